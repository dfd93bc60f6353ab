"""Scenes without a solution, or that the method does not solve: each ends in an outcome with a
name.
"""

from pathlib import Path

import numpy as np
import pytest
from scene_tables import coulomb_friction, fixed, rectangle_mesh, tresca_friction
from scenes import PATCH, alone, example1

from signorini_fx.mechanics.effects.loads import Traction
from signorini_fx.records import Status
from signorini_fx.results.files import write_results
from signorini_fx.results.solution import ConvergenceError
from signorini_fx.results.summary import lines_of, summary_of
from signorini_fx.scenes.reading import parse_scene

SMALL = {"nx": 30, "ny": 10}


def loaded(x, y):
    """A traction on top."""
    return (Traction(boundary="top", x=x, y=y),)


def outcome(scene):
    """The status of the scene; with ``check`` it is raised, and the error says the same."""
    solution = alone(scene, check=False)
    if not solution.converged:
        with pytest.raises(ConvergenceError) as caught:
            alone(scene)
        assert caught.value.solution.status is solution.status
        first, *warnings = str(caught.value).splitlines()
        assert first == f"{solution.status.value}: {solution.advice}"
        told = [
            f for f in solution.findings if f.level == "warning" and f.message != solution.advice
        ]
        assert warnings == [f"{f.path}: {f.message}" for f in told]
    return solution


def test_converged():
    """The scene that the others are made from has a solution, and its records say so."""
    solution = outcome(example1(bound=1.5, **SMALL))
    assert solution.converged
    assert solution.certificate.holds
    assert solution.history.iterations[-1].changed == 0
    assert solution.history.outer[-1].status == "converged"


def test_free_sideways_without_friction():
    """Contact without friction does not hold a body sideways: said before any linear solve."""
    solution = outcome(example1(**SMALL).model_copy(update={"displacement": ()}))
    assert solution.status is Status.NOT_HELD
    assert solution.history.iterations == []
    # What to do is said once, with the motion.
    assert "the translation along (1, 0)" in solution.advice
    assert "friction" in solution.advice
    assert (
        " ".join(map(str, lines_of(summary_of(solution), Path()))).split().count("prescribe") == 1
    )


def test_no_contact_and_no_support():
    """A linear scene whose body floats."""
    scene = example1(**SMALL).model_copy(update={"displacement": (), "contact": ()})
    assert outcome(scene).status is Status.NOT_HELD


@pytest.mark.parametrize("law", [{}, {"bound": 1.5}, {"coefficient": 0.3}])
def test_pulled_off(law):
    """A load that lifts the body off its foundation has no static solution."""
    scene = example1(**law, **SMALL).model_copy(update={"traction": loaded(0.0, 20.0)})
    assert outcome(scene).status is Status.OPEN


@pytest.mark.parametrize("law", [{"bound": 1.5}, {"coefficient": 0.3}])
def test_pushed_off_sideways(law):
    """A sideways load beyond what friction can carry slides the body away."""
    scene = example1(**law, **SMALL).model_copy(
        update={"traction": loaded(10.0, -20.0), "displacement": ()}
    )
    solution = outcome(scene)
    assert solution.status is Status.SLIDES
    if not solution.history.iterations:  # known before the first solve: nothing has touched yet
        assert not solution.contact.pressure.any()
        assert not solution.contact.in_contact.any()


def test_friction_where_a_support_takes_the_pressure():
    """A corner that is held along its normal does not press: friction there holds no body."""
    scene = example1(coefficient="0.8 if x[0] < 0.01 else 0", **SMALL)
    sides = tuple(
        support.model_copy(update={"x": None, "y": 0.0}) for support in scene.displacement
    )
    scene = scene.model_copy(update={"traction": loaded(2.0, 0.0), "displacement": sides})
    assert outcome(scene).status is Status.NOT_HELD


def fitted(gap, support, algorithm="ssn", **mesh):
    """A block of height 2 between two foundations, without a load."""
    size = {"length": 3.0, "height": 2.0, "nx": 6, "ny": 4, **mesh}
    scene = {
        "mesh": rectangle_mesh(**size),
        "material": {"young": 1000.0, "poisson": 0.3},
        "displacement": support,
        "contact": [{"boundary": "bottom", "gap": gap[0]}, {"boundary": "top", "gap": gap[1]}],
        "solver": {"algorithm": algorithm},
    }
    return parse_scene(scene)


LEFT = fixed("left", "x")


@pytest.mark.parametrize("algorithm", ["ssn", "alm"])
@pytest.mark.parametrize("gap", [(-0.01, -0.01), (0.03, -0.05)])
def test_squeezed(gap, algorithm):
    """An interference fit needs no load: the block is compressed by 0.02, free to widen, wherever
    the foundations are.

    Plane strain without a stress along x: the pressure is E / (1 - nu^2) times the strain 0.02 / 2.
    """
    solution = outcome(fitted(gap, LEFT, algorithm))
    assert solution.converged
    # What gamma leaves of the penetration, as a share of the interference.
    exact = 1000.0 / (1 - 0.3**2) * 0.01
    leaves = 0.0 if algorithm == "alm" else 2 * exact / solution.parameters["gamma_n"] / 0.02
    np.testing.assert_allclose(solution.contact.pressure, exact, rtol=1e-7 + 2 * leaves)
    assert solution.contact.in_contact.all()
    assert not any("nothing presses" in found.message for found in solution.findings)


@pytest.mark.parametrize("gap", [(0.01, 0.01), (0.0, 0.0), (0.03, -0.02)])
def test_nothing_presses(gap):
    """Where the block has room, or touches without interference, nothing presses it on."""
    solution = outcome(fitted(gap, LEFT))
    assert solution.status is Status.NOT_HELD
    assert "nothing presses on the body" in solution.advice


@pytest.mark.parametrize("friction", [{"law": "none"}, coulomb_friction(0.3)])
def test_a_heated_block_that_nothing_presses(friction, tmp_path):
    """It widens without a force.  Where it lies is not told by one load step, whose results are
    written all the same; of two it stays where it was.
    """
    scene = {
        "mesh": rectangle_mesh(4, 4, length=1.0, height=1.0),
        "material": {"young": 1000.0, "poisson": 0.3, "expansion": 1e-3},
        "displacement": LEFT,
        "contact": {"boundary": "bottom", "friction": friction},
    }
    once = outcome(parse_scene(scene | {"temperature": {"change": 10.0}}))
    assert once.status is Status.NOT_HELD
    assert "nothing presses on the body" in once.advice
    write_results(once, tmp_path)
    heat = {"change": 10.0, "factors": [1.0, 1.0]}
    twice = outcome(parse_scene(scene | {"temperature": heat}))
    assert twice.converged
    u = twice.displacement
    moved = 0.01 * 1.3 * u.function_space.tabulate_dof_coordinates()[:, :2]  # of plane strain
    np.testing.assert_allclose(u.x.array.reshape(-1, 2), moved, atol=1e-7)


@pytest.mark.one_quick("friction", [coulomb_friction(0.3), tresca_friction(0.3)])
@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
@pytest.mark.parametrize(("nx", "ny"), [(3, 2), (14, 3)])
def test_loads_that_balance_each_other(friction, cell, nx, ny):
    """A resultant of round-off is no load: nothing presses the body on, on any mesh and in any
    units.
    """
    for length, force in ((1.0, 1.0), (1e-7, 1e9)):
        parameters = {
            "length": 3.0 * length,
            "height": 1.1 * length,
            "nx": nx,
            "ny": ny,
            "cell": cell,
        }
        scene = parse_scene(
            {
                "mesh": rectangle_mesh(**parameters),
                "material": {"young": 1000.0 * force, "poisson": 0.3},
                "traction": [
                    {
                        "boundary": "top",
                        "y": f"{5.0 * force} * cos(2 * pi * x[0] / {1.5 * length})",
                    },
                    {"boundary": "left", "x": 3.0 * force},
                    {"boundary": "right", "x": -3.0 * force},
                ],
                "contact": {
                    "boundary": "bottom",
                    "friction": tresca_friction(0.3 * force) if "bound" in friction else friction,
                },
            }
        )
        solution = outcome(scene)
        assert (solution.status, solution.history.linear_solves) == (Status.NOT_HELD, 0)
        assert "nothing presses on the body" in solution.advice


@pytest.mark.one_quick("friction", [coulomb_friction(0.3), tresca_friction(0.3)])
@pytest.mark.parametrize("algorithm", ["ssn", "alm"])
@pytest.mark.parametrize("gap", [(0.01, 0.01), (0.03, -0.01)])
def test_strains_that_press(gap, algorithm, friction):
    """A block with clearance of 0.02 in sum, compressed by 3 % along its foundations: it becomes
    too thick for them.
    """
    sides = zip(("bottom", "top"), gap, strict=True)
    scene = parse_scene(
        {
            "mesh": rectangle_mesh(6, 4, length=3.0, height=2.0),
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": LEFT,
            "traction": {"boundary": "right", "x": -30.0},
            "contact": [
                {"boundary": side, "gap": distance, "friction": friction}
                for side, distance in sides
            ],
            "solver": {"algorithm": algorithm},
        }
    )
    solution = outcome(scene)
    assert solution.converged
    assert solution.certificate.holds
    assert solution.contact.pressure.min() > 0


@pytest.mark.one_quick("algorithm", ["ssn", "alm", "path-following"])
@pytest.mark.parametrize(
    ("pressure", "status"), [(10.0, Status.CONVERGED), (-10.0, Status.NOT_HELD)]
)
def test_held_by_friction_where_a_beam_bends_down(pressure, status, algorithm):
    """Both ends rest on rollers and nothing is pushed along them: friction holds the beam if it
    bends down, not up.
    """
    scene = parse_scene(
        {
            "mesh": rectangle_mesh(8, 2, length=3.0, height=0.5),
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": [fixed("left", "y"), fixed("right", "y")],
            "traction": {"boundary": "top", "pressure": pressure},
            "contact": {"boundary": "bottom", "gap": 1e-3, "friction": coulomb_friction(0.05)},
            "solver": {"algorithm": algorithm},
        }
    )
    solution = outcome(scene)
    assert solution.status is status
    if status is Status.CONVERGED:
        assert solution.certificate.holds
        assert solution.contact.pressure.max() > 0
    else:
        assert "nothing presses on the body" in solution.advice


@pytest.mark.one_quick("gamma", [1e6, 1e8])
def test_cycling(gamma):
    """sigma = 1 / gamma_2 cycles (section 7.1); the advice names the cure, and the cure works."""
    solution = outcome(
        example1(bound=1.5, gamma=gamma, sigma=1 / gamma, patch=PATCH, fallbacks=False)
    )
    assert solution.status is Status.CYCLING
    assert "sigma = 'auto'" in solution.status.advice
    assert (
        outcome(example1(bound=1.5, gamma=gamma, patch=PATCH, fallbacks=False)).status
        is Status.CONVERGED
    )


def test_too_few_iterations():
    """The limit on linear solves is kept to the number."""
    solution = outcome(example1(bound=1.5, patch=PATCH, max_iterations=3, **SMALL))
    assert solution.status is Status.MAX_ITERATIONS
    assert solution.history.linear_solves == 3


def test_gamma_beyond_double_precision():
    """A penalty that drowns the stiffness ends in a name, not in a wrong result."""
    assert outcome(example1(bound=1.5, gamma=1e16, patch=PATCH, **SMALL)).status is Status.ROUND_OFF
