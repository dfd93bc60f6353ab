"""The rows of the benchmark: what is compared with what, and the targets."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import clock
import contestants
import example1
import large_space
import numpy as np
import small
import space_rows
import two_bodies
from clock import Key, Sample
from row import Row, Say, Sizes

from signorini_fx import solve

HERE = Path(__file__).parent


@dataclass(frozen=True)
class Ratio:
    """A row that is the time of one contestant over that of another."""

    group: str
    what: str
    over: tuple[str, str]
    sizes: tuple[str, ...]
    targets: tuple[float | None, ...]
    at_least: bool = False
    coulomb: str = ""


_MIDDLE, _BOTH = ("middle",), ("middle", "large")
_COULOMB = (("newton", "newton"), ("fp", "fixed point"))
RATIOS = [
    Ratio("tresca", "Tresca over a linear solve, MUMPS both", ("tresca", "mumps"), _BOTH, (1.5, 1.5)),
    Ratio("tresca", "Tresca over the fastest linear solve, CHOLMOD", ("tresca", "cholmod"), _BOTH, (2.5, 2.5)),
    *(
        Ratio(
            "coulomb", f"Coulomb, {name}, over a linear solve, MUMPS both", (m, "mumps"), _BOTH, (1.7, 1.7), coulomb=m
        )
        for m, name in _COULOMB
    ),
    *(
        Ratio("coulomb", f"Coulomb, {name}, over one by CHOLMOD", (m, "cholmod"), _BOTH, (None, None), coulomb=m)
        for m, name in _COULOMB
    ),
    Ratio("sweep", "20 values of F over a linear solve", ("sweep F", "mumps"), _MIDDLE, (3.0,)),
    Ratio("sweep", "the same, each certified", ("sweep F, certified", "mumps"), _MIDDLE, (None,)),
    Ratio("sweep", "20 loads, Tresca, over a linear solve", ("sweep load", "mumps"), _MIDDLE, (3.0,)),
    Ratio("sweep", "the same, each certified", ("sweep load, certified", "mumps"), _MIDDLE, (None,)),
    Ratio("plain", "the plain way over the package, Tresca", ("plain", "tresca"), _MIDDLE, (10.0,), at_least=True),
    Ratio("rival", "the rival over the package, Tresca", ("rival tresca", "tresca"), _BOTH, (3.0, 5.0), at_least=True),
    *(
        Ratio("rival", f"the rival (FP) over {name}", ("rival fp", m), _BOTH, (5.0, 8.0), at_least=True, coulomb=m)
        for m, name in _COULOMB
    ),
]
GROWTH = ("tresca", "newton", "fp")
GROUPS = (
    "tresca",
    "coulomb",
    "sweep",
    "plain",
    "rival",
    "growth",
    "memory",
    "nested",
    "ranks",
    "counts",
    "large",
    "space",
    "space-sweep",
    "space-rivals",
    "two-bodies",
    "large-space",
    "space-growth",
    "small",
    "import",
)
# On the largest mesh differences are not small, and fewer rounds suffice.
_FEW_REPEATS = 3


def plan(groups: Sequence[str], sizes: Sizes) -> list[Key]:
    """The contestants that the rows need, each once."""
    keys: list[Key] = []
    for ratio in RATIOS:
        if ratio.group in groups:
            keys += [(name, getattr(sizes, size)) for size in ratio.sizes for name in ratio.over]
    if "growth" in groups:
        keys += [(name, nx) for nx in (sizes.small, sizes.large) for name in (*GROWTH, "mumps")]
    return sorted(dict.fromkeys(keys), key=lambda key: (key[1], key[0]))


def timed(groups: Sequence[str], sizes: Sizes, samples: list[Sample], notes: dict[Key, str], default: str) -> list[Row]:
    """The rows that are ratios of times."""
    rows = []
    for ratio in RATIOS:
        if ratio.group not in groups:
            continue
        for size, target in zip(ratio.sizes, ratio.targets, strict=True):
            nx = getattr(sizes, size)
            top, bottom = ((name, nx) for name in ratio.over)
            seconds = clock.series(samples, top), clock.series(samples, bottom)
            rounds = min(map(len, seconds))
            measured = seconds[0][:rounds] / seconds[1][:rounds]
            ours = bottom if ratio.at_least else top
            note = "; ".join(
                filter(None, (notes.get(ours, ""), notes.get(top, "") if top[0] in contestants.ROUNDS else ""))
            )
            counts = ratio.coulomb in ("", default)
            if ratio.coulomb and counts:
                note += "; the default"
            where = clock.phases(samples, ours)
            what, limit = ratio.what, target if counts else None
            rows.append(Row(ratio.group, what, sizes.name(nx), measured, limit, ratio.at_least, ours, "", note, where))
    if "growth" in groups:
        rows += _growth(sizes, samples, default)
    return rows


def _growth(sizes: Sizes, samples: list[Sample], default: str) -> list[Row]:
    rows = []
    for name in GROWTH:
        ours, theirs = (
            clock.series(samples, (who, sizes.large)) / clock.series(samples, (who, sizes.small))
            for who in (name, "mumps")
        )
        note = f"{np.median(ours):.1f} times, the linear solve {np.median(theirs):.1f} times"
        limit = 1.2 if name in ("tresca", default) else None
        size = f"{sizes.small} to {sizes.large}"
        what = f"growth of time, {name}, over that of the linear solve"
        rows.append(Row("growth", what, size, ours / theirs, limit, note=note))
    return rows


def apart(arguments: Sequence[object], ranks: int = 1, options: str = "") -> dict[str, Any]:
    """Run ``once.py`` in a separate process, or on several ranks.

    Raises:
        RuntimeError: it failed.
    """
    command = [sys.executable, str(HERE / "once.py"), *map(str, arguments)]
    if ranks > 1:
        command = ["mpirun", "-n", str(ranks), *command]
    environment = os.environ | ({"PETSC_OPTIONS": options} if options else {})
    ended = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    if ended.returncode:
        raise RuntimeError(f"{' '.join(command)} failed:\n{ended.stderr[-2000:]}")
    found: dict[str, Any] = json.loads(ended.stdout.splitlines()[-1])
    found["krylov"] = [int(count) for count in re.findall(r"^ *Linear.* iterations (\d+)$", ended.stdout, re.MULTILINE)]
    return found


def memory(sizes: Sizes, repeats: int, say: Say) -> list[Row]:
    """Peak memory of a process that solves a contact problem, over that of one that solves the linear problem."""
    nx = sizes.large
    names = ("tresca", "newton", "fp", "mumps", "cholmod")
    found: dict[str, list[dict[str, Any]]] = {name: [] for name in names}
    for repeat in range(repeats):
        for name in names:
            say(f"memory, round {repeat + 1} of {repeats}: {name}")
            found[name].append(apart([name, nx]))
    rows = []
    for name in names[:3]:
        for package in names[3:]:
            ours, theirs = ([run["peak"] for run in found[who]] for who in (name, package))
            added = [np.median([run["peak"] - run["before"] for run in found[who]]) for who in (name, package)]
            note = f"{np.median(ours):.0f} MB over {np.median(theirs):.0f} MB"
            note += f"; without what there was before the solve {added[0]:.0f} MB over {added[1]:.0f} MB"
            what = f"peak memory, {name}, over a linear solve, {package.upper()}"
            limit = 1.5 if package == "mumps" else None
            rows.append(Row("memory", what, sizes.name(nx), np.divide(ours, theirs), limit, note=note))
    return rows


def nested(sizes: Sizes, levels: int, gammas: Sequence[float], say: Say) -> list[Row]:
    """Linear solves on the finest mesh of a nested iteration; counts, hence one run."""
    rows = []
    for law in ("tresca", "coulomb"):
        counts, notes = [], []
        for gamma in gammas:
            say(f"nested, {law}, gamma = {gamma:.0e}")
            solution = solve(example1.scene(law, sizes.large, gamma=gamma, levels=levels), check=False)
            per_level = [level.linear_solves for level in solution.levels]
            counts.append(per_level[-1] if solution.converged else np.inf)
            notes.append(f"{gamma:.0e}: {' '.join(map(str, per_level))}{'' if solution.converged else ' FAILED'}")
        what = f"linear solves on the finest of {levels} meshes, {law}, worst gamma"
        size = sizes.name(sizes.large)
        rows.append(Row("nested", what, size, [max(counts)], 4.0, unit="solves", note="; ".join(notes)))
    return rows


def ranks(sizes: Sizes, levels: int, repeats: int, say: Say) -> list[Row]:
    """Two ranks over one, all unknowns, nested iteration."""
    arguments = ["tresca", sizes.large, levels, "full"]
    cases = {"1": (1, ""), "1, MUMPS": (1, "-sfx_pc_factor_mat_solver_type mumps"), "2": (2, "")}
    found: dict[str, list[dict[str, Any]]] = {name: [] for name in cases}
    load = []
    for repeat in range(repeats):
        for name, (count, options) in cases.items():
            say(f"ranks, round {repeat + 1} of {repeats}: {name}")
            load.append(os.getloadavg()[0])
            found[name].append(apart(arguments, count, options))
    two = [run["seconds"] for run in found["2"]]
    rows = []
    for name, what in (("1", "as it comes"), ("1, MUMPS", "MUMPS on both")):
        speedup = np.divide([run["seconds"] for run in found[name]], two)
        solves = found["2"][0]["solves"], found["2"][0]["factorisations"]
        counts = f"solves by level {solves[0]}, factorisations {solves[1]}"
        note = f"{counts}; load average {np.mean(load):.1f} on {os.cpu_count()} cores"
        where = found["2"][0]["phases"]
        limit = 1.5 if name == "1" else None
        rows.append(
            Row(
                "ranks",
                f"2 ranks faster than 1, full, {levels} meshes, {what}",
                sizes.name(sizes.large),
                speedup,
                limit,
                at_least=True,
                note=note,
                where=where,
            )
        )
    return rows


def counts(sizes: Sizes, levels: int, say: Say) -> list[Row]:
    """Counts that should not grow with mesh and ranks: solves, and CG iterations with multigrid.

    Counts may be taken on more ranks than there are cores.
    """
    rows = []
    for nx, most in ((sizes.small, 4), (sizes.middle, 4), (sizes.large, 2)):
        for count in (n for n in (1, 2, 4) if n <= most):
            say(f"counts, {sizes.name(nx)}, {count} ranks")
            full = apart(["tresca", nx, levels, "full"], count)
            krylov = apart(["tresca", nx, levels, "krylov"], count, "-sfx_ksp_converged_reason")
            finest = krylov["krylov"][-krylov["solves"][-1] :]
            note = f"solves by level {full['solves']}; with multigrid {krylov['solves']}"
            what = f"CG iterations a solve on the finest of {levels} meshes, multigrid, {count} ranks"
            rows.append(Row("counts", what, sizes.name(nx), finest, unit="its", note=note))
    return rows


def huge(sizes: Sizes, repeats: int, default: str, say: Say) -> list[Row]:
    """Two million unknowns: time and memory over one linear solve, each in a process of its own."""
    names = ("tresca", "newton", "fp", "mumps", "cholmod")
    found: dict[str, list[dict[str, Any]]] = {name: [] for name in names}
    for repeat in range(repeats):
        for name in names:
            say(f"large, round {repeat + 1} of {repeats}: {name}")
            found[name].append(apart([name, sizes.huge]))
    rows = []
    size = sizes.name(sizes.huge)
    targets: dict[tuple[str, str], float] = {
        (default, "mumps"): 1.7,
        ("tresca", "mumps"): 1.5,
        ("tresca", "cholmod"): 2.5,
    }
    for name in names[:3]:
        runs, first = found[name], found[name][0]
        gigabytes = [run["peak"] / 1024 if run["status"] == "converged" else np.inf for run in runs]
        note = f"{first['dofs']} unknowns, {first['status']}, {sum(first['solves'])} solves; {first['linear_algebra']}"
        rows.append(Row("large", f"peak memory, {name}", size, gigabytes, 24.0, unit="GB", note=note))
        for package in names[3:]:
            linear = found[package]
            ratio = np.divide([run["seconds"] for run in runs], [run["seconds"] for run in linear])
            memory = np.median([run["peak"] for run in runs]) / np.median([run["peak"] for run in linear])
            what = f"{name} over a linear solve, {package.upper()}"
            note, limit = f"peak memory {memory:.2f} times that of it", targets.get((name, package))
            rows.append(Row("large", what, size, ratio, limit, note=note, where=first["phases"]))
    return rows


_HEAVY = ("dolfinx", "petsc4py", "mpi4py", "ufl", "basix", "gmsh", "matplotlib")


def start_up(repeats: int, say: Say) -> list[Row]:
    """Seconds of ``--help`` and of the import, each in a process of its own; and what they import."""
    cases = {
        "signorini-fx --help": ["-m", "signorini_fx", "--help"],
        "import signorini_fx": ["-c", "import signorini_fx"],
        "bare Python": ["-c", "pass"],
    }
    seconds: dict[str, list[float]] = {name: [] for name in cases}
    for _ in range(max(repeats, 5)):
        for name, arguments in cases.items():
            say(f"start: {name}")
            start = time.perf_counter()
            subprocess.run([sys.executable, *arguments], check=True, capture_output=True)
            seconds[name].append(time.perf_counter() - start)
    command = [sys.executable, "-X", "importtime", *cases["signorini-fx --help"]]
    trace = subprocess.run(command, check=True, capture_output=True, text=True).stderr
    imported = {line.rsplit("|", 1)[-1].strip().split(".")[0] for line in trace.splitlines() if "|" in line}
    heavy = sorted(imported & set(_HEAVY))
    note = f"imports {', '.join(heavy)}" if heavy else "imports no dolfinx, PETSc, MPI, gmsh, matplotlib"
    rows = []
    for name, values in seconds.items():
        limit = 0.3 if name == "signorini-fx --help" else None
        measured = [np.inf] if limit and heavy else values
        rows.append(Row("import", name, "", measured, limit, unit="s", note=note if limit else ""))
    return rows


def run(
    groups: Sequence[str], sizes: Sizes, repeats: int, levels: int, say: Say
) -> Iterator[tuple[list[Row], list[Sample]]]:
    """All rows of the groups, and the samples of those that are ratios of times; each yield has more."""
    keys = plan(groups, sizes)
    default = contestants.default_coulomb(example1.tagged_mesh(sizes.middle))
    meshes = {nx: example1.tagged_mesh(nx) for nx in sorted({nx for _, nx in keys})}
    notes = clock.warm_up(keys, meshes, say)
    samples = clock.interleave(keys, meshes, repeats, say)
    rows = timed(groups, sizes, samples, notes, default)
    if rows:
        yield rows, samples
    del meshes
    gammas = [10.0**power for power in range(4, 11)]
    others: dict[str, Callable[[], Iterable[Row]]] = {
        "memory": lambda: memory(sizes, repeats, say),
        "nested": lambda: nested(sizes, levels, gammas, say),
        "ranks": lambda: ranks(sizes, levels, repeats, say),
        "counts": lambda: counts(sizes, levels, say),
        "large": lambda: huge(sizes, min(repeats, _FEW_REPEATS), default, say),
        "space": lambda: space_rows.in_space(sizes, repeats, say),
        "space-sweep": lambda: space_rows.sweeps(sizes, min(repeats, _FEW_REPEATS), say),
        "space-rivals": lambda: space_rows.rivals(sizes, min(repeats, _FEW_REPEATS), say),
        "two-bodies": lambda: two_bodies.rows(sizes, min(repeats, _FEW_REPEATS), say),
        "large-space": lambda: large_space.rows(min(repeats, _FEW_REPEATS), say),
        "space-growth": lambda: large_space.growth(say),
        "small": lambda: small.rows(min(repeats, _FEW_REPEATS), say),
        "import": lambda: start_up(repeats, say),
    }
    for group in groups:
        if group in others:
            try:
                for row in others[group]():
                    rows.append(row)
                    yield rows, samples
            except RuntimeError as error:
                rows.append(Row(group, f"{group}: failed", "", [np.inf], 0.0, note=str(error)))
                yield rows, samples
