"""Scenes of two nonlinear bodies: a closed form, gaps that depend on the time, and what is
refused.
"""

import numpy as np
import pytest
from scene_tables import coulomb_friction, fixed, rectangle_mesh
from scenes import alone
from support.nonlinear_bodies import LAME, MU, stress_of_block

from signorini_fx import Scene, SceneError, solve

POISSON = LAME / (2 * (LAME + MU))
LINEAR = {"young": 2 * MU * (1 + POISSON), "poisson": POISSON}
MODULI = {"law": "neo-hooke", **LINEAR}


def two_blocks(contact, depths=(0.4,), **settings):
    """A unit square on another one, both free to the right, pressed by these depths one after the
    other.
    """
    counts = {"lower": 3, "upper": 2}
    body = [
        {"name": name, "mesh": rectangle_mesh(count, count), "shift": [0.0, float(number)]}
        for number, (name, count) in enumerate(counts.items())
    ]
    largest = max(depths)
    displacement = [
        fixed("lower.bottom", "y"),
        {"boundary": "upper.top", "y": -largest, "factors": [depth / largest for depth in depths]},
        fixed("lower.left", "x"),
        fixed("upper.left", "x"),
    ]
    entry = {"boundary": "upper.bottom", "against": "lower.top"} | contact
    return Scene(body=body, material=MODULI, displacement=displacement, contact=entry, **settings)


@pytest.mark.one_quick(
    "contact",
    [
        {},
        {"sliding": "small"},
        {"sliding": "small", "distance": "nominal"},
        {"sliding": "small", "adjust": 0.1},
    ],
)
def test_blocks(contact):
    """Each is compressed by a fifth: the pressure of a block in plane strain, in closed form."""
    solution = alone(two_blocks(contact))
    assert solution.certificate.holds
    assert solution.contact.pressure == pytest.approx(-stress_of_block(0.8, 1), rel=1e-4)


def test_rubber_under_steel():
    """The law of the steel does not decide how the volume of the rubber is integrated."""
    pressures = []
    for law in ("neo-hooke", "saint-venant-kirchhoff"):
        scene = two_blocks({"friction": coulomb_friction(0.5)}).model_dump(exclude_unset=True)
        rubber = {"law": "neo-hooke", "young": 1.0, "poisson": 0.499, "region": "lower"}
        steel = {"law": law, "young": 1e5, "poisson": 0.3, "region": "upper"}
        scene |= {"material": [rubber, steel], "element": {"volumetric": "auto"}}
        scene["displacement"] = [
            fixed("lower.bottom"),
            {"boundary": "upper.top", "x": 0, "y": -0.1},
        ]
        solution = alone(Scene(**scene))
        assert not [found for found in solution.findings if "too stiff" in found.message]
        pressures.append(solution.contact.pressure)
    assert pressures[1] == pytest.approx(pressures[0], rel=1e-3)


def placed(shift, way, contact, law="neo-hooke"):
    """A block that moves, from a place to the right of a longer one, and is pressed onto it."""
    return Scene(
        body=[
            {"name": "low", "mesh": rectangle_mesh(10, 3, length=4.0)},
            {"name": "up", "mesh": rectangle_mesh(3, 3), "shift": shift},
        ],
        material=LINEAR | ({"law": law} if law else {}),
        displacement=[
            fixed("low.bottom"),
            {"boundary": "up.top", "x": f"{way}*min(t, 1)", "y": "-0.6*max(t-1, 0)"},
        ],
        contact={"boundary": "up.bottom", "against": "low.top"} | contact,
        load_steps={"times": [1.0, 2.0], "steps": 3},
        solver={"algorithm": "alm"},
    )


@pytest.mark.mpi
def test_bodies_that_meet_later():
    """A block that faces the other one nowhere as it starts has, once it is there, the forces of
    one that started there, in whichever side's points.
    """
    reach = {"reach": 0.5, "points": "against"}
    over, beside = (solve(placed(*where, reach)) for where in (([1.3, 1.5], 0), ([6.3, 1.5], -5)))
    assert over.converged
    assert beside.converged
    ends = [np.sum(one.steps[-1].contact.forces, axis=0) for one in (over, beside)]
    assert abs(ends[0][1]) > 0.1
    np.testing.assert_allclose(*ends, atol=1e-8)
    forces = {row["boundary"]: row["force"] for row in beside.resultants.as_rows()}
    np.testing.assert_allclose(forces["low.top"], -np.array(forces["up.bottom"]), atol=1e-9)


@pytest.mark.parametrize(
    ("contact", "law", "said"),
    [
        ({}, "neo-hooke", r"contact\[0\]: no facet faces .* nonlinear and slide, give a reach"),
        ({"reach": 0.5}, None, r"contact\.reach: is for sides that slide"),
        (
            {"reach": 0.5, "sliding": "small"},
            "neo-hooke",
            r"contact\.reach: is for sides that slide",
        ),
        ({"reach": 0.0}, "neo-hooke", r"contact\.reach: .*greater than 0"),
    ],
)
def test_bodies_that_never_meet(contact, law, said):
    """Sides that do not face each other, and a reach that has no use, are refused with the cure."""
    with pytest.raises(SceneError, match=said):
        alone(placed([6.3, 1.5], -5, contact, law))


@pytest.mark.slow
@pytest.mark.parametrize("sliding", [True, "small"])
def test_forces_act_where_a_body_has_slid_to(sliding):
    """What acts on each body balances with its moment about any point, after it has slid by its
    length, or by a facet with partners that it keeps: then the moments on both bodies differ, as a
    warning says.
    """
    sizes = {"lower": (1.6, 0.4, 8), "upper": (0.6, 0.3, 4)}
    way = 0.3 if sliding is True else 0.05
    meshes = {
        name: rectangle_mesh(count, 2, length=length, height=height)
        for name, (length, height, count) in sizes.items()
    }
    scene = Scene(
        body=[
            {"name": "lower", "mesh": meshes["lower"]},
            {"name": "upper", "mesh": meshes["upper"], "shift": [0.2, 0.4]},
        ],
        material=MODULI,
        displacement=[
            fixed("lower.bottom"),
            {"boundary": "upper.top", "x": f"{way}*(t - 1)", "y": -0.02},
        ],
        contact={
            "boundary": "upper.bottom",
            "against": "lower.top",
            "friction": coulomb_friction(0.3),
        }
        | ({} if sliding is True else {"sliding": sliding}),
        load_steps={"times": [1.0, 2.0, 3.0]},
    )
    solution = alone(scene)
    rows = {row.boundary: row for row in solution.resultants.every()}
    held = rows["upper.top"]
    for contact, support in (("upper.bottom", "upper.top"), ("lower.top", "lower.bottom")):
        assert rows[contact].force == pytest.approx(
            -rows[support].force, abs=1e-7 * abs(held.force[1])
        )
        assert rows[contact].moment == pytest.approx(-rows[support].moment, rel=1e-5)
    if sliding is True:
        assert 0.8 < rows["upper.bottom"].acts_at[0] < 1.4
        return
    assert sum("keep their partners" in found.message for found in solution.findings) == 1
    apart = abs(rows["upper.bottom"].moment + rows["lower.top"].moment)
    assert apart > 0.1 * abs(rows["upper.bottom"].moment)


def test_bonds():
    """Tied sides of the same blocks, which pull, too."""
    solution = alone(two_blocks({"kind": "bonded", "sliding": "small"}, depths=(-0.4,)))
    assert solution.certificate.holds
    assert solution.contact.pressure == pytest.approx(-stress_of_block(1.2, 1), rel=1e-4)


def test_what_is_refused():
    """By the key; between linear bodies nothing slides."""
    with pytest.raises(SceneError, match="sliding: is for contact against another boundary"):
        two_blocks({"against": None, "sliding": "small"})
    for key, value in {"kind": "bonded", "distance": "nominal", "adjust": 0.1}.items():
        with pytest.raises(
            SceneError,
            match=rf"contact\[0\].{key}: .* where sides slide.* give sliding = \"small\"",
        ):
            alone(two_blocks({key: value}))


@pytest.mark.slow
def test_a_stiff_block_slides_on_a_soft_one_with_its_corners():
    """Where the sets of the linearised problem cycle, one without the curvature of the last
    tractions has a solution; friction is that of the whole pressure at last.
    """
    sizes = {"lower": (3.0, 1.0, 24, 8), "upper": (1.0, 0.8, 9, 7)}
    names = ("length", "height", "nx", "ny")
    meshes = {
        name: rectangle_mesh(**dict(zip(names, size, strict=True))) for name, size in sizes.items()
    }
    law = {"law": "neo-hooke", "poisson": 0.3}
    slides = 10
    scene = Scene(
        body=[
            {"name": "lower", "mesh": meshes["lower"]},
            {"name": "upper", "mesh": meshes["upper"], "shift": [0.5, 1.0]},
        ],
        material=[{"region": "lower", "young": 1.0} | law, {"region": "upper", "young": 2.0} | law],
        displacement=[
            fixed("lower.bottom"),
            {"boundary": "upper.top", "x": "max(t - 1, 0)", "y": "-0.15*min(t, 1)"},
        ],
        contact={
            "boundary": "upper.bottom",
            "against": "lower.top",
            "friction": coulomb_friction(0.15),
        },
        load_steps={
            "times": [1 / 3, 2 / 3, 1.0, *(1 + 0.5 * (k + 1) / slides for k in range(slides))]
        },
    )
    solution = alone(scene)
    assert solution.certificate.holds
    assert solution.contact.in_contact.sum() >= 8
    pressed = solution.contact.pressure > 0.0
    share = np.abs(solution.contact.shear[pressed, 0]) / solution.contact.pressure[pressed]
    assert share == pytest.approx(0.15, rel=1e-6)
