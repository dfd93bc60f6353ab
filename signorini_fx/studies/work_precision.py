"""What accuracy costs by every method: one list of methods, one reference, the same measure for all.

The methods vary one choice at a time around the default: the element, the regularisation, the algorithm, the linear
algebra, the meshes.  Errors are measured outside the methods, against a solution of much higher accuracy (see
``reference``); how far that can be trusted itself is estimated from coarser ones.
"""

from __future__ import annotations

import ctypes
import gc
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from mpi4py import MPI

from signorini_fx.errors import SceneError, SignoriniError
from signorini_fx.report import plots
from signorini_fx.results.files import write_csv
from signorini_fx.results.solution import Solution
from signorini_fx.scene.model import Accuracy, Scene
from signorini_fx.solving.solver import solve
from signorini_fx.studies.reference import Reference, on_mesh, overkill

Row = dict[str, Any]

QUANTITIES = {
    "energy": "displacement, energy norm",
    "pressure": "contact pressure, $L^2(\\Gamma_c)$",
    "peak": "largest contact pressure",
    "zone": "ends of the contact zone",
    "force": "contact and friction force",
}
FAMILIES = {
    "element": "Element",
    "gamma": r"Fixed $\gamma$, in units of $E$ / size",
    "algorithm": "Algorithm",
    "linear algebra": "Linear algebra",
    "meshes": "One mesh, nested, adaptive",
}
PHASES = ("mesh", "compile", "assemble", "condense", "iterate", "certify")
TARGETS = (1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4)
# Elements of the study's meshes, relative to those of the scene; those of a uniform reference, unknowns of another.
_FACTORS, _QUICK_FACTORS = (8.0, 4.0, 2.0, 1.0, 0.5), (4.0, 2.0)
_REFERENCE, _QUICK_REFERENCE = (0.2, 300_000), (1.0, 30_000)
# Errors in the energy norm that adaptive meshes are asked for, and what a run may take, seconds.
_ASKED = {"P1": (0.2, 0.1, 0.05, 0.025), "P2": (0.05, 0.01, 3e-3, 1e-3)}
_QUICK_ASKED, _TOO_LONG = (0.05, 0.02), 30.0
# A run that takes longer is not repeated, one that takes this long only three times, seconds.
_LONG, _MIDDLE = 15.0, 0.5
# Times so close are a tie, and the first in the list wins: it is the simpler one.  So are errors so close.
_TIE, _SAME = 1.25, 0.8
# Forces that balance the load on every mesh have no error to be shown.
_NOTHING = 1e-5


@dataclass(frozen=True)
class Method:
    """One way to solve the scene.

    Attributes:
        name: what to call it.
        families: the comparisons that it takes part in.
        element: P1, Q1, P2 or Q2.
        gamma: gamma_1 = gamma_2 over E / size of the body; None: automatic.
        settings: further solver settings.
        adaptive: whether its meshes are divided where the error is, until an accuracy is reached.
    """

    name: str
    families: tuple[str, ...]
    element: str = "Q1"
    gamma: float | None = None
    settings: dict[str, Any] = field(default_factory=dict)
    adaptive: bool = False

    @property
    def degree(self) -> int:
        """Of the element."""
        return int(self.element[1])


def methods(scene: Scene, *, quick: bool = False) -> list[Method]:
    """The list, simplest first."""
    exact = {"algorithm": "exact"}
    found = [Method("Q1, exact", tuple(FAMILIES), settings=exact)]
    elements = ("Q2",) if quick else ("Q2", "P1", "P2")
    found += [Method(f"{name}, exact", ("element",), name, settings=exact) for name in elements]
    for name, settings in (
        ("gamma automatic", {}),
        ("continuation", {"algorithm": "continuation"}),
        ("path-following", {"algorithm": "path-following"}),
        ("ALM", {"algorithm": "alm"}),
    ):
        if scene.has_coulomb:
            name = f"{name}-FP" if name == "ALM" else f"{name}, FP"
        if not quick or "ALM" in name:
            found.append(Method(name, ("algorithm",), settings=settings))
    powers = (5,) if quick else (3, 4, 5, 6, 7, 8, 9, 10)
    found += [Method(f"gamma = 1e{power}", ("gamma",), gamma=10.0**power) for power in powers]
    if scene.has_coulomb:
        found.append(Method("gamma automatic, monolithic", ("algorithm",), settings={"coulomb": "newton"}))
    for kind in ("condensed", "full", "krylov")[: 2 if quick else 3]:
        found.append(Method(f"Q1, exact, {kind}", ("linear algebra",), settings={**exact, "linear_algebra": kind}))
    for element in ("Q1", "Q2"):
        nested = {**exact, "levels": 2 if quick else 3}
        found.append(Method(f"{element}, exact, nested", ("meshes",), element, settings=nested))
    if not quick:
        found.append(Method("Q2, ALM, nested", ("meshes",), "Q2", settings={"algorithm": "alm", "levels": 3}))
        found.append(Method("Q2, exact", ("meshes",), "Q2", settings=exact))
        found.append(Method("P1, exact, adaptive", ("meshes",), "P1", settings=exact, adaptive=True))
    found.append(Method("P2, exact, adaptive", ("meshes",), "P2", settings=exact, adaptive=True))
    return list({method.name: method for method in _merge(found)}.values())


def _merge(found: list[Method]) -> list[Method]:
    """Methods that are in the list twice, once with the families of both."""
    families: dict[str, list[str]] = {}
    for method in found:
        families.setdefault(method.name, []).extend(method.families)
    return [replace(method, families=tuple(families[method.name])) for method in found]


@dataclass(frozen=True)
class Study:
    """What was measured.

    Attributes:
        scene: about what.
        rows: one for each method on each mesh, failures included; the columns of work_precision.csv.
        floor: how far the reference itself may be wrong, quantity by quantity; None: it cannot be told.
        reference: what the reference is.
        seconds: wall time of the whole study.
    """

    scene: Scene
    rows: list[Row]
    floor: dict[str, float | None]
    reference: str
    seconds: float


def run_study(
    scene: Scene, *, quick: bool = False, repeats: int = 7, report: Callable[[str], None] = lambda _: None
) -> Study:
    """Run every method on every mesh; on one rank.

    Args:
        scene: with a mesh from a generator that has ``coarser``, contact and one load step.
        quick: few methods, two coarse meshes, no repeats.
        repeats: rounds that are counted, long runs take part in three; medians are taken.  In a round before them
            forms may still be compiled.
        report: is told how far it is.

    Raises:
        SceneError: the scene is none of that kind.
        ConvergenceError: there is no reference.
    """
    if not scene.contact or scene.steps > 1:
        raise SceneError([("contact", "a study needs a scene with contact and one load step")])
    begin = time.perf_counter()
    factors = _QUICK_FACTORS if quick else _FACTORS
    reference, floor = overkill(scene, *(_QUICK_REFERENCE if quick else _REFERENCE))
    about = f"{reference.about}, {reference.solution.discretisation.dofs} unknowns"
    report(f"reference: {about}; {time.perf_counter() - begin:.1f} s")
    natural = scene.young / reference.solution.discretisation.tagged.size
    runs = []
    for method in methods(scene, quick=quick):
        if method.adaptive:
            targets = _QUICK_ASKED if quick else _ASKED[method.element]
            runs += [_Run(method, 1.0, scene, natural, asked=target) for target in targets]
            continue
        # Quadratic elements on twice as large cells have as many unknowns.
        own = factors[:-1] if method.degree == 2 else factors[1:]
        runs += [_Run(method, factor, scene, natural) for factor in (own if not quick else factors)]
    for repeat in range(1 if quick else repeats + 1):
        for run in runs:
            run.go(reference if repeat == 0 else None, counted=repeat > 0 or quick)
        report(f"round {repeat} of {0 if quick else repeats}: {time.perf_counter() - begin:.1f} s")
    return Study(scene, [run.row() for run in runs], floor, about, time.perf_counter() - begin)


class _Run:
    """A method on a mesh, or on those that an accuracy takes, as often as it is repeated."""

    def __init__(
        self, method: Method, factor: float, scene: Scene, natural: float, *, asked: float | None = None
    ) -> None:
        gamma = "auto" if method.gamma is None else method.gamma * natural
        settings = {"gamma_n": gamma, "gamma_t": gamma, **method.settings}
        self._scene = on_mesh(scene, factor, method.element, settings)
        if asked is not None:
            goal = Accuracy(target=asked, of="energy", refinement="adaptive", seconds=_TOO_LONG)
            self._scene = self._scene.model_copy(update={"accuracy": goal})
        self._method, self._factor, self._asked = method, factor, asked
        self._times: list[dict[str, float]] = []
        self._about: Row = {}
        self._enough = 1000

    def go(self, reference: Reference | None, *, counted: bool) -> None:
        """Solve once; measure the errors where there is a reference."""
        if len(self._times) >= self._enough:
            return
        before, begin = _resident(reset=True), time.perf_counter()
        try:
            solution = solve(self._scene, MPI.COMM_SELF, check=False)
        except SignoriniError as error:
            self._about = {"status": " ".join(str(error).split()), **dict.fromkeys(QUANTITIES)}
            return
        total = time.perf_counter() - begin
        self._enough = 1 if total > _LONG else 3 if total > _MIDDLE else self._enough
        if counted or self._enough == 1:
            own = {phase: solution.timings.seconds.get(phase, 0.0) for phase in PHASES}
            coarser = sum(level.seconds for level in solution.levels[:-1])
            rest = max(0.0, total - sum(own.values()) - coarser)
            memory = max(0.0, _resident() - before)
            self._times.append({"seconds": total, **own, "coarser": coarser, "rest": rest, "memory": memory})
        if reference is None:
            return
        weight = solution.table.columns["weight"]
        self._about = {
            "h": float(weight.mean()),
            "dofs": solution.discretisation.dofs,
            "linear_solves": solution.history.linear_solves,
            "work": work_of(solution),
            "factorisations": sum(record.factorised for record in solution.history.iterations),
            "linear_algebra": solution.linear_algebra.split(":")[0],
            "status": solution.status.value,
            **dict.fromkeys(QUANTITIES),
        }
        if solution.converged:
            key = None if self._asked else (self._method.element[0], self._factor)
            self._about |= reference.errors(solution, key)

    def row(self) -> Row:
        """All that is known of it."""
        settings, about = self._scene.solver, self._about
        times: dict[str, float | None] = dict.fromkeys(
            ("seconds", *PHASES, "coarser", "rest", "fastest", "slowest", "memory")
        )
        if self._times:
            times |= {name: statistics.median(run[name] for run in self._times) for name in self._times[0]}
            totals = [run["seconds"] for run in self._times]
            times |= {"fastest": min(totals), "slowest": max(totals)}
        return {
            "method": self._method.name,
            "families": "; ".join(self._method.families),
            "element": self._method.element,
            "algorithm": settings.algorithm,
            "coulomb": settings.coulomb if self._scene.has_coulomb else "",
            "gamma": self._method.gamma if self._method.gamma is not None else "auto",
            "linear_algebra": about.get("linear_algebra", settings.linear_algebra),
            "levels": settings.levels,
            "size_of_cells": None if self._asked else self._factor,
            "asked": self._asked,
            "h": about.get("h"),
            "dofs": about.get("dofs"),
            "status": about.get("status", ""),
            **{name: about.get(name) for name in QUANTITIES},
            "linear_solves": about.get("linear_solves"),
            "work": about.get("work"),
            "factorisations": about.get("factorisations"),
            "repeats": len(self._times),
            **times,
        }


def work_of(solution: Solution) -> int:
    """Linear solves on every mesh times the unknowns there."""
    meshes = [(level.linear_solves, level.dofs) for level in solution.levels]
    meshes = meshes or [(solution.history.linear_solves, solution.discretisation.dofs)]
    return sum(solves * dofs for solves, dofs in meshes)


def _resident(*, reset: bool = False) -> float:
    """Largest resident memory since the last reset, MB; 0 where the system does not tell."""
    try:
        if reset:  # what earlier runs have left would hide what this one takes
            gc.collect()
            ctypes.CDLL(None).malloc_trim(0)
            Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
        text = Path("/proc/self/status").read_text(encoding="ascii")
    except (OSError, AttributeError):
        return 0.0
    return int(text.partition("VmHWM:")[2].split()[0]) / 1024


# --- what follows from the table -------------------------------------------------------------------------------------


def lasting_errors(rows: Sequence[Row], quantity: str) -> list[float | None]:
    """The errors without luck: of each run the largest on its mesh and the finer ones by the same method.

    An error that changes its sign is small on one mesh by accident.
    """
    result: list[float | None] = []
    for row in rows:
        family = [r for r in rows if r["method"] == row["method"] and _coarseness(r) <= _coarseness(row)]
        errors = [r[quantity] for r in family if r[quantity] is not None]
        result.append(max(errors) if row[quantity] is not None else None)
    return result


def _coarseness(row: Row) -> float:
    """The size of the cells, or the accuracy that was asked for: what falls from run to run of a method."""
    return float(row["size_of_cells"] or row["asked"])


def cheapest_front(rows: Sequence[Row], quantity: str, floor: float | None = None) -> list[tuple[Row, float]]:
    """The runs that no cheaper run beats, cheapest first, each with its lasting error.

    A step down is worth a fifth of the error at least; where several runs are as good as equal, the first of the list
    stands for them.  Errors below that of the reference, ``floor``, cannot be told apart.
    """
    errors = [None if e is None else max(e, floor or 0.0) for e in lasting_errors(rows, quantity)]
    known = [(row, e) for row, e in zip(rows, errors, strict=True) if e is not None and row["seconds"]]
    front: list[tuple[Row, float]] = []
    for row, error in sorted(known, key=lambda pair: (pair[0]["seconds"], pair[1])):
        if not front or error < _SAME * front[-1][1]:
            front.append(next(pair for pair in known if _as_good(pair, (row, error))))
    return [pair for k, pair in enumerate(front) if not any(_beats(later, pair) for later in front[k + 1 :])]


def _beats(one: tuple[Row, float], other: tuple[Row, float]) -> bool:
    return bool(one[0]["seconds"] <= other[0]["seconds"] and one[1] <= other[1])


def _as_good(one: tuple[Row, float], other: tuple[Row, float]) -> bool:
    """Whether the first is as good as the second within what is called a tie."""
    return bool(one[0]["seconds"] <= _TIE * other[0]["seconds"] and _SAME * one[1] <= other[1])


def choice(rows: Sequence[Row], quantity: str, target: float) -> Row | None:
    """The cheapest run that meets a target; among ties the first of the list.  None: no run does."""
    errors = lasting_errors(rows, quantity)
    enough = [row for row, e in zip(rows, errors, strict=True) if e is not None and e <= target and row["seconds"]]
    least = min((row["seconds"] for row in enough), default=0.0)
    return next((row for row in enough if row["seconds"] <= _TIE * least), None)


def advice(study: Study) -> str:
    """One paragraph: which method for which accuracy, from the data alone."""
    rows = study.rows
    parts = [f"{study.scene.title or 'The scene'}: errors relative to {study.reference}, times of whole solves."]
    for quantity in _shown(study):
        best: list[tuple[str, float, Row]] = []
        for target in TARGETS:
            row = choice(rows, quantity, target) if target > 2 * (study.floor[quantity] or 0.0) else None
            if row is not None and best and best[-1][2]["method"] == row["method"]:
                best[-1] = (best[-1][0], target, row)
            elif row is not None:
                best.append((_percent(target), target, row))
        said = [
            f"{row['method']} ({first}{'' if _percent(last) == first else ' down to ' + _percent(last)}, "
            f"there {row['seconds']:.2g} s and {row['dofs']} unknowns)"
            for first, last, row in best
        ]
        label = _LABELS[quantity]
        parts.append(f"For the {label} take " + ", then ".join(said) + "." if said else _none(study, quantity))
    parts += [text for text in (_on_gamma(rows), _on_time(rows), _on_failures(rows)) if text]
    return " ".join(parts)


_LABELS = {
    "energy": "displacement in the energy norm",
    "pressure": "contact pressure",
    "peak": "largest pressure",
    "zone": "ends of the contact zone",
    "force": "contact force",
}


def _none(study: Study, quantity: str) -> str:
    """What to say of a quantity that no run has."""
    best = min((e for e in lasting_errors(study.rows, quantity) if e is not None), default=None)
    floor = study.floor[quantity]
    text = f"No run has the {_LABELS[quantity]} within {_percent(TARGETS[0])} beyond doubt"
    text += f": the best is wrong by {100 * best:.2g} %" if best is not None else ""
    return text + (f", the reference itself perhaps by {100 * floor:.2g} %." if floor else ".")


def _percent(target: float) -> str:
    return f"{100 * target:g} %"


def _shown(study: Study) -> list[str]:
    """Quantities that have errors."""
    return [name for name in QUANTITIES if any((row[name] or 0.0) > _NOTHING for row in study.rows)]


def _finest(rows: Sequence[Row], name: str) -> Row | None:
    """The run of a method on its finest mesh, if it is solved there."""
    own = [row for row in rows if row["method"] == name]
    last = min(own, key=_coarseness, default=None)
    return last if last is not None and last["seconds"] and last["pressure"] is not None else None


def _on_gamma(rows: Sequence[Row]) -> str:
    """What gamma leaves on the finest mesh."""
    base = _finest(rows, rows[0]["method"])
    fixed = [row for name in dict.fromkeys(r["method"] for r in rows) if (row := _finest(rows, name)) is not None]
    fixed = [row for row in fixed if row["gamma"] != "auto" and row["algorithm"] == "auto"]
    if base is None or not base["pressure"] or not fixed:
        return ""
    ratios = {row["gamma"]: row["pressure"] / base["pressure"] for row in fixed}
    enough = [gamma for gamma, ratio in ratios.items() if 0.9 <= ratio <= 1.1]
    low = {gamma: ratio for gamma, ratio in ratios.items() if ratio > 1.1}
    said = ", ".join(f"{gamma:.0e} leaves {ratio:.2g} times that" for gamma, ratio in low.items())
    text = f"On the finest Q1 mesh the pressure is wrong by {base['pressure']:.1e} without regularisation"
    if enough:
        spread = f"{min(enough):.0e}" + (f" to {max(enough):.0e}" if len(enough) > 1 else "")
        text += f", and by as much with a fixed gamma of {spread} E/size"
    return text + (f"; {said}." if said else ".")


def _on_time(rows: Sequence[Row]) -> str:
    """Times on the finest mesh relative to the base."""
    base = _finest(rows, rows[0]["method"])
    if base is None:
        return ""
    said = []
    for name in dict.fromkeys(row["method"] for row in rows):
        row = _finest(rows, name)
        alike = row is not None and row["gamma"] == "auto" and row["element"] == base["element"]
        if row is not None and alike and name != base["method"]:
            said.append(f"{name} {row['seconds'] / base['seconds']:.2g} ({row['linear_solves']} solves)")
    own = f"{base['seconds']:.2g} s, {base['linear_solves']} solves"
    return f"There, in multiples of the time of {base['method']} ({own}): {', '.join(said)}." if said else ""


def _on_failures(rows: Sequence[Row]) -> str:
    """Which runs have no solution."""
    failed = [row for row in rows if row["status"] != "converged"]
    if not failed:
        return f"All {len(rows)} runs have a solution."
    said: dict[str, list[str]] = {}
    for row in failed:
        mesh = f"cells x {row['size_of_cells']:g}" if row["size_of_cells"] else f"asked for {row['asked']:g}"
        said.setdefault(row["status"], []).append(f"{row['method']} ({mesh})")
    return (
        f"{len(failed)} of {len(rows)} runs have no solution: "
        + "; ".join(f"{', '.join(names)}: {status}" for status, names in said.items())
        + "."
    )


# --- files -----------------------------------------------------------------------------------------------------------


def write_study(study: Study, folder: Path) -> None:
    """Write work_precision.csv, reference.csv, advice.txt and one picture a quantity."""
    folder.mkdir(parents=True, exist_ok=True)
    write_csv(folder / "work_precision.csv", study.rows)
    rows = [{"quantity": name, "may_be_wrong_by": error, "is": study.reference} for name, error in study.floor.items()]
    write_csv(folder / "reference.csv", rows)
    (folder / "advice.txt").write_text(advice(study) + "\n", encoding="utf-8")
    for quantity in _shown(study):
        draw(folder / f"work_precision_{quantity}", study, quantity)


_COLOURS = ("#1a1a1a", "#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#6b6b6b", "#8c6d1f")
_MARKERS = "os^Dv<>PX"


def draw(stem: Path, study: Study, quantity: str) -> None:
    """Error against time: the cheapest front of all methods on the left, the families beside it."""
    errors = lasting_errors(study.rows, quantity)
    points = [(row, e) for row, e in zip(study.rows, errors, strict=True) if e and row["seconds"]]
    if not points:
        return
    with mpl.rc_context(plots._STYLE):
        figure = Figure(figsize=(11.0, 5.6), layout="constrained")
        grid = figure.add_gridspec(2, 4, width_ratios=(1.75, 1, 1, 1))
        large = figure.add_subplot(grid[:, 0])
        small: list[Axes] = []
        for k in range(6):
            shared = small[0] if small else None
            small.append(figure.add_subplot(grid[k // 3, 1 + k % 3], sharex=large, sharey=shared))
        times, values = [row["seconds"] for row, _ in points], [error for _, error in points]
        large.set(xscale="log", yscale="log", xlim=(min(times) / 6, 1.6 * max(times)))
        floor = study.floor[quantity]
        low = min(values) / 2
        large.set_ylim(low, 2 * max(values))
        small[0].set(yscale="log", ylim=(low, 15 * max(values)))  # room for the names
        for axes in (large, *small[:5]):
            axes.plot(times, values, "o", color=plots._RULE, markersize=2.5, zorder=1)
            axes.grid(visible=True, which="major", color=plots._RULE, linewidth=0.35, zorder=0)
            if floor and floor > low:
                axes.axhspan(low, floor, facecolor="#f3e9e9", zorder=0)
        _front(large, study, quantity)
        for axes, (family, title) in zip(small, FAMILIES.items(), strict=False):
            _family(axes, points, family)
            axes.set_title(title, loc="left", fontsize=8)
            axes.tick_params(labelleft=family in ("element", "linear algebra"))
        large.set_title("The cheapest method for each accuracy", loc="left", fontweight="bold")
        large.set_ylabel(f"relative error: {QUANTITIES[quantity]}")
        for axes in (large, small[3], small[4]):
            axes.set_xlabel("seconds for the whole solve")
        small[2].set_xlabel("seconds for the whole solve")
        small[5].set_axis_off()
        small[5].text(0.0, 0.98, _how_to_read(study, floor, low), va="top", fontsize=7.5, transform=small[5].transAxes)
        plots._finish(figure, stem, f"What accuracy costs: {study.scene.title}")


def _front(axes: Axes, study: Study, quantity: str) -> None:
    """The front as a staircase; a name where the method changes, in the empty corner below it."""
    front = cheapest_front(study.rows, quantity, study.floor[quantity])
    seconds, errors = [row["seconds"] for row, _ in front], [error for _, error in front]
    axes.step(seconds, errors, where="post", color=plots._INK, linewidth=1.2, zorder=3)
    axes.plot(seconds, errors, "o", color=plots._INK, markersize=4, zorder=4)
    for k, (row, error) in enumerate(front):
        if k + 1 < len(front) and front[k + 1][0]["method"] == row["method"]:
            continue
        place: dict[str, Any] = {
            "xytext": (-5, -3),
            "textcoords": "offset points",
            "ha": "right",
            "va": "top",
            "fontsize": 7,
        }
        axes.annotate(f"{row['method']}\n{row['dofs']} unknowns", (row["seconds"], error), **place, zorder=5)


def _family(axes: Axes, points: Sequence[tuple[Row, float]], family: str) -> None:
    """One line a method of the family."""
    names = dict.fromkeys(row["method"] for row, _ in points if family in row["families"].split("; "))
    for name, colour, marker in zip(names, _COLOURS, _MARKERS, strict=False):
        own = sorted(((r["seconds"], e, _coarseness(r)) for r, e in points if r["method"] == name), key=_coarsest)
        axes.plot(*zip(*((s, e) for s, e, _ in own), strict=True), f"-{marker}", color=colour, lw=1, ms=3, label=name)
    style = {"facecolor": "white", "framealpha": 0.85, "edgecolor": "none", "frameon": True}
    long = len(names) > 6 and max(map(len, names)) > 15
    small = {"fontsize": 5.2 if long else 6.2, "ncols": 2 if len(names) > 6 else 1, "columnspacing": 0.8}
    axes.legend(loc="upper right", handlelength=1.3, labelspacing=0.2, handletextpad=0.5, **small, **style)


def _coarsest(point: tuple[float, float, float]) -> float:
    return -point[2]


def _how_to_read(study: Study, floor: float | None, low: float) -> str:
    """The words beside the pictures."""
    lines = [
        "How to read this",
        "Each point is one method on one mesh; a line joins",
        "the meshes of a method, coarse to fine. Lower is more",
        "accurate, further left is cheaper. Gray: all methods.",
        "The error shown is the largest on this and finer",
        "meshes: luck on one mesh does not count.",
        "Exact: without regularisation. Not said otherwise:",
        "Q1, cold start, the program's own gamma and linear",
        "algebra; Coulomb friction by a fixed point (FP).",
        "Times are medians, machine code of forms excluded.",
    ]
    if floor and floor > low:
        lines += ["Shaded: the reference itself may be wrong by so much."]
    failed = [row["method"] for row in study.rows if row["status"] != "converged"]
    counts = [f"{name} ({failed.count(name)})" for name in dict.fromkeys(failed)]
    lines += [f"{len(failed)} of {len(study.rows)} runs failed:" if failed else "No run failed."]
    lines += [f"   {text}" for text in counts[:3]] + (["   and others: see the table"] if len(counts) > 3 else [])
    return "\n".join(lines)
