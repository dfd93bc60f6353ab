"""The command that judges a result, on any number of ranks."""

import json
from pathlib import Path

import pytest
from mpi4py import MPI

from signorini_fx.scenes import cli

DATA, WORLD = Path(__file__).parent / "data", MPI.COMM_WORLD


@pytest.mark.mpi
@pytest.mark.parametrize(("result", "code"), [("shelf_CPE4.dat", 0), ("absent.dat", 2)])
def test_all_ranks_end_with_the_verdict(result, code, capsys):
    """The first one reads and solves, and prints it once."""
    command = ["judge", str(DATA / "shelf_CPE4.inp"), str(DATA / result), "--json"]
    assert WORLD.allgather(cli.main(command)) == [code] * WORLD.size
    printed = capsys.readouterr()
    assert (printed.out != "") == (WORLD.rank == 0 and code != 2)
    assert (printed.err != "") == (WORLD.rank == 0 and code == 2)
    if printed.out:
        assert json.loads(printed.out)["exit_code"] == code
