"""Where cases of other programs are.  No dolfinx here."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

PROGRAM = "CalculiX"
PRINTED = (".dat.ref", ".frd.ref")
_CONTACT = re.compile(r"^\*\s*(CONTACT\s*PAIR|TIE)\b", re.IGNORECASE | re.MULTILINE)


def decks_of(folder: Path) -> Iterator[Path]:
    """The input files of a folder, or below, with contact or ties, and printed results beside them."""
    for deck in sorted(folder.rglob("*.inp")):
        printed = any(deck.with_suffix(suffix).exists() for suffix in PRINTED)
        if printed and _CONTACT.search(deck.read_text(encoding="utf-8", errors="replace")):
            yield deck
