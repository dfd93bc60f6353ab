"""What the algorithms are given to start with, and in which order: answers alone would not tell."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from scenes import alone, example1
from spaces import block

from signorini_fx.algebra.algorithms import strategy
from signorini_fx.algebra.algorithms.path_following import path_model
from signorini_fx.mechanics.body.discretisation import discretise
from signorini_fx.records import History, Status, Timings
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.solving.solve_on_mesh import contact_task


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


def test_a_loose_body_without_load_is_not_at_rest():
    """Where it is nothing holds it: every position off the foundation is as good."""
    scene = example1(bound=1.5, nx=6, ny=2).model_copy(update={"displacement": (), "traction": ()})
    assert alone(scene, check=False).status is Status.OPEN
