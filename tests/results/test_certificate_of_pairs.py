"""A solver that pairs two bodies wrongly does not get its result certified."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI
from two_bodies import assembled, facets, forms, grid

from signorini_fx import Status, solve
from signorini_fx.forms.contact_problem import ContactProblem
from signorini_fx.mechanics.interfaces import Pair
from signorini_fx.mechanics.laws.coulomb import Coulomb
from signorini_fx.mechanics.mesh.tagged import tag_boundaries
from signorini_fx.mechanics.obstacles import paired_points
from signorini_fx.results.solution import ConvergenceError
from signorini_fx.scenes.reading import parse_scene

COMM = MPI.COMM_WORLD
FACING = paired_points.FacingSides.of.__func__


def scene():
    """A block on another one, beyond whose end it stands out; the points are on the lower one, which is softer."""

    def mesh(count):
        parameters = {"length": 1.0, "height": 1.0, "nx": count, "ny": count, "cell": "quadrilateral"}
        return {"generator": "rectangle", "parameters": parameters}

    return parse_scene(
        {
            "body": [
                {"name": "lower", "mesh": mesh(6)},
                {"name": "upper", "mesh": mesh(4), "shift": [0.25, 1.0]},
            ],
            "material": [
                {"region": "lower", "young": 100.0, "poisson": 0.3},
                {"region": "upper", "young": 200.0, "poisson": 0.3},
            ],
            "displacement": [{"boundary": "lower.bottom", "x": 0.0, "y": 0.0}],
            "traction": {"boundary": "upper.top", "x": 0.05, "y": "-(1 + 0.3*x[0])"},
            "contact": {
                "boundary": "upper.bottom",
                "against": "lower.top",
                "friction": {"law": "coulomb", "coefficient": 0.3},
            },
        }
    )


def with_facets(change):
    """Pair other facets than those of the scene; ``change``: of the x[0] of their middles, which of them stay."""

    def facing(cls, space, facets, *rest):
        from dolfinx.mesh import compute_midpoints

        sides = [
            side[change[k](compute_midpoints(space.mesh, 1, side)[:, 0])] if change[k] else side
            for k, side in enumerate(facets)
        ]
        return FACING(cls, space, tuple(sides), *rest)

    return facing


FACETS = {
    "a facet of the points is missing": (lambda x: np.abs(x - 0.6) > 0.1, None),
    "a facet of the other side is missing": (None, lambda x: np.abs(x - 0.6) > 0.1),
}


@pytest.mark.mpi
def test_what_is_right_is_certified():
    """The identities of the map hold to round-off."""
    found = solve(scene(), COMM, check=False)
    assert found.status is Status.CONVERGED
    assert found.certificate.coupling < 1e-10


@pytest.mark.mpi
@pytest.mark.parametrize("name", FACETS)
def test_a_facet_is_missing(name, monkeypatch):
    """All balance forces and moments, but the facets are not those that the scene names."""
    monkeypatch.setattr(paired_points.FacingSides, "of", classmethod(with_facets(FACETS[name])))
    found = solve(scene(), COMM, check=False)
    assert found.status is Status.NOT_CERTIFIED
    assert found.certificate.coupling == 1.0


def opening(reach=None):
    """Forms of a user: a block on another one, with a wedge between them that opens towards the end, pressed down by
    more than the wedge is high.
    """
    slope, blocks = 0.01, (((6, 6), (0.0, 0.0), (1.0, 1.0)), ((4, 4), (0.0, 1.0), (1.0, 2.0)))
    tilted = None, lambda x: x + np.outer(slope * x[:, 0], (0.0, 1.0))
    lower, upper = (grid("quadrilateral", *block, place) for block, place in zip(blocks, tilted, strict=True))
    mesh = assembled("quadrilateral", lower, upper, comm=COMM)
    space, a, v = forms(mesh, 1, 100.0)
    bottom, slave, master, top = (
        facets(mesh, lambda x, at=at, slope=slope: np.isclose(x[1], at + slope * x[0]))
        for at, slope in ((0.0, 0.0), (1.0, 0.0), (1.0, slope), (2.0, slope))
    )
    bcs = [
        fem.dirichletbc(np.array(moved), fem.locate_dofs_topological(space, 1, side), space)
        for side, moved in ((bottom, (0.0, 0.0)), (top, (0.0, -2 * slope)))
    ]
    nothing = ufl.inner(fem.Constant(mesh, (0.0, 0.0)), v) * ufl.dx
    return ContactProblem(a, nothing, bcs, contact=Pair(slave, master, friction=Coulomb(0.3), reach=reach))


@pytest.mark.mpi
@pytest.mark.parametrize("name", FACETS)
def test_facets_that_the_user_named_are_missing(name, monkeypatch):
    """The user's forms: the certificate takes both sides from ``Pair``, not from what the solver has paired."""
    monkeypatch.setattr(paired_points.FacingSides, "of", classmethod(with_facets(FACETS[name])))
    problem = opening()
    with pytest.raises(ConvergenceError):
        problem.solve()
    assert problem.status is Status.NOT_CERTIFIED
    assert problem.certificate.coupling == 1.0


@pytest.mark.one_quick
@pytest.mark.parametrize("degree", [1, 2])
def test_faces_that_are_no_parallelograms(degree):
    """Integrands are no polynomials there; the identities hold."""

    def block(counts, low, twist):
        def place(x):
            return x + 16 * np.outer(np.prod(x[:, :2] * (1 - x[:, :2]), axis=1), twist)

        mesh = assembled("hexahedron", grid("hexahedron", counts, (0, 0, low), (1, 1, low + 1), place))
        return tag_boundaries(mesh, {"bottom": f"abs(x[2] - {low}) < 1e-9", "top": f"abs(x[2] - {low + 1}) < 1e-9"})

    found = solve(
        parse_scene(
            {
                "body": [
                    {"name": "lower", "mesh": block((2, 2, 1), 0, [0.2, -0.1, 0.0])},
                    {"name": "upper", "mesh": block((3, 3, 1), 1, [-0.2, 0.07, 0.0])},
                ],
                "element": {"degree": degree},
                "material": {"young": 100.0, "poisson": 0.3},
                "displacement": {"boundary": "lower.bottom", **dict.fromkeys("xyz", 0.0)},
                "traction": {"boundary": "upper.top", "x": 1.0, "z": "-1 - x[0]"},
                "contact": {"boundary": "upper.bottom", "against": "lower.top", "kind": "bonded"},
            }
        ),
        MPI.COMM_SELF,
    )
    assert found.converged
    assert found.certificate.coupling < 1e-8
