"""Slender bodies that peel off: sets that an interior point proposes where full steps change few at
a time.
"""

import gc
import inspect

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc
from scenes import alone

from signorini_fx.algebra.linalg import petsc_calls
from signorini_fx.extensions import register
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

LENGTH, WEIGHT, YOUNG = 10.0, 0.16, 1e6


def heavy_beam(h, *, cells=200, degree=2, unit=1.0, friction=None, **solver):
    """A beam on a foundation whose end is lifted, its slope kept; ``unit``: of length."""
    lift = WEIGHT * 5.0**4 / (2 * YOUNG * h**3)
    contact = {"boundary": "bottom", "gap": 0.0} | (
        {} if friction is None else {"friction": friction}
    )
    parameters = {"length": LENGTH * unit, "height": h * unit, "nx": cells, "ny": 2}
    return parse_scene(
        {
            "mesh": {"generator": "rectangle", "parameters": parameters},
            "element": {"degree": degree},
            "material": {"young": YOUNG, "poisson": 0.0},
            "displacement": [{"boundary": "left", "x": 0.0, "y": lift * unit}],
            "body_force": {"y": -WEIGHT / h / unit},
            "contact": contact,
            "solver": solver,
        }
    )


def pressed(h):
    """The force of the foundation by the theory of beams, per length.

    With s the distance from the edge of contact EI v = w (l s^3 / 18 - s^4 / 24): v = v' = v'' = 0
    at s = 0 and v' = 0 at the end s = l, where v = w l^4 / (72 EI) and the end carries 2 w l / 3.
    """
    lift = WEIGHT * 5.0**4 / (2 * YOUNG * h**3)
    lifted = (72 * YOUNG * h**3 / 12 * lift / WEIGHT) ** 0.25
    return WEIGHT * (LENGTH - 2 * lifted / 3)


def proposals(solution):
    """How many times sets were proposed."""
    return sum(event.startswith("sets: ") for event in solution.history.events)


@pytest.mark.parametrize("h", [0.2, 0.1, 0.05])
def test_a_heavy_beam(h):
    """However thin it is, and with no fall-back; full steps alone take more than a hundred
    solves.
    """
    ours = alone(heavy_beam(h, fallbacks=False))
    assert proposals(ours) == 1
    assert ours.history.linear_solves <= 35
    # What shear and the stress across it change of a beam of 6.6 by h.
    np.testing.assert_allclose(ours.contact.forces[0][1], pressed(h), rtol=2 * (h / 6.6) ** 1.5)


@pytest.mark.mpi
@pytest.mark.parametrize("system", ["full", "krylov"])
def test_ranks(system):
    """The same sets on any number of ranks; and by loose solves of a Krylov method."""
    scene = heavy_beam(0.2, cells=100, degree=1, linear_algebra=system)
    ours, single = solve(scene, MPI.COMM_WORLD), alone(scene)
    assert proposals(ours) == 1
    assert ours.history.linear_solves <= 40
    np.testing.assert_allclose(
        ours.contact.forces[0], single.contact.forces[0], rtol=1e-8, atol=1e-10
    )


class Broken(Exception):
    """Raised by a test."""


class BreaksInside:
    """A direct solver that fails within an interior point."""

    def set_up(self, matrix):
        self.factor = PETSc.PC().create(matrix.comm)
        self.factor.setOperators(matrix)
        self.factor.setType(PETSc.PC.Type.LU)

    def solve(self, b, x):
        if any(frame.function == "_moves" for frame in inspect.stack()):
            raise Broken
        self.factor.apply(b, x)


def test_an_exception_of_a_preconditioner_within_an_interior_point():
    """Reaches the caller, and garbage is collected afterwards."""
    register("signorini_fx.linear_solvers", "breaks_inside", BreaksInside)
    with pytest.raises(Broken):
        solve(heavy_beam(0.1, linear_algebra="breaks_inside"))
    assert gc.isenabled()
    assert not petsc_calls._raised
