"""Two nonlinear bodies of revolution that slide on each other: closed forms, limits, invariances, and what the
certificate refuses.
"""

import runpy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI
from scipy.optimize import brentq
from support.nonlinear_bodies import LAME, MU, stress_of_block
from support.sliding_bodies import as_linear_bodies, cylinders, dome, ring_on_cone, roller

from signorini_fx import ConvergenceError, Coulomb, Foundation, NonlinearContactProblem, Status
from signorini_fx.mechanics.obstacles.sliding_sides import SlidingSides
from signorini_fx.mechanics.pairs import sliding_plane
from signorini_fx.mechanics.pairs.pair_side import PairSurface

FRICTION = pytest.mark.parametrize("friction", [None, Coulomb(0.3)], ids=["smooth", "rough"])
SLOW = pytest.mark.slow


def assembled(form):
    """A number of all ranks."""
    form = fem.form(form)
    return form.mesh.comm.allreduce(fem.assemble_scalar(form))


def reaction(scene):
    """The force along the axis that supports exert on the held end, from the residual alone."""
    residual = fem.assemble_vector(fem.form(scene.form)).array.reshape(-1, 2)
    return residual[scene.nodes[0], 1].sum()


@pytest.mark.parametrize(("revolved", "degree"), [(True, 1), (False, 1), pytest.param(True, 2, marks=SLOW)])
def test_lifted_off_the_axis(revolved, degree):
    """Half of a pressed dome is lifted until the facet at the axis is nearly open: the axis, which holds the rays on
    it, takes the moment of what is left, and the load step is no less certified than the pressed one.
    """
    scene = dome(height=0.05, lower=(6, 3), upper=(4, 2), slave=1, revolved=revolved, degree=degree)
    scene.move(0.0, -0.025)
    pressed = scene.problem.state.pressure.max()
    scene.move(0.0, -0.0015 * degree)
    opening = scene.problem.linear.pairs[0].coupling.gap
    assert np.count_nonzero(opening > 1e-3) > opening.size / 2
    assert 0 < scene.problem.state.pressure.max() < 0.2 * pressed
    assert reaction(scene) == pytest.approx(sum(scene.problem.state.forces)[1], rel=1e-6)


@pytest.mark.parametrize("depth", [0.01, pytest.param(0.03, marks=SLOW)])
def test_a_quadratic_node_on_the_axis(depth):
    """It has no share of any ring, and forces on it are not relative to that: its certificate is as that of the node
    beside it.
    """
    scene = dome(height=0.05, lower=(6, 3), upper=(4, 2), degree=2, ratio=5.0)
    force = scene.move(0.0, -depth)
    assert scene.problem.certificate.worst < 1e-6
    assert reaction(scene) == pytest.approx(-force[1], rel=1e-6)


@pytest.mark.parametrize("kind", ["quadrilateral", pytest.param("triangle", marks=SLOW)])
@pytest.mark.parametrize("slave", [0, 1])
@pytest.mark.parametrize("inner", [0.0, pytest.param(0.2, marks=SLOW)])
def test_patch(kind, slave, inner):
    """Two cylinders whose meshes do not match, compressed by two fifths: uniform, in closed form; the tubes as well."""
    scene = cylinders(kind, inner=inner, slave=slave)
    area = np.pi * (1.0 - inner**2)
    for depth in (0.1, 0.4):
        force = scene.move(0.0, -2 * depth)
        assert scene.problem.certificate.holds
        state = scene.problem.state
        (pair,) = scene.problem.linear.pairs.values()
        into = -pair.coupling.gap
        assert into == pytest.approx(into[0], rel=1e-6)
        assert 0 < into[0] < 1e-4
        stress = stress_of_block(1 - depth + into[0] / 2, directions=2)
        assert state.pressure == pytest.approx(-stress, rel=1e-8)
        assert abs(force[1]) == pytest.approx(-stress * area, rel=1e-8)
        x = scene.u.function_space.tabulate_dof_coordinates()[:, :2]
        across = scene.u.x.array.reshape(-1, 2)[:, 0]
        assert across == pytest.approx(across[x[:, 0].argmax()] * x[:, 0], abs=1e-9)


def agrees_with_linear_bodies(scene):
    """Whether displacements and forces are those of the pair of linear bodies on the same mesh, to 1e-6."""
    force = scene.move(1e-8 * (not scene.half), -1e-7)
    linear = as_linear_bodies(scene)
    expected = sum(linear.state.forces)
    assert np.count_nonzero(linear.state.in_contact) > 3
    assert force == pytest.approx(expected, abs=1e-6 * np.abs(expected).max())
    far = np.abs(linear.u.x.array).max()
    assert scene.u.x.array == pytest.approx(linear.u.x.array, abs=1e-6 * far)
    return linear


@pytest.mark.parametrize("friction", [pytest.param(None, marks=SLOW), Coulomb(0.3)], ids=["smooth", "rough"])
@pytest.mark.parametrize("slave", [0, 1])
def test_linear_limit(friction, slave):
    """A paraboloid on a cylinder."""
    linear = agrees_with_linear_bodies(dome(friction=friction, slave=slave, algorithm="alm"))
    if friction is not None:
        assert np.abs(linear.state.shear).max() > 0.01 * linear.state.pressure.max()


def test_linear_limit_of_half_a_scene():
    """In 2D the halves of both bodies: at points in 2D of symmetry friction has nothing to hold."""
    scene = dome(friction=Coulomb(0.3), revolved=False, algorithm="alm")
    agrees_with_linear_bodies(scene)
    state = scene.problem.state
    on_plane = np.isclose(state.boundary.x[:, 0], 0.0)
    assert state.pressure[on_plane] > 0.5 * state.pressure.max()
    assert state.shear[on_plane] == pytest.approx(0.0, abs=1e-12 * state.pressure.max())


@pytest.mark.slow
def test_plane_limit():
    """At radii of 1e6 the forces are those of the plane times 2 pi r, after pressing and sliding with friction."""
    forces = []
    for far, revolved in ((0.0, False), (1e6, True)):
        scene = roller(ratio=10.0, cells=(16, 4), around=10, far=far, revolved=revolved, friction=Coulomb(0.3))
        for way in ((0.0, -0.1), (0.2, -0.1)):
            force = scene.move(*way)
        assert scene.problem.certificate.holds
        forces.append(force / (2 * np.pi * far if revolved else 1.0))
    assert np.abs(forces[0]).min() > 1.0
    assert forces[1] == pytest.approx(forces[0], abs=1e-5 * np.abs(forces[0]).max())


def hoop_force(scene, body_ratio):
    """2 pi N of a thin ring that is stretched along itself alone, from its mean stretch and its area."""
    mesh, u = scene.mesh, scene.u
    radius = ufl.SpatialCoordinate(mesh)[0]
    ring = scene.of_body
    area = assembled(ring * ufl.dx)
    stretch = 1 + assembled(ring * u[0] / radius * ufl.dx) / area
    free = brentq(lambda width: MU * (width**2 - 1) + LAME * np.log(width**2 * stretch), 0.3, 3.0)
    stress = (MU * (stretch**2 - 1) + LAME * np.log(stretch * free**2)) / stretch
    return 2 * np.pi * area * body_ratio * stress


@pytest.mark.slow
@FRICTION
def test_ring_over_a_cone(friction):
    """A soft thin ring that is driven down a cone, over ten facets, widens by two fifths: its force along the axis is
    that of the slope and the angle of friction, whatever the number of steps is.
    """
    angle = np.pi / 4 + np.arctan(0.0 if friction is None else 0.3)
    ends = []
    for steps in (4, 8):
        scene = ring_on_cone(ratio=0.02, slave=1, size=0.1, cells=(48, 4), friction=friction)
        for way in -0.4 * np.arange(1, steps + 1) / steps:
            force = scene.move(0.0, way)
        assert scene.problem.certificate.holds
        assert max(scene.iterations) <= 7
        ends.append(force)
    assert force[1] / force[0] == pytest.approx(np.tan(angle), rel=0.01)
    assert np.abs(scene.u.x.array).max() > 0.35
    assert ends[1] == pytest.approx(ends[0], rel=1e-5)


@pytest.mark.slow
def test_hoop_force():
    """The radial force of rings that are stretched by two fifths tends to that of their hoop stress as they are thin:
    what is left falls with their size, and the straight line through two sizes ends there.
    """
    sizes, shares = np.array([0.1, 0.05]), []
    for size in sizes:
        scene = ring_on_cone(ratio=0.02, slave=1, size=size, cells=(round(4.8 / size), 4))
        for way in -0.1 * np.arange(1, 5):
            force = scene.move(0.0, way)
        shares.append(force[0] / hoop_force(scene, 0.02))
    assert shares[0] == pytest.approx(1.0, abs=0.06)
    assert 2 * shares[1] - shares[0] == pytest.approx(1.0, abs=5e-3)


@pytest.mark.slow
def test_forces_balance():
    """Along the axis the force on the ring is that of the support of the cone, from the residual alone; upside down all
    forces are mirror images, and in millimetres the same.
    """
    ways = (-0.1, -0.2)
    law = {"ratio": 0.02, "slave": 1, "friction": Coulomb(0.3), "cells": (24, 3), "around": 12}
    forces = []
    for up, scale in ((1.0, 1.0), (-1.0, 1.0), (1.0, 1e-3)):
        scene = ring_on_cone(up=up, scale=scale, **law)
        for way in ways:
            force = scene.move(0.0, way * up * scale)
        assert scene.problem.certificate.holds
        largest = np.abs(force).max()
        assert largest > 0
        assert reaction(scene) == pytest.approx(force[1], abs=1e-8 * largest)
        forces.append(force * [1.0, up] / scale**2)
    assert forces[1] == pytest.approx(forces[0], rel=1e-8)
    assert forces[2] == pytest.approx(forces[0], rel=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("slave", [0, 1])
def test_hertz(slave):
    """Small pressures are those of Hertz: on the axis and within half of the radius of contact to 3 %."""
    height = 0.02
    scene = dome(height=height, lower=(44, 16), upper=(40, 16), power=2.5, slave=slave)
    force = abs(scene.move(0.0, -1e-4)[1])
    state = scene.problem.state
    modulus, curvature = 100.0 / (1 - 0.3**2) / 2, 2 * height
    a = (3 * force / curvature / 4 / modulus) ** (1 / 3)
    largest = 3 * force / (2 * np.pi * a**2)
    r = state.boundary.x[:, 0]
    inner = r < a / 2
    assert np.count_nonzero(inner) > 4
    assert state.pressure[inner] == pytest.approx(largest * np.sqrt(1 - (r[inner] / a) ** 2), abs=0.03 * largest)
    assert not state.in_contact[r > 1.15 * a].any()


@pytest.mark.slow
@pytest.mark.mpi
def test_seal_on_a_shaft():
    """The demo: on the taper the slope and friction hold the ring back, on the cylinder friction alone."""
    found = runpy.run_path(str(Path(__file__).parents[2] / "demos" / "forms" / "seal_on_a_shaft.py"))
    assert found["problem"].certificate.holds
    way, radial, axial = np.array(found["forces"]).T
    taper, cylinder = (way > 0.85) & (way < 1.25), way > 1.74
    assert np.count_nonzero(taper) > 3
    assert np.count_nonzero(cylinder) > 0
    assert axial[taper] == pytest.approx(radial[taper] * np.tan(2 * np.arctan(0.3)), rel=0.01)
    assert axial[cylinder] == pytest.approx(0.3 * radial[cylinder], rel=0.02)


def random_rings(seed, degree=1):
    """The force on a random ring that a rigid cone of facets widens, and that of a shape in its place, which other code
    meets at the nodes; and how far the ring has come, in facets of the cone.
    """
    rng = np.random.default_rng(seed)
    kind, up, friction = rng.choice(["quadrilateral", "triangle"]), rng.choice([-1.0, 1.0]), rng.uniform(0.0, 0.35)
    slope, size, scale = rng.uniform(0.7, 2.0), rng.uniform(0.1, 0.2), 10.0 ** rng.uniform(-3.0, 3.0)
    cells, around, steps = int(rng.integers(24, 60)), int(rng.integers(12, 24)), int(rng.integers(2, 5))
    depth = rng.uniform(0.1, 0.3)
    law = Coulomb(friction) if rng.random() < 0.7 else None
    forces = []
    for shaped in (False, True):
        scene = ring_on_cone(kind, (cells, 1), around, size, slope, up, scale, slave=1, friction=law, degree=degree)
        space = scene.u.function_space
        scene.mesh.topology.create_connectivity(2, 2)
        of_cone = np.flatnonzero(scene.of_body.x.array == 0)
        rigid = fem.dirichletbc(np.zeros(2), fem.locate_dofs_topological(space, 2, of_cone.astype(np.int32)), space)
        contact = scene.pair
        if shaped:
            plane = {"shape": "plane", "point": (0.0, 0.0), "normal": (slope, up)}
            contact = Foundation(scene.sides[1], shape=plane, friction=law, measure=scene.pair.measure)
        problem = NonlinearContactProblem(scene.form, scene.u, bcs=[*scene.bcs, rigid], contact=contact)
        for share in np.arange(1, steps + 1) / steps:
            scene.driven.value = -share * depth * up * scale
            problem.solve()
            problem.advance()
        assert problem.certificate.holds
        forces.append(sum(problem.state.forces))
    way = np.linalg.norm([np.abs(scene.u.x.array[::2]).max(), depth * scale]) / scale
    return forces[0], forces[1], way * cells / 1.5 / np.hypot(1.0, slope)


@pytest.mark.slow
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("seed", range(2))
def test_random_rings(seed, degree):
    """Half a per cent, which is what mean normals of both sides are off those of the cone by."""
    force, expected, way = random_rings(seed, degree)
    assert way > 2.0
    assert force == pytest.approx(expected, abs=5e-3 * np.abs(expected).max())


@pytest.mark.long
def test_forty_random_rings():
    """None is farther off."""
    for seed in range(40):
        force, expected, _ = random_rings(seed, 1 + seed % 2)
        assert force == pytest.approx(expected, abs=5e-3 * np.abs(expected).max()), seed


@pytest.mark.slow
@pytest.mark.mpi
def test_on_ranks():
    """The same on any number of ranks."""
    forces = []
    for comm in (MPI.COMM_WORLD, MPI.COMM_SELF):
        scene = ring_on_cone(ratio=0.02, slave=1, cells=(24, 3), around=8, friction=Coulomb(0.3), comm=comm)
        for way in (-0.1, -0.2):
            force = scene.move(0.0, way)
        assert scene.problem.certificate.holds
        forces.append(force)
    assert np.abs(forces[0]).min() > 0.01
    assert forces[0] == pytest.approx(forces[1], rel=1e-8)


def forgotten(monkeypatch):
    """Points have lengths, not areas of rings."""
    monkeypatch.setattr(PairSurface, "measured", lambda self, facets, at, weight: weight)


def displaced_radius(monkeypatch):
    """Rings are as large as they have become."""
    displaced = PairSurface.displaced

    def moved(self, displacement):
        side = displaced(self, displacement)
        if self.measure is None:
            return side
        return replace(side, measure=self.measure * side.x[:, 0] / side.undeformed[:, 0])

    monkeypatch.setattr(PairSurface, "displaced", moved)


def other_side(monkeypatch):
    """Rings of one radius for all points, that of the middle of the side."""
    of = SlidingSides.of.__func__

    def even(cls, *args, **settings):
        sides = of(cls, *args, **settings)
        surface = sides.slave.surface
        level = replace(surface, measure=np.full_like(surface.measure, surface.measure.mean()))
        return replace(sides, slave=replace(sides.slave, surface=level))

    monkeypatch.setattr(SlidingSides, "of", classmethod(even))


def turned_back(monkeypatch):
    """Normals turn the wrong way round."""
    turned = sliding_plane._turned_by_facets
    monkeypatch.setattr(sliding_plane, "_turned_by_facets", lambda side: -turned(side))


@pytest.mark.parametrize(
    "spoil", [forgotten, *(pytest.param(way, marks=SLOW) for way in (displaced_radius, other_side, turned_back))]
)
def test_the_certificate_sees_what_is_wrong(monkeypatch, spoil):
    """Weights and turning normals of the solver that are not those of rings."""
    spoil(monkeypatch)
    scene = ring_on_cone(ratio=0.02, slave=1, cells=(24, 3), around=8, friction=Coulomb(0.3))
    with pytest.raises(ConvergenceError, match="certificate does not hold") as refused:
        scene.move(0.0, -0.1)
    assert refused.value.solution.status is Status.NOT_CERTIFIED
