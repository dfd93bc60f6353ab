"""The elastic system of a symmetric form with supports and contact points: stiffness, load cases and contact map.

It is the same for the forms of a scene and for those of a user.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from signorini_fx import parallel
from signorini_fx.body.assembly import action
from signorini_fx.body.contact_boundary import ContactBoundary
from signorini_fx.body.contact_map import contact_map
from signorini_fx.body.mesh_levels import MeshLevel
from signorini_fx.body.rigid import RigidMotions, nearest_motion
from signorini_fx.body.turned_supports import TurnedNodes, block_rotation
from signorini_fx.contact.map import ContactMap
from signorini_fx.contact.motions import FreeMotions
from signorini_fx.linalg.choice import SystemSize
from signorini_fx.linalg.elasticity import Elasticity, LoadCase
from signorini_fx.tuned import FINER_LEVELS

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class ElasticBody:
    """A symmetric form a(., .) on a vector Lagrange space with supports and contact points.

    Attributes:
        space: Y_h, of the displacement.
        forms: the compiled terms of a(., .).
        fixed: which unknowns of this rank are prescribed, shape (owned dofs,).
        motions: the rigid motions that are free.
        boundary: the contact points; None: there are none.
        turned: nodes with supports along no axis; None: there are none.
        stiffness: a(., .) on Y_h, symmetric; prescribed rows and columns are eliminated and have its largest entry on
            their diagonal.
        rotation: Q from the unknowns of the stiffness to displacements; None: they are the same.
    """

    space: fem.FunctionSpace
    forms: tuple[fem.Form, ...]
    fixed: npt.NDArray[np.bool_]
    motions: RigidMotions
    boundary: ContactBoundary | None
    turned: TurnedNodes | None
    stiffness: PETSc.Mat
    rotation: PETSc.Mat | None

    @classmethod
    def assembled(
        cls,
        space: fem.FunctionSpace,
        forms: tuple[fem.Form, ...],
        bcs: Sequence[fem.DirichletBC],
        fixed: npt.NDArray[np.bool_],
        motions: RigidMotions,
        boundary: ContactBoundary | None = None,
        turned: TurnedNodes | None = None,
        *,
        aligned: bool = False,
    ) -> ElasticBody:
        """Assemble the stiffness; collective.

        Args:
            space: see above.
            forms: see above.
            bcs: the supports along the axes.
            fixed: what these and those of ``turned`` prescribe.
            motions: see above.
            boundary: see above.
            turned: see above.
            aligned: whether each component of a relative displacement must be an unknown, as without regularisation.

        Raises:
            SceneError: that is impossible, see ``ContactBoundary.aligned``.
        """
        owned = space.dofmap.index_map.size_local
        frames = [] if turned is None else [(turned.nodes[own := turned.nodes < owned], turned.frames[own])]
        if aligned and boundary is not None and (found := boundary.aligned()) is not None:
            frames.append(found)
        conditions = [] if frames else list(bcs)
        stiffness = fem_petsc.assemble_matrix(forms[0], conditions, 0.0)
        for form in forms[1:]:
            stiffness.assemble()
            fem_petsc.assemble_matrix(stiffness, form, conditions, 0.0)  # type: ignore[arg-type]
        stiffness.assemble()
        rotation = None
        if frames:
            rotation = block_rotation(stiffness, frames)
            stiffness = stiffness.ptap(rotation)
            stiffness.setOption(PETSc.Mat.Option.KEEP_NONZERO_PATTERN, True)
            first = stiffness.getOwnershipRange()[0]
            stiffness.zeroRowsColumns((first + np.flatnonzero(fixed)).astype(PETSc.IntType), diag=0.0)
        diagonal = stiffness.getDiagonal()
        values = diagonal.getArray()
        # In any unit it is neither small nor large beside the other entries.
        values[fixed] = parallel.global_max(space.mesh.comm, parallel.local_max(values)) or 1.0
        stiffness.setDiagonal(diagonal)
        stiffness.setOption(PETSc.Mat.Option.SPD, True)
        return cls(space, forms, fixed, motions, boundary, turned, stiffness, rotation)

    @cached_property
    def contact(self) -> ContactMap:
        """B from the unknowns of the stiffness; collective."""
        return contact_map(self.boundary, self.fixed, self.stiffness, self.rotation, self.space.mesh.geometry.dim)

    def level(self, coarser: MeshLevel | None = None, solved: fem.Function | None = None) -> MeshLevel:
        """Its mesh over coarser ones, of which those are left out that are hardly coarser, or far too coarse."""
        dimension, (least, most) = self.space.mesh.geometry.dim, FINER_LEVELS
        found = MeshLevel(self.space, self.fixed, self.rotation, self.motions, coarser, solved)
        while found.coarser is not None and found.dofs < least**dimension * found.coarser.dofs:
            found.coarser = found.coarser.coarser
        if found.coarser is not None and found.dofs > most**dimension * found.coarser.dofs:
            found.coarser = None
        return found

    def elasticity(self, cases: Sequence[LoadCase], coarser: MeshLevel | None = None) -> Elasticity:
        """What linear algebra needs to know of the body; ``coarser``: coarser meshes for multigrid."""
        free = self.motions.free.shape[1]
        return Elasticity(self.stiffness, self.fixed, cases, self.contact, free, self.level(coarser))

    def case(self, forces: Array, prescribed: fem.Function) -> LoadCase:
        """The right-hand side of loads and prescribed displacements, which are lifted; collective.

        Args:
            forces: L at the owned dofs, shape (owned dofs,).
            prescribed: zero, with the prescribed displacements put in.
        """
        comm, dim = self.space.mesh.comm, self.space.mesh.geometry.dim
        given, moved = prescribed.x.array[: forces.size], prescribed.x.array.reshape(-1, dim).any(axis=1)
        lifted, start = forces, self.vector(given)
        if parallel.any_rank(comm, bool(moved.any())):
            lifted = forces - action(self.forms, prescribed, np.flatnonzero(moved).astype(np.int32))
            nearest = nearest_motion(
                self.motions, self.fixed.reshape(-1, dim), given.reshape(-1, dim), self.turned, comm
            )
            free = self.vector(nearest).getArray(readonly=True)
            start.getArray()[~self.fixed] = free[~self.fixed]
        load = self.vector(lifted)
        diagonal = self.stiffness.getDiagonal().getArray(readonly=True)
        load.getArray()[self.fixed] = (diagonal * start.getArray(readonly=True))[self.fixed]
        return LoadCase(load, start, self.motions.load_of(forces, comm))

    def function(self, x: PETSc.Vec, name: str = "displacement") -> fem.Function:
        """The finite element function with the unknowns ``x``."""
        if self.rotation is not None:
            y = x.duplicate()
            self.rotation.mult(x, y)
            x = y
        function = fem.Function(self.space, name=name)
        function.x.array[: x.getLocalSize()] = x.getArray(readonly=True)
        function.x.scatter_forward()
        return function

    def energy_norm(self, x: PETSc.Vec) -> float:
        """Sqrt(a(y, y)) of a displacement, with what is prescribed; collective."""
        y, dim = self.function(x), self.space.mesh.geometry.dim
        forces = action(self.forms, y, np.arange(y.x.array.size // dim, dtype=np.int32))
        twice = float(parallel.global_sum(self.space.mesh.comm, forces @ y.x.array[: forces.size]))
        return float(np.sqrt(max(0.0, twice)))

    def unknowns(self, function: fem.Function) -> PETSc.Vec:
        """The unknowns x of a finite element function, the inverse of ``function``."""
        return self.vector(function.x.array)

    def vector(self, values: Array) -> PETSc.Vec:
        """A new vector Q^T y of displacements or forces at the nodes of this rank, the owned ones first."""
        x = vector_like(self.stiffness, values)
        if self.rotation is None:
            return x
        result = x.duplicate()
        self.rotation.multTranspose(x, result)
        return result


def vector_like(matrix: PETSc.Mat, values: Array) -> PETSc.Vec:
    """Values at the nodes of this rank, the owned ones first, as a new vector with the layout of a matrix."""
    x = matrix.createVecRight()
    x.getArray()[:] = values.ravel()[: x.getLocalSize()]
    return x


def system_size(
    space: fem.FunctionSpace, boundary: ContactBoundary | None, motions: FreeMotions | None, *, compressible: bool
) -> SystemSize:
    """The figures that decide which kind of elastic system a body gets; collective.

    Args:
        space: the displacements.
        boundary: the contact points; None: there are none.
        motions: the free rigid motions at these.
        compressible: whether the material is far enough from incompressible for multigrid.
    """
    comm, dim = space.mesh.comm, int(space.dofmap.index_map_bs)
    retained, held = 0, False
    if boundary is not None and motions is not None:
        retained = dim * int(parallel.global_sum(comm, np.array(np.unique(boundary.reached).size)))
        everywhere: Any = boundary.points.everywhere
        held = motions.held_by(everywhere, everywhere)
    return SystemSize(comm, dim * int(space.dofmap.index_map.size_global), dim, retained, held, compressible)
