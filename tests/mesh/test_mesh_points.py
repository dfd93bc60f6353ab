"""Points in the cells of meshes that are not nested, curved ones too: exact where they can be, on ranks as alone."""

import gmsh
import numpy as np
import pytest
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from spaces import CELLS

from signorini_fx.mechanics.mesh.points import at_points
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene

COMM, SELF = MPI.COMM_WORLD, MPI.COMM_SELF
PLANE = (dmesh.CellType.quadrilateral, dmesh.CellType.triangle)


def distorted(cell, n=3, comm=SELF):
    """A unit square or cube whose nodes are moved, the same whatever their numbers."""
    dim = 2 if cell in PLANE else 3
    mesh = (dmesh.create_unit_square if dim == 2 else dmesh.create_unit_cube)(comm, *[n] * dim, cell)
    x = mesh.geometry.x
    x[:, :dim] += 0.05 * np.sin(7 * x[:, :dim] + 5 * np.roll(x[:, :dim], 1, axis=1))
    return mesh


@pytest.fixture(scope="module")
def drawing(tmp_path_factory):
    """A plate of 40 x 20 x 10 with a round hole of radius 5."""
    file = COMM.bcast(tmp_path_factory.mktemp("drawing") / "plate.step")
    if COMM.rank == 0:
        gmsh.initialize(interruptible=False)
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.model.occ.addBox(0, 0, 0, 40, 20, 10, 1)
        gmsh.model.occ.addCylinder(20, 10, -1, 0, 0, 12, 5, 2)
        gmsh.model.occ.cut([(3, 1)], [(3, 2)])
        gmsh.model.occ.synchronize()
        gmsh.write(str(file))
        gmsh.finalize()
    COMM.barrier()
    return file


def plate(drawing, size, degree, *, unit=1.0, comm=COMM):
    """A drawing in cells of this size, curved ones for degree 2."""
    scene = {
        "mesh": {"file": str(drawing), "size": size},
        "element": {"degree": degree},
        "material": {"young": 1.0, "poisson": 0.3},
    }
    mesh = load_mesh(parse_scene(scene), comm).mesh
    mesh.geometry.x[:] *= unit
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
    fine = (dmesh.create_unit_square if dim == 2 else dmesh.create_unit_cube)(COMM, *[7] * dim, cell)
    x = (0.1 + 0.8 * nodes(fine)) * (np.arange(3) < dim)
    function = quadratic if simplex else lambda x: 1 + x[0] - 2 * x[1] + x[2]
    found = values_at(distorted(cell, 4, COMM), x, 2 if simplex else 1, function)
    np.testing.assert_allclose(found[:, 0], function(x.T), rtol=0, atol=1e-11)
