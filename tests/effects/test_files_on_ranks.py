"""Tables and surfaces that only some ranks see: one error on all of them, and no rank waits."""

import pytest
from mpi4py import MPI
from scene_tables import fixed, rectangle_mesh

from signorini_fx.errors import SceneError
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

COMM = MPI.COMM_WORLD
TABLES = {"temperature": ("x,y,change\n0,0,1\n1,0,1\n0,1,1\n1,1,1\n", {})}


@pytest.mark.mpi
@pytest.mark.parametrize("key", TABLES)
def test_a_table_that_the_first_rank_has_alone(key, tmp_path):
    """The folder of each rank is its own, as on machines without a shared disk."""
    text, more = TABLES[key]
    file = tmp_path / "table.csv"
    if COMM.rank == 0:
        file.write_text(text, encoding="utf-8")
    scene = parse_scene(
        {
            "mesh": rectangle_mesh(4, 4, length=1.0, height=1.0),
            "material": {"young": 1000.0, "poisson": 0.3, "expansion": 1e-5},
            "displacement": fixed("left", "x"),
            "traction": {"boundary": "top", "y": -1.0},
            "contact": {"boundary": "bottom"},
            key: [{"file": str(file)} | more],
        }
    )
    if COMM.size == 1:
        assert solve(scene).converged
        return
    with pytest.raises(SceneError, match=rf"{key}\[0\]: .*table.csv: rank 1 has no such file"):
        solve(scene)
