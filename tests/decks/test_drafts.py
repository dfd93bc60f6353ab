"""Drafts of Abaqus decks: what is told for each body, parts of an assembly, included files, and
what is lost.
"""

import math
import os
import tomllib

import numpy as np
import pytest
from deck_lines import POISSON, STEEL, YOUNG, assembly, squares, stacked
from mesh_files import read_file
from numpy.testing import assert_allclose
from scenes import alone

from signorini_fx.addons.decks import text
from signorini_fx.scenes import cli
from signorini_fx.scenes.reading import read_scene


def drafted(folder, lines, capsys, name="deck.inp", code=0):
    """The scene, as data, and what was printed."""
    deck, scene = folder / name, folder / "draft.toml"
    deck.write_text("\n".join(lines) + "\n")
    scene.unlink(missing_ok=True)
    ended = cli.main(["new", str(scene), "--from", str(deck)])
    said = capsys.readouterr()
    assert ended == code, said
    return scene, tomllib.loads(scene.read_text()) if scene.exists() else None, said.out + said.err


def two_towers(force):
    """Two bodies beside each other, of unequal width, on the ground; forces on both in one
    keyword.
    """
    lines = [*squares(4, 4, name="A"), *squares(4, 4, 101, (3.0, 0.0), (2.0, 1.0), name="B")]
    lines += [f"*SOLID SECTION, ELSET={name}, MATERIAL=STEEL" for name in "AB"]
    lines += [*STEEL, "*BOUNDARY", "A_FEET, 1, 2", "B_FEET, 1, 2", "*STEP", "*STATIC", "*CLOAD"]
    shares = (0.5, 1.0, 1.0, 1.0, 0.5)
    lines += [f"{21 + k}, 2, {-force[0] * share / 4}" for k, share in enumerate(shares)]
    lines += [f"{121 + k}, 2, {-force[1] * share / 4}" for k, share in enumerate(shares)]
    return [*lines, "*END STEP"]


def test_forces_on_several_bodies(tmp_path, capsys):
    """Those of one keyword are a traction on each body, which carries its own to the ground."""
    scene, data, _ = drafted(tmp_path, two_towers((3.0, 10.0)), capsys)
    assert [entry["boundary"] for entry in data["traction"]] == ["A_HEAD", "B_HEAD"]
    assert "point_force" not in data
    solution = alone(read_scene(scene))
    feet = [solution.resultants.of(f"{name}_FEET").force[1] for name in "AB"]
    assert_allclose(feet, [3.0, 10.0], rtol=1e-9)


def test_forces_with_a_moment(tmp_path, capsys):
    """An even traction has their sum but not their moment: they act one by one, and the ground
    carries their moment.
    """
    lines = [
        "121, 2, -1.0" if line.startswith("121, 2,") else line for line in two_towers((3.0, 10.0))
    ]
    scene, _, _ = drafted(tmp_path, lines, capsys)
    feet = alone(read_scene(scene)).resultants.of("B_FEET")
    forces, arms = np.array([1.0, 2.5, 2.5, 2.5, 1.25]), np.linspace(3.0, 5.0, 5)
    assert feet.force == pytest.approx([0.0, forces.sum()], abs=1e-9)
    assert feet.moment_about((0.0, 0.0)) == pytest.approx(forces @ arms, rel=1e-9)


# Of a block in plane strain under pressure on top, free at its sides, per length.
SINKS = (1 - POISSON**2) / YOUNG


@pytest.mark.parametrize(
    ("behaviour", "solver"),
    [
        (
            ["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", "100., 3.", "*FRICTION", "0.2, 50."],
            (100.0, 50.0),
        ),
        (["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", "100."], (100.0, None)),
        (["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=HARD"], None),
    ],
)
def test_soft_contact(tmp_path, capsys, behaviour, solver):
    """The stiffness of the deck is that of the scene: the blocks approach each other by pressure
    over slope.
    """
    scene, data, said = drafted(tmp_path, stacked(behaviour), capsys)
    given = data.get("solver", {})
    assert (given.get("gamma_n"), given.get("gamma_t")) == (solver or (None, None))
    assert "lost" not in said
    solution = alone(read_scene(scene))
    y = solution.displacement.x.array[1::2].min()
    soft = 5.0 / solver[0] if solver else 0.0
    assert y == pytest.approx(-5.0 * 2 * SINKS - soft, rel=1e-4)


@pytest.mark.parametrize("gap", [0.004, -0.003, -0.02, 0.008])
def test_adjust(tmp_path, capsys, gap):
    """Within its length the gap, or overlap, counts as zero: the blocks are compressed as one, and
    nothing else; a larger gap has to be closed, which needs a support that lets the upper block
    fall.
    """
    lines = stacked([], gap, "*CONTACT PAIR, INTERACTION=I, ADJUST=0.005")
    scene, data, _ = drafted(tmp_path, lines, capsys)
    assert data["contact"] == [{"boundary": "UP_BOTTOM", "against": "LOW_TOP", "adjust": 0.005}]
    solution = alone(read_scene(scene))
    assert solution.certificate.holds
    left = gap if gap > 0.005 else 0.0
    y = solution.displacement.x.array[1::2].min()
    assert y == pytest.approx(-5.0 * 2 * SINKS - left, rel=1e-4)
    assert_allclose(solution.table.columns["gap"], left, atol=1e-12)
    assert_allclose(solution.table.columns["pressure"], 5.0, rtol=1e-6)


# --- materials ------------------------------------------------------------------------------------


def one_block(sections, materials, name="BODY"):
    lines = [
        *squares(4, 2, name=name),
        *sections,
        *materials,
        "*BOUNDARY",
        f"{name}_FEET, 2",
        f"{name}_WALL, 1",
    ]
    return [*lines, "*STEP", "*STATIC", "*DSLOAD", f"{name}_TOP, P, 5.0", "*END STEP"]


@pytest.mark.parametrize(
    ("sections", "materials", "word"),
    [
        (
            ["*SOLID SECTION, ELSET=BODY, MATERIAL=GLASS"],
            STEEL,
            "the material 'GLASS' of 'BODY' is not defined",
        ),
        ([], STEEL, "no material: 8 of 8 cells are in no section"),
        (
            ["*SOLID SECTION, ELSET=BODY, MATERIAL=R"],
            ["*MATERIAL, NAME=R", "*VISCOELASTIC", "1."],
            "has no *ELASTIC",
        ),
        (
            [],
            [
                "*MATERIAL, NAME=W",
                "*ELASTIC, TYPE=ENGINEERING CONSTANTS",
                "1.,1.,1.,0.,0.,0.,1.,1.",
                "1.",
            ],
            "*ELASTIC: only isotropic elasticity is read",
        ),
    ],
)
def test_materials_that_are_missing(tmp_path, capsys, sections, materials, word):
    """Nothing stands in their place."""
    assert word in drafted(tmp_path, one_block(sections, materials), capsys, code=2)[2]


# --- parts and included files ---------------------------------------------------------------------


def test_an_assembly(tmp_path, capsys):
    """Each instance has its own nodes, names and place; they are pressed together as one block."""
    scene, data, said = drafted(tmp_path, assembly(), capsys)
    assert data["contact"] == [{"boundary": "Brick-2.BODY_TOP", "against": "Brick-1.BODY_TOP"}]
    assert data["displacement"] == [
        {"boundary": "BODY_FEET", "y": 0.0},
        {"at": [0.0, 0.0], "region": "Brick-1.BODY", "x": 0.0},
        {
            "at": [pytest.approx(0.0, abs=1e-12), pytest.approx(2.0)],
            "region": "Brick-2.BODY",
            "x": 0.0,
        },
    ]
    mesh = read_file(tmp_path / "deck.inp")
    assert len(mesh.points) == 30
    assert len(mesh.cells) == 16
    lid = mesh.points[mesh.facets[mesh.boundaries["LID"]]]
    assert_allclose(lid[..., 1], 2.0)
    assert_allclose(mesh.points.min(axis=0), 0.0, atol=1e-12)
    y = alone(read_scene(scene)).displacement.x.array[1::2].min()
    assert y == pytest.approx(-5.0 * 2 * SINKS, rel=1e-4)
    assert "lost" not in said


def test_adjust_of_a_set_of_an_instance(tmp_path, capsys):
    """ADJUST names the set of nodes with its instance, or has a length."""
    lines = stacked([], 0.004, "*CONTACT PAIR, INTERACTION=I, ADJUST=B-1.UP_FEET")
    upper, rest = lines.index("*NODE", 1), lines.index("*SOLID SECTION, ELSET=LOW, MATERIAL=STEEL")
    deck = [
        "*PART, NAME=A",
        *lines[:upper],
        "*END PART",
        "*PART, NAME=B",
        *lines[upper:rest],
        "*END PART",
    ]
    deck += ["*ASSEMBLY, NAME=S", "*INSTANCE, NAME=A-1, PART=A", "*END INSTANCE"]
    deck += ["*INSTANCE, NAME=B-1, PART=B", "*END INSTANCE", "*END ASSEMBLY", *lines[rest:]]
    for adjust, wanted in (("B-1.UP_FEET", pytest.approx(math.hypot(1.0, 2.004))), ("0.01", 0.01)):
        _, data, _ = drafted(
            tmp_path, [line.replace("B-1.UP_FEET", adjust) for line in deck], capsys
        )
        assert data["contact"] == [
            {"boundary": "UP_BOTTOM", "against": "LOW_TOP", "adjust": wanted}
        ]


def test_an_instance_in_space(tmp_path):
    """It is shifted and then turned about its axis."""
    cube = [(x, y, z) for z in (0, 1) for x, y in ((0, 0), (2, 0), (2, 1), (0, 1))]
    part = [
        "*PART, NAME=P",
        "*NODE",
        *(f"{n}, {x}, {y}, {z}" for n, (x, y, z) in enumerate(cube, 1)),
    ]
    part += ["*ELEMENT, TYPE=C3D8, ELSET=E", "1, 1, 2, 3, 4, 5, 6, 7, 8"]
    part += ["*SOLID SECTION, ELSET=E, MATERIAL=W", "*END PART", "*ASSEMBLY, NAME=A"]
    part += [
        "*INSTANCE, NAME=P-1, PART=P",
        "1., 0., 0.",
        "1., 0., 0., 1., 0., 3., 90.",
        "*END INSTANCE",
        "*END ASSEMBLY",
    ]
    deck = tmp_path / "deck.inp"
    deck.write_text("\n".join(part))
    mesh = read_file(deck)
    assert_allclose(mesh.points.min(axis=0), [0.0, 0.0, 0.0], atol=1e-12)
    assert_allclose(mesh.points.max(axis=0), [1.0, 2.0, 1.0], atol=1e-12)


def test_included_files(tmp_path, capsys):
    """Keywords and rows may be in files of the folder and below it, which may include others."""
    whole = stacked(["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", "100."])
    _, wanted, _ = drafted(tmp_path, whole, capsys)
    (tmp_path / "parts").mkdir()
    first = whole.index("*NODE")
    second = whole.index("*NODE", first + 1)
    rows = whole.index("*ELEMENT, TYPE=CPE4, ELSET=UP")
    (tmp_path / "parts" / "low.inp").write_text("\n".join(whole[:second]))
    (tmp_path / "nodes.txt").write_text("\n".join(whole[second + 1 : rows]) + "\n")
    (tmp_path / "all.inc").write_text("*include, input=parts\\low.inp\n*NODE, INPUT=nodes.txt\n")
    deck = ["** a comment", "*Include, Input=all.inc", *whole[rows:]]
    _, data, _ = drafted(tmp_path, deck, capsys)
    assert data == wanted
    assert [one.name for one in text.read_keywords(tmp_path / "deck.inp")[1]] == [
        *("deck.inp", "all.inc", "low.inp", "nodes.txt")
    ]
    (tmp_path / "nodes.txt").write_text("101, 0., zero\n")
    said = drafted(tmp_path, deck, capsys, code=2)[2]
    assert "line 2 of all.inc, *NODE: a number is expected, got" in said


def test_included_files_that_are_refused(tmp_path, capsys):
    """Outside of the folder, by whatever way; no file at all; files that never end."""
    folder = tmp_path / "deck"
    folder.mkdir()
    (tmp_path / "secret.inp").write_text("\n".join(squares(2, 2)))
    (folder / "link.inp").symlink_to(tmp_path / "secret.inp")
    (folder / "outside").symlink_to(tmp_path)
    os.mkfifo(folder / "pipe")
    (folder / "self.inp").write_text("*INCLUDE, INPUT=self.inp\n")
    outside = "is outside of the folder of the input file"
    for name, word in {
        **dict.fromkeys(
            (
                "../secret.inp",
                "link.inp",
                "outside/secret.inp",
                "/etc/hostname",
                "a/../../secret.inp",
            ),
            outside,
        ),
        **dict.fromkeys(("pipe", "missing.inp", ".", "outside/.."), "the folder of the input file"),
        "self.inp": "more than 20 times deep",
        "x" * 5000: "",
        "nul\0": "",
    }.items():
        said = drafted(folder, [f"*INCLUDE, INPUT={name}", *squares(2, 2)], capsys, code=2)[2]
        assert word in said
        assert "*INCLUDE: " in said
    assert "INPUT is missing" in drafted(folder, ["*INCLUDE", *squares(2, 2)], capsys, code=2)[2]
