"""The certificate: whether a displacement and the contact tractions are a solution of the scene.

It takes the scene, the mesh, the displacement that the user gets, and the contact tractions (pressure and shear at the
contact nodes); in a later load step also those of the previous step, from which friction acts.  It uses nothing else
from the solver: internal and external forces, prescribed displacements, weights and normals, gap, friction bound and
slip are evaluated again by ``nodal_forces``, in NumPy.  So faults of the solver show up as follows:

- a displacement that is not the one that the iteration has found (a rotation or a resting place that is left out, an
  interior that is not recovered): ``equilibrium``, ``supports``, or at the contact nodes ``entered`` and the slip;
- a wrong row of the stiffness matrix, wrong moduli, a wrong load, a load factor: ``equilibrium``;
- wrong weights or normals: ``equilibrium``, since they turn tractions into forces;
- a wrong gap or friction bound: ``entered``, ``pressure_at_distance``, ``friction_cone``, ``slip_below_bound``;
- an iteration that stops too early: the conditions that are not satisfied yet.

It does not detect faults in what both sides share: the mesh and its names, basix, the values of expressions,
quadrature degrees, and loads given as UFL expressions.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from mpi4py import MPI

from signorini_fx import parallel
from signorini_fx.mesh.tagged import TaggedMesh
from signorini_fx.records import CERTIFICATE_TOLERANCE
from signorini_fx.results.contact_nodes import ContactNodes, ContactSide, sides_of
from signorini_fx.results.nodal_forces import NodalForces, left_over
from signorini_fx.results.promised_law import UNREGULARISED, Before, Law, Tractions
from signorini_fx.results.rigid_part import RigidPart
from signorini_fx.results.supports import Supports
from signorini_fx.results.surface_quadrature import SurfaceQuadrature
from signorini_fx.results.tool_motion import ToolMotion
from signorini_fx.results.tools import given_in, unbalanced
from signorini_fx.scales import Scales
from signorini_fx.scene.model import Scene

if TYPE_CHECKING:
    from signorini_fx.body.paired_points import PairedSides

Nodal = npt.NDArray[np.float64]

# The figures that decide.
JUDGED = (
    "equilibrium",
    "supports",
    "negative_pressure",
    "friction_cone",
    "wrong_way_slip",
    "entered",
    "pressure_at_distance",
    "slip_below_bound",
    "coupling",
)
# The others give the regularisation error, and how far the body moves.
REPORTED = ("displacement", "penetration", "complementarity", "stick_slip")
# Forces below this share of stiffness times displacement are round-off of a stress-free motion.
_ROUND_OFF = 1e-8
# Units in the last place of displacements and loads that an evaluation of their nodal forces may lose.
_LOST_UNITS = 100.0
# What a penalty makes of round-off may be 0.1 % of the mean stress in bodies that are not without stress.
_ABOVE_THE_MEAN = 1e3
# Contact stresses below this share of the mean stress in the body cannot be distinguished from zero.
_FAINT = 1e-3


@dataclass(frozen=True, repr=False)
class Certificate:
    """How far a result is from the conditions of its problem; every figure is relative.

    Forces are relative to the largest of internal and external ones, stresses to the largest pressure or shear without
    what supports take of them, lengths to the deformation: the largest displacement without the rigid part of each body
    (of penetration, complementarity and slip at stick nodes: to the largest displacement).

    Attributes:
        equilibrium: residual of (3.3a) in the free unknowns, of all together and of the worst contact node as a stress;
            of a mixed element also that of its change of volume, relative to the mean strain.
        supports: largest difference from a prescribed displacement.
        negative_pressure: largest -lambda.
        friction_cone: largest |mu| - F g, or shear across a plane of symmetry of two bodies.
        wrong_way_slip: slip against mu, in space also perpendicular to it, excluded by (2.3e'): the smaller of the slip
            and the part of the shear that does not point along it.
        entered: largest tau_N y - d beyond what the law allows for.
        pressure_at_distance: the complementarity (3.3b): the smaller of pressure and distance.
        slip_below_bound: the complementarity (3.3c): the smaller of the slip and the distance of the shear from its
            bound.
        coupling: largest error of the map that joins pairs of bodies, in its identities and in integrals at some of its
            points.
        displacement: largest displacement, relative to the size of the body.
        penetration: largest tau_N y - d; lambda / gamma by the regularisation.
        complementarity: largest |lambda (tau_N y - d)|.
        stick_slip: largest slip where the shear is below its bound; |mu| / gamma by the regularisation.
        law: the contact law that was used for the check.
        strain_energy: of the stress, an energy per thickness: a(y, y) / 2 of the strains without initial ones.
        potential_energy: the same, and that of what resists the displacement, without the work of the loads.
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
    strain_energy: float = 0.0
    potential_energy: float = 0.0

    def __repr__(self) -> str:
        verdict = "holds" if self.holds else "does not hold"
        return f"<Certificate: {verdict}, largest figure {self.worst:.1e}, {self.law}>"

    @property
    def worst(self) -> float:
        """The largest of the judged figures; the regularisation error is not among them."""
        return float(np.max([getattr(self, name) for name in JUDGED]))

    @property
    def holds(self) -> bool:
        """Whether the result is a solution of the law that its method promises."""
        return self.worst <= CERTIFICATE_TOLERANCE

    def as_dict(self) -> dict[str, float | bool | str]:
        """All figures, the law, and the verdict."""
        figures = {name: getattr(self, name) for name in (*JUDGED, *REPORTED)}
        return {**figures, "law": str(self.law), "holds": self.holds}


def certify(
    scene: Scene,
    tagged: TaggedMesh,
    displacement: fem.Function,
    tractions: Tractions | None,
    *,
    law: Law = UNREGULARISED,
    step: float = 0,
    scale: float = 1.0,
    before: Before | None = None,
    pairs: Mapping[int, PairedSides] | None = None,
    tools: tuple[ToolMotion, ...] = (),
) -> Certificate:
    """Check the conditions of a load step from the displacement and the contact tractions alone; collective.

    Args:
        scene: the scene.
        tagged: its mesh.
        displacement: y.
        tractions: pressure and shear at the contact nodes; None for a scene without contact.
        law: the contact law that the method promises.
        step: the load step, from 0, or a place between two.
        scale: factor of all loads and prescribed displacements.
        before: the end of the previous load step; None for the first one.  If that kept to the regularised law and this
            one does not, its elastic slip is removed.
        pairs: bodies in contact as the solver has paired them, see ``sides_of``.
        tools: how rigid tools have moved.

    Raises:
        ValueError: the tractions are not those of the contact nodes of the scene.
    """
    space = displacement.function_space
    forces = NodalForces(scene, tagged, space)
    every = displacement.x.array.reshape(-1, tagged.mesh.geometry.dim)
    scales = Scales.of(tagged.dimension, scene.young, tagged.size, axisymmetric=scene.axisymmetric)
    mixed = scene.element.volumetric == "mixed"  # whose forces are not those of a change of volume
    stiffest = replace(scales, modulus=max(one.stiffest(mixed=mixed) for one in scene.material))
    balance = Balance(
        forces,
        forces.internal(displacement),
        forces.external(step, scale),
        Supports.of(forces, step, scale),
        scales,
        stiffest,
        forces.resisted(every),
        *forces.initial(step, scale, displacement),
        dilation=forces.dilation(displacement, step, scale) if mixed else None,
    )
    sides = sides_of(scene, tagged, space, pairs)
    if tractions is not None and tractions.fluid is not None:
        from signorini_fx.results.entered_fluid import forces_entered

        balance = replace(balance, external=balance.external + forces_entered(forces, sides, tractions, step))
    found = judged(displacement, balance, sides, tractions, law=law, before=before, tools=tools)
    if tools and tractions is not None:
        nodes, given = ContactNodes.of(forces, sides, tractions), given_in(scene, tools, step, scale)
        left = unbalanced(nodes, given, _FAINT * scales.stress(found.strain_energy) * nodes.area)
        found = replace(found, equilibrium=max(found.equilibrium, left))
    return found


@dataclass(frozen=True)
class Balance:
    """The forces on a body without contact, evaluated anew, and what they are compared with.

    Attributes:
        surface: integrals over its boundary.
        internal: a(y, .) of the strains, forces, shape (owned nodes, d).
        external: L, forces, shape (owned nodes, d).
        supports: what is prescribed.
        scales: of its lengths and stresses.
        stiffest: the same with the largest modulus.
        resisted: what resists the displacement on the boundary, the rest of a(y, .), forces, shape (owned nodes, d).
        initial: those of initial strains where they are prevented, forces, shape (owned nodes, d).
        prevented: energy of their stress then.
        dilation: see ``NodalForces.dilation``; None: the pressure is no unknown.
    """

    surface: SurfaceQuadrature
    internal: Nodal
    external: Nodal
    supports: Supports
    scales: Scales
    stiffest: Scales
    resisted: Nodal
    initial: Nodal | float = 0.0
    prevented: float = 0.0
    dilation: tuple[Nodal, Nodal] | None = None


@dataclass(frozen=True)
class _Units:
    """What figures are relative to: a length of the deformation, of the displacement, and a stress; the latter is at
    least ``penalty``, of which the round-off of a regularised law of two bodies is a tolerated share.
    """

    length: float
    far: float
    stress: float
    penalty: float = 0.0


def judged(
    displacement: fem.Function,
    balance: Balance,
    sides: Sequence[ContactSide],
    tractions: Tractions | None,
    *,
    law: Law = UNREGULARISED,
    before: Before | None = None,
    tools: tuple[ToolMotion, ...] = (),
) -> Certificate:
    """Check equilibrium and contact conditions of a problem; collective.

    Args:
        displacement: y.
        balance: forces on the body without contact.
        sides: the parts of its boundary with contact.
        tractions: pressure and shear at the contact points; None: there are none.
        law: see ``certify``.
        before: see ``certify``.
        tools: see ``certify``.

    Raises:
        ValueError: the tractions are not those of the contact points.
    """
    forces, supports, scales = balance.surface, balance.supports, balance.scales
    comm, dim = forces.space.mesh.comm, forces.dimension
    every = displacement.x.array.reshape(-1, dim)
    y, x = every[: forces.owned], forces.at_nodes[: forces.owned, :dim]
    works = [np.sum(force * y) for force in (balance.internal, balance.resisted, balance.external, balance.initial)]
    energy, stored, work, expanding = map(float, parallel.global_sum(comm, np.array(works)))
    strain_energy = max(0.0, left_over(half := energy / 2, balance.prevented - expanding))
    strained = max(half, strain_energy if balance.dilation is not None else 0.0)  # or its pressure takes of it
    far = _largest(comm, np.linalg.norm(y, axis=1))
    drawn = max((float(np.linalg.norm(tool.translation)) for tool in tools), default=0.0)
    rigid = RigidPart(forces.space, x)
    length = max(rigid.largest_beside(y), _ROUND_OFF * max(far, drawn))
    found: dict[str, Any] = {
        "supports": _share(_largest(comm, supports.missed(y)), length),
        "displacement": far / scales.size,
        "law": law,
        "strain_energy": strain_energy,
        "potential_energy": strain_energy + stored / 2 - work,
    }
    volume = _change_of_volume(balance, far, strained)
    if tractions is None:
        left = equilibrium(balance, y, None, _Units(length, far, 0.0))
        return Certificate(equilibrium=max(left, volume), **found)
    nodes = ContactNodes.of(forces, sides, tractions)
    found["coupling"] = nodes.coupling_error(supports, y / (far or 1.0))
    # Where the contact transmits nothing its reactions are round-off of the stress in the body.
    inside = _FAINT * scales.stress(strained)
    finest = -parallel.largest(comm, -scales.side(nodes.weight), -np.inf)
    stress = max(_largest(comm, nodes.felt(supports)), inside, _ROUND_OFF * balance.stiffest.modulus * far / finest)
    # What supports take of a traction leaves its round-off in the directions that are free, and in the penetration.
    stress = max(stress, _ROUND_OFF * _largest(comm, np.linalg.norm(nodes.traction, axis=1)))
    length = max(length, _ROUND_OFF * _largest(comm, np.abs(nodes.pressure)) / law.gamma_n)
    (u_n, slip), origin = nodes.traces(every, tools), np.zeros_like(nodes.shear)
    if before is not None:  # what is added to it has its round-off
        last = ContactNodes.of(forces, sides, before.tractions)
        so_far = before.displacement.x.array.reshape(-1, dim)
        stress = max(stress, _ROUND_OFF * _largest(comm, last.felt(supports)))
        common = _largest(comm, last.terms(so_far[: forces.owned]))
        length = max(length, _ROUND_OFF * max(common, rigid.largest_beside(so_far[: forces.owned])))
        slip, origin = slip - last.traces(so_far, before.tools)[1], last.shear
        if before.elastic_slip is not None and not np.isfinite(law.gamma_t):
            elastic = replace(before.tractions, shear=before.elastic_slip)
            slip = slip + nodes.rounded(ContactNodes.of(forces, sides, elastic).shear, power=-2)
        if before.moved is not None:  # slip is relative to the foundation, and shear along it
            moved = ContactNodes.of(forces, sides, replace(before.tractions, shear=before.moved)).shear
            slip, origin = (
                one - np.einsum("ni,ni->n", one, nodes.normal)[:, None] * nodes.normal for one in (slip - moved, origin)
            )
    # Most of the displacement that a relative one is the difference of may be common to two bodies.
    terms = _ROUND_OFF * _largest(comm, nodes.terms(y))
    penalty = terms * max((one for one in (law.gamma_n, law.gamma_t) if np.isfinite(one)), default=0.0)
    mean = scales.stress(strained)
    if mean > _LOST_UNITS * _ROUND_OFF * balance.stiffest.modulus * far / scales.size:
        penalty = min(penalty, _ABOVE_THE_MEAN * mean)  # with a larger gamma nothing is known of the tractions
    length, stress = max(length, terms), max(stress, penalty)
    # If everything sticks, all motion is round-off of the displacements that the stresses could cause.
    still = _FAINT * scales.deflection(stress)
    units = _Units(max(length, still), max(far, still), stress, penalty)
    found |= contact_conditions(nodes, u_n, nodes.rounded(slip, 1), nodes.rounded(origin, -1), law, supports, units)
    return Certificate(equilibrium=max(equilibrium(balance, y, nodes, units), volume), **found)


def equilibrium(balance: Balance, y: Nodal, nodes: ContactNodes | None, units: _Units) -> float:
    """The residual of (3.3a) in the free unknowns, of all together and of the worst contact node as a stress;
    collective.

    Args:
        balance: forces on the body without contact.
        y: displacements of the owned nodes, shape (owned nodes, d).
        nodes: the contact points with the tractions at them; None: there are none.
        units: what stresses and lengths are relative to.
    """
    comm, stiffest, supports = balance.surface.space.mesh.comm, balance.stiffest, balance.supports
    spacing = stiffest.spacing(balance.surface.space.dofmap.index_map.size_global)
    # A motion without stress, or without change of volume, has forces too: round-off of the largest modulus.
    least = _ROUND_OFF * stiffest.stiffness(spacing) * _norm(comm, y)
    loads = balance.external + balance.initial
    force = max(least, *(_norm(comm, one) for one in (balance.internal, balance.resisted, loads)))
    residual = balance.internal + balance.resisted - loads
    if nodes is not None:
        reached, contact_forces, area = nodes.forces()
        np.add.at(residual, reached, contact_forces)
        force = max(force, units.penalty * _norm(comm, area))
    residual = supports.left(residual)
    digits = _LOST_UNITS * np.finfo(float).eps
    whole = _share(_norm(comm, residual) - digits * least / _ROUND_OFF, force)
    if nodes is None:
        return whole
    # The stress at a node is known to the digits of loads, and of the displacement over the length of its side.
    load = _largest(comm, np.linalg.norm(loads, axis=1))
    lost = digits * (stiffest.modulus * units.far / stiffest.side(area) + load / area)
    unbalanced = np.linalg.norm(residual[reached], axis=1) / area - lost
    return max(whole, _share(_largest(comm, unbalanced), units.stress))


def _change_of_volume(balance: Balance, far: float, strain_energy: float) -> float:
    """How far the volume of a mixed element changes otherwise than its pressure says, relative to the mean strain, or
    to what loads may cause (in an enclosed body a pressure, and no strain); ``far``: largest displacement; collective.
    """
    if balance.dilation is None:
        return 0.0
    (residual, volume), comm, scales = balance.dilation, balance.surface.space.mesh.comm, balance.scales
    loads = float(parallel.global_sum(comm, np.linalg.norm(balance.external, axis=1).sum())) / scales.surface
    strain = max(scales.stress(strain_energy), _FAINT * loads) / scales.modulus
    spacing = scales.spacing(balance.surface.space.dofmap.index_map.size_global)
    lost = _LOST_UNITS * np.finfo(float).eps * far / spacing
    return _share(_norm(comm, residual) - lost * _norm(comm, volume), strain * _norm(comm, volume))


def contact_conditions(
    nodes: ContactNodes, u_n: Nodal, slip: Nodal, origin: Nodal, law: Law, supports: Supports, units: _Units
) -> dict[str, float]:
    """How far contact points are from the law, the figures of ``Certificate`` by name; collective.

    Args:
        nodes: the contact points with the tractions at them, n of them.
        u_n: tau_N y, shape (n,).
        slip: what tau_T y adds to the previous step, shape (n, d), see ``ContactNodes.rounded``.
        origin: shear at its end, shape (n, d), likewise.
        law: the contact law that the method promises.
        supports: what is prescribed.
        units: what stresses and lengths are relative to.
    """
    pressure, shear, bilateral = nodes.pressure, nodes.rounded(nodes.shear, -1), nodes.bilateral
    comm, length, far, stress = nodes.evaluation.space.mesh.comm, units.length, units.far, units.stress
    overlap, sheared = u_n - nodes.gap, np.linalg.norm(shear, axis=1)
    entered = overlap - pressure / law.gamma_n
    xi = slip - (shear - origin) / law.gamma_t
    if not np.isfinite(law.gamma_n):
        # Where the supports prescribe the distance, what contact excludes of it belongs to the scene.
        allowed = np.where(bilateral, 0.0, np.minimum(entered, 0.0))
        entered = np.where(nodes.immovable(supports), allowed, entered)
    distance = np.where(bilateral, 0.0, np.maximum(-entered, 0.0))
    slipped = np.linalg.norm(xi, axis=1)
    way = np.divide(xi, slipped[:, None], out=np.zeros_like(xi), where=(slipped > 0)[:, None])
    along = np.sum(shear * way, axis=1)
    astray = np.linalg.norm(shear - np.maximum(along, 0.0)[:, None] * way, axis=1)
    figures = {
        "negative_pressure": (-pressure[~bilateral], stress),
        "friction_cone": (np.maximum(sheared - nodes.bound, np.linalg.norm(nodes.shear_across, axis=1)), stress),
        "wrong_way_slip": (_smaller(slipped, length, astray, stress), 1.0),
        "entered": (np.where(bilateral, np.abs(entered), entered), length),
        "pressure_at_distance": (_smaller(distance, length, pressure, stress), 1.0),
        "slip_below_bound": (_smaller(slipped, length, nodes.bound - along, stress), 1.0),
        "penetration": (np.where(bilateral, np.abs(overlap), overlap), far),
        "complementarity": (np.abs(pressure * overlap), stress * far),
        "stick_slip": (np.linalg.norm(slip, axis=1)[sheared < nodes.bound - CERTIFICATE_TOLERANCE * stress], far),
    }
    return {name: _share(_largest(comm, violation), unit) for name, (violation, unit) in figures.items()}


def _smaller(a: Nodal, unit_a: float, b: Nodal, unit_b: float) -> Nodal:
    """min(|a|, max(b, 0)), each in its own unit: zero where one of two conditions holds."""
    return np.minimum(np.abs(a) / (unit_a or 1.0), np.maximum(b, 0.0) / (unit_b or 1.0))


def _largest(comm: MPI.Comm, values: Nodal) -> float:
    """The largest value over the ranks, not below zero; nan where one is nan."""
    return parallel.global_max(comm, float(np.nan_to_num(np.max(values, initial=0.0), nan=np.inf)))


def _norm(comm: MPI.Comm, values: Nodal) -> float:
    return float(np.sqrt(parallel.global_sum(comm, np.sum(values**2))))


def _share(part: float, whole: float) -> float:
    """Nothing is a share of nothing, and what is not is more than any share of it; negative parts count as nothing."""
    if part <= 0:
        return 0.0
    return float(part / whole) if whole > 0 else np.inf
