"""Mesh generators.

Each module has ``generate(comm, *, ...) -> TaggedMesh``; its keyword arguments are the ``mesh.parameters`` of a scene.
With ``coarser(parameters, factor)`` it can take part in a nested iteration; with ``triangles(parameters)``, for bodies
with straight sides, its cells can be divided where the error is, as an accuracy asks for.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any


def coarser_grid(generate: Callable[..., Any], parameters: dict[str, Any], factor: float) -> dict[str, Any]:
    """The parameters with the counts nx and ny divided by ``factor``, at least 1."""
    defaults = inspect.signature(generate).parameters
    counts = {name: parameters.get(name, defaults[name].default) for name in ("nx", "ny")}
    return parameters | {name: max(1, round(count / factor)) for name, count in counts.items()}
