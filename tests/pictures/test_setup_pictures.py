"""Pictures of a scene before it is solved: what acts where, on any number of ranks."""

import numpy as np
import pytest
from matplotlib.quiver import Quiver
from mpi4py import MPI
from numpy.testing import assert_allclose, assert_array_equal
from scene_tables import box_mesh, fixed
from scenes import example1

from signorini_fx.addons.pictures import setup as setup_pictures
from signorini_fx.addons.pictures.of_setup import gather_setup
from signorini_fx.scenes import cli
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.tuned import LONGEST_ARROW_OF_SETUP

COMM = MPI.COMM_WORLD
BOX = {
    "mesh": box_mesh(3, 2, 2, cell="hexahedron"),
    "material": {"young": 1.0, "poisson": 0.3},
    "traction": [{"boundary": "top", "pressure": 2.0, "x": "x[1]"}, fixed("right", "x")],
    "displacement": [
        fixed("left", "xyz"),
        {"boundary": "back", "normal": 0.0},
        {"boundary": "front", "y": 0.5},
    ],
    "springs": [{"boundary": "right", "normal": 3.0}],
    "contact": [{"boundary": "bottom"}],
}


def areas(corners):
    """Of straight segments, or of plane facets."""
    if corners.shape[2] == 2:
        return np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1)
    around = corners - corners.mean(axis=1, keepdims=True)
    return np.linalg.norm(np.cross(around, np.roll(around, -1, axis=1)).sum(axis=1) / 2, axis=1)


@pytest.mark.mpi
def test_in_the_plane():
    """Forces, normals and supports of Example 1; what is nought does not act."""
    scene = parse_scene(example1(bound=1.5))
    setup = gather_setup(load_mesh(scene, COMM), scene.statement, "Example 1")
    if COMM.rank > 0:
        assert not len(setup.polygons)
        return
    assert areas_of_cells(setup.polygons) == pytest.approx(3.0)
    by_name = {one.name: one for one in setup.boundaries}
    assert {name: one.kinds for name, one in by_name.items()} == {
        "left": ("displacement",),
        "right": ("displacement",),
        "top": ("traction",),
        "bottom": ("contact",),
    }
    assert by_name["left"].held == ("x",)
    assert not by_name["left"].moved.any()
    top = by_name["top"]
    assert_allclose(top.normals, np.broadcast_to([0, 1], top.normals.shape), atol=1e-15)
    assert_allclose(areas(top.corners) @ top.load, [0, -20], atol=1e-12)


def areas_of_cells(polygons):
    """The area of polygons of the plane, whose corners are in order."""
    x, y = np.moveaxis(polygons, 2, 0)
    return np.abs((x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1) / 2).sum()


@pytest.mark.mpi
def test_in_space():
    """Loads of several entries add up; the surface is seen from outside."""
    scene = parse_scene(BOX)
    setup = gather_setup(load_mesh(scene, COMM), scene.statement)
    if COMM.rank > 0:
        return
    by_name = {one.name: one for one in setup.boundaries}
    assert by_name["right"].kinds == ("springs",)
    assert by_name["left"].held == ("x", "y", "z")
    assert by_name["back"].held == ("normal",)
    assert_array_equal(
        by_name["front"].moved, np.broadcast_to([0, 0.5, 0], by_name["front"].moved.shape)
    )
    top = by_name["top"]
    assert_allclose(
        top.load, np.column_stack((top.middles[:, 1], 0 * top.load[:, 0], 0 * top.load[:, 0] - 2))
    )
    low, high = setup.polygons.min(axis=(0, 1)), setup.polygons.max(axis=(0, 1))
    # The volume by the divergence theorem: counterclockwise from outside.
    around = setup.polygons - setup.polygons.mean(axis=1, keepdims=True)
    moments = np.cross(around, np.roll(around, -1, axis=1)).sum(axis=1) / 2
    volume = np.einsum("ij,ij->", moments, setup.polygons.mean(axis=1)) / 3
    assert volume == pytest.approx(np.prod(high - low))


def test_what_acts_on_no_boundary_and_pairs(monkeypatch):
    """Gravity from the middle of the body, a point force and both sides of a preload at their
    points; the sides of a pair name each other and have one colour.
    """
    drawn = []
    monkeypatch.setattr(setup_pictures, "finish", lambda figure, *_: drawn.append(figure))
    blocks = [
        {"name": name, "mesh": {"generator": "rectangle"}, "shift": [0.0, shift]}
        for name, shift in (("low", 0.0), ("high", 1.0))
    ]
    scene = parse_scene(
        {
            "body": blocks,
            "material": {"young": 1.0, "poisson": 0.3, "density": 1.0},
            "displacement": fixed("low.bottom"),
            "contact": {"boundary": "high.bottom", "against": "low.top"},
            "gravity": {"y": -9.0},
            "point_force": {"at": [0.0, 2.0], "x": 3.0},
            "preload": {"point": [0.5, 1.5], "axis": [1.0, 0.0], "region": "high", "force": 1.0},
        }
    )
    setup = gather_setup(load_mesh(scene, MPI.COMM_SELF), scene.statement)
    told = [(name, None if at is None else [*at], [*along]) for name, at, along in setup.arrows]
    assert sorted(told, key=str) == [
        ("gravity", None, [0.0, -9.0]),
        ("point force", [0.0, 2.0], [3.0, 0.0]),
        ("preload", [0.5, 1.5], [-1.0, 0.0]),
        ("preload", [0.5, 1.5], [1.0, 0.0]),
    ]
    setup.draw("nowhere")
    texts = [text.get_text() for text in drawn[0].axes[0].texts]
    assert sorted(text for text in texts if text) == [
        "gravity",
        "point force",
        "preload",
        "preload",
    ]
    (legend,) = drawn[0].legends
    colours = {
        text.get_text(): line.get_color()
        for text, line in zip(legend.get_texts(), legend.legend_handles, strict=True)
    }
    pair = ["high.bottom: contact with low.top", "low.top: contact with high.bottom"]
    assert colours[pair[0]] == colours[pair[1]]


@pytest.mark.slow
@pytest.mark.parametrize("suffix", ["png", "pdf", "svg"])
def test_commands(tmp_path, capsys, suffix):
    """``check`` and ``mesh-info`` draw, and their text is what it is without a picture."""
    body = tmp_path / "body.geo"
    body.write_text(
        "Point(1) = {0,0,0}; Point(2) = {2,0,0}; Point(3) = {0,1,0}; Line(1) = {1,2}; Line(2) = "
        "{2,3}; Line(3) = {3,1};"
        'Curve Loop(1) = {1:3}; Plane Surface(1) = {1}; Physical Curve("$foot") = {1}; Physical '
        'Curve("back") = {3};'
    )
    scene = tmp_path / "scene.toml"
    scene.write_text(
        'title = "costs $5"\n[mesh]\nfile = "body.geo"\n[material]\nyoung = 1.0\npoisson = 0.3\n'
        '[[displacement]]\nboundary = "back"\nx = 0.0\ny = 0.0\n[[contact]]\nboundary = "$foot"\n'
        '[units]\nlength = "mm"\n'
    )
    for command in (["check", str(scene)], ["mesh-info", str(body)]):
        picture = tmp_path / f"{command[0]}.{suffix}"
        assert cli.main(command) == 0
        text = capsys.readouterr().out
        assert cli.main([*command, "--picture", str(picture)]) == 0
        assert capsys.readouterr().out == text
        assert picture.stat().st_size > 5000
    if suffix == "svg":
        drawn = (tmp_path / "check.svg").read_text()
        assert all(
            f"<!-- {name} -->" in drawn
            for name in ("$foot: contact", "back: displacement (x, y)", "x (mm)")
        )
    assert cli.main([*command, "--picture", str(tmp_path / "mesh.bmp")]) == 2
    assert "mesh.bmp: a picture is .png, .pdf or .svg" in capsys.readouterr().err
    assert cli.main([*command, "--picture", str(tmp_path / "body.geo" / "mesh.png")]) == 2
    assert "cannot be written" in capsys.readouterr().err


def test_the_legend_says_what_acts(monkeypatch):
    """Each boundary has its name, its colour and what acts on it; a support with all components has
    a square.
    """
    drawn = []
    monkeypatch.setattr(setup_pictures, "finish", lambda figure, *_: drawn.append(figure))
    scene = parse_scene(
        BOX
        | {
            "mesh": {"generator": "rectangle"},
            "displacement": [fixed("left"), {"boundary": "right", "normal": 0.0}],
            "springs": [],
            "traction": [{"boundary": "top", "pressure": 2.0}],
        }
    )
    gather_setup(load_mesh(scene, MPI.COMM_SELF), scene.statement).draw("nowhere")
    (legend,) = drawn[0].legends
    texts = [text.get_text() for text in legend.get_texts()]
    assert texts == [
        "left: displacement (x, y)",
        "right: displacement (normal)",
        "bottom: contact",
        "top: traction",
        "longest arrow of a load: 2",
    ]
    lines = dict(zip(texts, legend.legend_handles, strict=True))
    assert len({line.get_color() for line in lines.values() if line.get_linestyle() != "None"}) == 4
    assert lines[texts[0]].get_marker() == "s"
    assert lines[texts[1]].get_marker() == "o"
    (arrows,) = (one for one in drawn[0].axes[0].collections if isinstance(one, Quiver) and one.N)
    assert_allclose(arrows.V, -LONGEST_ARROW_OF_SETUP * 3.0)
    assert_allclose(np.asarray(arrows.get_offsets())[:, 1] + arrows.V, 1.0)  # they end at the body
