"""The equilibria of a nonlinear body: Newton's method from where it is, and the verdicts on where
that ends.

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
from functools import partial

import numpy as np

from signorini_fx.arrays import Array
from signorini_fx.errors import FormError
from signorini_fx.forms.elasticity import NOT_FINITE, MatrixError
from signorini_fx.forms.nonlinear.crossing import behind, crossing
from signorini_fx.forms.nonlinear.linearised import Iterate, NonlinearBody, Solved
from signorini_fx.forms.nonlinear.residual import Remembers, round_off
from signorini_fx.forms.nonlinear.results import ResidualMechanics, SolvedBody, certified
from signorini_fx.forms.nonlinear.verdicts import (
    corner_inside,
    leads,
    overlap,
    overlap_of_bodies,
    reason_for_none,
    stable,
)
from signorini_fx.machine import parallel
from signorini_fx.mechanics.pairs.mortar_coupling import PairingError
from signorini_fx.mechanics.state import Field, State
from signorini_fx.records import OF_THE_BODY, Status, Timings
from signorini_fx.results.certificate.certificate import Certificate
from signorini_fx.results.solution import ConvergenceError
from signorini_fx.solving.increments import FINAL
from signorini_fx.tuned import (
    CERTIFICATE_TOLERANCE,
    KEPT_TANGENT,
    LINE_SEARCH_STEPS,
    NO_FORCE,
    ROOT_OF_EPS,
    SAME_NUMBER,
    UNITS_OF_PLACES,
    WHOLE_SLOPE,
)

# What is said of linear bodies alone.
OF_LINEAR_BODIES = (*OF_THE_BODY, Status.SLIDES_AT_PRESSURES, Status.SINGULAR)
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


@dataclass(frozen=True)
class Verdict:
    """What is said of a displacement, or of the search for one.

    Attributes:
        status: how it has ended.
        detail: what is wrong, or where, in words; "": nothing is known.
        certificate: of the last displacement that was judged; None: none was.
        mechanics: what the certificate is of.
        iterations: of Newton's method.
        without: why there may be no solution, in words; "": nothing says so.
        cause: why the linear contact problem has no solution; None: it has one, or that says
            nothing of the body.
        tried: see ``reason_for_none``.
    """

    status: Status
    detail: str = ""
    certificate: Certificate | None = None
    mechanics: ResidualMechanics | None = None
    iterations: int = 0
    without: str = ""
    cause: Status | None = None
    tried: Array | None = None


@dataclass
class EquilibriumSolver:
    """Finds the equilibrium next to where a nonlinear body is, with loads and shapes as they
    are.
    """

    body: NonlinearBody
    commit: Callable[[], object] | None  # the user's function at the end of a step
    remembers: Remembers | None  # what the material keeps of earlier steps
    max_newton: int
    asks_stability: bool
    extrapolates: bool = False  # whether Newton's method begins beyond the step before
    too_large: Callable[[], str] = lambda: (
        ""
    )  # by how much the deformation is, in words; "": it is not; collective
    # See ``behind``, of the solutions since the path began.
    passed: dict[int, str] = field(default_factory=dict)
    # What to do about statuses, where that is not ``Status.advice``.
    cures: Mapping[Status, str] = field(default_factory=dict)
    status: Status | None = (
        None  # of the last attempt; None: it has ended by an error, or there is none
    )
    verdict: Verdict = field(init=False)  # on the last attempt
    linear_solves: int = 0  # likewise
    failure: str = ""  # how the last attempt has ended that has no solution, in words
    solved: SolvedBody | None = None  # the last solution that was taken, for results
    reached: State | None = None  # the end of the last step
    timings: Timings = field(default_factory=Timings)
    # the largest displacement of solutions that were taken, relative to the size of the body
    farthest: float = 0.0
    _since: State = field(init=False)  # the last solution before an attempt, or what there was

    def begin_path(self) -> None:
        """Forget how long solves took, and a first step that had no solution."""
        self.timings = Timings()
        self.passed = {}
        if self.solved is not None and self.solved.status is not Status.CONVERGED:
            self.solved = None

    def attempt(self, *, final: bool = True) -> str:
        """Solve with the values of now; ``take`` makes it the last solution; ``final``: whether no
        smaller step will be tried, so that a failure is asked why there may be no solution.
        Returns why there is none, and what to do, with all but ``status`` as the last solution was;
        "": there is one; collective.
        """
        body = self.body
        begin = body.at.x.array.copy()
        last = self._since = body.last or self._beginning(begin)
        self.status = None
        solves = len(body.history.iterations)
        search = partial(newton, body, self.judge, self.max_newton)
        try:
            verdict = self._ended("iterate", search)
            status = verdict.status
            if status is Status.CONVERGED and self._hidden(verdict.certificate):
                verdict = replace(verdict, status=Status.NO_DIGIT)
            elif status is Status.CONVERGED and self.asks_stability:
                assert body.solved is not None
                status, place = stable(body.solved)
                verdict = replace(verdict, status=status, detail=place)
            elif (
                final
                and status not in (Status.CONVERGED, *FINAL, *NOT_BY_STIFFNESS)
                and not verdict.without
                # The last iterate of a contact problem without sets is no equilibrium.
                and not verdict.detail
            ):
                without = reason_for_none(body, last.displacement, verdict.tried)
                verdict = replace(verdict, without=without)
        except Exception:
            self.show_last(begin)
            raise
        self.verdict = verdict
        status = self.status = verdict.status
        self.linear_solves = len(body.history.iterations) - solves
        if status is Status.CONVERGED:
            return ""
        reason = verdict.without or verdict.detail
        certificate = verdict.certificate
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
        if status is Status.INVERTED and verdict.without:  # beyond any displacement of the body
            self.failure = verdict.without
        if final and status in (Status.NOT_SOLVED, Status.NOT_CERTIFIED, Status.UNSTABLE):
            passed = self.passed | behind(body, last)
            self.failure += "".join(f"; {text}" for text in passed.values())
        self.show_last(begin)
        return f"{self.failure}: {self.advice(status)}"

    def advice(self, status: Status) -> str:
        """Return what to do about the last attempt, which has ended with this status."""
        cause = self.verdict.cause
        if cause is not None and status in (Status.NOT_SOLVED, Status.LIMIT):
            return cause.advice
        return self.cures.get(status, status.advice)

    def certify(self) -> Status:
        """The verdict, but for stability, on the displacement of now, which an earlier run has
        found; collective.
        """
        self._since = self.body.begin
        values = self.body.at.x.array.copy()
        self.verdict = self._ended("certify", lambda: self.judge(self.body.evaluated.at(values)))
        return self.verdict.status

    def _ended(self, phase: str, solve: Callable[[], Verdict]) -> Verdict:
        """How something ends that may not be able to go on; collective."""
        try:
            with self.timings.phase(phase):
                return solve()
        except PairingError as error:
            return Verdict(Status.FOLDED, str(error))
        except ConvergenceError as error:
            return self._not_solved(error.solution)
        except MatrixError as error:
            if error.fault != NOT_FINITE:
                raise
            return Verdict(Status.NOT_FINITE)

    def take(self) -> SolvedBody:
        """Make what there is now the last solution, and return it; collective."""
        verdict = self.verdict
        certificate = verdict.certificate
        assert certificate is not None
        assert verdict.mechanics is not None
        self.passed |= behind(self.body, self._since)
        self.farthest = max(self.farthest, certificate.displacement)
        counts = self.linear_solves, verdict.iterations
        self.solved = SolvedBody.of(self.body.settled(), certificate, verdict.mechanics, *counts)
        return self.solved

    def before(self, status: Status, solves: int) -> SolvedBody | None:
        """The body as it is, without contact, to be shown in place of a solution that there is not;
        None: it cannot be evaluated; ``status``, ``solves``: how the search has ended, after how
        many linear solves; collective.
        """
        with suppress(FormError, MatrixError, PairingError):
            if (residual := self.body.evaluated.at(self.body.at.x.array.copy())) is None:
                return None
            solved = self.body.leave_open(status)
            return SolvedBody.of(solved, *certified(residual, solved), solves, 0, status)
        return None

    def initial(self) -> State:
        """The body before the first step, with what its material remembers then."""
        return self._remembered(self.body.initial())

    def _remembered(self, state: State) -> State:
        """A state with what the material remembers now."""
        if self.remembers is None:
            return state
        values = self.remembers.remembered()
        kept = {name: Field("cells", rows) for name, rows in values.items()}
        return replace(state, fields={**state.fields, **kept})

    def _beginning(self, values: Array) -> State:
        """The state from which the way of a step counts: where the step begins, but where bodies
        and shapes are now if the user has put the body elsewhere before the first one, ``values``
        of u; collective.
        """
        begin = self.body.begin
        comm = self.body.space.mesh.comm
        if begin.number or not parallel.any_rank(
            comm, not np.array_equal(values, begin.displacement)
        ):
            return begin
        return replace(begin, displacement=values, placed=self.body.foundations.placed)

    def start(self, state: State) -> None:
        """Begin a step from a state, and from nothing else that another step has left; collective.

        Raises:
            FormError: the material has its history elsewhere.
            SceneError: the state is that of another material.
        """
        body = self.body
        known = state is body.begin or state is self.reached
        if not known and (state.number or body.begin.number):
            self.refuse_elsewhere()
        self.recall(state)
        body.start(state)
        size = parallel.largest(body.space.mesh.comm, np.abs(state.displacement))
        self.farthest = max(self.farthest, size / body.named[1].size)

    def refuse_elsewhere(self) -> None:
        """Refuse to begin from a state without what the material remembers.

        Raises:
            FormError: the material keeps it elsewhere.
        """
        if self.commit is not None and self.remembers is None:
            reason = (
                "keeps what the material remembers where no state has it, so that no step can "
                "begin from one: give kept, the Functions that it changes"
            )
            raise FormError.at("commit", reason)

    def recall(self, state: State) -> None:
        """Let the material remember what it does in a state; collective."""
        if self.remembers is not None and (state.fields or state.number):
            self.remembers.recall(state.fields)

    def committed(self, time: float) -> State:
        """Return the end of the step whose last solution was taken, from which the material goes
        on; collective.
        """
        assert self.body.last is not None
        if self.commit is not None:
            self.commit()
        new = self._remembered(replace(self.body.last, time=time))
        begin = self.body.begin
        if not self.extrapolates or time <= begin.time:
            return new
        rate = (new.displacement - begin.displacement) / (time - begin.time)
        return new.with_field("rate", "dofs", rate)

    def extrapolate(self, state: State, time: float) -> None:
        """Begin Newton's method where the step before a state goes on to, until a time: a body that
        flows is soft there, but at the state it has its elastic tangent.
        """
        if self.extrapolates and (rate := state.fields.get("rate")) is not None:
            self.body.at.x.array[:] = state.displacement + rate.values * (time - state.time)

    def show_last(self, begin: Array) -> None:
        """Make the last solution what the user sees, or before the first one the values of ``u``
        where it began; loads and shapes stay, but for rigid bodies that forces move; collective.
        """
        solved = self.solved
        if solved is not None and solved.status is not Status.CONVERGED:
            solved = None
        body = self.body
        body.now = None
        body.solved = None if solved is None else solved.solved
        body.show(None if body.solved is None else body.solved.state)
        body.foundations.carry_to((body.last or body.begin).rigid)
        body.at.x.array[:] = begin if solved is None else solved.result.displacement.x.array
        with suppress(FormError):  # before the first solution it may not be possible
            body.evaluated.updated()

    @property
    def certificate(self) -> Certificate | None:
        """Return the certificate of the last solution."""
        solved = self.solved
        ended = solved is not None and solved.status is Status.CONVERGED
        return solved.result.certificate if solved is not None and ended else None

    def _not_solved(self, solved: Solved) -> Verdict:
        """How a solve ends whose linear contact problem has no solution, which proves little of the
        body itself.
        """
        inner = solved.status
        if inner is Status.NOT_HELD:
            return Verdict(inner)
        if inner is Status.OPEN and solved.loose:
            return Verdict(inner, "nothing presses on the body, and the supports do not hold it")
        if inner in OF_LINEAR_BODIES:
            if not leads(self.body, self.body.at.x.array.copy()):
                return Verdict(Status.NOT_SOLVED)
            without = f"the tangent does not hold it: {inner.value}"
            return Verdict(Status.NOT_SOLVED, without=without, cause=inner)
        if inner not in (Status.CYCLING, Status.OUTER_MAX_ITERATIONS):
            return Verdict(inner)
        return Verdict(Status.NOT_SOLVED, inner.value)

    def _hidden(self, certificate: Certificate | None) -> bool:
        """Whether round-off may be all that there is in the solution, unless the body has come back
        to rest.
        """
        assert certificate is not None
        return (
            certificate.displacement > self.farthest
            and certificate.placed < 1.0 <= certificate.lost
        )

    def judge(self, residual: Array | None) -> Verdict:
        """Whether an iterate is a solution, where F is ``residual``, evaluated last; collective."""
        if residual is None:
            return Verdict(Status.INVERTED)
        body = self.body
        foundations = body.foundations
        last = self._since
        if self.body.evaluated.turns_over(last.displacement):
            return Verdict(Status.INVERTED, "some turn over within the step")
        solved = body.solved
        assert solved is not None
        boundary = solved.linear.boundary
        for status, said in (
            (Status.TOO_LARGE, self.too_large),
            (Status.INSIDE, lambda: overlap(foundations, last)),
            (Status.CORNER, lambda: corner_inside(foundations, boundary)),
            (Status.PASSED, lambda: overlap_of_bodies(foundations, last)),
        ):
            if detail := said():
                return Verdict(status, detail)
        if (crossed := crossing(body)) is not None:
            return Verdict(Status.CROSSED if crossed.itself else Status.PASSED, crossed.text)
        body.slide()
        for number, pair in foundations.sliding.items():
            if body.contact[number].bilateral and (reached := pair.parted):
                return Verdict(Status.AT_END, reached)
        lost = round_off(body.evaluated, residual)
        certificate, mechanics = certified(residual, solved, lost)
        status = Status.CONVERGED if certificate.holds else Status.NOT_CERTIFIED
        return Verdict(status, "", certificate, mechanics)


def newton(
    body: NonlinearBody,
    judge: Callable[[Array | None], Verdict],
    max_newton: int,
) -> Verdict:
    """Newton's method from where the body is, with one increment where F and contact are linear,
    and what ``judge`` says of its end, where F is given; collective.

    It ends where increments are small and the certificate holds, or, as with a J that is not
    the derivative of F, iterations no longer make it better.  With a J the residual of a body
    at rest is round-off once increments are no longer halved; where the displacement is
    round-off, it goes on from the undeformed body.
    """
    foundations = body.foundations
    u = body.at
    evaluated = body.evaluated
    tangents = body.tangents
    verdict = Verdict(Status.NOT_SOLVED)
    worst = np.inf
    last_change = np.inf
    keeps = False
    comm = body.space.mesh.comm
    iterate: Iterate | None = None
    begun = parallel.largest(comm, np.abs(u.x.array))
    residual: Array | None = None
    rests = False
    follows = foundations.moving or any(entry.slides for entry in body.contact)
    is_linear = not follows and evaluated.update is None and tangents.bilinear is not None
    for iteration in range(1, max_newton + 1):
        old = u.x.array.copy()
        coordinates = foundations.coordinates
        residual = evaluated.at(old) if residual is None else residual
        if residual is None:
            return Verdict(Status.INVERTED, "at the values of u before the solve")
        body.slide()
        # Rigid bodies have unknowns in the stiffness.
        keeps = keeps and not foundations.rigid_bodies.bodies
        if iterate is None:
            iterate = Iterate(body.bend(symmetric=False), residual)
        else:
            bent = iterate.bent if keeps else body.bend(symmetric=False)
            iterate = replace(iterate, bent=bent, residual=residual)
        solved = body.solve_at(iterate, keeps=keeps)
        iterate = solved.linear.iterate
        increment = solved.values - old
        at = old, increment, residual
        length, residual = line_search(solved, evaluated.at, at, search=iteration > 1)
        if length == 0.0:
            return Verdict(Status.INVERTED, tried=old + increment)
        u.x.array[:] = old + length * increment
        moved = length * (solved.rigid - coordinates)
        foundations.carry_to(coordinates + moved)
        change, size = (
            max(
                parallel.largest(comm, np.abs(values)),
                float(np.abs(further).max(initial=0.0)),
            )
            for values, further in ((length * increment, moved), (u.x.array, coordinates + moved))
        )
        small = change <= ROOT_OF_EPS * size
        least = change <= least_increment(solved)
        keeps = length == 1.0 and change <= min(
            KEPT_TANGENT[0] * size, KEPT_TANGENT[1] * last_change
        )
        shortened = tangents.given and 2 * change < last_change
        last_change = change
        ends = small or (length == 1.0 and is_linear)
        if ends or (least and not (shortened and iteration < max_newton)):
            verdict = replace(judge(residual), iterations=iteration)
            certificate = verdict.certificate
            if verdict.status is not Status.NOT_CERTIFIED or certificate is None:
                return verdict
            if certificate.worst < worst:
                worst = certificate.worst
            elif rests or parallel.largest(comm, np.abs(u.x.array)) > ROOT_OF_EPS * begun:
                return verdict
            else:
                u.x.array[:], residual, keeps, rests = 0.0, None, False, True
    return replace(verdict, status=Status.NOT_SOLVED)


def least_increment(solved: Solved) -> float:
    """Increments that may be round-off of the body, its places, or loose bodies, length;
    collective.
    """
    scales = solved.linear.elastic.scales
    bounds = np.abs(solved.linear.elastic.pieces.bounds)
    places = UNITS_OF_PLACES * float(np.finfo(float).eps * bounds.max())
    loose = scales.coordinate_error / NO_FORCE if solved.loose else 0.0
    return max(SAME_NUMBER * scales.size, places, loose)


def line_search(
    solved: Solved,
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
    comm = solved.body.space.mesh.comm
    owned = len(residual)
    internal, turning, on_rigid = solved.internal(increment)
    ahead = np.where(solved.linear.prescribed[0][:owned], 0.0, increment[:owned])

    def along(forces: Array) -> float:
        return parallel.total(comm, ahead @ forces)

    first = -along(internal) - on_rigid
    size, change = (parallel.largest(comm, np.abs(values)) for values in (old, increment))
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
            slope = along(forces - internal - residual + share * turning) - (1.0 - share) * on_rigid
        if slope <= steepest:
            break
    if np.isfinite(slope):
        return share, forces
    if failed is not None:
        raise failed
    return 0.0, None
