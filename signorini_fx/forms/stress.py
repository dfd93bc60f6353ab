"""The stress of a user's forms: its law from the expression for it, and the traction that the forms prescribe."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh

from signorini_fx.errors import FormError
from signorini_fx.machine import compat, parallel
from signorini_fx.machine.compilation import compiling
from signorini_fx.mechanics.assembly.mesh_entities import facet_nodes
from signorini_fx.mechanics.elasticity.elastic_law import ElementStress, cellwise_stress
from signorini_fx.mechanics.kinematics import CARTESIAN
from signorini_fx.mechanics.mesh.tagged import is_section
from signorini_fx.tuned import NOTHING_LEFT

if TYPE_CHECKING:
    from signorini_fx.results.accuracy.stress_recovery import StressRecovery
    from signorini_fx.results.stresses import RawStresses

Cells = npt.NDArray[np.int32]
Facets = npt.NDArray[np.int32]
Law = Callable[[Any], Any]


def law_of(stress: Any, u: fem.Function) -> Law | None:
    """What ``ContactProblem`` is given, as a function of the displacement."""
    if stress is not None and is_section(u.function_space.mesh):
        raise FormError([("stress", "stresses and their estimates are not possible yet on a plane mesh in 3D")])
    if stress is None or (callable(stress) and not hasattr(stress, "ufl_shape")):
        return stress
    return lambda y: ufl.replace(stress, {u: y, **dict.fromkeys(_arguments(stress), y)})


def stresses_of(
    law: Law,
    y: fem.Function,
    parts: Sequence[Cells],
    forms: Sequence[Any],
    contact: Sequence[Facets],
    fixed: npt.NDArray[np.bool_],
    shared: dict[str, StressRecovery],
) -> RawStresses:
    """The stress of a displacement, raw and recovered, with the estimate of its error, for which the traction of
    compiled forms is not known; ``shared``: where what projects is kept for other displacements; collective.
    """
    from signorini_fx.results.accuracy.stress_recovery import StressRecovery
    from signorini_fx.results.stresses import RawStresses

    def projects() -> StressRecovery:
        stress = stress_of(law, fem.Function(y.function_space), parts)
        all_ufl = all(isinstance(form, ufl.Form) for form in forms)
        residual = partial(residual_of, stress, forms, contact, fixed) if all_ufl else lambda z: None
        return StressRecovery(stress, lambda z: (lambda step: None, residual(z)))

    return RawStresses(stress_of(law, y, parts), projects, shared=shared)


def stress_of(law: Law, y: fem.Function, parts: Sequence[Cells]) -> ElementStress:
    """The stress of a displacement by a law that gives it as UFL, shape (d, d), or in 2D (3, 3), linear in the strain
    but for a stress without strain; collective.

    The moduli are those at the middle of each cell.

    Raises:
        FormError: the law has another shape, is known at points of quadrature alone, or some strain has no stress.
    """
    mesh = y.function_space.mesh
    kinematics, full_stress = CARTESIAN[mesh.geometry.dim], law(y)
    dim = kinematics.dimension
    if not hasattr(full_stress, "ufl_shape") or full_stress.ufl_shape not in ((dim, dim), (3, 3)):
        shape = getattr(full_stress, "ufl_shape", "none")
        raise FormError([("stress", f"has the shape {shape}; ({dim}, {dim}) or (3, 3) is needed")])
    if _by_quadrature(full_stress):
        raise FormError([("stress", "has a Function of a quadrature element, which has no values at other points")])
    outward = full_stress[2, 2] if full_stress.ufl_shape[0] > dim else None
    moduli = cellwise_moduli(law, y.function_space)
    sigma = ufl.as_matrix([[full_stress[i, j] for j in range(dim)] for i in range(dim)])
    try:
        shear_modulus = None
        if (lame := isotropic_moduli(moduli, dim, mesh)) is not None:
            shear_modulus = fem.Function(fem.functionspace(mesh, ("DG", 0)))
            shear_modulus.x.array[:] = lame[1]
        return replace(cellwise_stress(y, kinematics, sigma, outward, moduli, shear_modulus), parts=parts)
    except np.linalg.LinAlgError:
        raise FormError([("stress", "is zero for some strain: nothing can be measured in its energy")]) from None


def cellwise_moduli(law: Law, space: fem.FunctionSpace) -> npt.NDArray[np.float64]:
    """The components of the stress over those of the strain, shape (cells, m, m), see ``cellwise_stress``; collective.

    They are those at the middle of each cell, from stresses of fields with one strain each.
    """
    from signorini_fx.results.stresses import interpolated

    mesh, kinematics = space.mesh, CARTESIAN[space.mesh.geometry.dim]
    dim, pairs, x = kinematics.dimension, kinematics.pairs, ufl.SpatialCoordinate(mesh)
    axes = [ufl.unit_vector(k, dim) for k in range(dim)]
    strained = [(x[i] * axes[j] + x[j] * axes[i]) / 2 for i, j in pairs]  # with one strain, or one twice a shear
    at_rest = law(fem.Function(space))
    stresses = [law(field) for field in strained]
    moduli = ufl.as_vector([(stress - at_rest)[i, j] for i, j in pairs for stress in stresses])
    cellwise = interpolated(moduli, fem.functionspace(mesh, ("DG", 0, (len(moduli),))))
    return cellwise.x.array.reshape(-1, len(pairs), len(pairs))


def isotropic_moduli(
    moduli: npt.NDArray[np.float64], dim: int, mesh: dmesh.Mesh
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]] | None:
    """Both parameters of Lame in each cell from ``cellwise_moduli``; None: some cell of some rank is not isotropic;
    collective.
    """
    mu, lame = moduli[:, -1, -1], moduli[:, 0, 1]
    isotropic = np.zeros_like(moduli)
    isotropic[:, :dim, :dim] = lame[:, None, None]
    diagonal = np.arange(moduli.shape[2])
    isotropic[:, diagonal, diagonal] += np.where(diagonal < dim, 2.0, 1.0) * mu[:, None]
    apart = np.abs(moduli - isotropic).max(initial=0.0) > NOTHING_LEFT * np.abs(moduli).max(initial=0.0)
    if parallel.any_rank(mesh.comm, bool(apart)):
        return None
    return lame, mu


def natural_modulus(law: Law, space: fem.FunctionSpace) -> float | None:
    """Young's modulus of the stiffest cell, the natural unit of stress, as of a scene; None: the law is not isotropic,
    or none that can be evaluated; collective.
    """
    at_rest, dim = law(fem.Function(space)), space.mesh.geometry.dim
    if getattr(at_rest, "ufl_shape", None) not in ((dim, dim), (3, 3)) or _by_quadrature(at_rest):
        return None
    return _stiffest(cellwise_moduli(law, space), space.mesh)


def modulus_of_energy(a: Any, space: fem.FunctionSpace, measure: Any = None) -> float | None:
    """The same from an energy, divided by the UFL that it is multiplied by; None: it is compiled, or known at points of
    quadrature alone; collective.

    It is that of fields with one strain each.  They are zero in the middle of the cell where they are taken, so that no
    hoop strain adds to theirs.
    """
    integrals = a.integrals_by_type("cell") if isinstance(a, ufl.Form) else ()
    everywhere = all(integral.subdomain_id() == "everywhere" for integral in integrals)
    if not integrals or is_section(space.mesh) or not everywhere:
        return None
    mesh, kinematics = space.mesh, CARTESIAN[space.mesh.geometry.dim]
    dim, x, (z, y) = kinematics.dimension, ufl.SpatialCoordinate(mesh), a.arguments()
    of_cells = fem.functionspace(mesh, ("DG", 0))
    cellwise, *middle = (fem.Function(of_cells) for _ in range(1 + dim))
    for k, function in enumerate(middle):
        function.interpolate(lambda points, k=k: points[k])
    x = x - ufl.as_vector(middle)
    axes = [ufl.unit_vector(k, dim) for k in range(dim)]
    strained = [(x[i] * axes[j] + x[j] * axes[i]) / 2 for i, j in kinematics.pairs]
    energy = sum(integral.integrand() for integral in integrals) / (1 if measure is None else measure)
    if _by_quadrature(energy):
        return None
    # One expression, which constants make that of each pair of fields.
    factors = [fem.Constant(mesh, np.zeros(len(strained))) for _ in range(2)]
    fields = [sum(factor[k] * field for k, field in enumerate(strained)) for factor in factors]
    with compiling():
        points = compat.interpolation_points(of_cells.element)
        modulus = fem.Expression(ufl.replace(energy, dict(zip((z, y), fields, strict=True))), points)
    moduli = np.empty((cellwise.x.array.size, len(strained), len(strained)))
    for pair in np.ndindex(moduli.shape[1:]):
        for factor, k in zip(factors, pair, strict=True):
            factor.value[:] = np.arange(len(strained)) == k
        cellwise.interpolate(modulus)
        moduli[:, pair[0], pair[1]] = cellwise.x.array
    return _stiffest(moduli, mesh)


def _by_quadrature(expression: Any) -> bool:
    """Whether it has a Function of a quadrature element, which has no values in the middle of a cell."""
    coefficients = ufl.algorithms.extract_coefficients(expression)
    return any(getattr(function.ufl_element(), "has_custom_quadrature", False) for function in coefficients)


def _stiffest(moduli: npt.NDArray[np.float64], mesh: dmesh.Mesh) -> float | None:
    """The largest of Young's moduli, of ``cellwise_moduli``; None: some cell is not isotropic; collective."""
    lame = isotropic_moduli(moduli, mesh.geometry.dim, mesh)
    if lame is None:
        return None
    first, shear = lame
    with np.errstate(divide="ignore", invalid="ignore"):
        young = shear * (3 * first + 2 * shear) / (first + shear)
    largest = float(parallel.largest(mesh.comm, young, 0.0))
    return largest if 0.0 < largest < np.inf else None


def residual_of(
    stress: ElementStress, forms: Sequence[Any], contact: Sequence[Facets], fixed: npt.NDArray[np.bool_], z: Any
) -> Any:
    """The squared residual of the traction that UFL forms prescribe, see ``squared_residual``; ``z``: a test function,
    constant in each cell; collective.

    It is known off the contact in the components that are not prescribed.
    """
    from signorini_fx.results.accuracy.stress_recovery import squared_residual

    space = stress.displacement.function_space
    mesh, dim = space.mesh, stress.kinematics.dimension
    exterior, touching = dmesh.exterior_facet_indices(mesh.topology), np.concatenate([np.zeros(0, np.int32), *contact])
    traction_facets = np.setdiff1d(exterior, touching).astype(np.int32)
    held = fixed.reshape(-1, dim)[facet_nodes(space, traction_facets)].all(axis=1)
    integrals = [
        integral for form in forms for integral in form.integrals() if integral.integral_type() == "exterior_facet"
    ]
    on = [np.isin(traction_facets, exterior_facets(integral, mesh)) for integral in integrals]

    def of(numbers: npt.NDArray[np.int64], residual: Any) -> tuple[Any, list[Any], bool]:
        varies = False
        for number in numbers[numbers >= dim]:
            traction = _traction(integrals[number - dim].integrand(), stress.displacement)
            varies = varies or ufl.algorithms.estimate_total_polynomial_degree(traction) > 0
            residual = residual + traction
        free = [0.0 if k in numbers else residual[k] for k in range(dim)]
        return ufl.as_vector(free), [], varies

    return squared_residual(stress, traction_facets, np.column_stack((held, *on)), of, z)


def _traction(integrand: Any, y: fem.Function) -> Any:
    """What an integral over the boundary prescribes, as a vector: of L with its sign, of a(y, .) minus that."""
    *trial, test = sorted(_arguments(integrand), key=lambda argument: -int(argument.number()))
    dim = len(y)
    parts = [ufl.replace(integrand, {test: ufl.unit_vector(k, dim), **dict.fromkeys(trial, y)}) for k in range(dim)]
    return (-1 if trial else 1) * ufl.as_vector(parts)


def _arguments(expression: Any) -> list[Any]:
    """The test and trial functions in an expression."""
    return list(ufl.algorithms.extract_arguments(expression))


def exterior_facets(integral: Any, mesh: dmesh.Mesh) -> Facets:
    """The exterior facets of this rank that an integral is over."""
    data, wanted = integral.subdomain_data(), integral.subdomain_id()
    wanted = wanted if isinstance(wanted, tuple) else (wanted,)
    if data is None or "everywhere" in wanted:
        return np.asarray(dmesh.exterior_facet_indices(mesh.topology))
    if hasattr(data, "values"):
        return np.asarray(data.indices[np.isin(data.values, wanted)])
    pairs = np.concatenate([np.empty(0, int), *(entities for number, entities in data if number in wanted)]).reshape(
        -1, 2
    )
    dim = mesh.topology.dim
    mesh.topology.create_connectivity(dim, dim - 1)
    of_cell = mesh.topology.connectivity(dim, dim - 1)
    return np.asarray(of_cell.array[of_cell.offsets[pairs[:, 0]] + pairs[:, 1]])
