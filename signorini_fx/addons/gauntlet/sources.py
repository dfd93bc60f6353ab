"""Where cases of other programs are.  No dolfinx here."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

PROGRAM = "CalculiX"
ASTER = "code_aster"
KRATOS = "Kratos"
FRONTISTR = "FrontISTR"
COMMANDS = ".comm"
PARAMETERS = "_parameters.json"
CONTROL = ".cnt"
PRINTED = (".dat.ref", ".frd.ref")
_CONTACT = re.compile(r"^\*\s*(CONTACT\s*PAIR|TIE)\b", re.IGNORECASE | re.MULTILINE)
_CONTACT_CARD = re.compile(r"^!CONTACT\s*(,|$)", re.IGNORECASE | re.MULTILINE)
_CONTACT_PROCESS = re.compile(r'"[\w.]*(contact|mesh_tying)_process"')
_ZONES = re.compile(r"^[^#\n]*\bDEFI_CONT(?:ACT)?\s*\(", re.MULTILINE)


def cases_of(folder: Path) -> Iterator[Path]:
    """All cases of a folder, or below."""
    yield from decks_of(folder)
    yield from command_files_of(folder)
    yield from parameters_of(folder)
    yield from controls_of(folder)


def program_of(file: Path) -> str:
    """Whose case a file is."""
    return {".json": KRATOS, CONTROL: FRONTISTR, COMMANDS: ASTER}.get(file.suffix.lower(), PROGRAM)


def name_of(file: Path) -> str:
    """The name of a case; of programs whose folders have the same names in them with the folder."""
    if program_of(file) == FRONTISTR:
        return f"{file.parent.name}/{file.stem}"
    if program_of(file) == KRATOS:
        return f"{file.parent.name}/{file.name.removesuffix(PARAMETERS).removesuffix('.json')}"
    return file.stem


def decks_of(folder: Path) -> Iterator[Path]:
    """The input files of a folder, or below, with contact or ties, and printed results beside them."""
    for deck in sorted(folder.rglob("*.inp")):
        printed = any(deck.with_suffix(suffix).exists() for suffix in PRINTED)
        if printed and _CONTACT.search(deck.read_text(encoding="utf-8", errors="replace")):
            yield deck


def command_files_of(folder: Path) -> Iterator[Path]:
    """The command files of a folder, or below, with contact and values that code_aster has computed."""
    for file in sorted(folder.rglob(f"*{COMMANDS}")):
        text = file.read_text(encoding="utf-8", errors="replace")
        if _ZONES.search(text) and "TEST_" in text:
            yield file


def parameters_of(folder: Path) -> Iterator[Path]:
    """The parameters of Kratos in a folder, or below, with contact and values that Kratos has computed."""
    for pattern in (f"*{PARAMETERS}", "ProjectParameters*.json"):
        for file in sorted(folder.rglob(pattern)):
            text = file.read_text(encoding="utf-8", errors="replace")
            if _CONTACT_PROCESS.search(text) and "from_json_check_result_process" in text:
                yield file


def controls_of(folder: Path) -> Iterator[Path]:
    """The control files of FrontISTR in a folder, or below, with contact, and a mesh and results beside them."""
    for file in sorted(folder.rglob(f"*{CONTROL}")):
        text = file.read_text(encoding="utf-8", errors="replace")
        if (
            _CONTACT_CARD.search(text)
            and file.with_suffix(".msh").exists()
            and any(file.parent.glob(f"{file.stem}.res.*"))
        ):
            yield file
