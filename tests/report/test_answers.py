"""The first lines after every outcome, and of everything that may be known: true, and no figure where there is none.

What must be said follows here from the entries of the summary alone, in other words than those of the package.
"""

import math
import random
import re
from pathlib import Path

import pytest
import summaries_of_outcomes as page

from signorini_fx.quantities.answers import answers
from signorini_fx.records import Status
from signorini_fx.results.short_answer import short_answer

SOLVED = (
    "converged",
    "budget ends before the accuracy",
    "memory ends before the accuracy",
    "accuracy out of reach",
    "solved on a coarser mesh only",
)
PROVED = ("body not held", "contact opens", "tips over", "slides, no static")
# Figures of the summaries: von Mises stress and its place, pressure, share of the yield stress.
FIGURES = re.compile(r"\b(96|93|1\.25|31\.8|41 %|125 %|28\.0 times|far above|4\.3 %|8 %)")
# How the yield stress is exceeded: no figure where it has no limit, and no per cent far above it.
EXCEEDED = {"125 %": "125 %", "28 times": "28.0 times", "far above": "far above"}
MOST = 1500


@pytest.fixture(scope="module")
def drawn():
    """Some of all products, another choice of them for each outcome."""
    every = list(page.all_products())
    assert len(every) == len(Status) * 2 * math.prod(
        map(len, (page.STRENGTHS, page.STATICS, page.ERRORS, page.LAWS, page.COMPLETE))
    )
    return random.Random(4).sample(every, MOST)


def told(summary):
    return [(answer.text, "; ".join([answer.text, *answer.details])) for answer in answers(summary)]


@pytest.mark.slow
def test_every_answer_is_true(drawn):
    """Whether it holds, from status, certificate, strength and what is left out; the others from what is known."""
    for status, step, (strength, statics, error, law, complete), summary in drawn:
        solved = status.value in SOLVED
        earlier = step and not solved
        (holds, why), (left, limits), (place, stress), (_, sure) = told(summary)
        about = (status, step, strength, statics, error, law, complete)
        beyond = next((how for name, how in EXCEEDED.items() if strength.startswith(name)), "")
        if complete == "incomplete":
            assert holds == "not known", about
        elif not (solved or earlier):
            assert holds == ("no" if status.value.startswith(PROVED) else "not known"), about
        elif beyond:
            assert holds == "no, it would yield", about
        elif earlier:
            assert holds == "up to load step 3 (time 0.75)", about
        elif strength == "41 % at a corner":
            assert holds == "in balance; strength not shown", about
        else:
            assert holds == "yes", about
        if beyond and (solved or earlier):
            assert left.startswith(f"nothing: {beyond}"), about
        used = "far above the yield stress" if beyond == "far above" else "41 % of the yield stress used"
        corner = r"on this mesh, at a reentrant corner of the body; the stress has no limit there"
        reserved = bool(re.search(rf"{used}( at load step [34] .*)? {corner}", why))
        of_strength = (solved or earlier) and complete == "whole"
        assert reserved == (of_strength and strength.endswith("at a corner")), about
        assert ("judge it at a distance" in why) == reserved, about
        assert "judge it at a distance" not in limits, about
        assert not re.search(r"\d{4} %", f"{why} {limits}"), about
        assert ("supports hold it" in limits) == (statics == "supports" and solved), about
        assert ("friction used: 37 %" in limits) == (statics == "friction used" and solved), about
        if not (solved or earlier):
            assert ("there is no solution" in stress) == status.value.startswith(PROVED), about
            assert (left == "nothing") == (status.value.startswith(PROVED) and complete == "whole"), about
        assert place.startswith("at (") == (strength != "no fields" and (solved or earlier)), about
        told_by_stress = error == "of the stress" and status.value not in SOLVED[1:]
        if solved or earlier:
            assert ("8 % in the mean, estimated" in sure) == told_by_stress, about
            assert ("not estimated" in sure) == (error == "none" and status.value not in SOLVED[1:]), about
        assert ("guaranteed" in sure) == (error == "guaranteed" and (solved or earlier)), about
        if complete == "whole" and solved and law == "another one" and not beyond:
            assert "not with the contact law that was asked for" in why, about
        assert ("'alm' was not reached" in sure) == (law == "another one" and (solved or earlier)), about


def test_no_figure_without_a_solution(drawn):
    """Neither in the answers nor on the terminal."""
    seen = 0
    for status, step, _, summary in drawn:
        if status.value in SOLVED or step:
            continue
        lines = "\n".join(map(str, short_answer(summary, Path("results"))))
        text = " ".join(said for _, said in told(summary))
        assert not FIGURES.search(text), text
        assert not FIGURES.search(lines), lines
        seen += 1
    assert seen > 100


def said_of(lines, label):
    """What the terminal says behind a label, line by line."""
    labels = [line[:14].strip() for line in lines]
    if label not in labels:
        return []
    first = labels.index(label)
    following = next((k for k in range(first + 1, len(lines)) if labels[k]), len(lines))
    return [line[14:].strip() for line in lines[first:following]]


def test_terminal_and_exit_code(drawn):
    """Ten short lines, more where what to do takes them, which is whole, and there unless it is a solution; what is
    used of the yield stress is never cut.
    """
    for status, step, (strength, _, _, law, complete), summary in drawn:
        lines = list(map(str, short_answer(summary, Path("results/scene"))))
        labels = [line[:14].strip() for line in lines]
        advised = said_of(lines, "what to do")
        assert " ".join(advised) == ("" if summary["converged"] else " ".join(summary["advice"].split()))
        assert len(lines) <= max(10, len(advised) + 9)
        assert max(map(len, lines)) <= 80
        figures = status.value in SOLVED or step
        good = status is Status.CONVERGED
        assert ("what to do" in labels) == (not good)
        assert ("certificate" in labels) == figures
        assert ("stress" in labels) == (figures and strength != "no fields")
        for name, how in EXCEEDED.items():
            if figures and strength.startswith(name):
                assert any(f"{how}{' of' * ('%' in how)} yield" in line for line in lines)
        assert any("'alm' was not reached" in line for line in lines) == (law == "another one"), lines
        assert (page.code(summary) == 0) == (good and complete == "whole")
        assert (page.code(summary) == 1) == (not good)
        assert ("incomplete" in lines[0]) == (complete == "incomplete")


@pytest.mark.parametrize(("raw", "recovered"), [(96.0, 93.0), (93.0, 96.0), (96.0, None)])
def test_larger_one_of_two_stresses(raw, recovered):
    """In the answer, and on the terminal with its place."""
    entries = {"raw": (raw, [1.0, 0.0]), "recovered": (recovered, [2.0, 0.0])}
    extremes = {
        name: {"von_mises": {"value": value, "place": place, "region": None, "no_limit": None}}
        for name, (value, place) in entries.items()
    }
    stress = {**extremes["raw"], "recovered": extremes["recovered"], "error": None}
    summary = page.known(stress=stress)
    where = "(2, 0)" if recovered == 96.0 else "(1, 0)"
    text, details = told(summary)[2]
    assert text == f"at {where}"
    assert "von Mises stress 96" in details
    (line,) = (str(line) for line in short_answer(summary, Path("results")) if str(line).startswith("  stress"))
    assert "von Mises 96" in line
    assert line.endswith(f"at {where}")


NONLINEAR_ANSWERS = [
    ("neo-hooke", {"utilisation": None}, "strength is not judged: no yield stress is known of such a material"),
    ("j2", {"utilisation": None, "plastic_strain": {"value": 0.0, "place": [1.0, 0.0]}}, "nothing has yielded"),
    (
        "j2",
        {"utilisation": None, "plastic_strain": {"value": 0.0123, "place": [1.0, 0.0], "region": "web"}},
        "it has yielded, to a plastic strain of 0.0123 at (1, 0) in web; how much more it bears is not judged",
    ),
    ("j2", {"utilisation": None, "stress": None}, "strength is not judged: no fields were written, leave --no-fields"),
]


@pytest.mark.parametrize(("law", "changes", "text"), NONLINEAR_ANSWERS)
def test_strength_of_nonlinear_scenes(law, changes, text):
    """A metal that yields has no share of its yield stress: its plastic strain is what is known."""
    summary = page.known(algorithm="newton, ssn", **changes)
    summary["scene"] = {"material": [{"law": law} | ({"yield_stress": 300.0} if law == "j2" else {})]}
    said = [why for _, why in told(summary)]
    assert text in said[0]
    assert ("von Mises stress" in said[2]) == ("stress" not in changes)
