"""Hyperelastic rectangles for the tests of nonlinear bodies."""

import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from on_meshes import vector_space
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from signorini_fx import Foundation, NonlinearContactProblem

YOUNG, POISSON = 100.0, 0.3
MU, LAME = YOUNG / 2 / (1 + POISSON), YOUNG * POISSON / (1 + POISSON) / (1 - 2 * POISSON)
PLATE = {"shape": "plane", "point": (0.0, 1.0), "normal": (0.0, -1.0)}


class Killed(Exception):
    """The end of a run that is gone on with."""


def rectangle(corner, cells, comm=MPI.COMM_SELF, cell="quadrilateral", degree=1):
    """A mesh from the origin to a corner, its vector space, and its sides by the axis and the
    coordinate.
    """
    mesh = dmesh.create_rectangle(comm, [[0.0, 0.0], corner], cells, getattr(dmesh.CellType, cell))
    space = vector_space(mesh, degree)

    def side(axis, at):
        return dmesh.locate_entities_boundary(mesh, 1, lambda x: np.isclose(x[axis], at))

    return space, side


def held(space, facets, component=None):
    """A condition of zero displacement."""
    where = space if component is None else space.sub(component)
    dofs = fem.locate_dofs_topological(where, space.mesh.topology.dim - 1, facets)
    return fem.dirichletbc(
        0.0 if component is not None else np.zeros(space.mesh.geometry.dim), dofs, where
    )


def neo_hooke(u, radius=None):
    """mu / 2 (tr C - d) - mu ln J + lambda / 2 ln^2 J, in 2D of plane strain; with a radius, which
    is x[0], of a
    body of revolution.
    """
    dim = len(u)
    gradient = ufl.Identity(dim) + ufl.grad(u)
    around = 1.0 if radius is None else 1.0 + u[0] / radius
    square, volume = (
        ufl.inner(gradient, gradient) - dim + around**2 - 1.0,
        around * ufl.det(gradient),
    )
    return MU / 2 * square - MU * ufl.ln(volume) + LAME / 2 * ufl.ln(volume) ** 2


def polynomial(u):
    """The same up to third order of the strain, finite for every displacement."""
    gradient = ufl.Identity(2) + ufl.grad(u)
    growth = ufl.det(gradient) - 1
    return MU / 2 * (ufl.inner(gradient, gradient) - 2) - MU * growth + (LAME + MU) / 2 * growth**2


def residual(u, energy=neo_hooke):
    """The form F of an energy."""
    return ufl.derivative(energy(u) * ufl.dx, u, ufl.TestFunction(u.function_space))


def under_shape(
    shape,
    corner=(1.0, 1.0),
    cells=(2, 2),
    *,
    sides=None,
    comm=MPI.COMM_SELF,
    degree=1,
    energy=neo_hooke,
    friction=None,
    make=NonlinearContactProblem,
    **options,
):
    """A rectangle that is held at its bottom, and a shape at its top or other sides."""
    space, side = rectangle(list(corner), list(cells), comm, degree=degree)
    touching = np.unique(np.concatenate([side(*where) for where in sides or [(1, corner[1])]]))
    u = fem.Function(space)
    contact = Foundation(touching, shape=shape, friction=friction)
    bcs = [held(space, side(1, 0.0))]
    return make(residual(u, energy), u, bcs=bcs, contact=contact, **options)


def stress_of_block(height, directions=1):
    """Nominal stress of a block whose sides are free, compressed to a height of 1; ``directions``:
    in how many it is free to widen, 1: plane strain, 2: a cylinder.
    """

    def volume(width):
        return np.log(width**directions * height)

    free = brentq(lambda width: MU * (width**2 - 1) + LAME * volume(width), 0.5, 3.0)
    return (MU * (height**2 - 1) + LAME * volume(free)) / height


def inside_of_tube(inner, outer, pressure=0.0, inertia=0.0):
    """The radius of the inside of a neo-Hookean tube in plane strain under a pressure there, whose
    density times the squared speed of rotation is ``inertia``, by radial equilibrium
    d P_R / dR + (P_R - P_Theta) / R + inertia r = 0.

    P_R = mu (a - 1 / a) + Lambda ln J / a, P_Theta likewise with the stretches a = dr / dR and
    b = r / R, J = a b.
    """

    def nominal(a, b):
        return MU * (a - 1 / a) + LAME * np.log(a * b) / a

    def slope(R, y):
        r, radial = y
        a = brentq(lambda a: nominal(a, r / R) - radial, 0.05, 5.0, xtol=1e-15)
        return [a, (nominal(r / R, a) - radial) / R - inertia * r]

    def outside(r):
        begin = [r, -pressure * r / inner]
        return solve_ivp(slope, (inner, outer), begin, rtol=1e-11, atol=1e-12).y[1, -1]

    return brentq(outside, inner * (1.0001 if pressure else 1.0), inner * 2.5, xtol=1e-13)
