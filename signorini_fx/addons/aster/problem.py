"""What a command file says of one problem, whose solution is a result of it.

What a scene cannot say, or what would need a guess, is listed.  No dolfinx here.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from signorini_fx.addons.aster.command_file import CommandFile
from signorini_fx.addons.aster.grouped_mesh import DIMENSIONS, GroupedMesh
from signorini_fx.addons.aster.loads import read_excitation
from signorini_fx.addons.aster.mail_file import read_mail
from signorini_fx.addons.aster.study import MODELS, AsterStudy, ExcludedNodes
from signorini_fx.addons.aster.values import AsterCommand, CommandError, Concept
from signorini_fx.addons.aster.zones import read_contact
from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.files.reading import read_separately
from signorini_fx.tuned import ACROSS_AXIS

# Kinds of DEFORMATION for which displacements are small.
SMALL = ("PETIT", "PETIT_REAC")
SOLVES = ("STAT_NON_LINE", "MECA_NON_LINE", "MECA_STATIQUE")
# More instants than these are not solved one after the other.
_MOST_INSTANTS = 400


def results_of(commands: CommandFile) -> list[Concept]:
    """What the file solves, in its order; what continues another result is part of that one.

    A result of a command that is not evaluated is none.
    """
    return [concept for concept in commands.concepts if concept.made_by.name in SOLVES]


def read_study(file: Path, commands: CommandFile, result: Concept, wanted: Sequence[float] | None = None) -> AsterStudy:
    """The problem whose solution is a result.

    Args:
        file: the command file, beside which its mesh is.
        commands: what is in it.
        result: one of ``results_of``.
        wanted: instants that are enough where the solution does not depend on what was before; None: all.

    Raises:
        MeshError: it is not known here how to say it, or a value is none; the message says where.
    """
    try:
        return _read(file, commands, result, wanted)
    except CommandError as error:
        raise MeshError(f"{file}: {error.text}") from None


def _read(file: Path, commands: CommandFile, result: Concept, wanted: Sequence[float] | None) -> AsterStudy:
    solve = result.made_by
    model = solve.concept(solve.get("MODELE"), "MODELE").made_by
    mesh_concept = model.concept(model.get("MAILLAGE"), "MAILLAGE")
    mesh = _mesh(file, commands, mesh_concept, solve)
    kind, body = _model(mesh, model)
    study = AsterStudy(mesh, kind, body, result=result)
    for line, why in commands.unread:
        if "in it: no command" not in why:
            study.lose(f"line {line}", why)
    _say_of_mesh(study, mesh_concept, solve)
    for command in commands.commands:
        if command.name in SOLVES or command.name.startswith(("AFFE_", "DEFI_")):
            for key in _misspelled(command.keywords):
                study.lose(command.origin, f"{key} is not known: keywords are in capitals")
    _say_of_unused_contact(study, commands, solve)
    _materials(study, solve)
    _behaviour(study, solve)
    instants = instants_of(solve)
    zones = solve.get("CONTACT")
    if zones is not None:
        read_contact(study, solve, zones)
    for command in (command for command in result.commands[1:] if command.name in SOLVES):
        study.lose(command.origin, "a solution that is continued: the first part is taken")
    if "ETAT_INIT" in solve:
        study.lose(solve.origin, "ETAT_INIT: a state to begin with")
    study.instants = _needed(instants, wanted, rubs=any(zone.coefficient for zone in study.zones))
    for entry in solve.factors("EXCIT"):
        read_excitation(study, solve, entry)
    for excluded in study.excluded:
        _exclude_nodes(study, excluded)
    return study


def _misspelled(value: Any) -> list[str]:
    """Keywords that are not in capitals, also within factor keywords; code_aster has none but these two."""
    if isinstance(value, tuple | list):
        return [key for entry in value for key in _misspelled(entry)]
    if not isinstance(value, dict):
        return []
    own = [str(key) for key in value if str(key) not in ("reuse", "identification") and not str(key).isupper()]
    return own + [key for entry in value.values() for key in _misspelled(entry)]


def _say_of_unused_contact(study: AsterStudy, commands: CommandFile, solve: AsterCommand) -> None:
    """A contact that is defined for a solution, but which none takes, as where CONTACT was forgotten."""
    solves = [concept.made_by for concept in results_of(commands)]
    if "CONTACT" in solve or any("CONTACT" in other for other in solves):
        return
    for concept in commands.concepts:
        if concept.made_by.name in ("DEFI_CONTACT", "DEFI_CONT"):
            study.lose(concept.made_by.origin, "nothing that is solved has it as its CONTACT")


def _exclude_nodes(study: AsterStudy, excluded: ExcludedNodes) -> None:
    """Take nodes out of a zone, but those of which supports or relations hold all that contact would move: there it is
    the same with contact.
    """
    held = {(int(node), support.component) for support in study.supports for node in support.nodes}
    held |= {(node, component) for relation in study.relations for node, component, _ in relation.terms}
    loose = [
        node
        for row, node in enumerate(map(int, excluded.nodes))
        if any(abs(excluded.acting[row, k]) > ACROSS_AXIS and (node, k) not in held for k in range(study.dim))
    ]
    if loose and excluded.directed:
        study.lose("", f"{excluded.origin}: friction acts in all directions at {len(loose)} nodes")
    elif loose:
        study.zones = [
            zone if zone.number != excluded.zone else zone.without(np.array(loose), rubbing=excluded.rubs)
            for zone in study.zones
        ]
        study.note("", f"{excluded.origin}: {len(loose)} nodes, where contact or friction has an exception")
    elif len(excluded.nodes):
        study.note("", f"{excluded.origin}: {len(excluded.nodes)} nodes, which supports or relations hold")


def _needed(instants: list[float], wanted: Sequence[float] | None, *, rubs: bool) -> list[float]:
    if rubs or wanted is None:
        return instants
    enough = [
        time
        for time in instants
        if any(abs(time - additional) < 1e-6 * max(1.0, abs(additional)) for additional in wanted)
    ]
    return enough or instants[-1:]


# --- mesh ---------------------------------------------------------------------------------------------------------


def _mesh(file: Path, commands: CommandFile, concept: Concept, solve: AsterCommand) -> GroupedMesh:
    """The mesh of a model, with all groups that commands have made."""
    made = concept.made_by
    if made.name == "CREA_MAILLAGE":
        mesh = _mesh(file, commands, made.concept(made.get("MAILLAGE"), "MAILLAGE"), solve)
        for key in made.keywords.keys() - {"MAILLAGE", "DECOUPE_LAC", "INFO", "TITRE"} - _OTHER_NODES:
            raise CommandError(made.origin, f"{key} is not known here")
    elif made.name == "LIRE_MAILLAGE":
        mesh = GroupedMesh(_raw(file, made))
    else:
        raise CommandError(made.origin, "a mesh that is not read from a file")
    for command in concept.commands[1:]:
        if command.line > solve.line and command.name != "DEFI_GROUP":
            continue
        if command.name == "DEFI_GROUP":
            mesh.define(command)
        elif command.name == "MODI_MAILLAGE":
            for key in command.keywords:
                if not key.startswith(("ORIE_", "reuse", "MAILLAGE", "INFO")):
                    raise CommandError(command.origin, f"{key}: a mesh that is moved is not known here")
    return mesh


# Options of CREA_MAILLAGE that add or take nodes between the corners.
_OTHER_NODES = {"HEXA20_27", "PENTA15_18", "QUAD_LINE", "LINE_QUAD", "CREA_POI1"}


def _say_of_mesh(study: AsterStudy, concept: Concept, solve: AsterCommand) -> None:
    made = concept.made_by
    if made.name == "CREA_MAILLAGE":
        for key in made.keywords:
            if key == "DECOUPE_LAC":
                study.note(made.origin, "DECOUPE_LAC: cells at the contact stay whole")
            elif key in _OTHER_NODES:
                study.note(made.origin, f"{key}: nodes between the corners are as in the file")


_SUFFIXES = {"MED": (".mmed", ".med", ".rmed"), "ASTER": (".mail", ".aster")}


def _raw(file: Path, command: AsterCommand) -> Any:
    """The mesh file that LIRE_MAILLAGE reads: that of its UNITE in the .export, or the one beside it with its name."""
    form = command.words(command.get("FORMAT", "MED"), "FORMAT")[0]
    if form not in _SUFFIXES:
        raise CommandError(command.origin, f"FORMAT={form!r}: meshes are read in the formats MED and ASTER")
    if "NOM_MED" in command:
        raise CommandError(command.origin, "NOM_MED: a mesh among several of a file")
    unit = int(command.number(command.get("UNITE", 20), "UNITE"))
    path = _exported(file, unit)
    if path is None:
        path = next((p for s in _SUFFIXES[form] if (p := file.with_suffix(s)).is_file()), None)
    if path is None or not path.is_file():
        names = f"{file.stem}.export, or one of {', '.join(file.stem + s for s in _SUFFIXES[form])}"
        raise CommandError(command.origin, f"there is no mesh beside it: {names} is expected")
    if form == "ASTER":
        return read_mail(path)
    try:
        return read_separately(path, "meshio", {"kind": "med"})
    except MeshError as error:
        raise CommandError(command.origin, str(error)) from None


def _exported(file: Path, unit: int) -> Path | None:
    """The file of a logical unit that a .export beside it lists; None: there is none."""
    listing = file.with_suffix(".export")
    if not listing.is_file():
        return None
    text = listing.read_text(encoding="utf-8", errors="replace")
    for name, number in re.findall(r"^F\s+\S+\s+(\S+)\s+\S+\s+(\d+)\s*$", text, re.MULTILINE):
        beside = file.with_name(Path(name).name)
        if int(number) == unit and beside.is_file():
            return beside
    return None


def _model(mesh: GroupedMesh, command: AsterCommand) -> tuple[str, list[Any]]:
    """The kind of the model, and its body."""
    body = [np.zeros(len(nodes), dtype=bool) for _, nodes in mesh.blocks]
    kinds: set[str] = set()
    for entry in command.factors("AFFE"):
        if entry.get("PHENOMENE") != "MECANIQUE":
            raise CommandError(command.origin, f"PHENOMENE={entry.get('PHENOMENE')!r}: only MECANIQUE is known here")
        (kind,) = command.words(entry.get("MODELISATION", ""), "MODELISATION")[:1]
        if kind not in MODELS:
            raise CommandError(command.origin, f"MODELISATION={kind!r}: known are {', '.join(MODELS)}")
        kinds.add(kind)
        marks = mesh.where(command, entry)
        for k, (cell, _) in enumerate(mesh.blocks):
            if DIMENSIONS.get(cell, -1) == (3 if kind == "3D" else 2):
                body[k] |= marks[k]
    if len(kinds) != 1:
        raise CommandError(command.origin, f"elements of several kinds: {', '.join(sorted(kinds)) or 'none'}")
    if not any(mark.any() for mark in body):
        raise CommandError(command.origin, "no element of the body is in the mesh")
    return kinds.pop(), body


# --- materials ----------------------------------------------------------------------------------------------------


def _materials(study: AsterStudy, solve: AsterCommand) -> None:
    field_command = solve.concept(solve.get("CHAM_MATER"), "CHAM_MATER").made_by
    for entry in field_command.factors("AFFE"):
        value = entry.get("MATER")
        value = value[0] if isinstance(value, tuple | list) and value else value
        material = field_command.concept(value, "MATER").made_by
        if material.name != "DEFI_MATERIAU" or "ELAS" not in material:
            raise CommandError(material.origin, "ELAS is expected: an isotropic elastic material with constants")
        elastic = material.factor("ELAS")
        properties = {
            "young": material.number(elastic.get("E"), "E"),
            "poisson": material.number(elastic.get("NU"), "NU"),
        }
        for key, name in (("RHO", "density"), ("ALPHA", "expansion")):
            if key in elastic:
                properties[name] = material.number(elastic[key], key)
        study.materials.append((study.mesh.where(field_command, entry), properties, material.origin))
    for entry in field_command.factors("AFFE_VARC"):
        study.lose(field_command.origin, f"AFFE_VARC: {entry.get('NOM_VARC')}")


def _behaviour(study: AsterStudy, solve: AsterCommand) -> None:
    for entry in solve.factors("COMPORTEMENT"):
        relation, deformation = entry.get("RELATION", "ELAS"), entry.get("DEFORMATION", "PETIT")
        if relation != "ELAS":
            study.lose(solve.origin, f"RELATION={relation!r}: the material is elastic here")
        if deformation not in SMALL:
            study.lose(solve.origin, f"DEFORMATION={deformation!r}: displacements are taken as small")
    if "PILOTAGE" in solve:
        study.lose(solve.origin, "PILOTAGE: a load that is found")


def instants_of(solve: AsterCommand) -> list[float]:
    """The instants that are solved, without the first one."""
    if solve.name == "MECA_STATIQUE":
        if "INST" in solve:
            return [solve.number(solve.get("INST"), "INST")]
        return _listed(solve, solve.get("LIST_INST")) if "LIST_INST" in solve else [0.0]
    entry = solve.factor("INCREMENT")
    instants = _listed(solve, entry.get("LIST_INST"))
    last = entry.get("NUME_INST_FIN")
    if last is not None:
        instants = instants[: int(solve.number(last, "NUME_INST_FIN")) + 1]
    if "INST_FIN" in entry:
        end = solve.number(entry["INST_FIN"], "INST_FIN")
        instants = [time for time in instants if time <= end + 1e-9 * max(1.0, abs(end))]
    if "INST_INIT" in entry or "NUME_INST_INIT" in entry:
        raise CommandError(solve.origin, "a beginning within the list of instants")
    if any(later <= time for time, later in itertools.pairwise(instants)):
        raise CommandError(solve.origin, "LIST_INST: instants must increase")
    if len(instants) < 2:
        raise CommandError(solve.origin, "LIST_INST: two instants at least are expected")
    if len(instants) > _MOST_INSTANTS:
        raise CommandError(solve.origin, f"LIST_INST: more than {_MOST_INSTANTS} instants")
    return instants[1:]


def _listed(user: AsterCommand, value: Any) -> list[float]:
    command = user.concept(value, "LIST_INST").made_by
    if command.name == "DEFI_LIST_INST":
        entry = command.factor("DEFI_LIST")
        if "LIST_INST" not in entry:
            raise CommandError(command.origin, "DEFI_LIST: LIST_INST is expected")
        return _listed(command, entry["LIST_INST"])
    if command.name != "DEFI_LIST_REEL":
        raise CommandError(command.origin, "DEFI_LIST_REEL is expected")
    if "VALE" in command:
        return command.numbers(command.get("VALE"), "VALE")
    instants = [command.number(command.get("DEBUT"), "DEBUT")]
    for entry in command.factors("INTERVALLE"):
        end = command.number(entry.get("JUSQU_A"), "JUSQU_A")
        if "NOMBRE" in entry:
            count = int(command.number(entry["NOMBRE"], "NOMBRE"))
        else:
            step = command.number(entry.get("PAS"), "PAS")
            count = round((end - instants[-1]) / step) if step else 0
        if not 0 < count <= 100 * _MOST_INSTANTS:
            raise CommandError(command.origin, f"INTERVALLE: {count} steps to {end:g}")
        begin = instants[-1]
        instants += [begin + (end - begin) * k / count for k in range(1, count + 1)]
    return instants
