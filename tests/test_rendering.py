"""Surfaces in space as images: what is in front, values and light at every pixel, hidden lines, views, foundations."""

import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from scipy.spatial import ConvexHull

from signorini_fx.report import view
from signorini_fx.report.rendering import fans, normals_of, render, smooth_normals
from signorini_fx.report.solid_body import deformed_solid, solid_figure, telling_view
from signorini_fx.report.solid_foundation import FoundationSurface

SHARP = np.cos(np.radians(40.0))
CUBE = np.array([[x, y, z] for z in (0.0, 1.0) for y in (0.0, 1.0) for x in (0.0, 1.0)])
SIDES = np.array([[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]])


def square(height, low=0.0, high=8.0):
    """Two triangles, at a height that is a number or depends on the place."""
    x = np.array([[low, low], [high, low], [high, high], [low, high]])
    z = np.broadcast_to(height(x) if callable(height) else height, 4)
    return np.column_stack((x, z))[[[0, 1, 2], [0, 2, 3]]]


def test_every_pixel_has_the_value_at_its_place():
    """Exactly, for a field that is linear; no pixel is missing, and none is outside."""
    corners = square(0.0)
    image = render(corners, np.array([-0.95, -0.95]), 0.1, (100, 100))
    middles = -0.95 + 0.1 * np.arange(100)
    inside = (middles > 0) & (middles < 8)
    np.testing.assert_array_equal(image.triangle >= 0, inside[:, None] & inside)
    row, column = np.nonzero(image.triangle >= 0)
    field = image.interpolated(3 * corners[..., 0] - 2 * corners[..., 1] + 1)
    np.testing.assert_allclose(field, 3 * middles[column] - 2 * middles[row] + 1, atol=1e-12)
    vectors = image.interpolated(corners)
    np.testing.assert_allclose(vectors[:, :2], np.column_stack((middles[column], middles[row])), atol=1e-12)


@pytest.mark.parametrize("order", [1, -1])
def test_the_nearest_is_seen(order):
    """Whichever is given first, and where two pass through each other."""
    sloping = square(lambda x: x[:, 0] - 4.02)
    image = render(np.concatenate((square(0.0), sloping)[::order]), np.zeros(2) + 0.05, 0.1, (80, 80))
    x = 0.05 + 0.1 * np.arange(80)
    first_is_sloping = order == -1
    sloped = (image.triangle < 2) == first_is_sloping
    np.testing.assert_array_equal(sloped, np.tile(x > 4.02, (80, 1)))
    np.testing.assert_allclose(image.depth, np.tile(np.maximum(x - 4.02, 0.0), (80, 1)), atol=1e-12)


def test_large_and_small_triangles_agree():
    """A surface that is cut into 800 triangles looks like one of two; triangles beyond the frame are left out."""
    n = 20
    grid = np.stack(np.meshgrid(np.linspace(0, 8, n + 1), np.linspace(0, 8, n + 1)), axis=-1).reshape(-1, 2)
    points = np.column_stack((grid, grid @ [0.3, -0.2]))
    corner = (np.arange(n)[:, None] * (n + 1) + np.arange(n)).ravel()
    triangles = fans(np.column_stack((corner, corner + 1, corner + n + 2, corner + n + 1)))
    assert len(triangles) == 800
    frame = (np.array([2.013, 3.017]), 0.05, (90, 70))
    fine, coarse = render(points[triangles], *frame), render(square(lambda x: x @ [0.3, -0.2]), *frame)
    assert (coarse.triangle >= 0).all()
    np.testing.assert_allclose(fine.depth, coarse.depth, atol=1e-12)


def test_triangles_seen_from_the_side_are_not_seen():
    """They cover no pixel, and give no warning."""
    edge_on = np.array([[[0.0, 1, 0], [8, 1, 0], [4, 1, 5]]])
    assert (render(edge_on, np.zeros(2), 0.1, (80, 80)).triangle == -1).all()


def test_hidden_lines():
    """What is behind is hidden, what is on the surface is not, unless lines apart from it are asked for."""
    image = render(square(1.0, 2.0, 6.0), np.zeros(2) + 0.05, 0.1, (80, 80))

    def lengths(height, **options):
        line = np.array([[0.0, 4.0, height], [8.0, 4.0, height]])
        return [float(np.ptp(part[:, 0])) for part in image.visible_parts([line], **options)]

    assert lengths(0.0) == pytest.approx([2.0, 2.0], abs=0.35)
    assert lengths(1.0) == pytest.approx([8.0])
    assert lengths(2.0) == pytest.approx([8.0])
    assert lengths(1.0, apart=True) == pytest.approx([1.5, 1.5], abs=0.35)
    assert lengths(2.0, apart=True) == pytest.approx([8.0])
    assert image.visible_parts([]) == []


def test_light_turns_smoothly_but_at_sharp_edges():
    """On a cube each side keeps its normal; on a sphere they are those of the sphere."""
    triangles = fans(SIDES)
    expected = normals_of(CUBE, SIDES).repeat(2, axis=0)
    np.testing.assert_allclose(np.abs(expected).sum(axis=1), 1.0)
    np.testing.assert_allclose(smooth_normals(CUBE, triangles, SHARP), expected[:, None].repeat(3, axis=1))
    points = np.random.default_rng(4).normal(size=(2000, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    hull = ConvexHull(points).simplices.astype(np.int64)
    a, b, c = points[hull].transpose(1, 0, 2)
    inwards = np.einsum("ij,ij->i", np.cross(b - a, c - a), a) < 0
    hull[inwards] = hull[inwards][:, ::-1]
    assert np.einsum("tij,tij->ti", smooth_normals(points, hull, SHARP), points[hull]).min() > 0.99
    flat = normals_of(points, hull)
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    assert np.einsum("tj,tij->ti", flat, points[hull]).min() < 0.99


def test_the_view_shows_the_cut():
    """Of a cube that is stressed on one side only, that side is seen; of a uniform one the front and the right."""
    usual = view.oblique()
    for loaded, azimuth in ((2, -58.0), (5, -58.0), (3, 122.0), (4, -122.0)):
        values = np.where(np.arange(6) == loaded, 1.0, 0.0)
        seen = telling_view(CUBE, SIDES, values)
        towards = normals_of(CUBE, SIDES)[loaded] @ seen.toward
        assert towards > 0.4
        if azimuth == -58.0:
            np.testing.assert_array_equal(seen.toward, usual.toward)
    for values in (np.ones(6), np.zeros(6), np.full(6, np.nan)):
        np.testing.assert_array_equal(telling_view(CUBE, SIDES, values).toward, usual.toward)


@pytest.mark.parametrize("size", [(3.0, 1.0, 1.0), (1.0, 3.0, 1.0), (1.0, 1.0, 3.0), (1.0, 1.0, 0.1)])
@pytest.mark.parametrize("azimuth", [-58.0, 122.0])
def test_the_axes_are_beside_the_body(size, azimuth):
    """Where they are named nothing is drawn, and the directions are those of the view."""
    points = CUBE * size
    seen = view.oblique(azimuth)
    figure, _ = solid_figure(points, SIDES, np.zeros((8, 3)), np.ones(6), seen=seen)
    axes = figure.axes[0]
    names = [text for text in axes.texts if text.get_text() in ("$x_1$", "$x_2$", "$x_3$")]
    places = np.array([text.get_position() for text in names])
    (image,) = axes.images
    left, right, bottom, top = image.get_extent()
    rows, columns = image.get_array().shape[:2]
    column, row = np.floor((places - [left, bottom]) / [right - left, top - bottom] * [columns, rows]).astype(int).T
    assert (image.get_array()[row, column, 3] == 0).all()
    steps = np.diff(places, axis=0)
    along = np.diff(seen.flat(np.eye(3)), axis=0)
    np.testing.assert_allclose(steps / steps[0, 0], along / along[0, 0], rtol=1e-9)


def over(gap):
    """The foundation below the cube, by its gap at the corners."""
    down = np.tile([0.0, 0.0, -1.0], (4, 1))
    return FoundationSurface(CUBE[:4], down, np.array(gap), np.array([[0, 1, 3, 2]]))


def test_foundations_that_are_magnified_or_not():
    """A plane stays one and is drawn in the same map; a bent one would be another: then there are two panels."""
    size = np.sqrt(3.0)
    assert over([0.01] * 4).looks_like_itself(50.0, size)
    assert not over([0.01] * 4).looks_like_itself(200.0, size)  # it would be far away
    assert over([0.0, 0.0, 0.1, 0.1]).looks_like_itself(2.0, size)
    assert not over([0.0, 0.0, 0.1, 0.1]).looks_like_itself(8.0, size)  # as steep as 39 degrees
    displacement = np.tile([0.0, 0.0, -0.001], (8, 1))
    values = np.ones(6)

    def panels(gap, **options):
        figure, remark = solid_figure(CUBE, SIDES, displacement, values, foundations=[over(gap)], **options)
        axes = [one for one in figure.axes if one.get_label() != "<colorbar>"]
        return remark, [sum(isinstance(c, PolyCollection) for c in one.collections) for one in axes]

    assert panels([0.001] * 4) == (r"displacement and gap $\times\,100$", [1])
    assert panels([0.001, 0.001, 0.5, 0.5]) == (r"left: as it is; right: displacement $\times\,100$", [1, 0])
    assert panels([0.001, 0.001, 0.5, 0.5], factor=2.0)[1] == [1]


def test_a_curved_foundation_is_seen():
    """A ridge from above, gray; not from below, where it would hide the body."""
    x = np.linspace(-2.0, 3.0, 21)
    nodes = np.column_stack((x.repeat(2), np.tile([-2.0, 3.0], 21), np.zeros(42)))
    down = np.tile([0.0, 0.0, -1.0], (42, 1))
    row = 2 * np.arange(20)
    facets = np.column_stack((row, row + 1, row + 3, row + 2))
    ridge = FoundationSurface(nodes, down, 0.2 * (nodes[:, 0] - 0.5) ** 2, facets)
    still = np.zeros((8, 3))
    figure, _ = solid_figure(CUBE, SIDES, still, np.ones(6), foundations=[ridge], factor=1.0)
    picture = figure.axes[0].images[0].get_array()
    gray = (np.ptp(picture[..., :3], axis=2) < 1e-6) & (picture[..., 3] == 1)
    body = (np.ptp(picture[..., :3], axis=2) > 0.1) & (picture[..., 3] == 1)
    assert gray.sum() > body.sum() > 1000
    middle = 0.5 * (x[1:] + x[:-1])
    for elevation in (24.0, 60.0, -60.0):
        triangles = ridge.facing(view.oblique(0.0, elevation), 1.0)
        lift = np.radians(elevation)
        assert len(triangles) == 2 * np.count_nonzero(0.4 * (middle - 0.5) * np.cos(lift) + np.sin(lift) > 0)
        assert (np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])[:, 2] > 0).all()


def test_a_body_without_facets(tmp_path):
    """There is nothing to draw."""
    with pytest.raises(ValueError, match="no facets"):
        deformed_solid(tmp_path / "none", CUBE, SIDES[:0], np.zeros((8, 3)), np.ones(0))
