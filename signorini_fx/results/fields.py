"""The fields of a result for ParaView: displacement, raw and recovered stresses, energy density, plastic strain."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from dolfinx.plot import vtk_mesh

from signorini_fx.machine import parallel
from signorini_fx.results.solution import Solution
from signorini_fx.results.vtu import bytes_of, write_vtu

Array = npt.NDArray[Any]
# The file of a result without load steps, and with them their list and the folder of one for each.
VTU, VTU_STEPS, VTU_FOLDER = "fields.vtu", "fields.pvd", "fields"
FIELD_FILES = (VTU, VTU_STEPS, VTU_FOLDER)
_COMPONENTS = (3, 9, 1, 3, 1, 9, 1)  # of the fields in 3D, more than those of nonlinear materials


def size_of_fields(solution: Solution) -> float:
    """About how many bytes the fields take, rather too many: points, cells and values of each file."""
    topology = solution.model.tagged.mesh.topology
    cells = topology.index_map(topology.dim).size_global
    corners = int(solution.model.space.dofmap.list.shape[1])
    text = 4000.0  # about the numbers
    return len(solution.shown_steps) * (text + bytes_of(cells * corners, cells, corners, sum(_COMPONENTS)))


def write_fields(solution: Solution, folder: Path) -> list[str]:
    """Displacement, stresses and shear energy density in one file, with points of its own in each cell, as raw stresses
    jump; collective.

    With load steps there is one file for each with a solution, and their list with their times.  The stress is a tensor
    with nine components, which ParaView takes for one, in 2D too.

    Returns:
        Names of the files.
    """
    if not solution.statement.several_steps:
        write_vtu(folder / VTU, solution.comm, *_grid(solution.at(solution.last_step)))
        return [VTU]
    parallel.on_root(solution.comm, lambda: (folder / VTU_FOLDER).mkdir())
    rows = []
    for step in solution.shown_steps:
        name = f"{VTU_FOLDER}/{step.step:04d}.vtu"
        write_vtu(folder / name, solution.comm, *_grid(solution.at(step)))
        rows.append(f'<DataSet timestep="{step.time!r}" file="{name}"/>')
    text = "\n".join(['<VTKFile type="Collection" version="1.0"><Collection>', *rows, "</Collection></VTKFile>", ""])
    parallel.on_root(solution.comm, lambda: (folder / VTU_STEPS).write_text(text, encoding="utf-8"))
    return [VTU_STEPS]


def _grid(moment: Solution) -> tuple[Array, Array, int, dict[str, Array]]:
    """Points, cells, their kind, and the fields at the points of the cells that this rank owns, see ``write_vtu``."""
    fields = fields_in_cells(moment)
    space = fields["von_mises" if "von_mises" in fields else "displacement"].function_space
    cells, kinds, points = vtk_mesh(space)
    cells = cells.reshape(len(kinds), -1)[:, 1:] if len(kinds) else np.zeros((0, space.dofmap.list.shape[1]), dtype=int)
    # In the order of the cells: each field has degrees of freedom of its own.
    numbers = space.dofmap.list
    order = [list(numbers[0]).index(number) for number in cells[0]] if len(cells) else []
    values = {}
    for name, function in fields.items():
        at_nodes = function.x.array.reshape(-1, function.function_space.dofmap.index_map_bs)
        at_points = at_nodes[function.function_space.dofmap.list[: len(cells)][:, order].ravel()]
        if name == "displacement":  # a vector of space, as ParaView expects
            at_points = np.pad(at_points, ((0, 0), (0, 3 - at_points.shape[1])))
        values[name] = at_points[:, 0] if at_points.shape[1] == 1 else at_points
    kind = int(parallel.global_max(moment.comm, float(np.max(kinds, initial=0))))  # a rank may have no cell
    return points[cells.ravel()], np.arange(cells.size).reshape(cells.shape), kind, values


def _fields(solution: Solution) -> dict[str, fem.Function]:
    """Every field under its name; collective."""
    fields = {"displacement": solution.displacement}
    if (stress := solution.known_stress) is None:
        return fields
    fields |= {"stress": stress.tensor, "von_mises": stress.von_mises, "principal_stresses": stress.principal}
    if stress.stress.shear_modulus is not None:
        fields["density"] = stress.shear_energy_density
    if stress.plastic_strain is not None:
        fields["plastic_strain"] = stress.plastic_strain
    # The same fields in all load steps: those of recovery need finite values, which only a failed first step lacks.
    if stress.recovers and not parallel.any_rank(solution.comm, not np.isfinite(solution.displacement.x.array).all()):
        fields |= {"recovered_stress": stress.recovered.tensor, "recovered_von_mises": stress.recovered.von_mises}
    return fields


def fields_in_cells(solution: Solution) -> dict[str, fem.Function]:
    """Every field under its name, in discontinuous functions of the degree of the element; collective."""
    return {name: _in_cells(solution, function, name) for name, function in _fields(solution).items()}


def _in_cells(solution: Solution, function: fem.Function, name: str) -> fem.Function:
    """A field in the discontinuous functions of the degree of the element, which all fields of a data set share."""
    model = solution.model
    degree, shape = model.space.element.basix_element.degree, function.ufl_shape
    element = ("DG", degree, shape) if shape else ("DG", degree)
    interpolated = fem.Function(fem.functionspace(model.tagged.mesh, element), name=name)
    interpolated.interpolate(function)
    return interpolated
