"""Supports that push the body into its foundation: contact nodes that cannot move along their normal, and lie inside.

No displacement is admissible there, so that no contact pressure keeps the node outside: the supports take whatever it
would be.  The node transmits nothing in contact (``contact.laws.trial_pressure``), and the scene must be told of it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from signorini_fx import parallel
from signorini_fx.body.contact_state import ContactState
from signorini_fx.body.motion_names import rounded
from signorini_fx.records import Finding
from signorini_fx.tuned import SAME_LENGTH


def pushed_nodes(steps: Sequence[ContactState | None], size: float) -> list[Finding]:
    """One finding for each contact boundary with such nodes, from the load step where one lies deepest; collective.

    Args:
        steps: the contact points of each load step.
        size: of the body, length: shares of it below ``SAME_LENGTH`` are round-off.
    """
    deepest: dict[int, tuple[float, str]] = {}
    for contact in steps:
        if contact is None:
            continue
        boundary, comm, depth = contact.boundary, contact.boundary.comm, contact.held_inside
        for part in range(int(parallel.largest(comm, boundary.part, -1)) + 1):
            inside = (boundary.part == part) & (depth > SAME_LENGTH * size)
            rows = parallel.gather_rows(comm, np.column_stack((depth, contact.bilateral, boundary.x))[inside])
            if not len(rows) or rows[:, 0].max() <= deepest.get(part, (0.0, ""))[0]:
                continue
            # The first of those that are as deep, whatever the number of ranks.
            most = rows[rows[:, 0] >= rows[:, 0].max() - SAME_LENGTH * size]
            length, bilateral, *place = most[np.lexsort(most[:, 2:].T[::-1])[0]]
            deepest[part] = float(rows[:, 0].max()), _message(len(rows), float(length), bool(bilateral), place, size)
    return [Finding("warning", f"contact[{part}], displacement", message) for part, (_, message) in deepest.items()]


def _message(count: int, length: float, bilateral: bool, place: Sequence[float], size: float) -> str:
    at = ", ".join(rounded(c, size) for c in place)
    where = "off" if bilateral else "inside"
    nodes, they = ("node", "it transmits") if count == 1 else ("nodes", "they transmit")
    return (
        f"supports hold {count} contact {nodes} {where} the foundation, by {length:.3g} at ({at}): {they} nothing, the "
        "supports carry what acts there; check the gap beside them, or end the contact boundary before them"
    )
