"""What acts on a body in an Abaqus input file: materials, supports, loads, steps and contact with rigid surfaces.

What a scene cannot say, or what would need a guess, is listed and left out.  No dolfinx here.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from signorini_fx.errors import MeshError
from signorini_fx.mesh.files.abaqus import Block, blocks, read
from signorini_fx.mesh.files.arrays import MeshArrays
from signorini_fx.mesh.files.raw import RawMesh

# Keywords that the mesh is read from, that only group others, or that ask for output.
_SILENT = {
    *("HEADING", "NODE", "ELEMENT", "NSET", "ELSET", "SURFACE", "PART", "END PART", "ASSEMBLY", "END ASSEMBLY"),
    *("INSTANCE", "END INSTANCE", "PREPRINT", "RESTART", "OUTPUT", "NODE OUTPUT", "ELEMENT OUTPUT", "CONTACT OUTPUT"),
    *("FIELD OUTPUT", "HISTORY OUTPUT", "NODE PRINT", "EL PRINT", "NODE FILE", "EL FILE", "CONTACT PRINT", "PRINT"),
    *("CONTACT FILE", "ENERGY OUTPUT", "ENERGY PRINT", "MONITOR", "FILE FORMAT", "CONTROLS", "STEP", "END STEP"),
    *("STATIC", "HOURGLASS STIFFNESS", "MASS", "RIGID BODY"),
}
_SYMMETRIES = {"XSYMM": "x", "YSYMM": "y", "ZSYMM": "z"}
_CLAMPED = ("ENCASTRE", "PINNED")


@dataclass
class Load:
    """A boundary condition or a load with its value in the steps that give one; in others it stays as it was."""

    table: str
    target: str
    keys: tuple[str, ...]
    direction: tuple[float, ...] = (1.0,)
    values: dict[int, float] = field(default_factory=dict)

    def by_step(self, steps: int) -> list[float]:
        """Its value in each step; what was given before the first one holds in all."""
        now, found = self.values.get(-1, 0.0), []
        for step in range(steps):
            now = self.values.get(step, now)
            found.append(now)
        return found


@dataclass
class Deck:
    """What has been read, and what was left out."""

    mesh: MeshArrays
    raw: RawMesh
    left_out: list[str] = field(default_factory=list)
    title: str = ""
    materials: dict[str, dict[str, float]] = field(default_factory=dict)
    sections: list[tuple[str, str]] = field(default_factory=list)
    stress: bool = False
    steps: list[str] = field(default_factory=list)
    loads: dict[tuple[Any, ...], Load] = field(default_factory=dict)
    frictions: dict[str, dict[str, float]] = field(default_factory=dict)
    pairs: list[tuple[str, str, str]] = field(default_factory=list)
    rigid: set[str] = field(default_factory=set)
    parts: dict[str, list[str]] = field(default_factory=dict)
    movers: set[str] = field(default_factory=set)
    drawn: dict[str, list[list[str]]] = field(default_factory=dict)
    rough: set[str] = field(default_factory=set)

    @property
    def step(self) -> int:
        """The current one, from 0; -1 before the first."""
        return len(self.steps) - 1

    @property
    def axes(self) -> str:
        """Of the mesh."""
        return "xyz"[: self.mesh.dim]

    def leave_out(self, block: Block, why: str) -> None:
        """Say that something is not in the scene."""
        said = f"line {block.line}, *{block.keyword}: {why}"
        if said not in self.left_out:
            self.left_out.append(said)

    def boundary(self, name: str) -> str | None:
        """The boundary of the mesh that a set or surface of the file is, whatever its case and its instance."""
        return _known(name, self.mesh.boundaries)

    def region(self, name: str) -> str | None:
        """The same for a part of the body."""
        return _known(name, self.mesh.regions)


def _known(name: str, names: Iterable[str]) -> str | None:
    wanted = (name.upper(), plain_name(name))
    return next((one for one in names if one.upper() in wanted), None)


def read_deck(file: Path, mesh: MeshArrays) -> Deck:
    """What acts on the body of an input file.

    Args:
        file: the input file.
        mesh: what was read from it.

    Raises:
        MeshError: a number is none, or a line has too few of them.
    """
    deck = Deck(mesh, read(file))
    every = list(blocks(file.read_text(encoding="utf-8", errors="replace")))
    _find_rigid(deck, every)
    material = interaction = ""
    for block in every:
        try:
            match block.keyword:
                case "MATERIAL":
                    material = block.parameters["NAME"]
                    deck.materials.setdefault(material, {})
                case "SURFACE INTERACTION":
                    interaction = block.parameters["NAME"]
                    deck.frictions.setdefault(interaction, {})
                case "ELASTIC" | "DENSITY":
                    _constants(deck, block, material)
                case "FRICTION":
                    _friction(deck, block, interaction)
                case _:
                    _read(deck, block)
        except (ValueError, IndexError) as error:
            raise MeshError(f"{file}: line {block.line}, *{block.keyword}: {error}") from None
        except KeyError as error:
            raise MeshError(f"{file}: line {block.line}, *{block.keyword}: {error} is missing") from None
    return deck


def _read(deck: Deck, block: Block) -> None:
    parameters, rows = block.parameters, block.rows
    match block.keyword:
        case "HEADING":
            deck.title = ", ".join(rows[0]) if rows else ""
        case "SOLID SECTION":
            deck.sections.append((parameters["ELSET"], parameters["MATERIAL"]))
        case "ELEMENT":
            deck.stress |= parameters["TYPE"].upper().startswith("CPS")
        case "STEP":
            deck.steps.append(parameters.get("NAME", f"step {len(deck.steps) + 1}"))
            if parameters.get("NLGEOM", "NO").upper() == "YES" or ("NLGEOM" in parameters and not parameters["NLGEOM"]):
                deck.leave_out(block, "NLGEOM: displacements and rotations are taken as small")
        case "BOUNDARY":
            _boundary(deck, block)
        case "DSLOAD":
            _surface_loads(deck, block)
        case "DLOAD":
            _body_forces(deck, block)
        case "CLOAD":
            deck.leave_out(block, "forces at nodes: give a traction, force over area, on their boundary")
        case "SURFACE BEHAVIOR":
            if "NO SEPARATION" in parameters:
                deck.leave_out(block, 'contact that does not open again: kind = "bilateral" does not open at all')
            if parameters.get("PRESSURE-OVERCLOSURE", "HARD").upper() != "HARD":
                deck.leave_out(block, "soft contact: here the body does not enter the foundation")
        case "CONTACT PAIR":
            pair = [word for row in rows for word in row][:2]
            deck.pairs.append((pair[0], pair[1], parameters.get("INTERACTION", "")))
        case "CONTACT" | "CONTACT INCLUSIONS":
            deck.leave_out(block, "general contact: name the pairs of surfaces, in [[contact]]")
        case "TIE":
            deck.leave_out(block, "surfaces that are tied: mesh the parts as one body")
        case keyword if keyword not in _SILENT:
            deck.leave_out(block, "not known to scenes")


def _find_rigid(deck: Deck, every: list[Block]) -> None:
    """Rigid surfaces, and the nodes or sets of nodes that move them, wherever in the file they are named."""
    for block in every:
        parameters = block.parameters
        if block.keyword == "RIGID BODY":
            deck.rigid |= {plain_name(parameters[key]) for key in ("ANALYTICAL SURFACE", "ELSET") if key in parameters}
            deck.movers.add(plain_name(parameters.get("REF NODE", "")))
        elif block.keyword == "ELEMENT" and re.match(r"R[23]D", parameters.get("TYPE", "").upper()):
            deck.rigid.add(plain_name(parameters.get("ELSET", "")))
    for block in (block for block in every if block.keyword == "SURFACE" and "NAME" in block.parameters):
        name = plain_name(block.parameters["NAME"])
        if block.parameters.get("TYPE", "").upper() in ("SEGMENTS", "CYLINDER", "REVOLUTION"):
            deck.drawn[name] = block.rows
            deck.rigid.add(name)
        elif block.rows and all(plain_name(row[0]) in deck.rigid for row in block.rows):
            deck.rigid.add(name)
            deck.parts[name] = [plain_name(row[0]) for row in block.rows]
    deck.rigid.discard("")


def plain_name(name: str) -> str:
    """The name of a set in capitals, without its instance."""
    return name.rpartition(".")[2].upper()


def _constants(deck: Deck, block: Block, material: str) -> None:
    own = deck.materials[material]
    if block.keyword == "DENSITY":
        own["density"] = float(block.rows[0][0])
        return
    if block.parameters.get("TYPE", "ISOTROPIC").upper() not in ("ISOTROPIC", "ISO"):
        deck.leave_out(block, f"the material {material!r} is not isotropic")
        return
    own["young"], own["poisson"] = (float(word) for word in block.rows[0][:2])
    if len(block.rows) > 1:
        deck.leave_out(block, "constants that depend on temperature: the first line is taken")


def _friction(deck: Deck, block: Block, interaction: str) -> None:
    if "ROUGH" in block.parameters:
        deck.rough.add(interaction)
        return
    own = deck.frictions.setdefault(interaction, {})
    if block.rows and block.rows[0]:
        own["coefficient"] = float(block.rows[0][0])
    if "TAUMAX" in block.parameters:
        own["cap"] = float(block.parameters["TAUMAX"])
    if len(block.rows) > 1 or any(len(row) > 1 for row in block.rows):
        deck.leave_out(block, "friction that depends on speed, pressure or temperature: the first coefficient is taken")


def _boundary(deck: Deck, block: Block) -> None:
    if block.parameters.get("OP", "MOD").upper() == "NEW":
        _forget(deck, "displacement")
    for name, *words in block.rows:
        where = deck.boundary(name)
        if plain_name(name) in deck.movers:
            if any(float(word) for word in words[2:3]):
                deck.leave_out(block, f"motion of the rigid body of node {name}: move the body instead")
            continue
        if where is None:
            whose = f"node {name}" if name.isdigit() else f"{name!r}, which holds no whole facet of the outside"
            deck.leave_out(block, f"support of {whose}: a scene supports boundaries")
            continue
        if words[0].upper() in _CLAMPED:
            held, value = deck.axes, 0.0
        elif words[0].upper() in _SYMMETRIES:
            held, value = _SYMMETRIES[words[0].upper()], 0.0
        else:
            first, last = int(words[0]), int(words[1]) if len(words) > 1 else int(words[0])
            held, value = "xyz"[first - 1 : last], float(words[2]) if len(words) > 2 else 0.0
        for axis in held:
            if axis in deck.axes:
                _given(deck, Load("displacement", where, (axis,)), value)


def _surface_loads(deck: Deck, block: Block) -> None:
    if block.parameters.get("OP", "MOD").upper() == "NEW":
        _forget(deck, "traction")
    for name, kind, *words in block.rows:
        where = deck.boundary(name)
        if where is None:
            deck.leave_out(block, f"load on {name!r}, which is no boundary of the body")
        elif kind.upper() == "P":
            _given(deck, Load("traction", where, ("pressure",)), float(words[0]))
        elif kind.upper() in ("TRVEC", "TRSHR"):
            if kind.upper() == "TRSHR":
                deck.leave_out(block, f"TRSHR on {name!r}: taken along its vector, which must lie in the surface")
            direction = _unit([float(word) for word in words[1:]])
            _given(deck, Load("traction", where, tuple(deck.axes), direction[: deck.mesh.dim]), float(words[0]))
        else:
            deck.leave_out(block, f"load of type {kind}")


def _body_forces(deck: Deck, block: Block) -> None:
    if block.parameters.get("OP", "MOD").upper() == "NEW":
        _forget(deck, "body_force")
    for row in block.rows:
        at = next((k for k, word in enumerate(row) if re.fullmatch(r"GRAV|B[XYZ]|P\d?", word.upper())), None)
        if at is None:
            deck.leave_out(block, f"load {', '.join(row)}")
            continue
        kind, words = row[at].upper(), [float(word) for word in row[at + 1 :]]
        whole = at == 0 or ((where := deck.region(row[0])) is not None and _whole(deck, where))
        if kind.startswith("P"):
            deck.leave_out(block, f"pressure on faces of {row[0]!r}: make a *SURFACE of them and a [[traction]] on it")
        elif not whole:
            deck.leave_out(block, f"body force on {row[0]!r}, a part of the body: give an expression of the position")
        elif kind == "GRAV":
            densities = {own.get("density") for own in deck.materials.values()}
            if len(densities) != 1 or None in densities:
                deck.leave_out(block, "weight: the body has no density, or several")
                continue
            (density,) = densities
            direction = _unit(words[1:])[: deck.mesh.dim]
            _given(deck, Load("body_force", "", tuple(deck.axes), direction), (density or 0.0) * words[0])
        else:
            _given(deck, Load("body_force", "", (kind[1].lower(),)), words[0])


def _whole(deck: Deck, region: str) -> bool:
    return len(deck.mesh.regions[region]) == len(deck.mesh.cells)


def _unit(vector: list[float]) -> tuple[float, ...]:
    size = math.hypot(*vector)
    if not size > 0:
        raise ValueError("a direction is expected")
    return tuple(value / size for value in vector)


def _given(deck: Deck, load: Load, value: float) -> None:
    key = (load.table, load.target, load.keys, load.direction)
    deck.loads.setdefault(key, load).values[deck.step] = value


def _forget(deck: Deck, table: str) -> None:
    """What steps have given so far ends with this one."""
    for load in deck.loads.values():
        if load.table == table:
            load.values[deck.step] = 0.0
