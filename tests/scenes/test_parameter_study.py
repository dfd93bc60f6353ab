"""Entries of a scene that the command line changes, and studies of several values of one."""

import csv
import math
import tomllib

import pytest

from signorini_fx import Contact, Coulomb
from signorini_fx.errors import SceneError
from signorini_fx.scenes import cli
from signorini_fx.scenes.reading import changed, parse_scene, parsed_change

PUSHED = """
[mesh]
generator = "rectangle"
parameters = { nx = 12, ny = 4 }
[material]
young = 5000.0
poisson = 0.3
[[traction]]
boundary = "top"
y = -20.0
x = 5.0
[[contact]]
boundary = "bottom"
friction = { law = "coulomb", coefficient = 0.5 }
"""


@pytest.mark.parametrize(
    ("text", "path", "value"),
    [
        ("solver.levels=3", "solver.levels", 3),
        ("contact[0].friction.coefficient=0.3", "contact[0].friction.coefficient", 0.3),
        ("solver.algorithm=alm", "solver.algorithm", "alm"),
        ('title="a = b"', "title", "a = b"),
        ("title=a = b", "title", "a = b"),
        ("traction[1].factors=[0.0, 1.0]", "traction[1].factors", [0.0, 1.0]),
        ("contact.gap=0.1*x[0]", "contact.gap", "0.1*x[0]"),
        (" mesh.parameters.nx = 4", "mesh.parameters.nx", 4),
        ('units={length = "mm"}', "units", {"length": "mm"}),
    ],
)
def test_what_is_given(text, path, value):
    assert parsed_change(text) == (path, value)


@pytest.mark.parametrize(
    "text", ["", "=1", "a", "a..b=1", "a[x]=1", "a[-1]=1", "[0]=1", "1a=2", "a b=1"]
)
def test_what_is_no_change(text):
    with pytest.raises(ValueError, match="PATH=VALUE is expected"):
        parsed_change(text)


def test_entries_are_changed_and_the_others_are_not():
    data = {
        "contact": [{"gap": 0.0}, {"gap": 1.0}],
        "mesh": {"parameters": {"nx": 3}},
        "traction": {"x": 1.0},
    }
    before = repr(data)
    found = changed(
        data,
        {"contact[1].gap": 2.0, "mesh.parameters.nx": 4, "traction[0].x": 3.0, "solver.levels": 2},
    )
    assert found == {
        "contact": [{"gap": 0.0}, {"gap": 2.0}],
        "mesh": {"parameters": {"nx": 4}},
        "traction": {"x": 3.0},
        "solver": {"levels": 2},
    }
    assert repr(data) == before
    assert changed({"contact": [{"gap": 0.0}]}, {"contact.gap": 1.0}) == {"contact": [{"gap": 1.0}]}


def test_a_table_of_python_keeps_its_law():
    """It is not among the keys that were given."""
    made = parse_scene(
        {
            **tomllib.loads(PUSHED),
            "contact": [Contact(boundary="bottom", friction=Coulomb(coefficient=0.1))],
        }
    )
    found = parse_scene(changed(made, {"contact[0].friction.coefficient": 0.2}))
    assert found.contact[0].friction == Coulomb(coefficient=0.2)


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("contact[2].gap", r"contact\[2\]: is not there: contact has 2"),
        ("contact.gap", "contact: is a list of 2: give a number"),
        ("title.more", "title: must be a table"),
        ("title[0]", r"title\[0\]: is not there: title is no list"),
        ("nothing[1].x", r"nothing\[1\]: is not there: nothing is no list"),
    ],
)
def test_paths_that_lead_nowhere(path, message):
    with pytest.raises(SceneError, match=message):
        changed({"contact": [{"gap": 0.0}, {"gap": 1.0}], "title": "t"}, {path: 1.0})


@pytest.fixture
def scene(tmp_path):
    file = tmp_path / "pushed.toml"
    file.write_text(PUSHED)
    return file


@pytest.mark.slow
def test_a_block_that_is_pushed(scene, tmp_path, capsys):
    """Statics: friction carries 3 x, until the block slides beyond x = F 20 = 10."""
    out = tmp_path / "out"
    assert cli.main(["sweep", str(scene), "--set", "traction.x=0:12:4", "--out", str(out)]) == 1
    printed = capsys.readouterr().out
    assert "slides, no static equilibrium" in printed
    with (out / "sweep.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row["traction.x"]) for row in rows] == [0.0, 4.0, 8.0, 12.0]
    assert [row["status"] for row in rows] == [*["converged"] * 3, "slides, no static equilibrium"]
    for row in rows[:3]:
        assert float(row["contact_force"]) == pytest.approx(60.0, rel=1e-9)
        assert float(row["friction_force"]) == pytest.approx(3 * float(row["traction.x"]), rel=1e-9)
    assert math.isnan(float(rows[3]["contact_force"] or "nan"))


def test_bodies_without_contact(tmp_path, capsys):
    """Figures stand below their names, and the strain energy of rubber is not known."""
    pulled = (
        PUSHED.replace("[[contact]]", "[[displacement]]").split("friction")[0]
        + "x = 0.0\ny = 0.0\n"
    )
    for law, known in (("", True), ('law = "neo-hooke"\n', False)):
        path = tmp_path / "pulled.toml"
        path.write_text(pulled.replace("poisson", f"{law}poisson"))
        arguments = [
            "sweep",
            str(path),
            "--set",
            "material.young=5000,6000",
            "--out",
            str(tmp_path / "out"),
        ]
        assert cli.main(arguments) == 0
        header, first = capsys.readouterr().out.splitlines()[:2]
        end = header.index("strain energy") + len("strain energy")
        with open(tmp_path / "out" / "sweep.csv", newline="") as file:
            row = next(csv.DictReader(file))
        energy = float(row["strain_energy"])
        assert float(first[end - 12 : end]) == pytest.approx(energy, rel=1e-5, nan_ok=True)
        assert math.isfinite(energy) is known
        assert int(row["linear_solves"]) > 0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["solve", "--set", "contact.friction.coeficient=1"], "did you mean 'coefficient'"),
        (["check", "--set", "traction[4].x=1"], "traction[4]: is not there"),
        (["sweep", "--set", "traction.x=1"], "no range found: write --set PATH=0.1:0.8:8"),
        (
            ["sweep", "--set", "contact.friction.coefficient=0.1,-3"],
            "contact[0].friction.coefficient",
        ),
    ],
)
def test_what_is_refused(scene, capsys, arguments, message):
    assert cli.main([arguments[0], str(scene), *arguments[1:]]) == 2
    assert message in capsys.readouterr().err
