"""Tables 1 and 3 of the paper, every entry (data/tables.json holds the printed numbers)."""

import json
from functools import partial
from pathlib import Path

import pytest
from scenes import PATCH, PATCH_AT_THE_END, alone, example1

PRINTED = json.loads((Path(__file__).parents[1] / "data" / "tables.json").read_text())
STARTS = {"symmetric": PATCH, "nonsymmetric": PATCH_AT_THE_END}
GRIDS = [(60, 20), (120, 40), (240, 80)]


def linear_solves(**scene):
    """Linear solves inside (SSN): with a patch the first of them already counts."""
    return len(alone(example1(**scene)).history.iterations)


def table_1(sigma):
    """Iterations for 36 pairs (gamma_1, gamma_2)."""
    table = PRINTED["table1"]
    found = [
        [linear_solves(bound=1.5, gamma=(gamma_n, gamma_t), patch=PATCH, sigma=sigma) for gamma_t in table["gamma_2"]]
        for gamma_n in table["gamma_1"]
    ]
    assert found == table["iterations"]


def table_3(nx, ny, start, sigma):
    """Iterations on one of three grids from one of two starts, for five gammas."""
    table = PRINTED["table3"]
    found = [
        linear_solves(poisson=0.49, bound=2.5, gamma=gamma, nx=nx, ny=ny, patch=STARTS[start], sigma=sigma)
        for gamma in table["gamma"]
    ]
    assert found == table[f"{nx}x{ny}"][start]


@pytest.mark.slow
@pytest.mark.parametrize(
    "table",
    [partial(table_1, 1.0), *(partial(table_3, *g, s, 1.0) for g in GRIDS for s in STARTS)],
    ids=["1", *(f"3, {nx} x {ny}, {start}" for nx, ny in GRIDS for start in STARTS)],
)
def test_another_sigma(table):
    """The same iterations."""
    table()
