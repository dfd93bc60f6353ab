"""Contact of deformable bodies on several ranks: counts, tractions and forces are those of one rank."""

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from dolfinx.graph import adjacencylist
from mpi4py import MPI
from test_two_bodies import example1, paraboloids, stack

from signorini_fx.machine import parallel

pytestmark = pytest.mark.mpi
WORLD = MPI.COMM_WORLD

# Newton's method may leave a residual of 1e-8 of the forces, unless less is asked for.
KRYLOV = {"linear_algebra": "krylov", "petsc_options": {"snes_rtol": "1e-10"}}
PROBLEMS = {
    "plane": lambda comm: example1(24, comm=comm),
    "Q2": lambda comm: example1(12, 2, comm=comm),
    "stack": lambda comm: stack("triangle", comm),
    "hexahedra": lambda comm: paraboloids("hexahedron", 1, (4, 5), comm, linear_algebra="full"),
    "hexahedra, krylov": lambda comm: paraboloids("hexahedron", 1, (4, 5), comm, **KRYLOV),
    "tetrahedra, krylov": lambda comm: paraboloids("tetrahedron", 1, (4, 5), comm, **KRYLOV),
    "P2": lambda comm: paraboloids("tetrahedron", 2, (4, 5), comm, linear_algebra="full"),
    "P2, krylov": lambda comm: paraboloids("tetrahedron", 2, (4, 5), comm, **KRYLOV),
}


def points_of(state):
    """Part, position, weight, pressure and shear of the points of all ranks, sorted by place."""
    boundary = state.boundary
    shear = np.einsum("ijk,ik->ij", boundary.tangents, state.shear)
    columns = (boundary.part, boundary.x, boundary.weight, state.pressure, shear)
    rows = parallel.gather_rows(boundary.comm, np.column_stack(columns))
    return rows[np.lexsort(np.round(rows[:, : 1 + boundary.x.shape[1]], 9).T)]


@pytest.mark.one_quick
@pytest.mark.mpi(slow=True)
@pytest.mark.parametrize("name", PROBLEMS)
def test_one_rank_or_many(name):
    """Every kind of element and system; the certificate tries the map on all ranks."""
    together, alone = (PROBLEMS[name](comm) for comm in (WORLD, MPI.COMM_SELF))
    loose = name.endswith("krylov")  # directions of slip are those of the linear solver
    counts = [[(r.active_contact, r.slip_plus, r.slip_minus) for r in p.history.iterations] for p in (together, alone)]
    assert loose or counts[0] == counts[1]
    ours, theirs = points_of(together.state), points_of(alone.state)
    assert ours.shape == theirs.shape
    size, close = np.abs(theirs).max(axis=0), 1e-9
    dimension = alone.state.boundary.x.shape[1]
    size[1 : 1 + dimension] = size[1 : 1 + dimension].max()  # places: heights above y = 0 are round-off
    size[-1 - dimension :] = size[-1 - dimension]  # tractions
    assert (np.abs(ours - theirs) <= close * np.maximum(size, 1e-300)).all()
    np.testing.assert_allclose(together.state.forces, alone.state.forces, atol=close * np.abs(alone.state.forces).max())
    assert together.certificate.coupling < 1e-9
    assert together.certificate.holds


@pytest.mark.mpi(slow=True)
def test_ranks_without_cells(monkeypatch):
    """All cells are of the first rank; the others have nothing, and the certificate is the same."""
    plain = dmesh.create_cell_partitioner

    def all_to_the_first(*given):
        divide = plain(*given)

        def owners(*cells):
            count = divide(*cells).num_nodes
            links = adjacencylist(np.zeros(count, dtype=np.int32), np.arange(count + 1, dtype=np.int32))
            return getattr(links, "_cpp_object", links)  # which is wrapped since dolfinx 0.10

        return owners

    monkeypatch.setattr(dmesh, "create_cell_partitioner", all_to_the_first)
    mesh = PROBLEMS["Q2"](WORLD).u.function_space.mesh
    assert WORLD.rank == 0 or mesh.topology.index_map(2).size_local == 0
    test_one_rank_or_many("Q2")
