"""What of a deck or a command file its solution has lost: what can be said with the solution only."""

from __future__ import annotations

from dataclasses import dataclass, replace

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded
import numpy as np
import numpy.typing as npt

from signorini_fx.addons.aster.study import CaseStudy
from signorini_fx.addons.decks.draft import Draft
from signorini_fx.addons.decks.kept_partners import judged_partners
from signorini_fx.addons.decks.rotations import judged_rotations
from signorini_fx.machine import parallel
from signorini_fx.results.solution import Solution
from signorini_fx.tuned import DIGITS_OF_FILES, LINEAR_IN_DECK


def graded_solution(solution: Solution, draft: Draft | None) -> Solution:
    """The solution with what it lacks of the file that its scene was drafted from, as far as it says that itself: large
    rotations where a deck asks for them, contact that follows surfaces or does not open again; collective.

    Args:
        solution: of the scene that was drafted.
        draft: on the first rank; None on the others.
    """
    solution = judged_rotations(solution, None if draft is None else draft.deck)
    solution = judged_partners(solution, draft)
    promise = parallel.on_root(solution.comm, lambda: _ContactPromise.of(getattr(draft, "study", None)))
    if not solution.converged or promise is None:
        return solution
    remarks = [*_slips_too_far(solution, promise), *_opens_again(solution, promise)]
    if not remarks:
        return solution
    incomplete = (*solution.statement.incomplete, *remarks)
    model = replace(solution.model, statement=replace(solution.statement, incomplete=incomplete))
    return replace(solution, model=model)


@dataclass(frozen=True)
class _ContactPromise:
    """What a case says of contact that depends on the motion.

    Attributes:
        follows: what says that contact follows the surfaces; "": it does not.
        length: of the shortest surface.
        curvature: the largest one of a surface, 1 / length.
        stays: commands by which contact does not open again.
    """

    follows: str
    length: float
    curvature: float
    stays: tuple[str, ...]

    @classmethod
    def of(cls, study: CaseStudy | None) -> _ContactPromise | None:
        """That of a case; None: it has no contact of that kind."""
        if study is None or not study.zones or not (study.follows or study.stays):
            return None
        sides = [marks for zone in study.zones for marks in (zone.slave, zone.master)]
        length, curvature = min(map(study.mesh.extent, sides)), max(map(study.mesh.curvature, sides))
        return cls(study.follows, float(length), float(curvature), tuple(study.stays))


def _slips_too_far(solution: Solution, promise: _ContactPromise) -> list[str]:
    """What is lost where surfaces slide so far that others touch, by a share of their length, or along a curve so that
    their distance changes: a slip s on a surface of curvature k leaves the tangent by k s^2 / 2, which is compared with
    the largest displacement.
    """
    if not promise.follows:
        return []
    slip, size = 0.0, 0.0
    for step in solution.shown_steps:
        moment = solution.at(step)
        size = max(size, parallel.global_max(moment.comm, float(np.abs(moment.displacement.x.array).max(initial=0.0))))
        slip = max(slip, _largest_slip(moment))
    away = promise.curvature * slip**2 / 2
    message = f"{promise.follows}: contact does not follow surfaces that slide by {slip:.2g}"
    if slip > LINEAR_IN_DECK * promise.length:
        return [f"{message}, {100 * slip / promise.length:.2g} % of their length"]
    if size and away > LINEAR_IN_DECK * size:
        return [f"{message}: their distance changes by {100 * away / size:.2g} % of the displacement"]
    return []


def _largest_slip(moment: Solution) -> float:
    """Of the points that touch."""
    if moment.contact is None:
        return 0.0
    columns = moment.table.columns
    names = [name for name in columns if name == "u_t" or name.startswith("u_t_")]
    slips = np.column_stack([columns[name] for name in names])[_touching(moment)]
    return float(np.linalg.norm(slips, axis=1).max(initial=0.0))


def _touching(moment: Solution) -> npt.NDArray[np.bool_]:
    return np.asarray(moment.table.columns["state"]) != "open"


def _opens_again(solution: Solution, promise: _ContactPromise) -> list[str]:
    """What is lost where contact of the solution opens that was closed, from the beginning or in an earlier step."""
    if not promise.stays or solution.contact is None:
        return []
    size = promise.length * DIGITS_OF_FILES
    closed = np.asarray(solution.table.columns["gap"]) <= size
    opened = np.zeros_like(closed)
    for step in solution.shown_steps:
        touching = _touching(solution.at(step))
        opened |= closed & ~touching
        closed |= touching
    count = int(np.count_nonzero(opened))
    return [f"{origin}: {count} points open again, which is another contact" for origin in promise.stays if count]
