"""Shells without thickness on a flat side of a body: in a scene only the area on which their pressure acts."""

import numpy as np
import pytest
from deck_lines import STEEL
from mpi4py import MPI

from signorini_fx.addons.decks.draft import draft
from signorini_fx.errors import MeshError
from signorini_fx.scenes.reading import read_scene
from signorini_fx.scenes.solver import solve

# The inner part of the top of a cube, and what it is loaded with.
CORNERS = ((0.2, 0.3), (0.2, 0.7), (0.6, 0.7), (0.6, 0.3))
AREA, PRESSURE = 0.4 * 0.4, 5.0
CUBE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)]
EDGES = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]


def cube(*, degree=1, thickness=1e-12, height=1.0, corners=CORNERS, tie=True, shells="S4"):
    """A cube held at its foot, with a shell on its top that is pressed; both shells of S3 are its halves."""
    points = [*CUBE, *(np.mean([CUBE[a], CUBE[b]], axis=0).tolist() for a, b in EDGES)][: 8 if degree == 1 else 20]
    nodes = [f"{number}, {', '.join(map(str, x))}" for number, x in enumerate(points, start=1)]
    nodes += [f"{101 + k}, {x}, {y}, {height}" for k, (x, y) in enumerate(corners)]
    kind, numbers = ("C3D8", 8) if degree == 1 else ("C3D20", 20)
    cell = ", ".join(map(str, range(1, numbers + 1)))
    elements = {"S4": ["2, 101, 102, 103, 104"], "S3": ["2, 101, 102, 103", "3, 101, 103, 104"]}[shells]
    lines = ["*NODE", *nodes, f"*ELEMENT, TYPE={kind}, ELSET=CUBE"]
    lines += (
        [f"1, {cell}"] if degree == 1 else [f"1, {', '.join(cell.split(', ')[:12])},", ", ".join(cell.split(", ")[12:])]
    )
    lines += [f"*ELEMENT, TYPE={shells}, ELSET=PATCH", *elements]
    lines += ["*SURFACE, NAME=TOP", "1, S2", "*SURFACE, NAME=FOOT", "1, S1"]
    lines += ["*SURFACE, NAME=UNDER", *(f"{row.split(',')[0]}, S1" for row in elements)]
    lines += ["*NSET, NSET=HELD", "1, 2, 3, 4" + (", 9, 10, 11, 12" if degree == 2 else ""), *STEEL]
    lines += ["*SOLID SECTION, ELSET=CUBE, MATERIAL=STEEL"]
    lines += ["*SHELL SECTION, ELSET=PATCH, MATERIAL=STEEL", f"{thickness}"]
    bonded = ["*SURFACE INTERACTION, NAME=S", "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=TIED", "1e9"]
    bonded += ["*CONTACT PAIR, INTERACTION=S, TYPE=SURFACE TO SURFACE", "UNDER, TOP"]
    lines += ["*TIE, NAME=T", "UNDER, TOP"] if tie else bonded
    return [*lines, "*BOUNDARY", "HELD, 1, 3", "*STEP", "*STATIC", "*DLOAD", f"PATCH, P, {PRESSURE}", "*END STEP"]


def drafted(folder, lines):
    """The draft."""
    file, target = folder / "deck.inp", folder / "deck.toml"
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    made = draft(file, target)
    for path, text in made.files.items():
        path.write_text(text, encoding="utf-8")
    return made, target


@pytest.mark.parametrize("shells", ["S4", "S3"])
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("tie", [True, False])
def test_the_force_of_an_area(tmp_path, degree, tie, shells):
    """Its size, along the normal around which the corners go, and where it acts."""
    made, target = drafted(tmp_path, cube(degree=degree, tie=tie, shells=shells))
    assert made.lost == []
    assert any("only the area" in remark for remark in made.noted)
    solution = solve(read_scene(target), MPI.COMM_SELF, check=False)
    assert solution.certificate.holds
    force = solution.resultants.of("TOP")
    size = AREA * PRESSURE
    np.testing.assert_allclose(force.force, [0.0, 0.0, -size], atol=1e-9)
    middle = np.array([0.4, 0.5, 1.0])
    np.testing.assert_allclose(force.moment, np.cross(middle, [0.0, 0.0, -size]), atol=1e-9)


@pytest.mark.parametrize(
    "changes",
    [
        {"thickness": 0.1},
        {"height": 1.2},
        {"corners": ((0.2, 0.3), (0.2, 0.7), (1.6, 0.7), (1.6, 0.3))},
        {"corners": ((0.2, 0.3), (0.6, 0.7), (0.2, 0.7), (0.6, 0.3))},
    ],
)
def test_other_shells_are_lost(tmp_path, changes):
    """Those with stiffness, beside the side, or folded."""
    made, _ = drafted(tmp_path, cube(**changes))
    assert any("shells, which are no part of the body" in remark for remark in made.lost)
    assert any("*DLOAD" in remark for remark in made.lost)


def test_a_thickness_that_is_none(tmp_path):
    """One error with its line."""
    lines = cube(thickness="thin")
    with pytest.raises(MeshError, match=rf"line {lines.index('thin')}, \*SHELL SECTION: thickness: could not convert"):
        drafted(tmp_path, lines)


def test_a_load_without_its_kind(tmp_path):
    """It is lost, and that of the area stays."""
    made, target = drafted(tmp_path, [*cube()[:-1], "PATCH", "*END STEP"])
    assert [remark.partition("*DLOAD")[2] for remark in made.lost] == [": load PATCH"]
    assert read_scene(target).traction[0].z is not None
