"""Two nonlinear bodies whose points keep their partners: invariances, limits, ties, stability and the certificate."""

import re
from dataclasses import replace

import numpy as np
import pytest
from dolfinx import fem
from mpi4py import MPI
from support.sliding_bodies import blocks, stacked, turn_of
from two_bodies import assembled, facets, facets_of_cells, grid

from signorini_fx import Coulomb, FormError, Foundation, NonlinearContactProblem, Pair
from signorini_fx.forms.nonlinear.moving_pairs import turned_forces

KEPT = {"pair": {"sliding": False}}


def turned_as_a_whole(scene, way, angle, steps=4):
    """Both ends of a scene moved, the second one pressed by a way and both turned by an angle; the force on the slave
    in axes that turn with them.
    """
    space, dim = scene.u.function_space, len(way)
    values = [fem.Function(space), fem.Function(space)]
    bcs = [fem.dirichletbc(value, nodes) for value, nodes in zip(values, scene.nodes, strict=True)]
    problem = NonlinearContactProblem(scene.form, scene.u, bcs=bcs, contact=scene.pair)
    x = space.tabulate_dof_coordinates()[:, :dim]

    def apply(load):
        turn = turn_of(load * angle, dim)
        for value, press in zip(values, (0.0, load), strict=True):
            value.x.array[:] = ((x + press * np.array(way)) @ turn.T - x).ravel()

    problem.ramp(apply, first=1 / steps, largest=1 / steps)
    assert problem.certificate.holds
    return turn_of(angle, dim).T @ sum(problem.state.forces), problem


@pytest.mark.one_quick
@pytest.mark.parametrize(
    ("make", "way"),
    [
        (lambda: blocks(lower=(6, 3), upper=(3, 2), **KEPT), (0.0, -0.1)),
        (lambda: blocks(lower=(4, 2), upper=(3, 2), degree=2, slave=1, **KEPT), (0.0, -0.1)),
        pytest.param(
            lambda: stacked("hexahedron", lower=(2, 2, 1), upper=(1, 1, 1), degree=2, **KEPT),
            (0.0, 0.0, -0.1),
            marks=pytest.mark.slow,
        ),
    ],
    ids=["plane", "quadratic", "space"],
)
def test_joint_rotations_do_not_matter(make, way):
    """Blocks that are pressed, and pressed and turned by half a right angle together: the same force, turned, to what
    Newton's method leaves.
    """
    still, _ = turned_as_a_whole(make(), way, 0.0)
    turned, problem = turned_as_a_whole(make(), way, np.pi / 4)
    assert np.linalg.norm(still) > 0.01
    assert turned == pytest.approx(still, abs=3e-6 * np.linalg.norm(still))
    assert not problem.linear.pairs  # none slides


@pytest.mark.one_quick
@pytest.mark.parametrize("facets", [0.2, 0.9])
def test_sides_that_slide_too_far_are_told(facets):
    """A warning says how many facets points have moved along the side whose partners they keep."""
    scene = blocks(lower=(6, 3), upper=(3, 2), **KEPT)
    x = scene.u.function_space.mesh.geometry.x[:, 0]
    size = float(np.ptp(x[np.abs(scene.u.function_space.mesh.geometry.x[:, 1]) < 1e-9])) / 6
    scene.move(0.0, -0.01)
    scene.move(facets * size, -0.01)
    told = [finding for finding in scene.problem.findings if finding.path == "contact[0].sliding"]
    assert len(told) == (facets > 0.5)
    if told:
        moved = float(re.search(r"side, ([\d.]+) facets", told[0].message)[1])
        assert moved == pytest.approx(facets, rel=0.15)


@pytest.mark.slow
def test_ties():
    """A beam of two halves that are tied, bent to a right angle: the same as of one piece."""
    ends = [lambda x: np.isclose(x[0], 0.0), lambda x: np.isclose(x[0], 4.0)]
    pieces = [grid("quadrilateral", (4, 2), [2.0 * k, 0.0], [2.0 * k + 2, 0.5]) for k in (0, 1)]
    middle = [lambda x: np.isclose(x[0], 2.0)] * 2
    scene_of_two = stacked_along(pieces, middle, ends)
    whole = grid("quadrilateral", (8, 2), [0.0, 0.0], [4.0, 0.5])
    mesh = assembled("quadrilateral", whole)
    below = facets(mesh, lambda x: np.isclose(x[1], 0.0))
    far = Foundation(below, gap=100.0)
    alone = bent(mesh, far, ends)
    tied = bent(scene_of_two[0], Pair(*scene_of_two[1], bonded=True, sliding=False), ends)
    assert np.abs(alone[1]).max() > 1.5
    for place, way in zip(*tied, strict=True):
        same = np.linalg.norm(alone[0] - place, axis=1).argmin()
        assert way == pytest.approx(alone[1][same], abs=1e-7)


def stacked_along(pieces, touching, held):
    """The mesh of two pieces and their sides."""
    count = len(pieces[0][0])
    mesh = assembled("quadrilateral", *pieces)
    numbers = np.arange(count), np.arange(count, count + len(pieces[1][0]))
    sides = [facets_of_cells(mesh, marker, cells) for marker, cells in zip(touching, numbers, strict=True)]
    return mesh, sides


def bent(mesh, contact, ends):
    """Places of nodes and their displacements, one end held and the other one turned by a right angle."""
    import ufl
    from support.nonlinear_bodies import neo_hooke

    space = fem.functionspace(mesh, ("Lagrange", 1, (2,)))
    u = fem.Function(space)
    energy = neo_hooke(u, None) * ufl.dx(metadata={"quadrature_degree": 2})
    form = ufl.derivative(energy, u, ufl.TestFunction(space))
    nodes = [fem.locate_dofs_topological(space, 1, facets(mesh, marker)) for marker in ends]
    turned = fem.Function(space)
    x = space.tabulate_dof_coordinates()[:, :2]
    bcs = [fem.dirichletbc(np.zeros(2), nodes[0], space), fem.dirichletbc(turned, nodes[1])]
    problem = NonlinearContactProblem(form, u, bcs=bcs, contact=contact, algorithm="alm")

    def apply(load):
        angle = load * np.pi / 2
        centre = np.array([2.0, 0.25])
        middle = np.array([4.0, 0.25]) - centre
        along = 2.0 * np.array([np.sinc(angle / np.pi), 0.0]) + np.array(
            [0.0, 2.0 * (1 - np.cos(angle)) / max(angle, 1e-9)]
        )
        way = (x - centre - middle) @ turn_of(angle, 2).T + along + centre - x
        turned.x.array[:] = way.ravel()

    problem.ramp(apply, first=0.1, largest=0.1)
    assert problem.certificate.holds
    return x, u.x.array.reshape(-1, 2).copy()


@pytest.mark.one_quick
@pytest.mark.parametrize(
    "scene",
    [
        lambda: blocks(lower=(6, 3), upper=(3, 2), friction=Coulomb(0.3), **KEPT),
        lambda: blocks(lower=(4, 2), upper=(3, 2), degree=2, slave=1, **KEPT),
        lambda: stacked("hexahedron", lower=(2, 2, 1), upper=(1, 1, 1), friction=Coulomb(0.3), **KEPT),
    ],
    ids=["plane", "quadratic", "space"],
)
def test_forces_turn_with_the_normals(scene):
    """What the tangent knows of it, against differences of the forces along the turned normals of uneven sides."""
    scene = scene()
    space, dim = scene.u.function_space, scene.u.function_space.mesh.geometry.dim
    scene.move(*np.zeros(dim - 1), -0.05)
    state, paired = scene.problem.state, scene.problem.linear.foundations.kept_pairs[0]
    generator = np.random.default_rng(0)
    shape = scene.u.x.array.reshape(-1, dim).shape
    places, way = 0.02 * generator.standard_normal(shape), generator.standard_normal(shape)
    boundary, along = state.boundary, fem.Function(space)
    along.x.array[:] = way.ravel()
    rows = (dim * np.arange(boundary.size)[:, None] + np.arange(dim)).ravel()
    operator = boundary.averages.operator[rows]
    pressure = 1.0 + generator.random(boundary.size)
    shear = generator.standard_normal(state.shear.shape)

    def forces(share):
        """Of pressures, and of shears that turn with the normals as in 2D, or as little as they can."""
        normal = paired.deformed(space, places + share * way).coupling.normal
        start = paired.deformed(space, places).coupling.normal
        vectors = np.einsum("nik,nk->ni", tangents_across(start), shear)
        bisector = start + normal
        part = np.sum(vectors * normal, axis=1) / (1.0 + np.sum(start * normal, axis=1))
        tractions = pressure[:, None] * normal + vectors - part[:, None] * bisector
        at_nodes = operator.T @ (boundary.weight[:, None] * tractions).ravel()
        total = np.zeros(shape)
        total[boundary.averages.nodes] = at_nodes.reshape(-1, dim)
        return total.ravel()

    def tangents_across(normal):
        first = np.eye(dim)[np.abs(normal).argmin(axis=1)]
        first = first - np.sum(first * normal, axis=1, keepdims=True) * normal
        first /= np.linalg.norm(first, axis=1, keepdims=True)
        return first[..., None] if dim == 2 else np.stack((first, np.cross(normal, first)), axis=2)

    start = paired.deformed(space, places).coupling.normal
    turned = replace(boundary, normal=start)
    in_axes = np.einsum("nik,nij,nj->nk", turned.tangents, tangents_across(start), shear)
    claimed = replace(state, boundary=turned, pressure=pressure, shear=in_axes)
    change = (forces(1e-6) - forces(-1e-6)) / 2e-6
    expected = turned_forces(claimed, 0, paired, space, places).times(along)
    assert np.abs(change).max() > 0.01
    assert expected == pytest.approx(change, abs=1e-6 * np.abs(change).max())


def test_what_a_pair_may_be():
    """Ties, nominal distances and quadratic bodies in 3D are for pairs that keep partners."""
    for options, words in (({"bonded": True}, "sliding = False"), ({"gap": 0.0}, "geometry")):
        with pytest.raises(FormError, match=words):
            blocks(lower=(4, 2), upper=(2, 2), pair=options)
        blocks(lower=(4, 2), upper=(2, 2), pair={**options, "sliding": False})
    with pytest.raises(FormError, match="sliding = False"):
        stacked("hexahedron", lower=(1, 1, 1), upper=(1, 1, 1), degree=2)


@pytest.mark.slow
@pytest.mark.mpi
def test_ranks():
    """Forces with friction do not depend on the ranks."""
    comm = MPI.COMM_WORLD
    settings = {"lower": (6, 3), "upper": (4, 2), "friction": Coulomb(0.3), "algorithm": "alm", **KEPT}
    alone, shared = blocks(**settings), blocks(comm=comm, **settings)
    for way in ((0.0, -0.03), (0.02, -0.03)):
        force, of_ranks = alone.move(*way), shared.move(*way)
        assert of_ranks == pytest.approx(force, abs=1e-8 * np.linalg.norm(force))
    assert shared.problem.certificate.holds
    assert abs(force[0]) > 0.01 * abs(force[1])
