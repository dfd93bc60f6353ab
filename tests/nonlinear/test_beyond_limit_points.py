"""Ramps beyond a limit point: an arch that snaps through under a circle that a force presses."""

import re

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from support.nonlinear_bodies import held, neo_hooke

from signorini_fx import ConvergenceError, FormError, Foundation, NonlinearContactProblem, Status
from signorini_fx.forms.nonlinear.displacement_control import load_that_holds
from signorini_fx.forms.nonlinear.leaps import Leaps

FORCE, HELD = 0.15, {"x": 0.0, "rotation": 0.0}
WEIGHT = 0.01  # force per volume
FAR = 0.05  # for a material that takes small increments
SOFT, WAVES = 0.1, 1.2  # a law whose stress falls from a strain on, and rises again


def arch(comm, *, weighs=False, **shape):
    """The right half of a shallow arch that is clamped at its end, below a circle; its weight is ``problem.weight``."""
    mesh = dmesh.create_rectangle(comm, [[0.0, 0.0], [4.0, 0.3]], [12, 1], dmesh.CellType.quadrilateral)
    space = fem.functionspace(mesh, ("Lagrange", 2, (2,)))

    def side(axis, at):
        return dmesh.locate_entities_boundary(mesh, 1, lambda x: np.isclose(x[axis], at))

    top, middle, end = side(1, 0.3), side(0, 0.0), side(0, 4.0)
    mesh.geometry.x[:, 1] += 0.8 * np.cos(np.pi * mesh.geometry.x[:, 0] / 8)
    u = fem.Function(space)
    circle = {"shape": "circle", "centre": (0.0, 1.6), "radius": 0.5, "pivot": (0.0, 1.6)} | shape
    F = ufl.derivative(neo_hooke(u) * ufl.dx(metadata={"quadrature_degree": 4}), u, ufl.TestFunction(space))
    weight = fem.Constant(mesh, 0.0)
    if weighs:
        F += WEIGHT * weight * ufl.TestFunction(space)[1] * ufl.dx
    bcs = [held(space, end), held(space, middle, 0)]
    problem = NonlinearContactProblem(F, u, bcs=bcs, contact=Foundation(top, shape=circle), algorithm="alm")
    problem.weight = weight
    return problem


def pressed(problem, **further):
    """A ramp of the force; where the circle is after each step, and what it exerts."""
    path = []

    def apply(load):
        problem.place(0, force=(0.0, -FORCE * load), prescribed=HELD)

    def record(step):
        path.append((step.load, float(problem.tools[0].translation[1]), -float(sum(problem.state.forces)[1])))

    problem.ramp(apply, first=0.1, largest=0.1, on_step=record, **further)
    return np.array(path)


@pytest.mark.slow
def test_an_arch_snaps_through():
    """The force rises, falls along a branch on which the circle goes on down, and rises again to its whole."""
    problem = arch(MPI.COMM_SELF, force=(0.0, 0.0), prescribed=HELD)
    loads, places, forces = pressed(problem, control=(0, "y")).T
    assert problem.status is Status.CONVERGED
    assert loads[-1] == 1.0
    assert (np.diff(places) < 0).all()
    falling = np.flatnonzero(np.diff(loads) < 0)
    assert falling.size > 3
    assert loads[falling[0]] > 1.2 * loads[falling[-1] + 1]
    # Tools that are moved there take the same force, on either branch.
    placed = arch(MPI.COMM_SELF)
    for place, force in zip(places, forces, strict=True):
        placed.place(0, shift=(0.0, float(place)))
        placed.solve()
        assert -sum(placed.state.forces)[1] == pytest.approx(force, abs=1e-7 * forces.max())
        placed.advance()
    assert forces == pytest.approx(FORCE * loads, abs=1e-8 * FORCE)
    steps = problem.solution.steps
    assert [step.tools[0].translation[1] for step in steps] == pytest.approx(places, abs=1e-12)
    assert all(step.certificate.holds for step in steps)
    assert (np.diff([step.time for step in steps]) > 0).all()


def pushed(problem, weight=None, prescribed=None, spring=0.0, **further):
    """A ramp of the force, and of a weight on the arch; rows of load, place and what the circle exerts."""
    path = []

    def apply(load):
        placement = {} if prescribed is None else {"prescribed": prescribed}
        if spring:
            placement["spring"] = {"y": spring}
        problem.place(0, force=(0.0, -FORCE * load), **placement)
        if weight is not None:
            weight.value = load

    def record(step):
        path.append((step.load, float(problem.tools[0].translation[1]), -float(sum(problem.state.forces)[1])))

    problem.ramp(apply, on_step=record, **({"first": 0.1, "largest": 0.1} | further))
    assert problem.status is Status.CONVERGED
    return np.array(path)


@pytest.mark.slow
@pytest.mark.parametrize("case", ["prescribed once", "from a distance", "first step", "spring", "weight"])
def test_the_whole_path_however_it_is_stated(case):
    """What is prescribed is given once, or again with each load; the circle comes from a distance; the first step is
    the whole load; a spring holds it, too; another load changes beside the force.  The path snaps through, and ends
    where the whole load alone puts the arch.
    """
    away = 0.4 if case == "from a distance" else 0.0
    shape = {"centre": (0.0, 1.6 + away), "pivot": (0.0, 1.6 + away), "force": (0.0, 0.0), "prescribed": HELD}
    further = {"first step": {"first": None, "largest": None}, "spring": {"spring": 0.02}}.get(case, {})
    further |= {} if case == "prescribed once" else {"prescribed": HELD}

    def heavy():
        """The arch, and what weighs it down."""
        problem = arch(MPI.COMM_SELF, weighs=case == "weight", **shape)
        return problem, problem.weight if case == "weight" else None

    path = pushed(*heavy(), control=(0, "y"), **further)
    loads, places, forces = path.T
    assert forces == pytest.approx(FORCE * loads + further.get("spring", 0.0) * places, abs=1e-8 * FORCE)
    assert loads[-1] == 1.0
    assert (np.diff(loads) < 0).any()  # it falls
    assert np.abs(np.diff(places)).max() < 0.3
    problem, weight = heavy()
    at_once = pushed(problem, weight, **further | {"first": None, "largest": None})
    assert path[-1] == pytest.approx(at_once[-1], abs=1e-8)
    assert problem.shapes[0].shape.prescribed.y is None


def test_a_jump_is_enclosed_and_told(tmp_path):
    """Without control the ramp reaches its load and says between which two loads the arch jumps: the path of the same
    arch on which the circle is prescribed has its limit point between them.  A restart says the same.
    """
    problem = arch(MPI.COMM_SELF, force=(0.0, 0.0), prescribed=HELD)
    path = pressed(problem)
    (found,) = problem.findings
    begin, end = map(float, re.search(r"between the loads (\S+) and (\S+) the body jumps", found.message).groups())
    jump = np.abs(np.diff(path[:, 1])).argmax()
    assert path[jump : jump + 2, 0] == pytest.approx([begin, end], rel=1e-5)
    assert end - begin < 0.03
    placed, peak = arch(MPI.COMM_SELF), 0.0
    for place in np.linspace(path[jump - 1, 1], path[jump, 1] - 0.2, 20):
        placed.place(0, shift=(0.0, float(place)))
        placed.solve()
        peak = max(peak, -sum(placed.state.forces)[1] / FORCE)
    assert begin < peak < end

    def run(restart):
        """The same as a path of load steps."""
        solved = arch(MPI.COMM_SELF, force=(0.0, 0.0), prescribed=HELD)

        def at(load):
            solved.place(0, force=(0.0, -FORCE * load), prescribed=HELD)

        return solved.run(np.linspace(0.1, 0.6, 6), at, folder=tmp_path, restart=restart)

    first, second = run(restart=False), run(restart=True)
    assert [found.path for found in first.findings] == ["load_steps"]
    assert first.findings == second.findings
    assert first.displacement.x.array == pytest.approx(second.displacement.x.array, abs=1e-12)


def bar(law):
    """A square of an elastic law, stress along the bar by its strain, drawn by a force; its problem, and the force."""
    mesh = dmesh.create_rectangle(MPI.COMM_SELF, [[0.0, 0.0], [1.0, 1.0]], [2, 2])
    space = fem.functionspace(mesh, ("Lagrange", 1, (2,)))
    u, v = fem.Function(space), ufl.TestFunction(space)
    force = fem.Constant(mesh, 0.0)
    strain = ufl.sym(ufl.grad(u))
    right, left = (dmesh.locate_entities_boundary(mesh, 1, lambda x, at=at: np.isclose(x[0], at)) for at in (1.0, 0.0))
    tags = dmesh.meshtags(mesh, 1, np.sort(right), 1)
    ds = ufl.Measure("ds", mesh, subdomain_data=tags)
    along = law(strain[0, 0]) * v[0].dx(0)
    F = (along + strain[1, 1] * v[1].dx(1) + 2 * strain[0, 1] * ufl.sym(ufl.grad(v))[0, 1]) * ufl.dx
    bottom, top = (dmesh.locate_entities_boundary(mesh, 1, lambda x, y=y: np.isclose(x[1], y)) for y in (0.0, 1.0))
    bcs, far = [held(space, left, 0), held(space, bottom, 1)], Foundation(top, gap=1.0, direction=(0, 1))
    return NonlinearContactProblem(F - force * v[0] * ds(1), u, bcs=bcs, contact=far), force


def test_what_becomes_softer_does_not_jump():
    """A bar whose stiffness falls to a thirtieth at a strain, drawn by a force through this strain: two steps that are
    halves are shorter, and no jump is told.
    """
    problem, force = bar(lambda e: ufl.conditional(ufl.lt(e, 0.01), e, 0.01 + (e - 0.01) / 30))
    problem.ramp(lambda t: setattr(force, "value", 0.021 * t), first=0.25, largest=0.25)
    assert problem.u.x.array.max() == pytest.approx(0.01 + 30 * 0.011, rel=1e-9)
    assert problem.findings == ()
    assert any("may jump" in event for event in problem.history.events)


@pytest.mark.slow
@pytest.mark.parametrize("before", [0.07, 0.13])
def test_a_jump_from_just_below_its_limit_point(before):
    """A bar that becomes soft over several steps, the last of which ends a share of a step below the limit point: its
    tangent predicts a far way, too, and the jump is told nevertheless.
    """
    limit, end = SOFT * np.arccos(-1 / WAVES), 2 * np.pi * SOFT
    load = limit + WAVES * SOFT * np.sin(limit / SOFT)
    step = load / (8 + before)
    problem, force = bar(lambda e: e + WAVES * SOFT * ufl.sin(e / SOFT))
    problem.ramp(lambda t: setattr(force, "value", t), 10 * step, first=step, largest=step)
    assert problem.u.x.array.max() > end - limit
    (found,) = problem.findings
    begin, end = map(float, re.search(r"between the loads (\S+) and (\S+) the body jumps", found.message).groups())
    assert begin < load * (1 + 1e-6)
    assert end > load * (1 - 1e-6)
    assert end - begin < 2 * step


@pytest.mark.one_quick
@pytest.mark.parametrize(("waves", "soft", "jumps"), [(1.5, 0.1, 2), (0.9, 0.12, 0)])
def test_jumps_within_one_step(waves, soft, jumps):
    """The whole load is one step, of whose way each jump is a third or less: it is divided until each limit point lies
    between two loads that findings name, and a bar that only becomes softer between them jumps nowhere.
    """
    problem, force = bar(lambda e: e + waves * soft * ufl.sin(e / soft))
    limit = soft * np.arccos(-1 / waves) if jumps else 0.0
    first = limit + waves * soft * np.sin(limit / soft)
    last = first + 2 * np.pi * soft * (max(jumps, 1) - 0.07)
    problem.ramp(lambda t: setattr(force, "value", t), last)
    found = [re.search(r"between the loads (\S+) and (\S+) the body", finding.message) for finding in problem.findings]
    assert len(found) == jumps
    for number, loads in enumerate(found):
        begin, end = map(float, loads.groups())
        assert begin * (1 - 1e-5) <= first + 2 * np.pi * soft * number <= end * (1 + 1e-5)
        assert end - begin < last / 10


@pytest.mark.parametrize(("moved", "jumps"), [(0.11, False), (0.13, True)])
def test_a_restart_suspects_the_same(moved, jumps):
    """A step is compared with the last one, of the earlier run, too."""
    earlier, later = Leaps(yields=False), Leaps(yields=False)
    assert not earlier.suspects(0.05, 0.05, 0.0, 0.1)
    earlier.pass_by(0.0, 0.1)
    later.resume(earlier.stored())
    assert [leaps.suspects(moved, 0.1, 0.1, 0.2) for leaps in (earlier, later)] == [jumps, jumps]


class Unsteady:
    """A tool whose drive is the load, and of which contact takes a share of its largest force, to so many digits."""

    number, key = 0, "y"

    def __init__(self, taken, error):
        self.load, self._taken, self._error = 0.0, taken, error

    def drive(self, shapes):
        return self.load

    def missing(self, shapes, state):
        self._error = -self._error
        return self.load - self._taken + self._error, abs(self._taken)

    def apply(self, load):
        self.load = load


@pytest.mark.parametrize("taken", [0.5, 1e-3, 0.0, -0.1])
@pytest.mark.parametrize(("error", "found"), [(0.0, True), (1e-8, True), (1e-6, False)])
def test_a_load_that_holds_to_the_digits_of_a_solve(taken, error, found):
    """Also where the force has fallen to little or nothing; what is wrong by more is no load that holds."""
    tool = Unsteady(taken, error)
    load = load_that_holds(tool, {}, tool.apply, lambda: None, 0.7, 1e-3, 1.0)
    assert (load is not None) == found
    if load is not None:
        assert load == pytest.approx(taken, abs=2 * error + 1e-9)
        assert tool.load == load


def test_an_error_beyond_the_limit_point_goes_back():
    """To the last step, with its load, here of a force that does not fall with the load that is tried."""
    problem, ends, tried = arch(MPI.COMM_SELF, force=(0.0, 0.0), prescribed=HELD), [], []

    def apply(load):
        tried.append(load)
        largest = max((end for end, _ in ends), default=0.0)
        problem.place(0, force=(0.0, -FORCE * max(load, largest)), prescribed=HELD)

    with pytest.raises(FormError, match=r"control: the force on contact\[0\] along y does not change with the load"):
        problem.ramp(
            apply,
            first=0.2,
            largest=0.2,
            control=(0, "y"),
            on_step=lambda step: ends.append((step.load, problem.u.x.array.copy())),
        )
    assert tried[-1] == ends[-1][0] != tried[-2]
    assert (problem.u.x.array == ends[-1][1]).all()
    assert (problem.solution.displacement.x.array == ends[-1][1]).all()
    assert problem.tools[0].translation == pytest.approx(problem.solution.steps[-1].tools[0].translation, abs=1e-14)


def test_a_material_that_takes_small_increments_under_control():
    """Its ``update`` raises an exception where the first load is tried: this is halved, as without control."""
    problem, begun, ends = arch(MPI.COMM_SELF, force=(0.0, 0.0), prescribed=HELD), [0.0], []

    def update():
        if np.abs(problem.u.x.array - begun[0]).max() > FAR:
            raise ValueError("too far")

    def commit():
        begun[0] = problem.u.x.array.copy()

    problem._solver.residual.update, problem._solver.commit = update, commit
    problem.ramp(
        lambda load: problem.place(0, force=(0.0, -FORCE * load), prescribed=HELD),
        0.15,
        control=(0, "y"),
        on_step=lambda step: ends.append(step.load),
    )
    assert ends[0] < ends[-1] == 0.15
    assert np.abs(problem.u.x.array).max() > FAR


def test_what_cannot_be_controlled():
    """By one sentence that names what to give."""
    problem = arch(MPI.COMM_SELF, force=(0.0, 0.0), prescribed=HELD)
    for control in (3, (1, "y"), (0, "z"), (0, "rotation")):
        with pytest.raises(FormError, match="control: must be the number of a foundation that a force moves"):
            pressed(problem, control=control)
    with pytest.raises(FormError, match=r"control: x of contact\[0\] is not moved by a force"):
        pressed(problem, control=(0, "x"))


def test_a_first_step_without_a_solution_under_control():
    """Pushed off the body from the first step on, there is no limit point to go beyond: the end is the named one."""
    problem = arch(MPI.COMM_SELF, force=(0.0, 0.0), prescribed=HELD, centre=(6.0, 1.6), pivot=(6.0, 1.6))
    with pytest.raises(ConvergenceError, match="there is no solution before it"):
        pressed(problem, control=(0, "y"))
    assert problem.status is not Status.CONVERGED
