"""One linear elastic solve of the size of Example 1 by dolfinx and PETSc: the unit of this
benchmark.

The body is held at the bottom instead of touching a foundation there; the pattern of the matrix is
the same.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import example1
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from signorini_fx.mechanics.mesh.tagged import TaggedMesh

# Fastest for one factorisation: PETSc's default also tries METIS, which takes longer than it saves.
PACKAGES: dict[str, dict[str, str]] = {"mumps": {}, "cholmod": {"mat_cholmod_nmethods": "1"}}


@contextmanager
def petsc_options(options: dict[str, str]) -> Iterator[None]:
    """Set PETSc options temporarily: some are read only when a factor is made."""
    table = PETSc.Options()
    for name, value in options.items():
        table[name] = value
    try:
        yield
    finally:
        for name in options:
            table.delValue(name)


def elastic_terms(space: fem.FunctionSpace, y: Any, z: Any) -> Any:
    """a(y, z) of section 2.1."""
    mesh = space.mesh
    lame = fem.Constant(
        mesh,
        example1.YOUNG * example1.POISSON / (1 + example1.POISSON) / (1 - 2 * example1.POISSON),
    )
    mu = fem.Constant(mesh, example1.YOUNG / 2 / (1 + example1.POISSON))
    strain, test = ufl.sym(ufl.grad(y)), ufl.sym(ufl.grad(z))
    return ufl.inner(lame * ufl.tr(strain) * ufl.Identity(2) + 2 * mu * strain, test) * ufl.dx


def load_terms(tagged: TaggedMesh, z: Any) -> Any:
    """L of section 7.1: the traction on the middle of the top."""
    mesh = tagged.mesh
    metadata = {"quadrature_degree": example1.LOAD_DEGREE}
    ds = ufl.Measure("ds", domain=mesh, subdomain_data=tagged.facet_tags, metadata=metadata)
    x = ufl.SpatialCoordinate(mesh)
    loaded = ufl.And(ufl.ge(x[0], 1.0), ufl.le(x[0], 2.0))
    return ufl.conditional(loaded, example1.TRACTION, 0.0) * z[1] * ds(tagged.boundaries["top"])


def solve(tagged: TaggedMesh, package: str) -> PETSc.Vec:
    """Assemble, factorise by a Cholesky factor of ``package``, and solve; the displacement."""
    space = fem.functionspace(tagged.mesh, ("Lagrange", 1, (2,)))
    y, z = ufl.TrialFunction(space), ufl.TestFunction(space)
    stiffness, load = fem.form(elastic_terms(space, y, z)), fem.form(load_terms(tagged, z))
    fixed = []
    for boundary, component in (("left", 0), ("right", 0), ("bottom", 1)):
        part = space.sub(component)
        dofs = fem.locate_dofs_topological(part, 1, tagged.facets(boundary))
        fixed.append(fem.dirichletbc(PETSc.ScalarType(0.0), dofs, part))
    matrix = fem_petsc.assemble_matrix(stiffness, fixed, example1.YOUNG)
    matrix.assemble()
    matrix.setOption(PETSc.Mat.Option.SPD, True)
    vector = fem_petsc.assemble_vector(load)
    vector.ghostUpdate(PETSc.InsertMode.ADD, PETSc.ScatterMode.REVERSE)
    fem_petsc.set_bc(vector, fixed)
    with petsc_options(PACKAGES[package]):
        ksp = PETSc.KSP().create(matrix.comm)
        ksp.setType(PETSc.KSP.Type.PREONLY)
        pc = ksp.getPC()
        pc.setType(PETSc.PC.Type.CHOLESKY)
        pc.setFactorSolverType(package)
        ksp.setOperators(matrix)
        ksp.setFromOptions()
        ksp.setUp()
    x = vector.duplicate()
    ksp.solve(vector, x)
    return x
