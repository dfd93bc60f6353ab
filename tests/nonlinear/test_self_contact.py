"""A surface of a nonlinear body that touches itself: against the mirror problem, named halves, and
what is refused.
"""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx.mesh import compute_midpoints
from mpi4py import MPI
from support.nonlinear_bodies import Killed
from two_bodies import assembled, facets, grid

from signorini_fx import (
    Coulomb,
    Foundation,
    NonlinearContactProblem,
    Pair,
    Scene,
    SceneError,
    solve,
)
from signorini_fx.mechanics.mesh.tagged import tagged_mesh
from signorini_fx.records import StepRecord
from signorini_fx.scenes.checks import check_scene

UPPER = {"shape": "plane", "point": (0.0, 3.0), "normal": (0.0, -1.0)}
LOWER = {"shape": "plane", "point": (0.0, -3.0), "normal": (0.0, 1.0)}
WAYS = (0.4, 1.1, 1.8, 2.4, 3.0, 3.6, 4.0, 4.2, 4.4)


def ring(cells=(64, 3), angle=2.0 * np.pi, comm=MPI.COMM_SELF):
    """The mesh of a ring of the radii 2 and 3, from y = 0 on, and its sides by their names."""
    around, through = cells
    listed, x = grid("quadrilateral", cells, [0.0, 0.0], [angle, 1.0])
    if angle > 6.0:  # the end is the beginning
        listed = listed % (around * (through + 1))
        x = x[: around * (through + 1)]
    x = (3.0 - x[:, 1:]) * np.column_stack((np.cos(x[:, 0]), np.sin(x[:, 0])))
    mesh = assembled("quadrilateral", (listed, x), comm=comm)

    def side(marker):
        return facets(mesh, lambda x: marker(np.hypot(x[0], x[1]), x[1]))

    return mesh, {
        "inside": side(lambda r, y: r < 2.0 + 1e-9),
        "upper": side(lambda r, y: (r > 3.0 - 1e-9) & (y > -1e-9)),
        "lower": side(lambda r, y: (r > 3.0 - 1e-9) & (y < 1e-9)),
    }


class CrushedRing:
    """A ring between two plates, in plane strain, of mu = 1 and lambda = 10.

    Args:
        cells: around, and through the wall.
        half: whether it is the part above the plane y = 0, which is a mirror and a wall.
        pair: a function of mesh and facets inside that gives the contact there; None: there is
        none.
        friction: on the plates.
        comm: the ranks.
    """

    def __init__(self, cells=(64, 3), half=False, pair=None, friction=None, comm=MPI.COMM_SELF):
        mesh, sides = ring(cells, np.pi if half else 2.0 * np.pi, comm)
        space = fem.functionspace(mesh, ("Lagrange", 1, (2,)))
        u = fem.Function(space)
        gradient = ufl.Identity(2) + ufl.grad(u)
        volume = ufl.ln(ufl.det(gradient))
        energy = (ufl.inner(gradient, gradient) - 2) / 2 - volume + 5.0 * volume**2
        form = ufl.derivative(
            energy * ufl.dx(metadata={"quadrature_degree": 2}), u, ufl.TestFunction(space)
        )
        contact = [Foundation(sides["upper"], shape=UPPER, friction=friction)]
        if half:
            contact.append(Foundation(sides["inside"], shape=LOWER | {"point": (0.0, 0.0)}))
        else:
            contact.append(Foundation(sides["lower"], shape=LOWER, friction=friction))
        if pair is not None:
            contact.append(pair(mesh, sides["inside"]))
        bcs = []
        for axis in range((friction is None) + half):  # planes of symmetry
            where = space.sub(axis)
            nodes = fem.locate_dofs_geometrical(
                (where, where.collapse()[0]), lambda x, axis=axis: np.isclose(x[axis], 0.0)
            )
            bcs.append(fem.dirichletbc(0.0, nodes[0], where))
        self.problem = NonlinearContactProblem(form, u, bcs=bcs, contact=contact, stability=False)
        self.share = 0.5 if half else 1.0

    def crush(self, ways=WAYS, along=None):
        """Move the upper plate down and along by these ways; the forces on it and inside."""
        along = [0.0] * len(ways) if along is None else along

        def move(t):
            at = np.arange(len(ways) + 1)
            shift = [np.interp(t, at, (0.0, *way)) for way in (along, ways)]
            self.problem.place(0, shift=(shift[0], -self.share * shift[1]))

        self.solves = list[int]()
        times = [float(k) for k in range(1, len(ways) + 1)]
        self.problem.run(times, move, on_step=lambda step: self.solves.append(step.linear_solves))
        assert self.problem.certificate.holds
        state = self.problem.state
        forces = state.boundary.weight * state.pressure
        last = state.boundary.part.max()
        comm = state.boundary.comm
        return [comm.allreduce(forces[state.boundary.part == part].sum()) for part in (0, last)]


def itself(reach=None, friction=None):
    return lambda mesh, inside: Pair(inside, inside, reach=reach, friction=friction)


@pytest.mark.parametrize(
    ("cells", "exact", "error"),
    [
        ((64, 3), (7.33175, 5.48444), 2.1e-4),
        pytest.param((128, 6), (7.21310, 5.87831), 6e-5, marks=pytest.mark.slow),
    ],
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
            (48, 2),
            pair=itself(friction=Coulomb(0.3)),
            friction=Coulomb(0.5),
            comm=MPI.COMM_WORLD,
        )
        ways = (0.4, 1.8, 3.0, 4.0, 4.4, 4.4, 4.4, 4.4)
        forces.append(rolled.crush(ways, (*[0.0] * 5, 0.3 * sign, 0.6 * sign, 0.9 * sign)))
    assert forces[0] == pytest.approx(forces[1], rel=1e-7)
    problem = rolled.problem
    folded = problem.linear.foundations.sliding[2]
    tractions = np.random.default_rng(3).standard_normal(2 * folded.mine.size)
    tractions[np.repeat(folded.alone, 2)] = 0.0
    averages = folded.boundary().averages
    forces = (averages.operator.T @ tractions).reshape(-1, 2)
    moved = averages.x + folded.displacement
    moments = moved[:, 0] * forces[:, 1] - moved[:, 1] * forces[:, 0]
    sums = np.array([*forces.sum(axis=0), moments.sum()])
    assert np.abs(problem.u.function_space.mesh.comm.allreduce(sums)).max() < 1e-12


# --- scenes ---


def tube(comm=MPI.COMM_SELF, law="neo-hooke", **changed):
    """A crushed ring as a scene."""
    mesh, sides = ring((32, 2), comm=comm)
    contact = {"boundary": "inside", "against": "inside"} | changed
    plates = [
        {"boundary": "upper", "foundation": UPPER | {"shift": [0.0, "-4.4*t"]}},
        {"boundary": "lower", "foundation": LOWER},
    ]
    rough = {"friction": {"law": "coulomb", "coefficient": 0.3}}
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
