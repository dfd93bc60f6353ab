"""The stress of a solution: its tensor, the von Mises stress, principal stresses, and where they
are largest.

For nonlinear bodies nothing is recovered; their extremes are those at the quadrature points, where
the material has its state.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np
from dolfinx import default_scalar_type, fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from scipy.spatial import cKDTree

from signorini_fx.arrays import Array, Plain
from signorini_fx.machine import compat, parallel
from signorini_fx.machine.compilation import compiling
from signorini_fx.machine.display import point_in_words
from signorini_fx.mechanics.assembly.mesh_entities import node_positions
from signorini_fx.mechanics.elasticity.elastic_law import ElementStress
from signorini_fx.mechanics.elasticity.moduli import of_materials
from signorini_fx.mechanics.kinematics import tensors
from signorini_fx.mechanics.model import Model
from signorini_fx.results.singularities import OuterFacets, singular_corners, why_no_limit
from signorini_fx.tuned import (
    DIGITS_OF_FILES,
    FEWEST_KRYLOV_UNKNOWNS,
    NOTABLE,
    SAME_LENGTH,
)

if TYPE_CHECKING:
    from ufl.core.expr import Expr

    from signorini_fx.mechanics.materials.protocol import Material

# Components of the tensor by name.
COMPONENTS = {a + b: (i, j) for i, a in enumerate("xyz") for j, b in enumerate("xyz") if j >= i}


def _limit(material: Material) -> float:
    """Return the von Mises stress at which a material yields, infinite if it is not known."""
    return math.inf if (stress := getattr(material, "yield_stress", None)) is None else stress


@dataclass(frozen=True)
class Extreme:
    """The smallest or largest value of a field, and its place.

    Attributes:
        value: a stress.
        place: a point, length, shape (d,).
        cell: global number of the cell that the stress belongs to: at an interface there is one on
            each side.
    """

    value: float
    place: tuple[float, ...]
    cell: int


@dataclass(frozen=True, repr=False)
class StressFields:
    """A stress tensor and fields that follow from it.  Every field is computed at its first use,
    which is collective.

    Attributes:
        stress: the stress of the displacement, in each cell.
    """

    stress: ElementStress

    @property
    def comm(self) -> MPI.Comm:
        """The ranks that share the body."""
        comm = self.stress.displacement.function_space.mesh.comm
        return comm

    @cached_property
    def tensor(self) -> fem.Function:
        """Sigma with all components in 3D, also in 2D, where (2, 2) follows from the
        hypothesis, such as plane strain; a stress, shape (3, 3).

        The raw one is discontinuous and of the degree of the element, of a nonlinear body of one
        degree less; the recovered one has degree 1 and is discontinuous between materials.
        """
        if isinstance(self.stress.in_space, fem.Function):
            return self.stress.in_space
        space = self.stress.displacement.function_space
        tensor_space = fem.functionspace(
            space.mesh, ("DG", space.element.basix_element.degree, (3, 3))
        )
        return interpolated(self.stress.in_space, tensor_space, "stress")

    @cached_property
    def von_mises(self) -> fem.Function:
        """The von Mises stress, sqrt(3/2) |dev sigma|."""
        return self._function("von_mises", self._nodal_von_mises)

    @cached_property
    def _nodal_von_mises(self) -> Array:
        """The von Mises stress at the points of the function space of the tensor, shape (n,)."""
        return von_mises_of(self._nodal())

    @cached_property
    def shear_energy_density(self) -> fem.Function:
        """|dev sigma|^2 / (4 mu), an energy per volume: the square of the von Mises stress over 6
        mu.

        Raises:
            ValueError: the body is not isotropic.
        """
        space = self.tensor.function_space
        mu = self.stress.shear_modulus
        if mu is None:
            raise ValueError("the body has no shear modulus: its material is not isotropic")
        shear_modulus = np.full(node_positions(space).shape[0], np.nan)
        shear_modulus[space.dofmap.list] = (
            mu.x.array[:, None] if isinstance(mu, fem.Function) else float(mu.value)
        )
        return self._function(
            "shear_energy_density", self._nodal_von_mises**2 / (6 * shear_modulus)
        )

    @cached_property
    def principal(self) -> fem.Function:
        """The principal stresses, the largest (most tensile) first, shape (3,); in 2D one of them
        acts out of the plane.
        """
        return self._function("principal_stresses", principal_of(self._nodal()))

    def component(self, name: str) -> fem.Function:
        """Return a component of the tensor: ``xx``, ``yy``, ``zz``, ``xy``, ``xz`` or ``yz``; in 2D
        ``zz`` is the component out of the plane.

        Raises:
            ValueError: there is no such component.
        """
        if name not in COMPONENTS:
            raise ValueError(
                f"{name!r} is no component of the stress: take one of {', '.join(COMPONENTS)}"
            )
        i, j = COMPONENTS[name]
        return self._function(f"stress_{name}", self._nodal()[:, i, j])

    def largest(self, field: str = "von_mises", component: int = 0) -> Extreme:
        """Return the largest value of a field at the nodes and its place; collective.

        Args:
            field: ``von_mises``, ``principal``, or a component of the tensor such as ``zz``.
            component: the number of the principal stress, from 0; ignored for other fields.

        Raises:
            ValueError: there is no such field.
        """
        return self._extreme(field, component, sign=1.0)

    def smallest(self, field: str = "principal", component: int = 2) -> Extreme:
        """Return the smallest value of a field and its place, see ``largest``: by default the
        largest compression.
        """
        return self._extreme(field, component, sign=-1.0)

    def _extremes(self) -> dict[str, Extreme]:
        extremes = {
            "von_mises": self.largest(),
            "largest_principal": self.largest("principal", 0),
            "smallest_principal": self.smallest(),
        }
        if (
            self.tensor.function_space.mesh.topology.dim == 2
            and (2, 2) in self.stress.kinematics.stressed
        ):
            extremes |= {"largest_zz": self.largest("zz"), "smallest_zz": self.smallest("zz")}
        return extremes

    def _extreme(self, field: str, component: int, *, sign: float) -> Extreme:
        if field not in ("von_mises", "principal", *COMPONENTS):
            known = f"'von_mises', 'principal' or one of {', '.join(COMPONENTS)}"
            raise ValueError(f"{field!r} is no field with extremes: take {known}")
        if field == "principal":
            return self._extreme_of(self._sampled_principal[:, component], sign)
        if field in COMPONENTS:
            return self._extreme_of(self._samples[0][:, *COMPONENTS[field]], sign)
        return self._extreme_of(self._sampled_von_mises, sign)

    @cached_property
    def _sampled_von_mises(self) -> Array:
        """The von Mises stress at the points where extremes are sought, shape (n,)."""
        return self._nodal_von_mises[: len(self._samples[0])]

    @cached_property
    def _sampled_principal(self) -> Array:
        """The principal stresses at the points where extremes are sought, shape (n, 3)."""
        return principal_of(self._samples[0])

    @cached_property
    def _samples(self) -> tuple[Array, Array, Callable[[int], int]]:
        """The tensor at the points where extremes are sought, shape (n, 3, 3), these points,
        and a function from the number of a point to the local number of its cell.
        """
        space = self.tensor.function_space
        x = node_positions(space)[:, : space.mesh.topology.dim]
        cells = space.dofmap.list
        owned = space.dofmap.index_map.size_local
        return self._nodal()[:owned], x, lambda at: np.flatnonzero((cells == at).any(axis=1))[0]

    @cached_property
    def _extent(self) -> float:
        """The largest coordinate of these points, length; collective."""
        return parallel.largest(self.comm, np.abs(self._samples[1])) or 1.0

    def _extreme_of(self, values: Array, sign: float = 1.0) -> Extreme:
        """Return the largest finite value at these points and its place, or with ``sign`` -1 the
        smallest; collective.
        """
        topology = self.tensor.function_space.mesh.topology
        _, x, cell_of = self._samples
        values = np.where(np.isfinite(values), sign * values, -np.inf)
        best = parallel.largest(self.comm, values, -np.inf)
        # Where several values agree to six digits, the place with the smallest coordinates is
        # taken: it is the same on any number of ranks.
        largest = np.flatnonzero(values >= best - DIGITS_OF_FILES * abs(best))
        places = np.round(x[largest] / (SAME_LENGTH * self._extent))
        found: list[tuple[tuple[float, ...], tuple[float, ...], int]] = []
        if largest.size:
            first = int(np.lexsort(places.T[::-1])[0])
            at = int(largest[first])
            cell = topology.index_map(topology.dim).local_to_global(
                np.array([cell_of(at)], dtype=np.int32)
            )
            found = [(tuple(map(float, places[first])), tuple(map(float, x[at])), int(cell[0]))]
        every = [candidate for of_rank in self.comm.allgather(found) for candidate in of_rank]
        _, place, number = min(every, default=((), (), -1))
        return Extreme(sign * best, place, number)

    def utilised(self, limit: fem.Function) -> Extreme:
        """Return the largest ratio of the von Mises stress to a limit, and its place; collective.

        Args:
            limit: a stress of each cell, a function of degree 0, infinite where there is none.
        """
        cells = self.tensor.function_space.dofmap
        share = self._nodal_von_mises.copy()
        share[cells.list] /= limit.x.array[limit.function_space.dofmap.list]
        return self._extreme_of(share[: cells.index_map.size_local])

    def _nodal(self) -> Array:
        """Return the tensor at the points of its function space on this rank, shape (n, 3, 3)."""
        return self.tensor.x.array.reshape(-1, 3, 3)

    def _function(self, name: str, values: Array) -> fem.Function:
        """Return a field with values at the points of the tensor, whose numbering all spaces of
        this degree share.
        """
        space = self.tensor.function_space
        degree = space.element.basix_element.degree
        shape = values.shape[1:]
        element = ("DG", degree, shape) if shape else ("DG", degree)
        function = fem.Function(fem.functionspace(space.mesh, element), name=name)
        assert np.array_equal(function.function_space.dofmap.list, space.dofmap.list)
        function.x.array[:] = values.ravel()
        return function


@dataclass(frozen=True)
class PointStress:
    """The Cauchy stress of nonlinear materials at the quadrature points of the c cells that this
    rank owns, q in each; at small strains the stress.
    """

    points: Array  # in the reference cell, shape (q, t)
    weights: Array  # shape (q,)
    x: Array  # undeformed positions, length, shape (c, q, t)
    stress: Array  # tension positive, shape (c, q, 3, 3)
    plastic: Array | None = (
        None  # the accumulated plastic strain, shape (c, q); None: there is none
    )

    def on_cells(self, values: Array, mesh: dmesh.Mesh, degree: int, name: str) -> fem.Function:
        """Return the polynomials in cells that fit values at the quadrature points best;
        collective.

        Args:
            values: values at the points, shape (c, q, ...).  Polynomials of scalars stay between
                the smallest and largest value of their cell.
            mesh: the mesh.
            degree: the degree of the polynomials.
            name: the name of the function.
        """
        function = fem.Function(
            fem.functionspace(mesh, ("DG", degree, values.shape[2:])), name=name
        )
        space = function.function_space
        rows = values.reshape(*self.x.shape[:2], math.prod(values.shape[2:]))
        root = np.sqrt(self.weights)[:, None]
        basis = root * space.element.basix_element.tabulate(0, self.points)[0, :, :, 0]
        fitted = np.einsum("nq,cqm->cnm", np.linalg.pinv(basis) * root.T, rows)
        if values.ndim == 2:
            fitted = np.clip(
                fitted, rows.min(axis=1, keepdims=True), rows.max(axis=1, keepdims=True)
            )
        function.x.array.reshape(-1, rows.shape[2])[space.dofmap.list[: len(rows)]] = fitted
        function.x.scatter_forward()
        return function


@dataclass(frozen=True, repr=False)
class RawStresses(StressFields):
    """The stress of a displacement in each cell.

    It is discontinuous from cell to cell and a power of h less accurate than the displacement;
    values at corners of the body, at ends of supports and at a contact edge may have no limit as
    the mesh is refined.

    Attributes:
        mechanics: the mechanics of the body, ``results.mechanics.Mechanics``.
        place: position of the load step in the lists of factors, see ``statement.load_path``.
        at_points: the stress of a nonlinear body at the quadrature points, where its extremes are
            sought; None where they are sought at nodes.
        strain_energy: strain energy of the load step.
    """

    mechanics: Any
    place: float = 0.0
    at_points: PointStress | None = None
    strain_energy: float | None = None

    @property
    def recovers(self) -> bool:
        """Whether a ``recovered`` stress and an estimated error exist."""
        return self.at_points is None

    @cached_property
    def energy(self) -> float:
        """The strain energy of the stress; collective."""
        if (
            self.strain_energy is None or not self.mechanics.model.materials
        ):  # the energy of forms may include springs
            return float(self.mechanics.recovery.energy(self.stress.displacement))
        return self.strain_energy

    @cached_property
    def plastic_strain(self) -> fem.Function | None:
        """The accumulated (equivalent) plastic strain, or None without one.

        It is a function of degree k - 1 in each cell, within the range of the values at its
        quadrature points.
        """
        if self.at_points is None or self.at_points.plastic is None:
            return None
        space = self.tensor.function_space
        degree = space.element.basix_element.degree
        return self.at_points.on_cells(self.at_points.plastic, space.mesh, degree, "plastic_strain")

    def plastic_extreme(self) -> dict[str, Plain] | None:
        """Return the largest plastic strain at the quadrature points, its place, and the region of
        its material if there are several, JSON-safe; None without plastic strain; collective.
        """
        if self.at_points is None or self.at_points.plastic is None:
            return None
        return self._told(self._extreme_of(self.at_points.plastic.ravel()))

    @cached_property
    def recovered(self) -> StressFields:
        """The stress projected onto the functions of degree 1 that are continuous in each material,
        with the same fields.

        Inside the body it is smoother than the raw stress and often more accurate; at the boundary,
        where cells are on one side only, it need not be; peaks that are narrower than a cell are
        smoothed away.

        Raises:
            RuntimeError: the body is nonlinear.
        """
        mesh = self.stress.displacement.function_space.mesh
        tensor = fem.Function(fem.functionspace(mesh, ("DG", 1, (3, 3))), name="recovered_stress")
        values = tensor.x.array.reshape(-1, 3, 3)
        nodes = tensor.function_space.dofmap.list
        smoothed = self.mechanics.recovery.smoothed(self.stress.displacement, self.place)
        for cells, components in smoothed:
            values[nodes[cells]] = tensors(components, self.stress.kinematics.stressed)
        return StressFields(replace(self.stress, in_space=tensor))

    @cached_property
    def _sampled_von_mises(self) -> Array:
        if self.at_points is None:
            return super()._sampled_von_mises
        return von_mises_of(self._samples[0])

    @cached_property
    def _samples(self) -> tuple[Array, Array, Callable[[int], int]]:
        if self.at_points is None:
            return super()._samples
        x = self.at_points.x
        tensors_there = self.at_points.stress.reshape(-1, 3, 3)
        return tensors_there, x.reshape(-1, x.shape[2]), lambda at: at // x.shape[1]

    @cached_property
    def error(self) -> float | None:
        """Estimated relative error of the raw stress in the energy norm, which is that of the
        displacement; None without stress, and for a nonlinear body.

        It is the estimate of Zienkiewicz and Zhu, from the difference of raw and recovered stress,
        with the residual of the tractions on the boundary: a mean over the body that says nothing
        about a single point.
        """
        if not self.recovers or not self.energy > 0:
            return None
        return float(
            np.sqrt(parallel.global_sum(self.comm, self.squares.sum()) / (2 * self.energy))
        )

    @cached_property
    def squares(self) -> Array:
        """The squared error of each owned cell, an energy, shape (cells,); collective."""
        return np.asarray(self.mechanics.recovery.squares(self.stress.displacement, self.place))

    @compat.shared_cells()
    def as_dict(self) -> dict[str, Plain]:
        """Return the extremes of raw and recovered stress, with the estimated error, JSON-safe;
        collective.

        For a scene each extreme has the reason ``no_limit`` if its stress is known to have no
        limit, and the name of its body, or of the region of its material, if there are several.  In
        plane strain the stress out of the plane is among them.
        """
        finite = not parallel.any_rank(
            self.comm, not np.isfinite(self.stress.displacement.x.array).all()
        )
        raw = self._extremes()
        recovered = self.recovered._extremes() if finite and self.recovers else {}
        rows, recovered_rows = (
            {name: self._told(entry, finite=finite) for name, entry in extremes.items()}
            for extremes in (raw, recovered)
        )
        # For forms it is not known where the stress has no limit.
        if recovered_rows and self.mechanics.model.materials:
            error = self._error_of_largest(raw["von_mises"], recovered["von_mises"])
            largest = rows["von_mises"], recovered_rows["von_mises"]
            for row in largest:
                row["error"] = error
            if all(row.get("no_limit", "") is None for row in largest):
                rows["von_mises"]["no_limit"] = self._no_limit_elsewhere(raw["von_mises"].value)
                recovered_rows["von_mises"]["no_limit"] = rows["von_mises"]["no_limit"]
        return {
            **rows,
            "recovered": recovered_rows or None,
            "error": self.error if finite else None,
        }

    def _no_limit_elsewhere(self, largest: float) -> str | None:
        """Return why, and at which corner of a body, a finer mesh has a larger stress than this
        one, or None; collective.

        The stress there has no limit, and is a notable share of the largest one already.  Large
        bodies in 3D are not searched.
        """
        model: Model = self.mechanics.model
        dim = model.tagged.dimension
        if not largest > 0 or (dim == 3 and model.dofs > FEWEST_KRYLOV_UNKNOWNS):
            return None
        if not (corners := singular_corners(model, self._outer)):
            return None
        shares = self._nodal_von_mises / largest
        notable = np.flatnonzero(shares > 2 * NOTABLE)
        places = cKDTree(node_positions(self.tensor.function_space)[notable, :dim])
        found = list[tuple[float, str]]()
        for corner, reason in corners:
            there = places.query_ball_point(corner, SAME_LENGTH * model.tagged.size)
            share = parallel.largest(self.comm, shares[notable[there]])
            found.append((share, f"{reason}, {point_in_words(corner)}"))
        share, why = max(found)
        return why if share > 2 * NOTABLE else None

    def _error_of_largest(self, raw: Extreme, recovered: Extreme) -> float:
        """Return the error of the larger one of the two largest von Mises stresses, raw and
        recovered; collective.

        It is the largest of their difference, and in the cells at the place of the raw one of its
        jumps, its difference from the recovered stress there, and its difference from the mean of
        that stress.
        """
        model: Model = self.mechanics.model
        off = [abs(recovered.value - raw.value)]
        mean: Array = np.zeros(2)
        # Another body or material may have another stress there.
        parts = model.pieces.of_cell.copy()
        for number, cells in enumerate(self.stress.parts):
            parts[cells] += number * (1 + parts.max(initial=0))
        part = -1
        for fields in (self, self.recovered):
            space = fields.tensor.function_space
            x = node_positions(space)[:, : space.mesh.topology.dim]
            near = np.linalg.norm(x - raw.place, axis=1) <= SAME_LENGTH * model.tagged.size
            nodes = space.dofmap.list
            cell, at = np.nonzero(near[nodes])
            values = fields._nodal_von_mises
            there = values[nodes[cell, at]]
            if part < 0:
                largest = there >= raw.value * (1 - DIGITS_OF_FILES)
                part = int(parallel.largest(self.comm, parts[cell[largest]], -1.0))
            same = parts[cell] == part
            off.append(raw.value + parallel.largest(self.comm, -there[same], -np.inf))
            around = values[nodes[np.unique(cell[same])]]
            mean = parallel.global_sum(self.comm, np.array([around.sum(), around.size]))
        return float(max(*off, abs(raw.value - mean[0] / max(mean[1], 1.0))))

    def utilisation(self) -> dict[str, Plain] | None:
        """Return the largest ratio of von Mises stress to yield stress, in raw or recovered stress,
        and its place, JSON-safe; collective.

        None if no yield stress is known, and for nonlinear materials.
        """
        model = self.mechanics.model
        if not self.recovers or all(math.isinf(_limit(one)) for one in model.materials):
            return None
        if parallel.any_rank(self.comm, not np.isfinite(self.stress.displacement.x.array).all()):
            return {"value": math.nan, "place": []}
        (limits,) = of_materials(
            model.statement, model.tagged, lambda material, _: (_limit(material),)
        )
        limit = fem.Function(fem.functionspace(model.tagged.mesh, ("DG", 0)))
        limit.x.array[:] = limits.value if isinstance(limits, fem.Constant) else limits.x.array
        largest = max(
            (fields.utilised(limit) for fields in (self, self.recovered)),
            key=lambda entry: entry.value,
        )
        return self._told(largest)

    @cached_property
    def _outer(self) -> OuterFacets:
        """The exterior facets of this body on this rank."""
        return OuterFacets.of(self.mechanics.model.tagged.mesh)

    @cached_property
    def _why_no_limit(self) -> Callable[[tuple[float, ...]], str | None]:
        """A cached ``why_no_limit`` of this body, because several extremes may have the
        same place.
        """
        model = self.mechanics.model
        return cache(partial(why_no_limit, model, outer=self._outer))

    def _told(self, extreme: Extreme, *, finite: bool = True) -> dict[str, Any]:
        """Return an extreme as a dictionary, JSON-safe; collective.

        With several regions it has the one of the extreme, and for a linear body why its stress has
        no limit.
        """
        told = {"value": extreme.value, "place": [*extreme.place]}
        model = self.mechanics.model
        regions = [*self.mechanics.statement.bodies] or [entry.region for entry in model.materials]
        if len(regions) > 1:
            told["region"] = part_of(model, extreme.cell, regions)
        if finite and self.recovers and model.materials:
            told["no_limit"] = self._why_no_limit(extreme.place)
        return told


def von_mises_of(sigma: Array) -> Array:
    """Return the von Mises stress of tensors, from shape (n, 3, 3) to (n,)."""
    xx, xy, xz, _, yy, yz, _, _, zz = np.ascontiguousarray(sigma.reshape(-1, 9).T)
    shear = xy * xy + xz * xz + yz * yz
    return np.sqrt(((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 2 + 3 * shear)


def principal_of(sigma: Array) -> Array:
    """Return the principal stresses of tensors, the largest first, from shape (n, 3, 3) to (n, 3);
    nan where a tensor is not finite: a solve that failed may leave anything behind.
    """
    if not sigma[:, :2, 2].any():  # one of them acts out of the plane
        middle = (sigma[:, 0, 0] + sigma[:, 1, 1]) / 2
        radius = np.hypot((sigma[:, 0, 0] - sigma[:, 1, 1]) / 2, sigma[:, 0, 1])
        return -np.sort(-np.stack((middle + radius, middle - radius, sigma[:, 2, 2]), axis=1))
    finite = np.isfinite(sigma).all(axis=(1, 2))
    values = np.full((len(sigma), 3), np.nan)
    values[finite] = np.linalg.eigvalsh(sigma[finite])[:, ::-1]
    return values


def part_of(model: Model, cell: int, parts: Sequence[str | None]) -> str | None:
    """Return which of some regions contains a cell, given by its global number; None if none does;
    collective.
    """
    cells = model.tagged.mesh.topology.index_map(model.tagged.dimension)
    local_cell = cell - cells.local_range[0]
    matches = [
        part
        for part, name in enumerate(parts)
        if name is not None and local_cell in model.tagged.cells(name)
    ]
    local_part = matches[0] if matches and 0 <= local_cell < cells.size_local else -1
    at = int(parallel.global_max(model.comm, local_part))
    return None if at < 0 else parts[at]


def interpolated(expression: Expr, space: fem.FunctionSpace, name: str = "f") -> fem.Function:
    """Return a UFL expression interpolated into a function space of the same value shape;
    collective.
    """
    function = fem.Function(space, name=name)
    with compiling():
        compiled = fem.Expression(
            expression, compat.interpolation_points(space.element), dtype=default_scalar_type
        )
    function.interpolate(compiled)
    return function
