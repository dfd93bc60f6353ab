"""Springs between a boundary and the ground: exact states, statics, and what is said."""

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI
from on_meshes import nodes
from scenes import alone
from steel_blocks import COMM, ELEMENTS, PLANE, YOUNG, body, scene

from signorini_fx import SceneError
from signorini_fx.mechanics.body.discretisation import prepare
from signorini_fx.mechanics.mesh.tagged import tag_boundaries
from signorini_fx.records import Timings
from signorini_fx.results.accuracy.stress_recovery import StressRecovery
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.solver import solve

# --- exact states ---------------------------------------------------------------------------------


@pytest.mark.mpi
@pytest.mark.one_quick("keys", ["normal", "axis", "everything"])
@pytest.mark.parametrize(("cells", "degree"), ELEMENTS)
def test_bar_on_end_springs(cells, degree, keys):
    """A bar that is pulled at one end and held by springs at the other: y = t / k + t x / E,
    without other supports.
    """
    pull, stiffness = 3.0, 700.0
    springs = {
        "normal": [{"boundary": "left", "normal": stiffness, "tangential": 5.0}],
        "axis": [
            {"boundary": "left", "x": stiffness, "y": 5.0, **({} if cells in PLANE else {"z": 5.0})}
        ],
        "everything": [
            {"boundary": "left", "normal": "300 + 0 * x[1]"},
            {"boundary": "left", "x": lambda x: 400 + 0 * x[0], "y": 0.0},
            {"boundary": "left", "tangential": 5.0},
        ],
    }[keys]
    given = scene(
        body(cells),
        degree,
        {"young": YOUNG, "poisson": 0.0},
        springs=springs,
        traction={"boundary": "right", "x": pull},
    )
    solution = solve(given, COMM, check=False)
    x, y = nodes(solution)
    expected = np.zeros_like(y)
    expected[:, 0] = pull / stiffness + pull * x[:, 0] / YOUNG
    assert np.abs(y - expected).max(initial=0.0) <= 1e-11 * pull / stiffness
    assert solution.certificate.holds
    assert solution.certificate.equilibrium < 1e-11
    strained = pull**2 / YOUNG
    assert solution.certificate.strain_energy == pytest.approx(strained, rel=1e-9)
    ground = solution.resultants.of("left")
    assert ground.acts == ("springs",)
    assert ground.force == pytest.approx([-pull, *np.zeros(y.shape[1] - 1)], abs=1e-9)
    assert ground.acts_at == pytest.approx([0.0, *np.full(y.shape[1] - 1, 0.5)], abs=1e-9)
    # The traction at the springs is part of the error estimate, which is zero for this state.
    error = StressRecovery.of(solution.model).error(solution.displacement)
    assert error < 1e-5 * np.sqrt(2 * strained)


@pytest.mark.mpi
@pytest.mark.one_quick("linear_algebra", ["full", "condensed", "krylov"])
@pytest.mark.parametrize("cells", ["quadrilateral", "hexahedra"])
def test_rigid_block_under_a_plate(cells, linear_algebra):
    """Springs below, a flat plate that has come down by d, a force at the left side: statics by
    hand.

    The plate lets the block sink without turning: the springs push up with k A d in the middle, the
    plate presses with the rest, N = k A d - P, and balances the moment of P: it acts at 1 + P / N
    from the left.
    """
    if linear_algebra == "condensed" and COMM.size > 1:
        pytest.skip("condensation is for one rank")
    stiffness, down, weight, stiff = 50.0, 0.02, 0.4, 1e7
    rigid = 2 * stiffness / stiff  # the block itself gives way by this share
    up = "y" if cells in PLANE else "z"
    given = scene(
        body(cells, fine=2),
        1,
        {"young": stiff, "poisson": 0.0},
        springs=[{"boundary": "bottom", "normal": stiffness, "tangential": 1.0}],
        traction={"boundary": "left", up: -weight},
        contact={"boundary": "top", "gap": -down},
        # The automatic gamma is that of the stiff body, with which the pressure of the soft springs
        # has no digits.
        solver={"linear_algebra": linear_algebra, "algorithm": "alm", "gamma_n": 1e6},
    )
    solution = solve(given, COMM, check=False)
    assert solution.converged
    assert solution.certificate.holds
    assert solution.linear_algebra.startswith(linear_algebra)
    pressed, ground = stiffness * 2 * down - weight, solution.resultants.of("bottom")
    contact = solution.resultants.of("top")
    assert contact.force[-1] == pytest.approx(-pressed, rel=rigid)
    assert contact.acts_at[0] == pytest.approx(1 + weight / pressed, rel=rigid)
    assert ground.force[-1] == pytest.approx(stiffness * 2 * down, rel=rigid)
    assert ground.acts_at[0] == pytest.approx(1.0, rel=rigid)


def test_beam_on_an_elastic_foundation():
    """A long slender beam under a force in its middle: P beta / (2 k) there (Hetenyi, Beams on
    Elastic Foundation).
    """
    length, height, stiffness, force = 60.0, 1.0, 1.0, 1.0
    mesh = dmesh.create_rectangle(
        MPI.COMM_SELF, [(0.0, 0.0), (length, height)], (240, 4), PLANE["quadrilateral"]
    )
    tagged = tag_boundaries(
        mesh, {"bottom": lambda x: x[1] < 1e-9, "top": lambda x: x[1] > height - 1e-9}
    )
    given = scene(
        tagged,
        2,
        {"young": 1e4, "poisson": 0.0, "hypothesis": "plane stress"},
        springs={"boundary": "bottom", "normal": stiffness, "tangential": 1e-3},
        traction={"boundary": "top", "y": f"-{force} if 29.5 <= x[0] <= 30.5 else 0"},
    )
    solution = alone(given, check=False)
    bending = 1e4 * height**3 / 12
    beta = (stiffness / (4 * bending)) ** 0.25
    expected = force * beta / (2 * stiffness)
    # Shear, which the theory leaves out, adds h^2 beta^2 times a number of order one.
    x, y = nodes(solution)
    y = y[:, 1]
    middle = np.argmin(np.hypot(x[:, 0] - 30.0, x[:, 1] - 0.5))
    assert -y[middle] == pytest.approx(expected, rel=2 * (height * beta) ** 2)
    assert solution.resultants.of("bottom").force[1] == pytest.approx(force, rel=1e-9)


# --- supports, and what is said -------------------------------------------------------------------

FREE = {
    "normal": ([{"boundary": "bottom", "normal": 1.0}], 1),
    "tangential": ([{"boundary": "bottom", "tangential": 1.0}], 2),
    "both": ([{"boundary": "bottom", "normal": 1.0, "tangential": 1.0}], 0),
    "very soft": ([{"boundary": "bottom", "normal": 1e-6, "tangential": 1e-6}], 0),
    "two sides": ([{"boundary": "bottom", "normal": 1.0}, {"boundary": "left", "normal": 1.0}], 0),
    "zero": ([{"boundary": "bottom", "normal": 0.0}], 3),
}


def turned(tagged, angle):
    """The same body, turned."""
    x = tagged.mesh.geometry.x
    x[:, 0], x[:, 1] = (
        np.cos(angle) * x[:, 0] - np.sin(angle) * x[:, 1],
        np.sin(angle) * x[:, 0] + np.cos(angle) * x[:, 1],
    )
    return tagged


@pytest.mark.mpi
@pytest.mark.parametrize("angle", [0.0, 0.3])
@pytest.mark.parametrize("held", FREE)
def test_springs_are_supports(held, angle):
    """They resist the rigid motions that do work against them, however the body is turned."""
    springs, free = FREE[held]
    given = scene(turned(body(), angle), springs=springs, traction={"boundary": "top", "y": -1.0})
    found = [one for one in check_scene(given, COMM).findings if "nothing holds" in one.message]
    assert bool(found) == (free > 0)
    assert prepare(given.statement, given.mesh, Timings()).motions.free.shape[1] == free


REFUSED = {
    "nothing": ({}, r"springs\[0\].*give either"),
    "two frames": ({"normal": 1.0, "x": 1.0}, r"springs\[0\].*give either"),
    "negative": ({"normal": -1.0}, r"springs\[0\]\.normal.*must not be negative"),
    "misspelt": ({"normall": 1.0}, r"springs\[0\]\.normall.*did you mean 'normal'"),
    "no boundary": ({"normal": 1.0, "boundary": "nowhere"}, r"springs\[0\]\.boundary.*nowhere"),
    "negative somewhere": ({"normal": "x[0] - 1"}, r"springs\[0\]\.normal.*a number from 0"),
    "not finite": ({"normal": "1 / (x[0] - 2)**2"}, r"springs\[0\]\.normal.*a number from 0"),
    "space": ({"x": 1.0, "z": 1.0}, r"springs\[0\]\.z.*the mesh is plane"),
}


@pytest.mark.mpi
@pytest.mark.parametrize("mistake", REFUSED)
def test_mistakes(mistake):
    """Each with its path, on all ranks."""
    springs, message = REFUSED[mistake]
    with pytest.raises(SceneError, match=message):
        check_scene(scene(body(), springs=[{"boundary": "bottom", **springs}]), COMM)
