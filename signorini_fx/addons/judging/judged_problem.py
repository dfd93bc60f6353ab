"""The problem that a result is judged against: a scene on a mesh whose nodes have the numbers of the result."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded
import numpy as np
from mpi4py import MPI

from signorini_fx.addons.decks.draft import draft
from signorini_fx.mechanics.mesh.files.arrays import MeshArrays
from signorini_fx.mechanics.mesh.files.cells import Floats, Ints
from signorini_fx.mechanics.mesh.halving import quadratic
from signorini_fx.mechanics.mesh.tagged import arrays_of, check_fits
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import as_scene, parse_scene_text
from signorini_fx.scenes.scene import Scene


@dataclass(frozen=True)
class JudgedProblem:
    """A problem: what is stated, on a mesh with the nodes of its elements."""

    scene: Scene
    arrays: MeshArrays
    names: Ints  # the numbers of the nodes that a result has, which are the first ones of the mesh, shape (n,)
    lost: tuple[str, ...] = ()  # what the scene lacks of its input file
    time: float | None = None  # at the end of the last load step; None: not known

    @property
    def unjudged(self) -> str:
        """What of it cannot be judged, in words; "": nothing."""
        scene, element = self.scene, self.scene.element
        reasons = {
            "materials that are not linear are not judged": scene.statement.nonlinear,
            "elements with a pressure of their own are not judged": element.volumetric == "mixed",
            "elements of degree 1 on cells of degree 2 are not judged: set element.degree = 2": element.degree
            < self.arrays.degree,
            "displacements out of the section are not judged": scene.statement.kinematics.out_of_section,
            "sections inside a body, such as those of bolts, are not judged": scene.statement.sections,
            "rigid bodies that forces move are not judged": any(entry.tool is not None for entry in scene.contact),
        }
        return "; ".join(reason for reason, there in reasons.items() if there)

    @property
    def points(self) -> Floats:
        """Positions of the nodes that a result has, length, shape (n, d)."""
        return self.arrays.points[: len(self.names)]

    @property
    def cells(self) -> Ints:
        """Of each cell the nodes that a result has, shape (m, k)."""
        cells = self.arrays.cells
        return cells[:, (cells < len(self.names)).all(axis=0)]


def judged_problem(problem: object) -> JudgedProblem:
    """The problem of an input file or of a scene, as ``judge`` takes it."""
    if isinstance(problem, str | Path) and Path(problem).suffix.lower() == ".inp":
        return _of_deck(Path(problem))
    scene = as_scene(problem)
    mesh = load_mesh(scene, MPI.COMM_SELF)
    check_fits(scene.statement, mesh)
    arrays = arrays_of(mesh)
    if scene.element.degree > arrays.degree:
        arrays = quadratic(arrays)
    names = np.arange(1, len(arrays.points) + 1)
    contacts = [contact.model_copy(update={"contact_size": None}) for contact in scene.contact]  # cells are made
    scene = scene.model_copy(update={"contact": contacts})
    return JudgedProblem(scene, arrays, names)


def _of_deck(file: Path) -> JudgedProblem:
    drafted = draft(file, file)
    scene, deck = parse_scene_text(drafted.text, file), drafted.deck
    return JudgedProblem(scene, deck.mesh, deck.names, tuple(drafted.lost), deck.time + deck.period)
