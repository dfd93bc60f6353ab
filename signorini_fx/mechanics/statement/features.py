"""The features that a scene uses, by name, and which of them cannot be combined.

Each feature lists what it refuses, and why: effects in ``Effect.refuses``, the kinematics in
``Kinematics.refuses``, elements and settings here, and derived results (a bound, a proof, a
derivative) where they are computed.  A reason is mathematical, or says that a combination is not
possible *yet*.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from pydantic import BaseModel

from signorini_fx.mechanics.statement.effect import Contradictions, Keys
from signorini_fx.mechanics.statement.expressions import Expression
from signorini_fx.mechanics.statement.rigid_body import MESH_IS
from signorini_fx.mechanics.statement.settings import Accuracy, Target
from signorini_fx.mechanics.statement.statement import Statement

REFUSED_BY_SETTINGS: Mapping[str, Mapping[str, str]] = {
    "mixed element": {
        "krylov": "must not be 'krylov' where element.volumetric = 'mixed': multigrid needs a "
        "positive definite matrix"
    },
    "several bodies": {
        "local refinement": "is not possible for several [[body]], each of which is made anew "
        "with smaller cells: use "
        "'uniform'"
    },
    "no contact": {"requested accuracy": "needs a scene with contact"},
    "mesh that no generator makes": {
        "nested iteration": "needs a mesh from a generator, which can make the coarser ones"
    },
}


def features(statement: Statement) -> Iterator[tuple[str, Keys]]:
    """Yield the name of each feature that a scene uses, with the key that requests it."""
    solver = statement.solver
    accuracy = statement.accuracy
    element = statement.element
    of = None if accuracy is None else accuracy.of
    # Cells of drawings, and of generators, may be made anew instead.
    divides = accuracy is not None and accuracy.refinement == "adaptive" and not statement.remade
    of_contact = of not in (None, "energy") and element.volumetric in ("full", "mixed")
    locking = of_contact and any(material.locks for material in statement.material)
    for name, path, used in (
        (statement.kinematics.words, ("material",), True),
        ("reduced integration", ("element", "volumetric"), element.volumetric == "reduced"),
        ("mixed element", ("element", "volumetric"), element.pressed),
        ("krylov", ("solver", "linear_algebra"), solver.linear_algebra == "krylov"),
        ("nested iteration", ("solver", "levels"), solver.levels > 1),
        ("requested accuracy", ("accuracy",), accuracy is not None),
        ("accuracy of the energy", ("accuracy", "of"), of == "energy"),
        ("accuracy of the zone or the peak", ("accuracy", "of"), of in ("zone", "peak")),
        ("accuracy of contact on cells that lock", ("accuracy", "of"), locking),
        ("local refinement", ("accuracy", "refinement"), divides),
        ("local refinement for contact", ("accuracy", "refinement"), divides and of != "energy"),
        ("statement of an error bound", ("solver", "error_bound"), solver.error_bound),
        ("several bodies", ("body",), bool(statement.bodies)),
        ("no contact", ("contact",), not statement.contact),
        ("mesh that no generator makes", ("mesh",), not statement.generated),
    ):
        if used:
            yield name, path
    for kind, entries in statement.effects.items():
        for number, entry in enumerate(entries):
            for name, keys in entry.features:
                yield name, (kind, number, *keys)


def refused_by(statement: Statement, refuses: Mapping[str, str]) -> Contradictions:
    """Return the features of a scene that are refused, with the key of each and the reason."""
    return ((path, refuses[name]) for name, path in features(statement) if name in refuses)


def refusals(statement: Statement) -> list[Mapping[str, str]]:
    """Return what each feature of a scene refuses, with reasons."""
    declared = {**REFUSED_BY_SETTINGS, statement.kinematics.words: statement.kinematics.refuses}
    for _, entry in statement.listed():
        declared |= entry.refuses
    used = {name for name, _ in features(statement)}
    return [refused for name, refused in declared.items() if name in used]


def divisible(statement: Statement, of: str) -> bool:
    """Return whether no feature refuses local refinement for the error of the quantity ``of``;
    several bodies count as one mesh.
    """
    names = (
        {"local refinement"}
        if of == "energy"
        else {"local refinement", "local refinement for contact"}
    )
    return not any(names & {*refused} for refused in refusals(replace(statement, bodies=())))


def accuracy_refused(statement: Statement, of: Target) -> str:
    """Return why a request for the accuracy of ``of`` would be refused; "" if it would not, or if
    an accuracy is already requested.
    """
    if statement.accuracy is not None:
        return ""
    asked = replace(statement, accuracy=Accuracy(target=0.5, of=of))
    reasons = (reason for path, reason in refused_features(asked) if path[:1] == ("accuracy",))
    return next(reasons, "")


def refused_features(statement: Statement) -> Contradictions:
    """Return the features of a scene that other features of it refuse, with key and reason."""
    return iter(
        dict.fromkeys(
            problem for refused in refusals(statement) for problem in refused_by(statement, refused)
        )
    )


# --- keys that are not allowed in 2D or in 3D: the mesh decides which of the two the scene is ---

_PLANE = MESH_IS[2]
_SPACE = MESH_IS[3]
# The tables whose component z is out of the section of a body that moves there, see
# ``Kinematics.out_of_section``.
_AROUND = ("displacement", "traction", "force", "body_force", "springs")


def dimension_problems(statement: Statement, dimension: int) -> list[tuple[str, str]]:
    """Return every key of a statement that has no meaning on a mesh of this dimension, with the
    reason.
    """
    return [
        *_everywhere(statement, dimension),
        *(_in_the_plane(statement) if dimension == 2 else _in_space(statement)),
    ]


def _everywhere(statement: Statement, dimension: int) -> Iterator[tuple[str, str]]:
    where = MESH_IS[dimension]
    for path, effect in statement.listed():
        for key in effect.vectors:
            vector = getattr(effect, key)
            if vector is not None and len(vector) != dimension:
                yield f"{path}.{key}", f"{where}: give {dimension} numbers, not {len(vector)}"
    for index, material in enumerate(statement.material):
        for path, reason in material.dimension_problems(dimension):
            yield ".".join((f"material[{index}]", *map(str, path))), reason
    for index, effect in enumerate(statement.contact):
        if effect.foundation is not None:
            turns = bool(statement.kinematics.unbalanced[-1])
            for key, reason in effect.foundation.contradictions(dimension, turns=turns):
                yield f"contact[{index}].foundation.{key}", reason


def _in_the_plane(statement: Statement) -> Iterator[tuple[str, str]]:
    for index, effect in enumerate(statement.displacement):
        if effect.axis is not None and not statement.kinematics.out_of_section:
            yield f"displacement[{index}].axis", f"{_PLANE}: a rotation is about x[2]"
    for path, table in _tables(statement.tables, ""):
        if "z" in table.model_fields_set and getattr(table, "z", None) is not None:
            if not statement.kinematics.out_of_section:
                yield f"{path}.z", f"{_PLANE}: there is nothing along x[2]"
            elif path.partition("[")[0] not in _AROUND:
                yield f"{path}.z", f"{_PLANE}: nothing of this kind is along x[2]"
        if getattr(table, "up", None) == "z":
            yield f"{path}.up", f"{_PLANE}: there is nothing along x[2]"
        for name, value in table:
            if isinstance(value, Expression) and value.coordinates > 2:
                yield f"{path}.{name}".lstrip("."), f"{_PLANE}: there is no x[2]"


def _in_space(statement: Statement) -> Iterator[tuple[str, str]]:
    for index, material in enumerate(statement.material):
        if "hypothesis" in material.model_fields_set:
            reason = (
                f"{_SPACE}: plane stress and plane strain have no meaning, leave the hypothesis out"
            )
            yield f"material[{index}].hypothesis", reason
    for index, effect in enumerate(statement.displacement):
        if effect.axis is not None and len(effect.axis) != 3:
            yield f"displacement[{index}].axis", f"{_SPACE}: give 3 numbers, not {len(effect.axis)}"


def _tables(node: object, path: str) -> Iterator[tuple[str, BaseModel]]:
    """Yield all tables of a scene with their paths."""
    if isinstance(node, BaseModel):
        yield path, node
        for name, value in node:
            yield from _tables(value, f"{path}.{name}".lstrip("."))
    elif isinstance(node, list | tuple):
        for index, item in enumerate(node):
            yield from _tables(item, f"{path}[{index}]")
    elif isinstance(node, Mapping):
        for name, item in node.items():
            yield from _tables(item, f"{path}.{name}".lstrip("."))
