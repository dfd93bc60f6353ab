"""Which kind of elastic system a problem gets, and why."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from signorini_fx import parallel
from signorini_fx.body.discretisation import Body, Discretisation
from signorini_fx.linalg import ElasticSystem, options
from signorini_fx.linalg.condensed import CondensedSystem
from signorini_fx.linalg.full import FullSystem, can_factorise, has_package

# Below this many unknowns a sparse factorisation costs no more than what condensation saves.
_SMALL = 4_000
# A dense solve costs n_c^3 / 3 operations, a sparse one in two dimensions about 50 n^1.5, in three about 8 n^2: factor
# and exponent, by dimension.
_SPARSE_OPERATIONS = {2: (50.0, 1.5), 3: (8.0, 2.0)}
# In three dimensions memory ends before that: three dense matrices of so many unknowns take 0.6 GB.
_MOST_KEPT = {2: 1e9, 3: 5_000}


def choose_system(discretisation: Discretisation, wanted: str) -> tuple[ElasticSystem, str]:
    """The elastic system, and the reason for its kind.

    Args:
        discretisation: the assembled body with a contact boundary.
        wanted: ``full``, ``krylov``, ``condensed`` or ``auto``.
    """
    d = discretisation
    assert d.boundary is not None
    kept = d.tagged.dimension * int(parallel.global_sum(d.boundary.comm, np.array(np.unique(d.boundary.nodes).size)))
    everywhere: npt.NDArray[np.bool_] = np.ones(d.boundary.size, dtype=bool)
    if wanted != "krylov" and not d.motions.held_by(d.boundary, everywhere, everywhere):
        return FullSystem.of(d), "full: the contact does not reach every piece of the body that supports do not hold"
    reason = against_condensing(d, kept)
    if wanted == "condensed" and d.boundary.comm.size == 1 and has_package("mumps"):
        return CondensedSystem.of(d), "condensed: as asked for"
    if wanted == "krylov":
        return FullSystem.of(d, krylov=True), "full, Krylov: as asked for"
    if not can_factorise(d.boundary.comm):
        return FullSystem.of(d, krylov=True), "full, Krylov: PETSc has no factorisation for more than one rank"
    if wanted == "full" or reason is not None:
        return FullSystem.of(d), f"full: {reason or 'as asked for'}"
    memory = 3 * 8 * kept**2 / 2**20
    return CondensedSystem.of(
        d
    ), f"condensed: {kept} of {d.dofs} unknowns are on the contact boundary, {memory:.0f} MB dense"


def against_condensing(d: Body, kept: int) -> str | None:
    """Why ``kept`` unknowns of the contact boundary are not condensed onto; None where they are."""
    if d.tagged.mesh.comm.size > 1:
        return "more than one rank"
    if not has_package("mumps"):
        return "PETSc has no MUMPS"
    if options.user_sets("pc_") or options.user_sets("ksp_") or options.user_sets("mat_"):
        return "the options choose a linear solver"
    if d.dofs < _SMALL:
        return f"only {d.dofs} unknowns"
    factor, exponent = _SPARSE_OPERATIONS[d.tagged.dimension]
    if kept**3 / 3 > factor * d.dofs**exponent or kept > _MOST_KEPT[d.tagged.dimension]:
        return f"{kept} of {d.dofs} unknowns are on the contact boundary, too many for a dense matrix"
    return None
