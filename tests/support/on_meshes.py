"""Spaces, sides and values on meshes, which many tests need."""

import numpy as np
import ufl
from dolfinx import fem

from signorini_fx.machine import compat


def vector_space(mesh, degree=1, components=None):
    """Continuous elements with as many components as the mesh has axes, or others."""
    return fem.functionspace(mesh, ("Lagrange", degree, (components or mesh.geometry.dim,)))


def at_coordinate(axis, value, **tolerance):
    """Whether points have a coordinate, as dolfinx asks for it."""
    return lambda x: np.isclose(x[axis], value, **tolerance)


def trial_and_test(space):
    """The arguments of a bilinear form."""
    return ufl.TrialFunction(space), ufl.TestFunction(space)


def no_load(mesh, v):
    """The linear form of a body without loads."""
    return ufl.inner(fem.Constant(mesh, (0.0,) * mesh.geometry.dim), v) * ufl.dx


def nodes(solution):
    """Positions and displacements of the nodes of this rank."""
    x = solution.displacement.function_space.tabulate_dof_coordinates()
    return x, solution.displacement.x.array.reshape(len(x), -1)


def tensors(function):
    """Values of a tensor, shape (n, 3, 3)."""
    return function.x.array.reshape(-1, 3, 3)


def function_of_cells(mesh):
    """A function that is constant on each cell."""
    return fem.Function(fem.functionspace(mesh, ("DG", 0)))


def corners_of_cells(tagged):
    """Positions of the nodes of each cell, shape (cells, nodes, 3)."""
    return tagged.mesh.geometry.x[compat.geometry_cells(tagged.mesh)]


def turn_by(angle):
    """The rotation of the plane by an angle."""
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def hooke_stress(strain, young, poisson):
    """The stress of isotropic elasticity, plane strain or space."""
    volume = poisson / (1 - 2 * poisson) * ufl.tr(strain) * ufl.Identity(strain.ufl_shape[0])
    return young / (1 + poisson) * (strain + volume)


def strain_of_section(y, r):
    """The strain of a body of revolution by its displacement, with torsion."""
    around = ufl.outer(ufl.as_vector([-y[2], 0, y[0]]) / r, ufl.unit_vector(2, 3))
    return ufl.sym(ufl.grad(y) + around)
