"""What people type first, and what they are told: a scene without a command, a command misspelt."""

from pathlib import Path

import meshio
import numpy as np
import pytest
from commands import summary_in

from signorini_fx.errors import MeshError, SceneError
from signorini_fx.machine.result_files import read_csv
from signorini_fx.scenes import cli
from signorini_fx.scenes.reading import parse_scene, parse_scene_text

SCENE = """
mesh = { generator = "rectangle", parameters = { length = 2.0, height = 1.0, nx = 4, ny = 2 } }
material = { young = 50.0, poisson = 0.3 }
displacement = { boundary = "top", x = 0.0, y = -0.1 }
contact = { boundary = "bottom" }
"""


def test_a_scene_without_a_command_is_solved(tmp_path):
    """As by `solve`, with its options."""
    (tmp_path / "s.toml").write_text(SCENE)
    words = [str(tmp_path / "s.toml"), "--out", str(tmp_path / "out"), "--no-pictures", "--quiet"]
    assert cli.main(words) == 0
    assert len(read_csv(tmp_path / "out/contact.csv")["pressure"]) == 5


def test_the_cause_of_an_outcome_is_given_once(tmp_path, capsys):
    """As what to do, not as a warning, too."""
    held = 'boundary = "left", x = 0.0 }\ntraction = { boundary = "top", y = 0.1 }'
    loads = SCENE.replace('boundary = "top", x = 0.0, y = -0.1 }', held)
    (tmp_path / "s.toml").write_text(loads)
    words = [str(tmp_path / "s.toml"), "--out", str(tmp_path / "out"), "--no-pictures"]
    assert cli.main(words) == 1
    shown = " ".join(capsys.readouterr().out.split())
    assert shown.count("the loads move the body by the translation along (0, 1)") == 1
    assert "warning" not in shown


def test_nothing_is_answered_by_help(capsys):
    """All commands are listed."""
    assert cli.main([]) == 2
    assert "solve a scene and write its results" in capsys.readouterr().out


def test_a_command_that_is_misspelt(capsys):
    """The one that is meant is named."""
    with pytest.raises(SystemExit):
        cli.main(["slove", "s.toml"])
    assert "'slove': did you mean 'solve'?" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "path", "message"),
    [
        (
            'mesh = { file = "a.msh" }\nmesh.size = 2.0',
            "syntax",
            "mesh is complete with its braces",
        ),
        ("material = 210e3", "material", "must be a table or a list of tables"),
        ("traction = 3", "traction", "must be a table or a list of tables"),
        (
            'displacement = { boundary = ["left", "right"], x = 0.0 }',
            "displacement.boundary",
            "must be one name: write a table for each boundary",
        ),
    ],
)
def test_what_is_natural_and_refused(text, path, message):
    """With what to write instead."""
    with pytest.raises(SceneError) as error:
        parse_scene_text(text, Path("s.toml"))
    found = dict(error.value.problems)
    assert found[path].startswith(message)


def test_wedges_in_place_of_hexahedra(tmp_path):
    """Their nodes that are there twice are named, not that they are folded."""
    x = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1]], dtype=float)
    cells = [("hexahedron", np.array([[0, 1, 2, 2, 3, 4, 5, 5]]))]
    meshio.Mesh(x, cells).write(tmp_path / "wedge.vtu")
    scene = {"mesh": {"file": "wedge.vtu"}, "material": {"young": 1.0, "poisson": 0.3}}
    from mpi4py import MPI

    from signorini_fx.scenes.mesh import load_mesh

    with pytest.raises(MeshError, match="1 cells have a node twice, as wedges in place of hexa"):
        load_mesh(parse_scene(scene, folder=tmp_path), MPI.COMM_SELF)


def test_all_of_a_few_warnings(tmp_path, capsys):
    """That of the entry that is wrong stands before what follows from it."""
    plane = '{ shape = "plane", point = [0.0, 0.0], normal = [0.0, -1.0] }'
    text = SCENE.replace('"bottom" }', f'"bottom", foundation = {plane} }}')
    (tmp_path / "s.toml").write_text(text)
    out = tmp_path / "out"
    cli.main(["solve", str(tmp_path / "s.toml"), "--out", str(out), "--no-pictures", "--no-fields"])
    findings = summary_in(out)["findings"]
    warnings = [finding["path"] for finding in findings if finding["level"] == "warning"]
    said = [line for line in capsys.readouterr().out.splitlines() if line.startswith("  warning ")]
    assert len(said) == len(warnings) == 2
    assert "contact[0].foundation" in said[0]
    file = str(tmp_path / "s.toml")
    assert [cli.main(["check", *words, file]) for words in ([], ["--strict"])] == [0, 2]


def test_pieces_are_called_by_their_regions(tmp_path, capsys):
    """Each piece that is a whole region; its extent says less."""
    (tmp_path / "two.geo").write_text(
        'SetFactory("OpenCASCADE");\nRectangle(1) = {0, 0, 0, 2, 1};\n'
        "Rectangle(2) = {0, 1.01, 0, 2, 1};\nMesh.MeshSizeMax = 0.5;\n"
        'Physical Curve("foot") = {1};\nPhysical Surface("lower") = {1};\n'
        'Physical Surface("upper") = {2};\n'
    )
    (tmp_path / "s.toml").write_text(
        'mesh = { file = "two.geo" }\nmaterial = { young = 1.0, poisson = 0.3 }\n'
        'displacement = { boundary = "foot", x = 0.0, y = 0.0 }\n'
    )
    assert cli.main(["check", str(tmp_path / "s.toml")]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "nothing holds body 'upper'" in said
    assert "each must be held: body 'lower'; body 'upper'" in said
