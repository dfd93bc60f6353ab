"""The contact problem of one iteration of Newton's method, for the whole displacement y.

    a(y, z) = a(u, z) - F(u; z),    a = F'(u) - lambda Hess phi + what turns the shear,

with the gaps and normals of the shapes at X + u.  The right-hand side is assembled from a and F as
they are compiled: a form a(u, .) - F(u; .) would get a quadrature degree of its own, and Newton's
method the residual of that.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from copy import copy
from dataclasses import replace
from functools import partial, reduce
from operator import or_
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.algebra.algorithms.strategy import solve_task
from signorini_fx.algebra.algorithms.task import Outcome, Start
from signorini_fx.algebra.contact.active_sets import ActiveSets
from signorini_fx.algebra.contact.complementarity import RegularisedData
from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.algebra.linalg import ElasticSystem, LoadCase
from signorini_fx.algebra.linalg.condensed import CondensedSystem
from signorini_fx.arrays import Array, Flags, Indices
from signorini_fx.errors import FormError
from signorini_fx.forms.elasticity import NOT_POSITIVE, NOT_SYMMETRIC, MatrixError, elastic_body
from signorini_fx.forms.given_forms import conditions_of, given_forms
from signorini_fx.forms.nonlinear.moving_shapes import (
    MovingShape,
    MovingTools,
    curvature_of,
    fitting,
    hessians_at,
    left_by_turning,
    turned_slips,
)
from signorini_fx.forms.nonlinear.residual import Residual, Tangents, round_off
from signorini_fx.forms.solver import FormSolver, options_applied
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.averages import averaging
from signorini_fx.mechanics.assembly.mesh_entities import node_positions, prescribed
from signorini_fx.mechanics.assembly.nodal_stiffness import JointStiffness, NodalStiffness
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.obstacles.corner_points import BoundaryLine, CornerFeet
from signorini_fx.mechanics.obstacles.foundations_on_points import Foundations, ShapeDistances
from signorini_fx.mechanics.obstacles.paired_points import FacingSides, MovingPair, PairedSides
from signorini_fx.mechanics.shapes.analytic import Plane
from signorini_fx.mechanics.state import State
from signorini_fx.mechanics.statement.rigid_body import COMPONENTS
from signorini_fx.mechanics.statement.rigid_shape import Distance, Placement
from signorini_fx.mechanics.step_effect import StepEffect
from signorini_fx.records import Status
from signorini_fx.results.certificate.law_of_method import PreviousStep
from signorini_fx.results.solution import ConvergenceError
from signorini_fx.solving.frames import Posed, in_frames, rotations, start_of, state_of
from signorini_fx.solving.step import with_contact
from signorini_fx.tuned import NO_FORCE, RETAINED_REACH, UNITS_OF_NO_LOAD

# How a contact problem ends whose sets are not found.
_WITHOUT_SETS = (Status.CYCLING, Status.MAX_ITERATIONS, Status.OUTER_MAX_ITERATIONS)


class MovingFoundations(Foundations):
    """Foundations whose shapes are seen from points at the displacement ``at``."""

    sliding: Mapping[int, MovingPair]  # by their numbers
    coordinates: Array  # of tools where they are, see ``MovingTools``

    def __init__(self, *args: Any, at: fem.Function) -> None:
        self.at = at
        self.sliding = {}
        # Pairs that keep their partners, with what that depends on, by their numbers.
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
        """The shapes by the numbers of their foundations."""
        return self._distances  # type: ignore[return-value]

    def _put(self, number: int, distance: Distance) -> None:
        moving = self.moving[number]
        if distance.shape.driven is not moving.shape.driven:
            raise FormError.at(
                f"contact[{number}].shape", "forces move it, or they do not: that cannot change"
            )
        moving.shape = fitting(number, distance.shape, self._dimension, turns=moving.turns)

    @property
    def driven(self) -> list[Any]:
        """Return the shape of each contact that forces move, as the user has given it; None or
        False: it is none.
        """
        return [
            shape and self.moving[number].as_given for number, shape in enumerate(super().driven)
        ]

    @property
    def rigid_bodies(self) -> MovingTools:
        given = super().rigid_bodies
        return MovingTools(given.bodies, given.kinematics, given.length, self.at, self.coordinates)

    def check_driven(self) -> None:
        """Refuse driven shapes, also those given turned about another axis than forces turn them
        about.
        """
        super().check_driven()
        for body in self.rigid_bodies.bodies:
            rotations = map(body.motion.prescribes, COMPONENTS[self._dimension][self._dimension :])
            turn = np.array([1.0 if value is None else value for value in rotations])
            for part in body.parts:
                if reason := self.moving[part].turned_otherwise(turn):
                    raise FormError.at(f"contact[{part}].shape.rotation", reason)

    def carry_to(self, coordinates: Array) -> None:
        """Put tools where they are at coordinates of shape (k,)."""
        self.coordinates = coordinates
        for tool in self.rigid_bodies.motions:
            for part in tool.body.parts:
                self.moving[part].carry_to(tool)

    def motion_at(self, boundary: ContactBoundary, begun: State) -> Array | None:
        """How far shapes have moved with points since a state, length, shape (n, d); None: not."""
        moved = self.moved_shapes(begun.placed)
        places = begun.displacement.reshape(-1, self._dimension)
        if not moved:
            return None
        motion = np.zeros_like(boundary.x)
        for number, (shape, earlier) in moved.items():
            points = np.flatnonzero(boundary.part == number)
            # Not its closest points: a node may be inside by the penalty, or away by a gap that is
            # added.
            at = boundary.x[points] + places[boundary.nodes[points]]
            motion[points] = shape.carried_from(earlier, at)
            if (corners := boundary.corners) is not None:  # these move with the shape
                points = points[~boundary.at_nodes[points]]
                now = corners.place[points]
                motion[points] = now - earlier.moved_points(shape.moved_back(now))
        return motion

    def spin_at(
        self, boundary: ContactBoundary, placed: Sequence[Placement | None]
    ) -> Array | None:
        """Return the infinitesimal rotation at contact points, the mean of both sides of a pair."""
        moved = self.moved_shapes(placed)
        turned = dict.fromkeys(self.moving, np.eye(self._dimension))
        turned |= {
            k: shape.turned_from(earlier, self._dimension) for k, (shape, earlier) in moved.items()
        }
        turned |= {k: pair.rotation for k, pair in self.sliding.items()}
        if not turned:
            return None
        rotation = np.tile(np.eye(self._dimension), (boundary.size, 1, 1))
        for number, turn in turned.items():
            rotation[boundary.part == number] = turn
        return rotation

    def measured(self, shape: Any) -> bool:
        """Along the axis of a body of revolution alone, as forces around it cancel."""
        return bool(shape.prescribes("x") == 0.0)

    def _paired(self, number: int, *known: Any) -> ContactBoundary:
        """Return the contact points of a pair, of sides at their present places if they slide;
        otherwise with the partners of undeformed sides and present normals.
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
        """Return the displacement of the nodes onto which corners are projected, length, shape
        (nodes, d).
        """
        return self.at.x.array.reshape(-1, self._dimension)

    def stiffness_at_corners(self, state: ContactState) -> tuple[JointStiffness, ...]:
        """Return what facets that turn under corners add to the tangent; collective."""
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
                forces = of_part[np.argsort(of_part[:, 1]), 2]
                joint.append(CornerFeet.of(line, corners).stiffness(line, corners, forces))
        return tuple(joint)

    def slips_at_corners(self, boundary: ContactBoundary, begun: State) -> Array:
        """How far the points of the body that were under corners when a step began have moved from
        there, length, shape (n, d), zero at nodes; collective.
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
            feet = CornerFeet.of(lines[0], earlier.corners(2))
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
    """Return two sides that slide, or one that may touch itself, where nothing is displaced."""
    if not sides.one:
        return MovingPair(sides, reach)
    from signorini_fx.mechanics.obstacles.folded_side import FoldedSide

    return FoldedSide(sides, reach)


class LinearisedProblem(FormSolver):
    """The contact problem of one iteration, at the displacement ``at``."""

    _stated_by = ("F",)
    _refused_features = (("nonlinear material", "F"),)
    symmetric = definite = True  # as far as is known
    residual: Array | None = (
        None  # F at the displacement of now, less the loads; None: it has not been assembled yet
    )
    several = False  # see ``Start``
    posed: Posed  # the last linear problem
    previous_step: PreviousStep | None = (
        None  # the end of the last step, as foundations of now see it
    )
    bodies: tuple[str, ...] = ()  # see ``BodyPieces``
    _keeps = False  # whether the next solve keeps the stiffness of the last one
    _turning: ContactState | None = None  # whose tractions turn; None: those of ``begin``
    _round_off: float | None = None  # see ``_lost``, of the present load
    foundations: MovingFoundations
    _hessians: Array

    def __init__(
        self,
        tangents: Tangents,
        evaluated: Residual,
        bcs: Any,
        contact: Any,
        options: tuple[str, Mapping[str, Any]],
        boundaries: Mapping[str, Any] | None = None,
        effects: Sequence[StepEffect] = (),
        **settings: Any,
    ) -> None:
        at = self.at = evaluated.u
        increment = fem.Function(at.function_space)
        self._foundations_class = partial(MovingFoundations, at=at)
        forms, increment = given_forms(
            tangents.leading, evaluated.form, contact, increment, boundaries=boundaries
        )
        forms = replace(forms, original=(tangents.bilinear, evaluated.form))
        # Facets of parts of the boundary by their names, for messages.
        self.names: Mapping[str, Indices] = forms.boundaries
        super().__init__(forms, increment, bcs, settings, options, effects)
        self._evaluated = evaluated
        self._straighten()

    def _straighten(self) -> None:
        """Drop the geometric terms, which turn with the displacement."""
        dim = self.places.shape[1]
        self.curvature = NodalStiffness.none(dim)  # what the shapes add to the tangent
        self._hessians = np.zeros((0, dim, dim))
        self.relative: tuple[Array, Array] | None = None  # see ``MovingTools.relative_stiffness``
        self._askew = False  # whether what is added to the tangent is not symmetric

    @property
    def places(self) -> Array:
        """Displacements of the nodes, shape (nodes, d)."""
        return self.at.x.array.reshape(-1, self.at.function_space.mesh.geometry.dim)

    def slide(self) -> None:
        """Renew the maps of pairs at the displacement of now; collective."""
        numbers = [k for k, entry in enumerate(self.contact) if entry.slides]
        if numbers and not self.foundations.sliding:
            foundations = self.foundations
            space = self.space
            fixed, values = prescribed(space, conditions_of(self.bcs, space))
            owned = space.dofmap.index_map.size_local * space.dofmap.index_map_bs
            at_rest = foundations.at_rest(fixed, values)[:owned]
            fixed = fixed[:owned]
            facing = {
                k: foundations.facing(k, foundations.factor_of(k), fixed, None, at_rest)
                for k in numbers
            }
            pairs = {k: _moving(both, self.contact[k].reach) for k, both in facing.items()}
            reason = (
                "no point of its side has a partner within the reach: nothing would "
                "hold both sides together"
            )
            unseen = [k for k, pair in pairs.items() if not pair.coupling.frames.partnered.any()]
            if apart := [
                (f"contact[{k}].kind", reason) for k in unseen if self.contact[k].bilateral
            ]:
                raise FormError(apart)
            self.foundations.sliding = pairs
            self.settle()
        for pair in self.foundations.sliding.values():
            pair.move(self.places[: self.space.dofmap.index_map.size_local])

    def settle(self) -> None:
        """Slips of pairs count from where the step begins; collective."""
        for pair in self.foundations.sliding.values():
            pair.settle(self.begin)

    def points(self) -> tuple[ContactBoundary, fem.FunctionSpace]:
        self.slide()
        return super().points()

    def initial(self) -> State:
        """Return the initial state, with rigid bodies that nothing has moved."""
        rest = np.zeros(self.foundations.rigid_bodies.fixed.size)
        return replace(super().initial(), rigid=rest)

    def start(self, state: State) -> None:
        """Put the body where a step begins, with nothing of other steps; collective."""
        if state is not self.begin:  # else u is the first iterate that a user has given
            self.at.x.array[:] = state.displacement
        self.begin = state
        self.last = self._turning = None
        self.foundations.carry_to(state.rigid)
        self._straighten()
        self.settle()

    def _tractions(self) -> ContactState | None:
        """Return tractions of the last linear problem, else of the start of the step, in present
        frames; None: there are none; collective.
        """
        values = self.begin.contact
        if self._turning is not None or values is None:
            return self._turning
        shapes = self.foundations.shapes()
        boundary = self.contact_points(shapes, *prescribed(self.space, self.bcs))
        spin = self.foundations.spin_at(boundary, self.begin.placed)
        rotation = rotations(values.normal, boundary.normal, spin)
        sets, (pressure, shear) = in_frames(values, rotation, boundary)
        laws = [entry.law for entry in self.foundations.data(shapes)]
        law = self.foundations.law(boundary, 1.0, laws)
        none = np.zeros_like(pressure)
        self._turning = ContactState(
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
        return self._turning

    def bend(self, *, symmetric: bool = True) -> None:
        """Give the tangent the curvature of the shapes with the tractions of the last solution, all
        of it unless
        ``symmetric``: then what is not is left out, which only pairs with Coulomb friction have;
        collective.
        """
        if (state := self._tractions()) is None:
            return
        # The matrices of Coulomb friction are not symmetric, so that a whole one costs the same.
        whole = not symmetric and self.set_up and type(self.task.system) is ElasticSystem
        laws = [self.contact[number].friction for number in self.foundations.sliding]
        self._askew = whole and any(law is not None and law.follows_pressure for law in laws)
        size = self.named[1].size
        hessians = hessians_at(state.boundary, self.foundations.moving, self.places, size)
        blocks = curvature_of(hessians, state)
        self._hessians, tools, self.relative = hessians, self.foundations.rigid_bodies, None
        if tools.bodies:
            self.relative = tools.relative_stiffness(state, blocks)
        joint = tuple(
            pair.stiffness(state, symmetric=not self._askew)
            for pair in self.foundations.sliding.values()
        )
        places = self.places[: self.space.dofmap.index_map.size_local]
        for number, (_, paired) in self.foundations.undeformed.items():
            if not self.contact[number].bonded:
                joint = *joint, paired.stiffness(state, places)
        joint = *joint, *self.foundations.stiffness_at_corners(state)
        self.curvature = NodalStiffness.summed(state.boundary.nodes, blocks, joint)

    # --- what a FormSolver asks for ---

    def begin_step(self) -> Start:
        """Slips of points that stick are linearised as their tangent planes turn."""
        state = self._turning
        begin = self.begin
        self.posed = replace(self.pose(begin), linear=False, dt=self.foundations.dt)
        if self.effects:
            self.posed = with_contact(self.posed, self.effects, begin)
            begin = replace(begin, gammas=None)  # they are there already
        begun, self.previous_step = start_of(self.posed, begin, self.last)
        boundary = self.boundary
        tools = self.foundations.rigid_bodies
        origin = begun.data.slip_origin
        for (
            number,
            pair,
        ) in self.foundations.sliding.items():  # slips count from where their step has begun
            rows = boundary.part == number
            origin = origin.copy()
            origin[rows] = np.einsum("nij,ni->nj", boundary.tangents[rows], pair.slip_origin)
        if self.task.motions.count:
            begun = replace(begun, several=self.several)
        if boundary.corners is not None:
            slips = self.foundations.slips_at_corners(boundary, self.begin)
            moved = boundary.moved(self.places)
            count = np.einsum("nij,ni->nj", boundary.tangents, moved - slips)
            origin = np.where(boundary.at_nodes[:, None], origin, count)
        places = self.places[boundary.nodes]
        way = self._way()
        if (
            boundary.moving is not None
        ):  # slips on tools are counted from where a step has begun by their finite motion
            places = places - boundary.moving.modes @ tools.coordinates
            begins = np.einsum("nij,ni->nj", boundary.tangents, places - way)
            on_tools = np.isin(
                boundary.part, [part for body in tools.bodies for part in body.parts]
            )
            origin = np.where(on_tools[:, None], begins, origin)
        if state is not None and len(self._hessians) == boundary.size == state.boundary.size:
            slip = np.einsum("nij,ni->nj", boundary.tangents, places) - origin
            slip -= np.einsum(
                "nij,nik,nk->nj", boundary.tangents, state.boundary.cotangents, state.slip_length
            )
            turned = left_by_turning(boundary, self._hessians, way, slip)
            origin = origin + np.where(self.sticks(state)[:, None], turned, 0.0)
        return replace(begun, data=replace(begun.data, slip_origin=origin))

    def _way(self) -> Array:
        """Return the displacement of contact points relative to shapes since the step began,
        without what forces move, shape (n, d).
        """
        previous = self.previous_step
        way = (self.places - self._begun_places)[self.boundary.nodes]
        return (
            way if previous is None or previous.moved is None else np.asarray(way - previous.moved)
        )

    def _body(self, fixed: Flags, boundary: ContactBoundary) -> Model:
        """A tangent that is not definite is factorised whole, without fall-backs: a smaller
        increment is what helps.
        """
        definite = self.definite and self.symmetric
        symmetric = self.symmetric and not self._askew
        settings = self.settings
        if self._curved:  # without curvature it is a convex problem: that is the first fall-back
            settings = settings.model_copy(update={"fallbacks": False})
        if not (definite and symmetric):
            whole = {"linear_algebra": "full", "fallbacks": definite and settings.fallbacks}
            settings = settings.model_copy(update=whole)
        beside: dict[str, Any] = {"definite": definite and symmetric, "symmetric": symmetric}
        last = self.__dict__.get("elastic")
        comm = self.space.mesh.comm
        if not parallel.any_rank(comm, last is None or not np.array_equal(last.fixed, fixed)):
            assert last is not None
            beside["of_body"], beside["of_mesh"] = (
                last.of_body if self._keeps else last.of_supports,
                last.of_mesh,
            )
            if self._keeps and isinstance(self.task.system, CondensedSystem):
                beside["eliminated"] = self.task.system.schur
        if definite:
            beside["far"] = self._far_points(boundary)
        try:
            return self.body_of(
                self.forms.compiled[0], boundary, fixed=fixed, settings=settings, **beside
            )
        except MatrixError as error:
            if error.fault != NOT_SYMMETRIC:
                raise
        self.symmetric = False
        self.history.add("the tangent is not symmetric: it is factorised as LU")
        return self._body(fixed, boundary)

    def body_of(self, tangent: fem.Form, boundary: ContactBoundary, **more: Any) -> Model:
        """The body of a tangent, with what turns; for the further arguments see ``elastic_body``;
        collective.
        """
        fits = self.relative is not None and len(self.relative[0]) == boundary.size
        points = boundary if self.contact else None
        more |= {"beside": self.curvature, "relative": self.relative if fits else None}
        named = self.named
        return elastic_body(self.space, tangent, self.bcs, boundary=points, named=named, **more)

    def _forces(self, values: Array) -> tuple[Array, Array]:
        """Supports that have not moved since F was evaluated add nothing to it."""
        at = self.at.x.array
        return self.elastic.forces_of_free(at) - self._residual_now, np.where(
            self.prescribed[0], values - at, 0.0
        )

    def _renew_mesh(self) -> None:
        reason = "the coordinates of its mesh have changed: make a new problem on this mesh"
        raise FormError.at("u", reason)

    def _set_up(
        self, shapes: Sequence[ShapeDistances], *, renewed: bool
    ) -> tuple[RegularisedData, PointFriction | None]:
        """Displacements are counted from the initial position, whatever holds the body."""
        data = super()._set_up(shapes, renewed=True)
        self.task = replace(self.task, rest=None)
        return data

    def _case(self, values: Array) -> LoadCase:
        """Return the load case with the work of the residual on free motions, and of the forces on
        relative displacements.
        """
        case = super()._case(values)
        elastic = self.elastic
        driven = self.driven
        if elastic.motions.free.size:
            resultant = elastic.motions.load_of(-self._residual_now, elastic.comm, driven.forces)
            case = replace(
                case, resultant=replace(resultant, size=resultant.size + self._lost / NO_FORCE)
            )
        if elastic.relative is not None:
            away = self.at.x.array - np.where(self.prescribed[0], values, 0.0)
            moved = self.foundations.coordinates - np.where(self.rigid.fixed, driven.motion, 0.0)
            forces, _ = elastic.relative_forces(away, moved)
            case.load.getArray()[: forces.size] += np.where(
                elastic.prescribed[: forces.size], 0.0, forces
            )
        return case

    def _beside(self) -> Sequence[npt.NDArray[Any]]:
        loads = np.asarray(self._evaluated.loads)
        where = [self.foundations.coordinates, self.at.x.array]
        follows = (
            any(entry.against is not None and not entry.bonded for entry in self.contact)
            or self.rigid.bodies
            or any(self.foundations.corners_of(k) for k in range(len(self.contact)))
        )
        curvature = self.curvature.nodes, self.curvature.blocks
        return *curvature, loads, *(where if follows else ())

    def moved(self, boundary: ContactBoundary) -> Array | None:
        return self.foundations.motion_at(boundary, self.begin)

    @property
    def _begun_places(self) -> Array:
        """Displacements of the nodes at the end of the last step, shape (nodes, d)."""
        return self.begin.displacement.reshape(self.places.shape)

    def attempt(self) -> str:
        with options_applied(*self.options):
            self.begun = self.begin_step()
            outcome = solve_task(self.task, self.begun)
            self.take(outcome)
            if isinstance(system := outcome.problem.system, CondensedSystem):
                system.find_far_points(
                    outcome.newton.x
                )  # those that were taken to be far are where it is
        if outcome.status is Status.CONVERGED:
            return ""
        return f"{outcome.status.value}: {outcome.status.advice}"

    def take(self, outcome: Outcome) -> None:
        """Make the end of a linear problem the last result: the solution of the nonlinear one gets
        a certificate.
        """
        self.outcome = outcome
        unknowns = outcome.displacement()
        state = ContactState.of(self.task.contact(outcome, self.begun), self.boundary)
        self._state = self._turning = state
        self.rigid_bodies = self.rigid.moved(self.elastic.driven(unknowns, None))
        self.status = outcome.status
        self.certificate = None
        displacement = self.elastic.function(unknowns)
        self.u.x.array[:] = displacement.x.array
        if outcome.status is Status.CONVERGED:
            self.last = state_of(self.posed, self.begun, outcome, displacement, self.begin)

    @property
    def _residual_now(self) -> Array:
        """F less the loads at the displacement of now, forces of shape (owned dofs,);
        collective.
        """
        return self._evaluated.assembled() if self.residual is None else self.residual

    @property
    def _lost(self) -> float:
        """What round-off may make of the resultant of the residual, force; collective."""
        if self._round_off is None:
            lost = round_off(self._evaluated, self._residual_now)
            free = ~self.elastic.fixed
            self._round_off = UNITS_OF_NO_LOAD * float(
                parallel.global_sum(self.space.mesh.comm, lost[free].sum())
            )
        return self._round_off

    # --- one iteration ---

    def begin_anew(self) -> None:
        """A new load: the tangent is definite until a factorisation refuses it."""
        self.definite, self.symmetric, self._round_off = True, True, None
        self._near: Flags | None = None
        self._last_values: Array | None = None  # of the displacement in the last iteration

    def solve(self, *, keeps_stiffness: bool = False) -> None:
        """Solve it, with the stiffness of the last solve if ``keeps_stiffness`` and that has a
        solution; a tangent that Cholesky's factorisation refuses is factorised as LDL^T.  A
        ConvergenceError or MatrixError says how it ends.
        """
        if keeps_stiffness:
            self._keeps, solved = True, False
            try:
                with suppress(MatrixError):
                    solved = not self.attempt()
            finally:
                self._keeps = False
            if solved:
                return
            self._inputs_before = None
            self.bend()
        refused = False
        try:
            why = self.attempt()
            opens = self.status is Status.OPEN and bool(self.task.idle)
            if self._curved and (opens or self.status in _WITHOUT_SETS):
                # What nothing presses on any more has no tractions that turn.
                self.curvature = NodalStiffness.none(self.curvature.blocks.shape[1])
                self.relative = None
                why = self.attempt()
        except MatrixError as error:
            if error.fault != NOT_POSITIVE:
                raise
            why = error.fault
            refused = True
        if self.definite and (
            refused or (why and self.status in (Status.SINGULAR, Status.LINEAR_SOLVER))
        ):
            self.definite, self._inputs_before = False, None
            self.history.add("the tangent is not positive definite: it is factorised as LDL^T")
            why = self.attempt()
        if why:
            raise ConvergenceError(self, why)

    @property
    def _curved(self) -> bool:
        """Whether tractions that turn are in the tangent; collective."""
        curved = bool(self.curvature.nodes.size or self.curvature.joint)
        return parallel.any_rank(self.space.mesh.comm, curved)

    def _far_points(self, boundary: ContactBoundary) -> tuple[Flags, fem.Function] | None:
        """Which points are farther from their shapes than an increment may bring them, shape (n,),
        and the displacement of now; None: none is.  The dense matrix of a body in 3D on one rank
        does without them; the next iteration has those that are inside of their shapes.
        """
        state = self._turning
        values = self.at.x.array
        dim = boundary.x.shape[1]
        plain = (
            boundary.averages.shares.nnz == boundary.size > 0
            and boundary.moving is None
            and not boundary.paired
        )
        known = state is not None and state.boundary.size == boundary.size
        if dim != 3 or boundary.comm.size > 1 or self.residual is None or not plain or not known:
            return None
        assert state is not None
        distance = np.full(boundary.size, -np.inf)
        added = np.zeros(len(self.places))
        for number, moving in self.foundations.moving.items():
            points = np.flatnonzero(boundary.part == number)
            nodes, added[moving.nodes] = boundary.nodes[points], moving.added
            distance[points] = (
                moving.shape.distance(boundary.x[points] + self.places[nodes])[0] + added[nodes]
            )
        # As far as shapes are inside, supports move now, or the last increment has moved anything.
        fixed, to = self.prescribed
        increments = [np.abs(to - values)[fixed], -distance[np.isfinite(distance)]]
        if self._last_values is not None:
            increments.append(np.abs(values - self._last_values))
        near = state.in_contact | (state.bound > 0.0)  # a shear may act without contact
        near |= distance <= RETAINED_REACH * max(moved.max(initial=0.0) for moved in increments)
        if self._near is not None and self._near.size == near.size:
            near |= self._near
        near[distance.argmin()] = True  # a dense matrix of nothing is none
        self._near = near
        self._last_values = values.copy()
        return None if near.all() else (~near, self.at)

    def leave_open(self, status: Status) -> None:
        """Make the displacement of now, without any contact, the last result, of a solve with this
        end; collective.
        """
        with options_applied(*self.options):
            begun = self.begun = self.begin_step()
        nowhere = np.zeros(self.boundary.size)
        sets = ActiveSets.of(nowhere > 0, np.zeros_like(begun.data.mu_hat), nowhere)
        newton = self.task.newton
        self.task.begin_step(begun)
        newton.pose(begun.data, sets)
        x = self.task.system.unknowns(self.elastic.unknowns(self.at))
        newton.restore((x, newton.problem.sets, newton.problem.data))
        self.take(
            Outcome(status, newton, begun.data, augmented=self.task.settings.algorithm == "alm")
        )

    def settled(self) -> State:
        """The end of the last linear problem at the displacement of the nonlinear one, whose
        residual has been judged.
        """
        assert self.last is not None
        remembered = [pair.remembered() for pair in self.foundations.sliding.values()]
        self.last = replace(
            self.last,
            fields=reduce(or_, remembered, dict(self.last.fields)),
            displacement=self.at.x.array.copy(),
            rigid=self.foundations.coordinates.copy(),
            placed=self.foundations.placed,
        )
        return self.last

    @property
    def step(self) -> int:
        """How many steps have ended."""
        return self.begin.number

    def begin_at_solution(self, state: State) -> None:
        """Assemble the contact problem at the end of a step that an earlier run has solved;
        collective.
        """
        self.foundations.carry_to(state.rigid)
        try:
            self._begin_at_tangent(definite=True)
        except MatrixError as error:
            if error.fault != NOT_POSITIVE:
                raise
            self._begin_at_tangent(definite=False)

    def take_tractions(self, state: State) -> None:
        """Make those of the end of a step, in the frames of now, those of the last result, as the
        last linear problem of the step had another displacement than its end.
        """
        assert state.contact is not None
        values = state.contact
        rotation = rotations(values.normal, self.boundary.normal)
        _, (pressure, shear) = in_frames(values, rotation, self.boundary)
        self._state = replace(self.state, pressure=pressure, shear=shear)

    def _begin_at_tangent(self, *, definite: bool, symmetric: bool = True) -> None:
        """Assemble the contact problem of now; collective."""
        self.begin_anew()
        self.definite, self.symmetric = definite, symmetric
        self.slide()
        self._inputs_before = None
        with options_applied(*self.options):
            self.begun = self.begin_step()

    def assembled_elsewhere(self) -> LinearisedProblem:
        """A copy to be assembled in its place; the next solve of this one assembles anew."""
        self._inputs_before, other = None, copy(self)
        other.foundations = copy(self.foundations)
        return other

    def derivative_at(self, begin: State) -> tuple[Any, ...]:
        """The last solution, of a step that has begun at a state, with the derivative of its
        contact problem there, see ``SolvedStep.of``; collective.
        """
        self.begin = begin
        outcome = self.outcome
        solved = self.state
        symmetric = self.symmetric
        assert outcome is not None
        self.bend()
        curvature = curvature_of(self._hessians, solved, symmetric=False)
        sheared = bool((curvature != curvature.transpose(0, 2, 1)).any())
        if parallel.any_rank(self.space.mesh.comm, sheared):
            joint = self.foundations.stiffness_at_corners(solved)
            self.curvature = NodalStiffness.summed(solved.boundary.nodes, curvature, joint)
            symmetric = False
        self._begin_at_tangent(definite=self.definite, symmetric=symmetric)
        state = replace(solved, boundary=self.boundary)
        # Of displacements along the normal there are none.
        slips = np.pad(
            turned_slips(self.boundary, self._hessians, self._way()), ((0, 0), (0, 0), (1, 0))
        )
        turning = curvature, slips, self.foundations.spin_at(self.boundary, self.begin.placed)
        return self.elastic, self.task, outcome, self.begun, state, self.at, self.begun.law, turning

    def data_now(
        self, solved: FormSolver | None = None, begun: State | None = None
    ) -> tuple[Any, ...]:
        """Minus the residual in place of the forms, with what supports prescribe, and the motion of
        shapes at contact points in the step; ``begun``: the end of the last step; None: that here.
        """
        kept = self.at.x.array.copy()
        at = self.at.x.array
        fixed, supports = prescribed(self.space, conditions_of(self.bcs, self.space))
        at[fixed] = supports[fixed]
        try:
            values, boundary, gap, law = self.contact_now(solved)
            motion = self.foundations.motion_at(boundary, self.begin if begun is None else begun)
            if (residual := self._evaluated.at(at.copy())) is None:
                raise FormError.at("F", "is not finite beside the solution")
            return [], -residual, values, boundary, gap, law, motion
        finally:
            at[:] = kept
            self._evaluated.go_to(kept)

    @property
    def loose(self) -> list[int]:
        """The numbers of the assemblies that nothing presses on in the last outcome; collective."""
        task = self.task
        state = self.state
        pressed = np.asarray(np.column_stack((state.pressure, state.shear)).any(axis=1))
        return task.motions.untouched(task.idle, pressed)

    def internal(self, increment: Array) -> tuple[Array, Array, float]:
        """What a(d, .), where no support prescribes d, and the curvature alone are, shapes (owned
        dofs,), and the work of the forces that normals which turn relative to tools, and springs of
        tools, exert on increments; collective.
        """
        elastic = self.elastic
        work = 0.0
        if self.rigid.bodies:
            moved = self.rigid.unknowns(self.rigid_bodies) - self.foundations.coordinates
            springs = np.where(self.rigid.fixed, 0.0, self.rigid.stiffness)
            work += float(springs @ moved**2)
            if elastic.relative is not None:
                on_tools = elastic.relative_forces(increment, moved)[1]
                work += float(2 * on_tools @ moved + moved @ elastic.relative[1] @ moved)
        held = elastic.forces_of(np.where(self.prescribed[0], increment, 0.0))
        return (
            elastic.forces_of_free(increment) + held,
            self.curvature.times(increment, self.space),
            work,
        )

    def show_again(self, solved: LinearisedProblem | None) -> None:
        """Make an earlier solution, None: none, what the user sees; shapes stay where they are, but
        for those that forces move; collective.
        """
        self._state = self.outcome = self.last = None
        if solved is not None:
            self._state, self.outcome, self.last = solved._state, solved.outcome, solved.last
        self.fields.take(self.space, self._state)
        self.foundations.carry_to((self.last or self.begin).rigid)
        self._turning = self._state
        self._inputs_before = None
        self._straighten()

    # --- what the verdict on stability asks for ---

    def sticks(self, state: ContactState) -> Flags:
        """Which points friction has held, in contact or by a bound without it, shape (n,)."""
        part = state.boundary.part
        rough = np.array(
            [entry.friction is not None or entry.bonded for entry in self.contact], dtype=bool
        )[part]
        acts = state.in_contact | (state.bound > 0.0)
        return rough & acts & (state.direction == 0.0).all(axis=1)
