"""Supports and loads of a command file, AFFE_CHAR_MECA and AFFE_CHAR_CINE.  No dolfinx here."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from signorini_fx.addons.aster.command_file import depends_on, value_at
from signorini_fx.addons.aster.study import AsterStudy, NodalForce, Relation, Support, SurfaceLoad
from signorini_fx.addons.aster.values import AsterCommand, CommandError, Concept
from signorini_fx.mechanics.mesh.files.shape import Floats
from signorini_fx.tuned import TOWARD_CORNERS

_COMPONENTS = {"DX": 0, "DY": 1, "DZ": 2}
_FORCES = {"FX": 0, "FY": 1, "FZ": 2}


def read_excitation(study: AsterStudy, solve: AsterCommand, entry: dict[str, Any]) -> None:
    """What an occurrence of EXCIT says: a load or supports, with their course.

    Raises:
        CommandError: a value is none, or a group is not there.
    """
    charge = solve.concept(entry.get("CHARGE"), "CHARGE")
    for key in sorted(entry.keys() - {"CHARGE", "FONC_MULT", "TYPE_CHARGE"}):
        study.lose(solve.origin, f"EXCIT: {key} is not known here")
    course = [1.0] * len(study.instants)
    if "FONC_MULT" in entry:
        course = [value_at(entry["FONC_MULT"], {"INST": time}, solve, "FONC_MULT") for time in study.instants]
    if entry.get("TYPE_CHARGE", "FIXE_CSTE") not in ("FIXE_CSTE", "SUIV"):
        study.lose(solve.origin, f"TYPE_CHARGE={entry['TYPE_CHARGE']!r}")
    elif entry.get("TYPE_CHARGE") == "SUIV":
        study.note(solve.origin, "TYPE_CHARGE='SUIV': the load keeps its direction, as displacements are small")
    for command in charge.commands:
        _charge(study, command, course)


def _charge(study: AsterStudy, command: AsterCommand, course: list[float]) -> None:
    if not command.name.startswith(("AFFE_CHAR_MECA", "AFFE_CHAR_CINE")):
        study.lose(command.origin, "a load that is not known here")
        return
    for key in command.keywords:
        match key:
            case "MODELE" | "INFO" | "VERI_NORM" | "LIAISON_EPX" | "VERI_DDL":
                continue
            case "DDL_IMPO" | "MECA_IMPO":
                for entry in command.factors(key):
                    _prescribe(study, command, entry, course)
            case "FACE_IMPO":
                for entry in command.factors(key):
                    if entry.keys() & {"DNOR", "DTAN"}:
                        study.lose(command.origin, "FACE_IMPO: DNOR or DTAN")
                    _prescribe(study, command, {k: v for k, v in entry.items() if k not in ("DNOR", "DTAN")}, course)
            case "PRES_REP":
                for entry in command.factors(key):
                    _press(study, command, entry, course)
            case "FORCE_CONTOUR" | "FORCE_FACE":
                for entry in command.factors(key):
                    _pull(study, command, entry, course)
            case "FORCE_NODALE":
                for entry in command.factors(key):
                    _push(study, command, entry, course)
            case "PESANTEUR":
                for entry in command.factors(key):
                    _weigh(study, command, entry, course)
            case "LIAISON_DDL" | "LIAISON_UNIF" | "LIAISON_GROUP":
                for entry in command.factors(key):
                    _relate(study, command, key, entry)
            case _:
                study.lose(command.origin, f"{key} is not known here")


def _at(study: AsterStudy, node: int, time: float) -> dict[str, float]:
    x, y, z = map(float, study.mesh.points[node])
    return {"X": x, "Y": y, "Z": z, "INST": time}


def _prescribe(study: AsterStudy, command: AsterCommand, entry: dict[str, Any], course: list[float]) -> None:
    nodes = study.mesh.selected(command, entry)
    values = {key: entry[key] for key in _COMPONENTS if key in entry}
    blocked = set(command.words(entry["BLOCAGE"], "BLOCAGE") if "BLOCAGE" in entry else ())
    for unknown in blocked - {"DEPLACEMENT", "ROTATION", "TUYAU_FOURIER"}:
        study.lose(command.origin, f"BLOCAGE={unknown!r} is not known here")
    if entry.get("LIAISON", "ENCASTRE") != "ENCASTRE":
        study.lose(command.origin, f"LIAISON={entry['LIAISON']!r} is not known here")
    elif "LIAISON" in entry or "DEPLACEMENT" in blocked:
        values |= dict.fromkeys(_COMPONENTS, 0.0)
    further = entry.keys() - values.keys() - {"LIAISON", "BLOCAGE", "DRX", "DRY", "DRZ"}
    further -= {"TOUT", "GROUP_NO", "GROUP_MA", "NOEUD", "SANS_GROUP_NO", "SANS_GROUP_MA"}
    if further:
        study.lose(command.origin, f"what is prescribed of {', '.join(sorted(further))}")
    for key, value in values.items():
        component = _COMPONENTS[key]
        if component >= study.dim:
            continue
        courses: list[float | Floats] = []
        for time, factor in zip(study.instants, course, strict=True):
            if depends_on(value) & {"X", "Y", "Z"}:
                at_nodes = [value_at(value, _at(study, node, time), command, key) for node in nodes]
                courses.append(factor * np.array(at_nodes))
            else:
                courses.append(factor * value_at(value, {"INST": time}, command, key))
        study.supports.append(Support(nodes, component, courses, command.origin))


def _press(study: AsterStudy, command: AsterCommand, entry: dict[str, Any], course: list[float]) -> None:
    if "CISA_2D" in entry:
        study.lose(command.origin, "PRES_REP: CISA_2D, a shear along the boundary")
    if "PRES" not in entry:
        return
    marks = study.mesh.boundary(command, entry, study.dim)
    _surface_load(study, command, marks, {"PRES": entry["PRES"]}, course)


def _pull(study: AsterStudy, command: AsterCommand, entry: dict[str, Any], course: list[float]) -> None:
    further = entry.keys() - {"TOUT", "GROUP_MA", *_FORCES}
    if further:
        study.lose(command.origin, f"forces on a boundary with {', '.join(sorted(further))}")
    marks = study.mesh.boundary(command, entry, study.dim)
    _surface_load(study, command, marks, {key: entry[key] for key in _FORCES if key in entry}, course)


def _surface_load(
    study: AsterStudy, command: AsterCommand, marks: list[Any], values: Mapping[str, Any], course: list[float]
) -> None:
    """A pressure or a force per area."""
    varying = any(depends_on(value) & {"X", "Y", "Z"} for value in values.values())
    if varying:
        _varying_load(study, command, marks, values, course)
        return
    pressing = "PRES" in values
    vector = np.zeros((len(study.instants), 1 if pressing else 3))
    for k, (time, factor) in enumerate(zip(study.instants, course, strict=True)):
        for key, value in values.items():
            vector[k, 0 if pressing else _FORCES[key]] = factor * value_at(value, {"INST": time}, command, key)
    (study.pressures if pressing else study.tractions).append(SurfaceLoad(marks, vector, command.origin))


def _varying_load(
    study: AsterStudy, command: AsterCommand, marks: list[Any], values: Mapping[str, Any], course: list[float]
) -> None:
    """A load that is a function of the position, where it is constant on each element of the boundary."""
    components = {key: 0 if key == "PRES" else _FORCES[key] for key in values}
    width = 1 if "PRES" in values else 3
    of_elements: dict[bytes, tuple[Floats, list[tuple[int, int]]]] = {}
    for block, ((kind, rows), mark) in enumerate(zip(study.mesh.blocks, marks, strict=True)):
        for row in np.flatnonzero(mark):
            corners = study.mesh.points[rows[row][: {"l": 2, "t": 3, "q": 4}[kind[0]]]]
            # Between the middle and the corners, where a quadrature of the boundary has its points.
            at = corners.mean(axis=0) + TOWARD_CORNERS * (corners - corners.mean(axis=0))
            vectors = np.zeros((len(at), len(study.instants), width))
            for key, axis in components.items():
                for point, x in enumerate(at):
                    named = dict(zip("XYZ", map(float, x), strict=False))
                    for k, (time, factor) in enumerate(zip(study.instants, course, strict=True)):
                        value = value_at(
                            values[key], {"X": 0.0, "Y": 0.0, "Z": 0.0, **named, "INST": time}, command, key
                        )
                        vectors[point, k, axis] = factor * value
            if not (vectors == vectors[:1]).all():
                study.lose(command.origin, f"{', '.join(values)}: a function of the position within an element")
                return
            of_elements.setdefault(vectors[0].tobytes(), (vectors[0], []))[1].append((block, int(row)))
    for vector, elements in of_elements.values():
        if vector.any():
            chosen = [np.zeros(len(rows), dtype=bool) for _, rows in study.mesh.blocks]
            for block, row in elements:
                chosen[block][row] = True
            loads = study.pressures if width == 1 else study.tractions
            loads.append(SurfaceLoad(chosen, vector, command.origin))


def _push(study: AsterStudy, command: AsterCommand, entry: dict[str, Any], course: list[float]) -> None:
    nodes = study.mesh.selected(command, entry)
    further = entry.keys() - {"GROUP_NO", "NOEUD", *_FORCES}
    if further:
        study.lose(command.origin, f"forces at nodes with {', '.join(sorted(further))}")
    forces = np.zeros((len(study.instants), 3))
    for k, (time, factor) in enumerate(zip(study.instants, course, strict=True)):
        for key, axis in _FORCES.items():
            if key in entry:
                forces[k, axis] = factor * value_at(entry[key], {"INST": time}, command, key)
    study.forces.append(NodalForce(nodes, forces * study.circumference, command.origin))


def _weigh(study: AsterStudy, command: AsterCommand, entry: dict[str, Any], course: list[float]) -> None:
    if entry.keys() - {"GRAVITE", "DIRECTION"}:
        study.lose(command.origin, "PESANTEUR on a part of the body")
    size = command.number(entry.get("GRAVITE"), "GRAVITE")
    direction = np.array(command.numbers(entry.get("DIRECTION"), "DIRECTION"))
    if len(direction) != 3 or not direction.any():
        raise CommandError(command.origin, "PESANTEUR: DIRECTION: three numbers that are not all 0 are expected")
    study.gravities.append((size * np.outer(course, direction / np.linalg.norm(direction)), command.origin))


def _relate(study: AsterStudy, command: AsterCommand, key: str, entry: dict[str, Any]) -> None:
    mesh = study.mesh
    constant = entry.get("COEF_IMPO", 0.0)
    if depends_on(constant) or isinstance(constant, Concept) or command.number(constant, "COEF_IMPO") != 0:
        study.lose(command.origin, f"{key}: COEF_IMPO other than 0")
        return
    if key == "LIAISON_DDL":
        selected = mesh.nodes if "GROUP_NO" in entry else mesh.single_nodes
        names = command.words(entry.get("GROUP_NO", entry.get("NOEUD", ())), "GROUP_NO")
        words = command.words(entry.get("DDL", ()), "DDL")
        factors = command.numbers(entry.get("COEF_MULT", ()), "COEF_MULT")
        if not len(names) == len(words) == len(factors):
            raise CommandError(command.origin, "LIAISON_DDL: as many nodes, DDL and COEF_MULT are expected")
        terms = []
        for name, word, factor in zip(names, words, factors, strict=True):
            nodes = selected(command, [name])
            if len(nodes) != 1 or word not in _COMPONENTS:
                study.lose(command.origin, f"LIAISON_DDL of {word} of {len(nodes)} nodes")
                return
            terms.append((int(nodes[0]), _COMPONENTS[word], factor))
        study.relations.append(Relation(tuple(terms), command.origin))
        return
    if key == "LIAISON_UNIF":
        first, *following = mesh.selected(command, entry)
        for word in command.words(entry.get("DDL", ()), "DDL"):
            if word not in _COMPONENTS:
                study.lose(command.origin, f"LIAISON_UNIF of {word}")
                continue
            for node in following:
                terms = [(int(first), _COMPONENTS[word], 1.0), (int(node), _COMPONENTS[word], -1.0)]
                study.relations.append(Relation(tuple(terms), command.origin))
        return
    nodes, partners = (
        mesh.selected(
            command, {word: entry[f"{word}_{k}"] for word in ("GROUP_NO", "GROUP_MA") if f"{word}_{k}" in entry}
        )
        for k in (1, 2)
    )
    first_words, second_words = (command.words(entry.get(f"DDL_{k}", ()), f"DDL_{k}") for k in (1, 2))
    first_factors, second_factors = (command.numbers(entry.get(f"COEF_MULT_{k}", ()), f"COEF_MULT_{k}") for k in (1, 2))
    if (
        entry.keys() & {"TRAN", "ANGL_NAUT", "CENTRE", "SOMMET"}
        or not {*first_words, *second_words} <= _COMPONENTS.keys()
    ):
        study.lose(command.origin, "LIAISON_GROUP of other components, or of a part that is moved")
        return
    for node, partner in zip(nodes, mesh.nearest(nodes, partners), strict=True):
        terms = [(int(node), _COMPONENTS[word], f) for word, f in zip(first_words, first_factors, strict=True)]
        terms += [(int(partner), _COMPONENTS[word], f) for word, f in zip(second_words, second_factors, strict=True)]
        study.relations.append(Relation(tuple(terms), command.origin))
