"""Every generator: names, area, shape of the cells, the same mesh every time; parameters that do not go together."""

import re
import sys
import tomllib
from math import cos, pi, radians, sin, tan
from pathlib import Path

import numpy as np
import pytest
from mesh_quality import quality
from mpi4py import MPI
from scenes import alone, table_of

from signorini_fx.errors import SceneError
from signorini_fx.machine.compat import geometry_cells, geometry_degree
from signorini_fx.mechanics.mesh.tagged import generate_mesh, simplex_parameters
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.scene import Discretised
from signorini_fx.scenes.solver import solve
from signorini_fx.scenes.template import scene_schema


def segment(radius, angle):
    """What a chord cuts off a disk, the angle from the middle in degrees."""
    turn = radians(angle)
    return radius**2 * (turn - sin(turn) * cos(turn))


SIDES = {"top": 3, "left": 1, "right": 1}
# Parameters of a small mesh: names of its boundaries, its area and how long they are.
SMALL = {
    "block": (
        {"nx": 12, "ny": 4, "layout": "graded", "grading": 5.0},
        3.0,
        {"bottom": 3, "top": 3, "left": 1, "right": 1},
    ),
    "rectangle": ({"nx": 12, "ny": 4}, 3.0, {"bottom": 3, "top": 3, "left": 1, "right": 1}),
    "notched_sides": ({"nx": 30, "ny": 10}, 3.0, {"bottom": 3, "top": 3, "left": 0.8, "right": 0.8}),
    "half_disk": ({"contact_size": 0.2}, 32 * pi, {"arc": 8 * pi, "top": 16}),
    "ring_segment": (
        {"contact_size": 0.2},
        (64 - 36) * pi / 3,
        {"outer": 16 * pi / 3, "inner": 4 * pi, "left": 2, "right": 2},
    ),
    "block_on_cylinder": (
        {"contact_size": 0.2},
        10 * (5 + 2) - segment(4, 60),
        {"seat": 8 * pi / 3, "bottom": 10 - 8 * sin(pi / 3), "left": 7, "right": 7, "top": 10},
    ),
    "punch": ({}, 12 - 0.5 + pi / 8, {"foot": 3 + pi / 2, "left": 2.5, "right": 2.5, "top": 4}),
    "wedge": (
        {"nx": 6, "ny": 10},
        2 * (1 + 2 * tan(pi / 12)),
        {"tip": 1, "top": 1 + 4 * tan(pi / 12), "left": 2 / cos(pi / 12), "right": 2 / cos(pi / 12)},
    ),
    "plate_with_hole": ({}, 32 - pi, {"hole": 2 * pi, "bottom": 8, "right": 4, "top": 8, "left": 4}),
    "dovetail": ({}, None, {"bottom": 26, "left": None, "right": None, "top": 14}),
}
HALVES = {
    "half_disk": (16 * pi, {"arc": 4 * pi, "top": 8, "symmetry": 8}),
    "ring_segment": (14 * pi / 3, {"outer": 8 * pi / 3, "inner": 2 * pi, "right": 2, "symmetry": 2}),
    "punch": (6 - 0.25 + pi / 16, {"foot": 1.5 + pi / 4, "right": 2.5, "top": 2, "symmetry": 3}),
    "plate_with_hole": (16 - pi / 2, {"hole": pi, "right": 2, "top": 8, "left": 2, "symmetry": 6}),
}
CURVED = ["half_disk", "ring_segment", "block_on_cylinder", "punch", "plate_with_hole", "dovetail"]
each = pytest.mark.parametrize("name", SMALL)
each_curved = pytest.mark.parametrize("name", CURVED)
each_cell = pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])


def make(name, comm=MPI.COMM_SELF, **changes):
    """The small mesh of a generator."""
    return generate_mesh(name, SMALL[name][0] | changes, comm)


def corners(tagged):
    """Points, and the corners of each cell along its perimeter."""
    mesh = tagged.mesh
    order = [0, 1, 2] if mesh.topology.cell_name() == "triangle" else [0, 1, 3, 2]
    return mesh.geometry.x[:, :2], geometry_cells(mesh)[:, order]


def area(tagged):
    """Of the cells with straight sides."""
    points, cells = corners(tagged)
    x, after = points[cells], np.roll(points[cells], -1, axis=1)
    return 0.5 * np.abs((x[..., 0] * after[..., 1] - x[..., 1] * after[..., 0]).sum(axis=1)).sum()


def ends(tagged, name):
    """End points of the facets of a boundary, shape (facets, 2, 2)."""
    topology = tagged.mesh.topology
    topology.create_connectivity(1, 0)
    topology.create_connectivity(0, 2)
    topology.create_connectivity(2, 0)
    to_vertices, cell_of, of_cell = (
        topology.connectivity(1, 0),
        topology.connectivity(0, 2),
        topology.connectivity(2, 0),
    )
    where, cells = {}, geometry_cells(tagged.mesh)
    for facet in tagged.facets(name):
        for vertex in to_vertices.links(facet):
            cell = cell_of.links(vertex)[0]
            local = list(of_cell.links(cell)).index(vertex)
            where[vertex] = tagged.mesh.geometry.x[cells[cell, local], :2]
    return np.array([[where[v] for v in to_vertices.links(facet)] for facet in tagged.facets(name)])


def length(tagged, name):
    """Of a boundary with straight facets."""
    x = ends(tagged, name)
    return np.hypot(*(x[:, 1] - x[:, 0]).T).sum()


def check(tagged, whole, lengths, rel):
    """Names, lengths, area and shape of the cells."""
    assert set(tagged.boundaries) == set(lengths)
    for boundary, expected in lengths.items():
        if expected is not None:
            assert length(tagged, boundary) == pytest.approx(expected, rel=rel), boundary
    if whole is not None:
        assert area(tagged) == pytest.approx(whole, rel=rel)


@pytest.mark.one_quick
@each_cell
@each
def test_names_area_and_quality(name, cell):
    """What the sketch promises."""
    _, whole, lengths = SMALL[name]
    tagged = make(name, cell=cell)
    check(tagged, whole, lengths, 4e-3)
    assert tagged.mesh.topology.cell_name() == cell
    shape = quality(*corners(tagged))
    # Graded and structured meshes have cells that are long on purpose, the others have none.
    low, mean = (0.15, 0.4) if name in ("block", "wedge") else (0.35, 0.8)
    assert shape.min() > low
    assert shape.mean() > mean


@pytest.mark.one_quick
@each_cell
@each_curved
def test_geometry_of_degree_two(name, cell):
    """The nodes within the facets are on the arcs: the area is right to the fourth order, not the second."""
    straight, curved = (make(name, cell=cell, order=order) for order in (1, 2))
    assert (geometry_degree(straight.mesh), geometry_degree(curved.mesh)) == (1, 2)
    exact = SMALL[name][1]
    if exact is None:
        exact = integral(make(name, cell=cell, order=2, contact_size=0.1, size=0.5))
    errors = [abs(integral(tagged) / exact - 1) for tagged in (straight, curved)]
    assert errors[1] < 2e-6
    assert errors[1] < 0.05 * errors[0]


def integral(tagged):
    """The area with curved sides."""
    import ufl
    from dolfinx import default_scalar_type, fem

    one = fem.Constant(tagged.mesh, default_scalar_type(1.0))
    return fem.assemble_scalar(fem.form(one * ufl.dx(metadata={"quadrature_degree": 4})))


@pytest.mark.parametrize(
    ("name", "changes", "path"),
    [
        ("ring_segment", {"thickness": 9.0}, "thickness"),
        ("ring_segment", {"angle": 180.0}, "angle"),
        ("notched_sides", {"ny": 10, "lower": 0.25}, "lower"),
        ("notched_sides", {"lower": 1.0}, "lower"),
        ("block_on_cylinder", {"length": 6.0}, "length"),
        ("block_on_cylinder", {"angle": 100.0}, "angle"),
        ("punch", {"rounding": 2.0}, "rounding"),
        ("wedge", {"angle": 90.0}, "angle"),
        ("wedge", {"nx": 0}, "nx"),
        ("plate_with_hole", {"radius": 2.0}, "radius"),
        ("dovetail", {"neck": 30.0}, "neck"),
        ("dovetail", {"fillet": 6.0}, "fillet"),
        ("dovetail", {"stem": 0.1}, "fillet"),
    ],
)
def test_parameters_that_are_refused(name, changes, path):
    """With the path of the parameter, at once."""
    with pytest.raises(SceneError) as caught:
        make(name, **changes)
    assert [problem[0] for problem in caught.value.problems] == [f"mesh.parameters.{path}"]


# --- generators of other packages ------------------------------------------------------------------------------------

GUIDE = Path(__file__).parents[2] / "docs" / "meshes.md"


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """Installs a package with these generators, and with the module of the guide."""

    def install(*generators):
        guide = GUIDE.read_text(encoding="utf-8")
        code, settings = (re.search(rf"```{kind}\n(.*?)```", guide, re.DOTALL)[1] for kind in ("python", "toml"))
        (tmp_path / "wavy.py").write_text(code, encoding="utf-8")
        project = tomllib.loads(settings)["project"]
        ((group, names),) = project["entry-points"].items()
        data = tmp_path / f"{project['name']}-{project['version']}.dist-info"
        data.mkdir()
        (data / "METADATA").write_text(f"Name: {project['name']}\nVersion: {project['version']}\n", encoding="utf-8")
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
    """That of the guide is named in a scene as ours are, on several meshes too, and its parameters are checked."""
    installed()
    assert "wavy" in scene_schema()["$defs"]["MeshGenerator"]["properties"]["generator"]["enum"]
    solution = alone(wavy({"nx": 24}, solver={"levels": 2}))
    assert solution.converged
    assert [row.dofs for row in solution.convergence_table[:2]] == [2 * 13 * 5, 2 * 25 * 9]
    columns = table_of(solution).columns
    assert columns["y"].max() == pytest.approx(0.1)
    assert (columns["state"] != "open").any()
    assert simplex_parameters("wavy", {}) is None
    for parameters, told in (({"depth": 2}, "less than 1"), ({"length": -1.0}, "positive"), ({"n": 1}, "nx, ny")):
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


# --- bodies in contact -----------------------------------------------------------------------------------------------

STEEL = {"young": 210000.0, "poisson": 0.3}


def solved(name, parameters, contact, **effects):
    """A solution, its contact force checked against the loads by the certificate."""
    data = {"mesh": {"generator": name, "parameters": parameters}, "contact": contact, "material": STEEL, **effects}
    solution = alone(parse_scene(data))
    assert solution.converged
    return solution


@pytest.mark.parametrize("friction", [0.0, 0.1, 0.2])
def test_wedge_in_its_groove(friction):
    """The normal force on each flank balances the load: P / (2 (sin a + F cos a)) while it slides down."""
    angle, load = radians(15.0), 100.0
    solution = solved(
        "wedge",
        {"nx": 8, "ny": 16},
        [{"boundary": side, "friction": {"law": "coulomb", "coefficient": friction}} for side in ("left", "right")],
        traction={"boundary": "top", "pressure": load},
    )
    columns = table_of(solution).columns
    total = load * (1 + 4 * tan(angle))
    normal = np.dot(columns["weight"], columns["pressure"])
    assert normal == pytest.approx(total / (sin(angle) + friction * cos(angle)), rel=1e-5)


@pytest.mark.mpi
@each_cell
def test_linear_elements_on_curved_cells(cell):
    """They cannot turn without strain, so they are refused."""
    scene = parse_scene(
        {
            "mesh": {"generator": "punch", "parameters": {"order": 2, "cell": cell, "contact_size": 0.2}},
            "material": STEEL,
            "displacement": {"boundary": "top", "x": 0.0, "y": -0.001},
            "contact": {"boundary": "foot", "gap": "x[1]", "direction": [0, -1]},
        }
    )
    for ask in (solve, check_scene):
        with pytest.raises(SceneError, match=r"element\.degree: the mesh has curved cells: set degree = 2"):
            ask(scene, MPI.COMM_WORLD)
    quadratic = scene.model_copy(update={"element": Discretised(degree=2)})
    assert solve(quadratic, MPI.COMM_WORLD).converged
