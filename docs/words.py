"""How long the pages are, and how long their sentences: for the tests and for who writes.

python3 docs/words.py [PAGE ...]      # words, words a sentence, sentences of more than 30 words, by page
python3 docs/words.py --long PAGE     # these sentences
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LONG = 30
# What is not for users of the package, or of results of other programs, or written by a command, or examples, or for
# users of FEniCSx alone; the others, with the README, are the guide.
OTHERS = ("theory", "architecture", "trust", "evidence", "refusals", "answers", "decks", "judge")
OTHERS += ("i-want-to", "for-fenicsx", "bounds")


def guide() -> list[Path]:
    """The pages that a user meets."""
    return [ROOT / "README.md", *(page for page in sorted(ROOT.glob("docs/*.md")) if page.stem not in OTHERS)]


def words(page: Path) -> int:
    """All words of the file, tables, code and formulas included; marks without a letter or digit are none."""
    return sum(bool(re.search(r"\w", word)) for word in page.read_text(encoding="utf-8").split())


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
        for sentence in re.split(r"(?<=[.!?])[)*\"]*\s+(?=[\"(*]*(?![a-z]{2})\w)", paragraph.strip())
    ]
    return [sentence for sentence in found if len(sentence.split()) > 1]


def readability(page: Path) -> tuple[float, float]:
    """Words a sentence, and the share of sentences of more than ``LONG`` words."""
    lengths = [len(sentence.split()) for sentence in sentences(page)]
    if not lengths:
        return 0.0, 0.0
    return sum(lengths) / len(lengths), sum(length > LONG for length in lengths) / len(lengths)


def main(arguments: list[str]) -> None:
    """Print what is asked for."""
    pages = [Path(name) for name in arguments if name != "--long"]
    if "--long" in arguments:
        for page in pages:
            print(*(s for s in sentences(page) if len(s.split()) > LONG), sep="\n\n")
        return
    pages = pages or [*guide(), *(ROOT / "docs" / f"{name}.md" for name in OTHERS)]
    print("words  a sentence  longer than 30  page")
    for page in pages:
        mean, share = readability(page)
        print(f"{words(page):5} {mean:11.1f} {share:14.1%}   {page.name}")
    print(f"{sum(map(words, pages)):5} words; the guide has {sum(map(words, guide()))}")


if __name__ == "__main__":
    main(sys.argv[1:])
