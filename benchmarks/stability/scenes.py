"""Scenes that several groups start from, as the dictionaries that a TOML file would give."""

from __future__ import annotations

from typing import Any

LAWS: dict[str, dict[str, Any]] = {
    "frictionless": {"law": "none"},
    "Tresca": {"law": "tresca", "bound": 1.5},
    "Coulomb": {"law": "coulomb", "coefficient": 0.3},
}


def example1(
    law: str | dict[str, Any] = "Tresca",
    *,
    nx: int = 60,
    ny: int = 20,
    length: float = 1.0,
    stress: float = 1.0,
    poisson: float = 0.4,
    mesh: dict[str, Any] | None = None,
    element: dict[str, Any] | None = None,
    load: float = 1.0,
    **settings: Any,
) -> dict[str, Any]:
    """Example 1 of section 7.1 in units of which the paper's are ``length`` and ``stress``, gamma chosen by itself."""
    friction = dict(LAWS[law] if isinstance(law, str) else law)
    if isinstance(friction.get("bound"), float):
        friction["bound"] *= stress
    mesh = mesh or {"generator": "rectangle"}
    return {
        "mesh": mesh
        | {"parameters": {"length": 3 * length, "height": length, "nx": nx, "ny": ny} | mesh.get("parameters", {})},
        "element": element or {},
        "material": {"young": 5000.0 * stress, "poisson": poisson},
        "displacement": [{"boundary": "left", "x": 0.0}, {"boundary": "right", "x": 0.0}],
        "traction": {"boundary": "top", "y": f"{-20 * stress * load!r} if 1 <= x[0] / {length!r} <= 2 else 0"},
        "contact": {
            "boundary": "bottom",
            "gap": f"{length!r} * (0.003 * (x[0] / {length!r} - 1.5)**2 + 0.001)",
            "friction": friction,
        },
        "solver": settings,
    }
