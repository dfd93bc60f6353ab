"""Spaces and sides of meshes, which many tests need."""

import numpy as np
import ufl
from dolfinx import fem


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
