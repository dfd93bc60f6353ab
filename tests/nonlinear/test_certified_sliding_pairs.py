"""Sliding pairs whose certificate makes the map anew: held sides, tips on an axis, and points that
supports fix.
"""

import numpy as np
import pytest
from dolfinx.mesh import compute_midpoints
from on_meshes import at_coordinate
from parameters import slow
from support.sliding_bodies import SlidingBodies, cylinders, wheel
from two_bodies import grid

from signorini_fx import Coulomb, NonlinearContactProblem, Pair

DEPTH = 0.02
KINDS = {2: "quadrilateral", 3: "hexahedron"}


def punch(dim, kind=None, degree=1, away=1e-6, clamped=-np.inf, **settings):
    """A parabola that is driven into a block and along it, with friction.

    Args:
        dim: of space.
        kind: of the cells.
        degree: of the displacement.
        away: distance of the undeformed bodies.
        clamped: all nodes of the parabola are driven, and those of the upper side of the block are
        held up to here.
        settings: see ``SlidingBodies``.
    """
    up = dim - 1

    def height(x):
        return 0.1 * np.sum(x[:up] ** 2, axis=0)

    def bent(x):
        return np.column_stack((x[:, :up], x[:, up] + height(x.T) * (0.3 - x[:, up]) / 0.3))

    kind = kind or KINDS[dim]
    meshes = (
        grid(kind, (*[6] * up, 3), [*[-0.75] * up, -1.0], [*[0.75] * up, 0.0]),
        grid(kind, (*[7 - 2 * (dim - 2)] * up, 1), [*[-0.5] * up, away], [*[0.5] * up, 0.3], bent),
    )
    touching = [lambda x: np.isclose(x[up], 0.0), lambda x: x[up] <= height(x) + 2 * away]
    held = [
        lambda x: np.isclose(x[up], -1.0) | (np.isclose(x[up], 0.0) & (x[0] <= clamped)),
        lambda x: np.isclose(x[up], 0.3) | ((x[up] >= away / 2) & (clamped > -1.0)),
    ]
    pair = {"reach": 0.5, "friction": settings.pop("friction", Coulomb(0.3))}
    return SlidingBodies(kind, meshes, touching, held, degree=degree, pair=pair, **settings)


def driven(scene, depth=DEPTH, far=0.5):
    """Two steps, down and along, by this part of the depth."""
    along = np.zeros(len(scene.u))
    for part in (0.0, far):
        along[0], along[-1] = part * depth, -depth
        scene.move(*along)
    return scene


def pressed(scene, depth=DEPTH):
    """A step down."""
    scene.move(*[0.0] * (len(scene.u) - 1), -depth)
    return scene


def clamped(dim=2):
    """Part of both sides is held over each other."""
    return pressed(punch(dim, clamped=-0.2))


def half():
    """The half of a wheel beside a plane of symmetry."""
    return pressed(wheel(half=True, friction=Coulomb(0.3)))


def revolved():
    """Quadratic bodies of revolution, of which the nodes on the axis have no area."""
    return pressed(cylinders(degree=2, friction=Coulomb(0.3)))


def far():
    """Bodies that are apart by more than a tenth of the reach."""
    return pressed(punch(2, away=0.1), 0.12)


def two_pairs(slave=0):
    """A block on another one, whose sides are two pairs each, which share the nodes in the
    middle.
    """
    kind = "quadrilateral"
    bodies = (
        grid(kind, (8, 3), [-1.0, -1.0], [1.0, 0.0]),
        grid(kind, (6, 3), [-0.75, 1e-6], [0.75, 1.0]),
    )
    level = [at_coordinate(1, y, atol=1e-09) for y in (0.0, 1e-6, -1.0, 1.0)]
    scene = SlidingBodies(kind, bodies, level[:2], level[2:], friction=Coulomb(0.3))

    def parts(side):
        left = compute_midpoints(scene.mesh, 1, side)[:, 0] < 0.0
        return side[left], side[~left]

    (low, high), pairs = [parts(side) for side in scene.sides], []
    for first, second in zip(low, high, strict=True):
        both = (first, second)
        pairs.append(Pair(both[slave], both[1 - slave], friction=Coulomb(0.3), reach=0.3))
    scene.problem = NonlinearContactProblem(scene.form, scene.u, bcs=scene.bcs, contact=pairs)
    return pressed(scene)


# --- faults ---


def slid(dim=2, kind=None, degree=1):
    """See ``driven``."""
    return driven(punch(dim, kind, degree))


def stuck(dim=2):
    """The same where friction holds points."""
    return driven(punch(dim), far=0.01)


SCENES = slid, stuck, two_pairs, clamped, far, revolved, half


@pytest.mark.parametrize("scene", SCENES)
def test_what_is_right_is_certified(scene):
    """Without a fault, each of these scenes."""
    certificate = scene().problem.certificate
    assert certificate.holds
    assert certificate.coupling < 1e-9


def cone(slope, slave, degree=1):
    """A cone of revolution in a wider one: on the axis its sides are not level, and normals are
    along that.
    """

    def below(x):
        return np.column_stack((1.3 * x[:, 0], x[:, 1] + (1 + x[:, 1]) * 1.3 * slope * x[:, 0]))

    def above(x):
        return np.column_stack((x[:, 0], x[:, 1] + (1 - x[:, 1]) * slope * x[:, 0]))

    kind, away = "quadrilateral", 1e-6
    bodies = (
        grid(kind, (6, 3), [0.0, -1.0], [1.0, 0.0], below),
        grid(kind, (5, 3), [0.0, away], [1.0, 1.0], above),
    )
    touching = [
        lambda x: np.isclose(x[1], slope * x[0], atol=1e-9),
        lambda x: x[1] <= slope * x[0] + 2 * away,
    ]
    held = [at_coordinate(1, -1.0), at_coordinate(1, 1.0)]
    return SlidingBodies(
        kind, bodies, touching, held, half=True, revolved=True, slave=slave, degree=degree
    )


@pytest.mark.parametrize("slave", [0, 1])
@pytest.mark.parametrize("slope", [0.1, 0.5])
def test_tips_on_an_axis_are_in_the_plane_of_symmetry(slope, slave):
    """For solver and certificate, on either side, although their facets are steep."""
    certificate = pressed(cone(slope, slave), 0.01).problem.certificate
    assert certificate.holds
    assert certificate.coupling < 1e-9


@pytest.mark.slow
@pytest.mark.parametrize(
    ("dim", "kind", "upto"),
    [(2, "quadrilateral", 0.05), (2, "triangle", 0.05), slow(3, "tetrahedron", -0.1)],
)
def test_a_step_begins_with_what_supports_fix_there(dim, kind, upto):
    """Sides that are held over each other and slide: who meets whom as a step begins is known from
    where bodies are then, not from where the step before had begun, so that slips are those of the
    certificate, and nothing slides where nothing moves.
    """
    scene = driven(punch(dim, kind, 4 - dim, clamped=upto, slave=1), 0.02, 0.1)
    certificate = scene.problem.certificate
    assert max(certificate.slip_below_bound, certificate.wrong_way_slip) < 1e-9
    scene.problem.linear.slide()
    (pair,) = scene.problem.linear.foundations.sliding.values()
    size = np.abs(scene.u.x.array).max()
    assert np.abs(pair.slip[pair.begun.frames.partnered]).max() < 1e-14 * size
    assert scene.problem.state.in_contact.any()


ANGLES = (0.0, np.pi / 2, 1.0, 4.5)


@pytest.mark.slow
@pytest.mark.parametrize(("degree", "upto", "friction"), [(1, 0.05, None), (2, -0.4, Coulomb(0.3))])
def test_nodes_over_each_other_that_are_held(degree, upto, friction):
    """A node of the one side lies exactly over the last held one of the other side, and both are
    held along the axes of space: forces are those of any other rotation of the scene, as no plane
    of symmetry is there.
    """
    forces = []
    for angle in ANGLES:
        scene = punch(
            2, degree=degree, clamped=upto, slave=1, friction=friction, angle=angle, algorithm="alm"
        )
        forces.append(scene.move(0.0, -DEPTH))
    assert np.abs(forces[0][1]) > 0.1
    assert np.array(forces) == pytest.approx(
        np.tile(forces[0], (len(ANGLES), 1)), abs=1e-9 * np.abs(forces[0]).max()
    )
