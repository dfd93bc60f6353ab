"""Two nonlinear bodies whose points keep their partners: joint rotations, limits, arguments and
ranks.
"""

import re

import numpy as np
import pytest
from dolfinx import fem
from mpi4py import MPI
from parameters import slow
from support.sliding_bodies import blocks, stacked, turn_of

from signorini_fx import Coulomb, FormError, NonlinearContactProblem

KEPT = {"pair": {"sliding": "small"}}


def turned_as_a_whole(scene, way, angle, steps=4):
    """Both ends of a scene moved, the second one pressed by a way and both turned by an angle; the
    force on the slave in axes that turn with them.
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

    problem.run(np.linspace(0.0, 1.0, steps + 1)[1:], apply)
    assert problem.certificate.holds
    return turn_of(angle, dim).T @ sum(problem.state.forces), problem


@pytest.mark.one_quick(
    ("make", "way"),
    [
        (lambda: blocks(lower=(6, 3), upper=(3, 2), **KEPT), (0.0, -0.1)),
        (
            lambda: blocks(lower=(6, 3), upper=(3, 2), pair={"sliding": "small", "kind": "bonded"}),
            (0.0, 0.1),
        ),
        (lambda: blocks(lower=(4, 2), upper=(3, 2), degree=2, slave=1, **KEPT), (0.0, -0.1)),
        slow(
            lambda: stacked("hexahedron", lower=(2, 2, 1), upper=(1, 1, 1), degree=2, **KEPT),
            (0.0, 0.0, -0.1),
        ),
    ],
    ids=["plane", "tied", "quadratic", "space"],
)
def test_joint_rotations_do_not_matter(make, way):
    """Blocks that are pressed, or tied and pulled, and turned by half a right angle together: the
    same force, turned, to what Newton's method leaves.
    """
    still, _ = turned_as_a_whole(make(), way, 0.0)
    turned, problem = turned_as_a_whole(make(), way, np.pi / 4)
    assert np.linalg.norm(still) > 0.01
    assert turned == pytest.approx(still, abs=3e-6 * np.linalg.norm(still))
    assert not problem.linear.foundations.sliding  # none slides


@pytest.mark.one_quick("facets", [0.2, 0.9])
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


def test_what_a_pair_may_be():
    """Ties, nominal distances and quadratic bodies in 3D are for pairs that keep partners."""
    for options, words in (
        ({"kind": "bonded"}, 'sliding = "small"'),
        ({"distance": "nominal"}, "geometry"),
    ):
        with pytest.raises(FormError, match=words):
            blocks(lower=(4, 2), upper=(2, 2), pair=options)
        blocks(lower=(4, 2), upper=(2, 2), pair={**options, "sliding": "small"})
    with pytest.raises(FormError, match='sliding = "small"'):
        stacked("hexahedron", lower=(1, 1, 1), upper=(1, 1, 1), degree=2)


@pytest.mark.slow
@pytest.mark.mpi
def test_ranks():
    """Forces with friction do not depend on the ranks."""
    comm = MPI.COMM_WORLD
    settings = {
        "lower": (6, 3),
        "upper": (4, 2),
        "friction": Coulomb(0.3),
        "algorithm": "alm",
        **KEPT,
    }
    alone, shared = blocks(**settings), blocks(comm=comm, **settings)
    for way in ((0.0, -0.03), (0.02, -0.03)):
        force, of_ranks = alone.move(*way), shared.move(*way)
        assert of_ranks == pytest.approx(force, abs=1e-8 * np.linalg.norm(force))
    assert shared.problem.certificate.holds
    assert abs(force[0]) > 0.01 * abs(force[1])
