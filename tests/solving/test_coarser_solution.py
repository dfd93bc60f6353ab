"""A certified solution is not lost because a finer mesh has none: its outcome says so, and why."""

from dataclasses import replace

import forms
import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc
from scenes import example1
from test_meshes_of_forms import block

from signorini_fx import ConvergenceError, solve_nested, solve_to_accuracy
from signorini_fx.algebra.linalg import krylov
from signorini_fx.algebra.linalg.full import FullSystem
from signorini_fx.errors import MeshError
from signorini_fx.forms import meshes as form_meshes
from signorini_fx.mechanics.statement.settings import Accuracy
from signorini_fx.records import SHORT_OF_ACCURACY, Status
from signorini_fx.scenes import mesh_sequence
from signorini_fx.scenes.solver import solve
from signorini_fx.solving.coarser_solution import OF_THE_BODY, Unsolved
from signorini_fx.solving.finer_meshes import Meshes
from signorini_fx.solving.iterated_interfaces import protocol

# Unknowns of the meshes before the one that fails: 13 x 5 nodes, or 7 x 3 of the forms; the others have more.
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


def package_fails(monkeypatch):
    """A factorisation that raises the error of a package on finer meshes."""
    kept = FullSystem.keep_factor

    def keep(self, *args, **how):
        if self.matrix.getSize()[0] > MOST:
            raise PETSc.Error(76)
        return kept(self, *args, **how)

    monkeypatch.setattr(FullSystem, "keep_factor", keep)


def matrix_is_not_finite(monkeypatch):
    """A matrix with infinite entries on finer meshes."""
    kept = FullSystem.keep_factor

    def keep(self, *args, **how):
        if self.matrix.getSize()[0] > MOST:
            self.matrix.scale(np.inf)
        return kept(self, *args, **how)

    monkeypatch.setattr(FullSystem, "keep_factor", keep)


def ends_with(status, fails=lambda unknowns: unknowns > MOST):
    """Every contact problem of such a mesh ends so."""

    def fault(monkeypatch):
        def solved(task, *args, usual=protocol.solve_task):
            outcome = usual(task, *args)
            return replace(outcome, status=status) if fails(outcome.displacement().getSize()) else outcome

        monkeypatch.setattr(protocol, "solve_task", solved)

    return fault


FAULTS = {
    Status.LINEAR_SOLVER: krylov_fails,
    Status.SINGULAR: package_fails,
    Status.NOT_FINITE: matrix_is_not_finite,
    Status.CYCLING: ends_with(Status.CYCLING),
}
KINDS = {Status.LINEAR_SOLVER: "krylov"}


def scene_of(status, nx=12, ny=4, **settings):
    return example1(bound=1.5, nx=nx, ny=ny, gamma="auto", linear_algebra=KINDS.get(status, "full"), **settings)


@pytest.mark.parametrize("status", FAULTS)
@pytest.mark.parametrize("nested", [True, False])
def test_scenes(status, nested, monkeypatch):
    """The coarsest mesh is solved, certified, and is what comes back; the reason says how the next one has ended."""
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
    assert solution.advice == f"{Status.COARSER.advice}; {which} ends with: {status.value}: {status.advice}"
    if nested:
        np.testing.assert_array_equal(solution.displacement.x.array, alone.displacement.x.array)


@pytest.mark.parametrize("status", FAULTS)
@pytest.mark.parametrize("nested", [True, False])
def test_forms_of_a_user(status, nested, monkeypatch):
    """They raise, as they do wherever an accuracy is not reached; the error has the solution."""
    FAULTS[status](monkeypatch)
    coarsest = forms.box((3.0, 1.0), (12, 4), comm=MPI.COMM_SELF)
    make = block(linear_algebra=KINDS.get(status, "full"))
    with pytest.raises(ConvergenceError, match=f"solved on a coarser mesh only: .*ends with: {status.value}") as error:
        (solve_nested if nested else solve_to_accuracy)(make, coarsest, 2 if nested else ANYTHING)
    solution = error.value.solution
    assert solution.status is Status.COARSER
    assert solution.certificate.holds
    assert solution.model.dofs <= MOST


def test_meshes_that_cannot_be_made(monkeypatch):
    """The solution on the last one stands whatever the package refuses of the next one; of the first one it raises."""

    def refused(*args, **how):
        raise MeshError("no such mesh\nbecause")

    scene = scene_of(None).model_copy(update={"accuracy": ANYTHING})
    load, coarsest = mesh_sequence.load_mesh, forms.box((3.0, 1.0), (12, 4), comm=MPI.COMM_SELF)
    with monkeypatch.context() as patched:
        patched.setattr(Meshes, "refine", refused)
        solution = solve(scene, MPI.COMM_SELF, check=False)
    assert solution.status is Status.COARSER
    assert solution.advice.endswith("; to make the next mesh cannot be solved: no such mesh")
    with monkeypatch.context() as patched:
        patched.setattr(form_meshes, "refine", refused)
        with pytest.raises(ConvergenceError, match="mesh 2 of 3 cannot be solved: no such mesh"):
            solve_nested(block(), coarsest, 3)
    coarse_only = lambda scene, comm: (load if scene.mesh.parameters["nx"] == 12 else refused)(scene, comm)  # noqa: E731
    monkeypatch.setattr(mesh_sequence, "load_mesh", coarse_only)
    solution = solve(scene_of(None, 48, 16, levels=3), MPI.COMM_SELF, check=False)
    assert (solution.status, solution.model.dofs) == (Status.COARSER, MOST)
    monkeypatch.setattr(mesh_sequence, "load_mesh", refused)
    with pytest.raises(MeshError, match="no such mesh"):
        solve(scene_of(None, 48, 16, levels=3), MPI.COMM_SELF)


def test_a_mesh_between_that_fails(monkeypatch):
    """The last mesh is solved all the same."""
    ends_with(Status.CYCLING, lambda unknowns: unknowns == 2 * 25 * 9)(monkeypatch)
    solution = solve(scene_of(None, 48, 16, levels=3), MPI.COMM_SELF)
    assert (solution.status, solution.model.dofs) == (Status.CONVERGED, 2 * 49 * 17)


@pytest.mark.parametrize(
    "status", [status for status in Status if status not in (Status.CONVERGED, *SHORT_OF_ACCURACY)]
)
def test_every_outcome(status):
    """Memory, time and tiny cells have their own names; what holds of the body stays what it is; all others are one."""
    of_the_body = status in OF_THE_BODY
    memory = Status.MEMORY if status is Status.NO_MEMORY else None
    plain, late, tiny = (
        Unsolved.by_outcome(status, "the next mesh", **how) for how in ({}, {"late": "too late"}, {"tiny": True})
    )
    assert (plain is None) == (tiny is None) == of_the_body
    assert late.status is (memory or Status.BUDGET)
    if not of_the_body:
        assert plain.status is (memory or Status.COARSER)
        digits = status in (Status.NOT_CERTIFIED, Status.ROUND_OFF, Status.SINGULAR, Status.NOT_FINITE)
        assert tiny.status is (memory or (Status.OUT_OF_REACH if digits else Status.COARSER))
    assert memory or late.reason == "too late"


def test_errors_that_are_none_of_the_mesh():
    """They are raised; memory of one of several ranks, too, as the others wait."""
    for error in (ZeroDivisionError(), PETSc.Error(76), KeyboardInterrupt()):
        with pytest.raises(type(error)):
            Unsolved.by_error(error, "the next mesh", MPI.COMM_SELF)
