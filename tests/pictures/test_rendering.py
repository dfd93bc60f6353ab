"""Bodies in 3D as pictures: views, perspective, foundations and colours."""

import sys
from types import SimpleNamespace

import numpy as np
import pytest
from drawing import needs_pictures_in_3d
from numpy.testing import assert_allclose, assert_array_equal

from signorini_fx.addons.pictures import solid as drawing
from signorini_fx.addons.pictures import view
from signorini_fx.addons.pictures.body import normals_of
from signorini_fx.addons.pictures.foundation import Foundation
from signorini_fx.addons.pictures.solid import Solid
from signorini_fx.addons.pictures.style import VALUES
from signorini_fx.errors import PictureError

CUBE = np.array([[x, y, z] for z in (0.0, 1.0) for y in (0.0, 1.0) for x in (0.0, 1.0)])
SIDES = np.array(
    [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
)
TRIANGLES = SIDES[:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3)
WIDTH = 120


@pytest.fixture(autouse=True)
def needed():
    """PyVista is not everywhere."""
    needs_pictures_in_3d()


def solid(values, points=CUBE, triangles=TRIANGLES, **more):
    """What is drawn of triangles with one value each, or one for each corner."""
    values = np.broadcast_to(
        np.asarray(values, dtype=float).reshape(len(triangles), -1), (len(triangles), 3)
    )
    return Solid(points, triangles, values, (0.0, 1.0), **more)


def hue(colours):
    """Colours without their brightness, which the light changes."""
    colours = np.asarray(colours, dtype=float)[..., :3]
    return colours / np.linalg.norm(colours, axis=-1, keepdims=True)


def at(picture, camera, points):
    """The colours at points in 3D."""
    share = (camera.flat(np.asarray(points, dtype=float)) / camera.half + 1) / 2
    column, row = np.floor(share * picture.shape[1::-1]).astype(int).T
    return picture[::-1][row, column]


def test_colours_are_those_of_the_field():
    """On each side one value, or a field that is linear on it; the light changes the brightness
    only.
    """
    camera = view.Camera.on(view.oblique(), CUBE)
    sides = np.array([0.0, 0.9, 0.5, 0.0, 0.0, 0.2])
    front = [1, 2, 5]  # top, front, right
    picture = drawing.image(solid(sides.repeat(2)), camera, WIDTH)
    middles = CUBE[SIDES].mean(axis=1)[front]
    assert_allclose(hue(at(picture, camera, middles)), hue(VALUES(sides[front])), atol=0.02)
    brightness = at(picture, camera, middles).sum(axis=1) / VALUES(sides[front])[:, :3].sum(axis=1)
    assert np.ptp(brightness) > 0.05 * brightness.max()
    assert (
        at(picture, camera, np.array([camera.centre + 0.995 * camera.half[0] * camera.view.right]))
        == 255
    ).all()
    rising = drawing.image(solid(CUBE[TRIANGLES][..., 0]), camera, WIDTH)
    along = np.array([[x, 0.5, 1.0] for x in (0.1, 0.4, 0.6, 0.9)])
    assert_allclose(hue(at(rising, camera, along)), hue(VALUES(along[:, 0])), atol=0.02)
    assert_array_equal(drawing.image(solid(CUBE[TRIANGLES][..., 0]), camera, WIDTH), rising)


def test_a_jump_of_the_field_is_not_smeared():
    """Beside an edge between two values there is neither of the other, however smooth the
    surface.
    """
    flat = view.View(*np.eye(3))
    points = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0], [1, 1, 0], [2, 1, 0]])
    triangles = np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4]])
    camera = view.Camera.on(flat, points)
    picture = drawing.image(solid([0.0, 0.0, 1.0, 1.0], points, triangles), camera, WIDTH)
    for x, value in ((0.95, 0.0), (1.05, 1.0)):
        assert_allclose(hue(at(picture, camera, [[x, 0.5, 0.0]])), [hue(VALUES(value))], atol=0.02)


def test_foundations_are_seen_from_the_body():
    """A plane from above, gray; not from below, where it would hide the body."""
    ground = drawing.ground_of(over([0.2] * 4), 1.0)
    assert_allclose(ground[0][:, 2], -0.2)
    assert normals_of(ground[0][ground[1]])[0, 2] > 0
    corner = ground[0][np.argmin(ground[0] @ view.oblique().right)]
    inside = corner + 0.1 * (ground[0].mean(axis=0) - corner)
    for elevation in (24.0, -24.0):
        camera = view.Camera.on(
            view.oblique(elevation=elevation), np.concatenate((CUBE, ground[0]))
        )
        picture = drawing.image(solid(np.ones(12), grounds=[ground]), camera, WIDTH)
        (colour,) = at(picture, camera, [inside]).astype(int)
        assert np.ptp(colour) < 6
        assert (colour[0] < 250) == (elevation > 0)


def over(gap):
    """The foundation below the cube, by its gap at the corners."""
    down = np.tile([0.0, 0.0, -1.0], (4, 1))
    return Foundation(CUBE[:4], down, np.array(gap), np.full(4, True), np.array([[0, 1, 3, 2]]))


@pytest.mark.parametrize(
    ("old", "message"), [(False, "is drawn by PyVista"), (True, "needs a display")]
)
def test_what_is_missing(monkeypatch, old, message):
    """The error says what to install."""
    monkeypatch.setitem(
        sys.modules, "pyvista", SimpleNamespace(vtk_version_info=(9, 3, 0)) if old else None
    )
    monkeypatch.setenv("DISPLAY", "")
    monkeypatch.setenv("PATH", "")  # no Xvfb
    with pytest.raises(PictureError, match=rf"{message}.*pip install pyvista"):
        drawing.image(solid(np.ones(12)), view.Camera.on(view.oblique(), CUBE), WIDTH)
