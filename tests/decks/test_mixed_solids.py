"""Decks of bricks, and of bricks with some wedges."""

import itertools

import pytest
from deck_lines import STEEL

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


def test_bricks_beside_wedges(tmp_path):
    """They are refused with what makes tetrahedra of them."""
    lines, _ = bricks("BODY", (4, 2, 2), (2.0, 1.0, 1.0), halved=(1,))
    (tmp_path / "deck.inp").write_text("\n".join([*lines, *STEEL]) + "\n")
    with pytest.raises(MeshError, match="12 hexahedron, 8 wedge: tetrahedra are made of all by gmsh"):
        read_deck(tmp_path / "deck.inp")


def test_a_number_without_its_keyword_in_space(tmp_path):
    """*SURFACE INTERACTION has a thickness in the plane alone, and not a stiffness whose keyword is missing."""
    lines, _ = bricks("BLOCK", (1, 1, 1), (1.0, 1.0, 1.0))
    (tmp_path / "deck.inp").write_text("\n".join([*lines, *STEEL, "*SURFACE INTERACTION, NAME=I", "1.e6"]) + "\n")
    with pytest.raises(MeshError, match=r"\*SURFACE INTERACTION: data line 1, '1.e6', is one too many"):
        read_deck(tmp_path / "deck.inp")
