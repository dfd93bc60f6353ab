"""Our solution on a mesh whose sides are half as long, at the nodes of a deck."""

from __future__ import annotations

from dataclasses import dataclass

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded
import numpy as np
from scipy.spatial import cKDTree

from signorini_fx.addons.decks.content import Deck
from signorini_fx.addons.decks.node_results import contact_by_node, stress_by_node
from signorini_fx.addons.decks.tagged_arrays import tagged
from signorini_fx.addons.gauntlet.solved_drafts import SolvedDraft
from signorini_fx.errors import SignoriniError
from signorini_fx.mechanics.assembly.mesh_entities import node_positions
from signorini_fx.mechanics.mesh.files.arrays import plain
from signorini_fx.mechanics.mesh.files.shape import Floats, is_straight
from signorini_fx.mechanics.mesh.halving import halved
from signorini_fx.results.solution import Solution
from signorini_fx.tuned import FINER_AT_MOST


@dataclass(frozen=True)
class FinerValues:
    """Values at the end, at the nodes of a deck, by their numbers.

    Attributes:
        displacement: length, shape (3,) at each.
        stress: mean of the cells at a node, xx, yy, zz, xy, xz, yz.
        pressure: at contact points; NaN where nothing touches, infinite elsewhere.
    """

    displacement: dict[int, Floats]
    stress: dict[int, Floats]
    pressure: dict[int, Floats]


def finer_values(solved: SolvedDraft, deck: Deck) -> FinerValues | None:
    """Our solution with all sides halved; None: the mesh, or the scene, does not allow that, or there is none."""
    arrays = deck.mesh
    unknowns = solved.solution.model.dofs * 2**arrays.dim
    nodal = deck.links or any(getattr(entry, "file", None) for _, entry in solved.solution.statement.listed())
    straight = arrays.degree == 1 or is_straight(arrays.points, arrays.cells, arrays.cell)
    if nodal or unknowns > FINER_AT_MOST:
        return None
    try:
        solution = solved.solve(mesh=tagged(halved(arrays), straight=straight))
    except SignoriniError:
        return None
    return _at_nodes_of(solution, deck) if solution.converged else None


def _at_nodes_of(solution: Solution, deck: Deck) -> FinerValues:
    """The values at the nodes of a deck, of which a finer mesh has all, body by body."""
    space, dim = solution.displacement.function_space, deck.mesh.dim
    x = node_positions(space)[:, :dim]
    displacement = np.pad(solution.displacement.x.array.reshape(-1, dim), ((0, 0), (0, 3 - dim)))
    pressure = np.full((len(x), 1), np.inf)
    touching = contact_by_node(solution)
    pressure[touching[:, 0].astype(np.int64), 0] = touching[:, 4]
    tables = (displacement, stress_by_node(solution), pressure)
    values: tuple[dict[int, Floats], ...] = ({}, {}, {})
    for body, rows in deck.bodies.items():
        nodes = np.arange(len(x))
        if body:
            nodes = np.unique(space.dofmap.list[solution.model.tagged.cells(body)])
        _, nearest = cKDTree(x[nodes]).query(deck.mesh.points[rows])
        for by_number, table in zip(values, tables, strict=True):
            by_number |= dict(zip(plain(deck.names[rows]), table[nodes[nearest]], strict=True))
    return FinerValues(*values)
