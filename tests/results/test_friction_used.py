"""The share of its friction that a body uses, against statics, a ramp and a linear programme."""

from functools import cache

import numpy as np
import pytest
from boxes import Box, boxes_mesh, scene_on
from mpi4py import MPI
from scene_tables import coulomb_friction, fixed, rectangle_mesh
from scenes import alone
from scipy.optimize import linprog

from signorini_fx.addons.report.page import write_report
from signorini_fx.results.files import write_results
from signorini_fx.scenes.reading import parse_scene


def hub(torque, **load_steps):
    """A ring pressed onto a shaft that turns it."""
    return parse_scene(
        {
            "mesh": {"generator": "ring", "parameters": {"nr": 2, "nt": 4, "nz": 1}},
            "material": {"young": 1e5, "poisson": 0.3},
            "displacement": fixed("bottom", "z"),
            "traction": {
                "boundary": "outer",
                "x": f"{-torque} * x[1]",
                "y": f"{torque} * x[0]",
                **({"factors": [0.0, 1.0]} if load_steps else {}),
            },
            "contact": {"boundary": "inner", "gap": -1e-3, "friction": coulomb_friction(0.3)},
            **({"load_steps": load_steps} if load_steps else {}),
        }
    )


@cache
def beyond_the_limit():
    """A ramp whose last torque the friction does not hold."""
    return alone(hub(3.0, steps=4, times=[0.0, 1.0]), check=False)


def test_a_hub_at_its_slip_torque():
    """The torque itself takes a per cent of the pressure away; a ramp ends where all of the
    friction is used.
    """
    shares = np.array([alone(hub(torque)).friction_used / torque for torque in (0.5, 1.5, 1.95)])
    np.testing.assert_allclose(shares, 1 / 2.02, rtol=0.01)
    assert (np.diff(shares) > 0).all()
    ramp = beyond_the_limit()
    assert not ramp.converged
    assert 3.0 * ramp.last_step.time == pytest.approx(1 / shares[-1], rel=0.02)
    assert ramp.friction_used == pytest.approx(1.0, rel=0.02)


@pytest.mark.parametrize("beyond", [False, True])
def test_a_page_says_the_friction_or_the_limit(tmp_path, beyond):
    """Of a press fit that holds the share of its friction, of a ramp beyond its limit that limit,
    never both.
    """
    solution = beyond_the_limit() if beyond else alone(hub(1.5))
    write_results(solution, tmp_path / "hub", fields=False, pictures=False)
    page = write_report(tmp_path / "hub", None).read_text(encoding="utf-8")
    first = page.partition("<h2>Figures")[0]
    assert ("74 % used" in first) is not beyond
    assert ("no solution of load step" in first) is beyond
    assert ("<dt>friction</dt>" in first) is not beyond


@pytest.mark.parametrize("pushes", [(0.1, 0.2), (0.2, 0.1)])
def test_of_several_pieces_the_weakest_counts(pushes):
    boxes = [Box("one", 0.0, 0.0, 1.0, 1.0, 2, 2), Box("other", 2.0, 0.0, 1.0, 1.0, 2, 2)]
    tractions = [
        {"boundary": f"left {box.name}", "x": push} for box, push in zip(boxes, pushes, strict=True)
    ]
    friction = coulomb_friction(0.8)
    contact = [{"boundary": f"bottom {box.name}", "friction": friction} for box in boxes]
    scene = scene_on(
        boxes_mesh(MPI.COMM_SELF, boxes),
        body_force={"y": -1.0},
        traction=tractions,
        contact=contact,
    )
    assert alone(scene).friction_used == pytest.approx(0.2 / 0.8, rel=1e-6)


def test_of_a_wheel_the_nodes_in_contact_count():
    """A braked wheel that is pushed: it would rest at steeper nodes if it slid, which this solution
    does not use.
    """
    push, weight, radius = 0.6, 2.0, 4.0
    wheel = {
        "shape": "circle",
        "centre": [5.0, 3.0 + radius],
        "radius": radius,
        "pivot": [5.0, 3.0 + radius],
    }
    wheel |= {"force": [push, -weight], "prescribed": {"rotation": 0.0}}
    scene = parse_scene(
        {
            "mesh": rectangle_mesh(40, 12, length=10.0, height=3.0),
            "material": {"young": 20.0, "poisson": 0.3},
            "displacement": fixed("bottom"),
            "contact": {"boundary": "top", "foundation": wheel, "friction": coulomb_friction(0.5)},
        }
    )
    solution = alone(scene)
    table = solution.table.columns
    touching = table["state"] != "open"
    normal = np.column_stack((table["n_x"], table["n_y"]))[touching]
    along = np.column_stack((-normal[:, 1], normal[:, 0]))
    bound = (table["bound"] * table["weight"])[touching]
    # Forces of the wheel on the body: pressures along -n, shears within their bounds; the multiple
    # is the last unknown.
    rows = np.column_stack((-normal.T, along.T, [-push, weight]))
    limits = [(0, None)] * len(bound) + [(-b, b) for b in bound] + [(0, None)]
    best = linprog([0.0] * (2 * len(bound)) + [-1.0], A_eq=rows, b_eq=[0.0, 0.0], bounds=limits)
    assert 1.0 < -best.fun < 10.0
    assert solution.friction_used == pytest.approx(-1 / best.fun, rel=1e-6)


def test_friction_that_a_support_could_carry():
    """Equilibrium needs none of it, and yet it carries a share of its limit, which is said."""
    solution = alone(
        parse_scene(
            {
                "mesh": rectangle_mesh(8, 4, length=2.0, height=1.0),
                "material": {"young": 1000.0, "poisson": 0.3},
                "displacement": fixed("left", "x"),
                "traction": {"boundary": "top", "x": 0.1, "y": -1.0},
                "contact": {"boundary": "bottom", "friction": coulomb_friction(0.5)},
            }
        )
    )
    assert solution.friction_used == pytest.approx(0.0, abs=1e-9)
    columns = solution.table.columns
    share = abs(columns["weight"] @ columns["shear"]) / (0.5 * 2.0)
    assert f"friction    {100 * share:.0f} % of its limit" in str(solution)
