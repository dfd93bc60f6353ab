"""Two nonlinear bodies in 3D that slide on each other: closed forms, invariances, limits, and the certificate."""

import numpy as np
import pytest
from mpi4py import MPI
from support.nonlinear_bodies import stress_of_block
from support.sliding_bodies import (
    as_linear_bodies,
    bulge,
    out_of_balance,
    pillow,
    quarter_of_a_bulge,
    rounded,
    stacked,
)

from signorini_fx import Coulomb, Foundation, NonlinearContactProblem

COARSE = {"kind": "tetrahedron", "lower": (8, 6, 1), "upper": (4, 4, 1), "ratio": 10.0}
PRESSED = ((0, 0, -0.05), (0, 0, -0.1))
KINDS = [pytest.param("hexahedron", marks=pytest.mark.slow), pytest.param("tetrahedron", marks=pytest.mark.slow)]


def slid(scene, ways):
    """The forces of a scene after each of some ways."""
    forces = np.array([scene.move(*way) for way in ways])
    assert scene.problem.certificate.holds
    return forces


@pytest.mark.one_quick
@pytest.mark.parametrize(
    ("kind", "slave"),
    [
        ("hexahedron", 0),
        ("tetrahedron", 1),
        pytest.param("hexahedron", 1, marks=pytest.mark.slow),
        pytest.param("tetrahedron", 0, marks=pytest.mark.slow),
    ],
)
def test_patch(kind, slave):
    """Two blocks whose meshes do not match, compressed by two fifths between smooth plates: uniform, in closed form."""
    scene = stacked(kind, slave=slave, smooth=lambda x: np.isclose(x[0], 0.0))
    for depth in (0.1, 0.4):
        scene.move(0.0, 0.0, -2 * depth)
        state = scene.problem.state
        (pair,) = scene.problem.linear.pairs.values()
        into = -pair.coupling.gap
        # The regularised law lets both bodies overlap by a pressure over gamma.
        assert into == pytest.approx(into[0], rel=1e-6)
        assert 0 < into[0] < 1e-4
        assert state.pressure == pytest.approx(-stress_of_block(1 - depth + into[0] / 2, 2), rel=1e-9)
        x = scene.u.function_space.tabulate_dof_coordinates()
        moved = scene.u.x.array.reshape(-1, 3)[:, :2]
        widened = moved[x[:, :2].sum(axis=1).argmax(), 0]
        assert moved == pytest.approx(widened * x[:, :2], abs=1e-9)
        assert scene.problem.iterations <= 5


@pytest.mark.parametrize("kind", KINDS)
def test_frames_do_not_matter(kind):
    """A punch that is pressed and slides, and the same turned as a whole: equal forces; friction is F times them, along
    what slides, and forces and moments of both bodies balance.
    """
    ways = (*PRESSED, (0.15, 0.05, -0.1))
    law = {**COARSE, "kind": kind, "friction": Coulomb(0.3), "algorithm": "alm"}
    scenes = [pillow(angle=angle, **law) for angle in (0.0, 0.7)]
    first, second = (slid(scene, ways) for scene in scenes)
    assert second == pytest.approx(first, abs=1e-9 * np.abs(first).max())
    assert first[-1, :2] @ [3.0, 1.0] > 0.2 * abs(first[-1, 2])
    for scene in scenes:
        assert max(scene.iterations) <= 8
        state = scene.problem.state
        closed = state.in_contact
        assert np.count_nonzero(closed) > 2
        shear = np.linalg.norm(state.shear, axis=1)
        assert shear[closed] == pytest.approx(0.3 * state.pressure[closed], rel=1e-6)
        force, moment = out_of_balance(scene)
        assert force < 1e-13
        assert moment < 1e-13


@pytest.mark.parametrize("kind", KINDS)
def test_on_a_rigid_plane(kind):
    """A block that is 1e5 times as stiff is a rigid plane, of which other code knows: half a per cent while all slides,
    one while frames half-way between flat and round facets make friction of what is pressed.
    """
    forces = []
    for rigid in (False, True):
        friction = {"friction": Coulomb(0.3)}
        scene = rounded(kind, height=0.3, ratio=1e-5, slave=1, algorithm="alm", **friction)
        if rigid:
            plane = {"shape": "plane", "point": (0.0, 0.0, 0.0), "normal": (0.0, 0.0, 1.0)}
            tool = Foundation(scene.sides[1], shape=plane, **friction)
            scene.problem = NonlinearContactProblem(scene.form, scene.u, bcs=scene.bcs, contact=tool, algorithm="alm")
        forces.append(slid(scene, [(0, 0, -0.05), (0, 0, -0.1), (0.05, 0.1, -0.1), (0.1, 0.3, -0.1)]))
    largest = np.abs(forces[1]).max()
    assert forces[0][:2] == pytest.approx(forces[1][:2], abs=0.01 * largest)
    assert forces[0][2:] == pytest.approx(forces[1][2:], abs=0.005 * largest)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["hexahedron", "tetrahedron"])
@pytest.mark.parametrize("slave", [0, 1])
def test_linear_limit(kind, slave):
    """At small loads pairs of linear bodies, on the same mesh: displacements of 1e-4 of the size leave a difference
    of some strains.
    """
    scene = bulge(kind, friction=Coulomb(0.3), slave=slave, algorithm="alm")
    force = scene.move(2e-5, 1e-5, -1e-4)
    linear = as_linear_bodies(scene)
    expected = sum(linear.state.forces)
    assert 0 < np.count_nonzero(linear.state.in_contact) < linear.state.in_contact.size
    assert force == pytest.approx(expected, abs=2e-3 * np.abs(expected).max())
    far = np.abs(linear.u.x.array).max()
    assert scene.u.x.array == pytest.approx(linear.u.x.array, abs=2e-3 * far)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "slave"), [("hexahedron", 0), ("hexahedron", 1), ("tetrahedron", 1)])
def test_hertz(kind, slave):
    """Small pressures are those of Hertz within half of the radius of contact, over which there are five facets, to 5 %
    (with eight to 1.5 %), contact ends where his does, to one facet, and all is as of linear bodies on the same mesh.
    """
    height = 2e-3
    scene = quarter_of_a_bulge(kind, height=height, slave=slave, cells=(14, 10), algorithm="alm")
    force = 4 * np.abs(scene.move(0.0, 0.0, -4e-5)[2])
    assert scene.problem.certificate.holds
    state, linear = scene.problem.state, as_linear_bodies(scene)
    assert 4 * np.abs(sum(linear.state.forces)[2]) == pytest.approx(force, rel=5e-5)
    assert scene.u.x.array == pytest.approx(linear.u.x.array, abs=5e-5 * np.abs(linear.u.x.array).max())
    _, own, of_linear = np.intersect1d(state.boundary.nodes, linear.state.boundary.nodes, return_indices=True)
    assert state.in_contact[own].sum() == state.in_contact.sum() > 30
    assert state.pressure[own] == pytest.approx(linear.state.pressure[of_linear], abs=2e-4 * state.pressure.max())
    modulus, curvature = 100.0 / (1 - 0.3**2) / 2, 2 * height
    a = (3 * force / curvature / 4 / modulus) ** (1 / 3)
    largest = 3 * force / (2 * np.pi * a**2)
    r = np.linalg.norm(state.boundary.x[:, :2], axis=1)
    inner = r < a / 2
    assert np.count_nonzero(inner) > 12
    assert state.pressure[inner] == pytest.approx(largest * np.sqrt(1 - (r[inner] / a) ** 2), abs=0.05 * largest)
    assert not state.in_contact[r > 1.25 * a].any()
    assert state.in_contact[r < 0.75 * a].all()


@pytest.mark.slow
@pytest.mark.mpi
def test_on_ranks():
    """The same on any number of ranks, with stick and slip."""
    forces = [
        slid(pillow(friction=Coulomb(0.3), comm=comm, **COARSE), ((0, 0, -0.1), (0.1, 0.05, -0.1)))
        for comm in (MPI.COMM_WORLD, MPI.COMM_SELF)
    ]
    assert np.abs(forces[0][-1]).min() > 0.01 * np.abs(forces[0][-1]).max()
    assert forces[0] == pytest.approx(forces[1], abs=1e-7 * np.abs(forces[1]).max())


def at_the_rim(**settings):
    """A punch at whose rim a node keeps 3 per cent of its area only where it carries no point, and its way."""
    law = {**COARSE, "lower": (7, 5, 1), "upper": (5, 4, 2), "height": 0.59, "ratio": 3.0, "algorithm": "alm"}
    return pillow(**law, **settings), (0.1388, 0.2671, -0.08315)


@pytest.mark.slow
@pytest.mark.parametrize("slave", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_points_that_come_and_go(slave):
    """Functions at the rim turn evenly into those beside them: there is equilibrium, with hardly another force where
    the way is longer by a thousandth.
    """
    scene, way = at_the_rim(slave=slave)
    forces = slid(scene, [way, (1.001 * way[0], 1.001 * way[1], way[2])])
    assert max(scene.iterations) <= 12
    assert max(out_of_balance(scene)) < 1e-13
    assert forces[1] == pytest.approx(forces[0], abs=0.003 * np.abs(forces).max())
