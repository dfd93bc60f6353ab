"""Area and forces of contact boundaries, the share of friction that loads use, and forces through
tightened sections.

On a boundary that closes around a body, as the seat of a hub on its shaft, resultant forces are
round-off: there the relevant figure is the moment of friction about the middle of the boundary.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from dolfinx import fem
from mpi4py import MPI

from signorini_fx.algebra.contact.friction import as_given
from signorini_fx.algebra.contact.motions import total_work
from signorini_fx.algebra.contact.statics import largest_multiple, reactions
from signorini_fx.arrays import Array, Flags, quotient, rmatvec
from signorini_fx.machine import parallel
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.kinematics import CARTESIAN, Kinematics
from signorini_fx.mechanics.loads.initial_strains import jumps_in
from signorini_fx.mechanics.model import Model
from signorini_fx.quantities.summary import ContactFigures, CornerFigures, SectionForce
from signorini_fx.tuned import CLOSED_BOUNDARY, ZERO_IN_SOLUTION

if TYPE_CHECKING:
    pass


def contact_figures(
    model: Model, kinematics: Kinematics, contact: ContactState
) -> list[ContactFigures]:
    """Return area, pressure and forces of each contact boundary, in the order of the scene.
    Collective.
    """
    boundary = contact.boundary
    comm = contact.boundary.comm
    figures = []
    uniform = kinematics.uniform and boundary.kinematics.uniform
    for part, effect in enumerate(model.contacts):
        moment, moment_limit = _moment_about_middle(contact, part) if uniform else (None, None)
        on_part = boundary.part == part
        nodes = boundary.at_nodes[on_part]
        weight = boundary.weight[on_part]
        pressure = contact.pressure[on_part]
        closed = contact.in_contact[on_part] & nodes
        sums = np.array(
            [
                weight @ nodes,
                weight @ closed,
                closed.sum(),
                weight @ pressure,
                weight @ np.where(contact.held_together, np.inf, contact.bound)[on_part],
                weight @ (pressure * nodes),
            ]
        )
        area, touching, count, normal, limit, spread = map(float, parallel.global_sum(comm, sums))
        reaction, resultant = contact.forces_of_each[part]
        tangential = float(np.linalg.norm(resultant))
        if tangential <= ZERO_IN_SOLUTION * max(abs(normal), limit if np.isfinite(limit) else 0.0):
            tangential = 0.0
        if boundary.friction_axes is not None and 0 < limit < np.inf:
            reached = resultant if tangential else np.zeros(3)
            limit = _largest_along(
                boundary.tangents[on_part], weight * contact.bound[on_part], reached, comm
            )
        figures.append(
            ContactFigures(
                boundary=effect.boundary,
                area=area,
                contact_area=touching,
                touching_nodes=round(count),
                pressure_integral=normal,
                mean_pressure=spread / touching if touching > 0 else None,
                contact_force=(reaction + 0.0).tolist(),
                friction_force=(resultant + 0.0).tolist(),
                max_pressure=parallel.largest(comm, pressure[nodes], -np.inf),
                tangential_force=tangential,
                slip_speed=_slip_speed(contact, on_part),
                friction_limit=limit,
                friction_moment=moment,
                moment_limit=moment_limit,
            )
        )
    return figures


def corner_figures(model: Model, contact: ContactState) -> list[CornerFigures]:
    """Return force, state and contact width of each corner of a foundation in contact, in the order
    of the scene.  Collective.

    A force P makes a contact of width P / (E tan b), where b is the angle between the facet and the
    nearer side of the corner; on the axis of a body of revolution the root of 2 P / (pi E tan b).
    """
    boundary = contact.boundary
    corners = contact.boundary.corners
    if corners is None:
        return []
    points = np.flatnonzero(contact.in_contact & ~boundary.at_nodes)
    none_n = np.zeros_like(contact.pressure)
    none_t = np.zeros_like(contact.shear)
    forces = [
        -boundary.nodal_forces(contact.pressure, none_t),
        -boundary.nodal_forces(none_n, contact.shear),
    ]
    columns = (
        boundary.part,
        corners.number // 2,
        corners.place[:, :2],
        *(force[:, :2] for force in forces),
        contact.displaced(contact.slip_length)[:, :1],
        (contact.direction != 0.0).any(axis=1),
        corners.facet,
        corners.slope,
    )
    rows = parallel.gather_rows(boundary.comm, np.column_stack(columns)[points])
    figures = []
    for part, number in np.unique(rows[:, :2], axis=0):
        of_corner = rows[(rows[:, :2] == (part, number)).all(axis=1)]
        first = of_corner[np.linalg.norm(of_corner[:, 4:6], axis=1).argmax()]
        normal = of_corner[:, 4:6].sum(axis=0)
        tangential = of_corner[:, 6:8].sum(axis=0)
        depth = float(np.broadcast_to(model.kinematics.measure(first[2:4, None]), 1)[0])
        size = float(np.linalg.norm(normal)) / max(model.scales.modulus * float(first[11]), 1e-300)
        width = size / depth if depth > 0 else np.sqrt(2 * size / np.pi)
        figures.append(
            CornerFigures(
                boundary=model.contacts[int(part)].boundary,
                place=first[2:4].tolist(),
                contact_force=(normal + 0.0).tolist(),
                friction_force=(tangential + 0.0).tolist(),
                state="slip" if first[9] else "stick",
                slip=float(first[8]),
                facet=float(first[10]),
                contact_width=float(width),
            )
        )
    return figures


def _slip_speed(contact: ContactState, on_part: Flags) -> list[float | None] | None:
    """Return the smallest and largest speed of slipping points where friction depends on the
    speed; None where it does not, or where no point slips.  Collective.
    """
    if contact.speed is None:
        return None
    slips = on_part & contact.in_contact & np.any(contact.direction != 0, axis=1)
    speeds = contact.speed[slips]
    largest = parallel.largest(contact.boundary.comm, speeds, -np.inf)
    least = -parallel.largest(contact.boundary.comm, -speeds, -np.inf)
    return [least, largest] if largest >= 0 else None


def _moment_about_middle(
    contact: ContactState, part: int
) -> tuple[float | list[float | None] | None, float | None]:
    """Return the moment of friction about the middle of a closed contact boundary and its limit.
    Collective.

    Returns (None, None) if the boundary is not closed.
    """
    boundary = contact.boundary
    comm = contact.boundary.comm
    on_part = boundary.part == part
    weight = boundary.weight[on_part]
    x = boundary.centre[on_part]
    normal = boundary.normal[on_part]
    dim = x.shape[1]
    total = parallel.global_sum(comm, weight @ np.column_stack((x, normal, np.ones(len(x)))))
    area = float(total[-1])
    if not np.linalg.norm(total[dim:-1]) < CLOSED_BOUNDARY * area:
        return None, None
    arm = x - total[:dim] / area
    force = -boundary.nodal_forces(np.zeros_like(contact.pressure), contact.shear)[on_part]
    moment = parallel.global_sum(comm, CARTESIAN[dim].turned(arm, force).sum(axis=0))
    size = float(np.linalg.norm(moment))
    turn = moment / size if size > 0 else np.eye(len(moment))[-1]
    way = np.column_stack((-arm[:, 1], arm[:, 0])) * turn if dim == 2 else np.cross(turn, arm)
    reach = np.linalg.norm(rmatvec(boundary.tangents[on_part], way), axis=1)
    largest_moments = weight * np.where(reach > 0, contact.bound[on_part] * reach, 0.0)
    limit = parallel.total(comm, largest_moments)
    components: list[float | None] = [float(component) for component in moment]
    return components[0] if len(components) == 1 else components, limit


def _largest_along(tangents: Array, bound: Array, resultant: Array, comm: MPI.Comm) -> float:
    """Return the sum of the largest friction forces in the direction of a resultant; if it is zero,
    in the direction of the larger friction.  Collective.

    Args:
        tangents: semi-axes of the friction ellipse at each point, shape (n, d, d - 1).
        bound: friction bound times weight, shape (n,).
        resultant: the resultant friction force.
        comm: the ranks.
    """
    lengths = np.linalg.norm(tangents, axis=1)
    largest = lengths.max(axis=1)
    if resultant.any():
        way = resultant / np.linalg.norm(resultant)
        along = np.linalg.norm(np.einsum("nij,i->nj", tangents, way) / lengths**2, axis=1)
        largest = quotient(1.0, along)
    return parallel.total(comm, bound @ largest)


def friction_used(model: Model, contact: ContactState, step: float) -> float | None:
    """Return the share of the available friction that the loads of a solution use.  Collective.

    With the present friction bounds the nodes in contact could balance loads of up to 1 / share
    times their size.  Of several bodies the largest share is returned, and None without friction or
    if supports hold the body.
    """
    if not model.motions.free.shape[1] or not model.applied or not contact.has_friction:
        return None
    if parallel.any_rank(contact.boundary.comm, bool(contact.held_together.any())):
        return None  # bonds hold as well
    load = load_on(model, step)
    motions = model.motions.at(contact.boundary)
    touching = contact.bilateral | contact.in_contact
    present = reactions(motions, as_given(contact.bound), contact.bilateral, touching)
    shares = []
    for number, columns in motions.assemblies:
        if load[columns].any():
            multiple = largest_multiple(present.of(number, columns), load[columns])
            if multiple > 0:
                shares.append(1 / multiple)
    return max(shares, default=None)


def load_on(model: Model, step: float) -> Array:
    """Return the work of the loads of a step on the free rigid motions, shape (k,).  Collective."""
    motions = model.motions
    loads = [
        (
            factor,
            motions.load_of(
                load.pushing, model.comm, None if load.driven is None else load.driven.forces
            ),
        )
        for factor, load in model.applied_at(step)
    ]
    return total_work(loads, motions.free.shape[1])


def section_forces(model: Model, displacement: fem.Function, step: float) -> list[SectionForce]:
    """Return the tension through each section that a scene shortens.  Collective.

    Let J be the jump of a shortening of one, which moves only the cells beyond the section.  The
    force is the work of the stress in these cells on J, without the work of the loads in these
    cells; loads on their surface do not count.
    """
    from signorini_fx.results.certificate.nodal_forces import NodalForces

    if all(load.entry is None for load in model.applied):
        return []
    nodal = NodalForces.on(model)
    return [
        SectionForce(
            name=jump.entry.name,
            force=nodal.through(jump, displacement, step),
            shortening=jump.amount(step),
        )
        for jump in jumps_in(model.statement, model.tagged, model.space)
    ]
