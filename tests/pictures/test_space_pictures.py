"""Pictures and page of a body in 3D: they say what the files say, on any number of ranks; no plane scene pays."""

import io
import json
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from drawing import needs_pictures_in_3d
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.quiver import Quiver
from matplotlib.text import Text
from mpi4py import MPI
from PIL import Image
from scenes import alone
from scipy.spatial import cKDTree
from spaces import block, box, friction_of
from test_report import Page, pictures, summary_of

from signorini_fx.addons.pictures import contact_surface, gather, load_steps, results, view
from signorini_fx.addons.pictures import solid as drawing
from signorini_fx.addons.pictures.body import DrawnBody, tiling
from signorini_fx.addons.pictures.boundary_profiles import STATES
from signorini_fx.addons.pictures.foundation import plane_of
from signorini_fx.addons.pictures.solid import solid_figure
from signorini_fx.addons.pictures.style import VALUES, lay_out
from signorini_fx.addons.report import page
from signorini_fx.machine.result_files import read_csv, read_facets
from signorini_fx.quantities import digits
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
            "displacement": [{"boundary": "bottom", "x": 0.0, "y": 0.0, "z": 0.0}],
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


def drawn(folder):
    """Sides and figure of the contact surface from the files."""
    table, facets = read_csv(folder / "contact.csv"), read_facets(folder / "contact.vtu")
    return contact_surface.sides_of(table, facets), contact_surface.contact_figure(table, facets)


def panels(figure):
    """The axes that are no colour bars, in order."""
    return [axes for axes in figure.axes if axes.get_label() != "<colorbar>"]


@pytest.mark.slow
def test_files(folder):
    """All are there, of a size to look at, none is blank, and none of those of a plane scene."""
    needs_pictures_in_3d()
    assert not (folder / "profiles.png").exists()
    for name in ("deformed", "section", "contact_surface", "history"):
        if folder.name == "coulomb":
            assert (folder / f"{name}.pdf").stat().st_size > 5000
        with Image.open(folder / f"{name}.png") as image:
            assert 400 < image.width < 1600
            assert 300 < image.height < 3000
            assert np.asarray(image.convert("L")).std() > 10


@pytest.mark.slow
def test_nothing_is_cut_off(folder):
    """Titles, labels and legends are within the picture, also without a title above it."""
    _, figure = drawn(folder)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    renderer = canvas.get_renderer()
    inside = figure.bbox.padded(1.0)
    for piece in (*figure.axes, *figure.legends):
        box = piece.get_tightbbox(renderer)
        assert inside.x0 <= box.x0 < box.x1 <= inside.x1
        assert inside.y0 <= box.y0 < box.y1 <= inside.y1


@pytest.mark.slow
def test_pressure_is_that_of_the_table(folder):
    """Colours are the pressures of contact.csv at its nodes, in the plane of the picture; the scale reaches the top."""
    sides, figure = drawn(folder)
    pressed = [axes for axes in panels(figure) if "seen along" in axes.get_title(loc="left")]
    assert len(pressed) == len(sides)
    for side, axes in zip(sides, pressed, strict=True):
        (mesh,) = [c for c in axes.collections if type(c).__name__ == "TriMesh"]
        pressure = side.floats("pressure")
        np.testing.assert_array_equal(mesh.get_array()[: len(pressure)], pressure)
        points = np.column_stack((mesh._triangulation.x, mesh._triangulation.y))
        for direction, along in ((side.view.right, 0), (side.view.up, 1)):
            expected = np.column_stack([side.floats(axis) for axis in "xyz"]) @ direction
            np.testing.assert_allclose(points[: len(pressure), along], expected, atol=1e-12)
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
    """Each node has the colour of its state on its own part of the area; arrows are the slip times what is said."""
    (side,), figure = drawn(folders["coulomb"])
    _, right = panels(figure)
    regions = next(c for c in right.collections if isinstance(c, PolyCollection))
    where, owner = contact_surface._around_nodes(side.nodes, side.polygons)
    expected = [to_rgba(STATES[str(state)][0]) for state in side.columns["state"][owner]]
    np.testing.assert_allclose(regions.get_facecolor(), expected)
    x, y = where[..., 0], where[..., 1]
    pieces = np.abs((x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1)) / 2
    np.testing.assert_allclose(np.bincount(owner, pieces), side.floats("weight"))
    assert np.abs(where - side.nodes[owner][:, None]).max() == pytest.approx(0.125)  # half of a facet
    (arrows,) = [c for c in right.collections if isinstance(c, Quiver)]
    factor = float(re.search(r"slip \$\\times\\,(\d+)\$", right.get_title(loc="left")).group(1))
    slips = np.flatnonzero(side.columns["friction"] == "slip")
    at = {tuple(np.round(side.nodes[row], 9)): row for row in slips}
    rows = [at[tuple(np.round(place, 9))] for place in arrows.get_offsets()]
    assert len(rows) == len(slips)  # few enough to show all
    for component, axis in ((arrows.U, "x"), (arrows.V, "y")):
        np.testing.assert_allclose(component, factor * side.floats(f"slip_{axis}")[rows], rtol=1e-9, atol=1e-15)
    legend = {text.get_text() for text in figure.legends[0].get_texts()}
    assert legend == {"open", "slip", "stick"} & {str(s) for s in side.columns["state"]}


@pytest.mark.slow
def test_shear_arrows(folders):
    """They are along the shear of the table, and the longest one has the size that the title says."""
    (side,), figure = drawn(folders["coulomb"])
    left, _ = panels(figure)
    (arrows,) = [c for c in left.collections if isinstance(c, Quiver)]
    assert f"the longest ${side.floats('shear').max():.3g}$" in left.get_title(loc="left")
    at = {tuple(np.round(place, 9)): row for row, place in enumerate(side.nodes)}
    rows = [at[tuple(np.round(place, 9))] for place in arrows.get_offsets()]
    shear = np.column_stack((side.floats("shear_x"), side.floats("shear_y")))[rows]
    drawn_vectors = np.column_stack((arrows.U, arrows.V))
    scale = np.linalg.norm(drawn_vectors, axis=1).max() / np.linalg.norm(shear, axis=1).max()
    np.testing.assert_allclose(drawn_vectors, scale * shear, atol=1e-12)


@pytest.mark.slow
def test_axes_are_those_of_space(folders):
    """Labels name the coordinates, equal lengths are equal, and numbers are those of the coordinates."""
    sides, figure = drawn(folders["walls"])
    assert [side.name for side in sides] == ["left", "right"]
    left, state, right = panels(figure)
    assert left.get_title(loc="left").startswith("left, seen along $-x$")
    assert right.get_title(loc="left").startswith("right, seen along $x$")
    for axes in (left, right, state):
        assert (axes.get_xlabel(), axes.get_ylabel()) == ("$y$", "$z$")
        assert axes.get_aspect() == 1
    # Seen along x with z upwards, y grows to the left.
    assert right.xaxis.get_major_formatter()(-0.5, 0) == "0.5"
    assert left.xaxis.get_major_formatter().__class__.__name__ == "ScalarFormatter"
    assert "arrows: shear" in left.get_title(loc="left")
    assert "arrows" not in right.get_title(loc="left")


@pytest.mark.parametrize("direction", [(0, 0, -1), (0, 0, 1), (1, 0, 0), (0, -1, 0), (1, 2, -2), (0.02, 0.01, -1)])
def test_views(direction):
    """Right-handed, against the direction; close to an axis it is the axis; the label measures what it says."""
    seen = view.along(np.array(direction, dtype=float))
    frame = np.array([seen.right, seen.up, seen.toward])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(frame) == pytest.approx(1)
    assert -seen.toward @ direction >= 0.99 * np.linalg.norm(direction)
    if np.count_nonzero(np.abs(direction) > 0.1) == 1:
        assert np.abs(seen.toward).max() == 1
    label, falls = view.coordinate(seen.right)
    assert not falls or seen.right.min() == -1
    assert set("xyz") & set(label)
    assert label[1] != "-" or np.abs(seen.right).max() < 1
    assert view.combination(np.array([0.6, 0.0, -0.8])) == r"0.60\,x-0.80\,z"
    assert view.combination(np.array([0.0, -1.0, 0.0])) == "-y"


def wall(touching):
    """Table and facets of the wall of a hole around the axis z, its nodes in contact where the function says."""
    angle, height = np.meshgrid(2 * np.pi * np.arange(24) / 24, (0.0, 0.5, 1.0), indexing="ij")
    angle, height = angle.ravel(), height.ravel()
    row = np.arange(72).reshape(24, 3)
    ahead = np.roll(row, -1, axis=0)
    facets = np.stack((row[:, :-1], ahead[:, :-1], ahead[:, 1:], row[:, 1:]), axis=-1).reshape(-1, 4)
    closed = touching(angle)
    zero = np.zeros(72)
    table = {"x": np.cos(angle), "y": np.sin(angle), "z": height, "gap": zero, "pressure": np.where(closed, 1.0, 0.0)}
    table |= {"n_x": -np.cos(angle), "n_y": -np.sin(angle), "n_z": zero, "bound": zero, "weight": zero + 1 / 72}
    table |= {f"{name}{axis}": zero for name in ("shear", "slip") for axis in ("", "_x", "_y", "_z")}
    state = np.where(closed, "stick", "open")
    return table | {"state": state, "friction": np.full(72, "none"), "boundary": np.full(72, "hole")}, facets


def test_bent_boundaries():
    """The wall of a hole is seen where it touches, and from two sides where both touch; a part is shown as such."""
    table, facets = wall(lambda angle: np.cos(angle) > 0.8)
    (side,) = contact_surface.sides_of(table, facets)
    np.testing.assert_array_equal(-side.view.toward, [-1, 0, 0])
    assert set(side.polygons.ravel()) >= set(np.flatnonzero(side.touching))
    assert side.floats("x")[side.polygons].mean(axis=1).min() > -1e-9
    both = contact_surface.sides_of(*wall(lambda angle: np.abs(np.cos(angle)) > 0.8))
    assert len(both) == 2
    np.testing.assert_array_equal(both[0].view.toward, -both[1].view.toward)
    assert sum(len(side.polygons) for side in both) == len(facets)
    (nothing,) = panels(contact_surface.contact_figure(*wall(lambda angle: angle < -1)))
    assert "nothing in contact" in nothing.get_title(loc="left")


@pytest.mark.slow
def test_small_zones_are_enlarged(folders):
    """The window is about what touches where that is little, and the title says so."""
    table, facets = read_csv(folders["coulomb"] / "contact.csv"), read_facets(folders["coulomb"] / "contact.vtu")
    few = np.hypot(table["x"] - 1.5, table["y"] - 0.5) < 0.1
    table |= {"state": np.where(few, table["state"], "open"), "pressure": np.where(few, table["pressure"], 0.0)}
    left = panels(contact_surface.contact_figure(table, facets))[0]
    assert "the part in contact" in left.get_title(loc="left")
    low, high = left.get_xlim()
    assert 0 < low < table["x"][few].min()
    assert table["x"][few].max() < high < 3


# --- the body --------------------------------------------------------------------------------------------------------


def areas_of(surface):
    """Area vectors of the facets."""
    corners = surface.points[surface.perimeters]
    one, other = (2, 3) if surface.perimeters.shape[1] == 4 else (1, 2)
    start = 1 if surface.perimeters.shape[1] == 4 else 0
    return np.cross(corners[:, one] - corners[:, 0], corners[:, other] - corners[:, start]) / 2


@pytest.mark.mpi
@pytest.mark.parametrize("cells", ["hexahedra", "tetrahedra"])
def test_outer_surface(cells):
    """It is closed, has the area and the volume of the body, and is the same on any number of ranks."""
    comm = MPI.COMM_WORLD
    together = gather.gather_outer_surface(solve(block(6, cells, bound=1.5, comm=comm)), ["von_mises"])
    assert comm.rank == 0 or len(together.perimeters) == len(together.points) == 0  # the other ranks do not hold it
    together = comm.bcast(together)
    solution = alone(block(6, cells, bound=1.5))
    single = gather.gather_outer_surface(solution, ["von_mises"])
    assert gather.outer_facets(solution) == len(single.perimeters) == len(together.perimeters)
    for surface in (together, single):
        areas = areas_of(surface)
        np.testing.assert_allclose(areas.sum(axis=0), 0.0, atol=1e-12)
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
    np.testing.assert_allclose(ours, theirs, atol=1e-9)


@pytest.mark.mpi
@pytest.mark.parametrize("cells", ["hexahedra", "tetrahedra"])
def test_volume(cells):
    """The cells of all ranks fill the body, points shared, with the recovered stress of the surface where that is."""
    comm = MPI.COMM_WORLD
    solution = solve(block(3, cells, bound=1.5, comm=comm))
    found = gather.gather_volume(solution)
    surface = gather.gather_outer_surface(solution, ("von_mises",))
    if comm.rank:
        assert len(found.cells) == 0
        return
    assert len(found.points) == 16  # 4 x 2 x 2
    corners = found.points[found.cells]
    sides = corners[:, [1, 3 if cells == "hexahedra" else 2, 4 if cells == "hexahedra" else 3]] - corners[:, :1]
    parts = 1 if cells == "hexahedra" else 6
    assert np.abs(np.linalg.det(sides)).sum() / parts == pytest.approx(3.0)
    away, at = cKDTree(found.points).query(surface.points[surface.within[:, surface.tiles.vertices]])
    assert away.max() < 1e-9
    values = surface.values["von_mises"][:, surface.tiles.vertices]
    np.testing.assert_allclose(values, found.values[at], rtol=1e-6)
    near = cKDTree(surface.points).query(found.points)[1]
    np.testing.assert_allclose(found.displacement, surface.displacement[near], atol=1e-12)


def test_the_body_is_drawn_with_its_stress(monkeypatch):
    """Each triangle with the values at its corners, where the displacement has moved it; a label says which stress."""
    kept = []
    blank = np.full((4, 4, 3), 255, dtype=np.uint8)
    monkeypatch.setattr(drawing, "image", lambda *request: kept.append(request) or blank)
    surface = gather.gather_outer_surface(alone(block(3)), ["von_mises"])
    figure, remark = solid_figure(surface, "von_mises", view.oblique())
    assert figure.axes[1].get_xlabel() == "von Mises stress, recovered"
    factor = surface.factor
    assert factor > 1
    assert remark == rf"displacement $\times\,{factor:g}$"
    ((solid, _, width),) = kept
    np.testing.assert_allclose(solid.points, surface.points + factor * surface.displacement)
    nodal = np.zeros(len(surface.points))
    nodal[surface.within] = surface.values["von_mises"]
    np.testing.assert_allclose(solid.values, nodal[solid.triangles])
    assert width > 500
    assert len(solid.edges) == len(view.outline(surface.points, surface.perimeters)) + 2 * len(surface.perimeters)


def test_flat_foundations_only():
    """A plane around the points, its normal theirs; no plane through points of a bowl, nor through too few."""
    rng = np.random.default_rng(5)
    points = np.column_stack((rng.random((40, 2)), np.zeros(40)))
    turn = np.linalg.qr(rng.random((3, 3)))[0]
    for frame in (np.eye(3), turn):
        corners = plane_of(points @ frame)
        (normal,) = view.normals_of(corners, np.arange(4)[None])
        normal /= np.linalg.norm(normal)
        assert abs(normal @ frame[2]) == pytest.approx(1)
        np.testing.assert_allclose((corners - (points @ frame)[0]) @ normal, 0.0, atol=1e-12)
    assert plane_of(points + [0, 0, 0.1] * (points**2).sum(axis=1)[:, None]) is None
    assert plane_of(points[:2]) is None


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
                np.asarray(Image.open(tmp_path / kind / name).convert("L"), dtype=int) for kind in ("all", "one")
            )
            assert ours.shape == theirs.shape
            assert np.mean(np.abs(ours - theirs) > 8) < 0.005


@pytest.mark.slow
@pytest.mark.mpi(slow=True)
def test_too_many_facets(tmp_path, monkeypatch, capsys):
    """The body is left out with a line that says why and where to look, the rest is drawn; on any number of ranks."""
    comm = MPI.COMM_WORLD
    folder = comm.bcast(str(tmp_path / "out"))
    monkeypatch.setattr(results, "MOST_FACETS", 50)
    solution = solve(block(6, bound=1.5, comm=comm))
    write_results(solution, folder, fields=False)
    comm.Barrier()
    if comm.rank == 0:
        said = capsys.readouterr().out
        assert "the deformed body is not drawn: its surface has 56 facets, more than 50" in said
        assert not (tmp_path / "out" / "deformed.png").exists()
        assert (tmp_path / "out" / "contact_surface.png").exists()
        page.write_report(folder)
        assert "too many facets" in Page(tmp_path / "out").text


# --- the page --------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_page(folder):
    """Well-formed, whole in itself, with the sections of space and none of the plane, and the numbers of the files."""
    needs_pictures_in_3d()
    found, summary = Page(folder), summary_of(folder)
    headings = found.of("h2")
    assert headings[:5] == ["Outcome", "Figures", "Further pictures", "Contact", "Forces"]
    for wrong in ("unit thickness", "--levels", "slip minus", "plane strain", "arc length"):
        assert wrong not in found.source
    files = ["deformed", "section", "contact_surface", "history", *["load_steps"] * ("steps" in summary)]
    assert len(pictures(found)) == len(files)
    cells = found.of("td")
    start = cells.index("stick") - 1
    expected = [summary["areas"][name] for name in ("contact", "stick", "slip")]
    np.testing.assert_allclose([float(area) for area in cells[start : start + 6 : 2]], expected, rtol=5e-4, atol=1e-12)
    for row in summary["contact_boundaries"]:
        assert digits.figure(row["contact_force"]) in cells


@pytest.mark.slow
def test_curves_of_the_load_steps(folders, monkeypatch):
    """Three components, those that are nought left out; friction against the motion along it."""
    steps = read_csv(folders["steps"] / "steps.csv")
    seen = []
    monkeypatch.setattr(load_steps, "finish", lambda figure, *_: seen.append(figure))
    load_steps.load_steps("unused", steps)
    (figure,) = seen
    upper, lower = figure.axes
    lines = {line.get_label(): line.get_ydata() for line in upper.lines}
    np.testing.assert_array_equal(lines["contact force z"], steps["contact_force_z"])
    np.testing.assert_array_equal(lines["friction force y"], steps["friction_force_y"])
    assert "contact force x" not in lines
    assert upper.get_ylabel() == "force"
    assert lower.get_ylabel() == "friction force y"
    assert lower.get_xlabel().startswith("mean tangential displacement y")
    ratio = lower.lines[0].get_xdata() / steps["mean_tangential_displacement_y"]
    np.testing.assert_allclose(ratio, 10.0 ** round(np.log10(ratio[0])))
    figure.draw_without_rendering()
    for axes in figure.axes:  # no name is longer than the picture is high
        assert Text.get_window_extent(axes.yaxis.label).y0 >= 0


@pytest.mark.slow
def test_what_is_not_there(tmp_path, folders):
    """Without pictures the page says so; a body that slides and one without contact have a page as well."""
    needs_pictures_in_3d()
    folder = tmp_path / "plain"
    write_results(alone(between_walls()), folder, fields=False, pictures=False)
    assert not list(folder.glob("*.p[nd][gf]"))
    page.write_report(folder)
    assert "--no-pictures" in Page(folder).text
    pushed = block(6, coefficient=0.1).model_copy(update={"displacement": ()})
    write_results(alone(pushed, check=False), tmp_path / "slides", fields=False)
    page.write_report(tmp_path / "slides")
    assert summary_of(tmp_path / "slides")["converged"] is False
    assert "What to do" in Page(tmp_path / "slides").text
    write_results(alone(linear()), tmp_path / "linear", fields=False)
    page.write_report(tmp_path / "linear")
    found = Page(tmp_path / "linear")
    assert len(pictures(found)) == 1
    assert "Contact" not in found.of("h2")


def linear():
    """A body in 3D without contact."""
    data = block(6)
    held = [entry.model_copy(update={"z": 0.0}) for entry in data.displacement]
    return data.model_copy(update={"displacement": tuple(held), "contact": ()})


@pytest.mark.slow
def test_pictures_of_what_failed(folders):
    """Numbers that are none do not keep the rest from being drawn."""
    needs_pictures_in_3d()
    table, facets = read_csv(folders["coulomb"] / "contact.csv"), read_facets(folders["coulomb"] / "contact.vtu")
    for name in ("pressure", "shear", "shear_x", "slip_x"):
        table[name] = table[name].copy()
        table[name][::3] = np.nan
    contact_surface.contact_figure(table, facets).savefig(io.BytesIO())
    surface = gather.gather_outer_surface(alone(block(6)), ["von_mises"])
    nothing = {"von_mises": np.full(surface.within.shape, np.nan)}
    nowhere = replace(surface, displacement=np.full_like(surface.displacement, np.nan), values=nothing)
    figure, remark = solid_figure(nowhere, "von_mises", view.oblique())
    figure.savefig(io.BytesIO())
    assert remark == r"displacement $\times\,1$"
    assert isinstance(figure, Figure)


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
    run = subprocess.run([sys.executable, "-c", code, *arguments], check=True, capture_output=True, text=True)
    assert run.stdout.strip() == "[]"
    assert json.loads((folders["coulomb"] / "summary.json").read_text())["dimension"] == 3


@pytest.mark.parametrize("height", [0.5, 12.0])
def test_lengths_are_within_the_picture(height):
    """Arrows and labels of a round body, which is far from the corners of its box, are not cut off, flat or tall."""
    needs_pictures_in_3d()
    angle = np.linspace(0.0, 2 * np.pi, 24, endpoint=False)
    rim = np.column_stack((2 * np.cos(angle), 2 * np.sin(angle), np.zeros(24)))
    points = np.concatenate((rim, rim + np.array([0.0, 0.0, height]), [[0.0, 0.0, height]]))
    ahead = (np.arange(24) + 1) % 24
    top = np.column_stack((np.arange(24) + 24, ahead + 24, np.full(24, 48)))
    side = np.column_stack((np.arange(24), ahead, ahead + 24))
    triangles = np.concatenate((top, side))
    values = {"von_mises": np.ones(triangles.shape)}
    body = DrawnBody(points, triangles, tiling(3, 1), np.zeros_like(points), values, recovered=True)
    figure, _ = solid_figure(body, "von_mises", view.oblique())
    lay_out(figure)
    figure.draw_without_rendering()  # which gives equal axes their place
    renderer = figure.canvas.get_renderer()
    for entry in figure.axes[0].texts:
        if entry.get_text() or entry.arrow_patch is not None:
            box = entry.get_window_extent(renderer)
            assert box.x0 >= 0
            assert box.y0 >= 0
            assert (np.array([box.x1, box.y1]) <= figure.get_size_inches() * figure.dpi).all()
