"""Loads and prescribed displacements as right-hand sides, grouped by their load factors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import count
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import default_scalar_type, fem
from mpi4py import MPI

from signorini_fx import parallel
from signorini_fx.body.assembly import assemble, facet_vertices, measure
from signorini_fx.body.turned_supports import TurnedNodes
from signorini_fx.effects.displacement import PrescribedDisplacement
from signorini_fx.errors import SceneError
from signorini_fx.mesh.tagged import TaggedMesh
from signorini_fx.records import Inventory
from signorini_fx.scene.effect import Effect, Force, Load, Resistance
from signorini_fx.scene.expressions import Expression, sample
from signorini_fx.scene.magnitudes import LARGEST
from signorini_fx.scene.model import Scene


@dataclass(frozen=True)
class AppliedLoad:
    """The loads and prescribed displacements that share one list of load factors, as the scene has them.

    Attributes:
        factors: one number per load step.
        name: of the form, empty without.
        form: the compiled terms of L; None if there are prescribed displacements only.
        forces: L at the owned dofs, shape (owned dofs,).
        prescribed: zero, with its prescribed displacements put in.
    """

    factors: tuple[float, ...]
    name: str
    form: fem.Form | None
    forces: npt.NDArray[np.float64]
    prescribed: fem.Function

    @property
    def start(self) -> npt.NDArray[np.float64]:
        """The prescribed displacements at the owned dofs, shape (owned dofs,)."""
        values: npt.NDArray[np.float64] = self.prescribed.x.array[: self.forces.size]
        return values


@dataclass(frozen=True)
class FormCoefficients:
    """Values of a scene as UFL, ``scene.effect.Coefficients``.

    Attributes:
        space: of the displacement; a callable is interpolated at its nodes.
    """

    space: fem.FunctionSpace

    @property
    def normal(self) -> Any:
        """Outward unit normal."""
        return ufl.FacetNormal(self.space.mesh)

    def value(self, value: Any) -> Any:
        """A value as a coefficient."""
        mesh = self.space.mesh
        if isinstance(value, float):
            return fem.Constant(mesh, default_scalar_type(value))
        if isinstance(value, Expression):
            return value.ufl(mesh)
        if hasattr(value, "ufl_domain"):
            return value
        function = fem.Function(fem.functionspace(mesh, ("Lagrange", self.space.element.basix_element.degree)))
        function.interpolate(lambda x: sample(value, x))
        return function

    def vector(self, values: tuple[Any, ...]) -> Any:
        """Values along the axes as a vector, shape (d,)."""
        return ufl.as_vector([self.value(value) for value in values[: self.space.mesh.geometry.dim]])


Facets = Callable[[str], npt.NDArray[np.int32]]


def measures(space: fem.FunctionSpace, effects: Sequence[Effect], facets: Facets) -> list[Any]:
    """Integration over what each effect acts on: the body, or the facets of its boundary."""
    surfaces = [effect.where for effect in effects if effect.where is not None]
    ds = measure(space.mesh, [facets(boundary) for boundary in surfaces], {})
    number = count(1)
    return [ufl.dx if effect.where is None else ds(next(number)) for effect in effects]


def load_groups(scene: Scene) -> dict[tuple[float, ...], list[Load]]:
    """The loads of the scene by their load factors; zero loads are left out."""
    groups: dict[tuple[float, ...], list[Load]] = {}
    for load in scene.loads:
        if load.acts:
            groups.setdefault(scene.factors_of(load), []).append(load)
    return groups


def applied_load(
    factors: tuple[float, ...],
    loads: list[Load],
    space: fem.FunctionSpace,
    z: Any,
    facets: Facets,
    supports: list[tuple[PrescribedDisplacement, fem.DirichletBC]],
    inventory: Inventory,
    turned: TurnedNodes | None = None,
) -> AppliedLoad:
    """Compile and assemble the loads that share their factors; collective."""
    name, form = compile_loads(loads, space, z, facets, inventory)
    prescribed = fem.Function(space)
    for effect, support in supports:  # the later one applies where two meet
        dofs, _ = support.dof_indices()
        prescribed.x.array[dofs] = 0.0
        if any(effect is one for one in loads):
            support.set(prescribed.x.array)
            prescribed.x.scatter_forward()
    if turned is not None:
        turned.place(prescribed.x.array.reshape(-1, space.mesh.geometry.dim), loads)
    owned = space.dofmap.index_map.size_local * space.dofmap.index_map_bs
    forces = np.zeros(owned) if form is None else assemble(form)
    return AppliedLoad(factors, name, form, forces, prescribed)


def compile_loads(
    loads: Sequence[Load], space: fem.FunctionSpace, z: Any, facets: Facets, inventory: Inventory
) -> tuple[str, fem.Form | None]:
    """The terms of L of section 2.1 that the loads list, (f, z) and (h, z), compiled together, and their name."""
    forces = sorted((load for load in loads if isinstance(load, Force)), key=lambda load: load.where is not None)
    on = FormCoefficients(space)
    return _compiled(forces, lambda load: ufl.inner(load.density(on), z), space, facets, inventory)


def compile_resistance(
    scene: Scene, space: fem.FunctionSpace, z: Any, facets: Facets, inventory: Inventory
) -> tuple[str, fem.Form | None]:
    """The terms of a(., .) that resist the displacement on the boundary, compiled together, and their name."""
    effects, y, on = scene.of(Resistance), ufl.TrialFunction(space), FormCoefficients(space)
    acting = [effect for effect in effects if effect.acts]
    return _compiled(acting, lambda effect: ufl.inner(effect.reaction(y, on), z), space, facets, inventory)


def _compiled(
    effects: Sequence[Any],
    integrand: Callable[[Any], Any],
    space: fem.FunctionSpace,
    facets: Facets,
    inventory: Inventory,
) -> tuple[str, fem.Form | None]:
    """The integrals of effects over what each of them acts on, and their name; "" and None without effects."""
    if not effects:
        return "", None
    element, where = space.element.basix_element.degree, measures(space, effects, facets)
    degrees = ({"quadrature_degree": effect.degree(element)} for effect in effects)
    terms = [integrand(effect) * d(metadata=degree) for effect, d, degree in zip(effects, where, degrees, strict=True)]
    name = " + ".join(effect.name for effect in effects)
    return name, inventory.compile(name, lambda: fem.form(sum(terms[1:], terms[0])))


def check_resistances(scene: Scene, tagged: TaggedMesh) -> None:
    """Whether what resists the displacement is finite and not negative at vertices and middles of facets; collective.

    Raises:
        SceneError: an expression is not.
    """
    problems = []
    for path, effect in scene.listed():
        if effect.where is None or not isinstance(effect, Resistance):
            continue
        corners = facet_vertices(tagged.mesh, tagged.facets(effect.where))
        points = np.concatenate([corners.reshape(-1, 3), corners.mean(axis=1)]).T
        for key, value in effect.given.items():
            values = sample(value, points)
            if parallel.any_rank(tagged.mesh.comm, not ((values >= 0) & (values <= LARGEST)).all()):
                wanted = f"a number from 0 to {LARGEST:g} everywhere on {effect.where!r}"
                problems.append((f"{path}.{key}", f"must be {wanted}"))
    if problems:
        raise SceneError(problems)


def check_finite(comm: MPI.Comm, loads: list[AppliedLoad]) -> None:
    """Whether all loads and prescribed displacements are finite, with finite squares; collective.

    Raises:
        SceneError: an expression is not.
    """
    problems = []
    where = f"an expression is not finite, or larger than {LARGEST:g}, somewhere on its boundary"
    if parallel.any_rank(comm, not all((np.abs(load.start) <= LARGEST).all() for load in loads)):
        problems.append(("displacement", where))
    elif parallel.any_rank(comm, not all((np.abs(load.forces) <= LARGEST**2).all() for load in loads)):
        problems.append(("traction, body_force", f"{where} or in the body"))  # stresses times lengths
    if problems:
        raise SceneError(problems)
