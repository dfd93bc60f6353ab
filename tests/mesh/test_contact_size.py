"""``contact_size``: facets in contact have the length that was asked for, cells far away are no
smaller than before.
"""

import tomllib

import numpy as np
import pytest
from mesh_files import read_file, write_msh
from mesh_quality import quality
from mpi4py import MPI
from on_meshes import corners_of_cells

from signorini_fx import MeshError, SceneError, TaggedMesh
from signorini_fx.machine import compat
from signorini_fx.mechanics.mesh.files.gmsh_reader import gmsh_session
from signorini_fx.mechanics.statement.mesh_sources import contact_sizes
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene

RADIUS = 10.0
REST = "[[material]]\nyoung = 1e3\npoisson = 0.3\n"


def _read(text):
    return parse_scene(tomllib.loads(text))


# Half of a lug of STEP in 2D, whose hole is on the origin.
BOUNDARIES = {
    "hole": "abs(x[0]**2 + x[1]**2 - 100) < 0.5 and x[1] < 1e-9",
    "top": "x[1] > 40 - 1e-9",
}


@pytest.fixture(scope="module")
def drawings(tmp_path_factory):
    """Half of a lug with a hole in 2D, and the same in 3D, 10 thick, as STEP and as a script."""
    folder = tmp_path_factory.mktemp("drawings")
    with gmsh_session("a test") as gmsh:
        for name, solid in (("plane", False), ("space", True)):
            gmsh.clear()
            occ = gmsh.model.occ
            if solid:
                plate, hole = (
                    occ.addBox(0, -20, 0, 20, 60, 10),
                    occ.addCylinder(0, 0, -1, 0, 0, 12, RADIUS),
                )
            else:
                plate, hole = (
                    occ.addRectangle(0, -20, 0, 20, 60),
                    occ.addDisk(0, 0, 0, RADIUS, RADIUS),
                )
            dim = 3 if solid else 2
            occ.cut([(dim, plate)], [(dim, hole)])
            occ.synchronize()
            gmsh.write(str(folder / f"{name}.step"))
    (folder / "plane.geo").write_text(SCRIPT)
    (folder / "quads.geo").write_text(SCRIPT + "Recombine Surface {1};\n")
    return folder


SCRIPT = """
Point(1) = {0, -20, 0, 3}; Point(2) = {20, -20, 0, 3}; Point(3) = {20, 40, 0, 3}; Point(4) = {0, 40, 0, 3};
Point(5) = {0, 10, 0, 3}; Point(6) = {10, 0, 0, 3}; Point(7) = {0, -10, 0, 3}; Point(8) = {0, 0, 0, 3};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 5};
Circle(5) = {5, 8, 6}; Circle(6) = {6, 8, 7}; Line(7) = {7, 1};
Curve Loop(1) = {1, 2, 3, 4, 5, 6, 7};
Plane Surface(1) = {1};
Physical Curve("hole") = {6}; Physical Curve("top") = {3}; Physical Curve("symmetry") = {4, 7};
Physical Surface("lug") = {1};
"""


def scene(file, *, contact=None, degree=1, bodies=(), more=""):
    """A scene whose boundary ``hole`` is in contact, of one mesh or of several bodies."""
    table = f'file = "{file}"\n' + ("" if file.suffix == ".geo" else "size = 3.0\n")
    named = (
        ""
        if file.suffix == ".geo"
        else "".join(f'{key} = "{rule}"\n' for key, rule in BOUNDARIES.items())
    )
    mesh = f"[mesh]\n{table}[mesh.boundaries]\n{named}"
    for name in bodies:
        mesh = mesh if name != bodies[0] else ""
        mesh += f'[[body]]\nname = "{name}"\n[body.mesh]\n{table}[body.mesh.boundaries]\n{named}'
    name = f"{bodies[0]}.hole" if bodies else "hole"
    size = "" if contact is None else f"contact_size = {contact}\n"
    text = f'[element]\ndegree = {degree}\n[[contact]]\nboundary = "{name}"\n{size}'
    return _read(mesh + text + REST + more)


def edges(tagged: TaggedMesh, name: str) -> np.ndarray:
    """The lengths of the facets of a boundary, in 3D of the longest side of each."""
    tagged.mesh.topology.create_connectivity(tagged.dimension - 1, tagged.dimension)
    return tagged.mesh.h(tagged.dimension - 1, tagged.facets(name))


def far_sizes(tagged: TaggedMesh) -> np.ndarray:
    """Of the cells that are far from the hole."""
    x = corners_of_cells(tagged).mean(axis=1)
    cells = np.flatnonzero(np.hypot(x[:, 0], x[:, 1]) > 30).astype(np.int32)
    return tagged.mesh.h(tagged.dimension, cells)


@pytest.mark.one_quick(
    ("name", "size"),
    [("plane.step", 0.3), ("plane.geo", 0.3), ("quads.geo", 0.3), ("space.step", 0.9)],
)
@pytest.mark.parametrize("degree", [1, 2])
def test_facets_in_contact_have_the_length(drawings, name, size, degree):
    before, after = (
        load_mesh(scene(drawings / name, contact=own, degree=degree), MPI.COMM_SELF)
        for own in (None, size)
    )
    lengths = edges(after, "hole")
    assert np.median(lengths) == pytest.approx(size, rel=0.15)
    assert lengths.max() < 1.5 * size
    # Far away cells are what they were, and beside the hole their sizes grow slowly.
    assert np.median(far_sizes(after)) == pytest.approx(np.median(far_sizes(before)), rel=0.2)
    assert far_sizes(after).min() > 0.5 * far_sizes(before).min()
    assert dict(after.boundaries) == dict(before.boundaries)
    assert dict(after.regions) == dict(before.regions)
    assert after.mesh.topology.cell_name() == before.mesh.topology.cell_name()
    assert compat.geometry_degree(after.mesh) == degree
    if degree == 2:  # also the nodes between the corners are on the circle
        nodes = compat.geometry_cells(after.mesh)[:, :]
        x = after.mesh.geometry.x[np.unique(nodes)]
        near = np.abs(np.hypot(x[:, 0], x[:, 1]) - RADIUS) < 0.05 * size**2 / RADIUS
        assert np.count_nonzero(near & (x[:, 1] < 0)) > np.pi / 2 * RADIUS / size * 1.8
        assert np.abs(np.hypot(*x[near, :2].T) - RADIUS).max() < 1e-6


def test_of_two_bodies_the_one_that_is_named_has_the_size(drawings):
    two = scene(drawings / "plane.geo", contact=0.5, bodies=("upper", "lower"))
    assert [[one.boundary for one in contact_sizes(two, body)] for body in range(2)] == [
        ["hole"],
        [],
    ]


def test_sizes_grow_by_a_quarter_per_length(drawings):
    arrays = read_file(drawings / "plane.geo")
    tagged = load_mesh(scene(drawings / "plane.geo", contact=0.1), MPI.COMM_SELF)
    x = corners_of_cells(tagged)
    middle, lengths = x.mean(axis=1), np.linalg.norm(x - np.roll(x, 1, axis=1), axis=2).mean(axis=1)
    away = np.hypot(middle[:, 0], middle[:, 1]) - RADIUS
    low = (middle[:, 1] < 0) & (away < 6)
    ratio = lengths[low] / (0.1 + 0.25 * away[low])
    assert np.quantile(ratio, 0.1) > 0.6
    assert np.quantile(ratio, 0.9) < 1.4
    assert len(arrays.cells) < tagged.mesh.topology.index_map(2).size_local < 12 * len(arrays.cells)
    assert quality(tagged.mesh.geometry.x[:, :2], compat.geometry_cells(tagged.mesh)).min() > 0.4


@pytest.mark.one_quick(
    ("generator", "boundary", "size", "parameters"),
    [
        ("half_disk", "arc", 0.1, "radius = 8.0"),
        ("half_disk", "arc", 1e-4, "radius = 8e-3, size = 1e-3, contact_size = 1e-3"),
        ("half_disk", "arc", 0.1, 'cell = "quadrilateral", order = 2'),
        ("plate_with_hole", "hole", 0.03, "radius = 1.0"),
        ("punch", "foot", 0.01, "order = 2"),
        ("half_sphere", "sphere", 0.5, 'part = "quarter", order = 2'),
        ("half_sphere", "sphere", 0.6, 'part = "quarter", cell = "hexahedron"'),
        ("bracket", "foot", 1.5, "order = 1"),
    ],
)
def test_generators_that_gmsh_meshes(generator, boundary, size, parameters):
    text = (
        f'[mesh]\ngenerator = "{generator}"\nparameters = '
        f'{{ {parameters} }}\n[[contact]]\nboundary = "{boundary}"\n'
    )
    rest = "[[material]]\nyoung = 1e3\npoisson = 0.3\n[element]\ndegree = 2\n"
    before, after = (
        load_mesh(_read(text + own + rest), MPI.COMM_SELF)
        for own in ("", f"contact_size = {size}\n")
    )
    lengths = edges(after, boundary)
    assert lengths.max() < 1.5 * size
    assert lengths.max() > 0.8 * size
    assert dict(after.boundaries) == dict(before.boundaries)
    assert compat.geometry_degree(after.mesh) == compat.geometry_degree(before.mesh)


def refused(text):
    with pytest.raises((SceneError, MeshError)) as error:
        load_mesh(_read(text), MPI.COMM_SELF)
    return str(error.value)


CONTACT = '[[contact]]\nboundary = "bottom"\n'


@pytest.mark.parametrize("size", ["0.0", "-1.0", "inf", '"fine"'])
def test_a_size_that_is_no_length_is_refused(size):
    text = f'[mesh]\ngenerator = "rectangle"\n{CONTACT}contact_size = {size}\n{REST}'
    assert "contact_size" in refused(text)


def test_what_cannot_be_had_is_refused_with_its_place(drawings, tmp_path):
    plain = f'[mesh]\ngenerator = "rectangle"\n{CONTACT}contact_size = 0.01\n{REST}'
    assert "contact[0].contact_size: the cells of the generator 'rectangle' are in rows" in refused(
        plain
    )
    rows = f'[mesh]\ngenerator = "block"\n{CONTACT}contact_size = 0.01\n{REST}'
    message = refused(rows)
    assert "contact[0].contact_size: the cells of the generator 'block' are in rows" in message
    assert ".geo" in message
    hole = f"{CONTACT}contact_size = 9.0\n{REST}".replace("bottom", "hole")
    message = refused(f'[mesh]\nfile = "{drawings / "plane.geo"}"\n{hole}')
    assert "contact[0].contact_size: the facets of 'hole' are no longer than" in message
    small = f"{CONTACT}contact_size = 1e-8\n{REST}".replace("bottom", "hole")
    message = refused(f'[mesh]\nfile = "{drawings / "plane.geo"}"\n{small}')
    assert "contact[0].contact_size: cells of 1e-08 would be about" in message
    message = refused(f'[mesh]\nfile = "{drawings / "space.step"}"\nsize = 2e-3\n{small}')
    assert "mesh.size: cells of 0.002 would be about" in message
    write_msh(drawings / "plane.geo", tmp_path / "cells.msh")
    message = refused(f'[mesh]\nfile = "{tmp_path / "cells.msh"}"\n{hole}')
    assert "contact[0].contact_size: a .msh file has its cells already" in message
    assert ".geo" in message
    body = f'[[body]]\nname = "lug"\n[body.mesh]\nfile = "{tmp_path / "cells.msh"}"\n'
    text = f"{body}{CONTACT}contact_size = 0.5\n{REST}".replace("bottom", "lug.hole")
    assert "contact[0].contact_size: needs CAD or a gmsh generator" in refused(text)
    script = tmp_path / "rows.geo"
    script.write_text(SCRIPT + "Transfinite Curve {6} = 5;\n")
    text = f'[mesh]\nfile = "{script}"\n{CONTACT}contact_size = 0.5\n{REST}'.replace(
        "bottom", "hole"
    )
    assert "Transfinite" in refused(text)


def test_a_generator_takes_the_cells_of_a_file(tmp_path):
    """Without ``cell`` beside a body of triangles; where it is given, the cells differ."""
    (tmp_path / "upper.geo").write_text(
        'SetFactory("OpenCASCADE");\nRectangle(1) = {0, 1, 0, 2, 1};\nMesh.MeshSizeMax = 0.5;\n'
        'Physical Curve("foot") = {1};\nPhysical Surface("all") = {1};\n'
    )
    block = {"length": 2.0, "height": 1.0, "nx": 4, "ny": 2}

    def cells(**parameters):
        lower = {"generator": "rectangle", "parameters": block | parameters}
        scene = {
            "body": [
                {"name": "lower", "mesh": lower},
                {"name": "upper", "mesh": {"file": "upper.geo"}},
            ],
            "material": {"young": 1.0, "poisson": 0.3},
            "contact": {"boundary": "upper.foot", "against": "lower.top"},
        }
        return load_mesh(parse_scene(scene, folder=tmp_path), MPI.COMM_WORLD).mesh.topology

    assert cells().cell_name() == "triangle"
    with pytest.raises(MeshError, match="body 'upper' has triangles, body 'lower' quadrilaterals"):
        cells(cell="quadrilateral")
