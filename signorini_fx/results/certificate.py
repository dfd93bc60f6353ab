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

from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from mpi4py import MPI

from signorini_fx import parallel
from signorini_fx.mesh.tagged import TaggedMesh
from signorini_fx.records import CERTIFICATE_TOLERANCE
from signorini_fx.results.contact_nodes import ContactNodes
from signorini_fx.results.nodal_forces import NodalForces, hooke
from signorini_fx.results.promised_law import UNREGULARISED, Before, Law, Tractions
from signorini_fx.results.supports import Supports
from signorini_fx.scales import Scales
from signorini_fx.scene.model import Scene

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
)
# The others give the regularisation error, and how far the body moves.
REPORTED = ("displacement", "penetration", "complementarity", "stick_slip")
# Forces below this share of stiffness times displacement are round-off of a stress-free motion.
_ROUND_OFF = 1e-8
# Units in the last place of the displacement that an evaluation of its nodal forces may lose.
_LOST_UNITS = 100.0
# Contact stresses below this share of the mean stress in the body cannot be distinguished from zero.
_FAINT = 1e-3


@dataclass(frozen=True, repr=False)
class Certificate:
    """How far a result is from the conditions of its problem; every figure is relative.

    Forces are relative to the largest of internal and external ones, stresses to the largest pressure or shear without
    what supports take of them, lengths to the deformation: the largest displacement without its rigid part (of
    penetration, complementarity and slip at stick nodes: to the largest displacement).

    Attributes:
        equilibrium: residual of (3.3a) in the free unknowns, of all together and of the worst contact node as a stress.
        supports: largest difference from a prescribed displacement.
        negative_pressure: largest -lambda.
        friction_cone: largest |mu| - F g.
        wrong_way_slip: slip against mu, in space also perpendicular to it, excluded by (2.3e'): the smaller of the slip
            and the part of the shear that does not point along it.
        entered: largest tau_N y - d beyond what the law allows for.
        pressure_at_distance: the complementarity (3.3b): the smaller of pressure and distance.
        slip_below_bound: the complementarity (3.3c): the smaller of the slip and the distance of the shear from its
            bound.
        displacement: largest displacement, relative to the size of the body.
        penetration: largest tau_N y - d; lambda / gamma by the regularisation.
        complementarity: largest |lambda (tau_N y - d)|.
        stick_slip: largest slip where the shear is below its bound; |mu| / gamma by the regularisation.
        law: the contact law that was used for the check.
        strain_energy: a(y, y) / 2, an energy per thickness.
        potential_energy: a(y, y) / 2 - L(y), an energy per thickness.
    """

    equilibrium: float = 0.0
    supports: float = 0.0
    negative_pressure: float = 0.0
    friction_cone: float = 0.0
    wrong_way_slip: float = 0.0
    entered: float = 0.0
    pressure_at_distance: float = 0.0
    slip_below_bound: float = 0.0
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

    Raises:
        ValueError: the tractions are not those of the contact nodes of the scene.
    """
    comm, space = tagged.mesh.comm, displacement.function_space
    forces = NodalForces(scene, tagged, space)
    dim = tagged.dimension
    every = displacement.x.array.reshape(-1, dim)
    y, x = every[: forces.owned], space.tabulate_dof_coordinates()[: forces.owned, :dim]
    internal, external = forces.internal(every), forces.external(step, scale)
    supports = Supports.of(forces, step, scale)
    energy, work = parallel.global_sum(comm, np.array([np.sum(internal * y), np.sum(external * y)]))
    strain_energy = max(0.0, float(energy) / 2)
    scales = Scales(dim, scene.young, tagged.size)
    stiffest = replace(scales, modulus=max(a + b for a, b in map(hooke, scene.material)))
    spacing = scales.spacing(space.dofmap.index_map.size_global)
    far = _largest(comm, np.linalg.norm(y, axis=1))
    # A motion without stress, or without change of volume, has forces too: round-off of the largest modulus.
    force = max(_norm(comm, internal), _norm(comm, external), _ROUND_OFF * stiffest.stiffness(spacing) * _norm(comm, y))
    length = max(_deformation(comm, x, y), _ROUND_OFF * far)
    residual = internal - external
    found: dict[str, Any] = {
        "supports": _share(_largest(comm, supports.missed(y)), length),
        "displacement": far / tagged.size,
    }
    rest: dict[str, Any] = {
        "law": law,
        "strain_energy": strain_energy,
        "potential_energy": strain_energy - float(work),
    }
    if tractions is None:
        return Certificate(equilibrium=_share(_norm(comm, supports.left(residual)), force), **found, **rest)
    nodes = ContactNodes.of(scene, forces, x, tractions)
    pressure, shear = nodes.pressure, nodes.shear
    reached, contact_forces, area = nodes.forces()
    np.add.at(residual, reached, contact_forces)
    # Where the contact transmits nothing its reactions are round-off of the stress in the body.
    inside = _FAINT * scales.stress(strain_energy)
    finest = -parallel.global_max(comm, parallel.local_max(-scales.side(nodes.weight), -np.inf))
    sheared = np.linalg.norm(shear, axis=1)
    stress = max(_largest(comm, nodes.felt(supports)), inside, _ROUND_OFF * stiffest.modulus * far / finest)
    if before is not None:  # what is added to it has its round-off
        last = ContactNodes.of(scene, forces, x, before.tractions)
        so_far = before.displacement.x.array.reshape(-1, dim)[: forces.owned]
        stress = max(stress, _ROUND_OFF * _largest(comm, last.felt(supports)))
        length = max(length, _ROUND_OFF * _deformation(comm, x, so_far))
    # If everything sticks, all motion is round-off of the displacements that the stresses could cause.
    still = _FAINT * scales.deflection(stress)
    length, far = max(length, still), max(far, still)
    residual = supports.left(residual)
    # The stress at a node is known to the digits of the displacement over the length of its side.
    lost = _LOST_UNITS * np.finfo(float).eps * stiffest.modulus * far / scales.side(area)
    unbalanced = np.maximum(np.linalg.norm(residual[reached], axis=1) / area - lost, 0.0)
    equilibrium = max(
        _share(_norm(comm, residual), force),
        _share(_largest(comm, unbalanced), stress),
    )
    u_n, u_t = nodes.traces(every)
    overlap, slip, origin = u_n - nodes.gap, u_t, np.zeros_like(shear)
    if before is not None:
        slip, origin = u_t - last.traces(before.displacement.x.array.reshape(-1, dim))[1], last.shear
        if before.elastic_slip is not None and not np.isfinite(law.gamma_t):
            elastic = replace(before.tractions, shear=before.elastic_slip)
            slip = slip + ContactNodes.of(scene, forces, x, elastic).shear
    bilateral = nodes.bilateral
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
        "friction_cone": (sheared - nodes.bound, stress),
        "wrong_way_slip": (_smaller(slipped, length, astray, stress), 1.0),
        "entered": (np.where(bilateral, np.abs(entered), entered), length),
        "pressure_at_distance": (_smaller(distance, length, pressure, stress), 1.0),
        "slip_below_bound": (_smaller(slipped, length, nodes.bound - along, stress), 1.0),
        "penetration": (np.where(bilateral, np.abs(overlap), overlap), far),
        "complementarity": (np.abs(pressure * overlap), stress * far),
        "stick_slip": (np.linalg.norm(slip, axis=1)[sheared < nodes.bound - CERTIFICATE_TOLERANCE * stress], far),
    }
    found |= {name: _share(_largest(comm, violation), unit) for name, (violation, unit) in figures.items()}
    return Certificate(equilibrium=equilibrium, **found, **rest)


def _deformation(comm: MPI.Comm, x: Nodal, y: Nodal) -> float:
    """The largest displacement after the nearest rigid motion is subtracted; collective."""
    dim = x.shape[1]
    count, *sums = parallel.global_sum(comm, np.array([len(x), *x.sum(axis=0), *y.sum(axis=0)]))
    centre, mean = np.array(sums[:dim]) / count, np.array(sums[dim:]) / count
    arm, motion = x - centre, y - mean
    turns = dim * (dim - 1) // 2
    turned = np.zeros((*x.shape, turns))
    for k, (i, j) in enumerate(combinations(range(dim), 2)):
        turned[:, i, k], turned[:, j, k] = -arm[:, j], arm[:, i]
    flat = turned.reshape(motion.size, turns)
    gram = parallel.global_sum(comm, np.column_stack((flat.T @ flat, flat.T @ motion.ravel())))
    angles = np.linalg.solve(gram[:, :-1], gram[:, -1])
    return _largest(comm, np.linalg.norm(motion - turned @ angles, axis=1))


def _smaller(a: Nodal, unit_a: float, b: Nodal, unit_b: float) -> Nodal:
    """min(|a|, max(b, 0)), each in its own unit: zero where one of two conditions holds."""
    return np.minimum(np.abs(a) / (unit_a or 1.0), np.maximum(b, 0.0) / (unit_b or 1.0))


def _largest(comm: MPI.Comm, values: Nodal) -> float:
    """The largest value over the ranks, not below zero; nan where one is nan."""
    return parallel.global_max(comm, float(np.nan_to_num(np.max(values, initial=0.0), nan=np.inf)))


def _norm(comm: MPI.Comm, values: Nodal) -> float:
    return float(np.sqrt(parallel.global_sum(comm, np.sum(values**2))))


def _share(part: float, whole: float) -> float:
    return part / whole if whole > 0 else part
