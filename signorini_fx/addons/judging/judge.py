"""``judge``: a verdict on another program's displacement of a contact problem.

The distance of the result from our solution on the same mesh, and on the mesh with halved sides, is
compared with the error of our solution. Beyond that error the certificate of the result shows which
condition it violates, and other problems are tried.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from signorini_fx.addons.decks.results import ForeignResult
from signorini_fx.addons.judging.alternatives import nearest_alternative
from signorini_fx.addons.judging.judged_problem import (
    JudgedProblem,
    NotJudgedError,
    SolutionOnMesh,
    judged_problem,
    read_result,
)
from signorini_fx.arrays import Array, Plain
from signorini_fx.mechanics.mesh.halving import halved
from signorini_fx.results.certificate.contact_nodes import Tractions
from signorini_fx.results.files import for_json
from signorini_fx.tuned import (
    JUDGED_DIGITS,
    JUDGED_FINEST,
    JUDGED_INCREMENTS,
    JUDGED_LEFT,
    JUDGED_UNITS,
    MARGIN,
    NEGLIGIBLE,
    NOTABLE,
)

AGREES = "agrees within the error of the mesh"
ANOTHER = "another problem"
VIOLATES = "violates "
UNDECIDED = "undecided"
# With reduced integration there are as many points as with cells twice as large, on which the error
# is so much larger, and that of displacements and forces by its square.
_COARSER = 2.0
# A condition that is violated by more than this share is so with any elements, unless our solution
# on the next mesh does so at the nodes of this one.
_HALF = 0.5
# Messages about violated conditions of contact, with their share.
_CONDITIONS = {
    "penetration": "sides enter each other by {} of the deformation",
    "tension": "contact pulls with {} of the largest pressure",
    "complementarity": "contact presses across an open gap, by {}",
    "friction": "friction is not that of the slip and the pressure, by {}",
}
# Measures in which a result must agree: the energy norm, and the quantities that users look at.
_MEASURES = {"distance": "energy norm", "displacement": "displacement", "force": "contact force"}


@dataclass(frozen=True)
class Judgement:
    """A verdict on a result.

    Attributes:
        name: name of the result.
        word: ``agrees within the error of the mesh``, ``another problem``, ``violates`` supports,
            equilibrium, penetration, tension, complementarity or friction, or ``undecided``.
        reason: why, in words; "" if the word says all.
        theirs: program, time and digits of the result.
        figures: value and threshold of each figure by name: shares of the energy norm, of the
            largest displacement, of the contact force, and of the largest pressure.
        lost: what the problem as read lacks of its input file.
        lines: the lines below the word, by label.
    """

    name: str
    word: str
    reason: str = ""
    theirs: Mapping[str, Plain] = field(default_factory=dict)
    figures: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    lost: tuple[str, ...] = ()
    lines: Mapping[str, str] = field(default_factory=dict)

    @property
    def agrees(self) -> bool:
        """Whether the result solves the problem, as far as its mesh can show."""
        return self.word == AGREES

    @property
    def exit_code(self) -> int:
        """The exit code of the command: 0 the result agrees, 4 it agrees with what was read of the
        input file, 5 it solves another problem, 6 it violates the problem, 7 no verdict is
        possible.
        """
        return {AGREES: 4 if self.lost else 0, ANOTHER: 5, UNDECIDED: 7}.get(self.word, 6)

    def as_dict(self) -> dict[str, Any]:
        """Return the judgement as plain data for JSON."""
        names = ("word", "reason", "agrees", "exit_code", "theirs", "figures", "lost")
        return dict(for_json({name: getattr(self, name) for name in names}))

    def __str__(self) -> str:
        first = f"{self.name}: {self.word}"
        if self.reason:
            first += f": {self.reason}"
        if self.lost:
            first += " (of the problem as read)"
        lines = [first, *(f"  {label:12s}{text}" for label, text in self.lines.items())]
        lines += [f"  not read    {remark}" for remark in self.lost]
        return "\n".join(lines)


def judge(problem: object, result: object) -> Judgement:
    """Check the displacements that another program has computed for a problem; collective.

    Args:
        problem: the path of an input file (.inp) of Abaqus or CalculiX, or of a scene file; or a
            ``Scene``.
        result: the displacements: the path of a .dat or .frd file of CalculiX, of a .csv or .vtu
            file; or an array of shape (n, d), in the order of the nodes of the input file or of the
            mesh of the scene.

    Raises:
        MeshError: a file cannot be read, or the array has another shape.
        SceneError: the scene is wrong.

    Examples:
        >>> nodes = solution.displacement.x.array.reshape(-1, 2)
        >>> print(sfx.judge(scene, nodes).agrees)
        True
    """
    begun = time.perf_counter()
    stated = judged_problem(problem)
    theirs = read_result(result, stated)
    about = {"program": theirs.program, "time": theirs.time, "digits": theirs.digits}
    judging = _Judging(stated, theirs)
    try:
        word, reason = _of_another_time(stated, theirs) or judging.verdict()
    except NotJudgedError as missing:
        word = UNDECIDED
        reason = str(missing)
    lines = {**judging.lines, "effort": f"{time.perf_counter() - begun:.1f} s"}
    return Judgement(theirs.name, word, reason, about, judging.figures, stated.lost, lines)


def _of_another_time(problem: JudgedProblem, theirs: ForeignResult) -> tuple[str, str] | None:
    """Return the word and the reason for a result that ends at another time than the problem, or
    None.

    Raises:
        NotJudgedError: the result cannot be judged.
    """
    values = theirs.displacement
    if problem.unjudged:
        raise NotJudgedError(problem.unjudged)
    if np.isinf(values).any():
        raise NotJudgedError("it has values that are not finite")
    if np.isnan(values).any(axis=1).all():
        cure = "; of plane elements write *NODE FILE without OUTPUT=3D" if theirs.program else ""
        raise NotJudgedError(f"no node of the problem has a displacement{cure}")
    if not np.abs(np.nan_to_num(values)).max() > 0:
        raise NotJudgedError("nothing moves at all")
    if theirs.digits is not None and theirs.digits < JUDGED_DIGITS:
        raise NotJudgedError(
            f"it is printed with {theirs.digits} digits, of which {JUDGED_DIGITS} at least are "
            "needed"
        )
    ends = theirs.time, problem.time
    if (
        ends[0] is None
        or ends[1] is None
        or np.isclose(ends[0], ends[1], rtol=10.0**-JUDGED_DIGITS)
    ):
        return None
    return ANOTHER, f"it ends at time {ends[0]:g}, and the problem at {ends[1]:g}"


@dataclass(frozen=True)
class EnergyNorms:
    """Energy norms of displacements on the mesh of a result."""

    size: float  # of our solution
    error: float  # of its error, with the margin
    distance: float  # from the result to ours, on this mesh or on the finer one


@dataclass
class _Judging:
    """The figures and lines that lead to a verdict.

    Attributes:
        violated: the text for each condition if it is violated, in the order of the lines.
    """

    problem: JudgedProblem
    theirs: ForeignResult
    figures: dict[str, dict[str, float]] = field(default_factory=dict)
    own: dict[str, float] = field(default_factory=dict)  # what our own meshes let differ
    lines: dict[str, str] = field(default_factory=dict)
    violated: dict[str, str] = field(default_factory=dict)
    on_finer: dict[str, float] = field(default_factory=dict)  # shares of ours on the next mesh

    @cached_property
    def ours(self) -> SolutionOnMesh:
        """Our solution on the mesh of the result."""
        return SolutionOnMesh.of(self.problem, self.problem.arrays)

    @cached_property
    def finer(self) -> SolutionOnMesh | None:
        """Our solution on the next finer mesh, or None if it would take too long or has none."""
        arrays = self.problem.arrays
        if arrays.points.size * 2**arrays.dim > JUDGED_FINEST:
            return None
        try:
            return SolutionOnMesh.of(self.problem, halved(arrays))
        except NotJudgedError:
            return None

    @cached_property
    def read_finer(self) -> Array:
        """Our solution on the finer mesh at the nodes of this mesh, or our solution on this mesh
        without one.
        """
        finer = self.finer
        return self.ours.displacement if finer is None else self.ours.from_finer(finer)

    @cached_property
    def v(self) -> Array:
        """The displacement of the result at all nodes of the mesh, length, shape (n, d)."""
        v = np.full(self.problem.arrays.points.shape, np.nan)
        v[: len(self.theirs.displacement)] = self.theirs.displacement
        fixed = self.ours.held.all(axis=1) & np.isnan(v).any(
            axis=1
        )  # programs need not print what they prescribe
        v[fixed] = self.ours.displacement[fixed]
        missing = np.flatnonzero(np.isnan(v[: len(self.problem.names)]).any(axis=1))
        if missing.size:
            name = self.problem.names[missing[0]]
            raise NotJudgedError(f"{missing.size} nodes have no displacement, such as node {name}")
        return self.ours.completed(v)

    @cached_property
    def norms(self) -> EnergyNorms:
        """The energy norms of our solution, of its error, and of its distance from the result."""
        ours = self.ours
        finer = self.finer
        distance = ours.norm(self.v - ours.displacement)
        if finer is None:
            size = ours.norm(ours.displacement)
            stress = ours.solution.known_stress
            if stress is None or not stress.error:
                raise NotJudgedError("our own solution has no error estimate")
            return EnergyNorms(size, MARGIN * float(stress.error) * size, distance)
        size = finer.norm(finer.displacement)
        error = MARGIN * finer.norm(ours.on_finer(ours.displacement) - finer.displacement)
        on_finer = finer.norm(ours.on_finer(self.v) - finer.displacement)
        return EnergyNorms(size, error, min(distance, on_finer))

    def verdict(self) -> tuple[str, str]:
        """Return the word and its reason."""
        ours = self.ours
        v = self.v
        size = self.norms.size
        error = self.norms.error
        distance = self.norms.distance
        if not size > 0:
            raise NotJudgedError("in our own solution nothing is strained")
        printed = ours.round_off(self.theirs.half_unit)
        allowed = error + printed
        self._figure("distance", distance / size, allowed / size)
        self._head(size, error, distance, printed)
        self._certify(size, allowed)
        self._compare()
        factor = ours.product(v, ours.displacement) / ours.product(
            ours.displacement, ours.displacement
        )
        if factor > 0 and abs(np.log10(factor)) >= JUDGED_UNITS:
            return ANOTHER, f"it is {factor:.4g} times the solution: it has other units"
        if self._value("supports") > NEGLIGIBLE:
            return self._violates("supports")
        on_mesh = ours.norm(v - ours.displacement)
        if on_mesh <= printed + NEGLIGIBLE * size:
            return self._strained_alike()
        agrees = not self._excess(self.own)
        if not agrees and self._in_increments():
            return self._strained_alike("friction")  # that of other load steps
        # So far elements with fewer points may be away.
        farthest = _COARSER * error + printed
        share = NOTABLE if agrees else JUDGED_LEFT
        if nodes := ours.moved_alone(v, min(share * on_mesh, farthest)):
            return (
                VIOLATES + "equilibrium",
                f"forces are not balanced around {' and '.join(map(self._node, nodes))}",
            )
        if other_problem := self._other_problem(on_mesh, share, farthest, printed):
            return ANOTHER, other_problem
        if not self._excess({}):
            return self._strained_alike()
        if any(contact.adjust is not None for contact in self.problem.scene.contact):
            return (
                UNDECIDED,
                "ADJUST moves nodes, and the result belongs to the adjusted mesh",
            )
        if self.problem.lost:
            return (
                UNDECIDED,
                "it is not a result of the problem as read, which lacks what is listed below",
            )
        if distance <= allowed:
            return self._strained_alike()
        worst = self._worst()
        if distance <= farthest and self._value(worst) <= self._most(worst):
            return (
                UNDECIDED,
                "it is less accurate than ours, yet no more than elements with fewer points may be",
            )
        if self._value(worst) > allowed / size:
            return self._violates(worst)
        return (
            ANOTHER,
            "no single load, modulus, gap or friction explains it, and it violates no condition",
        )

    def _strained_alike(self, *but: str) -> tuple[str, str]:
        """Return the word and the reason if the strains are ours within the error.

        A rigid motion, which strains do not show, may still violate contact, and displacement or
        contact force may be farther from ours.
        """
        worst = self._worst(*but)
        excess = self._excess({})
        if self._value(worst) > (self.figures[worst]["threshold"] if excess else self._most(worst)):
            return self._violates(worst)
        if excess:
            cause = "no single load, modulus, gap or friction explains it"
            return UNDECIDED, f"strains are ours, but not the {self._said(excess)}: {cause}"
        return AGREES, ""

    def _worst(self, *but: str) -> str:
        """Return the condition that is violated most, except the supports and those of ``but``."""
        considered = [name for name in self.violated if name not in ("supports", *but)]
        return max(considered, key=self._value)

    def _most(self, condition: str) -> float:
        """Return the share by which a condition may be violated with other elements than ours."""
        return max(_HALF, MARGIN * self.on_finer.get(condition, 0.0))

    def _violates(self, condition: str) -> tuple[str, str]:
        return VIOLATES + condition, self.violated[condition]

    def _value(self, name: str) -> float:
        return self.figures[name]["value"] if name in self.figures else 0.0

    def _figure(self, name: str, value: float, threshold: float) -> None:
        self.figures[name] = {"value": float(value), "threshold": float(threshold)}

    def _excess(self, limits: Mapping[str, float]) -> list[str]:
        """Return the measures that are beyond their limits, or beyond their thresholds where there
        is no limit.
        """
        return [
            name
            for name in _MEASURES
            if name in self.figures
            and self._value(name) > limits.get(name, self.figures[name]["threshold"])
        ]

    def _in_increments(self) -> bool:
        """Return whether the result agrees with our solution in load increments, by which other
        programs solve problems with friction.
        """
        scene = self.problem.scene
        ours = self.ours
        if not any(contact.friction.acts for contact in scene.contact):
            return False
        try:
            u = ours.with_entries({"load_steps": scene.load_steps.remade(steps=JUDGED_INCREMENTS)})
        except NotJudgedError:
            return False
        away = {"distance": ours.norm(self.v - u) / self.norms.size, **self._away(self.v, u)}
        limits = {"distance": self.figures["distance"]["threshold"], **self.own}
        if any(value > limits[name] for name, value in away.items()):
            return False
        for name, value in away.items():
            self._figure(name, value, self.figures[name]["threshold"])
        solved = f"of ours in {JUDGED_INCREMENTS} increments"
        self.lines["distance"] += f"; {_percent(away['distance'])} {solved}"
        self.lines["beside ours"] = f"{self._said(self.own)}, {solved}"
        return True

    def _other_problem(self, on_mesh: float, left: float, farthest: float, printed: float) -> str:
        """Return the other problem that the result solves, in words, or "".

        Args:
            on_mesh: the distance of the result from ours in the energy norm.
            left: the share of this distance that may remain to the other problem.
            farthest: the largest distance that may remain.
            printed: the distance that is due to the last printed digits.
        """
        ours = self.ours
        v = self.v
        enough = min(left * on_mesh + printed, farthest)
        names = [step.name for step in ours.solution.shown_steps]
        steps = [ours.norm(v - step) for step in ours.steps]
        if steps and min(steps) <= enough:
            number = int(np.argmin(steps))
            return f"it is the end of load step {number + 1} {names[number]}".rstrip()
        other = nearest_alternative(ours, v, printed + NEGLIGIBLE * on_mesh)
        if other is None:
            return ""
        share = other.distance / on_mesh
        self.lines["other"] = f"{other.text}, with which it is {share:.2g} of its distance away"
        if other.large:  # so much is no error of a mesh
            enough = min(JUDGED_LEFT * on_mesh + printed, farthest)
        if other.distance <= enough:
            return other.text
        # With other elements an alternative may explain the measures that differ, not the energy.
        excess = self._excess(self.own)
        away = self._away_from(other.displacement)
        explained = bool(excess) and (share < 1 if self._excess({}) else share**2 <= JUDGED_LEFT)
        for name, value in away.items():
            far = _COARSER * self.figures[name]["threshold"]
            explained &= value <= (self.own[name] if name in excess else far)
        return other.text if explained else ""

    def _certify(self, size: float, allowed: float) -> None:
        """Record the figures of the certificate, and the text for each condition if it is
        violated.
        """
        ours = self.ours
        v = self.v
        away = np.where(ours.held, np.abs(v - ours.displacement), 0.0)
        node, axis = divmod(int(away.argmax()), v.shape[1])
        largest = np.linalg.norm(v, axis=1).max()
        missed = float(away.max() / largest)
        meant = f"prescribed is {ours.displacement[node, axis]:.4g}"
        for number, step in enumerate(ours.steps, start=1):
            if np.abs(np.where(ours.held, v - step, 0.0)).max() <= NEGLIGIBLE * largest:
                meant += f": its supports are those at the end of load step {number}"
        self._figure("supports", missed, NEGLIGIBLE)
        moved = f"{self._node(node)} is moved by {v[node, axis]:.4g} along {'xyz'[axis]}"
        self.violated["supports"] = f"{moved}, {meant}"
        self.lines["supports"] = f"missed by {_percent(missed)} of the largest displacement"
        tractions, remaining_forces = ours.tractions(v)
        unbalanced, worst = ours.unbalanced(remaining_forces)
        self._figure("equilibrium", unbalanced / size, allowed / size)
        self.violated["equilibrium"] = f"forces are not balanced, most around {self._node(worst)}"
        self.lines["equilibrium"] = (
            f"{_percent(unbalanced / size)} of the energy norm missing inside the body"
        )
        if tractions is None:
            return
        shares = self._shares(v, tractions)
        if self.finer is not None:
            read = ours.tractions(self.read_finer)[0]
            assert read is not None
            self.on_finer = self._shares(self.read_finer, read)
        for condition, text in _CONDITIONS.items():
            self._figure(condition, shares[condition], allowed / size)
            self.violated[condition] = text.format(_percent(shares[condition]))
        said = [f"{condition} {_percent(share)}" for condition, share in shares.items()]
        self.lines["contact"] = ", ".join(said[:3])
        self.lines["friction"] = f"off by {_percent(shares['friction'])} of the largest pressure"

    def _shares(self, v: Array, tractions: Tractions) -> dict[str, float]:
        """Return by how much a displacement with its tractions violates each condition of
        contact.
        """
        certificate = self.ours.certificate(v, tractions)
        friction = max(
            certificate.friction_cone, certificate.wrong_way_slip, certificate.slip_below_bound
        )
        pressure = certificate.negative_pressure, certificate.pressure_at_distance
        return dict(zip(_CONDITIONS, (certificate.entered, *pressure, friction), strict=True))

    def _compare(self) -> None:
        """Record the distance of displacement and contact force from ours, and the largest distance
        that such meshes explain.
        """
        ours = self.ours
        finer = self.finer
        u = ours.displacement
        size = _largest(u)
        values = self._away(self.v, u)
        if finer is None:
            own = dict.fromkeys(values, self.norms.error / self.norms.size / MARGIN)
        else:
            # A result is read at the nodes of this mesh, and so is our finer solution.
            own = self._away(self.read_finer, u)
            own["displacement"] = _largest(ours.on_finer(u) - finer.displacement) / size
            farther = _largest(ours.on_finer(self.v) - finer.displacement) / size
            values["displacement"] = min(values["displacement"], farther)
            if "force" in own:
                own["force"] = max(own["force"], abs(finer.force() / ours.force() - 1))
                farther = abs(self._force(self.v) - finer.force()) / ours.force()
                values["force"] = min(values["force"], farther)
        round_off = NEGLIGIBLE + self.theirs.half_unit / size
        for name, value in values.items():
            self.own[name] = MARGIN * own[name] + round_off
            # Elements with fewer points or nodes are as far from ours as those of a coarser mesh;
            # where that is little, the energy norm decides.
            other_elements = max(_COARSER**2 * self.own[name], NOTABLE)
            self._figure(name, value, self.own[name] if self.problem.alike else other_elements)
        self.lines["beside ours"] = self._said(self.own)

    def _said(self, names: Iterable[str]) -> str:
        """Return some measures with their thresholds in words."""
        shown = {name: self.figures[name] for name in names}
        return ", ".join(
            f"{_MEASURES[name]} {_percent(one['value'])} (at most {_percent(one['threshold'])})"
            for name, one in shown.items()
        )

    def _away(self, v: Array, w: Array) -> dict[str, float]:
        """Return the differences between two displacements, and between their contact forces,
        relative to ours.
        """
        away = {"displacement": _largest(v - w) / _largest(self.ours.displacement)}
        if self.ours.solution.contact is not None and self.ours.force() > 0:
            away["force"] = abs(self._force(v) - self._force(w)) / self.ours.force()
        return away

    def _away_from(self, w: Array) -> dict[str, float]:
        """Return the differences between the result and a solution on this mesh, see ``_away``, or
        from an estimate of that solution on the finer mesh if these are smaller.
        """
        on_mesh = self._away(self.v, w)
        on_finer = self._away(self.v, w + self.read_finer - self.ours.displacement)
        return {name: min(value, on_finer[name]) for name, value in on_mesh.items()}

    def _force(self, v: Array) -> float:
        return self.ours.force(self.ours.tractions(v)[0])

    def _head(self, size: float, error: float, distance: float, printed: float) -> None:
        theirs = self.theirs
        when = "" if theirs.time is None else f"time {theirs.time:g}"
        digits = (
            ""
            if theirs.digits is None
            else f"{theirs.digits} digits, {_percent(printed / size)} in energy"
        )
        self.lines["theirs"] = (
            ", ".join(filter(None, [theirs.program, when, digits])) or "all digits"
        )
        mesh = "on the next mesh" if self.finer is not None else "by its stresses"
        self.lines["distance"] = f"{_percent(distance / size)} of the energy norm from ours"
        self.lines["our error"] = (
            f"{_percent(error / size)} of the energy norm on this mesh, estimated {mesh}"
        )

    def _node(self, node: int) -> str:
        x = ", ".join(f"{value:.4g}" for value in self.problem.arrays.points[node])
        if node >= len(self.problem.names):
            return f"({x})"
        return f"node {self.problem.names[node]} ({x})"


def _largest(u: Array) -> float:
    """Return the length of the largest of several vectors, shape (n, d)."""
    return float(np.linalg.norm(u, axis=1).max())


def _percent(value: float) -> str:
    return f"{100 * value:.3g} %"
