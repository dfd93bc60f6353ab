"""The contact problem of one iteration of Newton's method, for the whole displacement y.

    a(y, z) = a(u, z) - F(u; z),    a = F'(u) - lambda Hess phi + the terms of turning shear,

with the gaps and normals of the shapes at X + u.  The right-hand side is assembled from the
compiled a and F separately: the form a(u, .) - F(u; .) would get its own quadrature degree, and
Newton's method a residual with that degree.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial, reduce
from operator import or_
from typing import TYPE_CHECKING, Any

import numpy as np
from dolfinx import fem

from signorini_fx.algebra.algorithms.strategy import solve_task
from signorini_fx.algebra.algorithms.task import Outcome, Start, Task
from signorini_fx.algebra.contact.active_sets import ActiveSets
from signorini_fx.algebra.linalg import ElasticSystem, LoadCase
from signorini_fx.algebra.linalg.condensed import CondensedSystem
from signorini_fx.arrays import Array, Flags, Indices
from signorini_fx.errors import FormError
from signorini_fx.forms.elasticity import (
    NOT_POSITIVE,
    NOT_SYMMETRIC,
    MatrixError,
    elastic_body,
    natural_modulus,
)
from signorini_fx.forms.given_forms import Density, PetscOptions, SettingValue, given_forms
from signorini_fx.forms.nonlinear.moving_shapes import (
    MovingRigidBodies,
    MovingShape,
    curvature_of,
    fitting,
    hessians_at,
    left_by_turning,
    turned_slips,
)
from signorini_fx.forms.nonlinear.residual import Residual, Tangents, round_off
from signorini_fx.forms.solver import (
    BodyOfForms,
    case_of,
    options_applied,
    with_modulus,
)
from signorini_fx.machine import compat, parallel
from signorini_fx.machine.petsc_objects import free_unused
from signorini_fx.mechanics.assembly.averages import averaging
from signorini_fx.mechanics.assembly.mesh_entities import node_positions
from signorini_fx.mechanics.assembly.nodal_stiffness import JointStiffness, NodalStiffness
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.obstacles.corner_points import BoundaryLine, CornerFeet
from signorini_fx.mechanics.obstacles.foundations_on_points import FoundationData, Foundations
from signorini_fx.mechanics.obstacles.paired_points import FacingSides, MovingPair, PairedSides
from signorini_fx.mechanics.rigid.rigid_bodies import Drive, Driven, RigidBodies
from signorini_fx.mechanics.shapes.analytic import Plane
from signorini_fx.mechanics.state import ContactValues, State
from signorini_fx.mechanics.statement.rigid_body import COMPONENTS, RigidBody
from signorini_fx.mechanics.statement.rigid_shape import Distance, Placement, Shape, corners_of
from signorini_fx.mechanics.step_effect import StepEffect
from signorini_fx.records import History, Status
from signorini_fx.results.certificate.contact_nodes import PreviousStep
from signorini_fx.results.solution import ConvergenceError
from signorini_fx.solving.frames import (
    Posed,
    components,
    in_frames,
    rotations,
    start_of,
    state_of,
    vectors_of,
)
from signorini_fx.solving.step import with_contact
from signorini_fx.tuned import NO_FORCE, RETAINED_REACH, UNITS_OF_NO_LOAD

if TYPE_CHECKING:
    from signorini_fx.mechanics.interfaces import Facets, Foundation, Pair

# Statuses of a contact problem whose active sets were not found.
_WITHOUT_SETS = (Status.CYCLING, Status.MAX_ITERATIONS, Status.OUTER_MAX_ITERATIONS)


class MovingFoundations(Foundations):
    """Foundations whose shapes and pairs are evaluated at points displaced by ``at``."""

    sliding: Mapping[int, MovingPair]  # sliding pairs, by contact number
    coordinates: Array  # present coordinates of rigid bodies, see ``MovingRigidBodies``

    def __init__(self, *args: Any, at: fem.Function) -> None:
        self.at = at
        self.sliding = {}
        # Pairs that keep their partners, by contact number, with the bytes of the data that they
        # depend on.
        self.undeformed = dict[int, tuple[list[bytes], PairedSides]]()
        super().__init__(*args)
        self.coordinates = np.zeros(super().rigid_bodies.fixed.size)

    def _shaped(self) -> dict[int, Any]:
        x = node_positions(self._space)[:, : self._dimension].astype(np.float64)
        moving = dict[int, Any]()
        averages = averaging(self._space)
        for number, distance in super()._shaped().items():
            if averages and not isinstance(distance.shape, Plane):
                reason = (
                    "on quadratic tetrahedra a shape must be a plane: take hexahedra, or degree 1"
                )
                raise FormError.at(f"contact[{number}].shape", reason)
            turns = self._contact[number].measure is None and not averages
            shape = fitting(number, distance.shape, self._dimension, turns=turns)
            nodes = self._values[number].nodes
            moving[number] = MovingShape(shape, nodes, x[nodes], self.at, turns)
        return moving

    @property
    def moving(self) -> dict[int, MovingShape]:
        """The shapes, by contact number."""
        return self._distances  # type: ignore[return-value]

    def _put(self, number: int, distance: Distance) -> None:
        moving = self.moving[number]
        assert isinstance(distance.shape, Shape)
        if distance.shape.driven is not moving.shape.driven:
            raise FormError.at(
                f"contact[{number}].shape", "forces move it, or they do not: that cannot change"
            )
        moving.shape = fitting(number, distance.shape, self._dimension, turns=moving.turns)

    @property
    def driven(self) -> list[Shape | None]:
        """The shape of each contact, as the user has given it, that forces move; None or False:
        forces do not move it.
        """
        return [
            shape and self.moving[number].as_given for number, shape in enumerate(super().driven)
        ]

    @property
    def rigid_bodies(self) -> MovingRigidBodies:
        given = super().rigid_bodies
        return MovingRigidBodies(
            given.bodies, given.kinematics, given.length, self.at, self.coordinates
        )

    def check_driven(self) -> None:
        """Refuse driven shapes that the base class refuses, and those whose given rotation has
        another axis than the rotation by forces.
        """
        super().check_driven()
        for body in self.rigid_bodies.bodies:
            rotations = map(body.motion.prescribes, COMPONENTS[self._dimension][self._dimension :])
            turn = np.array([1.0 if value is None else value for value in rotations])
            for part in body.parts:
                if reason := self.moving[part].turned_otherwise(turn):
                    raise FormError.at(f"contact[{part}].shape.rotation", reason)

    def carry_to(self, coordinates: Array) -> None:
        """Move the shapes of rigid bodies to their coordinates, shape (k,)."""
        self.coordinates = coordinates
        for motion in self.rigid_bodies.motions:
            for part in motion.body.parts:
                self.moving[part].carry_to(motion)

    def drive(self, bodies: Sequence[RigidBody]) -> None:
        """Set force, moment and spring of the shapes of these rigid bodies."""
        for body in bodies:
            driving = {key: getattr(body.motion, key) for key in ("force", "moment", "spring")}
            for moving in (self.moving[part] for part in body.parts):
                if moving.shape.drives:
                    moving.shape = moving.shape.model_copy(update=driving)

    def motion_at(self, boundary: ContactBoundary, begun: State) -> Array | None:
        """Return the displacement of foundations at the contact points since a state, length, shape
        (n, d); None: no foundation has moved.
        """
        moved = self.moved_shapes(begun.placed)
        places = begun.displacement.reshape(-1, self._dimension)
        if not moved:
            return None
        motion = np.zeros_like(boundary.x)
        for number, (shape, earlier) in moved.items():
            points = np.flatnonzero(boundary.part == number)
            # The material points of the shape at the nodes, not its closest points: a node may
            # penetrate by the penalty, or keep an added gap.
            at = boundary.x[points] + places[boundary.nodes[points]]
            motion[points] = shape.moved_points(earlier.moved_back(at)) - at
            if (corners := boundary.corners) is not None:  # corner points move with the shape
                points = points[~boundary.at_nodes[points]]
                now = corners.place[points]
                motion[points] = now - earlier.moved_points(shape.moved_back(now))
        return motion

    def spin_at(
        self, boundary: ContactBoundary, placed: Sequence[Placement | None]
    ) -> Array | None:
        """Return the rotation of the obstacle at each contact point since its shape was at
        ``placed``, as matrices of shape (n, d, d).

        For a sliding pair it is the rotation of its frames in the step.  None if there are neither
        shapes nor sliding pairs.
        """
        moved = self.moved_shapes(placed)
        dim = self._dimension
        turned = dict.fromkeys(self.moving, np.eye(dim))
        turned |= {
            k: shape.turn_matrix(dim) @ earlier.turn_matrix(dim).T
            for k, (shape, earlier) in moved.items()
        }
        turned |= {k: pair.rotation for k, pair in self.sliding.items()}
        if not turned:
            return None
        rotation = np.tile(np.eye(dim), (boundary.size, 1, 1))
        for number, turn in turned.items():
            rotation[boundary.part == number] = turn
        return rotation

    def measured(self, shape: Any) -> bool:
        """Return whether forces may move a shape where the contact has a measure: only along the
        axis of a body of revolution, as forces around it cancel.
        """
        return bool(shape.prescribes("x") == 0.0)

    def _paired(self, number: int, *known: Any) -> ContactBoundary:
        """Return the contact points of a pair: of sides at their displaced positions if they slide,
        otherwise with the partners of the undeformed sides and present normals.
        """
        if number in self.sliding:
            return self.sliding[number].boundary()
        facts = [values.tobytes() for values in known if isinstance(values, np.ndarray)]
        last = self.undeformed.get(number)
        if parallel.any_rank(self._space.mesh.comm, last is None or facts != last[0]):
            super()._paired(number, *known)
            last = self.undeformed[number] = facts, self._pairs[number]
        assert last is not None
        paired = last[1]
        owned = self._space.dofmap.index_map.size_local
        if not self._contact[number].bonded:
            paired = paired.deformed(self.at.x.array.reshape(-1, self._dimension)[:owned])
        self._pairs[number] = paired
        return paired.boundary()

    def alone(self, boundary: ContactBoundary) -> Flags:
        alone = super().alone(boundary)
        for number, pair in self.sliding.items():
            alone[boundary.part == number] = pair.alone
        return alone

    @property
    def displacement(self) -> Array:
        """Displacement of the nodes onto which corners are projected, length, shape (nodes, d)."""
        return self.at.x.array.reshape(-1, self._dimension)

    def stiffness_at_corners(self, state: ContactState) -> tuple[JointStiffness, ...]:
        """Return the stiffness of contact at corners of shapes, where the facets under them turn;
        collective.
        """
        boundary = state.boundary
        if boundary.corners is None:
            return ()
        columns = np.column_stack(
            (boundary.part, boundary.number, boundary.weight * state.pressure)
        )
        rows = parallel.gather_rows(boundary.comm, columns[~boundary.at_nodes])
        joint = list[JointStiffness]()
        for number in map(int, np.unique(rows[:, 0])):
            corners = self.corners_of(number)
            of_part = rows[rows[:, 0] == number]
            if corners is not None and of_part[:, 2].any():
                line = BoundaryLine.of(self._space, self.facets[number], self.displacement)
                forces = of_part[np.argsort(of_part[:, 1]), 2] * parallel.is_root(boundary.comm)
                joint.append(CornerFeet.of(line, corners).stiffness(line, corners, forces))
        return tuple(joint)

    def slips_at_corners(self, boundary: ContactBoundary, begun: State) -> Array:
        """Return the slip of the material points that were under corners at the beginning of the
        step, relative to the corners, length, shape (n, d), zero at nodes; collective.
        """
        slips = np.zeros_like(boundary.x)
        moved = self.moved_shapes(begun.placed)
        for number in range(len(self._contact)):
            if (corners := self.corners_of(number)) is None:
                continue
            before = begun.displacement.reshape(-1, self._dimension)
            lines = [
                BoundaryLine.of(self._space, self.facets[number], places)
                for places in (before, self.displacement)
            ]
            shape = self.placed_shape(number)
            earlier = moved.get(number, (shape, shape))[1]
            turned = corners_of(earlier, 2)
            assert turned is not None
            feet = CornerFeet.of(lines[0], turned)
            rows = np.flatnonzero((boundary.part == number) & ~boundary.at_nodes)
            slips[rows, :2] = feet.slips(lines[1], corners.places)[: rows.size]
        return slips

    def _gap_of(self, number: int) -> Array:
        gap = super()._gap_of(number)
        if (pair := self.sliding.get(number)) is not None:
            gap[pair.local_points] += pair.opening
        return gap

    def _distance_of(self, number: int) -> Array:
        moving = self.moving[number]
        at = self._values[number]
        path = f"contact[{number}]"
        moving.added = at(self._contact[number].gap, f"{path}.gap")[moving.nodes]
        return at(moving, f"{path}.shape")


def _moving(sides: FacingSides, reach: float | None) -> MovingPair:
    """Return the map of two sliding sides, or of one side that may touch itself, at zero
    displacement.
    """
    if not sides.one:
        return MovingPair(sides, reach)
    from signorini_fx.mechanics.obstacles.folded_side import FoldedSide

    return FoldedSide(sides, reach)


@dataclass(frozen=True)
class Bent:
    """Geometric stiffness of contact: what tractions that turn with the displacement add to the
    tangent.

    Attributes:
        hessians: second derivatives of distances at contact points, see ``hessians_at``.
        curvature: the added stiffness at nodes.
        relative: see ``MovingRigidBodies.relative_stiffness``.
        askew: whether the added stiffness is not symmetric.
        tractions: the tractions; None: there are none.
    """

    hessians: Array
    curvature: NodalStiffness
    relative: tuple[Array, Array] | None = None
    askew: bool = False
    tractions: ContactState | None = None


@dataclass(frozen=True)
class Iterate:
    """The input of a contact problem of Newton's method beside the present displacement.

    Attributes:
        bent: the geometric stiffness of contact.
        residual: F minus the loads, forces of shape (owned dofs,); None: it is not assembled yet.
        definite: whether the tangent is positive definite, as far as is known for this load.
        symmetric: whether it is symmetric, as far as is known.
        near: contact points that an increment may close, shape (n,); None: unknown.
        values: the displacement of the last iteration; None: there was none.
        lost: bound of the round-off in the resultant of the residual, force; None: unknown.
    """

    bent: Bent
    residual: Array | None = None
    definite: bool = True
    symmetric: bool = True
    near: Flags | None = None
    values: Array | None = None
    lost: float | None = None


@dataclass(frozen=True)
class Linearised:
    """The contact problem of one iteration, for the whole displacement.

    Attributes:
        begin: the state from which its step begins.
        iterate: the input that it was made of.
        posed: the tangent with its contact points.
        boundary: the contact points, which may be none.
        start: the initial state of its solution.
        before: the end of the last step, relative to the present foundations; None: it has no
            influence.
        prescribed: flags of prescribed dofs of this rank, ghosts included, and their values, shapes
            (dofs,).
        data: data of each foundation at the nodes.
        given_gap: gap without the additions of effects, length, shape (n,).
        matrix: bytes of all values that the matrix is assembled from.
    """

    begin: State
    iterate: Iterate
    posed: Posed
    boundary: ContactBoundary
    start: Start
    before: PreviousStep | None
    prescribed: tuple[Flags, Array]
    data: list[FoundationData]
    given_gap: Array
    matrix: list[bytes]

    @property
    def elastic(self) -> Model:
        """The body with this tangent."""
        return self.posed.body

    @property
    def task(self) -> Task:
        """The contact problem in terms of matrices."""
        return self.posed.task


@dataclass(frozen=True)
class Solved:
    """The end of the contact problem of an iteration.

    Attributes:
        body: the nonlinear body.
        linear: the contact problem.
        outcome: how the method has ended.
        state: the contact points of this rank.
        values: the displacement, ghosts included, length, shape (dofs,).
        rigid: coordinates of rigid bodies, see ``MovingRigidBodies``.
        new: the last solution in the step; None: there is none.
    """

    body: NonlinearBody
    linear: Linearised
    outcome: Outcome
    state: ContactState
    values: Array
    rigid: Array
    new: State | None

    @property
    def status(self) -> Status:
        """The status of the outcome."""
        return self.outcome.status

    @property
    def loose(self) -> list[int]:
        """The numbers of the assemblies without contact tractions; collective."""
        task = self.linear.task
        tractions = np.column_stack((self.state.pressure, self.state.shear))
        return task.motions.untouched(task.idle, np.asarray(tractions.any(axis=1)))

    def internal(self, increment: Array) -> tuple[Array, Array, float]:
        """Return the forces of an increment d in the linearised problem, and their work on rigid
        bodies.

        Args:
            increment: d, ghosts included, shape (dofs,).

        Returns:
            The forces a(d, .), correct at dofs without supports, shape (owned dofs,); the part of
            them that comes from the geometric stiffness; and the work on the increments of rigid
            bodies, by their springs and by normals that turn relative to them.
        """
        linear = self.linear
        elastic = linear.elastic
        rigid = elastic.rigid
        work = 0.0
        if rigid.bodies:
            moved = self.rigid - self.body.foundations.coordinates
            springs = np.where(rigid.fixed, 0.0, rigid.stiffness)
            work += float(springs @ moved**2)
            if elastic.relative is not None:
                on_rigid = elastic.relative_forces(increment, moved)[1]
                work += float(2 * on_rigid @ moved + moved @ elastic.relative[1] @ moved)
        held = elastic.forces_of(np.where(linear.prescribed[0], increment, 0.0))
        turning = linear.iterate.bent.curvature.times(increment, elastic.space)
        return elastic.forces_of_free(increment) + held, turning, work


class NonlinearBody(BodyOfForms):
    """A nonlinear body at the displacement ``at``, with its contact and all unchanging data."""

    stated_by = ("F",)
    refused_features = (("nonlinear material", "F"),)
    foundations: MovingFoundations

    def __init__(
        self,
        tangents: Tangents,
        evaluated: Residual,
        bcs: Sequence[fem.DirichletBC],
        contact: Sequence[Foundation | Pair],
        options: tuple[str, PetscOptions],
        boundaries: Mapping[str, Facets] | None = None,
        effects: Sequence[StepEffect] = (),
        density: Density = None,
        **settings: SettingValue,
    ) -> None:
        at = self.at = evaluated.u
        increment = fem.Function(at.function_space)
        forms, _ = given_forms(
            tangents.leading, evaluated.form, contact, increment, boundaries=boundaries
        )
        bilinear = tangents.bilinear if evaluated.stepped is None else None
        forms = replace(forms, original=(bilinear, evaluated.form))
        moving = partial(MovingFoundations, at=at)
        super().__init__(forms, bcs, settings, options, effects, moving, density)
        # Facets of named parts of the boundary, for messages.
        self.names: Mapping[str, Indices] = forms.boundaries
        self.bodies: tuple[str, ...] = ()  # see ``BodyPieces``
        self.evaluated = evaluated
        self.tangents = tangents
        # Whether a given tangent is known to be the derivative and is not tested: near a yield
        # stress no difference quotient can tell.
        self.trusted = False
        self.several = False  # see ``Start``
        self.drives: Sequence[Drive] = ()  # forces on rigid bodies in this step, without effects
        self.now: Linearised | None = None  # the last problem that was assembled
        self.solved: Solved | None = None  # the last problem that was solved in this step
        self.begin = self.initial()

    def take_scene(self, model: Model, history: History) -> None:
        """Take the names, material parts and the history from a scene.

        Args:
            model: the linear body of the scene, at small strains.
            history: the history of solves, which is continued.
        """
        tagged = model.tagged
        rigid = replace(model.rigid, length=self.foundations.rigid_bodies.length)
        self.model_of_scene = replace(model, rigid=rigid)
        self.history = history
        self.names = {name: tagged.facets(name) for name in tagged.boundaries}
        self.bodies = model.pieces.bodies
        parts = [tagged.cells(material.region) for material in model.materials]
        self.forms = replace(self.forms, parts=parts)

    @property
    def places(self) -> Array:
        """The displacements of the nodes, length, shape (nodes, d)."""
        return self.at.x.array.reshape(-1, self.at.function_space.mesh.geometry.dim)

    def slide(self) -> None:
        """Update the maps of sliding pairs to the present displacement; collective."""
        numbers = [k for k, entry in enumerate(self.contact) if entry.slides]
        if numbers and not self.foundations.sliding:
            foundations = self.foundations
            fixed, values = self.supports()
            at_rest = foundations.at_rest(fixed, values)[: self.owned]
            fixed = fixed[: self.owned]
            facing = {
                k: foundations.facing(k, foundations.factor_of(k), fixed, None, at_rest)
                for k in numbers
            }
            pairs = {k: _moving(both, self.contact[k].reach) for k, both in facing.items()}
            reason = (
                "no point of its side has a partner within the reach: nothing would "
                "hold both sides together"
            )
            unseen = [k for k, pair in pairs.items() if not pair.coupling.seen]
            if apart := [
                (f"contact[{k}].kind", reason) for k in unseen if self.contact[k].bilateral
            ]:
                raise FormError(apart)
            self.foundations.sliding = pairs
            self.settle()
        for pair in self.foundations.sliding.values():
            pair.move(self.places[: self.space.dofmap.index_map.size_local])

    def settle(self) -> None:
        """Count the slips of pairs from the beginning of the step; collective."""
        for pair in self.foundations.sliding.values():
            pair.settle(self.begin)

    def points(self) -> tuple[ContactBoundary, fem.FunctionSpace]:
        """Return the contact points and the space of the displacement, see ``State.save``."""
        return (self.now or self.as_it_is()).boundary, self.space

    def start(self, state: State) -> None:
        """Put the body into the state in which a step begins, and discard all data of other steps;
        collective.
        """
        if state is not self.begin:  # otherwise u keeps the first iterate that the user has given
            self.at.x.array[:] = state.displacement
        self.begin = state
        self.solved = None
        self.foundations.carry_to(state.rigid)
        self.settle()

    # --- the contact problem of an iteration ---

    def _tractions(self) -> ContactState | None:
        """Return the tractions of the last linear problem, or of the state at which the step
        begins, in the present tangent frames; None if there are none; collective.
        """
        if self.solved is not None:
            return self.solved.state
        values = self.begin.contact
        if values is None:
            return None
        foundations = self.foundations
        shapes = foundations.shapes()
        boundary = foundations.points(shapes, *self.supports())
        spin = foundations.spin_at(boundary, self.begin.placed)
        rotation = rotations(values.normal, boundary.normal, spin)
        sets, (pressure, shear) = in_frames(values, rotation, boundary)
        law = foundations.law(boundary, 1.0)
        none = np.zeros_like(pressure)
        return ContactState(
            boundary.points,
            gap=none,
            u_n=none,
            u_t=0.0 * shear,
            pressure=pressure,
            shear=shear,
            bound=none if law is None else law.evaluate(pressure, none)[0],
            in_contact=sets.contact,
            direction=sets.direction,
            has_friction=law is not None,
            bilateral=none > 0,
            slip_length=0.0 * shear,
            xi=0.0 * shear,
            dt=0.0,
            held=None,
            damage=None,
            boundary=boundary,
        )

    @property
    def last(self) -> State | None:
        """The last solution of the step, or None if there is none."""
        return None if self.solved is None else self.solved.new

    def bend(self, *, symmetric: bool = True) -> Bent:
        """Return the geometric stiffness of contact at the last tractions; collective.

        Args:
            symmetric: whether to leave out its unsymmetric part, which only pairs with Coulomb
                friction have.
        """
        foundations = self.foundations
        dim = self.places.shape[1]
        if (state := self._tractions()) is None:
            return Bent(np.zeros((0, dim, dim)), NodalStiffness.none(dim))
        # The matrices of Coulomb friction are not symmetric anyway, so the unsymmetric part costs
        # nothing.
        whole = (
            not symmetric and self.now is not None and type(self.now.task.system) is ElasticSystem
        )
        laws = [self.contact[number].friction for number in foundations.sliding]
        askew = whole and any(law is not None and law.follows_pressure for law in laws)
        size = self.named[1].size
        hessians = hessians_at(state.boundary, foundations.moving, self.places, size)
        blocks = curvature_of(hessians, state)
        rigid = foundations.rigid_bodies
        relative = rigid.relative_stiffness(state, blocks) if rigid.bodies else None
        joint = [
            pair.stiffness(state, symmetric=not askew) for pair in foundations.sliding.values()
        ]
        places = self.places[: self.space.dofmap.index_map.size_local]
        joint += [
            paired.stiffness(state, places)
            for number, (_, paired) in foundations.undeformed.items()
            if not self.contact[number].bonded
        ]
        joint += foundations.stiffness_at_corners(state)
        curvature = NodalStiffness.summed(state.boundary.nodes, blocks, tuple(joint))
        return Bent(hessians, curvature, relative, askew, state)

    def at_iterate(self, iterate: Iterate, *, keeps: bool = False) -> Linearised:
        """Return the contact problem of an iteration at the present displacement; collective.

        Args:
            iterate: its input.
            keeps: whether to reuse the stiffness of the last iteration.
        """
        last = self.now
        self.now = None
        if self.mesh_has_moved:
            reason = "the coordinates of its mesh have changed: make a new problem on this mesh"
            raise FormError.at("u", reason)
        foundations = self.foundations
        prescribed = self.supports()
        shapes = foundations.shapes()
        rigid = foundations.rigid_bodies
        free_unused(self.space.mesh)
        boundary = self.contact_points(shapes, *prescribed)
        form = compat.form_data(self.forms.compiled[0])
        bent = iterate.bent
        flags = np.array([iterate.definite, iterate.symmetric, bent.askew])
        arrays = [*form, prescribed[0], rigid.fixed, rigid.stiffness, flags]
        arrays += [bent.curvature.nodes, bent.curvature.blocks]
        matrix = [np.asarray(one).tobytes() for one in arrays]
        other = last is None or last.matrix != matrix or self._follows(rigid)
        keeps = keeps or not parallel.any_rank(self.space.mesh.comm, other)
        if keeps and last is not None:
            matrix = last.matrix
        elastic, iterate = self._tangent(iterate, boundary, prescribed, last, keeps=keeps)
        forms = self.forms
        natural = natural_modulus(None, forms.original[0], forms.measures, self.space)
        elastic = with_modulus(elastic, boundary, natural, foundations.facets)
        case, iterate = self._case(elastic, iterate, rigid.driven(), prescribed)
        data = foundations.data(shapes)
        given, law = foundations.problem(boundary, data, self.settings, elastic.scales)
        elastic = replace(elastic, rigid=rigid, data=given, law=law)
        task = elastic.task([case], np.ones(1), history=self.history)
        drift = foundations.motion_at(boundary, self.begin)
        posed = Posed(
            elastic,
            replace(task, rest=None),
            replace(task.start, data=given, factors=np.ones(1)),
            foundations.placed,
            drift,
            foundations.spin_at(boundary, self.begin.placed),
            dt=foundations.dt,
            linear=False,
        )
        if self.effects:
            posed = with_contact(posed, self.effects, self.begin)
        start, before = self._start(posed, boundary, bent)
        self.now = Linearised(
            self.begin,
            iterate,
            posed,
            boundary,
            start,
            before,
            prescribed,
            data,
            given.gap,
            matrix,
        )
        return self.now

    def _follows(self, rigid: RigidBodies) -> bool:
        """Return whether the matrix depends on the displacement beyond the tangent of the forms."""
        foundations = self.foundations
        return bool(
            any(entry.against is not None and not entry.bonded for entry in self.contact)
            or rigid.bodies
            or any(foundations.corners_of(k) for k in range(len(self.contact)))
        )

    def _start(
        self, posed: Posed, boundary: ContactBoundary, bent: Bent
    ) -> tuple[Start, PreviousStep | None]:
        """Return the start of a contact problem, and the end of the last step or None; collective.

        The slips of sticking points are linearised with the rotation of their tangent planes.
        """
        foundations = self.foundations
        state = bent.tractions if self.solved is None else self.solved.state
        # With effects the gammas are already in the posed step.
        begin = replace(self.begin, gammas=None) if self.effects else self.begin
        begun, before = start_of(posed, begin, self.last)
        rigid = foundations.rigid_bodies
        tangents = boundary.tangents
        origin = begun.data.slip_origin.copy()
        for number, pair in foundations.sliding.items():
            rows = boundary.part == number
            origin[rows] = components(pair.slip_origin, tangents[rows])
        if posed.task.motions.count:
            begun = replace(begun, several=self.several)
        if boundary.corners is not None:
            slips = foundations.slips_at_corners(boundary, self.begin)
            count = components(boundary.moved(self.places) - slips, tangents)
            origin = np.where(boundary.at_nodes[:, None], origin, count)
        places = self.places[boundary.nodes]
        way = self.way(boundary, before)
        if (
            boundary.moving is not None
        ):  # slips on rigid bodies count from their present coordinates
            places = places - boundary.moving.modes @ rigid.coordinates
            on_rigid = np.isin(boundary.part, rigid.parts)
            origin = np.where(on_rigid[:, None], components(places - way, tangents), origin)
        if state is not None and len(bent.hessians) == boundary.size == state.boundary.size:
            slip = components(places, tangents) - origin
            slip -= components(vectors_of(state.slip_length, state.boundary.cotangents), tangents)
            turned = left_by_turning(boundary, bent.hessians, way, slip)
            origin = origin + np.where(self.sticks(state)[:, None], turned, 0.0)
        return replace(begun, data=replace(begun.data, slip_origin=origin)), before

    def way(self, boundary: ContactBoundary, before: PreviousStep | None) -> Array:
        """Return the displacement of contact points relative to the prescribed motion of shapes
        since the step began, length, shape (n, d); motions by forces are not subtracted.
        """
        places = self.places
        way = (places - self.begin.displacement.reshape(places.shape))[boundary.nodes]
        return way if before is None or before.moved is None else (way - before.moved)

    def _tangent(
        self,
        iterate: Iterate,
        boundary: ContactBoundary,
        prescribed: tuple[Flags, Array],
        last: Linearised | None,
        *,
        keeps: bool,
    ) -> tuple[Model, Iterate]:
        """Return the body with its tangent, and the iterate with what was found out about it;
        collective.

        A tangent that is not definite is factorised as a whole and without fall-backs, since a
        smaller increment helps more.
        """
        definite = iterate.definite and iterate.symmetric
        symmetric = iterate.symmetric and not iterate.bent.askew
        settings = self.settings
        if self._curved(
            iterate.bent
        ):  # without geometric stiffness it is convex; this is the first fall-back
            settings = settings.model_copy(update={"fallbacks": False})
        if not (definite and symmetric):
            whole = {"linear_algebra": "full", "fallbacks": definite and settings.fallbacks}
            settings = settings.model_copy(update=whole)
        more: dict[str, Any] = {"definite": definite and symmetric, "symmetric": symmetric}
        fixed = prescribed[0][: self.owned]
        other = last is None or not np.array_equal(last.elastic.fixed, fixed)
        if not parallel.any_rank(self.space.mesh.comm, other):
            assert last is not None
            earlier = last.elastic
            more["of_mesh"] = earlier.of_mesh
            more["of_body"] = earlier.of_body if keeps else earlier.of_supports
            if keeps:
                more["eliminated"] = last.task.system.eliminated
        if definite:
            more["far"], iterate = self._far_points(iterate, boundary, prescribed)
        try:
            form = self.forms.compiled[0]
            more |= {"fixed": fixed, "settings": settings}
            return self.body_of(form, boundary, iterate.bent, **more), iterate
        except MatrixError as error:
            if error.fault != NOT_SYMMETRIC:
                raise
        self.history.add("the tangent is not symmetric: it is factorised as LU")
        iterate = replace(iterate, symmetric=False)
        return self._tangent(iterate, boundary, prescribed, last, keeps=keeps)

    def body_of(
        self, tangent: fem.Form, boundary: ContactBoundary, bent: Bent, **more: Any
    ) -> Model:
        """Return the body of a tangent with the geometric stiffness of contact; collective.

        Args:
            tangent: the compiled tangent.
            boundary: the contact points.
            bent: the geometric stiffness.
            more: further arguments of ``elastic_body``.
        """
        fits = bent.relative is not None and len(bent.relative[0]) == boundary.size
        more |= {"beside": bent.curvature, "relative": bent.relative if fits else None}
        more["density"] = lambda: self.density
        points = boundary if self.contact else None
        return elastic_body(
            self.space, tangent, self.bcs, boundary=points, named=self.named, **more
        )

    def _curved(self, bent: Bent) -> bool:
        """Return whether the tangent contains geometric stiffness of contact on any rank;
        collective.
        """
        curved = bool(bent.curvature.nodes.size or bent.curvature.joint)
        return parallel.any_rank(self.space.mesh.comm, curved)

    def _case(
        self,
        elastic: Model,
        iterate: Iterate,
        driven: Driven,
        prescribed: tuple[Flags, Array],
    ) -> tuple[LoadCase, Iterate]:
        """Return the right-hand side, with the work of the residual on free rigid motions, and the
        iterate with its round-off; collective.

        Displacements relative to rigid bodies add their forces.  Supports add nothing unless they
        have moved since F was evaluated.
        """
        fixed, values = prescribed
        at = self.at.x.array
        residual = iterate.residual
        if residual is None:
            residual = self.evaluated.assembled()
        lifted = np.where(fixed, values - at, 0.0)
        case = case_of(elastic, elastic.forces_of_free(at) - residual, values, driven, lifted)
        if elastic.motions.free.size:
            lost = iterate.lost
            if lost is None:
                lost = round_off(self.evaluated, residual)[~elastic.fixed].sum()
                lost = UNITS_OF_NO_LOAD * float(parallel.global_sum(elastic.comm, lost))
                iterate = replace(iterate, lost=lost)
            resultant = elastic.motions.load_of(-residual, elastic.comm, driven.forces)
            resultant = replace(resultant, size=resultant.size + lost / NO_FORCE)
            case = replace(case, resultant=resultant)
        if elastic.relative is not None:
            away = at - np.where(fixed, values, 0.0)
            rigid = self.foundations.rigid_bodies
            moved = rigid.coordinates - np.where(rigid.fixed, driven.motion, 0.0)
            forces, _ = elastic.relative_forces(away, moved)
            held = elastic.prescribed[: forces.size]
            case.load.getArray()[: forces.size] += np.where(held, 0.0, forces)
        return case, iterate

    def _far_points(
        self, iterate: Iterate, boundary: ContactBoundary, prescribed: tuple[Flags, Array]
    ) -> tuple[tuple[Flags, fem.Function] | None, Iterate]:
        """Return the flags of points that are too far from their shapes to close in this increment,
        shape (n,), with the present displacement; or None if there are none; and the updated
        iterate.

        The condensed matrix of a 3D body on one rank leaves them out.  If one penetrates after all,
        the next iteration includes it.
        """
        state = iterate.bent.tractions if self.solved is None else self.solved.state
        values = self.at.x.array
        plain = (
            boundary.averages.shares.nnz == boundary.size > 0
            and boundary.moving is None
            and not boundary.paired
        )
        of_body = boundary.x.shape[1] == 3 and boundary.comm.size == 1
        if not of_body or iterate.residual is None or not plain:
            return None, iterate
        if state is None or state.boundary.size != boundary.size:
            return None, iterate
        distance = np.full(boundary.size, -np.inf)
        added = np.zeros(len(self.places))
        for number, moving in self.foundations.moving.items():
            points = np.flatnonzero(boundary.part == number)
            nodes, added[moving.nodes] = boundary.nodes[points], moving.added
            distance[points] = (
                moving.shape.distance(boundary.x[points] + self.places[nodes])[0] + added[nodes]
            )
        # The reach: the largest penetration, motion of supports, or change in the last iteration.
        fixed, to = prescribed
        increments = [np.abs(to - values)[fixed], -distance[np.isfinite(distance)]]
        if iterate.values is not None:
            increments.append(np.abs(values - iterate.values))
        near = state.in_contact | (state.bound > 0.0)  # a shear may act without contact
        near |= distance <= RETAINED_REACH * max(moved.max(initial=0.0) for moved in increments)
        if iterate.near is not None and iterate.near.size == near.size:
            near |= iterate.near
        near[distance.argmin()] = True  # keep at least one point, so that the matrix is not empty
        iterate = replace(iterate, near=near, values=values.copy())
        return None if near.all() else (~near, self.at), iterate

    # --- its solution ---

    def solve_at(self, iterate: Iterate, *, keeps: bool = False) -> Solved:
        """Solve the contact problem of an iteration; a tangent that is not positive definite for
        Cholesky's factorisation is factorised as LDL^T; collective.

        Args:
            iterate: its input.
            keeps: whether to try the stiffness of the last iteration first.

        Raises:
            ConvergenceError: the contact problem has no solution.
            MatrixError: the stiffness cannot be assembled.
        """
        if keeps:
            with suppress(MatrixError):
                solved = self._solved(iterate, keeps=True)
                if solved.status is Status.CONVERGED:
                    return solved
            iterate = replace(iterate, bent=self.bend())
        status = Status.SINGULAR
        try:
            solved = self._solved(iterate)
            status = solved.status
            opens = status in (Status.OPEN, Status.NOT_HELD) and bool(solved.linear.task.idle)
            if (opens or status in _WITHOUT_SETS) and self._curved(iterate.bent):
                # Bodies without contact have no tractions that turn: retry without geometric
                # stiffness.
                curvature = NodalStiffness.none(self.places.shape[1])
                bent = replace(iterate.bent, curvature=curvature, relative=None)
                iterate = replace(solved.linear.iterate, bent=bent)
                solved = self._solved(iterate)
                status = solved.status
            iterate = solved.linear.iterate
        except MatrixError as error:
            if error.fault != NOT_POSITIVE:
                raise
        if iterate.definite and status in (Status.SINGULAR, Status.LINEAR_SOLVER):
            self.history.add("the tangent is not positive definite: it is factorised as LDL^T")
            solved = self._solved(replace(iterate, definite=False))
        if solved.status is not Status.CONVERGED:
            reason = f"{solved.status.value}: {solved.status.advice}"
            raise ConvergenceError(solved, reason)
        return solved

    def _solved(self, iterate: Iterate, *, keeps: bool = False) -> Solved:
        with options_applied(*self.options):
            linear = self.at_iterate(iterate, keeps=keeps)
            outcome = solve_task(linear.task, linear.start)
            solved = self.take(linear, outcome)
            if isinstance(system := outcome.problem.system, CondensedSystem):
                # Evaluate the points that were left out as far at the solution.
                system.find_far_points(outcome.newton.x)
        return solved

    def take(self, linear: Linearised, outcome: Outcome) -> Solved:
        """Return the end of a contact problem and store it as the start of the next iteration.

        It gets no certificate: only the solution of the nonlinear problem is checked.
        """
        elastic = linear.elastic
        unknowns = outcome.displacement()
        displacement = elastic.function(unknowns)
        state = ContactState.of(linear.task.contact(outcome, linear.start), linear.boundary)
        coordinates = elastic.driven(unknowns, None)
        new = self.last
        if outcome.status is Status.CONVERGED:
            new = state_of(linear.posed, linear.start, outcome, unknowns, displacement, self.begin)
        values = displacement.x.array
        self.solved = Solved(self, linear, outcome, state, values, coordinates, new)
        return self.solved

    def settled(self) -> Solved:
        """Return the end of the last linear problem with the displacement of the nonlinear
        solution, whose residual has been judged, as the new state.
        """
        last = self.last
        assert last is not None
        assert self.solved is not None
        remembered = [pair.remembered() for pair in self.foundations.sliding.values()]
        last = replace(
            last,
            fields=reduce(or_, remembered, dict(last.fields)),
            displacement=self.at.x.array.copy(),
            rigid=self.foundations.coordinates.copy(),
            placed=self.foundations.placed,
        )
        self.solved = replace(self.solved, new=last)
        return self.solved

    def as_it_is(self) -> Linearised:
        """Return the contact problem at the present displacement, without the geometric stiffness
        of contact; collective.

        The tangent may be indefinite.
        """
        dim = self.places.shape[1]
        iterate = Iterate(Bent(np.zeros((0, dim, dim)), NodalStiffness.none(dim)))
        self.slide()
        with options_applied(*self.options):
            try:
                return self.at_iterate(iterate)
            except MatrixError as error:
                if error.fault != NOT_POSITIVE:
                    raise
            return self.at_iterate(replace(iterate, definite=False))

    def leave_open(self, status: Status) -> Solved:
        """Return the present displacement without any contact, as the end of a solve with this
        status; collective.
        """
        linear = self.as_it_is()
        data = linear.start.data
        nowhere = np.zeros(linear.boundary.size)
        sets = ActiveSets.of(nowhere > 0, np.zeros_like(data.mu_hat), nowhere)
        task = linear.task
        newton = task.newton
        task.begin_step(linear.start)
        newton.pose(data, sets)
        x = task.system.unknowns(linear.elastic.unknowns(self.at))
        newton.restore((x, newton.problem.sets, newton.problem.data))
        augmented = task.settings.algorithm == "alm"
        return self.take(linear, Outcome(status, newton, data, augmented=augmented))

    def take_tractions(self, values: ContactValues) -> None:
        """Give the last result the tractions of the end of a step, in the present frames.

        The last linear problem of the step had another displacement than the end of the step.
        """
        assert self.solved is not None
        boundary = self.solved.linear.boundary
        _, (pressure, shear) = in_frames(
            values, rotations(values.normal, boundary.normal), boundary
        )
        state = replace(self.solved.state, pressure=pressure, shear=shear)
        self.solved = replace(self.solved, state=state)

    def derivative_at(self, solved: Solved) -> tuple[Any, ...]:
        """Return a solution with the derivative of its contact problem, see ``SolvedStep.of``;
        collective.
        """
        self.begin = solved.linear.begin
        self.solved = solved
        iterate = solved.linear.iterate
        symmetric = iterate.symmetric
        bent = self.bend()
        curvature = curvature_of(bent.hessians, solved.state, symmetric=False)
        sheared = bool((curvature != curvature.transpose(0, 2, 1)).any())
        if parallel.any_rank(self.space.mesh.comm, sheared):
            joint = self.foundations.stiffness_at_corners(solved.state)
            nodes = solved.state.boundary.nodes
            bent = replace(bent, curvature=NodalStiffness.summed(nodes, curvature, joint))
            symmetric = False
        self.slide()
        iterate = Iterate(bent, definite=iterate.definite, symmetric=symmetric)
        with options_applied(*self.options):
            linear = self.at_iterate(iterate)
        boundary = linear.boundary
        state = replace(solved.state, boundary=boundary)
        # Displacements along the normal do not change the slip.
        slips = turned_slips(boundary, bent.hessians, self.way(boundary, linear.before))
        slips = np.pad(slips, ((0, 0), (0, 0), (1, 0)))
        turning = curvature, slips, self.foundations.spin_at(boundary, self.begin.placed)
        start = linear.start
        ended = (linear.elastic, linear.task, solved.outcome, start, state, self.at, start.law)
        return *ended, turning

    def data_now(
        self, solved: NonlinearBody | None = None, begun: State | None = None
    ) -> tuple[Any, ...]:
        """Return the data of the present problem for derivatives: minus the residual, prescribed
        values, contact points, gap, friction law, and the motion of shapes at the points in the
        step; collective.

        Args:
            solved: a body with the assembled problem of a solution; None: this one.
            begun: the end of the last step; None: that of this body.
        """
        kept = self.at.x.array.copy()
        at = self.at.x.array
        fixed, supports = self.supports()
        at[fixed] = supports[fixed]
        try:
            now = (solved or self).now
            assert now is not None
            values, boundary, gap, law = self.contact_now(now)
            motion = self.foundations.motion_at(boundary, self.begin if begun is None else begun)
            if (residual := self.evaluated.at(at.copy())) is None:
                raise FormError.at("F", "is not finite beside the solution")
            return [], -residual, values, boundary, gap, law, motion
        finally:
            at[:] = kept
            self.evaluated.go_to(kept)

    # --- used by the verdict on stability ---

    def sticks(self, state: ContactState) -> Flags:
        """Return the flags of points that stick by friction, in contact or by a bound that acts
        without contact, or that are bonded, shape (n,).
        """
        part = state.boundary.part
        rough = np.array(
            [entry.friction is not None or entry.bonded for entry in self.contact], dtype=bool
        )[part]
        acts = state.in_contact | (state.bound > 0.0)
        return rough & acts & (state.direction == 0.0).all(axis=1)
