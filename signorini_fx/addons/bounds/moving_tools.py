"""Rigid tools that forces move, without friction: their motions are unknown, and pressures balance their forces.

With the displacement R w of a tool, linear in its motion w and in x, a displacement v keeps to it where

    n . v <= d + n . R w,

and the functional has - F . w, with its force and moment F.  A stress in equilibrium with the pressures p has

    L(v) + F . w = int tau : eps(v) + int p n . (v - R w) + (F + int p R^T n) . w,

without supports.  Components of w that are prescribed are the same for all that are admissible; where F + int p R^T n
vanishes in all others, (B1) of docs/theory.md follows as without a tool, with the gap d + n . R w.  So the motion has
no part of its own in the bound: for any w that v goes with, such as the computed one, the gap is a known function, and
the balance of each tool is added to that of bodies that are free.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from dolfinx import fem

from signorini_fx.addons.bounds.arrays import Array, Ints
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.rigid.rigid_motions import rigid_modes
from signorini_fx.mechanics.statement.rigid_motion import RigidBody


@dataclass(frozen=True)
class MovingTool:
    """A tool with m components of motion, rotations as lengths at its size.

    Attributes:
        parts: the numbers of its contacts.
        pivot: that it turns about, length, shape (d,).
        size: at which a rotation moves by one, length.
        motion: w, lengths, shape (m,).
        free: the components that are not prescribed, shape (k,).
        force: on these, shape (k,).
    """

    parts: tuple[int, ...]
    pivot: Array
    size: float
    motion: Array
    free: Ints
    force: Array

    def modes(self, x: Array) -> Array:
        """Displacements of its components, shape (..., d, m).

        Args:
            x: where, length, shape (..., d).
        """
        flat = rigid_modes(x.reshape(-1, x.shape[-1]), self.pivot, np.array(self.size))
        return np.asarray(flat.reshape(*x.shape, -1))

    def displacement(self, x: Array) -> Array:
        """Its own, length, shape (..., d)."""
        return np.asarray(self.modes(x) @ self.motion)


def tools_of(
    bodies: Sequence[RigidBody], y: fem.Function, contact: ContactState, time: float, size: float
) -> list[MovingTool]:
    """The tools, with the motions that displacements relative to them tell.

    Args:
        bodies: of the statement.
        y: the displacement.
        contact: the contact points.
        time: when forces and prescribed components are taken.
        size: of the body, length.
    """
    boundary, d = contact.boundary, contact.boundary.x.shape[1]
    average = boundary.selection if boundary.averages is None else boundary.averages
    at_points = average.shares @ y.x.array.reshape(-1, d)[average.nodes]
    along = np.einsum("nd,nd->n", at_points, boundary.normal) - contact.u_n
    tools = []
    for body in bodies:
        force, prescribed = body.motion.drive(d, time)
        units = np.where(np.arange(len(force)) < d, 1.0, size)
        free, motion = np.flatnonzero(np.isnan(prescribed)), np.nan_to_num(prescribed) * units
        rows = np.isin(boundary.part, body.parts)
        pivot = body.pivot(d)
        modes = rigid_modes(boundary.centre[rows], pivot, np.array(size))
        seen = np.einsum("ndk,nd->nk", modes, boundary.normal[rows])
        motion[free] = np.linalg.lstsq(seen[:, free], along[rows] - seen @ motion, rcond=None)[0]
        tools.append(MovingTool(body.parts, pivot, size, motion, free, (force / units)[free]))
    return tools
