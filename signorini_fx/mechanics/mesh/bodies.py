"""Several bodies, each with a mesh of its own, turned and moved to its place in one mesh of several pieces."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
import numpy as np
import numpy.typing as npt
from dolfinx import mesh as dmesh
from mpi4py import MPI

from signorini_fx.errors import MeshError, SceneError
from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.mesh.distribution import Tagged, distributed, domain
from signorini_fx.mechanics.mesh.shares_of_ranks import shares
from signorini_fx.mechanics.statement.mesh_sources import Body, TaggedMeshBase
from signorini_fx.mechanics.statement.rigid_shape import turning

Tags = int | tuple[int, ...]
Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class BodyArrays:
    """What this rank brings of the mesh of one body, in plain arrays.

    Attributes:
        kind: dolfinx's word for the cells, degree and variant of their geometry.
        points: nodes, shape (n, d).
        cells: cells by the numbers of their nodes, which go through the ranks; a tag is 0 where there is none.
        facets: facets with tags.
        middles: of the cells, shape (m, d).
        corners: nodes of the facets, corners first, shape (f, nodes of each, d).
        boundaries, regions, origin, note, subdivided, left_out: those of the ``TaggedMesh``.
    """

    kind: tuple[str, int, int]
    points: Floats
    cells: Tagged
    facets: Tagged
    middles: Floats
    corners: Floats
    boundaries: Mapping[str, Tags]
    regions: Mapping[str, Tags]
    origin: Mapping[str, Any]
    note: str
    subdivided: bool
    left_out: Mapping[str, int]

    @property
    def dimension(self) -> int:
        """2 in the plane, 3 in space."""
        return self.points.shape[1]

    @property
    def without_cells(self) -> BodyArrays:
        """The same kind and names, and nothing that this rank brings."""
        cells, facets = (Tagged(entities.nodes[:0], entities.tags[:0]) for entities in (self.cells, self.facets))
        empty = {name: getattr(self, name)[:0] for name in ("points", "middles", "corners")}
        return replace(self, cells=cells, facets=facets, **empty)

    def placed(self, body: Body) -> BodyArrays:
        """The body where the scene puts it."""
        pivot = np.array(body.pivot or (0.0,) * self.dimension)
        shift = np.array(body.shift or (0.0,) * self.dimension)

        def place(x: Floats) -> Floats:
            turned = x if body.rotation is None else (x - pivot) @ turning(body.rotation, self.dimension).T + pivot
            return np.asarray(turned + shift)

        return replace(self, points=place(self.points), middles=place(self.middles), corners=place(self.corners))


def together(
    bodies: Sequence[Body], load: Callable[[int, MPI.Comm], Any], touching: Collection[str], comm: MPI.Comm
) -> dict[str, Any]:
    """Several bodies as one mesh, whose cells are cut into equal shares for the ranks; collective.

    The cells of a body are the region of its name.  Its boundaries and regions have their names with that of the body
    and a dot before them; names that one body alone has are also names without.

    The first rank makes the mesh of each body alone, so that the order of the cells does not depend on the ranks, and
    checkpoints fit any number of them.  Meshes of the caller stay on their ranks.

    Args:
        bodies: their names, meshes and places.
        load: makes the ``TaggedMesh`` of the body with a number on some ranks.
        touching: the names of the boundaries that are in contact, near which cells stay together.
        comm: the ranks that share the mesh.

    Returns:
        What a ``TaggedMesh`` consists of, by name.

    Raises:
        SceneError: keys that do not fit the dimension of the meshes, or errors of a mesh, which name the body.
        MeshError: the meshes have different kinds of cells, or a mesh cannot be made.
    """
    meshes = [_of_body(number, body, load, comm) for number, body in enumerate(bodies)]
    _check_alike(bodies, meshes)
    meshes = [arrays.placed(body) for body, arrays in zip(bodies, meshes, strict=True)]
    dim = meshes[0].dimension
    firsts = {
        dim: _first_tags([arrays.regions for arrays in meshes]),
        dim - 1: _first_tags([arrays.boundaries for arrays in meshes]),
    }
    renumber = _renumbering(comm, [len(arrays.points) for arrays in meshes])
    gathered = {
        dim: _one_after_the_other([arrays.cells for arrays in meshes], renumber, firsts[dim]),
        dim - 1: _one_after_the_other([arrays.facets for arrays in meshes], renumber, firsts[dim - 1]),
    }
    names = [body.name for body in bodies]
    boundaries = _named(names, [arrays.boundaries for arrays in meshes], firsts[dim - 1])
    regions = _named(names, [arrays.regions for arrays in meshes], firsts[dim])
    for name, arrays, first in zip(names, meshes, firsts[dim], strict=True):
        regions[name] = (first, *(first + tag for tag in sorted(set(_flat(arrays.regions)))))
    owner = None
    if comm.size > 1:
        wanted = _flat({name: boundaries[name] for name in touching if name in boundaries})
        sides = np.concatenate([arrays.corners for arrays in meshes])[np.isin(gathered[dim - 1].tags, wanted)]
        owner = shares(comm, np.concatenate([arrays.middles for arrays in meshes]), sides)
    word, degree, variant = meshes[0].kind
    points = np.concatenate([arrays.points for arrays in meshes])
    joint_domain = domain(word, degree, dim, variant)
    mesh, new_tags = distributed(comm, joint_domain, gathered[dim].nodes, points, gathered, owner)
    return {
        "mesh": mesh,
        "facet_tags": new_tags[dim - 1],
        "boundaries": boundaries,
        "cell_tags": new_tags[dim],
        "regions": regions,
        "origin": {"bodies": {name: dict(arrays.origin) for name, arrays in zip(names, meshes, strict=True)}},
        "note": "; ".join(f"{name}: {arrays.note}" for name, arrays in zip(names, meshes, strict=True) if arrays.note),
        "subdivided": any(arrays.subdivided for arrays in meshes),
        "left_out": _named(names, [arrays.left_out for arrays in meshes], [0] * len(meshes)),
    }


def _of_body(number: int, body: Body, load: Callable[[int, MPI.Comm], Any], comm: MPI.Comm) -> BodyArrays:
    """The mesh of one of several bodies; errors name it."""
    made: list[BodyArrays] = []

    def make() -> BodyArrays:
        made.append(_arrays(load(number, MPI.COMM_SELF)))
        return made[0].without_cells

    try:
        if isinstance(body.mesh, TaggedMeshBase):
            return _arrays(load(number, comm))
        arrays = parallel.on_root(comm, make)
    except SceneError as error:
        raise SceneError(in_body(number, error.problems)) from None
    except MeshError as error:
        raise MeshError(f"body {body.name!r}: {error}") from None
    return made[0] if made else arrays


def in_body(number: int, problems: Iterable[tuple[str, str]]) -> list[tuple[str, str]]:
    """Problems of the mesh of one of several bodies: the keys of its table ``mesh`` are those of the body."""
    return [(f"body[{number}].{path}" if path.startswith("mesh") else path, message) for path, message in problems]


def _arrays(tagged: Any) -> BodyArrays:
    """What this rank owns of a ``TaggedMesh``; collective on its ranks."""
    mesh, dim = tagged.mesh, tagged.dimension
    x = mesh.geometry.x[:, :dim].astype(np.float64)
    element, nodes = compat.geometry_element(mesh), mesh.geometry.index_map()
    numbers = nodes.local_to_global(np.arange(nodes.size_local + nodes.num_ghosts, dtype=np.int32))
    cells = compat.geometry_cells(mesh)[: _count(mesh, dim)]
    regions = np.zeros(len(cells), dtype=np.int32)
    if tagged.cell_tags is not None:
        owned = tagged.cell_tags.indices < len(cells)
        regions[tagged.cell_tags.indices[owned]] = tagged.cell_tags.values[owned]
    owned = tagged.facet_tags.indices < _count(mesh, dim - 1)
    facets = _nodes_of_facets(mesh, tagged.facet_tags.indices[owned])
    return BodyArrays(
        kind=(mesh.topology.cell_name(), element.degree, int(element.lagrange_variant)),
        points=x[: nodes.size_local],
        cells=Tagged(numbers[cells], regions),
        facets=Tagged(numbers[facets], tagged.facet_tags.values[owned]),
        middles=x[cells].mean(axis=1),
        corners=x[facets],
        boundaries=dict(tagged.boundaries),
        regions=dict(tagged.regions),
        origin=dict(tagged.origin),
        note=tagged.note,
        subdivided=tagged.subdivided,
        left_out=dict(tagged.left_out),
    )


def _check_alike(bodies: Sequence[Body], meshes: Sequence[BodyArrays]) -> None:
    """Check that the meshes can be one, and that the bodies are placed in their dimension."""
    kinds = [f"{arrays.kind[0]} cells{', curved' if arrays.kind[1] > 1 else ''}" for arrays in meshes]
    for body, kind in zip(bodies, kinds, strict=True):
        if kind != kinds[0]:
            raise MeshError(
                f"body {body.name!r} has {kind}, body {bodies[0].name!r} {kinds[0]}: the elements of a mesh are all of "
                "one kind, so give all bodies the same, generators by their parameter 'cell'"
            )
    dim = meshes[0].dimension
    problems = []
    for number, body in enumerate(bodies):
        where = "the mesh is plane" if dim == 2 else "the mesh is in space"
        for key in ("shift", "pivot"):
            vector = getattr(body, key)
            if vector is not None and len(vector) != dim:
                problems.append((f"body[{number}].{key}", f"{where}: give {dim} numbers, not {len(vector)}"))
        if body.rotation is not None and isinstance(body.rotation, tuple) != (dim == 3):
            wanted = "an angle" if dim == 2 else "three numbers, the axis"
            problems.append((f"body[{number}].rotation", f"{where}: give {wanted}"))
    if problems:
        raise SceneError(problems)


def _renumbering(
    comm: MPI.Comm, counts: Sequence[int]
) -> Callable[[int, npt.NDArray[np.int64]], npt.NDArray[np.int64]]:
    """From a body and numbers of its nodes to their numbers if every rank brings its nodes of one body after the other.

    Args:
        comm: the ranks.
        counts: how many nodes of each body this rank brings.
    """
    all_counts = parallel.gather_rows(comm, np.array([counts], dtype=np.int64))
    ends = np.cumsum(all_counts, axis=0)
    starts = (np.cumsum(all_counts.ravel()) - all_counts.ravel()).reshape(all_counts.shape)

    def renumber(body: int, named: npt.NDArray[np.int64]) -> npt.NDArray[np.int64]:
        rank = np.searchsorted(ends[:, body], named, side="right")
        return np.asarray(named - (ends - all_counts)[rank, body] + starts[rank, body])

    return renumber


def _one_after_the_other(
    entities: Sequence[Tagged],
    renumber: Callable[[int, npt.NDArray[np.int64]], npt.NDArray[np.int64]],
    firsts: Sequence[int],
) -> Tagged:
    """The entities of all bodies with the numbers and the tags that they have together."""
    nodes = [renumber(body, tagged.nodes) for body, tagged in enumerate(entities)]
    tags = [tagged.tags + first for tagged, first in zip(entities, firsts, strict=True)]
    return Tagged(np.concatenate(nodes), np.concatenate(tags).astype(np.int32))


def _count(mesh: dmesh.Mesh, dim: int) -> int:
    """How many entities this rank owns."""
    mesh.topology.create_entities(dim)
    return int(mesh.topology.index_map(dim).size_local)


def _nodes_of_facets(mesh: dmesh.Mesh, facets: npt.NDArray[np.int32]) -> npt.NDArray[np.int32]:
    """The nodes of facets, in dolfinx's order, shape (n, nodes of each)."""
    dim = mesh.topology.dim - 1
    mesh.topology.create_connectivity(dim, dim + 1)
    width = len(compat.geometry_element(mesh).entity_closure_dofs[dim][0])
    if not facets.size:  # dolfinx divides by their number
        return np.empty((0, width), dtype=np.int32)
    return np.asarray(dmesh.entities_to_geometry(mesh, dim, facets))


def _flat(names: Mapping[str, Tags]) -> list[int]:
    return [tag for tags in names.values() for tag in ((tags,) if isinstance(tags, int) else tags)]


def _first_tags(names: Sequence[Mapping[str, Tags]]) -> list[int]:
    """What is added to the tags of each body, so that all of them differ and none is zero."""
    firsts = [1]
    for named in names:
        firsts.append(firsts[-1] + max(_flat(named), default=0) + 1)
    return firsts[:-1]


def _named(bodies: Sequence[str], names: Sequence[Mapping[str, Tags]], firsts: Sequence[int]) -> dict[str, Tags]:
    """The names of all bodies with their new tags; those that are the name of a body are left to it."""
    count = Counter(name for named in names for name in named)
    tags_by_name: dict[str, Tags] = {}
    for body, named, first in zip(bodies, names, firsts, strict=True):
        for name, tags in named.items():
            moved = tags + first if isinstance(tags, int) else tuple(tag + first for tag in tags)
            tags_by_name[f"{body}.{name}"] = moved
            if count[name] == 1 and name not in bodies:
                tags_by_name[name] = moved
    return tags_by_name
