"""On parallelepipeds fewer points integrate the stiffness exactly; on other cells they are not used."""

from __future__ import annotations

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from scenes import example1

from signorini_fx.mechanics.assembly import quadrature
from signorini_fx.mechanics.assembly.mesh_entities import stiffness_form
from signorini_fx.mechanics.assembly.quadrature import parallelepipeds, strain_degree
from signorini_fx.mechanics.body.discretisation import discretise
from signorini_fx.mechanics.kinematics import AXISYMMETRIC
from signorini_fx.mechanics.materials.isotropic import elastic_forms
from signorini_fx.records import Timings
from signorini_fx.results.accuracy import stress_recovery
from signorini_fx.scenes.mesh import load_mesh

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


def test_reordered_sums_differ_by_round_off() -> None:
    """The stiffness of curved cells in 3D, compiled so that sums may be reordered, and as dolfinx compiles it."""
    mesh = cells(3)
    mesh.geometry.x[:, 2] += 0.2 * mesh.geometry.x[:, 0] ** 2 + 0.1 * mesh.geometry.x[:, 0] * mesh.geometry.x[:, 1]
    space = fem.functionspace(mesh, ("Lagrange", 1, (3,)))
    (term,) = elastic_forms(ufl.TrialFunction(space), ufl.TestFunction(space), 3.0, 2.0, strain_degree(space))
    plain, fast = (fem.assemble_matrix(form).to_dense() for form in (fem.form(term), stiffness_form(term, 3)))
    assert np.abs(fast - plain).max() < 1e-14 * np.abs(plain).max()


def test_triangles_as_before() -> None:
    """The strain of linear triangles is constant."""
    mesh = dmesh.create_unit_square(MPI.COMM_SELF, 2, 2)
    assert not parallelepipeds(mesh)
    assert strain_degree(fem.functionspace(mesh, ("Lagrange", 1, (2,)))) == 0


@pytest.mark.mpi
def test_ranks_agree() -> None:
    """One cell of another shape on one rank is enough for all, also for those to which it is not even a ghost."""
    comm = MPI.COMM_WORLD
    mesh = dmesh.create_unit_square(comm, 24, 2, dmesh.CellType.quadrilateral)
    assert parallelepipeds(mesh)
    corner = np.linalg.norm(mesh.geometry.x, axis=1) < 1e-12
    mesh.geometry.x[corner, 0] -= 0.1
    assert not parallelepipeds(mesh)


@pytest.mark.parametrize("degree", [1, 2])
def test_stress_recovery_is_the_same(monkeypatch, degree: int) -> None:
    """With the points that UFL chooses for any cell, the estimated error of each cell has the same square."""
    scene = example1(bound=1.5, nx=6, ny=2)
    scene = scene.model_copy(update={"element": scene.element.model_copy(update={"degree": degree})})
    d = discretise(scene.statement, load_mesh(scene, MPI.COMM_SELF), Timings())
    y = fem.Function(d.space)
    y.x.array[:] = np.random.default_rng(degree).normal(size=d.dofs)
    fewer = stress_recovery.StressRecovery.of(d).squares(y)
    monkeypatch.setattr(stress_recovery, "parallelepipeds", lambda mesh: False)
    assert fewer == pytest.approx(stress_recovery.StressRecovery.of(d).squares(y), rel=1e-9)


def test_cells_are_looked_at_once_unless_nodes_are_moved(monkeypatch) -> None:
    """The mesh stays the same object."""
    mesh, looked = cells(2), []
    affine = quadrature._affine
    monkeypatch.setattr(quadrature, "_affine", lambda of: looked.append(of) or affine(of))
    assert all(parallelepipeds(mesh) for _ in range(3))
    assert len(looked) == 1
    mesh.geometry.x[0, 0] += 0.1
    assert not parallelepipeds(mesh)
    assert len(looked) == 2
