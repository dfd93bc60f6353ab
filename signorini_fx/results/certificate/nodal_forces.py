"""Nodal forces of a scene by compiled linear forms, evaluated at a displacement.

The certificate is based on this module.  It reads no matrix, right-hand side, condensed system or load vector of the
solver: the form of the body is assembled at the displacement, and loads at their place in the lists of factors, with
coefficients of their own.  Both sides share what states the problem: the mesh, the forms, the materials and the loads.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from copy import copy
from functools import cached_property, partial
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem

from signorini_fx.machine import parallel
from signorini_fx.machine.compilation import compiling
from signorini_fx.mechanics.assembly.mesh_entities import assemble
from signorini_fx.mechanics.elasticity.elastic_law import fields_of
from signorini_fx.mechanics.loads.initial_strains import Jump, initial_strain, jumps_in, total_jump
from signorini_fx.mechanics.loads.load_vectors import FormCoefficients, compile_loads, compile_resistance, group_of
from signorini_fx.mechanics.loads.supports import forces_at_nodes
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.effect import Force, InitialStrain, Resistance
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.results.certificate.body_nodes import BodyNodes

Array = npt.NDArray[np.float64]


class CompiledForms:
    """The linear forms of a statement, compiled when they are first asked for, with coefficients of their own."""

    def __init__(self, statement: Statement, tagged: TaggedMesh, space: fem.FunctionSpace) -> None:
        self.on = FormCoefficients(statement, tagged, space)
        self.z = ufl.TestFunction(space)
        self._kept: dict[Hashable, Sequence[fem.Form]] = {}

    @cached_property
    def y(self) -> fem.Function:
        """The displacement at which they are evaluated."""
        elastic = self.on.elastic
        return elastic.displacement(self.on.space, np.zeros(elastic.count))

    def take(self, displacement: fem.Function) -> None:
        """Evaluate all of them at a displacement.

        Raises:
            ValueError: it is without a pressure that belongs to it.
        """
        if self.on.elastic.pressed:
            from signorini_fx.mechanics.elasticity.mixed_pressure import hydrostatic_of

            hydrostatic_of(displacement)
        for own, given in zip(fields_of(self.y), fields_of(displacement), strict=True):
            own.x.array[:] = given.x.array

    @cached_property
    def _given(self) -> tuple[tuple[Any, Callable[[float], None]], tuple[Any, Callable[[float], None]]]:
        """Initial strains and jumps of the displacement, UFL, None without any, and what moves them to a place."""
        on = self.on
        return initial_strain(on.statement, on.tagged, on.space, 0), total_jump(on.statement, on.tagged, on.space)

    def move_to(self, step: float) -> tuple[Any, Any, int]:
        """Initial strains and jumps of a load step, UFL, None without any, and the degree of the quadrature of the
        former.
        """
        (strain, move_strain), (jump, move_jump) = self._given
        move_strain(step)
        move_jump(step)
        acting = [entry for entry in self.on.statement.of(InitialStrain) if entry.acts]
        return strain, jump, acting[0].degree(self.on.statement.element.degree) if acting else 0

    def kept(self, name: Hashable, make: Callable[[], Sequence[fem.Form]]) -> Sequence[fem.Form]:
        """Compiled forms, which are made once."""
        if name not in self._kept:
            self._kept[name] = make()
        return self._kept[name]

    def compiled(self, name: Hashable, terms: Callable[[], Sequence[Any]]) -> Sequence[fem.Form]:
        """Some terms, each compiled by itself: FFCx 0.9 compiles one of one point beside another one wrongly."""

        def make() -> list[fem.Form]:
            with compiling():
                return [fem.form(term) for term in terms()]

        return self.kept(name, make)


class NodalForces(BodyNodes):
    """Forces on the nodes of a Lagrange space, from a scene and its mesh alone; all methods are collective."""

    def __init__(self, statement: Statement, tagged: TaggedMesh, space: fem.FunctionSpace) -> None:
        super().__init__(space)
        self.statement = statement
        self.tagged = tagged
        self.kinematics = statement.kinematics_in(tagged.dimension)
        self._forms = CompiledForms(statement, tagged, space)

    @classmethod
    def on(cls, model: Model) -> NodalForces:
        """Those of a model, which is asked for them by all that evaluate forces anew."""
        if "nodal_forces" not in model.of_mesh:
            model.of_mesh["nodal_forces"] = cls(model.statement, model.tagged, model.space)
        shared: NodalForces = model.of_mesh["nodal_forces"]
        return shared.of(model.statement)

    def of(self, statement: Statement) -> NodalForces:
        """Those of another statement on the same mesh, whose nodes, pieces and areas are not computed again."""
        if statement is self.statement:
            return self
        other = copy(self)
        other.statement = statement
        other.kinematics = statement.kinematics_in(self.tagged.dimension)
        if not _differ_in_contact_alone(statement, self._forms.on.statement):
            other._forms = CompiledForms(statement, self.tagged, self.space)
        return other

    @property
    def pressed(self) -> bool:
        """Whether a pressure is an unknown."""
        return self.statement.element.pressed

    def internal(self, displacement: fem.Function) -> Array:
        """a(y, .) of the strains of a displacement, forces, shape (owned nodes, d).

        What resists them on the boundary is not in it, see ``resisted``.
        """
        forms = self._forms
        forms.take(displacement)
        return self._sum(forms.compiled("stress", lambda: forms.on.elastic.force_terms(forms.y, forms.z)))

    def initial(self, step: float, displacement: fem.Function) -> tuple[Array, float]:
        """Forces of the stress that initial strains and jumps of a load step cause where
        they are prevented, shape (owned nodes, d), and its energy; with a pressure those of jumps alone, and what both
        add to the energy of a ``displacement``.
        """
        forms = self._forms
        strain, jump, degree = forms.move_to(step)
        if strain is None and jump is None:
            return np.zeros((self.owned, self.dimension)), 0.0
        forms.take(displacement)
        elastic = forms.on.elastic
        prevented = forms.compiled("initial", lambda: elastic.initial_terms(forms.z, jump, strain, degree))
        energy = forms.compiled("prevented", lambda: elastic.prevented_terms(forms.y, jump, strain, degree))
        return self._sum(prevented), self._number(energy)

    def dilation(self, displacement: fem.Function, step: float) -> tuple[Array, Array] | None:
        """How far the volume changes otherwise than a pressure says, tested with the functions of the pressure, and
        their integrals, volumes, both of shape (owned unknowns of the pressure,); None: no pressure is an unknown.
        """
        if not self.pressed:
            return None
        forms = self._forms
        strain, jump, degree = forms.move_to(step)
        forms.take(displacement)
        *residual, volume = forms.compiled(
            "dilation", lambda: forms.on.elastic.dilation_terms(forms.y, jump, strain, degree)
        )
        return np.sum([assemble(form) for form in residual], axis=0), assemble(volume)

    def jumps(self) -> list[Jump]:
        """The jumps of the displacement."""
        return jumps_in(self.statement, self.tagged, self.space)

    def through(self, jump: Jump, displacement: fem.Function, step: float) -> float:
        """The work on a jump of one of the stress in the cells beyond it, without that of the loads in these cells:
        the tension through its section, a force.
        """
        forms = self._forms
        strain, jumps, degree = forms.move_to(step)
        forms.take(displacement)
        at, elastic = jump.on(self.space), forms.on.elastic

        def stress() -> list[Any]:
            acting = elastic.force_terms(forms.y, at, forms.y + jumps)
            free = () if strain is None else elastic.initial_terms(at, None, strain, degree)
            return [*acting, *(-term for term in free)]

        force = self._number(forms.compiled(("through", jump.path), stress))
        forms.on.move_to(step)
        for load in (load for load in self.statement.of(Force) if load.where is None and load.acts):
            factor, _ = self.statement.now(load, step)
            of_load = partial(compile_loads, [load], forms.on, at)
            force -= factor * self._number(forms.kept(("through", jump.path, id(load)), of_load))
        return force

    def resisted(self, displacement: fem.Function, resistances: Sequence[Resistance] | None = None) -> Array:
        """What resists a displacement on the boundary: all of it, or some; forces, shape (owned nodes, d)."""
        forms = self._forms
        some = self.statement.of(Resistance) if resistances is None else resistances
        acting = [effect for effect in some if effect.acts]
        forms.y.x.array[:] = displacement.x.array

        def make() -> list[fem.Form]:
            form = compile_resistance(acting, forms.on, forms.y, forms.z)
            return [] if form is None else [form]

        return self._sum(forms.kept(("resisted", *map(id, acting)), make))

    def external(self, step: float, some: Sequence[Force] | None = None) -> Array:
        """The forces in L of a load step, all or some, shape (owned nodes, d); initial strains have
        none.
        """
        forms, total = self._forms, np.zeros((self.owned, self.dimension))
        groups: dict[Hashable, list[Force]] = {}
        for load in self.statement.of(Force) if some is None else some:
            if load.acts:
                groups.setdefault(group_of(self.statement, load), []).append(load)
        forms.on.move_to(step)
        for loads in groups.values():
            factor, _ = self.statement.now(loads[0], step)
            compiled = forms.kept(("loads", *map(id, loads)), partial(compile_loads, loads, forms.on, forms.z))
            total += factor * self._sum(compiled)
            for load in loads:
                if load.nodal:
                    _, current = self.statement.now(load, step)
                    at_nodes = forces_at_nodes(current, load.label, self.space, self.tagged)
                    total += factor * at_nodes.reshape(total.shape)
        return total

    def _sum(self, forms: Sequence[fem.Form]) -> Array:
        """Linear forms, forces of shape (owned nodes, d)."""
        zero = np.zeros(self.owned * self.dimension)
        return sum((assemble(form) for form in forms), zero).reshape(-1, self.dimension)

    def _number(self, forms: Sequence[fem.Form]) -> float:
        """The sum of forms without arguments."""
        local_sum = sum((float(fem.assemble_scalar(form)) for form in forms), 0.0)
        return float(parallel.global_sum(self.tagged.mesh.comm, np.array(local_sum)))


def _differ_in_contact_alone(one: Statement, other: Statement) -> bool:
    """Whether the forms of one statement serve another one."""
    if (one.kinematics, one.element, one.path) != (other.kinematics, other.element, other.path):
        return False
    entries, others = ([at for at in of.listed() if not at[0].startswith("contact[")] for of in (one, other))
    return len(entries) == len(others) and all(a[1] is b[1] for a, b in zip(entries, others, strict=True))
