"""CPU time of a rigid tool that a force moves, over that of the same tool where the force brings it.

    ./env python3 bench/tools.py 2 330    # 440,000 unknowns in the plane
    ./env python3 bench/tools.py 3 29     # 300,000 in space

A block on the ground, and a circle or a ball without friction that may tilt about the axes along its surface.  Each
scene is solved twice; the second time counts, when forms are compiled and programs loaded.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

from signorini_fx import Solution, solve
from signorini_fx.scene.reading import parse_scene


def scene(dimension: int, cells: int, **tool: Any) -> Any:
    """A block with so many cells along its height; ``tool``: what drives it."""
    names = "xyz"[:dimension]
    if dimension == 2:
        mesh = {"generator": "rectangle", "parameters": {"length": 1.0, "height": 0.5, "nx": 2 * cells, "ny": cells}}
        shape = {"shape": "circle", "centre": [0.45, 2.5], "pivot": [0.45, 0.5]}
    else:
        sizes = {"length": 1.0, "height": 0.5, "width": 1.0, "nx": 2 * cells, "ny": 2 * cells, "nz": cells}
        mesh = {"generator": "box", "parameters": sizes}
        shape = {"shape": "sphere", "centre": [0.45, 0.5, 2.5], "pivot": [0.45, 0.5, 0.5]}
    return parse_scene(
        {
            "mesh": mesh,
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": {"boundary": "bottom", **dict.fromkeys(names, 0.0)},
            "contact": {"boundary": "top", "foundation": {**shape, "radius": 2.0, **tool}},
            "solver": {"levels": 2},
        }
    )


def timed(given: Any) -> tuple[Solution, float]:
    """The second solution and its CPU seconds."""
    solve(given)
    begin = time.process_time()
    return solve(given), time.process_time() - begin


def main() -> None:
    """Print both times and their ratio."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("dimension", type=int, choices=(2, 3))
    parser.add_argument("cells", type=int, help="along the height")
    chosen = parser.parse_args()
    plane = chosen.dimension == 2
    still = {"x": 0.0} if plane else {"x": 0.0, "y": 0.0, "rotation_z": 0.0}
    force = [0.0, -20.0] if plane else [0.0, 0.0, -20.0]
    forced, seconds = timed(scene(chosen.dimension, chosen.cells, force=force, prescribed=still))
    (tool,) = forced.last_step.tools
    turned = {"rotation": tool.rotation[0]} if plane else dict(zip("xyz", tool.rotation, strict=True))
    moved = {**dict(zip("xyz", tool.translation.tolist(), strict=False))}
    moved |= {name if plane else f"rotation_{name}": float(value) for name, value in turned.items()}
    driven, other = timed(scene(chosen.dimension, chosen.cells, prescribed=moved))
    shifted = scene(chosen.dimension, chosen.cells, shift=tool.translation.tolist())
    _, fixed = timed(shifted)
    print(f"{forced.discretisation.dofs} unknowns, {forced.linear_algebra.partition(':')[0]}")
    for name, solution, spent in (("force", forced, seconds), ("prescribed motion", driven, other)):
        print(f"{name}: {spent:.2f} s, {solution.history.linear_solves} linear solves")
    print(f"force over prescribed motion {seconds / other:.2f}, over a shifted foundation {seconds / fixed:.2f}")


if __name__ == "__main__":
    main()
