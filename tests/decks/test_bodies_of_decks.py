"""Nodes of several bodies at one place: temperatures and supports of a deck belong to its nodes."""

import numpy as np
from deck_lines import drafted
from scenes import alone

from signorini_fx.scenes.reading import read_scene

YOUNG, POISSON, EXPANSION = 1000.0, 0.3, 1e-5
MATERIAL = ["*MATERIAL, NAME=M", "*ELASTIC", f"{YOUNG}, {POISSON}", "*EXPANSION", f"{EXPANSION}"]
# Corners and middles of the sides of an element, in the order of the file.
SERENDIPITY = ((0, 0), (2, 0), (2, 2), (0, 2), (1, 0), (2, 1), (1, 2), (0, 1))


def block(kind, nx, ny, first, low, high, elset):
    """Lines of a rectangle of elements of degree 2, its nodes by their places in the grid, and
    their positions.
    """
    places = [
        (i, j) for j in range(2 * ny + 1) for i in range(2 * nx + 1) if i % 2 == 0 or j % 2 == 0
    ]
    number = {place: first + k for k, place in enumerate(places)}
    x = {number[i, j]: (low[0] + (high[0] - low[0]) * i / (2 * nx), low[1] + (high[1] - low[1]) * j / (2 * ny))
         for i, j in places}  # fmt: skip
    lines = ["*NODE", *(f"{node}, {at[0]!r}, {at[1]!r}" for node, at in x.items())]
    lines.append(f"*ELEMENT, TYPE={kind}, ELSET={elset}")
    cells = [(i, j) for j in range(ny) for i in range(nx)]
    for k, (i, j) in enumerate(cells):
        lines.append(
            ", ".join(
                map(str, [first + k, *(number[2 * i + a, 2 * j + b] for a, b in SERENDIPITY)])
            )
        )
    for name, face, side in (("WEST", "S4", 0), ("EAST", "S2", nx - 1)):
        lines.append(f"*SURFACE, NAME={name}{first}")
        lines += [f"{first + k}, {face}" for k, (i, _) in enumerate(cells) if i == side]
    return lines, number, x


def test_a_hot_ring_in_a_cold_one(tmp_path):
    """Two rings that touch, of which the inner one is heated: Lame's pressure, which is exact where
    they are free along the axis; both are in one set of elements, and their nodes at the interface
    at the same places.
    """
    inner, interface, outer, hot = 1.0, 1.5, 2.5, 80.0
    low, _, x_low = block("CAX8", 4, 1, 1, (inner, 0.0), (interface, 0.2), "RINGS")
    high, _, x_high = block("CAX8", 5, 1, 101, (interface, 0.0), (outer, 0.2), "RINGS")
    lines = [
        *low,
        *high,
        *MATERIAL,
        "*SOLID SECTION, ELSET=RINGS, MATERIAL=M",
        "*CONTACT PAIR, INTERACTION=I",
    ]
    lines += [
        "WEST101, EAST1",
        "*SURFACE INTERACTION, NAME=I",
        "*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=HARD",
    ]
    lines += [
        "*INITIAL CONDITIONS, TYPE=TEMPERATURE",
        *(f"{node}, 20." for node in (*x_low, *x_high)),
        "*BOUNDARY",
    ]
    lines += [f"{node}, 2, 2" for node, at in (*x_low.items(), *x_high.items()) if at[1] == 0.0]
    lines += [
        "*STEP",
        "*STATIC",
        "*TEMPERATURE",
        *(f"{node}, {20 + hot}" for node in x_low),
        "*END STEP",
    ]
    scene, data = drafted(tmp_path, lines)
    assert data["temperature"] == [{"change": hot, "region": "body_1"}]
    solution = alone(read_scene(scene))
    shares = [
        (b * b + a * a) / (b * b - a * a) for a, b in ((inner, interface), (interface, outer))
    ]
    pressure = EXPANSION * hot * YOUNG / sum(shares)
    assert solution.certificate.holds
    assert (solution.table.columns["state"] != "open").all()
    np.testing.assert_allclose(solution.table.columns["pressure"], pressure, rtol=5e-3)
