"""The description of the package for an index of packages; everything else is in pyproject.toml.

The README names files of the repository, which an index does not have: there a relative link leads nowhere, and a
relative image is shown as broken.  Hence the description is the README without its images and captions, and with the
words of its relative links only.
"""

import re
from pathlib import Path

from setuptools import setup

_NOTE = "Pages, pictures and folders that this text mentions are in the repository.\n\n"


def description(readme: str) -> str:
    """What an index of packages shows of a README."""
    text = re.sub(r"^<!--.*?-->\n", "", readme, flags=re.MULTILINE | re.DOTALL)
    text = re.sub(r"^!\[[^]]*\]\((?!https:)[^)]*\)\n\n(\*[^*]+\*\n\n)?", "", text, flags=re.MULTILINE)
    text = re.sub(r"\[([^]]+)\]\((?!https:)[^)]*\)", r"\1", text)
    title, rest = text.split("\n\n", 1)
    return f"{title}\n\n{_NOTE}{rest}"


if __name__ == "__main__":
    readme = Path(__file__).with_name("README.md").read_text(encoding="utf-8")
    setup(long_description=description(readme), long_description_content_type="text/markdown")
