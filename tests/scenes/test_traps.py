"""Results that must not be called right, and warnings that must not be kept: each ends in a name,
or is said.
"""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI
from pressed_block import block, check, contact, coulomb
from scene_tables import circle_shape, fixed, plane_shape, rectangle_mesh
from scenes import alone, example1

from signorini_fx.machine import parallel
from signorini_fx.mechanics.body.deformation import deformation_of
from signorini_fx.mechanics.body.discretisation import prepare
from signorini_fx.records import Status, Timings
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

WORLD = MPI.COMM_WORLD


def warned(found):
    """{path: message} of the warnings among findings."""
    return {finding.path: finding.message for finding in found if finding.level == "warning"}


# --- deformations that linear elasticity cannot mean ----------------------------------------------


def tall(**changes):
    """A body of 30 x 20 that its sides hold sideways, pressed onto a flat foundation."""
    data = {
        "mesh": rectangle_mesh(12, 8, length=30.0, height=20.0),
        "material": {"young": 5000.0, "poisson": 0.3},
        "displacement": [fixed(side, "x") for side in ("left", "right")],
        "traction": {"boundary": "top", "y": "-20 if 10 <= x[0] <= 20 else 0"},
        "contact": {"boundary": "bottom"},
    }
    return parse_scene({**data, **changes})


SOFT = {"young": 5.0, "poisson": 0.3}
ABSURD = {
    "a modulus in another unit": (
        tall(material=SOFT),
        "material, traction, body_force, displacement",
    ),
    "a modulus far from all": (
        tall(material={"young": 5e-9, "poisson": 0.3}),
        "material, traction, body_force, displacement",
    ),
    "a gap of more than the body": (
        tall(contact={"boundary": "bottom", "gap": 50.0}),
        "contact.gap, displacement",
    ),
    "without contact": (
        tall(material=SOFT, contact=[], displacement=fixed("left")),
        "material, traction, body_force, displacement",
    ),
    "a turn": (
        tall(traction=[], contact=[], displacement=[{"boundary": "left", "x": "-x[1]", "y": 0.0}]),
        "material, traction, body_force, displacement",
    ),
}


@pytest.mark.parametrize("case", ABSURD)
@pytest.mark.parametrize("algorithm", ["ssn", "alm"])
def test_what_linear_elasticity_cannot_mean(case, algorithm):
    """The outcome has a name, and the figures are said with what to look at."""
    scene, path = ABSURD[case]
    scene = scene.model_copy(
        update={"solver": scene.solver.model_copy(update={"algorithm": algorithm})}
    )
    solution = alone(scene, check=False)
    assert solution.status is Status.TOO_LARGE
    assert path in warned(solution.findings)
    for word in ("units", "gap", "loads"):
        assert word in solution.status.advice


@pytest.mark.parametrize("case", ABSURD)
def test_a_scene_may_raise_the_limit(case):
    """What is meant as mathematics is solved; the warning stays."""
    scene, path = ABSURD[case]
    allowed = scene.solver.model_copy(update={"largest_deformation": 1e12})
    solution = alone(scene.model_copy(update={"solver": allowed}))
    assert solution.converged
    assert path in warned(solution.findings)


FIELDS = {
    "quadrilaterals": rectangle_mesh(6, 2, length=3.0, height=1.0),
    "triangles": rectangle_mesh(6, 4, cell="triangle"),
    "distorted": {
        "generator": "block",
        "parameters": {"nx": 12, "ny": 4, "layout": "unstructured"},
    },
    "curved": {"generator": "ring_segment", "parameters": {"order": 2}},
}


@pytest.mark.mpi
@pytest.mark.parametrize("mesh", FIELDS)
@pytest.mark.parametrize("degree", [1, 2])
def test_figures_of_known_fields(mesh, degree):
    """An affine displacement has the gradient that it was made from; a smooth one that of an
    integral by UFL.
    """
    if mesh == "curved" and degree == 1:
        pytest.skip("linear elements do not go on curved cells")
    scene = parse_scene(
        {
            "mesh": FIELDS[mesh],
            "material": {"young": 1.0, "poisson": 0.3},
            "element": {"degree": degree},
        }
    )
    tagged = load_mesh(scene, WORLD)
    d = prepare(scene.statement, tagged, Timings())
    rng = np.random.default_rng(3)
    matrix, shift = rng.standard_normal((2, 2)), rng.standard_normal(2)
    field = fem.Function(d.space)
    field.interpolate(lambda x: matrix @ x[:2] + shift[:, None])
    found = deformation_of(d, field, d.tagged.size)
    if mesh != "curved":  # where an affine field is not in the space
        assert found.gradient == pytest.approx(np.linalg.norm(matrix), rel=1e-12)
    owned = field.x.array.reshape(-1, 2)
    furthest = parallel.global_max(WORLD, float(np.linalg.norm(owned, axis=1).max(initial=0.0)))
    assert found.displacement == pytest.approx(furthest / tagged.size, rel=1e-12)
    size = tagged.size
    field.interpolate(lambda x: np.sin(x[:2] / size) * np.cos(x[1::-1] / size))
    gradient = ufl.grad(field)
    one = fem.Constant(tagged.mesh, 1.0)
    dx = ufl.dx(metadata={"quadrature_degree": 6})
    integrals = [
        parallel.global_sum(WORLD, np.array(fem.assemble_scalar(fem.form(f * dx))))
        for f in (ufl.inner(gradient, gradient), one)
    ]
    assert deformation_of(d, field, d.tagged.size).gradient == pytest.approx(
        np.sqrt(integrals[0] / integrals[1]), rel=0.02
    )


# --- what check knows, solve says -----------------------------------------------------------------

TRIANGLES = rectangle_mesh(12, 4, cell="triangle")


@pytest.mark.mpi
def test_findings_are_the_same_on_every_rank():
    """No rank keeps a warning to itself, whatever it owns of the boundary; check warns of no
    more.
    """
    scene = block(material={"young": 5000.0, "poisson": 0.499}, mesh=TRIANGLES, **coulomb(1.5))
    told = [(f.level, f.path, f.message) for f in solve(scene, WORLD, check=False).findings]
    assert all(other == told for other in WORLD.allgather(told))
    assert told == [(f.level, f.path, f.message) for f in alone(scene, check=False).findings]
    assert warned(check(scene).findings).keys() <= {path for _, path, _ in told}


def test_nothing_is_said_where_nothing_hurts():
    """The plain block, and the first example of the paper."""
    for scene in (block(), example1(bound=1.5, gamma="auto", nx=30, ny=10)):
        assert warned(alone(scene).findings) == {}


PAD = {
    "mesh": rectangle_mesh(20, 2, length=10.0, height=1.0),
    "material": {"young": 100.0, "poisson": 0.3},
    "displacement": fixed("bottom"),
}
CIRCLE = circle_shape([5.0, 3.0], 2.0)
# A wide pad under 1 % of its modulus; a foundation that arrives later; soft contact, whose
# foundation enters the body.
SOUND = {
    "wide": {"traction": {"boundary": "top", "pressure": 1.0}},
    "arrives": {
        "contact": {"boundary": "top", "foundation": {**CIRCLE, "shift": [0.0, "-0.02*t"]}},
        "load_steps": {"times": [0.0, 1.0]},
    },
    "soft": {
        "displacement": {"boundary": "bottom", "x": 0.0, "y": 0.4},
        "contact": {"boundary": "top", "foundation": CIRCLE, "overclosure": {"stiffness": 1.0}},
    },
}


@pytest.mark.parametrize("name", SOUND)
def test_no_false_alarm(name):
    """Nothing is said before, nor with the result."""
    scene = parse_scene(PAD | SOUND[name])
    assert warned(check(scene).findings) == {}
    assert warned(alone(scene).findings) == {}


# --- directions -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("direction", "opposite"),
    [([0.0, 1.0], "[0, -1]"), ([0.5, 2.0], "[-0.5, -2]"), ([0.0, -1.0], None), ([1.0, -0.1], None)],
)
def test_a_direction_that_leads_into_the_body(direction, opposite):
    """The opposite is named; a direction that is only askew is one."""
    found = warned(check(block(**contact(direction=direction))).findings).get(
        "contact[0].direction", ""
    )
    assert ("opposite" in found) == (opposite is not None)
    assert opposite is None or f"the opposite, direction = {opposite}" in found


@pytest.mark.parametrize(
    ("normal", "warns"), [([0.0, -1.0], True), ([0.0, 1.0], False), ([0.5, 1.0], False)]
)
def test_a_plane_that_faces_away(normal, warns):
    """Nothing would be in contact, as the body is behind the plane's back."""
    plane = {"boundary": "bottom", "foundation": plane_shape([0.0, 0.0], normal)}
    found = warned(check(tall(contact=plane)).findings).get("contact[0].foundation", "")
    assert ("no facet of the boundary faces the foundation" in found) == warns
