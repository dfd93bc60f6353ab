"""Mesh generators.

A generator is a function ``generate(comm, /, *, ...) -> TaggedMesh``; its keyword arguments are the ``mesh.parameters``
of a scene.  Those of this package are the functions of this name in its modules; other installed packages add theirs as
entry points of the group ``signorini_fx.generators``.  The decorator ``generator`` says what a nested iteration and
adaptive refinement need to know.  Outlines and solids that several of them draw are in ``mesh.drawing``.

Bodies in 3D have the axis x[2] upwards and the foundation below.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from signorini_fx.errors import SceneError
from signorini_fx.mechanics.statement.generators import Count, Length, generator, refuse
from signorini_fx.tuned import BYTES_PER_DOF

if TYPE_CHECKING:
    from mpi4py import MPI

__all__ = ["Count", "Length", "generator", "refuse", "refuse_too_large"]


def refuse_too_large(comm: MPI.Comm, blocks: int, cell: str) -> None:
    """Refuse a grid of quadrilaterals or hexahedra, perhaps cut into simplices, before it is made, by a ``SceneError``
    if mesh and stiffness alone would take more memory than the machines have; collective.
    """
    from signorini_fx.machine import parallel

    cells = blocks * {"triangle": 2, "tetrahedron": 6}.get(cell, 1)
    wanted, available = BYTES_PER_DOF * cells, parallel.machine_memory(comm)
    if wanted > available:
        message = f"about {cells:.2g} cells would need {wanted / 1e9:.0f} GB or more, there are {available / 1e9:.0f}"
        raise SceneError([("mesh.parameters", f"{message}: use fewer and larger cells")])
