"""Derivatives of results of a scene by its numbers."""

from __future__ import annotations

import math
import shlex
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from mpi4py import MPI

from signorini_fx import parallel
from signorini_fx.body.assembly import assemble, measure
from signorini_fx.body.discretisation import Discretisation, prepare
from signorini_fx.body.elastic import sum_of
from signorini_fx.body.moduli import lame_coefficients
from signorini_fx.body.rigid_tools import Driven
from signorini_fx.derivatives.entries import default_entries, entry_of, varied
from signorini_fx.derivatives.gradient import At, Data, Explicit, Solved, adjoints_of, derivatives, explicit
from signorini_fx.derivatives.quantities import ContactArea, ContactForce, LargestPressure, OfDisplacement, Quantity
from signorini_fx.errors import MeshError, SceneError
from signorini_fx.records import History, Timings
from signorini_fx.results.solution import ConvergenceError, Solution
from signorini_fx.scene.effect import InitialStrain, Resistance, SectionJump
from signorini_fx.scene.model import Scene
from signorini_fx.solving.load_steps import LoadStep
from signorini_fx.solving.one_mesh import solve_mesh

Array = npt.NDArray[np.float64]
_POWER = 8.0
# Assembling a matrix takes as long as applying its form to the displacements of so many load steps.
_FEW = 2
_KINDS = (
    "'force BOUNDARY AXIS' or 'moment BOUNDARY [AXIS]' of a contact, 'pressure BOUNDARY [POWER]', the largest one, "
    "'area BOUNDARY [POWER]', that presses, "
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
        scene: on one mesh.
        of: the result or several: see ``quantity_of``; of the last load step, or of another one with its number behind
            it, as in ``force bottom x step 2``.
        by: paths of numbers of the scene, such as ``contact[0].friction.coefficient``; of an expression a term that is
            added to it; the path of a load itself, such as ``traction[0]``: a factor of all of it.  None: friction and
            gap of each contact, the materials, and each load as a whole.
        comm: the ranks that share the work.

    Raises:
        SceneError: a result or a datum is not known, or has no derivative.
        ConvergenceError: the scene has no solution.
    """
    _check(scene)
    solved: list[_Step] = []

    def keep(step: LoadStep) -> None:
        if step.result.step == 1:  # a ramp may begin again
            solved.clear()
        solved.append(_Step.of(step))

    begin = time.perf_counter()
    solution, *_ = solve_mesh(scene, comm, History(), None, keep)
    seconds = parallel.global_max(comm, time.perf_counter() - begin)
    if not solution.converged:
        raise ConvergenceError(solution)
    found = _sensitivities(solved, [of] if isinstance(of, str) else list(of), by, solution, seconds)
    return found[0] if isinstance(of, str) else found


@dataclass(frozen=True)
class _Step:
    """A load step of a scene.

    Attributes:
        d: the scene with its foundations where they are in this step.
        place: in the lists of factors.
        solved: its solution.
    """

    d: Discretisation
    place: float
    solved: Solved

    @classmethod
    def of(cls, step: LoadStep) -> _Step:
        """One that has just been solved; collective."""
        d, state = step.discretisation, step.result.contact
        assert state is not None
        of = d, step.task, step.outcome, step.start, state, step.result.displacement, step.start.law
        return cls(d, step.result.place, Solved.of(*of))


def _check(scene: Scene) -> None:
    """Whether derivatives of the scene are known."""
    for wrong, path, reason in (
        (not scene.contact, "contact", "there is none: a problem without contact is linear"),
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
    steps: list[_Step], of: list[str], by: Sequence[str] | None, solution: Solution, seconds: float
) -> list[Sensitivity]:
    scene, d = solution.scene, steps[-1].d
    paths = tuple(default_entries(scene) if by is None else by)
    entries = [entry_of(scene, path, d.tagged.size, d.dimension) for path in paths]
    begin = time.perf_counter()
    quantities = [_at_step(steps, text) for text in of]
    adjoints = adjoints_of([step.solved for step in steps], quantities if paths else [])
    columns = [
        derivatives(adjoints, quantities, _evaluated(scene, steps, path, quantities), step)
        for path, (_, step) in zip(paths, entries, strict=True)
    ]
    end = time.perf_counter()
    return [
        Sensitivity(
            text,
            _value(steps[at].solved, quantity),
            paths,
            tuple(value for value, _ in entries),
            tuple(column[k] for column in columns),
            sum(step.solved.law.between for step in steps[: at + 1]),
            sum(one.solves for known in adjoints for one in known[k : k + 1] if one is not None),
            parallel.global_max(d.comm, (end - begin)),
            solution,
            seconds,
        )
        for k, (text, (at, quantity)) in enumerate(zip(of, quantities, strict=True))
    ]


def _value(solved: Solved, quantity: Quantity) -> float:
    state = solved.state
    return quantity.value(solved.displacement, state.boundary, state.pressure, state.shear)


def _at_step(steps: list[_Step], text: str) -> tuple[int, Quantity]:
    """The number of the load step of a result, and the result."""
    words = text.rpartition(" step ")
    if not words[1]:
        return len(steps) - 1, quantity_of(steps[-1].d, text)
    number = int(words[2]) if words[2].strip().isdecimal() else 0
    if not 1 <= number <= len(steps):
        raise SceneError([(f"of {text!r}", f"there are load steps 1 to {len(steps)}")])
    return number - 1, quantity_of(steps[number - 1].d, words[0])


def _evaluated(scene: Scene, steps: list[_Step], path: str, quantities: Sequence[tuple[int, Quantity]]) -> At:
    """``explicit`` with a number of the scene that is larger by some change."""
    of_material = path.startswith("material") and path.rpartition(".")[2] in ("young", "poisson")

    def at(change: float) -> Callable[[int], Explicit]:
        other = varied(scene, path, change, steps[0].d.dimension)
        data = cache(_material(other, steps) if of_material else _data(other, steps, path))

        def evaluated(k: int) -> Explicit:
            own = [quantity for number, quantity in quantities if number == k]
            before = (steps[k - 1].solved, data(k - 1)) if k else None
            with _lame(steps[k].d, other) if of_material else nullcontext():
                return explicit(steps[k].solved, data(k), own, before)

        return evaluated

    return at


def _material(scene: Scene, steps: list[_Step]) -> Callable[[int], Data]:
    """The data of each load step with other moduli."""
    strained = any(isinstance(one, InitialStrain | SectionJump) for _, one in scene.listed())
    with _lame(steps[0].d, scene):
        forms = steps[0].d.forms if len(steps) <= _FEW else sum_of(steps[0].d.forms, [])
    other = prepare(scene, steps[0].d.tagged, Timings()) if strained else None

    def data(k: int) -> Data:
        d, place = steps[k].d, steps[k].place
        return replace(_unchanged(d, place), forms=forms, **_loads(other or d, place))

    return data


def _data(scene: Scene, steps: list[_Step], path: str) -> Callable[[int], Data]:
    """The data of each load step of a scene that differs in contact, loads, or supports."""
    of_contact, of_friction = path.startswith("contact"), path.startswith("contact") and ".friction." in path
    other = None if of_contact and not scene.tools else prepare(scene, steps[0].d.tagged, Timings())
    placed = [scene.placed(step.place) for step in steps]

    @cache
    def contact(k: int) -> dict[str, Any]:
        d, now = steps[k].d, placed[k]
        if k and now is placed[k - 1]:
            return contact(k - 1)
        if of_friction:
            return {"law": d.law_of(now)}
        if other is not None:
            there = other.placed(steps[k].place)
            assert there.data is not None
            return {"boundary": there.boundary, "gap": there.data.gap, "law": there.law}
        found = d.contact_of(now)
        moving = {"gap": found["data"].gap, "boundary": found["boundary"], "law": found["law"]}
        if any(effect.moves for effect in now.contact):
            there = replace(d, scene=now, boundary=found["boundary"])
            moving["drift"] = there.moved_since(placed[k - 1] if k else now.placed(-1))
        return moving

    def data(k: int) -> Data:
        d, place = steps[k].d, steps[k].place
        found = replace(_unchanged(d, place), forms=())
        if of_contact:
            found = replace(found, **contact(k))
        if other is None:
            return found
        loads = _loads(other, place)
        same = not scene.of(Resistance) and np.array_equal(loads["prescribed"], found.prescribed)
        if parallel.any_rank(d.comm, not same) or found.driven is not None:
            found = replace(found, forms=other.forms if scene.of(Resistance) else d.forms)
        return replace(found, **loads)

    return data


def _loads(d: Discretisation, place: float) -> dict[str, Any]:
    applied = d.applied_at(place)
    none = np.zeros(d.fixed.size)
    return {
        "driven": Driven.together([(factor, load.driven) for factor, load in applied if load.driven is not None]),
        "forces": sum((factor * load.forces for factor, load in applied), none),
        "prescribed": sum((factor * load.start for factor, load in applied), none),
    }


def _unchanged(d: Discretisation, place: float) -> Data:
    assert d.boundary is not None
    assert d.data is not None
    return Data(forms=d.forms, boundary=d.boundary, gap=d.data.gap, law=d.law, **_loads(d, place))


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
            the origin, in space about an axis; ``pressure BOUNDARY [POWER]``, see ``LargestPressure``; ``area BOUNDARY
            [POWER]``, see ``ContactArea``;
            ``mean BOUNDARY AXIS``, the mean displacement; ``displacement X,Y[,Z] AXIS`` at a point.

    Raises:
        SceneError: it is not known, or has no derivative.
    """
    try:
        kind, *words = shlex.split(text)
    except ValueError:
        kind, words = text, []
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


def _area(d: Discretisation, boundary: str, power: str = "2") -> Quantity:
    number = float(power)
    if not 1 < number <= 1000:
        raise SceneError([(f"of area {boundary} {power}", "the power must be above 1, and 1000 at most")])
    return ContactArea(_part(d, boundary), number)


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
    "area": _area,
    "mean": _mean,
    "displacement": _displacement,
}
