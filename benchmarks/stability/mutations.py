"""Texts and files spoilt at random, by seed: what ``fuzz`` and tests share."""

from __future__ import annotations

import random
import re
from collections.abc import Iterator, Sequence

NUMBERS = ("0", "-1", "1", "3", "1e9", "1_000_000_000", "-1e400", "1e-320", "nan", "inf", "2147483648", "9" * 30)
_HUGE = "0x" + "f" * 5000
VALUES = (
    *NUMBERS, _HUGE, "true", '""', "[]", "{}", "[[[[]]]]", "1979-05-27", '"auto"', "'x[0]'", '"x[2]"', '"1/0"',
    '"__import__(\'os\').system(\'touch PWNED\')"', '"open(\'PWNED\', \'w\')"', '"x.__class__"', '"9**9**9**9"',
    '"(lambda: 0)()"', '"[c for c in x]"',
    '"x[0]"' + "  # " + "y" * 3000, '"' + "(" * 500 + '"', '"' + "-" * 1500 + '1"',
    '"' + "x[0]+" * 350 + '1"', '"1e308*1e308"', '"2**100**2"', '"\\u0000"', '"/dev/zero"', '"../../etc/passwd"',
)  # fmt: skip
EXPRESSIONS = (
    "x[0]", "x[1]", "pi", "1", "0.5", "1e308", "-", "+", "*", "/", "**", "(", ")", "<", "<=", "and", "or", "not", "if",
    "else", "where(", "min(", "max(", "sqrt(", "log(", "abs(", ",", "&", "|", "~", "^", "%", "//", "@", ":=", "lambda",
    "[", "]", "{", "}", ".", "'", '"', "\\", "\n", "\t", "x", "x[", "x[-1]", "__class__", "import", "await", "f''",
    "0x", "1j", "1_0", "...", "é", "\x00", "\ud800", "=", "==", "!=", "is", "in", "*x", "yield",
)  # fmt: skip


def spoilt_bytes(data: bytes, chance: random.Random) -> bytes:
    """Bytes changed, cut out, cut off, repeated, or replaced altogether."""
    found = bytearray(data)
    match chance.randrange(6):
        case 0:
            for _ in range(chance.randrange(1, 8)):
                found[chance.randrange(len(found))] = chance.randrange(256)
        case 1:
            start = chance.randrange(len(found))
            del found[start : start + chance.randrange(1, 200)]
        case 2:
            del found[chance.randrange(len(found)) :]
        case 3:
            start, end = chance.randrange(len(found)), chance.randrange(len(found))
            found[start:start] = found[end : end + chance.randrange(1, 200)]
        case 4:
            lines = bytes(found).split(b"\n")
            where = chance.randrange(len(lines))
            words = lines[where].split(b" ")
            words[chance.randrange(len(words))] = chance.choice(NUMBERS).encode()
            lines[where] = b" ".join(words)
            return b"\n".join(lines)
        case _:
            return chance.randbytes(chance.randrange(1, 400))
    return bytes(found)


def spoilt_text(text: str, chance: random.Random) -> str:
    """A scene with values exchanged, or lines lost, doubled and mixed; or anything."""
    lines = text.splitlines()
    match chance.randrange(5):
        case 0 | 1:
            places = [k for k, line in enumerate(lines) if re.match(r"\s*#?\s*\w+ *=", line)]
            for _ in range(chance.randrange(1, 4)):
                where = chance.choice(places)
                key = lines[where].split("=")[0].lstrip("# ")
                lines[where] = f"{key}= {chance.choice(VALUES)}"
        case 2:
            del lines[chance.randrange(len(lines))]
            lines.insert(chance.randrange(len(lines)), chance.choice(lines))
        case 3:
            chance.shuffle(lines)
        case _:
            return spoilt_bytes(text.encode(), chance).decode("utf-8", "replace")
    return "\n".join(lines)


def spoilt_expression(chance: random.Random) -> str:
    """An expression, one with something out of place, or pieces of expressions in any order."""
    match chance.randrange(3):
        case 0:
            return _expression(chance, 5)
        case 1:
            text = _expression(chance, 4)
            where = chance.randrange(len(text))
            return text[:where] + chance.choice(EXPRESSIONS) + text[where + chance.randrange(3) :]
    return "".join(chance.choice(EXPRESSIONS) for _ in range(chance.randrange(1, 30)))


def _expression(chance: random.Random, depth: int) -> str:
    """A number made of coordinates, numbers and functions, in the syntax of scenes."""
    if depth == 0 or chance.random() < 0.2:
        return chance.choice(("x[0]", "x[1]", "pi", "0", "1", "-2.5", "1e300", "1e-300", "0.1"))
    a, b, c, d = (_expression(chance, depth - 1) for _ in range(4))
    condition = f"({a}) {chance.choice(('<', '<=', '>', '>='))} ({b})"
    function = chance.choice(("abs", "cos", "exp", "log", "sign", "sin", "sqrt", "tan", "tanh"))
    return chance.choice(
        (
            f"({a}) {chance.choice('+-*/')} ({b})",
            f"({a})**{chance.choice(('2', '-1', '0.5', '100', '0'))}",
            f"{function}({a})",
            f"{chance.choice(('min', 'max'))}({a}, {b})",
            f"where({condition}, {c}, {d})",
            f"({c} if {condition} else {d})",
            f"({c} if not {condition} and ({a}) < 1 < ({d}) else {b})",
        )
    )


def repeated(seed: int, count: int, kinds: Sequence[str]) -> Iterator[tuple[random.Random, str]]:
    """``count`` generators of random numbers with the kind that each is for; the same for the same seed."""
    for number in range(count):
        yield random.Random(seed * 1_000_003 + number), kinds[number % len(kinds)]
