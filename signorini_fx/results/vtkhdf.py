"""Fields in VTK's HDF5 format, as dolfinx writes it since 0.10: one field in each file, there named ``u``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.machine import compat

Array = npt.NDArray[np.float64]
SUFFIX = ".vtkhdf"


def write_vtkhdf(folder: Path, moments: Sequence[Mapping[str, fem.Function]], times: Sequence[float]) -> list[str]:
    """Write every field in a file of its own; collective.

    Continuous fields have their values at the points of the mesh, discontinuous ones in the middle of each cell.

    Args:
        folder: where.
        moments: the fields at each time by their names, the same at all times.
        times: these.

    Returns:
        Names of the files.
    """
    files = {name: folder / f"{name}{SUFFIX}" for name in moments[0]}
    for name, path in files.items():
        domain = moments[0][name].function_space.mesh
        compat.write_vtkhdf_mesh(path, domain)
        for fields, time in zip(moments, times, strict=True):
            function = fields[name]
            of_cells = bool(function.function_space.element.basix_element.discontinuous)
            values = _in_cells(function) if of_cells else _at_points(function)
            if values.shape[1] == 2:  # a vector of space, as VTK expects
                values = np.pad(values, ((0, 0), (0, 1)))
            compat.write_vtkhdf_data(path, domain, values, time, cells=of_cells)
    return [path.name for path in files.values()]


def _at_points(function: fem.Function) -> Array:
    """At the points of the mesh that this rank owns, shape (points, components)."""
    domain, shape = function.function_space.mesh, function.ufl_shape
    degree = compat.geometry_degree(domain)
    element: Any = ("Lagrange", degree, shape) if shape else ("Lagrange", degree)
    interpolated = fem.Function(fem.functionspace(domain, element))
    interpolated.interpolate(function)
    space = interpolated.function_space
    at_nodes = interpolated.x.array.reshape(-1, space.dofmap.index_map_bs)
    values = np.zeros((len(domain.geometry.x), at_nodes.shape[1]))
    values[compat.geometry_cells(domain)] = at_nodes[space.dofmap.list]
    return values[: domain.geometry.index_map().size_local]


def _in_cells(function: fem.Function) -> Array:
    """In the middle of the cells that this rank owns, shape (cells, components)."""
    domain, shape = function.function_space.mesh, function.ufl_shape
    interpolated = fem.Function(fem.functionspace(domain, ("DG", 0, shape) if shape else ("DG", 0)))
    interpolated.interpolate(function)
    space = interpolated.function_space
    owned = domain.topology.index_map(domain.topology.dim).size_local
    return np.asarray(interpolated.x.array.reshape(-1, space.dofmap.index_map_bs)[space.dofmap.list[:owned, 0]])
