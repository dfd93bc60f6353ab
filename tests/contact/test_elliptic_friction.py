"""Friction that depends on the direction: limits and slip by hand, the disc, a cone programme,
errors.
"""

import numpy as np
import pytest
from mpi4py import MPI
from numpy.testing import assert_allclose
from on_meshes import turn_by
from scene_tables import coulomb_friction, fixed, tresca_friction
from scenes import alone
from spaces import block, box, brick

from benchmarks.stability.oracle import convex
from benchmarks.stability.oracle.judge import FAILURES, RIGHT, judge
from benchmarks.stability.oracle.package import answer_of, solution_of
from benchmarks.stability.oracle.scenes import Trial
from benchmarks.stability.oracle.units import same
from signorini_fx import SceneError
from signorini_fx.records import Status
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.reading import parse_scene

F1, F2 = 0.4, 0.15
AXIS = 0.5
ALONG = [float(np.cos(AXIS)), float(np.sin(AXIS)), 0.3]  # its part along the normal does not count
PRESS = 10.0  # of the brick
LAWS = {
    "coulomb": {"law": "coulomb", "coefficient": F1, "ratio": F2 / F1, "along": ALONG},
    "tresca": {"law": "tresca", "bound": F1 * PRESS, "ratio": F2 / F1, "along": ALONG},
}


def in_axes(vector):
    """Components along the axes of the ellipse."""
    turn = np.array([[np.cos(AXIS), np.sin(AXIS)], [-np.sin(AXIS), np.cos(AXIS)]])
    return turn @ np.asarray(vector)[:2]


def limit(angle):
    """Largest tangential force over the normal one in a direction: that to the ellipse."""
    c, s = in_axes([np.cos(angle), np.sin(angle)])
    return 1 / np.hypot(c / F1, s / F2)


# --- by hand --------------------------------------------------------------------------------------


def inclined(law, angle, slope):
    """The brick on a plane that is inclined by ``slope`` = tan, down in a direction, in the frame
    of the plane.
    """
    weight = PRESS * 4.0
    pull = slope * weight / 4.0 * turn_by(angle)[:, 0]  # per volume
    contact = {"boundary": "bottom", "friction": LAWS[law]}
    press = {"boundary": "top", "pressure": PRESS}
    force = {"x": float(pull[0]), "y": float(pull[1])}
    mesh = box("hexahedra", (4, 4, 2), size=(2.0, 2.0, 1.0))
    return brick({}, mesh=mesh, traction=press, contact=contact, body_force=force)


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("angle", [1.2, 4.4])
def test_critical_slope(law, angle):
    """It rests just below the slope of the ellipse in that direction, and slides above; half of it
    uses half of it.
    """
    critical = limit(angle)
    held = alone(inclined(law, angle, 0.9999 * critical))
    assert held.converged
    force = -held.contact.forces[1][:2] / (PRESS * 4.0)
    assert_allclose(force, 0.9999 * critical * turn_by(angle)[:, 0], rtol=1e-6)
    assert held.contact_figures[0].friction_limit == pytest.approx(critical * PRESS * 4.0, rel=1e-6)
    assert alone(inclined(law, angle, 1.0001 * critical), check=False).status is Status.SLIDES
    assert alone(inclined(law, angle, 0.5 * critical)).friction_used == pytest.approx(0.5, rel=1e-6)


def slips_normal_to_the_ellipse(scene, law):
    """All points slip where a motion drives them: the shear is where the ellipse has this
    normal.
    """
    settings = {"largest_deformation": 50.0, "tolerance": 1e-12}
    solution = alone(
        scene.model_copy(update={"solver": scene.solver.model_copy(update=settings)}), check=False
    )
    assert solution.converged
    assert solution.certificate.holds
    c = solution.table.columns
    here = c["state"] == "slip"
    assert here.sum() > 0.7 * here.size
    shear = in_axes(np.stack((c["shear_x"][here], c["shear_y"][here])))
    slip = in_axes(np.stack((c["slip_x"][here], c["slip_y"][here])))
    size = np.multiply.outer(
        [F1, F2], c["pressure"][here] if law == "coulomb" else PRESS + 0 * here[here]
    )
    assert_allclose(np.hypot(shear[0] / size[0], shear[1] / size[1]), 1.0, rtol=1e-9)
    xi = slip - shear / solution.certificate.law.gamma_t / np.array(
        [[1.0], [(F2 / F1) ** 2]]
    )  # less the elastic slip
    normal = shear / size**2
    assert_allclose(
        xi[0] * normal[1], xi[1] * normal[0], atol=1e-9 * np.abs(xi[0] * normal[1]).max()
    )
    assert (xi * normal).sum(axis=0).min() > 0
    return solution


@pytest.mark.parametrize("law", LAWS)
def test_driven(law):
    """The top moves sideways."""
    drive = {
        "boundary": "top",
        "x": 5 * float(np.cos(1.0)),
        "y": 5 * float(np.sin(1.0)),
        "z": -0.01,
    }
    scene = brick(
        {}, contact={"boundary": "bottom", "friction": LAWS[law]}, traction=(), displacement=drive
    )
    slips_normal_to_the_ellipse(scene, law)


# --- the disc, and the same ellipse by its other axis ---------------------------------------------


def pulled(friction, nx=6, **solver):
    """The block over a paraboloid, pulled along x[1], with stick and slip."""
    return with_friction(block(nx, coefficient=0.3, **solver), friction)


def with_friction(scene, friction):
    """The same with another friction law."""
    return scene.model_copy(update={"contact": changed(scene, friction)})


def changed(scene, friction):
    """The contact of a scene with another friction law."""
    return (scene.contact[0].model_copy(update={"friction": friction}),)


def law_of(**more):
    """A friction law as a scene has it."""
    data = {"mesh": box("hexahedra", (1, 1, 1)), "material": {"young": 1.0, "poisson": 0.0}}
    return (
        parse_scene(data | {"contact": {"boundary": "bottom", "friction": more}})
        .contact[0]
        .friction
    )


def test_a_circle_is_the_disc():
    one, other = (
        alone(pulled(law_of(law="coulomb", coefficient=0.3, **more)))
        for more in ({}, {"ratio": 1.0, "along": ALONG})
    )
    y = one.displacement.x.array
    assert np.abs(other.displacement.x.array - y).max() <= 1e-11 * np.abs(y).max()
    assert other.history.linear_solves == one.history.linear_solves
    assert_allclose(other.table.columns["shear_y"], one.table.columns["shear_y"], atol=1e-9)


# --- independent judges ---------------------------------------------------------------------------


@pytest.mark.skipif(convex.cvxopt is None, reason="CVXOPT (python3-cvxopt) is missing")
@pytest.mark.one_quick("seed", range(3))
def test_cone_programme(seed, tmp_path):
    """Random scenes under the oracle, which solves given friction as a cone programme, and statics
    as another one.
    """
    from turned_scenes import block as turned_block
    from turned_scenes import scene as turned_scene

    rng = np.random.default_rng([5, seed])
    law = {"ratio": float(rng.uniform(0.2, 3.0)), "along": [float(v) for v in rng.normal(size=3)]}
    law |= tresca_friction(0.5) if seed < 2 else coulomb_friction(0.2)
    solver = {"algorithm": "alm"} if seed == 1 else {}
    traction = turned_scene({})["traction"]
    given = turned_scene(law, 1 + (seed == 2), solver, displacement=[], traction=traction)
    given["displacement"] = [fixed("left", "xyz")]
    given["traction"][0]["factors"] = [0.5, 1.0, 0.7]
    trial = Trial(
        0, given, turned_block("tetrahedron" if seed == 2 else "hexahedron", inner=0.03)[0], same(3)
    )
    answer = answer_of(solution_of(trial.write(tmp_path)), trial.units)
    verdict = judge(trial.scene, trial.mesh, answer)
    assert verdict.kind == RIGHT, (verdict.kind, verdict.figure, verdict.value)
    assert verdict.kind not in FAILURES
    assert verdict.compared >= 3


# --- what is refused and said ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("friction", "more", "place", "message"),
    [
        ({"ratio": 0.0}, {}, "contact.*friction.ratio", "must be above 0"),
        ({"ratio": "x[0] - 1"}, {}, "contact.*friction.ratio", "not negative"),
        ({"ratio": 0.5, "along": [1.0, 0.0]}, {}, "contact.friction.along", "at least 3"),
        ({"along": [1.0, 0.0, 0.0]}, {}, "contact.friction.along", "needs a ratio"),
        (
            {"ratio": 0.5, "along": [0.0, 0.0, 1.0]},
            {},
            "contact.*friction.along",
            "along the normal somewhere",
        ),
        (
            {"ratio": 0.5, "along": ["x[0]", "x[0]", 0.0]},
            {},
            "contact.*friction.along",
            "zero or along",
        ),
        (
            {"ratio": 0.5, "along": ALONG},
            {"displacement": fixed("left", "x")},
            "contact.*friction.along",
            "neither along nor across it",
        ),
    ],
)
def test_refused(friction, more, place, message):
    data = {
        "mesh": box("hexahedra", (2, 2, 1)),
        "material": {"young": 1000.0, "poisson": 0.3},
        "displacement": {"boundary": "top", "x": 0.0, "y": 0.0, "z": -0.01},
        "contact": {"boundary": "bottom", "friction": coulomb_friction(0.3) | friction},
    }
    with pytest.raises(SceneError, match=f"{place}.*{message}") as raised:
        check_scene(parse_scene(data | more), MPI.COMM_SELF)
    assert len(raised.value.problems) == 1
