"""The resultants of a ``ContactProblem``: what its forms exert through the parts of its boundary that have names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem, la
from dolfinx import mesh as dmesh

from signorini_fx.forms.stress import exterior_facets
from signorini_fx.machine import parallel
from signorini_fx.machine.compilation import compiling
from signorini_fx.mechanics.body.assembly import action, assemble, facet_nodes
from signorini_fx.mechanics.body.node_positions import node_positions
from signorini_fx.results.certificate.contact_nodes import ContactNodes, ContactSide
from signorini_fx.results.certificate.equilibrium import Balance
from signorini_fx.results.certificate.promised_law import Tractions
from signorini_fx.results.certificate.surface_quadrature import SurfaceQuadrature
from signorini_fx.results.resultants import NodalForcesAt, Resultants

_ADD = la.InsertMode.add
Array = npt.NDArray[np.float64]
Facets = npt.NDArray[np.int32]


@dataclass(frozen=True)
class FormIntegral:
    """One integral of the forms.

    Attributes:
        cause: what it exerts, in words.
        form: compiled.
        resists: whether it is of a, so that it acts on the displacement.
        facets: that it is over; None: it is over the body.
    """

    cause: str
    form: fem.Form
    resists: bool
    facets: Facets | None


def integrals_of(a: Any, L: Any, mesh: dmesh.Mesh) -> list[FormIntegral]:
    """The loads of UFL forms, and what resists the displacement on the boundary; of compiled forms nothing is known."""
    found = []
    for form, resists in ((L, False), (a, True)):
        for integral in form.integrals() if isinstance(form, ufl.Form) else ():
            kind = integral.integral_type()
            if kind not in ("exterior_facet", "cell") or (resists and kind == "cell"):
                continue
            facets = exterior_facets(integral, mesh) if kind == "exterior_facet" else None
            cause = "springs" if resists else "body force" if facets is None else "traction"
            with compiling():
                found.append(FormIntegral(cause, fem.form(ufl.Form([integral])), resists, facets))
    return found


@dataclass(frozen=True, repr=False)
class FormResultants(Resultants):
    """The resultants of forms.  A load belongs to a part of the boundary that holds all facets of its integral.

    A part is a support if at all of its nodes the same components are prescribed; at a node of two of them a component
    belongs to the later one.

    Attributes:
        balance: the forces on the body without contact.
        contacts: the parts of the boundary with contact.
        integrals: of the forms.
        boundaries: the parts of the boundary with names given by the user.
        fixed: which dofs of this rank are prescribed, ghosts included, shape (dofs,).
        displaced: whether forces act at the displaced points, as on a body with large displacements.
        loads: further loads: the part of the boundary, None for the body; what acts, in words; the forces, shape (owned
            nodes, d).
    """

    balance: Balance
    contacts: Sequence[ContactSide]
    integrals: Sequence[FormIntegral]
    boundaries: Mapping[str, Facets]
    fixed: npt.NDArray[np.bool_]
    displaced: bool = False
    loads: Sequence[tuple[str | None, str, Array]] = ()

    @cached_property
    def _x(self) -> Array:
        """See ``Resultants``."""
        places = self._displacements[: self._nodal.owned]
        return node_positions(self.displacement.function_space)[: self._nodal.owned, : places.shape[1]] + places

    @cached_property
    def _contact_points(self) -> Array:
        """See ``Resultants``."""
        assert self.contact is not None
        boundary = self.contact.boundary
        return boundary.centre + self._displacements[boundary.nodes]

    @property
    def _displacements(self) -> Array:
        """By which points are moved, shape (nodes, d)."""
        dim = self.tagged.mesh.geometry.dim
        return np.asarray(
            self.displacement.x.array.reshape(-1, dim) if self.displaced else np.zeros((self.fixed.size // dim, dim))
        )

    def _middle(self, boundary: str) -> tuple[Array, Array | None]:
        """See ``Resultants``; a displaced boundary is not flat."""
        middle, normal = super()._middle(boundary)
        return middle, None if self.displaced else normal

    @property
    def _names(self) -> list[str]:
        names = [name for name in self.boundaries if self._held[name].any() or self._of_effects(name)]
        for effect in self.statement.contact:
            names += [effect.boundary, *([effect.against] if effect.against else [])]
        return list(dict.fromkeys(names))

    @cached_property
    def _nodal(self) -> SurfaceQuadrature:
        return self.balance.surface

    @cached_property
    def _held(self) -> dict[str, npt.NDArray[np.bool_]]:
        """Which components are prescribed at all nodes of each part, shape (d,) each; collective."""
        space, held = self.displacement.function_space, {}
        for name, facets in self.boundaries.items():
            free = ~self.fixed.reshape(-1, space.dofmap.index_map_bs)[facet_nodes(space, facets)].all(axis=(0, 1))
            held[name] = parallel.global_sum(space.mesh.comm, free.astype(np.float64)) == 0
        return held

    @cached_property
    def _taken_by(self) -> npt.NDArray[np.int64]:
        """Which part each prescribed component belongs to, by its number, else -1, shape (owned nodes, d)."""
        space, owned = self.displacement.function_space, self._nodal.owned
        by = np.full((self.fixed.size // space.dofmap.index_map_bs, space.dofmap.index_map_bs), -1, dtype=np.int64)
        marks = fem.Function(space)
        for number, (name, facets) in enumerate(self.boundaries.items()):
            marks.x.array[:] = 0.0
            on_part = marks.x.array.reshape(by.shape)
            on_part[np.unique(facet_nodes(space, facets))] = 1.0
            marks.x.scatter_reverse(_ADD)  # the owner of a node need not have the facet
            by[(on_part > 0) & self._held[name]] = number
        return by[:owned]

    @cached_property
    def _reactions(self) -> Array:
        """What the stresses in the body leave to the supports, shape (owned nodes, d)."""
        owned = self._nodal.owned
        unbalanced = (self.balance.internal - self.balance.external)[:owned].copy()
        if self.contact is not None:
            reached, forces, _ = ContactNodes.of(self._nodal, self.contacts, Tractions.of(self.contact)).forces()
            np.add.at(unbalanced, reached, forces)
        return unbalanced

    def _of_supports(self, boundary: str) -> dict[str, NodalForcesAt]:
        if boundary not in self.boundaries or not self._held[boundary].any():
            return {}
        mine = self._taken_by == list(self.boundaries).index(boundary)
        return {"support": NodalForcesAt(self._x, np.where(mine, self._reactions, 0.0))}

    def _of_effects(self, boundary: str | None) -> dict[str, NodalForcesAt]:
        comm, dim = self.tagged.mesh.comm, self.tagged.mesh.geometry.dim
        on = None if boundary is None else self.tagged.facets(boundary)
        forces = dict[str, NodalForcesAt]()
        for name, cause, values in self.loads:
            if name == boundary:
                earlier = forces[cause].values if cause in forces else 0.0
                forces[cause] = NodalForcesAt(self._x, earlier + values)
        for integral in self.integrals:
            if (integral.facets is None) != (on is None):
                continue
            if (
                on is not None
                and integral.facets is not None
                and parallel.any_rank(comm, not np.isin(integral.facets, on).all())
            ):
                continue
            if integral.resists:
                nodes = np.arange(self.displacement.x.array.size // dim, dtype=np.int32)
                values = -action((integral.form,), self.displacement, nodes)
            else:
                values = assemble(integral.form)
            if not parallel.any_rank(comm, bool(np.any(values))):
                continue
            values = np.asarray(values).reshape(-1, dim)[: self._nodal.owned]
            before = forces[integral.cause].values if integral.cause in forces else 0.0
            forces[integral.cause] = NodalForcesAt(self._x, before + values)
        return forces
