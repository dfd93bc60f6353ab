"""Nodal forces and Cauchy stress of bodies of nonlinear materials, from their states and their UFL.

The stress is evaluated at the quadrature points, where the material has its state.  The fields are
polynomials of degree k - 1 in each cell of degree k, the nearest ones to the values at its points:
those of a higher degree would leave the yield surface at the nodes.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, partial
from typing import TYPE_CHECKING

import basix
import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh

from signorini_fx.arrays import Array, Indices
from signorini_fx.machine.compilation import compiling
from signorini_fx.mechanics.assembly.mesh_entities import strain_degree
from signorini_fx.mechanics.body.nonlinear_law import (
    BodyResidual,
    at_rest,
    body_residual,
    cells_of,
    gradients,
    stress_parts,
    volume_degree,
)
from signorini_fx.mechanics.elasticity.elastic_law import ElementStress, element_at_points
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.results.certificate.nodal_forces import NodalForces
from signorini_fx.results.mechanics import Mechanics
from signorini_fx.results.resultants import NamedForces
from signorini_fx.results.stresses import PointStress, RawStresses

if TYPE_CHECKING:
    from ufl.core.expr import Expr

# Displacements at the ends of load steps, the first one first, with their places in the lists of
# factors.
Path = Sequence[tuple[fem.Function, float]]


class NonlinearForces(NodalForces):
    """Nodal forces of a body of nonlinear materials, see ``NodalForces``, and the stress of its
    load steps.

    Only the material states of the last step are kept: those of all steps would take many times the
    memory of the displacements.
    """

    def __init__(self, statement: Statement, tagged: TaggedMesh, space: fem.FunctionSpace) -> None:
        super().__init__(at_rest(statement), tagged, space)
        self._stated = (statement, tagged)
        self._u = fem.Function(space)
        self._path: tuple[tuple[fem.Function, float], ...] = ()

    @cached_property
    def _body(self) -> BodyResidual:
        """The work of the stress at ``_u``, the displacement of this object."""
        return body_residual(*self._stated, self._u)

    def _move_to(self, displacement: fem.Function, step: float) -> None:
        """Set the displacement and the step."""
        self._u.x.array[:] = displacement.x.array
        self._body.move_to(step)

    def residual(self, displacement: fem.Function, step: float) -> Array:
        """Return the sum of the internal forces of materials without a state and of springs, minus
        the loads, shape (owned dofs,).  Collective.
        """
        self._move_to(displacement, step)
        forms = self._compiled("residual", lambda: [self._body.form])
        return (self._sum(forms) - self.external(step)).ravel()

    def of_followers(self, displacement: fem.Function, step: float) -> list[NamedForces]:
        """Return the forces of loads that follow the body, with their names.  Collective."""
        self._move_to(displacement, step)
        followers = self._body.followers
        loads = list[NamedForces]()
        for effect, work in zip(followers.effects, followers.works, strict=True):
            forms = self._compiled(("follower", id(effect)), partial(list, (work,)))
            loads.append(
                (effect.where, effect.label if effect.carried else "pressure", -self._sum(forms))
            )
        return loads

    def _go_through(self, path: Path) -> None:
        """Update the material states through all load steps of a path; an empty path resets
        them.
        """
        count = len(self._path)
        points = self._body.points
        if count > len(path) or any(
            a is not b for (a, _), (b, _) in zip(self._path, path, strict=False)
        ):
            count = 0
            for state in points:
                state.begun = np.zeros_like(state.begun)
        for displacement, step in path[count:] if points else ():
            self._move_to(displacement, step)
            self._body.update()
            self._body.commit()
        self._path = tuple(path)

    def stress_after(self, path: Path) -> PointStress:
        """Return the Cauchy stress at the quadrature points at the end of a path.  Collective.

        A mean stress that is integrated with fewer points is interpolated by the polynomial through
        them.
        """
        self._go_through(path[:-1])
        self._move_to(*path[-1])
        self._body.update()
        degree = max(1, strain_degree(self.space, self.kinematics))
        mesh = self.space.mesh
        cell = self.space.mesh.topology.cell_name()
        reduced = volume_degree(*self._stated)
        points, weights = basix.make_quadrature(getattr(basix.CellType, cell), degree)
        through = None if reduced is None else element_at_points(cell, reduced).basix_element
        fewer = points if through is None else through.points
        owned = int(mesh.topology.index_map(mesh.topology.dim).size_local)
        x = _evaluated(ufl.SpatialCoordinate(mesh), points, mesh, np.arange(owned, dtype=np.int32))
        stress, mean = (np.zeros((owned, len(at), 3, 3)) for at in (points, fewer))
        for material in self._stated[0].material:
            of_both = gradients(self._u, self.kinematics, reduced)
            parts = stress_parts(material, of_both, self._body.free)
            for part, at, values in zip(parts, (points, fewer), (stress, mean), strict=True):
                if part is not None:
                    cells = cells_of(material, self.tagged)
                    values[cells] = _evaluated(part, at, mesh, cells)
        plastic: Array | None = None
        for state in self._body.points:
            stress[state.cells] = state.cauchy_stress()
            reached = state.material.plastic_strain(
                state.current.reshape(-1, state.material.state_size)
            )
            if reached is not None:
                plastic = np.zeros(stress.shape[:2]) if plastic is None else plastic
                plastic[state.cells] = reached.reshape(state.current.shape[:2])
        if through is not None:
            mean = np.einsum("pq,cqij->cpij", through.tabulate(0, points)[0, :, :, 0], mean)
        return PointStress(points, weights, x[..., : points.shape[1]], stress + mean, plastic)


def _evaluated(expression: Expr, points: Array, mesh: dmesh.Mesh, cells: Indices) -> Array:
    """Return the values of a UFL expression at points of cells, shape (cells, points, ...)."""
    with compiling():
        compiled = fem.Expression(expression, points)
    return np.asarray(compiled.eval(mesh, cells)).reshape(
        len(cells), len(points), *expression.ufl_shape
    )


def nonlinear_stresses(mechanics: Mechanics, forces: NonlinearForces, path: Path) -> RawStresses:
    """Return the Cauchy stress at the end of a path, which at small strains is the stress.
    Collective.

    Nothing is recovered, and no error is estimated.
    """
    at_points = forces.stress_after(path)
    space = mechanics.model.space
    tensor = at_points.on_cells(
        at_points.stress, space.mesh, space.element.basix_element.degree - 1, "stress"
    )
    stress = ElementStress(path[-1][0], forces.kinematics, tensor, lambda _: None, None, None)
    return RawStresses(stress, mechanics, at_points=at_points)
