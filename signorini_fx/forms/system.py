"""The elastic system of a user's forms."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx import parallel
from signorini_fx.body.assembly import assemble
from signorini_fx.body.contact_boundary import ContactBoundary
from signorini_fx.body.contact_map import contact_map
from signorini_fx.body.loads import AppliedLoad, load_case
from signorini_fx.body.mesh_levels import MeshLevel
from signorini_fx.body.pieces import find_pieces
from signorini_fx.body.rigid import rigid_motions
from signorini_fx.errors import FormError
from signorini_fx.forms.elasticity import Array, assembled, modulus_of, without_energy
from signorini_fx.linalg import ElasticSystem
from signorini_fx.linalg.choice import SystemSize, choose_system
from signorini_fx.linalg.elasticity import Elasticity, LoadCase
from signorini_fx.scales import Scales


class FormSystem:
    """Stiffness and rigid motions of a problem; all methods are collective.

    Args:
        space: the displacements.
        a: compiled.
        bcs: the Dirichlet conditions.
        fixed: which owned dofs they prescribe, shape (owned dofs,).
        boundary: the contact points.
        facets: of each foundation.

    Attributes:
        stiffness: a(., .), with the largest of its entries on the diagonal of the prescribed rows.
        motions: the rigid motions without energy that the conditions leave free.
        scales: of lengths and stresses.

    Raises:
        FormError: the form is not symmetric, not positive, or not finite.
    """

    def __init__(
        self,
        space: fem.FunctionSpace,
        a: fem.Form,
        bcs: Sequence[fem.DirichletBC],
        fixed: npt.NDArray[np.bool_],
        boundary: ContactBoundary,
        facets: Sequence[npt.NDArray[np.int32]],
    ) -> None:
        self._space, self._a, self._bcs, self._fixed, self._boundary = space, a, bcs, fixed, boundary
        dim = space.mesh.geometry.dim
        self.stiffness = assembled(a, bcs, fixed)
        diagonal = self.stiffness.getDiagonal()
        self._largest = diagonal.max()[1]
        pieces = find_pieces(space.mesh)
        self.motions = without_energy(rigid_motions(space, fixed.reshape(-1, dim), pieces), self.stiffness)
        size = float(np.linalg.norm(np.ptp(pieces.bounds.reshape(-1, dim), axis=0)))
        self._contact = contact_map(boundary, fixed, self.stiffness, None, dim)
        stiffness = self._contact.stiffness(diagonal)
        self.scales = Scales(dim, modulus_of(space, boundary, stiffness, facets), size)

    def choose(self, linear_algebra: str, L: fem.Form, values: Array) -> tuple[ElasticSystem, str]:
        """The elastic system with a first load, and the reason for its kind.

        Args:
            linear_algebra: see ``SolverSettings``.
            L: compiled.
            values: what is prescribed, ghosts included, shape (dofs,).
        """
        comm, dim, points = self._space.mesh.comm, self._space.mesh.geometry.dim, self._boundary.points
        retained = dim * int(parallel.global_sum(comm, np.array(np.unique(self._boundary.reached).size)))
        held = self.motions.at(self._boundary).held_by(points.everywhere, points.everywhere)
        unknowns = int(self.stiffness.getSize()[0])
        level = MeshLevel(self._space, self._fixed, None, self.motions, None)
        case, free = self.case(L, values), self.motions.free.shape[1]
        elasticity = Elasticity(self.stiffness, self._fixed, [case], self._contact, free, level)
        size = SystemSize(comm, unknowns, dim, retained, held, compressible=True)
        return choose_system(elasticity, size, linear_algebra)

    def case(self, L: fem.Form, values: Array) -> LoadCase:
        """The right-hand side of a load and prescribed displacements, see ``choose``.

        Raises:
            FormError: one of them is not finite.
        """
        function = fem.Function(self._space)
        function.x.array[:] = values
        forces, comm = assemble(L), self._space.mesh.comm
        for name, given in (("bcs", values), ("L", forces)):
            if parallel.any_rank(comm, not np.isfinite(given).all()):
                raise FormError([(name, "is not finite somewhere")])
        applied = AppliedLoad((1.0,), "L", None, forces, function)
        supports: Any = [(None, condition) for condition in self._bcs]
        return load_case(applied, (self._a,), self.stiffness, supports, self._fixed, self._largest, self.motions)
