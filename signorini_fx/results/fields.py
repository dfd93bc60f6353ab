"""Files for ParaView, in VTK's XML format: the fields of a result, and its contact surface in 3D.

Each file is one unstructured grid in base64, which ParaView, PyVista and meshio read.  Each rank
writes its own cells into it, and no rank gathers those of another.  (meshio reads neither the raw
form reliably nor files of several pieces.)
"""

from __future__ import annotations

import base64
import sys
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from dolfinx.plot import vtk_mesh
from mpi4py import MPI

from signorini_fx.arrays import Ints
from signorini_fx.machine import parallel
from signorini_fx.mechanics.contact_points.contact_table import ContactTable
from signorini_fx.results.solution import Solution

Array = npt.NDArray[Any]
# The file of a result without load steps, and with them their list and the folder of one for each.
VTU = "fields.vtu"
VTU_STEPS = "fields.pvd"
VTU_FOLDER = "fields"
FIELD_FILES = (VTU, VTU_STEPS, VTU_FOLDER)


def write_fields(solution: Solution, folder: Path) -> list[str]:
    """Write displacement, stresses and shear energy density for ParaView and return the names of
    the files.  Collective.

    There is one file, and with load steps one for each step with a solution and a list of them with
    their times.  Each cell has its own points, because raw stresses jump between cells.  The stress
    has nine components, which ParaView reads as a tensor, in 2D too.  An OSError is raised on all
    ranks alike.
    """
    if not solution.model.path.several:
        write_vtu(folder / VTU, solution.comm, *grid_of(solution.at(solution.last_step)))
        return [VTU]
    parallel.on_root(solution.comm, lambda: (folder / VTU_FOLDER).mkdir())
    rows = []
    for step in solution.shown_steps:
        name = f"{VTU_FOLDER}/{step.step:04d}.vtu"
        write_vtu(folder / name, solution.comm, *grid_of(solution.at(step)))
        rows.append(f'<DataSet timestep="{step.time!r}" file="{name}"/>')
    text = "\n".join(
        [
            '<VTKFile type="Collection" version="1.0"><Collection>',
            *rows,
            "</Collection></VTKFile>",
            "",
        ]
    )
    parallel.on_root(solution.comm, lambda: (folder / VTU_STEPS).write_text(text, encoding="utf-8"))
    return [VTU_STEPS]


def grid_of(moment: Solution) -> tuple[Array, Array, int, dict[str, Array]]:
    """Return points, cells, VTK's cell type, and fields at the points, for the cells that this rank
    owns, see ``write_vtu``.  Collective.
    """
    fields = fields_in_cells(moment)
    space = fields["von_mises" if "von_mises" in fields else "displacement"].function_space
    cells, kinds, points = vtk_mesh(space)
    cells = (
        cells.reshape(len(kinds), -1)[:, 1:]
        if len(kinds)
        else np.zeros((0, space.dofmap.list.shape[1]), dtype=int)
    )
    # In the order of the cells: each field has its own degrees of freedom.
    numbers = space.dofmap.list
    order = [list(numbers[0]).index(number) for number in cells[0]] if len(cells) else []
    values = {}
    for name, function in fields.items():
        at_nodes = function.x.array.reshape(-1, function.function_space.dofmap.index_map_bs)
        at_points = at_nodes[function.function_space.dofmap.list[: len(cells)][:, order].ravel()]
        if name == "displacement":  # a vector of space, as ParaView expects
            at_points = np.pad(at_points, ((0, 0), (0, 3 - at_points.shape[1])))
        values[name] = at_points[:, 0] if at_points.shape[1] == 1 else at_points
    pieces = moment.model.pieces
    if pieces.count > 1:
        values["piece"] = np.repeat(pieces.of_cell[: len(cells)], cells.shape[1]).astype(np.int64)
    kind = int(
        parallel.global_max(moment.comm, float(np.max(kinds, initial=0)))
    )  # a rank may have no cell
    return points[cells.ravel()], np.arange(cells.size).reshape(cells.shape), kind, values


def computed_fields(solution: Solution) -> dict[str, fem.Function]:
    """Return the nodal fields that effects have computed for the shown step, by name."""
    space = solution.model.space
    nodes = fem.functionspace(space.mesh, ("Lagrange", space.element.basix_element.degree))
    functions = dict[str, fem.Function]()
    for name, values in getattr(solution.last_step.place, "computed", {}).items():
        functions[name] = fem.Function(nodes)
        functions[name].x.array[:] = values
    return functions


def fields_in_cells(solution: Solution) -> dict[str, fem.Function]:
    """Return every field by name, as a discontinuous function of the degree of the element.
    Collective.
    """
    mesh = solution.model.tagged.mesh
    degree = solution.model.space.element.basix_element.degree
    y = solution.displacement
    stress = solution.known_stress
    fields = dict[str, fem.Function]()
    known = {"displacement": y, **computed_fields(solution)}
    if stress is not None:
        known |= {
            "stress": stress.tensor,
            "von_mises": stress.von_mises,
            "principal_stresses": stress.principal,
        }
        if stress.stress.shear_modulus is not None:
            known["density"] = stress.shear_energy_density
        if stress.plastic_strain is not None:
            known["plastic_strain"] = stress.plastic_strain
        # All load steps have the same fields: recovered ones need finite values, which only a
        # failed first step lacks.
        if stress.recovers and not parallel.any_rank(
            solution.comm, not np.isfinite(y.x.array).all()
        ):
            known |= {
                "recovered_stress": stress.recovered.tensor,
                "recovered_von_mises": stress.recovered.von_mises,
            }
    for name, function in known.items():
        space = fem.functionspace(mesh, ("DG", degree, function.ufl_shape))
        fields[name] = fem.Function(space, name=name)
        fields[name].interpolate(function)
    return fields


# VTK's number of a facet with this many nodes, and its order of basix's nodes: vertices, then
# edges, then the rest.
_KINDS = {3: (5, [0, 1, 2]), 4: (9, [0, 1, 3, 2]), 9: (28, [0, 1, 3, 2, 4, 6, 7, 5, 8])}
_STATES = ("open", "stick", "slip")


def facets_of(table: ContactTable) -> Ints:
    """Return the rows of a contact table in 3D at the nodes of each facet, in VTK's order, shape
    (m, 3), (m, 4) or (m, 9).
    """
    assert table.facets is not None
    facets = table.facets[(table.facets >= 0).all(axis=1)]
    return facets[:, _KINDS[facets.shape[1]][1]]


def write_surface(path: Path, table: ContactTable) -> None:
    """Write the contact surface as a .vtu file; on one rank."""
    c = table.columns
    facets = facets_of(table)

    def vector(begin: str) -> Array:
        return np.column_stack([c[f"{begin}{axis}"] for axis in "xyz"])

    fields = {
        **{
            name: c[name]
            for name in ("pressure", "gap", "u_n", "bound", "shear", "slip", "u_t", "weight")
        },
        **{f"{name} vector": vector(f"{name}_") for name in ("shear", "slip", "u_t")},
        "normal": vector("n_"),
        "state (0 open, 1 stick, 2 slip)": np.array([_STATES.index(state) for state in c["state"]]),
    }
    write_vtu(path, MPI.COMM_SELF, vector(""), facets, _KINDS[facets.shape[1]][0], fields)


_NAMES = {np.dtype(np.float64): "Float64", np.dtype(np.int64): "Int64", np.dtype(np.uint8): "UInt8"}


def write_vtu(
    path: Path, comm: MPI.Comm, points: Array, cells: Array, kind: int, fields: Mapping[str, Array]
) -> None:
    """Write the cells of all ranks as one grid.  Collective.

    Args:
        path: the file.
        comm: the ranks.
        points: points of this rank, shape (n, 3).
        cells: local numbers of the points of each cell in VTK's order, shape (cells, corners).
        kind: VTK's number of the cell type.
        fields: values at the points, shape (n,) or (n, components).
    """
    corners = cells.shape[1]
    first_cell = parallel.rows_before(comm, len(cells))
    ends = corners * np.arange(first_cell + 1, first_cell + len(cells) + 1)
    grid: dict[str, dict[str, Array]] = {
        "Points": {"points": points.astype(np.float64)},
        "Cells": {
            "connectivity": cells.ravel().astype(np.int64)
            + parallel.rows_before(comm, len(points)),
            "offsets": ends.astype(np.int64),
            "types": np.full(len(cells), kind, dtype=np.uint8),
        },
        "PointData": {name: values.astype(np.float64) for name, values in fields.items()},
    }
    counts = parallel.global_sum(comm, np.array([len(points), len(cells)]))
    order = "LittleEndian" if sys.byteorder == "little" else "BigEndian"
    described = f'type="UnstructuredGrid" version="1.0" byte_order="{order}" header_type="UInt64"'
    text = f"<VTKFile {described}>\n<UnstructuredGrid>\n"
    text += f'<Piece NumberOfPoints="{counts[0]}" NumberOfCells="{counts[1]}">\n'
    for group, arrays in grid.items():
        text += f"<{group}>\n"
        for name, values in arrays.items():
            components = f' NumberOfComponents="{values.shape[1]}"' if values.ndim > 1 else ""
            text += (
                f'<DataArray type="{_NAMES[values.dtype]}" Name="{name}"{components} '
                'format="binary">'
            )
            _append(path, comm, text, values)
            text = "</DataArray>\n"
        text += f"</{group}>\n"
    _append(path, comm, text + "</Piece>\n</UnstructuredGrid>\n</VTKFile>\n")


def _append(path: Path, comm: MPI.Comm, text: str, values: Array | None = None) -> None:
    """Append a text to a file, and after it the values of all ranks in base64, preceded by the
    number of their bytes.  Collective.

    Four characters encode three bytes: a rank starts at its first group of three bytes, and takes
    the missing bytes of its last group from the next ranks.  An OSError is raised on all ranks
    alike.
    """
    own = b"" if values is None else values.tobytes()
    sizes = comm.allgather(len(own))
    if values is not None:
        header = np.uint64(sum(sizes)).tobytes()
        own = header + own if parallel.is_root(comm) else own
        sizes[0] += len(header)
    behind = b"".join(comm.allgather(own[:2])[comm.rank + 1 :])
    first = sum(sizes[: comm.rank])
    skipped = -first % 3
    ends = -(first + len(own)) % 3
    error = None
    try:
        place = parallel.on_root(comm, partial(_append_text, path, text))
        if skipped < len(own):
            with path.open("r+b") as file:
                file.seek(place + 4 * ((first + skipped) // 3))
                file.write(base64.b64encode(own[skipped:] + behind[:ends]))
    except OSError as failed:
        error = failed
    parallel.raise_together(comm, error)


def _append_text(path: Path, text: str) -> int:
    """Append a text to a file and return the size of the file afterwards, in bytes."""
    with path.open("ab") as file:
        file.write(text.encode())
        return file.tell()
