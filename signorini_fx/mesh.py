"""Distributed meshes with named boundaries: from a generator in ``meshes/``, from a file, or the caller's own."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import mesh as dmesh
from mpi4py import MPI
from pydantic import ValidationError
from scipy.spatial import ConvexHull
from scipy.spatial.distance import pdist

from signorini_fx import compat, meshes, parallel
from signorini_fx.errors import MeshError, SceneError
from signorini_fx.scene import MeshFile, MeshGenerator, Scene, TaggedMeshBase

_GMSH_SUFFIXES = {".msh", ".geo"}


@dataclass(frozen=True)
class TaggedMesh(TaggedMeshBase):
    """A mesh and the names of its boundaries.

    Attributes:
        mesh: the distributed mesh.
        facet_tags: tags on facets.
        boundaries: name of a boundary -> its tag.
        cell_tags: tags on cells, None where the body is one region.
        regions: name of a part of the body -> its tag.
    """

    mesh: dmesh.Mesh
    facet_tags: dmesh.MeshTags
    boundaries: Mapping[str, int]
    cell_tags: dmesh.MeshTags | None = None
    regions: Mapping[str, int] = field(default_factory=dict)

    def cells(self, region: str) -> npt.NDArray[np.int32]:
        """Cells of the part ``region`` on this rank, ghosts included (local numbers)."""
        if self.cell_tags is None or region not in self.regions:
            raise MeshError(f"the mesh has no region {region!r}; its regions are: {', '.join(self.regions) or 'none'}")
        return self.cell_tags.find(self.regions[region])

    def facets(self, name: str) -> npt.NDArray[np.int32]:
        """Exterior facets of the boundary ``name`` whose cell this rank owns (local numbers, sorted).

        Raises:
            MeshError: the name is not there; the message lists those that are.
        """
        if name not in self.boundaries:
            known = ", ".join(sorted(self.boundaries)) or "none"
            raise MeshError(f"the mesh has no boundary {name!r}; its boundaries are: {known}")
        # dolfinx 0.10 integrates ds(tag) over interior facets too: only the exterior ones are kept, on every version.
        tagged = self.facet_tags.find(self.boundaries[name])
        self.mesh.topology.create_connectivity(self.mesh.topology.dim - 1, self.mesh.topology.dim)
        return np.intersect1d(tagged, dmesh.exterior_facet_indices(self.mesh.topology)).astype(np.int32)

    @cached_property
    def size(self) -> float:
        """Diameter of the body, the largest distance of two of its points, a length; the same on all ranks.

        The diagonal of a rectangle, however it is turned: scales that follow from it, gamma = auto among them, do not
        depend on the axes.
        """
        dim = self.mesh.topology.dim
        self.mesh.topology.create_connectivity(dim - 1, dim)
        self.mesh.topology.create_connectivity(dim, dim - 1)
        facets = dmesh.exterior_facet_indices(self.mesh.topology)
        # dolfinx divides by the number of facets, which is zero on a rank without any.
        nodes = np.unique(dmesh.entities_to_geometry(self.mesh, dim - 1, facets)) if facets.size else facets
        x = parallel.gather_rows(self.mesh.comm, self.mesh.geometry.x[nodes, :2].astype(np.float64))
        low, high = x.min(axis=0), x.max(axis=0)
        corners = x[ConvexHull((x - low) / (high - low).max()).vertices]
        return float(pdist(corners).max())


def load_mesh(scene: Scene, comm: MPI.Comm) -> TaggedMesh:
    """The mesh that a scene names.

    Raises:
        SceneError: unknown generator, or parameters that it refuses.
        MeshError: the file is no mesh.
    """
    match scene.mesh:
        case TaggedMesh() as tagged:
            return tagged
        case MeshFile(file=file):
            return read_mesh(file, comm)
        case MeshGenerator(generator=name, parameters=parameters):
            return generate_mesh(name, parameters, comm)
    raise TypeError(f"no mesh: {scene.mesh!r}")


def generate_mesh(name: str, parameters: Mapping[str, Any], comm: MPI.Comm) -> TaggedMesh:
    """Run the generator ``name`` (a module of ``meshes/`` with a function ``generate(comm, ...)``).

    Raises:
        SceneError: unknown generator, or parameters that it refuses.
    """
    generate: Callable[..., TaggedMesh] = _generator(name).generate
    try:
        return generate(comm, **parameters)
    except ValidationError as error:
        problems = [
            (f"mesh.parameters.{'.'.join(map(str, d['loc']))}", f"{d['msg'].removeprefix('Value error, ')}")
            for d in error.errors()
        ]
        raise SceneError(problems) from None


def coarser_parameters(name: str, parameters: Mapping[str, Any], factor: float) -> dict[str, Any]:
    """The parameters with which the generator ``name`` makes elements ``factor`` times as large.

    Raises:
        SceneError: the generator has no function ``coarser(parameters, factor)``.
    """
    coarser = getattr(_generator(name), "coarser", None)
    if coarser is None:
        raise SceneError([("solver.levels", f"the generator {name!r} makes no coarser meshes: use levels = 1")])
    result: dict[str, Any] = coarser(dict(parameters), factor)
    return result


def read_mesh(file: Path, comm: MPI.Comm) -> TaggedMesh:
    """A mesh from a gmsh file with physical groups for its boundaries and its body.

    Raises:
        MeshError: there is no such file, or it is no mesh of that format.
    """
    if file.suffix.lower() not in _GMSH_SUFFIXES:
        raise MeshError(f"{file}: unknown mesh format {file.suffix!r}; known are {', '.join(sorted(_GMSH_SUFFIXES))}")

    def draw(gmsh: Any) -> None:
        if not file.is_file():
            raise MeshError(f"{file}: no such file")
        try:
            gmsh.open(str(file))
            if file.suffix.lower() == ".geo":
                gmsh.model.mesh.generate(2)
        except Exception as error:
            raise MeshError(f"{file}: gmsh cannot read it: {error}") from None

    return gmsh_mesh(comm, draw, name=str(file))


def _generator(name: str) -> Any:
    """The module of a generator."""
    known = sorted(module.name for module in pkgutil.iter_modules(meshes.__path__))
    if name not in known:
        raise SceneError([("mesh.generator", f"no generator {name!r}; there are: {', '.join(known)}")])
    return importlib.import_module(f"signorini_fx.meshes.{name}")


def gmsh_mesh(comm: MPI.Comm, draw: Callable[[Any], None], name: str, unit: float = 1.0) -> TaggedMesh:
    """Let ``draw(gmsh)`` make a meshed gmsh model on the first rank, and distribute it.

    Args:
        comm: the ranks that share the mesh.
        draw: called on the first rank only; leaves a meshed two-dimensional model with physical groups.
        name: what to call the mesh in messages.
        unit: length of the model's unit.  The tolerances of gmsh are absolute: what it draws should be neither large
            nor small, and have the same numbers in all units.

    Raises:
        MeshError: the model has no cells, no physical group for the body, or no named boundary.
    """

    def build() -> tuple[dict[str, int], dict[str, int]]:
        import gmsh

        gmsh.initialize(interruptible=False)
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.RandomSeed", 1)
        draw(gmsh)
        groups = gmsh.model.getPhysicalGroups()
        if not any(dim == 2 for dim, _ in groups):
            raise MeshError(f"{name}: the mesh has no physical group of dimension 2 (the body)")
        kinds = {kind for dim, tag in groups if dim == 2 for kind in _cell_kinds(gmsh, tag)}
        if not kinds:
            raise MeshError(f"{name}: the body has no cells")
        if len(kinds) > 1:
            raise MeshError(f"{name}: the mesh mixes cell types or orders; use one")
        lines, surfaces = (
            {gmsh.model.getPhysicalName(d, tag) or f"{kind}_{tag}": tag for dim, tag in groups if dim == d}
            for d, kind in ((1, "boundary"), (2, "region"))
        )
        return lines, surfaces

    try:
        boundaries, regions = parallel.on_root(comm, build)
        model = None
        if parallel.is_root(comm):
            import gmsh

            model = gmsh.model
        mesh, cell_tags, facet_tags = compat.gmsh_model_to_mesh(model, comm, 2)
    finally:
        if parallel.is_root(comm):
            import gmsh

            if gmsh.isInitialized():
                gmsh.finalize()
    if facet_tags is None or not boundaries:
        raise MeshError(f"{name}: the mesh has no named boundary: give it physical groups of dimension 1")
    mesh.geometry.x[:] *= unit
    return TaggedMesh(mesh, facet_tags, boundaries, cell_tags, regions)


def _cell_kinds(gmsh: Any, group: int) -> set[int]:
    entities = gmsh.model.getEntitiesForPhysicalGroup(2, group)
    return {int(kind) for entity in entities for kind in gmsh.model.mesh.getElementTypes(2, entity)}


def tag_boundaries(mesh: dmesh.Mesh, markers: Mapping[str, Callable[[npt.NDArray[np.float64]], Any]]) -> TaggedMesh:
    """Name the exterior facets whose vertices all satisfy a marker.

    Args:
        mesh: the mesh.
        markers: name -> function of points of shape (3, n) that gives truth values of shape (n,).
    """
    dim = mesh.topology.dim - 1
    found = [dmesh.locate_entities_boundary(mesh, dim, marker) for marker in markers.values()]
    facets = np.concatenate(found).astype(np.int32)
    tags = np.concatenate([np.full(len(f), tag) for tag, f in enumerate(found, start=1)]).astype(np.int32)
    order = np.argsort(facets, kind="stable")
    facets, first = np.unique(facets[order], return_index=True)
    facet_tags = dmesh.meshtags(mesh, dim, facets, tags[order][first])
    return TaggedMesh(mesh, facet_tags, {name: tag for tag, name in enumerate(markers, start=1)})
