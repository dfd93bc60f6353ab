"""Meshes that do not fit their scene, or are none: the message says what is there instead."""

import sys

import gmsh
import numpy as np
import pytest
from dolfinx import mesh
from mpi4py import MPI
from on_meshes import at_coordinate
from scenes import alone, example1, on_mesh, rectangle

from signorini_fx.errors import InstallationError, MeshError, SceneError
from signorini_fx.mechanics.effects.contact import Contact
from signorini_fx.mechanics.effects.displacement import Displacement
from signorini_fx.mechanics.mesh.tagged import generate_mesh, read_mesh, tag_boundaries
from signorini_fx.mechanics.statement.mesh_sources import MeshFile


def small(**changes):
    """Example 1 on a small mesh, with some of its effects exchanged."""
    return example1(nx=6, ny=2).model_copy(update=changes)


def mistakes(scene):
    """{path: message} of the mistakes that only the mesh reveals."""
    with pytest.raises(SceneError) as caught:
        alone(scene)
    return dict(caught.value.problems)


def test_missing_boundaries():
    """Every name that the mesh does not have is reported, and those that it has are listed."""
    found = mistakes(
        small(
            contact=(Contact(boundary="foot"),),
            displacement=(Displacement(boundary="Left", x=0.0),),
        )
    )
    assert set(found) == {"contact[0].boundary", "displacement[0].boundary"}
    assert "'foot'" in found["contact[0].boundary"]
    assert "bottom, left, right, top" in found["contact[0].boundary"]
    assert "'Left'" in found["displacement[0].boundary"]


def test_empty_boundary():
    """A name without facets is a mistake, not a boundary where nothing happens."""
    tagged = rectangle(nx=6, ny=2)
    sides = {"left": 0.0, "right": 3.0}
    markers = {name: at_coordinate(0, at) for name, at in sides.items()}
    markers |= {"top": at_coordinate(1, 1.0), "bottom": lambda x: x[1] < -1.0}
    found = mistakes(on_mesh(example1(nx=6, ny=2), tag_boundaries(tagged.mesh, markers)))
    assert list(found) == ["contact[0].boundary"]
    assert "'bottom'" in found["contact[0].boundary"]
    assert "no exterior facets" in found["contact[0].boundary"]


def test_interior_facets_are_no_boundary():
    """Tags on facets inside the body do not count (dolfinx 0.10 would integrate over them)."""
    tagged = rectangle(nx=4, ny=2)
    inside = mesh.locate_entities(tagged.mesh, 1, at_coordinate(1, 0.5))
    tags = mesh.meshtags(tagged.mesh, 1, inside, np.full(inside.size, 3, dtype=np.int32))
    assert inside.size == 4
    assert type(tagged)(tagged.mesh, tags, {"bottom": 3}).facets("bottom").size == 0


@pytest.mark.parametrize("use", ["contact", "traction", "displacement"])
def test_facets_inside_of_a_boundary_are_told(use):
    """A boundary of which some facets are inside of the body is refused wherever it is used, with
    both counts.
    """
    tagged = rectangle(nx=4, ny=2)
    inside = mesh.locate_entities(tagged.mesh, 1, at_coordinate(1, 0.5))
    extra = mesh.meshtags(tagged.mesh, 1, inside, np.full(inside.size, 9, dtype=np.int32))
    merged = np.concatenate((tagged.facet_tags.indices, extra.indices))
    values = np.concatenate((tagged.facet_tags.values, extra.values))
    order = np.argsort(merged)
    tags = mesh.meshtags(tagged.mesh, 1, merged[order], values[order])
    scene = example1(nx=4, ny=2)
    name = getattr(scene, use)[0].boundary
    boundaries = dict(tagged.boundaries)
    boundaries[name] = (boundaries[name], 9)
    before = tagged.facets(name).size
    found = mistakes(on_mesh(scene, type(tagged)(tagged.mesh, tags, boundaries)))
    assert list(found) == [f"{use}[0].boundary"]
    text = (
        f"{inside.size} of the {inside.size + before} facets of boundary {name!r} are inside "
        "of the body"
    )
    assert text in found[f"{use}[0].boundary"]


def test_contact_and_normal_support_on_the_same_facets():
    """Where the normal displacement is prescribed nothing is left for contact."""
    found = mistakes(small(displacement=(Displacement(boundary="bottom", y=0.0),)))
    assert list(found) == ["displacement[0]"]
    assert "6 facets" in found["displacement[0]"]


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("body.msh", None, "no such file"),
        ("body.msh", "this is no mesh\n", "body.msh"),
        ("body.geo", "Point(1) = {0, 0", "body.geo"),
        ("body.geo", "Point(1) = {0, 0, 0};", "physical group"),
        ("body.obj", "v 0 0 0\n", "unknown mesh format '.obj'"),
    ],
)
def test_files_that_are_no_mesh(tmp_path, name, content, message):
    """A MeshError names the file and says what is wrong; gmsh is left as it was found."""
    file = tmp_path / name
    if content is not None:
        file.write_text(content)
    with pytest.raises(MeshError, match=message):
        alone(small(mesh=MeshFile(file=file)))
    assert not gmsh.isInitialized()


NO_LIBRARY = 'raise OSError("libGLU.so.1: cannot open shared object file")'


@pytest.mark.parametrize(
    ("module", "message"),
    [
        (
            "raise ModuleNotFoundError('gmsh')",
            "cannot be loaded: gmsh: pip install gmsh, or apt install",
        ),
        (
            NO_LIBRARY,
            "cannot be loaded: libGLU.so.1: cannot open .*; its wheel needs libgl1 libglu1-mesa",
        ),
    ],
)
@pytest.mark.mpi
def test_without_gmsh(tmp_path, monkeypatch, module, message):
    """One error on all ranks says what to install."""
    (tmp_path / "gmsh.py").write_text(module)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "gmsh")
    with pytest.raises(InstallationError, match=message):
        generate_mesh("block", {}, MPI.COMM_WORLD)


GEOMETRY = """
SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 3, 1};
Transfinite Curve{1, 3} = 7; Transfinite Curve{2, 4} = 3; Transfinite Surface{1};
Physical Surface("body") = {1};
"""


def test_mesh_without_names(tmp_path):
    """A body without named boundaries can hold no scene."""
    file = tmp_path / "body.geo"
    file.write_text(GEOMETRY)
    with pytest.raises(MeshError, match="no named boundary"):
        read_mesh(file, MPI.COMM_SELF)
