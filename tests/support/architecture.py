"""The layers of signorini_fx, from its folders and imports, for the tests.

A package is a layer.  Imports point down or stay within a package and never form a cycle, imports
for type checking included.
"""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[2] / "signorini_fx"

# What only looks at a solved problem, or only makes a mesh.  The others import none of them: they
# are entry points.
ADD_ONS = (
    "addons.judging",
    "addons.derivatives",
    "addons.bounds",
    "addons.report",
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
    "results",
    "results.certificate",
    "results.accuracy",
    "quantities",
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
    "mechanics.effects",
    "mechanics.materials",
    "mechanics.laws",
    "mechanics.statement",
    "algebra.algorithms",
    "algebra.regularised",
    "algebra.linalg",
    "algebra.contact",
    "algebra",
    "mechanics.kinematics",
    "records",
    "machine",
    "ground",
)
# The packages that solve a contact problem given by matrices: they import nothing of those above
# them.
CORE = ("algebra.algorithms", "algebra", "algebra.linalg", "algebra.contact")
BESIDE = {
    "algebra.regularised": ("algebra.regularised",),
    "mechanics.kinematics": ("mechanics.kinematics",),
    "scenes.cli": ("__main__",),
    "mechanics.body": ("mechanics.model", "mechanics.step_effect"),
    "mechanics.obstacles": ("mechanics.interfaces",),
    "mechanics.assembly": ("mechanics.scales",),
    "mechanics.contact_points": ("mechanics.state",),
    "records": ("records", "machine.display"),
    "ground": ("arrays", "errors", "extensions", "removed", "tuned"),
}


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
    return (
        beside.get(module)
        or next((name for name in parents if name in packages()), "")
        or houses[module]
    )


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
        return (
            name
            if name in known
            else name.rpartition(".")[0]
            if name.rpartition(".")[0] in known
            else None
        )

    own = {
        name: {n for n in imports(path) if n.startswith("signorini_fx.")}
        for name, path in known.items()
    }
    return {
        name: {m for n in names if (m := module(n)) is not None and m != name}
        for name, names in own.items()
    }
