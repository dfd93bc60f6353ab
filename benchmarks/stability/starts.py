"""Starts: the iteration ends at the same solution from every start."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache, partial

import numpy as np
import numpy.typing as npt

from benchmarks.stability.case import Case, Finding
from benchmarks.stability.measure import apart, found, solved, solved_from
from benchmarks.stability.scenes import LAWS, example1
from signorini_fx.algebra.contact.active_sets import ActiveSets
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.results.solution import Solution

Sets = Callable[[ContactBoundary], ActiveSets]
_SEEDS = range(6)


def _where(test: Callable[[npt.NDArray[np.float64]], npt.NDArray[np.bool_]], slip: int = 0) -> Sets:
    """Contact where a test of x[0] holds; slip of one sign everywhere."""

    def sets(boundary: ContactBoundary) -> ActiveSets:
        return ActiveSets.of(test(boundary.x[:, 0]), np.full((boundary.size, 1), float(slip)))

    return sets


def _random(seed: int, share: float = 0.5) -> Sets:
    def sets(boundary: ContactBoundary) -> ActiveSets:
        generator = np.random.default_rng(seed)
        contact = generator.random(boundary.size) < share
        return ActiveSets.of(contact, generator.integers(-1, 2, (boundary.size, 1)).astype(float))

    return sets


def _of_another(law: str) -> Sets:
    """The solution of the mirrored, turned-round problem: contact at the ends only, the wrong slip."""

    def sets(boundary: ContactBoundary) -> ActiveSets:
        scene = example1(law)
        scene["traction"] = {"boundary": "top", "y": "-20 if x[0] <= 0.5 or x[0] >= 2.5 else 0"}
        contact = solved(scene).contact
        assert contact is not None
        return ActiveSets.of(contact.in_contact, -contact.direction)

    return sets


SETS: dict[str, Sets] = {
    "all": _where(lambda x: x >= 0),
    "none": _where(lambda x: x < 0),
    "one node": _where(lambda x: np.arange(x.size) == 20),
    "the first node": _where(lambda x: x == x.min()),
    "left end": _where(lambda x: x < 0.4),
    "right end": _where(lambda x: x > 2.6),
    "both ends": _where(lambda x: abs(x - 1.5) > 1.2),
    "every other node": _where(lambda x: np.arange(x.size) % 2 == 0),
    "all, slip to the right": _where(lambda x: x >= 0, 1),
    "all, slip to the left": _where(lambda x: x >= 0, -1),
    "none, slip": _where(lambda x: x < 0, 1),
    **{f"random {seed}": _random(seed) for seed in _SEEDS},
    "random, few": _random(17, 0.05),
}
MOTIONS = {
    "sunk by 1e6 lengths": lambda x: np.column_stack((0 * x[:, 0], 0 * x[:, 0] - 3e6)),
    "lifted by 1e6 lengths": lambda x: np.column_stack((0 * x[:, 0], 0 * x[:, 0] + 3e6)),
    "torn by 1e6 lengths": lambda x: 3e6 * np.column_stack((np.sin(7 * x[:, 0]), np.cos(5 * x[:, 0]))),
}


def cases(*, short: bool) -> Iterator[Case]:
    """Every start for every law; random multipliers for Coulomb friction, which give its first bound."""
    shape = {"target": 1e-8, "reference": "the solution from the usual start"}
    for law in ("Tresca", "Coulomb") if short else LAWS:
        some = ("none", "both ends", "random 0") if short else (*SETS, "another problem")
        for name in some:
            sets = _of_another(law) if name == "another problem" else SETS[name]
            yield Case(f"{law}, sets: {name}", partial(_from_sets, law, sets), **shape)
        for name in ("torn by 1e6 lengths",) if short else MOTIONS:
            # A huge first iterate has a large round-off.
            yield Case(f"{law}, {name}", partial(_from_motion, law, MOTIONS[name]), **shape)
        for name, settings in {"Newton": {}, "path-following": {"algorithm": "path-following"}}.items():
            if not short and name != "Newton":
                yield Case(f"{law}, {name}, sets: none", partial(_from_sets, law, SETS["none"], **settings), **shape)
    for way in ("fp", "newton"):
        for seed in _SEEDS[:1] if short else _SEEDS:
            for size in (1.0, 1e6):
                name = f"Coulomb, {way}, random multipliers {seed}, {size:g} times the stress"
                yield Case(name, partial(_from_multipliers, way, seed, size), **shape)


@cache
def _reference(law: str, **settings: str) -> Solution:
    return solved(example1(law, tolerance=1e-11, **settings))


def _from_sets(law: str, sets: Sets, **settings: str) -> Finding:
    solution = solved_from(example1(law, tolerance=1e-11, **settings), sets)
    return found(solution, apart(solution, _reference(law, **settings)))


def _from_motion(law: str, motion: Callable[[npt.NDArray[np.float64]], npt.NDArray[np.float64]]) -> Finding:
    solution = solved_from(example1(law, tolerance=1e-11), motion=motion)
    return found(solution, apart(solution, _reference(law)))


def _from_multipliers(way: str, seed: int, size: float) -> Finding:
    def start(boundary: ContactBoundary) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        generator = np.random.default_rng(seed)
        return 20 * size * generator.random(boundary.size), 20 * size * generator.standard_normal(boundary.size)

    solution = solved_from(example1("Coulomb", coulomb=way, tolerance=1e-11), _random(seed), start)
    return found(solution, apart(solution, _reference("Coulomb")))
