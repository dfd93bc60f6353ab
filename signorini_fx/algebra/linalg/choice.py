"""The choice of the kind of elastic system for a problem, with the reason."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx.algebra.linalg import Elasticity, ElasticSystem, is_by_blocks, petsc_options
from signorini_fx.algebra.linalg.factorisation import (
    can_factorise,
    enough_memory,
    factor_memory,
    has_package,
)
from signorini_fx.tuned import (
    DENSE_SPEED,
    FACTOR_SECONDS,
    FEWEST_CONDENSED_UNKNOWNS,
    FEWEST_KRYLOV_UNKNOWNS,
    FEWEST_KRYLOV_UNKNOWNS_IF_CONDENSED,
    MOST_CONDENSED_UNKNOWNS,
)


@dataclass(frozen=True)
class SystemSize:
    """The figures that decide which kind of system is used.

    Attributes:
        comm: the ranks that share it.
        unknowns: global number of unknowns.
        dimension: d.
        retained: number of unknowns that contact touches, on both sides of two bodies.
        held: whether contact and stick at all contact points hold every piece of the body.
        compressible: whether the material is compressible enough for multigrid.
        definite: whether the matrix is positive semi-definite.
        enclosed: whether contact and supports enclose an incompressible body, so that the matrix of
            the unknowns that contact does not touch is singular.
    """

    comm: MPI.Comm
    unknowns: int
    dimension: int
    retained: int
    held: bool
    compressible: bool
    definite: bool = True
    enclosed: bool = False


def choose_system(
    elasticity: Elasticity, size: SystemSize, requested: str
) -> tuple[ElasticSystem, str]:
    """Return the elastic system, and the reason for its kind.

    Modules that few problems need are imported here.

    Args:
        elasticity: the body without contact.
        size: the figures that decide.
        requested: ``full``, ``krylov``, ``condensed``, ``auto``, or the name of a solver of another
            package.
    """
    kind, reason = choose_kind(size, requested)
    if kind != "krylov" and is_by_blocks(elasticity.matrix):
        from signorini_fx.algebra.linalg.blocks import by_entries

        elasticity = replace(elasticity, matrix=by_entries(elasticity.matrix))
    if kind == "full":
        return ElasticSystem.of(elasticity), f"full: {reason}"
    if kind == "condensed":
        from signorini_fx.algebra.linalg.condensed import CondensedSystem

        try:
            return CondensedSystem.of(elasticity), f"condensed: {reason}"
        except PETSc.Error:
            return ElasticSystem.of(elasticity), "full: MUMPS could not condense the system"
    if kind == "krylov":
        from signorini_fx.algebra.linalg.krylov import KrylovSystem

        return KrylovSystem.of(elasticity), f"krylov: {reason}"
    from signorini_fx.algebra.linalg.krylov import UserSystem

    return UserSystem.named(kind, elasticity), f"{kind}: {reason}"


def choose_kind(size: SystemSize, requested: str) -> tuple[str, str]:
    """Return ``full``, ``krylov``, ``condensed`` or the name of another solver, and the reason;
    collective.

    Without contact there is nothing to condense onto.

    Args:
        size: the figures that decide.
        requested: as for ``choose_system``.
    """
    if requested not in ("auto", "full", "condensed"):
        return requested, "as requested"
    if size.retained and not size.held:
        return (
            "full",
            "the contact does not reach every piece of the body that supports do not hold",
        )
    if size.enclosed:
        return "full", "contact and supports enclose the incompressible body"
    if requested == "condensed" and cannot_condense(size) is None:
        return "condensed", "as requested"
    if not can_factorise(size.comm):
        return "krylov", "PETSc has no factorisation for more than one rank"
    against = against_condensing(size)
    if requested == "full":
        return "full", against or "set by the scene"
    if size.definite and (multigrid := for_multigrid(size)) is not None:
        return "krylov", multigrid
    if against is not None:
        return "full", against
    megabytes = 3 * 8 * size.retained**2 / 2**20
    memory = f"{megabytes:.0f} MB" if megabytes >= 1 else "less than 1 MB"
    return (
        "condensed",
        f"{size.retained} of {size.unknowns} unknowns are on the contact boundary, {memory} dense",
    )


def for_multigrid(size: SystemSize) -> str | None:
    """Return why a Krylov method with multigrid is better than a factorisation; None if it is not.
    Collective.
    """
    if petsc_options.user_chooses_solver():
        return None
    factor = factor_memory(size.unknowns, size.dimension)
    if not enough_memory(size.comm, factor):
        return (
            f"a factor for {size.unknowns} unknowns would take about {factor / 1e9:.2g} GB, "
            "more than this machine has"
        )
    faster = size.unknowns >= krylov_from(size, "auto")
    return (
        f"for {size.unknowns} unknowns in 3D multigrid is faster than a factor" if faster else None
    )


def krylov_from(size: SystemSize, requested: str) -> float:
    """Return the number of unknowns above which a mesh of a body gets a Krylov method because it is
    faster; infinite: never.

    Args:
        size: of the system on any of the meshes.
        requested: as for ``choose_system``.
    """
    if requested != "auto":
        return 0.0 if requested == "krylov" else math.inf
    if size.dimension == 2 or not size.compressible or petsc_options.user_chooses_solver():
        return math.inf
    # A condensed system with few contact points stays cheap up to more unknowns than a sparse one.
    return (
        FEWEST_KRYLOV_UNKNOWNS if against_condensing(size) else FEWEST_KRYLOV_UNKNOWNS_IF_CONDENSED
    )


def against_condensing(size: SystemSize) -> str | None:
    """Return why the system is not condensed onto the unknowns of the contact boundary; None if it
    is.
    """
    retained = size.retained
    if (why := cannot_condense(size)) is not None:
        return why
    if petsc_options.user_chooses_solver():
        return "the options choose a linear solver"
    if size.unknowns < FEWEST_CONDENSED_UNKNOWNS:
        return f"only {size.unknowns} unknowns"
    # A sparse factorisation takes operations in proportion to n^1.5 in 2D and n^2 in 3D, a dense
    # one n^3 / 3.
    sparse = (
        DENSE_SPEED * FACTOR_SECONDS[size.dimension] * size.unknowns ** (3 - 3 / size.dimension)
    )
    border = round(
        (size.comm.size - 1) * math.sqrt(2 * size.unknowns)
    )  # unknowns on straight cuts through a square
    if (retained + border) ** 3 / 3 > sparse or retained > MOST_CONDENSED_UNKNOWNS:
        between = f" and about {border} between ranks" if border else ""
        where = f"are on the contact boundary{between}, too many for a dense matrix"
        return f"{retained} of {size.unknowns} unknowns {where}"
    return None


def cannot_condense(size: SystemSize) -> str | None:
    """Return why the system cannot be condensed; None if it can."""
    if size.retained == 0:
        return "there is no contact"
    if size.comm.size > 1 and size.dimension > 2:  # the border between ranks is a surface
        return "more than one rank in 3D"
    if size.comm.size > 1 and not size.definite:
        return "more than one rank, and an indefinite matrix"
    return None if has_package("mumps") else "PETSc has no MUMPS"
