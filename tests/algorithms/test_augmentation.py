"""The augmented Lagrangian method ends at the unregularised solution, whatever gamma it begins with."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mpi4py import MPI
from scenes import alone, example1

from signorini_fx.algebra.algorithms.augmentation import Augmentation, with_enough_digits
from signorini_fx.algebra.contact.contact_map import ContactMap
from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.algebra.contact.nodal_vectors import unit
from signorini_fx.mechanics.body.discretisation import discretise
from signorini_fx.records import History, Status, Timings
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.solving.solve_on_mesh import contact_task

FEW = settings(max_examples=60, suppress_health_check=[HealthCheck.too_slow])
MANY = settings(FEW, max_examples=300)
FORCE = 5.704914


def pushed(**solver):
    """A coarse block pushed sideways on a foundation with a kink: its pressure is nearly settled by statics."""
    return parse_scene(
        {
            "mesh": {"generator": "rectangle", "parameters": {"nx": 8, "ny": 4}},
            "material": {"young": 5000.0, "poisson": 0.3},
            "displacement": [{"boundary": side, "x": 0.0} for side in ("left", "right")],
            "traction": {"boundary": "top", "y": -20.0, "x": 10.0},
            "contact": {
                "boundary": "bottom",
                "gap": "abs(x[0] - 1.5)",
                "friction": {"law": "coulomb", "coefficient": 1.0},
            },
            "solver": solver,
        }
    )


@pytest.mark.one_quick
@pytest.mark.parametrize("coulomb", ["fp", "newton"])
@pytest.mark.parametrize("gamma", [(1e5, 1e4), (1e6, 1e2), (1e2, 1e6), (1e-3, 1e-3), (1e13, 1e13), (1e13, 1.0)])
def test_shear_settles_as_well_as_pressure(gamma, coulomb):
    """The friction force is that of the limit, though the pressure alone settles at once."""
    ours = alone(pushed(algorithm="alm", coulomb=coulomb, gamma_n=gamma[0], gamma_t=gamma[1]))
    assert not ours.certificate.law.regularised
    assert ours.contact.forces[1][0] == pytest.approx(FORCE, rel=1e-6)


SCENES = {
    "kink": lambda **s: pushed(**s),
    "no friction": lambda **s: example1(nx=12, ny=4, **s),
    "Tresca": lambda **s: example1(bound=1.5, nx=12, ny=4, **s),
    "Coulomb": lambda **s: example1(coefficient=0.6, nx=12, ny=4, **s),
    "Coulomb, degree 2": lambda **s: example1(coefficient=0.3, nx=8, ny=3, degree=2, **s),
}
LIMIT = {}


def same_limit(name, coulomb, share_n, share_t):
    """Pressure and shear agree with those of the natural gamma to the tolerance."""
    if name not in LIMIT:
        LIMIT[name] = alone(SCENES[name](algorithm="alm", tolerance=1e-12))
    limit = LIMIT[name]
    default = 1e5 * limit.statement.young / limit.model.tagged.size
    gammas = {"gamma_n": share_n * default, "gamma_t": share_t * default}
    scene = SCENES[name]()
    ours = alone(
        scene.model_copy(
            update={"solver": scene.solver.model_copy(update={"algorithm": "alm", "coulomb": coulomb, **gammas})}
        )
    )
    largest = limit.contact.pressure.max()
    for ours_, theirs in ((ours.contact.pressure, limit.contact.pressure), (ours.contact.shear, limit.contact.shear)):
        np.testing.assert_allclose(ours_, theirs, rtol=0, atol=5e-7 * largest)


shares = st.floats(-3, 5).map(lambda power: 10**power)
cases = {
    "name": st.sampled_from(sorted(SCENES)),
    "coulomb": st.sampled_from(["fp", "newton"]),
    "share_n": shares,
    "share_t": shares,
}


@pytest.mark.slow
@pytest.mark.parametrize("count", [60, 20])
def test_random_gammas(count):
    """From a thousandth to 1e5 times the default, each apart."""
    settings(FEW, max_examples=count)(given(**cases)(same_limit))()


@pytest.mark.long
@MANY
@given(**cases)
def test_many_random_gammas(name, coulomb, share_n, share_t):
    """The same, more of them."""
    same_limit(name, coulomb, share_n, share_t)


def wedge(angle, coefficient, load, **solver):
    """A wedge in a groove with oblique flanks, held sideways at its top, where two contact nodes are."""
    friction = {"law": "coulomb", "coefficient": coefficient}
    return parse_scene(
        {
            "mesh": {"generator": "wedge", "parameters": {"nx": 4, "ny": 8, "angle": angle}},
            "material": {"young": 5000.0, "poisson": 0.3},
            "displacement": [{"boundary": "top", "x": 0.0}],
            "traction": [{"boundary": "top", "y": -20.0, "x": load}],
            "contact": [{"boundary": side, "friction": friction} for side in ("left", "right")],
            "solver": solver,
        }
    )


def settles_across_its_normal(angle, coefficient, load, share):
    """Its multipliers settle in the free direction, whatever gamma; penalty with a large gamma agrees."""
    ours = alone(wedge(angle, coefficient, load, algorithm="alm"))
    penalty = alone(wedge(angle, coefficient, load))
    assert np.any(ours.contact.boundary.free.sum(axis=1) == 1)
    gamma = share * 1e5 * 5000.0 / ours.model.tagged.size
    again = alone(wedge(angle, coefficient, load, algorithm="alm", gamma_n=gamma, gamma_t=gamma))
    largest = ours.contact.pressure.max()
    forces = [
        contact.boundary.nodal_forces(contact.pressure, contact.shear) * contact.boundary.free
        for contact in (ours.contact, penalty.contact, again.contact)
    ]
    size = np.abs(forces[0]).max()
    np.testing.assert_allclose(forces[2], forces[0], rtol=0, atol=1e-6 * size)
    np.testing.assert_allclose(forces[1], forces[0], rtol=0, atol=2e-3 * size)
    closed = ours.contact.pressure > 1e-6 * largest
    assert np.abs((ours.contact.u_n - ours.contact.gap)[closed]).max() < 1e-6 * np.abs(ours.displacement.x.array).max()


@pytest.mark.slow
@pytest.mark.parametrize("count", [20, 7])
def test_a_contact_node_with_a_support_across_its_normal(count):
    """Of wedges drawn at random."""
    drawn = given(
        angle=st.floats(5, 40),
        coefficient=st.sampled_from([0.0, 0.1, 0.2]),
        load=st.floats(-30, 30).map(lambda load: round(load, 6)),
        share=st.floats(-2, 2).map(lambda power: 10**power),
    )
    settings(FEW, max_examples=count)(drawn(settles_across_its_normal))()


# --- how it is judged -------------------------------------------------------------------------------------------------


def begun(scene, comm=MPI.COMM_SELF):
    """The contact problem of a scene, solved once without shifts."""
    d = discretise(scene.statement, load_mesh(scene, comm), Timings())
    task = contact_task(d, History())
    assert task.iterate.newton.solve(task.start.data, task.start.sets) is Status.CONVERGED
    return task, d.boundary


@pytest.mark.parametrize("gammas", [(1e7, 1e4), (1e4, 1e7)])
def test_what_is_left_after_one_problem(gammas):
    """Penetration, slip of nodes that stick, and how far the multipliers may be from those of the limit."""
    task, boundary = begun(example1(bound=0.2, nx=24, ny=8, gamma=gammas))
    augmentation, newton, points = Augmentation(task.iterate.newton, 1e8, 1e-9), task.iterate.newton, boundary.points
    assert augmentation.measure(task.start.data) == pytest.approx(1.0)
    u_n, u_t = newton.problem.system.contact.traces(newton.x)
    pressure, shear = newton.multipliers()
    sticks = np.abs(shear) < 0.2
    assert sticks.any()
    assert not sticks.all()
    moved = max((u_n - task.start.data.gap)[pressure > 0].max(), np.abs(u_t)[sticks].max())
    assert augmentation.violation == pytest.approx(moved / max(np.abs(u_n).max(), np.abs(u_t).max()), rel=1e-6)
    diagonal = np.where(task.system.contact.fixed, 0.0, task.system.matrix.getDiagonal().getArray())
    diagonal = diagonal.reshape(-1, 2)  # the normal is along an axis
    stiffness = diagonal[boundary.nodes].max(axis=1) / boundary.weight
    sizes = [points.norm(pressure), points.norm(shear)]
    # Nothing is known of how fast they settle: as slowly as the stiffest node would have it.
    slowest = [size * max(1.0, stiffness.max() / gamma) for size, gamma in zip(sizes, gammas, strict=True)]
    assert augmentation.left == pytest.approx(sum(slowest) / sum(sizes), rel=1e-9)


def test_settled_is_both():
    """Multipliers that no longer change are not enough, nor is a displacement that meets the limit."""
    task, _ = begun(example1(bound=1.5, nx=12, ny=4))
    augmentation = Augmentation(task.iterate.newton, 1e8, 1e-3)
    for left, violation, settled in ((0.0, 0.0, True), (0.0, 2e-3, False), (2e-3, 0.0, False)):
        augmentation.left, augmentation.violation = left, violation
        assert augmentation.settled is settled


@pytest.mark.parametrize("gammas", [(1e13, 1e3), (1e3, 1e13), (1e13, 1e13)])
def test_no_more_gamma_than_digits(gammas):
    """Each of the two is lowered to ten times the natural one."""
    data = begun(example1(bound=1.5, nx=12, ny=4))[0].start.data
    lowered = with_enough_digits(replace(data, gamma_n=gammas[0], gamma_t=gammas[1]), 1e5)
    assert (lowered.gamma_n, lowered.gamma_t) == tuple(min(gamma, 1e6) for gamma in gammas)


@pytest.mark.parametrize("gamma", [1e4, 1e7])
def test_the_fixed_point_needs_no_help(gamma):
    """(ALM-FP) by itself ends at the limit of the natural gamma, in shear too."""
    scene = example1(coefficient=0.3, nx=12, ny=4)
    limit = alone(example1(coefficient=0.3, nx=12, ny=4, algorithm="alm", tolerance=1e-12))
    settings = {"algorithm": "alm", "coulomb": "fp", "fallbacks": False, "gamma_n": gamma, "gamma_t": gamma}
    ours = alone(scene.model_copy(update={"solver": scene.solver.model_copy(update=settings)}))
    assert not any("from the same start" in event for event in ours.history.events)
    largest = limit.contact.pressure.max()
    np.testing.assert_allclose(ours.contact.shear, limit.contact.shear, rtol=0, atol=5e-7 * largest)


def test_nodes_that_a_support_presses_are_no_measure():
    """What counts of the tractions is what no support takes, nothing where it takes all of them."""
    _, boundary = begun(wedge(20.0, 0.2, 0.0))
    held = ~boundary.free[:, 0]
    assert 0 < np.count_nonzero(held) < boundary.size
    normal, area = np.where(held[:, None], [1.0, 0.0], boundary.normal), boundary.weight[~held].sum()
    pressed = replace(boundary, normal=normal)
    assert pressed.points.immovable.tolist() == held.tolist()
    pressure = np.where(held, 1e9, 1.0)
    assert pressed.points.scale(pressure) == pytest.approx(np.sqrt(area), rel=1e-12)
    assert pressed.points.scale(pressure * held) == 0
    along_support = np.where(held, boundary.normal[:, 1], boundary.tangents[:, 1, 0])
    for values, felt in (held * 1.0, along_support), ((held * 1.0)[:, None], boundary.tangents[:, 1, 0]):
        expected = np.sqrt(np.sum(boundary.weight * held * felt**2))
        assert boundary.points.scale(values) == pytest.approx(expected, rel=1e-12)


def test_what_supports_press_hides_no_shear():
    """How near the friction law is, is relative to what the body feels of friction."""
    task, boundary = begun(wedge(20.0, 0.2, 0.0))
    newton = task.iterate.newton
    problem = newton.problem
    held = ~boundary.free[:, 0]
    problem.points = replace(boundary, normal=np.where(held[:, None], [1.0, 0.0], boundary.normal)).points
    problem.away = lambda x: np.where(held, 0.0, 1.0)
    problem.friction_bounds = lambda x: (np.where(held, 1e9, 10.0),) * 2
    problem.multipliers = lambda x, sets: (np.zeros(held.size), np.zeros((held.size, 1)))
    assert problem.law_residual(newton.x) == pytest.approx(0.1, rel=1e-12)


def undone(boundary):
    """Where a support holds a node: a large pressure and a shear whose forces along the free direction cancel."""
    held = ~boundary.free[:, 0]
    pressure = np.where(held, 1e9 * boundary.tangents[:, 1, 0], 0.0)
    return held, pressure, np.where(held, -1e9 * boundary.normal[:, 1], 0.0)[:, None]


def test_what_pressure_and_shear_undo_in_each_other_hides_no_shear():
    """Neither is a scale for the friction law at other nodes, nor is the bound that follows such a pressure."""
    task, boundary = begun(wedge(20.0, 0.2, 0.0))
    newton = task.iterate.newton
    problem = newton.problem
    held, pressure, shear = undone(boundary)
    assert 0 < np.count_nonzero(held) < held.size
    problem.away = lambda x: np.where(held, 0.0, 1.0)
    problem.friction_bounds = lambda x: (np.where(held, 1e9, 10.0),) * 2
    problem.multipliers = lambda x, sets: (pressure, np.where(held[:, None], shear, 10.0))
    assert problem.law_residual(newton.x) == pytest.approx(0.1, rel=1e-6)


def test_what_pressure_and_shear_undo_in_each_other_does_not_settle():
    """Changes that cancel are none, and what cancels is no scale for them."""
    task, boundary = begun(wedge(20.0, 0.2, 0.0))
    newton = task.iterate.newton
    held, pressure, shear = undone(boundary)
    zero = np.zeros(held.size)
    data = replace(task.start.data, lambda_hat=zero, mu_hat=zero[:, None], bound=zero + 1e12)
    newton.problem.set_data(data)
    newton.shifts = lambda data: (pressure + ~held * 10.0, shear)
    augmentation = Augmentation(newton, 1e8, 1e-9)
    assert augmentation.measure(data) == pytest.approx(1.0, rel=1e-6)
    area = boundary.weight[~held].sum()
    assert augmentation.changes == pytest.approx((10.0 * np.sqrt(area), 0.0), rel=1e-6, abs=1e-3)


def in_space(walls=("bottom",), supports=(), **solver):
    """A block that is pressed, and pushed towards its left side and away from its front side, in two load steps."""
    size = {"length": 1.5, "width": 1.2, "height": 1.0, "nx": 4, "ny": 3, "nz": 3}
    friction = {"law": "coulomb", "coefficient": 0.283}
    return parse_scene(
        {
            "mesh": {"generator": "box", "parameters": size},
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": list(supports),
            "traction": {"boundary": "top", "x": -2.37, "y": 2.0, "z": -10.0, "factors": [0.3, 1.0]},
            "contact": [{"boundary": wall, "friction": friction} for wall in walls],
            "solver": solver,
        }
    )


@pytest.mark.parametrize(("turn", "wrong"), [(0.0, 0.0), (1e-4, 1e-4), (np.pi, 1.0)])
def test_a_shear_that_does_not_point_along_the_slip_has_not_settled(monkeypatch, turn, wrong):
    """However little the multipliers change, at a node that slips the shear is along its slip."""
    task, _ = begun(in_space(supports=[{"boundary": "back", "x": 0.0, "y": 0.0, "z": 0.0}]))
    newton, points = task.iterate.newton, task.motions.points
    slip = np.zeros((points.size, 2))
    slip[np.flatnonzero(np.trace(points.movable, axis1=1, axis2=2) > 2.5)[0]] = 0.6, 0.8
    monkeypatch.setattr(ContactMap, "traces", lambda contact, x: (np.zeros(points.size), slip))
    shear = slip @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
    data = replace(task.start.data, lambda_hat=np.zeros(points.size), mu_hat=shear, bound=np.ones(points.size))
    newton.shifts = lambda data: (data.lambda_hat, data.mu_hat)
    augmentation = Augmentation(newton, 1e8, 1e-7)
    assert augmentation.measure(data) == 0.0
    assert augmentation.violation == pytest.approx(wrong, rel=1e-6, abs=1e-15)
    assert augmentation.settled is (wrong == 0.0)


@pytest.mark.mpi
def test_every_rank_judges_alike():
    """The stiffest contact node is that of all ranks: the block's cells are of many sizes."""
    scene = example1(bound=1.5, nx=9, ny=4, gamma=1e3, generator="block", layout="unstructured")
    task, _ = begun(scene, MPI.COMM_WORLD)
    augmentation = Augmentation(task.iterate.newton, 1e8, 1e-9)
    augmentation.measure(task.start.data)
    assert all(left == augmentation.left for left in MPI.COMM_WORLD.allgather(augmentation.left))


def test_a_node_that_a_support_lifts_off():
    """The clamped end pushes its corner into the foundation in the first load step, and lifts it off in the second."""
    scene = parse_scene(
        {
            "mesh": {"generator": "rectangle", "parameters": {"nx": 4, "ny": 2}},
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": {"boundary": "left", "x": 0.0, "y": -0.01, "factors": [1.0, 0.1]},
            "traction": {"boundary": "right", "y": -1.0, "factors": [1.0, 1.0]},
            "contact": {"boundary": "bottom", "gap": 0.005, "friction": {"law": "coulomb", "coefficient": 0.3}},
            "solver": {"algorithm": "alm", "coulomb": "fp"},
        }
    )
    solution = alone(scene)
    held = solution.contact.points.immovable
    assert held.sum() == 1
    assert [step.contact.pressure[held].tolist() for step in solution.steps] == [[0.0], [0.0]]
    assert [bool((step.contact.held_inside > 0).any()) for step in solution.steps] == [True, False]
    assert all(step.certificate.holds for step in solution.steps)


def test_shear_along_a_wall_that_prescribes_the_slip():
    """A node beside a wall slips by little: the shear across the wall, which does nothing, has its limit."""
    supports = [{"boundary": "left", "normal": 0.001}, {"boundary": "front", "normal": 0.0}]
    solution = alone(in_space(supports=supports, algorithm="alm", gamma_n=1e7, gamma_t=1e4, tolerance=1e-10))
    assert solution.status is Status.CONVERGED
    assert solution.certificate.holds
    assert max(step.linear_solves for step in solution.steps) <= 30


@pytest.mark.parametrize("coulomb", ["fp", "newton"])
@pytest.mark.parametrize("dimension", [2, 3])
def test_a_node_that_a_support_drags_along_the_foundation(dimension, coulomb):
    """However small gamma_t is, the shear of a node whose slip is prescribed has its limit at once."""
    sizes = {"length": 1.5, "height": 1.0, "nx": 4, "ny": 3}
    mesh = {2: {"generator": "rectangle"}, 3: {"generator": "box"}}[dimension]
    up = "y" if dimension == 2 else "z"
    solution = alone(
        parse_scene(
            {
                "mesh": {**mesh, "parameters": sizes if dimension == 2 else {**sizes, "width": 1.2, "nz": 3}},
                "material": {"young": 1000.0, "poisson": 0.3},
                "displacement": [
                    {"boundary": "left", "x": 0.002, **({} if dimension == 2 else {"y": 0.001})},
                    {"boundary": "top", up: -0.01},
                ],
                "contact": {"boundary": "bottom", "friction": {"law": "coulomb", "coefficient": 0.3}},
                "solver": {"algorithm": "alm", "coulomb": coulomb, "gamma_n": 1e8, "gamma_t": 1e5},
            }
        )
    )
    contact = solution.contact
    dragged = np.trace(contact.points.still, axis1=1, axis2=2) > dimension - 1.5
    assert dragged.sum() == {2: 1, 3: 4}[dimension]
    assert solution.certificate.holds
    assert contact.pressure[dragged].min() > 0
    np.testing.assert_allclose(np.linalg.norm(contact.shear, axis=1)[dragged], 0.3 * contact.pressure[dragged])
    assert solution.history.linear_solves <= 30


def test_a_node_that_a_support_drags_has_not_settled_below_its_bound():
    """Its bound follows its own pressure."""
    supports = [{"boundary": "left", "x": 0.002, "y": 0.001}, {"boundary": "top", "z": -0.01}]
    task, _ = begun(in_space(supports=supports))
    newton, points = task.iterate.newton, task.motions.points
    data = replace(
        task.start.data,
        bound=np.zeros(points.size),
        follows=PointFriction(np.zeros(points.size), np.full(points.size, 0.3)),
    )
    newton.problem.set_data(data, newton.problem.sets)
    dragged = np.trace(points.still, axis1=1, axis2=2) > 1.5
    half = 0.15 * newton.multipliers()[0] * dragged
    assert half[dragged].min() > 0
    shear = half[:, None] * unit(newton.problem.system.contact.traces(newton.x)[1])
    for least, settled in ((0.0, True), (1.0, False)):
        newton.shifts = lambda data, least=least: (data.lambda_hat, least * shear)
        augmentation = Augmentation(newton, 1e8, 1e-7)
        augmentation.measure(data)
        assert bool(augmentation.violation <= 1e-7) is settled


def test_shear_along_a_wall_that_is_a_contact():
    """A node at the edge of two contacts slips along it: the shear across the edge has its limit at once."""
    supports = [{"boundary": "back", "normal": 0.0}]
    walls, gammas = ("bottom", "left"), {"gamma_n": 1e7, "gamma_t": 1e4}
    solution = alone(in_space(walls, supports, algorithm="alm", tolerance=1e-10, **gammas))
    assert solution.status is Status.CONVERGED
    assert solution.certificate.holds
    assert max(step.linear_solves for step in solution.steps) <= 40
