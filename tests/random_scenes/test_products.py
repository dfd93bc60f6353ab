"""Features together, drawn at random: whatever the way, the answer is that of the plainest one."""

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from products import ALGEBRA, FEATURES, Product
from scenes import table_of
from test_ranks import same_on_all_ranks

from signorini_fx.records import Status

WORLD = MPI.COMM_WORLD
QUICK, MANY = range(10), range(10, 210)


def agree(seed, folder):
    """Status, tractions, displacements and forces of the product are those of the plain way, to 1e-8."""
    product = Product.drawn(seed)
    ours, theirs = product.solved(WORLD, Path(WORLD.bcast(str(folder)))), product.plainly()
    assert same_on_all_ranks(ours.status) is theirs.status is Status.CONVERGED
    assert ours.certificate.holds
    assert [step.place for step in ours.steps] == pytest.approx([step.place for step in theirs.steps], rel=1e-12)
    table, wanted = table_of(ours).columns, table_of(theirs).columns
    names = [name for name in wanted if name.startswith(("pressure", "shear"))]
    for group in (names, [name for name in wanted if name.startswith("u_")]):
        size = max(np.abs(wanted[name]).max() for name in group)
        for name in group:
            np.testing.assert_allclose(table[name], wanted[name], rtol=0, atol=1e-8 * size, err_msg=name)
    return product


@pytest.mark.slow
@pytest.mark.mpi(slow=True)
@pytest.mark.parametrize("seed", QUICK, ids=lambda seed: f"{seed} {Product.drawn(seed).name}")
def test_products(seed, tmp_path):
    """On any number of ranks."""
    agree(seed, tmp_path)


@pytest.mark.mpi
@pytest.mark.long
@pytest.mark.parametrize("seed", MANY)
def test_many_products(seed, tmp_path):
    """The same, many times."""
    agree(seed, tmp_path)


def test_every_pair_is_drawn():
    """All features, two at a time, with every linear algebra and law, but for those that clash."""
    products = [Product.drawn(seed) for seed in (*QUICK, *MANY)]
    pairs = {frozenset((a, b)) for one in products for a in one.features for b in one.features if a != b}
    assert len(pairs) == len(FEATURES) * (len(FEATURES) - 1) // 2 - 8
    assert {one.algebra for one in products[: len(QUICK)]} == set(ALGEBRA)
    assert set().union(*(one.features for one in products[: len(QUICK)])) == set(FEATURES)
    assert {one.law["law"] for one in products[: len(QUICK)]} == {"none", "tresca", "coulomb"}
