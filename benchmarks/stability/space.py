"""Bodies in 3D: gamma, Poisson's ratio, starts, friction of every size, what holds the body, bad cells, units."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache, partial
from typing import Any

import numpy as np

from benchmarks.stability.case import CONVERGED, Case, Finding
from benchmarks.stability.measure import REGULARISED, apart, difference, found, solved, solved_from
from signorini_fx.algebra.contact.active_sets import ActiveSets
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.records import Status
from signorini_fx.results.solution import Solution

_E, _SIZE = 5000.0, np.sqrt(11.0)
_NONE: dict[str, Any] = {"law": "none"}
_TRESCA: dict[str, Any] = {"law": "tresca", "bound": 1.5}
_COULOMB: dict[str, Any] = {"law": "coulomb", "coefficient": 0.3}
_LAWS = {"frictionless": _NONE, "Tresca": _TRESCA, "Coulomb": _COULOMB}


def cases(*, short: bool) -> Iterator[Case]:
    """The block of the first example in 3D, and a block that only its foundation holds."""
    laws = {"Tresca": _TRESCA} if short else _LAWS
    for name, law in laws.items():
        for power in (7,) if short else (2, 3, 5, 7, 9, 11):
            # The penalty has about this error; above the limit of round-off the outcome has a name.
            target = max(REGULARISED, 30 * 10.0**-power)
            beyond = (Status.ROUND_OFF.value, Status.NOT_CERTIFIED.value) if power > 9 else ()
            yield Case(
                f"{name}, gamma 1e{power}",
                partial(_gamma, law, 10.0**power),
                allowed=beyond,
                target=target,
                reference="unregularised limit",
                note="gamma is too large for double precision; 'auto' is not" if beyond else "",
            )
        for ratio in (0.4999,) if short else (0.0, 0.3, 0.45, 0.4999, 0.499999):
            yield Case(
                f"{name}, nu = {ratio:g}", partial(_poisson, law, ratio), target=1e-5, reference="unregularised limit"
            )
    for start in ("all slip", "all open") if short else ("all slip", "all stick", "all open", "at random"):
        yield Case(f"start: {start}", partial(_start, start), target=1e-7, reference="the usual start")
    for coefficient in (1e6,) if short else (0.0, 1e-6, 0.1, 1.0, 3.0, 100.0, 1e6):
        yield Case(
            f"F = {coefficient:g}", partial(_coefficient, coefficient), target=1e-5, reference="monolithic against fp"
        )
    for push, wanted in ((0.9, CONVERGED), (1.1, Status.SLIDES.value)):
        for angle in (37.0,) if short else (0.0, 37.0, 90.0, 200.0):
            yield Case(
                f"pushed at {angle:g} degrees with {push:g} of the limit",
                partial(_pushed, push, np.radians(angle)),
                wanted=(wanted,),
                target=1e-6 if wanted == CONVERGED else None,
                reference="force of friction",
            )
    yield Case("lifted", _lifted, wanted=(Status.OPEN.value,))
    yield Case("pushed without friction", _without_friction, wanted=(Status.NOT_HELD.value,))
    for cell in ("tetrahedron",) if short else ("hexahedron", "tetrahedron"):
        for height in (0.02,) if short else (0.02, 0.2, 20.0):
            yield Case(
                f"{cell}s, height {height:g} of 3",
                partial(_flat, cell, height),
                # gamma = auto depends on the size of the body, the contact on its width: a tower penetrates more.
                target=REGULARISED * max(1.0, height),
                reference="unregularised limit",
            )
    for length, stress in ((1e-3, 1e6),) if short else ((1e-6, 1.0), (1e-3, 1e6), (1e3, 1e-6), (1e6, 1e9)):
        yield Case(
            f"lengths times {length:g}, stresses times {stress:g}",
            partial(_units, length, stress),
            target=1e-7,
            reference="the same in other units",
        )


def _block(law: dict[str, Any], *, length: float = 1.0, stress: float = 1.0, **changed: Any) -> dict[str, Any]:
    """A block 3 x 1 x 1 on a paraboloid, its ends guided, under an oblique load in the middle of its top."""
    settings = {key: value for key, value in changed.items() if key not in ("parameters", "poisson", "element")}
    friction = dict(law, bound=law["bound"] * stress) if "bound" in law else law
    within = f"{length} <= x[0] <= {2 * length}"
    foundation = f"{length}*(0.003*((x[0]/{length} - 1.5)**2 + (x[1]/{length} - 0.5)**2) + 0.001)"
    sizes = {"length": 3.0 * length, "width": length, "height": length}
    return {
        "mesh": {
            "generator": "box",
            "parameters": {**sizes, "nx": 12, "ny": 4, "nz": 4, **changed.get("parameters", {})},
        },
        "element": changed.get("element", {}),
        "material": {"young": _E * stress, "poisson": changed.get("poisson", 0.4)},
        "displacement": [{"boundary": side, "x": 0.0, "y": 0.0} for side in ("left", "right")],
        "traction": {
            "boundary": "top",
            "y": f"{4 * stress} if {within} else 0",
            "z": f"{-20 * stress} if {within} else 0",
        },
        "contact": {"boundary": "bottom", "gap": foundation, "friction": friction},
        "solver": settings,
    }


def _against_the_limit(law: dict[str, Any], **changed: Any) -> Finding:
    ours = solved(_block(law, **changed))
    changed = {key: value for key, value in changed.items() if not key.startswith("gamma")}
    return found(ours, apart(ours, solved(_block(law, algorithm="alm", tolerance=1e-10, **changed))))


def _gamma(law: dict[str, Any], factor: float) -> Finding:
    return _against_the_limit(law, gamma_n=factor * _E / _SIZE, gamma_t=factor * _E / _SIZE)


def _poisson(law: dict[str, Any], ratio: float) -> Finding:
    changed: dict[str, Any] = {"poisson": ratio, "element": {"volumetric": "auto"}, "tolerance": 1e-8}
    ours = solved(_block(law, **changed))
    return found(ours, apart(ours, solved(_block(law, algorithm="alm", **changed))))


@cache
def _usual() -> Solution:
    return solved(_block(_TRESCA))


def _start(start: str) -> Finding:
    random = np.random.default_rng(5)

    def sets(boundary: ContactBoundary) -> ActiveSets:
        directions = random.standard_normal((boundary.size, 2))
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        slips = {"all slip": True, "all stick": False, "all open": False}.get(start, random.random(boundary.size) < 0.5)
        contact = random.random(boundary.size) < 0.5 if start == "at random" else np.full(boundary.size, True)
        contact &= start != "all open"
        return ActiveSets.of(contact, np.where(np.broadcast_to(slips, boundary.size)[:, None], directions, 0.0))

    ours = solved_from(_block(_TRESCA), sets)
    return found(ours, apart(ours, _usual()))


def _coefficient(coefficient: float) -> Finding:
    law = {"law": "coulomb", "coefficient": coefficient}
    one, other = (solved(_block(law, coulomb=way, tolerance=1e-9)) for way in ("newton", "fp"))
    return found(one, apart(one, other))


def _free(loads: list[dict[str, Any]], friction: dict[str, Any]) -> dict[str, Any]:
    """A block that only its foundation holds."""
    return {
        "mesh": {"generator": "box", "parameters": {"nx": 9, "ny": 3, "nz": 3}},
        "material": {"young": _E, "poisson": 0.3},
        "traction": loads,
        "contact": {"boundary": "bottom", "friction": friction},
    }


def _pushed(share: float, angle: float) -> Finding:
    """Pressed with 20 on its top, area 3; friction 0.3 of it is the limit of a push at its foot in any direction."""
    push = share * 0.3 * 20.0
    foot = {"boundary": "bottom", "x": push * np.cos(angle), "y": push * np.sin(angle)}
    loads = [{"boundary": "top", "z": -20.0}, foot]
    solution = solved(_free(loads, _COULOMB))
    if solution.status is not Status.CONVERGED or solution.contact is None:
        return found(solution)
    _, friction = solution.contact.forces
    return found(solution, difference(friction[:2], -3.0 * push * np.array([np.cos(angle), np.sin(angle)])))


def _lifted() -> Finding:
    return found(solved(_free([{"boundary": "top", "z": 1.0}], _COULOMB)))


def _without_friction() -> Finding:
    return found(solved(_free([{"boundary": "top", "z": -20.0, "x": 1.0}], _NONE)))


def _flat(cell: str, height: float) -> Finding:
    return _against_the_limit(_COULOMB, parameters={"cell": cell, "height": height})


def _units(length: float, stress: float) -> Finding:
    ours = solved(_block(_TRESCA, length=length, stress=stress))
    return found(ours, apart(ours, _usual(), length, stress))
