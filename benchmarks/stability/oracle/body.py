"""The elastic body of a scene, assembled anew from its mesh as plain arrays."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial.distance import pdist

from benchmarks.stability.oracle import effects, elements
from benchmarks.stability.oracle.effects import listed
from benchmarks.stability.oracle.elements import Array, Ints, at_points


@dataclass(frozen=True)
class Mesh:
    """A mesh as plain arrays.

    Attributes:
        points: corners of the cells, and with cells of degree 2 the other nodes; shape (n, 2).
        cells: node numbers in the order of ``elements``, shape (cells, 3), (cells, 4), (cells, 6) or (cells, 9).
        boundaries: name -> the two ends of each facet, shape (facets, 2).
        regions: name -> cells.
    """

    points: Array
    cells: Ints
    boundaries: dict[str, Ints]
    regions: dict[str, Ints] = field(default_factory=dict)


@dataclass(frozen=True)
class Side:
    """The nodes of one contact boundary: number, weight and outward normal (or the scene's direction) of each."""

    part: int
    nodes: Ints
    weight: Array
    normal: Array

    @property
    def tangent(self) -> Array:
        """T = (-n_2, n_1)."""
        return np.stack([-self.normal[:, 1], self.normal[:, 0]], axis=1)


class Body:
    """Nodes, stiffness, loads and supports of a scene (as its TOML says it) on a mesh."""

    def __init__(self, scene: dict[str, Any], mesh: Mesh) -> None:
        self.scene = scene
        self.mesh = mesh
        corners, self.geometry_degree = elements.KINDS[mesh.cells.shape[1]]
        self.degree = int(scene.get("element", {}).get("degree", 1))
        if self.geometry_degree > self.degree:
            raise ValueError("curved cells need elements of degree 2")
        self.corners: Ints = mesh.cells[:, :corners]
        self._number_nodes()
        self._forces: dict[tuple[str, int], Array] = {}
        lists = [e["factors"] for key in ("displacement", "traction") for e in listed(scene, key) if "factors" in e]
        lists += [e["factors"] for k in ("body_force", *effects.LOADS) for e in listed(scene, k) if "factors" in e]
        self.steps = len(lists[0]) if lists else 1

    def _number_nodes(self) -> None:
        """Nodes of the displacement: the mesh's own, or with degree 2 on straight cells also middles of the sides."""
        mesh, corners = self.mesh, self.corners
        self.middle: dict[tuple[int, int], int] = {}
        if self.degree == 1:
            self.x, self.cells = mesh.points, mesh.cells
        elif self.geometry_degree == 2:
            self.x, self.cells = mesh.points, mesh.cells
            for k, (i, j) in enumerate(elements.SIDES[corners.shape[1]]):
                for row in mesh.cells:
                    self.middle[_pair(row[i], row[j])] = int(row[corners.shape[1] + k])
        else:
            points, rows = [mesh.points], []
            count = len(mesh.points)
            for row in corners:
                nodes = list(row)
                for i, j in elements.SIDES[corners.shape[1]]:
                    pair = _pair(row[i], row[j])
                    if pair not in self.middle:
                        self.middle[pair] = count
                        points.append(mesh.points[list(pair)].mean(axis=0)[None])
                        count += 1
                    nodes.append(self.middle[pair])
                if corners.shape[1] == 4:
                    points.append(mesh.points[row].mean(axis=0)[None])
                    nodes.append(count)
                    count += 1
                rows.append(nodes)
            self.x, self.cells = np.concatenate(points), np.array(rows, dtype=np.int64)

    # ---- elasticity

    @cached_property
    def lame(self) -> tuple[Array, Array]:
        """Lame parameters of each cell; the first one is reduced for plane stress."""
        first, second = np.full(len(self.cells), np.nan), np.full(len(self.cells), np.nan)
        for material in listed(self.scene, "material"):
            where = self.mesh.regions[material["region"]] if "region" in material else np.arange(len(self.cells))
            young, poisson = material["young"] * effects.graded(self, material)[where], float(material["poisson"])
            shear = young / 2 / (1 + poisson)
            plane_stress = material.get("hypothesis", "plane strain") == "plane stress"
            first[where] = 2 * shear * poisson / (1 - poisson if plane_stress else 1 - 2 * poisson)
            second[where] = shear
        if np.isnan(first).any():
            raise ValueError("a cell has no material")
        return first, second

    @cached_property
    def young(self) -> float:
        """The largest Young's modulus."""
        return max(float(material["young"]) for material in listed(self.scene, "material"))

    @cached_property
    def size(self) -> float:
        """The largest distance of two nodes of the mesh."""
        ends = np.unique(np.concatenate(self.exterior))
        return float(pdist(self.mesh.points[ends]).max())

    @cached_property
    def exterior(self) -> list[Ints]:
        """All nodes of the mesh on each side that belongs to one cell only."""
        count: dict[tuple[int, int], int] = {}
        for row in self.corners:
            for i, j in elements.SIDES[self.corners.shape[1]]:
                count[_pair(row[i], row[j])] = count.get(_pair(row[i], row[j]), 0) + 1
        curved = self.geometry_degree == 2
        return [
            np.array([*pair, *([self.middle[pair]] if curved else [])], dtype=np.int64)
            for pair, cells in count.items()
            if cells == 1
        ]

    @cached_property
    def reduced(self) -> bool:
        """Whether the volumetric term is integrated with the reduced rule."""
        wanted = self.scene.get("element", {}).get("volumetric", "full")
        if self.cells.shape[1] == 3 or wanted == "full":
            return False
        nearly = (
            m["poisson"] >= 0.45 and m.get("hypothesis", "plane strain") == "plane strain"
            for m in listed(self.scene, "material")
        )
        return wanted == "reduced" or any(nearly)

    @cached_property
    def stiffness(self) -> csr_array:
        """a(., .), dofs 2 n and 2 n + 1 at node n, nothing eliminated."""
        full = elements.stiffness_rule(self.cells.shape[1], curved=self.geometry_degree == 2)
        first, second = self.lame
        if self.reduced:
            total = self._cell_matrices(full, 0 * first, second)
            total += self._cell_matrices(elements.reduced_rule(self.cells.shape[1]), first, 0 * second)
        else:
            total = self._cell_matrices(full, first, second)
        dofs = (2 * self.cells[:, :, None] + np.arange(2)).reshape(len(self.cells), -1)
        rows, columns = np.broadcast_arrays(dofs[:, :, None], dofs[:, None, :])
        size = 2 * len(self.x)
        elastic = coo_array((total.ravel(), (rows.ravel(), columns.ravel())), shape=(size, size)).tocsr()
        return elastic + self.springs if self.scene.get("springs") else elastic

    @cached_property
    def springs(self) -> csr_array:
        """The part of a(., .) of springs."""
        return effects.springs(self)

    def of_materials(self, key: str) -> Array:
        """A number of the material of each cell."""
        found = np.zeros(len(self.cells))
        for material in listed(self.scene, "material"):
            where = self.mesh.regions[material["region"]] if "region" in material else np.arange(len(self.cells))
            found[where] = material[key]
        return found

    def _cell_matrices(self, rule: tuple[Array, Array], first: Array, second: Array) -> Array:
        """The stiffness matrix of every cell by a rule."""
        xi, weights = rule
        _, slopes = elements.shape(self.cells.shape[1], xi)
        nodes = self.cells.shape[1]
        total = np.zeros((len(self.cells), 2 * nodes, 2 * nodes))
        for point, weight in enumerate(weights):
            jacobian = self.jacobian(xi[point : point + 1])[:, 0]
            size = np.abs(np.linalg.det(jacobian)) * weight
            g = np.einsum("kj,cji->cki", slopes[point], np.linalg.inv(jacobian))
            block = np.einsum("c,cai,cbj->caibj", first * size, g, g)
            block += np.einsum("c,caj,cbi->caibj", second * size, g, g)
            dot = np.einsum("c,cak,cbk->cab", second * size, g, g)
            for i in range(2):
                block[:, :, i, :, i] += dot
            total += block.reshape(len(self.cells), 2 * nodes, 2 * nodes)
        return total

    def jacobian(self, xi: Array) -> Array:
        """D x_i / d xi_j in every cell at the points xi, shape (cells, points, 2, 2)."""
        _, slopes = elements.shape(self.mesh.cells.shape[1], xi)
        return np.einsum("cki,pkj->cpij", self.mesh.points[self.mesh.cells], slopes)

    # ---- facets and loads

    @cached_property
    def _inside(self) -> dict[tuple[int, int], Array]:
        """A point of the cell behind each side."""
        found = {}
        for row in self.corners:
            centre = self.mesh.points[row].mean(axis=0)
            for i, j in elements.SIDES[self.corners.shape[1]]:
                found[_pair(row[i], row[j])] = centre
        return found

    def facet_nodes(self, name: str) -> Ints:
        """Nodes of the displacement on each facet: the ends, and the middle with degree 2."""
        ends = self.mesh.boundaries[name]
        if self.degree == 1:
            return ends
        return np.array([[a, b, self.middle[_pair(a, b)]] for a, b in ends], dtype=np.int64).reshape(-1, 3)

    def facet_frames(self, name: str, s: Array) -> tuple[Array, Array]:
        """Positions, and outward normals times the length per s, at points s of each facet: (facets, points, 2)."""
        ends = self.mesh.boundaries[name]
        nodes = ends if self.geometry_degree == 1 else self.facet_nodes(name)
        values, slopes = elements.line(self.geometry_degree, s)
        x = self.mesh.points[nodes]
        along = np.einsum("fki,pk->fpi", x, slopes)
        normal = np.stack([along[:, :, 1], -along[:, :, 0]], axis=2)
        inside = np.array([self._inside[_pair(a, b)] for a, b in ends])
        outward = np.einsum("fi,fi->f", normal.sum(axis=1), x[:, :2].mean(axis=1) - inside)
        return np.einsum("fki,pk->fpi", x, values), normal * np.sign(outward)[:, None, None]

    def load(self, step: int) -> Array:
        """L of a load step, one force per dof."""
        total = np.zeros((len(self.x), 2))
        for load in listed(self.scene, "traction"):
            varies = any(isinstance(load.get(k), str) for k in ("x", "y", "pressure"))
            s, weights = elements.gauss(11 if varies else self.degree + 2)
            values, _ = elements.line(self.degree, s)
            x, normal = self.facet_frames(load["boundary"], s)
            flat, length = x.reshape(-1, 2), np.linalg.norm(normal, axis=2)
            force = np.stack([at_points(load.get(k, 0.0), flat).reshape(length.shape) * length for k in "xy"], axis=2)
            force -= at_points(load.get("pressure", 0.0), flat).reshape(length.shape)[:, :, None] * normal
            nodal = np.einsum("fpi,p,pk->fki", force, weights, values) * factor_of(load, step)
            np.add.at(total, self.facet_nodes(load["boundary"]), nodal)
        for load in listed(self.scene, "body_force"):
            xi, weights = elements.triangle(6) if self.corners.shape[1] == 3 else elements.square(self.degree + 2)
            values, _ = elements.shape(self.cells.shape[1], xi)
            place, _ = elements.shape(self.mesh.cells.shape[1], xi)
            x = np.einsum("cki,pk->cpi", self.mesh.points[self.mesh.cells], place)
            size = np.abs(np.linalg.det(self.jacobian(xi))) * weights
            force = np.stack(
                [at_points(load.get(k, 0.0), x.reshape(-1, 2)).reshape(size.shape) * size for k in "xy"], axis=2
            )
            np.add.at(total, self.cells, np.einsum("cpi,pk->cki", force, values) * factor_of(load, step))
        for key in effects.LOADS:
            for number, load in enumerate(listed(self.scene, key)):
                if (key, number) not in self._forces:
                    self._forces[key, number] = effects.forces(self, key, load)
                total += self._forces[key, number] * factor_of(load, step)
        return total.ravel()

    def prescribed(self, step: int) -> Array:
        """Prescribed displacement of each dof in a load step, NaN where it is free; a later support wins."""
        values = np.full((len(self.x), 2), np.nan)
        for support in listed(self.scene, "displacement"):
            nodes = np.unique(self.facet_nodes(support["boundary"]))
            for axis, key in enumerate("xy"):
                if key in support:
                    values[nodes, axis] = at_points(support[key], self.x[nodes]) * factor_of(support, step)
            if "normal" in support:
                _, normal = self.facet_frames(support["boundary"], np.array([0.5]))
                axis = int(np.argmax(np.abs(normal[0, 0])))
                sign = np.sign(normal[0, 0, axis])
                values[nodes, axis] = sign * at_points(support["normal"], self.x[nodes]) * factor_of(support, step)
        return values.ravel()

    # ---- contact

    @cached_property
    def sides(self) -> list[Side]:
        """The contact boundaries, by a quadrature rule whose points are the nodes: trapezoidal, or Simpson's."""
        places, weights = (
            (np.array([0.0, 1.0]), np.array([0.5, 0.5]))
            if self.degree == 1
            else (np.array([0.0, 1.0, 0.5]), np.array([1.0, 1.0, 4.0]) / 6)
        )
        found = []
        for part, effect in enumerate(listed(self.scene, "contact")):
            _, normal = self.facet_frames(effect["boundary"], places)
            moments = np.zeros((len(self.x), 2))
            facets = self.facet_nodes(effect["boundary"])
            np.add.at(moments, facets, normal * weights[:, None])
            nodes = np.unique(facets)
            weight = np.linalg.norm(moments[nodes], axis=1)
            normals = moments[nodes] / weight[:, None]
            if "foundation" in effect:
                _, normals = effects.from_shape(effect["foundation"], self.x[nodes])
            if "direction" in effect:
                direction = np.array(effect["direction"], dtype=float)
                normals = np.tile(direction / np.linalg.norm(direction), (len(nodes), 1))
            found.append(Side(part, nodes, weight, normals))
        return found

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
        """The rigid motions of every piece (two translations, a rotation about its middle), a column each."""
        count, labels = self.pieces
        columns = []
        for piece in range(count):
            here = labels == piece
            x = self.x - self.x[here].mean(axis=0)
            for motion in (np.array([1.0, 0.0]), np.array([0.0, 1.0]), None):
                values = (
                    np.stack([-x[:, 1], x[:, 0]], axis=1) / self.size
                    if motion is None
                    else np.tile(motion, (len(x), 1))
                )
                columns.append((values * here[:, None]).ravel())
        return np.stack(columns, axis=1)


def behind(x: Array, cells: Ints, corners: int) -> Array:
    """The mean of the middles of the cells around each node, shape (nodes, d)."""
    middles = np.repeat(x[cells[:, :corners]].mean(axis=1), cells.shape[1], axis=0)
    found, count = np.zeros_like(x), np.zeros(len(x))
    np.add.at(found, cells.ravel(), middles)
    np.add.at(count, cells.ravel(), 1.0)
    return np.asarray(found / count[:, None])


def _pair(a: int, b: int) -> tuple[int, int]:
    return (int(a), int(b)) if a < b else (int(b), int(a))


def factor_of(effect: dict[str, Any], step: int) -> float:
    """The load factor of an effect in a load step."""
    return float(effect["factors"][step]) if "factors" in effect else 1.0
