"""All error estimates on one mesh, by quantity and by cell.

Where cells are about as long as the facets in contact near them, the kinks of the pressure from
facet to facet show its error.  Under a cell that is as long as many facets the pressure is smooth
from facet to facet, and wrong by the error of the stress in that cell, to first order.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl
from dolfinx import default_scalar_type, fem
from mpi4py import MPI
from scipy.spatial import cKDTree

from signorini_fx.arrays import Array, Indices, extents
from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.assembly.mesh_entities import (
    assemble,
    compile_form,
    facet_cells,
    facet_vertices,
)
from signorini_fx.mechanics.contact_points.contact_table import ContactTable
from signorini_fx.mechanics.kinematics import Kinematics
from signorini_fx.mechanics.loads.load_vectors import measures
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.effect import ForceDensity
from signorini_fx.mechanics.statement.expressions import Expression, sample
from signorini_fx.results.accuracy.contact_surface import ContactSurface, places
from signorini_fx.results.accuracy.pressure_error import (
    bends,
    beside,
    corner_rows,
    interval_squares,
    on_facets,
    pressure_square,
)
from signorini_fx.tuned import FEW_NODES, NOTABLE, POLLUTION


@dataclass(frozen=True)
class Errors:
    """The error estimates on one mesh; all errors are relative.

    Attributes:
        energy: error of the displacement in the energy norm, that of loads included; for a
            nonlinear body error of the stress.
        pressure: error of the contact pressure in L2(Gamma_c), that of loads included, as the
            contact boundary shows it; None without contact, and where it is not known.
        force: error of contact and friction force: by J. A. Nitsche's argument the square of that
            of the displacement, for a nonlinear body the product of those of stress and strain,
            together with ``points``; where loads, not displacements, press the body, far above the
            true error.
        points: the part of ``force`` that contact at the nodes misses between them.
        loads: error of the loads on the mesh.
        size: energy norm of the solution.
        pressed: norm of its contact pressure in L2(Gamma_c).
        squares: contribution of each owned cell to the square of the error, by quantity, shape
            (cells,).
    """

    energy: float
    pressure: float | None
    force: float
    points: float
    loads: float
    size: float
    pressed: float
    squares: dict[str, Array]


def estimate_errors(
    mechanics: Any, displacement: fem.Function, energy: float, table: ContactTable, step: float
) -> Errors:
    """Return the error estimates on a mesh; collective.

    Args:
        mechanics: the mechanics of the body.
        displacement: y.
        energy: strain energy of the solution.
        table: the contact table.
        step: position in the lists of load factors.
    """
    model = mechanics.model
    missed = missed_loads(model, step) + missed_gaps(model, table, step)
    squares = np.zeros(missed.shape)
    if energy > 0:
        squares = mechanics.recovery.squares(displacement, step)
    if parallel.any_rank(model.comm, missed):
        pressed = float(np.dot(table.columns["weight"], np.abs(table.columns["pressure"])))
        forces = model.loads_at(step, pushing=True).forces
        missed /= max(parallel.total(model.comm, np.abs(forces)), pressed)
    return combined(model, table, squares, energy, model.kinematics, missed)


def combined(
    model: Model,
    table: ContactTable,
    recovery: Array,
    energy: float,
    kinematics: Kinematics,
    missed: Array | float = 0.0,
    displaced: Collection[int] = (),
    modulus: float | None = None,
) -> Errors:
    """Return all error estimates from the squared errors of the cells; collective.

    Args:
        model: the body on its mesh.
        table: the contact table.
        recovery: squared error of each owned cell in the energy norm, shape (cells,); for a
            nonlinear body those of stress and strain, each over the square of its norm and times
            ``2 energy``, shape (2, cells).
        energy: strain energy; for a nonlinear body half of the squared norm of stress and strain.
        kinematics: kinematics of the body; the forms of a nonlinear body have its measure in them.
        missed: share of all forces that quadrature and gaps miss in each cell.
        displaced: numbers of the contacts that are evaluated at displaced points.
        modulus: stress per strain; None for that of the model.
    """
    boundary = model.boundary
    assert boundary is not None
    facets = np.concatenate([model.tagged.facets(effect.boundary) for effect in model.contacts])
    cells = facet_cells(model.tagged.mesh, facets)
    size = 2 * energy
    shares = np.atleast_2d(recovery) / (size if energy > 0 else np.inf)
    body = shares[0]
    missed = np.zeros(shares.shape[1]) + missed

    def total(squares: Array) -> float:
        return parallel.total(boundary.comm, squares)

    loads = total(missed)
    error = float(np.sqrt(total(body)))
    strain = float(np.sqrt(total(shares[-1])))
    contact = np.zeros_like(body)
    top = np.zeros_like(body)
    points = np.zeros_like(body)
    pressed = pressure_square(table)
    if pressed > 0 and size > 0:
        work, force = missed_by_points(model, table, kinematics, displaced)
        whole = float(np.dot(table.columns["weight"], np.abs(table.columns["pressure"])))
        np.add.at(points, cells, work / size + force / whole)
    if pressed > 0 and table.facets is None:
        np.add.at(
            contact,
            cells,
            on_facets(boundary, table, interval_squares(table, kinematics)) / pressed,
        )
        rows = np.append(corner_rows(table), np.argmax(table.columns["pressure"]))
        np.add.at(top, cells, total(contact) * on_facets(boundary, table, beside(table, rows)))
    elif pressed > 0:
        surface = ContactSurface.of(table)
        np.add.at(
            contact,
            cells,
            surface.of_rank(boundary, surface.squares(table.columns["pressure"])) / pressed,
        )
    if pressed > 0:
        assert table.nodes is not None
        base = int(table.nodes.max(initial=0)) + 1
        acting = table.nodes[table.columns["pressure"] != 0] @ [base, 1]
        nodes = boundary.segments[:, :1] * base + boundary.segments[:, 1:]
        touching = facets[np.isin(nodes, acting).any(axis=1)]
        stress = body * size * (model.scales.modulus if modulus is None else modulus)
        contact += under_long_cells(model.tagged, touching, stress) / pressed
    return Errors(
        energy=error + loads,
        pressure=float(np.hypot(np.sqrt(total(contact)), error**2)) + loads
        if pressed > 0
        else None,
        force=float(np.hypot((error + loads) * (strain + loads), total(points))),
        points=total(points),
        loads=loads,
        size=float(np.sqrt(size)),
        pressed=float(np.sqrt(pressed)),
        squares={
            "energy": body + loads * missed,
            "force": body + loads * missed + points,
            "pressure": contact + (POLLUTION * error) ** 2 * body + loads * missed,
            # Half of it is at the largest pressure, where the kinks are small although the error of
            # this value arises there, and at corners, where the pressure may become the largest.
            "peak": contact + top + (POLLUTION * error) ** 2 * body + loads * missed,
        },
    )


def missed_gaps(model: Model, table: ContactTable, step: float) -> Array:
    """Return the contact force on facets where the gap between the nodes differs from its
    interpolation, for each owned cell, shape (cells,); collective.

    The difference counts if it is a notable share of the displacements, and opens or closes the
    contact, such as where the gap jumps within a facet.
    """
    boundary = model.boundary
    missed = np.zeros(model.tagged.mesh.topology.index_map(model.tagged.dimension).size_local)
    assert boundary is not None
    assert table.nodes is not None
    columns = table.columns
    x = np.column_stack([columns[axis] for axis in "xyz" if axis in columns])
    beyond = NOTABLE * float(np.abs(columns["u_n"]).max(initial=0.0))
    for number, effect in enumerate(model.statement.contacts_at(step)):
        if not isinstance(effect.gap, Expression) or effect.against is not None:
            continue
        segments = boundary.segments[boundary.segments[:, 0] == number]
        facets = np.concatenate([at for _, at, part in boundary.surface if part == number])
        cells = facet_cells(model.tagged.mesh, facets)
        shares = _inside(segments.shape[1] - 1, x.shape[1])
        weights = np.stack(list(shares.values()), axis=1)
        beside = cKDTree(weights).query_pairs(1.5 / _ALONG, output_type="ndarray")
        row_of = np.full(1 + max(segments.max(initial=0), table.nodes.max(initial=0)), -1)
        of_part = np.flatnonzero(table.nodes[:, 0] == number)
        row_of[table.nodes[of_part, 1]] = of_part
        rows = row_of[segments[:, 1:][:, list(shares)]]
        pressure = columns["pressure"][rows].max(axis=1, initial=0.0)
        pressed = np.flatnonzero((rows >= 0).all(axis=1) & (pressure > 0))
        for some in np.array_split(pressed, 1 + pressed.size // _AT_ONCE):
            points = np.zeros((3, some.size, len(weights)))
            points[: x.shape[1]] = np.einsum("pk,fkd->dfp", weights, x[rows[some]])
            linear = columns["gap"][rows[some]] @ weights.T
            moved = columns["u_n"][rows[some]] @ weights.T
            there = sample(effect.gap, points.reshape(3, -1)).reshape(-1)
            there = np.broadcast_to(there, linear.size).reshape(linear.shape)
            # A gap that bends evenly has small steps between neighbouring points.
            steps = np.abs(np.diff((there - linear)[:, beside], axis=2)).max(axis=(1, 2))
            other = (np.abs(there - linear) > beyond) & (
                (moved >= there - beyond) != (moved >= linear - beyond)
            )
            force = pressure[some] * other.mean(axis=1) * areas(x[rows[some]])
            np.add.at(missed, cells[some], np.where(steps > beyond, force, 0.0))
    return missed


def missed_by_points(
    model: Model, table: ContactTable, kinematics: Kinematics, displaced: Collection[int]
) -> tuple[Array, Array]:
    """Return what contact at the nodes misses between them, for each facet of this rank in the
    order of ``boundary.segments``; collective.

    The first array is the work of the pressure on the difference between the gap and its linear
    interpolation, the second the force on intervals in which the contact ends, times the change of
    its direction.

    Where the distance is nominal, sides are as round as they were drawn: normals that turn leave no
    gap between nodes.

    Args:
        model: the body on its mesh.
        table: the contact table.
        kinematics: kinematics of the body.
        displaced: see ``combined``; there the change of the gap is known from the normals alone.
    """
    boundary = model.boundary
    c = table.columns
    surface = None
    assert boundary is not None
    assert table.nodes is not None
    nominal = [k for k, effect in enumerate(model.contacts) if effect.distance == "nominal"]
    faceted = ~np.isin(table.nodes[:, 0], nominal)
    # A gap that bends or jumps at one end of an interval only does so at a node, where it is exact.
    bent = ~np.isin(table.nodes[:, 0], list(displaced))
    if table.facets is None:
        corners = np.concatenate([np.column_stack((path[:-1], path[1:])) for path in table.paths])
        size = np.concatenate([np.diff(table.arc(path)) for path in table.paths])
        sides = size[:, None]
        at_rows = [bends(table, path, c["gap"]) for path in table.paths]
        change = np.concatenate([np.minimum(one[:-1], one[1:]) for one in at_rows])
        if not kinematics.uniform:
            x = places(table)[corners].mean(axis=1)
            size = size * kinematics.measure_at(x.T)
    else:
        surface = ContactSurface.of(table)
        corners = surface.corners
        size = surface.area
        sides = surface.sides
        change = np.median(np.abs(surface.jumps(c["gap"])), axis=1)
    following = np.roll(corners, -1, axis=1)[:, : sides.shape[1]]
    first = corners[:, : sides.shape[1]]
    normal = np.column_stack([c[f"n_{axis}"] for axis in "xyz" if f"n_{axis}" in c])
    apart = np.abs(c["gap"] - c["u_n"])
    pressure = c["pressure"][corners]
    turn = np.linalg.norm(normal[following] - normal[first], axis=2)
    # The mean distance of a parabola from its chord, and of a paraboloid from its triangle.
    slopes = turn * faceted[first] + (change * bent[corners].all(axis=1))[:, None]
    bow = sides * slopes / (12 if surface is None else 8)
    off = np.maximum(bow - (apart[first] + apart[following]) / 2, 0.0).mean(axis=1)
    mean = size * pressure.mean(axis=1)
    pressed = pressure > 0
    ends = pressed.any(axis=1) & ~pressed.all(axis=1)
    both = mean * off, mean * ends * turn.mean(axis=1) / 2
    if surface is not None:
        return surface.of_rank(boundary, both[0]), surface.of_rank(boundary, both[1])
    begins = np.cumsum([len(path) - 1 for path in table.paths])[:-1]
    work, force = (on_facets(boundary, table, np.split(part, begins)) for part in both)
    return work, force


def worst_of(steps: Sequence[Errors]) -> Errors:
    """Return the largest errors of several load steps, relative to the largest solution and
    pressure of all steps.
    """
    if len(steps) == 1:
        return steps[0]
    size, pressed = (max(getattr(step, name) for step in steps) for name in ("size", "pressed"))
    of_size = [step.size / size if size > 0 else 0.0 for step in steps]
    of_pressed = [step.pressed / pressed if pressed > 0 else 0.0 for step in steps]
    shares = {"energy": of_size, "force": of_size, "pressure": of_pressed, "peak": of_pressed}
    pressures = [
        step.pressure * share
        for step, share in zip(steps, of_pressed, strict=True)
        if step.pressure is not None
    ]

    def added(name: str, weights: list[float]) -> Array:
        parts = [share**2 * step.squares[name] for step, share in zip(steps, weights, strict=True)]
        return np.sum(parts, axis=0)

    return Errors(
        energy=max(step.energy * share for step, share in zip(steps, of_size, strict=True)),
        pressure=max(pressures, default=None),
        force=max(step.force * share**2 for step, share in zip(steps, of_size, strict=True)),
        points=max(step.points * share**2 for step, share in zip(steps, of_size, strict=True)),
        loads=max(step.loads for step in steps),
        size=size,
        pressed=pressed,
        squares={name: added(name, weights) for name, weights in shares.items()},
    )


_ALONG = 16  # points along each axis of a facet at which a gap is looked at
_AT_ONCE = 4096  # facets: 200 MB of their points in 3D


def _inside(nodes: int, dimension: int) -> dict[int, Array]:
    """Return the shares of the corners of a facet at points within it, shape (points,) each, by the
    position of the corner among the nodes.

    Args:
        nodes: number of nodes of the facet.
        dimension: dimension of the body.
    """
    at = (np.arange(_ALONG) + 0.5) / _ALONG
    if dimension == 2:
        return {0: 1 - at, nodes - 1: at}
    first, second = (part.ravel() for part in np.meshgrid(at, at))
    if nodes in (4, 9):
        return {
            0: (1 - first) * (1 - second),
            1: first * (1 - second),
            2: (1 - first) * second,
            3: first * second,
        }
    inside = first + second < 1
    first = first[inside]
    second = second[inside]
    return {0: 1 - first - second, 1: first, 2: second}


def areas(corners: Array) -> Array:
    """Return the areas of facets, in 2D their lengths, shape (f,).

    Args:
        corners: positions of their k corners, shape (f, k, d).
    """
    sides = corners[:, 1:] - corners[:, :1]
    if sides.shape[1] == 1:
        return np.linalg.norm(sides[:, 0], axis=1)
    double = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    return double / (2 if sides.shape[1] == 2 else 1)


# Quadrature to compare with, by dimension: 31 points along a facet and 100 in a cell; in 3D 441 and
# 343.
_FACET_DEGREE = {2: 60, 3: 40}
_CELL_DEGREE = {2: 18, 3: 12}


def missed_loads(model: Model, step: float) -> Array:
    """Return the part of the loads that quadrature misses in each owned cell, a force (in 2D per
    thickness), shape (cells,); collective.
    """
    mesh = model.tagged.mesh
    dim = model.tagged.dimension
    owned = mesh.topology.index_map(dim).size_local
    loads = [load for load in model.statement.of(ForceDensity) if load.varies and not load.nodal]
    if not loads:
        return np.zeros(owned)
    z = ufl.TestFunction(fem.functionspace(mesh, ("DG", 0, (model.dimension,))))
    on = model.coefficients
    terms = []
    assert on is not None
    on.move_to(step)
    for load, where in zip(loads, measures(loads, model.tagged), strict=True):
        factor = fem.Constant(mesh, default_scalar_type(model.statement.now(load, step)[0]))
        density = factor * ufl.inner(load.density(on), z) * on.around
        fine = _CELL_DEGREE[dim] if load.where is None else _FACET_DEGREE[dim]
        terms += [
            density * where(metadata={"quadrature_degree": fine}),
            -density * where(metadata={"quadrature_degree": load.degree(on.degree)}),
        ]
    missed = compile_form(sum(terms[1:], terms[0]))
    return np.linalg.norm(assemble(missed).reshape(-1, model.dimension), axis=1)


# A cell is long if its length is this many times that of a facet, and its distance from the facet.
_LONG = FEW_NODES // 2


def under_long_cells(tagged: TaggedMesh, facets: Indices, squares: Array) -> Array:
    """Return the squared error of the pressure times area that each long cell causes, shape
    (cells,); collective.

    At each facet it is the largest squared error of the stress in cells that are longer than a few
    times the facet and than a few times their distance from it.

    Args:
        tagged: the mesh.
        facets: the facets of this rank on which a pressure acts.
        squares: squared error of the stress times the volume of each owned cell, shape (cells,).
    """
    mesh = tagged.mesh
    dim = tagged.dimension
    comm = mesh.comm
    found = np.zeros(len(squares))
    corners = facet_vertices(mesh, facets)[:, :, :dim]
    lengths = extents(corners)
    near = parallel.gather_rows(comm, np.column_stack((corners.mean(axis=1), lengths)))
    if not len(near):
        return found
    middles = near[:, :dim]
    lengths = near[:, dim]
    x = mesh.geometry.x[compat.geometry_cells(mesh)[: len(squares)]][:, :, :dim]
    low = x.min(axis=1, initial=np.inf)
    high = x.max(axis=1, initial=-np.inf)
    sizes = np.linalg.norm(high - low, axis=1)
    long = np.flatnonzero(sizes > _LONG * lengths.min())
    tree = cKDTree(middles)
    distance, _ = tree.query((low[long] + high[long]) / 2)
    long = long[distance <= sizes[long] * (0.5 + 1 / _LONG)]
    simplex = mesh.topology.cell_name() in ("triangle", "tetrahedron")
    edges = x[long][:, [1, 2, 3 if simplex else 4][:dim]] - x[long][:, :1]
    volumes = np.abs(np.linalg.det(edges)) / (math.factorial(dim) if simplex else 1)
    largest = np.zeros(len(middles))
    above = np.zeros(len(middles), dtype=np.int64)
    for cell, volume in zip(long, volumes, strict=True):
        reach = sizes[cell] * (0.5 + 1 / _LONG)
        at = np.array(tree.query_ball_point((low[cell] + high[cell]) / 2, reach), dtype=np.int64)
        outside = np.maximum(np.maximum(low[cell] - middles[at], middles[at] - high[cell]), 0.0)
        away = np.maximum(np.linalg.norm(outside, axis=1), lengths[at])
        at = at[sizes[cell] > _LONG * away]
        density = squares[cell] / volume
        at = at[density > largest[at]]
        largest[at] = density
        above[at] = cell
    everywhere = largest.copy()
    comm.Allreduce(MPI.IN_PLACE, everywhere, MPI.MAX)
    mine = np.flatnonzero((largest > 0) & (largest == everywhere))
    np.add.at(found, above[mine], largest[mine] * lengths[mine] ** (dim - 1))
    return found
