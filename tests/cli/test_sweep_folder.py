"""`sweep` stores each value as soon as it is solved, and goes on after a kill."""

import json

import pytest

from signorini_fx.machine.result_files import read_csv
from signorini_fx.scenes import cli
from signorini_fx.scenes import sweep as study

SCENE = """
mesh = { generator = "rectangle", parameters = { length = 2.0, height = 1.0, nx = 8, ny = 4 } }
material = { young = 50.0, poisson = 0.3 }
traction = { boundary = "top", x = 0.2, y = -1.0 }
displacement = { boundary = "left", x = 0.0 }
contact = { boundary = "bottom", friction = { law = "coulomb", coefficient = 0.1 } }
"""
ENTRY = "contact.friction.coefficient"


@pytest.fixture
def sweep(tmp_path):
    """The command on a scene, with the values of a coefficient and further words."""
    (tmp_path / "s.toml").write_text(SCENE)

    def run(values, *words):
        words = ["--set", f"{ENTRY}={values}", "--out", str(tmp_path / "out"), *words]
        return cli.main(["sweep", str(tmp_path / "s.toml"), *words])

    return run


def killed_after(monkeypatch, count):
    """Let the solve of a value be interrupted; returns the number of solves so far."""
    solves, solve = [], study._solved

    def interrupted(*arguments):
        if len(solves) == count:
            raise KeyboardInterrupt
        solves.append(arguments)
        return solve(*arguments)

    monkeypatch.setattr(study, "_solved", interrupted)
    return solves


@pytest.mark.slow
def test_jobs_side_by_side(sweep, tmp_path):
    """The table and the folders are those of one process, and another run goes on from them."""
    assert sweep("0.1:0.3:3") == 0
    table = (tmp_path / "out/sweep.csv").read_text()
    assert sweep("0.1:0.3:3", "--jobs", "2") == 0
    new = [line.split(",") for line in (tmp_path / "out/sweep.csv").read_text().splitlines()]
    old = [line.split(",") for line in table.splitlines()]
    assert new[0] == old[0]
    force = new[0].index("contact_force")
    for row, former in zip(new[1:], old[1:], strict=True):
        assert row[:2] == former[:2]
        assert float(row[force]) == pytest.approx(float(former[force]), rel=1e-6)
    assert (tmp_path / "out/003/summary.json").is_file()
    assert sweep("0.1:0.3:3", "--jobs", "2", "--restart") == 0


def test_a_killed_sweep_goes_on(sweep, tmp_path, monkeypatch, capfd):
    """What is complete is there, is not solved again, and the table is that of a whole run."""
    assert sweep("0.1:0.4:4") == 0
    whole = {name: column.tolist() for name, column in read_csv(tmp_path / "out/sweep.csv").items()}
    with monkeypatch.context() as patch:
        killed_after(patch, 2)
        assert sweep("0.1:0.4:4") == 130
    said = capfd.readouterr().err
    assert f"interrupted: 2 of 4 values are in {tmp_path / 'out'}/; --restart goes on" in said
    stored = read_csv(tmp_path / "out/sweep.csv")
    assert stored[ENTRY].tolist() == [0.1, 0.2]
    with monkeypatch.context() as patch:
        solves = killed_after(patch, 9)
        assert sweep("0.1:0.4:4", "--restart") == 0
        assert len(solves) == 2
    table = read_csv(tmp_path / "out/sweep.csv")
    for name in (ENTRY, "contact_force", "friction_force", "max_pressure", "stick_area"):
        assert table[name].tolist() == pytest.approx(whole[name], rel=1e-6)
    for number, coefficient in enumerate(table[ENTRY], start=1):
        summary = json.loads((tmp_path / f"out/{number:03d}/summary.json").read_text())
        assert summary["scene"]["contact"][0]["friction"]["coefficient"] == coefficient


def test_another_sweep_is_not_continued(sweep, tmp_path, capsys):
    """Of other values, of another scene; results of values of an earlier sweep go."""
    assert sweep("0.1:0.4:4") == 0
    assert sweep("0.1,0.2") == 0
    assert sorted(path.name for path in (tmp_path / "out").glob("0*")) == ["001", "002"]
    assert sweep("0.1,0.3", "--restart") == 2
    assert "values: is another one in the sweep to go on from" in capsys.readouterr().err
    scene = tmp_path / "s.toml"
    scene.write_text(scene.read_text().replace("50.0", "60.0"))
    assert sweep("0.1,0.2", "--restart") == 2
    assert "scene: is another one" in capsys.readouterr().err


def test_whole_numbers_are_no_time(sweep, tmp_path):
    """TOML reads 10:12:02 as a time of day."""
    words = ["--set", "mesh.parameters.nx=10:12:02", "--out", str(tmp_path / "out")]
    assert cli.main(["sweep", str(tmp_path / "s.toml"), *words]) == 0
    assert read_csv(tmp_path / "out/sweep.csv")["mesh.parameters.nx"].tolist() == [10.0, 12.0]


def test_all_combinations(sweep, tmp_path, capsys):
    """Of the values of two entries, those of the last one first."""
    words = ["--set", "traction.y=-1,-2", "-o", str(tmp_path / "out")]
    assert sweep("0.1,0.3", *words) == 0
    table = read_csv(tmp_path / "out/sweep.csv")
    assert table[ENTRY].tolist() == [0.1, 0.1, 0.3, 0.3]
    assert table["traction.y"].tolist() == [-1.0, -2.0, -1.0, -2.0]
    assert table["contact_force"].tolist() == pytest.approx([2.0, 4.0, 2.0, 4.0])
    first = capsys.readouterr().out.splitlines()[0].split()
    assert first[:2] == ["coefficient", "y"]
