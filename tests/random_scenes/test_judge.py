"""The oracle of random scenes: it shares no code with the package, and notices what is wrong."""

import ast
import copy
import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scene_tables import coulomb_friction, fixed, tresca_friction
from turned_scenes import block

from benchmarks.stability.oracle import __main__ as command
from benchmarks.stability.oracle import convex
from benchmarks.stability.oracle.body import Body, Mesh
from benchmarks.stability.oracle.conditions import contact_of
from benchmarks.stability.oracle.judge import (
    DENIED,
    NO_BALANCE,
    OPEN,
    RIGHT,
    WRONG,
    Answer,
    Step,
    judge,
)
from benchmarks.stability.oracle.package import answer_of, solution_of
from benchmarks.stability.oracle.scenes import Trial, grid

ROOT = Path(__file__).parents[2]

ORACLE = ROOT / "benchmarks" / "stability" / "oracle"
# These two, and the command, start the package; nothing that judges imports them.
STARTERS = {"package.py", "worker.py", "__main__.py"}
OWN = {"benchmarks", "numpy", "scipy", "cvxopt", "tomli_w"}


def test_the_oracle_shares_no_code_with_the_package():
    """What judges imports NumPy, SciPy, CVXOPT and itself, and none of the modules that start the
    package.
    """
    seen = set()
    for file in ORACLE.rglob("*.py"):
        if file.name in STARTERS:
            continue
        seen.add(file.name)
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            names = []
            if isinstance(node, ast.Import):
                names = [alias.name for alias in node.names]
            elif isinstance(node, ast.ImportFrom):
                assert node.level == 0
                names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
            elif isinstance(node, ast.Name):
                assert node.id not in ("__import__", "importlib")
            for name in names:
                first = name.split(".")[0]
                assert first in OWN or first in sys.stdlib_module_names, (
                    f"{file.name} imports {name}"
                )
                if first == "benchmarks":
                    assert name.startswith("benchmarks.stability.oracle"), name
                    assert not {f"{part}.py" for part in name.split(".")} & STARTERS, name
    assert {
        "elements.py",
        "body.py",
        "conditions.py",
        "convex.py",
        "statics.py",
        "judge.py",
        "scenes.py",
    } <= seen


# The image has CVXOPT if the Dockerfile says so; elsewhere it may be missing.
PROMISED = (
    "python3-cvxopt" in (ROOT / "Dockerfile").read_text(encoding="utf-8")
    and "SFX_ENVIRONMENT" in os.environ
)


# ---- what is wrong is noticed


def body(nx=8, ny=4, cell="quadrilateral", turn=0.0, inner=0.0):
    """A distorted block of 2 x 1, turned, in two parts."""
    points, cells, boundaries = grid(nx, ny, cell)
    inside = (points > 1e-9).all(axis=1) & (points < 1 - 1e-9).all(axis=1)
    points[inside] += inner * np.sin(9 * points[inside][:, ::-1] + 1)
    x = points * [2.0, 1.0]
    c, s = np.cos(turn), np.sin(turn)
    high = x[cells].mean(axis=1)[:, 1] > 0.5
    regions = {"below": np.flatnonzero(~high), "above": np.flatnonzero(high)}
    return Mesh(x @ np.array([[c, s], [-s, c]]), cells, boundaries, regions)


def scene(friction, degree=1, solver=None, **others):
    """Two materials, a traction that presses and pulls, a body force, a gap that is not
    constant.
    """
    return {
        "mesh": {"file": "body.inp"},
        "element": {"degree": degree},
        "material": [
            {"region": "below", "young": 1000.0, "poisson": 0.3},
            {"region": "above", "young": 700.0, "poisson": 0.2},
        ],
        "displacement": [fixed("left", "x")],
        "traction": [{"boundary": "top", "x": 1.5, "y": -4.0}],
        "body_force": {"y": -1.0},
        "contact": [{"boundary": "bottom", "gap": "0.01*(x[0] - 1)**2", "friction": friction}],
        "solver": solver or {},
        **others,
    }


TRESCA, COULOMB = tresca_friction(0.8), coulomb_friction(0.25)
STEPPED = [
    {"boundary": "top", "y": -4.0},
    {"boundary": "top", "x": 2.5, "factors": [0.4, 1.0, -0.3]},
]
TRIALS = {
    "tresca": Trial(0, scene(TRESCA), body(inner=0.03)),
    "coulomb": Trial(0, scene(COULOMB, 2), body(4, 2, "triangle")),
    "limit": Trial(0, scene(COULOMB, solver={"algorithm": "alm"}), body()),
    "steps": Trial(0, scene(COULOMB, traction=STEPPED), body(cell="triangle")),
    # Held by nothing but two foundations and friction: it moves as a whole.
    "loose": Trial(
        0,
        scene(
            TRESCA,
            displacement=[],
            contact=[
                {
                    "boundary": "bottom",
                    "gap": "0.01 + 0.002*x[0]",
                    "direction": [0.0, -1.0],
                    "friction": TRESCA,
                },
                {"boundary": "right", "gap": 0.02, "direction": [1.0, 0.0]},
            ],
            traction=[{"boundary": "top", "x": 2.0, "y": -4.0}],
        ),
        body(),
    ),
}
ANSWERS: dict[str, Answer] = {}


def answer(name, tmp_path_factory):
    """What the package says of one of these scenes."""
    if name not in ANSWERS:
        ANSWERS[name] = answer_of(solution_of(TRIALS[name].write(tmp_path_factory.mktemp("scene"))))
    return copy.deepcopy(ANSWERS[name])


def verdict(name, given):
    trial = TRIALS[name]
    return judge(trial.scene, trial.mesh, given)


def nodes(name, given, wanted=lambda table: table["state"] != "open"):
    """The contact table of the last step and its rows that are expected, those that carry most
    first.
    """
    table = given.steps[-1].table
    rows = np.flatnonzero(wanted(table))
    assert rows.size, name
    return table, rows[np.argsort(-table["pressure"][rows])]


def moved(given, change, *, told=True):
    """Another displacement, and if ``told`` a contact table that says the same."""
    place, step = given.place, given.steps[-1]
    u, table = step.displacement + change, step.table
    at = np.array(
        [np.argmin(np.hypot(*(place - p).T)) for p in np.stack([table["x"], table["y"]], axis=1)]
    )
    if told:
        origin = table["u_t"] - table["slip"]
        table["u_n"] = u[at, 0] * table["n_x"] + u[at, 1] * table["n_y"]
        table["u_t"] = -u[at, 0] * table["n_y"] + u[at, 1] * table["n_x"]
        table["slip"] = table["u_t"] - origin
    return replace(given, steps=[*given.steps[:-1], replace(step, displacement=u)])


def one_percent_more(name, given):
    return moved(given, 0.01 * given.steps[-1].displacement)


def one_percent_more_in_the_body(name, given):
    """Only where no contact table and no support tells."""
    away = np.ones(len(given.place), dtype=bool)
    body_ = Body(TRIALS[name].scene, TRIALS[name].mesh)
    held = body_.x[np.unique(np.concatenate([*body_.mesh.boundaries.values()]))]
    for p in held:
        away[np.argmin(np.hypot(*(given.place - p).T))] = False
    return moved(given, 0.01 * given.steps[-1].displacement * away[:, None])


def one_pressure(name, given):
    table, rows = nodes(name, given)
    table["pressure"][rows[0]] *= 1.0001
    return given


def sign_of_the_shear(name, given):
    given.steps[-1].table["shear"] *= -1
    return given


def shear_beyond_the_bound(name, given):
    """With a bound that says it may."""
    table, rows = nodes(name, given, lambda table: np.char.startswith(table["state"], "slip"))
    table["shear"][rows[0]] *= 1.001
    table["bound"][rows[0]] *= 1.001
    return given


def bound_of_another_law(name, given):
    given.steps[-1].table["bound"] *= 1.1
    return given


def open_for_closed(name, given):
    table, rows = nodes(name, given)
    table["state"][rows[0]] = "open"
    return given


def slip_for_stick(name, given):
    table, rows = nodes(name, given, lambda table: table["state"] == "stick")
    table["state"][rows[0]] = "slip+" if table["shear"][rows[0]] > 0 else "slip-"
    return given


def gap_forgotten(name, given):
    given.steps[-1].table["gap"][:] = 0.0
    return given


def not_a_number(name, given):
    displacement = given.steps[-1].displacement
    displacement[len(displacement) // 2, 0] = np.nan
    return given


def another_gamma(name, given):
    return replace(given, gamma=(2 * given.gamma[0], given.gamma[1]))


EVERYWHERE = ("tresca", "coulomb", "limit", "steps", "loose")
INJECTED = {
    one_percent_more: EVERYWHERE,
    one_percent_more_in_the_body: EVERYWHERE,
    one_pressure: EVERYWHERE,
    sign_of_the_shear: EVERYWHERE,
    shear_beyond_the_bound: ("tresca", "coulomb", "limit", "steps"),
    bound_of_another_law: EVERYWHERE,
    open_for_closed: EVERYWHERE,
    slip_for_stick: ("tresca", "coulomb", "limit", "steps"),
    gap_forgotten: EVERYWHERE,
    not_a_number: EVERYWHERE,
    another_gamma: ("tresca", "coulomb", "steps", "loose"),
}


@pytest.mark.parametrize("name", TRIALS)
def test_an_honest_answer_is_right(name, tmp_path_factory):
    """Each of the scenes that faults are put into: contact, stick and slip are all there where they
    are asked for.
    """
    given = answer(name, tmp_path_factory)
    found = verdict(name, given)
    assert found.kind == RIGHT, found
    assert convex.cvxopt is None or found.compared == len(given.steps)


@pytest.mark.one_quick(
    ("fault", "name"), [(fault, name) for fault, names in INJECTED.items() for name in names]
)
def test_an_injected_fault_is_noticed(fault, name, tmp_path_factory):
    """A wrong displacement, pressure, shear, state, bound, gap or gamma."""
    found = verdict(name, fault(name, answer(name, tmp_path_factory)))
    assert found.kind == WRONG, found


def other(name, **changes):
    """The same scene with another entry."""
    trial = TRIALS[name]
    return Trial(0, {**trial.scene, **changes}, trial.mesh)


def test_a_load_step_that_forgets_where_slip_counts_from(tmp_path, tmp_path_factory):
    """The last load step solved as if it were the first, between steps that are right."""
    given = answer("steps", tmp_path_factory)
    last = [{k: v for k, v in load.items() if k != "factors"} for load in STEPPED]
    last[1]["x"] *= STEPPED[1]["factors"][-1]
    alone = answer_of(solution_of(other("steps", traction=last).write(tmp_path)))
    assert alone.outcome == "converged"
    found = verdict("steps", replace(alone, steps=[*given.steps[:-1], *alone.steps]))
    assert found.kind == WRONG
    told = alone.steps[-1].table
    told["slip"] = told["u_t"] - given.steps[-2].table["u_t"]
    found = verdict("steps", replace(alone, steps=[*given.steps[:-1], *alone.steps]))
    assert found.kind == WRONG
    assert max(found.figures[name] for name in ("law of friction", "friction cone")) > 1


def test_a_wrong_step_in_the_middle(tmp_path_factory):
    """Steps before the last are judged too."""
    given = answer("steps", tmp_path_factory)
    table = given.steps[1].table
    table["pressure"][np.argmax(table["pressure"])] *= 1.0001
    assert verdict("steps", given).kind == WRONG
    assert verdict("steps", replace(given, steps=given.steps[1:])).kind == WRONG
    given = answer("steps", tmp_path_factory)
    given.steps[1].displacement[:] *= 1.00001
    assert verdict("steps", given).kind == WRONG


@pytest.mark.skipif(
    convex.cvxopt is None and not PROMISED, reason="CVXOPT (python3-cvxopt) is missing"
)
def test_what_gamma_leaves(tmp_path):
    """Path-following reports how far it is from the unregularised solution: the programme knows."""
    solver = {"algorithm": "path-following", "regularisation_error": 1e-3}
    asked = Trial(0, scene(TRESCA, solver=solver), body())
    given = answer_of(solution_of(asked.write(tmp_path)))
    assert judge(asked.scene, asked.mesh, given).kind == RIGHT
    assert given.regularisation_error < 1e-3
    better = replace(given, regularisation_error=given.regularisation_error / 5)
    assert judge(asked.scene, asked.mesh, better).kind == WRONG
    finer = {
        **asked.scene,
        "solver": {**solver, "regularisation_error": given.regularisation_error / 5},
    }
    assert judge(finer, asked.mesh, given).kind == WRONG


def test_an_outcome_is_asked_of_statics(tmp_path):
    """That contact opens is believed of a body that is lifted, not of one that is pressed."""
    loose = TRIALS["loose"]
    empty = replace(answer_of(solution_of(loose.write(tmp_path))), outcome=OPEN)
    assert judge(loose.scene, loose.mesh, empty).kind == DENIED
    lifted = {**loose.scene, "traction": [{"boundary": "top", "y": 40.0}]}
    assert judge(lifted, loose.mesh, empty).kind == NO_BALANCE
    for outcome, sideways in (("body not held", True), (OPEN, False)):
        flat = {
            **loose.scene,
            "contact": [loose.scene["contact"][0] | {"friction": {"law": "none"}}],
        }
        if not sideways:
            flat["displacement"] = [fixed("left", "x")]
        kind = judge(flat, loose.mesh, replace(empty, outcome=outcome)).kind
        assert kind == (NO_BALANCE if sideways else DENIED)


@pytest.mark.skipif(
    convex.cvxopt is None and not PROMISED, reason="CVXOPT (python3-cvxopt) is missing"
)
def test_a_solution_refutes_that_coulomb_friction_slides():
    """A block on a plane, pushed by 0.3 and by 0.6 of its load at F = 0.5, said to slide both
    times.
    """
    mesh = replace(body(), regions={})
    empty = Answer("slides, no static equilibrium", mesh.points, [], gamma=(np.inf, np.inf))
    for push, kind in ((0.3, DENIED), (0.6, NO_BALANCE)):
        data = {
            "material": {"young": 1000.0, "poisson": 0.3},
            "traction": [{"boundary": "top", "x": push, "y": -1.0}],
            "contact": [{"boundary": "bottom", "friction": coulomb_friction(0.5)}],
        }
        assert judge(data, mesh, empty).kind == kind


# ---- the oracle's own elements and conditions against what is known


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("cell", ["triangle", "quadrilateral", "tetrahedron", "hexahedron"])
def test_a_constant_stress_is_in_balance(cell, degree):
    """The patch test of the oracle's elements: distorted, turned cells under the tractions of a
    constant stress, and under contact pressure.
    """
    plane = cell in ("triangle", "quadrilateral")
    mesh = body(3, 2, cell, turn=0.7, inner=0.04) if plane else block(cell, inner=0.04)[0]
    mesh = replace(mesh, regions={})
    young, poisson = 10.0, 0.3
    strain = 1e-3 * np.array([[1.0, 0.4, -0.3], [0.4, -2.0, 0.5], [-0.3, 0.5, 0.7]])
    if plane:
        strain = strain[:2, :2]
    first, second = young * poisson / (1 + poisson) / (1 - 2 * poisson), young / 2 / (1 + poisson)
    stress = first * np.trace(strain) * np.eye(len(strain)) + 2 * second * strain
    probe = Body({"material": {"young": 1.0, "poisson": 0.0}}, mesh)
    loads = []
    for name in mesh.boundaries:
        normal = probe.middle_frames(probe.facets(name))[0]
        traction = map(float, stress @ normal / np.linalg.norm(normal))
        loads.append(dict(zip("xyz", traction, strict=False)) | {"boundary": name})
    given = {
        "element": {"degree": degree},
        "material": {"young": young, "poisson": poisson},
        "traction": loads,
        "contact": [{"boundary": "bottom"}],
    }
    patch = Body(given, mesh)
    forces = patch.stiffness @ (patch.x @ strain).ravel()
    np.testing.assert_allclose(forces, patch.load(0), atol=1e-15)
    # A contact pressure of 1 is a pressure of 1.
    contact = contact_of(patch)
    pressed = Body(given | {"traction": [{"boundary": "bottom", "pressure": 1.0}]}, mesh)
    pushed = contact.forces(np.ones(len(contact.weight)), 0 * contact.normal)
    np.testing.assert_allclose(-pushed, pressed.load(0), atol=1e-15)
    assert contact.weight.sum() == pytest.approx(2.0 if plane else 1.5)


def test_one_triangle_with_three_solutions():
    """Hassani, Hild, Ionescu and Sakki (2003): all three are accepted, and nothing between them."""
    root = np.sqrt(3)
    mesh = Mesh(
        np.array([[0.0, 0.0], [1.0, 0.0], [1 + root, 1.0]]),
        np.array([[0, 1, 2]]),
        {"bottom": np.array([[0, 1]]), "side": np.array([[1, 2]])},
    )
    data = {
        "material": {"young": 2.5, "poisson": 0.25},
        "displacement": [fixed("side")],
        "body_force": {"x": 15.0, "y": -6.0},
        "contact": [{"boundary": "bottom", "friction": coulomb_friction(3.0)}],
        "solver": {"algorithm": "alm"},
    }
    contact = contact_of(Body(data, mesh))
    assert contact.weight == pytest.approx([0.5, 0.5])

    def kind(u, force, state):
        table = {
            name: np.zeros(2)
            for name in ("gap", "u_n", "u_t", "pressure", "shear", "bound", "slip", "n_x")
        }
        table |= {
            "x": np.array([0.0, 1.0]),
            "y": np.zeros(2),
            "weight": np.full(2, 0.5),
            "n_y": -np.ones(2),
        }
        table |= {"boundary": np.array(["bottom"] * 2), "state": np.array([state, "stick"])}
        # The foundation's force on the body is minus w (lambda n + mu t), with n = (0, -1) and t =
        # (1, 0).
        table["pressure"][0], table["shear"][0] = 2 * force[1], -2 * force[0]
        table["bound"] = 3 * table["pressure"]
        table["u_n"][0], table["u_t"][0] = -u[1], u[0]
        table["slip"] = table["u_t"]
        displacement = np.array([u, (0.0, 0.0), (0.0, 0.0)])
        steps = [Step(displacement, table)]
        return judge(
            data, mesh, Answer("converged", mesh.points, steps, gamma=(np.inf, np.inf))
        ).kind

    # Sliding: 3 u = 2.5 - 3 p and -root u = -1 + p.
    slip = 0.5 / (3 * (root - 1))
    assert slip == pytest.approx(0.227671, abs=1e-6)
    assert kind((0.0, 0.0), (-2.5, 1.0), "stick") == RIGHT
    assert kind((slip, 0.0), (3 * slip - 2.5, 1 - root * slip), "slip+") == RIGHT
    free = np.linalg.solve(np.array([[3, -root], [-root, 5]]), [2.5, -1.0])
    assert free == pytest.approx([0.897329, 0.110844], abs=1e-6)
    assert kind(tuple(free), (0.0, 0.0), "open") == RIGHT
    assert kind((slip / 2, 0.0), (3 * slip / 2 - 2.5, 1 - root * slip / 2), "slip+") == WRONG
    assert kind((slip, 0.0), (-3 * (1 - root * slip), 1 - root * slip), "stick") == WRONG
    assert kind((0.0, 0.0), (-2.5, 0.8), "stick") == WRONG


# ---- the command


def test_what_is_wrong_is_counted(monkeypatch, tmp_path, capsys):
    """Any other error than bad input is no outcome, whatever raises it."""
    monkeypatch.setattr("benchmarks.stability.oracle.worker.solution_of", lambda path: 1 / 0)
    assert command.main(["--only", "plane", "2", "--out", str(tmp_path)]) == 1
    assert "ZeroDivisionError" in capsys.readouterr().out
