"""What contact holds between the sides of pairs that do not slide: as they are joined where they are undeformed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.nodal_stiffness import JointStiffness
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.obstacles.paired_points import PairedSides
from signorini_fx.mechanics.pairs.sliding import along_vectors
from signorini_fx.records import Finding
from signorini_fx.tuned import FACETS_OF_KEPT_PARTNERS

Array = npt.NDArray[np.float64]


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
        rows = along_vectors(directions[points]) @ operator[(dim * points[:, None] + np.arange(dim)).ravel()]
        total = total + sp.csr_array(rows.T @ rows)
    entries = total.tocoo()
    return _joint(boundary.comm, dim, (nodes[entries.row], nodes[entries.col], entries.data))


def turned_forces(
    state: ContactState, number: int, paired: PairedSides, space: fem.FunctionSpace, displacement: Array
) -> JointStiffness:
    """What displacements change of the contact forces of a pair as normals turn, which is not symmetric; collective.

    Args:
        state: the contact points of this rank, with tractions.
        number: of the contact.
        paired: both sides where they are undeformed.
        space: of the displacement.
        displacement: of the owned nodes, length, shape (owned nodes, d).
    """
    boundary, averages, dim = state.boundary, state.boundary.averages, displacement.shape[1]
    assert averages is not None
    points = np.flatnonzero(boundary.part == number)
    normal, weight = boundary.normal[points], boundary.weight[points, None, None]
    shear = np.einsum("nik,nk->ni", boundary.tangents[points], state.shear[points])
    # Tangents turn against normals.
    tractions = state.pressure[points, None, None] * np.eye(dim) - normal[:, :, None] * shear[:, None]
    components = np.arange(dim)
    operator = sp.csr_array(averages.operator)[(dim * points[:, None] + components).ravel()]
    forces = along_vectors((weight * tractions).swapaxes(1, 2)) @ paired.turning(space, displacement)
    entries = sp.coo_array(operator.T @ forces)
    rows, columns = ((dim * nodes[:, None] + components).ravel() for nodes in (averages.nodes, paired.master.nodes))
    return _joint(boundary.comm, dim, (rows[entries.row], columns[entries.col], entries.data))


def _joint(comm: MPI.Comm, dim: int, entries: tuple[npt.NDArray[Any], ...]) -> JointStiffness:
    """The sum of entries of all ranks, rows, columns and values, by unknowns of the whole body; collective."""
    row, column, value = (np.concatenate(part) for part in zip(*comm.allgather(entries), strict=True))
    unknowns = np.stack((row, column))
    reached = np.unique(unknowns // dim)
    places = np.searchsorted(reached, unknowns // dim) * dim + unknowns % dim
    matrix = sp.coo_array((value, (places[0], places[1])), shape=(dim * reached.size, dim * reached.size))
    return JointStiffness(reached, sp.csr_array(matrix))


def slid_past_partners(state: ContactState, sides: Mapping[int, float]) -> list[Finding]:
    """A warning for each pair whose touching points have moved farther along the other side than partners may be kept;
    collective.

    Args:
        state: the contact points of this rank.
        sides: the mean size of facets of the first side of each of these pairs, length, by the number of the contact.
    """
    findings, boundary = list[Finding](), state.boundary
    for number, facet in sides.items():
        touching = (boundary.part == number) & state.in_contact
        farthest = parallel.largest(boundary.comm, np.linalg.norm(state.u_t[touching], axis=1), 0.0)
        if farthest > FACETS_OF_KEPT_PARTNERS * facet:
            message = (
                f"points that keep their partners have moved by up to {farthest:.3g} along the other side, "
                f"{farthest / facet:.2g} facets: forces there may be wrong, and those on both sides act apart: let the "
                "sides slide"
            )
            findings.append(Finding("warning", f"contact[{number}].sliding", message))
    return findings


def facet_size(mesh: dmesh.Mesh, facets: npt.NDArray[np.int32]) -> float:
    """The mean size of facets of all ranks, length; collective.  ``facets``: local numbers."""
    dim = mesh.topology.dim - 1
    mesh.topology.create_connectivity(dim, mesh.topology.dim)
    owned = facets[facets < mesh.topology.index_map(dim).size_local]
    sums = np.array([mesh.h(dim, owned).sum(), owned.size], dtype=np.float64)
    total, count = parallel.global_sum(mesh.comm, sums)
    return float(total / max(count, 1.0))
