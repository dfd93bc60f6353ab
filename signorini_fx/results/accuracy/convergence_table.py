"""The convergence table: one row for each mesh of a nested iteration, with its errors and its cost, and one for the
next.

It needs no solves beyond those of the nested iteration.  The error of the displacement in the energy norm is estimated
on every mesh by stress recovery, that of the contact pressure by its kinks at the nodes; errors of contact force, zone
ends and largest pressure by the changes from the previous meshes, extrapolated; the regularisation error by the
dependence on gamma; that of the iteration by its last residual or change.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.mechanics.contact_points.contact_table import ContactTable, is_closed
from signorini_fx.results.accuracy.contact_surface import ContactSurface, interpolated, places
from signorini_fx.results.accuracy.force_error import force_error
from signorini_fx.results.accuracy.forecast import grown, powers
from signorini_fx.results.accuracy.mesh_level import LevelResult, MeshCost
from signorini_fx.results.accuracy.peak_error import peak_error
from signorini_fx.tuned import (
    CHANGES_USED,
    ENERGY_RATES,
    EXPECTED_RATES,
    FEW_NODES,
    LEAST_GROWING_TIME,
    POLLUTION,
    POLLUTION_OF_PEAK,
    POLYGON_ERRORS,
    POLYGON_PEAK,
    SMOOTH_RATE,
)


@dataclass(frozen=True)
class Price(MeshCost):
    """One row of the convergence table: ``MeshCost`` and errors; each is relative, None where it cannot be estimated
    yet.

    Attributes:
        energy: error of the displacement, energy norm.
        pressure: error of the contact pressure, L2(Gamma_c).
        force: error of contact and friction force.
        zone: error of the ends of the contact zones, relative to their length; in 3D of the contact area.
        peak: error of the largest pressure.
        regularisation: the part of ``energy`` due to gamma.
        iteration: the part due to the iteration.
        predicted: whether this is the next mesh, not solved yet.
    """

    energy: float | None
    pressure: float | None
    force: float | None
    zone: float | None
    peak: float | None
    regularisation: float
    iteration: float
    predicted: bool = False


def with_polygon(level: LevelResult, polygon: float) -> LevelResult:
    """A mesh with the errors that its straight facets add if they approximate a curved boundary."""
    additions = {name: share * polygon**power for name, (share, power) in POLYGON_ERRORS.items()}
    pressure = None if level.pressure is None else level.pressure + additions["pressure"]
    return replace(
        level,
        energy=level.energy + additions["energy"],
        pressure=pressure,
        loads=level.loads + additions["force"],
        polygon=polygon,
    )


def expected_rates(degree: int) -> dict[str, float]:
    """How errors are expected to decrease with h, taken as the square root of 1 / unknowns; ``degree``: of the
    displacement on adaptive meshes, which restore the rates of smooth solutions; 1 on uniform ones, where the ends of
    the contact zones limit the rates.
    """
    return {name: max(rate, degree) for name, rate in EXPECTED_RATES.items()}


def convergence_table(
    levels: list[LevelResult],
    base_memory: float,
    *,
    rates: Mapping[str, float] = EXPECTED_RATES,
    uniform: bool = True,
) -> list[Price]:
    """The rows for the meshes that were solved, coarsest first, and one for the next.

    Args:
        levels: the solved meshes; at least two.
        base_memory: memory before the first mesh, MB.
        rates: how the errors are expected to decrease with h.
        uniform: whether each mesh is finer than the previous one everywhere, and by about the same factor.  Otherwise
            the change from mesh to mesh is no error: where nothing was divided nothing changes.  Then the ends of the
            zones are told to one interval.
    """
    changes = [_changes(coarse, fine) for coarse, fine in pairwise(levels)]
    rows = []
    for index, level in enumerate(levels):
        errors: dict[str, float | None] = dict.fromkeys(EXPECTED_RATES)
        if index > 0:
            fineness = [fineness_of(level.dofs, level.dimension) for level in levels[: index + 1]]
            errors = {
                name: _error(rates[name], [c[name] for c in changes[:index]], fineness) for name in ("pressure", "zone")
            }
            # In 3D and between two bodies a single change was seen to mislead.
            enough = index > 1 or not (level.dimension == 3 or level.paired)
            errors["force"] = force_error(levels[: index + 1], uniform=uniform) if enough else None
            errors["peak"] = error = peak_error([level.table for level in levels[: index + 1]])
            if error is not None:
                # Changes of meshes that are divided here and there do not show the error elsewhere.
                elsewhere = 0.0 if uniform else min(error, POLLUTION_OF_PEAK * level.energy**2)
                errors["peak"] = error + elsewhere + level.loads + POLYGON_PEAK * level.polygon
        if level.dimension == 3:
            errors["zone"] = border_of(level.table)
        elif not uniform:
            errors["zone"] = max(errors["zone"] or 0.0, ends_of_zones(level.table) or 0.0) or None
        errors["pressure"] = level.pressure
        change = changes[index - 1]["pressure"] if index > 0 else None
        if change is not None and level.pressure is not None:
            errors["pressure"] = _confirmed(levels[index - 1], level, change, uniform=uniform)
        level_fields = (*(field.name for field in fields(MeshCost)), "energy", "regularisation", "iteration")
        row: dict[str, Any] = {name: getattr(level, name) for name in level_fields} | errors
        rows.append(Price(**row))
    last = levels[-1]
    following = predict(rows, base_memory, rates=rates, dimension=last.dimension, krylov_from=last.krylov_from)
    return [*rows, following]


def fineness_of(dofs: float, dimension: int) -> float:
    """1 / h of a mesh with so many unknowns, but for a factor; of a quotient of unknowns, how many times finer."""
    return float(np.sqrt(dofs) if dimension == 2 else np.cbrt(dofs))


def _confirmed(coarse: LevelResult, fine: LevelResult, change: float, *, uniform: bool) -> float:
    """The error of the pressure, corrected by its change from the previous mesh.

    A change that is larger than the estimated error of the coarse mesh shows by how much the estimate is too small.  On
    uniform meshes the change of a pressure that the mesh resolves is caused elsewhere in the body.
    """
    estimate = fine.pressure or 0.0
    if uniform and fine.dofs <= coarse.dofs:
        return estimate
    if uniform:
        return max(estimate, float(change / ((fine.dofs / coarse.dofs) ** (SMOOTH_RATE / fine.dimension) - 1)))
    times = max(1.0, change / coarse.pressure) if coarse.pressure else 1.0
    return float(np.hypot(estimate * times, POLLUTION * fine.energy**2))


def _changes(coarse: LevelResult, fine: LevelResult) -> dict[str, float | None]:
    """Relative change of every quantity from one mesh to the next; None where it cannot be compared."""
    f = fine.table.columns
    weight, pressure = f["weight"], f["pressure"]
    size = float(np.sqrt(np.dot(weight, pressure**2)))
    difference = pressure - interpolated(coarse.table, fine.table, "pressure")
    force = float(np.linalg.norm(fine.force))
    return {
        "pressure": float(np.sqrt(np.dot(weight, difference**2))) / size if size > 0 else None,
        "force": float(np.linalg.norm(fine.force - coarse.force)) / force if force > 0 else None,
        "zone": zone_change(coarse.table, fine.table),
    }


def zone_change(coarse: ContactTable, fine: ContactTable) -> float | None:
    """Change of the ends of the contact zones, relative to their length; in 3D that of their area."""
    if fine.facets is not None:
        coarse_area, fine_area = (
            float(np.sum(table.columns["weight"][table.columns["pressure"] > 0])) for table in (coarse, fine)
        )
        return abs(fine_area - coarse_area) / fine_area if fine_area > 0 else None
    ends_c, ends_f = zone_ends(coarse), zone_ends(fine)
    length = float(np.abs(np.diff(ends_f[:, :, 0])).sum())
    if ends_c.shape != ends_f.shape or length == 0:
        return None
    return float(np.linalg.norm((ends_f - ends_c)[:, :, 1:], axis=2).max()) / length


def border_of(table: ContactTable) -> float | None:
    """In 3D: half of the pieces that are pressed at some corners only, relative to the contact area.

    The contact ends within them, and nodes count about half of them.  The change of the area from mesh to mesh says
    less: it is zero where no node changes.
    """
    surface, pressed = ContactSurface.of(table), table.columns["pressure"] > 0
    corners, area = pressed[surface.corners], float(np.sum(table.columns["weight"][pressed]))
    border = corners.any(axis=1) & ~corners.all(axis=1)
    return float(surface.area[border].sum()) / 2 / area if area > 0 else None


def ends_of_zones(table: ContactTable) -> float | None:
    """In 2D: the longest interval in which the contact ends, relative to its length; None if it has no ends."""
    length = longest = 0.0
    for _, s, _, start, stop in _zones(table):
        length += s[stop] - s[start]
        beyond = [k for k in (start - 1, stop) if 0 <= k < len(s) - 1]
        longest = max([longest, *(float(s[k + 1] - s[k]) for k in beyond)])
    return longest / length if length > 0 and longest > 0 else None


def _zones(table: ContactTable) -> Iterator[tuple[Any, npt.NDArray[np.float64], npt.NDArray[np.float64], int, int]]:
    """Rows, arc length and pressure along the boundary of each contact zone with ends, and where these are in them."""
    pressure = table.columns["pressure"]
    for path, first, last in table.runs(pressure > 0):
        if is_closed(path) and (pressure[path] > 0).all():
            continue
        rows, s, path_slice = table.unrolled(path)
        start, stop = (path_slice.start + int(np.flatnonzero(path == row)[0]) for row in (first, last))
        yield rows, s, pressure[rows], start, stop + (path_slice.stop - path_slice.start) * (stop < start)


def zone_ends(table: ContactTable) -> npt.NDArray[np.float64]:
    """Start and end of each contact zone: arc length and position there, length, shape (zones, 2, 3).

    Between the last node in contact and the next one the pressure falls like the square root of the distance to the
    end, so its square is extrapolated linearly.
    """
    zones, x = [], places(table)
    for rows, s, p, start, stop in _zones(table):
        ends = [_end(s, p, start, -1, stop), _end(s, p, stop, 1, start)]
        zones.append([[end, *(np.interp(end, s, axis) for axis in x[rows].T)] for end in ends])
    return np.array(zones).reshape(-1, 2, 3)


def _end(s: npt.NDArray[np.float64], p: npt.NDArray[np.float64], row: int, step: int, opposite: int) -> float:
    """Where p^2 vanishes beyond ``row`` in the direction ``step``."""
    outside, inside = row + step, row - step
    if not (0 <= outside < p.size and 0 <= inside < p.size) or row == opposite or p[inside] <= p[row]:
        return float(s[row])
    reach = p[row] ** 2 / (p[inside] ** 2 - p[row] ** 2) * abs(s[row] - s[inside])
    return float(s[row] + np.sign(s[outside] - s[row]) * min(reach, abs(s[outside] - s[row])))


def _error(rate: float, changes: list[float | None], fineness: Sequence[float]) -> float | None:
    """Error of the last mesh: the geometric mean of the estimates from the last changes, extrapolated to it;
    ``fineness``: 1 / h of the meshes, one more than changes.

    A mesh with no more unknowns than the one before it, as generators make it of smaller cells here and there, says
    nothing; None: no mesh says anything.
    """
    if not changes[-1]:
        return changes[-1]
    estimates = [
        change / ((fine / coarse) ** rate - 1) * (fine / fineness[-1]) ** rate
        for change, (coarse, fine) in list(zip(changes, pairwise(fineness), strict=True))[-CHANGES_USED:]
        if change and fine > coarse
    ]
    return float(np.exp(np.mean(np.log(estimates)))) if estimates else None


def predict(
    rows: list[Price],
    base_memory: float,
    *,
    rates: Mapping[str, float] = EXPECTED_RATES,
    finer: float | None = None,
    dimension: int = 2,
    krylov_from: float = np.inf,
) -> Price:
    """The next mesh: errors by their rates, time and memory by their growth with the unknowns; ``finer``: how many
    times finer the next mesh is, on average over the body; None: as many times as the last one was.
    """
    last, previous = rows[-1], rows[-2]
    seen_growth = last.dofs / previous.dofs
    seen_finer = fineness_of(seen_growth, dimension)
    finer = seen_finer if finer is None else finer
    growth = finer**dimension

    def next_error(name: str) -> float | None:
        value = getattr(last, name)
        return None if value is None else value / finer ** rates[name]

    energy_rate = (
        np.clip(np.log(previous.energy / last.energy) / np.log(seen_finer), *ENERGY_RATES)
        if previous.energy and last.energy
        else 1.0
    )

    seconds, memory = powers(last.dofs * growth, dimension, krylov_from)
    return replace(
        last,
        level=last.level + 1,
        h=last.h / finer,
        dofs=round(last.dofs * growth),
        seconds=grown(last.seconds, previous.seconds, seen_growth, growth, seconds, least=LEAST_GROWING_TIME),
        memory=grown(last.memory, previous.memory, seen_growth, growth, memory, offset=base_memory),
        energy=None if last.energy is None else float(last.energy / finer**energy_rate),
        pressure=next_error("pressure"),
        force=next_error("force"),
        zone=next_error("zone"),
        peak=next_error("peak"),
        predicted=True,
    )


def render(rows: list[Price]) -> str:
    """The convergence table for a terminal."""

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
    if any(row.peak is None for row in rows[1:] if not row.predicted):
        lines.append(
            f"   -: the largest pressure has no limit, or no estimate on meshes with fewer than {FEW_NODES} nodes in "
            "contact, or that are no finer where it is"
        )
    return "\n".join(lines)
