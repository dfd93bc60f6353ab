"""Mutants that cosmic-ray draws on the lines that a change touches, and which of them no test of their rooms notices.

    git diff -U0 SINCE -- signorini_fx | ./env python3 -m benchmarks.stability.drawn [--number N] [--seed S] [--near]

``make mutants-drawn SINCE=...`` does it, with cosmic-ray in build/.  The tests of the rooms of the touched modules, and
of ``verification``, are run once on the code as it is; a mutant is then tried by those that ran its line, cheapest
first; what survives is tried by the tests of all other rooms, unless ``--near`` is given.  On each touched expression
at most one mutant is drawn.  Some mutants change nothing that matters: who reads the survivors decides.
"""

from __future__ import annotations

import argparse
import ast
import difflib
import random
import re
import sys
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.stability.copies import Copy, copied
from benchmarks.stability.lines import Line, recorded

ROOT = Path(__file__).parents[2]
TOOL = ROOT / "build" / "cosmic-ray-8.7.0"
SECONDS = 30.0  # of the tests that try a mutant, as they took on the code as it is
# What a programmer gets wrong; all other operators change a type, or give what any test notices.
OPERATORS = re.compile(
    "Replace(BinaryOperator_(Add_Sub|Sub_Add|Mul_Div|Div_Mul|Pow_Mul|BitAnd_BitOr|BitOr_BitAnd)"
    "|ComparisonOperator_(Lt_LtE|LtE_Lt|Gt_GtE|GtE_Gt|Lt_Gt|Gt_Lt|LtE_GtE|GtE_LtE|Eq_NotEq|NotEq_Eq|Is_IsNot|IsNot_Is)"
    "|UnaryOperator_Delete_(USub|Not|Invert)|TrueWithFalse|FalseWithTrue|AndWithOr|OrWithAnd|BreakWithContinue"
    "|ContinueWithBreak)|NumberReplacer|ZeroIterationForLoop"
)


@dataclass(frozen=True)
class Drawn:
    """A mutant."""

    file: str  # of the package, below the root of the repository
    line: int  # the number of its line
    in_function: bool  # whether the line stands in a function
    source: str  # the whole file with the mistake
    change: str  # the lines that differ, before and after


def touched(diff: str) -> dict[str, set[int]]:
    """File -> lines of its new version that a diff without context adds or changes."""
    lines: dict[str, set[int]] = defaultdict(set)
    file = ""
    for row in diff.splitlines():
        if row.startswith("+++ "):
            file = row.removeprefix("+++ ").removeprefix("b/")
        elif match := re.match(r"@@ -\S+ \+(\d+)(?:,(\d+))? @@", row):
            first, count = int(match[1]), int(match[2] or 1)
            lines[file] |= set(range(first, first + count))
    return {file: rows for file, rows in lines.items() if file.endswith(".py") and rows}


def idle(source: str) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Where mutants show nothing: annotations and decorators, and what is raised, which tests compare as words."""
    nodes: list[ast.AST] = []
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.FunctionDef():
                nodes += [*node.decorator_list, *([node.returns] if node.returns else [])]
            case ast.ClassDef():
                nodes += node.decorator_list
            case ast.arg(annotation=ast.expr() as annotation) | ast.AnnAssign(annotation=annotation):
                nodes.append(annotation)
            case ast.Raise():
                nodes.append(node)
    return [((n.lineno, n.col_offset), (n.end_lineno, n.end_col_offset)) for n in nodes]  # type: ignore[attr-defined]


def between_operands(source: str) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """From the end of the left to the beginning of the right operand: other signs ``*`` and ``**`` unpack arguments."""
    sums = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.BinOp)]
    return [((n.left.end_lineno or 0, n.left.end_col_offset or 0), (n.right.lineno, n.right.col_offset)) for n in sums]


def operators() -> dict[str, Any]:
    """The operators of cosmic-ray that count.

    Raises:
        SystemExit: it is not there.
    """
    sys.path.append(str(TOOL))
    try:
        from cosmic_ray.operators.provider import OperatorProvider
    except ImportError as error:
        raise SystemExit(f"{error}: run make {TOOL.relative_to(ROOT)}") from None
    provider = OperatorProvider()
    return {name: provider[name]() for name in provider if OPERATORS.fullmatch(name)}


def _nodes(node: Any) -> Iterator[Any]:
    yield node
    for child in getattr(node, "children", ()):
        yield from _nodes(child)


def mutants(file: str, source: str, lines: set[int], known: Mapping[str, Any], chance: random.Random) -> list[Drawn]:
    """One mutant for each expression, number or statement that begins on one of the lines of a file."""
    import parso

    spared, signs = idle(source), between_operands(source)
    functions = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.FunctionDef)]
    places: dict[tuple[int, int], list[tuple[str, int, int]]] = defaultdict(list)
    for name, operator in known.items():
        for number, node in enumerate(_nodes(parso.parse(source))):
            for index, (begin, _) in enumerate(operator.mutation_positions(node)):
                if begin[0] not in lines or any(first <= begin < last for first, last in spared):
                    continue
                if "BinaryOperator" not in name or any(first <= begin < last for first, last in signs):
                    places[begin].append((name, number, index))
    drawn = []
    for (line, _), ways in sorted(places.items()):
        name, number, index = chance.choice(ways)
        tree = parso.parse(source)
        node = next(node for k, node in enumerate(_nodes(tree)) if k == number)
        siblings = node.parent.children if node.parent else None
        spoilt = known[name].mutate(node, index)
        if siblings is not None:
            siblings[next(k for k, sibling in enumerate(siblings) if sibling is node)] = spoilt
        text = tree.get_code()
        rows = [row.rstrip() for row in difflib.ndiff(source.splitlines(), text.splitlines()) if row[0] in "-+"]
        if rows:
            inside = any(f.body[0].lineno <= line <= (f.end_lineno or 0) for f in functions)
            drawn.append(Drawn(file, line, inside, text, "\n".join(rows)))
    return drawn


def rooms(files: Sequence[str]) -> list[str]:
    """The folders of tests about some modules, and the one about all of the method."""
    names = {folder for file in files for folder in Path(file).parts[1:-1]} | {"verification"}
    return sorted(f"tests/{name}" for name in names if (ROOT / "tests" / name).is_dir())


def cheapest(tests: Sequence[tuple[str, float]], budget: float = SECONDS) -> list[str]:
    """As many tests, given with their seconds, as fit into a time, the cheapest first; the first one in any case."""
    chosen, left = [], budget
    for name, seconds in sorted(tests, key=lambda test: test[1]):
        if chosen and seconds > left:
            break
        chosen.append(name)
        left -= seconds
    return chosen


def fate(original: Copy, mutant: Drawn, tests: Sequence[str]) -> str:
    """What ended the trial of a mutant: a failed test, a limit, or "" if it survives."""
    with copied(original) as copy:
        (copy.code / mutant.file).write_text(mutant.source, encoding="utf-8")
        code, text = copy.pytest(tests, "files")
    if code is None:
        return "a limit of time or memory"
    failed = [row for row in text.splitlines() if row.startswith(("FAILED ", "ERROR "))]
    return "" if code in (0, 5) else (failed or ["ERROR not collected"])[0].partition(" ")[2].partition(" - ")[0]


def survivors(original: Copy, mutants: Sequence[Drawn], tests: Sequence[str]) -> list[Drawn]:
    """The mutants that none of some tests notices; the others are printed.

    Raises:
        SystemExit: the tests do not pass on the code as it is.
    """
    record = original.folder / "lines"
    quick = ["-p", "benchmarks.stability.lines", "--lines", str(record), "-m", "not slow"]
    code, text = original.pytest([*quick, *tests], "suite")
    if code != 0:
        raise SystemExit(f"the tests do not pass on the code as it is:\n{text}")
    run: dict[Line, list[tuple[str, float]]] = defaultdict(list)
    for node, seconds, lines in recorded(record):
        # Lines outside functions, which run at the import, are judged by what runs any of their module.
        for line in lines | {(file, 0) for file, _ in lines}:
            run[line].append((node, seconds))
    left = []
    for mutant in mutants:
        able = cheapest(run[mutant.file, mutant.line if mutant.in_function else 0])
        by = fate(original, mutant, able) if able else ""
        left += [] if by else [mutant]
        print(f"{mutant.file}:{mutant.line}: {by or f'passes {len(able)} tests'}\n{mutant.change}", flush=True)
    return left


def main(arguments: Sequence[str] | None = None) -> int:
    """Draw mutants, try them, and print those that survive."""
    parser = argparse.ArgumentParser(
        prog="python3 -m benchmarks.stability.drawn", description=(__doc__ or "").split("\n\n")[0]
    )
    parser.add_argument("--number", type=int, default=20, metavar="N", help="mutants to try")
    parser.add_argument("--seed", type=int, default=0, metavar="S", help="of what is drawn")
    parser.add_argument("--near", action="store_true", help="leave out the tests of other rooms")
    parser.add_argument("--tests", nargs="+", metavar="PATH", help="in place of the rooms of the touched modules")
    given = parser.parse_args(arguments)
    changed = {file: lines for file, lines in touched(sys.stdin.read()).items() if (ROOT / file).exists()}
    known, chance = operators(), random.Random(given.seed)
    every = [
        mutant
        for file, lines in sorted(changed.items())
        for mutant in mutants(file, (ROOT / file).read_text(encoding="utf-8"), lines, known, chance)
    ]
    chosen = chance.sample(every, min(given.number, len(every)))
    if not chosen:
        print("no line that was touched can be mutated")
        return 0
    near = given.tests or rooms([mutant.file for mutant in chosen])
    far = sorted({f"tests/{path.parent.name}" for path in (ROOT / "tests").glob("*/test_*.py")} - set(near))
    print(f"{len(every)} mutants on the lines touched, {len(chosen)} drawn", flush=True)
    left = chosen
    with copied() as original:
        for tests in [near] if given.tests or given.near else [near, far]:
            print(f"tests: {' '.join(tests)}", flush=True)
            left = survivors(original, left, tests) if left else []
    print(f"{len(chosen)} mutants, {len(chosen) - len(left)} noticed, {len(left)} survive")
    for mutant in left:
        print(f"survives: {mutant.file}:{mutant.line}\n{mutant.change}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
