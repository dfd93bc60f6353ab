"""What is printed after every outcome, and of everything that may be known: no figure where there
is none.
"""

import math
import random
import re
from pathlib import Path

import pytest
import summaries_of_outcomes as page

from signorini_fx.quantities.shown import short_answer
from signorini_fx.records import Status

SOLVED = (
    "converged",
    "budget ends before the accuracy",
    "memory ends before the accuracy",
    "accuracy out of reach",
    "solved on a coarser mesh only",
)
# Figures of the summaries: von Mises stress and its place, pressure, share of the yield stress.
FIGURES = re.compile(r"\b(96|93|1\.25|31\.8|41 %|125 %|28\.0 times|far above|4\.3 %|8 %)")
# How the yield stress is exceeded: no figure where it has no limit, and no per cent far above it.
EXCEEDED = {"125 %": "125 %", "28 times": "28 times", "far above": "far above"}
MOST = 1500


@pytest.fixture(scope="module")
def drawn():
    """Some of all products, another choice of them for each outcome."""
    every = list(page.all_products())
    assert len(every) == len(Status) * 2 * math.prod(
        map(len, (page.STRENGTHS, page.STATICS, page.ERRORS, page.LAWS, page.COMPLETE))
    )
    return random.Random(4).sample(every, MOST)


def test_no_figure_without_a_solution(drawn):
    seen = 0
    for status, step, _, summary in drawn:
        if status.value in SOLVED or step:
            continue
        lines = "\n".join(map(str, short_answer(summary, Path("results"))))
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


def test_terminal(drawn):
    """What to do is there unless it is a solution, and how much of the yield stress is used."""
    for status, step, (strength, _, _, law, complete), summary in drawn:
        lines = list(map(str, short_answer(summary, Path("results/scene"))))
        labels = [line[:14].strip() for line in lines]
        advised = said_of(lines, "what to do")
        assert " ".join(advised) == (
            "" if summary["converged"] else " ".join(summary["advice"].split())
        )
        assert max(map(len, lines)) <= 80
        figures = status.value in SOLVED or step
        good = status is Status.CONVERGED
        assert ("what to do" in labels) == (not good)
        assert ("certificate" in labels) == figures
        assert ("stress" in labels) == (figures and strength != "no fields")
        for name, how in EXCEEDED.items():
            if figures and strength.startswith(name):
                assert f"{how}{' of' * ('%' in how)} yield" in " ".join(said_of(lines, "stress"))
        assert ("in place of 'alm'" in " ".join(said_of(lines, "warning"))) == (
            law == "another one"
        ), lines
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
    (line,) = (
        str(line)
        for line in short_answer(summary, Path("results"))
        if str(line).startswith("  stress")
    )
    assert "von Mises 96" in line
    assert line.endswith(f"at {where}")
