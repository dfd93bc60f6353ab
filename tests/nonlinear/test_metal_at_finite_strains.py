"""Bodies of metal at finite strains: closed forms of bars and blocks, contact, and what is refused."""

import numpy as np
import pytest
from mpi4py import MPI
from support.nonlinear_scenes import block, but_slow, cube, force, material

from signorini_fx import SceneError, solve

YOUNG, POISSON, YIELD, HARDENING = 200.0, 0.3, 0.3, 1.0
METAL = {"strains": "finite", "young": YOUNG, "poisson": POISSON, "yield_stress": YIELD}
METAL = material("j2", **METAL, hardening=HARDENING)
ROUND = METAL | {"hypothesis": "axisymmetric"}
STRETCH = 1.5


def free_bar(stretch):
    """Of a bar that flows while its length becomes ``stretch`` times as large: Kirchhoff's stress
    along it, the stretch across, and the accumulated plastic strain.
    """
    way = np.log(stretch)
    stress = np.sign(way) * (YIELD + HARDENING * abs(way)) / (1 + HARDENING / YOUNG)
    plastic = abs(way) - abs(stress) / YOUNG
    across = np.exp(-POISSON * stress / YOUNG - np.sign(way) * plastic / 2)
    return stress, across, plastic


def drawn(kind, steps, **element):
    """A bar that is drawn to ``STRETCH``, in so many steps."""
    top = {"boundary": "top", "z" if kind == "cube" else "y": f"{STRETCH - 1} * t"}
    further = {"element": element, "load_steps": {"times": [1.0], "steps": steps}}
    if kind == "cube":
        return cube(METAL, top, **further, contact=[])
    held = [{"boundary": "left", "x": 0.0}, {"boundary": "bottom", "y": 0.0}, top]
    return block(ROUND, "0", cells=(2, 2), displacement=held, contact=[], **further)


WAYS = {
    "axisymmetric": ("round", 5, {}),
    "one step": ("round", 1, {}),
    "reduced": ("round", 5, {"volumetric": "reduced"}),
    "degree 2": ("round", 5, {"degree": 2, "volumetric": "auto"}),
    "cube": ("cube", 2, {"volumetric": "auto"}),
}


@pytest.mark.mpi
@pytest.mark.parametrize("way", but_slow(WAYS, "axisymmetric", "cube"))
def test_a_bar_in_tension(way):
    """Stress, width and plastic strain of the closed form at 50 %, in any number of steps."""
    kind, steps, element = WAYS[way]
    solution = solve(drawn(kind, steps, **element), MPI.COMM_WORLD)
    assert solution.converged
    stress, across, plastic = free_bar(STRETCH)
    x = solution.model.space.tabulate_dof_coordinates()
    moved = np.array(solution.displacement.x.array).reshape(-1, solution.model.space.dofmap.bs)
    assert np.abs(moved[:, 0] - (across - 1) * x[:, 0]).max() <= 1e-12
    cauchy = solution.stress.tensor.x.array.reshape(-1, 3, 3)
    along = 2 if kind == "cube" else 1
    wanted = np.zeros((3, 3))
    wanted[along, along] = stress / (STRETCH * across**2)
    assert np.abs(cauchy - wanted).max() <= 1e-9 * stress
    assert np.abs(solution.stress.plastic_strain.x.array - plastic).max() <= 1e-10


def test_upset_without_friction():
    """A cylinder of radius 1 and height 1 under a smooth plate: the force on its face is that of a
    bar that is pressed, which has grown wider; then it comes back with the stiffness at rest.
    """
    path = "0.2 * t if t <= 1 else 0.2 - 0.0001 * (t - 1)"
    steps = {"times": [0.5, 1.0, 2.0]}
    element = {"volumetric": "auto"}
    solution = solve(
        block(ROUND, path, cells=(3, 3), load_steps=steps, element=element), MPI.COMM_SELF
    )
    assert solution.converged
    stresses = [free_bar(high)[0] for high in (0.9, 0.8)]
    stresses.append(stresses[-1] + YOUNG * np.log(0.8001 / 0.8))
    for step, high, stress in zip(solution.steps, (0.9, 0.8, 0.8001), stresses, strict=True):
        assert force(step)[1] == pytest.approx(np.pi * stress / high, rel=1e-8)


def test_what_is_refused():
    """Small strains beside finite ones, with the cure; plane stress and torsion, by name."""
    for change, said in (
        ({"hypothesis": "plane stress"}, "plane stress is not possible yet"),
        ({"hypothesis": "axisymmetric", "torsion": True}, "with torsion is not possible yet"),
        ({"strains": "large"}, "'small' or 'finite'"),
    ):
        with pytest.raises(SceneError, match=said):
            solve(block(METAL | change, "0.1 * t"), MPI.COMM_SELF)
    both = [METAL | {"region": "low"}, METAL | {"region": "high", "strains": "small"}]
    with pytest.raises(SceneError, match=r"material\[1\].*give it strains = 'finite'"):
        solve(block(both, "0.1 * t"), MPI.COMM_SELF)
