"""What a certified accuracy costs beside an estimated one, in processor seconds of whole solves.

    ./env python3 demos/studies/certified.py [--accuracy 0.01 0.001] [block hertz two_blocks ...]

Prints the rows of docs/evidence/certified_accuracy.csv.  A first solve, which compiles, is not counted.  Of two bodies
it is the contact force, too: the guaranteed interval of the force is found on meshes on which half the bound of the
energy is certified each time, until half its width is the accuracy; all of this counts.
"""

from __future__ import annotations

import argparse
import time
from math import inf

from mpi4py import MPI

from signorini_fx.errors import SignoriniError
from signorini_fx.mechanics.statement.settings import Accuracy
from signorini_fx.results.solution import ConvergenceError
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.scene import Scene
from signorini_fx.scenes.solver import solve

# A run that takes longer ends by name.
BUDGET = 120.0
YOUNG = {"upper": 1000.0, "lower": 500.0}
PUSHED = "upper.bottom"


def on_a_rectangle(length: float, height: float, nx: int, ny: int, young: float, **more: object) -> Scene:
    """A block of triangles on rollers at its left side."""
    mesh = {
        "generator": "rectangle",
        "parameters": {"length": length, "height": height, "nx": nx, "ny": ny, "cell": "triangle"},
    }
    material, held = {"young": young, "poisson": 0.3}, {"boundary": "left", "x": 0.0}
    return parse_scene({"mesh": mesh, "material": material, "displacement": held, **more})


def two_blocks(**friction: object) -> Scene:
    """One block is pushed onto another, softer one, from which it is apart by a parabola."""

    def body(name: str, nx: int, ny: int, y: float) -> dict[str, object]:
        parameters = {"length": 2.0, "height": 1.0, "nx": nx, "ny": ny, "cell": "triangle"}
        return {"name": name, "shift": [0.0, y], "mesh": {"generator": "rectangle", "parameters": parameters}}

    contact = {"boundary": PUSHED, "against": "lower.top", "gap": "0.02*x[0]**2", **friction}
    held = {"upper.left": {"x": 0.0}, "lower.left": {"x": 0.0}, "upper.top": {"y": -0.02}, "lower.bottom": {"y": 0.0}}
    return parse_scene(
        {
            "body": [body("upper", 12, 6, 1.0), body("lower", 10, 5, 0.0)],
            "material": [{"region": name, "young": young, "poisson": 0.3} for name, young in YOUNG.items()],
            "displacement": [{"boundary": boundary, **values} for boundary, values in held.items()],
            "contact": contact,
            "element": {"degree": 2},
        }
    )


def scenes() -> dict[str, Scene]:
    """Block on a table, Hertz, a plate that a pressure bends onto its foundation, two bodies."""
    jump = {"boundary": "top", "y": "where(x[0] < 1.0, -1.0, -0.1)"}
    table = {"boundary": "bottom", "friction": {"law": "tresca", "bound": 0.05}}
    down, round_ = {"boundary": "top", "y": -0.2}, {"boundary": "bottom", "gap": "x[0]**2/16"}
    bent, below = {"boundary": "top", "y": -1e-3}, {"boundary": "bottom", "gap": 0.02}
    plate = on_a_rectangle(4.0, 0.4, 40, 4, 200.0, traction=bent, contact=below)
    clamped = plate.displacement[0].model_copy(update={"y": 0.0})
    return {
        "block": on_a_rectangle(2.0, 1.0, 16, 8, 1000.0, traction=jump, contact=table),
        "hertz": on_a_rectangle(10.0, 5.0, 40, 20, 200.0, traction=down, contact=round_),
        "plate": plate.model_copy(update={"displacement": (clamped,)}),
        "two_blocks": two_blocks(),
        "two_blocks_tresca": two_blocks(friction={"law": "tresca", "bound": 0.5}),
    }


def measured(scene: Scene, target: float, *, certified: bool) -> tuple[float, str]:
    """Processor seconds, and a description of the run."""
    asked = scene.model_copy(update={"accuracy": Accuracy(target=target, certified=certified, seconds=BUDGET)})
    begin, ended = time.process_time(), ""
    try:
        solution = solve(asked, MPI.COMM_SELF)
    except ConvergenceError as failed:
        solution, ended = failed.solution, f" ({failed.solution.status.value})"
    seconds = time.process_time() - begin
    bound = solution.error_bound
    shown = "none" if bound is None or isinstance(bound, str) else f"{100 * bound.relative:.2g} %"
    return seconds, f"{solution.levels[-1].dofs:,}, {seconds:.2f}, {shown}{ended}"


def force(scene: Scene, target: float, *, certified: bool) -> tuple[float, str]:
    """The same for the contact force of two bodies, whose guaranteed interval takes the place of the bound."""
    begin, energy, share = time.process_time(), 2 * target, inf
    while share > target:
        goal = Accuracy(target=energy, certified=True) if certified else Accuracy(target=target, of="force")
        solution = solve(scene.model_copy(update={"accuracy": goal}), MPI.COMM_SELF)
        seconds = time.process_time() - begin
        interval = solution.force_bounds(PUSHED, (0.0, 1.0))
        if isinstance(interval, str):
            raise SignoriniError(interval)
        low, high = interval
        share, energy = (high - low) / (high + low), energy / 2
        if not certified:
            break
        seconds = time.process_time() - begin
    return seconds, f"{solution.levels[-1].dofs:,}, {seconds:.2f}, {100 * share:.2g} %"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", choices=[*scenes(), []], help="scenes; all of them if none is given")
    parser.add_argument("--accuracy", nargs="*", type=float, default=[0.01, 0.001])
    given = parser.parse_args()
    print("| scene | asked | estimated: unknowns, s, bound | certified: unknowns, s, bound | ratio |")
    print("|---|---|---|---|---|")
    for name, scene in scenes().items():
        if given.names and name not in given.names:
            continue
        try:
            measured(scene, 0.05, certified=True)
            for target in given.accuracy:
                (before, one), (after, two) = (measured(scene, target, certified=kind) for kind in (False, True))
                print(f"| {name} | {100 * target:g} % | {one} | {two} | {after / before:.1f} |", flush=True)
                if scene.body:
                    (before, one), (after, two) = (force(scene, target, certified=kind) for kind in (False, True))
                    row = f"{name}, contact force | {100 * target:g} % | {one} | {two} | {after / before:.1f}"
                    print(f"| {row} |", flush=True)
        except SignoriniError as failed:
            print(f"| {name} | {str(failed).splitlines()[0]} | | | |", flush=True)


if __name__ == "__main__":
    main()
