"""A certified solution is not lost because a finer mesh has none: its outcome says so, and why."""

from dataclasses import replace

import forms
import numpy as np
import pytest
from forms import block_on_a_floor
from mpi4py import MPI
from scenes import example1

from signorini_fx import ConvergenceError, solve_nested, solve_to_accuracy
from signorini_fx.algebra.linalg import krylov
from signorini_fx.mechanics.statement.settings import Accuracy
from signorini_fx.records import Status
from signorini_fx.scenes.solver import solve
from signorini_fx.solving import step

# Unknowns of the meshes before the one that fails: 13 x 5 nodes, or 7 x 3 of the forms; the others
# have more.
MOST = 2 * 13 * 5
ANYTHING = Accuracy(target=1e-6, refinement="uniform")


def krylov_fails(monkeypatch):
    """Two steps of a Krylov method on finer meshes, and no memory for a factor."""
    kept = krylov.KrylovSystem.keep_factor

    def keep(self, ksp, *args, **how):
        result = kept(self, ksp, *args, **how)
        if self.matrix.getSize()[0] > MOST:
            ksp.setTolerances(max_it=2)
        return result

    monkeypatch.setattr(krylov.KrylovSystem, "keep_factor", keep)
    monkeypatch.setattr(krylov, "enough_memory", lambda *_: False)


def ends_with(status, fails=lambda unknowns: unknowns > MOST):
    """Every contact problem of such a mesh ends so."""

    def fault(monkeypatch):
        def solved(task, *args, usual=step.solve_task):
            outcome = usual(task, *args)
            return (
                replace(outcome, status=status)
                if fails(outcome.displacement().getSize())
                else outcome
            )

        monkeypatch.setattr(step, "solve_task", solved)

    return fault


FAULTS = {Status.LINEAR_SOLVER: krylov_fails, Status.CYCLING: ends_with(Status.CYCLING)}
KINDS = {Status.LINEAR_SOLVER: "krylov"}


def scene_of(status, nx=12, ny=4, **settings):
    return example1(
        bound=1.5, nx=nx, ny=ny, gamma="auto", linear_algebra=KINDS.get(status, "full"), **settings
    )


@pytest.mark.one_quick("status", FAULTS)
@pytest.mark.parametrize("nested", [True, False])
def test_scenes(status, nested, monkeypatch):
    """The coarsest mesh is solved, certified, and is what comes back; the reason says how the next
    one has ended.
    """
    scene = scene_of(status, 24, 8, levels=2) if nested else scene_of(status)
    if not nested:
        scene = scene.model_copy(update={"accuracy": ANYTHING})
    alone = solve(scene_of(status), MPI.COMM_SELF)
    FAULTS[status](monkeypatch)
    solution = solve(scene, MPI.COMM_SELF, check=False)
    assert solution.status is Status.COARSER
    assert solution.certificate.holds
    assert solution.model.dofs <= MOST
    assert [level.dofs for level in solution.levels][-1] == solution.model.dofs
    which = "mesh 2 of 2" if nested else "the next mesh"
    assert (
        solution.advice
        == f"{Status.COARSER.advice}; {which} ends with: {status.value}: {status.advice}"
    )
    if nested:
        np.testing.assert_array_equal(solution.displacement.x.array, alone.displacement.x.array)


@pytest.mark.parametrize("nested", [True, False])
def test_forms_of_a_user(nested, monkeypatch):
    """They raise, as they do wherever an accuracy is not reached; the error has the solution."""
    status = Status.CYCLING
    FAULTS[status](monkeypatch)
    coarsest = forms.box((3.0, 1.0), (12, 4), comm=MPI.COMM_SELF)
    make = block_on_a_floor(linear_algebra="full")
    with pytest.raises(
        ConvergenceError, match=f"solved on a coarser mesh only: .*ends with: {status.value}"
    ) as error:
        (solve_nested if nested else solve_to_accuracy)(make, coarsest, 2 if nested else ANYTHING)
    solution = error.value.solution
    assert solution.status is Status.COARSER
    assert solution.certificate.holds
    assert solution.model.dofs <= MOST
