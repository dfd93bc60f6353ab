"""The command line as a user meets it: exit codes, result folders, messages, options."""

import csv
import json
import subprocess
import sys
from types import SimpleNamespace

import pytest
from commands import summary_in

from signorini_fx.scenes import cli

SCENE = """
title = "small"
[mesh]
generator = "rectangle"
parameters = { nx = 12, ny = 4 }
[material]
young = 5000.0
poisson = 0.4
[[displacement]]
boundary = "left"
x = 0.0
[[displacement]]
boundary = "right"
x = 0.0
[[traction]]
boundary = "top"
y = "-20 if 1 <= x[0] <= 2 else 0"
[[contact]]
boundary = "bottom"
gap = "0.003*(x[0] - 1.5)**2 + 0.001"
friction = { law = "coulomb", coefficient = 0.3 }
"""


def run(tmp_path, *arguments, scene=SCENE, **environment):
    """Run ``signorini-fx solve`` on a scene; the finished process."""
    path = tmp_path / "small.toml"
    path.write_text(scene)
    command = [
        sys.executable,
        "-m",
        "signorini_fx",
        "solve",
        str(path),
        "--out",
        str(tmp_path / "out"),
        *arguments,
    ]
    return subprocess.run(
        command, capture_output=True, text=True, timeout=300, env=environment or None, check=False
    )


@pytest.fixture
def here(tmp_path, capsys):
    """The same in this process, which need not begin; code and output."""

    def command(*arguments, scene=SCENE):
        path = tmp_path / "small.toml"
        path.write_text(scene)
        code = cli.main(["solve", str(path), "--out", str(tmp_path / "out"), *arguments])
        said = capsys.readouterr()
        return SimpleNamespace(returncode=code, stdout=said.out, stderr=said.err)

    return command


def read_summary(tmp_path):
    return summary_in(tmp_path / "out")


def read_rows(path):
    return list(csv.DictReader(path.read_text().splitlines()))


@pytest.mark.slow
def test_result_folder(tmp_path):
    """Everything that the README promises is there, and the files agree with each other."""
    process = run(tmp_path, "--pdf")
    assert process.returncode == 0, process.stderr
    assert "small: converged" in process.stdout
    files = {path.name for path in (tmp_path / "out").iterdir()}
    assert files >= {
        "summary.json",
        "contact.csv",
        "history.csv",
        "outer.csv",
        "deformed.png",
        "profiles.pdf",
    }
    summary = read_summary(tmp_path)
    assert summary["contact_force"][1] == pytest.approx(20.0, rel=1e-9)
    rows = read_rows(tmp_path / "out" / "contact.csv")
    assert len(rows) == summary["contact_nodes"] == 13
    assert sum(row["state"] != "open" for row in rows) == summary["touching_nodes"] > 0
    assert max(float(row["pressure"]) for row in rows) == summary["max_pressure"]
    assert {row["state"] for row in rows} <= {"open", "stick", "slip+", "slip-"}
    assert [float(row["x"]) for row in rows] == sorted(float(row["x"]) for row in rows)
    solves = read_rows(tmp_path / "out" / "history.csv")
    assert len(solves) == summary["linear_solves"]
    assert not any(
        "step" in rows[0] for rows in (solves, read_rows(tmp_path / "out" / "outer.csv"))
    )


def without_times(value):
    """Summary or rows without what a clock or the operating system says."""
    if isinstance(value, dict):
        times = {"timings", "seconds", "memory", "finished", "next_seconds"}
        times |= {"statement"} if "next_seconds" in value else set()
        return {key: without_times(v) for key, v in value.items() if key not in times}
    return [without_times(item) for item in value] if isinstance(value, list) else value


@pytest.mark.slow
@pytest.mark.parametrize(
    "scene",
    [
        SCENE,
        SCENE + "[solver]\nlevels = 3\n",
        SCENE.replace('"top"', '"top"\nfactors = [0.5, 1.0, 0.2]'),
    ],
    ids=["plain", "levels", "steps"],
)
def test_two_runs_differ_in_times_only(tmp_path, scene):
    """On one rank the same scene gives the same tables, bit by bit, apart from times and memory."""
    found = []
    for _ in range(2):
        assert run(tmp_path, "--no-fields", "--no-pictures", "--quiet", scene=scene).returncode == 0
        tables = {
            file.name: without_times(read_rows(file)) for file in (tmp_path / "out").glob("*.csv")
        }
        # As text: -0.0 equals 0.0, and neither has the bits of the other.
        found.append(json.dumps([without_times(read_summary(tmp_path)), tables]))
    assert found[0] == found[1]


@pytest.mark.one_quick(
    ("old", "new", "path"),
    [
        ("young = 5000.0", "young = ", "syntax"),
        ("young = 5000.0", "yung = 5000.0", "material.yung"),
        ('boundary = "top"', 'boundary = "roof"', "traction[0].boundary"),
        ("young = 5000.0", "young = -1.0", "material.young"),
        ("poisson = 0.4", "poisson = 0.5", "material.poisson"),
        ("coefficient = 0.3", "coefficient = -0.3", "contact[0].friction.coefficient"),
        ("coefficient = 0.3", "coefficient = nan", "contact[0].friction.coefficient"),
        ('"0.003*(x[0] - 1.5)**2 + 0.001"', "\"__import__('os')\"", "contact[0].gap"),
        ('generator = "rectangle"', 'generator = "rectangel"', "mesh.generator"),
        ("nx = 12", "nx = 1_000_000_000", "mesh.parameters.nx"),
    ],
)
def test_bad_scenes(tmp_path, old, new, path):
    """One clear error that names the file and the key, exit code 2, and nothing is left behind."""
    assert old in SCENE
    process = run(tmp_path, scene=SCENE.replace(old, new))
    assert process.returncode == 2
    assert f"small.toml: {path}" in process.stderr
    assert "Traceback" not in process.stderr
    assert not (tmp_path / "out").exists()


def test_no_solution(tmp_path, here):
    """A load that nothing balances ends by name with exit code 1, and the folder says so."""
    process = here("--no-pictures", scene=SCENE.replace('"-20 if', '"20 if'))
    assert process.returncode == 1
    assert process.stderr.count("no static equilibrium") == 1
    assert "what to do" in process.stdout
    assert (
        "certificate" not in process.stdout
    )  # nothing was solved: there are no figures to look at
    assert read_summary(tmp_path)["converged"] is False


def test_old_results_survive_a_bad_scene(tmp_path, here):
    """A run that fails leaves an earlier result as it was."""
    assert here("--no-pictures").returncode == 0
    before = (tmp_path / "out" / "summary.json").read_text()
    assert here(scene=SCENE.replace("top", "roof")).returncode == 2
    assert (tmp_path / "out" / "summary.json").read_text() == before


def test_folder_that_cannot_be_written(tmp_path, here):
    """An output folder that is a file is refused before anything is solved."""
    (tmp_path / "out").write_text("mine")
    process = here()
    assert process.returncode == 2
    assert "cannot be written" in process.stderr
    assert "converged" not in process.stdout


@pytest.mark.one_quick("arguments", [["--help"], ["solve", "--help"], ["--version"]])
def test_help_does_not_import_dolfinx(arguments):
    """Help is there at once."""
    code = (
        "import sys; from signorini_fx.scenes.cli import main\ntry: main(sys.argv[1:])\nexcept "
        "SystemExit: pass\n"
    )
    code += "assert not {'dolfinx', 'petsc4py', 'mpi4py', 'numpy'} & set(sys.modules)"
    subprocess.run(
        [sys.executable, "-c", code, *arguments], check=True, capture_output=True, timeout=60
    )
