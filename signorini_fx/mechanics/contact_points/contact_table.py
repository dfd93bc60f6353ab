"""The contact boundary as a table: the nodes of all ranks in a fixed order, and in 2D its zones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate, chain, pairwise
from typing import TYPE_CHECKING

import numpy as np

from signorini_fx.arrays import Array, Column, Flags, Ints, length
from signorini_fx.machine import parallel
from signorini_fx.machine.display import clean, dataframe, html_table
from signorini_fx.mechanics.contact_points.contact_state import ContactState

if TYPE_CHECKING:
    import pandas

# Rows of a table that a notebook shows.
_SHOWN_ROWS = 20


@dataclass(frozen=True, repr=False)
class ContactTable:
    """The contact boundary as a table, gathered from all ranks, nodes in order along each boundary.

    Attributes:
        columns: one entry per node, by name.  ``state`` is open, stick, slip+ or slip-, in 3D open,
            stick or slip.  ``friction`` has the same values without open, whether or not the node
            is in contact (Tresca friction acts on open nodes too), and none where the bound is 0.
            ``u_t``, ``shear`` and ``slip`` are along the tangent; in 3D, and on a section with
            torsion, they are lengths of vectors, whose components follow as ``u_t_x`` and so on.
            Between two bodies ``against`` names the other boundary.
        chains: the connected pieces of the boundary in 2D, as ranges of rows; empty in 3D.  The
            column ``to_next`` has the distance to the next node along a piece; at the last node it
            is positive if the piece is closed.
        nodes: position of the boundary in ``statement.contact`` and global number of the node,
            shape (rows, 2); None for a table without a mesh.
        facets: in 3D the rows of the nodes of each facet in the order of basix, facets in the order
            of the ranks, -1 for nodes without contact, shape (facets, nodes of a facet); None in
            2D.
    """

    columns: dict[str, Column]
    chains: list[range]
    nodes: Ints | None = None
    facets: Ints | None = None

    def __repr__(self) -> str:
        return f"<ContactTable: {len(self.columns['x'])} nodes, columns {', '.join(self.columns)}>"

    def _repr_html_(self) -> str:
        """Return the first rows as HTML for notebooks, with round-off removed from positions."""
        x = [self.columns[axis] for axis in "xyz" if axis in self.columns]
        extent = max((float(np.ptp(column)) for column in x if column.size), default=0.0)
        first = {name: column[:_SHOWN_ROWS].tolist() for name, column in self.columns.items()}
        rows = list(
            zip(
                *(clean(c, extent) if name in "xyz" else c for name, c in first.items()),
                strict=True,
            )
        )
        return html_table(
            tuple(self.columns),
            rows,
            f"{len(self.columns['x'])} contact nodes, the first {len(rows)}",
        )

    def to_dataframe(self) -> pandas.DataFrame:
        """Return the columns as a ``pandas.DataFrame``, one row per node."""
        return dataframe(self.columns)

    @property
    def touching(self) -> int:
        """The number of nodes in contact."""
        return int(np.count_nonzero(self.columns["state"] != "open"))

    @property
    def paths(self) -> list[Ints]:
        """The rows along each connected piece; a closed piece ends with its first row again."""
        to_next = self.columns.get("to_next")
        closed = [to_next is not None and to_next[piece.stop - 1] > 0 for piece in self.chains]
        return [
            np.array([*c, *c[:1]] if loop else c)
            for c, loop in zip(self.chains, closed, strict=True)
        ]

    def arc(self, path: Ints) -> Array:
        """Return the arc length at the rows of one of ``paths``, from its first row."""
        s = np.array(self.columns["s"][path])
        if is_closed(path):
            s[-1] = s[-2] + self.columns["to_next"][path[-2]]
        return s

    def unrolled(self, path: Ints) -> tuple[Ints, Array, slice]:
        """Return rows and arc lengths along one of ``paths``, and a slice of the intervals between
        them that belong to the path itself.

        A closed path is repeated three times, so that the copy in the middle has no ends.
        """
        s = self.arc(path)
        count = len(path) - 1
        if not is_closed(path):
            return path, s, slice(0, count)
        rows = np.concatenate((path[:-1], path[:-1], path))
        return rows, np.concatenate((s[:-1] - s[-1], s[:-1], s + s[-1])), slice(count, 2 * count)

    def zones(self, mask: Flags) -> list[list[list[float]]]:
        """Return runs of neighbouring nodes where ``mask`` is true, each as [first point, last
        point].

        A run across the first row of a closed piece counts as one; a run all around goes from the
        first row to the last.
        """
        places = np.column_stack((self.columns["x"], self.columns["y"]))
        zones = []
        for path in self.paths:
            rows = path[:-1] if is_closed(path) else path
            enters = np.diff(mask[rows].astype(np.int64), prepend=0, append=0)
            first = rows[np.flatnonzero(enters == 1)]
            last = rows[np.flatnonzero(enters == -1) - 1]
            if is_closed(path) and len(first) > 1 and mask[rows[0]] and mask[rows[-1]]:
                first = first[1:]
                last = np.append(last[1:-1], last[0])
            zones += [
                [places[start].tolist(), places[end].tolist()]
                for start, end in zip(first, last, strict=True)
            ]
        return zones


def is_closed(path: Ints) -> bool:
    """Return whether a path of rows ends at its first row."""
    return path.size > 1 and bool(path[0] == path[-1])


def contact_table(
    contact: ContactState, names: Sequence[str], against: Sequence[str | None] | None = None
) -> ContactTable:
    """Return the table of the contact nodes of all ranks, the same on every rank and for any number
    of ranks; collective.

    In 2D nodes are in order along the boundary, in 3D in the order of their coordinates.

    Args:
        contact: the contact state of this rank.
        names: name of the boundary of each effect in ``statement.contact``.
        against: name of the other boundary of each effect, None without one; None: no contact has
            one, and the table has no such column.
    """
    boundary = contact.boundary
    dim = boundary.x.shape[1] - boundary.kinematics.out_of_section
    nodes = boundary.at_nodes
    numbers = parallel.gather_rows(
        boundary.comm, np.column_stack((boundary.part, boundary.global_nodes))[nodes]
    )
    values = {
        "x": boundary.x[:, :dim],
        "n": boundary.normal[:, :dim],
        "gap": contact.gap,
        "u_n": contact.u_n,
        "u_t": contact.displaced(contact.u_t),
        "pressure": contact.pressure,
        "shear": contact.tangential(contact.shear),
        "slip": contact.displaced(contact.slip_length),
        **({} if contact.speed is None else {"speed": contact.speed}),
        "bound": contact.bound,
        "touching": contact.in_contact,
        "side": contact.sliding_side(),
        "weight": boundary.weight,
        **contact.columns,
    }
    widths = [value.shape[1] if value.ndim == 2 else 1 for value in values.values()]
    rows = parallel.gather_rows(boundary.comm, np.column_stack([*values.values()])[nodes])
    segments = parallel.gather_rows(boundary.comm, boundary.segments)
    if dim == 2:
        pieces, order, closed = _chains(numbers, segments, rows[:, :dim])
        facets = None
    else:
        pieces = []
        closed = []
        order = np.lexsort((*_in_line(rows[:, :dim]).T[::-1], numbers[:, 0])).astype(np.int64)
        facets = _rows_of(numbers[order], segments)
    part = numbers[order, 0]
    of = dict(zip(values, np.split(rows[order], np.cumsum(widths)[:-1], axis=1), strict=True))
    slipping = np.array(
        ["slip-", "stick", "slip+"] if boundary.x.shape[1] == 2 else ["", "stick", "slip"]
    )
    state = slipping[of["side"][:, 0].astype(int) + 1]
    columns = {
        **dict(zip("xyz", of["x"].T, strict=False)),
        **_components("gap", of["gap"]),
        **_components("u_n", of["u_n"]),
        **_components("u_t", of["u_t"]),
        **_components("pressure", of["pressure"]),
        **_components("shear", of["shear"]),
        **_components("bound", of["bound"]),
        "state": np.where(of["touching"][:, 0] > 0, state, "open"),
        "friction": np.where(of["bound"][:, 0] > 0, state, "none"),
        **_components("slip", of["slip"]),
        **(_components("speed", of["speed"]) if "speed" in of else {}),
        **{name: of[name][:, 0] for name in contact.columns},
        "boundary": np.array(names)[part.astype(int)],
        **(
            {}
            if against is None
            else {"against": np.array([body or "" for body in against])[part.astype(int)]}
        ),
        **(_along(of["x"], pieces, closed) if dim == 2 else {}),
        **dict(zip(("n_x", "n_y", "n_z"), of["n"].T, strict=False)),
        **_components("weight", of["weight"]),
    }
    return ContactTable(columns, pieces, numbers[order], facets)


def _in_line(x: Array) -> Array:
    """Return positions divided by the largest extent, shape (n, d), rounded: otherwise round-off
    would order points on one line.
    """
    extent = float(np.ptp(x, axis=0).max()) if len(x) > 1 else 0.0
    return np.round(x / extent, 9) if extent > 0 else np.zeros_like(x)


def _chains(numbers: Ints, segments: Ints, x: Array) -> tuple[list[range], Ints, list[bool]]:
    """Return the connected pieces as ranges of rows, the nodes in this order, and whether each
    piece is closed.

    The result does not depend on the numbering of nodes or the number of ranks.
    """
    keys = [*zip(numbers.T[0], *_in_line(x).T, strict=True)]
    row_of = {
        (int(part), int(node)): row for row, (part, node) in enumerate(zip(*numbers.T, strict=True))
    }
    neighbours: list[list[int]] = [[] for _ in keys]
    for part, *nodes in segments:
        path = [row_of[number] for node in nodes if (number := (int(part), int(node))) in row_of]
        for a, b in pairwise(path):
            neighbours[a].append(b)
            neighbours[b].append(a)
    rows = sorted(range(len(keys)), key=keys.__getitem__)
    ends = [row for row in rows if len(neighbours[row]) <= 1]
    seen = set[int]()
    paths = list[list[int]]()
    for start in [*ends, *rows]:
        path = list[int]()
        row = None if start in seen else start
        while row is not None:
            path.append(row)
            seen.add(row)
            further = [near for near in neighbours[row] if near not in seen]
            row = min(further, key=keys.__getitem__) if further else None
        paths += [path] if path else []
    paths.sort(key=lambda path: keys[path[0]])
    closed = [len(path) > 2 and path[0] in neighbours[path[-1]] for path in paths]
    limits = pairwise(accumulate(map(len, paths), initial=0))
    return [range(a, b) for a, b in limits], np.array([*chain(*paths)], dtype=np.int64), closed


def _rows_of(numbers: Ints, segments: Ints) -> Ints:
    """Return ``ContactTable.facets``.

    Args:
        numbers: part and global node number of each row.
        segments: see ``ContactBoundary.segments``.
    """
    base = int(segments[:, 1:].max(initial=0)) + 1
    row_keys = numbers[:, 0] * base + numbers[:, 1]
    wanted = segments[:, :1] * base + segments[:, 1:]
    order = np.argsort(row_keys)
    rows = order[np.minimum(np.searchsorted(row_keys[order], wanted), row_keys.size - 1)]
    return np.where(row_keys[rows] == wanted, rows, -1)


def _components(name: str, vectors: Array) -> dict[str, Array]:
    """Return values as columns; tangential vectors in 3D give their length and their components."""
    if vectors.shape[1] == 1:
        return {name: vectors[:, 0]}
    return {
        name: length(vectors),
        **{f"{name}_{axis}": vectors[:, k] for k, axis in enumerate("xyz")},
    }


def _along(x: Array, pieces: list[range], closed: list[bool]) -> dict[str, Array]:
    """Return the columns ``s``, arc length from the beginning of each connected piece, and
    ``to_next``, distance to the next node.
    """
    along = np.zeros(len(x))
    to_next = np.zeros(len(x))
    for piece, loop in zip(pieces, closed, strict=True):
        rows = slice(piece.start, piece.stop)
        to_next[rows] = np.hypot(*(np.roll(x[rows], -1, axis=0) - x[rows]).T)
        along[piece.start + 1 : piece.stop] = np.cumsum(to_next[piece.start : piece.stop - 1])
        if not loop:
            to_next[piece.stop - 1] = 0.0
    return {"s": along, "to_next": to_next}
