"""What is compared: the package, one linear solve, other programs; each from the mesh in memory to the solution."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import example1
import linear
import numpy as np
import plain
import rival
from example1 import Answer
from mpi4py import MPI

from signorini_fx import solve, sweep
from signorini_fx.mechanics.mesh.tagged import TaggedMesh

COEFFICIENTS = [float(value) for value in np.linspace(0.05, 1.0, 20)]
# The plain way is stopped after this many seconds, and runs in the first round only.
PATIENCE = 60.0
ROUNDS = {"plain": 1}
LOADS = [float(value) for value in np.linspace(0.1, 2.0, 20)]


@dataclass(frozen=True)
class Outcome:
    """The result of a run: one answer for each problem that it solved, and the seconds that it measured by phase."""

    answers: Sequence[Answer] = ()
    phases: Mapping[str, float] = field(default_factory=dict)
    algorithm: str = ""
    unfinished: str = ""


Contestant = Callable[[TaggedMesh], Outcome]


def _package(law: str, **settings: Any) -> Contestant:
    def run(tagged: TaggedMesh) -> Outcome:
        solution = solve(example1.scene(law, tagged, **settings), MPI.COMM_SELF)
        return Outcome([Answer.of(solution)], solution.timings.seconds, solution.algorithm)

    return run


def _linear(package: str) -> Contestant:
    return lambda tagged: Outcome(phases=linear.solve(tagged, package)[1])


def _alone(run: Callable[[TaggedMesh], Answer]) -> Contestant:
    return lambda tagged: Outcome([run(tagged)])


def _plain(tagged: TaggedMesh) -> Outcome:
    try:
        return Outcome([plain.tresca(tagged, PATIENCE)])
    except plain.Unfinished as stop:
        return Outcome(unfinished=f"{stop}: the ratio is at least this")


def _sweep(law: str, *, certified: bool = False, **values: list[float]) -> Contestant:
    """All values of one parameter; ``certified``: with the displacement and the certificate of each."""

    def run(tagged: TaggedMesh) -> Outcome:
        points = sweep(example1.scene(law, tagged), MPI.COMM_SELF, **values)
        if certified and not all(point.certificate().holds for point in points):
            raise RuntimeError("a point of the sweep has no certificate")
        return Outcome([Answer.of_state(point.contact, point.linear_solves) for point in points])

    return run


ALL: dict[str, Contestant] = {
    "tresca": _package("tresca"),
    "fp": _package("coulomb", coulomb="fp"),
    "newton": _package("coulomb", coulomb="newton"),
    "mumps": _linear("mumps"),
    "cholmod": _linear("cholmod"),
    "sweep F": _sweep("coulomb", coefficients=COEFFICIENTS),
    "sweep F, certified": _sweep("coulomb", certified=True, coefficients=COEFFICIENTS),
    "sweep load": _sweep("tresca", loads=LOADS),
    "sweep load, certified": _sweep("tresca", certified=True, loads=LOADS),
    "rival tresca": _alone(rival.tresca),
    "rival fp": _alone(rival.coulomb),
    "plain": _plain,
}
# Those that must find the same solution and the same sets.
SAME = {"rival tresca": "tresca", "rival fp": "fp", "newton": "fp", "plain": "tresca"}


def default_coulomb(tagged: TaggedMesh) -> str:
    """Which of ``fp`` and ``newton`` is the default of a scene."""
    return "newton" if "newton" in _package("coulomb")(tagged).algorithm else "fp"


def check(name: str, outcome: Outcome, reference: Mapping[str, Outcome], tagged: TaggedMesh) -> None:
    """Whether a contestant has solved the same problem.

    Raises:
        RuntimeError: it has not; the message says what differs.
    """
    pairs = []
    if name in SAME and not outcome.unfinished:
        pairs = [(outcome.answers[0], reference[SAME[name]].answers[0])]
    if name.startswith("sweep"):
        pairs = [(outcome.answers[k], answer) for k, answer in _single(name, tagged).items()]
    for ours, theirs in pairs:
        if found := theirs.differs(ours):
            raise RuntimeError(f"{name} at {tagged.mesh.topology.index_map(2).size_global} cells differs: {found}")


def _single(name: str, tagged: TaggedMesh) -> dict[int, Answer]:
    """Three values of a sweep, each solved alone."""
    answers = {}
    for k in (0, 9, 19):
        if "load" in name:
            made = example1.scene("tresca", tagged)
            traction = made.traction[0].model_copy(update={"factors": (LOADS[k],)})
            made = made.model_copy(update={"traction": (traction,)})
        else:
            made = example1.scene("coulomb", tagged, coulomb="fp", coefficient=COEFFICIENTS[k])
        answers[k] = Answer.of(solve(made, MPI.COMM_SELF))
    return answers
