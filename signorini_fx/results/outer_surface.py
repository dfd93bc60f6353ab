"""The outer surface of a body in space with its result on one rank, for a picture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh

from signorini_fx import parallel
from signorini_fx.body.assembly import facet_entities
from signorini_fx.body.material import shear_energy_density
from signorini_fx.results.interpolation import interpolated
from signorini_fx.results.solution import Solution


@dataclass(frozen=True)
class OuterSurface:
    """The exterior facets of the body; the same on any number of ranks except for their order.

    Attributes:
        points: vertex positions, length, shape (n, 3).
        facets: vertices of each facet along its perimeter, counterclockwise as seen from outside, shape (m, 3) or
            (m, 4).
        displacement: at the points, length, shape (n, 3).
        mises: von Mises stress at the midpoint of the cell behind each facet, shape (m,).
    """

    points: npt.NDArray[np.float64]
    facets: npt.NDArray[np.int64]
    displacement: npt.NDArray[np.float64]
    mises: npt.NDArray[np.float64]


def outer_facets(solution: Solution) -> int:
    """How many facets the outer surface has; collective."""
    mesh = solution.discretisation.tagged.mesh
    mesh.topology.create_connectivity(2, 3)
    own = dmesh.exterior_facet_indices(mesh.topology).size
    return int(parallel.global_sum(solution.comm, np.array(own)))


def gather_outer_surface(solution: Solution) -> OuterSurface:
    """The outer surface of all ranks, on the first one, and an empty one on the others; collective."""
    d, comm = solution.discretisation, solution.comm
    mesh = d.tagged.mesh
    linear = fem.Function(fem.functionspace(mesh, ("Lagrange", 1, (3,))))
    linear.interpolate(solution.displacement)
    entities = facet_entities(mesh, dmesh.exterior_facet_indices(mesh.topology))
    space, cells = linear.function_space, entities[:, 0]
    layout = space.dofmap.dof_layout
    sides = 4 if space.dofmap.list.shape[1] == 4 else 6
    closures = np.array([layout.entity_closure_dofs(2, side) for side in range(sides)], dtype=np.int64)
    if sides == 6:
        closures = closures[:, [0, 1, 3, 2]]
    nodes = space.dofmap.list[cells[:, None], closures[entities[:, 1]]].astype(np.int64)
    x = space.tabulate_dof_coordinates()
    corners, middle = x[nodes], x[space.dofmap.list[cells]].mean(axis=1)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inwards = np.einsum("ij,ij->i", normal, corners.mean(axis=1) - middle) < 0
    nodes[inwards] = nodes[inwards][:, ::-1]

    used, local = np.unique(nodes, return_inverse=True)
    numbers = space.dofmap.index_map.local_to_global(used.astype(np.int32)).astype(np.int64)
    values = np.column_stack((x[used], linear.x.array.reshape(-1, 3)[used]))
    facets = parallel.rows_on_root(comm, numbers[local.reshape(nodes.shape)])
    every, first = np.unique(parallel.rows_on_root(comm, numbers), return_index=True)
    values = parallel.rows_on_root(comm, values)[first]
    mises = parallel.rows_on_root(comm, _von_mises(solution, cells))
    return OuterSurface(values[:, :3], np.searchsorted(every, facets), values[:, 3:], mises)


def _von_mises(solution: Solution, cells: npt.NDArray[np.int32]) -> npt.NDArray[np.float64]:
    """Von Mises stress at the midpoints of cells of this rank."""
    d = solution.discretisation
    density = shear_energy_density(solution.displacement, *d.lame, solution.scene.material[0].hypothesis)
    constant = interpolated(ufl.sqrt(6 * d.lame[1] * density), fem.functionspace(d.tagged.mesh, ("DG", 0)))
    return np.asarray(constant.x.array[constant.function_space.dofmap.list[cells, 0]])
