"""Loads that jump inside a facet or cell that is not cut there: quadrature takes a part of their force wrong."""

from __future__ import annotations

from itertools import combinations
from typing import Any, NamedTuple

import basix
import numpy as np
import numpy.typing as npt

from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.assembly.mesh_entities import facet_entities
from signorini_fx.mechanics.loads.cut_loads import PARTS, SIMPLICES, cut_rule
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.effect import Force
from signorini_fx.mechanics.statement.expressions import Expression, in_space, sample
from signorini_fx.records import Finding
from signorini_fx.tuned import FIRST_DEGREE, MANY_LOADED, MISSED_INTERPOLATED_LOAD, MISSED_LOAD, SUSPECT_LOAD

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int32]

# How often the simplices that fill a facet or a cell are halved for the rule to compare with, and its degree.
_HALVED_FACETS, _HALVED_CELLS, _DEGREE = 8, 4, 5
# Facets or cells that are looked at together.
_TOGETHER = 2000


class _Rule(NamedTuple):
    """Points in the reference cell, shape (q, t), their weights, shape (q,), and axes of the facet or cell there."""

    points: Array
    weights: Array
    axes: Array


def jumping_loads(model: Model) -> list[Finding]:
    """A warning for each load of which the rule on facets or cells misses a part; collective."""
    findings = []
    for path, entry in model.statement.listed():
        if not isinstance(entry, Force):
            continue
        load = model.statement.now(entry, 0)[1]
        given = load.given | ({} if load.weighting is None else {"spread": load.weighting})
        values = {key: value for key, value in given.items() if _may_jump(value)}
        if not values:
            continue
        rule, topology = cut_rule(load, model.coefficients), model.tagged.mesh.topology
        kind, where = ("cell", "") if load.where is None else ("facet", f" of {load.where!r}")
        every = (
            np.arange(topology.index_map(topology.dim).size_local, dtype=np.int32)
            if load.where is None
            else model.tagged.facets(load.where)
        )
        uncut = every if rule is None else np.setdiff1d(every, rule.entities)
        for key, value in values.items():
            missed, sizes = _missed(model, uncut, value, load).T
            little = MISSED_LOAD if isinstance(value, Expression) else MISSED_INTERPOLATED_LOAD
            wrong = missed > little * parallel.global_max(model.comm, float(sizes.max(initial=0.0)))
            on_parts = 0.0 if rule is None else float((np.abs(rule.value(value)) * rule.size).sum())
            sums = np.array([wrong.sum(), missed[wrong].sum(), sizes.sum() + on_parts])
            count, part, size = (float(total) for total in parallel.global_sum(model.comm, sums))
            if part <= MISSED_LOAD * size:
                continue
            inside, share = f"inside {count:.0f} {kind}{'s' * (count != 1)}{where}", f"{100 * part / size:.2g} %"
            message = f"jumps {inside}, where the points of quadrature take {share} of it wrong: "
            if not isinstance(value, Expression):
                message = (
                    f"is a function of Python, which elements interpolate between nodes: {inside} this takes {share} "
                    "of it wrong: write it as an expression, "
                )
            message += "give the mesh nodes where it jumps, or smaller cells there"
            findings.append(Finding("warning", f"{path}.{key}", message))
    return findings


def _may_jump(value: Any) -> bool:
    """Whether a value may jump where the mesh has no nodes."""
    return value.jumps if isinstance(value, Expression) else callable(value) and not hasattr(value, "ufl_shape")


def _missed(model: Model, every: Indices, value: Any, load: Force) -> Array:
    """The force that the rule misses on facets or cells, and that on them, sizes, shape (n, 2).

    Args:
        model: the model.
        every: the facets or cells, local numbers.
        value: a component of the load.
        load: the load.
    """
    mesh, rows = model.tagged.mesh, [np.zeros((0, 2))]
    cell, across = getattr(basix.CellType, mesh.topology.cell_name()), mesh.topology.dim
    entities, sides, kind, often = np.column_stack((every, 0 * every)), [basix.geometry(cell)], cell, _HALVED_CELLS
    if load.where is not None:
        entities, often = facet_entities(mesh, every), _HALVED_FACETS
        sides = [basix.geometry(cell)[corners] for corners in basix.topology(cell)[across - 1]]
        kind = basix.cell.subentity_types(cell)[across - 1][0]
    rules = [basix.make_quadrature(kind, load.degree(model.statement.element.degree))]
    rules += [_halved(kind, 0 if load.where is None else 1, FIRST_DEGREE)] if len(every) > MANY_LOADED else []
    rules += [_halved(kind, often, _DEGREE)]
    reference = basix.geometry(kind)
    ends_of_axes = [1, 2, 4 if len(reference) == 8 else 3][: reference.shape[1]]
    for side, corners in enumerate(sides):
        on_side = entities[entities[:, 1] == side, 0]
        if not len(on_side):
            continue
        # A facet in the reference cell is an affine image of its own reference, whose axes are at these corners.
        axes = corners[ends_of_axes] - corners[0]
        coarse, *finer = (_Rule(corners[0] + points @ axes, weights, axes) for points, weights in rules)
        for cells in np.array_split(on_side, -(-len(on_side) // _TOGETHER)):
            nodes = mesh.geometry.x[compat.geometry_cells(mesh)[cells]]
            known = _forces(model, value, coarse, nodes, interpolated=not isinstance(value, Expression)).sum(axis=1)
            row = np.zeros((len(cells), 2))
            near: npt.NDArray[np.intp] = np.arange(len(cells))
            for rule in finer:
                forces = _forces(model, value, rule, nodes[near])
                row[near] = np.abs(np.column_stack((forces.sum(axis=1) - known[near], np.abs(forces).sum(axis=1))))
                near = np.flatnonzero(row[:, 0] > SUSPECT_LOAD * row[:, 1].max(initial=0.0))
            rows.append(row)
    return np.concatenate(rows)


def _halved(kind: basix.CellType, often: int, degree: int) -> tuple[Array, Array]:
    """A rule on a reference facet or cell, on the parts of its longest edges' halves."""
    simplices = basix.geometry(kind)[np.array(PARTS[kind])]
    pairs = np.array(list(combinations(range(simplices.shape[1]), 2)))
    for _ in range(often):
        lengths = np.linalg.norm(simplices[:, pairs[:, 0]] - simplices[:, pairs[:, 1]], axis=2)
        first, second = pairs[lengths.argmax(axis=1)].T
        numbers = np.arange(len(simplices))
        middle = (simplices[numbers, first] + simplices[numbers, second]) / 2
        halves = simplices.copy(), simplices.copy()
        halves[0][numbers, first], halves[1][numbers, second] = middle, middle
        simplices = np.concatenate(halves)
    points, weights = basix.make_quadrature(
        SIMPLICES[simplices.shape[2]], degree, rule=basix.QuadratureType.gauss_jacobi
    )
    edges = simplices[:, 1:] - simplices[:, :1]
    places = simplices[:, :1] + points @ edges
    return places.reshape(-1, simplices.shape[2]), (np.abs(np.linalg.det(edges))[:, None] * weights).ravel()


def _forces(model: Model, value: Any, rule: _Rule, nodes: Array, *, interpolated: bool = False) -> Array:
    """A value times the length, area or volume that points of a rule stand for, shape (n, q).

    Args:
        model: the model.
        value: a component of a load.
        rule: in the reference cell.
        nodes: of the geometry of the cells, length, shape (n, g, 3).
        interpolated: whether elements interpolate it.
    """
    geometry = compat.geometry_element(model.tagged.mesh)

    def at(points: Array) -> tuple[Array, Array]:
        table = geometry.tabulate(1, points)[..., 0]
        along = np.einsum("tk,kqg->qtg", rule.axes, table[1:])
        slopes = along.reshape(-1, along.shape[2]) @ nodes
        return table[0] @ nodes, slopes.reshape(len(nodes), *along.shape[:2], 3)

    def values(x: Array) -> Array:
        return sample(value, in_space(x.reshape(-1, 3))).reshape(x.shape[:2])

    x, slopes = at(rule.points)
    squares = slopes @ slopes.swapaxes(2, 3)
    squared = squares[..., 0, 0] if squares.shape[2] == 1 else np.linalg.det(squares)
    size = np.sqrt(np.abs(squared)) * rule.weights
    size *= model.kinematics.measure(np.moveaxis(x, -1, 0))
    if not interpolated:
        return values(x) * size
    element = model.space.element.basix_element
    return values(at(element.points)[0]) @ element.tabulate(0, rule.points)[0, ..., 0].T * size
