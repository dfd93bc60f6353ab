"""Below which friction coefficient there is one solution: against all states of few points, and one
triangle.
"""

import re
from itertools import product

import numpy as np
import pytest
from mpi4py import MPI
from scene_tables import coulomb_friction, fixed, rectangle_mesh
from scenes import one_triangle

from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.solving.uniqueness import proved_multiple


def told(scene):
    """What check says of it."""
    found = check_scene(scene, MPI.COMM_SELF, uniqueness=True).findings
    return [one.message for one in found if "one solution" in one.message]


def coefficient_of(scene):
    """The coefficient that check names."""
    (message,) = told(scene)
    return float(
        re.match(
            r"with friction coefficients below ([\d.]+) there is one solution on this mesh", message
        )[1]
    )


def states(stiffness, friction, load, gap):
    """All solutions of few points in 2D, components (n, t) per point, by trying all of their
    states.
    """
    count, found = gap.size, []
    size = np.abs(gap).max() + np.abs(np.linalg.solve(stiffness, load)).max()
    for kinds in product(["open", "stick", "+", "-"], repeat=count):
        matrix, right = stiffness.copy(), load.copy()
        for point, kind in enumerate(kinds):
            n, t = 2 * point, 2 * point + 1
            if kind == "open":
                continue
            if kind == "stick":
                matrix[t], right[t] = np.eye(2 * count)[t], 0.0
            else:  # r_T = +-F r_N
                sign = 1.0 if kind == "+" else -1.0
                matrix[t], right[t] = (
                    stiffness[t] - sign * friction * stiffness[n],
                    load[t] - sign * friction * load[n],
                )
        for point, kind in enumerate(kinds):
            if kind != "open":
                matrix[2 * point], right[2 * point] = np.eye(2 * count)[2 * point], gap[point]
        if abs(np.linalg.det(matrix)) < 1e-12 * np.abs(stiffness).max() ** (2 * count):
            continue
        v = np.linalg.solve(matrix, right)
        force = load - stiffness @ v
        pressure, shear = force[::2], force[1::2]
        small, tiny = 1e-9 * size, 1e-9 * np.abs(load).max()
        held = {
            "open": (v[::2] <= gap + small),
            "stick": (pressure >= -tiny) & (np.abs(shear) <= friction * pressure + tiny),
            "+": (pressure >= -tiny) & (v[1::2] >= -small),
            "-": (pressure >= -tiny) & (v[1::2] <= small),
        }
        new = all(np.abs(v - other).max() > 1e-6 * size for other in found)
        if new and all(held[kind][point] for point, kind in enumerate(kinds)):
            found.append(v)
    return found


def random_points(chance, count):
    """A stiffness of contact points with rather much coupling, shape (2 n, 2 n)."""
    root = chance.normal(size=(2 * count, 2 * count))
    return root @ root.T + 0.3 * np.eye(2 * count)


def test_one_solution_below_the_bound():
    """All states of three points tried: one solution for any load, and several for some far
    above.
    """
    several = 0
    for seed in range(4):
        chance = np.random.default_rng(seed)
        stiffness = random_points(chance, 3)
        critical, _ = proved_multiple(stiffness, np.eye(6), PointFriction(np.zeros(3), np.ones(3)))
        assert critical > 0
        for factor in (0.99, 6.0):
            for _ in range(8):
                load, gap = chance.normal(size=6), 0.3 * chance.normal(size=3)
                found = states(stiffness, factor * critical, load, gap)
                assert factor > 1 or len(found) == 1
                several += len(found) > 1
    assert several > 0


def test_one_triangle():
    """The critical coefficient is sqrt(3) = K_xx / |K_xy|, whatever the coefficient of the scene
    is.
    """
    for coefficient in (1.7, 3.0):
        assert coefficient_of(one_triangle(coefficient, (0.015, -0.006))) == pytest.approx(
            np.sqrt(3), rel=1e-3
        )


def test_what_is_not_tried():
    """A preload by a force, whose shortening is an unknown of the problem, and friction with
    cohesion.
    """
    preload = {"point": [1.37, 0.0], "axis": [1.0, 0.0], "force": 0.1}
    friction = coulomb_friction(0.1)
    scene = {
        "mesh": rectangle_mesh(12, 4, length=3.0),
        "material": {"young": 1000.0, "poisson": 0.3},
        "displacement": fixed("left"),
        "traction": {"boundary": "top", "y": -1.0},
        "contact": {"boundary": "bottom", "friction": friction},
    }
    assert coefficient_of(parse_scene(scene)) > 0.0
    (message,) = told(parse_scene(scene | {"preload": preload}))
    assert message.endswith("not tried where a force determines the shortening of a section")
    cohesive = {"boundary": "bottom", "friction": {**friction, "cohesion": 0.1}}
    (message,) = told(parse_scene(scene | {"contact": cohesive}))
    assert "friction ends with a jump" in message


@pytest.mark.parametrize("seed", [0, 1])
def test_motions_that_nothing_but_friction_stops(seed):
    """Where friction alone holds a piece along its foundation nothing is proved; a frictionless
    piece that moves freely there changes nothing of what is proved of another one."""
    chance = np.random.default_rng(seed)
    stiffness, law = random_points(chance, 2), PointFriction(np.zeros(2), np.array([0.1, 0.2]))
    loose = np.zeros(4)
    loose[1::2] = 1.0
    free = stiffness - np.outer(stiffness @ loose, stiffness @ loose) / (loose @ stiffness @ loose)
    found, why = proved_multiple(free, np.eye(4), law)
    assert found == 0.0
    assert "nothing but friction holds" in why
    (alone, _), zero = proved_multiple(stiffness, np.eye(4), law), np.zeros((4, 4))
    both = np.block([[stiffness, zero], [zero, free]])
    smooth = PointFriction(np.zeros(4), np.array([0.1, 0.2, 0.0, 0.0]))
    assert proved_multiple(both, np.eye(8), smooth)[0] == pytest.approx(alone, rel=1e-4)
