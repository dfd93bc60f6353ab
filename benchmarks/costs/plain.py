"""Example 1 with Tresca friction the plain way: one residual in UFL, its derivative by UFL, PETSc's SNES.

Everything is assembled and factorised anew in each step.  The max and min of (3.3b) and (3.4) are integrated by the
vertex rule, with which this program is faster than with Gauss points, and with which it solves the same problem as the
other contestants.  Newton's method cycles where gamma is large: a node changes from one slip set to the other and back.
Therefore gamma is raised step by step, starting from the previous solution; a step that fails is halved.

These settings are the fastest of those that were tried: the line search ``cp`` (``basic``, ``bt`` and ``l2`` need
smaller steps), at most 12 iterations before a step counts as failed, Cholesky rather than LU.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass

import example1
import linear
import numpy as np
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from example1 import Answer, Floats
from petsc4py import PETSc

from signorini_fx.mechanics.mesh.tagged import TaggedMesh

FIRST_GAMMA = 1e4
_FACTOR = 10.0
_ITERATIONS = 12
_SMALLEST_FACTOR = 1.002
_DOWN = -1e-2  # the initial displacement: in contact everywhere, since otherwise nothing would hold the body


class Unfinished(Exception):
    """The time limit was reached before the last gamma."""


@dataclass
class _Plain:
    """The compiled forms and the SNES callbacks."""

    y: fem.Function
    residual: fem.Form
    jacobian: fem.Form
    fixed: list[fem.DirichletBC]
    factorisations: int = 0

    def evaluate(self, snes: PETSc.SNES, x: PETSc.Vec, f: PETSc.Vec) -> None:
        """The residual, prescribed rows replaced."""
        self.y.x.array[: x.getLocalSize()] = x.getArray(readonly=True)
        self.y.x.scatter_forward()
        with f.localForm() as local:
            local.set(0.0)
        fem_petsc.assemble_vector(f, self.residual)
        fem_petsc.apply_lifting(f, [self.jacobian], bcs=[self.fixed], x0=[x], alpha=-1.0)
        f.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)
        fem_petsc.set_bc(f, self.fixed, x0=x, alpha=-1.0)

    def differentiate(self, snes: PETSc.SNES, x: PETSc.Vec, jacobian: PETSc.Mat, _: PETSc.Mat) -> None:
        """The Jacobian."""
        jacobian.zeroEntries()
        fem_petsc.assemble_matrix(jacobian, self.jacobian, self.fixed)
        jacobian.assemble()
        self.factorisations += 1


def tresca(tagged: TaggedMesh, seconds: float = math.inf) -> Answer:
    """Solve; the answer follows from the displacement of the bottom nodes.

    Raises:
        Unfinished: it takes longer than the limit.
    """
    begin = time.perf_counter()
    mesh = tagged.mesh
    space = fem.functionspace(mesh, ("Lagrange", 1, (2,)))
    y, z = fem.Function(space), ufl.TestFunction(space)
    x, n = ufl.SpatialCoordinate(mesh), ufl.FacetNormal(mesh)
    t = ufl.as_vector((-n[1], n[0]))
    metadata = {"quadrature_rule": "vertex", "quadrature_degree": 1}
    ds = ufl.Measure("ds", domain=mesh, subdomain_data=tagged.facet_tags, metadata=metadata)
    ds = ds(tagged.boundaries["bottom"])
    gamma = fem.Constant(mesh, FIRST_GAMMA)
    gap = 0.003 * (x[0] - 1.5) ** 2 + 0.001
    pressure = ufl.max_value(0.0, gamma * (ufl.inner(y, n) - gap))
    shear = ufl.max_value(-example1.BOUND, ufl.min_value(gamma * ufl.inner(y, t), example1.BOUND))
    residual = linear.elastic_terms(space, y, z) - linear.load_terms(tagged, z)
    residual += pressure * ufl.inner(z, n) * ds + shear * ufl.inner(z, t) * ds
    fixed = []
    for side in ("left", "right"):
        part = space.sub(0)
        fixed.append(fem.dirichletbc(0.0, fem.locate_dofs_topological(part, 1, tagged.facets(side)), part))
    problem = _Plain(y, fem.form(residual), fem.form(ufl.derivative(residual, y)), fixed)

    matrix, vector = fem_petsc.create_matrix(problem.jacobian), fem_petsc.assemble_vector(problem.residual)
    iterate = vector.duplicate()
    snes = PETSc.SNES().create(mesh.comm)
    snes.setFunction(problem.evaluate, vector)
    snes.setJacobian(problem.differentiate, matrix)
    snes.setTolerances(rtol=1e-10, atol=1e-9, stol=0.0, max_it=_ITERATIONS)
    snes.getKSP().setType(PETSc.KSP.Type.PREONLY)
    snes.getKSP().getPC().setType(PETSc.PC.Type.CHOLESKY)
    snes.getKSP().getPC().setFactorSolverType("mumps")
    with linear.petsc_options({"snes_linesearch_type": "cp"}):
        snes.setFromOptions()

    iterate.getArray()[1::2] = _DOWN
    path = _follow(snes, gamma, iterate, begin + seconds)
    return _read(y, tagged, problem.factorisations, f"{len(path)} values of gamma")


def _follow(snes: PETSc.SNES, gamma: fem.Constant, iterate: PETSc.Vec, end: float) -> list[float]:
    """Raise gamma to its last value, and return the values at which there is a solution."""
    factor, good, path = _FACTOR, iterate.copy(), []
    while not path or path[-1] < example1.GAMMA:
        wanted = min(path[-1] * factor, example1.GAMMA) if path else FIRST_GAMMA
        if time.perf_counter() > end:
            raise Unfinished(
                f"stopped at gamma = {path[-1] if path else 0:.1e}, before the last of {example1.GAMMA:.0e}"
            )
        gamma.value = wanted
        good.copy(iterate)
        snes.solve(None, iterate)
        if snes.getConvergedReason() > 0:
            path.append(wanted)
            iterate.copy(good)
        else:
            factor = math.sqrt(factor)
            if factor < _SMALLEST_FACTOR or not path:
                raise RuntimeError(f"the plain way does not get beyond gamma = {path[-1] if path else 0:.1e}")
    return path


def _read(y: fem.Function, tagged: TaggedMesh, solves: int, note: str) -> Answer:
    """The contact boundary from the displacement."""
    space = y.function_space
    nodes = fem.locate_dofs_topological(space, 1, tagged.facets("bottom"))
    x = space.tabulate_dof_coordinates()[nodes, 0]
    order = np.argsort(x)
    values = y.x.array.reshape(-1, 2)[nodes[order]]
    trial: Floats = -example1.GAMMA * (values[:, 1] + example1.gap(x[order]))
    elastic: Floats = example1.GAMMA * values[:, 0]
    slip = np.where(np.abs(elastic) > example1.BOUND, np.sign(elastic), 0).astype(np.int8)
    shear = np.clip(elastic, -example1.BOUND, example1.BOUND)
    return Answer(x[order], np.maximum(trial, 0.0), shear, trial > 0, slip, solves, solves, note=note)
