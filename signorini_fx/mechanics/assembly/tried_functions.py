"""Values of a scene, tried on all ranks before anything waits for another rank."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.errors import SceneError
from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.assembly.mesh_entities import facet_vertices
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.statement.effect import InitialStrain, Resistance
from signorini_fx.mechanics.statement.expressions import Expression, sample
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.tuned import LARGEST_NUMBER


def try_functions(statement: Statement, tagged: TaggedMesh) -> None:
    """Evaluate the functions of loads, supports and materials once at the nodes of what they act on, and look whether
    initial strains are finite in all load steps, and resistances not negative; collective.

    An error that one rank alone raises in the middle of a solve leaves the others waiting for ever.  Gaps and friction
    are evaluated together anyway.

    Raises:
        SceneError: some value cannot be evaluated on some rank, gives no real number for each point, or is a wrong one.
    """
    problems = []
    for path, entry in statement.listed():
        strains, region = isinstance(entry, InitialStrain), getattr(entry, "region", None)
        if strains and region is not None and region not in tagged.regions:
            continue  # said where names are looked at
        for step in range(statement.steps if strains and entry.timed else 1):
            for key, value in _values(entry.at_time(statement.time_at(step)) if strains else entry):
                problems += _problems(f"{path}.{key}", value, entry, tagged)
    parallel.raise_together(tagged.mesh.comm, SceneError(list(dict.fromkeys(problems))) if problems else None)


def _problems(path: str, value: Any, entry: Any, tagged: TaggedMesh) -> list[tuple[str, str]]:
    """What is wrong with a value on this rank."""
    strains, resists = isinstance(entry, InitialStrain), isinstance(entry, Resistance)
    given = callable(value) and not isinstance(value, Expression)
    if value is None or hasattr(value, "ufl_shape") or not (strains or resists or given):
        return []
    # Outside of its region an expression is multiplied by zero.
    x = tagged.mesh.geometry.x.T.astype(np.float64) if strains and not given else _points(entry, tagged)
    try:
        values = sample(value, x) if x.size else np.zeros(0)
    except SceneError as error:  # of a table
        return error.problems
    except Exception as failure:  # whatever a function of a user raises
        return [(path, f"cannot be evaluated at points of shape (3, {x.shape[1]}): {failure}")]
    if strains and not (np.abs(values) <= LARGEST_NUMBER).all():
        return [(path, f"must be a number up to {LARGEST_NUMBER:g} at all nodes of the mesh")]
    if resists and not ((values >= 0) & (values <= LARGEST_NUMBER)).all():
        return [(path, f"must be a number from 0 to {LARGEST_NUMBER:g} everywhere on {entry.where!r}")]
    return []


def _values(entry: Any) -> Iterator[tuple[str, Any]]:
    """What an entry gives as values of the position, by keys."""
    yield from getattr(entry, "given", {}).items()
    yield "grading", getattr(entry, "grading", None)
    for key in ("direction", "second"):  # axes of a material
        axis = getattr(entry, key, None)
        for component in axis if isinstance(axis, tuple) else ():
            yield key, component


def _points(entry: Any, tagged: TaggedMesh) -> npt.NDArray[np.float64]:
    """Nodes of the region of an entry, of its boundary with middles of facets, or of the mesh, shape (3, n)."""
    mesh, boundary, region = tagged.mesh, getattr(entry, "boundary", None) or "", getattr(entry, "region", None) or ""
    if boundary in tagged.boundaries:
        corners = facet_vertices(mesh, tagged.facets(boundary))
        return np.concatenate((corners.reshape(-1, 3), corners.mean(axis=1))).T
    if region in tagged.regions:
        return np.ascontiguousarray(mesh.geometry.x[np.unique(compat.geometry_cells(mesh)[tagged.cells(region)])].T)
    return np.ascontiguousarray(mesh.geometry.x.T)
