"""Loads that jump inside a facet that is not cut there: quadrature takes a part of their force wrong."""

from __future__ import annotations

from typing import Any

import basix
import numpy as np
import numpy.typing as npt

from signorini_fx import parallel
from signorini_fx.body.assembly import facet_vertices
from signorini_fx.body.discretisation import Discretisation
from signorini_fx.body.quadrature import has_affine_parts
from signorini_fx.records import Finding
from signorini_fx.scene.cut_simplices import exactly_cut
from signorini_fx.scene.effect import Force
from signorini_fx.scene.expressions import Expression, in_space, sample

Array = npt.NDArray[np.float64]

# Share of a load that quadrature may miss without a word.
_LITTLE = 1e-3


def jumping_loads(d: Discretisation) -> list[Finding]:
    """A warning for each load on a boundary of which the rule on its facets misses a part; collective."""
    findings = []
    for path, load in d.scene.listed():
        if not isinstance(load, Force) or load.where is None:
            continue
        x = _simplices(facet_vertices(d.tagged.mesh, d.tagged.facets(load.where)), d.tagged.mesh.topology.cell_name())
        for key, value in d.scene.now(load, 0)[1].given.items():
            if not isinstance(value, Expression):
                continue
            cut_there = value.jumps and bool(load.jumps) and has_affine_parts(d.tagged.mesh, in_body=False)
            missed_here = _missed(x, value, load.degree(d.scene.element.degree), cut_there=cut_there)
            sums = parallel.global_sum(d.comm, missed_here)
            facets, missed, size = (float(total) for total in sums)
            if missed > _LITTLE * size > 0:
                findings.append(
                    Finding(
                        "warning",
                        f"{path}.{key}",
                        f"jumps inside {facets:.0f} facet{'s' * (facets != 1)} of {load.where!r}, where the points of "
                        f"quadrature take {100 * missed / size:.2g} % of it wrong: give the mesh nodes where it jumps, "
                        "or smaller cells there",
                    )
                )
    return findings


def _simplices(x: Array, cell: str) -> Array:
    """Chords or triangles between the vertices of facets, which come before the other nodes, shape (n, k, 3)."""
    if cell == "hexahedron" and x.size:
        return np.concatenate((x[:, :3], x[:, 1:4]))
    return x[:, : 3 if cell == "tetrahedron" else 2]


def _missed(x: Array, value: Any, degree: int, *, cut_there: bool) -> Array:
    """How many simplices are cut, the force that a rule misses on these, and that on all of them, sizes.

    Args:
        x: corners, length, shape (n, k, 3).
        value: of the load.
        degree: of the rule.
        cut_there: whether the rule is one on the parts, where these are known exactly.
    """
    kind = basix.CellType.interval if x.shape[1] == 2 else basix.CellType.triangle
    places, weights = basix.make_quadrature(kind, degree)
    local = np.column_stack((1 - places.sum(axis=1), places))
    weights = weights / weights.sum()
    edges = x[:, 1:] - x[:, :1]
    size = np.linalg.norm(edges[:, 0] if x.shape[1] == 2 else np.cross(edges[:, 0], edges[:, 1]) / 2, axis=1)

    def values(points: Array) -> Array:
        return sample(value, in_space(points.reshape(-1, 3))).reshape(points.shape[:2])

    seen = values(local @ x)
    owner, parts, known = exactly_cut(x, [value])
    share = np.abs(np.linalg.det(parts))
    exact = np.bincount(owner, share * (values(local @ parts @ x[owner]) @ weights), len(x))
    is_cut = (np.bincount(owner, minlength=len(x)) > 1) & ~(known & cut_there)
    missed = np.abs(exact - seen @ weights) * size
    total = float((np.abs(seen) @ weights * size).sum()) + float((np.abs(exact) * size)[is_cut].sum())
    return np.array([np.count_nonzero(is_cut & (missed > _LITTLE * np.abs(exact) * size)), missed[is_cut].sum(), total])
