"""What a quantity says of itself."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Protocol

from signorini_fx.machine.terminal import TerminalLine
from signorini_fx.mechanics.statement.units import with_unit
from signorini_fx.quantities.digits import figure
from signorini_fx.quantities.kinds import Number
from signorini_fx.quantities.text import digits, row

if TYPE_CHECKING:
    from signorini_fx.mechanics.model import Model
    from signorini_fx.quantities.functional import Functional
    from signorini_fx.quantities.proved_statements import Interval

# Figures of a summary.
Summary = dict[str, Any]
# It grows when a key of a summary goes or changes its meaning, not when one is added.
SCHEMA_VERSION = 1


@dataclass(frozen=True)
class Card:
    """A figure that the report shows large.

    Attributes:
        label: what it is.
        text: its value, with its unit.
        error: its estimated relative error; None: it is not known.
        remark: what it does not say; "": nothing.
        wide: whether it takes two columns, as vectors do.
    """

    label: str
    text: str
    error: float | None = None
    remark: str = ""
    wide: bool = False


class Quantity(Protocol):
    """A result of a solve: a class with this as its base sets ``key`` and ``title`` and has the method ``value``.

    Attributes:
        key: its name in summary.json.
        title: what it is, in words, as the schema and the documentation say it.
        unit: what it is measured in, a word of ``units.names_of`` such as ``force``; "": it has no unit, or several.
        kind: the type of its value in summary.json.
        scope: which solutions have it.
        stage: when it is computed: with the results, with the fields, or after the results stand, so that its failure
            is a warning, as one that another package adds always is; never: its derivative or a column of the load
            steps is all there is.
        terminal: what ``solve`` prints before its value; "": nothing is printed.
        report: the label of its card in the report; "": it has none.
        steps: whether steps.csv has it as a number, or as several columns by axis and boundary.
        first: whether the terminal shows it before what was done.
        brief: whether the short answer has its lines.
        request: how its derivative and its bounds are asked for; "": by its key.
    """

    key: str
    title: str
    unit: str = ""
    kind: Any = Number
    scope: Literal["all", "contact", "some"] = "some"
    stage: Literal["results", "fields", "afterwards", "never"] = "afterwards"
    terminal: str = ""
    report: str = ""
    steps: Literal["", "number", "components"] = ""
    first: bool = False
    brief: bool = False
    request: str = ""

    def value(self, solution: Any) -> Any:
        """Its value, as JSON has it; None: this solution has none; collective.

        Args:
            solution: a ``Solution``, of a load step if there are several.
        """
        return None

    def entries(self, solution: Any) -> dict[str, Any]:
        """What it adds to the summary, one that another package adds under its own key; collective."""
        value = self.value(solution)
        return {} if value is None else {self.key: value}

    def missed(self, value: Any) -> str:
        """What a reader of its value must know first, such as that an accuracy was missed; "": nothing."""
        return ""

    def asked(self, solution: Any) -> bool:
        """Whether the scene asks for it."""
        return True

    def columns(self, solution: Any) -> dict[str, Any]:
        """Its entries in a row of steps.csv; collective."""
        return self.entries(solution)

    def error(self, summary: Summary) -> float | None:
        """Its estimated error, relative to its size; None: there is no estimate."""
        return None

    def lines(self, summary: Summary) -> list[TerminalLine]:
        """What ``solve`` prints of it."""
        if not self.terminal or summary.get(self.key) is None:
            return []
        return [row(self.terminal, digits(summary[self.key], self.error(summary)))]

    def cards(self, summary: Summary) -> list[Card]:
        """What the report shows large."""
        if not self.report or summary.get(self.key) is None:
            return []
        error = self.error(summary)
        return [Card(self.report, with_unit(figure(summary[self.key], error), self.unit), error)]

    def functional(self, model: Model, *words: str) -> Functional | None:
        """It with its derivatives by displacement and tractions; None: it has none; collective.

        Args:
            model: the model.
            words: what stands behind the first word of the request.

        Raises:
            ValueError: the words do not fit.
        """
        return None

    def bounds(self, solution: Any, *words: str) -> Interval | str | None:
        """Guaranteed bounds, or why there are none; None: nobody knows any; collective.

        Args:
            solution: a ``Solution``.
            words: what stands behind the first word of the request.

        Raises:
            ValueError: the words do not fit.
        """
        return None
