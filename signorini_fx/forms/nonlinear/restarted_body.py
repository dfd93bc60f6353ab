"""The load steps of a nonlinear body in a checkpoint.

Stored are the displacement of a load step, that at which its last tangent was formed, and the iterate of the contact
problem of that.  All else follows as load steps are gone through again: each is certified anew, and the state of
materials, slips and the ways of shapes are those of the displacements.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from dolfinx import fem

from signorini_fx.algebra.contact.nodal_vectors import Nodal
from signorini_fx.errors import FormError
from signorini_fx.forms.elasticity import MatrixError
from signorini_fx.forms.nonlinear.linearised import LinearisedProblem
from signorini_fx.forms.nonlinear.residual import Residual
from signorini_fx.mechanics.pairs.mortar_coupling import PairingError
from signorini_fx.records import Timings
from signorini_fx.results.mechanics import StepResult
from signorini_fx.results.restart_files import Figures
from signorini_fx.solving.checkpointed_steps import MeshCheckpoint

_SOLUTION, _TANGENT = "solution", "tangent"


def recalled(linear: LinearisedProblem, checkpoint: MeshCheckpoint, figures: Figures, residual: Residual) -> bool:
    """Give a body the displacement and the contact of its next load step, with loads and shapes as they are in it;
    whether they fit; collective.
    """
    number, tools = linear.step, linear.moving_tools
    fields = checkpoint.beside(number, linear.space, (_SOLUTION, _TANGENT))
    if fields is None:
        checkpoint.forget(number)
        return False
    (solution, tangent), shape = fields, tools.coordinates.shape
    coordinates = {
        name: np.array(values, dtype=np.float64).reshape(shape) for name, values in figures["coordinates"].items()
    }
    try:
        if residual.at(tangent.x.array.copy()) is None:
            return False
        tools.carry_to(coordinates[_TANGENT])
        linear.begin_at_tangent(definite=figures["definite"], symmetric=figures["symmetric"])
        start = replace(linear.begun, place=float(figures["place"]), factors=np.ones(1))
        outcome = checkpoint.recall(linear.elastic, linear.scales.size, linear.task, start)
    except (FormError, MatrixError, PairingError):
        return False
    if outcome is None:
        return False
    linear.accept(outcome)
    tools.carry_to(coordinates[_SOLUTION])
    residual.u.x.array[:] = solution.x.array
    return True


def store(
    linear: LinearisedProblem,
    checkpoint: MeshCheckpoint,
    step: StepResult,
    tangent: tuple[Nodal, Nodal],
    timings: Timings,
    marks: tuple[int, int, int],
    more: Figures,
) -> None:
    """Store a load step that has a solution; ``tangent``: where the last tangent was formed: values of the
    displacement, and coordinates of tools; collective.
    """
    assert linear.outcome is not None
    ways = {_SOLUTION: linear.moving_tools.coordinates.tolist(), _TANGENT: tangent[1].tolist()}
    kind = {"definite": bool(linear.definite), "symmetric": bool(linear.symmetric)}
    figures = more | {"linear_solves": step.linear_solves, "coordinates": ways} | kind
    at, start = fem.Function(linear.space), replace(linear.begun, place=step.place)
    at.x.array[:] = tangent[0]
    beside, result = {_SOLUTION: step.displacement, _TANGENT: at}, replace(step, displacement=linear.u.copy())
    checkpoint.store(linear.elastic, timings, linear.task, start, linear.outcome, result, marks, figures, beside)
