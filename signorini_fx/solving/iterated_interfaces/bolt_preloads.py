"""Sections across bolts that are shortened, by a given length or until a force goes through them.

The section need not be flat: it may consist of any facets, here of those closest to a plane.  What is beyond it jumps
against what is before it, see ``loads.initial_strains``.  In a load step in which forces tighten sections the
shortenings are found at which these forces go through them: the forces N(s) grow with the shortenings s, and are linear
in them while no contact point changes its state.  The contact problem is solved for one s after the other, by the
method of C. G. Broyden, Math. Comp. 19 (1965) 577-593, which for one section is that of secants.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem, la
from dolfinx import mesh as dmesh

from signorini_fx.algebra.algorithms.task import Start
from signorini_fx.algebra.contact.nodal_vectors import Nodal
from signorini_fx.errors import SceneError
from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.assembly.mesh_entities import facet_nodes, node_positions
from signorini_fx.mechanics.effects.preload import Preload
from signorini_fx.mechanics.loads.initial_strains import Jump
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.records import Finding, Status
from signorini_fx.results.contact_figures import section_forces
from signorini_fx.results.mechanics import SolidBody
from signorini_fx.solving.iterated_interfaces.protocol import Interface, LoadStepEnd, LoadStepStart
from signorini_fx.tuned import (
    CERTIFICATE_TOLERANCE,
    DIGITS_OF_FILES,
    LEFT_BY_SOLVES,
    SAME_LENGTH,
    SHORTENED_AT_MOST,
    SHORTENED_IF_LOOSE,
)

_Floats = npt.NDArray[np.float64]
_Flags = npt.NDArray[np.bool_]
# Contact problems for one load step.
_MOST_PROBLEMS = 30


class BoltPreloads(Interface):
    """Those of a scene, see ``Interface``."""

    def jumps(self, tagged: TaggedMesh, space: fem.FunctionSpace) -> list[Jump]:
        """Raises a ``SceneError`` where there is no such section, or it does not cut the body."""
        return [_jump(path, entry, self.statement, tagged, space) for path, entry in self.entries.items()]

    def solve(self, step: LoadStepStart) -> LoadStepEnd:
        model, task, start = step.model, step.task, step.start
        place, newton = start.place, task.newton
        loads = _tightened(model, place)
        of_all = [k for k, load in enumerate(model.applied) if isinstance(load.entry, Preload)]
        numbers = [of_all.index(k) for k in loads]
        wanted = np.array([entry.force_at(model.statement, place) for entry in loads.values()], dtype=np.float64)
        previous = np.array(_shortenings(model, place))
        # Shortenings s, and ``slope``, length per force: Broyden's approximation of the inverse of dN/ds, empty until
        # every section holds some force; ``last`` are s and N of the iterate before.
        s = np.where(previous > 0, previous, wanted / model.scales.stiffness(model.scales.size))
        slope, last, best = np.empty((0, 0)), (s, s), np.inf
        for _ in range(_MOST_PROBLEMS):
            model = _with_shortenings(model, place, s)
            start, begun = replace(start, factors=model.factors(place)), newton.checkpoint()
            outcome, force = step.solved(model, start).outcome, np.zeros_like(s)
            if outcome.status is Status.CONVERGED:
                y = model.from_rest(task.rest, outcome.displacement())
                forces = [row.force for row in section_forces(model.statement, model.tagged, y, place)]
                force = np.array(forces)[numbers]
            elif slope.size or outcome.status is Status.NOT_HELD:  # whatever the shortenings are
                return LoadStepEnd(model, start, outcome)
            missing = float(np.abs(wanted - force).max() / wanted.max())
            task.history.add(
                f"sections shortened by {', '.join(f'{entry:.6g}' for entry in s)}: forces miss {missing:.1e}"
            )
            if missing <= LEFT_BY_SOLVES or best / 2 <= missing <= CERTIFICATE_TOLERANCE:
                return LoadStepEnd(model, start, outcome)
            if outcome.status is Status.CONVERGED:
                start = start.begin_from(outcome.problem.sets, outcome.newton.multipliers())
            else:
                newton.restore(begun)
            slack = force <= CERTIFICATE_TOLERANCE * wanted
            if not slope.size and slack.any():
                if s[slack].max() > model.scales.size:
                    loose = [*loads.values()][int(np.argmax(slack * s))]
                    return LoadStepEnd(
                        model, start, replace(outcome, status=Status.OPEN), reason=_loose(model, loose, start)
                    )
                s = np.where(slack, SHORTENED_IF_LOOSE * s, s)
                continue
            if not slope.size:  # as if the forces were proportional to the shortenings
                slope = np.diag(np.minimum(s / force, SHORTENED_AT_MOST * s / wanted))
            else:
                ds, dn = s - last[0], force - last[1]
                slope = slope + np.outer(ds - slope @ dn, ds @ slope) / (ds @ slope @ dn)
            best, last = min(best, missing), (s, force)
            s = s + slope @ (wanted - force)
        return LoadStepEnd(model, start, replace(outcome, status=Status.OUTER_MAX_ITERATIONS))

    def stored(self, model: SolidBody, step: float) -> dict[str, Any]:
        """The shortenings that forces have led to."""
        return {"shortenings": _shortenings(model, step)}

    def recalled(self, model: SolidBody, step: float, figures: Mapping[str, Any]) -> SolidBody:
        return _with_shortenings(model, step, figures["shortenings"])


# The name by which ``Statement.interfaces`` finds the class of a file.
Kind = BoltPreloads


def _tightened(model: SolidBody, step: float) -> dict[int, Preload]:
    """The loads that are sections which forces tighten at a place, by their numbers."""
    entries = {k: load.entry for k, load in enumerate(model.applied) if isinstance(load.entry, Preload)}
    return {k: entry for k, entry in entries.items() if entry.force_at(model.statement, step) is not None}


def _shortenings(model: SolidBody, step: float) -> list[float]:
    """Those that forces have led to at a place, in the order of ``_tightened``, length."""
    return [model.applied[k].factor(step) for k in _tightened(model, step)]


def _loose(model: SolidBody, entry: Preload, start: Start) -> Finding:
    """What to say of a section that is shortened by more than the size of the body, without any force."""
    when = f"load step {start.step + 1}: " if model.statement.several_steps else ""
    message = (
        f"{when}{entry.name}: no force goes through it even if it is shortened by the size of "
        "the body: a part that it pulls at comes loose, or never meets what it is to clamp; check the gaps and "
        "the contacts of both parts"
    )
    return Finding("warning", "preload", message)


def _with_shortenings(model: SolidBody, step: float, lengths: Sequence[float] | Nodal) -> SolidBody:
    """The same with shortenings that were found at a place; nothing is assembled again."""
    shortened = zip(_tightened(model, step).values(), lengths, strict=True)
    tight = {id(entry): entry.tightened(step, float(s)) for entry, s in shortened}
    changed = {
        key: tuple(tight.get(id(entry), entry) for entry in entries)
        for key, entries in model.statement.effects.items()
        if any(id(entry) in tight for entry in entries)
    }
    statement, applied = model.statement.changed(**changed), list(model.applied)
    for k, load in enumerate(applied):
        if isinstance(load.entry, Preload):
            entry = tight.get(id(load.entry), load.entry)
            applied[k] = replace(load, entry=entry, factor=partial(entry.shortening_at, statement))
    return replace(model, statement=statement, applied=tuple(applied))


def _jump(path: str, effect: Preload, statement: Any, tagged: TaggedMesh, space: fem.FunctionSpace) -> Jump:
    """The cells beyond a section, and its nodes; collective."""
    mesh, dim = tagged.mesh, tagged.dimension
    of_cells, corners = space.dofmap.list, compat.geometry_cells(mesh)
    middle = mesh.geometry.x[corners, :dim].mean(axis=1)
    inside: _Flags = np.ones(len(middle), dtype=bool)
    nodes: _Flags = np.zeros(len(node_positions(space)), dtype=bool)
    key = "section"
    if effect.section is not None:
        facets = _inner_facets(effect.section, path, tagged)
        nodes = _marked(space, facet_nodes(space, facets).ravel())
        point, axis = _plane(space, nodes, tagged, path)
    else:
        key = "point"
        point, axis = np.array(effect.point), np.array(effect.axis)
        axis = axis / np.linalg.norm(axis)
        if effect.region is not None:
            inside[:] = False
            inside[tagged.cells(effect.region)] = True
    beyond = (middle - point) @ axis > -SAME_LENGTH * tagged.size
    if effect.section is None:
        nodes = _marked(space, of_cells[inside & beyond].ravel()) & _marked(space, of_cells[inside & ~beyond].ravel())
    touching = nodes[of_cells].any(axis=1)
    far_nodes, near_nodes = (_marked(space, of_cells[touching & side].ravel()) for side in (beyond, ~beyond))
    where = "the mesh" if effect.region is None else f"region {effect.region!r}"
    for wrong, reason in (
        (not parallel.any_rank(mesh.comm, bool(nodes.any())), f"the plane does not cut {where}"),
        (bool((touching & ~inside).any()), f"cells outside {where} share nodes with the section: move it"),
        (bool((far_nodes & near_nodes & ~nodes).any()), "the section ends inside the body: it must cut it through"),
    ):
        if parallel.any_rank(mesh.comm, wrong):
            raise SceneError([(f"{path}.{key}", reason)])
    cells = np.flatnonzero(touching & beyond).astype(np.int32)
    axis = np.append(axis, np.zeros(space.dofmap.index_map_bs - dim))  # nothing moves around the axis of a body
    return Jump(path, effect, partial(effect.shortening_at, statement), axis, nodes, cells)


def _inner_facets(name: str, path: str, tagged: TaggedMesh) -> npt.NDArray[np.int32]:
    """The facets inside the mesh with a name, those of this rank."""
    mesh = tagged.mesh
    if name not in tagged.boundaries:
        boundary_names = ", ".join(sorted(tagged.boundaries)) or "none"
        raise SceneError([(f"{path}.section", f"the mesh has no facets {name!r}; it has: {boundary_names}")])
    mesh.topology.create_connectivity(mesh.topology.dim - 1, mesh.topology.dim)
    tags = tagged.boundaries[name]
    tagged_facets = tagged.facet_tags.indices[np.isin(tagged.facet_tags.values, tags)]
    inner_facets = np.setdiff1d(tagged_facets, dmesh.exterior_facet_indices(mesh.topology)).astype(np.int32)
    if not parallel.any_rank(mesh.comm, inner_facets.size > 0):
        raise SceneError([(f"{path}.section", f"{name!r} has no facets inside the mesh: it is on its boundary")])
    return inner_facets


def _plane(space: fem.FunctionSpace, nodes: _Flags, tagged: TaggedMesh, path: str) -> tuple[_Floats, _Floats]:
    """A point and the unit normal of the plane through nodes."""
    comm, owned = space.mesh.comm, space.dofmap.index_map.size_local
    x = node_positions(space)[:owned, : tagged.dimension][nodes[:owned]]
    sums = parallel.global_sum(comm, np.append(x.sum(axis=0), len(x)))
    point = sums[:-1] / sums[-1]
    spread, directions = np.linalg.eigh(parallel.global_sum(comm, (x - point).T @ (x - point)))
    if np.sqrt(max(spread[0], 0.0) / sums[-1]) > DIGITS_OF_FILES * tagged.size:
        raise SceneError([(f"{path}.section", "its facets are not in one plane: give point and axis instead")])
    return point, directions[:, 0]


def _marked(space: fem.FunctionSpace, nodes: npt.NDArray[np.int32]) -> _Flags:
    """Which nodes of this rank, ghosts included, any rank has named."""
    mark = la.vector(space.dofmap.index_map, 1, dtype=np.int32)
    mark.array[nodes] = 1
    mark.scatter_reverse(la.InsertMode.add)
    mark.scatter_forward()
    return np.asarray(mark.array > 0)
