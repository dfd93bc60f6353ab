"""Quick, slow and long tests: nothing is lost between them."""

import re
from pathlib import Path

import tiers
from _pytest.mark.expression import Expression
from tiers import NOT_THERE, Test

ROOT = Path(__file__).parents[2]


def test_slow_tests_are_there(pytestconfig):
    """A test with another name must be listed with this one: remove it from tests/slow_tests.txt, or measure anew."""
    assert pytestconfig.stash[NOT_THERE] == []


def test_what_notices_a_mistake_is_quick():
    """docs/evidence/mutants.csv says which tests notice which mistake."""
    slow = tiers.listed()
    assert len(slow) > 20
    names = {part for name in slow for part in (name, name.partition("[")[0], name.partition("::")[0])}
    assert {name for _, name in tiers.noticing()} & names == set()


def test_several_ranks(monkeypatch):
    """Of functions that are not costly on two one set of parameters that is quick, and on three one test of each file,
    or of each function where it is about ranks; and what notices a mistake there.
    """
    names = [f"test_a.py::test_{name}" for name in ("f[1]", "f[2]", "f[3]", "g", "h[1]", "h[2]", "h[3]", "k", "m")]
    names += ["test_b.py::test_f[1]", "test_b.py::test_f[2]"]
    names += [f"test_some_ranks.py::test_{name}" for name in ("f", "g[1]", "g[2]")]
    monkeypatch.setattr(tiers, "listed", lambda: {names[0], names[10]})
    monkeypatch.setattr(tiers, "costly", lambda: {names[3], names[7], names[8], names[13]})
    noticing = {(3, names[6]), (3, "test_a.py::test_g"), (1, names[2]), (2, names[7])}
    monkeypatch.setattr(tiers, "noticing", lambda: noticing)
    assert tiers.slow_on(names, 1) == {names[k] for k in (0, 10)}
    assert tiers.slow_on(names, 2) == {names[k] for k in (0, 2, 3, 5, 6, 8, 10, 13)}
    assert tiers.slow_on(names, 3) == {names[k] for k in (0, 1, 2, 4, 5, 7, 8, 10, 13)}


def test_ci_runs_all_but_the_long_ones():
    """Each test with any of the marks is run on one rank, and if it is marked mpi on two and three, once."""
    makefile, default = ((ROOT / name).read_text(encoding="utf-8") for name in ("Makefile", "pyproject.toml"))
    for name, value in re.findall(r"^(\w+) := (.*)", makefile, re.MULTILINE):
        makefile = makefile.replace(f"$({name})", value)
    (default,) = re.findall(r"addopts = .*-m '([^']*)'", default)
    targets = re.findall(r"^make (.*)", (ROOT / ".ci" / "run").read_text(encoding="utf-8"), re.MULTILINE)
    recipes = [re.search(rf"^{name}:.*\n((?:\t.*\n)+)", makefile, re.MULTILINE)[1] for name in targets]
    lines = [line for recipe in recipes for line in recipe.splitlines() if " pytest " in line]
    for several in (False, True):
        run = [line for line in lines if ("mpirun" in line) is several]
        marks = [(re.findall(r'-m "([^"]*)"', line) or [default])[0] for line in run]
        for slow in (False, True):
            for long in (False, True):
                has = {"mpi": several, "slow": slow, "long": long}
                times = sum(Expression.compile(mark).evaluate(lambda name, has=has: has[name]) for mark in marks)
                assert times == (not long), has
        assert not several or all("for n in 2 3" in line for line in run)


def test_the_rule():
    """What is dear and runs no line of its own, if another one of the function stays and it notices no mistake."""
    tests = [
        Test("test_a.py::test_f[1]", 1.0, frozenset({1, 2}), True),
        Test("test_a.py::test_f[2]", 3.0, frozenset({1, 2}), True),
        Test("test_a.py::test_f[3]", 2.0, frozenset({1, 2, 3}), True),
        Test("test_a.py::test_f[4]", 2.5, frozenset({2}), True),
        Test("test_a.py::test_g", 9.0, frozenset({1, 4}), True),
        Test("test_a.py::test_h[1]", 0.1, frozenset({1}), False),
        Test("test_a.py::test_h[2]", 0.2, frozenset({1}), False),
    ]
    assert tiers.chosen(tests, {(2, "test_a.py::test_f[4]")}) == ["test_a.py::test_f[1]", "test_a.py::test_f[2]"]
    assert tiers.chosen(tests, {(2, "test_a.py::test_f")}) == []
    assert tiers.chosen(tests, {(1, "test_a.py")}) == []
    # What takes more than 0.7 seconds may be the last of its function, if it has lines by which it can be judged.
    lone = [Test("test_a.py::test_k", 1.1, frozenset({1}), False), Test("test_a.py::test_m", 1.2, frozenset(), False)]
    assert tiers.chosen([tests[-2], *lone], set()) == [lone[0].name]
    # Many cheap sets of parameters: those that stay take 0.7 seconds together.
    many = [Test(f"test_a.py::test_f[{k}]", 0.2, frozenset({1, 9 if k == 0 else 2}), False) for k in range(12)]
    slow = tiers.chosen(many, {(1, many[1].name)})
    assert len(slow) == 9
    assert not {many[0].name, many[1].name} & set(slow)
