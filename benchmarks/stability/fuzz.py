"""Fuzz: thousands of randomly corrupted scenes, expressions and mesh files, by seed.

    ./env python3 -m benchmarks.stability.fuzz [SEED ...]

Each must end with an error that names its place, or with a certified result; no code in it may be executed, and none
may take long.  Every mesh is read in a separate process, as gmsh may crash; the files that remain must do no harm.
"""

from __future__ import annotations

import importlib
import multiprocessing
import os
import pkgutil
import random
import resource
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from mpi4py import MPI

from benchmarks.stability.mutations import repeated, spoilt_bytes, spoilt_expression, spoilt_text
from signorini_fx import extensions
from signorini_fx.errors import MeshError, SceneError
from signorini_fx.mechanics import effects, shapes
from signorini_fx.mechanics.mesh.tagged import read_mesh
from signorini_fx.mechanics.statement.expressions import Expression
from signorini_fx.records import Status
from signorini_fx.scenes.reading import parse_scene, parse_scene_text
from signorini_fx.scenes.solver import solve
from signorini_fx.scenes.template import starting_scene

# CPU seconds that one of them may take.
_SCENE_SECONDS, _MESH_SECONDS = 2.0, 30
_MESH_BYTES = 4 << 30
_LONGEST = 20_000  # characters of a message
DEMOS = Path(__file__).parents[2] / "demos" / "scenes"


class Score:
    """How many had which outcome, and those with a bad end."""

    def __init__(self) -> None:
        self.ends: Counter[str] = Counter()
        self.bad: list[str] = []

    def take(self, name: str, run: Callable[[], str], seconds: float) -> None:
        """Run one, which returns its outcome; an error or too many CPU seconds are a bad end."""
        begin = time.process_time()
        try:
            self.ends[run()] += 1
        except Exception as error:
            where = traceback.extract_tb(error.__traceback__)[-1]
            self.bad.append(f"{name}: {type(error).__name__} in {Path(where.filename).name}:{where.lineno}")
        if time.process_time() - begin > seconds:
            self.bad.append(f"{name}: took more than {seconds} s")


def texts(seed: int, count: int) -> Score:
    """Scenes and expressions, read and evaluated, not solved."""
    bases = [starting_scene(), *(path.read_text(encoding="utf-8") for path in sorted(DEMOS.glob("*.toml")))]
    score = Score()
    executed: list[str] = []
    watched = {"os.system", "os.exec", "os.posix_spawn", "subprocess.Popen", "import", "open", "socket.connect"}
    watching = True

    def watch(event: str, arguments: object) -> None:
        if watching and (event in watched or (event == "exec" and "PWNED" in repr(arguments))):
            executed.append(f"{event} {arguments}"[:200])

    def scene(chance: random.Random) -> str:
        try:
            parse_scene_text(spoilt_text(chance.choice(bases), chance), Path("scene.toml"))
        except SceneError as refusal:
            placed = all(path.strip() and len(message) > 5 for path, message in refusal.problems)
            return "refused" if placed and refusal.problems and len(str(refusal)) < _LONGEST else unplaced(refusal)
        return "scenes"

    def unplaced(refusal: SceneError) -> str:
        raise AssertionError(f"an error without a place, or a long one: {str(refusal)[:100]!r}")

    def expression(chance: random.Random) -> str:
        try:
            function = Expression(spoilt_expression(chance))
        except ValueError:
            return "no expressions"
        assert function(np.array([[0.0, 0.3, 3.0], [0.0, 1.0, 0.5]])).shape == (3,)
        return "expressions"

    # All modules that reading needs are imported by now, and what other packages add is known: effects and shapes are
    # where a scene names one.
    for module in (
        *pkgutil.iter_modules(effects.__path__, f"{effects.__name__}."),
        *pkgutil.iter_modules(shapes.__path__, f"{shapes.__name__}."),
    ):
        importlib.import_module(module.name)
    scene(random.Random(seed))
    expression(random.Random(seed))
    importlib.import_module("unicodedata")
    with suppress(ImportError):  # a separate module in Python 3.14
        importlib.import_module("_ast_unparse")
    for group in extensions.GROUPS:
        extensions.names_of(group)
    sys.addaudithook(watch)
    for number, (chance, kind) in enumerate(repeated(seed, count, ("scene", "expression"))):
        run = scene if kind == "scene" else expression
        score.take(f"{kind} {number}", partial(run, chance), _SCENE_SECONDS)
    watching = False
    score.bad += [f"executed: {what}" for what in executed[:1]]
    return score


def meshes(seed: int, count: int) -> Score:
    """Mesh files: read, and where that succeeds solved on."""
    score = Score()
    importlib.import_module("gmsh")  # once, not in every child
    with tempfile.TemporaryDirectory() as name:
        # gmsh is started in children only, because it has a global state.
        assert _in_a_child(lambda: _write_bases(Path(name)), 60) == 0
        contents = [path.read_bytes() for path in sorted(Path(name).glob("base*.msh"))]
        for number, (chance, _) in enumerate(repeated(seed, count, ("mesh",))):
            file = Path(name) / "spoilt.msh"
            file.write_bytes(spoilt_bytes(chance.choice(contents), chance))
            score.take(f"mesh {number}", partial(_mesh, file), float("inf"))
            for left in (file, file.with_name("found")):
                left.unlink(missing_ok=True)
    return score


def _mesh(file: Path) -> str:
    """Read in a child, where gmsh may break."""
    refused = 3

    def read() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (_MESH_SECONDS, _MESH_SECONDS))
        resource.setrlimit(resource.RLIMIT_AS, (_MESH_BYTES, _MESH_BYTES))
        try:
            tagged = read_mesh(file, MPI.COMM_SELF)
            scene = parse_scene(_example1({"law": "tresca", "bound": 1.5}))
            solution = solve(scene.model_copy(update={"mesh": tagged}), MPI.COMM_SELF, check=False)
        except (MeshError, SceneError):
            os._exit(refused)
        _check(solution)

    status = _in_a_child(read, 2 * _MESH_SECONDS)
    if status is None or status < 0:
        return "broke gmsh"
    if status == refused:
        return "refused"
    assert status == 0, f"a mesh that was accepted ends with {status}"
    return "meshes"


def _check(solution: object) -> None:
    assert isinstance(solution.status, Status)  # type: ignore[attr-defined]
    assert not solution.converged or solution.certificate.holds  # type: ignore[attr-defined]


def _write_bases(folder: Path) -> None:
    """A small mesh in every format of gmsh."""
    import gmsh

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    geo = gmsh.model.geo
    corners = [geo.addPoint(x, y, 0) for x, y in ((0, 0), (3, 0), (3, 1), (0, 1))]
    sides = [geo.addLine(a, b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
    body = geo.addPlaneSurface([geo.addCurveLoop(sides)])
    for side, count in zip(sides, (6, 2, 6, 2), strict=True):
        geo.mesh.setTransfiniteCurve(side, count + 1)
    geo.mesh.setTransfiniteSurface(body)
    geo.synchronize()
    gmsh.model.addPhysicalGroup(2, [body], name="body")
    for side, name in zip(sides, ("bottom", "right", "top", "left"), strict=True):
        gmsh.model.addPhysicalGroup(1, [side], name=name)
    gmsh.model.mesh.generate(2)
    for version in (2.2, 4.1):
        for binary in (0, 1):
            gmsh.option.setNumber("Mesh.MshFileVersion", version)
            gmsh.option.setNumber("Mesh.Binary", binary)
            gmsh.write(str(folder / f"base{version}{binary}.msh"))


def _in_a_child(action: Callable[[], object], seconds: float) -> int | None:
    """The exit of a fork that runs a function, negative for a signal; None if it had to be killed."""
    child = multiprocessing.get_context("fork").Process(target=_silently, args=(action,))
    child.start()
    child.join(seconds)
    if child.is_alive():
        child.kill()
        child.join()
        return None
    return child.exitcode


def _silently(action: Callable[[], object]) -> None:
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    for number in (signal.SIGSEGV, signal.SIGABRT, signal.SIGFPE, signal.SIGBUS):
        signal.signal(number, signal.SIG_DFL)  # PETSc would end all of MPI
    action()


_SOLVED = (
    ("solver", "algorithm", ("ssn", "continuation", "path-following", "alm")),
    ("solver", "gamma_n", (1e-6, 1e4, 1e8, 1e18)),
    ("solver", "levels", (1, 2)),
    ("solver", "linear_algebra", ("full", "krylov", "condensed")),
    ("material", "poisson", (0.0, 0.4999999, -0.9)),
    ("material", "young", (1e-3, 1e15)),
)


def solved_scenes(seed: int, count: int) -> Score:
    """Random expressions as load, gap and bound of a small scene, with random settings: solved."""
    score = Score()

    def attempt(chance: random.Random) -> str:
        data = _example1(chance.choice(({"law": "tresca", "bound": 1.5}, {"law": "coulomb", "coefficient": 0.3})))
        for table, key, values in chance.sample(_SOLVED, 2):
            data[table][key] = chance.choice(values)
        data["contact"]["gap"] = f"1e-3*({spoilt_expression(chance)})"
        if chance.random() < 0.3:
            data["contact"]["friction"] = {"law": "tresca", "bound": f"abs({spoilt_expression(chance)})"}
        data["solver"] |= {"max_iterations": 30, "max_outer_iterations": 20}
        try:
            solution = solve(parse_scene(data), MPI.COMM_SELF, check=False)
        except (MeshError, SceneError) as refusal:
            return "refused" if str(refusal).strip() else "refused without a message"
        _check(solution)
        return str(solution.status.value)

    for number, (chance, _) in enumerate(repeated(seed, count, ("scene",))):
        score.take(f"scene {number}", partial(attempt, chance), 60.0)
    return score


def _example1(friction: dict[str, Any]) -> dict[str, Any]:
    """Example 1 of the paper on a coarse mesh."""
    return {
        "mesh": {"generator": "rectangle", "parameters": {"length": 3.0, "height": 1.0, "nx": 6, "ny": 2}},
        "material": {"young": 5000.0, "poisson": 0.4},
        "displacement": [{"boundary": "left", "x": 0.0}, {"boundary": "right", "x": 0.0}],
        "traction": {"boundary": "top", "y": "-20 if 1 <= x[0] <= 2 else 0"},
        "contact": {"boundary": "bottom", "gap": "0.003 * (x[0] - 1.5)**2 + 0.001", "friction": friction},
        "solver": {},
    }


# What is spoilt, and how many of each for one seed.
KINDS = {"scenes and expressions": (texts, 10_000), "mesh files": (meshes, 500), "solved scenes": (solved_scenes, 300)}


def main(seeds: list[str]) -> int:
    """Print the outcomes; the exit code is 1 if there is a bad end."""
    bad = 0
    for seed in seeds or ["0"]:
        for name, (run, count) in KINDS.items():
            score = run(int(seed), count)
            outcomes = ", ".join(f"{count} {end}" for end, count in sorted(score.ends.items()))
            print(
                f"{name}, seed {seed}: {outcomes}; {len(score.bad)} with a bad end", *score.bad, sep="\n  ", flush=True
            )
            bad += len(score.bad)
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
