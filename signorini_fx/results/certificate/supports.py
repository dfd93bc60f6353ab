"""What the supports prescribe, as the certificate sees it: from the scene and the mesh."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.machine import parallel
from signorini_fx.mechanics.statement.expressions import sample
from signorini_fx.tuned import SAME_DIRECTION

if TYPE_CHECKING:
    from signorini_fx.results.certificate.nodal_forces import NodalForces

Nodal = npt.NDArray[np.float64]


@dataclass(frozen=True)
class PrescribedNodes:
    """The prescribed displacements of the owned nodes.

    Attributes:
        fixed: which components are prescribed, shape (owned nodes, d); none at the nodes ``askew``.
        value: to what, length, shape (owned nodes, d).
        askew: nodes with a displacement prescribed along a normal that is no axis, as often as there are directions in
            which something is prescribed there, shape (m,).
        normals: these directions, normals and axes, shape (m, d).
        along: what is prescribed along them, length, shape (m,).
        by: position in ``scene.displacement`` of what prescribes each component, -1 elsewhere, shape (owned nodes, d).
        askew_by: likewise of what prescribes the displacement along each of the directions, shape (m,).
    """

    fixed: npt.NDArray[np.bool_]
    value: Nodal
    askew: npt.NDArray[np.int64]
    normals: Nodal
    along: Nodal
    by: npt.NDArray[np.int64]
    askew_by: npt.NDArray[np.int64]

    @classmethod
    def of(cls, forces: NodalForces, step: float, scale: float) -> PrescribedNodes:
        """Those of a load step times ``scale``; collective.

        Of two effects the later one applies in full, the earlier one in the directions that are left.
        """
        statement, tagged, space, owned = forces.statement, forces.tagged, forces.space, forces.owned
        shape = (owned, forces.dimension)
        fixed, value, by = np.zeros(shape, dtype=bool), np.zeros(shape), np.full(shape, -1)
        askew: list[tuple[npt.NDArray[np.int64], Nodal, Nodal, int]] = []
        x = forces.at_nodes
        dim = tagged.mesh.topology.dim - 1
        for position, effect in enumerate(statement.displacement):
            if not effect.holds_at(step):
                continue
            if effect.at is None:
                nodes = fem.locate_dofs_topological(space, dim, tagged.facets(effect.boundary))
            else:
                away = np.linalg.norm(x[:, : len(effect.at)] - np.array(effect.at), axis=1)
                nodes = np.flatnonzero(away <= SAME_DIRECTION * tagged.size)
                if effect.region is not None:
                    inside = np.zeros((len(x), forces.dimension))
                    inside[space.dofmap.list[tagged.cells(effect.region)].ravel()] = 1.0
                    nodes = np.intersect1d(nodes, np.flatnonzero(forces.over_ranks(inside)[:, 0]))
            nodes = nodes[nodes < owned]
            step_factor, effect = statement.now(effect, step)
            factor = scale * step_factor
            prescribed = [(axis, imposed, 1.0) for axis, imposed in enumerate(effect.components)]
            if effect.normal is not None:
                outward = parallel.global_sum(tagged.mesh.comm, forces.moments(effect.boundary).sum(axis=0))
                axis = int(np.argmax(np.abs(outward)))
                if np.linalg.norm(np.delete(outward, axis)) > SAME_DIRECTION * abs(outward[axis]):
                    along = factor * sample(effect.normal, x[nodes].T)
                    askew.append((nodes.astype(np.int64), outward / np.linalg.norm(outward), along, position))
                    continue
                prescribed = [(axis, effect.normal, float(np.sign(outward[axis])))]
            for component, imposed, sign in prescribed:
                if imposed is not None:
                    fixed[nodes, component] = True
                    by[nodes, component] = position
                    value[nodes, component] = sign * factor * sample(imposed, x[nodes].T)
        if forces.kinematics.zero_on_axis:
            middle = np.abs(x[:owned, 0]) <= SAME_DIRECTION * tagged.size
            for axis in forces.kinematics.zero_on_axis:
                fixed[middle, axis], value[middle, axis], by[middle, axis] = True, 0.0, len(statement.displacement)
        no_nodes = np.zeros(0, dtype=np.int64)
        if not askew:
            return cls(fixed, value, no_nodes, np.zeros((0, shape[1])), np.zeros(0), by, no_nodes)
        groups: list[tuple[Any, ...]] = [(no_nodes, np.zeros((0, shape[1])), np.zeros(0), no_nodes)]
        places = np.unique(np.concatenate([no_nodes, *(nodes for nodes, *_ in askew)]))
        offered = [np.eye(shape[1])], [value[places]], [by[places]]
        for nodes, normal, along, position in askew:
            _, rows, effect_rows = np.intersect1d(places, nodes, return_indices=True)
            column, owner = np.zeros((places.size, 1)), np.full((places.size, 1), -1)
            column[rows, 0], owner[rows] = along[effect_rows], position
            for table, new in zip(offered, (normal[None], column, owner), strict=True):
                table.append(new)
        directions, imposed, owners = np.vstack(offered[0]), np.hstack(offered[1]), np.hstack(offered[2])
        kinds, kind = np.unique(owners, axis=0, return_inverse=True)
        for number, whose in enumerate(kinds):
            rows = np.flatnonzero(kind.ravel() == number)
            for normal, along, position in _in_turn(directions, imposed[rows], whose):
                groups.append((places[rows], np.tile(normal, (rows.size, 1)), along, np.full(rows.size, position)))
        fixed[places], by[places] = False, -1
        where, normals, along, askew_by = (np.concatenate(column) for column in zip(*groups, strict=True))
        return cls(fixed, value, where, normals, along, by, askew_by)

    def missed(self, y: Nodal) -> Nodal:
        """How far displacements of the owned nodes are from what is prescribed, length, as a list."""
        askew = np.sum(y[self.askew] * self.normals, axis=1) - self.along
        return np.abs(np.concatenate(((y - self.value)[self.fixed], askew)))

    def among(self, of_node: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        """Numbers that the owned nodes have, in the order of ``missed``."""
        return np.concatenate((np.broadcast_to(of_node[:, None], self.fixed.shape)[self.fixed], of_node[self.askew]))

    def left(self, vectors: Nodal, nodes: npt.NDArray[np.int64] | None = None) -> Nodal:
        """Vectors at the owned nodes, or at some of them, without the directions that are prescribed, shape (n, d)."""
        fixed = self.fixed if nodes is None else self.fixed[nodes]
        remainder = np.where(fixed, 0.0, vectors)
        where = np.arange(len(vectors)) if nodes is None else nodes
        order = np.argsort(self.askew, kind="stable")
        begin = np.searchsorted(self.askew[order], where, "left")
        end = np.searchsorted(self.askew[order], where, "right")
        for row in np.flatnonzero(end > begin):
            basis = self.normals[order[begin[row] : end[row]]]
            remainder[row] = vectors[row] - np.linalg.pinv(basis) @ (basis @ vectors[row])
        return remainder

    def taken(self, forces: Nodal, position: int) -> Nodal:
        """The part of nodal forces that acts along what one entry of ``scene.displacement`` prescribes, shape (owned
        nodes, d); at a node of several entries each direction belongs to the one that prescribes it.
        """
        taken = np.where(self.by == position, forces, 0.0)
        order = np.argsort(self.askew, kind="stable")
        nodes, first = np.unique(self.askew[order], return_index=True)
        for node, rows in zip(nodes, np.split(order, first[1:]), strict=False):
            basis = self.normals[rows]
            shares = (np.linalg.pinv(basis.T) @ forces[node])[:, None] * basis
            taken[node] = shares[self.askew_by[rows] == position].sum(axis=0)
        return taken

    def movable(self) -> npt.NDArray[np.bool_]:
        """Components in which a node can move, shape (owned nodes, d)."""
        movable, nodes = ~self.fixed, np.unique(self.askew)
        ways = [self.left(np.tile(axis, (nodes.size, 1)), nodes) for axis in np.eye(movable.shape[1])]
        movable[nodes] = np.max(np.abs(ways), axis=0) > SAME_DIRECTION
        return movable


def _in_turn(directions: Nodal, imposed: Nodal, whose: npt.NDArray[np.int64]) -> list[tuple[Nodal, Nodal, int]]:
    """What applies at nodes where several effects prescribe displacements, the later ones first.

    An effect that later ones contradict applies across them only, as closely as it can.

    Args:
        directions: of the displacements that are prescribed, shape (k, d).
        imposed: what is prescribed along them, shape (n, k).
        whose: position of the effect that prescribes it, -1 where none does, shape (k,).

    Returns:
        Directions, what is prescribed along each of them, shape (n,), and by which effect.
    """
    y, taken = np.zeros((len(imposed), directions.shape[1])), directions[:0]
    constraints = []
    for position in map(int, np.unique(whose[whose >= 0])[::-1]):
        effect_directions = directions[whose == position]
        _, sizes, ways = np.linalg.svd(effect_directions - effect_directions @ taken.T @ taken)
        new = ways[: np.count_nonzero(sizes > SAME_DIRECTION)]
        if not len(new):
            continue
        y += (
            (imposed[:, whose == position] - y @ effect_directions.T)
            @ np.linalg.pinv(effect_directions @ new.T).T
            @ new
        )
        taken = np.vstack((taken, new))
        constraints += [
            (way, y @ way, position) for way in (effect_directions if len(new) == len(effect_directions) else new)
        ]
    return constraints
