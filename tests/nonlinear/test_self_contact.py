"""A surface of a nonlinear body that touches itself: against the mirror problem, named halves, and
what is refused.
"""

import re

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx.mesh import compute_midpoints
from mpi4py import MPI
from on_meshes import at_coordinate, vector_space
from parameters import slow
from scene_tables import coulomb_friction, plane_shape
from support.nonlinear_bodies import Killed
from support.sliding_bodies import roller
from two_bodies import assembled, facets, grid, on

from signorini_fx import (
    Coulomb,
    Foundation,
    NonlinearContactProblem,
    Pair,
    Scene,
    SceneError,
    follower_pressure,
    solve,
)
from signorini_fx.mechanics.mesh.tagged import tagged_mesh
from signorini_fx.records import StepRecord
from signorini_fx.scenes.checks import check_scene

UPPER = plane_shape((0.0, 3.0), (0.0, -1.0))
LOWER = plane_shape((0.0, -3.0), (0.0, 1.0))
WAYS = (0.4, 1.1, 1.8, 2.4, 3.0, 3.6, 4.0, 4.2, 4.4)


def ring(cells=(64, 3), angle=2.0 * np.pi, comm=MPI.COMM_SELF, kind="quadrilateral"):
    """The mesh of a ring of the radii 2 and 3, from y = 0 on, and its sides by their names; in 3D
    of the length 1 along z.
    """
    dim = len(cells)
    listed, x = grid(kind, cells, [0.0] * dim, [angle, *[1.0] * (dim - 1)])
    if angle > 6.0:  # the end is the beginning
        count = int(cells[0] * np.prod(np.array(cells[1:]) + 1))
        listed = listed % count
        x = x[:count]
    radii = 3.0 - x[:, 1:2]
    x = np.hstack((radii * np.cos(x[:, :1]), radii * np.sin(x[:, :1]), x[:, 2:]))
    mesh = assembled(kind, (listed, x), comm=comm)

    def side(marker):
        return facets(mesh, lambda x: marker(np.hypot(x[0], x[1]), x[1]))

    return mesh, {
        "inside": side(lambda r, y: r < 2.0 + 1e-9),
        "upper": side(lambda r, y: (r > 3.0 - 1e-9) & (y > -1e-9)),
        "lower": side(lambda r, y: (r > 3.0 - 1e-9) & (y < 1e-9)),
    }


def hyperelastic(u, radius=None):
    """The residual of mu = 1 and lambda = 10; with a radius of a body of revolution."""
    dim = len(u)
    gradient = ufl.Identity(dim) + ufl.grad(u)
    around = 1.0 if radius is None else 1.0 + u[0] / radius
    volume = ufl.ln(ufl.det(gradient) * around)
    energy = (ufl.inner(gradient, gradient) + around**2 - dim - 1) / 2 - volume + 5.0 * volume**2
    measure = 1.0 if radius is None else 2 * np.pi * radius
    dx = ufl.dx(metadata={"quadrature_degree": 2})
    return ufl.derivative(energy * measure * dx, u, ufl.TestFunction(u.function_space))


def zero(space, axis, marker):
    """A displacement of zero along an axis at nodes."""
    part = space.sub(axis)
    nodes = fem.locate_dofs_geometrical((part, part.collapse()[0]), marker)[0]
    return fem.dirichletbc(0.0, nodes, part)


def placed(shape, dim):
    """A plane of 2D in a space of this dimension."""
    further = [0.0] * (dim - 2)
    return shape | {key: (*shape[key], *further) for key in ("point", "normal")}


class CrushedRing:
    """A ring between two plates, in plane strain, of mu = 1 and lambda = 10.

    Args:
        cells: around, and through the wall.
        half: whether it is the part above the plane y = 0, which is a mirror and a wall.
        pair: a function of mesh and facets inside that gives the contact there; None: there is
        none.
        friction: on the plates.
        comm: the ranks.
        kind: of the cells.
    """

    def __init__(
        self,
        cells=(64, 3),
        half=False,
        pair=None,
        friction=None,
        comm=MPI.COMM_SELF,
        kind="quadrilateral",
    ):
        mesh, sides = ring(cells, np.pi if half else 2.0 * np.pi, comm, kind)
        dim = self.dim = len(cells)
        space = vector_space(mesh)
        u = fem.Function(space)
        upper, lower = placed(UPPER, dim), placed(LOWER, dim)
        contact = [Foundation(sides["upper"], shape=upper, friction=friction)]
        if half:
            mirror = placed(LOWER | {"point": (0.0, 0.0)}, dim)
            contact.append(Foundation(sides["inside"], shape=mirror))
        else:
            contact.append(Foundation(sides["lower"], shape=lower, friction=friction))
        if pair is not None:
            contact.append(pair(mesh, sides["inside"]))
        bcs = [
            zero(space, axis, lambda x, axis=axis: np.isclose(x[axis], 0.0))
            for axis in range((friction is None) + half)
        ]
        if dim == 3:
            ends = [at_coordinate(2, at) for at in (0.0, 1.0)]
            bcs += [zero(space, 2, end) for end in ends]
        self.problem = NonlinearContactProblem(
            hyperelastic(u), u, bcs=bcs, contact=contact, stability=False
        )
        self.share = 0.5 if half else 1.0

    def crush(self, ways=WAYS, along=None):
        """Move the upper plate down and along by these ways; the forces on it and inside."""
        along = [0.0] * len(ways) if along is None else along

        def move(t):
            at = np.arange(len(ways) + 1)
            shift = [np.interp(t, at, (0.0, *way)) for way in (along, ways)]
            way = (shift[0], -self.share * shift[1], *[0.0] * (self.dim - 2))
            self.problem.place(0, shift=way)

        self.solves, self.forces = list[int](), list[list[float]]()

        def note(step):
            self.solves.append(step.linear_solves)
            self.forces.append(self.pressed())

        times = [float(k) for k in range(1, len(ways) + 1)]
        self.problem.run(times, move, on_step=note)
        assert self.problem.certificate.holds
        return self.forces[-1]

    def pressed(self):
        """The forces on the upper plate and inside."""
        state = self.problem.state
        forces = state.boundary.weight * state.pressure
        last = state.boundary.part.max()
        comm = state.boundary.comm
        return [comm.allreduce(forces[state.boundary.part == part].sum()) for part in (0, last)]


def itself(reach=None, friction=None):
    return lambda mesh, inside: Pair(inside, inside, reach=reach, friction=friction)


@pytest.mark.parametrize(
    ("cells", "exact", "error"),
    [((64, 3), (7.33175, 5.48444), 2.1e-4), slow((128, 6), (7.21310, 5.87831), 6e-5)],
)
def test_a_crushed_ring_is_its_own_mirror_image(cells, exact, error):
    """Half of it above a wall has the same forces, but for the error of the mesh, and takes as many
    solves, once the plates hold it.
    """
    mirror = CrushedRing((cells[0] // 2, cells[1]), half=True)
    assert mirror.crush() == pytest.approx(exact, rel=2e-6)
    whole = CrushedRing(cells, pair=itself())
    assert whole.crush() == pytest.approx(exact, rel=error)
    assert sum(whole.solves[2:]) <= 1.2 * sum(mirror.solves[2:])


def halves(left_out, reach=None):
    """Two sides that leave out so much of each fold, in radians."""

    def pair(mesh, inside):
        height = compute_midpoints(mesh, 1, inside)[:, 1] / 2.0
        parts = [inside[sign * height > np.sin(left_out)] for sign in (1.0, -1.0)]
        return Pair(*parts, reach=reach)

    return pair


@pytest.mark.slow
@pytest.mark.parametrize(
    "pair",
    [itself(reach=1.0), itself(reach=3.0), halves(0.1), halves(0.06, reach=10.0)],
    ids=["reach", "far", "halves", "almost all"],
)
def test_what_finds_the_same_contact(pair):
    """Neither the reach nor names change it: partners are nearer than the focus of the folds."""
    assert CrushedRing(pair=pair).crush() == pytest.approx([7.33254, 5.48554], rel=3e-6)


@pytest.mark.slow
@pytest.mark.mpi
def test_a_ring_that_rolls():
    """To the right as to the left; forces and moments inside balance, whatever has become of the
    sides.
    """
    forces = list[list[float]]()
    for sign in (1.0, -1.0):
        rolled = CrushedRing(
            (48, 2), pair=itself(friction=Coulomb(0.3)), friction=Coulomb(0.5), comm=MPI.COMM_WORLD
        )
        ways = (0.4, 1.8, 3.0, 4.0, 4.4, 4.4, 4.4, 4.4)
        forces.append(rolled.crush(ways, (*[0.0] * 5, 0.3 * sign, 0.6 * sign, 0.9 * sign)))
    assert forces[0] == pytest.approx(forces[1], rel=1e-7)
    problem = rolled.problem
    folded = problem.linear.foundations.sliding[2]
    tractions = np.random.default_rng(3).standard_normal(2 * folded.alone.size)
    tractions[np.repeat(folded.alone, 2)] = 0.0
    averages = folded.boundary().averages
    forces = (averages.operator.T @ tractions).reshape(-1, 2)
    moved = averages.x + folded.displacement
    moments = moved[:, 0] * forces[:, 1] - moved[:, 1] * forces[:, 0]
    sums = np.array([*forces.sum(axis=0), moments.sum()])
    assert np.abs(problem.u.function_space.mesh.comm.allreduce(sums)).max() < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize(("cells", "ripple"), [((64, 3), 0.01), ((128, 6), 0.0025)])
def test_a_ring_that_rolls_has_smooth_forces(cells, ripple):
    """Over two facets they leave a parabola by so much of their mean."""
    rolled = CrushedRing(cells, pair=itself(), friction=Coulomb(0.5))
    ways = 6 * np.pi / cells[0] * np.concatenate([np.arange(1, 5) / 2, 2 + np.arange(1, 17) / 8])
    rolled.crush((0.4, 1.8, 3.0, 4.0, *[4.4] * 21), (*[0.0] * 5, *ways))
    for forces in np.transpose(rolled.forces[-16:]):
        parabola = np.polyval(np.polyfit(ways[-16:], forces, 2), ways[-16:])
        assert np.abs(forces - parabola).max() < ripple * forces.mean()


@pytest.mark.slow
@pytest.mark.mpi
@pytest.mark.parametrize(("kind", "error"), [("hexahedron", 2e-4), ("tetrahedron", 0.1)])
def test_a_tube_in_space(kind, error):
    """Between walls across its axis it is the plane one, but for the stiffness of tetrahedra."""
    plane = CrushedRing((48, 2), pair=itself()).crush()
    cells = (48, 2, 1)
    tube = CrushedRing(cells, pair=itself(), kind=kind, comm=MPI.COMM_WORLD).crush()
    assert tube == pytest.approx(plane, rel=error)


def folded(revolved, half):
    """The force with which a fold closes whose ends are pushed together: two legs and a bend of the
    radius 0.3, plane or of revolution; ``half``: above a mirror.
    """

    def bent(x):
        along = np.abs(x[:, 0]) * (1.0 + 0.15 * np.pi)
        angle = np.minimum(along / 0.3, np.pi / 2)
        normal = np.column_stack((np.cos(angle), np.sign(x[:, 0]) * np.sin(angle)))
        middle = np.column_stack((2.0 - np.maximum(along - 0.15 * np.pi, 0.0), 0.0 * along))
        return middle + (0.45 - 0.3 * x[:, 1:]) * normal

    start, around = (0.0, 20) if half else (-1.0, 40)
    cells = grid("quadrilateral", (around, 4), [start, 0.0], [1.0, 1.0], bent)
    mesh = assembled("quadrilateral", cells)
    space = vector_space(mesh)
    u = fem.Function(space)
    radius = ufl.SpatialCoordinate(mesh)[0] if revolved else None
    measure = {"measure": 2 * np.pi * radius} if revolved else {}
    inside = facets(mesh, lambda x: (np.abs(x[1]) < 0.15 + 1e-9) & (x[0] < 2.15 + 1e-9))
    legs = [facets(mesh, at_coordinate(1, y)) for y in (0.45, -0.45)]
    plates = [
        Foundation(leg, shape=plate | {"point": (0.0, y)}, **measure)
        for leg, plate, y in zip(legs, (UPPER, LOWER), (0.45, -0.45), strict=True)
        if leg.size
    ]
    bcs = [zero(space, 0, at_coordinate(0, 1.0))]
    if half:
        bcs.append(zero(space, 1, at_coordinate(1, 0.0)))
        contact = Foundation(inside, shape=LOWER | {"point": (0.0, 0.0)}, **measure)
    else:
        contact = Pair(inside, inside, **measure)
    problem = NonlinearContactProblem(
        hyperelastic(u, radius), u, bcs=bcs, contact=[*plates, contact], stability=False
    )
    way = 0.18 if half else 0.36
    problem.run([0.4, 0.8, 1.0], lambda t: problem.place(0, shift=(0.0, -way * t)))
    assert problem.certificate.holds
    state = problem.state
    forces = state.boundary.weight * state.pressure
    return float(forces[state.boundary.part == len(plates)].sum())


@pytest.mark.parametrize("revolved", [False, True])
def test_a_fold_that_closes(revolved):
    """The section of a bellows is its own mirror image."""
    force = folded(revolved, half=False)
    assert force > 0.1
    assert force == pytest.approx(folded(revolved, half=True), rel=5e-3)


@pytest.mark.slow
def test_an_elastica_under_pressure():
    """Half of a thin tube whose opposite sides touch at a point: the forces there by an own program
    for inextensible rods of half the thickness, at pressures p R^3 / (E I) that follow the tube
    (Flaherty, Keller and Rubinow, SIAM J. Appl. Math. 23 (1972) 446-455).
    """
    thickness = 0.02
    cells = grid("quadrilateral", (96, 2), [-np.pi / 2, 0.0], [np.pi / 2, 1.0])
    radii = 1.0 + thickness * (0.5 - cells[1][:, 1:])
    x = radii * np.column_stack((np.cos(cells[1][:, 0]), np.sin(cells[1][:, 0])))
    mesh = assembled("quadrilateral", (cells[0], x))
    space = vector_space(mesh, 2)
    u, v = fem.Function(space), ufl.TestFunction(space)
    gradient = ufl.Identity(2) + ufl.grad(u)
    volume = ufl.ln(ufl.det(gradient))
    energy = (ufl.inner(gradient, gradient) - 2) / 2 - volume + 0.75 * volume**2  # poisson 0.3
    form = ufl.derivative(energy * ufl.dx(metadata={"quadrature_degree": 4}), u, v)
    bending = 2.6 / (1.0 - 0.3**2) * thickness**3 / 12
    pressure, push = fem.Constant(mesh, 0.0), fem.Constant(mesh, 0.0)
    inner, outer = (
        facets(mesh, lambda x, sign=sign: sign * (np.hypot(x[0], x[1]) - 1.0) > 0.005)
        for sign in (-1.0, 1.0)
    )
    x = ufl.SpatialCoordinate(mesh)
    loads = follower_pressure(pressure, u) + push * ufl.as_vector((x[0], -x[1]))
    form -= ufl.inner(loads, v) * on(mesh, outer)
    bcs = [zero(space, axis, lambda x, axis=axis: np.isclose(x[axis], 0.0)) for axis in (0, 1)]
    problem = NonlinearContactProblem(form, u, bcs=bcs, contact=Pair(inner, inner), stability=False)
    pressures = [2.8, 3.3, 4.0, 4.6, 5.1, 5.9406, 6.9307]
    forces = dict[float, float]()

    def load(t):
        at = np.interp(t, np.arange(len(pressures) + 1), [0.0, *pressures])
        pressure.value = at * bending
        push.value = 0.02 * bending * (at < 3.5)  # until it has chosen a direction

    def take(step):
        contact = step.contact
        forces[step.time] = float(contact.boundary.weight @ contact.pressure) / bending

    problem.run([float(k) for k in range(1, len(pressures) + 1)], load, on_step=take)
    found = [forces[float(k)] for k in range(5, len(pressures) + 1)]
    assert 2.0 * np.array(found) == pytest.approx([0.0, 1.17148, 2.71794], rel=1e-3)


def test_two_bodies_in_one_surface():
    """A half ring rolls and slides on a block, both of one surface, as it does with two sides."""
    ways = [(0.0, -0.05), (0.0, -0.1), (0.1, -0.1), (0.2, -0.1)]
    pair = roller(friction=Coulomb(0.3), slave=1)
    expected = [pair.move(*way) for way in ways]
    one = roller(friction=Coulomb(0.3))
    surface = np.sort(np.concatenate(one.sides))
    contact = Pair(surface, surface, friction=Coulomb(0.3))
    one.problem = NonlinearContactProblem(one.form, one.u, bcs=one.bcs, contact=contact)
    found = [one.move(*way) for way in ways]
    np.testing.assert_allclose(found, expected, atol=1e-3)
    assert one.iterations == pair.iterations


# --- scenes ---


def tube(comm=MPI.COMM_SELF, law="neo-hooke", **changed):
    """A crushed ring as a scene."""
    mesh, sides = ring((32, 2), comm=comm)
    contact = {"boundary": "inside", "against": "inside"} | changed
    plates = [
        {"boundary": "upper", "foundation": UPPER | {"shift": [0.0, "-4.4*t"]}},
        {"boundary": "lower", "foundation": LOWER},
    ]
    rough = {"friction": coulomb_friction(0.3)}
    return Scene(
        mesh=tagged_mesh(mesh, sides),
        material={"young": 2.9, "poisson": 0.45} | ({"law": law} if law else {}),
        contact=[*(plate | rough for plate in plates), contact],
        load_steps={"times": [0.25, 0.5, 0.75, 0.9, 1.0]},
    )


@pytest.mark.slow
@pytest.mark.mpi
def test_a_scene_goes_on_after_a_checkpoint(tmp_path_factory):
    """The sides of the next step are those that it would have had."""
    comm = MPI.COMM_WORLD
    folder = comm.bcast(tmp_path_factory.mktemp("states") if comm.rank == 0 else None)
    scene = tube(comm)
    reference = solve(scene, comm)

    def watch(record):
        if isinstance(record, StepRecord) and record.step == 5:
            raise Killed

    with pytest.raises(Killed):
        solve(scene, comm, checkpoint=folder, observers=[watch])
    again = solve(scene, comm, checkpoint=folder)
    assert again.converged
    np.testing.assert_allclose(
        again.displacement.x.array, reference.displacement.x.array, atol=1e-12
    )
    forces = comm.allreduce(
        float(reference.contact.pressure[reference.contact.boundary.part == 2].sum())
    )
    assert forces > 1.0
    said = [found.message for found in reference.findings if found.path == "contact[2]"]
    assert len(said) == 1
    words = r"touches itself at \d+ of 32 nodes, with a force of \d.*; (\d+) of 32 facets face "
    facing, beside = re.match(words + r"each other; (\d+) beside them", said[0]).groups()
    assert int(facing) + int(beside) == 32


def test_a_scene_in_words():
    said = check_scene(tube(), MPI.COMM_SELF).acts
    assert "contact inside (unilateral, may touch itself, 32 nodes)" in said


@pytest.mark.parametrize(
    ("changed", "fault"),
    [
        ({"law": None}, r"contact\[2\].against: is the boundary itself: .* a nonlinear law"),
        ({"sliding": "small"}, r"contact\[2\].against: is the boundary itself"),
        ({"kind": "bilateral"}, r"contact\[2\].kind: must be left out: each step finds both"),
        ({"points": "against"}, r"contact\[2\].points: must be left out"),
    ],
)
def test_bad_input(changed, fault):
    with pytest.raises(SceneError, match=fault):
        check_scene(tube(**changed), MPI.COMM_SELF)
