"""Quick and slow tests: nothing is lost between them."""

import re
from pathlib import Path
from types import SimpleNamespace

import pytest
from _pytest.mark.expression import Expression

ROOT = Path(__file__).parents[2]


class Item:
    """A test as pytest collects it."""

    path = Path("test_a.py")

    def __init__(self, nodeid, **marks):
        self.nodeid, self.marks = (
            nodeid,
            {name: SimpleNamespace(kwargs=kwargs) for name, kwargs in marks.items()},
        )

    def get_closest_marker(self, name):
        return self.marks.get(name)

    def add_marker(self, name):
        self.marks[name] = SimpleNamespace(kwargs={})


@pytest.mark.parametrize(
    ("ranks", "slow"),
    [(1, ["b[1]", "b[2]", "c[2]", "c[3]"]), (2, ["b[1]", "b[2]", "c[2]", "c[3]", "d[2]", "e"])],
)
def test_what_is_slow(pytestconfig, monkeypatch, ranks, slow):
    """By the marks of its function, and on several ranks all but one set of parameters of each."""
    conftest = pytestconfig.pluginmanager.get_plugin(str(ROOT / "tests" / "conftest.py"))
    items = [Item("a[1]"), Item("a[2]"), Item("b[1]", slow={}), Item("b[2]", slow={})]
    items += [Item(f"c[{k}]", one_quick={}) for k in (1, 2, 3)]
    items += [Item("d[1]", mpi={}), Item("d[2]", mpi={}), Item("e", mpi={"slow": True})]
    with monkeypatch.context() as patch:
        patch.setattr(conftest, "COMM", SimpleNamespace(size=ranks))
        conftest.pytest_collection_modifyitems(items)
    assert [item.nodeid for item in items if item.get_closest_marker("slow")] == slow


def test_ci_and_nightly_run_all():
    """Each test with any of the marks is run on one rank, and if it is marked mpi on two and three,
    once.
    """
    makefile, default = (
        (ROOT / name).read_text(encoding="utf-8") for name in ("Makefile", "pyproject.toml")
    )
    for name, value in re.findall(r"^(\w+) := (.*)", makefile, re.MULTILINE):
        makefile = makefile.replace(f"$({name})", value)
    (default,) = re.findall(r"addopts = .*-m '([^']*)'", default)
    targets = re.findall(
        r"^make (.*)", (ROOT / ".ci" / "run").read_text(encoding="utf-8"), re.MULTILINE
    )
    targets += re.search(r"^nightly:.*\n\t\$\(MAKE\) -k (.*)", makefile, re.MULTILINE)[1].split()
    recipes = [
        re.search(rf"^{name}:.*\n((?:\t.*\n)+)", makefile, re.MULTILINE)[1] for name in targets
    ]
    lines = [line for recipe in recipes for line in recipe.splitlines() if " pytest " in line]
    lines = [
        line for line in lines if "SFX_WHEELS" not in line
    ]  # another installation, on which all run once more
    on_one = [line for line in lines if "mpirun" not in line]
    for several, run in (
        (False, on_one),
        *((True, [line for line in lines if f"n={n};" in line]) for n in (2, 3)),
    ):
        marks = [(re.findall(r'-m "([^"]*)"', line) or [default])[0] for line in run]
        for slow in (False, True):
            has = {"mpi": several, "slow": slow}
            assert (
                sum(
                    Expression.compile(mark).evaluate(lambda name, has=has: has[name])
                    for mark in marks
                )
                == 1
            ), has
