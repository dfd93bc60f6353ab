"""What to know of a scene and its result: what hurts, and what to do about it.

``checks`` says it before a scene is solved, ``solver`` with the solution; both by the functions of this module, from
data that they have anyway.  What is said of equilibrium is proved: a linear body that is in equilibrium with its
foundation is in equilibrium against every motion without strain that its supports leave free.  What is said of gaps
and of uniqueness is a rule of thumb, and says so.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from mpi4py import MPI
from scipy.optimize import lsq_linear

from signorini_fx import contact_data, parallel
from signorini_fx.boundary import ContactBoundary
from signorini_fx.complementarity import FrictionLaw, RegularisedData
from signorini_fx.deformation import Deformation
from signorini_fx.discretisation import LOCKING_POISSON, Body
from signorini_fx.expressions import sample
from signorini_fx.holding import Reactions, reactions
from signorini_fx.results import SMALL_DEFORMATION
from signorini_fx.rigid import RigidMotions
from signorini_fx.scene import CoulombFriction, LinearElastic, Scene
from signorini_fx.strategy import LARGEST_GAMMA, START_GAMMA

_Rows = npt.NDArray[np.float64]
# Forces and motions below this share of their scale are round-off.
_ZERO = 1e-8
# Friction above this is taken for as much as is wanted.
_ROUGH = 1e6
# A gap this many times larger than the estimated displacements is called out.
_FAR = 10.0


@dataclass(frozen=True)
class Finding:
    """Something to know of a scene or of its result.

    Attributes:
        level: a warning hurts, a note does not.
        path: key of the scene that it is about.
        message: what is the matter, and what to do.
    """

    level: Literal["warning", "note"]
    path: str
    message: str


def scene_findings(
    body: Body, law: FrictionLaw | None, data: RegularisedData | None, *, estimates: bool = True
) -> list[Finding]:
    """What the scene and its mesh say; collective, the same on every rank.

    Args:
        body: the scene and its mesh.
        law: its friction law, None without.
        data: its contact data, None without contact.
        estimates: whether to say what is only estimated of displacements: a solution knows better.
    """
    scene = body.scene
    found = [*_pieces(body), *_locking(body), *_equilibrium(body, law)]
    # Without an estimate all that counts is whether anything acts at all.
    moved = max(_displacement_scale(body, step) for step in range(scene.steps)) if estimates else float(_acts(body))
    if estimates:
        found += _large_displacements(body, moved)
    if body.boundary is not None and data is not None:
        found += [
            *_gaps(body, data, moved, estimates=estimates),
            *_heights(body),
            *_uniqueness(scene, body.boundary, law),
            *_regularisation(scene, data, scene.young / body.tagged.size),
            *_monolithic(scene),
        ]
    return found


def _locking(body: Body) -> list[Finding]:
    scene = body.scene
    if body.reduced is not None or scene.element.degree > 1:
        return []
    triangles = body.tagged.mesh.topology.cell_name() == "triangle"
    cure = (
        "set element.degree = 2, or use quadrilaterals with element.volumetric = 'reduced'"
        if triangles
        else "set element.volumetric = 'auto', or element.degree = 2"
    )
    return [
        Finding(
            "warning",
            f"material[{index}].poisson",
            f"linear elements lock as nu -> 0.5 (nu = {material.poisson:g}): the body comes out too stiff; {cure}",
        )
        for index, material in enumerate(scene.material)
        if material.hypothesis == "plane strain" and material.poisson >= LOCKING_POISSON
    ]


def result_findings(deformations: Sequence[Deformation], *, touching: bool | None) -> list[Finding]:
    """What a result says, whatever its scene looked like.

    Args:
        deformations: of each load step.
        touching: whether there is contact anywhere; None for a scene without.
    """
    found = []
    worst = max(deformations, key=lambda deformation: deformation.largest)
    far = f"displacements of up to {worst.displacement:.2g} times the size of the body"
    if worst.gradient > SMALL_DEFORMATION:
        message = (
            f"strains and rotations of {worst.gradient:.2g} on average, {far}: this is no small deformation, of which "
            "alone linear elasticity speaks; check the units of E, of the loads and of the lengths"
        )
        found.append(Finding("warning", "material, traction, body_force, displacement", message))
    elif worst.displacement > SMALL_DEFORMATION:
        message = (
            f"{far}, by strains and rotations of {worst.gradient:.2g} on average: the body travels, while gap and "
            "normals are those of where it was; check the gap and the unit of lengths"
        )
        found.append(Finding("warning", "contact.gap, displacement", message))
    if touching is False:
        message = "nothing is in contact; where contact was expected, check the gap, the loads and their units"
        found.append(Finding("warning", "contact.gap", message))
    return found


def _pieces(body: Body) -> list[Finding]:
    """A body in several pieces: each of them must be held."""
    pieces = body.motions.pieces
    if pieces.count == 1:
        return []
    listed = "; ".join(pieces.describe(piece) for piece in range(min(pieces.count, _MOST_LISTED)))
    more = f"; and {pieces.count - _MOST_LISTED} more" if pieces.count > _MOST_LISTED else ""
    pairs = [
        f"{one + 1} and {other + 1}" for one, other in zip(*np.unique(np.sort(pieces.pins), axis=0).T, strict=True)
    ]
    hinges = f"; hinges, where they share a single vertex, join {', '.join(pairs[:_MOST_LISTED])}" if pairs else ""
    message = (
        f"the mesh of the body is in {pieces.count} pieces that share no side, so that each must be held by itself: "
        f"{listed}{more}{hinges}; where one body is meant let the cells share their nodes (in gmsh: fragment)"
    )
    return [Finding("note", "mesh", message)]


# Pieces that a message lists one by one.
_MOST_LISTED = 4


# --- equilibrium -----------------------------------------------------------------------------------------------------


def _equilibrium(body: Body, law: FrictionLaw | None) -> list[Finding]:
    """Motions without strain that the supports leave free: whether contact can resist them, and balance the loads.

    Each assembly of pieces is judged by itself.
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
    loads = [_load_on(body, step) for step in range(body.scene.steps)]
    found = []
    for number, columns, _ in motions.assemblies():
        own = None if every is None else every.of(number, columns)
        on = [(work[columns], sizes[number]) for work, sizes in loads]
        found.append(_equilibrium_of(motions, number, columns, own, on, has_friction=law is not None))
    return found


def _equilibrium_of(
    motions: RigidMotions,
    number: int,
    columns: npt.NDArray[np.bool_],
    contact: Reactions | None,
    loads: list[tuple[_Rows, float]],
    *,
    has_friction: bool,
) -> Finding:
    """Whether one assembly is in equilibrium.

    Args:
        motions: all motions.
        number: of the assembly.
        columns: its free motions, k of them.
        contact: reactions of its contact nodes, None for a scene without contact.
        loads: of each load step what it does on these motions, forces, shape (k,), and the sum of its nodal forces.
        has_friction: whether a friction law acts anywhere.
    """
    free = motions.free[:, columns]
    several = motions.pieces.count > 1
    members = np.flatnonzero(motions.pieces.assembly == number)
    it = "the body"
    if several:
        it = motions.pieces.describe(int(members[0])) if members.size == 1 else "pieces joined by hinges"
    cone, given, directions = _cone(contact, free.shape[1])
    loose = _null_space(directions)
    if loose.shape[1]:
        names = _motions(free @ loose, motions, members)
        who, advice = "the supports do not resist", "prescribe a displacement"
        if contact is not None:
            who, advice = "neither the supports nor the contact resists", f"{advice}, or add friction"
        return Finding("warning", "displacement", f"nothing holds {it}: {who} {names}; {advice}")
    pushed, away_in = False, []
    for step, (load, size) in enumerate(loads):
        pushed = pushed or float(np.linalg.norm(load)) > _ZERO * size
        away = _unbalanced(cone, load)
        left = float(np.linalg.norm(away))
        if left > _ZERO * size and left**2 > np.abs(given @ away).sum():
            away_in.append((step + 1, _motions(free @ away[:, None], motions, members)))
    of_it = f" of {it}" if several else ""
    if away_in:
        steps = [step for step, _ in away_in]
        when = ""
        if len(loads) > 1:
            when = f"load step{'s' * (len(steps) > 1)} {_runs(steps)}: "
        return Finding(
            "warning",
            "traction, body_force",
            f"{when}there is no static equilibrium{of_it}: the loads drive {away_in[0][1]}, which neither the supports "
            "nor the contact can stop: turn the loads, prescribe a displacement, or raise the friction",
        )
    assert contact is not None
    alone = "friction" if has_friction and _null_space(contact.normal).shape[1] else "the contact alone"
    text = f"the supports do not hold {_motions(free, motions, members)}: {alone} must"
    if several:
        text = f"{it}: {text}"
    if not pushed and np.linalg.matrix_rank(given) < free.shape[1] and not contact.bilateral.any():
        message = f"{text}, but no load presses {it} on its foundation: its position is not determined"
        return Finding("warning", "traction, body_force", message)
    return Finding("note", "displacement", f"{text}, and the loads press the body on")


def _runs(steps: list[int]) -> str:
    """Numbers in order, runs of them shortened."""
    runs: list[list[int]] = []
    for step in steps:
        if runs and step == runs[-1][-1] + 1:
            runs[-1].append(step)
        else:
            runs.append([step])
    return ", ".join(str(run[0]) if len(run) == 1 else f"{run[0]} to {run[-1]}" for run in runs)


def _cone(contact: Reactions | None, count: int) -> tuple[_Rows, _Rows, _Rows]:
    """Contact reactions against so many motions, one a row.

    Returns:
        Generators, of length 1, of the cone that pressure and Coulomb friction can balance (a cap is not counted); what
        given friction balances at most, in either direction; the directions in which there is any reaction.
    """
    if contact is None:
        none = np.empty((0, count))
        return none, none, none
    c, share = contact, contact.coefficient[:, None]
    edges = [c.normal + share * c.tangential, c.normal - share * c.tangential, c.normal]
    rough = c.coefficient > _ROUGH
    edges += [c.tangential[rough], -c.tangential[rough]]
    edges += [-edge[c.bilateral] for edge in edges[:3]]
    cone = np.concatenate(edges)
    sizes = np.linalg.norm(cone, axis=1)
    directions = np.concatenate([c.normal, c.tangential[(c.coefficient > 0) | (c.given > 0)]])
    return cone[sizes > _ZERO] / sizes[sizes > _ZERO, None], c.given[:, None] * c.tangential, directions


def _load_on(body: Body, step: int) -> tuple[_Rows, _Rows]:
    """L of the free motions, shape (k,), and the sum of the sizes of the nodal forces on each assembly; collective."""
    motions = body.motions
    forces = sum((load.factors[step] * load.forces for load in body.applied), np.zeros(body.fixed.size))
    nodal = np.asarray(forces).reshape(-1, 2)
    work = motions.free.T @ motions.resultant(nodal, body.comm)
    assembly = motions.pieces.assembly[motions.piece[: len(nodal)]]
    sizes = np.linalg.norm(nodal, axis=1, keepdims=True)
    return work, parallel.sums_by(body.comm, assembly, sizes, int(motions.pieces.assembly.max()) + 1).ravel()


def _null_space(rows: _Rows) -> _Rows:
    """Directions, one a column, across all the rows."""
    values, vectors = np.linalg.eigh(rows.T @ rows)
    null: _Rows = vectors[:, values <= _ZERO**2 * max(float(values[-1]), 1e-300)]
    return null


def _unbalanced(generators: _Rows, load: _Rows) -> _Rows:
    """What is left of a load when the cone has taken all that it can: load minus its projection onto the cone.

    The rest r satisfies generators r <= 0: a motion that every reaction lets happen.  (``scipy.optimize.nnls`` of SciPy
    1.15 is wrong for one random cone in forty.)
    """
    scale = float(np.linalg.norm(load))
    if scale == 0.0 or not len(generators):
        return load.copy()
    found = lsq_linear(generators.T, load / scale, (0.0, np.inf), method="bvls", tol=1e-14)
    rest: _Rows = load - scale * (found.x @ generators)
    return rest


def _motions(moved: _Rows, motions: RigidMotions, members: npt.NDArray[np.int64]) -> str:
    """Names of motions of an assembly, combinations as in ``RigidMotions.free``, one a column."""
    found = []
    for piece in members:
        own = moved[3 * piece : 3 * piece + 3]
        vectors, values, _ = np.linalg.svd(own, full_matrices=False)
        own = own if members.size == 1 else vectors[:, values > _SLIGHT * np.abs(moved).max()]
        if own.shape[1]:
            names = _names(own, motions.centre[piece], float(motions.length[piece]))
            found.append(names if members.size == 1 else f"{motions.pieces.describe(int(piece))} in {names}")
    more = f", and {len(found) - _MOST_LISTED} more pieces" if len(found) > _MOST_LISTED else ""
    return ", ".join(found[:_MOST_LISTED]) + more


# A piece that moves by less than this share of another one is at rest.
_SLIGHT = 1e-6


def _names(motions: _Rows, centre: _Rows, length: float) -> str:
    """Names of motions of one piece (translation x, translation y, rotation), one a column."""
    _, values, rows = np.linalg.svd(motions[2:3], full_matrices=True)
    turning = values.size > 0 and values[0] > 1e-6
    shifts = motions @ (rows[1:].T if turning else np.eye(motions.shape[1]))
    names = []
    if shifts.shape[1] == 2:
        names.append("translations")
    if shifts.shape[1] == 1:
        along = shifts[:2, 0] / np.linalg.norm(shifts[:2, 0])
        along = along * np.sign(along[np.argmax(np.abs(along))]) if motions.shape[1] > 1 else along
        names.append(f"the translation along ({_round(along[0])}, {_round(along[1])})")
    if turning and motions.shape[1] > 1:
        names.append("rotations")
    elif turning:
        shift_x, shift_y, angle = motions[:, 0]
        x, y = centre + length / angle * np.array([-shift_y, shift_x])
        names.append(f"the rotation about ({_round(x)}, {_round(y)})")
    return " and ".join(names)


def _round(value: float) -> str:
    return f"{round(float(value), 6) + 0.0:.4g}"


# --- gaps and displacements ------------------------------------------------------------------------------------------


def _gaps(body: Body, data: RegularisedData, moved: float, *, estimates: bool) -> list[Finding]:
    boundary = body.boundary
    assert boundary is not None
    comm, size = boundary.comm, body.tagged.size
    unilateral = np.ones(boundary.size, dtype=bool) if data.bilateral is None else ~data.bilateral
    smallest = -parallel.global_max(comm, parallel.local_max(-data.gap, -np.inf))
    found = []
    if smallest < -_ZERO * size:
        level: Literal["warning", "note"] = "warning" if -smallest > 0.01 * size else "note"
        found.append(
            Finding(
                level,
                "contact.gap",
                f"the gap is negative, down to {smallest:g}: the body penetrates its foundation before it is loaded",
            )
        )
    two_sided = parallel.any_rank(comm, not unilateral.all())
    if body.motions.free.shape[1] > 0 or two_sided:
        return found
    if smallest >= -_ZERO * size and moved == 0.0:
        message = "there is no load, and every prescribed displacement is 0: the solution is 0"
        found.append(Finding("warning", "traction, body_force, displacement", message))
    elif estimates and smallest > _FAR * moved:
        found.append(
            Finding(
                "warning",
                "contact.gap",
                f"the smallest gap is {smallest:g}, while prescribed displacements and loads move the body by about "
                f"{moved:.1g} (an estimate): contact will hardly ever close; check the gap and the units",
            )
        )
    return found


def _heights(body: Body) -> list[Finding]:
    """Gaps that look like the height above the foundation, where they are measured along normals that turn."""
    boundary = body.boundary
    assert boundary is not None
    found = []
    for index, effect in enumerate(body.scene.contact):
        if effect.direction is not None or isinstance(effect.gap, float):
            continue
        here = boundary.part == index
        step = _STEP * body.tagged.size
        slope = _slope(effect.gap, boundary.x[here], step)
        for direction in _fall_lines(slope, boundary.comm):
            # A height falls by one per unit of length along its direction, wherever the foundation is.
            heights = np.abs(slope @ direction + 1.0) <= _SAME_SLOPE
            along = boundary.normal[here] @ direction
            count, number, total = parallel.global_sum(
                boundary.comm, np.array([np.count_nonzero(heights), heights.size, along[heights].sum()], dtype=float)
            )
            least = -parallel.global_max(boundary.comm, parallel.local_max(-along[heights], -1.0))
            turned = math.degrees(math.acos(min(1.0, max(-1.0, least))))
            if 2 * count > number and 2 * total > count and turned > _TURNED:
                told = ", ".join(_round(c) for c in direction)
                message = (
                    f"it looks like the distance to the foundation along ({told}), but it is measured along the "
                    f"normals, which turn by up to {turned:.0f} degrees from there: write direction = [{told}], or "
                    "give the distance along the normals"
                )
                found.append(Finding("warning", f"contact[{index}].gap", message))
                break
    return found


# A gap is a height if it falls by one along a direction, up to this; normals turn if by more than so many degrees.
_SAME_SLOPE, _TURNED = 1e-5, 5.0
# Step of the differences, over the size of the body.
_STEP = 1e-4


def _slope(gap: Any, x: _Rows, step: float) -> _Rows:
    """Gradient of a gap by differences, shape (n, 2); infinite where it cannot be had."""
    slope = np.full(x.shape, np.inf)
    for axis in range(2):
        values = []
        for sign in (1.0, -1.0):
            points = np.zeros((3, len(x)))
            points[:2] = x.T
            points[axis] += sign * step
            values.append(sample(gap, points))
        with np.errstate(invalid="ignore"):
            slope[:, axis] = (values[0] - values[1]) / (2 * step)
    return np.where(np.isfinite(slope).all(axis=1)[:, None], slope, np.inf)


def _fall_lines(slope: _Rows, comm: MPI.Comm) -> list[_Rows]:
    """Directions along which a gap of this gradient may be a height: the axes, and the line of steepest descent."""
    lines = [np.array(axis) for axis in ((0.0, -1.0), (0.0, 1.0), (-1.0, 0.0), (1.0, 0.0))]
    known = slope[np.isfinite(slope).all(axis=1)]
    *total, count = parallel.global_sum(comm, np.append(known.sum(axis=0), float(len(known))))
    mean = np.array(total) / max(count, 1.0)
    if abs(float(np.hypot(*mean)) - 1.0) <= _SAME_SLOPE:
        lines.append(-mean)
    return lines


def _large_displacements(body: Body, moved: float) -> list[Finding]:
    """Loads under which linear elasticity is not what is wanted; as a rule two units do not agree."""
    size = body.tagged.size
    if moved < size:
        return []
    message = (
        f"loads and prescribed displacements move the body by about {moved:.1g} (an estimate), its size is {size:.3g}: "
        "no small deformation; check the units of E and of the loads"
    )
    return [Finding("warning", "material, traction, body_force, displacement", message)]


def _acts(body: Body) -> bool:
    """Whether there is a load or a prescribed displacement in any load step; collective."""
    acting = [load for load in body.applied if any(load.factors)]
    return parallel.any_rank(body.comm, any(load.forces.any() or load.start.any() for load in acting))


def _displacement_scale(body: Body, step: int) -> float:
    """Largest prescribed displacement, and what a beam of the body's outline would bend under the loads, a length."""
    owned = sum((load.factors[step] * load.start for load in body.applied), np.zeros(body.fixed.size))
    prescribed = parallel.global_max(body.comm, parallel.local_max(np.abs(owned)))
    force = float(_load_on(body, step)[1].sum())
    x = body.tagged.mesh.geometry.x[:, :2].astype(np.float64)
    low, high = parallel.global_bounds(body.comm, x)
    softest = min(material.young for material in body.scene.material)
    return prescribed + 4 * force / softest * float(body.tagged.size / (high - low).min()) ** 3


# --- uniqueness, gamma, methods --------------------------------------------------------------------------------------


def friction_indication(material: LinearElastic) -> float:
    """The friction coefficient above which several solutions are to be reckoned with: sqrt(3 - 4 nu) / (2 - 2 nu).

    An indication, no theorem.  On a half-plane a wave exp(i k s) of the pressure changes the tangential displacement,
    and this the pressure; for every k, the fixed point that Coulomb friction is contracts below this coefficient
    (1 / sqrt(S_NN C_TT), with the stiffness S and the compliance C of the surface, does not depend on k).  A bound for
    uniqueness that is both proved and independent of the mesh is not known: a solution exists for every coefficient in
    two dimensions (Ballard and Iurlano, arXiv:2303.16298), the discrete one is unique below a bound that falls to zero
    with the mesh size (Hild, Int. J. Appl. Math. Comput. Sci. 12 (2002) 41-50), and examples with several solutions
    are known.
    """
    nu = material.poisson
    if material.hypothesis == "plane stress":
        nu = nu / (1 + nu)
    return math.sqrt(3 - 4 * nu) / (2 - 2 * nu)


def _uniqueness(scene: Scene, boundary: ContactBoundary, law: FrictionLaw | None) -> list[Finding]:
    limit = min(friction_indication(material) for material in scene.material)
    found = []
    for index, _ in enumerate(scene.contact):
        here = np.zeros(0) if law is None else law.coefficient[boundary.part == index]
        largest = parallel.global_max(boundary.comm, parallel.local_max(here))
        if largest > limit:
            found.append(
                Finding(
                    "warning",
                    f"contact[{index}].friction.coefficient",
                    f"F = {largest:g} is above {limit:.3g} (an indication from the half-plane, no proven bound): the "
                    "problem may have several solutions and the fixed point may not contract; compare solutions from "
                    "different solver.initial_contact, and try solver.coulomb = 'newton'",
                )
            )
    return found


def _regularisation(scene: Scene, data: RegularisedData, natural: float) -> list[Finding]:
    """Gamma and sigma against E over the size of the body."""
    settings, found = scene.solver, []
    gammas = {"gamma_n": data.gamma_n, "gamma_t": data.gamma_t}
    if not scene.has_friction:
        del gammas["gamma_t"]
    # Path-following looks for gamma itself; exact ends without.
    for name, gamma in gammas.items() if settings.algorithm not in ("path-following", "exact") else ():
        if gamma > LARGEST_GAMMA * natural:
            message = (
                f"{gamma:g} is above {LARGEST_GAMMA * natural:.1g}, {LARGEST_GAMMA:g} times E over the size of the "
                "body: round-off takes the digits of the pressures; set 'auto', or algorithm = 'alm' or 'exact'"
            )
            found.append(Finding("warning", f"solver.{name}", message))
        if gamma < START_GAMMA * natural and settings.algorithm != "alm":
            error = "a penetration" if name == "gamma_n" else "an elastic slip"
            message = (
                f"{gamma:g} is below {START_GAMMA * natural:.1g}, {START_GAMMA:g} times E over the size of the body: "
                f"{error} of about {min(1.0, natural / gamma):.0%} of the displacements is to be expected; set "
                "'auto', or algorithm = 'alm'"
            )
            found.append(Finding("warning", f"solver.{name}", message))
    if scene.has_friction and data.sigma * data.gamma_t <= 1.0 + 1e-9 and data.gamma_t > START_GAMMA * natural:
        message = f"{data.sigma:g} is not above 1 / gamma_t: the slip sets cycle where gamma_t is large; set 'auto'"
        found.append(Finding("warning", "solver.sigma", message))
    return found


def _monolithic(scene: Scene) -> list[Finding]:
    """Where coulomb = newton is not what will be done."""
    if scene.solver.coulomb != "newton" or not scene.has_coulomb:
        return []
    capped = any(isinstance(c.friction, CoulombFriction) and c.friction.cap is not None for c in scene.contact)
    reasons = {
        "a cap": capped,
        "bilateral contact": any(contact.kind == "bilateral" for contact in scene.contact),
    }
    given = [reason for reason, holds in reasons.items() if holds]
    if not given:
        return []
    return [
        Finding("note", "solver.coulomb", f"newton does not go with {' and '.join(given)}: the fixed point is used")
    ]
