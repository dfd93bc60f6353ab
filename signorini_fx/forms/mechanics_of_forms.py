"""What the forms of a ``ContactProblem`` say of its results, and what its certificate judges.

Equilibrium is that of the user's forms: the action of ``a`` on the displacement and ``L`` are assembled anew, without
the matrix.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem

from signorini_fx.forms.given_forms import Facets, GivenForms
from signorini_fx.forms.stress import exterior_facets, stresses_of
from signorini_fx.machine import parallel
from signorini_fx.machine.compilation import compiling
from signorini_fx.mechanics.assembly.mesh_entities import action, assemble, facet_nodes, marked_nodes
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.scales import Scales
from signorini_fx.results.certificate.body_nodes import BodyNodes, PrescribedNodes
from signorini_fx.results.certificate.equilibrium import Balance
from signorini_fx.results.mechanics import SolidBody

if TYPE_CHECKING:
    from signorini_fx.results.accuracy.stress_recovery import StressRecovery
    from signorini_fx.results.resultants import ActingForces, NamedForces
    from signorini_fx.results.stresses import RawStresses

Nodal = npt.NDArray[np.float64]
NO_STRESS = "only the form knows the stresses: give stress=, a function of the displacement"


@dataclass(frozen=True, kw_only=True)
class FormBody(SolidBody):
    """A body that forms say all of; what depends on values in them is that of their present ones.

    Attributes:
        user_forms: what is assembled.
        prescribed_dofs: which dofs of this rank are prescribed, ghosts included, and to what, shapes (dofs,).
        form_scales: of lengths and stresses.
        settled: whether the forms are those of the results, and not those of a later load step that has failed.
    """

    no_bounds: ClassVar[str] = "a guaranteed bound is for scenes, which state their loads and supports"

    user_forms: GivenForms
    prescribed_dofs: tuple[npt.NDArray[np.bool_], Nodal]
    form_scales: Scales
    settled: bool = True

    @property
    def scales(self) -> Scales:
        """Forms state no materials."""
        return self.form_scales

    def balance(self, y: fem.Function, step: float) -> Balance:
        """Of the present values of the forms, wherever ``step`` is."""
        (a, L), (fixed, values), scales = self.user_forms.compiled, self.prescribed_dofs, self.form_scales
        dim = self.dimension
        nodes = np.arange(values.size // dim, dtype=np.int32)
        internal = action((a,), y, nodes).reshape(-1, dim)
        surface = BodyNodes(y.function_space)
        supports = prescribed_nodes(fixed, values, y.function_space)
        external, nothing = assemble(L).reshape(-1, dim), np.zeros_like(internal)
        return Balance(surface, internal, external, supports, scales, scales, nothing)

    def stress(self, y: fem.Function, step: float, shared: dict[str, StressRecovery]) -> RawStresses | str:
        forms, (fixed, _) = self.user_forms, self.prescribed_dofs
        if forms.stress is None:
            return NO_STRESS
        return stresses_of(forms.stress, y, forms.parts, forms.original, forms.touching, fixed, shared)

    def acting(self, y: fem.Function, step: float) -> ActingForces:
        """What acts through the parts of the boundary that have names."""
        from signorini_fx.results.resultants import ActingForces

        balance, forms, (fixed, _) = self.balance(y, step), self.user_forms, self.prescribed_dofs
        if not self.settled:
            return ActingForces(balance, (), (), ())
        return acting_on(balance, forms.boundaries, fixed, loads_of(forms, self.tagged, y))


def loads_of(forms: GivenForms, tagged: TaggedMesh, y: fem.Function) -> Iterator[NamedForces]:
    """The loads of UFL forms, and what resists the displacement on the boundary, see ``ActingForces``; of compiled
    forms nothing is known.  A load belongs to each part of the boundary that holds all facets of its integral;
    collective.
    """
    comm, dim = forms.mesh.comm, forms.mesh.geometry.dim
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
            if not parallel.any_rank(comm, bool(np.any(values))):
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
    boundaries: Mapping[str, Facets],
    fixed: npt.NDArray[np.bool_],
    loads: Iterable[NamedForces],
    *,
    displaced: bool = False,
) -> ActingForces:
    """What acts on a body whose supports are parts of its boundary: those at all of whose nodes the same components are
    prescribed; at a node of two of them a component belongs to the later one; collective.
    """
    from signorini_fx.results.resultants import ActingForces

    space, supports = balance.surface.space, list[str | None]()
    by = np.full((fixed.size // space.dofmap.index_map_bs, space.dofmap.index_map_bs), -1, dtype=np.int64)
    for number, (name, facets) in enumerate(boundaries.items()):
        nodes = facet_nodes(space, facets)
        free = ~fixed.reshape(by.shape)[nodes].all(axis=(0, 1))
        held = parallel.global_sum(space.mesh.comm, free.astype(np.float64)) == 0
        supports.append(name if held.any() else None)
        by[marked_nodes(space, nodes.ravel())[:, None] & held] = number  # the owner of a node need not have the facet
    balance, loads = replace(balance, supports=replace(balance.supports, by=by[: balance.surface.owned])), list(loads)
    acted_on = {*supports, *(where for where, *_ in loads)}
    return ActingForces(balance, supports, loads, [name for name in boundaries if name in acted_on], displaced)


def prescribed_nodes(fixed: npt.NDArray[np.bool_], values: Nodal, space: fem.FunctionSpace) -> PrescribedNodes:
    """What is prescribed component by component, as certificates take it: which dofs of this rank, ghosts included, and
    to what, shapes (dofs,).
    """
    dim, owned = space.mesh.geometry.dim, space.dofmap.index_map.size_local
    here = fixed.reshape(-1, dim)[:owned]
    return PrescribedNodes(here, values.reshape(-1, dim)[:owned], np.where(here, 0, -1))
