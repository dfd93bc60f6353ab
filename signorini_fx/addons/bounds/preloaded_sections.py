"""What preloaded sections add to the strain of a displacement: their sides are apart by a jump that is known.

With the unit vector n across a section and its shortening s the displacement is that of the elements, which is
continuous, less s n in all cells beyond the section; ``body.jumps`` takes it from the nodes on the section in the cells
beyond it that have such nodes, which is the same function but for a continuous one of the elements.  The jump is the
same for all displacements that are compared, so that differences of these are continuous, and the proof is that of a
body without sections with the strain of the jump as a part of each strain, (B15) of docs/bounds.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.addons.bounds.arrays import Array
from signorini_fx.mechanics.body.jumps import Jump, jumps_in
from signorini_fx.mechanics.effects.preload import Preload
from signorini_fx.mechanics.model import Model


@dataclass(frozen=True)
class SectionJump:
    """A section that is shortened.

    Attributes:
        moved: s J: what it adds to the displacement of cells beyond the section, of the elements, zero at all nodes but
            those on the section, length.
        beyond: which cells of the mesh are beyond it, and have nodes on it, shape (cells,).
    """

    moved: fem.Function
    beyond: npt.NDArray[np.bool_]


@dataclass(frozen=True)
class JumpStrain:
    """What sections add to the strain of n cells.

    Attributes:
        strain: at corners, shape (n, d + 1, 3 or 6).
        rounded: squares of the norm of its round-off, energies, shape (n,).
    """

    strain: Array
    rounded: Array


def preloaded_sections(model: Model, space: fem.FunctionSpace, step: float) -> list[SectionJump]:
    """Those of a scene that are shortened at a place in the lists of factors."""
    jumps = [jump for jump in jumps_in(model.statement, model.tagged, space) if isinstance(jump.entry, Preload)]
    return [_section(jump, space, step) for jump in jumps if jump.amount(step) != 0]


def _section(jump: Jump, space: fem.FunctionSpace, step: float) -> SectionJump:
    moved = fem.Function(space)
    moved.x.array[:] = jump.amount(step) * jump.at_nodes.ravel()
    beyond = np.zeros(len(space.dofmap.list), dtype=bool)
    beyond[jump.cells] = True
    return SectionJump(moved, beyond)
