"""The table of a gauntlet, for a terminal and as a page of Markdown.  No dolfinx here."""

from __future__ import annotations

from collections.abc import Iterator

from signorini_fx.addons.gauntlet.outcomes import STATES, WHOLE, ComparedQuantity, Gauntlet, GauntletCase
from signorini_fx.addons.gauntlet.sources import ASTER, FRONTISTR, KRATOS

_HEAD = """# The gauntlet{of}

Test cases of other programs, run with this one. The files belong to those programs and are not part of this package.
Once you have fetched them,

```sh
signorini-fx gauntlet FOLDER --out {page}
```

writes this page. {cases}

- **State**: a case is *whole* if nothing that changes the answer was lost ([decks]({grades})).
- **Theirs and ours** are values at the place where theirs is largest. **Difference** is the largest one of {difference}
{exact}\
- **Nearer** names the result that is nearer to the exact value, or, without one, to our solution on cells half as
  large.
{why}
"""
_CALCULIX = {
    "of": "",
    "page": "gauntlet.md",
    "cases": """\
A case is an input file of CalculiX with contact or ties that has printed results, `NAME.dat.ref` or
`NAME.frd.ref`, beside it. Each runs in its own process, so that one that hangs or crashes is just a row. Its steps are
those of [`run`](command-line.md). [code_aster](gauntlet-code-aster.md), [Kratos](gauntlet-kratos.md) and
[FrontISTR](gauntlet-frontistr.md) have their own pages.""",
    "grades": "decks.md",
    "difference": "all nodes,\n  relative to the largest value of theirs, at the last time that both print.",
    "exact": "- **Exact** is from a file `NAME.exact.csv` with the columns `node`, `component` and `value`.\n",
    "why": """\
- **Why**: what is lost, and for differences above 1 % what further runs have found: whether their result is in
  equilibrium, and in which element formulation, by [`judge`](judge.md), and how far both are from the finer solution.
  This verdict comes from our program; if in doubt, refine their mesh with theirs. Other cases were
  [followed up by hand](gauntlet-differences.md).""",
}
_OF_ASTER = {
    "of": ": code_aster",
    "page": "gauntlet-code-aster.md",
    "cases": """\
A case is a command file of code_aster with contact and tests, `NAME.comm`, beside its mesh; the
`.export` beside it says which mesh. Each runs in its own process, so that one that hangs or crashes is just a row.
[What is read of it](code-aster.md) is not executed.""",
    "grades": "code-aster.md",
    "difference": "all\n  that are tested, relative to the largest value of theirs.",
    "exact": "- **Exact** is the value that a test calls analytical.\n",
    "why": """\
- **Why**: what is lost, and for differences above 1 % how code_aster solves its contact, what differs in the cells, and
  how far both are from our finer solution. Others were [followed up by hand](gauntlet-differences.md).""",
}
_OF_KRATOS = {
    "of": ": Kratos",
    "page": "gauntlet-kratos.md",
    "cases": """\
A case is a file of parameters of Kratos with contact, `NAME_parameters.json`, with the files
that it names: model part, materials, and the values that its process `from_json_check_result_process` compares. Each
runs in its own process, so that one that hangs or crashes is just a row. Nothing of a case is executed: its processes
are read, and those that are not known are named.""",
    "grades": "decks.md",
    "difference": "all\n  that are checked, at all times, relative to the largest value of theirs.",
    "exact": "",
    "why": """\
- **Why**: what is lost, and for differences above 1 % how Kratos solves its contact, what differs in the cells, and how
  far both are from our finer solution. Elements of large strains are taken as linear, and so graded: the row says how
  large rotations are, and how much of the strain is neglected. All differences above 1 % were
  [followed up](gauntlet-differences.md#kratos), with Kratos itself too.""",
}
_OF_FRONTISTR = {
    "of": ": FrontISTR",
    "page": "gauntlet-frontistr.md",
    "cases": """\
A case is a control file of FrontISTR with contact, `NAME.cnt`, beside its mesh, `NAME.msh`, and
results, `NAME.res.0.STEP`. Each runs in its own process, so that one that hangs or crashes is just a row.""",
    "grades": "decks.md",
    "difference": "all\n  nodes, at all times, relative to the largest value of theirs.",
    "exact": "",
    "why": """\
- **Why**: what is lost, and for differences above 1 % which elements FrontISTR has and how it solves its contact, what
  differs in the cells, how far both are from our finer solution, and what [`judge`](judge.md), for which strains are
  small, says of theirs. Others were [followed up by hand](gauntlet-differences.md#frontistr).""",
}
_PAGES = {ASTER: _OF_ASTER, KRATOS: _OF_KRATOS, FRONTISTR: _OF_FRONTISTR}


def short_line(case: GauntletCase) -> str:
    """A case in a line of a terminal."""
    difference = "" if case.difference is None else f"{100 * case.difference:.2g} %"
    remark = "; ".join(filter(None, [case.why, *case.reasons]))
    return f"{case.name:24s} {case.state:24s} {difference:>9s}  {case.seconds:5.1f} s  {remark}"


def short_table(result: Gauntlet) -> str:
    """How many cases have ended how."""
    counts = [f"{result.counted(state)} {state}" for state in STATES if result.counted(state)]
    within = f"{result.within(0.01)} whole within 1 %"
    return f"{len(result.cases)} cases: {', '.join(counts)}; {within}"


def page(result: Gauntlet, command: str) -> str:
    """The page: that of a program if all cases are of it.

    Args:
        result: what has been run.
        command: that has done it.
    """
    programs = {case.program for case in result.cases}
    words = _PAGES.get(next(iter(programs)), _CALCULIX) if len(programs) == 1 else _CALCULIX
    sources = ", ".join(f"`{name}`{f' at {commit[:10]}' if commit else ''}" for name, commit in result.sources)
    head = "\n".join(line.rstrip() for line in _HEAD.format(**words).split("\n"))
    lines = [head, f"{short_table(result)}. Run on {result.date} over {sources} by", ""]
    lines += ["```sh", command, "```", "", f"with {result.seconds:g} s for each case.", ""]
    if whole := [case for case in result.cases if case.state == WHOLE]:
        lines += ["## Whole", "", *_table(whole), ""]
    incomplete = [case for state in STATES[1:] for case in result.cases if case.state == state]
    if incomplete:
        lines += ["## The others", "", *_table(incomplete), ""]
    return "\n".join(lines).rstrip() + "\n"


def _table(cases: list[GauntletCase]) -> Iterator[str]:
    yield "| case | quantity | theirs | ours | exact | difference | nearer | why |"
    yield "|---|---|---|---|---|---|---|---|"
    for case in cases:
        name = case.name if case.state == WHOLE else f"{case.name} ({case.state})"
        why = "; ".join(filter(None, [case.why, *case.reasons]))
        for number, quantity in enumerate(case.quantities):
            yield _row(name if number == 0 else "", quantity, why if number == 0 else "")
        if not case.quantities:
            yield f"| {name} | | | | | | | {_escaped(why or 'nothing that both have by nodes')} |"


def _row(name: str, quantity: ComparedQuantity, why: str) -> str:
    exact = "" if quantity.exact is None else f"{quantity.exact:.6g}"
    numbers = f"{quantity.theirs:.6g} | {quantity.ours:.6g} | {exact} | {100 * quantity.difference:.2g} %"
    return f"| {name} | {_escaped(quantity.name)} | {numbers} | {quantity.nearer} | {_escaped(why)} |"


def _escaped(text: str) -> str:
    """Text that does not end a cell, and in which names of keywords are no emphasis."""
    return text.replace("|", "\\|").replace("*", "\\*")
