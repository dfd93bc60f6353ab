"""Forces at the nodes of a mesh that are equivalent to the loads of a scene, supports and springs, in NumPy."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import basix
import numpy as np
from scipy.sparse import coo_array, csr_array

from signorini_fx.addons.judging.problem_data import JudgedMaterial, JudgedMesh, facet_points
from signorini_fx.addons.judging.reference_elements import ReferenceElement, gauss
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints
from signorini_fx.mechanics.statement.cut_simplices import cut
from signorini_fx.mechanics.statement.effect import Effect, Force, InitialStrain, Load, Resistance
from signorini_fx.mechanics.statement.expressions import Expression, in_space, sample
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.tuned import JUDGED_DEGREES, JUDGED_LOAD_POINTS, SAME_LENGTH

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
    statement: Statement,
    position: float,
    mesh: JudgedMesh,
    materials: tuple[JudgedMaterial, ...],
    *,
    revolved: bool,
    degree: int | None = None,
) -> tuple[dict[str, Floats], Reasons]:
    """Forces at the nodes by the names of loads, and what acts that is not known here.

    Args:
        statement: what is stated.
        position: in the lists of factors.
        mesh: the mesh.
        materials: of the body.
        revolved: whether the mesh is a section of a body of revolution; then forces are per radian.
        degree: of the quadrature of loads that jump; None: on the parts between the jumps.
    """
    forces: dict[str, Floats] = {}
    reasons: Reasons = []
    for _, entry in statement.listed():
        if not entry.acts or not isinstance(entry, Load):
            continue
        factor, load = statement.now(entry, position)
        if not isinstance(load, Force):
            if load.label != "displacement" and not isinstance(load, InitialStrain):
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
        forces[name] = factor / share * _forces(load, mesh, materials, degree, revolved=revolved)
    return forces, reasons


def _name(load: Force) -> str:
    """As people say it."""
    values = {key: value for key, value in load.given.items() if not (isinstance(value, float) and value == 0.0)}
    word = "pressure" if list(values) == ["pressure"] else load.label
    return word if load.where is None else f"{word} on {load.where}"


def loads_by_degree(
    statement: Statement, position: float, mesh: JudgedMesh, materials: tuple[JudgedMaterial, ...], *, revolved: bool
) -> dict[str, dict[str, Floats]]:
    """Loads that jump inside facets or cells as programs integrate them that do not look for jumps, by what is to be
    said of it; nothing if none jumps.  The arguments are those of ``loads_of``.
    """
    loads = [statement.now(entry, position)[1] for _, entry in statement.listed() if isinstance(entry, Load)]
    jumping = [load for load in loads if isinstance(load, Force) and load.jumps]
    degrees = {*JUDGED_DEGREES, *(load.degree(mesh.element.degree) for load in jumping)} if jumping else ()
    return {
        f"loads that jump by quadrature of degree {degree}": loads_of(
            statement, position, mesh, materials, revolved=revolved, degree=degree
        )[0]
        for degree in sorted(degrees)
    }


@dataclass(frozen=True)
class _MovedPoints(LoadPoints):
    """Points of a boundary that moves by the same everywhere.

    Attributes:
        moved: by what, length, shape (d,).
    """

    moved: Floats

    @property
    def displacement(self) -> Floats:
        """At the points, length, shape (f, q, d)."""
        return np.broadcast_to(self.moved, self.x.shape)


def springs_of(
    statement: Statement, position: float, mesh: JudgedMesh, *, revolved: bool
) -> tuple[dict[str, csr_array], Reasons]:
    """The stiffness of springs on boundaries by their names, force per length, shape (n d, n d), and what is not known.

    Args:
        statement: what is stated.
        position: in the lists of factors.
        mesh: the mesh.
        revolved: whether the mesh is a section of a body of revolution; then forces are per radian.
    """
    springs: dict[str, csr_array] = {}
    reasons: Reasons = []
    for _, entry in statement.listed():
        if not entry.acts or not isinstance(entry, Resistance):
            continue
        if entry.where is None or entry.timed:
            reasons.append(f"{entry.name} is not judged yet")
            continue
        facets = mesh.boundaries[entry.where]
        if switches_inside(entry, mesh.facet, mesh.points[facets], kinks=False):
            reasons.append(f"{entry.name} may jump inside facets, which is not judged yet")
            continue
        at = facet_points(mesh, facets, JUDGED_LOAD_POINTS, revolved=revolved)
        axes = [
            entry.reaction_at(_MovedPoints(at.x, at.normal, at.weight, np.zeros(at.weight.shape), axis))
            for axis in np.eye(mesh.dim)
        ]
        blocks = np.einsum("fq,qk,ql,jfqi->fkilj", at.weight, at.shape, at.shape, np.array(axes), optimize=True)
        numbers = (facets[:, :, None] * mesh.dim + np.arange(mesh.dim)).reshape(len(facets), -1)
        rows, columns = np.repeat(numbers, numbers.shape[1], axis=1), np.tile(numbers, numbers.shape[1])
        entries = (blocks.ravel(), (rows.ravel(), columns.ravel()))
        name = f"springs on {entry.where}"
        stiffness = csr_array(coo_array(entries, shape=(mesh.points.size,) * 2))
        springs[name] = springs[name] + stiffness if name in springs else stiffness
    return springs, reasons


def _forces(
    load: Force, mesh: JudgedMesh, materials: tuple[JudgedMaterial, ...], degree: int | None, *, revolved: bool
) -> Floats:
    forces = np.zeros(mesh.points.shape)
    if load.nodal:
        listed: Any = load
        table = listed.table(mesh.dim)
        for at, region, vector in zip(table.points, table.regions, table.vectors, strict=True):
            forces[_node_at(mesh, at, region or None)] += vector
        return forces
    if load.where is not None:
        facets = mesh.boundaries[load.where]
        rule, facets = _rule(mesh.facet, mesh.points, facets, load, degree)
        at = facet_points(mesh, facets, JUDGED_LOAD_POINTS, revolved=revolved, rule=rule)
        points = LoadPoints(at.x, at.normal, at.weight, np.zeros(at.weight.shape))
        shape = np.broadcast_to(at.shape, (*at.weight.shape, at.shape.shape[-1]))
        _add(forces, facets, shape, points, load)
        return forces
    for material in materials:
        rule, cells = _rule(mesh.element, mesh.points, mesh.cells[material.cells], load, degree)
        places, weights = rule
        flat = places.reshape(-1, mesh.dim)
        shape = mesh.element.shape(flat).reshape(*weights.shape, -1)
        gradient = mesh.element.gradient(flat).reshape(*shape.shape, mesh.dim)
        x = np.einsum("mqk,mkd->mqd", shape, mesh.points[cells])
        size = np.abs(np.linalg.det(np.einsum("mqkj,mkd->mqdj", gradient, mesh.points[cells]))) * weights
        size = size * (x[..., 0] if revolved else 1.0)
        density = np.full(size.shape, 0.0 if material.density is None else material.density)
        _add(forces, cells, shape, LoadPoints(x, np.zeros_like(x), size, density), load)
    return forces


def _add(forces: Floats, nodes: Ints, shape: Floats, points: LoadPoints, load: Force) -> None:
    density = load.density_at(points)
    parts = np.einsum("fq,fqd,fqk->fkd", points.weight, density, shape)
    np.add.at(forces, nodes, parts)


def _rule(
    element: ReferenceElement, points: Floats, nodes: Ints, load: Force, degree: int | None
) -> tuple[tuple[Floats, Floats], Ints]:
    """Places and weights of quadrature in facets or cells, and their nodes.

    Where a load jumps inside, there is a rule on each part between the jumps, which is as good as the cells are affine.

    Returns:
        Places and weights, shapes (m, q, dim) and (m, q), and nodes, shape (m, k).

    Args:
        element: of the facets or cells.
        points: positions of nodes, length, shape (n, d).
        nodes: of each, shape (f, k).
        load: the load.
        degree: of the rule of a load that jumps; None: on the parts.
    """
    if not load.jumps or degree is not None or not len(nodes):
        if degree is None or not load.jumps:
            places, weights = gauss(JUDGED_LOAD_POINTS, element.dim, simplex=element.simplex)
        else:
            places, weights = basix.make_quadrature(_BASIX[element.corner_count, element.dim], degree)
        shape = len(nodes), *weights.shape
        return (np.broadcast_to(places, (*shape, element.dim)), np.broadcast_to(weights, shape)), nodes
    corners, x = _filled(element, points[nodes])
    owner, parts = cut(x, load.jumps)
    facet, simplex = np.divmod(owner, len(corners))
    inner, weights = gauss(JUDGED_LOAD_POINTS, element.dim, simplex=True)
    local = np.column_stack((1 - inner.sum(axis=1), inner)) @ parts
    edges = corners[:, 1:] - corners[:, :1]
    size = np.abs(np.linalg.det(edges))[simplex] * np.abs(np.linalg.det(parts))
    return (local @ corners[simplex], size[:, None] * weights), nodes[facet]


def _filled(element: ReferenceElement, x: Floats) -> tuple[Floats, Floats]:
    """Simplices that fill facets or cells with the nodes x, shape (f, k, d): their corners in the reference cell, shape
    (s, c, dim), and their positions, length, shape (f s, c, d).
    """
    corners = element.nodes[np.array(_FILLINGS[element.corner_count, element.dim])]
    at_corners = element.shape(corners.reshape(-1, element.dim)).reshape(*corners.shape[:2], -1)
    return corners, np.einsum("scn,fnd->fscd", at_corners, x).reshape(-1, corners.shape[1], x.shape[2])


def switches_inside(effect: Effect, element: ReferenceElement, x: Floats, *, kinks: bool) -> bool:
    """Whether what an effect varies by may jump inside facets or cells with the nodes x, length, shape (f, k, d), or
    has a kink there, if ``kinks``.
    """
    expressions = [value for value in effect.given.values() if isinstance(value, Expression)]
    switching = [value for value in expressions if value.jumps or (kinks and value.switch_count)]
    if not switching or not len(x):
        return False
    sizes = np.abs(np.linalg.det(cut(_filled(element, x)[1], switching)[1]))
    return bool(((sizes > SAME_LENGTH) & (sizes < 1 - SAME_LENGTH)).any())


# By the number of corners and the dimension of a facet or cell: the cell of basix, and simplices that fill it.
_BASIX = {
    (2, 1): basix.CellType.interval,
    (3, 2): basix.CellType.triangle,
    (4, 2): basix.CellType.quadrilateral,
    (4, 3): basix.CellType.tetrahedron,
    (8, 3): basix.CellType.hexahedron,
}
_FILLINGS = {
    (2, 1): ((0, 1),),
    (3, 2): ((0, 1, 2),),
    (4, 2): ((0, 1, 2), (0, 2, 3)),
    (4, 3): ((0, 1, 2, 3),),
    (8, 3): tuple((0, *pair, 6) for pair in ((1, 2), (2, 3), (3, 7), (7, 4), (4, 5), (5, 1))),
}


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
