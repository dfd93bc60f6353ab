"""Problems as they stand in ``problems/*.toml``: what the keys are, and what a file may not miss."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

from benchmarks.contactbench.expressions import COORDINATES, ExpressionError, evaluate, names

FOLDER = Path(__file__).parent / "problems"
Formula = str | float
HYPOTHESES = {"plane strain": 2, "plane stress": 2, "axisymmetric": 2, "space": 3}
LAWS = {"none": set[str](), "tresca": {"bound"}, "coulomb": {"coefficient"}}
SHAPES = {"rectangle": ("x", "y"), "annulus": ("radius", "angle"), "box": ("x", "y", "z")}
SIDES = {
    "rectangle": ("left", "right", "bottom", "top"),
    "annulus": ("inner", "outer", "start", "end"),
    "box": ("left", "right", "front", "back", "bottom", "top"),
}
MEASURES = {
    "normal force": set[str](),
    "friction force": {"axis"},
    "pressure at": {"point"},
    "largest pressure": set[str](),
    "pressure moment": {"axis"},
    "pressure mean square": {"axis"},
    "displacement": {"point", "axis"},
    "strain energy": set[str](),
}
ON_BOUNDARY = {"normal force", "friction force", "pressure at", "largest pressure", "pressure moment"}
ON_BOUNDARY |= {"pressure mean square"}
REFERENCES = ("exact", "interval", "values")


class ProblemError(ValueError):
    """A problem file that is not complete: file, key, and what is wrong."""


@dataclass(frozen=True)
class Body:
    """A body: its shape with the lines of its mesh, the names of its sides, and its material.

    Attributes:
        name: of the body.
        young: Young's modulus.
        poisson: Poisson's ratio.
        shape: a key of ``SHAPES``.
        lines: for each coordinate of the shape its segments: start, end, cells on the coarsest mesh, and the size of
            the last over that of the first cell.
        sides: name of each side, or of each of its segments; "" has no name.
        centre: of an annulus, whose angles are degrees from the x-axis.
        straight: whether the body is the polygon of the coarsest mesh, which finer meshes keep.
    """

    name: str
    young: float
    poisson: float
    shape: str
    lines: dict[str, list[tuple[float, float, int, float]]] = field(default_factory=dict)
    sides: dict[str, list[str]] = field(default_factory=dict)
    centre: tuple[float, float] = (0.0, 0.0)
    straight: bool = False

    @property
    def mu(self) -> float:
        """Shear modulus."""
        return self.young / (2 * (1 + self.poisson))


@dataclass(frozen=True)
class Support:
    """Prescribed displacements: of a boundary, or of the node at a point; components that are not named are free."""

    boundary: str
    at: tuple[Formula, ...]
    components: dict[int, Formula]


@dataclass(frozen=True)
class Traction:
    """A force per area on a boundary, by components."""

    boundary: str
    components: dict[int, Formula]


@dataclass(frozen=True)
class Contact:
    """A boundary that may touch a rigid foundation, or the boundary of another body.

    Attributes:
        boundary: its name.
        against: the boundary of the other body; "": a rigid foundation.
        gap: distance along ``direction`` before loading.
        direction: from the body to what it may touch, a unit vector of formulas of constants; empty: the outward normal
            of the body.
        law: "none", "tresca" or "coulomb".
        bound: largest shear with Tresca friction.
        coefficient: of Coulomb friction.
    """

    boundary: str
    against: str
    gap: Formula
    direction: tuple[Formula, ...]
    law: str
    bound: Formula
    coefficient: Formula


@dataclass(frozen=True)
class Quantity:
    """What is asked for, and its reference.

    Attributes:
        name: by which a result names it.
        measure: a key of ``MEASURES``.
        boundary: of the contact.
        point: where; a node of every mesh.
        axis: 0, 1 or 2.
        unit: such as "force / length".
        text: what it is in words, with its sign.
        kind: of the reference, one of ``REFERENCES``.
        numbers: the exact value; both ends of the interval; or two independent values.
        sources: where the numbers come from.
        formula: of the exact value; "" for the others.
        tolerance: largest error of a correct program on the coarsest mesh, relative to ``scale``.
        scale: what errors are relative to.
    """

    name: str
    measure: str
    boundary: str
    point: tuple[Formula, ...]
    axis: int
    unit: str
    text: str
    kind: str
    numbers: tuple[float, ...]
    sources: tuple[str, ...]
    formula: str
    tolerance: float
    scale: float


@dataclass(frozen=True)
class Problem:
    """A problem.

    Attributes:
        name: of the file.
        title: in one line.
        text: geometry, loads and supports in words.
        signs: sign conventions.
        units: of data and quantities.
        source: where it comes from.
        hypothesis: a key of ``HYPOTHESES``.
        constants: numbers and formulas of numbers.
        fields: formulas of positions.
        bodies: see ``Body``.
        supports: see ``Support``.
        tractions: see ``Traction``.
        contacts: see ``Contact``.
        quantities: see ``Quantity``.
    """

    name: str
    title: str
    text: str
    signs: str
    units: str
    source: str
    hypothesis: str
    constants: dict[str, Formula]
    fields: dict[str, str]
    bodies: tuple[Body, ...]
    supports: tuple[Support, ...]
    tractions: tuple[Traction, ...]
    contacts: tuple[Contact, ...]
    quantities: tuple[Quantity, ...]

    @property
    def dimension(self) -> int:
        """2 or 3."""
        return HYPOTHESES[self.hypothesis]

    @cached_property
    def numbers(self) -> dict[str, float]:
        """Values of the constants."""
        return {key: float(evaluate(key, self.constants)) for key in self.constants}

    def number(self, formula: Formula) -> float:
        """The value of a formula of constants."""
        return float(evaluate(formula, self.numbers))

    def at(self, formula: Formula, coordinates: Mapping[str, Any]) -> Any:
        """The value of a formula of positions.

        Args:
            formula: any formula of the file.
            coordinates: what x, y and z stand for.
        """
        return evaluate(formula, {**self.fields, **self.numbers, **coordinates})

    def quantity(self, name: str) -> Quantity:
        """A quantity by its name."""
        return next(quantity for quantity in self.quantities if quantity.name == name)


def problem_names() -> list[str]:
    """All problems, in the order of the alphabet."""
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


def read_problem(name: str | Path) -> Problem:
    """A problem by its name, or a file.

    Raises:
        ProblemError: there is none, or the file is not complete.
    """
    path = Path(name) if str(name).endswith(".toml") else FOLDER / f"{name}.toml"
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError:
        raise ProblemError(
            f"there is no problem {str(name)!r}: python3 -m benchmarks.contactbench list names them"
        ) from None
    except tomllib.TOMLDecodeError as error:
        raise ProblemError(f"{path.name}: {error}") from None
    return _Reader(path.name, data).problem(path.stem)


class _Table:
    """A table of the file that says which key is wrong."""

    def __init__(self, file: str, place: str, data: Any) -> None:
        self.file, self.place, self.data = file, place, dict(data) if isinstance(data, dict) else {}
        if not isinstance(data, dict):
            raise ProblemError(f"{file}: {place} must be a table")

    def wrong(self, key: str, what: str) -> ProblemError:
        return ProblemError(f"{self.file}: {self.place}{key}: {what}")

    def take(self, key: str, kinds: type | tuple[type, ...], default: Any = None, *, required: bool = False) -> Any:
        """The value of a key, which is then known."""
        if key not in self.data:
            if required:
                raise self.wrong(key, "is missing")
            return default
        value = self.data.pop(key)
        if not isinstance(value, kinds) or isinstance(value, bool) != (kinds is bool):
            raise self.wrong(key, f"{value!r} is of the wrong kind")
        if required and value == "":
            raise self.wrong(key, "is empty")
        return value

    def text(self, key: str, default: str | None = None) -> str:
        return str(self.take(key, str, default, required=default is None))

    def number(self, key: str, default: float | None = None) -> float:
        return float(self.take(key, (int, float), default, required=default is None))

    def one_of(self, key: str, allowed: Any, default: str | None = None) -> str:
        value = self.text(key, default)
        if value not in allowed:
            raise self.wrong(key, f"{value!r} is none of {', '.join(allowed)}")
        return value

    def end(self) -> None:
        if self.data:
            raise self.wrong(min(self.data), "is not a key of this table")


class _Reader:
    def __init__(self, file: str, data: dict[str, Any]) -> None:
        self.file, self.top = file, _Table(file, "", data)

    def problem(self, name: str) -> Problem:
        top = self.top
        hypothesis = top.one_of("hypothesis", HYPOTHESES)
        self.dimension = HYPOTHESES[hypothesis]
        self.constants: dict[str, Formula] = dict(top.take("constants", dict, {}))
        self.fields: dict[str, str] = dict(top.take("fields", dict, {}))
        for key, value in {**self.constants, **self.fields}.items():
            self.formula(key, value, position=key in self.fields)
        bodies = tuple(self.body(table) for table in self.tables("body"))
        sides = [name for body in bodies for names_of_side in body.sides.values() for name in names_of_side]
        self.named = set(sides) - {""}
        found = Problem(
            name,
            *(top.text(key) for key in ("title", "text", "signs", "units", "source")),
            hypothesis,
            self.constants,
            self.fields,
            bodies,
            tuple(self.support(table) for table in self.tables("support", some=False)),
            tuple(self.traction(table) for table in self.tables("traction", some=False)),
            tuple(self.contact(table) for table in self.tables("contact")),
            tuple(self.quantity(table) for table in self.tables("quantity")),
        )
        top.end()
        if self.named & {body.name for body in bodies} or len({body.name for body in bodies}) < len(bodies):
            raise ProblemError(f"{self.file}: bodies and boundaries need different names")
        if len({quantity.name for quantity in found.quantities}) < len(found.quantities):
            raise ProblemError(f"{self.file}: two quantities have the same name")
        return found

    def tables(self, key: str, *, some: bool = True) -> list[_Table]:
        rows = self.top.take(key, list, [], required=some)
        return [_Table(self.file, f"{key}[{row}].", data) for row, data in enumerate(rows)]

    def formula(self, place: str, value: Any, *, position: bool = True) -> Formula:
        if not isinstance(value, int | float | str) or isinstance(value, bool):
            raise ProblemError(f"{self.file}: {place}: {value!r} is neither a number nor a formula")
        known = set(self.constants)
        if position:
            known |= set(self.fields) | set(COORDINATES[: self.dimension])
        try:
            unknown = names(value) - known
        except ExpressionError as error:
            raise ProblemError(f"{self.file}: {place}: {error}") from None
        if unknown:
            raise ProblemError(f"{self.file}: {place}: {min(unknown)!r} is not known")
        return value

    def vector(self, table: _Table, key: str, *, position: bool, default: Any = None) -> tuple[Formula, ...]:
        values = table.take(key, list, default, required=default is None)
        if values and len(values) != self.dimension:
            raise table.wrong(key, f"must have {self.dimension} components")
        return tuple(self.formula(f"{table.place}{key}", value, position=position) for value in values)

    def components(self, table: _Table) -> dict[int, Formula]:
        found = {
            k: self.formula(f"{table.place}{key}", table.take(key, (int, float, str)))
            for k, key in enumerate(COORDINATES[: self.dimension])
            if key in table.data
        }
        if not found:
            raise table.wrong("x", "no component is named")
        return found

    def boundary(self, table: _Table, key: str = "boundary", default: str | None = None) -> str:
        value = table.text(key, default)
        if value and value not in self.named:
            raise table.wrong(key, f"{value!r} is no side of a body: sides are {', '.join(sorted(self.named))}")
        return value

    def constant(self, table: _Table, key: str) -> float:
        return self.number(f"{table.place}{key}", table.take(key, (int, float, str), required=True))

    def number(self, place: str, value: Any) -> float:
        return float(evaluate(self.formula(place, value, position=False), self.constants))

    def body(self, table: _Table) -> Body:
        shape = table.one_of("shape", SHAPES)
        lines, sides = {}, {}
        for key in SHAPES[shape]:
            rows = table.take(key, list, required=True)
            if not rows or any(not isinstance(row, list) or len(row) != 4 for row in rows):
                raise table.wrong(key, "must have segments of start, end, cells and ratio")
            ends = [[self.number(key, value) for value in row] for row in rows]
            if any(low >= high or n < 1 or n != int(n) or ratio <= 0 for low, high, n, ratio in ends):
                raise table.wrong(key, "a segment needs start < end, one cell at least, and a positive ratio")
            if any(abs(first[1] - second[0]) > 1e-12 * abs(ends[-1][1]) for first, second in pairwise(ends)):
                raise table.wrong(key, "a segment does not begin where the one before it ends")
            lines[key] = [(low, high, int(n), ratio) for low, high, n, ratio in ends]
        for side in SIDES[shape]:
            value = table.take(side, (str, list), "")
            sides[side] = [value] if isinstance(value, str) else [str(part) for part in value]
        found = Body(
            table.text("name"),
            self.constant(table, "young"),
            self.constant(table, "poisson"),
            shape,
            lines,
            sides,
            tuple(float(c) for c in table.take("centre", list, [0.0, 0.0])),  # type: ignore[arg-type]
            table.take("straight", bool, False),
        )
        if not (found.young > 0 and -1 < found.poisson <= 0.5):
            raise table.wrong("young", "Young's modulus must be positive, and Poisson's ratio between -1 and 1/2")
        table.end()
        return found

    def support(self, table: _Table) -> Support:
        boundary = self.boundary(table, default="")
        at = self.vector(table, "at", position=False, default=[])
        if bool(boundary) == bool(at):
            raise table.wrong("boundary", "a support has either a boundary or a point")
        found = Support(boundary, at, self.components(table))
        table.end()
        return found

    def traction(self, table: _Table) -> Traction:
        found = Traction(self.boundary(table), self.components(table))
        table.end()
        return found

    def contact(self, table: _Table) -> Contact:
        law = table.one_of("law", LAWS)
        data: dict[str, Formula] = dict.fromkeys(("bound", "coefficient"), 0.0)
        for key in LAWS[law]:
            data[key] = self.formula(f"{table.place}{key}", table.take(key, (int, float, str), required=True))
        found = Contact(
            self.boundary(table),
            self.boundary(table, "against", ""),
            self.formula(f"{table.place}gap", table.take("gap", (int, float, str), required=True)),
            self.direction(table),
            law,
            data["bound"],
            data["coefficient"],
        )
        table.end()
        return found

    def direction(self, table: _Table) -> tuple[Formula, ...]:
        if table.data.get("direction") == "normal":
            del table.data["direction"]
            return ()
        return self.vector(table, "direction", position=False)

    def quantity(self, table: _Table) -> Quantity:
        measure = table.one_of("measure", MEASURES)
        boundary = self.boundary(table, default=None if measure in ON_BOUNDARY else "")
        kinds = [kind for kind in REFERENCES if kind in table.data]
        if len(kinds) != 1:
            raise table.wrong("exact", f"needs one of {', '.join(REFERENCES)}")
        kind = kinds[0]
        numbers = table.take(kind, (int, float, list), required=True)
        numbers = [numbers] if kind == "exact" else numbers
        if not isinstance(numbers, list) or not all(isinstance(n, int | float) for n in numbers):
            raise table.wrong(kind, f"{numbers!r} is of the wrong kind")
        if kind in ("interval", "values") and len(numbers) != 2:
            raise table.wrong(kind, "must have two numbers")
        if kind == "interval" and numbers[0] >= numbers[1]:
            raise table.wrong(kind, "the first end is not below the second one")
        sources = table.take("sources", list) if kind == "values" else [table.text("source")]
        if not isinstance(sources, list) or len(sources) != (2 if kind == "values" else 1) or not all(sources):
            raise table.wrong("sources", "each of two values needs its source")
        formula = table.text("formula", None if kind == "exact" else "")
        asked = MEASURES[measure]
        found = Quantity(
            table.text("name"),
            measure,
            boundary,
            self.vector(table, "point", position=False, default=None if "point" in asked else []),
            COORDINATES.index(table.one_of("axis", COORDINATES[: self.dimension])) if "axis" in asked else 0,
            table.text("unit"),
            table.text("text"),
            kind,
            tuple(float(n) for n in numbers),
            tuple(str(s) for s in sources),
            formula,
            table.number("tolerance"),
            table.number("scale", max(abs(float(n)) for n in numbers)),
        )
        if not (0 < found.tolerance < 0.2 and found.scale > 0):
            raise table.wrong("tolerance", "must be between 0 and 0.2 of a scale that is not zero")
        table.end()
        return found
