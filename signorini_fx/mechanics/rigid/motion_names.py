"""Names of motions without strain, for messages."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from signorini_fx.mechanics.rigid.rigid_motions import RigidMotions
from signorini_fx.tuned import CERTIFICATE_TOLERANCE

_Rows = npt.NDArray[np.float64]
# Number of pieces that a message lists.
MOST_LISTED = 4


def names_of(moved: _Rows, motions: RigidMotions, members: npt.NDArray[np.int64], *, one_way: bool = False) -> str:
    """Names of motions of an assembly, combinations as in ``RigidMotions.of_all``, one per column.

    Args:
        moved: the motions.
        motions: those that supports leave free.
        members: the pieces of the assembly.
        one_way: whether a single motion is meant in its direction, not in the opposite one as well.
    """
    descriptions = []
    moved = moved / np.abs(moved).max()  # the size of a motion means nothing
    rows, rigid, pieces = moved.reshape(-1, motions.each, moved.shape[1]), motions.moving, motions.pieces
    things = [
        (motions.pieces.called(int(member)), rows[member], motions.centre[member], motions.length[member])
        for member in members
    ]
    if rigid is not None:
        things += [
            (body.called, row, body.pivot(motions.x.shape[1]), rigid.length)
            for body, row in zip(rigid.bodies, rows[pieces.count :], strict=True)
        ]
    for name, modes, centre, length in things:
        vectors, values, _ = np.linalg.svd(modes, full_matrices=False)
        independent = modes if len(things) == 1 else vectors[:, values > CERTIFICATE_TOLERANCE]
        if one_way and independent.shape[1]:
            independent = modes / np.linalg.norm(modes)  # the sign of ``vectors`` means nothing
        if independent.shape[1]:
            names = names_of_piece(independent, centre, float(length), one_way=one_way)
            descriptions.append(names if len(things) == 1 else f"{name} in {names}")
    suffix = f", and {len(descriptions) - MOST_LISTED} more pieces" if len(descriptions) > MOST_LISTED else ""
    return ", ".join(descriptions[:MOST_LISTED]) + suffix


def names_of_piece(motions: _Rows, centre: _Rows, length: float, *, one_way: bool = False) -> str:
    """Names of motions of one piece (translations, then rotations, see ``rigid_modes``), one per column; ``one_way``:
    see ``names_of``.
    """
    dim = centre.size
    _, values, rows = np.linalg.svd(motions[dim:], full_matrices=True)
    turning = int(np.count_nonzero(values > CERTIFICATE_TOLERANCE))
    shifts = (motions @ (rows[turning:].T if turning else np.eye(motions.shape[1])))[:dim]
    names = []
    if shifts.shape[1] == dim:
        names.append("translations")
    elif shifts.shape[1] == 1:
        along = shifts[:, 0] / np.linalg.norm(shifts[:, 0])
        along = along if one_way and motions.shape[1] == 1 else _upwards(along)
        names.append(f"the translation along ({_point(along)})")
    elif shifts.shape[1] == 2:
        names.append(f"the translations across ({_point(_upwards(np.linalg.svd(shifts.T)[2][-1]))})")
    if turning == 1 and shifts.shape[1] < dim:
        names.append(_rotation(motions @ rows[0], shifts, centre, length))
    elif turning == 1 and dim == 3:
        axis = rows[0] @ motions[dim:].T
        names.append(f"rotations about axes along ({_point(_upwards(axis / np.linalg.norm(axis)))})")
    elif turning:
        names.append("rotations")
    return " and ".join(names)


def _rotation(motion: _Rows, shifts: _Rows, centre: _Rows, length: float) -> str:
    """The name of a motion of shape (m,) that rotates, with any multiple of translations of shape (d, k)."""
    dim = centre.size
    along, _ = np.linalg.qr(shifts)
    shift, turn = motion[:dim] - along @ (along.T @ motion[:dim]), motion[dim:] / length
    if dim == 2:
        return f"the rotation about ({_point(centre + np.array([-shift[1], shift[0]]) / turn[0], length)})"
    through = centre + np.cross(turn, shift) / np.dot(turn, turn)
    axis = turn / np.linalg.norm(turn)
    axis = _upwards(axis) if shifts.shape[1] else axis
    return f"the rotation about the axis through ({_point(through, length)}) along ({_point(axis)})"


def _upwards(direction: _Rows) -> _Rows:
    """The direction or its opposite, so that its largest component is positive."""
    return np.asarray(direction * np.sign(direction[np.argmax(np.abs(direction))]))


def _point(x: _Rows, size: float = 1.0) -> str:
    return ", ".join(rounded(value, size) for value in x)


def rounded(value: float, size: float = 1.0) -> str:
    """A number of a message, to four digits; 0 where it is round-off beside a number of this size."""
    return f"{round(float(value) / size, 6) * size + 0.0:.4g}"
