"""Rigid tools: foundations whose motion is an unknown, driven by forces, moments or prescribed components.

A tool with its reference point c moves by translations v and a small rotation w, lengths q = (v, L w) with a length L,

    R_i q = v + w x (x_i - c)

at a contact point x_i.  What contact sees is the displacement of the body relative to it.  The unknowns (u, q) of all
tools have

    K = [A 0; 0 0],   B_i = F_i^T [I, -R_i],   b = [f; (force, moment / L)],

so that equilibrium of a tool, -R^T B^T (w t) = (force, moment / L), is k rows more, and laws, sets and algorithms see
tau_N y and tau_T y as before.  Gap and normals are those of the place where the tool is given: its motion is small
against its geometry, like the displacement of the body.

The k unknowns are the last ones, on the last rank: the numbers of all others stay as they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc

from signorini_fx.body.contact_boundary import ContactBoundary, MovingFoundation
from signorini_fx.body.rigid import rigid_modes
from signorini_fx.kinematics.cartesian import Kinematics

_Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Driven:
    """What drives all tools, by their unknowns.

    Attributes:
        forces: (force, moment / L), shape (k,).
        motion: the prescribed unknowns, lengths; elsewhere zero, shape (k,).
    """

    forces: _Floats
    motion: _Floats

    @classmethod
    def together(cls, parts: Sequence[tuple[float, Driven]]) -> Driven | None:
        """The sum of several times their factors; None: there are none."""
        if not parts:
            return None
        factors, drives = zip(*parts, strict=True)
        forces, motion = (
            np.einsum("i,ij->j", factors, [getattr(drive, k) for drive in drives]) for k in ("forces", "motion")
        )
        return cls(forces, motion)


@dataclass(frozen=True)
class RigidTools:
    """The tools of a scene, t of them with m unknowns each.

    Attributes:
        parts: places of their contacts, shape (t,).
        shapes: what drives them, see ``scene.rigid_motion``.
        centre: their reference points, length, shape (t, d).
        length: L.
        kinematics: of the body, with which they may move.
    """

    parts: npt.NDArray[np.int64]
    shapes: Sequence[Any]
    centre: _Floats
    length: float
    kinematics: Kinematics

    @classmethod
    def of(cls, contacts: Sequence[Any], kinematics: Kinematics, length: float) -> RigidTools | None:
        """Those among the shapes of contacts, None for a contact that is with none of them; None: there are none."""
        parts = [number for number, shape in enumerate(contacts) if shape is not None]
        if not parts:
            return None
        shapes = [contacts[number] for number in parts]
        centre = np.array([shape.reference(kinematics.dimension) for shape in shapes])
        return cls(np.array(parts), shapes, centre, length, kinematics)

    @property
    def dimension(self) -> int:
        """D, of space."""
        return int(self.centre.shape[1])

    @property
    def _units(self) -> _Floats:
        """Unknowns per component: one of a translation, L of a rotation, shape (m,)."""
        rotations = len(self.kinematics.rotations)
        return np.array([1.0] * self.dimension + [self.length] * rotations)

    def on(self, boundary: ContactBoundary) -> ContactBoundary:
        """The contact points on tools that move."""
        motion_count, count = self.kinematics.motions, self.parts.size
        modes = np.zeros((boundary.size, self.dimension, count, motion_count))
        for tool, part in enumerate(self.parts):
            on_part = boundary.part == part
            modes[on_part, :, tool] = rigid_modes(boundary.centre[on_part], self.centre[tool], np.array(self.length))
        flat = modes.reshape(boundary.size, self.dimension, count * motion_count)
        number = np.repeat(np.arange(count), motion_count)
        moving = MovingFoundation(flat, self.fixed, number, self.parts, self.centre, self.length)
        return replace(boundary, moving=moving)

    @property
    def fixed(self) -> npt.NDArray[np.bool_]:
        """Which unknowns are prescribed, shape (k,)."""
        prescribed = [~np.isnan(shape.drive(self.dimension, 0.0)[1]) for shape in self.shapes]
        return np.concatenate([flags | ~self.kinematics.unbalanced for flags in prescribed])

    def driven(self, number: int, time: float) -> Driven:
        """What drives one of them at a time."""
        forces: _Floats = np.zeros((self.parts.size, self._units.size))
        motion = np.zeros_like(forces)
        forces[number], prescribed = self.shapes[number].drive(self.dimension, time)
        motion[number] = np.nan_to_num(prescribed)
        return Driven((forces / self._units).ravel(), (motion * self._units).ravel())

    def motions(self, unknowns: _Floats) -> _Floats:
        """Translations and rotations, radians, from the unknowns, shape (t, m)."""
        return np.asarray(unknowns.reshape(self.parts.size, -1) / self._units)


def with_more_unknowns(matrix: PETSc.Mat, extra: int) -> PETSc.Mat:
    """[A 0; 0 0] with the diagonal in its pattern; ``extra``: unknowns that this rank adds."""
    (rows, _), (_, total_columns) = matrix.getSizes()
    starts, columns, values = matrix.getValuesCSR()
    csr = (
        np.append(starts, starts[-1] + np.arange(1, extra + 1)).astype(PETSc.IntType),
        np.append(columns, total_columns + np.arange(extra)).astype(PETSc.IntType),
        np.append(values, np.zeros(extra)),
    )
    return PETSc.Mat().createAIJ(((rows + extra, None), (rows + extra, None)), csr=csr, comm=matrix.comm)


def without_more(rotation: PETSc.Mat | None, matrix: PETSc.Mat, extra: int) -> PETSc.Mat:
    """[Q 0], from the unknowns to displacements y = Q x.

    Args:
        rotation: Q without the unknowns of tools; None: the identity.
        matrix: A, for the layout of y.
        extra: unknowns that this rank adds.
    """
    (rows, _), (columns, _) = matrix.getSizes()
    if rotation is None:
        first, numbers = matrix.getOwnershipRange()[0], np.arange(rows + 1)
        csr = (numbers, first + numbers[:-1], np.ones(rows))
    else:
        csr = rotation.getValuesCSR()
    starts, names, values = csr
    entries = (starts.astype(PETSc.IntType), names.astype(PETSc.IntType), values)
    return PETSc.Mat().createAIJ(((rows, None), (columns + extra, None)), csr=entries, comm=matrix.comm)
