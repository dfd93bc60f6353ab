"""``mesh-info``: what a mesh file holds, in any format."""

import json

import pytest
from commands import run

SQUARES = """*NODE
1, 0, 0
2, 1, 0
3, 2, 0
4, 0, 1
5, 1, 1
6, 2, 1
10, 1, 0
*ELEMENT, TYPE=CPE4, ELSET=body
1, 1, 2, 5, 4
2, 10, 3, 6, 5
"""


@pytest.fixture
def squares(tmp_path):
    """Two unit squares whose lower nodes in the middle are two, with names on the floor."""
    file = tmp_path / "squares.inp"
    file.write_text(SQUARES + "*NSET, NSET=floor\n1, 2, 3, 10\n*SURFACE, NAME=west\n1, S4\n")
    return file


def test_mesh_info(capsys, squares):
    """Counts, size, names, and what would hurt: a hinge, nodes that coincide, facets without a
    name.
    """
    code, out, err = run(capsys, "mesh-info", squares)
    assert (code, err) == (0, ""), err
    for text in (
        "2 quadrilaterals, 7 points",
        "x[0] 0 to 2, x[1] 0 to 1; area 2",
        "2 parts of the body share no side",
        "2 points coincide with another one",
        "floor            2 facets, length 2, x[0] 0 to 2, x[1] 0 to 0",
        "west             1 facets, length 1, x[0] 0 to 0, x[1] 0 to 1",
        "body             2 cells, area 2",
        "exterior facets  5 facets, length 5",
    ):
        assert text in out, text
    code, out, _ = run(capsys, "mesh-info", squares, "--json")
    info = json.loads(out)
    assert (info["pieces"], info["coincident"], info["touching"]) == (2, 2, 0)
    assert info["unnamed"]["length"] == pytest.approx(5.0)


def test_parts_that_touch(capsys, tmp_path):
    """Points of two regions at one place are no fault; round-off of a zero is zero."""
    file = tmp_path / "parts.inp"
    text = SQUARES.replace("1, 0, 0", "1, -1e-17, 0") + "*ELSET, ELSET=a\n1\n*ELSET, ELSET=b\n2\n"
    file.write_text(text)
    code, out, _ = run(capsys, "mesh-info", file)
    assert code == 0
    assert "touching      2 points of different regions have the same place" in out
    assert "coincide" not in out
    assert "x[0] 0 to 2" in out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["mesh-info", "nowhere.msh"], "nowhere.msh: no such file"),
        (["mesh-info", "scene.toml"], "unknown mesh format '.toml'"),
    ],
)
def test_meshes_that_cannot_be_described(capsys, tmp_path, monkeypatch, arguments, message):
    """One sentence, exit code 2."""
    monkeypatch.chdir(tmp_path)
    code, out, err = run(capsys, *arguments)
    assert (code, out) == (2, "")
    assert message in err
    assert "Traceback" not in err
