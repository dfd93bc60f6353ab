"""Supports, loads and contact of a scene as plain arrays for a picture, before anything is
solved.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
import numpy as np
from dolfinx import mesh as dmesh
from mpi4py import MPI

from signorini_fx.addons.pictures.body import normals_of
from signorini_fx.addons.pictures.rigid_shapes import lines_of
from signorini_fx.addons.pictures.setup import NamedBoundary, Setup
from signorini_fx.arrays import Array, Indices, inner
from signorini_fx.errors import OutputError, cannot_be_written
from signorini_fx.machine import parallel
from signorini_fx.machine.compat import geometry_cells
from signorini_fx.mechanics.assembly.mesh_entities import facet_cells
from signorini_fx.mechanics.effects.contact import Contact as ContactEffect
from signorini_fx.mechanics.effects.displacement import Displacement
from signorini_fx.mechanics.effects.loads import PointForce, Preload
from signorini_fx.mechanics.mesh.tagged import TaggedMesh, load_file, outer_facets
from signorini_fx.mechanics.statement.effect import Effect, ForceDensity, SampledPoints, VectorForce
from signorini_fx.mechanics.statement.mesh_sources import MeshFile
from signorini_fx.mechanics.statement.statement import Statement

_SUFFIXES = (".png", ".pdf", ".svg")


def gather_setup(tagged: TaggedMesh, statement: Statement | None = None, title: str = "") -> Setup:
    """Return a body with everything that acts on its boundaries, on the first rank, and without
    facets on the others; collective.
    """
    mesh = tagged.mesh
    dim = tagged.dimension
    comm = tagged.mesh.comm
    if dim == 2:
        shown = _corners(
            tagged, 2, np.arange(mesh.topology.index_map(2).size_local, dtype=np.int32)
        )
    else:
        shown, _ = _sides(tagged, outer_facets(mesh))
    acting: dict[str, list[Effect]] = {name: [] for name in tagged.boundaries}
    for effect in () if statement is None else statement.of(Effect):
        if effect.where is not None and (effect.acts or effect.label == "contact"):
            acting[effect.where].append(effect)
        if isinstance(effect, ContactEffect) and effect.against is not None:
            acting[effect.against].append(effect)
    placed = statement.contacts_at(0) if statement is not None and dim == 2 else ()
    time = 0.0 if statement is None else statement.time_at(statement.steps - 1)
    return Setup(
        title,
        parallel.rows_on_root(comm, shown),
        tuple(_boundary(tagged, name, acting[name], time) for name in _shown(tagged, acting)),
        {} if statement is None else statement.unit_names(dim),
        [
            line
            for effect in placed
            if effect.surface is not None
            for line in lines_of(effect.gap_in(2), tagged)
        ],
        [] if statement is None else list(_elsewhere(statement, dim)),
    )


def _elsewhere(statement: Statement, dim: int) -> Iterator[tuple[str, Array | None, Array]]:
    """Yield the loads that act on no boundary, see ``Setup.arrows``."""
    for effect in statement.of(Effect):
        if isinstance(effect, Preload) and effect.point and effect.axis:
            for way in (1.0, -1.0):
                yield "preload", np.array(effect.point[:dim]), way * np.array(effect.axis[:dim])
        elif isinstance(effect, VectorForce) and effect.where is None:
            parts = [part if isinstance(part, float) else 0.0 for part in effect.components[:dim]]
            at = effect.at if isinstance(effect, PointForce) else None
            if any(parts):
                yield effect.label, None if at is None else np.array(at), np.array(parts)


def _shown(tagged: TaggedMesh, acting: dict[str, list[Effect]]) -> list[str]:
    """Return the names of the boundaries to show; collective.

    Of several names for the same facets those that the scene uses are shown, otherwise the longest.
    """
    used = [name for name, effects in acting.items() if effects]
    facets = {name: tagged.facets(name) for name in acting}
    equal = np.array(
        [
            [np.array_equal(facets[name], facets[used_name]) for used_name in used]
            for name in acting
        ],
        dtype=np.int8,
    )
    tagged.mesh.comm.Allreduce(MPI.IN_PLACE, equal, MPI.MIN)
    bodies = tagged.origin.get("bodies", {})
    body_names = {name for name in acting if name.partition(".")[0] in bodies}
    short = {name.partition(".")[2] for name in body_names} - body_names
    return [
        name
        for name, twins in zip(acting, equal, strict=True)
        if acting[name] or not (twins.any() or name in short)
    ]


def draw_setup(
    load: Callable[[], TaggedMesh], statement: Statement, comm: MPI.Comm, file: Path
) -> None:
    """Draw a problem into a file with the suffix .png, .pdf or .svg; ``load`` returns its mesh;
    collective.

    Raises:
        SceneError: the scene does not fit its mesh.
        MeshError: the mesh cannot be read or generated.
        OutputError: the file cannot be written.
        PictureError: in 3D, PyVista is missing.
    """
    _draw(lambda: gather_setup(load(), statement, statement.title), comm, file)


def draw_mesh(mesh: MeshFile, comm: MPI.Comm, file: Path) -> None:
    """Draw the mesh of a file with the names of its boundaries, see ``draw_setup``; collective."""
    _draw(lambda: gather_setup(load_file(mesh, comm), title=Path(mesh.file).name), comm, file)


def _draw(gather: Callable[[], Setup], comm: MPI.Comm, file: Path) -> None:
    if file.suffix not in _SUFFIXES:
        raise OutputError(f"{file}: a picture is .png, .pdf or .svg")
    setup = gather()

    def draw() -> None:
        try:
            setup.draw(file.with_suffix(""), (file.suffix,))
        except OSError as error:
            raise cannot_be_written(file, error) from None

    parallel.on_root(comm, draw)


def _corners(tagged: TaggedMesh, dim: int, entities: Indices) -> Array:
    """Return the corners of facets or cells along their perimeters, shape (n, k, d)."""
    x = tagged.mesh.geometry.x[:, : tagged.dimension].astype(np.float64)
    mesh = tagged.mesh
    cell = mesh.topology.cell_name()
    order = (
        [0, 1]
        if dim == 1
        else [0, 1, 3, 2]
        if cell in ("quadrilateral", "hexahedron")
        else [0, 1, 2]
    )
    if not entities.size:  # dolfinx divides by their number
        return np.empty((0, len(order), tagged.dimension))
    return x[dmesh.entities_to_geometry(mesh, dim, entities)[:, order]]


def _boundary(tagged: TaggedMesh, name: str, acting: list[Effect], time: float) -> NamedBoundary:
    """Return a boundary with everything that acts on it, on the first rank; collective."""
    corners, areas = _sides(tagged, tagged.facets(name))
    sizes = np.linalg.norm(areas, axis=1)
    middles = corners.mean(axis=1)
    normals = areas / sizes[:, None]

    def whole(effect: Any) -> float:
        """Return the total of a distributed force from one point on each facet, which is accurate
        enough for arrows.
        """
        return parallel.total(tagged.mesh.comm, sizes @ on.value(effect.spread))

    on = SampledPoints(middles.T, normals.T, whole)
    load = np.zeros_like(middles)
    moved = np.zeros_like(middles)
    held: dict[str, None] = {}
    grounded = False
    partners: dict[str, None] = {}
    for acting_effect in (effect.at_time(time) for effect in acting):
        if isinstance(acting_effect, ContactEffect):
            grounded |= acting_effect.against is None
            other = (acting_effect.boundary, acting_effect.against)[acting_effect.boundary == name]
            partners |= {other: None} if other is not None else {}
        elif isinstance(acting_effect, ForceDensity):
            load += _density(acting_effect, on).T
        elif isinstance(acting_effect, Displacement):
            along = (*acting_effect.components, acting_effect.normal)
            held |= {
                key: None
                for key, value in zip(("x", "y", "z", "normal"), along, strict=True)
                if value is not None
            }
            moved += on.vector(tuple(value or 0.0 for value in acting_effect.components)).T
            moved += on.value(acting_effect.normal or 0.0)[:, None] * normals
    kinds = tuple(dict.fromkeys(acting_effect.label for acting_effect in acting))
    corners, normals, load, moved = (
        parallel.rows_on_root(tagged.mesh.comm, rows) for rows in (corners, normals, load, moved)
    )
    told = tuple(held), grounded, tuple(partners)
    return NamedBoundary(name, kinds, corners, normals, load, moved, *told)


def _density(load: ForceDensity, on: SampledPoints) -> Array:
    """Return the load at the points, shape (d, n); zero for a load of another package that is given
    by UFL functions, which have no values at points.
    """
    try:
        return np.broadcast_to(load.density(on), on.position.shape)
    except (TypeError, ValueError):
        return np.zeros_like(on.position)


def _sides(tagged: TaggedMesh, facets: Indices) -> tuple[Array, Array]:
    """Return the corners of facets, shape (f, k, d), in 3D counterclockwise as seen from outside,
    and outward normals as long as their areas.
    """
    mesh = tagged.mesh
    dim = tagged.dimension
    corners = _corners(tagged, dim - 1, facets)
    areas = (
        normals_of(corners) if dim == 3 else (corners[:, 1] - corners[:, 0])[:, ::-1] * (1.0, -1.0)
    )
    inside = mesh.geometry.x[geometry_cells(mesh)[facet_cells(mesh, facets)], :dim].mean(axis=1)
    inwards = inner(areas, corners.mean(axis=1) - inside) < 0
    corners[inwards] = corners[inwards, ::-1]
    areas[inwards] *= -1
    return corners, areas
