"""Files that are broken end in one clear error with their name, and scripts that do more than draw
are refused.
"""

import meshio
import numpy as np
import pytest
from mesh_files import read_file, write_msh
from mpi4py import MPI

from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.tagged import read_mesh

GEO = """Point(1) = {0, 0, 0, .5}; Point(2) = {2, 0, 0, .5}; Point(3) = {2, 1, 0, .5}; Point(4) = {0, 1, 0, .5};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1};
Curve Loop(1) = {1:4}; Plane Surface(1) = {1};
Physical Curve("foot") = {1}; Physical Surface("body") = {1};
"""
SUFFIXES = ("geo", "msh", "step", "brep", "inp", "med", "vtu", "xdmf")


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """A rectangle in every format."""
    import gmsh

    folder = tmp_path_factory.mktemp("sound")
    (folder / "body.geo").write_text(GEO)
    write_msh(folder / "body.geo", folder / "body.msh")
    mesh = read_file(folder / "body.geo")
    foot = mesh.facets[mesh.boundaries["foot"]]
    cells = meshio.Mesh(
        mesh.points, [("triangle", mesh.cells)], point_sets={"foot": np.unique(foot)}
    )
    meshio.write(folder / "body.inp", cells)
    meshio.xdmf.write(folder / "body.xdmf", cells, data_format="XML")
    both = meshio.Mesh(mesh.points, [("triangle", mesh.cells), ("line", foot)])
    both.cell_data = {"cell_tags": [np.full(len(mesh.cells), -1), np.full(len(foot), -2)]}
    both.cell_tags = {-1: ["body"], -2: ["foot"]}
    meshio.write(folder / "body.med", both)
    in_space = np.column_stack((mesh.points, np.zeros(len(mesh.points))))
    meshio.write(folder / "body.vtu", meshio.Mesh(in_space, cells.cells))
    gmsh.initialize(readConfigFiles=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.occ.addRectangle(0, 0, 0, 2, 1)
    gmsh.model.occ.synchronize()
    gmsh.write(str(folder / "body.step"))
    gmsh.write(str(folder / "body.brep"))
    gmsh.merge(str(folder / "body.msh"))
    gmsh.option.setNumber("Mesh.Binary", 1)
    gmsh.write(str(folder / "binary.msh"))
    gmsh.finalize()
    return folder


def refused(file, capfd):
    """The message, which names the file, prints nothing, and has no characters that a terminal
    would obey.
    """
    names = {"foot": lambda x: x[1] < 1e-9} if file.suffix in (".vtu", ".xdmf") else None
    with pytest.raises(MeshError) as caught:
        read_mesh(file, MPI.COMM_SELF, names)
    message = str(caught.value)
    assert message.startswith(str(file))
    assert capfd.readouterr() == ("", "")
    return message


@pytest.mark.parametrize("kept", [0.0, 0.02, 0.4, 0.8])
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_truncated(sound, tmp_path, suffix, kept, capfd):
    """Only the first part of a file is there."""
    file = tmp_path / f"body.{suffix}"
    content = (sound / f"body.{suffix}").read_bytes()
    if suffix == "geo" and kept == 0.8:
        kept = 0.5  # what comes last names the body
    file.write_bytes(content[: int(kept * len(content))])
    refused(file, capfd)


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_another_program(sound, tmp_path, suffix, capfd):
    """The content of another format, here a picture."""
    file = tmp_path / f"body.{suffix}"
    file.write_bytes(b"\x89PNG\r\n\x1a\n\x1b[31m\x00\x07" + bytes(range(256)) * 8)
    refused(file, capfd)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ('SystemCall "touch left";', "SystemCall"),
        ('System "touch left";', "System"),
        ('NonBlockingSystemCall "touch left";', "NonBlockingSystemCall"),
        ('OnelabRun("a", "touch left");', "OnelabRun"),
        ('Field[1] = ExternalProcess; Field[1].CommandLine = "touch left";', "ExternalProcess"),
        ('Parse[ Str("Sys", "tem") ];', "Parse"),
        ("Exit;", "Exit"),
        ('Save "left.msh";', "Save"),
        ('Print "left.opt";', "Print"),
        ('Printf("x") > "left";', "Printf"),
        ('CreateDir "left";', "CreateDir"),
        ('Merge "../other.geo";', "Merge"),
        ('Include "/etc/passwd";', "Include"),
        ('Merge StrCat("oth", "er.geo");', "Merge"),
        ('x[] = ListFromFile["../secret.txt"];', "ListFromFile"),
        ('Include "other.geo";', "SystemCall"),
        ('/* " */ SystemCall "touch left"; // "', "SystemCall"),
    ],
)
def test_scripts_that_do_more_than_draw(tmp_path, text, word, capfd):
    """They are refused by the word, before anything is run."""
    (tmp_path / "other.geo").write_text('SystemCall "touch left";\n')
    file = tmp_path / "body.geo"
    file.write_text(f"{GEO}// SystemCall in a comment\n{text}\n")
    assert f": {word} is not allowed in a script" in refused(file, capfd)
    assert not (tmp_path / "left").exists()
