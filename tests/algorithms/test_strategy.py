"""What the algorithms are given to start with, and in which order: answers alone would not tell."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from scenes import alone, example1
from spaces import block

from signorini_fx.algebra.algorithms import augmented_fall_back, fall_backs, strategy
from signorini_fx.algebra.algorithms.path_following import path_model
from signorini_fx.mechanics.body.discretisation import discretise
from signorini_fx.mechanics.effects.traction import SurfaceTraction
from signorini_fx.records import History, Status, Timings
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.solving.solve_on_mesh import contact_task


def test_fall_backs_begin_where_the_first_method_began(monkeypatch):
    """Not from the iterate that the one before has left behind."""
    starts = []

    def fails(method, *_, augmentation=None, **__):
        newton = getattr(method, "newton", method)
        if augmentation is None and newton is method:  # augmentation begins by solving a problem of its own
            starts.append(newton.x.getArray().copy())
        newton.x.set(7.0)  # as far away as can be
        return Status.CYCLING

    monkeypatch.setattr(strategy, "fixed_point", fails)
    monkeypatch.setattr(strategy, "coulomb_newton", fails)
    for name in ("fixed_point", "augmented_lagrangian"):
        monkeypatch.setattr(augmented_fall_back, name, fails)
    scene = example1(coefficient=0.3, nx=12, ny=4)
    discretisation = discretise(scene.statement, load_mesh(scene, MPI.COMM_SELF), Timings())
    task = contact_task(discretisation, History())
    strategy._coulomb(task, task.start, task.start.law)
    assert len(starts) >= 3
    assert np.abs(starts[0]).max() > 0
    for start in starts[1:]:
        np.testing.assert_array_equal(start, starts[0])


def test_the_path_to_gamma_keeps_the_ratio_of_gammas():
    """Both grow together, from a ten thousandth to what is asked for."""

    class Newton:
        stages = ()

        def solve_once(self, data, first_sets, measure):
            self.stages += ((data.gamma_n, data.gamma_t),)
            return Status.CONVERGED

        def continued_sets(self, data):
            return None

    scene = example1(bound=1.5, nx=12, ny=4, gamma=(1e6, 2e5))
    discretisation = discretise(scene.statement, load_mesh(scene, MPI.COMM_SELF), Timings())
    task = contact_task(discretisation, History())
    newton = Newton()
    assert fall_backs._path(newton, task.start.data, None, lambda: None) is Status.CONVERGED
    normal, tangential = np.array(newton.stages).T
    np.testing.assert_allclose(normal, 1e6 * np.logspace(-4, 0, 5), rtol=1e-12)
    np.testing.assert_allclose(tangential, normal / 5, rtol=1e-12)


@pytest.mark.parametrize(("ratio", "kept"), [(0.2, 0.2), (5.0, 5.0), (0.01, 0.1), (1000.0, 10.0)])
def test_path_following_keeps_the_ratio_of_gammas(ratio, kept):
    """gamma_2 follows gamma_1, by a factor of ten at the most, beyond which the model of the path is of no use."""
    solution = alone(example1(bound=1.5, nx=30, ny=10, gamma=(1e6, ratio * 1e6), algorithm="path-following"))
    assert solution.parameters["gamma_t"] == pytest.approx(kept * solution.parameters["gamma_n"], rel=1e-12)


def test_continuation_begins_with_the_first_gamma_that_is_given():
    """And ends with the last."""
    solution = alone(example1(bound=1.5, nx=30, ny=10, gamma=1e8, algorithm="continuation", gamma_first=1e5))
    assert [record.gamma_n for record in solution.history.outer] == pytest.approx([1e5, 1e8], rel=1e-12)


@pytest.mark.parametrize("length", [1e-3, 1e3])
def test_path_following_has_no_unit(length):
    """The path begins at a share of E over the size of the body, and ends at the same gamma times the size."""
    scenes = (
        example1(bound=1.5, nx=30, ny=10, gamma="auto", algorithm="path-following", length_unit=unit)
        for unit in (1.0, length)
    )
    here, there = (alone(scene) for scene in scenes)
    ours, theirs = ([record.gamma_n for record in solution.history.outer] for solution in (there, here))
    np.testing.assert_allclose(np.array(ours) * length, theirs, rtol=1e-6)


@pytest.mark.parametrize("push", [0.7, 0.9])
def test_sets_that_are_forced_are_no_solution(push):
    """One stick node alone holds the body, with more than its bound: its sets come back, and something else must help.

    A block on its foundation that is pushed aside; nodes on its left slip against the push.
    """
    bound = 0.2
    scene = example1(bound=bound, nx=2, ny=1, gamma=1e6)
    pushed = SurfaceTraction(boundary="left", x=3 * bound * push)
    solution = alone(scene.model_copy(update={"displacement": (), "traction": (*scene.traction, pushed)}))
    assert solution.history.outer[0].status == Status.CYCLING.value
    assert solution.converged
    assert np.abs(solution.contact.shear).max() <= bound * (1 + 1e-9)
    _, friction = solution.contact.forces
    assert friction[0] == pytest.approx(-3 * bound * push, rel=1e-6)


def test_both_gammas_grow():
    """With a growth factor augmentation ends with both gammas equally larger, where neither is slow."""
    solution = alone(example1(bound=1.5, nx=30, ny=10, gamma=(1e7, 5e6), algorithm="alm", gamma_factor=2.0))
    grown = solution.parameters["gamma_n"] / 1e7
    assert grown == 2.0 ** (len(solution.history.outer) - 1) > 1.0
    assert solution.parameters["gamma_t"] == pytest.approx(5e6 * grown, rel=1e-12)


@pytest.mark.parametrize("gamma", [3e2, 1e3, 1e4, 1e6])
def test_model_of_the_path(gamma):
    """Where sets do not change the solution is rational in gamma: its distance from the limit is foreseen."""

    def solved(**settings):
        data = {
            "mesh": {"generator": "rectangle", "parameters": {"nx": 24, "ny": 8}},
            "material": {"young": 5000.0, "poisson": 0.3},
            "displacement": {"boundary": "left", "x": 0.0},
            "traction": {"boundary": "top", "y": "-20 - 5 * x[0]"},
            "contact": {"boundary": "bottom", "kind": "bilateral"},
            "solver": settings,
        }
        scene = parse_scene(data)
        discretisation = discretise(scene.statement, load_mesh(scene, MPI.COMM_SELF), Timings())
        task = contact_task(discretisation, History())
        outcome = strategy.solve_task(task, task.start)
        assert outcome.status is Status.CONVERGED
        return task, outcome

    (task, ours), (_, limit) = solved(gamma_n=gamma), solved(algorithm="alm", tolerance=1e-12)
    model = path_model(task.iterate.newton, task.start.data)
    away = limit.displacement().copy()
    away.axpy(-1.0, ours.displacement())
    image = away.duplicate()
    task.system.matrix.mult(away, image)
    assert model.distance == pytest.approx(np.sqrt(image.dot(away)), rel=0.1)
    missing = limit.newton.multipliers()[0] - ours.newton.multipliers()[0]
    assert model.pressure_distance == pytest.approx(task.system.contact.points.norm(missing), rel=0.2)


@pytest.mark.parametrize("shift", [(0.0, 0.0, 0.0), (1.0, -0.5, 0.0)])
def test_slope_of_the_path_in_space(shift):
    """As gamma grows by 1e-4, also where the shear of an earlier load step is not along the slip."""

    def solved(gamma):
        scene = block(6, bound=1.5, gamma=gamma)
        discretisation = discretise(scene.statement, load_mesh(scene, MPI.COMM_SELF), Timings())
        task = contact_task(discretisation, History())
        data = replace(task.start.data, mu_hat=np.einsum("nij,i->nj", discretisation.boundary.tangents, shift))
        newton = task.iterate.newton
        assert newton.solve(data, task.start.sets) is Status.CONVERGED
        return newton, path_model(newton, data)

    (newton, model), (other, _) = solved(1e4), solved(1.0001e4)
    assert newton.problem.sets.slip.sum() >= 8
    moved = other.x - newton.x
    slope = np.sqrt(moved.dot(newton.problem.system.matrix * moved)) / (1e-4 * model.gamma)
    assert model.distance / (model.gamma + model.pole) == pytest.approx(slope, rel=2e-4)


def posed(scene):
    """The contact problem of a scene, not yet solved."""
    d = discretise(scene.statement, load_mesh(scene, MPI.COMM_SELF), Timings())
    return contact_task(d, History())


def test_augmentation_begins_with_small_gammas():
    """Both by the same factor."""
    task = posed(example1(bound=1.5, nx=6, ny=2, gamma=(1e8, 2e7)))
    data = augmented_fall_back.softened(
        task, task.start, strategy.Outcome(Status.CYCLING, task.iterate.newton, task.start.data)
    )
    assert data.gamma_n < 1e7
    assert data.gamma_n / data.gamma_t == pytest.approx(5.0)


@pytest.mark.parametrize(("gap", "kind", "rests"), [(0.01, "unilateral", True), (0.01, "bilateral", False)])
def test_what_moves_a_body_without_load(gap, kind, rests):
    """Bilateral contact at a distance pulls it."""
    scene = {
        "mesh": {"generator": "rectangle", "parameters": {"nx": 6, "ny": 2}},
        "material": {"young": 5000.0, "poisson": 0.3},
        "displacement": {"boundary": "top", "x": 0.0, "y": 0.0},
        "contact": {"boundary": "bottom", "gap": gap, "kind": kind},
    }
    task = posed(parse_scene(scene))
    assert strategy._nothing_acts(task, task.start) is rests


@pytest.mark.parametrize(
    ("contact", "possible"),
    [({}, True), ({"kind": "bilateral"}, True), ({"friction": {"cap": 1.0}}, False)],
)
def test_where_the_monolithic_method_is_tried(monkeypatch, contact, possible):
    """Not with a cap."""
    told = []
    plain = strategy.for_coulomb
    monkeypatch.setattr(strategy, "for_coulomb", lambda **how: told.append(how["monolithic"]) or plain(**how))
    friction = {"law": "coulomb", "coefficient": 0.3} | contact.get("friction", {})
    scene = {
        "mesh": {"generator": "rectangle", "parameters": {"nx": 6, "ny": 2}},
        "material": {"young": 5000.0, "poisson": 0.3},
        "displacement": {"boundary": "top", "x": 0.001, "y": -0.01},
        "contact": {"boundary": "bottom"} | contact | {"friction": friction},
    }
    assert alone(parse_scene(scene)).converged
    assert told == [possible]


def test_the_first_linear_solve_of_augmentation_with_a_fixed_point():
    """That of the start is number 0, as in section 7 of the paper."""
    history = alone(example1(coefficient=0.3, nx=12, ny=4, algorithm="alm", coulomb="fp")).history
    assert [record.iteration for record in history.iterations][:2] == [0, 1]


def test_one_path_for_all_load_steps(monkeypatch):
    """The gamma that path-following has found for the first one is that of the others."""
    calls = []
    plain = strategy.path_following
    monkeypatch.setattr(strategy, "path_following", lambda *given, **how: calls.append(1) or plain(*given, **how))
    scene = {
        "mesh": {"generator": "rectangle", "parameters": {"nx": 6, "ny": 2}},
        "material": {"young": 5000.0, "poisson": 0.3},
        "displacement": {"boundary": "top", "x": 0.001, "y": -0.01, "factors": [0.5, 0.8, 1.0]},
        "contact": {"boundary": "bottom", "friction": {"law": "coulomb", "coefficient": 0.3}},
        "solver": {"algorithm": "path-following"},
    }
    assert len(alone(parse_scene(scene)).steps) == 3
    assert calls == [1]


def test_a_loose_body_without_load_is_not_at_rest():
    """Where it is nothing holds it: every position off the foundation is as good."""
    scene = example1(bound=1.5, nx=6, ny=2).model_copy(update={"displacement": (), "traction": ()})
    assert alone(scene, check=False).status is Status.OPEN


def test_a_path_does_not_end_where_a_stick_node_is_moved():
    """A wall moves the corner of a block that sticks to the ground: at small gammas both hold it half way, and a node
    that will slip still sticks.
    """

    def solved(**solver):
        data = {
            "mesh": {"generator": "rectangle", "parameters": {"length": 1.0, "nx": 2, "ny": 2}},
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": {"boundary": "top", "x": 0.0, "y": -1e-3},
            "contact": [
                {"boundary": "bottom", "friction": {"law": "tresca", "bound": 100.0}},
                {"boundary": "left", "gap": -1e-3},
            ],
            "solver": solver,
        }
        return alone(parse_scene(data))

    path, limit = solved(algorithm="path-following", regularisation_error=0.1), solved(algorithm="alm", tolerance=1e-12)
    stiffness = path.model.stiffness
    away, size = limit.displacement.x.petsc_vec.copy(), limit.displacement.x.petsc_vec.copy()
    away.axpy(-1.0, path.displacement.x.petsc_vec)
    error = np.sqrt(away.dot(stiffness * away) / size.dot(stiffness * size))
    assert error < 2 * path.parameters["regularisation_error"] < 0.2
