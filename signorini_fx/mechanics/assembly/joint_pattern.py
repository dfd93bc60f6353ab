"""The stiffness of forms with what joins nodes of two bodies, in a pattern that tangents share; on one rank.

As bodies slide, other nodes of both sides meet.  A pattern with room for all that have met lately, with zeros where
nothing is any more, spares linear algebra what depends on patterns alone, such as the order of elimination.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem, la
from petsc4py import PETSc

from signorini_fx.algebra.linalg import row_by_row
from signorini_fx.mechanics.assembly.nodal_stiffness import NodalStiffness
from signorini_fx.tuned import KEPT_ROOM

Numbers = npt.NDArray[np.int64]


@dataclass(frozen=True)
class JointPattern:
    """Where forms and joints have entries, as keys: row times the number of unknowns plus column, ascending.

    Attributes:
        forms: the compiled terms, all with the pattern of the first one.
        of_forms: the matrix of these, whose values each tangent renews.
        keys: of all entries.
        ends, columns: of the rows.
        places: which entries are those of the forms.
        room: keys of the others.
    """

    forms: tuple[fem.Form, ...] = field(repr=False)
    of_forms: la.MatrixCSR = field(repr=False)
    keys: Numbers
    ends: npt.NDArray[np.integer[Any]]
    columns: npt.NDArray[np.integer[Any]]
    places: Numbers
    room: Numbers

    @classmethod
    def holding(cls, forms: Sequence[fem.Form], joints: Numbers, last: JointPattern | None) -> JointPattern:
        """One with room for forms and joints: the last one if it has that.

        Args:
            forms: the compiled terms.
            joints: keys of the entries of joints.
            last: that of an earlier tangent; None: there is none.
        """
        if last is not None and last.forms != tuple(forms):
            last = None
        if last is not None and _among(last.keys, joints).all():
            return last
        of_forms = None if last is None else last.of_forms
        if of_forms is None:
            entries_of_forms = fem.create_sparsity_pattern(forms[0])
            entries_of_forms.finalize()
            of_forms = la.matrix_csr(entries_of_forms, block_mode=la.BlockMode.expanded, dtype=forms[0].dtype)
        dofmap = forms[0].function_spaces[0].dofmap
        size = dofmap.index_map.size_local * dofmap.index_map_bs
        columns: npt.NDArray[np.integer[Any]]
        if last is None:
            columns, counts = of_forms.indices, np.diff(of_forms.indptr)
            by_forms = np.repeat(np.arange(size), counts) * size + columns
        else:
            by_forms, columns = last.keys[last.places], last.columns[last.places]
            counts = np.diff(last.ends) - np.bincount(last.room // size, minlength=size)
        room = np.unique(joints)
        room = room[~_among(by_forms, room)]
        if last is not None and last.room.size <= KEPT_ROOM * room.size:
            room = np.union1d(room, last.room)
        at = np.searchsorted(by_forms, room)
        keys, places = np.insert(by_forms, at, room), np.arange(by_forms.size)
        places += np.cumsum(np.bincount(at, minlength=by_forms.size + 1))[:-1]
        ends = np.zeros(size + 1, dtype=PETSc.IntType)
        np.cumsum(counts + np.bincount(room // size, minlength=size), out=ends[1:])
        columns = np.insert(columns, at, room % size).astype(PETSc.IntType, copy=False)
        return cls(tuple(forms), of_forms, keys, ends, columns, places, room)


def _among(keys: Numbers, wanted: Numbers) -> npt.NDArray[np.bool_]:
    """Which of some keys are among others, ascending."""
    return np.asarray(keys[np.minimum(np.searchsorted(keys, wanted), keys.size - 1)] == wanted)


def joined_stiffness(
    forms: Sequence[fem.Form],
    bcs: Sequence[fem.DirichletBC],
    beside: NodalStiffness,
    fixed: npt.NDArray[np.bool_],
    last: JointPattern | None,
) -> tuple[PETSc.Mat, JointPattern]:
    """The matrix of a sum of bilinear forms and of what is beside it, without what is prescribed, and its pattern.

    Args:
        forms: the compiled terms.
        bcs: whose rows and columns are left out.
        beside: blocks of nodes, and joints.
        fixed: which unknowns ``bcs`` prescribe, shape (dofs,).
        last: see ``JointPattern.holding``.
    """
    space, size = forms[0].function_spaces[0].dofmap, fixed.size
    joints = [joint.entries(space.index_map_bs, fixed, forms[0].mesh.comm) for joint in beside.joint]
    rows, columns, values = (np.concatenate(parts) for parts in zip(*joints, strict=True))
    keys = rows * size + columns
    pattern = JointPattern.holding(forms, keys, last)
    pattern.of_forms.data[:] = 0.0
    for form in forms:
        fem.assemble_matrix(pattern.of_forms, form, list(bcs), 0.0)  # type: ignore[arg-type]
    data = np.zeros(pattern.keys.size)
    data[pattern.places] = pattern.of_forms.data
    np.add.at(data, np.searchsorted(pattern.keys, keys), values)
    csr = pattern.ends, pattern.columns, data
    matrix = PETSc.Mat().createAIJWithArrays((size, size), csr, comm=forms[0].mesh.comm)
    matrix.setBlockSize(space.index_map_bs)
    beside.without_joints.add_to(matrix, fixed)
    return row_by_row(matrix), pattern
