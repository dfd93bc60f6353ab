"""A problem of another program's case: mesh, materials, supports and loads at each instant, and contact.

No dolfinx here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from signorini_fx.addons.aster.grouped_mesh import GroupedMesh
from signorini_fx.addons.aster.values import Concept
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints

# Kinds of models, and what the elements of a deck are called for them, before their number of nodes.
MODELS = {"3D": "C3D", "D_PLAN": "CPE", "C_PLAN": "CPS", "AXIS": "CAX"}


@dataclass(frozen=True)
class Support:
    """A component of some nodes that is prescribed.

    Attributes:
        nodes: of the mesh.
        component: 0 to 2.
        values: at each instant one for all nodes, or one for each; None: nothing holds them then.
        origin: of the command.
    """

    nodes: Ints
    component: int
    values: Sequence[float | Floats | None]
    origin: str


@dataclass(frozen=True)
class SurfaceLoad:
    """A load on elements of the boundary.

    Attributes:
        cells: block by block whether an element belongs.
        vector: for each instant pressure, or force per area; shape (instants,) or (instants, 3).
        origin: of the command.
    """

    cells: list[Any]
    vector: Floats
    origin: str


@dataclass(frozen=True)
class NodalForce:
    """Forces at nodes.

    Attributes:
        nodes: of the mesh.
        values: for each instant, shape (instants, 3).
        origin: of the command.
    """

    nodes: Ints
    values: Floats
    origin: str


@dataclass(frozen=True)
class Relation:
    """A linear relation of displacements: the sum of terms is zero.

    Attributes:
        terms: node, component and coefficient.
        origin: of the command.
    """

    terms: tuple[tuple[int, int, float], ...]
    origin: str


@dataclass(frozen=True)
class ExcludedNodes:
    """Nodes of the slave surface of a zone without contact, or without friction.

    Attributes:
        nodes: shape (n,).
        acting: the directions along which it would act, shape (n, 3).
        zone: the number of the zone.
        rubs: whether it is friction alone.
        directed: whether it is friction along a direction alone.
        origin: of the command, with the keyword.
    """

    nodes: Ints
    acting: Floats
    zone: int
    rubs: bool
    directed: bool
    origin: str


@dataclass(frozen=True)
class Zone:
    """Two surfaces that may touch.

    Attributes:
        slave: block by block whether an element belongs.
        master: likewise.
        coefficient: of friction.
        stiffness: stress per length by which contact gives way; None: it is hard.
        sticking: the same of friction.
        origin: of the command.
        number: of the zone, from 1.
        vector: whether LAGS_C is a component of a multiplier, and not the contact pressure.
        apart: nodes of the slave surface without contact.
        smooth: those without friction.
        tied: whether both surfaces are bonded, and do not slide or open.
    """

    slave: list[Any]
    master: list[Any]
    coefficient: float
    stiffness: float | None
    sticking: float | None
    origin: str
    number: int
    vector: bool
    apart: Ints
    smooth: Ints
    tied: bool = False

    def without(self, nodes: Ints, *, rubbing: bool) -> Zone:
        """The zone with further nodes that have no contact, or if ``rubbing`` no friction."""
        if rubbing:
            return replace(self, smooth=np.union1d(self.smooth, nodes))
        return replace(self, apart=np.union1d(self.apart, nodes))


@dataclass
class CaseStudy:
    """A problem of a case.

    Attributes:
        mesh: with its groups.
        model: one of ``MODELS``.
        body: block by block whether an element belongs to the body.
        instants: those that are solved, without the first one, which is the beginning.
        lost: what changes the answer, with its place.
        noted: what does not.
        follows: what says that contact follows the surfaces as they move; "": it does not.
        formulations: how the other program solves its contact, in words.
        excluded: what says that nodes of slave surfaces have no contact or friction.
        stays: zones whose contact does not open again, with their command.
        finite: what says that strains and rotations may be large; "": they are small.
    """

    mesh: GroupedMesh
    model: str
    body: list[Any]
    instants: list[float] = field(default_factory=list)
    materials: list[tuple[list[Any], dict[str, float], str]] = field(default_factory=list)
    supports: list[Support] = field(default_factory=list)
    pressures: list[SurfaceLoad] = field(default_factory=list)
    tractions: list[SurfaceLoad] = field(default_factory=list)
    forces: list[NodalForce] = field(default_factory=list)
    gravities: list[tuple[Floats, str]] = field(default_factory=list)
    relations: list[Relation] = field(default_factory=list)
    zones: list[Zone] = field(default_factory=list)
    lost: list[str] = field(default_factory=list)
    noted: list[str] = field(default_factory=list)
    follows: str = ""
    formulations: list[str] = field(default_factory=list)
    excluded: list[ExcludedNodes] = field(default_factory=list)
    stays: list[str] = field(default_factory=list)
    finite: str = ""

    @property
    def dim(self) -> int:
        """Of the body."""
        return 3 if self.model == "3D" else 2

    @property
    def has_27_nodes(self) -> bool:
        """Whether cells have nodes in the middle of their faces, which the deck has not: forces at nodes are others."""
        pairs = zip(self.mesh.blocks, self.body, strict=True)
        return any(kind == "hexahedron27" and bool(mark.any()) for (kind, _), mark in pairs)

    @property
    def nodal(self) -> bool:
        """Whether supports have a value of its own at each node, so that a finer mesh lacks some."""
        return any(isinstance(value, np.ndarray) for support in self.supports for value in support.values)

    @property
    def circumference(self) -> float:
        """Of the forces of the whole ring those that the case states: per radian of a body of revolution."""
        return 2 * np.pi if self.model == "AXIS" else 1.0

    def lose(self, origin: str, why: str) -> None:
        """Say that something is not in the scene that changes its solution."""
        add_once(self.lost, f"{origin}: {why}" if origin else why)

    def note(self, origin: str, why: str) -> None:
        """Say that something is told in another way, or is nothing that a scene is about."""
        add_once(self.noted, f"{origin}: {why}" if origin else why)

    @property
    def slave_corners(self) -> Ints:
        """The corners of all elements of slave surfaces: those nodes have a contact pressure, between which it is
        linear; none of zones whose pressure has another name, and of bonds.
        """
        parts = [self.mesh.corners_of_cells(zone.slave) for zone in self.zones if not (zone.vector or zone.tied)]
        return np.unique(np.concatenate([np.empty(0, dtype=np.int64), *parts]))


@dataclass
class AsterStudy(CaseStudy):
    """A problem of a command file.

    Attributes:
        result: what is solved.
    """

    result: Concept = field(kw_only=True)


def add_once(remarks: list[str], remark: str) -> None:
    """Add what is not there yet."""
    if remark not in remarks:
        remarks.append(remark)
