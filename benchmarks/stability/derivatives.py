"""Derivatives of random scenes with several load steps, against central differences of solves.

    ./env python3 -m benchmarks.stability.derivatives 0 40

A derivative is compared where every point keeps its set, in every load step, between the two solves of the difference.
These end Newton's method at a hundredth of the usual residual: where directions of slip turn, in 3D, the usual one
leaves errors of 1e-10 of the forces, or none, as one more step is taken or not, and a difference divides them by 1e-5.
"""

from __future__ import annotations

import sys
from collections import Counter
from typing import Any

import numpy as np
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx import sensitivity
from signorini_fx.addons.derivatives.entries import default_entries, varied
from signorini_fx.addons.derivatives.of_scene import Sensitivity
from signorini_fx.errors import SceneError
from signorini_fx.results.solution import ConvergenceError
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.scene import Scene

COMM = MPI.COMM_WORLD
# Relative error allowed, and data of each scene.
_AGREE, _DATA = 1e-5, 3
# Changes of a datum for a difference, relative to it, or to the unit of one that is an expression or zero.
_STEPS = (1e-5, 1e-6)
# Solves repeat to this share of the largest force, if Newton's method ends at this residual.
_REPEAT, _RESIDUAL = 3e-12, 1e-10


def judged(seed: int) -> tuple[str, float]:
    """How a scene ends, and its largest error relative to what is allowed."""
    given, of, more = scene(seed)
    PETSc.Options()["sfx_snes_rtol"] = _RESIDUAL
    try:
        parsed = parse_scene(given)
        names = [*dict.fromkeys([*default_entries(parsed.statement), *more])]
        by = np.random.default_rng([seed, 1]).permutation(names)[:_DATA].tolist()
        found = sensitivity(parsed, of, by, COMM)
    except SceneError as error:
        return f"refused: {error.problems[0][0]}", 0.0
    except ConvergenceError as error:
        return f"no solution: {error.solution.status.value}", 0.0
    assert isinstance(found, list)
    if any(one.between for one in found):
        return "between two sets", 0.0
    errors = [_error(parsed, of, path, k, found) for k, path in enumerate(by)]
    known = [error for error in errors if error is not None]
    if not known:
        return "a point changes its set within every difference", 0.0
    worst = max(known)
    return ("agrees" if worst <= 1.0 else "wrong"), worst


def _error(scene: Scene, of: list[str], path: str, k: int, found: list[Sensitivity]) -> float | None:
    """The largest error of the derivatives by one datum; None: sets change within the difference."""
    datum, slopes = found[0].data[k], np.array([one.derivatives[k] for one in found])
    unit = abs(datum) if np.isfinite(datum) and datum != 0.0 else 1e-2 if "displacement" in path else 1.0
    if "gap" in path or "foundation" in path:
        unit = 0.1
    errors, dimension = [], 2 if scene.mesh.generator == "rectangle" else 3
    for share in _STEPS:
        step, values = share * unit, []
        try:
            for sign in (1, -1):
                changed = scene.model_copy(update=varied(scene.statement, path, sign * step, dimension))
                solved = sensitivity(changed, of, [], COMM)
                assert isinstance(solved, list)
                if not _same_sets(solved[0], found[0]):
                    break
                values.append([one.value for one in solved])
        except ConvergenceError:
            continue
        if len(values) == 2:
            high, low = np.array(values)
            wanted, size = (high - low) / (2 * step), np.abs(np.array(values)).max(axis=0)
            least = 1e-7 * size / unit + _REPEAT * size.max() / step
            errors.append(float((np.abs(slopes - wanted) / (_AGREE * np.abs(wanted) + least)).max()))
            if errors[-1] <= 1.0:
                break
    return min(errors) if errors else None


def _same_sets(one: Sensitivity, other: Sensitivity) -> bool:
    pairs = zip(one.solution.steps, other.solution.steps, strict=False)
    same = len(one.solution.steps) == len(other.solution.steps)
    for here, there in pairs:
        assert here.contact is not None
        assert there.contact is not None
        same &= np.array_equal(here.contact.in_contact, there.contact.in_contact)
        slips = (np.any(state.direction != 0, axis=1) for state in (here.contact, there.contact))
        same &= np.array_equal(*slips)
    return bool(COMM.allreduce(same, op=MPI.LAND))


def scene(seed: int) -> tuple[dict[str, Any], list[str], list[str]]:
    """The scene of a seed, the results that are differentiated, and data besides the usual ones."""
    random = np.random.default_rng(seed)

    def one_of(*choices: Any) -> Any:
        return choices[random.integers(len(choices))]

    dimension, steps = int(one_of(2, 2, 3)), int(one_of(1, 2, 3, 4, 5))
    algorithm = one_of("ssn", "ssn", "alm", "alm")
    law, law_data = _law(random, one_of, dimension, steps)
    contact, more = _foundation(random, dimension, steps, simple="ratio" in law)
    contact |= {"boundary": "bottom", "friction": law}
    down = -float(random.uniform(5, 20))
    axis, along = ("y", ["x"]) if dimension == 2 else ("z", ["x", "y"])
    pressing = {"boundary": "top", axis: down, "factors": random.uniform(0.4, 1.2, steps).round(3).tolist()}
    pushing: dict[str, Any] = {"boundary": "top", "factors": random.uniform(-1.5, 1.5, steps).round(3).tolist()}
    pushing |= {name: float(random.uniform(1, 5)) for name in along}
    held: list[dict[str, Any]] = [{"boundary": "left", "x": 0.0}]
    moving = isinstance(contact.get("foundation"), dict) and steps > 1 and "shift" in contact["foundation"]
    if moving or random.random() < 0.5:
        held[0] |= {axis: 0.0, **({"y": 0.0} if dimension == 3 else {})}
    elif dimension == 3:
        held[0] |= {"y": 0.0}
    if random.random() < 0.3:
        held.append({"boundary": "right", "x": f"{random.uniform(-1e-3, 1e-3):.3g}*t"})
        more.append("displacement[1].x")
    parameters = {"nx": 8, "ny": 2} if dimension == 2 else {"nx": 4, "ny": 2, "nz": 1}
    cell, degree = one_of(False, True), int(one_of(1, 1, 2))
    generator = "rectangle" if dimension == 2 else "box"
    names = ("triangle", "quadrilateral") if dimension == 2 else ("tetrahedron", "hexahedron")
    linear = one_of("auto", "full", "krylov") if COMM.size > 1 else one_of("auto", "full", "condensed", "krylov")
    settings = {"algorithm": algorithm, "linear_algebra": linear, "tolerance": 1e-10}
    given = {
        "mesh": {"generator": generator, "parameters": {**parameters, "cell": names[cell]}},
        "element": {"degree": degree},
        "material": {"young": 5000.0, "poisson": float(one_of(0.0, 0.2, 0.33, 0.4))},
        "displacement": held,
        "traction": [pressing, pushing],
        "contact": contact,
        "load_steps": {"times": [1.0 + step for step in range(steps)]},
        "solver": {**settings, "gamma_n": 1e7, "gamma_t": 1e7},
    }
    if steps > 1 and random.random() < 0.15:
        given["load_steps"]["steps"] = 2
    last = f" step {random.integers(1, steps + 1)}"
    point = "1.7,0.6" if dimension == 2 else "1.7,0.6,0.4"
    moment = "moment bottom" if dimension == 2 else "moment bottom y"
    of = ["force bottom x", f"force bottom {axis}{last}", moment, "pressure bottom 6", f"mean top x{last}"]
    return given, [*of, f"displacement {point} {axis}"], [*law_data, *more, "traction[1].x"]


def _law(random: np.random.Generator, one_of: Any, dimension: int, steps: int) -> tuple[dict[str, Any], list[str]]:
    coefficient = float(random.uniform(0.05, 0.6))
    laws: list[tuple[dict[str, Any], list[str]]] = [
        ({"law": "none"}, []),
        ({"law": "tresca", "bound": float(random.uniform(0.3, 4))}, []),
        ({"law": "coulomb", "coefficient": coefficient}, []),
        ({"law": "coulomb", "coefficient": coefficient}, []),
        ({"law": "coulomb", "coefficient": coefficient, "cap": float(random.uniform(1, 5))}, ["contact.friction.cap"]),
        ({"law": "coulomb", "coefficient": f"{coefficient:.3g}*(1 + 0.1*t)"}, []),
    ]
    if dimension == 3:
        directed = {"law": "coulomb", "coefficient": coefficient, "ratio": 0.6, "along": [1.0, 0.0, 0.0]}
        laws.append((directed, []))
    return one_of(*laws)


def _foundation(
    random: np.random.Generator, dimension: int, steps: int, *, simple: bool
) -> tuple[dict[str, Any], list[str]]:
    middle = [float(random.uniform(1.2, 1.8)), float(random.uniform(0.3, 0.7))][: dimension - 1]
    squares = " + ".join(f"(x[{k}]-{place:.3g})**2" for k, place in enumerate(middle))
    below = {"centre": [*middle, -100.0], "radius": 100.0}
    shape: dict[str, Any] = {"shape": "circle" if dimension == 2 else "sphere", **below}
    still = {"gap": 0.0, "foundation": shape}
    where = "contact.foundation"
    kind = random.integers(4)
    if kind == 0 or simple:
        return {"gap": f"0.003*({squares})"}, []
    if kind == 1 or steps == 1:
        return still, [f"{where}.radius", f"{where}.centre[0]", f"{where}.shift[{dimension - 1}]"]
    speed = random.uniform(-3e-4, 3e-4, dimension)
    shift = [f"{value:.3g}*t" for value in speed]
    rotation: Any = "1e-5*t*t" if dimension == 2 else [0.0, "1e-5*t*t", "0.002*t"]
    shape |= {"shift": shift, **({"rotation": rotation} if kind == 3 else {})}
    return {"gap": 0.0, "foundation": shape}, [f"{where}.shift[0]", f"{where}.radius"]


def main(first: int, last: int) -> int:
    """Print how the scenes of some seeds end; the exit code is 1 if a derivative is wrong."""
    ends: Counter[str] = Counter()
    for seed in range(first, last):
        end, error = judged(seed)
        ends[end] += 1
        if COMM.rank == 0:
            print(f"{seed}: {end}, {error:.3g} of what is allowed", flush=True)
    if COMM.rank == 0:
        print(", ".join(f"{name}: {count}" for name, count in ends.most_common()))
    return int("wrong" in ends)


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]), int(sys.argv[2])))
