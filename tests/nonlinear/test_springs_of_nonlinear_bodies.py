"""Nonlinear bodies on springs: closed forms and resultants."""

import numpy as np
import pytest
from mpi4py import MPI
from scene_tables import fixed
from scipy.optimize import root
from support.nonlinear_scenes import cube, grown_energy, material

from signorini_fx import solve

STIFFNESS = 80.0


def sprung_cube(law, springs, comm=MPI.COMM_SELF, **further):
    """A unit cube that may slide on two of its sides, and that springs hold at others."""
    held = [fixed("front", "y"), fixed("left", "x")]
    return solve(cube(law, **({"springs": springs, "displacement": held} | further)), comm)


def squeezed(name, pressure, expansion=0.0):
    """The stretches along and across a block under a pressure on its deformed ends, in energies of
    stretches.
    """
    stored, grown = grown_energy(name, expansion), 1 + expansion

    def unbalanced(stretches, step=1e-5):
        along, across = stretches
        pull = (stored(along + step, across) - stored(along - step, across)) / (2 * step)
        aside = (stored(along, across + step) - stored(along, across - step)) / (2 * step)
        return pull + pressure * across**2, aside

    solved = root(unbalanced, (grown, grown), tol=1e-13)
    assert np.abs(unbalanced(solved.x)).max() < 1e-9
    return solved.x


@pytest.mark.mpi
@pytest.mark.one_quick("keys", [{"z": STIFFNESS}, {"normal": STIFFNESS}])
def test_a_warm_cube_under_a_pressure_that_follows_it(keys):
    """The springs below carry the pressure on the top, which is larger the wider this is; both are
    on sides that move, and the cube becomes warmer.
    """
    name, pressure, expansion = "mooney-rivlin", 15.0, 0.05
    solution = sprung_cube(
        material(name, expansion=0.01),
        {"boundary": "bottom", **keys},
        MPI.COMM_WORLD,
        traction={"boundary": "top", "pressure": pressure, "factors": [0.5, 1.0]},
        temperature={"change": 5.0},
        load_steps={"times": [1.0, 2.0]},
    )
    x, dim = solution.model.space.tabulate_dof_coordinates(), 3
    for step, share in zip(solution.steps, (0.5, 1.0), strict=True):
        along, across = squeezed(name, share * pressure, expansion)
        sunk = share * pressure * across**2 / STIFFNESS
        moved = step.displacement.x.array.reshape(-1, dim)
        assert np.abs(moved[:, 2] - ((along - 1) * x[:, 2] - sunk)).max() < 1e-7
        assert np.abs(moved[:, 0] - (across - 1) * x[:, 0]).max() < 1e-7
        carried = solution.at(step).resultants.of("bottom").force
        assert carried == pytest.approx([0.0, 0.0, share * pressure * across**2], abs=1e-6)


def test_metal_on_springs():
    """It yields as its pull says, and springs along its end keep that from becoming thinner."""
    law = {"law": "j2", "young": 100.0, "poisson": 0.3, "yield_stress": 1.0, "hardening": 20.0}
    free = [fixed("front", "y"), fixed("bottom", "z")]
    pull = {"boundary": "right", "x": 2.0}
    smooth, rough = (
        sprung_cube(
            law,
            {"boundary": "left", "normal": STIFFNESS, **along},
            displacement=free,
            traction=pull,
        )
        for along in ({}, {"tangential": 2 * STIFFNESS})
    )
    x = smooth.model.space.tabulate_dof_coordinates()
    moved, held = (solution.displacement.x.array.reshape(-1, 3) for solution in (smooth, rough))
    strain = 2.0 / 100.0 + (2.0 - 1.0) / 20.0
    assert moved[:, 0] == pytest.approx(2.0 / STIFFNESS + strain * x[:, 0], rel=1e-9)
    end = np.isclose(x[:, 0], 0.0)
    assert np.abs(held[end, 1:]).max() < 0.5 * np.abs(moved[end, 1:]).max()
    assert rough.resultants.of("left").force[0] == pytest.approx(-2.0, rel=1e-9)
