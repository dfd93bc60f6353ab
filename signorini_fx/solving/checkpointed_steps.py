"""Restart: a load step as it is stored in a checkpoint, and how its outcome is rebuilt from there.

What is stored is the iterate and its sets with the data of its problem.  Multipliers, contact state and certificate
are evaluated again on restart, and a step whose certificate does not hold is solved again.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from dolfinx import fem
from mpi4py import MPI
from pydantic import BaseModel

from signorini_fx.algebra.algorithms.task import Outcome, Start, Task
from signorini_fx.algebra.contact.active_sets import ActiveSets, bound_of_sets, release, slope_of_bound
from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.algebra.contact.nodal_vectors import Nodal, unit
from signorini_fx.machine import parallel
from signorini_fx.mechanics.contact_points.contact_boundary import no_points
from signorini_fx.mechanics.model import ElasticBody
from signorini_fx.records import History, IterationRecord, OuterRecord, Status, Timings, as_rows
from signorini_fx.results.mechanics import StepResult
from signorini_fx.results.restart_files import Checkpoint, Figures


class MeshCheckpoint(Checkpoint):
    """The checkpoint of a run on one of its meshes; all methods are collective."""

    @staticmethod
    def recall_history(figures: Figures, history: History, timings: Timings) -> None:
        """Take the linear solves, problems and events of a load step of an earlier run for those of this one."""
        history.iterations += [IterationRecord(**row) for row in figures["iterations"]]
        history.outer += [OuterRecord(**row) for row in figures["outer"]]
        history.events += figures["events"]
        timings.seconds.update(figures["seconds"])

    def store(
        self,
        body: ElasticBody,
        timings: Timings,
        task: Task,
        start: Start,
        outcome: Outcome,
        result: StepResult,
        marks: tuple[int, int, int],
        more: Figures,
        beside: Mapping[str, fem.Function] | None = None,
    ) -> None:
        """Store a load step that has a solution; ``marks``: see ``load_steps``; ``more``: plain data, and its path."""
        problem, history = outcome.problem, task.history
        boundary = body.boundary or no_points(body.space)
        tangents, cotangents, sets = boundary.tangents, boundary.cotangents, problem.sets
        nodal: dict[str, Nodal] = {
            "contact": sets.contact.astype(np.float64),
            "direction": _in_space(sets.direction, tangents),
            "turning": sets.turning,
        }
        data, rest_t = problem.data, 0.0 if task.rest is None else task.rest.u_t
        nodal["lambda_hat"], nodal["mu_hat"] = data.lambda_hat, _in_space(data.mu_hat, tangents)
        nodal["slip_origin"] = _in_space(data.slip_origin + rest_t, cotangents)
        if data.bound is not None:
            nodal["bound"] = bound_of_sets(sets, np.zeros(data.bound.size), data)
            if (slope := slope_of_bound(sets, data)) is not None:
                nodal["coupling"] = slope
        solves, problems, events = marks
        figures = {
            "place": start.place,
            "parameters": [[each.gamma_n, each.gamma_t, each.sigma] for each in (outcome.data, data)],
            "monolithic": outcome.monolithic,
            "augmented": outcome.augmented,
            "regularisation_error": outcome.regularisation_error,
            "iterations": as_rows(history.iterations[solves:]),
            "outer": as_rows(history.outer[problems:]),
            "events": history.events[events:],
            "seconds": parallel.largest_timings(body.comm, timings.seconds),
            **more,
        }
        if boundary.moving is not None:
            figures["tools"] = body.driven(outcome.displacement(), task.rest).tolist()
        self.write(start.step, result.displacement, boundary, nodal, figures, beside)

    def recall(self, body: ElasticBody, size: float, task: Task, start: Start) -> Outcome | None:
        """How a load step ended, with its iterate in place; None if it does not fit."""
        figures = self.figures(start.step)
        if figures is None:
            return None
        boundary = body.boundary or no_points(body.space)
        stored = self.read(start.step, body.space, boundary, size)
        if stored is None:
            self.forget(start.step)
            return None
        displacement, nodal = stored
        task.begin_step(start)
        if task.rest is not None:
            displacement.x.array[:] -= body.motions.displacement(task.rest.motion).ravel()
        all_unknowns = body.unknowns(displacement)
        if boundary.moving is not None:
            body.begin_driven(all_unknowns, np.array(figures["tools"]), task.rest)
        x = task.system.unknowns(all_unknowns)
        direction = _along(nodal["direction"], boundary.cotangents)
        slipping = np.linalg.norm(direction, axis=1) > 0.5
        direction = np.where(slipping[:, None], unit(direction), 0.0)
        sets = ActiveSets.of(nodal["contact"].ravel() > 0, direction, nodal["turning"].ravel())
        bound, slope = (nodal[name].ravel() if name in nodal else None for name in ("bound", "coupling"))
        origin = _along(nodal["slip_origin"], boundary.tangents) - (0.0 if task.rest is None else task.rest.u_t)
        posed, solved = (
            replace(start.data, gamma_n=gamma_n, gamma_t=gamma_t, sigma=sigma, slip_origin=origin)
            for gamma_n, gamma_t, sigma in figures["parameters"]
        )
        solved = replace(
            solved,
            lambda_hat=nodal["lambda_hat"].ravel(),
            mu_hat=_along(nodal["mu_hat"], boundary.cotangents),
            bound=bound,
            follows=None if bound is None or slope is None else PointFriction(bound, slope),
        )
        sets = release(sets, solved)  # in 3D points without a bound slip in no direction
        newton = task.newton
        newton.pose(solved, sets)
        newton.restore((x, sets, solved))
        return Outcome(
            Status.CONVERGED,
            newton,
            posed,
            monolithic=figures["monolithic"],
            augmented=figures["augmented"],
            regularisation_error=figures["regularisation_error"],
        )


def open_checkpoint(
    comm: MPI.Comm,
    folder: str | Path,
    scene: BaseModel | Mapping[str, Any],
    history: History,
    *,
    restart: bool,
) -> MeshCheckpoint:
    """The ``Checkpoint`` of a run on its first mesh, and in its history what there is to go on from; collective."""
    stored = MeshCheckpoint(comm, folder, scene, restart=restart)
    if restart:
        steps = "1 complete load step" if stored.found == 1 else f"{stored.found} complete load steps"
        history.add(f"restart: {steps} in {stored.path}")
    elif parallel.on_root(comm, stored.path.is_dir):
        history.add(f"restart: not asked for: {stored.path} of a run that has not ended is replaced")
    return stored


def _in_space(vectors: Nodal, tangents: Nodal) -> Nodal:
    """Components, shape (n, d - 1), as vectors, shape (n, d): shears with the tangents, slips with their dual basis."""
    return np.einsum("ijk,ik->ij", tangents, vectors)


def _along(vectors: Nodal, tangents: Nodal) -> Nodal:
    """The inverse of ``_in_space``, with the dual basis."""
    return np.einsum("ijk,ij->ik", tangents, vectors)
