"""The user's PETSc options, tried on a few equations: one that PETSc does not accept is named."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx.algebra.linalg.factorisation import has_package
from signorini_fx.algebra.linalg.petsc_options import PREFIX, watches
from signorini_fx.errors import OptionsError
from signorini_fx.machine import parallel

# Options that put another method in the place of ours, or another matrix or test into it, and the values that do not.
_OFF = ("false", "no", "off", "0")
_EXCHANGING = {
    "snes_type": ("newtonls",),
    "snes_lag_jacobian": ("1",),
    "snes_convergence_test": (),
    "snes_grid_sequence": ("0",),
    **dict.fromkeys(("snes_mf", "snes_mf_operator", "snes_fd", "snes_fd_color"), _OFF),
}
_INNER_SOLVER = "npc_"


def refuse_mistyped(comm: MPI.Comm) -> None:
    """Try the user's options on a small system, before anything else is computed; collective.

    Raises:
        OptionsError: PETSc does not accept one of them; the message names it.
    """
    options = PETSc.Options()
    values = {name: options.getString(name, "") for name in options.getAll()}
    user_options = {name: value for name, value in values.items() if name.startswith(PREFIX)}
    parallel.on_root(comm, lambda: _check_files({name: value for name, value in values.items() if watches(name)}))
    refuse_exchanged({name.removeprefix(PREFIX): value for name, value in user_options.items()})
    for name in user_options:
        options.delValue(name)
    try:
        for name, value in user_options.items():
            if (reason := _complaint(comm, name, value)) is not None:
                raise OptionsError(f"PETSc option {_spelt({name: value})}: {reason}")
    finally:
        for name, value in user_options.items():
            options[name] = value or None


def refuse_exchanged(user_options: Mapping[str, str]) -> None:
    """Refuse options with which PETSc would not run the Newton method of this package; names are without the prefix.

    Raises:
        OptionsError: one of them does so; the message names it.
    """
    for name, value in user_options.items():
        harmless = _EXCHANGING.get(name, () if name.startswith(_INNER_SOLVER) else None)
        if harmless is not None and value.lower() not in harmless:
            raise OptionsError(
                f"PETSc option {_spelt({PREFIX + name: value})}: it would take the place of the semi-smooth Newton "
                "method, of its matrix or of its test: leave it out, and choose by solver.algorithm"
            )


def refused(error: PETSc.Error) -> OptionsError | None:
    """The message for an error of PETSc that options of the user may have caused; None if there are none."""
    options = PETSc.Options()
    user_options = {name: options.getString(name, "") for name in options.getAll() if name.startswith(PREFIX)}
    return (
        OptionsError(f"PETSc fails with the options {_spelt(user_options)}: {_last_line(error)}")
        if user_options
        else None
    )


def _spelt(options: Mapping[str, str]) -> str:
    return " ".join(f"-{name} {value}".strip() for name, value in options.items())


def _last_line(error: PETSc.Error) -> str:
    """The reason in PETSc's stack trace, without the number of the rank."""
    return re.sub(r"^\[\d+\] *", "", str(error).splitlines()[-1])


def _check_files(watching: Mapping[str, str]) -> None:
    """Refuse files that cannot be written: PETSc writes on the first rank, whose error the others would not notice;
    ``watching``: options of the form ``TYPE:FILE:FORMAT:MODE``, all but the type perhaps absent.
    """
    for name, value in watching.items():
        file = value.split(":")[1] if ":" in value else ""
        if not file:
            continue
        folder = Path(file).parent
        try:
            fits = folder.is_dir() and os.access(Path(file) if Path(file).exists() else folder, os.W_OK)
        except (OSError, ValueError):
            fits = False
        if not fits or Path(file).is_dir():
            raise OptionsError(f"PETSc option -{name} {value}: {file!r} cannot be written")


def _complaint(comm: MPI.Comm, name: str, value: str) -> str | None:
    """PETSc's objection to an option when it solves a small system with it; None: there is none; collective."""
    options = PETSc.Options()
    options[name] = value or None
    try:
        snes, x = _few_equations(comm)
        snes.setFromOptions()
        if not watches(name):
            snes.solve(None, x)
    except PETSc.Error as error:
        return _last_line(error)
    finally:
        with suppress(PETSc.Error):
            options.delValue(name)
    return None


def _few_equations(comm: MPI.Comm) -> tuple[PETSc.SNES, PETSc.Vec]:
    """The equations x = 0, set up like the system of a body, and a start.

    PETSc checks options when they are read, so the Krylov method is one that reads all of them.
    """
    matrix = PETSc.Mat().createAIJ(((4, None), (4, None)), nnz=1, bsize=2, comm=comm)
    matrix.assemble()
    matrix.shift(1.0)
    matrix.setOption(PETSc.Mat.Option.SPD, True)
    x, residual = matrix.createVecs()
    x.set(1.0)
    snes = PETSc.SNES().create(comm)
    snes.setOptionsPrefix(PREFIX)
    snes.setType(PETSc.SNES.Type.NEWTONLS)
    snes.setFunction(lambda snes, x, out: x.copy(out), residual)
    snes.setJacobian(lambda snes, x, jacobian, preconditioner: None, matrix)
    ksp = snes.getKSP()
    ksp.setOperators(matrix)
    ksp.setType(PETSc.KSP.Type.GMRES)
    pc = ksp.getPC()
    if has_package("mumps"):
        pc.setType(PETSc.PC.Type.CHOLESKY)
        pc.setFactorSolverType("mumps")
    else:  # PETSc's own factorisation is for one rank
        pc.setType(PETSc.PC.Type.NONE)
    return snes, x
