"""What launchers of ranks (mpirun, srun) set in the environment, and what libraries read there as they start."""

from __future__ import annotations

import os

_RANK = ("PMIX_RANK", "OMPI_COMM_WORLD_RANK", "PMI_RANK", "SLURM_PROCID")
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "BLIS_NUM_THREADS")


def started_as_root() -> bool:
    """Whether this process is the first of its ranks, or the only one."""
    return next((os.environ[name] for name in _RANK if name in os.environ), "0") == "0"


def gives_pseudo_terminals() -> bool:
    """Whether the standard output of a rank is a pseudo-terminal wherever the output of the launcher itself goes.

    Open MPI's mpirun does so, even if its output is a file; MPICH's, Intel's and Slurm's launchers pass pipes on.
    """
    return "OMPI_COMM_WORLD_SIZE" in os.environ


def limit_threads() -> None:
    """One thread for each rank unless the environment says otherwise; for a process that has not loaded BLAS.

    The fronts of factorisations are small.  Threads of OpenBLAS wait for each other in loops, so that on a busy machine
    with two cores Example 1 takes 4 to 7 seconds with two and 1 with one.
    """
    if not any(name in os.environ for name in _THREADS):
        os.environ["OMP_NUM_THREADS"] = "1"
