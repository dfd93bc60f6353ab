"""The layout of docstrings, which tools read: pages, editors and the schema of scenes."""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
ENTRY = re.compile(r"\**[A-Za-z_]\w*(, \**[A-Za-z_]\w*)*: ")


def entries(doc):
    """The lines at which entries of Args and Attributes may begin."""
    section = None
    for line in doc.splitlines():
        indent = len(line) - len(line.lstrip())
        if line.strip() in ("Args:", "Attributes:"):
            section = indent
        elif line.strip() and section is not None and indent <= section:
            section = None
        elif line.strip() and section is not None and indent == section + 4:
            yield line.strip()


def test_entries_begin_with_names():
    """What follows in the next lines is further in, also after the lines were wrapped anew."""
    wrong = []
    for file in sorted((ROOT / "signorini_fx").rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                wrong += [
                    f"{file.name}: {node.name}: {line}"
                    for line in entries(ast.get_docstring(node) or "")
                    if not ENTRY.match(f"{line} ") or line.startswith("None: ")
                ]
    assert wrong == []
