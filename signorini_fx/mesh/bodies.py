"""Several bodies, each with a mesh of its own, turned and moved to its place in one mesh of several pieces."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.body
import numpy as np
import numpy.typing as npt
from dolfinx import mesh as dmesh
from mpi4py import MPI

from signorini_fx import compat, parallel
from signorini_fx.errors import MeshError, SceneError
from signorini_fx.mesh.distribution import Tagged, distributed
from signorini_fx.scene.model import Body
from signorini_fx.scene.rigid_shape import turning

Tags = int | tuple[int, ...]


def together(bodies: Sequence[Body], meshes: Sequence[Any], comm: MPI.Comm) -> dict[str, Any]:
    """The bodies as one mesh, whose cells are distributed anew; collective.

    The cells of a body are the region of its name.  Its boundaries and regions have their names with that of the body
    and a dot before them; names that one body alone has are also names without.

    Args:
        bodies: their names and places.
        meshes: the ``TaggedMesh`` of each.
        comm: the ranks that share them.

    Returns:
        What a ``TaggedMesh`` consists of, by name.

    Raises:
        SceneError: keys that do not fit the dimension of the meshes.
        MeshError: the meshes have different kinds of cells.
    """
    _check_alike(bodies, meshes)
    points = [_placed(body, tagged) for body, tagged in zip(bodies, meshes, strict=True)]
    numbers = _numbers(comm, [tagged.mesh for tagged in meshes])
    dim, kind = meshes[0].dimension, meshes[0].mesh.ufl_domain()
    firsts = {
        dim: _first_tags([tagged.regions for tagged in meshes]),
        dim - 1: _first_tags([tagged.boundaries for tagged in meshes]),
    }
    owned: dict[int, list[Tagged]] = {dim: [], dim - 1: []}
    for place, (tagged, numbered) in enumerate(zip(meshes, numbers, strict=True)):
        cells = _with_nodes(tagged.mesh, dim, np.arange(_count(tagged.mesh, dim), dtype=np.int32), numbered)
        parts = np.zeros(len(cells), dtype=np.int32)
        if tagged.cell_tags is not None:
            own = tagged.cell_tags.indices < len(parts)
            parts[tagged.cell_tags.indices[own]] = tagged.cell_tags.values[own]
        owned[dim].append(Tagged(cells, parts + firsts[dim][place]))
        own = tagged.facet_tags.indices < _count(tagged.mesh, dim - 1)
        facets = _with_nodes(tagged.mesh, dim - 1, tagged.facet_tags.indices[own], numbered)
        owned[dim - 1].append(Tagged(facets, tagged.facet_tags.values[own] + firsts[dim - 1][place]))
    gathered = {
        one: Tagged(
            np.concatenate([tags.nodes for tags in several]),
            np.concatenate([tags.tags for tags in several]).astype(np.int32),
        )
        for one, several in owned.items()
    }
    mesh, found = distributed(comm, kind, gathered[dim].nodes, np.concatenate(points), gathered)
    names = [body.name for body in bodies]
    boundaries = _named(names, [tagged.boundaries for tagged in meshes], firsts[dim - 1])
    regions = _named(names, [tagged.regions for tagged in meshes], firsts[dim])
    for name, tagged, first in zip(names, meshes, firsts[dim], strict=True):
        regions[name] = (first, *(first + tag for tag in sorted(set(_flat(tagged.regions)))))
    origin = {"bodies": {name: dict(tagged.origin) for name, tagged in zip(names, meshes, strict=True)}}
    note = "; ".join(f"{name}: {tagged.note}" for name, tagged in zip(names, meshes, strict=True) if tagged.note)
    return {
        "mesh": mesh,
        "facet_tags": found[dim - 1],
        "boundaries": boundaries,
        "cell_tags": found[dim],
        "regions": regions,
        "origin": origin,
        "note": note,
    }


def _check_alike(bodies: Sequence[Body], meshes: Sequence[Any]) -> None:
    """Check that the meshes can be one, and that the bodies are placed in their dimension."""
    kinds = []
    for tagged in meshes:
        curved = ", curved" if compat.geometry_degree(tagged.mesh) > 1 else ""
        kinds.append(f"{tagged.mesh.topology.cell_name()} cells{curved}")
    for body, kind in zip(bodies, kinds, strict=True):
        if kind != kinds[0]:
            raise MeshError(
                f"body {body.name!r} has {kind}, body {bodies[0].name!r} {kinds[0]}: the elements of a mesh are all of "
                "one kind, so give all bodies the same"
            )
    dim = meshes[0].dimension
    problems = []
    for place, body in enumerate(bodies):
        where = "the mesh is plane" if dim == 2 else "the mesh is in space"
        for key in ("shift", "pivot"):
            given = getattr(body, key)
            if given is not None and len(given) != dim:
                problems.append((f"body[{place}].{key}", f"{where}: give {dim} numbers, not {len(given)}"))
        if body.rotation is not None and isinstance(body.rotation, tuple) != (dim == 3):
            wanted = "an angle" if dim == 2 else "three numbers, the axis"
            problems.append((f"body[{place}].rotation", f"{where}: give {wanted}"))
    if problems:
        raise SceneError(problems)


def _placed(body: Body, tagged: Any) -> npt.NDArray[np.float64]:
    """The owned nodes of a body where it is, shape (n, d)."""
    mesh, dim = tagged.mesh, tagged.dimension
    x = mesh.geometry.x[: mesh.geometry.index_map().size_local, :dim].astype(np.float64)
    pivot = np.array(body.pivot or (0.0,) * dim)
    turned = x if body.rotation is None else (x - pivot) @ turning(body.rotation, dim).T + pivot
    return np.asarray(turned + np.array(body.shift or (0.0,) * dim))


def _numbers(comm: MPI.Comm, meshes: Sequence[dmesh.Mesh]) -> list[npt.NDArray[np.int64]]:
    """The number of each node of this rank, ghosts included, if every rank brings its nodes of one mesh after the
    other; collective.
    """
    maps = [mesh.geometry.index_map() for mesh in meshes]
    counts = parallel.gather_rows(comm, np.array([[one.size_local for one in maps]], dtype=np.int64))
    ends = np.cumsum(counts, axis=0)
    starts = (np.cumsum(counts.ravel()) - counts.ravel()).reshape(counts.shape)
    found = []
    for place, one in enumerate(maps):
        before = np.arange(one.size_local + one.num_ghosts, dtype=np.int32)
        named = np.asarray(one.local_to_global(before), dtype=np.int64)
        rank = np.searchsorted(ends[:, place], named, side="right")
        found.append(named - (ends - counts)[rank, place] + starts[rank, place])
    return found


def _count(mesh: dmesh.Mesh, dim: int) -> int:
    """How many entities this rank owns."""
    mesh.topology.create_entities(dim)
    return int(mesh.topology.index_map(dim).size_local)


def _with_nodes(
    mesh: dmesh.Mesh, dim: int, entities: npt.NDArray[np.int32], numbers: npt.NDArray[np.int64]
) -> npt.NDArray[np.int64]:
    """The numbers of the nodes of entities, in dolfinx's order, shape (n, nodes of each)."""
    if dim == mesh.topology.dim:
        return np.asarray(numbers[compat.geometry_cells(mesh)[entities]])
    mesh.topology.create_connectivity(dim, mesh.topology.dim)
    width = len(compat.geometry_element(mesh).entity_closure_dofs[dim][0])
    if not entities.size:  # dolfinx divides by their number
        return np.empty((0, width), dtype=np.int64)
    return np.asarray(numbers[dmesh.entities_to_geometry(mesh, dim, entities)])


def _flat(names: Mapping[str, Tags]) -> list[int]:
    return [tag for tags in names.values() for tag in ((tags,) if isinstance(tags, int) else tags)]


def _first_tags(names: Sequence[Mapping[str, Tags]]) -> list[int]:
    """What is added to the tags of each body, so that all of them differ and none is zero."""
    found = [1]
    for one in names:
        found.append(found[-1] + max(_flat(one), default=0) + 1)
    return found[:-1]


def _named(bodies: Sequence[str], names: Sequence[Mapping[str, Tags]], firsts: Sequence[int]) -> dict[str, Tags]:
    """The names of all bodies with their new tags; those that are the name of a body are left to it."""
    count = Counter(name for one in names for name in one)
    found: dict[str, Tags] = {}
    for body, one, first in zip(bodies, names, firsts, strict=True):
        for name, tags in one.items():
            moved = tags + first if isinstance(tags, int) else tuple(tag + first for tag in tags)
            found[f"{body}.{name}"] = moved
            if count[name] == 1 and name not in bodies:
                found[name] = moved
    return found
