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

import numpy as np
from dolfinx import fem

from signorini_fx.arrays import Array
from signorini_fx.errors import FormError
from signorini_fx.forms.elasticity import NOT_FINITE, MatrixError
from signorini_fx.forms.nonlinear.crossing import behind, crossing
from signorini_fx.forms.nonlinear.linearised import LinearisedProblem
from signorini_fx.forms.nonlinear.residual import Remembers, round_off
from signorini_fx.forms.nonlinear.results import ResidualMechanics, SolvedBody, certified
from signorini_fx.forms.nonlinear.verdicts import (
    Stability,
    corner_inside,
    overlap,
    overlap_of_bodies,
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


@dataclass
class EquilibriumSolver(Stability):
    """Finds the equilibrium next to where a nonlinear body is, with loads and shapes as they
    are.
    """

    commit: Callable[[], object] | None  # the user's function at the end of a step
    remembers: Remembers | None  # what the material keeps of earlier steps
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
    solved: SolvedBody | None = None  # the last solution that was taken, for results
    reached: State | None = None  # the end of the last step
    timings: Timings = field(default_factory=Timings)
    # the largest displacement of solutions that were taken, relative to the size of the body
    farthest: float = 0.0
    _since: State = field(init=False)  # the last solution before an attempt, or what there was
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
        begin = self.u.x.array.copy()
        last = self._since = self.linear.last or self._beginning(begin)
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
            self.show_last(begin)
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
        self.show_last(begin)
        return f"{self.failure}: {self.advice(status)}"

    def advice(self, status: Status) -> str:
        """Return what to do about the last attempt, which has ended with this status."""
        if self.cause is not None and status in (Status.NOT_SOLVED, Status.LIMIT):
            return self.cause.advice
        return self.cures.get(status, status.advice)

    def certify(self) -> Status:
        """The verdict, but for stability, on the displacement of now, which an earlier run has
        found; collective.
        """
        self._since = self.linear.begin
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

    def take(self) -> SolvedBody:
        """Make what there is now the last solution, and return it; collective."""
        assert self.certificate is not None
        self.passed |= behind(self.linear, self._since)
        self.farthest = max(self.farthest, self.certificate.displacement)
        self.linear.settled()
        self.solved = SolvedBody.of(
            self.linear, self.certificate, self._mechanics, self.linear_solves, self.iterations
        )
        return self.solved

    def before(self, status: Status, solves: int) -> SolvedBody | None:
        """The body as it is, without contact, to be shown in place of a solution that there is not;
        None: it cannot be evaluated; ``status``, ``solves``: how the search has ended, after how
        many linear solves; collective.
        """
        linear = self.linear
        with suppress(FormError, MatrixError, PairingError):
            if (residual := self.residual.at(self.u.x.array.copy())) is None:
                return None
            linear.slide()
            linear.leave_open(status)
            return SolvedBody.of(linear, *certified(residual, linear), solves, 0, status)
        return None

    def initial(self) -> State:
        """The body before the first step, with what its material remembers then."""
        return self._remembered(self.linear.initial())

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
        linear = self.linear
        begin = linear.begin
        comm = linear.space.mesh.comm
        if begin.number or not parallel.any_rank(
            comm, not np.array_equal(values, begin.displacement)
        ):
            return begin
        return replace(begin, displacement=values, placed=linear.foundations.placed)

    def start(self, state: State) -> None:
        """Begin a step from a state, and from nothing else that another step has left; collective.

        Raises:
            FormError: the material has its history elsewhere.
            SceneError: the state is that of another material.
        """
        linear = self.linear
        known = state is linear.begin or state is self.reached
        if not known and (state.number or linear.begin.number):
            self.refuse_elsewhere()
        self._recall(state)
        linear.start(state)
        size = float(parallel.largest(linear.space.mesh.comm, np.abs(state.displacement), 0.0))
        self.farthest = max(self.farthest, size / linear.named[1].size)

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

    def _recall(self, state: State) -> None:
        """Let the material remember what it does in a state; collective."""
        if self.remembers is not None and (state.fields or state.number):
            self.remembers.recall(state.fields)

    def resume(self, begin: State) -> None:
        """Let the next solve begin at a state again, before which another step has had no solution;
        collective.
        """
        self.linear.begin = begin
        self._recall(begin)
        self.linear.settle()

    def committed(self, time: float) -> State:
        """Return the end of the step whose last solution was taken, from which the material goes
        on; collective.
        """
        assert self.linear.last is not None
        if self.commit is not None:
            self.commit()
        return self._remembered(replace(self.linear.last, time=time))

    def show_last(self, begin: Array) -> None:
        """Make the last solution what the user sees, or before the first one the values of ``u``
        where it began; loads and shapes stay, but for tools that forces move; collective.
        """
        solved = self.solved
        if solved is not None and solved.status is not Status.CONVERGED:
            solved = None
        self.linear.show_again(None if solved is None else solved.linear)
        self.u.x.array[:] = begin if solved is None else solved.result.displacement.x.array
        self.certificate = None if solved is None else solved.result.certificate
        self.iterations = 0 if solved is None else solved.iterations
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
        follows = linear.foundations.moving or any(entry.slides for entry in linear.contact)
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
            moved = length * (linear.rigid.unknowns(linear.rigid_bodies) - tools)
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
        linear = self.linear
        foundations = self.linear.foundations
        last = self._since
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
