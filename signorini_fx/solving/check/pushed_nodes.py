"""Supports that push the body into its foundation: contact nodes that cannot move along their normal, and lie inside.

No displacement is admissible there, so that no contact pressure keeps the node outside: the supports take whatever it
would be.  The node transmits nothing in contact (``complementarity.trial_pressure``), and the result must say so.  Of
two bodies it is a node that supports hold on both sides, and that has no contact point (``obstacles.held_pairs``).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from mpi4py import MPI

from signorini_fx.algebra.contact.points import pushed
from signorini_fx.machine import parallel
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.rigid.motion_names import rounded
from signorini_fx.records import Finding
from signorini_fx.tuned import SAME_LENGTH

if TYPE_CHECKING:
    from signorini_fx.mechanics.obstacles.paired_points import PairedSides

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class HeldNodes:
    """Contact nodes of this rank, of which those with a depth are held inside, n of them.

    Attributes:
        part: the contact, from 0, shape (n,).
        depth: how far they are inside the foundation or the other body, length, shape (n,).
        off: whether contact cannot open there, so that they may be off it, shape (n,).
        paired: whether it is another body, shape (n,).
        x: position, length, shape (n, d).
    """

    part: npt.NDArray[np.int32]
    depth: Array
    off: npt.NDArray[np.bool_]
    paired: npt.NDArray[np.bool_]
    x: Array

    @property
    def rows(self) -> Array:
        """All of it as one array, shape (n, 4 + d)."""
        return np.column_stack((self.part, self.depth, self.off, self.paired, self.x)).astype(np.float64)


def held_in_result(
    contact: ContactState | None, displacement: fem.Function, pairs: Mapping[int, PairedSides]
) -> list[HeldNodes]:
    """Those of a load step; collective."""
    if contact is None:
        return []
    boundary = contact.boundary
    single = np.zeros(boundary.size, dtype=bool)
    points = HeldNodes(boundary.part, contact.held_inside, contact.bilateral, single, boundary.x)
    owned = displacement.function_space.dofmap.index_map.size_local
    y = displacement.x.array.reshape(-1, boundary.x.shape[1])[:owned]
    return [points, *_held_pairs(y, pairs, boundary.comm)]


def _held_pairs(y: Array, pairs: Mapping[int, PairedSides], comm: MPI.Comm) -> list[HeldNodes]:
    """Those of pairs."""
    nodes = []
    for part, pair in pairs.items():
        if (held := pair.held) is not None:
            count = len(held.nodes)
            off, paired = np.full(count, held.bilateral), np.ones(count, dtype=bool)
            nodes.append(HeldNodes(np.full(count, part, np.int32), held.inside(y, comm), off, paired, held.x))
    return nodes


def pushed_nodes(comm: MPI.Comm, steps: Sequence[Sequence[HeldNodes]], size: float) -> list[Finding]:
    """One finding for each contact with such nodes, from the load step where one lies deepest; collective.

    Args:
        comm: the ranks.
        steps: the nodes of each load step.
        size: of the body, length.
    """
    deepest: dict[int, tuple[float, str]] = {}
    for nodes in steps:
        for held in nodes:
            rows = np.unique(parallel.gather_rows(comm, held.rows[pushed(held.depth, size)]), axis=0)
            for part in np.unique(rows[:, 0]).astype(int):
                of_part = rows[rows[:, 0] == part, 1:]
                depth = float(of_part[:, 0].max())
                if depth > deepest.get(part, (0.0, ""))[0]:
                    deepest[part] = depth, _message(of_part, depth, size)
    return [Finding("warning", f"contact[{part}], displacement", deepest[part][1]) for part in sorted(deepest)]


def _message(rows: Array, depth: float, size: float) -> str:
    """Of the nodes of one contact, ``HeldNodes.rows`` without the part."""
    # The first of those that are as deep, whatever the number of ranks.
    most = rows[rows[:, 0] >= depth - SAME_LENGTH * size]
    length, bilateral, paired, *place = most[np.lexsort(most[:, 3:].T[::-1])[0]]
    at = ", ".join(rounded(c, size) for c in place)
    where = f"{'off' if bilateral else 'inside'} {'the other body' if paired else 'the foundation'}"
    nodes, they = ("node", "it transmits") if len(rows) == 1 else ("nodes", "they transmit")
    beside = ", and forces beside grow without limit on finer meshes" if paired and not bilateral else ""
    return (
        f"supports hold {len(rows)} contact {nodes} {where}, by {length:.3g} at ({at}): {they} nothing, the "
        f"supports carry what acts there{beside}; check the gap beside them, or end the contact boundary before them"
    )
