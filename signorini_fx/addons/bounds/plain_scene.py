"""A scene with its solution as plain arrays on triangles or tetrahedra: displacement, supports, contact."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import basix
import numpy as np
import numpy.typing as npt
from dolfinx import fem
from scipy.spatial import cKDTree

from signorini_fx.addons.bounds.applied_loads import Acting, PlaneLoads, SpatialLoads
from signorini_fx.addons.bounds.arrays import Array, Ints
from signorini_fx.addons.bounds.balanced_tractions import onto_disc
from signorini_fx.addons.bounds.biquadratic_cells import StrainBeyond, on_triangles
from signorini_fx.addons.bounds.bounded_scene import (
    APART,
    CLOSED_NO_MATCH,
    NO_MATCH,
    PARTLY_CLOSED,
    REFUSES_OF_PAIRS,
    SPRINGS_MOVED,
    TWICE_MET,
    BoundPoints,
    grounds,
    mass_of,
    moduli_of,
    refuse_unknown,
)
from signorini_fx.addons.bounds.common_refinement import CommonRefinement, FacetTractions
from signorini_fx.addons.bounds.facets import (
    NODES,
    POINTS,
    SEEN,
    TRIPLE,
    bernstein,
    coefficients,
    linear_below,
    times_linear,
)
from signorini_fx.addons.bounds.graded_moduli import graded_moduli
from signorini_fx.addons.bounds.initial_stress import free_strain, initial_stress
from signorini_fx.addons.bounds.matching_facets import MatchingFacets
from signorini_fx.addons.bounds.moving_tools import MovingTool, tools_of
from signorini_fx.addons.bounds.paired_parts import MASTER, SLAVE, PairedParts, pieces_of
from signorini_fx.addons.bounds.preloaded_sections import (
    JumpStrain,
    MovedCells,
    SectionJump,
    TightenedSection,
    preloaded_sections,
)
from signorini_fx.addons.bounds.round_foundations import RoundFacets, is_round
from signorini_fx.addons.bounds.round_off import of_strains
from signorini_fx.addons.bounds.simplices import EDGES_OF_FACET, Simplices, divide
from signorini_fx.addons.bounds.split_triangles import SplitTriangles, with_moved_nodes
from signorini_fx.addons.bounds.spring_facets import SpringFacets
from signorini_fx.addons.bounds.varying_springs import SpringComponent, SpringReaction, VaryingSprings
from signorini_fx.algebra.contact.points import pushed
from signorini_fx.machine import compat
from signorini_fx.mechanics.assembly.mesh_entities import facet_entities
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.effects.contact import Contact
from signorini_fx.mechanics.effects.displacement import PrescribedDisplacement
from signorini_fx.mechanics.effects.springs import Springs
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.pairs.mortar_coupling import closed_within
from signorini_fx.mechanics.statement.effect import Force
from signorini_fx.quantities.proved_statements import Grounds, Refused
from signorini_fx.tuned import SAME_DIRECTION, SAME_LENGTH, ZERO_IN_SOLUTION

# Values at both ends and in the middle of the linear function whose moments with linear ones are those that Simpson's
# rule has from nodal values.
_LINEAR: Array = np.array([[4, 4, -2], [1, 4, 1], [-2, 4, 4]]) / 6


@dataclass(frozen=True)
class OtherSide:
    """The facets of another body, one over each facet of a contact.

    Attributes:
        facets: shape (m,).
        order: of their vertices those over the first one, the second one and so on, shape (m, d).
        ratio: of the lengths of the facets of the contact to theirs, shape (m,).
        share: of a change of the jump that the side with the contact points takes, shape (m,).
    """

    facets: Ints
    order: Ints
    ratio: Array
    share: Array

    def vertices(self, t: Simplices) -> Ints:
        """Over those of the facets of the contact, shape (m, d)."""
        return np.take_along_axis(t.facets[self.facets], self.order, axis=1)

    def edges(self, t: Simplices) -> Ints:
        """Over the edges of the facets of the contact, shape (m, 1 or 3): in space each is opposite a vertex."""
        edges = t.edges_of_facets[self.facets]
        return edges if edges.shape[1] == 1 else np.take_along_axis(edges, self.order, axis=1)

    def over(self, values: Array) -> Array:
        """Values at the vertices of the facets, shape (m, d, ...), at those over the vertices of the contact."""
        return np.asarray(values[np.arange(len(self.order))[:, None], self.order])

    def under(self, values: Array) -> Array:
        """Values at the vertices of the contact, shape (m, d, ...), at the vertices of the facets."""
        return np.asarray(values[np.arange(len(self.order))[:, None], np.argsort(self.order, axis=1)])


@dataclass
class FacetsInContact:
    """The facets of one contact.

    Attributes:
        facets: of the cells, shape (m,).
        normal: to the foundation, shape (m, d).
        gap: at ``POINTS``, and coefficients of Bernstein of a quadratic below it, lengths, shapes (m, q) and
            (m, 3 or 6).
        below: see ``gap``.
        bound: g at ``POINTS``, stress, shape (m, q).
        pressure: p at the vertices, stress, shape (m, d).
        shear: mu at the vertices, perpendicular to the normal, stress, shape (m, d, d).
        least: a linear function of which |mu| is at most, at the vertices, stress, shape (m, d).
        bilateral: whether the contact cannot open: then the facets of one body are held along the normal, and
            ``pressure`` is zero; between two bodies it has any sign.
        before: coefficients of Bernstein of the displacement from which slip counts, length, shape (m, 3 or 6, d); zero
            in the first load step.
        opposite: those of the other body; None: the foundation is rigid.
        bonded: whether two bodies stay together; then ``least`` is infinite.
        round: what the foundation is where its distance is no polynomial: then ``normal`` is that of the middle,
            ``gap``, ``below``, pressure and shear are those of ``round_foundations``, the latter at vertices p and
            mu T, and ``least`` is a bound of |mu| |m|; None: ``normal`` is the same on all of a facet.
        refined: the triangles that the facets of both sides share where they do not match: then all that is of facets
            is of these, and ``facets``, and those of ``opposite``, are the ones that each triangle is on; None: they
            match.
        on_whole: then the tractions on whole facets.
    """

    facets: Ints
    normal: Array
    gap: Array
    below: Array
    bound: Array
    pressure: Array
    shear: Array
    least: Array
    before: Array
    bilateral: bool
    opposite: OtherSide | None = None
    bonded: bool = False
    round: RoundFacets | None = None
    refined: CommonRefinement | None = None
    on_whole: FacetTractions | None = None

    def area(self, of_facets: Array) -> Array:
        """Of the facets, or of the triangles on them, shape (m,); ``of_facets``: of all of the cells, shape (f,)."""
        return of_facets[self.facets] if self.refined is None else self.refined.area

    def press(self, pressure: Array, shear: Array) -> None:
        """Exchange the tractions, of facets at k vertices, shapes (f, k) and (f, k, d)."""
        if self.refined is not None and self.on_whole is not None:
            self.on_whole = replace(self.on_whole, pressure=pressure, shear=shear)
            pressure, shear = (self.refined.on_triangles(values) for values in (pressure, shear))
        self.pressure = np.broadcast_to(pressure, self.pressure.shape)
        self.shear = np.broadcast_to(shear, self.shear.shape)

    @property
    def traction(self) -> Array:
        """On the body at the vertices, stress, shape (m, d, d); of a quadratic one what has its moments with linear
        functions.
        """
        at_vertices = -self.pressure[:, :, None] * self.directions - self.shear
        return at_vertices if self.round is None else at_vertices - self._second_difference[:, None] / 6

    @property
    def missed(self) -> Array:
        """Mean squares of what this is not of the traction, stress squared, shape (m,)."""
        return np.asarray((self._second_difference**2).sum(axis=1) / 180)

    @property
    def _second_difference(self) -> Array:
        """Of the traction along facets in the plane, stress, shape (m, 2); elsewhere it is linear."""
        if self.round is None or self.normal.shape[1] == 3:
            return np.zeros_like(self.normal)
        turned = turn(self.round.direction)
        scaled = np.einsum("fad,fad->fa", self.shear, turned) / (turned**2).sum(axis=2)
        first, second = (np.diff(values, axis=1)[:, 0] for values in (self.pressure, scaled))
        return np.asarray(
            -first[:, None] * np.diff(self.round.direction, axis=1)[:, 0]
            - second[:, None] * np.diff(turned, axis=1)[:, 0]
        )

    @property
    def directions(self) -> Array:
        """To the foundation at the vertices, linear between them, shape (m, d, d)."""
        if self.round is not None:
            return self.round.direction
        return np.repeat(self.normal[:, None], self.normal.shape[1], axis=1)

    def excess(self, displacement: Array) -> Array:
        """Coefficients of Bernstein of what a displacement is beyond the foundation, length, shape (m, c).

        Args:
            displacement: its coefficients, see ``on_facets``.
        """
        if self.round is None:
            return np.einsum("fcd,fd->fc", displacement, self.normal) - self.below
        below = times_linear(np.ones((*self.below.shape[:1], self.normal.shape[1], 1)), self.below[:, :, None])
        return times_linear(self.round.direction, displacement) - below

    @property
    def ways_out(self) -> Iterator[tuple[int, int, int, Array, float]]:
        """For each coefficient of ``excess`` what changes it: 0 for a vertex or 1 for the middle of an edge, its place
        on the facet, the coefficient, the directions, shape (m, d), and the way of it along these per excess.
        """
        d, directions = self.normal.shape[1], self.directions
        for corner in range(d):
            yield 0, corner, corner, directions[:, corner], 1.0
        for edge, ends in enumerate(zip(*EDGES_OF_FACET[d].T, strict=True)):
            if self.round is None:  # twice the middle of an edge is what its coefficient of Bernstein has of it
                yield 1, edge, d + edge, self.normal, 0.5
                continue
            for column, end in enumerate(ends):
                yield 1, edge, d + 2 * edge + column, directions[:, end], 0.75
            if d == 3:  # all three edges change the coefficient inside
                yield 1, edge, 9, directions[:, edge], 0.5

    def work(self, area: Array, motions: Array) -> tuple[Array, Array]:
        """Of unit pressures and shears at the vertices on linear displacements, shapes (m, d, k) and (m, d, d, k); in
        space, where the pressure on a round foundation is constant, with one vertex.

        Args:
            area: of all facets, shape (f,).
            motions: at the vertices, relative to the other side, length, shape (m, d, d, k).
        """
        d, areas = self.normal.shape[1], self.area(area)
        if self.round is None:
            moments = areas[:, None, None, None] / (d * (d + 1)) * (motions + motions.sum(axis=1, keepdims=True))
            normal = -np.einsum("fadk,fd->fak", moments, self.normal)
            return normal, -(moments + np.einsum("fak,fd->fadk", normal, self.normal))
        if d == 3:
            moments = areas[:, None, None, None] / 12 * (motions + motions.sum(axis=1, keepdims=True))
            normal = -np.einsum("fadk,fad->fk", moments, self.round.direction)[:, None]
            return normal, np.zeros((len(areas), 1, d, motions.shape[3]))
        turned = turn(self.round.direction)
        of_pressure, of_shear = (
            -areas[:, None, None] * np.einsum("abc,fbd,fcdk->fak", TRIPLE, linear, motions)
            for linear in (self.round.direction, turned)
        )
        unit = turned / (turned**2).sum(axis=2, keepdims=True)
        return of_pressure, of_shear[:, :, None] * unit[..., None]

    @property
    def tangents(self) -> list[Array]:
        """One in the plane, two in space, orthonormal, shapes (m, d)."""
        if self.normal.shape[1] == 2:
            return [turn(self.normal)]
        first = np.cross(self.normal, np.eye(3)[np.abs(self.normal).argmin(axis=1)])
        first /= np.linalg.norm(first, axis=1)[:, None]
        return [first, np.asarray(np.cross(self.normal, first), dtype=np.float64)]


def turn(vectors: Array) -> Array:
    """Vectors of the plane by a right angle, shape (..., 2)."""
    return np.stack((-vectors[..., 1], vectors[..., 0]), axis=-1)


class PlainProblem:
    """A scene with its solution as plain arrays.

    Attributes:
        t: the cells; triangles of degree 2, and quadrilaterals, are divided.
        owner: the cell of the mesh that each of them is in, shape (n,).
        placed: the cells before those at the contact of two bodies are divided, with nodes where they have moved to.
        given_x: where these nodes were, length, shape (v, d).
        moved_nodes: square of the energy norm of what this takes of the displacement, an energy.
        beyond: what the displacement of quadrilaterals of degree 2 is beyond ``y`` and ``middle``, of one body; of two
            ``interpolated`` has it; None: nothing.
        flat: whether the sides of all pairs of bodies are parallel.
        y: the displacement at vertices, and at the middles of edges, length, shapes (v, d) and (e, d).
        middle: see ``y``.
        held: projectors onto the directions in which facets are held, by supports and by contact that cannot open,
            shape (f, d, d).
        supported: those of supports alone.
        springs: on facets, with the least stiffness of each; None: there are none.
        varying: what is more than that; None: nothing is.
        stopped: projectors onto the directions in which facets are held or on springs, shape (f, d, d).
        loads: what acts on the body.
        jump: what preloaded sections add to strains; None: nothing.
        grading: how moduli vary inside the cells; None: they do not.
        initial: the stress that initial strains take from it; None: there are none.
        tools: foundations that forces move.
        contacts: the contacts of the scene, in its order.
    """

    def __init__(
        self,
        model: Model,
        y: fem.Function,
        contact: ContactState | None,
        step: float,
        before: fem.Function | None = None,
    ) -> None:
        self._model, self._position, self._dimension = model, step, model.tagged.dimension
        self._statement = model.statement.placed(step)
        refuse_unknown(model)
        if contact is not None and pushed(contact.held_inside, model.tagged.size).any():
            raise Refused("supports push the body into its foundation")
        self._divide(y)
        self._match()
        self.jump = self._jumps(preloaded_sections(model, y.function_space, step))
        self._grade()
        self._before = self._begin_of_slip(contact, before)
        self.held: Array = np.zeros((len(self.t.facets), self._dimension, self._dimension))
        self._supports()
        self.supported = self._projectors()
        for effect in self._statement.contact:
            if not effect.opens and effect.against is None:
                facets, normal = self._towards(effect)
                self.held[facets] += normal[:, :, None] * normal[:, None]
        self.held = self._projectors()
        springs = [
            component
            for entry in self._statement.of(Springs)
            for component in SpringComponent.of(self.t, entry, self._facets(entry.boundary))
        ]
        self.springs = SpringFacets.of(self.t, self.held, springs)
        self.varying = VaryingSprings.of(self.t, self.held, springs)
        self.stopped = self.held if self.springs is None else self.springs.stopped(self.held)
        if self.sprung and self.moved_nodes > 0:
            raise Refused(SPRINGS_MOVED)
        acting, mass = (
            [self._statement.now(load, step) for load in self._statement.of(Force)],
            mass_of(model, self.owner),
        )
        forces = [
            Acting.of(self.t, factor, load, None if load.where is None else self._facets(load.where), mass)
            for factor, load in acting
            if factor != 0
        ]
        self.loads = (PlaneLoads if self._dimension == 2 else SpatialLoads)(self.t, self.held, forces)
        self.tools: list[MovingTool] = []
        if contact is not None and (bodies := self._statement.rigid_bodies):
            self.tools = tools_of(bodies, y, contact, self._statement.time_at(step), model.tagged.size)
        self.contacts = (
            []
            if contact is None
            else [
                self._on_tool(number, self._contact(number, effect, contact))
                for number, effect in enumerate(self._statement.contact)
            ]
        )

    @property
    def grounds(self) -> Grounds:
        """What all that is proved rests on."""
        return grounds(
            self._model,
            self._position,
            coulomb=self._model.statement.has_coulomb,
            later=self._before is not None,
            unknown=self.loads.unknown_share,
            flat=self.flat,
        )

    @property
    def sprung(self) -> tuple[SpringFacets | VaryingSprings, ...]:
        """All springs."""
        return tuple(part for part in (self.springs, self.varying) if part is not None)

    def reaction_of_springs(self, y: Array, middle: Array) -> PlaneLoads | SpatialLoads | None:
        """What ``varying`` exerts under a displacement, as a load; None: there is nothing."""
        if self.varying is None:
            return None
        reaction = SpringReaction(self.varying, self.on_facets(y, middle, self.varying.facets))
        return (PlaneLoads if self._dimension == 2 else SpatialLoads)(self.t, self.held, [reaction])

    def _divide(self, y: fem.Function) -> None:
        """Simplices of the cells, with degree 2 four of each triangle, and the displacement on them."""
        mesh, dofs, d = self._model.tagged.mesh, y.function_space.dofmap.list, self._dimension
        used, cells = np.unique(np.asarray(compat.geometry_cells(mesh), dtype=np.int64), return_inverse=True)
        x, cells = np.asarray(mesh.geometry.x[:, :d], dtype=np.float64)[used], cells.reshape(len(dofs), -1)
        if mesh.topology.cell_name() == "quadrilateral":
            across = x[cells[:, 0]] - x[cells[:, 1]] - x[cells[:, 2]] + x[cells[:, 3]]
            if np.abs(across).max() > SAME_LENGTH * self._model.tagged.size:
                raise Refused("a guaranteed bound is for quadrilaterals that are parallelograms: use triangles")
            corners = np.concatenate((cells[:, [0, 1, 3]], cells[:, [0, 3, 2]]))
        else:
            corners = cells
        owner: Ints = np.arange(len(corners)) % len(cells)
        turned = np.linalg.det(x[corners][:, 1:] - x[corners][:, :1]) < 0
        corners = np.where(turned[:, None], corners[:, [*range(d - 1), d, d - 1]], corners)
        t = Simplices(x, corners, moduli_of(self._model, owner))
        local = basix.topology(getattr(basix.CellType, mesh.topology.cell_name()))
        self._corners_of_facets, self._cells, self._edges_of_cells = np.array(local[d - 1]), cells, np.array(local[1])
        self.owner, self._undivided, self._parts, self.t = owner, t, np.arange(len(t.facets))[:, None], t
        self.y, self.middle = self._on_cells(y)
        self.beyond: StrainBeyond | None = None
        if d == 2 and self._degree_2(y):
            # The stress is linear: on four triangles it is as accurate as that of degree 2.
            self.t, self.y, self.middle, self._parts = divide(t, self.y, self.middle)
            self.owner = np.tile(owner, 4)
            if self._quadrilateral:
                nodal = y.x.array.reshape(-1, d)[dofs]
                self.y, self.middle, self.beyond = on_triangles(self.t, self.owner, x[cells], nodal)

    def _match(self) -> None:
        """Divide the triangles at the contact of two bodies, so that the facets of both sides match."""
        cells, pairs = self.t, self._model.pairs
        self._sides: list[tuple[int, PairedParts]] = []
        self._split: SplitTriangles | None = None
        self.moved_nodes, self.placed, self.given_x, self.flat = 0.0, cells, cells.x, True
        self._on_quadrilaterals = 0.0
        self._matching = dict[int, MatchingFacets]()
        self._refined = dict[int, CommonRefinement]()
        if not pairs:
            return
        if self._dimension == 3:
            self._match_in_space()
            return
        cells = replace(cells, parts=1)
        movable: npt.NDArray[np.bool_] = self._movable(cells)
        contacts = dict[int, PairedParts]()
        for number, pair in sorted(pairs.items()):
            surfaces = pair.slave.surface, pair.master.surface
            sides = [self._parts[self._undivided_facets(side.facets)] for side in (pair.slave, pair.master)]
            x, numbers = pieces_of(pair.coupling, *surfaces)
            facets = np.stack([sides[side][numbers[:, side]] for side in (SLAVE, MASTER)], axis=1)
            contacts[number] = PairedParts.of(cells, x, facets)
        placed_x: Array = cells.x
        for number, parts in contacts.items():
            contacts[number], changed = parts.moved(replace(cells, x=placed_x), movable)
            movable &= (changed == placed_x).all(axis=1)
            placed_x = changed
        placed = replace(cells, x=placed_x)
        self.y, self.middle, self.moved_nodes, _ = with_moved_nodes(cells, placed, self.y, self.middle)
        if self.beyond is not None:
            self._on_quadrilaterals, self.beyond = float(np.sqrt(self.beyond.squares.sum())), None
        self.placed, self._split = placed, SplitTriangles.of(placed, list(contacts.values()))
        self._sides = list(contacts.items())
        self.t, self.owner = self._split.t, self.owner[self._split.parent]
        self.y, self.middle = self._split.carried(self.y, self.middle)

    def _match_in_space(self) -> None:
        """The facets over each other, or else the triangles that those of flat parallel sides share: all that meet."""
        tiny = SAME_LENGTH * self._model.tagged.size
        for number, pair in sorted(self._model.pairs.items()):
            slave, master = (self._undivided_facets(side.facets) for side in (pair.slave, pair.master))
            matching = MatchingFacets.of(self.t, slave, master, tiny)
            area = float(self.t.area[matching.slave].sum())
            covered = pair.coupling.covered + float(pair.coupling.still.weight.sum())
            if abs(area - covered) <= SAME_LENGTH * covered and covered > 0:
                self._matching[number] = matching
                continue
            if not self._statement.contact[number].opens:
                raise Refused(REFUSES_OF_PAIRS[CLOSED_NO_MATCH])
            refined = CommonRefinement.of(self.t, slave, master, tiny)
            if refined is None or abs(float(refined.area.sum()) - covered) > SAME_LENGTH * covered or not covered > 0:
                raise Refused(REFUSES_OF_PAIRS[NO_MATCH])
            self._refined[number] = refined

    def _grade(self) -> None:
        """Moduli in the centres of the cells where they vary inside; then no parts of a cell have the same matrices.
        And the stress of initial strains, which has these moduli.
        """
        free = free_strain(self._model, self.owner, self._position)
        self.grading = graded_moduli(self._model, self.t, self.owner, free)
        if self.grading is not None:
            free = self.grading.free
            graded = replace(self.t, moduli=self.grading.moduli, parts=1)
            self.placed, self.t = graded if self.placed is self.t else self.placed, graded
        self.initial = None if free is None else initial_stress(self.t, free)

    def _movable(self, t: Simplices) -> npt.NDArray[np.bool_]:
        """Vertices that may move along the boundary without any change of the problem: it is straight there, with the
        same names at both sides, and around them is one material.
        """
        names = {
            name
            for _, entry in self._statement.listed()
            for name in (getattr(entry, "boundary", None), getattr(entry, "against", None))
            if isinstance(name, str)
        }
        named = np.zeros((len(t.facets), len(names)), dtype=bool)
        for column, name in enumerate(sorted(names)):
            named[self._whole_facets(name), column] = True
        label = np.unique(named, axis=0, return_inverse=True)[1].ravel() if names else np.zeros(len(t.facets))
        facet: Ints = np.repeat(t.outer, 2)
        vertex: Ints = t.facets[t.outer].ravel()
        order = np.argsort(vertex, kind="stable")
        twice = np.flatnonzero(np.bincount(vertex, minlength=len(t.x)) == 2)
        vertex, facet = vertex[order], facet[order]
        first = np.searchsorted(vertex, twice)
        pairs = np.stack((facet[first], facet[first + 1]), axis=1)
        normals = t.normal[pairs]
        straight = np.abs(normals[:, 0] - normals[:, 1]).max(axis=1) <= SAME_DIRECTION
        movable: npt.NDArray[np.bool_] = np.zeros(len(t.x), dtype=bool)
        movable[twice[straight & (label[pairs[:, 0]] == label[pairs[:, 1]])]] = True
        units = np.tile(np.eye(3)[None], (len(t.corners), 1, 1))
        kind = np.unique(t.stress(units).reshape(len(t.corners), -1), axis=0, return_inverse=True)[1].ravel()
        lowest, highest = np.full(len(t.x), kind.max()), np.zeros(len(t.x), dtype=np.int64)
        np.minimum.at(lowest, t.corners, kind[:, None])
        np.maximum.at(highest, t.corners, kind[:, None])
        return np.asarray(movable & (lowest == highest))

    def _degree_2(self, y: fem.Function) -> bool:
        """Whether a displacement has unknowns at the middles of the edges of simplices."""
        return bool(y.function_space.dofmap.list.shape[1] > self._cells.shape[1])

    @property
    def _quadrilateral(self) -> bool:
        """Whether the cells of the mesh are quadrilaterals, in two triangles each."""
        return len(self._undivided.corners) > len(self._cells)

    def _on_cells(self, y: fem.Function) -> tuple[Array, Array]:
        """A displacement at the vertices of cells that are not divided, and at the middles of their edges."""
        t, cells, d = self._undivided, self._cells, self._dimension
        values = y.x.array.reshape(-1, d)[y.function_space.dofmap.list]
        at: Array = np.zeros((len(t.x), d))
        at[cells] = values[:, : cells.shape[1]]
        middle: Array = at[t.edges].mean(axis=1)

        def numbers(ends: Ints) -> Ints:
            """Of the edges between vertices."""
            return np.searchsorted(t.keys(t.edges), t.keys(np.sort(ends, axis=-1)))

        if self._quadrilateral:  # the middle of the diagonal is that of the quadrilateral
            middle[numbers(cells[:, [0, 3]])] = values[:, -1] if self._degree_2(y) else values.mean(axis=1)
        if self._degree_2(y):
            corners, edges = cells.shape[1], self._edges_of_cells
            middle[numbers(cells[:, edges])] = values[:, corners : corners + len(edges)]
        return at, middle

    def _begin_of_slip(self, contact: ContactState | None, before: fem.Function | None) -> tuple[Array, Array] | None:
        """The displacement from which slip counts at vertices and middles of edges; None: slip is all of it."""
        if contact is None or not contact.has_friction or np.array_equal(contact.slip_length, contact.u_t):
            return None
        if before is None:
            raise Refused("slip counts from the displacement of the load step before, which is not known")
        return self._carried(
            before,
            "with friction in a later load step a guaranteed bound needs that nodes of two bodies meet, or do not "
            "nearly meet",
        )

    def _carried(self, f: fem.Function, otherwise: str) -> tuple[Array, Array]:
        """A function of the elements at vertices and middles of edges of the cells.

        Raises:
            Refused: with the reason ``otherwise``, where it does not vanish in cells whose nodes are not where they
                were.
        """
        values = self._on_cells(f)
        if self.halved:
            values = divide(self._undivided, *values)[1:3]
        if self._split is None:
            return values
        placed, (y, middle) = self.placed, values
        touched = (placed.x != self.given_x).any(axis=1)[placed.corners].any(axis=1)
        if y[placed.corners[touched]].any() or middle[placed.edges_of[touched]].any():
            raise Refused(otherwise)
        return self._split.carried(*values)

    def _jumps(self, sections: list[SectionJump]) -> JumpStrain | None:
        """What preloaded sections add to strains; None: there are none.

        Raises:
            Refused: contact with friction or springs may see one side of a section.
        """
        if not sections:
            return None
        if self.beyond is not None or self._on_quadrilaterals > 0:
            raise Refused(
                "preloaded sections have a guaranteed bound on simplices and quadrilaterals of degree 1 so far"
            )
        t = self.t
        strain: Array = np.zeros_like(t.strain_at_corners(self.y, self.middle))
        rounded: Array = np.zeros(len(t.corners))
        moved, tightened = list[MovedCells](), list[TightenedSection]()
        for section in sections:
            y, middle = self._carried(
                section.moved,
                "with preload a guaranteed bound needs that nodes of two bodies meet, or do not nearly meet",
            )
            if self._sees_one_side(y):
                raise Refused(
                    "a preloaded section has a guaranteed bound where neither springs nor friction are at it, and "
                    "contact is along it"
                )
            beyond, size = section.beyond[self.owner], section.amount
            strain[beyond] += size * t.strain_at_corners(y, middle)[beyond]
            rounded[beyond] = (np.sqrt(rounded) + abs(size) * np.sqrt(of_strains(t, y, middle)))[beyond] ** 2
            moved.append(MovedCells(size * y, size * middle, beyond))
            if section.force is not None:
                tightened.append(TightenedSection.of(t, section, y, beyond))
        return JumpStrain(strain, rounded, moved, tightened)

    def _sees_one_side(self, moved: Array) -> bool:
        """Whether springs or contact may see on which side of a section they are, which moves nodes on it so, length,
        shape (v, d).
        """
        t, whole = self.t, [spring.boundary for spring in self._statement.of(Springs)]
        for contact in self._statement.contact:
            if contact.friction.acts or contact.bonded or not self.flat:
                whole += [name for name in (contact.boundary, contact.against) if name is not None]
                continue
            if contact.against is None:
                facets, normal = self._towards(contact)
            else:
                facets = np.concatenate([self._facets(name) for name in (contact.boundary, contact.against)])
                normal = t.normal[facets]
            along = np.einsum("fad,fd->fa", moved[t.facets[facets]], normal)
            if np.abs(along).max(initial=0.0) > SAME_LENGTH * np.abs(moved).max():
                return True
        return any(moved[t.facets[self._facets(str(name))]].any() for name in whole)

    def strained(self, y: Array, middle: Array) -> Array:
        """The strain of a displacement and of preloaded sections, at corners, shape (n, d + 1, 3 or 6)."""
        strain = self.t.strain_at_corners(y, middle)
        return strain if self.jump is None else strain + self.jump.strain

    @property
    def interpolated(self) -> float:
        """Energy norm of what the displacement on the triangles is not of the computed one, but for ``beyond``."""
        return float(np.sqrt(self.moved_nodes)) + self._on_quadrilaterals

    @property
    def paired_contacts(self) -> set[int]:
        """The numbers of the contacts of two bodies."""
        return {number for number, _ in self._sides}

    @property
    def halved(self) -> bool:
        """Whether the facets of the cells are halved."""
        return bool(self._parts.shape[1] == 2)

    @property
    def cells(self) -> int:
        """How many the mesh has."""
        return len(self._cells)

    def _undivided_facets(self, facets: npt.NDArray[np.int32]) -> Ints:
        """Those of the cells that are not divided, from facets of the mesh."""
        entities, t = facet_entities(self._model.tagged.mesh, facets), self._undivided
        corners = np.take_along_axis(self._cells[entities[:, 0]], self._corners_of_facets[entities[:, 1]], axis=1)
        return np.searchsorted(t.keys(t.facets), t.keys(np.sort(corners, axis=1)))

    def _whole_facets(self, name: str) -> Ints:
        """The facets of a boundary before cells at the contact of two bodies are divided, the parts of each facet of
        the mesh one after the other.
        """
        return self._parts[self._undivided_facets(self._model.tagged.facets(name))].ravel()

    def _facets(self, name: str) -> Ints:
        """The facets of a boundary, the parts of each facet of the mesh one after the other."""
        facets = self._whole_facets(name)
        return facets if self._split is None else self._split.parts_of(facets)[0]

    def on(self, facets: Ints, local: Array, refined: CommonRefinement | None = None) -> BoundPoints:
        """Points on facets, or on the triangles of a refinement of them, at barycentric places, with their normals."""
        corners = self.t.x[self.t.facets[facets]]
        x = np.einsum("qc,fcd->fqd", local, corners if refined is None else refined.local[SLAVE] @ corners)
        return BoundPoints(x, np.broadcast_to(self.t.normal[facets][:, None], x.shape))

    def on_facets(self, y: Array, middle: Array, facets: Ints) -> Array:
        """Coefficients of Bernstein of a displacement of degree 2 on facets, length, shape (m, 3 or 6, d)."""
        nodal = np.concatenate((y[self.t.facets[facets]], middle[self.t.edges_of_facets[facets]]), axis=1)
        return coefficients(nodal)

    def relative(self, surface: FacetsInContact, y: Array, middle: Array) -> Array:
        """Coefficients of Bernstein of a displacement of degree 2 relative to the other body, see ``on_facets``."""
        if (refined := surface.refined) is not None:
            of_sides = [
                refined.coefficients_from(side) @ self.on_facets(y, middle, refined.facet(side))
                for side in (SLAVE, MASTER)
            ]
            return np.asarray(of_sides[SLAVE] - of_sides[MASTER])
        of_slave, opposite = self.on_facets(y, middle, surface.facets), surface.opposite
        if opposite is None:
            return of_slave
        of_master = self.on_facets(y, middle, opposite.facets)
        d = self._dimension
        between = of_master[:, d:] if d == 2 else opposite.over(of_master[:, d:])
        return of_slave - np.concatenate((opposite.over(of_master[:, :d]), between), axis=1)

    def _supports(self) -> None:
        """Directions in which facets are held; the displacement there is one that the elements hold."""
        statement, size, d = self._statement, np.abs(self.y).max(), self._dimension
        for entry in statement.of(PrescribedDisplacement):
            if not entry.holding:
                continue
            factor, effect = statement.now(entry, self._position)
            facets = self._facets(str(effect.boundary))
            points = self.on(facets, POINTS[d])
            displacement = bernstein(POINTS[d]) @ self.on_facets(self.y, self.middle, facets)
            rows = [(effect.normal, self.t.normal[facets])]
            rows += [(value, np.tile(np.eye(d)[k], (len(facets), 1))) for k, value in enumerate(effect.components[:d])]
            for value, direction in rows:
                if value is None:
                    continue
                component, prescribed = np.einsum("fqd,fd->fq", displacement, direction), factor * points.value(value)
                if np.abs(component - prescribed).max(initial=0.0) > ZERO_IN_SOLUTION * max(
                    size, np.abs(prescribed).max(initial=0.0)
                ):
                    raise Refused(f"the displacement of {effect.boundary!r} is no polynomial of the elements")
                self.held[facets] += direction[:, :, None] * direction[:, None]

    def _projectors(self) -> Array:
        """Onto the directions that are held at all."""
        sizes, vectors = np.linalg.eigh(self.held)
        return np.einsum("fik,fk,fjk->fij", vectors, np.where(sizes > SAME_LENGTH, 1.0, 0.0), vectors)

    def _towards(self, effect: Contact) -> tuple[Ints, Array]:
        """The facets of a contact, and unit vectors to its foundation, shape (m, d)."""
        facets, d = self._facets(effect.boundary), self._dimension
        if effect.foundation is not None:
            middles = self.t.x[self.t.facets[facets]].mean(axis=1)
            return facets, -effect.foundation.distance(middles)[1]
        if effect.direction is None:
            return facets, self.t.normal[facets]
        direction = np.array(effect.direction[:d])
        return facets, np.tile(direction / np.linalg.norm(direction), (len(facets), 1))

    def _contact(self, number: int, effect: Contact, contact: ContactState) -> FacetsInContact:
        """The facets of a contact, with admissible tractions near the nodal ones."""
        d, boundary, parts = self._dimension, contact.boundary, dict(self._sides).get(number)
        opposite, bonded, refined = None, effect.bonded, self._refined.get(number)
        apart: Array
        if (matching := self._matching.get(number)) is not None:
            whole_facets, whole_of = self._undivided_facets(self._model.pairs[number].slave.facets), matching.slave
            facets, normal, apart, opposite = self._facing(number, effect, whole_of, matching.master, matching.order)
        elif refined is not None:
            whole_facets = whole_of = refined.facets[SLAVE]
            facets, normal, apart, opposite = self._refined_sides(number, effect, refined)
        elif parts is None:
            whole_facets = self._whole_facets(effect.boundary)
            whole_of = whole_facets if self._split is None else self._split.parts_of(whole_facets)[1]
            facets, normal = self._towards(effect)
            apart = np.zeros((len(facets), d))
        else:
            slave = self._model.pairs[number].slave.facets
            whole_facets, whole_of = self._parts[self._undivided_facets(slave)].ravel(), parts.facets[:, SLAVE]
            facets, normal, apart, opposite = self._paired(number, effect, parts)
        given_gap = 0.0 if bonded else effect.gap_in(d)
        fine = self.on(facets, SEEN[d], refined).value(given_gap) + apart @ SEEN[d].T
        below = coefficients(fine[:, NODES[d]])
        above = below @ bernstein(SEEN[d]).T - fine
        if effect.opens:
            below -= above.max(axis=1, initial=0.0)[:, None]
        elif np.abs(above).max(initial=0.0) > ZERO_IN_SOLUTION * np.abs(fine).max(initial=0.0):
            raise Refused(f"the gap of {effect.boundary!r}, which cannot open, is no polynomial of degree 2")
        with_tractions = facets if refined is None else whole_of
        linear = _OnFacets(self, boundary, number, whole_facets, with_tractions, whole_of)
        points = self.on(facets, POINTS[d], refined)
        pressure = linear(contact.pressure, positive=effect.opens)
        gap = points.value(given_gap) + apart @ POINTS[d].T
        if effect.opens:
            pressure = pressure.clip(min=0.0)
        elif opposite is None:
            pressure = np.zeros_like(pressure)
        if bonded:
            least = np.full_like(pressure, np.inf)
            bounds = np.zeros_like(gap)
        elif effect.coulomb:
            least = linear(contact.bound).clip(min=0.0)
            bounds = (least if refined is None else refined.on_triangles(least)) @ POINTS[d].T
        else:
            given = effect.friction.given_bound if effect.friction.acts else 0.0
            bounds, seen = points.value(given), self.on(with_tractions, SEEN[d]).value(given)
            least = linear_below(seen, d)
        if d == 2:
            shear = linear(contact.shear) * turn(normal)[:, None]
        else:
            shear = linear(np.einsum("nij,nj->ni", boundary.tangents, contact.shear))
            of_facets = normal if refined is None else np.broadcast_to(normal[0], (len(whole_of), d))
            shear -= np.einsum("fad,fd,fe->fae", shear, of_facets, of_facets)
        shear, tractions = onto_disc(shear, least), None
        if refined is not None:
            tractions = FacetTractions(pressure, shear, least)
            pressure, shear, least = (refined.on_triangles(values) for values in (pressure, shear, least))
        before = np.zeros((*below.shape, d))
        surface = FacetsInContact(
            facets, normal, gap, below, bounds, pressure, shear, least, before, not effect.opens, opposite, bonded
        )
        surface.refined, surface.on_whole = refined, tractions
        if self._before is not None:
            surface.before = self.relative(surface, *self._before)
        return surface if not is_round(effect.foundation) else self._on_round(surface, effect, linear(contact.shear))

    def _on_round(self, surface: FacetsInContact, effect: Contact, shear: Array) -> FacetsInContact:
        """The same where the foundation is round.

        Args:
            surface: as if the foundation were straight along each facet.
            effect: the contact.
            shear: along the tangents at the vertices in the plane, stress, shape (m, d, d - 1).
        """
        d = self._dimension
        foundation = RoundFacets.of(self.t.x[self.t.facets[surface.facets]], effect.foundation, float(effect.gap))
        size = np.linalg.norm(foundation.direction, axis=2)
        pressure = surface.pressure / size
        if d == 3:
            pressure = np.repeat(pressure.mean(axis=1, keepdims=True), d, axis=1)
        least = surface.least * size / size.max(axis=1, keepdims=True)
        along = shear * (turn(foundation.direction) / size[:, :, None]) if d == 2 else np.zeros_like(surface.shear)
        return replace(
            surface,
            gap=foundation.gap,
            below=foundation.below,
            pressure=pressure,
            shear=onto_disc(along, least),
            least=least,
            round=foundation,
        )

    def _on_tool(self, number: int, surface: FacetsInContact) -> FacetsInContact:
        """The same with what its foundation has moved, where forces move it, added to the gap: see ``moving_tools``."""
        d = self._dimension
        for tool in self.tools:
            if number not in tool.parts:
                continue
            directions, away = surface.directions, tool.displacement(self.t.x[self.t.facets[surface.facets]])
            first, second = EDGES_OF_FACET[d].T
            along = np.einsum("fad,fbd->fab", directions, away)
            between = (along[:, first, second] + along[:, second, first]) / 2
            surface = replace(
                surface,
                gap=surface.gap + np.einsum("fqd,fqd->fq", POINTS[d] @ directions, POINTS[d] @ away),
                below=surface.below + np.concatenate((np.einsum("faa->fa", along), between), axis=1),
            )
        return surface

    def _paired(self, number: int, effect: Contact, parts: PairedParts) -> tuple[Ints, Array, Array, OtherSide]:
        """The facets of the contact of two bodies, its normals, the distance of both sides along these at the vertices,
        length, shape (m, d), and the other side.
        """
        assert self._split is not None
        t = self.t
        vertex = self._split.vertex[[contact for contact, _ in self._sides].index(number)][parts.ends]
        facets, opposite_facets = (
            self._split.between(vertex[:, 0, side], vertex[:, 1, side]) for side in (SLAVE, MASTER)
        )
        for side, numbers in ((SLAVE, facets), (MASTER, opposite_facets)):
            missed = (t.facets[numbers] != np.sort(vertex[:, :, side], axis=1)).any()
            if missed or len(np.unique(numbers)) < len(numbers):
                raise Refused(REFUSES_OF_PAIRS[TWICE_MET])
        backwards = t.facets[facets, 0] != vertex[:, 0, SLAVE]
        ordered = np.where(backwards[:, None], vertex[:, ::-1, MASTER], vertex[:, :, MASTER])
        order = (t.facets[opposite_facets, 0][:, None] != ordered).astype(np.int64)
        return self._facing(number, effect, facets, opposite_facets, order)

    def _facing(
        self, number: int, effect: Contact, facets: Ints, opposite_facets: Ints, order: Ints
    ) -> tuple[Ints, Array, Array, OtherSide]:
        """See ``_paired``.

        Args:
            number: of the contact.
            effect: the contact.
            facets: of the side with the contact points, shape (m,).
            opposite_facets: those over them, shape (m,).
            order: see ``OtherSide``.
        """
        t, pair = self.t, self._model.pairs[number]
        normal = t.normal[facets]
        if pair.by_geometry:
            normal = normal - t.normal[opposite_facets]
            normal = normal / np.linalg.norm(normal, axis=1)[:, None]
        opposite = OtherSide(
            opposite_facets, order, t.area[facets] / t.area[opposite_facets], self._share(facets, opposite_facets)
        )
        away = t.x[opposite.vertices(t)] - t.x[t.facets[facets]]
        apart, tiny = np.einsum("fad,fd->fa", away, normal), SAME_LENGTH * self._model.tagged.size
        flat = np.abs(t.normal[facets] + t.normal[opposite_facets]).max() <= SAME_DIRECTION
        flat &= np.abs(away - apart[:, :, None] * normal[:, None]).max() <= tiny
        self.flat &= bool(flat)
        along = effect.bonded or effect.friction.acts
        if along and (flat or pair.by_geometry) and np.abs(away).max() > tiny:
            raise Refused(REFUSES_OF_PAIRS[APART])
        return facets, normal, self._left_apart(number, effect, apart), opposite

    def _refined_sides(
        self, number: int, effect: Contact, refined: CommonRefinement
    ) -> tuple[Ints, Array, Array, OtherSide]:
        """See ``_paired``: of flat parallel sides the facets that each triangle is on."""
        t, facets, opposite_facets = self.t, refined.facet(SLAVE), refined.facet(MASTER)
        normal = np.tile(t.normal[facets[0]], (len(facets), 1))
        corners = [refined.local[side] @ t.x[t.facets[refined.facet(side)]] for side in (SLAVE, MASTER)]
        apart = np.einsum("fad,fd->fa", corners[MASTER] - corners[SLAVE], normal)
        if effect.friction.acts and np.abs(apart).max() > SAME_LENGTH * self._model.tagged.size:
            raise Refused(REFUSES_OF_PAIRS[APART])
        share, order = self._share(facets, opposite_facets), np.tile(np.arange(3), (len(facets), 1))
        opposite = OtherSide(opposite_facets, order, np.ones(len(facets)), share)
        return facets, normal, self._left_apart(number, effect, apart), opposite

    def _share(self, facets: Ints, opposite_facets: Ints) -> Array:
        """See ``OtherSide``."""
        t = self.t
        soft = [t.moduli.softest[t.sides[side, 0]] for side in (facets, opposite_facets)]
        return np.asarray(soft[1] / (soft[0] + soft[1]))

    def _left_apart(self, number: int, effect: Contact, apart: Array) -> Array:
        """The distance of both sides that counts as a gap, of the one that they have."""
        if not self._model.pairs[number].by_geometry:
            return np.zeros_like(apart)
        closed = closed_within(apart, effect.adjust)
        if (closed != apart).any() and closed.any():
            raise Refused(REFUSES_OF_PAIRS[PARTLY_CLOSED])
        return closed


class _OnFacets:
    """Linear functions on the facets of a contact from values of its points, zero where there is none; on divided ones
    with the moments of the nodal rule, or not negative with its resultants.
    """

    def __init__(
        self,
        problem: PlainProblem,
        boundary: ContactBoundary,
        number: int,
        whole_facets: Ints,
        facets: Ints,
        whole_of: Ints,
    ) -> None:
        """Look for the points among the vertices.

        Args:
            problem: the cells.
            boundary: all points.
            number: of the contact.
            whole_facets: of the contact before cells were divided where two bodies meet, shape (f,).
            facets: of the contact, shape (m,).
            whole_of: the whole facet that each of them is on, shape (m,).
        """
        self._cells, self._facets = problem.placed, whole_facets
        self._rows, self._halved = np.flatnonzero(boundary.part == number), problem.halved
        x = boundary.x[self._rows][:, : self._cells.dimension]
        # Of this side alone: vertices of the other body may be at the same places.
        vertices = np.unique(self._cells.facets[whole_facets])
        self._near = vertices[cKDTree(problem.given_x[vertices]).query(x)[1]]
        self._weight = boundary.weight[self._rows] if number in problem.paired_contacts else None
        order = np.argsort(whole_facets)
        self._of = order[np.searchsorted(whole_facets, whole_of, sorter=order)]
        self._parameter: Array | None = None
        if problem.t is not problem.placed:
            along = self._cells.x[self._cells.facets[whole_of]]
            way = along[:, 1] - along[:, 0]
            away = problem.t.x[problem.t.facets[facets]] - along[:, :1]
            self._parameter = np.einsum("mad,md->ma", away, way) / np.einsum("md,md->m", way, way)[:, None]

    def __call__(self, values: Array, *, positive: bool = False) -> Array:
        """At the vertices of the facets, shape (m, d, ...).

        Args:
            values: of all contact points, shape (n, ...).
            positive: see above.
        """
        t = self._cells
        nodal = np.zeros((len(t.x), *values.shape[1:]))
        nodal[self._near] = values[self._rows]
        if self._weight is not None and not self._halved:
            self._extend(nodal, self._weight)
        tractions = nodal[t.facets[self._facets]]
        if self._halved:
            # Each half of a facet ends with its middle, which has the higher number.
            together = np.concatenate((tractions[::2], tractions[1::2, :1]), axis=1)  # an end, the middle, an end
            together = np.einsum("ab,mb...->ma...", _LINEAR, together)
            if positive:  # with the resultant of each facet, of which a thin body takes notice
                cut = together.clip(min=0.0)
                share = together @ [0.25, 0.5, 0.25] / np.maximum(cut @ [0.25, 0.5, 0.25], np.finfo(float).tiny)
                together = cut * share.clip(0.0, 1.0)[:, None]
            tractions = np.stack((together[:, :2], together[:, [2, 1]]), axis=1).reshape(tractions.shape)
        tractions = np.asarray(tractions)[self._of]
        if self._parameter is None:
            return tractions
        parameter = self._parameter.reshape(*self._parameter.shape, *[1] * (tractions.ndim - 2))
        return (1 - parameter) * tractions[:, :1] + parameter * tractions[:, 1:]

    def _extend(self, nodal: Array, point_weight: Array) -> None:
        """Give nodes with a part of their length, or none, as much less of their values, and the mean of those beside
        them instead: near the end of a side the multiplier of a short part may be anything.
        """
        t, ends = self._cells, self._cells.facets[self._facets]
        weight, length = np.zeros((2, len(t.x)))
        np.add.at(weight, self._near, point_weight)
        np.add.at(length, ends, t.area[self._facets, None] / 2)
        vertices = np.unique(ends)
        share = np.zeros(len(t.x))
        share[vertices] = (weight[vertices] / length[vertices]).clip(max=1.0)
        shape = (-1, *[1] * (nodal.ndim - 1))
        beside, number = np.zeros_like(nodal), np.zeros(len(t.x))
        for a, b in (ends.T, ends.T[::-1]):
            np.add.at(beside, a, share[b].reshape(shape) * nodal[b])
            np.add.at(number, a, share[b])
        rows = vertices[(share[vertices] < 1) & (number[vertices] > 0)]
        part = share[rows].reshape(shape)
        nodal[rows] = part * nodal[rows] + (1 - part) * beside[rows] / number[rows].reshape(shape)
