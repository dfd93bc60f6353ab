"""The derivative of a residual: made with the quadrature of the residual, and tried by differences."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from ufl.algorithms import compute_form_data
from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering
from ufl.algorithms.apply_derivatives import apply_derivatives

from signorini_fx.errors import FormError
from signorini_fx.machine import parallel
from signorini_fx.machine.compilation import compiling
from signorini_fx.mechanics.assembly.mesh_entities import action, assemble
from signorini_fx.tuned import DIFFERENCE_STRAINS, NEGLIGIBLE, NOTHING_LEFT, SAME_TANGENT, UNITS_OF_DIFFERENCE

Array = npt.NDArray[np.float64]


class Tangents:
    """The user's tangent and the derivative of F, each compiled when it is first needed.

    Args:
        F: a UFL form with one argument.
        J: the user's, UFL or compiled; None: there is none.
        u: the Function that F is differentiated by.
        options: of the form compiler, as ``dolfinx.fem.form`` takes them.

    Attributes:
        given: whether there is one of the user's.
        trusted: whether that is known to be the derivative, and is not tried: near a yield stress no difference tells.
    """

    trusted = False

    def __init__(self, F: Any, J: Any, u: fem.Function, options: dict[str, Any]) -> None:
        self.given = J is not None
        self._F, self._J, self._u, self._options = F, J, u, options

    @property
    def leading(self) -> fem.Form:
        """The one that leads Newton's method; collective."""
        return self._leading if self.given else self.derivative

    @cached_property
    def _leading(self) -> fem.Form:
        return self._compiled(self._J)

    @property
    def affine(self) -> bool:
        """Whether the tangent of Newton's method is the derivative of F, and the same at all displacements."""
        return self.bilinear is not None

    @cached_property
    def bilinear(self) -> Any:
        """F' in UFL where it is the same at all displacements; else, and where there is one of the user's, None."""
        if self.given:
            return None
        form = ufl.derivative(self._F, self._u, ufl.TrialFunction(self._u.function_space))
        lowered = apply_derivatives(apply_algebra_lowering(form))
        return None if self._u in lowered.coefficients() else lowered

    @cached_property
    def derivative(self) -> fem.Form:
        """That of F; collective."""
        return self._compiled(derivative(self._F, self._u, ufl.TrialFunction(self._u.function_space)))

    def _compiled(self, form: Any) -> fem.Form:
        with compiling():
            return form if isinstance(form, fem.Form) else fem.form(form, **self._options)


def derivative(F: Any, u: fem.Function, trial: Any) -> Any:
    """F'(u), integrated at the points at which F is: by default UFL estimates a higher degree for it.

    Args:
        F: a UFL form with one argument.
        u: the Function it is differentiated by.
        trial: the direction.
    """
    lowered = compute_form_data(
        F,
        do_apply_function_pullbacks=True,
        do_apply_integral_scaling=True,
        do_apply_geometry_lowering=True,
        preserve_geometry_types=(ufl.classes.Jacobian,),
        do_apply_restrictions=True,
        do_append_everywhere_integrals=False,
    )
    estimated = dict[tuple[str, Any], int]()
    for data in lowered.integral_data:
        for integral in data.integrals:
            if "quadrature_degree" in integral.metadata():
                continue
            for number in data.subdomain_id:
                key = (data.integral_type, number)
                degree = int(np.max(integral.metadata()["estimated_polynomial_degree"]))
                estimated[key] = max(estimated.get(key, 0), degree)

    def as_assembled(integral: Any) -> Any:
        numbers = integral.subdomain_id()
        numbers = numbers if isinstance(numbers, tuple) else ("otherwise" if numbers == "everywhere" else numbers,)
        degrees = [estimated[key] for number in numbers if (key := (integral.integral_type(), number)) in estimated]
        if "quadrature_degree" in integral.metadata() or not degrees:
            return integral
        return integral.reconstruct(metadata={**integral.metadata(), "quadrature_degree": max(degrees)})

    return ufl.derivative(ufl.Form([as_assembled(integral) for integral in F.integrals()]), u, trial)


def spacing(space: fem.FunctionSpace) -> Array:
    """The size of the smallest cell around each node, ghosts included, length, shape (nodes,); collective."""
    mesh, tdim = space.mesh, space.mesh.topology.dim
    cells = mesh.topology.index_map(tdim)
    count = cells.size_local + cells.num_ghosts
    size, function = mesh.h(tdim, np.arange(count, dtype=np.int32)), fem.Function(space)
    smallest = np.full(function.x.array.size // space.dofmap.index_map_bs, np.inf)
    np.minimum.at(smallest, space.dofmap.list[:count], np.asarray(size)[:, None])
    function.x.array[:] = np.repeat(smallest, space.dofmap.index_map_bs)
    function.x.scatter_forward()
    return np.array(function.x.array[:: space.dofmap.index_map_bs])


def is_derivative(
    form: fem.Form, u: fem.Function, forces: Callable[[Array], Array | None], free: npt.NDArray[np.bool_]
) -> bool:
    """Whether the product of a bilinear form with a random displacement is what forces change by; collective.

    Args:
        form: compiled.
        u: the displacement.
        forces: F at the owned unknowns for values of ``u``, ghosts included; None: it has none there.
        free: which of the owned unknowns are not prescribed, shape (owned dofs,).
    """
    return any(_agrees(form, u, forces, free, strain) for strain in DIFFERENCE_STRAINS)


def _agrees(
    form: fem.Form,
    u: fem.Function,
    forces: Callable[[Array], Array | None],
    free: npt.NDArray[np.bool_],
    strain: float,
) -> bool:
    """The same over a change of strain of this size; ``u`` is as it was after it, but not what depends on it.

    Where the change leads across a yield surface, forces change otherwise ahead than behind: either is a derivative.
    """
    comm, values = u.function_space.mesh.comm, u.x.array.copy()
    now = forces(values)
    direction = random_direction(u, strain)
    direction.x.array[: free.size][~free] = 0.0
    direction.x.scatter_forward()
    nodes = direction.x.array.size // u.function_space.dofmap.index_map_bs
    predicted = action((form,), direction, np.arange(nodes, dtype=np.int32))
    ahead, behind = (forces(values + sign * direction.x.array) for sign in (1.0, -1.0))
    u.x.array[:] = values
    if now is None or ahead is None or behind is None:
        return False
    apart = np.abs(predicted - (ahead - behind) / 2) - np.abs(ahead - 2 * now + behind) / 2
    error = np.where(free, np.maximum(apart, 0.0), 0.0)
    squares = parallel.global_sum(comm, np.array([error @ error, (predicted * free) @ predicted]))
    return bool(squares[0] <= SAME_TANGENT**2 * squares[1])


def random_direction(u: fem.Function, strain: float) -> fem.Function:
    """A displacement that strains each cell by about this much, the same on any number of ranks only in size.

    Args:
        u: gives the space.
        strain: without unit.
    """
    space, direction = u.function_space, fem.Function(u.function_space)
    generator = np.random.default_rng(space.mesh.comm.rank)
    signs = generator.choice([-1.0, 1.0], direction.x.array.size)
    direction.x.array[:] = strain * np.repeat(spacing(space), space.dofmap.index_map_bs) * signs
    direction.x.scatter_forward()
    return direction


def round_off(u: fem.Function, residual: Array, forces: Callable[[Array], Array | None]) -> Array:
    """What round-off changes of forces, shape (owned dofs,); collective.

    It is measured: over a change that is large beside round-off, and small beside anything else, F is linear, so that
    its second difference is round-off of three evaluations.  A residual that computes I + grad u has that of the unit,
    however small u is; one that computes strains from grad u alone that of the strains.  At some unknowns it is
    nothing by chance: they have the mean of all, quadratic.

    Args:
        u: the displacement.
        residual: F there.
        forces: see ``is_derivative``.
    """
    unit, values = UNITS_OF_DIFFERENCE * float(np.finfo(float).eps), u.x.array.copy()
    change = random_direction(u, unit).x.array
    last_digits = unit * np.abs(values) * np.sign(change)
    change = np.where(np.abs(last_digits) > np.abs(change), last_digits, change)
    ahead, behind = (forces(values + sign * change) for sign in (1.0, -1.0))
    if ahead is None or behind is None:
        return np.zeros_like(residual)
    # The variances of three evaluations add up: 1 + 4 + 1.
    comm, lost = u.function_space.mesh.comm, np.abs(ahead - 2 * residual + behind) / np.sqrt(6)
    squares, count = parallel.global_sum(comm, np.array([lost @ lost, lost.size]))
    return np.asarray(np.maximum(lost, np.sqrt(squares / count)))


def refuse_miscompiled(F: Any, residual: fem.Form, u: fem.Function, options: dict[str, Any]) -> None:
    """Compare a residual with the sum of its integrals by each rule, where it has several; collective.

    Args:
        F: a UFL form.
        residual: F, compiled.
        u: the Function that F depends on; it is as it was afterwards.
        options: of the form compiler, see ``dolfinx.fem.form``.

    Raises:
        FormError: they differ.
    """
    rules: dict[Any, list[Any]] = {}
    for integral in F.integrals():
        rules.setdefault(integral.metadata().get("quadrature_degree"), []).append(integral)
    if len(rules) < 2:
        return
    with compiling():
        parts = [fem.form(ufl.Form(integrals), **options) for integrals in rules.values()]
    values = u.x.array.copy()
    u.x.array[:] += random_direction(u, NEGLIGIBLE).x.array
    whole, summed = assemble(residual), np.sum([assemble(part) for part in parts], axis=0)
    u.x.array[:] = values
    comm = u.function_space.mesh.comm
    wrong, size = (parallel.largest(comm, np.abs(forces), 0.0) for forces in (whole - summed, summed))
    if np.isfinite(size) and not wrong <= NOTHING_LEFT * size:
        why = "is compiled wrongly: FFCx takes a quadrature rule of one point beside another one for something else, "
        cure = f"{wrong / size:.1e} from the sum over its rules; take no quadrature_degree below 2"
        raise FormError([("F", why + cure)])
