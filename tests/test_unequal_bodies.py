"""Bodies of very unequal loads and stiffness in one scene: none stops the iteration of another one too early."""

from functools import cache

import numpy as np
import pytest
from mpi4py import MPI
from scenes import alone

from signorini_fx.contact.groups import PointGroups, shares
from signorini_fx.contact.points import ContactPoints
from signorini_fx.scene.reading import parse_scene
from signorini_fx.solving.solver import solve

# Of the largest pressure of each body: what a tolerance of 1e-7 leaves of a fixed point.
NEAR = 1e-6


def scene(*sizes, algorithm="ssn", coulomb="fp", degree=1, steps=0):
    """Blocks beside each other, pressed onto the ground and pushed aside; size, and modulus over 1000, of each."""
    data = {
        "body": [],
        "element": {"degree": degree},
        "solver": {"algorithm": algorithm, "coulomb": coulomb, "gamma_n": 1e7, "gamma_t": 1e7},
        "load_steps": {"steps": steps} if steps else {},
    }
    for k, (size, soft, coefficient) in enumerate(sizes):
        name, x0, mesh = "abc"[k], 3.0 * k, {"length": 1.0, "height": 0.5, "nx": 8, "ny": 3, "cell": "quadrilateral"}
        sample = {
            "material": {"region": name, "young": 1e3 * soft, "poisson": 0.3},
            "displacement": {"boundary": f"{name}.left", "x": 0.0},
            "traction": {"boundary": f"{name}.top", "y": -size},
            "contact": {
                "boundary": f"{name}.bottom",
                "gap": f"{1e-4 * size / soft!r} * (x[0] - {x0}) ** 2",
                "friction": {"law": "coulomb", "coefficient": coefficient},
            },
        }
        data["body"].append({"name": name, "mesh": {"generator": "rectangle", "parameters": mesh}, "shift": [x0, 0.0]})
        for key, entry in sample.items():
            data.setdefault(key, []).append(entry)
        data["traction"].append({"boundary": f"{name}.right", "x": -size})
    return parse_scene({key: value for key, value in data.items() if value})


def tractions(solution, part):
    """Pressure and shear on the ground of one body, in order from left to right."""
    boundary = solution.contact.boundary
    here = np.flatnonzero(boundary.part == part)
    order = here[np.argsort(boundary.x[here, 0])]
    return np.column_stack((solution.contact.pressure, solution.contact.shear))[order]


@cache
def lonely(*size, **options):
    """Tractions of a body that is alone in its scene."""
    return tractions(alone(scene(size, **options)), 0)


@pytest.mark.parametrize(
    ("algorithm", "coulomb", "small", "steps"),
    [
        ("ssn", "fp", (1e-8, 1.0, 0.3), 0),
        ("alm", "fp", (1e-7, 1.0, 0.3), 0),
        ("exact", "fp", (1e-8, 1e-3, 0.3), 0),
        ("ssn", "fp", (1e-7, 1e-2, 0.3), 2),
    ],
)
def test_a_small_body_is_solved_as_if_it_were_alone(algorithm, coulomb, small, steps):
    """The Coulomb iteration stopped, and old factors served as preconditioners, by norms over all bodies."""
    options = {"algorithm": algorithm, "coulomb": coulomb, "steps": steps}
    bodies = (1.0, 1.0, 0.01), small
    solution = alone(scene(*bodies, **options))
    assert solution.certificate.holds
    for part, body in enumerate(bodies):
        expected = lonely(*body, **options)
        assert tractions(solution, part) == pytest.approx(expected, abs=NEAR * np.abs(expected).max())


def test_groups():
    """Points are judged by what reaches the same pieces, and by the largest of those that share a piece."""
    one = np.ones(5)
    points = ContactPoints(MPI.COMM_SELF, one, np.tile(np.eye(2), (5, 1, 1)), np.zeros((5, 2)))
    reached = np.array([[1, 0, 0, 0], [1, 1, 0, 0], [1, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], dtype=bool)
    groups = PointGroups.of(points, reached)
    assert groups.count == 4
    values = np.array([1.0, 3.0, 4.0, 1e-3, 1e-20])
    norms, scales = groups.norms(values), groups.scales(groups.norms(values))
    assert norms[groups.number] == pytest.approx([1.0, 5.0, 5.0, 1e-3, 1e-20], rel=1e-15)
    assert scales[groups.number] == pytest.approx([5.0, 5.0, 5.0, 1e-3, 5e-8], rel=1e-15)
    assert groups.largest(values)[groups.number] == pytest.approx([1.0, 4.0, 4.0, 1e-3, 1e-20], rel=1e-15)
    assert groups.some(points, np.array([3, 4])).number.tolist() == groups.number[3:].tolist()
    assert shares(np.array([1.0, 2.0]), np.array([0.0, 4.0]), np.inf).tolist() == [np.inf, 0.5]
    whole = PointGroups.of(points, points.everywhere[:, None])
    assert (whole.count, whole.norms(values)[0]) == (1, points.norm(values))


@pytest.mark.mpi
def test_on_ranks():
    """Each rank takes part in every norm, with points of the body or without; the same solves as on one."""
    bodies = (1.0, 1.0, 0.01), (1e-8, 1.0, 0.3)
    solution, single = solve(scene(*bodies), MPI.COMM_WORLD), alone(scene(*bodies))
    assert solution.certificate.holds
    assert solution.history.linear_solves == single.history.linear_solves
