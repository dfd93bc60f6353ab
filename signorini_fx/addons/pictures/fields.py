"""The fields that can be drawn on the deformed body: what each is called, and how it follows from values of cells."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Field:
    """A quantity with one value per cell or facet, or with values at points of each.

    Attributes:
        label: what stands at the colour bar.
        signed: whether it has both signs, so that the scale need not begin at zero.
        remark: what the caption adds to the label.
        colours: a colour map of matplotlib, or its name; None: that of all fields.
        of_stress: whether it follows from the stress, of which there are a raw and a recovered one.
        quantity: whose unit it has, see ``signorini_fx.mechanics.statement.units``.
    """

    label: str
    signed: bool = False
    remark: str = ""
    colours: Any = None
    of_stress: bool = True
    quantity: str = "stress"

    @property
    def in_words(self) -> str:
        """The label as plain text, without the signs of formulas."""
        return self.label.replace("$", "").replace("_", "")

    def told(self, *, at_points: bool) -> Field:
        """The field with a label that says what is seen: at points the recovered stress, else one value per cell."""
        suffix = ", one value per cell" if not at_points else ", recovered" if self.of_stress else ""
        return replace(self, label=self.label + suffix)


# Name in options and file names -> what it is.
FIELDS = {
    "von_mises": Field("von Mises stress"),
    "pressure": Field(
        "mean pressure", signed=True, remark=", minus a third of the trace of the stress, compression positive"
    ),
    "principal": Field(
        "largest principal stress in size",
        remark=(
            "; strokes: directions of the principal stresses, as long as the stresses are large, blue and thick for "
            "compression, orange for tension"
        ),
        colours="Greys",  # dark for large values: the strokes are seen on light ground
    ),
    "displacement": Field("size of the displacement", of_stress=False, quantity="length"),
    "density": Field("elastic shear energy density"),
    "around": Field("displacement $u_z$ around the axis", signed=True, of_stress=False, quantity="length"),
}
# Those that need the tensor of the stress.
FROM_STRESS = ("pressure", "principal")


def values_of(name: str, cells: Mapping[str, Floats]) -> Floats:
    """A field from what was gathered of the cells, shape (m,), or shape (m, p) at points of each.

    Args:
        name: in ``FIELDS``.
        cells: ``stress`` of shape (m, 3, 3) or (m, p, 3, 3), or the field itself by its name.

    Raises:
        KeyError: neither is there.
    """
    if name == "pressure":
        return np.asarray(-np.trace(cells["stress"], axis1=-2, axis2=-1) / 3)
    if name == "principal":
        stresses, _ = principal(cells["stress"])
        return np.asarray(np.abs(stresses).max(axis=-1))
    return cells[name]


def principal(stress: Floats) -> tuple[Floats, Floats]:
    """Principal stresses of tensors of shape (..., 3, 3), shape (..., 3), ascending, and their directions, of shape
    (..., 3, 3): ``directions[..., :, k]`` is the unit vector of the k-th; nan for a tensor that is not finite.
    """
    finite = np.asarray(np.isfinite(stress).all(axis=(-2, -1)))
    values, vectors = np.linalg.eigh(np.where(finite[..., None, None], stress, 0.0))
    values[~finite] = np.nan
    return values, vectors
