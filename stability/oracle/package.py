"""Solves a scene with signorini_fx and returns the results as plain arrays: the only module that imports it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from dolfinx import mesh as dmesh
from mpi4py import MPI

from signorini_fx import compat
from signorini_fx.contact.table import contact_table
from signorini_fx.results.solution import Solution
from signorini_fx.scene.reading import read_scene
from signorini_fx.solving.solver import solve
from stability.oracle.body import Mesh
from stability.oracle.judge import Answer, Step


def solution_of(scene: Path) -> Solution:
    """Solve a scene file on one rank, whatever the outcome."""
    return solve(read_scene(scene), MPI.COMM_SELF, check=False)


def answer_of(solution: Solution) -> Answer:
    """The results as plain arrays."""
    space = solution.displacement.function_space
    names = [effect.boundary for effect in solution.scene.contact]
    tables = [contact_table(step.contact, names) for step in solution.steps if step.contact is not None]
    told = solution.parameters
    return Answer(
        outcome=solution.status.value,
        place=space.tabulate_dof_coordinates()[:, :2].copy(),
        displacement=solution.displacement.x.array.reshape(-1, 2).copy(),
        steps=[
            Step(table.columns, step.certificate.law.regularised)
            for table, step in zip(tables, solution.steps, strict=True)
        ],
        gamma=(told.get("gamma_n", np.inf), told.get("gamma_t", np.inf)),
        events=tuple(map(str, solution.history.events)),
        regularisation_error=told.get("regularisation_error"),
    )


def mesh_of(solution: Solution) -> Mesh:
    """The mesh that was solved on, for scenes whose mesh a generator of the package makes."""
    tagged = solution.discretisation.tagged
    mesh = tagged.mesh
    cells = np.asarray(compat.geometry_cells(mesh), dtype=np.int64)
    mesh.topology.create_connectivity(1, 2)
    boundaries = {}
    for name in tagged.boundaries:
        facets = tagged.facets(name)
        nodes: Any = dmesh.entities_to_geometry(mesh, 1, facets) if facets.size else np.empty((0, 2))
        boundaries[name] = np.asarray(nodes, dtype=np.int64)[:, :2]
    regions = {name: tagged.cells(name).astype(np.int64) for name in tagged.regions}
    return Mesh(mesh.geometry.x[:, :2].copy(), cells, boundaries, regions)
