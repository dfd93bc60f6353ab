"""gmsh's scripts (.geo), translated into scripts that can only draw.

The language of gmsh also has commands that start programs, and read and write files.  Its parser has limits and
recoveries of its own, so that what looks like a text or a comment here may be a command there.  Therefore gmsh is never
given the script itself, but a translation that consists of the words listed below, numbers, punctuation, ``v1``,
``v2`` ... in place of the names of variables, and ``s1``, ``s2`` ... in place of texts.  Whatever gmsh makes of it, no
other word is in it.  What is not understood is refused.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from signorini_fx.errors import MeshError

_LARGEST = 1 << 20
_LONGEST_TEXT = 255

_TOKEN = re.compile(
    r"""(?P<blank>[ \t\r\f\n]+ | //[^\n]* | /\*.*?\*/)
    | (?P<number>(?:\d+\.?\d*|\.\d+)(?:[eEdD][-+]?\d+)?(?![\w.]))
    | (?P<word>[A-Za-z_]\w*)
    | (?P<text>"[^"\n]*" | '[^'\n]*')
    | (?P<sign>\+=|-=|\*=|/=|\+\+|--|==|!=|<=|>=|&&|\|\||[-+*/%^=<>!?:;,.()\[\]{}\#])""",
    re.VERBOSE | re.DOTALL | re.ASCII,
)

# What a script may do: points, curves, surfaces, volumes, and how they are meshed.
_GEOMETRY = (
    "Point Line Curve Circle Ellipse Spline BSpline Bezier Wire Loop Surface Plane Ruled Filling Volume Physical "
    "Compound Box Sphere Cylinder Cone Torus Wedge Rectangle Disk Fillet Chamfer ThruSections Extrude Translate "
    "Rotate Symmetry Dilate Affine Duplicata Boundary CombinedBoundary PointsOf In BoundingBox BooleanUnion "
    "BooleanIntersection BooleanDifference BooleanFragments Delete Recursive Coherence Reverse SetFactory"
)
_MESH = (
    "Layers Recombine Transfinite Using Progression Bump Left Right Alternate AlternateLeft AlternateRight "
    "Characteristic Length MeshSize MeshAlgorithm Smoother Periodic Field Background Mesh Geometry Distance "
    "Threshold Ball Frustum Constant Restrict BoundaryLayer Attractor"
)
_NUMBERS = (
    "For EndFor If ElseIf Else EndIf newp newl newc newll news newsl newv newreg newf Pi Exp Log Log10 Sqrt Sin "
    "Asin Cos Acos Tan Atan Atan2 Sinh Cosh Tanh Fabs Abs Floor Ceil Round Fmod Modulo Hypot Min Max Unique "
    "LinSpace LogSpace"
)
_WORDS = frozenset(f"{_GEOMETRY} {_MESH} {_NUMBERS}".split())
# Categories of options; and the only options of another one.
_OPTIONS, _GENERAL = ("Mesh", "Geometry"), ("Terminal", "Verbosity")
# A skipped part of a script ends for gmsh where it finds such letters, even within a name.
_ENDS = re.compile("End|Else|If")
_KERNELS = ("OpenCASCADE", "Built-in")
# What a text may name.
_NAMED = ("Point", "Line", "Curve", "Surface", "Volume")
_ASSIGNMENTS = ("=", "+=", "-=", "*=", "/=", "++", "--")


@dataclass(frozen=True)
class Script:
    """A translated script.

    Attributes:
        text: what gmsh gets, line by line as in the script.
        words: what stands for a name or a text -> that name or text.
    """

    text: str
    words: dict[str, str]

    def original(self, text: str) -> str:
        """A name or a message of gmsh in the words of the script."""
        return re.sub(r"\b[vs]\d+\b", lambda match: self.words.get(match[0], match[0]), text)


@dataclass(frozen=True)
class _Token:
    kind: str
    text: str
    line: int


def translated(file: Path) -> Script:
    """A script that does at most what the file asks for, and nothing but draw.

    Raises:
        OSError: the file cannot be read.
        MeshError: it contains something else; the message names it and its line.
    """
    with file.open(encoding="utf-8-sig", errors="replace") as stream:
        text = stream.read(_LARGEST + 1)
    if len(text) > _LARGEST:
        raise MeshError(f"{file}: a script of more than {_LARGEST >> 20} MB; give the .msh that gmsh makes of it")
    if text.startswith("$"):
        raise MeshError(f"{file}: is not a gmsh script: it begins with $; a mesh must end in .msh")
    try:
        return _translated(list(_tokens(text)))
    except _NotUnderstoodError as error:
        raise MeshError(
            f"{file}: {error} is not allowed in a script: it may only describe geometry and mesh; "
            "give the .msh that gmsh makes of it"
        ) from None


class _NotUnderstoodError(ValueError):
    def __init__(self, token: str, line: int) -> None:
        super().__init__(f"line {line}: {token if len(token) <= 40 else f'{token[:40]} ...'}")


def _tokens(text: str) -> Iterator[_Token]:
    position, line = 0, 1
    while position < len(text):
        token = _TOKEN.match(text, position)
        if token is None:
            raise _NotUnderstoodError(text[position:].split("\n", 1)[0], line)
        if token.lastgroup != "blank":
            yield _Token(str(token.lastgroup), token[0], line)
        line += token[0].count("\n")
        position = token.end()


def _translated(tokens: list[_Token]) -> Script:
    end = _Token("end", "", 0)
    variables = _variables(tokens)
    stands_for: dict[tuple[str, str], str] = {}

    def number(kind: str, text: str) -> str:
        return stands_for.setdefault((kind, text), f"{kind}{len(stands_for) + 1}")

    lines: list[list[str]] = [[]]
    for k, token in enumerate(tokens):
        previous = [tokens[k - n] if k >= n else end for n in (1, 2, 3)]
        following = [tokens[k + n] if k + n < len(tokens) else end for n in (1, 2)]
        lines += [[] for _ in range(token.line - len(lines))]
        written = token.text
        if token.kind == "text":
            written = f'"{_text(token, previous, number)}"'
        elif token.kind == "word" and previous[0].text == ".":
            # An option: only its value counts, which is no text.
            if previous[1].text not in (*_OPTIONS, "General", "]") or _ENDS.search(token.text):
                raise _NotUnderstoodError(f"{previous[1].text}.{token.text}", token.line)
        elif token.kind == "word" and token.text == "General":
            if following[0].text != "." or following[1].text not in _GENERAL:
                raise _NotUnderstoodError(f"General.{following[1].text}", token.line)
        elif token.kind == "word" and token.text in variables:
            written = number("v", token.text)
        elif token.kind == "word" and token.text not in _WORDS:
            raise _NotUnderstoodError(token.text, token.line)
        lines[-1].append(written)
    words = {new: old for (_, old), new in stands_for.items()}
    return Script("\n".join(" ".join(line) for line in lines) + "\n", words)


def _text(token: _Token, previous: list[_Token], number: Callable[[str, str], str]) -> str:
    """What stands for a text, which may be the name of a physical group, or of one of gmsh's kernels."""
    text = token.text[1:-1]
    first, second, third = (earlier.text for earlier in previous)
    if (first, second) == ("(", "SetFactory") and text in _KERNELS:
        return text
    named = first == "(" and second in _NAMED and third == "Physical"
    if named and 0 < len(text) <= _LONGEST_TEXT and text.isprintable():
        return number("s", text)
    raise _NotUnderstoodError(token.text, token.line)


def _variables(tokens: list[_Token]) -> set[str]:
    """The names to which something is assigned; ``name[] = ...`` and ``name() = ...`` are lists."""
    names = set()
    for k, token in enumerate(tokens):
        if token.kind != "word" or (k and tokens[k - 1].text == ".") or token.text in _WORDS:
            continue
        following = [later.text for later in tokens[k + 1 : k + 4]]
        if following[:2] in (["[", "]"], ["(", ")"]):
            following = following[2:]
        if (following and following[0] in _ASSIGNMENTS) or (
            k and tokens[k - 1].text == "For" and following[:1] == ["In"]
        ):
            names.add(token.text)
    return names
