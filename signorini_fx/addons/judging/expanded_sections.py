"""Displacements of bodies of revolution as CalculiX prints them.

CalculiX expands a section into a layer of elements between the angles -1 and 1 degree.  What it prints at a node of the
section is the mean of the displacement along the radius of the section over the nodes of the layer: of corners of
quadratic elements by Simpson's rule, of all others over both faces, where it is the cosine of a degree times the radial
one (``map3dto1d2d_v.f``).  Nodes between corners move by 1e-4 less beside corners than they do, which bends thin cells.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from signorini_fx.addons.judging.foreign_result import ForeignResult
from signorini_fx.addons.judging.problem_data import JudgedProblem

_PROGRAM = "CalculiX"
_FACE = np.cos(np.radians(1.0))


def radial_means(problem: JudgedProblem) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """What CalculiX prints of a radial displacement of one at each node, shape (n,)."""
    mesh = problem.mesh
    means = np.full(len(mesh.points), _FACE)
    if mesh.element.degree == 2:
        corners = 3 if mesh.kind.startswith("triangle") else 4
        means[np.unique(mesh.cells[:, :corners])] = (2.0 + _FACE) / 3.0
    return means


def as_they_move(theirs: ForeignResult, problem: JudgedProblem) -> ForeignResult | None:
    """The result with the radial displacements that CalculiX has printed so; None: it is of another program, or no body
    of revolution.
    """
    if problem.hypothesis != "axisymmetric" or not theirs.program.startswith(_PROGRAM):
        return None
    share = np.column_stack((radial_means(problem), np.ones(len(problem.mesh.points))))
    start = None if theirs.step_start is None else theirs.step_start / share
    return replace(theirs, displacement=theirs.displacement / share, step_start=start)
