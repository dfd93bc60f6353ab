"""Pictures and page of a body in 3D: they say what the files say, on any number of ranks; no plane
scene pays.
"""

import re
import subprocess
import sys

import numpy as np
import pytest
from commands import summary_in
from drawing import needs_pictures_in_3d
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgba
from matplotlib.quiver import Quiver
from mesh_files import arrays_of
from mpi4py import MPI
from numpy.testing import assert_allclose, assert_array_equal
from PIL import Image
from scene_tables import fixed
from scenes import alone
from spaces import block, box, friction_of

from signorini_fx.addons.pictures import contact_surface, gather, results
from signorini_fx.addons.pictures.body import normals_of
from signorini_fx.addons.pictures.boundary_profiles import STATES
from signorini_fx.addons.pictures.style import VALUES
from signorini_fx.addons.report import page
from signorini_fx.machine.result_files import read_csv
from signorini_fx.results.files import write_results
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve


def stepped():
    """Tetrahedra, Tresca friction, three load steps, a title with markup."""
    data = block(6, "tetrahedra", bound=1.5)
    loads = [load.model_copy(update={"factors": (0.5, 1.0, 0.7)}) for load in data.traction]
    return data.model_copy(update={"traction": tuple(loads), "title": "$5 & <b>"})


def quadratic():
    data = block(6)
    return data.model_copy(update={"element": data.element.model_copy(update={"degree": 2})})


def between_walls():
    """Two contact boundaries, neither below: one has friction, the other has not."""
    return parse_scene(
        {
            "mesh": box("hexahedra", (4, 4, 4), size=(2.0, 1.0, 1.0)),
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": [fixed("bottom", "xyz")],
            "traction": [{"boundary": "top", "y": 4.0, "z": -40.0}],
            "contact": [
                {"boundary": "left", "friction": friction_of(coefficient=0.3)},
                {"boundary": "right", "gap": "0.001 * x[2]"},
            ],
        }
    )


SCENES = {
    "coulomb": lambda: block(12, coefficient=0.3),
    "steps": stepped,
    "quadratic": quadratic,
    "walls": between_walls,
}


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """A result folder of each scene, with its report."""
    found = {}
    for name, scene in SCENES.items():
        found[name] = tmp_path_factory.mktemp("space") / name
        write_results(alone(scene()), found[name], fields=False, pdf=name == "coulomb")
        page.write_report(found[name])
    return found


@pytest.fixture(params=SCENES)
def folder(request, folders):
    return folders[request.param]


def surface_in(folder):
    """The columns of the contact surface, and its rows at each facet, from the files."""
    arrays = arrays_of(folder / "contact.vtu")
    return read_csv(folder / "contact.csv"), arrays["connectivity"].reshape(
        len(arrays["offsets"]), -1
    )


def drawn(folder):
    """Sides and figure of the contact surface from the files."""
    table, facets = surface_in(folder)
    return contact_surface.sides_of(table, facets), contact_surface.contact_surface(table, facets)


def panels(figure):
    """The axes that are no colour bars, in order."""
    return [axes for axes in figure.axes if axes.get_label() != "<colorbar>"]


@pytest.mark.slow
def test_files(folder):
    """All are there, of a size to look at, none is blank, and none of those of a plane scene."""
    needs_pictures_in_3d()
    assert not (folder / "profiles.png").exists()
    for name in ("deformed", "contact_surface"):
        if folder.name == "coulomb":
            assert (folder / f"{name}.pdf").stat().st_size > 5000
        with Image.open(folder / f"{name}.png") as image:
            assert 400 < image.width < 2400  # two panels beside each other
            assert 300 < image.height < 3000
            assert np.asarray(image.convert("L")).std() > 10


def test_the_contact_pressure_stands_beside_the_body(tmp_path, monkeypatch):
    """On its surface, nothing where it is open, with a colour bar of its own; its facets are
    counterclockwise as seen from outside.
    """
    needs_pictures_in_3d()
    drawn = []
    monkeypatch.setattr(results, "finish", lambda figure, *_: drawn.append(figure))
    solution = alone(block(6, bound=1.5))
    table = solution.table
    results.gather_pictures(solution).draw(tmp_path, table, None)
    labels = [axes.get_xlabel() for axes in drawn[-1].axes if axes.get_label() == "<colorbar>"]
    assert labels == ["von Mises stress, recovered", "contact pressure"]
    points, facets, pressure = results._pressed(table)
    assert points.shape == (len(pressure), 3)
    assert facets.max() < len(pressure)
    open_nodes = table.columns["state"] == "open"
    assert open_nodes.any()
    assert_array_equal(pressure == 0.0, open_nodes)
    assert_array_equal(pressure[~open_nodes], table.columns["pressure"][~open_nodes])
    assert (normals_of(points[facets[:, :3]])[:, 2] < 0).all()


@pytest.mark.slow
def test_pressure_is_that_of_the_table(folder):
    """Colours are the pressures of contact.csv at its nodes, in the plane of the picture; the scale
    reaches the top.
    """
    sides, figure = drawn(folder)
    pressed = [axes for axes in panels(figure) if "seen along" in axes.get_title(loc="left")]
    assert len(pressed) == len(sides)
    for side, axes in zip(sides, pressed, strict=True):
        (mesh,) = [c for c in axes.collections if type(c).__name__ == "TriMesh"]
        pressure = side.floats("pressure")
        assert_array_equal(mesh.get_array()[: len(pressure)], pressure)
        points = np.column_stack((mesh._triangulation.x, mesh._triangulation.y))
        for direction, along in ((side.view.right, 0), (side.view.up, 1)):
            expected = np.column_stack([side.floats(axis) for axis in "xyz"]) @ direction
            assert_allclose(points[: len(pressure), along], expected, atol=1e-12)
        low, high = mesh.get_clim()
        assert low == 0
        assert high == pytest.approx(pressure.max())
        assert mesh.get_cmap() is VALUES
        # What is coloured is what touches: every node in contact, and no facet without one.
        corners = mesh._triangulation.triangles
        used = np.unique(corners[corners < len(pressure)])
        assert set(np.flatnonzero(side.touching)) <= set(used)


@pytest.mark.slow
def test_states_and_slip_are_those_of_the_table(folders):
    """Each node has the colour of its state on its own part of the area; arrows are the slip times
    what is said.
    """
    (side,), figure = drawn(folders["coulomb"])
    _, right = panels(figure)
    regions = next(c for c in right.collections if isinstance(c, PolyCollection))
    where, owner = contact_surface._around_nodes(side.nodes, side.polygons)
    expected = [to_rgba(STATES[str(state)][0]) for state in side.columns["state"][owner]]
    assert_allclose(regions.get_facecolor(), expected)
    x, y = where[..., 0], where[..., 1]
    pieces = np.abs((x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1)) / 2
    assert_allclose(np.bincount(owner, pieces), side.floats("weight"))
    assert np.abs(where - side.nodes[owner][:, None]).max() == pytest.approx(
        0.125
    )  # half of a facet
    (arrows,) = [c for c in right.collections if isinstance(c, Quiver)]
    factor = float(re.search(r"slip . (\d+)$", right.get_title(loc="left")).group(1))
    slips = np.flatnonzero(side.columns["friction"] == "slip")
    at = {tuple(np.round(side.nodes[row], 9)): row for row in slips}
    rows = [at[tuple(np.round(place, 9))] for place in arrows.get_offsets()]
    assert len(rows) == len(slips)  # few enough to show all
    for component, axis in ((arrows.U, "x"), (arrows.V, "y")):
        assert_allclose(
            component, factor * side.floats(f"slip_{axis}")[rows], rtol=1e-9, atol=1e-15
        )
    legend = {text.get_text() for text in figure.legends[0].get_texts()}
    assert legend == {"open", "slip", "stick"} & {str(s) for s in side.columns["state"]}


# --- the body -------------------------------------------------------------------------------------


def areas_of(surface):
    """Area vectors of the facets."""
    corners = surface.points[surface.perimeters]
    one, other = (2, 3) if surface.perimeters.shape[1] == 4 else (1, 2)
    start = 1 if surface.perimeters.shape[1] == 4 else 0
    return np.cross(corners[:, one] - corners[:, 0], corners[:, other] - corners[:, start]) / 2


@pytest.mark.mpi
@pytest.mark.parametrize("cells", ["hexahedra", "tetrahedra"])
def test_outer_surface(cells):
    """It is closed, has the area and the volume of the body, and is the same on any number of
    ranks.
    """
    comm = MPI.COMM_WORLD
    together = gather.gather_body(solve(block(6, cells, bound=1.5, comm=comm)), ["von_mises"])
    assert (
        comm.rank == 0 or len(together.perimeters) == len(together.points) == 0
    )  # the other ranks do not hold it
    together = comm.bcast(together)
    solution = alone(block(6, cells, bound=1.5))
    single = gather.gather_body(solution, ["von_mises"])
    assert len(single.perimeters) == len(together.perimeters)
    for surface in (together, single):
        areas = areas_of(surface)
        assert_allclose(areas.sum(axis=0), 0.0, atol=1e-12)
        assert np.linalg.norm(areas, axis=1).sum() == pytest.approx(14.0)
        middle = surface.points[surface.perimeters].mean(axis=1)
        assert np.einsum("ij,ij->", middle, areas) / 3 == pytest.approx(3.0)
    scale, top = np.abs(single.displacement).max(), single.values["von_mises"].max()
    rows = [
        np.hstack(
            (
                s.points[s.perimeters].mean(axis=1),
                s.displacement[s.perimeters].mean(axis=1) / scale,
                s.values["von_mises"].mean(axis=1, keepdims=True) / top,
            )
        )
        for s in (together, single)
    ]
    ours, theirs = (row[np.lexsort(np.round(row[:, :3], 6).T)] for row in rows)
    assert_allclose(ours, theirs, atol=1e-9)


@pytest.mark.slow
@pytest.mark.mpi
def test_pictures_on_ranks(tmp_path):
    """The same picture of the contact surface on one rank and on all."""
    needs_pictures_in_3d()
    comm = MPI.COMM_WORLD
    folder = comm.bcast(str(tmp_path))
    write_results(solve(block(6, coefficient=0.3, comm=comm)), f"{folder}/all", fields=False)
    if comm.rank == 0:
        write_results(alone(block(6, coefficient=0.3)), tmp_path / "one", fields=False)
        for name in ("contact_surface.png", "deformed.png"):
            ours, theirs = (
                np.asarray(Image.open(tmp_path / kind / name).convert("L"), dtype=int)
                for kind in ("all", "one")
            )
            assert ours.shape == theirs.shape
            assert np.mean(np.abs(ours - theirs) > 8) < 0.005


@pytest.mark.slow
@pytest.mark.mpi(slow=True)
def test_too_many_facets(tmp_path, monkeypatch, capsys):
    """The body is left out with a line that says why and where to look, the rest is drawn; on any
    number of ranks.
    """
    comm = MPI.COMM_WORLD
    folder = comm.bcast(str(tmp_path / "out"))
    monkeypatch.setattr(gather, "MOST_FACETS", 50)
    solution = solve(block(6, bound=1.5, comm=comm))
    write_results(solution, folder, fields=False)
    comm.Barrier()
    if comm.rank == 0:
        said = capsys.readouterr().out
        assert "the deformed body is not drawn: its surface has 56 facets, more than 50" in said
        assert not (tmp_path / "out" / "deformed.png").exists()
        assert (tmp_path / "out" / "contact_surface.png").exists()
        page.write_report(folder)
        assert "too many facets" in (tmp_path / "out" / page.PAGE).read_text(encoding="utf-8")


# --- the page -------------------------------------------------------------------------------------


@pytest.mark.slow
def test_plane_scenes_import_nothing_of_it(tmp_path):
    """Neither solve nor report of a plane scene imports what draws in 3D."""
    code = """
import sys
from scenes import alone, example1
from signorini_fx.results.files import write_results
from signorini_fx.addons.report.page import write_report
write_results(alone(example1(nx=6, ny=2)), sys.argv[1], fields=False)
write_report(sys.argv[1])
print([name for name in sys.modules if name.startswith("signorini_fx.")])
"""
    run = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "out")],
        check=True,
        capture_output=True,
        text=True,
        cwd="tests/support",
    )
    assert "signorini_fx.addons.pictures.boundary_profiles" in run.stdout
    for name in (
        "pictures.contact",
        "pictures.solid",
        "in_space",
        "pictures.view",
        "outer_surface",
        "results.surface'",
    ):
        assert name not in run.stdout


@pytest.mark.slow
def test_page_needs_no_dolfinx(folders, tmp_path):
    """The report of a body in 3D imports neither dolfinx nor MPI."""
    code = """
import sys
from signorini_fx.addons.report.page import write_report
write_report(sys.argv[1], sys.argv[2])
print([name for name in sys.modules if name in ("dolfinx", "mpi4py", "petsc4py", "ufl")])
"""
    arguments = [str(folders["coulomb"]), str(tmp_path / "page.html")]
    run = subprocess.run(
        [sys.executable, "-c", code, *arguments], check=True, capture_output=True, text=True
    )
    assert run.stdout.strip() == "[]"
    assert summary_in(folders["coulomb"])["dimension"] == 3
