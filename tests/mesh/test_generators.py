"""Every generator: names, sizes and shapes; the same mesh every time, on ranks, in all units; what
is refused.
"""

import inspect
import re
import sys
import tomllib
from math import cos, pi, radians, sin, tan
from pathlib import Path

import numpy as np
import pytest
import ufl
from dolfinx import default_scalar_type, fem
from dolfinx import mesh as dmesh
from mesh_quality import quality
from mpi4py import MPI
from numpy.testing import assert_allclose, assert_array_equal
from scenes import alone, table_of

from signorini_fx.errors import SceneError
from signorini_fx.machine.compat import geometry_cells, geometry_degree
from signorini_fx.mechanics.mesh.files.cells import CELLS, check_shape
from signorini_fx.mechanics.mesh.refinement import refine
from signorini_fx.mechanics.mesh.tagged import generate_mesh
from signorini_fx.mechanics.statement.mesh_sources import MeshGenerator, known_generators
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.scene import Element
from signorini_fx.scenes.solver import solve
from signorini_fx.scenes.template import scene_schema

# Parameters of a small mesh: its area, and how long its boundaries are.
PLANE = {
    "block": (
        {"nx": 12, "ny": 4, "layout": "graded", "grading": 5.0},
        3.0,
        {"bottom": 3, "top": 3, "left": 1, "right": 1},
    ),
    "rectangle": ({"nx": 12, "ny": 4}, 3.0, {"bottom": 3, "top": 3, "left": 1, "right": 1}),
    "half_disk": ({"contact_size": 0.2}, 32 * pi, {"arc": 8 * pi, "top": 16}),
    "ring_segment": (
        {"contact_size": 0.2},
        (64 - 36) * pi / 3,
        {"outer": 16 * pi / 3, "inner": 4 * pi, "left": 2, "right": 2},
    ),
    "punch": ({}, 12 - 0.5 + pi / 8, {"foot": 3 + pi / 2, "left": 2.5, "right": 2.5, "top": 4}),
    "wedge": (
        {"nx": 6, "ny": 10},
        2 * (1 + 2 * tan(pi / 12)),
        {
            "tip": 1,
            "top": 1 + 4 * tan(pi / 12),
            "left": 2 / cos(pi / 12),
            "right": 2 / cos(pi / 12),
        },
    ),
    "plate_with_hole": (
        {},
        32 - pi,
        {"hole": 2 * pi, "bottom": 8, "right": 4, "top": 8, "left": 4},
    ),
}
# The bracket's seat is a ring, its hole goes through the foot; beside the fillet a square less a
# quarter of a circle.
SEAT, HOLE, FILLET = pi * (10**2 - 5.5**2), pi * 5.5**2, 6**2 * (1 - pi / 4)
# Parameters of a small mesh: its volume and the areas of its boundaries.
SPACE = {
    "box": (
        {"nx": 6, "ny": 2, "nz": 2},
        3.0,
        {"left": 1, "right": 1, "front": 3, "back": 3, "bottom": 3, "top": 3},
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
SMALL = PLANE | SPACE
CURVED_PLANE = ["half_disk", "ring_segment", "punch", "plate_with_hole"]
CURVED_SPACE = ["cylinder", "ring", "half_sphere", "bracket"]
CURVED = CURVED_PLANE + CURVED_SPACE
KINDS = {
    "triangle": ("triangle", "triangle6"),
    "quadrilateral": ("quad", "quad9"),
    "tetrahedron": ("tetra", "tetra10"),
    "hexahedron": ("hexahedron", "hexahedron27"),
}
PLANE_CELLS, SPACE_CELLS = list(KINDS)[:2], list(KINDS)[2:]
NO_LENGTHS = {"angle", "grading"}
# Parameters that are no numbers of cells and give a coarser mesh as well.
COARSER = {"bracket": {"contact_size": 1.5, "size": 3.0}}
each = pytest.mark.parametrize("name", SMALL)


def with_cells(names):
    """Each of the generators with each kind of cell that it has."""
    pairs = [
        (name, cell) for name in names for cell in (PLANE_CELLS if name in PLANE else SPACE_CELLS)
    ]
    return pytest.mark.parametrize(("name", "cell"), pairs)


def make(name, comm=MPI.COMM_SELF, **changes):
    """The small mesh of a generator."""
    return generate_mesh(name, SMALL[name][0] | changes, comm)


def integral(tagged, boundary=None):
    """The size of the body, or of a boundary, with curved sides; over all ranks."""
    mesh = tagged.mesh
    one, measure = (
        fem.Constant(mesh, default_scalar_type(1.0)),
        ufl.dx(metadata={"quadrature_degree": 6}),
    )
    if boundary is not None:
        facets = tagged.facets(boundary)
        tags = dmesh.meshtags(
            mesh, tagged.dimension - 1, facets, np.ones(len(facets), dtype=np.int32)
        )
        measure = ufl.Measure("ds", mesh, subdomain_data=tags, metadata={"quadrature_degree": 6})(1)
    return mesh.comm.allreduce(fem.assemble_scalar(fem.form(one * measure)))


def check(name, tagged, rel):
    """Names and sizes; in 3D no facet is without a name, which is also to say that the mesh is
    conforming.
    """
    _, whole, sizes = SMALL[name]
    assert set(tagged.boundaries) == set(sizes)
    for boundary, expected in sizes.items():
        assert integral(tagged, boundary) == pytest.approx(expected, rel=rel), boundary
    assert integral(tagged) == pytest.approx(whole, rel=rel)
    if name in SPACE:
        named = np.concatenate([tagged.facets(boundary) for boundary in sizes])
        exterior = dmesh.exterior_facet_indices(tagged.mesh.topology)
        assert_array_equal(np.sort(named), np.sort(exterior))


def cells_of(tagged):
    """Positions, nodes of the cells, and their kind."""
    mesh = tagged.mesh
    cell = CELLS[KINDS[mesh.topology.cell_name()][geometry_degree(mesh) - 1]]
    return mesh.geometry.x[:, : tagged.dimension], geometry_cells(mesh), cell


def cells_of_all(tagged):
    """How many there are."""
    return tagged.mesh.topology.index_map(tagged.mesh.topology.dim).size_global


def test_all_are_here():
    """No generator is without these tests."""
    assert sorted(SMALL) == list(known_generators())


@pytest.mark.one_quick
@with_cells(SMALL)
def test_names_sizes_and_quality(name, cell):
    """What the sketch promises; straight sides lose a little of what is round."""
    tagged = make(name, cell=cell)
    check(name, tagged, 4e-3 if name in PLANE else 3e-2 if name in CURVED else 1e-12)
    assert tagged.mesh.topology.cell_name() == cell
    points, nodes, kind = cells_of(tagged)
    shape = quality(points, nodes[:, : len(kind.corners)])
    # Graded and structured meshes have cells that are long on purpose, the others in 2D have none.
    low, mean = (0.15, 0.4) if name in ("block", "wedge") else (0.35, 0.8)
    if name in SPACE:
        # Tetrahedra that are divided make hexahedra of a worse shape than a grid has.
        low, mean = (
            (0.15, 0.45)
            if cell == "hexahedron" and name in ("half_sphere", "bracket")
            else (0.3, 0.6)
        )
    assert shape.min() > low
    assert shape.mean() > mean


@pytest.mark.one_quick
@with_cells(CURVED)
def test_geometry_of_degree_two(name, cell):
    """The nodes within facets and edges are on the surfaces: sizes are right to the fourth order,
    not the second.
    """
    straight, curved = (make(name, cell=cell, order=order) for order in (1, 2))
    assert (geometry_degree(straight.mesh), geometry_degree(curved.mesh)) == (1, 2)
    check(name, curved, 5e-4)
    exact = SMALL[name][1]
    errors = [abs(integral(tagged) / exact - 1) for tagged in (straight, curved)]
    assert errors[1] < (2e-6 if name in PLANE else 5e-4)
    assert errors[1] < 0.05 * errors[0]
    points, nodes, kind = cells_of(curved)
    check_shape(points, nodes, kind, name)  # none is turned inside out


@pytest.mark.one_quick
@each
def test_the_same_mesh_every_time(name):
    """Points and cells, bit by bit."""
    first, second = make(name), make(name)
    assert_array_equal(first.mesh.geometry.x, second.mesh.geometry.x)
    assert_array_equal(geometry_cells(first.mesh), geometry_cells(second.mesh))


@pytest.mark.one_quick("unit", [1e-9, 1e6])
@each
def test_the_same_mesh_in_all_units(name, unit):
    """A body of nanometres or of kilometres has the same cells."""
    parameters = inspect.signature(known_generators()[name]()).parameters.items()
    values = {key: p.default for key, p in parameters} | SMALL[name][0]
    lengths = {
        k: unit * value
        for k, value in values.items()
        if isinstance(value, float) and k not in NO_LENGTHS
    }
    first, second = make(name), make(name, **lengths)
    assert_array_equal(geometry_cells(first.mesh), geometry_cells(second.mesh))
    size = np.abs(first.mesh.geometry.x).max()
    assert_allclose(second.mesh.geometry.x / unit, first.mesh.geometry.x, rtol=0, atol=1e-8 * size)


@pytest.mark.one_quick
@pytest.mark.mpi
@each
def test_on_ranks(name):
    """The cells and facets are the same on any number of ranks, and in 3D the areas."""
    comm = MPI.COMM_WORLD
    order = {"order": 2} if name in CURVED_SPACE else {}
    shared, own = make(name, comm, **order), make(name, **order)
    assert cells_of_all(shared) == cells_of_all(own)
    for boundary in own.boundaries:
        assert comm.allreduce(shared.facets(boundary).size) == own.facets(boundary).size, boundary
        if name in SPACE:
            assert integral(shared, boundary) == pytest.approx(integral(own, boundary), rel=1e-12)
    if name in SPACE:
        assert integral(shared) == pytest.approx(integral(own), rel=1e-12)


@pytest.mark.one_quick
@each
def test_coarser(name):
    """Facets twice as long: about a quarter, or an eighth, of the cells, the same names."""
    parameters = SMALL[name][0] | COARSER.get(name, {})
    coarse = generate_mesh(
        name,
        MeshGenerator(generator=name, parameters=parameters).coarser(2.0).parameters,
        MPI.COMM_SELF,
    )
    fine = generate_mesh(name, parameters, MPI.COMM_SELF)
    assert set(coarse.boundaries) == set(fine.boundaries)
    low, high = (4, 12) if name in SPACE else (2.5, 6)
    assert low < cells_of_all(fine) / cells_of_all(coarse) < high


@each
def test_words_that_are_refused(name):
    """With the path of the parameter, at once."""
    wrong = {"cell": "hexagon", "colour": "red"} | ({"order": 3} if name in CURVED else {})
    for key, value in wrong.items():
        with pytest.raises(SceneError) as caught:
            make(name, **{key: value})
        assert [problem[0] for problem in caught.value.problems] == [f"mesh.parameters.{key}"]


@pytest.mark.mpi
@pytest.mark.one_quick("everything", [True, False], ids=["all", "marked"])
@pytest.mark.parametrize("name", ["box", "half_sphere"])
def test_refined(name, everything):
    """Tetrahedra are bisected on any number of ranks: areas, volume and region stay."""
    parameters = {**SMALL[name][0], "cell": "tetrahedron"}
    tagged = generate_mesh(name, parameters, MPI.COMM_WORLD)
    fine = refine(tagged, None if everything else np.arange(2, dtype=np.int32))
    assert integral(fine) == pytest.approx(integral(tagged), rel=1e-12)
    for boundary in tagged.boundaries:
        assert integral(fine, boundary) == pytest.approx(integral(tagged, boundary), rel=1e-12)
    cells = [one.mesh.topology.index_map(3).size_global for one in (tagged, fine)]
    assert (cells[1] == 8 * cells[0]) if everything else (cells[0] < cells[1] < 4 * cells[0])
    if name == "half_sphere":
        index_map = fine.mesh.topology.index_map(3)
        assert len(fine.cells("body")) == index_map.size_local + index_map.num_ghosts


@pytest.mark.parametrize(
    ("name", "changes", "path"),
    [
        ("ring_segment", {"thickness": 9.0}, "thickness"),
        ("ring_segment", {"angle": 180.0}, "angle"),
        ("rectangle", {"ny": 10, "lower": 0.25}, "lower"),
        ("rectangle", {"lower": 1.0}, "lower"),
        ("punch", {"rounding": 2.0}, "rounding"),
        ("wedge", {"angle": 90.0}, "angle"),
        ("wedge", {"nx": 0}, "nx"),
        ("plate_with_hole", {"radius": 2.0}, "radius"),
        ("ring", {"inner_radius": 2.0}, "inner_radius"),
        ("ring", {"nt": 1}, "nt"),
        ("half_sphere", {"part": "third"}, "part"),
        ("bracket", {"thickness": 45.0}, "thickness"),
        ("bracket", {"seat_radius": 23.0}, "seat_radius"),
        ("bracket", {"radius": 10.0}, "radius"),
        ("box", {"width": -1.0}, "width"),
        *(
            (name, changes, *changes)
            for name in ("rectangle", "block")
            for changes in (
                {"nx": 0},
                {"nx": 2.5},
                {"nx": 10**400},
                {"length": -1.0},
                {"height": float("nan")},
                {"cell": "hexahedron"},
                {"radius": 1.0},
            )
        ),
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
        ("box", TOO_MANY),
        *((name, TOO_MANY_AROUND) for name in ("cylinder", "ring")),
    ],
    ids=str,
)
def test_more_cells_than_there_could_be(name, changes):
    """A mesh that no machine could hold is refused before it is tried, on all ranks."""
    with pytest.raises(SceneError, match=r"mesh\.parameters"):
        make(name, MPI.COMM_WORLD, **changes)


# --- generators of other packages -----------------------------------------------------------------

GUIDE = Path(__file__).parents[2] / "docs" / "meshes.md"


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """Installs a package with these generators, and with the module of the guide."""

    def install(*generators):
        guide = GUIDE.read_text(encoding="utf-8")
        code, settings = (
            re.search(rf"```{kind}\n(.*?)```", guide, re.DOTALL)[1] for kind in ("python", "toml")
        )
        (tmp_path / "wavy.py").write_text(code, encoding="utf-8")
        project = tomllib.loads(settings)["project"]
        ((group, names),) = project["entry-points"].items()
        data = tmp_path / f"{project['name']}-{project['version']}.dist-info"
        data.mkdir()
        (data / "METADATA").write_text(
            f"Name: {project['name']}\nVersion: {project['version']}\n", encoding="utf-8"
        )
        lines = [*(f"{name} = {value}" for name, value in names.items()), *generators]
        (data / "entry_points.txt").write_text("\n".join([f"[{group}]", *lines]), encoding="utf-8")
        monkeypatch.syspath_prepend(tmp_path)
        monkeypatch.delitem(sys.modules, "wavy", raising=False)

    return install


def wavy(parameters, **settings):
    """A scene on the mesh of the guide."""
    return parse_scene(
        {
            "mesh": {"generator": "wavy", "parameters": parameters},
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": {"boundary": "top", "x": 0.0, "y": -0.01},
            "contact": {"boundary": "bottom", "gap": "x[1]", "direction": [0, -1]},
            **settings,
        }
    )


def test_generator_of_another_package(installed):
    """That of the guide is named in a scene as ours are, on several meshes too, and its parameters
    are checked.
    """
    installed()
    assert "wavy" in scene_schema()["$defs"]["MeshGenerator"]["properties"]["generator"]["enum"]
    solution = alone(wavy({"nx": 24}, solver={"levels": 2}))
    assert solution.converged
    assert [row.dofs for row in solution.convergence_table[:2]] == [2 * 13 * 5, 2 * 25 * 9]
    columns = table_of(solution).columns
    assert columns["y"].max() == pytest.approx(0.1)
    assert (columns["state"] != "open").any()
    assert MeshGenerator(generator="wavy").of_simplices is None
    for parameters, told in (
        ({"depth": 2}, "less than 1"),
        ({"length": -1.0}, "greater than 0"),
        ({"n": 1}, "nx, ny"),
    ):
        with pytest.raises(SceneError, match=told):
            alone(wavy(parameters))


def test_generators_of_other_packages_that_cannot_be_used(installed):
    """The message says where it comes from; ours stay ours."""
    installed("absent = nowhere:generate", "broken = wavy:nothing", "box = wavy:generate")
    for name, told in (
        ("absent", "No module named 'nowhere'"),
        ("broken", "nothing"),
        ("other", "no generator 'other'"),
    ):
        with pytest.raises(SceneError, match=rf"mesh\.generator: .*{told}"):
            generate_mesh(name, {}, MPI.COMM_SELF)
    assert generate_mesh("box", {"nx": 2, "ny": 1, "nz": 1}, MPI.COMM_SELF).dimension == 3


# --- bodies in contact ----------------------------------------------------------------------------

STEEL = {"young": 210000.0, "poisson": 0.3}


def solved(name, parameters, contact, **effects):
    """A solution, its contact force checked against the loads by the certificate."""
    data = {
        "mesh": {"generator": name, "parameters": parameters},
        "contact": contact,
        "material": STEEL,
        **effects,
    }
    solution = alone(parse_scene(data))
    assert solution.converged
    return solution


@pytest.mark.parametrize("friction", [0.0, 0.1, 0.2])
def test_wedge_in_its_groove(friction):
    """The normal force on each flank balances the load: P / (2 (sin a + F cos a)) while it slides
    down.
    """
    angle, load = radians(15.0), 100.0
    solution = solved(
        "wedge",
        {"nx": 8, "ny": 16},
        [
            {"boundary": side, "friction": {"law": "coulomb", "coefficient": friction}}
            for side in ("left", "right")
        ],
        traction={"boundary": "top", "pressure": load},
    )
    columns = table_of(solution).columns
    total = load * (1 + 4 * tan(angle))
    normal = np.dot(columns["weight"], columns["pressure"])
    assert normal == pytest.approx(total / (sin(angle) + friction * cos(angle)), rel=1e-5)


@pytest.mark.mpi
@pytest.mark.parametrize("cell", PLANE_CELLS)
def test_linear_elements_on_curved_cells(cell):
    """They cannot turn without strain, so they are refused."""
    scene = parse_scene(
        {
            "mesh": {
                "generator": "punch",
                "parameters": {"order": 2, "cell": cell, "contact_size": 0.2},
            },
            "material": STEEL,
            "displacement": {"boundary": "top", "x": 0.0, "y": -0.001},
            "contact": {"boundary": "foot", "gap": "x[1]", "direction": [0, -1]},
        }
    )
    for ask in (solve, check_scene):
        with pytest.raises(
            SceneError, match=r"element\.degree: the mesh has curved cells: set degree = 2"
        ):
            ask(scene, MPI.COMM_WORLD)
    quadratic = scene.model_copy(update={"element": Element(degree=2)})
    assert solve(quadratic, MPI.COMM_WORLD).converged
