"""The fields that can be drawn on the deformed body, with their labels."""

from __future__ import annotations

from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Field:
    """A quantity with values at points of each cell or facet."""

    label: str  # what stands at the colour bar
    signed: bool = False  # whether it has both signs, so that the scale need not begin at zero
    remark: str = ""  # what the caption adds to the label
    # the function of ``StressFields``, raw or recovered, that it follows from; "": the displacement
    of: str = ""
    quantity: str = "stress"  # whose unit it has, see ``signorini_fx.mechanics.statement.units``

    @property
    def in_words(self) -> str:
        """The label as plain text, without mathematical markup."""
        return self.label.replace("$", "").replace("_", "")

    def labelled(self, *, recovered: bool) -> Field:
        """Return the field with a label that names the stress that is drawn."""
        kind = ", recovered" if recovered else ", raw"
        return replace(self, label=self.label + kind * bool(self.of))


# Name in options and file names -> what it is.
FIELDS = {
    "von_mises": Field("von Mises stress", of="von_mises"),
    "pressure": Field(
        "mean pressure",
        True,
        ", minus a third of the trace of the stress, compression positive",
        of="tensor",
    ),
    "displacement": Field("size of the displacement", quantity="length"),
    "density": Field("elastic shear energy density", of="shear_energy_density"),
    "temperature": Field("temperature", signed=True, quantity="temperature"),
    "around": Field("displacement $u_z$ around the axis", signed=True, quantity="length"),
}
