"""In any tree of folders a run removes and replaces only what an earlier run into the same folder
has written.
"""

import os
import random
import shutil
import tomllib
from functools import partial
from pathlib import Path

import pytest
from mpi4py import MPI
from scenes import alone, example1

from signorini_fx.addons.report.page import write_report
from signorini_fx.errors import OutputError, ResultError
from signorini_fx.machine import manifest
from signorini_fx.results import files
from signorini_fx.scenes import sweep
from signorini_fx.scenes.cli import main
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

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
NAMES = ("a", "b", "results", "fields", "checkpoint", "displacement", "0-00000")
STRANGERS = (
    *("notes.txt", "contact.csv", "summary.json", "history.csv", "sweep.csv", "report.html"),
    *("stress", "fields/a.vtu", "fields.vtu", "checkpoint/0-00000/mine.npz"),
)


def every(root):
    """All files and links below a folder: what is in them, where they lead."""
    found = {}
    for place, folders, names in os.walk(root):
        for name in (*folders, *names):
            path = Path(place, name)
            if path.is_symlink():
                found[path] = os.readlink(path)
            elif path.is_file():
                found[path] = path.read_bytes()
    return found


class Tree:
    """A tree of folders that remembers which folder's run has written each file."""

    def __init__(self, root, solution, killed, chance):
        self.root, self.solution, self.killed, self.chance = root, solution, killed, chance
        self.writer = {}  # of each file: the folder that the run was told to fill; None: a stranger

    def run(self, folder, run):
        """Run something that fills a folder, and check that all that others have written is still
        there.
        """
        before = every(self.root)
        refused = False
        try:
            refused = run(folder) == 2
        except OutputError:
            refused = True
        after = every(self.root)
        lost = {path for path in before if after.get(path) != before[path]}
        assert {path for path in lost if self.writer.get(path) != folder} == set()
        if refused:
            assert {path for path in lost if path.name != manifest.MANIFEST} == set()
        self.writer = {path: self.writer.get(path) for path in after}
        self.writer.update({path: folder for path in after if path not in before or path in lost})
        return refused

    def grow(self, folder, depth):
        """Random results, strangers' files, links and half-written runs, in a folder and below
        it.
        """
        folder.mkdir(exist_ok=True)
        for what in self.chance.sample(("result", "fields", "killed", "part", "file", "link"), 3):
            self.put(folder, what)
        for name in self.chance.sample(NAMES, self.chance.randrange(3) if depth else 0):
            if not (folder / name).exists():
                self.grow(folder / name, depth - 1)

    def put(self, folder, what):
        """One thing in a folder."""
        if what in ("result", "fields"):
            self.run(folder, partial(write, self.solution, what == "fields"))
        elif what == "killed" and not any(folder.iterdir()):
            shutil.copytree(self.killed, folder, dirs_exist_ok=True)
            self.writer.update(dict.fromkeys(every(folder), folder))
        elif what == "part" and not (folder / manifest.PART).exists():
            manifest.begin_part(folder)
            (folder / manifest.PART / "half").write_text("half")
            self.writer.update(dict.fromkeys(every(folder / manifest.PART), folder))
        elif what == "file":
            path = folder / self.chance.choice(STRANGERS)
            if not os.path.lexists(path) and not any(map(Path.is_symlink, path.parents)):
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(f"mine {path}")
                self.writer[path] = None
        elif what == "link":
            path = folder / self.chance.choice((*NAMES, *STRANGERS[:7]))
            if not os.path.lexists(path):
                path.symlink_to(
                    self.chance.choice([self.root / "outside", self.root / "outside" / "mine.txt"])
                )
                self.writer[path] = None


def write(solution, fields, folder):
    """The files of a solution."""
    files.write_results(solution, folder, fields=fields, pictures=False)


def report(folder):
    """The report of a result folder; a folder without a result has none."""
    try:
        write_report(folder)
    except (ResultError, OutputError):
        return 2
    return 0


@pytest.fixture(scope="module")
def solution():
    """A small solution."""
    return alone(example1(bound=1.5, nx=6, ny=2))


@pytest.fixture(scope="module")
def killed(tmp_path_factory, solution):
    """What a run leaves that was killed after its first mesh."""
    folder = tmp_path_factory.mktemp("killed") / "out"
    solve(parse_scene(tomllib.loads(SCENE)), SELF, checkpoint=folder)
    manifest.begin_part(folder)
    (folder / manifest.PART / "half").write_text("half")
    return folder


@pytest.mark.slow
def test_what_is_not_of_this_run_stays(solution, killed, tmp_path, monkeypatch, capsys):
    """In random trees every command is run on each level in a random order: what others have
    written stays as it is.
    """
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE)
    # Sweeps write their files as always; what is in them does not matter here.
    monkeypatch.setattr(sweep, "sweep", lambda scene, path, values, comm: iter(values))
    monkeypatch.setattr(
        sweep, "row_of", lambda value, solution: {"value": value, "status": "converged"}
    )
    monkeypatch.setattr(sweep, "line_of", str)
    monkeypatch.setattr("signorini_fx.scenes.cli.commands.EXIT_NO_SOLUTION", 0)
    refusals = runs = 0
    for seed in range(6):
        chance = random.Random(seed)
        root = tmp_path / str(seed)
        (root / "outside").mkdir(parents=True)
        (root / "outside" / "mine.txt").write_text("mine")
        tree = Tree(root, solution, killed, chance)
        tree.grow(root / "top", 2)
        commands = [
            lambda out: main(
                ["solve", str(scene), "--out", str(out), "--no-fields", "--no-pictures", "--quiet"]
            ),
            lambda out: main(
                ["sweep", str(scene), "--out", str(out), "--set", "material.young=1:2:2"]
            ),
            report,
            partial(write, solution, False),
            partial(write, solution, True),
        ]
        levels = [
            Path(place)
            for place, _, _ in os.walk(root / "top")
            if not place.endswith(manifest.PART)
        ]
        for folder in chance.sample(levels, min(len(levels), 4)):
            for command in chance.sample(commands, 2):
                refusals += tree.run(folder, command)
                runs += 1
        capsys.readouterr()
        shutil.rmtree(root)
    assert 0 < refusals < runs
