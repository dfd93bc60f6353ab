"""The residual F with the state of the material, and its derivative, which has the quadrature of F
and can be tested by differences.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import basix
import numpy as np
import ufl
from dolfinx import fem
from ufl.algorithms import compute_form_data
from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering
from ufl.algorithms.apply_derivatives import apply_derivatives

from signorini_fx.arrays import Array, Flags, Indices
from signorini_fx.errors import FormError
from signorini_fx.machine import parallel
from signorini_fx.machine.compilation import compiling
from signorini_fx.mechanics.assembly.mesh_entities import action, assemble
from signorini_fx.mechanics.body.deformation import CellSlopes
from signorini_fx.mechanics.mesh.points import determinants, inverses
from signorini_fx.mechanics.state import Field, State, at_cells
from signorini_fx.mechanics.step_effect import SteppedForms
from signorini_fx.tuned import (
    DIFFERENCE_STRAINS,
    NEGLIGIBLE,
    NOTHING_LEFT,
    SAME_TANGENT,
    UNITS_OF_DIFFERENCE,
)

if TYPE_CHECKING:
    from ufl.core.expr import Expr

    from signorini_fx.forms.given_forms import FormOptions, UflOrCompiled


class Remembers(Protocol):
    """The interface of a material's history of earlier load steps: arrays by name, with one row for
    each owned cell of this rank.
    """

    def remembered(self) -> Mapping[str, Array]:
        """Return the material history at the end of the last step."""

    def recall(self, fields: Mapping[str, Field]) -> None:
        """Restore the history from the fields of a state; collective.

        Raises:
            SceneError: the state belongs to another material.
        """


@dataclass(frozen=True)
class KeptFunctions:
    """The Functions of cells, by name, that a user's ``commit`` changes."""

    functions: Mapping[str, fem.Function]

    def _dofs(self, name: str) -> tuple[Array, Indices]:
        """Return the values of a Function, one row per node, and the nodes of each owned cell."""
        space = self.functions[name].function_space
        topology = space.mesh.topology
        owned = topology.index_map(topology.dim).size_local
        values = self.functions[name].x.array.reshape(-1, space.dofmap.index_map_bs)
        return values, space.dofmap.list[:owned]

    def remembered(self) -> dict[str, Array]:
        """Return the values in each owned cell, by name."""
        pairs = {name: self._dofs(name) for name in self.functions}
        return {name: values[nodes] for name, (values, nodes) in pairs.items()}

    def recall(self, fields: Mapping[str, Field]) -> None:
        """Set the Functions to the fields of a state, see ``Remembers``."""
        for name, rows in at_cells(fields, self.remembered()).items():
            values, nodes = self._dofs(name)
            values[nodes] = rows
            self.functions[name].x.scatter_forward()


@dataclass
class Residual:
    """The residual F, with the loads beside it and the user's update of the material."""

    form: fem.Form
    u: fem.Function
    update: Callable[[], None] | None  # the user's function, called before assembly; None: no state
    loads: Array | float = (
        0.0  # additional forces on the body, shape (owned dofs,), or a number for all
    )
    # The forms of a time step, which replace F; None: F itself.  ``further``: their forces beside
    # the loads.
    stepped: SteppedForms | None = None
    further: Array | float = 0.0
    whole: fem.Form | None = None  # F itself if ``form`` is that of a time step
    _slopes: CellSlopes | None = field(
        default=None, init=False
    )  # of the mesh at its present position

    def assembled(self) -> Array:
        """Return F minus the additional loads at the present ``u``, at the owned dofs, force;
        collective.
        """
        return assemble(self.form) - self.loads - self.further

    def begin(self, state: State, dt: float) -> None:
        """Prepare the step of duration ``dt`` that follows a state, with the loads at its end."""
        if self.stepped is not None:
            self.further = self.stepped.begin(state, dt, self.loads)

    def internal(self, values: Array) -> Array:
        """Return F itself, without the additional loads, at values of ``u``, ghosts included; ``u``
        stays as it is; collective.
        """
        kept = self.u.x.array.copy()
        self.u.x.array[:] = values
        forces = assemble(self.whole or self.form)
        self.u.x.array[:] = kept
        return forces

    def at(self, values: Array) -> Array | None:
        """Set ``u`` to values, ghosts included, and return F minus the loads at the owned dofs;
        None if F is not finite or a cell is inverted; collective.

        Raises:
            FormError: ``update`` has raised an exception.
        """
        self.go_to(values)
        forces = self.assembled()
        # Whether det(I + grad u) = det (x + u)' / det x' is not positive at a quadrature point.
        fails = not np.isfinite(forces).all() or any(
            bool((determinants(displaced) * np.sign(determinants(place)) <= 0).any())
            for place, displaced in self._gradients(values)
        )
        return None if parallel.any_rank(self.u.function_space.mesh.comm, fails) else forces

    def _gradients(self, values: Array) -> Iterator[tuple[Array, Array]]:
        """Yield for each quadrature point of the cells of this rank the Jacobians of the undeformed
        and of the displaced cells with respect to the reference cell, shape (d, d, cells); for
        sections the plane part.
        """
        space = self.u.function_space
        if self._slopes is None or not self._slopes.fits:
            cell = space.mesh.topology.cell_name()
            degree = space.element.basix_element.degree
            self._slopes = CellSlopes(
                space, basix.make_quadrature(getattr(basix.CellType, cell), 2 * degree)[0]
            )
        for place, moved in self._slopes.along_reference(values):
            yield place, place + moved[: len(place)]

    def turns_over(self, before: Array) -> bool:
        """Return whether a cell turns over between other values and the present ``u``; collective.

        The deformation in between, F now times the inverse of F before, then has an eigenvalue with
        |arg| above 135 degrees. With a negative eigenvalue the straight path between both passes a
        singular deformation, but an iterate of Newton's method may be there: two negative ones
        leave det F positive.

        Args:
            before: the other values of ``u``, ghosts included.
        """
        both = zip(self._gradients(before), self._gradients(self.u.x.array), strict=True)
        turned = False
        for (_, first), (_, last) in both:
            way = np.einsum("ijc,jkc->cik", last, inverses(first))
            far = (
                np.linalg.norm(way - np.eye(len(first)), axis=(1, 2)) >= 1
            )  # otherwise no eigenvalue is that far from one
            values = np.linalg.eigvals(way[far])
            turned |= bool((values.real < -np.abs(values.imag)).any())
        return parallel.any_rank(self.u.function_space.mesh.comm, turned)

    def go_to(self, values: Array) -> None:
        """Set ``u`` to values, ghosts included, and update the state of the material there, see
        ``at``; collective.
        """
        self.u.x.array[:] = values
        self.updated()

    def updated(self) -> None:
        """Call ``update``; collective.

        Raises:
            FormError: it has raised an exception on some rank.
        """
        if self.update is None:
            return
        error: Exception | None = None
        try:
            self.update()
        except Exception as raised:  # a user's function may raise anything
            error = raised
        named = (
            None
            if error is None
            else FormError.at("update", f"raised {type(error).__name__}: {error}")
        )
        try:
            parallel.raise_together(self.u.function_space.mesh.comm, named)
        except FormError as failed:
            raise failed from error


class Tangents:
    """The user's tangent J, if ``given``, and the derivative dF/du; each is compiled when first
    used.
    """

    def __init__(
        self,
        F: ufl.Form,
        J: UflOrCompiled | None,
        u: fem.Function,
        options: FormOptions,
    ) -> None:
        self.given = J is not None
        self._F = F
        self._J = J
        self._u = u
        self._options = options

    @cached_property
    def leading(self) -> fem.Form:
        """The compiled tangent of Newton's method: J if given, otherwise dF/du; collective."""
        return self._compiled(self._J) if self.given else self.derivative

    @cached_property
    def bilinear(self) -> ufl.Form | None:
        """dF/du in UFL if it does not depend on u and J is not given; otherwise None."""
        if self.given:
            return None
        form = apply_derivatives(
            ufl.derivative(lowered(self._F), self._u, ufl.TrialFunction(self._u.function_space))
        )
        return None if self._u in form.coefficients() else form

    @cached_property
    def derivative(self) -> fem.Form:
        """The compiled derivative dF/du; collective."""
        return self._compiled(
            derivative(self._F, self._u, ufl.TrialFunction(self._u.function_space))
        )

    def _compiled(self, form: UflOrCompiled) -> fem.Form:
        with compiling():
            return form if isinstance(form, fem.Form) else fem.form(form, **self._options)


def lowered(F: ufl.Form) -> ufl.Form:
    """Return F in terms of components, with its derivatives carried out."""
    return apply_derivatives(apply_algebra_lowering(F))


def derivative(F: ufl.Form, u: fem.Function, trial: Expr) -> ufl.Form:
    """Return F'(u) in the direction ``trial``, with the quadrature degrees of F; UFL would estimate
    higher ones for the derivative.
    """
    unknown = [
        integral for integral in F.integrals() if "quadrature_degree" not in integral.metadata()
    ]
    if not unknown:
        return ufl.derivative(F, u, trial)
    form_data = compute_form_data(
        ufl.Form(unknown),
        do_apply_function_pullbacks=True,
        do_apply_integral_scaling=True,
        do_apply_geometry_lowering=True,
        preserve_geometry_types=(ufl.classes.Jacobian,),
        do_apply_restrictions=True,
        do_append_everywhere_integrals=False,
    )
    estimated = dict[tuple[str, int | str], int]()
    for data in form_data.integral_data:
        degrees = [
            integral.metadata()["estimated_polynomial_degree"] for integral in data.integrals
        ]
        estimated |= {
            (data.integral_type, number): int(max(map(np.max, degrees)))
            for number in data.subdomain_id
        }

    def as_assembled(integral: ufl.Integral) -> ufl.Integral:
        numbers = integral.subdomain_id()
        numbers = (
            numbers
            if isinstance(numbers, tuple)
            else ("otherwise" if numbers == "everywhere" else numbers,)
        )
        degrees = [
            estimated[key]
            for number in numbers
            if (key := (integral.integral_type(), number)) in estimated
        ]
        if "quadrature_degree" in integral.metadata() or not degrees:
            return integral
        return integral.reconstruct(
            metadata={**integral.metadata(), "quadrature_degree": max(degrees)}
        )

    return ufl.derivative(
        ufl.Form([as_assembled(integral) for integral in F.integrals()]), u, trial
    )


def is_derivative(form: fem.Form, residual: Residual, values: Array, free: Flags) -> bool:
    """Return whether a bilinear form is the derivative of F at values of ``u``, tested by central
    differences in a random direction; collective.

    Near a yield surface, forces change differently ahead and behind: either one counts as a
    derivative.

    Args:
        form: the bilinear form.
        residual: F.
        values: values of ``u``, ghosts included.
        free: flags of the owned dofs that are compared.
    """
    u = residual.u
    comm = residual.u.function_space.mesh.comm

    def agrees(strain: float) -> bool:
        """Return whether they agree for a displacement with this size of strain."""
        now = residual.at(values)
        direction = random_direction(u, strain)
        direction.x.array[: free.size][~free] = 0.0
        direction.x.scatter_forward()
        nodes = direction.x.array.size // u.function_space.dofmap.index_map_bs
        predicted = action((form,), direction, np.arange(nodes, dtype=np.int32))
        ahead, behind = (residual.at(values + sign * direction.x.array) for sign in (1.0, -1.0))
        if now is None or ahead is None or behind is None:
            return False
        apart = np.abs(predicted - (ahead - behind) / 2) - np.abs(ahead - 2 * now + behind) / 2
        error = np.where(free, np.maximum(apart, 0.0), 0.0)
        squares = parallel.global_sum(
            comm, np.array([error @ error, (predicted * free) @ predicted])
        )
        return bool(squares[0] <= SAME_TANGENT**2 * squares[1])

    fits = any(map(agrees, DIFFERENCE_STRAINS))
    residual.go_to(values)
    return fits


def random_direction(u: fem.Function, strain: float) -> fem.Function:
    """Return a random displacement that strains each cell by about ``strain``; its signs depend on
    the number of ranks.
    """
    space = u.function_space
    direction = fem.Function(u.function_space)
    mesh = space.mesh
    tdim = space.mesh.topology.dim
    dim = space.dofmap.index_map_bs
    cells = mesh.topology.index_map(tdim)
    count = cells.size_local + cells.num_ghosts
    smallest = np.full(
        direction.x.array.size // dim, np.inf
    )  # size of the smallest cell around each node
    np.minimum.at(
        smallest, space.dofmap.list[:count], mesh.h(tdim, np.arange(count, dtype=np.int32))[:, None]
    )
    signs = np.random.default_rng(mesh.comm.rank).choice([-1.0, 1.0], direction.x.array.size)
    direction.x.array[:] = strain * np.repeat(smallest, dim) * signs
    direction.x.scatter_forward()
    return direction


def round_off(residual: Residual, forces: Array) -> Array:
    """Return the round-off error of F at each owned dof, shape (owned dofs,); collective.

    It is measured: over a change that is large beside round-off and small beside anything else, F
    is linear, so its second difference is the round-off of three evaluations.  A residual that
    computes I + grad u has the round-off of the identity, however small u is; one that computes
    strains from grad u has that of the strains.  Dofs whose error happens to be small get the root
    mean square of all.

    Args:
        residual: F.
        forces: its value at the present ``u``.
    """
    u = residual.u
    unit = UNITS_OF_DIFFERENCE * float(np.finfo(float).eps)
    values = u.x.array.copy()
    change = random_direction(u, unit).x.array
    last_digits = unit * np.abs(values) * np.sign(change)
    change = np.where(np.abs(last_digits) > np.abs(change), last_digits, change)
    ahead, behind = (residual.at(values + sign * change) for sign in (1.0, -1.0))
    residual.go_to(values)
    if ahead is None or behind is None:
        return np.zeros_like(forces)
    # The variances of three evaluations add up: 1 + 4 + 1.
    comm = u.function_space.mesh.comm
    lost = np.abs(ahead - 2 * forces + behind) / np.sqrt(6)
    squares, count = parallel.global_sum(comm, np.array([lost @ lost, lost.size]))
    return np.maximum(lost, np.sqrt(squares / count))


def refuse_miscompiled(
    F: ufl.Form, residual: fem.Form, u: fem.Function, options: FormOptions
) -> None:
    """Raise a FormError if F has several quadrature rules and its compiled form differs from the
    sum of its parts, one per rule; collective.
    """
    rules: dict[int | None, list[ufl.Integral]] = {}
    for integral in F.integrals():
        rules.setdefault(integral.metadata().get("quadrature_degree"), []).append(integral)
    if len(rules) < 2:
        return
    with compiling():
        parts = [fem.form(ufl.Form(integrals), **options) for integrals in rules.values()]
    values = u.x.array.copy()
    u.x.array[:] += random_direction(u, NEGLIGIBLE).x.array
    whole = assemble(residual)
    summed = np.sum([assemble(part) for part in parts], axis=0)
    u.x.array[:] = values
    comm = u.function_space.mesh.comm
    wrong, size = (parallel.largest(comm, np.abs(forces)) for forces in (whole - summed, summed))
    if np.isfinite(size) and not wrong <= NOTHING_LEFT * size:
        why = (
            "is compiled wrongly: FFCx takes a quadrature rule of one point beside another one "
            "for something else, "
        )
        cure = f"{wrong / size:.1e} from the sum over its rules; take no quadrature_degree below 2"
        raise FormError.at("F", why + cure)
