"""Fields on the deformed body: their values, their colours, strokes along principal stresses, and curved cells."""

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from mpi4py import MPI
from scenes import alone, example1
from spaces import block

from signorini_fx import cli
from signorini_fx.report.fields import FIELDS, ON_DEMAND, Field, principal, values_of
from signorini_fx.report.style import BLUE, ORANGE
from signorini_fx.report.tones import Tones, draw_principal, thinned
from signorini_fx.results.body_cells import gather_cells
from signorini_fx.results.files import write_results
from signorini_fx.results.outer_surface import gather_outer_surface
from signorini_fx.results.stresses import Stresses
from signorini_fx.scene.reading import parse_scene
from signorini_fx.solving.solver import solve

SHEAR = np.array([[[0.0, 2.0, 0.0], [2.0, 0.0, 0.0], [0.0, 0.0, -3.0]]])


def test_values_from_the_stress():
    """Trace and principal stresses of simple shear with a pressure along x_3: -3, -2, 2."""
    stresses, directions = principal(SHEAR)
    np.testing.assert_allclose(stresses, [[-3.0, -2.0, 2.0]], atol=1e-14)
    np.testing.assert_allclose(np.abs(directions[0, :, 2]), [np.sqrt(0.5), np.sqrt(0.5), 0.0], atol=1e-14)
    assert values_of("pressure", {"stress": SHEAR}) == pytest.approx([1.0])
    assert values_of("principal", {"stress": SHEAR}) == pytest.approx([3.0])
    with pytest.raises(KeyError):
        values_of("displacement", {"stress": SHEAR})
    assert np.isnan(principal(SHEAR * np.nan)[0]).all()


def strokes(stress, plane, points=((0.3, 0.2),)):
    """Ends of the coloured strokes, shape (n, 2, 2), by colour."""
    axes = Figure().add_subplot()
    draw_principal(axes, np.array(points), stress, plane, 26.0)
    lines = [one for one in axes.collections if isinstance(one, LineCollection)]
    found = {}
    for name in (BLUE, ORANGE):
        own = [one.get_segments() for one in lines if tuple(one.get_color()[0]) == to_rgba(name)]
        found[name] = np.array([segment for segments in own for segment in segments]).reshape(-1, 2, 2)
    return found


def test_strokes_point_along_the_principal_stresses():
    """Compression along (1, -1), tension along (1, 1), centred at the cell; what acts out of the plane has none."""
    found = strokes(SHEAR, np.eye(2, 3))
    for name, slope in ((BLUE, -1.0), (ORANGE, 1.0)):
        (ends,) = found[name]
        np.testing.assert_allclose(ends.mean(axis=0), [0.3, 0.2])
        along = ends[1] - ends[0]
        assert along[1] / along[0] == pytest.approx(slope)
    lengths = [np.linalg.norm(found[name][0][1] - found[name][0][0]) for name in (BLUE, ORANGE)]
    assert lengths[0] == pytest.approx(lengths[1])
    # Seen along x_1, the stress along x_3 is a stroke, and so are the projections of the others along x_2.
    seen = strokes(SHEAR, np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]))
    assert len(seen[BLUE]) == 2
    assert len(seen[ORANGE]) == 1
    assert len(strokes(0 * SHEAR, np.eye(2, 3))[BLUE]) == 0


def test_thinned():
    """One point of each square, that next to its middle."""
    points = np.array([[0.1, 0.1], [0.4, 0.6], [0.9, 0.9], [1.5, 0.5], [-0.5, 0.2]])
    assert sorted(thinned(points, 1.0)) == [1, 3, 4]


@pytest.mark.parametrize(
    ("values", "signed", "low", "high", "extend"),
    [
        ([1.0, 2.0, 4.0], False, 0.0, 4.0, "neither"),
        ([-1.0, 2.0, 4.0], True, -1.0, 4.0, "neither"),
        ([-4.0, -2.0, -1.0], True, -4.0, 0.0, "neither"),
        ([1.0, 2.0, 4.0], True, 0.0, 4.0, "neither"),
        ([1.0, 1.0, np.nan], False, 0.0, 1.0, "neither"),
        ([1.0] * 199 + [50.0], False, 0.0, 1.0, "max"),
        ([1.0] * 199 + [-50.0], True, 0.0, 1.0, "min"),
        ([0.0, 0.0], False, 0.0, 1.0, "neither"),
    ],
)
def test_scales(values, signed, low, high, extend):
    """From nought, or both signs; one cell of 200 does not take the colours from the others."""
    values = np.array(values)
    tones = Tones(Field("f", signed=signed), values, np.ones(len(values)))
    figure = Figure()
    axes = figure.add_subplot()
    bar = tones.bar(figure, axes)
    assert bar.extend == extend
    assert tones.high == high
    assert tones.low == low


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


@pytest.mark.mpi
def test_curved_cells_are_drawn_curved():
    """The outline is the boundary of the quarter disk, a closed line; its arc is a parabola through three points of the
    circle in each cell, not a chord.
    """
    comm = MPI.COMM_WORLD
    gathered = comm.bcast(gather_cells(solve(half_disk(), comm)))
    corners = gathered.points[gathered.cells]
    assert gathered.cells.shape[1] == 12
    x, y = corners[..., 0], corners[..., 1]
    area = 0.5 * np.abs((x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum())
    assert area == pytest.approx(np.pi * 64 / 4, rel=3e-3)
    ends = gathered.points[gathered.outline]
    assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum() == pytest.approx(16 + 4 * np.pi, rel=2e-3)
    radii = np.hypot(ends[..., 0], ends[..., 1] - 8.0).ravel()
    on_arc = (ends[..., 0].ravel() > 1e-6) & (ends[..., 1].ravel() < 8.0 - 1e-6)
    longest = max(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)) * 4
    assert np.abs(radii[on_arc] - 8.0).max() < 0.2 * longest**2 / (8 * 8.0)  # a fifth of the sagitta


@pytest.mark.mpi
def test_fields_are_the_same_on_any_number_of_ranks():
    """In the plane and in space, cell by cell at their places."""
    comm = MPI.COMM_WORLD
    plane, space = (lambda ranks: example1(bound=1.5, nx=12, ny=4)), (lambda ranks: block(6, bound=1.5, comm=ranks))
    for gather, scene in ((gather_cells, plane), (gather_outer_surface, space)):
        both = []
        for ranks in (comm, MPI.COMM_SELF):
            found = ranks.bcast(gather(solve(scene(ranks), ranks), ON_DEMAND))
            polygons = found.cells if gather is gather_cells else found.facets
            middle = found.points[polygons].mean(axis=1)
            values = np.column_stack([values_of(name, found.values) for name in FIELDS])
            both.append(values[np.lexsort(np.round(middle, 6).T)])
        scale = np.abs(both[1]).max(axis=0)
        np.testing.assert_allclose(both[0] / scale, both[1] / scale, atol=1e-8)
        # -tr/3 and the deviator make up the von Mises stress of the tensor.
        stress = found.values["stress"]
        deviator = stress - np.trace(stress, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3)
        mises = np.sqrt(1.5 * (deviator**2).sum(axis=(1, 2)))
        np.testing.assert_allclose(mises, found.values["von_mises"], rtol=1e-8, atol=1e-10 * mises.max())


@pytest.mark.parametrize("scene", [lambda: example1(nx=6, ny=2), lambda: block(4)], ids=["plane", "space"])
def test_only_what_is_asked_for_is_drawn(tmp_path, monkeypatch, scene):
    """As PNG and PDF; a later run takes the pictures away; without a field of the stress the tensor is not computed."""
    solution = alone(scene())
    write_results(solution, tmp_path, fields=False, pictures=["principal", "displacement"])
    assert sorted(path.name for path in tmp_path.glob("field_*")) == [
        f"field_{name}.{kind}" for name in ("displacement", "principal") for kind in ("pdf", "png")
    ]
    monkeypatch.setattr(Stresses, "tensor", property(lambda self: 1 / 0))
    write_results(alone(scene()), tmp_path, fields=False, pictures=["density", "displacement"])
    assert sorted(path.name for path in tmp_path.glob("field_*.png")) == ["field_density.png", "field_displacement.png"]
    write_results(solution, tmp_path, fields=False)
    assert not list(tmp_path.glob("field_*"))
    assert (tmp_path / "deformed.pdf").exists()


def test_fields_that_are_none(tmp_path, capsys):
    """The known ones are named."""
    solution = alone(example1(nx=6, ny=2))
    with pytest.raises(ValueError, match="no picture of 'mises': there are von_mises, pressure"):
        write_results(solution, tmp_path, pictures=["mises"])
    with pytest.raises(SystemExit, match="2"):
        cli.main(["solve", "scene.toml", "--picture", "mises"])
    assert f"choose from {', '.join(ON_DEMAND)}" in capsys.readouterr().err.replace("'", "")


def test_scale_that_is_given():
    """An animation has the same colours in every frame: the scale ends where it is told to, with an arrow above."""
    tones = Tones(FIELDS["von_mises"], np.array([1.0, 2.0, 4.0]), np.ones(3), top=3.0)
    figure = Figure()
    assert (tones.low, tones.high) == (0.0, 3.0)
    assert tones.bar(figure, figure.add_subplot()).extend == "max"
