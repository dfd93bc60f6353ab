"""PETSc options: their prefix, and our defaults, over which options of the user take precedence."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from petsc4py import PETSc

from signorini_fx.errors import OptionsError

PREFIX = "sfx_"
# Options that would replace our method, its matrix or its test, with the values that would not.
_OFF = ("false", "no", "off", "0")
_EXCHANGING = {
    "snes_type": ("newtonls",),
    "snes_lag_jacobian": ("1",),
    "snes_convergence_test": (),
    "snes_grid_sequence": ("0",),
    **dict.fromkeys(("snes_mf", "snes_mf_operator", "snes_fd", "snes_fd_color"), _OFF),
}
# MUMPS takes more memory (per cent) than it predicts if large contact blocks disturb the pivot
# order; minimum degree is its quickest order on few ranks; CHOLMOD's own nested dissection has half
# the fill of its default orderings on large meshes; on the coarsest level of multigrid PETSc
# compares pivots with an absolute threshold, whatever their unit.
_OF_FACTORS = {
    "mat_mumps_icntl_14": "100",
    "mat_mumps_icntl_7": "0",
    "mat_cholmod_default_nesdis": "true",
    "mat_cholmod_print": "0",
    **{f"mg_coarse_{sub}pc_factor_zeropivot": "1e-300" for sub in ("", "sub_")},
}
_INNER_SOLVER = "npc_"
# These options only print.
_WATCHING = ("monitor", "view", "converged_reason")


def user_sets(*starts: str) -> bool:
    """Return whether the user has set any option whose name (without prefix) begins with one of
    ``starts``, monitors excepted.
    """
    names = [
        name.removeprefix(PREFIX) for name in PETSc.Options().getAll() if name.startswith(PREFIX)
    ]
    return any(
        name.startswith(starts) and not any(word in name for word in _WATCHING) for name in names
    )


def user_chooses_solver() -> bool:
    """Return whether the user has set any option of the linear solvers and their matrices."""
    return user_sets("pc_", "ksp_", "mat_")


@contextmanager
def defaults(values: Mapping[str, str | None] = _OF_FACTORS) -> Iterator[None]:
    """Set options, by default those of factorisations, while PETSc reads them, unless the user has
    set them.
    """
    options = PETSc.Options(PREFIX)
    ours = [name for name in values if not options.hasName(name)]
    for name in ours:
        options[name] = values[name]
    try:
        yield
    finally:
        for name in ours:
            options.delValue(name)


def refuse_exchanged() -> None:
    """Refuse options with which PETSc would not run the Newton method of this package.

    Raises:
        OptionsError: the user has set such an option; the message names it.
    """
    for name, value in PETSc.Options(PREFIX).getAll().items():
        harmless = _EXCHANGING.get(name, () if name.startswith(_INNER_SOLVER) else None)
        if harmless is not None and (value or "").lower() not in harmless:
            raise OptionsError(
                f"PETSc option {_spelt({PREFIX + name: value or ''})}: it would replace the "
                "semi-smooth Newton method, its matrix or its test: remove the option, and choose "
                "by solver.algorithm"
            )


def refused(error: PETSc.Error) -> OptionsError | None:
    """Return an error to raise for a PETSc error that options of the user may have caused; None if
    the user has set none.
    """
    user_options = {
        name: value or ""
        for name, value in PETSc.Options().getAll().items()
        if name.startswith(PREFIX)
    }
    if not user_options:
        return None
    reason = re.sub(
        r"^\[\d+\] *", "", str(error).splitlines()[-1]
    )  # without the number of the rank
    return OptionsError(f"PETSc fails with the options {_spelt(user_options)}: {reason}")


def _spelt(options: Mapping[str, str]) -> str:
    return " ".join(f"-{name} {value}".strip() for name, value in options.items())
