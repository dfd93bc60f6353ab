"""Scenes drafted from Abaqus decks: what they say, what they leave out, and that they are
solved.
"""

import tomllib

import numpy as np
import pytest
from mesh_files import read_file
from scene_tables import coulomb_friction, fixed
from scenes import alone

from signorini_fx.addons.decks.reading import draft
from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.files.cells import CELLS, order_in
from signorini_fx.results.contact_figures import section_forces
from signorini_fx.scenes import cli
from signorini_fx.scenes.reading import read_scene
from signorini_fx.scenes.solver import solve

NX, NY, LENGTH, HEIGHT = 8, 4, 2.0, 1.0
HEAD = "*HEADING\nA block on a floor, 5 mm\n"


def block(name="CPE4"):
    """Nodes, elements and surfaces of a rectangle of squares, with an element of mass at its first
    node.
    """
    x = [(i, j) for j in range(NY + 1) for i in range(NX + 1)]
    lines = [HEAD, "*NODE"]
    lines += [f"{n}, {LENGTH * i / NX}, {HEIGHT * j / NY}" for n, (i, j) in enumerate(x, 1)]
    lines += ["1001, 0.5, -1.0", f"*ELEMENT, TYPE={name}, ELSET=Body"]
    cells = [1 + i + j * (NX + 1) for j in range(NY) for i in range(NX)]
    lines += [f"{n}, {c}, {c + 1}, {c + NX + 2}, {c + NX + 1}" for n, c in enumerate(cells, 1)]
    lines += ["*ELEMENT, TYPE=MASS, ELSET=POINTS", "5001, 1", "*MASS, ELSET=POINTS", "7.0"]
    lines += ["*ELSET, ELSET=LOW, GENERATE", f"1, {NX}, 1", "*ELSET, ELSET=HIGH, GENERATE"]
    lines += [f"{NX * (NY - 1) + 1}, {NX * NY}, 1", "*SURFACE, NAME=FLOOR SIDE", "LOW, S1"]
    lines += [
        "*SURFACE, NAME=LID",
        "HIGH, S3",
        "*NSET, NSET=WALL, GENERATE",
        f"1, {1 + NY * (NX + 1)}, {NX + 1}",
    ]
    lines += ["*NSET, NSET=CORNER", "3", "*NSET, NSET=REF", "1001"]
    lines += ["*SOLID SECTION, ELSET=BODY, MATERIAL=Steel", "1.0"]
    return lines


MATERIAL = ["*MATERIAL, NAME=Steel", "*DENSITY", "2.5", "*ELASTIC", "1000.0, 0.25"]
BELOW = [
    *("*NODE", "3001, -1., -1.01", "3002, 3., -1.01", "3003, 3., -.01", "3004, -1., -.01"),
    *(
        "*ELEMENT, TYPE=CPE4, ELSET=BASE",
        "3001, 3001, 3002, 3003, 3004",
        "*SURFACE, NAME=GROUND",
        "3001, S3",
    ),
    *(
        "*SOLID SECTION, ELSET=BASE, MATERIAL=Steel",
        "1.0",
        "*NSET, NSET=SOLE",
        "3001, 3002",
        "*BOUNDARY",
        "SOLE, 1, 2",
    ),
    "*SURFACE INTERACTION, NAME=RUBS",
    "1.0",
    "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=LINEAR, NO SEPARATION",
    "1e6",
    "*FRICTION",
    "0.3",
    "*CONTACT PAIR, INTERACTION=RUBS",
    "FLOOR SIDE, GROUND",
]
STEPS = [
    *("*BOUNDARY", "WALL, XSYMM", "CORNER, 1, 1"),
    *("*STEP, NAME=press", "*STATIC", "1., 1.", "*DSLOAD", "LID, P, 4.0", "*DLOAD"),
    *("BODY, GRAV, 9.81, 0., -1., 0.", "BASE, GRAV, 9.81, 0., -1., 0."),
    *("*NODE FILE", "U", "*END STEP"),
    *("*STEP, NAME=push", "*STATIC", "*DSLOAD", "LID, P, 2.0", "LID, TRVEC, 0.5, 3., 4., 0."),
    *("*CLOAD", "3, 1, 5.0", "*MODEL CHANGE", "*END STEP"),
]


LACKS, NOTED = "changes the answer: ", "does not change the answer: "


def drafted(folder, lines, capsys):
    """The scene, as data, and what was printed."""
    deck = folder / "deck.inp"
    deck.write_text("\n".join(lines) + "\n")
    (folder / "scenes").mkdir(exist_ok=True)
    scene = folder / "scenes" / "draft.toml"
    scene.unlink(missing_ok=True)
    code, data = (
        cli.main(["new", str(scene), "--from", str(deck)]),
        tomllib.loads(scene.read_text()),
    )
    assert code == (4 if "incomplete" in data else 0)
    said = capsys.readouterr().out
    assert data.get("incomplete", []) == [
        line.removeprefix(LACKS) for line in said.splitlines() if line.startswith(LACKS)
    ]
    return scene, data, said


def test_a_deck(tmp_path, capsys):
    """Everything that a scene can say is in it, with the steps as factors; the rest is listed with
    its line.
    """
    scene, data, said = drafted(tmp_path, [*block(), *MATERIAL, *BELOW, *STEPS], capsys)
    assert data["title"] == "A block on a floor, 5 mm"
    assert data["mesh"] == {"file": "../deck.inp"}
    assert data["material"] == {"young": 1000.0, "poisson": 0.25, "density": 2.5}
    assert data["displacement"] == [
        fixed("SOLE"),
        fixed("WALL", "x"),
        {"at": [0.5, 0.0], "region": "Body", "x": 0.0},
    ]
    assert data["traction"] == [
        {"boundary": "LID", "pressure": 4.0, "factors": [1.0, 0.5]},
        {"boundary": "LID", "x": 0.3, "y": 0.4, "factors": [0.0, 1.0]},
    ]
    assert data["gravity"] == [{"y": pytest.approx(-9.81)}]
    (contact,) = data["contact"]
    law = coulomb_friction(0.3)
    sides = {"boundary": "FLOOR SIDE", "against": "GROUND"}
    assert contact == sides | {"friction": law, "kind": "bilateral"}
    assert data["load_steps"] == {"names": ["press", "push"]}
    (noted,) = [line.removeprefix(NOTED) for line in said.splitlines() if line.startswith(NOTED)]
    assert "*NODE FILE: not written" in noted
    assert f"# Left out: {noted}\n" in scene.read_text()
    keywords = [line.partition(": ")[0].partition("*")[2] for line in data["incomplete"]]
    assert keywords == ["MODEL CHANGE", "CONTACT PAIR"]
    force = {"at": [0.5, 0.0], "region": "Body", "x": 5.0, "factors": [0.0, 1.0]}
    assert data["point_force"] == [force]
    assert data["solver"] == {"gamma_n": 1e6}
    number = int(data["incomplete"][0].split()[1].rstrip(","))
    assert (tmp_path / "deck.inp").read_text().splitlines()[number - 1].startswith("*MODEL CHANGE")


def lines_of(said):
    """What is left out, without the places."""
    found = [line.removeprefix(NOTED).removeprefix(LACKS) for line in said.splitlines()[1:]]
    return [line.partition(", *")[2] or line for line in found if " is incomplete: " not in line]


NODES = [str(n) for n in range(1, (NX + 1) * (NY + 1) + 1)]
RIGHT, TOP, CORNERS = NODES[NX :: NX + 1], NODES[-NX - 1 :], NODES[::NX]


def test_what_single_nodes_have(tmp_path, capsys):
    """Supports that agree are one boundary, which a later step refers to; those that fill no facet
    are points.
    """
    lines = [
        "*BOUNDARY",
        *(f"{n}, 1, 2, 0.5" for n in RIGHT),
        *(f"{n}, 1" for n in NODES[:: NX + 1]),
    ]
    lines += ["3, 2", "21, 2,, 7.0", "*Boundary", *(f"{n}, 4, 6" for n in TOP), "REF, 11, 11, 20.0"]
    lines += ["*STEP", "*STATIC", "*BOUNDARY", *(f"{n}, 2, 2, 1.D0" for n in RIGHT), "*END STEP"]
    scene, data, said = drafted(tmp_path, [*block(), *MATERIAL, *lines], capsys)
    assert data["displacement"] == [
        {"boundary": "support_1", "x": 0.5, "y": 1.0},
        fixed("WALL", "x"),
        {"at": [0.5, 0.0], "y": 0.0},
        {"at": [0.5, 0.5], "y": 7.0},
    ]
    mesh = read_file(scene.parent / data["mesh"]["file"])
    assert (mesh.points[mesh.facets[mesh.boundaries["support_1"]]][..., 0] == LENGTH).all()
    assert len(mesh.boundaries["support_1"]) == NY
    assert lines_of(said) == ["BOUNDARY: what 'REF' has besides displacements and rotations"]


def test_sets_that_are_more_or_less_than_facets(tmp_path, capsys):
    """Nodes of no whole facet are held one by one; those that are no part of the body are named."""
    lines = [
        "*NSET, NSET=SOME, GENERATE",
        f"1, {3 * NX + 3}",
        "*NSET, NSET=SOME",
        "5000, 5001",
        "1001",
    ]
    lines += ["*BOUNDARY", "some, 2", "LID, 3", "REF, 1", "*BOUNDARY", "1001, 1"]
    _, data, said = drafted(tmp_path, [*block(), *MATERIAL, *lines], capsys)
    side, *points = data["displacement"]
    assert side == fixed("SOME", "y")
    assert {tuple(point) for point in points} == {("at", "y")}
    assert len(points) == 2 * (NX - 1)
    assert lines_of(said) == [
        "BOUNDARY: support of 'REF': no part of the body",
        "BOUNDARY: support of node 1001: no part of the body",
    ]


def test_pressures_on_faces(tmp_path, capsys):
    """Those of elements and of sets of elements; a face inside the body has none."""
    steps = [
        "*STEP",
        "*STATIC",
        "*DLOAD",
        "HIGH, P3, 2.0",
        "1, P1, 0.5",
        "2, P1, 0.5",
        f"{NX}, P2, 0.5",
    ]
    steps += [
        "*DSLOAD",
        "LID, P, 1.0",
        "*DLOAD",
        "5, P3, 3.0",
        "6, P4, -3.0",
        "7, P, 1.0",
        "1, P3, 4.0",
        "*END STEP",
    ]
    steps += [
        "*STEP",
        "*STATIC",
        "*DLOAD, OP=NEW",
        "1, P1, 0.25",
        "2, P1, 0.25",
        f"{NX}, P2, 0.25",
        "*END STEP",
    ]
    scene, data, said = drafted(tmp_path, [*block(), *MATERIAL, *steps], capsys)
    assert data["traction"] == [
        {"boundary": "LID", "pressure": 2.0, "factors": [1.0, 0.0]},
        {"boundary": "pressure_1", "pressure": 0.5, "factors": [1.0, 0.5]},
        {"boundary": "LID", "pressure": 1.0},
    ]
    mesh = read_file(scene.parent / data["mesh"]["file"])
    assert len(mesh.boundaries["pressure_1"]) == 3
    assert lines_of(said) == [
        "DLOAD: pressure on faces that are no boundary of the body: 1",
        "DLOAD: load 7, P, 1.0",
    ]


def test_forces_at_nodes(tmp_path, capsys):
    """Those of a uniform traction are one, others are given one by one."""
    weights = [0.5, *[1.0] * (NX - 1), 0.5]
    forces = [
        f"{n}, 2, {-3.0 * weight * LENGTH / NX}" for n, weight in zip(TOP, weights, strict=True)
    ]
    forces += ["*CLOAD", *(f"{n}, 2, {0.5 if n in CORNERS else 1.0}" for n in NODES[: NX + 1])]
    steps = [
        "*STEP",
        "*STATIC",
        "*CLOAD",
        *forces,
        "*CLOAD",
        "WALL, 1, 1.0",
        "3, 3, 5.0",
        "3, 4, 1.0",
    ]
    steps += ["*CLOAD", "13, 2, 2.0", "*END STEP"]
    lines = [*block("CPS4")[:-1], "0.5", *MATERIAL, *steps]
    _, data, said = drafted(tmp_path, lines, capsys)
    assert data["traction"] == [
        {"boundary": "force_1", "y": pytest.approx(-6.0)},
        {"boundary": "force_2", "y": pytest.approx(2.0 * NX / LENGTH)},
    ]
    assert lines_of(said) == [
        "SOLID SECTION: the thickness 0.5: forces are per unit of it",
        "CLOAD: moments at nodes are not read",
    ]
    wall = [{"at": [0.0, pytest.approx(HEIGHT * k / NY)], "x": 1.0 / 0.5} for k in range(NY + 1)]
    inside = {"at": pytest.approx([LENGTH * 3 / NX, HEIGHT / NY]), "y": 2.0 / 0.5}
    assert sorted(data["point_force"], key=lambda force: force["at"]) == [*wall, inside]


@pytest.mark.parametrize(("kind", "dim"), [("CPE8R", 2), ("C3D20", 3)])
def test_elements_without_nodes_in_the_middle_of_faces(tmp_path, capsys, kind, dim):
    """They get them, the scene is quadratic, and forces are compared with those of the incomplete
    shape functions.
    """
    whole = CELLS["quad9" if dim == 2 else "hexahedron27"]
    nodes = whole.places[np.argsort(order_in("vtk", whole))][: 8 if dim == 2 else 20]
    lines = ["*NODE", *(f"{n}, {', '.join(map(str, x))}" for n, x in enumerate(nodes, 1))]
    lines += [
        f"*ELEMENT, TYPE={kind}, ELSET=ALL",
        ", ".join(map(str, range(1 + len(nodes)))).replace("0", "1", 1),
    ]
    lines += ["*SOLID SECTION, ELSET=ALL, MATERIAL=STEEL", *MATERIAL]
    share = {2: (1 / 6, 2 / 3), 3: (-1 / 12, 1 / 3)}[
        dim
    ]  # of a corner, and of a node in the middle of an edge
    top = [(n, x) for n, x in enumerate(nodes, 1) if x[-1] == 1]
    lines += [
        "*BOUNDARY",
        *(f"{n}, {dim}" for n, x in enumerate(nodes, 1) if x[-1] == 0),
        "*STEP",
        "*STATIC",
        "*CLOAD",
    ]
    lines += [f"{n}, {dim}, {4 * share[int((x == 0.5).sum())]}" for n, x in top]
    scene, data, said = drafted(tmp_path, [*lines, "*END STEP"], capsys)
    axis = "xyz"[dim - 1]
    assert data["element"] == {"degree": 2}
    assert data["displacement"] == [{"boundary": "support_1", axis: 0.0}]
    assert data["traction"] == [{"boundary": "force_1", axis: pytest.approx(4.0)}]
    assert lines_of(said) == []
    mesh = read_file(scene.parent / data["mesh"]["file"])
    np.testing.assert_allclose(mesh.points[-1], 0.5)
    assert mesh.kind == whole.kind


def test_axisymmetric_elements(tmp_path, capsys):
    """A cylinder under pressure on its lid; forces at nodes are those of the whole circle: its
    supports carry them.
    """
    lines = [
        *block("CAX4"),
        *MATERIAL,
        "*BOUNDARY",
        *(f"{n}, 2" for n in NODES[: NX + 1]),
        "WALL, 1",
        "*STEP",
    ]
    lines += ["*STATIC", "*DSLOAD", "LID, P, 4.0", "*END STEP"]
    scene, data, said = drafted(tmp_path, lines, capsys)
    assert data["material"]["hypothesis"] == "axisymmetric"
    assert lines_of(said) == []
    solution = alone(read_scene(scene))
    assert solution.displacement.x.array[1::2].min() == pytest.approx(-4.0 * HEIGHT / 1000.0)
    lines[-1:] = ["*CLOAD", *(f"{n}, 2, -2.0" for n in RIGHT), "*END STEP"]
    (tmp_path / "more").mkdir()
    scene, data, said = drafted(tmp_path / "more", lines, capsys)
    assert lines_of(said) == []
    assert len(data["point_force"]) == NY + 1
    carried = alone(read_scene(scene)).resultants.of("support_1").force
    assert carried[1] == pytest.approx(4.0 * np.pi * LENGTH**2 + 2.0 * (NY + 1), rel=1e-9)


HEATED = [
    "*EXPANSION, ZERO=300.",
    "1e-5",
    "*NSET, NSET=EVERY, GENERATE",
    f"1, {(NX + 1) * (NY + 1)}",
    "*NSET, NSET=ONE",
]
HEATED += [
    "1",
    "*INITIAL CONDITIONS, TYPE=TEMPERATURE",
    "EVERY, 20.",
    "*BOUNDARY",
    "WALL, 1",
    "ONE, 2",
]


def test_temperatures(tmp_path, capsys):
    """Their change since the beginning, whatever the coefficient of expansion counts from; in plane
    strain, by hand.
    """
    lines = [
        "*STEP",
        "*STATIC",
        "*TEMPERATURE",
        "EVERY, 70.",
        "*END STEP",
        "*STEP",
        "*STATIC",
        "*TEMPERATURE, OP=NEW",
        "*END STEP",
    ]
    lines += ["*AMPLITUDE, NAME=half", "0., 0., 1., 0.5"]
    lines += [
        "*STEP",
        "*STATIC",
        "*TEMPERATURE, OP=NEW, AMPLITUDE=HALF",
        "EVERY, 240.",
        "*END STEP",
    ]
    scene, data, said = drafted(tmp_path, [*block(), *MATERIAL, *HEATED, *lines], capsys)
    assert data["material"] == {"young": 1000.0, "poisson": 0.25, "expansion": 1e-5}
    assert data["temperature"] == [{"change": 100.0, "factors": [0.5, 0.0, 1.0]}]
    assert not lines_of(said)
    solution = alone(read_scene(scene))
    grown = (1 + 0.25) * 1e-5 * 100.0 * np.array([LENGTH, HEIGHT])
    np.testing.assert_allclose(
        solution.displacement.x.array.reshape(-1, 2).max(axis=0), grown, rtol=1e-9
    )


def test_a_step_that_does_not_end(tmp_path, capsys):
    """What the step before says would be lost: one error that names both.  The last step may end
    with the file.
    """
    first = ["*STEP", "*STATIC", "*DSLOAD", "LID, P, 4.0"]
    lines = [*block(), *MATERIAL, *first, "*STEP", "*STATIC", "*DSLOAD", "LID, P, 2.0"]
    deck = tmp_path / "open.inp"
    deck.write_text("\n".join([*lines, "*END STEP"]) + "\n", encoding="utf-8")
    numbers = [n for n, line in enumerate("\n".join(lines).splitlines(), 1) if line == "*STEP"]
    with pytest.raises(
        MeshError,
        match=rf"line {numbers[1]}, \*STEP: the step of line {numbers[0]} has no \*END STEP",
    ):
        draft(deck, tmp_path / "open.toml")
    lines.insert(-4, "*END STEP")
    _, data, _ = drafted(tmp_path, lines, capsys)
    assert data["traction"] == [{"boundary": "LID", "pressure": 4.0, "factors": [1.0, 0.5]}]


def test_amplitudes(tmp_path, capsys):
    """What acts at the end of each step; what a step does not give again keeps what it has
    reached.
    """
    lines = ["*AMPLITUDE, NAME=Up", "0., 0., 4., 2.", "*AMPLITUDE, NAME=DOWN", "0., 0., 4., 6."]
    lines += [
        "*STEP",
        "*STATIC",
        "1., 2.",
        "*DSLOAD, AMPLITUDE=UP, TIME DELAY=1.",
        "LID, P, 10.0",
        "*BOUNDARY, AMPLITUDE=DOWN",
    ]
    lines += [
        "WALL, 1, 1, 0.1",
        "*END STEP",
        "*STEP",
        "*STATIC",
        "*BOUNDARY, AMPLITUDE=DOWN",
        "WALL, 1, 1, 0.1",
    ]
    lines += [
        "*DSLOAD, AMPLITUDE=NONE",
        "FLOOR SIDE, P, 1.0",
        "*END STEP",
        "*STEP",
        "*STATIC",
        "0.1, 3.",
    ]
    lines += ["*DSLOAD, AMPLITUDE=DOWN", "FLOOR SIDE, TRVEC, 1., 1., 0., 0.", "*END STEP"]
    _, data, said = drafted(tmp_path, [*block(), *MATERIAL, *lines], capsys)
    assert [load.get("factors") for load in data["traction"]] == [
        None,
        [0.0, 1.0, 1.0],
        [0.0, 0.0, 1.0],
    ]
    assert data["traction"][0]["pressure"] == 5.0
    assert data["displacement"] == [
        {
            "boundary": "WALL",
            "x": pytest.approx(0.3),
            "factors": [1.0, pytest.approx(1 / 2), pytest.approx(1 / 2)],
        }
    ]
    assert lines_of(said) == [
        "DSLOAD: the amplitude 'NONE': only tabular amplitudes are read: the whole load is taken"
    ]


def test_rigid_surfaces_are_lost(tmp_path, capsys):
    """The body, the contact, and what holds or moves the reference node, each by its line."""
    rigid = ["*SURFACE, TYPE=SEGMENTS, NAME=GROUND", "START, -1.0, 0.0", "LINE, 3.0, 0.0"]
    rigid += [
        "*RIGID BODY, ANALYTICAL SURFACE=GROUND, REF NODE=REF",
        "*CONTACT PAIR",
        "FLOOR SIDE, GROUND",
    ]
    rigid += [
        "*STEP",
        "*STATIC",
        "*BOUNDARY",
        "REF, 2, 2, 0.001",
        "*CLOAD",
        "REF, 1, 3.",
        "*END STEP",
    ]
    _, _, said = drafted(tmp_path, [*block(), *MATERIAL, *rigid], capsys)
    assert lines_of(said) == [
        "BOUNDARY: support of 'REF': no part of the body",
        "CLOAD: force at node 1001: no part of the body",
        "SURFACE: TYPE=SEGMENTS is not read",
        "RIGID BODY: rigid bodies are not read: give the shape as foundation of a contact, or its "
        "distance as gap",
        "CONTACT PAIR: contact of 'FLOOR SIDE' with 'GROUND': 'GROUND' is no boundary of the body",
        "all of its contact: bodies do not touch in the scene",
    ]


def two_blocks():
    """The block with another one beneath it, whose squares are larger by half."""
    count, below = 1 + NX // 2, 2000
    x = [(i, j) for j in (0, 1) for i in range(count)]
    lines = [
        *block()[:-2],
        "*NODE",
        *(f"{below + n}, {2 * LENGTH * i / NX}, {j - 1}" for n, (i, j) in enumerate(x, 1)),
    ]
    lines += ["*ELEMENT, TYPE=CPE4, ELSET=LOWER"]
    lines += [
        f"{below + n}, {', '.join(str(below + n + k) for k in (0, 1, count + 1, count))}"
        for n in range(1, count)
    ]
    lines += ["*SURFACE, NAME=ROOF", "LOWER, S3", "*SURFACE, NAME=GROUND", "LOWER, S1"]
    lines += [
        "*SOLID SECTION, ELSET=BODY, MATERIAL=Steel",
        "*SOLID SECTION, ELSET=LOWER, MATERIAL=Steel",
        *MATERIAL,
    ]
    lines += ["*NSET, NSET=LEFT", "WALL, 2001", f"{below + count + 1}", "*BOUNDARY", "LEFT, 1"]
    lines += [f"{below + n}, 2" for n in range(1, count + 1)]
    return [*lines, "*STEP", "*STATIC", "*DSLOAD", "LID, P, 4.0", "*END STEP"]


@pytest.mark.parametrize("bonded", [False, True])
def test_two_bodies(tmp_path, capsys, bonded):
    """Tied, or in contact: in both cases they are compressed as one block; the first surface has
    the contact points.
    """
    pair = ["*TIE, NAME=T", "floor side, ROOF", "*TIE, CYCLIC SYMMETRY, NAME=C", "LID, GROUND"]
    if not bonded:
        pair = [
            "*SURFACE INTERACTION, NAME=S",
            "*FRICTION",
            "0.2, 1e5",
            "*CONTACT PAIR, INTERACTION=s, ADJUST=0.1",
        ]
        pair += ["FLOOR SIDE, ROOF", "LID, LID"]
    lines = two_blocks()
    scene, data, said = drafted(
        tmp_path, [*lines[: lines.index("*STEP")], *pair, *lines[lines.index("*STEP") :]], capsys
    )
    law = {"kind": "bonded"} if bonded else {"friction": coulomb_friction(0.2)}
    more = {} if bonded else {"adjust": 0.1}
    assert data["contact"] == [{"boundary": "FLOOR SIDE", "against": "ROOF", **more, **law}]
    assert data.get("solver") == (None if bonded else {"gamma_t": 1e5})
    assert lines_of(said) == (
        ["TIE: a constraint between nodes is not read"]
        if bonded
        else ["CONTACT PAIR: contact of 'LID' with 'LID': contact of a surface with itself"]
    )
    solution = alone(read_scene(scene))
    assert solution.converged
    sinking = -4.0 * (HEIGHT + 1.0) * (1 - 0.25**2) / 1000.0
    assert solution.displacement.x.array[1::2].min() == pytest.approx(sinking, rel=1e-4)


def test_it_is_solved(tmp_path, capsys):
    """The weight and the pressure of the first step are on the floor."""
    scene, _, _ = drafted(tmp_path, [*block(), *MATERIAL, *BELOW, *STEPS], capsys)
    solution = alone(read_scene(scene))
    assert solution.converged
    force = -(4.0 * LENGTH + 9.81 * 2.5 * LENGTH * HEIGHT)
    first = solution.at(solution.steps[0])
    assert first.resultants.of("FLOOR SIDE").force[1] == pytest.approx(-force, rel=1e-9)


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (["*ELASTIC", "abc, 0.3"], "a number is expected, got 'abc'"),
        (["*MATERIAL"], "NAME is missing"),
        (["*STEP", "*STATIC", "*DSLOAD", "LID, TRVEC, 1., 0., 0., 0."], "a direction is expected"),
        (
            ["*BOUNDARY", "WALL"],
            "data line 1 has only 'WALL': a name or number, and what is said of it, are expected",
        ),
        (["*SURFACE, NAME=G", "1, 1.0"], "surface 'G': a face S1, S2 ... is expected, not '1.0'"),
        (
            ["*CONTACT PAIR, TYPE=1.0", "FLOOR, LID"],
            "TYPE=1.0: NODE TO SURFACE, SURFACE TO SURFACE or MORTAR is",
        ),
    ],
)
def test_broken_decks(tmp_path, capsys, lines, said):
    """One error with the line; no scene."""
    deck = tmp_path / "deck.inp"
    deck.write_text(
        "\n".join([*block(), *([] if lines == ["*MATERIAL"] else MATERIAL), *lines]) + "\n"
    )
    assert cli.main(["new", str(tmp_path / "scene.toml"), "--from", str(deck)]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert f"{deck}: line " in error
    assert not (tmp_path / "scene.toml").exists()


BOLTED = [
    *(
        "*SURFACE, NAME=Cut",
        "4, S2",
        "12, S2",
        "20, S2",
        "28, S2",
        "*NODE, NSET=TIGHT",
        "2001, 9., 9.",
    ),
    *("*SURFACE, NAME=RIGHT", "8, S2", "16, S2", "24, S2", "32, S2"),
    "*PRE-TENSION SECTION, SURFACE=CUT, NODE=TIGHT",
    "1., 0., 0.",
    *("*NSET, NSET=FAR, GENERATE", f"{NX + 1}, {(NY + 1) * (NX + 1)}, {NX + 1}"),
    *(
        "*NSET, NSET=SOLE, GENERATE",
        f"1, {NX + 1}",
        "*BOUNDARY",
        "WALL, XSYMM",
        "FAR, XSYMM",
        "SOLE, 2",
    ),
]
TIGHTENED = [
    *(
        "*STEP, NAME=half",
        "*STATIC",
        "*DSLOAD",
        "LID, P, 4.0",
        "*CLOAD",
        "TIGHT, 1, 2.0",
        "*END STEP",
    ),
    *("*STEP, NAME=whole", "*STATIC", "*CLOAD", "2001, 1, 3.0", "*END STEP"),
    *("*STEP, NAME=work", "*STATIC", "*BOUNDARY, OP=MOD, FIXED", "TIGHT, 1, 1"),
    *("*CLOAD, OP=NEW", "*DSLOAD", "LID, P, 9.0", "*END STEP"),
]


def test_a_bolt_that_a_force_tightens(tmp_path, capsys):
    """*CLOAD at the node of a *PRE-TENSION SECTION tightens it, and *BOUNDARY, FIXED keeps its
    length.
    """
    scene, data, said = drafted(tmp_path, [*block(), *MATERIAL, *BOLTED, *TIGHTENED], capsys)
    assert data["preload"] == [
        {"section": "Cut", "force": 3.0, "locked_after": 2, "factors": [2.0 / 3.0, 1.0, 1.0]}
    ]
    assert not [
        line
        for line in lines_of(said)
        if "BOUNDARY" in line or "PRE-TENSION" in line or "CLOAD" in line
    ]
    ends = solve(read_scene(scene))
    for step, force in zip(ends.steps, (2.0, 3.0), strict=False):
        (section,) = section_forces(ends.model, step.displacement, step.place)
        assert np.isclose(section.force, force, rtol=1e-9)
    (section,) = ends.preloads
    assert np.isclose(
        ends.resultants.of("WALL").force[0], -section.force, rtol=1e-9
    )  # nothing else acts along x
    assert np.isclose(ends.resultants.of("FAR").force[0], section.force, rtol=1e-9)
    # A uniform state of plane strain, walls and floor smooth: the lid presses with 4, then 9, times
    # nu / (1 - nu).
    assert np.isclose(
        section.shortening, (3.0 + 4.0 / 3.0) * LENGTH * (1 - 0.25**2) / 1000.0, rtol=1e-9
    )
    assert np.isclose(section.force, 3.0 - 5.0 / 3.0, rtol=1e-9)
