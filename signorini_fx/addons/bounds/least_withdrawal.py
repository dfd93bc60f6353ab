"""What a displacement withdraws from foundations, with the least share in the bound of its error.

Of all v = u_h - w that keep to the foundations each gives a bound; of it

    |w|^2 + 2 int p w_n

depends on w, energy norm, but for slip.  The least one under the coefficients of Bernstein of what u_h enters,

    C w >= e,

is a quadratic programme. It need not be solved: whatever w is found, v is made admissible afterwards and the bound
computed for it. So a few steps of the method of multipliers are taken, with a stiffness far above that of the body, in
which Newton's method finds the active inequalities. The displacement is linear on the cells, with bubbles along the
edges of the facets that may be in contact: a facet that is long beside the radius of a foundation enters it between its
nodes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from signorini_fx.addons.bounds.arrays import Array, Ints
from signorini_fx.addons.bounds.definite_factor import Factor
from signorini_fx.addons.bounds.facets import POINTS, WEIGHTS, bernstein
from signorini_fx.addons.bounds.linear_displacement import free_basis, stiffness
from signorini_fx.addons.bounds.plain_scene import FacetsInContact
from signorini_fx.addons.bounds.simplices import COLUMNS, EDGES, EDGES_OF_FACET, ROWS, TWICE, Simplices
from signorini_fx.tuned import (
    PENALTY_OF_ENTRY,
    SAME_LENGTH,
    SMALL_OF_STIFFNESS,
    STEPS_OF_WITHDRAWAL,
    UPDATES_OF_WITHDRAWAL,
)


def least_withdrawal(
    t: Simplices,
    surfaces: Sequence[FacetsInContact],
    excess: Sequence[Array],
    free: tuple[tuple[Array, Array], tuple[Array, Array]],
) -> tuple[Array, Array]:
    """The displacement w at the vertices, and its bubbles at the middles of the edges, length, (v, d) and (e, d).

    Args:
        t: the cells.
        surfaces: the contacts with rigid foundations that may open.
        excess: coefficients of Bernstein of what the computed displacement enters each of them, length.
        free: of vertices and of edges what ``Bounded._free_at`` returns: sizes and directions of what holds them.
    """
    d, vertices = t.dimension, len(t.x)
    edges = np.unique(np.concatenate([t.edges_of_facets[faces].ravel() for faces in _facets_of(surfaces)]))
    count = vertices + len(edges)
    (size, turn), (size_of_edges, turn_of_edges) = free
    fixed = np.concatenate((size, size_of_edges[edges])) > SAME_LENGTH
    basis = free_basis(np.concatenate((turn, turn_of_edges[edges])), fixed)
    matrix = basis.T @ _with_bubbles(t, edges) @ basis
    diagonal = matrix.diagonal()
    matrix = matrix + sp.diags(SMALL_OF_STIFFNESS * diagonal)
    rows, entered, work = [], [], np.zeros(d * count)
    for surface, deep in zip(surfaces, excess, strict=True):
        of_coefficients = _coefficients(t, surface, edges)
        directions = _directions_of(surface)
        rows.append(sp.csr_matrix(directions @ of_coefficients))
        entered.append(deep.ravel())
        work += of_coefficients.T @ _work(t, surface)
    constraints, deep, force = sp.vstack(rows).tocsr() @ basis, np.concatenate(entered), basis.T @ work
    stiff = PENALTY_OF_ENTRY * (constraints.multiply(constraints) @ diagonal)
    reduced, pushed, active = np.zeros(basis.shape[1]), np.zeros(len(deep)), deep > 0
    factor, updates = None, 0
    for _ in range(STEPS_OF_WITHDRAWAL):
        own = constraints[np.flatnonzero(active)]
        if factor is None:
            upper = sp.triu(matrix + own.T @ sp.diags(stiff[active]) @ own, format="csr")
            upper.sort_indices()
            factor = Factor(upper)
        reduced = factor.solve(own.T @ (stiff[active] * deep[active] + pushed[active]) - force)
        following = pushed + stiff * (deep - constraints @ reduced)
        if ((following > 0) == active).all():
            if updates == UPDATES_OF_WITHDRAWAL:
                break
            pushed, updates = following.clip(min=0.0), updates + 1
        else:
            active, factor = following > 0, None
    components = (basis @ reduced).reshape(-1, d)
    bubbles = np.zeros((len(t.edges), d))
    bubbles[edges] = components[vertices:]
    return components[:vertices], bubbles


def _facets_of(surfaces: Sequence[FacetsInContact]) -> Iterator[Ints]:
    """Those of foundations, and of both sides of bodies that do not match."""
    for surface in surfaces:
        yield surface.facets
        if surface.opposite is not None:
            yield surface.opposite.facets


def _with_bubbles(t: Simplices, edges: Ints) -> sp.csr_matrix:
    """Stiffness of displacements at vertices and of bubbles 4 l_a l_b of edges, force per length."""
    d, vertices = t.dimension, len(t.x)
    number = np.full(len(t.edges), -1)
    number[edges] = vertices + np.arange(len(edges))
    cells = np.flatnonzero((number[t.edges_of] >= 0).any(axis=1))
    g, corners = t.gradients[cells], d + 1
    pairs = EDGES[d]
    gradient = np.zeros((len(cells), corners + len(pairs), d, corners, d, d))  # unknown, component, at corner
    for component in range(d):
        for corner in range(corners):
            gradient[:, corner, component, :, component] = g[:, corner, None]
        for k, (a, b) in enumerate(zip(*pairs.T, strict=True)):
            gradient[:, corners + k, component, a, component] = 4 * g[:, b]
            gradient[:, corners + k, component, b, component] = 4 * g[:, a]
    strain = (gradient[..., ROWS[d], COLUMNS[d]] + gradient[..., COLUMNS[d], ROWS[d]]) / 2
    strain = strain.reshape(len(cells), -1, corners, strain.shape[-1])
    moduli = t.moduli.of(cells)
    stress = moduli.stress(strain) * TWICE[d]
    local = np.einsum("nick,njck->nij", stress, strain) + np.einsum(
        "nik,njk->nij", stress.sum(axis=2), strain.sum(axis=2)
    )
    local *= (t.volume[cells] / ((d + 1) * (d + 2)))[:, None, None]
    own = np.concatenate((t.corners[cells], number[t.edges_of[cells]]), axis=1)
    dofs = (d * own[:, :, None] + np.arange(d)).reshape(len(cells), -1)
    kept = np.repeat(own >= 0, d, axis=1)
    kept_pairs = kept[:, :, None] & kept[:, None, :]
    kept_pairs[:, : d * corners, : d * corners] = False  # the vertices of all cells follow
    first, second = np.broadcast_arrays(dofs[:, :, None], dofs[:, None, :])
    size = d * (vertices + len(edges))
    bubbles = sp.csr_matrix((local[kept_pairs], (first[kept_pairs], second[kept_pairs])), shape=(size, size))
    linear = stiffness(t)
    linear.resize((size, size))
    return sp.csr_matrix(bubbles + linear)


def _coefficients(t: Simplices, surface: FacetsInContact, edges: Ints) -> sp.csr_matrix:
    """Coefficients of Bernstein on the facets, (m, 3 or 6, d) flat, from displacements at vertices and bubbles; between
    two bodies those of the jump.
    """
    d = t.dimension
    pairs = EDGES_OF_FACET[d]
    of_facet = np.diag(np.repeat([1.0, 2.0], [d, len(pairs)]))
    of_facet[d + np.arange(len(pairs))[:, None], pairs] = 0.5
    if surface.refined is None:
        return _from_unknowns(
            t, surface.facets, edges, np.broadcast_to(of_facet, (len(surface.facets), *of_facet.shape))
        )
    first, second = (
        _from_unknowns(t, surface.refined.facet(side), edges, surface.refined.coefficients_from(side) @ of_facet)
        for side in (0, 1)
    )
    return first - second


def _from_unknowns(t: Simplices, facets: Ints, edges: Ints, local: Array) -> sp.csr_matrix:
    """A matrix for each facet, shape (m, c, vertices and bubbles), as one for all unknowns, for each component."""
    d, (m, count, _) = t.dimension, local.shape
    unknown = np.concatenate((t.facets[facets], len(t.x) + np.searchsorted(edges, t.edges_of_facets[facets])), axis=1)
    rows = np.broadcast_to(np.arange(m * count).reshape(m, count, 1), local.shape)
    columns = np.broadcast_to(unknown[:, None], local.shape)
    shape = (m * count, len(t.x) + len(edges))
    matrix = sp.csr_matrix((local.ravel(), (rows.ravel(), columns.ravel())), shape=shape)
    matrix.eliminate_zeros()
    return sp.csr_matrix(sp.kron(matrix, sp.eye(d)))


def _directions_of(surface: FacetsInContact) -> sp.csr_matrix:
    """The coefficients of ``FacetsInContact.excess`` from those of a displacement, less what is of the foundation."""
    m, d = surface.normal.shape
    per_facet = d + len(EDGES_OF_FACET[d])
    unit = np.zeros((m, per_facet, d))
    parts: list[npt.NDArray[np.float64]] = []
    still = surface.excess(unit)
    for coefficient in range(per_facet):
        for component in range(d):
            unit[:, coefficient, component] = 1.0
            parts.append(surface.excess(unit) - still)
            unit[:, coefficient, component] = 0.0
    local = np.stack(parts, axis=2)  # (m, coefficients of the excess, coefficients of the displacement)
    count = local.shape[1]
    rows = np.broadcast_to((np.arange(m)[:, None] * count + np.arange(count))[:, :, None], local.shape)
    columns = np.broadcast_to((np.arange(m)[:, None] * per_facet * d + np.arange(per_facet * d))[:, None], local.shape)
    shape = (m * count, m * per_facet * d)
    return sp.csr_matrix((local.ravel(), (rows.ravel(), columns.ravel())), shape=shape)


def _work(t: Simplices, surface: FacetsInContact) -> Array:
    """Integrals of the pressure times the displacement towards the foundation, by its coefficients, flat."""
    d = t.dimension
    pressure, direction = surface.pressure @ POINTS[d].T, POINTS[d] @ surface.directions
    moments = np.einsum("q,fq,fqd,qc->fcd", WEIGHTS[d], pressure, direction, bernstein(POINTS[d]))
    return np.asarray((surface.area(t.area)[:, None, None] * moments).ravel())
