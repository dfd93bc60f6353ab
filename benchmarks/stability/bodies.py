"""Bodies: how they are held, and the outcomes of those that are not."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from benchmarks.stability.case import Case, Finding
from benchmarks.stability.measure import REGULARISED, difference, found, solved, worst
from benchmarks.stability.scenes import LAWS, example1
from benchmarks.stability.shapes import grid, turned
from signorini_fx.records import Status
from signorini_fx.results.solution import Solution

BALANCE = "forces in balance"
_LINEAR = "the same body without contact"


def cases(*, short: bool) -> Iterator[Case]:
    """How bodies are held; grazing contact; bodies without load."""
    laws = ("Coulomb",) if short else tuple(LAWS)
    friction = tuple(law for law in laws if law != "frictionless")
    for law in laws:
        yield Case(
            f"floating vertically, {law}", partial(_balanced, example1(law), 20.0), target=1e-9, reference=BALANCE
        )
        yield Case(f"pressed into a corner, {law}", partial(_corner, law), target=1e-9, reference=BALANCE)
        yield Case(f"in a groove, {law}", partial(_groove, law), target=1e-9, reference=BALANCE)
        yield Case(
            f"contact meets support, {law}",
            partial(_touching, law),
            target=REGULARISED,
            reference="unregularised limit",
        )
        yield Case(f"lifted off, {law}", partial(_lifted, law), wanted=(Status.OPEN.value,))
        # Given friction acts whether there is contact or not (section 2), so that it needs another reference.
        open_reference = "unregularised limit" if law == "Tresca" else _LINEAR
        target = REGULARISED if law == "Tresca" else 1e-10
        yield Case(f"lifted off, but held, {law}", partial(_never, law, 20.0), target=target, reference=open_reference)
        yield Case(f"gap never closed, {law}", partial(_never, law, -20.0), target=target, reference=open_reference)
        yield Case(
            f"penetration at the start, {law}",
            partial(_penetrating, law),
            target=REGULARISED,
            reference="unregularised limit" if law != "frictionless" else "prescribed displacement",
        )
        for load in (1e-14,) if short else (1e-2, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14):
            # The gap is known to round-off only, relative to which the displacements by the load are small.
            target = max(1e-8, 1e-15 / load)
            yield Case(f"grazing, load {load:g}, {law}", partial(_grazing, law, load), target=target, reference=BALANCE)
        for share in (1e-8,) if short else (1e-2, 1e-5, 1e-8, 1e-11, 1e-14):
            yield Case(
                f"sags onto the foundation, {share:g} too far, {law}",
                partial(_sagging, law, share),
                target=3.0 * share + (REGULARISED if law == "Tresca" else 1e-10),
                reference=open_reference,
            )
        yield Case(f"no load, supported, {law}", partial(_nothing, law, held=True), target=0.0, reference="zero")
        # All positions are equivalent: an outcome with a name is expected.
        yield Case(f"no load, floating, {law}", partial(_nothing, law, held=False), wanted=(Status.OPEN.value,))
    for law in friction:
        for nx, ny in ((13, 4),) if short else ((12, 4), (13, 4), (15, 5), (33, 11), (61, 20)):
            for gap in ("curved", "flat"):
                for gamma in ("auto", 1e8):
                    yield Case(
                        f"held by friction alone, {nx}x{ny}, {gap}, gamma {gamma}, {law}",
                        partial(_friction_only, law, nx, ny, gap, gamma),
                        target=1e-9,
                        reference=BALANCE,
                    )
    yield Case("slides away", _sliding, wanted=(Status.SLIDES.value,))
    yield Case("held by nothing sideways", _free, wanted=(Status.NOT_HELD.value,))


def _resultant(solution: Solution) -> np.ndarray:
    """The contact force plus the friction force."""
    assert solution.contact is not None
    contact, friction = solution.contact.forces
    return contact + friction


def _balanced(scene: dict[str, Any], load: float) -> Finding:
    solution = solved(scene)
    return found(solution, abs(_resultant(solution)[1] / load - 1))


def _corner(law: str) -> Finding:
    friction = LAWS[law]
    scene = {
        "mesh": {"generator": "rectangle", "parameters": {"nx": 30, "ny": 10}},
        "material": {"young": 5000.0, "poisson": 0.3},
        "traction": [{"boundary": "top", "y": -20.0}, {"boundary": "right", "x": -10.0}],
        "contact": [
            {"boundary": "bottom", "gap": "0.001*(x[0] - 1)**2", "friction": friction},
            {"boundary": "left", "gap": "0.001 * x[1]", "friction": friction},
        ],
    }
    solution = solved(scene)
    return found(solution, difference(_resultant(solution), [10.0, 60.0]))


def _groove(law: str) -> Finding:
    """A square on its corner in a groove of 90 degrees, under its weight."""
    friction = LAWS[law]
    scene = {
        "mesh": grid(12, 12, turned(np.pi / 4, 1.0, 1.0)),
        "material": {"young": 5000.0, "poisson": 0.3},
        "body_force": {"y": -10.0},
        "contact": [{"boundary": side, "friction": friction} for side in ("bottom", "left")],
    }
    solution = solved(scene)
    return found(solution, difference(_resultant(solution), [0.0, 10.0]))


def _clamped(law: str, gap: Any, load: float = -20.0, **settings: Any) -> dict[str, Any]:
    """A block whose sides are clamped."""
    scene = example1(law, **settings)
    scene["displacement"] = [{"boundary": side, "x": 0.0, "y": 0.0} for side in ("left", "right")]
    scene["traction"] = {"boundary": "top", "y": load}
    scene["contact"] = scene["contact"] | {"gap": gap}
    return scene


def _touching(law: str) -> Finding:
    ours, limit = (solved(_clamped(law, "0", **way)) for way in ({}, {"algorithm": "alm"}))
    return found(ours, difference(ours.displacement.x.array, limit.displacement.x.array))


def _lifted(law: str) -> Finding:
    return found(solved(example1(law, load=-1.0)))


def _never(law: str, load: float) -> Finding:
    scene = _clamped(law, 1.0 if load < 0 else 1e-3, load)
    solution = solved(scene)
    linear = solved(_open_reference(scene, law))
    error = difference(solution.displacement.x.array, linear.displacement.x.array)
    assert solution.contact is not None
    return found(solution, worst([error, np.abs(solution.contact.pressure).max()]))


def _open_reference(scene: dict[str, Any], law: str) -> dict[str, Any]:
    """The same scene without contact, in which given friction acts nevertheless."""
    return scene | ({"solver": {"algorithm": "alm"}} if law == "Tresca" else {"contact": []})


def _penetrating(law: str) -> Finding:
    """The foundation penetrates the body slightly, under a clamped top."""
    scene = example1(law) | {"traction": []}
    scene["displacement"] = [{"boundary": "top", "x": 0.0, "y": 0.0}]
    scene["contact"] = scene["contact"] | {"gap": -0.01}
    solution = solved(scene)
    if law == "frictionless":
        other = scene | {"contact": [], "displacement": [*scene["displacement"], {"boundary": "bottom", "y": 0.01}]}
    else:
        other = scene | {"solver": {"algorithm": "alm"}}
    return found(solution, difference(solution.displacement.x.array, solved(other).displacement.x.array))


def _grazing(law: str, load: float) -> Finding:
    solution = solved(example1(law, load=load))
    return found(solution, abs(_resultant(solution)[1] / (20.0 * load) - 1))


def _sagging(law: str, share: float) -> Finding:
    """The foundation is at the position of the free loaded body, except for a small distance."""
    linear = solved(_open_reference(_clamped(law, 1.0), law))
    bottom = linear.model.space.tabulate_dof_coordinates()[:, 1] < 1e-9
    sag = -linear.displacement.x.array[1::2][bottom].min()
    solution = solved(_clamped(law, float(sag * (1 - share))))
    return found(solution, difference(solution.displacement.x.array, linear.displacement.x.array))


def _nothing(law: str, *, held: bool) -> Finding:
    scene = _clamped(law, "0.001", 0.0) if held else example1(law, load=0.0)
    solution = solved(scene)
    return found(solution, float(np.abs(solution.displacement.x.array).max()))


def _friction_only(law: str, nx: int, ny: int, gap: str, gamma: Any) -> Finding:
    scene = example1(law, nx=nx, ny=ny, gamma_n=gamma, gamma_t=gamma)
    scene["displacement"] = []
    if gap == "flat":
        scene["contact"] = scene["contact"] | {"gap": 0.0}
    load = solved_load(scene)
    solution = solved(scene)
    return found(solution, difference(_resultant(solution), [0.0, load]))


def solved_load(scene: dict[str, Any]) -> float:
    """The resultant of the load as the mesh integrates it."""
    from mpi4py import MPI

    from signorini_fx.mechanics.body.discretisation import discretise
    from signorini_fx.records import Timings
    from signorini_fx.scenes.mesh import load_mesh
    from signorini_fx.scenes.reading import parse_scene

    parsed = parse_scene(scene)
    applied = discretise(parsed.statement, load_mesh(parsed, MPI.COMM_SELF), Timings()).applied
    return -sum(float(load.forces[1::2].sum()) for load in applied)


def _sliding() -> Finding:
    scene = example1("Coulomb")
    scene |= {"displacement": [], "traction": {"boundary": "top", "x": 10.0, "y": -20.0}}
    return found(solved(scene))


def _free() -> Finding:
    return found(solved(example1("frictionless") | {"displacement": []}))
