"""An input file of CalculiX beside what it has printed: the scene that the file becomes, solved, and compared.

Differences are explained by runs: is their result in equilibrium, and in which element formulation (``judge``); by how
much does ours move when all sides of its cells are halved, and whose is nearer to that.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded
import numpy as np

from signorini_fx.addons.decks.content import Deck
from signorini_fx.addons.decks.draft import Draft, draft
from signorini_fx.addons.decks.keywords import OTHER_PROCEDURE, RULES
from signorini_fx.addons.decks.node_results import NodeResults, at_nodes
from signorini_fx.addons.decks.tables import dat
from signorini_fx.addons.gauntlet.compared_tables import Tables, compared, compared_displacements, with_exact
from signorini_fx.addons.gauntlet.finer import finer_values
from signorini_fx.addons.gauntlet.outcomes import (
    LOST,
    OTHER_KIND,
    REFUSED,
    WHOLE,
    ComparedQuantity,
    GauntletCase,
    in_short,
)
from signorini_fx.addons.gauntlet.printed_tables import by_time, last_tables, read_tables
from signorini_fx.addons.gauntlet.solved_drafts import SolvedDraft, solved_draft, without_folders
from signorini_fx.addons.gauntlet.sources import PRINTED, PROGRAM
from signorini_fx.addons.judging.calculix_results import NodeTables, read_frd
from signorini_fx.addons.judging.judge import judge
from signorini_fx.errors import MeshError, SignoriniError
from signorini_fx.mechanics.mesh.files.abaqus import read_keywords
from signorini_fx.mechanics.mesh.files.abaqus_blocks import DeckBlock
from signorini_fx.mechanics.mesh.files.arrays import plain
from signorini_fx.mechanics.mesh.files.shape import Floats
from signorini_fx.tuned import EXPLAINED_FROM, JUDGED_SAME_TIME

# Keywords of steps that are none of a scene.
_PROCEDURES = {rule.key for rule in RULES if rule.effect == OTHER_PROCEDURE}


@dataclass
class DeckRun:
    """A case that runs.

    Attributes:
        deck: the input file.
        out: a folder for what it writes.
        tell: is called with what is known so far.
    """

    deck: Path
    out: Path
    tell: Callable[[GauntletCase], None]

    def outcome(self) -> GauntletCase:
        """Run it, and say what it has come to."""
        case, target = GauntletCase(self.deck.stem, PROGRAM, REFUSED), self.out / f"{self.deck.stem}.toml"
        try:
            if (block := _other_procedure(self.deck)) is not None:
                return replace(case, state=OTHER_KIND, why=f"{block.origin}: {OTHER_PROCEDURE}")
            drafted = draft(self.deck, target)
        except SignoriniError as error:
            return replace(case, why=self._without_folder(str(error)))
        lost = list(drafted.lost)
        if not drafted.deck.apart:
            self.tell(replace(case, state=LOST if lost else WHOLE, why=in_short(lost)))
        solved = solved_draft(case, drafted, target, self._without_folder, self.deck)
        if isinstance(solved, GauntletCase):
            return solved
        case = replace(case, state=LOST if solved.lost else WHOLE, why=in_short(solved.lost))
        self.tell(case)
        try:
            return self._compared(case, drafted, solved)
        except MeshError as error:
            message = f"what stands beside it cannot be read: {self._without_folder(str(error))}"
            return replace(case, state=REFUSED, why=in_short([message, *solved.lost]))

    def _without_folder(self, text: str) -> str:
        """A message without the folder of the deck, which differs between machines."""
        return without_folders(text, self.deck.parent)

    def _compared(self, case: GauntletCase, drafted: Draft, solved: SolvedDraft) -> GauntletCase:
        deck = drafted.deck
        moments = [moment for moment in at_nodes(solved.solution, deck) if moment is not None]
        if not moments:
            return replace(case, why=in_short([*filter(None, [case.why]), "our solution has other nodes"]))
        if len(moments) == 1:
            moments *= max(1, len(deck.steps))
        ours = by_time(read_tables("".join(dat(deck, moments)), "ours"))
        printed, fields = (self.deck.with_suffix(suffix) for suffix in PRINTED)
        theirs: Tables = last_tables(printed) if printed.exists() else {}
        case = replace(case, quantities=tuple(self._quantities(theirs, ours, fields, deck, moments[-1])))
        self.tell(case)
        if (case.difference or 0.0) <= EXPLAINED_FROM:
            return case
        case = replace(case, reasons=tuple(self._verdicts(printed, fields)))
        self.tell(case)
        finer = finer_values(solved, deck)
        if finer is None:
            return case
        quantities = self._quantities(theirs, ours, fields, deck, moments[-1], finer.displacement)
        return replace(case, quantities=tuple(quantities)).told_by_finer()

    def _quantities(
        self,
        theirs: Tables,
        ours: Tables,
        fields: Path,
        deck: Deck,
        last: NodeResults,
        finer: Mapping[int, Floats] | None = None,
    ) -> Iterator[ComparedQuantity]:
        by_number: dict[int, Floats] = dict(zip(plain(deck.names), last.displacement, strict=True))
        quantities = list(compared(theirs, ours, finer))
        of_file: dict[int, Floats] = {}
        table: NodeTables | None = None
        if not any(quantity.name.startswith("displacement") for quantity in quantities) and fields.exists():
            with suppress(MeshError):  # it has other fields, or none
                table = read_frd(fields)
            if table is not None and (table.time is None or np.isclose(table.time, _end(deck), rtol=JUDGED_SAME_TIME)):
                of_file = {node: np.array(values) for node, (values, _) in table.displacement.items()}
                quantities[:0] = compared_displacements(of_file, by_number, finer)
        yield from quantities
        exact = self.deck.with_name(f"{self.deck.stem}.exact.csv")
        if exact.exists():
            for (title, _), tables in theirs.items():
                if title == "displacements":
                    of_file |= {node: np.array(values) for node, values in tables[-1].rows.items()}
            yield from with_exact(exact, of_file, by_number)

    def _verdicts(self, printed: Path, fields: Path) -> Iterator[str]:
        """What ``judge`` says of their result; nothing where it does not say what all nodes do."""
        for file, suffix in ((fields, ".frd"), (printed, ".dat")):
            if not file.exists():
                continue
            copy = self.out / f"theirs{suffix}"
            shutil.copyfile(file, copy)
            try:
                verdict = judge(self.deck, copy, compare=False)
            except SignoriniError:
                continue
            if verdict.findings and verdict.findings[0].key == "judged":
                continue
            formulation = verdict.theirs.get("formulation")
            verdict_words = f"{verdict.word}: {verdict.findings[0].text}" if verdict.findings else verdict.word
            yield f"judge says of theirs: {verdict_words}" + (f" ({formulation})" if formulation else "")
            return


def _other_procedure(deck: Path) -> DeckBlock | None:
    """The first keyword of a step that is not static; None: all are."""
    return next((block for block in read_keywords(deck) if block.keyword in _PROCEDURES), None)


def _end(deck: Deck) -> float:
    """The time at which the last step of a deck ends."""
    return max(deck.ends.values(), default=1.0)
