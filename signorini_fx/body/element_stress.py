"""The stress that the elements work with: everything that shows or judges a stress takes it from here."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import basix
import basix.ufl
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import default_scalar_type, fem

from signorini_fx import compat, parallel
from signorini_fx.body.cellwise_stiffness import CellwiseStiffness, strain_components
from signorini_fx.body.discretisation import Discretisation
from signorini_fx.body.initial_strains import initial_strain
from signorini_fx.body.jumps import total_jump
from signorini_fx.body.mixed import hydrostatic_of
from signorini_fx.body.moduli import isotropic, poisson_of
from signorini_fx.kinematics.cartesian import Kinematics, position
from signorini_fx.machine.compilation import compiling

_Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class ElementStress:
    """The stress of a displacement as UFL, linear in the strain, and what follows from its law.

    Attributes:
        displacement: y, whose values may change.
        sigma: the stress, shape (d, d); of the displacement at the time of the last ``refresh``.
        outward: the stress out of the plane; None: there is none.
        outward_of: (which of ``parts``, components of stresses at the vertices of its cells, shape (c, v, m)) -> the
            stress out of the plane that belongs to them, shape (c, v).
        compliance: components tau of a difference of stresses -> C^-1 tau : tau.
        modulus: the largest normal stress per strain, lambda + 2 mu.
        shear_modulus: mu, the mean one of an orthotropic material; None: the body is not known to be isotropic.
        hydrostatic: the pressure of a mixed element, which is a part of sigma; None: there is none.
        parts: the cells of each part within which the stress has no jumps, local numbers, ghosts included.
        kinematics: of the displacement.
        refresh: takes from the displacement anew what ``sigma`` does not see of it, on all cells of this rank, and
            moves initial strains to a place in the lists of factors.
    """

    displacement: fem.Function
    sigma: Any
    outward: Any
    outward_of: Callable[[int, _Floats], _Floats]
    compliance: Callable[[Any], Any]
    modulus: Any
    shear_modulus: Any
    parts: Sequence[npt.NDArray[np.int32]]
    kinematics: Kinematics
    refresh: Callable[[float], None] = lambda place: None
    hydrostatic: fem.Function | None = None

    @property
    def around(self) -> Any:
        """By what areas and lengths of the mesh are multiplied, see ``Kinematics.measure``."""
        return self.kinematics.measure(position(self.displacement))

    @property
    def components(self) -> Any:
        """The components of sigma, see ``Kinematics.pairs``."""
        return self.kinematics.components(self.in_space)

    @property
    def in_space(self) -> Any:
        """Sigma with all components in space, shape (3, 3)."""
        dim = self.kinematics.dimension
        out = 0 * self.sigma[0, 0] if self.outward is None else self.outward
        components = [[self.sigma[i, j] if max(i, j) < dim else 0 * out for j in range(3)] for i in range(3)]
        if dim < 3:
            components[2][2] = out
        return ufl.as_tensor(components)


def element_stress(body: Discretisation, displacement: fem.Function, step: float = 0.0) -> ElementStress:
    """Sigma = 2 mu epsilon + lambda theta I, with the volumetric strain theta as the stiffness sees it.

    Both are without the initial strain, and with the jumps across sections.  Without reduced integration theta is
    tr(epsilon).  A reduced volumetric term sees tr(epsilon) at the points of its rule only.  Between them it may have
    any value, and lambda times it is any multiple of the true stress if Poisson's ratio is near 1/2.  There theta is
    interpolated between these points: constant in a cell with one point, bilinear or trilinear with two along each
    axis.  This is the pressure of the mixed method that reduced integration is equivalent to (Malkus and Hughes,
    Comput. Methods Appl. Mech. Engrg. 15 (1978) 63-81).

    Args:
        body: the scene.
        displacement: y.
        step: the place of the initial strains in the lists of factors.
    """
    if body.mixed is not None:
        return _mixed_stress(body, displacement, step)
    if body.moduli is not None:
        return _cellwise_stress(body, displacement, body.moduli, step)
    (lame, mu), materials, mesh, kinematics = body.lame, body.scene.material, body.tagged.mesh, body.kinematics
    initial, move_to = initial_strain(body.scene, body.tagged, body.space, step)
    moved, jump_to = _moved(body, displacement, step)
    elastic = kinematics.strain(moved, on_axis=True)
    theta = ufl.tr(elastic)
    if initial is not None:
        elastic -= initial * ufl.Identity(elastic.ufl_shape[0])
        theta -= materials[0].directions * initial
    interpolated = []  # functions and what they take their values from
    if body.reduced is not None:
        interpolated.append(
            _interpolation(theta, fem.functionspace(mesh, _at_points(mesh.topology.cell_name(), body.reduced)))
        )
        theta = interpolated[-1][0]
        theta.name = "volumetric strain"
    mean = lame * theta
    full_stress = 2 * mu * elastic + mean * ufl.Identity(elastic.ufl_shape[0])
    outward = full_stress[2, 2] if elastic.ufl_shape[0] > body.tagged.dimension else None
    prevented = None
    if kinematics.prevented:
        outward = mean
    if kinematics.prevented and initial is not None:  # E times the initial strain
        outward -= 2 * mu * initial
        young = mu * (3 * lame + 2 * mu) / (lame + mu)
        interpolated.append(_interpolation(young * initial, fem.functionspace(mesh, ("DG", 1))))
        prevented = interpolated[-1][0]
    parts = _materials(body)

    def refresh(step: float) -> None:
        move_to(step)
        jump_to(step)
        for function, expression in interpolated:
            function.interpolate(expression)

    def outward_of(part: int, tau: _Floats) -> _Floats:
        if not kinematics.prevented:
            return tau[..., kinematics.pairs.index((2, 2))]
        out_of_plane = _poisson(body, part, parts[part]) * (tau[..., 0] + tau[..., 1])
        if prevented is not None:
            out_of_plane -= prevented.x.array[prevented.function_space.dofmap.list[parts[part]]]
        return np.asarray(out_of_plane)

    refresh(step)
    return ElementStress(
        displacement,
        _in_mesh(full_stress, len(displacement)),
        outward,
        outward_of,
        lambda tau: compliance(tau, kinematics, lame, mu),
        lame + 2 * mu,
        mu,
        parts,
        kinematics,
        refresh,
    )


def _mixed_stress(body: Discretisation, displacement: fem.Function, step: float) -> ElementStress:
    """Sigma = 2 mu epsilon - p I of a mixed element; in plane strain -p is the stress out of the plane as well."""
    (_, mu), parts, kinematics = body.lame, _materials(body), body.kinematics
    young, poisson, modulus = isotropic(
        body.scene, body.tagged, lambda elastic_modulus, nu: (elastic_modulus, nu, elastic_modulus / (1 - nu**2))
    )
    pressure = hydrostatic_of(displacement)
    moved, jump_to = _moved(body, displacement, step)
    elastic = kinematics.strain(moved, on_axis=True)
    full_stress = 2 * mu * elastic - pressure * ufl.Identity(elastic.ufl_shape[0])
    outward = full_stress[2, 2] if elastic.ufl_shape[0] > body.tagged.dimension else None
    if kinematics.prevented:
        outward = -pressure

    initial, move_to = initial_strain(body.scene, body.tagged, body.space, step)
    prevented = None
    if initial is not None and kinematics.prevented:
        prevented = _interpolation(young * initial, fem.functionspace(body.tagged.mesh, ("DG", 1)))

    def refresh(step: float) -> None:
        move_to(step)
        jump_to(step)
        if prevented is not None:
            prevented[0].interpolate(prevented[1])

    def outward_of(part: int, tau: _Floats) -> _Floats:
        if not kinematics.prevented:
            return tau[..., kinematics.pairs.index((2, 2))]
        out_of_plane = _poisson(body, part, parts[part]) * (tau[..., 0] + tau[..., 1])
        if prevented is not None:
            out_of_plane -= prevented[0].x.array[prevented[0].function_space.dofmap.list[parts[part]]]
        return np.asarray(out_of_plane)

    refresh(step)
    return ElementStress(
        displacement,
        _in_mesh(full_stress, len(displacement)),
        outward,
        outward_of,
        lambda tau: compliance(tau, kinematics, None, mu, poisson),
        modulus,
        mu,
        parts,
        kinematics,
        refresh,
        hydrostatic=pressure,
    )


def _in_mesh(stress: Any, dimension: int) -> Any:
    """The components of a stress that act on facets of the mesh, shape (d, d)."""
    axes = range(dimension)
    return stress if stress.ufl_shape[0] == dimension else ufl.as_matrix([[stress[i, j] for j in axes] for i in axes])


def _interpolation(value: Any, space: fem.FunctionSpace) -> tuple[fem.Function, fem.Expression]:
    """A function, and the expression that it is to be interpolated from."""
    with compiling():
        expression = fem.Expression(value, compat.interpolation_points(space.element), dtype=default_scalar_type)
    return fem.Function(space), expression


def _moved(body: Discretisation, y: fem.Function, step: float) -> tuple[Any, Callable[[float], None]]:
    """The displacement with its jumps, UFL, and what moves these to a place in the lists of factors."""
    jump, move_to = total_jump(body.scene, body.tagged, body.space)
    move_to(step)
    return y if jump is None else y + jump, move_to


def _cellwise_stress(body: Discretisation, y: fem.Function, moduli: CellwiseStiffness, step: float) -> ElementStress:
    """By the stiffness of each cell."""
    kinematics, dim = body.kinematics, len(y)
    initial, move_to = initial_strain(body.scene, body.tagged, body.space, step)
    moved, jump_to = _moved(body, y, step)
    components = moduli.stress(strain_components(moved, kinematics, on_axis=True), initial)
    pairs = [*kinematics.pairs, *([(2, 2)] if kinematics.prevented else [])]
    at = {pair: k for k, (i, j) in enumerate(pairs) for pair in ((i, j), (j, i))}
    of_cells = np.arange(len(moduli.at_cells), dtype=np.int32)
    stress = anisotropic_stress(
        y,
        ufl.as_matrix([[components[at[i, j]] for j in range(dim)] for i in range(dim)]),
        components[at[2, 2]] if dim == 2 and (2, 2) in at else None,
        (moduli.at_cells, of_cells),
        _materials(body),
        kinematics,
        shear_modulus=body.lame[1],
    )
    prevented, parts, m = None, stress.parts, len(kinematics.pairs)
    if initial is not None and kinematics.prevented:  # what of it the stress out of the plane has beside the others
        ratios = moduli.at_cells[:, m:] @ np.linalg.inv(moduli.at_cells[:, :m])
        free = moduli.of_free_strain
        values = free.x.array.reshape(-1, m + 1)[free.function_space.dofmap.list[:, 0]]
        share = fem.Function(fem.functionspace(body.tagged.mesh, ("DG", 0)))
        share.x.array[share.function_space.dofmap.list[:, 0]] = values[:, m] - np.einsum(
            "ck,ck->c", ratios[:, 0], values[:, :m]
        )
        prevented = _interpolation(share * initial, fem.functionspace(body.tagged.mesh, ("DG", 1)))

    def refresh(step: float) -> None:
        move_to(step)
        jump_to(step)
        if prevented is not None:
            prevented[0].interpolate(prevented[1])

    def outward_of(part: int, tau: _Floats) -> _Floats:
        out_of_plane = stress.outward_of(part, tau)
        if prevented is not None:
            out_of_plane = out_of_plane - prevented[0].x.array[prevented[0].function_space.dofmap.list[parts[part]]]
        return out_of_plane

    refresh(step)
    return replace(stress, refresh=refresh, outward_of=outward_of)


def anisotropic_stress(
    y: fem.Function,
    sigma: Any,
    outward: Any,
    moduli: tuple[_Floats, npt.NDArray[np.int32]],
    parts: Sequence[npt.NDArray[np.int32]],
    kinematics: Kinematics,
    *,
    shear_modulus: Any = None,
) -> ElementStress:
    """That of moduli which are constant in each cell; collective.

    Args:
        y: the displacement.
        sigma: see ``ElementStress``.
        outward: see ``ElementStress``.
        moduli: the components of the stress, see ``Kinematics.pairs``, and out of the plane if there is such a stress,
            over those of the strain, of shear twice epsilon_ij, of each cell, shape (cells, rows, m), and the number
            of each cell among them.
        parts: see ``ElementStress``.
        kinematics: see ``ElementStress``.
        shear_modulus: see ``ElementStress``.

    Raises:
        numpy.linalg.LinAlgError: some strain has no stress, on all ranks.
    """
    mesh, (at_cells, numbers) = y.function_space.mesh, moduli
    dim, m = int(mesh.geometry.dim), at_cells.shape[2]
    inverse: Any = at_cells[:, :m]
    error = None
    try:
        inverse = np.linalg.inv(inverse)
    except np.linalg.LinAlgError as found:
        error = found
    parallel.raise_together(mesh.comm, error)
    largest = fem.Function(fem.functionspace(mesh, ("DG", 0)))
    largest.x.array[:] = at_cells[:, range(dim), range(dim)].max(axis=1)
    flexibility = fem.Function(fem.functionspace(mesh, ("DG", 0, (m, m))))
    flexibility.x.array[:] = inverse.ravel()
    ratios = at_cells[:, m:] @ inverse

    def outward_of(part: int, tau: _Floats) -> _Floats:
        if not m < at_cells.shape[1]:
            return tau[..., kinematics.pairs.index((2, 2))]
        return np.asarray(np.einsum("cm,cvm->cv", ratios[numbers[parts[part]], 0], tau))

    return ElementStress(
        y,
        sigma,
        outward,
        outward_of,
        lambda tau: ufl.inner(ufl.dot(flexibility, tau), tau),
        largest,
        shear_modulus,
        parts,
        kinematics,
    )


def compliance(tau: Any, kinematics: Kinematics, lame: Any, mu: Any, poisson: Any = 0.5) -> Any:
    """C^-1 tau : tau of an isotropic body for a stress tau, given by its components, see ``Kinematics.pairs``.

    Args:
        tau: the components.
        kinematics: of the body.
        lame: first Lame parameter; None: it may be infinite, and follows from Poisson's ratio.
        mu: second Lame parameter.
        poisson: nu, which counts without ``lame``; not in plane stress.
    """
    normal = [tau[k] for k, (i, j) in enumerate(kinematics.pairs) if i == j]
    mixed = [tau[k] for k, (i, j) in enumerate(kinematics.pairs) if i != j]
    trace = sum(normal[1:], normal[0])
    square = sum((entry**2 for entry in normal[1:]), normal[0] ** 2)
    shear = sum((2 * entry**2 for entry in mixed[1:]), 2 * mixed[0] ** 2)
    share = poisson / (1 + poisson if len(normal) == 3 else 1)
    if lame is not None:
        share = lame / (len(normal) * lame + 2 * mu)
    return (square + shear - share * trace**2) / (2 * mu)


def _poisson(body: Discretisation, number: int, cells: npt.NDArray[np.int32]) -> _Floats:
    """That of cells of a material, by its number, shape (1, 1) or (cells, 1)."""
    return np.reshape(poisson_of(body.scene.material[number], body.tagged, cells), (-1, 1))


def _materials(d: Discretisation) -> list[npt.NDArray[np.int32]]:
    """The cells of each material, ghosts included."""
    if len(d.scene.material) > 1:
        return [d.tagged.cells(str(material.region)) for material in d.scene.material]
    index_map = d.tagged.mesh.topology.index_map(d.tagged.dimension)
    return [np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32)]


def _at_points(cell: str, degree: int) -> Any:
    """The discontinuous element whose nodes are the points of a Gauss rule: one point, or two along each axis."""
    if degree == 1:
        return basix.ufl.element("DG", cell, 0)
    return basix.ufl.element("DQ", cell, 1, lagrange_variant=basix.LagrangeVariant.gl_warped, discontinuous=True)
