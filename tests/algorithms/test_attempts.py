"""The plan of attempts: one list, which the log, ``check`` and the documentation follow."""

from pathlib import Path

import pytest
from scenes import example1

from signorini_fx.algebra.attempts import (
    AUGMENTED,
    AUGMENTED_NEWTON,
    DAMPED,
    FIXED_POINT,
    MONOLITHIC,
    PLAN,
    RAISED,
    for_coulomb,
    for_mesh,
    step_limit,
    tried,
)
from signorini_fx.records import History, IterationRecord
from signorini_fx.solving.check.planned import attempts_for
from signorini_fx.tuned import PROBLEMS_PER_STEP

DOCS = Path(__file__).parents[2] / "docs"


def test_the_table_of_the_documentation():
    """The built page has it; each attempt has a name of its own and says what it does."""
    assert "<!-- the plan of attempts -->" in (DOCS / "theory.md").read_text(encoding="utf-8")
    every = [attempt for attempts in PLAN.values() for attempt in attempts]
    assert all(attempt.what for attempt in every)
    assert all(len(set(map(str, attempts))) == len(attempts) for attempts in PLAN.values())


def names(scene):
    return {what: list(attempts) for what, attempts, _ in attempts_for(scene.statement)}


def test_what_check_lists():
    """What does not apply to a scene is not in its plan."""
    plain = names(example1(bound=1.5, nx=6, ny=2))
    assert "through stick" not in plain["a problem with given friction"]
    assert "Coulomb friction" not in plain
    assert names(example1(bound=1.5, nx=6, ny=2, sigma=1e-8))["a problem with given friction"][2] == "through stick"
    coulomb = names(example1(coefficient=0.3, nx=6, ny=2, coulomb="newton"))
    assert coulomb["Coulomb friction"][:2] == ["monolithic Newton", "fixed point"]
    alone = names(example1(coefficient=0.3, nx=6, ny=2, fallbacks=False))
    assert alone == {
        "a problem with given friction": ["full steps", "exact linear solves"],
        "Coulomb friction": ["fixed point"],
        "a load step": ["the method of the scene"],
    }


@pytest.mark.parametrize("monolithic", [True, False])
def test_ways_of_coulomb_friction(monolithic):
    """The fixed point is the fall-back of Newton's method even where there are to be none."""
    assert for_coulomb(monolithic=monolithic, first=False, fallbacks=False, augmented=True) == (FIXED_POINT,)
    ways = for_coulomb(monolithic=monolithic, first=True, fallbacks=False, augmented=True)
    assert ways == ((MONOLITHIC, FIXED_POINT) if monolithic else (FIXED_POINT,))
    assert for_coulomb(monolithic=True, first=False, fallbacks=True, augmented=True) == (
        FIXED_POINT,
        MONOLITHIC,
        AUGMENTED,
        AUGMENTED_NEWTON,
        *DAMPED.values(),
        RAISED,
    )
    assert for_coulomb(monolithic=True, first=False, fallbacks=True, augmented=False, damped=False) == (
        FIXED_POINT,
        MONOLITHIC,
    )


def test_coarser_meshes_help_the_first_load_step_alone():
    """Of a mesh that a generator makes, unless increments are found on the way or nothing else is wanted."""
    assert for_mesh(generated=True, ramp=False, fallbacks=True) == PLAN["mesh"]
    for changes in ({"generated": False}, {"ramp": True}, {"fallbacks": False}):
        assert for_mesh(**{"generated": True, "ramp": False, "fallbacks": True} | changes) == ()


def test_a_load_step_has_many_problems():
    """It may take as many linear solves as so many problems with given friction."""
    assert step_limit(7) == 7 * PROBLEMS_PER_STEP


def solve_of(history, count):
    for _ in range(count):
        history.add(IterationRecord(1, history.linear_solves + 1, 0, 1, 0, 0, 0, 0, 0.0, True, 0.0))


def test_one_after_the_other():
    """Each from the same state, with a line in the history, until one settles the matter."""
    history, restored = History(), []
    attempts = iter([("first", lambda: "bad"), ("second", lambda: "worse"), ("third", lambda: "good")])
    outcomes = tried(
        attempts, history=history, settled=lambda one: one == "good", restore=lambda: restored.append(len(restored))
    )
    assert outcomes == ["bad", "worse", "good"]
    assert history.events == ["bad: second", "worse: third"]
    assert restored == [0, 1]


def test_the_linear_solves_that_are_allowed():
    """They end the attempts, and limits within limits never allow more."""
    history = History()

    def attempt():
        solve_of(history, 4)
        return "bad"

    with history.at_most(10):
        with history.at_most(100):
            outcomes = tried([("", attempt)] * 5, history=history, settled=lambda _: False)
        assert history.limit == 10
    assert len(outcomes) == 3
    assert history.limit == float("inf")


def test_no_attempt_begins_after_the_time():
    """An attempt that has begun ends by itself; what comes after it is left."""
    history = History(is_late=lambda: True)
    assert tried([("", lambda: 1), ("", lambda: 2)], history=history, settled=lambda _: False) == [1]
    assert tried([("", lambda: 1), ("", lambda: 2)], history=History(), settled=lambda _: False) == [1, 2]
