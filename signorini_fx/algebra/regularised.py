"""The regularised contact problem (3.3) as SNES callbacks: residual, and active-set Jacobian A +
B^T D B.

The contact pressure (3.3b) is in ``algebra.contact.complementarity``, friction (3.3c) in
``algebra.contact.active_sets``.  A problem is independent of the kind of its elastic system and of
the algorithm that evaluates its residual.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

# First: PETSc and dolfinx from PyPI find the library of MPI where it is loaded.
import mpi4py.MPI  # noqa: F401
import numpy as np
from petsc4py import PETSc

from signorini_fx.algebra.contact.active_sets import (
    ActiveSets,
    classify,
    hold,
    holds,
    law_residual,
    multipliers,
    release,
    tangent,
)
from signorini_fx.algebra.contact.complementarity import RegularisedData, slip_of, trial_pressure
from signorini_fx.algebra.contact.contact_map import ContactMap
from signorini_fx.algebra.contact.friction import as_given
from signorini_fx.algebra.contact.motions import FreeMotions
from signorini_fx.algebra.contact.points import ContactPoints
from signorini_fx.algebra.contact.statics import Escape, no_balance
from signorini_fx.algebra.linalg import SAME_PATTERN, SUBSET_PATTERN, ElasticSystem, is_by_blocks
from signorini_fx.algebra.linalg.petsc_calls import called_back
from signorini_fx.arrays import Array, inner, length, quotient
from signorini_fx.machine import parallel
from signorini_fx.records import Status
from signorini_fx.tuned import ATTAINABLE_SHARE, NO_FORCE


@dataclass(frozen=True)
class NextSets:
    """The active sets of the next linear solve.

    Attributes:
        sets: the active sets.
        trial: the sets that follow from the iterate.
        repaired: whether ``sets`` differ from ``trial``, because these would not hold the body.
        escapes: the status if the body moves away whatever the sets are; else None.
    """

    sets: ActiveSets
    trial: ActiveSets
    repaired: bool = False
    escapes: Status | None = None


class ContactTangent:
    """The Jacobians A + B^T D B of one problem.

    A is stored by blocks, or with a pattern that contains that of B^T D B
    (``ContactMap.admitted``), so that only the entries to which contact adds are set.

    Attributes:
        inserted: the blocks D in each Jacobian, by its handle.
        factorised: the blocks D at its last factorisation, by its handle.
    """

    def __init__(self, matrix: PETSc.Mat, contact: ContactMap) -> None:
        self._matrix = matrix
        self._contact = contact
        self.inserted: dict[int, Array] = {}
        self.factorised: dict[int, Array] = {}

    def create(self) -> PETSc.Mat:
        """Return a matrix to insert blocks into, at first equal to A; collective."""
        if not is_by_blocks(self._matrix):
            return self._matrix.duplicate(copy=True)
        from signorini_fx.algebra.linalg.blocks import with_added

        added = self._contact.products[-1].copy()
        added.zeroEntries()
        return with_added(self._matrix, added)

    def insert(self, matrix: PETSc.Mat, blocks: Array) -> bool:
        """Set a matrix to A + B^T D B, if it is not yet, and return whether it is that of the last
        factorisation; collective.

        Args:
            matrix: from ``create``, or a copy of A.
            blocks: D, stress per length, shape (n, d, d).
        """
        points = self._contact.points
        earlier_blocks = [table.get(matrix.handle) for table in (self.inserted, self.factorised)]
        differ = [old is None or bool((old != blocks).any()) for old in earlier_blocks]
        changed, since = [
            int(count)
            for count in parallel.global_sum(points.comm, np.array(differ, dtype=np.int64))
        ]
        if changed > 0:
            self.inserted[matrix.handle] = blocks
            operator, law, half, product = self._contact.products
            self._contact.law(points.weight[:, None, None] * blocks, law).matMult(
                operator, result=half
            )
            operator.transposeMatMult(half, result=product)
            if is_by_blocks(matrix):
                from signorini_fx.algebra.linalg.blocks import change_added

                change_added(matrix, product)
            else:
                self._matrix.copy(matrix, SAME_PATTERN)
                matrix.axpy(1.0, product, structure=SUBSET_PATTERN)
        return since == 0


class RegularisedProblem:
    """R(x) = A x - b + (lambda, tau_N .) + (mu, tau_T .) with lambda and mu of the current active
    sets (3.3a).

    For fixed sets R is affine, so that a full Newton step solves step 4 of Algorithm (SSN) exactly.

    ``sets`` are those of the last linear solve.  Evaluating the residual finds the next ones
    (``next``) without changing ``sets``, so that SNES may evaluate it any number of times;
    assembling the Jacobian makes the next sets current.

    Attributes:
        system: the elastic system.
        points: the contact points.
        tangent: inserts tangents of contact into Jacobians.
        groups: groups of contact points that are judged together.
        springs: springs at all contact points in addition to contact: stiffness, stress per length,
            and the relative displacement (tau_N y, tau_T y) at which they are free of stress,
            length, shape (n, d); None: there are none.
        data: the data that outer algorithms change.
        affine: whether the residual is affine for fixed sets and directions, so that repeated sets
            mean a solution, and sets that come back mean a cycle.  It is not in 3D with friction,
            where the direction of slip changes, nor where a friction bound is a nonlinear function
            of pressure or slip.
        sets: active sets of the last linear solve.
        next: active sets of the last residual.
        force_scale: size of the forces on the unknowns that are not prescribed, in the last
            residual.
        unchanged: whether the blocks in the Jacobian are those of its last factorisation.
    """

    def __init__(self, system: ElasticSystem, motions: FreeMotions) -> None:
        self.system = system
        self.points: ContactPoints = system.contact.points
        self.tangent = ContactTangent(system.matrix, system.contact)
        self.groups = motions.groups
        self.springs: tuple[float, Array] | None = None
        self.data: RegularisedData
        self.sets = ActiveSets.all_in_contact(self.points.size, self.points.dimension - 1)
        self.next = NextSets(self.sets, self.sets)
        self.force_scale = 0.0
        self.unchanged = False
        self._motions = motions
        self._forced_first = False
        self._definite: set[int] = set()
        self._stiffness = parallel.largest(
            system.comm, system.matrix.getDiagonal().getArray(readonly=True)
        )

    def set_data(self, data: RegularisedData, first_sets: ActiveSets | None = None) -> None:
        """Start a new problem.

        Args:
            data: its data.
            first_sets: active sets of the first linear solve; None: from the iterate and the sets
                of the previous problem.
        """
        self.data = data
        curved = data.follows is not None and not data.follows.affine
        self.affine = (self.points.dimension == 2 or data.bound is None) and not curved
        moved = self.system.start.copy()
        moved.getArray()[self.system.contact.fixed] = 0.0
        self._lifted = None if moved.norm() == 0.0 else self.system.matrix * moved
        self._load_size = self._acting(self.system.load)
        self._escaping: tuple[Escape | None] | None = None
        self._forced_first = first_sets is not None
        if (
            data.bound is not None
        ):  # sets of the previous problem may slip where this bound is infinite
            self.sets = self.sets.sticking(np.isinf(data.bound))
        if first_sets is not None:
            first = release(first_sets, data)
            self.next = NextSets(first, first)

    def multipliers(self, x: PETSc.Vec, sets: ActiveSets) -> tuple[Array, Array]:
        """Return (lambda, mu) at the contact points for given sets."""
        traces = self.system.contact.traces(x)
        return multipliers(sets, *traces, self.data.at(traces))

    def friction_bounds(self, x: PETSc.Vec) -> tuple[Array, Array]:
        """Return the friction bounds of the current and the next sets."""
        u_n, u_t = self.system.contact.traces(x)
        trial = trial_pressure(u_n, self.data)
        present = self.data.friction_bound(np.where(self.sets.contact, trial, 0.0), u_t)
        return present, self.data.friction_bound(trial, u_t)

    @called_back
    def residual(self, snes: PETSc.SNES | None, x: PETSc.Vec, f: PETSc.Vec) -> None:
        """Evaluate the residual at x into f with the active sets that follow from x."""
        u_n, u_t = self.system.contact.traces(x)
        self.data = self.data.at((u_n, u_t))
        trial = self.next.trial if self._forced_first else classify(self.sets, u_n, u_t, self.data)
        if self.data.follows is not None:
            pressure = trial_pressure(u_n, self.data)
            slip = slip_of(u_t, self.data)
            where = pressure, self.data.bilateral, length(slip), inner(trial.direction, slip)
            changing = self.data.follows.follows_slip and parallel.any_rank(
                self.points.comm, trial.changed(self.sets)
            )
            trial = replace(trial, line=self.data.follows.line(*where, careful=changing))
        self._hold(trial, u_t, lambda: multipliers(self.sets, u_n, u_t, self.data))
        self.imbalance(x, *multipliers(self.next.sets, u_n, u_t, self.data), f)

    def imbalance(self, x: PETSc.Vec, pressure: Array, shear: Array, f: PETSc.Vec) -> None:
        """Evaluate R(x) into f for given (lambda, mu); collective."""
        if self.springs is not None or self.data.bond is not None:
            traces = self.system.contact.traces(x)
            pulled = np.zeros(self.points.movable.shape[:2])
            if self.springs is not None:
                stiffness, position = self.springs
                pulled += stiffness * (np.column_stack(traces) - position)
            if self.data.bond is not None:
                pulled += self.data.bond.tractions(traces)
            pressure = pressure + pulled[:, 0]
            shear = shear + pulled[:, 1:]
        self.system.matrix.mult(x, f)
        # The forces are the scale of the residual.  Prescribed rows are left out, as their entries
        # are no forces, and so are the forces due to prescribed values.
        acting = [self._acting(f), self._load_size, ATTAINABLE_SHARE * self._stiffness * x.norm()]
        if self.system.contact.paired:
            area = float(
                np.sqrt(parallel.global_sum(self.points.comm, np.sum(self.points.weight**2)))
            )
            acting.append(area * self._least_traction(x))
        self.force_scale = max(acting)
        f.axpy(-1.0, self.system.load)
        self.system.contact.add_forces(pressure, shear, f)

    def assemble_jacobian(self, jacobian: PETSc.Mat) -> None:
        """Assemble the Jacobian with the sets of the last residual, which become the
        current ones.
        """
        self.sets = self.next.sets
        self._forced_first = False
        # PETSc keeps its factor as long as the matrix is not changed.
        self.insert(jacobian, tangent(self.sets, self.data))

    def insert(self, jacobian: PETSc.Mat, blocks: Array) -> None:
        """Set a Jacobian to A + B^T D B; D has shape (n, d, d), stress per length.  Collective."""
        if self.springs is not None:
            blocks = blocks + self.springs[0] * np.eye(blocks.shape[1])
        self.unchanged = self.tangent.insert(jacobian, blocks)
        if jacobian.handle in self._definite:
            # PETSc forgets it at every assembly, and LAPACK's Cholesky is three times as fast as
            # its LDL^T.
            jacobian.setOption(PETSc.Mat.Option.SPD, True)

    def factorised(self, jacobian: PETSc.Mat) -> None:
        """Record that the current Jacobian is factorised."""
        self.tangent.factorised[jacobian.handle] = self.tangent.inserted[jacobian.handle]

    def law_residual(self, x: PETSc.Vec) -> float:
        """Return the largest distance of mu from the projection (3.4), relative to the largest
        bound or shear that acts on the body in its group of points; collective.
        """
        bound, _ = self.friction_bounds(x)
        pressure, shear = self.multipliers(x, self.sets)
        alone = self.points.felt(shear)
        felt = self.points.felt(shear, pressure)
        felt_ratio = quotient(felt, alone, otherwise=1.0)
        # Friction due to the pressure of nodes that supports press into the foundation is no scale
        # for other nodes, nor are pressures and shears that cancel each other.
        felt = np.maximum(
            felt_ratio * self.points.felt(np.where(np.isfinite(bound), bound, 0.0)), felt
        )
        distance = law_residual(self.sets, *self.system.contact.traces(x), self.data)
        away, size = map(self.groups.largest, (distance, felt))
        size = self.scales(size, x)
        if self.system.contact.paired:
            size = np.maximum(size, self._least_traction(x))
        return float(quotient(away, size, otherwise=away).max())

    def scales(self, sizes: Array, x: PETSc.Vec) -> Array:
        """Return the scales of tractions in each group, stress, shape (groups,), see
        ``PointGroups.scales``; collective.

        With several groups they are no less than the tractions that the penalty makes of round-off
        of displacements.
        """
        scales = self.groups.scales(sizes)
        if self.groups.count == 1:
            return scales
        floors = self.groups.largest(self.round_off(x))
        # If no group carries more than that, nothing is pressed, and only changes distinguish
        # round-off from convergence.
        return np.maximum(scales, floors) if np.any(scales > floors) or self.bonds_alone else scales

    @property
    def bonds_alone(self) -> bool:
        """Whether only points that cannot open are in contact, and these hold all bodies;
        collective.
        """
        opens = self.sets.contact & ~self.data.bilateral
        return not parallel.any_rank(self.points.comm, opens) and self.holds(self.sets, self.data)

    def round_off(self, x: PETSc.Vec) -> Array:
        """Return the tractions that the penalty makes of round-off of displacements, stress, shape
        (n,); collective.
        """
        unsigned = x.copy()
        unsigned.abs()
        terms = length(np.column_stack(self._unsigned.traces(unsigned)))
        return NO_FORCE * max(self.data.gamma_n, self.data.gamma_t) * terms

    def least_share(self, x: PETSc.Vec) -> float:
        """Return the tractions of the group with the smallest ones relative to the largest;
        collective.
        """
        if self.groups.count == 1:
            return 1.0
        pressure, shear = self.multipliers(x, self.sets)
        sizes = self.groups.scales(self.groups.norms(np.column_stack((pressure, shear))))
        return float(sizes.min() / sizes.max()) if sizes.max() > 0 else 1.0

    @cached_property
    def _unsigned(self) -> ContactMap:
        """|B|, which gives the magnitudes of the terms in the sums of relative displacements."""
        operator = self.system.contact.operator.copy()
        starts, columns, values = operator.getValuesCSR()
        operator.setValuesCSR(starts, columns, np.abs(values))
        operator.assemble()
        return replace(self.system.contact, operator=operator)

    def accept(self, x: PETSc.Vec, sets: ActiveSets, tolerance: float) -> bool:
        """Accept sets as those of the solution if the residual is at most ``tolerance`` times the
        forces; return whether they are accepted.  Collective.
        """
        force = x.duplicate()
        self.imbalance(x, *self.multipliers(x, sets), force)
        if not force.norm() <= tolerance * self.force_scale:
            return False
        self.sets = sets
        self.next = NextSets(sets, sets)
        return True

    def holds(self, sets: ActiveSets, data: RegularisedData) -> bool:
        """Return whether these sets resist every rigid motion; collective."""
        return holds(sets, data, self._motions)

    def lost_to_round_off(self, x: PETSc.Vec, tolerance: float) -> bool:
        """Return whether round-off of the penalty exceeds ``tolerance`` times the forces in the
        last residual; collective.
        """
        data = self.data
        u_n, u_t = self.system.contact.traces(x)
        far = (
            2 * x.norm(PETSc.NormType.NORM_INFINITY) if self.system.contact.paired else np.abs(u_n)
        )
        pressed = self.sets.contact | self.next.sets.contact
        stretch = np.where(pressed, data.gamma_n * np.maximum(far, np.abs(data.gap)), 0.0)
        if data.bound is not None:
            stretch = np.maximum(stretch, data.gamma_t * length(u_t))
        largest = parallel.largest(self.points.comm, self.points.weight * stretch)
        return bool(largest * np.finfo(float).eps > tolerance * self.force_scale)

    def create_jacobian(self, *, symmetric: bool) -> PETSc.Mat:
        """Return a matrix for the Jacobian, at first equal to A; collective."""
        jacobian = self.tangent.create()
        if symmetric and self.system.definite:
            self._definite.add(jacobian.handle)
        return jacobian

    def _hold(
        self, trial: ActiveSets, u_t: Array, multipliers: Callable[[], tuple[Array, Array]]
    ) -> None:
        """Set the next sets to sets that hold the body, or record that it moves away; arguments as
        in ``hold``.
        """
        points = self.points
        motions = self._motions
        resultant = self.system.resultant

        def escaping() -> Status | None:
            if self._escaping is None:  # kept until the data change
                data = self.data
                law = data.follows or as_given(
                    np.zeros(points.size) if data.bound is None else data.bound
                )
                # The gaps are those of the body only without a load, as strains would change them.
                at_rest = self.system.load.norm() == 0.0 and self.system.start.norm() == 0.0
                gap = data.gap if at_rest else None
                self._escaping = (no_balance(law, data.bilateral, motions, resultant, gap),)
            (verdict,) = self._escaping
            return None if verdict is None else verdict.status

        iterate = self.sets, u_t, multipliers
        if self.data.broken is not None and motions.held_by(*2 * (self.data.broken < 1.0,)):
            self.next = NextSets(trial, trial)
            return
        sets, escapes, repaired = hold(trial, *iterate, self.data, motions, escaping)
        self.next = NextSets(sets, trial, repaired, escapes)

    def _acting(self, forces: PETSc.Vec) -> float:
        """Return the size of forces without those in prescribed rows and those due to prescribed
        values; collective.
        """
        free = forces.copy()
        if self._lifted is not None:
            free.axpy(-1.0, self._lifted)
        free.getArray()[self.system.contact.fixed] = 0.0
        return float(free.norm())

    def _least_traction(self, x: PETSc.Vec) -> float:
        """Return the traction that the penalty makes of a negligible share of the largest
        displacement of two bodies, stress.
        """
        # Prescribed displacements are left out: the long path of a driven rigid body is no scale
        # for friction.
        free = x.copy()
        free.getArray()[self.system.contact.fixed] = 0.0
        gamma = max(self.data.gamma_n, self.data.gamma_t)
        far = free.norm(PETSc.NormType.NORM_INFINITY)
        return float(2 * ATTAINABLE_SHARE * gamma * far)
