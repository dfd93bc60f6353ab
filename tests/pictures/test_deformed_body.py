"""The picture of the deformed body: where body and foundation are drawn, and when one panel is not enough."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure

from signorini_fx.addons.pictures import deformed_body
from signorini_fx.addons.pictures.body import DrawnBody
from signorini_fx.addons.pictures.deformed_body import DrawnFoundation, deformed_mesh, magnification
from signorini_fx.addons.pictures.fields import FIELDS
from signorini_fx.addons.pictures.marks import Largest
from signorini_fx.addons.pictures.style import finish
from signorini_fx.addons.pictures.tiling import tiling

X = np.linspace(0.0, 3.0, 13)
BOTTOM = np.column_stack((X, np.zeros(13)))
POINTS = np.vstack((BOTTOM, BOTTOM + np.array([0.0, 1.0])))
OUTLINE = np.array([[0, 1], [1, 14]])
CELLS = np.array([[k, k + 1, k + 14, k + 13] for k in range(12)])
DOWN = np.array([0.0, -1.0])
WITHIN = np.column_stack((CELLS, CELLS[:, 0]))  # the point in the middle of a cell is not used
BODY = DrawnBody(POINTS, WITHIN, tiling(4, 1), np.zeros((26, 2)), {"von_mises": np.ones(12)}, False, OUTLINE)


def drawn(monkeypatch, gap, displacement, **options):
    """The axes of the picture and its title; ``gap`` along the bottom."""
    kept = []
    monkeypatch.setattr(deformed_body, "finish", lambda figure, stem, title, suffixes: kept.append((figure, title)))
    touching = gap <= -displacement[:13, 1] + 1e-12
    foundation = DrawnFoundation(BOTTOM, gap[:, None] * DOWN, touching)
    deformed_mesh(
        "nowhere", POINTS, CELLS, displacement, np.ones(12), outline=OUTLINE, foundation=foundation, **options
    )
    figure, title = kept[0]
    return [axes for axes in figure.axes if axes.get_label() != "<colorbar>"], title


def body_of(axes):
    (cells,) = (one for one in axes.collections if isinstance(one, PolyCollection))
    return np.array([path.vertices[:4] for path in cells.get_paths()])


def foundation_of(axes):
    (line,) = (line for line in axes.lines if line.get_marker() != "o")
    return line


def sinking(depth):
    return np.tile([0.0, -depth], (26, 1))


def test_a_gap_that_hardly_varies_is_magnified_like_the_displacement(monkeypatch):
    """One panel: body and foundation touch in it where they touch."""
    gap = 0.001 + 0.0005 * (X - 1.5) ** 2
    displacement = sinking(0.001)
    factor = magnification(POINTS, displacement)
    (axes,), title = drawn(monkeypatch, gap, displacement)
    assert factor == 200
    assert "displacement and gap" in title
    assert "200" in title
    np.testing.assert_allclose(body_of(axes), (POINTS + factor * displacement)[CELLS])
    line = foundation_of(axes)
    np.testing.assert_allclose(line.get_xydata(), BOTTOM + factor * gap[:, None] * DOWN)


def test_round_off_is_not_magnified():
    """A body that is back where it began is drawn as it is, and not 1e15 times as deformed."""
    assert magnification(POINTS, sinking(1e-17)) == 1
    assert magnification(POINTS, sinking(1e-12)) > 1e10


@pytest.mark.parametrize("gap", [0.3 * (X - 1.5) ** 2, np.where(X < 2, 0.0, 0.1 * (X - 2)), np.full(13, 0.2)])
def test_a_foundation_that_would_be_bent_is_drawn_where_it_is(monkeypatch, gap):
    """Two panels: all as it is; and the displacement magnified, with the contact zone and no foundation."""
    gap = gap + 0.001
    displacement = sinking(0.0012)
    factor = magnification(POINTS, displacement)
    (left, right), title = drawn(monkeypatch, gap, displacement)
    assert "as it is" in title
    assert "and gap" not in title
    np.testing.assert_allclose(body_of(left), (POINTS + displacement)[CELLS])
    np.testing.assert_allclose(body_of(right), (POINTS + factor * displacement)[CELLS])
    line = foundation_of(left)
    np.testing.assert_allclose(line.get_xydata(), BOTTOM + gap[:, None] * DOWN)
    assert not right.lines
    zone = max((one for one in right.collections if isinstance(one, LineCollection)), key=lambda c: c.get_linewidth())
    both = (gap[:-1] <= 0.0012) & (gap[1:] <= 0.0012)
    assert len(zone.get_segments()) == both.sum()
    if both.any():
        assert np.array(zone.get_segments())[..., 1] == pytest.approx(-0.0012 * factor)


def test_an_asked_factor_makes_one_panel(monkeypatch):
    """As the figures of the paper need it, in the gray tones that the paper has."""
    gray = replace(FIELDS["density"], colours="gray_r")
    (axes,), title = drawn(monkeypatch, 0.003 * (X - 1.5) ** 2, sinking(0.001), factor=20.0, field=gray)
    assert "20" in title
    assert axes.lines
    (cells,) = (one for one in axes.collections if isinstance(one, PolyCollection))
    assert cells.get_cmap().name == "gray_r"


def test_a_panel_has_no_foundation_that_would_be_bent(monkeypatch):
    """One panel, with the contact zone marked, where the factor magnifies a plane below a round body."""
    gap = 0.3 * (X - 1.5) ** 2 + 0.001
    (axes,), title = drawn(monkeypatch, gap, sinking(0.0012), factor=50.0)
    assert "gap" not in title
    assert "contact zone thick" in title
    assert not axes.lines
    np.testing.assert_allclose(body_of(axes), (POINTS + 50.0 * sinking(0.0012))[CELLS])


def test_lengths_are_those_of_the_body(monkeypatch):
    """Coordinates stand at the axes of what is not magnified; else arrows say how long the undeformed body is, whose
    outline is drawn, and a circle is at the largest value.
    """
    gap = np.full(13, 0.001)
    at = POINTS[CELLS[0]].mean(axis=0)
    (axes,), _ = drawn(monkeypatch, gap, sinking(0.001), largest=Largest(at, "1.20"))
    said = [text.get_text() for text in axes.texts if text.get_text()]
    assert said == ["x: $3$", "y: $1$", "$1.2$"]
    assert not axes.axison
    rest = [one for one in axes.collections if isinstance(one, LineCollection)]
    assert any(np.array_equal(one.get_segments(), POINTS[OUTLINE]) for one in rest)
    (circle,) = (line for line in axes.lines if line.get_marker() == "o")
    np.testing.assert_allclose(circle.get_xydata()[0], at - np.array([0.0, 0.2]))
    (axes,), _ = drawn(monkeypatch, gap, sinking(0.001), factor=1.0)
    assert (axes.get_xlabel(), axes.get_ylabel()) == ("$x$", "$y$")
    assert axes.axison
    assert not [text for text in axes.texts if text.get_text()]


def test_the_circle_moves_with_the_cell_that_has_the_value(monkeypatch):
    """Of two bodies that touch there and slide past each other that of the largest value, and turned as the cell is."""
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    points = np.vstack((square - [0.0, 1.0], square))
    turned = 0.3 * np.column_stack((-square[:, 1], square[:, 0])) + [0.5, 0.0]
    at, kept = np.array([0.9, 0.0]), []
    monkeypatch.setattr(deformed_body, "finish", lambda figure, stem, title, suffixes: kept.append(figure))
    for values, expected in (([1.0, 2.0], np.array([1.4, 0.27])), ([2.0, 1.0], at)):
        deformed_mesh(
            "nowhere",
            points,
            np.array([[0, 1, 2, 3], [4, 5, 6, 7]]),
            np.vstack((0.0 * square, turned)),
            np.array(values),
            outline=np.array([[0, 1], [4, 5]]),
            factor=1.0,
            largest=Largest(at, "2"),
        )
        (circle,) = (line for line in kept[-1].axes[0].lines if line.get_marker() == "o")
        np.testing.assert_allclose(circle.get_xydata()[0], expected, rtol=0, atol=1e-12)


def test_a_small_contact_zone_is_enlarged(monkeypatch):
    """In a second panel, which shows it as it is; not where the factor is given."""
    gap = 0.3 * (X - 1.5) ** 2 + 0.001
    gap[[5, 6, 7]] = 0.001
    (whole, zone), title = drawn(monkeypatch, gap, sinking(0.0012))
    assert title == "left: as it is; right: the contact zone as it is"
    low, high = zone.get_xlim()
    assert 0 < low < X[5] < X[7] < high < 3
    np.testing.assert_allclose(body_of(zone), (POINTS + sinking(0.0012))[CELLS])
    assert whole.get_xlim()[0] < 0
    assert len(drawn(monkeypatch, gap, sinking(0.0012), factor=1.0)[0]) == 1


def test_a_title_stays_within_its_picture(tmp_path):
    """A title that is wider than the figure goes on in the next line, and its remark has a line of its own."""
    figure = Figure(figsize=(4.0, 3.0))
    finish(
        figure,
        tmp_path / "figure",
        4 * "A brake shoe pressed and dragged " + r"  (displacement $\times\,50$)",
        suffixes=[],
    )
    (text,) = figure.texts
    assert text.get_text().endswith("\n" + r"(displacement $\times\,50$)")
    assert text.get_window_extent().x1 <= figure.bbox.width
    assert text.get_text().replace("\n", " ").startswith("A brake shoe pressed and dragged A brake shoe")


def test_axisymmetric_bodies_are_mirrored():
    """Points, displacements, shear and foundation are reflected at the axis, which is no edge of the body."""
    stress = np.arange(9.0).reshape(1, 3, 3).repeat(12, axis=0)
    displacement = np.column_stack((0.1 * POINTS[:, 0], -POINTS[:, 1]))
    edges = np.array([[0, 13], [0, 1], [12, 25]])
    body = replace(BODY, displacement=displacement, values={"stress": stress}, outline=edges).with_mirror_image()
    assert np.array_equal(body.points[26:], POINTS * (-1, 1))
    assert np.array_equal(body.displacement[26:], displacement * (-1, 1))
    assert np.array_equal(body.outline, [[0, 1], [12, 25], [26, 27], [38, 51]])
    assert np.array_equal(body.within[12:], WITHIN + 26)
    signs = np.array([[1, -1, -1], [-1, 1, 1], [-1, 1, 1]])
    assert np.array_equal(body.values["stress"][12:], stress * signs)
    offset = np.column_stack((0.1 * X, -1 - X))
    touching = X < 1
    foundation = DrawnFoundation(BOTTOM, offset, touching).with_mirror_image()
    assert np.array_equal(foundation.nodes[:, 0], [*-X[::-1], *X])
    assert np.array_equal(foundation.offset[:, 0], [*-0.1 * X[::-1], *0.1 * X])
    assert np.array_equal(foundation.touching, [*touching[::-1], *touching])


def test_whole_foundations_are_drawn_where_nothing_is_magnified(monkeypatch):
    """A circle on a body: in the panel of what is as it is the whole circle, and not what is opposite of the nodes."""
    angle = np.linspace(0.0, -2 * np.pi, 60)
    circle = np.column_stack((1.5 + np.cos(angle), -1.0 + np.sin(angle)))
    offset = (0.5 * (X - 1.5) ** 2)[:, None] * DOWN
    kept = []
    monkeypatch.setattr(deformed_body, "finish", lambda figure, *_: kept.append(figure))
    ground = DrawnFoundation(BOTTOM, offset, np.full(13, False), None, np.full(13, True), [circle])
    deformed_mesh("nowhere", POINTS, CELLS, sinking(0.001), np.ones(12), outline=OUTLINE, foundation=ground)
    left, right = (axes for axes in kept[0].axes if axes.get_label() != "<colorbar>")
    (line,) = left.lines
    np.testing.assert_array_equal(line.get_xydata(), circle)
    assert len(right.lines) == 0
    mirrored = ground.with_mirror_image()
    np.testing.assert_array_equal(mirrored.lines[1], circle[::-1] * [-1.0, 1.0])
