"""Whether a rigid shape lies inside a nonlinear body, or has passed through it since the last solution, or two bodies
have done so with each other, in words.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from dolfinx import fem

from signorini_fx.forms.nonlinear.moving_pairs import MovingPair
from signorini_fx.forms.nonlinear.moving_shapes import MovingShape
from signorini_fx.forms.nonlinear.state import State
from signorini_fx.machine import parallel
from signorini_fx.mechanics.obstacles.bodies_inside import PairedBodies
from signorini_fx.mechanics.obstacles.shapes_inside import BodyCells


def overlap(u: fem.Function, cells: BodyCells, shapes: Mapping[int, MovingShape], last: State) -> str:
    """Which shape is inside the body, how deep and where; empty: none; collective.

    Before there is a solution a shape comes from where it is given, if it is outside of the body there.
    """
    comm, now, then = cells.space.mesh.comm, cells.placed(u.x.array), cells.placed(last.displacement)
    solved = last.certificate is not None
    for number, moving in shapes.items():
        added = parallel.largest(comm, moving.added, -np.inf)
        deep = cells.inside(now, moving.shape, added)
        if deep is not None:
            return f"contact[{number}]: {deep}"
        before = last.shapes[number] if solved else moving.settled
        if not solved and cells.inside(then, before, added) is not None:
            continue
        deep = cells.passed((then, before), (now, moving.shape), added)
        if deep is not None:
            return f"contact[{number}]: on its way, {deep}"
    return ""


def overlap_of_bodies(u: fem.Function, cells: BodyCells, pairs: Mapping[int, MovingPair], last: State) -> str:
    """Which pair, how deep and where; empty: none; collective.  For the arguments see ``overlap``."""
    now, then = cells.placed(u.x.array), cells.placed(last.displacement)
    for number, pair in pairs.items():
        deep = PairedBodies.of(cells, pair.sides).inside(then, now)
        if deep is not None:
            return f"contact[{number}]: {deep}"
    return ""
