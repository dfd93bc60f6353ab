"""Guaranteed bounds on several ranks: those of one rank, in every kind of scene, and errors that are raised alike."""

import json
from functools import partial

import numpy as np
import pytest
from bounds_of_pairs import drawn as pair_drawn
from error_bounds import drawn, of_several_materials, pressed
from error_bounds_in_space import drawn as drawn_in_space
from graded_scenes import graded_and_heated
from heated_scenes import drawn as drawn_with
from heated_scenes import heated
from loaded_scenes import drawn as loaded
from mpi4py import MPI
from pairs_in_space import drawn as pair_in_space
from scenes import alone, energy, example1
from spread_meshes import on_all_ranks
from test_bounds_of_other_loads import DENSE
from test_bounds_of_two_bodies import chained
from test_bounds_on_shapes import CIRCLE, TOOL, on_tool
from test_jumping_loads import square

from signorini_fx.addons.bounds import error_bound as proof
from signorini_fx.addons.bounds import whole_problem
from signorini_fx.addons.bounds.bounded_scene import REFUSES
from signorini_fx.machine import parallel
from signorini_fx.mechanics.effects.displacement import PrescribedDisplacement
from signorini_fx.mechanics.mesh.refinement import refine
from signorini_fx.mechanics.statement.settings import Accuracy
from signorini_fx.quantities.proved_statements import ErrorBound
from signorini_fx.results.files import write_results
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.solver import solve

pytestmark = pytest.mark.mpi
WORLD = MPI.COMM_WORLD
# Relative; what systems and sums leave, in space conjugate gradients, the bound counts beside this.
CLOSE = 1e-8


def stepped():
    """Friction in two load steps, the slip of the second one counts from the first one."""
    scene = example1(bound=1.5, nx=12, ny=4, cell="triangle")
    loads = tuple(load.model_copy(update={"factors": (0.5, 1.0)}) for load in scene.traction)
    return scene.model_copy(update={"traction": loads})


def two_cells():
    """Fewer of them than ranks."""
    return square("0", n=1, material=DENSE, gravity={"y": "-4*x[0]**2"})


SCENES = {
    "triangles": partial(pressed, 1),
    "two cells": two_cells,
    "quadrilaterals of degree 2": partial(example1, bound=1.5, nx=6, ny=2, degree=2),
    "several materials": lambda: of_several_materials(drawn(4), 4),
    "a later load step": stepped,
    "a tool": partial(on_tool, CIRCLE | TOOL),
    "gravity": partial(loaded, "gravity", "plane", 4),
    "rotation": partial(loaded, "rotation", "plane", 4),
    "fluid on two bodies": partial(loaded, "fluid", "pair", 4),
    "springs": partial(loaded, "springs", "plane", 4),
    "springs on two bodies": partial(loaded, "springs", "pair", 4),
    "heated": partial(drawn_with, "plane", 5, heated),
    "graded and heated": partial(drawn_with, "plane", 5, graded_and_heated),
    "two bodies": partial(pair_drawn, 3),
    "bonded": partial(pair_drawn, 1, kind="bonded"),
    "a chain": chained,
    "space": partial(drawn_in_space, 1),
    "springs in space": partial(loaded, "springs", "space", 4),
    "preload": partial(loaded, "preload", "plane", 2),
    "springs that vary": partial(loaded, "varying springs", "plane", 4),
    "springs that vary in space": partial(loaded, "varying springs", "space", 5),
    "two bodies in space": partial(pair_in_space, 1),
    "two bodies in space that do not match": partial(pair_in_space, 1, unmatched=1),
}


def bounds_of(solution):
    """The bound of the error and all intervals of forces of a solution, in space none of these."""
    statement = solution.statement
    names = dict.fromkeys(entry.boundary for entry in (*statement.contact, *statement.displacement) if entry.boundary)
    return solution.error_bound, [solution.force_bounds(name, (0.3, 1.0)) for name in names]


def in_order(solution, values):
    """Of values of the cells of this rank those of all ranks, in the order of the input of the mesh."""
    topology, comm = solution.model.tagged.mesh.topology, solution.comm
    numbers = parallel.gather_rows(comm, topology.original_cell_index[: len(values)])
    return parallel.gather_rows(comm, values)[np.argsort(numbers)]


@pytest.mark.one_quick
@pytest.mark.parametrize("kind", SCENES)
def test_one_rank_or_many(kind):
    """Error, its parts and those of the cells, energy, work, forces and words."""
    scene = SCENES[kind]()
    together, by_itself = solve(on_all_ranks(scene), WORLD, check=False), alone(scene, check=False)
    (bound, forces), (expected, expected_forces) = bounds_of(together), bounds_of(by_itself)
    assert isinstance(expected, ErrorBound), expected
    assert WORLD.allgather(str(bound)) == [str(bound)] * WORLD.size
    rounded = 2 * max(bound.round_off, expected.round_off)
    assert 0 < rounded < 1e-6 * expected.error
    close = CLOSE + rounded / expected.error
    for name in ("duality", "data", "moved", "error"):
        assert getattr(bound, name) == pytest.approx(getattr(expected, name), rel=0, abs=close * expected.error)
    assert bound.size == pytest.approx(expected.size, rel=CLOSE)
    # The ends of the interval are quadratic in size and error, and so is what an error that is close changes of them.
    assert bound.strain_energy == pytest.approx(
        expected.strain_energy, rel=CLOSE, abs=close * (expected.size + expected.error) ** 2
    )
    assert (bound.work is None) == (expected.work is None)
    of_cells = in_order(by_itself, expected.squares)
    assert in_order(together, bound.squares) == pytest.approx(of_cells, rel=0, abs=2 * close * sum(of_cells))
    assert bound.grounds.estimated == expected.grounds.estimated
    for ours, theirs in zip(forces, expected_forces, strict=True):
        if isinstance(theirs, str):
            assert ours == theirs
        else:
            size = float(np.abs(theirs).max())
            assert tuple(ours) == pytest.approx(tuple(theirs), abs=close * size)
            assert WORLD.allgather(tuple(ours)) == [tuple(ours)] * WORLD.size
            assert str(ours).partition(";")[2] == str(theirs).partition(";")[2]


@pytest.mark.one_quick
@pytest.mark.mpi(slow=True)
@pytest.mark.parametrize("seed", [1, 5])
def test_finer_solutions_on_ranks_refute_nothing(seed):
    """Energy and forces of degree 2 with cells a quarter as long; where a support moves twice as far they do."""
    scene = pressed(seed)
    solution = solve(scene, WORLD, check=False)
    low, high = solution.error_bound.strain_energy
    interval = solution.force_bounds("top", (0.0, 1.0))
    tagged, element = refine(refine(load_mesh(scene, WORLD))), scene.element.model_copy(update={"degree": 2})
    settings = scene.solver.model_copy(update={"algorithm": "alm"})
    finer = scene.model_copy(update={"mesh": tagged, "element": element, "solver": settings})
    (support,) = scene.displacement
    moved = support.model_copy(update={"x": 2 * support.x, "y": 2 * support.y})
    for reference, right in ((finer, True), (finer.model_copy(update={"displacement": (moved,)}), False)):
        found = solve(reference, WORLD, check=False)
        force = {row.boundary: row.force for row in found.resultants.every()}["top"][1]
        assert (low <= energy(found) <= high) == right
        assert (interval[0] <= force <= interval[1]) == right


def test_a_mean_displacement():
    """Its interval is that of one rank."""
    scene = pressed(1)
    ours, theirs = (
        solution.mean_displacement_bounds("right", (0.2, 1.0)) for solution in (solve(scene, WORLD), alone(scene))
    )
    assert ours[1] - ours[0] > 1e-3 * abs(ours[0])
    assert tuple(ours) == pytest.approx(tuple(theirs), rel=CLOSE)


@pytest.mark.slow
def test_an_accuracy_that_is_certified():
    """The shares of the cells say where the mesh gets finer; the summary tells the bound on all ranks alike."""
    scene = example1(bound=1.5, nx=12, ny=4, gamma="auto")
    scene = scene.model_copy(update={"accuracy": Accuracy(target=0.05, certified=True)})
    together, by_itself = solve(scene, WORLD), alone(scene)
    assert together.error_bound.relative <= 0.05
    assert together.error_bound.relative == pytest.approx(by_itself.error_bound.relative, rel=0.2)  # meshes differ
    cells = [solution.model.tagged.mesh.topology.index_map(2).size_global for solution in (together, by_itself)]
    assert cells[0] == pytest.approx(cells[1], rel=0.2)


def test_the_summary(tmp_path):
    """A scene that asks for the bound has it in its summary on any number of ranks."""
    scene = example1(bound=1.5, nx=12, ny=4, cell="triangle", error_bound=True)
    folder = WORLD.bcast(tmp_path)
    write_results(solve(scene, WORLD), folder, pictures=False)
    WORLD.barrier()
    told = json.loads((folder / "summary.json").read_text(encoding="utf-8"))["error_bound"]
    expected = alone(scene).error_bound
    assert told["guaranteed"]
    assert told["relative_error"] == pytest.approx(expected.relative, rel=1e-6)


@pytest.mark.parametrize("rank", [0, WORLD.size - 1], ids=["first", "last"])
def test_an_error_of_one_rank_is_raised_on_all(rank, monkeypatch):
    """No rank waits for one that cannot send its part."""
    solution = solve(example1(nx=6, ny=2, cell="triangle"), WORLD)
    sent = whole_problem._rows_of

    def rows_of(*arguments):
        if WORLD.rank == rank:
            raise MemoryError("no room")
        return sent(*arguments)

    monkeypatch.setattr(whole_problem, "_rows_of", rows_of)
    if WORLD.size == 1:
        assert isinstance(solution.error_bound, ErrorBound)
        return
    with pytest.raises(MemoryError, match="no room"):
        _ = solution.error_bound


def test_an_error_of_the_bound_is_raised_on_all(monkeypatch):
    """The rank that computes the bound sends what it raised."""
    solution = solve(example1(nx=6, ny=2, cell="triangle"), WORLD)

    def fails(*arguments):
        raise np.linalg.LinAlgError("no factor")

    monkeypatch.setattr(proof.Bounded, "bound", fails)
    with pytest.raises(np.linalg.LinAlgError, match="no factor"):
        _ = solution.error_bound


def test_what_has_no_bound():
    """The same reason on all ranks, before anything is sent and on the first rank."""
    scene = example1(nx=6, ny=2, cell="triangle")
    held = (*scene.displacement, PrescribedDisplacement(at=(0.0, 1.0), x=0.0))
    pinned = solve(scene.model_copy(update={"displacement": held}), WORLD).error_bound
    assert WORLD.allgather(pinned) == [REFUSES["support of a point"]] * WORLD.size
    bound = solve(example1(nx=6, ny=2, cell="triangle"), WORLD).force_bounds("top", (0.0, 1.0))
    assert WORLD.allgather(bound) == ["'top' is neither a support nor a contact"] * WORLD.size
