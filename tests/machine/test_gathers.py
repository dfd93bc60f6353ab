"""What ranks send to each other: nothing of the size of the body, messages of any size."""

import sys
import tomllib
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from signorini_fx import solve, write_results
from signorini_fx.machine import parallel
from signorini_fx.mechanics.mesh.tagged import largest_distance
from signorini_fx.scenes.reading import parse_scene

BLOCK = """
mesh = { generator = "box", parameters = { nx = NX, ny = NY, nz = NZ } }
material = { young = 5000.0, poisson = 0.3 }
displacement = { boundary = "top", x = 0.002, y = 0.0, z = -0.01 }
contact = { boundary = "bottom", friction = { law = "coulomb", coefficient = 0.3 } }
solver = { linear_algebra = "krylov" }
"""
# They grow with the surface of the body, as what is in contact does, and not with its volume.
OF_SIZE = 5.0


def bytes_by_caller(monkeypatch, solved):
    """Return the bytes of all ranks' rows by the place from where they are gathered."""
    sent = Counter()
    with monkeypatch.context() as patch:
        for name in ("gather_rows", "rows_on_root"):
            gather = getattr(parallel, name)

            def counted(comm, rows, gather=gather):
                code = sys._getframe(1).f_code
                sent[f"{code.co_filename.rpartition('signorini_fx/')[2]} {code.co_name}"] += (
                    comm.allreduce(np.asarray(rows).nbytes)
                )
                return gather(comm, rows)

            patch.setattr(parallel, name, counted)
        solved()
    return sent


@pytest.mark.mpi
def test_nothing_of_the_size_of_the_body(monkeypatch, tmp_path):
    """Eight times the cells, four times the points in contact: from no place are more than about
    four times as many bytes sent.
    """
    folder = Path(MPI.COMM_WORLD.bcast(str(tmp_path)))

    def sent(n):
        text = BLOCK.replace("NX", str(3 * n)).replace("NY", str(n)).replace("NZ", str(n))

        def solved():
            write_results(solve(parse_scene(tomllib.loads(text))), folder / str(n), pictures=False)

        return bytes_by_caller(monkeypatch, solved)

    coarse, fine = sent(3), sent(6)
    grown = {place: fine[place] / coarse[place] for place in coarse if coarse[place]}
    assert coarse
    assert {place: ratio for place, ratio in grown.items() if ratio > OF_SIZE} == {}


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
