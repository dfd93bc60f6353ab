"""What the launcher of the ranks (mpirun, srun) sets in the environment, read before MPI is initialised."""

from __future__ import annotations

import os

_RANK = ("PMIX_RANK", "OMPI_COMM_WORLD_RANK", "PMI_RANK", "SLURM_PROCID")
_FAMILIES = ("OMPI_", "PMIX_", "PMI_", "PRTE_")


def started_as_root() -> bool:
    """Whether this process is the first of its ranks, or the only one."""
    return next((os.environ[name] for name in _RANK if name in os.environ), "0") == "0"


def gives_pseudo_terminals() -> bool:
    """Whether the standard output of a rank is a pseudo-terminal wherever the output of the launcher itself goes.

    Open MPI's mpirun does so, even if its output is a file; MPICH's, Intel's and Slurm's launchers pass pipes on.
    """
    return "OMPI_COMM_WORLD_SIZE" in os.environ


def environment_of_no_rank() -> dict[str, str]:
    """The environment for a separate program, which would otherwise take itself for one of the MPI ranks."""
    return {name: value for name, value in os.environ.items() if not name.startswith(_FAMILIES)}
