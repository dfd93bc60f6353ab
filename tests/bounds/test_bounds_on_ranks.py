"""Guaranteed bounds on several ranks: those of one rank, and errors that are raised alike."""

from functools import partial

import numpy as np
import pytest
from bounds_under_references import drawn
from mpi4py import MPI
from scenes import alone, example1
from spread_meshes import on_all_ranks

from signorini_fx.addons.bounds import error_bound as proof
from signorini_fx.addons.bounds import scene_arrays
from signorini_fx.addons.bounds.bounded_scene import BOUNDED
from signorini_fx.machine import parallel
from signorini_fx.mechanics.effects.displacement import PrescribedDisplacement
from signorini_fx.mechanics.statement.settings import Accuracy
from signorini_fx.quantities.proved_statements import ErrorBound
from signorini_fx.scenes.solver import solve

pytestmark = pytest.mark.mpi
WORLD = MPI.COMM_WORLD
# Relative; what systems and sums leave, which the bound counts beside this.
CLOSE = 1e-7

SCENES = {
    "plane": partial(drawn, "one body: plane", 1),
    "two cells": partial(
        example1, bound=1.5, nx=1, ny=1, cell="triangle"
    ),  # fewer than ranks, and a jump between nodes
    "degree 2": partial(example1, bound=1.5, nx=6, ny=2, degree=2, cell="triangle"),
    "two bodies": partial(drawn, "two bodies: plane", 5),
    "space": partial(drawn, "one body: space", 8),
    "two bodies in 3D": partial(drawn, "two bodies: space", 11),
}


def in_order(solution, values):
    """Of values of the cells of this rank those of all ranks, in the order of the input of the mesh."""
    topology, comm = solution.model.tagged.mesh.topology, solution.comm
    numbers = parallel.gather_rows(comm, topology.original_cell_index[: len(values)])
    return parallel.gather_rows(comm, values)[np.argsort(numbers)]


@pytest.mark.parametrize("kind", SCENES)
def test_one_rank_or_many(kind):
    """Error, its parts and those of the cells, energy, force and words."""
    scene = SCENES[kind]()
    together, by_itself = solve(on_all_ranks(scene), WORLD, check=False), alone(scene, check=False)
    bound, expected = together.error_bound, by_itself.error_bound
    assert WORLD.allgather(str(bound)) == [str(bound)] * WORLD.size
    boundary, axis = scene.contact[0].boundary, tuple(np.eye(by_itself.model.dimension)[-1])
    force, expected_force = (one.force_bounds(boundary, axis) for one in (together, by_itself))
    if isinstance(expected, str):
        assert (bound, force) == (expected, expected_force)
        return
    close = CLOSE + 2 * max(bound.round_off, expected.round_off) / expected.error
    assert close < 1e-4
    for name in ("duality", "moved", "error"):
        assert getattr(bound, name) == pytest.approx(getattr(expected, name), rel=0, abs=close * expected.error)
    assert bound.size == pytest.approx(expected.size, rel=CLOSE)
    of_cells = in_order(by_itself, expected.squares)
    assert in_order(together, bound.squares) == pytest.approx(of_cells, rel=0, abs=2 * close * sum(of_cells))
    size = float(np.abs(expected_force).max())
    assert tuple(force) == pytest.approx(tuple(expected_force), abs=close * size)
    assert WORLD.allgather(tuple(force)) == [tuple(force)] * WORLD.size


def test_an_accuracy_that_is_certified():
    """The shares of the cells say where the mesh gets finer."""
    scene = example1(bound=1.5, nx=12, ny=4, gamma="auto", cell="triangle")
    scene = scene.model_copy(update={"accuracy": Accuracy(target=0.1, certified=True)})
    together, by_itself = solve(scene, WORLD), alone(scene)
    assert together.error_bound.relative <= 0.1
    cells = [solution.model.tagged.mesh.topology.index_map(2).size_global for solution in (together, by_itself)]
    assert cells[0] == pytest.approx(cells[1], rel=0.2)  # meshes differ


@pytest.mark.parametrize("rank", [0, WORLD.size - 1], ids=["first", "last"])
def test_an_error_of_one_rank_is_raised_on_all(rank, monkeypatch):
    """No rank waits for one that cannot send its part."""
    solution = solve(example1(nx=6, ny=2, cell="triangle"), WORLD)
    sent = scene_arrays._points

    def points(contact):
        if WORLD.rank == rank:
            raise MemoryError("no room")
        return sent(contact)

    monkeypatch.setattr(scene_arrays, "_points", points)
    with pytest.raises(MemoryError, match="no room"):
        _ = solution.error_bound


def test_an_error_of_the_bound_is_raised_on_all(monkeypatch):
    """The rank that computes the bound sends what it raised."""
    solution = solve(example1(nx=6, ny=2, cell="triangle"), WORLD)

    def fails(*arguments):
        raise np.linalg.LinAlgError("no factor")

    monkeypatch.setattr(proof.Bounded, "bound", fails)
    with pytest.raises(np.linalg.LinAlgError, match="no factor"):
        _ = solution.error_bound


def test_what_has_no_bound():
    """The same reason on all ranks."""
    scene = example1(nx=6, ny=2, cell="triangle")
    held = (*scene.displacement, PrescribedDisplacement(at=(0.0, 1.0), x=0.0))
    pinned = solve(scene.model_copy(update={"displacement": held}), WORLD).error_bound
    assert WORLD.allgather(pinned) == [f"{BOUNDED}; this scene has a support of a point"] * WORLD.size
    assert isinstance(solve(scene, WORLD).error_bound, ErrorBound)
