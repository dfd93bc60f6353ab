"""A load step depends on the state before it and on nothing else: any step again, in a fresh problem, from a file."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from forms import Block
from mpi4py import MPI
from numpy.testing import assert_allclose, assert_array_equal
from parameters import slow
from scenes import alone
from step_effects import (
    Counted,
    ErodedContact,
    ErodedContacts,
    ErodedFoundation,
    Erosion,
    Wear,
    solve_on,
)
from test_restart import CASES, METHODS, MOVING, PUSHED, Killed, scene, until

from signorini_fx import (
    Contact,
    ContactProblem,
    Coulomb,
    Foundation,
    build_problem,
    extensions,
    solve,
)
from signorini_fx.algebra.linalg.schur import SchurComplement
from signorini_fx.errors import FormError, SceneError
from signorini_fx.mechanics.state import State
from signorini_fx.records import History
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import read_scene
from signorini_fx.solving.increments import Increments
from signorini_fx.solving.load_path import run
from signorini_fx.solving.solve_on_mesh import stated_problem
from signorini_fx.solving.step import step

# Supports that hold in some load steps only, a gap and friction that depend on the time.
RELEASED = """
mesh = { generator = "rectangle", parameters = { length = 3.0, nx = 12, ny = 4 } }
material = { young = 5000.0, poisson = 0.3 }
load_steps = { times = [1.0, 2.0, 3.0, 4.0] }
[[displacement]]
boundary = "left"
x = 0.0
holds = [true, true, false, false]
[[traction]]
boundary = "top"
y = -20.0
x = "3 * (t - 1)"
[[contact]]
boundary = "bottom"
gap = "0.001 * t * x[0]"
friction = { law = "coulomb", coefficient = "0.2 + 0.1 * t" }
"""
BODIES = """
material = { young = 5000.0, poisson = 0.3 }
[[body]]
name = "lower"
mesh = { generator = "rectangle", parameters = { length = 3.0, height = 1.0, nx = 9, ny = 3 } }
[[body]]
name = "upper"
mesh = { generator = "rectangle", parameters = { length = 2.0, height = 1.0, nx = 8, ny = 4 } }
shift = [0.5, 1.0]
[[displacement]]
boundary = "lower.bottom"
x = 0.0
y = 0.0
[[displacement]]
boundary = "upper.top"
x = 0.004
factors = [0.0, 0.5, 1.0, -0.5]
[[displacement]]
boundary = "upper.top"
y = -0.02
[[contact]]
boundary = "upper.bottom"
against = "lower.top"
friction = { law = "coulomb", coefficient = 0.3 }
"""
TEXTS = {name: (text, method) for name, (text, method, _) in CASES.items() if method != "krylov"}
TEXTS |= {"released": (RELEASED, "fp"), "bodies": (BODIES, "fp")}
TEXTS["mixed bodies"] = (
    BODIES.replace(
        "material = { young = 5000.0, poisson = 0.3 }",
        'element = { degree = 2, volumetric = "mixed" }\n'
        'material = [{ region = "lower", young = 5000.0, poisson = 0.49 }, '
        '{ region = "upper", young = 2000.0, poisson = 0.3 }]',
    ),
    "fp",
)
DEMOS = ("bolted_joint", "press_and_slide")
QUICK = (
    "fp",
    "moving",
    "released",
    "bodies",
    "tool",
    "reference motion",
    "mixed",
    "torn",
    "heated",
    "warming",
    "seeping",
)
NAMES = [name if name in QUICK else slow(name) for name in TEXTS]


def fresh(given, comm=MPI.COMM_WORLD):
    """A problem of which nothing has been solved."""
    return stated_problem(given.statement, partial(load_mesh, given, comm), History())


def solved(given, comm=MPI.COMM_WORLD):
    """Its states from before the first load step, and the reports of the steps."""
    problem = fresh(given, comm)
    begin = problem.initial()
    ends = list(run(problem, begin, Increments(problem.path, given.statement.solver)))
    assert ends[-1][1].result.status.value == "converged"
    return problem, [begin, *(state for state, _ in ends)], [report for _, report in ends]


def assert_again(state, report, other, reference, tolerance=1e-9):
    """The same displacement, sets, and linear solves."""
    size = np.abs(other.displacement).max(initial=0.0)
    assert_allclose(state.displacement, other.displacement, rtol=0, atol=tolerance * size)
    assert (state.contact.contact == other.contact.contact).all()
    slips, slipped = ((one.contact.direction != 0).any(axis=1) for one in (state, other))
    assert (slips == slipped).all()
    assert report.result.linear_solves == reference.result.linear_solves
    assert report.result.certificate.holds


def again(given, tmp_path):
    """Each step from a file with the state before it."""
    problem, states, reports = solved(given)
    for number, report in enumerate(reports):
        states[number].save(tmp_path / f"{number}.npz", problem)
        renewed = fresh(given)
        state = State.load(tmp_path / f"{number}.npz", renewed)
        new, found = step(renewed, state, report.start.place)
        assert_again(new, found, states[number + 1], report)


@pytest.mark.parametrize("name", NAMES)
def test_each_step_again(tmp_path, name):
    """In a fresh problem, from a file."""
    text, method = TEXTS[name]
    again(scene(text, **METHODS[method]), tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", DEMOS)
def test_each_step_of_a_demo_again(tmp_path, name):
    """In a fresh problem, from a file; forces have shortened the bolts."""
    again(read_scene(f"demos/scenes/{name}.toml"), tmp_path)


@pytest.mark.parametrize("name", ["moving", "released", "bodies"])
def test_what_is_assembled_is_no_state(name):
    """From last to first, in a problem that has solved other steps before."""
    text, method = TEXTS[name]
    given = scene(text, **METHODS[method])
    problem, states, reports = solved(given)
    for number in range(len(reports))[::-1]:
        new, found = step(problem, states[number], reports[number].start.place)
        assert_again(new, found, states[number + 1], reports[number])


@pytest.mark.mpi(slow=True)
@pytest.mark.parametrize("name", ["tool", "moving", "bodies", "mixed", "torn", "warming"])
def test_from_one_rank_to_all(tmp_path, name):
    """A state that one rank has written is read on all of them, and the next step is the same."""
    text, method = TEXTS[name]
    given, comm = scene(text, **METHODS[method]), MPI.COMM_WORLD
    folder = comm.bcast(tmp_path)
    if comm.rank == 0:
        problem, states, _ = solved(given, MPI.COMM_SELF)
        states[1].save(folder / "state.npz", problem)
    comm.barrier()
    problem, states, reports = solved(given)
    state = State.load(folder / "state.npz", problem)
    new, report = step(problem, state, reports[1].start.place)
    assert_again(new, report, states[2], reports[1], tolerance=1e-8)


def test_branches():
    """What was found of a step stays as it is when the same step is solved from another state."""
    given = scene(TEXTS["warming"][0], **METHODS["newton"])
    problem, states, (_, report, *_) = solved(given)
    expected = report.mechanics.stress(report.result.displacement, report.start.place)
    expected = expected.tensor.x.array.copy()
    apart, _ = step(problem, states[0], report.start.place)
    assert np.abs(apart.displacement - states[2].displacement).max() > 1e-6
    found = report.mechanics.stress(report.result.displacement, report.start.place)
    np.testing.assert_array_equal(found.tensor.x.array, expected)
    new, once = step(fresh(given), states[1], report.start.place)
    assert_again(new, once, states[2], report)
    found = once.mechanics.stress(once.result.displacement, once.start.place)
    np.testing.assert_allclose(found.tensor.x.array, expected, rtol=1e-8, atol=1e-8)


def test_a_failed_step_changes_nothing():
    """The state before it is as it was, and the step has its solution afterwards."""
    given = scene(PUSHED)
    problem, states, reports = solved(given)
    (begin, end), (report, *_) = states[3:5], reports[3:]
    assert report.result.linear_solves > 2
    before = begin.displacement.copy()
    _, failed = step(problem, begin, report.start.place, budget=1)
    assert failed.result.status.value != "converged"
    assert (begin.displacement == before).all()
    with pytest.raises(ValueError, match="read-only"):
        begin.displacement[0] = 1.0
    assert_again(*step(problem, begin, report.start.place), end, report)


def test_fields_go_along(tmp_path):
    """What a user adds to a state stays in it, also in a file."""
    given = scene(PUSHED)
    problem, states, reports = solved(given)
    begin = states[1].with_field("wear", "points", np.arange(states[1].contact.pressure.size))
    begin = begin.with_field(
        "dose", "cells", np.arange(problem.model.tagged.mesh.topology.index_map(2).size_local)
    )
    begin = begin.with_field("clock", "global", [3.0])
    new, _ = step(problem, begin, reports[1].start.place)
    new.save(tmp_path / "state.npz", problem)
    read = State.load(tmp_path / "state.npz", problem)
    assert {name: entry.at for name, entry in read.fields.items()} == {
        "wear": "points",
        "dose": "cells",
        "clock": "global",
    }
    for name, entry in begin.fields.items():
        assert (read.fields[name].values == entry.values).all()
    for name in ("displacement", "rigid"):
        assert (getattr(read, name) == getattr(new, name)).all()
    assert (read.placed, read.gammas, read.number, read.time) == (
        new.placed,
        new.gammas,
        2,
        new.time,
    )


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda file: file.write_bytes(b"nothing"), "is no state of this mesh and contact"),
        (lambda file: file.unlink(), "is no state of this mesh and contact"),
    ],
)
def test_what_is_no_state(tmp_path, change, reason):
    """One error that says so."""
    given, file = scene(PUSHED), tmp_path / "state.npz"
    problem = fresh(given)
    problem.initial().save(file, problem)
    change(file)
    with pytest.raises(SceneError, match=reason):
        State.load(file, problem)
    problem.initial().save(file, problem)
    finer = fresh(scene(PUSHED.replace("nx = 24", "nx = 25")))
    with pytest.raises(SceneError, match="it is of another mesh"):
        State.load(file, finer)


@pytest.fixture
def schur_complements(monkeypatch):
    """Those that are made."""
    made, begin = [], SchurComplement.__init__

    def counted(self, *args, **options):
        made.append(self)
        begin(self, *args, **options)

    monkeypatch.setattr(SchurComplement, "__init__", counted)
    return made


def test_an_obstacle_that_moves_is_condensed_once(schur_complements):
    """The stiffness of the body stays the same: one Schur complement for four problems."""
    _, _, reports = solved(scene(MOVING, linear_algebra="condensed"), MPI.COMM_SELF)
    assert len(reports) == 3
    assert len({id(report.posed.task) for report in reports}) == 3
    assert len(schur_complements) == 1


def test_a_foundation_that_is_placed_anew_is_condensed_once(schur_complements):
    """Likewise in a loop of a user's own."""
    block = Block((12, 4), comm=MPI.COMM_SELF)
    circle = {"shape": "circle", "centre": (1.2, -2.0), "radius": 2.0}
    rounded = Foundation(block.bottom, shape=circle, friction=Coulomb(0.3))
    settings = {"linear_algebra": "condensed"}
    problem = ContactProblem(block.a, block.L, block.bcs, rounded, **settings)
    for shift in np.linspace(0.0, 0.01, 4):
        problem.place(0, shift=(shift, shift))
        problem.solve()
        problem.advance()
    assert problem.certificate.holds
    assert len(schur_complements) == 1


# --- what a user calls ----------------------------------------------------------------------------


@pytest.mark.mpi
def test_a_solve_goes_on_from_a_state():
    """The steps after a state are those of one run."""
    solve_on(scene(PUSHED), 3)


@pytest.mark.mpi(slow=True)
def test_fields_survive_a_restart(tmp_path):
    """Those of an effect, on any number of ranks."""
    folder, given = MPI.COMM_WORLD.bcast(tmp_path), scene(PUSHED)
    if MPI.COMM_WORLD.rank == 0:
        how = {"effects": [Counted()], "observers": [until(4)], "checkpoint": folder}
        with pytest.raises(Killed):
            alone(given, **how)
    MPI.COMM_WORLD.barrier()
    ended = solve(given, checkpoint=folder, restart=True, effects=[Counted()])
    whole = solve(given, effects=[Counted()])
    assert ended.state.fields["steps"].values == [6.0]
    for name, field in whole.state.fields.items():
        assert_allclose(ended.state.fields[name].values, field.values, rtol=1e-7)


def test_wear_in_scenes_and_forms():
    """A plate that is pressed by a prescribed displacement wears off: its pressure falls by the
    same share in each step, and the certificate holds at the worn gap.
    """
    text = """
    mesh = { generator = "rectangle", parameters = { nx = 4, ny = 4 } }
    material = { young = 1000.0, poisson = 0.0 }
    [[displacement]]
    boundary = "top"
    x = 0.0
    y = -0.01
    factors = [1.0, 1.0, 1.0, 1.0]
    [[contact]]
    boundary = "bottom"
    """
    solution = solve(scene(text), effects=[Wear(1e-5)])
    found = [step.contact.pressure.mean() for step in solution.steps]
    # E / H times what is left of the displacement; gamma is 1e3 of it.
    assert_allclose(found, 10.0 * 0.99 ** np.arange(4), rtol=2e-3)
    assert all(step.certificate.holds for step in solution.steps)
    block = Block((4, 4))
    problem = ContactProblem(block.a, block.L, block.bcs, block.foundation, effects=[Wear(1e-5)])
    state, pressures = problem.initial(), []
    for time in range(3):
        state, result = problem.step(state, float(time))
        pressures.append(result.contact.pressure.mean())
        assert result.certificate.holds
    ratio = np.array(pressures[1:]) / pressures[:-1]
    assert (ratio < 0.995).all()
    assert ratio[0] == pytest.approx(ratio[1], rel=1e-3)


def test_a_part_of_a_contact(monkeypatch):
    """A table within a contact, and its step effect, are found by their names; a scene and forms
    with it are worn as by the effect itself, and what is wrong in it names its key.
    """
    monkeypatch.setattr(extensions, "_registered", {})
    extensions.register("signorini_fx.contact_parts", "erosion", Erosion)
    extensions.register("signorini_fx.step_effects", "erosion", ErodedContacts)
    (stated,) = scene(PUSHED).contact
    eroded = ErodedContact(**dict(stated), erosion={"rate": 1e-5})
    given = scene(PUSHED).model_copy(update={"contact": eroded})
    expected = solve(scene(PUSHED), effects=[Wear(1e-5)]).state.fields["worn"].values
    assert_array_equal(solve(given).state.fields["worn"].values, expected)
    with pytest.raises(SceneError, match=r"erosion\.rate.*greater than 0"):
        ErodedContact(boundary="bottom", erosion={"rate": -1.0})
    with pytest.raises(SceneError, match="erosion: must be a table"):
        ErodedContact(boundary="bottom", erosion=3)
    with pytest.raises(SceneError, match="erosion: unknown key"):
        Contact(boundary="bottom", erosion={"rate": 1e-5})

    block = Block((4, 4))
    worn = []
    for more in (
        {"contact": replace(block.foundation), "effects": [Wear(1e-5)]},
        {"contact": ErodedFoundation(block.foundation.facets, erosion=Erosion(rate=1e-5))},
    ):
        problem = ContactProblem(block.a, block.L, block.bcs, **more)
        worn.append(problem.step(problem.initial(), 1.0)[0].fields["worn"].values)
    assert_array_equal(*worn)
    wrong = ErodedFoundation(block.foundation.facets, erosion=1e-5)
    with pytest.raises(FormError, match=r"contact\[0\]\.erosion.*Erosion\(...\), not float"):
        ContactProblem(block.a, block.L, block.bcs, wrong)


def test_an_effect_by_its_name(monkeypatch):
    """As another package adds it."""
    monkeypatch.setattr(extensions, "_registered", {})
    extensions.register("signorini_fx.step_effects", "count", Counted)
    assert solve(scene(PUSHED), effects=["count"]).state.fields["steps"].values == [6.0]
    with pytest.raises(TypeError, match="objects of StepEffect are expected"):
        solve(scene(PUSHED), effects=[3])


@pytest.mark.parametrize(
    ("use", "reason"),
    [
        (lambda problem, state: problem.step(state, 2.0), "must be after that of the state, 2"),
        (lambda problem, state: problem.step(state, 2.5), "no load step ends at time 2.5"),
        (lambda problem, state: solve(FINER, state=state), "is of another mesh"),
        (lambda problem, state: solve(SHORTER, state=state), "must be after that of the state, 2"),
        (lambda problem, state: build_problem(FINER).step(state, 3.0), "is of another mesh"),
        (lambda problem, state: Block().problem.step(state, 3.0), "is of another mesh"),
        (lambda problem, state: Block().problem.step(state, 1.0), "must be after that"),
        (lambda problem, state: state.with_field("a", "point", [1.0]), "must be at one of dofs"),
        (lambda problem, state: state.with_field("a", "points", [1.0]), "has 1 rows"),
    ],
)
def test_what_a_state_is_not_for(use, reason):
    """One error that says so."""
    problem = build_problem(scene(PUSHED))
    state = problem.initial()
    for time in (1.0, 2.0):
        state, _ = problem.step(state, time)
    with pytest.raises(SceneError, match=reason):
        use(problem, state)


FINER = scene(PUSHED.replace("nx = 24", "nx = 25"))
SHORTER = scene(PUSHED.replace("[0.0, 0.4, 0.8, 1.0, 0.5, -0.4]", "[0.0, 0.4]"))
