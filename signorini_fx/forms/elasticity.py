"""The elastic system of a user's forms: stiffness, loads, prescribed displacements and free rigid motions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem, la
from dolfinx import mesh as dmesh
from petsc4py import PETSc

from signorini_fx.errors import FormError
from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.assembly.mesh_entities import facet_entities
from signorini_fx.mechanics.assembly.pieces import find_pieces
from signorini_fx.mechanics.body.elastic_body import ElasticBody
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.kinematics import CARTESIAN
from signorini_fx.mechanics.scales import Scales
from signorini_fx.mechanics.statement.settings import SolverSettings
from signorini_fx.tuned import NOTHING_LEFT

Array = npt.NDArray[np.float64]


def digest(form: fem.Form, *arrays: npt.NDArray[Any]) -> tuple[int, ...]:
    """A fingerprint of what a form is assembled from on this rank (constants, coefficients, positions of the mesh), and
    of other arrays: hashes of 64 bits with the key of this process, in an eighth of the time of a cryptographic one.
    """
    return tuple(hash(values.tobytes()) for values in (*compat.form_data(form), form.mesh.geometry.x, *arrays))


def elastic_body(
    space: fem.FunctionSpace,
    a: fem.Form,
    bcs: Sequence[fem.DirichletBC],
    fixed: npt.NDArray[np.bool_],
    boundary: ContactBoundary | None,
    settings: SolverSettings,
    **more: Any,
) -> ElasticBody:
    """The elastic body of a user's form, assembled, see ``ElasticBody``; with a stiffness that is ``of_body`` nothing
    is; collective.
    """
    body = ElasticBody(
        space=space,
        terms=lambda: (a,),
        resists=None,
        bcs=bcs,
        turned=None,
        fixed=fixed,
        pieces=find_pieces(space.mesh),
        boundary=boundary,
        settings=settings,
        kinematics=CARTESIAN[space.mesh.geometry.dim],
        **more,
    )
    if not body.is_assembled:
        check_energy(body.stiffness, fixed.size, definite=body.definite, symmetric=body.symmetric)
    return body


NOT_FINITE = "its matrix is not finite: check its coefficients"
NOT_SYMMETRIC = "is not symmetric: a(y, z) and a(z, y) differ; friction is what contact= adds"
NOT_POSITIVE = "is not positive: a(z, z) is not for some basis function z; check its sign"


class MatrixError(FormError):
    """The matrix of a form cannot be used."""

    @property
    def fault(self) -> str:
        """Why, one of the above."""
        return self.problems[0][1]


def check_energy(matrix: PETSc.Mat, owned: int, *, definite: bool = True, symmetric: bool = True) -> None:
    """Whether a(x, y) = a(y, x) for two random vectors, and a(z, z) > 0 for each basis function z of the ``owned``
    unknowns of the body; collective.

    Raises:
        MatrixError: the form is not symmetric, not positive, or not finite.
    """
    x, y = matrix.createVecs()
    generator = np.random.default_rng(matrix.comm.rank)
    for vector in (x, y):
        vector.getArray()[:] = generator.standard_normal(vector.getLocalSize())
    forces, forces_of_y = x.duplicate(), x.duplicate()
    matrix.mult(x, forces)
    matrix.mult(y, forces_of_y)
    size = forces.norm()
    if not np.isfinite(size):
        raise MatrixError([("a", NOT_FINITE)])
    if symmetric and abs(forces.dot(y) - forces_of_y.dot(x)) > NOTHING_LEFT * size:
        raise MatrixError([("a", NOT_SYMMETRIC)])
    if not definite:
        return
    diagonal = matrix.getDiagonal().getArray(readonly=True)[:owned]
    if parallel.any_rank(matrix.comm.tompi4py(), bool((diagonal <= 0).any())):
        raise MatrixError([("a", NOT_POSITIVE)])


def scales_of(
    body: ElasticBody,
    boundary: ContactBoundary,
    facets: Sequence[npt.NDArray[np.int32]],
    size: float,
    modulus: float | None = None,
) -> Scales:
    """Size of a body, and its modulus, the scale of gamma; collective.

    Where the modulus is not known it is that of the stiffness near the contact points; without contact that of the
    whole body, from a geometric mean of what nodes meet that move alone, about E h^(d - 2).

    A point that moves alone strains the cells around it, which are of the size l along the boundary and h across it:
    per area it meets about E (1 / h + h / l^2).
    """
    if modulus is not None:
        return Scales(body.space.mesh.topology.dim, modulus, size)
    space, diagonal = body.space, body.stiffness.getDiagonal()
    if body.relative is not None:  # what turning normals do to rigid bodies is no stiffness of the body
        diagonal.getArray()[body.fixed.size :] = 0.0
    mesh, dim = space.mesh, space.mesh.topology.dim
    if body.boundary is None:
        # Of logarithms: a few entries of a penalty would make an arithmetic mean that of the penalty.
        free = np.abs(diagonal.getArray(readonly=True)[~body.prescribed])
        units = mesh.h(dim, np.arange(mesh.topology.index_map(dim).size_local, dtype=np.int32)) ** (dim - 2)
        logarithms = [np.log(values[values > 0]) for values in (free, units)]
        totals = parallel.global_sum(
            boundary.comm, np.array([(values.sum(), values.size) for values in logarithms]).ravel()
        )
        return Scales(dim, float(np.exp(totals[0] / max(totals[1], 1.0) - totals[2] / totals[3])), size)
    stiffness, listed = body.contact.stiffness(diagonal), np.concatenate(list(facets))
    across = 2 * (
        dmesh.compute_midpoints(mesh, dim, facet_entities(mesh, listed)[:, 0])
        - dmesh.compute_midpoints(mesh, dim - 1, listed)
    )
    along, across = mesh.h(dim - 1, listed), np.linalg.norm(across, axis=1)
    inverse, degree = 1 / across + across / along**2, space.element.basix_element.degree
    sums = fem.Function(space)
    array = sums.x.array.reshape(-1, mesh.geometry.dim)
    for node in boundary.segments[:, 1:].T:
        local = space.dofmap.index_map.global_to_local(np.ascontiguousarray(node))
        np.add.at(array[:, :2], local, np.column_stack((inverse, np.ones(inverse.size))))
    sums.x.scatter_reverse(la.InsertMode.add)
    total, count = array[boundary.nodes, :2].T
    moves = stiffness > 0
    weight, unit = boundary.weight[moves], degree * total[moves] / count[moves]
    weights, compliance = parallel.global_sum(
        boundary.comm, np.array([weight.sum(), weight @ (unit / stiffness[moves])])
    )
    return Scales(dim, float(weights / compliance), size)
