"""Findings about a scene and its results: what may be wrong or unexpected, and what to do about it.

At the end are the refusals that follow from several entries; ``prepare`` refuses single entries and
meshes.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from scipy.linalg import null_space

from signorini_fx.algebra.algorithms.task import Outcome, Task
from signorini_fx.algebra.contact.complementarity import RegularisedData
from signorini_fx.algebra.contact.points import pushed
from signorini_fx.algebra.contact.statics import Reactions, escape, reactions
from signorini_fx.arrays import Array, Flags, inner
from signorini_fx.errors import SceneError
from signorini_fx.extensions import add_on
from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.assembly.averages import averaging
from signorini_fx.mechanics.assembly.mesh_entities import facet_cells, facet_vertices
from signorini_fx.mechanics.body.deformation import Deformation
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.contact_points.contact_table import contact_table
from signorini_fx.mechanics.interfaces import PlacedShape
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.obstacles.corner_depths import FACETS_OF_ROUNDING, facing_corners
from signorini_fx.mechanics.obstacles.scene_contact import hard_foundations
from signorini_fx.mechanics.obstacles.shapes_inside import BodyCells
from signorini_fx.mechanics.rigid.rigid_motions import MOST_LISTED, names_of, rounded
from signorini_fx.mechanics.statement.effect import ForceDensity, Resistance, is_zero
from signorini_fx.mechanics.statement.expressions import Expression, sample
from signorini_fx.mechanics.statement.load_path import LoadPath
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.mechanics.step_effect import stated_effects
from signorini_fx.records import MAY_JUMP, STEPS_UNESTIMATED, Finding, History, Status
from signorini_fx.results.contact_figures import load_on
from signorini_fx.results.limit import motion_in_words
from signorini_fx.results.mechanics import StepResult
from signorini_fx.tuned import (
    CERTIFICATE_TOLERANCE,
    FAR_GAP,
    NO_FORCE,
    NOTABLE,
    ROOT_OF_EPS,
    SAME_LENGTH,
)

if TYPE_CHECKING:
    from signorini_fx.mechanics.effects.contact import Contact


def scene_findings(body: Model, reached: float = np.inf) -> Iterator[Finding]:
    """Yield findings about the scene, its mesh, and the equilibrium of its loads; collective, the
    same on every rank.

    Args:
        body: the model of the scene.
        reached: the last position on the load path at which equilibrium is checked.
    """
    statement = body.statement
    data = body.data
    prescribed, force = _largest_loads(body)
    yield from _incomplete(statement)
    yield from _falling(body.contacts)
    yield from _pieces(body)
    yield from _locking(
        body, reduced=body.scene_law.reduced is not None or statement.element.degree > 1
    )
    yield from _idle(body)
    for effect in stated_effects(statement):
        yield from effect.findings(body)
    static = not _moves(statement)
    if static:
        yield from equilibrium(body, [k for k in range(len(body.path.times)) if k <= reached])
    yield from _units(body, prescribed, force)
    if body.boundary is not None and data is not None:
        if static or reached == np.inf:  # the gap during motion is no property of the scene
            yield from _gaps(
                body, data, FAR_GAP * prescribed + (body.tagged.size if force > 0 else 0.0)
            )
        yield from _inwards(body)
        yield from _inclined(body, data)
        if static:
            yield from closed_at_once(body)
    yield from _corners(body)
    yield from _coarse_surfaces(body)


def _moves(statement: Statement) -> bool:
    """Return whether bodies may move, so that static equilibrium is not required."""
    return any(effect.moves_bodies for effect in stated_effects(statement))


def nonlinear_findings(statement: Statement, body: Model) -> Iterator[Finding]:
    """Yield findings about a scene with nonlinear materials and its mesh, from its linearisation at
    small strains; collective.
    """
    from signorini_fx.mechanics.body.nonlinear_law import volume_degree

    yield from _incomplete(statement)
    yield from _falling(statement.contact)
    for number, contact in enumerate(statement.contact):
        if statement.finite_strains and contact.foundation is None and contact.against is None:
            text = (
                "the gap is measured on the undeformed boundary; for large sliding give a "
                "`foundation` shape"
            )
            yield Finding("note", f"contact[{number}]", text)
    yield from _locking(body, reduced=volume_degree(statement, body.tagged) is not None)
    yield from _idle(body)
    if body.data is not None:
        yield from _gaps(body, body.data, np.inf)
    for effect in stated_effects(statement):
        yield from effect.findings(body)
    if not _moves(statement):
        yield from _inwards(body)
        yield from closed_at_once(body)
        yield from equilibrium(body, [])
    yield from _corners(body)
    yield from _coarse_surfaces(body)


def _falling(contacts: Sequence[Contact]) -> Iterator[Finding]:
    """Yield a finding for each contact whose friction decreases with the speed of slip."""
    for number, contact in enumerate(contacts):
        fall = getattr(contact.friction, "steepest_fall", 0.0)
        if fall > 0:
            text = (
                f"friction falls by up to {fall:.3g} per speed: a load step must last longer than "
                "this times the normal force over the stiffness against sliding, else sliding jumps"
            )
            yield Finding("note", f"contact[{number}].friction", text)


def _incomplete(statement: Statement) -> Iterator[Finding]:
    yield from (
        Finding("warning", "incomplete", f"not in the scene: {lost}")
        for lost in statement.incomplete
    )


def _locking(body: Model, *, reduced: bool) -> Iterator[Finding]:
    simplices = body.tagged.mesh.topology.cell_name() in ("triangle", "tetrahedron")
    other = "quadrilaterals or hexahedra, or degree 2, with "
    cure = f"use {other if simplices else ''}element.volumetric = 'auto'"
    if body.statement.element.volumetric == "auto" and not simplices:
        cure = "use element.degree = 2: a material here has no term of the volume to reduce"
    for index, material in enumerate(body.materials):
        if material.locks and not reduced:
            message = f"the nearly incompressible material makes these cells too stiff: {cure}"
            yield Finding("warning", f"material[{index}]", message)


def _idle(body: Model) -> Iterator[Finding]:
    """Yield a finding for each load or resistance whose expression vanishes on its whole
    boundary.
    """
    for path, effect in body.statement.listed():
        values = [value for value in effect.given.values() if not is_zero(value)]
        on_boundary = effect.where is not None and isinstance(effect, ForceDensity | Resistance)
        loads = on_boundary and isinstance(effect, ForceDensity) and effect.acts
        if loads and _held(body, effect.where):
            message = (
                f"all components of the displacement are prescribed on {effect.where!r}: the force "
                "goes into the support and moves nothing"
            )
            yield Finding("warning", path, message)
        if (
            not on_boundary
            or not values
            or not all(isinstance(value, Expression) for value in values)
        ):
            continue
        corners = facet_vertices(body.tagged.mesh, body.tagged.facets(effect.where))
        points = np.concatenate([corners.reshape(-1, 3), corners.mean(axis=1)]).T
        acts = any(bool(np.any(sample(value, points) != 0.0)) for value in values)
        if not parallel.any_rank(body.comm, acts):
            message = (
                f"the value is 0 on the whole boundary {effect.where!r}, at all nodes and middles "
                "of facets: check its expression and the unit of lengths"
            )
            yield Finding("warning", path, message)


def _held(body: Model, boundary: str) -> bool:
    """Return whether the displacement of a boundary is prescribed in all steps; collective."""
    space = body.space
    nodes = fem.locate_dofs_topological(
        space, body.tagged.dimension - 1, body.tagged.facets(boundary)
    )
    free = ~body.fixed.reshape(-1, body.dimension)
    owned = nodes[nodes < len(free)]
    always = all(effect.holds is None for effect in body.statement.displacement)
    return always and not parallel.any_rank(body.comm, bool(free[owned].any()))


def _pieces(body: Model) -> Iterator[Finding]:
    """Yield a note if the mesh has several pieces, as each must be held."""
    pieces = body.motions.pieces
    if pieces.count == 1:
        return
    listed = "; ".join(pieces.called(piece) for piece in range(min(pieces.count, MOST_LISTED)))
    suffix = f"; and {pieces.count - MOST_LISTED} more" if pieces.count > MOST_LISTED else ""
    message = (
        f"the mesh has {pieces.count} pieces that share no side, and each must be held: "
        f"{listed}{suffix}; if one body is meant, let the cells share their nodes (in gmsh: "
        "fragment)"
    )
    if any(effect.against is not None for effect in body.contacts):
        message = f"there are {pieces.count} bodies: {listed}{suffix}"
    yield Finding("note", "mesh", message)


# --- gaps and displacements -----------------------------------------------------------------------


def _gaps(body: Model, data: RegularisedData, reach: float) -> Iterator[Finding]:
    """Yield findings about negative gaps, and about gaps wider than ``reach``, the largest distance
    by which displacements and loads may move the body, length.
    """
    boundary = body.boundary
    assert boundary is not None
    comm = boundary.comm
    size = body.tagged.size
    unilateral = ~data.bilateral
    smallest = -parallel.largest(comm, -data.gap, -np.inf)
    moves = any(effect.moves or effect.gap_timed for effect in body.contacts)
    if smallest < -NO_FORCE * size and not moves:
        level: Literal["warning", "note"] = "warning" if -smallest > 0.01 * size else "note"
        overlap = "the body penetrates its foundation"
        if any(effect.against is not None for effect in body.contacts):
            overlap = "a body penetrates another one, or its foundation,"
        message = f"the gap is negative, down to {smallest:g}: {overlap} before it is loaded"
        yield Finding(level, "contact.gap", message)
    two_sided = parallel.any_rank(comm, not unilateral.all())
    if smallest > reach > 0 and not (body.motions.free.shape[1] > 0 or two_sided or moves):
        message = (
            f"the smallest gap is {smallest:g}, more than loads and prescribed displacements can "
            "close: check the gap and the units"
        )
        yield Finding("warning", "contact.gap", message)


def _inwards(body: Model) -> Iterator[Finding]:
    """Yield findings about directions that point into the body, and foundations that face away from
    it.
    """
    mesh = body.tagged.mesh
    dim = body.tagged.dimension
    for index, effect in enumerate(body.statement.contacts_at(-1)):
        if effect.direction is None and effect.surface is None:
            continue
        facets = body.tagged.facets(effect.boundary)
        cells = dmesh.compute_midpoints(mesh, dim, facet_cells(mesh, facets))
        middles = dmesh.compute_midpoints(mesh, dim - 1, facets)
        if effect.direction is None:
            _, normals = effect.surface.distance(middles[:, :dim])
            facing = np.any(inner((middles - cells)[:, :dim], normals) < 0)
            if not parallel.any_rank(body.comm, bool(facing)):
                message = (
                    "no facet of the boundary faces the foundation: name another boundary, turn "
                    "the normal of a plane towards the body, or reverse the points of a line, "
                    "which has the body on its left"
                )
                yield Finding("warning", f"contact[{index}].foundation", message)
            continue
        outwards = (middles - cells)[:, :dim] @ np.array(effect.direction)
        inwards, total = parallel.global_sum(
            body.comm, np.array([np.count_nonzero(outwards < 0), outwards.size])
        )
        if 2 * inwards > total:
            turned = ", ".join(f"{-component + 0.0:g}" for component in effect.direction)
            message = (
                f"the direction points into the body on {inwards:.0f} of {total:.0f} facets; from "
                f"the body to the foundation it is the opposite, direction = [{turned}]"
            )
            yield Finding("warning", f"contact[{index}].direction", message)


def _coarse_surfaces(body: Model) -> Iterator[Finding]:
    """Yield a note for each surface from a file whose flat facets are wider than those of
    the body.
    """
    for foundation in hard_foundations(body.contacts, body.kinematics):
        width, off = getattr(foundation.shape, "facets", (0.0, 0.0))
        where = body.contacts[foundation.contact].boundary
        corners = facet_vertices(body.tagged.mesh, body.tagged.facets(where))
        lengths = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        total, count = parallel.global_sum(body.comm, np.array([lengths.sum(), lengths.size]))
        if width * count > total:
            message = (
                f"the surface has flat facets about {width:.2g} wide, {off:.1g} off the curved "
                f"one, and those of the body are {total / count:.2g} long: it presses with its "
                "facets and their edges; write the file with smaller ones, or take a shape such "
                "as a sphere or a cylinder"
            )
            yield Finding("note", foundation.path, message)


def _corners(body: Model) -> Iterator[Finding]:
    """Yield a note for each foundation with corners that point at a facet of the body between
    nodes, which may not detect them.
    """
    for foundation in hard_foundations(body.contacts, body.kinematics):
        if (facing := facing_corners(foundation, body.space)) is not None:
            points, facet = facing
            listed = ", ".join(
                f"({', '.join(f'{c:.4g}' for c in point)})" for point in points[:MOST_LISTED]
            )
            more = f" and {len(points) - MOST_LISTED} more" if len(points) > MOST_LISTED else ""
            message = (
                f"corners that point at the body between nodes, at {listed}{more}: facets there "
                f"are {facet:.3g} long, and nodes detect a corner whose rounding has a radius of "
                f"at least {FACETS_OF_ROUNDING * facet:.2g}"
            )
            yield Finding("note", foundation.path, message)


def _units(body: Model, prescribed: float, force: float) -> Iterator[Finding]:
    """Yield findings about loads that are too large for linear elasticity or negligible, usually
    due to inconsistent units.
    """
    path = f"material, {body.forces_at}, displacement"
    low, high = parallel.global_bounds(body.comm, body.tagged.mesh.geometry.x.astype(np.float64))
    section = body.scales.depth * float(
        np.prod(np.sort(high - low)[::-1][: body.tagged.mesh.topology.dim - 1])
    )
    moduli = [material.natural_modulus for material in body.materials]
    least, most = (
        max(prescribed / body.tagged.size, force / modulus / section)
        for modulus in (max(moduli), min(moduli))
    )
    if least >= 1:
        message = (
            f"loads and prescribed displacements strain the body by about {least:.1g}, which is "
            "not small: check the units of E and of the loads"
        )
        yield Finding("warning", path, message)
    elif 0 < most < ROOT_OF_EPS:
        message = (
            f"loads and prescribed displacements strain the body by about {most:.1g} only: are E "
            "and the loads in the same units, such as MPa?"
        )
        yield Finding("note", path, message)


def _largest_loads(body: Model) -> tuple[float, float]:
    """Return the largest displacement that a load step prescribes, length, and the largest sum of
    the magnitudes of its nodal loads, force.
    """
    prescribed = force = 0.0
    for step in range(len(body.path.times)):
        start, forces = _loads_at(body, step)
        prescribed = max(prescribed, parallel.largest(body.comm, np.abs(start)))
        sizes = np.linalg.norm(forces, axis=1)
        force = max(force, parallel.total(body.comm, sizes))
    return prescribed, force


def _loads_at(body: Model, step: int) -> tuple[Array, Array]:
    """Return prescribed displacements and nodal loads of a load step at the owned nodes, shape (n,
    d) each.
    """
    loads = body.loads_at(step, pushing=True)
    dim = body.space.dofmap.bs
    start = loads.prescribed[: loads.forces.size]
    return start.reshape(-1, dim), loads.forces.reshape(-1, dim)


# --- friction -------------------------------------------------------------------------------------


def closed_at_once(body: Model) -> Iterator[Finding]:
    """Yield a warning for each contact with pressure-dependent friction whose points close one
    after the other within one load step; collective.

    All motion of a point before it touches then counts as slip.
    """
    boundary = body.boundary
    data = body.data
    if boundary is None or data is None:
        return
    prescribed, force = _largest_loads(body)
    section = body.tagged.size ** (body.space.dofmap.bs - 2)
    motions = [prescribed, force / (body.scales.modulus * section)]
    for index, effect in enumerate(body.contacts):
        friction = effect.friction
        on = boundary.part == index
        if not (friction.acts and friction.follows_pressure) or effect.kind != "unilateral":
            continue
        gap = data.gap[on]
        nearest = -parallel.largest(body.comm, -gap, -np.inf)
        reached = parallel.largest(body.comm, gap[gap <= nearest + sum(motions)], nearest)
        if reached - nearest <= NOTABLE * sum(motions):
            continue
        if _largest_increment(body, boundary.weight[on] @ boundary.normal[on], motions) > 0.5:
            message = (
                "its points close one after the other, while one load step presses them together: "
                "all that moves before it touches counts as slip, and shear and stick zone come "
                "out wrong; let what presses grow in five load steps or more, such as by factors = "
                "[0.2, 0.4, 0.6, 0.8, 1.0]"
            )
            yield Finding("warning", f"contact[{index}].friction", message)


def _largest_increment(body: Model, normal: Array, motions: list[float]) -> float:
    """Return the largest increment by which a load step presses a contact, as a share of the
    largest load.

    Args:
        body: the model.
        normal: direction of pressing, summed over the points of this rank, of any length.
        motions: estimated displacements due to prescribed displacements and to forces, lengths.
    """
    pressing = [0.0]
    total_normal = parallel.global_sum(body.comm, normal)
    normal = total_normal / max(float(np.linalg.norm(total_normal)), NO_FORCE)
    _, total = _largest_loads(body)
    for step in range(len(body.path.times)):
        start, forces = (values @ normal for values in _loads_at(body, step))
        moved = max((1.0, -1.0), key=lambda sign: parallel.largest(body.comm, sign * start, 0.0))
        moved *= parallel.largest(body.comm, moved * start, 0.0)
        pushed = parallel.total(body.comm, forces)
        pressing.append(moved + (motions[1] * pushed / total if total > 0 else 0.0))
    largest = float(np.abs(pressing).max())
    parts = body.path.steps or 1
    if largest <= NOTABLE * sum(motions):  # the foundations move, not the body
        return 1.0 / body.path.expected
    increments = np.abs(np.diff(pressing)) / largest
    return float(increments.max()) / parts


def _inclined(body: Model, data: RegularisedData) -> Iterator[Finding]:
    """Yield a warning for each contact whose pressure acts in another direction than the normal of
    the body where the gap is smallest.
    """
    mesh = body.tagged.mesh
    boundary = body.boundary
    dim = body.tagged.dimension
    assert boundary is not None
    for index, effect in enumerate(body.contacts):
        if effect.direction is None:
            continue
        nearest = -parallel.largest(body.comm, -data.gap[boundary.part == index], -np.inf)
        near = (boundary.part == index) & (data.gap <= nearest + NO_FORCE * body.tagged.size)
        nodes = np.unique(parallel.gather_rows(body.comm, boundary.global_nodes[near][:, None]))
        of_part = boundary.segments[boundary.segments[:, 0] == index, 1:]
        facets = np.concatenate([facets for _, facets, part in boundary.surface if part == index])
        facets = facets[np.isin(of_part, nodes).any(axis=1)]
        middles = dmesh.compute_midpoints(mesh, dim - 1, facets)[:, :dim]
        cells = dmesh.compute_midpoints(mesh, dim, facet_cells(mesh, facets))[:, :dim]
        sides = np.diff(facet_vertices(mesh, facets)[:, :dim, :dim], axis=1)
        outward = np.cross(sides[:, 0], sides[:, 1]) if dim == 3 else sides[:, 0, ::-1] * [1, -1]
        outward = outward * np.sign(np.sum(outward * (middles - cells), axis=1))[:, None]
        areas = np.linalg.norm(outward, axis=1)[:, None]
        along = areas * np.array(effect.direction)
        sums = np.concatenate((outward.sum(axis=0), along.sum(axis=0)))
        own, other = parallel.global_sum(body.comm, sums).reshape(2, dim)
        lengths = np.linalg.norm(own) * np.linalg.norm(other)
        cosine = float(own @ other / lengths) if lengths > 0 else 1.0
        if 0 < cosine < np.sqrt(1 - NOTABLE**2):
            message = (
                f"the pressure acts {np.degrees(np.arccos(cosine)):.2g} degrees off the normal of "
                "the body where it is nearest to its foundation, and pushes it along: leave the "
                "direction out, or take a foundation that the body faces"
            )
            yield Finding("warning", f"contact[{index}].direction", message)


# --- equilibrium: rigid motions that supports and contact resist, loads that they balance ---------


def equilibrium(body: Model, places: Sequence[float]) -> Iterator[Finding]:
    """Yield findings, one for each assembly, on whether contact resists the motions that supports
    leave free, and balances the loads at ``places`` on the load path.
    """
    motions = body.motions
    boundary = body.boundary
    data = body.data
    if motions.free.shape[1] == 0:
        return
    all_reactions = None
    if boundary is not None and data is not None:
        all_reactions = reactions(motions.at(boundary), body.law, data.bilateral)
    loads = [load_on(body, place) for place in places]
    for number in map(int, np.unique(motions.assembly)):
        columns = motions.assembly == number
        contact = None if all_reactions is None else all_reactions.of(number, columns)
        yield _equilibrium_of(body, number, contact, [load[columns] for load in loads])


def _equilibrium_of(
    body: Model, number: int, contact: Reactions | None, loads: list[Array]
) -> Finding:
    """Return the finding on the equilibrium of one assembly.

    Args:
        body: the model.
        number: number of the assembly.
        contact: reactions of its contact nodes; None: there are none.
        loads: work of each load on the free motions of the assembly.
    """
    motions = body.motions
    free = motions.of_all[:, motions.assembly == number]
    several = motions.pieces.count > 1
    members = np.flatnonzero(motions.pieces.assembly == number)
    subject = "the body"
    if several:
        subject = (
            motions.pieces.called(int(members[0])) if members.size == 1 else "bodies that may touch"
        )
    tangential = (
        np.zeros((0, free.shape[1])) if contact is None else contact.tangential[contact.friction]
    )
    normal = np.zeros((0, free.shape[1])) if contact is None else contact.normal
    resisting = np.concatenate(
        (normal, tangential.reshape(-1, free.shape[1]), np.zeros((free.shape[1],) * 2))
    )
    loose = null_space(np.linalg.qr(resisting, mode="r"), rcond=NO_FORCE)
    if loose.shape[1]:
        names = names_of(free @ loose, motions, members)
        who, advice = "the supports do not resist", "prescribe a displacement"
        if contact is not None:
            who = "neither the supports nor the contact resists"
            advice = f"{advice}, or add friction"
        return Finding(
            "warning", "displacement", f"nothing holds {subject}: {who} {names}; {advice}"
        )
    assert contact is not None
    away = [escape(contact, load) if load.any() else None for load in loads]
    steps = [step for step, way in enumerate(away, start=1) if way is not None]
    if steps:
        when = ""
        if len(loads) > 1:
            when = f"{'load step' if body.path.steps is None else 'factor'} {steps[0]}: "
        status, motion = next(way for way in away if way is not None)
        moved = free @ motion
        names = names_of(moved[:, None], motions, members, one_way=True)
        message = f"{when}{status.value}: the loads move {subject} by {names}; {status.advice}"
        if body.law is not None and body.law.unknown:
            message += f"; {body.law.unknown}, which was tried at samples of the pressure"
        sizes = np.abs(moved.reshape(-1, motions.each)).max(axis=1)
        moving = sizes[members] > CERTIFICATE_TOLERANCE * sizes.max()
        movers = motions.pieces.names(members[moving]) or ["the body"]
        ended = motion_in_words(status, movers, motions.pieces.names(members[~moving]))
        return Finding("warning", body.forces_at, message, ended)
    names = names_of(free, motions, members)
    message = f"only contact holds {subject} against {names}: the supports do not"
    return Finding("note", "displacement", message)


# --- results --------------------------------------------------------------------------------------


def may_jump(history: History) -> list[Finding]:
    """Return a warning for each recorded load step with decreasing friction that may have several
    solutions.
    """
    events = [event for event in history.events if event.startswith(MAY_JUMP)]
    return [Finding("warning", "load_steps.times", event) for event in events]


def pushed_nodes(steps: Sequence[ContactState | None], size: float) -> list[Finding]:
    """Return a finding for each contact with nodes that supports hold inside the foundation;
    collective.

    It describes the load step in which a node lies deepest.  Such nodes transmit no force, see
    ``trial_pressure``.

    Args:
        steps: contact states of the load steps.
        size: of the body, length.
    """
    deepest: dict[int, tuple[float, str]] = {}
    for contact in steps:
        if contact is None:
            continue
        boundary = contact.boundary
        depth = contact.held_inside
        held = pushed(depth, size)
        columns = np.column_stack((boundary.part, depth, contact.bilateral, boundary.x))[held]
        rows = np.unique(parallel.gather_rows(boundary.comm, columns), axis=0)
        for part in np.unique(rows[:, 0]).astype(int):
            of_part = rows[rows[:, 0] == part, 1:]
            largest = float(of_part[:, 0].max())
            if largest > deepest.get(part, (0.0, ""))[0]:
                deepest[part] = largest, _message(of_part, largest, size)
    return [
        Finding("warning", f"contact[{part}], displacement", deepest[part][1])
        for part in sorted(deepest)
    ]


def _message(rows: Array, depth: float, size: float) -> str:
    """Return the message about the nodes of one contact that supports hold inside the foundation.

    Args:
        rows: depth, whether contact cannot open, and position of each node, shape (n, 2 + d).
        depth: the largest depth, length.
        size: of the body, length.
    """
    # The first of the deepest nodes by position, independently of the number of ranks.
    most = rows[rows[:, 0] >= depth - SAME_LENGTH * size]
    length, bilateral, *place = most[np.lexsort(most[:, 2:].T[::-1])[0]]
    at = ", ".join(rounded(c, size) for c in place)
    where = f"{'off' if bilateral else 'inside'} the foundation"
    nodes, they = ("node", "it transmits") if len(rows) == 1 else ("nodes", "they transmit")
    return (
        f"supports hold {len(rows)} contact {nodes} {where}, by {length:.3g} at ({at}): {they} "
        "no contact force; check the gap beside them, or end the contact boundary before them"
    )


def facets_in_result(body: Model, contact: ContactState | None) -> Iterator[Finding]:
    """Yield a warning for each contact of two bodies whose pressure is disturbed by the flat facets
    of their curved sides; collective.

    The disturbance is estimated as the modulus times the change of the gap within a facet over the
    length of the facet; it is small where facets are many on sides that curve apart, whose gap is
    much larger at the rim of what touches.
    """
    from signorini_fx.results.accuracy.pressure_error import chords

    if contact is None or not contact.boundary.paired:
        return
    degree = compat.geometry_degree(body.tagged.mesh)
    table = contact_table(contact, *body.statement.sides)
    assert table.nodes is not None
    assert body.data is not None
    assert body.boundary is not None
    for index, effect in enumerate(body.contacts):
        if effect.against is None or effect.distance != "geometry" or effect.kind == "bonded":
            continue
        pressure = np.where(table.nodes[:, 0] == index, table.columns["pressure"], 0.0)
        own = replace(table, columns={**table.columns, "pressure": pressure})
        angles, lengths = chords(own, degree)
        if degree == 2 and averaging(body.space):  # between vertices, without the nodes of edges
            angles = angles / 8
            lengths = lengths / 2
        off = float(np.max(angles * lengths, initial=0.0)) / 4  # an eighth on either side
        here = body.boundary.part == index
        gap = body.data.gap[here]
        gap = gap + parallel.largest(body.comm, -gap, -np.inf)
        change = parallel.largest(body.comm, gap[gap <= off])
        closed = 0.0  # the approach, unless points of contact are others than before the load
        if not parallel.any_rank(body.comm, contact.pressure.size != here.size):
            closed = parallel.largest(body.comm, gap[contact.pressure[here] > 0])
        if not change > NOTABLE * off > 0 or off < NOTABLE * closed:  # nodes of both sides match
            continue
        mean = np.average(pressure, weights=own.columns["weight"] * (pressure != 0))
        if body.scales.modulus * change >= NOTABLE * mean * lengths.mean():
            cells = ", curved cells with element.degree = 2" if degree == 1 else ""
            text = (
                f"facets of {effect.boundary!r} and {effect.against!r} are up to {off:.2g} off "
                "the curved sides, which changes the pressure by a tenth or more: take "
                f'smaller facets{cells}, or distance = "nominal" (of nonlinear bodies with '
                'sliding = "small")'
            )
            yield Finding("warning", f"contact[{index}].distance", text)


def shapes_in_results(
    foundations: Iterable[PlacedShape], displacement: fem.Function
) -> Iterator[Finding]:
    """Yield a warning for each foundation that lies inside the deformed body between nodes or
    beside the contact boundary; collective.

    Rigid bodies that move, and foundations with a gap given by an expression, are left out.
    """
    cells = None
    for name, _, shape, added in foundations:
        if getattr(shape, "driven", False) or not isinstance(added, int | float):
            continue
        space = displacement.function_space
        cells = cells or BodyCells.of(space)
        deep = cells.inside(cells.placed(displacement.x.array), shape, float(added))
        if deep is not None:
            message = (
                f"a part of the foundation lies inside the deformed body, {deep}, between two "
                "nodes or beside the contact boundary: take facets that are not wider than the "
                "foundation, and a larger contact boundary"
            )
            yield Finding("warning", name, message)


def result_findings(
    deformations: Sequence[Deformation], unjudged: Sequence[str]
) -> Iterator[Finding]:
    """Yield findings about bodies with negligible forces and about large deformations.

    Args:
        deformations: of the load steps.
        unjudged: names of bodies whose forces are below the round-off of those of others.
    """
    if unjudged:
        message = (
            f"the forces on {', '.join(unjudged)} are below round-off, so that its results mean "
            "nothing and the certificate does not judge it: solve it separately"
        )
        yield Finding("warning", "body, traction, displacement", message)
    worst = max(deformations, key=lambda deformation: deformation.largest)
    far = f"displacements of up to {worst.displacement:.2g} times the size of the body"
    if worst.gradient > NOTABLE:
        message = (
            f"strains and rotations of {worst.gradient:.2g} on average, {far}: the deformation is "
            "not small, as linear elasticity assumes; check the units of E, of the loads and of "
            "the lengths"
        )
        yield Finding("warning", "material, traction, body_force, displacement", message)
    elif worst.displacement > NOTABLE:
        message = (
            f"{far}, by strains and rotations of {worst.gradient:.2g} on average: the body moves "
            "far, but gap and normals are those of the initial position; check the gap and the "
            "unit of lengths"
        )
        yield Finding("warning", "contact.gap, displacement", message)


def errors_of_steps(
    comm: MPI.Comm, statement: Statement, path: LoadPath, steps: Sequence[StepResult]
) -> Iterator[Finding]:
    """Yield findings about errors in time; collective.

    With a required accuracy: a warning if the estimated error is larger.  Without one: notes about
    load steps whose error need not be small, as they close or open contact of a body with memory,
    or turn a foundation with friction by a large angle.
    """
    if path.time_accuracy is not None:
        error = steps[-1].figures.get("time_error", 0.0)
        if error > path.time_accuracy:
            cure = "a finer mesh allows shorter ones" if _moves(statement) else "give more of them"
            message = f"is {path.time_accuracy:g}, the error is about {error:.2g}: steps are not "
            message += f"divided further, {cure}"
            yield Finding("warning", "load_steps.time_accuracy", message)
        return
    advice = f"{STEPS_UNESTIMATED}: set load_steps.time_accuracy"
    # For materials that relax ``at_time`` returns another object.
    memory = [one for one in statement.material if getattr(one, "state_size", 0)]
    if any(one.at_time(0.5) is not one for one in memory):
        changed = []
        before: Flags | None = None
        for step in steps:
            if step.contact is None:
                continue
            now = step.contact.in_contact
            known = np.zeros_like(now) if before is None or before.size != now.size else before
            if parallel.any_rank(comm, now != known):
                changed.append(step.step)
            before = now
        if changed:
            listed = ", ".join(map(str, changed[:MOST_LISTED]))
            message = (
                f"contact of a body with memory closes or opens in load step {listed}: {advice}"
            )
            yield Finding("note", "load_steps", message)
    for number, effect in enumerate(statement.contact):
        if effect.foundation is None or not effect.friction.acts:
            continue
        turned = {
            step.step: _turned(statement.contacts_at(step.place)[number], number, step)
            for step in steps
        }
        last = _turned(statement.contacts_at(-1)[number], number, None)
        angles = {}
        for count, angle in turned.items():
            angles[count] = float(np.linalg.norm(angle - last))
            last = angle
        farthest = max(angles, key=lambda count: angles[count], default=0)
        if angles and angles[farthest] > NOTABLE:
            message = (
                f"load step {farthest} turns it by {angles[farthest]:.2g} rad, and slip is along "
                f"the chord: {advice}"
            )
            yield Finding("note", f"contact[{number}].foundation", message)


def _turned(contact: Contact, number: int, step: StepResult | None) -> Array:
    """Return the rotation of a foundation at the end of a load step, radians, shape (1,) in 2D or
    (3,) in 3D.
    """
    angle = np.atleast_1d(np.radians(contact.foundation.angles()))
    motions = () if step is None else step.rigid_bodies
    driven = [one.rotation for one in motions if number in one.body.parts]
    return angle + (driven[0] if driven else 0.0)


def slid_at_corners(contact: ContactState | None) -> Iterator[Finding]:
    """Yield a warning if a linear body has moved along a corner of its foundation by a notable part
    of a facet; collective.

    The corner keeps pressing on the same point of a linear body.
    """
    if contact is None or (corners := contact.boundary.corners) is None:
        return
    far = np.abs(contact.displaced(contact.slip_length)[:, 0]) / corners.facet
    worst = np.where(contact.in_contact & ~contact.boundary.at_nodes, far, 0.0)
    share = parallel.largest(contact.boundary.comm, np.nan_to_num(worst))
    if share > NOTABLE:
        message = (
            f"the body has moved by {share:.2g} of a facet along a corner of its foundation, which "
            "presses on the same point of a linear body: take a nonlinear one"
        )
        yield Finding("warning", "contact.foundation", message)


def untouched(comm: MPI.Comm, steps: Sequence[StepResult]) -> Iterator[Finding]:
    """Yield a warning if nothing is in contact in any load step, unless there are time steps
    between them in which contact may have occurred; collective.
    """
    contacts = [step.contact for step in steps if step.contact is not None]
    if any(len(step.between) > 1 for step in steps):
        return
    if contacts and not parallel.any_rank(comm, [each.in_contact.any() for each in contacts]):
        missing = [*(np.max(c.u_n - c.gap, initial=-np.inf) for c in contacts)]
        nearest = -parallel.largest(comm, np.array(missing))
        apart = f", sides stay {nearest:.2g} apart" if np.isfinite(nearest) else ""
        message = (
            f"nothing is in contact{apart}; where contact was expected, check the gap, the loads "
            "and their units"
        )
        yield Finding("warning", "contact.gap", message)


# --- bodies that lie loose: nothing presses on them, and they can move without touching anything --


def explained(body: Model, task: Task, outcome: Outcome, place: float, when: str) -> Finding | None:
    """Return a finding that names the bodies that move away under the loads, or lie loose because
    nothing presses on them; None if neither is known.

    Args:
        body: the model.
        task: the contact problem.
        outcome: its outcome.
        place: position on the load path.
        when: name of the load step, put before the message.
    """
    moves = {Status.OPEN, Status.TIPS, Status.SLIDES, Status.NOT_HELD}
    if outcome.status not in moves:
        return None
    ends = "nothing holds" if outcome.status is Status.NOT_HELD else outcome.status.value
    for found in equilibrium(body, [place]):
        if found.level == "warning" and found.message.startswith(ends):
            return replace(found, message=when + found.message)
    held = outcome.status is not Status.NOT_HELD
    if held and outcome.status is not Status.OPEN:
        return None
    loose = task.idle
    if len(loose) < len(task.motions.assemblies):  # the other bodies are loaded
        loose = task.motions.untouched(
            loose, np.asarray(np.column_stack(outcome.newton.multipliers()).any(axis=1))
        )
    if not loose:
        return None if held else _hardly_held(body, task, when)
    message = (
        f"{when}nothing presses on {_named(body, loose)}, so that its position is not unique: "
        "press it on, or prescribe a displacement"
    )
    return Finding("warning", body.forces_at if held else "displacement", message)


def _hardly_held(body: Model, task: Task, when: str) -> Finding:
    """Return a finding with the motion that contact resists least, for bodies that would be held
    only if all contact points were in contact.
    """
    motions = task.motions
    least = (np.inf, 0, np.zeros(0))
    for number, columns in motions.assemblies:
        normal = parallel.gather_rows(body.comm, motions.relative[:, 0, columns])
        _, sizes, ways = np.linalg.svd(np.linalg.qr(normal, mode="r"))
        least = min(least, (sizes[-1] / sizes[0], number, ways[-1]), key=lambda entry: entry[0])
    _, number, motion = least
    free = body.motions.of_all[:, body.motions.assembly == number] @ motion[:, None]
    members = np.flatnonzero(body.motions.pieces.assembly == number)
    message = (
        f"{when}neither supports nor pressed contact hold "
        f"{names_of(free, body.motions, members)}: prescribe a displacement, or add friction"
    )
    return Finding("warning", "displacement", message)


def loose_in(body: Model, step: StepResult) -> list[int]:
    """Return the numbers of assemblies that supports do not hold and that have no tractions in a
    load step; collective.
    """
    motions = body.at_contact
    if step.contact is None or not motions.count:
        return []
    pressed = np.any(np.column_stack((step.contact.pressure, step.contact.shear)), axis=1)
    return motions.untouched([number for number, _ in motions.assemblies], pressed)


def loose_at_rest(
    body: Model, steps: Sequence[StepResult], path: str, names: tuple[str, ...] = ()
) -> Iterator[Finding]:
    """Yield a note about load steps in which bodies without tractions stayed where they were.

    Args:
        body: the model.
        steps: the results of the load steps.
        path: key of the scene that the note refers to.
        names: of bodies, if pieces have none.
    """
    loose = {step.step: numbers for step in steps if (numbers := loose_in(body, step))}
    if len(steps) == 1 or not loose:
        return
    which = f"load step{'s' * (len(loose) > 1)} {', '.join(map(str, loose))}"
    bodies = _named(body, sorted(set().union(*loose.values())), names)
    message = (
        f"{which}: nothing presses on {bodies}, so that its position is not unique: it stayed as "
        "near as possible to where it was"
    )
    yield Finding("note", path, message)


def _named(body: Model, loose: Sequence[int], names: tuple[str, ...] = ()) -> str:
    """Return the names of assemblies with their free motions, for a message.

    Args:
        body: the model.
        loose: numbers of the assemblies.
        names: see ``loose_at_rest``.
    """
    motions = body.motions
    if names:
        motions = replace(motions, pieces=replace(motions.pieces, bodies=names))
    members = np.flatnonzero(np.isin(motions.pieces.assembly, loose))
    free = names_of(motions.of_all[:, np.isin(motions.assembly, loose)], motions, members)
    if members.size == 1 and motions.moving is None:
        return f"the body, of which the supports do not hold {free}"
    return f"{free}, which the supports do not hold"


# --- refusals -------------------------------------------------------------------------------------


def refuse_beforehand(model: Model) -> None:
    """Refuse a problem that cannot be solved, or that needs an add-on which is not installed;
    collective.
    """
    if model.mixed is not None and model.mixed.encloses(model.vector, model.prescribed):
        reason = (
            "the pressure is not determined, because supports hold the whole boundary of the "
            "incompressible body: leave a part of it free"
        )
        raise SceneError.at("displacement", reason)
    if model.boundary is not None:
        model.first_sets()
    if model.settings.error_bound:
        add_on("error_bound")  # fail now, not after hours
