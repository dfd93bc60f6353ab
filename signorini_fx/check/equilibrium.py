"""Whether a scene is in equilibrium: which rigid motions supports and contact resist, which loads they balance.

The statements are proved: the forces on a linear body in equilibrium do no work on any motion without strain that its
supports leave free.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from signorini_fx import parallel
from signorini_fx.body.discretisation import Body
from signorini_fx.body.rigid import RigidMotions
from signorini_fx.contact import data as contact_data
from signorini_fx.contact.laws import FrictionLaw, RegularisedData
from signorini_fx.contact.statics import (
    ZERO,
    Reactions,
    certainly_balances,
    cone,
    left_over,
    null_space,
    reactions,
    squeezed,
)
from signorini_fx.records import Finding

_Rows = npt.NDArray[np.float64]
# Number of pieces that a message lists.
MOST_LISTED = 4


def equilibrium(body: Body, law: FrictionLaw | None, data: RegularisedData | None) -> list[Finding]:
    """Motions without strain that the supports leave free: whether contact can resist them, and balance the loads.

    Each assembly of pieces is checked separately.
    """
    motions, boundary = body.motions, body.boundary
    if motions.free.shape[1] == 0:
        return []
    every: Reactions | None = None
    if boundary is not None:
        none = np.zeros(boundary.size)
        coefficient, given = (none, none) if law is None else (law.coefficient, law.given)
        bilateral = contact_data.bilateral_nodes(body.scene, boundary)
        every = reactions(boundary, motions, given, coefficient, bilateral)
    loads = [load_on(body, step) for step in range(body.scene.steps)]
    counted = "load step" if body.scene.automatic_steps is None else "factor"
    found = []
    for number, columns, _ in motions.assemblies():
        own = None if every is None else every.of(number, columns)
        on = [(work[columns], sizes[number]) for work, sizes in loads]
        interference = False
        pushed = any(np.linalg.norm(load) > ZERO * size for load, size in on)
        if not pushed and boundary is not None and data is not None and own is not None and own.given.size:
            assert every is not None
            interference = squeezed(data, boundary, every, number, columns)
        found.append(
            _equilibrium_of(
                motions,
                number,
                columns,
                own,
                on,
                has_friction=law is not None,
                interference=interference,
                counted=counted,
            )
        )
    return found


def _equilibrium_of(
    motions: RigidMotions,
    number: int,
    columns: npt.NDArray[np.bool_],
    contact: Reactions | None,
    loads: list[tuple[_Rows, float]],
    *,
    has_friction: bool,
    interference: bool,
    counted: str,
) -> Finding:
    """Whether one assembly is in equilibrium.

    Args:
        motions: all motions.
        number: of the assembly.
        columns: its free motions, k of them.
        contact: reactions of its contact nodes; None for a scene without contact.
        loads: for each load step its forces on these motions, shape (k,), and the sum of its nodal forces.
        has_friction: whether a friction law acts anywhere.
        interference: whether its foundation holds it without a load.
        counted: what the loads are numbered by: load steps, or the factors of a ramp.
    """
    free = motions.free[:, columns]
    several = motions.pieces.count > 1
    members = np.flatnonzero(motions.pieces.assembly == number)
    it = "the body"
    if several:
        it = motions.pieces.describe(int(members[0])) if members.size == 1 else "pieces joined by hinges"
    generators, given, directions = cone(contact, free.shape[1])
    loose = null_space(directions)
    if loose.shape[1]:
        names = _motions(free @ loose, motions, members)
        who, advice = "the supports do not resist", "prescribe a displacement"
        if contact is not None:
            who, advice = "neither the supports nor the contact resists", f"{advice}, or add friction"
        return Finding("warning", "displacement", f"nothing holds {it}: {who} {names}; {advice}")
    pushed, away_in = False, []
    for step, (load, size) in enumerate(loads):
        pushed = pushed or float(np.linalg.norm(load)) > ZERO * size
        away = left_over(generators, load)
        left = float(np.linalg.norm(away))
        if left > ZERO * size and left**2 > np.linalg.norm(given @ away, axis=1).sum():
            away_in.append((step + 1, _motions(free @ away[:, None], motions, members)))
    of_it = f" of {it}" if several else ""
    if away_in:
        steps = [step for step, _ in away_in]
        when = ""
        if len(loads) > 1:
            when = f"{counted}{'s' * (len(steps) > 1)} {_runs(steps)}: "
        return Finding(
            "warning",
            "traction, body_force",
            f"{when}there is no static equilibrium{of_it}: the loads drive {away_in[0][1]}, which neither the supports "
            "nor the contact can stop: change the direction of the loads, prescribe a displacement, or raise the "
            "friction",
        )
    assert contact is not None
    alone = "friction" if has_friction and null_space(contact.normal).shape[1] else "the contact alone"
    text = f"the supports do not hold {_motions(free, motions, members)}: {alone} must"
    if several:
        text = f"{it}: {text}"
    stuck = np.linalg.matrix_rank(given.reshape(-1, free.shape[1])) == free.shape[1]
    if not pushed and not stuck and not interference and not contact.bilateral.any():
        message = f"{text}, but no load presses {it} on its foundation: its position is not determined"
        return Finding("warning", "traction, body_force", message)
    pressed = "it is squeezed without a load" if interference else "the loads press the body on"
    text = f"{text}, and {pressed}"
    # In space friction is bracketed by polygons: an equilibrium that the inner one does not allow for is not proved.
    bracketed = contact.tangential.shape[1] > 1 and not contact.bilateral.any()
    if bracketed and not all(certainly_balances(contact, load, load) for load, _ in loads):
        text = f"{text}; friction is so close to its limit that only the iteration can say whether it holds"
    return Finding("note", "displacement", text)


def _runs(steps: list[int]) -> str:
    """Numbers in order, with runs of them abbreviated."""
    runs: list[list[int]] = []
    for step in steps:
        if runs and step == runs[-1][-1] + 1:
            runs[-1].append(step)
        else:
            runs.append([step])
    return ", ".join(str(run[0]) if len(run) == 1 else f"{run[0]} to {run[-1]}" for run in runs)


def load_on(body: Body, step: int) -> tuple[_Rows, _Rows]:
    """L of the free motions, shape (k,), and the sum of the sizes of the nodal forces on each assembly; collective."""
    motions = body.motions
    forces = sum((load.factors[step] * load.forces for load in body.applied), np.zeros(body.fixed.size))
    nodal = np.asarray(forces).reshape(-1, motions.x.shape[1])
    work = motions.free.T @ motions.resultant(nodal, body.comm)
    assembly = motions.pieces.assembly[motions.piece[: len(nodal)]]
    sizes = np.linalg.norm(nodal, axis=1, keepdims=True)
    return work, parallel.sums_by(body.comm, assembly, sizes, int(motions.pieces.assembly.max()) + 1).ravel()


def _motions(moved: _Rows, motions: RigidMotions, members: npt.NDArray[np.int64]) -> str:
    """Names of motions of an assembly, combinations as in ``RigidMotions.free``, one per column."""
    found = []
    for piece in members:
        own = moved[motions.each * piece : motions.each * (piece + 1)]
        vectors, values, _ = np.linalg.svd(own, full_matrices=False)
        own = own if members.size == 1 else vectors[:, values > _SLIGHT * np.abs(moved).max()]
        if own.shape[1]:
            names = _names(own, motions.centre[piece], float(motions.length[piece]))
            found.append(names if members.size == 1 else f"{motions.pieces.describe(int(piece))} in {names}")
    more = f", and {len(found) - MOST_LISTED} more pieces" if len(found) > MOST_LISTED else ""
    return ", ".join(found[:MOST_LISTED]) + more


# A piece that moves by less than this share of another one is at rest.
_SLIGHT = 1e-6


# A rotation about a point that is so many lengths of the piece away moves it like a translation.
_FAR_AXIS = 30.0


def _names(motions: _Rows, centre: _Rows, length: float) -> str:
    """Names of motions of one piece (translations, then rotations, see ``rigid_modes``), one per column."""
    dim = centre.size
    _, values, rows = np.linalg.svd(motions[dim:], full_matrices=True)
    turning = int(np.count_nonzero(values > 1e-6))
    shifts = (motions @ (rows[turning:].T if turning else np.eye(motions.shape[1])))[:dim]
    if turning and motions.shape[1] == 1 and np.linalg.norm(motions[:dim]) > _FAR_AXIS * np.linalg.norm(motions[dim:]):
        along = motions[:dim, 0] / np.linalg.norm(motions[:dim])
        return f"the translation along ({_point(along)}) with a slight rotation"
    names = []
    if shifts.shape[1] == dim:
        names.append("translations")
    elif shifts.shape[1] == 1:
        along = shifts[:, 0] / np.linalg.norm(shifts[:, 0])
        along = along * np.sign(along[np.argmax(np.abs(along))]) if motions.shape[1] > 1 else along
        names.append(f"the translation along ({_point(along)})")
    elif shifts.shape[1] == 2:
        across = np.linalg.svd(shifts.T)[2][-1]
        names.append(f"the translations across ({_point(across * np.sign(across[np.argmax(np.abs(across))]))})")
    if turning and motions.shape[1] > 1:
        names.append("rotations")
    elif turning and dim == 2:
        shift_x, shift_y, angle = motions[:, 0]
        names.append(f"the rotation about ({_point(centre + length / angle * np.array([-shift_y, shift_x]))})")
    elif turning:
        shift, turn = motions[:dim, 0], motions[dim:, 0] / length
        through = centre + np.cross(turn, shift) / np.dot(turn, turn)
        axis = turn / np.linalg.norm(turn)
        names.append(f"the rotation about the axis through ({_point(through)}) along ({_point(axis)})")
    return " and ".join(names)


def _point(x: _Rows) -> str:
    return ", ".join(map(rounded, x))


def rounded(value: float) -> str:
    """A number of a message, to four digits."""
    return f"{round(float(value), 6) + 0.0:.4g}"
