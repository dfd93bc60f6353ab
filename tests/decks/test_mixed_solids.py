"""Decks of bricks with some wedges, whose cells are divided into hexahedra."""

import itertools

import numpy as np
import pytest
from deck_lines import STEEL
from test_tables import solved

from signorini_fx.addons.decks.deck import read_deck
from signorini_fx.errors import MeshError

CORNERS = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
HALVES = [(0, 1, 2, 4, 5, 6), (2, 3, 0, 6, 7, 4)]


def bricks(name, shape, size, first=1, corner=(0.0, 0.0, 0.0), halved=()):
    """Nodes, elements, surfaces and sets of a box; bricks in some planes across x are two wedges each."""
    numbers = {at: first + k for k, at in enumerate(itertools.product(*(range(n + 1) for n in shape)))}
    lines = ["*NODE"]
    for at, number in numbers.items():
        x = [c + s * k / n for c, s, k, n in zip(corner, size, at, shape, strict=True)]
        lines.append(f"{number}, {', '.join(f'{value:.12g}' for value in x)}")
    rows = {"C3D8": [], "C3D6": []}
    low, high = [], []
    for number, (i, j, k) in enumerate(itertools.product(*map(range, shape))):
        nodes = [numbers[i + a, j + b, k + c] for a, b, c in CORNERS]
        for part, own in enumerate(HALVES if i in halved else [range(8)]):
            element = first + 2 * number + part
            rows["C3D8" if i not in halved else "C3D6"].append([element, *(nodes[n] for n in own)])
            low += [f"{element}, S1"] * (k == 0)
            high += [f"{element}, S2"] * (k == shape[2] - 1)
    for kind, elements in rows.items():
        if elements:
            lines += [f"*ELEMENT, TYPE={kind}, ELSET={name}", *(", ".join(map(str, row)) for row in elements)]
    lines += [f"*SURFACE, NAME={name}_LOW", *low, f"*SURFACE, NAME={name}_HIGH", *high]
    sides = {"WALL": 0, "FEET": 2}
    for side, axis in sides.items():
        held = [str(number) for at, number in numbers.items() if at[axis] == 0]
        lines += [f"*NSET, NSET={name}_{side}", *held]
    head = [str(number) for at, number in numbers.items() if at[2] == shape[2]]
    lines += [f"*NSET, NSET={name}_HEAD", *head, f"*SOLID SECTION, ELSET={name}, MATERIAL=STEEL"]
    return lines, numbers


def test_a_shelf_beside_calculix(tmp_path):
    """A shelf that is clamped on one side and lies on a rigid block on the other bears as much there as CalculiX 2.20
    finds with bricks a third as long (C3D8I): 4.172.  With the bricks and wedges of this deck it has 4.254 itself; cut
    into tetrahedra of degree 1 they give 4.283.
    """
    shelf, _ = bricks("SHELF", (12, 4, 3), (3.0, 1.0, 0.6), halved=(1, 5, 9))
    block, _ = bricks("BLOCK", (4, 3, 1), (1.6, 1.2, 0.5), 1001, (1.6, -0.1, -0.5))
    lines = [*shelf, *block, *STEEL[:2], "1000., .3", "*SURFACE INTERACTION, NAME=I"]
    lines += ["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", "1.e6"]
    lines += ["*CONTACT PAIR, INTERACTION=I, TYPE=SURFACE TO SURFACE", "SHELF_LOW, BLOCK_HIGH"]
    lines += ["*NSET, NSET=BLOCK, GENERATE", "1001, 1040", "*BOUNDARY", "SHELF_WALL, 1, 3", "BLOCK, 1, 3"]
    lines += ["*STEP", "*STATIC", "*DSLOAD", "SHELF_HIGH, P, 2.0"]
    lines += ["*NODE PRINT, NSET=BLOCK, TOTALS=ONLY", "RF", "*END STEP"]
    (total,) = solved(tmp_path, lines)[0].values()
    assert total[0][2] == pytest.approx(4.172, rel=0.01)


def test_a_number_without_its_keyword_in_space(tmp_path):
    """*SURFACE INTERACTION has a thickness in the plane alone, and not a stiffness whose keyword is missing."""
    lines, _ = bricks("BLOCK", (1, 1, 1), (1.0, 1.0, 1.0))
    (tmp_path / "deck.inp").write_text("\n".join([*lines, *STEEL, "*SURFACE INTERACTION, NAME=I", "1.e6"]) + "\n")
    with pytest.raises(MeshError, match=r"\*SURFACE INTERACTION: data line 1, '1.e6', is one too many"):
        read_deck(tmp_path / "deck.inp")


def test_forces_at_nodes(tmp_path):
    """As a pressure gives them to nodes between bricks and wedges: they are one, and the nodes of the other side bear
    them, those between the nodes of the file included.
    """
    lines, numbers = bricks("BODY", (4, 2, 2), (2.0, 1.0, 1.0), halved=(1,))
    forces = dict.fromkeys(numbers.values(), 0.0)
    for i, j in itertools.product(range(4), range(2)):
        corners = [numbers[i + a, j + b, 2] for a, b, c in CORNERS if c]
        for half in ((0, 1, 2), (2, 3, 0)) if i == 1 else ((0, 1, 2, 3),):
            for n in half:
                forces[corners[n]] -= 0.25 * (1.0 if i != 1 else 0.5) / len(half)
    lines += [*STEEL, "*BOUNDARY", "BODY_FEET, 3", "1, 1, 2", f"{numbers[4, 0, 0]}, 2", "*STEP", "*STATIC", "*CLOAD"]
    lines += [f"{node}, 3, {force}" for node, force in forces.items() if force]
    lines += ["*NODE PRINT, NSET=BODY_FEET", "RF", "*NODE PRINT, NSET=BODY_HEAD", "U", "*END STEP"]
    feet, head = solved(tmp_path, lines)[0].values()
    np.testing.assert_allclose([f[2] for f in feet.values()], [-forces[n + 2] for n in feet], atol=1e-6)
    np.testing.assert_allclose([u[2] for u in head.values()], -1.0 / 1000.0, rtol=1e-5)
