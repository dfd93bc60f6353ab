"""Bounds of bodies with preloaded sections: true errors, exact states, and what the strain of a jump is for."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tightened_scenes
from loaded_scenes import effectivity
from scenes import alone
from spaces import box

from signorini_fx.addons.bounds import plain_scene
from signorini_fx.addons.bounds.error_bound import Bounded
from signorini_fx.addons.bounds.plain_scene import PlainProblem
from signorini_fx.addons.bounds.stress_products import energy
from signorini_fx.scenes.reading import parse_scene

SCENES = Path(__file__).parents[2] / "demos" / "scenes"
SLOW, LONG = pytest.mark.slow, pytest.mark.long
YOUNG, SPAN, SHORTER, TENSION = 100.0, 2.0, 0.01, 0.4


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


@pytest.mark.parametrize(
    ("family", "seeds"),
    [
        ("walls", (0,)),
        pytest.param("walls", range(1, 8), marks=SLOW),
        pytest.param("hammer", range(6), marks=SLOW),
        pytest.param("two", range(4), marks=SLOW),
        pytest.param("space", (1,), marks=SLOW),
    ],
)
def test_true_errors_where_forces_tighten_sections(family, seeds):
    """Finer solutions with the same force refute no interval of the strain energy or of a force."""
    known = 0
    for seed in seeds:
        found = tightened_scenes.effectivity(family, seed)
        if isinstance(found, str):
            assert "way out of the foundation" in found or "push the body into its foundation" in found
            continue
        known += 1
        assert found[2] == []
        assert 1 < found[0] < 6
    assert known > len(seeds) / 2


def tightened(cell="triangle", **more):
    """The bar with a section in its middle that a force tightens, under a body force along it; contact is far away."""
    return bar(
        cell,
        degree=1 if cell == "quadrilateral" else 2,
        preload=[{"point": [SPAN / 2, 0.0], "axis": [-1.0, 0.0], "force": TENSION}],
        contact={"boundary": "bottom", "gap": 10.0},
        **more,
    )


def test_a_bar_that_a_force_tightens():
    """The tension at x is N + f (L / 2 - x): bounds are equal to what they bound."""
    solution, force = alone(tightened(body_force={"x": 0.1})), 0.1
    bound = solution.error_bound
    ends = [TENSION + force * SPAN / 2, TENSION - force * SPAN / 2]
    energy = SPAN * (ends[0] ** 2 + ends[0] * ends[1] + ends[1] ** 2) / (6 * YOUNG)
    assert bound.error < 1e-5 * bound.size
    assert bound.strain_energy == pytest.approx((energy, energy), rel=1e-4)
    assert "shortenings" not in str(bound)
    for boundary, pull in zip(("left", "right"), (-ends[0], ends[1]), strict=True):
        low, high = solution.force_bounds(boundary, (1.0, 0.0))
        assert high - low < 1e-8 * TENSION
        assert low - 1e-12 <= pull <= high + 1e-12
    # The wall moves nothing: what is on the left of the section moves towards it.
    low, high = solution.mean_displacement_bounds("left", (1.0, 0.0))
    assert low <= 0 <= high < 1e-6


@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
def test_a_shortening_that_the_force_does_not_lead_to(monkeypatch, cell):
    """The error of a displacement with another one is bounded, and for this bar exactly; before, it was not seen."""
    solution, made = alone(tightened(cell)), plain_scene.preloaded_sections
    monkeypatch.setattr(
        plain_scene,
        "preloaded_sections",
        lambda *of: [replace(section, amount=1.1 * section.amount) for section in made(*of)],
    )
    error = 0.1 * TENSION * np.sqrt(SPAN / YOUNG)
    found = Bounded(solution.model, solution.displacement, solution.contact, 0.0)
    # The displacement itself is still that of the right shortening: its strain lacks a tenth of the jump.
    strain = found.strained(found.y, found.middle)
    exact = TENSION / YOUNG
    true = np.sqrt(energy(found.t, strain - np.array([exact, 0.0, 0.0])).sum())
    assert true > error
    assert found.bound().error == pytest.approx(true, rel=1e-5)


@pytest.mark.parametrize("factor", [1.0, 1.02, 0.98])
def test_a_tension_that_is_wrong(monkeypatch, factor):
    """Seen with another one, the force of the wall is refuted."""
    solution, made = alone(tightened()), plain_scene.preloaded_sections
    monkeypatch.setattr(
        plain_scene,
        "preloaded_sections",
        lambda *of: [replace(section, force=factor * section.force) for section in made(*of)],
    )
    low, high = solution.force_bounds("right", (1.0, 0.0))
    assert (low - 1e-12 <= TENSION <= high + 1e-12) == (factor == 1)


@pytest.mark.parametrize("family", ["hammer", "two"])
def test_a_tension_that_contact_balances(family):
    """The head of a hammer presses on its foundation with the tension and its load, whatever the stiffness is."""
    solution = alone(tightened_scenes.drawn(family, 1))
    case = Bounded(solution.model, solution.displacement, solution.contact, 0.0)
    assert case.loose.piece.size == 1
    load = float(case.loads.traction[..., 1].mean(axis=1) @ case.t.area)
    low, high = solution.force_bounds("under", (0.0, 1.0))
    (section,) = case.tightened
    assert high - low < 1e-8 * section.force
    assert low - 1e-9 * section.force <= section.force - load <= high + 1e-9 * section.force


@pytest.mark.slow
def test_a_bolt_that_contact_alone_holds(tmp_path):
    """Head and nut press on the plates with its tension, by statics; nodes of these contacts are moved for it."""
    drawing = (SCENES / "bolted_joint.geo").read_text(encoding="utf-8")
    (tmp_path / "joint.geo").write_text(drawing.replace("fine = 0.5", "fine = 2"), encoding="utf-8")
    pairs = (("over", "head"), ("under", "nut"), ("joint above", "joint below"))
    solution = alone(
        parse_scene(
            {
                "mesh": {"file": str(tmp_path / "joint.geo")},
                "material": {"young": 210e3, "poisson": 0.3},
                "displacement": [
                    {"boundary": "axis", "x": 0.0},
                    {"boundary": "end below", "x": 0.0, "y": 0.0},
                    {"boundary": "end above", "x": 0.0},
                ],
                "traction": {"boundary": "end above", "y": 0.5},
                "contact": [{"boundary": one, "against": other} for one, other in pairs],
                "preload": {"region": "bolt", "point": [0.0, 0.3], "axis": [0.0, 1.0], "force": 200.0},
            }
        )
    )
    case = Bounded(solution.model, solution.displacement, solution.contact, 0.0)
    assert case.moved_nodes > 0
    assert case.loose.piece.size == 1
    assert solution.error_bound.relative < 1
    for boundary, pressed in (("over", -200.0), ("under", 200.0)):
        low, high = solution.force_bounds(boundary, (0.0, 1.0))
        assert low < pressed < high


def test_what_a_force_has_led_to_is_kept():
    """In later load steps the shortening is given; that the error of the computed one is not bounded is said."""
    section = {"point": [0.7, 0.0], "axis": [1.0, 0.0], "force": TENSION}
    more = {"contact": {"boundary": "bottom", "gap": 0.001}, "load_steps": {"names": ["tighten", "press"]}}
    load = {"boundary": "top", "y": -0.2, "factors": [0.5, 1.0]}
    solution = alone(bar(preload=[section], traction=load, **more))
    assert "sections that a force has tightened before, whose errors are not bounded" in str(solution.error_bound)
    assert len(Bounded(solution.model, solution.displacement, solution.contact, 1.0).tightened) == 0


def test_the_work_of_loads_beyond_a_section():
    """A force per volume f along the bar works on its own displacement, f L^3 / (12 E), and on that of the shortening s
    at x_0, whose mean is s (x_0 / L - 1 / 2)."""
    force, place = 0.1, 0.5
    section = {"point": [place, 0.0], "axis": [1.0, 0.0], "shortening": SHORTER}
    solution = alone(bar(degree=2, preload=[section], body_force={"x": force}))
    work = force * (force * SPAN**3 / (12 * YOUNG) + SHORTER * (place - SPAN / 2))
    low, high = solution.error_bound.work
    assert high - low < 1e-6 * abs(work)
    assert low <= work <= high


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
