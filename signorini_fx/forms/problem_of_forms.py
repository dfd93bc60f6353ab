"""What the problems of forms have in common for those who look at their results."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from signorini_fx.extensions import add_on
from signorini_fx.forms.solver import FormSolver
from signorini_fx.machine import parallel
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.records import History

if TYPE_CHECKING:
    from signorini_fx.results.solution import Solution


class ProblemOfForms:
    """A problem with the results of a ``Solution``."""

    assembled: FormSolver

    def __repr__(self) -> str:
        dofmap = self.assembled.space.dofmap
        unknowns = dofmap.index_map.size_global * dofmap.index_map_bs
        status = self.assembled.status
        return (
            f"<{type(self).__name__}: {unknowns} unknowns, {'not solved so far' if status is None else status.value}>"
        )

    @property
    def bcs(self) -> Any:
        """The Dirichlet conditions; the list may change between two solves."""
        return self.assembled.bcs

    @bcs.setter
    def bcs(self, bcs: Any) -> None:
        self.assembled.bcs = bcs

    @property
    def history(self) -> History:
        """Every linear solve of all solves so far."""
        return self.assembled.history

    @property
    def state(self) -> ContactState:
        """The contact points of this rank after the last solve, with forces and areas of the undeformed boundary."""
        return self.assembled.state

    def titled(self, title: str) -> Solution:
        """``solution`` with a title; collective.

        Raises:
            RuntimeError: there is none so far.
        """
        raise NotImplementedError

    @property
    def solution(self) -> Solution:
        """The last solution, or of a ``ContactProblem`` the last iterate, with the values that the forms have now;
        after ``run`` with all load steps; collective.

        Raises:
            RuntimeError: there is none so far.
        """
        return self.titled("")

    def write(
        self,
        folder: str | Path,
        *,
        title: str = "",
        fields: bool = True,
        pictures: bool | Sequence[str] = True,
        pdf: bool = False,
        report: bool = False,
    ) -> dict[str, Any]:
        """Write the result folder of the last solution, as that of a scene; collective.

        Args:
            folder: made if it does not exist.
            title: any text.
            fields: see ``write_results``.
            pictures: see ``write_results``.
            pdf: see ``write_results``.
            report: whether to write ``report.html``, too.

        Returns:
            The summary.

        Raises:
            OutputError: see ``write_results``.
            RuntimeError: there is no solution so far.
        """
        from signorini_fx.results.files import write_results

        solution = self.titled(title)
        summary = write_results(solution, folder, fields=fields, pictures=pictures, pdf=pdf)
        if report:
            parallel.on_root(solution.comm, lambda: add_on("report")(folder))
        return summary
