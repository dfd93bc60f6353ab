"""The outer surface of a body in space with its result on one rank, for a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import basix
import numpy as np
import numpy.typing as npt
from dolfinx import mesh as dmesh

from signorini_fx import parallel
from signorini_fx.body.assembly import facet_entities
from signorini_fx.results import sampling
from signorini_fx.results.solution import Solution

Floats = npt.NDArray[np.float64]
_SAME = 1e-8  # of the size of the body: points that are closer are one


@dataclass(frozen=True)
class OuterSurface:
    """The exterior facets of the body; the same on any number of ranks except for their order.

    Attributes:
        points: positions, length, shape (n, 3).
        facets: points of each facet along its perimeter, counterclockwise as seen from outside, shape (m, k): its
            corners, and more along sides that may be curved.
        displacement: at the points, length, shape (n, 3).
        values: fields at the midpoint of the cell behind each facet, see ``sampling.cell_values``.
    """

    points: Floats
    facets: npt.NDArray[np.int64]
    displacement: Floats
    values: Mapping[str, Floats]


def outer_facets(solution: Solution) -> int:
    """How many facets the outer surface has; collective."""
    mesh = solution.discretisation.tagged.mesh
    mesh.topology.create_connectivity(2, 3)
    own = dmesh.exterior_facet_indices(mesh.topology).size
    return int(parallel.global_sum(solution.comm, np.array(own)))


def gather_outer_surface(solution: Solution, fields: Sequence[str] = ()) -> OuterSurface:
    """The outer surface of all ranks, on the first one, and an empty one on the others; collective.

    Args:
        solution: where from.
        fields: names of the fields to compute beside von Mises stress and shear energy density.
    """
    comm, mesh = solution.comm, solution.discretisation.tagged.mesh
    mesh.topology.create_connectivity(2, 3)
    entities = facet_entities(mesh, dmesh.exterior_facet_indices(mesh.topology))
    kind = getattr(basix.CellType, mesh.topology.cell_name())
    count = sampling.pieces(solution)
    corners, sides = basix.geometry(kind), basix.topology(kind)[2]
    per_facet = count * len(sides[0])
    x, u = np.zeros((2, len(entities), per_facet, 3))
    for side, vertices in enumerate(sides):
        here = entities[:, 1] == side
        around = sampling.perimeter(corners[[vertices[k] for k in sampling.PERIMETER[len(vertices)]]], count)
        x[here] = sampling.positions(solution, around, entities[here, 0])
        u[here] = sampling.values_at(solution.displacement, around, entities[here, 0])
    middle = sampling.positions(solution, corners.mean(axis=0)[None], entities[:, 0])[:, 0]
    normal = np.cross(x[:, count] - x[:, 0], x[:, 2 * count] - x[:, 0])
    inwards = np.einsum("ij,ij->i", normal, x.mean(axis=1) - middle) < 0
    x[inwards], u[inwards] = x[inwards][:, ::-1], u[inwards][:, ::-1]

    both = parallel.rows_on_root(comm, np.concatenate((x, u), axis=2).reshape(-1, 6))
    size = float(np.ptp(both[:, :3], axis=0).max()) if len(both) else 1.0
    places = np.round(both[:, :3] / (_SAME * size)).astype(np.int64)
    _, first, number = np.unique(places, axis=0, return_index=True, return_inverse=True)
    values = sampling.cell_values(solution, entities[:, 0], fields)
    return OuterSurface(
        both[first, :3],
        number.reshape(-1, per_facet).astype(np.int64),
        both[first, 3:],
        {name: parallel.rows_on_root(comm, rows) for name, rows in values.items()},
    )
