"""A few of the spoilt scenes and files of ``benchmarks.stability.fuzz``, and what these have found."""

from pathlib import Path

import pytest
from mpi4py import MPI

from benchmarks.stability.fuzz import KINDS
from signorini_fx.errors import MeshError, SceneError
from signorini_fx.mechanics.mesh.tagged import read_mesh
from signorini_fx.scenes.reading import parse_scene_text
from signorini_fx.scenes.template import starting_scene


@pytest.mark.one_quick
@pytest.mark.parametrize("kind", KINDS)
def test_fuzz(kind):
    """An error with its place, or a result with its certificate; nothing is executed, nothing takes long."""
    run, count = KINDS[kind]
    score = run(0, count // 20)
    assert not score.bad
    assert sum(score.ends.values()) == count // 20


@pytest.mark.parametrize("key", ["young", "poisson", "nx", "gamma_n", "levels", "coefficient", "kind", "x"])
def test_number_of_thousands_of_digits(key):
    """TOML takes it in hexadecimal, and Python will not print it."""
    lines = [
        line.lstrip("# ") if line.lstrip("# ").startswith(f"{key} ") else line for line in starting_scene().split("\n")
    ]
    text = "\n".join(f"{key} = 0x{'f' * 5000}" if line.startswith(f"{key} ") else line for line in lines)
    try:
        parse_scene_text(text, Path("scene.toml"))
    except SceneError as refusal:
        for path, message in refusal.problems:
            assert path
            assert "Exceeds the limit" not in message
            assert len(message) < 1000


MESH = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
2
1 1 "bottom"
2 2 "body"
$EndPhysicalNames
$Nodes
NODES
$EndNodes
$Elements
ELEMENTS
$EndElements
"""
NODES = "4\n1 0 0 0\n7 1 0 0\n9 1 1 0\n20 0 1 0"
ELEMENTS = "2\n1 1 2 1 1 1 7\n2 3 2 2 1 1 7 9 20"


def test_numbers_with_holes(tmp_path):
    """Nodes may have any numbers."""
    file = tmp_path / "body.msh"
    file.write_text(MESH.replace("NODES", NODES, 1).replace("$NODES", "$Nodes").replace("ELEMENTS", ELEMENTS))
    tagged = read_mesh(file, MPI.COMM_SELF)
    assert tagged.mesh.topology.index_map(2).size_local == 1
    assert tagged.facets("bottom").size == 1


def test_nodes_outside_the_body(tmp_path):
    """Nodes that no cell has, and facets of them, are left behind: dolfinx does not survive them."""
    file = tmp_path / "body.msh"
    elements = ELEMENTS.replace("2\n", "3\n", 1) + "\n3 1 2 1 1 20 30"
    nodes = NODES.replace("4\n", "5\n") + "\n30 0 9 0"
    file.write_text(MESH.replace("\nNODES", "\n" + nodes).replace("ELEMENTS", elements))
    tagged = read_mesh(file, MPI.COMM_SELF)
    assert tagged.mesh.geometry.x.shape == (4, 3)
    assert tagged.facets("bottom").size == 1


@pytest.mark.parametrize(
    ("nodes", "elements", "message"),
    [
        (NODES.replace("9 1 1 0", "9 1 1 0.5"), ELEMENTS, r"plane x\[2\]"),
        (NODES.replace("9 1 1 0", "9 nan 1 0"), ELEMENTS, "body.msh"),
        (NODES.replace("9 1 1 0", "9 0.5 0 0"), ELEMENTS, "corner without an angle"),
        (NODES.replace("9 1 1 0", "9 0.2 0.2 0"), ELEMENTS, "folded"),
        (NODES, ELEMENTS.replace("1 7 9 20", "1 7 9 21"), "body.msh"),
        (NODES, ELEMENTS.replace("2 3 2 2 1", "2 16 2 2 1"), "body.msh"),
        (NODES, "4\n1 1 2 1 1 1 7" + "".join(f"\n{k} 3 2 2 1 1 7 9 20" for k in (2, 3, 4)), "occur twice"),
        (NODES, ELEMENTS.replace("2\n", "3\n", 1) + "\n3 3 2 5 1 1 7 9 20", "1 cells occur twice"),
        (NODES, "1\n2 3 2 2 1 1 7 9 20", "no named boundary"),
        (NODES, "1\n1 1 2 1 1 1 7", "dimension 2"),
        (NODES.replace("4\n", "1000000000\n"), ELEMENTS, "body.msh"),
        (NODES, ELEMENTS.replace("2\n1", "1000000000\n1"), "body.msh"),
    ],
)
def test_broken_mesh(tmp_path, nodes, elements, message):
    """Each ends in an error that names the file, soon."""
    file = tmp_path / "body.msh"
    file.write_text(MESH.replace("\nNODES", "\n" + nodes).replace("ELEMENTS", elements))
    with pytest.raises(MeshError, match=message):
        read_mesh(file, MPI.COMM_SELF)
