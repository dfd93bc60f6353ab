"""The equilibria of a nonlinear body: Newton's method from where it is, the verdicts on where that
ends, and the way through load steps: how large they are, and where they begin again.

Newton's method for the body has the semi-smooth method for contact inside: each of its iterations
is a linear ``ContactProblem`` for the whole displacement, see ``linearised``.  Contact pressure and
friction are those of the new displacement, so the old ones only enter through the curvature of the
shapes.  A line search follows d . (R(u + s d) + B^T (lambda, mu)), the slope of the energy with
contact where there is one; it needs no energy (P. Wriggers, Computational Contact Mechanics, 2006,
chapter 10).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.errors import FormError
from signorini_fx.forms.elasticity import NOT_FINITE, MatrixError
from signorini_fx.forms.nonlinear.crossing import behind, crossing
from signorini_fx.forms.nonlinear.linearised import LinearisedProblem, Snapshot
from signorini_fx.forms.nonlinear.residual import round_off
from signorini_fx.forms.nonlinear.results import ResidualMechanics, SolvedBody, certified
from signorini_fx.forms.nonlinear.verdicts import (
    Stability,
    corner_inside,
    overlap,
    overlap_of_bodies,
)
from signorini_fx.machine import parallel
from signorini_fx.mechanics.pairs.mortar_coupling import PairingError
from signorini_fx.mechanics.statement.load_path import LoadPath
from signorini_fx.records import OF_THE_BODY, Status, StepRecord, Timings
from signorini_fx.results.certificate.certificate import Certificate
from signorini_fx.results.mechanics import StepResult
from signorini_fx.results.solution import ConvergenceError
from signorini_fx.solving.frames import solution_of
from signorini_fx.solving.increments import PathIncrements
from signorini_fx.solving.restart import Figures, StoredStates, marks_of, recall_history
from signorini_fx.tuned import (
    CERTIFICATE_TOLERANCE,
    EASY_STEP,
    ENCLOSED,
    FAILED_STEP,
    FEW_NEWTON_ITERATIONS,
    KEPT_TANGENT,
    LINE_SEARCH_STEPS,
    NO_FORCE,
    ROOT_OF_EPS,
    SAME_NUMBER,
    UNITS_OF_PLACES,
    WHOLE_SLOPE,
)

Array = npt.NDArray[np.float64]

# What is said of linear bodies alone.
OF_LINEAR_BODIES = (*OF_THE_BODY, Status.SLIDES_AT_PRESSURES, Status.SINGULAR)
# What smaller steps do not change.
FINAL = (
    Status.CORNER,
    Status.STABILITY_UNKNOWN,
    Status.NO_DIGIT,
    Status.NO_MEMORY,
    Status.NOT_HELD,
    Status.OPEN,
)
# How a solve ends that says nothing of the stiffness, beside these.
NOT_BY_STIFFNESS = (
    *OF_THE_BODY,
    Status.PASSED,
    Status.CROSSED,
    Status.FOLDED,
    Status.AT_END,
    Status.INSIDE,
    Status.NOT_CERTIFIED,
)


@dataclass
class EquilibriumSolver(Stability):
    """Finds the equilibrium next to where a nonlinear body is, with loads and shapes as they
    are.
    """

    commit: Callable[[], object]  # the user's function at the end of a step
    max_newton: int
    asks_stability: bool
    too_large: Callable[[], str] = lambda: (
        ""
    )  # by how much the deformation is, in words; "": it is not; collective
    # See ``behind``, of the solutions since the path began.
    passed: dict[int, str] = field(default_factory=dict)
    # What to do about statuses, where that is not ``Status.advice``.
    cures: Mapping[Status, str] = field(default_factory=dict)
    # Why the linear contact problem of the last attempt has no solution; None: it has one, or that
    # says nothing of the body.
    cause: Status | None = None
    status: Status | None = (
        None  # of the last attempt; None: it has ended by an error, or there is none
    )
    certificate: Certificate | None = None  # of the last solution, or the last iterate
    iterations: int = 0  # of the last attempt
    linear_solves: int = 0  # likewise
    failure: str = ""  # how the last attempt has ended that has no solution, in words
    without: str = ""  # why there may be no solution, in words; "": nothing says so
    tangent_at: tuple[Array, Array] = field(
        init=False
    )  # of the last tangent: values of u, coordinates of tools
    last: Snapshot | None = (
        None  # the last solution that was taken, or what there was before; None: nothing was tried
    )
    solved: SolvedBody | None = None  # the last solution that was taken, for results
    timings: Timings = field(default_factory=Timings)
    # the largest displacement of solutions that were taken, relative to the size of the body
    farthest: float = 0.0
    _tried: Array | None = None  # see ``reason_for_none``
    _mechanics: ResidualMechanics = field(init=False)  # of the certificate

    @property
    def u(self) -> fem.Function:
        """The displacement."""
        return self.residual.u

    @property
    def _least_increment(self) -> float:
        """Increments that may be round-off of the body, its places, or loose bodies, length;
        collective.
        """
        linear = self.linear
        places = UNITS_OF_PLACES * float(
            np.finfo(float).eps * np.abs(linear.elastic.pieces.bounds).max()
        )
        loose = linear.scales.coordinate_error / NO_FORCE if linear.loose else 0.0
        return max(SAME_NUMBER * linear.scales.size, places, loose)

    def begin_path(self, *, several: bool) -> None:
        """Forget how long solves took, and a first step that had no solution; ``several``: see
        ``Start``.
        """
        self.timings, self.linear.several = Timings(), several
        self.passed = {}
        if self.solved is not None and self.solved.step.status is not Status.CONVERGED:
            self.solved = None

    def attempt(self, *, final: bool = True) -> str:
        """Solve with the values of now; ``take`` makes it the last solution; ``final``: whether no
        smaller step will be tried, so that a failure is asked why there may be no solution.
        Returns why there is none, and what to do, with all but ``status`` as the last solution was;
        "": there is one; collective.
        """
        last = self.last = self.last or self.snapshot()
        self.certificate = None
        self.status = None
        self.without = ""
        self.cause = None
        self._detail = ""
        self._tried = None
        solves = len(self.linear.history.iterations)
        try:
            status = self._ended("iterate", self._iterate)
            if status is Status.CONVERGED and self._hidden:
                status = Status.NO_DIGIT
            elif status is Status.CONVERGED and self.asks_stability:
                status = self.stable()
            elif (
                final
                and status not in (Status.CONVERGED, *FINAL, *NOT_BY_STIFFNESS)
                and not self.without
                # The last iterate of a contact problem without sets is no equilibrium.
                and not self._detail
            ):
                self.without = self.reason_for_none(last.displacement, self._tried)
        except Exception:
            self.go_back(last)
            raise
        self.status, self.linear_solves = status, len(self.linear.history.iterations) - solves
        if status is Status.CONVERGED:
            return ""
        reason = self.without or self._detail
        certificate = self.certificate
        if (
            not reason
            and certificate is not None
            and status in (Status.NOT_CERTIFIED, Status.NOT_SOLVED)
        ):
            reason = f"{certificate.worst_name} {certificate.worst:.1e}"
        ended = (
            "deformation too large for small strains"
            if status is Status.TOO_LARGE
            else status.value
        )
        self.failure = ended + (f" ({reason})" if reason else "")
        if status is Status.INVERTED and self.without:  # beyond any displacement of the body
            self.failure = self.without
        if final and status in (Status.NOT_SOLVED, Status.NOT_CERTIFIED, Status.UNSTABLE):
            passed = self.passed | behind(self.linear, last)
            self.failure += "".join(f"; {text}" for text in passed.values())
        self.go_back(last)
        return f"{self.failure}: {self.advice(status)}"

    def advice(self, status: Status) -> str:
        """Return what to do about the last attempt, which has ended with this status."""
        if self.cause is not None and status in (Status.NOT_SOLVED, Status.LIMIT):
            return self.cause.advice
        return self.cures.get(status, status.advice)

    def certify(self, begun: Snapshot) -> Status:
        """The verdict, but for stability, on a displacement of an earlier run whose step has
        ``begun``; collective.
        """
        self.last = self.last or begun
        return self._ended("certify", lambda: self._judge(self.residual.at(self.u.x.array.copy())))

    def _ended(self, phase: str, solve: Callable[[], Status]) -> Status:
        """How something ends that may not be able to go on; collective."""
        try:
            with self.timings.phase(phase):
                return solve()
        except PairingError as error:
            self._detail = str(error)
            return Status.FOLDED
        except ConvergenceError as error:
            return self._not_solved(error.solution.status)
        except MatrixError as error:
            if error.fault != NOT_FINITE:
                raise
            return Status.NOT_FINITE

    def take(self) -> None:
        """Make what there is now the last solution; collective."""
        assert self.certificate is not None
        if self.last is not None:
            self.passed |= behind(self.linear, self.last)
        self.last, self.farthest = (
            self.snapshot(),
            max(self.farthest, self.certificate.displacement),
        )
        self.solved = SolvedBody.of(
            self.linear, self.certificate, self._mechanics, self.linear_solves
        )

    def take_before(self, status: Status, solves: int) -> None:
        """Show the body as it is, without contact, in place of a first solution that there is not,
        unless it cannot be evaluated; ``status``, ``solves``: how the search has ended, after how
        many linear solves; collective.
        """
        with suppress(FormError, MatrixError, PairingError):
            if (residual := self.residual.at(self.u.x.array.copy())) is None:
                return
            self.linear.slide()
            self.linear.leave_open(status)
            self.solved = SolvedBody.of(
                self.linear, *certified(residual, self.linear), solves, status
            )

    def advance(self) -> None:
        """Begin the next step where the last one has ended."""
        if self.status is not Status.CONVERGED:
            raise RuntimeError("there is no solution to advance from")
        self.linear.tools = self.linear.foundations.rigid_bodies.motions
        self.linear.advance()
        self.commit()
        self.linear.slide()
        for pair in self.linear.foundations.sliding.values():
            pair.settle()

    def snapshot(self) -> Snapshot:
        """All that an attempt changes, and where the shapes are."""
        return self.linear.state_now(self.certificate, self.iterations)

    def go_back(self, state: Snapshot) -> None:
        """Go back to where the body was; loads and shapes stay, but for tools that forces move;
        collective.
        """
        self.linear.go_back(state)
        self.certificate = state.certificate
        self.iterations = state.iterations
        with suppress(FormError):  # before the first solution it may not be possible
            self.residual.updated()

    # --- Newton's method --------------------------------------------------------------------------

    def _iterate(self) -> Status:
        """Newton's method from the present ``u``, with one increment where F and contact are
        linear; collective.

        It ends where increments are small and the certificate holds, or, as with a J that is not
        the derivative of F, iterations no longer make it better.  With a J the residual of a body
        at rest is round-off once increments are no longer halved; where the displacement is
        round-off, it goes on from the undeformed body.
        """
        linear = self.linear
        u = self.u
        worst = np.inf
        last_change = np.inf
        keeps = False
        comm = linear.space.mesh.comm
        linear.begin_anew()
        begun = float(parallel.largest(comm, np.abs(u.x.array), 0.0))
        residual: Array | None = None
        rests = False
        follows = linear.foundations.moving or any(entry.sliding for entry in linear.contact)
        is_linear = (
            not follows and self.residual.update is None and self.tangents.bilinear is not None
        )
        for iteration in range(1, self.max_newton + 1):
            self.iterations = iteration
            old, tools = self.tangent_at = u.x.array.copy(), linear.foundations.coordinates
            residual = self.residual.at(old) if residual is None else residual
            if residual is None:
                self._detail = "at the values of u before the solve"
                return Status.INVERTED
            linear.slide()
            # Rigid bodies have unknowns in the stiffness.
            keeps = keeps and not linear.rigid.bodies and linear.relative is None and linear.set_up
            if not keeps:
                linear.bend(symmetric=False)
            linear.residual = residual
            try:
                linear.solve(keeps_stiffness=keeps)
                increment = linear.u.x.array - old
                at = old, increment, residual
                length, residual = line_search(linear, self.residual.at, at, search=iteration > 1)
            finally:
                linear.residual = None
            if length == 0.0:
                self._tried = old + increment
                return Status.INVERTED
            u.x.array[:] = old + length * increment
            moved = length * (linear.rigid.unknowns(linear.tools) - tools)
            linear.foundations.carry_to(tools + moved)
            change, size = (
                max(
                    float(parallel.largest(comm, np.abs(values), 0.0)),
                    float(np.abs(further).max(initial=0.0)),
                )
                for values, further in ((length * increment, moved), (u.x.array, tools + moved))
            )
            small = change <= ROOT_OF_EPS * size
            least = change <= self._least_increment
            keeps = length == 1.0 and change <= min(
                KEPT_TANGENT[0] * size, KEPT_TANGENT[1] * last_change
            )
            shortened = self.tangents.given and 2 * change < last_change
            last_change = change
            ends = small or (length == 1.0 and is_linear)
            if ends or (least and not (shortened and iteration < self.max_newton)):
                status = self._judge(residual)
                if status is not Status.NOT_CERTIFIED or self.certificate is None:
                    return status
                if self.certificate.worst < worst:
                    worst = self.certificate.worst
                elif (
                    rests
                    or float(parallel.largest(comm, np.abs(u.x.array), 0.0)) > ROOT_OF_EPS * begun
                ):
                    return status
                else:
                    u.x.array[:], residual, keeps, rests = 0.0, None, False, True
        return Status.NOT_SOLVED

    def _not_solved(self, inner: Status) -> Status:
        """How a solve ends whose linear contact problem has no solution, which proves little of the
        body itself.
        """
        if inner is Status.NOT_HELD:
            return inner
        if inner is Status.OPEN and self.linear.loose:
            self._detail = "nothing presses on the body, and the supports do not hold it"
            return inner
        if inner in OF_LINEAR_BODIES:
            if self.leads(self.u.x.array.copy()):
                self.cause = inner
                self.without = f"the tangent does not hold it: {inner.value}"
            return Status.NOT_SOLVED
        if inner not in (Status.CYCLING, Status.OUTER_MAX_ITERATIONS):
            return inner
        self._detail = inner.value
        return Status.NOT_SOLVED

    # --- what is said of a solution ---------------------------------------------------------------

    @property
    def _hidden(self) -> bool:
        """Whether round-off may be all that there is in the solution, unless the body has come back
        to rest.
        """
        certificate = self.certificate
        assert certificate is not None
        return (
            certificate.displacement > self.farthest
            and certificate.placed < 1.0 <= certificate.lost
        )

    def _judge(self, residual: Array | None) -> Status:
        """Whether an iterate is a solution, where F is ``residual``, evaluated last; collective."""
        if residual is None:
            return Status.INVERTED
        assert self.last is not None
        linear = self.linear
        foundations = self.linear.foundations
        last = self.last
        for status, said in (
            (Status.TOO_LARGE, self.too_large),
            (Status.INSIDE, lambda: overlap(foundations, last)),
            (Status.CORNER, lambda: corner_inside(foundations, linear.boundary)),
            (Status.PASSED, lambda: overlap_of_bodies(foundations, last)),
        ):
            self._detail = said()
            if self._detail:
                return status
        if (crossed := crossing(linear)) is not None:
            self._detail = crossed.text
            return Status.CROSSED if crossed.itself else Status.PASSED
        linear.slide()
        for number, pair in foundations.sliding.items():
            if linear.contact[number].bilateral and (reached := pair.parted):
                self._detail = reached
                return Status.AT_END
        self.certificate, self._mechanics = certified(
            residual, linear, round_off(self.residual, residual)
        )
        return Status.CONVERGED if self.certificate.holds else Status.NOT_CERTIFIED


def line_search(
    linear: LinearisedProblem,
    forces_at: Callable[[Array], Array | None],
    at: tuple[Array, Array, Array],
    *,
    search: bool,
) -> tuple[float, Array | None]:
    """The share of an increment to take, and F there; 0 and None: there is no F however short it
    is; collective.

    It is halved where F cannot be evaluated, by a FormError of ``Residual.at``, too, or where
    ``search`` and the slope of the energy along it has not become smaller; prescribed values must
    arrive.  ``at``: values of ``u`` and the increment to them, ghosts included, and F at the owned
    unknowns.
    """
    old, increment, residual = at
    comm = linear.space.mesh.comm
    owned = len(residual)
    internal, turning, on_tools = linear.internal(increment)
    ahead = np.where(linear.prescribed[0][:owned], 0.0, increment[:owned])

    def along(forces: Array) -> float:
        return float(parallel.global_sum(comm, np.array(ahead @ forces)))

    first = -along(internal) - on_tools
    size, change = (
        float(parallel.largest(comm, np.abs(values), 0.0)) for values in (old, increment)
    )
    search = search and first < 0 and change > CERTIFICATE_TOLERANCE * size
    steepest = WHOLE_SLOPE * abs(first) if search else np.finfo(float).max
    share = 2.0
    slope = np.inf
    for _ in range(LINE_SEARCH_STEPS + 1):
        share = share / 2
        failed = None
        slope = np.inf
        try:
            forces = forces_at(old + share * increment)
        except FormError as error:
            forces, failed = None, error
        if forces is not None:
            # The contact forces of the linearised problem are - a(d, .) - R(u); along d they turn
            # with the normals.
            slope = along(forces - internal - residual + share * turning) - (1.0 - share) * on_tools
        if slope <= steepest:
            break
    if np.isfinite(slope):
        return share, forces
    if failed is not None:
        raise failed
    return 0.0, None


# --- the way through load steps -------------------------------------------------------------------

# What is stored of a step beside the end of its last linear problem.
_SOLUTION = "solution"
_TANGENT = "tangent"
_ORIGIN = "slip origin"


class Continuation:
    """Goes through the load steps of a path, each of which an ``EquilibriumSolver`` attempts.  One
    without a solution is halved, the first one from time 0; after an easy one the next is larger.
    One that cannot be shortened ends it with a ``failure`` in words and an ``advice``, or with a
    FormError.

    ``apply`` changes the problem to what it is at a place; ``held`` says in words what the place
    that was reached bears of the loads at one without a solution.  ``ends`` are the load steps with
    a solution, with what the residual says of them.
    """

    def __init__(
        self,
        solver: EquilibriumSolver,
        path: LoadPath,
        apply: Callable[[float], object],
        held: Callable[[float, float], str] = lambda reached, failed: "",
    ) -> None:
        solver.begin_path(several=path.several)
        self.solver = solver
        self.way = PathIncrements(path)
        self._apply = apply
        self._held = held
        self.history = solver.linear.history
        self.timings = solver.timings
        self.ends = list[tuple[StepResult, ResidualMechanics]]()
        self.failure = ""
        self.advice = ""
        self._solves_before = len(self.history.iterations)

    @property
    def through(self) -> bool:
        """Whether there is no further load step."""
        return self.way.ended or bool(self.failure)

    @property
    def _may_halve(self) -> bool:
        """Whether a smaller step than the next one may be tried."""
        return (self.way.next - self.way.reached) / 2 >= ENCLOSED * self.way.nominal

    @property
    def _allowed(self) -> float:
        """Linear solves that the next step may take, before a smaller one is tried."""
        if not (self.ends and self._may_halve):
            return np.inf
        return FAILED_STEP**2 * max(self.ends[-1][0].linear_solves, EASY_STEP)

    def solved(self) -> StepResult | None:
        """The next load step; None: it has no solution, and is tried in another way."""
        begun = self.solver.snapshot()
        solver = self.solver
        way = self.way
        if (path := way.path).several:
            self.history.add(
                StepRecord(len(self.ends) + 1, path.name_at(way.next), path.time_at(way.next))
            )
        why: Exception | str
        duration = path.time_at(way.next) - path.time_at(way.reached)
        solver.linear.foundations.dt = duration
        try:
            self._apply(way.next)
            with self.history.at_most(self._allowed):
                why = solver.attempt(final=not self._may_halve)
            if not why:
                solver.take()
        except Exception as error:
            why = error
        if why:
            self._give_up(begun, why)
            return None
        end = way.reached = way.next
        increment = way.increment * (2 if solver.iterations <= FEW_NEWTON_ITERATIONS else 1)
        way.increment = min(max(increment, ENCLOSED * way.nominal), way.nominal)
        return self._end_step(end)

    def _give_up(self, begun: Snapshot, why: Exception | str) -> None:
        """Go back to where a failed step has begun, and halve it, or end with why there is no
        solution; collective.
        """
        solver = self.solver
        way = self.way
        status = self.solver.status
        final = not self._may_halve or status in FINAL
        if status is not None and solver.without:
            status = Status.LIMIT
        if final and isinstance(why, str) and solver.solved is None:
            assert status is not None
            solver.take_before(status, len(self.history.iterations) - self._solves_before)
            if (before := solver.solved) is not None:
                solver.solved = replace(before, step=self._named(way.next, before.step))
        self._begin_again(begun)
        end, reached = (f"time {way.path.time_at(place):g}" for place in (way.next, way.reached))
        self.history.add(f"{end} is given up, back at {reached}: {why}")
        if not isinstance(why, str | FormError):
            raise why
        if not final:
            way.halve()
            return
        last = (
            f"there is a solution at {reached}{self._held(way.reached, way.next)}"
            if self.ends
            else "there is no solution before it"
        )
        if isinstance(why, FormError):
            reasons = [(key, f"{reason} (at {end}; {last})") for key, reason in why.problems]
            raise FormError(reasons, why.source) from why.__cause__
        assert status is not None
        solver.status = status
        self.failure = f"{solver.failure}: at {end}; {last}"
        if status is Status.LIMIT:
            self.failure = f"{status.value}: {last}; a step to {end} ends with: {solver.failure}"
        self.advice = solver.advice(status)

    def _begin_again(self, begun: Snapshot) -> None:
        """Go back to where a step has begun, with its load and its shapes; collective."""
        self._apply(self.way.reached)
        for number, shape in begun.shapes.items():
            self.solver.linear.foundations.moving[number].shape = shape
        self.solver.go_back(begun)

    def _named(self, end: float, step: StepResult) -> StepResult:
        path = self.way.path
        return replace(step, place=end, time=path.time_at(end), name=path.name_at(end))

    def _end_step(self, end: float) -> StepResult:
        """Make the last solution that of a step, and begin the next one; ``end``: where the step
        ends; collective.
        """
        solved = self.solver.solved
        assert solved is not None
        step = self._named(end, replace(solved.step, step=len(self.ends) + 1))
        self.solver.solved = replace(solved, step=step)
        self.ends.append((step, solved.mechanics))
        self.solver.advance()
        return step

    def all(
        self, on_step: Callable[[StepResult], object], stored: StoredStates | None = None
    ) -> None:
        """Solve one load step after the other, or take it from what is stored, until there is none;
        collective.
        """
        marks = marks_of(self.history)
        while not self.through:
            step = None if stored is None else self.recalled(stored)
            recalled = step is not None
            step = step or self.solved()
            if step is None:
                continue
            on_step(step)
            if not recalled and stored is not None:
                with self.timings.phase("checkpoint"):
                    self.store(stored, step, marks)
            marks = marks_of(self.history)

    def store(self, stored: StoredStates, step: StepResult, marks: tuple[int, int, int]) -> None:
        """The end of its last linear problem is stored, with its displacement and that of its last
        tangent.
        """
        solver = self.solver
        linear = self.solver.linear
        assert linear.outcome is not None
        assert linear.last is not None
        values, coordinates = solver.tangent_at
        figures = {
            "place": step.place,
            "newton": solver.iterations,
            "path": self.way.stored(),
            "linear_solves": step.linear_solves,
            "coordinates": {
                _SOLUTION: linear.foundations.coordinates.tolist(),
                _TANGENT: coordinates.tolist(),
            },
            "definite": bool(linear.definite),
            "symmetric": bool(linear.symmetric),
        }
        origin = np.einsum("nij,nj->ni", linear.boundary.cotangents, linear.begun.data.slip_origin)
        state = linear.last.with_field(_SOLUTION, "dofs", step.displacement.x.array)
        state = state.with_field(_TANGENT, "dofs", values).with_field(_ORIGIN, "points", origin)
        stored.store(linear.begun.step, linear.posed, linear.outcome, state, self, marks, figures)

    def recalled(self, stored: StoredStates) -> StepResult | None:
        """It is certified anew."""
        solver = self.solver
        number = self.solver.linear.step
        history = self.history
        figures = stored.figures(number)
        if figures is None:
            return None
        begun = solver.snapshot()
        end = float(figures["place"])
        with self.timings.phase("restart"):
            self._apply(end)
            fits = self._fits(stored, figures)
        if fits and (status := solver.certify(begun)) is Status.CONVERGED:
            solver.status = status
            solver.iterations = figures["newton"]
            solver.linear_solves = figures["linear_solves"]
            solver.take()
            recall_history(figures, history, self.timings)
            self.way.resume(figures["path"])
            return self._end_step(end)
        if fits:
            history.add(f"restart: load step {number + 1}: {status.value}: it is solved again")
            stored.forget(number)
        self._begin_again(begun)
        return None

    def _fits(self, stored: StoredStates, figures: Figures) -> bool:
        """Take the displacement and the contact of the next load step, if they fit; collective."""
        linear = self.solver.linear
        residual = self.solver.residual
        number = linear.step
        space = linear.space
        state = stored.read(number, space)
        if state is None:
            return False
        at_solution, at_tangent = (
            np.array(figures["coordinates"][name]) for name in (_SOLUTION, _TANGENT)
        )
        outcome = None
        with suppress(FormError, MatrixError, PairingError):
            if residual.at(state.fields[_TANGENT].values.copy()) is not None:
                linear.foundations.carry_to(at_tangent)
                linear.begin_at_tangent(
                    definite=figures["definite"], symmetric=figures["symmetric"]
                )
                end = stored.read(number, space, linear.boundary)
                boundary = linear.boundary
                if end is not None:
                    origin = np.einsum("nij,ni->nj", boundary.tangents, end.fields[_ORIGIN].values)
                    linear.begun = replace(
                        linear.begun, data=replace(linear.begun.data, slip_origin=origin)
                    )
                    outcome = solution_of(linear.posed, linear.begun, end, **figures["method"])
        if outcome is None:
            return False
        linear.take(outcome)
        linear.foundations.carry_to(at_solution)
        residual.u.x.array[:] = state.fields[_SOLUTION].values
        return True
