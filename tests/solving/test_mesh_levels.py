"""Coarser meshes as levels of multigrid: interpolation is exact where it can be, and solves take few steps."""

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc
from scenes import example1
from scipy.spatial import cKDTree
from spaces import block, box, friction_of
from test_krylov import LAWS, agree, set_ups, steps  # noqa: F401
from test_ranks import same_on_all_ranks
from test_space_patch import rotation
from two_bodies import assembled, grid

from signorini_fx.algebra.linalg import multigrid
from signorini_fx.mechanics.body.discretisation import discretise
from signorini_fx.mechanics.mesh.points import at_points
from signorini_fx.mechanics.mesh.tagged import tag_boundaries
from signorini_fx.mechanics.rigid import mesh_levels
from signorini_fx.records import History, Timings
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.mesh_sequence import solve_scenes
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve
from signorini_fx.scenes.sweep import _coarser, _Value, sweep
from signorini_fx.solving.first_start import begin_at_coarse
from signorini_fx.solving.solve_on_mesh import contact_task

WORLD, SELF = MPI.COMM_WORLD, MPI.COMM_SELF


def level(scene, comm, coarser=None):
    """The level of a scene's mesh over a coarser one."""
    return discretise(scene.statement, load_mesh(scene, comm), Timings()).level(coarser)


def generated(name, parameters, **solver):
    """A body from a generator, moved down onto a foundation by its top."""
    return parse_scene(
        {
            "mesh": {"generator": name, "parameters": parameters},
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": {"boundary": "top", "x": 0.0, "y": 0.0, "z": -0.01},
            "contact": {
                "boundary": "bottom" if name != "half_sphere" else "sphere",
                "gap": "x[2] - 1e-9",
                "friction": friction_of(bound=0.5),
            },
            "solver": solver,
        }
    )


def linear(x):
    """A displacement that is linear in the place."""
    dim = x.shape[1]
    slope = np.arange(1.0, 1.0 + dim * dim).reshape(dim, dim)
    return x @ slope.T + np.arange(dim)


MESHES = {
    "rectangle": [lambda _, n=n: example1(nx=n, ny=n // 3) for n in (12, 24)],
    "quadratic": [lambda _, n=n: example1(nx=n, ny=n // 3, degree=2, cell="triangle") for n in (6, 12)],
    "hexahedra": [lambda comm, n=n: block(n, comm=comm) for n in (6, 12)],
    "tetrahedra": [lambda comm, n=n: block(n, "tetrahedra", comm=comm) for n in (6, 12)],
    # Neither is nested in the other.
    "not nested": [lambda comm, n=n: block(n, comm=comm) for n in (6, 15)],
    "other cells": [lambda comm, n=n, c=c: block(n, c, comm=comm) for n, c in ((6, "tetrahedra"), (12, "hexahedra"))],
    # Nodes of the finer mesh are outside the coarser one.
    "cylinder": [lambda _, k=k: generated("cylinder", {"nr": k, "nt": k, "nz": k}) for k in (2, 4)],
    "half a sphere": [lambda _, h=h: generated("half_sphere", {"contact_size": h, "size": 4 * h}) for h in (1, 0.5)],
}


@pytest.mark.mpi
@pytest.mark.parametrize("name", MESHES)
def test_linear_functions_are_interpolated_exactly(name):
    """At all unknowns that are free, wherever no coarse one is prescribed nearby; also on ranks that share no cells."""
    coarse, fine = (level(scene(WORLD), WORLD) for scene in MESHES[name])
    coarse.fixed[:] = False
    fine.fixed[:] = False
    fine.coarser = coarse
    assert fine.interpolation is not None
    vectors = []
    for one in (coarse, fine):
        x = one.space.tabulate_dof_coordinates()[: one.fixed.size // one.block, : one.block]
        vectors.append(one.vector())
        vectors[-1].getArray()[:] = linear(x).ravel()
    found = vectors[1].duplicate()
    fine.interpolation.mult(vectors[0], found)
    wanted = vectors[1].getArray()
    np.testing.assert_allclose(found.getArray(), wanted, rtol=0, atol=1e-9 * vectors[1].norm(PETSc.NormType.INF))


# Whether all nodes are looked up on one rank.
LOOKED_UP = dict.fromkeys(("rectangle", "quadratic", "hexahedra", "tetrahedra"), True)
LOOKED_UP |= dict.fromkeys(("not nested", "cylinder"), False)


@pytest.mark.mpi
@pytest.mark.parametrize("name", [*LOOKED_UP, "touching"])
def test_places_that_are_looked_up_are_those_that_are_found(name, monkeypatch):
    """The same interpolation to round-off as by the search alone, also of two bodies whose nodes are at the same
    places; where meshes are nested nothing is sought on one rank.
    """
    if name == "touching":
        coarse, fine = (level(touching(n), WORLD) for n in (1, 2))
    else:
        coarse, fine = (level(scene(WORLD), WORLD) for scene in MESHES[name])
    fine.coarser, sought = coarse, []

    def search(mesh, x, *arguments):
        sought.append(len(x))
        return at_points(mesh, x, *arguments)

    monkeypatch.setattr(mesh_levels, "at_points", search)
    interpolation = fine.interpolation
    if WORLD.size == 1:
        assert (sum(sought) == 0) == LOOKED_UP.get(name, True)
    del fine.interpolation
    monkeypatch.setattr(mesh_levels, "at_lattice", nowhere)
    interpolation.axpy(-1.0, fine.interpolation, structure=PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
    assert interpolation.norm(PETSc.NormType.NORM_INFINITY) <= 1e-9


def touching(n):
    """Two cubes on each other that are not joined, each held at its end, with the same nodes where they touch."""
    cubes = (grid("hexahedron", (n, n, n), (0, 0, z), (1, 1, z + 1)) for z in (0, 1))
    mesh = assembled("hexahedron", *cubes, comm=WORLD)
    tagged = tag_boundaries(mesh, {"bottom": lambda x: x[2] < 1e-9, "top": lambda x: x[2] > 2 - 1e-9})
    held = [{"boundary": name, "x": 0.0, "y": 0.0, "z": 0.0} for name in ("bottom", "top")]
    return parse_scene({"mesh": tagged, "material": {"young": 1.0, "poisson": 0.3}, "displacement": held})


def nowhere(mesh, x, *_):
    """No point is at a lattice point."""
    return np.full(len(x), -1), np.zeros(len(x), dtype=np.int64), np.zeros((1, mesh.topology.dim))


def test_prescribed_unknowns_do_not_move():
    """Neither those of the finer mesh nor by those of the coarser one."""
    coarse = level(block(6), SELF)
    fine = level(block(12), SELF, coarse)
    rows, columns, values = fine.interpolation.getValuesCSR()
    assert fine.fixed.any()
    assert coarse.fixed.any()
    assert not values[np.repeat(fine.fixed, np.diff(rows))].any()
    assert not values[coarse.fixed[columns]].any()


def test_levels_in_between():
    """Meshes of nearly the same size are left out; a mesh far too coarse is no level."""
    coarse, same, fine, finest = (level(block(n), SELF) for n in (6, 9, 12, 27))
    d = discretise(block(12).statement, load_mesh(block(12), SELF), Timings())
    same.coarser = coarse
    assert d.level(same).coarser is coarse
    assert d.level(coarse).coarser is coarse
    assert d.level(finest).coarser is None
    assert d.level(fine).coarser is None
    d = discretise(block(27).statement, load_mesh(block(27), SELF), Timings())
    assert d.level(coarse).coarser is None


def test_another_body_is_no_coarser_mesh():
    """A mesh that does not cover the finer one gives no interpolation, and multigrid does without it."""
    half = parse_scene(
        {
            "mesh": {"generator": "box", "parameters": {"length": 1.0, "nx": 3, "ny": 3, "nz": 3}},
            "material": {"young": 1.0, "poisson": 0.3},
            "displacement": {"boundary": "left", "x": 0.0, "y": 0.0, "z": 0.0},
        }
    )
    assert level(block(12), SELF, level(half, SELF)).interpolation is None


def nested(scenes, comm=SELF):
    """The solution on the last of some meshes."""
    return solve_scenes(scenes, comm, History())


NESTED = {
    **{law: lambda law=law, **s: [block(n, gamma=1e8, **LAWS[law], **s) for n in (6, 12)] for law in LAWS},
    "tetrahedra": lambda **s: [block(n, "tetrahedra", gamma=1e5, **LAWS["tresca"], **s) for n in (6, 12)],
    "three meshes": lambda **s: [example1(bound=1.5, nx=n, ny=n // 3, **s) for n in (15, 30, 60)],
    "not nested": lambda **s: [block(n, bound=1.5, gamma=1e7, **s) for n in (6, 15)],
    "alm": lambda **s: [block(n, bound=1.5, gamma="auto", algorithm="alm", **s) for n in (6, 12)],
    "quadratic": lambda **s: [example1(bound=1.5, nx=n, ny=n // 3, degree=2, **s) for n in (15, 30)],
}


@pytest.mark.one_quick
@pytest.mark.parametrize("name", NESTED)
def test_same_answer_as_a_factorisation(name, set_ups):  # noqa: F811
    """To 1e-8 of the largest, whatever the coarser meshes are; one hierarchy for each mesh."""
    ours, theirs = (nested(NESTED[name](linear_algebra=kind)) for kind in ("krylov", "full"))
    agree(ours, theirs)
    assert len(set_ups) == len(set(set_ups)) == len(NESTED[name]())


CURVED = {
    "cylinder": ("cylinder", {"nr": 4, "nt": 4, "nz": 6}),
    "half a sphere": ("half_sphere", {"contact_size": 0.5, "size": 2.0}),
}


@pytest.mark.one_quick
@pytest.mark.parametrize("name", CURVED)
def test_curved_bodies(name):
    """Nodes beyond the coarser mesh take the shape functions of the nearest cell."""
    ours, theirs = (solve(generated(*CURVED[name], levels=2, linear_algebra=kind), SELF) for kind in ("krylov", "full"))
    assert theirs.contact.in_contact.any()
    agree(ours, theirs)


def between_walls(n, **solver):
    """A brick turned in 3D between two walls that are across no axis, pushed along both of them."""
    turn = rotation(0.9, (0.3, -0.8, 0.5))
    tagged = box("hexahedra", (n, n, n), size=(1.5, 1.2, 1.0))
    tagged.mesh.geometry.x[:] = tagged.mesh.geometry.x @ turn.T
    return parse_scene(
        {
            "mesh": tagged,
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": [{"boundary": "left", "normal": 0.0}, {"boundary": "front", "normal": 0.0}],
            "traction": {"boundary": "top", "pressure": 1.0},
            "contact": {"boundary": "bottom", "friction": friction_of(bound=0.3)},
            "solver": solver,
        }
    )


def test_skew_supports(steps):  # noqa: F811
    """Unknowns in frames of their own on either mesh; the interpolation turns them, with as few steps."""
    ours, theirs = (nested([between_walls(n, linear_algebra=kind) for n in (4, 8)]) for kind in ("krylov", "full"))
    assert ours.model.rotation is not None
    agree(ours, theirs)
    assert max(count for *_, count in steps) <= 12


def test_frames_of_skew_supports():
    """A linear displacement in the frames of the coarser mesh becomes the same in those of the finer one."""
    coarse, fine = (level(between_walls(n), SELF) for n in (4, 8))
    fine.coarser = coarse
    turned = []
    for one in (coarse, fine):
        one.fixed[:] = False
        flat, own = one.vector(), one.vector()
        flat.getArray()[:] = linear(one.space.tabulate_dof_coordinates()).ravel()
        one.rotation.multTranspose(flat, own)
        assert (own - flat).norm() > 0.1 * flat.norm()
        turned.append(own)
    found = fine.vector()
    fine.interpolation.mult(turned[0], found)
    wanted = turned[1].getArray()
    np.testing.assert_allclose(found.getArray(), wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())


@pytest.mark.parametrize("cells", ["hexahedra", "tetrahedra"])
def test_the_coarser_displacement_is_the_start(cells):
    """At the nodes of the coarser mesh it is what it was there, although each body has a reference motion of its
    own.
    """
    coarse = solve(block(6, cells, bound=1.5, linear_algebra="krylov"), SELF)
    scene = block(12, cells, bound=1.5, linear_algebra="krylov")
    d = discretise(scene.statement, load_mesh(scene, SELF), Timings())
    below = coarse.model.level(None, coarse.displacement)
    task = contact_task(d, History(), below)
    assert task.rest is not None
    begin_at_coarse(task, below, d)
    found = d.from_rest(task.rest, task.iterate.x).x.array.reshape(-1, 3)
    wanted = coarse.displacement.x.array.reshape(-1, 3)
    distance, node = cKDTree(d.space.tabulate_dof_coordinates()).query(coarse.model.space.tabulate_dof_coordinates())
    assert distance.max() < 1e-12
    np.testing.assert_allclose(found[node], wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())


def test_a_coarsest_mesh_that_is_large(monkeypatch, steps):  # noqa: F811
    """It is coarsened further by aggregation, with hardly more steps."""
    scenes = NESTED["tresca"](linear_algebra="krylov")
    assert nested(scenes).converged
    direct = sum(count for *_, count in steps)
    steps.clear()
    monkeypatch.setattr(multigrid, "MOST_COARSEST_UNKNOWNS", 100)
    assert nested(scenes).converged
    assert direct <= sum(count for *_, count in steps) <= 1.3 * direct


def test_steps_do_not_grow_with_the_mesh(steps):  # noqa: F811
    """In 2D from 60 x 20 to 240 x 80 cells: 2.5 times those of one linear solve at most."""
    spent = []
    for nx in (60, 240):
        steps.clear()
        scene = example1(bound=1.5, nx=nx, ny=nx // 3, levels=1 + int(np.log2(nx / 15)), linear_algebra="krylov")
        assert solve(scene, SELF).converged
        finest = max(size for size, *_ in steps)
        spent.append(sum(count for size, *_, count in steps if size == finest))
    assert spent[1] <= 1.3 * spent[0]


@pytest.mark.slow
@pytest.mark.mpi
@pytest.mark.parametrize("name", ["tresca", "coulomb", "three meshes", "not nested"])
def test_one_rank_or_many(name, steps):  # noqa: F811
    """As many steps but for one in each solve, as many solves but for one, and the same answer to 1e-8."""

    def scenes(comm):
        if name == "three meshes":
            return [example1(bound=1.5, nx=n, ny=n // 3, linear_algebra="krylov") for n in (15, 30, 60)]
        sizes, law = ((6, 15), "tresca") if name == "not nested" else ((6, 12), name)
        return [block(n, gamma=1e8, linear_algebra="krylov", comm=comm, **LAWS[law]) for n in sizes]

    together = nested(scenes(WORLD), WORLD)
    ours = same_on_all_ranks([count for *_, count in steps])
    steps.clear()
    single = nested(scenes(SELF))
    theirs = [count for *_, count in steps]
    assert abs(len(ours) - len(theirs)) <= 1
    if len(ours) == len(theirs):
        assert max(abs(np.subtract(ours, theirs))) <= 1, (ours, theirs)
    assert abs(sum(ours) - sum(theirs)) <= len(theirs)
    table, wanted = together.table.columns, single.table.columns
    for group in (("u_n",), ("pressure", "shear")):
        size = max(np.abs(wanted[one]).max() for one in group)
        for one in group:
            np.testing.assert_allclose(table[one], wanted[one], rtol=0, atol=1e-8 * size, err_msg=one)


def test_sweep():
    """Coarser meshes are levels of multigrid in a sweep too, and change no result; other methods do without them."""
    scene = parse_scene(
        {
            "mesh": {"generator": "box", "parameters": {"nx": 12, "ny": 4, "nz": 4}},
            "material": {"young": 5000.0, "poisson": 0.4},
            "displacement": [{"boundary": name, "x": 0.0, "y": 0.0} for name in ("left", "right")],
            "traction": {"boundary": "top", "y": 4.0, "z": -20.0},
            "contact": {"boundary": "bottom", "gap": 0.001, "friction": {"law": "coulomb", "coefficient": 0.3}},
            "solver": {"linear_algebra": "krylov", "levels": 2, "coulomb": "newton"},
        }
    )
    body = discretise(scene.statement, load_mesh(scene, SELF), Timings())
    values = [0.1, 0.3]
    first = [_Value(coefficient=values[0])]
    level, state = _coarser(scene, body, first)
    assert level.dofs == 3 * 7 * 3 * 3
    assert level.solved is not None
    assert state.boundary.size == 7 * 3
    others = {}
    for kind, levels in (("krylov", 2), ("krylov", 1), ("condensed", 2)):
        settings = scene.solver.model_copy(update={"linear_algebra": kind, "levels": levels})
        others[kind, levels] = scene.model_copy(update={"solver": settings})
    assert _coarser(others["krylov", 1], body, first) == (None, None)
    assert _coarser(others["condensed", 2], body, first) == (None, None)
    nested, *alone = (sweep(s, SELF, coefficients=values) for s in others.values())
    assert nested[0].linear_solves < alone[0][0].linear_solves
    for points in alone:
        for mine, right in zip(points, nested, strict=True):
            wanted = right.contact.pressure
            np.testing.assert_allclose(mine.contact.pressure, wanted, rtol=0, atol=2e-8 * wanted.max())
