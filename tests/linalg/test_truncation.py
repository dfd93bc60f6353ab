"""Truncated levels of multigrid: against dense products, and shared by solvers with different tangents."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc
from spaces import block
from test_krylov import dense
from test_two_bodies import paraboloids

from signorini_fx.algebra.contact.active_sets import ActiveSets
from signorini_fx.algebra.linalg import factorisation, krylov, multigrid
from signorini_fx.mechanics.body.discretisation import discretise
from signorini_fx.records import History, Timings
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.solving.solve_on_mesh import contact_task

WORLD = MPI.COMM_WORLD


def test_coarse_matrix_of_two_bodies(monkeypatch):
    """P'^T (A + B^T D B) P' with D what contact adds softly, and P' = P - S E B P, on which E B is nearly zero: turning
    makes B S differ from one by 1e-5 here, and S is corrected by one step of Newton's method, which squares that.
    """
    made, matrices = [], []

    def levels(hierarchy, matrix, *arguments, **how):
        matrices.append(matrix)
        return multigrid.ContactLevels(hierarchy, matrix, *arguments, **how)

    def create(*arguments, **how):
        made.append(multigrid.ContactPreconditioner(*arguments, **how))
        return made[-1]

    monkeypatch.setattr(krylov, "ContactLevels", levels)
    monkeypatch.setattr(krylov, "ContactPreconditioner", create)
    problem = paraboloids("hexahedron", 1, (4, 5), linear_algebra="krylov")
    assert len(matrices) == 1
    found, levels = made[-1], made[-1]._levels
    levels._truncated_at = None
    found._truncate()
    blocks = levels.joined.split(found._reduced)
    held, soft = (dense(levels.joined.matrix(each)) for each in blocks)
    assert 0.5 < np.trace(held) < len(held)
    assert np.abs(soft).max() > 0
    every, unknowns = dense(levels.hierarchy.interpolations[0]), levels.unknowns
    operator, lift = dense(levels.joined.operator), dense(levels.joined.lift)
    functions = every.copy()
    functions[unknowns] -= lift @ held @ operator @ every[unknowns]
    assert np.abs(held @ operator @ functions[unknowns]).max() < 1e-8
    np.testing.assert_allclose(dense(levels.truncated.interpolation), functions, rtol=0, atol=1e-13)
    matrix = dense(matrices[0])
    matrix[np.ix_(unknowns, unknowns)] += operator.T @ soft @ operator
    wanted = functions.T @ matrix @ functions + np.diag(1e-10 * np.diag(dense(levels.hierarchy.coarse[0])))
    np.testing.assert_allclose(dense(levels.truncated.coarse[0]), wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())
    assert problem.certificate.holds


def test_two_tangents_share_the_levels():
    """A solver that comes back to its tangent takes as many steps as before, whatever was solved between."""
    scene = block(6, coefficient=0.3, gamma=1e7, linear_algebra="krylov")
    d = discretise(scene.statement, load_mesh(scene, WORLD), Timings())
    task = contact_task(d, History())
    task.iterate.begin_step(task.start)
    newtons = task.iterate.newton, task.iterate.unsymmetric_newton
    count = task.iterate.newton.problem.points.size
    sticks = ActiveSets.all_in_contact(count, 2)
    few = ActiveSets.of(np.arange(count) % 3 == 0, np.zeros((count, 2)))
    system = task.system

    def steps(newton):
        ksp, x = newton.snes.getKSP(), newton.x.duplicate()
        ksp.setTolerances(rtol=1e-8, atol=0.0)
        ksp.solve(system.load, x)
        assert ksp.is_converged
        assert (newton.snes.getJacobian()[0] * x - system.load).norm() <= 1e-6 * system.load.norm()
        return ksp.getIterationNumber()

    def assemble(newton, sets, data):
        newton.pose(data, sets)
        newton.problem.assemble_jacobian(None, newton.x, newton.snes.getJacobian()[0])
        return steps(newton)

    data = replace(task.start.data, bound=np.full(count, np.inf))
    first = assemble(newtons[0], sticks, data)
    second = assemble(newtons[1], few, data)
    assert [steps(newton) for newton in (*newtons, newtons[0])] == [first, second, first]


@pytest.mark.parametrize("most", [0, 10_000])
@pytest.mark.parametrize("symmetric", [True, False])
def test_direct_solvers_of_all_ranks_and_of_each(most, symmetric, monkeypatch):
    """Of the matrix of a chain of springs, with a flow along it if it is not symmetric; factorised twice."""
    monkeypatch.setattr(factorisation, "MOST_REPLICATED_UNKNOWNS", most)
    n = 40 * WORLD.size
    matrix = PETSc.Mat().createAIJ(((None, n), (None, n)), nnz=(3, 2), comm=WORLD)
    for row in range(*matrix.getOwnershipRange()):
        for column, value in ((row - 1, -1.0), (row, 2.5), (row + 1, -1.0 if symmetric else -0.5)):
            if 0 <= column < n:
                matrix.setValue(row, column, value)
    matrix.assemble()
    pc = PETSc.PC().create(WORLD)
    factorisation.use_direct(pc, n, symmetric=symmetric)
    x, b = matrix.createVecs()
    first, last = b.getOwnershipRange()
    for factor in (1.0, 3.0):
        b.getArray()[:] = np.sin(1.0 + np.arange(first, last))
        pc.setOperators(factor * matrix)
        pc.setUp()
        pc.apply(b, x)
        assert (factor * (matrix * x) - b).norm() < 1e-12 * b.norm()
    assert (pc.getType() == PETSc.PC.Type.REDUNDANT) == (WORLD.size > 1 and most > 0)
