"""The certificate: whether a displacement and the contact tractions are a solution of the scene.

It takes the scene, the mesh, the displacement that the user gets, and the contact tractions; in a
later load step also those of the previous step, from which friction acts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from dolfinx import fem

from signorini_fx.arrays import Array, matvec, quotient
from signorini_fx.machine import parallel
from signorini_fx.mechanics.rigid.rigid_bodies import Drive, RigidBodyMotion
from signorini_fx.mechanics.scales import Scales
from signorini_fx.mechanics.statement.settings import SolverSettings
from signorini_fx.records import JUDGED, REPORTED, Finding
from signorini_fx.results.certificate.contact_nodes import (
    UNREGULARISED,
    ContactConditions,
    ContactNodes,
    Law,
    PreviousStep,
    Tractions,
)
from signorini_fx.results.certificate.equilibrium import (
    Balance,
    PieceScales,
    change_of_volume,
    equilibrium,
    share,
)
from signorini_fx.tuned import CERTIFICATE_TOLERANCE, LOST_UNITS, NEGLIGIBLE, NO_FORCE

if TYPE_CHECKING:
    from signorini_fx.results.certificate.nodal_forces import NodalForces


@dataclass(frozen=True, repr=False)
class Certificate:
    """How far a result is from the conditions of its problem; every figure is relative.

    Each connected piece of the mesh has its own scales:

    - forces are relative to those of loads, contact and springs on it where it is free;
    - stresses are relative to the largest pressure or shear, without the part that supports take;
    - lengths are relative to the deformation, which is the largest displacement without its rigid
      part;
    - penetration, complementarity and slip at stick nodes are relative to the largest displacement.

    Between two pieces the smaller stress and the larger length count.

    Attributes:
        equilibrium: residual of (3.3a) in the free unknowns, of all together and of the worst
            contact node as a stress; where the pressure is an unknown also that of the change of
            volume, relative to the mean strain.
        supports: largest difference from a prescribed displacement.
        negative_pressure: largest -lambda.
        friction_cone: largest |mu| - F g, or shear that is not tangential, or across a plane of
            symmetry of two bodies.
        wrong_way_slip: slip against mu, in 3D also perpendicular to it, excluded by (2.3e'): the
            smaller of the slip and the part of the shear that does not point along it.
        entered: largest tau_N y - d beyond what the law allows, of points that can move along their
            normal.
        pressure_at_distance: the complementarity (3.3b): the smaller of pressure and distance; at a
            point that cannot move along its normal, where supports take the force, the pressure.
        slip_below_bound: the complementarity (3.3c): the smaller of the slip and the distance of
            the shear from its bound.
        coupling: largest error in the identities of the map that couples two bodies, see
            ``PairPoints``.
        displacement: largest displacement, relative to the size of the body.
        penetration: largest tau_N y - d; it is lambda / gamma with the regularised law.
        complementarity: largest |lambda (tau_N y - d)|.
        stick_slip: largest slip where the shear is below its bound; it is |mu| / gamma with the
            regularised law.
        law: the contact law that was used for the check.
        strain_energy: a(y, y) / 2 of the strains without initial ones, an energy per thickness;
            None where forces are not linear in y.
        unjudged: pieces of the mesh whose loads are round-off of the largest forces, so that their
            equilibrium cannot be checked.
        lost: the residual of equilibrium that round-off of the forces may hide, see
            ``equilibrium``.
        placed: round-off of positions X + u, at which contact is evaluated, relative to the largest
            displacement.
        checked: the tolerance to which the tractions of each piece are checked, relative to its own
            stress (that of its tractions or the mean one): more than the usual tolerance where
            gamma, which a stiffer piece determines, or the joint system leaves larger errors in the
            softest piece.
    """

    equilibrium: float = 0.0
    supports: float = 0.0
    negative_pressure: float = 0.0
    friction_cone: float = 0.0
    wrong_way_slip: float = 0.0
    entered: float = 0.0
    pressure_at_distance: float = 0.0
    slip_below_bound: float = 0.0
    coupling: float = 0.0
    displacement: float = 0.0
    penetration: float = 0.0
    complementarity: float = 0.0
    stick_slip: float = 0.0
    law: Law = UNREGULARISED
    strain_energy: float | None = 0.0
    unjudged: tuple[int, ...] = ()
    lost: float = 0.0
    placed: float = 0.0
    checked: float = CERTIFICATE_TOLERANCE

    def __repr__(self) -> str:
        verdict = "holds" if self.holds else "does not hold"
        return f"<Certificate: {verdict}, largest figure {self.worst:.1e}, {self.law}>"

    @property
    def worst(self) -> float:
        """The largest of the judged figures; the regularisation error is not among them."""
        return float(np.max([getattr(self, name) for name in JUDGED]))

    @property
    def worst_name(self) -> str:
        """The name of the largest judged figure; nan counts as the largest."""
        return max(JUDGED, key=lambda name: np.nan_to_num(getattr(self, name), nan=np.inf))

    @property
    def holds(self) -> bool:
        """Whether the result is a solution of the law that its method promises: all judged figures
        are within the tolerance.
        """
        return self.worst <= CERTIFICATE_TOLERANCE

    def as_dict(self) -> dict[str, float | bool | str]:
        """Return all figures, the law, and the verdict."""
        figures = {name: getattr(self, name) for name in (*JUDGED, *REPORTED, "checked")}
        return {**figures, "law": str(self.law), "holds": self.holds}


def balance_of(forces: NodalForces, displacement: fem.Function, step: float) -> Balance:
    """Return the forces on a body without contact.  Collective.

    Args:
        forces: the forces of the scene.
        displacement: y.
        step: position in the lists of load factors.
    """
    statement = forces.statement
    tagged = forces.tagged
    scales = Scales(
        tagged.dimension, statement.young, tagged.size, forces.kinematics.depth(tagged.size)
    )
    return Balance(
        forces.pieces,
        forces.internal(displacement),
        forces.external(step),
        forces.prescribed(step),
        scales,
        # If the pressure is an unknown, forces are not those of the bulk modulus.
        replace(
            scales,
            modulus=max(
                material.stiffest(pressed=forces.pressed) for material in statement.material
            ),
        ),
        forces.resisted(displacement),
        *forces.initial(step, displacement),
        dilation=forces.dilation(displacement, step),
    )


def judged(
    displacement: fem.Function,
    balance: Balance,
    contact: ContactConditions | None,
    tractions: Tractions | None,
    *,
    law: Law = UNREGULARISED,
    before: PreviousStep | None = None,
    rigid: Sequence[tuple[RigidBodyMotion, Drive]] = (),
) -> Certificate:
    """Check the conditions of a load step from the displacement and the contact tractions alone.
    Collective.

    Args:
        displacement: y.
        balance: the forces on the body without contact.
        contact: the contact points and their conditions; None without contact.
        tractions: pressure and shear at the contact points; None without contact.
        law: the contact law that the method promises.
        before: the end of the previous load step; None for the first step.  If that step used the
            regularised law and this one does not, its elastic slip is removed.
        rigid: the motion of each rigid body, and the force, moment or motion that drives it.
    """
    supports = balance.supports
    pieces = balance.pieces
    comm = pieces.space.mesh.comm
    owned, dim = pieces.x.shape
    y = displacement.x.array.reshape(-1, dim)[:owned]
    works = balance.works(y)
    half = float(works[:, 0].sum()) / 2
    strain_energy = balance.strain_energy(works)
    strained = max(
        half, strain_energy if balance.dilation is not None else 0.0
    )  # an unknown pressure may reduce half
    scales, stiffest = balance.of_pieces()
    # It is not known which piece the initial strains strain.
    halves = (
        works[:, 0] / 2
        if balance.dilation is None or strain_energy == half
        else np.full(pieces.count, strained)
    )
    mean = scales.stress(np.maximum(halves, 0.0) + balance.energies)
    if (
        balance.with_loads
    ):  # their work gives no stress without contact, the reactions of supports do
        held = np.linalg.norm(balance.internal - supports.left(balance.internal), axis=1)
        mean = np.maximum(mean, pieces.sums(held[:, None])[:, 0] / scales.surface)
    far = pieces.largest(np.linalg.norm(y, axis=1))
    deformed = pieces.largest_beside(y)
    length = np.maximum(deformed, NO_FORCE * far.max())
    figures: dict[str, Any] = {
        "supports": share(comm, supports.missed(y), length[supports.among(pieces.piece)]),
        "displacement": float(far.max()) / balance.scales.size,
        "law": law,
        "strain_energy": None if balance.with_loads else strain_energy,
    }
    volume = change_of_volume(balance, float(far.max()), strained)
    if tractions is None or contact is None:
        units = PieceScales(length, far, np.zeros(pieces.count), np.zeros(pieces.count))
        unbalanced, unjudged, lost = equilibrium(balance, y, None, units, float(far.max()))
        return Certificate(
            equilibrium=max(unbalanced, volume), unjudged=unjudged, lost=lost, **figures
        )
    nodes = ContactNodes.of(contact, tractions)
    at = nodes.pieces(pieces.piece)
    figures["coupling"] = max((pair.error() for pair in contact.pairs.values()), default=0.0)

    def largest(values: Array) -> Array:
        """Return the largest value of the points of each piece, from either side."""
        return pieces.largest(np.concatenate((values, values)), np.concatenate(at))

    drawn = np.zeros(contact.boundary.size)
    moved = [motion for motion, _ in rigid]
    for motion in moved:
        touching = contact.part(*motion.body.parts)
        drawn[touching] = np.linalg.norm(motion.at(contact.boundary.x[touching]), axis=1)
    length = np.maximum(length, NO_FORCE * largest(drawn))
    reach = max(float(far.max()), float(largest(drawn).max()))
    alone = balance.unloaded
    # Where the contact transmits nothing, its tractions are round-off of the stress in the body and
    # of displacements.
    fineness = largest(np.asarray(1.0 / balance.scales.side(contact.boundary.weight)))
    unknown = stiffest.modulus * np.where(alone, reach, far) * fineness
    # The part of a traction that supports take leaves its round-off in the free directions, and in
    # the penetration.
    unknown = np.maximum(unknown, largest(np.linalg.norm(nodes.traction, axis=1)))
    felt = largest(nodes.felt)
    stress = np.max([felt, NEGLIGIBLE * mean, NO_FORCE * unknown], axis=0)
    length = np.maximum(length, NO_FORCE * largest(np.abs(nodes.pressure)) / law.gamma_n)
    u_n, slip = nodes.traces(y, moved)
    origin = np.zeros_like(nodes.shear)
    if before is not None:  # the step adds to it, and has its round-off
        last = ContactNodes.of(contact, before.tractions)
        so_far = before.displacement.x.array.reshape(-1, dim)[:owned]
        stress = np.maximum(stress, NO_FORCE * largest(last.felt))
        length = np.maximum(
            length,
            NO_FORCE * np.maximum(largest(last.terms(so_far)), pieces.largest_beside(so_far)),
        )
        slip = slip - last.traces(so_far, before.rigid)[1]
        origin = last.shear
        if before.elastic_slip is not None and not np.isfinite(law.gamma_t):
            slip = slip + nodes.rounded(before.elastic_slip, power=-2)
        if before.moved is not None:  # slip is relative to the foundation
            slip = slip - before.moved
        # Foundations may have turned since: what was along them then need not be along them now.
        slip = nodes.along(slip)
        origin = nodes.along(origin)
    # A relative displacement is a difference: most of it may be common to two bodies, or to a body
    # and a moving rigid one, and the solver loses digits of the larger of both.
    farther = np.where(at[1] < 0, drawn, np.maximum(far[at[0]], far[at[1]]))
    terms = NO_FORCE * np.maximum(
        largest(np.maximum(nodes.terms(y), farther)), np.where(alone, reach, 0.0)
    )
    penalty = terms * max(
        (gamma for gamma in (law.gamma_n, law.gamma_t) if np.isfinite(gamma)), default=0.0
    )
    # With a larger gamma nothing is known of the tractions.  In a body without stress they are
    # round-off of the method.
    strains = mean > LOST_UNITS * NO_FORCE * stiffest.modulus * reach / stiffest.size
    penalty = np.where(
        strains, np.minimum(penalty, mean / NEGLIGIBLE), np.maximum(penalty, terms * law.penalty)
    )
    # Where contact is evaluated at X + u, distances have the round-off of X, however small u is;
    # gaps of a body at rest, too.
    farthest = max(
        parallel.largest(comm, np.linalg.norm(pieces.x, axis=1), 0.0), float(np.max(scales.size))
    )
    placed = (
        np.full_like(terms, NO_FORCE * farthest)
        if balance.displaced or reach == 0
        else np.zeros_like(terms)
    )
    length = np.maximum(length, np.maximum(terms, placed))
    stress = np.maximum(stress, penalty)
    stress = np.maximum(stress, NO_FORCE * float(stress.max()))  # round-off of the joint system
    # If everything sticks, all motion is round-off of the displacements that the stresses could
    # cause.
    still = NEGLIGIBLE * scales.deflection(stress)
    units = PieceScales(np.maximum(length, still), np.maximum(far, still), stress, penalty)
    points = units.between(*at)
    own = np.maximum(felt, mean)
    known = own > NO_FORCE * stiffest.modulus * reach / stiffest.size
    blunter = quotient(stress, own, known, otherwise=1.0).max()
    figures["checked"] = CERTIFICATE_TOLERANCE * max(1.0, float(blunter))
    figures |= contact_conditions(
        nodes.without_bond(u_n, slip),
        u_n,
        nodes.rounded(slip, 1),
        nodes.rounded(origin, -1),
        law,
        points,
    )
    unbalanced, unjudged, lost = equilibrium(balance, y, nodes, units, reach)
    for motion, drive in rigid:
        touching = contact.part(*motion.body.parts)
        # Round-off of the stress in the pieces that it touches, of the penalty, and of the joint
        # system.
        faint = np.maximum(NEGLIGIBLE * mean, penalty)[at[0][touching]]
        faint_stress = max(parallel.largest(comm, faint), NO_FORCE * float(mean.max()))
        area = parallel.total(comm, contact.boundary.weight[touching])
        resultant = nodes.resultant(motion, y, displaced=balance.displaced)
        unbalanced = max(unbalanced, motion.unbalanced(drive, resultant, faint_stress * area))
    if balance.displaced and reach > 0:
        figures["placed"] = float(np.finfo(float).eps * farthest / reach)
    return Certificate(equilibrium=max(unbalanced, volume), unjudged=unjudged, lost=lost, **figures)


def contact_conditions(
    nodes: ContactNodes,
    u_n: Array,
    slip: Array,
    origin: Array,
    law: Law,
    units: PieceScales,
) -> dict[str, float]:
    """Return how far contact points are from the contact law, as figures of ``Certificate`` by
    name.  Collective.

    Args:
        nodes: the contact points with tractions, without those of a bond.
        u_n: tau_N y, length, shape (n,).
        slip: tangential slip since the previous step, see ``ContactNodes.rounded``, length, shape
            (n, d).
        origin: shear at the end of the previous step, see ``ContactNodes.rounded``, stress, shape
            (n, d).
        law: the contact law.
        units: the scales of each point.
    """
    pressure = nodes.pressure
    shear = nodes.rounded(nodes.shear, -1)
    bilateral = nodes.bilateral
    immovable = nodes.boundary.points.immovable
    comm = nodes.boundary.comm
    length = units.length
    far = units.far
    stress = units.stress
    unity = np.ones_like(stress)
    overlap = u_n - nodes.gap
    if law.softness is not None:
        overlap = overlap - law.softness * np.maximum(pressure, 0.0)
    sheared = np.linalg.norm(shear, axis=1)
    bound = nodes.bound(np.linalg.norm(slip, axis=1))
    entered = overlap - pressure / law.gamma_n
    for number, soft in law.overclosures.items():
        on = nodes.part(number)
        entered[on] = np.maximum(overlap[on], 0.0) - pressure[on] / soft.stiffness
    xi = slip - (shear - origin) / law.gamma_t
    # At points that cannot move along their normal, supports take the contact force, and the
    # pressure must vanish.
    overlap = np.where(immovable, np.minimum(overlap, 0.0), overlap)
    entered = np.where(immovable, 0.0, entered)
    distance = np.where(immovable, np.inf, np.where(bilateral, 0.0, np.maximum(-entered, 0.0)))
    pushing = np.where(immovable, np.abs(pressure), pressure)
    slipped = np.linalg.norm(xi, axis=1)
    way = quotient(xi, slipped[:, None])
    along = np.sum(shear * way, axis=1)
    astray = np.linalg.norm(shear - np.maximum(along, 0.0)[:, None] * way, axis=1)
    # A shear along the normal, or across a plane of symmetry, is no friction.
    excluded = np.linalg.norm(nodes.shear - nodes.along(nodes.shear), axis=1)
    for pair, part in nodes.of_pairs:
        across = matvec(pair.across, nodes.shear[part])
        excluded[part] = np.hypot(excluded[part], np.linalg.norm(across, axis=1))
    figures = {
        "negative_pressure": (-pressure[~bilateral], stress[~bilateral]),
        "friction_cone": (np.maximum(sheared - bound, excluded), stress),
        "wrong_way_slip": (_smaller(slipped, length, astray, stress), unity),
        "entered": (np.where(bilateral, np.abs(entered), entered), length),
        "pressure_at_distance": (_smaller(distance, length, pushing, stress), unity),
        "slip_below_bound": (_smaller(slipped, length, bound - along, stress), unity),
        "penetration": (np.where(bilateral & ~immovable, np.abs(overlap), overlap), far),
        "complementarity": (np.abs(pressure * overlap), stress * far),
        "stick_slip": (
            np.where(
                sheared < bound - CERTIFICATE_TOLERANCE * stress,
                np.linalg.norm(slip, axis=1),
                0.0,
            ),
            far,
        ),
    }
    return {name: share(comm, violation, unit) for name, (violation, unit) in figures.items()}


def _smaller(a: Array, unit_a: Array, b: Array, unit_b: Array) -> Array:
    """Return min(|a|, max(b, 0)), each divided by its own unit: zero where one of the two
    conditions holds.
    """
    first, second = (np.where(unit > 0, unit, 1.0) for unit in (unit_a, unit_b))
    return np.minimum(np.abs(a) / first, np.maximum(b, 0.0) / second)


def another_law(
    settings: SolverSettings,
    laws: Mapping[int, Law],
    left: float | None,
    *,
    raises_gamma: bool = False,
) -> Finding | None:
    """Return a warning if a load step was solved with another contact law than the settings
    request, or None.

    Args:
        settings: the settings of the solver.
        laws: the law of each load step, by its number.
        left: the regularisation error of the last step relative to its energy norm, where
            path-following has estimated it; otherwise None.
        raises_gamma: whether an accuracy is requested, for which gamma is raised as needed.
    """
    exact = settings.algorithm == "alm"
    if raises_gamma and not exact:
        return None
    if settings.algorithm == "path-following":
        allowed = settings.regularisation_error
        if allowed == "auto" or left is None or left <= allowed:
            return None
        gamma = list(laws.values())[-1].gamma_n
        message = (
            f"the regularisation error is {left:.2g}, above the required {allowed:.2g}; with a "
            f"gamma above {gamma:.3g} round-off would dominate: use algorithm = 'alm'"
        )
        return Finding("warning", "solver.regularisation_error", message)
    given = {
        name: value
        for name in ("gamma_n", "gamma_t")
        if (value := getattr(settings, name)) != "auto"
    }
    if exact:
        key = "algorithm"
        asked = "'alm'"
        others = [step for step, law in laws.items() if law.regularised]
        remedy = (
            "raise solver.gamma_n and solver.gamma_t to reduce penetration and elastic slip, or "
            "change the loads in smaller steps"
        )
    else:
        key = "gamma_n"
        asked = ", ".join(f"{name} = {value:.3g}" for name, value in given.items())
        others = [
            step
            for step, law in laws.items()
            if any(getattr(law, name) != given[name] for name in given)
        ]
        remedy = "lower gamma, or set solver.fallbacks = false to have this gamma or nothing"
    if not others:
        return None
    where = (
        f" in load step{'s' * (len(others) > 1)} {', '.join(map(str, others))}"
        if len(laws) > 1
        else ""
    )
    message = f"a fall-back has solved {laws[others[-1]]} in place of {asked}{where}; {remedy}"
    return Finding("warning", f"solver.{key}", message)
