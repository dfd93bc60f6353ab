"""Which kind of elastic system a problem gets, and why."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from signorini_fx import parallel
from signorini_fx.body.discretisation import Body, Discretisation
from signorini_fx.linalg import ElasticSystem, options
from signorini_fx.linalg.condensed import CondensedSystem
from signorini_fx.linalg.full import FullSystem, can_factorise, has_package
from signorini_fx.tuned import FEWEST_CONDENSED_UNKNOWNS, MOST_CONDENSED_UNKNOWNS, SPARSE_OPERATIONS


def choose_system(discretisation: Discretisation, requested: str) -> tuple[ElasticSystem, str]:
    """The elastic system, and the reason for its kind.

    Args:
        discretisation: the assembled body with a contact boundary.
        requested: ``full``, ``krylov``, ``condensed`` or ``auto``.
    """
    d = discretisation
    assert d.boundary is not None
    nodes = np.array(np.unique(d.boundary.reached).size)
    retained = d.tagged.dimension * int(parallel.global_sum(d.boundary.comm, nodes))
    everywhere: npt.NDArray[np.bool_] = np.ones(d.boundary.size, dtype=bool)
    if requested != "krylov" and not d.motions.held_by(d.boundary, everywhere, everywhere):
        return FullSystem.of(d), "full: the contact does not reach every piece of the body that supports do not hold"
    reason = against_condensing(d, retained)
    if requested == "condensed" and d.boundary.comm.size == 1 and has_package("mumps"):
        return CondensedSystem.of(d), "condensed: as asked for"
    if requested == "krylov":
        return FullSystem.of(d, krylov=True), "full, Krylov: as asked for"
    if not can_factorise(d.boundary.comm):
        return FullSystem.of(d, krylov=True), "full, Krylov: PETSc has no factorisation for more than one rank"
    if requested == "full" or reason is not None:
        return FullSystem.of(d), f"full: {reason or 'as asked for'}"
    memory = 3 * 8 * retained**2 / 2**20
    return CondensedSystem.of(
        d
    ), f"condensed: {retained} of {d.dofs} unknowns are on the contact boundary, {memory:.0f} MB dense"


def against_condensing(d: Body, retained: int) -> str | None:
    """Why ``retained`` unknowns of the contact boundary are not condensed onto; None where they are."""
    if d.tagged.mesh.comm.size > 1:
        return "more than one rank"
    if not has_package("mumps"):
        return "PETSc has no MUMPS"
    if options.user_sets("pc_") or options.user_sets("ksp_") or options.user_sets("mat_"):
        return "the options choose a linear solver"
    if d.dofs < FEWEST_CONDENSED_UNKNOWNS:
        return f"only {d.dofs} unknowns"
    factor, exponent = SPARSE_OPERATIONS[d.tagged.dimension]
    if retained**3 / 3 > factor * d.dofs**exponent or retained > MOST_CONDENSED_UNKNOWNS[d.tagged.dimension]:
        return f"{retained} of {d.dofs} unknowns are on the contact boundary, too many for a dense matrix"
    return None
