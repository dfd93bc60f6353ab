"""Compares the answers of hundreds of problems with those that were recorded; public names only.

    make golden                                               all of them, on one rank
    ./env python3 -m tests.golden [--ranks N] [--jobs N] [--beside FOLDER] [NAME ...]
    ./env python3 -m tests.golden --record [NAME ...]         record the answers anew

A line for each difference has the case, the quantity, the old and the new value.  Exit code 1:
there are differences. NAME is the beginning of names of cases.  ``--beside`` solves all of them
with the package of another checkout at the same time, and prints by which factor the CPU seconds of
each group differ.

Cases are the scenes and form programs of ``demos``, the examples of ``docs/i-want-to.md``, and the
lines of
``scenes.jsonl``: drawn once by the generators of ``stability`` or made from the problems of
``contactbench``, with the text of a scene and of its mesh, or of a deck.  What is refused is
recorded with the class of the error and the keys.
"""

import argparse
import contextlib
import faulthandler
import io
import json
import math
import os
import re
import runpy
import shutil
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
FROZEN, ANSWERS = HERE / "scenes.jsonl", HERE / "answers.jsonl"
MARK = "\x1e"  # begins the lines of a process that are for us
LIMIT = 600  # wall seconds of a case, after which its process is ended
# Relative to the largest value of the quantity in the case, or so many times the error of its
# equilibrium, where digits are lost; outcomes must be the same.
SAME, OF_EQUILIBRIUM = 1e-8, 10.0
# Counts must be the same, too, but for these: round-off, which differs by processor and ranks,
# decides when they end.
UNSETTLED = {
    "demos/dent",
    "decks/beams, finite strains",
    *(f"oracle/bodies {seed}" for seed in (8, 43, 75, 104)),
}
UNSETTLED |= {
    "oracle/plane 36",
    "oracle/space 66",
    "oracle/space-effects 0",
    "oracle/space-effects 36",
}
# Programs that take long on their own meshes, and the CELLS that they are given here.
COARSER = {"ironing": "4", "sliding_circle": "8"}
# The first keeps no problem whose answer could be asked for; the other takes long on any mesh that
# has its tool.
LEFT_OUT = {"rolling_wheel", "punch_along_an_arc"}
# Errors of a certificate below this are round-off; above it they may grow by this factor.
ROUND_OFF, GROWTH = 1e-10, 10.0


def cases():
    """All cases by name: functions that solve one in an empty folder and return its summary."""
    found = {
        f"demos/{path.stem}": partial(of_scene, path)
        for path in sorted(ROOT.glob("demos/scenes/*.toml"))
    }
    page = (ROOT / "docs" / "i-want-to.md").read_text(encoding="utf-8")
    for block in re.findall(r"^```toml\n(.*?)^```$", page, re.MULTILINE | re.DOTALL):
        if name := re.match(r"# (\w+)\.toml", block):
            found[f"examples/{name[1]}"] = partial(of_text, {"scene": block})
    programs = [*sorted(ROOT.glob("demos/forms/*.py")), ROOT / "demos" / "extensions" / "body.py"]
    found |= {
        f"forms/{path.stem}": partial(of_program, path)
        for path in programs
        if path.stem not in LEFT_OUT
    }
    for line in FROZEN.read_text(encoding="utf-8").splitlines():
        frozen = json.loads(line)
        found[frozen["case"]] = partial(of_text, frozen)
    return found


def of_scene(path, folder):
    """The summary of a scene file."""
    from signorini_fx import read_scene, solve, write_results

    return write_results(
        solve(read_scene(path), check=False), folder / "out", fields=False, pictures=False
    )


def of_text(frozen, folder):
    """The summary of a scene or a deck whose files are written first, or of a scene that is stated
    as forms.
    """
    from mpi4py import MPI

    if front := {"forms", "residual"} & frozen.keys():
        return of_front(frozen, front.pop(), folder)
    names = {"scene": "scene.toml", "mesh": "body.inp", "deck": "deck.inp"}
    if MPI.COMM_WORLD.rank == 0:
        for kind in names.keys() & frozen.keys():
            (folder / names[kind]).write_text(frozen[kind], encoding="utf-8")
    MPI.COMM_WORLD.barrier()
    return (
        of_deck(folder / "deck.inp", folder)
        if "deck" in frozen
        else of_scene(folder / "scene.toml", folder)
    )


def of_front(frozen, front, folder):
    """The summary of a scene that is stated as forms or as a residual."""
    from fronts import solution_of

    from signorini_fx import write_results

    solution = solution_of(frozen[front], residual=front == "residual")
    return write_results(solution, folder / "out", fields=False, pictures=False)


NOTHING_DRAWN = ("--no-pictures", "--no-fields")


def of_deck(path, folder):
    """The summary of a deck that the command line drafts and solves, with its exit code."""
    from mpi4py import MPI

    scene = folder / "draft.toml"
    for command in (
        ["new", scene, "--from", path],
        ["solve", scene, "--out", folder / "out", *NOTHING_DRAWN],
    ):
        if command[0] == "solve" and not scene.exists():
            break
        sys.argv = ["signorini-fx", *map(str, command)]
        try:
            runpy.run_module("signorini_fx", run_name="__main__", alter_sys=True)
        except SystemExit as end:
            code = end.code
        MPI.COMM_WORLD.barrier()  # the draft is written by one rank
    summary = folder / "out" / "summary.json"
    return (json.loads(summary.read_text(encoding="utf-8")) if summary.exists() else {}) | {
        "exit_code": code
    }


def of_program(path, folder):
    """The summary of the last solution of a program with forms; the solution or the problem has its
    usual name.
    """
    from signorini_fx import write_results

    os.environ["CELLS"] = COARSER.get(path.stem, "")
    names = runpy.run_path(str(path), run_name="__main__")
    solution = names["solution"] if "solution" in names else names["problem"].solution
    return write_results(solution, folder / "out", fields=False, pictures=False)


def figures(summary):
    """What is recorded of a summary, with the values of all load steps that converged one after the
    other.
    """
    rows = [row for row in summary.get("steps") or [summary] if row.get("status") == "converged"]
    found = {"status": summary.get("status"), "solves": [row["linear_solves"] for row in rows]}
    if "exit_code" in summary:
        found["exit_code"] = summary["exit_code"]
    if summary.get("status") == "converged":
        rows += summary["contact_boundaries"]
        found["displacement"] = numbers(summary["deformation"], "displacement")
        errors = summary["certificate"].items()
        found["certificate"] = {key: float(f"{x:.1e}") for key, x in errors if isinstance(x, float)}
    found["force"] = [
        x
        for row in rows
        for name in ("contact_force", "friction_force")
        for x in numbers(row, name)
    ]
    found["pressure"] = [x for row in rows for x in numbers(row, "max_pressure")]
    found["energy"] = [x for row in rows for x in numbers(row, "strain_energy")]
    # What round-off is measured by: the largest resultant, its mean pressure and work where nothing
    # is in contact, and the force of the largest pressure where nothing is loaded.
    load = max(
        (abs(x) for row in summary.get("resultants", []) for x in numbers(row, "force") if x),
        default=0.0,
    )
    area = sum(row["area"] for row in summary.get("contact_boundaries", []))
    load = load or area * max((x for x in found["pressure"] if x), default=0.0)
    work = load * max((x for x in found.get("displacement", []) if x), default=0.0)
    return found | {
        "sizes": {"force": load, "pressure": load / area if area else 0.0, "energy": work}
    }


def numbers(row, name):
    """Those of all keys that begin with a name, with the digits that are compared; None for those
    that are none.
    """
    values = [row[key] for key in sorted(row) if key.startswith(name)]
    flat = [x for value in values for x in (value if isinstance(value, list) else [value])]
    return [float(f"{x:.11g}") if isinstance(x, float) and math.isfinite(x) else None for x in flat]


def work(names):
    """Solve cases one after the other, and print an answer for each."""
    from dolfinx import jit
    from mpi4py import MPI

    from signorini_fx import SignoriniError

    jit.DOLFINX_DEFAULT_JIT_OPTIONS["timeout"] = (
        LIMIT,
        "seconds",
    )  # one process may wait for another one's compiler
    comm, every = MPI.COMM_WORLD, cases()
    for name in names:
        faulthandler.dump_traceback_later(LIMIT, exit=True)
        own = tempfile.mkdtemp() if comm.rank == 0 else None
        folder = Path(comm.bcast(own))
        os.chdir(folder)
        start = time.process_time()
        try:
            with (
                contextlib.redirect_stdout(io.StringIO()),
                contextlib.redirect_stderr(io.StringIO()),
            ):
                answer = figures(every[name](folder))
        except SignoriniError as error:
            answer = {
                "refused": type(error).__name__,
                "keys": [path for path, _ in getattr(error, "problems", [])],
            }
        except Exception as error:
            answer = {"refused": f"{type(error).__name__}: {error}"}
        answer = {"case": name, **answer, "seconds": round(time.process_time() - start, 3)}
        comm.barrier()
        if comm.rank == 0:
            shutil.rmtree(folder)
            print(f"{MARK}{json.dumps(answer)}", flush=True)


def answers(names, ranks, root):
    """Those of a process of its own, or of several ranks, with the package of a checkout; it is
    begun again where a case ends it.
    """
    environment = os.environ | {"PYTHONPATH": str(root), "OMPI_MCA_mpi_yield_when_idle": "1"}
    command = [
        *(["mpirun", "-n", str(ranks)] if ranks > 1 else []),
        sys.executable,
        str(HERE / "__main__.py"),
    ]
    found, outputs = {}, {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    while names:
        said = ""
        with subprocess.Popen(
            [*command, "--work", *names], env=environment, text=True, **outputs
        ) as process:
            for line in process.stdout:
                before, mark, text = line.partition(MARK)
                said += before
                if mark:
                    answer = json.loads(text)
                    found[answer["case"]], names = answer, names[1:]
                    print(line.strip(MARK), end="", file=sys.stderr)
        if names and not found:
            sys.exit(said[-5000:])
        if names:
            found[names[0]] = {
                "case": names[0],
                "refused": f"the process ended: {said[-300:]}",
                "seconds": 0.0,
            }
            names = names[1:]
    return found


def differences(old, new):
    """Quantity, old and new value of each difference."""
    ends = [(one.get("refused"), one.get("status")) for one in (old, new)]
    if ends[0] != ends[1]:  # then all else differs too
        yield "outcome", *(refused or status for refused, status in ends)
        return
    same = max(SAME, OF_EQUILIBRIUM * old.get("certificate", {}).get("equilibrium", 0.0))
    for key in sorted((old.keys() | new.keys()) - {"case", "seconds", "certificate", "sizes"}):
        ours, theirs = old.get(key), new.get(key)
        if ours == theirs or (key == "solves" and old["case"] in UNSETTLED):
            continue
        if (
            key in ("force", "pressure", "energy", "displacement")
            and ours
            and theirs
            and len(ours) == len(theirs)
        ):
            scale = max(abs(x) for x in [*ours, *theirs, new["sizes"].get(key)] if x is not None)
            pairs = list(zip(ours, theirs, strict=True))
            apart = [
                0.0 if a == b else math.inf if None in (a, b) else abs(a - b) for a, b in pairs
            ]
            worst = apart.index(max(apart))
            if apart[worst] > same * scale:
                yield (
                    f"{key}[{worst}], {apart[worst] / scale:.1e} of the largest",
                    ours[worst],
                    theirs[worst],
                )
        else:
            yield key, ours, theirs
    errors = old.get("certificate", {}), new.get("certificate", {})
    for key in errors[0].keys() & errors[1].keys() if old["case"] not in UNSETTLED else ():
        if errors[1][key] > GROWTH * max(errors[0][key], ROUND_OFF):
            yield f"certificate.{key}", errors[0][key], errors[1][key]


def main():
    """Compare, or record."""
    parser = argparse.ArgumentParser(prog="python3 -m tests.golden")
    parser.add_argument(
        "names", nargs="*", metavar="NAME", help="beginnings of names of cases (all)"
    )
    parser.add_argument("--record", action="store_true", help="write the answers anew")
    parser.add_argument("--ranks", type=int, default=1, metavar="N", help="of each process (1)")
    parser.add_argument(
        "-n", "--jobs", type=int, default=2, metavar="N", help="processes side by side (2)"
    )
    parser.add_argument(
        "--beside", type=Path, metavar="FOLDER", help="a checkout whose CPU seconds are compared"
    )
    parser.add_argument("--work", action="store_true", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.work:
        work(given.names)
        return 0
    every = cases()
    recorded = {
        one["case"]: one
        for one in map(json.loads, ANSWERS.read_text(encoding="utf-8").splitlines())
    }
    wanted = [
        name for name in every.keys() | recorded.keys() if name.startswith(tuple(given.names) or "")
    ]
    # What takes long is dealt out first, to all alike.
    names = sorted(
        every.keys() & wanted,
        key=lambda name: (-recorded.get(name, {"seconds": 1.0})["seconds"], name),
    )
    checkouts = [ROOT, *([given.beside.resolve()] if given.beside else [])]
    jobs = max(1, given.jobs // len(checkouts))
    with ThreadPoolExecutor() as pool:
        parts = {
            root: [pool.submit(answers, names[k::jobs], given.ranks, root) for k in range(jobs)]
            for root in checkouts
        }
    found = {
        root: {k: v for part in some for k, v in part.result().items()}
        for root, some in parts.items()
    }
    new = found[ROOT]
    count = 0
    for name in sorted(wanted):
        if name not in new or name not in recorded:
            lines = [
                (
                    "case",
                    "recorded" if name in recorded else "not recorded",
                    "there" if name in new else "gone",
                )
            ]
        else:
            lines = list(differences(recorded[name], new[name]))
        for quantity, before, now in lines:
            print(f"{name}: {quantity}: {before} -> {now}")
        count += bool(lines)
    if given.record:
        kept = {name: one for name, one in recorded.items() if name not in wanted} | new
        lines = [json.dumps(kept[name]) for name in sorted(kept)]
        ANSWERS.write_text("\n".join(lines) + "\n", encoding="utf-8")
    seconds = {root: defaultdict(float) for root in checkouts}
    for root, some in found.items():
        for name, answer in some.items():
            seconds[root][name.partition("/")[0]] += answer["seconds"]
    for group, own in sorted(seconds[ROOT].items()):
        ratio = "".join(
            f", {own / seconds[root][group]:.3f} times those beside" for root in checkouts[1:]
        )
        print(f"{group}: {own:.1f} CPU seconds{ratio}")
    print(
        f"{len(wanted)} cases on {given.ranks} rank{'s' * (given.ranks > 1)}, {count} with a "
        "difference"
    )
    return int(count > 0 and not given.record)


if __name__ == "__main__":
    sys.exit(main())
