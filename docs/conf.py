"""How Sphinx makes HTML of README, CONTRIBUTING, CHANGELOG and docs/: make docs."""

import re
from pathlib import Path

_ROOT = Path(__file__).resolve().parent.parent
_PACKAGE = (_ROOT / "signorini_fx" / "__init__.py").read_text(encoding="utf-8")

project = "signorini_fx"
release = re.search(r'__version__ = "(.+)"', _PACKAGE)[1]
extensions = ["myst_parser"]
myst_heading_anchors = 4  # GitHub's anchors: the tests check links against these
root_doc = "docs/index"
include_patterns = ["*.md", "docs/*.md", "docs/index.rst"]
html_theme = "furo"
html_title = f"{project} {release}"
html_show_copyright = False
html_copy_source = False
highlight_language = "none"
# Pygments does not know gmsh's language; a link to a folder is for readers of the repository. The tests check links.
suppress_warnings = ["misc.highlighting_failure", "myst.xref_missing"]
