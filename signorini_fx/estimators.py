"""How wrong a discrete solution is: error estimates in the energy norm."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from signorini_fx import parallel
from signorini_fx.discretisation import Discretisation
from signorini_fx.material import stress

_PROJECTION_TOLERANCE = 1e-6


class StressRecovery:
    """Zienkiewicz and Zhu's estimate of the discretisation error; compiled and assembled once, asked often.

    The stress is projected onto the continuous functions of degree 1, and its difference to the discontinuous stress is
    measured with the compliance.  Functions of degree 2 would be so close to the stress of quadratic elements that half
    of the error went unseen.
    """

    def __init__(self, discretisation: Discretisation) -> None:
        d = discretisation
        self._comm = d.tagged.mesh.comm
        self._displacement = fem.Function(d.space)
        space = fem.functionspace(d.tagged.mesh, ("Lagrange", 1, (3,)))
        self._recovered = fem.Function(space)
        z = ufl.TestFunction(space)
        sigma = stress(self._displacement, *d.lame)
        raw = ufl.as_vector((sigma[0, 0], sigma[1, 1], sigma[0, 1]))
        compiled = d.inventory.compile
        self._moments = compiled("stress moments", lambda: fem.form(ufl.inner(raw, z) * ufl.dx))
        density = _compliance(self._recovered - raw, *d.lame)
        cellwise = ufl.TestFunction(fem.functionspace(d.tagged.mesh, ("DG", 0)))
        self._squares = compiled("stress recovery error", lambda: fem.form(density * cellwise * ufl.dx))
        # The three components share one matrix: dolfinx numbers the nodes of both spaces alike.
        scalar = fem.functionspace(d.tagged.mesh, ("Lagrange", 1))
        assert np.array_equal(scalar.dofmap.list, space.dofmap.list)
        product = ufl.inner(ufl.TrialFunction(scalar), ufl.TestFunction(scalar)) * ufl.dx
        mass = fem_petsc.assemble_matrix(compiled("stress mass", lambda: fem.form(product)))
        mass.assemble()
        d.inventory.matrices.append("stress mass")
        self._ksp = PETSc.KSP().create(self._comm)
        self._ksp.setOperators(mass)
        self._ksp.setType(PETSc.KSP.Type.CG)
        self._ksp.getPC().setType(PETSc.PC.Type.JACOBI)
        self._ksp.setTolerances(rtol=_PROJECTION_TOLERANCE)
        self._moment, self._component = mass.createVecs()

    def error(self, x: PETSc.Vec) -> float:
        """Energy norm sqrt(a(e, e)) of the discretisation error of the displacement dofs ``x``; collective."""
        return float(np.sqrt(parallel.global_sum(self._comm, self.squares(x).sum())))

    def squares(self, x: PETSc.Vec) -> npt.NDArray[np.float64]:
        """Its square for each owned cell, shape (cells,); collective."""
        _fill(self._displacement, x)
        moments = fem_petsc.assemble_vector(self._moments)
        moments.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)
        owned = moments.getLocalSize()
        for k in range(3):
            self._moment.getArray()[:] = moments.getArray(readonly=True)[k::3]
            self._ksp.solve(self._moment, self._component)
            self._recovered.x.array[k:owned:3] = self._component.getArray(readonly=True)
        self._recovered.x.scatter_forward()
        squares = fem_petsc.assemble_vector(self._squares)
        squares.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)
        return np.maximum(squares.getArray(), 0.0)


def _fill(function: fem.Function, x: PETSc.Vec) -> None:
    function.x.array[: x.getLocalSize()] = x.getArray(readonly=True)
    function.x.scatter_forward()


def _compliance(tau: Any, lame: Any, mu: Any) -> Any:
    """C^-1 tau : tau for a stress tau = (xx, yy, xy)."""
    trace = tau[0] + tau[1]
    return (tau[0] ** 2 + tau[1] ** 2 + 2 * tau[2] ** 2 - lame / (2 * (lame + mu)) * trace**2) / (2 * mu)
