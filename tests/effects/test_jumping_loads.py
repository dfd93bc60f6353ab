"""Loads that jump inside a facet or a cell: their forces, and what ``check`` says."""

import re

import numpy as np
import pytest
from mpi4py import MPI
from scenes import alone
from spaces import box
from test_safety import COULOMB, block, hub

from signorini_fx.mechanics.statement.cut_simplices import cut, halved
from signorini_fx.mechanics.statement.expressions import Expression
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve
from signorini_fx.solving.check import jumping_loads

COMM = MPI.COMM_WORLD


def square(x, *, n=8, degree=1, body_force=None, **more):
    """A unit square with a traction (0, x) on its top; it rests on its bottom."""
    scene = {
        "mesh": {
            "generator": "rectangle",
            "parameters": {"length": 1.0, "height": 1.0, "nx": n, "ny": n, "cell": "triangle"},
        },
        "element": {"degree": degree},
        "material": {"young": 1000.0, "poisson": 0.3},
        "displacement": [{"boundary": "left", "x": 0.0}],
        "traction": [{"boundary": "top", "y": x}],
        "contact": [{"boundary": "bottom"}],
        "solver": {"algorithm": "alm"},
    }
    if body_force is not None:
        scene["body_force"] = body_force
    return parse_scene(scene | more)


@pytest.mark.one_quick
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize(
    ("load", "exact", "width"),
    [
        ("where(x[0] < 0.47, -1, 0)", 0.47, 1e-9),
        ("-1 if 0.46 < x[0] < 0.465 else -0.1", 0.1045, 1e-9),
        ("-abs(x[0] - 0.43)**0.5", (0.43**1.5 + 0.57**1.5) / 1.5, 1e-3),
        ("-max(x[0] - 0.31, 0)", 0.69**2 / 2, 1e-4),  # kinks are not cut
        ("-1 if abs(x[0] - 0.4) < 0.01 else 0", 0.02, 1e-9),
    ],
)
def test_the_force_of_a_load_that_jumps(load, exact, width, degree):
    """Where statics determines the force on the foundation; cut loads are known but for round-off."""
    solution = alone(square(load, degree=degree))
    assert solution.contact.forces_of_each[0].sum(axis=0)[1] == pytest.approx(exact, rel=width)


def test_a_load_in_the_body_beside_one_that_jumps():
    """Both are integrated, each over its own cells, in one form."""
    more = {
        "gravity": {"y": "where(x[0] < 0.43, -4, -1)"},
        "material": {"young": 1000.0, "poisson": 0.3, "density": 2.0},
    }
    solution = alone(square("0", body_force={"y": -3.0}, **more))
    exact = 3 + 2 * (4 * 0.43 + 0.57)
    assert solution.contact.forces_of_each[0].sum(axis=0)[1] == pytest.approx(exact, rel=1e-9)


def test_a_body_force_that_jumps_inside_cells():
    """Its resultant is cut too, and so is the work of the loads."""
    scene = square(0.0, body_force={"y": "-1 if x[0] + x[1] < 0.37 else 0"})
    solution = alone(scene)
    assert solution.contact.forces_of_each[0].sum(axis=0)[1] == pytest.approx(0.37**2 / 2, rel=1e-9)


def test_the_parts_of_cut_simplices():
    """They fill their simplex, and no function changes its sign inside one; halving them fills it too."""
    chance = np.random.default_rng(3)
    text = Expression("(1 if 2*x[0] + x[1] < 0.9 else 0) + abs(x[0] - x[1]) + min(x[0], 0.3)")
    for size in (2, 3, 4):
        x = chance.uniform(size=(20, size, 3 if size == 4 else 2))
        owner, parts = cut(x, [text, 1.0])
        assert len(x) < len(parts) < 30 * len(x)
        np.testing.assert_allclose(np.bincount(owner, np.abs(np.linalg.det(parts))), 1.0, rtol=1e-12)
        corners = np.einsum("mkc,mcd->mkd", parts, x[owner])
        values = text.switches(corners.reshape(-1, x.shape[2]).T)
        signs = np.where(np.abs(values) < 1e-9, 0, np.sign(values))
        by_part = signs.reshape(len(signs), -1, size)
        assert ((by_part.min(axis=2) >= 0) | (by_part.max(axis=2) <= 0)).all()
        if size == 2:
            halves = halved(parts).reshape(2, len(parts), 2, 2)
            np.testing.assert_allclose(np.linalg.det(halves), np.tile(np.linalg.det(parts) / 2, (2, 1)), rtol=1e-9)
            np.testing.assert_array_equal([halves[0][:, 0], halves[1][:, 1]], [parts[:, 0], parts[:, 1]])


@pytest.mark.slow
def test_statements_say_what_they_rest_on():
    """Safety does."""
    assert alone(block(1.0, COULOMB)).safety.assumed == "the foundation presses where the body touches it now"
    assert "straight cells of the mesh" in alone(hub(0.5)).safety.assumed


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize(
    ("load", "exact", "moment"),
    [
        ("where(x[0] < 0.47, -1, 0)", 0.47, 0.47**2 / 2),
        ("-1 if 0.46 < x[0] < 0.465 else 0", 0.005, 0.005 * 0.4625),
        ("-1 if abs(x[0] - 0.4375) < 0.01 else -x[0]", 0.5 + 0.02 * (1 - 0.4375), None),
    ],
)
def test_a_solution_has_the_force_of_a_load_that_jumps(load, exact, moment, degree):
    """Solver and certificate cut facets, each by its own code."""
    solution = alone(square(load, degree=degree), check=False)
    assert solution.certificate.holds
    assert solution.contact.forces[0][1] == pytest.approx(exact, rel=1e-12)
    given = solution.resultants.of("top")
    assert given.force[1] == pytest.approx(-exact, rel=1e-12)
    if moment is not None:
        assert given.moment == pytest.approx(-moment, rel=1e-12)


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("cell", ["tetrahedron", "hexahedron"])
def test_a_load_within_one_facet(cell, degree):
    """Which has no vertex of the mesh: all parts of the facet are between four jumps."""
    inside = "x[0] >= 0.25 and x[0] <= 0.75 and x[1] >= 0.125 and x[1] <= 0.375"
    scene = {
        "mesh": {"generator": "box", "parameters": BOX | {"nx": 1, "ny": 1, "nz": 1, "cell": cell}},
        "element": {"degree": degree},
        "material": {"young": 1000.0, "poisson": 0.3},
        "displacement": [{"boundary": "bottom", "x": 0.0, "y": 0.0, "z": 0.0}],
        "traction": [{"boundary": "top", "z": f"-8.0 if {inside} else 0.0"}],
    }
    solution = alone(parse_scene(scene), check=False)
    assert solution.certificate.holds
    np.testing.assert_allclose(solution.resultants.of("top").force, [0.0, 0.0, -1.0], atol=1e-12)


BOX = {"length": 1.0, "width": 0.5, "height": 0.3, "nx": 4, "ny": 3, "nz": 2}


@pytest.mark.one_quick
@pytest.mark.mpi
@pytest.mark.parametrize("cell", ["triangle", "quadrilateral", "tetrahedron", "hexahedron"])
def test_forces_of_all_kinds_that_jump(cell):
    """Tractions, total forces and body forces that a line or a plane cuts, in two load steps between which it moves:
    the force of the foundation is by hand, and the certificate's own cuts agree.
    """
    space = cell in ("tetrahedron", "hexahedron")
    up = "yz"[space]
    sizes = BOX if space else {"length": 1.0, "height": 0.3, "nx": 5, "ny": 3}
    mesh = {"generator": "box" if space else "rectangle", "parameters": sizes | {"cell": cell}}
    thick = 0.5 if space else 1.0
    across = "x[0] + 0.5*x[1]" if space else "x[0]"  # at the mean of x[1]
    ends = [{"boundary": "left", "x": 0.0}, *([{"boundary": "front", "y": 0.0}] if space else [])]
    scene = parse_scene(
        {
            "mesh": mesh,
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": ends,
            "contact": {"boundary": "bottom"},
            "body_force": {up: f"-(1 if {across} < 0.61 else 3)"},
            "traction": {"boundary": "top", up: f"-where({across} < 0.23*t, 2, 0)"},
            "force": {"boundary": "top", up: -0.7, "spread": f"3 if {across} < 0.57 else 2"},
            "load_steps": {"times": [2.0, 3.0]},
        }
    )
    solution = solve(scene, COMM, check=False)
    middle = 0.125 if space else 0.0
    weight = thick * 0.3 * (3 - 2 * (0.61 - middle))
    for time, step in zip((2.0, 3.0), solution.steps, strict=True):
        pushed = thick * 2 * (0.23 * time - middle)
        assert step.certificate.holds
        assert step.contact.forces[0][-1] == pytest.approx(weight + pushed + 0.7, rel=1e-8)
    assert solution.resultants.of("top").force[-1] == pytest.approx(-pushed - 0.7, rel=1e-12)


def test_round_a_body_and_equal_loads():
    """An axisymmetric body under two equal pressures up to a radius: the circumference counts, and both act."""
    push = {"boundary": "top", "pressure": "where(x[0] < 0.47, 1, 0)"}
    material = {"young": 1000.0, "poisson": 0.3, "hypothesis": "axisymmetric"}
    solution = alone(square(0.0, traction=[push, push], material=material, displacement=[], solver={}), check=False)
    assert solution.certificate.holds
    assert solution.resultants.of("bottom").force[1] == pytest.approx(2 * np.pi * 0.47**2, rel=1e-9)


@pytest.mark.parametrize(("cell", "nodes"), [("triangle", 8), ("quadrilateral", 8)])
def test_check_names_loads_that_jump_inside_a_facet(cell, nodes):
    """With the share of the force that is wrong; not where facets are cut, where they jump at nodes, nor where they are
    smooth.
    """

    def told(load):
        scene = square(
            load, mesh={"generator": "rectangle", "parameters": {"length": 1.0, "nx": nodes, "ny": 2, "cell": cell}}
        )
        return [found for found in check_scene(scene).findings if found.path == "traction[0].y"]

    (found,) = told("where(x[0]**2 < 0.2209, -1, 0)")
    assert found.level == "warning"
    assert "jumps inside 1 facet of 'top'" in found.message
    for smooth in (
        "where(x[0] < 0.47, -1, 0)",
        "-1 if 0.46 < x[0] < 0.465 else 0",
        "where(x[0] < 0.5, -1, 0)",
        "-x[0]**2",
        -1.0,
        "-abs(x[0] - 0.47)",
    ):
        assert not told(smooth)


ROUND = "(x[0] - 0.4)**2 + (x[1] - 0.2)**2 < 0.001"


@pytest.mark.parametrize(
    ("cell", "key", "load", "area", "entities"),
    [
        ("tetrahedron", "traction", f"-1 if {ROUND} else 0", np.pi * 0.001, "inside 1 facet of 'top'"),
        ("hexahedron", "traction", f"-1 if {ROUND} else 0", np.pi * 0.001, "inside 1 facet of 'top'"),
        ("hexahedron", "body_force", "-1 if x[0]**2 < 0.075 else 0", 0.15 * 0.075**0.5, "inside 6 cells"),
        ("hexahedron", "body_force", lambda x: np.where(x[0] < 0.3, -1.0, 0.0), 0.15 * 0.3, "inside 6 cells"),
        ("distorted", "body_force", "-1 if x[0] < 0.3 else 0", 0.15 * 0.3, "inside 6 cells"),
        ("distorted", "traction", "-1 if x[0] < 0.3 else 0", 0.15, "inside 3 facets of 'top'"),
        ("tetrahedron", "body_force", "-1 if x[0] < 0.3 else 0", 0.15 * 0.3, ""),
    ],
)
def test_check_names_what_is_not_cut(cell, key, load, area, entities):
    """Circles within a face, cells that jumps cross, functions of Python, distorted cells: with the wrong share."""
    cells = "tetrahedra" if cell == "tetrahedron" else "hexahedra"
    tagged = box(cells, (4, 3, 2), size=(1.0, 0.5, 0.3))
    if cell == "distorted":
        x = tagged.mesh.geometry.x
        x[:, 1] += 0.1 * x[:, 0] * x[:, 1] * (0.5 - x[:, 1])
    effect = {"z": load} | ({"boundary": "top"} if key == "traction" else {})
    scene = {"mesh": tagged, "material": {"young": 1e3, "poisson": 0.3}, "displacement": {"boundary": "left", "x": 0.0}}
    scene = parse_scene(scene | {"contact": {"boundary": "bottom"}, key: effect})
    found = [finding for finding in check_scene(scene).findings if re.fullmatch(rf"{key}(\[0\])?\.z", finding.path)]
    assert [entities in finding.message for finding in found] == [True] * bool(entities)
    if entities and cell != "distorted":
        given = alone(scene, check=False).model.applied[0].forces.sum()
        share = float(re.search(r"([\d.]+) % of it wrong", found[0].message)[1]) / 100
        assert share == pytest.approx(abs(-given / area - 1), rel=0.2, abs=0.02)


CIRCLE, WAVY = "x[0]**2 + x[1]**2 < 1.7", "2 + sin(x[1]) if (x[0] - 1)**2 + x[1]**2 < 0.3 else 0"


@pytest.mark.parametrize("load", [f"1 if {CIRCLE} else 0", WAVY])
def test_of_many_cells_only_those_that_jump_are_looked_at_closely(monkeypatch, load):
    """What is said is nearly the same."""
    scene = parse_scene(
        {
            "mesh": {"generator": "rectangle", "parameters": {"nx": 30, "ny": 10, "cell": "quadrilateral"}},
            "material": {"young": 1.0, "poisson": 0.3},
            "displacement": {"boundary": "left", "x": 0.0, "y": 0.0},
            "body_force": {"y": load},
        }
    )
    shares = []
    for many in (10, 10**6):
        monkeypatch.setattr(jumping_loads, "MANY_LOADED", many)
        texts = [
            finding.message for finding in check_scene(scene).warnings if "points of quadrature" in finding.message
        ]
        shares.append([float(re.search(r"take ([\d.e-]+) %", text)[1]) for text in texts])
    assert shares[1]
    assert shares[0] == pytest.approx(shares[1], rel=0.2)
