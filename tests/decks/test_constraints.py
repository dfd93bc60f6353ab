"""Equations, couplings, ties of nodes, cyclic symmetry, and directions of nodes in decks: exact states and statics."""

import csv
import re
import tomllib

import numpy as np
import pytest
from deck_lines import POISSON, STEEL, YOUNG, squares, stacked
from mpi4py import MPI

from signorini_fx.addons.decks.draft import draft
from signorini_fx.errors import MeshError
from signorini_fx.results.solution import ConvergenceError
from signorini_fx.scenes.reading import read_scene
from signorini_fx.scenes.solver import solve

STIFF = ["*MATERIAL, NAME=STEEL", "*ELASTIC", f"{YOUNG}, 0."]  # bars have no Poisson's effect
END = "*END STEP"


def drafted(folder, lines, name="deck"):
    """What was drafted, and the scene as data; its files are written."""
    deck = folder / f"{name}.inp"
    deck.write_text("\n".join(lines) + "\n", encoding="utf-8")
    made = draft(deck, folder / f"{name}.toml")
    for file, text in made.files.items():
        file.write_text(text, encoding="utf-8")
    return made, tomllib.loads(made.text)


def solved(folder, lines, name="deck"):
    """The solution of a deck of which nothing is lost."""
    made, _ = drafted(folder, lines, name)
    assert made.lost == []
    return solve(read_scene(folder / f"{name}.toml"), MPI.COMM_SELF)


def moved(solution, dim=2):
    """Places of the nodes and their displacements."""
    u = solution.displacement
    return u.function_space.tabulate_dof_coordinates()[:, :dim], u.x.array.reshape(-1, dim)


def column(constraint, loads, material=STIFF):
    """A block of squares, 1 x 1, that stands on its feet."""
    lines = [*squares(4, 2), "*SOLID SECTION, ELSET=BODY, MATERIAL=STEEL", *material, "*NODE", "900, 0.75, 1.5"]
    return [*lines, *constraint, "*BOUNDARY", "BODY_FEET, 2", "1, 1", "*STEP", "*STATIC", *loads, END]


# --- equations -------------------------------------------------------------------------------------------------------


def test_equations_keep_a_head_flat(tmp_path):
    """A force at one node of the head shortens the column as an even one: F L / E A at all of its nodes."""
    flat = [line for n in (12, 13, 14, 15) for line in ("2", f"{n}, 2, 1., 11, 2, -1.")]
    solution = solved(tmp_path, column(["*EQUATION", *flat], ["*CLOAD", "13, 2, -7."]))
    x, u = moved(solution)
    np.testing.assert_allclose(u[x[:, 1] > 0.99, 1], -7.0 / YOUNG, rtol=1e-5)
    assert solution.resultants.of("BODY_FEET").force[1] == pytest.approx(7.0, rel=1e-9)


def test_equations_of_several_terms(tmp_path):
    """Terms go on in the next line; a lever: one node sinks by twice what another one does, however they are loaded."""
    solution = solved(
        tmp_path, column(["*EQUATION", "3", "11, 2, 2., 15, 2, -1.,", "13, 1, 1."], ["*CLOAD", "15, 2, -3."])
    )
    x, u = moved(solution)
    first, last, middle = (u[np.argmin(np.linalg.norm(x - at, axis=1))] for at in ((0, 1), (1, 1), (0.5, 1)))
    assert 2 * first[1] - last[1] + middle[0] == pytest.approx(0.0, abs=1e-5 * np.abs(u).max())
    assert abs(first[1]) > 1e-4


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (["2", "11, 2, 1., 12, 2"], "an equation of 2 terms ends after 5 of 6 entries"),
        (["x", "11, 2, 1."], "the number of terms of an equation is expected, not 'x'"),
        (["0"], "the number of terms of an equation is expected, not '0'"),
        (["1", "11, a, 1."], "invalid literal"),
        (["1", "11, 2, nan"], "a finite number is expected"),
    ],
)
def test_equations_that_are_wrong(tmp_path, rows, message):
    """One error with the line of the keyword."""
    lines = column(["*EQUATION", *rows], [])
    with pytest.raises(MeshError) as error:
        drafted(tmp_path, lines)
    assert f"line {lines.index('*EQUATION') + 1}, *EQUATION: " in str(error.value)
    assert message in str(error.value)


def test_equations_with_others(tmp_path):
    """A node that is nothing of the body, and a rotation, are lost."""
    made, data = drafted(tmp_path, column(["*EQUATION", "2", "900, 2, 1., 11, 2, -1.", "1", "11, 6, 1."], []))
    assert [remark.partition(": ")[2] for remark in made.lost] == [
        "an equation with '900': no part of the body",
        "an equation with component 6 of '11': a rotation",
    ]
    assert "links" not in data


def test_constraints_of_several_nodes(tmp_path):
    """*MPC, STRAIGHT: a force in the middle of a head that stays straight shortens the column evenly, F L / E A."""
    solution = solved(tmp_path, column(["*MPC", "STRAIGHT, 11, 15, 12,", "13, 14"], ["*CLOAD", "13, 2, -7."]))
    x, u = moved(solution)
    np.testing.assert_allclose(u[x[:, 1] > 0.99, 1], -7.0 / YOUNG, rtol=1e-5)


def test_a_plane_of_nodes(tmp_path):
    """*MPC, PLANE, of the outside of a ring's sector: its nodes stay in a plane that turns with three of them."""
    lines, number = ring(1)
    side = [number(i, ROWS, k) for k in (0, 1) for i in range(len(RADII))]
    order = [side[k] for k in (0, 2, 3, 1, 4, 5)]
    lines += ["*MPC", f"PLANE, {', '.join(map(str, order))}", "*BOUNDARY", "INNER, 1, 3", "*STEP", "*STATIC"]
    lines += ["*CLOAD", f"{side[1]}, 1, 2.", f"{side[4]}, 3, 1.", END]
    x, u = moved(solved(tmp_path, lines), 3)
    angle = np.pi / 3
    normal = np.array([-np.sin(angle), np.cos(angle), 0.0])
    rows = np.flatnonzero(np.abs(x @ normal) < 1e-9)
    away = u[rows] @ normal
    arms = np.column_stack((np.ones(len(rows)), x[rows] @ [np.cos(angle), np.sin(angle), 0.0], x[rows, 2]))
    left = away - arms @ np.linalg.lstsq(arms, away, rcond=None)[0]
    assert len(rows) == len(side)
    assert np.abs(left).max() < 1e-5 * np.abs(u).max() < 1e-2 * np.abs(u).max()


@pytest.mark.parametrize("kind", ["PIN", "TIE"])
def test_pins(tmp_path, kind):
    """Two blocks that are pinned at coincident nodes: the lower one carries the load of the upper one."""
    lines = [*squares(4, 2, name="LOW"), *squares(4, 2, 101, (0.0, 1.0), name="UP"), *STEEL, "*MPC"]
    lines += [f"{kind}, {101 + k}, {11 + k}" for k in (0, 4)]
    lines += [f"*SOLID SECTION, ELSET={name}, MATERIAL=STEEL" for name in ("LOW", "UP")]
    lines += ["*BOUNDARY", "LOW_FEET, 1, 2", "*STEP", "*STATIC", "*DSLOAD", "UP_TOP, P, 5.", END]
    feet = solved(tmp_path, lines).resultants.of("LOW_FEET")
    np.testing.assert_allclose(feet.force, (0.0, 5.0), atol=1e-7)


@pytest.mark.parametrize("row", ["STRAIGHT, 11, 15", "PLANE, 11, 12, 13, 14", "PIN, 11, 12, 13"])
def test_constraints_that_are_wrong(tmp_path, row):
    """One error with the line of the keyword."""
    with pytest.raises(MeshError, match=r"line \d+, \*MPC: .* expected"):
        drafted(tmp_path, column(["*MPC", row], []))


def test_two_nodes_at_one_place_of_a_body(tmp_path):
    """A slit: a scene cannot name one of them, so that the equation is lost."""
    lines = column(["*EQUATION", "2", "901, 2, 1., 15, 2, -1."], [])
    lines[lines.index("900, 0.75, 1.5")] = "901, 0.25, 1.0"
    lines[lines.index("5, 6, 7, 12, 11")] = "5, 6, 7, 901, 11"
    lost = drafted(tmp_path, lines)[0].lost
    assert any("its body has another node at the same place" in remark for remark in lost)


# --- couplings -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["*DISTRIBUTING", "*KINEMATIC"])
def test_couplings(tmp_path, kind):
    """The ground carries force and moment of the reference node; a kinematic one keeps the head straight."""
    lines = column(
        ["*COUPLING, REF NODE=900, SURFACE=BODY_TOP, CONSTRAINT NAME=C", kind, "1, 2"],
        ["*CLOAD", "900, 1, 2.", "900, 2, -5.", "900, 6, 0.5"],
        STEEL,
    )
    lines[lines.index("BODY_FEET, 2")] = "BODY_FEET, 1, 2"
    lines.remove("1, 1")
    solution = solved(tmp_path, lines)
    feet = solution.resultants.of("BODY_FEET")
    np.testing.assert_allclose(feet.force, (-2.0, 5.0), rtol=1e-6)
    # x F_y - y F_x at (.75, 1.5), and the moment there
    assert feet.moment_about((0.0, 0.0)) == pytest.approx(-(0.75 * -5.0 - 1.5 * 2.0 + 0.5), rel=1e-6)
    x, u = moved(solution)
    head = np.flatnonzero(x[:, 1] > 0.99)
    bent = u[head, 1] - np.polyval(np.polyfit(x[head, 0], u[head, 1], 1), x[head, 0])
    assert (np.abs(bent).max() < 1e-6 * np.abs(u).max()) == (kind == "*KINEMATIC")


def test_a_load_on_the_node_of_a_lost_coupling(tmp_path):
    """It changes the answer."""
    lines = column(
        ["*COUPLING, REF NODE=900, SURFACE=NOWHERE, CONSTRAINT NAME=C", "*KINEMATIC"], ["*CLOAD", "900, 2, 1."]
    )
    lost = drafted(tmp_path, lines)[0].lost
    assert any("force at node 900: no part of the body, which a constraint may tie to it" in remark for remark in lost)


# --- ties and contact of nodes ---------------------------------------------------------------------------------------


def test_a_tie_of_nodes(tmp_path):
    """Nodes that fill no facets hold the upper block: it moves with the lower one, which carries its load."""
    lines = [
        *squares(4, 2, name="LOW"),
        *squares(6, 2, 101, (0.0, 1.0), name="UP"),
        "*NSET, NSET=SOME",
        "101, 103, 105",
    ]
    lines += [f"*SOLID SECTION, ELSET={name}, MATERIAL=STEEL" for name in ("LOW", "UP")]
    lines += [*STEEL, "*SURFACE, NAME=NODES, TYPE=NODE", "SOME", "*TIE, NAME=T", "NODES, LOW_TOP", "*BOUNDARY"]
    given = [*lines, "LOW_FEET, 1, 1, 0.01", "LOW_FEET, 2, 2, 0.02", "*STEP", "*STATIC", END]
    _, u = moved(solved(tmp_path, given, "moved"))
    np.testing.assert_allclose(u, np.tile([0.01, 0.02], (len(u), 1)), rtol=1e-7)
    loaded = [*lines, "LOW_FEET, 1, 2", "*STEP", "*STATIC", "*DSLOAD", "UP_TOP, TRVEC, 3., 1., -2.", END]
    feet = solved(tmp_path, loaded, "loaded").resultants.of("LOW_FEET")
    np.testing.assert_allclose(feet.force, (-3 / 5**0.5, 6 / 5**0.5), rtol=1e-7)


def test_contact_of_a_node(tmp_path):
    """With equations that move its facets alike nothing is lost: a column sinks by p L / E and p / k; else it is."""
    lines = stacked(["*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR", "100."])
    lines[lines.index("UP_BOTTOM, LOW_TOP")] = "NODES, LOW_TOP"
    at = lines.index("*SURFACE INTERACTION, NAME=I")
    lines[at:at] = ["*NSET, NSET=SOME", "102, 104", "*SURFACE, NAME=NODES, TYPE=NODE", "SOME"]
    lines[lines.index(f"{YOUNG}, {POISSON}")] = f"{YOUNG}, 0."
    made, _ = drafted(tmp_path, lines, "alone")
    assert [remark.partition(": ")[2] for remark in made.lost] == [
        "contact of 2 nodes of 'NODES': 3 more nodes of whole facets touch here"
    ]
    numbers = (101, 103, 104, 105)
    lines[at:at] = ["*EQUATION", *(line for n in numbers for line in ("2", f"{n}, 2, 1., 102, 2, -1."))]
    x, u = moved(solved(tmp_path, lines))
    np.testing.assert_allclose(u[x[:, 1] > 1.99, 1], -2 * 5.0 / YOUNG - 5.0 / 100.0, rtol=1e-4)


# --- cyclic symmetry -------------------------------------------------------------------------------------------------

SECTORS, RADII, ROWS, TALL = 6, (1.0, 1.5, 2.0), 2, 0.5


def ring(sectors):
    """Nodes and bricks of some sectors of a ring about axis z, and a function of radius, angle and height to a node."""
    whole = sectors == SECTORS
    around = ROWS * sectors + (not whole)

    def number(i, j, k):
        return 1 + i + len(RADII) * (j % around + around * k)

    lines = ["*NODE"]
    for k in (0, 1):
        for j in range(around):
            angle = 2 * np.pi * j / (ROWS * SECTORS)
            for i, radius in enumerate(RADII):
                x, y = float(radius * np.cos(angle)), float(radius * np.sin(angle))
                lines.append(f"{number(i, j, k)}, {x!r}, {y!r}, {TALL * k}")
    lines.append("*ELEMENT, TYPE=C3D8, ELSET=BODY")
    for j in range(ROWS * sectors):
        for i in range(len(RADII) - 1):
            corners = [number(i + a, j + b, k) for k in (0, 1) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
            lines.append(f"{1 + i + (len(RADII) - 1) * j}, {', '.join(map(str, corners))}")
    inner = sorted({number(0, j, k) for j in range(ROWS * sectors + 1) for k in (0, 1)})
    lines += ["*NSET, NSET=INNER", *map(str, inner), "*SOLID SECTION, ELSET=BODY, MATERIAL=STEEL", *STEEL]
    return lines, number


def twisted(sectors, constraint):
    """Held inside, and pushed around the axis and outwards at one node of the outside of each sector."""
    lines, number = ring(sectors)
    forces = []
    for j in range(sectors):
        angle = 2 * np.pi * (ROWS * j + 1) / (ROWS * SECTORS)
        radial, round_ = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        vector = 0.3 * radial + 2.0 * round_
        forces += [f"{number(2, ROWS * j + 1, 1)}, {axis}, {value!r}" for axis, value in enumerate(vector.tolist(), 1)]
    return [*lines, *constraint(number), "*BOUNDARY", "INNER, 1, 3", "*STEP", "*STATIC", "*CLOAD", *forces, END]


def sides(number):
    """One side of the sector moves as the other one."""
    rows = [(i, k) for i in range(len(RADII)) for k in (0, 1)]
    lines = ["*NSET, NSET=FIRST", *(str(number(i, 0, k)) for i, k in rows)]
    lines += ["*NSET, NSET=LAST", *(str(number(i, ROWS, k)) for i, k in rows)]
    lines += ["*SURFACE, NAME=A, TYPE=NODE", "FIRST", "*SURFACE, NAME=B, TYPE=NODE", "LAST"]
    lines += ["*TIE, CYCLIC SYMMETRY, NAME=T", "A, B"]
    return [*lines, f"*CYCLIC SYMMETRY MODEL, N={SECTORS}, TIE=T", "0., 0., 0., 0., 0., 1."]


def test_cyclic_symmetry(tmp_path):
    """A sector moves as in the whole ring, which has no links; loads are not mirror-symmetric."""
    at, whole = moved(solved(tmp_path, twisted(SECTORS, lambda number: []), "ring"), 3)
    x, sector = moved(solved(tmp_path, twisted(1, sides), "sector"), 3)
    rows = [int(np.argmin(np.linalg.norm(at - place, axis=1))) for place in x]
    assert np.abs(at[rows] - x).max() < 1e-9
    np.testing.assert_allclose(sector, whole[rows], atol=2e-5 * np.abs(whole).max())


@pytest.mark.parametrize(
    ("model", "message"),
    [
        (["*CYCLIC SYMMETRY MODEL, N=1, TIE=T", "0., 0., 0., 0., 0., 1."], "N, a whole number from 2 on"),
        (["*CYCLIC SYMMETRY MODEL, N=6, TIE=T", "0., 0., 0., 0., 0., 0."], "two points of the axis"),
        (["*CYCLIC SYMMETRY MODEL, N=6, TIE=U", "0., 0., 0., 0., 0., 1."], "TIE=U is no single *TIE"),
        (["*CYCLIC SYMMETRY MODEL, TIE=T", "0., 0., 0., 0., 0., 1."], "'N' is missing"),
    ],
)
def test_sectors_that_are_wrong(tmp_path, model, message):
    """One error with the line of the keyword."""
    lines = twisted(1, lambda number: [*sides(number)[:-2], *model])
    with pytest.raises(MeshError, match=r"line \d+, \*CYCLIC SYMMETRY MODEL: ") as error:
        drafted(tmp_path, lines)
    assert message in str(error.value)


def test_sectors_that_do_not_meet(tmp_path):
    """Where a turn of another angle leaves nodes alone, they are lost."""
    lines = twisted(1, sides)
    lines[lines.index("*CYCLIC SYMMETRY MODEL, N=6, TIE=T")] = "*CYCLIC SYMMETRY MODEL, N=5, TIE=T"
    lost = drafted(tmp_path, lines)[0].lost
    assert "cyclic symmetry: 6 of 6 nodes of 'A' find no place of 'B'" in lost[0]


EDGES = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]


def quadratic(lines):
    """The same bricks with nodes in the middle of their edges."""
    x, middles, result = {}, {}, []
    for line in lines:
        words = line.split(",")
        if len(words) == 4 and not line.startswith("*"):
            x[int(words[0])] = np.array(list(map(float, words[1:])))
        if len(words) == 9:
            corners = [int(word) for word in words[1:]]
            for a, b in EDGES:
                middles.setdefault(frozenset((corners[a], corners[b])), 500 + len(middles))
            more = [middles[frozenset((corners[a], corners[b]))] for a, b in EDGES]
            result += [", ".join(map(str, [int(words[0]), *corners, *more[:7]])) + ",", ", ".join(map(str, more[7:]))]
        else:
            result.append(line.replace("C3D8", "C3D20"))
    added = [f"{n}, {', '.join(repr(float(v)) for v in sum(x[k] for k in ends) / 2)}" for ends, n in middles.items()]
    return ["*NODE", *added, *result]


def pressed(joint, *, inwards=-1.0):
    """A sector of a ring whose outside is moved towards the axis, or away from it, by even radial forces; its middle
    does not move around the axis and its bottom not along it.
    """
    lines, number = ring(1)
    middle = [number(i, 1, k) for i in range(len(RADII)) for k in (0, 1)]
    bottom = [number(i, j, 0) for i in range(len(RADII)) for j in range(ROWS + 1)]
    lines += ["*NSET, NSET=MIDDLE", *map(str, middle), "*NSET, NSET=BOTTOM", *map(str, bottom)]
    lines += ["*TRANSFORM, NSET=MIDDLE, TYPE=C", "0., 0., 0., 0., 0., 1."]
    for name, row, face in (("A", 0, "S3"), ("B", ROWS - 1, "S5")):
        lines += [f"*SURFACE, NAME={name}", *(f"{1 + i + (len(RADII) - 1) * row}, {face}" for i in range(2))]
    forces = []
    for j, share in ((0, 0.5), (1, 1.0), (2, 0.5)):
        angle = 2 * np.pi * j / (ROWS * SECTORS)
        for k in (0, 1):
            vector = inwards * share * np.array([np.cos(angle), np.sin(angle)])
            forces += [f"{number(2, j, k)}, {axis}, {float(value)!r}" for axis, value in enumerate(vector, 1)]
    held = ["*BOUNDARY", "MIDDLE, 2", "BOTTOM, 3"]
    return [*lines, *joint, *held, "*STEP", "*STATIC", "*CLOAD", *forces, END]


MODEL = "*CYCLIC SYMMETRY MODEL, N=6, TIE=T"
AXIS = "0., 0., 0., 0., 0., 1."
TIED = ["*TIE, CYCLIC SYMMETRY, NAME=T", "A, B", MODEL, AXIS]
TOUCHING = ["*SURFACE INTERACTION, NAME=I", *TIED[:2], f"{MODEL}, CONTACT", AXIS]
PAIR = ["*CONTACT PAIR, INTERACTION=I", "A, B"]


@pytest.mark.parametrize("shape", [list, quadratic])
@pytest.mark.parametrize("pair", [PAIR, ["*CONTACT PAIR, INTERACTION=I", "B, A"]], ids=["slave", "master"])
def test_a_sector_touches_the_next_one(tmp_path, pair, shape):
    """Under forces towards the axis a ring of loose sectors is one whole ring, whose sectors press each other without
    shear; the images of the next sector have less than 1e-4 of its stiffness.
    """
    whole = solved(tmp_path, shape(pressed(TIED)), "whole")
    loose = solved(tmp_path, shape(pressed([*TOUCHING, *pair])), "loose")
    assert loose.converged
    (at, expected), (x, u) = moved(whole, 3), moved(loose, 3)
    size = np.sqrt(0.75)
    turns = [np.eye(3), *(np.array([[0.5, -s, 0.0], [s, 0.5, 0.0], [0.0, 0.0, 1.0]]) for s in (size, -size))]
    places, values = (np.vstack([rows @ turn.T for turn in turns]) for rows in (at, expected))
    rows = [int(np.argmin(np.linalg.norm(places - place, axis=1))) for place in x]
    assert len(x) == len(at) + (45 if shape is quadratic else 12)
    assert np.abs(places[rows] - x).max() < 1e-9
    np.testing.assert_allclose(u, values[rows], atol=1e-3 * np.abs(expected).max())


def test_sectors_come_apart(tmp_path):
    """Forces away from the axis are held by ties and not by contact."""
    assert solved(tmp_path, pressed(TIED, inwards=1.0), "whole").converged
    with pytest.raises(ConvergenceError, match="contact opens, no static equilibrium"):
        solved(tmp_path, pressed([*TOUCHING, *PAIR], inwards=1.0), "loose")


def test_coordinates_that_lines_lack(tmp_path):
    """They are zero, of images, too; nodes without any are all at one place, which is said."""
    lines = pressed([*TOUCHING, *PAIR])
    short = [re.sub(r"^(\d+, [^,*]+, [^,*]+), 0\.0$", r"\1", line) for line in lines]
    assert sum(a != b for a, b in zip(lines, short, strict=True)) == 9
    texts = [drafted(tmp_path, deck)[0].files for deck in (lines, short)]
    assert texts[0] == texts[1]
    none = [re.sub(r"^(\d+), [^,*]+, [^,*]+, [^,*]+$", r"\1", line) for line in lines]
    with pytest.raises(MeshError, match="no third coordinate"):
        drafted(tmp_path, none)


def test_elements_that_are_removed_have_no_image(tmp_path):
    """One of both at the side that is touched: four nodes less are added."""
    lines = pressed([*TOUCHING, *PAIR, "*ELSET, ELSET=GONE", "4"])
    removed = [*lines[:-1], "*MODEL CHANGE, TYPE=ELEMENT, REMOVE", "GONE", END]
    counts = []
    for name, deck in (("all", lines), ("less", removed)):
        (sector,) = drafted(tmp_path, deck, name)[0].deck.model.sectors.values()
        counts.append(len(sector.images))
    assert counts == [12, 8]


def test_a_sector_that_touches_nothing(tmp_path):
    """Without a contact pair of both sides the contact is lost, in so many words."""
    for name, joint in (
        ("alone", TOUCHING),
        ("other", [*TOUCHING, "*CONTACT PAIR, INTERACTION=I", "A, C"]),
    ):
        lost = drafted(tmp_path, pressed(joint), name)[0].lost
        assert any(
            "contact of a sector with the next one: no *CONTACT PAIR of 'A' and the faces 'B'" in line for line in lost
        )


# --- directions and temperatures -------------------------------------------------------------------------------------


def test_forces_in_turned_directions(tmp_path):
    """A cylindrical *TRANSFORM: along the radius and around the axis at the node, by hand."""
    turn = ["*NSET, NSET=TURNED", "15", "*TRANSFORM, NSET=TURNED, TYPE=C", "0., 0., 0., 0., 0., 1."]
    _, data = drafted(tmp_path, column(turn, ["*CLOAD", "15, 1, 4.", "15, 2, 2."]))
    (force,) = data["point_force"]
    root = 0.5**0.5
    assert force == {"at": [1.0, 1.0], "x": pytest.approx(4 * root - 2 * root), "y": pytest.approx(4 * root + 2 * root)}


def test_forces_at_nodes_of_a_ring(tmp_path):
    """They are those of the whole ring: displacement and reaction as CalculiX 2.20 prints them, from its 2 degrees."""
    lines = [
        "*NODE",
        "1, 1., 0.",
        "2, 2., 0.",
        "3, 2., 1.",
        "4, 1., 1.",
        "*ELEMENT, TYPE=CAX4, ELSET=E",
        "1, 1, 2, 3, 4",
    ]
    lines += ["*SOLID SECTION, ELSET=E, MATERIAL=STEEL", *STIFF, "*NSET, NSET=FEET", "1, 2", "*BOUNDARY", "FEET, 2"]
    solution = solved(tmp_path, [*lines, "*STEP", "*STATIC", "*CLOAD", "3, 2, 50.", "4, 2, 40.", END])
    assert solution.displacement.x.array.max() == pytest.approx(9.551236e-3, rel=3e-4)
    assert solution.resultants.of("FEET").force[1] * 2 / 360 == pytest.approx(-0.5, rel=1e-9)


def test_temperatures_along_a_line(tmp_path):
    """*TEMPERATURE, LINTEMP of CalculiX: linear between two places, 300 at the feet and 500 at the head."""
    lines = column(
        ["*INITIAL CONDITIONS, TYPE=TEMPERATURE", "EVERY, 300."],
        ["*TEMPERATURE, LINTEMP", "0., 1., 0., 0., 300., 1., 500."],
    )
    lines.insert(lines.index(f"{YOUNG}, 0.") + 1, "*EXPANSION")
    lines.insert(lines.index("*EXPANSION") + 1, "1e-5")
    at = lines.index("*INITIAL CONDITIONS, TYPE=TEMPERATURE")
    lines[at:at] = ["*NSET, NSET=EVERY, GENERATE", "1, 15"]
    made, data = drafted(tmp_path, lines)
    assert made.lost == []
    (temperature,) = data["temperature"]
    with (tmp_path / temperature["file"]).open() as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == 15
    assert [float(row["change"]) for row in rows] == pytest.approx([200 * float(row["y"]) for row in rows])
    at = lines.index("0., 1., 0., 0., 300., 1., 500.")
    lines[at] = "0., 1., 0., 1., 300., 1., 500."
    with pytest.raises(MeshError, match=f"line {at}, .TEMPERATURE: both temperatures are at 1"):
        drafted(tmp_path, lines)
