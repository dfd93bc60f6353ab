"""An assembly of parts as one model: the nodes, elements and sets of instances get unique numbers
and names.

A name that several instances have, or that the assembly has too, becomes INSTANCE.NAME; one that is
unique stays as it is.  Nodes of the second instance, and of the assembly, get higher numbers.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from signorini_fx.addons.decks.text import DeckBlock, DeckError, coordinates, real, real_or_none
from signorini_fx.arrays import Array
from signorini_fx.mechanics.mesh.files.arrays import plain
from signorini_fx.mechanics.statement.rigid_shape import turning

# Parameters whose values are sets, surfaces, orientations or nodes.
_NAMING = ("NSET", "ELSET", "SURFACE", "NODE")
# Keywords whose rows begin with nodes, elements or sets of them, and the number of such words; None
# for all words.
_REFERRING: dict[str, int | None] = {
    **dict.fromkeys(("NSET", "ELSET", "ELEMENT", "TIE", "CONTACTPAIR"), None),
    **dict.fromkeys(
        (
            "NODE",
            "SURFACE",
            "BOUNDARY",
            "CLOAD",
            "DLOAD",
            "DSLOAD",
            "TEMPERATURE",
            "INITIALCONDITIONS",
        ),
        1,
    ),
}
LEVELS = ("PART", "ENDPART", "INSTANCE", "ENDINSTANCE", "ASSEMBLY", "ENDASSEMBLY")
_DEFINING = {
    "NODE": "NSET",
    "NSET": "NSET",
    "ELEMENT": "ELSET",
    "ELSET": "ELSET",
    "SURFACE": "NAME",
}
# From positions in a part to those in the assembly, shape (n, 3).
_Motion = Callable[[Array], Array]


@dataclass
class _Scope:
    """An instance, or the assembly with everything that is outside of instances."""

    name: str  # as it is written; empty: that of the assembly
    blocks: list[DeckBlock] = field(default_factory=list)  # its keywords
    move: _Motion | None = (
        None  # from its coordinates to those of the assembly; None: they are the same
    )
    first: int = 0  # offset that is added to its numbers
    names: set[str] = field(default_factory=set)  # of its sets and surfaces, in capitals


def assembled(blocks: list[DeckBlock]) -> list[DeckBlock]:
    """Return the keywords with each instance replaced by the keywords of its part; without
    instances all stay as they are.
    """
    if not any(block.keyword == "INSTANCE" for block in blocks):
        return blocks
    assembly = _Scope("")
    parts: dict[str, list[DeckBlock]] = {}
    instances: dict[str, _Scope] = {}
    order: list[tuple[DeckBlock | None, _Scope]] = []
    scope: list[DeckBlock] | None = None
    for block in blocks:
        if block.keyword in LEVELS:
            order.append((block, assembly))
        if block.keyword == "PART":
            scope = parts.setdefault(_required(block, "NAME").upper(), [])
        elif block.keyword == "INSTANCE":
            instance = _instance(block, parts)
            if instance.name.upper() in instances:
                raise DeckError(block, f"there are two instances {instance.name!r}")
            instances[instance.name.upper()] = instance
            order.append((None, instance))
            scope = instance.blocks
        elif block.keyword in LEVELS:
            scope = None
        elif scope is None:
            order.append((block, assembly))
            assembly.blocks.append(block)
        else:
            scope.append(block)
    first = 0
    for part_scope in (*instances.values(), assembly):
        part_scope.names = {name.upper() for block in part_scope.blocks for name in _defined(block)}
        part_scope.first, first = (
            first,
            first + max(map(_largest_number, part_scope.blocks), default=0),
        )
    if not any(block.keyword in ("NODE", "ELEMENT") for block in assembly.blocks):
        assembly.first = (
            0  # numbers are those of the only instance, in files that say so without its name
        )
    counts = Counter(
        name for part_scope in (*instances.values(), assembly) for name in part_scope.names
    )
    names = _Names(assembly, instances, counts)
    return [
        names.written(block, part_scope)
        for one, part_scope in order
        for block in (part_scope.blocks if one is None else [one])
    ]


def _required(block: DeckBlock, key: str) -> str:
    if key not in block.parameters:
        raise DeckError(block, f"{key} is missing")
    return block.parameters[key]


def _instance(block: DeckBlock, parts: dict[str, list[DeckBlock]]) -> _Scope:
    """Return an instance of a part; its data lines may shift it and then turn it about an axis."""
    part = _required(block, "PART")
    if part.upper() not in parts:
        raise DeckError(block, f"there is no part {part!r} before it")
    instance = _Scope(_required(block, "NAME"), list(parts[part.upper()]))
    try:
        rows = [np.array([real(word) for word in row]) for row in block.rows]
        if [len(row) for row in rows] not in ([], [3], [3, 7]):
            raise ValueError(
                "a shift of three numbers is expected, then perhaps two points of an axis and an "
                "angle"
            )
        if rows:
            instance.move = _motion(*rows)
    except ValueError as error:
        raise DeckError(block, str(error)) from None
    return instance


def _motion(shift: Array, turn: Array | None = None) -> _Motion:
    """Return a shift followed by a rotation.

    Args:
        shift: the shift, length, shape (3,).
        turn: two points of the axis of the rotation, and its angle in degrees, shape (7,); None
            without one.
    """
    if turn is None:
        return lambda x: x + shift
    pivot = turn[:3]
    axis = turn[3:6] - turn[:3]
    if not (size := float(np.linalg.norm(axis))) > 0:
        raise ValueError("the axis of the rotation has no length")
    matrix = turning(tuple(plain(turn[6] / size * axis)), 3)
    return lambda x: (x + shift - pivot) @ matrix.T + pivot


def _defined(block: DeckBlock) -> list[str]:
    """Return the names that a keyword defines."""
    key = _DEFINING.get(block.keyword)
    return [block.parameters[key]] if key in block.parameters else []


def _names(key: str, value: str) -> bool:
    """Return whether the value of a parameter is a name (the value of ADJUST may be a length)."""
    return key in _NAMING or (key == "ADJUST" and real_or_none(value) is None)


def _largest_number(block: DeckBlock) -> int:
    """Return the largest number in the data lines of *NODE or *ELEMENT, 0 for other keywords."""
    rows = block.rows if block.keyword in ("NODE", "ELEMENT") else []
    words = (word for row in rows for word in (row[:1] if block.keyword == "NODE" else row))
    return max((int(word) for word in words if word.isdecimal()), default=0)


@dataclass(frozen=True)
class _Names:
    """The unique names and numbers of the instances of a file."""

    whole: _Scope  # all that is outside of instances
    instances: dict[str, _Scope]  # by their names in capitals
    counts: Counter[str]  # how many scopes have each name

    def word(self, word: str, scope: _Scope) -> str:
        """Return the unique name of a set, surface, node or element of a scope."""
        prefix, dot, suffix = word.partition(".")
        if dot and (candidate := self.instances.get(prefix.strip().upper())) is not None:
            return self.word(suffix.strip(), candidate)
        if word.isdecimal():
            return str(int(word) + scope.first)
        if scope is self.whole or word.upper() not in scope.names:
            return word
        return word if self.counts[word.upper()] == 1 else f"{scope.name}.{word}"

    def written(self, block: DeckBlock, scope: _Scope) -> DeckBlock:
        """Return a keyword of a scope with unique names and numbers."""
        inside = self.instances.get(block.word("INSTANCE"), scope)
        defined_names = _defined(block)
        parameters = {
            key: self.word(value, scope)
            if _names(key, value) or [value] == defined_names
            else value
            for key, value in block.parameters.items()
        }
        try:
            rows = block.rows if scope.move is None else _moved(block, scope.move)
        except ValueError as error:
            raise DeckError(block, str(error)) from None
        count = 2 if "GENERATE" in block.parameters else _REFERRING.get(block.keyword, 0)
        rows = [
            [self.word(word, inside) for word in row[:count]] + row[len(row[:count]) :]
            for row in rows
        ]
        return replace(block, parameters=parameters, texts=[",".join(row) or "," for row in rows])


def _moved(block: DeckBlock, move: _Motion) -> Sequence[list[str]]:
    """Return the data lines of a keyword of a part, with nodes at the place of the instance."""
    rows = block.rows
    if block.keyword == "NODE" and rows:
        _, x = coordinates(block)
        moved = move(np.pad(x, ((0, 0), (0, 3 - x.shape[1]))))
        flat = x.shape[1] < 3 and not moved[:, 2].any()
        return [
            [row[0], *map(repr, point)]
            for row, point in zip(rows, plain(moved[:, : 2 if flat else 3]), strict=True)
        ]
    return rows
