"""Programs on the problems: ours meets each reference on the coarsest mesh, others where they are installed."""

import shutil

import numpy as np
import pytest

from benchmarks.contactbench.adapters import adapter
from benchmarks.contactbench.adapters.calculix_deck import deck
from benchmarks.contactbench.adapters.signorini import scene
from benchmarks.contactbench.answers import CannotRun, measured
from benchmarks.contactbench.elasticity import nodal_loads
from benchmarks.contactbench.grids import make_grid
from benchmarks.contactbench.judging import Result, distance, judge
from benchmarks.contactbench.problem import problem_names, read_problem

NAMES = problem_names()
# One of each kind: dimension, law, one and two bodies, degree of the element, with and without supports.
QUICK = ["smooth-edge", "example1-coulomb", "cattaneo-mindlin", "smooth-edge-coulomb", "tube-on-shaft"]
QUICK += ["press-fit-plane", "patch-slip-space", "ring"]
each_problem = pytest.mark.parametrize(
    "name", [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in NAMES]
)
# Further than a reference allows on the coarsest mesh: a penalty is no part of the problem.
PENALTY = {"patch-stick": 0.002, "patch-slip": 0.006, "patch-slip-space": 0.006}


def errors(program, name, level=0):
    problem = read_problem(name)
    grid = make_grid(problem, level)
    answer = adapter(program)(problem, grid)
    values = measured(problem, grid, answer)
    assert answer.unknowns >= grid.points.size
    assert answer.seconds > 0
    return {q.name: (distance(q, values[q.name]), q.tolerance) for q in problem.quantities if q.name in values}


@pytest.mark.one_quick
@each_problem
def test_the_package_meets_every_reference(name):
    """On the coarsest mesh within the tolerance of the file."""
    found = errors("signorini_fx", name)
    assert {key: value for key, value in found.items() if value[0] > value[1]} == {}


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in NAMES if not name.startswith(("patch", "stacked"))])
def test_errors_fall(name):
    """On two finer meshes each error is smaller than the tolerance by 1.6 a mesh, unless it was small from the start.

    Intervals and two values that agree to less than the error of the mesh have no such slope.
    """
    problem = read_problem(name)
    for key, (error, tolerance) in errors("signorini_fx", name, 2 if problem.dimension == 2 else 1).items():
        if problem.quantity(key).kind == "exact":
            levels = 2 if problem.dimension == 2 else 1
            assert error <= tolerance / 1.6**levels, key


@pytest.mark.slow
@pytest.mark.parametrize("name", ["smooth-edge-tresca", *(pytest.param(n, marks=pytest.mark.slow) for n in NAMES)])
def test_dolfinx(name):
    """A penalty by hand."""
    compared("dolfinx", name, PENALTY)


@pytest.mark.parametrize("name", ["patch-stick", *(pytest.param(n, marks=pytest.mark.slow) for n in NAMES)])
def test_getfem(name):
    """Its brick."""
    compared("getfem", name, {})


def compared(program, name, excused):
    try:
        found = errors(program, name)
    except CannotRun as why:
        pytest.skip(f"{program}: {why}")
    for key, (error, tolerance) in found.items():
        assert error <= max(tolerance, excused.get(name, 0.0)), key


def test_calculix_deck():
    """Fields of at most 20 characters, a foundation at the gap, forces that add up; where ccx is, it solves it."""
    for name in ("hertz-line", "patch-slip-space", "sphere"):
        problem = read_problem(name)
        grid = make_grid(problem)
        lines = deck(problem, grid)
        fields = [word.strip() for line in lines if not line.startswith("*") for word in line.split(",")]
        assert max(map(len, fields)) <= 20
        numbers = {}
        for line in lines[lines.index("*NODE, NSET=GROUND") + 1 :]:
            if line.startswith("*"):
                break
            number, *x = line.split(",")
            numbers[int(number)] = [float(c) for c in x]
        own = grid.nodes(problem.contacts[0].boundary)
        assert len(numbers) == 2 * len(own)
        surface = np.array([numbers[len(grid.points) + 1 + k] for k in range(len(own))])
        gap = grid.points[own] - surface
        np.testing.assert_allclose(gap[:, :-1], 0.0, atol=1e-10)
        radius = (grid.points[own][:, :-1] ** 2).sum(axis=1)
        expected = 0.0 if "patch" in name else radius / (2 * problem.numbers["R"])
        np.testing.assert_allclose(gap[:, -1], expected, atol=1e-10)
        if "*CLOAD" in lines:
            rows = [line.split(",") for line in lines[lines.index("*CLOAD") + 1 :] if line[0].isdigit()]
            total = sum(float(value) for _, axis, value in rows if int(axis) == problem.dimension)
            assert total == pytest.approx(nodal_loads(problem, grid)[:, -1].sum(), abs=1e-9)
    if shutil.which("ccx") is None:
        pytest.skip("there is no ccx")
    for name in ("patch-compression", "tube-on-shaft"):
        compared("calculix", name, {})


INTERVALS = [name for name in NAMES if any(q.kind == "interval" for q in read_problem(name).quantities)]


@pytest.mark.slow
@pytest.mark.parametrize("name", INTERVALS)
def test_nothing_refutes_an_interval(name):
    """The value of the finest meshes that are affordable, and its limit by Richardson, lie within."""
    from mpi4py import MPI

    import signorini_fx

    problem = read_problem(name)
    for degree, levels in ((1, (2, 3)), (2, (1, 2, 3))):
        found = []
        for level in levels:
            grid = make_grid(problem, level)
            solution = signorini_fx.solve(scene(problem, grid, degree)[0], MPI.COMM_SELF)
            force = float(np.dot(solution.contact.boundary.weight, solution.contact.pressure))
            found.append({"strain energy": solution.steps[-1].strain_energy, "force": force})
        for quantity in problem.quantities:
            if quantity.kind == "interval":
                values = [one[quantity.name] for one in found]
                limit = values[-1] + (values[-1] - values[-2])
                for value in (values[-1], limit):
                    assert quantity.numbers[0] <= value <= quantity.numbers[1]
    grid = make_grid(problem, 1)
    values = measured(problem, grid, adapter("dolfinx")(problem, grid))
    results = [Result(q.name, values[q.name]) for q in problem.quantities if q.kind == "interval"]
    assert all(verdict.error == 0.0 for verdict in judge(problem, results))
