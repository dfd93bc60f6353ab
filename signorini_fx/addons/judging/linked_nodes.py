"""Ties and equations of an input file: what they ask of displacements, and the directions that they leave free."""

from __future__ import annotations

import numpy as np
from scipy.linalg import qr, solve_triangular
from scipy.sparse import coo_array, csc_array, csr_array, diags_array, vstack
from scipy.sparse.csgraph import connected_components

from signorini_fx.mechanics.mesh.files.shape import Floats, Ints
from signorini_fx.tuned import JUDGED_FOLLOWER, SAME_LENGTH


def free_directions(links: csr_array, free: Ints, size: int) -> tuple[csc_array, Ints]:
    """The changes of a displacement that keep to links.

    Args:
        links: C, shape (links, size).
        free: numbers of the components that may change.
        size: how many components there are.

    Returns:
        Their basis, shape (size, m), each of which changes one component by 1, and only linked ones besides; and these
        components, shape (m,).
    """
    inner = csr_array(links[:, free])
    inner.eliminate_zeros()
    rows, followers, weights = _in_one_link(inner)
    candidates = np.setdiff1d(np.arange(free.size), followers)
    basis, independent = _of_whole_links(csr_array(inner[np.setdiff1d(np.arange(inner.shape[0]), rows)][:, candidates]))
    following = csr_array(diags_array(-1.0 / weights) @ inner[rows][:, candidates] @ basis)
    following.data[np.abs(following.data) <= SAME_LENGTH] = 0.0
    following.eliminate_zeros()
    entries = coo_array(vstack((basis, following)))
    at = np.concatenate((free[candidates], free[followers]))[entries.row], entries.col
    return csc_array((entries.data, at), shape=(size, independent.size)), free[candidates[independent]]


def _in_one_link(inner: csr_array) -> tuple[Ints, Ints, Floats]:
    """Links with components that are in no other one, of each the largest of these, which follows the others, and its
    factor there.
    """
    sizes, row = np.abs(inner.data), np.repeat(np.arange(inner.shape[0]), np.diff(inner.indptr))
    largest = np.zeros(inner.shape[0])
    np.maximum.at(largest, row, sizes)
    alone = np.bincount(inner.indices, minlength=inner.shape[1]) == 1
    chosen = np.flatnonzero(alone[inner.indices] & (sizes > JUDGED_FOLLOWER * largest[row]))
    chosen = chosen[np.lexsort((-sizes[chosen], row[chosen]))]
    rows, first = np.unique(row[chosen], return_index=True)
    entries = chosen[first]
    return rows, inner.indices[entries].astype(np.int64), inner.data[entries]


def _of_whole_links(inner: csr_array) -> tuple[csc_array, Ints]:
    """The basis of what keeps to links, shape (n, m), and the components that are its own, shape (m,), by factors of
    dense blocks: of links that have components in common, all at once.
    """
    entries = coo_array(inner)
    graph = coo_array(
        (np.ones(entries.nnz), (entries.row, inner.shape[0] + entries.col)), shape=(sum(inner.shape),) * 2
    )
    label = connected_components(graph, directed=False)[1]
    columns = csc_array(inner)
    parts: list[tuple[Ints, Ints, Floats]] = []
    for number in np.unique(label[entries.row]):
        rows = np.flatnonzero(label[: inner.shape[0]] == number)
        own = np.flatnonzero(label[inner.shape[0] :] == number)
        block = columns[:, own][rows].toarray()
        shares = 1.0 / np.count_nonzero(block, axis=0)  # nodes that are in few links follow, so that few are linked
        _, r, order = qr(block * shares, mode="economic", pivoting=True)
        diagonal = np.abs(np.diag(r))
        rank = int((diagonal > SAME_LENGTH * diagonal[0]).sum())
        following = -solve_triangular(r[:rank, :rank], r[:rank, rank:])
        followers, leaders = order[:rank], order[rank:]
        parts.append((own[followers], own[leaders], shares[followers, None] * following / shares[leaders]))
    count = inner.shape[1]
    independent = np.setdiff1d(np.arange(count), np.concatenate([np.empty(0, np.int64), *(led for led, _, _ in parts)]))
    at_rows: list[Ints] = [independent]
    at_columns: list[Ints] = [np.arange(independent.size)]
    values: list[Floats] = [np.ones(independent.size)]
    for followers, leaders, following in parts:
        first, second = np.nonzero(np.abs(following) > SAME_LENGTH)
        at_rows.append(followers[first])
        at_columns.append(np.searchsorted(independent, leaders[second]))
        values.append(following[first, second])
    at = np.concatenate(at_rows), np.concatenate(at_columns)
    return csc_array((np.concatenate(values), at), shape=(count, independent.size)), independent
