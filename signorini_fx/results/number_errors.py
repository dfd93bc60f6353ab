"""The errors of the numbers that ``solve`` prints: an interval for each, or why there is none.

If an accuracy was requested, errors come from the comparison of meshes.  On a single mesh the error
of a force J is a(e_y, e_z), where e_z is the error of the adjoint state z of J (R. Becker and R.
Rannacher, Acta Numerica 10 (2001) 1-102); both errors are estimated by stress recovery, and
magnitudes are summed cell by cell, as signs are not reliable.  To it are added what nodes miss of a
gap that bends between them, what straight facets miss of an arc, and for friction the part that
changes direction between two nodes.

Where no adjoint state is known, or it would take longer than a share of the solve, the relative
error of a force is the square of that of the displacement, by J. A. Nitsche's argument; so is that
part of the error of the largest pressure which its kink does not show, beside the penetration that
the regularised law allows.  The von Mises stress has its error from its jumps, the contact area
from the facets in which contact zones end.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import basix
import numpy as np

from signorini_fx.arrays import Array, Ints, rmatvec
from signorini_fx.errors import SignoriniError
from signorini_fx.machine import compat, parallel
from signorini_fx.machine.display import point_in_words
from signorini_fx.mechanics.assembly.mesh_entities import facet_vertices
from signorini_fx.mechanics.contact_points.contact_table import ContactTable, is_closed
from signorini_fx.mechanics.statement.effect import ForceDensity, Resistance, is_zero
from signorini_fx.mechanics.statement.expressions import sample
from signorini_fx.mechanics.statement.features import refused_by
from signorini_fx.quantities.summary import Price, PrintedNumber
from signorini_fx.results.accuracy.adjoint import REFUSES, Adjoint, TransposedTangent, law_at
from signorini_fx.results.accuracy.contact_surface import ContactSurface, places
from signorini_fx.results.accuracy.convergence_table import border_of
from signorini_fx.results.accuracy.error_estimates import areas, missed_by_points
from signorini_fx.results.accuracy.pressure_error import chords, growing_rows
from signorini_fx.results.certificate.contact_nodes import overclosures_of
from signorini_fx.results.singularities import ends_on_another, why_no_limit
from signorini_fx.tuned import (
    FEW_NODES,
    MARGIN,
    NOTABLE,
    ROOT_OF_EPS,
    ZERO_IN_SOLUTION,
)

# The largest pressure is not resolved if it differs from its neighbours by more than the first
# share; it still grows towards an end if its second difference exceeds the second.
_UNRESOLVED, _GROWS = 2 * NOTABLE, NOTABLE / 5
# With fewer nodes in contact no figure of the contact has more than one correct digit.
_TOO_FEW = FEW_NODES // 2 + 1
# Points at which loads are compared, on a facet in 2D, and as a degree of quadrature in 3D.
_FINE, _FINE_DEGREE = 400, 40


def printed_numbers(solution: Any) -> dict[str, PrintedNumber]:
    """Return the numbers of a solution that are printed, with their errors, by name.
    Collective.
    """
    found = dict[str, PrintedNumber]()
    if solution.contact is not None and solution.table.touching:
        share = cache(partial(_share, solution))
        found |= _forces(solution, share) | _moments(solution, share) | _motions(solution)
        found["largest pressure"] = _largest_pressure(solution)
        found["contact area"] = _contact_area(solution)
    return found


# --- forces ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Resultant:
    """A resultant contact force on a body.

    ``name`` is the name of the printed number, ``parts`` are the numbers of its contacts, and
    ``friction`` is 1 for friction and 0 for the normal force.
    """

    name: str
    force: Array
    parts: Sequence[int]
    friction: int

    @property
    def size(self) -> float:
        """The magnitude of the force."""
        return float(np.linalg.norm(self.force))


def _forces(solution: Any, share: Callable[[float], float]) -> dict[str, PrintedNumber]:
    """Return the contact force and the friction force; if bodies touch each other, those of each
    boundary.  ``share`` is as in ``_errors_of_forces``.
    """
    each = solution.contact.forces_of_each
    contacts = solution.model.contacts
    rubs = bool(solution.contact.has_friction and solution.table.columns["bound"].any())
    groups = {"": range(len(contacts))}
    if any(effect.against for effect in contacts) and len(contacts) > 1:
        groups = {f" on {effect.boundary}": range(k, k + 1) for k, effect in enumerate(contacts)}
    wanted = [
        _Resultant(f"{kind}{name}", each[parts, number].sum(axis=0) + 0.0, parts, number)
        for name, parts in groups.items()
        for number, kind in enumerate(("force", "friction")[: 1 + rubs])
    ]
    largest = float(np.linalg.norm(each, axis=2).max())
    errors = _errors_of_forces(solution, wanted, largest, share)
    few = _few_nodes(solution.table)
    found = {}
    for number, one in enumerate(wanted):
        error = None
        why = few if solution.table.touching < _TOO_FEW else None
        if isinstance(errors, str):
            why = f"error not known: {errors}"
        elif errors[number] <= ZERO_IN_SOLUTION * largest:
            error = 0.0
            why = "from the loads"
        else:
            error = errors[number]
        found[one.name] = PrintedNumber(value=[*map(float, one.force)], error=error, why=why)
    return found


def _errors_of_forces(
    solution: Any, wanted: Sequence[_Resultant], largest: float, share: Callable[[float], float]
) -> list[float] | str:
    """Return the error of each resultant, or why the errors are not known.

    Args:
        solution: the solution.
        wanted: the resultants.
        largest: the largest magnitude of the forces of all contacts.
        share: from the relative error of the displacement to that of forces.
    """
    price = solved_price(solution)
    turning = turning_shear(solution)
    if price is not None and price.force is not None:
        estimate = price.force * float(np.linalg.norm(solution.levels[-1].forces))
        return [MARGIN * estimate + one.friction * turning for one in wanted]
    error = solution.mean_error
    if isinstance(error, str):
        return error
    bodies = _dual_weighted(solution, wanted)
    if bodies is None:
        bodies = [
            share(error) * (not _from_loads(solution, one)) * _reach(solution, one, largest)
            for one in wanted
        ]
    degree = compat.geometry_degree(solution.model.tagged.mesh)
    angle = float(chords(solution.table, degree)[0].max(initial=0.0))
    loads = force_between_points(solution)
    errors = []
    for one, body in zip(wanted, bodies, strict=True):
        turned = turning * one.friction * (body > ZERO_IN_SOLUTION * largest)
        errors.append(MARGIN * body + turned + loads + angle**2 / 6 * one.size)
    return errors


def _share(solution: Any, error: float) -> float:
    """Return the relative error of forces from that of the displacement in the energy norm."""
    return float(np.hypot(error**2, _missed_by_points(solution)))


def _reach(solution: Any, one: _Resultant, largest: float) -> float:
    """Return the largest magnitude that a resultant may have: friction is at most its bound."""
    on = np.isin(solution.table.nodes[:, 0], one.parts).astype(np.float64)
    return _bounded(solution.table, on, largest) if one.friction else largest


def _bounded(table: ContactTable, arms: Array, size: float) -> float:
    """Return the smaller of ``size`` and the sum of the friction bounds times ``arms``,
    shape (n,).
    """
    weights = table.columns["weight"] * arms
    on = weights > 0  # a bound may be infinite, and is no number where a bond holds
    return float(np.fmin(weights[on] @ table.columns["bound"][on], size))


def _moments(solution: Any, share_of: Callable[[float], float]) -> dict[str, PrintedNumber]:
    """Return the moments of contact and friction about the origin in 3D, if there is only
    one body.  ``share_of`` is as in ``_errors_of_forces``.
    """
    contact = solution.contact
    boundary = contact.boundary
    if solution.table.facets is None or any(one.against for one in solution.model.contacts):
        return {}
    error = solution.mean_error
    share = getattr(solved_price(solution), "force", None)
    if share is None and not isinstance(error, str):
        share = share_of(error)
    moments = np.cross(boundary.centre[:, None], contact.forces_at_points)
    size, friction = parallel.global_sum(boundary.comm, np.linalg.norm(moments, axis=2).sum(axis=0))
    if friction > 0:
        arms = np.linalg.norm(places(solution.table), axis=1)
        friction = _bounded(solution.table, arms, size)
    return {
        name: PrintedNumber(
            value=[*map(float, moment)],
            error=None if share is None else float(MARGIN * share * size),
            why=f"error not known: {error}" if share is None else None,
        )
        for name, moment, size in zip(
            ("contact moment", "friction moment"), contact.moments, (size, friction), strict=True
        )
        if size > 0
    }


def _motions(solution: Any) -> dict[str, PrintedNumber]:
    """Return the displacements of rigid bodies that forces move.

    If a single force is the only load, its displacement is its work over the force, and the
    relative error of the work is the square of the error of the body's displacement in the energy
    norm.
    """
    motions = solution.last_step.rigid_bodies
    error = solution.mean_error
    given = [value for support in solution.model.held for value in support.components]
    still = is_zero(*(value for value in given if value is not None))
    if len(motions) > 1 or not still or solution.statement.of(ForceDensity):
        error = "other loads act too"
    found = {}
    for motion in motions:
        known = not isinstance(error, str)
        size = float(np.linalg.norm(motion.translation))
        found[f"displacement of {motion.body.name}"] = PrintedNumber(
            value=motion.translation.tolist(),
            error=MARGIN * error**2 * size if known else None,
            why=None if known else f"error not known: {error}",
        )
    return found


def _from_loads(solution: Any, one: _Resultant) -> bool:
    """Return whether a resultant is known to be determined by the loads alone.

    This holds on a flat contact boundary where nothing else holds the body in that direction; for
    forms it is not known.
    """
    model = solution.model
    columns = solution.table.columns
    bent = [np.ptp(columns[f"n_{axis}"]) for axis in "xyz" if f"n_{axis}" in columns]
    others = any(effect.against for effect in model.contacts) or solution.statement.of(Resistance)
    # Effects in time such as inertia add forces to those that are stated.
    unknown = model.coefficients is None or solution.last_step.acting is not None
    if max(bent) > ROOT_OF_EPS or others or unknown or solution.statement.nonlinear:
        return False
    held = set() if model.kinematics.uniform else {0}
    for support in model.held:
        given = [support.normal is not None or value is not None for value in support.components]
        held |= {axis for axis, holds in enumerate(given) if holds}
    along = np.flatnonzero(np.abs(one.force) > ROOT_OF_EPS * one.size)
    return held.isdisjoint(map(int, along))


def _dual_weighted(solution: Any, wanted: Sequence[_Resultant]) -> list[float] | None:
    """Return an error estimate for each resultant by its adjoint state: the sum of |a(e_y, e_z)|
    over the cells, and what nodes miss of the gap.  Collective.

    Each resultant is taken in its own direction.  Returns None if no adjoint state is known.
    """
    model = solution.model
    reached = solution.reached
    if reached is None:
        return None
    law = reached.start.law
    if any(refused_by(solution.statement, REFUSES)) or (law is not None and law.follows_slip):
        return None
    boundary = solution.contact.boundary
    task = reached.posed.task
    try:
        linear = law_at(task, reached.outcome, reached.start, solution.contact, law)
        tangent = TransposedTangent(task.system, linear, symmetric=model.symmetric)
        adjoints = list[Adjoint]()
        for one in wanted:
            way = one.force / one.size if one.size > 0 else np.eye(len(one.force))[0]
            ways = np.where(np.isin(boundary.part, one.parts)[:, None], way, 0.0)
            kappa = -rmatvec(boundary.frames, ways)
            kappa[:, 0 if one.friction else slice(1, None)] = 0.0
            nothing = model.vector(np.zeros(model.fixed.size))
            adjoints.append(tangent.adjoint(nothing, kappa))
    except SignoriniError:
        return None
    states = [model.function(adjoint.psi) for adjoint in adjoints]
    products = solution.mechanics.recovery.products(solution.displacement, states, solution.place)
    bow = _bow_of_gaps(solution)
    missed = [boundary.weight @ (adjoint.tied[:, 0] * bow) for adjoint in adjoints]
    sums = np.column_stack(([float(np.abs(one).sum()) for one in products], missed))
    total = parallel.global_sum(model.comm, sums)
    return [float(cells + abs(gap)) for cells, gap in total]


def _missed_by_points(solution: Any) -> float:
    """Return the share of a force that contact at nodes misses between them.  Collective."""
    model = solution.model
    table = solution.table
    columns = table.columns
    displaced = range(len(model.contacts) * solution.statement.nonlinear)
    kinematics = solution.statement.kinematics_in(model.tagged.dimension)
    missed = missed_by_points(model, table, kinematics, displaced)
    work, force = parallel.global_sum(model.comm, np.array([part.sum() for part in missed]))
    pushing = columns["weight"] * columns["pressure"]
    energy = solution.last_step.strain_energy
    size = pushing @ np.abs(columns["u_n"]) if energy is None else 2 * energy
    return float(work / size + force / pushing.sum())


def solved_price(solution: Any) -> Price | None:
    """Return the row of the last solved mesh of the convergence table, or None without one."""
    prices = [price for price in solution.convergence_table if not price.predicted]
    return prices[-1] if prices else None


def _bow_of_gaps(solution: Any) -> Array:
    """Return by how much the mean of a gap between nodes differs from its interpolation by the
    nodes, length, at each point of this rank, shape (n,).

    With elements of degree 1 that is the whole of a parabola through vertices, with degree 2 the
    part that mid-side nodes do not follow; zero in 3D.
    """
    boundary = solution.contact.boundary
    table = solution.table
    degree = solution.statement.element.degree
    if table.facets is not None:
        return np.zeros(boundary.size)
    found = np.zeros(len(table.columns["x"]))
    gap = table.columns["gap"]
    for path in table.paths:
        rows, s, own = table.unrolled(path)
        ends = np.arange(0, len(rows), degree)
        h = np.diff(s[ends])
        if len(h) < 2 or (degree > 1 and (own.start or len(rows) % 2 == 0)):
            continue
        bends = np.diff(np.diff(gap[rows[ends]]) / h) * (h[1:] + h[:-1]) / 24
        bow = np.interp(s, s[ends], np.pad(bends, 1, mode="edge"))
        if degree > 1:
            middle = (gap[rows[:-2:2]] + gap[rows[2::2]]) / 2 - gap[rows[1::2]]
            bow -= np.interp(s, s[1::2], middle) * 2 / 3
        found[path] = bow[own.start : own.stop + 1]
    return _at_points(solution, found)


def _at_points(solution: Any, values: Array) -> Array:
    """Return values of the rows of the contact table at the points of this rank, shape (n,); zero
    at points that are not at nodes.
    """
    table = solution.table
    boundary = solution.contact.boundary
    base = int(table.nodes.max(initial=0)) + 1
    keys = table.nodes @ [base, 1]
    order = np.argsort(keys)
    wanted = boundary.part * base + boundary.global_nodes
    rows = order[np.minimum(np.searchsorted(keys[order], wanted), keys.size - 1)]
    return np.where((keys[rows] == wanted) & boundary.at_nodes, values[rows], 0.0)


def turning_shear(solution: Any) -> float:
    """Return the force error from shear that changes between two neighbouring nodes in contact of
    different states (one sticks, or slips the other way).

    Only the change beyond that in the neighbouring intervals counts; 0 in 3D.
    """
    table = solution.table
    columns = table.columns
    total = 0.0
    for path in table.paths:
        rows, s, own = table.unrolled(path)
        changes = np.abs(np.diff(columns["shear"][rows]))
        beside = np.maximum(
            np.concatenate(([0.0], changes[:-1])), np.concatenate((changes[1:], [0.0]))
        )
        state = columns["state"][rows]
        turns = (state[1:] != state[:-1]) & (state[1:] != "open") & (state[:-1] != "open")
        forces = np.where(turns, np.diff(s) / 2 * np.maximum(changes - beside, 0.0), 0.0)
        total += float((forces * _around(solution, rows))[own].sum())
    return total


def _around(solution: Any, rows: Ints) -> Array:
    """Return the factor by which ``Kinematics.measure`` weights each interval between nodes, shape
    (rows - 1,).
    """
    x = places(solution.table)[rows]
    measure = solution.model.kinematics.measure_at((x[1:] + x[:-1]).T / 2)
    return np.broadcast_to(measure, len(rows) - 1)


def force_between_points(solution: Any) -> float:
    """Return the part of the boundary loads that their quadrature misses, such as where a load
    jumps within a facet, a force.  Collective.
    """
    model = solution.model
    statement = solution.statement
    mesh = model.tagged.mesh
    dim = model.tagged.dimension
    total = 0.0
    for load in statement.of(ForceDensity):
        if not load.varies or load.nodal or load.where is None:
            continue
        factor, now = statement.now(load, solution.place)
        vertices = facet_vertices(mesh, model.tagged.facets(load.where))
        simplex = mesh.topology.cell_name() in ("triangle", "tetrahedron")
        kind = "interval" if dim == 2 else "triangle" if simplex else "quadrilateral"
        cell = getattr(basix.CellType, kind)
        corners = vertices[:, : len(basix.geometry(cell))]
        element = basix.create_element(basix.ElementFamily.P, cell, 1)
        along = (np.arange(_FINE)[:, None] + 0.5) / _FINE, np.full(_FINE, 1 / _FINE)
        rules = (
            basix.make_quadrature(cell, load.degree(statement.element.degree)),
            along if dim == 2 else basix.make_quadrature(cell, _FINE_DEGREE),
        )
        forces = []
        for points, weights in rules:
            shares = element.tabulate(0, points)[0, :, :, 0]
            x = np.einsum("qc,fcd->dfq", shares, corners)
            around = model.kinematics.measure_at(x[:dim].reshape(dim, -1))
            given = [value for value in now.given.values() if value is not None]
            values = np.stack([sample(value, x.reshape(3, -1)) * around for value in given])
            values = values.reshape(len(values), *x.shape[1:])
            forces.append(values @ weights)
            if len(forces) == 1:
                # A load that varies little within a facet is integrated well enough.
                varies = np.ptp(values, axis=2).max(axis=0, initial=0.0)
                jumps = varies > NOTABLE * np.abs(values).max(initial=0.0)
                corners = corners[jumps]
                forces[0] = forces[0][:, jumps]
        missed = np.linalg.norm(forces[1] - forces[0], axis=0)
        total += abs(factor) * float(missed @ areas(corners)) / rules[0][1].sum()
    return parallel.total(model.comm, np.array(total))


# --- the contact ----------------------------------------------------------------------------------


def _largest_pressure(solution: Any) -> PrintedNumber:
    """Return the largest pressure with its place, and its error or why it has none."""
    table = solution.table
    columns = table.columns
    row = int(np.argmax(columns["pressure"]))
    value = float(columns["pressure"][row])
    place: list[float | None] = [
        round(float(columns[axis][row]), 9) + 0.0 for axis in "xyz" if axis in columns
    ]
    printed = partial(PrintedNumber, value=value, place=place)
    price = solved_price(solution)
    if price is not None and price.peak is not None:
        return printed(error=MARGIN * price.peak * value)
    kink = _kink(table, row)
    error = solution.mean_error
    width = MARGIN * kink if isinstance(error, str) else max(kink, error**2)
    if not overclosures_of(solution.model.contacts):  # a soft contact lets the body in by its law
        width += MARGIN * solution.certificate.penetration
    if table.touching < _TOO_FEW:
        width = max(width, 1 / (1 + table.touching))
        return printed(error=width * value, why=_few_nodes(table))
    if (reason := solution.no_limit_of_pressure) is not None:
        return printed(why=f"has no finite value: {reason}")
    if at := _near_a_corner(solution):
        return printed(why=f"error not known: it may have no limit at {at}")
    if row in growing_rows(table) and kink > _GROWS:
        return printed(why="error not known: still growing towards the end")
    if kink >= _UNRESOLVED:
        return printed(why=f"not resolved: {100 * kink:.0f} % to the next node")
    return printed(error=width * value)


def _few_nodes(table: ContactTable) -> str:
    """Return the number of nodes in contact, in words."""
    return f"{table.touching} node{'s' * (table.touching != 1)} in contact"


def _near_a_corner(solution: Any) -> str:
    """Return the end of a contact boundary in 2D where the pressure may have no limit, in words, or
    "".  Collective.

    The contact reaches it with a large pressure, or ends one facet before it.
    """
    table = solution.table
    touching = table.columns["state"] != "open"
    pressure = table.columns["pressure"]
    x = places(table)
    beyond = ends_on_another(solution.model, table)
    # Facets of an arc enlarge its angle with a plane of symmetry.
    straight = not chords(table)[0].size
    for path in table.paths if table.facets is None else ():
        for end, inside in ((0, 1), (-1, -2)):
            if is_closed(path) or len(path) < 2:
                continue
            row = int(path[end])
            near = touching[path[inside]] and not touching[row]
            # If another body continues beyond the end, a coarse mesh shows a small pressure.
            large = pressure[row] > (NOTABLE if row in beyond else 0.5) * pressure.max()
            if near or (large and (straight or row in beyond)):
                place = tuple(map(float, x[row]))
                # For forms it is not known what supports and loads act there.
                unknown = solution.model.coefficients is None
                if row in beyond or unknown or why_no_limit(solution.model, place):
                    return point_in_words(place)
    return ""


def _kink(table: ContactTable, row: int) -> float:
    """Return the relative difference between the pressure at a row and the mean of its neighbours;
    at an end the relative second difference.
    """
    pressure = table.columns["pressure"]
    if table.facets is not None:
        surface = ContactSurface.of(table)
        around = (surface.corners == row).any(axis=1)
        neighbours = np.setdiff1d(np.unique(surface.corners[around]), [row])
        return _relative_change(pressure, neighbours, row) if neighbours.size else 1.0
    for path in table.paths:
        rows, _, _ = table.unrolled(path)
        if row not in path or len(rows) < 3:
            continue
        # A closed path is repeated, and the copy in the middle has no ends.
        places = np.flatnonzero(rows == row)
        place = int(places[len(places) // 2])
        if 0 < place < len(rows) - 1:
            return _relative_change(pressure, rows[[place - 1, place + 1]], row)
        end, inside, next_inside = pressure[rows[:3] if place == 0 else rows[:-4:-1]]
        return float(abs(end - 2 * inside + next_inside) / end)
    return 1.0


def _relative_change(pressure: Array, neighbours: Ints, row: int) -> float:
    """Return the relative difference between the pressure at a row and the mean of its
    neighbours.
    """
    return float(abs(pressure[neighbours].mean() / pressure[row] - 1))


def _contact_area(solution: Any) -> PrintedNumber:
    """Return the area in contact with its error, in 2D a length."""
    table = solution.table
    columns = table.columns
    touching = columns["state"] != "open"
    value = float(columns["weight"][touching].sum())
    if table.facets is not None:
        border = border_of(table)
        return PrintedNumber(value=value, error=None if border is None else border * value)
    ends = 0.0
    for path in table.paths:
        rows, s, own = table.unrolled(path)
        sizes = np.diff(s) * _around(solution, rows)
        ends += float((sizes * (touching[rows[1:]] != touching[rows[:-1]]))[own].sum())
        # A pressure that decreases to zero within a facet may do so before its end.
        for end, inside, size in ((0, 1, sizes[:1]), (-1, -2, sizes[-1:])):
            falls = 2 * columns["pressure"][rows[end]] < columns["pressure"][rows[inside]]
            if own.start == 0 and touching[rows[end]] and falls:
                ends += float(size.sum())
    return PrintedNumber(value=value, error=ends)
