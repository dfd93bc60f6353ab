"""Solves a scene with signorini_fx and returns the results as plain arrays: the only module that
imports it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from dolfinx import mesh as dmesh
from mpi4py import MPI

from benchmarks.stability.oracle.body import Mesh, behind
from benchmarks.stability.oracle.judge import Answer, Step
from benchmarks.stability.oracle.units import Units, same
from signorini_fx.machine import compat
from signorini_fx.mechanics.contact_points.contact_table import contact_table
from signorini_fx.results.solution import Solution
from signorini_fx.scenes.reading import read_scene
from signorini_fx.scenes.solver import solve

_CORNERS = {"triangle": 3, "quadrilateral": 4, "tetrahedron": 4, "hexahedron": 8}


def solution_of(scene: Path) -> Solution:
    """Solve a scene file on one rank, whatever the outcome."""
    return solve(read_scene(scene), MPI.COMM_SELF, check=False)


def answer_of(solution: Solution, units: Units | None = None) -> Answer:
    """The results as plain arrays, taken back from the units of the scene to those of the body."""
    space = solution.displacement.function_space
    dimension = space.mesh.geometry.dim
    units = units or same(dimension)
    shown = [*(step.displacement for step in solution.steps[:-1]), solution.displacement]
    names = [effect.boundary for effect in solution.statement.contact]
    tables = [
        contact_table(step.contact, names) for step in solution.steps if step.contact is not None
    ]
    told = solution.parameters
    stiffness = units.of((-1, 1))
    place = space.tabulate_dof_coordinates()[:, :dimension]
    corners = space.mesh.topology.cell_name()
    return Answer(
        outcome=solution.status.value,
        place=place / units.length,
        behind=behind(place, space.dofmap.list, _CORNERS[corners]) / units.length,
        steps=[
            Step(
                displacement.x.array.reshape(-1, dimension) / units.length,
                units.table(table.columns),
                step.certificate.law.regularised,
            )
            for displacement, table, step in zip(shown, tables, solution.steps, strict=True)
        ],
        gamma=(told.get("gamma_n", np.inf) / stiffness, told.get("gamma_t", np.inf) / stiffness),
        events=tuple(map(str, solution.history.events)),
        regularisation_error=told.get("regularisation_error"),
    )


def mesh_of(solution: Solution, units: Units | None = None) -> Mesh:
    """The mesh that was solved on, for scenes whose mesh a generator of the package makes."""
    tagged = solution.model.tagged
    mesh, dimension = tagged.mesh, tagged.dimension
    cells = np.asarray(compat.geometry_cells(mesh), dtype=np.int64)
    mesh.topology.create_connectivity(dimension - 1, dimension)
    corners = (
        dimension
        if mesh.topology.cell_name() in ("triangle", "tetrahedron")
        else 2 ** (dimension - 1)
    )
    boundaries = {}
    for name in tagged.boundaries:
        facets = tagged.facets(name)
        nodes: Any = (
            dmesh.entities_to_geometry(mesh, dimension - 1, facets)
            if facets.size
            else np.empty((0, corners))
        )
        boundaries[name] = np.asarray(nodes, dtype=np.int64)[:, :corners]
    regions = {name: tagged.cells(name).astype(np.int64) for name in tagged.regions}
    length = (units or same(dimension)).length
    return Mesh(mesh.geometry.x[:, :dimension] / length, cells, boundaries, regions)
