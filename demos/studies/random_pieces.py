"""Random scenes of several bodies with unequal loads, asked for bounds and means, and judged.

    ./env python3 demos/studies/random_pieces.py --first 0 --count 100

Bodies are clamped, on rollers or in a corner, loads differ by factors of up to 1e8, and jump or have a kink anywhere.
Judges are exact statics and the same scene on a mesh four times finer.  Prints every exception and every
refuted statement; exit code 1 if there is any.
"""

from __future__ import annotations

import argparse
import traceback
from collections import Counter
from collections.abc import Iterator
from typing import Any

import numpy as np
from mpi4py import MPI
from matplotlib.tri import Triangulation

from signorini_fx.addons.bounds.error_bound import Bounded
from signorini_fx.quantities.proved_statements import ErrorBound
from signorini_fx.results.solution import ConvergenceError, Solution
from signorini_fx.results.summary import summarise
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

# How much finer the mesh of the reference is, and the share of a force or a width that is round-off.
FINER, ROUND_OFF = 4, 1e-12


class Body:
    """One body with its loads and what statics says of its forces.

    Args:
        number: of the body, from 0, which gives its name and its place.
        chance: source of the data.
    """

    def __init__(self, number: int, chance: np.random.Generator) -> None:
        self.name, self.x0 = "abc"[number], 3.0 * number
        self.length, self.height = float(chance.uniform(0.5, 2)), float(chance.uniform(0.3, 1))
        self.cells = int(chance.integers(2, 8)), int(chance.integers(2, 4))
        self.kind = str(chance.choice(["clamped", "rollers", "corner"]))
        self.size = float(10.0 ** -chance.integers(0, 9))
        self.young = float(10 ** chance.uniform(2, 5))
        self.poisson = float(chance.choice([0.0, 0.3, 0.45]))
        law = str(chance.choice(["none", "none", "tresca", "coulomb"]))
        self.friction: dict[str, Any] = {"law": law}
        if law == "tresca":
            self.friction["bound"] = 0.3 * self.size
        if law == "coulomb":
            self.friction["coefficient"] = float(chance.choice([0.1, 0.3]))
        self.gap = str(chance.choice(["0", f"1e-4 * {self.size} * (x[0] - {self.x0}) ** 2"]))
        where = self.x0 + float(chance.uniform(0.1, 0.9)) * self.length
        first, last = where - self.x0, self.x0 + self.length - where
        # Along the top: an expression for a force of size one downwards, and its exact integral.
        self.shape, self.downwards = [
            ("1", self.length),
            (f"where(x[0] < {where!r}, 1, 0)", first),
            (f"(2 if x[0] > {where!r} else 0.5)", 0.5 * first + 2 * last),
            (f"abs(x[0] - {where!r})", (first**2 + last**2) / 2),
            (f"abs(x[0] - {where!r}) ** 0.5", (first**1.5 + last**1.5) / 1.5),
            (f"(1 + x[0] - {self.x0!r})", self.length + self.length**2 / 2),
        ][int(chance.integers(6))]
        self.aside = 0.3 * self.size if self.kind == "corner" else 0.0

    @property
    def contacts(self) -> list[str]:
        """Its contact boundaries."""
        sides = {"clamped": ["bottom"], "rollers": ["bottom"], "corner": ["bottom", "right"]}[self.kind]
        return [f"{self.name}.{side}" for side in sides]

    def entries(self) -> dict[str, list[dict[str, Any]]]:
        """Its entries of a scene, but for its mesh."""
        held = {"clamped": [{"x": 0.0, "y": 0.0}], "rollers": [{"x": 0.0}], "corner": []}[self.kind]
        loads = [{"boundary": f"{self.name}.top", "y": f"-{self.size!r} * ({self.shape})"}]
        if self.aside:
            loads.append({"boundary": f"{self.name}.left", "x": self.aside})
        return {
            "material": [{"region": self.name, "young": self.young, "poisson": self.poisson}],
            "displacement": [{"boundary": f"{self.name}.left", **one} for one in held],
            "traction": loads,
            "contact": [
                {"boundary": one, "gap": self.gap if one.endswith("bottom") else "0", "friction": self.friction}
                for one in self.contacts
            ],
        }

    def mesh(self, finer: int) -> dict[str, Any]:
        """Its mesh."""
        nx, ny = (finer * count for count in self.cells)
        sizes = {"length": self.length, "height": self.height, "nx": nx, "ny": ny, "cell": "triangle"}
        return {"generator": "rectangle", "parameters": sizes}

    def forces(self) -> Iterator[tuple[str, tuple[float, float], float]]:
        """Boundary, direction and exact force on the body where statics determines it; without friction aside."""
        down = self.size * self.downwards
        if self.kind == "rollers":
            yield self.contacts[0], (0.0, 1.0), down
        if self.kind == "corner" and self.friction["law"] == "none":
            yield self.contacts[0], (0.0, 1.0), down
            yield self.contacts[1], (1.0, 0.0), -self.aside * self.height


def scene_of(bodies: list[Body], *, finer: int = 1, degree: int = 1) -> Any:
    """The scene of the bodies."""
    data: dict[str, Any] = {
        "body": [{"name": one.name, "mesh": one.mesh(finer), "shift": [one.x0, 0.0]} for one in bodies],
        "element": {"degree": degree},
        "solver": {"error_bound": True},
    }
    for one in bodies:
        for key, entries in one.entries().items():
            data.setdefault(key, []).extend(entries)
    return parse_scene({key: value for key, value in data.items() if value})


def differences(coarse: Solution, fine: Solution) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Squares of the energy norm of the difference by piece, and for both meshes the piece of each triangle."""
    first, second = (Bounded(one.model, one.displacement, one.contact, 0.0) for one in (coarse, fine))
    t, c = second.t, first.t
    strains = t.strain_at_corners(second.y, second.middle)
    local = (np.ones((3, 3)) + 3 * np.eye(3)) / 6  # three points inside, exact for linear strains
    x = np.einsum("qc,ncd->nqd", local, t.x[t.corners])
    where = Triangulation(*c.x.T, c.corners).get_trifinder()(x[..., 0], x[..., 1])
    assert (where >= 0).all()
    rest = np.einsum("nqij,nqj->nqi", np.linalg.inv(c.jacobian)[where], x - c.x[c.corners[where, 0]])
    barycentric = np.concatenate((1 - rest.sum(axis=2, keepdims=True), rest), axis=2)
    there = np.einsum("nqc,nqck->nqk", barycentric, c.strain_at_corners(first.y, first.middle)[where])
    gap = np.einsum("qc,nck->nqk", local, strains) - there
    squares = (t.area[:, None] / 3 * (t.stress(gap) * gap * [1, 1, 2]).sum(axis=2)).sum(axis=1)
    return np.bincount(c.piece[where[:, 0]], squares), c.piece, first.owner


def judge(seed: int) -> tuple[list[str], Counter[str]]:
    """What is refuted in a random scene, and how many statements of each kind there were."""
    chance = np.random.default_rng([41, seed])
    bodies = [Body(number, chance) for number in range(int(chance.integers(2, 4)))]
    wrong, made = list[str](), Counter[str]()
    try:
        solution = solve(scene_of(bodies), MPI.COMM_SELF)
    except ConvergenceError as failed:
        return wrong, Counter({f"no solution: {failed.solution.status.value}": 1})
    summary = summarise(solution)
    for one in bodies:
        for boundary, direction, exact in one.forces():
            bounds = solution.force_bounds(boundary, direction)
            made["force, " + ("refused" if isinstance(bounds, str) else "bounded")] += 1
            if not isinstance(bounds, str):
                room = ROUND_OFF * abs(exact)
                if not bounds[0] - room <= exact <= bounds[1] + room:
                    wrong.append(f"force on {boundary}: {exact!r} is not within {bounds}")
    bound = solution.error_bound
    if not isinstance(bound, ErrorBound):
        made[f"error, refused: {bound}"] += 1
        return wrong, made
    made["error, bounded"] += 1
    assert summary["error_bound"]["error"] == bound.error
    coulomb = any(one.friction["law"] == "coulomb" for one in bodies)
    if coulomb:  # the bound is that of the Tresca problem with the friction bound of this mesh
        return wrong, made
    try:
        corners = any(one.kind == "corner" for one in bodies)  # of two normals, which exact does not solve
        fine = solve(scene_of(bodies, finer=FINER, degree=2, algorithm="alm" if corners else "exact"), MPI.COMM_SELF)
    except ConvergenceError:
        return wrong, made + Counter({"no reference": 1})
    squares, piece, owner = differences(solution, fine)
    shares = np.zeros(len(bound.squares))
    shares += bound.squares
    of_cell = np.zeros(len(shares), dtype=np.int64)
    of_cell[owner] = piece
    made["error, judged"] += 1
    if np.sqrt(squares.sum()) > bound.error:
        wrong.append(f"error: {np.sqrt(squares.sum())!r} is above {bound.error!r}")
    for number, square in enumerate(squares):
        if np.sqrt(square) > np.sqrt(3 * shares[of_cell == number].sum()) + bound.round_off + bound.data:
            wrong.append(f"error of piece {number}: {np.sqrt(square)!r} is above its share")
    for one in bodies:
        for direction in ((1.0, 0.0), (0.0, 1.0)):
            wide, narrow = (each.mean_displacement_bounds(f"{one.name}.right", direction) for each in (solution, fine))
            made["mean, " + ("refused" if isinstance(wide, str) else "bounded")] += 1
            if isinstance(wide, str) != isinstance(narrow, str) or (one.kind != "clamped") != isinstance(wide, str):
                wrong.append(f"mean of body {one.name}, {one.kind}: {wide}, {narrow}")
            elif not isinstance(wide, str) and (wide[1] < narrow[0] or narrow[1] < wide[0]):
                wrong.append(f"mean of body {one.name}: {wide} and {narrow} exclude each other")
    return wrong, made


def main() -> int:
    """Draw, judge and count."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--count", type=int, default=100)
    options = parser.parse_args()
    made, refuted, exceptions = Counter[str](), 0, 0
    for seed in range(options.first, options.first + options.count):
        try:
            wrong, counts = judge(seed)
        except Exception:
            exceptions += 1
            print(f"scene {seed}: exception\n{traceback.format_exc()}", flush=True)
            continue
        made += counts
        refuted += len(wrong)
        for statement in wrong:
            print(f"scene {seed}: {statement}", flush=True)
    for kind, number in sorted(made.items()):
        print(f"{number:6d}  {kind}")
    print(f"{options.count} scenes, {exceptions} exceptions, {refuted} statements refuted")
    return int(exceptions + refuted > 0)


if __name__ == "__main__":
    raise SystemExit(main())
