"""What two programs have printed for the same nodes, side by side.  No dolfinx here."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

from signorini_fx.addons.gauntlet.outcomes import ComparedQuantity
from signorini_fx.addons.gauntlet.printed_tables import PrintedTable
from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.files.shape import Floats
from signorini_fx.tuned import DIGITS_OF_FILES

Tables = Mapping[tuple[str, str], list[PrintedTable]]
# Of each table the quantity, how many of its components are compared, and the names of these.
_NODAL = {
    "displacements": ("displacement", 3, "xyz"),
    "contact stress": ("contact pressure", 1, ("",)),
}


def compared(theirs: Tables, ours: Tables, finer: Mapping[int, Floats] | None = None) -> Iterator[ComparedQuantity]:
    """Each quantity of the last time that both have.

    Args:
        theirs: their tables.
        ours: ours.
        finer: our displacement on a finer mesh at the end, by numbers of nodes; None: there is none.
    """
    for key, tables in ours.items():
        pair = next(
            (
                (printed, computed)
                for printed in reversed(theirs.get(key, []))
                for computed in reversed(tables)
                if np.isclose(printed.time, computed.time, rtol=DIGITS_OF_FILES)
            ),
            None,
        )
        if pair is None or pair[0].repeated:  # at points of faces, which are others than ours
            continue
        title, where = key
        at = f" of {where}" if where else ""
        if title in _NODAL:
            name, count, axes = _NODAL[title]
            of_finer = finer if name == "displacement" and pair[1] is tables[-1] else None
            yield from _of_nodes(f"{name}{at}", *pair, count, axes, of_finer)
        elif title == "total force":
            printed, computed = (table.values([0], 3)[0] for table in pair)
            yield _largest(f"total force{at}", printed[None], computed[None], ["xyz"])
        elif title == "forces":
            numbers = sorted(pair[0].rows.keys() & pair[1].rows.keys())
            printed, computed = (table.values(numbers, 3) for table in pair)
            size = float(np.abs(printed).sum(axis=0).max(initial=0.0))
            if size > 0:
                sums, computed_sums = printed.sum(axis=0), computed.sum(axis=0)
                axis = int(np.argmax(np.abs(sums)))
                difference = float(np.abs(sums - computed_sums).max()) / size
                name = f"sum of the forces{at} along {'xyz'[axis]}"
                yield ComparedQuantity(name, float(sums[axis]), float(computed_sums[axis]), difference)


def _of_nodes(
    name: str,
    printed: PrintedTable,
    computed: PrintedTable,
    count: int,
    axes: Sequence[str],
    finer: Mapping[int, Floats] | None,
) -> Iterator[ComparedQuantity]:
    numbers = sorted(printed.rows.keys() & computed.rows.keys())
    if not numbers:
        return
    a, b = printed.values(numbers, count), computed.values(numbers, count)
    labels = [f"{axis} at node {number}".strip() for number in numbers for axis in axes]
    c = None
    if finer is not None and finer.keys() >= set(numbers):
        c = np.array([finer[number] for number in numbers])
    yield _largest(name, a, b, labels, c)


def _largest(
    name: str, theirs: Floats, ours: Floats, labels: list[str], finer: Floats | None = None
) -> ComparedQuantity:
    """The quantity where theirs is largest, with the largest difference of all."""
    size = float(np.abs(theirs).max())
    at = int(np.argmax(np.abs(theirs)))
    scale = size or 1.0
    label = labels[at] if len(labels) == theirs.size else f"{labels[0][at]}"
    of_finer = None
    if finer is not None and finer.shape == theirs.shape and size:
        of_finer = float(np.abs(theirs - finer).max()) / scale, float(np.abs(ours - finer).max()) / scale
    difference = float(np.abs(theirs - ours).max()) / scale
    return ComparedQuantity(
        f"{name}, {label}", float(theirs.ravel()[at]), float(ours.ravel()[at]), difference, finer=of_finer
    )


def compared_displacements(
    theirs: Mapping[int, Floats], ours: Mapping[int, Floats], finer: Mapping[int, Floats] | None
) -> Iterator[ComparedQuantity]:
    """Displacements by numbers of nodes, at the end, of those that both have."""
    printed, computed = (
        PrintedTable("displacements", "", "", 0.0, {node: list(values) for node, values in of.items()})
        for of in (theirs, ours)
    )
    yield from _of_nodes("displacement", printed, computed, 3, "xyz", finer)


def with_exact(file: Path, theirs: Mapping[int, Floats], ours: Mapping[int, Floats]) -> Iterator[ComparedQuantity]:
    """Displacements that are known exactly, of a file with the columns node, component (x, y or z) and value.

    Raises:
        MeshError: the file is not so, or no result has the node.
    """
    if not file.exists():
        return
    with file.open(newline="", encoding="utf-8") as stream:
        entries = list(csv.DictReader(stream))
    for row, entry in enumerate(entries, 2):
        try:
            node, axis, exact = int(entry["node"]), "xyz".index(entry["component"]), float(entry["value"])
            printed, computed = float(theirs[node][axis]), float(ours[node][axis])
        except (ValueError, KeyError, IndexError):
            raise MeshError(
                f"{file}: line {row}: a node of the results, x, y or z, and a number are expected"
            ) from None
        size = abs(printed) or 1.0
        name = f"displacement, {entry['component']} at node {node}"
        yield ComparedQuantity(name, printed, computed, abs(printed - computed) / size, exact)
