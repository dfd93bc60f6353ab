"""Bounds with loads that tell their densities at points: weight, rotation, fluids, forces whose total is given, and
those of other packages.
"""

from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import ClassVar

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from error_bounds_in_space import energy_of_difference, on_finer_mesh, problem
from loaded_scenes import effectivity
from mpi4py import MPI
from scenes import alone
from spaces import box
from test_jumping_loads import square

from signorini_fx.addons.bounds import applied_loads
from signorini_fx.addons.bounds.applied_loads import Acting
from signorini_fx.addons.bounds.bounded_scene import profile_of, refuse_unknown, why_estimated
from signorini_fx.addons.bounds.error_bound import Bounded
from signorini_fx.addons.bounds.facets import POINTS, WEIGHTS, bernstein
from signorini_fx.mechanics.body.discretisation import prepare
from signorini_fx.mechanics.effects.body_force import BodyForce
from signorini_fx.mechanics.effects.fluid import Fluid
from signorini_fx.mechanics.effects.force import TotalForce
from signorini_fx.mechanics.effects.gravity import Gravity
from signorini_fx.mechanics.effects.point_force import PointForce
from signorini_fx.mechanics.effects.rotation import Rotation
from signorini_fx.mechanics.statement.effect import Force
from signorini_fx.mechanics.statement.expressions import Expression, product_of
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.quantities.proved_statements import Refused
from signorini_fx.records import Timings
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene

SLOW, LONG = pytest.mark.slow, pytest.mark.long
DENSE = {"young": 1000.0, "poisson": 0.3, "density": 2.5}


# --- true errors ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "study", "seeds"),
    [
        ("gravity", "plane", (1,)),
        ("fluid", "plane", (0,)),
        ("force", "space", (100,)),
        pytest.param("gravity", "pair", (3, 7), marks=SLOW),
        ("rotation", "space", (103,)),
        pytest.param("rotation", "space", (100, 101, 102), marks=SLOW),
        pytest.param("rotation", "spatial-pair", (100, 101), marks=SLOW),
        pytest.param("fluid", "space", (100, 101, 102), marks=SLOW),
        pytest.param("gravity", "space", (100, 101, 102), marks=SLOW),
        pytest.param("force", "plane", (1, 4, 6), marks=SLOW),
        pytest.param("force", "pair", (3, 7), marks=SLOW),
        pytest.param("rotation", "plane", (1, 4, 6), marks=SLOW),
        pytest.param("rotation", "pair", (3, 7), marks=SLOW),
        pytest.param("fluid", "pair", (3, 7), marks=SLOW),
        pytest.param("fluid", "pressed", (1, 4), marks=SLOW),
    ],
)
def test_true_errors(kind, study, seeds):
    """The bound is above the true error, and finer solutions refute no interval of the energy or of a force."""
    for seed in seeds:
        found = effectivity(kind, study, seed)
        assert not isinstance(found, str), found
        assert found[2] == []
        assert 1 < found[0] < 8


@LONG
@pytest.mark.parametrize("kind", ["gravity", "force", "rotation", "fluid"])
@pytest.mark.parametrize(("study", "many", "largest"), [("plane", 30, 2.2), ("pair", 30, 2), ("space", 12, 2.5)])
def test_true_errors_of_many(kind, study, many, largest):
    """Of random scenes, most of which have a bound."""
    found = [row for row in (effectivity(kind, study, seed) for seed in range(100, 100 + many)) if len(row) == 3]
    assert len(found) > many / 2
    assert all(ratio > 1 and wrong == [] for ratio, _, wrong in found)
    assert np.median([ratio for ratio, _, _ in found]) < largest


# --- the bound sees all of a load -------------------------------------------------------------------------------------

# A unit square that rests on its bottom and is held aside by its left: the load, and what it presses with.
PRESSING = {
    "gravity": ({"gravity": {"y": -4.0}}, 10.0),
    "gravity that jumps": ({"gravity": {"y": "where(x[0] < 0.43, -4, -1)"}}, 2.5 * (4 * 0.43 + 0.57)),
    "rotation": ({"rotation": {"speed": 2.0, "about": [0.0, 2.0]}}, 15.0),
    "faster rotation": (
        {"rotation": {"speed": "1 + x[0]", "about": [0.3, 2.0], "axis": [1.0, 0.0]}},
        2.5 * 1.5 * 7 / 3,
    ),
    "force": ({"force": {"boundary": "top", "y": -7.0}}, 7.0),
    "force of a polynomial": ({"force": {"boundary": "top", "y": -7.0, "spread": "x[0]**3 + 0.2"}}, 7.0),
    "force that jumps": ({"force": {"boundary": "top", "y": -7.0, "spread": "where(x[0] < 0.43, 1, 0.3)"}}, 7.0),
    "fluid": ({"fluid": {"boundary": "top", "level": "1.43 - x[0]", "weight": 30.0}}, 30 * 0.43**2 / 2),
    "fluid above": ({"fluid": {"boundary": "top", "level": 1.2, "weight": 30.0}}, 6.0),
}


@pytest.mark.parametrize("factor", [1.0, 1.02, 0.98])
@pytest.mark.parametrize("kind", PRESSING)
def test_a_force_that_statics_determines(monkeypatch, kind, factor):
    """A load that is seen two hundredths too large or too small is refuted; a kink inside a facet costs nothing."""
    load, exact = PRESSING[kind]
    solution = alone(square("0", material=DENSE, **load))
    at = Acting.at
    monkeypatch.setattr(Acting, "at", lambda self, *points: factor * at(self, *points))
    low, high = solution.force_bounds("bottom", (0.0, 1.0))
    assert high - low < 1e-9 * exact
    assert (low - 1e-12 * exact <= exact <= high + 1e-12 * exact) == (factor == 1)
    assert solution.error_bound.as_dict()["guaranteed"]


@pytest.mark.parametrize("degree", [1, 2])
def test_the_work_of_tractions_that_vary_along_edges(degree):
    """On a displacement that is drawn, beside a rule of quadrature on the edges of the scene."""
    load = {"boundary": "right", "x": "x[1]**2 - 0.2*x[1]", "y": "3*x[1]"}
    solution = alone(bent(degree, load))
    displaced = solution.displacement.copy()
    away = displaced.function_space.tabulate_dof_coordinates()[:, 0] > 1e-9
    displaced.x.array[:] = np.random.default_rng(degree).normal(size=(len(away), 2)).ravel() * np.repeat(away, 2)
    case = Bounded(solution.model, displaced, solution.contact, 0.0)
    facets = case._facets("right")
    up = case.on(facets, POINTS[2]).x[..., 1]
    at = bernstein(POINTS[2]) @ case.on_facets(case.y, case.middle, facets)
    density = (up**2 - 0.2 * up) * at[..., 0] + 3 * up * at[..., 1]
    assert case.loads.work(case.y, case.middle) == pytest.approx(case.t.area[facets] @ density @ WEIGHTS[2], rel=1e-12)


def test_a_beam_that_is_bent_by_a_linear_traction():
    """Without Poisson's ratio elements of degree 2 have its displacement: both bounds of the mean are equal."""
    solution = alone(bent(2, {"boundary": "right", "x": "x[1] - 0.5"}))
    exact = -(2.0**2) / 100.0 / 2
    low, high = solution.mean_displacement_bounds("right", (0.0, 1.0))
    assert high - low < 1e-8 * abs(exact)
    assert low - 1e-12 <= exact <= high + 1e-12
    work = solution.error_bound.work
    assert work == pytest.approx((2.0 / 12 / 100,) * 2, rel=1e-6)


def bent(degree, load):
    """A beam that is clamped at its left and loaded at its right."""
    shape = {"length": 2.0, "height": 1.0, "nx": 3, "ny": 2, "cell": "triangle"}
    return parse_scene(
        {
            "mesh": {"generator": "rectangle", "parameters": shape},
            "element": {"degree": degree},
            "material": {"young": 100.0, "poisson": 0.0},
            "displacement": [{"boundary": "left", "x": 0.0, "y": 0.0}],
            "traction": [load],
        }
    )


def test_a_share_that_quadrature_does_not_know():
    """The total of a force is given, but not the integral of what it is spread by: how far this is not known counts."""
    scene = square("0", n=2, force={"boundary": "top", "y": -7.0, "spread": "1 + sin(40*x[0])"})
    solution = alone(scene)
    low, high = solution.force_bounds("bottom", (0.0, 1.0))
    assert low <= 7 <= high
    assert high - low > 1e-9
    assert "quadrature of the loads" in solution.error_bound.grounds.assumed
    wide = high - low
    low, high = alone(scene.model_copy(update={"force": (TotalForce(boundary="top", y=-7.0),)})).force_bounds(
        "bottom", (0.0, 1.0)
    )
    assert high - low < 1e-6 * wide


@pytest.mark.parametrize("known", [0.0, 1e-3])
def test_how_far_a_share_is_not_known(monkeypatch, known):
    """An integral of a spread that is wrong by a thousandth is refuted, but not if it is known to be so."""
    of = Acting.of

    def wrong(*args):
        found = of(*args)
        return replace(found, whole=1.001 * found.whole, doubtful=known) if found.load.weighting else found

    monkeypatch.setattr(Acting, "of", staticmethod(wrong))
    solution = alone(square("0", force={"boundary": "top", "y": -7.0, "spread": "x[0] + 0.1"}))
    low, high = solution.force_bounds("bottom", (0.0, 1.0))
    assert (low <= 7 <= high) == (known > 0)


def test_what_linear_functions_miss_of_a_doubtful_share(monkeypatch):
    """It is larger by as much as the share may be."""
    solution = alone(square("0", n=2, force={"boundary": "top", "y": -7.0, "spread": "1 + sin(40*x[0])"}))

    def known_to(of, doubtful, *args):
        return replace(of(*args), doubtful=doubtful)

    missed, of = [], Acting.of
    for doubtful in (0.0, 0.5):
        monkeypatch.setattr(Acting, "of", staticmethod(partial(known_to, of, doubtful)))
        loads = problem(solution).loads
        missed.append(loads.missed_beside(np.zeros(len(loads.traction))).sum())
    assert missed[1] == pytest.approx(1.5**2 * missed[0])


FORCE_IN_SPACE = {"boundary": "top", "z": "-where(x[0] < 0.3, 1, 5)", "spread": "where(x[0] < 0.3, 1, 0.2)"}


@pytest.mark.parametrize(
    ("force", "total"),
    [
        (FORCE_IN_SPACE, 1 / (0.3 + 0.7 * 0.2)),
        ({"boundary": "top", "z": -2.0, "spread": "1 + x[0] + 2*x[1]"}, 2.0),
        ({"boundary": "top", "z": "-exp(-40*x[0])", "spread": "exp(40*x[0])"}, 40 / np.expm1(40)),
    ],
)
def test_shares_in_space(force, total):
    """Whatever multiplies a spread, how far its integral is not known counts: here the force per area is linear."""
    scene = {
        "mesh": box("tetrahedra", (1, 1, 1), size=(1.0, 1.0, 1.0)),
        "material": DENSE,
        "displacement": {"boundary": "left", "x": 0.0, "y": 0.0, "z": 0.0},
        "force": force,
    }
    solution = alone(parse_scene(scene))
    loads = problem(solution).loads
    unknown = loads.unknown_work(*_moved(solution))
    assert ("quadrature of the loads" in solution.error_bound.grounds.assumed) == (unknown > 1e-9 * total)
    assert loads.work(*_moved(solution)) == pytest.approx(-total, rel=1e-12, abs=unknown)


def _moved(solution):
    """A displacement by one upwards, at vertices and at middles."""
    cells = problem(solution).t
    return np.tile([0.0, 0.0, 1.0], (len(cells.x), 1)), np.tile([0.0, 0.0, 1.0], (len(cells.edges), 1))


def test_weight_of_two_materials():
    """Each has its density; the lower one lies on the foundation."""
    scene = square("0", n=4)
    tagged = load_mesh(scene, MPI.COMM_SELF)
    cells = np.arange(tagged.mesh.topology.index_map(2).size_local, dtype=np.int32)
    above = dmesh.compute_midpoints(tagged.mesh, 2, cells)[:, 1] > 0.5
    marked = dmesh.meshtags(tagged.mesh, 2, cells, (above + 1).astype(np.int32))
    fields = {key: getattr(scene, key) for key in scene.model_fields_set - {"traction"}}
    fields["mesh"] = replace(tagged, cell_tags=marked, regions={"lower": 1, "upper": 2})
    fields["material"] = [DENSE | {"region": "lower"}, DENSE | {"region": "upper", "density": 7.0}]
    low, high = alone(parse_scene(fields | {"gravity": {"y": -2.0}})).force_bounds("bottom", (0.0, 1.0))
    assert low - 1e-12 <= 9.5 <= high + 1e-12
    assert high - low < 1e-9


# --- what is known of a load between points ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("load", "dimension", "profile", "degree"),
    [
        (BodyForce(x="x[1]**2"), 2, ["x[1]**2", 0.0, 0.0], 2),
        (Gravity(y=-2.0), 2, [0.0, -2.0, 0.0], 0),
        (TotalForce(boundary="b", x=2.0, spread="x[0]"), 2, ["(2.0)*(x[0])", "(0.0)*(x[0])", "(0.0)*(x[0])"], 1),
        (TotalForce(boundary="b", x=2.0, spread=3.0), 3, [6.0, 0.0, 0.0], 0),
        (Rotation(speed=3.0), 2, ["(3.0)*(3.0)*(x[0])"], 1),
        (Rotation(speed="2*x[1]"), 2, ["(2*x[1])*(2*x[1])*(x[0])"], 3),
        (Fluid(boundary="b", level=0.5, weight=1.0), 2, ["max(0, (0.5)*(1) - x[1])"], 1),
        (Fluid(boundary="b", level=0.5, weight=1.0), 3, ["max(0, (0.5)*(1) - x[2])"], 1),
        (Fluid(boundary="b", level="x[0]", weight=1.0, up="x"), 3, ["max(0, (x[0])*(1) - x[0])"], 1),
    ],
)
def test_profiles(load, dimension, profile, degree):
    """Of the loads of the package."""
    found = profile_of(load, dimension)
    assert [getattr(value, "text", value) for value in found] == profile
    assert max(getattr(value, "degree", 0) for value in found) == degree


def test_profiles_in_time():
    """A level that rises is that of its time."""
    rising = Fluid(boundary="b", level="2*t", weight=1.0).at_time(0.25)
    (profile,) = profile_of(rising, 2)
    assert profile.switch(0, np.array([[0.0], [0.2], [0.0]]))[0] in (pytest.approx(0.3), pytest.approx(-0.3))
    assert product_of(2.0, 3.0) == 6.0
    assert product_of(2.0, function := lambda x: x[0]) is function
    assert product_of(Expression("x[0]"), 2.0)(np.array([[3.0], [0.0]])) == 6.0


@pytest.mark.parametrize(
    "load",
    [
        {"rotation": {"speed": "1" + " + 0*x[0]" * 120, "about": [0.0, 2.0]}},
        {"force": {"boundary": "top", "y": "-1" + " + 0*x[0]" * 120, "spread": "1" + " + 0*x[0]" * 120}},
        {"fluid": {"boundary": "top", "level": "1.5" + " + 0*x[0]" * 220, "weight": 1.0}},
    ],
)
def test_profiles_of_long_expressions(load):
    """Their products may be longer than what a scene may say."""
    assert alone(square("0", n=2, material=DENSE, **load)).error_bound.as_dict()["guaranteed"]


class Pull(Force):
    """A traction of another package that says nothing of its profile."""

    boundary: str
    strength: float = -2.0

    def density(self, on):
        return on.vector((0.0, self.strength, 0.0))

    def density_at(self, at):
        return at.vector((0.0, self.strength, 0.0))


class OldProfile(Gravity):
    """A load that changes the density of an older class, and not the profile of that."""

    def density_at(self, at):
        return super().density_at(at) * np.sin(at.position[..., :1])


class Sticky(Pull):
    """One that does more than its density."""

    density_tells_all: ClassVar[bool] = False


class Stepping(Pull):
    """One that an interface applies."""

    @property
    def interface(self):
        return "entering_loads"


@pytest.mark.parametrize(
    ("load", "reason"),
    [
        (Pull(boundary="top"), "the pull of 'top' is a function of Python"),
        (OldProfile(y=-1.0), "the old profile is a function of Python"),
        (Sticky(boundary="top"), "sticky has no guaranteed bound yet"),
        (Stepping(boundary="top"), "stepping has no guaranteed bound yet"),
        (PointForce(at=[0.0, 1.0], y=-1.0), "point force has no guaranteed bound yet"),
        (Gravity(y=-1.0), ""),
    ],
)
def test_what_acts_unseen_has_no_bound(monkeypatch, load, reason):
    """A load of another package has one if its density is all of it; without a profile it is an estimate."""
    scene = square("0")
    fields = {key: getattr(scene, key) for key in scene.model_fields_set}
    scene = parse_scene(fields | {"material": DENSE})
    model, listed = prepare(scene.statement, load_mesh(scene, MPI.COMM_SELF), Timings()), Statement.listed
    monkeypatch.setattr(Statement, "listed", lambda self: [*listed(self), ("body_force", load)])
    found = ""
    try:
        refuse_unknown(model)
        found = why_estimated(model)
    except Refused as refused:
        found = str(refused)
    assert reason in found
    assert (reason == "") == (found == "")


# --- in space ---------------------------------------------------------------------------------------------------------


def turning(n, factor):
    """A plate of degree 2 without lateral contraction that turns about an axis above, which presses it downwards."""
    return parse_scene(
        {
            "mesh": box("tetrahedra", (n, 1, n), size=(1.0, 1 / n, 1.0)),
            "element": {"degree": 2},
            "material": DENSE | {"poisson": 0.0},
            "displacement": [{"boundary": "left", "x": 0.0}, {"boundary": "front", "y": 0.0}],
            "rotation": {"speed": 2 * factor**0.5, "about": [0.0, 0.0, 1.5], "axis": [0.0, 1.0, 0.0]},
            "contact": {"boundary": "bottom"},
            "solver": {"algorithm": "alm"},
        }
    )


@pytest.mark.parametrize("factor", [1.0, 1.02, 0.98])
def test_the_energy_of_a_plate_that_turns(factor):
    """Its stresses are polynomials of degree 2; a centrifugal force that is two hundredths wrong is refuted."""
    bound, n = alone(turning(6, factor)).error_bound, 6
    per_volume = 2.5 * 2**2
    x, weights = (np.polynomial.legendre.leggauss(3)[k] / 2 + 0.5 * (k == 0) for k in (0, 1))
    along, down = (1 - x**2) / 2, (1 - x**2) / 2 - 1.5 * (1 - x)
    exact = weights @ (along**2 + down**2) * per_volume**2 / (2 * 1000 * n)
    low, high = bound.strain_energy
    assert (low <= exact <= high) == (factor == 1)
    assert bound.as_dict()["guaranteed"]
    assert bound.relative < 0.01


# Polynomials that are orthogonal to linear functions: on the tetrahedra of a cube, and on the triangles of its side.
HIDDEN = {
    "work_inside": {"body_force": {"x": "70*x[0]**4 - 140*x[0]**3 + 90*x[0]**2 - 20*x[0] + 1"}},
    "work_beside_linear": {"traction": {"boundary": "right", "x": "20*x[1]**3 - 30*x[1]**2 + 12*x[1] - 0.99"}},
}


@pytest.mark.parametrize("term", HIDDEN)
def test_loads_that_linear_functions_do_not_see(monkeypatch, term):
    """Elements of degree 1 and stresses on one cube see nothing of them but a hundredth: constants alone bound the
    error."""
    fields = {
        "mesh": box("tetrahedra", (1, 1, 1), size=(1.0, 1.0, 1.0)),
        "material": DENSE,
        "displacement": {"boundary": "left", "x": 0.0, "y": 0.0, "z": 0.0},
        "contact": {"boundary": "bottom", "gap": 1.0},
        "solver": {"algorithm": "alm"},
    }
    scene = parse_scene(fields | HIDDEN[term])
    solution = alone(scene)
    true = energy_of_difference(solution, on_finer_mesh(scene, 2))
    assert true < solution.error_bound.error < 20 * true
    monkeypatch.setattr(applied_loads, term, lambda t, *given: np.zeros(len(given[0])))
    assert alone(scene).error_bound.error < 0.2 * true


def across(x):
    """From the axis of the rotation of ``ACTING`` in the plane across it."""
    axis = np.array([1.0, 0.4, 0.0]) / np.hypot(1.0, 0.4)
    arm = x - [0.3, 2.0, 0.0]
    return arm - (arm @ axis)[:, None] * axis


# Loads in space, and their densities.
ACTING = {
    "rotation": (
        {"speed": "1 + x[0]", "about": [0.3, 2.0, 0.0], "axis": [1.0, 0.4, 0.0]},
        lambda x: 2.5 * (1 + x[:, :1]) ** 2 * across(x),
    ),
    "gravity": (
        {"z": "where(x[0] < 0.43, -4, -1)*x[1]"},
        lambda x: -2.5 * np.where(x[:, :1] < 0.43, 4, 1) * x[:, 1:2] * [0, 0, 1],
    ),
    "traction": (
        {"boundary": "top", "x": 5.0, "y": "max(0, x[1] - 0.31)", "z": "-1 - x[0]**3"},
        lambda x: np.column_stack((0 * x[:, 0], np.maximum(0, x[:, 1] - 0.31), -1 - x[:, 0] ** 3)),
    ),
    "fluid": (
        {"boundary": "top", "level": "1.43 - x[0]", "weight": 30.0},
        lambda x: 30 * np.maximum(0, 0.43 - x[:, :1]) * [0, 0, -1],
    ),
}


@pytest.mark.parametrize("kind", ACTING)
def test_work_in_space(kind):
    """On a displacement of degree 2; what a support takes of a traction does none."""
    load, density = ACTING[kind]
    scene = {
        "mesh": box("tetrahedra", (2, 1, 1), size=(1.3, 1.0, 1.0)),
        "material": DENSE,
        "displacement": [{"boundary": "left", "x": 0.0, "y": 0.0, "z": 0.0}, {"boundary": "top", "x": 0.0}],
        "contact": {"boundary": "bottom"},
        kind: load,
    }
    case = problem(alone(parse_scene(scene)))
    slopes = np.random.default_rng(1).normal(size=(6, 3))

    def displacement(x):
        return (
            np.stack([x[:, i] * x[:, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))], axis=1) @ slopes
        )

    s, w = (np.polynomial.legendre.leggauss(5)[k] / 2 + 0.5 * (k == 0) for k in (0, 1))
    rules = [
        tuple(np.concatenate([(a + (b - a) * s, (b - a) * w)[k] for a, b in pairwise(ends)]) for k in (0, 1))
        for ends in ((0.0, 0.43, 1.3), (0.0, 0.31, 1.0))
    ]
    rules.append((s, w) if case.loads.body.any() else (np.ones(1), np.ones(1)))
    x = np.stack(np.meshgrid(*(rule[0] for rule in rules), indexing="ij"), axis=-1).reshape(-1, 3)
    weights = np.einsum("i,j,k->ijk", *(rule[1] for rule in rules)).ravel()
    expected = weights @ (density(x) * displacement(x)).sum(axis=1)
    found = case.loads.work(displacement(case.t.x), displacement(case.t.x[case.t.edges].mean(axis=1)))
    assert found == pytest.approx(expected, rel=1e-10)
