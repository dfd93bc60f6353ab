"""A case of another program that becomes a row of the table: drafted as a scene, solved, and compared.

What is read and what is compared differs between programs; the way, and what is said where it ends early, does not.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import ClassVar, Generic, TypeVar

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded

from signorini_fx.addons.aster.draft import StudyDraft, draft_study
from signorini_fx.addons.aster.study import CaseStudy
from signorini_fx.addons.decks.node_results import NodeResults, at_nodes
from signorini_fx.addons.gauntlet.outcomes import LOST, REFUSED, WHOLE, GauntletCase, in_short
from signorini_fx.addons.gauntlet.solved_drafts import SolvedDraft, solved_draft, without_folders
from signorini_fx.addons.gauntlet.sources import name_of
from signorini_fx.errors import MeshError, SignoriniError

D = TypeVar("D", bound=StudyDraft)
S = TypeVar("S", bound=CaseStudy)


@dataclass
class CaseRun(ABC):
    """A case that runs.

    Attributes:
        file: the file that says what the case is.
        out: a folder for what it writes.
        tell: is called with what is known so far.
    """

    file: Path
    out: Path
    tell: Callable[[GauntletCase], None]

    @abstractmethod
    def outcome(self) -> GauntletCase:
        """Run it, and say what it has come to."""

    def solved_row(
        self,
        case: GauntletCase,
        name: str,
        draft: Callable[[Path], D],
        compared: Callable[[GauntletCase, D, list[NodeResults], SolvedDraft], GauntletCase],
        *,
        tells: bool = True,
    ) -> GauntletCase:
        """What the case has come to.

        Args:
            case: refused, without a reason.
            name: of the file of the scene, without its ending.
            draft: makes the draft of a scene that will be in a file.
            compared: makes the row of a case that is solved, with our results at the nodes for each instant.
            tells: whether the row of a case that is solved is told before values are compared.
        """
        target = self.out / f"{name}.toml"
        try:
            drafted = draft(target)
        except SignoriniError as error:
            return replace(case, why=self.without_folders(str(error)))
        solved = solved_draft(case, drafted, target, self.without_folders)
        if isinstance(solved, GauntletCase):
            return solved
        case = replace(case, state=LOST if solved.lost else WHOLE, why=in_short(solved.lost))
        if tells:
            self.tell(case)
        try:
            moments = [moment for moment in at_nodes(solved.solution, drafted.deck) if moment is not None]
            if not moments:
                return replace(case, why=in_short([*filter(None, [case.why]), "our solution has other nodes"]))
            if len(moments) == 1:
                moments *= len(drafted.study.instants)
            return compared(case, drafted, moments, solved)
        except MeshError as error:
            return replace(case, state=REFUSED, why=in_short([self.without_folders(str(error)), *solved.lost]))

    def without_folders(self, text: str) -> str:
        """A message without the folders of the case, which differ between machines."""
        return without_folders(text, self.file.parent, self.out)


class StudyRun(CaseRun, Generic[S]):
    """A case that is one problem.

    Attributes:
        program: whose case it is, of ``sources``.
    """

    program: ClassVar[str]

    def outcome(self) -> GauntletCase:
        """See ``CaseRun``."""
        case, name = GauntletCase(name_of(self.file), self.program, REFUSED), self.file.stem
        try:
            study = self.read()
        except SignoriniError as error:
            return replace(case, why=self.without_folders(str(error)))

        def draft(target: Path) -> StudyDraft:
            return draft_study(study, self.file, target, name)

        return self.solved_row(case, name, draft, partial(self.compared, study))

    @abstractmethod
    def read(self) -> S:
        """The problem of the case.

        Raises:
            SignoriniError: it cannot be read.
        """

    @abstractmethod
    def compared(
        self,
        study: S,
        case: GauntletCase,
        drafted: StudyDraft,
        moments: list[NodeResults],
        solved: SolvedDraft,
    ) -> GauntletCase:
        """The row of the case with the values that the other program has, see ``CaseRun.solved_row``.

        Raises:
            MeshError: a file of values is not as it should be.
        """
