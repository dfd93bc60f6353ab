"""Bodies of revolution in contact, whose sides have their nodes at the same places."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from dolfinx import mesh as dmesh
from mpi4py import MPI
from two_bodies import assembled, grid

from signorini_fx.mechanics.mesh.tagged import TaggedMesh, tag_boundaries
from signorini_fx.scenes.reading import parse_scene

# Sides of a box by the direction across and the end.
SIDES = {"left": (0, 0), "right": (0, 1), "bottom": (1, 0), "top": (1, 1)}


class Box(NamedTuple):
    """A rectangle of radii and heights before it is placed, and its material."""

    name: str
    counts: tuple[int, int]
    low: tuple[float, float]
    high: tuple[float, float]
    young: float = 200.0
    poisson: float = 0.3


class Touching(NamedTuple):
    """Contact of two sides, "body.side" each: a gap along the normal, and friction as a scene has
    it.
    """

    slave: str
    master: str
    gap: object = 0.0
    friction: dict = MappingProxyType({})
    kind: str = "unilateral"


@dataclass(frozen=True)
class Bodies:
    """Boxes with what holds, loads and joins them.

    Attributes:
        kind: of the cells.
        boxes: the bodies.
        place: from points of shape (n, 2) before to those after they are placed; None: as they are.
        held: of sides their prescribed components: ("body.side", {"x" or "y": value}).
        pressed: sides with a pressure.
        touching: contacts.
        pull: force per volume along the axis.
    """

    kind: str
    boxes: list[Box]
    place: object = None
    held: list[tuple[str, dict]] = field(default_factory=list)
    pressed: list[tuple[str, float]] = field(default_factory=list)
    touching: list[Touching] = field(default_factory=list)
    pull: float = 0.0

    @property
    def pieces(self):
        """Cells and points of each."""
        return [grid(self.kind, box.counts, box.low, box.high, self.place) for box in self.boxes]

    @property
    def origin(self):
        """The points before they are placed, of all bodies."""
        return np.concatenate(
            [grid(self.kind, box.counts, box.low, box.high)[1] for box in self.boxes]
        )

    def nodes(self, name):
        """The nodes of a side, in order along it."""
        body, side = name.split(".")
        axis, end = SIDES[side]
        start = 0
        for box, (_, x) in zip(self.boxes, self.pieces, strict=True):
            if box.name == body:
                origin = self.origin[start : start + len(x)]
                limit = (box.low, box.high)[end][axis]
                on = np.flatnonzero(np.isclose(origin[:, axis], limit))
                return start + on[np.argsort(origin[on, 1 - axis])]
            start += len(x)
        raise KeyError(name)

    def mesh(self, comm=MPI.COMM_SELF):
        """All bodies as one mesh, with the names of bodies and sides."""
        mesh = assembled(self.kind, *self.pieces, comm=comm)
        mesh.topology.create_connectivity(1, 2)
        facets = dmesh.exterior_facet_indices(mesh.topology)
        at = mesh.geometry.input_global_indices[dmesh.entities_to_geometry(mesh, 1, facets)]
        tags, names = np.zeros(len(facets), dtype=np.int32), {}
        for number, name in enumerate(f"{box.name}.{side}" for box in self.boxes for side in SIDES):
            tags[np.isin(at, self.nodes(name)).all(axis=1)] = names[name] = number + 1
        cells = mesh.topology.index_map(2).size_local + mesh.topology.index_map(2).num_ghosts
        counts = np.cumsum([len(part) for part, _ in self.pieces])
        of_cell = (
            np.searchsorted(counts, mesh.topology.original_cell_index[:cells], side="right").astype(
                np.int32
            )
            + 1
        )
        return TaggedMesh(
            mesh,
            dmesh.meshtags(mesh, 1, facets[tags > 0], tags[tags > 0]),
            names,
            dmesh.meshtags(mesh, 2, np.arange(cells, dtype=np.int32), of_cell),
            {box.name: number + 1 for number, box in enumerate(self.boxes)},
        )

    def scene(self, comm=MPI.COMM_SELF, material=None, **more):
        """The same for the package; ``more``: further entries."""
        contacts = [
            {
                "boundary": pair.slave,
                "against": pair.master,
                "points": "boundary",
                "kind": pair.kind,
            }
            | ({} if pair.kind == "bonded" else {"distance": "nominal", "gap": pair.gap})
            | ({"friction": dict(pair.friction)} if pair.friction else {})
            for pair in self.touching
        ]
        common = {"hypothesis": "axisymmetric", **(material or {})}
        given = {
            "mesh": self.mesh(comm),
            "material": [
                {"region": b.name, "young": b.young, "poisson": b.poisson, **common}
                for b in self.boxes
            ],
            "displacement": [{"boundary": name, **values} for name, values in self.held],
            "traction": [{"boundary": name, "pressure": value} for name, value in self.pressed],
            "body_force": {"y": self.pull} if self.pull else None,
            "contact": contacts,
        }
        return parse_scene({key: value for key, value in given.items() if value} | more)


def section(
    inner=0.0, outer=2.0, height=1.0, cells="quadrilateral", counts=(8, 4), comm=MPI.COMM_WORLD
):
    """A rectangle of radii and heights: a cylinder, or a ring."""
    mesh = dmesh.create_rectangle(
        comm, [(inner, 0.0), (outer, height)], counts, dmesh.CellType[cells]
    )
    near = {"inside": (0, inner), "outside": (0, outer), "bottom": (1, 0.0), "top": (1, height)}
    return tag_boundaries(
        mesh,
        {name: lambda x, k=k, at=at: np.abs(x[k] - at) < 1e-9 for name, (k, at) in near.items()},
    )
