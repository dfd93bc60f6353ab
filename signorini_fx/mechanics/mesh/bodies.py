"""Several bodies, each with its own mesh, rotated and moved to their places in one mesh of several
pieces.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import TypeVar

import numpy as np
from mpi4py import MPI

from signorini_fx.arrays import Ints, Plain
from signorini_fx.errors import MeshError, SceneError
from signorini_fx.mechanics.mesh.files.arrays import MeshArrays
from signorini_fx.mechanics.mesh.halving import quadratic
from signorini_fx.mechanics.mesh.tagged import TaggedMesh, arrays_of, from_arrays
from signorini_fx.mechanics.statement.base import TaggedMeshBase
from signorini_fx.mechanics.statement.mesh_sources import Body, MeshFile, MeshGenerator


def together(
    bodies: Sequence[Body], load: Callable[[int, MPI.Comm], TaggedMesh], comm: MPI.Comm
) -> TaggedMesh:
    """Return several bodies as one mesh; collective.

    The cells of a body are the region of its name.  Its boundaries and regions are called
    ``body.name``; a name that only one body has is also available without the prefix.  Where some
    bodies have curved cells, the others get nodes in the middle of their sides.

    The first rank makes the mesh of each body, by ``load`` of its number, so that the order of the
    cells does not depend on the ranks, and checkpoints fit any number of them.

    Raises:
        SceneError: keys that do not fit the dimension of the meshes, or errors of a mesh, which
            name the body.
        MeshError: the meshes have different kinds of cells, or a mesh cannot be made.
    """

    def of_body(number: int, ranks: MPI.Comm) -> MeshArrays:
        with naming(number, bodies[number]):
            return arrays_of(load(number, ranks))

    # Meshes of the caller are on all ranks.
    given = {
        number: of_body(number, comm)
        for number, body in enumerate(bodies)
        if isinstance(body.mesh, TaggedMesh)
    }

    def make() -> MeshArrays:
        return _joined(
            bodies, [given.get(k) or of_body(k, MPI.COMM_SELF) for k in range(len(bodies))]
        )

    return replace(
        from_arrays(comm, make),
        origin={"bodies": {body.name: _origin(body.mesh) for body in bodies}},
    )


def _joined(bodies: Sequence[Body], meshes: Sequence[MeshArrays]) -> MeshArrays:
    """Return the mesh of all bodies at their places."""
    if len({mesh.degree for mesh in meshes}) > 1:
        meshes = [quadratic(mesh) if mesh.degree == 1 else mesh for mesh in meshes]
    _check_alike(bodies, meshes)
    names = [body.name for body in bodies]
    first_point, first_cell, first_facet = (
        [0, *np.cumsum([len(entities) for entities in of_bodies])]
        for of_bodies in zip(
            *((mesh.points, mesh.cells, mesh.facets) for mesh in meshes), strict=True
        )
    )
    regions = _named(names, [mesh.regions for mesh in meshes], first_cell)
    whole = {name: np.arange(first_cell[k], first_cell[k + 1]) for k, name in enumerate(names)}
    return MeshArrays(
        points=np.concatenate(
            [body.moved_points(mesh.points) for mesh, body in zip(meshes, bodies, strict=True)]
        ),
        kind=meshes[0].kind,
        cells=np.concatenate(
            [mesh.cells + first for mesh, first in zip(meshes, first_point, strict=False)]
        ),
        facets=np.concatenate(
            [mesh.facets + first for mesh, first in zip(meshes, first_point, strict=False)]
        ),
        boundaries=_named(names, [mesh.boundaries for mesh in meshes], first_facet),
        regions=regions | whole,
        astray=_named(names, [mesh.astray for mesh in meshes], [0] * len(meshes)),
    )


_Rows = TypeVar("_Rows", Ints, int)


def _named(
    bodies: Sequence[str], named: Sequence[Mapping[str, _Rows]], firsts: Sequence[int]
) -> dict[str, _Rows]:
    """Return the rows of each name of the bodies in the joint mesh, as ``body.name``, and as the
    plain name if only one body has it and no body is called so.
    """
    count = Counter(name for names in named for name in names)
    result = {}
    for body, names, first in zip(bodies, named, firsts, strict=False):
        for name, rows in names.items():
            result[f"{body}.{name}"] = rows + first
            if count[name] == 1 and name not in bodies:
                result[name] = rows + first
    return result


def _origin(mesh: MeshFile | MeshGenerator | TaggedMeshBase) -> Mapping[str, Plain]:
    """Return the source of a mesh in the terms of a scene, see ``TaggedMesh``."""
    match mesh:
        case MeshFile():
            return {"file": mesh.file.name}
        case MeshGenerator():
            return {"generator": mesh.generator, "parameters": dict(mesh.parameters)}
        case _:
            assert isinstance(mesh, TaggedMesh)
            return mesh.origin


@contextmanager
def naming(number: int, body: Body) -> Iterator[None]:
    """Add the name of the body to errors of its mesh: keys of a table ``mesh`` become keys of the
    body.
    """
    try:
        yield
    except SceneError as error:
        problems = [
            (f"body[{number}].{path}" if path.startswith("mesh") else path, reason)
            for path, reason in error.problems
        ]
        raise SceneError(problems) from None
    except MeshError as error:
        raise MeshError(f"body {body.name!r}: {error}") from None


def _check_alike(bodies: Sequence[Body], meshes: Sequence[MeshArrays]) -> None:
    """Check that the meshes have one kind of cell, and that the bodies are placed in their
    dimension.
    """
    first = meshes[0]
    for body, mesh in zip(bodies, meshes, strict=True):
        if mesh.kind != first.kind:
            simplices = "tetrahedra" if mesh.dim == 3 else "triangles"
            raise MeshError(
                f"body {body.name!r} has {mesh.cell.word}, body {bodies[0].name!r} "
                f"{first.cell.word}: a mesh has one "
                f"kind of cell. Generators have a parameter 'cell'; gmsh makes {simplices} of a "
                "drawing without "
                "Recombine, ParaView's filter Tetrahedralize of any file"
            )
    problems = [
        (f"body[{number}].{key}", reason)
        for number, body in enumerate(bodies)
        for key, reason in body.placing_contradictions(first.dim)
    ]
    if problems:
        raise SceneError(problems)
