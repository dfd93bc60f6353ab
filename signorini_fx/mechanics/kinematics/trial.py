"""What kinematics of another package say of themselves, tried before anything is assembled with them."""

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

    The strain of displacements that are linear in the position is tried at points with x[0] > 0.
    """
    from signorini_fx.mechanics.kinematics import KINDS

    if is_of_package(type(kinematics)) and kinematics.words in [kind.words for kind in KINDS]:
        return ""
    random, name, dim = np.random.default_rng(0), kinematics.words, kinematics.dimension
    if dim not in (2, 3):
        return f"{name!r} has {dim} components of the displacement, not 2 or 3"
    points: _Floats = random.uniform(0.5, 1.5, size=(_POINTS, 2))
    fields = [(random.normal(size=(dim, 2)), random.normal(size=dim)) for _ in range(2)]
    fields.append((fields[0][0] - 2 * fields[1][0], fields[0][1] - 2 * fields[1][1]))
    try:
        (first, measures), (second, _), (together, _) = (_tried(kinematics, *field, points) for field in fields)
        moved = [
            _tried(kinematics, fields[0][0] + slope, fields[0][1] + offset, points)[0]
            for slope, offset in _motions_without_strain(kinematics)
        ]
    except Exception as error:
        return f"strain or measure of {name!r} cannot be evaluated: {type(error).__name__}: {error}"
    least = CERTIFICATE_TOLERANCE * np.abs(first).max()
    if not np.abs(together - (first - 2 * second)).max() <= least:
        return f"strain of {name!r} is not finite, or not linear in the displacement"
    if any(np.abs(strain - first).max() > least for strain in moved):
        return f"strain of {name!r} is not zero on its motions_without_strain"
    if not measures.min() > 0:
        return f"measure of {name!r} is not positive"
    return ""


def _motions_without_strain(kinematics: Kinematics) -> list[tuple[_Floats, _Floats]]:
    """Those of points of the mesh, as slope and offset."""
    dim, motions = kinematics.dimension, list[tuple[_Floats, _Floats]]()
    motions += [(np.zeros((dim, 2)), unit) for unit in np.eye(dim)]
    for first, second in kinematics.rotations:
        slope = np.zeros((dim, 3))
        slope[second, first], slope[first, second] = 1.0, -1.0
        motions.append((slope[:, :2], np.zeros(dim)))
    return [motion for motion, free in zip(motions, kinematics.unbalanced, strict=True) if free]


def _tried(kinematics: Kinematics, slope: _Floats, offset: _Floats, points: _Floats) -> tuple[_Floats, _Floats]:
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
