"""The contact problem of one iteration of Newton's method, for the whole displacement y.

    a(y, z) = a(u, z) - F(u; z),    a = F'(u) - lambda Hess phi + what turns the shear,

with the gaps and normals of the shapes at X + u.  The right-hand side is assembled from a and F as they are compiled:
a form a(u, .) - F(u; .) would get a quadrature degree of its own, and Newton's method the residual of that.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import copy
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from dolfinx import fem

from signorini_fx.algebra.algorithms.loose import idle, untouched
from signorini_fx.algebra.algorithms.task import Outcome, Start
from signorini_fx.algebra.contact.active_sets import ActiveSets
from signorini_fx.algebra.contact.complementarity import RegularisedData
from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.algebra.linalg.condensed import CondensedSystem
from signorini_fx.algebra.linalg.elasticity import LoadCase
from signorini_fx.algebra.linalg.factorisation import enough_memory, factor_memory
from signorini_fx.algebra.method import Settings
from signorini_fx.errors import FormError
from signorini_fx.forms import options
from signorini_fx.forms.arguments import conditions_of, settings_of
from signorini_fx.forms.elasticity import NOT_POSITIVE, NOT_SYMMETRIC, MatrixError, elastic_body
from signorini_fx.forms.given_forms import given_forms
from signorini_fx.forms.nonlinear.arguments import slides
from signorini_fx.forms.nonlinear.moving_pairs import MovingPair, held_between, joint_stiffness, spins_of, turned_forces
from signorini_fx.forms.nonlinear.moving_shapes import (
    MovingShape,
    curvature_of,
    fitting,
    hessians_at,
    left_by_turning,
    motion_at,
    slips_by_displacements,
    spin_at,
)
from signorini_fx.forms.nonlinear.moving_tools import DisplacedRigidBodies, MovingTools, RelativeStiffness
from signorini_fx.forms.nonlinear.residual import Residual
from signorini_fx.forms.nonlinear.retained_points import RetainedPoints
from signorini_fx.forms.nonlinear.state import State
from signorini_fx.forms.nonlinear.tangent import round_off
from signorini_fx.forms.solver import FormSolver, StepBeginning
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.averages import averaging
from signorini_fx.mechanics.assembly.mesh_entities import node_positions
from signorini_fx.mechanics.assembly.nodal_stiffness import JointStiffness, NodalStiffness
from signorini_fx.mechanics.body.elastic_body import ElasticBody
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.contact_points.turned_supports import TurnedNodes
from signorini_fx.mechanics.loads.supports import prescribed
from signorini_fx.mechanics.obstacles.foundations_on_points import (
    FoundationData,
    Foundations,
    NodalFriction,
    ShapeDistances,
)
from signorini_fx.mechanics.obstacles.paired_points import PairedSides
from signorini_fx.mechanics.obstacles.sliding_sides import SlidingSides
from signorini_fx.mechanics.rigid.rigid_bodies import Drive, RigidBodies, RigidBodyMotion
from signorini_fx.mechanics.scales import Scales
from signorini_fx.records import Status
from signorini_fx.results.certificate.certificate import Certificate
from signorini_fx.results.certificate.law_of_method import Law
from signorini_fx.results.solution import ConvergenceError
from signorini_fx.tuned import (
    NO_FORCE,
    UNITS_OF_NO_LOAD,
)

Array = npt.NDArray[np.float64]


class MovingFoundations(Foundations):
    """Foundations whose shapes are seen from displaced points.

    Attributes:
        sliding: the pairs, by their numbers.
        shapes_of_tools: of the foundations, where they are, by their numbers.
        at: the displacement of now.
    """

    sliding: Mapping[int, MovingPair]
    shapes_of_tools: Mapping[int, MovingShape] = MappingProxyType({})
    at: fem.Function
    _undeformed: dict[int, tuple[list[bytes], PairedSides]]

    @property
    def settled(self) -> dict[int, Any]:
        """The shapes as they were at the end of the last step."""
        return {number: moving.settled for number, moving in self.shapes_of_tools.items()}

    @settled.setter
    def settled(self, shapes: dict[int, Any]) -> None:
        for number, shape in shapes.items():
            self.shapes_of_tools[number].settled = shape

    def settle(self) -> None:
        """See ``Foundations``."""
        self.settled = {number: moving.shape for number, moving in self.shapes_of_tools.items()}

    @property
    def kept_pairs(self) -> dict[int, PairedSides]:
        """Pairs that keep their partners, where they are undeformed, by their numbers."""
        return {number: sides for number, (_, sides) in self._undeformed.items()}

    @property
    def driven(self) -> list[Any]:
        shapes = {k: moving.shape for k, moving in self.shapes_of_tools.items() if moving.driven}
        return [shapes.get(k) for k in range(len(self._contact))]

    @property
    def rigid_bodies(self) -> RigidBodies:
        """See ``Foundations``: at the displaced points."""
        bodies = super().rigid_bodies
        if not bodies.bodies:
            return bodies
        return DisplacedRigidBodies(bodies.bodies, bodies.kinematics, bodies.length, self.at)

    def measured(self, shape: Any) -> bool:
        """See ``Foundations``: along the axis of a body of revolution alone, as forces around it cancel."""
        return bool(getattr(shape.prescribed, "x", None) == 0.0)

    def sides_of(self, number: int, fixed: npt.NDArray[np.bool_], at_rest: npt.NDArray[np.bool_]) -> SlidingSides:
        """Both sides of a pair, for the arguments see ``boundary``; collective.

        Raises:
            FormError: see ``SlidingSides``.
        """
        facing = self.facing(number, self.factor_of(number), fixed, None, at_rest)
        return SlidingSides.of(self._space, self._contact[number].reach, facing, number)

    def _paired(
        self,
        number: int,
        factor: Array | None,
        fixed: npt.NDArray[np.bool_],
        turned: TurnedNodes | None,
        at_rest: npt.NDArray[np.bool_] | None,
    ) -> ContactBoundary:
        """See ``Foundations``: where both sides are now, if they slide; else as they are paired where they are
        undeformed, and, unless they are tied, with the normals of now.
        """
        if number in self.sliding:
            return self.sliding[number].boundary()
        facts = [values.tobytes() for values in (fixed, at_rest, factor) if values is not None]
        last = self._undeformed.get(number)
        if parallel.any_rank(self._space.mesh.comm, last is None or facts != last[0]):
            super()._paired(number, factor, fixed, turned, at_rest)
            last = self._undeformed[number] = facts, self._pairs[number]
        assert last is not None
        paired, flags = last[1], fixed.reshape(-1, self._dimension)
        if not self._contact[number].bonded:
            paired = paired.deformed(self._space, self.at.x.array.reshape(-1, self._dimension)[: len(flags)])
        self._pairs[number] = paired
        return paired.boundary(self._space, self.facets[number], number, flags)

    def law(
        self, boundary: ContactBoundary, modulus: float, friction: Sequence[NodalFriction] | None = None
    ) -> PointFriction | None:
        """See ``Foundations``: a point that does not see the other side has none, not even one without pressure."""
        law = super().law(boundary, modulus, friction)
        return law if law is None else law.without_points(self._alone(boundary))

    def problem(
        self, boundary: ContactBoundary, data: Sequence[FoundationData], settings: Settings, scales: Scales
    ) -> tuple[RegularisedData, PointFriction | None]:
        """See ``Foundations``: a point that does not see the other side is not held at it, either."""
        regularised, law = super().problem(boundary, data, settings, scales)
        return replace(regularised, bilateral=regularised.bilateral & ~self._alone(boundary)), law

    def _alone(self, boundary: ContactBoundary) -> npt.NDArray[np.bool_]:
        """Which contact points do not see the other side of their pair, shape (n,)."""
        alone = np.zeros(boundary.size, dtype=bool)
        for number, pair in self.sliding.items():
            alone[boundary.part == number] = pair.alone
        return alone

    def _gap_of(self, number: int) -> tuple[Array, Array | None]:
        if (pair := self.sliding.get(number)) is None:
            return super()._gap_of(number)
        allowance = self._values[number](self._contact[number].allowance, f"contact[{number}].allowance")
        gap = allowance.copy()
        pair.allowance = allowance[: pair.allowance.size]
        gap[pair.sides.local_points()] += pair.opening
        return gap, allowance


class LinearisedProblem(FormSolver):
    """The contact problem of one iteration.

    Args:
        tangent: F', a compiled form.
        residual: F, a compiled form.
        evaluated: F at the displacement, with the loads beside it.
        at: the displacement where both are evaluated.
        bilinear: F' in UFL where it is the same at all displacements; else None.
        bcs, contact, boundaries, settings: see ``ContactProblem``.

    Raises:
        FormError: a tool is not possible.

    Attributes:
        stated: the foundations and pairs as they were given; ``contact`` has gaps and directions in place of shapes.
        shapes: of the foundations that have one, by their numbers.
        extent: of the mesh, the diagonal of its box, length.
        curvature: what the shapes add to the tangent.
        symmetric: whether the tangent has been symmetric so far.
        residual: F at the displacement of now, less the loads; None: it has not been assembled yet.
        several: see ``Start``.
        bodies: see ``BodyPieces``.
    """

    symmetric = True
    residual: Array | None = None
    several = False
    bodies: tuple[str, ...] = ()
    _retained: RetainedPoints
    _keeps = False  # whether the next solve keeps the stiffness of the last one
    _round_off: float | None = None  # see ``_lost``, of the present load
    _foundations_class = MovingFoundations
    foundations: MovingFoundations

    def __init__(
        self,
        tangent: fem.Form,
        residual: fem.Form,
        evaluated: Residual,
        at: fem.Function,
        bilinear: Any,
        bcs: Any,
        contact: Any,
        *,
        petsc_options_prefix: str,
        petsc_options: Mapping[str, Any],
        boundaries: Mapping[str, Any] | None = None,
        **settings: Any,
    ) -> None:
        increment, self.stated, self._at = fem.Function(at.function_space), contact, at
        self._bilinear = bilinear
        self.shapes = dict[int, MovingShape]()
        self._gaps = {k: entry.gap for k, entry in enumerate(contact) if entry.shape is not None}
        seen = [entry if entry.shape is None else self._seen(k, entry) for k, entry in enumerate(contact)]
        forms, increment = given_forms(tangent, residual, seen, increment, boundaries=boundaries)
        super().__init__(
            forms,
            increment,
            conditions_of(bcs, forms.space),
            settings_of(settings),
            (petsc_options_prefix, petsc_options),
        )
        self._evaluated, self._definite, mesh = evaluated, True, at.function_space.mesh
        self._retained = RetainedPoints(at)
        dim = mesh.geometry.dim
        self.curvature, self._hessians = NodalStiffness.none(dim), np.zeros((0, dim, dim))
        self.relative: RelativeStiffness | None = None
        self._diameter = super()._size()
        bounds = parallel.global_bounds(mesh.comm, mesh.geometry.x.astype(np.float64))
        self.extent = float(np.linalg.norm(np.ptp(bounds, axis=0)))
        foundations = self.foundations
        self.shapes |= {k: self._shape_of(k, entry) for k, entry in enumerate(contact) if entry.shape is not None}
        foundations.at, foundations.sliding, foundations.shapes_of_tools = at, {}, self.shapes
        foundations._undeformed = {}
        foundations.check_driven()

    def _bilinear_form(self) -> Any:
        """See ``FormSolver``: moduli of other tangents depend on the displacement."""
        return self._bilinear

    def _seen(self, number: int, entry: Any) -> Any:
        """A foundation with a shape as the linearised problem has it: a gap and a direction."""

        def seen() -> tuple[Array, Array]:
            moving = self.shapes[number]
            moving.added = self._added_to_distance(number)
            return moving.projected_onto(self.places[moving.nodes])

        return replace(entry, shape=None, gap=lambda x: seen()[0], direction=lambda x: seen()[1].T)

    def _shape_of(self, number: int, entry: Any) -> MovingShape:
        """The shape of a foundation at its nodes."""
        space, nodes = self.space, self.foundations.nodal_values(number).nodes
        dim, turns = space.mesh.geometry.dim, entry.measure is None and not averaging(space)
        shape = fitting(number, entry.shape, dim, turns=turns)
        self.foundations.check_shape(number, shape)
        x = node_positions(space)[nodes, :dim].astype(np.float64)
        return MovingShape(shape, shape, self._added_to_distance(number), nodes, x, turns)

    def _added_to_distance(self, number: int) -> Array:
        """The gap of a foundation with a shape as it is now, at its nodes, length, shape (n,); collective."""
        values = self.foundations.nodal_values(number)
        return values(self._gaps[number], f"contact[{number}].gap")[values.nodes]

    def give_gap(self, number: int, gap: Any) -> None:
        """Another gap of a contact, see ``Foundations.give_gap``; beside a shape what is added to its distance."""
        if number in self._gaps:
            self._gaps[number] = gap
        else:
            self.foundations.give_gap(number, gap)

    @property
    def places(self) -> Array:
        """Displacements of the nodes, shape (nodes, d)."""
        return self._at.x.array.reshape(-1, self._at.function_space.mesh.geometry.dim)

    @property
    def moving_tools(self) -> MovingTools:
        """The tools where they are."""
        return MovingTools(self.foundations.rigid_bodies, self.foundations.shapes_of_tools)

    @property
    def pairs(self) -> Mapping[int, MovingPair]:
        """The sides that slide on each other by the numbers of their contacts, once a solve has begun."""
        return self.foundations.sliding

    @property
    def _one_body(self) -> bool:
        """Whether no contact is one of two bodies."""
        return all(entry.against is None for entry in self.contact)

    @property
    def reached(self) -> Array:
        """The coordinates of tools in the last outcome, lengths, shape (t, m), see ``MovingTools``."""
        length, now = self.rigid.length, self.moving_tools.coordinates
        moved = [np.append(tool.translation, length * tool.rotation) for tool in self.tools]
        return np.array(moved, dtype=np.float64).reshape(now.shape)

    @property
    def driven_tools(self) -> list[tuple[RigidBodyMotion, Drive]]:
        """Where tools are, and what drives them."""
        tools = self.moving_tools
        return [*zip(tools.motions, tools.bodies.drives(), strict=True)]

    def slide(self) -> None:
        """Renew the maps of pairs at the displacement of now; collective.

        Raises:
            PairingError: a facet sees two sheets of the other side.
            FormError: two sides do not fit together, or do not see each other although their contact cannot open.
        """
        numbers = [k for k, entry in enumerate(self.contact) if slides(entry)]
        if numbers and not self.pairs:
            fixed, values = prescribed(self.space, conditions_of(self.bcs, self.space))
            at_rest, owned = self.foundations.at_rest(fixed, values), self.space.dofmap.index_map.size_local
            owned *= self.space.dofmap.index_map_bs
            sides = {k: self.foundations.sides_of(k, fixed[:owned], at_rest[:owned]) for k in numbers}
            pairs = {k: MovingPair(both) for k, both in sides.items()}
            reason = "no point of its side sees the other one within the reach: nothing would hold both together"
            unseen = [k for k, pair in pairs.items() if not pair.coupling.frames.partnered.any()]
            if apart := [(f"contact[{k}].bilateral", reason) for k in unseen if self.contact[k].bilateral]:
                raise FormError(apart)
            self.foundations.sliding = pairs
        for pair in self.pairs.values():
            pair.move(self._at)

    def bend(self) -> None:
        """Give the tangent the curvature of the shapes with the tractions of the last solution; collective."""
        if (state := self._state) is None:
            return
        hessians = hessians_at(state.boundary, self.shapes, self.places, self.extent)
        nodal = blocks = curvature_of(hessians, state)
        self._hessians, tools, self.relative = hessians, self.moving_tools, None
        if tools.there:
            self.relative = tools.relative_stiffness(state, blocks, self.places)
            nodal = np.where((self.relative.tool >= 0)[:, None, None], 0.0, blocks)
        joint = joint_stiffness(self.pairs, state)
        if turning := self._turned_forces(state):
            both_ways = (JointStiffness(part.nodes, sp.csr_array(part.matrix + part.matrix.T)) for part in turning)
            joint = (*joint, *both_ways)
        self.curvature = NodalStiffness.summed(state.boundary.nodes, nodal, joint)

    def _turned_forces(self, state: ContactState) -> list[JointStiffness]:
        """See ``turned_forces``, for each pair that keeps its partners; collective."""
        space, places = self.space, self.places[: self.space.dofmap.index_map.size_local]
        return [turned_forces(state, k, paired, space, places) for k, paired in self._turning_pairs.items()]

    @property
    def _turning_pairs(self) -> dict[int, PairedSides]:
        """Pairs that keep their partners without being tied, where they are undeformed, by their numbers."""
        return {k: paired for k, paired in self.foundations.kept_pairs.items() if not self.contact[k].bonded}

    # --- what a FormSolver asks for ---

    def begin_step(self) -> Start:
        """See ``FormSolver``; slips of points that stick are linearised as their tangent planes turn."""
        state = self._state
        begun = self._from_pairs(super().begin_step())
        if self.task.motions.count:
            begun = replace(begun, several=self.several)
            if self._last is None:
                self.task.iterate.newton.begin_at(self.task.system.start)
            else:
                self._last.taken_up(self.task, self.elastic, self.rigid)
        boundary, tools, origin = self.boundary, self.moving_tools, begun.data.slip_origin
        places = self.places[boundary.nodes] - tools.at_points(boundary)
        way = self._way()
        if tools.there:  # their slips are counted from where a step has begun by their finite motion
            begins = np.einsum("nij,ni->nj", boundary.tangents, places - way)
            origin = np.where((tools.touching(boundary) >= 0)[:, None], begins, origin)
            begun = replace(begun, data=replace(begun.data, slip_origin=origin))
        if state is None or not len(self._hessians) == boundary.size == state.boundary.size:
            return begun
        slip = np.einsum("nij,ni->nj", boundary.tangents, places) - origin
        slip -= np.einsum("nij,nik,nk->nj", boundary.tangents, state.boundary.cotangents, state.slip_length)
        turned = left_by_turning(boundary, self._hessians, way, slip)
        origin = origin + np.where(self._sticks[:, None], turned, 0.0)
        return replace(begun, data=replace(begun.data, slip_origin=origin))

    def _way(self) -> Array:
        """Of contact points relative to shapes since the step has begun, length, shape (n, d); what forces have moved
        these by is not in it.
        """
        boundary, previous = self.boundary, self.previous_step
        dim, nodes = boundary.x.shape[1], boundary.nodes
        if previous is None:
            return self.places[nodes]
        earlier = previous.displacement.x.array.reshape(-1, dim)[nodes]
        return np.asarray(self.places[nodes] - earlier - (0.0 if previous.moved is None else previous.moved))

    def _from_pairs(self, begun: Start) -> Start:
        """With the slips of pairs counted from where their step has begun."""
        if not self.pairs:
            return begun
        origin = begun.data.slip_origin.copy()
        for number, pair in self.pairs.items():
            rows = self.boundary.part == number
            origin[rows] = np.einsum("nij,ni->nj", self.boundary.tangents[rows], pair.slip_origin)
        return replace(begun, data=replace(begun.data, slip_origin=origin))

    def _body(self, fixed: npt.NDArray[np.bool_], boundary: ContactBoundary) -> ElasticBody:
        """See ``FormSolver``: a tangent that is not definite is factorised whole.  Its contact problem may have no
        solution: then a smaller increment of the load is what helps, not another method.
        """
        indefinite = {"linear_algebra": "full", "fallbacks": False}
        definite = self._definite and self.symmetric
        settings = self.settings if definite else self.settings.model_copy(update=indefinite)
        beside: dict[str, Any] = {"beside": self.curvature, "definite": definite, "symmetric": self.symmetric}
        last, comm = self.__dict__.get("elastic"), self.space.mesh.comm
        if not parallel.any_rank(comm, last is None or not np.array_equal(last.fixed, fixed)):
            assert last is not None
            beside["of_body"] = last.of_body if self._keeps else last.of_supports
            if self._keeps and isinstance(self.task.system, CondensedSystem):
                beside["eliminated"] = self.task.system.schur
        if self.relative is not None and len(self.relative.blocks) == boundary.size:
            beside["relative"] = self.relative.blocks
        if self._one_body and definite:
            beside["far"] = self._retained.far_points(boundary, self._state, self.shapes, self.prescribed)
        try:
            points = boundary if self.contact else None
            return elastic_body(self.space, self.forms.compiled[0], self.bcs, fixed, points, settings, **beside)
        except MatrixError as error:
            if error.fault != NOT_SYMMETRIC:
                raise
        self.symmetric = False
        self.history.add("the tangent is not symmetric: it is factorised as LU")
        return self._body(fixed, boundary)

    def _forces(self) -> Array:
        return self.elastic.forces_where_free(self._at) - self._residual_now

    def _set_up(self, shapes: Sequence[ShapeDistances]) -> tuple[RegularisedData, PointFriction | None]:
        """See ``FormSolver``; displacements are counted from the initial position, whatever holds the body."""
        data = super()._set_up(shapes)
        self.task = replace(self.task, rest=None)
        return data

    def _case(self, values: Array) -> LoadCase:
        """See ``FormSolver``: with what relative displacements meet; only the residual and what drives tools do work on
        free motions, and round-off of theirs is none.
        """
        case, elastic = super()._case(values), self.elastic
        if elastic.motions.free.size:
            driven = self.rigid.driven_together
            driving = None if driven is None else driven.forces
            resultant = elastic.motions.load_of(-self._residual_now, elastic.comm, driving)
            case = replace(case, resultant=replace(resultant, size=resultant.size + self._lost / NO_FORCE))
        if elastic.relative is None or self.relative is None:
            return case
        dim, fixed, moved = self.boundary.x.shape[1], self.prescribed[0], self.moving_tools.coordinates
        driven = self.rigid.driven_together
        assert driven is not None
        free_tools = ~self.rigid.fixed.reshape(moved.shape)
        held_at = np.where(free_tools, 0.0, driven.motion.reshape(moved.shape))
        away = self._at.x.array - np.where(fixed, values, 0.0)
        forces, on_tools, _ = self.relative.forces(self.boundary, away.reshape(-1, dim), moved - held_at)
        at_nodes = np.zeros((elastic.fixed.size // dim, dim))
        np.add.at(at_nodes, self.boundary.nodes, forces)
        added, load = np.where(elastic.fixed, 0.0, at_nodes.ravel()), case.load.getArray()
        load[: added.size] += added
        if elastic.comm.rank == elastic.comm.size - 1:
            load[added.size : added.size + moved.size] += np.where(free_tools, on_tools, 0.0).ravel()
        return case

    def _beside(self) -> Sequence[npt.NDArray[Any]]:
        pairs = [values for pair in self.pairs.values() for values in pair.fingerprint]
        joint = [part.matrix.data for part in self.curvature.joint]
        tools = [] if self.relative is None else [self.relative.blocks]
        if self.rigid.bodies:  # arms change with both
            tools += [self.moving_tools.coordinates, self._at.x.array]
        elif not self._one_body and len(self.pairs) < sum(entry.against is not None for entry in self.contact):
            tools += [self._at.x.array]  # which normals follow
        return self.curvature.nodes, self.curvature.blocks, np.asarray(self._evaluated.loads), *pairs, *joint, *tools

    def _size(self) -> float:
        """See ``FormSolver``: that of the body before it is deformed."""
        return self._diameter

    def _moved(self, boundary: ContactBoundary) -> Array | None:
        return motion_at(boundary, self.shapes, self._begun_places, self.places)

    @property
    def _begun_places(self) -> Array:
        """Displacements of the nodes at the end of the last step, shape (nodes, d)."""
        if self._last is None:
            return np.zeros_like(self.places)
        return self._last.before.displacement.x.array.reshape(self.places.shape)

    def _spin(self, boundary: ContactBoundary) -> Array | None:
        return spins_of(self.pairs, boundary, spin_at(boundary, self.shapes))

    def _judged(self, outcome: Outcome) -> None:
        """None: the solution of the nonlinear problem gets one."""
        return None

    @property
    def _residual_now(self) -> Array:
        """F less the loads at the displacement of now, forces of shape (owned dofs,); collective."""
        return self._evaluated.assembled() if self.residual is None else self.residual

    @property
    def _lost(self) -> float:
        """What round-off may make of the resultant of the residual, force; collective."""
        if self._round_off is None:
            values, free = self._at.x.array.copy(), ~self.elastic.fixed
            lost = round_off(self._at, self._residual_now, self._evaluated.at)
            self._evaluated.go_to(values)
            self._round_off = UNITS_OF_NO_LOAD * float(parallel.global_sum(self.space.mesh.comm, lost[free].sum()))
        return self._round_off

    # --- one iteration ---

    def begin_anew(self) -> None:
        """A new load: the tangent is definite until a factorisation refuses it."""
        self._definite, self._round_off = True, None
        self._retained.begin_anew()

    @property
    def can_keep_stiffness(self) -> bool:
        """Whether another solve may have the stiffness of the last one: it has no unknowns of rigid bodies."""
        return not self.rigid.bodies and self.relative is None and self.set_up

    def solve(self, *, keeps_stiffness: bool = False) -> None:
        """Solve it; a tangent that Cholesky's factorisation refuses is factorised as LDL^T; collective.

        Args:
            keeps_stiffness: whether the body has the stiffness of the last solve, with the residual and the contact
                points of now, if that has a solution.

        Raises:
            ConvergenceError: there is no solution.
            MatrixError: the tangent is not finite, or not symmetric.
        """
        if not (keeps_stiffness and self._solve_with_last_stiffness()):
            self._solve()

    def _solve_with_last_stiffness(self) -> bool:
        """Whether the contact problem has a solution with the stiffness of the last one, which is solved; else the
        tangent is that of now again; collective.
        """
        self._keeps = True
        try:
            solved = not self.attempt()
        except MatrixError:
            solved = False
        finally:
            self._keeps = False
        if not solved:
            self._last_pattern = None
            self.bend()
        return solved

    def _solve(self) -> None:
        """See ``solve``, without what shears pass on; collective."""
        try:
            why = self.attempt()
            curved = bool(self.curvature.nodes.size or self.curvature.joint)
            if self.status is Status.OPEN and idle(self.task) and parallel.any_rank(self.space.mesh.comm, curved):
                # What nothing presses on any more has no tractions that turn.
                self.curvature = NodalStiffness.none(self.curvature.blocks.shape[1])
                why = self.attempt()
        except MatrixError as error:
            if error.fault != NOT_POSITIVE:
                raise
        else:
            if not why:
                return
            if not self._definite or self.status not in (Status.SINGULAR, Status.LINEAR_SOLVER):
                raise ConvergenceError(self, why)
        self._definite, self._last_pattern = False, None
        self.history.add("the tangent is not positive definite: it is factorised as LDL^T")
        if why := self.attempt():
            raise ConvergenceError(self, why)

    def attempt(self) -> str:
        with self._retained.chosen():
            return super().attempt()

    def _outcome_of_now(self) -> Outcome:
        """See ``FormSolver``: once more with more points if one has touched that was taken to be far."""
        outcome = super()._outcome_of_now()
        if not self._retained.suffice(self.elastic.far, self.begun, outcome):
            self._last_pattern = None
            self.begun = self.begin_step()
            outcome = super()._outcome_of_now()
        return outcome

    def leave_open(self, status: Status) -> None:
        """Make the displacement of now, without any contact, the last result; collective.

        Args:
            status: how the solve has ended that it is the result of.
        """
        with options.applied(*self.options):
            begun = self.begun = self.begin_step()
        nowhere = np.zeros(self.boundary.size)
        sets = ActiveSets.of(nowhere > 0, np.zeros_like(begun.data.mu_hat), nowhere)
        newton = self.task.iterate.newton
        self.task.iterate.begin_step(begun)
        newton.pose(begun.data, sets)
        counted = self._at.copy()
        if (resting := self.task.rest) is not None:
            counted.x.array[:] -= self.elastic.motions.displacement(resting.motion).ravel()
        x = self.task.system.unknowns(self.elastic.unknowns(counted))
        newton.restore((x, newton.problem.sets, newton.problem.data))
        self.show(Outcome(status, newton, begun.data), None)

    @property
    def step(self) -> int:
        """How many steps have ended."""
        return 0 if self._last is None else self._last.start.step

    @property
    def definite(self) -> bool:
        """Whether the tangent is taken to be positive definite."""
        return self._definite

    def begin_at_tangent(self, *, definite: bool, symmetric: bool) -> None:
        """Assemble the contact problem at the displacement of now, as in the last iteration of an earlier run;
        collective.

        Args:
            definite: see ``definite``, in that run.
            symmetric: see ``symmetric``, in that run.

        Raises:
            MatrixError: see ``solve``.
            PairingError: see ``slide``.
            FormError: a value is not finite.
        """
        self.begin_anew()
        self._definite, self.symmetric = definite, symmetric
        self.slide()
        self._last_pattern = None
        with options.applied(*self.options):
            self.begun = self.begin_step()

    def assembled_elsewhere(self) -> LinearisedProblem:
        """A copy to be assembled in its place; the next solve of this one assembles anew."""
        self._last_pattern = None
        return copy(self)

    @contextmanager
    def returned_to(self, beginning: StepBeginning) -> Iterator[None]:
        """While it is where a step begins, whatever has been advanced since."""
        advanced = self.beginning()
        self.return_to(beginning)
        try:
            yield
        finally:
            self.return_to(advanced)

    def derivative_at_solution(self) -> tuple[Any, ...]:
        """The last solution with the derivative of its contact problem there, see ``SolvedStep.of``, and the problem of
        that; collective.

        The derivative of a shear that turns is not symmetric.  All contact points take part.

        Raises:
            MatrixError: see ``solve``.
        """
        outcome, solved, symmetric = self.outcome, self.state, self.symmetric
        assert outcome is not None
        self.residual = None
        self.bend()
        curvature = curvature_of(self._hessians, solved, symmetric=False)
        sheared = bool((curvature != curvature.transpose(0, 2, 1)).any())
        if parallel.any_rank(self.space.mesh.comm, sheared):
            self.curvature, symmetric = NodalStiffness.summed(solved.boundary.nodes, curvature, ()), False
        self.begin_at_tangent(definite=self.definite, symmetric=symmetric)
        state, at = replace(solved, boundary=self.boundary), (self._hessians, self._way(), self.places, self.extent)
        slips = slips_by_displacements(self.boundary, self.shapes, *at)
        turning = curvature, slips, self._spin(self.boundary)
        return self.elastic, self.task, outcome, self.begun, state, self._at, self.law_now(), turning

    def data_now(self, solved: FormSolver | None = None, begun: Array | None = None) -> tuple[Any, ...]:
        """See ``FormSolver``; and no drives of rigid bodies, and how far shapes have moved at contact points in the
        load step: all at the displacement of now with what supports prescribe, by which contact points move, too.

        Args:
            solved: see ``FormSolver``.
            begun: the displacement at the end of the last step, its values; None: that of the last step here.
        """
        kept, at = self._at.x.array.copy(), self._at.x.array
        fixed, supports = prescribed(self.space, conditions_of(self.bcs, self.space))
        at[fixed] = supports[fixed]
        try:
            *data, boundary, gap, law = super().data_now(solved)
            begins = self._begun_places if begun is None else begun.reshape(self.places.shape)
            return (*data, boundary, gap, law, None, motion_at(boundary, self.shapes, begins, self.places))
        finally:
            at[:] = kept
            self._evaluated.go_to(kept)

    def _forms_and_forces(self) -> tuple[list[fem.Form], Array]:
        """See ``FormSolver``: no form, and minus the residual at the displacement of now.

        Raises:
            FormError: the residual is not finite there.
        """
        if (residual := self._evaluated.at(self._at.x.array.copy())) is None:
            raise FormError([("F", "is not finite beside the solution")])
        return [], -residual

    def accept(self, outcome: Outcome) -> None:
        """Take an outcome of an earlier run for that of the contact problem of now; collective."""
        origin = outcome.data.slip_origin
        self.begun = replace(self.begun, data=replace(self.begun.data, slip_origin=origin))
        self.show(outcome, None)

    @property
    def loose(self) -> list[int]:
        """The numbers of the assemblies that nothing presses on in the last outcome; collective."""
        task, state = self.task, self.state
        pressed = np.asarray(np.column_stack((state.pressure, state.shear)).any(axis=1))
        return untouched(task.motions, idle(task), pressed)

    def internal(self, displacement: fem.Function) -> tuple[Array, Array, float]:
        """What a(d, .), where no support prescribes d, and the curvature alone are, shapes (owned dofs,), and the work
        of the forces that normals which turn relative to tools, and springs of tools, exert on increments; collective.
        """
        work = 0.0
        if self.rigid.bodies:
            moved = self.reached - self.moving_tools.coordinates
            springs = np.where(self.rigid.fixed, 0.0, self.rigid.stiffness)
            work += float(springs @ moved.ravel() ** 2)
            if self.relative is not None:
                nodal = displacement.x.array.reshape(-1, self.boundary.x.shape[1])
                work += self.relative.forces(self.boundary, nodal, moved)[2]
        return self.elastic.forces_where_free(displacement), self.curvature.times(displacement), work

    def state_now(self, certificate: Certificate | None, iterations: int) -> State:
        """What there is now."""
        shapes, tools = {k: moving.shape for k, moving in self.shapes.items()}, self.moving_tools.coordinates
        solution = self._state, self.outcome, self._solution
        return State(self._at.x.array.copy(), *solution, certificate, iterations, shapes, tools)

    def go_back(self, state: State) -> None:
        """Make an earlier solution the last one; shapes stay where they are placed, but for those that forces move; the
        next solve assembles anew; collective.
        """
        self._at.x.array[:] = state.displacement
        self.fields.take(self.space, state.contact)
        self._state, self.outcome, self._solution = state.contact, state.outcome, state.guess
        self.moving_tools.carry_to(state.tools)
        dim = self._at.function_space.mesh.geometry.dim
        self._last_pattern, self.curvature, self._hessians = None, NodalStiffness.none(dim), np.zeros((0, dim, dim))
        self.relative = None

    # --- what the certificate and the verdict on stability ask for ---

    @property
    def law(self) -> Law:
        """That the last solution keeps to."""
        assert self.outcome is not None
        return Law(*self.task.promised(self.outcome))

    @property
    def _sticks(self) -> npt.NDArray[np.bool_]:
        """Which contact points friction has held in the last solution, in contact or by a bound that needs no pressure,
        shape (n,).
        """
        part, state = self.state.boundary.part, self.state
        rough = np.array([entry.friction is not None or entry.bonded for entry in self.contact], dtype=bool)[part]
        acts = state.in_contact | (state.bound > 0.0)
        return np.asarray(rough & acts & (state.direction == 0.0).all(axis=1))

    @property
    def held(self) -> Array:
        """The directions that contact with shapes holds at each contact point, zero where it holds none, shape (n, d,
        d).
        """
        assert self.outcome is not None
        boundary = self.state.boundary
        alone = ~np.isin(boundary.part, [k for k, entry in enumerate(self.contact) if entry.against is not None])
        normal = boundary.normal[:, None, :] * (self.state.in_contact & alone)[:, None, None]
        tangents = boundary.tangents.transpose(0, 2, 1) * (self._sticks & alone)[:, None, None]
        return np.concatenate((normal, tangents), axis=1)

    @property
    def holding(self) -> list[JointStiffness]:
        """What contact holds between the sides of pairs, see ``SlidingSides``; collective."""
        sticks = self._sticks
        sliding = [pair.holding(self.state, sticks) for pair in self.pairs.values()]
        paired = [k for k, entry in enumerate(self.contact) if entry.against is not None and k not in self.pairs]
        return [*sliding, held_between(self.state, paired, sticks)] if paired else sliding

    @property
    def factor_fits(self) -> bool:
        """Whether the machines have the memory for a factor of the tangent; collective."""
        size = self.elastic.system_size
        return enough_memory(size.comm, factor_memory(size.unknowns, size.dimension))
