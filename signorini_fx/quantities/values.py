"""The values of results for summary.json and steps.csv; those about the run are in
``results.summary``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from signorini_fx.arrays import Plain
from signorini_fx.machine import parallel

if TYPE_CHECKING:
    from signorini_fx.mechanics.contact_points.contact_state import ContactState
    from signorini_fx.mechanics.contact_points.contact_table import ContactTable
    from signorini_fx.mechanics.effects.contact import Contact


def of_results(solution: Any) -> dict[str, Any]:
    """Return the values of all keys that need nothing but the solution; collective."""
    contact = solution.contact
    known = {
        **({} if contact is None else _of_contact(solution, contact)),
        "limit": solution.limit and solution.limit.model_dump(exclude_none=True),
        "preloads": [section.model_dump() for section in solution.preloads] or None,
        "resultants": solution.resultants.as_rows(),
        "strain_energy": solution.last_step.strain_energy,
        "deformation": asdict(
            max((step.deformation for step in solution.shown_steps), key=lambda step: step.largest)
        ),
        "certificate": solution.certificate.as_dict(),
    }
    return {key: value for key, value in known.items() if value is not None}


def _of_contact(solution: Any, contact: ContactState) -> dict[str, Plain]:
    """Return the values of the keys of a scene with contact; collective."""
    table = solution.table
    columns = table.columns
    kinematics = solution.model.kinematics
    solid = contact.boundary.x.shape[1] == 3
    motions = solution.last_step.rigid_bodies
    return {
        "contact_nodes": int(columns["x"].size),
        "touching_nodes": table.touching,
        "contact_force": (contact.forces[0] + 0.0).tolist(),
        "friction_force": (contact.forces[1] + 0.0).tolist(),
        "pressure_integral": float(
            np.dot(columns["weight"], columns["pressure"])
            if contact.boundary.corners is None
            else sum(figures.pressure_integral or 0.0 for figures in solution.contact_figures)
        ),
        "max_pressure": float(columns["pressure"].max()),
        "present_pressure": float(columns["present_pressure"].max())
        if "present_pressure" in columns
        else None,
        "no_limit_of_pressure": solution.no_limit_of_pressure,
        "max_shear": float(np.abs(columns["shear"]).max()),
        "zones": _zones(table) if "s" in columns else None,
        "areas": contact.areas if solid else None,
        "contact_moment": (contact.moments[0] + 0.0).tolist() if solid else None,
        "friction_moment": (contact.moments[1] + 0.0).tolist() if solid else None,
        "contact_boundaries": [figures.model_dump() for figures in solution.contact_figures]
        or None,
        "corners": [figures.model_dump() for figures in solution.corner_figures] or None,
        "rigid_bodies": [
            motion.as_dict(contact, solution.model.contacts, kinematics) for motion in motions
        ]
        or None,
    }


def _zones(table: ContactTable) -> dict[str, Plain]:
    """Return the contact, stick and slip zones of a 2D body, from node to node."""
    columns = table.columns
    touching = columns["state"] != "open"
    # Tresca friction acts on open nodes as well, which do not belong to the contact.
    acting = (columns["bound"] > 0) & touching
    return {
        "contact": table.zones(touching),
        "stick": table.zones(acting & (columns["friction"] == "stick")),
        "slip": table.zones(acting & np.isin(columns["friction"], ["slip+", "slip-", "slip"])),
    }


def of_fields(solution: Any) -> dict[str, Plain]:
    """Return the values of the stress, which exist only if fields are written; collective."""
    stress = solution.known_stress
    if stress is None:
        return {}
    known = {
        "stress": stress.as_dict(),
        "plastic_strain": stress.plastic_extreme(),
        "utilisation": stress.utilisation(),
    }
    return {key: value for key, value in known.items() if value is not None}


def afterwards(solution: Any) -> dict[str, Callable[[Any], Plain]]:
    """Return functions for values that are computed after the results are written, so that a
    failure is only a warning.
    """
    functions: dict[str, Callable[[Any], Plain]] = {}
    if solution.contact is not None:
        functions["friction_used"] = lambda solution: solution.friction_used
    if solution.model.settings.error_bound:
        functions["error_bound"] = _error_bound
    functions["cost"] = _cost
    functions["numbers"] = lambda solution: {
        name: number.model_dump() for name, number in solution.numbers.items()
    }
    return functions


# The beginning of the statement if there is no bound.
NO_BOUND = "none: "


def _error_bound(solution: Any) -> Plain:
    bound = solution.error_bound
    if isinstance(bound, str):
        return {"statement": f"{NO_BOUND}{bound}"}
    return None if bound is None else bound.as_dict()


def _cost(solution: Any) -> Plain:
    cost = solution.cost
    return {"statement": cost} if isinstance(cost, str) else cost.model_dump()


def of_step(solution: Any) -> dict[str, Any]:
    """Return the columns of a load step in steps.csv; collective."""
    contact = solution.contact
    columns = {} if contact is None else _of_contact_in_step(solution, contact)
    energy = solution.last_step.strain_energy
    columns |= {} if energy is None else {"strain_energy": energy}
    return columns | {"certificate_holds": solution.certificate.holds}


def _of_contact_in_step(solution: Any, contact: ContactState) -> dict[str, Plain]:
    """Return the contact values of a load step by axis, and by boundary if their sum has no
    meaning; collective.
    """
    parts = solution.model.contacts
    names = _boundaries(parts)
    count = range(len(names))
    columns: dict[str, Plain] = {}
    for number, key in enumerate(("contact_force", "friction_force")):
        forces = [contact.forces_of_each[k, number] for k in count] or [contact.forces[number]]
        columns |= _by_axis(key, forces, names)
    figures = (
        list(zip(names or [""], solution.contact_figures, strict=True))
        if names or len(parts) == 1
        else []
    )
    closed = [
        (name, boundary) for name, boundary in figures if boundary.friction_moment is not None
    ]
    for name, boundary in closed:
        columns |= _by_axis("pressure_integral", [boundary.pressure_integral], [name])
    # Not 0 as the initial value: a rank may have no contact nodes, and if contact only pulls, the
    # largest pressure is negative.
    columns["max_pressure"] = parallel.largest(
        contact.boundary.comm, contact.pressure[contact.boundary.at_nodes], -np.inf
    )
    for name, boundary in closed:
        columns |= _by_axis("friction_moment", [boundary.friction_moment], [name])
    if contact.boundary.kinematics.out_of_section:
        columns["torque"] = float(contact.moments[1][1])
    motions = (
        contact.mean_tangential_displacements[1:]
        if names
        else [contact.mean_tangential_displacement]
    )
    columns |= _by_axis("mean_tangential_displacement", motions, names)
    return columns | {"friction_work": contact.friction_work}


def _boundaries(contacts: Sequence[Contact]) -> list[str]:
    """Return the names of the contact boundaries if the sum of their forces acts on no single body,
    otherwise an empty list.
    """
    names = [effect.boundary for effect in contacts]
    return names if len(names) > 1 and any(effect.against for effect in contacts) else []


def _by_axis(key: str, values: Sequence[Any], names: Sequence[str]) -> dict[str, float]:
    """Return numbers under their key, and vectors as one entry for each axis."""
    columns = {}
    for name, value in zip(names or [""], values, strict=True):
        of = f" {name}" if name else ""
        if np.ndim(value) == 0:
            columns[f"{key}{of}"] = float(value)
        else:
            axes = zip("xyz", value, strict=False)
            columns |= {f"{key}_{axis}{of}": float(component) for axis, component in axes}
    return columns
