"""Loads within open contact as the certificate sees them: from the scene, the mesh and the pressure of the contact."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, laplacian
from scipy.sparse.linalg import spsolve

from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import facet_nodes
from signorini_fx.mechanics.contact_points.joint_pressure import Flags
from signorini_fx.results.certificate.contact_nodes import ContactNodes, ContactSide
from signorini_fx.results.certificate.nodal_forces import NodalForces
from signorini_fx.results.certificate.promised_law import PreviousStep, Tractions
from signorini_fx.results.certificate.surface_quadrature import SurfaceQuadrature
from signorini_fx.tuned import ZERO_IN_SOLUTION

Array = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int64]


def forces_of_joint_loads(forces: SurfaceQuadrature, sides: Sequence[ContactSide], tractions: Tractions) -> Array:
    """The forces of the loads within contact on the body, shape (owned nodes, d); collective."""
    assert tractions.joint is not None
    alone = replace(tractions, pressure=tractions.joint.pressure, shear=np.zeros_like(tractions.shear))
    reached, pushing, _ = ContactNodes.of(forces, sides, alone).forces()
    joint_forces = np.zeros((forces.owned, forces.dimension))
    np.subtract.at(joint_forces, reached, pushing)
    return joint_forces


def forces_entered(
    forces: NodalForces, sides: Sequence[ContactSide], tractions: Tractions, step: float, previous: PreviousStep | None
) -> Array:
    """The same of loads that have entered; of one that has not there are none: they leave the body unbalanced."""
    joint_forces = forces_of_joint_loads(forces, sides, tractions)
    return np.zeros_like(joint_forces) if astray(forces, tractions, step, previous) else joint_forces


def astray(forces: NodalForces, tractions: Tractions, step: float, previous: PreviousStep | None = None) -> bool:
    """Whether loads within contact are not where they have come to, or do not have their pressure; collective.

    - They are where they were at the end of the last load step, and where they enter.
    - All else is connected with that by facets; where a stage is told, it is what they reach from there through the
      points that were open.  By induction over the stages, each of which is certified, no smaller region is possible
      as long as more of the load closes no point that it came through.
    - Where they are settled they reach no more through the points that are open now.
    - Each point has the pressure of the loads at it, or what closed contact carries of it.

    Args:
        forces: of the model.
        tractions: those of the contact; a point is open where its pressure is not positive.
        step: the load step, or a place between two.
        previous: the end of the last load step; None: there is none.
    """
    return any(_astray(forces, tractions, step, part, previous) for part in range(len(forces.statement.contact)))


@dataclass(frozen=True)
class _Joint:
    """The facets of one contact, of all ranks.

    Attributes:
        facets: global numbers of their nodes, shape (f, k).
        count: of all nodes of the mesh.
    """

    facets: Numbers
    count: int

    def parts(self, nodes: Flags) -> tuple[Numbers, Numbers]:
        """The connected part that each facet and each node is in, where facets share some of the nodes."""
        facet, corner = np.nonzero(nodes[self.facets])
        first, size = len(self.facets), len(self.facets) + self.count
        edges = (np.ones(facet.size), (facet, self.facets[facet, corner] + first))
        label = connected_components(coo_array(edges, shape=(size, size)), directed=False)[1]
        return label[:first], label[first:]

    def flooded(self, reached: Flags, passing: Flags) -> Flags:
        """The nodes that are reached from others through nodes that let pass, shape (nodes,)."""
        facet, node = self.parts(passing)
        flooded = reached.copy()
        flooded[self.facets[np.isin(facet, node[reached & passing])]] = True
        return flooded

    def connected(self, seeds: Flags) -> Flags:
        """The nodes of the facets that are connected with some nodes, shape (nodes,)."""
        return self.flooded(seeds, np.ones(self.count, dtype=bool))

    def conducted(self, pressure: Array, pressurised: Flags, points: Flags, x: Array) -> Array:
        """What flows through a line of constant conductivity, between points where its pressure is known and its ends,
        which are dry: nowhere sources, shape (nodes,).
        """
        rows: list[int] = []
        columns: list[int] = []
        for facet in self.facets:
            nodes = facet[points[facet]]
            far = np.linalg.norm(x[facet[1]] - x[facet[0]])
            nodes = nodes[np.argsort(((x[nodes] - x[facet[0]]) @ (x[facet[1]] - x[facet[0]])) / far)]
            rows, columns = [*rows, *nodes[:-1]], [*columns, *nodes[1:]]
        a, b = np.array(rows, dtype=np.int64), np.array(columns, dtype=np.int64)
        prescribed = pressurised | (points & (np.bincount(np.concatenate((a, b)), minlength=self.count) <= 1))
        value = np.where(pressurised, pressure, 0.0)
        size = (self.count, self.count)
        links = coo_array((1 / np.linalg.norm(x[a] - x[b], axis=1), (a, b)), shape=size)
        links = links + links.T
        label = connected_components(links, directed=False)[1]
        entered = np.isin(label, label[pressurised])
        unknown = points & ~prescribed & entered
        value[points & ~entered] = 0.0
        if unknown.any():
            matrix = laplacian(links).tocsr()
            load = -matrix[unknown][:, prescribed] @ value[prescribed]
            value[unknown] = np.atleast_1d(spsolve(matrix[unknown][:, unknown].tocsc(), load))
        return value


def _astray(forces: NodalForces, tractions: Tractions, step: float, part: int, previous: PreviousStep | None) -> bool:
    """The same for one contact."""
    statement, numbers, name = forces.statement, forces.space.dofmap.index_map, forces.statement.contact[part].boundary
    joint, comm = tractions.joint, forces.space.mesh.comm
    assert joint is not None
    loads = [(k, load) for k, load in enumerate(statement.joint_loads.values()) if name in load.enters]
    points_of_part = np.flatnonzero(tractions.part == part)
    nodes, load_numbers = tractions.nodes[points_of_part], [k for k, _ in loads]
    x = forces.at_nodes[nodes, : forces.dimension]
    offers: list[Array] = []
    for _, load in loads:
        factor, current = statement.now(load, step)
        offers.append(np.maximum(factor * current.pressure(x), 0.0)[:, None])
    last = None if previous is None else previous.tractions.joint
    unreached = np.zeros_like(joint.reached)
    stages = [joint.reached, unreached if last is None else last.reached, unreached]
    opened = [tractions.pressure <= 0, np.zeros(tractions.pressure.size, dtype=bool)]
    if joint.stage is not None:
        stages[2], opened[1] = joint.stage.reached, joint.stage.open
    columns = [joint.pressure, *opened]
    local_rows = np.column_stack(
        [numbers.local_to_global(nodes), x, *(column[points_of_part] for column in columns), *offers]
    )
    local_rows = np.column_stack([local_rows, *(column[points_of_part][:, load_numbers] for column in stages)])
    rows = parallel.gather_rows(comm, local_rows)
    count, dim, m = int(numbers.size_global), forces.dimension, len(loads)
    node_table = np.zeros((count, rows.shape[1]))
    node_table[rows[:, 0].astype(np.int64)] = rows
    points = np.zeros(count, dtype=bool)
    points[rows[:, 0].astype(np.int64)] = True
    x, (pressure, open_, opened_before) = node_table[:, 1 : 1 + dim], node_table[:, 1 + dim : 4 + dim].T
    offered, now_at, last_at, stage_at = (node_table[:, 4 + dim + k * m : 4 + dim + (k + 1) * m] for k in range(4))
    line = _Joint(_facets(forces, name), count)
    expected: Array = np.zeros(count)
    right: Flags = np.zeros(count, dtype=bool)
    for number, (_, load) in enumerate(loads):
        reached, passing = now_at[:, number] > 0, offered[:, number] > 0
        begun: Flags = np.zeros(count, dtype=bool)
        begun[np.intersect1d(_facets(forces, load.boundary), line.facets)] = True
        enters = begun.copy()
        begun |= last_at[:, number] > 0
        if joint.stage is None:
            came = begun
        else:
            came = line.flooded(stage_at[:, number] > 0, (opened_before > 0) & passing & points)
        further = line.flooded(reached, (open_ > 0) & passing & points)
        wrong = points & ((reached & ~line.connected(begun)) | (begun & ~reached))
        if not joint.recalled:
            wrong |= points & (reached != came)
        if joint.settled:
            wrong |= points & (further != reached)
        if wrong.any():
            return True
        at = line.connected(enters) if load.closed == "full" else reached
        expected = np.maximum(expected, np.where(at, offered[:, number], 0.0))
        right |= at
    if loads and loads[0][1].closed == "linear":
        expected = line.conducted(expected, right & points, points, x)
    return bool((np.abs(pressure - expected)[points] > ZERO_IN_SOLUTION * np.abs(expected).max(initial=0.0)).any())


def _facets(forces: NodalForces, boundary: str) -> Numbers:
    """Global numbers of the nodes of the facets of a boundary, shape (facets, nodes of a facet); collective."""
    local_nodes = facet_nodes(forces.space, forces.tagged.facets(boundary))
    numbers = forces.space.dofmap.index_map.local_to_global(local_nodes.ravel()).reshape(local_nodes.shape)
    return parallel.gather_rows(forces.space.mesh.comm, numbers)
