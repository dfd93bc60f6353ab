"""The content of an Abaqus input file in the terms of a scene: loads by step, names of boundaries,
and remarks on what is not read.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from signorini_fx.addons.decks.mesh import DeckModel
from signorini_fx.addons.decks.text import DeckBlock, number_of
from signorini_fx.arrays import Array, Ints
from signorini_fx.mechanics.kinematics import Kinematics, of_materials
from signorini_fx.mechanics.mesh.files.arrays import MeshArrays, plain
from signorini_fx.mechanics.mesh.files.cells import dimension

# Keys of a table with their values, where boundaries have no names.
Place = tuple[tuple[str, Any], ...]


@dataclass
class DeckLoad:
    """A boundary condition or a load with its values in the steps that change it; in other steps it
    keeps its value.
    """

    table: str  # of the scene
    target: str  # name of its boundary, or number of its reference node
    keys: tuple[str, ...]  # of the table
    block: DeckBlock  # the first keyword that gives it
    direction: tuple[float, ...] = (1.0,)  # share of the value in each key
    place: Place = ()  # keys of its table besides these
    values: dict[int, float | None] = field(
        default_factory=dict
    )  # step -> value; None: it ends with this step

    def by_step(self, steps: int) -> list[float | None]:
        """Return the value in each step, None where the load does not act.

        A value before the first step holds in all steps until it is changed.
        """
        current = self.values.get(-1)
        values = []
        for step in range(steps):
            current = self.values.get(step, current)
            values.append(current)
        return values


@dataclass(frozen=True)
class DeckSection:
    """A region of the body and its material, whose name is in capitals."""

    region: str
    material: str
    block: DeckBlock


@dataclass
class Interaction:
    """The friction and stiffness of a *SURFACE INTERACTION."""

    coefficient: float = 0.0  # of friction
    cap: float | None = None  # the largest shear, stress; None: there is none
    sticking: float | None = (
        None  # stiffness of sticking, stress per length; None: the file gives none
    )
    behaviour: DeckBlock | None = None  # the last *SURFACE BEHAVIOR
    stiffness: float | None = None  # of contact, stress per length; None: it is hard
    tied: bool = False  # whether both sides are bonded
    separates: bool = True  # whether sides that touch may part again


@dataclass(frozen=True)
class SurfacePair:
    """A contact pair or, without an interaction, a tie."""

    slave: str  # the name of its dependent surface
    master: str  # that of the other one
    interaction: str | None  # its name, in capitals; None: it is a tie
    block: DeckBlock  # the keyword
    adjust: str | None = None  # ADJUST, a length or a set of nodes; None: it is not given
    keeps_partners: bool = False  # whether its sides slide by less than a facet


@dataclass
class Deck:
    """The content of an input file, with remarks on what was not read."""

    mesh: MeshArrays  # the mesh as the scene has it, its boundaries outside alone
    model: DeckModel  # the mesh and the keywords of the file
    inside: Mapping[str, int]  # name of a boundary -> how many of its facets are inside the body
    # (keyword, remark, whether the answer changes) -> places in the file
    remark_places: dict[tuple[str, str, bool], list[str]] = field(default_factory=dict)
    title: str = ""
    material: str = ""  # the current *MATERIAL; ``interaction`` likewise
    materials: dict[str, dict[str, Any]] = field(default_factory=dict)
    sections: list[DeckSection] = field(default_factory=list)
    hypothesis: str = ""
    assumed: str = ""  # the assumption of plane elements, of which ``hypothesis`` is the key
    thickness: float = 1.0
    steps: list[str] = field(default_factory=list)
    period: float = 1.0  # of the last step
    time: float = 0.0  # the total one at its beginning
    nonlinear: DeckBlock | None = None  # the last step with NLGEOM; None: there is none
    loads: dict[tuple[Hashable, ...], DeckLoad] = field(default_factory=dict)
    ended: set[tuple[int, str]] = field(default_factory=set)
    amplitudes: dict[str, DeckBlock] = field(default_factory=dict)
    # those of the nodes at the end of each step that changes them, and at rest as step -1
    temperatures: dict[int, Array] = field(default_factory=dict)
    heating: list[DeckBlock] = field(default_factory=list)
    interaction: str = ""
    interactions: dict[str, Interaction] = field(default_factory=dict)
    pairs: list[SurfacePair] = field(default_factory=list)
    bolts: dict[int, str] = field(
        default_factory=dict
    )  # reference node of a *PRE-TENSION SECTION -> its surface

    @property
    def kinematics(self) -> Kinematics:
        """The kinematics of the cells."""
        return of_materials([(self.hypothesis, False)])

    @property
    def step(self) -> int:
        """The number of the current step, from 0; -1 before the first one."""
        return len(self.steps) - 1

    @property
    def axes(self) -> str:
        """The names of the axes of the mesh."""
        return "xyz"[: self.mesh.dim]

    # --- remarks ----------------------------------------------------------------------------------

    def lose(self, block: DeckBlock, why: str) -> None:
        """Record something that the scene lacks, so that its solution differs."""
        self._say(block, why, lost=True)

    def note(self, block: DeckBlock, why: str) -> None:
        """Record something that is stated in another way, or does not change the solution."""
        self._say(block, why, lost=False)

    def _say(self, block: DeckBlock, why: str, *, lost: bool) -> None:
        places = self.remark_places.setdefault((block.name, why, lost), [])
        if block.place not in places:
            places.append(block.place)

    def remarks(self, *, lost: bool) -> list[str]:
        """Return the remarks of one kind; a remark that applies to several lines is given once."""
        lines = []
        for (name, why, changes), places in self.remark_places.items():
            repeats = f" and {len(places) - 1} more" if len(places) > 1 else ""
            if changes is lost:
                lines.append(f"{places[0]}, *{name}{repeats}: {why}")
        return lines

    # --- names ------------------------------------------------------------------------------------

    def label(self, kind: str, name: str) -> str | None:
        """Return the spelling of the name of a boundary, surface, region or set of nodes in the
        file, whatever the case of ``name``; None if there is no such name.
        """
        of_body = {"boundary": self.mesh.boundaries, "region": self.mesh.regions}
        names: dict[str, Any] = {
            "surface": self.model.surfaces,
            "nodes": self.model.raw.node_sets,
            **of_body,
        }
        named = names[kind]
        spelt = self.model.spelt.get(name.upper(), name)
        empty = kind in ("boundary", "surface") and not len(named.get(spelt, ()))
        return None if empty or spelt not in named else spelt

    def boundary(self, name: str) -> str | None:
        """Return the name of the boundary that a set or surface of the file forms, or None if it is
        no boundary.
        """
        return self.label("boundary", name)

    def elements(self, name: str) -> Ints:
        """Return the numbers of the elements of a set, those of masses too; empty if there is no
        such set.
        """
        spelt = self.model.spelt.get(name.upper(), name)
        return self.model.elements.get(spelt, np.empty(0, np.int64))

    def check_nodes(self, name: str) -> None:
        """Refuse the name of a set that the file does not define; unknown node numbers are allowed,
        as in CalculiX.
        """
        if number_of(name) is None and not any(
            self.label(kind, name) for kind in ("nodes", "boundary", "surface")
        ):
            raise ValueError(f"set {name!r} does not exist")

    # --- nodes ------------------------------------------------------------------------------------

    @cached_property
    def numbers(self) -> Ints:
        """The rows in the file of the nodes of the body, ascending; added nodes that complete its
        cells have no row.
        """
        raw = self.model.raw
        used = np.zeros(len(raw.points), dtype=bool)
        for kind, nodes in raw.blocks:
            if dimension(kind) == self.mesh.dim:
                used[nodes] = True
        return np.flatnonzero(used)

    @cached_property
    def names(self) -> Ints:
        """The numbers in the file of the nodes of the body, in the order of ``numbers``."""
        return self.model.places.numbers[self.numbers]

    @cached_property
    def bodies(self) -> dict[str, Ints]:
        """The positions in ``numbers`` of the nodes of each body, by its name; the name is "" if
        there is only one body.
        """
        if not self.model.bodies:
            return {"": np.arange(len(self.numbers))}
        nodes = {
            name: np.unique(self.mesh.cells[self.mesh.regions[name]]) for name in self.model.bodies
        }
        return {name: of_body[of_body < len(self.numbers)] for name, of_body in nodes.items()}

    @cached_property
    def _body_of(self) -> dict[int, str]:
        """The name of the body of each node; "" if there is only one body."""
        return {node: name for name, nodes in self.bodies.items() for node in plain(nodes)}

    def at_point(self, row: int) -> Place:
        """Return the keys of a table that locate a node, given by its row in the file.

        They name its body, because another body may have a node at the same place.
        """
        node = int(np.searchsorted(self.numbers, row))
        return (("at", tuple(plain(self.mesh.points[node]))), ("region", self._body_of[node]))

    def rows(self, nodes: Iterable[int]) -> Ints:
        """Return the rows in the file of the nodes that belong to the body, in the given order."""
        rows = self.model.places.rows(np.array(list(nodes), dtype=np.int64))
        return rows[np.isin(rows, self.numbers)]

    def nodes(self, name: str) -> Ints:
        """Return the rows in the file of the nodes of a set that belong to the body."""
        label = self.label("nodes", name)
        return (
            np.empty(0, np.int64)
            if label is None
            else np.intersect1d(self.model.raw.node_sets[label], self.numbers)
        )

    def boundary_nodes(self, boundary: str) -> Ints:
        """Return the rows in the file of the nodes of a boundary."""
        nodes = np.unique(self.mesh.facets[self.mesh.boundaries[boundary]])
        return self.numbers[nodes[nodes < len(self.numbers)]]

    def single_node(self, name: str) -> int | None:
        """Return the number of a node, given directly or as a set of one node, also outside of the
        body; None for other sets.
        """
        if (number := number_of(name)) is not None:
            return number
        label = self.label("nodes", name)
        rows = np.empty(0, np.int64) if label is None else self.model.raw.node_sets[label]
        return int(self.model.places.numbers[rows[0]]) if len(rows) == 1 else None

    def reference_node(self, name: str) -> int | None:
        """Return the reference node of a bolt, given as a node or a set, or None if it is none."""
        return node if self.bolts and (node := self.single_node(name)) in self.bolts else None

    @cached_property
    def given_singly(self) -> set[int]:
        """The components for which a keyword changes only some of the nodal forces of another one.

        They stay single forces, because tractions on boundaries would add up.
        """
        single_components = set[int]()
        seen = dict[tuple[int, int], frozenset[int]]()
        for block in self.model.blocks:
            for group in (
                self.model.groups.get(block.number, ()) if block.keyword == "CLOAD" else ()
            ):
                component = int(group.words[0])
                nodes = frozenset(group.nodes)
                for node in nodes:
                    if seen.setdefault((component, node), nodes) != nodes:
                        single_components.add(component)
        return single_components
