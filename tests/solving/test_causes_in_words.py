"""What is said of a load step that has no solution is of that step, and of its cause."""

import pytest
from scene_tables import coulomb_friction, fixed, rectangle_mesh
from scenes import alone

from signorini_fx import ConvergenceError, Scene, Status
from signorini_fx.scenes.reading import parse_scene

ELASTIC = {"young": 100.0, "poisson": 0.3}
RUBBER = {"law": "neo-hooke", **ELASTIC}
COULOMB = coulomb_friction(0.3)
# At which factor of the push each of three blocks slides.
LIMITS = (1.9, 1.95, 1.99)


def pushed(material, limits=LIMITS):
    """Blocks that are pressed, and pushed up to twice a force by which each slides at a factor."""
    size = {"length": 2.0, "height": 1.0, "nx": 6, "ny": 3}
    mesh = rectangle_mesh(**size)
    names = [f"b{number}" for number in range(len(limits))]
    traction = []
    for name, limit in zip(names, limits, strict=True):
        press = {"boundary": f"{name}.top", "y": -0.5, "factors": [1.0, 1.0]}
        push = {"boundary": f"{name}.top", "x": 0.3 * 0.5 / limit, "factors": [0.0, 2.0]}
        traction += [press, push]
    return Scene(
        body=[
            {"name": name, "mesh": mesh, "shift": [3.0 * number, 0.0]}
            for number, name in enumerate(names)
        ],
        material=material,
        traction=traction,
        contact=[{"boundary": f"{name}.bottom", "friction": COULOMB} for name in names],
        load_steps={"steps": 4},
    )


def failing(scene):
    """The error of a scene without a solution."""
    with pytest.raises(ConvergenceError) as raised:
        alone(scene)
    return raised.value


def test_the_block_that_slides_is_named_alone():
    """The others would slide at larger factors, which have not been reached."""
    error = failing(pushed(ELASTIC))
    assert error.solution.status is Status.SLIDES
    assert "body 'b0'" in str(error)
    assert "body 'b1'" not in str(error)
    assert "factor 2" not in str(error)
    held = error.solution.last_step.place * 2.0
    assert f"({held:.4g} times traction[1]" in error.solution.advice
    assert 1.88 < held < 1.9


@pytest.mark.slow
def test_a_block_that_slides_and_would_tip_further_on():
    """At twice the force it would tip; it slides before, and that is what is said."""
    scene = pushed(ELASTIC, (1.96,)).model_dump(exclude_unset=True)
    scene["body"][0]["mesh"]["parameters"] |= {"height": 3.28, "ny": 9}
    error = failing(parse_scene(scene))
    assert error.solution.status is Status.SLIDES
    assert "tips" not in str(error)


def test_friction_that_is_too_small_for_a_nonlinear_body():
    """The tangent slides: a force is too large or friction too small, whatever the material is."""
    error = failing(pushed(RUBBER, (1.9,)))
    solution = error.solution
    assert solution.status is Status.LIMIT
    assert "slides, no static equilibrium" in str(error)
    assert "raise the friction" in solution.advice
    assert "neo-Hooke" not in str(error)
    held = solution.last_step.place * 2.0
    assert f"({held:.4g} times traction[1])" in str(error)
    assert 1.88 < held < 1.91


def test_a_section_that_yields():
    """It carries no larger load, which no cell that is turned inside out explains."""
    mesh = rectangle_mesh(8, 4, length=2.0)
    scene = Scene(
        mesh=mesh,
        material={"law": "j2", **ELASTIC, "yield_stress": 0.3},
        displacement=fixed("left", "x"),
        traction={"boundary": "top", "y": -1.0},
        contact={"boundary": "bottom"},
        load_steps={"steps": 4},
    )
    error = failing(scene)
    assert error.solution.status is Status.LIMIT
    assert "the displacement runs away" in str(error)
    assert "inside out" not in str(error)
    assert "take a material that hardens" in error.solution.advice
    # Of plane strain 2 / sqrt(3) times the yield stress.
    assert error.solution.last_step.place == pytest.approx(0.3 * 2 / 3**0.5 - 1, abs=0.01)


PIN = """
SetFactory("OpenCASCADE");
Disk(1) = {0, 0, 0, 2}; Disk(2) = {0, 0, 0, 1};
BooleanDifference(5) = { Surface{1}; Delete; }{ Surface{2}; Delete; };
Disk(3) = {0, 0, 0, 0.97}; Disk(4) = {0, 0, 0, 0.3};
BooleanDifference(6) = { Surface{3}; Delete; }{ Surface{4}; Delete; };
Physical Surface("eye") = {5}; Physical Surface("pin") = {6};
Mesh.MeshSizeMax = 0.2;
"""


def test_a_pin_that_turns_freely_in_an_eye(tmp_path):
    """Its facets would hold it by all of their points; those that press do not."""
    pytest.importorskip("gmsh")
    path = tmp_path / "pin.geo"
    path.write_text(PIN, encoding="utf-8")
    radius = "sqrt(x[0]**2 + x[1]**2)"
    boundaries = {
        "rim": f"{radius} > 1.99",
        "eye": f"abs({radius} - 1) < 0.02",
        "pin": f"abs({radius} - 0.97) < 0.01",
        "bore": f"{radius} < 0.31",
    }
    scene = {
        "mesh": {"file": str(path), "boundaries": boundaries},
        "material": ELASTIC,
        "displacement": fixed("rim"),
        "traction": {"boundary": "bore", "y": -1.0},
        "contact": {"boundary": "pin", "against": "eye"},
    }
    error = failing(parse_scene(scene))
    assert error.solution.status is Status.NOT_HELD
    assert "body 'pin'" in error.solution.advice
    assert "neither supports nor pressed contact hold" in error.solution.advice
    assert "in rotations: prescribe a displacement" in error.solution.advice
