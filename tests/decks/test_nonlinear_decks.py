"""*HYPERELASTIC and *PLASTIC of input files: closed forms of a block, and what is refused or taken
as elastic.
"""

import numpy as np
import pytest
from deck_lines import drafted
from mpi4py import MPI
from scipy.optimize import brentq

from signorini_fx import solve
from signorini_fx.scenes.reading import read_scene

# A square of four cells, its left and its lower side on rollers, its upper one pushed down.
SQUARE = [
    *("*NODE", *(f"{1 + i + 3 * j}, {i / 2}, {j / 2}" for j in range(3) for i in range(3))),
    *(
        "*ELEMENT, TYPE=CPE4, ELSET=BODY",
        "1, 1, 2, 5, 4",
        "2, 2, 3, 6, 5",
        "3, 4, 5, 8, 7",
        "4, 5, 6, 9, 8",
    ),
    *("*SURFACE, NAME=LOW", "1, S1", "2, S1", "*SURFACE, NAME=LID", "3, S3", "4, S3"),
    *("*NSET, NSET=WALL", "1, 4, 7", "*NSET, NSET=TOP", "7, 8, 9"),
    *("*SOLID SECTION, ELSET=BODY, MATERIAL=M", "1."),
]
GROUND = ["*NSET, NSET=SOLE", "1, 2, 3", "*BOUNDARY", "SOLE, 2"]


def pushed(depth):
    """The step."""
    return [
        *("*BOUNDARY", "WALL, 1, 1", "*STEP, NLGEOM", "*STATIC", "*BOUNDARY"),
        *(f"TOP, 2, 2, {-depth}", "*END STEP"),
    ]


def nominal(energy, height):
    """The stress of a block in plane strain whose side is free, by the energy of its stretches."""
    step = 1e-30

    def slope(width, tall, which):
        shifted = np.array([width, tall], dtype=complex)
        shifted[which] += 1j * step
        return energy(*shifted, 1.0).imag / step

    width = brentq(lambda across: slope(across, height, 0), 0.8, 2.0, xtol=1e-15)
    return slope(width, height, 1)


def isochoric(a, b, c):
    """Stretches without the change of volume, and that."""
    volume = a * b * c
    return np.array([a, b, c]) * volume ** (-1 / 3), volume


def of_abaqus(shape, d1):
    """The energy of the shape, and 1 / D1 (J - 1)^2."""

    def energy(a, b, c):
        stretches, volume = isochoric(a, b, c)
        return shape(stretches) + (volume - 1) ** 2 / d1

    return energy


LAWS = {
    "NEO HOOKE": (["10., .02"], lambda s: 10.0 * (np.sum(s**2) - 3)),
    "MOONEY-RIVLIN": (
        ["7., 3., .02"],
        lambda s: 7.0 * (np.sum(s**2) - 3) + 3.0 * (np.sum(s**-2) - 3),
    ),
    "": (["7., 3., .02"], lambda s: 7.0 * (np.sum(s**2) - 3) + 3.0 * (np.sum(s**-2) - 3)),
    "OGDEN, N=2": (
        ["12., 1.6, 4., -3., .02, 0."],
        lambda s: sum(
            2 * mu / alpha**2 * (np.sum(s**alpha) - 3) for mu, alpha in ((12.0, 1.6), (4.0, -3.0))
        ),
    ),
}


@pytest.mark.one_quick("law", LAWS)
def test_rubber(tmp_path, law):
    """As CalculiX has its energies; NLGEOM is nothing to remark on."""
    rows, shape = LAWS[law]
    material = ["*MATERIAL, NAME=M", f"*HYPERELASTIC, {law}".rstrip(", "), *rows]
    scene, data = drafted(tmp_path, [*SQUARE, *material, *GROUND, *pushed(0.2)])
    assert "incomplete" not in data
    assert "NLGEOM" not in scene.read_text()
    solution = solve(read_scene(scene), MPI.COMM_SELF)
    assert solution.certificate.holds
    taken = solution.resultants.of("SOLE").force[1]
    assert taken == pytest.approx(-nominal(of_abaqus(shape, 0.02), 0.8), rel=1e-6)


TWO = [
    *("*NODE", "21, 0., -1.", "22, 1., -1.", "23, 1., 0.", "24, 0., 0."),
    *("*ELEMENT, TYPE=CPE4, ELSET=BASE", "9, 21, 22, 23, 24"),
]
BELOW = [
    *(
        "*SOLID SECTION, ELSET=BASE, MATERIAL=M",
        "*SURFACE, NAME=UPPER",
        "9, S3",
        "*SURFACE INTERACTION, NAME=I",
    ),
    *("*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=HARD", "*CONTACT PAIR, INTERACTION=I", "LOW, UPPER"),
    *("*BOUNDARY", "21, 1, 2", "22, 1, 2"),
]


WARM = [
    "*INITIAL CONDITIONS, TYPE=TEMPERATURE",
    "EVERY, 20.",
    "*BOUNDARY",
    "WALL, 1, 1",
    "TOP, 2, 2",
]
WARM += ["*STEP", "*STATIC", "*TEMPERATURE", "EVERY, 120.", "*END STEP"]
EVERY = ["*NSET, NSET=EVERY", "1, 2, 3, 4, 5, 6, 7, 8, 9"]


def test_metal_that_yields_as_it_becomes_warm(tmp_path):
    """Its height and its thickness are held and its width is free, so that both have the stress
    -sigma, whose size is that of von Mises, and half of the plastic strain p: sigma = E (alpha T -
    p / 2) / (1 - nu) = sigma_0 + H p.
    """
    material = [
        "*MATERIAL, NAME=M",
        "*ELASTIC",
        "1000., .25",
        "*PLASTIC",
        "5., 0.",
        "15., .1",
        "*EXPANSION",
        "1e-4",
    ]
    scene, data = drafted(tmp_path, [*SQUARE, *EVERY, *material, *GROUND, *WARM])
    assert "incomplete" not in data
    solution = solve(read_scene(scene), MPI.COMM_SELF)
    plastic = (1000.0 * 1e-2 / 0.75 - 5.0) / (100.0 + 1000.0 / 2 / 0.75)
    assert solution.resultants.of("SOLE").force[1] == pytest.approx(5.0 + 100.0 * plastic, rel=1e-6)


ROLLING = [line for line in BELOW if line not in ("21, 1, 2", "22, 1, 2")] + [
    "21, 1",
    "24, 1",
    "21, 2",
    "22, 2",
]


@pytest.mark.one_quick("law", ["NEO HOOKE", "MOONEY-RIVLIN"])
def test_two_bodies_of_rubber(tmp_path, law):
    """A block on another one of the same rubber, both on rollers: each is compressed by half of the
    way, in closed form, as its sides slide on each other.
    """
    rows, shape = LAWS[law]
    material = ["*MATERIAL, NAME=M", f"*HYPERELASTIC, {law}", *rows]
    scene, data = drafted(tmp_path, [*SQUARE, *TWO, *material, *ROLLING, *pushed(0.4)])
    assert "incomplete" not in data
    assert "sliding" not in data["contact"][0]
    solution = solve(read_scene(scene), MPI.COMM_SELF)
    assert solution.certificate.holds
    taken = np.sum(solution.contact.forces, axis=0)[1]
    assert abs(taken) == pytest.approx(abs(nominal(of_abaqus(shape, 0.02), 0.8)), rel=1e-3)


def _square(says):
    return [line.replace("CPE4", "CPS4") for line in SQUARE] if "plane stress" in says else SQUARE


@pytest.mark.parametrize(
    ("material", "others", "says"),
    [
        (
            ["*HYPERELASTIC, YEOH", "1., 1., 1., .1"],
            GROUND,
            "only NEO HOOKE, MOONEY-RIVLIN and OGDEN",
        ),
        (["*HYPERELASTIC, NEO HOOKE", "1., 0."], GROUND, "with D1 above 0"),
        (["*HYPERELASTIC, NEO HOOKE", "1."], GROUND, "2 constants are expected"),
        (
            ["*HYPERELASTIC, MOONEY-RIVLIN", "1., -.1, .1"],
            GROUND,
            "C10 and C01 must not be negative here",
        ),
        (["*HYPERELASTIC, OGDEN, N=1", "1., 0., .1"], GROUND, "no exponent alpha zero"),
        (["*HYPERELASTIC, OGDEN, N=1", "-1., 2., .1"], GROUND, "mu must be above 0 here"),
        (
            ["*HYPERELASTIC, POLYNOMIAL, N=2", "1., 1., 1., 1., 1., .1, .1"],
            GROUND,
            "only NEO HOOKE",
        ),
        (["*HYPERELASTIC, NEO HOOKE", "1., .1"], GROUND, "not possible yet in plane stress"),
        (
            ["*ELASTIC", "1000., .3", "*PLASTIC", "5., .1"],
            GROUND,
            "the first plastic strain must be 0",
        ),
        (
            ["*ELASTIC", "1000., .3", "*PLASTIC", "5.", "6., 0."],
            GROUND,
            "plastic strains must increase",
        ),
        (
            ["*ELASTIC", "1000., .3", "*PLASTIC", "5.", "4., .1"],
            GROUND,
            "yield stresses not decrease",
        ),
        (
            ["*ELASTIC", "1000., .3", "*PLASTIC"],
            GROUND,
            "a data line ends too early, or is missing",
        ),
    ],
)
def test_what_is_refused(tmp_path, capsys, material, others, says):
    """By the line of the keyword."""
    drafted(
        tmp_path, [*_square(says), "*MATERIAL, NAME=M", *material, *others, *pushed(0.1)], code=2
    )
    said = " ".join(capsys.readouterr().err.split())
    assert says in said
    assert "line " in said or "deck.inp:" in said


HALVES = [
    *(line for line in SQUARE if not line.startswith("*SOLID") and line != "1."),
    *("*ELSET, ELSET=LOWER", "1, 2", "*SOLID SECTION, ELSET=LOWER, MATERIAL=M", "1."),
    *("*ELSET, ELSET=UPPER", "3, 4", "*SOLID SECTION, ELSET=UPPER, MATERIAL=S", "1."),
]
SOFT = ["*MATERIAL, NAME=M", "*HYPERELASTIC, NEO HOOKE", "10., .02"]


@pytest.mark.parametrize("yields", [False, True])
def test_rubber_on_metal(tmp_path, yields):
    """One part is rubber, the other one as stiff as steel beside it: at the same stress, which the
    whole shares.
    """
    steel = [
        "*MATERIAL, NAME=S",
        "*ELASTIC",
        "1e6, 0.",
        *(["*PLASTIC", "5., 0."] if yields else []),
    ]
    sides = ["*NSET, NSET=SIDE", "3, 6, 9", "*BOUNDARY", "SIDE, 1, 1"]
    scene, data = drafted(
        tmp_path, [*HALVES, *SOFT, *steel, *GROUND, *sides, *pushed(0.1)], code=4 if yields else 0
    )
    assert [part["law"] for part in data["material"]] == ["mooney-rivlin", "saint-venant-kirchhoff"]
    assert (
        any("beside rubber: elastic here" in remark for remark in data.get("incomplete", []))
        is yields
    )
    if yields:
        return
    solution = solve(read_scene(scene), MPI.COMM_SELF)
    assert solution.certificate.holds
    energy, step = of_abaqus(lambda s: 10.0 * (np.sum(s**2) - 3), 0.02), 1e-30
    alone = (
        energy(1.0, 0.8 + 1j * step, 1.0).imag / step
    )  # all of the way is that of the rubber, which is half
    assert solution.resultants.of("SOLE").force[1] == pytest.approx(-alone, rel=1e-3)
