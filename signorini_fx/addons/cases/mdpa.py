"""Model parts of Kratos, .mdpa: nodes, elements, conditions, properties and sub model parts.  No dolfinx here.

meshio reads such files too, but numbers nodes by their order and leaves conditions and sub model parts out.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints

# Of elements and conditions by dimension of space and number of nodes the kind in meshio's words, whose order of nodes
# is that of Kratos.
ELEMENT_KINDS = {
    **{(2, 3): "triangle", (2, 4): "quad", (2, 6): "triangle6", (2, 8): "quad8", (2, 9): "quad9"},
    **{(3, 4): "tetra", (3, 10): "tetra10", (3, 8): "hexahedron"},
}
FACET_KINDS = {
    **{(2, 2): "line", (2, 3): "line3"},
    **{(3, 3): "triangle", (3, 4): "quad", (3, 6): "triangle6", (3, 8): "quad8", (3, 9): "quad9"},
}
_LISTS = {"SubModelPartNodes": "nodes", "SubModelPartElements": "elements", "SubModelPartConditions": "conditions"}
# Blocks that say nothing of a problem where they are empty.
_PLAIN = {"ModelPartData", "SubModelPartData", "SubModelPartTables"}


@dataclass(frozen=True)
class Entities:
    """Elements or conditions of a block.

    Attributes:
        name: of their class.
        line: of the block.
        numbers: of each.
        properties: number of the properties of each.
        nodes: numbers of the nodes, shape (entities, nodes of each).
    """

    name: str
    line: int
    numbers: Ints
    properties: Ints
    nodes: Ints

    @property
    def dim(self) -> int:
        """Of space, as the name says; 0: it does not."""
        match = re.search(r"([23])D", self.name)
        return int(match[1]) if match else 0

    def kind(self, kinds: dict[tuple[int, int], str]) -> str:
        """In meshio's words; "": it is not known here."""
        return kinds.get((self.dim, self.nodes.shape[1]), "")


@dataclass
class SubModelPart:
    """A part of the model by numbers.

    Attributes:
        line: where it begins.
        nodes: numbers of nodes.
        elements: of elements.
        conditions: of conditions.
    """

    line: int
    nodes: list[int] = field(default_factory=list)
    elements: list[int] = field(default_factory=list)
    conditions: list[int] = field(default_factory=list)


@dataclass
class ModelPart:
    """The content of a file.

    Attributes:
        numbers: of the nodes, ascending.
        points: their positions, shape (n, 3).
        elements: block by block.
        conditions: likewise.
        parts: sub model parts by their names, of those within another one with a dot between.
        properties: number -> name of a variable -> value, where it is a number.
        unread: line of a block -> what it is.
    """

    numbers: Ints
    points: Floats
    elements: list[Entities] = field(default_factory=list)
    conditions: list[Entities] = field(default_factory=list)
    parts: dict[str, SubModelPart] = field(default_factory=dict)
    properties: dict[int, dict[str, float]] = field(default_factory=dict)
    unread: dict[int, str] = field(default_factory=dict)

    def rows(self, numbers: Ints) -> Ints:
        """The rows of nodes by their numbers, which exist."""
        return np.searchsorted(self.numbers, numbers).astype(np.int64)


class _FileError(ValueError):
    """What is wrong with a line."""

    def __init__(self, line: int, why: str) -> None:
        super().__init__(f"line {line}: {why}")


def read_mdpa(file: Path) -> ModelPart:
    """Read a file.

    Raises:
        MeshError: it cannot be read, or a line is not as it should be; the message says which.
    """
    try:
        text = file.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise MeshError(f"{file}: cannot be read: {error.strerror}") from None
    try:
        return _MdpaText(text).model_part()
    except _FileError as error:
        raise MeshError(f"{file}: {error}") from None


class _MdpaText:
    """Lines of a file without comments, and the place in them."""

    def __init__(self, text: str) -> None:
        rows = (line.partition("//")[0].split() for line in text.split("\n"))
        self._lines = [(number, words) for number, words in enumerate(rows, 1) if words]
        self._at = 0
        self._nodes: list[tuple[int, list[str]]] = []
        self._model = ModelPart(np.empty(0, np.int64), np.empty((0, 3)))

    def model_part(self) -> ModelPart:
        """All of it."""
        while self._at < len(self._lines):
            line, words = self._next()
            self._begin(line, words, "")
        self._keep_nodes()
        self._check_references()
        return self._model

    def _next(self) -> tuple[int, list[str]]:
        entry = self._lines[self._at]
        self._at += 1
        return entry

    def _begin(self, line: int, words: list[str], outer: str) -> None:
        """A block that begins on a line."""
        if words[0] != "Begin" or len(words) < 2:
            raise _FileError(line, f"Begin and a name are expected, not {' '.join(words)[:40]!r}")
        kind, title = words[1], words[2:]
        if kind == "SubModelPart":
            self._sub_model_part(line, title, outer)
            return
        body = self._body(line, kind)
        match kind:
            case "Nodes":
                self._nodes += body
            case "Elements" | "Conditions":
                if not title:
                    raise _FileError(line, f"Begin {kind}: the name of their class is expected")
                if body:
                    blocks = self._model.elements if kind == "Elements" else self._model.conditions
                    blocks += _entities(title[0], line, body)
            case "Properties":
                number = _whole(line, title[0] if title else "", "Properties: a number is expected")
                variables = self._model.properties.setdefault(number, {})
                for _, row in body:
                    if len(row) == 2 and (value := _real(row[1])) is not None:
                        variables[row[0]] = value
            case _ if kind not in _PLAIN and body:
                self._model.unread[line] = " ".join([kind, *title])

    def _body(self, line: int, kind: str) -> list[tuple[int, list[str]]]:
        """The lines of a block without others in it, up to its end."""
        body: list[tuple[int, list[str]]] = []
        while self._at < len(self._lines):
            number, words = self._next()
            if words[0] == "End":
                if words[1:2] != [kind]:
                    raise _FileError(number, f"End {kind} is expected, as it began on line {line}")
                return body
            if words[0] == "Begin" and kind != "Properties":
                raise _FileError(number, f"End {kind} is expected, as it began on line {line}")
            if words[0] == "Begin":  # a table of properties
                self._body(number, words[1] if len(words) > 1 else "")
                self._model.unread[number] = " ".join(words[1:])
                continue
            body.append((number, words))
        raise _FileError(line, f"Begin {kind} has no end")

    def _sub_model_part(self, line: int, title: list[str], outer: str) -> None:
        if not title:
            raise _FileError(line, "Begin SubModelPart: a name is expected")
        name = f"{outer}.{title[0]}" if outer else title[0]
        part = self._model.parts.setdefault(name, SubModelPart(line))
        while self._at < len(self._lines):
            number, words = self._next()
            if words[0] == "End":
                if words[1:2] != ["SubModelPart"]:
                    raise _FileError(number, f"End SubModelPart is expected, as it began on line {line}")
                return
            kind = words[1] if len(words) > 1 else ""
            if words[0] == "Begin" and kind in _LISTS:
                listed = getattr(part, _LISTS[kind])
                for row_line, row in self._body(number, kind):
                    listed += [_whole(row_line, word, f"{kind}: a number is expected") for word in row]
            else:
                self._begin(number, words, name)
        raise _FileError(line, "Begin SubModelPart has no end")

    def _keep_nodes(self) -> None:
        if not self._nodes:
            raise _FileError(1, "there are no nodes")
        numbers, points = [], []
        seen: dict[int, int] = {}
        for line, words in self._nodes:
            number = _whole(line, words[0], "the number of a node is expected")
            values = [_real(word) for word in words[1:]]
            if len(values) != 3 or None in values:
                raise _FileError(line, f"a number and three coordinates are expected, not {' '.join(words)[:60]!r}")
            if number in seen:
                raise _FileError(line, f"node {number} is there again: it was on line {seen[number]}")
            seen[number] = line
            numbers.append(number)
            points.append(values)
        order = np.argsort(numbers)
        self._model.numbers = np.array(numbers, dtype=np.int64)[order]
        self._model.points = np.array(points, dtype=np.float64)[order]

    def _check_references(self) -> None:
        """Nodes, elements and conditions that are named are there."""
        model = self._model
        for blocks, word in ((model.elements, "element"), (model.conditions, "condition")):
            for block in blocks:
                missing = ~np.isin(block.nodes, model.numbers).all(axis=1)
                if missing.any():
                    row = int(np.argmax(missing))
                    node = np.setdiff1d(block.nodes[row], model.numbers)[0]
                    raise _FileError(
                        block.line, f"{block.name}: {word} {block.numbers[row]} has node {node}, which is not there"
                    )
            numbers = np.concatenate([np.empty(0, np.int64), *(block.numbers for block in blocks)])
            values, counts = np.unique(numbers, return_counts=True)
            if (counts > 1).any():
                twice = values[np.argmax(counts > 1)]
                line = next(block.line for block in reversed(blocks) if twice in block.numbers)
                raise _FileError(line, f"{word} {twice} is there twice")
            for name, part in model.parts.items():
                listed = part.elements if word == "element" else part.conditions
                unknown = np.setdiff1d(np.array(listed, dtype=np.int64), numbers)
                if unknown.size:
                    raise _FileError(part.line, f"SubModelPart {name}: {word} {unknown[0]} is not there")
        for name, part in model.parts.items():
            unknown = np.setdiff1d(np.array(part.nodes, dtype=np.int64), model.numbers)
            if unknown.size:
                raise _FileError(part.line, f"SubModelPart {name}: node {unknown[0]} is not there")


def _entities(name: str, line: int, body: Sequence[tuple[int, list[str]]]) -> list[Entities]:
    """A block of elements or conditions, which all have as many nodes as the name says, or as the first one has."""
    match = re.search(r"(\d+)N$", name)
    count = int(match[1]) if match else len(body[0][1]) - 2
    rows = []
    for row_line, words in body:
        if len(words) != count + 2 or count < 1:
            raise _FileError(row_line, f"{name}: a number, properties and {count} nodes are expected")
        rows.append([_whole(row_line, word, f"{name}: whole numbers are expected") for word in words])
    table = np.array(rows, dtype=np.int64)
    return [Entities(name, line, table[:, 0], table[:, 1], table[:, 2:])]


def _whole(line: int, word: str, why: str) -> int:
    """A whole number of at most 18 digits."""
    if not word.isascii() or not word.isdigit() or len(word) > 18:
        raise _FileError(line, f"{why}, not {word[:40]!r}")
    return int(word)


def _real(word: str) -> float | None:
    """A finite number; None: it is none."""
    try:
        value = float(word)
    except ValueError:
        return None
    return value if abs(value) < float("inf") else None
