"""Which kind of elastic system a problem gets, and why."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from signorini_fx import parallel
from signorini_fx.body.discretisation import Body, Discretisation
from signorini_fx.linalg import ElasticSystem, options
from signorini_fx.linalg.condensed import CondensedSystem
from signorini_fx.linalg.full import FullSystem, can_factorise, has_package
from signorini_fx.linalg.krylov import KrylovSystem
from signorini_fx.linalg.mesh_levels import MeshLevel
from signorini_fx.tuned import (
    FACTOR_ENTRIES,
    FEWEST_CONDENSED_UNKNOWNS,
    FEWEST_KRYLOV_UNKNOWNS,
    LARGEST_MULTIGRID_POISSON,
    MEMORY_SHARE,
    MOST_CONDENSED_UNKNOWNS,
    SPARSE_OPERATIONS,
)

_KINDS: dict[str, Callable[[Discretisation], ElasticSystem]] = {
    "full": FullSystem.of,
    "condensed": CondensedSystem.of,
}


def choose_system(
    discretisation: Discretisation, requested: str, coarser: MeshLevel | None = None
) -> tuple[ElasticSystem, str]:
    """The elastic system, and the reason for its kind.

    Args:
        discretisation: the assembled body.
        requested: ``full``, ``krylov``, ``condensed`` or ``auto``.
        coarser: the body on a coarser mesh, for multigrid; None: there is none.
    """
    kind, reason = choose_kind(discretisation, requested)
    if kind == "krylov":
        return KrylovSystem.of(discretisation, coarser), f"{kind}: {reason}"
    return _KINDS[kind](discretisation), f"{kind}: {reason}"


def choose_kind(d: Body, requested: str) -> tuple[str, str]:
    """``full``, ``krylov`` or ``condensed``, and the reason; collective.

    Args:
        d: the body; without contact there is nothing to condense onto.
        requested: as for ``choose_system``.
    """
    if requested == "krylov":
        return "krylov", "as asked for"
    reached = d.boundary is not None
    if d.boundary is not None:
        everywhere = d.boundary.points.everywhere
        reached = d.motions.at(d.boundary).held_by(everywhere, everywhere)
        if not reached:
            return "full", "the contact does not reach every piece of the body that supports do not hold"
    retained = retained_unknowns(d)
    if requested == "condensed" and reached and d.comm.size == 1 and has_package("mumps"):
        return "condensed", "as asked for"
    if not can_factorise(d.comm):
        return "krylov", "PETSc has no factorisation for more than one rank"
    against = against_condensing(d, retained)
    if requested == "full":
        return "full", against or "set by the scene"
    if (multigrid := for_multigrid(d)) is not None:
        return "krylov", multigrid
    if against is not None:
        return "full", against
    memory = 3 * 8 * retained**2 / 2**20
    return "condensed", f"{retained} of {d.dofs} unknowns are on the contact boundary, {memory:.0f} MB dense"


def retained_unknowns(d: Body) -> int:
    """Displacement components that contact reaches; collective."""
    if d.boundary is None:
        return 0
    return d.tagged.dimension * int(parallel.global_sum(d.comm, np.array(np.unique(d.boundary.reached).size)))


def for_multigrid(d: Body) -> str | None:
    """Why a Krylov method with multigrid is better than a factorisation; None: it is not; collective."""
    if options.user_sets("pc_") or options.user_sets("ksp_") or options.user_sets("mat_"):
        return None
    factor = 12.0 * factor_entries(d.dofs, d.tagged.dimension)
    if factor > MEMORY_SHARE * parallel.machine_memory(d.comm):
        return f"a factor for {d.dofs} unknowns would take about {factor / 1e9:.2g} GB, more than this machine has"
    faster = d.dofs >= krylov_from(d, "auto")
    return f"for {d.dofs} unknowns in space multigrid is faster than a factor" if faster else None


def krylov_from(d: Body, requested: str) -> float:
    """Unknowns from which on a mesh of this body gets a Krylov method because it is faster; infinite: none does.

    Args:
        d: the body.
        requested: as for ``choose_system``.
    """
    if requested != "auto":
        return 0.0 if requested == "krylov" else math.inf
    compressible = max(material.poisson for material in d.scene.material) <= LARGEST_MULTIGRID_POISSON
    if not compressible or any(options.user_sets(start) for start in ("pc_", "ksp_", "mat_")):
        return math.inf
    return FEWEST_KRYLOV_UNKNOWNS.get(d.tagged.dimension, math.inf)


def factor_entries(unknowns: int, dimension: int) -> float:
    """Entries of a sparse factor: n log n in two dimensions, n^(4/3) in three (nested dissection)."""
    least, slope, offset = FACTOR_ENTRIES[dimension]
    growing = slope * (math.log2(unknowns) - offset) if dimension == 2 else slope * unknowns**offset
    return unknowns * max(least, growing)


def against_condensing(d: Body, retained: int) -> str | None:
    """Why the system is not condensed onto ``retained`` unknowns of the contact boundary; None if it is."""
    if retained == 0:
        return "there is no contact"
    if d.comm.size > 1:
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
