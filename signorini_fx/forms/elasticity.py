"""The elastic body of user forms: stiffness, moduli and scales, stresses, and the quantities that
its certificate judges.

Equilibrium is checked with the user's forms: the action of ``a`` on the displacement and ``L`` are
assembled again, without the matrix.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np
import ufl
from dolfinx import fem, la
from dolfinx import mesh as dmesh
from petsc4py import PETSc
from ufl.algorithms.analysis import extract_type
from ufl.geometry import GeometricQuantity

from signorini_fx.algebra.linalg import ElasticSystem
from signorini_fx.arrays import Array, Flags, Indices, Ints
from signorini_fx.errors import FormError
from signorini_fx.forms.given_forms import Energy, GivenForms, Law, UflOrCompiled
from signorini_fx.machine import compat, parallel
from signorini_fx.machine.compilation import compiling
from signorini_fx.mechanics.assembly.mesh_entities import (
    action,
    assemble,
    facet_cells,
    facet_nodes,
    marked_nodes,
)
from signorini_fx.mechanics.assembly.pieces import find_pieces
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.interfaces import PlacedShape
from signorini_fx.mechanics.kinematics import CARTESIAN, PLANE_STRESS, padded
from signorini_fx.mechanics.mesh.tagged import TaggedMesh, is_section, outer_facets
from signorini_fx.mechanics.model import Loads, Model
from signorini_fx.mechanics.rigid.rigid_bodies import RigidBodies
from signorini_fx.mechanics.statement.load_path import counted_path
from signorini_fx.mechanics.statement.settings import SolverSettings
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.results.certificate.equilibrium import Balance, PrescribedNodes, RigidPart
from signorini_fx.results.mechanics import Mechanics
from signorini_fx.tuned import NOTHING_LEFT

if TYPE_CHECKING:
    from ufl.core.expr import Expr

    from signorini_fx.mechanics.elasticity.elastic_law import ElementStress
    from signorini_fx.results.accuracy.stress_recovery import StressRecovery
    from signorini_fx.results.resultants import ActingForces, NamedForces
    from signorini_fx.results.stresses import RawStresses


def elastic_body(
    space: fem.FunctionSpace,
    a: fem.Form,
    bcs: Sequence[fem.DirichletBC],
    fixed: Flags,
    boundary: ContactBoundary | None,
    settings: SolverSettings,
    named: tuple[Statement, TaggedMesh],
    **more: Any,
) -> Model:
    """Return the elastic body of a user's form; collective.

    Args:
        space: the space of the displacement.
        a: the bilinear form.
        bcs: Dirichlet conditions.
        fixed: flags of prescribed owned dofs.
        boundary: the contact points; None: no contact.
        settings: settings of the solver.
        named: statement and tagged mesh, see ``named_parts``.
        more: further arguments of ``Model``; the stiffness is assembled and checked unless they
            contain an assembled one.
    """
    kinematics = CARTESIAN[space.mesh.geometry.dim]
    body = Model(
        space=space,
        terms=lambda: (a,),
        resists=None,
        bcs=bcs,
        turned=None,
        fixed=fixed,
        pieces=find_pieces(space.mesh),
        boundary=boundary,
        settings=settings,
        kinematics=kinematics,
        contacts=named[0].contact,
        path=counted_path(0),
        tagged=named[1],
        rigid=RigidBodies((), kinematics, 1.0),
        **more,
    )
    if not body.is_assembled:
        check_energy(body.stiffness, fixed.size, definite=body.definite, symmetric=body.symmetric)
    return body


NOT_FINITE = "its matrix is not finite: check its coefficients"
NOT_SYMMETRIC = "is not symmetric: a(y, z) and a(z, y) differ; friction is what contact= adds"
NOT_POSITIVE = "is not positive: a(z, z) is not for some basis function z; check its sign"


class MatrixError(FormError):
    """The matrix of a form cannot be used for a solve."""

    @property
    def fault(self) -> str:
        """The reason: one of ``NOT_FINITE``, ``NOT_SYMMETRIC`` and ``NOT_POSITIVE``."""
        return self.problems[0][1]


def check_energy(
    matrix: PETSc.Mat, owned: int, *, definite: bool = True, symmetric: bool = True
) -> None:
    """Raise a MatrixError unless the matrix is finite, symmetric and has a positive diagonal;
    collective.

    Symmetry, a(x, y) = a(y, x), is tested for two random vectors, and a(z, z) > 0 for each basis
    function z.

    Args:
        matrix: the matrix of the form.
        owned: number of dofs of the body on this rank, which come first.
        definite: whether to test the diagonal.
        symmetric: whether to test the symmetry.
    """
    x, y = matrix.createVecs()
    generator = np.random.default_rng(matrix.comm.rank)
    for vector in (x, y):
        vector.getArray()[:] = generator.standard_normal(vector.getLocalSize())
    forces = matrix * x
    forces_of_y = matrix * y
    size = forces.norm()
    if not np.isfinite(size):
        raise MatrixError([("a", NOT_FINITE)])
    if symmetric and abs(forces.dot(y) - forces_of_y.dot(x)) > NOTHING_LEFT * size:
        raise MatrixError([("a", NOT_SYMMETRIC)])
    if not definite:
        return
    diagonal = matrix.getDiagonal().getArray(readonly=True)[:owned]
    if parallel.any_rank(matrix.comm.tompi4py(), diagonal <= 0):
        raise MatrixError([("a", NOT_POSITIVE)])


def modulus_of(body: Model, boundary: ContactBoundary, facets: Sequence[Indices]) -> float:
    """Return the modulus of a body, the scale of gamma, estimated from its stiffness; collective.

    Without contact it is the geometric mean of the diagonal of the stiffness, which is about E h^(d
    - 2) per node, over h^(d - 2).  With contact it is estimated near the contact points: a point
    that moves alone strains cells of size l along the boundary and h across it, and meets about E
    (1 / h + h / l^2) per area.
    """
    space = body.space
    diagonal = body.stiffness.getDiagonal()
    if (
        body.relative is not None
    ):  # the terms of turning normals on rigid bodies are not stiffness of the body
        diagonal.getArray()[body.fixed.size :] = 0.0
    mesh = space.mesh
    dim = space.mesh.topology.dim
    if body.boundary is None:
        # Mean of logarithms: a few penalty entries would dominate an arithmetic mean.
        free = np.abs(diagonal.getArray(readonly=True)[~body.prescribed])
        units = mesh.h(dim, np.arange(mesh.topology.index_map(dim).size_local, dtype=np.int32)) ** (
            dim - 2
        )
        logarithms = [np.log(values[values > 0]) for values in (free, units)]
        totals = parallel.global_sum(
            boundary.comm, np.array([(values.sum(), values.size) for values in logarithms]).ravel()
        )
        return float(np.exp(totals[0] / max(totals[1], 1.0) - totals[2] / totals[3]))
    if "met" not in body.of_mesh:
        body.of_mesh["met"] = _met_at_nodes(space, boundary, np.concatenate(list(facets)))
    stiffness = body.contact.stiffness(diagonal)
    moves = stiffness > 0
    weight = boundary.weight[moves]
    unit = body.of_mesh["met"][boundary.nodes[moves]]
    weights, compliance = parallel.global_sum(
        boundary.comm, np.array([weight.sum(), weight @ (unit / stiffness[moves])])
    )
    return float(weights / compliance)


def _met_at_nodes(space: fem.FunctionSpace, boundary: ContactBoundary, facets: Indices) -> Array:
    """Return the degree times the mean of 1 / h + h / l^2 over the facets around each node of this
    rank, 1 / length; nan at nodes without a facet; collective.
    """
    mesh = space.mesh
    dim = space.mesh.topology.dim
    sums = fem.Function(space)
    cells = facet_cells(mesh, facets)
    across = 2 * (
        dmesh.compute_midpoints(mesh, dim, cells) - dmesh.compute_midpoints(mesh, dim - 1, facets)
    )
    along = mesh.h(dim - 1, facets)
    across = np.linalg.norm(across, axis=1)
    inverse = 1 / across + across / along**2
    array = sums.x.array.reshape(-1, mesh.geometry.dim)
    for node in boundary.segments[:, 1:].T:
        local = space.dofmap.index_map.global_to_local(np.ascontiguousarray(node))
        np.add.at(array[:, :2], local, np.column_stack((inverse, np.ones(inverse.size))))
    sums.x.scatter_reverse(la.InsertMode.add)
    with np.errstate(invalid="ignore"):
        return space.element.basix_element.degree * array[:, 0] / array[:, 1]


# --- what results are made of ---------------------------------------------------------------------


@dataclass(frozen=True)
class FormMechanics(Mechanics):
    """The mechanics of a model that is defined by forms, with their present values."""

    no_bounds = "a guaranteed bound is for scenes, which state their loads and supports"

    forms: GivenForms  # the checked and compiled forms
    prescribed: tuple[
        Flags, Array
    ]  # flags and values of prescribed dofs of this rank, ghosts included
    placed: Sequence[PlacedShape]  # the shapes of foundations
    settled: bool = True  # False: the forms belong to a later, failed step

    def shapes(self, step: float | None = None) -> Sequence[PlacedShape]:
        return self.placed

    def load(self, system: ElasticSystem, step: float) -> Array:
        """Return a single load factor of one, as the forms hold their present values."""
        return np.ones(1)

    def loads_at(self, step: float) -> Loads:
        return Loads(assemble(self.forms.compiled[1]), self.prescribed[1])

    def balance(self, y: fem.Function, step: float) -> Balance:
        """Return internal, external and support forces with the present values of the forms;
        ``step`` is ignored.
        """
        a, L = self.forms.compiled
        fixed, values = self.prescribed
        scales = self.model.scales
        dim = self.model.dimension
        nodes = np.arange(values.size // dim, dtype=np.int32)
        internal = action((a,), y, nodes).reshape(-1, dim)
        supports = prescribed_nodes(fixed, values, y.function_space)
        external = assemble(L).reshape(-1, dim)
        nothing = np.zeros_like(internal)
        return Balance(
            RigidPart(y.function_space), internal, external, supports, scales, scales, nothing
        )

    def stress(self, y: fem.Function, step: float) -> RawStresses | str:
        from signorini_fx.results.stresses import RawStresses

        law = self.forms.stress
        if law is None:
            return "the stresses are not given: pass stress=, a function of the displacement"
        return RawStresses(stress_of(law, y, self.forms.parts), self)

    @cached_property
    def recovery(self) -> StressRecovery:
        """The recovery of the stress for error estimates; the traction of compiled forms is
        ignored.
        """
        from signorini_fx.results.accuracy.stress_recovery import StressRecovery

        forms = self.forms
        fixed, _ = self.prescribed
        assert forms.stress is not None
        stress = stress_of(forms.stress, fem.Function(self.model.space), forms.parts)
        all_ufl = all(isinstance(form, ufl.Form) for form in forms.original)
        residual = partial(residual_of, stress, forms, fixed) if all_ufl else lambda z: None
        return StressRecovery(stress, lambda z: (lambda step: None, residual(z)))

    def acting(self, y: fem.Function, step: float) -> ActingForces:
        """Return the forces that act through the named parts of the boundary."""
        from signorini_fx.results.resultants import ActingForces

        balance = self.balance(y, step)
        forms = self.forms
        fixed, _ = self.prescribed
        if not self.settled:
            return ActingForces(balance, (), (), ())
        return acting_on(balance, forms.boundaries, fixed, loads_of(forms, self.model.tagged, y))


def loads_of(forms: GivenForms, tagged: TaggedMesh, y: fem.Function) -> Iterator[NamedForces]:
    """Yield the loads of UFL forms, and the forces of boundary terms of ``a`` that resist the
    displacement, see ``ActingForces``; collective.

    Each belongs to the named parts of the boundary that contain all facets of its integral.
    """
    comm = forms.mesh.comm
    dim = forms.mesh.geometry.dim
    nodes = np.arange(y.x.array.size // dim, dtype=np.int32)
    (a, L) = forms.original
    for form, resists in ((L, False), (a, True)):
        for integral in form.integrals() if isinstance(form, ufl.Form) else ():
            kind = integral.integral_type()
            if kind not in ("exterior_facet", "cell") or (resists and kind == "cell"):
                continue
            with compiling():
                compiled = fem.form(ufl.Form([integral]))
            values = -action((compiled,), y, nodes) if resists else np.asarray(assemble(compiled))
            if not parallel.any_rank(comm, values):
                continue
            if kind == "cell":
                yield None, "body force", values.reshape(-1, dim)
                continue
            facets = exterior_facets(integral, forms.mesh)
            for name in tagged.boundaries:
                if not parallel.any_rank(comm, not np.isin(facets, tagged.facets(name)).all()):
                    yield name, "springs" if resists else "traction", values.reshape(-1, dim)


def acting_on(
    balance: Balance,
    boundaries: Mapping[str, Indices],
    fixed: Flags,
    loads: Iterable[NamedForces],
    *,
    displaced: bool = False,
) -> ActingForces:
    """Return the forces that act on a body whose supports are named parts of its boundary;
    collective.

    A part is a support if at all of its nodes the same component is prescribed.  Where two supports
    share a node, the component belongs to the later one.
    """
    from signorini_fx.results.resultants import ActingForces

    space = balance.pieces.space
    supports = list[str | None]()
    by = np.full(
        (fixed.size // space.dofmap.index_map_bs, space.dofmap.index_map_bs), -1, dtype=np.int64
    )
    for number, (name, facets) in enumerate(boundaries.items()):
        nodes = facet_nodes(space, facets)
        free = ~fixed.reshape(by.shape)[nodes].all(axis=(0, 1))
        held = parallel.global_sum(space.mesh.comm, free.astype(np.float64)) == 0
        supports.append(name if held.any() else None)
        by[marked_nodes(space, nodes.ravel())[:, None] & held] = (
            number  # also nodes of facets that another rank owns
        )
    balance = replace(balance, supports=replace(balance.supports, by=by[: len(balance.external)]))
    loads = list(loads)
    acted_on = {*supports, *(where for where, *_ in loads)}
    return ActingForces(
        balance, supports, loads, [name for name in boundaries if name in acted_on], displaced
    )


def prescribed_nodes(fixed: Flags, values: Array, space: fem.FunctionSpace) -> PrescribedNodes:
    """Return the prescribed components of the owned nodes in the format of certificates.

    Args:
        fixed: flags of prescribed dofs of this rank, ghosts included, shape (dofs,).
        values: their values, length, shape (dofs,).
        space: the space of the displacement.
    """
    dim = space.mesh.geometry.dim
    owned = space.dofmap.index_map.size_local
    here = fixed.reshape(-1, dim)[:owned]
    return PrescribedNodes(here, values.reshape(-1, dim)[:owned], np.where(here, 0, -1))


def stress_of(law: Law, y: fem.Function, parts: Sequence[Indices]) -> ElementStress:
    """Return the stress of a displacement, with the moduli at the midpoint of each cell;
    collective.

    Args:
        law: the stress as UFL, shape (d, d), or (3, 3) in 2D, linear in the strain up to a stress
            without strain.
        y: the displacement.
        parts: the cells of each material.

    Raises:
        FormError: the stress has another shape, cannot be evaluated, or is zero for some strain.
    """
    from signorini_fx.mechanics.elasticity.elastic_law import cellwise_stress

    mesh = y.function_space.mesh
    dim = mesh.geometry.dim
    full_stress = law(y)
    if not hasattr(full_stress, "ufl_shape") or full_stress.ufl_shape not in ((dim, dim), (3, 3)):
        shape = getattr(full_stress, "ufl_shape", "none")
        raise FormError.at("stress", f"has the shape {shape}; ({dim}, {dim}) or (3, 3) is needed")
    if _by_quadrature(full_stress):
        raise FormError.at(
            "stress", "has a Function of a quadrature element, which has no values at other points"
        )
    known = full_stress.ufl_shape[0] == 3  # otherwise the stress out of the plane is unknown
    kinematics = CARTESIAN[dim] if known else PLANE_STRESS
    sigma = padded(full_stress, dim, full_stress[2, 2] if known else 0)
    moduli = cellwise_moduli(_energy_by(law, law(fem.Function(y.function_space))), y.function_space)
    try:
        shear_modulus = None
        if (lame := isotropic_moduli(moduli, dim, mesh)) is not None:
            shear_modulus = fem.Function(fem.functionspace(mesh, ("DG", 0)))
            shear_modulus.x.array[:] = lame[1]
        return replace(cellwise_stress(y, kinematics, sigma, moduli, shear_modulus), parts=parts)
    except np.linalg.LinAlgError:
        raise FormError.at(
            "stress", "is zero for some strain: nothing can be measured in its energy"
        ) from None


def cellwise_moduli(energy: Energy, space: fem.FunctionSpace) -> Array:
    """Return the elasticity matrix at the midpoint of each cell, stress over strain components,
    shape (cells, m, m); collective.

    It is the energy of two displacement fields with a single strain component each. Both are zero
    at the midpoint, so that there is no hoop strain.
    """
    mesh = space.mesh
    kinematics = CARTESIAN[space.mesh.geometry.dim]
    dim = kinematics.dimension
    x = ufl.SpatialCoordinate(mesh)
    of_cells = fem.functionspace(mesh, ("DG", 0))
    cellwise, *middle = (fem.Function(of_cells) for _ in range(1 + dim))
    for k, function in enumerate(middle):
        function.interpolate(lambda points, k=k: points[k])
    x = x - ufl.as_vector(middle)
    axes = [ufl.unit_vector(k, dim) for k in range(dim)]
    strained = [
        (x[i] * axes[j] + x[j] * axes[i]) / 2 for i, j in kinematics.pairs
    ]  # one unit strain, or a shear strain of 1/2
    # One compiled expression; its constants select the pair of fields.
    factors = [fem.Constant(mesh, np.zeros(len(strained))) for _ in range(2)]
    fields = [sum(factor[k] * field for k, field in enumerate(strained)) for factor in factors]
    with compiling():
        modulus = fem.Expression(energy(*fields), compat.interpolation_points(of_cells.element))
    moduli = np.empty((cellwise.x.array.size, len(strained), len(strained)))
    for pair in np.ndindex(moduli.shape[1:]):
        for factor, k in zip(factors, pair, strict=True):
            factor.value[:] = np.arange(len(strained)) == k
        cellwise.interpolate(modulus)
        moduli[:, pair[0], pair[1]] = cellwise.x.array
    return moduli


def _energy_by(law: Law, at_rest: Expr) -> Energy:
    """Return a function of z and y that gives the energy density sigma(y) : grad z."""

    def energy(z: Expr, y: Expr) -> Expr:
        stress = law(y) - at_rest
        slopes = ufl.grad(z)
        return sum(stress[k] * slopes[k] for k in np.ndindex(slopes.ufl_shape))

    return energy


def isotropic_moduli(moduli: Array, dim: int, mesh: dmesh.Mesh) -> tuple[Array, Array] | None:
    """Return the Lame parameters (lambda, mu) of each cell from ``cellwise_moduli``, or None if
    some cell is not isotropic; collective.
    """
    mu = moduli[:, -1, -1]
    lame = moduli[:, 0, 1]
    isotropic = np.zeros_like(moduli)
    isotropic[:, :dim, :dim] = lame[:, None, None]
    diagonal = np.arange(moduli.shape[2])
    isotropic[:, diagonal, diagonal] += np.where(diagonal < dim, 2.0, 1.0) * mu[:, None]
    apart = np.abs(moduli - isotropic).max(initial=0.0) > NOTHING_LEFT * np.abs(moduli).max(
        initial=0.0
    )
    if parallel.any_rank(mesh.comm, bool(apart)):
        return None
    return lame, mu


def natural_modulus(
    law: Law | None, a: UflOrCompiled | None, measures: set[Expr], space: fem.FunctionSpace
) -> float | None:
    """Return Young's modulus of the stiffest cell, the natural unit of stress, or None if the
    material is not isotropic or the forms cannot be evaluated; collective.

    It follows from the stress law, or from the form divided by the measure of the contacts.  A form
    of numbers alone has the same modulus on each mesh, so that of the last one is kept.
    """
    numbers = None if law is not None or measures else _numbers_of(a)
    if parallel.any_rank(space.mesh.comm, numbers is None or numbers not in _last_modulus):
        modulus = _modulus_of_cells(law, a, measures, space)
        _last_modulus.clear()
        if numbers is not None:
            _last_modulus[numbers] = modulus
        return modulus
    assert numbers is not None
    return _last_modulus[numbers]


_last_modulus: dict[tuple[str, bytes], float | None] = {}  # by ``_numbers_of`` a form


def _numbers_of(a: UflOrCompiled | None) -> tuple[str, bytes] | None:
    """Return the signature of a form and the values of its Constants; None if it depends on
    anything else, such as Functions or the position.
    """
    if not isinstance(a, ufl.Form) or a.coefficients() or extract_type(a, GeometricQuantity):
        return None
    return a.signature(), b"".join(constant.value.tobytes() for constant in a.constants())


def _modulus_of_cells(
    law: Law | None, a: UflOrCompiled | None, measures: set[Expr], space: fem.FunctionSpace
) -> float | None:
    mesh = space.mesh
    dim = space.mesh.geometry.dim
    if law is not None and not measures:
        at_rest = law(fem.Function(space))
        if getattr(at_rest, "ufl_shape", None) not in ((dim, dim), (3, 3)) or _by_quadrature(
            at_rest
        ):
            return None
        energy = _energy_by(law, at_rest)
    else:
        if not isinstance(a, ufl.Form):
            return None
        integrals = a.integrals_by_type("cell")
        everywhere = all(integral.subdomain_id() == "everywhere" for integral in integrals)
        # With several measures it is unknown which one multiplies the energy.
        if not integrals or is_section(mesh) or not everywhere or len(measures) > 1:
            return None
        whole = sum(integral.integrand() for integral in integrals) / next(iter(measures), 1)
        if _by_quadrature(whole):
            return None

        def energy(z: Expr, y: Expr) -> Expr:
            return ufl.replace(whole, dict(zip(a.arguments(), (z, y), strict=True)))

    lame = isotropic_moduli(cellwise_moduli(energy, space), dim, mesh)
    if lame is None:
        return None
    first, shear = lame
    with np.errstate(divide="ignore", invalid="ignore"):
        young = shear * (3 * first + 2 * shear) / (first + shear)
    largest = parallel.largest(mesh.comm, young)
    return largest if 0.0 < largest < np.inf else None


def _by_quadrature(expression: Expr) -> bool:
    """Return whether the expression contains a Function of a quadrature element, which cannot be
    evaluated at the midpoint of a cell.
    """
    coefficients = ufl.algorithms.extract_coefficients(expression)
    return any(
        getattr(function.ufl_element(), "has_custom_quadrature", False) for function in coefficients
    )


def residual_of(stress: ElementStress, forms: GivenForms, fixed: Flags, z: Expr) -> ufl.Form | None:
    """Return the squared residual of the traction that UFL forms prescribe, see
    ``squared_residual``; collective.

    Contact facets and prescribed components are left out.

    Args:
        stress: the stress.
        forms: the forms.
        fixed: flags of prescribed dofs, ghosts included.
        z: a test function, constant in each cell.
    """
    from signorini_fx.results.accuracy.stress_recovery import squared_residual

    space = stress.displacement.function_space
    mesh = space.mesh
    dim = stress.kinematics.dimension
    touching = np.concatenate([np.zeros(0, np.int32), *forms.facets, *forms.masters.values()])
    exterior = outer_facets(mesh)
    traction_facets = np.setdiff1d(exterior, touching).astype(np.int32)
    held = fixed.reshape(-1, dim)[facet_nodes(space, traction_facets)].all(axis=1)
    integrals = [
        integral
        for form in forms.original
        if isinstance(form, ufl.Form)
        for integral in form.integrals_by_type("exterior_facet")
    ]
    on = [np.isin(traction_facets, exterior_facets(integral, mesh)) for integral in integrals]

    def of(numbers: Ints, residual: Expr) -> tuple[Expr, list[Expr], bool]:
        varies = False
        for number in numbers[numbers >= dim]:
            traction = _traction(integrals[number - dim].integrand(), stress.displacement)
            varies = varies or ufl.algorithms.estimate_total_polynomial_degree(traction) > 0
            residual = residual + traction
        free = [0.0 if k in numbers else residual[k] for k in range(dim)]
        return ufl.as_vector(free), [], varies

    return squared_residual(stress, traction_facets, np.column_stack((held, *on)), of, z)


def _traction(integrand: Expr, y: fem.Function) -> Expr:
    """Return the traction that a boundary integral prescribes, as a vector: for L the integrand
    itself, for a the integrand a(y, .) with a minus sign.
    """
    *trial, test = sorted(
        ufl.algorithms.extract_arguments(integrand), key=lambda argument: -int(argument.number())
    )
    dim = len(y)
    parts = [
        ufl.replace(integrand, {test: ufl.unit_vector(k, dim), **dict.fromkeys(trial, y)})
        for k in range(dim)
    ]
    return (-1 if trial else 1) * ufl.as_vector(parts)


def exterior_facets(integral: ufl.Integral, mesh: dmesh.Mesh) -> Indices:
    """Return the exterior facets of this rank over which a boundary integral extends."""
    data = integral.subdomain_data()
    wanted = integral.subdomain_id()
    wanted = wanted if isinstance(wanted, tuple) else (wanted,)
    if data is None or "everywhere" in wanted:
        return outer_facets(mesh)
    if hasattr(data, "values"):
        return data.indices[np.isin(data.values, wanted)]
    pairs = np.concatenate(
        [np.empty(0, int), *(entities for number, entities in data if number in wanted)]
    )
    dim = mesh.topology.dim
    mesh.topology.create_connectivity(dim, dim - 1)
    of_cell = mesh.topology.connectivity(dim, dim - 1)
    return np.asarray(of_cell.array[of_cell.offsets[pairs[::2]] + pairs[1::2]])
