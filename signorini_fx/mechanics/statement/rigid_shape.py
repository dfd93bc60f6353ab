"""The base class of the rigid foundations in ``shapes/``, and how their classes are found.

Other packages add shapes by entry points:

    [project.entry-points."signorini_fx.shapes"]
    "rounded box" = "its.module:RoundedBox"

Such a class derives from ``Shape``, with its own keys and the method ``initial``; its distance is
tested at the contact points before anything is solved, see ``fault_of``.

A shape is a solid with a signed distance phi: positive outside, where the body is, and negative
inside.  Its gradient n_f at the closest point is the outward normal of the foundation.  A point x
that is displaced by u stays outside to first order if  -n_f . u <= phi(x):  the gap is the signed
distance, and the direction of contact is -n_f.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Protocol

import numpy as np
import numpy.typing as npt
from pydantic import BeforeValidator, TypeAdapter, ValidationError, WithJsonSchema

from signorini_fx.arrays import Array, Value
from signorini_fx.errors import SceneError
from signorini_fx.extensions import SHAPES, is_of_package, load_class, names_of
from signorini_fx.mechanics.statement.base import Table, problems_of
from signorini_fx.mechanics.statement.expressions import number, sample
from signorini_fx.mechanics.statement.rigid_body import (
    COMPONENTS,
    MESH_IS,
    RigidMotion,
    TimedAngle,
    TimedVector,
)
from signorini_fx.mechanics.statement.values import Vector, kind_of, shown
from signorini_fx.tuned import DIFFERENCE_STEP, SAME_LENGTH, WRONG_SLOPE, ZERO_IN_SOLUTION

# Shift, length, rotation, degrees, and pivot, length, as numbers; None: it has none.
Placement = tuple[
    tuple[float, ...] | None, float | tuple[float, ...] | None, tuple[float, ...] | None
]


class SignedDistance(Protocol):
    """The protocol of shapes of foundations: a solid with a signed distance."""

    def distance(self, x: Array) -> tuple[Array, Array]:
        """Return the signed distance of points of shape (n, d), length, shape (n,), and the outward
        normal at the closest point, shape (n, d).
        """


def unit(vector: Sequence[float]) -> Array:
    """Return the vector scaled to length one, shape (d,)."""
    components = np.array(vector)
    return components / np.linalg.norm(components)


def across(axis: Array) -> Array:
    """Return a unit vector perpendicular to a unit vector, shape (d,)."""
    coordinate_axis = np.eye(axis.size)[np.argmin(np.abs(axis))]
    perpendicular = coordinate_axis - (coordinate_axis @ axis) * axis
    return perpendicular / np.linalg.norm(perpendicular)


def normalised(vectors: Array, otherwise: Array, least: float = 0.0) -> tuple[Array, Array]:
    """Return the lengths of vectors, shape (n,), and the unit vectors, shape (n, d).

    Vectors no longer than ``least`` are replaced by ``otherwise``.
    """
    size = np.linalg.norm(vectors, axis=1)
    return size, np.where(
        size[:, None] > least, vectors / np.maximum(size, 1e-300)[:, None], otherwise
    )


def turning(rotation: float | tuple[float, ...], dimension: int) -> Array:
    """Return the matrix of a rotation in degrees, counterclockwise, shape (d, d).

    In 3D a vector [a, b, c] is the axis, and its length is the angle.
    """
    if isinstance(rotation, tuple):
        from scipy.spatial.transform import Rotation

        return Rotation.from_rotvec(np.radians(rotation)).as_matrix()
    if rotation == 0.0:
        return np.eye(dimension)
    cosine = math.cos(math.radians(rotation))
    sine = math.sin(math.radians(rotation))
    return np.array([[cosine, -sine], [sine, cosine]])


class Placed(Table):
    """What is turned about a pivot and then moved by a shift: a table with these keys, a shape or a
    body.
    """

    if TYPE_CHECKING:
        shift: TimedVector | None
        rotation: TimedAngle | None
        pivot: Vector | None

    def placing_contradictions(self, dimension: int) -> Iterator[tuple[str, str]]:
        """Yield the keys of vectors that do not fit the dimension of the mesh, with reasons."""
        where = MESH_IS[dimension]
        for key, value in self:
            vector = (
                isinstance(value, tuple)
                and key not in ("rotation", "moment", "moment_of_inertia")
                and not isinstance(value[0], tuple)
            )
            if vector and len(value) != dimension:
                yield key, f"{where}: give {dimension} numbers, not {len(value)}"
        if self.rotation is not None and isinstance(self.rotation, tuple) != (dimension == 3):
            yield (
                "rotation",
                f"{where}: give " + ("an angle" if dimension == 2 else "three numbers, the axis"),
            )

    def moved_back(self, x: Array) -> Array:
        """Return points transformed back to the initial placement of the shape, shape (n, d)."""
        moved, pivot = self._translations(x.shape[1])
        return (x - moved - pivot) @ self.turn_matrix(x.shape[1]) + pivot

    def moved_points(self, x: Array) -> Array:
        """Return points of the shape after its rotation and shift, shape (n, d)."""
        moved, pivot = self._translations(x.shape[1])
        return (x - pivot) @ self.turn_matrix(x.shape[1]).T + pivot + moved

    def _translations(self, dimension: int) -> tuple[Array, Array]:
        """Return shift and pivot, shapes (d,)."""
        zero = np.zeros(dimension)
        shift = (
            zero
            if self.shift is None
            else np.array([number(component) for component in self.shift])
        )
        return shift, zero if self.pivot is None else np.array(self.pivot)

    def turn_matrix(self, dimension: int) -> Array:
        """Return the matrix of its rotation, shape (d, d)."""
        return turning(self.angles(), dimension)

    def angles(self) -> float | tuple[float, ...]:
        """Return the rotation as numbers, degrees."""
        rotation = self.rotation
        return (
            tuple(map(number, rotation)) if isinstance(rotation, tuple) else number(rotation or 0.0)
        )


@dataclass(frozen=True)
class Corners:
    """The k convex corners of a foundation, sharp or rounded, and in 3D the e straight edges
    between its sides.

    Attributes:
        places: the corners, or the centres of their rounding, length, shape (k, d).
        radius: radius of the rounding, length, shape (k,); zero: sharp.
        sides: outward unit normals of the two sides that meet, in 3D of two opposite ones, shape
            (k, 2, d).
        edges: both ends of the edges, length, shape (e, 2, d).
    """

    places: Array
    radius: Array
    sides: Array
    edges: Array

    @classmethod
    def none(cls, dimension: int) -> Corners:
        """Return empty corners, for a smooth shape."""
        nothing = np.zeros((0, 2, dimension))
        return cls(nothing[:, 0], np.zeros(0), nothing, nothing)


class Shape(Placed, RigidMotion):
    """A rigid foundation that is a thing: the body is outside of it, or inside where it is hollow.

    Attributes:
        shape: its name.
        hollow: whether the foundation is all that the shape is not.
        shift: by which it is moved, lengths, numbers or expressions of the time t; None: not at
            all.
        rotation: by which it is turned before it is moved, degrees, counterclockwise; in 3D along
            the axis [a, b, c] by the length of this vector; of the same kinds; None: not at all.
        pivot: the point that it is turned about, the reference point where forces move it, length;
            None: the origin.
        rigid: the name of a rigid body that several contacts have, of which one says what drives
            it; None: none.
    """

    # The dimensions of space in which there is such a shape.
    exists_in: ClassVar[tuple[int, ...]] = (2, 3)
    asked_later = ("force", "moment", "prescribed")

    shape: str
    hollow: bool = False
    shift: TimedVector | None = None
    rotation: TimedAngle | None = None
    pivot: Vector | None = None
    rigid: str | None = None

    @property
    def inradius(self) -> float:
        """The radius of the largest ball in the shape, or a lower bound, length; infinite if there
        is none or it is unknown.
        """
        return math.inf

    @property
    def narrows(self) -> bool:
        """Whether some part of the shape may be narrower than a cell of the body, and so fit
        between nodes that are outside.
        """
        return not self.hollow

    @property
    def driven(self) -> bool:
        """Whether the motion of the shape is an unknown."""
        return self.drives or self.rigid is not None

    def initial(self, x: Array) -> tuple[Array, Array]:
        """Return the same as ``distance``, but before rotation and shift, and never hollow."""
        raise NotImplementedError

    def initial_corners(self, dimension: int) -> Corners:
        """Return the same as ``corners``, but before rotation and shift; for a hollow shape those
        of its surroundings.
        """
        return Corners.none(dimension)

    def corners(self, dimension: int) -> Corners:
        """Return the convex corners of the foundation at its present place, with which it may press
        between the nodes of a body.
        """
        found = self.initial_corners(dimension)
        turn = self.turn_matrix(dimension).T
        return replace(
            found,
            places=self.moved_points(found.places),
            sides=found.sides @ turn,
            edges=self.moved_points(found.edges.reshape(-1, dimension)).reshape(found.edges.shape),
        )

    def contradictions(self, dimension: int, *, turns: bool = True) -> Iterator[tuple[str, str]]:
        """Yield the keys that do not fit the dimension of the mesh, or that are missing, with
        reasons.

        ``turns``: whether a driven shape may rotate, which needs a pivot.
        """
        if dimension not in self.exists_in:
            yield "shape", f"{MESH_IS[dimension]}: there is no {self.shape}"
            return
        yield from self.placing_contradictions(dimension)
        yield from self.motion_contradictions(dimension)
        turns = turns and any(
            self.prescribes(key) != 0.0 for key in COMPONENTS[dimension][dimension:]
        )
        if self.drives and self.pivot is None and turns:
            yield "pivot", "give the point where the force acts, about which the foundation turns"

    def reference(self, dimension: int) -> Array:
        """Return the present position of the pivot, length, shape (d,)."""
        return np.asarray(sum(self._translations(dimension)))

    def distance(self, x: Array) -> tuple[Array, Array]:
        """Return the signed distance of points of shape (n, d), length, shape (n,), and the outward
        normal of the foundation at the closest point, shape (n, d).
        """
        signed, normal = self.initial(self.moved_back(x))
        normal = normal @ self.turn_matrix(x.shape[1]).T
        return (-signed, -normal) if self.hollow else (signed, normal)

    @property
    def placement(self) -> Placement:
        """The shift, rotation and pivot of the shape as numbers."""
        shift = None if self.shift is None else tuple(map(number, self.shift))
        pivot = None if self.pivot is None else tuple(self.pivot)
        return shift, None if self.rotation is None else self.angles(), pivot

    def placed_as(self, placement: Placement) -> Shape:
        """Return the shape with another placement; the same object if it does not change."""
        if placement == self.placement:
            return self
        return self.model_copy(
            update=dict(zip(("shift", "rotation", "pivot"), placement, strict=True))
        )

    def moved_from(self, earlier: Shape, x: Array) -> Array:
        """Return the displacement of the material points of the shape closest to x since the shape
        was placed like ``earlier``, length, shape (n, d).
        """
        signed, normal = self.distance(x)
        closest = x - signed[:, None] * normal
        return closest - earlier.moved_points(self.moved_back(closest))

    def on_way_from(self, earlier: Shape, share: float, dimension: int) -> Shape:
        """Return the shape after a share of the motion from the place of ``earlier``; the shift of
        the pivot and the rotation are interpolated.
        """
        moved, pivot = self._translations(dimension)
        begun = (earlier.moved_points(pivot[None]) - pivot)[0]
        zero = np.zeros(3 if dimension == 3 else 1)
        before = zero + np.array(earlier.angles())
        now = zero + np.array(self.angles())
        shift = ((1 - share) * begun + share * moved).tolist()
        turn = ((1 - share) * before + share * now).tolist()
        return self.model_copy(
            update={"shift": tuple(shift), "rotation": tuple(turn) if dimension == 3 else turn[0]}
        )


# --- as the data of a foundation ------------------------------------------------------------------


@dataclass(frozen=True)
class Distance:
    """The gap to a shape as a function of points, as foundations take it, length.

    ``shape``: has a method ``distance``; ``added``: is added to the distance, a number, an
    expression or a callable of the position.
    """

    shape: SignedDistance
    added: Value
    dimension: int

    def __call__(self, x: Array) -> Array:
        """Return the gap at points of shape (3, n), length, shape (n,)."""
        return self._of(x)[0] + sample(self.added, x)

    def direction(self, x: Array) -> Array:
        """Return the unit vector to the foundation, shape (d, n)."""
        return -self._of(x)[1].T

    def _of(self, x: Array) -> tuple[Array, Array]:
        return self.shape.distance(np.ascontiguousarray(x[: self.dimension].T))


def distance_from(source: Any, dimension: int, *, turns: bool = True) -> Distance:
    """Return the distance from a shape, from the table of one, or from any object with a method
    ``distance``.

    ``turns``: whether a shape that forces move may rotate; it may not on the axis of a body of
    revolution.

    Raises:
        SceneError: it is none of these, or does not fit the dimension of space.
    """
    try:
        shape = source if callable(getattr(source, "distance", None)) else read_shape(source)
    except ValidationError as error:
        raise SceneError(problems_of(error, source, shape_class(source["shape"]))) from None
    except ValueError as error:
        raise SceneError.at("", str(error)) from None
    assert shape is not None
    if isinstance(shape, Shape) and (
        problems := list(shape.contradictions(dimension, turns=turns))
    ):
        raise SceneError(problems)
    return Distance(shape, 0.0, dimension)


def corners_of(shape: SignedDistance | None, dimension: int) -> Corners | None:
    """Return the corners of a shape; None if there is no shape, or if a user's own shape has no
    method ``corners``.
    """
    return shape.corners(dimension) if shape is not None and hasattr(shape, "corners") else None


def _floats(values: npt.ArrayLike) -> Array:
    """Return values as an array of floats."""
    return np.asarray(values, dtype=np.float64)


def fault_of(shape: SignedDistance, x: Array, size: float) -> str:
    """Return what is wrong with the distance of a user's own shape at points of a boundary; "" if
    nothing is found.

    Moving a point back along its normal must reduce the distance by as much, everywhere.  Behind
    the closest point the distance must be negative: otherwise points would pass through the shape.

    ``x``: the points, length, shape (n, d); ``size``: size of the body, length.
    """
    if is_of_package(type(shape)):
        return ""
    name = type(shape).__name__
    step = DIFFERENCE_STEP * size
    x = x.copy()
    x.flags.writeable = False  # a shape that changes its argument moves the points of others
    try:
        signed, normal = map(_floats, shape.distance(x))
        if signed.shape != x.shape[:1] or normal.shape != x.shape:
            wanted = f"{x.shape[:1]} and {x.shape} for points of the shape {x.shape}"
            return (
                f"distance of {name} has the shapes {signed.shape} and {normal.shape}, not {wanted}"
            )
        surface = x - signed[:, None] * normal
        behind = _floats(shape.distance(x - step * normal)[0])
        at_surface = _floats(shape.distance(surface)[0])
        within = _floats(shape.distance(surface - step * normal)[0])
    except Exception as error:
        return f"distance of {name} fails: {type(error).__name__}: {error}"
    length = np.linalg.norm(normal, axis=1)
    for reason, wrong in (
        (
            f"distance of {name} is not finite",
            ~np.isfinite(np.column_stack((signed, normal))).all(axis=1),
        ),
        (f"the normals of {name} are not of unit length", ~(np.abs(length - 1) <= SAME_LENGTH)),
        (
            f"distance of {name} does not grow along its normals as a distance does",
            ~(
                np.abs(signed - behind - step)
                <= WRONG_SLOPE * step + ZERO_IN_SOLUTION * np.abs(signed)
            ),
        ),
        (
            f"distance of {name} is not negative inside",
            (np.abs(at_surface) <= WRONG_SLOPE * step) & (within >= 0),
        ),
    ):
        if wrong.any():
            return f"{reason} at {tuple(map(float, x[wrong.argmax()]))}"
    return ""


# --- how they are found ---------------------------------------------------------------------------

# The file of each shape, and its class there.
_SHAPES = {
    "circle": ("analytic", "Circle"),
    "cone": ("analytic", "Cone"),
    "cylinder": ("analytic", "Cylinder"),
    "plane": ("analytic", "Plane"),
    "polyline": ("analytic", "Polyline"),
    "sphere": ("analytic", "Sphere"),
    "surface": ("surface", "ClosedSurface"),
}


def names() -> tuple[str, ...]:
    """Return the names of all shapes, sorted; their modules are not imported."""
    return tuple(sorted({*_SHAPES, *names_of(SHAPES)}))


def shape_class(name: str) -> type[Shape]:
    """Return the class of a shape; its module is imported.

    Raises:
        InstallationError: the package of the shape cannot be imported.
    """
    if name not in _SHAPES:
        return load_class(SHAPES, name, Shape)
    file, kind = _SHAPES[name]
    found = getattr(import_module(f"signorini_fx.mechanics.shapes.{file}"), kind)
    return found


def read_shape(entry: Shape | Mapping[str, Any] | None) -> Shape | None:
    """Return a shape from a table; a shape or None is returned unchanged.

    Raises:
        ValueError: the table is not a valid shape.
    """
    if entry is None or isinstance(entry, Shape):
        return entry
    if not isinstance(entry, Mapping):
        raise ValueError(
            f'a table is expected, such as {{ shape = "plane", point = [...] }}, not '
            f"{kind_of(entry)}"
        )
    name = entry.get("shape")
    if name not in [*_SHAPES] and name not in names():
        raise ValueError(f"shape must be one of {', '.join(names())}, got {shown(name)}")
    return TypeAdapter(shape_class(name)).validate_python(entry)


OneShape = Annotated[
    Any, BeforeValidator(read_shape), WithJsonSchema({"type": "object", "required": ["shape"]})
]
