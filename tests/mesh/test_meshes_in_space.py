"""Generators in 3D: names, volume, areas, shape of the cells; the same mesh every time, on ranks, in all units."""

from math import cos, pi, radians, tan

import numpy as np
import pytest
import ufl
from dolfinx import default_scalar_type, fem
from dolfinx import mesh as dmesh
from mesh_quality import quality
from mpi4py import MPI

from signorini_fx.errors import SceneError
from signorini_fx.machine.compat import geometry_cells, geometry_degree, geometry_element
from signorini_fx.mechanics.mesh.files.cells import CELLS
from signorini_fx.mechanics.mesh.files.shape import check_shape
from signorini_fx.mechanics.mesh.refinement import refine
from signorini_fx.mechanics.mesh.tagged import generate_mesh, simplex_parameters

TAN, COS = tan(radians(15)), cos(radians(15))
FLANK = 2 * 2 / COS
SECTION = 2 * (1 + 2 * TAN)
# The bracket's seat is a ring, its hole goes through the foot; beside the fillet a square less a quarter of a circle.
SEAT, HOLE, FILLET = pi * (10**2 - 5.5**2), pi * 5.5**2, 6**2 * (1 - pi / 4)
# Parameters of a small mesh: its volume and the areas of its boundaries.
SMALL = {
    "box": (
        {"nx": 6, "ny": 2, "nz": 2},
        3.0,
        {"left": 1, "right": 1, "front": 3, "back": 3, "bottom": 3, "top": 3},
    ),
    "wedge_block": (
        {"nx": 4, "ny": 4, "nz": 6},
        2 * SECTION,
        {"tip": 2, "top": 2 + 8 * TAN, "left": FLANK, "right": FLANK, "front": SECTION, "back": SECTION},
    ),
    "cylinder": ({"nz": 4}, pi, {"bottom": pi, "top": pi, "side": 2 * pi}),
    "ring": (
        {"nr": 4, "nz": 2},
        1.5 * pi,
        {"bottom": 3 * pi, "top": 3 * pi, "inner": pi, "outer": 2 * pi},
    ),
    "half_sphere": ({"contact_size": 0.4}, 1024 * pi / 3, {"sphere": 128 * pi, "top": 64 * pi}),
    "bracket": (
        {"contact_size": 3.0},
        40 * (60 * 8 + 42 * 8 + FILLET) - 8 * HOLE,
        {
            "foot": 2400 - HOLE,
            "heel": 2000,
            "toe": 320,
            "top": 320,
            "inside": 40 * (46 + 36 + 3 * pi) - HOLE - SEAT,
            "seat": SEAT,
            "hole": 8 * 11 * pi,
            "front": 60 * 8 + 42 * 8 + FILLET,
            "back": 60 * 8 + 42 * 8 + FILLET,
        },
    ),
}
CURVED = ["cylinder", "ring", "half_sphere", "bracket"]
STRUCTURED = ["box", "wedge_block", "cylinder", "ring"]
PARTS = ["half_sphere"]
each = pytest.mark.parametrize("name", SMALL)
each_cell = pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
each_curved = pytest.mark.parametrize("name", CURVED)


def make(name, comm=MPI.COMM_SELF, **changes):
    """The small mesh of a generator."""
    return generate_mesh(name, SMALL[name][0] | changes, comm)


def integral(tagged, boundary=None):
    """The volume, or the area of a boundary, with curved sides; over all ranks."""
    mesh = tagged.mesh
    one, measure = fem.Constant(mesh, default_scalar_type(1.0)), ufl.dx(metadata={"quadrature_degree": 6})
    if boundary is not None:
        facets = tagged.facets(boundary)
        tags = dmesh.meshtags(mesh, 2, facets, np.ones(len(facets), dtype=np.int32))
        measure = ufl.Measure("ds", mesh, subdomain_data=tags, metadata={"quadrature_degree": 6})(1)
    return mesh.comm.allreduce(fem.assemble_scalar(fem.form(one * measure)))


def check(tagged, volume, areas, rel):
    """Names, areas and volume; no facet is without a name, which is also to say that the mesh is conforming."""
    assert set(tagged.boundaries) == set(areas)
    for boundary, expected in areas.items():
        assert integral(tagged, boundary) == pytest.approx(expected, rel=rel), boundary
    assert integral(tagged) == pytest.approx(volume, rel=rel)
    named = np.concatenate([tagged.facets(boundary) for boundary in areas])
    exterior = dmesh.exterior_facet_indices(tagged.mesh.topology)
    np.testing.assert_array_equal(np.sort(named), np.sort(exterior))


def cells_of(tagged):
    """Nodes of the cells in the order of mesh files, and their kind."""
    word, degree = tagged.mesh.topology.cell_name(), geometry_degree(tagged.mesh)
    kind = {"tetrahedron": ("tetra", "tetra10"), "hexahedron": ("hexahedron", "hexahedron27")}[word][degree - 1]
    cell = CELLS[kind]
    places = geometry_element(tagged.mesh).points
    own = [np.mean([cell.corners[c] for c in corners], axis=0) for corners in cell.nodes]
    order = [int(np.argmin(np.abs(places - x).sum(axis=1))) for x in own]
    return geometry_cells(tagged.mesh)[:, order], cell


@pytest.mark.one_quick
@each_cell
@each
def test_names_volume_areas_and_quality(name, cell):
    """What the sketch promises; straight sides lose a little of what is round."""
    _, volume, areas = SMALL[name]
    tagged = make(name, cell=cell)
    check(tagged, volume, areas, 3e-2 if name in CURVED else 1e-12)
    assert tagged.mesh.topology.cell_name() == cell
    nodes, kind = cells_of(tagged)
    shape = quality(tagged.mesh.geometry.x, nodes[:, : len(kind.corners)])
    # Tetrahedra that are divided make hexahedra of a worse shape than a grid has.
    low, mean = (0.15, 0.45) if cell == "hexahedron" and name not in STRUCTURED else (0.3, 0.6)
    assert shape.min() > low
    assert shape.mean() > mean


@pytest.mark.one_quick
@each_cell
@each_curved
def test_geometry_of_degree_two(name, cell):
    """The nodes within facets and edges are on the surfaces: volume and areas are right to the fourth order."""
    _, volume, areas = SMALL[name]
    straight, curved = (make(name, cell=cell, order=order) for order in (1, 2))
    assert (geometry_degree(straight.mesh), geometry_degree(curved.mesh)) == (1, 2)
    check(curved, volume, areas, 5e-4)
    errors = [abs(integral(tagged) / volume - 1) for tagged in (straight, curved)]
    assert errors[1] < 0.05 * errors[0]
    nodes, kind = cells_of(curved)
    check_shape(curved.mesh.geometry.x, nodes, kind, name)  # none is turned inside out


@pytest.mark.one_quick
@pytest.mark.mpi
@pytest.mark.parametrize("everything", [True, False], ids=["all", "marked"])
@pytest.mark.parametrize("name", ["box", "wedge_block"])
def test_refined(name, everything):
    """Tetrahedra are bisected on any number of ranks: areas, volume and region stay."""
    parameters = simplex_parameters(name, SMALL[name][0])
    tagged = generate_mesh(name, parameters, MPI.COMM_WORLD)
    fine = refine(tagged, None if everything else np.arange(2, dtype=np.int32))
    assert integral(fine) == pytest.approx(integral(tagged), rel=1e-12)
    for boundary in tagged.boundaries:
        assert integral(fine, boundary) == pytest.approx(integral(tagged, boundary), rel=1e-12)
    cells = [one.mesh.topology.index_map(3).size_global for one in (tagged, fine)]
    assert (cells[1] == 8 * cells[0]) if everything else (cells[0] < cells[1] < 4 * cells[0])
    if name == "wedge_block":
        index_map = fine.mesh.topology.index_map(3)
        assert len(fine.cells("body")) == index_map.size_local + index_map.num_ghosts


@pytest.mark.parametrize(
    ("name", "changes", "path"),
    [
        ("ring", {"inner_radius": 2.0}, "inner_radius"),
        ("ring", {"nt": 1}, "nt"),
        ("wedge_block", {"angle": 90.0}, "angle"),
        ("half_sphere", {"part": "third"}, "part"),
        ("bracket", {"thickness": 45.0}, "thickness"),
        ("bracket", {"seat_radius": 23.0}, "seat_radius"),
        ("bracket", {"radius": 10.0}, "radius"),
        ("box", {"width": -1.0}, "width"),
    ],
)
def test_parameters_that_are_refused(name, changes, path):
    """With the path of the parameter, at once."""
    with pytest.raises(SceneError) as caught:
        make(name, **changes)
    assert [problem[0] for problem in caught.value.problems] == [f"mesh.parameters.{path}"]


TOO_MANY = {"nx": 999, "ny": 999, "nz": 999}
TOO_MANY_AROUND = {"nr": 999, "nt": 999, "nz": 999}


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("name", "changes"),
    [
        *((name, {"contact_size": 1e-9}) for name in ("half_sphere", "bracket")),
        ("half_sphere", {"size": 1e-3, "contact_size": 1e-3}),
        *((name, TOO_MANY) for name in ("box", "wedge_block")),
        *((name, TOO_MANY_AROUND) for name in ("cylinder", "ring")),
    ],
    ids=str,
)
def test_more_cells_than_there_could_be(name, changes):
    """A mesh that no machine could hold is refused before it is tried, on all ranks."""
    with pytest.raises(SceneError, match=r"mesh\.parameters"):
        make(name, MPI.COMM_WORLD, **changes)


# --- bodies in contact -----------------------------------------------------------------------------------------------

STEEL = {"young": 210000.0, "poisson": 0.3}
