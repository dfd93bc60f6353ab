"""Every part of a solve that sums over the ranks: all ranks together get what each gets alone.

Whole solves are compared in test_ranks.py; there a wrong sum may hide behind an iteration that ends all the same.
"""

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI
from scenes import PATCH, example1, rectangle
from test_ranks import agree, same_on_all_ranks

from signorini_fx.algebra.contact.active_sets import natural_sets
from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.assembly.mesh_entities import facet_vertices
from signorini_fx.mechanics.body.discretisation import discretise
from signorini_fx.mechanics.effects.displacement import PrescribedDisplacement
from signorini_fx.mechanics.effects.traction import SurfaceTraction
from signorini_fx.mechanics.mesh.refinement import cells_at, mark, refine
from signorini_fx.mechanics.mesh.tagged import TaggedMesh, generate_mesh
from signorini_fx.records import History, Status, Timings
from signorini_fx.results.accuracy.stress_recovery import StressRecovery
from signorini_fx.results.certificate.certificate import certify
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve
from signorini_fx.solving.solve_on_mesh import contact_task
from signorini_fx.tuned import UNEVEN

pytestmark = pytest.mark.mpi
WORLD, ALONE = MPI.COMM_WORLD, MPI.COMM_SELF
SCENE = example1(bound=1.5, nx=12, ny=4, gamma=1e4)
FREE = SCENE.model_copy(update={"displacement": ()})


def test_rows_of_all_ranks():
    """Stacked in the order of the ranks, also where a rank has none and made them of another type."""
    rows = np.arange(2.0 * WORLD.rank).reshape(-1, 2) if WORLD.rank else np.empty((0, 2), dtype=np.int32)
    expected = np.vstack([np.arange(2.0 * rank).reshape(-1, 2) for rank in range(WORLD.size)])
    every = parallel.gather_rows(WORLD, rows)
    assert every.dtype == np.dtype(float if WORLD.size > 1 else np.int32)
    np.testing.assert_array_equal(every, expected)
    on_root = parallel.rows_on_root(WORLD, rows[:, 0] > 1)
    assert on_root.dtype == np.dtype(bool)
    np.testing.assert_array_equal(on_root, expected[:, 0] > 1 if WORLD.rank == 0 else [])


class Unsendable(Exception):
    """One that pickle refuses, as it holds a function of a function."""

    def __init__(self, words):
        super().__init__(words)
        self.again = lambda: words


def test_errors_that_cannot_be_sent():
    """All ranks raise them, in words."""

    def fails():
        raise Unsendable("as it was")

    with pytest.raises(Unsendable if WORLD.size == 1 else RuntimeError, match="as it was"):
        parallel.on_root(WORLD, fails)
    mine = Unsendable("as it was") if WORLD.rank == WORLD.size - 1 else None
    with pytest.raises(Unsendable if WORLD.size == 1 else RuntimeError, match="as it was"):
        parallel.raise_together(WORLD, mine)


@pytest.mark.parametrize("cell", ["tetrahedra", "hexahedra"])
def test_size_of_a_body(cell):
    """The diagonal of a block, upright and oblique, on ranks whose own facets lie in a plane too."""
    kind = dmesh.CellType.tetrahedron if cell == "tetrahedra" else dmesh.CellType.hexahedron
    mesh = dmesh.create_box(WORLD, [[0, 0, 0], [3, 1, 2]], [6, 1, 2], kind)
    empty = dmesh.meshtags(mesh, 2, np.empty(0, dtype=np.int32), np.empty(0, dtype=np.int32))
    assert TaggedMesh(mesh, empty, {}, None, {}).size == pytest.approx(np.sqrt(14), rel=1e-14)
    mesh.geometry.x[:, 0] += mesh.geometry.x[:, 2] / 2  # the other diagonals of the oblique block are shorter
    assert TaggedMesh(mesh, empty, {}, None, {}).size == pytest.approx(np.sqrt(21), rel=1e-14)


def discretised(scene, comm):
    return discretise(scene.statement, load_mesh(scene, comm), Timings())


def field(discretisation, a, b):
    """A smooth displacement as a vector, zero where it is prescribed."""
    d = discretisation
    x = d.space.tabulate_dof_coordinates()[: d.space.dofmap.index_map.size_local]
    vector = d.stiffness.createVecRight()
    values = 1e-2 * np.column_stack((np.sin(a * x[:, 0] + x[:, 1]), np.cos(b * x[:, 0] - 2 * x[:, 1])))
    vector.getArray()[:] = np.where(d.fixed, 0.0, values.ravel())
    return vector


def both(measure, scene=SCENE):
    """What ``measure`` makes of the discretised scene: of all ranks together, the same on each, and of one."""
    return same_on_all_ranks(measure(discretised(scene, WORLD))), measure(discretised(scene, ALONE))


def test_norm_of_the_contact_boundary():
    """|1| is the square root of the length."""
    together, alone = both(lambda d: d.boundary.points.norm(np.ones(d.boundary.size)))
    assert together == pytest.approx(alone, rel=1e-14)
    assert alone == pytest.approx(np.sqrt(3.0), rel=1e-14)


def test_work_of_the_residual():
    """On a smooth field, at another one."""

    def work(d):
        task = contact_task(d, History())
        problem, x = task.iterate.newton.problem, field(d, 1.0, 2.0)
        problem.set_data(task.start.data)
        sets, residual = natural_sets(*problem.system.contact.traces(x), task.start.data), x.duplicate()
        problem.imbalance(x, *problem.multipliers(x, sets), residual)
        return float(residual.dot(field(d, -3.0, 1.0)))

    together, alone = both(work)
    assert together == pytest.approx(alone, rel=1e-10)


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
@pytest.mark.parametrize("degree", [1, 2])
def test_error_estimate(cell, degree):
    """Stress recovery of a smooth displacement."""
    scene = example1(bound=1.5, nx=12, ny=4, cell=cell, degree=degree)
    together, alone = both(lambda d: StressRecovery.of(d).error(d.function(field(d, 1.0, 2.0))), scene)
    assert together == pytest.approx(alone, rel=1e-5)  # the projection is solved to 1e-6
    assert alone > 0


@pytest.mark.parametrize(("step", "factor"), [(0, 1.0), (1, 0.5)])
def test_resultant(step, factor):
    """Of the loads on a body that is free, about its middle: 20 on a unit length, downwards, in the middle."""
    steps = FREE.model_copy(update={"traction": (FREE.traction[0].model_copy(update={"factors": (1.0, 0.5)}),)})

    def resultant(d):
        system = contact_task(d, History()).system
        system.set_load(d.factors(step))
        return np.round(system.resultant, 9).tolist()

    together, alone = both(resultant, steps)
    assert together == pytest.approx(alone, abs=1e-8)
    assert alone == pytest.approx([0.0, -20.0 * factor, 0.0], abs=1e-8)


def test_few_ranks_condense():
    """What one rank condenses, some do too; they count the unknowns that contact touches alike."""
    d = discretised(example1(bound=1.5, nx=120, ny=40), WORLD)
    assert same_on_all_ranks(d.system_size.retained) == 2 * 121
    kind = same_on_all_ranks(contact_task(d, History()).linear_algebra)
    if WORLD.size <= 3:
        assert kind.startswith("condensed: 242 of 9922 unknowns")
    else:
        assert kind.startswith("full: 242 of 9922 unknowns are on the contact boundary and about")


SUPPORTS = {"none": (), "left": ("left",), "both": ("left", "right")}


@pytest.mark.parametrize("names", SUPPORTS)
def test_free_motions(names):
    """Sides that are held along x leave the vertical motion; no support leaves all three."""
    held = tuple(PrescribedDisplacement(boundary=name, x=0.0) for name in SUPPORTS[names])

    def free(d):
        return np.round(d.motions.free @ d.motions.free.T, 9).tolist()

    together, alone = both(free, SCENE.model_copy(update={"displacement": held}))
    np.testing.assert_allclose(together, alone, atol=1e-8)
    np.testing.assert_allclose(alone, np.diag([0.0, 1.0, 0.0]) if held else np.eye(3), atol=1e-8)


@pytest.mark.parametrize(("ends", "stick", "held"), [(2, 1, True), (1, 1, False), (2, 0, False), (0, 1, False)])
def test_what_holds_a_body(ends, stick, held):
    """Contact at both ends and stick at one of them hold it, whichever ranks these nodes are on; less does not."""

    def judge(d):
        x = d.boundary.x[:, 0]
        normal = (x < 0.1) & (ends > 0) | (x > 2.9) & (ends > 1)
        return d.motions.at(d.boundary).held_by(normal, (x > 2.9) & (stick > 0))

    assert both(judge, FREE) == (held, held)


@pytest.mark.parametrize(("side", "component", "sign"), [("left", 0, -1), ("right", 0, 1), ("top", 1, 1)])
def test_outward_displacement(side, component, sign):
    """Which side of a support is outward is known to ranks that have nothing of it."""
    scene = SCENE.model_copy(update={"displacement": (PrescribedDisplacement(boundary=side, normal=0.01),)})

    def prescribed(d):
        start = d.cases[-1].start if d.cases[-1].start.norm() > 0 else d.cases[0].start
        values = start.getArray(readonly=True).reshape(-1, 2)[d.fixed.reshape(-1, 2)[:, component], component]
        return [parallel.global_max(d.tagged.mesh.comm, parallel.local_max(s * values, -np.inf)) for s in (1, -1)]

    together, alone = both(prescribed, scene)
    assert together == alone
    assert alone[0 if sign > 0 else 1] == 0.01


@pytest.mark.parametrize(("nx", "ny"), [(2, 2), (1, 3), (12, 4)])
@pytest.mark.parametrize("law", [{"bound": 0.5}, {"coefficient": 0.01}], ids=["tresca", "coulomb"])
def test_how_a_body_gets_away(nx, ny, law):
    """One that is pushed aside slides, also for ranks that nothing presses on."""
    scene = example1(**law, nx=nx, ny=ny, gamma=1e4)
    pushed = SurfaceTraction(boundary="left", x=10.0)
    scene = scene.model_copy(update={"displacement": (), "traction": (*scene.traction, pushed)})
    assert same_on_all_ranks(solve(scene, WORLD, check=False).status) is Status.SLIDES
    assert solve(scene, ALONE, check=False).status is Status.SLIDES


def test_certificate():
    """Every figure is that of all ranks."""
    solution = solve(example1(bound=1.5, nx=30, ny=10, patch=PATCH), WORLD)
    figures = same_on_all_ranks(solution.certificate.as_dict())
    assert figures["holds"]


def test_certificate_of_a_wrong_displacement():
    """The residual is that of all ranks, relative to all forces."""
    clamped = tuple(support.model_copy(update={"y": 0.0}) for support in SCENE.displacement)
    scene = SCENE.model_copy(update={"displacement": clamped, "contact": ()})

    def wrong(comm):
        solution = solve(scene, comm)
        solution.displacement.x.array[:] *= 1.1
        return certify(scene.statement, solution.model.tagged, solution.displacement, None).equilibrium

    assert same_on_all_ranks(wrong(WORLD)) == pytest.approx(wrong(ALONE), rel=1e-6)
    assert wrong(ALONE) > 1e-3


HALF_DISK = parse_scene(
    {
        "mesh": {"generator": "half_disk", "parameters": {"radius": 1.0, "size": 0.2, "contact_size": 0.1}},
        "material": {"young": 5000.0, "poisson": 0.3},
        "traction": {"boundary": "top", "x": 0.5, "y": -5.0},
        "contact": {"boundary": "arc", "gap": 1e-3, "friction": {"law": "tresca", "bound": 1.0}},
        "solver": {"algorithm": "alm"},
    }
)
LIMITS = {
    "along the axes": example1(bound=1.5, nx=30, ny=10, algorithm="alm"),
    "Coulomb": example1(coefficient=0.3, nx=30, ny=10, algorithm="alm"),
    "turned nodes": HALF_DISK,
}


@pytest.mark.one_quick
@pytest.mark.mpi(slow=True)
@pytest.mark.parametrize("name", LIMITS)
def test_the_limit(name):
    """Constraints, and nodes turned into their normals, are in the rows of their own rank."""
    assert agree(LIMITS[name]).converged


def test_marking():
    """The fewest cells that hold half of the error, wherever they are."""
    errors = np.random.default_rng(3).exponential(size=60) ** 2
    mine = np.array_split(np.arange(60), WORLD.size)[WORLD.rank]
    found = parallel.gather_rows(WORLD, mine[mark(WORLD, errors[mine])])
    assert found.tolist() == mark(ALONE, errors).tolist()
    largest = np.sort(errors)[::-1]
    assert len(found) == np.searchsorted(np.cumsum(largest), errors.sum() / 2) + 1


def test_regions_of_a_refined_mesh():
    """A child is in the region of its parent."""
    tagged = rectangle(WORLD, nx=6, ny=3, cell="triangle")
    mesh = tagged.mesh
    index_map = mesh.topology.index_map(2)
    cells = np.arange(index_map.size_local + index_map.num_ghosts, dtype=np.int32)
    right = dmesh.compute_midpoints(mesh, 2, cells)[:, 0] > 1.5
    tags = dmesh.meshtags(mesh, 2, cells, right.astype(np.int32) + 1)
    fine = refine(TaggedMesh(mesh, tagged.facet_tags, tagged.boundaries, tags, {"left": 1, "right": 2}))
    for name, sign in (("left", -1), ("right", 1)):
        x = dmesh.compute_midpoints(fine.mesh, 2, fine.cells(name))[:, 0]
        assert (sign * (x - 1.5) > 0).all()
    owned = fine.mesh.topology.index_map(2).size_local
    children = parallel.global_sum(WORLD, np.array([np.sum(fine.cells(name) < owned) for name in ("left", "right")]))
    assert children[0] == children[1] > 36


def measures(tagged):
    """Length or area of every boundary, and area or volume of every region."""
    mesh, dim = tagged.mesh, tagged.dimension
    owned = mesh.topology.index_map(dim).size_local
    simplices = {name: facet_vertices(mesh, tagged.facets(name)) for name in tagged.boundaries}
    for name in tagged.regions:
        cells = tagged.cells(name)
        simplices[name] = mesh.geometry.x[compat.geometry_cells(mesh)[cells[cells < owned]]]
    return {name: float(parallel.global_sum(WORLD, volumes(x).sum())) for name, x in simplices.items()}


def volumes(x):
    """Volumes of simplices, up to the same factor for all of one dimension, from their corners, shape (n, k, 3)."""
    sides = x[:, 1:] - x[:, :1]
    return np.sqrt(np.linalg.det(sides @ sides.transpose(0, 2, 1)))


@pytest.mark.parametrize("name", ["rectangle", "box"])
def test_cells_are_distributed_anew(name):
    """Refinement in a corner leaves no rank with many more cells than the others, and moves all names along."""
    cell = {"rectangle": "triangle", "box": "tetrahedron"}[name]
    tagged = generate_mesh(name, {"nx": 6, "ny": 4, "cell": cell, **({"nz": 4} if name == "box" else {})}, WORLD)
    dim = tagged.dimension
    mesh = tagged.mesh
    cells = np.arange(len(compat.geometry_cells(mesh)), dtype=np.int32)
    far = dmesh.compute_midpoints(mesh, dim, cells).sum(axis=1) > 1
    tagged = TaggedMesh(
        mesh,
        tagged.facet_tags,
        tagged.boundaries,
        dmesh.meshtags(mesh, dim, cells, far.astype(np.int32) + 1),
        {"near": 1, "far": 2},
    )
    before = measures(tagged)
    for _ in range(5):
        tagged = refine(tagged, cells_at(tagged, np.zeros((1, dim))))
        cells = tagged.mesh.topology.index_map(dim)
        assert parallel.global_max(WORLD, cells.size_local) * WORLD.size <= UNEVEN * cells.size_global
    after = measures(tagged)
    assert after == pytest.approx(before, rel=1e-12)
    assert set(after) == {*tagged.boundaries, "near", "far"}


def test_meshes_that_are_fine_where_it_touches():
    entries = {
        "mesh": {"generator": "half_disk", "parameters": {"contact_size": 0.2}, "contact_size": 0.2},
        "material": {"young": 1e3, "poisson": 0.3},
        "contact": [{"boundary": "arc"}],
    }
    tagged, alone = (load_mesh(parse_scene(entries), comm) for comm in (WORLD, ALONE))
    for dim in (1, 2):
        tagged.mesh.topology.create_entities(dim)
        alone.mesh.topology.create_entities(dim)
        assert tagged.mesh.topology.index_map(dim).size_global == alone.mesh.topology.index_map(dim).size_local
    facets = tagged.facets("arc")
    lengths = tagged.mesh.h(1, facets)
    assert parallel.global_sum(WORLD, np.array([len(facets)]))[0] == len(alone.facets("arc"))
    assert parallel.largest(WORLD, lengths) < 0.3
