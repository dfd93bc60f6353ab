"""From a scene and its mesh to a ``Model``: the forms that the scene needs, each assembled once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.arrays import Array, Indices, Value
from signorini_fx.errors import FormError, MeshError, SceneError, together
from signorini_fx.extensions import is_of_package
from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.assembly.mesh_entities import facet_vertices
from signorini_fx.mechanics.assembly.pieces import find_pieces
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.kinematics import Kinematics
from signorini_fx.mechanics.loads.initial_strains import holds, jump_loads, jumps_in
from signorini_fx.mechanics.loads.load_vectors import (
    FormCoefficients,
    applied_load,
    compile_resistance,
    driving_load,
    finite,
    load_groups,
)
from signorini_fx.mechanics.loads.supports import Supports, at_rest, check_overlap
from signorini_fx.mechanics.materials.trial import check_materials
from signorini_fx.mechanics.mesh.tagged import TaggedMesh, check_fits
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.obstacles.foundations_on_points import Foundations
from signorini_fx.mechanics.obstacles.scene_contact import foundations_of, with_chosen_sides
from signorini_fx.mechanics.rigid.rigid_bodies import RigidBodies
from signorini_fx.mechanics.statement.effect import Effect, InitialStrain, Load, Resistance
from signorini_fx.mechanics.statement.expressions import Expression, sample
from signorini_fx.mechanics.statement.rigid_shape import Placement
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.records import Timings
from signorini_fx.tuned import LARGEST_MULTIGRID_POISSON, LARGEST_NUMBER, SAME_NUMBER

M = TypeVar("M", bound=Model)


def prepare(
    statement: Statement, tagged: TaggedMesh, timings: Timings, *, path_step: float = 0
) -> Model:
    """Compile and assemble loads and contact boundaries, and check all data that depend on the
    mesh; collective.

    Args:
        statement: the entries of the scene.
        tagged: the mesh with its names.
        timings: where the times of the phases are added.
        path_step: place in the lists of factors for which foundations are placed; -1: before any
            has moved.

    Raises:
        SceneError: a file is missing on some rank; or, all together, the errors that only the mesh
            reveals: boundaries and regions that do not exist or are empty, contact where the
            displacement is prescribed, expressions that are not finite.
        MeshError: the cells of the mesh are not connected.
    """
    _refuse_missing_files(statement, tagged.mesh.comm)
    if statement.kinematics.out_of_section and tagged.dimension == tagged.mesh.geometry.dim == 2:
        from signorini_fx.mechanics.mesh.tagged import embed_in_3d

        tagged = replace(tagged, mesh=embed_in_3d(tagged.mesh))
    facets = boundary_facets(statement, tagged)
    _try_functions(statement, tagged)
    try:
        return _prepared(statement, tagged, facets, timings, path_step)
    except FormError as error:  # of a foundation
        raise SceneError(error.problems) from None


def _refuse_missing_files(statement: Statement, comm: MPI.Comm) -> None:
    """Raise an error on all ranks if some rank does not find a file of the scene.

    Otherwise that rank would raise it alone, and the others would wait for it.
    """
    if comm.size == 1:
        return
    places = statement.listed()
    places += [
        (f"contact[{k}].foundation", effect.surface) for k, effect in enumerate(statement.contact)
    ]
    files = [
        (path, file)
        for path, entry in places
        if isinstance(file := getattr(entry, "file", None), Path)
    ]
    missing = [
        (path, f"{file}: rank {comm.rank} has no such file")
        for path, file in files
        if not file.is_file()
    ]
    parallel.raise_together(comm, SceneError(missing) if missing else None)


def _prepared(
    statement: Statement,
    tagged: TaggedMesh,
    facets: dict[str, Indices],
    timings: Timings,
    path_step: float,
) -> Model:
    check_materials(statement.material)
    kinematics = statement.kinematics_in(tagged.dimension)
    _check_measure(kinematics, tagged)
    space = fem.functionspace(
        tagged.mesh, ("Lagrange", statement.element.degree, (tagged.mesh.geometry.dim,))
    )
    on = FormCoefficients(statement, tagged, space)
    elastic, _ = together(lambda: on.elastic, partial(check_fits, statement, tagged))
    if statement.sides[1] is not None:
        chosen = with_chosen_sides(statement, tagged, facets, elastic.lame[1])
        at_rest = tuple(contact.at_rest for contact in chosen.contact)
        statement = chosen if at_rest == chosen.contact else chosen.changed(contact=at_rest)
        on = replace(on, statement=statement)
    pieces = find_pieces(tagged.mesh)
    if statement.bodies:
        pieces = pieces.of_bodies(
            tagged.mesh.comm, {name: tagged.cells(name) for name in statement.bodies}
        )
    elif pieces.count > 1 and tagged.regions:
        owned = tagged.mesh.topology.index_map(tagged.dimension).size_local
        regions = {name: tagged.cells(name) for name in tagged.regions}
        pieces = pieces.of_regions(
            tagged.mesh.comm, {name: own[own < owned] for name, own in regions.items()}
        )
    with timings.phase("compile"):
        acting = [effect for effect in statement.of(Resistance) if effect.acts]
        resistance = compile_resistance(
            acting, on, ufl.TrialFunction(space), ufl.TestFunction(space)
        )
        loaded = _loaded(on, facets, path_step)
    resists = () if resistance is None else (resistance,)
    # ``compressible`` tests nu <= most by the Lame parameters, with a tolerance for their
    # round-off; in plane stress nu is that of the equivalent plane strain.
    most = LARGEST_MULTIGRID_POISSON * (1 + SAME_NUMBER)
    lame = [material.lame for material in statement.material]
    model = Model(
        space=space,
        terms=lambda: (*on.elastic.compiled(space), *resists),
        resists=resists,
        pieces=pieces,
        boundary=None,
        settings=statement.solver,
        kinematics=kinematics,
        compressible=all((1 - 2 * most) * first <= 2 * most * second for first, second in lame),
        elastic=on.elastic,
        modulus=statement.young,
        title=statement.title,
        forces_at=statement.forces_at,
        path=statement.path,
        contacts=statement.contacts_at(path_step),
        materials=statement.material,
        tagged=tagged,
        rigid=RigidBodies(statement.rigid_bodies, kinematics, tagged.size),
        **loaded,
    )
    applied = [*model.applied]
    with timings.phase("assemble"):
        contact = contact_of(model) if model.contacts else {}
        boundary: ContactBoundary | None = contact.get("boundary")
        applied += [
            driving_load(model.rigid, k, statement, space) for k in range(len(model.rigid.bodies))
        ]
        if jumps := jumps_in(statement, tagged, space):
            bonded = [k for k, effect in enumerate(model.contacts) if effect.bonded]
            held = partial(
                holds, fixed=model.fixed, turned=model.turned, boundary=boundary, bonded=bonded
            )
            applied += jump_loads(jumps, space, on.elastic, held)
    together(
        partial(_check_finite, statement, tagged, all(map(finite, applied))),
        lambda: None if boundary is None else check_overlap(statement, boundary, facets, tagged),
    )
    for step in range(
        1, statement.steps if any(effect.friction.timed for effect in model.contacts) else 1
    ):
        # Find errors of later steps before the first step.
        _foundations(replace(model, contacts=statement.contacts_at(step))).friction()
    return replace(model, applied=tuple(applied), **contact)


def _loaded(on: FormCoefficients, facets: dict[str, Indices], step: float) -> dict[str, Any]:
    """Return the fields of a ``Model`` that follow from the loads, and from the supports at a place
    in the lists of factors; collective.
    """
    supports = Supports.of(on.statement, on.space, facets, on.tagged, step)
    test = ufl.TestFunction(on.space)
    groups = load_groups(on.statement, on.statement.loads).items()
    return {
        "bcs": [support for _, support in supports.conditions],
        "turned": supports.turned,
        "fixed": supports.fixed,
        "supports": supports.conditions,
        "held": on.statement.held_at(step),
        "coefficients": on,
        "density": lambda: on.density * on.around,
        "applied": tuple(
            applied_load(group, loads, on, test, supports.at) for group, loads in groups
        ),
    }


def _check_measure(kinematics: Kinematics, tagged: TaggedMesh) -> None:
    """Raise an error if the measure of kinematics of another package is negative somewhere, or zero
    everywhere; collective.
    """
    if is_of_package(type(kinematics)):
        return
    x = tagged.mesh.geometry.x[:, : tagged.dimension].astype(np.float64)
    measures = np.broadcast_to(kinematics.measure(x.T), len(x))
    most = parallel.largest(tagged.mesh.comm, measures, 0.0)
    if parallel.any_rank(tagged.mesh.comm, measures < -SAME_NUMBER * most) or most <= 0:
        raise SceneError.at(
            "material.hypothesis", f"measure of {kinematics.words!r} is not positive"
        )


def placed(model: M, step: float) -> M:
    """Return the model with the contacts and supports at a place in the lists of factors; the model
    itself if nothing changes; collective.
    """
    statement = model.statement
    contacts = statement.contacts_at(step)
    if model.boundary is None:
        return model
    if statement.held_at(step) != model.held:
        return _with_supports(model, step, contacts)
    if contacts is statement.contact:
        return model
    moved = replace(model, contacts=contacts)
    if not any(effect.moves or effect.gap_timed for effect in contacts):
        return replace(moved, law=law_of(moved))
    return replace(moved, **contact_of(moved))


def held_at(model: M, step: float) -> M:
    """Return the model with the supports at a place in the lists of factors and unchanged contacts;
    the model itself if no support changes; collective.
    """
    if model.statement.held_at(step) == model.held:
        return model
    return _with_supports(model, step, model.contacts)


def _with_supports(model: M, step: float, contacts: tuple[Any, ...]) -> M:
    """Return the model with the supports at a place in the lists of factors and with these
    contacts; collective.
    """
    on = model.coefficients
    assert on is not None
    loaded = _loaded(on, boundary_facets(on.statement, on.tagged), step)
    further = model.applied[len(load_groups(on.statement, on.statement.loads)) :]
    fields = loaded | {"applied": (*loaded["applied"], *further), "contacts": contacts}
    changed = replace(model, **fields, of_body={})
    return replace(changed, **contact_of(changed))


def contact_of(model: Model) -> dict[str, Any]:
    """Return the fields of a ``Model`` that follow from its contacts: the contact points, pairs,
    gaps and friction law; collective.
    """
    foundations = _foundations(model)
    rests = at_rest(model.space, model.supports, model.turned, model.fixed)
    shapes = foundations.shapes()
    boundary = model.rigid.on(foundations.boundary(shapes, model.fixed, rests, model.turned))
    of_model = model.settings, model.scales
    data, law = foundations.problem(boundary, foundations.data(shapes), *of_model)
    return {"boundary": boundary, "pairs": foundations.pairs, "data": data, "law": law}


def law_of(model: Model) -> PointFriction | None:
    """Return the friction law of a model at its contact points; collective."""
    assert model.boundary is not None
    return _foundations(model).law(model.boundary, model.scales.modulus)


def with_gap_and_friction(model: M, statement: Statement) -> M:
    """Return the model with the gaps and friction of another statement at the same contact points;
    axes of friction are not changed; collective.
    """
    assert model.boundary is not None
    changed = replace(model.with_statement(statement), contacts=statement.contact)
    foundations = _foundations(changed)
    of_foundations = foundations.data(foundations.shapes())
    of_model = changed.settings, changed.scales
    data, law = foundations.problem(model.boundary, of_foundations, *of_model)
    return replace(changed, data=data, law=law)


def placements(contacts: Sequence[Any]) -> tuple[Placement | None, ...]:
    """Return the translation and rotation of the foundation of each contact; None if it cannot
    move.
    """
    return tuple(getattr(contact.foundation, "placement", None) for contact in contacts)


def moved_since(model: Model, earlier: Sequence[Placement | None]) -> Array | None:
    """Return how far foundations have moved at the contact points since some earlier placements,
    length, shape (n, d).

    Returns None if no foundation moves.
    """
    boundary = model.boundary
    dimension = model.tagged.dimension
    moving = [k for k, contact in enumerate(model.contacts) if contact.moves]
    if boundary is None or not moving:
        return None
    moved = np.zeros_like(boundary.x)
    for number in moving:
        shape = model.contacts[number].foundation
        placement = earlier[number]
        assert placement is not None
        on_part = boundary.part == number
        moved[on_part, :dimension] = shape.moved_from(
            shape.placed_as(placement), boundary.x[on_part, :dimension]
        )
    return moved


def _foundations(model: Model) -> Foundations:
    """Return the contacts of a model, ready to be evaluated at contact points."""
    facets = model.tagged.facets
    contacts = model.contacts
    on = [facets(effect.boundary) for effect in contacts]
    masters = {
        number: facets(effect.against)
        for number, effect in enumerate(contacts)
        if effect.against is not None
    }
    names = [f"contact {effect.boundary}" for effect in contacts]
    entries = foundations_of(contacts, model.kinematics, on, masters)
    return Foundations(model.space, entries, on, names, masters)


def boundary_facets(statement: Statement, tagged: TaggedMesh) -> dict[str, Indices]:
    """Return the facets of every boundary that the scene names, by name.

    Raises:
        SceneError: boundaries or regions are missing, empty, inside the body or in two contacts;
            all errors together.
    """
    facets = {}
    problems = []
    for path, effect in statement.listed():
        for key, name in (
            ("boundary", effect.where),
            ("against", getattr(effect, "against", None)),
        ):
            if name is None:
                continue
            try:
                indices = tagged.facets(name)
            except MeshError as error:
                problems.append((f"{path}.{key}", str(error)))
                continue
            facets[name] = indices
            outside = int(parallel.total(tagged.mesh.comm, indices.size))
            if outside == 0:
                problems.append((f"{path}.{key}", f"boundary {name!r} has no exterior facets"))
            elif inside := tagged.inside(name):
                which = (
                    f"{inside} of the {inside + outside} facets of boundary {name!r} are "
                    "inside of the body"
                )
                cure = (
                    "give exterior facets alone; two bodies that touch there need their own nodes"
                )
                problems.append((f"{path}.{key}", f"{which}: {cure}"))
    sides = [
        (f"contact[{index}].{key}", name)
        for key in ("boundary", "against")
        for index, effect in enumerate(statement.contact)
        if (name := getattr(effect, key)) is not None and not (key == "against" and effect.itself)
    ]
    for (earlier_path, earlier_name), (path, name) in combinations(sides, 2):
        # Several bodies may touch the same facets, if the contact points are on these bodies.
        carries = path.endswith("against") and earlier_path.endswith("against")
        if carries or name not in facets or earlier_name not in facets:
            continue
        shared = np.intersect1d(facets[name], facets[earlier_name]).size
        if total := parallel.global_sum(tagged.mesh.comm, np.array(shared)):
            shared_with = f"shares {total} facets with the contact boundary {earlier_name!r}"
            cure = (
                "a facet can touch one other only; bodies that touch need names of the mesh "
                "file or [[body]]"
            )
            problems.append((path, f"boundary {name!r} {shared_with}: {cure}"))
    for path, effect in statement.listed():
        region = getattr(effect, "region", None)
        if region is not None and region not in tagged.regions:
            known = ", ".join(sorted(tagged.regions)) or "none"
            problems.append(
                (f"{path}.region", f"the mesh has no region {region!r}; its regions are: {known}")
            )
    if problems:
        raise SceneError(problems)
    return facets


# --- values, tried on all ranks before anything waits for another rank ----------------------------


def _try_functions(statement: Statement, tagged: TaggedMesh) -> None:
    """Evaluate all functions and tables of the scene once, and raise an error on all ranks if one
    fails or returns a number out of range.

    Otherwise one rank would fail alone later, while the others wait.
    """
    problems = []
    for path, entry in statement.listed():
        strains = isinstance(entry, InitialStrain)
        for step in range(statement.steps if strains and entry.timed else 1):
            for key, value in _values(entry.at_time(statement.time_at(step)) if strains else entry):
                problems += _problems(f"{path}.{key}", value, entry, tagged)
    parallel.raise_together(
        tagged.mesh.comm, SceneError(list(dict.fromkeys(problems))) if problems else None
    )


def _problems(
    path: str, value: Value | None, entry: Effect, tagged: TaggedMesh
) -> list[tuple[str, str]]:
    """Return pairs of key and message for what is wrong with a value on this rank; empty if it is
    right.
    """
    strains = isinstance(entry, InitialStrain)
    resists = isinstance(entry, Resistance)
    given = callable(value) and not isinstance(value, Expression)
    if value is None or hasattr(value, "ufl_shape") or not (strains or resists or given):
        return []
    # Outside of its region an expression is multiplied by zero.
    x = (
        tagged.mesh.geometry.x.T.astype(np.float64)
        if strains and not given
        else _points_of(entry, tagged)
    )
    try:
        values = sample(value, x) if x.size else np.zeros(0)
    except SceneError as error:  # of a table
        return error.problems
    except Exception as failure:  # whatever a function of a user raises
        return [(path, f"cannot be evaluated at points of shape (3, {x.shape[1]}): {failure}")]
    if strains and not (np.abs(values) <= LARGEST_NUMBER).all():
        return [(path, f"must be a number up to {LARGEST_NUMBER:g} at all nodes of the mesh")]
    if resists and not ((values >= 0) & (values <= LARGEST_NUMBER)).all():
        return [
            (path, f"must be a number from 0 to {LARGEST_NUMBER:g} everywhere on {entry.where!r}")
        ]
    return []


def _check_finite(statement: Statement, tagged: TaggedMesh, right: bool) -> None:
    """Raise an error that names a load or prescribed displacement that is not ``right``, which is
    whether those of this rank are finite; collective.
    """
    comm = tagged.mesh.comm
    if not parallel.any_rank(comm, not right):
        return
    most = f"a number of at most {LARGEST_NUMBER:g}"
    error: SceneError | None = None
    for path, entry in statement.listed():
        if not isinstance(entry, Load):
            continue
        x = _points_of(entry, tagged)
        for key, value in statement.now(entry, 0)[1].given.items():
            if hasattr(value, "ufl_shape") or not x.size:
                continue
            values = sample(value, x)
            bad = np.flatnonzero(~(np.abs(values) <= LARGEST_NUMBER))
            if bad.size and error is None:
                at = ", ".join(f"{c:g}" for c in x[: tagged.dimension, bad[0]])
                error = SceneError.at(
                    f"{path}.{key}", f"is {values[bad[0]]:g} at ({at}); it must be {most}"
                )
    parallel.raise_together(comm, error)
    key = f"displacement, {statement.forces_at}"
    raise SceneError.at(key, f"a value is not {most} somewhere on its boundary or in the body")


def _values(entry: Effect) -> Iterator[tuple[str, Value | None]]:
    """Yield key and value of the data of an entry that may depend on the position."""
    yield from getattr(entry, "given", {}).items()
    yield "grading", getattr(entry, "grading", None)
    for key in ("direction", "second"):  # axes of a material
        axis = getattr(entry, key, None)
        for component in axis if isinstance(axis, tuple) else ():
            yield key, component


def _points_of(entry: Effect, tagged: TaggedMesh) -> Array:
    """Return points at which to try the functions of an entry, shape (3, n).

    They are the nodes of its region; the vertices and midpoints of the facets of its boundary; or
    all nodes of the mesh.
    """
    mesh = tagged.mesh
    boundary = getattr(entry, "boundary", None)
    region = getattr(entry, "region", None)
    if boundary is not None:
        corners = facet_vertices(mesh, tagged.facets(boundary))
        return np.concatenate((corners.reshape(-1, 3), corners.mean(axis=1))).T
    if region is not None:
        return np.ascontiguousarray(
            mesh.geometry.x[np.unique(compat.geometry_cells(mesh)[tagged.cells(region)])].T
        )
    return np.ascontiguousarray(mesh.geometry.x.T)
