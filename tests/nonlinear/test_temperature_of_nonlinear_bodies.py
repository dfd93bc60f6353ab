"""Nonlinear bodies that expand as they become warmer: closed forms, CalculiX, and what is
refused.
"""

import numpy as np
import pytest
from scene_tables import box_mesh, fixed
from scenes import alone
from scipy.optimize import brentq
from support.nonlinear_scenes import LAWS, block, but_slow, cube, grown_energy, material, slope

from signorini_fx.scenes.reading import parse_scene

IN_SPACE = [name for name in LAWS if name != "ogden"]
EXPANSION = 1e-2


def warmed_cube(law, change, *further_supports, **further):
    """A cube on rollers without anything else."""
    return cube(
        law | {"expansion": EXPANSION}, *further_supports, temperature={"change": change}, **further
    )


def stresses(solution):
    """The Cauchy stress at the points of quadrature at the ends of load steps."""
    return [solution.at(step).stress.at_points.stress for step in solution.steps]


@pytest.mark.one_quick("name", but_slow(IN_SPACE, "neo-hooke", "j2"))
@pytest.mark.parametrize("change", [30.0, -20.0])
def test_free_expansion(name, change):
    """A cube becomes larger by the expansion, far from small, and no stress arises."""
    solution = alone(warmed_cube(material(name), change, solver={"largest_deformation": 1.0}))
    assert solution.converged
    x = solution.model.space.tabulate_dof_coordinates()
    expected = EXPANSION * change * x
    assert np.abs(solution.displacement.x.array.reshape(-1, 3) - expected).max() < 1e-13
    assert np.abs(stresses(solution)[-1]).max() < 1e-11 * 100.0


def test_a_free_body_does_not_turn_over():
    """In the plane, colder by 70 and held by rollers alone, it becomes smaller in any number of
    steps: in one step Newton's method ends at the body that has turned by 180 degrees, which has
    no stress, either.
    """
    law = material("j2, finite") | {"expansion": EXPANSION}
    free = {"contact": [], "temperature": {"change": -70.0}}
    solution = alone(block(law, "0", cells=(2, 2), solver={"largest_deformation": 1.0}, **free))
    assert solution.converged
    x = solution.model.space.tabulate_dof_coordinates()[:, :2]
    # The thickness stays: strains, logarithms, across it are Poisson's share of that along it.
    expected = (0.3 ** (1 + law["poisson"]) - 1) * x
    assert np.abs(solution.displacement.x.array.reshape(-1, 2) - expected).max() < 1e-12


def held_bar(name, expansion):
    """The force per undeformed area along a bar of fixed length that may become thicker, and its
    stretch across.

    Energies per undeformed volume are (1 + s)^3 W(stretches / (1 + s)); this is minimal across the
    bar, and its derivative by the stretch along it is the force.
    """
    stored, grown = grown_energy(name, expansion), 1 + expansion
    across = brentq(
        lambda b: slope(lambda a: stored(1.0, a), b), 0.6 * grown, 1.8 * grown, xtol=1e-14
    )
    return slope(lambda along: stored(along, across), 1.0), across


@pytest.mark.one_quick("name", but_slow([name for name in IN_SPACE if name != "j2"], "neo-hooke"))
@pytest.mark.parametrize("volumetric", ["full", "reduced"])
def test_a_bar_that_is_held(name, volumetric):
    """It presses on what holds its ends, in two steps of which the second cools it."""
    if (name, volumetric) == ("saint-venant-kirchhoff", "reduced"):
        pytest.skip("it has no energy of the volume alone")
    end = fixed("right", "x")
    scene = warmed_cube(
        material(name),
        "25 * t if t <= 1 else 25 - 40 * (t - 1)",
        end,
        load_steps={"times": [1.0, 2.0], "steps": 4},
        element={"volumetric": volumetric},
    )
    solution = alone(scene)
    x = solution.model.space.tabulate_dof_coordinates()
    changes, tried = {1.0: 25.0, 2.0: -15.0}, 0  # other steps are halves of these
    for step, cauchy in zip(solution.steps, stresses(solution), strict=True):
        if step.time not in changes:
            continue
        nominal, across = held_bar(name, EXPANSION * changes[step.time])
        moved = step.displacement.x.array.reshape(-1, 3)[:, 1:]
        assert np.abs(moved - (across - 1) * x[:, 1:]).max() < 1e-7
        assert cauchy[..., 0, 0] == pytest.approx(nominal / across**2, rel=1e-6)
        cauchy[..., 0, 0] = 0.0
        assert np.abs(cauchy).max() < 1e-8 * abs(nominal)
        tried += 1
    assert tried == 2


def test_a_bar_that_yields():
    """In one direction: the yield stress is reached, hardens, and leaves tension as the bar is cold
    again.
    """
    young, first, slope = 100.0, 1.0, 20.0
    law = {"law": "j2", "young": young, "poisson": 0.3, "yield_stress": first, "hardening": slope}
    times = {"times": [0.5, 1.0, 2.0]}
    solution = alone(warmed_cube(law, "4 * min(t, 2 - t)", fixed("right", "x"), load_steps=times))
    expansions = EXPANSION * np.array([2.0, 4.0])
    plastic = (young * expansions - first) / (young + slope)
    back = (young * plastic[-1] - first - slope * plastic[-1]) / (young + slope)
    assert back > 0  # it yields in tension, too
    expected = [*(-young * (expansions - plastic)), young * (plastic[-1] - back)]
    for stress, wanted in zip(stresses(solution), expected, strict=True):
        assert stress[..., 0, 0] == pytest.approx(wanted, rel=1e-9)


def between_walls(law, change, **further):
    """A bar whose ends are held in all directions."""
    size = {
        "length": 2.0,
        "width": 1.0,
        "height": 1.0,
        "nx": 4,
        "ny": 2,
        "nz": 2,
        "cell": "hexahedron",
    }
    scene = {
        "mesh": box_mesh(**size),
        "material": law | {"expansion": EXPANSION},
        "element": {"volumetric": "full"},
        "temperature": {"change": change},
        "displacement": [fixed(side, "xyz") for side in ("left", "right")],
    }
    return alone(parse_scene(scene | further))


def at_middle(solution, step):
    """The displacement of the node in the middle of the top and back edge."""
    x = solution.model.space.tabulate_dof_coordinates()
    return step.displacement.x.array.reshape(-1, 3)[np.argmin(np.abs(x - 1.0).sum(axis=1))]


def test_metal_of_calculix():
    """Displacements of CalculiX 2.20 with *PLASTIC, *EXPANSION and *TEMPERATURE, which differ from
    node to node, in two load steps in which more and more of the bar yields.
    """
    law = {
        "law": "j2",
        "young": 100.0,
        "poisson": 0.3,
        "yield_stress": 0.5,
        "hardening": [[0.1, 1.5]],
    }
    solution = between_walls(law, "0.5 * (1 + x[0]) * t", load_steps={"times": [0.5, 1.0]})
    expected = [(-1.860600e-3, 3.728933e-3, 3.728933e-3), (-4.114901e-3, 8.300234e-3, 8.300234e-3)]
    for step, moved in zip(solution.steps, expected, strict=True):
        assert at_middle(solution, step) == pytest.approx(np.array(moved), abs=2e-9)
