"""The one loop over load steps, with a body of which nothing is known."""

from signorini_fx.records import History, Timings
from signorini_fx.solving.load_steps import Stepping


def test_each_load_step_in_its_turn():
    """The first is there from an earlier run and not stored again; what the second and the last took before they had a
    solution is stored with them; nothing begins after the last one.
    """
    history, calls, steps, attempts = History(), [], [], iter([None, "second", "third", None, None, "last"])

    def recalled(checkpoint):
        assert checkpoint == "checkpoint"
        history.add("recalled" if not steps else "not there")
        return None if steps else taken("first")

    def taken(step):
        steps.extend([] if step is None else [step])
        return step

    def solved():
        history.add("tried")
        return taken(next(attempts))

    stepping = Stepping(
        history,
        Timings(),
        ended=lambda: len(steps) == 4,
        solved=solved,
        recalled=recalled,
        store=lambda checkpoint, step, marks: calls.append(("store", checkpoint, step, history.events[marks[2] :])),
        go_on=lambda step: calls.append(("go on", step)),
    )
    stepping.all(lambda step: calls.append(("result", step)), "checkpoint")
    each = ["not there", "tried"]
    assert calls == [
        ("result", "first"),
        ("go on", "first"),
        ("result", "second"),
        ("store", "checkpoint", "second", 2 * each),
        ("go on", "second"),
        ("result", "third"),
        ("store", "checkpoint", "third", each),
        ("go on", "third"),
        ("result", "last"),
        ("store", "checkpoint", "last", 3 * each),
    ]
    assert set(stepping.timings.seconds) == {"checkpoint"}


def test_load_steps_that_end_without_a_solution():
    """Nothing is called for a step that has none."""
    ends = []
    stepping = Stepping(History(), Timings(), ended=lambda: bool(ends), solved=lambda: ends.append("failed"))
    stepping.all(lambda step: 1 / 0)
    assert ends == ["failed"]
