"""Draw docs/images/architecture.svg: the layers of the package, from its imports.

    ./env python3 docs/architecture.py

Every module is in one layer; imports point down or stay within a layer, and never run in a circle.  A test holds all
of this, and that the picture is of today.
"""

from __future__ import annotations

import ast
import html
from dataclasses import dataclass
from functools import cache
from pathlib import Path

DOCS = Path(__file__).resolve().parent
PACKAGE = DOCS.parent / "signorini_fx"
PICTURE = DOCS / "images" / "architecture.svg"


@dataclass(frozen=True)
class Layer:
    """Modules with one responsibility.

    Attributes:
        name: of the layer.
        does: its responsibility.
        modules: names as in ``signorini_fx.NAME``; ``linalg`` alone is the protocol in its ``__init__``.
    """

    name: str
    does: str
    modules: tuple[str, ...]


# From the top down.  Two layers on one level know nothing of each other.
LEVELS: tuple[tuple[Layer, ...], ...] = (
    (Layer("Command line", "words in, exit code out", ("__main__", "cli")),),
    (
        Layer(
            "Before and after",
            "what a scene will do; files, pictures, reports, studies",
            (
                "template",
                "checks",
                "summary",
                "io",
                "result_folder",
                "plots",
                "pyvista_pictures",
                "report",
                "parameter_sweep",
                "work_precision",
                "reference",
            ),
        ),
    ),
    (
        Layer(
            "Solve",
            "the one entry point: scene in, solution out",
            (
                "solver",
                "findings",
                "strategy",
                "task",
                "nested",
                "boundary_levels",
                "exact",
                "price_list",
                "accuracy",
                "solution",
            ),
        ),
    ),
    (
        Layer(
            "Algorithms",
            "which regularised problem comes next",
            (
                "algorithms",
                "algorithms.ssn",
                "algorithms.alm",
                "algorithms.augmentation",
                "algorithms.fp",
                "algorithms.continuation",
                "algorithms.path_following",
                "algorithms.coulomb_newton",
                "algorithms.ladder",
                "algorithms.descent",
            ),
        ),
        Layer(
            "Linear algebra",
            "how its linear systems are solved",
            (
                "linalg.choice",
                "linalg.full",
                "linalg.condensed",
                "linalg.schur",
                "linalg.transformed",
                "linalg.rotated",
                "linalg.coarsened",
            ),
        ),
    ),
    (
        Layer(
            "The regularised problem",
            "active sets, residual and tangent; what is measured after",
            (
                "complementarity",
                "problem",
                "linalg",
                "contact_data",
                "contact_map",
                "holding",
                "resting",
                "quantities",
                "certificate",
                "nodal_forces",
                "contact_table",
                "estimators",
                "data_error",
                "pressure_error",
                "error_estimates",
            ),
        ),
    ),
    (
        Layer(
            "Discretisation",
            "forms of the effects that a scene names, assembled once",
            (
                "discretisation",
                "forms",
                "material",
                "loads",
                "supports",
                "boundary",
                "pieces",
                "rigid",
                "deformation",
                "assembly",
            ),
        ),
    ),
    (
        Layer(
            "Scene and mesh",
            "what is to be solved, validated",
            (
                "scene",
                "expressions",
                "mesh",
                "mesh_arrays",
                "mesh_halving",
                "mesh_formats",
                "gmsh_files",
                "_gmsh_process",
                "mesh_info",
                "abaqus",
                "refinement",
            ),
        ),
    ),
    (
        Layer(
            "Ground",
            "errors, outcomes, ranks, versions",
            (
                "errors",
                "magnitudes",
                "csv_text",
                "compilation",
                "requirements",
                "results",
                "parallel",
                "terminal",
                "launcher",
                "options",
                "petsc_start",
                "compat",
                "petsc_c",
            ),
        ),
    ),
)
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


def files() -> dict[str, Path]:
    """The modules of the package by name, without the package itself."""
    found = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        parts = path.relative_to(PACKAGE).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        if name and not name.startswith("meshes"):
            found[name] = path
    return found


@cache
def imports(path: Path) -> frozenset[str]:
    """Full names of all that a file imports, anywhere but for type checking."""
    found: set[str] = set()
    todo: list[ast.AST] = [ast.parse(path.read_text(encoding="utf-8"))]
    while todo:
        node = todo.pop()
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test):
            continue
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found |= {f"{node.module}.{alias.name}" for alias in node.names}
        todo += ast.iter_child_nodes(node)
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


def outside(layer: Layer) -> list[str]:
    """The packages of others that a layer imports."""
    known = files()
    used = {name.partition(".")[0] for module in layer.modules for name in imports(known[module])}
    return [name for name in OUTSIDE if name in used]


# --- the picture -----------------------------------------------------------------------------------------------------

_WIDTH, _MARGIN, _GAP = 900, 12, 10
_LETTER = 7.3  # width of a letter of a module's name
_CHIP, _HEAD = 24, 40


def _text(x: float, y: float, text: str, **style: str) -> str:
    given = "".join(f' {key.replace("_", "-")}="{value}"' for key, value in style.items())
    return f'<text x="{x:.0f}" y="{y:.0f}"{given}>{html.escape(text)}</text>'


def _layer(layer: Layer, left: float, top: float, width: float) -> tuple[list[str], float]:
    """What is in a box, and its height."""
    parts = [
        _text(left + 12, top + 20, layer.name, font_weight="700", font_size="15"),
        _text(left + 12, top + 36, layer.does, fill="#555", font_size="12"),
    ]
    x, y = left + 12, top + _HEAD + 6
    for module in layer.modules:
        wide = _LETTER * len(module) + 14
        if x + wide > left + width - 8:
            x, y = left + 12, y + _CHIP + 6
        chip = f'x="{x:.0f}" y="{y:.0f}" width="{wide:.0f}" height="{_CHIP}" rx="4" fill="#fff" stroke="#8aa4b8"'
        parts += [f"<rect {chip}/>", _text(x + 7, y + 16, module, font_family="monospace", font_size="12")]
        x += wide + 6
    others = ", ".join(outside(layer))
    if others:
        y += _CHIP + 6
        parts.append(_text(left + 12, y + 12, f"uses {others}", fill="#555", font_size="11.5", font_style="italic"))
        y -= 4
    height = y + _CHIP + 4 - top
    return parts, height


def drawn() -> str:
    """The picture as SVG."""
    body: list[str] = []
    top = float(_MARGIN)
    arrow = 34
    inner = _WIDTH - 2 * _MARGIN - arrow
    for level in LEVELS:
        width = (inner - _GAP * (len(level) - 1)) / len(level)
        boxes = [_layer(layer, _MARGIN + k * (width + _GAP), top, width) for k, layer in enumerate(level)]
        height = max(height for _, height in boxes)
        for k, (parts, _) in enumerate(boxes):
            box = (
                f'x="{_MARGIN + k * (width + _GAP):.0f}" y="{top:.0f}" width="{width:.0f}" height="{height:.0f}" rx="6"'
            )
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
