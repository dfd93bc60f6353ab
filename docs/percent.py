"""Scripts that are divided into cells by lines ``# %%``: as Markdown for these pages, and as notebooks.

``./env python3 docs/percent.py demos/tutorial.py`` writes ``demos/tutorial.ipynb``, without outputs.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path


def cells(script: str) -> list[tuple[str, str]]:
    """The cells of a script as ("markdown", text) or ("code", text)."""
    found = []
    for part in re.split(r"^# %%", script, flags=re.MULTILINE)[1:]:
        head, _, body = part.partition("\n")
        if "[markdown]" in head:
            lines = (re.sub(r"^# ?", "", line) for line in body.strip().splitlines())
            found.append(("markdown", "\n".join(lines)))
        elif body.strip():
            found.append(("code", body.strip()))
    return found


def as_markdown(script: str) -> str:
    """A script as a page: text, and code in fences."""
    return "\n\n".join(text if kind == "markdown" else f"```python\n{text}\n```" for kind, text in cells(script)) + "\n"


def as_notebook(script: str) -> str:
    """A script as a notebook of Jupyter (nbformat 4.5), without outputs."""
    import nbformat
    from nbformat import v4

    make = {"markdown": v4.new_markdown_cell, "code": v4.new_code_cell}
    made = [make[kind](text, id=f"cell-{number}") for number, (kind, text) in enumerate(cells(script), 1)]
    kernel = {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}}
    notebook = v4.new_notebook(cells=made, metadata=kernel)
    nbformat.validate(notebook)
    return str(nbformat.writes(notebook, version=4)) + "\n"


if __name__ == "__main__":
    for name in sys.argv[1:]:
        source = Path(name)
        source.with_suffix(".ipynb").write_text(as_notebook(source.read_text(encoding="utf-8")), encoding="utf-8")
