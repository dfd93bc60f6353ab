"""Scenes drafted from Abaqus decks: what they say, what they leave out, and that they are solved."""

import tomllib

import numpy as np
import pytest
from mpi4py import MPI

from signorini_fx import cli
from signorini_fx.scene.reading import read_scene
from signorini_fx.solving.solver import solve

NX, NY, LENGTH, HEIGHT = 8, 4, 2.0, 1.0
HEAD = "*HEADING\nA block on a floor, 5 mm\n"


def block(name="CPE4"):
    """Nodes, elements and surfaces of a rectangle of squares, with an element of mass at its first node."""
    x = [(i, j) for j in range(NY + 1) for i in range(NX + 1)]
    lines = [HEAD, "*NODE"]
    lines += [f"{n}, {LENGTH * i / NX}, {HEIGHT * j / NY}" for n, (i, j) in enumerate(x, 1)]
    lines += ["1001, 0.5, -1.0", f"*ELEMENT, TYPE={name}, ELSET=Body"]
    cells = [1 + i + j * (NX + 1) for j in range(NY) for i in range(NX)]
    lines += [f"{n}, {c}, {c + 1}, {c + NX + 2}, {c + NX + 1}" for n, c in enumerate(cells, 1)]
    lines += ["*ELEMENT, TYPE=MASS, ELSET=POINTS", "5001, 1", "*MASS, ELSET=POINTS", "7.0"]
    lines += ["*ELSET, ELSET=LOW, GENERATE", f"1, {NX}, 1", "*ELSET, ELSET=HIGH, GENERATE"]
    lines += [f"{NX * (NY - 1) + 1}, {NX * NY}, 1", "*SURFACE, NAME=FLOOR SIDE", "LOW, S1"]
    lines += ["*SURFACE, NAME=LID", "HIGH, S3", "*NSET, NSET=WALL, GENERATE", f"1, {1 + NY * (NX + 1)}, {NX + 1}"]
    lines += ["*NSET, NSET=CORNER", "3", "*NSET, NSET=REF", "1001"]
    lines += ["*SOLID SECTION, ELSET=BODY, MATERIAL=Steel", "1.0"]
    return lines


MATERIAL = ["*MATERIAL, NAME=Steel", "*DENSITY", "2.5", "*ELASTIC", "1000.0, 0.25"]
RIGID = [
    "*SURFACE, TYPE=SEGMENTS, NAME=GROUND",
    "START, -1.0, -0.01",
    "LINE, 3.0, -0.01",
    "*RIGID BODY, ANALYTICAL SURFACE=GROUND, REF NODE=REF",
    "*SURFACE INTERACTION, NAME=RUBS",
    "1.0",
    "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR, NO SEPARATION",
    "1e6",
    "*FRICTION",
    "0.3",
    "*CONTACT PAIR, INTERACTION=RUBS",
    "FLOOR SIDE, GROUND",
]
STEPS = [
    *("*BOUNDARY", "WALL, XSYMM", "REF, 1, 6", "CORNER, 1, 1"),
    *("*STEP, NAME=press", "*STATIC", "1., 1.", "*DSLOAD", "LID, P, 4.0", "*DLOAD", "BODY, GRAV, 9.81, 0., -1., 0."),
    *("*NODE FILE", "U", "*END STEP"),
    *("*STEP, NAME=push, NLGEOM=YES", "*STATIC", "*DSLOAD", "LID, P, 2.0", "LID, TRVEC, 0.5, 3., 4., 0."),
    *("*CLOAD", "3, 1, 5.0", "*MODEL CHANGE", "*END STEP"),
]


def drafted(folder, lines, capsys):
    """The scene, as data, and what was printed."""
    deck = folder / "deck.inp"
    deck.write_text("\n".join(lines) + "\n")
    (folder / "scenes").mkdir(exist_ok=True)
    scene = folder / "scenes" / "draft.toml"
    assert cli.main(["convert", str(deck), str(scene)]) == 0
    return scene, tomllib.loads(scene.read_text()), capsys.readouterr().out


def test_a_deck(tmp_path, capsys):
    """Everything that a scene can say is in it, with the steps as factors; the rest is listed with its line."""
    scene, data, said = drafted(tmp_path, [*block(), *MATERIAL, *RIGID, *STEPS], capsys)
    assert data["title"] == "A block on a floor, 5 mm"
    assert data["mesh"] == {"file": "../deck.inp"}
    assert data["material"] == {"young": 1000.0, "poisson": 0.25}
    assert data["displacement"] == [{"boundary": "WALL", "x": 0.0}]
    assert data["traction"] == [
        {"boundary": "LID", "pressure": 4.0, "factors": [1.0, 0.5]},
        {"boundary": "LID", "x": 0.3, "y": 0.4, "factors": [0.0, 1.0]},
    ]
    assert data["body_force"] == {"y": pytest.approx(-9.81 * 2.5)}
    (contact,) = data["contact"]
    assert contact["boundary"] == "FLOOR SIDE"
    assert contact["direction"] == [0.0, -1.0]
    assert contact["gap"] == "0.01 + x[1]"
    assert contact["friction"] == {"law": "coulomb", "coefficient": 0.3}
    assert data["load_steps"] == {"names": ["press", "push"]}
    left_out = [line.removeprefix("left out: ") for line in said.splitlines()[1:]]
    assert [line.partition(": ")[0].partition("*")[2] for line in left_out] == [
        "SURFACE BEHAVIOR",
        "SURFACE BEHAVIOR",
        "BOUNDARY",
        "STEP",
        "CLOAD",
        "MODEL CHANGE",
    ]
    assert all(f"# Left out: {line}\n" in scene.read_text() for line in left_out)
    number = int(left_out[0].split()[1].rstrip(","))
    assert (tmp_path / "deck.inp").read_text().splitlines()[number - 1].startswith("*SURFACE BEHAVIOR")


def test_it_is_solved(tmp_path, capsys):
    """The weight and the pressure of the first step are on the floor."""
    scene, _, _ = drafted(tmp_path, [*block(), *MATERIAL, *RIGID, *STEPS], capsys)
    solution = solve(read_scene(scene), MPI.COMM_SELF)
    assert solution.converged
    force = -(4.0 * LENGTH + 9.81 * 2.5 * LENGTH * HEIGHT)
    first = solution.at(solution.steps[0])
    assert first.resultants.of("FLOOR SIDE").force[1] == pytest.approx(-force, rel=1e-9)


def test_parts_of_several_materials(tmp_path, capsys):
    """Each has its region; a slanted rigid face of elements is a plane."""
    lines = block("CPS4")[:-2]
    lines += ["*ELSET, ELSET=REST, GENERATE", f"{NX + 1}, {NX * NY}, 1"]
    lines += ["*SOLID SECTION, ELSET=LOW, MATERIAL=A", "*SOLID SECTION, ELSET=REST, MATERIAL=B"]
    lines += ["*MATERIAL, NAME=A", "*ELASTIC", "10., 0.1", "*MATERIAL, NAME=B", "*ELASTIC, TYPE=ISO", "20., 0.2"]
    lines += ["*NODE", "2001, -1., -1.5", "2002, 3., 0.5", "*ELEMENT, TYPE=R2D2, ELSET=SLOPE", "9001, 2001, 2002"]
    lines += ["*SURFACE, NAME=RAMP", "SLOPE, SPOS", "*RIGID BODY, ELSET=SLOPE, REF NODE=1001"]
    lines += ["*CONTACT PAIR", "RAMP, FLOOR SIDE", "*TIE, NAME=T", "A, B"]
    lines += ["*BOUNDARY", "WALL, ENCASTRE", "*STEP", "*BOUNDARY, OP=NEW", "WALL, 2, 2, -0.1", "*END STEP"]
    _, data, said = drafted(tmp_path, lines, capsys)
    assert data["material"] == [
        {"region": "LOW", "young": 10.0, "poisson": 0.1, "hypothesis": "plane stress"},
        {"region": "REST", "young": 20.0, "poisson": 0.2, "hypothesis": "plane stress"},
    ]
    (contact,) = data["contact"]
    direction = np.array(contact["direction"])
    np.testing.assert_allclose(direction, np.array([1.0, -2.0]) / np.sqrt(5))
    gap = eval(contact["gap"], {"x": [0.3, 0.0]})
    assert gap == pytest.approx((np.array([1.0, -0.5]) - [0.3, 0.0]) @ direction)
    assert "tied" in said
    assert data["displacement"] == [{"boundary": "WALL", "x": 0.0, "y": -0.1}]


def test_loads_with_the_same_component(tmp_path, capsys):
    """They are two entries; a second body force is left out."""
    steps = ["*STEP", "*DSLOAD", "LID, TRVEC, 5., 3., 4., 0.", "LID, TRVEC, 2., 0., 1., 0."]
    steps += ["*DLOAD", "7, BY, 5.0", "BODY, BX, 1.0", "BODY, GRAV, 2.0, 1., 0., 0.", "*END STEP"]
    _, data, said = drafted(tmp_path, [*block(), *MATERIAL, *steps], capsys)
    assert data["traction"] == [{"boundary": "LID", "x": 3.0, "y": 4.0}, {"boundary": "LID", "y": 2.0}]
    assert data["body_force"] == {"x": 1.0}
    assert "several body forces" in said
    assert "body force on '7', a part of the body" in said


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (["*ELASTIC", "abc, 0.3"], "could not convert string to float: 'abc'"),
        (["*MATERIAL"], "'NAME' is missing"),
        (["*STEP", "*DSLOAD", "LID, TRVEC, 1., 0., 0., 0."], "a direction is expected"),
        (["*BOUNDARY", "WALL"], "list index out of range"),
        (
            ["*SURFACE, TYPE=SEGMENTS, NAME=G", "START, 0., a", "LINE, 1., 0.", "*CONTACT PAIR", "FLOOR SIDE, G"],
            "a rigid surface: could not convert",
        ),
    ],
)
def test_broken_decks(tmp_path, capsys, lines, said):
    """One error with the line; no scene."""
    deck = tmp_path / "deck.inp"
    deck.write_text("\n".join([*block(), *([] if lines == ["*MATERIAL"] else MATERIAL), *lines]) + "\n")
    assert cli.main(["convert", str(deck), str(tmp_path / "scene.toml")]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert f"{deck}: line " in error or f"{deck}: a rigid surface: " in error
    assert not (tmp_path / "scene.toml").exists()


def test_only_decks(tmp_path, capsys):
    """Of another mesh no scene is drafted, and no file is overwritten."""
    deck = tmp_path / "deck.inp"
    deck.write_text("\n".join(block()) + "\n")
    assert cli.main(["convert", str(deck), str(tmp_path / "mesh.msh")]) == 0
    assert cli.main(["convert", str(tmp_path / "mesh.msh"), str(tmp_path / "scene.toml")]) == 2
    assert "from an Abaqus input file" in capsys.readouterr().err
    (tmp_path / "scene.toml").write_text("mine")
    assert cli.main(["convert", str(deck), str(tmp_path / "scene.toml")]) == 2
    assert (tmp_path / "scene.toml").read_text() == "mine"
