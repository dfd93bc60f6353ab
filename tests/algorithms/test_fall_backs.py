"""Where full steps do not solve a problem, one fall-back after the other is tried; the history says
which.
"""

import sys
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from numpy.testing import assert_allclose, assert_array_equal
from scene_tables import coulomb_friction, fixed, plane_shape, rectangle_mesh, tresca_friction
from scenes import PATCH, alone, energy, example1

from benchmarks.stability.oracle.judge import RIGHT
from benchmarks.stability.oracle.worker import TRIAL, examined, same_units
from signorini_fx.algebra.algorithms import ssn
from signorini_fx.algebra.algorithms.interior_point import interior_point
from signorini_fx.records import Status
from signorini_fx.results.summary import lines_of, summary_of
from signorini_fx.scenes import solver
from signorini_fx.scenes.reading import parse_scene

ANGLE, LENGTH, THICKNESS = np.radians(60.0), 10.0, 0.4
JUMP = "0.001 if x[0] < 1.37 else 0.002"


def with_contact(scene, **changes):
    """The scene with other data of its one contact."""
    return scene.model_copy(update={"contact": (scene.contact[0].model_copy(update=changes),)})


def jumping(**settings):
    """Example 1 over a step in the foundation: the plain iteration cycles."""
    data = {
        "mesh": rectangle_mesh(60, 20),
        "material": {"young": 5000.0, "poisson": 0.4},
        "displacement": [fixed("left", "x"), fixed("right", "x")],
        "traction": {"boundary": "top", "y": "-20 if 1 <= x[0] <= 2 else 0"},
        "contact": {"boundary": "bottom", "gap": JUMP, "friction": tresca_friction(1.5)},
        "solver": settings,
    }
    return parse_scene(data)


def flat(**settings):
    """A block that lies on its foundation, held by nothing but friction, all of which slips."""
    scene = example1(coefficient=0.3, gamma="auto", nx=15, ny=5, **settings)
    return with_contact(scene.model_copy(update={"displacement": ()}), gap=0.0)


def pulled(coefficient, **settings):
    """A block pulled by its end over a rough foundation, for which the fixed point does not
    contract.
    """
    data = {
        "mesh": rectangle_mesh(60, 20),
        "material": {"young": 5000.0, "poisson": 0.3},
        "displacement": fixed("right"),
        "traction": [{"boundary": "top", "y": -20.0}, {"boundary": "left", "x": 60.0}],
        "contact": {"boundary": "bottom", "gap": 1e-4, "friction": coulomb_friction(coefficient)},
        "solver": settings,
    }
    return parse_scene(data)


def fall_backs_of(solution):
    """What was tried, in order."""
    events = [event for event in solution.history.events if not event.startswith("sets: ")]
    return [event.split(": ", 1)[1] for event in events if ": " in event]


def same(ours, theirs, rtol=1e-9):
    """Equal displacements, to a share of the largest."""
    a, b = ours.displacement.x.array, theirs.displacement.x.array
    assert_allclose(a, b, rtol=0, atol=rtol * np.abs(b).max())


@pytest.mark.one_quick("law", [{}, {"bound": 1.5}, {"coefficient": 0.3}])
def test_the_plain_way_stays_plain(law):
    """Where nothing goes wrong there is no event, and no solve more than without fall-backs."""
    ours, without = (alone(example1(**law, nx=60, ny=20, fallbacks=on)) for on in (True, False))
    assert ours.history.events == []
    assert ours.history.linear_solves == without.history.linear_solves
    assert_array_equal(ours.displacement.x.array, without.displacement.x.array)


def test_interior_point():
    """It has no sets that could cycle, and needs at most 40 linear solves for the gamma that was
    asked for.
    """
    ours = alone(jumping())
    assert fall_backs_of(ours) == ["interior point"]
    summary = summary_of(ours)
    assert summary["events"] == ours.history.events
    assert "fall-backs       active sets cycle: interior point" in "\n".join(
        map(str, lines_of(summary, Path()))
    )
    assert [record.status for record in ours.history.outer] == ["active sets cycle", "converged"]
    assert ours.history.outer[-1].linear_solves <= 40
    same(
        ours, alone(jumping(algorithm="alm", gamma_n=1e5, gamma_t=1e5, tolerance=1e-10)), rtol=1e-3
    )


def test_monolithic_where_the_fixed_point_does_not_contract():
    """And without fall-backs the outcome has its name."""
    ours = alone(pulled(5.0))
    assert fall_backs_of(ours) == ["monolithic Newton from the same start"]
    assert ours.algorithm == "coulomb-newton"
    same(ours, alone(pulled(5.0, algorithm="alm", coulomb="newton")), rtol=1e-3)
    assert alone(pulled(5.0, fallbacks=False), check=False).status is Status.OUTER_MAX_ITERATIONS


@pytest.mark.parametrize(
    ("mesh", "loads", "slips"),
    [
        ({"length": 2.38, "nx": 4, "ny": 4}, [("left", -1.71, -3.11), ("body", 0.0, -1.0)], 1),
        (
            {"length": 1.18, "nx": 4, "ny": 7, "cell": "triangle"},
            [("left", -0.282, -0.674), ("right", -1.02, -0.797)],
            2,
        ),
    ],
)
def test_a_corner_that_neither_opens_nor_sticks(mesh, loads, slips):
    """With F = 10 it enters the foundation if it is open, and is pulled if it sticks: sets without
    slip cycle.  Of all 4^5 states one is a solution, in which such points slip.
    """
    tractions = [{"boundary": at, "x": x, "y": y} for at, x, y in loads if at != "body"]
    weight = {"body_force": {"y": loads[-1][2]}} if loads[-1][0] == "body" else {}
    scene = {
        "mesh": rectangle_mesh(height=1.0, **mesh),
        "material": {"young": 1000.0, "poisson": 0.3},
        "traction": tractions,
        "contact": {"boundary": "bottom", "friction": coulomb_friction(10.0)},
    }
    solution = alone(parse_scene(scene | weight))
    pressure, shear = (solution.table.columns[name] for name in ("pressure", "shear"))
    assert (pressure > 0).all()
    assert np.count_nonzero(np.isclose(np.abs(shear), 10 * pressure)) == slips
    assert solution.history.linear_solves <= 20


def test_a_fall_back_begins_where_the_first_method_began():
    """It takes as many solves as where it is tried first; the body is held by friction alone, hence
    begins in stick.
    """
    ways = ({}, {"coulomb": "newton"})
    loose = (
        with_contact(pulled(5.0, **way), gap=0.0).model_copy(update={"displacement": ()})
        for way in ways
    )
    ours, theirs = (alone(scene) for scene in loose)
    assert fall_backs_of(ours) == ["monolithic Newton from the same start"]
    assert ours.history.outer[-1].linear_solves == theirs.history.outer[-1].linear_solves


@pytest.mark.mpi
@pytest.mark.parametrize("make", [jumping, flat])
def test_the_same_solution_on_every_number_of_ranks(make):
    """Decisions are taken from sums over the ranks, so that none waits for the others, and the
    solution is the same.

    The block that slips everywhere has sets that are equal but for round-off: it may take another
    fall-back.
    """
    ours, reference = solver.solve(make(), MPI.COMM_WORLD), alone(make())
    if make is jumping:
        assert fall_backs_of(ours) == fall_backs_of(reference)
    assert energy(ours) == pytest.approx(energy(reference), rel=1e-8)
    ours_force, force = (np.sum(solution.contact.forces, axis=0) for solution in (ours, reference))
    assert_allclose(ours_force, force, rtol=0, atol=1e-6)


def ladder(coefficient):
    """A rod of weight 1 whose ends lean on a rough floor and a rough wall with an edge each, in its
    own frame.
    """
    up, right = (
        np.array([np.sin(ANGLE), np.cos(ANGLE)]),
        np.array([-np.cos(ANGLE), np.sin(ANGLE)]),
    )
    planes = {"left": ([0.0, 0.0], up), "right": ([LENGTH, 0.0], right)}
    data = {
        "mesh": rectangle_mesh(40, 1, length=LENGTH, height=THICKNESS),
        "material": {"young": 1e5, "poisson": 0.3},
        "body_force": dict(zip("xy", (-up / (LENGTH * THICKNESS)).tolist(), strict=True)),
        "contact": [
            {
                "boundary": side,
                "foundation": plane_shape(point, normal.tolist()),
                "friction": coulomb_friction(coefficient),
            }
            for side, (point, normal) in planes.items()
        ],
    }
    return parse_scene(data)


@pytest.mark.parametrize("above", [1.003, 1.05])
def test_a_ladder_just_before_it_slides(above):
    """Both edges slip at the limit.  Above it the foot slips, which says how much each of them
    carries.

    The gaps of the other nodes are large, but do not press: their round-off is none of the
    residual.
    """
    high, wide = LENGTH * np.sin(ANGLE), LENGTH * np.cos(ANGLE)
    weight_at = wide / 2 - THICKNESS / 2 * np.sin(ANGLE)  # from the foot
    limit = np.roots([wide - weight_at, high, -weight_at]).max()
    solution = alone(ladder(above * limit))
    pressed = (wide - weight_at) / (wide - above * limit * high)  # on the floor
    contact, _ = solution.contact.forces
    up = np.array([np.sin(ANGLE), np.cos(ANGLE)])
    assert contact @ up == pytest.approx(pressed, rel=1e-6)


# --- trifles --------------------------------------------------------------------------------------


def test_no_load_no_motion():
    """A held body without any load is solved without a solve; the energy is zero."""
    scene = example1(coefficient=0.3, nx=30, ny=10, levels=2)
    held = tuple(support.model_copy(update={"y": 0.0}) for support in scene.displacement)
    solution = alone(scene.model_copy(update={"traction": (), "displacement": held}))
    assert solution.converged
    assert solution.history.linear_solves == 0
    assert energy(solution) == 0.0


@pytest.mark.parametrize("load", [1e-6, 1e-12])
@pytest.mark.parametrize("law", [{}, {"bound": 1.5}, {"coefficient": 0.3}])
def test_grazing(law, load):
    """A load that lays the body down and hardly deforms it: its forces are exact, though the drop
    is so much larger.
    """
    scene = example1(**law, gamma="auto", nx=60, ny=20)
    traction = scene.traction[0].model_copy(update={"y": -20.0 * load})
    solution = alone(scene.model_copy(update={"traction": (traction,)}))
    contact, _ = solution.contact.forces
    assert contact[1] == pytest.approx(60.0 * load, rel=max(1e-8, 1e-15 / load))
    assert solution.contact.pressure.min() >= 0


@pytest.mark.parametrize("gamma", [1e6, 1e8])
def test_a_finite_sigma_that_cycles(gamma):
    """sigma = 1 / gamma_2 cycles; an interior point does not, and comes to the solution with an
    infinite one.
    """
    ours = alone(example1(bound=1.5, gamma=gamma, sigma=1 / gamma, patch=PATCH))
    assert fall_backs_of(ours) == ["interior point"]
    assert [record.status for record in ours.history.outer] == ["active sets cycle", "converged"]
    same(ours, alone(example1(bound=1.5, gamma=gamma, patch=PATCH)))


def test_elements_that_lock(monkeypatch):
    """An interior point proposes sets before full steps cycle; where it may not, it is the
    fall-back.
    """
    scene = example1(bound=1.5, poisson=0.4999, gamma="auto", nx=60, ny=20, degree=2)
    proposed = alone(scene)
    assert fall_backs_of(proposed) == []
    monkeypatch.setattr(ssn, "SLOW_STEPS", sys.maxsize)
    ours = alone(scene)
    assert fall_backs_of(ours) == ["interior point"]
    for solution in (ours, proposed):
        assert solution.certificate.holds
    same(ours, proposed)


# --- the interior-point method alone --------------------------------------------------------------


def test_a_body_that_friction_alone_holds():
    """No set of the solution holds it, each step does."""
    contact, friction = alone(flat()).contact.forces
    assert_allclose(contact + friction, [0.0, 20.0], atol=1e-6)


@pytest.mark.one_quick(
    ("where", "seed"), [("plane", 7), ("space", 2), ("space-effects", 5), ("bodies", 7)]
)
def test_judged_by_another_programme(where, seed, monkeypatch):
    """Random scenes of which each problem with a given bound is solved by it alone."""
    plain, statuses = ssn.SemismoothNewton.solve, []

    def inside(self, data, first_sets=None, *, measure=lambda: None, **limits):
        if data.follows is not None or np.isinf(data.gamma_n):
            return plain(self, data, first_sets, measure=measure, **limits)
        statuses.append(interior_point(self, data, Status.CYCLING, measure))
        return statuses[-1]

    monkeypatch.setattr(ssn.SemismoothNewton, "solve", inside)
    verdict, _ = examined(TRIAL[where](seed, same_units(where, seed)), where)
    assert verdict.kind == RIGHT, verdict
    assert set(statuses) == {Status.CONVERGED}
