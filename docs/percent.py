"""Scripts that are divided into cells by lines ``# %%``: as Markdown for these pages, and as
notebooks.

``./env python3 docs/percent.py demos/tutorial.py`` runs the script as a notebook and writes
``demos/tutorial.ipynb`` with its outputs, which the page of the script shows too.
"""

from __future__ import annotations

import json
import os
import re
import sys
import tempfile
from pathlib import Path
from typing import Any


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


def as_markdown(script: str, notebook: Path | None = None) -> str:
    """A script as a page: text, code in fences, and the outputs of its notebook if there is one."""
    outputs = iter(outputs_of(notebook)) if notebook is not None and notebook.exists() else None
    shown = []
    for kind, text in cells(script):
        shown.append(text if kind == "markdown" else f"```python\n{text}\n```")
        for output in next(outputs) if outputs is not None else ():
            if kind == "code":
                shown.append(_shown(output))
    return "\n\n".join(shown) + "\n"


def outputs_of(notebook: Path) -> list[list[dict[str, Any]]]:
    """The outputs of each cell of a notebook, none of cells of text."""
    found = []
    for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"]:
        outputs: list[dict[str, Any]] = []
        for output in cell.get("outputs", []):
            if "text" in output and outputs and outputs[-1].get("name") == output["name"]:
                outputs[-1] = {**outputs[-1], "text": [*outputs[-1]["text"], *output["text"]]}
            else:
                outputs.append(output)
        found.append(outputs)
    return found


def _shown(output: dict[str, Any]) -> str:
    """An output in Markdown: a picture, a table, or what was printed."""
    data = {kind: "".join(lines) for kind, lines in output.get("data", {}).items()}
    if "image/png" in data:
        return f'<img alt="Output" src="data:image/png;base64,{data["image/png"].strip()}">'
    if "text/html" in data:
        table = re.sub(
            r"\n\s*\n", "\n", data["text/html"]
        )  # a blank line would end the block of HTML
        return f'<div style="overflow-x: auto">{table}</div>'
    text = "".join(output.get("text", "")) or data.get("text/plain", "")
    text = re.sub(r"\n\s*\n", "\n", text)
    return f"```text\n{text.rstrip()}\n```"


def as_notebook(script: str) -> str:
    """A script as a notebook of Jupyter (nbformat 4.5), without outputs."""
    import nbformat
    from nbformat import v4

    make = {"markdown": v4.new_markdown_cell, "code": v4.new_code_cell}
    made = [
        make[kind](text, id=f"cell-{number}")
        for number, (kind, text) in enumerate(cells(script), 1)
    ]
    kernel = {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}}
    notebook = v4.new_notebook(cells=made, metadata=kernel)
    nbformat.validate(notebook)
    return str(nbformat.writes(notebook, version=4)) + "\n"


def executed(notebook: str) -> str:
    """The same notebook with its outputs, run in a folder of its own.

    Raises:
        CellExecutionError: a cell fails.
    """
    import nbformat
    from nbclient import NotebookClient

    os.environ.pop("MPLBACKEND", None)  # a notebook shows figures
    run = nbformat.reads(notebook, as_version=4)
    with tempfile.TemporaryDirectory() as folder:
        NotebookClient(run, kernel_name="python3", timeout=600, record_timing=False).execute(
            cwd=folder
        )
    run.metadata.pop("language_info", None)
    return str(nbformat.writes(run, version=4)) + "\n"


if __name__ == "__main__":
    for name in sys.argv[1:]:
        source = Path(name)
        notebook = executed(as_notebook(source.read_text(encoding="utf-8")))
        source.with_suffix(".ipynb").write_text(notebook, encoding="utf-8")
