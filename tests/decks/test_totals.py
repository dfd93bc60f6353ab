"""The total load of a deck, summed up from its text in another way, is what the supports of its
solution carry.
"""

from collections import Counter

import numpy as np
import pytest
from deck_lines import STEEL, squares
from scenes import alone

from signorini_fx.addons.decks.reading import draft
from signorini_fx.scenes.reading import read_scene

BODIES = [*squares(4, 2, name="LOW"), *squares(4, 2, 101, (0.0, 1.0), name="UP")]
NODES = {"UP_HEAD": range(111, 116), "UP_WALL": (101, 106, 111), "LOW_WALL": (1, 6, 11)}
LENGTHS = {"UP_TOP": (1.0, (0.0, 1.0))}  # and outward normal
AREAS = {"UP": 1.0, "LOW": 1.0}
DENSITY = 2.0

STEPS = {
    "one after the other": [
        [
            (
                "*CLOAD",
                [
                    "UP_HEAD, 2, -0.25",
                    "111, 1, 0.5",
                    "115, 1, 0.5",
                    "112, 1, 1.",
                    "113, 1, 1.",
                    "114, 1, 1.",
                ],
            )
        ],
        [("*DSLOAD", ["UP_TOP, P, 3."])],
    ],
    "new": [
        [("*CLOAD", ["UP_HEAD, 2, -0.25"]), ("*DSLOAD", ["UP_TOP, TRVEC, 2., 3., -4."])],
        [("*CLOAD, OP=NEW", ["UP_WALL, 1, 0.5", "LOW_WALL, 1, 0.25"])],
        [("*DSLOAD, OP=NEW", ["UP_TOP, P, 1."])],
    ],
    "changed": [
        [("*CLOAD", ["UP_HEAD, 2, -0.25"]), ("*DSLOAD", ["UP_TOP, P, 2."])],
        [("*CLOAD", ["UP_HEAD, 2, -0.75"]), ("*DSLOAD, AMPLITUDE=HALF", ["UP_TOP, P, 8."])],
    ],
    "twice": [
        [
            ("*CLOAD", ["UP_HEAD, 2, -.25"]),
            ("*CLOAD", ["UP_HEAD, 2, -.5", "111, 1, .5"]),
            ("*CLOAD", ["111, 1, 1."]),
        ],
        [
            ("*CLOAD", ["112, 2, -0.5", "112, 2, -0.25"]),
            ("*DSLOAD", ["UP_TOP, P, 2.", "UP_TOP, P, 1."]),
        ],
    ],
    "weight": [
        [("*DLOAD", ["UP, GRAV, 9., 0., -1.", "LOW, GRAV, 9., 0., -1."])],
        [("*CLOAD", ["UP_HEAD, 1, 1."])],
    ],
}


def totals(steps):
    """Step by step what acts in all, from the text alone."""
    acting, sums = {}, []
    for step in steps:
        new = Counter()  # what a step gives several times adds up, as CalculiX 2.20 does it
        for keyword, rows in step:
            kind = keyword.split(",")[0]
            if "OP=NEW" in keyword:
                acting = {key: force for key, force in acting.items() if key[0] != kind}
            share = 0.5 if "AMPLITUDE" in keyword else 1.0
            for target, *words in (row.replace(" ", "").split(",") for row in rows):
                if kind == "*CLOAD":
                    for node in NODES.get(target, [target]):
                        new[kind, int(node), int(words[0])] += share * float(words[1])
                    continue
                numbers = np.array(words[1:], dtype=float)
                size, outward = LENGTHS.get(target, (AREAS.get(target), None))
                direction = (
                    numbers[1:] / np.linalg.norm(numbers[1:])
                    if len(numbers) > 1
                    else -np.array(outward)
                )
                density = DENSITY if words[0] == "GRAV" else 1.0
                for axis in (1, 2):
                    new[kind, target, words[0], axis] += (
                        share * density * size * numbers[0] * direction[axis - 1]
                    )
        acting.update(new)
        sums.append(
            [sum(force for (*_, axis), force in acting.items() if axis == k) for k in (1, 2)]
        )
    return sums


@pytest.mark.one_quick("name", STEPS)
def test_total_loads(tmp_path, name):
    """Of two tied bodies, in each step."""
    lines = [*BODIES, *(f"*SOLID SECTION, ELSET={body}, MATERIAL=STEEL" for body in AREAS), *STEEL]
    lines += [
        "*DENSITY",
        f"{DENSITY}",
        "*TIE, NAME=T",
        "UP_BOTTOM, LOW_TOP",
        "*BOUNDARY",
        "LOW_FEET, 1, 2",
    ]
    lines += ["*AMPLITUDE, NAME=HALF", "0., 0., 1., 0.5"]
    for step in STEPS[name]:
        lines += [
            "*STEP",
            "*STATIC",
            *(text for keyword, rows in step for text in (keyword, *rows)),
            "*END STEP",
        ]
    deck, scene = tmp_path / "deck.inp", tmp_path / "scene.toml"
    deck.write_text("\n".join(lines) + "\n")
    drafted = draft(deck, scene)
    scene.write_text(drafted.text)
    assert not [lost for lost in drafted.lost if "moment" not in lost], drafted.lost
    solution = alone(read_scene(scene))
    wanted = totals(STEPS[name])
    assert len(solution.shown_steps) == len(wanted)
    found = [solution.at(step).resultants.of("LOW_FEET").force for step in solution.shown_steps]
    np.testing.assert_allclose(found, -np.array(wanted), atol=1e-9)
