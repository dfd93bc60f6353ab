"""The error of the stress of a nonlinear body, from its residual alone.

The stress P is what the residual multiplies the gradient of its test function by (of finite strains the first
Piola-Kirchhoff stress).  In each cell it is taken as a polynomial of degree k - 1, and projected onto the continuous
functions of degree 1 in each material; its difference to the projection is measured in L2 (Zienkiewicz and Zhu).  The
error is that of the last load step: what a coarse mesh leaves in the state of a material counts as far as it makes the
stress rough.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse.linalg
import ufl
from dolfinx import fem
from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering
from ufl.algorithms.apply_derivatives import apply_derivatives
from ufl.algorithms.map_integrands import map_integrand_dags
from ufl.corealg.multifunction import MultiFunction

from signorini_fx.machine import parallel
from signorini_fx.machine.compilation import compiling
from signorini_fx.mechanics.assembly.mesh_entities import assemble
from signorini_fx.records import Inventory
from signorini_fx.results.accuracy.stress_recovery import StressRecovery


def stress_error(
    residual: Any, u: fem.Function, parts: Sequence[npt.NDArray[np.int32]]
) -> npt.NDArray[np.float64] | str:
    """What each owned cell has of the squared relative error of the stress in L2, or why it is not known; ``parts``:
    cells of each material, local numbers, ghosts included; collective.
    """
    stress = _Stress(u, stress_of(residual, u), parts)
    recovery = StressRecovery(stress, lambda z: (lambda step: None, None), Inventory())
    size = float(parallel.global_sum(u.function_space.mesh.comm, np.array(stress.square())))
    return np.asarray(recovery.squares(u) / size) if size > 0 else "there is no stress, and no error of it"


def stress_of(residual: Any, u: fem.Function) -> fem.Function:
    """P as a polynomial of degree k - 1 in each cell, its components row by row; collective."""
    mesh, rows = u.function_space.mesh, u.ufl_shape[0]
    columns, degree = mesh.geometry.dim, u.function_space.element.basix_element.degree - 1
    space, scalar = (fem.functionspace(mesh, ("DG", degree, shape)) for shape in ((rows * columns,), ()))
    tested, product = ufl.TestFunction(space), ufl.inner(ufl.TrialFunction(scalar), ufl.TestFunction(scalar))
    tensor = ufl.as_matrix([[tested[i * columns + j] for j in range(columns)] for i in range(rows)])
    lowered = apply_derivatives(apply_algebra_lowering(residual))
    over_cells = ufl.Form([integral for integral in lowered.integrals() if integral.integral_type() == "cell"])
    with compiling():
        moments = fem.form(map_integrand_dags(_GivenGradient(tensor), over_cells))
        mass = fem.assemble_matrix(fem.form(product * ufl.dx)).to_scipy()
    owned = scalar.dofmap.index_map.size_local
    stress = fem.Function(space)
    values = assemble(moments).reshape(owned, rows * columns)
    if owned:
        stress.x.array[: values.size] = scipy.sparse.linalg.splu(mass[:owned, :owned].tocsc()).solve(values).ravel()
    stress.x.scatter_forward()
    return stress


@dataclass(frozen=True)
class _Stress:
    """P as ``StressRecovery`` sees the stress of linear elasticity, see ``ElementStress``.

    Attributes:
        displacement: u.
        components: of P, a function.
        parts: see ``stress_error``.
    """

    displacement: fem.Function
    components: fem.Function
    parts: Sequence[npt.NDArray[np.int32]]

    def squared(self, difference: Any, times: Any, dx: Any) -> Any:
        """See ``ElementStress``: without a compliance."""
        return times * ufl.inner(difference, difference) * dx

    def square(self) -> float:
        """The part of this rank of the squared norm of P."""
        with compiling():
            return float(np.real(fem.assemble_scalar(fem.form(ufl.inner(self.components, self.components) * ufl.dx))))

    def refresh(self, step: float) -> None:
        """P is that of one load step."""


class _GivenGradient(MultiFunction):  # type: ignore[misc]  # UFL has no types
    """A tensor in the place of the gradient of an argument, and zero in that of the argument itself."""

    expr = MultiFunction.reuse_if_untouched

    def __init__(self, tensor: Any) -> None:
        super().__init__()
        self._tensor = tensor

    def grad(self, gradient: Any) -> Any:
        return self._tensor if isinstance(gradient.ufl_operands[0], ufl.Argument) else gradient

    def argument(self, argument: Any) -> Any:
        return ufl.zero(argument.ufl_shape)
