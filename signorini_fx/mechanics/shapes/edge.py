"""A corner of two faces, sharp or rounded; in 3D a straight edge, and a groove where it is hollow."""

from __future__ import annotations

from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from signorini_fx.mechanics.statement.rigid_shape import Array, Shape, unit
from signorini_fx.mechanics.statement.values import Direction, Finite, Vector
from signorini_fx.tuned import DIGITS_OF_FILES


class Edge(Shape):
    """All that is behind two planes.

    Attributes:
        point: where both faces meet, before they are rounded, length.
        normals: the outward normals of both faces, of any length.
        radius: of the rounding, length; zero: sharp.
    """

    shape: Literal["edge"] = "edge"
    point: Vector
    normals: tuple[Direction, Direction]
    radius: Annotated[Finite, Field(ge=0)] = 0.0

    @model_validator(mode="after")
    def _two_faces(self) -> Self:
        first, second = self.normals
        if len(first) != len(self.point) or len(second) != len(self.point):
            raise ValueError(f"normals: point has {len(self.point)} numbers, and each normal needs as many")
        if abs(float(unit(first) @ unit(second))) > 1 - DIGITS_OF_FILES**2 / 2:
            raise ValueError("normals: they are parallel: two faces that meet are expected")
        return self

    def initial(self, x: Array) -> tuple[Array, Array]:
        """See ``Shape``: a rounded corner is at the distance of its radius around a sharp one inside."""
        normals = np.stack([unit(normal) for normal in self.normals])
        cosine = float(normals[0] @ normals[1])
        above = (x - np.array(self.point)) @ normals.T + self.radius
        # On which face the closest point is: that whose foot is behind the other one.
        foot = above[:, ::-1] - above * cosine
        behind = (above <= 0).all(axis=1)
        face = np.where(behind, above.argmax(axis=1), np.where((foot[:, 0] <= 0) & (above[:, 0] > 0), 0, 1))
        rows = np.arange(len(x))
        signed, normal = above[rows, face], normals[face]
        corner = ~behind & ~((foot <= 0) & (above > 0)).any(axis=1)
        # From the corner: a combination of both normals, whose products with them are known.
        shares = np.linalg.solve(np.array([[1.0, cosine], [cosine, 1.0]]), above[corner].T).T
        away = shares @ normals
        size = np.linalg.norm(away, axis=1)
        signed[corner] = size
        normal[corner] = away / size[:, None]
        return signed - self.radius, normal


Entry = Edge
