"""Values of a command file: results of commands, functions, and what is not known.  No dolfinx here."""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np


class CommandError(ValueError):
    """What is wrong with a command, and where."""

    def __init__(self, origin: str, why: str) -> None:
        self.origin = origin
        super().__init__(why)

    @property
    def text(self) -> str:
        """What is wrong, and where."""
        return f"{self.origin}: {self}"


@dataclass(frozen=True)
class Unknown:
    """A value that is not known, because what makes it is not evaluated.

    Attributes:
        why: in words.
    """

    why: str


@dataclass
class AsterCommand:
    """A command as it is called.

    Attributes:
        name: such as AFFE_MODELE.
        keywords: their values: numbers, texts, tuples, dictionaries of factor keywords, ``Concept``, ``Unknown``.
        line: in the file, from 1.
    """

    name: str
    keywords: dict[str, Any]
    line: int

    @property
    def origin(self) -> str:
        """Where it is and what it is, in words."""
        return f"line {self.line}, {self.name}"

    def __contains__(self, key: str) -> bool:
        return key in self.keywords

    def get(self, key: str, default: Any = None) -> Any:
        """The value of a keyword.

        Raises:
            CommandError: it is not known.
        """
        value = self.keywords.get(key, default)
        self.check(key, value)
        return value

    def factors(self, key: str) -> list[dict[str, Any]]:
        """The occurrences of a factor keyword.

        Raises:
            CommandError: they are none, or not known.
        """
        value = self.get(key, ())
        entries = value if isinstance(value, tuple | list) else (value,)
        for entry in entries:
            self.check(key, entry)
            if not isinstance(entry, dict):
                raise CommandError(self.origin, f"{key}: _F(...) is expected")
        return [FactorKeyword(self, entry) for entry in entries]

    def factor(self, key: str) -> dict[str, Any]:
        """The first occurrence of a factor keyword.

        Raises:
            CommandError: there is none, or it is not known.
        """
        entries = self.factors(key)
        if not entries:
            raise CommandError(self.origin, f"{key}: _F(...) is expected")
        return entries[0]

    def choice(self, entry: Mapping[str, Any], key: str, known: Sequence[str]) -> str:
        """One of some words, of which the first one is meant where an occurrence has none.

        Raises:
            CommandError: it is another one.
        """
        value = entry.get(key, known[0])
        self.check(key, value)
        if value not in known:
            raise CommandError(self.origin, f"{key}={_shown(value)}: known are {', '.join(known)}")
        return str(value)

    def number(self, value: Any, key: str) -> float:
        """A number.

        Raises:
            CommandError: it is none, or not finite.
        """
        self.check(key, value)
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise CommandError(self.origin, f"{key}: a number is expected, not {_shown(value)}")
        return float(value)

    def words(self, value: Any, key: str) -> list[str]:
        """One text or several.

        Raises:
            CommandError: they are none.
        """
        entries = value if isinstance(value, tuple | list) else (value,)
        if not entries:
            raise CommandError(self.origin, f"{key}: a text is expected, not {_shown(value)}")
        for entry in entries:
            self.check(key, entry)
            if not isinstance(entry, str):
                raise CommandError(self.origin, f"{key}: a text is expected, not {_shown(entry)}")
        return [entry.strip() for entry in entries]

    def numbers(self, value: Any, key: str) -> list[float]:
        """One number or several.

        Raises:
            CommandError: they are none.
        """
        entries = value if isinstance(value, tuple | list) else (value,)
        return [self.number(entry, key) for entry in entries]

    def concept(self, value: Any, key: str) -> Concept:
        """The result of another command.

        Raises:
            CommandError: it is none.
        """
        self.check(key, value)
        if not isinstance(value, Concept):
            raise CommandError(self.origin, f"{key}: the result of a command is expected, not {_shown(value)}")
        return value

    def check(self, key: str, value: Any) -> None:
        """Refuse a value that is not known.

        Raises:
            CommandError: it is not.
        """
        if isinstance(value, Unknown):
            raise CommandError(self.origin, f"{key}: {value.why}")


class FactorKeyword(dict[str, Any]):
    """The keywords of an occurrence of a factor keyword.  A value that is not known is refused where it is read."""

    def __init__(self, command: AsterCommand, entry: Mapping[str, Any]) -> None:
        super().__init__(entry)
        self._command = command

    def __getitem__(self, key: str) -> Any:
        value = super().__getitem__(key)
        self._command.check(key, value)
        return value

    def get(self, key: str, default: Any = None) -> Any:
        """The value of a keyword.

        Raises:
            CommandError: it is not known.
        """
        value = super().get(key, default)
        self._command.check(key, value)
        return value


@dataclass
class Concept:
    """What a command has made, and others have changed.

    Attributes:
        name: of the variable.
        commands: that have made and changed it, in their order.
    """

    name: str
    commands: list[AsterCommand] = field(default_factory=list)

    @property
    def made_by(self) -> AsterCommand:
        """The first command."""
        return self.commands[0]


@dataclass(frozen=True)
class UserFunction:
    """A function of the command file.

    Attributes:
        node: its text as a tree.
        scope: the variables that it sees.
    """

    node: ast.FunctionDef | ast.Lambda
    scope: dict[str, Any]


def _shown(value: Any) -> str:
    if isinstance(value, Concept):
        return f"{value.name} of {value.made_by.name}"
    return repr(value)[:40]


def interpolated(command: AsterCommand, at: float) -> float:
    """The value of a DEFI_FONCTION.

    Raises:
        CommandError: it has none there.
    """
    if "VALE" in command:
        pairs = command.numbers(command.get("VALE"), "VALE")
        if len(pairs) % 2 or not pairs:
            raise CommandError(command.origin, "VALE: pairs of numbers are expected")
        x, y = np.array(pairs[0::2]), np.array(pairs[1::2])
    elif "ABSCISSE" in command and "ORDONNEE" in command:
        x, y = (np.array(command.numbers(command.get(key), key)) for key in ("ABSCISSE", "ORDONNEE"))
    else:
        raise CommandError(command.origin, "VALE, or ABSCISSE and ORDONNEE, are expected")
    if len(x) != len(y) or (np.diff(x) <= 0).any():
        raise CommandError(command.origin, "abscissas must increase, each with an ordinate")
    if any(word != "LIN" for word in command.words(command.get("INTERPOL", "LIN"), "INTERPOL")):
        raise CommandError(command.origin, "INTERPOL: only LIN is known")
    tolerance = 1e-9 * max(1.0, float(np.abs(x).max()))
    for key, side, ends in (
        ("PROL_GAUCHE", at < x[0] - tolerance, (0, 1)),
        ("PROL_DROITE", at > x[-1] + tolerance, (-1, -2)),
    ):
        if not side:
            continue
        kind = command.get(key, "EXCLU")
        if kind == "LINEAIRE" and len(x) > 1:
            first, second = ends
            return float(y[first] + (at - x[first]) * (y[second] - y[first]) / (x[second] - x[first]))
        if kind not in ("CONSTANT", "LINEAIRE"):
            raise CommandError(command.origin, f"it has no value at {at:g}, from {x[0]:g} to {x[-1]:g}")
    return float(np.interp(at, x, y))


Parameters = Mapping[str, float]
