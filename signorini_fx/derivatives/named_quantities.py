"""Results of a scene by their names."""

from __future__ import annotations

import shlex
from collections.abc import Callable

import numpy as np
import ufl
from dolfinx import fem

from signorini_fx import parallel
from signorini_fx.body.assembly import assemble, measure
from signorini_fx.body.discretisation import Discretisation
from signorini_fx.derivatives.quantities import ContactArea, ContactForce, LargestPressure, OfDisplacement, Quantity
from signorini_fx.errors import MeshError, SceneError

_POWER = 8.0
_KINDS = (
    "'force BOUNDARY AXIS' or 'moment BOUNDARY [AXIS]' of a contact, 'pressure BOUNDARY [POWER]', the largest one, "
    "'area BOUNDARY [POWER]', that presses, "
    "'mean BOUNDARY AXIS', of the displacement, and 'displacement X,Y[,Z] AXIS', at a point"
)


def quantity_of(d: Discretisation, text: str) -> Quantity:
    """A result by its name; collective.

    Args:
        d: the scene on its mesh.
        text: ``force BOUNDARY AXIS`` and ``moment BOUNDARY [AXIS]`` on the body at a contact boundary, a moment about
            the origin, in space about an axis; ``pressure BOUNDARY [POWER]``, see ``LargestPressure``; ``area BOUNDARY
            [POWER]``, see ``ContactArea``;
            ``mean BOUNDARY AXIS``, the mean displacement; ``displacement X,Y[,Z] AXIS`` at a point.

    Raises:
        SceneError: it is not known, or has no derivative.
    """
    try:
        kind, *words = shlex.split(text)
    except ValueError:
        kind, words = text, []
    try:
        return _NAMED[kind](d, *words)
    except (KeyError, TypeError, ValueError):
        raise SceneError([(f"of {text!r}", f"is no result; there are {_KINDS}")]) from None


def _axis(d: Discretisation, name: str) -> int:
    axis = "xyz"[: d.dimension].index(name)
    if len(name) != 1:
        raise ValueError(name)
    return axis


def _part(d: Discretisation, boundary: str) -> int:
    names = [effect.boundary for effect in d.scene.contact]
    if boundary not in names:
        raise SceneError([(f"of {boundary!r}", f"is no contact boundary; there are: {', '.join(names)}")])
    return names.index(boundary)


def _force(d: Discretisation, boundary: str, axis: str) -> Quantity:
    return ContactForce(_part(d, boundary), _axis(d, axis))


def _moment(d: Discretisation, boundary: str, axis: str = "z") -> Quantity:
    if d.dimension == 2 and axis != "z":
        raise ValueError(axis)
    if reason := d.kinematics.refuses.get("moment"):
        raise SceneError([(f"of moment {boundary}", reason)])
    return ContactForce(_part(d, boundary), 0 if d.dimension == 2 else _axis(d, axis), moment=True)


def _pressure(d: Discretisation, boundary: str, power: str = str(_POWER)) -> Quantity:
    number = float(power)
    if not 1 < number <= 1000:
        raise SceneError([(f"of pressure {boundary} {power}", "the power must be above 1, and 1000 at most")])
    return LargestPressure(_part(d, boundary), number)


def _area(d: Discretisation, boundary: str, power: str = "2") -> Quantity:
    number = float(power)
    if not 1 < number <= 1000:
        raise SceneError([(f"of area {boundary} {power}", "the power must be above 1, and 1000 at most")])
    return ContactArea(_part(d, boundary), number)


def _mean(d: Discretisation, boundary: str, axis: str) -> Quantity:
    z, component = ufl.TestFunction(d.space), _axis(d, axis)
    try:
        facets = d.tagged.facets(boundary)
    except MeshError as error:
        raise SceneError([(f"of mean {boundary}", str(error))]) from None
    ds = measure(d.space.mesh, [facets], {})(1)
    form = d.inventory.compile(f"mean of {boundary}", lambda: fem.form(z[component] * d.coefficients.around * ds))
    row = assemble(form)
    area = float(parallel.global_sum(d.comm, row.sum()))
    if area == 0:
        raise SceneError([(f"of mean {boundary}", "this boundary has no area")])
    return OfDisplacement(np.asarray(row / area, dtype=np.float64))


def _displacement(d: Discretisation, point: str, axis: str) -> Quantity:
    x = np.array([float(coordinate) for coordinate in point.split(",")])
    if x.size != d.dimension:
        raise ValueError(point)
    quantity = OfDisplacement.at_point(d.space, x, _axis(d, axis))
    if quantity is None:
        raise SceneError([(f"of displacement {point}", "this point is outside of the body")])
    return quantity


_NAMED: dict[str, Callable[..., Quantity]] = {
    "force": _force,
    "moment": _moment,
    "pressure": _pressure,
    "area": _area,
    "mean": _mean,
    "displacement": _displacement,
}
