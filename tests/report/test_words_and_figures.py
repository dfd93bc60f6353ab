"""Words and figures of a report that an engineer would stumble over: units, digits, what is told of which state."""

import re

import pytest

from signorini_fx.addons.report import evidence, sections
from signorini_fx.quantities.digits import figure
from signorini_fx.quantities.shown import shown_cards, table


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


def test_what_happened_is_in_the_report():
    """Once each; the advice of *slides at the contact pressures found* refers to the share that friction carries."""
    summary = {"algorithm": "fp", "linear_solves": 3, "events": ["friction carries at most 0.99 of the loads"] * 2}
    shown = texts_of(evidence.history(summary))
    assert shown.count("friction carries at most 0.99 of the loads") == 1
