"""Judge results of CalculiX, good ones and ones that are spoiled on purpose, and count the right words.

    ./env python3 -m stability.judged [--good 60] [--spoiled 150] [--seed 1] [--out FILE]
    ./env python3 -m stability.judged --data tests/judging/data      # the results that the tests judge

A good result is that of the deck itself, or of the same deck with another element, other increments or a harder
contact.  A spoiled one is the result of a deck that was changed and is judged against the deck before the change, or a
result whose displacements were changed.  It is right if the verdict is one of the words that describe the change.
The program is ccx (Debian's package calculix-ccx), or what CCX in the environment names; without it nothing is done.
"""

from __future__ import annotations

import argparse
import csv
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
from scipy.sparse.linalg import splu

from signorini_fx.addons.judging.calculix_results import read_dat
from signorini_fx.addons.judging.foreign_equilibrium import Equilibrium, best_fit
from signorini_fx.addons.judging.formulations import Formulation, stiffness_by_material
from signorini_fx.addons.judging.judge import judge
from signorini_fx.addons.judging.judgement import Judgement
from signorini_fx.addons.judging.problems import judged_problem
from signorini_fx.addons.judging.touching_surface import touching_surface
from stability.foreign_decks import SHAPES, ForeignDeck, program, solve, text_of

Floats = npt.NDArray[np.float64]
Rng = np.random.Generator

ELEMENTS = {
    "plane": ("CPE3", "CPE4", "CPE6", "CPE8", "CPE8R", "CPS4", "CPS8R", "CAX4", "CAX8R", "CPS4R", "CPE4R", "CAX4R"),
    "space": ("C3D4", "C3D8", "C3D8I", "C3D10", "C3D20R", "C3D8R"),
}
# Results whose displacements differ by less than this share of the largest are the same.
ALIKE = 2e-3
CELLS = {1: ((10, 4), (14, 5), (12, 6)), 2: ((6, 2), (8, 3)), 3: ((6, 3, 2), (5, 2, 3)), 4: ((4, 2, 1),)}
# What follows where forces of contact are others: the sides come apart or enter, too.
ANY_CONTACT = ("penetration", "tension", "apart", "reaction", "cone", "wrong way", "slip", "law", "penalty")
# The words for each change, besides those of a kind that all may have.
NOT_IN_EQUILIBRIUM, LOADS = "not in equilibrium", "another problem: load or modulus"


def contact(*keys: str) -> tuple[str, ...]:
    """Words of contact."""
    return tuple(f"violates contact: {key}" for key in keys)


# Laws of soft contact.
EXPONENTIAL = ("EXPONENTIAL", ((0.01, 2.0),))
TABULAR = ("TABULAR", ((0.0, 0.0), (1.0, 0.01), (5.0, 0.02)))
LINEAR = ("LINEAR", ((300.0,),))
DATA = {
    "shelf_CPE4": ForeignDeck("shelf", "CPE4", (8, 3)),
    "shelf_CPE6": ForeignDeck("shelf", "CPE6", (4, 2), warp=0.2),
    "shelf_CPE8R": ForeignDeck("shelf", "CPE8R", (5, 2)),
    "shelf_CPS4": ForeignDeck("shelf", "CPS4", (6, 2), warp=0.2),
    "shelf_CPS4R": ForeignDeck("shelf", "CPS4R", (8, 3)),
    "shelf_CAX4": ForeignDeck("shelf", "CAX4", (8, 3)),
    "shelf_CAX4R": ForeignDeck("shelf", "CAX4R", (8, 3)),
    "shelf_CPE4R": ForeignDeck("shelf", "CPE4R", (8, 3), warp=0.2),
    "shelf_C3D8R": ForeignDeck("shelf", "C3D8R", (4, 2, 2), warp=0.2),
    "shelf_C3D4": ForeignDeck("shelf", "C3D4", (4, 2, 2)),
    "shelf_C3D8I": ForeignDeck("shelf", "C3D8I", (4, 2, 2), warp=0.2),
    "shelf_C3D20R": ForeignDeck("shelf", "C3D20R", (3, 2, 1)),
    "shelf_hard": ForeignDeck("shelf", "CPE4", (8, 3), stiffness=None, pair="NODE TO SURFACE"),
    "press_CPE4": ForeignDeck("press", "CPE4", (8, 3), friction=0.3, warp=0.2),
    "press_CPS8R": ForeignDeck("press", "CPS8R", (5, 2), friction=0.3),
    "press_C3D8": ForeignDeck("press", "C3D8", (4, 2, 2), friction=0.2),
    "shelf_exponential": ForeignDeck("shelf", "CPE4", (8, 3), law=EXPONENTIAL, pair="NODE TO SURFACE"),
    "shelf_linear": ForeignDeck("shelf", "CPE8", (5, 2), law=LINEAR),
    "shelf_tabular": ForeignDeck("shelf", "C3D8", (4, 2, 2), law=TABULAR, pair="NODE TO SURFACE", increments=10),
    "shelf_tetrahedra": ForeignDeck("shelf", "C3D4", (4, 2, 2), law=EXPONENTIAL, pair="NODE TO SURFACE"),
    "shelf_adjusted": ForeignDeck("shelf", "CPE4", (8, 3), adjust="0.032", tilt=0.03),
    "shelf_adjusted8": ForeignDeck("shelf", "CPE8R", (5, 2), adjust="0.06", tilt=0.03),
    "shelf_folded": ForeignDeck("shelf", "CPE8R", (8, 3), young=3e3, stiffness=9e5, adjust="0.032", tilt=0.03),
    "shelf_adjusted10": ForeignDeck("shelf", "C3D10", (3, 2, 1), adjust="0.032", tilt=0.03),
    "shelf_adjusted3": ForeignDeck("shelf", "CPE3", (8, 3), adjust="0.032"),
    "shelf_adjusted_set": ForeignDeck("shelf", "C3D8", (4, 2, 2), adjust="BODY_BOTTOM_N", tilt=0.03),
    "press_linear": ForeignDeck("press", "C3D8", (4, 2, 2), law=LINEAR, friction=0.2),
    "stack_exponential": ForeignDeck("stack", "CPE4", (6, 2), law=EXPONENTIAL, pair="NODE TO SURFACE"),
    "stack_CPE4": ForeignDeck("stack", "CPE4", (6, 2), friction=0.3),
    "stack_CPE8R": ForeignDeck("stack", "CPE8R", (4, 2)),
    "stack_arc": ForeignDeck(
        "stack",
        "CPS4",
        (6, 2),
        young=2.5,
        stiffness=250.0,
        pressure=3e-3,
        push=2e-3,
        pair="NODE TO SURFACE",
        shape="arc",
    ),
    "shelf_capped": ForeignDeck("shelf", "C3D10", (2, 1, 1), capped=True),
    "press_capped": ForeignDeck(
        "press", "C3D8I", (3, 1, 1), friction=0.6, stiffness=None, capped=True, earlier=0.6, increments=5
    ),
    "press_above": ForeignDeck("press", "CPE4", (6, 2), friction=0.6, displaced=(0.03, 0.03), increments=4, above=0.02),
    "press_lifted": ForeignDeck("press", "CPE4", (14, 5), friction=0.15, stiffness=5e4, warp=0.2, earlier=-0.5),
    "press_slender": ForeignDeck(
        "press", "C3D20R", (2, 1, 1), friction=0.1, stiffness=1.5e5, shape="slender", increments=10
    ),
}


def write_data(folder: Path) -> None:
    """Solve the decks that the tests judge, and keep what CalculiX prints; .frd of the first of each kind."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch:
        for name, deck in DATA.items():
            solved = solve(text_of(deck), Path(scratch), name)
            assert solved is not None, name
            kinds = [".inp", ".dat"] + [".frd"] * (name in ("shelf_CPE4", "shelf_C3D20R", "stack_CPE8R"))
            for kind in kinds:
                (folder / f"{name}{kind}").write_bytes((solved.with_suffix(kind)).read_bytes())


@dataclass(frozen=True)
class Change:
    """Something that is done to a deck or to its result.

    Attributes:
        name: in words.
        right: the words that describe it.
        deck: the deck that is solved instead; None: its own.
        displacement: what becomes of the displacement, by the problem and its numbers of nodes; None: it stays.
    """

    name: str
    right: tuple[str, ...]
    deck: ForeignDeck | None = None
    text: Callable[[str], str] | None = None
    displacement: Callable[[Path, Floats], Floats] | None = None


def drawn(rng: Rng) -> ForeignDeck:
    """A deck."""
    element = str(rng.choice(ELEMENTS["plane"] if rng.random() < 0.7 else ELEMENTS["space"]))
    dim = 3 if element.startswith("C3D") else 2
    nodes = ForeignDeck(element=element).nodes_of_element
    quadratic = nodes in ((6, 8) if dim == 2 else (10, 20))
    cells = CELLS[(1 if dim == 2 else 3) + quadratic]
    kind = str(rng.choice(["shelf", "press", "stack"]))
    young = float(rng.choice([500.0, 1000.0, 3000.0]))
    friction = {"shelf": 0.0, "press": float(rng.choice([0.15, 0.3])), "stack": float(rng.choice([0.0, 0.3]))}[kind]
    pair = "SURFACE TO SURFACE" if quadratic or rng.random() < 0.6 else "NODE TO SURFACE"
    stiffness = None if rng.random() < 0.15 else float(rng.choice([50.0, 100.0, 300.0])) * young
    law = _drawn_law(rng, young, nodal=pair == "NODE TO SURFACE") if rng.random() < 0.3 else None
    if friction and law is not None and law[0] == "TABULAR":  # one needs one increment, the other many
        law = None
    adjusts = kind == "shelf" and rng.random() < 0.3
    shapes = [name for name in SHAPES if (kind == "stack" and dim == 2) or name != "arc"]
    turns = [name for name in shapes if name != "rotated" or not element.startswith("CAX")]
    shape = str(rng.choice(turns)) if rng.random() < 0.5 and law is None and not adjusts else ""
    capped = not shape and not adjusts and rng.random() < 0.3
    earlier = float(rng.choice([-0.5, 0.6])) if rng.random() < 0.2 else 0.0
    above = 0.01 if kind == "press" and not shape and not earlier and rng.random() < 0.2 else 0.0
    return ForeignDeck(
        kind,
        element,
        cells[rng.integers(len(cells))],
        young=young,
        poisson=float(rng.choice([0.2, 0.3])),
        stiffness=stiffness,
        friction=friction,
        stick=100.0 * young,
        pair=pair,
        pressure=young / 1000,
        push=young / (200 if kind != "shelf" and friction else 2000),
        displaced=(0.01, 0.03),
        warp=float(rng.choice([0.0, 0.2])),
        law=law,
        increments=_increments(friction, law, earlier),
        shape=shape,
        adjust="0.032" if adjusts else "",
        tilt=0.03 if adjusts else 0.0,
        # CalculiX ties no plane elements: of degree 1 it finds no solution, of degree 2 it warns that nodes stay free.
        capped=capped and dim == 3,
        earlier=earlier,
        above=above,
    )


def _increments(friction: float, law: tuple[str, tuple[tuple[float, ...], ...]] | None, earlier: float) -> int:
    """With how many increments CalculiX has a good result.

    All loads and motions grow in proportion, and so does a solution with a linear law, in any number of increments.
    Friction of CalculiX drifts from it with each of them, if contact is soft: of a press of CPE8R with a linear law and
    a coefficient of .15 our solution is .8 % (of displacement) from its result with one increment, 11 % with ten, 19 %
    with forty.  Of a table it may lose contact with few ones, the more after a step that pulls.
    """
    if law is None:
        return 10 if friction else 1
    return (50 if earlier else 10) if law[0] == "TABULAR" else 1


def _drawn_law(rng: Rng, young: float, *, nodal: bool) -> tuple[str, tuple[tuple[float, ...], ...]]:
    """A law of soft contact that CalculiX has: between faces it has none but the linear one (a table is passed over in
    version 2.20, an exponential one jumps where the sides meet).
    """
    laws = {
        "LINEAR": ((float(rng.choice([0.3, 1.0])) * young,),),
        "EXPONENTIAL": ((float(rng.choice([0.01, 0.02])), 2e-3 * young),),
        "TABULAR": ((0.0, 0.0), (1e-3 * young, 0.01), (5e-3 * young, 0.02)),
    }
    name = str(rng.choice(sorted(laws))) if nodal else "LINEAR"
    return name, laws[name]


def _times(law: tuple[str, tuple[tuple[float, ...], ...]], factor: float) -> tuple[str, tuple[tuple[float, ...], ...]]:
    """A law whose pressures are so many times as large."""
    name, rows = law
    if name == "EXPONENTIAL":
        return name, tuple((clearance, factor * pressure) for clearance, pressure in rows)
    return name, tuple((factor * pressure, *depth) for pressure, *depth in rows)


def _prescribed(deck: ForeignDeck) -> bool:
    """Whether the top is moved, and not pressed."""
    return deck.kind == "press" or (deck.kind == "stack" and deck.friction > 0)


def good_changes(deck: ForeignDeck) -> list[Change]:
    """Changes after which a result is still good."""
    harder = deck.stiffness
    changes = [Change("itself", ("agrees", "agrees with another penalty"))]
    if deck.kind == "shelf" and deck.increments == 1:  # with fewer ones CalculiX may lose a contact with a table
        changes.append(Change("4 increments", ("agrees", "agrees with another penalty"), replace(deck, increments=4)))
    if harder is not None and deck.law is None:
        right = ("agrees", "agrees with another penalty")
        changes.append(Change("penalty x 4", right, replace(deck, stiffness=4 * harder)))
    other = {"CPE8": "CPE8R", "CPE8R": "CPE8", "C3D8": "C3D8I", "C3D8I": "C3D8"}.get(deck.element)
    if other is not None:
        changes.append(Change(f"element {other}", ("agrees with another element",), replace(deck, element=other)))
    return changes


def bad_changes(deck: ForeignDeck, rng: Rng) -> list[Change]:
    """Changes after which it is not."""
    prescribed = _prescribed(deck)
    entering = contact("penetration", "penalty", "tension", "apart", "law")
    changes: list[Change] = []
    if not prescribed:
        share = float(rng.choice([1.02, 1.05, 1.1, 0.5]))
        changes.append(Change("load", (LOADS,), replace(deck, pressure=share * deck.pressure)))
        changes.append(Change("modulus", (LOADS,), replace(deck, young=1.1 * deck.young)))
        changes.append(Change("loads exchanged", (LOADS,), replace(deck, pressure=deck.push, push=deck.pressure)))
    changes.append(Change("push", (LOADS,), replace(deck, push=1.5 * deck.push)))
    changes.append(Change("nu", (NOT_IN_EQUILIBRIUM, LOADS, *contact("reaction")), replace(deck, poisson=0.4)))
    if deck.kind == "stack":
        right = (LOADS, NOT_IN_EQUILIBRIUM, *contact("reaction"))
        changes.append(Change("materials exchanged", right, replace(deck, young=3 * deck.young, lower=1 / 3)))
        changes.append(Change("modulus below", right, replace(deck, lower=4.0)))
    if deck.kind == "shelf":
        # Other nodes are moved where contact adjusts them.
        moved_nodes = (NOT_IN_EQUILIBRIUM,) * bool(deck.adjust)
        changes.append(Change("gap", (*entering, *contact("reaction"), *moved_nodes), replace(deck, gap=0.1)))
        released = ("violates supports",)
        changes.append(Change("support released", released, text=_released))
    else:
        moved = replace(deck, displaced=(deck.displaced[0] * 1.3, deck.displaced[1]))
        changes += [Change("prescribed motion", ("violates supports",), moved)] if prescribed else []
    for factor in (0.5, 2.0):
        if deck.law is not None:
            other = replace(deck, law=_times(deck.law, factor))
            changes.append(Change(f"law x {factor:g}", contact("law", "penetration", "penalty"), other))
    if deck.capped:
        changes.append(Change("half a tie", ("violates supports",), text=_half_tied))
    if deck.adjust:
        right = (NOT_IN_EQUILIBRIUM, LOADS, *entering, *contact("law"))
        changes.append(Change("not adjusted", right, replace(deck, adjust="")))
    if deck.stiffness is not None and deck.law is None:
        changes.append(
            Change("penalty / 100", contact("penetration", "penalty"), replace(deck, stiffness=deck.stiffness / 100))
        )
    right = contact("cone", "slip")
    if deck.friction:
        changes.append(Change("friction x 1.5", right, replace(deck, friction=1.5 * deck.friction)))
    # Of sides that begin apart nobody knows the slip since they touch, by which less friction is seen.
    if deck.friction and not deck.above and not deck.earlier < 0:
        changes.append(Change("friction x 0.5", right, replace(deck, friction=0.5 * deck.friction)))
        changes.append(
            Change("no friction", contact("slip"), replace(deck, friction=0.0))
            if deck.kind == "press"
            else Change("no friction", contact("slip"), text=_frictionless)
        )
        changes.append(Change("friction's sign", contact(*ANY_CONTACT), displacement=_with_forces(_turned_shear)))
    changes.append(Change("a corner pulls", contact(*ANY_CONTACT), displacement=_with_forces(_pulled)))
    changes.append(Change("contact force moved", contact(*ANY_CONTACT), displacement=_with_forces(_moved)))
    changes.append(Change("units", ("another problem: units",), displacement=lambda _, v: 1000.0 * v))
    right = ("violates supports", NOT_IN_EQUILIBRIUM, LOADS)
    changes.append(Change("half", right, displacement=lambda _, v: 0.5 * v))
    changes.append(Change("a node moved", (NOT_IN_EQUILIBRIUM, "violates supports"), displacement=_node_moved))
    changes.append(Change("two nodes exchanged", (NOT_IN_EQUILIBRIUM, "violates supports"), displacement=_exchanged))
    changes.append(Change("noise 1e-3", (NOT_IN_EQUILIBRIUM, "violates supports"), displacement=_noisy))
    changes.append(
        Change(
            "a node enters",
            (*contact("penetration", "tension", "apart", "reaction", "cone"), NOT_IN_EQUILIBRIUM),
            displacement=_entered,
        )
    )
    changes.append(Change("nothing moves", ("not a result",), displacement=lambda _, v: 0.0 * v))
    return changes


def _released(text: str) -> str:
    """Without the support of the left side along the vertical axis."""
    return text.replace("BODY_LEFT_N, 1, 2\n", "BODY_LEFT_N, 1, 1\n").replace(
        "BODY_LEFT_N, 1, 3\n", "BODY_LEFT_N, 1, 2\n"
    )


def _half_tied(text: str) -> str:
    """With the first half of the faces of a tie."""
    lines = text.splitlines()
    first = lines.index("*SURFACE, NAME=CAP_BOTTOM") + 1
    last = next(k for k in range(first, len(lines)) if lines[k].startswith("*"))
    del lines[(first + last + 1) // 2 : last]
    return "\n".join(lines) + "\n"


def _frictionless(text: str) -> str:
    lines = text.splitlines()
    at = lines.index("*FRICTION")
    return "\n".join(lines[:at] + lines[at + 2 :]) + "\n"


def _free_node(deck: Path, seed: int, v: Floats) -> tuple[int, float]:
    """A node that nothing holds and that is in no contact, and the largest displacement."""
    problem, _ = judged_problem(deck)
    free = np.flatnonzero(problem.free.all(axis=1))
    return int(np.random.default_rng(seed).choice(free)), float(np.abs(v).max())


def _node_moved(deck: Path, v: Floats) -> Floats:
    node, largest = _free_node(deck, 3, v)
    v = v.copy()
    v[node, -1] += 0.1 * largest
    return v


def _exchanged(deck: Path, v: Floats) -> Floats:
    problem, _ = judged_problem(deck)
    nodes = np.flatnonzero(problem.free.all(axis=1))
    apart = np.linalg.norm(v[nodes][:, None] - v[nodes][None], axis=2)
    first, second = np.unravel_index(int(np.argmax(apart)), apart.shape)
    v = v.copy()
    v[[nodes[first], nodes[second]]] = v[[nodes[second], nodes[first]]]
    return v


def _noisy(deck: Path, v: Floats) -> Floats:
    problem, _ = judged_problem(deck)
    noise = np.random.default_rng(5).uniform(-1, 1, v.shape) * 1e-3 * np.abs(v).max()
    return np.where(problem.free, v + noise, v)


def _entered(deck: Path, v: Floats) -> Floats:
    """The corner that is pressed most enters further."""
    problem, _ = judged_problem(deck)
    equilibrium = Equilibrium(problem, v, np.zeros_like(v))
    (first, *_) = problem.contacts
    surface = touching_surface(problem, first, v, equilibrium.fit(_best(equilibrium)).residual)
    corner = int(np.argmax(np.where(surface.judged, surface.push, -np.inf)))
    v = v.copy()
    v[surface.corners[corner]] += 0.1 * np.linalg.norm(v, axis=1).max() * surface.normal[corner]
    return v


def _best(equilibrium: Equilibrium) -> Formulation:
    return best_fit(equilibrium).fit.formulation


def _with_forces(change: Callable[[Floats, Floats, Floats], Floats]) -> Callable[[Path, Floats], Floats]:
    """The displacement in equilibrium with other contact forces at the corners of a surface."""

    def spoiled(deck: Path, v: Floats) -> Floats:
        problem, _ = judged_problem(deck)
        equilibrium = Equilibrium(problem, v, np.zeros_like(v))
        best = equilibrium.fit(_best(equilibrium))
        if best.formulation.layer or best.rho > equilibrium.threshold:
            raise NotImplementedError
        matrices = stiffness_by_material(problem, best.formulation)
        (first, *_) = problem.contacts
        surface = touching_surface(problem, first, v, best.residual)
        extra = np.zeros_like(v)
        nodes = surface.corners[surface.sliding]
        if len(nodes) < 3:
            raise NotImplementedError
        normal = surface.normal[surface.sliding]
        extra[nodes] = change(best.residual[nodes], normal, surface.push[surface.sliding])
        free = np.flatnonzero((np.isnan(problem.prescribed) & problem.deformable[:, None]).ravel())
        total = sum(matrices[1:], matrices[0])[free][:, free].tocsc()
        if abs(splu(total).U.diagonal()).min() <= 1e-9 * abs(total.diagonal()).max():
            raise NotImplementedError  # supports alone do not hold the body
        factor = splu(total)
        moved = v.copy().ravel()
        moved[free] += factor.solve(extra.ravel()[free])
        return moved.reshape(v.shape)

    return spoiled


def _turned_shear(force: Floats, normal: Floats, push: Floats) -> Floats:
    along = np.einsum("nd,nd->n", force, normal)[:, None] * normal
    return np.asarray(-2 * (force - along))


def _pulled(force: Floats, normal: Floats, push: Floats) -> Floats:
    """A corner is pulled with a tenth of all force."""
    extra = np.zeros_like(force)
    row = int(np.argmin(push))
    extra[row] = 0.1 * push.sum() * normal[row]
    return extra


def _moved(force: Floats, normal: Floats, push: Floats) -> Floats:
    """Half of the largest force goes to where the least is."""
    most, least = int(np.argmax(push)), int(np.argmin(push))
    extra = np.zeros_like(force)
    extra[most], extra[least] = 0.5 * push[most] * normal[most], -0.5 * push[most] * normal[least]
    return extra


@dataclass(frozen=True)
class JudgedCase:
    """A result that was judged.

    Attributes:
        deck: of the problem.
        change: what was done.
        good: whether it is to agree.
        judgement: the verdict.
    """

    deck: ForeignDeck
    change: Change
    good: bool
    judgement: Judgement

    @property
    def verdict(self) -> str:
        """right, another word, agrees or refused."""
        if self.judgement.word in self.change.right or (self.good and self.judgement.agrees):
            return "right"
        if self.good:
            return "refused"
        return "agrees" if self.judgement.agrees else "another word"


def judged_case(deck: ForeignDeck, change: Change, folder: Path, *, good: bool) -> JudgedCase | None:
    """Solve, change and judge; None: CalculiX has no solution, or the change cannot be made."""
    path = solve(text_of(deck), folder, "stated")
    if path is None:
        return None
    if change.displacement is not None:
        problem, _ = judged_problem(path)
        tables = read_dat(path.with_suffix(".dat"))
        v = np.array([tables.displacement[name][0][: problem.mesh.dim] for name in problem.mesh.names.tolist()])
        try:
            changed = change.displacement(path, v)
        except NotImplementedError:
            return None
        rows = {int(name): tuple(row) for name, row in zip(problem.mesh.names, changed.tolist(), strict=True)}
        return JudgedCase(deck, change, good, judge(path, rows, compare=False))
    text = text_of(change.deck or deck)
    solved = solve(text if change.text is None else change.text(text), folder, "changed")
    if solved is None or (not good and _alike(path, solved)):
        return None
    return JudgedCase(deck, change, good, judge(path, solved.with_suffix(".dat"), compare=False))


def _alike(first: Path, second: Path) -> bool:
    """Whether two decks have nearly the same result, so that nobody can tell them apart."""
    one, other = (read_dat(path.with_suffix(".dat")).displacement for path in (first, second))
    values = np.array([[one[node][0], other[node][0]] for node in one])
    return float(np.abs(values[:, 0] - values[:, 1]).max()) < ALIKE * float(np.abs(values).max())


def cases(good: int, spoiled: int, seed: int) -> list[JudgedCase]:
    """Random cases, good and spoiled ones."""
    rng = np.random.default_rng(seed)
    listed: list[JudgedCase] = []
    with tempfile.TemporaryDirectory() as name:
        for wanted, is_good in ((good, True), (spoiled, False)):
            count = 0
            while count < wanted:
                deck = drawn(rng)
                changes = good_changes(deck) if is_good else bad_changes(deck, rng)
                order = rng.permutation(len(changes))[: 2 if is_good else 4]
                for change in (changes[k] for k in order):
                    case = judged_case(deck, change, Path(name), good=is_good)
                    if case is None or count >= wanted:
                        continue
                    listed.append(case)
                    count += 1
                    if case.verdict != "right":
                        print(f"{case.verdict}: {change.name}: {case.judgement.word}: {deck}", flush=True)
                        for finding in case.judgement.findings:
                            print(f"    {finding.key}: {finding.text}", flush=True)
    return listed


def table(listed: Sequence[JudgedCase]) -> list[str]:
    """How many of each change got which verdict."""
    lines = ["| change | number | right word | another word | agrees | refused |", "|---|---|---|---|---|---|"]
    names = dict.fromkeys((case.good, case.change.name) for case in listed)
    for good, name in sorted(names, key=lambda pair: (not pair[0], pair[1])):
        own = [case for case in listed if (case.good, case.change.name) == (good, name)]
        counts = Counter(case.verdict for case in own)
        numbers = [counts[word] for word in ("right", "another word", "agrees", "refused")]
        label = f"{'good' if good else 'spoiled'}: {name}"
        lines.append(f"| {label} | {len(own)} | {' | '.join(map(str, numbers))} |")
    for good in (True, False):
        own = [case for case in listed if case.good is good]
        counts = Counter(case.verdict for case in own)
        numbers = [counts[word] for word in ("right", "another word", "agrees", "refused")]
        lines.append(f"| all {'good' if good else 'spoiled'} | {len(own)} | {' | '.join(map(str, numbers))} |")
    return lines


def main(arguments: Sequence[str] | None = None) -> int:
    """Judge, count and print; 1 if a good result was refused."""
    parser = argparse.ArgumentParser(prog="python3 -m stability.judged", description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("--good", type=int, default=60, metavar="N", help="good results")
    parser.add_argument("--spoiled", type=int, default=150, metavar="N", help="spoiled results")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, metavar="FILE", help="a table of all of them, .csv")
    parser.add_argument("--data", type=Path, metavar="DIR", help="write the results that the tests judge, and end")
    options = parser.parse_args(arguments)
    if program() is None:
        print("there is no ccx: apt install calculix-ccx, or name it in CCX; nothing is judged")
        return 0
    if options.data is not None:
        write_data(options.data)
        return 0
    listed = cases(options.good, options.spoiled, options.seed)
    print("\n".join(table(listed)))
    if options.out is not None:
        with options.out.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(["kind", "element", "change", "good", "word", "verdict"])
            for case in listed:
                row = [case.deck.kind, case.deck.element, case.change.name, case.good]
                writer.writerow([*row, case.judgement.word, case.verdict])
    return int(any(case.verdict == "refused" for case in listed))


if __name__ == "__main__":
    sys.exit(main())
