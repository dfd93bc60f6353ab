"""Derivatives of results of a scene by its numbers."""

from __future__ import annotations

import math
import shlex
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from mpi4py import MPI

from signorini_fx import parallel
from signorini_fx.algorithms.task import Outcome
from signorini_fx.body.assembly import assemble, measure
from signorini_fx.body.discretisation import Discretisation, prepare
from signorini_fx.body.moduli import lame_coefficients
from signorini_fx.body.rigid_tools import Driven
from signorini_fx.derivatives.entries import default_entries, entry_of, varied
from signorini_fx.derivatives.gradient import Data, Explicit, Solved, derivatives, explicit
from signorini_fx.derivatives.quantities import ContactForce, LargestPressure, OfDisplacement, Quantity
from signorini_fx.errors import MeshError, SceneError
from signorini_fx.records import History, Timings
from signorini_fx.results.solution import ConvergenceError, Solution, StepResult
from signorini_fx.scene.effect import InitialStrain, Resistance, SectionJump
from signorini_fx.scene.model import Scene
from signorini_fx.solving.one_mesh import solve_mesh

Array = npt.NDArray[np.float64]
_POWER = 8.0
_KINDS = (
    "'force BOUNDARY AXIS' or 'moment BOUNDARY [AXIS]' of a contact, 'pressure BOUNDARY [POWER]', the largest one, "
    "'mean BOUNDARY AXIS', of the displacement, and 'displacement X,Y[,Z] AXIS', at a point"
)


@dataclass(frozen=True)
class Sensitivity:
    """The derivatives of one result by data of a scene.

    Attributes:
        of: the result, such as ``force bottom y``.
        value: of it.
        by: the paths of the data.
        data: their values; 1 for a load as a whole, nan for an expression, which gets another term.
        derivatives: of the result by each of them.
        between: contact points that stand between two sets: there the derivatives are those of one side.
        solves: linear solves that the adjoint problem took.
        seconds: wall seconds of the adjoint problem, and of the derivatives from it.
        solution: whose derivatives they are.
        solution_seconds: wall seconds of its solve.
    """

    of: str
    value: float
    by: tuple[str, ...]
    data: tuple[float, ...]
    derivatives: tuple[float, ...]
    between: int
    solves: int
    seconds: float
    solution: Solution
    solution_seconds: float

    def __repr__(self) -> str:
        return f"<Sensitivity of {self.of}: {dict(zip(self.by, self.derivatives, strict=True))}>"

    def __getitem__(self, path: str) -> float:
        """The derivative by the entry at a path."""
        return self.derivatives[self.by.index(path)]

    def __str__(self) -> str:
        """A table: value of each datum, derivative, and by how many per cent 1 % of the datum changes the result."""
        wide = max(len(path) for path in self.by)
        lines = [
            f"{self.of} = {self.value:.8g}",
            f"{'by':{wide}s}  {'value':>12s}  {'derivative':>14s}  {'relative':>10s}",
        ]
        for path, datum, slope in zip(self.by, self.data, self.derivatives, strict=True):
            share = f"{slope * datum / self.value:10.4g}" if self.value != 0 and math.isfinite(datum) else f"{'-':>10s}"
            told = f"{datum:12.6g}" if math.isfinite(datum) else f"{'expression':>12s}"
            lines.append(f"{path:{wide}s}  {told}  {slope:14.7g}  {share}")
        if self.between:
            lines.append(f"{self.between} contact points stand between two sets: there the derivatives are one-sided")
        return "\n".join(lines)


def sensitivity(
    scene: Scene, of: str | Sequence[str], by: Sequence[str] | None = None, comm: MPI.Comm = MPI.COMM_WORLD
) -> Sensitivity | list[Sensitivity]:
    """Solve a scene, and differentiate results of it by its data; collective.

    gamma and the choice of the contact sets do not change: derivatives are those of the discrete solution.

    Args:
        scene: of one load step, on one mesh.
        of: the result or several: see ``quantity_of``.
        by: paths of numbers of the scene, such as ``contact[0].friction.coefficient``; of an expression a term that is
            added to it; the path of a load itself, such as ``traction[0]``: a factor of all of it.  None: friction and
            gap of each contact, the materials, and each load as a whole.
        comm: the ranks that share the work.

    Raises:
        SceneError: a result or a datum is not known, or has no derivative.
        ConvergenceError: the scene has no solution.
    """
    _check(scene)
    solved: list[tuple[Discretisation, Outcome]] = []

    def keep(d: Discretisation, outcome: Outcome, step: StepResult) -> None:
        solved.append((d, outcome))

    begin = time.perf_counter()
    solution, task, _ = solve_mesh(scene, comm, History(), None, keep)
    seconds = parallel.global_max(comm, time.perf_counter() - begin)
    if not solution.converged:
        raise ConvergenceError(solution)
    assert task is not None
    ((d, outcome),) = solved
    assert solution.contact is not None
    state = solution.contact
    ready = Solved(d, task, outcome, task.start, state, solution.displacement, d.law)
    found = _sensitivities(ready, d, [of] if isinstance(of, str) else list(of), by, solution, seconds)
    return found[0] if isinstance(of, str) else found


def _check(scene: Scene) -> None:
    """Whether derivatives of the scene are known."""
    for wrong, path, reason in (
        (not scene.contact, "contact", "there is none: a problem without contact is linear"),
        (scene.several_steps, "load_steps", "derivatives are those of one load step: give one"),
        (
            scene.element.volumetric == "mixed",
            "element.volumetric",
            "derivatives are not possible yet with a pressure of its own: leave 'mixed' out",
        ),
        (scene.fluids_enter, "fluid", "derivatives are not possible yet where a fluid enters contact"),
        (scene.tightens_at(0), "preload", "derivatives are not possible yet with a preload by force"),
        (scene.solver.levels > 1, "solver.levels", "derivatives are those of one mesh: leave it out"),
        (scene.accuracy is not None, "accuracy", "derivatives are those of one mesh: leave it out"),
    ):
        if wrong:
            raise SceneError([(path, reason)])


def _sensitivities(
    ready: Solved, d: Discretisation, of: list[str], by: Sequence[str] | None, solution: Solution, seconds: float
) -> list[Sensitivity]:
    scene, comm = d.scene, d.comm
    paths = tuple(default_entries(scene) if by is None else by)
    entries = [entry_of(scene, path, d.tagged.size, d.dimension) for path in paths]
    begin = time.perf_counter()
    quantities = [quantity_of(d, text) for text in of]
    law = ready.linearised
    adjoints = ready.adjoints_of(quantities, law)
    columns = [
        derivatives(adjoints, quantities, _evaluated(ready, d, path, quantities), step)
        for path, (_, step) in zip(paths, entries, strict=True)
    ]
    end = time.perf_counter()
    state, y = ready.state, ready.displacement
    return [
        Sensitivity(
            text,
            quantity.value(y, state.boundary, state.pressure, state.shear),
            paths,
            tuple(value for value, _ in entries),
            tuple(column[k] for column in columns),
            law.between,
            adjoints[k].solves,
            parallel.global_max(comm, (end - begin)),
            solution,
            seconds,
        )
        for k, (text, quantity) in enumerate(zip(of, quantities, strict=True))
    ]


def _evaluated(
    ready: Solved, d: Discretisation, path: str, quantities: Sequence[Quantity]
) -> Callable[[float], Explicit]:
    """``explicit`` with a number of the scene that is larger by some change."""
    key = path.rpartition(".")[2]

    def at(change: float) -> Explicit:
        scene = varied(d.scene, path, change, d.dimension)
        if path.startswith("contact") and scene.tools:
            other = prepare(scene, d.tagged, Timings())
            assert other.data is not None
            assert other.boundary is not None
            loads = _loads(other)
            data = replace(_unchanged(d), boundary=other.boundary, gap=other.data.gap, law=other.law, **loads)
            return explicit(ready, data, quantities)
        if path.startswith("contact"):
            now = d.contact_of(scene)
            data = replace(_unchanged(d), boundary=now["boundary"], gap=now["data"].gap, law=now["law"])
            return explicit(ready, data, quantities)
        if path.startswith("material") and key in ("young", "poisson"):
            strained = any(isinstance(one, InitialStrain | SectionJump) for _, one in scene.listed())
            loads = _loads(prepare(scene, d.tagged, Timings())) if strained else {}
            with _lame(d, scene):
                return explicit(ready, replace(_unchanged(d), **loads), quantities)
        other = prepare(scene, d.tagged, Timings())
        forms = other.forms if scene.of(Resistance) else d.forms
        return explicit(ready, replace(_unchanged(d), forms=forms, **_loads(other)), quantities)

    return at


def _loads(d: Discretisation) -> dict[str, Any]:
    applied = d.applied_at(0.0)
    none = np.zeros(d.fixed.size)
    return {
        "driven": Driven.together([(factor, load.driven) for factor, load in applied if load.driven is not None]),
        "forces": sum((factor * load.forces for factor, load in applied), none),
        "prescribed": sum((factor * load.start for factor, load in applied), none),
    }


def _unchanged(d: Discretisation) -> Data:
    assert d.boundary is not None
    assert d.data is not None
    return Data(forms=d.forms, boundary=d.boundary, gap=d.data.gap, law=d.law, **_loads(d))


@contextmanager
def _lame(d: Discretisation, scene: Scene) -> Iterator[None]:
    """The forms of the body have the Lame parameters of another scene."""
    kept = [_values(one).copy() for one in d.lame]
    try:
        for mine, other in zip(d.lame, lame_coefficients(scene, d.tagged), strict=True):
            _values(mine)[...] = _values(other)
        yield
    finally:
        for mine, values in zip(d.lame, kept, strict=True):
            _values(mine)[...] = values


def _values(coefficient: Any) -> Array:
    return coefficient.x.array if isinstance(coefficient, fem.Function) else coefficient.value


# --- results by their names ------------------------------------------------------------------------------------------


def quantity_of(d: Discretisation, text: str) -> Quantity:
    """A result by its name; collective.

    Args:
        d: the scene on its mesh.
        text: ``force BOUNDARY AXIS`` and ``moment BOUNDARY [AXIS]`` on the body at a contact boundary, a moment about
            the origin, in space about an axis; ``pressure BOUNDARY [POWER]``, see ``LargestPressure``;
            ``mean BOUNDARY AXIS``, the mean displacement; ``displacement X,Y[,Z] AXIS`` at a point.

    Raises:
        SceneError: it is not known, or has no derivative.
    """
    try:
        kind, *words = shlex.split(text)
    except ValueError:
        kind, words = text, []
    if kind == "area":
        reason = "a mesh knows it in steps of whole nodes: its derivative is zero or infinite; take pressure or force"
        raise SceneError([(f"of {text!r}", reason)])
    try:
        return _NAMED[kind](d, *words)
    except (KeyError, TypeError, ValueError):
        raise SceneError([(f"of {text!r}", f"is no result; there are {_KINDS}")]) from None


def _axis(d: Discretisation, name: str) -> int:
    found = "xyz"[: d.dimension].index(name)
    if len(name) != 1:
        raise ValueError(name)
    return found


def _part(d: Discretisation, boundary: str) -> int:
    names = [effect.boundary for effect in d.scene.contact]
    if boundary not in names:
        raise SceneError([(f"of {boundary!r}", f"is no contact boundary; there are: {', '.join(names)}")])
    return names.index(boundary)


def _force(d: Discretisation, boundary: str, axis: str) -> Quantity:
    return ContactForce(_part(d, boundary), _axis(d, axis))


def _moment(d: Discretisation, boundary: str, axis: str = "z") -> Quantity:
    if d.dimension == 2 and axis != "z":
        raise ValueError(axis)
    if d.scene.axisymmetric:
        raise SceneError([(f"of moment {boundary}", "there is none on a body of revolution")])
    return ContactForce(_part(d, boundary), 0 if d.dimension == 2 else _axis(d, axis), moment=True)


def _pressure(d: Discretisation, boundary: str, power: str = str(_POWER)) -> Quantity:
    number = float(power)
    if not 1 < number <= 1000:
        raise SceneError([(f"of pressure {boundary} {power}", "the power must be above 1, and 1000 at most")])
    return LargestPressure(_part(d, boundary), number)


def _mean(d: Discretisation, boundary: str, axis: str) -> Quantity:
    z, component = ufl.TestFunction(d.space), _axis(d, axis)
    try:
        facets = d.tagged.facets(boundary)
    except MeshError as error:
        raise SceneError([(f"of mean {boundary}", str(error))]) from None
    ds = measure(d.space.mesh, [facets], {})(1)
    form = d.inventory.compile(f"mean of {boundary}", lambda: fem.form(z[component] * d.coefficients.around * ds))
    row = assemble(form)
    area = float(parallel.global_sum(d.comm, row.sum()))
    if area == 0:
        raise SceneError([(f"of mean {boundary}", "this boundary has no area")])
    return OfDisplacement(np.asarray(row / area, dtype=np.float64))


def _displacement(d: Discretisation, point: str, axis: str) -> Quantity:
    x = np.array([float(one) for one in point.split(",")])
    if x.size != d.dimension:
        raise ValueError(point)
    found = OfDisplacement.at_point(d.space, x, _axis(d, axis))
    if found is None:
        raise SceneError([(f"of displacement {point}", "this point is outside of the body")])
    return found


_NAMED: dict[str, Callable[..., Quantity]] = {
    "force": _force,
    "moment": _moment,
    "pressure": _pressure,
    "mean": _mean,
    "displacement": _displacement,
}
