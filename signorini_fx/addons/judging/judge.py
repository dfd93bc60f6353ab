"""``judge``: a verdict on another program's displacement of a contact problem.

The order: is it a result of this mesh; are units and supports those of the problem; is it in equilibrium in some
element formulation, or with other loads or moduli; do contact and friction hold; how far is it from the solution.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from signorini_fx.addons.judging.contact_figures import JudgedContactFigures, contact_figures
from signorini_fx.addons.judging.contact_findings import contact_findings, contact_lines, figures_of_contact, reactions
from signorini_fx.addons.judging.distance import measured_distance
from signorini_fx.addons.judging.expanded_sections import as_they_move
from signorini_fx.addons.judging.factors import FoundFactors, force_factor, found_factors, unseen_factors
from signorini_fx.addons.judging.foreign_equilibrium import BestFit, Equilibrium, JudgedStiffness, best_fit, hourglass
from signorini_fx.addons.judging.foreign_result import ForeignResult, read_result
from signorini_fx.addons.judging.judgement import JudgedFinding, Judgement, sorted_findings
from signorini_fx.addons.judging.problem_data import JudgedProblem
from signorini_fx.addons.judging.problems import judged_problem
from signorini_fx.addons.judging.touching_surface import bond_jumps, touching_surface
from signorini_fx.mechanics.mesh.files.shape import Floats
from signorini_fx.tuned import (
    JUDGED_BOND,
    JUDGED_BY_QUADRATURE,
    JUDGED_CARRIES,
    JUDGED_DIGITS,
    JUDGED_FACTOR_LEFT,
    JUDGED_FORCES,
    JUDGED_SAME_TIME,
    JUDGED_SUPPORTS,
    JUDGED_TOLD,
    JUDGED_UNITS,
)


def judge(problem: object, result: object, *, compare: bool = True) -> Judgement:
    """Judge another program's result.

    Args:
        problem: the path of an input file (.inp) of Abaqus or CalculiX, or of a scene file; or a ``Scene``.
        result: the displacements: the path of a .dat or .frd file of CalculiX, of a .csv or .vtu; or an array of shape
            (n, d), in the order of the nodes of the input file or of the mesh of the scene; or a mapping from numbers
            of nodes to displacements.
        compare: solve the problem, too, for the distance from the solution and what stands beside it.

    Raises:
        MeshError: a file cannot be read, or the array has another shape.
        SceneError: the scene is wrong.
    """
    begun = time.perf_counter()
    stated, reasons = judged_problem(problem)
    theirs = read_result(result, stated)
    about: dict[str, Any] = {
        "program": theirs.program,
        "element": stated.element,
        "formulation": None,
        "step": None if stated.deck is None else max(1, len(stated.deck.steps)),
        "time": theirs.time,
        "digits": theirs.digits,
    }
    findings = [JudgedFinding("judged", reason) for reason in reasons] or _unusable(stated, theirs)
    if findings:
        return Judgement(theirs.name, sorted_findings(findings), about, lost=stated.lost)
    return _Judging(stated, theirs, about, begun).judgement(compare=compare)


def _unusable(problem: JudgedProblem, theirs: ForeignResult) -> list[JudgedFinding]:
    """Why a result is none, or cannot be judged."""
    values, needed = theirs.displacement, problem.deformable
    if np.isinf(values).any():
        return [JudgedFinding("result", "it has values that are not finite")]
    missing = needed & np.isnan(values).any(axis=1)
    if missing.any():
        count, name = np.count_nonzero(missing), problem.mesh.names[np.argmax(missing)]
        text = f"{count} of {np.count_nonzero(needed)} nodes have no displacement, such as node {name}"
        if missing[needed].all() and problem.mesh.dim == 2 and theirs.program:
            text += "; of plane elements write *NODE FILE without OUTPUT=3D"
        return [JudgedFinding("judged", text)]
    if not np.abs(values[needed]).max(initial=0.0) > 0:
        return [JudgedFinding("result", "nothing moves at all")]
    times = theirs.time, problem.time
    if times[0] is not None and times[1] is not None and not np.isclose(times[0], times[1], rtol=JUDGED_SAME_TIME):
        return [JudgedFinding("result", f"it ends at time {times[0]:g}, and the problem at {times[1]:g}")]
    if theirs.digits is not None and theirs.digits < JUDGED_DIGITS:
        text = f"it is printed with {theirs.digits} digits, of which {JUDGED_DIGITS} at least are needed"
        return [JudgedFinding("judged", text)]
    return []


@dataclass
class _Judging:
    """The way to a verdict.

    Attributes:
        problem: the problem.
        theirs: the result.
        about: what is known of it.
        begun: when it began, seconds.
        integrated: how loads are integrated or initial strains taken, in words, if not as they are stated.
    """

    problem: JudgedProblem
    theirs: ForeignResult
    about: dict[str, Any]
    begun: float
    integrated: str = ""

    def judgement(self, *, compare: bool) -> Judgement:
        """See ``judge``."""
        v, largest, equilibrium = self._equilibrium(self.theirs)
        if not equilibrium.threshold < 1.0:
            lost = JudgedFinding("judged", "it is a rigid motion or free expansion but for digits that it has not")
            return Judgement(self.theirs.name, (lost,), self.about, lost=self.problem.lost)
        # Of bodies of revolution it is nearly known: up to 5e-3 of the energy norm is left.
        of_calculix = self.theirs.program.startswith("CalculiX") and self.problem.hypothesis != "axisymmetric"
        best = best_fit(equilibrium, of_calculix=of_calculix)
        if (unprinted := as_they_move(self.theirs, self.problem)) is not None:
            candidate = self._equilibrium(unprinted)
            if (fits := best_fit(candidate[2])).fit.rho < best.fit.rho:  # it is no file of ours, which has what moves
                self.theirs, (v, largest, equilibrium), best = unprinted, candidate, fits
        readings = [("", equilibrium, best)]
        for words, fields in {} if best.exact else self.problem.other_readings().items():
            problem = replace(equilibrium.problem, **fields)
            with_them = Equilibrium(problem, v, self.theirs.half_units, equilibrium.system)
            readings.append((words, with_them, best_fit(with_them, of_calculix=of_calculix)))
            if readings[-1][-1].exact:
                break
        # One that is exact, else one in which another factor of a load or a modulus is, else as it is stated.
        self.integrated, equilibrium, best = next(
            (reading for reading in readings if reading[2].exact),
            next((reading for reading in readings if _explains(*reading[1:])), readings[0]),
        )
        problem = self.problem = equilibrium.problem
        findings: list[JudgedFinding] = []
        lines: dict[str, str] = {}
        figures: dict[str, dict[str, Any]] = {}
        factors: Mapping[str, float] = {}
        supports, finding = self._supports(v, largest)
        figures["supports"] = supports
        finding = finding or self._parted(v, largest)
        lines["supports"] = f"kept, largest deviation {supports['value']:.2g} of the largest displacement"
        if finding is not None:
            findings.append(finding)
            lines["supports"] = finding.text
        residual = best.fit.residual
        self.about["formulation"] = best.fit.formulation.words
        unit = self._unit_factor(equilibrium, best, v)
        explained = None if best.exact or unit is not None else found_factors(equilibrium, best)
        balanced = best.exact or best.similar or self._hourglass(best)
        if unit is None and explained is None and not balanced:
            doubt = JUDGED_BY_QUADRATURE * equilibrium.by_quadrature
            if best.fit.rho <= doubt:
                text = "initial strains have a jump or a kink inside cells, where programs take different points"
                lost = JudgedFinding("judged", text, best.fit.rho, doubt)
                return Judgement(self.theirs.name, (lost,), self.about, lost=problem.lost)
        if explained is not None:
            best = replace(best, fit=explained.fit)
            self.about["formulation"] = best.fit.formulation.words
        if unit is not None:
            text = f"it is {unit:.4g} times what the problem has in its units"
            findings.append(JudgedFinding("units", text, unit))
        elif explained is not None:
            factors, residual = explained.changed, explained.residual
            findings.append(JudgedFinding("factors", self._of_factors(explained), explained.remainder))
        elif not balanced:
            findings.append(self._unbalanced(equilibrium, best))
        elif not best.as_stated and not self._hourglass(best):
            findings.append(JudgedFinding("element", f"it is in equilibrium with {best.fit.formulation.words}"))
        if best.exact and finding is None and self.theirs.forces is not None:
            findings += self._of_forces(best, self.theirs.forces)
        lines["balance"] = _balance(equilibrium, best, explained)
        if self._hourglass(best):
            lines["balance"] += f"; the stiffness of {problem.element} against hourglassing is not known"
        figures["equilibrium"] = {"value": best.fit.rho, "threshold": best.resolution}
        figures["printed"] = {"value": equilibrium.printed, "threshold": None}
        unknown = not best.exact and explained is None
        contacts = self._contacts(v, residual, equilibrium, best)
        named = reactions(problem, residual, equilibrium.doubt(best.fit))
        if unit is None:
            for figure in contacts:
                findings += contact_findings(problem, figure, unknown=unknown)
            in_equilibrium = best.exact or explained is not None
            for side in named:
                differing = side.finding(balanced=in_equilibrium, unknown=unknown)
                findings += [differing] if differing is not None else []
        figures |= figures_of_contact(problem, contacts, named, unknown=unknown)
        lines |= contact_lines(contacts, figures)
        error: Mapping[str, Any] = {}
        beside: Mapping[str, Any] = {}
        if compare and unit is None:
            distance = measured_distance(
                problem, v, contacts, partial(self._own_contacts, equilibrium.system), supported=finding is None
            )
            error, beside = distance.error, distance.beside
            lines |= distance.lines
        head = self._head(best, equilibrium)
        lines = {"theirs": head, **lines, "effort": f"{time.perf_counter() - self.begun:.1f} s"}
        return Judgement(
            self.theirs.name,
            sorted_findings(findings),
            self.about,
            figures,
            factors,
            error,
            beside,
            {fit.formulation.words: fit.rho for fit in best.tried},
            problem.lost,
            lines,
        )

    def _equilibrium(self, theirs: ForeignResult) -> tuple[Floats, float, Equilibrium]:
        """The displacement of a result, completed by what is prescribed, its largest one, and its equilibrium."""
        v = np.where(np.isnan(theirs.displacement), np.nan_to_num(self.problem.prescribed), theirs.displacement)
        largest = float(np.linalg.norm(v[self.problem.deformable], axis=1).max())
        linked = self.problem.linked_in(v, JUDGED_SUPPORTS * largest)
        return v, largest, Equilibrium(linked, v, theirs.half_units)

    def _head(self, best: BestFit, equilibrium: Equilibrium) -> str:
        words = [self.theirs.program, self.problem.element]
        fit = f"{best.fit.formulation.words} fits to {best.fit.rho:.0e}, print round-off {equilibrium.printed:.0e}"
        when = "" if self.theirs.time is None else f"step {self.about['step']}, time {self.theirs.time:g}"
        return ", ".join(filter(None, [*words, fit, self.integrated, when]))

    def _hourglass(self, best: BestFit) -> bool:
        return hourglass(self.problem) and best.similar

    def _supports(self, v: Floats, largest: float) -> tuple[dict[str, Any], JudgedFinding | None]:
        away = np.abs(np.nan_to_num(v - self.problem.prescribed))
        node, axis = divmod(int(np.argmax(away)), away.shape[1])
        apart = np.abs(self.problem.links @ v.ravel())
        untied = float(apart.max(initial=0.0) / largest)
        value = max(float(away.max() / largest), untied)
        figure = {"value": value, "threshold": JUDGED_SUPPORTS}
        if value <= JUDGED_SUPPORTS:
            return figure, None
        if untied == value:
            worst = int(np.argmax(apart))
            name, at = self._named(int(self.problem.links.indices[self.problem.links.indptr[worst]]) // v.shape[1])
            text = f"a tie or equation of node {name} {_shown(at)} is off by {apart[worst]:.4g}"
            return figure, JudgedFinding("supports", text, value, JUDGED_SUPPORTS, None, name, at)
        name, at = self._named(int(node))
        meant = float(self.problem.prescribed[node, axis])
        text = (
            f"node {name} {_shown(at)} is moved by {v[node, axis]:.4g} along {'xyz'[axis]}, prescribed is {meant:.4g}"
        )
        return figure, JudgedFinding("supports", text, value, JUDGED_SUPPORTS, None, name, at)

    def _parted(self, v: Floats, largest: float) -> JudgedFinding | None:
        """The bond whose sides come apart most, in the mean over a facet; None: all hold."""
        parted = [
            (contact, bond_jumps(self.problem, contact, v)) for contact in self.problem.contacts if contact.bonded
        ]
        worst, jumps = max(parted, key=lambda pair: pair[1].max(initial=0.0), default=(None, np.zeros(0)))
        if worst is None or jumps.max(initial=0.0) <= JUDGED_BOND * largest:
            return None
        facet = int(np.argmax(jumps))
        at = tuple(self.problem.mesh.points[worst.facets[facet]].mean(axis=0).tolist())
        text = f"the bond of {worst.name} with {worst.against} is off by {jumps[facet]:.4g} at {_shown(at)}"
        return JudgedFinding("supports", text, float(jumps[facet] / largest), JUDGED_BOND, None, None, at)

    def _named(self, node: int) -> tuple[int, tuple[float, ...]]:
        return int(self.problem.mesh.names[node]), tuple(self.problem.mesh.points[node].tolist())

    def _unit_factor(self, equilibrium: Equilibrium, best: BestFit, v: Floats) -> float | None:
        """By which factor all of it is too large, if that is one of units; None: it is not."""
        meant = np.nan_to_num(self.problem.prescribed)
        square = float((meant**2).sum())
        factors = [float((v * meant).sum()) / square] if square > 0 else []
        loads = -equilibrium.loads.sum(axis=0) - best.fit.forces.strains.sum(axis=0)
        if not best.exact and loads.any():
            internal = best.fit.forces.of_displacement
            (value, *_), residual = equilibrium.least(internal, np.column_stack((loads, best.fit.forces.columns)))
            if equilibrium.size(residual) <= max(equilibrium.threshold, JUDGED_FACTOR_LEFT * best.fit.rho):
                factors.append(float(value))
        return next((f for f in factors if f > 0 and abs(np.log10(f)) > JUDGED_UNITS), None)

    def _of_factors(self, explained: FoundFactors) -> str:
        """In words whose problem it is."""
        if explained.kind == "moduli":
            verbs = {name: "is" if name in self.problem.springs else "are" for name in explained.changed}
            return ", ".join(
                f"its {explained.called(name)} {verbs[name]} {value:.4g} times the problem's"
                for name, value in explained.changed.items()
            )
        named = ", ".join(f"its {name} is {value:.4g} times the problem's" for name, value in explained.changed.items())
        # Initial strains and springs load a body the more the stiffer it is, or the softer.
        alone = not self.problem.strains and not self.problem.springs
        alike = alone and np.ptp(list(explained.factors.values())) <= 1e-3 * max(explained.factors.values())
        return f"{named}, or its moduli are {1 / max(explained.factors.values()):.4g} times" if alike else named

    def _unbalanced(self, equilibrium: Equilibrium, best: BestFit) -> JudgedFinding:
        fit = best.fit
        name, at = self._named(fit.worst)
        moved = float(np.linalg.norm(equilibrium.moved_by(fit)[fit.worst]))
        text = f"residual {100 * fit.rho:.2g} % of the energy norm, most at node {name} {_shown(at)}"
        if fit.worst_share > 0.5:
            text = f"node {name} {_shown(at)} does not fit: it must move by {moved:.2g} to be in balance"
        return JudgedFinding("equilibrium", text, fit.rho, equilibrium.threshold, fit.worst_share, name, at)

    def _of_forces(self, best: BestFit, theirs: Floats) -> list[JudgedFinding]:
        """Their own reactions against those that their displacement exerts."""
        problem = self.problem
        nodes = ~problem.touching & problem.deformable & ~problem.linked
        for forces in problem.loads.values():  # programs differ in whether loads at supports are part of reactions
            nodes &= ~forces.any(axis=1)
        held = np.asarray(~np.isnan(problem.prescribed) & nodes[:, None] & ~np.isnan(theirs))
        if problem.hypothesis == "axisymmetric":
            held[:, 0] = False  # CalculiX prints those of a sector, in which hoop stress has a part along the radius
        if not held.any():
            return []
        factor, remainder = force_factor(theirs, best.fit.residual, held)
        if abs(factor - 1) <= JUDGED_FORCES or remainder > JUDGED_FACTOR_LEFT * abs(factor - 1):
            return []
        text = f"its reactions are {factor:.4g} times those of its displacement with the problem's moduli"
        return [JudgedFinding("factors", text, factor, JUDGED_FORCES)]

    def _contacts(
        self, v: Floats, residual: Floats, equilibrium: Equilibrium, best: BestFit
    ) -> list[JudgedContactFigures]:
        size = float(np.linalg.norm(residual, axis=1).sum())
        size += equilibrium.doubt(best.fit) / JUDGED_CARRIES
        largest = float(np.linalg.norm(v[self.problem.deformable], axis=1).max())
        surfaces = (
            touching_surface(self.problem, contact, v, residual, self.theirs.step_start)
            for contact in self.problem.contacts
            if not contact.bonded
        )
        return [contact_figures(self.problem, surface, equilibrium.energy, largest, size) for surface in surfaces]

    def _own_contacts(self, system: JudgedStiffness, u: Floats) -> list[JudgedContactFigures] | None:
        """The figures of our displacement; None: it is in equilibrium in no formulation."""
        equilibrium = Equilibrium(self.problem, u, np.zeros_like(u), system)
        best = best_fit(equilibrium)
        return self._contacts(u, best.fit.residual, equilibrium, best) if best.exact else None


def _explains(equilibrium: Equilibrium, best: BestFit) -> bool:
    """Whether other factors leave nothing."""
    explained = found_factors(equilibrium, best)
    return explained is not None and explained.remainder <= equilibrium.threshold


def _balance(equilibrium: Equilibrium, best: BestFit, explained: FoundFactors | None) -> str:
    if explained is not None:
        return f"in equilibrium with {explained.words}"
    residual, allowed = (f"{100 * value:.2g} %" for value in (best.fit.rho, equilibrium.threshold))
    unseen = [
        f"the {name} may be {1 + share:.2g} times the problem's"
        if share < JUDGED_TOLD - 1
        else f"the {name} is not seen"
        for name, share in unseen_factors(equilibrium, best.fit).items()
    ]
    return ", ".join([f"residual {residual} of the energy norm", f"{allowed} is allowed", *unseen])


def _shown(at: tuple[float, ...]) -> str:
    return f"({', '.join(f'{x:g}' for x in at)})"
