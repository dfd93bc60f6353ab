"""A solver that pairs two bodies wrongly does not get its result certified."""

from dataclasses import replace

import numpy as np
import paired_integrals
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI
from two_bodies import assembled, facets, facets_of_piece, forms, grid

from signorini_fx import Status, solve
from signorini_fx.forms.contact_problem import ContactProblem
from signorini_fx.machine import parallel
from signorini_fx.mechanics.interfaces.pair import Pair
from signorini_fx.mechanics.laws.coulomb import Coulomb
from signorini_fx.mechanics.mesh.tagged import tag_boundaries
from signorini_fx.mechanics.obstacles import paired_points
from signorini_fx.mechanics.pairs import mortar_coupling as coupling
from signorini_fx.results.solution import ConvergenceError
from signorini_fx.scenes.reading import parse_scene

COMM = MPI.COMM_WORLD
COUPLE, PAIRED = paired_points.couple, paired_points.PairedSides.of.__func__
USUAL = coupling.default_reach


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

    def paired(cls, space, pair, facets, *rest):
        from dolfinx.mesh import compute_midpoints

        sides = [
            side[change[k](compute_midpoints(space.mesh, 1, side)[:, 0])] if change[k] else side
            for k, side in enumerate(facets)
        ]
        return PAIRED(cls, space, pair, tuple(sides), *rest)

    return paired


def point_left_out(slave, master, *rest, **settings):
    """Without the point at x[0] = 1/2, and without its area."""
    found = COUPLE(slave, master, *rest, **settings)
    return kept_of(found, ~np.isclose(slave.x[found.nodes, 0], 0.5))


def kept_of(found, keep):
    """Some points of a coupling, as if they were all."""
    rows = np.repeat(keep, 2)
    lost = parallel.global_sum(COMM, found.weight[~keep].sum())
    assert lost > 0.1
    kept = {
        name: getattr(found, name)[keep]
        for name in ("nodes", "weight", "normal", "distance", "slave", "master", "centre")
    }
    kept |= {name: getattr(found, name)[rows] for name in ("slave_turning", "master_turning")}
    return replace(found, **kept, alone=found.alone[keep], covered=found.covered - float(lost))


def smaller(slave, master, *rest, **settings):
    """Areas that are too small, of points that all have taken over functions of others, as they say."""
    found = COUPLE(slave, master, *rest, **settings)
    return replace(found, weight=0.9 * found.weight, covered=0.9 * found.covered, alone=np.zeros_like(found.alone))


CHANGES = {
    "right": (None, None),
    "a facet of the points is missing": ((lambda x: np.abs(x - 0.6) > 0.1, None), None),
    "a facet of the other side is missing": ((None, lambda x: np.abs(x - 0.6) > 0.1), None),
    "a point is missing": (None, point_left_out),
    "areas": (None, smaller),
}


@pytest.mark.mpi
@pytest.mark.parametrize("name", CHANGES)
def test_a_wrong_pairing_is_noticed(name, monkeypatch):
    """All balance forces and moments, and what is missing is missing for solver and certificate alike."""
    paired_integrals.tried_by(monkeypatch)
    facets, couple = CHANGES[name]
    if facets is not None:
        monkeypatch.setattr(paired_points.PairedSides, "of", classmethod(with_facets(facets)))
    if couple is not None:
        monkeypatch.setattr(paired_points, "couple", couple)
    found = solve(scene(), COMM, check=False)
    if name == "right":
        assert found.status is Status.CONVERGED
        assert found.certificate.coupling < 1e-10
        return
    assert found.status is Status.NOT_CERTIFIED
    assert found.certificate.coupling > 0.09


@pytest.mark.mpi
@pytest.mark.parametrize("name", [name for name, (facets, _) in CHANGES.items() if facets])
def test_a_facet_is_missing(name, monkeypatch):
    """Without any integral that is computed again: the facets are those that the scene names, or not."""
    monkeypatch.setattr(paired_points.PairedSides, "of", classmethod(with_facets(CHANGES[name][0])))
    found = solve(scene(), COMM, check=False)
    assert found.status is Status.NOT_CERTIFIED
    assert found.certificate.coupling == 1.0


@pytest.mark.mpi
def test_a_point_is_missing_beside_others(monkeypatch):
    """Its facets must not be covered: noticed without any area that is tried."""
    paired_integrals.tried_by(monkeypatch)
    monkeypatch.setattr(paired_integrals, "_areas", lambda *_: (np.zeros(0, dtype=np.int64), np.zeros(0)))
    monkeypatch.setattr(paired_points, "couple", point_left_out)
    assert solve(scene(), COMM, check=False).certificate.coupling == 1.0


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
@pytest.mark.parametrize("name", [name for name, (facets, _) in CHANGES.items() if facets])
def test_facets_that_the_user_named_are_missing(name, monkeypatch):
    """The user's forms: the certificate takes both sides from ``Pair``, not from what the solver has paired."""
    monkeypatch.setattr(paired_points.PairedSides, "of", classmethod(with_facets(CHANGES[name][0])))
    problem = opening()
    with pytest.raises(ConvergenceError):
        problem.solve()
    assert problem.status is Status.NOT_CERTIFIED
    assert problem.certificate.coupling == 1.0


@pytest.mark.mpi
@pytest.mark.parametrize("reach", [None, 0.5])
@pytest.mark.parametrize("factor", [1.0, 0.01, 100.0])
def test_a_wrong_reach_is_noticed(factor, reach, monkeypatch):
    """With too small a reach the bodies pass through each other beyond their first facets, and all balances hold."""

    def wrong(slave, master, *rest, reach=None, **settings):
        return COUPLE(
            slave, master, *rest, reach=factor * (USUAL(slave.x, master.x) if reach is None else reach), **settings
        )

    monkeypatch.setattr(paired_points, "couple", wrong)
    problem = opening(reach)
    if factor == 1.0:
        problem.solve()
        assert problem.certificate.coupling < 1e-10
        return
    with pytest.raises(ConvergenceError):
        problem.solve()
    assert problem.status is Status.NOT_CERTIFIED
    assert problem.certificate.coupling > 0.9


def feet():
    """Forms of a user: two feet on a plate, pressed down; the left side of one is held, beyond the end of the plate,
    which just reaches beyond a node.
    """
    blocks = ((7, 3), (0.276, 0.0), (3.0, 1.0)), ((20, 3), (0.2, 1.0), (1.0, 2.0)), ((4, 3), (2.0, 1.0), (2.8, 2.0))
    mesh = assembled("quadrilateral", *(grid("quadrilateral", *block) for block in blocks), comm=COMM)
    space, a, v = forms(mesh, 1, 100.0)
    top, side, bottom = (
        facets(mesh, lambda x, k=k, at=at: np.isclose(x[k], at)) for k, at in ((1, 2.0), (0, 0.2), (1, 0.0))
    )
    sides = [
        facets_of_piece(mesh, lambda x: np.isclose(x[1], 1.0), lambda x, upper=upper: (x[1] > 1.0) == upper)
        for upper in (True, False)
    ]
    down, still = (0.0, -0.02), (0.0, 0.0)
    bcs = [
        fem.dirichletbc(np.array(moved), fem.locate_dofs_topological(space, 1, there), space)
        for there, moved in ((bottom, still), (top, down), (side, down))
    ]
    nothing = ufl.inner(fem.Constant(mesh, still), v) * ufl.dx
    return ContactProblem(a, nothing, bcs, contact=Pair(*sides, friction=Coulomb(0.3)))


def one_foot(slave, master, *rest, **settings):
    """Without all points of the foot on the right, and without its area."""
    found = COUPLE(slave, master, *rest, **settings)
    return kept_of(found, slave.x[found.nodes, 0] < 1.5)


def lighter(slave, master, *rest, **settings):
    """Half the area of the points that have taken over functions, and as much less of the whole."""
    found = COUPLE(slave, master, *rest, **settings)
    assert parallel.global_sum(COMM, np.count_nonzero(~found.alone)) == 1
    weight = found.weight * np.where(found.alone, 1.0, 0.5)
    return replace(found, weight=weight, covered=float(parallel.global_sum(COMM, weight.sum())))


@pytest.mark.mpi
@pytest.mark.parametrize(("change", "least"), [(None, 0.0), (one_foot, 0.4), (lighter, 0.1)])
def test_points_that_no_others_miss(change, least, monkeypatch):
    """A foot that stands alone loses all of its points, and none of the others has a facet with one that is lost; a
    point that has taken over the function of a node at the end has a wrong area.  Forces and moments of what is left
    balance.
    """
    paired_integrals.tried_by(monkeypatch)
    monkeypatch.setattr(paired_points, "couple", COUPLE if change is None else change)
    if change is one_foot:  # few of all nodes are tried, as of larger meshes
        monkeypatch.setattr(paired_integrals, "_SAMPLED", dict.fromkeys(paired_integrals._SAMPLED, 3))
    problem = feet()
    if change is None:
        problem.solve()
        assert problem.certificate.coupling < 1e-10
        return
    with pytest.raises(ConvergenceError):
        problem.solve()
    assert problem.status is Status.NOT_CERTIFIED
    assert problem.certificate.coupling > least


@pytest.mark.parametrize("degree", [1, 2])
def test_faces_that_are_no_parallelograms(degree, monkeypatch):
    """Integrands are no polynomials there; solver and oracle, whose rules differ, integrate them alike."""
    paired_integrals.tried_by(monkeypatch)

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
