"""CPU time of a rigid tool that a force moves, over that of the same tool where the force brings it.

    ./env python3 benchmarks/costs/tools.py 2 385                      # 600,000 unknowns in 2D
    ./env python3 benchmarks/costs/tools.py 3 29                       # 300,000 in 3D
    ./env python3 benchmarks/costs/tools.py 3 29 --facets 100000   # a tool from a STEP file, over the same by formula

A block on the ground, and a circle or a ball without friction that may tilt about the axes along its surface.  Each
scene is solved twice; the second time counts, when forms are compiled and programs loaded.  A drawing is read again
each time, in a process of its own that counts too.
"""

from __future__ import annotations

import argparse
import math
import resource
import tempfile
from pathlib import Path
from typing import Any

from signorini_fx import Solution, solve
from signorini_fx.mechanics.mesh.files.formats import read_file
from signorini_fx.mechanics.mesh.files.gmsh_session import gmsh_session
from signorini_fx.scenes.reading import parse_scene

RADIUS = 2.0


def scene(dimension: int, cells: int, **tool: Any) -> Any:
    """A block with so many cells along its height; ``tool``: what drives it, or another shape."""
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
            "contact": {
                "boundary": "top",
                "foundation": {**shape, "radius": RADIUS, **tool} if "file" not in tool else tool,
            },
            "solver": {"levels": 2},
        }
    )


def timed(given: Any) -> tuple[Solution, float]:
    """The second solution and its CPU seconds, those of processes that it starts included."""
    solve(given)
    begin = seconds()
    return solve(given), seconds() - begin


def seconds() -> float:
    """CPU seconds until now."""
    both = (resource.getrusage(which) for which in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(one.ru_utime + one.ru_stime for one in both)


def drawing(file: Path, dimension: int) -> None:
    """Draw the circle or the ball, about the origin."""
    with gmsh_session() as gmsh:
        if dimension == 2:
            gmsh.model.occ.addDisk(0, 0, 0, RADIUS, RADIUS)
        else:
            gmsh.model.occ.addSphere(0, 0, 0, RADIUS)
        gmsh.model.occ.synchronize()
        gmsh.write(str(file))


def from_a_drawing(dimension: int, cells: int, facets: int) -> None:
    """Print what a tool of so many facets takes over the same by formula."""
    from signorini_fx.mechanics.shapes.surface import surface_of

    # Of a triangle with this side the area is 0.43 times its square.
    size = 2 * math.pi * RADIUS / facets if dimension == 2 else RADIUS * math.sqrt(4 * math.pi / 0.43 / facets)
    at = [0.45, 2.49] if dimension == 2 else [0.45, 0.5, 2.49]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "tool.step"
        drawing(file, dimension)
        drawn = scene(dimension, cells, shape="surface", file=file, size=size, shift=at)
        by_formula = scene(dimension, cells, centre=at)
        rounds = []
        for _ in range(3):
            exact, without = timed(by_formula)
            surface_of.cache_clear()
            begin = seconds()
            solution = solve(drawn)
            rounds.append((seconds() - begin, without))
        begin = seconds()
        count = len(read_file(file, degree=1, size=size).facets)
        reading = seconds() - begin
    force, other = (one.contact.forces[0][-1] for one in (solution, exact))
    print(f"{solution.model.dofs} unknowns, {count} facets, force {force:.6g} for {other:.6g}")
    print(f"reading the file {reading:.2f} s")
    for with_it, without in rounds:
        print(f"drawing {with_it:.2f} s, formula {without:.2f} s: {100 * (with_it / without - 1):+.1f} %")


def main() -> None:
    """Print both times and their ratio."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("dimension", type=int, choices=(2, 3))
    parser.add_argument("cells", type=int, help="along the height")
    parser.add_argument("--facets", type=int, help="of a tool from a STEP file")
    chosen = parser.parse_args()
    if chosen.facets:
        from_a_drawing(chosen.dimension, chosen.cells, chosen.facets)
        return
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
    print(f"{forced.model.dofs} unknowns, {forced.linear_algebra.partition(':')[0]}")
    for name, solution, spent in (("force", forced, seconds), ("prescribed motion", driven, other)):
        print(f"{name}: {spent:.2f} s, {solution.history.linear_solves} linear solves")
    print(f"force over prescribed motion {seconds / other:.2f}, over a shifted foundation {seconds / fixed:.2f}")


if __name__ == "__main__":
    main()
