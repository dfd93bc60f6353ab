"""What contact holds between the sides of pairs that do not slide: as they are joined where they are undeformed."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from signorini_fx.mechanics.body.contact_state import ContactState
from signorini_fx.mechanics.body.nodal_stiffness import JointStiffness


def held_between(state: ContactState, pairs: Sequence[int], sticks: npt.NDArray[np.bool_]) -> JointStiffness:
    """Products of the rows of relative displacements that contact holds, see ``SlidingSides.holding``; collective.

    Args:
        state: the contact points of this rank.
        pairs: the numbers of the contacts.
        sticks: which of the points friction holds, shape (n,).
    """
    boundary, averages = state.boundary, state.boundary.averages
    assert averages is not None
    dim, of_pair = boundary.x.shape[1], np.isin(boundary.part, pairs)
    operator = sp.csr_array(averages.operator)
    nodes = (dim * averages.nodes[:, None] + np.arange(dim)).ravel()
    total = sp.csr_array((nodes.size, nodes.size))
    for flags, directions in ((state.in_contact, boundary.normal[:, :, None]), (sticks, boundary.tangents)):
        points = np.flatnonzero(flags & of_pair)
        of_points = operator[(dim * points[:, None] + np.arange(dim)).ravel()]
        rows = (
            sp.block_diag([along.T for along in directions[points]], format="csr") @ of_points if points.size else None
        )
        total = total if rows is None else total + sp.csr_array(rows.T @ rows)
    entries = total.tocoo()
    triples = boundary.comm.allgather((nodes[entries.row], nodes[entries.col], entries.data))
    row, column, value = (np.concatenate(each) for each in zip(*triples, strict=True))
    reached = np.unique(row // dim)
    places = np.searchsorted(reached, np.stack((row, column)) // dim) * dim + np.stack((row, column)) % dim
    matrix = sp.coo_array((value, (places[0], places[1])), shape=(dim * reached.size, dim * reached.size))
    return JointStiffness(reached, sp.csr_array(matrix))
