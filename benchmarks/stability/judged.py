"""Results of CalculiX for ``signorini-fx judge``: 60 good ones, and 60 of another deck or changed
afterwards.

    python3 -m benchmarks.stability.judged run FOLDER                       # where ccx is: decks
    and their results ./env python3 -m benchmarks.stability.judged judge FOLDER
    docs/evidence/judged.csv

A spoiled result is named if the verdict is not *agrees*, and if its words name the load, support,
node ... that is another one, and its value to 10 %; of friction, whether it is larger: what sticks
does not show by how much.
"""

import argparse
import csv
import re
import subprocess
import tomllib
from pathlib import Path
from typing import Any

import numpy as np

DATA = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
SEED, COUNT, SECONDS, NUMBER = 2026, 60, "120", r"([-+]?\d[-+.\de]*)"
KINDS = ("force", "friction", "support", "gap", "modulus", "units", "step", "node")
NEEDED = {"force": "loads", "friction": "friction", "modulus": "loads", "support": "held"}


def drawn(number: int, kind: str) -> tuple[Any, ...]:
    """A problem, the one that is run instead, what is spoiled, and the words and the value that
    name it.
    """
    rng = np.random.default_rng([SEED, number, len(kind)])
    fit = [name for name, own in DATA["problem"].items() if own.get(NEEDED.get(kind, "cells"))]
    name = fit[number // (len(KINDS) if kind else 1) % len(fit)]
    own = DATA["default"] | DATA["problem"][name] | {"name": name}
    own["element"] = str(rng.choice(own["elements"].split()))
    finer = rng.choice([0.7, 1.0, 1.5] if len(own["cells"]) == 3 else [0.7, 1.0, 1.6, 2.2])
    own["cells"] = [max(2, round(finer * n)) for n in own["cells"]]
    own["loads"] = {side: value * rng.uniform(0.7, 1.4) for side, value in own["loads"].items()}
    own["length"], own["young"] = (
        float(rng.choice([1e-3, 1.0, 100.0])),
        float(rng.choice([1e3, 2.1e5, 7e10])),
    )
    own["moduli"] = {
        "BODY": 1.0,
        "BASE": float(rng.choice([0.5, 1.0, 3.0])) if own["base_cells"] else 1.0,
    }
    run, turn, side, said, words, value = (
        own,
        number // len(KINDS) % 2,
        own["pair"][0],
        "",
        "",
        None,
    )
    if kind == "force":
        said, value = str(rng.choice(list(own["loads"]))), 1.2
        words = (
            f"its loads are {NUMBER} times"
            if len(own["loads"]) == 1
            else f"on {said} is {NUMBER} times"
        )
        run = own | {"loads": own["loads"] | {said: value * own["loads"][said]}}
    elif kind == "friction" and turn:
        said, words = "turned round", "friction is not that of the slip"
    elif kind == "friction":
        value = own["friction"] * float(rng.choice([0.5, 2.0]))
        run, said, words = own | {"friction": value}, f"{value:g}", f"{side} is {NUMBER}, not"
    elif kind == "support":
        said = str(rng.choice(list(own["held"])))
        held = {
            key.replace("_N", "_H") if key == said else key: u for key, u in own["held"].items()
        }
        run, words = own | {"held": held}, f"is moved by .* along {said[-1]}, prescribed"
    elif kind == "gap":
        value = own["slack"] * own["length"]
        run, said = own | {"gap": own["gap"] + own["slack"]}, f"{value:+g}"
        words = f"gap of {side} is larger by {NUMBER}|enter each other|across an open gap"
    elif kind == "modulus":
        value, said = (
            float(rng.choice([0.7, 1.3])),
            ("BODY", "BASE")[int(rng.integers(2)) if own["base_cells"] else 0],
        )
        run = own | {"moduli": own["moduli"] | {said: value * own["moduli"][said]}}
        words = f"(?:moduli|modulus of {said} is) {NUMBER} times"
    elif kind == "units":
        value, said, words = (
            (1e3, 1e-3)[turn],
            ("mm", "km")[turn],
            f"{NUMBER} times the solution: it has other units",
        )
    elif kind == "step":
        own["steps"] = own["steps"] if len(own["steps"]) == 2 else [[0.6, 0.6], [1, 1]]
        run, said = own | {"steps": own["steps"][:1]}, ("first", "first, no time")[turn]
        words = ("ends at time 1,", "end of load step 1")[turn]
    return own, run, said or ("moved", "swapped")[turn], words, value


def grid(counts: list[int], element: str) -> tuple[Any, ...]:
    """Nodes in the unit box, cells in the order of Abaqus, and the corners of their faces."""
    dim, count, shape = (
        len(counts),
        int(re.findall(r"\d+", element)[-1]),
        DATA["cells"][f"{len(counts)}D"],
    )
    x = np.stack(
        np.meshgrid(*[np.linspace(0, 1, n + 1) for n in counts], indexing="ij"), axis=-1
    ).reshape(-1, dim)
    index = np.arange(len(x)).reshape([n + 1 for n in counts])
    from_first = [index[tuple(map(int, corner))] for corner in shape["box"].split()]
    cells = index[tuple(slice(n) for n in counts)].reshape(-1, 1) + from_first
    if count in ((3, 6), (4, 10))[dim - 2]:
        cells = np.concatenate(
            [cells[:, list(map(int, simplex))] for simplex in shape["simplices"].split()]
        )
    if count > (corners := cells.shape[1]):
        edges = np.array([list(map(int, edge)) for edge in shape[f"edges {corners}"].split()])
        ends, middle = np.unique(
            np.sort(cells[:, edges].reshape(-1, 2)), axis=0, return_inverse=True
        )
        cells = np.hstack((cells, len(x) + middle.reshape(len(cells), -1)))
        x = np.concatenate((x, x[ends].mean(axis=1)))
    return x, cells, [list(map(int, face)) for face in shape[f"faces {corners}"].split()]


def deck(own: dict[str, Any]) -> str:
    """The input file of a problem."""
    dim, lines, node, element, away = len(own["cells"]), [], 1, 1, own["gap"]
    for name, counts in ("BODY", own["cells"]), ("BASE", own["base_cells"] or [1] * dim):
        (low, extent), (unit, cells, faces) = own[name.lower()], grid(counts, own["element"])
        x = np.array(low) + unit * extent
        if name == "BASE":
            x += [0] * (dim - 1) + [-away] if own["pair"][1] == "BASE_TOP" else [away, 0]
        else:  # no cell is a box
            x[:, 0] += (
                0.03 * extent[0] * np.sin(np.pi * unit[:, 0]) * np.sin(2 * np.pi * unit[:, -1])
            )
            x[:, -1] += own["bend"] * (x[:, 0] - low[0]) ** 2 * (1 - unit[:, -1])
        rows = [", ".join(f"{value:.10g}" for value in row) for row in (own["length"] * x).tolist()]
        lines += ["*NODE", *(f"{n}, {row}" for n, row in enumerate(rows, node))]
        lines += [f"*ELEMENT, TYPE={own['element']}, ELSET={name}"]
        for k, row in enumerate((cells + node).tolist(), element):  # up to 16 entries a line
            words = list(map(str, [k, *row]))
            lines += (
                [", ".join(words)]
                if len(words) < 17
                else [", ".join(words[:16]) + ",", ", ".join(words[16:])]
            )
        for side, (axis, end) in DATA["cells"][f"{dim}D"]["sides"].items():
            on = np.isclose(unit[:, axis], end)
            for label, nodes in (
                (f"{name}_{side}_N", on),
                (f"{name}_{side}_H", on & (unit[:, axis - 1] > 0.5)),
            ):
                lines += [
                    f"*NSET, NSET={label}",
                    *(f"{node + n}," for n in np.flatnonzero(nodes).tolist()),
                ]
            lines.append(f"*SURFACE, NAME={name}_{side}")
            for number, face in enumerate(faces, 1):
                lines += [
                    f"{element + k}, S{number}"
                    for k in np.flatnonzero(on[cells[:, face]].all(axis=1)).tolist()
                ]
        lines += [
            f"*NSET, NSET={name}_N, GENERATE",
            f"{node}, {node + len(x) - 1}",
            f"*MATERIAL, NAME=M_{name}",
        ]
        lines += ["*ELASTIC", f"{own['moduli'][name] * own['young']:.10g}, 0.3"]
        lines += [f"*SOLID SECTION, ELSET={name}, MATERIAL=M_{name}", *(["1."] if dim == 2 else [])]
        node, element = node + len(x), element + len(cells)
    slope = (
        50
        * own["young"]
        * max(own["moduli"].values())
        * own["cells"][-1]
        / own["body"][1][-1]
        / own["length"]
    )
    lines += [
        "*SURFACE INTERACTION, NAME=S",
        "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR",
        f"{slope:.10g}",
    ]
    lines += ["*FRICTION", f"{own['friction']:.10g}, {0.1 * slope:.10g}"] if own["friction"] else []
    lines += [
        f"*CONTACT PAIR, INTERACTION=S, TYPE={own['contact']}",
        ", ".join(own["pair"]),
        "*BOUNDARY",
    ]
    lines += [] if own["base_cells"] else [f"BASE_N, 1, {dim}"]
    held = [(key[:-2], "xyz".index(key[-1]) + 1, u) for key, u in own["held"].items()]
    lines += [f"{nodes}, {axis}, {axis}" for nodes, axis, _ in held]
    times = (
        "0.1, 1., 1e-5, 0.1" if own["friction"] else "1., 1."
    )  # friction is not satisfied after one large increment
    for load, move in own["steps"]:
        lines += ["*STEP, INC=1000", "*STATIC", times, "*BOUNDARY"]
        lines += [
            f"{nodes}, {axis}, {axis}, {move * u * own['length']:.10g}" for nodes, axis, u in held
        ]
        lines += ["*DSLOAD"] * bool(own["loads"])
        lines += [
            f"{side}, P, {load * value * own['young']:.10g}" for side, value in own["loads"].items()
        ]
        lines += [
            "*NODE PRINT, NSET=BODY_N",
            "U",
            "*NODE PRINT, NSET=BASE_N",
            "U",
            "*NODE FILE",
            "U",
            "*END STEP",
        ]
    return "\n".join(lines) + "\n"


def spoiled(said: str, rng: Any, problem: Any, v: Any) -> tuple[Any, list[int]]:
    """Displacements that are changed, and the numbers of the nodes where they are."""
    from signorini_fx.addons.judging.judged_problem import SolutionOnMesh

    ours, v = SolutionOnMesh.of(problem, problem.arrays), v.copy()
    if (
        said == "turned round"
    ):  # forces of friction have the other sign, and what presses does not enter
        contact, free = ours.solution.contact, ~ours.held.ravel()
        side, at = (
            contact.boundary,
            ours.points_of_contact.toarray().reshape(*contact.boundary.normal.shape, -1),
        )
        shear = np.einsum("n,nij,nj,nik->k", side.weight, side.tangents, contact.shear, at)[free]
        pressed = np.einsum("n,ni,nik->nk", side.weight**0.5, side.normal, at)[
            contact.pressure > 0
        ][:, free]
        stiffness = (
            ours.stiffness.toarray()[free][:, free]
            + problem.scene.solver.gamma_n * pressed.T @ pressed
        )
        change = np.zeros(free.size)
        change[free] = np.linalg.solve(stiffness, 2 * shear)
        return v + change.reshape(-1, v.shape[1])[: len(v)], []
    free, largest = np.flatnonzero(~ours.held[: len(v)].any(axis=1)), np.abs(v).max()
    one = two = rng.choice(free)
    if said == "moved":
        v[one, rng.integers(v.shape[1])] += 0.1 * largest
    else:
        two = rng.choice(free[np.abs(v[free] - v[one]).max(axis=1) > 0.1 * largest])
        v[[one, two]] = v[[two, one]]
    return v, sorted({int(problem.names[node]) for node in (one, two)})


def judged(folder: Path, name: str, kind: str, number: int) -> tuple[str, ...]:
    """The row of a run."""
    from signorini_fx.addons.judging.judge import AGREES, judge
    from signorini_fx.addons.judging.judged_problem import judged_problem, read_result

    stated, _, said, words, value = drawn(number, kind)
    file, result = (
        folder / f"{name}.inp",
        folder / f"{name}_run.{'dat' if kind or number % 4 < 3 else 'frd'}",
    )
    if kind in ("units", "node") or said in (
        "turned round",
        "first, no time",
    ):  # from here on an array, of no time
        problem = judged_problem(file)
        result = read_result(result, problem).displacement * (value if kind == "units" else 1.0)
        if kind not in ("units", "step"):
            result, nodes = spoiled(said, np.random.default_rng([SEED, number]), problem, result)
            said = " ".join([said, *map(str, nodes)])
            words = words or f"node (?:{'|'.join(map(str, nodes))}) "
    judgement = judge(file, result)
    found, tolerance = re.search(words, judgement.reason), 0.5 if kind == "friction" else 0.1
    near = found and (
        value is None or not found[found.re.groups] or abs(float(found[1]) / value - 1) < tolerance
    )
    right = (judgement.word == AGREES) != bool(kind) and bool(near)
    about = (
        stated["name"],
        stated["element"],
        "x".join(map(str, stated["cells"])),
        f"{kind}: {said}" if kind else "",
    )
    return *about, judgement.word, judgement.reason, ("no", "yes")[right]


def main(what: str, folder: Path, file: str = "") -> None:
    """Run ccx, or judge its results."""
    rows = [("problem", "element", "cells", "change", "verdict", "words", "right")]
    for k in range(2 * COUNT):
        number, kind = k % COUNT, KINDS[k % len(KINDS)] if k >= COUNT else ""
        name = f"{number}{kind}"
        if what == "judge":
            if (folder / f"{name}.inp").exists():
                rows.append(judged(folder, name, kind, number))
                print(number, *rows[-1], sep=", ", flush=True)
        else:
            stated, run, *_ = drawn(number, kind)
            (folder / f"{name}.inp").write_text(deck(stated))
            (folder / f"{name}_run.inp").write_text(deck(run))
            command = ["timeout", SECONDS, "ccx", "-i", f"{name}_run"]
            printed = subprocess.run(command, cwd=folder, stdout=subprocess.PIPE, check=False)
            if b"Job finished" not in printed.stdout:
                print(name, stated["name"], stated["element"], "ccx has not solved it")
                (folder / f"{name}.inp").unlink()
    if file:
        with Path(file).open("w", newline="", encoding="utf-8") as stream:
            csv.writer(stream, lineterminator="\n").writerows(rows)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n\n")[0])
    parser.add_argument("what", choices=("run", "judge"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("file", nargs="?", default="")
    main(**vars(parser.parse_args()))
