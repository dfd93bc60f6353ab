"""Two nonlinear bodies that slide on each other over many facets: closed forms, invariances, limits, and outcomes."""

from dataclasses import replace

import numpy as np
import pytest
from dolfinx import fem
from mpi4py import MPI
from support.nonlinear_bodies import stress_of_block
from support.sliding_bodies import as_linear_bodies, blocks, bump, out_of_balance, roller

from signorini_fx import (
    ConvergenceError,
    Coulomb,
    FormError,
    Pair,
    Status,
)
from signorini_fx.forms.nonlinear.displaced_certificate import certified, mechanics_at
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


@pytest.mark.slow
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


def test_names_of_outcomes():
    """A body that goes through another one, or starts inside it."""
    small = roller(radius=0.1, gap=0.05, cells=(32, 8), around=8, ratio=10.0, reach=0.05)
    with pytest.raises(ConvergenceError, match=r"bodies inside each other \(contact\[0\]: "):
        small.move(0.0, -0.6)
    assert small.problem.status is Status.PASSED


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
