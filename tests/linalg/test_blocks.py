"""Matrices by blocks: products against scipy and PETSc, and whole solves against those with sparse
matrices.
"""

import functools
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
import ufl
from dolfinx import default_scalar_type, fem, jit
from dolfinx import mesh as dmesh
from mpi4py import MPI
from numpy.testing import assert_allclose, assert_array_equal
from on_meshes import function_of_cells, trial_and_test, vector_space
from petsc4py import PETSc
from ranks import same_on_all_ranks
from scenes import alone, example1, same_answer
from spaces import LAWS, block, box
from two_bodies import paraboloids

from signorini_fx.algebra.linalg import (
    blocks,
    factorisation,
    is_by_blocks,
    kernels,
    krylov,
    petsc_calls,
)
from signorini_fx.errors import MachineError
from signorini_fx.mechanics import model as models
from signorini_fx.mechanics.assembly.nodal_stiffness import NodalStiffness, block_stiffness
from signorini_fx.records import Status
from signorini_fx.scenes.solver import solve

WORLD = MPI.COMM_WORLD


@pytest.mark.parametrize("size", kernels.SIZES)
def test_products_of_random_blocks(size):
    """As scipy's, to the round-off of sums, with rows and columns that are empty, and columns of
    other ranks.
    """
    generator = np.random.default_rng(7)
    folder = Path(jit.get_options()["cache_dir"])
    kernels.load(MPI.COMM_SELF, folder)
    present = np.kron(generator.random((31, 40)) < 0.02, np.ones((size, size)))
    entries = present * generator.standard_normal((31 * size, 40 * size))
    entries[:, : 31 * size] += entries[:, : 31 * size].T
    matrix = sp.bsr_array(entries, blocksize=(size, size))
    assert (np.diff(matrix.indptr) == 0).any()
    product = kernels.BlockProduct(folder, matrix.indptr, matrix.indices, matrix.data)
    x, y = generator.standard_normal(40 * size), np.full(31 * size, np.nan)
    product(x, y)
    assert_allclose(y, matrix @ x, rtol=0, atol=1e-14 * size * np.abs(y).max())


def test_room_for_contact_is_empty():
    """Also once tangents have used it."""
    model = solve(example1(nx=12, coefficient=0.3, linear_algebra="full")).model
    assert (model.contact.admitted(model.stiffness) - model.stiffness).norm() == 0.0


def two_matrices(dimension, comm):
    """A stiffness with random moduli and one end prescribed, and random springs at nodes, by blocks
    and sparse.
    """
    mesh = (
        box("tetrahedra", (5, 3, 4), comm=comm).mesh
        if dimension == 3
        else dmesh.create_rectangle(
            comm, [(0.0, 0.0), (3.0, 1.0)], (9, 4), dmesh.CellType.quadrilateral
        )
    )
    space = vector_space(mesh)
    moduli = function_of_cells(mesh)
    moduli.x.array[:] = 1 + np.random.default_rng(comm.rank).random(moduli.x.array.size)
    moduli.x.scatter_forward()
    y, z = trial_and_test(space)
    strain = moduli * ufl.inner(ufl.sym(ufl.grad(y)), ufl.sym(ufl.grad(z)))
    forms = [fem.form(strain * ufl.dx), fem.form(moduli * ufl.div(y) * ufl.div(z) * ufl.dx)]
    nodes = np.flatnonzero(space.tabulate_dof_coordinates()[:, 0] < 1e-9)
    zero, first = default_scalar_type(0), (dimension * nodes).astype(np.int32)
    bcs = [
        fem.dirichletbc(zero, first + np.int32(axis), space.sub(axis)) for axis in range(dimension)
    ]
    fixed = np.zeros(space.dofmap.index_map.size_local * dimension, dtype=bool)
    fixed.reshape(-1, dimension)[nodes[nodes < len(fixed) // dimension]] = True
    some = np.arange(0, len(fixed) // dimension, 3)
    springs = np.random.default_rng(comm.rank).standard_normal((len(some), dimension, dimension))
    beside = NodalStiffness(some, springs @ springs.transpose(0, 2, 1))
    ours, theirs = block_stiffness(forms, fixed, beside), models.sum_of(forms, bcs)
    beside.add_to(theirs, fixed)
    diagonal = theirs.getDiagonal()
    diagonal.getArray()[fixed] = comm.allreduce(diagonal.getArray().max(initial=0.0), op=MPI.MAX)
    theirs.setDiagonal(diagonal)
    return ours, theirs, space  # whose communicator is that of the matrices


def test_rows_at_columns_of_the_same_number():
    """They were those of the columns that were asked for first."""
    ours, theirs, _ = two_matrices(2, MPI.COMM_SELF)
    blocked = blocks.with_added(ours, theirs)
    some = PETSc.IS().createGeneral(np.arange(6, dtype=np.int32), comm=MPI.COMM_SELF)
    others = PETSc.IS().createGeneral(np.arange(6, 12, dtype=np.int32), comm=MPI.COMM_SELF)
    for columns in (some, others):
        expected = 2 * theirs.createSubMatrix(some, columns)
        found = blocked.createSubMatrix(some, columns)
        assert (found - expected).norm() <= 1e-12 * theirs.norm()


@pytest.fixture
def either(monkeypatch):
    """Solves a scene by blocks and with a sparse matrix; with each solution the Krylov steps of all
    solves.
    """

    def solved(make, comm=MPI.COMM_SELF, *, solving=True):
        answers = []
        configure = krylov.KrylovSystem.configure
        for fewest in (0, np.inf):
            steps, kinds = [], set()

            def watched(self, ksp, *, _steps=steps, _kinds=kinds, **how):
                configure(self, ksp, **how)
                _kinds.add(is_by_blocks(self.matrix))
                ksp.setPostSolve(
                    lambda solver, b, x: _steps.append((b.getSize(), solver.getIterationNumber()))
                )

            monkeypatch.setattr(models, "FEWEST_BLOCK_UNKNOWNS", fewest)
            monkeypatch.setattr(krylov.KrylovSystem, "configure", watched)
            solution = solve(make(), comm) if solving else make()
            assert kinds == {fewest == 0}
            answers.append((solution, steps))
        return answers

    return solved


BODIES = {
    **{
        f"{cells}, {law}": functools.partial(
            block, 12, cells, gamma=1e6, linear_algebra="krylov", **LAWS[law]
        )
        for cells in ("hexahedra", "tetrahedra")
        for law in LAWS
    },
    "plane": functools.partial(example1, bound=1.5, nx=60, ny=20, linear_algebra="krylov"),
    "quadratic": functools.partial(
        block, 6, degree=2, gamma=1e6, linear_algebra="krylov", bound=1.5
    ),
}


@pytest.mark.one_quick("name", BODIES)
def test_blocks_change_no_answer(name, either):
    """As many Krylov steps, displacements and tractions to 1e-12."""
    (ours, steps), (theirs, wanted) = either(BODIES[name])
    assert steps == wanted
    same_answer(ours, theirs, 1e-12)


def test_two_bodies_by_blocks(either):
    """What contact adds couples nodes that the stiffness does not; forms of a user's own."""
    (ours, steps), (theirs, wanted) = either(
        lambda: paraboloids("hexahedron", 1, (4, 5), linear_algebra="krylov"), solving=False
    )
    assert steps == wanted
    assert ours.certificate.holds
    far = np.abs(theirs.u.x.array).max()
    assert_allclose(ours.u.x.array, theirs.u.x.array, rtol=0, atol=1e-12 * far)


@pytest.mark.mpi(slow=True)
def test_solves_by_blocks_on_ranks(either):
    """As with PETSc's matrix on as many ranks; round-off at a tolerance decides about a single
    Krylov step.
    """
    # One mesh for both: another one may be divided among the ranks differently.
    scene = block(9, "tetrahedra", coefficient=0.3, gamma=1e6, linear_algebra="krylov", comm=WORLD)
    (ours, steps), (theirs, wanted) = either(lambda: scene, WORLD)
    steps, wanted = np.array(same_on_all_ranks(steps)), np.array(wanted)
    assert_array_equal(steps[:, 0], wanted[:, 0])  # as many solves on each mesh
    assert np.abs(steps - wanted)[:, 1].sum() <= 1
    assert ours.status is theirs.status is Status.CONVERGED
    far = WORLD.allreduce(np.abs(theirs.displacement.x.array).max(), op=MPI.MAX)
    assert_allclose(
        ours.displacement.x.array, theirs.displacement.x.array, rtol=0, atol=1e-12 * far
    )


def test_without_a_compiler(monkeypatch):
    """The error says so."""

    def refuse(*_):
        raise MachineError("there is no C compiler")

    monkeypatch.setattr(kernels, "library", refuse)
    monkeypatch.setattr(kernels, "_LOADED", {})
    monkeypatch.setattr(models, "FEWEST_BLOCK_UNKNOWNS", 0)
    with pytest.raises(MachineError, match="there is no C compiler"):
        alone(block(6, bound=1.5, linear_algebra="krylov"))


@pytest.mark.parametrize("symmetric", [True, False])
@pytest.mark.parametrize("regular", [True, False])
def test_a_factor_of_blocks(symmetric, regular):
    """Solves as a factor of the sparse matrix, and a singular one fails for the same reason."""
    ours, theirs, _space = two_matrices(3, MPI.COMM_SELF)
    added = theirs.duplicate()
    added.setDiagonal(theirs.getDiagonal())
    if not regular:
        added.zeroEntries()
        added.axpy(-1.0, theirs)  # A + C = 0
    tangent = blocks.with_added(ours, added)
    results = []
    for matrix in (tangent, blocks.by_entries(tangent)):
        ksp = PETSc.KSP().create(MPI.COMM_SELF)
        ksp.setOperators(matrix)
        if matrix is tangent:
            ksp.setType(PETSc.KSP.Type.PREONLY)
            blocks.use_entries(
                ksp.getPC(), lambda pc: factorisation.use_factor(pc, symmetric=symmetric)
            )
        else:
            factorisation.use_factorisation(ksp, symmetric=symmetric)
        x, right = matrix.createVecs()
        right.set(1.0)
        try:
            petsc_calls.solve(ksp.solve, right, x)
            results.append(
                (ksp.getConvergedReason(), ksp.getPC().getFailedReason(), x.array.copy())
            )
        except PETSc.Error as error:
            results.append((error.ierr, None, None))
    (*reasons, solution), (*wanted, reference) = results
    assert reasons == wanted
    if regular:
        assert reasons[0] > 0
        assert_allclose(solution, reference, rtol=0, atol=1e-13 * np.abs(reference).max())
    else:
        assert reasons[1] is None or reasons[1] != PETSc.PC.FailedReason.NOERROR
