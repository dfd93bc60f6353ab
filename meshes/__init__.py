"""Mesh generators.

A generator is a function ``generate(comm, /, *, ...) -> TaggedMesh``; its keyword arguments are the
``mesh.parameters`` of a scene.  Those of this package are the functions of this name in its
modules; other installed packages add theirs as entry points of the group
``signorini_fx.generators``.  The decorator ``generator`` says what a nested iteration and adaptive
refinement need to know.  Outlines and solids that several of them draw are in ``_drawing``.

Bodies in 3D have the axis x[2] upwards and the foundation below.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, NoReturn, TypeVar

from pydantic import Field

from signorini_fx.errors import SceneError
from signorini_fx.mechanics.statement.values import Positive
from signorini_fx.tuned import BYTES_PER_DOF

if TYPE_CHECKING:
    from mpi4py import MPI

Length = Positive
Count = Annotated[int, Field(gt=0, le=20_000)]  # of cells along a line
Generate = TypeVar("Generate", bound=Callable[..., Any])


def generator(
    *,
    counts: Sequence[str] = (),
    sizes: Sequence[str] = (),
    least: Mapping[str, int] | None = None,
    simplices: str | None = None,
) -> Callable[[Generate], Generate]:
    """Say how the mesh of a generator depends on its parameters.

    Without this decorator a generator makes its meshes all the same, but none for a nested
    iteration and none that is refined adaptively.

    Args:
        counts: the parameters that are numbers of cells along a line; cells twice as large need
            half of them.
        sizes: the parameters that are lengths of cells.
        least: the smallest numbers of cells, where these are more than 1.
        simplices: of a body with straight sides and a parameter ``cell`` its value for triangles or
            tetrahedra.
    """

    def decorate(generate: Generate) -> Generate:
        described: Any = generate
        defaults = {
            name: parameter.default
            for name, parameter in inspect.signature(generate).parameters.items()
        }

        def coarser(parameters: Mapping[str, Any], factor: float) -> dict[str, Any]:
            """The parameters for cells that are ``factor`` times as large."""
            all_parameters = {**defaults, **parameters}
            fewer = {
                name: max((least or {}).get(name, 1), round(all_parameters[name] / factor))
                for name in counts
            }
            return {
                **parameters,
                **fewer,
                **{name: factor * all_parameters[name] for name in sizes},
            }

        described.coarser = coarser if counts or sizes else None
        described.simplices = simplices
        described.sized = bool(sizes)
        return generate

    return decorate


def refuse_too_large(comm: MPI.Comm, blocks: int, cell: str) -> None:
    """Refuse a grid of quadrilaterals or hexahedra, perhaps cut into simplices, before it is made,
    by a ``SceneError`` if mesh and stiffness alone would take more memory than the machines have;
    collective.
    """
    from signorini_fx.machine import parallel

    cells = blocks * {"triangle": 2, "tetrahedron": 6}.get(cell, 1)
    wanted = BYTES_PER_DOF * cells
    available = parallel.machine_memory(comm)
    if wanted > available:
        message = (
            f"about {cells:.2g} cells would need {wanted / 1e9:.0f} GB or more, there are "
            f"{available / 1e9:.0f}"
        )
        raise SceneError([("mesh.parameters", f"{message}: use fewer and larger cells")])


def refuse(parameter: str, message: str) -> NoReturn:
    """Raise a ``SceneError`` of a parameter that is not compatible with the others."""
    raise SceneError([(f"mesh.parameters.{parameter}", message)])
