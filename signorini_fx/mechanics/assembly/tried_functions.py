"""Functions of a user, tried on all ranks before anything waits for another rank."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.errors import SceneError
from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.assembly.mesh_entities import facet_vertices
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.statement.expressions import Expression, sample
from signorini_fx.mechanics.statement.point_values import PointValues
from signorini_fx.mechanics.statement.statement import Statement


def try_functions(statement: Statement, tagged: TaggedMesh) -> None:
    """Evaluate the functions of loads, supports and materials once at the nodes of what they act on; collective.

    An error that one rank alone raises in the middle of a solve leaves the others waiting for ever.  Gaps and friction
    are evaluated together anyway.

    Raises:
        SceneError: some function cannot be evaluated on some rank, or gives no real number for each point.
    """
    functions = [
        (f"{path}.{key}", entry, value)
        for path, entry in statement.listed()
        for key, value in _values(entry)
        if callable(value) and not isinstance(value, Expression | PointValues) and not hasattr(value, "ufl_shape")
    ]
    if not functions:
        return
    problems = []
    for path, entry, function in functions:
        x = _points(entry, tagged)
        try:
            if x.size:
                sample(function, x)
        except Exception as failure:  # whatever a function of a user raises
            problems.append((path, f"cannot be evaluated at points of shape (3, {x.shape[1]}): {failure}"))
    parallel.raise_together(tagged.mesh.comm, SceneError(problems) if problems else None)


def _values(entry: Any) -> Iterator[tuple[str, Any]]:
    """What an entry gives as values of the position, by keys."""
    yield from getattr(entry, "given", {}).items()
    for key in ("grading", "poisson_grading"):
        yield key, getattr(entry, key, None)
    for key in ("direction", "second"):  # axes of a material
        axis = getattr(entry, key, None)
        for component in axis if isinstance(axis, tuple) else ():
            yield key, component


def _points(entry: Any, tagged: TaggedMesh) -> npt.NDArray[np.float64]:
    """Nodes of this rank on the boundary or in the region of an entry, or of the whole mesh, shape (3, n)."""
    mesh, boundary, region = tagged.mesh, getattr(entry, "boundary", None) or "", getattr(entry, "region", None) or ""
    if boundary in tagged.boundaries:
        return np.ascontiguousarray(facet_vertices(mesh, tagged.facets(boundary)).reshape(-1, 3).T)
    if region in tagged.regions:
        return np.ascontiguousarray(mesh.geometry.x[np.unique(compat.geometry_cells(mesh)[tagged.cells(region)])].T)
    return np.ascontiguousarray(mesh.geometry.x.T)
