"""What accuracy costs: one row a mesh of a nested iteration, with what is wrong there and what it took, and the next
mesh.

Nothing is solved for it that the nested iteration does not solve anyway.  The energy norm of the displacement's error
is estimated on every mesh by stress recovery, that of the contact pressure by its kinks at the nodes; errors of contact
force, zone ends and peak pressure by the change from the mesh before, extrapolated with the expected rate; the error
that the regularisation leaves by the path that gamma takes; that of the iteration by its last residual or change.
"""

from __future__ import annotations

import resource
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from signorini_fx import parallel
from signorini_fx.accuracy.error_estimates import FAR
from signorini_fx.accuracy.pressure_error import peak_of
from signorini_fx.contact.table import ContactTable

# How errors fall with h.  The square-root ends of the contact zone limit all but the peak; measured on the paper's
# first example against an overkill solution.  Rates seen on two or three meshes scatter more than they tell: where an
# end falls on a node, one change is small and the next one large.
_RATE = {"pressure": 1.25, "force": 2.0, "zone": 1.0, "peak": 2.0}
_ENERGY_RATES = (0.5, 3.0)
_MEMORY_OF_CHANGES = 3
# What a polygon leaves of energy, pressure and force, times ``LevelResult.polygon`` to a power, and of the largest
# pressure; measured on a round lip pressed onto a plane, with 1 to 39 nodes in contact: 0.02 to 0.14, 0.12 to 0.29,
# 0.006 to 0.04 and 0.6 to 1.4, the largest of each where a single node is in contact.
_POLYGON = {"energy": (0.04, 1), "pressure": (0.15, 1), "force": (0.01, 2)}
_POLYGON_PEAK = 0.5
# The largest pressure has no limit if it grows like h^-0.05 or faster on so many meshes one after the other, each finer
# there, and hardly less on the last.
_FINER, _GROWING, _GROWTH, _LASTING = 1.3, 2, 0.05, 0.6
# An error that falls by less than this from mesh to mesh is not believed to fall at all.
_SLOWEST = 0.95
# Sparse factors of plane bodies: time between n for all else and n^1.5, memory n log n.
_TIME_POWER, _MEMORY_POWER = 1.2, 1.1
# Of the time at least so much is taken to grow: the mesh before may have begun cold, or on a busy machine.
_LEAST_GROWING = 0.25
# What changes from one uniform mesh to the next in a pressure that the mesh resolves comes from elsewhere in the body.
_SMOOTH_RATE = 2.0


@dataclass(frozen=True)
class LevelResult:
    """What is kept of one mesh.

    Attributes:
        level: its number, the coarsest is 0.
        h: mean spacing of the contact nodes, length.
        dofs: unknowns.
        linear_solves: linear solves on this mesh.
        factorisations: of them with a new factorisation.
        seconds: wall time of everything on this mesh, largest over the ranks.
        memory: peak memory so far of all ranks together, MB.
        status: how it ended.
        energy: estimated discretisation error, relative in the energy norm, data included.
        pressure: the same of the contact pressure, relative in L2(Gamma_c); None without contact.
        inside: the same but beside corners, data left out.
        data: the part of the loads and of friction that the mesh misses.
        polygon: what straight facets of a curved contact boundary are worth, which no refinement makes smaller;
            ``pressure_error.polygon_error``.
        regularisation: error that the regularisation leaves, relative in the energy norm; 0 without regularisation.
        pressure_regularisation: the same of the contact pressure, relative in L2(Gamma_c).
        iteration: relative residual, or last change of the outer iteration, whichever is larger.
        table: the contact boundary.
        force: contact and friction force on the body of all load steps, shape (4 steps,).
    """

    level: int
    h: float
    dofs: int
    linear_solves: int
    factorisations: int
    seconds: float
    memory: float
    status: str
    energy: float
    pressure: float | None
    inside: float
    data: float
    regularisation: float
    pressure_regularisation: float
    iteration: float
    table: ContactTable
    force: npt.NDArray[np.float64]
    polygon: float = 0.0


@dataclass(frozen=True)
class Price:
    """One row of the price list; every error is relative, None where it cannot be told yet.

    Attributes:
        level: number of the mesh.
        h: mean spacing of the contact nodes, length.
        dofs: unknowns.
        linear_solves: linear solves.
        factorisations: of them with a new factorisation.
        seconds: wall time.
        memory: peak memory so far, MB.
        energy: error of the displacement, energy norm.
        pressure: error of the contact pressure, L2(Gamma_c).
        force: error of contact and friction force.
        zone: error of the ends of the contact zones, relative to their length.
        peak: error of the largest pressure.
        regularisation: the part of ``energy`` that gamma adds.
        iteration: the part that the iteration adds.
        predicted: whether this is the next mesh, not solved yet.
    """

    level: int
    h: float
    dofs: int
    linear_solves: int
    factorisations: int
    seconds: float
    memory: float
    energy: float | None
    pressure: float | None
    force: float | None
    zone: float | None
    peak: float | None
    regularisation: float
    iteration: float
    predicted: bool = False


def with_polygon(level: LevelResult, polygon: float) -> LevelResult:
    """What a mesh is worth if its straight facets stand for a curved boundary."""
    more = {name: share * polygon**power for name, (share, power) in _POLYGON.items()}
    pressure = None if level.pressure is None else level.pressure + more["pressure"]
    return replace(
        level, energy=level.energy + more["energy"], pressure=pressure, data=level.data + more["force"], polygon=polygon
    )


def grows_for_ever(levels: Sequence[LevelResult]) -> bool:
    """Whether the largest pressure has no limit: it grew by as much, or nearly, each time the mesh was made finer."""
    seen = [peak_of(level.table) for level in levels]
    steps = [
        np.log(fine / coarse) / np.log(h / smaller)
        for (coarse, h), (fine, smaller) in pairwise(seen)
        if coarse > 0 and fine > 0 and smaller < h / _FINER
    ]
    last = steps[-_GROWING:]
    return len(last) == _GROWING and min(last) > _GROWTH and bool(last[-1] > _LASTING * last[0])


def peak_memory(comm: MPI.Comm) -> float:
    """Largest resident memory so far, summed over the ranks, MB; collective."""
    # Linux hands ru_maxrss on through fork and exec: in a small child it would be that of its large parent.
    try:
        status = Path("/proc/self/status").read_text(encoding="ascii")
        own = int(status.split("VmHWM:")[1].split()[0]) / 1024
    except (OSError, IndexError):  # no Linux
        own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return float(parallel.global_sum(comm, np.array(own)))


def expected_rates(degree: int) -> dict[str, float]:
    """How errors are expected to fall with h, taken as the square root of 1 / unknowns.

    Args:
        degree: of the displacement on meshes that are refined where the error is, which restores the rates of smooth
            solutions; 1 on meshes that are refined everywhere, where the ends of the contact zones limit them.
    """
    return {name: max(rate, degree) for name, rate in _RATE.items()}


def price_list(
    levels: list[LevelResult], base_memory: float, *, rates: Mapping[str, float] = _RATE, uniform: bool = True
) -> list[Price]:
    """The rows for the meshes that were solved, coarsest first, and one for the next.

    Args:
        levels: what was solved; at least two.
        base_memory: memory before the first mesh, MB.
        rates: how the errors are expected to fall with h.
        uniform: whether each mesh is finer everywhere, and by about as much, than the one before.
    """
    changes = [_changes(coarse, fine) for coarse, fine in pairwise(levels)]
    rows = []
    for index, level in enumerate(levels):
        errors: dict[str, float | None] = dict.fromkeys(_RATE)
        if index > 0:
            fineness = [np.sqrt(level.dofs) for level in levels[: index + 1]]
            errors = {name: _error(rates[name], [c[name] for c in changes[:index]], fineness) for name in _RATE}
            errors["force"] = _force_error(levels[: index + 1])
            if errors["peak"] is not None:
                errors["peak"] += level.data + _POLYGON_PEAK * level.polygon
        if grows_for_ever(levels[: index + 1]):
            errors["peak"] = None
        errors["pressure"] = level.pressure
        change = changes[index - 1]["pressure"] if index > 0 else None
        if change is not None and level.pressure is not None:
            errors["pressure"] = _confirmed(levels[index - 1], level, change, uniform=uniform)
        rows.append(
            Price(
                level=level.level,
                h=level.h,
                dofs=level.dofs,
                linear_solves=level.linear_solves,
                factorisations=level.factorisations,
                seconds=level.seconds,
                memory=level.memory,
                energy=level.energy,
                regularisation=level.regularisation,
                iteration=level.iteration,
                pressure=errors["pressure"],
                force=errors["force"],
                zone=errors["zone"],
                peak=errors["peak"],
            )
        )
    return [*rows, predict(rows, base_memory, rates=rates)]


def _confirmed(coarse: LevelResult, fine: LevelResult, change: float, *, uniform: bool) -> float:
    """The error of the pressure in the light of its change from the mesh before.

    A change that is larger than the error that the coarse mesh was said to have shows by how much the estimate is too
    small.  On uniform meshes what changes in a pressure that the mesh resolves comes from elsewhere in the body.
    """
    estimate = fine.pressure or 0.0
    if uniform:
        return max(estimate, float(change / ((fine.dofs / coarse.dofs) ** (_SMOOTH_RATE / 2) - 1)))
    times = max(1.0, change / coarse.pressure) if coarse.pressure else 1.0
    return float(np.hypot(estimate * times, FAR * fine.energy**2))


def _force_error(levels: Sequence[LevelResult]) -> float | None:
    """Error of contact and friction force on the last mesh, from how they changed on the way to it.

    A force is an average: it is wrong by what falls like the square of the error of the displacement or, if that falls
    less, of the pressure; a corner matters little to it.
    """
    fine = levels[-1]
    size = float(np.linalg.norm(fine.force))
    if size == 0.0:
        return None
    told = []
    for coarse in levels[-1 - _MEMORY_OF_CHANGES : -1]:
        pairs = ((coarse.energy, fine.energy), (coarse.inside, fine.inside))
        share = max((after / before for before, after in pairs if before > 0), default=0.0) ** 2
        share = float(np.clip(share, 0.0, _SLOWEST))
        told.append(float(np.linalg.norm(fine.force - coarse.force)) / size * share / (1 - share))
    return max(told) + fine.data


def _changes(coarse: LevelResult, fine: LevelResult) -> dict[str, float | None]:
    """Relative change of every quantity from one mesh to the next; None where it cannot be compared."""
    c, f = coarse.table.columns, fine.table.columns
    weight, pressure = f["weight"], f["pressure"]
    size = float(np.sqrt(np.dot(weight, pressure**2)))
    difference = pressure - _interpolate(coarse.table, fine.table, "pressure")
    ends_c, ends_f = zone_ends(coarse.table), zone_ends(fine.table)
    length = float(sum(abs(b - a) for a, b in zip(ends_f[::2], ends_f[1::2], strict=True)))
    comparable = len(ends_c) == len(ends_f) > 0 and length > 0
    force = float(np.linalg.norm(fine.force))
    return {
        "pressure": float(np.sqrt(np.dot(weight, difference**2))) / size if size > 0 else None,
        "force": float(np.linalg.norm(fine.force - coarse.force)) / force if force > 0 else None,
        "zone": float(np.abs(np.subtract(ends_f, ends_c)).max()) / length if comparable else None,
        "peak": abs(pressure.max() - c["pressure"].max()) / pressure.max() if pressure.max() > 0 else None,
    }


def _interpolate(coarse: ContactTable, fine: ContactTable, name: str) -> npt.NDArray[np.float64]:
    """A column of the coarse table at the nodes of the fine one, linearly along each piece of the boundary."""
    values = np.zeros(fine.columns["s"].size)
    for here, there in zip(fine.chains, coarse.chains, strict=False):
        rows, old = slice(here.start, here.stop), slice(there.start, there.stop)
        values[rows] = np.interp(fine.columns["s"][rows], coarse.columns["s"][old], coarse.columns[name][old])
    return values


def zone_ends(table: ContactTable) -> list[float]:
    """Ends of the contact zones along the boundary, length, start and end of each zone in turn.

    Between the last node in contact and the next one the pressure falls like the square root of the distance to the
    end, so its square is extrapolated linearly.
    """
    s, pressure = table.columns["s"], table.columns["pressure"]
    ends: list[float] = []
    for chain in table.chains:
        touching = dict.fromkeys(row for row in chain if pressure[row] > 0)
        starts = [row for row in touching if row - 1 not in touching]
        stops = [row for row in touching if row + 1 not in touching]
        for first, last in zip(starts, stops, strict=True):
            ends += [_end(s, pressure, chain, first, -1, last), _end(s, pressure, chain, last, 1, first)]
    return ends


def _end(
    s: npt.NDArray[np.float64], p: npt.NDArray[np.float64], chain: range, row: int, step: int, other: int
) -> float:
    """Where p^2 vanishes beyond ``row`` in the direction ``step``."""
    outside, inside = row + step, row - step
    if outside not in chain or inside not in chain or row == other or p[inside] <= p[row]:
        return float(s[row])
    reach = p[row] ** 2 / (p[inside] ** 2 - p[row] ** 2) * abs(s[row] - s[inside])
    return float(s[row] + np.sign(s[outside] - s[row]) * min(reach, abs(s[outside] - s[row])))


def _error(rate: float, changes: list[float | None], fineness: Sequence[float]) -> float | None:
    """Error of the last mesh: the geometric mean of what the last changes, extrapolated and brought to it, tell.

    Args:
        rate: the error falls like 1 / fineness to this power.
        changes: from each mesh to the next.
        fineness: 1 / h of the meshes, one more than changes.
    """
    if not changes[-1]:
        return changes[-1]
    told = [
        change / ((fine / coarse) ** rate - 1) * (fine / fineness[-1]) ** rate
        for change, (coarse, fine) in list(zip(changes, pairwise(fineness), strict=True))[-_MEMORY_OF_CHANGES:]
        if change
    ]
    return float(np.exp(np.mean(np.log(told))))


def _finer(rows: Sequence[Price]) -> float:
    """How many times finer the last mesh is than the one before, on average over the body."""
    return float(np.sqrt(rows[-1].dofs / rows[-2].dofs))


def predict(
    rows: list[Price], base_memory: float, *, rates: Mapping[str, float] = _RATE, finer: float | None = None
) -> Price:
    """The next mesh: errors by their rates, time and memory by their growth with the unknowns.

    Args:
        rows: what was solved, coarsest first; at least two.
        base_memory: memory before the first mesh, MB.
        rates: how the errors are expected to fall with h.
        finer: how many times finer the next mesh is; None: as many times as the last one was.
    """
    last, before = rows[-1], rows[-2]
    seen_growth, seen_finer = last.dofs / before.dofs, _finer(rows)
    finer = seen_finer if finer is None else finer
    growth = finer**2
    dofs = round(last.dofs * growth)

    def next_error(name: str) -> float | None:
        value = getattr(last, name)
        return None if value is None else value / finer ** rates[name]

    energy_rate = (
        np.clip(np.log(before.energy / last.energy) / np.log(seen_finer), *_ENERGY_RATES)
        if before.energy and last.energy
        else 1.0
    )

    def grown(name: str, power: float, offset: float, least: float) -> float:
        """A part that stays, at least ``offset``, and one that grows like this power of the unknowns."""
        value, earlier = getattr(last, name), getattr(before, name)
        growing = (value - earlier) / (1 - seen_growth**-power)
        own = max(value - offset, 0.0)
        return float(value + np.clip(growing, least * own, own) * (growth**power - 1))

    return Price(
        level=last.level + 1,
        h=last.h / finer,
        dofs=dofs,
        linear_solves=last.linear_solves,
        factorisations=last.factorisations,
        seconds=grown("seconds", _TIME_POWER, 0.0, _LEAST_GROWING),
        memory=grown("memory", _MEMORY_POWER, base_memory, 0.0),
        energy=None if last.energy is None else float(last.energy / finer**energy_rate),
        pressure=next_error("pressure"),
        force=next_error("force"),
        zone=next_error("zone"),
        peak=next_error("peak"),
        regularisation=last.regularisation,
        iteration=last.iteration,
        predicted=True,
    )


def render(rows: list[Price]) -> str:
    """The price list for a terminal."""

    def number(value: float | None) -> str:
        return "        -" if value is None else f"{value:9.1e}"

    header = (
        "level         h     dofs  solves   seconds  memory MB    energy  pressure     force      zone      peak"
        "  |  of it gamma  iteration"
    )
    lines = [header]
    for row in rows:
        errors = " ".join(number(getattr(row, name)) for name in ("energy", "pressure", "force", "zone", "peak"))
        name = "next" if row.predicted else f"{row.level:4d}"
        effort = f"{row.h:9.2e} {row.dofs:8d} {row.linear_solves:7d} {row.seconds:9.2f} {row.memory:10.0f}"
        lines.append(f"{name:>5s} {effort} {errors}  |    {row.regularisation:9.1e}  {row.iteration:9.1e}")
    return "\n".join(lines)
