"""Fields on the deformed body: their values, their colours, and curved cells."""

from dataclasses import replace

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from matplotlib.collections import TriMesh
from mpi4py import MPI
from numpy.testing import assert_allclose
from scene_tables import fixed
from scenes import alone, example1, rectangle
from scipy.spatial import cKDTree
from spaces import block, box

from signorini_fx.addons.pictures import deformed_body
from signorini_fx.addons.pictures.deformed_body import deformed_mesh
from signorini_fx.addons.pictures.gather import gather_body
from signorini_fx.machine import parallel
from signorini_fx.results.files import ON_DEMAND, write_results
from signorini_fx.scenes import cli
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

DISK = {"radius": 8.0, "size": 4.0, "order": 2, "symmetric": True}


def half_disk():
    """Curved cells, few of them."""
    return parse_scene(
        {
            "mesh": {"generator": "half_disk", "parameters": DISK},
            "element": {"degree": 2},
            "material": {"young": 200.0, "poisson": 0.3},
            "displacement": [{"boundary": "symmetry", "normal": 0.0}],
            "traction": [{"boundary": "top", "pressure": 0.2}],
            "contact": [{"boundary": "arc", "gap": "x[1]", "direction": [0, -1]}],
        }
    )


@pytest.mark.mpi(slow=True)
def test_curved_cells_are_drawn_curved():
    """The outline is the boundary of the quarter disk, a closed line; its arc is a parabola through
    three points of the circle in each cell, not a chord.
    """
    comm = MPI.COMM_WORLD
    gathered = comm.bcast(gather_body(solve(half_disk(), comm)))
    corners = gathered.points[gathered.perimeters]
    assert gathered.perimeters.shape[1] == 12
    x, y = corners[..., 0], corners[..., 1]
    area = 0.5 * np.abs((x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum())
    assert area == pytest.approx(np.pi * 64 / 4, rel=3e-3)
    ends = gathered.points[gathered.outline]
    assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum() == pytest.approx(
        16 + 4 * np.pi, rel=2e-3
    )
    radii = np.hypot(ends[..., 0], ends[..., 1] - 8.0).ravel()
    on_arc = (ends[..., 0].ravel() > 1e-6) & (ends[..., 1].ravel() < 8.0 - 1e-6)
    longest = max(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)) * 4
    assert np.abs(radii[on_arc] - 8.0).max() < 0.2 * longest**2 / (
        8 * 8.0
    )  # a fifth of the sagitta


@pytest.mark.mpi(slow=True)
def test_fields_are_the_same_on_any_number_of_ranks():
    """In 2D and in 3D, cell by cell at their places."""
    comm = MPI.COMM_WORLD
    plane, space = (
        (lambda ranks: example1(bound=1.5, nx=12, ny=4)),
        (lambda ranks: block(6, bound=1.5, comm=ranks)),
    )
    for scene in (plane, space):
        both = []
        for ranks in (comm, MPI.COMM_SELF):
            found = ranks.bcast(gather_body(solve(scene(ranks), ranks), ("von_mises", *ON_DEMAND)))
            polygons = found.perimeters
            middle = found.points[polygons].mean(axis=1)
            values = np.column_stack([field.mean(axis=1) for field in found.values.values()])
            both.append(values[np.lexsort(np.round(middle, 6).T)])
        scale = np.abs(both[1]).max(axis=0)
        assert_allclose(both[0] / scale, both[1] / scale, atol=1e-8)


def test_fields_that_are_none(tmp_path, capsys):
    """The known ones are named."""
    solution = alone(example1(nx=6, ny=2))
    with pytest.raises(ValueError, match="no picture of 'mises': there are von_mises, pressure"):
        write_results(solution, tmp_path, pictures=["mises"])
    with pytest.raises(SystemExit, match="2"):
        cli.main(["solve", "scene.toml", "--picture", "mises"])
    assert f"choose from {', '.join(ON_DEMAND)}" in capsys.readouterr().err.replace("'", "")


# --- values at points of the cells ----------------------------------------------------------------


NODAL = {
    "triangles": lambda comm: example1(bound=1.5, nx=9, ny=3, cell="triangle"),
    "quadrilaterals": lambda comm: example1(bound=1.5, nx=9, ny=3),
    "curved": lambda comm: half_disk(),
    "tetrahedra": lambda comm: block(3, "tetrahedra", bound=1.5, comm=comm),
    "hexahedra": lambda comm: block(3, bound=1.5, comm=comm),
    "quadratic": lambda comm: block(3, bound=1.5, degree=2, comm=comm),
}


@pytest.mark.mpi
@pytest.mark.one_quick("scene", NODAL.values(), ids=NODAL)
def test_vertices_have_the_recovered_values(scene):
    """At each vertex of each cell stands what ``recovered`` has there; the displacement is that of
    the elements.
    """
    comm = MPI.COMM_WORLD
    solution = solve(scene(comm), comm)
    plane = solution.model.tagged.dimension == 2
    found = gather_body(solution, ("von_mises", *ON_DEMAND))
    own = solution.stress.recovered
    nodal = {
        "von_mises": own.von_mises,
        "density": own.shear_energy_density,
        "pressure": own.tensor,
    }
    local = own.von_mises.function_space.tabulate_dof_coordinates()[:, : 2 if plane else 3]
    places = parallel.gather_rows(comm, local)
    for name, function in nodal.items():
        values = function.x.array.reshape(len(local), -1)
        values = -values[:, [0, 4, 8]].sum(axis=1) / 3 if name == "pressure" else values[:, 0]
        nodal[name] = parallel.gather_rows(comm, values)
    if comm.rank != 0:
        return
    assert found.recovered
    corners = found.within[:, found.tiles.vertices]
    at = cKDTree(places).query(found.points[corners])
    assert at[0].max() < 1e-9
    for name, values in nodal.items():
        drawn = found.values[name]
        assert drawn.shape == found.within.shape
        assert_allclose(
            drawn[:, found.tiles.vertices], values[at[1]], rtol=1e-9, atol=1e-9 * abs(values).max()
        )
    size = np.linalg.norm(found.displacement, axis=1)
    assert_allclose(found.values["displacement"], size[found.within], rtol=1e-9, atol=1e-15)


def layered(tagged):
    """The scene of two materials above each other on a mesh, drawn out by the same amount
    everywhere: the stress is E times the strain in each.
    """
    mesh = tagged.mesh
    dim = mesh.topology.dim
    cells = np.arange(mesh.topology.index_map(dim).size_local, dtype=np.int32)
    above = dmesh.compute_midpoints(mesh, dim, cells)[:, dim - 1] > 0.5
    tags = dmesh.meshtags(mesh, dim, cells, np.where(above, 2, 1).astype(np.int32))
    more = {"hypothesis": "plane stress"} if dim == 2 else {}
    return parse_scene(
        {
            "mesh": replace(tagged, cell_tags=tags, regions={"below": 1, "above": 2}),
            "material": [
                {"region": name, "young": young, "poisson": 0.0, **more}
                for name, young in (("below", 1000.0), ("above", 10.0))
            ],
            "displacement": [
                fixed("left", "x"),
                {"boundary": "right", "x": 0.03},
                fixed("bottom", "xyz"[dim - 1]),
                *([fixed("front", "y")] if dim == 3 else []),
            ],
        }
    )


def two_layers():
    """A solved strip of two materials."""
    return alone(layered(rectangle(nx=6, ny=4)))


def test_a_jump_between_materials_is_not_smeared(tmp_path):
    """Along the interface each side has its own stress, and the picture has no other values."""
    gathered = gather_body(two_layers(), ("von_mises",))
    middle = gathered.points[gathered.perimeters].mean(axis=1)[:, 1]
    expected = np.where(middle > 0.5, 0.1, 10.0)[:, None].repeat(5, axis=1)  # E times 0.03 / 3
    assert_allclose(gathered.values["von_mises"], expected, rtol=1e-5)
    mesh, _ = drawn_in_the_plane(gathered)
    corners = mesh.get_array()[mesh._triangulation.triangles]
    assert_allclose(corners.min(axis=1), corners.max(axis=1), rtol=1e-5)


def test_a_jump_between_materials_in_space():
    """On the outer surface too, where facets of both materials share points."""
    surface = gather_body(alone(layered(box("hexahedra", (3, 2, 2)))), ("von_mises",))
    assert (
        np.ptp(np.bincount(surface.perimeters.ravel())[np.unique(surface.perimeters)]) > 0
    )  # points are shared
    middle = surface.points[surface.perimeters].mean(axis=1)[:, 2]
    expected = np.where(middle > 0.5, 0.1, 10.0)[:, None].repeat(5, axis=1)
    assert_allclose(surface.values["von_mises"], expected, rtol=1e-5)


def drawn_in_the_plane(gathered, name="von_mises"):
    """What has colours that vary within cells, and the label of the colour bar."""
    axes, bar = deformed_mesh(gathered, name)[0].axes
    (mesh,) = (one for one in axes.collections if isinstance(one, TriMesh))
    return mesh, bar.get_xlabel()


def test_the_colour_bar_says_what_is_seen():
    """Recovered, raw, or the displacement itself, which needs no recovery."""
    points = gather_body(alone(example1(nx=6, ny=2)), ("von_mises", "displacement"))
    mesh, label = drawn_in_the_plane(points)
    assert label == "von Mises stress, recovered"
    drawn = np.column_stack((mesh._triangulation.x, mesh._triangulation.y))
    away, at = cKDTree(drawn).query((points.points + 50 * points.displacement)[points.within])
    assert away.max() < 1e-12
    assert_allclose(mesh.get_array()[at], points.values["von_mises"], rtol=1e-5)
    _, label = drawn_in_the_plane(points, "displacement")
    assert label.split(" (unit")[0] == "size of the displacement"
    _, label = drawn_in_the_plane(replace(points, recovered=False))
    assert label == "von Mises stress, raw"


def test_the_circle_is_at_the_largest_value_that_is_drawn(monkeypatch, tmp_path):
    """Raw stresses may be larger, and are not drawn."""
    marked = []
    monkeypatch.setattr(deformed_body, "mark_largest", lambda *marks: marked.append(marks[2]))
    solution = alone(example1(nx=6, ny=2))
    write_results(solution, tmp_path, fields=False)
    drawn = gather_body(solution, ("von_mises",)).values["von_mises"].max()
    assert marked == [f"{drawn:.3g}"]


@pytest.mark.mpi
def test_nothing_is_recovered_from_what_is_not_finite():
    """The raw stress is drawn then, on all ranks: that of each cell."""
    comm = MPI.COMM_WORLD
    solution = solve(example1(nx=6, ny=2), comm)
    solution.displacement.x.array[: comm.rank] = np.nan  # on one of the ranks at most
    assert gather_body(solution, ("von_mises",)).recovered == (comm.size == 1)
    solution.displacement.x.array[0] = np.nan
    gathered = gather_body(solution, ("von_mises",))
    assert not gathered.recovered
    if comm.rank == 0:
        values = gathered.values["von_mises"]
        raw = solution.stress.von_mises
        own = solution.model.tagged.mesh.topology.index_map(2).size_local
        cells = raw.x.array[raw.function_space.dofmap.list[:own]]
        assert_allclose(values[:own].max(axis=1), cells.max(axis=1))
