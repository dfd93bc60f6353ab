"""What a command file says that code_aster has computed: TEST_RESU and TEST_TABLE.  No dolfinx here."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from signorini_fx.addons.aster.command_file import CommandFile
from signorini_fx.addons.aster.study import AsterStudy
from signorini_fx.addons.aster.values import AsterCommand, CommandError, Concept
from signorini_fx.mechanics.mesh.files.shape import Ints

# Fields by nodes that are compared, and what they are in words.
FIELDS = {
    "DEPL": "displacement",
    "REAC_NODA": "nodal force",
    "FORC_NODA": "internal force",
    "SIEF_NOEU": "stress",
    "SIGM_NOEU": "stress",
}
EXACT = "ANALYTIQUE"


@dataclass(frozen=True)
class Expectation:
    """A value that code_aster has computed.

    Attributes:
        field: such as DEPL.
        component: such as DX.
        nodes: of the mesh, of which it is the value at the only one, or the sum, the largest or the smallest.
        how: "", "SOMM", "MAX", "MIN".
        instant: the one of the load steps, from 0.
        theirs: the value.
        exact: the exact one; None: none is known.
        unsigned: whether only the size is compared.
        where: in words.
        line: in the command file.
    """

    field: str
    component: str
    nodes: Ints
    how: str
    instant: int
    theirs: float
    exact: float | None
    unsigned: bool
    where: str
    line: int


def tested_instants(commands: CommandFile, result: Concept) -> list[float] | None:
    """The instants at which a result is tested; None: some are known by their number only."""
    instants: list[float] = []
    for entry in _entries(commands, result):
        if not isinstance(entry.get("INST"), int | float):
            return None
        instants.append(float(entry["INST"]))
    for action, _, _ in _tables(commands, result):
        if not isinstance(action.get("INST"), int | float):
            return None
        instants.append(float(action["INST"]))
    return instants


def expectations(commands: CommandFile, study: AsterStudy, instants: list[float]) -> tuple[list[Expectation], int]:
    """What is tested of a result, and how many tests are of something else.

    Args:
        commands: of the file.
        study: the problem whose solution is the result.
        instants: all of the list of instants, without the first one.
    """
    collected, further = [], 0
    for command in commands.named("TEST_RESU"):
        for key in command.keywords:
            entries = command.keywords[key]
            for entry in entries if isinstance(entries, tuple | list) else (entries,):
                if not isinstance(entry, dict) or entry.get("RESULTAT") is not study.result:
                    continue
                try:
                    expectation = _of_entry(study, command, entry, instants)
                except CommandError:
                    expectation = None
                collected += [] if expectation is None else [expectation]
                further += expectation is None
    for action, command, test in _tables(commands, study.result):
        try:
            expectation = _of_table(study, action, command, test, instants)
        except CommandError:
            expectation = None
        collected += [] if expectation is None else [expectation]
        further += expectation is None
    return collected, further


def _entries(commands: CommandFile, result: Concept) -> Iterator[dict[str, Any]]:
    for command in commands.named("TEST_RESU"):
        entries = command.keywords.get("RESU", ())
        for entry in entries if isinstance(entries, tuple | list) else (entries,):
            if isinstance(entry, dict) and entry.get("RESULTAT") is result:
                yield entry


def _of_entry(
    study: AsterStudy, command: AsterCommand, entry: dict[str, Any], instants: list[float]
) -> Expectation | None:
    name, component = entry.get("NOM_CHAM"), entry.get("NOM_CMP")
    if name not in FIELDS or not isinstance(component, str) or "VALE_CALC" not in entry:
        return None
    how = entry.get("TYPE_TEST", "")
    if "GROUP_NO" in entry or "NOEUD" in entry:
        nodes = study.mesh.selected(command, {key: entry[key] for key in ("GROUP_NO", "NOEUD") if key in entry})
        where = " ".join(command.words(entry.get("GROUP_NO", entry.get("NOEUD")), "GROUP_NO"))
    elif how and "GROUP_MA" not in entry:
        nodes = study.slave_corners if component == "LAGS_C" else study.mesh.nodes_of_cells(study.body)
        where = "all nodes"
    else:
        return None
    return _expected(
        study, command, entry, name, component, nodes, how, _instant(command, entry, study, instants), where
    )


def _instant(command: AsterCommand, entry: dict[str, Any], study: AsterStudy, instants: list[float]) -> int | None:
    """The number of a load step from 0; None: it is none that is solved."""
    if "INST" in entry:
        time = command.number(entry["INST"], "INST")
    elif "NUME_ORDRE" in entry:
        number = int(command.number(entry["NUME_ORDRE"], "NUME_ORDRE"))
        if not 1 <= number <= len(instants):
            return None
        time = instants[number - 1]
    else:
        return None
    away = np.abs(np.array(study.instants) - time)
    return int(away.argmin()) if away.min() <= 1e-6 * max(1.0, abs(time)) else None


def _tables(commands: CommandFile, result: Concept) -> Iterator[tuple[dict[str, Any], AsterCommand, dict[str, Any]]]:
    """Each TEST_TABLE of values at nodes of a result: the action that has made the table, the command, what it says."""
    for command in commands.named("TEST_TABLE"):
        table = command.keywords.get("TABLE")
        if not isinstance(table, Concept) or table.made_by.name != "POST_RELEVE_T":
            continue
        actions = _listed(table.made_by.keywords.get("ACTION", ()))
        if len(actions) == 1 and actions[0].get("RESULTAT") is result and actions[0].get("OPERATION") == "EXTRACTION":
            origin = dict(actions[0])
            for entry in _listed(command.keywords.get("FILTRE", ())):
                if entry.get("NOM_PARA") in ("INST", "NUME_ORDRE") and entry.get("CRIT_COMP", "EQ") == "EQ":
                    origin[entry["NOM_PARA"]] = entry.get("VALE", entry.get("VALE_I"))
            yield origin, command, command.keywords


def _listed(value: Any) -> list[dict[str, Any]]:
    return [entry for entry in (value if isinstance(value, tuple | list) else (value,)) if isinstance(entry, dict)]


def _of_table(
    study: AsterStudy, action: dict[str, Any], command: AsterCommand, test: dict[str, Any], instants: list[float]
) -> Expectation | None:
    name, component = action.get("NOM_CHAM"), test.get("NOM_PARA")
    if name not in FIELDS or not isinstance(component, str) or "VALE_CALC" not in test:
        return None
    if action.get("REPERE", "GLOBAL") != "GLOBAL" or "GROUP_NO" not in action:
        return None
    nodes = study.mesh.selected(command, {"GROUP_NO": action["GROUP_NO"]})
    for entry in _listed(test.get("FILTRE", ())):
        key = entry.get("NOM_PARA")
        if key in ("INST", "NUME_ORDRE"):
            continue
        if key == "NOEUD":
            nodes = nodes[np.isin(nodes, _numbered(command, entry.get("VALE_K")))]
        elif key in _COORDINATES and entry.get("CRIT_COMP", "EQ") == "EQ" and entry.get("CRITERE") == "ABSOLU":
            value, near = (command.number(entry.get(word), word) for word in ("VALE", "PRECISION"))
            nodes = nodes[np.abs(study.mesh.points[nodes, _COORDINATES.index(key)] - value) <= near]
        else:
            return None
    how = "SOMM" if "RESULTANTE" in action else test.get("TYPE_TEST", "")
    where = " ".join(command.words(action["GROUP_NO"], "GROUP_NO"))
    return _expected(
        study, command, test, name, component, nodes, how, _instant(command, action, study, instants), where
    )


_COORDINATES = ("COOR_X", "COOR_Y", "COOR_Z")


def _numbered(command: AsterCommand, name: Any) -> list[int]:
    """The node that is called 783 or N783, in a mesh without names."""
    digits = command.words(name, "VALE_K")[0].lstrip("N")
    return [int(digits) - 1] if digits.isdigit() else []


def _expected(
    study: AsterStudy,
    command: AsterCommand,
    test: dict[str, Any],
    field: str,
    component: str,
    nodes: Ints,
    how: str,
    at: int | None,
    where: str,
) -> Expectation | None:
    if at is None or how not in ("", "MAX", "MIN", "SOMM") or not nodes.size:
        return None
    if component == "LAGS_C":
        corners = np.intersect1d(nodes, study.slave_corners)
        if not corners.size or (len(corners) < len(nodes) and how not in ("MAX", "MIN")):
            return None
        nodes = corners
    if len(nodes) != 1 and not how:
        return None
    theirs = command.number(test["VALE_CALC"], "VALE_CALC")
    exact = None
    if test.get("REFERENCE") == EXACT and "VALE_REFE" in test:
        exact = command.number(test["VALE_REFE"], "VALE_REFE")
    where = f"{_WORDS.get(how, '')}{where}"
    return Expectation(
        field, component, nodes, how, at, theirs, exact, test.get("VALE_ABS") == "OUI", where, command.line
    )


_WORDS = {"MAX": "largest of ", "MIN": "smallest of "}
