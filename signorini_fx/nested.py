"""Nested iteration: the contact state of a coarse mesh starts the iteration on the next finer one.

The active sets are what the semi-smooth Newton method has to find, and they hardly depend on the mesh: a node of the
fine mesh begins in the set of the nearest coarse node.  On every mesh but the coarsest two to four linear solves are
left.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from signorini_fx import parallel
from signorini_fx.boundary import ContactBoundary
from signorini_fx.complementarity import ActiveSets, Nodal
from signorini_fx.mesh import coarser_parameters
from signorini_fx.quantities import ContactState
from signorini_fx.scene import MeshGenerator, Scene


@dataclass(frozen=True)
class LevelRecord:
    """What one mesh of a nested iteration took.

    Attributes:
        level: its number, the coarsest is 0.
        dofs: unknowns.
        linear_solves: linear solves on this mesh.
        factorisations: of them with a new factorisation.
        seconds: wall time of everything on this mesh, on this rank.
        status: how it ended.
    """

    level: int
    dofs: int
    linear_solves: int
    factorisations: int
    seconds: float
    status: str


def coarser_scenes(scene: Scene, levels: int) -> list[Scene]:
    """The scene on ``levels - 1`` coarser meshes, each with elements twice as large as the next, coarsest first.

    Raises:
        SceneError: the scene's mesh does not come from a generator that can make coarser ones.
    """
    if levels == 1:
        return []
    assert isinstance(scene.mesh, MeshGenerator)
    generator = scene.mesh.generator
    meshes = [
        MeshGenerator(generator=generator, parameters=coarser_parameters(generator, scene.mesh.parameters, 2**k))
        for k in range(levels - 1, 0, -1)
    ]
    return [scene.model_copy(update={"mesh": mesh}) for mesh in meshes]


def carry_over(coarse: ContactState, fine: ContactBoundary) -> tuple[ActiveSets, tuple[Nodal, Nodal]]:
    """Sets and (lambda, mu) for the nodes of a finer mesh, from the nearest coarse nodes; collective."""
    boundary = coarse.boundary
    rows = parallel.gather_rows(
        boundary.comm,
        np.column_stack((boundary.part, boundary.x, coarse.in_contact, coarse.slip, coarse.pressure, coarse.shear)),
    )
    contact = np.zeros(fine.size, dtype=bool)
    slip = np.zeros(fine.size, dtype=np.int8)
    pressure, shear = np.zeros(fine.size), np.zeros(fine.size)
    for part in np.unique(fine.part):
        here, there = fine.part == part, rows[rows[:, 0] == part]
        _, nearest = cKDTree(there[:, 1:3]).query(fine.x[here])
        contact[here] = there[nearest, 3] > 0
        slip[here] = there[nearest, 4]
        pressure[here], shear[here] = there[nearest, 5], there[nearest, 6]
    return ActiveSets(contact, slip), (pressure, shear)
