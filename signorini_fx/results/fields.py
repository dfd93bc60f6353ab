"""The fields of a result for ParaView: displacement, raw and recovered stresses, shear energy density."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import numpy as np
from dolfinx import fem, io

from signorini_fx import compat, parallel
from signorini_fx.errors import InstallationError
from signorini_fx.results.solution import Solution

FORMATS = ("vtx", "vtu")
# The folder of the files of VTU, whose number and names depend on the ranks.
VTU = "vtu"
_BYTES_PER_RANK = 200_000  # what ADIOS2 writes about itself, for all files together
_BYTES_OF_A_NUMBER = 25  # in the text that VTU files consist of


def chosen_format(fields: bool | str) -> str | None:
    """The format of the fields: VTX where dolfinx can write it, unless another one is asked for; None: none.

    Args:
        fields: whether to write any, or one of ``FORMATS``.

    Raises:
        ValueError: there is no such format.
        InstallationError: dolfinx cannot write it.
    """
    if isinstance(fields, bool):
        return ("vtx" if compat.has_vtx() else "vtu") if fields else None
    if fields not in FORMATS:
        raise ValueError(f"fields: True, False, {' or '.join(map(repr, FORMATS))} is expected, got {fields!r}")
    if fields == "vtx" and not compat.has_vtx():
        raise InstallationError("this dolfinx has no ADIOS2, which fields in the format vtx need; take vtu")
    return fields


def size_of_fields(solution: Solution, kind: str) -> float:
    """About how many bytes the fields take, rather too many: points, cells and values of each file."""
    d = solution.discretisation
    topology = d.tagged.mesh.topology
    cells = topology.index_map(topology.dim).size_global
    corners = int(d.space.dofmap.list.shape[1])
    if kind == "vtu":
        return len(solution.shown_steps) * cells * corners * (3 + 3 + 9 + 3 + 1 + 1 + 9 + 1 + 3) * _BYTES_OF_A_NUMBER
    cell = 8 * (corners + 1)
    continuous = d.dofs // d.tagged.mesh.geometry.dim * (2 * 3 * 8 + 9) + cells * cell
    broken = sum(cells * (corners * (3 * 8 + 8 * components + 9) + cell) for components in (9, 3, 1, 1, 9, 1))
    return len(solution.shown_steps) * (continuous + broken) + _BYTES_PER_RANK * solution.comm.size


def write_fields(solution: Solution, folder: Path, kind: str) -> list[str]:
    """Displacement, stresses and shear energy density; collective.

    With load steps each file has all of those with a solution, at their times.  The stress is a tensor with nine
    components, which ParaView takes for one, in the plane too.

    Args:
        solution: what to write.
        folder: where.
        kind: ``vtx``: a folder of ADIOS2 for each field; ``vtu``: all of them in one data set with points of its own in
            each cell.

    Returns:
        Names of the files.
    """
    moments = [solution.at(step) for step in solution.shown_steps]
    times = [step.time for step in solution.shown_steps] if solution.scene.several_steps else [0.0]
    written = _fields(moments[0], kind)
    with ExitStack() as stack:
        write: list[Callable[[float], object]] = []
        if kind == "vtx":
            files = [f"{name}.bp" for name in written]
            for file, function in zip(files, written.values(), strict=True):
                write.append(
                    stack.enter_context(io.VTXWriter(solution.comm, folder / file, [function], engine="BP4")).write
                )
        else:
            files = [f"{VTU}/fields.pvd"]
            parallel.on_root(solution.comm, lambda: (folder / VTU).mkdir())
            data = stack.enter_context(io.VTKFile(solution.comm, folder / files[0], "w"))
            write.append(lambda time: data.write_function(list(written.values()), time))
        for moment, time in zip(moments, times, strict=True):
            for name, function in _fields(moment, kind).items():
                written[name].x.array[:] = function.x.array
            for write_step in write:
                write_step(time)
    return files


def _fields(solution: Solution, kind: str) -> dict[str, fem.Function]:
    """Every field under its name; in functions of their own, which may be overwritten."""
    stress = solution.stress
    fields = {
        "displacement": solution.displacement,
        "stress": stress.tensor,
        "von_mises": stress.von_mises,
        "principal_stresses": stress.principal,
        "density": stress.shear_energy_density,
    }
    # The same fields in all load steps: those of recovery need finite values, which only a failed first step lacks.
    values = solution.displacement.x.array
    if not parallel.any_rank(solution.comm, not np.isfinite(values).all()):
        fields |= {"recovered_stress": stress.recovered.tensor, "recovered_von_mises": stress.recovered.von_mises}
    if kind == VTU:
        return {name: _in_cells(solution, function, name) for name, function in fields.items()}
    displacement = fem.Function(solution.displacement.function_space, name=solution.displacement.name)
    displacement.x.array[:] = values
    return fields | {"displacement": displacement}


def fields_in_cells(solution: Solution) -> dict[str, fem.Function]:
    """Every field under its name, in discontinuous functions of the degree of the element; collective."""
    return _fields(solution, VTU)


def _in_cells(solution: Solution, function: fem.Function, name: str) -> fem.Function:
    """A field in the discontinuous functions of the degree of the element, which all fields of a data set share."""
    d = solution.discretisation
    degree, shape = max(solution.scene.element.degree, 1), function.ufl_shape
    element = ("DG", degree, shape) if shape else ("DG", degree)
    interpolated = fem.Function(fem.functionspace(d.tagged.mesh, element), name=name)
    interpolated.interpolate(function)
    return interpolated
