"""How long the pages are, and how long their sentences.

python3 docs/words.py                 # words and share of long sentences of each page
python3 docs/words.py --long PAGE     # the sentences of more than 25 words
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LONG = 25


def pages() -> list[Path]:
    """README and the pages of this folder."""
    return [ROOT / "README.md", *sorted(ROOT.glob("docs/*.md"))]


def words(page: Path) -> int:
    """All words of the file, tables, code and formulas included."""
    return len(page.read_text(encoding="utf-8").split())


def sentences(page: Path) -> list[str]:
    """The sentences of paragraphs and list items; a formula or a piece of code is one word."""
    text = page.read_text(encoding="utf-8")
    text = re.sub(r"(?ms)^```.*?^```$|^    .*?$|<!--.*?-->|^\s*\|.*?$|^#.*?$", "\n\n", text)
    text = re.sub(r"(?s)\$\$.*?\$\$|\$[^$]+\$|`[^`]+`", "x", text)
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text)
    text = re.sub(r"(?m)^\s*(?:[-*]|\d+\.) ", "\n\n", text)
    found = [
        " ".join(sentence.split())
        for paragraph in re.split(r"\n\s*\n", text)
        for sentence in re.split(
            r"(?<=[.!?])[)*\"]*\s+(?=[\"(*]*(?![a-z]{2})\w)", paragraph.strip()
        )
    ]
    return [sentence for sentence in found if len(sentence.split()) > 1]


def long_sentences(page: Path) -> list[str]:
    """The sentences of more than ``LONG`` words."""
    return [sentence for sentence in sentences(page) if len(sentence.split()) > LONG]


if __name__ == "__main__":
    if "--long" in sys.argv:
        print(*long_sentences(Path(sys.argv[-1])), sep="\n\n")
    else:
        for one in pages():
            print(
                f"{words(one):6} {len(long_sentences(one)) / max(len(sentences(one)), 1):6.1%}  "
                f"{one.name}"
            )
        print(f"{sum(map(words, pages())):6} words")
