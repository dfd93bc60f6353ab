"""docs/contactbench.md is written from the problems and from the table of what was run, in which nothing is missing."""

import sys
from pathlib import Path

import pytest

from contactbench.adapters import ADAPTERS
from contactbench.judging import distance
from contactbench.problem import problem_names, read_problem

sys.path.append(str(Path(__file__).parents[2] / "docs"))

import references


def test_the_page_is_of_the_table():
    """`./env python3 docs/references.py` writes it; every problem is on it."""
    text = references.PAGE.read_text(encoding="utf-8")
    assert text == references.page(references.rows())
    assert all(f"[{name}](../contactbench/problems/{name}.toml)" in text for name in problem_names())
    assert "{" not in text
    for picture in ("unknowns", "seconds"):
        assert (references.DOCS / "images" / f"contactbench_{picture}.png").exists()


def test_errors_are_those_of_the_values():
    """Errors and verdicts of the table follow from its values and the references of the files."""
    for row in references.rows():
        if row["meets"] in ("skipped", "failed"):
            assert len(row["note"]) > 10
            continue
        quantity = read_problem(row["problem"]).quantity(row["quantity"])
        error = distance(quantity, float(row["value"]))
        assert float(row["error"]) == pytest.approx(error, rel=2e-3, abs=2e-8)
        assert row["meets"] == ("yes" if float(row["error"]) <= quantity.tolerance else "no")
        assert int(row["unknowns"]) > 0
        assert float(row["seconds"]) >= 0


def test_every_program_on_every_problem():
    """Each was run, or says why not; whatever it is, no row is there twice."""
    rows = references.rows()
    ran = {(row["problem"], row["program"]) for row in rows}
    assert ran == {(name, program) for name in problem_names() for program in ADAPTERS}
    keys = [(row["problem"], row["program"], row["level"], row["quantity"]) for row in rows]
    assert len(set(keys)) == len(keys)


def test_the_package_meets_all_in_the_table():
    """On every mesh that was recorded, and its errors fall where the reference is exact."""
    own = [row for row in references.rows() if row["program"] == "signorini_fx"]
    assert {row["meets"] for row in own} == {"yes"}
    assert {row["level"] for row in own} == {"0", "1", "2"}
