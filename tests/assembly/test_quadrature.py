"""On parallelepipeds fewer points integrate the stiffness exactly; on other cells they are not used."""

from __future__ import annotations

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

from signorini_fx.mechanics.assembly.quadrature import parallelepipeds, strain_degree
from signorini_fx.mechanics.kinematics import AXISYMMETRIC
from signorini_fx.mechanics.materials.isotropic import elastic_forms

SHEARED = np.array([[2.0, 0.3, -0.2], [0.7, 0.5, 0.1], [-0.4, 0.2, 0.01]])


def cells(dim: int, map_: np.ndarray | None = None) -> dmesh.Mesh:
    """Two cells along each axis, far from the origin, and mapped."""
    if dim == 2:
        mesh = dmesh.create_unit_square(MPI.COMM_SELF, 2, 2, dmesh.CellType.quadrilateral)
    else:
        mesh = dmesh.create_unit_cube(MPI.COMM_SELF, 2, 2, 2, dmesh.CellType.hexahedron)
    if map_ is not None:
        mesh.geometry.x[:, :dim] = mesh.geometry.x[:, :dim] @ map_[:dim, :dim].T + 1000.0
    return mesh


@pytest.mark.parametrize(("dim", "degree"), [(2, 2), (3, 1)])
def test_exact_on_parallelepipeds(dim: int, degree: int) -> None:
    """The forces of a displacement, as the rule of many points integrates them."""
    space = fem.functionspace(cells(dim, SHEARED), ("Lagrange", degree, (dim,)))
    y, z = fem.Function(space), ufl.TestFunction(space)
    y.x.array[:] = np.random.default_rng(0).normal(size=y.x.array.size)

    def forces(points: int) -> np.ndarray:
        (form,) = elastic_forms(y, z, 3.0, 2.0, points)
        return fem.assemble_vector(fem.form(form)).array

    exact = forces(2 * degree + 6)
    assert strain_degree(space) == 2 * degree
    assert np.abs(forces(2 * degree) - exact).max() < 1e-9 * np.abs(exact).max()
    assert np.abs(forces(2 * degree - 1 - (degree == 1)) - exact).max() > 1e-3 * np.abs(exact).max()  # no fewer do


@pytest.mark.parametrize("dim", [2, 3])
def test_other_cells_get_more_points(dim: int) -> None:
    """Any vertex of any cell may be in the wrong place, by little."""
    mesh = cells(dim, SHEARED)
    assert parallelepipeds(mesh)
    x = mesh.geometry.x
    for vertex in range(len(x)):
        x[vertex, 0] += 1e-4
        assert not parallelepipeds(mesh), vertex
        assert strain_degree(fem.functionspace(mesh, ("Lagrange", 1, (dim,)))) == 4
        x[vertex, 0] -= 1e-4
    space = fem.functionspace(mesh, ("Lagrange", 1, (dim,)))
    if dim == 2:  # the radius is not constant in a cell
        assert strain_degree(space, AXISYMMETRIC) == 6
