"""Words and figures of a report that an engineer would stumble over: units, digits, what is told of which state."""

import math
import re
from types import SimpleNamespace

import pytest

from signorini_fx.addons.pictures.fields import FIELDS
from signorini_fx.addons.report import evidence, sections
from signorini_fx.mechanics.statement.units import labelled
from signorini_fx.quantities.digits import between, figure
from signorini_fx.quantities.shown import shown_cards, table
from signorini_fx.results.accuracy.next_accuracy import between as times

MEGAPASCAL = {"length": "mm", "stress": "MPa", "force": "N", "area": "mm²", "moment": "N mm", "energy": "N mm"}


def heads(table):
    return re.findall("<th[^>]*>([^<]*)</th>", str(table))


def texts_of(markup):
    return re.sub("<[^>]*>", "", str(markup))


def card_of(key, summary):
    return shown_cards(next(shown for shown in table() if shown.key == key), summary)


@pytest.mark.parametrize(
    ("vector", "error", "text"),
    [
        ([-2296.2963, 0.0, 37037.01], None, "(-2296, 0, 37040)"),
        ([3.0, 0.52163], None, "(3, 0.5216)"),
        ([1e-9, 20.0], None, "(0, 20)"),  # not known beside the other one
        ([-2296.2963, 0.0, 37037.01], 0.003, "(-2300, 0, 37000)"),  # the estimate is of the vector
    ],
)
def test_a_small_component_keeps_its_digits(vector, error, text):
    """Where nothing is known of its error it is the same figure alone and beside a large one."""
    assert figure(vector, error) == text


def test_two_stresses_that_agree_do_not_make_digits():
    """Four as of every figure without an estimate."""
    stress = {"von_mises": {"value": 121.6742}, "recovered": {"von_mises": {"value": 121.6738}}}
    assert figure(121.6742, between(stress)) == "121.7"
    assert between({**stress, "recovered": {"von_mises": {"value": 118.0}}}) == pytest.approx(0.0302, abs=1e-4)


def test_captions_have_no_signs_of_formulas():
    """They are no TeX; the label at the colour bar is."""
    assert FIELDS["around"].label == "displacement $u_z$ around the axis"
    assert FIELDS["around"].in_words == "displacement uz around the axis"
    assert not any(sign in field.in_words for field in FIELDS.values() for sign in "$_\\")


@pytest.mark.parametrize(("law", "rubs"), [("none", False), ("coulomb", True)])
@pytest.mark.parametrize("dimension", [2, 3])
def test_no_friction_no_figures_of_it(law, rubs, dimension):
    """Neither in the table of boundaries nor among the figures."""
    row = {"boundary": "bottom", "area": 3.0, "contact_area": 1.3, "pressure_integral": 20.0, "mean_pressure": 15.4}
    row |= {
        "contact_force": [0.0, 20.0],
        "friction_force": [0.0, 0.0],
        "friction_limit": 6.0 * rubs,
        "friction_moment": None,
        "moment_limit": None,
    }
    summary = {"dimension": dimension, "contact_boundaries": [row], "max_shear": 0.0}
    summary |= {"contact_force": [0.0, 20.0], "friction_force": [0.0, 0.0]}
    summary["scene"] = {"material": [{}], "contact": [{"boundary": "bottom", "friction": {"law": law}}]}
    shown = heads(sections.forces(summary))
    assert ("friction force" in shown) == ("friction limit" in shown) == rubs
    assert ("length" in shown, "area" in shown) == (dimension == 2, dimension == 3)
    assert bool(card_of("friction_force", summary)) == bool(card_of("max_shear", summary)) == rubs


def test_areas_have_a_unit():
    """In 3D, as all other columns have."""
    summary = {"areas": {"contact": 2.0, "stick": 1.0, "slip": 1.0}, "contact_boundaries": [], "scene": {}}
    with labelled(MEGAPASCAL):
        assert heads(sections.forces(summary)) == ["all boundaries", "area (mm²)"]


def test_the_place_of_the_share_has_a_unit():
    """As that of the stress has."""
    place = {"value": 0.5, "place": [16.5, 10.0], "region": None, "no_limit": None}
    summary = {"utilisation": place, "stress": {"von_mises": {**place, "value": 20.0}}}
    with labelled(MEGAPASCAL):
        (card,) = card_of("utilisation", summary)
    assert card.remark == "at (16.5, 10) mm"


def test_energies_of_a_bound_have_a_unit():
    """Their statement is made where no unit is known."""
    bound = {"relative_error": 0.01, "guaranteed": True, "statement": "at most 1 %; strain energy between 1 and 2"}
    summary = {"certificate": {"holds": True, "equilibrium": 1e-12}, "error_bound": bound}
    with labelled(MEGAPASCAL):
        assert texts_of(evidence.certificate(summary)).endswith("between 1 and 2. Energies are in N mm.")
    assert texts_of(evidence.certificate(summary)).endswith("between 1 and 2.")


def test_a_figure_that_is_no_number_is_called_so():
    """Beside 'violated', instead of nothing."""
    shown = texts_of(evidence.certificate({"certificate": {"holds": False, "equilibrium": math.nan, "supports": 0.0}}))
    assert "not finiteviolated" in shown


def test_what_happened_is_in_the_report():
    """Once each; the advice of *slides at the contact pressures found* refers to the share that friction carries."""
    summary = {"algorithm": "fp", "linear_solves": 3, "events": ["friction carries at most 0.99 of the loads"] * 2}
    shown = texts_of(evidence.history(summary, SimpleNamespace(picture=lambda name: None)))
    assert shown.count("friction carries at most 0.99 of the loads") == 1


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        ((0.001, 0.002), "below 0.01 s"),
        ((0.001, 0.04), "up to 0.04 s"),
        ((0.01, 0.04), "0.01 to 0.04 s"),
        ((2.0, 2.0), "about 2 s"),
        ((9.6, 21.0), "10 to 21 s"),  # and not 1e+01
    ],
)
def test_times_from_and_to(seconds, text):
    """A lower end that nobody can tell from nothing is none."""
    assert times(seconds) == text
