"""What the certificate of a ``ContactProblem`` judges.

Equilibrium is that of the user's forms: the action of ``a`` on the displacement and ``L`` are assembled anew, without
the matrix.  Contact conditions, weights, normals and the forces of contact tractions come from the independent code of
``results``, on the facets that the user named.  Both sides share the user's forms and the values of gap, friction,
direction and measure at the nodes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.body.assembly import action, assemble
from signorini_fx.body.foundation import Foundation, Pair
from signorini_fx.body.foundations import FoundationData
from signorini_fx.results.contact_nodes import ContactSide
from signorini_fx.results.equilibrium import Balance
from signorini_fx.results.supports import PrescribedNodes
from signorini_fx.results.surface_quadrature import SurfaceQuadrature
from signorini_fx.scales import Scales

Nodal = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int32]


def balance_of(
    forms: tuple[fem.Form, fem.Form],
    displacement: fem.Function,
    fixed: npt.NDArray[np.bool_],
    values: Nodal,
    scales: Scales,
) -> Balance:
    """The forces on the body without contact; collective.

    Args:
        forms: a and L, compiled.
        displacement: y.
        fixed: which dofs of this rank are prescribed, ghosts included, shape (dofs,).
        values: to what, shape (dofs,).
        scales: of lengths and stresses.
    """
    (a, L), space = forms, displacement.function_space
    dim, owned = space.mesh.geometry.dim, space.dofmap.index_map.size_local
    nodes = np.arange(values.size // dim, dtype=np.int32)
    internal = action((a,), displacement, nodes).reshape(-1, dim)
    prescribed = fixed.reshape(-1, dim)[:owned]
    no_vectors, nowhere = np.zeros((0, dim)), np.zeros(0, dtype=np.int64)
    by = np.where(prescribed, 0, -1)
    supports = PrescribedNodes(
        prescribed, values.reshape(-1, dim)[:owned], nowhere, no_vectors, np.zeros(0), by, nowhere.astype(np.int64)
    )
    external, nothing = assemble(L).reshape(-1, dim), np.zeros_like(internal)
    return Balance(SurfaceQuadrature(space), internal, external, supports, scales, scales, nothing)


def sides_of(
    data: Sequence[FoundationData],
    contact: Sequence[Foundation | Pair],
    named: tuple[Sequence[Indices], Mapping[int, Indices]],
    space: fem.FunctionSpace,
) -> list[ContactSide]:
    """The parts of the boundary with contact.

    Args:
        data: of the foundations at the nodes.
        contact: the foundations and pairs as the user gave them.
        named: their facets, and those of the other side of each pair by its number, see ``facets_of``.
        space: the displacements.
    """
    return [
        _side(contact_data, entry, facets, named[1].get(k), space)
        for k, (contact_data, entry, facets) in enumerate(zip(data, contact, named[0], strict=True))
    ]


def _side(
    data: FoundationData, entry: Foundation | Pair, facets: Indices, master: Indices | None, space: fem.FunctionSpace
) -> ContactSide:
    """One foundation or pair; what the user named decides which facets meet, and up to which distance."""

    def bound(nodes: npt.NDArray[Any], pressure: Nodal) -> Nodal:
        if data.bonded:
            return np.full(nodes.size, np.inf)
        return np.zeros(nodes.size) if data.law is None else data.law.at(nodes).claimed(np.abs(pressure))

    claim, by_geometry = None, False
    factor, along, axes = data.shape.factor, data.shape.direction, data.shape.axes
    if isinstance(entry, Pair):
        from signorini_fx.results.paired_claim import claim_of

        assert data.pair is not None
        assert master is not None
        by_geometry = not entry.bonded and isinstance(entry.gap, str)
        claim = claim_of(data.pair, space, (facets, master), entry.reach, nominal=not by_geometry, factor=factor)
    return ContactSide(
        facets,
        lambda nodes: (data.gap if data.allowance is None else data.allowance)[nodes],
        bound,
        data.bilateral,
        None if along is None else lambda nodes: along[nodes],
        factor,
        claim,
        by_geometry,
        None if axes is None else lambda nodes: (axes.along[nodes], axes.ratio[nodes]),
        entry.adjust if isinstance(entry, Pair) else None,
    )
