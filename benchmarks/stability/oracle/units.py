"""Units of a scene: the solver sees a scene in units of its own, the oracle judges it in units of
the body.

A scene is drawn for a body of about size 1 with E = 1.  It is then written in other units, whose
exponents are drawn for lengths and for forces independently, and the answer is taken back.  In 2D
forces are per unit thickness.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

# Dimension of each value of a scene: powers of length and of stress.
_LENGTH, _STRESS, _PER_VOLUME, _STIFFNESS, _SOFTNESS = (1, 0), (0, 1), (-1, 1), (-1, 1), (1, -1)
_VALUES: dict[str, dict[str, tuple[float, int]]] = {
    # An acceleration has no unit here, so that times are those that make it so.
    "material": {"young": _STRESS, "density": _PER_VOLUME, "grading": (0, 0)},
    "orthotropic": {"young": _STRESS, "shear": _STRESS, "direction": (0, 0), "second": (0, 0)},
    "force": {"x": (1, 1), "y": (1, 1), "z": (1, 1), "spread": (0, 0)},  # per thickness in 2D
    "fluid": {"level": _LENGTH, "weight": _PER_VOLUME},
    "rotation": {"speed": (-0.5, 0), "about": _LENGTH},
    "temperature": {"change": (0, 0)},
    "springs": dict.fromkeys(("normal", "tangential", "x", "y", "z"), _STIFFNESS),
    "foundation": dict.fromkeys(("point", "centre", "radius"), _LENGTH),
    "displacement": dict.fromkeys(("x", "y", "z", "normal"), _LENGTH),
    "traction": dict.fromkeys(("x", "y", "z", "pressure"), _STRESS),
    "body_force": dict.fromkeys(("x", "y", "z"), _PER_VOLUME),
    "contact": {"gap": _LENGTH},
    "friction": {
        "bound": _STRESS,
        "cap": _STRESS,
        "cohesion": _STRESS,
        "coefficient": (0, 0),
        "ratio": (0, 0),
        "along": (0, 0),
    },
    "solver": dict.fromkeys(("gamma_n", "gamma_t", "gamma_first"), _STIFFNESS)
    | {"sigma": _SOFTNESS},
    "parameters": dict.fromkeys(
        (
            *(
                "length",
                "width",
                "height",
                "tip",
                "radius",
                "inner_radius",
                "thickness",
                "rounding",
            ),
            *("size", "contact_size", "contact_zone"),
        ),
        _LENGTH,
    ),
}
# The columns of a contact table by their first part; ``weight`` is a length or an area.
_COLUMNS = {
    **dict.fromkeys(("x", "y", "z", "s", "gap", "u_n", "u_t", "slip"), _LENGTH),
    **dict.fromkeys(("pressure", "shear", "bound"), _STRESS),
}


@dataclass(frozen=True)
class Units:
    """A scene's unit lengths and forces, as numbers of its units."""

    length: float  # a length of 1 in the scene's units
    force: float  # a force of 1, in 2D per thickness
    dimension: int  # of space

    @property
    def stress(self) -> float:
        """A stress of 1."""
        return self.force / self.length ** (self.dimension - 1)

    def of(self, dimension: tuple[float, int]) -> float:
        """The unit of a value with these powers of length and of stress."""
        lengths, stresses = dimension
        return float(self.length**lengths * self.stress**stresses)

    def scene(self, drawn: Mapping[str, Any]) -> dict[str, Any]:
        """The scene in these units."""
        return {key: self._table(key, value) for key, value in drawn.items()}

    def _table(self, name: str, value: Any) -> Any:
        if isinstance(value, list) and all(isinstance(item, dict) for item in value):
            return [self._table(name, item) for item in value]
        if not isinstance(value, dict):
            return value
        kinds = _VALUES.get(name, {})
        found = {}
        for key, item in value.items():
            if key in kinds:
                lengths, stresses = kinds[key]
                lengths += self.dimension - 2 if name == "force" and stresses else 0
                found[key] = self._value(item, self.of((lengths, stresses)))
            elif key == "initial_contact":
                found[key] = self._value(item, 1.0)
            else:
                found[key] = self._table(key, item)
        return found

    def _value(self, value: Any, unit: float) -> Any:
        """A number or an expression of the position, in these units."""
        if unit == self.length == 1.0:
            return value
        if isinstance(value, list):
            return [self._value(item, unit) for item in value]
        if not isinstance(value, str):
            return value * unit
        place = re.sub(r"x\[(\d)\]", lambda found: f"({found[0]}/{self.length!r})", value)
        return place if unit == 1.0 else f"{unit!r}*({place})"

    def table(self, columns: Mapping[str, npt.NDArray[Any]]) -> dict[str, npt.NDArray[Any]]:
        """The columns of a contact table taken back to units of the body."""
        found = {}
        for name, column in columns.items():
            stem = re.sub(r"_[xyz]$", "", name) if not name.startswith("n_") else "n"
            unit = self.of(_COLUMNS.get(stem, (0, 0)))
            if name == "weight":
                unit = self.length ** (self.dimension - 1)
            found[name] = np.asarray(column) / unit if unit != 1.0 else np.asarray(column)
        return found


def same(dimension: int) -> Units:
    """The units of the body itself."""
    return Units(1.0, 1.0, dimension)


# A scene in 2D as it is drawn.
AS_DRAWN = same(2)
