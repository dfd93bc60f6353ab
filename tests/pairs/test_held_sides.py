"""Sides of two bodies with nodes that supports hold: these push the other body, whichever side has the points.

The reference is the problem with both sides exchanged, where the points are on the side that is free.
"""

from dataclasses import replace

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from scipy import sparse
from support.sliding_bodies import SlidingBodies, as_linear_bodies, turn_of
from two_bodies import assembled, facets, facets_of_cells, grid

from signorini_fx import ContactProblem, ConvergenceError, Coulomb, Pair, Scene, Status, solve
from signorini_fx.mechanics.obstacles import sliding_sides
from signorini_fx.mechanics.obstacles.paired_points import FacingSides
from signorini_fx.mechanics.pairs import mortar_coupling
from signorini_fx.mechanics.pairs.dual_functions import EvenRedistribution
from signorini_fx.mechanics.pairs.fixed_distances import FixedDistances
from signorini_fx.mechanics.pairs.sliding import fixed_by_supports, slide
from signorini_fx.results.certificate.held_distances import DisplacedSide

DEPTH = 0.02
KINDS = {2: "quadrilateral", 3: "hexahedron"}


def plate(dim, kind=None, cells=3, finer=1, upto=0.0, **settings):
    """A plate of the length 1 and the thickness 0.1, held where x[0] is at most ``upto``, above a block that is held
    below.

    Args:
        dim: of space.
        kind: of the cells.
        cells: of the block along each edge of its upper side.
        finer: by what the plate has more cells.
        upto: see above.
        settings: see ``SlidingBodies``.
    """
    kind, up, away = kind or KINDS[dim], dim - 1, 1e-6  # which tells the nodes of both sides apart
    low, high = [0.0] * (dim - 1), [1.0] * (dim - 1)
    bodies = (
        grid(kind, (*[cells] * (dim - 1), 2), [*low, -1.0], [*high, 0.0]),
        grid(kind, (*[finer * cells] * (dim - 1), 1), [*low, away], [*high, 0.1]),
    )
    touching = [lambda x: np.isclose(x[up], 0.0), lambda x: np.isclose(x[up], away)]
    held = [lambda x: np.isclose(x[up], -1.0), lambda x: (x[0] <= upto + 1e-9) & (x[up] >= away / 2)]
    return SlidingBodies(kind, bodies, touching, held, reach=0.5, **settings)


def pressed(scene, depth=DEPTH):
    """The force across the sides on the lower body, of bodies that slide and of linear ones."""
    force = scene.move(*[0.0] * (len(scene.u) - 1), -depth)[-1]
    linear = sum(as_linear_bodies(scene).state.forces)[-1]
    return np.abs([force, linear])


@pytest.mark.parametrize(
    ("dim", "kind", "upto"),
    [
        (2, "quadrilateral", 0.0),
        (2, "triangle", 0.34),
        (3, "hexahedron", 0.0),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in (
                (2, "quadrilateral", 0.34),
                (2, "triangle", 0.0),
                (3, "hexahedron", 0.34),
                (3, "tetrahedron", 0.0),
                (3, "tetrahedron", 0.34),
            )
        ),
    ],
)
def test_both_choices_of_the_slave(dim, kind, upto):
    """An edge that is held, and a third of the side, on coarse meshes that match: linear bodies have one force, and
    those that slide differ by what turns.
    """
    slid, linear = np.transpose([pressed(plate(dim, kind, upto=upto, slave=slave)) for slave in (0, 1)])
    assert slid[1] == pytest.approx(slid[0], rel=0.005)
    assert linear[1] == pytest.approx(linear[0], rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("dim", [2, 3])
def test_meshes_that_do_not_match(dim):
    """What both choices differ by falls with the mesh."""
    apart = []
    for cells in (3, 6, 12)[: 5 - dim]:
        forces = [pressed(plate(dim, cells=cells, finer=2, upto=0.34, slave=slave)) for slave in (0, 1)]
        apart.append(np.abs(forces[1] / forces[0] - 1).max())
    assert apart[-1] < 0.05
    assert apart[-1] < 0.6 * apart[0]


def punch(dim, cells, **settings):
    """A parabola below a body of which all nodes are held, and a block with six cells below it that is held below."""
    up, away = dim - 1, 1e-6

    def height(x):
        return 0.1 * np.sum(x[:up] ** 2, axis=0)

    def bent(x):
        return np.column_stack((x[:, :up], x[:, up] + height(x.T) * (0.3 - x[:, up]) / 0.3))

    bodies = (
        grid(KINDS[dim], (*[6] * up, 3), [*[-0.75] * up, -1.0], [*[0.75] * up, 0.0]),
        grid(KINDS[dim], (*[cells] * up, 1), [*[-0.5] * up, away], [*[0.5] * up, 0.3], bent),
    )
    touching = [lambda x: np.isclose(x[up], 0.0), lambda x: x[up] <= height(x) + 2 * away]
    held = [lambda x: np.isclose(x[up], -1.0), lambda x: x[up] >= away / 2]
    return SlidingBodies(KINDS[dim], bodies, touching, held, reach=0.5, **settings)


@pytest.mark.parametrize(
    ("dim", "cells"),
    [(2, 7), (2, 14), *(pytest.param(3, cells, marks=pytest.mark.slow) for cells in (7, 10))],
)
def test_a_side_that_is_held_everywhere(dim, cells):
    """With all of its nodes held a slave is a rigid body, also where it has more nodes than the block that it dents:
    pressed down and along with friction, it has the forces of a rigid master.
    """
    forces, way = [], [0.01, *[0.0] * (dim - 2), -0.02]
    for slave in (0, 1):
        scene = punch(dim, cells, slave=slave, friction=Coulomb(0.3), algorithm="alm")
        forces.append([scene.move(*way), sum(as_linear_bodies(scene).state.forces)])
        assert max(scene.iterations) <= 6
    assert np.abs(forces[0])[:, 0].min() > 0.1 * np.abs(forces[0]).max()
    # More points hold the dent closer to the parabola.
    assert -np.array(forces[1]) == pytest.approx(np.array(forces[0]), abs=0.055 * np.abs(forces).max())


@pytest.mark.slow
@pytest.mark.parametrize(
    "method", [{"algorithm": "ssn"}, {"linear_algebra": "krylov"}, {"linear_algebra": "full"}, {"coulomb": "newton"}]
)
@pytest.mark.parametrize("dim", [2, 3])
def test_methods(dim, method):
    """All methods have one force, with more held points than there are nodes below them."""
    scene = punch(dim, 14 if dim == 2 else 7, slave=1, friction=Coulomb(0.3))
    scene.move(0.01, *[0.0] * (dim - 2), -0.03)
    forces = [sum(as_linear_bodies(scene, **settings).state.forces) for settings in ({}, method)]
    assert forces[1] == pytest.approx(forces[0], abs=1e-3 * np.abs(forces[0]).max())


def shelf(dim, slave, finer=2, comm=MPI.COMM_SELF):
    """A block and a plate on it that are both held where x[0] = 0, the block at its other end, too."""
    kind, up, away = KINDS[dim], dim - 1, 1e-6
    low, high = [0.0] * up, [1.0] * up
    bodies = (
        grid(kind, (*[3] * up, 2), [*low, -1.0], [*high, 0.0]),
        grid(kind, (*[3 * finer] * up, 1), [*low, away], [*high, 0.3]),
    )
    touching = [lambda x: np.isclose(x[up], 0.0), lambda x: np.isclose(x[up], away)]
    held = [lambda x: (x[up] <= 0) & np.isclose(x[0], 0.0), lambda x: (x[up] > 0) & np.isclose(x[0], 0.0)]
    return SlidingBodies(kind, bodies, touching, held, slave=slave, reach=0.5, comm=comm)


def told(scene):
    """What is told of nodes that supports hold."""
    return [found.message for found in scene.problem.findings if "supports hold" in found.message]


@pytest.mark.one_quick
@pytest.mark.mpi(slow=True)
@pytest.mark.parametrize("slave", [0, 1])
@pytest.mark.parametrize("dim", [2, 3])
def test_where_both_sides_are_held(dim, slave):
    """Where nothing can move nothing is transmitted, and the user is told the place and the depth, on all ranks; not
    where the bodies part.  Along the edge the sides of both are as in a plane of symmetry, of both choices.
    """
    scene = shelf(dim, slave, comm=MPI.COMM_WORLD)
    still = [0.0] * (dim - 1)
    scene.move(*still, DEPTH)
    assert not told(scene)
    scene.move(*still, -DEPTH)
    (message,) = told(scene)
    count = 1 if dim == 2 else (4, 7)[slave]
    assert message.startswith(f"supports hold {count} contact node{'s' * (count > 1)} inside the other body, by 0.0")
    assert " at (0, " in message
    depth = float(message.split(" by ")[1].split()[0])
    assert depth == pytest.approx(DEPTH, rel=0.03)
    assert len(set(MPI.COMM_WORLD.allgather(message))) == 1


def clamped(dim, slave, part, *, end=False, cells=(8, 8), plate_held=False, shift=0.0, comm=MPI.COMM_SELF, **settings):
    """A plate on a block, both held where x[0] is at most ``part``.

    Args:
        dim: of space.
        slave: the body with the points.
        part: see above.
        end: whether the sides end there.
        cells: of block and plate along x[0].
        plate_held: whether the plate is held everywhere.
        shift: of the plate along x[0].
        comm: the ranks.
        settings: see ``SlidingBodies``.
    """
    up, away, first = dim - 1, 1e-6, part if end else 0.0
    low, high = [0.0] * up, [1.0] * up

    def moved(x):
        return x + shift * np.eye(dim)[0]

    bodies = (
        grid(KINDS[dim], (cells[0], *[2] * (dim - 2), 2), [*low, -1.0], [*high, 0.0]),
        grid(KINDS[dim], (cells[1], *[2] * (dim - 2), 2), [*low, away], [*high, 0.3], moved),
    )
    touching = [
        lambda x, y=y, s=s: np.isclose(x[up], y, atol=1e-9) & (x[0] >= first + s - 1e-9)
        for y, s in ((0.0, 0.0), (away, shift))
    ]
    held = [
        lambda x: (x[up] <= away / 2) & (np.isclose(x[up], -1.0) | (x[0] <= part + 1e-9)),
        lambda x: (x[up] >= away / 2) & ((x[0] <= part + shift + 1e-9) | plate_held),
    ]
    return SlidingBodies(KINDS[dim], bodies, touching, held, slave=slave, reach=0.5, comm=comm, **settings)


@pytest.mark.parametrize("slave", [0, 1])
@pytest.mark.parametrize(
    ("dim", "part", "cells"),
    [
        (2, 0.5, (8, 8)),
        (2, 0.25, (8, 16)),
        *(
            pytest.param(dim, part, cells, marks=pytest.mark.slow)
            for dim, part, cells in ((2, 0.75, (8, 8)), (2, 0.75, (16, 8)), (3, 0.5, (8, 8)))
        ),
    ],
)
def test_a_region_in_which_both_sides_are_held(dim, part, cells, slave):
    """What overlaps there pushes nothing beside it: forces are those of sides that end before the region, in small
    strains exactly, else but for the normals at the border, which turn where no plane of symmetry ends the sides: by
    an angle that falls with the depth, and with its square the force; and the user is told of all of it.
    """
    for share in (1 / 16, 1.0):
        scenes = [clamped(dim, slave, part, end=end, cells=cells) for end in (False, True)]
        with_region, without = (pressed(scene, share * DEPTH) for scene in scenes)
        assert with_region[1] == pytest.approx(without[1], rel=1e-8)
        assert with_region[0] == pytest.approx(without[0], rel=1e-2 * share**2)
        assert with_region.min() > 0.1 * share
    count = round(part * cells[slave] + 1) * (1 if dim == 2 else 3)
    assert told(scenes[0])[0].startswith(f"supports hold {count} contact nodes inside the other body, by 0.0")


@pytest.mark.parametrize("slave", [0, 1])
@pytest.mark.parametrize(
    ("dim", "part", "degree"),
    [(2, 0.0, 1), (2, 0.5, 1), (2, 0.5, 2), *(pytest.param(3, part, 1, marks=pytest.mark.slow) for part in (0.0, 0.5))],
)
def test_the_nodes_beside_such_a_region(dim, part, degree, slave):
    """Where meshes match, each node beside an edge or a region that supports hold inside the other body touches that
    with its own distance, as if the overlap there were none: it is closed where there is a pressure, else apart.
    """
    scene = clamped(dim, slave, part, degree=degree)
    scene.drive.value[-1] = -DEPTH
    linear = as_linear_bodies(scene)
    up, moved = dim - 1, linear.solve()
    x, y = moved.function_space.tabulate_dof_coordinates(), moved.x.array.reshape(-1, dim)[:, up]
    free = x[:, 0] > part + 1e-9
    upper, lower = (np.flatnonzero(free & np.isclose(x[:, up], at, rtol=0.0, atol=1e-9)) for at in (1e-6, 0.0))
    upper, lower = (nodes[np.lexsort(np.round(x[nodes, :up].T, 9))] for nodes in (upper, lower))
    gap = 1e-6 + y[upper] - y[lower]
    assert gap.min() > -1e-9 * DEPTH
    points = linear.state.boundary.x
    rows = [int(np.flatnonzero(np.isclose(points[:, :up], at[:up], atol=1e-9).all(axis=1))[0]) for at in x[upper]]
    pressure = linear.state.pressure[rows]
    assert pressure.max() > 0.1
    assert np.abs(gap[pressure > 0]).max() < 1e-9 * DEPTH


@pytest.mark.parametrize("cells", [(4, 12), pytest.param((5, 16), marks=pytest.mark.slow)])
def test_a_side_that_is_held_everywhere_over_such_a_region(cells):
    """The facets of the block beside its held part are so long that the nodes of the plate, of which all are held, see
    the overlap at the border through them: the force is that of the points of the block, and of a plate with its nodes.
    """
    scenes = [
        clamped(2, slave, 0.5, cells=of, plate_held=True) for slave, of in ((0, cells), (1, cells), (1, cells[:1] * 2))
    ]
    for scene in scenes:
        scene.drive.value[-1] = -DEPTH
    forces = np.abs([sum(as_linear_bodies(scene).state.forces)[-1] for scene in scenes])
    assert forces[1:] == pytest.approx(forces[0], rel=0.15)


@pytest.mark.parametrize("slave", [0, 1])
@pytest.mark.parametrize(
    ("region", "beside", "moves"),
    [(0.004, 0.0, False), (0.0029, 0.006, True)],
)
def test_adjusted_sides_beside_such_a_region(region, beside, moves, slave):
    """Which points ``adjust`` closes is said by their own distance, not by that of what supports hold apart: sides that
    touch beside stay without forces, and those that are too far apart there are as without.
    """

    def height(x):
        return np.where(x[0] <= 0.5 + 1e-9, region, beside) + 1e-6

    def bent(x):
        return np.column_stack((x[:, 0], x[:, 1] + height(x.T) * (0.3 - x[:, 1]) / 0.3))

    bodies = (
        grid("quadrilateral", (8, 2), [0.0, -1.0], [1.0, 0.0]),
        grid("quadrilateral", (8, 2), [0, 0], [1, 0.3], bent),
    )
    touching = [lambda x: np.isclose(x[1], 0.0, atol=1e-9), lambda x: np.isclose(x[1], height(x), atol=1e-9)]
    held = [
        lambda x: (x[1] < 5e-7) & (np.isclose(x[1], -1.0) | (x[0] <= 0.5 + 1e-9)),
        lambda x: (x[1] > 5e-7) & (x[0] <= 0.5 + 1e-9),
    ]
    scene, solved = SlidingBodies("quadrilateral", bodies, touching, held, slave=slave, reach=0.5), []
    scene.drive.value[-1] = -DEPTH if moves else 0.0
    for adjust in (0.003, None):
        scene.pair = Pair(scene.sides[slave], scene.sides[1 - slave], reach=0.5, adjust=adjust)
        solved.append(as_linear_bodies(scene))
        assert solved[-1].certificate.holds
    assert solved[0].state.pressure.any() == moves
    assert solved[0].u.x.array == pytest.approx(solved[1].u.x.array if moves else 0.0, abs=1e-9 * DEPTH)


@pytest.mark.parametrize("keeps", [False, True])
@pytest.mark.parametrize(("cells", "slave"), [((8, 8), 0), ((16, 8), 0), ((8, 16), 1)])
def test_a_bond_beside_such_a_region(cells, slave, keeps):
    """What supports move apart ends the bond there: its forces are those of sides that end before, of linear bodies and
    of nonlinear ones that keep their partners.
    """
    forces, way = [], [0.0005, -0.002]
    for end in (True, False):
        if keeps:
            scene = clamped(
                2, slave, 0.5, end=end, cells=cells, pair={"bonded": True, "sliding": False}, algorithm="alm"
            )
            forces.append(scene.move(*way))
            assert scene.problem.certificate.holds
        else:
            scene = clamped(2, slave, 0.5, end=end, cells=cells)
            scene.pair = Pair(scene.sides[slave], scene.sides[1 - slave], reach=0.5, bonded=True)
            scene.drive.value[:] = way
            linear = as_linear_bodies(scene)
            assert linear.certificate.holds
            forces.append(np.sum(linear.state.forces, axis=0))
    assert forces[1] == pytest.approx(forces[0], rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("dim", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_the_certificate_misses_overlap_beside_such_a_region(monkeypatch, dim):
    """A solver that counts what supports fix at the points beside is refused."""
    monkeypatch.setattr(sliding_sides, "fixed_by_supports", lambda *_: None)
    scene = clamped(dim, 0, 0.5)
    with pytest.raises(ConvergenceError):
        scene.move(*[0.0] * (dim - 1), -DEPTH)
    assert scene.problem.status is Status.NOT_CERTIFIED


@pytest.mark.parametrize("dim", [2, pytest.param(3, marks=pytest.mark.slow)])
@pytest.mark.parametrize("fault", ["given to another point", "given to nobody", "a point of its own"])
def test_the_certificate_misses_a_wrong_share(monkeypatch, dim, fault):
    """Who takes over the functions of held nodes is no word of the solver: another choice is refused."""
    right = EvenRedistribution.of

    def wrong(side, covered, weight, unable, movable=None):
        if fault == "a point of its own":
            return right(side, covered, weight, unable)
        carriers = right(side, covered, weight, unable, movable)
        shares = carriers.shares.tolil()
        for node in np.setdiff1d(np.flatnonzero(shares.sum(axis=0)), carriers.nodes):
            shares[:, node] = 0.0
            if fault == "given to another point":
                shares[[carriers.nodes.size - 1], node] = 1.0
        return replace(carriers, shares=shares.tocsr())

    monkeypatch.setattr(EvenRedistribution, "of", wrong)
    scene = clamped(dim, 0, 0.5)
    with pytest.raises(ConvergenceError):
        scene.move(*[0.0] * (dim - 1), -DEPTH)
    assert scene.problem.status is Status.NOT_CERTIFIED


def _scaled(factor):
    """Distances of which the points leave out so many times as much."""
    return lambda found: replace(found, met=factor * found.met)


def _moved(found):
    """Each distance counts where the one before it does."""
    return replace(found, met=found.met[:, np.roll(np.arange(found.met.shape[1]), 1)])


def _of_one_side(found):
    """Distances of the nodes of the slave alone."""
    count = np.count_nonzero(np.diff(found.slave.indptr) == 1)
    keep = sparse.diags_array((np.arange(found.met.shape[1]) < count // 2).astype(float))
    return replace(found, met=(found.met @ keep).tocsr())


def _farther(found):
    """Distances that supports fix in the undeformed body, larger than they are by a twentieth of the way; what changes
    of them is right.
    """
    return replace(found, offset=found.offset + DEPTH / 20)


@pytest.mark.parametrize(
    "fault",
    [lambda _: None, _scaled(0.5), _scaled(-1.0), _scaled(-3.0), _scaled(1.001), _moved, _of_one_side, _farther],
    ids=["none", "half", "wrong sign", "thrice the wrong sign", "a thousandth more", "moved", "one side", "farther"],
)
@pytest.mark.parametrize(
    ("dim", "cells", "slave"), [(2, (8, 12), 0), (2, (12, 8), 1), pytest.param(3, (8, 12), 0, marks=pytest.mark.slow)]
)
def test_the_certificate_of_linear_bodies_misses_overlap_beside_such_a_region(monkeypatch, dim, cells, slave, fault):
    """A solver that leaves out less or more of what supports fix than functions have of it, or nothing, is refused."""
    whole = FixedDistances.of

    def wrong(*given):
        found = whole(*given)
        return None if found is None else fault(found)

    scene = clamped(dim, slave, 0.5, cells=cells)
    scene.drive.value[-1] = -DEPTH
    assert as_linear_bodies(scene).certificate.coupling < 1e-9
    monkeypatch.setattr(FixedDistances, "of", wrong)
    with pytest.raises(ConvergenceError, match="certificate does not hold") as raised:
        as_linear_bodies(scene)
    assert raised.value.solution.certificate.coupling > 1e-4


@pytest.mark.parametrize("fault", ["given to another point", "given to nobody", "a point of its own", "all share"])
@pytest.mark.parametrize("dim", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_the_certificate_of_linear_bodies_misses_a_wrong_share(monkeypatch, dim, fault):
    """Who takes over the functions of held nodes is evaluated for linear bodies, too."""
    right = mortar_coupling.carried

    def wrong(side, covered, weight, unable):
        if fault == "a point of its own":
            return right(side, covered, weight, np.zeros_like(unable))
        nodes, shares = right(side, covered, weight, unable)
        shares = shares.tolil()
        for node in np.setdiff1d(np.flatnonzero(shares.sum(axis=0)), nodes):
            shares[:, node] = 1.0 / nodes.size if fault == "all share" else 0.0
            if fault == "given to another point":
                shares[[nodes.size - 1], node] = 1.0
        return nodes, shares.tocsr()

    scene = clamped(dim, 0, 0.5)
    scene.drive.value[-1] = -DEPTH
    monkeypatch.setattr(mortar_coupling, "carried", wrong)
    with pytest.raises(ConvergenceError, match="certificate does not hold") as raised:
        as_linear_bodies(scene)
    assert raised.value.solution.certificate.coupling > 1e-4


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(
    ("cells", "slave", "at"),
    [
        ((8, 8), 0, 0.0),
        ((16, 8), 0, 0.0),
        ((8, 16), 1, 0.0),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in (
                ((8, 8), 1, 0.0),
                ((16, 8), 1, 0.0),
                ((8, 16), 0, 0.0),
                ((8, 8), 0, 0.0625),
                ((8, 8), 1, 0.0625),
                ((16, 8), 0, 0.0625),
                ((8, 16), 1, 0.0625),
            )
        ),
    ],
)
def test_last_clamped_nodes_that_pass_each_other(cells, slave, at, sign):
    """The force of sides that slide is continuous in the place of one of them: where clamped nodes, or their middles,
    lie over each other it is that of a little before and after.
    """
    places = at * sign + np.array([-2e-5, -1e-5, 1e-5, 2e-5])
    before, last, first, behind = (
        np.abs(clamped(2, slave, 0.5, cells=cells, shift=place).move(0.0, -DEPTH)[-1]) for place in places
    )
    assert first == pytest.approx(last, rel=2e-3)
    # As smooth as to either side: two steps of this size are twice one.
    assert abs(first - last) <= 2.5 * max(abs(last - before), abs(behind - first)) + 1e-4 * last


@pytest.mark.parametrize("slave", [0, 1])
@pytest.mark.parametrize("cells", [(16, 8), (8, 16)])
def test_last_clamped_nodes_of_linear_bodies_that_pass_each_other(cells, slave):
    """So is that of linear bodies where clamped nodes lie over each other."""
    forces = []
    for place in (-1e-3, -1e-7, 0.0, 1e-7, 1e-3):
        scene = clamped(2, slave, 0.5, cells=cells, shift=place)
        scene.drive.value[-1] = -DEPTH
        forces.append(np.abs(sum(as_linear_bodies(scene).state.forces)[-1]))
    assert forces[1:4] == pytest.approx([forces[2]] * 3, rel=1e-5)
    assert forces[::4] == pytest.approx([forces[2]] * 2, rel=0.03)


@pytest.mark.parametrize("slave", [0, 1])
@pytest.mark.parametrize("shift", [0.07, -0.07])
@pytest.mark.parametrize("dim", [2, 3])
def test_held_nodes_of_one_side_over_held_facets(dim, shift, slave):
    """Where only one side has places whose distances are fixed, because the other one's held nodes see none, linear
    bodies have a solution, whose force is continuous in the place of one of them.
    """
    forces = []
    for place in (shift, shift + 1e-7):
        scene = clamped(dim, slave, 0.0, cells=(4, 6), shift=place)
        scene.drive.value[-1] = -DEPTH
        forces.append(np.abs(sum(as_linear_bodies(scene).state.forces)[-1]))
    assert forces[0] > 0.5
    assert forces[1] == pytest.approx(forces[0], rel=1e-5)


@pytest.mark.parametrize("part", [0.5, 0.0])
@pytest.mark.parametrize("dim", [2, 3])
def test_fixed_distances_turn_with_both_sides(dim, part):
    """Those of places between held nodes and others, too: by the held nodes, or by the normal of a single one; the
    rotation is also that of the certificate.
    """
    scene = clamped(dim, 0, part, shift=-0.03)
    scene.move(*[0.0] * dim)
    (pair,) = scene.problem.linear.pairs.values()
    # Planes of symmetry do not turn.
    sides = [replace(side.surface, across=0.0 * side.surface.across) for side in (pair.sides.slave, pair.sides.master)]
    found, held, turn = [], pair.sides.held, turn_of(0.7, dim)
    for rotation in (np.eye(dim), turn):
        moved = [side.displaced(side.x @ rotation.T - side.x) for side in sides]
        found.append(fixed_by_supports(*moved, held, 0.5))
        distances = found[-1].distance(*(side.x for side in moved))
        assert distances == pytest.approx(1e-6 * found[0].counted, abs=1e-10)
    assert found[1].counted == pytest.approx(found[0].counted, abs=1e-6)
    assert found[1].counted.min() < 0.9
    assert found[1].direction == pytest.approx(found[0].direction @ turn.T, abs=1e-9)
    for side, flags in zip(sides, (held.slave, held.master), strict=True):
        normals = side.directions, side.directions @ turn.T
        seen = DisplacedSide(side.nodes, side.x @ turn.T, side.x, normals, flags, None, side.functions.values)
        assert seen.turn == pytest.approx(turn, abs=1e-6)


@pytest.mark.parametrize("loose", [True, False])
def test_the_certificate_misses_what_is_said_to_be_held(monkeypatch, loose):
    """A solver that takes a side that slides for held where it is not is refused."""
    right = FacingSides.of

    def wrong(*given, **more):
        facing = right(*given, **more)
        held = facing.held
        if loose:
            held = replace(held, loose=(0.0 * held.loose[0], held.loose[1]))
        else:
            at = facing.slave.surface.x[:, 0]
            held = replace(held, slave=held.slave | (np.abs(at - at[~held.slave].min()) < 1e-9))
        return replace(facing, held=held)

    monkeypatch.setattr(FacingSides, "of", wrong)
    scene = clamped(2, 0, 0.5)
    with pytest.raises(ConvergenceError, match=r"certificate does not hold \(coupling"):
        scene.move(0.0, -DEPTH)


@pytest.mark.mpi
@pytest.mark.parametrize("dim", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_such_a_region_on_ranks(dim):
    """It is the same on any number of ranks."""
    alone, shared = (clamped(dim, 0, 0.5, comm=comm) for comm in (MPI.COMM_SELF, MPI.COMM_WORLD))
    assert pressed(shared) == pytest.approx(pressed(alone), rel=1e-8)
    assert told(shared) == told(alone)


@pytest.mark.mpi
def test_held_nodes_far_away_tell_how_a_side_turns():
    """Places between held nodes and others turn with all held nodes of their side, also where a rank's points are made
    of no such node: results are those of one rank.
    """

    def box(cells):
        return {"generator": "box", "parameters": {"nx": cells, "ny": cells, "nz": 1, "height": 0.5}}

    low = [{"boundary": f"low.{side}", "x": 0.0, "y": 0.0, "z": 0.0} for side in ("bottom", "left")]
    up = [{"boundary": "up.left", "x": 0.0, "y": 0.0, "z": -0.002}, {"boundary": "up.right", "z": -0.003}]
    scene = Scene(
        body=[{"name": "up", "mesh": box(3), "shift": [-0.07, 0.0, 0.5]}, {"name": "low", "mesh": box(2)}],
        material={"young": 100.0, "poisson": 0.3},
        displacement=[*low, *up],
        contact={"boundary": "up.bottom", "against": "low.top"},
    )
    solution, alone = solve(scene, MPI.COMM_WORLD), solve(scene, MPI.COMM_SELF)
    assert solution.certificate.coupling < 1e-10
    force, reference = (each.resultants.of("low.top").force for each in (solution, alone))
    np.testing.assert_allclose(force, reference, atol=1e-9 * np.abs(reference).max())


STRAIN, YOUNG_AND_LAME = 0.01, (100.0, 50.0)


def evenly_pressed(kind, degree, bodies, held, slave, sides=None):
    """Two blocks between smooth walls, pressed evenly, of which supports that move along hold some facets of both
    sides: the problem, and its displacement without these.

    Args:
        kind: of the cells.
        degree: of the displacement.
        bodies: cells and points of each.
        held: of each which facets of its side, from their middles, shape (f, d - 1).
        slave: which body has the points.
        sides: of each which facets are its side, likewise; None: all.
    """
    dim = bodies[0][1].shape[1]
    up, strain, (young, lame) = dim - 1, STRAIN, YOUNG_AND_LAME
    mesh, count = assembled(kind, *bodies), len(bodies[0][0])
    of_body = np.arange(count), np.arange(count, count + len(bodies[1][0]))
    all_facets = [facets_of_cells(mesh, lambda x: np.isclose(x[up], 0.0), cells) for cells in of_body]
    middles = [dmesh.compute_midpoints(mesh, up, listed)[:, :up] for listed in all_facets]
    held = [listed[chosen(at)] for listed, chosen, at in zip(all_facets, held, middles, strict=True)]
    if sides is not None:
        all_facets = [listed[chosen(at)] for listed, chosen, at in zip(all_facets, sides, middles, strict=True)]
    space = fem.functionspace(mesh, ("Lagrange", degree, (dim,)))
    exact = fem.Function(space)
    exact.interpolate(lambda x: np.stack([*[0.0 * x[0]] * up, -strain * x[up]]))
    ends = [*held, facets(mesh, lambda x: np.isclose(np.abs(x[up]), 1.0))]
    bcs = [fem.dirichletbc(exact, fem.locate_dofs_topological(space, up, end)) for end in ends]
    for axis in range(up):
        walls = facets(mesh, lambda x, axis=axis: np.isclose(x[axis], 0.0) | np.isclose(x[axis], 1.0))
        dofs = fem.locate_dofs_topological(space.sub(axis), up, walls)
        bcs.append(fem.dirichletbc(fem.Constant(mesh, 0.0), dofs, space.sub(axis)))
    u, v = ufl.TrialFunction(space), ufl.TestFunction(space)
    a = young * ufl.inner(ufl.sym(ufl.grad(u)), ufl.sym(ufl.grad(v))) * ufl.dx + lame * ufl.div(u) * ufl.div(v) * ufl.dx
    nothing = ufl.inner(fem.Constant(mesh, np.zeros(dim)), v) * ufl.dx
    pair = Pair(all_facets[slave], all_facets[1 - slave], reach=0.5)
    return ContactProblem(a, nothing, bcs=bcs, contact=pair, algorithm="alm"), exact


@pytest.mark.parametrize("slave", [0, 1])
@pytest.mark.parametrize("upto", [(0.4, 0.4), (0.4, 0.55)])
@pytest.mark.parametrize(
    ("kind", "degree"),
    [
        ("quadrilateral", 1),
        *(
            pytest.param(*case, marks=pytest.mark.slow)
            for case in (
                ("triangle", 2),
                ("hexahedron", 1),
                ("hexahedron", 2),
                ("tetrahedron", 1),
                ("tetrahedron", 2),
            )
        ),
    ],
)
def test_constant_stress_beside_a_region_in_which_both_sides_are_held(kind, degree, upto, slave):
    """Two blocks of meshes that do not match, between smooth walls, pressed evenly: where supports that move along hold
    a part of both sides, displacements and pressures are those without, and the force is that of the rest, also where
    one of both ends before the other.
    """
    dim = 2 if kind in ("quadrilateral", "triangle") else 3
    up = dim - 1

    def graded(x, last):
        """Two facets along what is held, and the others beside it."""
        along = np.where(x[:, 0] <= 0.5, 2 * last * x[:, 0], last + (1 - last) * (2 * x[:, 0] - 1))
        return np.column_stack((along, x[:, 1:]))

    bodies = [
        grid(
            kind,
            (4, *[n] * (dim - 2), 2),
            [*[0.0] * up, low],
            [*[1.0] * up, low + 1],
            lambda x, last=last: graded(x, last),
        )
        for n, low, last in ((2, -1.0, upto[0]), (3, 0.0, upto[1]))
    ]
    held = [lambda x, last=last: x[:, 0] <= last for last in upto]
    problem, exact = evenly_pressed(kind, degree, bodies, held, slave)
    moved, pressure = problem.solve().x.array, sum(YOUNG_AND_LAME) * STRAIN
    assert moved == pytest.approx(exact.x.array, abs=1e-10 * STRAIN)
    assert problem.state.pressure == pytest.approx(pressure, rel=1e-7)
    force = np.abs(sum(problem.state.forces))
    assert force == pytest.approx([*[0.0] * up, pressure * (1 - min(upto))], abs=1e-7 * pressure)


@pytest.mark.parametrize(
    ("kind", "cells", "slave", "held", "removed"),
    [
        # An edge of the slave in a plane across which both are held sees no node of the master in it.
        ("hexahedron", ((2, 2), (4, 5)), 1, (0.59, 0.66), (0.4, 0.3)),
        # A facet of the slave that a hole in its side parts from the others, and that is held over what is held.
        ("quadrilateral", ((4,), (5,)), 0, (0.49, 0.3), None),
        ("triangle", ((4,), (5,)), 0, (0.49, 0.3), None),
    ],
)
def test_held_facets_with_holes(kind, cells, slave, held, removed):
    """One facet is not held amidst others that are, or no part of the side: what is right is not refused, and the block
    is pressed evenly where it is in contact.
    """
    up = len(cells[0])
    bodies = [
        grid(kind, (*of, 2), [*[0.0] * up, low], [*[1.0] * up, low + 1])
        for of, low in zip(cells, (-1.0, 0.0), strict=True)
    ]

    def nearest(x, place):
        return np.arange(len(x)) == np.linalg.norm(x - np.array(place), axis=1).argmin()

    def chosen(x, last):
        return (x[:, 0] <= last) if removed is None else (x[:, 0] <= last) & ~nearest(x, removed)

    sides = [lambda x: x[:, 0] > -1.0] * 2
    if removed is None:
        sides[slave] = lambda x: ~nearest(x, [0.375])
    of_both = [lambda x, last=last: chosen(x, last) for last in held]
    problem, exact = evenly_pressed(kind, 1, bodies, of_both, slave, sides)
    moved = problem.solve().x.array
    assert problem.state.pressure.min() > 0.0
    if removed is not None:
        assert moved == pytest.approx(exact.x.array, abs=1e-3 * STRAIN)


@pytest.mark.parametrize("slave", [0, 1])
@pytest.mark.parametrize("dim", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_the_depth_of_a_region_in_which_both_sides_are_held(dim, slave):
    """Forces begin at none, and grow in proportion to the depth from the first digit on: nothing jumps."""
    depths = 1e-6 + np.array([1e-12, 1e-9, 1e-7])  # which are apart by 1e-6
    forces = np.array([pressed(clamped(dim, slave, 0.5), depth) for depth in depths])
    assert forces / (depths - 1e-6)[:, None] == pytest.approx(np.tile(forces[-1] / 1e-7, (3, 1)), rel=1e-3)


@pytest.mark.one_quick
@pytest.mark.parametrize("dim", [2, 3])
def test_the_certificate_misses_held_points(monkeypatch, dim):
    """A solver that gives the functions of held nodes to their neighbours is refused."""

    def given_away(slave, master, points, unable, reach, held, fixed):
        return slide(slave, master, points, unable | held.slave, reach, fixed=fixed)

    monkeypatch.setattr(sliding_sides, "slide", given_away)
    scene = plate(dim, slave=1)
    with pytest.raises(ConvergenceError) as raised:
        scene.move(*[0.0] * (dim - 1), -DEPTH)
    assert scene.problem.status is Status.NOT_CERTIFIED
    assert "entered" in str(raised.value)
