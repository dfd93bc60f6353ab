"""What to do with a result."""

from __future__ import annotations

from itertools import groupby
from typing import Any

import numpy as np

from signorini_fx.machine.display import duration, storage
from signorini_fx.machine.result_files import in_space
from signorini_fx.quantities.digits import percent
from signorini_fx.quantities.validity import Validity, validity_of
from signorini_fx.tuned import FEW_NODES


def next_steps(summary: dict[str, Any], contact: dict[str, Any]) -> list[str]:
    """What to do with this result, most urgent first.

    Args:
        summary: the content of summary.json.
        contact: columns of contact.csv; empty without contact.
    """
    advice, validity = [], validity_of(summary)
    if validity is not Validity.SOLUTION:
        advice.append(
            "The first thing to do is stated at the top. Before the next solve, signorini-fx check SCENE reports what "
            "may go wrong, and why."
        )
        if validity is not Validity.LESS_ACCURATE:
            return advice
    prices = summary.get("convergence_table", [])
    if prices:
        *_, last, following = prices
        errors = {name: last[name] for name in ("energy", "pressure", "force", "zone", "peak") if last[name]}
        error_text = ", ".join(f"{name} {percent(value)}" for name, value in errors.items())
        effort = duration(following["seconds"]), storage(1024**2 * following["memory"])
        cost = f"{' and '.join(effort)}, {following['dofs']} unknowns"
        energy = f", energy error then {percent(following['energy'])}" if following["energy"] else ""
        advice.append(f"Estimated errors of this mesh: {error_text}. The next one would take about {cost}{energy}.")
        if last["energy"] and last["regularisation"] > 0.2 * last["energy"]:
            advice.append(
                "The regularisation takes a notable part of the error: raise solver.gamma_n and solver.gamma_t, or "
                "take solver.algorithm = 'path-following' or 'alm'."
            )
    elif contact and "steps" not in summary:
        mean = (summary.get("stress") or {}).get("error")
        stress_error = "" if mean is None else f" (that of the stress is about {percent(mean)} in the mean)"
        if not in_space(summary) and "forms" not in summary["scene"]:
            cure = "solve with --levels 3 (a mesh from a generator), or ask for an accuracy, as with --accuracy 0.05"
        elif all({"generator", "file"} & set(mesh or ()) for mesh in _meshes(summary["scene"])):
            cure = "ask for an accuracy, as with --accuracy 0.2"
        else:  # not every mesh from Python can be refined
            cure = "solve on a finer mesh as well, and compare"
        advice.append(f"The error of the contact figures has not been estimated{stress_error}: {cure}.")
    if contact:
        runs = _zone_sizes(contact)
        if runs and min(runs) < FEW_NODES:
            advice.append(
                f"A contact zone has only {min(runs)} node{'s' * (min(runs) > 1)}: refine there before its ends or "
                "its largest pressure are used."
            )
        if np.any(contact["bound"] > 0) and not np.any(contact["friction"] == "stick"):
            advice.append("Every node with friction slips: friction is at its limit.")
    if summary.get("fields"):
        advice.append(f"Look at the fields in ParaView: {', '.join(summary['fields'])}.")
    return advice


def _meshes(scene: dict[str, Any]) -> list[Any]:
    """The mesh of a scene, or those of its bodies."""
    return [body["mesh"] for body in scene.get("body") or ()] or [scene["mesh"]]


def _zone_sizes(contact: dict[str, Any]) -> list[int]:
    """The number of nodes in contact in each zone of a curve, in 3D on each boundary in contact."""
    closed = contact["state"] != "open"
    if "s" not in contact:
        return [int(count) for count in np.unique(contact["boundary"][closed], return_counts=True)[1]]
    # The arc length starts again with each connected piece, and so with each boundary.
    piece = np.cumsum(np.diff(contact["s"], prepend=-1.0) <= 0)
    to_next = contact.get("to_next", np.zeros(piece.size))
    sizes = []
    for number in np.unique(piece):
        touching = closed[piece == number]
        if to_next[piece == number][-1] > 0 and not touching.all():
            touching = np.roll(touching, -int(np.argmin(touching)))  # a closed piece begins where it is open
        sizes += [len(list(run)) for state, run in groupby(touching) if state]
    return sizes
