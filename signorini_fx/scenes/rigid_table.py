"""``[[rigid]]``: rigid bodies by name, whose shape and what drives them are said once for all of their contacts.

A contact takes part by the name alone, ``foundation = "roller"``, or with a shape of its own that names the body,
``foundation = { shape = "plane", ..., rigid = "roller" }``.  Either becomes the shape of the contact, and that of the
first contact gets what drives the body.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from pydantic import BaseModel, ValidationError

from signorini_fx.mechanics.statement.base import refused
from signorini_fx.mechanics.statement.rigid_motion import Prescribed, RigidMotion
from signorini_fx.mechanics.statement.rigid_shape import OneShape, Shape, read_shape
from signorini_fx.mechanics.statement.values import Vector, shown


class Rigid(RigidMotion):
    """A rigid body that forces move, with any number of contacts.

    Attributes:
        name: by which contacts refer to it.
        shape: its surface; None: each of its contacts says its own.
        pivot: the point where the force acts, about which it turns, length; None: that of the shape of its first
            contact.
        force: on it at its pivot, force, in 2D per thickness; numbers or expressions of the time t; None: none.
        moment: about that point, in 2D a number, counterclockwise, in 3D three; of the same kinds.
        prescribed: the components of the motion that are not free.
        spring: between its pivot and the ground; None: there is none.
    """

    name: str
    shape: OneShape = None
    pivot: Vector | None = None

    @property
    def driving(self) -> dict[str, Any]:
        """What drives it, as keys of a shape; without any of these it is free, and contacts alone move it."""
        free = {} if self.drives else {"prescribed": Prescribed()}
        values = {key: getattr(self, key) for key in ("pivot", *RigidMotion.model_fields)}
        return {key: value for key, value in values.items() if value is not None} | free


def with_shapes(entry: Any) -> Any:
    """The tables of a scene, where names of rigid bodies among the foundations of contacts are shapes; tables that are
    wrong stay as they are.

    Raises:
        ValidationError: a name is not that of one rigid body, or none refers to it.
    """
    if not isinstance(entry, Mapping) or not isinstance(entry.get("contact", ()), list | tuple | Mapping | BaseModel):
        return entry
    contacts, rigid = _listed(entry.get("contact", ())), _listed(entry.get("rigid", ()))
    if not rigid and not any(isinstance(_get(contact, "foundation"), str) for contact in contacts):
        return entry
    try:
        bodies = [body if isinstance(body, Rigid) else Rigid.model_validate(body) for body in rigid]
    except ValidationError:
        return entry  # its errors are those of the table
    names, problems, driven = [body.name for body in bodies], [], set[str]()
    for number, contact in enumerate(contacts):
        foundation = _get(contact, "foundation")
        name = foundation if isinstance(foundation, str) else _get(foundation, "rigid")
        path = ("contact", number, "foundation")
        if name not in names:
            if isinstance(foundation, str):
                listed = ", ".join(map(shown, names)) or "none"
                problems.append((path, f"no [[rigid]] has the name {shown(foundation)}; there are: {listed}"))
            continue
        body = bodies[names.index(name)]
        shape = body.shape if isinstance(foundation, str) else foundation
        if shape is None:
            problems.append((path, f"[[rigid]] {shown(name)} has no shape: give one there or here"))
            continue
        try:
            shape = read_shape(shape)
        except ValueError:  # also what pydantic raises; its errors are those of the contact
            continue
        keys = {"rigid": name, **(body.driving if name not in driven else {})}
        problems += [
            (path, f"[[rigid]] {shown(name)} says {key}: leave it out here")
            for key in body.driving
            if getattr(shape, key, None) not in (None, body.driving[key])
        ]
        if "pivot" in keys and (shape.shift is not None or shape.rotation is not None):
            problems.append((path, "a shape that shift or rotation places has its own pivot: give it there"))
        driven.add(name)
        contacts[number] = _with_foundation(contact, shape.model_copy(update=keys))
    for number, body in enumerate(bodies):
        if names.index(body.name) < number:
            problems.append((("rigid", number, "name"), f"two rigid bodies have the name {shown(body.name)}"))
        elif body.name not in driven and not problems:
            problems.append((("rigid", number, "name"), "no contact names it as its foundation"))
    if problems:
        raise refused("Scene", problems)
    return {**entry, "contact": contacts, "rigid": bodies}


def _listed(entries: Any) -> list[Any]:
    return [entries] if isinstance(entries, Mapping | BaseModel) else list(entries)


def _get(table: Any, key: str) -> Any:
    return table.get(key) if isinstance(table, Mapping) else getattr(table, key, None)


def _with_foundation(contact: Any, shape: Shape) -> Any:
    if isinstance(contact, Mapping):
        return {**contact, "foundation": shape}
    return contact.model_copy(update={"foundation": shape})
