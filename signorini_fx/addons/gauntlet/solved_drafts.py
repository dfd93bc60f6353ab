"""The scene of a draft, solved: what the cases of all programs have in common."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded
from mpi4py import MPI

from signorini_fx.addons.aster.draft import StudyDraft
from signorini_fx.addons.aster.grades import graded_solution
from signorini_fx.addons.decks.draft import Draft, finite_draft
from signorini_fx.addons.decks.rotations import lacks_finite_strains
from signorini_fx.addons.gauntlet.outcomes import LOST, UNSOLVED, GauntletCase, in_short
from signorini_fx.errors import MeshError, SceneError
from signorini_fx.results.solution import ConvergenceError, Solution
from signorini_fx.scenes.reading import read_scene
from signorini_fx.scenes.solver import solves


@dataclass(frozen=True)
class SolvedDraft:
    """A draft whose scene has a solution.

    Attributes:
        solution: ours, on this rank.
        lost: what it has lost of the draft, in words.
        solve: solves it with other entries, such as ``mesh``.
    """

    solution: Solution
    lost: list[str]
    solve: Callable[..., Solution]


def solved_draft(
    case: GauntletCase, drafted: Draft, file: Path, plainly: Callable[[str], str], deck: Path | None = None
) -> SolvedDraft | GauntletCase:
    """The scene and its solution; or the row of a case that has none.

    Where small displacements are not enough for a deck with NLGEOM, it is drafted and solved with finite strains.

    Args:
        case: refused, without a reason.
        drafted: the draft; its files are written.
        file: of the scene.
        plainly: takes what differs between machines out of a message.
        deck: the input file that it is from, which may be drafted anew; None: it is from another kind of file.
    """
    if drafted.deck.apart:
        return replace(case, state=LOST, why=in_short(drafted.lost))
    solved = _solved(case, drafted, file, plainly)
    if deck is None or isinstance(solved, GauntletCase) or not lacks_finite_strains(solved.solution):
        return solved
    finite = finite_draft(deck, file)
    if finite is None:
        return solved
    with_finite = _solved(case, finite, file, plainly)
    if not isinstance(with_finite, GauntletCase):
        return with_finite
    for path in finite.files:
        path.unlink()
    _write(drafted)
    return solved


def _write(drafted: Draft) -> None:
    """Write the files of a draft."""
    for path, text in drafted.files.items():
        path.write_text(text, encoding="utf-8")


def _solved(
    case: GauntletCase, drafted: Draft, file: Path, plainly: Callable[[str], str]
) -> SolvedDraft | GauntletCase:
    """See ``solved_draft``; of one draft."""
    lost = list(drafted.lost)
    _write(drafted)
    try:
        solve = solves(read_scene(file), MPI.COMM_SELF)
        solution = solve()
    except (SceneError, MeshError) as error:
        return replace(case, why=in_short([plainly(str(error)), *lost]))
    except ConvergenceError as error:
        return replace(case, state=UNSOLVED, why=in_short([str(error), *lost]))
    if not solution.converged:
        return replace(case, state=UNSOLVED, why=in_short([solution.status.value, *lost]))
    graded = graded_solution(solution, drafted)
    further = graded.statement.incomplete[len(solution.statement.incomplete) :]
    at_case = drafted.at_case if isinstance(drafted, StudyDraft) else str
    return SolvedDraft(graded, [*lost, *map(at_case, further)], solve)


def without_folders(text: str, *folders: Path) -> str:
    """A message on one line without the names of folders, which differ between machines."""
    for folder in folders:
        text = text.replace(f"{folder}/", "")
    return text.replace("\n", "; ")
