"""Small input files of Abaqus and CalculiX, as lines."""

YOUNG, POISSON = 1000.0, 0.25
STEEL = ["*MATERIAL, NAME=STEEL", "*ELASTIC", f"{YOUNG}, {POISSON}"]


def squares(nx, ny, first=1, corner=(0.0, 0.0), size=(1.0, 1.0), name="BODY"):
    """Nodes, elements and surfaces of a rectangle; numbers begin with ``first``."""
    at = [(i, j) for j in range(ny + 1) for i in range(nx + 1)]
    lines = ["*NODE"]
    lines += [
        f"{first + n}, {corner[0] + size[0] * i / nx}, {corner[1] + size[1] * j / ny}" for n, (i, j) in enumerate(at)
    ]
    lines += [f"*ELEMENT, TYPE=CPE4, ELSET={name}"]
    cells = [i + j * (nx + 1) for j in range(ny) for i in range(nx)]
    lines += [
        f"{first + n}, {', '.join(str(first + c + k) for k in (0, 1, nx + 2, nx + 1))}" for n, c in enumerate(cells)
    ]
    lines += [f"*ELSET, ELSET={name}_LOW, GENERATE", f"{first}, {first + nx - 1}"]
    lines += [f"*ELSET, ELSET={name}_HIGH, GENERATE", f"{first + nx * (ny - 1)}, {first + nx * ny - 1}"]
    lines += [f"*SURFACE, NAME={name}_BOTTOM", f"{name}_LOW, S1", f"*SURFACE, NAME={name}_TOP", f"{name}_HIGH, S3"]
    for side, start in (("FEET", 0), ("HEAD", ny * (nx + 1))):
        lines += [f"*NSET, NSET={name}_{side}, GENERATE", f"{first + start}, {first + start + nx}"]
    lines += [f"*NSET, NSET={name}_WALL, GENERATE", f"{first}, {first + ny * (nx + 1)}, {nx + 1}"]
    return lines


def stacked(behaviour, gap=0.0, pair="*CONTACT PAIR, INTERACTION=I"):
    """A block above another one, under pressure; its lower side is the first of the pair."""
    lines = [*squares(4, 2, name="LOW"), *squares(4, 2, 101, (0.0, 1.0 + gap), name="UP")]
    lines += [f"*SOLID SECTION, ELSET={name}, MATERIAL=STEEL" for name in ("LOW", "UP")]
    lines += [*STEEL, "*SURFACE INTERACTION, NAME=I", *behaviour, pair, "UP_BOTTOM, LOW_TOP", "*BOUNDARY"]
    lines += ["LOW_FEET, 2", "LOW_WALL, 1", "UP_WALL, 1", "*STEP", "*STATIC", "*DSLOAD", "UP_TOP, P, 5.0"]
    return [*lines, "*END STEP"]
