"""What is said about a result that stands may fail, on any rank: the result is kept, and nobody
waits for ever.
"""

import pytest
from commands import summary_in
from mpi4py import MPI
from scenes import alone, example1

from signorini_fx.addons.pictures import results
from signorini_fx.addons.report.page import write_report
from signorini_fx.errors import ResultError
from signorini_fx.machine.manifest import MANIFEST, PART
from signorini_fx.results import files
from signorini_fx.results.files import write_results
from signorini_fx.results.solution import Solution
from signorini_fx.scenes import cli
from signorini_fx.scenes.solver import solve

COMM = MPI.COMM_WORLD


def fails(*ignored, **options):
    raise ArithmeticError("a factorisation broke down")


def fails_on(rank, function):
    """A function that fails at its end on one rank, or on all of them where ``rank`` is None."""

    def act(*arguments, **options):
        result = function(*arguments, **options)
        return fails() if rank in (None, COMM.rank) else result

    return act


@pytest.fixture(scope="module")
def solution():
    """A solution."""
    scene = example1(coefficient=0.3, nx=6, ny=2)
    return solve(scene, COMM)


@pytest.mark.mpi
@pytest.mark.one_quick("rank", [0, 1, None])
def test_a_failure_is_one_of_all_ranks(rank, solution, tmp_path, monkeypatch):
    """Whichever rank it is on: the same warnings everywhere, and the results are there."""
    if rank == 1 and COMM.size == 1:
        pytest.skip("there is no such rank")
    folder = COMM.bcast(tmp_path) / "results"
    monkeypatch.setattr(files._Written, "_tables", fails_on(rank, files._Written._tables))
    monkeypatch.setattr(files._Written, "_pictures", fails_on(rank, lambda self, *tables: None))
    for name in ("friction_used", "cost"):
        known = fails_on(rank, getattr(Solution, name).func)
        monkeypatch.setattr(Solution, name, property(known))
    summary = write_results(solution, folder)
    warned = [found["path"] for found in summary["findings"] if "broke down" in found["message"]]
    assert warned == ["tables", "friction_used", "cost", "pictures"], summary["findings"]
    assert all(other == summary["findings"] for other in COMM.allgather(summary["findings"]))
    COMM.Barrier()
    there = {path.name for path in folder.iterdir()}
    assert there == {
        "summary.json",
        "contact.csv",
        "history.csv",
        "outer.csv",
        *there & set(files.FILES),
        MANIFEST,
    }
    assert not any(path.suffix == ".png" for path in folder.iterdir())
    assert summary_in(folder)["findings"] == summary["findings"]
    COMM.Barrier()


SCENE = """
mesh = { generator = "rectangle", parameters = { nx = 6, ny = 2 } }
material = { young = 5000.0, poisson = 0.3 }
[[displacement]]
boundary = "top"
x = 0.0
y = -0.01
[[contact]]
boundary = "bottom"
friction = { law = "coulomb", coefficient = 0.3 }
"""


def test_ctrl_c_during_an_afterthought(tmp_path, monkeypatch, capfd):
    """The results are kept, and the message says where they are."""
    (tmp_path / "scene.toml").write_text(SCENE)

    def interrupted(*ignored, **options):
        raise KeyboardInterrupt

    monkeypatch.setattr(results, "gather_pictures", interrupted)
    out = tmp_path / "out"
    assert (
        cli.main(["solve", str(tmp_path / "scene.toml"), "--out", str(out), "--no-fields"]) == 130
    )
    assert f"interrupted: the results are in {out}/" in capfd.readouterr().err
    summary = summary_in(out)
    assert [found["path"] for found in summary["findings"] if "is missing" in found["message"]] == [
        "pictures"
    ]
    assert "cost" in summary
    assert not (out / PART).exists()


def test_a_report_that_fails_costs_no_result(tmp_path, monkeypatch):
    """Nothing in the folder changes."""
    write_results(
        alone(example1(bound=1.5, nx=6, ny=2)), tmp_path / "out", pictures=False, fields=False
    )
    before = {path: path.read_bytes() for path in (tmp_path / "out").iterdir()}
    monkeypatch.setattr("signorini_fx.addons.report.page._page", fails)
    with pytest.raises(ResultError, match="broke down"):
        write_report(tmp_path / "out")
    assert {path: path.read_bytes() for path in (tmp_path / "out").iterdir()} == before
