"""Interleaved timing, A B C A B C ..., so that other load on the machine affects all alike; medians of ratios."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import contestants
import numpy as np

from signorini_fx.mechanics.mesh.tagged import TaggedMesh

Key = tuple[str, int]
"""A contestant and the number of cells along the bottom."""


@dataclass(frozen=True)
class Sample:
    """One timed run.

    Attributes:
        name: of the contestant.
        nx: cells along the bottom.
        repeat: number of the round, from 0.
        seconds: wall time.
        cpu: CPU time of the process, all threads; less than the wall time where other processes used the core.
        phases: seconds by phase as the program itself measures them.
    """

    name: str
    nx: int
    repeat: int
    seconds: float
    cpu: float
    phases: Mapping[str, float]


def warm_up(plan: Sequence[Key], meshes: Mapping[int, TaggedMesh], say: Callable[[str], None]) -> dict[Key, str]:
    """Run everyone once, so that all forms are compiled, and check that all solve the same problem.

    Returns:
        A note on each: its linear solves and factorisations.
    """
    notes = {}
    for nx in sorted({nx for _, nx in plan}):
        names = [name for name, n in plan if n == nx]
        order = [*dict.fromkeys([contestants.SAME[name] for name in names if name in contestants.SAME] + names)]
        reference: dict[str, contestants.Outcome] = {}
        for name in order:
            say(f"check {name}, {nx} x {nx // 3}")
            gc.collect()
            outcome = contestants.ALL[name](meshes[nx])
            contestants.check(name, outcome, reference, meshes[nx])
            reference[name] = outcome
            notes[name, nx] = _note(outcome)
    return notes


def _note(outcome: contestants.Outcome) -> str:
    if outcome.unfinished:
        return outcome.unfinished
    solves = sum(answer.solves for answer in outcome.answers)
    factorisations = sum(answer.factorisations for answer in outcome.answers)
    if not solves:
        return ""
    extra = outcome.answers[0].note
    counted = f"{solves} solves" + (f", {factorisations} factorisations" if factorisations else "")
    return counted + (f", {extra}" if extra else "")


def interleave(
    plan: Sequence[Key], meshes: Mapping[int, TaggedMesh], repeats: int, say: Callable[[str], None]
) -> list[Sample]:
    """Run every contestant once in each round."""
    samples = []
    for repeat in range(repeats):
        for name, nx in plan:
            if repeat >= contestants.ROUNDS.get(name, repeats):
                continue
            say(f"round {repeat + 1} of {repeats}: {name}, {nx} x {nx // 3}")
            gc.collect()
            cpu, wall = time.process_time(), time.perf_counter()
            outcome = contestants.ALL[name](meshes[nx])
            wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
            samples.append(Sample(name, nx, repeat, wall, cpu, dict(outcome.phases)))
    return samples


def series(samples: Sequence[Sample], key: Key, *, cpu: bool = False) -> np.ndarray:
    """Seconds of a contestant, round by round."""
    return np.array([s.cpu if cpu else s.seconds for s in samples if (s.name, s.nx) == key])


def phases(samples: Sequence[Sample], key: Key) -> dict[str, float]:
    """Median seconds of each phase of a contestant; ``rest`` is the time outside of its phases."""
    own = [s for s in samples if (s.name, s.nx) == key]
    names = dict.fromkeys(name for s in own for name in s.phases)
    found = {name: float(np.median([s.phases.get(name, 0.0) for s in own])) for name in names}
    whole = float(np.median([s.seconds for s in own]))
    return {**found, "rest": max(0.0, whole - sum(found.values()))} if found else {}
