"""Guaranteed bounds on several ranks: those of one rank, and errors that are raised alike."""

from functools import partial

import numpy as np
import pytest
from bounds_under_references import drawn
from mpi4py import MPI
from scenes import alone, example1
from spread_meshes import on_all_ranks

from signorini_fx.machine import parallel
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
    """Of values of the cells of this rank those of all ranks, in the order of the input of the
    mesh.
    """
    topology, comm = solution.model.tagged.mesh.topology, solution.comm
    numbers = parallel.gather_rows(comm, topology.original_cell_index[: len(values)])
    return parallel.gather_rows(comm, values)[np.argsort(numbers)]


@pytest.mark.one_quick("kind", SCENES)
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
        assert getattr(bound, name) == pytest.approx(
            getattr(expected, name), rel=0, abs=close * expected.error
        )
    assert bound.size == pytest.approx(expected.size, rel=CLOSE)
    of_cells = in_order(by_itself, expected.squares)
    assert in_order(together, bound.squares) == pytest.approx(
        of_cells, rel=0, abs=2 * close * sum(of_cells)
    )
    size = float(np.abs(expected_force).max())
    assert tuple(force) == pytest.approx(tuple(expected_force), abs=close * size)
    assert WORLD.allgather(tuple(force)) == [tuple(force)] * WORLD.size
