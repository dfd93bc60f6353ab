"""Values of the contact boundary of one mesh at the contact nodes of another one."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.spatial import cKDTree

from signorini_fx.mechanics.contact_points.contact_table import ContactTable
from signorini_fx.results.accuracy.contact_surface import ContactSurface


def places(table: ContactTable) -> npt.NDArray[np.float64]:
    """The positions of the nodes in 2D, length, shape (rows, 2)."""
    return np.column_stack((table.columns["x"], table.columns["y"]))


def interpolated(coarse: ContactTable, fine: ContactTable, name: str) -> npt.NDArray[np.float64]:
    """A column of the coarse table at the nodes of the fine one, interpolated on the facet that is nearest there.

    Arc lengths would not do: that of a curve grows with the facets, and between two bodies pieces begin elsewhere.
    """
    if fine.facets is not None:
        return _interpolated_in_space(coarse, fine, name)
    x, old, column = places(fine), places(coarse), coarse.columns[name]
    previous_node, next_node = np.arange(len(old)), np.arange(len(old))
    for path in coarse.paths:
        next_node[path[:-1]], previous_node[path[1:]] = path[1:], path[:-1]
    values, nearest = np.zeros(len(x)), np.full(len(x), np.inf)
    of_fine, of_coarse = fine.columns["boundary"], coarse.columns["boundary"]
    for boundary in np.unique(of_fine):
        fine_rows, coarse_rows = np.flatnonzero(of_fine == boundary), np.flatnonzero(of_coarse == boundary)
        if not coarse_rows.size:
            continue
        node = coarse_rows[cKDTree(old[coarse_rows]).query(x[fine_rows])[1]]
        for neighbour in (previous_node[node], next_node[node]):
            side, away = old[neighbour] - old[node], x[fine_rows] - old[node]
            square = (side**2).sum(axis=1)
            share = np.divide((side * away).sum(axis=1), square, out=np.zeros(fine_rows.size), where=square > 0)
            share = np.clip(share, 0.0, 1.0)
            distance = np.linalg.norm(share[:, None] * side - away, axis=1)
            candidate = column[node] + share * (column[neighbour] - column[node])
            values[fine_rows] = np.where(distance < nearest[fine_rows], candidate, values[fine_rows])
            nearest[fine_rows] = np.minimum(distance, nearest[fine_rows])
    return values


def _interpolated_in_space(coarse: ContactTable, fine: ContactTable, name: str) -> npt.NDArray[np.float64]:
    surface, c = ContactSurface.of(coarse), fine.columns
    x = np.column_stack([c[axis] for axis in "xyz"])
    values = np.zeros(len(x))
    assert fine.nodes is not None
    for part in np.unique(surface.part):
        on_part = fine.nodes[:, 0] == part
        values[on_part] = surface.at(x[on_part], coarse.columns[name][:, None], int(part))[:, 0]
    return values
