"""Condensed systems on several ranks: what one rank gets, from as many linear solves."""

import numpy as np
import pytest
from mpi4py import MPI
from ranks import agree, same_on_all_ranks
from scenes import example1

from signorini_fx import solve
from signorini_fx.algebra.linalg import partial_factor

pytestmark = pytest.mark.mpi
WORLD = MPI.COMM_WORLD


LONG = {"nx": 320, "ny": 3, "linear_algebra": "condensed", "patch": "auto", "bound": 1.5}
SCENES = {
    "without regularisation": example1(**LONG | {"nx": 60, "algorithm": "alm"}),
    "newton": example1(**LONG | {"nx": 60, "bound": None, "coefficient": 0.3, "coulomb": "newton"}),
    "many nodes": example1(**LONG),
    "degree 2": example1(**LONG | {"degree": 2, "nx": 160}),
}


@pytest.mark.one_quick("name", SCENES)
def test_one_body(name):
    """Sets, tractions, energy, certificate."""
    found = agree(SCENES[name])
    assert same_on_all_ranks(found.linear_algebra) == "condensed: as requested"


def test_a_rank_that_cannot_condense(monkeypatch):
    """One rank has no memory for its factor: all of them take the full system, and none waits for
    it.
    """
    scene = example1(bound=1.5, nx=96, ny=32, linear_algebra="condensed")
    expected = solve(scene, WORLD)
    assert expected.linear_algebra.startswith("condensed")
    if WORLD.rank == WORLD.size - 1:
        monkeypatch.setattr(partial_factor, "_MEMORY", (23, 1))  # one megabyte
    found = solve(scene, WORLD)
    assert found.linear_algebra == "full: MUMPS could not condense the system"
    np.testing.assert_allclose(found.contact.forces, expected.contact.forces, rtol=0, atol=1e-8)
