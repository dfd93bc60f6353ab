"""Solutions of all ranks together, and of each rank alone."""

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI

from signorini_fx.records import Status
from signorini_fx.scenes.solver import solve

WORLD = MPI.COMM_WORLD
# Columns of contact tables that are compared with the largest value of all of them.
GROUPS = (
    ("x", "y", "z", "s"),
    ("weight",),
    ("gap", "u_n", "u_t", "u_t_x", "u_t_y", "u_t_z"),
    ("pressure", "shear", "shear_x", "shear_y", "shear_z", "bound"),
)


def shared(tmp_path):
    """A folder that all ranks see."""
    return Path(WORLD.bcast(str(tmp_path)))


def same_on_all_ranks(value):
    """The value, which all ranks must share."""
    assert all(other == value for other in WORLD.allgather(value))
    return value


def agree(scene):
    """All ranks together get what one rank gets: status, counts, and numbers to 1e-9 of the
    largest.

    Args:
        scene: a scene, or a function that makes it on the given ranks.
    """
    together, alone = (
        solve(scene(comm) if callable(scene) else scene, comm, check=False)
        for comm in (WORLD, MPI.COMM_SELF)
    )
    assert same_on_all_ranks(together.status) is alone.status
    sets = [
        [
            (r.active_contact, r.slip_plus, r.slip_minus, r.changed)
            for r in solution.history.iterations
        ]
        for solution in (together, alone)
    ]
    assert same_on_all_ranks(sets[0]) == sets[1]
    if alone.status is not Status.CONVERGED:
        return together
    ours, theirs = together.table.columns, alone.table.columns
    for group in GROUPS:
        names = [name for name in group if name in theirs]
        close = 1e-9 * max(np.abs(theirs[name]).max() for name in names)
        for name in names:
            np.testing.assert_allclose(ours[name], theirs[name], rtol=0, atol=close, err_msg=name)
    for name in ("state", "friction", "boundary"):
        assert ours[name].tolist() == theirs[name].tolist()
    energies = [solution.steps[-1].strain_energy for solution in (together, alone)]
    assert same_on_all_ranks(energies[0]) == pytest.approx(energies[1], rel=1e-9)
    assert same_on_all_ranks(together.certificate.holds) == alone.certificate.holds is True
    np.testing.assert_allclose(together.contact.forces, alone.contact.forces, atol=1e-8)
    assert same_on_all_ranks(together.contact.areas) == pytest.approx(alone.contact.areas)
    return together
