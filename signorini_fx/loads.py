"""Loads and prescribed displacements as right-hand sides, grouped by their load factors."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import default_scalar_type, fem
from dolfinx.fem import petsc as fem_petsc
from petsc4py import PETSc

from signorini_fx import forms, parallel
from signorini_fx.assembly import action, assemble, measure
from signorini_fx.errors import SceneError
from signorini_fx.expressions import Expression, sample
from signorini_fx.results import Inventory
from signorini_fx.rigid import RigidMotions
from signorini_fx.scene import BodyForce, PrescribedDisplacement, Scene, SurfaceTraction
from signorini_fx.supports import fixed_dofs

_VARYING_DEGREE = 20


@dataclass(frozen=True)
class LoadCase:
    """The loads and prescribed displacements that share one list of load factors.

    Attributes:
        factors: one number a load step.
        form: the compiled terms of L, None if the case only prescribes displacements.
        load: L minus what its prescribed displacements contribute; E times their value in their rows.
        start: zero, with its prescribed displacements put in.
        resultant: what ``load`` does on the three rigid motions, forces, shape (3,).
    """

    factors: tuple[float, ...]
    form: fem.Form | None
    load: PETSc.Vec
    start: PETSc.Vec
    resultant: npt.NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))


def load_resultant(cases: tuple[LoadCase, ...], step: int) -> npt.NDArray[np.float64]:
    """What the loads of a load step do on the three rigid motions, shape (3,)."""
    return sum((case.factors[step] * case.resultant for case in cases), np.zeros(3))


def ufl_value(value: Any, space: fem.FunctionSpace) -> Any:
    """A scene value as a UFL coefficient; a callable is interpolated at the nodes."""
    mesh = space.mesh
    if isinstance(value, float):
        return fem.Constant(mesh, default_scalar_type(value))
    if isinstance(value, Expression):
        return value.ufl(mesh)
    if hasattr(value, "ufl_domain"):
        return value
    function = fem.Function(fem.functionspace(mesh, ("Lagrange", space.element.basix_element.degree)))
    function.interpolate(lambda x: sample(value, x))
    return function


def is_zero(*values: Any) -> bool:
    """Whether all values are the number zero."""
    return all(isinstance(value, float) and value == 0.0 for value in values)


Load = BodyForce | SurfaceTraction | PrescribedDisplacement


def load_groups(scene: Scene) -> dict[tuple[float, ...], list[Load]]:
    """The loads of the scene by their load factors; zero loads are no loads."""
    groups: dict[tuple[float, ...], list[Load]] = {}
    for load in scene.loads:
        values = [load.x, load.y]
        if isinstance(load, SurfaceTraction):
            values.append(load.pressure)
        if isinstance(load, PrescribedDisplacement) or not is_zero(*values):
            groups.setdefault(load.factors or (1.0,) * scene.steps, []).append(load)
    return groups


def load_degree(space: fem.FunctionSpace) -> int:
    """Quadrature degree of loads in the body, and of constant tractions."""
    return 2 * int(space.element.basix_element.degree) + 2


def traction_degree(load: SurfaceTraction, space: fem.FunctionSpace) -> int:
    """Quadrature degree of a traction: one that varies may jump within a facet, where many points see it better."""
    return _VARYING_DEGREE if varies(load) else load_degree(space)


def varies(load: BodyForce | SurfaceTraction) -> bool:
    """Whether a load is more than constants."""
    values = [load.x, load.y, *([load.pressure] if isinstance(load, SurfaceTraction) else [])]
    return not all(isinstance(value, float) for value in values)


def compile_load(
    loads: list[Load],
    space: fem.FunctionSpace,
    z: Any,
    facets: dict[str, npt.NDArray[np.int32]],
    inventory: Inventory,
) -> fem.Form | None:
    """The terms of L that the loads list, compiled together."""
    mesh = space.mesh
    degree = load_degree(space)
    bodies = [load for load in loads if isinstance(load, BodyForce)]
    tractions = [load for load in loads if isinstance(load, SurfaceTraction)]
    if not bodies and not tractions:
        return None
    terms = []
    for body in bodies:
        force = ufl.as_vector([ufl_value(v, space) for v in (body.x, body.y)])
        terms.append(forms.body_force_form(force, z, degree))
    ds = measure(mesh, [facets[load.boundary] for load in tractions], {})
    for number, load in enumerate(tractions, start=1):
        traction = ufl.as_vector([ufl_value(v, space) for v in (load.x, load.y)])
        if not is_zero(load.pressure):
            traction -= ufl_value(load.pressure, space) * ufl.FacetNormal(mesh)
        rule = {"quadrature_degree": traction_degree(load, space)}
        terms.append(forms.traction_form(traction, z, ds(number, metadata=rule)))
    names = ["body force"] * len(bodies) + [f"traction {load.boundary}" for load in tractions]
    return inventory.compile(" + ".join(names), lambda: fem.form(sum(terms[1:], terms[0])))


def load_case(
    factors: tuple[float, ...],
    loads: list[Load],
    load_form: fem.Form | None,
    elastic: tuple[fem.Form, ...],
    stiffness: PETSc.Mat,
    supports: list[tuple[PrescribedDisplacement, fem.DirichletBC]],
    space: fem.FunctionSpace,
    scene: Scene,
) -> LoadCase:
    """Assemble the right-hand side of the loads that share their factors."""
    load, start = stiffness.createVecRight(), stiffness.createVecRight()
    start.set(0.0)
    load.set(0.0)
    if load_form is not None:
        load.axpy(1.0, assemble(load_form))
    prescribed = fem.Function(space)
    touched: list[npt.NDArray[np.int32]] = []
    for effect, support in supports:
        dofs, _ = support.dof_indices()
        prescribed.x.array[dofs] = 0.0
        if any(effect is one for one in loads):
            fem_petsc.set_bc(prescribed.x.petsc_vec, [support])
            prescribed.x.scatter_forward()
        touched.append(dofs)
    if supports and parallel.global_max(space.mesh.comm, parallel.local_max(np.abs(prescribed.x.array))) != 0.0:
        blocks = np.unique(np.concatenate(touched) // 2).astype(np.int32)
        load.axpy(-1.0, action(elastic, prescribed, blocks))
        start.getArray()[:] = prescribed.x.array[: start.getLocalSize()]
    if supports:
        fixed = fixed_dofs(space, [support for _, support in supports])
        load.getArray()[fixed] = scene.young * start.getArray()[fixed]
    return LoadCase(factors, load_form, load, start)


def rigid_resultant(
    load: PETSc.Vec, motions: RigidMotions, x: npt.NDArray[np.float64], fixed: npt.NDArray[np.bool_]
) -> npt.NDArray[np.float64]:
    """What a load does on the rigid motions; only needed, and only taken, where one of them is free."""
    if motions.free.shape[1] == 0:
        return np.zeros(3)
    forces = np.where(fixed, 0.0, load.getArray(readonly=True)).reshape(-1, 2)
    return parallel.global_sum(load.comm.tompi4py(), np.einsum("ij,ijk->k", forces, motions.at(x)))


def check_finite(cases: tuple[LoadCase, ...]) -> None:
    """Whether all loads and prescribed displacements are finite; collective.

    Raises:
        SceneError: an expression is not.
    """
    problems = []
    if not all(np.isfinite(case.start.norm()) for case in cases):
        problems.append(("displacement", "an expression is not finite somewhere on its boundary"))
    elif not all(np.isfinite(case.load.norm()) for case in cases):
        problems.append(
            ("traction, body_force", "an expression is not finite somewhere on its boundary or in the body")
        )
    if problems:
        raise SceneError(problems)
