"""Bounds of bodies with preloaded sections: true errors, exact states, and what the strain of a jump is for."""

from dataclasses import replace

import numpy as np
import pytest
from loaded_scenes import effectivity
from scenes import alone
from spaces import box

from signorini_fx.addons.bounds.error_bound import Bounded
from signorini_fx.addons.bounds.plain_scene import PlainProblem
from signorini_fx.mechanics.effects.preload import Preload
from signorini_fx.scenes.reading import parse_scene

SLOW, LONG = pytest.mark.slow, pytest.mark.long
YOUNG, SPAN, SHORTER = 100.0, 2.0, 0.01


@pytest.mark.parametrize(
    ("study", "seeds"),
    [
        ("plane", (2,)),
        pytest.param("plane", (0, 1, 3, 4, 5), marks=SLOW),
        pytest.param("pair", (3, 5), marks=SLOW),
        pytest.param("space", (2,), marks=SLOW),
    ],
)
def test_true_errors(study, seeds):
    """Finer solutions refute no interval of the strain energy or of a force."""
    for seed in seeds:
        found = effectivity("preload", study, seed)
        assert not isinstance(found, str), found
        assert found[2] == []
        assert 1 < found[0] < 6


def bar(cell="triangle", *, degree=1, dimension=2, **more):
    """A bar without Poisson's ratio between two walls, a section of which is shortened."""
    if dimension == 2:
        shape = {"length": SPAN, "height": 1.0, "nx": 4, "ny": 2, "cell": cell}
        mesh = {"generator": "rectangle", "parameters": shape}
    else:
        mesh = box("tetrahedra", (4, 1, 1), size=(SPAN, 1.0, 1.0))
    still = dict.fromkeys("xyz"[:dimension], 0.0)
    section = {"point": [0.7, 0.0, 0.0][:dimension], "axis": [-1.0, 0.0, 0.0][:dimension], "shortening": SHORTER}
    scene = {
        "mesh": mesh,
        "element": {"degree": degree},
        "material": {"young": YOUNG, "poisson": 0.0},
        "displacement": [{"boundary": name, **still} for name in ("left", "right")],
        "preload": [section],
    }
    return parse_scene(scene | more)


@pytest.mark.parametrize(
    ("cell", "degree", "dimension"),
    [("triangle", 1, 2), ("triangle", 2, 2), ("quadrilateral", 1, 2), ("tetrahedron", 1, 3), ("tetrahedron", 2, 3)],
)
def test_a_bar_that_is_shortened_between_walls(cell, degree, dimension):
    """It is in uniform tension, which the elements have: bounds are equal to what they bound."""
    solution = alone(bar(cell, degree=degree, dimension=dimension))
    bound, pull = solution.error_bound, YOUNG * SHORTER / SPAN
    energy = pull * SHORTER / 2
    assert bound.error < 1e-5 * bound.size
    assert bound.strain_energy == pytest.approx((energy, energy), rel=1e-4)
    assert bound.as_dict()["guaranteed"]
    if dimension == 2:
        low, high = solution.force_bounds("right", (1.0, 0.0))
        assert high - low < 1e-8 * pull
        assert low - 1e-12 <= pull <= high + 1e-12


@pytest.mark.parametrize("factor", [1.0, 1.02, 0.98])
def test_a_shortening_that_is_wrong(monkeypatch, factor):
    """Seen with another one, the force of the wall is refuted."""
    solution, pull = alone(bar()), YOUNG * SHORTER / SPAN
    jumps = PlainProblem._jumps

    def wrong(self, sections):
        found = jumps(self, sections)
        return replace(found, strain=factor * found.strain)

    monkeypatch.setattr(PlainProblem, "_jumps", wrong)
    low, high = solution.force_bounds("right", (1.0, 0.0))
    assert (low - 1e-12 <= pull <= high + 1e-12) == (factor == 1)


def test_where_the_section_is_does_not_matter():
    """The same strain belongs to a section elsewhere, and to the part of a body between both that moves as a whole."""
    for place in (0.4, 1.0, 1.6):
        section = {"point": [place, 0.0], "axis": [1.0, 0.0], "shortening": SHORTER}
        solution = alone(bar(preload=[section], traction={"boundary": "top", "y": "-0.1*x[0]"}))
        case = Bounded(solution.model, solution.displacement, solution.contact, 0.0)
        strain, bound = case.strained(case.y, case.middle), solution.error_bound
        if place == 0.4:
            first, error = strain, bound.error
        assert np.abs(strain - first).max() < 1e-9 * np.abs(first).max()
        assert bound.error == pytest.approx(error, rel=1e-7)


def test_a_force_and_the_shortening_that_it_leads_to():
    """The same bound; that of the force rests on the computed shortening, and says so."""
    more = {"contact": {"boundary": "bottom", "gap": 0.001}, "traction": {"boundary": "top", "y": -0.2}}
    section = {"point": [0.7, 0.0], "axis": [1.0, 0.0]}
    by_force = alone(bar(preload=[section | {"force": 0.4}], **more))
    (preload,) = by_force.model.statement.of(Preload)
    shortening = preload.shortening_at(by_force.model.statement, 0.0)
    by_length = alone(bar(preload=[section | {"shortening": shortening}], **more))
    bounds = by_force.error_bound, by_length.error_bound
    assert bounds[0].error == pytest.approx(bounds[1].error, rel=1e-5)
    assert "with the computed shortenings" in str(bounds[0])
    assert "shortenings" not in str(bounds[1])


@pytest.mark.parametrize(
    ("more", "reason"),
    [
        ({"springs": {"boundary": "bottom", "normal": 2.0}}, "neither springs nor friction are at it"),
        (
            {"contact": {"boundary": "bottom", "friction": {"law": "tresca", "bound": 0.1}}},
            "neither springs nor friction are at it",
        ),
        ({"mesh": {"generator": "rectangle", "parameters": {"length": SPAN, "height": 1.0, "nx": 4, "ny": 2}},
          "element": {"degree": 2}}, "on simplices and quadrilaterals of degree 1"),
    ],
)  # fmt: skip
def test_what_has_no_bound(more, reason):
    """Springs and friction at the section, which see one of its sides, and quadrilaterals of degree 2."""
    assert reason in alone(bar(**more)).error_bound


def test_a_boundary_that_the_section_crosses_has_no_mean():
    """Its displacement jumps there."""
    assert "a preloaded section is at 'top'" in alone(bar()).mean_displacement_bounds("top", (0.0, 1.0))
