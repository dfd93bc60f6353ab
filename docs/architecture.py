"""Draw docs/images/architecture.svg: the packages of signorini_fx as layers, from its folders and imports.

    ./env python3 docs/architecture.py

A package is a layer, and the first sentence of its ``__init__`` says what it does.  Imports point down or stay within
a package and never form a cycle, imports for type checking included.  A test checks all of this, and that the picture
is up to date.
"""

from __future__ import annotations

import ast
import html
from functools import cache
from pathlib import Path

DOCS = Path(__file__).resolve().parent
PACKAGE = DOCS.parent / "signorini_fx"
PICTURE = DOCS / "images" / "architecture.svg"

# What only looks at a solved problem, or only makes a mesh.  The others import none of them: they are entry points.
ADD_ONS = (
    "addons.judging",
    "addons.derivatives",
    "addons.bounds",
    "addons.report",
    "addons.picture_data",
    "addons.pictures",
    "meshes",
    "addons.decks",
)
# From the top down.  A layer that is no package, or not only one, has modules beside it.
LAYERS = (
    *ADD_ONS,
    "scenes.cli",
    "scenes",
    "forms.nonlinear",
    "forms",
    "solving",
    "solving.check",
    "solving.iterated_interfaces",
    "results",
    "results.certificate",
    "quantities",
    "results.accuracy",
    "mechanics.body",
    "mechanics.loads",
    "mechanics.obstacles",
    "mechanics.rigid",
    "mechanics.contact_points",
    "mechanics.elasticity",
    "mechanics.assembly",
    "mechanics.pairs",
    "mechanics.shapes",
    "mechanics.mesh",
    "mechanics.interfaces",
    "mechanics.effects",
    "mechanics.materials",
    "mechanics.laws",
    "mechanics.statement",
    "algebra.algorithms",
    "algebra.problem",
    "algebra.linalg",
    "algebra.contact",
    "algebra",
    "mechanics.kinematics",
    "records",
    "machine",
    "ground",
)
# The packages that solve a contact problem given by matrices: they import nothing of those above them.
CORE = ("algebra.algorithms", "algebra.problem", "algebra.linalg", "algebra.contact")
BESIDE = {
    "scenes.cli": ("__main__",),
    "mechanics.body": ("mechanics.model",),
    "mechanics.assembly": ("mechanics.scales",),
    "records": ("records", "machine.display"),
    "ground": ("errors", "extensions", "removed", "tuned"),
}
SAYS = {
    "records": "Outcomes, what has happened in a solve, and words for it.",
    "ground": "The ways in which a request can fail, what other packages add, what was tuned, and what was removed.",
}
# Packages of others, as the picture names them.
OUTSIDE = (
    "dolfinx",
    "ufl",
    "basix",
    "petsc4py",
    "mpi4py",
    "gmsh",
    "meshio",
    "scipy",
    "matplotlib",
    "pyvista",
    "pydantic",
)


@cache
def files() -> dict[str, Path]:
    """The modules of the package by name, without the package itself."""
    found = {}
    # A glob does not follow the link to the generators.
    for path in sorted((*PACKAGE.rglob("*.py"), *(PACKAGE / "meshes").glob("*.py"))):
        parts = path.relative_to(PACKAGE).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        if name:
            found[name] = path
    return found


@cache
def packages() -> list[str]:
    """The layers that are folders, by their names with dots."""
    return [layer for layer in LAYERS if folder_of(layer).is_dir()]


def folder_of(layer: str) -> Path:
    """Where the modules of a layer are."""
    return PACKAGE.joinpath(*layer.split("."))


@cache
def layer_of(module: str) -> str:
    """The layer of a module: one that it lies beside, else the innermost package that is one.

    Raises:
        KeyError: it is in none.
    """
    beside = {name: layer for layer, modules in BESIDE.items() for name in modules}
    # A house of several layers alone, such as ``addons``, belongs to the uppermost of them.
    houses = {layer.partition(".")[0]: layer for layer in reversed(LAYERS)}
    parents = (module.rsplit(".", count)[0] for count in range(module.count(".") + 1))
    return beside.get(module) or next((name for name in parents if name in packages()), "") or houses[module]


@cache
def imports(path: Path) -> frozenset[str]:
    """Full names of all that a file imports, anywhere in it."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
    return frozenset(found)


def graph() -> dict[str, set[str]]:
    """Module -> modules of the package that it imports."""
    known = files()

    def module(name: str) -> str | None:
        """The module that a full name is, or is in."""
        name = name.removeprefix("signorini_fx.")
        return name if name in known else name.rpartition(".")[0] if name.rpartition(".")[0] in known else None

    own = {name: {n for n in imports(path) if n.startswith("signorini_fx.")} for name, path in known.items()}
    return {name: {m for n in names if (m := module(n)) is not None and m != name} for name, names in own.items()}


@cache
def modules_of(layer: str) -> list[str]:
    """The modules of a layer; a package itself only where it is more than its opening paragraph."""
    known = files()
    found = [name for name in known if layer_of(name) == layer]
    return [name for name in found if known[name].stem != "__init__" or _holds_code(known[name])]


def _holds_code(path: Path) -> bool:
    return len(ast.parse(path.read_text(encoding="utf-8")).body) > 1


def says(layer: str) -> str:
    """What a layer does, in one sentence."""
    if layer in SAYS:
        return SAYS[layer]
    text = ast.get_docstring(ast.parse((folder_of(layer) / "__init__.py").read_text(encoding="utf-8"))) or ""
    return text.split("\n\n")[0].replace("\n", " ").replace("``", "")


def outside(layer: str) -> list[str]:
    """The packages of others that a layer imports."""
    known = files()
    used = {name.partition(".")[0] for module in modules_of(layer) for name in imports(known[module])}
    return [name for name in OUTSIDE if name in used]


# --- the picture -----------------------------------------------------------------------------------------------------

_WIDTH, _MARGIN, _GAP = 900, 12, 8
_LETTER = 7.3  # width of a letter of a module's name
_CHIP, _HEAD = 24, 40


def _text(x: float, y: float, text: str, **style: str) -> str:
    given = "".join(f' {key.replace("_", "-")}="{value}"' for key, value in style.items())
    return f'<text x="{x:.0f}" y="{y:.0f}"{given}>{html.escape(text)}</text>'


def _box(layer: str, left: float, top: float, width: float) -> tuple[list[str], float]:
    """What is in the box of a layer, and its height."""
    name = f"{layer}/" if layer in packages() else layer
    parts = [
        _text(left + 12, top + 20, name, font_weight="700", font_size="15"),
        _text(left + 12, top + 36, says(layer), fill="#555", font_size="12"),
    ]
    x, y = left + 12, top + _HEAD + 6
    for module in modules_of(layer):
        short = module.removeprefix(f"{layer}.")
        wide = _LETTER * len(short) + 14
        if x + wide > left + width - 8:
            x, y = left + 12, y + _CHIP + 6
        chip = f'x="{x:.0f}" y="{y:.0f}" width="{wide:.0f}" height="{_CHIP}" rx="4" fill="#fff" stroke="#8aa4b8"'
        parts += [f"<rect {chip}/>", _text(x + 7, y + 16, short, font_family="monospace", font_size="12")]
        x += wide + 6
    others = ", ".join(outside(layer))
    if others:
        uses = f"uses {others}"
        parts.append(
            _text(
                left + width - 12,
                top + 20,
                uses,
                fill="#555",
                font_size="11.5",
                font_style="italic",
                text_anchor="end",
            )
        )
    return parts, y + _CHIP + 8 - top


def drawn() -> str:
    """The picture as SVG."""
    body: list[str] = []
    top = float(_MARGIN)
    width = _WIDTH - 2 * _MARGIN - 34
    for layer in LAYERS:
        parts, height = _box(layer, _MARGIN, top, width)
        box = f'x="{_MARGIN}" y="{top:.0f}" width="{width}" height="{height:.0f}" rx="6"'
        body += [f'<rect {box} fill="#eef3f7" stroke="#c3d0da"/>', *parts]
        top += height + _GAP
    x, low = _WIDTH - _MARGIN - 12, top - _GAP
    body += [
        f'<path d="M{x} {_MARGIN} V{low - 8:.0f}" stroke="#333" stroke-width="1.5" fill="none"/>',
        f'<path d="M{x - 5} {low - 9:.0f} h10 l-5 9 z" fill="#333"/>',
        f'<g transform="translate({x - 8} {low / 2:.0f}) rotate(-90)">'
        + _text(0, 0, "imports point down", text_anchor="middle", font_size="12")
        + "</g>",
    ]
    size = f'width="{_WIDTH}" height="{top:.0f}" viewBox="0 0 {_WIDTH} {top:.0f}"'
    style = 'font-family="Helvetica, Arial, sans-serif" fill="#1a1a1a"'
    head = f'<svg xmlns="http://www.w3.org/2000/svg" {size} {style} role="img">'
    title = "<title>Layers of signorini_fx and their modules</title>"
    ground = f'<rect width="{_WIDTH}" height="{top:.0f}" fill="#fff"/>'
    return "\n".join([head, title, ground, *body, "</svg>", ""])


if __name__ == "__main__":
    PICTURE.write_text(drawn(), encoding="utf-8")
    print(PICTURE)
