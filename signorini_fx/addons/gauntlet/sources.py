"""Where cases of other programs are.  No dolfinx here."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

PROGRAM = "CalculiX"
ASTER = "code_aster"
COMMANDS = ".comm"
PRINTED = (".dat.ref", ".frd.ref")
_CONTACT = re.compile(r"^\*\s*(CONTACT\s*PAIR|TIE)\b", re.IGNORECASE | re.MULTILINE)

_ZONES = re.compile(r"^[^#\n]*\bDEFI_CONT(?:ACT)?\s*\(", re.MULTILINE)


def cases_of(folder: Path) -> Iterator[Path]:
    """All cases of a folder, or below."""
    yield from decks_of(folder)
    yield from command_files_of(folder)


def program_of(file: Path) -> str:
    """Whose case a file is."""
    return ASTER if file.suffix.lower() == COMMANDS else PROGRAM


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
