"""Coarser meshes as levels of multigrid: the answers of a factorisation, in few steps."""

import numpy as np
import pytest
from mpi4py import MPI
from scenes import example1
from spaces import block
from test_krylov import LAWS, agree, set_ups, steps  # noqa: F401

from signorini_fx.records import History
from signorini_fx.scenes.mesh_sequence import solve_scenes
from signorini_fx.scenes.solver import solve

WORLD, SELF = MPI.COMM_WORLD, MPI.COMM_SELF


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
