"""Objects of PETSc on several ranks: that ranks do not wait for each other, and that nothing stays
behind.
"""

import gc
import resource

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI
from petsc4py import PETSc
from scenes import example1
from spaces import block

from signorini_fx.machine import petsc_objects
from signorini_fx.machine.petsc_objects import free_unused
from signorini_fx.scenes.solver import solve

COMM = MPI.COMM_WORLD


@pytest.mark.mpi
@pytest.mark.one_quick("where", ["plane", "space"])
def test_garbage_is_collected_at_another_time_on_each_rank(where):
    """One rank never collects what is in cycles of references, another one all the time: no rank
    waits for ever.
    """
    before = gc.get_threshold()
    if COMM.rank % 2:
        gc.disable()
    else:
        gc.set_threshold(30)
    try:
        for _ in range(2):
            if where == "plane":
                scene = example1(coefficient=0.3, nx=12, ny=4)
            else:
                scene = block(4, "tetrahedra", coefficient=0.3, gamma="auto", degree=2, comm=COMM)
            solution = solve(scene, COMM)
            force = sum(one.force for one in solution.resultants.every())
            np.testing.assert_allclose(force, 0.0, atol=1e-6)
            assert solution.stress.error > 0
    finally:
        gc.enable()
        gc.set_threshold(*before)


@pytest.mark.mpi
def test_what_is_not_used_is_freed():
    """Vectors of 8 MB that are forgotten one after the other; without a clean-up 400 MB are in use
    on several ranks.
    """
    mesh = dmesh.create_unit_square(COMM, 4, 4)
    free_unused(mesh)
    begin = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for _ in range(50):
        PETSc.Vec().createMPI((1_000_000, None), comm=mesh.comm).set(1.0)
        free_unused(mesh)
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - begin
    assert grown < 100_000


@pytest.mark.mpi
def test_meshes_that_are_gone_are_forgotten():
    """Also where one rank has forgotten a mesh before the others have."""
    first, second = (dmesh.create_unit_square(COMM, 4, 4) for _ in range(2))
    free_unused(first)
    several = COMM.size > 1
    known = len(petsc_objects._mesh_objects)
    also = first if COMM.rank == 1 else None
    del first
    free_unused(second)
    assert len(petsc_objects._mesh_objects) == (known + 1 if several else known)
    del also
    free_unused(second)
    assert len(petsc_objects._mesh_objects) == known
