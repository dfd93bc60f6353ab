"""The contact problem of one mesh: the elastic body with its supports, loads and contact points.

A scene and the forms of a user both become a ``Model``.
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
from signorini_fx.mechanics.kinematics import Kinematics
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
    """The loads on a body in a load step.

    Attributes:
        forces: forces on the owned dofs, shape (owned dofs,).
        prescribed: displacements that supports prescribe, zero elsewhere, ghosts included, length,
            shape (dofs,).
        drives: forces and motions that drive rigid bodies, see ``RigidBodies.drives``.
    """

    forces: Array
    prescribed: Array
    drives: Sequence[Drive] = ()


@dataclass(frozen=True, kw_only=True)
class Model:
    """An elastic body on its mesh: a bilinear form a(., .) on a vector Lagrange space, supports,
    contact points, loads, and the names of its parts.

    Each part is compiled and assembled when it is first needed.  Methods that use forms, matrices
    or motions are collective.
    """

    space: fem.FunctionSpace  # Y_h, the vector Lagrange space of displacements
    # Returns the compiled terms of a(., .).
    terms: Callable[[], Sequence[fem.Form]]
    # The terms that may resist rigid motions; None: any of them may.
    resists: Sequence[fem.Form] | None
    bcs: Sequence[fem.DirichletBC]  # the supports along the axes
    # Nodes with supports that are not along an axis, in rotated frames; None: there are none.
    turned: TurnedNodes | None
    # Which dofs of this rank the supports prescribe, at ``turned`` nodes in their frames, shape
    # (owned dofs,).
    fixed: Flags
    pieces: BodyPieces  # the connected pieces of the mesh
    boundary: ContactBoundary | None  # the contact points; None: there are none
    settings: SolverSettings  # of the solver
    # Strains and rigid motions of the displacement; for a user's forms which motions have no
    # strain.
    kinematics: Kinematics
    # Whether the material is far enough from incompressible for multigrid.
    compressible: bool = True
    # The elastic law that ``terms`` come from; None: a user's forms.
    elastic: SceneLaw | None = None
    # Returns the mass per volume of the mesh as UFL, or the form of the mass; None: it is unknown.
    density: Callable[[], Expr] | None = None
    # Nodal stiffness that is added to ``terms``; None: nothing.
    beside: NodalStiffness | None = None
    # Stiffness that couples the k unknowns of rigid bodies to the contact points, shape (n, d, k),
    # and to each other, shape (k, k), symmetric, in addition to a(., .) and springs; force per
    # length; None: there is none.
    relative: tuple[Array, Array] | None = None
    # Whether a(., .) is positive semi-definite, apart from an unknown pressure.
    definite: bool = True
    # Whether a(., .) is symmetric; otherwise it is not definite either.
    symmetric: bool = True
    # Contact points that are expected to stay open, shape (n,), and the displacement that estimates
    # where they are; None: any point may touch.
    far: tuple[Flags, fem.Function] | None = None
    # The mesh with its names; a 2D section in 3D if displacements have a component out of it.
    tagged: TaggedMesh
    path: LoadPath  # the load steps
    contacts: tuple[Any, ...]  # the entry of each contact, with its values at the current step
    # One for the body, or one for each named region; empty for a user's forms.
    materials: tuple[Any, ...] = ()
    title: str = ""  # any text
    forces_at: str = "L"  # the input keys of the forces, for messages
    modulus: float = 0.0  # the natural unit of stress; 0: it is not known yet
    law: PointFriction | None = None  # friction; None where no friction can act
    # Both sides of each contact of two bodies, by the position of the contact in ``contacts``.
    pairs: Mapping[int, PairedSides] = field(default_factory=dict)
    rigid: RigidBodies  # the rigid bodies whose motion is unknown
    supports: Conditions = field(default_factory=list)  # ``bcs``, one displacement component each
    held: tuple[Displacement, ...] = ()  # the entries of the supports that act in this step
    applied: tuple[AppliedLoad, ...] = ()  # the loads, one for each list of load factors
    # Gaps and regularisation at the contact points, without shifts; None without contact.
    data: RegularisedData | None = None
    # Coefficients in the forms of loads and resistances; None: a user's forms.
    coefficients: FormCoefficients | None = None
    # The Schur complement of the same stiffness from a condensed system with another boundary;
    # None: there is none.
    eliminated: SchurComplement | None = field(default=None, repr=False, compare=False)
    # Cached results: those that do not depend on ``boundary``, those that do, and those that depend
    # on the mesh and ``space`` alone.
    of_body: dict[str, Any] = field(default_factory=dict, repr=False, compare=False)
    of_contact: dict[str, Any] = field(default_factory=dict, repr=False, compare=False)
    of_mesh: dict[str, Any] = field(default_factory=dict, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Drop the results that depend on the contact boundary if this copy has another one."""
        if self.of_contact.setdefault("boundary", self.boundary) is not self.boundary:
            object.__setattr__(self, "of_contact", {"boundary": self.boundary})

    @property
    def comm(self) -> MPI.Comm:
        """The MPI communicator of the mesh."""
        return self.space.mesh.comm

    @property
    def dimension(self) -> int:
        """The geometric dimension d, 2 or 3."""
        return int(self.space.mesh.geometry.dim)

    @property
    def statement(self) -> Statement:
        """All entries of the scene; a model from a user's forms has none."""
        assert self.coefficients is not None
        return self.coefficients.statement

    def with_statement(self, statement: Statement) -> Self:
        """Return the model of a scene with another statement; what is already assembled is kept."""
        assert self.coefficients is not None
        return replace(self, coefficients=replace(self.coefficients, statement=statement))

    def tightens(self, step: float) -> bool:
        """Return whether some bolt is tightened by a force at ``step``, so that its shortening is
        unknown.

        Args:
            step: place in the lists of factors, see ``statement.load_path``.
        """
        return any(load.entry is not None and load.entry.tightens(step) for load in self.applied)

    @property
    def has_coulomb(self) -> bool:
        """Return whether any friction bound depends on the contact pressure."""
        return any(contact.coulomb for contact in self.contacts)

    @property
    def dofs(self) -> int:
        """The global number of displacement unknowns."""
        return int(self.space.dofmap.index_map.size_global) * self.dimension

    @shared_in("of_body")
    def forms(self) -> tuple[fem.Form, ...]:
        """Return the compiled terms of a(., .)."""
        return tuple(self.terms())

    @shared_in("of_contact")
    def motions(self) -> RigidMotions:
        """Return the rigid motions, without strain energy, that supports leave free.

        Bodies that can touch each other are one assembly.
        """
        return self._free if self.boundary is None else self._free.joined(self.boundary)

    @shared_in("of_body")
    def _supported(self) -> RigidMotions:
        """Return the rigid motions that the supports alone leave free, whatever springs resist."""
        fixed = self.fixed.reshape(-1, self.dimension)
        return rigid_motions(self.space, fixed, self.pieces, self.turned, self.kinematics)

    @property
    def of_supports(self) -> dict[str, Any]:
        """The entries of ``of_body`` that depend on the supports alone and stay valid with another
        stiffness.
        """
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
        """Return the traces of the free rigid motions at the contact points."""
        return self.motions.at(self.boundary or no_points(self.space))

    def system_size(self, at_contact: FreeMotions | None = None) -> SystemSize:
        """Return the figures from which the kind of elastic system (full, condensed, Krylov) is
        chosen.

        Args:
            at_contact: the free motions at the contact points; None: ``self.at_contact``.
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
        """Assemble ``stiffness`` and ``rotation``; the third entry is the rotation without the
        unknowns of rigid bodies, as multigrid needs it.
        """
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
        # This value fits the other entries in any system of units.
        values[fixed] = parallel.largest(self.comm, values) or 1.0
        stiffness.setDiagonal(diagonal)
        if self.mixed is not None:
            return self.mixed.joined(stiffness, rotation, fixed)
        stiffness.setOption(PETSc.Mat.Option.SPD, True)
        return stiffness, rotation, turning

    def _add_relative(self, stiffness: PETSc.Mat) -> None:
        """Add ``relative`` to a stiffness, but not to rows and columns of prescribed unknowns;
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
        """Return the forces of ``relative`` on all unknowns of this rank except a pressure, and the
        part of the forces on rigid bodies, shape (k,), that comes from the contact points;
        collective.

        Args:
            displacement: of the nodes of this rank, length, shape (dofs,).
            driven: the unknowns of rigid bodies, shape (k,).
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
        """Return whether contact will be solved by a Krylov method with multigrid, for which a
        stiffness in nodal blocks is faster.
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
        # Springs that resist rigid motions are not assembled yet.  The decision is made without
        # them, on the larger set of motions that the supports leave free.
        at_contact = self._supported.joined(boundary).at(boundary)
        return (
            choose_kind(self.system_size(at_contact), self.settings.linear_algebra)[0] == "krylov"
        )

    @property
    def scene_law(self) -> SceneLaw:
        """The law of the materials of a scene."""
        assert self.elastic is not None
        return self.elastic

    @property
    def mixed(self) -> MixedLaw | None:
        """The law with a pressure as an unknown, or None if there is none."""
        law = self.elastic if self.elastic is not None and self.elastic.pressed else None
        return cast("MixedLaw | None", law)  # which only a mixed element imports

    @property
    def _rigid(self) -> int:
        """The number of unknowns of this rank that belong to rigid bodies: all on the last rank,
        none on the others.
        """
        return self._held.size - self.fixed.size

    @property
    def _held(self) -> Flags:
        """Which unknowns this rank has prescribed, as ``prescribed``, but without those of a
        pressure.
        """
        if (
            self.boundary is None
            or self.boundary.moving is None
            or self.comm.rank < self.comm.size - 1
        ):
            return self.fixed
        return np.concatenate((self.fixed, self.boundary.moving.fixed))

    @property
    def prescribed(self) -> Flags:
        """Which unknowns of the stiffness on this rank are prescribed: those of ``fixed``, then, on
        the last rank, those of rigid bodies; unknowns of a pressure are not.
        """
        return self._held if self.mixed is None else np.pad(self._held, (0, self.mixed.count))

    @property
    def is_assembled(self) -> bool:
        """Whether the stiffness has been assembled."""
        return "_assembled" in self.of_body

    @property
    def stiffness(self) -> PETSc.Mat:
        """The matrix of a(., .) on Y_h.  Rows and columns of prescribed unknowns are zero except
        for the diagonal, which has the largest diagonal entry of the matrix.
        """
        return self._assembled[0]

    @property
    def rotation(self) -> PETSc.Mat | None:
        """The matrix Q from the unknowns of the stiffness, those of rigid bodies included, to nodal
        displacements; None if both are the same.
        """
        return self._assembled[1]

    @shared_in("of_contact")
    def contact(self) -> ContactMap:
        """The map B from the unknowns of the stiffness to the relative displacements at contact
        points.
        """
        behind = (
            0 if self.mixed is None else self.comm.bcast(self.mixed.count, root=self.comm.size - 1)
        )
        boundary = self.boundary or no_points(self.space)
        return contact_map(boundary, self.prescribed, self.stiffness, self.rotation, behind)

    def level(self, coarser: MeshLevel | None = None) -> MeshLevel:
        """Return the mesh as a multigrid level above coarser ones.

        Args:
            coarser: the coarser levels, of which those are skipped that have hardly fewer unknowns;
                if the next one has far too few, none is used.
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
        """Return the matrix, loads and contact map that linear algebra needs.

        Args:
            cases: right-hand sides, one for each load.
            coarser: coarser meshes for multigrid; None: there are none.
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
        """Return the right-hand side, the start vector and the rigid resultant of one load.

        Args:
            forces: on the owned dofs, shape (owned dofs,).
            prescribed: displacements of supports, ghosts included, length, shape (dofs,).
            driven: forces and motions that drive rigid bodies; None: there are none.
            pushing: the forces that count in the resultant; None: all ``forces``.
            pressure_load: see ``AppliedLoad``; None: zero.
            lifted: displacements whose internal forces are subtracted from the load; None:
                ``prescribed``.
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
        own.

        Args:
            cases: right-hand sides of the loads.
            factors: load factors of the cases to begin with.
            coarser: coarser meshes for multigrid; None: there are none.
            allowed: gives the regularisation error that path-following may leave at a displacement,
                in the energy norm; None: the share of the energy norm from the settings.
            choose: returns the elastic system and the reason for its kind.
            options: see ``Task``.
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
        """Return the displacement from the initial position, given one that is counted from the
        reference motion.
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
        """Return the displacements of rigid bodies from the initial position, shape (k,).

        Args:
            x: the unknowns, counted from the reference motion.
            resting: the reference motion; None: x is counted from the initial position.
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
        """Write the displacements of rigid bodies into x; the inverse of ``driven``."""
        if resting is not None:
            assert self.motions.foundations is not None
            driven = driven - self.motions.foundations @ resting.motion
        x.getArray()[self.fixed.size : self._held.size] = driven[: self._rigid]

    def unknowns_at(self, displacement: Array, rigid: Array) -> PETSc.Vec:
        """Return the unknowns x of a state; those of a pressure are not set.

        Args:
            displacement: of the nodes, ghosts included, length, shape (dofs,).
            rigid: the unknowns of rigid bodies, shape (k,).
        """
        x = self.vector(displacement)
        if rigid.size:
            self.begin_driven(x, rigid, None)
        return x

    def forces_of(self, values: Array) -> Array:
        """Return the internal forces a(y, .) on the owned dofs, shape (owned dofs,), as if there
        were no supports; collective.

        Args:
            values: y, ghosts included, length, shape (dofs,).
        """
        moved = np.flatnonzero(values.reshape(-1, self.dimension).any(axis=1)).astype(np.int32)
        if not parallel.any_rank(self.comm, moved.size > 0):
            return np.zeros(self.fixed.size)
        displacement = fem.Function(self.space)
        displacement.x.array[:] = values
        forces = action(self.forms, displacement, moved)
        return forces if self.beside is None else forces + self.beside.times(values, self.space)

    def forces_of_free(self, values: Array) -> Array:
        """Return ``forces_of`` the part of a displacement at free dofs.

        The forces are right at free dofs alone, and only if no support is turned.  A product with
        the stiffness takes less time than integrating over all cells.
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
        """Return Q^T y as a new vector of unknowns, for displacements or forces y at the nodes of
        this rank, owned ones first.
        """
        if self.rotation is None:
            return vector_like(self.stiffness, values)
        result, x = self.rotation.createVecs()
        x.getArray()[:] = values.ravel()[: x.getLocalSize()]
        self.rotation.multTranspose(x, result)
        return result

    @property
    def scales(self) -> Scales[float]:
        """The scales that lengths, stresses and energies are compared with."""
        tagged = self.tagged
        return Scales(
            tagged.dimension, self.modulus, tagged.size, self.kinematics.depth(tagged.size)
        )

    def factors(self, step: float) -> Array:
        """Return the load factor of each applied load at a place in the lists of factors, see
        ``statement.load_path``.
        """
        return np.array([load.factor(self.statement, step) for load in self.applied])

    def applied_at(self, step: float) -> list[tuple[float, AppliedLoad]]:
        """Return pairs of load factor and applied load at a place in the lists of factors;
        collective.
        """
        return [(load.factor(self.statement, step), load.at(step)) for load in self.applied]

    def first_sets(self) -> tuple[ActiveSets, int]:
        """Return the active sets to begin with, and the number of the first linear solve as in
        section 7 of the paper: 0 if that solve only computes the start; collective.

        Raises:
            SceneError: no contact point is in the region ``solver.initial_contact``.
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
        """Return the right-hand sides of the applied loads as they are in the first load step;
        collective.
        """
        return tuple(map(self.case_of, self.applied))

    def case_of(self, load: AppliedLoad) -> LoadCase:
        """Return the right-hand side of an applied load; collective."""
        return self.case(
            load.forces, load.prescribed.x.array, load.driven, load.pushing, load.pressure_load
        )

    def loads_at(self, step: float, *, pushing: bool = False) -> Loads:
        """Return the sum of the applied loads times their factors at a place in the lists of
        factors; collective.

        Args:
            step: the place.
            pushing: whether to sum ``pushing`` of each load in place of its forces.
        """
        forces = np.zeros(self.fixed.size)
        prescribed = np.zeros_like(fem.Function(self.space).x.array)
        for factor, load in self.applied_at(step):
            forces += factor * (load.pushing if pushing else load.forces)
            prescribed += factor * load.prescribed.x.array
        return Loads(forces, prescribed)


def vector_like(matrix: PETSc.Mat, values: Array) -> PETSc.Vec:
    """Return a new vector with the column layout of a matrix, filled with values at the nodes of
    this rank, owned ones first.
    """
    x = matrix.createVecRight()
    x.getArray()[:] = values.ravel()[: x.getLocalSize()]
    return x


def sum_of(forms: Sequence[fem.Form], bcs: Sequence[fem.DirichletBC]) -> PETSc.Mat:
    """Return the matrix of a sum of bilinear forms with zero rows and columns at ``bcs``;
    collective.

    The entries are copied: petsc4py never frees the arrays of a matrix to which PETSc adds another
    one with a different pattern.  On one rank dolfinx assembles in half the time of PETSc.
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
