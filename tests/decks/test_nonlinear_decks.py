"""*HYPERELASTIC and *PLASTIC of input files: closed forms of a block, and what is refused or taken as elastic."""

import tomllib

import numpy as np
import pytest
from mpi4py import MPI
from scipy.optimize import brentq

from signorini_fx import solve
from signorini_fx.scenes import cli
from signorini_fx.scenes.reading import read_scene

# A square of four cells on a rigid line, its left side on rollers, its upper one pushed down.
SQUARE = [
    *("*NODE", *(f"{1 + i + 3 * j}, {i / 2}, {j / 2}" for j in range(3) for i in range(3)), "90, .5, -1."),
    *("*ELEMENT, TYPE=CPE4, ELSET=BODY", "1, 1, 2, 5, 4", "2, 2, 3, 6, 5", "3, 4, 5, 8, 7", "4, 5, 6, 9, 8"),
    *("*SURFACE, NAME=LOW", "1, S1", "2, S1", "*SURFACE, NAME=LID", "3, S3", "4, S3"),
    *("*NSET, NSET=WALL", "1, 4, 7", "*NSET, NSET=TOP", "7, 8, 9", "*NSET, NSET=REF", "90"),
    *("*SOLID SECTION, ELSET=BODY, MATERIAL=M", "1."),
]
GROUND = [
    *("*SURFACE, TYPE=SEGMENTS, NAME=GROUND", "START, -9., 0.", "LINE, 9., 0."),
    *("*RIGID BODY, ANALYTICAL SURFACE=GROUND, REF NODE=REF", "*SURFACE INTERACTION, NAME=I"),
    *("*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=HARD", "*CONTACT PAIR, INTERACTION=I", "LOW, GROUND"),
]


def pushed(depth):
    """The step."""
    return [
        *("*BOUNDARY", "WALL, 1, 1", "REF, 1, 6", "*STEP, NLGEOM", "*STATIC", "*BOUNDARY"),
        *(f"TOP, 2, 2, {-depth}", "*END STEP"),
    ]


def converted(folder, lines, code=0):
    """The scene file and its data."""
    deck, scene = folder / "deck.inp", folder / "draft.toml"
    deck.write_text("\n".join(lines) + "\n")
    assert cli.main(["convert", str(deck), str(scene)]) == code
    return (scene, tomllib.loads(scene.read_text())) if code != 2 else (scene, {})


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
    "MOONEY-RIVLIN": (["7., 3., .02"], lambda s: 7.0 * (np.sum(s**2) - 3) + 3.0 * (np.sum(s**-2) - 3)),
    "": (["7., 3., .02"], lambda s: 7.0 * (np.sum(s**2) - 3) + 3.0 * (np.sum(s**-2) - 3)),
    "OGDEN, N=2": (
        ["12., 1.6, 4., -3., .02, 0."],
        lambda s: sum(2 * mu / alpha**2 * (np.sum(s**alpha) - 3) for mu, alpha in ((12.0, 1.6), (4.0, -3.0))),
    ),
}


@pytest.mark.parametrize("law", LAWS)
def test_rubber(tmp_path, law):
    """As CalculiX has its energies; NLGEOM is nothing to remark on."""
    rows, shape = LAWS[law]
    material = ["*MATERIAL, NAME=M", f"*HYPERELASTIC, {law}".rstrip(", "), *rows]
    scene, data = converted(tmp_path, [*SQUARE, *material, *GROUND, *pushed(0.2)])
    assert "incomplete" not in data
    assert "NLGEOM" not in scene.read_text()
    solution = solve(read_scene(scene), MPI.COMM_SELF)
    assert solution.certificate.holds
    taken = np.sum(solution.contact.forces, axis=0)[1]
    # The regularised law lets the floor be passed by a share of round-off size.
    assert taken == pytest.approx(-nominal(of_abaqus(shape, 0.02), 0.8), rel=1e-4)


def flow(size, reached, shear):
    """By how much the plastic strain grows where the von Mises stress of a trial has this size."""
    curve = [0.0, 0.01, 0.1], [5.0, 6.0, 9.0]

    def beyond(more):
        return size - 3 * shear * more - np.interp(reached + more, *curve)

    return brentq(beyond, 0.0, 1.0) if beyond(0.0) > 0 else 0.0


def test_metal(tmp_path):
    """Rows of yield stresses and plastic strains: a block in plane strain on its way through both segments."""
    material = ["*MATERIAL, NAME=M", "*ELASTIC", "1000., .3", "*PLASTIC", "5., 0.", "6., .01", "9., .1"]
    scene, data = converted(tmp_path, [*SQUARE, *material, *GROUND, *pushed(0.03)])
    assert data["material"] == {
        **{"law": "j2", "young": 1000.0, "poisson": 0.3, "yield_stress": 5.0},
        **{"hardening": [[0.01, 6.0], [0.1, 9.0]]},
    }
    assert "incomplete" not in data
    solution = solve(read_scene(scene), MPI.COMM_SELF)
    assert solution.certificate.holds
    # Mean stress and deviator of plane strain with a free side, in many small increments of radial return.
    shear, bulk, taken = 1000 / 2.6, 1000 / 1.2, np.sum(solution.contact.forces, axis=0)[1]
    plastic, reached, across, sigma = np.zeros(3), 0.0, 0.0, np.zeros(3)
    for down in np.linspace(0.0, 0.03, 3001)[1:]:
        for _ in range(60):
            strain = np.array([across, -down, 0.0])
            trial = 2 * shear * (strain - strain.mean() - plastic)
            size = np.sqrt(1.5) * np.linalg.norm(trial)
            amount = flow(size, reached, shear)
            sigma = trial * (1 - 3 * shear * amount / size) + bulk * strain.sum()
            change = -sigma[0] / (bulk + shear)
            across += change
            if abs(change) < 1e-13:
                break
        plastic += 1.5 * amount * trial / size
        reached += amount
    assert reached > 0.015
    assert taken == pytest.approx(-sigma[1], rel=5e-3)


TWO = [
    *("*NODE", "21, 0., -1.", "22, 1., -1.", "23, 1., 0.", "24, 0., 0."),
    *("*ELEMENT, TYPE=CPE4, ELSET=BASE", "9, 21, 22, 23, 24"),
]
BELOW = [
    *("*SOLID SECTION, ELSET=BASE, MATERIAL=M", "*SURFACE, NAME=UPPER", "9, S3", "*SURFACE INTERACTION, NAME=I"),
    *("*SURFACE BEHAVIOR, PRESSURE-OVERCLOSURE=HARD", "*CONTACT PAIR, INTERACTION=I", "LOW, UPPER"),
    *("*BOUNDARY", "21, 1, 2", "22, 1, 2"),
]


@pytest.mark.parametrize(
    ("material", "others", "says"),
    [
        (["*HYPERELASTIC, YEOH", "1., 1., 1., .1"], GROUND, "only NEO HOOKE, MOONEY-RIVLIN and OGDEN"),
        (["*HYPERELASTIC, NEO HOOKE", "1., 0."], GROUND, "with D1 above 0"),
        (["*HYPERELASTIC, NEO HOOKE", "1."], GROUND, "2 constants are expected"),
        (["*HYPERELASTIC, POLYNOMIAL, N=2", "1., 1., 1., 1., 1., .1, .1"], GROUND, "only NEO HOOKE"),
        (["*HYPERELASTIC, NEO HOOKE", "1., .1"], [*TWO, *BELOW], "not possible yet with another deformable body"),
        (["*ELASTIC", "1000., .3", "*PLASTIC", "5., .1"], GROUND, "the first plastic strain must be 0"),
    ],
)
def test_what_is_refused(tmp_path, capsys, material, others, says):
    """By the line of the keyword."""
    converted(tmp_path, [*SQUARE, "*MATERIAL, NAME=M", *material, *others, *pushed(0.1)], code=2)
    said = " ".join(capsys.readouterr().err.split())
    assert says in said
    assert "line " in said or "deck.inp:" in said


@pytest.mark.parametrize(
    ("plastic", "others", "says"),
    [
        (["*PLASTIC, HARDENING=COMBINED", "5., 0."], GROUND, "hardening that is not isotropic: elastic here"),
        (["*PLASTIC", "5., 0."], [*TWO, *BELOW], "not possible yet with another deformable body: elastic here"),
    ],
)
def test_what_does_not_yield(tmp_path, plastic, others, says):
    """The draft says so, and is incomplete."""
    material = ["*MATERIAL, NAME=M", "*ELASTIC", "1000., .3", *plastic]
    _, data = converted(tmp_path, [*SQUARE, *material, *others, *pushed(0.01)], code=4)
    assert any(says in remark for remark in data["incomplete"])
    assert "law" not in data["material"]


def test_constants_of_several_temperatures(tmp_path):
    """Those of the first one."""
    material = ["*MATERIAL, NAME=M", "*ELASTIC", "1000., .3", "*PLASTIC", "5., 0., 20.", "6., .1, 20.", "4., 0., 90."]
    _, data = converted(tmp_path, [*SQUARE, *material, *GROUND, *pushed(0.01)], code=4)
    assert data["material"]["hardening"] == [[0.1, 6.0]]
    assert any("the first line is taken" in remark for remark in data["incomplete"])
