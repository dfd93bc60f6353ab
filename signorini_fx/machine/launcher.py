"""What the launcher of the ranks (mpirun, srun) sets in the environment, read before MPI is initialised."""

from __future__ import annotations

import os

_RANK = ("PMIX_RANK", "OMPI_COMM_WORLD_RANK", "PMI_RANK", "SLURM_PROCID")
_FAMILIES = ("OMPI_", "PMIX_", "PMI_", "PRTE_")


def started_as_root() -> bool:
    """Whether this process is the first of its ranks, or the only one."""
    return next((os.environ[name] for name in _RANK if name in os.environ), "0") == "0"


def environment_of_no_rank() -> dict[str, str]:
    """The environment for a separate program, which would otherwise take itself for one of the MPI ranks."""
    return {name: value for name, value in os.environ.items() if not name.startswith(_FAMILIES)}
