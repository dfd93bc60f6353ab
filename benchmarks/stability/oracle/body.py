"""The elastic bodies of a scene in 2D or in 3D, assembled anew from their mesh as plain arrays."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.linalg import null_space
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial.distance import pdist

from benchmarks.stability.oracle import effects, elements
from benchmarks.stability.oracle.effects import listed
from benchmarks.stability.oracle.elements import Array, Ints, at_points

# Directions at a node that are closer to dependent than this are one direction.
_INDEPENDENT = 1e-6


@dataclass(frozen=True)
class Mesh:
    """A mesh as plain arrays."""

    points: Array  # corners of the cells, and with cells of degree 2 the other nodes; shape (n, d)
    cells: Ints  # node numbers in the order of ``elements``, shape (cells, nodes)
    boundaries: dict[str, Ints]  # name -> the corners of each facet, shape (facets, corners)
    regions: dict[str, Ints] = field(default_factory=dict)  # name -> cells


@dataclass(frozen=True)
class Facets:
    """Facets of a boundary: the cell behind each, and its nodes in the order of its element."""

    cells: Ints  # number of the cell, shape (f,)
    nodes: Ints  # nodes of the displacement, shape (f, k)
    places: Ints  # nodes of the mesh, shape (f, g)


class Body:
    """Nodes, stiffness, loads and supports of a scene (as its TOML says it) on a mesh."""

    def __init__(self, scene: dict[str, Any], mesh: Mesh) -> None:
        self.scene = scene
        self.mesh = mesh
        self.dim = mesh.points.shape[1]
        corners, self.geometry_degree = elements.KINDS[self.dim, mesh.cells.shape[1]]
        self.simplices = corners == self.dim + 1
        self.degree = int(scene.get("element", {}).get("degree", 1))
        if self.geometry_degree > self.degree:
            raise ValueError("curved cells need elements of degree 2")
        self.corners: Ints = mesh.cells[:, :corners]
        self.x, self.cells = self._numbered()
        loads = [
            e
            for key in ("displacement", "traction", "body_force", *effects.LOADS)
            for e in listed(scene, key)
        ]
        self.steps = max([1, *(len(effect["factors"]) for effect in loads if "factors" in effect)])
        self._forces: dict[tuple[str, int], Array] = {}

    def _numbered(self) -> tuple[Array, Ints]:
        """Nodes of the displacement: the mesh's own, or with degree 2 on straight cells middles as
        well.
        """
        mesh = self.mesh
        if self.degree == self.geometry_degree:
            return mesh.points, mesh.cells
        groups = elements.between(self.dim, self.corners.shape[1])
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
        """Lame parameters of each cell; the first one is reduced for plane stress."""
        first, second = np.full(len(self.cells), np.nan), np.full(len(self.cells), np.nan)
        for material in listed(self.scene, "material"):
            where, poisson = self.of_region(material), float(material["poisson"])
            shear = material["young"] * effects.graded(self, material)[where] / 2 / (1 + poisson)
            plane_stress = material.get("hypothesis", "plane strain") == "plane stress"
            first[where] = 2 * shear * poisson / (1 - poisson if plane_stress else 1 - 2 * poisson)
            second[where] = shear
        if np.isnan(first).any():
            raise ValueError("a cell has no material")
        return first, second

    def of_region(self, entry: dict[str, Any]) -> Ints:
        """The cells of the region of an entry, which are all where it has none."""
        return (
            self.mesh.regions[entry["region"]] if "region" in entry else np.arange(len(self.cells))
        )

    @cached_property
    def young(self) -> float:
        """The largest Young's modulus."""
        materials = listed(self.scene, "material")
        return max(
            float(material.get("young") or max(material["orthotropic"]["young"]))
            for material in materials
        )

    @cached_property
    def size(self) -> float:
        """The largest distance of two nodes of the mesh."""
        return float(pdist(self.mesh.points[np.unique(self.mesh.cells)]).max())

    @cached_property
    def reduced(self) -> bool:
        """Whether the volumetric term is integrated with the reduced rule."""
        wanted = self.scene.get("element", {}).get("volumetric", "full")
        if self.cells.shape[1] == self.dim + 1 or wanted == "full" or effects.is_orthotropic(self):
            return False
        nearly = (
            m["poisson"] >= 0.45 and m.get("hypothesis", "plane strain") == "plane strain"
            for m in listed(self.scene, "material")
        )
        return wanted == "reduced" or any(nearly)

    @cached_property
    def stiffness(self) -> csr_array:
        """a(., .), dofs d n, ..., d n + d - 1 at node n, nothing eliminated."""
        nodes = self.cells.shape[1]
        rule = elements.cell_rule(self.dim, nodes, self.geometry_degree)
        if effects.is_orthotropic(self):
            total = effects.orthotropic_matrices(self, rule)
        else:
            first, second = self.lame
            total = self._cell_matrices(rule, 0 * first if self.reduced else first, second)
            if self.reduced:
                total += self._cell_matrices(
                    elements.reduced_rule(self.dim, nodes), first, 0 * second
                )
        return self.assembled(total, self.cells) + self.springs

    def assembled(self, matrices: Array, nodes: Ints) -> csr_array:
        """The matrix of all dofs from those of cells or facets with these nodes, shape (m, d nodes,
        d nodes).
        """
        dofs = (self.dim * nodes[:, :, None] + np.arange(self.dim)).reshape(len(nodes), -1)
        rows, columns = np.broadcast_arrays(dofs[:, :, None], dofs[:, None, :])
        size = self.dim * len(self.x)
        return coo_array(
            (matrices.ravel(), (rows.ravel(), columns.ravel())), shape=(size, size)
        ).tocsr()

    @cached_property
    def springs(self) -> csr_array:
        """That part of the stiffness which resists rigid motions too."""
        return effects.springs(self)

    def of_materials(self, key: str) -> Array:
        """A number of the materials in each cell."""
        found = np.zeros(len(self.cells))
        for material in listed(self.scene, "material"):
            found[self.of_region(material)] = float(material[key])
        return found

    def _cell_matrices(self, rule: tuple[Array, Array], first: Array, second: Array) -> Array:
        """The stiffness matrix of every cell by a rule."""
        xi, weights = rule
        count, nodes = self.cells.shape
        _, slopes = elements.shape(self.dim, nodes, xi)
        jacobians = self.jacobian(xi)
        total = np.zeros((count, nodes, self.dim, nodes, self.dim))
        for point, weight in enumerate(weights):
            jacobian = jacobians[:, point]
            size = np.abs(np.linalg.det(jacobian)) * weight
            g = np.einsum("kj,cji->cki", slopes[point], np.linalg.inv(jacobian))
            outer = (
                g[:, :, :, None, None] * g[:, None, None, :, :]
            )  # d_i phi_a d_j phi_b at [c, a, i, b, j]
            total += (first * size)[:, None, None, None, None] * outer
            total += (second * size)[:, None, None, None, None] * outer.transpose(0, 1, 4, 3, 2)
            dot = np.einsum("c,cak,cbk->cab", second * size, g, g)
            for i in range(self.dim):
                total[:, :, i, :, i] += dot
        return total.reshape(count, self.dim * nodes, self.dim * nodes)

    def jacobian(self, xi: Array) -> Array:
        """D x_i / d xi_j in every cell at the points xi, shape (cells, points, d, d)."""
        _, slopes = elements.shape(self.dim, self.mesh.cells.shape[1], xi)
        return np.einsum("cki,pkj->cpij", self.mesh.points[self.mesh.cells], slopes)

    # ---- facets and loads

    @cached_property
    def _faces(self) -> dict[frozenset[int], tuple[int, int]]:
        """The cell and the number of the face for the corners of each face; of two cells the later
        one.
        """
        found = {}
        for cell, row in enumerate(self.corners.tolist()):
            for number, face in enumerate(elements.FACES[self.dim, len(row)]):
                found[frozenset(row[k] for k in face)] = (cell, number)
        return found

    def facets(self, name: str) -> Facets:
        """The facets of a boundary."""
        pairs = [self._faces[frozenset(corners)] for corners in self.mesh.boundaries[name].tolist()]
        cells = np.array([cell for cell, _ in pairs], dtype=np.int64)
        tables = (self.cells, self.mesh.cells)
        fine, coarse = (np.array(elements.face_nodes(self.dim, table.shape[1])) for table in tables)
        faces = np.array([face for _, face in pairs], dtype=np.int64)
        nodes, places = (
            self.cells[cells[:, None], fine[faces]],
            self.mesh.cells[cells[:, None], coarse[faces]],
        )
        return Facets(cells, nodes, places)

    def frames(self, facets: Facets, xi: Array) -> tuple[Array, Array]:
        """Positions, and outward normals times the area per xi, at points xi of each facet:
        (facets, points, d).
        """
        values, slopes = elements.shape(self.dim - 1, facets.places.shape[1], xi)
        x = self.mesh.points[facets.places]
        normal = across(np.einsum("fki,pkj->fpij", x, slopes))
        inside = self.mesh.points[self.corners[facets.cells]].mean(axis=1)
        outward = np.einsum("fi,fi->f", normal.mean(axis=1), x.mean(axis=1) - inside)
        return np.einsum("fki,pk->fpi", x, values), normal * np.sign(outward)[:, None, None]

    def middle_frames(self, facets: Facets) -> Array:
        """Outward normals of any length near the middle of each facet, shape (facets, d)."""
        return self.frames(facets, np.full((1, self.dim - 1), 0.3))[1][:, 0]

    def rule(self, points: int) -> tuple[Array, Array]:
        """A rule on a facet: exact on triangles, so many points along each side of lines and
        quadrilaterals.
        """
        make = elements.simplex if self.simplices and self.dim == 3 else elements.cube
        return make(self.dim - 1, points)

    def on_facets(self, name: str, *, varies: bool) -> tuple[Facets, Array, Array, Array, Array]:
        """The facets of a boundary with positions and outward normals times the area at points of a
        rule, the weights of these, and the shape functions there; ``varies``: what is integrated is
        no polynomial.
        """
        facets, (xi, weights) = self.facets(name), self.rule(11 if varies else self.degree + 2)
        values, _ = elements.shape(self.dim - 1, facets.nodes.shape[1], xi)
        return facets, *self.frames(facets, xi), weights, values

    def in_cells(
        self, rule: tuple[Array, Array] | None = None
    ) -> tuple[Array, Array, Array, Array]:
        """Positions (cells, points, d), weights (cells, points), shape functions (points, nodes)
        and their gradients (cells, points, nodes, d) at the points of a rule, or of one for loads.
        """
        make = elements.simplex if self.simplices else elements.cube
        xi, weights = rule or make(self.dim, 5 if self.simplices else self.degree + 2)
        values, slopes = elements.shape(self.dim, self.cells.shape[1], xi)
        place, _ = elements.shape(self.dim, self.mesh.cells.shape[1], xi)
        jacobian = self.jacobian(xi)
        gradients = np.einsum("pkj,cpji->cpki", slopes, np.linalg.inv(jacobian))
        x = np.einsum("cki,pk->cpi", self.mesh.points[self.mesh.cells], place)
        return x, np.abs(np.linalg.det(jacobian)) * weights, values, gradients

    def vectors(self, load: dict[str, Any], x: Array) -> Array:
        """The components of a load at points of shape (..., d), likewise."""
        flat = x.reshape(-1, self.dim)
        return np.stack(
            [at_points(load.get(k, 0.0), flat) for k in "xyz"[: self.dim]], axis=1
        ).reshape(x.shape)

    def load(self, step: int) -> Array:
        """L of a load step, one force per dof."""
        total = np.zeros(self.x.shape)
        for load in listed(self.scene, "traction"):
            varies = any(isinstance(load.get(k), str) for k in ("x", "y", "z", "pressure"))
            facets, x, normal, weights, values = self.on_facets(load["boundary"], varies=varies)
            area = np.linalg.norm(normal, axis=2)
            pressure = at_points(load.get("pressure", 0.0), x.reshape(-1, self.dim)).reshape(
                area.shape
            )
            force = self.vectors(load, x) * area[:, :, None] - pressure[:, :, None] * normal
            nodal = np.einsum("fpi,p,pk->fki", force, weights, values) * factor_of(load, step)
            np.add.at(total, facets.nodes, nodal)
        for load in listed(self.scene, "body_force"):
            x, size, values, _ = self.in_cells()
            nodal = np.einsum("cpi,cp,pk->cki", self.vectors(load, x), size, values)
            np.add.at(total, self.cells, nodal * factor_of(load, step))
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
            axes = "xyz"[: self.dim]
            directions = [
                (np.eye(self.dim)[axis], support[key])
                for axis, key in enumerate(axes)
                if key in support
            ]
            if "normal" in support:
                mean = self.middle_frames(facets).sum(axis=0)
                directions.append((mean / np.linalg.norm(mean), support["normal"]))
            for direction, value in directions:
                for node, number in zip(
                    nodes.tolist(), at_points(value, self.x[nodes]).tolist(), strict=True
                ):
                    found.setdefault(node, []).append((direction, number, support))
        return found

    @cached_property
    def held(self) -> Array:
        """The projection onto the directions that supports hold at each node, shape (nodes, d,
        d).
        """
        found = np.zeros((*self.x.shape, self.dim))
        for node, given in self._prescriptions.items():
            kept = np.zeros((0, self.dim))
            for direction, _, _ in reversed(given):
                kept, _ = _one_more(kept, direction)
            found[node] = kept.T @ kept
        return found

    def prescribed(self, step: int) -> Array:
        """A displacement that meets the supports of a load step and is zero elsewhere, shape
        (nodes, d).

        Of directions at a node that depend on each other the later ones hold.
        """
        u = np.zeros(self.x.shape)
        for node, given in self._prescriptions.items():
            kept = np.zeros((0, self.dim))
            for direction, value, effect in reversed(given):
                kept, rest = _one_more(kept, direction)
                if rest > 0:
                    wanted = value * factor_of(effect, step)
                    u[node] += kept[-1] * (wanted - direction @ u[node]) / rest
        return u

    @cached_property
    def free(self) -> csr_array:
        """Orthonormal free directions of all nodes, a column each, shape (d nodes, free)."""
        rows, columns, values, count = [], [], [], 0
        for node, held in enumerate(self.held):
            basis = null_space(held, rcond=0.5) if held.any() else np.eye(self.dim)
            for vector in basis.T:
                rows += [self.dim * node + axis for axis in range(self.dim)]
                columns += [count] * self.dim
                values += vector.tolist()
                count += 1
        return coo_array((values, (rows, columns)), shape=(self.x.size, count)).tocsr()

    # ---- rigid motions

    @cached_property
    def pieces(self) -> tuple[int, Ints]:
        """Number of connected pieces of the bodies, and the piece of each node."""
        size = len(self.x)
        first, rest = (
            np.repeat(self.cells[:, :1], self.cells.shape[1] - 1, axis=1),
            self.cells[:, 1:],
        )
        graph = coo_array((np.ones(first.size), (first.ravel(), rest.ravel())), shape=(size, size))
        count, labels = connected_components(graph, directed=False)
        return int(count), labels.astype(np.int64)

    @cached_property
    def rigid(self) -> Array:
        """The rigid motions of every piece (translations, and rotations about its middle), a column
        each.
        """
        count, labels = self.pieces
        columns = []
        for piece in range(count):
            here: npt.NDArray[np.bool_] = labels == piece
            x = np.pad(
                (self.x - self.x[here].mean(axis=0)) / self.size, ((0, 0), (0, 3 - self.dim))
            )
            turns = [
                np.cross(axis, x)[:, : self.dim] for axis in np.eye(3)[2 if self.dim == 2 else 0 :]
            ]
            for motion in (*np.eye(self.dim)[:, None], *turns):
                columns.append((motion * here[:, None]).ravel())
        return np.stack(columns, axis=1)


def across(along: Array) -> Array:
    """The normal of d - 1 tangents, as long as their area, shape (..., d, d - 1) -> (..., d)."""
    if along.shape[-1] == 1:
        return np.stack([along[..., 1, 0], -along[..., 0, 0]], axis=-1)
    return np.asarray(np.cross(along[..., 0], along[..., 1]))


def _one_more(kept: Array, direction: Array) -> tuple[Array, float]:
    """Orthonormal rows and the part of a direction that is new, and the length of that part, 0 if
    there is none.
    """
    rest = direction - kept.T @ (kept @ direction)
    length = float(np.linalg.norm(rest))
    if length < _INDEPENDENT:
        return kept, 0.0
    return np.concatenate([kept, rest[None] / length]), length


def behind(x: Array, cells: Ints, corners: int) -> Array:
    """The mean of the middles of the cells around each node, shape (nodes, d)."""
    middles = np.repeat(x[cells[:, :corners]].mean(axis=1), cells.shape[1], axis=0)
    found, count = np.zeros_like(x), np.zeros(len(x))
    np.add.at(found, cells.ravel(), middles)
    np.add.at(count, cells.ravel(), 1.0)
    return np.asarray(found / count[:, None])


def factor_of(effect: dict[str, Any], step: int) -> float:
    """The load factor of an effect in a load step."""
    return float(effect["factors"][step]) if "factors" in effect else 1.0
