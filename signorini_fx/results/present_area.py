"""The contact pressure of bodies at finite strains per area of their deformed boundary.

Contact tractions are unknowns per area of the undeformed boundary; a gauge between two bodies
measures forces per deformed area.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from dolfinx import fem

from signorini_fx.arrays import Array, Ints
from signorini_fx.machine import parallel
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.contact_points.contact_table import ContactTable
from signorini_fx.results.accuracy.contact_surface import ContactSurface, places


def present_pressure(
    table: ContactTable, contact: ContactState, displacement: fem.Function, *, revolved: bool
) -> Array:
    """Return the pressure at each row of a contact table per deformed area, which is that between
    the displaced nodes, shape (rows,).  Collective.

    Args:
        table: the contact table.
        contact: the contact state of this rank.
        displacement: y.
        revolved: whether the body is axisymmetric, so that areas are those of rings.
    """
    boundary = contact.boundary
    size = displacement.function_space.dofmap.index_map_bs
    moved = displacement.x.array.reshape(-1, size)[boundary.nodes]
    rows = np.column_stack((boundary.part, boundary.global_nodes, moved))
    gathered = parallel.gather_rows(boundary.comm, rows[boundary.at_nodes])
    assert table.nodes is not None
    order = np.lexsort(gathered[:, 1::-1].T)
    at = np.empty(len(order), dtype=np.int64)
    at[np.lexsort(table.nodes[:, ::-1].T)] = order
    u = gathered[at, 2:]
    stretch = np.ones(len(u))
    before = np.zeros(len(u))
    after = np.zeros(len(u))
    if table.facets is not None:
        surface = ContactSurface.of(table)
        corners = surface.corners
        areas = surface.area, replace(surface, x=surface.x + u).area
    else:
        corners = np.concatenate([np.column_stack((path[:-1], path[1:])) for path in table.paths])
        x = places(table)
        areas = _lengths(x, corners), _lengths(x + u[:, :2], corners)
        if revolved:
            around = x[corners, 0].sum(axis=1)
            turned = (x + u[:, :2])[corners, 0].sum(axis=1)
            areas = areas[0] * around, areas[1] * turned
    for total, area in zip((before, after), areas, strict=True):
        np.add.at(total, corners, area[:, None])
    np.divide(after, before, out=stretch, where=(before > 0) & (after > 0))
    return table.columns["pressure"] / stretch


def _lengths(x: Array, corners: Ints) -> Array:
    """Return the length of each interval, shape (intervals,)."""
    return np.linalg.norm(x[corners[:, 1]] - x[corners[:, 0]], axis=1)
