"""Nodal forces of a scene at a displacement, assembled from compiled linear forms for the
certificate.

No matrix, right-hand side, condensed system or load vector of the solver is read: the form of the
body is assembled at the displacement, and the loads at their position in the lists of factors, each
with its own coefficients.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from copy import copy
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import ufl
from dolfinx import fem

from signorini_fx.arrays import Array
from signorini_fx.machine import parallel
from signorini_fx.machine.compilation import compiling
from signorini_fx.mechanics.assembly.mesh_entities import assemble, node_positions, shared_in
from signorini_fx.mechanics.elasticity.elastic_law import fields_of
from signorini_fx.mechanics.loads.initial_strains import Jump, given_strains
from signorini_fx.mechanics.loads.load_vectors import (
    FormCoefficients,
    compile_loads,
    compile_resistance,
    load_groups,
)
from signorini_fx.mechanics.loads.supports import Supports, forces_at_nodes
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.effect import ForceDensity, InitialStrain, Resistance
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.results.certificate.equilibrium import PrescribedNodes, RigidPart

if TYPE_CHECKING:
    from ufl.core.expr import Expr


class NodalForces:
    """Forces on the nodes of a Lagrange space, from a scene and its mesh alone.  All methods are
    collective.

    A ``step`` is the position in the lists of load factors.
    """

    def __init__(self, statement: Statement, tagged: TaggedMesh, space: fem.FunctionSpace) -> None:
        self.space = space
        self.dimension = int(space.mesh.geometry.dim)
        self.owned = int(space.dofmap.index_map.size_local)
        self.statement = statement
        self.tagged = tagged
        self.kinematics = statement.kinematics_in(tagged.dimension)
        self._on = FormCoefficients(statement, tagged, space)
        self._z = ufl.TestFunction(space)
        self._of_forms: dict[Hashable, Any] = {}

    @classmethod
    def on(cls, model: Model) -> NodalForces:
        """Return the forces of a model.  Statements on one mesh that differ in contact alone share
        compiled forms.
        """
        statement = model.statement
        stated, kept = model.of_mesh.get("nodal_forces", (None, None))
        entries = [id(entry) for at, entry in statement.listed() if not at.startswith("contact[")]
        stating = statement.kinematics, statement.element, statement.path, statement.found, entries
        if kept is None or stated != stating:
            kept = cls(statement, model.tagged, model.space)
            model.of_mesh["nodal_forces"] = stating, kept
        forces = copy(kept)
        forces.statement = statement
        return forces

    @shared_in("_of_forms")
    def pieces(self) -> RigidPart:
        """Return the connected pieces of the body."""
        return RigidPart(self.space)

    @shared_in("_of_forms")
    def _y(self) -> fem.Function:
        """Return the displacement at which forms are evaluated."""
        return self._on.elastic.displacement()

    @shared_in("_of_forms")
    def _given(self) -> tuple[Expr | None, Expr | None, Callable[[float], None]]:
        """Return initial strains and jumps of the displacement as UFL, None for none, and a
        function that moves them to a step.
        """
        return given_strains(self._on.statement, self.tagged, self.space)

    def _take(self, displacement: fem.Function) -> None:
        """Copy a displacement into the function at which all forms are evaluated."""
        for own, given in zip(fields_of(self._y), fields_of(displacement), strict=True):
            own.x.array[:] = given.x.array

    def _at_step(self, step: float) -> tuple[Expr | None, Expr | None, int]:
        """Return initial strains and jumps of a step as UFL, None for none, and the quadrature
        degree of the strains.
        """
        strain, jump, move_to = self._given
        move_to(step)
        acting = [entry for entry in self.statement.of(InitialStrain) if entry.acts]
        return strain, jump, acting[0].degree(self.statement.element.degree) if acting else 0

    def _compiled(
        self, name: Hashable, terms: Callable[[], Sequence[ufl.Form | fem.Form | None]]
    ) -> Sequence[fem.Form]:
        """Return compiled terms, compiled once under a name.

        Each term is a form of its own, because FFCx 0.9 miscompiles a point form beside another
        one.
        """
        if name not in self._of_forms:
            stated = [term for term in terms() if term is not None]
            with compiling():
                self._of_forms[name] = [
                    term if isinstance(term, fem.Form) else fem.form(term) for term in stated
                ]
        forms = self._of_forms[name]
        return forms

    @property
    def pressed(self) -> bool:
        """Whether a pressure is an unknown."""
        return self.statement.element.pressed

    def internal(self, displacement: fem.Function) -> Array:
        """Return a(y, .) of the strains of a displacement without ``resisted``, forces, shape
        (owned nodes, d).
        """
        self._take(displacement)
        return self._sum(
            self._compiled("stress", lambda: self._on.elastic.force_terms(self._y, self._z))
        )

    def initial(self, step: float, displacement: fem.Function) -> tuple[Array, float]:
        """Return the forces of the stress that prevented initial strains and jumps cause, shape
        (owned nodes, d), and its energy.

        Where the pressure is an unknown, the forces are those of jumps, and the energy is what
        strains and jumps add to that of ``displacement``.
        """
        strain, jump, degree = self._at_step(step)
        if strain is None and jump is None:
            return np.zeros((self.owned, self.dimension)), 0.0
        self._take(displacement)
        elastic = self._on.elastic
        prevented = self._compiled(
            "initial", lambda: elastic.initial_terms(self._z, jump, strain, degree)
        )
        energy = self._compiled(
            "prevented", lambda: elastic.prevented_terms(self._y, jump, strain, degree)
        )
        return self._sum(prevented), self._number(energy)

    def dilation(self, displacement: fem.Function, step: float) -> tuple[Array, Array] | None:
        """Return the residual of the change of volume and the volumes of its test functions, both
        of shape (owned unknowns of the pressure,).

        The residual is the difference between the change of volume and the one that the pressure
        causes, tested with the functions of the pressure.  Returns None if the pressure is no
        unknown.
        """
        if not self.pressed:
            return None
        strain, jump, degree = self._at_step(step)
        self._take(displacement)
        *residual, volume = self._compiled(
            "dilation", lambda: self._on.elastic.dilation_terms(self._y, jump, strain, degree)
        )
        return np.sum([assemble(form) for form in residual], axis=0), assemble(volume)

    def through(self, jump: Jump, displacement: fem.Function, step: float) -> float:
        """Return the tension through the section of a jump, a force.

        It is the work of the stress in the cells beyond the section on a jump of one, without the
        work of the loads in these cells.
        """
        strain, jumps, degree = self._at_step(step)
        self._take(displacement)
        at = jump.on(self.space)
        elastic = self._on.elastic

        def stress() -> list[ufl.Form]:
            free = () if strain is None else elastic.initial_terms(at, None, strain, degree)
            return [*elastic.force_terms(self._y, at, self._y + jumps), *(-term for term in free)]

        force = self._number(self._compiled(("through", jump.path), stress))
        self._on.move_to(step)
        for load in (
            load for load in self.statement.of(ForceDensity) if load.where is None and load.acts
        ):
            of_load = partial(compile_loads, [load], self._on, at)
            work = self._number(self._compiled(("through", jump.path, id(load)), of_load))
            force -= self.statement.now(load, step)[0] * work
        return force

    def resisted(
        self, displacement: fem.Function, resistances: Sequence[Resistance] | None = None
    ) -> Array:
        """Return the forces of springs and other resistances on the boundary at a displacement,
        shape (owned nodes, d).

        Args:
            displacement: y.
            resistances: those that count; None for all of the scene.
        """
        some = self.statement.of(Resistance) if resistances is None else resistances
        acting = [effect for effect in some if effect.acts]
        self._y.x.array[:] = displacement.x.array

        forms = self._compiled(
            ("resisted", *map(id, acting)),
            lambda: [compile_resistance(acting, self._on, self._y, self._z)],
        )
        return self._sum(forms)

    def external(self, step: float, some: Sequence[ForceDensity] | None = None) -> Array:
        """Return the load vector L of a step, forces, shape (owned nodes, d); initial strains have
        no part in it.

        Args:
            step: position in the lists of factors.
            some: the loads that count; None for all of the scene.
        """
        total = np.zeros((self.owned, self.dimension))
        self._on.move_to(step)
        for loads in load_groups(
            self.statement, self.statement.of(ForceDensity) if some is None else some
        ).values():
            factor, _ = self.statement.now(loads[0], step)
            compiled = self._compiled(
                ("loads", *map(id, loads)), partial(compile_loads, loads, self._on, self._z)
            )
            total += factor * self._sum(compiled)
            for load in loads:
                if load.nodal:
                    at_nodes = forces_at_nodes(
                        self.statement.now(load, step)[1], load.label, self.space, self.tagged
                    )
                    total += factor * at_nodes.reshape(total.shape)
        return total

    def prescribed(self, step: float) -> PrescribedNodes:
        """Return the displacements that supports prescribe at a step."""
        statement = self.statement
        tagged = self.tagged
        now = [statement.now(entry, step) for entry in statement.displacement]
        factors = {id(effect): factor for factor, effect in now}
        position = {id(effect): number for number, (_, effect) in enumerate(now)}
        facets = {
            str(effect.boundary): tagged.facets(effect.boundary)
            for _, effect in now
            if effect.at is None
        }
        entries = tuple(effect for _, effect in now)
        stated = statement.changed(displacement=entries)
        supports = Supports.of(stated, self.space, facets, tagged, step)
        value = np.zeros((len(node_positions(self.space)), self.dimension))
        by = np.full(value.shape, -1)
        for (
            effect,
            condition,
        ) in supports.conditions:  # the last one holds nodes on an axis of revolution
            condition.set(value.reshape(-1), alpha=factors.get(id(effect), 1.0))
            by.reshape(-1)[condition.dof_indices()[0]] = position.get(id(effect), len(now))
        turned = supports.turned
        if turned is not None:
            scaled = [
                replace(skew, values=factors[id(skew.effect)] * skew.values)
                for skew in turned.supports
            ]
            turned = replace(turned, supports=scaled)
            turned.place(value, entries)
        fixed = supports.fixed.reshape(self.owned, self.dimension)
        return PrescribedNodes(fixed, value[: self.owned], by[: self.owned], turned)

    def _sum(self, forms: Sequence[fem.Form]) -> Array:
        """Return the sum of assembled linear forms, forces, shape (owned nodes, d)."""
        zero = np.zeros(self.owned * self.dimension)
        return sum((assemble(form) for form in forms), zero).reshape(-1, self.dimension)

    def _number(self, forms: Sequence[fem.Form]) -> float:
        """Return the sum of assembled forms of rank zero over all ranks."""
        local_sum = sum((float(fem.assemble_scalar(form)) for form in forms), 0.0)
        return parallel.total(self.tagged.mesh.comm, local_sum)
