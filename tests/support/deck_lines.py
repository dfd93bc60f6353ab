"""Small input files of Abaqus and CalculiX, as lines, and their drafts."""

import tomllib

from signorini_fx.scenes import cli

YOUNG, POISSON = 1000.0, 0.25
STEEL = ["*MATERIAL, NAME=STEEL", "*ELASTIC", f"{YOUNG}, {POISSON}"]


def drafted(folder, lines, code=0):
    """The scene of a deck, drafted with this exit code, and its data."""
    deck, scene = folder / "deck.inp", folder / "draft.toml"
    deck.write_text("\n".join(lines) + "\n", encoding="utf-8")
    scene.unlink(missing_ok=True)
    assert cli.main(["new", str(scene), "--from", str(deck)]) == code
    return scene, tomllib.loads(scene.read_text(encoding="utf-8")) if scene.exists() else {}


def squares(nx, ny, first=1, corner=(0.0, 0.0), size=(1.0, 1.0), name="BODY"):
    """Nodes, elements and surfaces of a rectangle; numbers begin with ``first``."""
    at = [(i, j) for j in range(ny + 1) for i in range(nx + 1)]
    lines = ["*NODE"]
    lines += [
        f"{first + n}, {corner[0] + size[0] * i / nx}, {corner[1] + size[1] * j / ny}"
        for n, (i, j) in enumerate(at)
    ]
    lines += [f"*ELEMENT, TYPE=CPE4, ELSET={name}"]
    cells = [i + j * (nx + 1) for j in range(ny) for i in range(nx)]
    lines += [
        f"{first + n}, {', '.join(str(first + c + k) for k in (0, 1, nx + 2, nx + 1))}"
        for n, c in enumerate(cells)
    ]
    lines += [f"*ELSET, ELSET={name}_LOW, GENERATE", f"{first}, {first + nx - 1}"]
    lines += [
        f"*ELSET, ELSET={name}_HIGH, GENERATE",
        f"{first + nx * (ny - 1)}, {first + nx * ny - 1}",
    ]
    lines += [
        f"*SURFACE, NAME={name}_BOTTOM",
        f"{name}_LOW, S1",
        f"*SURFACE, NAME={name}_TOP",
        f"{name}_HIGH, S3",
    ]
    for side, start in (("FEET", 0), ("HEAD", ny * (nx + 1))):
        lines += [f"*NSET, NSET={name}_{side}, GENERATE", f"{first + start}, {first + start + nx}"]
    lines += [f"*NSET, NSET={name}_WALL, GENERATE", f"{first}, {first + ny * (nx + 1)}, {nx + 1}"]
    return lines


def stacked(behaviour, gap=0.0, pair="*CONTACT PAIR, INTERACTION=I"):
    """A block above another one, under pressure; its lower side is the first of the pair."""
    lines = [*squares(4, 2, name="LOW"), *squares(4, 2, 101, (0.0, 1.0 + gap), name="UP")]
    lines += [f"*SOLID SECTION, ELSET={name}, MATERIAL=STEEL" for name in ("LOW", "UP")]
    lines += [
        *STEEL,
        "*SURFACE INTERACTION, NAME=I",
        *behaviour,
        pair,
        "UP_BOTTOM, LOW_TOP",
        "*BOUNDARY",
    ]
    lines += [
        "LOW_FEET, 2",
        "LOW_WALL, 1",
        "UP_WALL, 1",
        "*STEP",
        "*STATIC",
        "*DSLOAD",
        "UP_TOP, P, 5.0",
    ]
    return [*lines, "*END STEP"]


def assembly(turn="0., 0., 0., 0., 0., 1., 180."):
    """Two instances of one part, as Abaqus/CAE writes them: the second is shifted onto the first,
    and turned.
    """
    part = [
        "*PART, NAME=Brick",
        *squares(4, 2),
        "*SOLID SECTION, ELSET=BODY, MATERIAL=STEEL",
        "*END PART",
    ]
    lines = [
        *part,
        "*ASSEMBLY, NAME=Assembly",
        "*INSTANCE, NAME=Brick-1, PART=Brick",
        "*END INSTANCE",
    ]
    lines += ["*INSTANCE, NAME=Brick-2, PART=Brick", "-1., -2., 0.", turn, "*END INSTANCE"]
    # The bottom of the second one is on top; names of the assembly are those of sets of the part,
    # too.
    lines += [
        "*NSET, NSET=BODY_FEET, INSTANCE=Brick-1, GENERATE",
        "1, 5",
        "*ELSET, ELSET=_S, INSTANCE=Brick-2",
        "1, 2, 3, 4",
    ]
    lines += [
        "*SURFACE, NAME=LID",
        "_S, S1",
        "*NODE",
        "1, 9., 9.",
        "*NSET, NSET=REF",
        "1",
        "*END ASSEMBLY",
        *STEEL,
    ]
    lines += [
        "*CONTACT PAIR, INTERACTION=I",
        "Brick-2.BODY_TOP, Brick-1.BODY_TOP",
        "*SURFACE INTERACTION, NAME=I",
    ]
    lines += ["*BOUNDARY", "BODY_FEET, 2", "Brick-1.1, 1", "Brick-2.5, 1", "REF, 1, 2"]
    return [*lines, "*STEP", "*STATIC", "*DSLOAD", "LID, P, 5.0", "*END STEP"]
