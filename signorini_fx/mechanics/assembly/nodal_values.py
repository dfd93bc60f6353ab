"""Coefficients of a foundation at boundary nodes: numbers, callables, UFL expressions and
Functions.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
import ufl
from dolfinx import fem

from signorini_fx.arrays import Array, Expr, Indices, Value
from signorini_fx.errors import FormError
from signorini_fx.machine import compat, parallel
from signorini_fx.machine.compilation import compiling
from signorini_fx.mechanics.assembly.mesh_entities import marked_nodes, node_positions
from signorini_fx.mechanics.statement.expressions import in_space, real_numbers
from signorini_fx.tuned import LARGEST_NUMBER


class NodalValues:
    """Evaluates coefficients at the nodes of a vector Lagrange space on a part of the boundary.

    UFL expressions are compiled once, and evaluated only in the cells at these nodes, so that they
    may be singular elsewhere.  If an expression jumps between cells, one of its values is taken.
    """

    def __init__(self, space: fem.FunctionSpace, facets: Indices) -> None:
        self._space = space
        self._dimension = int(space.mesh.geometry.dim)
        nodes = fem.locate_dofs_topological(space, space.mesh.topology.dim - 1, facets)
        self.nodes = np.flatnonzero(marked_nodes(space, nodes))
        self._compiled: dict[int, tuple[fem.Expression, fem.Function, Expr]] = {}

    @cached_property
    def _cells(self) -> Indices:
        """The cells of this rank that have one of the nodes."""
        return np.flatnonzero(np.isin(self._space.dofmap.list, self.nodes).any(axis=1)).astype(
            np.int32
        )

    def __call__(
        self,
        value: Value | Sequence[float],
        name: str,
        components: int = 1,
        minimum: float = -np.inf,
    ) -> Array:
        """Return the values at all nodes of this rank, ghosts included, nan where no facet is;
        collective.

        Args:
            value: the coefficient.
            name: of the argument that it is, for messages.
            components: 1, or d for vectors.
            minimum: smallest value allowed.

        Returns:
            Values of shape (nodes,), or (nodes, components) if there are several.

        Raises:
            FormError: the coefficient cannot be evaluated, or has values out of range.
        """
        comm = self._space.mesh.comm
        error = None
        x = node_positions(self._space)
        nodal_values = np.full((len(x), components), np.nan)
        try:
            if hasattr(value, "ufl_shape"):
                expression, function, _ = self._expression(value, components)
                function.interpolate(expression, cells0=self._cells)
                nodal_values[self.nodes] = function.x.array.reshape(-1, self._space.dofmap.bs)[
                    self.nodes, :components
                ]
            else:
                point_values = real_numbers(
                    value(in_space(x[self.nodes])) if callable(value) else value
                )
                if point_values.ndim < 2 and components > 1:  # one vector for all points
                    point_values = point_values[:, None]
                rows = point_values[:components] if components > 1 else point_values
                nodal_values[self.nodes] = np.broadcast_to(rows, (components, self.nodes.size)).T
            at = nodal_values[self.nodes]
            bad = np.flatnonzero((~(np.abs(at) <= LARGEST_NUMBER) | (at < minimum)).any(axis=1))
            if bad.size:
                position = ", ".join(f"{c:g}" for c in x[self.nodes[bad[0]], : self._dimension])
                wanted = f"a number of at most {LARGEST_NUMBER:g}"
                wanted += "" if minimum == -np.inf else ", and not negative"
                wrong = ", ".join(f"{c:g}" for c in at[bad[0]])
                error = FormError.at(name, f"is {wrong} at ({position}); it must be {wanted}")
        except Exception as failure:  # of the user's callable, perhaps on one rank only
            error = FormError.at(name, f"cannot be evaluated at the contact points: {failure}")
        parallel.raise_together(comm, error)
        return nodal_values[:, 0] if components == 1 else nodal_values

    def _expression(
        self, value: Expr, components: int
    ) -> tuple[fem.Expression, fem.Function, Expr]:
        """Return the compiled expression, a Function of the displacement space for its values, and
        the UFL value, which must stay alive for the cache.

        Raises:
            ValueError: it has another shape or mesh.
        """
        compiled = self._compiled.get(id(value))
        if compiled is None:
            shape = tuple(value.ufl_shape)
            if shape != (() if components == 1 else (components,)):
                raise ValueError(f"it has the shape {shape}")
            domain = ufl.domain.extract_unique_domain(value)
            if domain is not None and domain != self._space.mesh.ufl_domain():
                raise ValueError("it is given on another mesh")
            vector = (
                value if components > 1 else ufl.as_vector([value] + [0.0] * (self._dimension - 1))
            )
            with compiling():
                expression = fem.Expression(
                    vector, compat.interpolation_points(self._space.element)
                )
            compiled = self._compiled[id(value)] = expression, fem.Function(self._space), value
        return compiled
