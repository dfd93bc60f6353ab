"""Forces at single nodes, as decks have them; the stress at such a node is infinite."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
from pydantic import model_validator

from signorini_fx.mechanics.statement.effect import Array, Coefficients, Features, Points, VectorForce
from signorini_fx.mechanics.statement.nodal_table import NodalTable, read_nodal_table
from signorini_fx.mechanics.statement.values import Vector


class PointForce(VectorForce):
    """A force at a node, or forces at the nodes that a table lists.

    Attributes:
        at: a point, which must be a node of the mesh, length; None: a table lists several.
        region: of the point: the part of the body whose node is meant; None: there is only one node.
        x: component along x[0], force (in the plane per thickness, of a body of revolution of the whole ring).
        y: component along x[1], force (likewise).
        z: component along x[2], force; only in space.
        file: instead, a .csv with the columns x, y, fx, fy, in space z and fz, and, where several parts of the body
            have a node at one place, region.
        factors: one number per load step; None: 1 in every step.
        live: whether the safety factor multiplies it; a permanent load is not live.
    """

    refuses: ClassVar[Mapping[str, Mapping[str, str]]] = {
        "point force": {
            "accuracy of the energy": "a force at a point does infinite work: take the 'force', 'pressure' or 'zone', "
            "or spread it over a boundary, in [[force]]",
            "local refinement": "cells at a force at a point would be divided without end: use 'uniform'",
        }
    }
    nodal: ClassVar[bool] = True
    vectors: ClassVar[tuple[str, ...]] = ("at",)
    density_tells_all: ClassVar[bool] = False

    at: Vector | None = None
    region: str | None = None
    file: Path | None = None

    @model_validator(mode="after")
    def _one_of_both(self) -> Self:
        if (self.at is None) == (self.file is None):
            raise ValueError("give either at, a point, or file")
        if self.file is not None and self.model_fields_set & {"x", "y", "z", "region"}:
            raise ValueError("the file has components and regions: leave x, y, z and region out")
        return self

    @property
    def name(self) -> str:
        """See ``Effect``."""
        if self.at is None:
            return f"{self.label} {self.file.name if self.file else ''}"
        point = f"({', '.join(f'{x:g}' for x in self.at)})"
        return f"{self.label} {point}" if self.region is None else f"{self.label} {point} of {self.region}"

    @property
    def features(self) -> Features:
        """See ``Effect``."""
        return super().features if self.acts else ()

    @property
    def acts(self) -> bool:
        """See ``Effect``."""
        return self.file is not None or super().acts

    @property
    def said(self) -> str:
        """See ``Effect``."""
        return f"file = {self.file.name}" if self.file is not None else super().said

    def table(self, path: str, dimension: int) -> NodalTable:
        """The nodes and the forces at them, in space of a dimension.

        Raises:
            SceneError: its file cannot be read, see ``read_nodal_table``.
        """
        if self.file is not None:
            return read_nodal_table(f"{path}.file", self.file, "f")
        from signorini_fx.mechanics.statement.expressions import in_space, sample

        point = np.array([self.at], dtype=np.float64)
        components = [sample(value, in_space(point)) for value in self.components[:dimension]]
        return NodalTable(point, (self.region or "",), np.column_stack(components), np.zeros(1, dtype=np.int64))

    def density(self, on: Coefficients) -> Any:
        """Zero: it has none, see ``Force``."""
        return on.vector((0.0, 0.0, 0.0))

    def density_at(self, at: Points) -> Array:
        """Zero: it has none, see ``Force``."""
        return at.vector((0.0, 0.0, 0.0))


Entry = PointForce

# How ``signorini-fx new`` explains it.
EXAMPLE = """
# Forces at single nodes, where the stress is infinite.  As many [[point_force]] as you like; they add up.
[[point_force]]
at = [0.0, 1.0]                            # a node of the mesh
#region = "block"                          # its part of the mesh, where several have a node there
x = 0.0                                    # VALUE, force (in the plane per thickness)
y = 0.0                                    # VALUE, force
#z = 0.0                                   # VALUE, force; only if the mesh is in space
#file = "forces.csv"                       # instead of these: columns x, y, (z,) fx, fy, (fz,) and region
#factors = [0.5, 1.0]                      # load steps, as above
live = true                                # whether the safety factor multiplies it
"""
