"""Scalar results of a solution, with their derivatives with respect to the displacement and to the
contact tractions.
"""

from __future__ import annotations

import shlex
from collections.abc import Callable
from dataclasses import dataclass

# Imported first: PETSc and dolfinx from PyPI use the MPI library that is loaded already.
import mpi4py.MPI  # noqa: F401
import numpy as np
import ufl
from dolfinx import fem, la

from signorini_fx.arrays import Array, rmatvec
from signorini_fx.errors import MeshError, SceneError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import assemble, compile_form, measure
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.mesh.points import cells_of_points
from signorini_fx.mechanics.model import Model
from signorini_fx.tuned import DIGITS_OF_FILES


class Functional:
    """A scalar result J(y, lambda, mu) of displacement, contact pressure and shear."""

    def value(
        self, y: fem.Function, boundary: ContactBoundary, pressure: Array, shear: Array
    ) -> float:
        """Return J; collective."""
        raise NotImplementedError

    def by_displacement(self, y: fem.Function) -> Array | None:
        """Return dJ/dy at the owned dofs, or None if J does not depend on the displacement;
        collective.
        """
        return None

    def by_traction(self, boundary: ContactBoundary, pressure: Array, shear: Array) -> Array:
        """Return the derivative with respect to (lambda, mu) at each contact point, divided by its
        weight, shape (n, d); collective.
        """
        return np.zeros((pressure.size, 1 + shear.shape[1]))


@dataclass(frozen=True)
class Gradient:
    """The derivatives of a result with respect to Constants.

    Attributes:
        value: the result.
        derivatives: the derivative with respect to each Constant, shape (n,).
        between: number of contact points on the border of two active sets, where the derivatives
            are one-sided.
    """

    value: float
    derivatives: Array
    between: int


@dataclass(frozen=True)
class OfDisplacement(Functional):
    """A linear functional of the displacement."""

    row: Array  # coefficients at the owned dofs

    def value(
        self, y: fem.Function, boundary: ContactBoundary, pressure: Array, shear: Array
    ) -> float:
        return parallel.total(boundary.comm, self.row @ y.x.array[: self.row.size])

    def by_displacement(self, y: fem.Function) -> Array | None:
        return self.row


@dataclass(frozen=True)
class ContactForce(Functional):
    """A component of the contact force on the body at one boundary, or of its moment about the
    origin.
    """

    part: int  # number of the contact
    component: int  # axis of the force or moment; unused for a moment in 2D
    moment: bool = False  # whether it is a moment

    def directions(self, boundary: ContactBoundary) -> Array:
        """Return the direction along which the traction of each point counts, zero off the
        boundary, shape (n, d).

        For a moment in 3D it is the axis times the arm, in 2D the arm turned by 90 degrees.
        """
        directions = np.zeros_like(boundary.normal)
        on_part = boundary.part == self.part
        if not self.moment:
            directions[on_part, self.component] = 1.0
            return directions
        arm = boundary.centre[on_part]
        if directions.shape[1] == 2:
            directions[on_part] = np.column_stack((-arm[:, 1], arm[:, 0]))
        else:
            directions[on_part] = np.cross(np.eye(3)[self.component], arm)
        return directions

    def value(
        self, y: fem.Function, boundary: ContactBoundary, pressure: Array, shear: Array
    ) -> float:
        force = -(boundary.nodal_forces(pressure, shear) * self.directions(boundary)).sum()
        return parallel.total(boundary.comm, force)

    def by_traction(self, boundary: ContactBoundary, pressure: Array, shear: Array) -> Array:
        return -rmatvec(boundary.frames, self.directions(boundary))


@dataclass(frozen=True)
class LargestPressure(Functional):
    """The largest pressure of one contact boundary, smoothed: (mean of lambda^p)^(1/p), a stress.

    It is below the largest pressure, and tends to it as p grows.
    """

    part: int  # number of the contact
    power: float  # the power p

    def value(
        self, y: fem.Function, boundary: ContactBoundary, pressure: Array, shear: Array
    ) -> float:
        return self._norm(boundary, pressure)

    def _norm(self, boundary: ContactBoundary, pressure: Array) -> float:
        on_part = boundary.part == self.part
        pushing = np.where(on_part, np.maximum(pressure, 0.0), 0.0)
        largest = parallel.largest(boundary.comm, pushing)
        if largest == 0:
            return 0.0
        sums = np.array(
            [boundary.weight @ (pushing / largest) ** self.power, boundary.weight[on_part].sum()]
        )
        power, area = parallel.global_sum(boundary.comm, sums)
        return float(largest * (power / area) ** (1 / self.power))

    def by_traction(self, boundary: ContactBoundary, pressure: Array, shear: Array) -> Array:
        slopes = np.zeros((pressure.size, 1 + shear.shape[1]))
        on_part = boundary.part == self.part
        value = self._norm(boundary, pressure)
        if value > 0:
            area = parallel.global_sum(boundary.comm, boundary.weight[on_part].sum())
            slopes[:, 0] = (
                np.where(on_part, np.maximum(pressure, 0.0) / value, 0.0) ** (self.power - 1) / area
            )
        return slopes


def functional_of(model: Model, text: str) -> Functional:
    """Return the functional of a result by its name; collective.

    Args:
        model: the body of a scene, or of forms.
        text: ``force BOUNDARY AXIS`` or ``moment BOUNDARY [AXIS]``, on the body at a contact
            boundary, a moment about the origin, in 3D about an axis; ``pressure BOUNDARY [POWER]``,
            see ``LargestPressure``; ``mean BOUNDARY AXIS``, the mean displacement;
            ``displacement X,Y[,Z] AXIS``, at a point.

    Raises:
        SceneError: the name is unknown, or the result has no derivative.
    """
    known = {request.split()[0]: find for request, find in DIFFERENTIABLE.items()}
    try:
        name, *words = shlex.split(text)
        return known[name](model, *words)
    except (KeyError, TypeError, ValueError):  # unknown name, or wrong arguments
        there = ", ".join(map(repr, DIFFERENTIABLE))
        raise SceneError.at(f"of {text!r}", f"is no result; there are {there}") from None


def _force(model: Model, boundary: str, axis: str) -> Functional:
    """Return a component of the resultant contact force on one boundary, friction included."""
    return ContactForce(_contact_of(model, boundary), _axis_of(model.dimension, axis))


def _moment(model: Model, boundary: str, axis: str = "z") -> Functional:
    """Return a component of the resultant contact moment on one boundary about the origin, friction
    included; in 2D there is only one.
    """
    if model.dimension == 2 and axis != "z":
        raise ValueError(axis)
    if reason := model.kinematics.refuses.get("moment"):
        raise SceneError.at(f"of moment {boundary}", reason)
    component = 0 if model.dimension == 2 else _axis_of(model.dimension, axis)
    return ContactForce(_contact_of(model, boundary), component, moment=True)


def _pressure(model: Model, boundary: str, power: str = "8") -> Functional:
    part = _contact_of(model, boundary)
    number = float(power)
    if not 1 < number <= 1000:
        raise SceneError.at(
            f"of pressure {boundary} {power}", "the power must be above 1, and 1000 at most"
        )
    return LargestPressure(part, number)


def _mean(model: Model, boundary: str, axis: str) -> Functional:
    """Return the mean displacement of a boundary along an axis."""
    z = ufl.TestFunction(model.space)
    component = _axis_of(model.dimension, axis)
    try:
        facets = model.tagged.facets(boundary)
    except MeshError as error:
        raise SceneError.at(f"of mean {boundary}", str(error)) from None
    ds = measure(model.space.mesh, [facets], {})(1)
    around = model.kinematics.measure(ufl.SpatialCoordinate(model.space.mesh))
    weights = assemble(compile_form(z[component] * around * ds))
    area = parallel.total(model.comm, weights)
    if area == 0:
        raise SceneError.at(f"of mean {boundary}", "this boundary has no area")
    return OfDisplacement(np.asarray(weights / area, dtype=np.float64))


def _displacement(model: Model, point: str, axis: str) -> Functional:
    """Return the displacement of a point along an axis."""
    at = [float(coordinate) for coordinate in point.split(",")]
    dim = model.dimension
    space = model.space
    component = _axis_of(dim, axis)
    x = np.zeros((1, 3))
    if len(at) != dim:
        raise ValueError(point)
    x[0, :dim] = at
    cells, reference_points, gap = cells_of_points(space.mesh, x, DIGITS_OF_FILES)
    gaps = model.comm.allgather(float(gap[0]))
    if np.isinf(min(gaps)):
        raise SceneError.at(f"of displacement {point}", "this point is outside of the body")
    row = fem.Function(space)
    if int(np.argmin(gaps)) == model.comm.rank:
        basis = space.element.basix_element.tabulate(0, np.ascontiguousarray(reference_points))[
            0
        ].reshape(-1)
        row.x.array[dim * space.dofmap.list[cells[0]] + component] = basis
    row.x.scatter_reverse(la.InsertMode.add)
    return OfDisplacement(row.x.array[: space.dofmap.index_map.size_local * dim].copy())


# The text by which a result is requested, and the function that makes its functional.
DIFFERENTIABLE: dict[str, Callable[..., Functional]] = {
    "force BOUNDARY AXIS": _force,
    "pressure BOUNDARY [POWER]": _pressure,
    "moment BOUNDARY [AXIS]": _moment,
    "mean BOUNDARY AXIS": _mean,
    "displacement X,Y[,Z] AXIS": _displacement,
}


def _axis_of(dimension: int, name: str) -> int:
    return list("xyz"[:dimension]).index(name)


def _contact_of(model: Model, boundary: str) -> int:
    names = [effect.boundary for effect in model.contacts]
    if boundary not in names:
        raise SceneError.at(
            f"of {boundary!r}", f"is no contact boundary; there are: {', '.join(names)}"
        )
    return names.index(boundary)
