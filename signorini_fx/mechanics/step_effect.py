"""What else happens to a body from load step to load step, such as wear: a base class.

Other packages have more by entry points:

    [project.entry-points."signorini_fx.step_effects"]
    wear = "its.module:Wear"

What an effect remembers is in fields of the state, which are carried along and stored with it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.state import State


class StepEffect:
    """An effect that does nothing: a class of a user's own overrides what it does.

    Examples:
        >>> class Pressed(sfx.StepEffect):
        ...     def after(self, state, new, contact):
        ...         return self.added(new, "impulse", "points", contact.pressure)
        >>> pressed = sfx.solve(scene, effects=[Pressed()])
        >>> print(np.round(pressed.state.fields["impulse"].values.mean(), 6))
        2.0
    """

    def added_gap(
        self, state: State, boundary: ContactBoundary, time: float
    ) -> npt.NDArray[np.float64] | None:
        """Return what is added to the gap in a step, length, shape (n,), or None; collective.

        Args:
            state: from which the step begins.
            boundary: its contact points on this rank, n of them.
            time: of the end of the step.
        """
        return None

    def after(self, state: State, new: State, contact: ContactState) -> State:
        """Return the end of a step that has a solution, with what the effect remembers; collective.

        Args:
            state: from which the step began.
            new: its end, with the fields of ``state``.
            contact: its pressure, shear and slip at the contact points on this rank.
        """
        return new

    @staticmethod
    def added(state: State, name: str, at: str, values: Any) -> State:
        """Return a state with values added to a field, which is zero where there is none yet."""
        earlier = state.fields.get(name)
        return state.with_field(name, at, values if earlier is None else earlier.values + values)
