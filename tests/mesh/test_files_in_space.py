"""Mesh files in 3D: names, volume and moments survive every format; drawings of CAD programs; what
is refused.
"""

import itertools

import gmsh
import meshio
import numpy as np
import pytest
import ufl
from dolfinx import default_scalar_type, fem
from mesh_files import read_file, write_msh
from mpi4py import MPI

from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.files.cells import CELLS, completed, measures, order_in
from signorini_fx.mechanics.mesh.halving import halved
from signorini_fx.mechanics.mesh.tagged import load_file, read_mesh
from signorini_fx.mechanics.statement.mesh_sources import MeshFile

KINDS = ["tetra", "tetra10", "hexahedron", "hexahedron27"]
each_kind = pytest.mark.parametrize("kind", KINDS)
# A quarter of a ring of radii 1 and 2 and height 1.5: volume, the integral of x y z, and areas.
VOLUME, MOMENT = np.pi / 4 * 3 * 1.5, 15 / 4 / 2 * 1.5**2 / 2
FOOT, OUTSIDE = np.pi / 4 * 3, np.pi * 1.5


def quarter(folder, kind):
    """The quarter of a ring by gmsh, its names overlapping and its inside without one; two
    regions.
    """
    recombine = "Recombine;" if kind.startswith("hexa") else ""
    file = folder / f"{kind}.geo"
    file.write_text(
        f"""
        Mesh.ElementOrder = {2 if kind[-1].isdigit() else 1};
        Point(1) = {{1, 0, 0}}; Point(2) = {{2, 0, 0}}; Point(3) = {{0, 2, 0}}; Point(4) = {{0, 1, 0}};
        Point(5) = {{0, 0, 0}};
        Line(1) = {{1, 2}}; Circle(2) = {{2, 5, 3}}; Line(3) = {{3, 4}}; Circle(4) = {{4, 5, 1}};
        Curve Loop(1) = {{1, 2, 3, 4}}; Plane Surface(1) = {{1}};
        Transfinite Curve{{2, 4}} = 5; Transfinite Curve{{1, 3}} = 3; Transfinite Surface{{1}};
        {"Recombine Surface{:};" if recombine else ""}
        low[] = Extrude {{0, 0, 0.75}} {{ Surface{{1}}; Layers{{1}}; {recombine} }};
        high[] = Extrude {{0, 0, 0.75}} {{ Surface{{low[0]}}; Layers{{1}}; {recombine} }};
        Physical Volume("lower half") = {{low[1]}}; Physical Volume("all") = {{low[1], high[1]}};
        Physical Surface("foot") = {{1}}; Physical Surface("ends") = {{1, high[0]}};
        Physical Surface("outside") = {{low[3], high[3]}};
        """
    )
    return file


def areas(found):
    """Area of each boundary."""
    each = measures(found.points, found.facets, found.facet)
    return {name: each[rows].sum() for name, rows in found.boundaries.items()}


def volumes(found):
    """Volume of each region."""
    each = measures(found.points, found.cells, found.cell)
    return {name: each[rows].sum() for name, rows in found.regions.items()}


def integrals(tagged):
    """Volume and the integral of x y z by dolfinx, over all ranks."""
    x, dx = ufl.SpatialCoordinate(tagged.mesh), ufl.dx(metadata={"quadrature_degree": 8})
    terms = (fem.Constant(tagged.mesh, default_scalar_type(1.0)), x[0] * x[1] * x[2])
    return [tagged.mesh.comm.allreduce(fem.assemble_scalar(fem.form(term * dx))) for term in terms]


def check_quarter(found, rel):
    """Names and sizes, of a straight mesh (rel 3e-2) or of a curved one."""
    assert volumes(found) == pytest.approx({"lower half": VOLUME / 2, "all": VOLUME}, rel=rel)
    assert areas(found) == pytest.approx(
        {"foot": FOOT, "ends": 2 * FOOT, "outside": OUTSIDE}, rel=rel
    )


@each_kind
def test_a_script(tmp_path, kind):
    """A .geo in 3D, and what dolfinx makes of it: wrong nodes would give another moment."""
    file = quarter(tmp_path, kind)
    found, rel = read_file(file), 3e-4 if kind[-1].isdigit() else 6e-2
    assert found.kind == kind
    check_quarter(found, rel)
    assert integrals(read_mesh(file, MPI.COMM_SELF)) == pytest.approx([VOLUME, MOMENT], rel=rel)


def in_meshio(elements, cell):
    """Nodes of elements in the order of meshio."""
    return elements[:, np.argsort(order_in("vtk", cell))]


def foreign(folder, kind):
    """The quarter as another program has it: points in another order, every other cell mirrored,
    triangles apart.
    """
    own = read_file(quarter(folder, kind))
    order = np.random.default_rng(1).permutation(len(own.points))
    points = np.empty_like(own.points)
    points[order] = own.points
    # The mirror image of a cell: its corners exchanged, and the nodes between them along with them.
    cell = CELLS[kind]
    swap = [1, 0, 3, 2, 5, 4, 7, 6] if cell.word == "hexahedra" else [1, 0, 2, 3]
    place = {frozenset(corners): node for node, corners in enumerate(cell.nodes)}
    mirror = [place[frozenset(swap[c] for c in corners)] for corners in cell.nodes]
    cells = order[own.cells]
    cells[::2] = cells[::2][:, mirror]
    foot = order[own.facets[own.boundaries["foot"]]]
    return points, [(kind, in_meshio(cells, cell)), (cell.facet, in_meshio(foot, own.facet))]


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.one_quick(
    ("kind", "form"),
    [
        *((kind, form) for kind in KINDS for form in ("gmsh22", "vtu")),
        *(
            (kind, form) for kind in KINDS[:3] for form in ("med", "abaqus")
        ),  # which have no hexahedra of 27 nodes
    ],
)
def test_files_of_others(tmp_path, kind, form):
    """meshio writes each format in its own order of nodes; a mirrored cell is a cell."""
    points, blocks = foreign(tmp_path, kind)
    suffix = {"gmsh22": "msh", "abaqus": "inp"}.get(form, form)
    numbers = [np.full(len(nodes), tag) for tag, (_, nodes) in enumerate(blocks, start=7)]
    other = meshio.Mesh(points, blocks)
    if form == "gmsh22":
        other.cell_data = {"gmsh:physical": numbers, "gmsh:geometrical": numbers}
        other.field_data = {"body": np.array([7, 3]), "foot": np.array([8, 2])}
    elif form == "med":
        other.cell_data = {"cell_tags": [-own for own in numbers]}
        other.cell_tags = {-7: ["body"], -8: ["foot"]}
    elif form == "abaqus":
        other = meshio.Mesh(points, blocks[:1], point_sets={"foot": np.unique(blocks[1][1])})
    else:
        other.cell_data = {"number": numbers}
    file = tmp_path / f"foreign.{suffix}"
    meshio.write(file, other, file_format=form)
    found = read_file(file, {"foot": 8} if form == "vtu" else None)
    own = read_file(tmp_path / f"{kind}.geo")
    assert areas(found)["foot"] == pytest.approx(areas(own)["foot"], rel=1e-12)
    tagged = [
        read_mesh(tmp_path / f"{kind}.geo", MPI.COMM_SELF),
        read_mesh(file, MPI.COMM_SELF, {"foot": low}),
    ]
    assert integrals(tagged[1]) == pytest.approx(integrals(tagged[0]), rel=1e-12)
    assert tagged[1].facets("foot").size == len(own.boundaries["foot"])


def low(x):
    """A rule for the foot."""
    return x[2] < 1e-9


@pytest.mark.parametrize("kind", ["quad8", "hexahedron20"])
def test_shape_of_completed_elements(kind):
    """The nodes that are added are where the element has them: exact for all polynomials of its
    space.
    """
    cell, weights = completed(kind)
    x = 2 * np.array([np.mean([cell.corners[c] for c in own], axis=0) for own in cell.nodes]) - 1
    powers = [
        p for p in itertools.product(range(3), repeat=cell.dim) if sum(n for n in p if n > 1) <= 2
    ]
    assert len(powers) == weights.shape[1]
    for power in powers:
        values = (x**power).prod(axis=1)
        np.testing.assert_allclose(weights @ values[: weights.shape[1]], values, atol=1e-14)


# The faces of a cube as the manual of Abaqus has them: S1 to S6.
CUBE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
FACES_OF_CUBE = [(2, 0), (2, 1), (1, 0), (0, 1), (1, 1), (0, 0)]
# Of a tetrahedron: the corner that is not on them.
APEX = [3, 2, 0, 1]


def abaqus(folder, element, points, sets="", surfaces=""):
    """A file with one element."""
    lines = [
        "*HEADING",
        "*NODE",
        *(f"{n}, {x}, {y}, {z}" for n, (x, y, z) in enumerate(points, start=1)),
    ]
    numbers = [str(n) for n in range(1, len(points) + 1)]
    rows = ",\n".join(", ".join(part) for part in (numbers[:12], numbers[12:]) if part)
    lines += [f"*ELEMENT, TYPE={element}, ELSET=solid", f"1, {rows}", sets, surfaces]
    file = folder / "one.inp"
    file.write_text("\n".join(line for line in lines if line) + "\n")
    return file


def between(corners, edges):
    """Corners and the middles of edges."""
    x = np.array(corners, dtype=float)
    return [*map(tuple, x), *(tuple((x[a] + x[b]) / 2) for a, b in edges)]


@pytest.mark.parametrize("element", ["C3D8", "C3D8R", "C3D8I", "C3D20", "C3D20R"])
def test_faces_of_abaqus_hexahedra(tmp_path, element):
    """Each face is where the manual says, by number and by a set of elements."""
    edges = [
        (0, 1),
        (1, 2),
        (2, 3),
        (3, 0),
        (4, 5),
        (5, 6),
        (6, 7),
        (7, 4),
        (0, 4),
        (1, 5),
        (2, 6),
        (3, 7),
    ]
    points = between(CUBE, edges if "20" in element else [])
    surfaces = "\n".join(f"*SURFACE, NAME=face{n}\nsolid, S{n}" for n in range(1, 7))
    found = read_file(abaqus(tmp_path, element, points, surfaces=surfaces))
    assert found.kind == ("hexahedron27" if "20" in element else "hexahedron")
    for n, (axis, at) in enumerate(FACES_OF_CUBE, start=1):
        (facet,) = found.facets[found.boundaries[f"face{n}"]]
        assert (found.points[facet][:, axis] == at).all(), n


@pytest.mark.parametrize("element", ["C3D4", "C3D10", "C3D10M"])
def test_faces_of_abaqus_tetrahedra(tmp_path, element):
    """Each face is opposite the corner that the manual says."""
    corners = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    edges = [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]
    points = between(corners, edges if "10" in element else [])
    surfaces = "\n".join(f"*SURFACE, NAME=face{n}\n1, S{n}" for n in range(1, 5))
    sets = "*NSET, NSET=floor\n1, 2, 3"
    found = read_file(abaqus(tmp_path, element, points, sets, surfaces))
    assert {name: len(rows) for name, rows in found.boundaries.items()}["floor"] == 1
    assert (found.points[found.facet_corners[found.boundaries["floor"]]][..., 2] == 0).all()
    for n, apex in enumerate(APEX, start=1):
        (facet,) = found.facet_corners[found.boundaries[f"face{n}"]]
        x = found.points[facet]
        assert not (x == corners[apex]).all(axis=1).any(), n
    with pytest.raises(MeshError, match=r"is a tetra\d* and has no face S5"):
        read_file(abaqus(tmp_path, element, points, surfaces="*SURFACE, NAME=no\n1, S5"))


# --- drawings of CAD programs ---------------------------------------------------------------------


@pytest.fixture(scope="module")
def drawings(tmp_path_factory):
    """A plate of 40 x 20 x 10 with a hole of radius 5, as .step and .brep."""
    folder = tmp_path_factory.mktemp("drawings")
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    occ = gmsh.model.occ
    occ.addBox(0, 0, 0, 40, 20, 10, 1)
    occ.addCylinder(20, 10, -1, 0, 0, 12, 5, 2)
    occ.cut([(3, 1)], [(3, 2)])
    occ.synchronize()
    gmsh.write(str(folder / "plain.step"))
    gmsh.write(str(folder / "plain.brep"))
    gmsh.clear()
    occ.addRectangle(0, 0, 0, 3, 1)
    occ.synchronize()
    gmsh.write(str(folder / "flat.step"))
    gmsh.finalize()
    text = (folder / "plain.step").read_text()
    (folder / "metres.stp").write_text(
        text.replace("SI_UNIT(.MILLI.,.METRE.)", "SI_UNIT($,.METRE.)")
    )
    return folder


# In the order in which OpenCASCADE writes the faces.
NAMES = ["left", "front", "cover", "back", "foot", "right end", "hole"]
NUMBERS = {name: number for number, name in enumerate(NAMES, start=1)}
PLATE, SHEET, RIM = 8000 - 250 * np.pi, 800 - 25 * np.pi, 100 * np.pi
SIDES = {
    "left": 200,
    "front": 400,
    "back": 400,
    "right end": 200,
    "cover": SHEET,
    "foot": SHEET,
    "hole": RIM,
}


@pytest.mark.one_quick("name", ["plain.step", "metres.stp"])
def test_faces_of_step(drawings, name):
    """They have the numbers of the file; the mesh is in millimetres whatever its unit."""
    unit = 1000.0 if name == "metres.stp" else 1.0
    found = read_file(drawings / name, NUMBERS, degree=2)
    assert found.kind == "tetra10"
    sizes = areas(found)
    assert {label: sizes[label] for label in SIDES} == pytest.approx(
        {label: unit**2 * area for label, area in SIDES.items()}, rel=1e-4
    )
    assert measures(found.points, found.cells, found.cell).sum() == pytest.approx(
        unit**3 * PLATE, rel=1e-4
    )
    assert set(found.boundaries) == {*SIDES, *(f"boundary_{n}" for n in range(1, 8))}
    assert list(found.regions) == [
        "region_1"
    ]  # and not the name that OpenCASCADE gives to a part without one


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        (
            "odd.step",
            b"no drawing",
            "is no file of the format step: it does not begin with ISO-10303-21",
        ),
        ("odd.stp", b"ISO-10303-21;\nHEADER;\n", "gmsh cannot read it"),
        ("odd.brep", b"Point(1) = {0, 0, 0};", "is no file of the format brep"),
        ("odd.brep", b"DBRep_DrawableShape\n\nCASCADE Topology V1", "gmsh cannot read it"),
    ],
)
def test_drawings_that_are_none(tmp_path, name, content, message, capfd):
    """One sentence with the name of the file."""
    file = tmp_path / name
    file.write_bytes(content)
    with pytest.raises(MeshError, match=message) as caught:
        read_file(file)
    assert str(file) in str(caught.value)
    assert capfd.readouterr() == ("", "")


# --- what is refused ------------------------------------------------------------------------------

TETRA = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
BALL = [[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, 1]]


@pytest.mark.parametrize(
    ("points", "blocks", "message"),
    [
        (
            [*CUBE, (0.5, 0.5, 2.0)],
            [("hexahedron", [list(range(8))]), ("tetra", [[4, 5, 6, 8], [4, 6, 7, 8]])],
            "1 hexahedron, 2 tetra: tetrahedra are made of all by gmsh without Recombine",
        ),
        (
            CUBE,
            [("hexahedron", [[0, 1, 3, 2, 4, 5, 7, 6]])],
            r"1 cells are folded, the first at \(0.5, 0.5, 0.5\)",
        ),
        ([*TETRA[:3], [1, 1, 0]], [("tetra", [[0, 1, 2, 3]])], "without an angle"),
        (TETRA, [("tetra", [[0, 1, 2, 3], [1, 0, 2, 3]])], "every facet belongs to two cells"),
        (
            BALL,
            [("triangle", [[0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]])],
            "not in a plane .* a body in 3D has",
        ),
        ([[1, *x[:2]] for x in CUBE[:4]], [("quad", [[0, 1, 2, 3]])], "turn it there"),
        ([[x, y, y] for x, y, _ in CUBE[:4]], [("quad", [[0, 1, 2, 3]])], "turn it there"),
        (
            [*TETRA, [1, 1, 1], [-1, -1, -1]],
            [("tetra", [[0, 1, 2, k] for k in (3, 4, 5)])],
            "a facet belongs to 3 cells",
        ),
        ([*TETRA[:3], [0, 0, float("inf")]], [("tetra", [[0, 1, 2, 3]])], "not finite"),
    ],
)
def test_meshes_that_are_refused(tmp_path, points, blocks, message):
    """The file, what is wrong, and where."""
    file = tmp_path / "odd.vtu"
    meshio.write(file, meshio.Mesh(np.array(points, dtype=float), blocks))
    with pytest.raises(MeshError, match=message) as caught:
        read_file(file)
    assert str(file) in str(caught.value)


def test_curved_cells_that_are_folded(tmp_path):
    """Also between their corners: two nodes in the middle of edges are exchanged."""
    found = read_file(quarter(tmp_path, "tetra10"))
    found.cells[0, [8, 9]] = found.cells[0, [9, 8]]
    meshio.write(
        tmp_path / "odd.vtu",
        meshio.Mesh(found.points, [("tetra10", in_meshio(found.cells, found.cell))]),
    )
    with pytest.raises(MeshError, match="1 cells are folded"):
        read_file(tmp_path / "odd.vtu")


# --- halving, info, ranks -------------------------------------------------------------------------


@each_kind
def test_halved(tmp_path, kind):
    """Eight children each; volume, areas and moments stay to round-off, and the mesh is
    conforming.
    """
    first = read_file(quarter(tmp_path, kind))
    finer = halved(first)
    assert len(finer.cells) == 8 * len(first.cells)
    assert len(finer.facets) == 4 * len(first.facets)
    assert volumes(finer) == pytest.approx(volumes(first), rel=1e-12)
    if first.degree == 1:  # the area of a curved facet is not integrated exactly
        assert areas(finer) == pytest.approx(areas(first), rel=1e-12)
    else:
        check_quarter(finer, 3e-4)
    file = tmp_path / "finer.vtu"
    meshio.write(file, meshio.Mesh(finer.points, [(kind, in_meshio(finer.cells, finer.cell))]))
    again = read_file(file)  # which counts the facets that one cell has alone
    assert {tuple(row) for row in np.sort(again.facet_corners)} == {
        tuple(row) for row in np.sort(finer.facet_corners)
    }
    tagged = [
        read_mesh(file, MPI.COMM_SELF, {"foot": low}),
        read_mesh(tmp_path / f"{kind}.geo", MPI.COMM_SELF),
    ]
    assert integrals(tagged[0]) == pytest.approx(integrals(tagged[1]), rel=1e-12)


@pytest.mark.mpi
@each_kind
def test_on_ranks(tmp_path, kind):
    """A file is read on one rank; names that overlap have all their facets and cells on any number
    of ranks.
    """
    comm = MPI.COMM_WORLD
    folder = comm.bcast(tmp_path)
    if comm.rank == 0:
        write_msh(quarter(folder, kind), folder / "body.msh")
    comm.barrier()
    tagged = load_file(MeshFile(file=folder / "body.msh"), comm, halvings=1)
    own = read_file(folder / "body.msh")
    counts = {name: comm.allreduce(int(tagged.facets(name).size)) for name in tagged.boundaries}
    assert counts == {name: 4 * len(rows) for name, rows in own.boundaries.items()}
    owned = tagged.mesh.topology.index_map(3).size_local
    cells = {
        name: comm.allreduce(int((tagged.cells(name) < owned).sum())) for name in tagged.regions
    }
    assert cells == {name: 8 * len(rows) for name, rows in own.regions.items()}
    rel = 3e-4 if kind[-1].isdigit() else 6e-2
    assert integrals(tagged) == pytest.approx([VOLUME, MOMENT], rel=rel)
