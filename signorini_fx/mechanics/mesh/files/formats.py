"""Mesh files, read into arrays by gmsh, meshio (.med, .vtu, .xdmf), dolfinx (its .xdmf) and the
add-on for decks.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree

import numpy as np

from signorini_fx.errors import MeshError, SceneError
from signorini_fx.extensions import add_on
from signorini_fx.mechanics.mesh.files.arrays import MeshArrays, RawMesh, from_raw
from signorini_fx.mechanics.mesh.files.cells import curvature, kind_of_mesh, order_in
from signorini_fx.mechanics.mesh.files.gmsh_reader import CAD, content, read_gmsh
from signorini_fx.mechanics.mesh.files.size_field import SizeField, Sizes
from signorini_fx.mechanics.mesh.halving import halved, straightened
from signorini_fx.mechanics.statement.mesh_sources import (
    DRAWN,
    MESH_FORMATS,
    MeshFile,
    MeshInMemory,
)
from signorini_fx.tuned import SAME_LENGTH

if TYPE_CHECKING:
    import meshio


def read_file(
    mesh: MeshFile,
    halvings: int = 0,
    degree: int | None = None,
    sizes: Sizes = (),
    *,
    joined: bool = False,
) -> MeshArrays:
    """Return a 2D or 3D mesh from a file; its suffix determines the format.

    A drawing (.geo, .step, .stp, .brep) is meshed again on the true shape; the cells of other
    meshes are divided, along their own curved sides.  With ``joined``, solids of a CAD drawing that
    touch or overlap share faces.  For the other arguments see ``load_file``.

    Raises:
        MeshError: there is no such file, it cannot be read, or it is not a mesh of one kind of
            cell.
        SceneError: a selection is empty, or a cell size cannot be made.
    """
    file = mesh.file
    suffix = mesh.file.suffix.lower()
    if suffix not in MESH_FORMATS:
        raise MeshError(
            f"{file}: unknown mesh format {file.suffix!r}; supported are "
            f"{', '.join(sorted(MESH_FORMATS))}"
        )
    if not os.path.isfile(file):  # a name may be of any length
        raise MeshError(f"{file}: no such file")
    if mesh.size is not None and suffix not in CAD:
        suffixes = ", ".join(CAD)
        raise SceneError.at(
            "mesh.size",
            f"a {file.suffix} file determines the size of its cells; a size is for {suffixes}",
        )
    if not mesh.drawn and not isinstance(sizes, SizeField) and sizes:
        message = (
            f"a {file.suffix} file has its cells already: give its drawing ({', '.join(DRAWN)}), "
            "or let "
            "[accuracy] with refinement = 'adaptive' divide straight triangles or tetrahedra"
        )
        raise SceneError.at(sizes[0].path, message)

    def named(raw: RawMesh) -> MeshArrays:
        return from_raw(raw, str(file), mesh.boundaries, mesh.regions, mesh.data)

    if mesh.drawn:
        drawn = read_gmsh(mesh, named, halvings, degree, sizes, joined=joined)
        # Nodes between the corners are for curves.
        near = SAME_LENGTH * drawn.diagonal
        straight = degree == 2 and curvature(drawn.points, drawn.cells, drawn.cell) <= near
        return straightened(drawn) if straight else drawn
    if suffix == ".msh":
        arrays = read_gmsh(mesh, named)
    else:
        arrays = named(
            add_on("deck_files").read_model(file).raw
            if suffix == ".inp"
            else read_meshio(file, suffix[1:])
        )
    if degree == 1:
        arrays = straightened(arrays)
    for _ in range(halvings):
        arrays = halved(arrays)
    return arrays


def files_of(file: Path) -> list[Path]:
    """Return a file, and if it is an Abaqus input file the files that it includes.

    Raises:
        MeshError: it cannot be read as an Abaqus input file.
    """
    return (
        list(add_on("deck_files").read_keywords(file)[1])
        if file.suffix.lower() == ".inp"
        else [file]
    )


def raw_of(mesh: MeshInMemory) -> RawMesh:
    """Return the content of a mesh that another program holds in memory.

    Raises:
        MeshError: it has no cells, or it cannot be read.
    """
    if mesh.program == "meshio":
        return _of_meshio(mesh.source)
    if mesh.program == "pyvista":
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder, "grid.vtu")
            mesh.source.cast_to_unstructured_grid().save(file)
            return read_meshio(file, "vtu")
    import gmsh

    if not gmsh.isInitialized() or not len(gmsh.model.mesh.getElementTypes(2)):
        raise MeshError("gmsh.model has no cells: call gmsh.model.mesh.generate before")
    return content(gmsh)


# --- meshio ---------------------------------------------------------------------------------------


def read_meshio(file: Path, kind: str) -> RawMesh:
    """Return the content of a file in a format of meshio.

    The reader of the format is called directly, because ``meshio.read`` ends the process if it
    cannot read a file.

    Raises:
        MeshError: it cannot be read, or meshio or h5py is not installed.
    """
    try:
        form = importlib.import_module(f"meshio.{kind}")
        silent = (
            contextlib.redirect_stdout(io.StringIO()),
            contextlib.redirect_stderr(io.StringIO()),
        )
        with silent[0], silent[1], np.errstate(over="ignore"):
            grids = (
                ElementTree.parse(file).getroot().findall("./Domain/Grid") if kind == "xdmf" else []
            )
            if len(grids) > 1:
                return _of_dolfinx(file, [grid.get("Name", "") for grid in grids])
            return _of_meshio(form.read(str(file)))
    except (Exception, SystemExit) as error:  # meshio passes on whatever its parsers raise
        reason = str(error) or type(error).__name__
        raise MeshError(f"{file}: meshio cannot read it as {kind}: {reason}") from None


def _of_meshio(mesh: meshio.Mesh) -> RawMesh:
    raw = RawMesh(
        np.asarray(mesh.points),
        [(block.type, np.asarray(block.data, np.int64)) for block in mesh.cells],
    )
    for name, arrays in mesh.cell_data.items():
        if all(
            np.ndim(values) == 1 and np.issubdtype(np.asarray(values).dtype, np.integer)
            for values in arrays
        ):
            raw.data[name] = [np.asarray(values, dtype=np.int64) for values in arrays]
    for name, rows in getattr(mesh, "cell_sets", {}).items():
        if not name.startswith("gmsh:"):
            raw.sets[name] = [np.asarray([] if r is None else r, dtype=np.int64) for r in rows]
    for name, members in getattr(mesh, "point_sets", {}).items():
        raw.node_sets[name] = np.asarray(members, dtype=np.int64)
    # In MED an element, or a node, has the number of a family, and a family belongs to groups.
    families = raw.data.pop("cell_tags", None) if hasattr(mesh, "cell_tags") else None
    for number, groups in mesh.cell_tags.items() if families is not None else ():
        for name in groups:
            rows = [np.flatnonzero(values == number) for values in families or ()]
            raw.sets[name] = [
                np.union1d(*pair) for pair in zip(raw.sets.get(name, rows), rows, strict=True)
            ]
    nodes = mesh.point_data.get("point_tags")
    for number, groups in mesh.point_tags.items() if nodes is not None else ():
        for name in groups:
            members = np.flatnonzero(np.asarray(nodes) == number)
            raw.node_sets[name] = np.union1d(raw.node_sets.get(name, members), members)
    return raw


def _of_dolfinx(file: Path, names: list[str]) -> RawMesh:
    """Return a mesh and tags that dolfinx has written into one XDMF file, from which meshio would
    read the mesh only.
    """
    import mpi4py.MPI  # first, see signorini_fx.mechanics.body
    from dolfinx import mesh as dmesh
    from dolfinx.io import XDMFFile

    from signorini_fx.machine import compat

    with XDMFFile(mpi4py.MPI.COMM_SELF, file, "r") as xdmf:
        mesh = xdmf.read_mesh(name=names[0])
        dim = mesh.topology.dim
        kind = kind_of_mesh(mesh)
        mesh.topology.create_connectivity(dim - 1, dim)
        all_tags = {name: xdmf.read_meshtags(mesh, name=name) for name in names[1:]}
    if kind is None:
        raise ValueError("its cells have a degree above 2")
    cells = compat.geometry_cells(mesh)[:, np.argsort(order_in("vtk", kind))]
    raw = RawMesh(mesh.geometry.x, [(kind.kind, cells.astype(np.int64))])
    of_facets = {name: tags for name, tags in all_tags.items() if tags.dim == dim - 1}
    for tags in of_facets.values():
        raw.blocks.append(
            (kind.facet, dmesh.entities_to_geometry(mesh, dim - 1, tags.indices).astype(np.int64))
        )
    for name, tags in all_tags.items():
        raw.data[name] = [np.full(len(nodes), -1) for _, nodes in raw.blocks]
        if tags.dim == dim:
            raw.data[name][0][tags.indices] = tags.values
        elif name in of_facets:
            raw.data[name][1 + list(of_facets).index(name)][:] = tags.values
    return raw
