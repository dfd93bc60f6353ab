"""The pressure of a fluid that seeps into an opening contact: a table within ``[[contact]]``.

Where it is, is in ``mechanics.body.seeping``, which is imported where a step is solved.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from pydantic import Field

from signorini_fx.mechanics.statement.effect import ContactPart, Contradictions
from signorini_fx.mechanics.statement.values import TimedSampledValue

_NOT_YET = "is not possible yet with a fluid that seeps in"


class Seeping(ContactPart):
    """A fluid that seeps into contact from one side, and presses wherever this is open and
    connected with that side.

    Attributes:
        pressure: of the fluid.
        side: name of the boundary that it comes from, with which the contact boundary has nodes in
            common.

    Examples:
        >>> lifted = sfx.Contact(
        ...     boundary="bottom",
        ...     gap="where(x[0] < 0.6, 0.01, 0)",
        ...     seeping=sfx.Seeping(1.5, side="left"),
        ... )
        >>> result = sfx.solve(scene.model_copy(update={"contact": lifted}))
        >>> print(np.round(result.contact.forces[0], 6), result.steps[0].figures["fluid_area"])
        [0.     3.0625] 0.625
    """

    key = "seeping"
    step_effect = "seeping"
    value_keys = ("pressure",)
    positional = ("pressure",)
    refuses: ClassVar[Mapping[str, Mapping[str, str]]] = {
        "seeping": {
            "inertia": _NOT_YET,
            "requested accuracy": f"{_NOT_YET}: its mesh is given",
            "nested iteration": f"{_NOT_YET}: leave out solver.levels",
            "mixed element": f"{_NOT_YET}: use 'reduced'",
            "driven foundation": f"{_NOT_YET}: prescribe its motion",
            "nonlinear material": f"{_NOT_YET}: it must be linear",
            "preload": _NOT_YET,
            "statement of an error bound": _NOT_YET,
        }
    }

    pressure: TimedSampledValue = Field(kw_only=False)
    side: str

    def contradictions(self, statement: Any, number: int) -> Contradictions:
        contact = statement.contact[number]
        if not contact.opens:
            yield ("contact", number, "seeping"), f"is for contact that opens, not {contact.kind!r}"
