"""How often ``judge`` is right: results of CalculiX of decks as they are and of changed ones, against the decks.

    python3 tests/support/judged_decks.py make DIR       # needs ccx, and nothing of the package
    ./env python3 tests/support/judged_decks.py DIR     # needs the package, and no ccx

A *shelf* is clamped on its left and bent down onto a rigid plate, a *press* is pushed along a plate with friction, a
*stack* is two elastic bodies, of which the upper one is pressed.
"""

import json
import re
import subprocess
import sys
from itertools import product
from pathlib import Path

CORNERS = {2: ((0, 0), (1, 0), (1, 1), (0, 1))}
CORNERS[3] = (*((*c, 0) for c in CORNERS[2]), *((*c, 1) for c in CORNERS[2]))
EDGES = {2: ((0, 1), (1, 2), (2, 3), (3, 0))}
EDGES[3] = (*EDGES[2], (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
UPPER = {2: "S3", 3: "S2"}
BASE = {"young": 1000.0, "pressure": 1.0, "gap": 0.02, "friction": 0.3, "below": 3000.0, "along": 0.01, "down": 0.03}


def box(element, cells, low, high, first):
    """Nodes, elements and the sides of a box, whose numbers begin with ``first``."""
    dim, quadratic = len(cells), re.sub(r"\D", "", element.removeprefix("C3D")).startswith(("8", "20"))
    quadratic = quadratic and not element.startswith("C3D8")
    nodes, elements, numbers = {}, {}, {}

    def node(at):
        if at not in numbers:
            numbers[at] = first + len(numbers)
            shares = zip(at, cells, low, high, strict=True)
            nodes[numbers[at]] = [a + k / (2 * n) * (b - a) for k, n, a, b in shares]
        return numbers[at]

    faces = {"LOWER": [], "UPPER": []}
    for number, cell in enumerate(product(*(range(n) for n in reversed(cells))), start=first):
        base = cell[::-1]
        corners = [tuple(2 * (b + c) for b, c in zip(base, corner, strict=True)) for corner in CORNERS[dim]]
        middles = [tuple((p + q) // 2 for p, q in zip(corners[a], corners[b], strict=True)) for a, b in EDGES[dim]]
        elements[number] = [node(at) for at in (*corners, *(middles if quadratic else ()))]
        faces["LOWER"] += [f"{number}, S1"] * (base[-1] == 0)
        faces["UPPER"] += [f"{number}, {UPPER[dim]}"] * (base[-1] == cells[-1] - 1)
    sides = {"LEFT": [n for at, n in numbers.items() if at[0] == 0]}
    sides |= {"TOP": [n for at, n in numbers.items() if at[-1] == 2 * cells[-1]]}
    sides |= {"BOTTOM": [n for at, n in numbers.items() if at[-1] == 0], "ALL": list(nodes)}
    return nodes, elements, faces, sides


def text_of(kind, element, cells, steps=1, settled=False, **values):
    """A deck."""
    now, dim, lines = BASE | values, len(cells), []
    gap, wide = now["gap"] if kind == "shelf" else 0.0, (0.25,) * (dim - 2)
    upper = box(element, cells, (1.0, *(0.0,) * (dim - 1)), (3.0, *(1.0,) * (dim - 2), 0.5), 1)
    start = max(*upper[0], *upper[1]) + 100
    below = tuple(n + 1 for n in cells) if kind == "stack" else (1,) * dim
    low = (0.75, *(-w for w in wide), -0.5 - gap), (3.25, *(1 + w for w in wide), -gap)
    for name, part in (("BODY", upper), ("BASE", box(element, below, *low, start))):
        nodes, elements, faces, sides = part
        lines += ["*NODE", *(f"{n}, {', '.join(map(repr, x))}" for n, x in nodes.items())]
        lines.append(f"*ELEMENT, TYPE={element}, ELSET={name}")
        for number, members in elements.items():
            words = [f"{word}," for word in (number, *members)]
            lines += [" ".join(words[:11]), *([" ".join(words[11:])] * bool(words[11:]))]
        for side, rows in faces.items():
            lines += [f"*SURFACE, NAME={name}_{side}", *rows]
        for side, rows in sides.items():
            lines += [f"*NSET, NSET={name}_{side}_N", *(f"{n}," for n in rows)]
    for name, young in (("BODY", now["young"]), ("BASE", now["below"])):
        lines += [f"*MATERIAL, NAME=M{name}", "*ELASTIC", f"{young!r}, 0.3"]
        lines.append(f"*SOLID SECTION, ELSET={name}, MATERIAL=M{name}")
    lines += ["*SURFACE INTERACTION, NAME=S", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", "1e5"]
    lines += ["*FRICTION", f"{now['friction']!r}, 1e5"] if kind == "press" and now["friction"] else []
    lines += ["*CONTACT PAIR, INTERACTION=S, TYPE=SURFACE TO SURFACE", "BODY_LOWER, BASE_UPPER", "*BOUNDARY"]
    lines.append(f"BASE_{'BOTTOM' if kind == 'stack' else 'ALL'}_N, 1, {dim}")
    lines += [f"BODY_LEFT_N, 1, {dim if kind == 'shelf' else dim - 1}"] * (kind != "press")
    for step in range(1, steps + 1):
        share = step / steps
        lines += ["*STEP, INC=100", "*STATIC", "1., 1."]
        if kind == "press":
            lines += ["*BOUNDARY", f"BODY_TOP_N, 1, 1, {share * now['along']!r}"]
            lines += [f"BODY_TOP_N, {dim}, {dim}, {-share * now['down']!r}"]
            lines += ["BODY_TOP_N, 2, 2"] * (dim == 3)
        else:
            lines += ["*BOUNDARY", f"BODY_LEFT_N, {dim}, {dim}, -0.01"] * settled
            lines += ["*DSLOAD", f"BODY_UPPER, P, {share * now['pressure']!r}"]
        lines += ["*NODE PRINT, NSET=BODY_ALL_N", "U", "*NODE PRINT, NSET=BASE_ALL_N", "U", "*END STEP"]
    return "\n".join(lines) + "\n"


def cases():
    """Name, deck, deck that is solved in its place, change of the displacement, and what is right."""
    plane = [("CPE4", (12, 4)), ("CPE4R", (16, 6)), ("CPS4", (12, 4)), ("CPE8", (6, 2)), ("CPE8R", (6, 2))]
    plane += [("CPS8R", (8, 3)), ("CAX8R", (6, 2)), ("CAX4", (12, 4)), ("CPE4", (24, 8)), ("CPE8R", (12, 4))]
    space = [("C3D8", (6, 2, 3)), ("C3D8I", (6, 2, 3)), ("C3D20R", (3, 1, 2))]
    other = {"CPE4": "CPE4R", "CPE8": "CPE8R", "CPE8R": "CPE8", "CPS8R": "CPS8", "C3D8": "C3D8I", "CAX8R": "CAX8"}
    for kind, (element, cells) in product(("shelf", "press", "stack"), plane + space):
        deck = {"kind": kind, "element": element, "cells": cells}
        yield "good", deck, deck, "", "agrees"
        if element in other:
            yield "element", deck, deck | {"element": other[element]}, "", "agrees"
    changes = {
        "shelf": [("force", {"pressure": 1.5}, "load"), ("gap", {"gap": 0.05}, "gap|penetration|tension|complement"),
                  ("modulus", {"young": 700.0}, "moduli"), ("support", {"settled": True}, "supports")],
        "press": [("no friction", {"friction": 0.0}, "friction"), ("friction / 3", {"friction": 0.1}, "friction"),
                  ("support", {"down": 0.035}, "supports")],
        "stack": [("force", {"pressure": 0.8}, "load"), ("modulus", {"below": 1000.0}, "modul")],
    }  # fmt: skip
    for kind, (element, cells) in product(changes, [plane[5], *plane[7:], plane[1], space[0]]):
        deck = {"kind": kind, "element": element, "cells": cells}
        for name, change, right in changes[kind]:
            yield name, deck, deck | change, "", right
        if element in ("CPE4", "CPE8R"):
            yield "units", deck, deck, "v * 1000", "units"
            half = {"pressure": 0.5, "along": 0.005, "down": 0.015}
            yield "step", deck | {"steps": 2}, deck | half, "", "step|supports"
            yield "node", deck, deck, "node", "violates"


def make(folder):
    """Solve all, and list them."""
    listed = []
    for number, (name, deck, solved, change, right) in enumerate(cases()):
        job = folder / f"{number:03d}"
        (folder / f"{number:03d}.inp").write_text(text_of(**solved))
        subprocess.run(["ccx", job.name], cwd=folder, capture_output=True, check=False, timeout=100)
        job.with_suffix(".inp").write_text(text_of(**deck))
        listed.append([job.name, name, f"{deck['kind']} {deck['element']} {deck['cells']}", change, right])
    (folder / "cases.json").write_text(json.dumps(listed))


def main(folder, *names):
    """Judge all, or those of some names, and print a line for each."""
    from signorini_fx.addons.judging.calculix_results import read_dat
    from signorini_fx.addons.judging.judge import judge

    right, count = {}, {}
    for job, name, deck, change, wanted in json.loads((folder / "cases.json").read_text()):
        result = folder / f"{job}.dat"
        if names and job not in names:
            continue
        if change or name == "step":
            result = {node: row for node, (row, _) in read_dat(result).displacement.items()}
            largest = max(abs(x) for row in result.values() for x in row)
            middle = len(result) // 3
            for place, row in enumerate(result.values()):
                row[:] = [1000 * x for x in row] if name == "units" else row
                row[0] += 0.1 * largest * (name == "node" and place == middle)
        judgement = judge(folder / f"{job}.inp", result)
        said, key = f"{judgement.word}: {judgement.reason}", "good" if wanted == "agrees" else "spoiled"
        count[key] = count.get(key, 0) + 1
        right[key] = right.get(key, 0) + (found := bool(re.search(wanted, said)))
        print("    " if found else "NOT ", job, name, deck, said, judgement.figures.get("distance"), flush=True)
    print({key: f"{right[key]} of {count[key]}" for key in count})


if __name__ == "__main__":
    make(Path(sys.argv[2])) if sys.argv[1] == "make" else main(Path(sys.argv[1]), *sys.argv[2:])
