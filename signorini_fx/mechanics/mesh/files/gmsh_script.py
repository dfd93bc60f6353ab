"""gmsh's scripts (.geo): those that do more than draw are refused.

The language of gmsh also has commands that start programs, write files and end the process, and a mesh or drawing of
others may contain them.
"""

from __future__ import annotations

import re
from pathlib import Path

from signorini_fx.errors import MeshError

# Comments and texts, whose words are no commands.
_SKIPPED = re.compile(r'//[^\n]*|/\*.*?\*/|"[^"\n]*"|\'[^\'\n]*\'', re.DOTALL)
_FORBIDDEN = re.compile(
    r"\b(?:(?:System|SystemCall|NonBlockingSystemCall|OnelabRun|ExternalProcess|CommandLine|Parse|Exit|Abort|Save|Print"
    r"|CreateDir)\b|(?:Error|Printf)\s*\([^;]*>)"
)
# These read another file, whose name follows.
_READS = re.compile(r"\b(?:Include|Merge|MergeFile|Open|ListFromFile|ShapeFromFile|FileName)\b")
_NAMED = re.compile(r"\s*[\[(=]?\s*[\"']([^\"'\n]*)[\"']")
_NO_SCRIPTS = (b"$MeshFormat", b"$Comments", b"ISO-10303-21", b"DBRep_DrawableShape", b"\nCASCADE Topology")


def check_script(file: Path, name: str = "", checked: frozenset[Path] = frozenset()) -> None:
    """Refuse a script with a word that starts programs, writes files, or reads files outside its folder.

    Args:
        file: the script.
        name: of the file that a scene names, in messages; "" if it is this one.
        checked: the scripts that include it.

    Raises:
        MeshError: with the word and its line.
        OSError: it cannot be read.
    """
    where = f"{name}: {file.name}" if name else str(file)
    text = file.read_text(encoding="utf-8-sig", errors="replace")
    if name and not text.endswith("\n"):
        raise MeshError(f"{where}: its last line does not end, so that gmsh would leave it out: add a line break")
    # Blanks in place of comments and texts leave all other places where they are.
    bare = _SKIPPED.sub(lambda skipped: re.sub(r"[^\n]", " ", skipped[0]), text)
    if word := _FORBIDDEN.search(bare):
        raise _refused(where, text, word.start(), "runs programs, writes files or ends the process")
    for word in _READS.finditer(bare):
        argument = _NAMED.match(text, word.end())
        if argument is None or Path(argument[1]).name != argument[1]:
            raise _refused(where, text, word.start(), "may read a file outside the folder of the script")
        other = file.with_name(argument[1])
        if other.is_file() and other not in checked and not _has_header(other):
            check_script(other, name or str(file), checked | {file, other})


def _refused(where: str, text: str, start: int, reason: str) -> MeshError:
    word = re.match(r"\w+", text[start:])
    line = text.count("\n", 0, start) + 1
    return MeshError(
        f"{where}: line {line}: {word and word[0]} is not allowed in a script, as it {reason}; give the .msh that gmsh "
        "makes of it"
    )


def _has_header(file: Path) -> bool:
    """Whether a file is a mesh or a drawing, which gmsh does not take for a script."""
    with file.open("rb") as stream:
        start = stream.read(256)
    return any(word in start for word in _NO_SCRIPTS)
