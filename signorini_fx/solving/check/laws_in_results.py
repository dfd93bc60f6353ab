"""Findings about friction laws of a user's own: what they say of themselves, tried at the pressures of a result."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.machine import parallel
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.laws.at_points import fault_in_result
from signorini_fx.mechanics.obstacles.foundations_on_points import NodalFriction
from signorini_fx.records import Finding


def laws_in_results(
    friction: Sequence[NodalFriction], law: PointFriction | None, contact: ContactState | None, modulus: float
) -> list[Finding]:
    """Laws that are not what they say at the pressures of a result, or of an iterate that is none; collective.

    Args:
        friction: of each contact.
        law: the same at the contact points.
        contact: the result; None: there is none.
        modulus: of the body, stress.
    """
    if contact is None or law is None:
        return []
    comm, findings = contact.boundary.comm, []
    exceeds, pressure = law.exceeds_envelope(contact.pressure), np.abs(contact.pressure)
    tried = np.isfinite(pressure) & (pressure > 0) & ~contact.boundary.points.immovable
    for number, entry in enumerate(friction):
        if entry.law is None or not entry.law.of_a_user:
            continue
        at, path = contact.boundary.part == number, f"contact[{number}].friction"
        nodes = contact.boundary.nodes[at & tried]
        fault = fault_in_result(entry.law.at(nodes), pressure[at & tried], modulus)
        faults = [fault for fault in comm.allgather(fault) if fault]
        wrong = exceeds & at
        if parallel.any_rank(comm, bool(wrong.any())):
            largest = parallel.largest(comm, np.where(wrong, contact.pressure, 0.0))
            message = (
                f"the bound of the friction law {entry.law.law} is larger than it says at pressures of this "
                f"solution, up to {largest:g}: check the law"
            )
            findings.append(Finding("warning", path, message))
        elif faults:
            message = f"at pressures of this result the friction law {entry.law.law} is not what it says: {faults[0]}"
            findings.append(Finding("warning", path, message))
    return findings
