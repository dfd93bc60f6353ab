"""The list of mistakes fits the code; pieces of code are found by their syntax; the table is read as it is written."""

import ast
import contextlib
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

sys.path.insert(0, str(Path(__file__).parents[2]))

from stability import drawn, mutants, syntax
from stability.mistakes import MUTANTS, QUICK, ROOT
from stability.mutants import LIMIT, NOTICED, SURVIVES, Fate

PACKAGE = ROOT / "signorini_fx"


@pytest.mark.parametrize("every", [1, 8])
def test_mutants_fit(every):
    """They replace what is there exactly once, by something else that compiles; see ``make mutants``."""
    wrong = []
    for mutant in MUTANTS[::every]:
        old, new = ([ast.dump(node) for node in syntax.parse(text)] for text in (mutant.old, mutant.new))
        try:
            compile(mutant.spoilt(PACKAGE), mutant.module, "exec")
            assert old != new
        except (ValueError, SyntaxError, AssertionError) as error:
            wrong.append(f"{mutant.module}: {mutant.idea}: {error}")
    assert wrong == []


def test_list():
    """Enough of them, all over the method, on several ranks too; the tests that are to notice exist."""
    assert len(MUTANTS) >= 100
    assert len({mutant.module for mutant in MUTANTS}) >= 30
    assert sum(mutant.ranks > 1 for mutant in MUTANTS) >= 15
    assert len({mutant.idea for mutant in MUTANTS}) == len(MUTANTS)
    assert set(QUICK) <= set(MUTANTS)
    for file, _, test in (name.partition("::") for mutant in MUTANTS for name in mutant.named):
        assert f"def {test.partition('[')[0]}" in (ROOT / file).read_text(encoding="utf-8")
    # A reason is a sentence, and the exception.
    assert all(len(mutant.equivalent.split()) >= 10 for mutant in MUTANTS if mutant.equivalent)
    assert sum(bool(mutant.equivalent) for mutant in MUTANTS) <= 0.05 * len(MUTANTS)


SOURCE = '''\
def first(a, b):
    """Umlauts count as one: ä."""
    if a < (b  # why
            + 1):
        return call(a, ä="é", b=a - b), call(
            c=1,
        )
    a = 1
    b = a


class Thing:
    def first(self):
        return b + 1
'''


@pytest.mark.parametrize(
    ("old", "scope", "new", "expected"),
    [
        ("b + 1", "first", "b - 1", "if a < ((b - 1)"),
        ("b+1", "Thing.first", "b - 1", "return (b - 1)"),
        ("b + 1", "Thing", "b - 1", "return (b - 1)"),
        ("a - b", "", "a", "b=(a))"),
        ("c=1", "", "c=2", "            c=2,"),
        ("b=a - b", "", "b=0", 'ä="é", b=0)'),
        ("a = 1\nb = a", "", "b = 1\na = b", "    b = 1\n    a = b\n"),
        ("b = a", "", "pass", "    a = 1\n    pass\n"),
    ],
)
def test_syntax(old, scope, new, expected):
    """Expressions, keyword arguments and statements, whatever their layout."""
    [piece] = syntax.find(ast.parse(SOURCE), old, scope)
    spoilt = syntax.replace(SOURCE, piece, new)
    assert expected in spoilt
    assert ast.dump(ast.parse(spoilt)) != ast.dump(ast.parse(SOURCE))


def test_what_occurs_twice():
    """Both are found, and not what only looks like it."""
    assert [piece.scope for piece in syntax.find(ast.parse(SOURCE), "b + 1")] == ["first", "Thing.first"]
    assert syntax.find(ast.parse(SOURCE), "b + 1", "fir") == []
    assert syntax.find(ast.parse(SOURCE), "a = 1\nb = b") == []
    with pytest.raises(SyntaxError):
        syntax.parse("if x:")


def test_table_is_read_as_it_is_written(tmp_path, monkeypatch, capsys):
    """The tests that noticed come back, with their ranks; what survives is said."""
    monkeypatch.setattr(mutants, "TABLE", tmp_path / "mutants.csv")
    assert mutants.recorded_tests() == {}
    some = MUTANTS[::20]
    monkeypatch.setattr(mutants, "MUTANTS", some)
    fates = {
        mutant.idea: Fate(NOTICED, "tests/verification/test_ranks.py::test_a[x | y, z]", 2, 1.0) for mutant in some
    }
    fates[some[1].idea] = Fate(SURVIVES, "", 1, 1.0)
    fates[some[2].idea] = Fate(LIMIT, "Killed", 1, 1.0)
    mutants.write_table(fates)
    assert f"Of {len(some)} mutants {len(some) - 1} are noticed, 0 equivalent, 1 survive." in capsys.readouterr().out
    found = mutants.recorded_tests()
    assert len(found) == len(some) - 2
    assert found[some[0].idea] == (2, "tests/verification/test_ranks.py::test_a[x | y, z]")


class Scripted:
    """A copy whose tests end as they are told to."""

    cache = None
    code = ROOT
    collected = "tests/test_a.py::test_x\ntests/test_a.py::test_x[1 - 2]\ntests/verification/test_ranks.py::test_y\n"

    def __init__(self, *answers):
        self.answers, self.calls = [(0, self.collected), *answers], []

    def pytest(self, ranks, arguments, limit, workers=1):
        self.calls.append((ranks, limit, list(arguments)))
        return self.answers.pop(0)


def trial(monkeypatch, answers, *, ranks=1, recorded=None, near=False):
    """The fate of a mutant whose tests end like that, and what was run for it."""
    copy = Scripted(*answers)
    monkeypatch.setattr(mutants, "copied", lambda original=None: contextlib.nullcontext(copy))
    mistake = SimpleNamespace(
        idea="a mistake", ranks=ranks, named=["tests/test_a.py::test_x"], spoil=lambda package: None
    )
    fate = mutants.Trials(copy, recorded or {}, near=near).try_one(mistake)
    return (fate.fate, fate.by, fate.ranks), [(ranks, limit) for ranks, limit, _ in copy.calls[1:]]


PASSED, FAILED = (0, "1 passed"), (1, "F\nFAILED tests/test_a.py::test_x[1 - 2] - assert 1 - 2\n")
STUCK = (1, "tests/verification/test_ranks.py::test_y: rank 0 waits in vain for the others\n")


@pytest.mark.parametrize(
    ("answers", "options", "fate", "runs"),
    [
        ([FAILED], {}, (NOTICED, "tests/test_a.py::test_x[1 - 2]", 1), [(1, "files")]),
        ([STUCK], {"ranks": 3}, (NOTICED, "tests/verification/test_ranks.py::test_y", 3), [(3, "files")]),
        ([(None, "x\nKilled\n")], {}, (LIMIT, "Killed", 1), [(1, "files")]),
        ([PASSED, PASSED], {"near": True}, (SURVIVES, "", 1), [(1, "files"), (1, "files")]),
        (
            [PASSED, PASSED, PASSED, FAILED],
            {},
            (NOTICED, "tests/test_a.py::test_x[1 - 2]", 2),
            [(1, "files"), (1, "files"), (1, "suite"), (2, "suite")],
        ),
        ([(5, "none"), PASSED], {"ranks": 2}, (SURVIVES, "", 2), [(2, "files"), (2, "suite")]),
        (
            [PASSED, FAILED],
            {"recorded": {"a mistake": (2, "tests/verification/test_ranks.py::test_y")}},
            (NOTICED, "tests/test_a.py::test_x[1 - 2]", 1),
            [(2, "test"), (1, "files")],
        ),
        (
            [FAILED],
            {"recorded": {"a mistake": (1, "gone")}},
            (NOTICED, "tests/test_a.py::test_x[1 - 2]", 1),
            [(1, "files")],
        ),
    ],
)
def test_trial(monkeypatch, answers, options, fate, runs):
    """From near to far until something fails; the longest name that fits is the test's."""
    assert trial(monkeypatch, answers, **options) == (fate, runs)


def test_a_trial_that_says_nothing(monkeypatch):
    """pytest's own errors are no proof of anything."""
    with pytest.raises(SystemExit, match="pytest ended with 4"):
        trial(monkeypatch, [(4, "no such option")])


def test_tests_that_fail_anyway():
    """What they noticed does not count."""
    copy = Scripted(FAILED)
    trials = mutants.Trials(copy, {}, near=False)
    fates = [Fate(NOTICED, f"tests/test_a.py::{name}", 1, 1.0) for name in ("test_x", "test_x[1 - 2]")]
    assert trials.wrong(fates) >= {(1, "tests/test_a.py::test_x[1 - 2]")}
    assert trials.wrong([Fate(SURVIVES, "", 1, 1.0)]) == set()


def test_a_mutant_with_a_name_that_is_not_there():
    """Any test would notice a NameError, whatever it is about."""
    mutant = replace(MUTANTS[0], new=f"{MUTANTS[0].old} + nothing_of_that_name")
    with pytest.raises(ValueError, match="the module knows no nothing_of_that_name"):
        mutant.spoilt(ROOT / "signorini_fx")


DIFF = """\
--- a/signorini_fx/algebra/contact/laws.py
+++ b/signorini_fx/algebra/contact/laws.py
@@ -3,0 +4,2 @@ def f
+one
+two
@@ -9 +12 @@
-old
+new
@@ -20,2 +22,0 @@
--- a/signorini_fx/notes.txt
+++ b/signorini_fx/notes.txt
@@ -1 +1 @@
"""


class Negated:
    """An operator as cosmic-ray has them: names get a sign."""

    def mutation_positions(self, node):
        return [(node.start_pos, node.end_pos)] if node.type == "name" else []

    def mutate(self, node, index):
        node.value = f"-{node.value}"
        return node


def test_drawn_mutants():
    """On the lines of a change, one for each expression, and none where mutants show nothing."""
    assert drawn.touched(DIFF) == {"signorini_fx/algebra/contact/laws.py": {4, 5, 12}}
    source = "a = b\ndef f(c: d) -> e:\n    if c < g:\n        raise k(m)\n    return c\n"
    found = drawn.mutants("x.py", source, {1, 2, 3, 4}, {"negated": Negated()}, drawn.random.Random(0))
    assert [(m.line, m.in_function) for m in found] == [(1, False)] * 2 + [(2, False)] * 2 + [(3, True)] * 2
    assert found[-1].source == source.replace("g:", "-g:")
    assert found[-1].change == "-     if c < g:\n+     if c < -g:"
    assert drawn.between_operands("def f(*, c):\n    return g(*c, a * b)") == [((2, 18), (2, 21))]
    assert drawn.rooms(["signorini_fx/algebra/contact/laws.py", "signorini_fx/mechanics/scales.py"]) == [
        "tests/contact",
        "tests/verification",
    ]
    assert drawn.cheapest([("a", 9.0), ("b", 1.0), ("c", 4.0)], 6.0) == ["b", "c"]
    assert drawn.cheapest([("a", 9.0)], 6.0) == ["a"]
