"""The plan of attempts: one list, which the log, ``check`` and the documentation follow."""

from signorini_fx.algebra.attempts import (
    tried,
)
from signorini_fx.records import History, IterationRecord


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
