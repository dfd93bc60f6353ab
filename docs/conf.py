"""How Sphinx makes HTML of README, CONTRIBUTING, CHANGELOG, docs/, the demos and the docstrings:
make docs.
"""

from __future__ import annotations

import re
import sys
from dataclasses import is_dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import sphinx.util.typing as sphinx_typing
from docutils import nodes
from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from myst_parser.parsers.sphinx_ import MystParser
from sphinx.ext.autodoc.mock import _MockObject
from sphinx.util import logging

_ROOT = Path(__file__).resolve().parent.parent
_PACKAGE = (_ROOT / "signorini_fx" / "__init__.py").read_text(encoding="utf-8")
sys.path[:0] = [str(_ROOT), str(_ROOT / "docs")]

from percent import as_markdown  # noqa: E402  # in this folder
from quantities import markdown  # noqa: E402

project = "signorini_fx"
release = re.search(r'__version__ = "(.+)"', _PACKAGE)[1]
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.autosummary", "sphinx.ext.napoleon"]
templates_path = [str(_ROOT / "docs" / "templates")]
html_math_renderer = "mathml"  # no script and no network
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 4  # GitHub's anchors: the tests check links against these
root_doc = "docs/index"
include_patterns = ["*.md", "docs/*.md", "docs/api/*.rst", "demos/*.py", "demos/forms/*.py"]
exclude_patterns = ["demos/paper.py"]
html_theme = "furo"
html_static_path = ["static"]
html_css_files = ["narrow.css"]
html_title = f"{project} {release}"
html_show_copyright = False
html_copy_source = False
highlight_language = "none"
# Docstrings are read without FEniCSx, of which this machine needs none of the compiled parts.
autodoc_mock_imports = [
    "basix",
    "dolfinx",
    "ffcx",
    "gmsh",
    "h5py",
    "matplotlib",
    "meshio",
    "mpi4py",
    "petsc4py",
    "scipy",
    "ufl",
]
autodoc_mock_imports += ["signorini_fx.machine.compat"]  # it refuses other versions of dolfinx
# A type of them may be one of several.
_MockObject.__or__ = _MockObject.__ror__ = lambda mock, other: mock
autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented_params"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
napoleon_use_ivar = True
# Pygments does not know gmsh's language.
suppress_warnings = ["misc.highlighting_failure"]
nitpick_ignore_regex = [(r"py:.*", r".*")]  # names of other packages in docstrings


class DemoParser(MystParser):
    """Shows a demo as a page: its text, its code, the outputs of its notebook and its pictures from
    the gallery.
    """

    supported = ("percent",)

    def parse(self, inputstring: str, document: nodes.document) -> None:
        """Parse the Markdown that the script makes."""
        name = Path(document["source"]).stem
        gallery = _ROOT / "docs" / "images" / "gallery"
        shown = (
            (f"{name}_body.png", f"{name}.png")
            if Path(document["source"]).parent == _ROOT / "demos"
            else ()
        )
        drawn = [one for one in shown if (gallery / one).exists()]
        pictures = "".join(f"\n![Result](../docs/images/gallery/{one})\n" for one in drawn)
        shown = as_markdown(inputstring, Path(document["source"]).with_suffix(".ipynb"))
        super().parse(shown + pictures, document)


def _escape(
    _app: Any, _what: str, _name: str, _object: Any, _options: Any, lines: list[str]
) -> None:
    """|x| is an absolute value in docstrings, not a substitution, and what is indented below a
    sentence is code.
    """
    shown = list[str]()
    for k, line in enumerate(lines):
        above = lines[k - 2] if k >= 2 and not lines[k - 1] else ""
        shown += ["::", ""] if line.startswith("    ") and re.match(r"\S.*\.$", above) else []
        shown.append(line.replace("|", r"\|"))
    lines[:] = shown


def _parameters(_app: Any, _page: str, text: list[str]) -> None:
    """What comments of a page ask for: docstrings of mesh generators, and the table of
    quantities.
    """
    names = sorted(path.stem for path in (_ROOT / "meshes").glob("[a-z]*.py"))
    shown = "".join(
        f".. automodule:: signorini_fx.meshes.{name}\n   :members: generate\n" for name in names
    )
    comment = "<!-- the parameters of all generators -->"
    if comment in text[0]:
        links = re.sub(
            r"\[(\w+)\]\(\.\./meshes/\w+\.py\)", r"{py:mod}`\1 <signorini_fx.meshes.\1>`", text[0]
        )
        text[0] = links.replace(comment, f"```{{eval-rst}}\n{shown}```")
    text[0] = text[0].replace("<!-- the table of all quantities -->", markdown())


def _demos(_app: Any, page: str, text: list[str]) -> None:
    """All demos are pages below the gallery, not beside the guides."""
    if page == "docs/gallery":
        listed = "/demos/[!t]*\n/demos/forms/*\n/demos/torsion_of_a_pressed_cylinder"
        text[0] += f"\n```{{toctree}}\n:hidden:\n:glob:\n\n{listed}\n```\n"


def _files(_app: Any, _page: str, text: list[str]) -> None:
    """Scripts that are no pages are files to download, where a link would lead nowhere."""
    pages = {*(_ROOT / "demos").glob("*.py"), *(_ROOT / "demos" / "forms").glob("*.py")}
    folder = (_ROOT / _page).parent

    def link(found: re.Match[str]) -> str:
        file = (folder / found[1]).resolve()
        return found[0] if file in pages or not file.is_file() else f"](path:{found[1]})"

    text[0] = re.sub(r"\]\(([\w./]+\.py)\)", link, text[0])


def _broad(_app: Any, tree: nodes.document, page: str) -> None:
    """Plots whose letters a telephone would make too small are marked, see narrow.css; bodies have
    larger letters.

    The table of the gallery is marked, too.
    """
    if page == "docs/gallery":
        for table in tree.findall(nodes.table):
            table["classes"] += ["cards"]
        return
    for image in () if page in ("README", "docs/index") else tree.findall(nodes.image):
        file = _ROOT / image["uri"]
        if (
            file.suffix == ".png"
            and file.exists()
            and not file.stem.endswith(("_body", "foot", "setup"))
        ):
            width = int.from_bytes(file.read_bytes()[16:20], "big")
            image["classes"] += ["broad"] if width >= 900 else []


def _hints(of: Any, *args: Any, **options: Any) -> dict[str, Any]:
    """The types of the fields of a class.

    Those of a dataclass are as they are written, because some are imported for type checking only.
    """
    if not isinstance(of, type):  # a module, of which data are shown
        return _get_type_hints(of, *args, **options)
    written = {
        name: hint
        for one in reversed(of.__mro__)
        for name, hint in vars(one).get("__annotations__", {}).items()
    }
    known = written if is_dataclass(of) else _get_type_hints(of, *args, **options)
    values = {
        name: re.sub(r"\w*Value\b", "number or expression", str(hint))
        for name, hint in written.items()
        if "Value" in str(hint)
    }
    return known | values


def _readable(annotation: Any, *args: Any, **options: Any) -> str:
    """A type without the modules of the package, and without what numpy's types are made of."""
    text = re.sub(r"~?\bsignorini_fx\.(?:\w+\.)*", "", _stringify(annotation, *args, **options))
    text = re.sub(
        r"(?:~?numpy\.)?ndarray\[tuple\[[^\]]*\], (?:~?numpy\.)?dtype\[[^\]]*\]\]", "ndarray", text
    )
    text = re.sub(r"_Buffer \|.*?\bstr\]", "ArrayLike", text)
    return re.sub(r"npt\.NDArray\[[^\]]*\]|\b(?:Array|Floats|Nodal)\b", "ndarray", text)


def _inline(docstring: Any) -> tuple[str, list[str]]:
    """The docstring of a property, whose first colon does not end a type."""
    return "", docstring._dedent(docstring._consume_to_end())


_get_type_hints, _stringify = sphinx_typing.get_type_hints, sphinx_typing.stringify_annotation
sphinx_typing.get_type_hints, sphinx_typing.stringify_annotation = _hints, _readable
napoleon = import_module("sphinx.ext.napoleon.docstring")  # which takes both by name
napoleon.GoogleDocstring._consume_inline_attribute = _inline


def _formula(writer: Any, node: nodes.Element) -> None:
    """A formula as MathML, which browsers draw by themselves."""
    block = isinstance(node, nodes.math_block)
    try:
        formula = tex2mathml(node.astext(), as_block=block)
    except MathError as error:
        logging.getLogger(__name__).warning(
            "this formula cannot be shown: %s", error, location=node
        )
        raise nodes.SkipNode from None
    writer.body.append(
        f'<div class="math" style="overflow-x: auto; padding: 0.6em 0">{formula}</div>'
        if block
        else formula
    )
    raise nodes.SkipNode


def setup(app: Any) -> None:
    """Let Sphinx read the demos and the docstrings."""
    app.connect("autodoc-process-docstring", _escape)
    app.connect("source-read", _demos)
    app.connect("source-read", _parameters)
    app.connect("source-read", _files)
    app.connect("doctree-resolved", _broad)
    app.add_html_math_renderer("mathml", (_formula, None), (_formula, None))
    app.add_source_suffix(".py", "percent")
    app.add_source_parser(DemoParser)
