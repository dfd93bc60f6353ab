"""What kinematics of another package say twice, tried before anything is assembled with them."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.extensions import is_of_package
from signorini_fx.mechanics.kinematics.protocol import Kinematics
from signorini_fx.tuned import CERTIFICATE_TOLERANCE

_Floats = npt.NDArray[np.float64]
_POINTS = 5


def fault_of(kinematics: Kinematics) -> str:
    """What kinematics say of themselves and do not keep; "": nothing was found, or they are of this package.

    The strain of displacements that are linear is compared with that of their gradients, whose third column is
    ``third_column``, and the measure with ``measure_at``, at points with x[0] > 0.
    """
    from signorini_fx.mechanics.kinematics import KINDS

    if is_of_package(type(kinematics)) and kinematics.words in [kind.words for kind in KINDS]:
        return ""
    random, name, dim = np.random.default_rng(0), kinematics.words, kinematics.dimension
    if dim not in (2, 3):
        return f"{name!r} has {dim} components of the displacement, not 2 or 3"
    points: _Floats = random.uniform(0.5, 1.5, size=(_POINTS, 2))
    slope: _Floats = random.normal(size=(dim, 2))
    offset: _Floats = random.normal(size=dim)
    try:
        strains, measures = _as_the_solver(kinematics, slope, offset, points)
    except Exception as error:
        return f"strain or measure of {name!r} cannot be evaluated: {type(error).__name__}: {error}"
    try:
        claimed = _by_gradients(kinematics, slope, offset, points)[:, : strains.shape[1], : strains.shape[2]]
        measure = kinematics.measure_at(points)
    except Exception as error:
        return f"third_column or measure_at of {name!r} fails: {type(error).__name__}: {error}"
    if np.abs(claimed - strains).max() > CERTIFICATE_TOLERANCE * np.abs(strains).max():
        return f"third_column of {name!r} is not that of its strain"
    expected = np.ones(_POINTS) if measure is None else np.asarray(measure)
    if expected.shape != measures.shape or np.abs(expected - measures).max() > CERTIFICATE_TOLERANCE * measures.max():
        return f"measure_at of {name!r} is not its measure"
    if not measures.min() > 0:
        return f"measure of {name!r} is not positive"
    return ""


def _as_the_solver(kinematics: Kinematics, slope: _Floats, offset: _Floats, points: _Floats) -> tuple[_Floats, _Floats]:
    """Strains, shape (n, d, d), and measures, shape (n,), by UFL."""
    import basix.ufl
    import ufl
    from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering
    from ufl.algorithms.apply_derivatives import apply_derivatives

    x = ufl.SpatialCoordinate(ufl.Mesh(basix.ufl.element("Lagrange", "triangle", 1, shape=(2,))))
    y = ufl.as_vector([float(offset[i]) + sum(float(slope[i, k]) * x[k] for k in range(2)) for i in range(len(slope))])

    def at_points(expression: Any) -> _Floats:
        lowered = apply_derivatives(apply_algebra_lowering(ufl.as_ufl(expression)))
        entries = [lowered[index] for index in np.ndindex(lowered.ufl_shape)] if lowered.ufl_shape else [lowered]
        values = [[float(entry(tuple(point))) for entry in entries] for point in points]
        return np.array(values).reshape(len(points), *lowered.ufl_shape)

    return at_points(kinematics.strain(y)), at_points(kinematics.measure(x))


def _by_gradients(kinematics: Kinematics, slope: _Floats, offset: _Floats, points: _Floats) -> _Floats:
    """Strains as the certificate has them, shape (n, 3, 3)."""
    gradient = np.zeros((len(points), 3, 3))
    gradient[:, : len(slope), :2] = slope
    if (column := kinematics.third_column) is not None:
        gradient[:, :, 2] = (points @ slope.T + offset) @ np.asarray(column).T / points[:, :1]
    return np.asarray((gradient + gradient.swapaxes(1, 2)) / 2)
