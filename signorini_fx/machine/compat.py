"""The few differences between dolfinx 0.9, 0.10 and 0.11.  No other module checks a version."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

import basix
import basix.ufl
import mpi4py.MPI  # noqa: F401  # before dolfinx, which finds MPI once it is loaded
import numpy as np
import ufl
from dolfinx import __version__, cpp, fem, mesh

from signorini_fx.arrays import Array, Column, Indices
from signorini_fx.errors import needs_fenicsx

VERSION = tuple(int(part) for part in __version__.split(".")[:2])
if VERSION < (0, 9):
    raise needs_fenicsx(f"dolfinx is {__version__}")


@contextmanager
def shared_cells() -> Iterator[None]:
    """Let all elements of one kind share their UFL cell inside the ``with`` block.

    basix makes a new cell whenever an element is asked for it, which UFL does hundreds of times for
    a form: 150 objects for a hexahedron.
    """
    elements = basix.ufl._ElementBase
    own = elements.cell
    elements.cell = property(lambda element: _cell(element._cellname))
    try:
        yield
    finally:
        elements.cell = own


_cell = cache(ufl.Cell)


def interpolation_points(element: Any) -> Array:
    """Return the interpolation points of an element on the reference cell: a method until 0.9, a
    property since.
    """
    points = element.interpolation_points
    return points() if callable(points) else points


def cell_name(domain: mesh.Mesh) -> str:
    """Return the name of the cells of a mesh in UFL: a method until 0.9, a property since."""
    name = domain.ufl_cell().cellname
    return str(name() if callable(name) else name)


def _cmap(geometry: Any) -> cpp.fem.CoordinateElement_float64:
    """Return the geometry map of a mesh; dolfinx 0.11 has one for each kind of cell."""
    return geometry.cmaps[0] if VERSION >= (0, 11) else geometry.cmap


def geometry_degree(domain: mesh.Mesh) -> int:
    """Return the polynomial degree of the geometry: 1 for straight cells."""
    return int(_cmap(domain.geometry).degree)


def geometry_element(domain: mesh.Mesh) -> basix.finite_element.FiniteElement:
    """Return the Lagrange element of the geometry of the cells as an element of basix."""
    cmap = _cmap(domain.geometry)
    return lagrange(domain.topology.cell_name(), cmap.degree, basix.LagrangeVariant(cmap.variant))


@cache
def lagrange(
    cell: str, degree: int, variant: basix.LagrangeVariant
) -> basix.finite_element.FiniteElement:
    """Return the scalar Lagrange element on a kind of cell as an element of basix."""
    return basix.create_element(
        basix.ElementFamily.P, getattr(basix.CellType, cell), degree, variant
    )


def geometry_cells(domain: mesh.Mesh) -> Indices:
    """Return the geometry nodes of the cells of this rank, shape (cells, nodes of each)."""
    geometry: Any = domain.geometry
    return geometry.dofmaps[0] if VERSION >= (0, 11) else geometry.dofmap


def wrapped(holder: fem.FunctionSpace | mesh.Mesh | fem.Form | mesh.Geometry) -> Any:
    """Return the C++ object that a Python object holds, as some functions of dolfinx take only
    this.
    """
    inner = holder
    return inner._cpp_object


def geometry_in_space(domain: mesh.Mesh) -> cpp.mesh.Geometry_float64:
    """Return the geometry of a mesh with points of three coordinates, for a mesh of the same
    topology.
    """
    geometry = wrapped(domain.geometry)
    x = np.array(geometry.x)
    indices = geometry.input_global_indices
    return type(geometry)(geometry.index_map(), geometry_cells(domain), _cmap(geometry), x, indices)


def form_data(form: fem.Form) -> list[Column]:
    """Return the values of the constants and coefficients of a compiled form on this rank, in a
    fixed order.
    """
    packed = cpp.fem.pack_coefficients(wrapped(form))
    kinds = sorted(packed, key=lambda kind: (kind[0].name, kind[1]))
    return [np.asarray(cpp.fem.pack_constants(wrapped(form))), *(packed[kind] for kind in kinds)]


def topology(holder: mesh.Mesh | mesh.MeshTags) -> cpp.mesh.Topology:
    """Return the topology of a mesh or of tags, unwrapped so that both can be compared.

    Until 0.10 it is wrapped for one of them only.
    """
    wrapped = holder.topology
    return getattr(wrapped, "_cpp_object", wrapped)


def facet_mesh(domain: mesh.Mesh, facets: Indices) -> tuple[mesh.Mesh, Indices]:
    """Return a mesh of facets, and for each of its cells on this rank the facet of ``domain``: an
    array until 0.9, a map since.
    """
    cells: Any
    made, cells, *_ = mesh.create_submesh(domain, domain.topology.dim - 1, facets)
    if VERSION >= (0, 10):
        index_map = made.topology.index_map(made.topology.dim)
        numbers = np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32)
        cells = cells.sub_topology_to_topology(numbers, inverse=False)
    return made, np.asarray(cells, dtype=np.int32)
