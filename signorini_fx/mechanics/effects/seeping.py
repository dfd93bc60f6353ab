"""The pressure of a fluid that enters contact as it opens: a table within ``[[contact]]``.

Which points it reaches is computed in ``mechanics.body.seeping``, which is imported only when such
a step is solved.
"""

from __future__ import annotations

from pydantic import Field

from signorini_fx.mechanics.statement.effect import ContactPart, Contradictions, Stated, not_yet
from signorini_fx.mechanics.statement.values import TimedSampledValue


class Seeping(ContactPart):
    """A fluid that enters contact from one side, with its pressure on both sides wherever contact
    is open and connected with that side.

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
    refuses = not_yet(
        "seeping",
        "inertia",
        "requested accuracy",
        "nested iteration",
        "mixed element",
        "driven foundation",
        "nonlinear material",
        "preload",
        "statement of an error bound",
        words="a fluid that seeps in",
    )

    pressure: TimedSampledValue = Field(kw_only=False)
    side: str

    def contradictions(self, statement: Stated, number: int) -> Contradictions:
        contact = statement.contact[number]
        if not contact.opens:
            yield ("contact", number, "seeping"), f"is for contact that opens, not {contact.kind!r}"
