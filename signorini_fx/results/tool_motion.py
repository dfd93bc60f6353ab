"""How rigid tools have moved in a result.

The motion is that of ``body.rigid_tools`` in components of its own: v + w x (x - c), in the plane with w along x[2].
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc
from scipy.spatial.transform import Rotation

from signorini_fx import parallel
from signorini_fx.body.contact_state import ContactState
from signorini_fx.body.elastic import ElasticBody
from signorini_fx.body.rigid_tools import RigidTools
from signorini_fx.contact.resting_place import RestingMotion
from signorini_fx.display import clean
from signorini_fx.kinematics.cartesian import Kinematics

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class ToolMotion:
    """How a tool has moved from where it is given.

    Attributes:
        part: place of its contact in ``scene.contact``.
        boundary: name of the boundary that it may touch.
        reference: the point c, length, shape (d,).
        translation: v, length, shape (d,).
        rotation: w, radians; a number in the plane, shape (1,), in space shape (3,).
    """

    part: int
    boundary: str
    reference: Array
    translation: Array
    rotation: Array

    def at(self, x: Array) -> Array:
        """The displacement of the tool at points of shape (n, d), length."""
        arm = x - self.reference
        if self.rotation.size == 1:
            return self.translation + self.rotation * np.column_stack((-arm[:, 1], arm[:, 0]))
        return np.asarray(self.translation + np.cross(self.rotation, arm))

    def gap_error(self, contact: ContactState, shape: Any) -> float:
        """By how much the gap of the tool where it ends up differs at most from the linearised one, where it presses,
        length; collective.

        Args:
            contact: the state at the contact points.
            shape: the tool where it is given, with a method ``distance`` as ``Shape`` has it.
        """
        boundary, turn = contact.boundary, np.eye(self.reference.size)
        if self.rotation.size == 1:
            cosine, sine = np.cos(self.rotation[0]), np.sin(self.rotation[0])
            turn = np.array([[cosine, -sine], [sine, cosine]])
        elif self.rotation.any():
            turn = np.asarray(Rotation.from_rotvec(self.rotation).as_matrix())
        x = boundary.centre[(boundary.part == self.part) & (contact.pressure > 0)]
        off = np.zeros(0)
        if not np.isfinite(self.translation).all():
            return np.nan
        if x.size:
            gap, normal = shape.distance(x)
            moved, _ = shape.distance((x - self.reference - self.translation) @ turn + self.reference)
            off = np.abs(moved - gap + np.sum(normal * self.at(x), axis=1))
        return parallel.largest(boundary.comm, off)

    def as_dict(self, contact: ContactState, effect: Any, kinematics: Kinematics) -> dict[str, Any]:
        """A row of the summary: its motion, the force and moment of the body on it, and ``gap_error``; collective.

        Args:
            contact: the state at the contact points.
            effect: its contact in the scene.
            kinematics: of the body, by which some forces and moments cancel.
        """
        boundary, dim = contact.boundary, self.reference.size
        on_tool = boundary.part == self.part
        forces = boundary.nodal_forces(contact.pressure, contact.shear)[on_tool]
        moments = kinematics.turned(boundary.centre[on_tool] - self.reference, forces)
        sums = [
            forces.sum(axis=0),
            moments.sum(axis=0),
            *(np.abs(vectors).sum(axis=0) for vectors in (forces, moments)),
        ]
        total = parallel.global_sum(boundary.comm, np.concatenate(sums))
        total[: kinematics.motions][~kinematics.unbalanced] = 0.0
        size = total[sums[0].size + sums[1].size :]
        moment = clean(total[dim : sums[0].size + sums[1].size].tolist(), float(size[dim:].max()))
        moved, turned = (
            clean(vectors.tolist(), float(np.abs(vectors).max())) for vectors in (self.translation, self.rotation)
        )
        return {
            "boundary": self.boundary,
            "reference": self.reference.tolist(),
            "displacement": moved,
            "rotation": turned if dim == 3 else turned[0],
            "force": clean(total[:dim].tolist(), float(size[:dim].max())),
            "moment": moment if dim == 3 else moment[0],
            "gap_error": None if effect.kind == "bonded" else self.gap_error(contact, effect.tool),
        }


def motions_of(
    tools: RigidTools | None, names: Sequence[str], body: ElasticBody, x: PETSc.Vec, resting: RestingMotion | None
) -> tuple[ToolMotion, ...]:
    """How they have moved in a displacement that is counted from the resting place; collective.

    Args:
        tools: None: there are none.
        names: of the contacts.
        body: the elastic body.
        x: the displacement.
        resting: see ``ElasticBody.driven``.
    """
    if tools is None:
        return ()
    dim, motions = tools.dimension, tools.motions(body.driven(x, resting))
    return tuple(
        ToolMotion(part, names[part], tools.centre[k], motions[k, :dim], motions[k, dim:])
        for k, part in enumerate(map(int, tools.parts))
    )
