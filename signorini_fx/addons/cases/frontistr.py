"""What a mesh and a control file of FrontISTR say of contact in linear elasticity, as a problem.  No dolfinx here."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from signorini_fx.addons.aster.grouped_mesh import GroupedMesh
from signorini_fx.addons.aster.study import CaseStudy, NodalForce, Relation, Support, SurfaceLoad, Zone, add_once
from signorini_fx.addons.cases.body_facets import BodyFacets, some
from signorini_fx.addons.cases.hecmw import CardError, ControlCard, NumberGroups, read_cards, real, whole_number
from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.files.abaqus import faces_of
from signorini_fx.mechanics.mesh.files.arrays import plain
from signorini_fx.mechanics.mesh.files.cells import CELLS
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints

# Types of elements in meshio's words; corners are in its order, and faces are numbered as those of Abaqus.
_KINDS = {"341": "tetra", "342": "tetra10", "351": "wedge", "361": "hexahedron", "362": "hexahedron20"}
_COUNTS = {"tetra": 4, "tetra10": 10, "wedge": 6, "hexahedron": 8, "hexahedron20": 20}
# Cards that say nothing of a problem of statics.
_PLAIN = re.compile(
    r"VERSION|WRITE|OUTPUT_RES|OUTPUT_VIS|VISUAL|SOLVER|HEADER|ZERO|SURFACE(_NUM)?\b.*|OUTPUT_TYPE.*|RESTART|CONTACT_PARAM"
    r"|ECHO|UTEMP|AUTOINC_PARAM|TIME_POINTS|INITIAL CONDITION|ITEM"
)
_MESH = (
    "NODE",
    "ELEMENT",
    "NGROUP",
    "EGROUP",
    "SGROUP",
    "SECTION",
    "MATERIAL",
    "EQUATION",
    "CONTACT PAIR",
    "AMPLITUDE",
)
# Of a control file what is read, up to the cards of pictures.
_CONTROL = (
    *("SOLUTION", "STEP", "BOUNDARY", "CLOAD", "DLOAD", "CONTACT", "CONTACT_ALGO", "EMBED", "SPRING", "TEMPERATURE"),
    *("FLOAD", "SECTION", "MATERIAL", "ELASTIC", "DENSITY", "PLASTIC", "HYPERELASTIC", "VISCOELASTIC", "CREEP"),
    "EXPANSION_COEFF",
)
_MOST_INSTANTS = 400
_FORMULATIONS = {
    "SLAGRANGE": "by Lagrange multipliers at the nodes of one surface",
    "ALAGRANGE": "by an augmented Lagrangian at the nodes of one surface",
}
_HEXAHEDRA = {"BBAR": "B-bar", "IC": "incompatible modes", "FBAR": "F-bar, for small strains B-bar"}
_TETRAHEDRA = {"SELECTIVE_ESNS": "smoothed strains at edges and nodes"}


@dataclass
class FrontistrStudy(CaseStudy):
    """A problem of a case of FrontISTR.

    Attributes:
        numbers: of the nodes, in the order of the mesh.
        results: files that FrontISTR has written.
    """

    numbers: Ints = field(default_factory=lambda: np.empty(0, np.int64))
    results: tuple[Path, ...] = ()


def results_beside(control: Path) -> list[Path]:
    """The results of a control file, in the order of their steps."""
    files = [
        (int(match[1]), path)
        for path in control.parent.glob(f"{control.stem}.res.0.*")
        if (match := re.fullmatch(r".*\.res\.0\.(\d+)", path.name))
    ]
    return [path for step, path in sorted(files) if step > 0]


def other_solution(control: Path) -> str:
    """Why a case is no statics; "": it is, or it does not say.

    Raises:
        MeshError: the file cannot be read.
    """
    for card in read_cards(control):
        if card.keyword == "SOLUTION" and (kind := card.parameters.get("TYPE", "").upper()) not in (
            *("STATIC", "NLSTATIC"),
            "",
        ):
            return f"{card.origin}: TYPE={kind}: only static steps are taken"
    return ""


def read_frontistr(control: Path) -> FrontistrStudy:
    """The problem of a control file, beside which its mesh is, NAME.msh.

    Raises:
        MeshError: something is missing, or is not known here; the message says where.
    """
    mesh = control.with_suffix(".msh")
    if not mesh.is_file():
        raise MeshError(f"{control}: line 1: {mesh.name} is expected beside it")
    reader = _FrontistrCase(control, mesh)
    try:
        reader.read_mesh(read_cards(mesh))
    except CardError as error:
        raise MeshError(f"{mesh}: {error}") from None
    try:
        return reader.study(read_cards(control))
    except CardError as error:
        raise MeshError(f"{control}: {error}") from None


@dataclass
class _SolvedStep:
    """A step with what is active in it, and the times at which it is solved."""

    card: ControlCard
    active: dict[str, set[int]]
    instants: list[float]
    begin: float


class _FrontistrCase:
    """Both files, and what has been read so far."""

    def __init__(self, control: Path, mesh: Path) -> None:
        self._control, self._mesh = control, mesh
        self._nodes, self._elements = NumberGroups("NGRP"), NumberGroups("EGRP")
        self._surfaces: dict[str, list[tuple[int, int]]] = {}
        self._sections: list[tuple[Ints, str, ControlCard]] = []
        self._materials: dict[str, tuple[dict[str, float], ControlCard]] = {}
        self._pairs: dict[str, tuple[str, list[str], ControlCard]] = {}
        self._relations: list[Relation] = []
        self._amplitudes: set[str] = set()
        self._unknown: list[tuple[str, str]] = []

    # --- mesh -----------------------------------------------------------------------------------------------------

    def read_mesh(self, cards: list[ControlCard]) -> None:
        """Nodes, elements, groups, sections, materials and pairs."""
        self._read_nodes([card for card in cards if card.keyword == "NODE"])
        self._read_elements([card for card in cards if card.keyword == "ELEMENT"])
        for number, card in enumerate(cards):
            match card.keyword:
                case "NGROUP":
                    self._nodes.add(card, "NGRP", self.numbers)
                case "EGROUP":
                    self._elements.add(card, "EGRP", self._element_numbers)
                case "SGROUP":
                    self._read_surface(card)
                case "SECTION":
                    chosen = self._elements.numbers(card.line, card.name("EGRP"))
                    self._sections.append((chosen, card.name("MATERIAL"), card))
                case "MATERIAL":
                    self._read_material(card, cards[number + 1 :])
                case "EQUATION":
                    self._read_equations(card)
                case "CONTACT PAIR":
                    for line, words in card.rows:
                        if len(words) < 2 or len(card.rows) > 1:
                            raise CardError(line, "!CONTACT PAIR: one line with two groups is expected")
                        self._pairs[card.name("NAME")] = (card.name("TYPE", "NODE-SURF"), words[:2], card)
                case "AMPLITUDE":
                    self._amplitudes.add(card.name("NAME"))
                case keyword if keyword not in _MESH and not _PLAIN.match(keyword) and not keyword.startswith("ITEM"):
                    self._unknown.append((f"{self._mesh.name}: {card.origin}", "not known here"))

    def _read_nodes(self, cards: list[ControlCard]) -> None:
        numbers, points = [], []
        for card in cards:
            for line, words in card.rows:
                if len(words) < 4:
                    raise CardError(line, "!NODE: a number and three coordinates are expected")
                numbers.append(whole_number(line, words[0], "!NODE"))
                points.append([real(line, word, "!NODE") for word in words[1:4]])
            if (group := card.parameters.get("NGRP", "").upper()) and card.rows:
                self._nodes.content.setdefault(group, []).extend(numbers[-len(card.rows) :])
        if not numbers:
            raise CardError(1, "there are no nodes")
        values, counts = np.unique(numbers, return_counts=True)
        if (counts > 1).any():
            raise CardError(cards[0].line, f"!NODE: node {values[np.argmax(counts > 1)]} is there twice")
        order = np.argsort(numbers)
        self.numbers: Ints = np.array(numbers, dtype=np.int64)[order]
        self._points: Floats = np.array(points, dtype=np.float64)[order]
        self._nodes.content["ALL"] = plain(self.numbers)

    def _read_elements(self, cards: list[ControlCard]) -> None:
        self._blocks: list[tuple[str, Ints, Ints]] = []
        for card in cards:
            kind = _KINDS.get(card.name("TYPE"), "")
            if not kind:
                raise CardError(card.line, f"!ELEMENT: TYPE={card.name('TYPE')} is not known here")
            words = [(line, word) for line, row in card.rows for word in row if word]
            width = _COUNTS[kind] + 1
            if not words or len(words) % width:
                line = words[-1][0] if words else card.line
                raise CardError(line, f"!ELEMENT: a number and {width - 1} nodes for each element are expected")
            table = np.array([whole_number(line, word, "!ELEMENT") for line, word in words], dtype=np.int64).reshape(
                -1, width
            )
            missing = ~np.isin(table[:, 1:], self.numbers)
            if missing.any():
                at = int(np.argmax(missing.any(axis=1)))
                node = table[at, 1:][missing[at]][0]
                raise CardError(words[at * width][0], f"!ELEMENT: node {node} of element {table[at, 0]} is not there")
            rows = np.searchsorted(self.numbers, table[:, 1:]).astype(np.int64)
            self._blocks.append((kind, self._ordered(kind, rows), table[:, 0]))
            if group := card.parameters.get("EGRP", "").upper():
                self._elements.content.setdefault(group, []).extend(plain(table[:, 0]))
        if not self._blocks:
            raise CardError(1, "there are no elements")
        self._element_numbers = np.concatenate([numbers for _, _, numbers in self._blocks])
        if len(np.unique(self._element_numbers)) != len(self._element_numbers):
            raise CardError(cards[0].line, "!ELEMENT: an element is there twice")
        self._elements.content["ALL"] = plain(self._element_numbers)
        self._facets = BodyFacets(self._points, [(kind, nodes) for kind, nodes, _ in self._blocks])

    def _ordered(self, kind: str, rows: Ints) -> Ints:
        """Nodes between the corners in meshio's order, found by their positions: files order them in several ways."""
        corners = len(CELLS[kind].corners) if kind in CELLS else rows.shape[1]
        if corners == rows.shape[1]:
            return rows
        x = self._points[rows[0]]
        middles = np.array([x[list(ends)].mean(axis=0) for ends in CELLS[kind].nodes[corners : rows.shape[1]]])
        nearest = np.linalg.norm(middles[:, None] - x[None, corners:], axis=2).argmin(axis=1)
        return rows[:, [*range(corners), *(corners + nearest)]]

    def _rows(self, line: int, word: str, keyword: str) -> Ints:
        """The rows of the nodes of a group, or of a node."""
        numbers = self._nodes.numbers(line, word)
        if (unknown_nodes := np.setdiff1d(numbers, self.numbers)).size:
            raise CardError(line, f"!{keyword}: node {unknown_nodes[0]} is not there")
        return np.searchsorted(self.numbers, numbers).astype(np.int64)

    def _read_surface(self, card: ControlCard) -> None:
        faces = self._surfaces.setdefault(card.name("SGRP"), [])
        words = [(line, word) for line, row in card.rows for word in row if word]
        if len(words) % 2:
            raise CardError(card.line, "!SGROUP: pairs of an element and a face are expected")
        for (line, word), (_, face) in zip(words[::2], words[1::2], strict=True):
            number = whole_number(line, face, "!SGROUP")
            faces += [(int(element), number) for element in self._elements.numbers(line, word)]

    def _corners(self, card: ControlCard, name: str) -> list[Ints]:
        """The corners of the faces of a surface, in tables of faces with as many."""
        if name.upper() not in self._surfaces:
            raise CardError(card.line, f"!{card.keyword}: there is no SGRP {name[:40]!r}")
        collected: dict[int, list[Ints]] = {}
        where = {int(n): (k, row) for k, (_, _, of) in enumerate(self._blocks) for row, n in enumerate(of)}
        for element, face in self._surfaces[name.upper()]:
            if element not in where:
                raise CardError(card.line, f"!{card.keyword}: {name}: element {element} is not there")
            k, row = where[element]
            kind, nodes, _ = self._blocks[k]
            faces = faces_of(kind)
            if not 1 <= face <= len(faces):
                raise CardError(card.line, f"!{card.keyword}: {name}: element {element} has no face {face}")
            corners = nodes[row, list(faces[face - 1])]
            collected.setdefault(len(corners), []).append(corners)
        return [np.array(rows, dtype=np.int64) for rows in collected.values()]

    def _surface(self, card: ControlCard, name: str) -> tuple[list[Any], int]:
        """The facets of a surface, and how many faces are none of the boundary."""
        marks, missing = self._facets.nothing(), 0
        for rows in self._corners(card, name):
            chosen, without = self._facets.matching(rows)
            marks, missing = [a | b for a, b in zip(marks, chosen, strict=True)], missing + without
        return marks, missing

    def _read_material(self, card: ControlCard, following: list[ControlCard]) -> None:
        properties: dict[str, float] = {}
        for item in following:
            if not item.keyword.startswith("ITEM"):
                break
            line, words = item.rows[0] if item.rows else (item.line, [])
            if item.keyword.endswith("1") and len(words) >= 2:
                properties |= {"young": real(line, words[0], "!ITEM"), "poisson": real(line, words[1], "!ITEM")}
            elif item.keyword.endswith("2") and words:
                properties["density"] = real(line, words[0], "!ITEM")
        self._materials[card.name("NAME")] = (properties, card)

    def _read_equations(self, card: ControlCard) -> None:
        rows = iter(card.rows)
        for line, words in rows:
            count = whole_number(line, words[0], "!EQUATION")
            entries: list[tuple[int, str]] = []
            while len(entries) < 3 * count:
                try:
                    line, further = next(rows)
                except StopIteration:
                    raise CardError(line, f"!EQUATION: {count} terms are expected") from None
                entries += [(line, word) for word in further if word]
            terms = []
            for (place, node), (_, dof), (_, factor) in zip(entries[::3], entries[1::3], entries[2::3], strict=True):
                for number in self._nodes.numbers(place, node):
                    component = whole_number(place, dof, "!EQUATION") - 1
                    if number not in self.numbers or not 0 <= component < 3:
                        raise CardError(place, f"!EQUATION: node {number} with component {dof} is not there")
                    row = int(np.searchsorted(self.numbers, number))
                    terms.append((row, component, real(place, factor, "!EQUATION")))
            if len(words) > 1 and words[1] and real(line, words[1], "!EQUATION"):
                raise CardError(line, "!EQUATION: a constant is not known here")
            self._relations.append(Relation(tuple(terms), f"{self._mesh.name}: {card.origin}"))

    # --- control --------------------------------------------------------------------------------------------------

    def study(self, cards: list[ControlCard]) -> FrontistrStudy:
        """All of it."""
        body = self._facets.nothing()
        for k in range(self._facets.cells):
            body[k][:] = True
        study = FrontistrStudy(GroupedMesh(self._facets.mesh), "3D", body)
        study.numbers, study.results = self.numbers, tuple(results_beside(self._control))
        study.relations = list(self._relations)
        for origin, why in self._unknown:
            study.lose(origin, why)
        self._lose_unknown(study, cards)
        self._nonlinear = self._solution(cards)
        self._behaviour(study, cards)
        self._give_materials(study)
        self._elements_of(study, cards)
        steps = self._steps(cards)
        self._contacts(study, cards, steps)
        study.instants = [time for step in steps for time in step.instants]
        if len(study.instants) > _MOST_INSTANTS:
            raise CardError(steps[0].card.line, f"!STEP: more than {_MOST_INSTANTS} steps")
        self._act(study, cards, steps)
        return study

    @staticmethod
    def _lose_unknown(study: FrontistrStudy, cards: list[ControlCard]) -> None:
        """Cards that may change the answer, and a state to begin from."""
        for card in cards:
            if card.keyword == "VISUAL":  # the cards of pictures follow
                break
            if card.keyword == "RESTART" and card.parameters.get("FREQUENCY", "").startswith("-"):
                study.lose(card.origin, "it goes on from a state that is not there")
            elif card.keyword not in _CONTROL and not _PLAIN.fullmatch(card.keyword):
                study.lose(card.origin, "not known here")

    @staticmethod
    def _solution(cards: list[ControlCard]) -> bool:
        """Whether it is nonlinear."""
        nonlinear = False
        for card in cards:
            if card.keyword == "SOLUTION":
                kind = card.parameters.get("TYPE", "STATIC").upper()
                if kind not in ("STATIC", "NLSTATIC"):
                    raise CardError(card.line, f"!SOLUTION: TYPE={kind}: only static steps are taken")
                nonlinear = kind == "NLSTATIC" or "NONLINEAR" in card.parameters
        return nonlinear

    def _behaviour(self, study: FrontistrStudy, cards: list[ControlCard]) -> None:
        """The materials of the control file, and whether strains may be large."""
        current: tuple[dict[str, float], ControlCard] | None = None
        for card in cards:
            if card.keyword == "MATERIAL":
                current = self._materials.setdefault(card.name("NAME"), ({}, card))
                self._materials[card.name("NAME")] = current = (current[0], card)
            elif card.keyword in ("ELASTIC", "DENSITY") and current is not None:
                if card.parameters.get("TYPE", "ISOTROPIC").upper() != "ISOTROPIC" or not card.rows:
                    raise CardError(card.line, f"!{card.keyword}: an isotropic material with constants is expected")
                line, words = card.rows[0]
                if card.keyword == "DENSITY":
                    current[0]["density"] = real(line, words[0], "!DENSITY")
                elif len(words) < 2:
                    raise CardError(line, "!ELASTIC: two constants are expected")
                else:
                    current[0].update(young=real(line, words[0], "!ELASTIC"), poisson=real(line, words[1], "!ELASTIC"))
                    if self._nonlinear and "INFINITESIMAL" not in card.parameters:
                        study.finite = study.finite or card.origin
            elif card.keyword in ("PLASTIC", "HYPERELASTIC", "VISCOELASTIC", "CREEP", "EXPANSION_COEFF"):
                raise CardError(card.line, f"!{card.keyword}: only elastic materials are known here")

    def _give_materials(self, study: FrontistrStudy) -> None:
        covered: Ints = np.zeros(0, np.int64)
        for chosen, name, card in self._sections:
            properties, _ = self._materials.get(name, ({}, card))
            if not {"young", "poisson"} <= properties.keys():
                raise CardError(1, f"the material {name} of {self._mesh.name} has no elastic constants")
            marks = self._facets.nothing()
            for mark, (_, _, numbers) in zip(marks, self._blocks, strict=False):
                mark[:] = np.isin(numbers, chosen)
            study.materials.append((marks, dict(properties), f"{self._mesh.name}: {card.origin}"))
            covered = np.union1d(covered, chosen)
        if np.setdiff1d(self._element_numbers, covered).size:
            raise CardError(1, f"some elements of {self._mesh.name} are in no !SECTION")

    def _elements_of(self, study: FrontistrStudy, cards: list[ControlCard]) -> None:
        """What tetrahedra and hexahedra are in FrontISTR: it has other choices than full integration for these."""
        for form in {card.parameters["FORM341"].upper() for card in cards if "FORM341" in card.parameters} - {"FI"}:
            add_once(study.formulations, f"with tetrahedra of {_TETRAHEDRA.get(form, form)}")
        if not any(kind == "hexahedron" for kind, _, _ in self._blocks):
            return
        forms = {card.parameters["FORM361"].upper() for card in cards if "FORM361" in card.parameters}
        for form in forms or {"FBAR" if self._nonlinear else "IC"}:
            if form != "FI":
                add_once(study.formulations, f"with hexahedra of {_HEXAHEDRA.get(form, form)}")

    def _steps(self, cards: list[ControlCard]) -> list[_SolvedStep]:
        steps: list[_SolvedStep] = []
        begin = 0.0
        for card in cards:
            if card.keyword != "STEP":
                continue
            count, length = card.whole_parameter("SUBSTEPS", 1), 1.0
            active: dict[str, set[int]] = {"BOUNDARY": set(), "LOAD": set(), "CONTACT": set()}
            for number, (line, words) in enumerate(card.rows):
                if words[0].upper() in active and len(words) > 1:
                    active[words[0].upper()].add(whole_number(line, words[1], "!STEP"))
                elif number == 0 and len(words) >= 2:
                    first, length = real(line, words[0], "!STEP"), real(line, words[1], "!STEP")
                    if not 0 < first <= length * (1 + 1e-9):
                        raise CardError(line, "!STEP: an increment and a length of time are expected")
                    count = max(1, round(length / first))
                elif len(words) == 1 and number == 0:
                    real(line, words[0], "!STEP")  # the tolerance of an older form
                else:
                    raise CardError(line, f"!STEP: {words[0][:40]!r} is not known here")
            if not 0 < count <= 100 * _MOST_INSTANTS:
                raise CardError(card.line, f"!STEP: SUBSTEPS={count}")
            steps.append(_SolvedStep(card, active, [begin + length * (k + 1) / count for k in range(count)], begin))
            begin += length
        if not steps:
            raise CardError(1, "!STEP is expected")
        return steps

    def _contacts(self, study: FrontistrStudy, cards: list[ControlCard], steps: list[_SolvedStep]) -> None:
        algorithm = "SLAGRANGE"
        for card in cards:
            if card.keyword == "CONTACT_ALGO":
                algorithm = card.parameters.get("TYPE", algorithm).upper()
            elif card.keyword == "EMBED":
                study.lose(card.origin, "bodies within each other")
        for card in cards:
            if card.keyword != "CONTACT":
                continue
            add_once(study.formulations, _FORMULATIONS.get(algorithm, algorithm))
            group = card.whole_parameter("GRPID", 1)
            holding = [group in step.active["CONTACT"] for step in steps]
            if not any(holding):
                study.note(card.origin, "no step has this contact")
                continue
            if not all(holding):
                study.lose(card.origin, "contact in a part of the steps only: it is there throughout")
            kind = card.parameters.get("INTERACTION", "SSLID").upper()
            if "SMOOTHING" in card.parameters:
                study.lose(card.origin, "surfaces that are made smooth")
            if kind == "FSLID":
                study.follows = card.origin
            for line, words in card.rows:
                self._zone(study, card, line, words, kind)
        if not study.zones:
            raise CardError(1, "no contact is known here")

    def _zone(self, study: FrontistrStudy, card: ControlCard, line: int, words: list[str], kind: str) -> None:
        if words[0].upper() not in self._pairs:
            raise CardError(line, f"!CONTACT: there is no !CONTACT PAIR {words[0][:40]!r} in {self._mesh.name}")
        form, names, pair = self._pairs[words[0].upper()]
        if form == "SURF-SURF":
            slave, missing = self._surface(pair, names[0])
        else:
            rows = self._rows(pair.line, names[0], pair.keyword)
            slave, missing = self._facets.within(rows), 0
            left = np.setdiff1d(rows, self._facets.filled(slave, rows))
            if left.size:
                study.lose(card.origin, f"{names[0]}: {left.size} nodes that fill no side of the body")
        master, without = self._surface(pair, names[1])
        if missing + without:
            study.lose(card.origin, f"{missing + without} faces are on no side of the body")
        if not some(slave) or not some(master):
            study.lose(card.origin, f"{words[0]}: two surfaces of bodies are expected")
            return
        coefficient = real(line, words[1], "!CONTACT") if len(words) > 1 and words[1] else 0.0
        sticking = None
        if coefficient and len(words) > 2 and words[2]:
            study.note(
                card.origin, f"friction begins with a stiffness of {words[2]}, which is force per length at a node"
            )
        no_nodes = np.empty(0, np.int64)
        number = len(study.zones) + 1
        tied = kind == "TIED"
        study.zones.append(
            Zone(slave, master, coefficient, None, sticking, card.origin, number, False, no_nodes, no_nodes, tied)
        )

    # --- supports and loads ---------------------------------------------------------------------------------------

    def _act(self, study: FrontistrStudy, cards: list[ControlCard], steps: list[_SolvedStep]) -> None:
        count = len(study.instants)
        held = np.full((3, count, len(self.numbers)), np.nan)
        origins = np.full((3, len(self.numbers)), -1, dtype=np.int64)
        for number, card in enumerate(cards):
            match card.keyword:
                case "BOUNDARY":
                    self._hold(study, card, steps, held, origins, number)
                case "DLOAD":
                    self._load(study, card, steps)
                case "CLOAD":
                    self._push(study, card, steps)
                case "SPRING" | "TEMPERATURE" | "FLOAD":
                    study.lose(card.origin, "not known here")
        for component in range(3):
            acting = np.isfinite(held[component])
            rows = np.flatnonzero(acting.any(axis=0))
            patterns = np.vstack((origins[component, rows], acting[:, rows])).T
            kinds, group = np.unique(patterns, axis=0, return_inverse=True)
            for k, kind in enumerate(kinds):
                nodes = rows[group.ravel() == k].astype(np.int64)
                table = held[component][:, nodes]
                alike = bool((table == table[:, :1])[kind[1:].astype(bool)].all())
                values = [
                    None if not acts else float(table[n, 0]) if alike else table[n] for n, acts in enumerate(kind[1:])
                ]
                study.supports.append(Support(nodes, component, values, cards[kind[0]].origin))

    def _course(self, card: ControlCard, steps: list[_SolvedStep], key: str) -> Floats:
        """The share of a load at each instant: it grows in the first step that has it, and stays in those after it."""
        if "AMP" in card.parameters:
            raise CardError(card.line, f"!{card.keyword}: AMP is not known here")
        group, shares, earlier = card.whole_parameter("GRPID", 1), [], False
        for step in steps:
            acts = group in step.active[key]
            length = step.instants[-1] - step.begin
            shares += [float(acts) * (1.0 if earlier else (time - step.begin) / length) for time in step.instants]
            earlier = acts
        return np.array(shares)

    def _hold(
        self,
        study: FrontistrStudy,
        card: ControlCard,
        steps: list[_SolvedStep],
        held: Floats,
        origins: Ints,
        number: int,
    ) -> None:
        """Displacements: in each step that has them those of its beginning, and a share of the value more."""
        if "AMP" in card.parameters or "ROT_CENTER" in card.parameters:
            raise CardError(card.line, "!BOUNDARY: AMP and ROT_CENTER are not known here")
        group = card.whole_parameter("GRPID", 1)
        for line, words in card.rows:
            if len(words) < 3:
                raise CardError(line, "!BOUNDARY: a group, and the first and the last component, are expected")
            rows = self._rows(line, words[0], card.keyword)
            first, last = (
                whole_number(line, words[1], "!BOUNDARY"),
                whole_number(line, words[2] or words[1], "!BOUNDARY"),
            )
            value = real(line, words[3], "!BOUNDARY") if len(words) > 3 and words[3] else 0.0
            for component in range(first - 1, last):
                if not 0 <= component < 3:
                    raise CardError(line, "!BOUNDARY: components are 1 to 3")
                self._move(steps, group, held[component], rows, value)
                origins[component, rows] = number

    @staticmethod
    def _move(steps: list[_SolvedStep], group: int, held: Floats, rows: Ints, value: float) -> None:
        n = 0
        earlier: Floats = np.zeros(len(rows))
        for step in steps:
            length = step.instants[-1] - step.begin
            for time in step.instants:
                if group in step.active["BOUNDARY"]:
                    held[n, rows] = earlier + value * (time - step.begin) / length
                n += 1
            at_end = held[n - 1, rows]
            earlier = np.where(np.isfinite(at_end), at_end, earlier)

    def _load(self, study: FrontistrStudy, card: ControlCard, steps: list[_SolvedStep]) -> None:
        shares = self._course(card, steps, "LOAD")
        for line, words in card.rows:
            if len(words) < 3:
                raise CardError(line, "!DLOAD: a group, a type and a value are expected")
            kind, value = words[1].upper(), real(line, words[2], "!DLOAD")
            if kind == "S":
                if self._nonlinear:
                    study.finite = study.finite or f"{card.origin}: a pressure that follows the boundary"
                marks, missing = self._surface(card, words[0])
                if missing:
                    study.lose(card.origin, f"{missing} faces are on no side of the body")
                study.pressures.append(SurfaceLoad(marks, (shares * value)[:, None], card.origin))
            elif kind == "GRAV" and len(words) >= 6:
                unit = np.array([real(line, word, "!DLOAD") for word in words[3:6]])
                study.gravities.append((shares[:, None] * value * unit, card.origin))
            else:
                raise CardError(line, f"!DLOAD: {kind[:40]!r} is not known here")

    def _push(self, study: FrontistrStudy, card: ControlCard, steps: list[_SolvedStep]) -> None:
        if "ROT_CENTER" in card.parameters:
            raise CardError(card.line, "!CLOAD: ROT_CENTER is not known here")
        shares = self._course(card, steps, "LOAD")
        for line, words in card.rows:
            if len(words) < 3:
                raise CardError(line, "!CLOAD: a group, a component and a value are expected")
            component = whole_number(line, words[1], "!CLOAD") - 1
            if not 0 <= component < 3:
                raise CardError(line, "!CLOAD: components are 1 to 3")
            rows = self._rows(line, words[0], card.keyword)
            values = np.zeros((len(shares), 3))
            values[:, component] = shares * real(line, words[2], "!CLOAD")
            study.forces.append(NodalForce(rows, values, card.origin))
