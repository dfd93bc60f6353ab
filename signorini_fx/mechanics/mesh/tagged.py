"""Distributed meshes with named boundaries: from a generator in ``meshes/``, from a file, or from
the caller.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextvars import ContextVar
from dataclasses import dataclass, field, replace
from functools import cached_property
from types import ModuleType
from typing import TYPE_CHECKING, Any

import basix.ufl
import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import mesh as dmesh
from dolfinx.graph import adjacencylist
from dolfinx.io import distribute_entity_data
from mpi4py import MPI
from scipy.spatial import ConvexHull, QhullError

from signorini_fx.arrays import Array, Flags, Indices, Integers, Ints, Plain, matvec
from signorini_fx.errors import MeshError, SceneError
from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.statement.base import JOIN, TaggedMeshBase
from signorini_fx.mechanics.statement.expressions import Expression
from signorini_fx.mechanics.statement.values import kind_of
from signorini_fx.tuned import SAME_LENGTH

if TYPE_CHECKING:
    from signorini_fx.mechanics.mesh.files.arrays import MeshArrays, Selection
    from signorini_fx.mechanics.mesh.files.size_field import Sizes
    from signorini_fx.mechanics.statement.mesh_sources import MeshFile, MeshInMemory
    from signorini_fx.mechanics.statement.statement import Statement

# Name of a boundary or region -> its tag, or its tags.
_Tags = dict[str, int | tuple[int, ...]]


@dataclass(frozen=True, repr=False)
class TaggedMesh(TaggedMeshBase):
    """A mesh with named boundaries and regions.

    Attributes:
        mesh: the distributed mesh.
        facet_tags: tags on facets.
        boundaries: name of a boundary -> its tag, or all its tags if boundaries overlap.
        cell_tags: tags on cells; None if the body is one region.
        regions: name of a part of the body -> its tag, or all its tags.
        origin: what a scene calls the file or the generator that it was made from; empty if the
            caller made it.
        left_out: name of a boundary -> how many of its elements in the file are no sides of cells,
            and have no tag.

    Examples:
        >>> print(len(block.facets("bottom")), block.dimension, sorted(block.boundaries))
        8 2 ['bottom', 'left', 'right', 'top']
    """

    mesh: dmesh.Mesh
    facet_tags: dmesh.MeshTags
    boundaries: Mapping[str, int | tuple[int, ...]]
    cell_tags: dmesh.MeshTags | None = None
    regions: Mapping[str, int | tuple[int, ...]] = field(default_factory=dict)
    origin: Mapping[str, Any] = field(default_factory=dict)
    left_out: Mapping[str, int] = field(default_factory=dict)

    def __repr__(self) -> str:
        cells = self.mesh.topology.index_map(self.dimension).size_global
        names = ", ".join(self.boundaries) or "none"
        return (
            f"<TaggedMesh: {cells:,} cells ({self.mesh.topology.cell_name()}), boundaries {names}>"
        )

    @cached_property
    def dimension(self) -> int:
        """Return the dimension d of points and cells, 2 or 3."""
        return int(self.mesh.topology.dim)

    def cells(self, region: str | None) -> Indices:
        """Return the cells of the region on this rank, ghosts included (local numbers); None: all
        of them.
        """
        if region is None:
            return np.arange(len(compat.geometry_cells(self.mesh)), dtype=np.int32)
        if self.cell_tags is None or region not in self.regions:
            raise MeshError(
                f"the mesh has no region {region!r}; its regions are: "
                f"{', '.join(self.regions) or 'none'}"
            )
        return _tagged(self.cell_tags, self.regions[region])

    def facets(self, name: str) -> Indices:
        """Return the exterior facets of the boundary ``name`` whose cell this rank owns (local
        numbers, sorted).

        Raises:
            MeshError: there is no such name; the message lists the known ones.
        """
        if name not in self.boundaries:
            names = ", ".join(sorted(self.boundaries)) or "none"
            raise MeshError(f"the mesh has no boundary {name!r}; its boundaries are: {names}")
        # dolfinx 0.10 integrates ds(tag) over interior facets too: only the exterior ones are kept,
        # on every version.
        tagged = _tagged(self.facet_tags, self.boundaries[name])
        return tagged[self._exterior[tagged]]

    def with_joined(self, name: str) -> TaggedMesh:
        """Return the mesh with a boundary whose name joins those of several others, see ``JOIN``;
        the same mesh if one of these does not exist.
        """
        parts = name.split(JOIN)
        if name in self.boundaries or not all(part in self.boundaries for part in parts):
            return self
        tags = np.concatenate([np.atleast_1d(self.boundaries[part]) for part in parts])
        joined = tuple(int(tag) for tag in np.unique(tags))
        return replace(self, boundaries={**self.boundaries, name: joined})

    def inside(self, name: str) -> int:
        """Return the number of elements of the boundary ``name`` that are not exterior facets, on
        all ranks; collective.
        """
        tagged = _tagged(self.facet_tags, self.boundaries[name])
        owned = tagged[tagged < self.mesh.topology.index_map(self.dimension - 1).size_local]
        within = np.count_nonzero(~self._exterior[owned])
        return int(parallel.total(self.mesh.comm, within)) + self.left_out.get(name, 0)

    @cached_property
    def _exterior(self) -> Flags:
        """Flags of the facets of this rank, shape (facets,), that are exterior and have a cell
        here.
        """
        outer = outer_facets(self.mesh)
        facets = self.mesh.topology.index_map(self.dimension - 1)
        exterior = np.zeros(facets.size_local + facets.num_ghosts, dtype=bool)
        exterior[outer] = True
        return exterior

    @cached_property
    def size(self) -> float:
        """Return the diameter of the body, the largest distance of two of its points, a length; the
        same on all ranks.

        For a rectangle this is the diagonal in any orientation, so that scales that depend on it,
        such as gamma = auto, do not depend on the axes.
        """
        return diameter_of(self.mesh)


def outer_facets(mesh: dmesh.Mesh) -> Indices:
    """Return the exterior facets of this rank; collective."""
    dim = mesh.topology.dim
    mesh.topology.create_connectivity(dim - 1, dim)
    return np.asarray(dmesh.exterior_facet_indices(mesh.topology))


def diameter_of(mesh: dmesh.Mesh) -> float:
    """Return the largest distance between two points of a mesh, length; the same on all ranks;
    collective.

    Raises:
        MeshError: all points lie in a plane, in 2D on a line.
    """
    dim = mesh.topology.dim
    mesh.topology.create_connectivity(dim, dim - 1)
    facets = outer_facets(mesh)
    # dolfinx divides by the number of facets, and a rank may have none.
    nodes = np.unique(dmesh.entities_to_geometry(mesh, dim - 1, facets)) if facets.size else facets
    x = parallel.rows_on_root(mesh.comm, mesh.geometry.x[nodes, :dim].astype(np.float64))

    def of_hull() -> float:
        low = x.min(axis=0)
        high = x.max(axis=0)
        try:
            corners = x[ConvexHull((x - low) / (high - low).max()).vertices]
        except QhullError:
            extents = " by ".join(f"{extent:g}" for extent in high - low)
            raise MeshError(f"the body is too thin to be meshed: it measures {extents}") from None
        return largest_distance(corners)

    return parallel.on_root(mesh.comm, of_hull)


def largest_distance(x: Array) -> float:
    """Return the largest distance between two of the points, shape (n, d).

    Branch and bound: groups of points are halved, and pairs of groups that cannot contain a larger
    distance are dropped.
    """
    start = x[np.linalg.norm(x - x[0], axis=1).argmax()]
    largest = float(np.linalg.norm(x - start, axis=1).max())
    size = 1 << (len(x) - 1).bit_length()
    groups: Array = x[np.minimum(np.arange(size), len(x) - 1)][None]
    pairs: Ints = np.zeros((1, 2), dtype=int)
    while groups.shape[1] > 1 and len(pairs):
        along = np.ptp(groups, axis=1).argmax(axis=1)
        order = np.take_along_axis(groups, along[:, None, None], axis=2).argsort(axis=1)
        groups = np.take_along_axis(groups, order, axis=1)
        groups = groups.reshape(2 * len(groups), -1, x.shape[1])
        pairs = (2 * pairs[:, None] + np.array([[0, 0], [0, 1], [1, 0], [1, 1]])).reshape(-1, 2)
        one, other = pairs[pairs[:, 0] <= pairs[:, 1]].T
        middle = groups.mean(axis=1)
        radius = np.linalg.norm(groups - middle[:, None], axis=2).max(axis=1)
        apart = middle[one] - middle[other]
        length = np.linalg.norm(apart, axis=1)
        largest = max(
            largest, float(np.linalg.norm(groups[one, 0] - groups[other, 0], axis=1).max())
        )
        # Along the line through both middles, and across it.
        line = apart / np.maximum(length, np.finfo(float).tiny)[:, None]
        far = matvec(groups[one], line).max(axis=1)
        near = matvec(groups[other], line).min(axis=1)
        kept = np.hypot(far - near, radius[one] + radius[other]) > largest
        pairs = np.column_stack((one[kept], other[kept]))
    return largest


def _tagged(tags: dmesh.MeshTags, values: int | tuple[int, ...]) -> Indices:
    """Return entities with any of the tags, sorted."""
    tags_wanted = (values,) if isinstance(values, int) else values
    return np.sort(np.concatenate([np.empty(0, dtype=np.int32), *map(tags.find, tags_wanted)]))


def check_fits(statement: Statement, tagged: TaggedMesh) -> None:
    """Check the scene against dimension and shape of its mesh; collective.

    Raises:
        SceneError: keys for another dimension than that of the mesh; linear elements on curved
            cells; a negative radius.
    """
    from signorini_fx.mechanics.statement.features import dimension_problems

    problems = dimension_problems(statement, tagged.dimension)
    least_x = -parallel.largest(tagged.mesh.comm, -tagged.mesh.geometry.x[:, 0])
    if least_x < statement.kinematics.least_x - SAME_LENGTH * tagged.size:
        problems.append(
            (
                "mesh",
                f"has points with x[0] = {least_x:g}: it is the radius of a body of revolution",
            )
        )
    if statement.element.degree == 1 and curvature(tagged) > SAME_LENGTH * tagged.size:
        # Such elements cannot even represent a rotation without strain: no refinement would help.
        message = (
            "the mesh has curved cells: set degree = 2, or take straight cells (order = 1 "
            "of a generator)"
        )
        problems.append(("element.degree", message))
    if problems:
        raise SceneError(problems)


def check_dimension(tagged: TaggedMesh, *, section: bool = False) -> None:
    """Check that positions are finite, and that cells and points have the same dimension, 2 or 3;
    collective.

    ``section``: also allow plane cells with points in 3D, as with torsion.

    Raises:
        MeshError: a check fails.
    """
    if parallel.any_rank(tagged.mesh.comm, not np.isfinite(tagged.mesh.geometry.x).all()):
        raise MeshError("a node of the mesh has coordinates that are not finite")
    cells = int(tagged.mesh.topology.dim)
    points = int(tagged.mesh.geometry.dim)
    if (cells == points and cells in (2, 3)) or (section and is_section(tagged.mesh)):
        return
    if (cells, points) != (2, 3):
        raise MeshError(
            f"the mesh has cells of dimension {cells} and points of dimension {points}: a body "
            "has 2 or 3"
        )
    raise MeshError(
        "the mesh is a surface in 3D (a shell): a planar one has points of two coordinates, x[0] "
        "and x[1] (gdim = 2), "
        "and a body in 3D tetrahedra or hexahedra"
    )


def embed_in_3d(mesh: dmesh.Mesh) -> dmesh.Mesh:
    """Return the plane mesh as the section x[2] = 0 in 3D, where displacements have three
    components; collective.

    It shares the topology, so that its cells and facets have the same numbers, and tags of the one
    are tags of the other.  In forms of a body of revolution about x[1] whose displacement turns
    with the section, the gradient of y along x[2] is (-y[2], 0, y[0]) / x[0], and moments of
    contact about x[1] are torques.

    Args:
        mesh: of the plane.

    Examples:
        >>> section = sfx.embed_in_3d(block.mesh)
        >>> print(section.geometry.dim, section.topology.dim)
        3 2
    """
    element = compat.geometry_element(mesh)
    domain = basix.ufl.element(
        "Lagrange",
        mesh.topology.cell_name(),
        element.degree,
        element.lagrange_variant,
        shape=(3,),
        dtype=mesh.geometry.x.dtype,
    )
    made = type(compat.wrapped(mesh))(
        mesh.comm, compat.topology(mesh), compat.geometry_in_space(mesh)
    )
    return dmesh.Mesh(made, ufl.Mesh(domain))


def is_section(mesh: dmesh.Mesh) -> bool:
    """Return whether the mesh has plane cells in 3D."""
    return bool(mesh.geometry.dim > mesh.topology.dim)


def curvature(tagged: TaggedMesh) -> float:
    """Return the largest distance of a midside node from the middle of its side, length; the same
    on all ranks.
    """
    from signorini_fx.mechanics.mesh.files import cells

    kind = cells.kind_of_mesh(tagged.mesh)
    if kind is None or kind.degree == 1:  # of a higher degree are those of a caller's own mesh
        return 0.0
    x = tagged.mesh.geometry.x
    nodes = compat.geometry_cells(tagged.mesh).astype(np.int64)
    return parallel.global_max(
        tagged.mesh.comm, cells.curvature(np.asarray(x, dtype=np.float64), nodes, kind)
    )


def generate_mesh(
    name: str, parameters: Mapping[str, Plain], comm: MPI.Comm, sizes: Sizes = ()
) -> TaggedMesh:
    """Return the mesh of the generator ``name``, see ``signorini_fx.meshes``; collective.

    Args:
        name: of the generator.
        parameters: its keyword arguments.
        comm: the ranks that share the mesh.
        sizes: lengths of the facets of some boundaries, or of all cells, on the first rank.

    Raises:
        SceneError: unknown generator, or parameters that it refuses; or lengths that it cannot
            make.

    Examples:
        >>> ring = sfx.generate_mesh("rectangle", {"nx": 6, "ny": 2}, MPI.COMM_WORLD)
        >>> print(ring.mesh.topology.index_map(2).size_global)
        12
    """
    from signorini_fx.mechanics.mesh.files.size_field import SizeField
    from signorini_fx.mechanics.statement.mesh_sources import found_generator

    generate, values = found_generator(name, parameters)
    in_rows = not getattr(generate, "sized", False)
    reset = _LOCAL_SIZES.set(() if in_rows else sizes)
    try:
        tagged = generate(comm, **values)
    finally:
        _LOCAL_SIZES.reset(reset)
    if not isinstance(tagged, TaggedMesh):
        raise SceneError.at(
            "mesh.generator", f"{name!r} has made {kind_of(tagged)}, a TaggedMesh is expected"
        )
    # Lengths of all cells are asked of generators alone that make cells of several.
    asked = (
        []
        if isinstance(sizes, SizeField)
        else [size.path for size in sizes if size.boundary in tagged.boundaries]
    )
    if in_rows and asked:
        cure = "make all of them smaller by its parameters, or draw the body in a .geo"
        raise SceneError.at(asked[0], f"the cells of the generator {name!r} are in rows: {cure}")
    return replace(tagged, origin={"generator": name, "parameters": dict(parameters)})


def read_mesh(
    file: Any,
    comm: MPI.Comm,
    boundaries: Mapping[str, Selection] | None = None,
    regions: Mapping[str, Selection] | None = None,
    data: str | None = None,
    size: float | None = None,
) -> TaggedMesh:
    """Return the mesh of a file, or one that another program has in memory; the first rank reads
    it; collective.  The formats are those of ``formats.read_file``.

    Args:
        file: the path of the file, or gmsh.model, a mesh of meshio, or a grid of PyVista.
        comm: the ranks that share the mesh.
        boundaries: name -> a number in the cell data of the file, or a function of points of shape
            (3, n) that is positive at all vertices of the exterior facets of the boundary.
        regions: the same for cells and all their vertices.
        data: the cell data that numbers refer to; None: there is only one.
        size: length of the cells of a .step, .stp or .brep; None: a fraction of the size of the
            body.

    Raises:
        MeshError: there is no such file, it is not a mesh of that format, or no boundary has a
            name.
        SceneError: a number or a condition selects nothing.

    Examples:
        >>> import tempfile
        >>> from dolfinx import io
        >>> file = tempfile.mkdtemp() + "/block.xdmf"
        >>> with io.XDMFFile(MPI.COMM_WORLD, file, "w") as out:
        ...     out.write_mesh(block.mesh)
        >>> read = sfx.read_mesh(file, MPI.COMM_WORLD, boundaries={"foot": "x[1] < 1e-9"})
        >>> print(len(read.facets("foot")))
        8
    """
    from signorini_fx.mechanics.statement.mesh_sources import MeshFile, MeshInMemory

    held = file if isinstance(file, MeshInMemory) else MeshInMemory(file)
    name = f"mesh of {held.program}" if held.program else file
    mesh = MeshFile(
        file=name, boundaries=boundaries or {}, regions=regions or {}, data=data, size=size
    )
    return _of_file(mesh, comm, held=held)


def load_file(
    mesh: MeshFile, comm: MPI.Comm, halvings: int = 0, degree: int | None = None, sizes: Sizes = ()
) -> TaggedMesh:
    """Return the mesh of a file of a scene; see ``read_mesh``.

    Args:
        mesh: the file, with the names that the scene gives.
        comm: the ranks that share the mesh.
        halvings: how often all cells are halved; drawings are halved on the true shape.
        degree: degree of the geometry: 1: straight sides; 2 (drawings only): with nodes between the
            corners, if there are curves; None: as in the file, 1 for a CAD drawing.
        sizes: for drawings the lengths of facets of some boundaries, or of all cells, on the first
            rank.
    """
    try:
        tagged = _of_file(mesh, comm, halvings, degree, sizes)
    except MeshError as error:
        raise MeshError(f"mesh.file: {error}") from None
    return replace(tagged, origin={"file": mesh.file.name})


def _of_file(
    mesh: MeshFile,
    comm: MPI.Comm,
    halvings: int = 0,
    degree: int | None = None,
    sizes: Sizes = (),
    held: MeshInMemory | None = None,
) -> TaggedMesh:
    from signorini_fx.mechanics.mesh.files import formats
    from signorini_fx.mechanics.mesh.files.arrays import from_raw

    def read() -> MeshArrays:
        names = "in mesh.boundaries of the scene"
        if held is not None and held.program:
            names = "by read_mesh(mesh, comm, boundaries={...})"
            given = (mesh.boundaries, mesh.regions, mesh.data)
            arrays = from_raw(formats.raw_of(held), str(mesh.file), *given)
        else:
            arrays = formats.read_file(mesh, halvings, degree, sizes)
        if not any(rows.size for rows in arrays.boundaries.values()):
            raise MeshError(
                f"{mesh.file}: the mesh has no named boundary: name some {names}, "
                f"or in the file (in gmsh: physical groups of dimension {arrays.dim - 1})"
            )
        return arrays

    return from_arrays(comm, read)


def from_arrays(comm: MPI.Comm, make: Callable[[], MeshArrays]) -> TaggedMesh:
    """Return the mesh that ``make`` returns, distributed; ``make`` is called on the first rank
    only; collective.

    Raises:
        MeshError: cells have different nodes in the middle of the same edge or face, or one in the
            middle of two.
    """
    from signorini_fx.mechanics.mesh.files.arrays import MeshArrays
    from signorini_fx.mechanics.mesh.files.cells import CELLS

    on_root: list[MeshArrays] = []

    def made() -> tuple[str, int, Mapping[str, int], list[str], list[str]]:
        arrays = make()
        on_root.append(arrays)
        return (
            arrays.kind,
            len(arrays.points),
            arrays.astray,
            [*arrays.boundaries],
            [*arrays.regions],
        )

    kind, nodes, astray, *names = parallel.on_root(comm, made)
    cell = CELLS[kind]
    none = np.empty(0, dtype=np.int64)
    empty = none.reshape(0, len(cell.nodes)), none.reshape(0, len(CELLS[cell.facet].nodes))
    boundaries_of_none, regions_of_none = (dict.fromkeys(of, none) for of in names)
    nothing = MeshArrays(np.empty((0, cell.dim)), kind, *empty, boundaries_of_none, regions_of_none)
    arrays = on_root.pop() if on_root else nothing
    facets, of_facets, boundaries = _combined(comm, arrays.boundaries)
    cells, of_cells, regions = _combined(comm, arrays.regions)
    even = basix.ufl.element(
        "Lagrange",
        cell.basix_type.name,
        cell.degree,
        basix.LagrangeVariant.equispaced,
        shape=(cell.dim,),
    )
    mesh = dmesh.create_mesh(comm, cells=arrays.cells, x=arrays.points, e=ufl.Mesh(even))
    if mesh.geometry.index_map().size_global != nodes:
        raise MeshError(
            "cells cross: a node in the middle of edges or faces belongs to two of them, or two "
            "to one"
        )
    facet_tags = _meshtags(mesh, cell.dim - 1, arrays.facets[facets], of_facets)
    cell_tags = _meshtags(mesh, cell.dim, arrays.cells[cells], of_cells)
    return TaggedMesh(
        mesh, facet_tags, boundaries, cell_tags if regions else None, regions, left_out=astray
    )


def _meshtags(mesh: dmesh.Mesh, dim: int, nodes: Ints, values: Indices) -> dmesh.MeshTags:
    """Return tags of entities, given on the first rank by their nodes."""
    local, of_local = distribute_entity_data(mesh, dim, nodes, values)
    mesh.topology.create_connectivity(dim, 0)
    mesh.topology.create_connectivity(dim, mesh.topology.dim)
    return dmesh.meshtags_from_entities(
        mesh, dim, adjacencylist(local), of_local.astype(np.int32, copy=False)
    )


def arrays_of(tagged: TaggedMesh) -> MeshArrays:
    """Return all cells and names of a mesh on the first rank, and empty arrays on the others;
    collective.

    Raises:
        MeshError: the degree of the geometry is above 2.
    """
    from signorini_fx.mechanics.mesh.files.arrays import MeshArrays
    from signorini_fx.mechanics.mesh.files.cells import CELLS, kind_of_mesh

    mesh = tagged.mesh
    comm = tagged.mesh.comm
    dim = tagged.dimension
    kind = kind_of_mesh(mesh)
    nodes = mesh.geometry.index_map()
    if kind is None:
        raise MeshError("the geometry of its cells has a degree above 2: give it one of 1 or 2")
    width = len(CELLS[kind.facet].nodes)
    count = mesh.topology.index_map(dim).size_local
    cells = _global_nodes(mesh, compat.geometry_cells(mesh)[:count])
    parts: Ints = np.empty((0, 2), dtype=np.int64)
    if tagged.cell_tags is not None:
        here = tagged.cell_tags.indices < count
        numbers = parallel.rows_before(comm, count) + tagged.cell_tags.indices[here]
        parts = np.column_stack((numbers, tagged.cell_tags.values[here])).astype(np.int64)
    owned = tagged.facet_tags.indices < mesh.topology.index_map(dim - 1).size_local
    entities = tagged.facet_tags.indices[owned]
    mesh.topology.create_connectivity(dim - 1, dim)
    # dolfinx divides by the number of entities, and a rank may have none.
    rows = (
        dmesh.entities_to_geometry(mesh, dim - 1, entities)
        if entities.size
        else np.empty((0, width), np.int32)
    )
    facets = np.column_stack((_global_nodes(mesh, rows), tagged.facet_tags.values[owned]))
    points = parallel.rows_on_root(
        comm, mesh.geometry.x[: nodes.size_local, :dim].astype(np.float64)
    )
    cells, parts, facets = (
        parallel.rows_on_root(comm, table) for table in (cells, parts, facets.astype(np.int64))
    )
    return MeshArrays(
        points=points,
        kind=kind.kind,
        cells=cells,
        facets=facets[:, :width],
        boundaries={
            name: np.flatnonzero(np.isin(facets[:, width], tags))
            for name, tags in tagged.boundaries.items()
        },
        regions={
            name: np.sort(parts[np.isin(parts[:, 1], tags), 0])
            for name, tags in tagged.regions.items()
        },
        astray=tagged.left_out,
    )


def _global_nodes(mesh: dmesh.Mesh, rows: Indices) -> Ints:
    """Return the global numbers of geometry nodes, in the same shape."""
    numbers: Ints = mesh.geometry.index_map().local_to_global(np.ascontiguousarray(rows).ravel())
    return numbers.reshape(rows.shape)


# Cell lengths for the running generator, which does not receive them: ``gmsh_mesh`` applies them.
_LOCAL_SIZES: ContextVar[Sizes] = ContextVar("_LOCAL_SIZES", default=())


def gmsh_mesh(
    comm: MPI.Comm, draw: Callable[[ModuleType], None], name: str, unit: float = 1.0
) -> TaggedMesh:
    """Let ``draw(gmsh)`` make a meshed gmsh model on the first rank, and distribute it.

    Args:
        comm: the ranks that share the mesh.
        draw: called on the first rank only; makes a meshed model with physical groups, of two or
            three dimensions.
        name: name of the mesh in messages.
        unit: length of the model's unit.  The tolerances of gmsh are absolute: its geometry should
            be neither large nor small, and have the same numbers in all units.

    Raises:
        MeshError: the model has no cells, no physical group for the body, or no named boundary.
        InstallationError: gmsh is not installed, or cannot be loaded.
    """
    from signorini_fx.mechanics.mesh.files.arrays import from_raw
    from signorini_fx.mechanics.mesh.files.gmsh_reader import content, gmsh_session, set_order
    from signorini_fx.mechanics.mesh.files.size_field import with_sizes
    from signorini_fx.mechanics.mesh.halving import straightened

    sizes = _LOCAL_SIZES.get()
    cure = (
        f"the cells of {name} are in rows; make them smaller by its parameters, or draw the "
        "body in a .geo"
    )

    def make() -> MeshArrays:
        with gmsh_session(f"{name}: gmsh cannot make the mesh") as gmsh:

            def current() -> MeshArrays:
                arrays = from_raw(content(gmsh), name)
                return replace(arrays, points=unit * arrays.points)

            def again() -> MeshArrays:
                gmsh.model.mesh.generate(top)
                if drawn.degree > 1:
                    set_order(gmsh, drawn.degree)
                return current()

            draw(gmsh)
            top = max((dim for dim, _ in gmsh.model.getPhysicalGroups()), default=0)
            if top < 2:
                raise MeshError(
                    f"{name}: the mesh has no physical group of dimension 2 or 3 (the body)"
                )
            drawn = current()
            arrays = (
                with_sizes(gmsh, lambda: straightened(drawn), again, sizes, cure, unit) or drawn
            )
        if not arrays.boundaries:
            raise MeshError(
                f"{name}: the mesh has no named boundary: give it physical groups of dimension "
                f"{top - 1}"
            )
        return arrays

    return from_arrays(comm, make)


def _rule(text: str) -> Callable[[Array], Flags]:
    """Return a marker that is true where an expression is true or positive."""
    expression = Expression(text)
    return lambda x: expression(x) > 0


def tag_boundaries(
    mesh: dmesh.Mesh, markers: Mapping[str, str | Callable[[Array], npt.ArrayLike]]
) -> TaggedMesh:
    """Name the exterior facets whose vertices all satisfy a marker; collective.

    A facet that satisfies several markers belongs to all of these boundaries.

    Args:
        mesh: the mesh.
        markers: name -> rule: a function of points of shape (3, n) that gives truth values of shape
            (n,), or an expression of the position such as "x[0] < 1e-9".

    Raises:
        TypeError: an argument is of another kind.

    Examples:
        >>> named = sfx.tag_boundaries(block.mesh, {"foot": lambda x: np.isclose(x[1], 0.0)})
        >>> print(len(named.facets("foot")))
        8
    """
    if not isinstance(mesh, dmesh.Mesh):
        raise TypeError(f"a mesh of dolfinx is expected, not {kind_of(mesh)}")
    rules = {name: _rule(rule) if isinstance(rule, str) else rule for name, rule in markers.items()}
    for name, rule in rules.items():
        if not callable(rule):
            raise TypeError(
                f"boundary {name!r}: a function of points or an expression is expected, not "
                f"{kind_of(rule)}"
            )
    dim = mesh.topology.dim - 1
    facets = {
        name: dmesh.locate_entities_boundary(mesh, dim, rule).astype(np.int32)
        for name, rule in rules.items()
    }
    return tagged_mesh(mesh, facets)


def tagged_mesh(mesh: dmesh.Mesh, boundaries: Mapping[str, Indices]) -> TaggedMesh:
    """Return a mesh with named boundaries, given by their facets; a facet may have several names;
    collective.
    """
    facets, tags, names = _combined(mesh.comm, boundaries)
    facet_tags = dmesh.meshtags(mesh, mesh.topology.dim - 1, facets.astype(np.int32), tags)
    return TaggedMesh(mesh, facet_tags, names)


def _combined(comm: MPI.Comm, groups: Mapping[str, Integers]) -> tuple[Ints, Indices, _Tags]:
    """Return tags for groups that may overlap, one for each combination of groups; collective.

    Returns the members, the tag of each, and the tags of each group.
    """
    members = np.unique(np.concatenate([np.empty(0, dtype=np.int64), *groups.values()]))
    holds = np.zeros((len(members), len(groups)), dtype=bool)
    for number, part in enumerate(groups.values()):
        holds[np.searchsorted(members, part), number] = True
    combination = np.zeros(len(members), dtype=np.int64)
    for held in holds.T:  # one column after the other, a hundred times as fast as all at once
        combination = np.unique(2 * combination + held, return_inverse=True)[1].reshape(-1)
    own = holds[np.unique(combination, return_index=True)[1]]
    patterns = np.unique(parallel.gather_rows(comm, own), axis=0)
    numbers = np.unique(np.concatenate((patterns, own)), axis=0, return_inverse=True)[1].reshape(-1)
    tags = {
        name: tuple(map(int, np.flatnonzero(held) + 1))
        for name, held in zip(groups, patterns.T, strict=True)
    }
    names = {name: of_name[0] if len(of_name) == 1 else of_name for name, of_name in tags.items()}
    return members, (numbers[len(patterns) :][combination] + 1).astype(np.int32), names
