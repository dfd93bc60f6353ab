"""The convergence table: a row for each mesh of a nested iteration, with its errors and its cost,
and a prediction for the next mesh.

It needs no further solves: errors are estimated on each mesh, those of forces and largest pressures
by extrapolated changes from the previous meshes.

``LevelResult`` has results, errors and cost of a solution on one mesh.  Further functions expect
the cost of a solve before it begins, and of the next accuracy after it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from pydantic import ConfigDict, InstanceOf

from signorini_fx.algebra.algorithms.path_following import path_model
from signorini_fx.algebra.algorithms.task import Outcome, Task
from signorini_fx.algebra.linalg import choice, petsc_calls, petsc_options
from signorini_fx.algebra.linalg.factorisation import factor_entries
from signorini_fx.arrays import Array
from signorini_fx.machine import parallel
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.contact_points.contact_table import ContactTable
from signorini_fx.mechanics.mesh.files.size_field import least_bytes
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.effect import Effect
from signorini_fx.mechanics.statement.features import accuracy_refused
from signorini_fx.quantities.summary import Number, Price
from signorini_fx.results.accuracy.contact_surface import ContactSurface
from signorini_fx.results.accuracy.next_accuracy import next_refinement
from signorini_fx.results.accuracy.pressure_error import peak_error
from signorini_fx.tuned import (
    BASE_BYTES,
    CHANGES_USED,
    ENERGY_RATES,
    EXPECTED_RATES,
    FACTOR_SECONDS,
    FEW_NODES,
    FIXED_UNKNOWNS,
    FORCE_OF_ENERGY,
    LEAST_GROWING_TIME,
    MEMORY_POWER,
    NEWTON_SOLVES,
    PAIRED_BYTES,
    POLLUTION_OF_PEAK,
    POLYGON_SHARES,
    SLOWEST_DECREASE,
    SOLVE_SECONDS,
    SOLVES_OF_START,
    SOLVES_PER_DOUBLING,
    TIME_POWER,
    WHOLE_SECONDS,
    ZERO_IN_SOLUTION,
)


def polygon_error_of(name: str, polygon: float) -> float:
    """Return the error of a quantity that is due to straight facets on a curved boundary.

    Args:
        name: the quantity.
        polygon: see ``LevelResult.polygon``.
    """
    share = POLYGON_SHARES.get(name)
    return (POLYGON_SHARES["pressure"] * polygon) ** 2 if share is None else share * polygon


def with_polygon(level: LevelResult, polygon: float) -> LevelResult:
    """Return the results of a mesh with the errors that its straight facets add."""
    pressure = (
        None if level.pressure is None else level.pressure + polygon_error_of("pressure", polygon)
    )
    energy, loads = (polygon_error_of(name, polygon) for name in ("energy", "force"))
    sums = {"energy": level.energy + energy, "loads": level.loads + loads}
    return level.model_copy(update={**sums, "pressure": pressure, "polygon": polygon})


def convergence_table(
    levels: list[LevelResult],
    base_memory: float,
    *,
    rates: Mapping[str, float] = EXPECTED_RATES,
    uniform: bool = True,
) -> list[Price]:
    """Return a row for each solved mesh, and one for the next mesh.

    Args:
        levels: the solved meshes, at least two, coarsest first.
        base_memory: memory before the first mesh, MB.
        rates: the expected rates by which errors decrease with h.
        uniform: whether each mesh is finer than the previous one everywhere, and by about the same
            factor; otherwise changes between meshes are no measure of errors.
    """
    rows = []
    for index, level in enumerate(levels):
        so_far = levels[: index + 1]
        errors = {"pressure": level.pressure, "force": None, "peak": None}
        if index > 0:
            # A single change may mislead.
            known = index > 1 and level.pressure is not None
            errors["force"] = force_error(so_far, uniform=uniform) if known else None
            errors["peak"] = error = peak_error([level.table for level in so_far])
            if error is not None:
                # Changes between locally refined meshes do not show the error elsewhere.
                elsewhere = 0.0 if uniform else min(error, POLLUTION_OF_PEAK * level.energy**2)
                errors["peak"] = (
                    error + elsewhere + level.loads + polygon_error_of("peak", level.polygon)
                )
        errors["zone"] = (
            border_of(level.table) if level.dimension == 3 else ends_of_zones(level.table)
        )
        rows.append(Price(**(level.model_dump(include=set(Price.model_fields)) | errors)))
    last = levels[-1]
    following = predict(
        rows, base_memory, rates=rates, dimension=last.dimension, krylov_from=last.krylov_from
    )
    return [*rows, following]


def fineness_of(dofs: float, dimension: int) -> float:
    """Return 1 / h of a mesh with this number of unknowns, up to a factor; for a ratio of unknowns,
    the ratio of 1 / h.
    """
    return float(np.sqrt(dofs) if dimension == 2 else np.cbrt(dofs))


def seen_rate(rows: Sequence[Price], dimension: int) -> float:
    """Return the observed rate at which the error in the energy norm decreases with h; 1 with a
    single mesh.
    """
    last = rows[-1]
    energies = [row.energy for row in rows[-2:]]
    if len(energies) < 2 or not energies[0] or not energies[1] or energies[1] >= energies[0]:
        return 1.0
    finer = fineness_of(last.dofs / rows[-2].dofs, dimension)
    return float(np.clip(np.log(energies[0] / energies[1]) / np.log(finer), *ENERGY_RATES))


def force_error(levels: Sequence[LevelResult], *, uniform: bool = True) -> float | None:
    """Return the relative error of contact and friction force on the last mesh, or None without a
    force.

    By J. A. Nitsche's argument it decreases like the square of the error of the displacement; with
    this rate the changes are extrapolated.  On locally refined meshes it is at least a share of
    that square, unless statics determines the force, which then does not change at all.  Meshes
    with the same few nodes in contact do not show what these miss.  With several contact boundaries
    it is the error of all forces together, as their resultant may vanish.

    Args:
        levels: at least two, coarsest first.
        uniform: whether each mesh is finer than the previous one everywhere.
    """
    fine = levels[-1]
    size = float(np.linalg.norm(fine.forces))
    if size == 0.0:
        return None
    seen = 0.0
    for coarse in levels[-1 - CHANGES_USED : -1]:
        # A coarse mesh without an error estimate, such as one on which nothing touches, shows no
        # rate: all of the error may remain.
        left = min(
            (fine.energy / coarse.energy) ** 2 if coarse.energy > 0 else 1.0, SLOWEST_DECREASE
        )
        seen = max(
            seen, float(np.linalg.norm(fine.forces - coarse.forces)) / size * left / (1 - left)
        )
    if not uniform and seen > ZERO_IN_SOLUTION:
        seen = max(seen, FORCE_OF_ENERGY * fine.energy**2)
    return seen + fine.loads + fine.points


def border_of(table: ContactTable) -> float | None:
    """Return half of the area of the pieces with both pressed and open corners, relative to the
    contact area, in 3D; None without contact.

    The contact ends within these pieces, and nodes count about half of them.  The change of the
    area from mesh to mesh is a worse estimate: it is zero where no node changes.
    """
    surface = ContactSurface.of(table)
    pressed = table.columns["pressure"] > 0
    corners = pressed[surface.corners]
    area = float(np.sum(table.columns["weight"][pressed]))
    border = corners.any(axis=1) & ~corners.all(axis=1)
    return float(surface.area[border].sum()) / 2 / area if area > 0 else None


def ends_of_zones(table: ContactTable) -> float | None:
    """Return the longest interval in which a contact zone ends, relative to the length of the
    zones, in 2D; None without ends.
    """
    length = longest = 0.0
    pressed = table.columns["pressure"] > 0
    for path in table.paths:
        lengths = np.diff(table.arc(path))
        begin = pressed[path[:-1]]
        end = pressed[path[1:]]
        length += float(lengths[begin & end].sum())
        longest = max(longest, float(lengths[begin != end].max(initial=0.0)))
    return longest / length if length > 0 and longest > 0 else None


def predict(
    rows: list[Price],
    base_memory: float,
    *,
    rates: Mapping[str, float] = EXPECTED_RATES,
    finer: float | None = None,
    dimension: int = 2,
    krylov_from: float = np.inf,
) -> Price:
    """Return a prediction for the next mesh: errors by their rates, time and memory by their growth
    with the unknowns.

    Args:
        rows: the solved meshes, at least two.
        base_memory: memory before the first mesh, MB.
        rates: the expected rates by which errors decrease with h.
        finer: ratio of h of the last and the next mesh, on average over the body; None for the
            ratio of the last two meshes.
        dimension: dimension of the body.
        krylov_from: number of unknowns from which on a Krylov method is used.
    """
    last = rows[-1]
    previous = rows[-2]
    seen_growth = last.dofs / previous.dofs
    seen_finer = fineness_of(seen_growth, dimension)
    finer = seen_finer if finer is None else finer
    growth = finer**dimension
    expected = {**rates, "energy": seen_rate(rows, dimension)}
    errors = {
        name: getattr(last, name) / finer**rate
        for name, rate in expected.items()
        if getattr(last, name)
    }
    # The time and the memory of a Krylov method are those of its products.
    krylov = last.dofs * growth >= krylov_from
    seconds, memory = (1.0, 1.0) if krylov else (TIME_POWER[dimension], MEMORY_POWER[dimension])
    cost = {
        "level": last.level + 1,
        "h": last.h / finer,
        "dofs": round(last.dofs * growth),
        "seconds": grown(
            last.seconds, previous.seconds, seen_growth, growth, seconds, least=LEAST_GROWING_TIME
        ),
        "memory": grown(
            last.memory, previous.memory, seen_growth, growth, memory, offset=base_memory
        ),
    }
    return last.model_copy(update={**cost, **errors, "predicted": True})


def grown(
    value: float,
    earlier: float,
    seen: float,
    growth: float,
    power: float,
    *,
    offset: float = 0.0,
    least: float = 0.0,
) -> float:
    """Return a time or memory on the next mesh: a constant part, at least ``offset``, plus one that
    grows like a power of the unknowns.

    Args:
        value: its value on the last mesh.
        earlier: its value on the mesh before.
        seen: ratio of the unknowns of the last two meshes.
        growth: ratio of the unknowns of the next and the last mesh.
        power: the power.
        offset: the least constant part.
        least: the least share of the rest that grows.
    """
    growing = (value - earlier) / (1 - seen**-power)
    excess = max(value - offset, 0.0)
    return float(value + np.clip(growing, least * excess, excess) * (growth**power - 1))


def render(rows: list[Price]) -> str:
    """Return the convergence table as text for a terminal."""

    def number(value: float | None) -> str:
        return "        -" if value is None else f"{value:9.1e}"

    header = (
        "level         h     dofs  solves   seconds  memory MB    energy  pressure     force      "
        "zone      peak"
        "  |  of it gamma  iteration"
    )
    lines = [header]
    for row in rows:
        errors = " ".join(
            number(getattr(row, name)) for name in ("energy", "pressure", "force", "zone", "peak")
        )
        name = "next" if row.predicted else f"{row.level:4d}"
        effort = (
            f"{row.h:9.2e} {row.dofs:8d} {row.linear_solves:7d} {row.seconds:9.2f} "
            f"{row.memory:10.0f}"
        )
        lines.append(
            f"{name:>5s} {effort} {errors}  |    {row.regularisation:9.1e}  {row.iteration:9.1e}"
        )
    if any(row.peak is None for row in rows[1:] if not row.predicted):
        lines.append(
            "   -: the largest pressure has no limit, or no estimate on meshes with fewer than "
            f"{FEW_NODES} nodes in "
            "contact, or that are no finer where it is"
        )
    return "\n".join(lines)


class LevelResult(Price):
    """Results of a solved mesh: cost, errors, and data to compare with other meshes.

    Cost and errors (loads included) are those of a ``Price``.  ``force``, ``zone`` and ``peak`` are
    None, because they are known from several meshes only, see ``convergence_table``.

    Attributes:
        loads: the error of the loads on the mesh.
        points: the error of the force that is due to few nodes in contact, see ``Errors.points``.
        polygon: effect of straight facets on a curved contact boundary, which no refinement
            reduces, see ``pressure_error.polygon_error``.
        pressure_regularisation: as ``regularisation``, of the contact pressure, relative in
            L2(Gamma_c).
        table: the contact boundary.
        forces: contact and friction force of each contact boundary in all load steps, shape (2 d
            boundaries steps,).
        krylov_from: number of unknowns from which on a mesh is solved by a Krylov method; infinite
            if none is.
    """

    model_config = ConfigDict(arbitrary_types_allowed=True)

    energy: float
    force: Number = None
    zone: Number = None
    peak: Number = None
    predicted: bool = False
    loads: float
    points: float = 0.0
    polygon: float = 0.0
    pressure_regularisation: float
    table: InstanceOf[ContactTable]
    forces: Array
    krylov_from: float

    @property
    def dimension(self) -> int:
        """The dimension of the body, 2 or 3."""
        return 2 if self.table.facets is None else 3


def mean_spacing(table: ContactTable, *, revolved: bool) -> float:
    """Return the mean length per contact node; in 3D the side of a square of the mean area.

    Args:
        table: the contact table.
        revolved: whether weights are areas of rings.
    """
    weight = table.columns["weight"]
    if revolved:
        return float(sum(np.ptp(table.arc(path)) for path in table.paths) / len(weight))
    return float(weight.mean() ** (1 if table.facets is None else 1 / 2))


def regularisation_errors(
    task: Task, outcome: Outcome, size: float, contact: ContactState
) -> tuple[float, float]:
    """Return the regularisation error of a solution in the energy norm and that of its contact
    pressure, both relative; collective.

    They take one or two back substitutions.

    Args:
        task: the problem that was solved.
        outcome: its solution.
        size: energy norm of the solution.
        contact: the contact state of this rank.
    """
    data = outcome.problem.data
    # Multipliers of an augmentation shift the pressure.
    shifted = parallel.any_rank(contact.boundary.comm, data.lambda_hat)
    if shifted or not np.isfinite(data.gamma_n) or not size > 0:
        return 0.0, 0.0
    newton = task.unsymmetric_newton if data.follows is not None else task.newton
    problem = newton.problem
    jacobian = newton.snes.getJacobian()[0]
    if (
        jacobian.handle not in problem.tangent.factorised
    ):  # of a checkpoint, with which nothing has been solved
        newton.pose(problem.data, problem.sets)
        problem.assemble_jacobian(jacobian)
        problem.factorised(jacobian)
        with petsc_options.defaults():
            petsc_calls.solve(newton.snes.getKSP().setUp)
    model = path_model(newton, data)
    pressure = contact.points.norm(contact.pressure)
    return model.distance / size, model.pressure_distance / pressure if pressure > 0 else 0.0


@dataclass(frozen=True)
class Cost:
    """A rough estimate, good to a factor of about three, for one core of a machine of the 2020s."""

    unknowns: int  # free displacement components, of the body and of rigid bodies
    linear_algebra: str  # ``full``, ``krylov`` or ``condensed``, and why
    linear_solves: tuple[int, int]  # from and to, of all load steps
    seconds: tuple[float, float]  # of the whole solve, from and to
    memory_bytes: float  # of the whole process
    next_error: float  # ratio of the next error to the present one
    next_seconds: tuple[float, float]  # seconds for the next error, from and to
    next_local: bool  # whether cells are divided where the error is; otherwise all become smaller
    next_refused: str  # why no accuracy can be requested; "" if it can


def linear_solves(model: Model, nodes: int) -> tuple[int, int]:
    """Return the smallest and largest number of linear solves to expect."""
    divided = max(
        (entry.time_steps(model.path.times) for entry in model.statement.of(Effect)), default=0
    )
    steps = model.path.expected + divided
    finer = model.settings.levels - 1
    if model.statement.nonlinear:
        return NEWTON_SOLVES[0] * steps, NEWTON_SOLVES[1] * steps
    if not model.contacts:
        return steps * (1 + finer), steps * (1 + finer)
    size = math.log2(max(nodes / 2**finer, 4))
    size *= 2 if model.has_coulomb else 1
    low, high = (round(factor * size) for factor in SOLVES_PER_DOUBLING)
    # A later load step starts from the sets of the previous one, a finer mesh from those of the
    # coarser one.
    least, greatest = SOLVES_OF_START
    if divided:  # in short steps sets hardly change
        return divided, least * steps
    return low + least * (steps - 1 + finer * steps), high * steps + greatest * finer * steps


def factorisation_seconds(unknowns: float, dimension: int) -> float:
    """Return the seconds of one sparse factorisation."""
    return SOLVE_SECONDS * unknowns + FACTOR_SECONDS[dimension] * unknowns ** (
        1.5 if dimension == 2 else 2.0
    )


def estimated_cost(model: Model) -> Cost:
    """Return the expected cost of a solve; collective.

    Nested dissection has n log n entries and n^1.5 operations in 2D, n^(4/3) and n^2 in 3D;
    multigrid has n of both.
    """
    comm = model.comm
    n = model.dofs
    dim = model.tagged.dimension
    touching = 0 if model.boundary is None else np.unique(model.boundary.nodes).size
    nodes, free = map(
        int, parallel.global_sum(comm, np.array([touching, np.count_nonzero(~model.fixed)]))
    )
    factorisation = factorisation_seconds(n, dim)
    solves = linear_solves(model, nodes)
    matrix = 12.0 * dim * 3**dim * n  # entries of the rows of Q1
    kind, reason = choice.choose_kind(model.system_size(), model.settings.linear_algebra)
    dense = 0
    held = 12.0 * factor_entries(n, dim)
    once, per_solve = 0.0, factorisation
    if kind == "krylov":
        per_solve = 0.0
        held = matrix
    elif kind == "condensed":  # dense solves take no longer, or it would not be chosen
        dense = dim * nodes
    elif model.boundary is None:
        reason = "one factorisation for all load steps"
        once = factorisation
        per_solve = SOLVE_SECONDS * n
    if model.boundary is not None and model.boundary.moving is not None:
        free += int(np.count_nonzero(~model.boundary.moving.fixed))
    # All other work, for each load step.
    steps = 1 if model.boundary is None else model.path.expected
    rest = steps * WHOLE_SECONDS[dim] * (FIXED_UNKNOWNS[dim] + n)
    seconds = (max(once + solves[0] * per_solve, rest), max(once + solves[1] * per_solve, rest))
    of = "energy" if model.statement.accuracy is None else model.statement.accuracy.of
    refused = accuracy_refused(model.statement, of)
    refinement = next_refinement(model.statement, model.tagged, of, free, able=not refused)
    paired = (
        PAIRED_BYTES[dim] * nodes if any(contact.against for contact in model.contacts) else 0.0
    )
    return Cost(
        unknowns=free,
        linear_algebra=f"{kind}: {reason}",
        linear_solves=solves,
        seconds=seconds,
        memory_bytes=BASE_BYTES * comm.size
        + least_bytes(dim) * n
        + held
        + 24.0 * dense**2
        + paired,
        next_error=refinement.share,
        next_seconds=(seconds[0] * refinement.times[0], seconds[1] * refinement.times[1]),
        next_refused=refused if model.contacts else "",
        next_local=refinement.local,
    )
