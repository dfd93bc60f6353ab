"""Values of a solution at points of its cells, as pictures need them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import basix
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem

from signorini_fx import compat
from signorini_fx.body.material import shear_energy_density
from signorini_fx.report.fields import FROM_STRESS
from signorini_fx.results.interpolation import interpolated
from signorini_fx.results.solution import Solution

Floats = npt.NDArray[np.float64]
# Corners of a triangle and of a quadrilateral as basix numbers them, in order along the perimeter.
PERIMETER = {3: [0, 1, 2], 4: [0, 1, 3, 2]}
# Straight pieces that stand for a side that may be curved.
_PIECES = 4


def pieces(solution: Solution) -> int:
    """How many straight pieces a side of a deformed cell is drawn with: 1 if it stays straight."""
    d = solution.discretisation
    curved = compat.geometry_degree(d.tagged.mesh) > 1 or d.scene.element.degree > 1
    return _PIECES if curved else 1


def perimeter(corners: Floats, count: int) -> Floats:
    """Points around a polygon with corners in order, shape (k, d): each corner, then the others along its side."""
    share = np.arange(count)[:, None] / count
    ahead = np.roll(corners, -1, axis=0) - corners
    return np.asarray((corners[:, None] + share * ahead[:, None]).reshape(-1, corners.shape[1]))


def positions(solution: Solution, points: Floats, cells: npt.NDArray[np.int32]) -> Floats:
    """Reference points in cells of this rank, shape (cells, points, d)."""
    mesh = solution.discretisation.tagged.mesh
    basis = _basis(compat.geometry_element(mesh), points)
    nodes = compat.geometry_cells(mesh)[cells]
    return np.asarray(np.einsum("pk,ckx->cpx", basis, mesh.geometry.x[nodes][..., : mesh.geometry.dim]))


def values_at(function: fem.Function, points: Floats, cells: npt.NDArray[np.int32]) -> Floats:
    """A Lagrange function at reference points in cells of this rank, shape (cells, points, components)."""
    space = function.function_space
    basis = _basis(space.element.basix_element, points)
    nodal = function.x.array.reshape(-1, space.dofmap.bs)[space.dofmap.list[cells]]
    return np.asarray(np.einsum("pk,ckx->cpx", basis, nodal))


def _basis(element: Any, points: Floats) -> Floats:
    return np.asarray(element.tabulate(0, np.ascontiguousarray(points))[0]).reshape(len(points), -1)


def cell_values(solution: Solution, cells: npt.NDArray[np.int32], fields: Sequence[str] = ()) -> dict[str, Floats]:
    """Values at the midpoints of cells of this rank, in their order; collective.

    Args:
        solution: where from.
        cells: local numbers, shape (n,).
        fields: names in ``report.fields.FIELDS``; only what they need is computed.

    Returns:
        ``von_mises`` and ``density``, shape (n,), and if needed ``displacement``, its size, shape (n,), and ``stress``,
        shape (n, 3, 3).
    """
    d = solution.discretisation
    mesh = d.tagged.mesh
    density = shear_energy_density(solution.displacement, *d.lame, solution.scene.material[0].hypothesis)
    both = ufl.as_vector((density, ufl.sqrt(6 * d.lame[1] * density)))
    constant = interpolated(both, fem.functionspace(mesh, ("DG", 0, (2,))))
    rows = constant.x.array.reshape(-1, 2)[constant.function_space.dofmap.list[cells, 0]]
    found: dict[str, Floats] = {"density": rows[:, 0], "von_mises": rows[:, 1]}
    middle = basix.geometry(getattr(basix.CellType, mesh.topology.cell_name())).mean(axis=0)[None]
    if "displacement" in fields:
        found["displacement"] = np.linalg.norm(values_at(solution.displacement, middle, cells)[:, 0], axis=1)
    if any(name in FROM_STRESS for name in fields):
        found["stress"] = values_at(solution.stress.tensor, middle, cells).reshape(-1, 3, 3)
    return found
