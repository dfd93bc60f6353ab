"""Dense tangents whose untouched unknowns are eliminated once, against NumPy's solution of the whole."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc
from scenes import example1

from signorini_fx import solve
from signorini_fx.linalg.condensed import dense_matrix
from signorini_fx.solving import untouched
from signorini_fx.solving.untouched import TangentFactor, UntouchedUnknowns

COUNT = 40
COMM = MPI.COMM_WORLD


@pytest.fixture
def elastic() -> np.ndarray:
    """Positive semi-definite: a rigid motion is free, as of a body that contact alone holds."""
    part = np.random.default_rng(0).normal(size=(COUNT, COUNT))
    part -= part.mean(axis=1, keepdims=True)
    return part.T @ part


def tangent(elastic: np.ndarray, points: Sequence[int], *, symmetric: bool) -> np.ndarray:
    """With a block of two unknowns of each of these points, as at slip with Coulomb friction if it has no symmetry, of
    every second one transposed.
    """
    found = elastic.copy()
    for point in points:
        block = np.array([[1e4, 0.0], [0.0, 1e4]] if symmetric else [[1e4, 0.0], [3e3, 0.0]])
        found[2 * point : 2 * point + 2, 2 * point : 2 * point + 2] += block.T if point % 2 else block
    return found


def solver(elastic: np.ndarray, *, symmetric: bool) -> tuple[PETSc.KSP, PETSc.Mat]:
    """With a matrix that may be changed between its solves, the first ranks with three unknowns less than the last."""
    own = COUNT // COMM.size - 3
    matrix = dense_matrix(COMM, elastic, own if COMM.rank < COMM.size - 1 else COUNT - own * COMM.rank)
    changing = matrix.duplicate(copy=True)
    ksp = PETSc.KSP().create(COMM)
    ksp.setOperators(changing)
    ksp.setType(PETSc.KSP.Type.PREONLY)
    ksp.getPC().setType(PETSc.PC.Type.PYTHON)
    ksp.getPC().setPythonContext(TangentFactor(UntouchedUnknowns(matrix, elastic), symmetric=symmetric))
    return ksp, changing


def change(matrix: PETSc.Mat, entries: np.ndarray) -> None:
    """Other entries: those of this rank."""
    matrix.getDenseArray()[:] = entries[slice(*matrix.getOwnershipRange())]
    matrix.assemble()


@pytest.mark.mpi
@pytest.mark.parametrize("symmetric", [True, False])
def test_solves_while_contact_changes(elastic: np.ndarray, symmetric: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """All points, fewer, one fewer, one other, others; unknowns are eliminated again only where they must be."""
    left: list[int] = []
    original = untouched._without
    monkeypatch.setattr(untouched, "_without", lambda *given: left.append(given[1].size) or original(*given))
    ksp, changing = solver(elastic, symmetric=symmetric)
    right, x = changing.createVecs()
    here, load = slice(*right.getOwnershipRange()), np.random.default_rng(1).normal(size=COUNT)
    right.getArray()[:] = load[here]
    for points in (range(20), range(8), range(7), [0, 1, 2, 3, 4, 5, 19], [10, 11]):
        whole = tangent(elastic, points, symmetric=symmetric)
        change(changing, whole)
        for solved, entries in ((ksp.solve, whole), (ksp.solveTranspose, whole.T)):
            solved(right, x)
            assert ksp.getConvergedReason() > 0
            expected = np.linalg.solve(entries, load)
            error = np.abs(x.getArray() - expected[here]).max(initial=0.0)
            assert error < 1e-9 * np.abs(expected).max(), points
    assert left == [40, 16, 14, 4]


@pytest.mark.mpi
def test_singular_is_a_failed_factor(elastic: np.ndarray) -> None:
    """Rows of zeros are not solved, and the next matrix is."""
    ksp, changing = solver(elastic, symmetric=True)
    empty = elastic.copy()
    empty[:2] = empty[:, :2] = 0.0
    change(changing, empty)
    right, x = changing.createVecs()
    right.set(1.0)
    ksp.solve(right, x)
    assert ksp.getConvergedReason() == PETSc.KSP.ConvergedReason.DIVERGED_PCSETUP_FAILED
    assert ksp.getPC().getFailedReason() == PETSc.PC.FailedReason.FACTOR_NUMERIC_ZEROPIVOT
    change(changing, tangent(elastic, [3], symmetric=True))
    ksp.solve(right, x)
    assert ksp.getConvergedReason() > 0
    changing.mult(x, right)
    assert np.abs(right.getArray() - 1.0).max() < 1e-9


@pytest.mark.mpi
def test_a_scene_is_solved_in_the_same_way(monkeypatch: pytest.MonkeyPatch) -> None:
    """Coulomb friction with and without the elimination: as many solves with the same sets, and the same result."""
    scene = example1(coefficient=0.3, nx=24, ny=8, linear_algebra="condensed", coulomb="newton")
    made: list[int] = []
    original = untouched._without
    monkeypatch.setattr(untouched, "_without", lambda *given: made.append(given[2].size) or original(*given))
    found = []
    for fewest in (10**9, 1):
        monkeypatch.setattr(untouched, "FEWEST_UNTOUCHED", fewest)
        found.append(solve(scene, COMM, check=False))
        assert any(made) == (fewest == 1)
    sets = [[(r.active_contact, r.slip_plus, r.slip_minus) for r in one.history.iterations] for one in found]
    assert sets[0] == sets[1]
    y = [one.displacement.x.array for one in found]
    assert np.abs(y[0] - y[1]).max(initial=0.0) < 1e-12 * np.abs(y[0]).max(initial=0.0)
    assert all(one.converged for one in found)
