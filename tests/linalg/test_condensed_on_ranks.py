"""Condensed systems on several ranks: what one rank gets, from as many linear solves."""

import numpy as np
import pytest
import scipy.sparse as sp
from mpi4py import MPI
from petsc4py import PETSc
from scenes import example1
from test_ranks import agree, same_on_all_ranks

from signorini_fx import solve
from signorini_fx.algebra.linalg import partial_factor
from signorini_fx.algebra.linalg.schur import SchurComplement
from signorini_fx.machine import parallel

pytestmark = pytest.mark.mpi
WORLD = MPI.COMM_WORLD


def distributed(dense, own):
    """A sparse matrix of which each rank has so many rows."""
    first = parallel.rows_before(WORLD, own)
    rows = sp.csr_array(dense[first : first + own])
    csr = (rows.indptr.astype(PETSc.IntType), rows.indices.astype(PETSc.IntType), rows.data)
    return PETSc.Mat().createAIJ(((own, None), (own, None)), csr=csr, comm=WORLD), slice(first, first + own)


@pytest.mark.parametrize("empty", [False, True], ids=["", "the first rank has nothing"])
@pytest.mark.parametrize("touched", [(31, 0, 17, 5, 59), (2, 3)])
def test_schur_complement(touched, empty):
    """Against dense algebra: ranks that couple everywhere, an unknown that couples with nothing but the border, loads
    of very different sizes, in odd units."""
    generator = np.random.default_rng(len(touched))
    half = generator.normal(size=(60, 60)) * (generator.random((60, 60)) < 0.03)
    sizes = np.diff(np.linspace(0, 60, WORLD.size + 1 - (empty and WORLD.size > 1)).astype(int))
    edge, unpaired = min(sizes[0], 59) - 1, touched[-2]
    half[unpaired] = half[:, unpaired] = 0.0
    half[edge, [edge + 1, unpaired]] = 1.0
    dense = 1e-9 * (half + half.T + 20 * np.eye(60))
    own = [0, *sizes][WORLD.rank] if empty and WORLD.size > 1 else sizes[WORLD.rank]
    matrix, here = distributed(dense, own)
    retained = np.sort(touched)
    inside = np.setdiff1d(np.arange(60), retained)
    loads = [generator.normal(size=60) * (generator.random(60) < 0.5) * size for size in (1e9, 1e-12, 0.0)]
    mine = retained[(here.start <= retained) & (retained < here.stop)] - here.start
    found = SchurComplement(matrix, mine, [load[here] for load in loads])
    lift = np.linalg.solve(dense[np.ix_(inside, inside)], dense[np.ix_(inside, retained)])
    expected = dense[np.ix_(retained, retained)] - dense[np.ix_(retained, inside)] @ lift
    np.testing.assert_allclose(found.dense, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    x = np.zeros(60)
    x[retained] = generator.normal(size=retained.size)
    for number, load in enumerate([*loads, np.ones(60)]):
        right = matrix.createVecRight()
        right.getArray()[:] = load[here]
        reference, tolerance = load[retained] - lift.T @ load[inside], 1e-12 * np.abs(load).max()
        ways = [found.condense(right)]
        if number < len(loads):
            ways.append((found.loads[number], found.between[number]))
        x[inside] = np.linalg.solve(
            dense[np.ix_(inside, inside)], load[inside] - dense[np.ix_(inside, retained)] @ x[retained]
        )
        for condensed, between in ways:
            np.testing.assert_allclose(condensed, reference, rtol=0, atol=tolerance)
            every = found.recover(right, between, x[here][mine]).getArray()
            np.testing.assert_allclose(every, x[here], rtol=0, atol=1e-12 * np.abs(x).max())


LONG = {"nx": 320, "ny": 3, "linear_algebra": "condensed", "patch": "auto", "bound": 1.5}
SCENES = {
    "many nodes": example1(**LONG),
    "degree 2": example1(**LONG | {"degree": 2, "nx": 160}),
    "without regularisation": example1(**LONG | {"nx": 60, "algorithm": "alm"}),
    "newton": example1(**LONG | {"nx": 60, "bound": None, "coefficient": 0.3, "coulomb": "newton"}),
}


@pytest.mark.one_quick
@pytest.mark.parametrize("name", SCENES)
def test_one_body(name):
    """Sets, tractions, energy, certificate."""
    found = agree(SCENES[name])
    assert same_on_all_ranks(found.linear_algebra) == "condensed: as asked for"


def test_a_rank_that_cannot_condense(monkeypatch):
    """One rank has no memory for its factor: all of them take the full system, and none waits for it."""
    scene = example1(bound=1.5, nx=96, ny=32, linear_algebra="condensed")
    expected = solve(scene, WORLD)
    assert expected.linear_algebra.startswith("condensed")
    if WORLD.rank == WORLD.size - 1:
        monkeypatch.setattr(partial_factor, "_MEMORY", ((23, 1),))  # one megabyte
    found = solve(scene, WORLD)
    assert found.linear_algebra == "full: MUMPS could not condense the system"
    np.testing.assert_allclose(found.contact.forces, expected.contact.forces, rtol=0, atol=1e-8)
