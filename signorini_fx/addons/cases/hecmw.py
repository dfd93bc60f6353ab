"""Files of FrontISTR in lines: .msh and .cnt with keywords, and results .res.  No dolfinx here."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path

import numpy as np

from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints

_MOST_IN_RANGE = 10_000_000


class CardError(ValueError):
    """What is wrong with a card, and where."""

    def __init__(self, line: int, why: str) -> None:
        super().__init__(f"line {line}: {why}")


@dataclass
class ControlCard:
    """A keyword with its parameters and data.

    Attributes:
        keyword: in capitals, without the exclamation mark.
        line: of the file, from 1.
        parameters: in capitals, each with its value or "".
        rows: lines of data, each with its line and the words in it.
    """

    keyword: str
    line: int
    parameters: dict[str, str]
    rows: list[tuple[int, list[str]]] = field(default_factory=list)

    @property
    def origin(self) -> str:
        """For messages."""
        return f"line {self.line}, !{self.keyword}"

    def name(self, key: str, otherwise: str | None = None) -> str:
        """A parameter in capitals.

        Raises:
            CardError: it is not there.
        """
        value = self.parameters.get(key, otherwise)
        if value is None or (not value and otherwise is None):
            raise CardError(self.line, f"!{self.keyword}: {key} is expected")
        return value.upper()

    def whole_parameter(self, key: str, otherwise: int) -> int:
        """A parameter that is a whole number.

        Raises:
            CardError: it is none.
        """
        value = self.parameters.get(key)
        return otherwise if value is None else whole_number(self.line, value, f"!{self.keyword}, {key}")


def whole_number(line: int, word: str, entry: str) -> int:
    """A whole number of at most 18 digits.

    Raises:
        CardError: it is none.
    """
    if not word.isascii() or not word.isdigit() or len(word) > 18:
        raise CardError(line, f"{entry}: a whole number is expected, not {word[:40]!r}")
    return int(word)


def real(line: int, word: str, entry: str) -> float:
    """A finite number, with the exponents of Fortran too.

    Raises:
        CardError: it is none.
    """
    try:
        value = float(word.lower().replace("d", "e"))
    except ValueError:
        value = np.inf
    if not abs(value) < np.inf:
        raise CardError(line, f"{entry}: a number is expected, not {word[:40]!r}")
    return value


def read_cards(file: Path) -> list[ControlCard]:
    """The cards of a file, up to !END.

    Raises:
        MeshError: it cannot be read, or begins with something else; the message says on which line.
    """
    try:
        text = file.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise MeshError(f"{file}: cannot be read: {error.strerror}") from None
    cards: list[ControlCard] = []
    for number, line in enumerate(text.split("\n"), 1):
        words = [word.strip() for word in line.strip().split(",")]
        if not line.strip() or line.lstrip().startswith(("#", "!!")):
            continue
        if not words[0].startswith("!"):
            if not cards:
                raise MeshError(f"{file}: line {number}: a keyword that begins with ! is expected")
            cards[-1].rows.append((number, [part for word in words for part in word.split() or [""]]))
            continue
        keyword = " ".join(words[0][1:].upper().split())
        if keyword == "END":
            break
        pairs = [word.partition("=") for word in words[1:] if word]
        cards.append(ControlCard(keyword, number, {key.strip().upper(): value.strip() for key, _, value in pairs}))
    return cards


class NumberGroups:
    """Named groups of numbers.

    Attributes:
        content: name -> numbers.
    """

    def __init__(self, kind: str) -> None:
        self._kind = kind
        self.content: dict[str, list[int]] = {}

    def add(self, card: ControlCard, key: str, existing: Ints) -> None:
        """The numbers of a card, or those of groups that it names, go into the group that it names.

        Raises:
            CardError: a number or a name is not known.
        """
        members = self.content.setdefault(card.name(key), [])
        for line, words in card.rows:
            entries = [word for word in words if word]
            if "GENERATE" in card.parameters:
                first, last, *step = (whole_number(line, word, f"!{card.keyword}") for word in entries)
                steps = step[0] if step else 1
                if not steps or (last - first) // steps > _MOST_IN_RANGE:
                    raise CardError(line, f"!{card.keyword}: first, last and step are expected")
                members += range(first, last + 1, steps)
                continue
            for word in entries:
                if word.isdigit():
                    members.append(whole_number(line, word, f"!{card.keyword}"))
                elif word.upper() in self.content:
                    members += self.content[word.upper()]
                else:
                    raise CardError(line, f"!{card.keyword}: there is no {self._kind} {word[:40]!r}")
        missing = np.setdiff1d(np.array(members, dtype=np.int64), existing)
        if missing.size:
            raise CardError(card.line, f"!{card.keyword}: {self._kind} {missing[0]} is not there")

    def numbers(self, line: int, word: str) -> Ints:
        """Those of a group, or a number alone.

        Raises:
            CardError: there is no such group.
        """
        if word.isdigit():
            return np.array([whole_number(line, word, self._kind)], dtype=np.int64)
        if word.upper() not in self.content:
            raise CardError(line, f"there is no {self._kind} {word[:40]!r}")
        return np.unique(np.array(self.content[word.upper()], dtype=np.int64))


@dataclass(frozen=True)
class CaseResult:
    """What FrontISTR has written of a moment.

    Attributes:
        time: of it.
        numbers: of the nodes.
        fields: name in capitals -> values, shape (nodes, components).
    """

    time: float
    numbers: Ints
    fields: dict[str, Floats]


def read_result(file: Path) -> CaseResult:
    """A result in text: the time and the fields of nodes.

    Raises:
        MeshError: it is not so.
    """
    try:
        lines = file.read_text(encoding="utf-8", errors="replace").split("\n")
    except OSError as error:
        raise MeshError(f"{file}: cannot be read: {error.strerror}") from None
    time, begin = None, None
    for number, line in enumerate(lines):
        if line.strip() == "TOTALTIME" and number + 1 < len(lines):
            time = line_number(lines[number + 1])
        if line.strip() == "*data":
            begin = number + 1
            break
    if time is None or begin is None:
        raise MeshError(f"{file}: line 1: a result with TOTALTIME and *data is expected")
    words = (word for line in lines[begin:] for word in line.split())
    try:
        nodes, _, items, _ = (int(next(words)) for _ in range(4))
        if not 0 < nodes <= len(lines) or not 0 < items <= len(lines):
            raise ValueError
        sizes = [int(next(words)) for _ in range(items)]
        names = [next(words).upper() for _ in range(items)]
        width = sum(sizes) + 1
        flat = np.array(list(islice(words, nodes * width)), dtype=np.float64)
        table = flat.reshape(nodes, width)
    except (ValueError, StopIteration, OverflowError):
        raise MeshError(f"{file}: line {begin + 1}: nodes and their fields are expected") from None
    ends = np.cumsum([1, *sizes])
    fields = {name: table[:, a:b] for name, a, b in zip(names, ends[:-1], ends[1:], strict=True)}
    return CaseResult(time, table[:, 0].astype(np.int64), fields)


def line_number(line: str) -> float | None:
    """The number of a line; None: it is none."""
    try:
        return float(line.split()[0])
    except (ValueError, IndexError):
        return None
