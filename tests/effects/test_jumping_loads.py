"""Loads that jump: their forces."""

import numpy as np
import pytest
from mpi4py import MPI
from scene_tables import fixed, rectangle_mesh
from scenes import alone

from signorini_fx.mechanics.statement.expressions import Expression, in_space, sample
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

COMM = MPI.COMM_WORLD


def square(x, *, n=8, degree=1, body_force=None, **more):
    """A unit square with a traction (0, x) on its top; it rests on its bottom."""
    scene = {
        "mesh": rectangle_mesh(n, n, length=1.0, height=1.0, cell="triangle"),
        "element": {"degree": degree},
        "material": {"young": 1000.0, "poisson": 0.3},
        "displacement": [fixed("left", "x")],
        "traction": [{"boundary": "top", "y": x}],
        "contact": [{"boundary": "bottom"}],
        "solver": {"algorithm": "alm"},
    }
    if body_force is not None:
        scene["body_force"] = body_force
    return parse_scene(scene | more)


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("where", ["x[0] < 0.47", "0.4 < x[0] < 0.45", "x[0] < 0.5"])
def test_a_load_has_one_rule_on_each_facet(where, degree):
    """Of 11 points, also where it jumps inside a facet: force and moment by hand, and the
    certificate agrees.
    """
    solution = alone(square(f"-1 if {where} else 0", degree=degree), check=False)
    assert solution.certificate.holds
    points, weights = np.polynomial.legendre.leggauss(11)
    x = ((points + 1) / 2 + np.arange(8)[:, None]) / 8
    loaded = (
        sample(Expression(f"1 if {where} else 0"), in_space(x.reshape(-1, 1))).reshape(x.shape)
        * weights
        / 16
    )
    assert solution.contact.forces[0][1] == pytest.approx(loaded.sum(), rel=1e-12, abs=1e-12)
    given = solution.resultants.of("top")
    assert given.force[1] == pytest.approx(-loaded.sum(), rel=1e-12, abs=1e-12)
    assert given.moment == pytest.approx(-(loaded * x).sum(), rel=1e-12, abs=1e-12)


BOX = {"length": 1.0, "width": 0.5, "height": 0.3, "nx": 5, "ny": 3, "nz": 2}


@pytest.mark.mpi
@pytest.mark.one_quick("cell", ["triangle", "quadrilateral", "tetrahedron", "hexahedron"])
def test_forces_of_all_kinds_that_jump(cell):
    """Tractions, total forces and body forces that jump at nodes, in two load steps between which
    the place moves: the force of the foundation is by hand.
    """
    space = cell in ("tetrahedron", "hexahedron")
    up = "yz"[space]
    sizes = BOX if space else {"length": 1.0, "height": 0.3, "nx": 5, "ny": 3}
    mesh = {"generator": "box" if space else "rectangle", "parameters": sizes | {"cell": cell}}
    thick = 0.5 if space else 1.0
    ends = [fixed("left", "x"), *([fixed("front", "y")] if space else [])]
    scene = parse_scene(
        {
            "mesh": mesh,
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": ends,
            "contact": {"boundary": "bottom"},
            # The rule in linear tetrahedra has points on their edges, which are on the jump.
            "body_force": {up: -1.8 if cell == "tetrahedron" else "-(1 if x[0] < 0.6 else 3)"},
            "traction": {"boundary": "top", up: "-where(x[0] < 0.2*t, 2, 0)"},
            "force": {"boundary": "top", up: -0.7, "spread": "3 if x[0] < 0.4 else 2"},
            "load_steps": {"times": [2.0, 3.0]},
        }
    )
    solution = solve(scene, COMM, check=False)
    weight = thick * 0.3 * (3 - 2 * 0.6)
    for time, step in zip((2.0, 3.0), solution.steps, strict=True):
        pushed = thick * 2 * 0.2 * time
        assert step.certificate.holds
        assert step.contact.forces[0][-1] == pytest.approx(weight + pushed + 0.7, rel=1e-8)
    assert solution.resultants.of("top").force[-1] == pytest.approx(-pushed - 0.7, rel=1e-12)
