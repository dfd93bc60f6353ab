"""The table of a gauntlet, for a terminal and as a page of Markdown.  No dolfinx here."""

from __future__ import annotations

from collections.abc import Iterator

from signorini_fx.addons.gauntlet.outcomes import STATES, WHOLE, ComparedQuantity, Gauntlet, GauntletCase

_HEAD = """# The gauntlet

Test cases of other programs, run by this one. The files are theirs, and are not part of this package: fetch them, and

```sh
signorini-fx gauntlet FOLDER --out gauntlet.md
```

writes this page. A case is an input file of CalculiX with contact or ties that has printed results, `NAME.dat.ref` or
`NAME.frd.ref`, beside it. Each is run in a process of its own: one that hangs or crashes is a row. Its steps are those
of [`run`](command-line.md).

- **State**: *whole* is a case of which nothing is lost that changes the answer ([decks](decks.md)).
- **Theirs and ours** stand where theirs is largest. **Difference** is the largest one of all nodes, relative to the
  largest value of theirs, at the last time that both print.
- **Exact** is from a file `NAME.exact.csv` with the columns `node`, `component` and `value`.
- **Nearer** to the exact value is the one named, or else to our solution with all sides halved.
- **Why**: what is lost, and of differences above 1 % what further runs have found: whether their result is in
  equilibrium, and in which element formulation, by [`judge`](judge.md), and how far both are from the finer solution.
  It is the same program that says so: who doubts it may refine their mesh with theirs.
"""


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
    """The page.

    Args:
        result: what has been run.
        command: that has done it.
    """
    sources = ", ".join(f"`{name}`{f' at {commit[:10]}' if commit else ''}" for name, commit in result.sources)
    lines = [_HEAD, f"{short_table(result)}. Run on {result.date} over {sources} by", ""]
    lines += ["```sh", command, "```", "", f"with {result.seconds:g} s for each case.", ""]
    lines += ["## Whole", "", *_table([case for case in result.cases if case.state == WHOLE]), ""]
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
            yield f"| {name} | | | | | | | {_escaped(why or 'nothing that both print by nodes')} |"


def _row(name: str, quantity: ComparedQuantity, why: str) -> str:
    exact = "" if quantity.exact is None else f"{quantity.exact:.6g}"
    numbers = f"{quantity.theirs:.6g} | {quantity.ours:.6g} | {exact} | {100 * quantity.difference:.2g} %"
    return f"| {name} | {_escaped(quantity.name)} | {numbers} | {quantity.nearer} | {_escaped(why)} |"


def _escaped(text: str) -> str:
    """Text that does not end a cell, and in which names of keywords are no emphasis."""
    return text.replace("|", "\\|").replace("*", "\\*")
