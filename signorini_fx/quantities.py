"""What is measured after a solve, the same way for every algorithm: certificate, forces, energy, zones."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from petsc4py import PETSc

from signorini_fx import parallel
from signorini_fx.boundary import ContactBoundary
from signorini_fx.complementarity import Nodal, RegularisedData, inner, project, trial_pressure
from signorini_fx.complementarity import length as length_of
from signorini_fx.discretisation import Discretisation
from signorini_fx.material import lame_parameters
from signorini_fx.problem import ROUND_OFF
from signorini_fx.results import CERTIFICATE_TOLERANCE, FAR_AWAY

# The figures that decide; the others say what the regularisation leaves.
JUDGED = (
    "equilibrium",
    "negative_pressure",
    "friction_cone",
    "wrong_way_slip",
    "entered",
    "pressure_at_distance",
    "slip_below_bound",
)
# Contact stresses below this share of the mean stress in the body are not told from zero.
_FAINT = 1e-3


@dataclass(frozen=True)
class ContactState:
    """The contact nodes of this rank after a solve, arrays of shape (n,).

    Attributes:
        boundary: nodes, weights and normals.
        gap: d, length.
        u_n: tau_N y, length; u_n - gap > 0 is penetration.
        u_t: tau_T y, length.
        pressure: lambda = -sigma_N, stress.
        shear: mu = -sigma_T, stress.
        bound: friction bound F g, stress; zero without friction.
        in_contact: True on A_c.
        direction: unit vector of the shear on A_f, zero on I_f, shape (n, d - 1); in the plane +1 on A_f,+ and
            -1 on A_f,-.
        has_friction: whether a friction law acts.
        bilateral: nodes whose contact cannot open.
        slip_length: what friction acts against, length: tau_T y, or its increment in a later load step.
        xi: its part beyond the elastic slip of the regularisation, length; zero at stick nodes.
        lambda_hat: shift of the pressure that the regularisation starts from, stress.
        mu_hat: shift of the shear, likewise.
        compliance: 1 / gamma_1 and 1 / gamma_2, length per stress; zero without regularisation.
    """

    boundary: ContactBoundary
    gap: Nodal
    u_n: Nodal
    u_t: Nodal
    pressure: Nodal
    shear: Nodal
    bound: Nodal
    in_contact: npt.NDArray[np.bool_]
    direction: Nodal
    has_friction: bool
    bilateral: npt.NDArray[np.bool_]
    slip_length: Nodal
    xi: Nodal
    lambda_hat: Nodal
    mu_hat: Nodal
    compliance: tuple[float, float]

    @cached_property
    def forces(self) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Resultants that the foundation exerts on the body: contact force, friction force, shape (2,); collective."""
        contact = -self.boundary.nodal_forces(self.pressure, np.zeros_like(self.shear)).sum(axis=0)
        friction = -self.boundary.nodal_forces(np.zeros_like(self.pressure), self.shear).sum(axis=0)
        comm = self.boundary.comm
        return parallel.global_sum(comm, contact), parallel.global_sum(comm, friction)

    @cached_property
    def friction_work(self) -> float:
        """Work that slip takes out of the body in this load step, (mu, xi) with xi of (3.3c), never negative;
        collective.

        xi is the slip without the elastic part that the regularisation adds, zero at stick nodes.
        """
        work = np.dot(self.boundary.weight, inner(self.shear, self.xi))
        return float(parallel.global_sum(self.boundary.comm, work))

    @cached_property
    def mean_tangential_displacement(self) -> float:
        """Mean of tau_T y over the contact boundary, length; collective."""
        weight = self.boundary.weight
        sums = parallel.global_sum(self.boundary.comm, np.array([np.dot(weight, self.u_t[:, 0]), weight.sum()]))
        return float(sums[0] / sums[1])

    def sliding_sign(self) -> npt.NDArray[np.int8]:
        """+1, -1 for slip along or against the tangent, 0 for stick; a node that transmits nothing moves freely."""
        sign = np.where(self.bound > 0, self.direction[:, 0], np.where(self.slip_length[:, 0] < 0, -1.0, 1.0))
        return np.sign(sign).astype(np.int8)


@dataclass(frozen=True)
class Certificate:
    """How far the result is from the conditions of the unregularised problem; every figure is relative.

    Stresses are relative to the largest pressure or shear, lengths to the largest displacement, forces to the internal
    ones.  Pressure and shear are those of the nodal reactions, recomputed from the displacement by assembling a(y, .)
    and L anew; they do not rely on what the solver says of them.

    Attributes:
        equilibrium: residual of (3.3a), reactions against multipliers included.
        penetration: largest tau_N y - d; lambda / gamma by the regularisation, no error of the iteration.
        negative_pressure: largest -lambda.
        complementarity: largest |lambda (tau_N y - d)|.
        friction_cone: largest |mu| - F g.
        wrong_way_slip: largest -mu xi: slip against mu, which (2.3e') excludes.
        entered: largest tau_N y - d beyond the lambda / gamma_1 of the regularisation.
        pressure_at_distance: lambda where there is a distance, after the same allowance; the complementarity (3.3b).
        slip_below_bound: slip xi where |mu| < F g; the complementarity (3.3c).
        stick_slip: largest |tau_T y| at stick nodes; |mu| / gamma by the regularisation.
        displacement: largest displacement, relative to the size of the body.
    """

    equilibrium: float
    penetration: float
    negative_pressure: float
    complementarity: float
    friction_cone: float
    wrong_way_slip: float
    entered: float
    pressure_at_distance: float
    slip_below_bound: float
    stick_slip: float
    displacement: float

    @property
    def worst(self) -> float:
        """The largest of the figures that are judged; what the regularisation leaves is not among them."""
        return float(np.max([getattr(self, name) for name in JUDGED]))

    @property
    def holds(self) -> bool:
        """Whether the iteration did what it promises; what the regularisation leaves is not its fault."""
        return self.worst <= CERTIFICATE_TOLERANCE and self.displacement <= FAR_AWAY

    def as_dict(self) -> dict[str, float | bool]:
        """All figures and the verdict."""
        return {**asdict(self), "holds": self.holds}


@dataclass(frozen=True)
class Forces:
    """Nodal forces of a solution, assembled anew from its displacement.

    Attributes:
        displacement: y.
        internal: a(y, .), prescribed dofs included.
        external: L of the load step.
    """

    displacement: fem.Function
    internal: PETSc.Vec
    external: PETSc.Vec

    @classmethod
    def of(cls, discretisation: Discretisation, displacement: fem.Function, step: int) -> Forces:
        """Assemble both; collective."""
        return cls(displacement, discretisation.internal_forces(displacement), discretisation.external_forces(step))

    @cached_property
    def strain_energy(self) -> float:
        """a(y, y) / 2, an energy per thickness; collective."""
        return max(0.0, 0.5 * float(self.internal.dot(self.displacement.x.petsc_vec)))

    @cached_property
    def potential_energy(self) -> float:
        """a(y, y) / 2 - L(y), an energy per thickness; collective."""
        return self.strain_energy - float(self.external.dot(self.displacement.x.petsc_vec))


def certify(
    discretisation: Discretisation, displacement: fem.Function, forces: Forces, contact: ContactState | None
) -> Certificate:
    """Check the conditions of a load step independently of how the solution was found; collective."""
    comm = discretisation.tagged.mesh.comm
    reaction = forces.internal.copy()
    # A stress-free motion has forces too, and one without change of volume: round-off of the largest modulus.
    young = discretisation.scene.young
    modulus = max(first + 2 * second for first, second in map(lame_parameters, discretisation.scene.material))
    scale = max(reaction.norm(), forces.external.norm(), ROUND_OFF * modulus * displacement.x.petsc_vec.norm())
    reaction.axpy(-1.0, forces.external)
    length = float(displacement.x.petsc_vec.norm(PETSc.NormType.NORM_INFINITY))
    owned = reaction.getArray()
    if contact is None:
        residual = _norm(comm, owned[~discretisation.fixed])
        nothing = {field.name: 0.0 for field in fields(Certificate)}
        found = {"equilibrium": _share(residual, scale), "displacement": length / discretisation.tagged.size}
        return Certificate(**nothing | found)
    boundary = contact.boundary
    nodal = owned.reshape(-1, 2)
    # The reactions become pressures only where no support takes a part of them and no second boundary shares the node.
    _, inverse, counts = np.unique(boundary.nodes, return_inverse=True, return_counts=True)
    alone = (counts[inverse.ravel()] == 1) & boundary.free.all(axis=1)
    nodal_reaction = -nodal[boundary.nodes] / boundary.weight[:, None]
    normal, tangential = boundary.traces(nodal_reaction)
    pressure = np.where(alone, normal, contact.pressure)
    shear = np.where(alone[:, None], tangential, contact.shear)
    np.add.at(nodal, boundary.nodes, boundary.nodal_forces(contact.pressure, contact.shear))
    residual = _norm(comm, owned[~discretisation.fixed])
    stress = parallel.global_max(comm, parallel.local_max(np.maximum(np.abs(pressure), length_of(shear))))
    # Where the contact transmits nothing its reactions are round-off of the stress in the body.
    inside = np.sqrt(2 * young * forces.strain_energy) / discretisation.tagged.size
    finest = -parallel.global_max(comm, parallel.local_max(-boundary.weight, -np.inf))
    stress = max(stress, _FAINT * inside, ROUND_OFF * modulus * length / finest)
    # Where everything sticks, nothing moves but for round-off of what the stresses could move.
    far = length / discretisation.tagged.size
    length = max(length, _FAINT * stress / young * discretisation.tagged.size)
    overlap = contact.u_n - contact.gap
    # What the regularisation allows for is a layer as compliant as 1 / gamma; where a component is prescribed, nothing.
    entered = overlap - contact.compliance[0] * (pressure - contact.lambda_hat)
    xi = contact.slip_length - contact.compliance[1] * (shear - contact.mu_hat)
    entered = np.where(boundary.prescribed(boundary.normal), 0.0, entered)
    prescribed = np.column_stack([boundary.prescribed(t) for t in np.moveaxis(boundary.tangents, 2, 0)])
    xi = np.where(prescribed | (not contact.has_friction), 0.0, xi)
    overlap, entered = (np.where(contact.bilateral, np.abs(values), values) for values in (overlap, entered))
    # A distance, or a bound, may be beyond all measure: it counts as much as what it is compared with.
    distance = np.where(contact.bilateral, 0.0, np.minimum(np.maximum(-entered, 0.0), length))
    below = np.clip(contact.bound - length_of(shear), 0.0, stress)
    sticking = ~(length_of(contact.direction) > 0)
    figures = {
        "penetration": (overlap, length),
        "negative_pressure": (-pressure[~contact.bilateral], stress),
        "complementarity": (np.abs(pressure * overlap), stress * length),
        "friction_cone": (length_of(shear) - contact.bound, stress),
        "wrong_way_slip": (-inner(shear, xi), stress * length),
        "entered": (entered, length),
        "pressure_at_distance": (np.maximum(pressure, 0.0) * distance, stress * length),
        "slip_below_bound": (below * length_of(xi), stress * length),
        "stick_slip": (length_of(contact.slip_length)[sticking & contact.has_friction], length),
    }
    values = {
        name: _share(parallel.global_max(comm, max(0.0, parallel.local_max(violation))), unit)
        for name, (violation, unit) in figures.items()
    }
    return Certificate(equilibrium=_share(residual, scale), **values, displacement=far)


def _norm(comm: Any, values: npt.NDArray[np.float64]) -> float:
    return float(np.sqrt(parallel.global_sum(comm, np.dot(values, values))))


def _share(part: float, whole: float) -> float:
    return part / whole if whole > 0 else part


@dataclass(frozen=True)
class Functionals:
    """Primal and dual functional of the regularised problem with given friction, energies per thickness.

    Their difference is never negative for feasible lambda and mu, and zero where (3.3b) and (3.3c) hold; together with
    equilibrium (3.3a) it is a certificate of optimality.

    Attributes:
        primal: J_gamma(y) of section 3.
        dual: -J*_gamma(lambda, mu) of section 3, written for prescribed displacements that need not vanish.
    """

    primal: float
    dual: float

    @property
    def relative_gap(self) -> float:
        """(primal - dual) / |primal|."""
        return (self.primal - self.dual) / abs(self.primal) if self.primal != 0 else self.primal - self.dual


def functionals(forces: Forces, contact: ContactState, data: RegularisedData) -> Functionals:
    """Evaluate J_gamma (section 3) and its dual at a solution; collective.

    The elastic part of the dual, min over y of a(y, y) / 2 - L(y) + (lambda, tau_N y) + (mu, tau_T y), is taken at the
    displacement at hand, which is its minimiser as far as (3.3a) holds.
    """
    elastic = forces.potential_energy
    c, w = contact, contact.boundary.weight
    pressure, shear = project(c.pressure, c.shear, data)
    bound = data.friction_bound(pressure)
    overlap, slip = c.u_n - c.gap, c.slip_length
    if np.isinf(data.gamma_n):  # the unregularised J of (P) and its dual (2.7)
        primal, dual = bound * length_of(slip), pressure * overlap + inner(shear, slip)
    else:
        trial = trial_pressure(c.u_n, data)
        pushing = np.where(c.bilateral, trial, np.maximum(0.0, trial))
        primal = pushing**2 / (2 * data.gamma_n) + _smoothed_friction(slip, data, bound)
        dual = (
            pressure * overlap
            + (data.lambda_hat**2 - (pressure - data.lambda_hat) ** 2) / (2 * data.gamma_n)
            + inner(shear, slip)
            + (inner(data.mu_hat, data.mu_hat) - inner(shear - data.mu_hat, shear - data.mu_hat)) / (2 * data.gamma_t)
        )
    sums = parallel.global_sum(
        contact.boundary.comm,
        np.array([np.dot(w, primal), np.dot(w, dual)]),
    )
    return Functionals(elastic + float(sums[0]), elastic + float(sums[1]))


def _smoothed_friction(slip: Nodal, data: RegularisedData, bound: Nodal) -> Nodal:
    """F g h(tau_T y, mu_hat) / gamma_2 of (3.2)."""
    trial = length_of(data.gamma_t * slip + data.mu_hat)
    sliding = bound * (trial - bound / 2)
    return np.where(trial >= bound, sliding, trial**2 / 2) / data.gamma_t
