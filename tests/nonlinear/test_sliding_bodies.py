"""Two nonlinear bodies that slide on each other over many facets, in 2D, in 3D and of revolution:
closed forms, invariances, limits, guides that cannot part, friction that needs no pressure, the
certificate, and outcomes.
"""

from dataclasses import replace

import numpy as np
import pytest
from dolfinx import fem
from mpi4py import MPI
from on_meshes import at_coordinate
from parameters import slow
from scene_tables import fixed, plane_shape, rectangle_mesh
from scenes import alone
from support.nonlinear_bodies import stress_of_block
from support.sliding_bodies import (
    as_linear_bodies,
    blocks,
    bulge,
    bump,
    cylinders,
    dome,
    out_of_balance,
    pillow,
    quarter_of_a_bulge,
    ring_on_cone,
    roller,
    rounded,
    stacked,
)

from signorini_fx import (
    ConvergenceError,
    Coulomb,
    FormError,
    Foundation,
    NonlinearContactProblem,
    Pair,
    Status,
    Tresca,
)
from signorini_fx.forms.nonlinear.results import certified
from signorini_fx.mechanics.laws.protocol import Envelope, FrictionLaw, Parameter
from signorini_fx.results.certificate.contact_nodes import Tractions
from signorini_fx.scenes.reading import parse_scene

PRESSED = ((0, -0.1), (0, -0.2))
PRESSED_IN_3D = ((0, 0, -0.05), (0, 0, -0.1))
COARSE = {"kind": "tetrahedron", "lower": (8, 6, 1), "upper": (4, 4, 1), "ratio": 10.0}
ROUGH = Coulomb(0.3)
GUIDE = {"pair": {"kind": "bilateral"}, "algorithm": "alm"}
SMOOTH = {"smooth": at_coordinate(0, 0.0)}
FLAT = {"lower": (5, 3), "upper": (3, 2), "width": 1.0, **SMOOTH}
QUADRATIC = {"kind": "triangle", "degree": 2}


def slid(scene, ways):
    """The forces of a scene after each of some ways."""
    forces = np.array([scene.move(*way) for way in ways])
    assert scene.problem.certificate.holds
    return forces


# --- blocks that are compressed, and limits -------------------------------------------------------


def cases(names, *quick):
    """All names with the points on either side, of which a few are quick with the points on the
    first one.
    """
    return [
        pytest.param(name, slave, marks=[pytest.mark.slow] * (slave > 0 or name not in quick))
        for name in names
        for slave in (0, 1)
    ]


PATCHES = {
    "quadrilaterals": (blocks, FLAT),
    "triangles": (blocks, FLAT | {"kind": "triangle"}),
    "degree 2": (blocks, FLAT | QUADRATIC),
    "hexahedra": (stacked, SMOOTH),
    "tetrahedra": (stacked, SMOOTH | {"kind": "tetrahedron"}),
    "cylinders": (cylinders, {}),
    "tubes": (cylinders, {"kind": "triangle", "inner": 0.2}),
    "cylinders, degree 2": (cylinders, QUADRATIC),
    "guide": (blocks, FLAT | GUIDE),
    "guide, degree 2": (blocks, {"width": 1.0} | QUADRATIC | SMOOTH | GUIDE),
    "guide in 3D": (stacked, SMOOTH | GUIDE),
}


@pytest.mark.parametrize(
    ("name", "slave"),
    cases(PATCHES, "quadrilaterals", "tetrahedra", "cylinders, degree 2", "guide"),
)
def test_patch(name, slave):
    """Bodies whose meshes do not match are compressed by two fifths of both, and guides pulled:
    uniform, in closed form.
    """
    make, settings = PATCHES[name]
    scene = make(slave=slave, **settings)
    dim, pulled, revolved = len(scene.u), "guide" in name, make is cylinders
    directions, exact = (
        dim - 1 + revolved,
        1e-8 if pulled or revolved or settings.get("degree") else 1e-9,
    )
    for depth in (0.1, -0.1) if pulled else (0.1, 0.3) if settings.get("degree") else (0.1, 0.4):
        force = scene.move(*[0.0] * (dim - 1), -2 * depth)
        assert scene.problem.certificate.holds
        (pair,) = scene.problem.linear.foundations.sliding.values()
        into = -pair.coupling.gap
        # The regularised law lets both bodies overlap by a pressure over gamma.
        assert np.abs(into).max() < 1e-4
        if not pulled:
            assert into == pytest.approx(into[0], rel=1e-6)
            assert into[0] > 0
        stress = stress_of_block(1 - depth + into[0] / 2, directions)
        assert scene.problem.state.pressure == pytest.approx(-stress, rel=exact)
        if revolved:
            area = np.pi * (1.0 - settings.get("inner", 0.0) ** 2)
            assert abs(force[1]) == pytest.approx(-stress * area, rel=1e-8)
        x = scene.u.function_space.tabulate_dof_coordinates()[:, : dim - 1]
        moved = scene.u.x.array.reshape(-1, dim)[:, : dim - 1]
        widened = moved[x.sum(axis=1).argmax(), 0]
        assert pulled or moved == pytest.approx(
            widened * x, abs=1e-8 if settings.get("degree") else 1e-9
        )
        assert dim == 2 or pulled or scene.problem.iterations <= 5


SMALL = {"height": 2e-7, "lower": (12, 4), "upper": (9, 3), "friction": ROUGH, "degree": 2}
# A scene, its settings, its way, and the largest relative difference.
LIMITS = {
    "smooth": (bump, {}, (2e-5, -1e-4), 2e-3),
    "rough": (bump, {"friction": ROUGH}, (2e-5, -1e-4), 2e-3),
    "hexahedra": (bulge, {"friction": ROUGH}, (2e-5, 1e-5, -1e-4), 2e-3),
    "tetrahedra": (bulge, {"kind": "tetrahedron", "friction": ROUGH}, (2e-5, 1e-5, -1e-4), 2e-3),
    "of revolution": (dome, {"friction": ROUGH}, (0.0, -1e-7), 1e-6),
    "degree 2": (bump, SMALL, (0.0, -1e-7), 1e-6),
    "of revolution, degree 2": (dome, SMALL, (0.0, -1e-7), 1e-6),
    "guide": (bump, {"lower": (26, 8), "friction": ROUGH} | GUIDE, (2e-5, -5e-5), 1e-3),
    "guide in 3D": (
        bulge,
        {"lower": (10, 10, 4), "friction": ROUGH} | GUIDE,
        (2e-5, 0.0, -5e-5),
        1e-3,
    ),
    "tresca": (bump, {"friction": Tresca(2e-4)}, (2e-5, -1e-4), 2e-4),
    "tresca in 3D": (bulge, {"friction": Tresca(2e-4)}, (2e-5, 0.0, -1e-4), 2e-4),
    "cohesion": (bump, {"friction": Coulomb(0.1, cohesion=1e-4)}, (2e-5, -1e-4), 2e-4),
}


@pytest.mark.parametrize(
    ("name", "slave"),
    [
        case
        for case in cases(LIMITS, "rough", "degree 2", "of revolution", "tresca")
        if case.values != ("guide in 3D", 0)
    ],
)
def test_linear_limit(name, slave):
    """At small loads pairs of linear bodies, on the same mesh, up to some strains: with points that
    pull, and with points that are open and carry shear.  Points of guides at the rim of the other
    side share their functions in another way, and are left out.
    """
    make, settings, way, share = LIMITS[name]
    scene = make(slave=slave, **({"algorithm": "alm"} | settings))
    force = scene.move(*way)
    linear, state = as_linear_bodies(scene), scene.problem.state
    expected, size = sum(linear.state.forces), np.abs(sum(linear.state.forces)).max()
    assert np.count_nonzero(linear.state.in_contact) > 3
    if "guide" in name:
        size = state.pressure.max()
        assert state.pressure.min() < -0.1 * size
    assert force == pytest.approx(expected, abs=share * size)
    assert scene.u.x.array == pytest.approx(
        linear.u.x.array, abs=share * np.abs(linear.u.x.array).max()
    )
    across = ~state.in_contact & (np.linalg.norm(state.shear, axis=1) > 0)
    assert across.any() == isinstance(settings.get("friction"), Tresca)


def beside_a_rigid_plane(make, ways, friction, *, contact="unilateral", **settings):
    """Forces on a block that is 1e5 times as stiff, and on a rigid plane, of which other code
    knows.
    """
    forces = []
    for rigid in (False, True):
        scene = make(
            ratio=1e-5,
            slave=1,
            friction=friction,
            algorithm="alm",
            pair={"kind": contact},
            **settings,
        )
        if rigid:
            up = np.eye(len(scene.u))[-1]
            plane = plane_shape(tuple(0.0 * up), tuple(up))
            tool = Foundation(scene.sides[1], shape=plane, friction=friction, kind=contact)
            scene.problem = NonlinearContactProblem(
                scene.form, scene.u, bcs=scene.bcs, contact=tool, algorithm="alm"
            )
        forces.append(slid(scene, ways))
    return forces


WIDE = {"lower": (8, 3), "upper": (4, 3), "width": 3.0}
PULLED = ((0.0, 0.05), (0.1, 0.1), (0.4, 0.1), (0.4, -0.1), (0.2, -0.1))


@pytest.mark.slow
@pytest.mark.parametrize("element", [{}, QUADRATIC], ids=["degree 1", "degree 2"])
def test_a_guide_on_a_rigid_plane(element):
    """Pulled and slid over facets."""
    forces = beside_a_rigid_plane(blocks, PULLED, ROUGH, contact="bilateral", **WIDE, **element)
    assert forces[1][:3, 1].max() < 0 < forces[1][3:, 1].min()
    assert forces[0] == pytest.approx(forces[1], abs=3e-5 * np.abs(forces[1]).max())


BOUND = 0.4
THERE_AND_BACK = ((0, -0.02), (0, -0.1), (0.05, -0.1), (0.3, -0.1), (0.27, -0.1), (0.05, -0.1))


@pytest.mark.slow
@pytest.mark.parametrize("element", [{}, QUADRATIC], ids=["degree 1", "degree 2"])
@pytest.mark.parametrize(
    "law", [Tresca(1e-5 * BOUND), Coulomb(0.0, cohesion=1e-5 * BOUND)], ids=["tresca", "cohesion"]
)
def test_a_bound_on_a_rigid_plane(law, element):
    """Over two facets and back; where all slides the force is the bound times the undeformed area
    of the first side.
    """
    forces = beside_a_rigid_plane(blocks, THERE_AND_BACK, law, **WIDE, **element)
    assert forces[0] == pytest.approx(forces[1], abs=3e-5 * np.abs(forces[1]).max())
    assert 1e5 * forces[0][[3, 5], 0] == pytest.approx([-BOUND, BOUND], rel=1e-5)


@pytest.mark.slow
def test_on_a_rigid_plane_in_3d():
    """Half a per cent while all slides, one while frames half-way between flat and round facets
    make friction of what is pressed.
    """
    ways = [(0, 0, -0.05), (0, 0, -0.1), (0.05, 0.1, -0.1), (0.1, 0.3, -0.1)]
    forces = beside_a_rigid_plane(rounded, ways, ROUGH, kind="hexahedron", height=0.3)
    largest = np.abs(forces[1]).max()
    assert forces[0][:2] == pytest.approx(forces[1][:2], abs=0.01 * largest)
    assert forces[0][2:] == pytest.approx(forces[1][2:], abs=0.005 * largest)


# --- invariances ----------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("dim", [2, 3])
def test_frames_do_not_matter(dim):
    """Bodies that are pressed and slide, and the same turned as a whole: equal forces; friction is
    F times them, along what slides, and forces and moments of both bodies balance.
    """
    law = {"friction": ROUGH, "algorithm": "alm"}
    if dim == 2:
        ways = (*PRESSED, (0.125, -0.2))
        scenes = [
            roller(ratio=10.0, cells=(24, 6), around=14, angle=angle, **law) for angle in (0.0, 0.7)
        ]
    else:
        ways = (*PRESSED_IN_3D, (0.15, 0.05, -0.1))
        scenes = [pillow(angle=angle, **COARSE, **law) for angle in (0.0, 0.7)]
    first, second = (slid(scene, ways) for scene in scenes)
    assert second == pytest.approx(first, abs=1e-9 * np.abs(first).max())
    assert dim == 2 or first[-1, :2] @ [3.0, 1.0] > 0.2 * abs(first[-1, 2])
    for scene in scenes:
        assert max(scene.iterations) <= 5 + dim
        state = scene.problem.state
        closed = state.in_contact
        assert np.count_nonzero(closed) > 5 - dim
        shear = np.linalg.norm(state.shear, axis=1)
        assert shear[closed] == pytest.approx(0.3 * state.pressure[closed], rel=1e-6)
        force, moment = out_of_balance(scene)
        assert force < 1e-13
        assert moment < 10.0 ** (-10 - dim)


@pytest.mark.slow
@pytest.mark.mpi
def test_on_ranks():
    """The same on any number of ranks, with stick and slip."""
    plane, space = (
        [make(comm) for comm in (MPI.COMM_WORLD, MPI.COMM_SELF)]
        for make in (
            lambda comm: slid(
                roller(ratio=10.0, cells=(16, 4), around=8, friction=ROUGH, comm=comm),
                (*PRESSED, (0.15, -0.2)),
            ),
            lambda comm: slid(
                pillow(friction=ROUGH, comm=comm, **COARSE), ((0, 0, -0.1), (0.1, 0.05, -0.1))
            ),
        )
    )
    assert plane[0] == pytest.approx(plane[1], rel=1e-6)
    assert np.abs(space[0][-1]).min() > 0.01 * np.abs(space[0][-1]).max()
    assert space[0] == pytest.approx(space[1], abs=1e-7 * np.abs(space[1]).max())


@pytest.mark.slow
def test_force_is_even_over_an_edge_between_facets():
    """In steps of a sixth of a facet over two facets no force jumps by more than one per cent of
    the largest one.
    """
    scene = roller(ratio=10.0, cells=(48, 12), around=24)
    slid(scene, [(0, -0.1), (0, -0.2), (0, -0.3)])
    forces = slid(scene, [(0.3 + share / 12, -0.3) for share in np.arange(13) / 6])
    largest = np.abs(forces).max()
    assert np.abs(np.diff(forces, axis=0)).max() < 0.01 * largest
    times = np.arange(13)
    for component in forces.T:
        assert (
            np.abs(component - np.polyval(np.polyfit(times, component, 2), times)).max()
            < 0.006 * largest
        )


# --- closed forms ---------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "slave"), [("hexahedron", 0), ("tetrahedron", 1)])
def test_hertz(kind, slave):
    """Small pressures are those of Hertz within half of the radius of contact, over which there are
    five facets, to 5 % (with eight to 1.5 %), contact ends where his does, to one facet, and all is
    as of linear bodies on the same mesh.
    """
    height = 2e-3
    scene = quarter_of_a_bulge(kind, height=height, slave=slave, cells=(14, 10), algorithm="alm")
    force = 4 * np.abs(scene.move(0.0, 0.0, -4e-5)[2])
    assert scene.problem.certificate.holds
    state, linear = scene.problem.state, as_linear_bodies(scene)
    assert 4 * np.abs(sum(linear.state.forces)[2]) == pytest.approx(force, rel=5e-5)
    assert scene.u.x.array == pytest.approx(
        linear.u.x.array, abs=5e-5 * np.abs(linear.u.x.array).max()
    )
    _, own, of_linear = np.intersect1d(
        state.boundary.nodes, linear.state.boundary.nodes, return_indices=True
    )
    assert state.in_contact[own].sum() == state.in_contact.sum() > 30
    assert state.pressure[own] == pytest.approx(
        linear.state.pressure[of_linear], abs=2e-4 * state.pressure.max()
    )
    modulus, curvature = 100.0 / (1 - 0.3**2) / 2, 2 * height
    a = (3 * force / curvature / 4 / modulus) ** (1 / 3)
    largest = 3 * force / (2 * np.pi * a**2)
    r = np.linalg.norm(state.boundary.x[:, :2], axis=1)
    inner = r < a / 2
    assert np.count_nonzero(inner) > 12
    assert state.pressure[inner] == pytest.approx(
        largest * np.sqrt(1 - (r[inner] / a) ** 2), abs=0.05 * largest
    )
    assert not state.in_contact[r > 1.25 * a].any()
    assert state.in_contact[r < 0.75 * a].all()


@pytest.mark.slow
@pytest.mark.parametrize("friction", [None, ROUGH], ids=["smooth", "rough"])
def test_ring_over_a_cone(friction):
    """A soft thin ring that is driven down a cone, over ten facets, widens by two fifths: its force
    along the axis is that of the slope and the angle of friction, whatever the number of steps is.
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


# --- ends, gaps and overlaps ----------------------------------------------------------------------


@pytest.mark.one_quick(("friction", "depth"), [(None, 0.3), (None, 0.42), (Coulomb(0.3), 0.42)])
def test_edges_that_are_flush(friction, depth):
    """Equal blocks with their edges on each other: from a compression on the one slides over the
    other where nothing but pressure holds it, as in a model of its own, blocks with a penalty of
    the overlap of their outlines.
    """
    smooth = friction is None and depth > 0.4
    scene = blocks(
        lower=(8, 8), upper=(8, 8), width=1.0, smooth=at_coordinate(0, 0.0), friction=friction
    )
    scene.move(0.0, -0.2)
    scene.move(0.0, -0.4)
    if smooth:
        with pytest.raises(ConvergenceError, match="unstable equilibrium"):
            scene.move(0.0, -2 * depth)
    else:
        scene.move(0.0, -2 * depth)
    assert scene.problem.status is (Status.UNSTABLE if smooth else Status.CONVERGED)


@pytest.mark.slow
def test_past_the_end_of_the_other_side():
    """Points that come to lie past the end of the other side share what its corner carries: forces
    are those with the points on the side that ends.
    """
    ways = [(0, -0.02), (0, -0.1), (0.1, -0.1), (0.2, -0.1), (0.3, -0.1), (0.4, -0.1)]
    forces = [slid(blocks(friction=Coulomb(0.3), slave=slave), ways) for slave in (0, 1)]
    assert forces[0] == pytest.approx(-forces[1], abs=0.015 * np.abs(forces[0]).max())


def at_the_rim(**settings):
    """A punch at whose rim a node keeps 3 per cent of its area only where it carries no point, and
    its way.
    """
    law = {
        **COARSE,
        "lower": (7, 5, 1),
        "upper": (5, 4, 2),
        "height": 0.59,
        "top": 1.1,  # the corners of a lower one would be above it, and the mesh cross itself
        "ratio": 3.0,
        "algorithm": "alm",
    }
    return pillow(**law, **settings), (0.1388, 0.2671, -0.08315)


@pytest.mark.slow
@pytest.mark.parametrize("slave", [0, slow(1)])
def test_points_that_come_and_go(slave):
    """Functions at the rim turn evenly into those beside them: there is equilibrium, with hardly
    another force where the way is longer by a thousandth.
    """
    scene, way = at_the_rim(slave=slave)
    forces = slid(scene, [way, (1.001 * way[0], 1.001 * way[1], way[2])])
    assert max(scene.iterations) <= 12
    assert max(out_of_balance(scene)) < 1e-13
    assert forces[1] == pytest.approx(forces[0], abs=0.003 * np.abs(forces).max())


class Sticky(FrictionLaw):
    """c + F lambda, in contact or not."""

    law: str = "sticky"
    given: Parameter
    coefficient: Parameter

    def evaluate(self, pressure, slip, dt):
        return self.given + self.coefficient * pressure, self.coefficient, 0.0

    def envelope(self, zero):
        return Envelope(zero + self.given, zero + self.coefficient)


@pytest.mark.slow
@pytest.mark.parametrize(
    "friction", [Tresca(BOUND), Coulomb(0.1, cohesion=BOUND), Sticky(BOUND, 0.3)], ids=type
)
@pytest.mark.parametrize("algorithm", [slow("ssn"), "alm"])
def test_nothing_acts_where_there_is_no_other_side(friction, algorithm):
    """Bodies that part and meet: no force where none sees the other one, and no shear at points
    that do not; forces and moments balance where there is some.
    """
    scene = roller(ratio=10.0, gap=0.3, reach=0.2, friction=friction, algorithm=algorithm)
    shears = []
    for way in (
        (0.0, 0.0),
        (0.0, -0.25),
        (0.0, -0.4),
        (0.0625, -0.4),
        (0.2, -0.4),
        (0.2, 0.1),
        (0.25, 0.1),
    ):
        force = scene.move(*way)
        (pair,) = scene.problem.linear.foundations.sliding.values()
        shear, sees = np.abs(scene.problem.state.shear[:, 0]), pair.coupling.frames.partnered
        assert not sees.all()
        assert np.abs(shear[~sees]).max() == 0.0
        assert scene.problem.certificate.holds
        shears.append(shear.max())
        if shear.any():
            left, moment = out_of_balance(scene)
            assert left < 1e-13
            assert moment < 1e-12
        if not sees.any():
            assert np.abs(force).max() == 0.0
    assert shears[4] >= BOUND * (1 - 1e-9)
    assert shears[0] == shears[-1] == 0.0


@pytest.mark.parametrize(("degree", "finer"), [(1, 2), (2, 1)])
def test_a_body_inside_another_one(degree, finer):
    """It is seen by the outlines of cells, with nodes between their vertices or without, and
    named.
    """
    cells = {"cells": (16 * finer, 4 * finer), "around": 4 * finer, "degree": degree}
    small = roller(radius=0.1, gap=0.05, ratio=10.0, reach=0.05, **cells)
    with pytest.raises(ConvergenceError, match=r"bodies inside each other \(contact\[0\]: "):
        small.move(0.0, -0.6)
    assert small.problem.status is Status.PASSED


def test_bodies_inside_each_other_by_a_gap_that_is_added():
    """What is added to the distance may be inside: the force is that of meshes that are apart by as
    much.
    """
    cells = {"length": 1.0, "height": 1.0, "nx": 20, "ny": 2}
    forces = []
    for gap, apart in ((0.1, 0.0), (0.0, 0.1)):
        scene = {
            "body": [
                {"name": name, "shift": [0.0, shift], "mesh": rectangle_mesh(**cells)}
                for name, shift in (("lower", 0.0), ("upper", 1.0 + apart))
            ],
            "material": {"law": "neo-hooke", "young": 1.0, "poisson": 0.3},
            "displacement": [
                *(fixed(f"{name}.left", "x") for name in ("lower", "upper")),
                fixed("lower.bottom", "y"),
                {"boundary": "upper.top", "y": "-0.15*t"},
            ],
            "contact": {"boundary": "upper.bottom", "against": "lower.top", "gap": gap},
            "load_steps": {"times": [1.0]},
        }
        solution = alone(parse_scene(scene))
        forces.append(solution.contact.forces[0][1])
    assert forces[0] == pytest.approx(forces[1], rel=1e-3)


# --- the certificate, and what is refused ---------------------------------------------------------


@pytest.mark.slow
def test_the_certificate_sees_what_is_wrong():
    """Pressures, shears, displacements and the beginning of the step that are not those of the
    solution.
    """
    scene = roller(ratio=10.0, cells=(24, 6), around=14, friction=Coulomb(0.3))
    for way in (*PRESSED, (0.05, -0.2)):
        scene.drive.value[:] = way
        scene.problem.solve()
        if way != (0.05, -0.2):
            scene.problem.advance()
    problem, u = scene.problem, scene.u
    form = fem.form(scene.form)

    def judged(changed=lambda tractions: tractions, before=lambda step: step):
        linear = problem.linear.now
        linear = replace(linear, before=before(linear.before))
        solved = replace(problem.linear.solved, linear=linear)
        return certified(
            fem.assemble_vector(form).array, solved, tractions=changed(Tractions.of(problem.state))
        )[0]

    assert judged().holds
    touching = np.flatnonzero(problem.state.in_contact)

    def larger(tractions):
        pressure = tractions.pressure.copy()
        pressure[touching[1]] *= 1.0001
        return replace(tractions, pressure=pressure)

    assert judged(larger).equilibrium > 1e-5
    assert not judged(lambda tractions: replace(tractions, shear=-tractions.shear)).holds
    values = u.x.array.copy()
    nodes = fem.locate_dofs_topological(u.function_space, 1, scene.sides[1])
    u.x.array.reshape(-1, 2)[nodes] += [0.0, -1e-4]
    moved = judged()
    assert moved.entered > 1e-5
    u.x.array.reshape(-1, 2)[nodes] += [0.0, 2e-4]
    assert judged().pressure_at_distance > 1e-5
    u.x.array[:] = values
    assert judged().holds

    def elsewhere(step):
        displacement = step.displacement.copy()
        displacement.x.array.reshape(-1, 2)[nodes] += [0.1, 0.0]
        return replace(step, displacement=displacement)

    assert not judged(before=elsewhere).holds


@pytest.mark.parametrize(
    ("more", "where"),
    [
        ({"distance": "nominal"}, "distance"),
        ({"kind": "bonded"}, "kind"),
        ({"adjust": 0.1}, "adjust"),
    ],
)
def test_what_is_not_possible(more, where):
    """One error that names the argument."""
    with pytest.raises(FormError, match=rf"contact\[0\]\.{where}: "):
        blocks(pair=more)


def test_sides_that_share_nodes():
    """Both sides of one corner cannot slide on each other."""
    scene = blocks()
    facets = scene.sides[1]
    contact = Pair(facets[:2], facets[2:])
    with pytest.raises(FormError, match=r"contact\[0\]: sides that slide must not share nodes"):
        type(scene.problem)(scene.form, scene.u, bcs=scene.bcs, contact=contact).solve()
