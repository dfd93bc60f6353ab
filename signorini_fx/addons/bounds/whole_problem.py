"""A problem that several ranks share as a whole on the first of them, where it is bounded as on one rank.

The stress in equilibrium is one system of the whole mesh, and where two bodies meet cells are divided and matched by
rules that look at both sides.  So what a bound reads of the model is gathered: the mesh, the displacement, moduli, and
both sides of contact.  The first rank needs the memory and the time that one rank alone needs; the others wait.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI

from signorini_fx.addons.bounds.arrays import Array, Ints
from signorini_fx.addons.bounds.bounded_scene import refuse_unknown, values_of
from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.assembly.averages import Averages
from signorini_fx.mechanics.assembly.mesh_entities import facet_entities
from signorini_fx.mechanics.assembly.pieces import find_pieces
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.elasticity.cellwise_stiffness import CellwiseStiffness
from signorini_fx.mechanics.mesh.distribution import distributed, domain
from signorini_fx.mechanics.mesh.files.arrays import combinations
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.obstacles.paired_points import PairedSide, PairedSides
from signorini_fx.mechanics.pairs.overlap_quadrature import Overlap

T = TypeVar("T")
# Arrays of all ranks by their names.
_Rows = dict[str, Any]

_OF_POINTS = (
    "gap",
    "u_n",
    "u_t",
    "pressure",
    "shear",
    "bound",
    "in_contact",
    "direction",
    "bilateral",
    "slip_length",
    "xi",
)
_OF_OVERLAP = ("slave", "master", "at", "over", "weight")


@dataclass(frozen=True)
class WholeProblem:
    """A model with its solution on one rank, as far as bounds read them.

    Attributes:
        model: its mesh, displacements, moduli, contact boundary and pairs are those of all ranks; forms, supports and
            load vectors are not.
        contact: the contact points of all ranks; None: there are none.
        displacement: of all ranks.
        before: that of the load step before; None: there is none.
        rows: of each cell of the mesh its number among those of all ranks, one rank after the other, shape (cells,).
    """

    model: Model
    contact: ContactState | None
    displacement: fem.Function
    before: fem.Function | None
    rows: Ints

    def by_ranks(self, values: Array) -> Array:
        """Values of the cells, shape (cells, ...), in the order of ``rows``."""
        ordered = np.empty_like(values)
        ordered[self.rows] = values
        return ordered


def of_whole(
    model: Model,
    y: fem.Function,
    contact: ContactState | None,
    before: fem.Function | None,
    prove: Callable[[WholeProblem], T],
) -> T:
    """What ``prove`` says of the whole problem on the first rank, on all ranks; collective.

    Args:
        model: the model.
        y: the displacement.
        contact: the contact nodes; None: they are not known.
        before: see ``error_bound``.
        prove: gives what can be sent to the other ranks.

    Raises:
        Refused: the scene has something that the proof does not know, or ``prove`` has raised it.
        Exception: what was raised on any rank, the same on all of them.
    """
    comm = model.comm
    if comm.size == 1:
        return prove(WholeProblem(model, contact, y, before, np.arange(_owned_cells(model.tagged))))
    refuse_unknown(model)
    numbers, local, failure = _numbers_of_cells(model.tagged), _Rows(), None
    try:
        local = _rows_of(model, contact, numbers)
        local |= {name: _of_nodes(f) for name, f in (("y", y), ("before", before)) if f is not None}
    except Exception as error:
        failure = error
    parallel.raise_together(comm, failure)
    rows = {name: parallel.rows_on_root(comm, values) for name, values in local.items()}
    averages = None if contact is None else comm.gather(contact.boundary.averages)
    return parallel.on_root(comm, lambda: prove(_whole(model, contact, rows, averages or [])))


def of_rank(model: Model, values: Array) -> Array:
    """Values of the cells that this rank owns, from those of ``WholeProblem.by_ranks``."""
    cells = model.tagged.mesh.topology.index_map(model.tagged.dimension)
    return values[slice(*cells.local_range)]


def _owned_cells(tagged: TaggedMesh) -> int:
    return int(tagged.mesh.topology.index_map(tagged.dimension).size_local)


def _numbers_of_cells(tagged: TaggedMesh) -> Ints:
    """Of the owned cells, no two the same on all ranks: those of the input of the mesh, so that their order does not
    depend on the ranks, or those that the ranks give them; collective.
    """
    owned, numbers = _owned_cells(tagged), compat.input_numbers(tagged.mesh)
    if parallel.any_rank(tagged.mesh.comm, len(numbers) < owned):  # as of a part of another mesh
        return np.arange(*tagged.mesh.topology.index_map(tagged.dimension).local_range)
    return numbers[:owned]


def _of_nodes(f: fem.Function) -> Array:
    """Values at the owned nodes, shape (nodes, d)."""
    dofmap = f.function_space.dofmap
    return np.asarray(f.x.array.reshape(-1, dofmap.index_map_bs)[: dofmap.index_map.size_local])


def _rows_of(model: Model, contact: ContactState | None, numbers: Ints) -> _Rows:
    """What this rank sends, but for displacements.

    Args:
        model: the model.
        contact: its points.
        numbers: of the owned cells, shape (cells,).
    """
    tagged, mesh, space = model.tagged, model.tagged.mesh, model.space
    owned, geometry = np.arange(len(numbers)), mesh.geometry
    names, points = np.asarray(geometry.input_global_indices), geometry.index_map().size_local
    dofs = space.dofmap.list[owned]  # of a rank without cells as wide as of others
    rows: _Rows = {
        "number": numbers,
        "corners": names[compat.geometry_cells(mesh)[owned]],
        "nodes": space.dofmap.index_map.local_to_global(dofs.ravel()).reshape(dofs.shape),
        "name of point": names[:points],
        "point": geometry.x[:points, : tagged.dimension],
    }

    def of_facets(facets: Any) -> Ints:
        """The numbers of their cells, and theirs in these, shape (f, 2)."""
        cells, side = facet_entities(mesh, facets).T
        return np.column_stack((numbers[cells], side))

    rows |= {f"boundary {name}": of_facets(tagged.facets(name)) for name in tagged.boundaries}
    for name in tagged.regions:
        cells = tagged.cells(name)
        rows[f"region {name}"] = numbers[cells[cells < len(owned)]]
    lame, stiffness = model.elastic.lame, model.elastic.stiffness
    rows |= {f"moduli {k}": values_of(part, owned) for k, part in enumerate(lame) if part is not None}
    if stiffness is not None:
        free = stiffness.of_free_strain
        rows["stiffness"] = stiffness.at_cells[owned]
        rows["free"] = free.x.array.reshape(-1, *free.ufl_shape)[free.function_space.dofmap.list[owned, 0]]
    for k, pair in model.pairs.items():
        for side, facets in (("slave", pair.slave.facets), ("master", pair.master.facets)):
            rows[f"{side} {k}"] = of_facets(facets)
        for kind, overlap in (("overlap", pair.coupling.overlap), ("still", pair.coupling.still)):
            rows |= {f"{kind} {k} {name}": getattr(overlap, name) for name in _OF_OVERLAP}
    if contact is not None:
        rows |= {f"state {name}": getattr(contact, name) for name in _OF_POINTS}
        rows |= _rows_of_boundary(contact.boundary)
    return rows


def _rows_of_boundary(boundary: ContactBoundary) -> _Rows:
    """See ``_rows_of``; what may be None says what it then means."""
    names = ("x", "weight", "normal", "part", "free", "segments", "global_nodes", "without_area")
    rows = {f"points {name}": getattr(boundary, name) for name in names}
    axes, along = boundary.axes, boundary.pushing
    rows["axes"] = np.tile(np.eye(boundary.x.shape[1]), (boundary.size, 1, 1)) if axes is None else axes
    rows["pushing"] = boundary.normal if along is None else along
    if boundary.moving is not None:
        rows["modes"] = boundary.moving.modes
    return rows


def _whole(
    model: Model, contact: ContactState | None, rows: Mapping[str, Any], averages: list[Averages | None]
) -> WholeProblem:
    """The problem of all ranks, on the first one.

    Args:
        model: the model of this rank.
        contact: its points.
        rows: those of all ranks.
        averages: of the contact points of each rank.
    """
    order = np.argsort(rows["number"])
    mesh, element = _mesh(model.tagged, rows, order), model.space.element.basix_element
    dim, of_row = mesh.topology.dim, np.asarray(mesh.topology.original_cell_index)
    space = fem.functionspace(mesh, ("Lagrange", element.degree, (mesh.geometry.dim,)))
    gathered: Ints = order[of_row]
    places: Ints = np.empty(space.dofmap.index_map.size_global, dtype=np.int64)
    places[rows["nodes"][gathered]] = space.dofmap.list
    mesh.topology.create_connectivity(dim, dim - 1)
    sides = mesh.topology.connectivity(dim, dim - 1).array.reshape(len(order), -1)

    def cells(numbers: Ints) -> Ints:
        """From their numbers."""
        return np.asarray(np.argsort(of_row)[np.searchsorted(rows["number"], numbers, sorter=order)])

    def facets(name: str) -> Any:
        return sides[cells(rows[name][:, 0]), rows[name][:, 1]]

    tagged = _named(
        mesh,
        model.tagged,
        {name: facets(f"boundary {name}") for name in model.tagged.boundaries},
        {name: cells(rows[f"region {name}"]) for name in model.tagged.regions},
    )

    def displacement(name: str) -> fem.Function:
        f = fem.Function(space)
        f.x.array.reshape(-1, space.dofmap.index_map_bs)[places] = rows[name]
        return f

    def of_cells(values: Array) -> fem.Function:
        f = fem.Function(fem.functionspace(mesh, ("DG", 0, values.shape[1:])))
        flat = values[gathered].reshape(len(values), -1)
        f.x.array.reshape(flat.shape)[f.function_space.dofmap.list[:, 0]] = flat
        return f

    def pair(k: int, sides_of_rank: PairedSides) -> PairedSides:
        """With all facets in the order of its surfaces, and all of the overlap."""
        slave, master = (
            PairedSide(side.surface, places[side.nodes], facets(f"{name} {k}"))
            for name, side in (("slave", sides_of_rank.slave), ("master", sides_of_rank.master))
        )
        overlap, still = (
            Overlap(*(rows[f"{kind} {k} {name}"] for name in _OF_OVERLAP)) for kind in ("overlap", "still")
        )
        coupling = replace(sides_of_rank.coupling, overlap=overlap, still=still)
        return replace(sides_of_rank, slave=slave, master=master, coupling=coupling)

    first, second = (of_cells(rows[name]) if name in rows else None for name in ("moduli 0", "moduli 1"))
    stiffness = CellwiseStiffness(of_cells(rows["stiffness"]), of_cells(rows["free"])) if "free" in rows else None
    state = None if contact is None else _state(contact, rows, places, averages)
    gathered_model = replace(
        model,
        space=space,
        tagged=tagged,
        pieces=find_pieces(mesh),
        elastic=replace(model.elastic, lame=(first, second), stiffness=stiffness),
        pairs={k: pair(k, sides_of_rank) for k, sides_of_rank in model.pairs.items()},
        boundary=None if state is None else state.boundary,
        of_body={},
        of_contact={},
    )
    before = displacement("before") if "before" in rows else None
    return WholeProblem(gathered_model, state, displacement("y"), before, gathered)


def _mesh(tagged: TaggedMesh, rows: Mapping[str, Any], order: Ints) -> dmesh.Mesh:
    """The mesh of all ranks.

    Args:
        tagged: that of this rank.
        rows: see ``_whole``.
        order: of the cells, shape (cells,).
    """
    element, names = compat.geometry_element(tagged.mesh), rows["name of point"]
    at = np.argsort(names)
    corners = np.searchsorted(names, rows["corners"][order], sorter=at)
    kind = domain(tagged.mesh.topology.cell_name(), element.degree, tagged.dimension, int(element.lagrange_variant))
    return distributed(MPI.COMM_SELF, kind, corners, rows["point"][at], {})[0]


def _named(
    mesh: dmesh.Mesh, origin: TaggedMesh, boundaries: Mapping[str, Ints], regions: Mapping[str, Ints]
) -> TaggedMesh:
    """The same with names: ranks may number the tags of forms each for themselves.

    Args:
        mesh: of all ranks.
        origin: the mesh of this rank.
        boundaries: facets by name.
        regions: cells by name.
    """
    dim = mesh.topology.dim
    facets = np.unique(np.concatenate([np.empty(0, dtype=np.int64), *boundaries.values()]))
    of_side, sides = combinations(
        {name: np.searchsorted(facets, np.sort(part)) for name, part in boundaries.items()}, len(facets)
    )
    of_cell, parts = combinations(
        {name: np.sort(part) for name, part in regions.items()}, mesh.topology.index_map(dim).size_local
    )
    cells = np.flatnonzero(of_cell)
    tags = [
        dmesh.meshtags(mesh, entity_dim, entities.astype(np.int32), values.astype(np.int32))
        for entity_dim, entities, values in ((dim - 1, facets, of_side), (dim, cells, of_cell[cells]))
    ]
    return replace(
        origin, mesh=mesh, facet_tags=tags[0], boundaries=sides, cell_tags=tags[1] if parts else None, regions=parts
    )


def _state(
    contact: ContactState, rows: Mapping[str, Any], places: Ints, averages: list[Averages | None]
) -> ContactState:
    """The contact points of all ranks.

    Args:
        contact: those of this rank.
        rows: see ``_whole``.
        places: the node of each global number, shape (nodes,).
        averages: see ``_whole``.
    """
    boundary, moving = contact.boundary, contact.boundary.moving
    unchanged = {name: rows[f"points {name}"] for name in ("x", "weight", "normal", "part", "free")}
    segments, without = rows["points segments"].copy(), rows["points without_area"].copy()
    segments[:, 1:], without[:, 1] = places[segments[:, 1:]], places[without[:, 1]]
    nodes = places[rows["points global_nodes"]]
    present = [part for part in averages if part is not None]
    joined = Averages.joined(present) if present else None
    points = replace(
        boundary,
        **unchanged,
        comm=MPI.COMM_SELF,
        nodes=nodes.astype(np.int32),
        segments=segments,
        global_nodes=nodes,
        without_area=without,
        axes=rows["axes"],
        pushing=rows["pushing"],
        moving=None if moving is None else replace(moving, modes=rows["modes"]),
        averages=None if joined is None else replace(joined, nodes=places[joined.nodes]),
    )
    values = {name: rows[f"state {name}"] for name in _OF_POINTS}
    return replace(contact, **values, points=points.points, boundary=points)
