"""The second opinion on the equilibrium of rigid tools."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from signorini_fx.results.contact_nodes import ContactNodes
from signorini_fx.results.tool_motion import ToolMotion
from signorini_fx.scene.model import Scene

Array = npt.NDArray[np.float64]


def given_in(scene: Scene, tools: Sequence[ToolMotion], step: float, scale: float) -> list[Driving]:
    """What drives the tools of a scene.

    Args:
        scene: the scene.
        tools: their motions.
        step: the load step, from 0, or a place between two.
        scale: factor of all loads and prescribed displacements.
    """
    drives = []
    for tool in tools:
        shape = scene.contact[tool.part].tool
        factor, time = scene.driving(shape, step)
        load, prescribed = shape.drive(tool.reference.size, time)
        prescribed[~scene.kinematics_in(tool.reference.size).unbalanced] = 0.0
        drives.append((tool, (scale * factor * load, scale * factor * prescribed)))
    return drives


# A tool, with force and moment on it, and the components that are prescribed, nan where they are free.
Driving = tuple[ToolMotion, tuple[Array, Array]]


def unbalanced(nodes: ContactNodes, tools: Sequence[Driving], least: Array | None = None) -> float:
    """The largest force or moment on a free component of a tool that the contact tractions do not balance, and the
    largest miss of a prescribed one, as a share of the forces at the tool, or of its motion; collective.

    Args:
        nodes: the contact points with the tractions at them.
        tools: their motions, and what drives them.
        least: forces that are round-off, of each tool; None: zero.
    """
    worst = 0.0
    for (tool, (load, prescribed)), slight in zip(tools, np.zeros(len(tools)) if least is None else least, strict=True):
        dim = tool.reference.size
        free, motion = np.isnan(prescribed), np.append(tool.translation, tool.rotation)
        taken, size, reach = nodes.resultant(tool.part, tool.reference)
        # Moments as forces and rotations as lengths at this lever, so that neither depends on units.
        lever = np.append(np.ones(dim), np.full(motion.size - dim, reach or 1.0))
        load, motion, prescribed = load / lever, motion * lever, prescribed * lever
        residual = load + taken / lever
        size = max(size, float(np.abs(load).max()), slight)
        missed, far = (
            np.abs(motion - prescribed)[~free],
            max(np.abs(motion).max(), np.abs(prescribed[~free]).max(initial=0)),
        )
        worst = max(worst, float(np.abs(residual[free]).max(initial=0.0)) / size if size > 0 else 0.0)
        worst = max(worst, float(missed.max(initial=0.0)) / far if far > 0 else float(missed.max(initial=0.0) > 0))
    return worst
