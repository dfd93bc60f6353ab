"""What ranks send to each other: nothing of the size of the body, messages of any size."""

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from benchmarks.costs.bytes_of_ranks import block, pair, solved
from signorini_fx.machine import parallel
from signorini_fx.mechanics.mesh.tagged import largest_distance

# They grow with the surface of the body, as what is in contact does, and not with its volume.
OF_SIZE = 5.0


def received(scene, folder):
    """The bytes that a rank receives for a solution with results, by the place that asks."""
    return solved(scene, Path(MPI.COMM_WORLD.bcast(str(folder))))[1]


@pytest.mark.mpi
def test_nothing_of_the_size_of_the_body(tmp_path):
    """Eight times the cells, four times the points in contact: from no place are more than about
    four times as many bytes sent.
    """
    coarse, fine = (received(block(cells), tmp_path / str(cells)) for cells in (3, 6))
    grown = {place: fine[place] / coarse[place] for place in coarse if coarse[place]}
    assert coarse or MPI.COMM_WORLD.size == 1
    assert {place: ratio for place, ratio in grown.items() if ratio > OF_SIZE} == {}


@pytest.mark.mpi
@pytest.mark.parametrize("law", [{}, {"law": "neo-hooke"}], ids=["kept", "sliding"])
def test_nothing_of_the_size_of_two_bodies(law, tmp_path):
    """Sides that slide or keep their partners: three times the unknowns with the same points, and
    2.2 times the surface, or four times the points.
    """
    thin, thick, wide = (
        received(pair(cells, layers, **law), tmp_path / f"{cells} {layers}")
        for cells, layers in ((4, 1), (4, 5), (8, 1))
    )
    assert ("mechanics/pairs/pair_side.py rows" in thin) == (MPI.COMM_WORLD.size > 1)
    for other, most in ((thick, 2.5), (wide, OF_SIZE)):
        grown = {place: other.get(place, 0) / thin[place] for place in thin if thin[place]}
        assert {place: ratio for place, ratio in grown.items() if ratio > most} == {}


@pytest.mark.mpi
def test_large_messages(monkeypatch):
    """Rows that are too many for one message are gathered all the same."""
    comm = MPI.COMM_WORLD
    rows = np.arange(3.0 * (comm.rank + 2)).reshape(-1, 3) + 100 * comm.rank
    whole = parallel.gather_rows(comm, rows)
    monkeypatch.setattr(parallel, "LARGEST_MESSAGE", 8)
    assert (parallel.gather_rows(comm, rows) == whole).all()
    assert (parallel.gather_rows(comm, rows > 100) == (whole > 100)).all()
    on_root = parallel.rows_on_root(comm, rows)
    assert (on_root == (whole if comm.rank == 0 else whole[:0])).all()


def test_the_largest_distance():
    """Of points on a sphere, in a block, on a line, and of one: as each with each."""
    points = np.random.default_rng(1).normal(size=(500, 3))
    sphere = points / np.linalg.norm(points, axis=1)[:, None]
    block = np.mgrid[:9, :7, :3].reshape(3, -1).T * [0.1, 1.0, 3.0]
    for x in (sphere, points, block, block[:, :2], block[:5], block[:1]):
        each = np.linalg.norm(x[:, None] - x, axis=-1).max()
        assert largest_distance(x) == pytest.approx(each, rel=1e-15)
