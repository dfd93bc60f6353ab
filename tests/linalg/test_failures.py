"""Memory that ends is told from a matrix that is singular: with one mesh and several, of scenes and
of forms.
"""

import forms
import pytest
from commands import run_python
from forms import block_on_a_floor
from mpi4py import MPI
from petsc4py import PETSc
from scenes import alone, example1

from signorini_fx import ConvergenceError, solve_to_accuracy
from signorini_fx.algebra.linalg import ElasticSystem
from signorini_fx.algebra.linalg.petsc_calls import called_back, memory_ended
from signorini_fx.mechanics.effects.displacement import Displacement
from signorini_fx.mechanics.statement.settings import Accuracy
from signorini_fx.records import Status
from signorini_fx.scenes.cli import on_ranks
from signorini_fx.scenes.cli.grammar import EXIT_CRASH

FAULTS = {
    "numpy": (lambda: MemoryError(), Status.NO_MEMORY),
    "petsc": (lambda: PETSc.Error(55), Status.NO_MEMORY),
    "package": (lambda: PETSc.Error(76), Status.SINGULAR),
}
# A process that may take no more memory than it has and a bit factorises a matrix without zeros,
# whose factor takes 32 MB; before that, small ones of which some have no factor.  It prints whether
# memory was why one failed.
LIMITED = """
import resource
from pathlib import Path
import numpy as np
from mpi4py import MPI
from petsc4py import PETSc
from signorini_fx.algebra.linalg import petsc_options
from signorini_fx.algebra.linalg.factorisation import use_factorisation
from signorini_fx.algebra.linalg.petsc_calls import factor_lacks_memory, memory_ended, unprinted

def solver(size, sign, symmetric):
    entries = np.full((size, size), 0.5)
    np.fill_diagonal(entries, size)
    entries[-1, -1] *= sign
    starts = np.arange(size + 1, dtype=np.int32) * size
    columns = np.tile(np.arange(size, dtype=np.int32), size)
    matrix = PETSc.Mat().createAIJ((size, size), csr=(starts, columns, entries.ravel()), comm=MPI.COMM_SELF)
    matrix.setOption(PETSc.Mat.Option.SPD, symmetric)
    ksp = PETSc.KSP().create(MPI.COMM_SELF)
    ksp.setOptionsPrefix(petsc_options.PREFIX)
    ksp.setOperators(matrix)
    use_factorisation(ksp, symmetric=symmetric)
    return ksp

def told(ksp):
    with petsc_options.defaults(), unprinted():
        try:
            ksp.setUp()
        except PETSc.Error as error:
            return memory_ended(error)
        return factor_lacks_memory(ksp)

print(*(told(solver(50, sign, symmetric)) for sign, symmetric in ((1, True), (-1, True), (1, False), (0, False))))
solvers = [solver(2000, 1, symmetric) for symmetric in (True, False)]
taken = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (taken + 2**23, resource.RLIM_INFINITY))
print(*map(told, solvers))
"""


def lacking(fault, monkeypatch, above=0):
    """Let each matrix with more unknowns than these have no factor."""
    kept = ElasticSystem.keep_factor

    def keep(self, *args, **how):
        if self.matrix.getSize()[0] > above:
            raise FAULTS[fault][0]()
        return kept(self, *args, **how)

    monkeypatch.setattr(ElasticSystem, "keep_factor", keep)


def test_packages_that_run_out():
    """CHOLMOD's error and MUMPS's reason are told from those of matrices that have no factor;
    nothing is printed.
    """
    ended = run_python(LIMITED)
    assert ended.stdout.splitlines() == ["False False False False", "True True"]
    assert "CHOLMOD" not in ended.stderr


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("coulomb", ["fp", "newton"])
def test_one_mesh(fault, coulomb, monkeypatch):
    """The outcome is that memory ends, and says nothing of supports or of a required accuracy."""
    lacking(fault, monkeypatch)
    scene = example1(coefficient=0.3, nx=6, ny=2, linear_algebra="full", coulomb=coulomb)
    solution = alone(scene, check=False)
    assert solution.status is FAULTS[fault][1]
    if solution.status is Status.NO_MEMORY:
        assert solution.advice.startswith(
            "the memory was used up by the factor of the matrix: use a larger machine"
        )
        assert solution.history.linear_solves == 0


@pytest.mark.parametrize("fault", FAULTS)
def test_without_contact(fault, monkeypatch):
    """A linear problem has no Newton's method that could tell."""

    class Fails:
        @called_back
        def apply(self, pc, right, x):
            raise FAULTS[fault][0]()

    def configure(self, ksp, **how):
        ksp.setType(PETSc.KSP.Type.PREONLY)
        ksp.getPC().setType(PETSc.PC.Type.PYTHON)
        ksp.getPC().setPythonContext(Fails())

    scene = example1(nx=6, ny=2, linear_algebra="full")
    held = Displacement(boundary="bottom", x=0.0, y=0.0)
    scene = scene.model_copy(update={"contact": (), "displacement": (held,)})
    assert alone(scene, check=False).status is Status.CONVERGED
    monkeypatch.setattr(ElasticSystem, "configure", configure)
    assert alone(scene, check=False).status is FAULTS[fault][1]


def test_forms(monkeypatch):
    """One mesh of forms has no solution, several have that of the last but one."""
    boxed, settings = forms.box((3.0, 1.0), (6, 2), comm=MPI.COMM_SELF), {"linear_algebra": "full"}
    lacking("petsc", monkeypatch, above=100)
    with pytest.raises(ConvergenceError, match="memory ends before the accuracy") as error:
        solve_to_accuracy(block_on_a_floor(**settings), boxed, Accuracy(target=1e-6))
    assert error.value.solution.certificate.holds
    lacking("petsc", monkeypatch)
    with pytest.raises(
        ConvergenceError, match="memory ends before a solution: the memory was used up"
    ):
        block_on_a_floor(**settings)(boxed).solve()


def test_an_error_that_is_no_outcome(capsys):
    """Memory that ends outside of the solves is one line, whatever has raised it."""

    def run(error):
        def raises(_comm):
            raise error

        return on_ranks(raises), capsys.readouterr().err

    for error in (
        MemoryError(),
        PETSc.Error(55),
        RuntimeError("Failed to call PETSc. PETSc error code is: 55, Out"),
    ):
        code, said = run(error)
        assert memory_ended(error)
        assert said.startswith("signorini-fx: error: memory ran out")
        assert code != EXIT_CRASH
    code, said = run(PETSc.Error(76))
    assert code == EXIT_CRASH
    assert "Traceback" in said
