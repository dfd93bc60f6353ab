"""Forces at the nodes of a mesh that are equivalent to the loads of a scene, by quadrature in NumPy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from signorini_fx.addons.judging.problem_data import JudgedMaterial, JudgedMesh, facet_points
from signorini_fx.addons.judging.reference_elements import gauss
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints
from signorini_fx.mechanics.statement.effect import Effect, Force, Load
from signorini_fx.mechanics.statement.expressions import in_space, sample
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.tuned import JUDGED_LOAD_POINTS

# In words what is not known of a problem that is judged.
Reasons = list[str]


@dataclass(frozen=True)
class LoadPoints:
    """Points of quadrature, ``statement.effect.BodyPoints``.

    Attributes:
        x: positions, shape (f, q, d).
        normal: outward on a boundary, shape (f, q, d); in the body zero.
        weight: area or volume, shape (f, q).
        densities: mass per volume, shape (f, q).
    """

    x: Floats
    normal: Floats
    weight: Floats
    densities: Floats

    @property
    def position(self) -> Floats:
        """Of the points, shape (f, q, d)."""
        return self.x

    @property
    def density(self) -> Floats:
        """Mass per volume, shape (f, q)."""
        return self.densities

    @property
    def displacement(self) -> Floats:
        """Of a load that follows it, which is not judged."""
        raise NotImplementedError

    def total(self, effect: Effect) -> Any:
        """The integral of what the force is proportional to."""
        return float((self.weight * self.value(effect.weighting)).sum())

    def value(self, value: Any) -> Floats:
        """Of a number, an expression or a callable, shape (f, q)."""
        return sample(value, in_space(self.x.reshape(-1, self.x.shape[2]))).reshape(self.x.shape[:2])

    def vector(self, values: tuple[Any, ...]) -> Floats:
        """Values along the axes, shape (f, q, d)."""
        return np.stack([self.value(value) for value in values[: self.x.shape[2]]], axis=2)


def loads_of(
    statement: Statement, position: float, mesh: JudgedMesh, materials: tuple[JudgedMaterial, ...], *, revolved: bool
) -> tuple[dict[str, Floats], Reasons]:
    """Forces at the nodes by the names of loads, and what acts that is not known here.

    Args:
        statement: what is stated.
        position: in the lists of factors.
        mesh: the mesh.
        materials: of the body.
        revolved: whether the mesh is a section of a body of revolution; then forces are per radian.
    """
    forces: dict[str, Floats] = {}
    reasons: Reasons = []
    for _, entry in statement.listed():
        if not entry.acts or not isinstance(entry, Load):
            continue
        factor, load = statement.now(entry, position)
        if not isinstance(load, Force):
            if load.label != "displacement":
                reasons.append(f"{load.name} is not judged yet")
            continue
        if getattr(load, "enters", ()):
            reasons.append(f"{load.name} enters contact, which is not judged yet")
            continue
        name = _name(load)
        while name in forces:
            name += "'"
        total = load.weighting is not None or load.nodal
        share = 2 * np.pi if revolved and total else 1.0  # a total is that of a revolution
        forces[name] = factor / share * _forces(load, mesh, materials, revolved=revolved)
    return forces, reasons


def _name(load: Force) -> str:
    """As people say it."""
    values = {key: value for key, value in load.given.items() if not (isinstance(value, float) and value == 0.0)}
    word = "pressure" if list(values) == ["pressure"] else load.label
    return word if load.where is None else f"{word} on {load.where}"


def _forces(load: Force, mesh: JudgedMesh, materials: tuple[JudgedMaterial, ...], *, revolved: bool) -> Floats:
    forces = np.zeros(mesh.points.shape)
    if load.nodal:
        listed: Any = load
        table = listed.table(load.label, mesh.dim)
        for at, region, vector in zip(table.points, table.regions, table.vectors, strict=True):
            forces[_node_at(mesh, at, region or None)] += vector
        return forces
    if load.where is not None:
        facets = mesh.boundaries[load.where]
        at = facet_points(mesh, facets, JUDGED_LOAD_POINTS, revolved=revolved)
        points = LoadPoints(at.x, at.normal, at.weight, np.zeros(at.weight.shape))
        _add(forces, facets, at.shape, points, load)
        return forces
    for material in materials:
        cells = mesh.cells[material.cells]
        places, weights = gauss(JUDGED_LOAD_POINTS, mesh.dim, simplex=mesh.element.simplex)
        shape, gradient = mesh.element.shape(places), mesh.element.gradient(places)
        x = np.einsum("qk,mkd->mqd", shape, mesh.points[cells])
        size = np.abs(np.linalg.det(np.einsum("qkj,mkd->mqdj", gradient, mesh.points[cells]))) * weights
        size = size * (x[..., 0] if revolved else 1.0)
        density = np.full(size.shape, 0.0 if material.density is None else material.density)
        _add(forces, cells, shape, LoadPoints(x, np.zeros_like(x), size, density), load)
    return forces


def _add(forces: Floats, nodes: Ints, shape: Floats, points: LoadPoints, load: Force) -> None:
    density = load.density_at(points)
    parts = np.einsum("fq,fqd,qk->fkd", points.weight, density, shape)
    np.add.at(forces, nodes, parts)


def prescribed_of(statement: Statement, position: float, mesh: JudgedMesh) -> tuple[Floats, Reasons]:
    """Prescribed displacements at nodes, NaN where they are free, shape (n, d), and what is not known here.

    Args:
        statement: what is stated.
        position: in the lists of factors.
        mesh: the mesh.
    """
    prescribed = np.full(mesh.points.shape, np.nan)
    reasons: Reasons = []
    for entry in statement.displacement:
        if not entry.holds_at(position):
            continue
        factor, support = statement.now(entry, position)
        if support.at is None:
            nodes = np.unique(mesh.boundaries[support.boundary])
        else:
            nodes = _node_at(mesh, np.array(support.at), support.region)
        x = in_space(mesh.points[nodes])
        for axis, value in enumerate(support.components[: mesh.dim]):
            if value is not None:
                prescribed[nodes, axis] = factor * sample(value, x)
        if support.normal is None:
            continue
        facets = mesh.boundaries[support.boundary]
        normals = facet_points(mesh, facets, 1, revolved=False).normal[:, 0]
        axis = int(np.argmax(np.abs(normals[0])))
        if (np.abs(np.abs(normals[:, axis]) - 1) > 1e-9).any():
            reasons.append(f"{support.name} along a normal that is along no axis is not judged yet")
            continue
        sign = np.sign(normals[0, axis])
        prescribed[nodes, axis] = sign * factor * sample(support.normal, x)
    return prescribed, reasons


def _node_at(mesh: JudgedMesh, at: Floats, region: str | None) -> Ints:
    """The node at a point, in a region."""
    nodes = np.arange(len(mesh.points)) if region is None else np.unique(mesh.cells[mesh.regions[region]])
    away = np.linalg.norm(mesh.points[nodes] - at, axis=1)
    return np.asarray(nodes[[int(np.argmin(away))]])
