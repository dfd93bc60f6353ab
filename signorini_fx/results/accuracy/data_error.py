"""Data that a mesh does not resolve: loads between quadrature points, gap and friction between nodes.

If a load, a gap or a friction bound jumps between nodes, a well resolved solution may belong to other data.  The data
are evaluated at many more points; the difference is a separate error, which is refined like the others.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import default_scalar_type, fem

from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import assemble, facet_entities
from signorini_fx.mechanics.contact_points.contact_table import ContactTable
from signorini_fx.mechanics.loads.load_vectors import measures
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.effect import Force
from signorini_fx.mechanics.statement.expressions import sample
from signorini_fx.mechanics.statement.rigid_shape import Distance
from signorini_fx.results.accuracy.contact_surface import ContactSurface
from signorini_fx.results.accuracy.pressure_error import around, on_facets
from signorini_fx.tuned import SMOOTH_LARGEST, SMOOTH_MEAN

Floats = npt.NDArray[np.float64]

# Quadrature to compare with, by dimension: 31 points along a facet and 100 in a cell; in 3D 441 and 343.
_FACET_DEGREE, _CELL_DEGREE = {2: 60, 3: 40}, {2: 18, 3: 12}
# Points between two nodes, in 2D and along a side of a piece of the contact surface.
_POINTS, _POINTS_ALONG = 32, 8


@dataclass(frozen=True)
class DataError:
    """The errors of the data.

    Attributes:
        forces: error of loads and friction in each owned cell, force (in 2D per thickness), shape (cells,).
        squares: squared energy norm of the error of the gap in each owned cell, shape (cells,).
        total: size of all forces together, force (in 2D per thickness).
    """

    forces: Floats
    squares: Floats
    total: float


def data_error(model: Model, table: ContactTable, step: float) -> DataError:
    """Evaluate the data between nodes and quadrature points; collective.

    Args:
        model: the model.
        table: the contact boundary after the load step.
        step: the load step.
    """
    assert model.boundary is not None
    cells = contact_cells(model)
    forces = _missed_loads(model, step)
    squares = np.zeros_like(forces)
    if table.facets is None:
        friction, gap = _between_nodes(model, table)
        rings = around(table, model.kinematics)
        squared = [errors**2 for errors in gap]
        missed = [
            on_facets(model.boundary, table, [ring * part for ring, part in zip(rings, errors, strict=True)])
            for errors in (friction, squared)
        ]
    else:
        surface = ContactSurface.of(table)
        missed = [surface.of_rank(model.boundary, errors) for errors in _inside_pieces(model, table, surface)]
    np.add.at(forces, cells, missed[0])
    np.add.at(squares, cells, model.statement.young * missed[1])
    pressed = float(np.dot(table.columns["weight"], np.abs(table.columns["pressure"])))
    forces_of_step = sum(factor * load.pushing for factor, load in model.applied_at(step))
    loads = float(parallel.global_sum(model.tagged.mesh.comm, np.abs(forces_of_step).sum()))
    return DataError(forces, squares, max(loads, pressed))


def contact_cells(model: Model) -> npt.NDArray[np.int32]:
    """The cell of each contact facet of this rank, in the order of ``boundary.segments``."""
    facets = [model.tagged.facets(effect.boundary) for effect in model.statement.contact]
    return np.concatenate([facet_entities(model.tagged.mesh, boundary_facets)[:, 0] for boundary_facets in facets])


def _missed_loads(model: Model, step: float) -> Floats:
    """The part of the loads that the quadrature of each owned cell misses, ``DataError.forces``, shape (cells,)."""
    mesh, dim = model.tagged.mesh, model.tagged.dimension
    owned = mesh.topology.index_map(dim).size_local
    loads = [load for load in model.statement.of(Force) if load.varies]
    if not loads:
        return np.zeros(owned)
    z = ufl.TestFunction(fem.functionspace(mesh, ("DG", 0, (model.dimension,))))
    on, terms = model.coefficients, []
    assert on is not None
    on.move_to(step)
    for load, where in zip(loads, measures(model.space, loads, model.tagged.facets), strict=True):
        factor = fem.Constant(mesh, default_scalar_type(model.statement.now(load, step)[0]))
        density = factor * ufl.inner(load.density(on), z) * on.around
        fine = _CELL_DEGREE[dim] if load.where is None else _FACET_DEGREE[dim]
        terms += [
            density * where(metadata={"quadrature_degree": fine}),
            -density * where(metadata={"quadrature_degree": load.degree(model.statement.element.degree)}),
        ]
    missed = model.inventory.compile("missed loads", lambda: fem.form(sum(terms[1:], terms[0])))
    return np.asarray(np.linalg.norm(assemble(missed).reshape(-1, model.dimension), axis=1))


def _between_nodes(model: Model, table: ContactTable) -> tuple[list[Floats], list[Floats]]:
    """Between neighbouring nodes: the error of the friction, force, and that of the gap, length."""
    c = table.columns
    effects = {effect.boundary: effect for effect in model.statement.contact}
    at = (np.arange(_POINTS) + 0.5) / _POINTS
    friction, gaps = list[Floats](), list[Floats]()
    for rows in table.paths:
        x = np.array([c["x"][rows], c["y"][rows], np.zeros(len(rows))])
        inside = x[:, :-1, None] + np.diff(x)[:, :, None] * at
        pressure, length = c["pressure"][rows], np.diff(table.arc(rows))
        effect = effects[str(c["boundary"][rows[0]])]

        def between(
            value: Any, near: Any = slice(None), x: Floats = x, inside: Floats = inside
        ) -> tuple[Floats, Floats, Floats]:
            """Values at the nodes, the deviation of those in between from a line, and the second differences nearby."""
            inside = inside[:, near]
            if isinstance(value, float):
                return np.full(x.shape[1], value), np.zeros(inside.shape[1:]), np.zeros(inside.shape[1])
            nodal = sample(value, x)
            points = sample(value, inside.reshape(3, -1)).reshape(inside.shape[1:])
            bend = np.pad(np.abs(np.diff(nodal, 2)), 1, mode="edge") if nodal.size > 2 else np.zeros(nodal.size)
            away = points - nodal[:-1, None][near] - np.diff(nodal)[near, None] * at
            return nodal, away, np.maximum(bend[:-1], bend[1:])[near]

        gap = effect.gap_in(model.tagged.dimension)
        ends = np.column_stack((rows[:-1], rows[1:]))
        near = np.flatnonzero(_reached(gap, table, ends, np.stack((x.T[:-1], x.T[1:]), axis=1)))
        nodal, away, bend = between(gap, near)
        # In contact the body follows the gap; beside it the body may have entered a bump that lies between nodes.
        distance = np.maximum((nodal if effect.against is None else c["gap"][rows]) - c["u_n"][rows], 0.0)
        room = distance[:-1, None] + np.diff(distance)[:, None] * at
        pressed = (pressure[:-1] != 0) & (pressure[1:] != 0)
        missed = np.where(pressed[near, None], np.abs(away), -away - room[near]).max(axis=1, initial=-np.inf)
        of_gap: Floats = np.zeros(length.size)
        of_gap[near] = np.maximum(missed - SMOOTH_LARGEST * bend, 0.0)
        gaps.append(of_gap)
        missed = np.zeros(length.size)
        if effect.friction.acts:
            _, away, bend = between(effect.friction.bound_per_pressure)
            times = (np.abs(pressure[:-1]) + np.abs(pressure[1:])) / 2 if effect.friction.follows_pressure else 1.0
            sliding = np.char.startswith(c["friction"][rows].astype(str), "slip")
            missed = np.maximum(np.abs(away).mean(axis=1) - SMOOTH_MEAN * bend, 0.0) * times * length
            missed[~(sliding[:-1] | sliding[1:])] = 0.0
        friction.append(missed)
    return friction, gaps


def _inside_pieces(model: Model, table: ContactTable, surface: ContactSurface) -> tuple[Floats, Floats]:
    """In 3D, inside each piece of the contact surface: the friction that is missed, force, and what the gap misses,
    length^3: its square over a body of the size of the piece, as an energy over Young's modulus.
    """
    c = table.columns
    weights = surface.inside(_POINTS_ALONG)
    friction, gaps = np.zeros(len(surface.part)), np.zeros(len(surface.part))
    for index, effect in enumerate(model.statement.contact):
        own = np.flatnonzero(surface.part == index)
        if not own.size:
            continue
        corners = surface.corners[own]
        inside = np.einsum("pk,nkd->dnp", weights, surface.x[corners])

        def between(
            value: Any, pieces: npt.NDArray[np.int64] = own, inside: Floats = inside, corners: Any = corners
        ) -> tuple[Floats, Floats, Floats]:
            """Values at the nodes, by how much those inside differ from them, and the second differences nearby."""
            if isinstance(value, float):
                return np.full(len(surface.x), value), np.zeros(inside.shape[1:]), np.zeros(len(pieces))
            nodal = sample(value, surface.x.T)
            points = sample(value, inside.reshape(3, -1)).reshape(inside.shape[1:])
            return nodal, points - nodal[corners] @ weights.T, surface.bends(nodal)[pieces]

        gap = effect.gap_in(model.tagged.dimension)
        near = np.flatnonzero(_reached(gap, table, corners, surface.x[corners]))
        nodal, away, bend = between(gap, own[near], inside[:, near], corners[near])
        pressed = c["pressure"][corners[near]] != 0
        room = np.maximum((nodal if effect.against is None else c["gap"]) - c["u_n"], 0.0)[corners[near]] @ weights.T
        missed = np.where(pressed.all(axis=1)[:, None], np.abs(away), -away - room).max(axis=1, initial=-np.inf)
        gaps[own[near]] = np.maximum(missed - SMOOTH_LARGEST * bend, 0.0) ** 2 * np.sqrt(surface.area[own[near]])
        if effect.friction.acts:
            _, away, bend = between(effect.friction.bound_per_pressure)
            times = np.abs(c["pressure"][corners]).mean(axis=1) if effect.friction.follows_pressure else 1.0
            sliding = (c["friction"] == "slip")[corners].any(axis=1)
            missed = np.maximum(np.abs(away).mean(axis=1) - SMOOTH_MEAN * bend, 0.0) * times * surface.area[own]
            friction[own] = np.where(sliding, missed, 0.0)
    return friction, gaps


def _reached(gap: Any, table: ContactTable, corners: npt.NDArray[np.int64], x: Floats) -> npt.NDArray[np.bool_]:
    """Which pieces may miss some of a gap inside them.

    A distance changes by no more than the way, and from any point of a piece that is at most D across the way to its
    nearest corner is at most D / sqrt(3) (H. Jung, J. Reine Angew. Math. 123 (1901) 241-257).

    Args:
        gap: what is sampled.
        table: the nodes.
        corners: rows of the table at the corners of each piece, shape (n, 2) along a path, (n, 3) on a surface.
        x: where they are, length, shape (n, 2 or 3, 3).
    """
    if not isinstance(gap, Distance) or not isinstance(gap.added, float):
        return np.ones(len(corners), dtype=bool)
    c = table.columns
    across = np.max([np.linalg.norm(x - np.roll(x, k, axis=1), axis=2).max(axis=1) for k in (1, 2)], axis=0)
    away = c["gap"][corners].min(axis=1) - c["u_n"][corners].max(axis=1) - across / np.sqrt(3)
    return np.asarray((away <= 0) | (c["pressure"][corners] != 0).any(axis=1))
