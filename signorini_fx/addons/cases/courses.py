"""What processes of a case hold and load in the course of time.  No dolfinx here."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from signorini_fx.addons.cases.located_json import JsonObject
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints
from signorini_fx.mechanics.statement.expressions import Expression
from signorini_fx.tuned import COURSE_MISSED


class Course:
    """Prescribed displacements of nodes, and loads, at each instant; what acts later in a list replaces the earlier.

    Attributes:
        instants: the times.
    """

    def __init__(self, instants: Sequence[float], dim: int, nodes: int) -> None:
        self.instants = list(instants)
        self._held = np.full((dim, len(self.instants), nodes), np.nan)
        self._origins = np.zeros((dim, nodes), dtype=np.int64)
        self._names: list[str] = [""]
        self._loads: dict[tuple[str, str], tuple[Floats, str]] = {}

    def _acts(self, interval: tuple[float, float]) -> list[int]:
        """The instants within an interval of time."""
        begin, end = interval
        near = COURSE_MISSED * max(1.0, *map(abs, self.instants))
        return [n for n, time in enumerate(self.instants) if begin - near <= time <= end + near]

    def hold(
        self,
        parameters: JsonObject,
        origin: str,
        component: int,
        rows: Ints,
        value: Any,
        points: Floats,
        interval: tuple[float, float],
    ) -> None:
        """Prescribe a component of nodes within an interval of time.

        Args:
            parameters: where the value is from, for errors.
            origin: the process.
            component: 0 to 2.
            rows: of the nodes.
            value: a number, or a function of t, x, y and z.
            points: positions of the nodes, shape (n, 3).
            interval: of time.

        Raises:
            JsonError: the value is none.
        """
        self._names.append(origin)
        self._origins[component, rows] = len(self._names) - 1
        for n in self._acts(interval):
            self._held[component, n, rows] = evaluated(parameters, value, self.instants[n], points)

    def load(
        self,
        parameters: JsonObject,
        origin: str,
        key: tuple[str, str],
        component: int,
        value: Any,
        interval: tuple[float, float],
    ) -> None:
        """Load something within an interval of time; the load stays as it was after it.

        Raises:
            JsonError: the value is none, or depends on the place.
        """
        values, first = self._loads.setdefault(key, (np.zeros((len(self.instants), 3)), origin))
        self._loads[key] = values, first
        for n in self._acts(interval):
            places = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]])
            at_both = evaluated(parameters, value, self.instants[n], places)
            if at_both[0] != at_both[1]:
                raise parameters.error("a load that depends on the place is not known here")
            values[n:, component] = at_both[0]

    def supports(self) -> Iterator[tuple[int, Ints, list[float | Floats | None], str]]:
        """Component, nodes, values at each instant and origin of what holds the same nodes at the same times."""
        for component, (held, origins) in enumerate(zip(self._held, self._origins, strict=True)):
            acting = np.isfinite(held)
            rows = np.flatnonzero(acting.any(axis=0))
            patterns = np.vstack((origins[rows], acting[:, rows])).T
            kinds, group = np.unique(patterns, axis=0, return_inverse=True)
            for number, kind in enumerate(kinds):
                nodes = rows[group.ravel() == number].astype(np.int64)
                values: list[float | Floats | None] = []
                table: Floats = held[:, nodes]
                alike = bool((table == table[:, :1])[kind[1:].astype(bool)].all())
                for n, acts in enumerate(kind[1:]):
                    values.append(None if not acts else float(table[n, 0]) if alike else np.asarray(table[n]))
                yield component, nodes, values, self._names[kind[0]]

    def loads(self) -> Iterator[tuple[tuple[str, str], Floats, str]]:
        """What is loaded, its components at each instant, shape (instants, 3), and the origin; nothing of what is
        zero.
        """
        for key, (values, origin) in self._loads.items():
            if values.any():
                yield key, values, origin


def evaluated(parameters: JsonObject, value: Any, time: float, points: Floats) -> Floats:
    """A number, or a function of t, x, y and z, at a time and points of shape (n, 3).

    Raises:
        JsonError: it is neither, or not finite there.
    """
    if isinstance(value, int | float) and not isinstance(value, bool):
        values: Floats = np.full(len(points), float(value))
    elif isinstance(value, str):
        text = re.sub(r"\b([xyzXYZ])\b", lambda match: f"x[{'xyz'.index(match[1].lower())}]", value).replace("^", "**")
        try:
            values = Expression(text, allows_time=True).at(time)(points.T)
        except (ValueError, TypeError) as error:
            raise parameters.error(str(error)) from None
    else:
        raise parameters.error(f"a number or a function is expected, not {value!r}")
    if not np.isfinite(values).all():
        raise parameters.error(f"{value!r} is not finite at the time {time:g}")
    return values
