"""What is refused of a scene on its mesh before anything is solved: the one place that ``solve`` and ``check`` share.

``prepare`` finds what is wrong with single entries and the mesh.  Here is what follows from several of them, and would
otherwise be noticed only on the way to the first solution.
"""

from __future__ import annotations

from signorini_fx.errors import SceneError
from signorini_fx.extensions import add_on
from signorini_fx.mechanics.body import contact_data
from signorini_fx.mechanics.model import Model


def refuse_beforehand(d: Model) -> None:
    """Refuse what no solve begins with; collective.

    Args:
        d: the model, whose stiffness need not be assembled; with a requested accuracy on its first one.

    Raises:
        SceneError: the first sets of contact hold no node; ``exact`` has no unknown for a constraint; nothing
            determines the pressure of an incompressible body; a foundation moves although contact alone holds the body;
            a certified accuracy is asked for where there is no guaranteed bound.
        InstallationError: the scene asks for a proof by an add-on that is not installed.
    """
    d.refuse_enclosed()
    if d.boundary is not None:
        contact_data.first_sets(d.statement, d.boundary)
        if d.statement.solver.algorithm == "exact":
            d.boundary.aligned()
        _refuse_moving(d)
    for proof in ("error_bound", "uniqueness"):
        if getattr(d.statement.solver, proof):
            add_on(proof)  # not after hours
    if d.statement.accuracy is not None and d.statement.accuracy.certified and (why := add_on("why_unbounded")(d)):
        raise SceneError([("accuracy.certified", why)])


def _refuse_moving(d: Model) -> None:
    """Refuse a foundation that moves with the time where supports do not hold the body."""
    if not d.motions.free.shape[1] or d.statement.steps < 2:
        return
    wrong = (
        "moves with the time, so that supports must hold the body, and not contact alone: add them, or let a force "
        "move the foundation (keys force and prescribed)"
    )
    problems = [(f"contact[{k}].foundation", wrong) for k, effect in enumerate(d.statement.contact) if effect.moves]
    if problems:
        raise SceneError(problems)
