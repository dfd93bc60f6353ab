"""A load step of a nonlinear body depends on the state before it and on nothing else: any step
again, in a fresh problem, from a file.
"""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI
from numpy.testing import assert_allclose
from parameters import slow
from scene_tables import circle_shape, coulomb_friction
from scenes import alone
from step_effects import Wear, solve_on
from support.nonlinear_bodies import Killed, held, rectangle, residual
from support.nonlinear_scenes import indented
from test_nonlinear_scenes_of_two_bodies import two_blocks
from test_restart_of_nonlinear_bodies import LAWS, pressed, shared

from signorini_fx import (
    Coulomb,
    FormError,
    Foundation,
    NonlinearContactProblem,
    SceneError,
    build_problem,
)
from signorini_fx.mechanics.state import State
from signorini_fx.records import Status, StepRecord

ROUGH = {"friction": coulomb_friction(0.3)}
# A roller that force, moment and springs move and turn.
TURNED = {
    "shape": "circle",
    "centre": [0.8, 1.5],
    "radius": 0.5,
    "pivot": [0.8, 1.5],
    "force": ["0.2 * (t - 1)", "-1.5"],
    "moment": "0.1 * (t - 1)",
    "spring": {"x": 5.0, "y": 5.0, "rotation": 2.0},
}
SCENES = {
    "rubber": lambda: pressed("rubber", steps=1),
    "metal": lambda: pressed("metal", steps=1),
    "metal by newton": lambda: pressed("metal", steps=1, solver={"coulomb": "newton"}),
    "relaxing": lambda: pressed(
        "rubber",
        steps=1,
        material={"law": "maxwell", "young": 100.0, "poisson": 0.3, "branches": [[50.0, 1.0]]},
    ),
    "roller": lambda: pressed("metal", steps=1, driven=True),
    "turned roller": lambda: indented(
        LAWS["metal"],
        cells=(6, 3),
        contact=[{"boundary": "top", "foundation": TURNED, **ROUGH}],
        load_steps={"times": [1.0, 2.0, 3.0]},
    ),
    "bodies": lambda: sliding_blocks(),
    "bodies by newton": lambda: sliding_blocks(coulomb="newton"),
}
QUICK = ("metal", "roller", "bodies", "relaxing")
NAMES = [name if name in QUICK else slow(name) for name in SCENES]


def sliding_blocks(**solver):
    """Two blocks of which the upper one is pressed, pushed along the lower one and back."""
    scene = two_blocks(ROUGH, (0.05, 0.05, 0.05), solver=solver, load_steps={"times": [1, 2, 3]})
    moved = [entry for entry in scene.displacement if entry.boundary != "upper.left"]
    pushed = {"boundary": "upper.top", "x": 0.2, "factors": [0.0, 1.0, 0.5]}
    return scene.model_validate(scene.model_dump() | {"displacement": [*moved, pushed]})


def ends_of(scene, comm=MPI.COMM_WORLD, **more):
    """A problem that has solved all load steps, its states from before the first, and results."""
    problem = build_problem(scene, comm, **more)
    states, results = [problem.initial()], []
    for time in problem.path.times:
        state, result = problem.step(states[-1], time)
        assert result.status.value == "converged"
        states.append(state)
        results.append(result)
    return problem, states, results


def assert_again(found, state, result, tolerance=1e-9):
    """The same displacement, sets, history of the material, and linear solves, of which round-off
    on several ranks may need one more.
    """
    new, again = found
    size = np.abs(state.displacement).max(initial=0.0)
    assert_allclose(new.displacement, state.displacement, rtol=0, atol=tolerance * size)
    assert_allclose(new.rigid, state.rigid, rtol=0, atol=tolerance)
    one, other = new.contact, state.contact
    assert (one.contact == other.contact).all()
    assert ((one.direction != 0).any(axis=1) == (other.direction != 0).any(axis=1)).all()
    for name, field in state.fields.items():
        values = field.values
        size = np.abs(values).max(initial=0.0)
        ours = new.fields[name].values
        assert_allclose(ours, values, rtol=0, atol=10 * tolerance * size)
    assert abs(again.linear_solves - result.linear_solves) <= (MPI.COMM_WORLD.size > 1)
    assert again.certificate.holds


@pytest.mark.parametrize("name", NAMES)
def test_each_step_again(tmp_path, name):
    """In a fresh problem, from a file."""
    scene = SCENES[name]()
    problem, states, results = ends_of(scene, MPI.COMM_SELF)
    for number, result in enumerate(results):
        states[number].save(tmp_path / f"{number}.npz", problem)
        fresh = build_problem(scene, MPI.COMM_SELF)
        state = State.load(tmp_path / f"{number}.npz", fresh)
        assert_again(fresh.step(state, result.time), states[number + 1], result)


def test_what_is_assembled_is_no_state():
    """From last to first, in a problem that has solved other steps before."""
    problem, states, results = ends_of(SCENES["metal"](), MPI.COMM_SELF)
    for number in range(len(results))[::-1]:
        found = problem.step(states[number], results[number].time)
        assert_again(found, states[number + 1], results[number])


@pytest.mark.mpi(slow=True)
@pytest.mark.parametrize("name", ["metal", "roller", "bodies"])
def test_from_one_rank_to_all(tmp_path, name):
    """A state that one rank has written is read on all of them, and the next step is the same."""
    scene, comm = SCENES[name](), MPI.COMM_WORLD
    folder = shared(tmp_path)
    if comm.rank == 0:
        problem, states, _ = ends_of(scene, MPI.COMM_SELF)
        states[1].save(folder / "state.npz", problem)
    comm.barrier()
    problem, states, results = ends_of(scene)
    state = State.load(folder / "state.npz", problem)
    assert_again(problem.step(state, results[1].time), states[2], results[1], tolerance=1e-7)


class Told(Wear):
    """Wear that tells the vertical force of the supports."""

    def figures(self, state, new, ended):
        return {"support": ended.reactions()[:, 1].sum()}


@pytest.mark.mpi
def test_a_solve_goes_on_from_a_state():
    """The steps after a state are those of one run, with what an effect and a metal remember."""
    whole = solve_on(SCENES["metal"](), 2)
    assert whole.state.fields.keys() == {"material 0", "rate", "impulse", "steps"}


def test_wear_of_rubber():
    """A block that a plate presses wears off: by E of small strains the pressure falls by the same
    share in each step, and the certificate holds at the worn gap.
    """
    text = {"contact": {"boundary": "bottom"}, "load_steps": {"times": [1.0, 2.0, 3.0, 4.0]}}
    supports = [{"boundary": "top", "x": 0.0, "y": -1e-3, "factors": [1.0, 1.0, 1.0, 1.0]}]
    law = {"law": "neo-hooke", "young": 10.0, "poisson": 0.0}
    scene = indented(law, cells=(4, 4), **text, displacement=supports)
    solution = alone(scene, effects=[Told(1e-3)])
    found = [step.contact.pressure.mean() for step in solution.steps]
    assert_allclose(found, found[0] * 0.99 ** np.arange(4), rtol=3e-3)
    assert all(step.certificate.holds for step in solution.steps)
    forces = [step.contact.forces[0][1] for step in solution.steps]
    assert [step.figures["support"] for step in solution.steps] == pytest.approx(-np.array(forces))


@pytest.mark.mpi
def test_a_failed_step_changes_nothing():
    """What the user sees is as it was, and the step has its solution afterwards."""
    u, problem, _ = stretched()
    begin = problem.initial()
    problem.place(0, shift=(0.0, -0.05))
    state, first = problem.step(begin, 1.0)
    before = u.x.array.copy()
    problem.place(0, shift=(0.0, -30.0))  # through the whole block
    same, failed = problem.step(state, 2.0)
    assert same is state
    assert failed.status is Status.INSIDE
    assert (u.x.array == before).all()
    problem.place(0, shift=(0.0, -0.05))
    assert_again(problem.step(begin, 1.0), state, first)


def stretched(**more):
    """A block below a circle, with a modulus of its cells that ``commit`` changes."""
    space, side = rectangle([1.0, 1.0], [3, 3], MPI.COMM_WORLD)
    u, v = fem.Function(space), ufl.TestFunction(space)
    cells = fem.functionspace(space.mesh, ("DG", 0))
    softer, now = fem.Function(cells), fem.Function(cells)
    work = residual(u) + softer * ufl.inner(ufl.grad(u), ufl.grad(v)) * ufl.dx
    largest = fem.Expression(ufl.inner(ufl.grad(u), ufl.grad(u)), np.array([[0.5, 0.5]]))

    def commit():
        now.interpolate(largest)
        softer.x.array[:] += now.x.array

    circle = circle_shape((0.5, 1.5), 0.5)
    top = Foundation(side(1, 1.0), shape=circle, friction=Coulomb(0.3))
    more = {"commit": commit, "kept": {"softer": softer}} | more
    bcs = [held(space, side(1, 0.0))]
    return u, NonlinearContactProblem(work, u, bcs=bcs, contact=top, **more), softer


@pytest.mark.mpi
def test_a_history_of_a_users_own(tmp_path):
    """What commit changes is in each state: a step again in a fresh problem, and a restart."""
    file = shared(tmp_path) / "state.npz"
    _, problem, _ = stretched()
    states, results = [problem.initial()], []
    for time in (1.0, 2.0, 3.0):
        problem.place(0, shift=(0.02 * time, -0.03 * time))
        state, result = problem.step(states[-1], time)
        states.append(state)
        results.append(result)
    assert states[2].fields["softer"].values.max() > states[1].fields["softer"].values.max() > 0
    states[2].save(file, problem)
    _, fresh, softer = stretched()
    state = State.load(file, fresh)
    fresh.place(0, shift=(0.06, -0.09))
    assert_again(fresh.step(state, 3.0), states[3], results[2])
    assert softer.x.array.max() > states[2].fields["softer"].values.max()


@pytest.mark.mpi
@pytest.mark.parametrize("kept", [True, False])
def test_restart_with_a_history_of_a_users_own(tmp_path, kept):
    """What is kept in the states is read again; what is kept elsewhere is refused."""
    folder = shared(tmp_path)
    more = {} if kept else {"kept": None}

    def run(problem, **further):
        def at(time):
            problem.place(0, shift=(0.02 * time, -0.03 * time))

        return problem.run((1.0, 2.0, 3.0), at, folder=folder, **further)

    def stop(record):
        if isinstance(record, StepRecord) and record.step == 3:
            raise Killed

    _, problem, _ = stretched(**more)
    problem.history.observers.append(stop)
    with pytest.raises(Killed):
        run(problem)
    u, again, _ = stretched(**more)
    if not kept:
        with pytest.raises(FormError, match="keeps what the material remembers where no state"):
            run(again, restart=True)
        return
    solution = run(again, restart=True)
    assert [step.step for step in solution.steps] == [1, 2, 3]
    reference, whole, _ = stretched()
    for time in (1.0, 2.0, 3.0):
        whole.place(0, shift=(0.02 * time, -0.03 * time))
        whole.solve()
        whole.advance()
    assert_allclose(u.x.array, reference.x.array, rtol=0, atol=1e-12)
    assert (solution.state.number, solution.state.time) == (3, 3.0)


def test_a_run_after_a_loop_of_a_users_own():
    """It begins where the last step has ended, also with a history that no state has; from another
    state no step begins.
    """
    _, problem, _ = stretched(kept=None)
    begin = problem.initial()
    problem.place(0, shift=(0.0, -0.02))
    _, result = problem.step(begin, 0.5)
    assert result.status is Status.CONVERGED
    for depth in (0.03, 0.05):
        problem.place(0, shift=(0.0, -depth))
        problem.solve()
        if depth < 0.05:
            problem.advance()
    solution = problem.run((2.0, 3.0), lambda time: problem.place(0, shift=(0.0, -0.03 * time)))
    assert solution.converged
    with pytest.raises(FormError, match="keeps what the material remembers where no state"):
        problem.step(begin, 1.0)


def test_a_state_of_another_material():
    """It has no such history."""
    problem = build_problem(pressed("rubber", steps=1))
    state, _ = problem.step(problem.initial(), 1.0)
    with pytest.raises(SceneError, match="is that of another material: it has no such material 0"):
        build_problem(pressed("metal", steps=1)).step(state, 2.0)
