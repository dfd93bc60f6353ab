"""Result folders: only what an earlier run has written is replaced or removed, whatever else is
there.
"""

import shutil
import tomllib
from functools import cache

import pytest
from mpi4py import MPI
from scenes import alone, example1

from signorini_fx.addons.report import page as report_page
from signorini_fx.addons.report.page import write_report
from signorini_fx.errors import MissingPackageError, OutputError
from signorini_fx.machine import manifest
from signorini_fx.records import History
from signorini_fx.results import files
from signorini_fx.results.folder import ResultFolder
from signorini_fx.scenes import solver
from signorini_fx.scenes.cli import main
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve
from signorini_fx.solving.restart import StoredStates

SELF = MPI.COMM_SELF
SCENE = """
mesh = { generator = "rectangle", parameters = { nx = 4, ny = 2 } }
material = { young = 5000.0, poisson = 0.4 }
solver = { levels = 2 }
[[displacement]]
boundary = "top"
x = 0.0
y = -0.01
[[contact]]
boundary = "bottom"
"""


def content(folder):
    """All files and what is in them."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file()
    }


@pytest.fixture(scope="module")
def solution():
    """A small solution."""
    return alone(example1(bound=1.5, nx=6, ny=2))


@pytest.fixture
def scene(tmp_path):
    """A file with a scene, and a folder for its results."""
    file = tmp_path / "scene.toml"
    file.write_text(SCENE)
    (tmp_path / "out").mkdir()
    return file


@pytest.mark.parametrize(
    "name", ["history.csv", "report.html", "fields/a.txt", "checkpoint/deep/er.txt", "summary.json"]
)
def test_files_of_others(scene, tmp_path, monkeypatch, capsys, name):
    """They are named and stay, and nothing is solved."""
    out = tmp_path / "out"
    (out / name).parent.mkdir(parents=True, exist_ok=True)
    (out / name).write_text("mine")
    monkeypatch.setattr(solver, "solve", lambda *_, **__: pytest.fail("it was solved"))
    before = content(out)
    assert main(["solve", str(scene), "--out", str(out)]) == 2
    assert f"{out}: {name}: no earlier run lists this as its own" in capsys.readouterr().err
    assert content(out) == before


def test_the_result_of_another_scene(scene, tmp_path, capsys):
    """It is replaced, and the command says so before it solves; the result of the same scene is
    replaced as always.
    """
    out = tmp_path / "out"
    solved = ["solve", str(scene), "--out", str(out), "--no-fields", "--no-pictures"]
    told = []
    for title in ("punch", "punch", "seal"):
        scene.write_text(f'title = "{title}"\n{SCENE}')
        assert main(solved) == 0
        told.append("another scene, 'punch', will be replaced" in capsys.readouterr().out)
    assert told == [False, False, True]


def test_a_file_that_appears_meanwhile(solution, tmp_path):
    """What was not there when the run began is not replaced at its end."""
    folder = ResultFolder(SELF, tmp_path, files.FILES)
    (tmp_path / "history.csv").write_text("mine")
    with pytest.raises(OutputError, match=r"history\.csv: no earlier run"):
        files.write_results(solution, folder, fields=False, pictures=False)
    assert content(tmp_path) == {"history.csv": b"mine"}


@pytest.mark.parametrize(
    "line", ["../mine.txt", "/{folder}/mine.txt", "link/mine.txt", "a/../../mine.txt", "fields"]
)
def test_a_manifest_of_others(solution, tmp_path, line):
    """What a manifest says of places outside does not count; no folder is removed with what is in
    it.
    """
    out = tmp_path / "out"
    (out / "fields").mkdir(parents=True)
    (out / "link").symlink_to(tmp_path)
    (tmp_path / "mine.txt").write_text("mine")
    (out / manifest.MANIFEST).write_text(line.format(folder=tmp_path) + "\n")
    if line == "fields":
        (out / "fields" / "mine.txt").write_text("mine")
        with pytest.raises(OutputError, match=r"fields/mine\.txt"):
            files.write_results(solution, out, fields=False, pictures=False)
    else:
        files.write_results(solution, out, fields=False, pictures=False)
    assert (tmp_path / "mine.txt").read_text() == "mine"
    assert (out / "link").is_symlink()


def test_what_a_killed_run_leaves(tmp_path, monkeypatch):
    """Its checkpoint and its hidden folders are known to the next run, which removes them."""
    scene, out = parse_scene(tomllib.loads(SCENE)), tmp_path / "out"
    solution = solve(scene, SELF, checkpoint=out)
    manifest.begin_part(out / "checkpoint")
    (out / "checkpoint" / manifest.PART / "half").write_text("half")
    manifest.begin_part(out)
    history = History()
    StoredStates(SELF, out, scene, history, restart=True)
    assert "2 complete load steps" in history.events[0]
    monkeypatch.setattr(
        manifest, "remove", lambda _: 1 / 0
    )  # killed while the folder is put in order
    with pytest.raises(ZeroDivisionError):
        files.write_results(solution, out, fields=False, pictures=False)
    monkeypatch.undo()
    shutil.rmtree(out / manifest.PART, ignore_errors=True)
    files.write_results(solution, out, fields=False, pictures=False)
    tables = {f"{name}.csv" for name in ("contact", "history", "outer", "convergence_table")}
    assert set(content(out)) == {"summary.json", manifest.MANIFEST, *tables}
    assert not (out / "checkpoint").exists()


def test_a_checkpoint_of_others(tmp_path):
    """From Python too it is refused before anything is solved."""
    (tmp_path / "checkpoint").mkdir()
    (tmp_path / "checkpoint" / "mine.txt").write_text("mine")
    with pytest.raises(OutputError, match=r"checkpoint/mine\.txt: no earlier run"):
        solve(parse_scene(tomllib.loads(SCENE)), SELF, checkpoint=tmp_path)
    assert content(tmp_path) == {"checkpoint/mine.txt": b"mine"}


@pytest.mark.slow
def test_reports(solution, tmp_path, monkeypatch):
    """A report replaces a report, no other file."""
    files.write_results(solution, tmp_path / "out", fields=False, pictures=False)
    monkeypatch.setattr(report_page, "page", cache(report_page.page))  # its pictures are drawn once
    for file in (None, tmp_path / "mine.html"):
        assert write_report(tmp_path / "out", file) == write_report(tmp_path / "out", file)
        place = file or tmp_path / "out" / "report.html"
        place.write_text("mine")
        with pytest.raises(OutputError, match="already exists, and is no report"):
            write_report(tmp_path / "out", file)
        assert place.read_text() == "mine"


@pytest.mark.parametrize(
    "words",
    [
        ["solve", "SCENE", "--out", ""],
        ["solve", ""],
        ["report", ""],
        ["report", "out", "--out", ""],
        ["new", ""],
    ],
)
def test_empty_names(scene, tmp_path, monkeypatch, capsys, words):
    """A variable of the shell that is not set does not mean the current folder."""
    monkeypatch.chdir(tmp_path)
    before = content(tmp_path)
    with pytest.raises(SystemExit) as ended:
        main([word.replace("SCENE", str(scene)) for word in words])
    assert ended.value.code == 2
    assert "a name is expected, got ''" in capsys.readouterr().err
    assert content(tmp_path) == before


def test_without_matplotlib(solution, tmp_path, monkeypatch):
    """The results are whole, and a note says which package draws them; a picture that is asked for
    is an error.
    """

    def missing(name):
        raise MissingPackageError(
            f"{name!r} needs matplotlib, which is not installed: pip install matplotlib"
        )

    monkeypatch.setattr(files, "add_on", missing)
    summary = files.write_results(solution, tmp_path)
    (note,) = [finding for finding in summary["findings"] if finding["path"] == "pictures"]
    assert note["level"] == "note"
    assert "pip install matplotlib" in note["message"]
    assert not list(tmp_path.glob("*.png"))
    with pytest.raises(MissingPackageError, match="pip install matplotlib"):
        files.write_results(solution, tmp_path, pictures=["von_mises"])
