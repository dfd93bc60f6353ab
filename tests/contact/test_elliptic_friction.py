"""Friction that depends on the direction: limits and slip by hand, the disc, a cone programme, products, errors."""

import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import ufl
from mpi4py import MPI
from scenes import alone
from scipy.optimize import minimize_scalar
from shifted_problems import shifted
from spaces import block, box
from test_space_statics import PRESS, brick

from signorini_fx import ContactProblem, Coulomb, Foundation, SceneError
from signorini_fx.algebra.contact.active_sets import multipliers, natural_sets, tangent
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.laws.directed import FrictionAxes
from signorini_fx.records import Status
from signorini_fx.results.certificate.certificate import certify
from signorini_fx.results.certificate.law_of_method import Tractions
from signorini_fx.results.contact_boundaries import _largest_resultant
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

sys.path.insert(0, str(Path(__file__).parents[2]))
from benchmarks.stability.oracle import convex
from benchmarks.stability.oracle.judge import FAILURES, RIGHT
from benchmarks.stability.oracle.package import answer_of, solution_of
from benchmarks.stability.oracle.scenes import Trial
from benchmarks.stability.oracle.space.judge import judge
from benchmarks.stability.oracle.units import same

COMM = MPI.COMM_WORLD
F1, F2 = 0.4, 0.15
AXIS = 0.5
ALONG = [float(np.cos(AXIS)), float(np.sin(AXIS)), 0.3]  # its part along the normal does not count
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


# --- by hand ---------------------------------------------------------------------------------------------------------


def inclined(law, angle, slope):
    """The brick on a plane that is inclined by ``slope`` = tan, down in a direction, in the frame of the plane."""
    weight = PRESS * 4.0
    pull = slope * weight / 4.0 * np.array([np.cos(angle), np.sin(angle)])  # per volume
    contact = {"boundary": "bottom", "friction": LAWS[law]}
    press = {"boundary": "top", "pressure": PRESS, "live": False}
    force = {"x": float(pull[0]), "y": float(pull[1]), "live": True}
    mesh = box("hexahedra", (4, 4, 2), size=(2.0, 2.0, 1.0))
    return brick({}, mesh=mesh, traction=press, contact=contact, body_force=force)


@pytest.mark.one_quick
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("angle", [1.2, 4.4])
def test_critical_slope(law, angle):
    """It rests just below the slope of the ellipse in that direction, and slides above; the safety factor says so."""
    critical = limit(angle)
    held = alone(inclined(law, angle, 0.9999 * critical))
    assert held.converged
    force = -held.contact.forces[1][:2] / (PRESS * 4.0)
    np.testing.assert_allclose(force, 0.9999 * critical * np.array([np.cos(angle), np.sin(angle)]), rtol=1e-6)
    assert held.contact_figures[0].friction_limit == pytest.approx(critical * PRESS * 4.0, rel=1e-6)
    assert alone(inclined(law, angle, 1.0001 * critical), check=False).status is Status.SLIDES
    safety = alone(inclined(law, angle, 0.5 * critical)).safety
    assert safety.factor == pytest.approx(2.0, rel=1e-8)
    assert safety.bound == pytest.approx(2.0, rel=1e-6)
    # It slides normal to the ellipse, and not where it is pushed.
    push = in_axes([np.cos(angle), np.sin(angle)])
    way = push / np.array([F1, F2]) ** 2
    told = np.array([float(word) for word in safety.motion.partition("(")[2].rstrip(")").split(",")])
    np.testing.assert_allclose(in_axes(told), way / np.linalg.norm(way), atol=6e-3)  # as it is rounded


def test_limit_of_ellipses_that_cross():
    """Two ellipses across each other transmit more together than twice what one does in the direction between them."""
    ratio, between = 0.1, np.array([1.0, 1.0, 0.0])
    crossed = np.array([[[1.0, 0], [0, ratio], [0, 0]], [[0, ratio], [1.0, 0], [0, 0]]])
    found = _largest_resultant(crossed, np.array([0.5, 0.5]), 3.0 * between, MPI.COMM_SELF)
    assert found == pytest.approx(np.sqrt((1 + ratio**2) / 2))
    alike = _largest_resultant(crossed[:1], np.ones(1), 3.0 * between, MPI.COMM_SELF)
    assert alike == pytest.approx(np.sqrt(2 / (1 + ratio**-2)))
    assert _largest_resultant(crossed, np.array([0.5, 1.5]), 0 * between, MPI.COMM_SELF) == pytest.approx(2.0)


def slips_normal_to_the_ellipse(scene, law):
    """All points slip where a motion drives them: the shear is where the ellipse has this normal."""
    settings = {"largest_deformation": 50.0, "tolerance": 1e-12}
    solution = alone(scene.model_copy(update={"solver": scene.solver.model_copy(update=settings)}), check=False)
    assert solution.converged
    assert solution.certificate.holds
    c = solution.table.columns
    here = c["state"] == "slip"
    assert here.sum() > 0.7 * here.size
    shear = in_axes(np.stack((c["shear_x"][here], c["shear_y"][here])))
    slip = in_axes(np.stack((c["slip_x"][here], c["slip_y"][here])))
    size = np.multiply.outer([F1, F2], c["pressure"][here] if law == "coulomb" else PRESS + 0 * here[here])
    np.testing.assert_allclose(np.hypot(shear[0] / size[0], shear[1] / size[1]), 1.0, rtol=1e-9)
    xi = slip - shear / solution.certificate.law.gamma_t / np.array([[1.0], [(F2 / F1) ** 2]])  # less the elastic slip
    normal = shear / size**2
    np.testing.assert_allclose(xi[0] * normal[1], xi[1] * normal[0], atol=1e-9 * np.abs(xi[0] * normal[1]).max())
    assert (xi * normal).sum(axis=0).min() > 0
    return solution


@pytest.mark.parametrize("law", LAWS)
def test_driven(law):
    """The top moves sideways."""
    drive = {"boundary": "top", "x": 5 * float(np.cos(1.0)), "y": 5 * float(np.sin(1.0)), "z": -0.01}
    scene = brick({}, contact={"boundary": "bottom", "friction": LAWS[law]}, traction=(), displacement=drive)
    slips_normal_to_the_ellipse(scene, law)


def under_a_tool(law, force, **prescribed):
    """A brick that stands fast, and a plate on it that forces move without turning it."""
    held = {"rotation_x": 0.0, "rotation_y": 0.0, "rotation_z": 0.0}
    plate = {"shape": "plane", "point": [0, 0, 1.0], "normal": [0, 0, -1], "pivot": [1.0, 1.0, 1.0]}
    tool = plate | {"force": [*map(float, force), -4.0 * PRESS], "prescribed": held | prescribed}
    fixed = {"boundary": "bottom", "x": 0.0, "y": 0.0, "z": 0.0}
    contact = {"boundary": "top", "foundation": tool, "friction": LAWS[law]}
    mesh = box("hexahedra", (4, 4, 2), size=(2.0, 2.0, 1.0))
    return brick({}, mesh=mesh, traction=(), displacement=fixed, contact=contact)


def on_a_brick(law, force=(0.0, 0.0), side="boundary", cells="hexahedra", **drive):
    """A brick on one that stands fast, whose mesh is another one; side: that has the contact points."""
    upper, lower = (box(cells, (n, n, 2), size=(2.0, 2.0, 1.0)) for n in (4, 3))
    moved = [{"boundary": "upper.top", **drive}] if drive else []
    contact = {"boundary": "upper.bottom", "against": "lower.top", "points": side, "friction": LAWS[law]}
    return parse_scene(
        {
            "body": [{"name": "upper", "mesh": upper, "shift": [0, 0, 1.0]}, {"name": "lower", "mesh": lower}],
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": [{"boundary": "lower.bottom", "x": 0.0, "y": 0.0, "z": 0.0}, *moved],
            "traction": [] if drive else [{"boundary": "upper.top", "pressure": PRESS}],
            "body_force": {axis: float(part) / 4.0 for axis, part in zip("xy", force, strict=True)},
            "contact": contact,
        }
    )


@pytest.mark.one_quick
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(
    ("scene", "keys"), [(under_a_tool, {}), (on_a_brick, {"side": "against"}), (on_a_brick, {"cells": "tetrahedra"})]
)
def test_limit_of_tools_and_bodies(law, scene, keys):
    """A tool and a body that are pushed hold up to the ellipse, and slide beyond it."""
    angle = 1.2
    push = limit(angle) * 4.0 * PRESS * np.array([np.cos(angle), np.sin(angle)])
    held = alone(scene(law, 0.999 * push, **keys), check=False)
    assert held.certificate.holds
    np.testing.assert_allclose(np.abs(held.contact.forces[1][:2]), 0.999 * push, rtol=1e-6)
    assert alone(scene(law, 1.001 * push, **keys), check=False).status is Status.SLIDES


def test_lift_of_bodies():
    """What gives the points any relative displacement is inverse to the map, along the axes of the ellipse too."""
    contact = alone(on_a_brick("coulomb", (1.0, 1.0))).model.elasticity([]).contact
    product = contact.operator.matMult(contact.lift)
    product.shift(-1.0)
    assert product.norm() < 1e-13


@pytest.mark.one_quick
@pytest.mark.parametrize("law", LAWS)
def test_driven_tools_and_bodies(law):
    """A tool and a body that move sideways."""
    x, y = 5 * float(np.cos(1.0)), 5 * float(np.sin(1.0))
    slips_normal_to_the_ellipse(under_a_tool(law, (0.0, 0.0), x=x, y=y), law)
    slips_normal_to_the_ellipse(on_a_brick(law, x=x, y=y, z=-0.02), law)


def test_law_and_its_derivative():
    """The shear of any displacement is nearest to what the springs of the law want, and D its derivative."""
    rng = np.random.default_rng(3)
    count, gamma, bound = 12, 40.0, rng.uniform(0.5, 2.0, 12)
    normal, along = (rng.normal(size=(count, 3)) for _ in range(2))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    ratio = rng.uniform(0.2, 3.0, count)
    nodes = np.arange(count, dtype=np.int32)
    boundary = ContactBoundary(
        MPI.COMM_SELF, nodes, np.zeros((count, 3)), np.ones(count), normal, 0 * nodes, np.ones((count, 3), bool),
        np.zeros((0, 5), np.int64), nodes.astype(np.int64), friction_axes=FrictionAxes(along, ratio),
    )  # fmt: skip
    data = shifted(np.zeros(count), 10.0, gamma, np.inf, np.zeros(count), np.zeros((count, 2)), bound)

    def force(y):
        u_n, u_t = boundary.traces(y)
        return boundary.nodal_forces(*multipliers(natural_sets(u_n, u_t, data), u_n, u_t, data))

    y = rng.normal(scale=0.1, size=(count, 3))
    sets = natural_sets(*boundary.traces(y), data)
    assert sets.slip.sum() > 3
    derivative = np.einsum("nij,njk,nlk->nil", boundary.frames, tangent(sets, data), boundary.frames)
    for k in range(3):
        step = np.zeros((count, 3))
        step[:, k] = 1e-6
        np.testing.assert_allclose(
            (force(y + step) - force(y - step)) / 2e-6, derivative[:, :, k], rtol=1e-6, atol=1e-6
        )
    # Of the admissible shears it is the one that minimises |mu|^2 / (2 gamma) - mu . s in the metric of its springs.
    first = along - (along * normal).sum(axis=1)[:, None] * normal
    first /= np.linalg.norm(first, axis=1)[:, None]
    second = np.cross(normal, first)
    found = force(y)
    for n in range(count):
        s = np.array([y[n] @ first[n], y[n] @ second[n]])
        want = gamma * s * np.array([1.0, ratio[n] ** 2])
        if np.hypot(want[0], want[1] / ratio[n]) > bound[n]:

            def missed(t, n=n, want=want):
                mu = bound[n] * np.array([np.cos(t), ratio[n] * np.sin(t)])
                return ((mu - want) ** 2 / np.array([1.0, ratio[n] ** 2])).sum()

            at = min(
                (minimize_scalar(missed, bounds=ends, method="bounded", options={"xatol": 1e-12})
                 for ends in pairwise(np.linspace(0, 2 * np.pi, 9))),
                key=lambda one: one.fun,
            ).x  # fmt: skip
            want = bound[n] * np.array([np.cos(at), ratio[n] * np.sin(at)])
        np.testing.assert_allclose([found[n] @ first[n], found[n] @ second[n]], want, rtol=1e-6, atol=1e-7)


# --- the disc, and the same ellipse by its other axis ----------------------------------------------------------------


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
    return parse_scene(data | {"contact": {"boundary": "bottom", "friction": more}}).contact[0].friction


def test_a_circle_is_the_disc():
    one, other = (
        alone(pulled(law_of(law="coulomb", coefficient=0.3, **more))) for more in ({}, {"ratio": 1.0, "along": ALONG})
    )
    y = one.displacement.x.array
    assert np.abs(other.displacement.x.array - y).max() <= 1e-11 * np.abs(y).max()
    assert other.history.linear_solves == one.history.linear_solves
    np.testing.assert_allclose(other.table.columns["shear_y"], one.table.columns["shear_y"], atol=1e-9)


@pytest.mark.one_quick
@pytest.mark.parametrize("algebra", ["full", "condensed", "krylov"])
def test_the_other_axis(algebra):
    """F_1 along x[0] and F_2 across it is F_2 along x[1] and F_1 across; without regularisation they are one law."""
    laws = [{"coefficient": 0.4, "ratio": 0.25}, {"coefficient": 0.1, "ratio": 4.0, "along": [0.0, 1.0, 0.0]}]
    one, other = (
        alone(pulled(law_of(law="coulomb", **law), algorithm="alm", linear_algebra=algebra, tolerance=1e-10))
        for law in laws
    )
    assert one.certificate.holds
    assert other.certificate.holds
    assert one.linear_algebra.startswith(algebra)
    assert {"stick", "slip"} <= set(one.table.columns["state"])
    for name in ("pressure", "shear_x", "shear_y"):
        a, b = (solution.table.columns[name] for solution in (one, other))
        np.testing.assert_allclose(a, b, atol=1e-6 * one.table.columns["pressure"].max())


# --- independent judges ----------------------------------------------------------------------------------------------


def test_certificate_sees_a_disc():
    """Tractions on the ellipse break the law of the disc and of another ellipse, and those of the disc that."""
    friction = law_of(law="coulomb", coefficient=0.4, ratio=0.25, along=ALONG)
    solution = alone(pulled(friction, algorithm="alm"))
    disc = alone(pulled(law_of(law="coulomb", coefficient=0.4), algorithm="alm"))
    for answer, other, figure in (
        (solution, law_of(law="coulomb", coefficient=0.4), "slip_below_bound"),
        (disc, friction, "friction_cone"),
        (solution, law_of(law="coulomb", coefficient=0.4, ratio=0.25), "friction_cone"),
    ):
        statement = answer.statement.changed(contact=changed(answer.statement, other))
        judged = certify(statement, answer.model.tagged, answer.displacement, Tractions.of(answer.contact))
        assert not judged.holds
        assert getattr(judged, figure) > 1e-3


@pytest.mark.one_quick
@pytest.mark.skipif(convex.cvxopt is None, reason="CVXOPT (python3-cvxopt) is missing")
@pytest.mark.parametrize("seed", range(3))
def test_cone_programme(seed, tmp_path):
    """Random scenes under the oracle, which solves given friction as a cone programme, and statics as another one."""
    from test_judge_space import block as turned_block
    from test_judge_space import scene as turned_scene

    rng = np.random.default_rng([5, seed])
    law = {"ratio": float(rng.uniform(0.2, 3.0)), "along": [float(v) for v in rng.normal(size=3)]}
    law |= {"law": "tresca", "bound": 0.5} if seed < 2 else {"law": "coulomb", "coefficient": 0.2}
    solver = {"algorithm": "alm"} if seed == 1 else {}
    traction = turned_scene({})["traction"]
    given = turned_scene(law, 1 + (seed == 2), solver, displacement=[], traction=traction)
    given["displacement"] = [{"boundary": "left", "x": 0.0, "y": 0.0, "z": 0.0}]
    given["traction"][0]["factors"] = [0.5, 1.0, 0.7]
    trial = Trial(0, given, turned_block("tetrahedron" if seed == 2 else "hexahedron", inner=0.03)[0], same(3))
    answer = answer_of(solution_of(trial.write(tmp_path)), trial.units)
    verdict = judge(trial.scene, trial.mesh, answer)
    assert verdict.kind == RIGHT, (verdict.kind, verdict.figure, verdict.value)
    assert verdict.kind not in FAILURES
    assert verdict.compared >= 3


# --- products --------------------------------------------------------------------------------------------------------


PRODUCTS = {
    "mesh": {
        "generator": "box",
        "parameters": {"length": 3.0, "width": 1.0, "height": 1.0, "nx": 6, "ny": 2, "nz": 2},
    },
    "material": {"young": 5000.0, "poisson": 0.3},
    "displacement": {"boundary": "left", "x": 0.0, "y": 0.0, "z": 0.0},
    "traction": {"boundary": "top", "y": 4.0, "z": -20.0, "x": 3.0},
    "contact": {
        "boundary": "bottom",
        "gap": 0.0,
        "friction": {
            "law": "coulomb",
            "coefficient": "0.3 + 0.1*x[0]",
            "ratio": "0.5 + 0.1*x[1]",
            "along": ["cos(x[0])", "sin(x[0])", 0.0],
        },
    },
    "solver": {"algorithm": "alm"},
}
IN_STEPS = {**PRODUCTS, "traction": {**PRODUCTS["traction"], "factors": [0.5, 1.0]}}


@pytest.mark.one_quick
@pytest.mark.mpi(slow=True)
@pytest.mark.parametrize(
    ("data", "more", "share"),
    [
        (IN_STEPS, {"linear_algebra": "krylov"}, 1e-6),
        (IN_STEPS, {"algorithm": "ssn", "gamma_n": 1e8, "gamma_t": 1e8}, 1e-3),
        (IN_STEPS, {"coulomb": "newton"}, 1e-6),
        (PRODUCTS, {"levels": 2}, 1e-5),
    ],
    ids=["krylov", "ssn", "newton", "levels"],
)
def test_products(data, more, share):
    """Ranks, linear algebra, a direction field, load steps, levels: the solution of one rank by the plain way."""
    wanted, found = alone(parse_scene(data)), solve(parse_scene(data | {"solver": data["solver"] | more}), COMM)
    assert wanted.certificate.holds
    assert found.certificate.holds
    force, y = (np.sum(solution.contact.forces, axis=0) for solution in (found, wanted))
    np.testing.assert_allclose(force, y, rtol=0, atol=share * np.abs(y).max())


def sphere(x):
    """The gap of ``block``."""
    return 0.003 * ((x[0] - 1.5) ** 2 + (x[1] - 0.5) ** 2) + 0.001


def test_own_forms():
    """``ContactProblem`` with the same law."""
    friction = Coulomb(0.3, ratio=0.3, along=(0.5, 1.0, 0.0))
    scene = alone(pulled(law_of(law="coulomb", coefficient=0.3, ratio=0.3, along=[0.5, 1.0, 0.0])))
    d = scene.model
    y, z = ufl.TrialFunction(d.space), ufl.TestFunction(d.space)
    mu, lame = 5000.0 / 2.8, 5000.0 * 0.4 / 1.4 / 0.2
    strain, stretched = ufl.sym(ufl.grad(y)), ufl.sym(ufl.grad(z))
    a = (2 * mu * ufl.inner(strain, stretched) + lame * ufl.div(y) * ufl.div(z)) * ufl.dx
    x = ufl.SpatialCoordinate(d.space.mesh)
    pressed = ufl.conditional(ufl.And(ufl.ge(x[0], 1.0), ufl.le(x[0], 2.0)), 1.0, 0.0)
    tags = d.tagged.facet_tags
    top = ufl.Measure("ds", d.space.mesh, subdomain_data=tags, metadata={"quadrature_degree": 20})
    L = ufl.inner(pressed * ufl.as_vector((0.0, 4.0, -20.0)), z) * top(d.tagged.boundaries["top"])
    foundation = Foundation(d.tagged.facets("bottom"), sphere, friction=friction)
    found = ContactProblem(a, L, [support for _, support in d.supports], [foundation], gamma_n=1e6, gamma_t=1e6).solve()
    size = np.abs(scene.displacement.x.array).max()
    assert np.abs(found.x.array - scene.displacement.x.array).max() <= 1e-7 * size


# --- what is refused and said ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("friction", "more", "place", "message"),
    [
        ({"ratio": 0.0}, {}, "contact.*friction.ratio", "between 0.001 and 1000"),
        ({"ratio": "x[0] - 1"}, {}, "contact.*friction.ratio", "not negative"),
        ({"ratio": 0.5, "along": [1.0, 0.0]}, {}, "contact.friction.along", "at least 3"),
        ({"along": [1.0, 0.0, 0.0]}, {}, "contact.friction.along", "needs a ratio"),
        ({"ratio": 0.5, "along": [0.0, 0.0, 1.0]}, {}, "contact.*friction.along", "along the normal somewhere"),
        ({"ratio": 0.5, "along": ["x[0]", "x[0]", 0.0]}, {}, "contact.*friction.along", "zero or along"),
        (
            {"ratio": 0.5, "along": ALONG},
            {"displacement": {"boundary": "left", "x": 0.0}},
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
        "contact": {"boundary": "bottom", "friction": {"law": "coulomb", "coefficient": 0.3} | friction},
    }
    with pytest.raises(SceneError, match=f"{place}.*{message}") as raised:
        check_scene(parse_scene(data | more), MPI.COMM_SELF)
    assert len(raised.value.problems) == 1


def test_not_in_the_plane():
    friction = {"law": "coulomb", "coefficient": 0.3, "ratio": 0.5}
    data = {"mesh": {"generator": "rectangle"}, "material": {"young": 1000.0, "poisson": 0.3}}
    data["displacement"] = {"boundary": "top", "x": 0.0, "y": 0.0}
    with pytest.raises(SceneError, match=r"friction.ratio: the mesh is plane"):
        check_scene(parse_scene(data | {"contact": {"boundary": "bottom", "friction": friction}}), MPI.COMM_SELF)


def test_check_says_so():
    friction = law_of(law="coulomb", coefficient=0.3, ratio=0.5, along=[1.0, "x[0]", 0.0])
    report = str(check_scene(pulled(friction), MPI.COMM_SELF))
    assert "coulomb, coefficient = 0.3, ratio = 0.5 across (1, x[0], 0)" in report


@pytest.mark.slow
def test_accuracy():
    """Estimates of an ellipse along y, twice as long as wide, are those of one along x; of a disc those of a disc."""

    def estimates(coefficient, **more):
        scene = {
            "mesh": {"generator": "box", "parameters": {"nx": 4, "ny": 2, "nz": 2}},
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": {"boundary": "left", "x": 0.0},
            "traction": {"boundary": "top", "x": 0.3, "y": 0.2, "z": -3.0},
            "contact": {"boundary": "bottom", "friction": {"law": "coulomb", "coefficient": coefficient} | more},
            "accuracy": {"target": 0.2, "refinement": "uniform"},
        }
        return [level.energy for level in solve(parse_scene(scene), MPI.COMM_SELF).levels]

    isotropic, disc = estimates(0.3), estimates(0.3, ratio=1.0, along=[1.0, 0.0, 0.0])
    assert disc == pytest.approx(isotropic, rel=1e-6)
    along_x = estimates(0.3, ratio=0.5, along=[1.0, 0.0, 0.0])
    along_y = estimates(0.15, ratio=2.0, along=[0.0, 1.0, 0.0])
    assert along_y == pytest.approx(along_x, rel=1e-3)  # gamma is told along the axes
    assert abs(along_x[0] / isotropic[0] - 1) > 0.1
