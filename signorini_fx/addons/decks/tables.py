"""Results at the nodes of a deck as CalculiX writes them: the tables of a .dat file, and a .frd file for cgx."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from itertools import chain
from pathlib import Path

import numpy as np

from signorini_fx.addons.decks.content import Deck
from signorini_fx.addons.decks.node_results import NodeResults, at_nodes
from signorini_fx.errors import OutputError, cannot_be_written
from signorini_fx.machine import manifest, parallel
from signorini_fx.mechanics.mesh.files.abaqus_blocks import DeckBlock
from signorini_fx.mechanics.mesh.files.arrays import plain
from signorini_fx.mechanics.mesh.files.cells import dimension
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints
from signorini_fx.results.solution import Solution

# Numbers of elements in .frd files.  Of those with nodes on edges the ones on upright edges come before those on top.
_FRD = {
    **{"hexahedron": 1, "wedge": 2, "tetra": 3, "hexahedron20": 4, "wedge15": 5, "tetra10": 6},
    **{"triangle": 7, "triangle6": 8, "quad": 9, "quad8": 10},
}
_UPRIGHT = {
    "hexahedron20": [*range(12), *range(16, 20), *range(12, 16)],
    "wedge15": [*range(9), 12, 13, 14, 9, 10, 11],
}
_NODE_TABLES = {"U": ("displacements (vx,vy,vz)", "displacement"), "RF": ("forces (fx,fy,fz)", "forces")}
_CONTACT_TABLES = {
    "CDIS": ("relative contact displacement (slave node,normal,tang1,tang2)", slice(0, 3)),
    "CSTR": ("contact stress (slave node,press,tang1,tang2)", slice(3, 6)),
}
_FIELDS = (
    ("DISP", ("D1", "D2", "D3"), 2),
    ("STRESS", ("SXX", "SYY", "SZZ", "SXY", "SYZ", "SZX"), 4),
    ("FORC", ("F1", "F2", "F3"), 2),
    ("CONTACT", ("COPEN", "CSLIP1", "CSLIP2", "CPRESS", "CSHEAR1", "CSHEAR2"), 4),
)
_ALL = "ALL"  # the name of all nodes
_TENSOR = ((1, 1), (2, 2), (3, 3), (1, 2), (2, 3), (3, 1))


def write_tables(solution: Solution, deck: Deck | None, folder: Path, name: str) -> list[Path]:
    """Write NAME.dat and NAME.frd into a result folder, unless the mesh was refined; collective.

    Args:
        solution: what to write.
        deck: on the first rank what was read from the deck.
        folder: the result folder.
        name: that of the deck.

    Raises:
        OutputError: a file cannot be written, or is in the way.
    """
    steps = list(at_nodes(solution, deck)) if solution.converged else []

    def write() -> list[Path]:
        moments = [moment for moment in steps if moment is not None]
        if deck is None or not moments:
            return []
        if len(moments) == 1:
            moments *= max(1, len(deck.steps))
        files = [folder / f"{name}.{kind}" for kind in ("dat", "frd")]
        texts = ("".join(dat(deck, moments)), "".join(frd(deck, moments)))
        for file, text in zip(files, texts, strict=True):
            if manifest.foreign(folder, [file.name]):
                raise OutputError(f"{file}: already exists, and is no result: remove it")
            try:
                file.write_text(text, encoding="utf-8")
                manifest.add(folder, [file.name])
            except OSError as error:
                raise cannot_be_written(file, error) from None
        return files

    return parallel.on_root(solution.comm, write)


def dat(deck: Deck, moments: Sequence[NodeResults]) -> Iterator[str]:
    """The tables that the deck asks for, step by step; what it asks for in a step it gets in later ones, too.

    Steps that the scene has not, as they are of another kind, have no tables, and the others have their numbers.
    """
    names = deck.names
    requests: dict[str, list[DeckBlock]] = {}
    by_step: list[list[DeckBlock]] = []
    fresh: set[str] = set()
    last = DeckBlock("ENDSTEP", {}, 0)  # which a file may lack
    for block in (*deck.model.blocks, last):
        match block.keyword:
            case "STEP":
                fresh = set()
            case "NODEPRINT" | "CONTACTPRINT":
                if block.keyword not in fresh:
                    requests[block.keyword] = []
                    fresh.add(block.keyword)
                requests[block.keyword].append(block)
            case "ENDSTEP":
                by_step.append(list(chain(*requests.values())))
    for step, (moment, file_step) in enumerate(zip(moments, deck.taken or range(len(by_step)), strict=False)):
        if file_step is None:
            continue
        time = deck.ends.get(step, step + 1.0)
        yield f"\n{'':24}S T E P {file_step + 1:7d}\n\n\n{'':32}INCREMENT     1\n\n"
        for block in by_step[file_step]:
            wanted = [word.upper()[:4] for row in block.rows for word in row]
            for word in wanted:
                if block.keyword == "NODEPRINT" and word in _NODE_TABLES:
                    yield from _node_table(deck, block, word, moment, names, time)
                elif block.keyword == "CONTACTPRINT" and word in _CONTACT_TABLES:
                    title, columns = _CONTACT_TABLES[word]
                    touching = ~np.isnan(moment.contact[:, 0])
                    yield f"\n {title} for all contact elements and time{_time(time)}\n\n"
                    yield from _rows(names[touching], moment.contact[touching, columns])


def _node_table(
    deck: Deck, block: DeckBlock, word: str, moment: NodeResults, names: Ints, time: float
) -> Iterator[str]:
    name = block.parameters.get("NSET", "")  # without a set all nodes are meant, as in Abaqus
    rows = np.searchsorted(deck.numbers, deck.nodes(name)) if name else np.arange(len(names))
    rows = rows[np.argsort(names[rows])]
    title, attribute = _NODE_TABLES[word]
    values: Floats = getattr(moment, attribute)[rows]
    totals = block.parameters.get("TOTALS", "NO").upper()
    if totals != "ONLY" or word == "U":
        yield f"\n {title} for set {name.upper() or _ALL} and time {_time(time)}\n\n"
        yield from _rows(names[rows], values)
    if totals != "NO" and word == "RF":
        yield f"\n total force (fx,fy,fz) for set {name.upper() or _ALL} and time {_time(time)}\n\n"
        yield f"       {_numbers(plain(values.sum(axis=0)))}\n"


def _time(time: float) -> str:
    """As Fortran's E14.7 writes it."""
    digits, _, exponent = f"{time:.6E}".partition("E")
    power = int(exponent) + 1 if float(digits) else 0
    return f" 0.{digits.replace('.', '')}E{power:+03d}"


def _numbers(row: list[float]) -> str:
    return "".join(f" {value:13.6E}" for value in row)


def _rows(names: Ints, values: Floats) -> Iterator[str]:
    for name, row in zip(plain(names), plain(values), strict=True):
        yield f"{name:10d}{_numbers(row)}\n"


def frd(deck: Deck, moments: Sequence[NodeResults]) -> Iterator[str]:
    """Mesh and fields for cgx."""
    names = deck.names
    yield f"    1C{deck.title[:60]}\n    1UDATE              {datetime.now(UTC):%d.%B.%Y}\n"
    yield f"    2C                  {len(names):12d}{'':37}1\n"
    points = np.pad(deck.mesh.points[: len(names)], ((0, 0), (0, 3 - deck.mesh.dim)))
    yield from _frd_rows(names, points)
    body = [(kind, nodes) for kind, nodes in deck.model.raw.blocks if dimension(kind) == deck.mesh.dim and kind in _FRD]
    yield f"    3C                  {sum(len(nodes) for _, nodes in body):12d}{'':37}1\n"
    number = 0
    for kind, nodes in body:
        listed = names[np.searchsorted(deck.numbers, nodes)][:, _UPRIGHT.get(kind, slice(None))]
        for row in plain(listed):
            number += 1
            yield f" -1{number:10d}{_FRD[kind]:5d}{0:5d}{1:5d}\n"
            for first in range(0, len(row), 10):
                yield f" -2{''.join(f'{node:10d}' for node in row[first : first + 10])}\n"
    yield " -3\n"
    block = 0
    file_steps = deck.taken or range(len(moments))
    for step, (moment, file_step) in enumerate(zip(moments, file_steps, strict=False)):
        if file_step is None:
            continue
        stress = moment.stress[:, [0, 1, 2, 3, 5, 4]]
        values = (moment.displacement, stress, moment.forces, np.nan_to_num(moment.contact))
        for (title, components, kind_of_field), field in zip(_FIELDS, values, strict=True):
            block += 1
            yield f"    1PSTEP{block:26d}{1:12d}{file_step + 1:12d}\n"
            yield f"  100CL{100 + block:5d}{deck.ends.get(step, step + 1.0):12.5E}{len(names):12d}{'':20}{0:2d}"
            yield f"{file_step + 1:5d}{'':10}{1:2d}\n"
            yield f" -4  {title:8}{len(components) + (kind_of_field == 2):5d}    1\n"
            for k, component in enumerate(components):
                first, second = (k + 1, 0) if kind_of_field == 2 else _TENSOR[k]
                yield f" -5  {component:8}{1:5d}{kind_of_field:5d}{first:5d}{second:5d}\n"
            if kind_of_field == 2:
                yield f" -5  {'ALL':8}{1:5d}{2:5d}{0:5d}{0:5d}{1:5d}ALL\n"
            yield from _frd_rows(names, field)
    yield " 9999\n"


def _frd_rows(names: Ints, values: Floats) -> Iterator[str]:
    for name, row in zip(plain(names), plain(values), strict=True):
        yield f" -1{name:10d}{''.join(f'{value:12.5E}' for value in row)}\n"
    yield " -3\n"
