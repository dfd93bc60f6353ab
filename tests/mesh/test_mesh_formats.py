"""Meshes that others made: the same body in every format gives the same answer; what is no plane
mesh, a clear word.
"""

import sys

import meshio
import numpy as np
import pytest
from dolfinx import mesh
from dolfinx.io import XDMFFile
from mesh_files import read_file, write_msh
from mpi4py import MPI
from scene_tables import coulomb_friction, fixed, rectangle_mesh
from scenes import alone, table_of

from signorini_fx.errors import MeshError, SceneError
from signorini_fx.mechanics.mesh.tagged import read_mesh
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

LENGTH, HEIGHT, NX, NY = 3.0, 1.0, 12, 4
FORMATS = ["msh22", "msh41", "inp", "med", "vtu", "xdmf"]
each_cell = pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])


def scene(mesh, degree=1):
    """Example 1 with Coulomb friction on 12 x 4 cells."""
    return parse_scene(
        {
            "mesh": mesh,
            "element": {"degree": degree},
            "material": {"young": 5000.0, "poisson": 0.4},
            "displacement": [fixed("left", "x"), fixed("right", "x")],
            "traction": {"boundary": "top", "y": "-20 if 1 <= x[0] <= 2 else 0"},
            "contact": {
                "boundary": "bottom",
                "gap": "0.003*(x[0] - 1.5)**2 + 0.001",
                "friction": coulomb_friction(0.3),
            },
        }
    )


def ours(cell, degree=1):
    """The scene on the mesh of our generator."""
    parameters = {"length": LENGTH, "height": HEIGHT, "nx": NX, "ny": NY, "cell": cell}
    return alone(scene(rectangle_mesh(**parameters), degree))


def same_answer(one, other):
    """Displacement, pressure and shear at the contact nodes to 1e-10, and the whole energy."""
    for name in ("x", "u_n", "u_t", "pressure", "shear", "weight"):
        a, b = (table_of(solution).columns[name] for solution in (one, other))
        np.testing.assert_allclose(b, a, rtol=0, atol=1e-10 * np.abs(a).max(), err_msg=name)
    assert other.steps[-1].strain_energy == pytest.approx(one.steps[-1].strain_energy, rel=1e-10)
    assert other.history.linear_solves == one.history.linear_solves


def numbered(cell):
    """Points, cells and the lines of the four sides of the rectangle, as someone else would number
    them.

    The points are in an order of their own, every other cell runs clockwise, and one point belongs
    to no cell.
    """
    x, y = np.meshgrid(
        np.linspace(0, LENGTH, NX + 1), np.linspace(0, HEIGHT, NY + 1), indexing="ij"
    )
    points = np.column_stack((x.ravel(), y.ravel()))
    node = np.arange((NX + 1) * (NY + 1)).reshape(NX + 1, NY + 1)
    corners = [node[:-1, :-1], node[1:, :-1], node[1:, 1:], node[:-1, 1:]]
    cells = np.stack([c.ravel() for c in corners], axis=1)
    if cell == "triangle":  # the diagonal that our generator has: from low left to high right
        cells = np.concatenate((cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]))
    cells[::2] = cells[::2, ::-1]
    lines = {
        "bottom": np.column_stack((node[:-1, 0], node[1:, 0])),
        "right": np.column_stack((node[-1, :-1], node[-1, 1:])),
        "top": np.column_stack((node[1:, -1], node[:-1, -1])),
        "left": np.column_stack((node[0, 1:], node[0, :-1])),
    }
    order = np.random.default_rng(1).permutation(len(points) + 1)
    shuffled = np.empty((len(points) + 1, 2))
    shuffled[order] = np.concatenate((points, [[7.0, 7.0]]))
    return shuffled, order[cells], {name: order[side] for name, side in lines.items()}


def written(folder, cell, form):
    """The rectangle written by meshio in one of the formats, with the names that the format can
    hold.
    """
    points, cells, lines = numbered(cell)
    kind = {"triangle": "triangle", "quadrilateral": "quad"}[cell]
    every = np.concatenate(list(lines.values()))
    side = np.repeat(np.arange(1, 5), [len(rows) for rows in lines.values()])
    mesh = meshio.Mesh(points, [("line", every), (kind, cells)])
    inside = np.full(len(cells), 9)
    file = folder / f"{cell}_{form}"
    if form.startswith("msh"):
        mesh.points = np.column_stack((points, np.zeros(len(points))))
        mesh.cell_data = {"gmsh:physical": [side, inside], "gmsh:geometrical": [side, inside]}
        mesh.field_data = {name: np.array([tag, 1]) for tag, name in enumerate(lines, start=1)}
        mesh.field_data["body"] = np.array([9, 2])
        file = file.with_suffix(".msh")
        if form == "msh41":  # meshio wants to know the entity that a node is on
            mesh.point_data = {"gmsh:dim_tags": np.tile([2, 9], (len(points), 1))}
        meshio.write(file, mesh, file_format="gmsh22" if form == "msh22" else "gmsh", binary=False)
        if form == "msh41":  # and says nothing of physical groups in the entities: gmsh itself does
            write_msh(written(folder, cell, "msh22"), file)
    elif form == "inp":
        mesh = meshio.Mesh(
            points, [(kind, cells)], point_sets={n: np.unique(side) for n, side in lines.items()}
        )
        mesh.cell_sets = {"body": [np.arange(len(cells))]}
        meshio.write(file := file.with_suffix(".inp"), mesh)
    elif form == "med":
        mesh.cell_data = {"cell_tags": [-side, -inside]}
        mesh.cell_tags = {-tag: [name] for tag, name in enumerate(lines, start=1)} | {
            -9: ["body", "all of it"]
        }
        meshio.write(file := file.with_suffix(".med"), mesh)
    else:
        mesh.cell_data = {"side": [side, inside]}
        meshio.write(file := file.with_suffix(f".{form}"), mesh)
    return file


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.one_quick("form", FORMATS)
@each_cell
def test_the_same_answer(tmp_path, cell, form):
    """A foreign mesh of each format, its nodes and cells in another order: the answer of our own
    mesh to 1e-10.
    """
    file = written(tmp_path, cell, form)
    if form.startswith("msh"):
        assert file.read_text().splitlines()[1].split()[0] == {"msh22": "2.2", "msh41": "4.1"}[form]
    table = {"file": file}
    if form in ("vtu", "xdmf"):  # numbers only: the scene gives the names
        table["boundaries"] = {"bottom": 1, "right": 2, "top": 3, "left": 4}
    same_answer(ours(cell), alone(scene(table)))


RULES = {
    "bottom": "x[1] < 1e-9",
    "top": "x[1] > 1 - 1e-9",
    "left": "x[0] < 1e-9",
    "right": "x[0] > 3 - 1e-9",
}


@pytest.mark.one_quick("suffix", ["inp", "med", "msh", "vtu", "xdmf"])
@each_cell
def test_names_by_rules(tmp_path, cell, suffix):
    """A file without any name: the scene says where its boundaries are."""
    points, cells, _ = numbered(cell)
    bare = meshio.Mesh(points, [({"triangle": "triangle"}.get(cell, "quad"), cells)])
    file = tmp_path / f"bare.{suffix}"
    if suffix == "msh":
        bare.points = np.column_stack((points, np.zeros(len(points))))
        meshio.write(file, bare, file_format="gmsh22")
    else:
        meshio.write(file, bare)
    with pytest.raises(MeshError, match=r"no named boundary: name some in mesh\.boundaries"):
        read_mesh(file, MPI.COMM_SELF)
    same_answer(ours(cell), alone(scene({"file": file, "boundaries": RULES})))


def body(folder):
    """Two squares side by side: the left one and both are regions, foot is a part of low, the top
    has no name.
    """
    file = folder / "body.geo"
    file.write_text(
        """
        Point(1) = {0, 0, 0}; Point(2) = {1, 0, 0}; Point(3) = {2, 0, 0};
        Point(4) = {2, 1, 0}; Point(5) = {1, 1, 0}; Point(6) = {0, 1, 0};
        Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 5}; Line(5) = {5, 6}; Line(6) = {6, 1};
        Line(7) = {2, 5};
        Curve Loop(1) = {1, 7, 5, 6}; Plane Surface(1) = {1};
        Curve Loop(2) = {2, 3, 4, -7}; Plane Surface(2) = {2};
        Transfinite Curve{:} = 4; Transfinite Surface{:};
        Physical Surface("left") = {1}; Physical Surface("both") = {1, 2};
        Physical Curve("low") = {1, 2}; Physical Curve("foot") = {2}; Physical Curve("side of it") = {3};
        Recombine Surface{:};
        """
    )
    return file


@pytest.mark.mpi
def test_names_that_must_not_overlap(tmp_path):
    """One foundation for each facet, one material for each cell; else there would be two
    answers.
    """
    comm = MPI.COMM_WORLD
    folder = comm.bcast(tmp_path)
    if comm.rank == 0:
        write_msh(body(folder), folder / "body.msh")
    comm.barrier()
    data = {
        "mesh": {"file": folder / "body.msh", "regions": {"right": "x[0] > 1 - 1e-9"}},
        "material": [
            {"young": 1.0, "poisson": 0.3, "region": region} for region in ("left", "right")
        ],
        "displacement": fixed("side of it"),
        "contact": [{"boundary": "foot"}],
    }
    assert solve(parse_scene(data), comm).converged
    with pytest.raises(
        SceneError, match=r"contact\[1\]\.boundary: boundary 'low' shares 3 facets with .* 'foot'"
    ):
        solve(parse_scene({**data, "contact": [{"boundary": "foot"}, {"boundary": "low"}]}), comm)
    data["material"][1]["region"] = "both"
    with pytest.raises(SceneError, match="material: 9 cells are in several of the regions"):
        solve(parse_scene(data), comm)


def test_regions_by_rule_and_number(tmp_path):
    """Parts of the body from the scene, for the materials."""
    points, cells, _ = numbered("quadrilateral")
    file = tmp_path / "two.vtu"
    low = points[cells][..., 1].max(axis=1) < 0.51
    mesh = meshio.Mesh(
        np.column_stack((points, 0 * points[:, 0])),
        [("quad", cells)],
        cell_data={"part": [low + 5]},
    )
    meshio.write(file, mesh)
    selections = ({"hard": 5, "soft": 6}, {"hard": "x[1] > 0.49", "soft": "x[1] < 0.51"})
    by_number, by_rule = (read_file(file, regions=r, boundaries=None) for r in (selections[0], {}))
    assert {name: len(rows) for name, rows in by_number.regions.items()} == {
        "region_5": 24,
        "region_6": 24,
        "hard": 24,
        "soft": 24,
    }
    assert set(by_rule.regions) == {"region_5", "region_6"}
    answers = []
    for regions in selections:
        one = scene({"file": file, "boundaries": RULES, "regions": regions})
        hard = one.material[0].model_copy(update={"region": "hard"})
        soft = hard.model_copy(update={"region": "soft", "young": 1000.0})
        answers.append(alone(one.model_copy(update={"material": (hard, soft)})))
    same_answer(*answers)
    assert table_of(answers[0]).columns["pressure"].max() != pytest.approx(
        table_of(ours("quadrilateral")).columns["pressure"].max(), rel=0.1
    )


ABAQUS = """*Heading
** from a preprocessor: plane strain, an element surface, sets of sets
*Part, name=Part-1
*Node, nset=everything
      1,           0.,           0.
      2,           1.,           0.
      3,           2.,           0.
     11,           0.,        1.D0
     12,           1.,           1.
     13,           2.,           1.
*Element, type={kind}, elset=whole
1, 1, 2, 12, 11
2, 2, 3, 13, 12
*Nset, nset=floor, generate
 1, 3, 1
*Elset, elset=first
 1,
*Elset, elset=again
 first,
*End Part
*Assembly, name=Assembly
*Instance, name=Part-1-1, part=Part-1
*End Instance
*Elset, elset="_roof_S3", instance=Part-1-1, internal
 1, 2
*Surface, type=ELEMENT, name="the roof"
_roof_S3, S3
*End Assembly
*Material, name=Steel
*Elastic
210000., 0.3
"""


@pytest.mark.parametrize("kind", ["CPE4", "CPS4R", "S4", "cpe4i", "CAX4R"])
def test_abaqus(tmp_path, kind):
    """Plane elements of any kind, sets, sets of sets, generated sets and surfaces."""
    file = tmp_path / "job.inp"
    file.write_text(ABAQUS.format(kind=kind))
    mesh = read_file(file)
    assert mesh.kind == "quad"
    assert {name: len(rows) for name, rows in mesh.regions.items()} == {
        "whole": 2,
        "first": 1,
        "again": 1,
        "_roof_S3": 2,
    }
    assert {name: len(rows) for name, rows in mesh.boundaries.items()} == {
        "everything": 6,
        "floor": 2,
        "the roof": 2,
    }
    assert (mesh.points[mesh.facets[mesh.boundaries["the roof"]]][..., 1] == 1).all()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("{kind}", "GK3D8", "GK3D8 is neither a plane one nor a solid"),
        ("{kind}", "CPE3", "3 nodes per element are expected"),
        (
            "1, 1, 2, 12, 11",
            "1, 1, 2, 12, 99",
            "element 1 has the node 99, which the file does not define",
        ),
        ("1, 1, 2, 12, 11", "2, 1, 2, 12, 11", "element 2 is defined twice"),
        (" first,", " second,", "set 'second' does not exist"),
        ("*End Instance", "1., 0.\n*End Instance", "a shift of three numbers is expected"),
        (
            "*Material",
            "*Include, input=rest.inp\n*Material",
            "INCLUDE: there is no file 'rest.inp'",
        ),
        ("*End Part", "*Node\n1, 5., 5.", "node 1 is defined twice"),
        ("*End Part", "*Ngen\n1, 5, 1", "NGEN: nodes and elements are not generated here"),
        ("1.D0", "one", "a number is expected, got 'one'"),
    ],
)
def test_abaqus_that_is_not_understood(tmp_path, old, new, message):
    """One sentence with the file, never half a mesh."""
    file = tmp_path / "job.inp"
    file.write_text(ABAQUS.replace(old, new).format(kind="CPE4"))
    with pytest.raises(MeshError, match=message) as caught:
        read_file(file)
    assert str(file) in str(caught.value)


def vtu(file, points, blocks, **more):
    """Write a file with these points and cells."""
    points = np.asarray(points, dtype=float)
    points = np.column_stack((points, np.zeros(len(points)))) if points.shape[1] == 2 else points
    meshio.write(file, meshio.Mesh(points, blocks, **more))
    return file


SQUARE = [[0, 0], [1, 0], [1, 1], [0, 1], [2, 0], [2, 1]]


@pytest.mark.parametrize(
    ("points", "blocks", "message"),
    [
        (
            SQUARE,
            [("quad", [[0, 1, 2, 3]]), ("triangle6", [[1, 4, 2, 0, 0, 0]])],
            "1 quad, 1 triangle6: triangles are made of all",
        ),
        (
            SQUARE,
            [("triangle", [[0, 1, 2]]), ("triangle6", [[0, 1, 2, 3, 4, 5]])],
            "one kind of cell",
        ),
        (SQUARE, [("line", [[0, 1]])], "no cells"),
        ([[*x, 0.0] for x in SQUARE], [("wedge", [list(range(6))])], "no wedges"),
        ([[0, 0, 0], [1, 0, 0], [0, 0, 1]], [("triangle", [[0, 1, 2]])], "not in a plane"),
        (SQUARE, [("quad", [[0, 1, 3, 2]])], "1 cells are folded, the first at \\(0.5, 0.5\\)"),
        (SQUARE, [("triangle", [[0, 1, 4]])], "without an angle"),
        (SQUARE, [("quad", [[0, 1, 2, 3]] * 3)], "a facet belongs to 3 cells"),
        (
            [*SQUARE, [0.4, 0.7]],
            [("triangle", [[0, 1, k] for k in (2, 3, 6)])],
            "a facet belongs to 3 cells",
        ),
        ([[0, 0], [1, 0], [1, float("nan")]], [("triangle", [[0, 1, 2]])], "not finite"),
    ],
)
def test_meshes_that_are_refused(tmp_path, points, blocks, message):
    """The file, what is wrong, and where."""
    file = vtu(tmp_path / "odd.vtu", points, blocks)
    with pytest.raises(MeshError, match=message) as caught:
        read_file(file, boundaries=None)
    assert str(file) in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "path", "message"),
    [
        (
            {"boundaries": {"foot": "x[1] < -1"}},
            "mesh.boundaries.foot",
            "selects no exterior facet",
        ),
        (
            {"boundaries": {"foot": "x[2] < 1"}},
            "mesh.boundaries.foot",
            "the mesh is plane: there is no x[2]",
        ),
        (
            {"boundaries": {"foot": 7}},
            "mesh.boundaries.foot",
            "selects no exterior facet; the numbers there are: 1, 2,",
        ),
        ({"regions": {"part": "x[0] > 5"}}, "mesh.regions.part", "selects no cell"),
        (
            {"data": "colour"},
            "mesh.data",
            "no cell data 'colour' of whole numbers; there are: 'side'",
        ),
    ],
)
def test_selections_that_take_nothing(tmp_path, changes, path, message):
    """A name that would be empty is a mistake in the scene."""
    file = written(tmp_path, "triangle", "vtu")
    with pytest.raises(SceneError) as caught:
        alone(scene({"file": file, **changes}))
    ((found, text),) = caught.value.problems
    assert found == path
    assert message in text


@pytest.mark.parametrize(
    "given",
    [
        {"foot": 1.5},
        {"foot": True},
        {"foot": "import os"},
        {"foot": "x[3] < 1"},
        ["foot"],
        {"foot": []},
        {"foot": [1, "a"]},
    ],
)
def test_selections_in_the_scene(given):
    """A whole number or an expression; everything else is refused before the file is looked at."""
    with pytest.raises(SceneError, match=r"mesh\.boundaries"):
        scene({"file": "nowhere.vtu", "boundaries": given})


def test_tags_of_dolfinx(tmp_path):
    """A mesh with tags on facets and cells as dolfinx writes them into one XDMF file."""
    own = mesh.create_rectangle(
        MPI.COMM_SELF, [[0.0, 0.0], [LENGTH, HEIGHT]], [NX, NY], mesh.CellType.quadrilateral
    )
    sides = {
        1: lambda x: x[1] < 1e-9,
        2: lambda x: x[1] > 1 - 1e-9,
        3: lambda x: x[0] < 1e-9,
        4: lambda x: x[0] > 3 - 1e-9,
    }
    found = [mesh.locate_entities_boundary(own, 1, marker) for marker in sides.values()]
    values = np.concatenate(
        [np.full(len(f), tag, dtype=np.int32) for tag, f in zip(sides, found, strict=True)]
    )
    facets = np.concatenate(found)
    order = np.argsort(facets)
    facet_tags = mesh.meshtags(own, 1, facets[order], values[order])
    low = mesh.locate_entities(own, 2, lambda x: x[1] < 0.51)
    cell_tags = mesh.meshtags(own, 2, low, np.full(len(low), 7, dtype=np.int32))
    facet_tags.name, cell_tags.name = "sides", "parts"
    own.topology.create_connectivity(1, 2)
    with XDMFFile(MPI.COMM_SELF, tmp_path / "mesh.xdmf", "w") as file:
        file.write_mesh(own)
        file.write_meshtags(facet_tags, own.geometry)
        file.write_meshtags(cell_tags, own.geometry)
    arrays = read_file(tmp_path / "mesh.xdmf")
    assert {name: len(rows) for name, rows in arrays.regions.items()} == {"region_7": 24}
    assert set(arrays.boundaries) == {"boundary_1", "boundary_2", "boundary_3", "boundary_4"}
    names = {name: tag for tag, name in enumerate(RULES, start=1)}
    same_answer(
        ours("quadrilateral"), alone(scene({"file": tmp_path / "mesh.xdmf", "boundaries": names}))
    )


def test_a_package_that_is_not_installed(tmp_path, monkeypatch):
    """The error names it."""
    file = tmp_path / "any.vtu"
    file.touch()
    monkeypatch.setitem(sys.modules, "meshio.vtu", None)
    with pytest.raises(MeshError, match=r"meshio cannot read it as vtu: .*meshio\.vtu"):
        read_file(file)
