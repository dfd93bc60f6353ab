"""The contact boundary as a table: nodes of all ranks in order along the boundary, and the zones on it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx import parallel
from signorini_fx.body.contact_boundary import chains
from signorini_fx.contact.state import ContactState


@dataclass(frozen=True)
class ContactTable:
    """The contact boundary as a table, gathered from all ranks, nodes in order along each boundary.

    Attributes:
        columns: name -> one entry a node.  ``state`` is open, stick, slip+ or slip-; ``friction`` is stick, slip+,
            slip- or, where the bound is 0, none, whether or not the node is in contact (Tresca friction acts on open
            nodes too).
        chains: the connected pieces of the boundary, as ranges of rows.
        nodes: position of the boundary in ``scene.contact`` and global number of the node, shape (rows, 2); None for a
            table that belongs to no mesh.
    """

    columns: dict[str, npt.NDArray[Any]]
    chains: list[range]
    nodes: npt.NDArray[np.int64] | None = None

    def zones(self, mask: npt.NDArray[np.bool_]) -> list[list[list[float]]]:
        """Runs of neighbouring nodes where ``mask`` holds, each as [first point, last point]."""
        x, y = self.columns["x"], self.columns["y"]
        runs = []
        for chain in self.chains:
            start = None
            for row in [*chain, None]:
                inside = row is not None and bool(mask[row])
                if inside and start is None:
                    start = row
                if not inside and start is not None:
                    last = row - 1 if row is not None else chain[-1]
                    runs.append([[float(x[start]), float(y[start])], [float(x[last]), float(y[last])]])
                    start = None
        return runs


def contact_table(contact: ContactState, names: list[str]) -> ContactTable:
    """Gather the contact nodes of all ranks and put them in order along the boundary; the same on every rank.

    Args:
        contact: the nodes of this rank.
        names: name of the boundary of each effect in ``scene.contact``.
    """
    boundary = contact.boundary
    numbers = parallel.gather_rows(boundary.comm, np.column_stack((boundary.part, boundary.global_nodes)))
    local = np.column_stack(
        [
            boundary.x,
            contact.gap,
            contact.u_n,
            contact.u_t[:, 0],
            contact.pressure,
            contact.shear[:, 0],
            contact.bound,
            contact.in_contact,
            contact.sliding_sign(),
            contact.slip_length[:, 0],
            boundary.normal,
            boundary.weight,
        ]
    )
    rows = parallel.gather_rows(boundary.comm, local)
    segments = parallel.gather_rows(boundary.comm, boundary.segments)
    pieces, order = chains(numbers, segments, rows[:, :2])
    rows, part = rows[order], numbers[order, 0]
    x, y, gap, u_n, u_t, pressure, shear, bound, touching, slip, slip_length, n_x, n_y, weight = rows.T
    sliding = np.where(slip > 0, "slip+", np.where(slip < 0, "slip-", "stick"))
    friction = np.where(bound > 0, sliding, "none")
    along = np.zeros(x.size)
    for chain in pieces:
        steps = np.hypot(np.diff(x[chain.start : chain.stop]), np.diff(y[chain.start : chain.stop]))
        along[chain.start + 1 : chain.stop] = np.cumsum(steps)
    columns = {
        "x": x,
        "y": y,
        "gap": gap,
        "u_n": u_n,
        "u_t": u_t,
        "pressure": pressure,
        "shear": shear,
        "bound": bound,
        "state": np.where(touching > 0, sliding, "open"),
        "friction": friction,
        "slip": slip_length,
        "boundary": np.array(names)[part.astype(int)],
        "s": along,
        "n_x": n_x,
        "n_y": n_y,
        "weight": weight,
    }
    return ContactTable(columns, pieces, numbers[order])
