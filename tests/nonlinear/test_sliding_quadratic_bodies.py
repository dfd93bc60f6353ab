"""Two nonlinear bodies of degree 2 that slide on each other: what bodies of degree 1 are tested by, and accuracy."""

import numpy as np
import pytest
from dolfinx import fem, la
from mpi4py import MPI
from support.nonlinear_bodies import stress_of_block
from support.sliding_bodies import as_linear_bodies, blocks, bump, cylinders, dome, out_of_balance, ring_on_cone, roller

from signorini_fx import ConvergenceError, Coulomb, Status, Tresca
from signorini_fx.forms.nonlinear.moving_pairs import MovingPair
from signorini_fx.mechanics.pairs import sliding_plane
from signorini_fx.mechanics.pairs.pair_side import Lagrange, PairSurface


def smooth_blocks(kind, slave):
    """As high and wide as each other, between smooth plates."""
    middle = {"smooth": lambda x: np.isclose(x[0], 0.0)}
    return blocks(kind, lower=(5, 3), upper=(3, 2), width=1.0, slave=slave, degree=2, **middle)


@pytest.mark.parametrize("slave", [0, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", [pytest.param("quadrilateral", marks=pytest.mark.slow), "triangle"])
@pytest.mark.parametrize("revolved", [False, True])
def test_patch(revolved, kind, slave):
    """Blocks and cylinders whose meshes do not match, compressed by three tenths: uniform, in closed form."""
    scene = cylinders(kind, slave=slave, degree=2) if revolved else smooth_blocks(kind, slave)
    for depth in (0.1, 0.3):
        scene.move(0.0, -2 * depth)
        assert scene.problem.certificate.holds
        (pair,) = scene.problem.linear.pairs.values()
        into = -pair.coupling.gap
        assert into == pytest.approx(into[0], rel=1e-6)
        assert 0 < into[0] < 1e-4
        stress = stress_of_block(1 - depth + into[0] / 2, directions=1 + revolved)
        assert scene.problem.state.pressure == pytest.approx(-stress, rel=1e-8)
        x = scene.u.function_space.tabulate_dof_coordinates()[:, :2]
        across = scene.u.x.array.reshape(-1, 2)[:, 0]
        assert across == pytest.approx(across[x[:, 0].argmax()] * x[:, 0], abs=1e-8)


@pytest.mark.parametrize("scene_of", [bump, pytest.param(dome, marks=pytest.mark.slow)])
def test_linear_limit(scene_of):
    """At small loads pairs of linear bodies of degree 2, with friction, in 2D and of revolution."""
    scene = scene_of(height=2e-7, lower=(12, 4), upper=(9, 3), friction=Coulomb(0.3), algorithm="alm", degree=2)
    force = scene.move(0.0, -1e-7)
    linear = as_linear_bodies(scene)
    expected = sum(linear.state.forces)
    assert np.count_nonzero(linear.state.in_contact) >= 5
    assert force == pytest.approx(expected, abs=1e-6 * np.abs(expected).max())
    far = np.abs(linear.u.x.array).max()
    assert scene.u.x.array == pytest.approx(linear.u.x.array, abs=1e-6 * far)


@pytest.mark.slow
def test_frames_do_not_matter():
    """A roller that is pressed and slides, and the same turned as a whole: equal forces; forces and moments of both
    bodies balance.
    """
    law = {"cells": (12, 3), "around": 8, "ratio": 10.0, "friction": Coulomb(0.3), "degree": 2, "algorithm": "alm"}
    scenes = [roller(angle=angle, **law) for angle in (0.0, 0.7)]
    forces = np.array([[scene.move(*way) for way in ((0.0, -0.1), (0.2, -0.1))] for scene in scenes])
    assert forces[1] == pytest.approx(forces[0], abs=1e-8 * np.abs(forces).max())
    for scene in scenes:
        assert max(scene.iterations) <= 8
        assert scene.problem.certificate.holds
        force, moment = out_of_balance(scene)
        assert force < 1e-13
        assert moment < 1e-12


@pytest.mark.slow
def test_over_facets():
    """Over three facets of a block, in three and in five steps: the same force; without friction hardly any of it is
    along the block, and triangles and quadrilaterals have the same to a fifth of a per cent.
    """
    ends = []
    for kind, steps in (("quadrilateral", 3), ("quadrilateral", 5), ("triangle", 3)):
        scene = roller(kind, ratio=10.0, cells=(28, 7), around=14, degree=2)
        ways = [(0, -0.1), (0, -0.2), *((3 / 7 * share, -0.2) for share in np.arange(1, steps + 1) / steps)]
        force = [scene.move(*way) for way in ways][-1]
        assert scene.problem.certificate.holds
        ends.append(force)
    largest = abs(ends[0][1])
    assert ends[1] == pytest.approx(ends[0], abs=1e-6 * largest)
    assert ends[2] == pytest.approx(ends[0], abs=2e-3 * largest)
    assert abs(ends[0][0]) < 3e-3 * largest


@pytest.mark.slow
@pytest.mark.parametrize("friction", [None, Coulomb(0.3)], ids=["smooth", "rough"])
def test_ring_over_a_cone(friction):
    """Of revolution, over five facets: the force along the axis is that of the slope and the angle of friction."""
    angle = np.pi / 4 + np.arctan(0.0 if friction is None else 0.3)
    scene = ring_on_cone(ratio=0.02, slave=1, size=0.1, cells=(24, 2), friction=friction, degree=2)
    for way in -0.1 * np.arange(1, 5):
        force = scene.move(0.0, way)
    assert scene.problem.certificate.holds
    assert force[1] / force[0] == pytest.approx(np.tan(angle), rel=0.005)


@pytest.mark.one_quick
@pytest.mark.mpi
@pytest.mark.parametrize("revolved", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_on_ranks(revolved):
    """The same on any number of ranks."""
    forces = []
    for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        more = {"friction": Coulomb(0.3), "degree": 2, "comm": comm}
        if revolved:
            scene = ring_on_cone(ratio=0.02, slave=1, cells=(16, 2), around=6, **more)
            ways = (0.0, -0.1), (0.0, -0.2)
        else:
            scene = roller(ratio=10.0, cells=(8, 2), around=6, **more)
            ways = (0.0, -0.1), (0.2, -0.1)
        for way in ways:
            force = scene.move(*way)
        assert scene.problem.certificate.holds
        forces.append(force)
    assert np.abs(forces[0]).min() > 0.01 * np.abs(forces[0]).max()
    assert forces[0] == pytest.approx(forces[1], rel=1e-7)


@pytest.mark.slow
@pytest.mark.mpi
@pytest.mark.parametrize("kind", ["quadrilateral", "triangle"])
@pytest.mark.parametrize("slave", [0, 1])
@pytest.mark.parametrize(
    "friction",
    [None, Coulomb(0.3), Tresca(0.5), Coulomb(0.0, cohesion=0.5)],
    ids=["smooth", "rough", "tresca", "cohesion"],
)
def test_where_driven_nodes_end(friction, slave, kind):
    """Supports drive the outer nodes of a roller up to the middle of contact, on the first side or on the second: the
    supports of the block take what contact says, on any number of ranks.
    """
    forces = []
    for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        settings = {"cells": (16, 4), "around": 8, "ratio": 3.0, "degree": 2, "algorithm": "alm", "comm": comm}
        scene = roller(kind, half_driven=True, friction=friction, slave=slave, **settings)
        for way in ((0.0, -0.05), (0.0, -0.1), (0.05, -0.1), (0.15, -0.1)):
            force = scene.move(*way)
        assert scene.problem.certificate.holds
        size = np.abs(force).max()
        assert size > 1.0
        residual = fem.assemble_vector(fem.form(scene.form))
        residual.scatter_reverse(la.InsertMode.add)
        below = scene.nodes[0][scene.nodes[0] < scene.u.function_space.dofmap.index_map.size_local]
        reaction = scene.mesh.comm.allreduce(residual.array.reshape(-1, 2)[below].sum(axis=0))
        assert reaction == pytest.approx([-1.0, 1.0][slave] * force, abs=1e-7 * size)
        forces.append(force)
    assert forces[0] == pytest.approx(forces[1], abs=1e-7 * np.abs(forces[1]).max())


def test_a_body_inside_another_one():
    """It is seen by the outlines of cells with nodes between their vertices."""
    small = roller(radius=0.1, gap=0.05, cells=(16, 4), around=4, ratio=10.0, reach=0.05, degree=2)
    with pytest.raises(ConvergenceError, match=r"bodies inside each other \(contact\[0\]: "):
        small.move(0.0, -0.6)
    assert small.problem.status is Status.PASSED


def straight(monkeypatch):
    """The nodes between are where the chord is."""
    displaced = PairSurface.displaced

    def moved(self, displacement):
        places = np.array(displacement)
        first, last, between = self.nodes.T
        places[between] = (places[first] + places[last]) / 2
        return displaced(self, places)

    monkeypatch.setattr(PairSurface, "displaced", moved)


def turned_back(monkeypatch):
    """Normals turn the wrong way round."""
    turned = sliding_plane._turned_by_facets
    monkeypatch.setattr(sliding_plane, "_turned_by_facets", lambda side: -turned(side))


def hats(monkeypatch):
    """Pressures have the functions of the displacement, not their duals."""
    monkeypatch.setattr(
        "signorini_fx.mechanics.pairs.mortar_coupling.dual_coefficients",
        lambda side, overlap: np.tile(np.eye(3), (len(side.nodes), 1, 1)),
    )


@pytest.mark.parametrize(
    "spoil", [straight, *(pytest.param(way, marks=pytest.mark.slow) for way in (turned_back, hats))]
)
def test_the_certificate_sees_what_is_wrong(monkeypatch, spoil):
    """Facets, turning normals and functions of the solver that are not those of curved facets."""
    spoil(monkeypatch)
    scene = roller(ratio=10.0, cells=(8, 2), around=6, friction=Coulomb(0.3), degree=2)
    with pytest.raises(ConvergenceError, match="certificate does not hold"):
        scene.move(0.0, -0.1)
    assert scene.problem.status is Status.NOT_CERTIFIED


@pytest.mark.slow
def test_curvature_of_facets_is_in_the_tangent(monkeypatch):
    """Without it, and without what is left out of it along increments, the same solution takes more iterations."""
    iterations = []
    monkeypatch.setattr(MovingPair, "moves_little", lambda self, increment: False)
    for none in (False, True):
        if none:
            monkeypatch.setattr(Lagrange, "curvatures", property(lambda self: np.zeros(len(self.places))))
        scene = roller(ratio=10.0, cells=(8, 2), around=6, degree=2)
        force = [scene.move(0.0, -0.1), scene.move(0.0, -0.2)][-1]
        iterations.append((scene.iterations[-1], force))
    assert iterations[1][1] == pytest.approx(iterations[0][1], rel=1e-6)
    assert iterations[1][0] > iterations[0][0]
