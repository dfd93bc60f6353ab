"""Values of a solution at points of its cells, as pictures need them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import basix
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem

from signorini_fx.addons.pictures.fields import FROM_STRESS
from signorini_fx.machine import compat, parallel
from signorini_fx.results.interpolation import interpolated
from signorini_fx.results.solution import Solution

Floats = npt.NDArray[np.float64]
# Corners of a triangle and of a quadrilateral as basix numbers them, in order along the perimeter.
PERIMETER = {3: [0, 1, 2], 4: [0, 1, 3, 2]}
# Straight pieces that stand for a side that may be curved; and of a whole picture, to the square.
_PIECES = 4
_MOST_POINTS = 100_000


def pieces(solution: Solution, polygons: int = 1) -> int:
    """How many straight pieces a side of a deformed cell is drawn with: 1 if it stays straight.

    Args:
        solution: of what.
        polygons: how many are drawn; of very many none is so large that its sides look curved.
    """
    model = solution.model
    curved = compat.geometry_degree(model.tagged.mesh) > 1 or model.space.element.basix_element.degree > 1
    return max(1, min(_PIECES, math.isqrt(_MOST_POINTS // max(polygons, 1)))) if curved else 1


def positions(solution: Solution, points: Floats, cells: npt.NDArray[np.int32]) -> Floats:
    """Reference points in cells of this rank, shape (cells, points, d)."""
    mesh = solution.model.tagged.mesh
    basis = _basis(compat.geometry_element(mesh), points)
    nodes = compat.geometry_cells(mesh)[cells]
    return np.asarray(np.einsum("pk,ckx->cpx", basis, mesh.geometry.x[nodes][..., : mesh.topology.dim]))


def values_at(function: fem.Function, points: Floats, cells: npt.NDArray[np.int32]) -> Floats:
    """A Lagrange function at reference points in cells of this rank, shape (cells, points, components)."""
    space = function.function_space
    basis = _basis(space.element.basix_element, points)
    nodal = function.x.array.reshape(-1, space.dofmap.bs)[space.dofmap.list[cells]]
    return np.asarray(np.einsum("pk,ckx->cpx", basis, nodal))


def _basis(element: Any, points: Floats) -> Floats:
    return np.asarray(element.tabulate(0, np.ascontiguousarray(points))[0]).reshape(len(points), -1)


def recovered_fields(solution: Solution, fields: Sequence[str]) -> dict[str, fem.Function] | None:
    """The fields that can be drawn point by point, as finite element functions; collective.

    Stresses are the recovered ones, which are continuous in each material and may jump from one to another.

    Args:
        solution: where from.
        fields: names in ``pictures.fields.FIELDS``; only what they need is computed.

    Returns:
        By name, with ``stress`` for those that need the tensor; None where nothing can be recovered: of nonlinear
        materials, and from a solution that is not finite.
    """
    if (stress := solution.known_stress) is not None and not stress.recovers:
        return None
    if parallel.any_rank(solution.comm, not np.isfinite(solution.displacement.x.array).all()):
        return None
    functions = {}
    if "von_mises" in fields:
        functions["von_mises"] = solution.stress.recovered.von_mises
    if "density" in fields:
        functions["density"] = solution.stress.recovered.shear_energy_density
    if any(name in FROM_STRESS for name in fields):
        functions["stress"] = solution.stress.recovered.tensor
    for name in ("displacement", "around"):
        if name in fields:
            functions[name] = solution.displacement
    return functions


def values_within(name: str, function: fem.Function, points: Floats, cells: npt.NDArray[np.int32]) -> Floats:
    """One of those fields at reference points in cells of this rank, in the order of the cells.

    Returns:
        The ``stress`` with shape (cells, points, 3, 3), of a ``displacement`` its size and of that ``around`` the axis
        the third component, any other as it is, with shape (cells, points).
    """
    values = values_at(function, points, cells)
    if name == "stress":
        return values.reshape(*values.shape[:2], 3, 3)
    return np.asarray(np.linalg.norm(values, axis=2) if name == "displacement" else values[..., 2 * (name == "around")])


def cell_values(solution: Solution, cells: npt.NDArray[np.int32], fields: Sequence[str] = ()) -> dict[str, Floats]:
    """Values at the midpoints of cells of this rank, in their order; collective.

    Args:
        solution: where from.
        cells: local numbers, shape (n,).
        fields: names in ``pictures.fields.FIELDS``; only what they need is computed.

    Returns:
        ``von_mises`` and ``density``, shape (n,), and if needed ``displacement``, its size, and ``around``, its third
        component, shape (n,), and ``stress``, shape (n, 3, 3).
    """
    model = solution.model
    mesh = model.tagged.mesh
    values: dict[str, Floats] = {}
    if (stresses := solution.known_stress) is not None:
        stress = stresses.stress
        deviator = ufl.dev(stress.in_space)
        square, mu = ufl.inner(deviator, deviator), stress.shear_modulus
        # The density has the gray tones of Figures 2 and 6 of the paper.
        densities = {} if mu is None else {"density": square / (4 * mu)}
        wanted = densities | {"von_mises": ufl.sqrt(1.5 * square)}
        space = fem.functionspace(mesh, ("DG", 0, (len(wanted),)))
        constant = interpolated(ufl.as_vector(list(wanted.values())), space)
        rows = constant.x.array.reshape(-1, len(wanted))[constant.function_space.dofmap.list[cells, 0]]
        values |= dict(zip(wanted, rows.T, strict=True))
    middle = basix.geometry(getattr(basix.CellType, mesh.topology.cell_name())).mean(axis=0)[None]
    for name in ("displacement", "around"):
        if name in fields:
            values[name] = values_within(name, solution.displacement, middle, cells)[:, 0]
    if any(name in FROM_STRESS for name in fields):
        values["stress"] = values_at(solution.stress.tensor, middle, cells).reshape(-1, 3, 3)
    return values
