"""The content of an Abaqus input file in terms of a scene: loads by step, names of boundaries, what was left out.

No dolfinx here.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from signorini_fx.addons.decks.keywords import CONSTRAINT, PLAIN
from signorini_fx.mechanics.kinematics import of_materials
from signorini_fx.mechanics.kinematics.protocol import Kinematics
from signorini_fx.mechanics.mesh.files.abaqus import DeckModel
from signorini_fx.mechanics.mesh.files.abaqus_blocks import DeckBlock
from signorini_fx.mechanics.mesh.files.abaqus_groups import Group, single
from signorini_fx.mechanics.mesh.files.arrays import MeshArrays
from signorini_fx.mechanics.mesh.files.cells import dimension
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints
from signorini_fx.mechanics.statement.point_values import same_places
from signorini_fx.tuned import ZERO_SUM

# CalculiX takes a body of revolution as a sector of so many degrees, whose nodal forces it prints.
_SECTOR = 2.0


@dataclass
class DeckLoad:
    """A boundary condition or a load with its value in the steps that give one; in others it stays as it was.

    Attributes:
        table: of the scene.
        target: name of its boundary.
        keys: of the table.
        direction: share of the value in each key.
        block: the first keyword that gives it.
        lines: of its table besides the keys.
        values: step -> value; None: it ends with this step.
        within: where it acts, a condition of a scene; empty: everywhere.
        parts: step -> the keywords that give its value there, and what each gives before its amplitude is applied.
    """

    table: str
    target: str
    keys: tuple[str, ...]
    block: DeckBlock
    direction: tuple[float, ...] = (1.0,)
    lines: tuple[str, ...] = ()
    values: dict[int, float | None] = field(default_factory=dict)
    within: str = ""
    parts: dict[int, list[tuple[DeckBlock, float]]] = field(default_factory=dict)

    @property
    def keyword(self) -> str:
        """That gives it."""
        return self.block.keyword

    def by_step(self, steps: int) -> list[float | None]:
        """Its value in each step, None where there is none; what was given before the first one holds in all."""
        current, values = self.values.get(-1), []
        for step in range(steps):
            current = self.values.get(step, current)
            values.append(current)
        return values


@dataclass(frozen=True)
class DeckSection:
    """A part of the body and its material.

    Attributes:
        region: its name in the mesh; empty: the whole body.
        material: its name, in capitals.
        orientation: that of its axes, in capitals; empty: those of the file.
        block: the keyword.
    """

    region: str
    material: str
    orientation: str
    block: DeckBlock


@dataclass(frozen=True)
class Turn:
    """The axes of a *TRANSFORM.

    Attributes:
        first: of rectangular axes a point on the first one, of cylindrical ones a point on the axis, shape (3,).
        second: of rectangular axes a point in the plane of the first two, else another one on the axis, shape (3,).
        round: whether they are cylindrical: along the radius, around the axis and along it.
    """

    first: tuple[float, ...]
    second: tuple[float, ...]
    round: bool

    def at(self, x: Floats) -> Floats | None:
        """The unit vectors at a point of shape (3,), one per row, shape (3, 3); None: it is on the axis.

        Raises:
            ValueError: the points do not determine them.
        """
        first, second = np.array(self.first), np.array(self.second)
        if not self.round:
            return frame(first, second)
        if not (length := float(np.linalg.norm(second - first))) > 0:
            raise ValueError("its points are at one place")
        axis = (second - first) / length
        radius = (x - first) - ((x - first) @ axis) * axis
        if np.linalg.norm(radius) <= ZERO_SUM * length:
            return None
        radius /= np.linalg.norm(radius)
        return np.array([radius, np.cross(axis, radius), axis])


def frame(first: Floats, second: Floats) -> Floats:
    """Unit vectors along a vector, across it in its plane with another one, and normal to both, shape (3, 3).

    Raises:
        ValueError: the vectors are in line.
    """
    normal = np.cross(first, second)
    rows = np.array([first, np.cross(normal, first), normal])
    sizes = np.linalg.norm(rows, axis=1, keepdims=True)
    if not sizes.all():
        raise ValueError("its points are in line")
    return np.asarray(rows / sizes)


@dataclass
class Deck:
    """What has been read, and what was left out.

    ``temperatures`` has those of the nodes at the end of each step that changes them, and those at rest as step -1.
    ``turned`` has the *TRANSFORM of nodes, as ``Turn``.
    ``movers`` has the reference node of each rigid surface, ``coupled`` sets of nodes of the body with theirs, and
    ``turners`` the reference node for each node whose displacements are, in CalculiX, the rotations of a rigid body;
    ``bolts`` has the surface of each reference node of a *PRE-TENSION SECTION.  ``stiffness`` and ``sticking`` are
    those of interactions, stress per length, and ``adjusted`` has the ADJUST of pairs: a length, or a set of nodes.
    ``overclosures`` has other laws of soft contact as they are in a scene, ``behaviours`` what states each law.
    ``pairing`` has the keyword of each pair and tie, ``heating`` those that give temperatures.
    ``distributed`` has the boundary over which the force at each reference node of a *DISTRIBUTING is spread; those
    in ``cyclic`` are of a sector. ``rubbing`` has the coefficients of friction of interactions by the steps that
    change them. ``unpaired`` has pairs of surfaces that are lost, as they are in contact between sectors;
    ``vanished`` those that the first step removes, and ``clearances`` the distances of others, length. ``links``
    has the linear relations of nodes (``nodal.DeckLink``), and ``grounded`` the place among them of each that holds
    a component of one node. ``ends`` has the times at the ends of steps, ``kept`` the loads that keep what they
    reach in a step, with the step, whatever their amplitude does later. ``apart`` says that all contact is lost.
    ``untouched`` and ``smooth`` have the nodes of slave surfaces without contact, and without friction, by
    interactions.
    ``shells`` has the elements of sets of shells in space, and ``areas`` those that only carry a pressure to a side of
    the body (``load_areas.LoadArea``).
    ``nonlinear`` is the last step with NLGEOM, and ``finite`` says that the scene has finite strains because of it.
    ``taken`` has the places of the steps of the scene among all of the file, which has others, too, from 0; None: the
    file has no such step, see ``deck._friction_first``.
    ``paired`` has, for contact pairs that a later step removes or adds, whether they are there from a step on.
    ``at_nodes`` says that forces at nodes stay there, even if they are
    nearly those of an even traction.  ``slaves`` says that contact points are those of slave surfaces, whose
    pressure is wanted, and not those that the scene would choose.
    ``assumed`` is what the elements of the plane read last assume, in words, of which ``hypothesis`` is the key.
    """

    mesh: MeshArrays
    model: DeckModel
    said: dict[tuple[str, str, bool], list[str]] = field(default_factory=dict)
    title: str = ""
    materials: dict[str, dict[str, Any]] = field(default_factory=dict)
    orientations: dict[str, DeckBlock] = field(default_factory=dict)
    sections: list[DeckSection] = field(default_factory=list)
    hypothesis: str = ""
    assumed: str = ""
    thickness: float = 1.0
    steps: list[str] = field(default_factory=list)
    period: float = 1.0
    time: float = 0.0
    ends: dict[int, float] = field(default_factory=dict)
    kept: list[tuple[int, DeckBlock]] = field(default_factory=list)
    loads: dict[tuple[Any, ...], DeckLoad] = field(default_factory=dict)
    ended: set[tuple[int, str]] = field(default_factory=set)
    amplitudes: dict[str, DeckBlock] = field(default_factory=dict)
    temperatures: dict[int, Floats] = field(default_factory=dict)
    heating: list[DeckBlock] = field(default_factory=list)
    turned: dict[int, Turn] = field(default_factory=dict)
    frictions: dict[str, dict[str, float]] = field(default_factory=dict)
    stiffness: dict[str, float] = field(default_factory=dict)
    sticking: dict[str, float] = field(default_factory=dict)
    overclosures: dict[str, str] = field(default_factory=dict)
    behaviours: dict[str, DeckBlock] = field(default_factory=dict)
    pairs: list[tuple[str, str, str]] = field(default_factory=list)
    pairing: dict[tuple[str, ...], DeckBlock] = field(default_factory=dict)
    adjusted: dict[tuple[str, str, str], str] = field(default_factory=dict)
    ties: list[tuple[str, str]] = field(default_factory=list)
    tied: set[str] = field(default_factory=set)
    rigid: set[str] = field(default_factory=set)
    parts: dict[str, list[str]] = field(default_factory=dict)
    movers: dict[str, int] = field(default_factory=dict)
    coupled: list[tuple[str, int]] = field(default_factory=list)
    turners: dict[int, int] = field(default_factory=dict)
    bolts: dict[int, str] = field(default_factory=dict)
    drawn: dict[str, Sequence[list[str]]] = field(default_factory=dict)
    rough: set[str] = field(default_factory=set)
    untouched: dict[str, Ints] = field(default_factory=dict)
    smooth: dict[str, Ints] = field(default_factory=dict)
    rubbing: dict[str, dict[int, float]] = field(default_factory=dict)
    unpaired: set[frozenset[str]] = field(default_factory=set)
    vanished: set[frozenset[str]] = field(default_factory=set)
    clearances: dict[frozenset[str], float] = field(default_factory=dict)
    distributed: dict[int, str] = field(default_factory=dict)
    cyclic: set[int] = field(default_factory=set)
    links: list[Any] = field(default_factory=list)
    grounded: dict[str, int] = field(default_factory=dict)
    shells: dict[str, list[int]] = field(default_factory=dict)
    areas: dict[int, Any] = field(default_factory=dict)
    nonlinear: DeckBlock | None = None
    finite: bool = False
    taken: list[int | None] = field(default_factory=list)
    paired: dict[frozenset[str], dict[int, bool]] = field(default_factory=dict)
    apart: bool = False
    slaves: bool = False
    at_nodes: bool = False

    @property
    def kinematics(self) -> Kinematics:
        """That of its cells."""
        return of_materials([(self.hypothesis, False)])

    @property
    def printed_share(self) -> float:
        """Of the forces of a scene those that CalculiX prints: over the thickness, or of its sector of a ring."""
        if self.mesh.dim == 3:
            return 1.0
        return self.thickness if self.kinematics.uniform else _SECTOR / 360.0

    def outside(self, block: DeckBlock, what: str) -> None:
        """Say that something is given at nodes that are no part of the body; it matters where a constraint or an
        element that is none either ties them to it.
        """
        keywords = {keyword.keyword for keyword in self.model.blocks}
        constrained = keywords & {"RIGIDBODY", "EQUATION", "COUPLING", "MPC"} or any(
            rule.effect == CONSTRAINT for keyword, rule in PLAIN.items() if keyword in keywords
        )
        if self.model.tied or constrained:
            self.lose(block, f"{what}: no part of the body, which a constraint may tie to it")
        else:
            self.note(block, f"{what}: no part of the body")

    @property
    def touches(self) -> bool:
        """Whether it has contact, which may not be in the scene."""
        ties = [row for block in self.model.blocks if block.keyword == "TIE" for row in block.rows]
        return (
            any(block.keyword in ("CONTACT", "GAP") for block in self.model.blocks)
            or any(len(row) < 2 or not self.has_vanished(row[0], row[1]) for row in ties)
            or any(not self.has_vanished(slave, master) for slave, master, _ in self.pairs)
        )

    def has_vanished(self, slave: str, master: str) -> bool:
        """Whether the first step removes a contact pair, or all elements of one of its sides."""
        pair = frozenset((slave.upper(), master.upper()))
        return pair in self.vanished or not pair.isdisjoint(self.model.emptied)

    def touching_in(self, pair: frozenset[str], steps: int) -> list[bool]:
        """Whether the surfaces of a contact pair may touch, step by step."""
        changes, touches, course = self.paired.get(pair, {}), True, list[bool]()
        for step in range(steps):
            touches = changes.get(step, touches)
            course.append(touches)
        return course

    def facing(self, pair: tuple[str, str, str]) -> tuple[str, str, str]:
        """A contact pair as the scene has it: that of both sides of a sector is one with the next sector."""
        for sector in self.model.sectors.values():
            pair = sector.facing(pair)
        return pair

    @property
    def step(self) -> int:
        """The current one, from 0; -1 before the first."""
        return len(self.steps) - 1

    @property
    def given_steps(self) -> int:
        """How many steps of the scene are steps of the file."""
        return sum(place is not None for place in self.taken)

    @property
    def axes(self) -> str:
        """Of the mesh."""
        return "xyz"[: self.mesh.dim]

    def lose(self, block: DeckBlock | None, why: str) -> None:
        """Say that something is not in the scene that changes its solution."""
        self._say(block, why, lost=True)

    def note(self, block: DeckBlock | None, why: str) -> None:
        """Say that something is told in another way, or is nothing that a scene is about."""
        self._say(block, why, lost=False)

    def _say(self, block: DeckBlock | None, why: str, *, lost: bool) -> None:
        places = self.said.setdefault((block.name if block else "", why, lost), [])
        if block and block.place not in places:
            places.append(block.place)

    def remarks(self, *, lost: bool) -> list[str]:
        """What was lost, or only noted; what is so for the same reason several times is one line."""
        lines = []
        for (name, why, changes), places in self.said.items():
            repeats = f" and {len(places) - 1} more" if len(places) > 1 else ""
            if changes is lost:
                lines.append(f"{places[0]}, *{name}{repeats}: {why}" if places else why)
        return lines

    def course(self, load: DeckLoad, steps: int, *, releases: bool = False) -> list[float]:
        """The values of a load in the steps.

        Args:
            load: of this deck.
            steps: how many there are.
            releases: whether the scene has supports that hold in some steps only; else they are lost.
        """
        values = load.by_step(steps)
        if releases and load.table == "displacement":
            return [value or 0.0 for value in values]
        prescribes = load.table in ("displacement", "grounded") or load.keys[0] == "prescribed"
        if prescribes and None in values and any(value is not None for value in values):
            free = ", ".join(name for name, value in zip(self.steps, values, strict=False) if value is None)
            where = repr(load.target) if load.target else (*load.lines, "")[0]
            where = f"rigid body of node {load.target}" if load.table == "tool" else where
            where = f"node {self.number(int(load.target))}" if load.table == "grounded" else where
            self.lose(None, f"{where} is free along {load.keys[-1]} in {free}: here it is held there")
        return [value or 0.0 for value in values]

    def boundary(self, name: str) -> str | None:
        """The boundary of the mesh that a set or surface of the file is, whatever its case and its instance."""
        return _defined_name(name, self._boundaries)

    def surface(self, name: str) -> str | None:
        """The surface of faces of the file with a name, also one inside the body."""
        return _defined_name(name, self._surfaces)

    def region(self, name: str) -> str | None:
        """The same for a part of the body."""
        return _defined_name(name, self._regions)

    @cached_property
    def _boundaries(self) -> dict[str, str]:
        return _by_capitals(label for label, facets in self.mesh.boundaries.items() if facets.size)

    @cached_property
    def _surfaces(self) -> dict[str, str]:
        return _by_capitals(label for label, faces in self.model.surfaces.items() if faces)

    @cached_property
    def _regions(self) -> dict[str, str]:
        return _by_capitals(self.mesh.regions)

    @cached_property
    def _node_sets(self) -> dict[str, str]:
        return _by_capitals(self.model.raw.node_sets)

    @cached_property
    def size(self) -> float:
        """The diagonal of the box around the body, length."""
        return float(np.linalg.norm([np.ptp(coordinate) for coordinate in self.mesh.points.T]))

    @cached_property
    def numbers(self) -> Ints:
        """Row of the file of each node of the body, ascending; nodes that complete its cells have none."""
        raw = self.model.raw
        used = np.zeros(len(raw.points), dtype=bool)
        for kind, nodes in raw.blocks:
            if dimension(kind) == self.mesh.dim:
                used[nodes] = True
        return np.flatnonzero(used)

    @cached_property
    def names(self) -> Ints:
        """The number in the file of each node of the body, in the order of ``numbers``."""
        return np.asarray(self.model.places.numbers[self.numbers])

    @cached_property
    def bodies(self) -> dict[str, Ints]:
        """The name of each body and where its nodes are in ``numbers``; the name of the only one is empty."""
        if not self.model.bodies:
            return {"": np.arange(len(self.numbers))}
        nodes = {name: np.unique(self.mesh.cells[self.mesh.regions[name]]) for name in self.model.bodies}
        return {name: of_body[of_body < len(self.numbers)] for name, of_body in nodes.items()}

    def position(self, row: int) -> list[float]:
        """Of a row of the file that is a node of the body."""
        point: list[float] = self.mesh.points[np.searchsorted(self.numbers, row)].tolist()
        return point

    @cached_property
    def node_surfaces(self) -> set[str]:
        """Names of surfaces of nodes, in capitals."""
        surfaces = (block.parameters for block in self.model.blocks if block.keyword == "SURFACE")
        return {plain_name(entry.get("NAME", "")) for entry in surfaces if entry.get("TYPE", "").upper() == "NODE"}

    def frame_of(self, row: int) -> Floats | None:
        """The unit vectors of the displacement of a node of the body, one per row; None: they are those of space."""
        turn = self.turned.get(row)
        return None if turn is None else turn.at(np.pad(self.position(row), (0, 3 - self.mesh.dim)))

    def members_of(self, name: str) -> int:
        """How many nodes a set of the file has."""
        label = _defined_name(name, self._node_sets)
        return 0 if label is None else len(self.model.raw.node_sets[label])

    def number(self, row: int) -> int:
        """In the file, of a row of it that is a node of the body."""
        return int(self.names[np.searchsorted(self.numbers, row)])

    def node(self, row: int) -> int:
        """Of the mesh, of a row of the file that is a node of the body."""
        return int(np.searchsorted(self.numbers, row))

    def called(self, node: int) -> str:
        """A node of the mesh by its number in the file, or one that completes its cells."""
        return f"node {self.names[node]}" if node < len(self.names) else "a node in the middle of a face"

    def beside(self, row: int) -> tuple[list[str], str]:
        """The bodies of other nodes at the place of one, by its row in the file, and its own."""
        return self.together(self.node(row))

    def together(self, node: int) -> tuple[list[str], str]:
        """The bodies of other nodes at the place of one of the mesh, and its own."""
        number = self._places[node]
        first, last = np.searchsorted(self._by_place[1], (number, number + 1))
        others = self._by_place[0][first:last]
        return [self._body_of(int(other)) for other in others if other != node], self._body_of(node)

    def _body_of(self, node: int) -> str:
        return self._body_names[self._node_bodies[node]]

    @cached_property
    def _body_names(self) -> list[str]:
        return list(self.model.bodies) or [""]

    @cached_property
    def _node_bodies(self) -> Ints:
        """The number of the body of each node of the mesh."""
        numbers = np.zeros(len(self.mesh.points), dtype=np.int64)
        for number, name in enumerate(self.model.bodies):
            numbers[self.mesh.cells[self.mesh.regions[name]]] = number
        return numbers

    @cached_property
    def _places(self) -> Ints:
        """The number of the place of each node of the mesh."""
        return same_places(self.mesh.points)

    @cached_property
    def _by_place(self) -> tuple[Ints, Ints]:
        """The nodes of the mesh in the order of their places, and these."""
        order = np.argsort(self._places, kind="stable")
        return order, self._places[order]

    def rows(self, nodes: Iterable[int]) -> Ints:
        """Rows of the file of those of some nodes that the body has, in their order."""
        rows = np.array([self.model.places.get(node, -1) for node in nodes], dtype=np.int64)
        return rows[np.isin(rows, self.numbers)]

    def nodes(self, name: str) -> Ints:
        """Rows of the file of the nodes of a set that the body has."""
        label = _defined_name(name, self._node_sets)
        return np.empty(0, np.int64) if label is None else np.intersect1d(self.model.raw.node_sets[label], self.numbers)

    def has_nodes(self, name: str) -> bool:
        """Whether the file defines a set of nodes with a name."""
        return _defined_name(name, self._node_sets) is not None

    def check_nodes(self, name: str) -> None:
        """Check that a name is a number, or that of a set of nodes or faces, which the body may not have; CalculiX
        takes numbers of nodes that the file has not, too.

        Raises:
            ValueError: the file does not define it.
        """
        is_set = self.has_nodes(name) or self.boundary(name) is not None or self.surface(name) is not None
        if single(name) is None and not is_set:
            raise ValueError(f"set {name!r} does not exist")

    def single(self, name: str) -> int | None:
        """The number of a node, or of the only one of a set, also if the body has it not; None: it is none."""
        if (number := single(name)) is not None:
            return number
        label = _defined_name(name, self._node_sets)
        rows = [] if label is None else list(self.model.raw.node_sets[label])
        return (
            next((node for node, row in self.model.places.items() if row == rows[0]), None) if len(rows) == 1 else None
        )

    def mover(self, name: str) -> int | None:
        """The node that moves or turns a rigid body, if a set or a node is one; None: it is none."""
        return node if self.driven and (node := self.single(name)) in self.driven else None

    @cached_property
    def driven(self) -> set[int]:
        """All nodes that move or turn rigid bodies, or tighten bolts."""
        coupled = {*(node for _, node in self.coupled), *self.distributed}
        return {*self.movers.values(), *coupled, *self.turners, *self.bolts}

    @cached_property
    def given_singly(self) -> set[int]:
        """The components of forces at nodes, of which one keyword changes some that another one gives: by boundaries
        they would be added.
        """
        found, seen = set[int](), dict[tuple[int, int], frozenset[int]]()
        for block in self.model.blocks:
            for group in self.model.groups.get(block.number, ()) if block.keyword == "CLOAD" else ():
                component, nodes = int(group.words[0]), frozenset(group.nodes)
                for node in nodes:
                    if seen.setdefault((component, node), nodes) != nodes:
                        found.add(component)
        return found

    def without_rigid(self, group: Group) -> Group:
        """What a keyword says of single nodes, without those that move rigid bodies."""
        rows = [k for k, node in enumerate(group.nodes) if node not in self.driven]
        return replace(group, nodes=tuple(group.nodes[k] for k in rows), values=tuple(group.values[k] for k in rows))

    def held(self, boundary: str) -> Ints:
        """Rows of the file of the nodes of a boundary."""
        nodes = np.unique(self.mesh.facets[self.mesh.boundaries[boundary]])
        return self.numbers[nodes[nodes < len(self.numbers)]]

    def inside(self, boundary: str) -> int:
        """How many faces of a surface of the file its boundary does not have, because they are inside the body."""
        raw, held = self.model.raw, self.held(boundary)
        faces = [
            nodes[rows]
            for (kind, nodes), rows in zip(raw.blocks, raw.sets.get(boundary, ()), strict=False)
            if dimension(kind) == self.mesh.dim - 1
        ]
        return sum(int((~np.isin(nodes, held)).any(axis=1).sum()) for nodes in faces)


def _by_capitals(names: Iterable[str]) -> dict[str, str]:
    """Names by their capitals, which the programs do not distinguish; the first of several."""
    return {label.upper(): label for label in reversed(list(names))}


def _defined_name(name: str, by_capitals: Mapping[str, str]) -> str | None:
    return by_capitals.get(name.upper(), by_capitals.get(plain_name(name)))


def plain_name(name: str) -> str:
    """The name of a set in capitals, without its instance."""
    return name.rpartition(".")[2].upper()
