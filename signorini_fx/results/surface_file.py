"""The contact surface of a body in 3D as a file for ParaView: its facets with all columns of the table."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.averages import to_owners
from signorini_fx.mechanics.assembly.mesh_entities import node_positions
from signorini_fx.mechanics.contact_points.contact_table import ContactTable
from signorini_fx.results.solution import Solution
from signorini_fx.results.vtu import write_vtu

Array = npt.NDArray[np.float64]
# VTK's number of a facet with this many nodes, and its order of basix's nodes: vertices, then edges, then the rest.
_KINDS = {3: (5, [0, 1, 2]), 4: (9, [0, 1, 3, 2]), 9: (28, [0, 1, 3, 2, 4, 6, 7, 5, 8])}
_STATES = ("open", "stick", "slip")


def facets_of(table: ContactTable) -> npt.NDArray[np.int64]:
    """The rows of a table in 3D at the nodes of each facet in the order of VTK, shape (m, 3), (m, 4) or (m, 9)."""
    assert table.facets is not None
    facets = table.facets[(table.facets >= 0).all(axis=1)]
    return facets[:, _KINDS[facets.shape[1]][1]]


def write_surface(path: Path, table: ContactTable) -> None:
    """A .vtu file of the contact surface; on one rank."""
    c = table.columns
    fields: dict[str, npt.NDArray[Any]] = {
        name: c[name] for name in ("pressure", "gap", "u_n", "bound", "shear", "slip", "u_t", "weight")
    }
    fields |= {
        f"{name} vector": np.column_stack([c[f"{name}_{axis}"] for axis in "xyz"]) for name in ("shear", "slip", "u_t")
    }
    fields["normal"] = np.column_stack([c[f"n_{axis}"] for axis in "xyz"])
    fields["state (0 open, 1 stick, 2 slip)"] = np.array([_STATES.index(state) for state in c["state"]])
    points = np.column_stack([c[axis] for axis in "xyz"])
    facets = facets_of(table)
    write_vtu(path, MPI.COMM_SELF, points, facets, _KINDS[facets.shape[1]][0], fields)


def other_side(solution: Solution) -> dict[str, npt.NDArray[Any]]:
    """Tractions and distances at the nodes of the boundaries that contacts are ``against``, ordered by their places.

    They are means of those at the contact points that see a node, by |M_il| w_i of ``pairs.coupling``; collective.

    Returns:
        Name -> one entry per node, on every rank: x, y, in 3D z; boundary, and against, on which the contact points
        are; pressure; shear_x and so on, what this body exerts on the other one; distance of the deformed bodies
        along the normal.  Empty where no two bodies are in contact.
    """
    statement, tagged, contact = solution.statement, solution.model.tagged, solution.contact
    if contact is None or statement.sides[1] is None:
        return {}
    space, boundary = solution.displacement.function_space, contact.boundary
    dim, owned = tagged.dimension, space.dofmap.index_map.size_local
    x = np.array(node_positions(space)[:owned, :dim], dtype=np.float64)
    blocks = []
    for part, side in enumerate(solution.sides):
        if (pair := side.pair) is None:
            continue
        points = np.flatnonzero(boundary.part == part)
        points = points[np.argsort(boundary.nodes[points], kind="stable")]
        distance = contact.gap[points] - contact.u_n[points]
        shear = np.einsum("ijk,ik->ij", boundary.tangents, contact.shear)[points]
        values = np.column_stack((contact.pressure[points], -shear, distance))
        shares = abs(pair.others).T * pair.weight
        rows = to_owners(np.column_stack((shares @ values, shares.sum(axis=1))), pair.reached, pair.comm, owned)
        nodes = np.flatnonzero(rows[:, -1] > 0)
        means = rows[nodes, :-1] / rows[nodes, -1:]
        blocks.append(np.column_stack((np.full(nodes.size, part), x[nodes], means)))
    gathered = parallel.gather_rows(tagged.mesh.comm, np.concatenate(blocks))
    parts, places, pressure, traction, apart = np.split(gathered, np.cumsum([1, dim, 1, dim]), axis=1)
    order = np.lexsort((*places.T[::-1], parts[:, 0]))
    names = [[effect.against or "", effect.boundary] for effect in statement.contact]
    sides = np.array(names)[parts[order, 0].astype(int)]
    return {
        **dict(zip("xyz", places[order].T, strict=False)),
        "boundary": sides[:, 0],
        "against": sides[:, 1],
        "pressure": pressure[order, 0],
        **{f"shear_{axis}": column for axis, column in zip("xyz", traction[order].T, strict=False)},
        "distance": apart[order, 0],
    }
