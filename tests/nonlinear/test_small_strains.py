"""Digits of nonlinear bodies at strains of any size: such a body is a linear one up to its strain, or a finding tells
how large errors may be.
"""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from support.nonlinear_bodies import PLATE, Killed, rectangle, residual
from support.nonlinear_scenes import LAWS, block, material

from signorini_fx import ConvergenceError, Coulomb, Foundation, NonlinearContactProblem, Scene, Status, solve

SCALES = [10.0**-power for power in (3, 7, 8, 10, 12, 14)]
# Terms of the strain beside it: of Saint Venant-Kirchhoff 3.5 strains in the block below.
BESIDE = 10.0
# Round-off of a linear solve, and what an iteration of the exact contact law leaves.
ROUND_OFF, LEFT_BY_CONTACT = 1e-12, 2e-8


def linear_twin(law):
    """The linear material that one of ``LAWS`` is at rest."""
    rest = block(material(law), "t").statement.material[0].at_rest
    return {"young": rest.young, "poisson": rest.poisson}


def apart(one, other):
    """The largest relative difference of two displacements."""
    values, others = (np.array(solution.displacement.x.array) for solution in (one, other))
    return np.abs(values - others).max() / np.abs(others).max()


def of_digits(solution):
    """The findings on digits."""
    return [found for found in solution.findings if "round-off" in found.message]


@pytest.mark.one_quick
@pytest.mark.parametrize("law", LAWS)
def test_a_block_under_a_load_of_any_size(law):
    """It is as far from the linear one as its strain, which round-off of I + grad u would hide from 1e-8 on."""
    for scale in SCALES:
        loads = {
            "displacement": [{"boundary": "bottom", "x": 0.0, "y": 0.0}],
            "traction": [{"boundary": "top", "x": 30.0 * scale, "y": -100.0 * scale}],
        }
        solution, linear = (
            solve(Scene(mesh=block(one, "t").mesh, material=one, **loads), MPI.COMM_SELF, check=False)
            for one in (material(law), linear_twin(law))
        )
        assert apart(solution, linear) <= BESIDE * scale + ROUND_OFF
        assert not of_digits(solution)


@pytest.mark.one_quick
@pytest.mark.parametrize("contact", ["plane", "kept partners", "sliding"])
def test_contact_at_displacements_of_any_size(contact):
    """Gaps of the undeformed bodies keep their digits; what is met at displaced points has those of its coordinates,
    and a finding says how many.
    """
    large = {"generator": "rectangle", "parameters": {"length": 1.5, "height": 0.5, "nx": 7, "ny": 2}}
    small = {"generator": "rectangle", "parameters": {"length": 1.0, "height": 0.5, "nx": 6, "ny": 3}}
    plate = {"shape": "plane", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
    rough = {"friction": {"law": "coulomb", "coefficient": 0.3}}
    for scale in SCALES:
        if contact == "plane":
            one = {
                "mesh": small,
                "displacement": [{"boundary": "left", "x": 0.0}],
                "traction": [{"boundary": "top", "y": -100.0 * scale}],
                "contact": [{"boundary": "bottom", "foundation": plate} | rough],
            }
        else:
            sliding = {"sliding": "small"} if contact == "kept partners" else {}
            one = {
                "body": [{"name": "u", "mesh": small, "shift": [0.2, 0.5]}, {"name": "l", "mesh": large}],
                "displacement": [
                    {"boundary": "u.top", "x": 0.2 * scale, "y": -0.5 * scale},
                    {"boundary": "l.bottom", "x": 0.0, "y": 0.0},
                ],
                "contact": [{"boundary": "u.bottom", "against": "l.top"} | sliding | rough],
            }
        pairs = []
        for law in (material("neo-hooke"), linear_twin("neo-hooke")):
            entries = [
                {key: value for key, value in entry.items() if key != "sliding" or "law" in law}
                for entry in one["contact"]
            ]
            scene = Scene(**{**one, "contact": entries}, material=law, solver={"algorithm": "alm"})
            pairs.append(solve(scene, MPI.COMM_SELF, check=False))
        error = apart(*pairs)
        known = BESIDE * scale + LEFT_BY_CONTACT
        told = of_digits(pairs[0])
        if contact == "kept partners":
            assert error <= known
            assert not told
        else:
            placed = pairs[0].certificate.placed
            assert error <= known + placed
            assert bool(told) == (placed > 1e-6)


def lossy(h, one):
    """The strain of a residual that adds I to grad u."""
    return one + h, ((one + h).T * (one + h) - one) / 2


def own_block(change, scale, comm=MPI.COMM_SELF):
    """A block of Saint Venant-Kirchhoff's material with a residual of one's own, its load, and a linear one.

    Args:
        change: gives F and E from grad u and I.
        scale: of the load.
        comm: the ranks.
    """
    mesh = dmesh.create_rectangle(comm, [[0, 0], [1, 0.5]], [6, 3], dmesh.CellType.quadrilateral)
    space = fem.functionspace(mesh, ("Lagrange", 1, (2,)))
    u, v, identity = fem.Function(space), ufl.TestFunction(space), ufl.Identity(2)
    mu, lame = 100 / 2.6, 100 * 0.3 / (1.3 * 0.4)
    top = np.sort(dmesh.locate_entities_boundary(mesh, 1, lambda x: np.isclose(x[1], 0.5)))
    ds = ufl.Measure("ds", mesh, subdomain_data=dmesh.meshtags(mesh, 1, top, np.full(top.size, 1, dtype=np.int32)))
    load = fem.Constant(mesh, (30.0 * scale, -100.0 * scale))
    held = fem.locate_dofs_geometrical(space, lambda x: np.isclose(x[1], 0.0))
    bcs = [fem.dirichletbc(np.zeros(2), held, space)]

    def hooke(strain):
        return 2 * mu * strain + lame * ufl.tr(strain) * identity

    gradient, strain = change(ufl.grad(u), identity)
    work = ufl.inner(gradient * hooke(strain), ufl.grad(v)) * ufl.dx - ufl.inner(load, v) * ds(1)
    nonlinear = NonlinearContactProblem(work, u, bcs=bcs)
    work = ufl.inner(hooke(ufl.sym(ufl.grad(u))), ufl.grad(v)) * ufl.dx - ufl.inner(load, v) * ds(1)
    return nonlinear, load, NonlinearContactProblem(work, u, bcs=bcs)


def own_residual(change, scale):
    """Its solution, its load, and how far it is from the linear one; for the arguments see ``own_block``."""
    nonlinear, load, linear = own_block(change, scale)
    u = nonlinear.solve()
    values = u.x.array.copy()
    u.x.array[:] = 0.0
    linear.solve()
    assert not linear.findings
    error = np.abs(values - u.x.array).max() / np.abs(u.x.array).max()
    return nonlinear, load, error


def test_a_residual_of_ones_own_that_loses_digits():
    """The difference of F^T F and I has the round-off of one: the error that it may cause is told, and is not smaller
    than the one that there is; a strain from grad u has none.
    """
    for scale in SCALES:
        lost, _, error = own_residual(lossy, scale)
        assert error <= BESIDE * scale + lost.certificate.lost + ROUND_OFF
        assert bool(lost.findings) == (lost.certificate.lost > 1e-6)
        assert lost.findings or scale > 1e-8
        careful, _, error = own_residual(lambda h, one: (one + h, (h + h.T + h.T * h) / 2), scale)
        assert error <= BESIDE * scale + ROUND_OFF
        assert not careful.findings


def test_a_body_that_comes_back_to_rest():
    """Beside what it was loaded by, its round-off is nothing, and no finding speaks of it."""
    problem, load, _ = own_residual(lossy, 1e-3)
    full = load.value.copy()

    def apply(time):
        load.value[:] = full * (1 - abs(time - 1))

    problem.run([1.0, 2.0], apply)
    assert np.abs(problem.u.x.array).max() < 1e-14
    assert not problem.findings


def along(problem, load, factors):
    """Load steps with these factors of the load."""
    full = load.value.copy()

    def apply(time):
        load.value[:] = full * np.interp(time, range(len(factors)), factors)

    return problem.run(np.arange(1.0, len(factors)), apply)


@pytest.mark.parametrize("scale", [1e-15, 3e-15])
@pytest.mark.parametrize("factors", [None, (0, 1), (0, 0.8, 1), (0, 1, 0), (0, 0, 1)])
def test_a_body_of_which_no_digit_is_known(scale, factors):
    """The check after the solve would accept the body at rest: the outcome has a name, of a solve and of load steps,
    and there are no figures of it.
    """
    problem, load, _ = own_block(lossy, scale)
    with pytest.raises(ConvergenceError, match="no digit known: round-off"):
        problem.solve() if factors is None else along(problem, load, factors)
    assert problem.status is Status.NO_DIGIT
    if factors is None:
        assert not problem.u.x.array.any()
    else:
        assert problem.solution.status is Status.NO_DIGIT
        assert [step.status for step in problem.solution.steps] == [Status.NO_DIGIT]


@pytest.mark.mpi
def test_runs_of_which_no_digit_is_known_are_gone_on_with(tmp_path):
    """A run that was killed ends as it would have ended, and another ramp is judged by what it does: one that goes
    back to rest, or by a load that tells, is a solution, and one that goes where nothing is known is none.
    """
    folder = Path(MPI.COMM_WORLD.bcast(str(tmp_path)))

    def begun(scale=2e-15):
        problem, load, _ = own_block(lossy, scale, MPI.COMM_WORLD)
        full = load.value.copy()

        def apply(time):
            load.value[:] = full * time

        return problem, apply

    def kill(step):
        if step.step == 2:
            raise Killed

    times = [0.5, 0.7, 1.0]
    problem, apply = begun()
    with pytest.raises(Killed):
        problem.run(times, apply, folder=folder, on_step=kill)
    problem, apply = begun()
    with pytest.raises(ConvergenceError, match="no digit known"):
        problem.run(times, apply, folder=folder, restart=True)
    assert problem.history.events[0].startswith("restart: 1 complete load step ")
    assert [step.status for step in problem.solution.steps] == [Status.NO_DIGIT]
    problem, apply = begun()
    at = 0.0
    for to, known in ((1.0, False), (0.0, True), (1.0, False), (1e12, True), (0.0, True), (1.0, True)):
        way = partial(lambda load, at, to: apply(at + (to - at) * load), at=at, to=to)
        if known:
            problem.ramp(way, first=0.5)
        else:
            with pytest.raises(ConvergenceError, match="no digit known"):
                problem.ramp(way, first=0.5)
        assert problem.status is (Status.CONVERGED if known else Status.NO_DIGIT)
        at = to


@pytest.mark.parametrize("factors", [(0, 1e-12, 1), (0, 1, 1e-12), (0, 0, 1), (0, 1, 0, 0)])
def test_steps_of_round_off_beside_others(factors):
    """A body that begins or comes back to where nothing is known of it, or to rest, and one without load in a step."""
    problem, load, _ = own_block(lossy, 1e-3)
    assert along(problem, load, factors).converged


@pytest.mark.parametrize("advances", [True, False])
@pytest.mark.parametrize("change", [lossy, lambda h, one: (one, ufl.sym(h))], ids=["finite", "linear"])
def test_steps_without_load(change, advances):
    """A body that nothing moves is where it was; a loop that ends at rest, too, whether the residual has the round-off
    of I + grad u or none but that of the displacement.
    """
    problem, load, _ = own_block(change, 1e-3)
    full = load.value.copy()
    for factor in (0.0, 1.0, 0.0, 0.0, 1e-14, 0.0):
        load.value[:] = factor * full
        problem.solve()
        assert problem.status is Status.CONVERGED
        assert factor or np.abs(problem.u.x.array).max() < 1e-16
        if advances:
            problem.advance()
    problem, load, _ = own_block(change, 0.0)
    assert along(problem, load, (0, 1, 1)).converged
    assert not problem.u.x.array.any()


def test_forces_that_are_one_unit_of_round_off_are_no_load():
    """A body without load has such ones: they are not told from a load of this size, which a finding tells of."""
    problem, _, _ = own_block(lossy, 1e-17)
    problem.solve()
    assert problem.status is Status.CONVERGED
    assert of_digits(problem)


@pytest.mark.parametrize("scale", [1e-13, 2e-16, 1e-17])
def test_displacements_below_the_round_off_of_places(scale):
    """Bodies that are moved by less than the digits of the coordinates at which they meet; by what is round-off of a
    way as long as they are, they are not moved, and a finding tells of it.
    """
    one = {"generator": "rectangle", "parameters": {"length": 1.0, "height": 0.5, "nx": 4, "ny": 2}}
    scene = Scene(
        body=[{"name": "u", "mesh": one, "shift": [0.2, 0.5]}, {"name": "l", "mesh": one}],
        material=material("neo-hooke"),
        displacement=[{"boundary": "u.top", "x": 0.0, "y": -scale}, {"boundary": "l.bottom", "x": 0.0, "y": 0.0}],
        contact=[{"boundary": "u.bottom", "against": "l.top"}],
        solver={"algorithm": "alm"},
    )
    found = solve(scene, MPI.COMM_SELF, check=False)
    assert found.status is (Status.NO_DIGIT if scale == 2e-16 else Status.CONVERGED)
    assert scale > 1e-15 or of_digits(found)


def test_a_loop_that_begins_at_a_right_angle():
    """Supports whose way is a cosine begin at 6e-17 of it: each step is that of a loop that begins at zero, of a lone
    solve and of a load path of a scene.
    """
    space, side = rectangle([2.0, 1.0], [8, 4], MPI.COMM_SELF)
    forces = []
    for first in (np.cos(np.pi / 2), 0.0):
        u, drive = fem.Function(space), fem.Constant(space.mesh, (0.0, 0.0))
        bottom = fem.locate_dofs_topological(space, 1, side(1, 0.0))
        contact = Foundation(side(1, 1.0), shape=PLATE, friction=Coulomb(0.3))
        problem = NonlinearContactProblem(residual(u), u, bcs=[fem.dirichletbc(drive, bottom, space)], contact=contact)
        for factor in (first, 0.7, 1.0, 0.7, -first, 0.4):
            drive.value[:] = 0.01 * factor, 0.02 * factor
            problem.solve()
            problem.advance()
            assert problem.status is Status.CONVERGED
            forces.append(sum(problem.state.forces))
    turned, straight = np.split(np.array(forces), 2)
    assert turned == pytest.approx(straight, abs=1e-9 * np.abs(straight).max())
    way = {"boundary": "bottom", "x": 0.0, "y": 0.02, "factors": [float(np.cos(np.pi / 2)), 0.7, 0.0]}
    scene = block(material("neo-hooke"), "0.0", displacement=[way])
    assert solve(scene, MPI.COMM_SELF, check=False).converged


def test_contact_that_comes_and_goes():
    """A circle reaches a body at rest, and leaves it at rest again: contact alone has moved it, by digits that are
    known, and all load steps are there.
    """
    circle = {
        "shape": "circle",
        "centre": [0.5, 1.51],
        "radius": 0.5,
        "shift": [0.0, "-0.03 * (t if t <= 1 else 2 - t)"],
    }
    solution = solve(block(material("neo-hooke"), "", foundation=circle, load_steps={"times": [0.2, 1.0, 2.0]}))
    assert [step.status for step in solution.steps] == [Status.CONVERGED] * 3
    moved = [np.abs(step.displacement.x.array).max() for step in solution.steps]
    assert moved[0] == 0.0
    assert moved[1] > 1e-3
    assert moved[2] < 1e-14
