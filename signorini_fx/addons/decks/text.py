"""Abaqus input files as text: keywords with their parameters and data lines, and numbers.

Parameters of keywords that are not known are reported as lost by their names.  A known parameter is
either read, or does not change the solution, such as controls of the solver. After ``=`` stand the
only known values, without blanks; an empty one means a parameter without a value.  INPUT names a
file and may belong to any keyword.

The keywords that are not read are listed by whether the solution changes, with the reason.
Keywords that are read in part are reported by their readers.  The tests read a deck with each of
these keywords.
"""

from __future__ import annotations

import codecs
import io
import itertools
import json
import math
import os
import re
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from signorini_fx.arrays import Array, Ints, Plain
from signorini_fx.errors import MeshError

# How many words each data line has at least, and how many data lines a keyword has at most.
_LEAST_WORDS = {
    **dict.fromkeys(("NODE", "NSET", "ELSET", "SURFACE", "CONTACTPAIR", "TIE", "DLOAD"), 1),
    **dict.fromkeys(("BOUNDARY", "CLOAD", "DSLOAD", "TEMPERATURE", "INITIALCONDITIONS"), 2),
}
_MOST_ROWS = {"STATIC": 1, "SURFACEINTERACTION": 1, "ENDSTEP": 0, "MATERIAL": 0}
_DEEPEST = 20  # files that include each other
_LARGEST = 2.0**53  # whole numbers from there on are not exact as floating point numbers
_STAR = re.compile(r"^[ \t]*\*", re.MULTILINE)
_LABELS = {
    **{"ENCASTRE": "123456", "PINNED": "123", "XSYMM": "156", "YSYMM": "246", "ZSYMM": "345"},
    **{"XASYMM": "234", "YASYMM": "135", "ZASYMM": "126"},
}
ROTATIONS = range(4, 7)


@dataclass
class DeckBlock:
    """A keyword with its parameters and its data lines."""

    keyword: str  # in capitals and without blanks, which the programs ignore
    parameters: dict[str, str]  # in capitals -> value
    line: int  # in the file, from 1
    name: str = ""  # the keyword as it is written, in capitals
    file: str = ""  # the included file that has it, by its name there; empty: the input file itself
    number: int = 0  # of the keyword, counted over all files
    texts: list[str] = field(default_factory=list)  # its data lines, in one or several texts

    @cached_property
    def rows(self) -> Sequence[list[str]]:
        """The data lines, split at commas, without empty words at the end of a line."""
        return [
            split_words(line.strip()) for line in "\n".join(self.texts).split("\n") if line.strip()
        ]

    def word(self, key: str, otherwise: str = "") -> str:
        """Return the value of a parameter in capitals, or ``otherwise`` in capitals if it is not
        given.
        """
        return self.parameters.get(key, otherwise).upper()

    def numbers(self, kind: type[np.float64 | np.int64]) -> tuple[Any, int] | None:
        """Return all numbers of the data lines, and how many each line has, 0 if lines differ.

        Returns None if a word is empty, too large or no number.
        """
        text = re.sub(r",[, \t]*\n", "\n", "\n".join(self.texts).rstrip(", \t\n"))
        lengths = [line.count(",") + 1 for line in text.split("\n")]
        alike = len(set(lengths)) == 1
        table = io.StringIO(text if alike else text.replace(",", "\n"))
        with warnings.catch_warnings():
            warnings.simplefilter(
                "error"
            )  # numpy warns of an integer with a point, and of no numbers
            try:
                values = np.loadtxt(
                    table, dtype=kind, delimiter=",", comments=None, ndmin=2
                ).ravel()
            except (ValueError, Warning):
                return None
        largest = _LARGEST if kind is np.int64 else math.inf
        if (
            len(values) != sum(lengths) or not (np.abs(values) < largest).all()
        ):  # an empty word is no number
            return None
        return values, lengths[0] if alike else 0

    @property
    def unread(self) -> list[str]:
        """The parameters that are not read, as ``NAME`` or ``NAME=VALUE``."""
        return unread_parameters(self.keyword, self.parameters)

    @property
    def place(self) -> str:
        """The line of the keyword and, for an included file, the name of the file."""
        return f"line {self.line}" + (f" of {self.file}" if self.file else "")

    @property
    def origin(self) -> str:
        """The place and the name of the keyword."""
        return f"{self.place}, *{self.name}"


def origins_of(blocks: Iterable[DeckBlock]) -> str:
    """Return the origins of several keywords, each once."""
    return " and ".join(dict.fromkeys(block.origin for block in blocks))


class DeckError(ValueError):
    """An error in a keyword of an input file."""

    def __init__(self, block: DeckBlock, why: str) -> None:
        self.block = block
        super().__init__(why)


# Messages of Python about words that are no numbers.
_PYTHONS_WORDS = re.compile(r"invalid literal for int\(\) with base 10: |could not convert .*: ")


@contextmanager
def mesh_errors(file: Path, block: DeckBlock | None = None) -> Iterator[None]:
    """Turn errors in reading a keyword into a ``MeshError`` that names its line."""
    try:
        yield
    except DeckError as error:
        raise MeshError(f"{file}: {error.block.origin}: {error}") from None
    except (ValueError, LookupError, OverflowError, TypeError) as error:
        words = {
            IndexError: "a data line ends too early, or is missing",
            KeyError: f"{error.args[0]} is missing",
            OverflowError: "a number is too large",
        }
        why = words.get(type(error), _PYTHONS_WORDS.sub("a number is expected, got ", str(error)))
        raise MeshError(f"{file}: {block.origin + ': ' if block else ''}{why}") from None


def split_words(line: str) -> list[str]:
    """Return the words of a data line, without empty words at its end."""
    words = [word.strip().strip('"') for word in line.rstrip(", \t").split(",")]
    return words if any(words) else []


def read_keywords(file: Path) -> tuple[list[DeckBlock], list[Path]]:
    """Return all keywords of an input file and of the files that it includes, and the paths of
    these files.

    Included files must be in the folder of the input file.
    """
    blocks: list[DeckBlock] = []
    files: list[Path] = []
    _read(file, file, "", blocks, files, 0)
    return blocks, files


def _read(
    deck: Path, file: Path, label: str, blocks: list[DeckBlock], files: list[Path], depth: int
) -> None:
    """Append the keywords of a file; data lines at its beginning belong to the last keyword."""
    try:
        content = file.read_bytes()
    except OSError as error:
        raise MeshError(f"{file}: cannot be read: {error.strerror or error}") from None
    files.append(file)
    wide = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    text = content.decode("utf-16" if wide else "utf-8-sig", errors="replace")
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    starts = [match.start() for match in _STAR.finditer(text)]
    line = 1
    for begin, end in itertools.pairwise([0, *(start for start in starts if start), len(text)]):
        chunk = text[begin:end]
        heading_line = line
        line += chunk.count("\n")
        heading, _, data = chunk.partition("\n")
        if begin not in starts:  # it is no keyword
            data = chunk
        elif not heading.strip().startswith("**"):
            while heading.rstrip().endswith(",") and _continues(heading, data):
                continuation, _, data = data.partition("\n")
                heading += continuation
            name, parameters = _heading(heading.strip())
            block = DeckBlock(name.replace(" ", ""), parameters, heading_line, name, label)
            included = block.keyword == "INCLUDE"
            # Data lines at the beginning of an included file belong to the keyword before it.
            blocks.insert(max(len(blocks) - 1, 0) if included else len(blocks), block)
            if included or "INPUT" in parameters:
                with mesh_errors(deck, block):
                    inner = _included_path(deck, parameters["INPUT"], depth)
                _read(deck, inner, parameters["INPUT"], blocks, files, depth + 1)
        if blocks and data.strip():
            blocks[-1].texts.append(data.strip("\n"))


def _heading(line: str) -> tuple[str, dict[str, str]]:
    """Return the name of a keyword, in capitals, and its parameters."""
    words = [word.strip() for word in line[1:].split(",")]
    pairs = (word.partition("=") for word in words[1:] if word)
    parameters = {squeezed(key): value.strip().strip('"') for key, _, value in pairs}
    return " ".join(words[0].upper().split()), parameters


def _continues(heading: str, data: str) -> bool:
    """Return whether the first line of ``data`` begins with a parameter of the keyword above it."""
    word = data.partition("\n")[0].partition(",")[0]
    return "=" in word or is_parameter(squeezed(heading.partition(",")[0])[1:], squeezed(word))


def _included_path(deck: Path, name: str, depth: int) -> Path:
    """Return the path of an included file."""
    if depth >= _DEEPEST:
        raise ValueError(f"files include each other more than {_DEEPEST} times deep")
    folder = deck.parent.resolve()
    path = (folder / name.replace("\\", "/")).resolve()
    if not path.is_relative_to(folder):
        raise ValueError(f"{name!r} is outside of the folder of the input file: put it there")
    if not os.path.isfile(path):
        raise ValueError(f"there is no file {name!r} in the folder of the input file")
    return path


def check_rows(block: DeckBlock) -> None:
    """Check the number of data lines, and of words in lines that name nodes, elements, sets or
    surfaces.
    """
    least = _LEAST_WORDS.get(block.keyword, 0)
    if block.keyword not in _MOST_ROWS and not least:
        return
    limit = math.inf if "USER" in block.parameters else _MOST_ROWS.get(block.keyword, math.inf)
    for number, row in enumerate(block.rows, start=1):
        if number > limit:
            raise ValueError(
                f"data line {number}, {', '.join(row)!r}, is one too many: of which keyword is it?"
            )
        if len(row) < least:
            expected = (
                "a name or number, and what is said of it, are"
                if least > 1
                else "a name or number is"
            )
            written = f"only {row[0]!r}" if row else "no word"
            raise ValueError(f"data line {number} has {written}: {expected} expected")


def real(word: str) -> float:
    """Return a finite number, also in Fortran's notation; an empty word is zero, as in Abaqus and
    CalculiX.
    """
    if not word:
        return 0.0
    try:
        number = float(word)
    except ValueError:
        number = float(re.sub("[dD]", "E", word))
    if not math.isfinite(number):
        raise ValueError(f"a finite number is expected, got {word!r}")
    return number


def real_or_none(word: str) -> float | None:
    """Return a finite number as ``real`` does, or None if the word is no number."""
    try:
        return real(word)
    except ValueError:
        return None


def parameter(block: DeckBlock, key: str) -> float:
    """Return the value of a parameter of a keyword as a number."""
    if not (word := block.parameters[key]):
        raise ValueError(f"{key} has no value")
    return real(word)


def number_of(word: str) -> int | None:
    """Return the number of a node or element, or None if the word is a name."""
    return int(word) if word.isascii() and word.isdigit() else None


def components(words: Sequence[str]) -> dict[int, float]:
    """Return the values that a row of *BOUNDARY prescribes after its node or set, by component: 1
    to 3 are displacements, 4 to 6 rotations.
    """
    if (held := _LABELS.get(words[0].upper())) is not None:
        return {int(component): 0.0 for component in held}
    first, last, value = (*words, "", "")[:3]
    return dict.fromkeys(range(int(first), int(last or first) + 1), real(value) if value else 0.0)


def coordinates(block: DeckBlock) -> tuple[Ints, Array]:
    """Return the numbers of the nodes of *NODE and their coordinates; missing coordinates
    are zero.
    """
    if (number_table := block.numbers(np.float64)) is not None and number_table[1]:
        table = number_table[0].reshape(-1, number_table[1])
        if np.all(table[:, 0] % 1 == 0) and np.abs(table[:, 0]).max() < _LARGEST:
            return table[:, 0].astype(np.int64), table[:, 1:4].copy()
    check_rows(block)
    width = min(max(map(len, block.rows), default=1) - 1, 3)
    numbers = np.array([int(row[0]) for row in block.rows], dtype=np.int64)
    words = [(*row[1:4], "", "", "")[:width] for row in block.rows]
    return numbers, np.array([list(map(real, row)) for row in words], dtype=np.float64).reshape(
        len(words), width
    )


def lines_of(table: Mapping[str, Plain]) -> list[str]:
    """Return the lines of a table of a scene, without keys that have no value; the value of the key
    "#" becomes a comment.
    """
    given = {key: value for key, value in table.items() if value not in (None, "", ())}
    return [
        f"# {value}" if key == "#" else f"{key} = {written(value)}" for key, value in given.items()
    ]


def written(value: Plain) -> str:
    """Return a value in the notation of a scene."""
    match value:
        case str():
            return json.dumps(value, ensure_ascii=False)
        case bool():
            return "true" if value else "false"
        case list() | tuple():
            return f"[{', '.join(map(written, value))}]"
        case dict():
            return f"{{ {', '.join(lines_of(value))} }}"
    return repr(value)


def factors_of(values: Sequence[float]) -> tuple[float, tuple[float, ...]]:
    """Return the largest value of several steps by magnitude, and the ratio of each value to it; no
    ratios if all values are equal.
    """
    largest = max(values, key=abs)
    shares = tuple(value / largest for value in values) if largest else ()
    return largest, shares if set(shares) != {1.0} else ()


_SECTION = "ELSET MATERIAL ORIENTATION CONTROLS"
_LOAD = "OP=MOD|NEW AMPLITUDE TIMEDELAY"
KNOWN: dict[str, str] = {
    # Structure of the file, and the mesh.
    **dict.fromkeys(("HEADING", "SYSTEM", "ENDSTEP", "INCLUDE"), ""),
    **dict.fromkeys(("ENDPART", "ENDINSTANCE", "ENDASSEMBLY"), ""),
    **dict.fromkeys(("PART", "ASSEMBLY", "MATERIAL"), "NAME"),
    "INSTANCE": "NAME PART",
    "NODE": "NSET SYSTEM",
    "ELEMENT": "TYPE ELSET",
    "NSET": "NSET ELSET GENERATE INSTANCE INTERNAL UNSORTED",
    "ELSET": "ELSET GENERATE INSTANCE INTERNAL UNSORTED",
    "SURFACE": "NAME TYPE=ELEMENT|NODE INTERNAL",
    # Sections and materials.
    "SOLIDSECTION": _SECTION,
    "SHELLSECTION": f"{_SECTION} OFFSET SECTIONINTEGRATION",
    "MEMBRANESECTION": _SECTION,
    "DENSITY": "",
    "MASS": "ELSET TYPE",
    "ELASTIC": "TYPE MODULI=LONGTERM",
    "EXPANSION": "TYPE ZERO",
    "HYPERELASTIC": "NEOHOOKE MOONEY-RIVLIN OGDEN POLYNOMIAL REDUCEDPOLYNOMIAL N MODULI=LONGTERM",
    "PLASTIC": "HARDENING EXTRAPOLATION=CONSTANT",
    # Contact.
    "SURFACEINTERACTION": "NAME USER UNSYMM",
    "FRICTION": "ROUGH TAUMAX SLIPTOLERANCE ELASTICSLIP LAGRANGE",
    "SURFACEBEHAVIOR": "PRESSURE-OVERCLOSURE NOSEPARATION DIRECT PENALTY AUGMENTEDLAGRANGE",
    "CONTACTPAIR": "INTERACTION TYPE ADJUST TIED SMALLSLIDING NOTHICKNESS TRACKING "
    "EXTENSIONZONE HCRIT SUPPLEMENTARYCONSTRAINTS",
    "TIE": "NAME ADJUST=|YES|NO POSITIONTOLERANCE CYCLICSYMMETRY NOROTATION NOTHICKNESS "
    "TYPE=SURFACETOSURFACE|NODETOSURFACE",
    "PRE-TENSIONSECTION": "SURFACE NODE",
    # Steps and loads.
    "STEP": "NAME INC INCF NLGEOM=|YES|NO PERTURBATION AMPLITUDE UNSYMM EXTRAPOLATION CONVERTSDI",
    "STATIC": "DIRECT SOLVER",
    "AMPLITUDE": "NAME TIME=STEPTIME|TOTALTIME DEFINITION VALUE=RELATIVE",
    "BOUNDARY": f"{_LOAD} TYPE FIXED SUBMODEL USER",
    **dict.fromkeys(("CLOAD", "DLOAD"), _LOAD),
    "DSLOAD": f"{_LOAD} FOLLOWER CONSTANTRESULTANT",
    "TEMPERATURE": f"{_LOAD} FILE BSTEP USER LINTEMP",
    "INITIALCONDITIONS": "TYPE FILE",
    "RESTART": "WRITE FREQUENCY NUMBERINTERVAL TIMEMARKS OVERLAY",
}


def squeezed(word: str) -> str:
    """Return a keyword, a parameter or a value in capitals and without blanks."""
    return "".join(word.split()).upper()


def _values_of(keyword: str) -> dict[str, list[str]]:
    """Return the known values of each known parameter of a keyword; an empty list means that all
    values are known.
    """
    pairs = (word.partition("=") for word in f"INPUT {KNOWN[keyword]}".split())
    return {name: values.split("|") if equals else [] for name, equals, values in pairs}


def is_parameter(keyword: str, word: str) -> bool:
    """Return whether a word is a known parameter of a keyword, whatever its value."""
    return word in _values_of(keyword) if keyword in KNOWN else False


def unread_parameters(keyword: str, parameters: Mapping[str, str]) -> list[str]:
    """Return the parameters of a keyword that are not read, as ``NAME`` or ``NAME=VALUE``."""
    if keyword not in KNOWN:
        return []
    known = _values_of(keyword)
    unread = []
    for name, value in parameters.items():
        values = known.get(name)
        if values is None or (values and squeezed(value) not in values):
            unread.append(f"{name}={value}" if value else name)
    return unread


UNKNOWN = "not read"
CONSTRAINT = "a constraint between nodes is not read"
CHANGED_WITHIN = "a change within a step is not read: the first value holds"
WITHOUT_EFFECT = "without effect in static steps"
OTHER_PROCEDURE = "only static steps are read"
NO_BODY_PART = "no part of the body"


def _each(effect: str, *names: str) -> dict[str, str]:
    """Return one reason for several keywords, whose blanks are removed, as Abaqus and CalculiX
    ignore them.
    """
    return dict.fromkeys((name.replace(" ", "") for name in names), effect)


# Keywords that change the answer; so do those that are in no table.
LOST = {
    **_each(CHANGED_WITHIN, "CHANGE FRICTION", "CHANGE SURFACE BEHAVIOR"),
    **_each(NO_BODY_PART, "BEAM SECTION"),
    **_each("rotated axes of nodes are not read", "TRANSFORM"),
    **_each(
        OTHER_PROCEDURE,
        *("FREQUENCY", "COMPLEX FREQUENCY", "BUCKLE", "DYNAMIC", "MODAL DYNAMIC"),
        *(
            "STEADY STATE DYNAMICS",
            "STEADY STATE TRANSPORT",
            "HEAT TRANSFER",
            "VISCO",
            "GREEN",
            "CFD",
            "SENSITIVITY",
        ),
        *(
            "COUPLED TEMPERATURE-DISPLACEMENT",
            "UNCOUPLED TEMPERATURE-DISPLACEMENT",
            "COUPLED THERMAL-ELECTRICAL",
        ),
        *(
            "SUBSTRUCTURE GENERATE",
            "ANNEAL",
            "ELECTROMAGNETICS",
            "NO ANALYSIS",
            "RANDOM RESPONSE",
            "GEOSTATIC",
        ),
        *(
            "RESPONSE SPECTRUM",
            "SOILS",
            "MASS DIFFUSION",
            "DIRECT CYCLIC",
            "CRACK PROPAGATION",
            "ROBUST DESIGN",
        ),
        "FEASIBLE DIRECTION",
    ),
    **_each("general contact is not read: name pairs of surfaces", "CONTACT", "CONTACT INCLUSIONS"),
    **_each("clearances are those of the mesh", "CLEARANCE"),
    **_each(
        "parts and contacts that come or go are not read: all are there throughout", "MODEL CHANGE"
    ),
    **_each(
        "rigid bodies are not read: give the shape as foundation of a contact, or its distance as "
        "gap",
        "RIGID BODY",
    ),
    **_each(
        *(CONSTRAINT, "EQUATION", "MPC", "COUPLING", "KINEMATIC", "DISTRIBUTING"),
        *("DISTRIBUTING COUPLING", "CYCLIC SYMMETRY MODEL"),
    ),
}
# Keywords that do not change it.
NOTED = {
    **_each("without effect on isotropic materials", "ORIENTATION"),
    **_each(
        *(WITHOUT_EFFECT, "CONDUCTIVITY", "SPECIFIC HEAT", "PHYSICAL CONSTANTS", "DAMPING"),
        *(
            "GAP CONDUCTANCE",
            "GAP HEAT GENERATION",
            "CONTACT DAMPING",
            "DESIGN VARIABLES",
            "VIEW FACTOR",
            "CFLUX",
        ),
        *("DFLUX", "FILM", "RADIATE", "EMISSIVITY"),
    ),
    **_each(
        "not written: fields.vtu and contact.csv of the result have all values",
        *("NODE PRINT", "EL PRINT", "FACE PRINT", "SECTION PRINT", "CONTACT PRINT"),
        *("NODE FILE", "EL FILE", "CONTACT FILE"),
    ),
}
# Other requests for output, and control of the solver, which a scene in static steps does not need.
OUTPUT = _each(
    *(
        "",
        "PREPRINT",
        "OUTPUT",
        "NODE OUTPUT",
        "ELEMENT OUTPUT",
        "CONTACT OUTPUT",
        "FIELD OUTPUT",
    ),
    *(
        "HISTORY OUTPUT",
        "PRINT",
        "ENERGY OUTPUT",
        "ENERGY PRINT",
        "MONITOR",
        "FILE FORMAT",
        "CONTROLS",
    ),
    *("HOURGLASS STIFFNESS", "TIME POINTS"),
)
