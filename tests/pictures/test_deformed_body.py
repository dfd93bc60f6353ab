"""The picture of the deformed body: where body and foundation are drawn, and when one panel is not
enough.
"""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from numpy.testing import assert_allclose

from signorini_fx.addons.pictures.body import DrawnBody, tiling
from signorini_fx.addons.pictures.deformed_body import deformed_mesh
from signorini_fx.addons.pictures.foundation import Foundation, magnification

X = np.linspace(0.0, 3.0, 13)
BOTTOM = np.column_stack((X, np.zeros(13)))
CORNERS = np.vstack((BOTTOM, BOTTOM + np.array([0.0, 1.0])))
OUTLINE = np.array([[0, 1], [1, 14]])
CELLS = np.array([[k, k + 1, k + 14, k + 13] for k in range(12)])
POINTS = np.vstack((CORNERS, CORNERS[CELLS].mean(axis=1)))
DOWN = np.array([0.0, -1.0])
WITHIN = np.column_stack((CELLS, 26 + np.arange(12)))
ONES = {"von_mises": np.ones((12, 5))}
BODY = DrawnBody(POINTS, WITHIN, tiling(4, 1), np.zeros((38, 2)), ONES, True, OUTLINE)


def on(gap, touching):
    """What is below."""
    return Foundation(BOTTOM, np.tile(DOWN, (13, 1)), gap, touching)


def drawn(gap, displacement, **options):
    """The axes of the picture and its remark; ``gap`` along the bottom."""
    foundation = on(gap, gap <= -displacement[:13, 1] + 1e-12)
    body = replace(BODY, displacement=displacement)
    figure, remark = deformed_mesh(body, "von_mises", foundations=[foundation], **options)
    return [axes for axes in figure.axes if axes.get_label() != "<colorbar>"], remark


def body_of(axes):
    (cells,) = (one for one in axes.collections if isinstance(one, PolyCollection))
    return np.array([path.vertices[:4] for path in cells.get_paths()])


def foundation_of(axes):
    (line,) = (line for line in axes.lines if line.get_marker() != "o")
    return line


def sinking(depth):
    return np.tile([0.0, -depth], (38, 1))


def test_a_gap_that_hardly_varies_is_magnified_like_the_displacement():
    """One panel: body and foundation touch in it where they touch."""
    gap = 0.001 + 0.0005 * (X - 1.5) ** 2
    displacement = sinking(0.001)
    factor = magnification(replace(BODY, displacement=displacement), [])
    (axes,), title = drawn(gap, displacement)
    assert factor == 200
    assert "displacement and gap" in title
    assert "200" in title
    assert_allclose(body_of(axes), (POINTS + factor * displacement)[CELLS])
    line = foundation_of(axes)
    assert_allclose(line.get_xydata(), BOTTOM + factor * gap[:, None] * DOWN)


def test_round_off_is_not_magnified():
    """A body that is back where it began is drawn as it is, and not 1e15 times as deformed."""
    assert magnification(replace(BODY, displacement=sinking(1e-17)), []) == 1
    assert magnification(replace(BODY, displacement=sinking(1e-12)), []) > 1e10


@pytest.mark.parametrize(
    "gap", [0.3 * (X - 1.5) ** 2, np.where(X < 2, 0.0, 0.1 * (X - 2)), np.full(13, 0.2)]
)
def test_a_foundation_that_would_be_bent_is_drawn_where_it_is(gap):
    """All as it is then, and nothing is magnified."""
    gap = gap + 0.001
    displacement = sinking(0.0012)
    assert magnification(replace(BODY, displacement=displacement), []) > 1
    (axes, *_), title = drawn(gap, displacement)
    assert "displacement \N{MULTIPLICATION SIGN} 1" in title
    assert_allclose(body_of(axes), (POINTS + displacement)[CELLS])
    assert_allclose(foundation_of(axes).get_xydata(), BOTTOM + gap[:, None] * DOWN)


def test_a_small_contact_zone_is_enlarged():
    """In a second panel, which shows it as it is."""
    gap = 0.3 * (X - 1.5) ** 2 + 0.001
    gap[[5, 6, 7]] = 0.001
    (whole, zone), title = drawn(gap, sinking(0.0012))
    assert title == "left: displacement \N{MULTIPLICATION SIGN} 1; right: the contact zone as it is"
    low, high = zone.get_xlim()
    assert 0 < low < X[5] < X[7] < high < 3
    assert_allclose(body_of(zone), (POINTS + sinking(0.0012))[CELLS])
    assert whole.get_xlim()[0] < 0


def test_two_bodies_seem_to_touch():
    """What has closed between them is magnified to a 300th of their size at most."""
    body = replace(BODY, displacement=sinking(0.001))
    other = replace(on(np.full(13, 0.0005), X < 1), rigid=False)
    assert magnification(body, [other]) == 20
    assert magnification(body, [replace(other, touching=X < 0)]) == 200
