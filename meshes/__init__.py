"""Mesh generators.

Each module has ``generate(comm, *, ...) -> TaggedMesh``; its keyword arguments are the ``mesh.parameters`` of a scene.
With ``coarser(parameters, factor)`` it can take part in a nested iteration.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import AfterValidator

from signorini_fx.errors import SceneError

if TYPE_CHECKING:
    from mpi4py import MPI

_LARGEST = 1e100  # its square is still a number


def _length(given: float) -> float:
    if not 1 / _LARGEST < given < _LARGEST:
        raise ValueError(f"a positive length below {_LARGEST:g} is wanted, got {given:g}")
    return given


Length = Annotated[float, AfterValidator(_length)]
# What a cell takes at least until its body is solved: the mesh, the stiffness and the Jacobian.
_BYTES_PER_CELL = 1000.0


def refuse_too_large(comm: MPI.Comm, cells: float) -> None:
    """Refuse a mesh that the machines cannot hold, before it is begun; collective.

    Args:
        comm: the ranks that will share the mesh.
        cells: how many it will have, about.

    Raises:
        SceneError: mesh and stiffness alone would take more memory than there is.
    """
    from signorini_fx import parallel

    wanted, there = _BYTES_PER_CELL * cells, parallel.machine_memory(comm)
    if wanted > there:
        message = f"about {cells:.2g} cells would need {wanted / 1e9:.0f} GB or more, there are {there / 1e9:.0f}"
        raise SceneError([("mesh.parameters", f"{message}: use fewer and larger cells")])


def cells_of_grid(nx: int, ny: int, cell: str) -> int:
    """How many cells a grid of nx by ny quadrilaterals has, cut into two triangles or not."""
    return nx * ny * (2 if cell == "triangle" else 1)


def coarser_grid(generate: Callable[..., Any], parameters: dict[str, Any], factor: float) -> dict[str, Any]:
    """The parameters with the counts nx and ny divided by ``factor``, at least 1."""
    defaults = inspect.signature(generate).parameters
    counts = {name: parameters.get(name, defaults[name].default) for name in ("nx", "ny")}
    return parameters | {name: max(1, round(count / factor)) for name, count in counts.items()}
