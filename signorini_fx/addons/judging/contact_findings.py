"""What figures of contact say against a result, and in which words."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from signorini_fx.addons.judging.contact_figures import JudgedContactFigures, contact_stiffness
from signorini_fx.addons.judging.judgement import JudgedFinding
from signorini_fx.addons.judging.problem_data import JudgedContact, JudgedProblem
from signorini_fx.mechanics.mesh.files.shape import Floats
from signorini_fx.tuned import (
    JUDGED_BOUND_ENERGY,
    JUDGED_CONE,
    JUDGED_ENTERED,
    JUDGED_FORCE_APART,
    JUDGED_HARD_DEPTH,
    JUDGED_LAW,
    JUDGED_PENALTY_ENERGY,
    JUDGED_REACTION,
    JUDGED_SLIP_BELOW,
    JUDGED_SOFTNESS,
    JUDGED_TENSION,
    JUDGED_TOLD,
    JUDGED_WRONG_WAY,
)


def contact_findings(
    problem: JudgedProblem, figures: JudgedContactFigures, *, unknown: bool
) -> Iterator[JudgedFinding]:
    """What is to be said of a contact.

    Args:
        problem: the problem.
        figures: of the contact.
        unknown: whether the element formulation is not known, which makes forces less certain.
    """
    name = figures.surface.contact.name
    tension, cone, below = JUDGED_TENSION[unknown], JUDGED_CONE[unknown], JUDGED_SLIP_BELOW[unknown]
    apart = JUDGED_FORCE_APART[unknown]
    if problem.hypothesis == "plane stress":
        below = JUDGED_SLIP_BELOW[True]

    def finding(key: str, text: str, value: float, threshold: float, corner: int, share: float) -> JudgedFinding:
        node = int(figures.surface.corners[corner])
        at = tuple(problem.mesh.points[node].tolist())
        number = int(problem.mesh.names[node])
        where = f"worst at node {number} ({', '.join(f'{x:g}' for x in at)}) of {name}"
        return JudgedFinding(key, f"{text}, {where}", value, threshold, share, number, at)

    def percent(value: float) -> str:
        return f"{100 * value:.2g} %"

    stated = contact_stiffness(problem, figures.surface)
    explained = stated > 0 or figures.surface.contact.law is not None
    depth = JUDGED_ENTERED if explained else JUDGED_HARD_DEPTH
    entered = figures.entered if explained else figures.penetration
    if entered > depth:
        text = f"enters by {percent(figures.penetration)} of the largest displacement"
        yield finding("penetration", text, entered, depth, figures.deepest, figures.penetration)
    if figures.tension > tension:
        text = f"pulls with {percent(figures.tension)} of the contact force"
        yield finding("tension", text, figures.tension, tension, figures.pulling, figures.tension)
    if figures.apart > apart:
        text = f"{percent(figures.apart)} of the contact force acts where the sides are apart"
        yield finding("apart", text, figures.apart, apart, figures.beside, figures.apart)
    elif figures.apart + figures.coarse > apart:
        text = f"the facets with {percent(figures.coarse)} of the force are too large to tell whether they touch"
        yield finding("coarse", text, figures.apart + figures.coarse, apart, figures.coarsest, figures.coarse)
    if figures.is_soft and figures.unlawful > JUDGED_LAW[unknown]:
        law = figures.surface.contact.law
        assert law is not None
        text = f"{percent(figures.unlawful)} of the contact force is not by {law.words} of soft contact"
        yield finding("law", text, figures.unlawful, JUDGED_LAW[unknown], figures.misfit, figures.unlawful)
    if figures.cone > cone:
        text = "shear without friction"
        if figures.surface.contact.rubs:
            text = f"friction {figures.cone:.3g} times its bound at {figures.cone_count} nodes"
        text += f" with {percent(figures.cone_share)} of the force"
        yield finding("cone", text, figures.cone, cone, figures.above, figures.cone_share)
    if figures.surface.slip_known:
        if figures.wrong_way > JUDGED_WRONG_WAY:
            text = f"friction along the slip, {percent(figures.wrong_way)} of the energy"
            yield finding("wrong way", text, figures.wrong_way, JUDGED_WRONG_WAY, figures.forward, figures.wrong_way)
        if figures.slips_below > below and figures.slips_energy > JUDGED_BOUND_ENERGY:
            text = f"slips below the bound of friction, by {percent(figures.slips_below)} of its work"
            yield finding("slip", text, figures.slips_below, below, figures.slack, figures.slips_energy)
    yield from _of_penalty(figures, stated, finding)


def _of_penalty(figures: JudgedContactFigures, stated: float, finding: Any) -> Iterator[JudgedFinding]:
    """How hard contact is."""
    if figures.penalty_energy <= JUDGED_PENALTY_ENERGY or not np.isfinite(figures.stiffness):
        return
    shown = f"contact has the stiffness {figures.stiffness:.3g}"
    share = figures.penalty_energy
    if stated > 0 and figures.stiffness < stated / JUDGED_SOFTNESS:
        text = f"{shown}, {figures.stiffness / stated:.2g} times the problem's {stated:.3g}"
        yield finding("penalty", text, figures.stiffness, stated, figures.deepest, share)
    elif figures.surface.contact.stiffness is None or figures.stiffness > JUDGED_SOFTNESS * stated:
        text = f"{shown}, with {100 * share:.2g} % of the energy"
        yield finding("another penalty", text, figures.stiffness, stated, figures.deepest, share)


@dataclass(frozen=True)
class ContactReaction:
    """The forces of both sides of a contact of two bodies.

    Attributes:
        contact: it.
        missing: of the sum of both over the sum of the sizes of all forces.
        factor: of the force of one side against that of the other one.
        parallel: whether both forces are parallel, so that another factor of a modulus explains it.
        unloaded: a body without loads of its own; "": both have some.
    """

    contact: JudgedContact
    missing: float
    factor: float
    parallel: bool
    unloaded: str

    def finding(self, *, balanced: bool, unknown: bool) -> JudgedFinding | None:
        """What it says against a result; None: nothing.

        Args:
            balanced: whether both bodies are in equilibrium, so that a modulus may explain it.
            unknown: whether the element formulation is not known.
        """
        limit = JUDGED_REACTION[unknown]
        if self.missing <= limit:
            return None
        if balanced and self.parallel and self.unloaded:
            text = (
                f"the modulus of {self.unloaded} is {1 / self.factor:.3g} times the problem's, by action and reaction"
            )
            return JudgedFinding("factors", text, self.missing, limit, self.missing)
        text = f"the forces of {self.contact.name} and {self.contact.against} differ by {100 * self.missing:.2g} %"
        return JudgedFinding("reaction", text, self.missing, limit, self.missing)


def reactions(problem: JudgedProblem, residual: Floats, doubt: float) -> list[ContactReaction]:
    """Action and reaction of contacts of bodies that both deform, in directions in which nothing holds them.

    Args:
        problem: the problem.
        residual: internal forces less loads, force, shape (n, d).
        doubt: how large a force may be that is none, see ``Equilibrium.doubt``.
    """
    listed = []
    for contact in problem.contacts:
        if not contact.opposite.size or not problem.deformable[contact.nodes].all():
            continue
        sides = np.unique(contact.facets), np.unique(contact.opposite)
        rivals = [rival for rival in problem.contacts if rival is not contact]
        if problem.linked[contact.nodes].any() or any(np.isin(contact.nodes, rival.nodes).any() for rival in rivals):
            continue
        free = np.isnan(problem.prescribed[contact.nodes]).all(axis=0)
        if not free.any():
            continue
        first, second = (residual[nodes][:, free].sum(axis=0) for nodes in sides)
        size = max(float(np.linalg.norm(residual[nodes], axis=1).sum()) for nodes in sides)
        size = max(size, doubt / JUDGED_REACTION[False])
        if not size > 0:
            continue
        missing = float(np.linalg.norm(first + second)) / size
        factor = -float(first @ second) / float(first @ first) if first.any() else 0.0
        remainder = float(np.linalg.norm(second + factor * first)) / size
        parallel = factor > 0 and remainder <= JUDGED_REACTION[False] and abs(factor - 1) > JUDGED_REACTION[False]
        unloaded = contact.against if not _loaded(problem, sides[1]) else ""
        listed.append(ContactReaction(contact, missing, 1 / factor if factor else 0.0, parallel, unloaded))
    return listed


def _loaded(problem: JudgedProblem, nodes: Any) -> bool:
    """Whether loads or initial strains act on the body of some nodes."""
    of_body = np.isin(problem.mesh.bodies, np.unique(problem.mesh.bodies[nodes]))
    cells = of_body[problem.mesh.cells[:, 0]]
    return any(strain.at_nodes[cells].any() for strain in problem.strains) or any(
        forces[of_body].any() for forces in problem.loads.values()
    )


def figures_of_contact(
    problem: JudgedProblem, contacts: Sequence[JudgedContactFigures], sides: Sequence[ContactReaction], *, unknown: bool
) -> dict[str, dict[str, Any]]:
    """The gravest of each figure over all contacts, with its threshold."""
    if not contacts:
        return {}
    below = JUDGED_SLIP_BELOW[unknown or problem.hypothesis == "plane stress"]
    limits = {
        "tension": JUDGED_TENSION[unknown],
        "penetration": None,
        "entered": JUDGED_ENTERED,
        "penalty_energy": JUDGED_PENALTY_ENERGY,
        "apart": JUDGED_FORCE_APART[unknown],
        "cone_ratio": JUDGED_CONE[unknown],
        "cone_share": None,
        "wrong_way": JUDGED_WRONG_WAY,
        "slip_below_bound": below,
    }
    attributes = {"cone_ratio": "cone", "slip_below_bound": "slips_below"}
    figures: dict[str, dict[str, Any]] = {
        name: {"value": max(getattr(figure, attributes.get(name, name)) for figure in contacts), "threshold": limit}
        for name, limit in limits.items()
    }
    figures |= _coefficients(contacts, below, JUDGED_CONE[unknown])
    soft = [figure for figure in contacts if figure.is_soft]
    figures["gives_way"] = {"value": max(figure.gives_way for figure in contacts), "threshold": None}
    figures["unlawful"] = {"value": None, "reason": "contact is hard"}
    if soft:
        value = max(figure.unlawful for figure in soft)
        figures["unlawful"] = {"value": value, "threshold": JUDGED_LAW[unknown]}
    if not all(figure.surface.slip_known for figure in contacts):
        for name in ("wrong_way", "slip_below_bound"):
            figures[name] = {"value": None, "reason": "slip counts from the load step before, which is not there"}
    stiffness = [figure.stiffness for figure in contacts if np.isfinite(figure.stiffness)]
    figures["stiffness"] = {"value": min(stiffness) if stiffness else None, "threshold": None}
    turned = max(float(figure.surface.rotation.max(initial=0.0)) for figure in contacts)
    figures["rotation"] = {"value": turned, "threshold": None}
    figures["reaction"] = {"value": None, "reason": "the other side does not deform"}
    if sides:
        figures["reaction"] = {"value": max(side.missing for side in sides), "threshold": JUDGED_REACTION[unknown]}
    return figures


def _coefficients(contacts: Sequence[JudgedContactFigures], below: float, cone: float) -> dict[str, dict[str, Any]]:
    """Between which times the problem's coefficient another one would fit as well, by the displacement.

    From below where no shear exceeds its bound; up to where, at the slip there is, less of its work than thresholds say
    would be missing.  Where the problem's own does not fit, as shear is above ``cone`` times its bound, there is none.
    """
    rubbing = [figure for figure in contacts if figure.surface.contact.rubs]
    reason = "no friction" if not rubbing else "shear exceeds its bound"
    if not rubbing or max(figure.cone for figure in rubbing) > cone:
        return {name: {"value": None, "reason": reason} for name in ("coefficient_from", "coefficient_to")}
    work = max(figure.slip_work for figure in rubbing)
    figures: dict[str, dict[str, Any]] = {
        "coefficient_from": {"value": min(1.0, max(figure.used for figure in rubbing)), "threshold": None},
        "coefficient_to": {"value": None, "reason": "nearly all sticks: friction cannot be told"},
    }
    if not all(figure.surface.touched.all() for figure in rubbing):
        figures["coefficient_to"]["reason"] = "slip counts since the sides touch, which they did not at first"
    if not all(figure.surface.slip_known for figure in rubbing):
        figures["coefficient_to"]["reason"] = "slip counts from the load step before, which is not there"
    elif work > 0 and (most := max(1.0 / (1.0 - below), 1.0 + JUDGED_BOUND_ENERGY / work)) <= JUDGED_TOLD:
        figures["coefficient_to"] = {"value": most, "threshold": None}
    return figures


def contact_lines(contacts: Sequence[JudgedContactFigures], figures: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    """Contact, penetration and friction in words; ``figures``: see ``figures_of_contact``."""
    if not contacts:
        return {}
    nodes = sum(len(figure.surface.corners) for figure in contacts)
    touching = sum(figure.touching for figure in contacts)
    force = sum(figure.force for figure in contacts)
    worst = max(contacts, key=lambda figure: figure.penetration)
    stiffness = f" by their stiffness {worst.stiffness:.2g}" if np.isfinite(worst.stiffness) else ""
    tension, apart = (max(getattr(figure, name) for figure in contacts) for name in ("tension", "apart"))
    lines = {
        "contact": f"{touching} of {nodes} nodes, force {force:.4g}; {100 * tension:.2g} % of it pulls, "
        f"{100 * apart:.2g} % acts where the sides are apart",
        "penetration": f"{100 * worst.penetration:.2g} % of the largest displacement{stiffness}, "
        f"{100 * worst.penalty_energy:.2g} % of the energy",
    }
    rubbing = [figure for figure in contacts if figure.surface.contact.rubs]
    lines["friction"] = "none"
    if rubbing:
        cone = max(figure.cone for figure in rubbing)
        wrong = max(figure.wrong_way for figure in rubbing)
        lines["friction"] = f"at most {cone:.3g} times its bound, {100 * wrong:.2g} % of the energy along the slip"
        low, high = (figures[f"coefficient_{end}"] for end in ("from", "to"))
        if low["value"] is not None and high["value"] is None:
            lines["friction"] += f"; any coefficient from {low['value']:.2g} times it on may fit: {high['reason']}"
        elif low["value"] is not None:
            lines["friction"] += f"; {low['value']:.2g} to {high['value']:.3g} times the coefficient fits"
    return lines
