"""Load steps with names and times, and ramps that find their own increments."""

import csv
import json
from xml.etree import ElementTree

import numpy as np
import pytest
from mpi4py import MPI
from scenes import alone
from test_fields import arrays_of
from test_load_steps import LENGTH, LIMIT, PRESSURE, block, friction_force

from signorini_fx.addons.pictures.load_steps import load_steps
from signorini_fx.addons.pictures.moving_body import MOST_FRAMES, shown
from signorini_fx.addons.report.page import write_report
from signorini_fx.algebra.linalg import callbacks
from signorini_fx.errors import FormError, SceneError
from signorini_fx.mechanics.statement.load_path import LoadPath, factor_at
from signorini_fx.mechanics.statement.settings import SolverSettings
from signorini_fx.records import Status, StepRecord
from signorini_fx.results.files import write_results
from signorini_fx.results.solution import ConvergenceError
from signorini_fx.results.summary import render, table_row
from signorini_fx.scenes.cli import main
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve
from signorini_fx.solving.ramp import Increments
from signorini_fx.tuned import EASY_STEP, ENCLOSED, FAILED_RAMP, FAILED_STEP


def ramp(push, steps=10, *, factors=(0.0, 1.0), nx=30, friction=None, load_steps=None, **solver):
    """Pressed in full, then pushed on its left side up to ``push`` times the limit of friction."""
    pushed = {"boundary": "left", "x": push * LIMIT, "factors": list(factors)}
    scene = {
        "traction": [{"boundary": "top", "y": -PRESSURE}, pushed],
        "load_steps": {"steps": steps, "times": list(map(float, range(len(factors))))} | (load_steps or {}),
    }
    return block(nx, scene, **solver)


def increments(scene):
    return Increments(scene.statement.path, scene.solver, may_augment=scene.statement.has_coulomb)


def test_factors_between_load_steps():
    """Linear from factor to factor, and from nothing to the first one."""
    factors = (2.0, 4.0, 0.0)
    places = (-1.0, -0.5, 0.0, 0.25, 1.0, 1.5, 2.0)
    assert [factor_at(factors, place) for place in places] == [0.0, 1.0, 2.0, 2.5, 4.0, 2.0, 0.0]


@pytest.mark.parametrize(
    ("times", "third"), [((0.0, 1.0), "0.3333333333"), ((0.0, 1e-6), "3.333333333e-07"), ((1e5, 103600.0), "101200.0")]
)
def test_times_have_no_digits_of_round_off(times, third):
    """The places of a ramp of three increments are not exact; the times say no more than they know, in any unit."""
    scene = ramp(0.5, 3, load_steps={"times": list(times)})
    assert repr(scene.statement.time_at(0.333333333334)) == third
    assert [scene.statement.time_at(place) for place in (0.0, 1.0)] == list(times)


def test_a_path_without_a_scene():
    """Times and names of places between load steps, as a scene has them."""
    path, scene = LoadPath((0.5, 2.0), ("press", "push"), steps=2, from_nothing=True), ramp(0.5)
    assert [path.time_at(place) for place in (-0.5, 0.0, 0.5)] == [0.25, 0.5, 1.25]
    assert [path.name_at(place) for place in (-0.5, 0.0, 0.5)] == ["press", "press", "push"]
    assert scene.statement.path == LoadPath((0.0, 1.0), steps=10)
    assert walk(Increments(path, SolverSettings(), may_augment=False), 9.0) == [-0.5, 0.0, 1.0]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"times": ()}, "times"),
        ({"times": (1.0, 1.0)}, "increase"),
        ({"times": (0.0, np.inf)}, "finite"),
        ({"times": (1.0, 2.0), "names": ("push",)}, "1 entries"),
        ({"times": (1.0,), "steps": 0}, "whole number"),
        ({"times": (1.0,), "from_nothing": True}, "give steps"),
        ({"times": (0.0, 1.0), "steps": 2, "from_nothing": True}, "positive"),
    ],
)
def test_bad_paths(arguments, message):
    with pytest.raises(FormError, match=message):
        LoadPath(**arguments)


# --- a limit load ----------------------------------------------------------------------------------------------------


@pytest.mark.one_quick
@pytest.mark.mpi
@pytest.mark.parametrize("push", [1.2, 40.0])
@pytest.mark.parametrize("method", [{}, {"coulomb": "newton"}, {"algorithm": "alm"}])
def test_limit_load(push, method):
    """Statics: the block slides at F times the normal force; the ramp ends within 1 % of that, with a certificate."""
    solution = solve(ramp(push, nx=18, **method), check=False)
    assert solution.status is Status.SLIDES
    last, failed = solution.last_step, solution.steps[-1]
    assert failed.linear_solves == 0  # statics proves it
    assert 0.99 / push <= last.time <= 1 / push < failed.time <= 1.01 / push
    assert friction_force(last.contact) == pytest.approx(last.time * push * LIMIT, rel=1e-8)
    assert solution.certificate.holds
    assert solution.displacement is last.displacement
    assert solution.contact is last.contact
    assert all(step.status is Status.CONVERGED for step in solution.steps[:-1])


@pytest.mark.one_quick
@pytest.mark.parametrize(
    ("method", "push"),
    [
        *(({}, 1.2), ({"coulomb": "newton"}, 1.2), ({"algorithm": "alm"}, 1.2)),
        # With fall-backs such a ramp would begin again with augmentation.
        *(({"max_iterations": 2, "fallbacks": False}, 0.9), ({"max_iterations": 6, "algorithm": "alm"}, 0.99)),
    ],
)
def test_failed_steps_leave_no_trace(method, push):
    """The load steps that a ramp ends up with, asked for one by one: the same solves, the same displacement.  Some fail
    because statics says so, before anything is iterated, and some by too many iterations.
    """
    found = solve(ramp(push, nx=18, **method), check=False)
    good = [step for step in found.steps if step.status is Status.CONVERGED]
    assert any(str(event).endswith("half the increment") for event in found.history.events)
    asked = ramp(push, steps=1, factors=[step.place for step in good], nx=18, **method)
    wanted = solve(asked, check=False)
    assert [step.linear_solves for step in good] == [step.linear_solves for step in wanted.steps]
    # A factor that a failed step has left refines to the last bits only.
    expected = wanted.displacement.x.array
    assert found.displacement.x.array == pytest.approx(expected, rel=0, abs=1e-14 * np.abs(expected).max())


def test_limit_load_from_nothing():
    """Without factors all loads grow together; Tresca friction of bound g holds at most g times the length."""
    bound = 2.0
    scene = block(
        30,
        {
            "traction": [{"boundary": "top", "x": 2 * bound, "y": -PRESSURE}],
            "contact": {"boundary": "bottom", "friction": {"law": "tresca", "bound": bound}},
            "load_steps": {"steps": 4},
        },
    )
    solution = alone(scene, check=False)
    assert solution.status is Status.SLIDES
    assert 0.99 * 0.5 <= solution.last_step.time <= 0.5
    assert solution.steps[0].time == 0.25
    assert friction_force(solution.contact) == pytest.approx(solution.last_step.time * 2 * bound * LENGTH, rel=1e-8)


def test_a_ramp_that_holds_ends_at_its_factors():
    """Every factor is a load step, whatever the increments."""
    solution = alone(ramp(0.9, 3, factors=(0.0, 1.0, -0.5)))
    assert solution.converged
    times = [step.time for step in solution.steps]
    assert {0.0, 1.0, 2.0} <= set(times)
    assert times == sorted(set(times))
    assert friction_force(solution.contact) == pytest.approx(-0.45 * LIMIT, rel=1e-8)


def test_a_ramp_is_the_same_as_its_factors():
    """With increments that are never changed it is the list of factors."""
    path = [0.0, 0.5, 1.0]
    by_hand = alone(ramp(0.9, None, factors=path, load_steps={"times": path}))
    found = alone(ramp(0.9, 2))
    assert [step.time for step in found.steps] == path
    for one, other in zip(found.steps, by_hand.steps, strict=True):
        np.testing.assert_allclose(one.contact.shear, other.contact.shear, rtol=0, atol=1e-12 * PRESSURE)
    assert found.history.linear_solves == by_hand.history.linear_solves


# --- the increments, apart from any solve -----------------------------------------------------------------------------


def walk(path, limit, solves=2, most=200):
    """The places that a path tries, where there is a solution up to ``limit``."""
    tried = []
    while len(tried) < most:
        tried.append(path.next)
        if path.next <= limit:
            path.advance(solves)
            if path.ended:
                return tried
        elif not path.shorten(Status.SLIDES):
            return tried
    raise AssertionError("no end")


@pytest.mark.parametrize("limit", [1e-3, 0.0101, 0.3, 0.55555, 0.999, 2 / 3])
def test_the_limit_is_enclosed(limit):
    """The last place with a solution is within 1 % below the limit, the last one without within 1 % above."""
    path = increments(ramp(1.0))
    tried = walk(path, limit)
    assert 0.99 * limit <= path.reached <= limit < tried[-1] <= 1.01 * limit
    assert len(tried) < 60


def test_easy_steps_become_larger():
    """After two easy ones the increment is doubled, and never more than that."""
    assert walk(increments(ramp(1.0)), 2.0) == pytest.approx([0.0, 0.1, 0.2, 0.4, 0.6, 0.8, 1.0])
    assert walk(increments(ramp(1.0)), 2.0, solves=1000) == pytest.approx([0.0, *np.linspace(0.1, 1.0, 10)])


def test_what_no_increment_changes():
    """A body that nothing holds, or no linear solver solves, ends the ramp at once, as does the first of several
    factors; near a limit load the linear solver fails because of the load.
    """
    path = increments(ramp(1.0))
    assert not path.shorten(Status.SLIDES)
    path.advance(2)
    assert path.shorten(Status.LINEAR_SOLVER)
    assert path.shorten(Status.CYCLING)
    from_nothing = increments(block(6, {"traction": {"boundary": "top", "y": -1.0}, "load_steps": {"steps": 2}}))
    assert not from_nothing.shorten(Status.NOT_HELD)
    assert not from_nothing.shorten(Status.LINEAR_SOLVER)
    assert from_nothing.shorten(Status.SLIDES)


def test_without_a_ramp_every_factor_is_a_step():
    path = increments(ramp(1.0, None, factors=(0.0, 0.2, 1.0, 0.5)))
    assert walk(path, 9.0) == [0.0, 1.0, 2.0, 3.0]
    assert not path.shorten(Status.SLIDES)


def end_of(path, limit, solves, wasted, *, proved=False):
    """How many linear solves a ramp takes below a limit and beyond it, where each attempt beyond takes ``wasted``."""
    below = beyond = 0
    for _ in range(200):
        if path.next <= limit:
            below += solves
            path.advance(solves)
            continue
        used = 0 if proved else min(wasted, path.allowed)
        beyond += used
        if not path.shorten(Status.SLIDES if proved else Status.CYCLING, used):
            return below, beyond
    raise AssertionError("no end")


@pytest.mark.parametrize("wasted", [40, 400, 10**6])
@pytest.mark.parametrize("limit", [0.0101, 0.3, 0.55555, 0.97])
def test_the_end_of_a_ramp_has_a_price(limit, wasted):
    """Where nothing proves that a load is too large, the attempts beyond the limit take no more than four times what
    the load steps up to it have taken, and the bracket says whether it was enough.
    """
    path = increments(ramp(1.0))
    below, beyond = end_of(path, limit, 15, wasted)
    assert beyond <= FAILED_RAMP * max(below, 10 * EASY_STEP)
    enclosed = path.at.failed - path.reached <= ENCLOSED * path.reached
    assert path.bracket.endswith("than they may") is not enclosed
    if wasted == 40 and limit > 0.1:
        assert path.at.failed <= 1.01 * path.reached


def test_what_is_proved_has_no_price():
    """Nor does it need the fall-backs."""
    path = increments(ramp(1.0))
    assert end_of(path, 0.3, 15, 10**6, proved=True)[1] == 0
    assert path.reached >= 0.99 * 0.3


def test_the_last_attempt_of_a_ramp_has_all_fall_backs():
    """Before it smaller increments are cheaper; if it finds a solution the others are not trusted any more."""
    path = increments(ramp(1.0))
    assert not path.without_fall_backs  # the first factor is reached in one step
    path.advance(15)
    tried = []
    while True:
        tried.append(path.without_fall_backs)
        if not path.shorten(Status.CYCLING, 1):
            break
    assert tried == [True] * (len(tried) - 1) + [False]
    again = increments(ramp(1.0))
    again.advance(15)
    while again.without_fall_backs:
        assert again.shorten(Status.CYCLING, 1)
    again.advance(100)
    assert not again.without_fall_backs
    assert again.next - again.reached == pytest.approx(0.1)


def test_a_place_that_has_failed_twice_is_a_limit():
    """From two starts; a place that has failed once is tried again from half the way."""
    path = increments(ramp(1.0))
    path.advance(15)
    assert path.shorten(Status.CYCLING, 1)
    path.advance(15)
    assert path.next == pytest.approx(0.1)
    assert path.shorten(Status.CYCLING, 1)
    path.advance(15)
    assert path.reached == pytest.approx(0.075)
    assert path.next == pytest.approx(0.0875)


def test_below_a_limit_no_place_is_tried_twice():
    """Once a place is known to have no solution, one below it that has failed is approached by halves."""
    path = increments(ramp(1.0))
    path.advance(15)
    assert path.shorten(Status.TIPS, 0)
    assert path.shorten(Status.CYCLING, 1)
    path.advance(15)
    assert path.reached == pytest.approx(0.025)
    assert path.next == pytest.approx(0.0375)


def test_the_price_of_a_ramp():
    """What its load steps have taken together sets what attempts without a solution may take: half of it before the
    last one, and each a multiple of the load step before.
    """
    path = increments(ramp(1.0))
    for _ in range(3):
        path.advance(1000)
    whole = FAILED_RAMP * 3000
    assert path.allowed == FAILED_STEP * 1000
    assert path.shorten(Status.CYCLING, whole // 2 - 2 * EASY_STEP)
    assert path.allowed == 2 * EASY_STEP
    assert path.shorten(Status.CYCLING, 2 * EASY_STEP)
    assert not path.without_fall_backs
    assert path.allowed == whole - whole // 2
    from_nothing = increments(block(6, {"traction": {"boundary": "top", "y": -1.0}, "load_steps": {"steps": 2}}))
    assert from_nothing.allowed == FAILED_STEP * SolverSettings.model_fields["max_iterations"].default


@pytest.mark.parametrize("hard", [False, True])
def test_a_ramp_that_should_begin_again(hard):
    """First with augmentation; if that comes less far, without, as far as before, and on with what is left."""
    path, solves = increments(ramp(1.0)), 100
    for _ in range(4):
        path.advance(EASY_STEP)
    known = path.next if hard else path.reached
    assert path.should_begin_again(Status.CONVERGED if hard else Status.CYCLING, solves)
    assert not path.should_begin_again(Status.SLIDES, solves)
    path.begin_again(Status.CONVERGED if hard else Status.CYCLING, 4 * EASY_STEP + solves)
    assert path.at.augmented
    path.advance(EASY_STEP)
    assert path.falls_short
    assert not path.should_begin_again(Status.CYCLING, solves)
    path.begin_again(Status.CYCLING, 10 * EASY_STEP + solves)
    assert not path.at.augmented
    assert not path.falls_short
    assert not path.should_begin_again(Status.CYCLING, solves)
    path.advance(EASY_STEP)
    while path.reached < known:
        assert path.allowed == FAILED_STEP * EASY_STEP
        path.advance(EASY_STEP)
    assert path.reached == pytest.approx(known)
    assert path._ramp == FAILED_RAMP * 10 * EASY_STEP - 10 * EASY_STEP - solves


def test_what_follows_a_hard_load_step_is_tried():
    """Augmentation fails, and has taken all that attempts without a solution may: no more than three times what the
    hard load step has; the load step after that one is tried nevertheless, with monolithic Newton first.
    """
    path = increments(block(6, {"traction": {"boundary": "top", "y": -1.0}, "load_steps": {"steps": 4}}))
    hard = 5 * EASY_STEP
    path.begin_again(Status.CONVERGED, hard)
    spent = hard
    while True:
        assert path.at.augmented
        used = path.allowed
        spent += used
        if not path.shorten(Status.CYCLING, used):
            break
    assert spent <= FAILED_RAMP * hard
    assert path.falls_short
    path.begin_again(Status.CYCLING, spent)
    assert path.at.monolithic
    path.advance(hard)
    assert EASY_STEP <= path.allowed <= FAILED_STEP * hard


def test_augmentation_that_comes_as_far_is_kept():
    """A ramp begins again without it only if it would lose a load step."""
    path = increments(ramp(1.0))
    path.advance(EASY_STEP)
    path.advance(EASY_STEP)
    path.begin_again(Status.CYCLING, 100)
    path.advance(EASY_STEP)
    assert path.falls_short
    path.advance(EASY_STEP)
    assert not path.falls_short


def test_a_place_that_was_passed_is_no_limit():
    """It has a solution after all."""
    path = increments(ramp(1.0))
    path.advance(15)
    assert path.shorten(Status.CYCLING, 1)
    assert path.bracket is not None
    path.advance(15)
    path.advance(15)
    assert path.reached == pytest.approx(0.1)
    assert (path.at.failed, path.at.limit, path.bracket) == (None, False, None)


@pytest.mark.parametrize("seed", range(6))
def test_a_path_goes_on_as_it_was(seed):
    """From what is stored at any moment, it chooses what it would have chosen without a restart."""
    rng, path = np.random.default_rng(seed), increments(ramp(1.0))
    for _ in range(60):
        again = increments(ramp(1.0))
        again.resume(json.loads(json.dumps(path.stored())))
        solved, solves, status = rng.random() < 0.6, int(rng.integers(1, 40)), rng.choice([Status.CYCLING, Status.TIPS])
        for one in (path, again):
            one.shortened = None if solved else one.shorten(status, solves)
            if solved:
                one.advance(solves)
        for name in ("shortened", "at", "next", "allowed", "without_fall_backs", "bracket"):
            assert getattr(again, name) == getattr(path, name), name
        if path.ended or path.shortened is False:
            return


# --- names, times, counting -------------------------------------------------------------------------------------------

NAMED = {"names": ["press", "push"], "times": [0.0, 2.0]}


def test_log():
    """Each load step has a heading with number, name and time; numbers begin with 1."""
    seen = []
    alone(ramp(0.9, 2, load_steps=NAMED), observers=[seen.append])
    steps = [record for record in seen if isinstance(record, StepRecord)]
    assert steps == [StepRecord(1, "press", 0.0), StepRecord(2, "push", 1.0), StepRecord(3, "push", 2.0)]
    assert table_row(steps[1]).startswith("--- load step 2 (push, time 1) ---")
    quiet = []
    alone(ramp(0.9, None, factors=[1.0]), observers=[quiet.append])
    assert not any(isinstance(record, StepRecord) for record in quiet)


def test_error_names_the_step():
    with pytest.raises(ConvergenceError) as error:
        alone(ramp(2.0, 2, load_steps=NAMED))
    (first, *_) = str(error.value).splitlines()
    assert first.startswith("load step ")
    assert "(push, time 1.0" in first
    assert "slides, no static equilibrium" in first
    assert f"; the results are those of {error.value.solution.last_step}" in first


@pytest.fixture(scope="module")
def failed(tmp_path_factory):
    """A ramp that slides, and its result folder."""
    solution = solve(ramp(1.9, 4, nx=12, load_steps=NAMED), MPI.COMM_SELF, check=False)
    folder = tmp_path_factory.mktemp("failed")
    return solution, write_results(solution, folder), folder


def rows(folder, name):
    with (folder / name).open() as file:
        return list(csv.DictReader(file))


def test_files_of_a_failed_ramp(failed):
    """All results are those of the last step with a solution; the step without one has a row, but no figures."""
    solution, summary, folder = failed
    steps = rows(folder, "steps.csv")
    assert [int(row["step"]) for row in steps] == list(range(1, len(steps) + 1))
    assert [row["name"] for row in steps] == ["press", *["push"] * (len(steps) - 1)]
    assert steps[-1]["status"] == "slides, no static equilibrium"
    assert steps[-1]["friction_force_x"] == "nan"
    last = solution.last_step
    of = {"step": last.step, "name": "push", "time": last.time, "status": "converged"}
    assert summary["results_of"] == json.loads((folder / "summary.json").read_text())["results_of"] == of
    assert summary["friction_force"][0] == float(steps[-2]["friction_force_x"])
    told = next(line for line in render(summary).splitlines() if line.startswith("  results of"))
    assert told == (
        f"  results of       load step {last.step} (push, time {last.time:.6g}); no solution of load step "
        f"{last.step + 1}, time {solution.steps[-1].time:.6g}"
    )
    numbers = {int(row["step"]) for row in rows(folder, "contact_steps.csv")}
    assert numbers == set(range(1, last.step + 1))
    assert summary["certificate"]["holds"]


def test_load_step_of_each_linear_solve(failed):
    """The tables of the iteration say which load step each row is of; failed increments are of the step they try."""
    _, _, folder = failed
    solves = {int(row["step"]): int(row["linear_solves"]) for row in rows(folder, "steps.csv")}
    iterations, problems = rows(folder, "history.csv"), rows(folder, "outer.csv")
    for table in (iterations, problems):
        numbers = [int(row["step"]) for row in table]
        assert numbers == sorted(numbers)
    for step, count in solves.items():
        of_it = [int(row["solve"]) for row in iterations if int(row["step"]) == step]
        last = of_it[len(of_it) - count :]
        assert [number - last[0] for number in last] == list(range(count))
    for row in problems:
        of_it = [solve for solve in iterations if (solve["step"], solve["outer"]) == (row["step"], row["outer"])]
        assert len(of_it) == int(row["linear_solves"])


def test_fields_of_every_step(failed):
    """The files are of all steps with a solution, at their times, with their values."""
    solution, summary, folder = failed
    steps = solution.steps[:-1]
    assert summary["fields"] == ["fields.pvd"]
    listed = list(ElementTree.parse(folder / "fields.pvd").iter("DataSet"))
    assert [float(row.get("timestep")) for row in listed] == [step.time for step in steps]
    for row, step in zip(listed, steps, strict=True):
        arrays = arrays_of(folder / row.get("file"))
        _, once = np.unique(arrays["points"].round(9), axis=0, return_index=True)  # each cell has points of its own
        ours = np.sort(np.linalg.norm(arrays["displacement"][once], axis=1))
        theirs = np.sort(np.linalg.norm(step.displacement.x.array.reshape(-1, 2), axis=1))
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-12 * theirs.max())


def test_pictures(failed, monkeypatch):
    """An animation with a frame for each step with a solution; the curve leaves the others out."""
    from PIL import Image

    from signorini_fx.addons.pictures import load_steps as drawing

    solution, _, folder = failed
    with Image.open(folder / "deformed.gif") as moving:
        assert moving.n_frames == len(solution.steps) - 1
        for frame in range(moving.n_frames):
            moving.seek(frame)
            assert moving.convert("RGB").getpixel((1, 1)) == (255, 255, 255)  # no box around it on a white page
    assert (folder / "load_steps.png").is_file()
    seen = []
    monkeypatch.setattr(drawing, "finish", lambda figure, *_: seen.append(figure))
    table = {name: np.array([row[name] for row in rows(folder, "steps.csv")]) for name in rows(folder, "steps.csv")[0]}
    figures = {
        name: column if name in ("name", "status") else column.astype(float)
        for name, column in table.items()
        if name != "certificate_holds"
    }
    load_steps("unused", figures)
    upper, lower = seen[0].axes
    times = [step.time for step in solution.steps[:-1]]
    assert list(upper.lines[0].get_xdata()) == times
    assert {text.get_text() for text in upper.texts} == {"press", "push"}
    np.testing.assert_allclose(-lower.lines[0].get_ydata() / 1.9 / LIMIT, np.array(times) / 2, atol=1e-6)


def test_report(failed):
    """The page says what the results are of, and has the animation."""
    _, summary, folder = failed
    page = write_report(folder, None).read_text()
    assert f"load step {summary['results_of']['step']} (push, time " in page
    assert "do not use them" not in page
    assert "data:image/gif" in page


def test_frames():
    assert shown(3) == [0, 1, 2]
    assert len(shown(1000)) <= MOST_FRAMES + 1
    assert shown(1000)[-1] == 999


@pytest.mark.slow
def test_without_contact(tmp_path):
    """A body in 3D without contact: the strain energy grows with the square of the load."""
    scene = {
        "mesh": {"generator": "box", "parameters": {"nx": 2, "ny": 2, "nz": 2}},
        "material": {"young": 5000.0, "poisson": 0.3},
        "displacement": [{"boundary": "bottom", "x": 0.0, "y": 0.0, "z": 0.0}],
        "traction": [{"boundary": "top", "z": -10.0}],
        "load_steps": {"steps": 2},
    }
    solution = alone(parse_scene(scene))
    assert [step.time for step in solution.steps] == [0.5, 1.0]
    assert solution.steps[0].strain_energy == pytest.approx(0.25 * solution.steps[1].strain_energy, rel=1e-9)
    pytest.importorskip("pyvista")
    write_results(solution, tmp_path, fields=False)
    assert (tmp_path / "deformed.gif").is_file()


def test_a_ramp_without_contact_says_where_it_ends():
    """At the load at which the deformation reaches its limit: it is proportional to the load; there is no other record
    of the attempts beyond it.
    """
    scene = {
        "mesh": {"generator": "rectangle", "parameters": {"length": 3.0, "nx": 6, "ny": 2}},
        "material": {"young": 5000.0, "poisson": 0.3},
        "displacement": [{"boundary": "bottom", "x": 0.0, "y": 0.0}],
        "traction": [{"boundary": "top", "y": -4000.0}],
        "load_steps": {"steps": 4},
    }
    solution = alone(parse_scene(scene), check=False)
    held, failed = solution.steps[-2:]
    assert failed.status is Status.TOO_LARGE
    limit = held.time * solution.statement.solver.largest_deformation / held.deformation.largest
    assert held.time <= limit < failed.time < 1.1 * limit
    expected = f"there is a solution at time {held.time:.6g}, and none at time {failed.time:.6g}"
    assert solution.history.events[-1].startswith(f"the ramp ends: {expected}")
    assert {step.linear_solves for step in solution.steps} == {1}
    assert solution.history.linear_solves == 0


@pytest.mark.parametrize("kind", ["not held", "no memory"])
def test_a_ramp_that_fails_for_another_reason_than_its_load(kind, monkeypatch):
    """It says nothing of loads that have a solution: there is none at any load, and no smaller one is tried."""
    support = {"x": 0.0} if kind == "not held" else {"x": 0.0, "y": 0.0}
    scene = {
        "mesh": {"generator": "rectangle", "parameters": {"nx": 2, "ny": 1}},
        "material": {"young": 1000.0, "poisson": 0.0},
        "displacement": {"boundary": "left", **support},
        "traction": {"boundary": "right", "x": 1.0},
        "load_steps": {"steps": 2},
    }
    if kind == "no memory":
        monkeypatch.setattr(callbacks, "solve", no_memory)
    solution = alone(parse_scene(scene), check=False)
    expected = Status.NOT_HELD if kind == "not held" else Status.NO_MEMORY
    assert [step.status for step in solution.steps] == [expected]
    assert solution.history.events == []


def no_memory(*_):
    raise MemoryError


@pytest.mark.slow
def test_exit_code_tells_of_the_failure(tmp_path, capsys):
    """And the message says what the results are of."""
    file = tmp_path / "scene.toml"
    file.write_text(
        f"""
mesh = {{ generator = "rectangle", parameters = {{ length = 3.0, nx = 6, ny = 2 }} }}
material = {{ young = 5000.0, poisson = 0.3 }}
[[traction]]
boundary = "top"
y = -20.0
[[traction]]
boundary = "left"
x = {2 * LIMIT}
factors = [0.0, 1.0]
[[contact]]
boundary = "bottom"
friction = {{ law = "coulomb", coefficient = 0.3 }}
[load_steps]
steps = 2
"""
    )
    out = tmp_path / "out"
    assert main(["solve", str(file), "--out", str(out), "--no-fields", "--no-pictures"]) == 1
    said = capsys.readouterr()
    assert "the results are those of load step " in said.err
    assert said.out.count("  warning  ") == 0
    assert "  what to do  factor 2: there is no static equilibrium: the loads make it slide" in said.out
    assert "make it slide" not in said.err  # it has been said
    assert main(["solve", str(file), "--out", str(out), "--no-fields", "--no-pictures", "--quiet"]) == 1
    assert "make it slide" in capsys.readouterr().err


# --- bad input --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"steps": 0}, "load_steps.steps"),
        ({"steps": 2.5}, "load_steps.steps"),
        ({"names": ["one"]}, "load_steps.names: has 1 entries, one for each of 2 factors"),
        ({"times": [1.0, 1.0]}, "times must increase"),
        ({"times": [0.0, 1.0, 2.0]}, "load_steps.times: has 3 entries"),
        ({"ramp": 3}, "load_steps.ramp"),
    ],
)
def test_bad_load_steps(given, message):
    with pytest.raises(SceneError, match=message.replace(".", r"\.")):
        ramp(1.0, load_steps={"times": [0.0, 1.0]} | given)


def test_loads_that_begin_before_time_0():
    loads = {"traction": {"boundary": "top", "y": -1.0}, "load_steps": {"steps": 2, "times": [0.0]}}
    with pytest.raises(SceneError, match="must be positive"):
        block(6, loads)


@pytest.mark.slow
@pytest.mark.parametrize("steps", [1, 4])
def test_a_limit_in_space_where_the_ramp_halves_its_increments(steps):
    """Statics: the plate slides at F times the force that presses it, which is half of the load; every halving of the
    increment meets it exactly.  It is named, and takes no more than the way up to it.
    """
    scene = {
        "mesh": {"generator": "box", "parameters": {"length": 2.0, "width": 1.0, "height": 0.5, "nx": 4, "ny": 2,
                                                    "nz": 2}},
        "material": {"young": 1000.0, "poisson": 0.3},
        "traction": [
            {"boundary": "top", "z": -1.0},
            {"boundary": "left", "x": 2 * 0.3 * 2.0 / 0.5, "factors": [0.0, 1.0]},
        ],
        "contact": {"boundary": "bottom", "friction": {"law": "coulomb", "coefficient": 0.3}},
        "load_steps": {"steps": steps, "times": [0.0, 1.0]},
    }  # fmt: skip
    solution = alone(parse_scene(scene), check=False)
    assert solution.status is Status.SLIDES
    assert 0.99 * 0.5 <= solution.last_step.time < 0.5
    assert solution.steps[-1].time == 0.5
    assert solution.steps[-1].linear_solves == 0
    assert any("the largest that can be held" in str(event) for event in solution.history.events)


def test_a_ramp_goes_on_where_only_monolithic_newton_converges():
    """A plate that is pushed nearly until it tips, F = 5: the fixed point alternates, augmentation cycles."""
    scene = {
        "mesh": {"generator": "box", "parameters": {"length": 2.0, "width": 1.0, "height": 0.5, "nx": 8, "ny": 4,
                                                    "nz": 2}},
        "material": {"young": 1000.0, "poisson": 0.3},
        "traction": [{"boundary": "top", "z": -10.0}, {"boundary": "left", "x": 150.0}],
        "contact": {"boundary": "bottom", "friction": {"law": "coulomb", "coefficient": 5.0}},
        "load_steps": {"steps": 4},
    }  # fmt: skip
    solution = alone(parse_scene(scene))
    assert solution.last_step.time == 1.0
    assert solution.steps[-1].linear_solves <= 3  # under proportional loads the sets stay
    assert solution.history.linear_solves <= 400


def test_a_first_load_step_that_only_fall_backs_solve():
    """As the plate below: without fall-backs it fails at any increment, and half of all solves are gone by then."""
    path = Increments(LoadPath((1.0,), steps=1, from_nothing=True), SolverSettings(), may_augment=True)
    path.begin_again(Status.CYCLING, 47)
    while path.without_fall_backs:
        assert path.shorten(Status.MAX_ITERATIONS, path.allowed)
    path.advance(398)
    assert not path.ended
    assert not path.without_fall_backs
    assert path.allowed >= 2 * 398  # of the load steps with a solution, not of what their search has taken


@pytest.mark.slow
@pytest.mark.parametrize("steps", [1, 4])
def test_a_plate_whose_ramp_begins_with_a_damped_fixed_point(steps):
    """A plate that is pushed nearly until it tips, F = 5: of all methods only a damped fixed point converges."""
    scene = {
        "mesh": {"generator": "box", "parameters": {"length": 2.0, "width": 1.0, "height": 0.5, "nx": 4, "ny": 2,
                                                    "nz": 2}},
        "material": {"young": 1000.0, "poisson": 0.3},
        "traction": [{"boundary": "top", "z": -10.0}, {"boundary": "left", "x": 156.0}],
        "contact": {"boundary": "bottom", "friction": {"law": "coulomb", "coefficient": 5.0}},
        "load_steps": {"steps": steps},
    }  # fmt: skip
    solution = alone(parse_scene(scene))
    assert solution.last_step.time == 1.0
    assert solution.history.linear_solves <= 2500
    # Under proportional loads the forces grow with them; statics says how large they are.
    for step in solution.steps:
        table = step.contact
        assert (table.boundary.weight * table.pressure).sum() == pytest.approx(20.0 * step.time, rel=1e-6)


def test_advice_is_about_how_it_ended():
    """A dam slides at twice the pressure of the water; that ten times as much would tip it over is another warning."""
    scene = parse_scene(
        {
            "mesh": {"generator": "rectangle", "parameters": {"length": 30.0, "height": 40.0, "nx": 6, "ny": 8}},
            "material": {"young": 25e9, "poisson": 0.2, "density": 2400.0},
            "gravity": {"y": -9.81},
            "contact": {"boundary": "bottom", "friction": {"law": "coulomb", "coefficient": 0.7}},
            "traction": {"boundary": "left", "pressure": "4e5 * (1 - x[1] / 40)", "factors": [1.0, 10.0]},
            "load_steps": {"steps": 4},
        }
    )
    solution = solve(scene, check=False)
    assert solution.status is Status.SLIDES
    assert any("tip it over" in finding.message for finding in solution.findings)
    assert "tip" not in solution.advice
    last, failed = solution.last_step.time, solution.steps[-1].time
    assert f"there is a solution at time {last:.6g}, and none at time {failed:.6g}" in solution.advice
