"""What a shape of a user's own does not say: how large it is, and where it is on its way.

Its distance says the first: from a point p of its surface, along the normal n into it, phi(p - t n) = -t as long as the
ball of radius t that touches the surface there is inside.  The largest of these balls is found by doubling and halving
t.  It is no larger than the largest one that there is; of a ball it is the ball itself.

What ``moved_from`` says of its closest points is a rigid motion, a shift and a turn: a share of the way is a share of
both.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from signorini_fx.extensions import is_of_package
from signorini_fx.machine import parallel
from signorini_fx.mechanics.statement.rigid_shape import Shape
from signorini_fx.tuned import SAME_LENGTH, SAMPLED_POINTS, SMALLEST_SHAPE, WRONG_NORMAL

Array = npt.NDArray[np.float64]


def inradius_of(comm: MPI.Comm, shape: Any, x: Array) -> float:
    """Radius of the largest ball in a shape, or a bound below it, length; infinite where there is none; collective.

    Args:
        comm: of the body.
        shape: with a method ``distance``, see ``Shape``; what it says itself holds.
        x: points of this rank to which the shape is near, length, shape (n, d).
    """
    of_class = getattr(type(shape), "inradius", None)
    if is_of_package(type(shape)) or (hasattr(shape, "inradius") and of_class is not Shape.inradius):
        return float(shape.inradius)
    size = float(np.linalg.norm(np.ptp(parallel.global_bounds(comm, x), axis=0)))
    return parallel.global_max(comm, _largest_ball(shape, x, size) if len(x) else 0.0) or math.inf


def _largest_ball(shape: Any, x: Array, size: float) -> float:
    """Radius of the largest ball found, zero: none, infinite: it is larger than the body."""
    signed, normal = shape.distance(x)
    nearest = np.argsort(np.abs(signed), kind="stable")[:SAMPLED_POINTS]
    chosen = np.union1d(nearest, np.linspace(0, len(x) - 1, SAMPLED_POINTS).astype(np.int64))
    surface, normal = (x - signed[:, None] * normal)[chosen], np.asarray(normal)[chosen]

    def inside(radius: float) -> npt.NDArray[np.bool_]:
        return np.asarray(-shape.distance(surface - radius * normal)[0] >= (1 - WRONG_NORMAL) * radius)

    largest, radius = 0.0, SMALLEST_SHAPE * size
    while radius < 2 * size:
        fits = inside(radius)
        if not fits.any():
            break
        largest, surface, normal, radius = radius, surface[fits], normal[fits], 2 * radius
    if radius >= 2 * size or largest == 0.0:
        return math.inf if largest else 0.0
    beyond = 2 * largest
    for _ in range(4):
        radius = (largest + beyond) / 2
        fits = inside(radius)
        if fits.any():
            largest, surface, normal = radius, surface[fits], normal[fits]
        else:
            beyond = radius
    return largest


@dataclass(frozen=True)
class OnWay:
    """A shape after a share of its way.

    Attributes:
        shape: where it ends.
        middle: a point of it, where it is and where it ends, length, shapes (d,).
        turn: the rotation from there to where it ends, shape (d, d).
    """

    shape: Any
    middle: tuple[Array, Array]
    turn: Array

    def distance(self, x: Array) -> tuple[Array, Array]:
        """See ``Shape``."""
        begin, end = self.middle
        signed, normal = self.shape.distance((x - begin) @ self.turn.T + end)
        return signed, normal @ self.turn


def on_way(comm: MPI.Comm, shape: Any, earlier: Any, share: float, x: Array) -> Any:
    """A shape after a share of the way from where ``earlier`` is; collective.

    A shape of a user's own that turns does so about a point that moves straight on, and is now in the middle of x.

    Args:
        comm: of the body.
        shape: with methods ``distance`` and ``moved_from``, see ``Shape``.
        earlier: the same shape elsewhere.
        share: from 0 to 1.
        x: points of this rank to which it is near, length, shape (n, d).
    """
    if isinstance(shape, Shape):
        return shape.on_way_from(earlier, share, x.shape[1])
    end = parallel.global_bounds(comm, x).mean(axis=0)
    if not len(x):
        return shape
    signed, normal = shape.distance(x)
    ended = x - signed[:, None] * normal
    begun = ended - shape.moved_from(earlier, x)
    turn = _turn(begun - begun.mean(axis=0), ended - ended.mean(axis=0))
    begin = begun.mean(axis=0) + (end - ended.mean(axis=0)) @ _rotation(turn, len(end))
    return OnWay(shape, ((1 - share) * begin + share * end, end), _rotation((1 - share) * turn, len(end)))


def _turn(begun: Array, ended: Array) -> Array:
    """The rotation that leads points to others best, by least squares, radians, shape (3,)."""
    from scipy.spatial.transform import Rotation

    if np.abs(ended - begun).max(initial=0.0) <= SAME_LENGTH * np.abs(ended).max(initial=0.0):
        return np.zeros(3)
    in_space = [np.pad(points, ((0, 0), (0, 3 - points.shape[1]))) for points in (ended, begun)]
    return np.asarray(Rotation.align_vectors(*in_space)[0].as_rotvec())


def _rotation(vector: Array, dimension: int) -> Array:
    """The matrix of a rotation, shape (d, d)."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(vector).as_matrix()[:dimension, :dimension])
