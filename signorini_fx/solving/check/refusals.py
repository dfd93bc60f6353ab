"""What is refused of a scene on its mesh before anything is solved: the one place that ``solve`` and ``check`` share.

``prepare`` finds what is wrong with single entries and the mesh.  Here is what follows from several of them, and would
otherwise be noticed only on the way to the first solution.
"""

from __future__ import annotations

from signorini_fx.errors import SceneError
from signorini_fx.extensions import add_on
from signorini_fx.mechanics.contact_points.first_sets import first_sets
from signorini_fx.mechanics.model import Model


def refuse_beforehand(model: Model, *, linear: bool = True) -> None:
    """Refuse what no solve begins with; ``linear``: whether this body is what is solved, and not that of nonlinear
    materials at small strains; collective.

    Raises:
        SceneError: the first sets of contact hold no node; nothing determines the pressure of an incompressible body;
            a foundation moves although contact alone holds the linear body; a certified accuracy is asked for where
            there is no guaranteed bound.
        InstallationError: the scene asks for a proof by an add-on that is not installed.
    """
    if model.elastic.pressed and model.elastic.encloses(model.vector, model.prescribed):
        reason = "nothing determines the pressure: supports hold the whole boundary of the incompressible body"
        raise SceneError([("displacement", reason)])
    if model.boundary is not None:
        first_sets(model.statement, model.boundary)
        if linear:
            _refuse_moving(model)
    if model.statement.solver.error_bound:
        add_on("error_bound")  # not after hours
    if (
        model.statement.accuracy is not None
        and model.statement.accuracy.certified
        and (why := add_on("why_unbounded")(model))
    ):
        raise SceneError([("accuracy.certified", why)])


def _refuse_moving(model: Model) -> None:
    """Refuse a foundation that moves with the time where supports do not hold the body."""
    if not model.motions.free.shape[1] or model.statement.steps < 2:
        return
    wrong = (
        "moves with the time, so that supports must hold the body, and not contact alone: add them, or let a force "
        "move the foundation (keys force and prescribed)"
    )
    problems = [(f"contact[{k}].foundation", wrong) for k, effect in enumerate(model.statement.contact) if effect.moves]
    if problems:
        raise SceneError(problems)
