"""The verdict on stability: whether displacements that contact admits raise the energy, by the derivative of F."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.algebra.linalg.condensed import CondensedSystem
from signorini_fx.errors import FormError
from signorini_fx.forms.arguments import conditions_of
from signorini_fx.forms.nonlinear.inertia import ToolsAtPoints, negative_directions
from signorini_fx.forms.nonlinear.linearised import LinearisedProblem
from signorini_fx.forms.nonlinear.moving_shapes import turning_of
from signorini_fx.forms.nonlinear.residual import Residual
from signorini_fx.forms.nonlinear.tangent import Tangents, is_derivative
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import node_positions
from signorini_fx.mechanics.assembly.nodal_stiffness import NodalStiffness
from signorini_fx.records import Status

Array = npt.NDArray[np.float64]


@dataclass
class Stability:
    """What the inertia of the tangent says of a displacement.

    Attributes:
        u: the displacement.
        linear: the contact problem of the last iteration of Newton's method.
        tangents: the user's and the derivative of F.
        residual: F.
        where: an instability that was found begins, in words.
    """

    u: fem.Function
    linear: LinearisedProblem
    tangents: Tangents
    residual: Residual
    where: str = ""

    def verdict(self) -> Status:
        """Whether an equilibrium is stable, by the derivative of F; collective."""
        if not self.linear.factor_fits or (tangent := self._derivative()) is None:
            return Status.STABILITY_UNKNOWN
        if tangent is self.tangents.leading and self._is_definite:
            return Status.CONVERGED
        self.linear.bend()
        negative, direction = self._negative(tangent)
        if not negative:
            return Status.CONVERGED
        self.where = self._most_moved(direction)
        # Without an energy a symmetric part that is not definite proves nothing.
        return Status.UNSTABLE if self.linear.symmetric else Status.STABILITY_UNKNOWN

    @property
    def _is_definite(self) -> bool:
        """Whether the last tangent is known to be positive definite without contact, and so it is with it.

        A matrix has as many negative eigenvalues as what is eliminated and what is left together (E. V. Haynsworth,
        Linear Algebra and its Applications 1 (1968) 73-81).
        """
        linear, system = self.linear, self.linear.task.system
        plain = linear.can_keep_stiffness and self.u.function_space.mesh.comm.size == 1
        if not plain or not isinstance(system, CondensedSystem) or not system.schur.positive_inside:
            return False
        try:
            np.linalg.cholesky(system.schur.dense)
        except np.linalg.LinAlgError:
            return False
        return True

    def reason_for_none(self, before: Array, tried: Array | None = None) -> str:
        """Why there may be no solution, at an iterate; empty: nothing says so; collective.

        Args:
            before: the last solution, values of ``u``.
            tried: where the tangent leads to, and no part of the way is possible, likewise; None: not so.
        """
        comm, size = self.u.function_space.mesh.comm, self.linear.extent
        farthest = self.u.x.array if tried is None else tried
        away = float(parallel.largest(comm, np.abs(farthest - before), 0.0))
        if not away <= max(size, float(parallel.largest(comm, np.abs(before), 0.0))):
            return "the displacement runs away" if self.leads(before) else ""
        with suppress(FormError):
            forces = self.residual.at(self.u.x.array.copy())
            known = forces is not None and self.linear.solved.outcome is not None and self.linear.factor_fits
            if known and (tangent := self._derivative()) is not None:
                self.linear.bend()
                if self._negative(tangent)[0]:
                    return "the tangent has lost its stiffness in some direction"
        return ""

    def leads(self, values: Array) -> bool:
        """Whether the tangent that leads Newton's method is the derivative of F at values of ``u``; collective.

        Another one may lead away from any equilibrium.
        """
        if not self.tangents.given or self.tangents.trusted:
            return True
        self.residual.go_to(values)
        fits = is_derivative(self.tangents.leading, self.u, self.residual.at, ~self._fixed)
        self.residual.go_to(values)
        return fits

    @property
    def _fixed(self) -> npt.NDArray[np.bool_]:
        """Which of the owned unknowns are prescribed."""
        dofmap = self.u.function_space.dofmap
        return self.linear.prescribed[0][: dofmap.index_map.size_local * dofmap.index_map_bs]

    def _derivative(self) -> fem.Form | None:
        """The user's tangent if it is the derivative of F at ``u``, else that of UFL; None: neither is; collective."""
        if self.tangents.trusted:
            return self.tangents.leading
        free, values = ~self._fixed, self.u.x.array.copy()
        for given in (True, False) if self.tangents.given else (False,):
            tangent = self.tangents.leading if given else self.tangents.derivative
            fits = is_derivative(tangent, self.u, self.residual.at, free)
            self.residual.go_to(values)
            if fits:
                return tangent
        return None

    def _most_moved(self, direction: Array) -> str:
        """Where a displacement of the owned nodes is largest, in words; collective."""
        space, dim = self.u.function_space, self.u.function_space.mesh.geometry.dim
        sizes = np.linalg.norm(direction.reshape(-1, dim), axis=1)
        places = node_positions(space)[: sizes.size, :dim]
        rows = np.column_stack((sizes, places))[np.argsort(-sizes, kind="stable")[:1]]
        farthest = max(map(tuple, parallel.gather_rows(space.mesh.comm, rows)))
        return f"it begins at ({', '.join(f'{x:.4g}' for x in farthest[1:])})"

    def _negative(self, tangent: fem.Form) -> tuple[int, Array]:
        """See ``negative_directions``: of a tangent, or its symmetric part, with the curvature of now; collective."""
        linear = self.linear
        bcs = conditions_of(linear.bcs, self.u.function_space)
        nodes = linear.state.boundary.nodes
        turning, relative = turning_of(linear.state, linear.scales.size), linear.relative
        if relative is None:
            at_points, tools = turning, None
        else:  # at the nodes is what a tool that stands still does
            dim, blocks = turning.shape[1], relative.blocks.copy()
            at_points = turning + blocks[:, :dim, :dim]
            blocks[:, :dim, :dim] += np.where((relative.tool >= 0)[:, None, None], turning, 0.0)
            tools = self._tools(relative.tool, blocks)
        curvature, blocks = linear.curvature, np.concatenate((linear.curvature.blocks, at_points))
        beside = NodalStiffness.summed(np.concatenate((curvature.nodes, nodes)), blocks, curvature.joint)
        judged = linear.holding, tools, linear.symmetric, bool(linear.loose)
        return negative_directions(tangent, bcs, self._fixed, beside, nodes, linear.held, *judged)

    def _tools(self, tool: npt.NDArray[np.int64], blocks: Array) -> ToolsAtPoints:
        """The tools, of which each point touches one or none, with what their relative displacements meet."""
        bodies, moving = self.linear.moving_tools.bodies, self.linear.state.boundary.moving
        assert moving is not None
        shape = len(bodies.bodies), blocks.shape[2]
        each = moving.modes.reshape(*moving.modes.shape[:2], *shape)
        modes = each[np.arange(len(tool)), :, tool]
        return ToolsAtPoints(tool, modes, blocks, bodies.fixed.reshape(shape), bodies.stiffness.reshape(shape))
