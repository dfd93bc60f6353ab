"""Coulomb friction by either method, each the fall-back of the other, with and without
regularisation; and an end.
"""

import itertools
import time

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scene_tables import coulomb_friction, rectangle_mesh
from scenes import alone, example1, one_triangle, prepared

from signorini_fx import algebra as method
from signorini_fx.algebra.algorithms import alm, strategy
from signorini_fx.records import History, Status
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.solving.solve_on_mesh import contact_task

METHODS = ("ssn", "alm")
WAYS = ("auto", "fp", "newton")
# Of the free node of the triangle.
STIFFNESS = np.array([[3.0, -np.sqrt(3.0)], [-np.sqrt(3.0), 5.0]])


def square(**solver):
    """A square pressed down and sideways with so much friction that the fixed point hardly
    contracts.
    """
    return parse_scene(
        {
            "mesh": rectangle_mesh(40, 40, length=1.0, height=1.0),
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": [{"boundary": "right", "x": 0.0}],
            "traction": [
                {"boundary": "top", "pressure": 50.0},
                {"boundary": "left", "pressure": 150.0},
            ],
            "contact": {"boundary": "bottom", "friction": coulomb_friction(4.0)},
            "solver": solver,
        }
    )


@pytest.mark.one_quick("algorithm", METHODS)
def test_square_by_newton(algorithm):
    """The monolithic method needs a tenth of what the fixed point takes, with regularisation and
    without.
    """
    monolithic = alone(square(algorithm=algorithm, coulomb="newton"))
    fixed = alone(square(algorithm=algorithm, coulomb="fp"))
    assert "coulomb-newton" in monolithic.algorithm
    assert monolithic.history.linear_solves <= 15 < 100 <= fixed.history.linear_solves
    largest = monolithic.contact.pressure.max()
    # The fixed point stops at a change of 1e-7; it contracts by 0.9.
    assert_allclose(
        fixed.contact.pressure, monolithic.contact.pressure, rtol=0, atol=2e-6 * largest
    )
    assert_allclose(fixed.contact.shear, monolithic.contact.shear, rtol=0, atol=8e-6 * largest)


@pytest.mark.one_quick("algorithm", METHODS)
@pytest.mark.parametrize("coulomb", WAYS)
def test_one_triangle(algorithm, coulomb):
    """F = 1.75 is above sqrt 3, where the fixed point does not contract: slip along -x by hand."""
    force, friction = np.array([-8.4, -3.0]), 1.75
    solution = alone(one_triangle(friction, force, algorithm=algorithm, coulomb=coulomb))
    # The free node moves to the left, hence mu = -F lambda: K (u, 0) - f = (F lambda, lambda).
    nodal = force / 6
    u = (friction * nodal[1] - nodal[0]) / (friction * STIFFNESS[1, 0] - STIFFNESS[0, 0])
    pressure = 2 * (STIFFNESS[1, 0] * u - nodal[1])  # half of the side belongs to the node
    assert u < 0 < pressure
    free = int(np.argmin(np.abs(solution.contact.boundary.x[:, 0])))
    exact = algorithm != "ssn"
    assert solution.contact.pressure[free] == pytest.approx(pressure, rel=1e-6 if exact else 1e-4)
    assert solution.contact.shear[free] == pytest.approx(
        -friction * pressure, rel=1e-6 if exact else 1e-4
    )


@pytest.mark.parametrize(
    ("algorithm", "coulomb"), [("ssn", "fp"), ("ssn", "newton"), ("alm", "fp")]
)
def test_each_way_is_the_fallback_of_the_other(monkeypatch, algorithm, coulomb):
    """Where one does not end, the other gives the same solution, and the history says so."""
    expected = alone(example1(coefficient=0.3, nx=24, ny=8, gamma="auto", algorithm=algorithm))
    broken = "fixed_point" if coulomb == "fp" else "coulomb_newton"
    monkeypatch.setattr(strategy, broken, lambda *arguments, **options: Status.CYCLING)
    scene = example1(
        coefficient=0.3, nx=24, ny=8, gamma="auto", algorithm=algorithm, coulomb=coulomb
    )
    solution = alone(scene)
    other = "monolithic Newton" if coulomb == "fp" else "fixed point"
    assert f"active sets cycle: {other} from the same start" in solution.history.events
    largest = expected.contact.pressure.max()
    assert_allclose(
        solution.contact.pressure, expected.contact.pressure, rtol=0, atol=1e-6 * largest
    )


@pytest.mark.one_quick(
    ("push", "kind", "status"),
    [
        (2.0, "unilateral", Status.OUTER_MAX_ITERATIONS),
        (20.0, "unilateral", Status.SLIDES),
        (2.0, "bilateral", Status.OUTER_MAX_ITERATIONS),
    ],
)
@pytest.mark.parametrize("fallbacks", [False, True])
def test_one_bound_proves_nothing(monkeypatch, push, kind, status, fallbacks):
    """A body slides under the bound of one pressure: an outcome only where the law allows for no
    equilibrium either.
    """
    ways = {strategy: ("fixed_point", "coulomb_newton"), alm: ("augmented_lagrangian",)}
    for module, names in ways.items():
        for name in names:
            monkeypatch.setattr(module, name, lambda *arguments, **options: Status.SLIDES)
    scene = parse_scene(
        {
            "mesh": rectangle_mesh(6, 2),
            "material": {"young": 1000.0, "poisson": 0.3},
            "traction": [{"boundary": "top", "pressure": 10.0}, {"boundary": "left", "x": push}],
            "contact": {"boundary": "bottom", "kind": kind, "friction": coulomb_friction(0.4)},
            "solver": {"fallbacks": fallbacks},
        }
    )
    assert alone(scene, check=False).status is status


@pytest.mark.one_quick("solver", [{}, {"algorithm": "alm"}, {"fallbacks": False}])
def test_friction_that_nothing_presses(solver):
    """A block beside a wall that leans away from it is drawn up, where friction would hold it if it
    were jammed between the wall and its support: but it is apart, the pressures found are zero, and
    so is what friction carries.
    """
    scene = parse_scene(
        {
            "mesh": rectangle_mesh(3, 3),
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": {"boundary": "right", "x": 0.0},
            "traction": {"boundary": "top", "y": 1.0},
            "contact": {
                "boundary": "left",
                "gap": 0.1,
                "direction": [-1.0, -0.1],
                "friction": coulomb_friction(0.5),
            },
            "solver": solver,
        }
    )
    solution = alone(scene, check=False)
    assert solution.status is Status.SLIDES_AT_PRESSURES
    assert "friction at this pressure carries at most 0 of the loads" in solution.history.events


def test_friction_without_pressure():
    """No load acts on the free motion, and the gap stays open: friction would hold the body if
    anything pressed it on, which is another outcome than a body that no friction could hold.
    """
    scene = parse_scene(
        {
            "mesh": {"generator": "cylinder", "parameters": {"nz": 1, "nr": 1, "nt": 2}},
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": [{"boundary": "side", "z": 0.0}, {"boundary": "top", "z": 0.0}],
            "traction": {"boundary": "top", "pressure": 0.01},
            "contact": {
                "boundary": "bottom",
                "gap": 1e-3,
                "direction": [-0.3, -0.1, -1.0],
                "friction": coulomb_friction(1.8),
            },
        }
    )
    solution = alone(scene, check=False)
    assert solution.status is Status.NOT_HELD
    assert "nothing presses on the body" in solution.advice


def test_the_limit_is_an_end(monkeypatch):
    """A method that would go on for ever is stopped, with the outcome of the first way and a word
    in the history.
    """
    monkeypatch.setattr(method, "PROBLEMS_PER_STEP", 1)
    begin = time.process_time()
    solution = alone(square(coulomb="fp"), check=False)
    assert not solution.converged
    assert solution.history.linear_solves <= 200
    assert any(
        "limit of linear solves of all methods" in event for event in solution.history.events
    )
    assert time.process_time() - begin < 20


def pulled_and_pushed(**solver):
    """A flat block whose contact cannot open, with loads that press one end of it on and lift the
    other one.
    """
    return parse_scene(
        {
            "mesh": rectangle_mesh(3, 2, length=1.0, height=0.25),
            "material": {"young": 1000.0, "poisson": 0.3},
            "traction": {"boundary": "top", "x": -2.0, "y": -0.5},
            "contact": {
                "boundary": "bottom",
                "kind": "bilateral",
                "friction": coulomb_friction(1.5),
            },
            "solver": solver,
        }
    )


def by_enumeration(scene):
    """Pressures of all combinations of stick, slip and signs that are solutions: linear systems and
    inequalities.
    """
    d = prepared(scene)
    system, weight = contact_task(d, History()).system, d.boundary.weight
    stiffness, traces, n = (
        system.matrix.convert("dense").getDenseArray().copy(),
        system.contact.operator.convert("dense").getDenseArray().copy(),
        d.boundary.size,
    )
    normal, along, count, friction = (
        traces[0::2],
        traces[1::2],
        len(stiffness),
        scene.contact[0].friction.coefficient,
    )
    found = []
    for slips in itertools.product((0, 1, -1), repeat=n):
        for signs in itertools.product(*[(1, -1) if slip else (0,) for slip in slips]):
            matrix = np.zeros((count + 2 * n, count + 2 * n))
            matrix[:count] = np.hstack((stiffness, normal.T * weight, along.T * weight))
            matrix[count : count + n, :count] = normal
            for k, (slip, sign) in enumerate(zip(slips, signs, strict=True)):
                row = matrix[count + n + k]
                if slip:
                    row[count + n + k], row[count + k] = 1.0, -slip * sign * friction
                else:
                    row[:count] = along[k]
            load = np.concatenate((system.load.array, np.zeros(2 * n)))
            y, *rest = np.split(np.linalg.lstsq(matrix, load)[0], [count, count + n])
            if np.abs(matrix @ np.concatenate((y, *rest)) - load).max() > 1e-9 * np.abs(load).max():
                continue
            (pressure, shear), slipped = rest, along @ y
            least = 1e-9 * np.abs(pressure).max()
            slip, sign, held = np.array(slips), np.array(signs), np.array(slips) == 0
            sticks = ~held | (np.abs(shear) <= friction * np.abs(pressure) + least)
            goes = held | (
                (sign * pressure >= -least) & (slip * slipped >= -1e-9 * np.abs(y).max())
            )
            if (sticks & goes).all():
                found.append(pressure)
    return found


@pytest.mark.one_quick("solver", [{}, {"coulomb": "newton"}, {"algorithm": "alm"}], ids=str)
def test_newton_where_contact_cannot_open(solver):
    """The bound is that of the size of the pressure: points that pull have friction, too.  The
    fixed point fails here, and the only solution is that of the enumeration of all combinations.
    """
    (expected,) = by_enumeration(pulled_and_pushed())
    assert expected.min() < 0 < expected.max()
    assert not alone(pulled_and_pushed(coulomb="fp", fallbacks=False), check=False).converged
    solution = alone(pulled_and_pushed(**solver))
    assert solution.certificate.holds
    accuracy = 1e-6 if "algorithm" in solver else 1e-3
    found, wanted = np.sort(solution.contact.pressure), np.sort(expected)
    assert_allclose(found, wanted, rtol=0, atol=accuracy * np.abs(wanted).max())
    if solver.get("coulomb") == "newton":
        assert solution.history.linear_solves <= 6
