"""Coarser meshes as levels of multigrid: interpolation is exact where it can be, and solves take few steps."""

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc
from scenes import example1
from spaces import block, friction_of
from test_krylov import LAWS, agree, set_ups, steps  # noqa: F401

from signorini_fx.mechanics.body.discretisation import discretise
from signorini_fx.records import History, Timings
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.mesh_sequence import solve_scenes
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

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


@pytest.mark.one_quick
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


@pytest.mark.slow
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
