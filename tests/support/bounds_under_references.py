"""Random scenes of all kinds that have guaranteed bounds, under solutions on finer meshes.

    ./env python3 tests/support/bounds_under_references.py [ROUNDS] [FIRST] [KIND ...]

draws one scene of each kind a round and prints its bound over its true error, what refuses a bound, and what the finer
solution says against the bounds; then a table of kinds, the rows of ``docs/evidence/bounds_under_references.csv``.
Solutions that the elements have exactly count beside the others: their errors are round-off, and the bound what it
allows for that.
"""

import csv
import signal
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np

sys.path += [str(Path(__file__).resolve().parents[2]), str(Path(__file__).resolve().parents[1] / "bounds")]

import bounds_of_pairs
import bounds_on_shapes
import error_bounds
import graded_scenes
import heated_scenes
import loaded_scenes
import tightened_scenes
from scenes import alone
from test_bounds_of_mixed_elements import effectivity as of_mixed_elements

from signorini_fx.errors import SignoriniError
from signorini_fx.scenes.reading import parse_scene

# Seconds after which a scene is given up: its finer mesh costs more than it tells.
LONGEST = 300
# Bounds that are a smaller share of the solution are those of round-off, and the solution is exact.
ROUND_OFF = 1e-6
# Kinds draw other scenes with the same number: they are this far apart.
APART = 1000
# Bound over true error, the bound relative to the solution, and what is refuted; or why there is no bound.
Found = str | tuple[float, float, list[str]]


def unchanged(scene, seed):
    """The scene."""
    return scene


def with_materials(scene, seed):
    """The scene with two or three materials."""
    return error_bounds.of_several_materials(scene, seed)


def judged(kind: str, change: Callable, seed: int) -> Found:
    """Of a study of ``heated_scenes``, whose scene is changed: bound over true error, and what is refuted."""
    found = heated_scenes.effectivity(kind, seed, change)
    return found if isinstance(found, str) else (found[0], found[1].relative, found[2])


def of_pair(seed: int, **kinds) -> Found:
    """Of two bodies in the plane, whose contact force is compared with that of the finer solution, too."""
    found = bounds_of_pairs.effectivity(bounds_of_pairs.drawn(seed, **kinds))
    if isinstance(found, str):
        return found
    ratio, relative, _, bound, solution, reference = found
    return ratio, relative, bounds_of_pairs.refuted(solution, reference, bound)


def on_shape_in_space(seed: int) -> Found:
    """Of a body in space on a foundation with a shape."""
    found = bounds_on_shapes.effectivity(3, seed)
    return found if isinstance(found, str) else (found[0], found[-1].relative, [])


def on_driven_foundation(dimension: int, seed: int) -> Found:
    """Of a body on a rigid one that a force drives."""
    found = bounds_on_shapes.effectivity(dimension, seed, "driven")
    return found if isinstance(found, str) else (found[0], found[-1].relative, [])


def on_quadrilaterals(seed: int) -> Found:
    """Of parallelograms of degree 2."""
    found = error_bounds.effectivity_on_quadrilaterals(seed)
    return found if isinstance(found, str) else (found[0], found[-1].relative, [])


def mixed(seed: int) -> Found:
    """Of the mixed element."""
    found = of_mixed_elements(seed)
    return found if isinstance(found, str) else (found[0], found[-1].relative, [])


def of_revolution(seed: int) -> Found:
    """Of a body of revolution, which has no bound."""
    scene = error_bounds.drawn(seed)
    fields = {key: getattr(scene, key) for key in scene.model_fields_set - {"displacement", "material"}}
    material = [one.model_copy(update={"hypothesis": "axisymmetric"}) for one in scene.material]
    fields["traction"] = [{"boundary": "top", "y": -1e-3 * float(scene.material[0].young)}]
    try:
        bound = alone(parse_scene(fields | {"material": material})).error_bound
    except SignoriniError as failed:
        return str(failed).splitlines()[0]
    return bound if isinstance(bound, str) else (float("nan"), 1.0, ["a bound of a body of revolution"])


def _loads() -> dict[str, Callable[[int], Found]]:
    """Other loads, each in the plane, in space and of two bodies where it is drawn there."""
    kinds: dict[str, Callable[[int], Found]] = {}
    for load in ("gravity", "force", "rotation", "fluid", "springs", "varying springs", "preload", "pressed springs"):
        change = partial(loaded_scenes.loaded, kind=load)
        for study in ("plane", "space") if load == "pressed springs" else ("plane", "pair", "space"):
            kinds[f"{load}: {study}"] = partial(judged, study, change)
    facing = partial(loaded_scenes.loaded, kind="facing springs")
    kinds["facing springs: pair"] = partial(judged, "pair", facing)
    kinds["facing springs: two bodies in space"] = partial(judged, "spatial-pair", facing)
    return kinds


KINDS: dict[str, Callable[[int], Found]] = {
    "one body: plane": partial(judged, "plane", unchanged),
    "several materials: plane": partial(judged, "plane", with_materials),
    "pressed: plane": partial(judged, "pressed", unchanged),
    "one body: space": partial(judged, "space", unchanged),
    "quadrilaterals of degree 2: plane": on_quadrilaterals,
    "mixed element: plane": mixed,
    "body of revolution": of_revolution,
    "foundation with a shape: plane": partial(judged, "shape", unchanged),
    "foundation with a shape: space": on_shape_in_space,
    "rigid body driven by a force: plane": partial(on_driven_foundation, 2),
    "rigid body driven by a force: space": partial(on_driven_foundation, 3),
    "unilateral, degree 1: pair": of_pair,
    "unilateral, degree 2: pair": partial(of_pair, degree=2),
    "bilateral: pair": partial(of_pair, kind="bilateral"),
    "bonded: pair": partial(of_pair, kind="bonded"),
    "two bodies: space": partial(judged, "spatial-pair", unchanged),
    "heat: plane": partial(judged, "plane", heated_scenes.heated),
    "heat: pair": partial(judged, "pair", heated_scenes.heated),
    "heat: space": partial(judged, "space", heated_scenes.heated),
    "heat: two bodies in space": partial(judged, "spatial-pair", heated_scenes.heated),
    "heat: foundation with a shape": partial(judged, "shape", heated_scenes.heated),
    "graded: plane": partial(judged, "plane", graded_scenes.graded),
    "graded: pressed": partial(judged, "pressed", graded_scenes.graded),
    "graded: pair": partial(judged, "pair", graded_scenes.graded),
    "graded: space": partial(judged, "space", graded_scenes.graded),
    "graded, heat: plane": partial(judged, "plane", graded_scenes.graded_and_heated),
    **_loads(),
    **{
        f"tightened by a force, {family}": partial(judged, study, change)
        for family, (study, change) in tightened_scenes.FAMILIES.items()
    },
}


@dataclass
class Tally:
    """What was found of a kind.

    Attributes:
        drawn: number of scenes.
        exact: number of those that are solved exactly.
        ratios: bounds over true errors.
        refused: how often a name refuses a bound.
        refuted: numbers of the scenes whose finer solution refutes a bound.
    """

    drawn: int = 0
    exact: int = 0
    ratios: list[float] = field(default_factory=list)
    refused: Counter[str] = field(default_factory=Counter)
    refuted: list[int] = field(default_factory=list)

    def row(self, kind: str) -> list[object]:
        """Of the table."""
        found = self.ratios
        shown = [f"{value:.3f}" for value in (min(found), np.median(found), max(found))] if found else ["", "", ""]
        why = "; ".join(f"{count}: {name}" for name, count in self.refused.most_common())
        return [kind, self.drawn, len(found), self.exact, *shown, " ".join(map(str, self.refuted)), why]


def _given_up(*_: object) -> None:
    raise SignoriniError(f"given up after {LONGEST} s")


def measured(kind: str, seed: int) -> Found:
    """One scene, of which LONGEST seconds are taken at most."""
    signal.signal(signal.SIGALRM, _given_up)
    signal.alarm(LONGEST)
    try:
        return KINDS[kind](seed)
    except Exception as failed:  # a random scene that ends otherwise is a finding, the others go on
        return f"{type(failed).__name__}: {str(failed).splitlines()[0]}"
    finally:
        signal.alarm(0)


def main(rounds: int, first: int, kinds: Sequence[str]) -> None:
    """Print each scene, and the table."""
    tallies: defaultdict[str, Tally] = defaultdict(Tally)
    for number, kind in product(range(first, first + rounds), kinds):
        seed = number + APART * list(KINDS).index(kind)
        begin, tally = time.process_time(), tallies[kind]
        found = measured(kind, seed)
        tally.drawn += 1
        if isinstance(found, str):
            tally.refused[found] += 1
            said = found
        else:
            ratio, relative, wrong = found
            if exact := relative < ROUND_OFF:
                tally.exact += 1
            else:
                tally.ratios.append(ratio)
            if wrong or not ratio >= 1:
                tally.refuted.append(seed)
            said = f"{ratio:.3f} bound {relative:.1e}{' exact' * exact} {wrong or ''}"
        print(f"{seed} {kind}: {said} ({time.process_time() - begin:.0f} s)", flush=True)
    writer = csv.writer(sys.stdout)
    writer.writerow(["kind", "scenes", "bounded", "exact", "least", "median", "largest", "refuted", "refused"])
    writer.writerows(tallies[kind].row(kind) for kind in kinds)
    for space in (False, True):
        found = [ratio for kind in kinds if ("space" in kind) == space for ratio in tallies[kind].ratios]
        if found:
            print(f"{'in space' if space else 'in the plane'}: {len(found)}, median {np.median(found):.2f}")


if __name__ == "__main__":
    main(
        int(sys.argv[1]) if len(sys.argv) > 1 else 3,
        int(sys.argv[2]) if len(sys.argv) > 2 else 0,
        sys.argv[3:] or list(KINDS),
    )
