"""The rigid tools of a ``ContactProblem``: foundations that force, moment or prescribed components move."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import mesh as dmesh

from signorini_fx import parallel
from signorini_fx.body.rigid_tools import Driven, RigidTools
from signorini_fx.kinematics import CARTESIAN
from signorini_fx.results.tool_motion import ToolMotion
from signorini_fx.results.tools import Driving

Array = npt.NDArray[np.float64]


def tools_of(shapes: Sequence[Any], mesh: dmesh.Mesh) -> RigidTools | None:
    """The tools among the contacts; None: there are none; collective.

    Args:
        shapes: of each contact the shape that is moved; None: it has none.
        mesh: of the body, whose size makes lengths of rotations.
    """
    dim = mesh.geometry.dim
    bounds = parallel.global_bounds(mesh.comm, mesh.geometry.x[:, :dim].astype(np.float64))
    return RigidTools.of(shapes, CARTESIAN[dim], float(np.linalg.norm(np.ptp(bounds, axis=0))))


def driven_by(tools: RigidTools | None) -> Driven | None:
    """What drives all of them together now."""
    count = 0 if tools is None else tools.parts.size
    return None if tools is None else Driven.together([(1.0, tools.driven(k, 0.0)) for k in range(count)])


def values_of(tools: RigidTools | None) -> tuple[list[npt.NDArray[Any]], list[npt.NDArray[Any]]]:
    """What decides about the matrix, and about its right-hand side."""
    driven = driven_by(tools)
    return ([], []) if tools is None or driven is None else ([tools.fixed], [driven.forces, driven.motion])


def driving_of(tools: RigidTools | None, motions: Sequence[ToolMotion]) -> list[Driving]:
    """The motions, and what drives them."""
    shapes = [] if tools is None else tools.shapes
    return [(motion, shape.drive(motion.reference.size, 0.0)) for motion, shape in zip(motions, shapes, strict=True)]
