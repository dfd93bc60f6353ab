"""Wear of contact in a scene: a table within ``[[contact]]``.

How wear is computed is in ``mechanics.body.wear``, which is imported only when such a step is
solved.
"""

from __future__ import annotations

from pydantic import Field

from signorini_fx.mechanics.statement.effect import ContactPart, Contradictions, Stated, not_yet
from signorini_fx.mechanics.statement.values import NonNegativeValue, TimedSampledValue


class Archard(ContactPart):
    """Wear by Archard's law: its depth grows by the coefficient times pressure times slip.

    Attributes:
        coefficient: k, depth per pressure and slip, 1 / stress.
        distance: by which the other surface has slid over each point at the time t, length, an
            expression; None: slip is that of the contact itself.

    Examples:
        >>> worn = sfx.Contact(boundary="bottom", wear=sfx.Archard(1e-6, distance="100*t"))
        >>> result = sfx.solve(scene.model_copy(update={"contact": worn}))
        >>> print(np.round(result.state.fields["wear"].values.max(), 6))
        0.0002
    """

    key = "wear"
    step_effect = "wear"
    adds_up = True
    value_keys = ("coefficient", "distance")
    positional = ("coefficient",)
    refuses = not_yet(
        "wear",
        "inertia",
        "requested accuracy",
        "nested iteration",
        "cohesion",
        "nonlinear material",
    )

    coefficient: NonNegativeValue = Field(kw_only=False)
    distance: TimedSampledValue | None = None

    def contradictions(self, statement: Stated, number: int) -> Contradictions:
        contact = statement.contact[number]
        place = ("contact", number, "wear")
        if not contact.opens:
            yield place, f"is for unilateral contact, not for {contact.kind!r}"
        if self.distance is not None and not getattr(self.distance, "timed", False):
            yield (*place, "distance"), "must grow with the time t, such as '5e3*t'"
        if statement.solver.algorithm not in ("auto", "ssn"):
            reason = f"needs algorithm = 'ssn', not {statement.solver.algorithm!r}"
            yield place, reason
