"""A command file of code_aster beside the values in it: the scene that it becomes, solved, and compared."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded
import numpy as np

from signorini_fx.addons.aster.command_file import CommandFile, read_commands
from signorini_fx.addons.aster.draft import CommandDraft, draft_result
from signorini_fx.addons.aster.expectations import FIELDS, Expectation, expectations, tested_instants
from signorini_fx.addons.aster.problem import instants_of, results_of
from signorini_fx.addons.aster.study import AsterStudy
from signorini_fx.addons.aster.values import Concept
from signorini_fx.addons.decks.content import Deck
from signorini_fx.addons.decks.node_results import NodeResults
from signorini_fx.addons.gauntlet.aster_kinds import other_behaviour, other_kind
from signorini_fx.addons.gauntlet.case_run import CaseRun
from signorini_fx.addons.gauntlet.finer import FinerValues, finer_values
from signorini_fx.addons.gauntlet.outcomes import (
    LOST,
    OTHER_KIND,
    REFUSED,
    UNSOLVED,
    WHOLE,
    ComparedQuantity,
    GauntletCase,
    in_short,
)
from signorini_fx.addons.gauntlet.solved_drafts import SolvedDraft
from signorini_fx.addons.gauntlet.sources import ASTER
from signorini_fx.errors import SignoriniError
from signorini_fx.mechanics.mesh.files.arrays import plain
from signorini_fx.mechanics.mesh.files.shape import Floats
from signorini_fx.tuned import DIGITS_OF_FILES, EXPLAINED_FROM

_STRESSES = ("SIXX", "SIYY", "SIZZ", "SIXY", "SIXZ", "SIYZ")
_WORSE = (WHOLE, LOST, UNSOLVED, REFUSED)
_AXES = ("DX", "DY", "DZ")


class CommandRun(CaseRun):
    """A case that runs; its file is the command file."""

    def outcome(self) -> GauntletCase:
        """Run all results of the file, and say what they have come to."""
        case = GauntletCase(self.file.stem, ASTER, REFUSED)
        try:
            commands = read_commands(self.file)
        except SignoriniError as error:
            return replace(case, why=self.without_folders(str(error)))
        if why := other_kind(commands):
            return replace(case, state=OTHER_KIND, why=why)
        results = results_of(commands)
        parts: list[GauntletCase] = []
        for number, result in enumerate(results):
            part = self._result(commands, result, number)
            prefix = f"{result.name}: " if len(results) > 1 else ""
            parts.append(_prefixed(part, prefix))
            self.tell(_together(case, parts))
        return _together(case, parts)

    def _result(self, commands: CommandFile, result: Concept, number: int) -> GauntletCase:
        case = GauntletCase(self.file.stem, ASTER, REFUSED)
        if why := other_behaviour(result):
            return replace(case, state=OTHER_KIND, why=why)

        def draft(target: Path) -> CommandDraft:
            return draft_result(self.file, commands, result, target, tested_instants(commands, result))

        # What is told are the rows of all results so far.
        return self.solved_row(
            case, f"{self.file.stem}_{number}", draft, partial(self._compared, commands), tells=False
        )

    def _compared(
        self,
        commands: CommandFile,
        case: GauntletCase,
        drafted: CommandDraft,
        moments: list[NodeResults],
        solved: SolvedDraft,
    ) -> GauntletCase:
        study, deck = drafted.study, drafted.deck
        wanted, further = expectations(commands, study, instants_of(study.result.made_by))
        fields = [_Fields(moment, deck, study) for moment in moments]
        case = replace(case, quantities=tuple(_quantities(wanted, fields, None)))
        if not case.quantities:
            message = (
                f"{further} tests, all of something else than values at nodes that both have" if further else "no test"
            )
            return replace(case, why=in_short([*filter(None, [case.why]), message]))
        if (case.difference or 0.0) <= EXPLAINED_FROM:
            return case
        theirs = [f"theirs is {words}" for words in study.formulations]
        case = replace(case, reasons=tuple(filter(None, [*theirs, f"here {deck.mesh.note}" if deck.mesh.note else ""])))
        finer = None if study.nodal else finer_values(solved, deck)
        if finer is None:
            return case
        quantities = _quantities(wanted, fields, (finer, len(moments) - 1))
        return replace(case, quantities=tuple(quantities)).told_by_finer()


@dataclass
class _Fields:
    """Our solution at an instant, by nodes of their mesh."""

    moment: NodeResults
    deck: Deck
    study: AsterStudy

    def __post_init__(self) -> None:
        self._rows = {int(number) - 1: row for row, number in enumerate(plain(self.deck.names))}

    def values(self, expectation: Expectation) -> Floats | None:
        """Of the nodes of an expectation; None: ours has none there."""
        rows = [self._rows.get(int(node), -1) for node in expectation.nodes]
        if -1 in rows:
            if not expectation.how or expectation.how == "SOMM":
                return None
            rows = [row for row in rows if row >= 0]
        name, component, moment = expectation.field, expectation.component, self.moment
        if name == "DEPL" and component in _AXES:
            return moment.displacement[rows, _AXES.index(component)]
        if name == "DEPL" and component == "LAGS_C":
            rows = [row for row in rows if moment.points[row]]  # a node on the axis, which has no area, is none
            complete = len(rows) == len(expectation.nodes) or expectation.how in ("MAX", "MIN")
            return -np.nan_to_num(moment.contact[rows, 3]) if rows and complete else None
        if name == "REAC_NODA" and component in _AXES and (expectation.how == "SOMM" or not self.study.has_27_nodes):
            share = self.deck.printed_share * self.study.circumference
            return np.asarray(moment.reactions[rows, _AXES.index(component)] / share)
        if name in ("SIEF_NOEU", "SIGM_NOEU") and component in _STRESSES:
            return moment.stress[rows, _STRESSES.index(component)]
        return None

    def size(self, expectation: Expectation) -> float:
        """Of all values of the field of an expectation the largest one."""
        moment = self.moment
        match expectation.field:
            case "DEPL" if expectation.component in _AXES:
                return float(np.abs(moment.displacement).max())
            case "DEPL":
                return float(np.nan_to_num(np.abs(moment.contact[:, 3])).max(initial=0.0))
            case "REAC_NODA":
                return float(np.abs(moment.reactions).max()) / self.deck.printed_share / self.study.circumference
            case _:
                return float(np.abs(moment.stress).max())


def _combined(values: Floats, expectation: Expectation) -> float:
    """The value that is compared, of those at the nodes."""
    value = float(
        values.max() if expectation.how == "MAX" else values.min() if expectation.how == "MIN" else values.sum()
    )
    return float(np.copysign(value, expectation.theirs)) if expectation.unsigned else value


def _quantities(
    wanted: Iterable[Expectation], fields: list[_Fields], finer: tuple[FinerValues, int] | None
) -> Iterator[ComparedQuantity]:
    """What both have, field by field, of which a quantity is the value that is largest in theirs."""
    groups: dict[str, list[Expectation]] = {}
    for expectation in wanted:
        word = "contact pressure" if expectation.component == "LAGS_C" else FIELDS[expectation.field]
        groups.setdefault("sum of nodal forces" if expectation.how == "SOMM" else word, []).append(expectation)
    for word, members in groups.items():
        rows: list[tuple[Expectation, float, float, float]] = []
        for expectation in members:
            field = fields[expectation.instant]
            values = field.values(expectation)
            if values is not None and values.size:
                rows.append((expectation, _combined(values, expectation), field.size(expectation), expectation.theirs))
        if not rows:
            continue
        largest, ours, _, theirs = max(rows, key=lambda row: abs(row[3]))
        field_size = max(row[2] for row in rows)
        scale = abs(theirs) if abs(theirs) > DIGITS_OF_FILES * field_size else field_size or 1.0
        difference = max(abs(row[1] - row[3]) for row in rows) / scale
        label = f"{word}, {largest.component} at {largest.where}"
        of_finer = None
        if finer is not None:
            shares = list(_shares(rows, *finer))
            if shares:
                of_finer = max(s[0] for s in shares) / scale, max(s[1] for s in shares) / scale
        yield ComparedQuantity(label, theirs, ours, difference, largest.exact, of_finer)


def _shares(
    rows: list[tuple[Expectation, float, float, float]], finer: FinerValues, last: int
) -> Iterator[tuple[float, float]]:
    """How far theirs and ours are from our solution on a finer mesh at the last instant."""
    for expectation, ours, _, theirs in rows:
        values = _finer_values(expectation, finer)
        if expectation.instant == last and values is not None and values.size and np.isfinite(values).all():
            value = _combined(values, expectation)
            yield abs(theirs - value), abs(ours - value)


def _finer_values(expectation: Expectation, finer: FinerValues) -> Floats | None:
    """Those on a finer mesh at the nodes of an expectation; None: there are none."""
    tables = {"DEPL": finer.displacement, "SIEF_NOEU": finer.stress, "SIGM_NOEU": finer.stress}
    column = next(
        (words.index(expectation.component) for words in (_AXES, _STRESSES) if expectation.component in words), 0
    )
    table = finer.pressure if expectation.component == "LAGS_C" else tables.get(expectation.field)
    numbers = [int(node) + 1 for node in expectation.nodes]
    if table is None or not table.keys() >= set(numbers):
        return None
    values = np.array([table[number][column] for number in numbers])
    if expectation.component == "LAGS_C":
        values = -np.where(np.isnan(values), 0.0, values)
        return values[np.isfinite(values)] if expectation.how in ("MAX", "MIN") else values
    return values


def _prefixed(case: GauntletCase, prefix: str) -> GauntletCase:
    quantities = tuple(replace(quantity, name=f"{prefix}{quantity.name}") for quantity in case.quantities)
    reasons = tuple(f"{prefix}{reason}" for reason in case.reasons)
    return replace(case, quantities=quantities, reasons=reasons, why=f"{prefix}{case.why}" if case.why else "")


def _together(case: GauntletCase, parts: list[GauntletCase]) -> GauntletCase:
    """The results of a file in one case, whose state is the worst of those that are statics of elastic bodies."""
    state = max((part.state for part in parts if part.state in _WORSE), key=_WORSE.index, default=OTHER_KIND)
    return replace(
        case,
        state=state,
        why="; ".join(dict.fromkeys(part.why for part in parts if part.why)),
        quantities=tuple(quantity for part in parts for quantity in part.quantities),
        reasons=tuple(reason for part in parts for reason in part.reasons),
    )
