"""What the supports prescribe, as the certificate sees it: from the scene and the mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx import parallel
from signorini_fx.results.nodal_forces import NodalForces
from signorini_fx.scene.expressions import sample

Nodal = npt.NDArray[np.float64]

# Two directions are one, and a normal is along an axis, within this.
_SAME = 1e-8


@dataclass(frozen=True)
class Supports:
    """The prescribed displacements of the owned nodes.

    Attributes:
        fixed: which components are prescribed, shape (owned nodes, d).
        value: to what, length, shape (owned nodes, d).
        askew: nodes with a displacement prescribed along a normal that is no axis, shape (m,).
        normals: these normals, shape (m, d); a node of several such boundaries is there as often.
        along: what is prescribed along them, length, shape (m,).
        by: position in ``scene.displacement`` of what prescribes each component, -1 where it is free, shape (owned
            nodes, d).
        askew_by: likewise of what prescribes the displacement along each of the normals, shape (m,).
    """

    fixed: npt.NDArray[np.bool_]
    value: Nodal
    askew: npt.NDArray[np.int64]
    normals: Nodal
    along: Nodal
    by: npt.NDArray[np.int64]
    askew_by: npt.NDArray[np.int64]

    @classmethod
    def of(cls, forces: NodalForces, step: int, scale: float) -> Supports:
        """Those of a load step times ``scale``; a later effect wins; collective."""
        scene, tagged, space, owned = forces.scene, forces.tagged, forces.space, forces.owned
        shape = (owned, forces.dimension)
        fixed, value, by = np.zeros(shape, dtype=bool), np.zeros(shape), np.full(shape, -1)
        askew: list[tuple[npt.NDArray[np.int64], Nodal, Nodal, npt.NDArray[np.int64]]] = []
        x = space.tabulate_dof_coordinates()
        dim = tagged.mesh.topology.dim - 1
        for position, effect in enumerate(scene.displacement):
            nodes = fem.locate_dofs_topological(space, dim, tagged.facets(effect.boundary))
            nodes = nodes[nodes < owned]
            factor = scale * (1.0 if effect.factors is None else effect.factors[step])
            prescribed = [(axis, given, 1.0) for axis, given in enumerate(effect.components)]
            if effect.normal is not None:
                outward = parallel.global_sum(tagged.mesh.comm, forces.moments(effect.boundary).sum(axis=0))
                axis = int(np.argmax(np.abs(outward)))
                if np.linalg.norm(np.delete(outward, axis)) > _SAME * abs(outward[axis]):
                    normal = np.tile(outward / np.linalg.norm(outward), (nodes.size, 1))
                    along = factor * sample(effect.normal, x[nodes].T)
                    askew.append((nodes.astype(np.int64), normal, along, np.full(nodes.size, position)))
                    continue
                prescribed = [(axis, effect.normal, float(np.sign(outward[axis])))]
            for component, given, sign in prescribed:
                if given is not None:
                    fixed[nodes, component] = True
                    by[nodes, component] = position
                    value[nodes, component] = sign * factor * sample(given, x[nodes].T)
        if not askew:
            none = np.zeros(0, dtype=np.int64)
            return cls(fixed, value, none, np.zeros((0, shape[1])), np.zeros(0), by, none)
        # The later one of two along one direction.
        count = np.cumsum([len(nodes) for nodes, *_ in askew])
        every, normals, along, askew_by = (np.concatenate(column) for column in zip(*askew, strict=True))
        kept = np.ones(len(every), dtype=bool)
        for end in count[:-1]:
            later = every[end:]
            for one in np.flatnonzero(np.isin(every[:end], later)):
                same = np.abs(np.abs(normals[end:][later == every[one]] @ normals[one]) - 1) < _SAME
                kept[one] &= not same.any()
        return cls(fixed, value, every[kept], normals[kept], along[kept], by, askew_by[kept])

    def missed(self, y: Nodal) -> Nodal:
        """How far displacements of the owned nodes are from what is prescribed, length, as a list."""
        askew = np.sum(y[self.askew] * self.normals, axis=1) - self.along
        return np.abs(np.concatenate(((y - self.value)[self.fixed], askew)))

    def left(self, vectors: Nodal, nodes: npt.NDArray[np.int64] | None = None) -> Nodal:
        """Vectors at the owned nodes, or at some of them, without the directions that are prescribed, shape (n, d)."""
        fixed = self.fixed if nodes is None else self.fixed[nodes]
        found = np.where(fixed, 0.0, vectors)
        where = np.arange(len(vectors)) if nodes is None else nodes
        order = np.argsort(self.askew, kind="stable")
        begin = np.searchsorted(self.askew[order], where, "left")
        end = np.searchsorted(self.askew[order], where, "right")
        for row in np.flatnonzero(end > begin):
            normals = self.normals[order[begin[row] : end[row]]]
            basis = np.vstack((np.eye(found.shape[1])[fixed[row]], normals))
            found[row] = vectors[row] - np.linalg.pinv(basis) @ (basis @ vectors[row])
        return found

    def taken(self, forces: Nodal, position: int) -> Nodal:
        """The part of nodal forces that acts along what one entry of ``scene.displacement`` prescribes, shape (owned
        nodes, d); at a node of several entries each direction belongs to the one that prescribes it.
        """
        found = np.where(self.by == position, forces, 0.0)
        order = np.argsort(self.askew, kind="stable")
        nodes, first = np.unique(self.askew[order], return_index=True)
        for node, rows in zip(nodes, np.split(order, first[1:]), strict=False):
            axes = np.flatnonzero(self.fixed[node])
            basis = np.vstack((np.eye(forces.shape[1])[axes], self.normals[rows]))
            shares = (np.linalg.pinv(basis.T) @ forces[node])[:, None] * basis
            owners = np.concatenate((self.by[node, axes], self.askew_by[rows]))
            found[node] = shares[owners == position].sum(axis=0)
        return found

    def touched(self) -> npt.NDArray[np.bool_]:
        """Components that supports have to do with, shape (owned nodes, d)."""
        found = self.fixed.copy()
        np.logical_or.at(found, self.askew, np.abs(self.normals) > _SAME)
        return found
