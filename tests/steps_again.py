"""Solves every load step of problems again, each in a fresh process from the file of the state
before it, and goes on after kills.

    ./env python3 -m tests.steps_again [--ranks N] [NAME ...]    steps again, on N ranks
    ./env python3 -m tests.steps_again --kill [NAME ...]         killed by -9 in each step, restarted

NAME is the beginning of names of cases of ``golden``, by default 25 scenes, 15 nonlinear ones
and 10 own loops of forms.  States are written on one rank. A line for each case has
its steps and the largest difference; exit code 1: a step has another displacement, contact or slip,
or another number of linear solves.
"""

import argparse
import json
import math
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
# Of the displacement and of vectors of a state, relative to the largest: round-off of one rank, and
# of several.
SAME = {1: 1e-9, 2: 1e-7, 3: 1e-7}
SCENES = (
    *(f"demos/{name}" for name in ("belt", "hertz_friction", "press_and_slide", "two_cylinders")),
    *(f"fronts/{seed}" for seed in (0, 1, 11, 19, 24, 33, 39, 40, 102, 104)),
    *(f"oracle/bodies {seed}" for seed in (0, 1, 2, 13, 14, 18)),
    *(f"oracle/effects {seed}" for seed in (15, 29, 40, 52, 67)),
)
NONLINEAR = (
    *(f"demos/{name}" for name in ("braked_wheel", "roller", "rubber_mount", "rubber_seal")),
    *(f"nonlinear/{seed}" for seed in (10, 11, 12, 14, 15, 17, 18, 19, 20, 22, 24)),
)
FORMS = (
    *(f"fronts/{seed} as forms" for seed in (3, 4, 11, 19, 39, 50)),
    *(f"fronts/{seed} as residual" for seed in (3, 4, 9, 43)),
)
KILLED = ("demos/hertz_friction", "demos/rubber_seal", "demos/roller", "fronts/11", "nonlinear/15")
KRYLOV = 'linear_algebra = "krylov"'
# Kills the process where a load step begins.
RECKLESS = """
import os, signal, sys
from signorini_fx.records import StepRecord
from signorini_fx.scenes.solver import solve

def kill(record):
    if isinstance(record, StepRecord) and record.step == int(sys.argv[3]):
        os.kill(os.getpid(), signal.SIGKILL)

solve(sys.argv[1], checkpoint=sys.argv[2], observers=[kill])
"""


def frozen_cases():
    """Return what is stored of each case, by name; scenes of ``demos`` by their file."""
    lines = (ROOT / "tests" / "golden" / "scenes.jsonl").read_text(encoding="utf-8").splitlines()
    stored = {one["case"]: one for one in map(json.loads, lines)}
    files = ROOT.glob("demos/scenes/*.toml")
    return stored | {f"demos/{path.stem}": {"file": str(path)} for path in files}


def scene_file(case, folder):
    """Return the file of a scene, which is written with its mesh where there is none yet: ranks
    that read it must not write it.
    """
    if "file" in case:
        return Path(case["file"])
    file = folder / "scene.toml"
    if not file.exists():
        if "mesh" in case:
            (folder / "body.inp").write_text(case["mesh"], encoding="utf-8")
        file.write_text(case["scene"], encoding="utf-8")
    return file


def problem_of(case, folder):
    """Return a problem of which nothing is solved, what gives its forms their values at a time, and
    the times of its load steps; collective.
    """
    from fronts import problem_of as problem_of_forms

    from signorini_fx import build_problem

    for kind in ("forms", "residual"):
        if kind in case:
            problem, at, path = problem_of_forms(case[kind], residual=kind == "residual")
            return problem, at, path.times
    problem = build_problem(scene_file(case, folder))
    return problem, lambda time: None, problem.path.times


def solve_all(name, folder):
    """Solve all load steps, and store the state after each and its number of linear solves."""
    problem, at, times = problem_of(frozen_cases()[name], folder)
    state = problem.initial()
    state.save(folder / "0.npz", problem)
    counts = []
    for number, time in enumerate(times, 1):
        at(time)
        state, result = problem.step(state, time)
        if result.status.value != "converged":
            break
        state.save(folder / f"{number}.npz", problem)
        counts.append(result.linear_solves)
    (folder / "counts.json").write_text(json.dumps(counts), encoding="utf-8")


def solve_again(name, folder, number):
    """Solve one load step from the file of the state before it, on all ranks."""
    from mpi4py import MPI

    from signorini_fx.mechanics.state import State

    problem, at, times = problem_of(frozen_cases()[name], folder)
    state = State.load(folder / f"{number - 1}.npz", problem)
    at(times[number - 1])
    state, result = problem.step(state, times[number - 1])
    state.save(folder / f"again-{number}.npz", problem)
    if MPI.COMM_WORLD.rank == 0:
        text = json.dumps([result.status.value, result.linear_solves])
        (folder / f"again-{number}.json").write_text(text, encoding="utf-8")


def in_process(ranks, *arguments):
    """Run Python on several ranks; return its exit code and its errors."""
    launcher = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    own = os.environ | {"PYTHONPATH": os.pathsep.join((str(ROOT), str(ROOT / "tests/golden")))}
    command = [*launcher, sys.executable, *map(str, arguments)]
    done = subprocess.run(command, env=own, capture_output=True, text=True, check=False)
    return done.returncode, done.stderr


def apart(ours, theirs):
    """Return by how much two files of states differ, relative to the largest of each array, and the
    arrays of sets that differ.
    """
    one, other = (dict(np.load(path)) for path in (ours, theirs))
    order, by_place = (
        np.lexsort(np.round(table["x"], 9).T) if "x" in table else None for table in (one, other)
    )
    largest, sets = 0.0, []
    for key in one.keys() & other.keys():
        if one[key].dtype.kind not in "fb" or one[key].size != other[key].size:
            continue
        a, b = one[key], other[key]
        if order is not None and a.ndim and len(a) == len(order):
            a, b = a[order], b[by_place]
        if key in ("contact", "direction"):
            # A component of a direction may be round-off on several ranks.
            one_set, other_set = (
                np.any(part.reshape(len(part), -1) != 0, axis=1) for part in (a, b)
            )
            sets += [key] if (one_set != other_set).any() else []
        elif key == "displacement":
            largest = np.abs(a - b).max(initial=0.0) / (np.abs(b).max(initial=0.0) or 1.0)
    return float(largest), sets


def steps_again(name, ranks):
    """Return the number of load steps of a case, and a text for each that is another one."""
    me, wrong, worst = Path(__file__).resolve(), [], 0.0
    with tempfile.TemporaryDirectory() as own:
        folder = Path(own)
        code, errors = in_process(1, me, "--whole", name, folder)
        if code:
            return 0, [errors[-500:]], math.nan
        counts = json.loads((folder / "counts.json").read_text(encoding="utf-8"))
        for number, count in enumerate(counts, 1):
            code, errors = in_process(ranks, me, "--step", name, folder, number)
            if code:
                wrong.append(f"step {number}: {errors[-500:]}")
                continue
            text = (folder / f"again-{number}.json").read_text(encoding="utf-8")
            status, solves = json.loads(text)
            largest, sets = apart(folder / f"again-{number}.npz", folder / f"{number}.npz")
            worst = max(worst, largest)
            # On several ranks round-off may need one linear solve more or less, and with Krylov
            # methods the last iterate decides how many are needed.
            allowed = np.inf if KRYLOV in str(frozen_cases()[name]) else ranks > 1
            if status != "converged" or abs(solves - count) > allowed:
                wrong.append(f"step {number}: {status}, {count} -> {solves} solves")
            if largest > SAME[ranks] or sets:
                wrong.append(f"step {number}: displacement {largest:.1e}, {sets}")
    return len(counts), wrong, worst


def killed(name, ranks):
    """The same for runs that are killed in each load step and restarted."""
    wrong, worst = [], 0.0
    command = ("-m", "signorini_fx", "solve")
    left_out = ("--no-pictures", "--no-fields", "--out")
    with tempfile.TemporaryDirectory() as own:
        folder = Path(own)
        file = scene_file(frozen_cases()[name], folder)
        code, errors = in_process(1, *command, file, *left_out, folder / "whole")
        if code:
            return 0, [errors[-500:]], math.nan
        reference = summary_of(folder / "whole")
        for number in range(1, len(reference["steps"]) + 1):
            out = folder / f"killed-{number}"
            code, _ = in_process(1, "-c", RECKLESS, file, out, number)
            if code != -signal.SIGKILL:
                wrong.append(f"step {number}: was not killed, exit {code}")
                continue
            restart = ["--restart"] if number > 1 else []
            code, errors = in_process(ranks, *command, file, *left_out, out, *restart)
            if code:
                wrong.append(f"step {number}: {errors[-500:]}")
                continue
            for ours, theirs in zip(summary_of(out)["steps"], reference["steps"], strict=True):
                for key in ("contact_force", "strain_energy", "max_pressure"):
                    a, b = (np.array(row.get(key, 0.0), dtype=float) for row in (ours, theirs))
                    largest = np.abs(a - b).max(initial=0.0) / (np.abs(b).max(initial=0.0) or 1.0)
                    worst = max(worst, float(largest))
                if abs(ours["linear_solves"] - theirs["linear_solves"]) > (ranks > 1):
                    wrong.append(f"killed in step {number}: other solves in {ours['step']}")
        if worst > SAME[ranks]:
            wrong.append(f"figures differ by {worst:.1e}")
    return len(reference["steps"]), wrong, worst


def summary_of(folder):
    """Return the summary of a folder of results."""
    return json.loads((folder / "summary.json").read_text(encoding="utf-8"))


def main():
    """Print a line for each case."""
    parser = argparse.ArgumentParser(prog="python3 -m tests.steps_again")
    parser.add_argument("names", nargs="*", metavar="NAME")
    parser.add_argument("--ranks", type=int, default=1, metavar="N")
    parser.add_argument("--kill", action="store_true")
    parser.add_argument("--whole", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--step", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.whole:
        solve_all(given.names[0], Path(given.names[1]))
        return 0
    if given.step:
        solve_again(given.names[0], Path(given.names[1]), int(given.names[2]))
        return 0
    names = KILLED if given.kill else (*SCENES, *NONLINEAR, *FORMS)
    if given.names:
        beginnings = tuple(given.names)
        names = [name for name in frozen_cases() if name.startswith(beginnings)]
    bad = 0
    for name in names:
        count, wrong, worst = (killed if given.kill else steps_again)(name, given.ranks)
        print(f"{name}: {count} steps, {worst:.1e}", *wrong, sep="\n    ", flush=True)
        bad += bool(wrong)
    print(f"{len(names)} cases, {bad} with a difference")
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main())
