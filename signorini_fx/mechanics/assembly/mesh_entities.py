"""Functions for all forms: positions of nodes, integration entities of facets, measures, quadrature
degrees, assembled vectors.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Generic, TypeVar

import basix
import numpy as np
import ufl
from dolfinx import fem, jit, la
from dolfinx import mesh as dmesh

from signorini_fx.arrays import Array, Flags, Indices, quotient
from signorini_fx.machine import compat, parallel
from signorini_fx.machine.compilation import compiling
from signorini_fx.mechanics.kinematics import SPACE, Kinematics
from signorini_fx.tuned import ROOT_OF_EPS

# Let compilers reorder sums and so vectorise them: in 3D this halves the time, and the results
# differ by round-off.
_IN_ANY_ORDER = ["-fassociative-math", "-fno-signed-zeros", "-fno-trapping-math"]

# The attribute of a function space that caches the positions of its nodes.
_ATTRIBUTE = "_signorini_fx_node_positions"
_Owner = TypeVar("_Owner")
_Computed = TypeVar("_Computed")


def node_positions(space: fem.FunctionSpace) -> Array:
    """Return the coordinates of the nodes of this rank, ghosts included, length, shape (nodes, 3),
    read-only.

    They are cached, because dolfinx loops over all cells at every call.
    """
    positions: Array | None = getattr(space, _ATTRIBUTE, None)
    if positions is None:
        positions = np.asarray(space.tabulate_dof_coordinates(), dtype=np.float64)
        positions.flags.writeable = False
        setattr(space, _ATTRIBUTE, positions)
    return positions


def forget_positions(space: fem.FunctionSpace) -> None:
    """Drop the cached node positions of a space, after the coordinates of its mesh have changed."""
    setattr(space, _ATTRIBUTE, None)


def compile_form(term: ufl.Form) -> fem.Form:
    """Return the compiled form; collective.

    Raises:
        MachineError: it cannot be compiled.
    """
    with compiling():
        return fem.form(term)


def stiffness_form(term: ufl.Form, dimension: int) -> fem.Form:
    """Return a compiled bilinear form on cells of this dimension, in 3D with faster compiler
    options; collective.

    Raises:
        MachineError: it cannot be compiled.
    """
    if dimension < 3:
        return compile_form(term)
    arguments = [*jit.get_options()["cffi_extra_compile_args"], *_IN_ANY_ORDER]
    with compiling():
        return fem.form(term, jit_options={"cffi_extra_compile_args": arguments})


def facet_cells(mesh: dmesh.Mesh, facets: Indices) -> Indices:
    """Return the cells of exterior facets, shape (facets,)."""
    return facet_entities(mesh, facets)[:, 0]


def facet_entities(mesh: dmesh.Mesh, facets: Indices) -> Indices:
    """Return pairs (cell, local number of the facet in this cell) of exterior facets, shape
    (facets, 2).
    """
    dim = mesh.topology.dim
    mesh.topology.create_connectivity(dim - 1, dim)
    mesh.topology.create_connectivity(dim, dim - 1)
    of_facets = mesh.topology.connectivity(dim - 1, dim)
    cell_facets = mesh.topology.connectivity(dim, dim - 1)
    if facets.size == 0:  # a rank may have no cells at all
        return np.empty((0, 2), dtype=np.int32)
    cells = of_facets.array[of_facets.offsets[facets]]
    per_cell = cell_facets.array.reshape(cell_facets.num_nodes, -1)
    return np.column_stack((cells, np.argmax(per_cell[cells] == facets[:, None], axis=1))).astype(
        np.int32
    )


def heights(mesh: dmesh.Mesh, facets: Indices) -> Array:
    """Return the heights of the cells above exterior facets, length, shape (facets,).

    A height is twice the distance between the midpoints of facet and cell.
    """
    dim = mesh.topology.dim
    cells = facet_cells(mesh, facets)
    up = dmesh.compute_midpoints(mesh, dim, cells) - dmesh.compute_midpoints(mesh, dim - 1, facets)
    return 2 * np.linalg.norm(up, axis=1)


def heights_at_nodes(space: fem.FunctionSpace, facets: Indices) -> Array:
    """Return the mean of ``heights`` of the facets around each node of this rank, length, shape
    (nodes,); nan at other nodes; collective.
    """
    nodes = facet_nodes(space, facets)
    each = np.repeat(heights(space.mesh, facets), nodes.shape[1])
    sums = la.vector(space.dofmap.index_map, 2)
    np.add.at(sums.array.reshape(-1, 2), nodes.ravel(), np.column_stack((each, np.ones(each.size))))
    sums.scatter_reverse(la.InsertMode.add)
    sums.scatter_forward()
    total, count = sums.array.reshape(-1, 2).T
    return quotient(total, count, otherwise=np.nan)


def facet_vertices(mesh: dmesh.Mesh, facets: Indices) -> Array:
    """Return the coordinates of the m vertices of each facet, shape (facets, m, 3)."""
    if facets.size == 0:  # dolfinx divides by their number
        kind = getattr(basix.CellType, mesh.topology.cell_name())
        return np.empty((0, len(basix.topology(kind)[mesh.topology.dim - 1][0]), 3))
    return mesh.geometry.x[dmesh.entities_to_geometry(mesh, mesh.topology.dim - 1, facets)].astype(
        np.float64
    )


def facet_nodes(space: fem.FunctionSpace, facets: Indices) -> Indices:
    """Return the local numbers of the nodes of exterior facets in the order of basix, shape
    (facets, nodes).

    All facets must have the same number of nodes.
    """
    layout = space.dofmap.dof_layout
    kind = getattr(basix.CellType, space.mesh.topology.cell_name())
    side = space.mesh.topology.dim - 1
    closures = np.array(
        [layout.entity_closure_dofs(side, k) for k in range(len(basix.topology(kind)[side]))]
    )
    entities = facet_entities(space.mesh, facets)
    return space.dofmap.list[entities[:, :1], closures[entities[:, 1]]]


def marked_nodes(space: fem.FunctionSpace, nodes: Indices) -> Flags:
    """Return which nodes of this rank, ghosts included, are in ``nodes`` on any rank, shape
    (nodes,); collective.
    """
    mark = la.vector(space.dofmap.index_map, 1, dtype=np.int32)
    mark.array[nodes] = 1
    mark.scatter_reverse(la.InsertMode.add)
    mark.scatter_forward()
    return mark.array > 0


def measure(
    mesh: dmesh.Mesh, parts: Sequence[Indices], metadata: Mapping[str, str | int]
) -> ufl.Measure:
    """Return the surface measure over lists of facets, with subdomain numbers from 1.

    The same numbers on every mesh let forms be compiled once.
    """
    data = [
        (number, facet_entities(mesh, facets).ravel())
        for number, facets in enumerate(parts, start=1)
    ]
    return ufl.Measure("ds", domain=mesh, subdomain_data=data, metadata=metadata)


def assemble(form: fem.Form) -> Array:
    """Return a compiled linear form as a vector, summed over the ranks, shape (owned dofs,);
    collective.
    """
    return _summed(fem.assemble_vector(form))


def action(elastic: tuple[fem.Form, ...], function: fem.Function, blocks: Indices) -> Array:
    """Return a(function, .) with the values of ``function`` at the nodes ``blocks`` only, shape
    (owned dofs,); collective.

    dolfinx lifts prescribed values by assembling the same bilinear form cell by cell, so that no
    further form is compiled.
    """
    result = fem.Function(function.function_space)
    for form in elastic:
        fem.apply_lifting(result.x.array, [form], [[fem.dirichletbc(function, blocks)]])
    return -_summed(result.x)


def _summed(vector: la.Vector) -> Array:
    """Return the owned entries of a vector after adding the contributions of all ranks; collective.

    No PETSc vector is made from it: dolfinx destroys such vectors when the garbage collector finds
    them, at another time on each rank, and one rank would wait in the duplication of a communicator
    that the others do not need.
    """
    vector.scatter_reverse(la.InsertMode.add)
    return np.array(vector.array[: vector.index_map.size_local * vector.block_size])


class _Shared(Generic[_Owner, _Computed]):
    """A property whose value is computed once and kept in a dictionary of its object."""

    def __init__(self, holder: str, compute: Callable[[_Owner], _Computed]) -> None:
        self.__doc__ = compute.__doc__
        self._holder = holder
        self._compute = compute

    def __get__(self, instance: _Owner, owner: type) -> _Computed:
        values: dict[str, _Computed] = getattr(instance, self._holder)
        name = self._compute.__name__
        if name not in values:
            values[name] = self._compute(instance)
        return values[name]


def shared_in(
    holder: str,
) -> Callable[[Callable[[_Owner], _Computed]], _Shared[_Owner, _Computed]]:
    """Return a decorator that makes a method a property, computed once and cached in a dictionary
    of its object.

    ``dataclasses.replace`` passes the dictionary on, so that copies share the value; a copy with
    other data must be given an empty dictionary.

    Args:
        holder: name of the attribute with the dictionary.
    """
    return lambda compute: _Shared(holder, compute)


def prescribed(space: fem.FunctionSpace, bcs: Sequence[fem.DirichletBC]) -> tuple[Flags, Array]:
    """Return which dofs of this rank are prescribed, and their values, zero elsewhere, both of
    shape (dofs,); the last condition wins.
    """
    index_map = space.dofmap.index_map
    block = space.dofmap.index_map_bs
    values = np.zeros((index_map.size_local + index_map.num_ghosts) * block)
    fixed = np.zeros(values.size, dtype=bool)
    for condition in bcs:
        condition.set(values)
        fixed[condition.dof_indices()[0]] = True
    return fixed, values


def strain_degree(space: fem.FunctionSpace, kinematics: Kinematics = SPACE) -> int:
    """Return the quadrature degree of a(., .) for displacements in ``space``; collective.

    On simplices, and along each axis of parallelepipeds, it is exact for epsilon(y) : epsilon(z)
    times the determinant of the Jacobian.  On other quadrilaterals and hexahedra the integrand is
    rational; there it is the degree of the product of all polynomials in it, as UFL estimates in
    2D.
    """
    mesh = space.mesh
    degree = space.element.basix_element.degree
    further = kinematics.further_degrees
    cell = mesh.topology.cell_name()
    geometry = compat.geometry_degree(mesh)
    if cell in ("triangle", "tetrahedron"):
        return 2 * (degree - 1) + (2 if cell == "triangle" else 3) * (geometry - 1) + further
    return 2 * (degree if not further and parallelepipeds(mesh) else degree + geometry) + further


def parallelepipeds(mesh: dmesh.Mesh) -> bool:
    """Return whether all cells are quadrilaterals or hexahedra with affine maps; collective."""
    if (
        mesh.topology.cell_name() not in ("quadrilateral", "hexahedron")
        or compat.geometry_degree(mesh) > 1
    ):
        return False
    dim = mesh.topology.dim
    # Shape (d, corners of a cell, cells), corners in the order of basix: along x[0] first.
    x = np.ascontiguousarray(mesh.geometry.x.T[:dim], dtype=np.float64)
    corners = x[:, compat.geometry_cells(mesh).T]
    relative = corners - corners[:, :1]
    edges = relative[:, 2 ** np.arange(dim)]
    away = relative - compat.geometry_element(mesh).points @ edges
    apart = (away**2).sum(axis=0) > ROOT_OF_EPS**2 * (edges**2).sum(axis=0).min(axis=0)
    return not parallel.any_rank(mesh.comm, apart)


def lumped_degree(degree: int, geometry: int) -> int:
    """Return the quadrature degree that integrates a basis function times the normal of a surface
    exactly.

    Args:
        degree: of the basis function.
        geometry: degree of the cells.
    """
    return 2 * (degree + geometry)
