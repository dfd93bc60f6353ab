"""How long the facets of contact boundaries are to be: ``contact_size`` of meshes and of contacts.  No dolfinx here."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from signorini_fx.errors import SceneError


@dataclass(frozen=True)
class ContactSize:
    """The length of the facets of one boundary of a mesh.

    Attributes:
        boundary: its name in the mesh.
        size: the length.
        path: the key of the scene that asks for it.
    """

    boundary: str
    size: float
    path: str


def contact_sizes(scene: Any, number: int | None = None) -> tuple[ContactSize, ...]:
    """What a scene asks of the facets of one of its meshes.

    Args:
        scene: the ``Scene``.
        number: of the body; None: there is one mesh.

    Raises:
        SceneError: a mesh has the key, and no boundary of it can be in contact.
    """
    body = None if number is None else scene.body[number]
    of_mesh = getattr(scene.mesh if body is None else body.mesh, "contact_size", None)
    wanted = []
    for index, contact in enumerate(scene.contact):
        size, path = contact.contact_size, f"contact[{index}].contact_size"
        if size is None:
            size, path = of_mesh, "mesh.contact_size"
        if size is not None:
            names = [_in_body(name, body) for name in (contact.boundary, contact.against) if name is not None]
            wanted += [ContactSize(name, size, path) for name in names if name]
    if of_mesh is not None and not wanted and not any(contact.contact_size for contact in scene.contact):
        raise SceneError([("mesh.contact_size", "is for boundaries in contact, and here is none: leave it out")])
    return tuple(wanted)


def _in_body(name: str, body: Any) -> str:
    """What a mesh may call a boundary that the scene calls ``name``; "" for one of another body."""
    if body is None:
        return name
    first, dot, rest = name.partition(".")
    return name if not dot else rest if first == body.name else ""


def with_larger_contact_sizes(contacts: tuple[Any, ...], factor: float) -> tuple[Any, ...]:
    """Contacts whose facets are ``factor`` times as long."""
    return tuple(
        contact
        if contact.contact_size is None
        else contact.model_copy(update={"contact_size": factor * contact.contact_size})
        for contact in contacts
    )
