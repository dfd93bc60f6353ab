"""How wrong a discrete solution is: error estimates in the energy norm."""

from __future__ import annotations

from typing import Any

import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from signorini_fx.discretisation import Discretisation
from signorini_fx.material import stress

_PROJECTION_TOLERANCE = 1e-6


def recovery_error(discretisation: Discretisation, displacement: fem.Function) -> float:
    """Energy norm sqrt(a(e, e)) of the discretisation error by stress recovery (Zienkiewicz and Zhu); collective.

    The stress is projected onto the continuous functions of the displacement's degree, and its difference to the
    discontinuous stress is measured with the compliance.
    """
    d = discretisation
    space = fem.functionspace(d.tagged.mesh, ("Lagrange", d.scene.element.degree, (3,)))
    y, z = ufl.TrialFunction(space), ufl.TestFunction(space)
    sigma = stress(displacement, *d.lame)
    raw = ufl.as_vector((sigma[0, 0], sigma[1, 1], sigma[0, 1]))
    mass = fem_petsc.assemble_matrix(fem.form(ufl.inner(y, z) * ufl.dx))
    mass.assemble()
    moments = fem_petsc.assemble_vector(fem.form(ufl.inner(raw, z) * ufl.dx))
    moments.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)
    projection = mass.createVecRight()
    ksp = PETSc.KSP().create(d.tagged.mesh.comm)
    ksp.setOperators(mass)
    ksp.setType(PETSc.KSP.Type.CG)
    ksp.getPC().setType(PETSc.PC.Type.JACOBI)
    ksp.setTolerances(rtol=_PROJECTION_TOLERANCE)
    ksp.solve(moments, projection)
    recovered = fem.Function(space)
    recovered.x.array[: projection.getLocalSize()] = projection.getArray(readonly=True)
    recovered.x.scatter_forward()
    return _compliance_norm(d, recovered - raw)


def _compliance_norm(d: Discretisation, tau: Any) -> float:
    """Sqrt of the integral of C^-1 tau : tau for a stress tau = (xx, yy, xy)."""
    lame, mu = d.lame
    trace = tau[0] + tau[1]
    density = (tau[0] ** 2 + tau[1] ** 2 + 2 * tau[2] ** 2 - lame / (2 * (lame + mu)) * trace**2) / (2 * mu)
    value = d.tagged.mesh.comm.allreduce(fem.assemble_scalar(fem.form(density * ufl.dx)))
    return float(np.sqrt(max(value, 0.0)))
