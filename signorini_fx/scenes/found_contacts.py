"""Contacts that a mesh of several bodies suggests, as entries of a scene, and a first scene for a
drawing or a mesh.
"""

from __future__ import annotations

import json
import os
import re
import tomllib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from signorini_fx.errors import MeshError, SceneError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.effects.contact import Contact, GeneralContact
from signorini_fx.mechanics.mesh.files.arrays import MeshArrays
from signorini_fx.mechanics.mesh.files.formats import read_file
from signorini_fx.mechanics.mesh.proposals import Proposals, ProposedContact, proposed_contacts
from signorini_fx.mechanics.statement.base import JOIN
from signorini_fx.mechanics.statement.mesh_sources import MeshFile
from signorini_fx.records import Finding
from signorini_fx.scenes.scene import Scene

if TYPE_CHECKING:
    from mpi4py import MPI

    from signorini_fx.mechanics.mesh.tagged import TaggedMesh

# The lines that enclose the entries that a new search replaces.
_FIRST = "# --- contacts found by signorini-fx contacts; a new search replaces what is between ---"
_LAST = "# --- end of the contacts found ---"
_SIDES = ("boundary", "against")
_MILLIMETRES = '{ length = "mm", stress = "MPa", force = "N" }'
_FRICTION = '{ law = "coulomb", coefficient = 0.1 }'
# Names with numbers: boundaries of drawings, and groups without a name.
_NUMBERED = re.compile(r"boundary_(\d+)")


def contacts_of(mesh: MeshFile, within: float | None = None) -> Proposals:
    """Return the contacts that a file suggests, see ``proposed_contacts``.

    Raises:
        MeshError: the file cannot be read, or is a single body.
        SceneError: a cell size is given for a file that has cells already.
    """
    found = proposed_contacts(read_file(mesh), within)
    if len(found.bodies) < 2:
        raise MeshError(
            f"{mesh.file}: the mesh is one body: all its cells hang together. Parts that a drawing "
            "has joined share nodes: keep them apart there (in gmsh, without Coherence or "
            "fragments)"
        )
    return found


def in_words(found: Proposals) -> list[str]:
    """Return a line of text for each contact, with its kind, mean gap and area."""
    if len(found.bodies) == 1:
        return ["one body"]
    bodies = ", ".join(found.bodies[:12]) + ", ..." * (len(found.bodies) > 12)
    count = len(found.contacts)
    lines = [f"{len(found.bodies)} bodies: {bodies}; {count or 'no'} contact{'s' * (count != 1)}"]
    for contact in found.contacts:
        how = f"facets leave arcs by {contact.sagitta:.2g}" if contact.sagitta else "flat"
        gap = 0.0 if contact.kind == "touches" else contact.gap
        row = (
            f"{contact.name:24s} {contact.kind:10s} gap {gap:<9.3g} area {contact.area:<9.4g} {how}"
        )
        lines.append(row.rstrip())
        if contact.shared:
            lines.append("  both sides are sides of other contacts, too: divide one in the drawing")
    for place in found.unnamed:
        where = ", ".join(f"{value:.4g}" for value in place)
        lines.append(f"surfaces without a name are near each other at ({where}): name them")
    return lines


def as_entries(contacts: Sequence[ProposedContact], *, in_rows: bool = False) -> str:
    """Return the contacts as entries of a scene file, in TOML.

    Where a round side sits in another one, the distance is stated, as facets deviate from arcs and
    the distance of the meshes differs.

    Args:
        contacts: the contacts.
        in_rows: whether to write rows of a list instead of tables.
    """
    entries = []
    for contact in contacts:
        keys = [f"{key} = {_quoted(_side(contact, k))}" for k, key in enumerate(_SIDES)]
        if contact.fitted:
            keys.append('distance = "nominal"')
            if contact.kind != "touches":
                keys.append(f"gap = {contact.gap:.6g}")
        gap = "" if contact.kind == "touches" else f" {abs(contact.gap):.3g}"
        remark = f"  # {contact.name}: {contact.kind}{gap}"
        if in_rows:
            entries.append(f"    {{ {', '.join(keys)} }},{remark}, area {contact.area:.4g}")
        else:
            keys.append(f"# friction = {_FRICTION}")
            entries.append("\n".join([f"[[contact]]{remark}", *keys]))
    return ("\n" if in_rows else "\n\n").join(entries)


def _side(contact: ProposedContact, number: int) -> str:
    """Return the name of a side in a scene: that of its boundary, or a joint name for several."""
    names = contact.sides[number]
    return names[0] if len(names) == 1 else f"{contact.name}_on_{contact.bodies[number]}"


def _quoted(text: str) -> str:
    """Return a text as a TOML string, escaped as in JSON."""
    return json.dumps(text, ensure_ascii=False)


def joined_boundaries(contacts: Sequence[ProposedContact]) -> dict[str, list[int]]:
    """Return the numbers of the boundaries of sides that consist of several, by the name of the
    side.

    Raises:
        MeshError: a boundary has no number.
    """
    joined: dict[str, list[int]] = {}
    for contact in contacts:
        for number, names in enumerate(contact.sides):
            if len(names) == 1:
                continue
            numbers = [_NUMBERED.fullmatch(name) for name in names]
            if not all(numbers):
                raise MeshError(
                    f"the surfaces {', '.join(names)} go into each other smoothly and touch the "
                    "same body: give them one name in the file"
                )
            joined[_side(contact, number)] = [int(match[1]) for match in numbers if match]
    return joined


def mesh_entry(mesh: MeshFile, folder: Path, contacts: Sequence[ProposedContact]) -> str:
    """Return the entry ``mesh`` of a scene file in ``folder``, in TOML."""
    parts = [f"file = {_quoted(os.path.relpath(mesh.file, folder))}"]
    if mesh.size is not None:
        parts.append(f"size = {mesh.size:g}")
    if joined := joined_boundaries(contacts):
        names = ", ".join(f"{_quoted(name)} = {numbers}" for name, numbers in joined.items())
        parts.append(f"boundaries = {{ {names} }}")
    return f"mesh = {{ {', '.join(parts)} }}"


def with_contacts(text: str, file: Path, contacts: Sequence[ProposedContact]) -> str:
    """Return the text of a scene with the contacts that it does not state itself.

    They replace those that an earlier search has written.

    Raises:
        SceneError: the text is no scene, or lacks names of boundaries that the contacts need.
    """
    before, found, rest = text.partition(_FIRST)
    own = before + rest.partition(_LAST)[2] if found else text
    try:
        data = tomllib.loads(own)
    except tomllib.TOMLDecodeError as error:
        raise SceneError.at("file", f"is not a TOML file: {error}", str(file)) from None
    stated = data.get("contact", [])
    in_rows = bool(found) and before.endswith("    ")
    if isinstance(stated, dict) or (stated and not in_rows and "[[contact]]" not in own):
        reason = "is an inline table, to which nothing can be added: write it as [[contact]]"
        raise SceneError.at("contact", reason, str(file))
    pairs = [{entry.get("boundary"), entry.get("against")} for entry in stated]
    new = [contact for contact in contacts if {_side(contact, 0), _side(contact, 1)} not in pairs]
    mesh = data.get("mesh", {})
    missing = {
        name: numbers
        for name, numbers in joined_boundaries(new).items()
        if mesh.get("boundaries", {}).get(name) != numbers
    }
    if missing:
        names = ", ".join(f"{name} = {numbers}" for name, numbers in missing.items())
        reason = f"add these names, which the contacts need: {names}"
        raise SceneError.at("mesh.boundaries", reason, str(file))
    if in_rows:
        return f"{before}{_rows(new)}{rest.partition(_LAST)[2]}"
    block = f"{_FIRST}\n\n{as_entries(new)}\n\n{_LAST}\n"
    return f"{own.rstrip()}\n\n{block}"


def _rows(contacts: Sequence[ProposedContact]) -> str:
    """Return found contacts as rows of a list, between the lines that enclose a search."""
    return f"{_FIRST}\n{as_entries(contacts, in_rows=True)}\n    {_LAST}"


def with_found_contacts(scene: Scene, comm: MPI.Comm) -> Scene:
    """Return the scene with the contacts that its mesh suggests, in place of ``general_contact``;
    collective.

    Raises:
        SceneError: ``general_contact`` names unknown bodies, or a contact cannot be stated.
    """
    from signorini_fx.mechanics.mesh.tagged import arrays_of
    from signorini_fx.scenes.mesh import load_mesh

    arrays = arrays_of(load_mesh(scene, comm))
    found = parallel.on_root(comm, lambda: _entries_of(scene, arrays))
    stated = {key: getattr(scene, key) for key in scene.model_fields_set}
    return Scene(**{**stated, "contact": (*scene.contact, *found), "general_contact": None})


def _entries_of(scene: Scene, mesh: MeshArrays) -> list[Contact]:
    """Return the contacts of a mesh that ``general_contact`` covers and the scene does not
    state.
    """
    general = scene.general_contact
    assert general is not None
    found = proposed_contacts(mesh, general.within)
    named = [("bodies", name) for name in general.bodies]
    named += [("without", name) for pair in general.without for name in pair]
    if wrong := [(key, name) for key, name in named if name not in found.bodies]:
        known = ", ".join(found.bodies)
        raise SceneError(
            [
                (f"general_contact.{key}", f"there is no body {name!r}; there are: {known}")
                for key, name in wrong
            ]
        )
    allowed = general.bodies or found.bodies
    apart = [set(pair) for pair in general.without]
    return [
        _entry(contact, general, nonlinear=scene.statement.nonlinear)
        for contact in _not_stated(scene.contact, mesh, found)
        if set(contact.bodies) <= set(allowed) and set(contact.bodies) not in apart
    ]


def _entry(contact: ProposedContact, general: GeneralContact, *, nonlinear: bool) -> Contact:
    """Return a found contact as an entry of a scene."""
    if contact.shared:
        reason = (
            f"both sides of {contact.name} are sides of other contacts, too, and a boundary "
            "carries the points of one: divide one in the drawing, or add its bodies to without"
        )
        raise SceneError.at("general_contact", reason)
    stated: dict[str, Any] = {} if general.kind == "bonded" else {"friction": general.friction}
    if general.kind == "bonded" and nonlinear:
        stated["sliding"] = "small"
    elif general.kind != "bonded" and contact.fitted and not nonlinear:
        stated["distance"] = "nominal"
        stated["gap"] = 0.0 if contact.kind == "touches" else contact.gap
    boundary, against = (JOIN.join(names) for names in contact.sides)
    return Contact(boundary=boundary, against=against, kind=general.kind, **stated)


def propose_contacts(tagged: TaggedMesh, within: float | None = None) -> list[Contact]:
    """Return the contacts that a mesh of several bodies suggests, largest first; collective.

    Args:
        tagged: the mesh, whose surfaces in contact have names.
        within: distance up to which surfaces count as near, length; None: a quarter of a facet.

    Raises:
        SceneError: two bodies share a boundary with others on both sides.

    Examples:
        >>> print(len(sfx.propose_contacts(block)))
        0
    """
    from signorini_fx.mechanics.mesh.tagged import arrays_of

    arrays = arrays_of(tagged)
    general = GeneralContact()

    def entries() -> list[Contact]:
        found = proposed_contacts(arrays, within).contacts
        return [_entry(contact, general, nonlinear=False) for contact in found]

    return parallel.on_root(tagged.mesh.comm, entries)


def _not_stated(
    entries: Sequence[Contact], mesh: MeshArrays, found: Proposals
) -> Iterator[ProposedContact]:
    """Yield the found contacts that no entry of the scene covers."""

    def meet(stated: str | None, names: Sequence[str]) -> bool:
        listed = str(stated).split(JOIN)
        rows = [row for name in listed for row in mesh.boundaries.get(name, ())]
        return any(np.isin(mesh.boundaries[name], rows).any() for name in names)

    for contact in found.contacts:
        one, other = contact.sides
        if not any(
            (meet(entry.boundary, first) and meet(entry.against, second))
            for entry in entries
            for first, second in ((one, other), (other, one))
        ):
            yield contact


def without_contact(entries: Sequence[Contact], mesh: MeshArrays) -> Iterator[Finding]:
    """Yield a finding for each pair of surfaces of two bodies that touch or nearly touch, but have
    no contact in the scene.
    """
    for contact in _not_stated(entries, mesh, proposed_contacts(mesh)):
        sides = [
            f"{' and '.join(names)} of {body}"
            for names, body in zip(contact.sides, contact.bodies, strict=True)
        ]
        apart = "touch" if contact.kind == "touches" else f"have a gap of {contact.gap:.3g}"
        message = (
            f"{sides[0]} and {sides[1]} {apart}, and no [[contact]] names them: add one, or they "
            "pass through each other"
        )
        yield Finding("note" if contact.kind == "clearance" else "warning", "contact", message)


def scene_of(mesh: MeshFile, arrays: MeshArrays, file: Path) -> str:
    """Return the text of a scene for a drawing or a mesh, in which the user fills in materials,
    supports and loads.

    Args:
        mesh: the file of the mesh.
        arrays: the mesh that was read from it.
        file: the file of the scene.
    """
    found = proposed_contacts(arrays)
    contacts = found.contacts
    held = ", ".join(f"{axis} = 0.0" for axis in "xyz"[: arrays.dim])
    bodies, *remarks = in_words(found)
    unnamed = [f"# {line}" for line in remarks if line.startswith("surfaces")]
    own = ""
    if len(arrays.regions) > 1:
        first = next(iter(arrays.regions))
        own = f"  # each its own: [{{ region = {_quoted(first)}, young = ... }}, ...]"
    named = [f"units = {_MILLIMETRES}"] if mesh.file.suffix.lower() in (".step", ".stp") else []
    shown = f"{file.stem}.png shows the boundaries, such as {_quoted(min(arrays.boundaries))}"
    lines = [
        f"# {bodies}",
        *unnamed,
        f"title = {_quoted(mesh.file.stem)}",
        mesh_entry(mesh, file.parent, contacts),
        *named,
        "",
        f'# Fill in what is 0.0 or ""; {shown}.',
        f"material = {{ young = 0.0, poisson = 0.3 }}{own}",
        f'displacement = [{{ boundary = "", {held} }}]  # supports',
        'traction = [{ boundary = "", pressure = 0.0 }]  # or x, y, z: forces per area',
    ]
    if contacts:
        lines += [f"contact = [  # with friction: friction = {_FRICTION}", f"    {_rows(contacts)}"]
        lines.append("]")
    return "\n".join([*lines, ""])
