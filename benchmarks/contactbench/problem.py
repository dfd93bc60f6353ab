"""Problems as they stand in ``problems/*.toml``: what the keys are, and what a file may not
miss.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from .expressions import COORDINATES, evaluate, names

FOLDER = Path(__file__).parent / "problems"
Formula = str | float
HYPOTHESES = {"plane strain": 2, "plane stress": 2, "axisymmetric": 2, "space": 3}
LAWS = {"none": set[str](), "tresca": {"bound"}, "coulomb": {"coefficient"}}
SHAPES = {"rectangle": ("x", "y"), "annulus": ("radius", "angle"), "box": ("x", "y", "z")}
# The sides at the start and at the end of each line.
SIDES = {
    "rectangle": (("left", "right"), ("bottom", "top")),
    "annulus": (("inner", "outer"), ("start", "end")),
    "box": (("left", "right"), ("front", "back"), ("bottom", "top")),
}
MEASURES = {
    "normal force": set[str](),
    "friction force": {"axis"},
    "pressure at": {"point"},
    "shear at": {"point", "axis"},
    "largest pressure": set[str](),
    "pressure moment": {"axis"},
    "pressure mean square": {"axis"},
    "displacement": {"point", "axis"},
    "strain energy": set[str](),
}
ON_BOUNDARY = {
    "normal force",
    "friction force",
    "pressure at",
    "shear at",
    "largest pressure",
    "pressure moment",
    "pressure mean square",
}
REFERENCES = ("exact", "interval", "values")


class ProblemError(ValueError):
    """A problem file that is not complete: file, key, and what is wrong."""


@dataclass(frozen=True)
class Body:
    """A body: its shape with the lines of its mesh, the names of its sides, and its material; see
    README.md.
    """

    name: str
    young: float
    poisson: float
    shape: str
    lines: dict[str, list[tuple[float, float, int, float]]] = field(default_factory=dict)
    sides: dict[str, list[str]] = field(default_factory=dict)
    centre: tuple[float, float] = (0.0, 0.0)
    straight: bool = False
    turn: float = 0.0
    density: float = 0.0
    velocity: tuple[Formula, ...] = ()

    @property
    def mu(self) -> float:
        """Shear modulus."""
        return self.young / (2 * (1 + self.poisson))


@dataclass(frozen=True)
class Support:
    """Prescribed displacements: of a boundary, or of the node at a point; components that are not
    named are free.
    """

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
    """A boundary that may touch a rigid foundation, or the boundary ``against`` it; see README.md.

    A direction without components is the outward normal of the body.
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
    """What is asked for, and its reference; see README.md.

    ``numbers`` are the exact value; both ends of the interval; or two independent values.
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
    time: float


@dataclass(frozen=True)
class Problem:
    """A problem; its attributes are the keys of its file, see README.md."""

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
    times: tuple[float, ...]
    time_step: float
    finite: bool

    @property
    def dynamic(self) -> bool:
        """Whether the bodies have inertia."""
        return any(body.density for body in self.bodies)

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

    def at(
        self, formula: Formula, coordinates: Mapping[str, Any], time: float | None = None
    ) -> Any:
        """The value of a formula of positions and of the time.

        Args:
            formula: any formula of the file.
            coordinates: what x, y and z stand for.
            time: what ``time`` stands for; None: the last one.
        """
        now = self.times[-1] if time is None else time
        return evaluate(formula, {**self.fields, **self.numbers, "time": now, **coordinates})

    def depends_on(self, formula: Formula, *others: str) -> bool:
        """Whether a formula, or a field that it names, has one of these names in it."""
        used = names(formula)
        fields = [self.fields[name] for name in used if name in self.fields]
        return not used.isdisjoint(others) or any(self.depends_on(f, *others) for f in fields)

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
            f"there is no problem {str(name)!r}; there are: {', '.join(problem_names())}"
        ) from None
    except tomllib.TOMLDecodeError as error:
        raise ProblemError(f"{path.name}: {error}") from None
    try:
        return _problem(path.stem, data)
    except KeyError as error:
        raise ProblemError(f"{path.name}: {error.args[0]} is missing, or not known") from None


def _problem(name: str, data: dict[str, Any]) -> Problem:
    """A problem from its file.

    Raises:
        KeyError: a key is missing, or a word is none of those that are known.
        ExpressionError: a formula is none.
    """
    hypothesis, constants = data["hypothesis"], data.get("constants", {})
    times = tuple(map(float, data.get("times", [1.0])))
    coordinates = COORDINATES[: HYPOTHESES[hypothesis]]

    for word in ("time", *coordinates):
        if word in constants or word in data.get("fields", {}):
            raise KeyError(f"another name than {word}")

    def number(formula: Formula) -> float:
        return float(evaluate(formula, constants))

    def components(table: dict[str, Any]) -> dict[int, Formula]:
        return {k: table[key] for k, key in enumerate(coordinates) if key in table}

    def body(table: dict[str, Any]) -> Body:
        shape = table["shape"]
        lines = {}
        for key in SHAPES[shape]:
            rows = [[number(value) for value in row] for row in table[key]]
            lines[key] = [(low, high, int(n), ratio) for low, high, n, ratio in rows]
        sides = {side: table.get(side, "") for pair in SIDES[shape] for side in pair}
        names = {
            side: [value] if isinstance(value, str) else value for side, value in sides.items()
        }
        material = number(table["young"]), number(table["poisson"])
        more = {key: table[key] for key in ("centre", "straight") if key in table}
        more |= {key: number(table[key]) for key in ("turn", "density") if key in table}
        more |= {"velocity": tuple(table["velocity"])} if "velocity" in table else {}
        return Body(table["name"], *material, shape, lines, names, **more)

    def contact(table: dict[str, Any]) -> Contact:
        direction = () if table["direction"] == "normal" else tuple(table["direction"])
        law = table["law"]
        bounds = {key: table[key] if key in LAWS[law] else 0.0 for key in ("bound", "coefficient")}
        return Contact(
            table["boundary"], table.get("against", ""), table["gap"], direction, law, **bounds
        )

    def quantity(table: dict[str, Any]) -> Quantity:
        measure, kind = table["measure"], next(kind for kind in REFERENCES if kind in table)
        numbers = tuple(map(float, [table[kind]] if kind == "exact" else table[kind]))
        return Quantity(
            table["name"],
            measure,
            table["boundary"] if measure in ON_BOUNDARY else "",
            tuple(table["point"]) if "point" in MEASURES[measure] else (),
            coordinates.index(table["axis"]) if "axis" in MEASURES[measure] else 0,
            table["unit"],
            table["text"],
            kind,
            numbers,
            tuple(table["sources"]) if kind == "values" else (table["source"],),
            table["formula"] if kind == "exact" else "",
            table["tolerance"],
            table.get("scale", max(map(abs, numbers))),
            float(table.get("time", times[-1])),
        )

    return Problem(
        name,
        *(data[key] for key in ("title", "text", "signs", "units", "source")),
        hypothesis,
        constants,
        data.get("fields", {}),
        tuple(map(body, data["body"])),
        tuple(
            Support(t.get("boundary", ""), tuple(t.get("at", ())), components(t))
            for t in data.get("support", [])
        ),
        tuple(Traction(table["boundary"], components(table)) for table in data.get("traction", [])),
        tuple(map(contact, data["contact"])),
        tuple(map(quantity, data["quantity"])),
        times,
        number(data.get("time_step", 0.0)),
        data.get("deformations", "small") == "finite",
    )
