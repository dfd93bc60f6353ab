"""Features together, drawn at random: whatever the way, the answer is that of the plainest one."""

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from products import Product
from ranks import same_on_all_ranks
from scenes import table_of

from signorini_fx.records import Status

WORLD = MPI.COMM_WORLD
SEEDS = range(10)


def agree(seed, folder):
    """Status, tractions, displacements and forces of the product are those of the plain way, to
    1e-8.
    """
    product = Product.drawn(seed)
    ours, theirs = product.solved(WORLD, Path(WORLD.bcast(str(folder)))), product.plainly()
    assert same_on_all_ranks(ours.status) is theirs.status is Status.CONVERGED
    assert ours.certificate.holds
    assert [step.place for step in ours.steps] == pytest.approx(
        [step.place for step in theirs.steps], rel=1e-12
    )
    table, wanted = table_of(ours).columns, table_of(theirs).columns
    names = [name for name in wanted if name.startswith(("pressure", "shear"))]
    for group in (names, [name for name in wanted if name.startswith("u_")]):
        size = max(np.abs(wanted[name]).max() for name in group)
        for name in group:
            np.testing.assert_allclose(
                table[name], wanted[name], rtol=0, atol=1e-8 * size, err_msg=name
            )
    return product


@pytest.mark.slow
@pytest.mark.mpi(slow=True)
@pytest.mark.parametrize("seed", SEEDS, ids=lambda seed: f"{seed} {Product.drawn(seed).name}")
def test_products(seed, tmp_path):
    """On any number of ranks."""
    agree(seed, tmp_path)
