"""The list of mistakes fits the code: each replaces text that is there exactly once, by something that compiles."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent.parent))

from stability.mutants import MUTANTS, QUICK, ROOT, TESTS


@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda mutant: f"{mutant.file}: {mutant.idea}")
def test_mutant_fits(mutant):
    """See ``make mutants``."""
    text = (ROOT / "signorini_fx" / mutant.file).read_text(encoding="utf-8")
    assert text.count(mutant.old) == 1
    spoilt = text.replace(mutant.old, mutant.new)
    assert spoilt != text
    compile(spoilt, mutant.file, "exec")


def test_list():
    """Enough of them, in every module of the method; the tests that are to notice exist."""
    assert len(MUTANTS) >= 25
    assert len({mutant.file for mutant in MUTANTS}) >= 15
    assert len({(mutant.file, mutant.old, mutant.new) for mutant in MUTANTS}) == len(MUTANTS)
    assert set(QUICK) <= set(MUTANTS)
    assert all((ROOT / "tests" / f"test_{test}.py").exists() for test in TESTS)
