"""Two nonlinear bodies that slide on each other over many facets: closed forms, invariances, limits, and outcomes."""

import runpy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import ufl
from dolfinx import fem, la
from dolfinx import mesh as dmesh
from mpi4py import MPI
from support.nonlinear_bodies import LAME, MU, stress_of_block
from support.sliding_bodies import SlidingBodies, as_linear_bodies, blocks, bump, grid, out_of_balance, roller, wheel

from signorini_fx import (
    ConvergenceError,
    Coulomb,
    FormError,
    NonlinearContactProblem,
    Pair,
    Status,
)
from signorini_fx.algebra.linalg import schur
from signorini_fx.forms.nonlinear import newton
from signorini_fx.forms.nonlinear.displaced_certificate import certified, mechanics_at
from signorini_fx.forms.nonlinear.linearised import LinearisedProblem
from signorini_fx.forms.nonlinear.moving_pairs import MovingPair
from signorini_fx.mechanics.body import elastic_body
from signorini_fx.mechanics.pairs.mortar_coupling import PairingError
from signorini_fx.results.certificate.law_of_method import Law, Tractions

PRESSED = ((0, -0.1), (0, -0.2))


def slid(scene, ways):
    """The forces of a scene after each of some ways."""
    forces = np.array([scene.move(*way) for way in ways])
    assert scene.problem.certificate.holds
    return forces


@pytest.mark.one_quick
@pytest.mark.parametrize("kind", ["quadrilateral", "triangle"])
@pytest.mark.parametrize("slave", [0, 1])
def test_patch(kind, slave):
    """Two blocks whose meshes do not match, compressed by two fifths between smooth plates: uniform, in closed form."""
    scene = blocks(kind, lower=(5, 3), upper=(3, 2), width=1.0, slave=slave, smooth=lambda x: np.isclose(x[0], 0.0))
    for depth in (0.1, 0.4):
        scene.move(0.0, -2 * depth)
        state = scene.problem.state
        (pair,) = scene.problem.linear.pairs.values()
        into = -pair.coupling.gap
        # The regularised law lets both bodies overlap by a pressure over gamma.
        assert into == pytest.approx(into[0], rel=1e-6)
        assert 0 < into[0] < 1e-4
        assert state.pressure == pytest.approx(-stress_of_block(1 - depth + into[0] / 2), rel=1e-9)
        x = scene.u.function_space.tabulate_dof_coordinates()[:, :2]
        across = scene.u.x.array.reshape(-1, 2)[:, 0]
        assert across == pytest.approx(across[x[:, 0].argmax()] * x[:, 0], abs=1e-9)


@pytest.mark.one_quick
@pytest.mark.parametrize(("friction", "depth"), [(None, 0.3), (None, 0.42), (Coulomb(0.3), 0.42)])
def test_edges_that_are_flush(friction, depth):
    """Equal blocks with their edges on each other: from a compression on the one slides over the other where nothing
    but pressure holds it, as in a model of its own, blocks with a penalty of the overlap of their outlines.
    """
    smooth = friction is None and depth > 0.4
    scene = blocks(lower=(8, 8), upper=(8, 8), width=1.0, smooth=lambda x: np.isclose(x[0], 0.0), friction=friction)
    scene.move(0.0, -0.2)
    scene.move(0.0, -0.4)
    if smooth:
        with pytest.raises(ConvergenceError, match="unstable equilibrium"):
            scene.move(0.0, -2 * depth)
    else:
        scene.move(0.0, -2 * depth)
    assert scene.problem.status is (Status.UNSTABLE if smooth else Status.CONVERGED)


@pytest.mark.slow
def test_frames_do_not_matter():
    """A roller that is pressed and slides, and the same turned as a whole: equal forces; friction is F times them, and
    forces and moments of both bodies balance.
    """
    ways = (*PRESSED, (0.125, -0.2))
    law = {"friction": Coulomb(0.3), "algorithm": "alm"}
    scenes = [roller(ratio=10.0, cells=(24, 6), around=14, angle=angle, **law) for angle in (0.0, 0.7)]
    first, second = (slid(scene, ways) for scene in scenes)
    assert second == pytest.approx(first, abs=1e-9 * np.abs(first).max())
    for scene in scenes:
        assert max(scene.iterations) <= 7
        state = scene.problem.state
        closed = state.in_contact
        assert np.count_nonzero(closed) > 3
        assert np.abs(state.shear[closed, 0]) == pytest.approx(0.3 * state.pressure[closed], rel=1e-6)
        force, moment = out_of_balance(scene)
        assert force < 1e-13
        assert moment < 1e-12


@pytest.mark.one_quick
@pytest.mark.parametrize(
    "friction", [None, pytest.param(Coulomb(0.3), marks=pytest.mark.slow)], ids=["smooth", "rough"]
)
def test_over_facets(friction):
    """Five facets of a block, in three and in five steps: the same force, and at most seven iterations a step."""
    ends = []
    for steps in (3, 5):
        scene = roller(ratio=10.0, cells=(28, 7), around=14, friction=friction)
        ways = [(0, -0.1), (0, -0.2), *((5 / 7 * share, -0.2) for share in np.arange(1, steps + 1) / steps)]
        ends.append(slid(scene, ways)[-1])
        assert max(scene.iterations) <= 7
    assert ends[1] == pytest.approx(ends[0], abs=1e-6 * np.abs(ends[0]).max())
    if friction is None:
        assert abs(ends[0][0]) < 0.01 * abs(ends[0][1])


@pytest.mark.slow
def test_force_is_even_over_an_edge_between_facets():
    """In steps of a sixth of a facet over two facets no force jumps by more than one per cent of the largest one."""
    scene = roller(ratio=10.0, cells=(48, 12), around=24)
    slid(scene, [(0, -0.1), (0, -0.2), (0, -0.3)])
    forces = slid(scene, [(0.3 + share / 12, -0.3) for share in np.arange(13) / 6])
    largest = np.abs(forces).max()
    assert np.abs(np.diff(forces, axis=0)).max() < 0.01 * largest
    times = np.arange(13)
    for component in forces.T:
        assert np.abs(component - np.polyval(np.polyfit(times, component, 2), times)).max() < 0.006 * largest


@pytest.mark.one_quick
@pytest.mark.parametrize("slave", [0, 1])
@pytest.mark.parametrize("friction", [None, Coulomb(0.3)], ids=["smooth", "rough"])
def test_linear_limit(friction, slave):
    """At small loads pairs of linear bodies, on the same mesh: displacements of 1e-4 of the size leave a difference
    of some strains.
    """
    scene = bump(friction=friction, slave=slave, algorithm="alm")
    force = scene.move(2e-5, -1e-4)
    linear = as_linear_bodies(scene)
    expected = sum(linear.state.forces)
    assert force == pytest.approx(expected, abs=2e-3 * np.abs(expected).max())
    far = np.abs(linear.u.x.array).max()
    assert scene.u.x.array == pytest.approx(linear.u.x.array, abs=2e-3 * far)


@pytest.mark.slow
def test_sides_exchanged():
    """Points on the one or on the other side: half a per cent, at facets of a twelfth of the height."""
    ways = (*PRESSED, (0.0625, -0.2), (0.125, -0.2))
    first, second = (
        slid(roller(cells=(48, 12), around=24, ratio=3.0, friction=Coulomb(0.3), slave=slave), ways)[-1]
        for slave in (0, 1)
    )
    assert first == pytest.approx(-second, abs=5e-3 * np.abs(first).max())


@pytest.mark.slow
@pytest.mark.mpi
def test_ironing(monkeypatch):
    """The demo: once all points slide the force hardly changes, and has friction and the slope ahead in it."""
    monkeypatch.setenv("CELLS", "8")
    found = runpy.run_path(str(Path(__file__).parents[2] / "demos" / "forms" / "ironing.py"))
    problem = found["problem"]
    assert problem.certificate.holds
    force = sum(problem.state.forces)
    assert force == pytest.approx([6.79, -20.0], abs=0.05)
    held = fem.locate_dofs_topological(found["V"], 1, found["on"](lambda x: x[1]))
    owned = held[held < found["V"].dofmap.index_map.size_local]
    reactions = fem.assemble_vector(fem.form(found["F"]))
    reactions.scatter_reverse(la.InsertMode.add)
    reaction = found["mesh"].comm.allreduce(reactions.array.reshape(-1, 2)[owned].sum(axis=0))
    assert reaction == pytest.approx(-force, abs=1e-6)


@pytest.mark.slow
@pytest.mark.mpi
def test_on_ranks():
    """The same on any number of ranks, with stick and slip."""
    forces = [
        slid(roller(ratio=10.0, cells=(16, 4), around=8, friction=Coulomb(0.3), comm=comm), (*PRESSED, (0.15, -0.2)))
        for comm in (MPI.COMM_WORLD, MPI.COMM_SELF)
    ]
    assert forces[0] == pytest.approx(forces[1], rel=1e-6)


@pytest.mark.slow
def test_the_certificate_sees_what_is_wrong():
    """Pressures, shears, displacements and the beginning of the step that are not those of the solution."""
    scene = roller(ratio=10.0, cells=(24, 6), around=14, friction=Coulomb(0.3))
    for way in (*PRESSED, (0.05, -0.2)):
        scene.drive.value[:] = way
        scene.problem.solve()
        if way != (0.05, -0.2):
            scene.problem.advance()
    problem, u = scene.problem, scene.u
    form = fem.form(scene.form)

    def judged(changed=lambda tractions: tractions, before=lambda step: step):
        linear = problem.linear
        mechanics = mechanics_at(u, fem.assemble_vector(form).array, linear)
        law = Law(*linear.task.promised(linear.outcome))
        return certified(u, mechanics, {}, changed(Tractions.of(problem.state)), law, before(linear.previous_step))

    assert judged().holds
    touching = np.flatnonzero(problem.state.in_contact)

    def larger(tractions):
        pressure = tractions.pressure.copy()
        pressure[touching[1]] *= 1.0001
        return replace(tractions, pressure=pressure)

    assert judged(larger).equilibrium > 1e-5
    assert not judged(lambda tractions: replace(tractions, shear=-tractions.shear)).holds
    values = u.x.array.copy()
    nodes = fem.locate_dofs_topological(u.function_space, 1, scene.sides[1])
    u.x.array.reshape(-1, 2)[nodes] += [0.0, -1e-4]
    moved = judged()
    assert moved.entered > 1e-5
    u.x.array.reshape(-1, 2)[nodes] += [0.0, 2e-4]
    assert judged().pressure_at_distance > 1e-5
    u.x.array[:] = values
    assert judged().holds

    def elsewhere(step):
        displacement = step.displacement.copy()
        displacement.x.array.reshape(-1, 2)[nodes] += [0.1, 0.0]
        return replace(step, displacement=displacement)

    assert not judged(before=elsewhere).holds


def test_bodies_that_part_and_meet_again():
    """No side sees the other one, then they touch, part, and touch at another place as if they had not before."""
    scene = roller(ratio=10.0, gap=0.3, reach=0.2, friction=Coulomb(0.3))
    assert np.abs(scene.move(0.0, 0.0)).max() == 0.0
    first = slid(scene, [(0.0, -0.25), (0.0, -0.4)])[-1]
    assert first[1] < -1
    assert np.abs(scene.move(0.0, 0.1)).max() == 0.0
    assert np.abs(scene.move(0.25, 0.1)).max() == 0.0  # by two facets
    again = slid(scene, [(0.25, -0.25), (0.25, -0.4)])[-1]
    assert again == pytest.approx(first, abs=0.01 * np.abs(first).max())


def test_past_the_end_of_the_other_side():
    """Points that come to lie past the end of the other side share what its corner carries: forces are those with the
    points on the side that ends, and a note says which part of them is there.
    """
    ways = [(0, -0.02), (0, -0.1), (0.1, -0.1), (0.2, -0.1), (0.3, -0.1), (0.4, -0.1)]
    forces, notes = [], []
    for slave in (0, 1):
        scene = blocks(friction=Coulomb(0.3), slave=slave)
        forces.append(slid(scene, ways))
        notes.append([found.message for found in scene.problem.findings if "past the end" in found.message])
    assert forces[0] == pytest.approx(-forces[1], abs=0.015 * np.abs(forces[0]).max())
    assert [len(found) for found in notes] == [1, 0]
    assert "13% of the contact force" in notes[0][0]


@pytest.mark.slow
def test_ends_of_sides_in_contact(monkeypatch):
    """A block that slides over the end of a smaller one: the same forces in fewer iterations than where points in
    contact do not know that their functions change with where the other side ends, also where bodies that are moved on
    for that see two sheets.
    """
    ways = [(0, -0.02), (0, -0.1), (0.1, -0.1), (0.2, -0.1), (0.3, -0.1)]

    def sees_two_sheets(*_):
        raise PairingError("two sheets")

    found = []
    for unknown in ({}, {"moves_little": lambda self, increment: False}, {"missed": sees_two_sheets}):
        with monkeypatch.context() as patch:
            for name, replaced in unknown.items():
                patch.setattr(MovingPair, name, replaced)
            scene = blocks(slave=0)
            found.append((slid(scene, ways), scene.iterations))
    (forces, iterations), *others = found
    for expected, more in others:
        assert forces == pytest.approx(expected, abs=1e-7 * np.abs(expected).max())
        assert max(iterations) <= 6 < max(more) - 2
        assert sum(iterations) <= sum(more) - 6


def test_names_of_outcomes():
    """A body that goes through another one, or starts inside it."""
    small = roller(radius=0.1, gap=0.05, cells=(32, 8), around=8, ratio=10.0, reach=0.05)
    with pytest.raises(ConvergenceError, match=r"bodies inside each other \(contact\[0\]: "):
        small.move(0.0, -0.6)
    assert small.problem.status is Status.PASSED


def test_two_sheets():
    """Two bars above each other, the sides of both of which face a block within the reach."""
    cells, x = grid("quadrilateral", (4, 1), [0.0, 0.0], [1.0, 0.2])
    bars = np.concatenate((cells, cells + len(x))), np.concatenate((x, x + np.array([0.0, 0.5])))
    bodies = grid("quadrilateral", (6, 2), [-0.5, -1.0], [1.5, 0.0]), bars
    level = [lambda x: np.isclose(x[1], 0.0), lambda x: np.isclose(x[1], 0.0) | np.isclose(x[1], 0.5)]
    held = [lambda x: np.isclose(x[1], -1.0), lambda x: np.isclose(x[1], 0.2) | np.isclose(x[1], 0.7)]
    scene = SlidingBodies("quadrilateral", bodies, level, held, reach=1.0)
    with pytest.raises(ConvergenceError, match="a side sees two sheets of the other one"):
        scene.move(0.0, -0.01)
    assert scene.problem.status is Status.FOLDED
    near = SlidingBodies("quadrilateral", bodies, level, held, reach=0.2)
    assert slid(near, [(0.0, -0.01)])[-1][1] < 0


@pytest.mark.parametrize(
    ("more", "where"),
    [
        ({"gap": 0.0}, "gap"),
        ({"bonded": True}, "bonded"),
        ({"adjust": 0.1}, "adjust"),
    ],
)
def test_what_is_not_possible(more, where):
    """One error that names the argument."""
    with pytest.raises(FormError, match=rf"contact\[0\]\.{where}: "):
        blocks(pair=more)


def test_sides_that_share_nodes():
    """Both sides of one corner cannot slide on each other."""
    scene = blocks()
    facets = scene.sides[1]
    contact = Pair(facets[:2], facets[2:])
    with pytest.raises(FormError, match=r"contact\[0\]: its sides share nodes"):
        type(scene.problem)(scene.form, scene.u, bcs=scene.bcs, contact=contact).solve()


def test_degree_2_in_space():
    """Not yet, with the reason."""
    mesh = dmesh.create_unit_cube(MPI.COMM_SELF, 1, 1, 1)
    u = fem.Function(fem.functionspace(mesh, ("Lagrange", 2, (3,))))
    form = ufl.inner(ufl.grad(u), ufl.grad(ufl.TestFunction(u.function_space))) * ufl.dx
    sides = [dmesh.locate_entities_boundary(mesh, 2, lambda x, z=z: np.isclose(x[2], z)) for z in (0.0, 1.0)]
    with pytest.raises(FormError, match=r"contact\[0\]: in 3D two bodies slide on each other with degree 1 only"):
        NonlinearContactProblem(form, u, contact=Pair(*sides))


@pytest.mark.slow
@pytest.mark.parametrize("degree", [1, 2])
def test_bounded_shear(degree):
    """Friction with a cap, which is what there is for a shear that pressure does not bound: min(F lambda, cap)."""
    scene = roller(ratio=10.0, cells=(12, 3), around=10, friction=Coulomb(0.8, cap=2.0), algorithm="alm", degree=degree)
    slid(scene, [(0, -0.1), (0.2, -0.1)])
    state = scene.problem.state
    closed = state.in_contact
    bound = np.minimum(0.8 * state.pressure[closed], 2.0)
    assert np.count_nonzero(bound == 2.0) > 0
    assert np.abs(state.shear[closed, 0]) == pytest.approx(bound, rel=1e-6)


@pytest.mark.parametrize("slave", [0, 1])
@pytest.mark.parametrize(
    "settings",
    [
        {},
        pytest.param({"friction": Coulomb(0.3)}, marks=pytest.mark.slow),
        pytest.param({"degree": 2}, marks=pytest.mark.slow),
    ],
    ids=["smooth", "rough", "quadratic"],
)
def test_half_a_model(settings, slave):
    """Of bodies with a plane of symmetry, whichever of them is curved, the half has half of the force of the whole."""
    whole, half = (wheel(slave=slave, half=half, reach=0.3, algorithm="alm", **settings) for half in (False, True))
    for depth in (0.02, 0.08):
        assert 2 * half.move(0.0, -depth)[1] == pytest.approx(whole.move(0.0, -depth)[1], rel=1e-9)
    assert half.problem.certificate.holds
    state = half.problem.state
    on_plane = np.isclose(state.boundary.x[:, 0], 0.0)
    assert state.pressure[on_plane] > 0.5 * state.pressure.max()
    assert state.boundary.normal[on_plane, 0] == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("slave", [0, 1])
@pytest.mark.parametrize(
    ("kind", "cells"), [("quadrilateral", 1), ("triangle", 1), pytest.param("quadrilateral", 2, marks=pytest.mark.slow)]
)
def test_few_facets_between_two_planes_of_symmetry(kind, cells, slave):
    """A block of one facet, whose points are all in planes of symmetry, on one of several, neither of which can widen:
    each is stretched evenly, and its stress is known.
    """
    sides = [lambda x: np.isclose(x[0], 0.0) | np.isclose(x[0], 1.0), lambda x: np.isclose(x[1], 0.0)]
    counts = (cells, 1), (3, 2)
    bodies = grid(kind, counts[slave], [0.0, -1.0], [1.0, 0.0]), grid(kind, counts[1 - slave], [0.0, 0.0], [1.0, 1.0])
    ends = [lambda x, y=y: np.isclose(x[1], y) for y in (-1.0, 1.0)]
    scene = SlidingBodies(kind, bodies, [sides[1]] * 2, ends, slave=slave, smooth=sides[0], algorithm="alm")
    for depth in (0.1, 0.4):
        stretch = 1.0 - depth / 2
        stress = MU * (stretch - 1.0 / stretch) + LAME * np.log(stretch) / stretch
        force = scene.move(0.0, -depth)
        assert np.abs(force) == pytest.approx([0.0, -stress], abs=-1e-9 * stress)


@pytest.mark.parametrize("slave", [0, 1])
def test_overlap_beyond_the_reach(slave):
    """Supports hold a plate and a block below it at one end, and move them into each other there, farther than points
    look for partners: that hardly any force is found then is no solution, though facets are far longer.
    """

    def plate(reach):
        bodies = [
            grid("quadrilateral", (8, 2), [0.0, -1.0], [1.0, 0.0]),
            grid("quadrilateral", (8, 1), [0.0, 1e-6], [1.0, 0.3]),
        ]
        touching = [lambda x, y=y: np.isclose(x[1], y, atol=1e-9) for y in (0.0, 1e-6)]
        held = [
            lambda x: (x[1] < 1e-7) & (np.isclose(x[0], 0.0) | np.isclose(x[1], -1.0)),
            lambda x: (x[1] > 1e-7) & np.isclose(x[0], 0.0),
        ]
        return SlidingBodies("quadrilateral", bodies, touching, held, slave=slave, reach=reach)

    assert np.abs(plate(0.1).move(0.0, -0.02)).max() > 1.0
    scene = plate(0.002)
    with pytest.raises(ConvergenceError, match=r"bodies inside each other \(contact\[0\]: 0.02 at "):
        scene.move(0.0, -0.02)
    assert scene.problem.status is Status.PASSED


def test_shears_that_are_passed_on(monkeypatch):
    """A wheel that is pressed and pulled: the same force in fewer iterations than where a shear stays at the nodes that
    its point has met.
    """
    found = []
    for passes in (True, False):
        if not passes:
            monkeypatch.setattr(LinearisedProblem, "_pass_on", lambda self, begun, ending: False)
        scene = wheel(slave=1, friction=Coulomb(0.3))
        force = [scene.move(*way) for way in ((0.0, -0.05), (0.0, -0.1), (0.1, -0.1))][-1]
        found.append((scene.problem.iterations, force))
    assert found[0][0] <= 5 < found[1][0]
    assert found[1][1] == pytest.approx(found[0][1], rel=1e-7)


@pytest.mark.slow
def test_tangents_that_are_kept(monkeypatch):
    """A wheel that is pressed and pulled: after small increments nothing is assembled or eliminated, and the answer is
    that of tangents which are all new.
    """
    found, made, joined = [], list[str](), elastic_body.joined_stiffness
    begin = schur.SchurComplement.__init__

    def counted(self, *of, **more):
        made.append("eliminated")
        begin(self, *of, **more)

    monkeypatch.setattr(elastic_body, "joined_stiffness", lambda *of: made.append("assembled") or joined(*of))
    monkeypatch.setattr(schur.SchurComplement, "__init__", counted)
    for kept in (newton.KEPT_TANGENT, (0.0, 0.0)):
        monkeypatch.setattr(newton, "KEPT_TANGENT", kept)
        scene, iterations = wheel(slave=1, friction=Coulomb(0.3), linear_algebra="condensed"), 0
        made.clear()
        for way in ((0.0, -0.05), (0.0, -0.1), (0.1, -0.1)):
            force = scene.move(*way)
            iterations += scene.problem.iterations
        found.append((iterations, made.count("assembled"), made.count("eliminated"), force, scene.u.x.array.copy()))
    (iterations, *with_kept, force, u), (of_new, *all_new, expected, u_of_new) = found
    assert all_new == [of_new - 1, of_new]  # nothing is between both bodies at first
    assert with_kept[1] == with_kept[0] + 1 <= iterations - 3
    assert iterations <= of_new
    assert force == pytest.approx(expected, rel=1e-8)
    assert u == pytest.approx(u_of_new, abs=1e-9 * np.abs(u).max())
