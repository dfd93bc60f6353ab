"""Findings about a result: what is odd about it, and what to do about it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem
from mpi4py import MPI

from signorini_fx.algebra.algorithms.task import Outcome, Task
from signorini_fx.algebra.contact.points import pushed
from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.body.deformation import Deformation
from signorini_fx.mechanics.body.elastic_body import ElasticBody
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.contact_points.contact_table import contact_table
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.obstacles.shapes_inside import BodyCells
from signorini_fx.mechanics.rigid.rigid_motions import names_of, rounded
from signorini_fx.records import Finding, Status
from signorini_fx.results.mechanics import StepResult
from signorini_fx.tuned import NOTABLE, SAME_LENGTH

Array = npt.NDArray[np.float64]


def pushed_nodes(steps: Sequence[ContactState | None], size: float) -> list[Finding]:
    """One finding for each contact with nodes that supports hold inside the foundation, from the load step where one
    lies deepest; ``size``: of the body, length; collective.

    No contact pressure keeps such a node outside: the supports take whatever it would be, and the node transmits
    nothing in contact (``complementarity.trial_pressure``).
    """
    deepest: dict[int, tuple[float, str]] = {}
    for contact in steps:
        if contact is None:
            continue
        boundary, depth = contact.boundary, contact.held_inside
        held = pushed(depth, size)
        columns = np.column_stack((boundary.part, depth, contact.bilateral, boundary.x))[held]
        rows = np.unique(parallel.gather_rows(boundary.comm, columns), axis=0)
        for part in np.unique(rows[:, 0]).astype(int):
            of_part = rows[rows[:, 0] == part, 1:]
            largest = float(of_part[:, 0].max())
            if largest > deepest.get(part, (0.0, ""))[0]:
                deepest[part] = largest, _message(of_part, largest, size)
    return [Finding("warning", f"contact[{part}], displacement", deepest[part][1]) for part in sorted(deepest)]


def _message(rows: Array, depth: float, size: float) -> str:
    """Of the nodes of one contact: depths, whether contact cannot open, and places, shape (n, 2 + d)."""
    # The first of those that are as deep, whatever the number of ranks.
    most = rows[rows[:, 0] >= depth - SAME_LENGTH * size]
    length, bilateral, *place = most[np.lexsort(most[:, 2:].T[::-1])[0]]
    at = ", ".join(rounded(c, size) for c in place)
    where = f"{'off' if bilateral else 'inside'} the foundation"
    nodes, they = ("node", "it transmits") if len(rows) == 1 else ("nodes", "they transmit")
    return (
        f"supports hold {len(rows)} contact {nodes} {where}, by {length:.3g} at ({at}): {they} nothing, the "
        "supports carry what acts there; check the gap beside them, or end the contact boundary before them"
    )


def facets_in_result(body: Model, contact: ContactState) -> Iterator[Finding]:
    """Contacts of two bodies whose pressure is that of the distances between the chords of their curved sides;
    collective.

    The slopes of both sides differ by the angles between facets; slope times modulus is a pressure.
    """
    from signorini_fx.results.accuracy.pressure_error import chords, polygon_error

    if compat.geometry_degree(body.tagged.mesh) > 1:
        return
    table = contact_table(contact, *body.statement.sides)
    assert table.nodes is not None
    assert body.data is not None
    for index, effect in enumerate(body.statement.contact):
        if effect.against is None or effect.distance != "geometry" or effect.kind == "bonded":
            continue
        pressure = np.where(table.nodes[:, 0] == index, table.columns["pressure"], 0.0)
        own = replace(table, columns={**table.columns, "pressure": pressure})
        if polygon_error(own, body.scales.modulus) < 1:
            continue
        names, on_part = (effect.boundary, effect.against), contact.boundary.part == index
        angles, lengths = chords(own)
        off = float(np.max(angles * lengths)) / 4  # an eighth of the product on either side
        gap = body.data.gap[on_part]
        gap = gap + parallel.largest(body.comm, -gap, -np.inf)
        if parallel.largest(body.comm, gap[gap <= off]) > NOTABLE * off > 0:  # else the nodes of both sides match
            text = (
                f"straight facets of {names[0]!r} and {names[1]!r} are up to {off:.2g} off the curved sides that they "
                "are chords of, and the distances between them change the pressure as much as the loads do: take "
                'smaller facets, curved cells, or distance = "nominal"'
            )
            yield Finding("warning", f"contact[{index}].distance", text)


def shapes_in_results(foundations: Iterable[tuple[str, Any, Any]], displacement: fem.Function) -> Iterator[Finding]:
    """Foundations between the nodes of a result, or in parts of the body that are in no contact; ``foundations``: the
    name of each, its shape where it is in the result, None: it has none, and what is added to its distance, without
    which number it is not looked at; collective.
    """
    cells = None
    for name, shape, added in foundations:
        if shape is None or getattr(shape, "driven", False) or not isinstance(added, int | float):
            continue
        space = displacement.function_space
        cells = cells or BodyCells.of(space)
        deep = cells.inside(cells.placed(displacement.x.array), shape, float(added))
        if deep is not None:
            message = (
                f"a part of the foundation lies inside the deformed body, {deep}: between two nodes, or where there is "
                "no contact boundary; take facets that are not wider than the foundation, and more of the boundary"
            )
            yield Finding("warning", name, message)


def result_findings(deformations: Sequence[Deformation], unjudged: Sequence[str]) -> Iterator[Finding]:
    """Findings about a result; ``unjudged``: names of bodies whose forces are round-off of those of others."""
    if unjudged:
        message = (
            f"the forces on {', '.join(unjudged)} are round-off of the largest ones of the scene: its results mean "
            "nothing, and the certificate does not judge it; solve it in a scene of its own"
        )
        yield Finding("warning", "body, traction, displacement", message)
    worst = max(deformations, key=lambda deformation: deformation.largest)
    far = f"displacements of up to {worst.displacement:.2g} times the size of the body"
    if worst.gradient > NOTABLE:
        message = (
            f"strains and rotations of {worst.gradient:.2g} on average, {far}: the deformation is not small, as "
            "linear elasticity assumes; check the units of E, of the loads and of the lengths"
        )
        yield Finding("warning", "material, traction, body_force, displacement", message)
    elif worst.displacement > NOTABLE:
        message = (
            f"{far}, by strains and rotations of {worst.gradient:.2g} on average: the body moves far, while gap and "
            "normals are those of its initial position; check the gap and the unit of lengths"
        )
        yield Finding("warning", "contact.gap, displacement", message)


def untouched(comm: MPI.Comm, steps: Sequence[StepResult]) -> Iterator[Finding]:
    """A finding where contact touches nothing in any load step; collective."""
    contacts = [step.contact.in_contact.any() for step in steps if step.contact is not None]
    if contacts and not parallel.any_rank(comm, bool(np.any(contacts))):
        message = "nothing is in contact; where contact was expected, check the gap, the loads and their units"
        yield Finding("warning", "contact.gap", message)


# --- bodies that lie loose: nothing presses on them, and they can move without touching anything ----------------------


def explained(body: Model, task: Task, outcome: Outcome, when: str) -> Finding | None:
    """Which bodies lie loose where contact opens without a load that opens it; ``when``: the name of the load step with
    a colon, or ""; None: it is another outcome; collective.
    """
    if outcome.status is not Status.OPEN:
        return None
    loose = task.idle
    if len(loose) < len(task.motions.assemblies):  # what a load moves away lies beside them
        loose = task.motions.untouched(loose, np.asarray(np.column_stack(outcome.newton.multipliers()).any(axis=1)))
    if not loose:
        return None
    message = (
        f"{when}nothing presses on {_named(body, loose)}: it lies loose, and many positions are in equilibrium; press "
        "it on, or prescribe a displacement"
    )
    return Finding("warning", body.statement.forces_at, message)


def loose_in(body: ElasticBody, step: StepResult) -> list[int]:
    """The assemblies that supports do not hold, and that have no tractions in a load step; collective."""
    motions = body.at_contact
    if step.contact is None or not motions.count:
        return []
    pressed = np.asarray(np.column_stack((step.contact.pressure, step.contact.shear)).any(axis=1))
    return motions.untouched([number for number, _ in motions.assemblies], pressed)


def loose_at_rest(
    body: ElasticBody, steps: Sequence[StepResult], path: str, names: tuple[str, ...] = ()
) -> Iterator[Finding]:
    """Load steps that leave what the supports do not hold near to where it was, as nothing presses on it; ``names``: of
    the bodies that its pieces are, if the pieces have none; collective.
    """
    loose = {step.step: numbers for step in steps if (numbers := loose_in(body, step))}
    if len(steps) == 1 or not loose:
        return
    which = f"load step{'s' * (len(loose) > 1)} {', '.join(map(str, loose))}"
    bodies = _named(body, sorted(set().union(*loose.values())), names)
    message = (
        f"{which}: nothing presses on {bodies}: it is left as near as possible to where it was, one of many positions "
        "in equilibrium"
    )
    yield Finding("note", path, message)


def _named(body: ElasticBody, loose: Sequence[int], names: tuple[str, ...] = ()) -> str:
    """These assemblies with their free motions; ``names``: see ``loose_at_rest``."""
    motions = body.motions
    if names:
        motions = replace(motions, pieces=replace(motions.pieces, bodies=names))
    members = np.flatnonzero(np.isin(motions.pieces.assembly, loose))
    free = names_of(motions.of_all[:, np.isin(motions.assembly, loose)], motions, members)
    if members.size == 1 and motions.moving is None:
        return f"the body, of which the supports do not hold {free}"
    return f"{free}, which the supports do not hold"
