"""Points in the cells of meshes that are not nested, curved ones too: exact where they can be, on
ranks as alone.
"""

import numpy as np
import pytest
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from spaces import CELLS

from signorini_fx.mechanics.mesh.points import at_points

COMM, SELF = MPI.COMM_WORLD, MPI.COMM_SELF
PLANE = (dmesh.CellType.quadrilateral, dmesh.CellType.triangle)


def distorted(cell, n=3, comm=SELF):
    """A unit square or cube whose nodes are moved, the same whatever their numbers."""
    dim = 2 if cell in PLANE else 3
    mesh = (dmesh.create_unit_square if dim == 2 else dmesh.create_unit_cube)(
        comm, *[n] * dim, cell
    )
    x = mesh.geometry.x
    x[:, :dim] += 0.05 * np.sin(7 * x[:, :dim] + 5 * np.roll(x[:, :dim], 1, axis=1))
    return mesh


def quadratic(x):
    """A function of degree 2."""
    return 1 + x[0] - 2 * x[1] + 3 * x[0] * x[1] - x[1] ** 2 + x[2] * x[0] + x[2] ** 2


def values_at(mesh, x, degree, function, outside=0.25):
    """What the interpolant of a function on a mesh is at points."""
    space = fem.functionspace(mesh, ("Lagrange", degree))
    values = np.atleast_2d(function(space.tabulate_dof_coordinates().T)).T

    def evaluate(cells, place):
        shares = space.element.basix_element.tabulate(0, place)[0, :, :, 0]
        return np.einsum("nk,nkc->nc", shares, values[space.dofmap.list[cells]])

    return at_points(mesh, x, outside, evaluate)


def nodes(mesh):
    """The nodes of degree 2 that this rank owns."""
    space = fem.functionspace(mesh, ("Lagrange", 2))
    return space.tabulate_dof_coordinates()[: space.dofmap.index_map.size_local]


@pytest.mark.mpi
@pytest.mark.parametrize("cell", [*CELLS.values(), *PLANE])
def test_quadratic_functions_on_meshes_that_are_not_nested(cell):
    """Exact at all points of straight simplices, and linear ones on distorted cells of any kind."""
    dim = 2 if cell in PLANE else 3
    simplex = cell in (dmesh.CellType.triangle, dmesh.CellType.tetrahedron)
    fine = (dmesh.create_unit_square if dim == 2 else dmesh.create_unit_cube)(
        COMM, *[7] * dim, cell
    )
    x = (0.1 + 0.8 * nodes(fine)) * (np.arange(3) < dim)
    function = quadratic if simplex else lambda x: 1 + x[0] - 2 * x[1] + x[2]
    found = values_at(distorted(cell, 4, COMM), x, 2 if simplex else 1, function)
    np.testing.assert_allclose(found[:, 0], function(x.T), rtol=0, atol=1e-11)
