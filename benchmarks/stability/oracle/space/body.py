"""The elastic body of a scene in 3D, assembled anew from its mesh as plain arrays."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.linalg import null_space
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial.distance import pdist

from benchmarks.stability.oracle import elements as plane
from benchmarks.stability.oracle.body import Mesh, factor_of, listed
from benchmarks.stability.oracle.elements import Array, Ints, at_points
from benchmarks.stability.oracle.space import effects, elements

# Directions at a node that are closer to dependent than this are one direction.
_INDEPENDENT = 1e-6


@dataclass(frozen=True)
class Facets:
    """Facets of a boundary: the cell behind each, and its nodes in the order of the element of the plane.

    Attributes:
        cells: number of the cell, shape (f,).
        nodes: nodes of the displacement, shape (f, k).
        places: nodes of the mesh, shape (f, g).
    """

    cells: Ints
    nodes: Ints
    places: Ints


class Body:
    """Nodes, stiffness, loads and supports of a scene in 3D (as its TOML says it) on a mesh."""

    def __init__(self, scene: dict[str, Any], mesh: Mesh) -> None:
        self.scene = scene
        self.mesh = mesh
        corners, self.geometry_degree = elements.KINDS[mesh.cells.shape[1]]
        self.degree = int(scene.get("element", {}).get("degree", 1))
        if self.geometry_degree > self.degree:
            raise ValueError("curved cells need elements of degree 2")
        self.corners: Ints = mesh.cells[:, :corners]
        self.x, self.cells = self._numbered()
        loads = [e for key in ("displacement", "traction", "body_force", *effects.LOADS) for e in listed(scene, key)]
        self.steps = max([1, *(len(effect["factors"]) for effect in loads if "factors" in effect)])
        self._forces: dict[tuple[str, int], Array] = {}

    def _numbered(self) -> tuple[Array, Ints]:
        """Nodes of the displacement: the mesh's own, or with degree 2 on straight cells middles as well."""
        mesh = self.mesh
        if self.degree == self.geometry_degree:
            return mesh.points, mesh.cells
        corners = self.corners.shape[1]
        groups = [*elements.EDGES[corners], *((*elements.FACES[8], tuple(range(8))) if corners == 8 else ())]
        numbers: dict[tuple[int, ...], int] = {}
        points, rows = list(mesh.points), []
        for row in self.corners:
            nodes = row.tolist()
            for group in groups:
                key = tuple(sorted(row[list(group)].tolist()))
                if key not in numbers:
                    numbers[key] = len(points)
                    points.append(mesh.points[list(key)].mean(axis=0))
                nodes.append(numbers[key])
            rows.append(nodes)
        return np.array(points), np.array(rows, dtype=np.int64)

    # ---- elasticity

    @cached_property
    def lame(self) -> tuple[Array, Array]:
        """Lame parameters of each cell; of no meaning where a material is orthotropic."""
        first, second = np.full(len(self.cells), np.nan), np.full(len(self.cells), np.nan)
        for material in listed(self.scene, "material"):
            young, poisson = float(material["young"]), float(material["poisson"])
            where = self.mesh.regions[material["region"]] if "region" in material else np.arange(len(self.cells))
            second[where] = young / 2 / (1 + poisson)
            first[where] = young * poisson / (1 + poisson) / (1 - 2 * poisson)
        if np.isnan(first).any():
            raise ValueError("a cell has no material")
        return first, second

    @cached_property
    def young(self) -> float:
        """The largest Young's modulus."""
        materials = listed(self.scene, "material")
        return max(float(material.get("young") or max(material["orthotropic"]["young"])) for material in materials)

    @cached_property
    def size(self) -> float:
        """The largest distance of two nodes of the mesh."""
        return float(pdist(self.mesh.points[np.unique(self.mesh.cells)]).max())

    @cached_property
    def reduced(self) -> bool:
        """Whether the volumetric term is integrated with the reduced rule."""
        wanted = self.scene.get("element", {}).get("volumetric", "full")
        if self.cells.shape[1] == 4 or wanted == "full" or effects.is_orthotropic(self):
            return False
        return wanted == "reduced" or any(m["poisson"] >= 0.45 for m in listed(self.scene, "material"))

    @cached_property
    def stiffness(self) -> csr_array:
        """a(., .), dofs 3 n, 3 n + 1, 3 n + 2 at node n, nothing eliminated."""
        rule = elements.cell_rule(self.cells.shape[1], self.geometry_degree)
        if effects.is_orthotropic(self):
            total = effects.orthotropic_matrices(self, rule)
        else:
            first, second = self.lame
            total = self._cell_matrices(rule, 0 * first if self.reduced else first, second)
            if self.reduced:
                total += self._cell_matrices(elements.reduced_rule(self.cells.shape[1]), first, 0 * second)
        dofs = (3 * self.cells[:, :, None] + np.arange(3)).reshape(len(self.cells), -1)
        rows, columns = np.broadcast_arrays(dofs[:, :, None], dofs[:, None, :])
        size = 3 * len(self.x)
        return coo_array((total.ravel(), (rows.ravel(), columns.ravel())), shape=(size, size)).tocsr() + self.springs

    @cached_property
    def springs(self) -> csr_array:
        """That part of the stiffness which resists rigid motions too."""
        return effects.springs(self)

    def of_materials(self, key: str) -> Array:
        """A number of the materials in each cell."""
        found = np.zeros(len(self.cells))
        for material in listed(self.scene, "material"):
            where = self.mesh.regions[material["region"]] if "region" in material else np.arange(len(self.cells))
            found[where] = float(material[key])
        return found

    def _cell_matrices(self, rule: tuple[Array, Array], first: Array, second: Array) -> Array:
        """The stiffness matrix of every cell by a rule."""
        xi, weights = rule
        _, slopes = elements.shape(self.cells.shape[1], xi)
        jacobians = self.jacobian(xi)
        count, nodes = self.cells.shape
        total = np.zeros((count, nodes, 3, nodes, 3))
        for point, weight in enumerate(weights):
            jacobian = jacobians[:, point]
            size = np.abs(np.linalg.det(jacobian)) * weight
            g = np.einsum("kj,cji->cki", slopes[point], np.linalg.inv(jacobian))
            outer = g[:, :, :, None, None] * g[:, None, None, :, :]  # d_i phi_a d_j phi_b at [c, a, i, b, j]
            total += (first * size)[:, None, None, None, None] * outer
            total += (second * size)[:, None, None, None, None] * outer.transpose(0, 1, 4, 3, 2)
            dot = np.einsum("c,cak,cbk->cab", second * size, g, g)
            for i in range(3):
                total[:, :, i, :, i] += dot
        return total.reshape(count, 3 * nodes, 3 * nodes)

    def jacobian(self, xi: Array) -> Array:
        """D x_i / d xi_j in every cell at the points xi, shape (cells, points, 3, 3)."""
        _, slopes = elements.shape(self.mesh.cells.shape[1], xi)
        return np.einsum("cki,pkj->cpij", self.mesh.points[self.mesh.cells], slopes)

    # ---- facets and loads

    @cached_property
    def _faces(self) -> dict[frozenset[int], tuple[int, int]]:
        """The cell and the number of the face for the corners of each face; of two cells the later one."""
        found = {}
        for cell, row in enumerate(self.corners.tolist()):
            for number, face in enumerate(elements.FACES[len(row)]):
                found[frozenset(row[k] for k in face)] = (cell, number)
        return found

    def facets(self, name: str) -> Facets:
        """The facets of a boundary."""
        pairs = [self._faces[frozenset(corners)] for corners in self.mesh.boundaries[name].tolist()]
        cells = np.array([cell for cell, _ in pairs], dtype=np.int64)
        fine, coarse = elements.face_nodes(self.cells.shape[1]), elements.face_nodes(self.mesh.cells.shape[1])
        nodes = [self.cells[cell, fine[face]] for cell, face in pairs]
        places = [self.mesh.cells[cell, coarse[face]] for cell, face in pairs]
        return Facets(cells, np.array(nodes, dtype=np.int64), np.array(places, dtype=np.int64))

    def frames(self, facets: Facets, xi: Array) -> tuple[Array, Array]:
        """Positions, and outward normals times the area per xi, at points xi of each facet: (facets, points, 3)."""
        values, slopes = plane.shape(facets.places.shape[1], xi)
        x = self.mesh.points[facets.places]
        along = np.einsum("fki,pkj->fpij", x, slopes)
        normal = np.cross(along[..., 0], along[..., 1])
        inside = self.mesh.points[self.corners[facets.cells]].mean(axis=1)
        outward = np.einsum("fi,fi->f", normal.mean(axis=1), x.mean(axis=1) - inside)
        return np.einsum("fki,pk->fpi", x, values), normal * np.sign(outward)[:, None, None]

    def rule(self, points: int) -> tuple[Array, Array]:
        """A rule on a facet: exact on triangles, so many points along each side of a quadrilateral."""
        return plane.triangle(points) if self.corners.shape[1] == 4 else plane.square(points)

    def load(self, step: int) -> Array:
        """L of a load step, one force per dof."""
        total = np.zeros((len(self.x), 3))
        for load in listed(self.scene, "traction"):
            varies = any(isinstance(load.get(k), str) for k in ("x", "y", "z", "pressure"))
            (xi, weights), facets = self.rule(11 if varies else self.degree + 2), self.facets(load["boundary"])
            values, _ = plane.shape(facets.nodes.shape[1], xi)
            x, normal = self.frames(facets, xi)
            flat, area = x.reshape(-1, 3), np.linalg.norm(normal, axis=2)
            force = np.stack([at_points(load.get(k, 0.0), flat).reshape(area.shape) * area for k in "xyz"], axis=2)
            force -= at_points(load.get("pressure", 0.0), flat).reshape(area.shape)[:, :, None] * normal
            nodal = np.einsum("fpi,p,pk->fki", force, weights, values) * factor_of(load, step)
            np.add.at(total, facets.nodes, nodal)
        for load in listed(self.scene, "body_force"):
            xi, weights = elements.tetrahedron(5) if self.corners.shape[1] == 4 else elements.cube(self.degree + 2)
            values, _ = elements.shape(self.cells.shape[1], xi)
            place, _ = elements.shape(self.mesh.cells.shape[1], xi)
            x = np.einsum("cki,pk->cpi", self.mesh.points[self.mesh.cells], place)
            size = np.abs(np.linalg.det(self.jacobian(xi))) * weights
            force = np.stack(
                [at_points(load.get(k, 0.0), x.reshape(-1, 3)).reshape(size.shape) * size for k in "xyz"], axis=2
            )
            np.add.at(total, self.cells, np.einsum("cpi,pk->cki", force, values) * factor_of(load, step))
        for key in effects.LOADS:
            for number, load in enumerate(listed(self.scene, key)):
                if (key, number) not in self._forces:
                    self._forces[key, number] = effects.forces(self, key, load)
                total += self._forces[key, number] * factor_of(load, step)
        return total.ravel()

    # ---- supports

    @cached_property
    def _prescriptions(self) -> dict[int, list[tuple[Array, float, dict[str, Any]]]]:
        """What is prescribed at each node, in the order of the scene: direction, value, effect."""
        found: dict[int, list[tuple[Array, float, dict[str, Any]]]] = {}
        for support in listed(self.scene, "displacement"):
            facets = self.facets(support["boundary"])
            nodes = np.unique(facets.nodes)
            directions = [(np.eye(3)[axis], support[key]) for axis, key in enumerate("xyz") if key in support]
            if "normal" in support:
                _, normal = self.frames(facets, np.array([[0.3, 0.3]]))
                mean = normal.sum(axis=(0, 1))
                directions.append((mean / np.linalg.norm(mean), support["normal"]))
            for direction, value in directions:
                for node, number in zip(nodes.tolist(), at_points(value, self.x[nodes]).tolist(), strict=True):
                    found.setdefault(node, []).append((direction, number, support))
        return found

    @cached_property
    def held(self) -> Array:
        """The projection onto the directions that supports hold at each node, shape (nodes, 3, 3)."""
        found = np.zeros((len(self.x), 3, 3))
        for node, given in self._prescriptions.items():
            kept = np.zeros((0, 3))
            for direction, _, _ in reversed(given):
                kept, _ = _one_more(kept, direction)
            found[node] = kept.T @ kept
        return found

    def prescribed(self, step: int) -> Array:
        """A displacement that meets the supports of a load step and is zero elsewhere, shape (nodes, 3).

        Of directions at a node that depend on each other the later ones hold.
        """
        u = np.zeros((len(self.x), 3))
        for node, given in self._prescriptions.items():
            kept = np.zeros((0, 3))
            for direction, value, effect in reversed(given):
                kept, rest = _one_more(kept, direction)
                if rest > 0:
                    wanted = value * factor_of(effect, step)
                    u[node] += kept[-1] * (wanted - direction @ u[node]) / rest
        return u

    @cached_property
    def free(self) -> csr_array:
        """Orthonormal free directions of all nodes, a column each, shape (3 nodes, free)."""
        rows, columns, values, count = [], [], [], 0
        for node, held in enumerate(self.held):
            basis = null_space(held, rcond=0.5) if held.any() else np.eye(3)
            for vector in basis.T:
                rows += [3 * node, 3 * node + 1, 3 * node + 2]
                columns += [count] * 3
                values += vector.tolist()
                count += 1
        return coo_array((values, (rows, columns)), shape=(3 * len(self.x), count)).tocsr()

    # ---- rigid motions

    @cached_property
    def pieces(self) -> tuple[int, Ints]:
        """Number of connected pieces of the body, and the piece of each node."""
        size = len(self.x)
        first, rest = np.repeat(self.cells[:, :1], self.cells.shape[1] - 1, axis=1), self.cells[:, 1:]
        graph = coo_array((np.ones(first.size), (first.ravel(), rest.ravel())), shape=(size, size))
        count, labels = connected_components(graph, directed=False)
        return int(count), labels.astype(np.int64)

    @cached_property
    def rigid(self) -> Array:
        """The rigid motions of every piece (three translations, three rotations about its middle), a column each."""
        count, labels = self.pieces
        columns = []
        for piece in range(count):
            here: npt.NDArray[np.bool_] = labels == piece
            x = (self.x - self.x[here].mean(axis=0)) / self.size
            for axis in range(3):
                columns.append((np.eye(3)[axis] * here[:, None]).ravel())
                columns.append((np.cross(np.eye(3)[axis], x) * here[:, None]).ravel())
        return np.stack(columns, axis=1)


def _one_more(kept: Array, direction: Array) -> tuple[Array, float]:
    """Orthonormal rows and the part of a direction that is new, and the length of that part, 0 if there is none."""
    rest = direction - kept.T @ (kept @ direction)
    length = float(np.linalg.norm(rest))
    if length < _INDEPENDENT:
        return kept, 0.0
    return np.concatenate([kept, rest[None] / length]), length
