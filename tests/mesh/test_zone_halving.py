"""Meshes whose cells are halved around some points only."""

import basix.ufl
import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.files.arrays import sides_of
from signorini_fx.mechanics.mesh.files.raw import row_keys
from signorini_fx.mechanics.mesh.halving import halved, halved_in_part
from signorini_fx.mechanics.mesh.tagged import arrays_of, from_arrays, generate_mesh, load_file, tag_boundaries
from signorini_fx.mechanics.mesh.zone_halving import halved_around, has_divisible_zone
from signorini_fx.mechanics.statement.mesh_sources import MeshFile

WORLD = MPI.COMM_WORLD
HALF_DISK = {"radius": 1.0, "symmetric": True, "size": 0.2, "contact_size": 0.08, "contact_zone": 0.3}

# Two unequal triangles with curved sides share a corner of two boundaries; a region of its own on the right.
GEO = """
Mesh.ElementOrder = {order};
Point(1) = {{0, 0, 0, 0.3}}; Point(2) = {{2, 0, 0, 0.3}}; Point(3) = {{2, 1, 0, 0.3}}; Point(4) = {{0, 1, 0, 0.3}};
Point(5) = {{1, -2, 0, 0.3}}; Point(6) = {{1, 1, 0, 0.3}}; Point(7) = {{1, 0.2360679774997898, 0, 0.3}};
Circle(1) = {{1, 5, 7}}; Circle(7) = {{7, 5, 2}}; Line(2) = {{2, 3}}; Line(3) = {{3, 6}}; Line(4) = {{6, 4}};
Line(5) = {{4, 1}}; Line(6) = {{7, 6}};
Curve Loop(1) = {{1, 6, 4, 5}}; Plane Surface(1) = {{1}}; Curve Loop(2) = {{7, 2, 3, -6}}; Plane Surface(2) = {{2}};
Physical Curve("all") = {{1, 7, 2, 3, 4, 5}}; Physical Curve("round") = {{1, 7}};
Physical Surface("left") = {{1}}; Physical Surface("right") = {{2}};
"""


@pytest.fixture(params=[1, 2], ids=["straight", "curved"])
def body(request, tmp_path):
    """Overlapping boundaries, and regions."""
    (tmp_path / "body.geo").write_text(GEO.format(order=request.param))
    return load_file(MeshFile(file=tmp_path / "body.geo"), MPI.COMM_SELF, degree=request.param)


def measures(tagged):
    """Areas of the body and its regions, and lengths of its boundaries, by name."""
    cells = ufl.Measure("dx", domain=tagged.mesh, subdomain_data=tagged.cell_tags)
    facets = ufl.Measure("ds", domain=tagged.mesh, subdomain_data=tagged.facet_tags)

    def integral(measure):
        one = fem.form(fem.Constant(tagged.mesh, 1.0) * measure)
        return tagged.mesh.comm.allreduce(fem.assemble_scalar(one))

    return {
        "body": integral(cells),
        **{name: integral(cells(tags)) for name, tags in tagged.regions.items()},
        **{name: integral(facets(tags)) for name, tags in tagged.boundaries.items()},
    }


def test_areas_and_lengths_stay_and_the_mesh_is_conforming(body):
    arrays = arrays_of(body)
    around = np.linalg.norm(arrays.points[arrays.corners].mean(axis=1) - (1.0, 0.3), axis=1) < 0.4
    chosen = around | (np.arange(len(around)) % 9 == 0)  # some others have two neighbours that are halved
    assert 4 < np.count_nonzero(chosen) < 0.6 * len(chosen)
    finer = halved_in_part(arrays, chosen)
    again = from_arrays(MPI.COMM_SELF, lambda: finer)
    assert set(again.boundaries) == {"all", "round"}
    assert set(again.regions) == {"left", "right"}
    # Lengths of curved facets are not integrated exactly.
    assert measures(again) == pytest.approx(measures(body), rel=1e-12 if arrays.degree == 1 else 1e-9)
    # A node in the middle of a side of a neighbour would leave sides that one cell has alone.
    keys = row_keys(sides_of(finer.cells, finer.cell)[:, :2])
    counts = np.unique(keys, return_counts=True)[1]
    assert counts.max() == 2
    assert np.count_nonzero(counts == 1) == len(finer.facets)
    # Every chosen cell has become four, and some others two; none is inside out.
    assert len(arrays.cells) + 3 * np.count_nonzero(chosen) < len(finer.cells) < 4 * len(arrays.cells)
    first, second = (finer.points[finer.corners[:, k]] - finer.points[finer.corners[:, 0]] for k in (1, 2))
    assert np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]).min() > 0
    assert len(finer.points) == len(np.unique(finer.cells))


def test_all_cells_as_halved(body):
    arrays = arrays_of(body)
    finer, expected = halved_in_part(arrays, np.ones(len(arrays.cells), dtype=bool)), halved(arrays)
    assert len(finer.cells) == len(expected.cells)
    places = [np.sort(mesh.points, axis=0) for mesh in (finer, expected)]
    assert places[0] == pytest.approx(places[1], abs=1e-9)
    centres = [np.sort(mesh.points[mesh.corners].mean(axis=1), axis=0) for mesh in (finer, expected)]
    assert centres[0] == pytest.approx(centres[1], abs=1e-9)
    assert len(finer.facets) == len(expected.facets)


def test_none():
    arrays = arrays_of(generate_mesh("half_disk", HALF_DISK, MPI.COMM_SELF))
    same = halved_in_part(arrays, np.zeros(len(arrays.cells), dtype=bool))
    assert len(same.cells) == len(arrays.cells)
    assert len(same.points) == len(arrays.points)


def on_boundary(tagged, name):
    facets = tagged.facets(name)
    dim = tagged.dimension
    tagged.mesh.topology.create_connectivity(dim - 1, dim)
    nodes = np.unique(dmesh.entities_to_geometry(tagged.mesh, dim - 1, facets)) if len(facets) else []
    return tagged.mesh.geometry.x[nodes, :dim]


def test_straight_facets_are_divided_on_the_curve():
    """A circle of radius 1, whose centre is at (0, 1): chords of 0.08 are off by 8e-4."""
    tagged = generate_mesh("half_disk", HALF_DISK, MPI.COMM_SELF)
    point = np.zeros((1, 2))
    off = {}
    for curved in ((), ("arc",)):
        finer = halved_around(tagged, point, 0.25, curved)
        x = on_boundary(finer, "arc")
        off[bool(curved)] = np.abs(np.linalg.norm(x - (0.0, 1.0), axis=1) - 1).max()
        assert len(x) > len(on_boundary(tagged, "arc"))
    assert off[False] > 5e-4
    assert off[True] < 2e-6


def test_corners_are_not_rounded():
    """All sides of a rectangle are one boundary."""
    tagged = generate_mesh("rectangle", {"length": 2.0, "height": 1.0, "nx": 6, "ny": 3, "cell": "triangle"}, WORLD)
    tagged = tag_boundaries(tagged.mesh, {"all": lambda x: np.ones(x.shape[1])})
    x = [np.ptp(halved_around(tagged, np.zeros((1, 2)), 9.0, tagged.boundaries).mesh.geometry.x, axis=0)]
    assert x[0] == pytest.approx([2.0, 1.0, 0.0], abs=1e-12)
    assert measures(halved_around(tagged, np.zeros((1, 2)), 0.6, tagged.boundaries)) == pytest.approx(measures(tagged))


def test_which_cells_it_can_divide():
    size = {"length": 2.0, "height": 1.0, "nx": 2, "ny": 1}
    assert has_divisible_zone(generate_mesh("half_disk", {**HALF_DISK, "order": 2}, MPI.COMM_SELF))
    assert has_divisible_zone(generate_mesh("rectangle", {**size, "cell": "quadrilateral"}, MPI.COMM_SELF))
    sheet = dmesh.create_mesh(
        MPI.COMM_SELF, [[0, 1, 2]], np.eye(3), basix.ufl.element("Lagrange", "triangle", 1, shape=(3,))
    )
    assert not has_divisible_zone(tag_boundaries(sheet, {"all": lambda x: np.ones(x.shape[1])}))


BOX = {"length": 2.0, "width": 1.3, "height": 1.0, "nx": 4, "ny": 3, "nz": 3}
BALL = {"part": "quarter", "radius": 1.0, "size": 0.3, "contact_size": 0.1, "contact_zone": 0.3}
KINDS = {
    "quadrilaterals": ("rectangle", {"length": 2.0, "height": 1.0, "nx": 7, "ny": 5, "cell": "quadrilateral"}),
    "tetrahedra": ("half_sphere", {**BALL, "order": 1}),
    "curved tetrahedra": ("half_sphere", {**BALL, "order": 2}),
    "hexahedra": ("box", {**BOX, "cell": "hexahedron"}),
}


@pytest.mark.parametrize("kind", KINDS)
def test_other_cells(kind):
    """Volumes and areas stay; what two cells share they divide alike; all cells halved are those of ``halved``."""
    name, parameters = KINDS[kind]
    tagged = generate_mesh(name, parameters, MPI.COMM_SELF)
    arrays = arrays_of(tagged)
    middles = arrays.points[arrays.corners].mean(axis=1)
    chosen = np.linalg.norm(middles - arrays.points.min(axis=0), axis=1) < 0.5
    chosen |= np.arange(len(chosen)) % 29 == 28  # tetrahedra beside several of these have any pattern
    finer = halved_in_part(arrays, chosen)
    assert measures(from_arrays(MPI.COMM_SELF, lambda: finer)) == pytest.approx(measures(tagged), rel=1e-9)
    keys = row_keys(sides_of(finer.cells, finer.cell)[:, : len(finer.facet.corners)])
    counts = np.unique(keys, return_counts=True)[1]
    assert counts.max() == 2
    assert np.count_nonzero(counts == 1) == len(finer.facets)
    parts = 2**finer.dim
    assert len(chosen) + (parts - 1) * np.count_nonzero(chosen) <= len(finer.cells) < parts * len(chosen)
    assert len(finer.points) == len(np.unique(finer.cells))
    everywhere, expected = halved_in_part(arrays, np.ones(len(chosen), dtype=bool)), halved(arrays)
    assert len(everywhere.points) == len(expected.points)
    for values in (lambda mesh: mesh.points, lambda mesh: mesh.points[mesh.corners].mean(axis=1)):
        places = [np.sort(values(mesh), axis=0) for mesh in (everywhere, expected)]
        assert places[0] == pytest.approx(places[1], abs=1e-9)


def test_rows_of_quadrilaterals_end_at_the_boundary():
    """One cell in the corner of 7 x 5 halves a column and a row: 8 x 6."""
    arrays = arrays_of(generate_mesh(*KINDS["quadrilaterals"], MPI.COMM_SELF))
    chosen = np.zeros(len(arrays.cells), dtype=bool)
    chosen[arrays.points[arrays.corners].mean(axis=1).sum(axis=1).argmin()] = True
    assert len(halved_in_part(arrays, chosen).cells) == 8 * 6


@pytest.mark.parametrize("cell", ["tetrahedron", "hexahedron"])
def test_facets_in_space_are_divided_on_the_surface(cell):
    """A sphere through the nodes, cut by planes of symmetry, in which nodes stay: facets of it bulge by 5e-3."""
    tagged = generate_mesh("box", {**BOX, "length": 1.0, "width": 1.0, "cell": cell}, MPI.COMM_SELF)
    x = tagged.mesh.geometry.x
    x[:, 2] += (1 - x[:, 2]) * (2 - np.sqrt(4 - x[:, 0] ** 2 - x[:, 1] ** 2))  # bottom of radius 2 around (0, 0, 2)
    off = {}
    for curved in ((), ("bottom",)):
        finer = halved_around(tagged, np.zeros((1, 3)), 0.3, curved)
        found = on_boundary(finer, "bottom")
        off[bool(curved)] = np.abs(np.linalg.norm(found - (0.0, 0.0, 2.0), axis=1) - 2).max()
        for side, axis in (("left", 0), ("front", 1)):
            assert np.abs(on_boundary(finer, side)[:, axis]).max() < 1e-12
        assert len(found) > len(on_boundary(tagged, "bottom"))
    assert off[False] > 4e-3
    assert off[True] < 0.05 * off[False]


def test_edges_of_surfaces_are_not_rounded():
    """All sides of a box are one boundary."""
    tagged = generate_mesh("box", {**BOX, "cell": "tetrahedron"}, MPI.COMM_SELF)
    tagged = tag_boundaries(tagged.mesh, {"all": lambda x: np.ones(x.shape[1])})
    finer = halved_around(tagged, np.zeros((1, 3)), 0.6, tagged.boundaries)
    assert measures(finer) == pytest.approx(measures(tagged), rel=1e-12)


def test_cells_that_would_turn_inside_out():
    """A thin layer below a curve that bulges into it by more than its height."""
    top = np.array([(x, 0.1 * (x - 1) ** 2) for x in (0.0, 1.0, 2.0)])
    cells = [[0, 1, 3], [1, 4, 3], [1, 2, 4], [2, 5, 4]]
    points = np.concatenate((top, top - (0.0, 0.01)))
    sheet = dmesh.create_mesh(MPI.COMM_SELF, cells, points, basix.ufl.element("Lagrange", "triangle", 1, shape=(2,)))
    tagged = tag_boundaries(sheet, {"top": lambda x: x[1] > 0.1 * (x[0] - 1) ** 2 - 1e-6})
    assert len(on_boundary(tagged, "top")) == 3
    assert len(on_boundary(halved_around(tagged, np.zeros((1, 2)), 9.0), "top")) == 5
    with pytest.raises(MeshError, match="inside out"):
        halved_around(tagged, np.zeros((1, 2)), 9.0, ["top"])


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("name", "parameters", "curved"),
    [
        ("half_disk", {**HALF_DISK, "order": 2}, ["arc"]),
        (*KINDS["tetrahedra"], ["sphere"]),
        (*KINDS["hexahedra"], ["bottom"]),
    ],
    ids=["triangles", "tetrahedra", "hexahedra"],
)
def test_the_same_mesh_on_any_number_of_ranks(name, parameters, curved):
    alone, shared = (
        halved_around(tagged, np.zeros((1, tagged.dimension)), 0.3, curved)
        for tagged in (generate_mesh(name, parameters, comm) for comm in (MPI.COMM_SELF, WORLD))
    )
    dim = alone.dimension
    assert shared.mesh.topology.index_map(dim).size_global == alone.mesh.topology.index_map(dim).size_global
    assert measures(shared) == pytest.approx(measures(alone), rel=1e-12)
