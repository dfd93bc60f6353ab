"""What a scene uses, by the names under which the objects that it consists of say what they refuse.

So far ``Scene.kinematics.refuses`` is asked.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from signorini_fx.scene.effect import Contradictions

Path = tuple[str | int, ...]


def features(scene: Any) -> Iterator[tuple[str, Path]]:
    """Each with the key that asks for it."""
    solver, accuracy = scene.solver, scene.accuracy
    for name, path, used in (
        ("mixed element", ("element", "volumetric"), scene.element.volumetric == "mixed"),
        ("krylov", ("solver", "linear_algebra"), solver.linear_algebra == "krylov"),
        ("nested iteration", ("solver", "levels"), solver.levels > 1),
        ("requested bound", ("solver", "error_bound"), solver.error_bound),
        ("requested accuracy", ("accuracy",), accuracy is not None),
        ("accuracy of a figure", ("accuracy", "of"), accuracy is not None and accuracy.of != "energy"),
        ("local refinement", ("accuracy", "refinement"), accuracy is not None and accuracy.refinement != "uniform"),
    ):
        if used:
            yield name, path
    for kind, entries in scene.effects.items():
        for number, entry in enumerate(entries):
            for name, key in (
                ("orthotropic material", "orthotropic"),
                ("prescribed rotation", "rotation"),
            ):
                if getattr(entry, key, None) is not None:
                    yield name, (kind, number, key)
            for name, keys in entry.features:
                yield name, (kind, number, *keys)


def refused_features(scene: Any) -> Contradictions:
    """Those that its kinematics refuse, and why."""
    refuses = scene.kinematics.refuses
    return ((path, refuses[name]) for name, path in features(scene) if name in refuses)
