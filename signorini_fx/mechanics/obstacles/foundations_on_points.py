"""The foundations and pairs of a problem on their contact points: weights, frames, gap and
friction.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from operator import attrgetter
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.algebra import Settings
from signorini_fx.algebra.contact.complementarity import RegularisedData
from signorini_fx.algebra.contact.friction import PointFriction, as_given
from signorini_fx.arrays import Array, Flags, Indices, Ints, Value, diagonal, inner
from signorini_fx.errors import FormError, SceneError
from signorini_fx.extensions import is_of_package
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.averages import Averages, averaging, from_owners
from signorini_fx.mechanics.assembly.mesh_entities import facet_cells, node_positions
from signorini_fx.mechanics.assembly.nodal_values import NodalValues
from signorini_fx.mechanics.assembly.pieces import find_pieces
from signorini_fx.mechanics.contact_points.contact_boundary import (
    ContactBoundary,
    contact_part,
    join,
    no_points,
    nodal_points,
    unit_contact_form,
)
from signorini_fx.mechanics.interfaces import Foundation, Pair, PlacedShape
from signorini_fx.mechanics.kinematics import CARTESIAN
from signorini_fx.mechanics.laws.at_points import fault_of, friction_of, joined
from signorini_fx.mechanics.laws.coulomb import Coulomb
from signorini_fx.mechanics.laws.directed import DirectedLaw, FrictionAxes
from signorini_fx.mechanics.laws.protocol import FrictionLaw
from signorini_fx.mechanics.rigid.rigid_bodies import RigidBodies
from signorini_fx.mechanics.scales import Scales
from signorini_fx.mechanics.statement.rigid_body import RigidMotion, driven_twice, rigid_bodies
from signorini_fx.mechanics.statement.rigid_shape import (
    Corners,
    Distance,
    Placement,
    Shape,
    SignedDistance,
    corners_of,
    distance_from,
)
from signorini_fx.mechanics.statement.rigid_shape import fault_of as fault_of_shape
from signorini_fx.mechanics.statement.settings import SolverSettings
from signorini_fx.tuned import DIGITS_OF_FILES, ROOT_OF_EPS, SAME_NUMBER

if TYPE_CHECKING:
    from signorini_fx.mechanics.contact_points.turned_supports import TurnedNodes
    from signorini_fx.mechanics.obstacles.paired_points import FacingSides, PairedSides
    from signorini_fx.mechanics.obstacles.shapes_inside import BodyCells


@dataclass(frozen=True)
class ShapeDistances:
    """Properties of one foundation that determine its contact points, at all nodes of this rank,
    nan where it has no facet.

    Attributes:
        factor: factor of the surface measure, shape (nodes,); None: 1.
        direction: contact direction n, of length one, shape (nodes, d); None: the outward normal.
        axes: the axes of anisotropic friction; None: friction has no axes.
    """

    factor: Array | None
    direction: Array | None
    axes: FrictionAxes | None = None


@dataclass(frozen=True)
class FoundationData:
    """The nodal values of one foundation on this rank: its shape data, its friction law, None if it
    has none, and the gap d, length, nan where it has no facet.
    """

    shape: ShapeDistances
    law: FrictionLaw | None
    gap: Array


class Foundations:
    """The foundations and pairs of a problem on one space; the slave side of a pair carries its
    points.

    All methods are collective.

    ``facets``: the facets of each foundation or slave, owned, local numbers; ``names``: the name of
    each contact in its form; ``masters``: the facets of the opposite side of each pair, by its
    number among the contacts.
    """

    def __init__(
        self,
        space: fem.FunctionSpace,
        contact: Sequence[Foundation | Pair],
        facets: Sequence[Indices],
        names: Sequence[str],
        masters: Mapping[int, Indices],
    ) -> None:
        self._space = space
        self._contact = contact
        self.facets = facets
        self._names = names
        self._masters = masters
        self._pairs: dict[int, PairedSides] = {}
        # Shapes that are not inside the body, by their numbers.
        self._outside = dict[int, SignedDistance]()
        self._values = [NodalValues(space, boundary_facets) for boundary_facets in facets]
        self._dimension = int(space.mesh.geometry.dim)
        self.dt = 0.0  # duration of the present load step, time; 0: it has none
        self._distances = self._shaped()

    def _shaped(self) -> dict[int, Distance]:
        """Return the distance functions of foundations that have a shape, by their numbers."""
        distances = {}
        problems = list[tuple[str, str]]()
        for k, contact in enumerate(self._contact):
            if contact.shape is None:
                continue
            if contact.direction is not None:
                problems.append(
                    (
                        f"contact[{k}].direction",
                        "follows from the shape: remove `direction`",
                    )
                )
            try:
                distances[k] = distance_from(
                    contact.shape, self._dimension, turns=contact.measure is None
                )
            except SceneError as error:
                problems += [
                    (f"contact[{k}].shape.{key}".rstrip("."), reason)
                    for key, reason in error.problems
                ]
                continue
            x = node_positions(self._space)[self._values[k].nodes, : self._dimension]
            self._refuse(f"contact[{k}].shape", fault_of_shape(distances[k].shape, x, self._length))
        if problems:
            raise FormError(problems)
        return distances

    def _refuse(self, path: str, fault: str) -> None:
        """Raise a FormError on all ranks if any rank has a fault; "" means none."""
        parallel.raise_together(self._space.mesh.comm, FormError.at(path, fault) if fault else None)

    @cached_property
    def _length(self) -> float:
        """The size of the body: the diagonal of its bounding box, length; collective."""
        mesh = self._space.mesh
        bounds = parallel.global_bounds(
            mesh.comm, mesh.geometry.x[:, : self._dimension].astype(np.float64)
        )
        return diagonal(bounds)

    @property
    def driven(self) -> list[Shape | None]:
        """The shape of each contact whose rigid body has unknown motion (moved by forces); None for
        others.
        """
        shapes = map(self.placed_shape, range(len(self._contact)))
        return [shape if isinstance(shape, Shape) and shape.driven else None for shape in shapes]

    def placed_shape(self, number: int) -> SignedDistance | None:
        """Return the shape of a contact at its present place; None if it has none."""
        return getattr(self._distances.get(number), "shape", None)

    @property
    def rigid_bodies(self) -> RigidBodies:
        """The rigid bodies that forces move."""
        bodies = rigid_bodies(self.driven, self._names)
        return RigidBodies(bodies, CARTESIAN[self._dimension], self._length if bodies else 1.0)

    def check_driven(self) -> None:
        """Check foundations that forces move, and bonds, for combinations that are not supported.

        Raises:
            FormError: a combination is not supported.
        """
        problems = []
        for k, (contact, shape) in enumerate(zip(self._contact, self.driven, strict=True)):
            tied = contact.bonded and contact.against is None
            if tied and not shape:
                problems.append(
                    (
                        f"contact[{k}].kind",
                        "'bonded' needs a shape that force, moment or prescribed moves",
                    )
                )
            if shape is None:
                continue
            if contact.measure is not None and not self.measured(shape):
                problems.append(
                    (
                        f"contact[{k}].measure",
                        "is not possible yet where a force moves the foundation",
                    )
                )
            if shape.timed or shape.driven_in_time:
                problems.append((f"contact[{k}].shape", "depends on t: give numbers, and place()"))
            if reason := driven_twice(self.driven, k):
                problems.append((f"contact[{k}].shape.rigid", reason))
        if problems:
            raise FormError(problems)

    def measured(self, shape: SignedDistance) -> bool:
        """Return whether a force may move this shape although its contact has a measure; here
        never.
        """
        return False

    def place(self, number: int, placement: Mapping[str, npt.ArrayLike | None]) -> None:
        """Place the shape of a foundation anew: rotation and shift count from its initial place.

        Raises:
            FormError: the foundation has no shape that can be placed, or the placement is invalid.
        """
        path = f"contact[{number}].shape"
        shape = self.placed_shape(number)
        driven = self.driven
        if not isinstance(shape, Shape):
            raise FormError.at(path, "this foundation has no shape that can be placed")
        if driven[number] is not None and (wrong := set(placement) - set(RigidMotion.model_fields)):
            raise FormError(
                [
                    (
                        f"{path}.{key}",
                        (
                            "cannot be changed: its loads or prescribed components "
                            "move this foundation"
                        ),
                    )
                    for key in wrong
                ]
            )
        try:
            placed = shape.remade(**placement)
            moved = distance_from(placed, self._dimension)
        except SceneError as error:
            raise FormError([(f"{path}.{key}", reason) for key, reason in error.problems]) from None
        driven[number] = placed
        if reason := driven_twice(driven, number):
            raise FormError.at(f"{path}.rigid", reason)
        self._put(number, moved)

    def _put(self, number: int, distance: Distance) -> None:
        """Replace the distance function of a contact."""
        self._distances[number] = distance

    @property
    def placed_shapes(self) -> list[PlacedShape]:
        """The shapes of all foundations that are not bonded, at their present place."""
        return [
            PlacedShape(f"contact[{k}].shape", k, at.shape, self._contact[k].gap)
            for k, at in self._distances.items()
            if not self._contact[k].bonded
        ]

    def change(self, number: int, **values: Any) -> None:
        """Replace the gap or the friction law of a contact."""
        contact = list(self._contact)
        contact[number] = replace(contact[number], **values)
        self._contact = contact

    @property
    def placed(self) -> tuple[Placement | None, ...]:
        """The present shift and rotation of the shape of each contact; None if it cannot be
        placed.
        """
        return tuple(
            getattr(self.placed_shape(k), "placement", None) for k in range(len(self._contact))
        )

    def moved_shapes(self, placed: Sequence[Placement | None]) -> dict[int, tuple[Shape, Shape]]:
        """Return the shapes whose placement has changed, by their numbers, each with its earlier
        version.

        ``placed``: the earlier placements.
        """
        shapes = map(self.placed_shape, range(len(placed)))
        moved = {}
        for number, (shape, placement) in enumerate(zip(shapes, placed, strict=True)):
            if isinstance(shape, Shape) and placement is not None:
                earlier = shape.placed_as(placement)
                if earlier is not shape:
                    moved[number] = shape, earlier
        return moved

    def moved(self, boundary: ContactBoundary, placed: Sequence[Placement | None]) -> Array | None:
        """Return the displacements of shapes, except those that forces move, at the contact points
        since the placements ``placed``, length, shape (n, d); None if no shape has moved.
        """
        driven = self.driven
        moved = {k: shapes for k, shapes in self.moved_shapes(placed).items() if not driven[k]}
        if not moved:
            return None
        displacements = np.zeros_like(boundary.x)
        for number, (shape, earlier) in moved.items():
            on_part = boundary.part == number
            displacements[on_part] = shape.moved_from(earlier, boundary.x[on_part])
        return displacements

    @cached_property
    def forms(self) -> list[tuple[fem.Form | None, fem.Function | None]]:
        """The unit contact form of each foundation and the function of the measure in it; (None,
        None) for pairs and averaged displacements.
        """
        forms = list[tuple[fem.Form | None, fem.Function | None]]()
        for contact, facets in zip(self._contact, self.facets, strict=True):
            if contact.against is not None or averaging(self._space):
                forms.append((None, None))
                continue
            function = None if contact.measure is None else fem.Function(self._space)
            factor = None if function is None else function[0]
            forms.append((unit_contact_form(self._space, facets, factor), function))
        return forms

    def factor_of(self, number: int) -> Array | None:
        """Return the factor of the measure of one contact at all nodes of this rank, shape
        (nodes,); None: 1; collective.

        Raises:
            FormError: it is negative or not finite somewhere.
        """
        measure = self._contact[number].measure
        if measure is None:
            return None
        factor = self._values[number](measure, f"contact[{number}].measure", minimum=0.0)
        largest = parallel.largest(self._space.mesh.comm, np.nan_to_num(factor))
        return np.where(factor <= SAME_NUMBER * largest, 0.0, factor)  # round-off is zero

    def shapes(self) -> list[ShapeDistances]:
        """Return the present directions, measures and friction axes of all contacts.

        Raises:
            FormError: a direction or a measure is invalid somewhere.
        """
        shapes = []
        for k, (contact, at) in enumerate(zip(self._contact, self._values, strict=True)):
            factor = self.factor_of(k)
            direction = None
            axes = None
            if isinstance(contact.friction, DirectedLaw):
                axes = contact.friction.axes(
                    at, f"contact[{k}].friction", self._dimension, self._space.mesh.comm
                )
            along = self._distances[k].direction if k in self._distances else contact.direction
            if along is not None:
                direction = at(along, f"contact[{k}].direction", self._dimension)
                size = np.hypot.reduce(direction, axis=1, keepdims=True)
                if parallel.any_rank(self._space.mesh.comm, size == 0):
                    raise FormError.at(f"contact[{k}].direction", "is zero somewhere")
                direction = direction / size
            shapes.append(ShapeDistances(factor, direction, axes))
        return shapes

    def boundary(
        self,
        shapes: Sequence[ShapeDistances],
        fixed: Flags,
        at_rest: Flags,
        turned: TurnedNodes | None = None,
    ) -> ContactBoundary:
        """Return the contact points: weights, frames and positions.

        ``fixed``: flags of the owned dofs that are prescribed, shape (owned dofs,); at ``turned``
        nodes in
            their own frames.
        ``at_rest``: see the method ``at_rest``; ghosts may be included.
        """
        parts = []
        for k, shape in enumerate(shapes):
            if k in self._masters:
                part = self._paired(k, shape.factor, fixed, turned, at_rest)
            else:
                part = self._rigid_points(k, shape, fixed, turned)
            if shape.axes is not None:
                axes = shape.axes.at(part.nodes)
                part = replace(part, friction_axes=axes)
                movable = partial(attrgetter("points.movable"), part)
                axes.check(part.normal, movable, f"contact[{k}].friction", part.comm)
            parts.append(part)
        return join(parts) if parts else no_points(self._space)

    def points(
        self, shapes: Sequence[ShapeDistances], fixed: Flags, values: Array
    ) -> ContactBoundary:
        """Return the contact points with the unknowns of rigid bodies.

        ``fixed``, ``values``: which dofs are prescribed, and to which values, ghosts included.
        """
        owned = self._space.dofmap.index_map.size_local * self._dimension
        return self.rigid_bodies.on(
            self.boundary(shapes, fixed[:owned], self.at_rest(fixed, values))
        )

    def _rigid_points(
        self,
        number: int,
        shape: ShapeDistances,
        fixed: Flags,
        turned: TurnedNodes | None,
    ) -> ContactBoundary:
        """Return the contact points of a rigid foundation."""
        space = self._space
        facets = self.facets[number]
        form, function = self.forms[number]
        if function is not None and shape.factor is not None:
            function.x.array.reshape(-1, function.function_space.dofmap.bs)[:, 0] = np.nan_to_num(
                shape.factor
            )
        if form is None:
            from signorini_fx.mechanics.obstacles.paired_points import averaged_points

            gap = self._gap_of(number)
            points, averages = averaged_points(space, facets, shape.factor, fixed, gap)
        else:
            points = nodal_points(space, form, 0.0 if shape.factor is None else SAME_NUMBER)
            nodes = points[0]
            names = space.dofmap.index_map.local_to_global(points[0])
            x = node_positions(space)[nodes, : self._dimension]
            held = fixed.reshape(-1, self._dimension)[nodes]
            averages = Averages.at_nodes(names, x, held)
        part = contact_part(space, points, averages, facets, number, turned)
        if shape.direction is not None:
            part = replace(part, normal=shape.direction[part.nodes])
            return self._with_corners(number, part, shape.factor, fixed, turned)
        if shape.factor is not None:
            on_axis = (
                shape.factor[part.nodes, None] == 0
            )  # all around the tip of a cone the mean of normals is axial
            axial = np.where(on_axis & (np.arange(part.normal.shape[1]) == 0), 0.0, part.normal)
            size = np.linalg.norm(axial, axis=1, keepdims=True)
            along = np.where(size > ROOT_OF_EPS, axial / np.maximum(size, ROOT_OF_EPS), part.normal)
            return replace(part, normal=along)
        return part

    def _with_corners(
        self,
        number: int,
        part: ContactBoundary,
        factor: Array | None,
        fixed: Flags,
        turned: TurnedNodes | None,
    ) -> ContactBoundary:
        """Return the contact points of a rigid foundation, including those at its corners;
        collective.
        """
        corners = self.corners_of(number)
        if corners is None or turned is not None:
            return part
        from signorini_fx.mechanics.obstacles.corner_points import (
            BoundaryLine,
            CornerFeet,
            with_corners,
        )

        line = BoundaryLine.of(self._space, self.facets[number], self.displacement)
        feet = CornerFeet.of(line, corners)
        return with_corners(part, corners, line, feet, fixed, factor, self._length)

    @property
    def displacement(self) -> Array | None:
        """The displacement at which corners are projected onto the body, at the nodes of this rank,
        length, shape (nodes, d); None: undeformed.
        """
        return None

    def corners_of(self, number: int) -> Corners | None:
        """Return the corners of a 2D foundation that get contact points, or None; collective.

        There are none if the contact is bonded or bilateral, if forces move the foundation, if
        friction is not proportional to pressure alone (a corner has no area for a bound on stress),
        or if the boundary is on several pieces of the mesh.
        """
        contact = self._contact[number]
        if self._space.mesh.topology.dim != 2:
            return None
        law = contact.friction
        by_pressure = law is None or (type(law) is Coulomb and len(law.parameters) == 1)
        if (
            contact.bonded
            or contact.bilateral
            or self.driven[number] is not None
            or not by_pressure
        ):
            return None
        corners = corners_of(self.placed_shape(number), 2)
        if corners is None or not corners.places.size or self._on_pieces[number] > 1:
            return None
        return corners

    @cached_property
    def _on_pieces(self) -> list[int]:
        """The number of connected pieces of the mesh on which each contact boundary lies;
        collective.
        """
        mesh = self._space.mesh
        of_cell = find_pieces(mesh).of_cell
        found = [of_cell[facet_cells(mesh, facets), None] for facets in self.facets]
        return [np.unique(parallel.gather_rows(mesh.comm, pieces)).size for pieces in found]

    def at_rest(self, fixed: Flags, values: Array) -> Flags:
        """Return the flags of dofs that are prescribed to be zero; all False without pairs, which
        alone use them.
        """
        return fixed & (values == 0) & bool(self._masters)

    def _paired(self, number: int, *known: Any) -> ContactBoundary:
        """Return the contact points of a pair.

        ``known``: the further arguments of ``facing``.
        """
        from signorini_fx.mechanics.obstacles.paired_points import PairedSides

        pair = self._contact[number]
        facing = self.facing(number, *known)
        assert isinstance(pair, Pair)
        self._pairs[number] = PairedSides.from_facing(facing, pair)
        return self._pairs[number].boundary()

    def facing(
        self,
        number: int,
        factor: Array | None,
        fixed: Flags,
        turned: TurnedNodes | None,
        at_rest: Flags,
    ) -> FacingSides:
        """Return both sides of a contact before they are paired.

        ``factor``: factor of its measure; for the other arguments see ``boundary``.
        """
        from signorini_fx.mechanics.obstacles.paired_points import FacingSides

        sides = (self.facets[number], self._masters[number])
        flags = fixed.reshape(-1, self._dimension)
        rests = at_rest.reshape(-1, self._dimension)[: len(flags)]
        # A node that two contacts share carries the point of the foundation or of the earlier pair.
        first = (
            k for k, contact in enumerate(self._contact) if k < number or contact.against is None
        )
        taken = [self.facets[k] for k in first if k != number]
        return FacingSides.of(self._space, sides, number, flags, taken, turned, rests, factor)

    def given_gap(self, number: int) -> Array:
        """Return the gap that the user prescribes for one contact, length, at all nodes of this
        rank; collective.
        """
        contact = self._contact[number]
        given = 0.0 if contact.bonded else contact.gap
        return self._values[number](given, f"contact[{number}].gap")

    def _gap_of(self, number: int) -> Array:
        """Return the gap of one contact at the nodes, length: prescribed value plus distance from
        the shape or the opposite side; the latter only at nodes with points.
        """
        contact = self._contact[number]
        gap = self.given_gap(number)
        pair = self._pairs.get(number)
        if number in self._distances:
            gap = gap + self._distance_of(number)
        if pair is not None and contact.by_geometry:
            distance = pair.coupling.gap
            if contact.adjust is not None:
                distance = np.where(
                    distance <= (1.0 + DIGITS_OF_FILES) * contact.adjust, 0.0, distance
                )
            gap[pair.sides.local(pair.coupling.nodes)] += distance
        return gap

    @cached_property
    def cells(self) -> BodyCells:
        """The cells of the body."""
        from signorini_fx.mechanics.obstacles.shapes_inside import BodyCells

        return BodyCells.of(self._space)

    def _distance_of(self, number: int) -> Array:
        """Return the signed distance from the shape of one contact, length, at all nodes of this
        rank; collective.

        Raises:
            FormError: the body lies inside the foundation, or the foundation inside the body.
        """
        comm = self._space.mesh.comm
        distance = self._distances[number]
        distances = self._values[number](distance, f"contact[{number}].shape")
        if not parallel.any_rank(comm, distances >= 0):
            at_vertices = distance(self._space.mesh.geometry.x.T.astype(np.float64))
            if not parallel.any_rank(comm, at_vertices >= 0):
                message = (
                    "the whole body is inside of the foundation: move it, set hollow if the body "
                    "belongs there, or "
                    "reverse the order of the points of a line, which has the body on its left"
                )
                raise FormError.at(f"contact[{number}]", message)
        if self._outside.get(number) == distance.shape:
            return distances
        if (swallowed := self.cells.swallowed(distance.shape)) is not None:
            at = ", ".join(f"{c:.4g}" for c in swallowed.at)
            message = (
                f"the foundation lies inside the body, at ({at}), beside its contact boundary: "
                "start with the shape outside the body; in load steps a nonlinear body may be "
                "pressed farther"
            )
            raise FormError.at(f"contact[{number}]", message)
        self._outside[number] = distance.shape
        return distances

    @property
    def pairs(self) -> dict[int, PairedSides]:
        """Return both sides of each pair, by its number among the contacts, once ``boundary`` has
        paired them.
        """
        return dict(self._pairs)

    def friction(self) -> list[FrictionLaw | None]:
        """Return the friction laws with their present values at all nodes of this rank; None for
        contacts without friction.

        Raises:
            FormError: a value is invalid somewhere.
        """
        laws = []
        for k, (contact, at) in enumerate(zip(self._contact, self._values, strict=True)):

            def nodal(
                key: str,
                value: Value,
                at: NodalValues = at,
                path: str = f"contact[{k}].friction",
            ) -> Array:
                return at(value, f"{path}.{key}", minimum=0.0)

            laws.append(None if contact.friction is None else contact.friction.with_values(nodal))
        return laws

    def data(self, shapes: Sequence[ShapeDistances]) -> list[FoundationData]:
        """Return the present gaps and friction laws of all contacts.

        Raises:
            FormError: a value is invalid somewhere.
        """
        laws = self.friction()
        return [FoundationData(shape, laws[k], self._gap_of(k)) for k, shape in enumerate(shapes)]

    def problem(
        self,
        boundary: ContactBoundary,
        data: Sequence[FoundationData],
        settings: SolverSettings,
        scales: Scales[float],
    ) -> tuple[RegularisedData, PointFriction | None]:
        """Return the regularised contact problem at the points, without shifts, and its friction
        law; the law is None where friction cannot act.
        """
        law = self.law(boundary, scales.modulus, [entry.law for entry in data])
        closed = [
            k for k, contact in enumerate(self._contact) if contact.bilateral or contact.bonded
        ]
        bilateral = np.isin(boundary.part, closed) & ~self.alone(boundary)
        gap = np.zeros(boundary.size)
        for k, entry in enumerate(data):
            on_part = np.flatnonzero(boundary.part == k)
            gap[on_part] = entry.gap[boundary.nodes[on_part]]
            if averaging(self._space) and k not in self._masters:
                averages = boundary.averages
                averages = replace(averages, shares=averages.shares[on_part])
                owned = np.nan_to_num(entry.gap[: self._space.dofmap.index_map.size_local, None])
                around = from_owners(owned, averages.nodes, boundary.comm)[:, 0]
                gap[on_part] = averages.of_gap(gap[on_part], around)
        if (corners := boundary.corners) is not None:
            moved = boundary.moved(self.displacement)
            ahead = inner(boundary.normal, moved)
            for k in range(len(data)):
                given = np.where(corners.alone, 0.0, boundary.interpolated(self.given_gap(k)))
                own = (boundary.part == k) & ~np.isnan(corners.opening)
                gap[own] = (corners.opening + given + ahead)[own]
        points = law, bilateral, boundary.points.immovable
        of_method = self._dimension - 1, Settings.of(settings), scales.gamma
        return RegularisedData.unshifted(gap, *of_method, *points), law

    def alone(self, boundary: ContactBoundary) -> Flags:
        """Return the flags of points without a partner, shape (n,), on which no contact or friction
        acts.
        """
        corners = boundary.corners
        return np.zeros(boundary.size, dtype=bool) if corners is None else corners.alone.copy()

    def law(
        self,
        boundary: ContactBoundary,
        modulus: float,
        friction: Sequence[FrictionLaw | None] | None = None,
    ) -> PointFriction | None:
        """Return the friction law at the points, for points that cannot move along their normal
        without pressure; None if no friction can act.

        ``modulus``: modulus of the body, stress: laws are tested for pressures up to it.
        ``friction``: the laws of the contacts; None: the present ones.

        Raises:
            FormError: a user's law violates its protocol.
        """
        if not any(entry.bonded or entry.friction is not None for entry in self._contact):
            return None
        parts = []
        points = [np.flatnonzero(boundary.part == k) for k in range(len(self._contact))]
        for k, (of_all, at) in enumerate(
            zip(self.friction() if friction is None else friction, points, strict=True)
        ):

            def at_points(_: str, values: Array, at: Ints = at) -> Array:
                return boundary.interpolated(values)[at]

            law = None if of_all is None else of_all.with_values(at_points)
            if law is not None and not is_of_package(type(law)):
                self._refuse(f"contact[{k}].friction", fault_of(law, at.size, modulus))
            parts.append(friction_of(law, at.size))
            if self._contact[k].bonded:
                parts[-1] = as_given(np.full(at.size, np.inf))
        together = joined(parts, points).without_pressure(boundary.points.immovable)
        return replace(together.without_points(self.alone(boundary)), dt=self.dt)

    def without_times(self) -> None:
        """Set the duration of the step to none.

        Raises:
            FormError: a friction law depends on the slip, whose rate needs a duration.
        """
        self.dt = 0.0
        reason = (
            "follows the slip, whose speed needs the duration of a step: solve by run, whose load "
            "steps have times"
        )
        laws = [contact.friction for contact in self._contact]
        wrong = [k for k, law in enumerate(laws) if law is not None and law.follows_slip]
        if wrong:
            raise FormError([(f"contact[{k}].friction", reason) for k in wrong])
