"""What is to be solved on one mesh: an elastic body, made a contact problem, and all that is stated
of it.

The forms of a scene and those of a user take this one way into the core.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any, Self, cast

import mpi4py.MPI as MPI  # first, see signorini_fx.mechanics.body
import numpy as np
from dolfinx import fem, la
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from signorini_fx.algebra import Settings
from signorini_fx.algebra.algorithms.task import Task
from signorini_fx.algebra.contact.active_sets import ActiveSets
from signorini_fx.algebra.contact.complementarity import RegularisedData
from signorini_fx.algebra.contact.contact_map import ContactMap
from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.algebra.contact.motions import FreeMotions, ReferenceMotion
from signorini_fx.algebra.linalg import (
    Elasticity,
    ElasticSystem,
    FarPoints,
    LoadCase,
    petsc_options,
    row_by_row,
)
from signorini_fx.algebra.linalg.choice import SystemSize, choose_kind, choose_system
from signorini_fx.algebra.linalg.schur import SchurComplement
from signorini_fx.arrays import Array, Expr, Flags
from signorini_fx.errors import SceneError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import action, shared_in
from signorini_fx.mechanics.assembly.pieces import BodyPieces
from signorini_fx.mechanics.contact_points.contact_boundary import (
    ContactBoundary,
    block_diagonal,
    contact_map,
    no_points,
)
from signorini_fx.mechanics.kinematics.protocol import Kinematics
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.rigid.mesh_levels import MeshLevel
from signorini_fx.mechanics.rigid.rigid_bodies import Drive, Driven, RigidBodies
from signorini_fx.mechanics.rigid.rigid_motions import (
    RigidMotions,
    nearest_motion,
    rigid_motions,
    without_energy,
)
from signorini_fx.mechanics.scales import Scales
from signorini_fx.mechanics.statement.expressions import in_space, sample
from signorini_fx.mechanics.statement.load_path import LoadPath
from signorini_fx.mechanics.statement.settings import SolverSettings
from signorini_fx.tuned import FEWEST_BLOCK_UNKNOWNS, FINER_LEVELS

if TYPE_CHECKING:
    from signorini_fx.mechanics.assembly.nodal_stiffness import NodalStiffness
    from signorini_fx.mechanics.contact_points.turned_supports import TurnedNodes
    from signorini_fx.mechanics.effects.displacement import Displacement
    from signorini_fx.mechanics.elasticity.elastic_law import SceneLaw
    from signorini_fx.mechanics.elasticity.mixed_pressure import MixedLaw
    from signorini_fx.mechanics.loads.load_vectors import AppliedLoad, FormCoefficients
    from signorini_fx.mechanics.loads.supports import Conditions
    from signorini_fx.mechanics.obstacles.paired_points import PairedSides
    from signorini_fx.mechanics.statement.statement import Statement


@dataclass(frozen=True, eq=False)
class Loads:
    """What acts on a body in a load step.

    Attributes:
        forces: on the owned dofs, shape (owned dofs,).
        prescribed: displacements that supports prescribe, zero elsewhere, ghosts included, length,
            shape (dofs,).
        drives: of rigid bodies, see ``RigidBodies.drives``.
    """

    forces: Array
    prescribed: Array
    drives: Sequence[Drive] = ()


@dataclass(frozen=True, kw_only=True)
class Model:
    """An elastic body on its mesh, a symmetric form a(., .) on a vector Lagrange space, with the
    names of its parts, its supports, its contact points and all that acts on it.

    Each part is compiled and assembled when it is first needed; what takes forms, matrices or
    motions is collective.
    """

    space: fem.FunctionSpace  # Y_h, of the displacement
    terms: Callable[[], Sequence[fem.Form]]  # gives the compiled terms of a(., .)
    resists: (
        Sequence[fem.Form] | None
    )  # the terms that may resist rigid motions; None: any of them may
    bcs: Sequence[fem.DirichletBC]  # the supports along the axes
    turned: (
        TurnedNodes | None
    )  # nodes with supports along no axis, ``fixed`` in their own frames; None: none
    fixed: Flags  # which unknowns of this rank these and ``bcs`` prescribe, shape (owned dofs,)
    pieces: BodyPieces  # into which the mesh falls
    boundary: ContactBoundary | None  # the contact points; None: there are none
    settings: SolverSettings  # how it is to be solved
    # of the displacement; of forms of a user's own these say which motions have no strain
    kinematics: Kinematics
    compressible: bool = (
        True  # whether the material is far enough from incompressible for multigrid
    )
    elastic: SceneLaw | None = None  # of which ``terms`` are; None: forms of a user's own
    # Gives mass per volume of the mesh as UFL, or the form of the mass; None: it is not known.
    density: Callable[[], Expr] | None = None
    beside: NodalStiffness | None = None  # what a(., .) has beside ``terms``; None: nothing
    # Forces of the k unknowns of rigid bodies at the contact points, and on these themselves,
    # beside a(., .) and springs, force per length, shapes (n, d, k) and (k, k), symmetric; None:
    # nothing.
    relative: tuple[Array, Array] | None = None
    definite: bool = (
        True  # whether a(., .) is positive semi-definite but for a pressure as an unknown
    )
    symmetric: bool = True  # whether a(., .) is symmetric; else it is not definite
    # Which contact points are not expected to touch, shape (n,), at a displacement; None: any of
    # them may.
    far: tuple[Flags, fem.Function] | None = None
    tagged: TaggedMesh  # the mesh; where displacements have a component out of it a section in 3D
    path: LoadPath  # the load steps
    contacts: tuple[Any, ...]  # the entry of each contact, as it is now
    # One for the body, or one for each named region; none: a user's forms have it.
    materials: tuple[Any, ...] = ()
    title: str = ""  # any text
    forces_at: str = "L"  # the keys of its forces, for messages
    modulus: float = 0.0  # the natural unit of stress; 0: it is not known yet
    law: PointFriction | None = None  # of friction; None where no law can act
    # Both sides of each contact of two bodies, by its place in ``contacts``.
    pairs: Mapping[int, PairedSides] = field(default_factory=dict)
    rigid: RigidBodies  # those whose motion is an unknown
    supports: Conditions = field(default_factory=list)  # one component each: ``bcs``
    held: tuple[Displacement, ...] = ()  # the entries of the supports that hold now
    applied: tuple[AppliedLoad, ...] = ()  # the loads, by their load factors
    # At the contact points, without shifts; None without contact.
    data: RegularisedData | None = None
    # Of the forms of loads and resistances; None: a user's forms.
    coefficients: FormCoefficients | None = None
    # What a condensed system with another boundary has made of the same stiffness; None: there is
    # none.
    eliminated: SchurComplement | None = field(default=None, repr=False, compare=False)
    # Results that depend on everything above but ``boundary``, on that too, and on the mesh and
    # ``space`` alone.
    of_body: dict[str, Any] = field(default_factory=dict, repr=False, compare=False)
    of_contact: dict[str, Any] = field(default_factory=dict, repr=False, compare=False)
    of_mesh: dict[str, Any] = field(default_factory=dict, repr=False, compare=False)

    def __post_init__(self) -> None:
        """A copy with another boundary begins anew with what is computed of it."""
        if self.of_contact.setdefault("boundary", self.boundary) is not self.boundary:
            object.__setattr__(self, "of_contact", {"boundary": self.boundary})

    @property
    def comm(self) -> MPI.Comm:
        """The ranks that share the body."""
        comm = self.space.mesh.comm
        return comm

    @property
    def dimension(self) -> int:
        """D, of space."""
        return int(self.space.mesh.geometry.dim)

    @property
    def statement(self) -> Statement:
        """Return all entries of a scene; a user's forms have none."""
        assert self.coefficients is not None
        return self.coefficients.statement

    def with_statement(self, statement: Statement) -> Self:
        """Return the body of a scene with another statement; what is assembled of it stays."""
        assert self.coefficients is not None
        return replace(self, coefficients=replace(self.coefficients, statement=statement))

    def tightens(self, step: float) -> bool:
        """Return whether forces tighten sections at a place in the lists of factors, whose
        shortenings are unknowns there.
        """
        return any(load.entry is not None and load.entry.tightens(step) for load in self.applied)

    @property
    def has_coulomb(self) -> bool:
        """Return whether any friction bound depends on the contact pressure."""
        return any(contact.coulomb for contact in self.contacts)

    @property
    def dofs(self) -> int:
        """Global number of displacement unknowns."""
        return int(self.space.dofmap.index_map.size_global) * self.dimension

    @shared_in("of_body")
    def forms(self) -> tuple[fem.Form, ...]:
        """Return the compiled terms of a(., .)."""
        return tuple(self.terms())

    @shared_in("of_contact")
    def motions(self) -> RigidMotions:
        """Return the free motions without strain; bodies that can touch each other are one
        assembly.
        """
        return self._free if self.boundary is None else self._free.joined(self.boundary)

    @shared_in("of_body")
    def _supported(self) -> RigidMotions:
        """Return the rigid motions that the supports alone leave free."""
        fixed = self.fixed.reshape(-1, self.dimension)
        return rigid_motions(self.space, fixed, self.pieces, self.turned, self.kinematics)

    @property
    def of_supports(self) -> dict[str, Any]:
        """What of ``of_body`` another stiffness does not change."""
        return {name: value for name, value in self.of_body.items() if name == "_supported"}

    @shared_in("of_body")
    def _free(self) -> RigidMotions:
        motions = self._supported
        if motions.free.shape[1] == 0 or (self.resists is not None and not self.resists):
            return motions
        if self.resists is None:
            return without_energy(motions, self.stiffness, self.vector)
        matrix = sum_of(self.resists, [])
        return without_energy(motions, matrix, partial(vector_like, matrix))

    @shared_in("of_contact")
    def at_contact(self) -> FreeMotions:
        """Return the free motions at the contact points."""
        return self.motions.at(self.boundary or no_points(self.space))

    def system_size(self, at_contact: FreeMotions | None = None) -> SystemSize:
        """Return the figures that decide which kind of elastic system it gets, with free motions at
        the contact points.
        """
        at_contact = self.at_contact if at_contact is None else at_contact
        retained = 0
        held = False
        across = int(self.space.mesh.topology.dim)
        if self.boundary is not None:
            reached = parallel.gather_rows(self.comm, np.unique(self.boundary.averages.nodes))
            retained = self.dimension * int(np.unique(reached).size)
            everywhere = self.boundary.points.everywhere
            held = at_contact.held_by(everywhere, everywhere)
        if self.mixed is None:
            definite = self.definite
            return SystemSize(
                self.comm, self.dofs, across, retained, held, self.compressible, definite=definite
            )
        enclosed = retained > 0 and self.mixed.encloses(
            self.vector, self.prescribed | self.contact.touched
        )
        return SystemSize(
            self.comm, self.dofs, across, retained, held, False, definite=False, enclosed=enclosed
        )

    @shared_in("of_body")
    def _assembled(self) -> tuple[PETSc.Mat, PETSc.Mat | None, PETSc.Mat | None]:
        """``stiffness`` and ``rotation``, and this without rigid bodies."""
        if self._fit_for_blocks:
            from signorini_fx.mechanics.assembly.nodal_stiffness import block_stiffness

            stiffness = block_stiffness(self.forms, self.fixed, self.beside)
            stiffness.setOption(PETSc.Mat.Option.SPD, True)
            return stiffness, None, None
        owned = self.space.dofmap.index_map.size_local
        turned = self.turned
        boundary = self.boundary
        stiffness = sum_of(self.forms, self.bcs if turned is None else [])
        if self.beside is not None:
            self.beside.add_to(stiffness, self.fixed if turned is None else None)
        rotation = None
        fixed = self._held
        if turned is not None:
            rotation = block_diagonal(stiffness, turned.frames_at(np.arange(owned)))
            stiffness = stiffness.ptap(rotation)
            stiffness.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
            first = stiffness.getOwnershipRange()[0]
            stiffness.zeroRowsColumns(
                (first + np.flatnonzero(self.fixed)).astype(PETSc.IntType), diag=0.0
            )
        turning = rotation
        if boundary is not None and boundary.moving is not None:
            from signorini_fx.algebra.linalg.rigid_unknowns import bordered, embedding

            of_body = stiffness
            springs = boundary.moving.stiffness[: self._rigid]
            stiffness = bordered(of_body, np.ones(springs.size, dtype=bool), springs)
            rotation = embedding(rotation, of_body, stiffness)
            if self.relative is not None:
                self._add_relative(stiffness)
        diagonal = stiffness.getDiagonal()
        values = diagonal.getArray()
        # In any unit it is neither small nor large beside the other entries.
        values[fixed] = parallel.largest(self.comm, values) or 1.0
        stiffness.setDiagonal(diagonal)
        if self.mixed is not None:
            return self.mixed.joined(stiffness, rotation, fixed)
        stiffness.setOption(PETSc.Mat.Option.SPD, True)
        return stiffness, rotation, turning

    def _add_relative(self, stiffness: PETSc.Mat) -> None:
        """Add ``relative`` to a stiffness without the rows and columns of what is prescribed;
        collective.
        """
        boundary = self.boundary
        dim = self.dimension
        assert boundary is not None
        assert boundary.moving is not None
        assert self.relative is not None
        free = ~boundary.moving.fixed
        at_points = (
            self.relative[0] * ~self.fixed.reshape(-1, dim)[boundary.nodes][:, :, None] * free
        )
        own = self.relative[1] * np.outer(free, free) * (self._rigid > 0)
        first, _ = stiffness.getOwnershipRange()
        total = stiffness.getSize()[0]
        rows = (
            (first + dim * boundary.nodes[:, None] + np.arange(dim)).ravel().astype(PETSc.IntType)
        )
        rigid = (total - free.size + np.arange(free.size)).astype(PETSc.IntType)
        added = PETSc.Mat().createAIJ(stiffness.getSizes(), comm=stiffness.comm)
        added.setUp()
        values = at_points.reshape(rows.size, free.size)
        added.setValues(rows, rigid, values, addv=True)
        added.setValues(rigid, rows, np.ascontiguousarray(values.T), addv=True)
        added.setValues(rigid, rigid, own, addv=True)
        added.assemble()
        stiffness.axpy(1.0, added, structure=PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)

    def relative_forces(self, displacement: Array, driven: Array) -> tuple[Array, Array]:
        """Return the forces of ``relative`` on all unknowns of this rank but a pressure, and those
        of its part at the contact points on rigid bodies, of displacements of the nodes, shape
        (dofs,), and motions, shape (k,); collective.
        """
        assert self.boundary is not None
        assert self.relative is not None
        at_points, own = self.relative
        nodes = self.boundary.nodes
        forces = np.zeros(self._held.size)
        np.add.at(forces[: self.fixed.size].reshape(-1, self.dimension), nodes, at_points @ driven)
        moved = displacement.reshape(-1, self.dimension)[nodes]
        on_rigid = parallel.global_sum(self.comm, np.einsum("nik,ni->k", at_points, moved))
        forces[self.fixed.size :] = (on_rigid + own @ driven)[: self._rigid]
        return forces, on_rigid

    @shared_in("of_body")
    def _fit_for_blocks(self) -> bool:
        """Return whether a Krylov method with multigrid will solve for contact, for which a
        stiffness by blocks is faster.
        """
        boundary = self.boundary
        if (
            boundary is None
            or boundary.moving is not None
            or self.turned is not None
            or self.mixed is not None
        ):
            return False
        if self.beside is not None and self.beside.joint:
            return False
        if petsc_options.user_chooses_solver() or self.dofs < FEWEST_BLOCK_UNKNOWNS:
            return False
        # Nothing that resists is assembled yet: without it more motions are free, and contact holds
        # them or not.
        at_contact = self._supported.joined(boundary).at(boundary)
        return (
            choose_kind(self.system_size(at_contact), self.settings.linear_algebra)[0] == "krylov"
        )

    @property
    def scene_law(self) -> SceneLaw:
        """Return the law of the materials of a scene."""
        assert self.elastic is not None
        return self.elastic

    @property
    def mixed(self) -> MixedLaw | None:
        """The law with a pressure as an unknown, or None if there is none."""
        law = self.elastic if self.elastic is not None and self.elastic.pressed else None
        return cast("MixedLaw | None", law)  # which only a mixed element imports

    @property
    def _rigid(self) -> int:
        """How many unknowns of this rank are those of rigid bodies."""
        return self._held.size - self.fixed.size

    @property
    def _held(self) -> Flags:
        """``prescribed`` without a pressure."""
        if (
            self.boundary is None
            or self.boundary.moving is None
            or self.comm.rank < self.comm.size - 1
        ):
            return self.fixed
        return np.concatenate((self.fixed, self.boundary.moving.fixed))

    @property
    def prescribed(self) -> Flags:
        """Which unknowns of the stiffness this rank has prescribed: ``fixed``, and on the last one
        of rigid bodies.
        """
        return self._held if self.mixed is None else np.pad(self._held, (0, self.mixed.count))

    @property
    def is_assembled(self) -> bool:
        """Whether there is a stiffness already."""
        return "_assembled" in self.of_body

    @property
    def stiffness(self) -> PETSc.Mat:
        """Return the matrix of a(., .) on Y_h; prescribed rows and columns are empty, with its
        largest entry on their diagonal.
        """
        return self._assembled[0]

    @property
    def rotation(self) -> PETSc.Mat | None:
        """Q from the unknowns of the stiffness, some of rigid bodies, to displacements; None if
        they are the same.
        """
        return self._assembled[1]

    @shared_in("of_contact")
    def contact(self) -> ContactMap:
        """B from the unknowns of the stiffness."""
        behind = (
            0 if self.mixed is None else self.comm.bcast(self.mixed.count, root=self.comm.size - 1)
        )
        boundary = self.boundary or no_points(self.space)
        return contact_map(boundary, self.prescribed, self.stiffness, self.rotation, behind)

    def level(self, coarser: MeshLevel | None = None) -> MeshLevel:
        """Return the mesh as a multigrid level over coarser ones, of which those are left out that
        are hardly coarser, or far too coarse.
        """
        dimension = self.dimension
        least, greatest = FINER_LEVELS
        alone = self.mixed is None and (self.boundary is None or self.boundary.moving is None)
        stiffness = self.stiffness if alone else None
        level = MeshLevel(
            self.space, self.fixed, self._assembled[2], self.motions, coarser, stiffness
        )
        while level.coarser is not None and level.dofs < least**dimension * level.coarser.dofs:
            level.coarser = level.coarser.coarser
        if level.coarser is not None and level.dofs > greatest**dimension * level.coarser.dofs:
            level.coarser = None
        return level

    def elasticity(self, cases: Sequence[LoadCase], coarser: MeshLevel | None = None) -> Elasticity:
        """Return what linear algebra needs to know of the body.

        ``coarser``: coarser meshes for multigrid.
        """
        free = self.motions.free.shape[1]
        of = self.stiffness, cases, self.contact, free, self.level(coarser)
        definite = self.definite and self.mixed is None
        far = (
            None if self.far is None or free else FarPoints(self.far[0], self.unknowns(self.far[1]))
        )
        symmetric = self.symmetric
        eliminated = self.eliminated
        return Elasticity(
            *of,
            definite=definite,
            rigid=self._rigid,
            symmetric=symmetric,
            far=far,
            eliminated=eliminated,
        )

    def case(
        self,
        forces: Array,
        prescribed: Array,
        driven: Driven | None = None,
        pushing: Array | None = None,
        pressure_load: Array | None = None,
        lifted: Array | None = None,
    ) -> LoadCase:
        """Return the right-hand side of an ``AppliedLoad``.

        ``lifted``: what its forces lack of ``prescribed``, None: all.
        """
        comm = self.comm
        dim = self.dimension
        fixed = self.prescribed
        start = self.vector(prescribed)
        if parallel.any_rank(comm, prescribed):
            owned = prescribed[: forces.size].reshape(-1, dim)
            nearest = nearest_motion(
                self.motions, self.fixed.reshape(-1, dim), owned, self.turned, comm
            )
            free = self.vector(self.motions.of_pieces(nearest)).getArray(readonly=True)
            start.getArray()[~fixed] = free[~fixed]
        load = self.vector(forces - self.forces_of(prescribed if lifted is None else lifted))
        if self.mixed is not None:
            load.getArray()[self._held.size :] = self.mixed.lifted(prescribed, pressure_load)
        if driven is not None:
            rigid = slice(self.fixed.size, self._held.size)
            start.getArray()[rigid] = driven.motion[: self._rigid]
            load.getArray()[rigid] = driven.forces[: self._rigid]
        diagonal = self.stiffness.getDiagonal().getArray(readonly=True)
        load.getArray()[fixed] = (diagonal * start.getArray(readonly=True))[fixed]
        working = forces if pushing is None else pushing
        resultant = self.motions.load_of(working, comm, None if driven is None else driven.forces)
        return LoadCase(load, start, resultant)

    def task(
        self,
        cases: Sequence[LoadCase],
        factors: Array,
        *,
        coarser: MeshLevel | None = None,
        allowed: Callable[[fem.Function], float] | None = None,
        choose: Callable[[Elasticity, SystemSize, str], tuple[ElasticSystem, str]] = choose_system,
        **options: Any,
    ) -> Task:
        """Return the contact problem, ready for ``strategy.solve_task`` or an algorithm of one's
        own, with the first ``factors`` of the cases.

        ``allowed``: the regularisation error allowed for path-following at a displacement, in the
            energy norm, None: that of the settings.
        ``choose``: the elastic system and the reason for its kind.
        ``options``: see ``Task``.
        """
        system, reason = choose(
            self.elasticity(cases, coarser), self.system_size(), self.settings.linear_algebra
        )
        system.set_load(factors)
        share = self.settings.regularisation_error
        data = self.data

        def goal(x: PETSc.Vec) -> float:
            y = self.function(system.displacement(x))
            if allowed is not None:
                return allowed(y)
            forces = self.forces_of(y.x.array)
            twice = parallel.total(self.comm, forces @ y.x.array[: forces.size])
            return float(share) * float(np.sqrt(max(0.0, twice)))

        return Task.of(
            system,
            self.at_contact,
            np.empty(0) if data is None else data.gap,
            self.law,
            bilateral=None if data is None else data.bilateral,
            settings=Settings.of(self.settings),
            natural_gamma=self.scales.gamma,
            coordinate_error=self.scales.coordinate_error,
            has_coulomb=self.has_coulomb,
            linear_algebra=reason,
            goal=goal,
            **options,
        )

    def from_rest(self, resting: ReferenceMotion | None, displacement: PETSc.Vec) -> fem.Function:
        """Return a displacement that is counted from the reference motion, converted to one from
        the initial position.
        """
        function = self.function(displacement)
        if resting is not None:
            function.x.array[:] += self.displacement_of(resting)
        return function

    def displacement_of(self, resting: ReferenceMotion) -> Array:
        """Return the displacement of a reference motion, ghosts included, length, shape (dofs,)."""
        if resting.displacement is not None:
            return resting.displacement
        return self.motions.displacement(resting.motion).ravel()

    def function(self, x: PETSc.Vec) -> fem.Function:
        """Return the finite element function with the unknowns ``x``."""
        function = fem.Function(self.space, name="displacement")
        if self.mixed is not None:
            function = self.mixed.displacement(x.getArray(readonly=True)[self._held.size :])
        if self.rotation is not None:
            x = self.rotation * x
        function.x.array[: x.getLocalSize()] = x.getArray(readonly=True)
        function.x.scatter_forward()
        return function

    def driven(self, x: PETSc.Vec, resting: ReferenceMotion | None) -> Array:
        """Return the unknowns of rigid bodies in a displacement counted from the reference motion,
        shape (k,).
        """
        if self.boundary is None or self.boundary.moving is None:
            return np.zeros(0)
        local = np.array(x.getArray(readonly=True)[self.fixed.size : self._held.size])
        unknowns = self.comm.bcast(local, root=self.comm.size - 1)
        if resting is not None:
            assert self.motions.foundations is not None
            unknowns = unknowns + self.motions.foundations @ resting.motion
        return unknowns

    def begin_driven(self, x: PETSc.Vec, driven: Array, resting: ReferenceMotion | None) -> None:
        """Put the unknowns of rigid bodies into x, the inverse of ``driven``."""
        if resting is not None:
            assert self.motions.foundations is not None
            driven = driven - self.motions.foundations @ resting.motion
        x.getArray()[self.fixed.size : self._held.size] = driven[: self._rigid]

    def unknowns_at(self, displacement: Array, rigid: Array) -> PETSc.Vec:
        """Return the unknowns x, but a pressure, of a displacement, ghosts included, shape (dofs,),
        and of rigid bodies, shape (k,).
        """
        x = self.vector(displacement)
        if rigid.size:
            self.begin_driven(x, rigid, None)
        return x

    def forces_of(self, values: Array) -> Array:
        """a(y, .) of a displacement, ghosts included, supports left out, shapes (dofs,), (owned
        dofs,); collective.
        """
        moved = np.flatnonzero(values.reshape(-1, self.dimension).any(axis=1)).astype(np.int32)
        if not parallel.any_rank(self.comm, moved.size > 0):
            return np.zeros(self.fixed.size)
        displacement = fem.Function(self.space)
        displacement.x.array[:] = values
        forces = action(self.forms, displacement, moved)
        return forces if self.beside is None else forces + self.beside.times(values, self.space)

    def forces_of_free(self, values: Array) -> Array:
        """``forces_of`` the part of a displacement that is free, right at free unknowns alone,
        where no support is
        turned: a product with the stiffness takes less time than an integration over all cells.
        """
        forces = self.stiffness * self.vector(values)
        return np.array(forces.getArray(readonly=True)[: self.fixed.size])

    def unknowns(self, function: fem.Function) -> PETSc.Vec:
        """Return the unknowns x of a finite element function, the inverse of ``function``."""
        x = self.vector(function.x.array)
        if self.mixed is not None:
            x.getArray()[self._held.size :] = self.mixed.unknowns(function)
        return x

    def vector(self, values: Array) -> PETSc.Vec:
        """Return a new vector Q^T y of displacements or forces at the nodes of this rank, the owned
        ones first.
        """
        if self.rotation is None:
            return vector_like(self.stiffness, values)
        result, x = self.rotation.createVecs()
        x.getArray()[:] = values.ravel()[: x.getLocalSize()]
        self.rotation.multTranspose(x, result)
        return result

    @property
    def scales(self) -> Scales[float]:
        """Return the scales that lengths and stresses are compared with."""
        tagged = self.tagged
        return Scales(
            tagged.dimension, self.modulus, tagged.size, self.kinematics.depth(tagged.size)
        )

    def factors(self, step: float) -> Array:
        """Return the factors of the applied loads at a place in the lists of factors, see
        ``statement.load_path``.
        """
        return np.array([load.factor(self.statement, step) for load in self.applied])

    def applied_at(self, step: float) -> list[tuple[float, AppliedLoad]]:
        """Return the applied loads at a place with their factors; collective."""
        return [(load.factor(self.statement, step), load.at(step)) for load in self.applied]

    def first_sets(self) -> tuple[ActiveSets, int]:
        """Return the sets of the first linear solve and its number, section 7: 0 if it only
        computes the start; collective.
        """
        assert self.boundary is not None
        region = self.settings.initial_contact
        full_contact = ActiveSets.all_in_contact(*self.boundary.tangents.shape[::2])
        if isinstance(region, str):
            return full_contact, 0
        inside = sample(region, in_space(self.boundary.x)) > 0
        if not parallel.any_rank(self.comm, inside):
            raise SceneError.at("solver.initial_contact", "holds no contact node")
        return ActiveSets.of(inside, full_contact.direction), 1

    @shared_in("of_body")
    def cases(self) -> tuple[LoadCase, ...]:
        """Return the right-hand sides of the applied loads, in their order; those of the first load
        step; collective.
        """
        return tuple(map(self.case_of, self.applied))

    def case_of(self, load: AppliedLoad) -> LoadCase:
        """Return the right-hand side of an applied load; collective."""
        return self.case(
            load.forces, load.prescribed.x.array, load.driven, load.pushing, load.pressure_load
        )

    def loads_at(self, step: float, *, pushing: bool = False) -> Loads:
        """Return the applied loads at a place, times their factors, or of the forces those that are
        ``pushing``; collective.
        """
        forces = np.zeros(self.fixed.size)
        prescribed = np.zeros_like(fem.Function(self.space).x.array)
        for factor, load in self.applied_at(step):
            forces += factor * (load.pushing if pushing else load.forces)
            prescribed += factor * load.prescribed.x.array
        return Loads(forces, prescribed)


def vector_like(matrix: PETSc.Mat, values: Array) -> PETSc.Vec:
    """Return values at the nodes of this rank, the owned ones first, as a new vector with the
    layout of a matrix.
    """
    x = matrix.createVecRight()
    x.getArray()[:] = values.ravel()[: x.getLocalSize()]
    return x


def sum_of(forms: Sequence[fem.Form], bcs: Sequence[fem.DirichletBC]) -> PETSc.Mat:
    """Return the matrix of a sum of bilinear forms, without the rows and columns of ``bcs``; its
    entries are copied: petsc4py never gives back the arrays of a matrix to which PETSc adds one
    with other entries; collective. On one rank dolfinx's matrix takes half the time of PETSc's.
    """
    if forms[0].mesh.comm.size == 1:
        entries = fem.create_matrix(forms[0], la.BlockMode.expanded)
        for form in forms:
            fem.assemble_matrix(entries, form, list(bcs), 0.0)  # type: ignore[arg-type]
        rows, columns = (
            numbers.astype(PETSc.IntType, copy=False)
            for numbers in (entries.indptr, entries.indices)
        )
        space = forms[0].function_spaces[0].dofmap
        size = space.index_map.size_local * space.index_map_bs
        matrix = PETSc.Mat().createAIJWithArrays(
            (size, size), (rows, columns, entries.data), comm=forms[0].mesh.comm
        )
        matrix.setBlockSize(space.index_map_bs)
        return row_by_row(matrix.duplicate(copy=True))
    matrix = fem_petsc.assemble_matrix(forms[0], list(bcs), 0.0)
    for form in forms[1:]:
        matrix.assemble()
        fem_petsc.assemble_matrix(matrix, form, list(bcs), 0.0)  # type: ignore[arg-type]
    matrix.assemble()
    return row_by_row(matrix)
