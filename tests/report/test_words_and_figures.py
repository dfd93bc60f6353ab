"""Words and figures of a report that an engineer would stumble over: units, digits, what is told of
which state.
"""

import re

import pytest

from signorini_fx.addons.report import sections
from signorini_fx.quantities.shown import all_shown, shown_lines


def texts_of(markup):
    return re.sub("<[^>]*>", "", str(markup))


def lines_of(key, summary):
    return list(
        map(str, shown_lines(next(shown for shown in all_shown() if shown.key == key), summary))
    )


@pytest.mark.parametrize(("law", "rubs"), [("none", False), ("coulomb", True)])
def test_no_friction_no_figures_of_it(law, rubs):
    summary = {
        "dimension": 2,
        "max_shear": 0.0,
        "contact_force": [0.0, 20.0],
        "friction_force": [0.0, 0.0],
    }
    summary["scene"] = {
        "material": [{}],
        "contact": [{"boundary": "bottom", "friction": {"law": law}}],
    }
    assert ("friction" in lines_of("contact_force", summary)[0]) == rubs
    assert bool(lines_of("max_shear", summary)) == rubs


def test_what_happened_is_in_the_report():
    """Once each; the advice of *slides at the contact pressures found* refers to the share that
    friction carries.
    """
    summary = {
        "algorithm": "fp",
        "linear_solves": 3,
        "factorisations": 1,
        "events": ["friction carries at most 0.99 of the loads"] * 2,
    }
    shown = texts_of(sections.history(summary))
    assert shown.count("friction carries at most 0.99 of the loads") == 1


def test_the_limit_of_a_bond_is_infinite():
    """In a file it is null."""
    row = {
        "boundary": "pad",
        "area": 3.0,
        "contact_area": 3.0,
        "mean_pressure": 1.0,
        "pressure_integral": 3.0,
    }
    row |= {
        "tangential_force": 0.5,
        "friction_limit": None,
        "friction_moment": None,
        "moment_limit": None,
    }
    assert "friction         pad: 0.5, bonded" in "\n".join(
        lines_of("contact_boundaries", {"contact_boundaries": [row]})
    )
