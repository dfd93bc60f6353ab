"""Quick and slow tests: nothing is lost between them."""

import re
from pathlib import Path

from _pytest.mark.expression import Expression

ROOT = Path(__file__).parents[2]


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
