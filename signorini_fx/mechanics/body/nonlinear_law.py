"""The residual of a body of nonlinear materials, and the internal variables at its quadrature
points.

Springs of a boundary are part of it: their forces follow the displacement, along the normal of the
undeformed boundary.

    F(u; v) = sum over the materials of the derivative of their energies, or of the integral of
    sigma : epsilon(v).

The volumetric part (the mean stress, or for finite strains the energy of the volume) may be
integrated with fewer points.

A temperature by which the body expands freely by s in all directions splits the deformation
gradient into F = (1 + s) F_e.  The energy per undeformed volume is (1 + s)^3 W(F_e); for small
strains the elastic strain is epsilon - s I.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import basix
import basix.ufl
import numpy as np
import ufl
from dolfinx import fem

from signorini_fx.arrays import Array, Expr, Indices
from signorini_fx.mechanics.assembly.mesh_entities import measure as surface_measure
from signorini_fx.mechanics.assembly.mesh_entities import strain_degree
from signorini_fx.mechanics.elasticity.moduli import reduced_degree
from signorini_fx.mechanics.kinematics import Kinematics, components, position, tensors
from signorini_fx.mechanics.loads.follower_pressure import Followers, following, without_followers
from signorini_fx.mechanics.loads.initial_strains import given_strains
from signorini_fx.mechanics.loads.load_vectors import FormCoefficients
from signorini_fx.mechanics.materials.nonlinear import (
    Hyperelastic,
    NonlinearMaterial,
    PathDependent,
    growth,
)
from signorini_fx.mechanics.materials.protocol import PAIRS, Material
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.state import Field, at_cells
from signorini_fx.mechanics.statement.effect import Resistance
from signorini_fx.mechanics.statement.load_path import LoadPath
from signorini_fx.mechanics.statement.statement import Statement


def at_rest(statement: Statement) -> Statement:
    """Return the statement with the small-strain limits of its materials, and without follower
    loads.
    """
    return without_followers(statement).changed(
        material=tuple(material.at_rest for material in statement.material)
    )


def volume_degree(statement: Statement, tagged: TaggedMesh) -> int | None:
    """Return the quadrature degree of the volumetric part of materials that have one; None if it
    is not reduced.

    Raises:
        SceneError: the mesh does not allow reduced integration.
    """
    if not any(material.splits for material in statement.material):
        return None
    flows = any(material.flows for material in statement.material)
    return reduced_degree(at_rest(statement), tagged.mesh, nearly=flows)


def cells_of(material: Material, tagged: TaggedMesh) -> Indices:
    """Return the local numbers of the cells of a material that this rank owns, ascending."""
    cells = tagged.cells(material.region)
    return np.sort(
        cells[cells < tagged.mesh.topology.index_map(tagged.mesh.topology.dim).size_local]
    ).astype(np.int32)


@dataclass
class MaterialPoints:
    """The internal variables of one material at the q quadrature points of each of its c cells."""

    material: PathDependent
    cells: Indices
    # The current strain without its thermal part: components ``PAIRS``, shear as 2 epsilon_ij; for
    # finite strains all components of grad u.
    strain: fem.Expression
    stress: fem.Function  # the components of the stress that do work
    tangent: fem.Function  # the derivative of these by the same components of the strain
    pairs: list[int]  # positions of these components in ``of``
    of: list[tuple[int, int]]  # the index pairs of the components of ``strain``
    begun: Array  # internal variables at the end of the last load step, shape (c, q, numbers)
    current: Array = field(init=False)  # internal variables at the current displacement
    time: float = 1.0  # the end of the load step

    def __post_init__(self) -> None:
        self.current = self.begun

    def update(self) -> None:
        """Evaluate stress, tangent and internal variables at the current displacement, starting
        from the end of the last load step.
        """
        stress, tangent, state = self.response()
        self.current = state.reshape(self.begun.shape)
        i, j = np.transpose([self.of[pair] for pair in self.pairs])
        at = self.stress.function_space.dofmap.list[self.cells].ravel()
        count = len(self.pairs)
        self.stress.x.array.reshape(-1, count)[at] = stress[:, i, j]
        used = tangent[:, self.pairs][:, :, self.pairs]
        self.tangent.x.array.reshape(-1, count**2)[at] = used.reshape(-1, count**2)

    def components(self, measured: Expr) -> Expr:
        """Return the components of a strain, or of grad u, that do work, as a UFL vector."""
        return _components(self.material, measured, [self.of[pair] for pair in self.pairs])

    def response(self) -> tuple[Array, Array, Array]:
        """Return stress, tangent and internal variables at the current displacement, at n = c q
        points.

        See ``PathDependent.respond``, for finite strains ``respond_by_change``.
        """
        material = self.material.at_time(self.time)
        state = self.begun.reshape(-1, self.begun.shape[-1])
        values = self._strain()
        if material.finite:
            return material.respond_by_change(values.reshape(-1, 3, 3), state)
        return material.respond(tensors(values / [1, 1, 1, 2, 2, 2], PAIRS), state)

    def _strain(self) -> Array:
        """Return the current strain, for finite strains grad u, shape (n, components)."""
        values = self.strain.eval(self.stress.function_space.mesh, self.cells)
        return np.asarray(values).reshape(-1, len(self.of))

    def cauchy_stress(self) -> Array:
        """Return the Cauchy stress at the current displacement without its volumetric part, shape
        (c, q, 3, 3).
        """
        stress = self.response()[0]
        if self.material.finite:
            gradient = np.eye(3) + self._strain().reshape(-1, 3, 3)
            volume = np.linalg.det(gradient)[:, None, None]
            stress = stress @ gradient.swapaxes(1, 2) / volume
        return stress.reshape(*self.begun.shape[:2], 3, 3)

    def commit(self) -> None:
        """Accept the current internal variables as those at the end of the load step."""
        self.begun = self.current


@dataclass(frozen=True)
class BodyResidual:
    """The virtual work of the internal forces of a body, and of loads that follow it."""

    form: ufl.Form  # F(u; .), UFL
    tangent: ufl.Form | None  # its derivative where UFL cannot derive it; None: UFL can
    points: tuple[MaterialPoints, ...]  # of the materials with internal variables
    followers: Followers  # the loads that follow the body
    free: Expr | None  # the free thermal expansion s, UFL; None: there is none
    heat: Callable[[float], None]  # sets the free expansion to a place in the lists of factors
    path: LoadPath  # gives the time of each place

    def move_to(self, step: float) -> None:
        """Set follower loads, temperature and time to a place in the lists of factors."""
        self.followers.move_to(step)
        self.heat(step)
        for state in self.points:
            state.time = self.path.time_at(step)

    def update(self) -> None:
        """Evaluate the materials; call it before anything is assembled at a new displacement."""
        for state in self.points:
            state.update()

    def commit(self) -> None:
        """Accept the internal variables of all materials as those at the end of the load step."""
        for state in self.points:
            state.commit()

    def remembered(self) -> dict[str, Array]:
        """Return the internal variables at the end of the last load step by name, shape (cells, q,
        numbers), zero in cells of other materials.
        """
        if not self.points:
            return {}
        topology = self.points[0].stress.function_space.mesh.topology
        owned = topology.index_map(topology.dim).size_local
        values = {}
        for number, state in enumerate(self.points):
            values[f"material {number}"] = rows = np.zeros((owned, *state.begun.shape[1:]))
            rows[state.cells] = state.begun
        return values

    def recall(self, fields: Mapping[str, Field]) -> None:
        """Start a load step from internal variables that a state holds, see ``remembered``.

        Raises:
            SceneError: it is the state of another material.
        """
        rows = at_cells(fields, self.remembered())
        for state, values in zip(self.points, rows.values(), strict=True):
            state.begun = state.current = values[state.cells]


def body_residual(statement: Statement, tagged: TaggedMesh, u: fem.Function) -> BodyResidual:
    """Return the residual of the materials of a statement at the displacement ``u``; collective.

    Raises:
        SceneError: see ``volume_degree``.
    """
    space = u.function_space
    kinematics = statement.kinematics_in(tagged.dimension)
    full = max(1, strain_degree(space, kinematics))
    reduced = volume_degree(statement, tagged)
    cells = [cells_of(material, tagged) for material in statement.material]
    # Each quadrature rule has its own subdomain number: FFCx 0.9 compiles a one-point rule next to
    # another rule on the same subdomain wrongly.
    owned_cells = np.arange(
        tagged.mesh.topology.index_map(tagged.mesh.topology.dim).size_local, dtype=np.int32
    )
    parts = [*enumerate(cells), *enumerate(cells, len(cells)), (2 * len(cells), owned_cells)]
    measure = ufl.Measure("dx", domain=space.mesh, subdomain_data=parts)
    around = kinematics.measure(position(u))
    free, _, heat = given_strains(statement, tagged, space)
    v = ufl.TestFunction(space)
    du = ufl.TrialFunction(space)
    energies = []
    forms = []
    of_states = []
    points = []
    for number, (material, owned) in enumerate(zip(statement.material, cells, strict=True)):
        shape = volume = measure(
            number, metadata={"quadrature_degree": full, "quadrature_rule": "default"}
        )
        if reduced is not None:
            volume = measure(number + len(cells), metadata={"quadrature_degree": reduced})
        if isinstance(material, PathDependent):
            state = _points(material, owned, kinematics, u, free, full)
            points.append(state)
            by_components, tried = (
                state.components(_measured(material, kinematics, one)) for one in (v, du)
            )
            # Finite strains: convert to stress per undeformed area before the free expansion.
            expanded = 1 + free if material.finite and free is not None else 1
            work = ufl.inner(state.stress, by_components) * expanded**2
            forms.append(work * around * shape)
            work = ufl.inner(ufl.dot(state.tangent, tried), by_components) * expanded
            of_states.append(work * around * shape)
        gradient = gradients(u, kinematics, reduced)
        if material.finite:
            energies += [
                energy * around * d
                for energy, d in zip(
                    _energies(material, gradient, free), (shape, volume), strict=True
                )
                if energy is not None
            ]
            continue
        tested = gradients(v, kinematics, reduced)
        parts_of_stress = stress_parts(material, gradient, free)
        for part, test, d in zip(parts_of_stress, tested, (shape, volume), strict=True):
            if part is not None:
                forms.append(ufl.inner(part, test) * around * d)
    if energies:
        forms.append(ufl.derivative(sum(energies[1:], energies[0]), u, v))
    springs = [effect for effect in statement.of(Resistance) if effect.acts]
    on = FormCoefficients(statement, tagged, space)
    ds = surface_measure(
        space.mesh,
        [tagged.facets(str(effect.where)) for effect in (*following(statement), *springs)],
        {},
    )
    followers = Followers.of(statement, tagged, u, ds, measure(2 * len(cells)))
    forms += followers.works
    for number, effect in enumerate(springs, len(following(statement)) + 1):
        part = ds(number, metadata={"quadrature_degree": effect.degree(statement.element.degree)})
        forms.append(ufl.inner(effect.reaction(u, on), v) * around * part)
    form = sum(forms[1:], forms[0])
    tangent = sum(of_states, ufl.derivative(form, u, du)) if points else None  # UFL cannot
    return BodyResidual(form, tangent, tuple(points), followers, free, heat, statement.path)


def gradients(u: Expr, kinematics: Kinematics, reduced: int | None) -> tuple[Expr, Expr]:
    """Return grad u for the shape part and for the volumetric part of the energy, each at the
    points of its quadrature rule, UFL, shape (3, 3).

    Args:
        u: the displacement.
        kinematics: of the body.
        reduced: degree of the volumetric rule, see ``volume_degree``.
    """
    gradient = kinematics.gradient(u)
    return gradient, kinematics.mean_gradient(u) if reduced == 1 else gradient


def stress_parts(
    material: Hyperelastic | PathDependent, gradients_of_u: tuple[Expr, Expr], free: Expr | None
) -> list[Expr | None]:
    """Return the Cauchy stress of the shape part and of the volumetric part, for small strains the
    stress, UFL, shape (3, 3).

    A part is None if it is zero or comes from internal variables.

    Args:
        material: the material.
        gradients_of_u: see ``gradients``.
        free: the free thermal expansion, see ``BodyResidual``.
    """
    unit = ufl.Identity(3)
    if not material.finite:
        first, shear = material.at_rest.lame
        strain, mean = (_elastic(ufl.sym(one), free) for one in gradients_of_u)
        of_shape = None if isinstance(material, PathDependent) else 2 * shear * ufl.dev(strain)
        return [of_shape, (first + 2 * shear / 3) * ufl.tr(mean) * unit]
    changes = [ufl.variable(one) for one in gradients_of_u]
    return [
        None
        if energy is None
        else ufl.diff(energy, change) * (unit + change).T / ufl.det(unit + change)
        for energy, change in zip(_energies(material, changes, free), changes, strict=True)
    ]


def _elastic(strain: Expr, free: Expr | None) -> Expr:
    """Return a small strain minus the free thermal strain, UFL."""
    return strain if free is None else strain - free * ufl.Identity(3)


def _measured(material: NonlinearMaterial, kinematics: Kinematics, u: Expr) -> Expr:
    """Return grad u if the material has finite strains, else the strain, UFL."""
    return kinematics.gradient(u) if material.finite else kinematics.strain(u)


def _components(material: NonlinearMaterial, measured: Expr, pairs: list[tuple[int, int]]) -> Expr:
    """Return components of the strain measure of ``_measured`` as a UFL vector."""
    if material.finite:
        return ufl.as_vector([measured[pair] for pair in pairs])
    return components(measured, pairs)


def _energies(
    material: Hyperelastic | PathDependent, changes: Sequence[Expr], free: Expr | None
) -> list[Expr | None]:
    """Return the shape part and the volumetric part of the energy per undeformed volume, UFL.

    The shape part is None if the material has internal variables, the volumetric part if the
    material does not split its energy.

    Args:
        material: the material.
        changes: grad u for each of the two parts.
        free: the free thermal expansion, see ``BodyResidual``.
    """
    expanded = 1
    if free is not None:
        changes = [(change - free * ufl.Identity(3)) / (1 + free) for change in changes]
        expanded = (1 + free) ** 3
    of_shape = of_volume = None
    if not isinstance(material, PathDependent):
        of_shape = material.shape_energy_by_change(changes[0]) * expanded
    if material.splits:
        of_volume = material.volume_energy_by_change(growth(changes[1])) * expanded
    return [of_shape, of_volume]


def _points(
    material: PathDependent,
    cells: Indices,
    kinematics: Kinematics,
    u: fem.Function,
    free: Expr | None,
    degree: int,
) -> MaterialPoints:
    """Return the quadrature points of one material with zero internal variables; collective.

    Args:
        material: the material.
        cells: its cells on this rank.
        kinematics: of the body.
        u: the displacement.
        free: the free thermal expansion, see ``BodyResidual``.
        degree: of the quadrature rule.
    """
    mesh = u.function_space.mesh
    name = mesh.topology.cell_name()
    worked = set(kinematics.pairs)
    of = [(i, j) for i in range(3) for j in range(3)] if material.finite else list(PAIRS)
    pairs = [place for place, (i, j) in enumerate(of) if worked & {(i, j), (j, i)}]
    strain = _elastic(_measured(material, kinematics, u), free)
    if material.finite and free is not None:
        strain = strain / (1 + free)
    count = len(pairs)
    rule, _ = basix.make_quadrature(getattr(basix.CellType, name), degree)
    stress, tangent = (
        fem.Function(
            fem.functionspace(mesh, basix.ufl.quadrature_element(name, shape, degree=degree))
        )
        for shape in ((count,), (count, count))
    )
    at_points = fem.Expression(_components(material, strain, of), rule)
    begun = np.zeros((cells.size, len(rule), material.state_size))
    return MaterialPoints(material, cells, at_points, stress, tangent, pairs, of, begun)
