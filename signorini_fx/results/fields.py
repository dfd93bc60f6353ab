"""The fields of a result for ParaView: displacement, stresses, shear energy density."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path

from dolfinx import fem, io

from signorini_fx import compat
from signorini_fx.body.material import shear_energy_density
from signorini_fx.results.interpolation import interpolated
from signorini_fx.results.solution import Solution

_BYTES_PER_RANK = 200_000  # what ADIOS2 writes about itself, for all files together


def size_of_fields(solution: Solution) -> float:
    """About how many bytes the fields take, rather too many: points, cells and values of each file."""
    d = solution.discretisation
    topology = d.tagged.mesh.topology
    cells = topology.index_map(topology.dim).size_global
    corners = int(d.space.dofmap.list.shape[1])
    cell = 8 * (corners + 1)
    continuous = d.dofs // d.tagged.dimension * (2 * 3 * 8 + 9) + cells * cell
    broken = sum(cells * (corners * (3 * 8 + 8 * components + 9) + cell) for components in (9, 3, 1, 1))
    return len(solution.shown_steps) * (continuous + broken) + _BYTES_PER_RANK * solution.comm.size


def write_fields(solution: Solution, folder: Path) -> list[str]:
    """Displacement, stresses and shear energy density: VTX (ADIOS2), else the displacement as XDMF; collective.

    With load steps each file has all of those with a solution, at their times.  The stress is a tensor with nine
    components, which ParaView takes for one, in the plane too.

    Returns:
        Names of the files.
    """
    moments = [solution.at(step) for step in solution.shown_steps]
    times = [step.time for step in solution.shown_steps] if solution.scene.several_steps else [0.0]
    if compat.has_vtx():
        written = _fields(moments[0])
        with ExitStack() as stack:
            files = {
                name: stack.enter_context(io.VTXWriter(solution.comm, folder / f"{name}.bp", [function], engine="BP4"))
                for name, function in written.items()
            }
            for moment, time in zip(moments, times, strict=True):
                for name, function in _fields(moment).items():
                    written[name].x.array[:] = function.x.array
                    files[name].write(time)
        return [f"{name}.bp" for name in written]
    mesh = solution.discretisation.tagged.mesh
    nodal = fem.Function(
        fem.functionspace(mesh, ("Lagrange", 1, (solution.discretisation.tagged.dimension,))), name="displacement"
    )
    with io.XDMFFile(solution.comm, folder / "fields.xdmf", "w") as file:
        file.write_mesh(mesh)
        for moment, time in zip(moments, times, strict=True):
            nodal.interpolate(moment.displacement)
            file.write_function(nodal, time)
    return ["fields.xdmf", "fields.h5"]


def _fields(solution: Solution) -> dict[str, fem.Function]:
    """Every field under the name of its file; of functions of their own, which may be overwritten."""
    found = solution.stress
    displacement = fem.Function(solution.displacement.function_space, name=solution.displacement.name)
    displacement.x.array[:] = solution.displacement.x.array
    return {
        "displacement": displacement,
        "stress": found.tensor,
        "von_mises": found.von_mises,
        "principal_stresses": found.principal,
        "density": _density(solution),
    }


def _density(solution: Solution) -> fem.Function:
    """The shear energy density, discontinuous, of the degree of the element."""
    d = solution.discretisation
    degree = max(solution.scene.element.degree, 1)
    density = shear_energy_density(solution.displacement, *d.lame, solution.scene.material[0].hypothesis)
    return interpolated(density, fem.functionspace(d.tagged.mesh, ("DG", degree)), "shear_energy_density")
