"""What a ``ContactProblem`` says of its last solution, as a scene's ``Solution`` does."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from signorini_fx import parallel
from signorini_fx.extensions import add_on
from signorini_fx.forms.parts import ProblemParts

if TYPE_CHECKING:
    from collections.abc import Sequence

    from signorini_fx.body.contact_table import ContactTable
    from signorini_fx.forms.solution import FormSolution
    from signorini_fx.quantities.statements import ErrorBound, Interval, Uniqueness


class SolvedProblem(ProblemParts):
    """Results of a problem that has been solved, with the values that its forms have now; all are collective."""

    @property
    def solution(self) -> FormSolution:
        """The last solution, or the last iterate; after ``run`` with all load steps.

        Raises:
            RuntimeError: there is none so far.
        """
        return self._titled("")

    def _titled(self, title: str) -> FormSolution:
        from signorini_fx.forms.solution import solution_of

        return solution_of(self, title)

    @property
    def error_bound(self) -> ErrorBound | str | None:
        """A guaranteed bound of the error, or why there is none, see ``Solution``; it needs ``stress``."""
        return self.solution.error_bound

    @property
    def uniqueness(self) -> Uniqueness | None:
        """Whether the solution is the only one on its mesh, see ``Solution``."""
        return self.solution.uniqueness

    def bounds(self, text: str) -> Interval | str:
        """Guaranteed bounds of a quantity, or why there are none, see ``Solution``.

        Args:
            text: such as ``force BOUNDARY AXIS``, with a name of ``boundaries``.

        Raises:
            SceneError: it is not known, or has no bounds.
        """
        return self.solution.bounds(text)

    def table(self) -> ContactTable:
        """The contact boundary of all ranks, the same on each: positions, gaps, displacements, pressures,
        shears, slips, and the states as words.

        Raises:
            RuntimeError: there is no solution so far.
        """
        return self.solution.table

    def plot(self, *fields: str) -> Any:
        """Pictures that a notebook displays: the deformed body, the contact boundary and the iteration.

        Args:
            fields: to draw on the body beside the von Mises stress: ``pressure``, ``principal``, ``displacement`` or
                ``density``.

        Raises:
            ValueError: there is no such field.
            RuntimeError: there is no solution so far.
            PictureError: the pictures cannot be drawn.
        """
        return self.solution.plot(*fields)

    def write(
        self,
        folder: str | Path,
        *,
        title: str = "",
        fields: bool | str = True,
        pictures: bool | Sequence[str] = True,
        pdf: bool = False,
        report: bool = False,
    ) -> dict[str, Any]:
        """Write the result folder of the last solution, as that of a scene.

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

        solution = self._titled(title)
        summary = write_results(solution, folder, fields=fields, pictures=pictures, pdf=pdf)
        if report:
            parallel.on_root(solution.comm, lambda: add_on("report")(folder))
        return summary
