"""An Abaqus input file as a scene can say it: materials, static steps with what acts in them, and contact.

What a scene cannot say, or what would need a guess, is listed and left out.  No dolfinx here.
"""

from __future__ import annotations

import itertools
import os
import re
from collections.abc import Generator, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from signorini_fx.addons.decks.bolts import read_bolt
from signorini_fx.addons.decks.content import Deck, Turn, plain_name
from signorini_fx.addons.decks.couplings import read_coupling
from signorini_fx.addons.decks.keywords import (
    AS_BEFORE,
    CHANGED_WITHIN,
    COMING_AND_GOING,
    FINITE,
    FRICTION_FIRST,
    NO_CLEARANCE,
    NO_PROCEDURE,
    NO_SECTORS,
    NOT_WRITTEN,
    OTHER_BEHAVIOUR,
    OTHER_PROCEDURE,
    OUTSIDE_STEPS,
    PERTURBATION,
    PLAIN,
    RULES,
    SECTOR,
    SMALL,
    STATIC,
    SUBROUTINE,
    TURNED,
    UNKNOWN,
    WITHIN_STEP,
    WRITTEN,
    Grade,
)
from signorini_fx.addons.decks.load_areas import find_load_areas
from signorini_fx.addons.decks.loads import (
    follow_amplitudes,
    read_body_forces,
    read_boundary,
    read_forces,
    read_surface_loads,
)
from signorini_fx.addons.decks.material import read_constants, read_section
from signorini_fx.addons.decks.nodal import read_constraints, read_equations
from signorini_fx.addons.decks.nonlinear_material import has_rubber, read_hardening, read_rubber
from signorini_fx.addons.decks.temperatures import read_temperatures
from signorini_fx.addons.decks.ties import link_sectors
from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.files.abaqus import NO_BODY, POINTS, read_model, removes_elements
from signorini_fx.mechanics.mesh.files.abaqus_blocks import DeckBlock, DeckError, parameter, real, real_or_none
from signorini_fx.mechanics.mesh.files.arrays import from_raw

_STRESS = re.compile(r"CPS|STRI|M3D|S\d")  # plane stress, if they are a plane body
# How a contact pair is discretised, which a scene chooses itself.
_KINDS_OF_PAIRS = ("NODETOSURFACE", "SURFACETOSURFACE", "MORTAR", "LINMORTAR", "PGLINMORTAR", "MASSLESS")
# What a step changes beside friction.
_CHANGES = ("BOUNDARY", "CLOAD", "DLOAD", "DSLOAD", "TEMPERATURE", "MODELCHANGE")
# Elements that may have friction of their own, of no *SURFACE INTERACTION.
_WITH_FRICTION = ("GAP", "CONNECTORFRICTION")
# What a step does, unless it is static.
_PROCEDURES = {rule.key for rule in RULES if rule.effect == OTHER_PROCEDURE}


def read_deck(file: Path, *, at_nodes: bool = False, finite: bool = False) -> Deck:
    """An input file: its mesh, and what acts on the body.

    Args:
        file: the input file.
        at_nodes: whether equal forces at the nodes of a side stay there, and do not become an even traction.
        finite: whether NLGEOM means finite strains, and not that displacements are taken as small.

    Raises:
        MeshError: there is no such file, or it is no mesh, see ``read_file``; a number is none, or a line has too few;
            the first step is of no kind.
    """
    if not os.path.isfile(file):  # a name may be of any length
        raise MeshError(f"{file}: no such file")
    model = read_model(file)
    deck = Deck(from_raw(model.raw, str(file)), model, at_nodes=at_nodes, finite=finite)
    for name, missing in deck.model.undefined.items():
        say = deck.lose if name in deck.model.surfaces else deck.note
        say(None, f"members of the set {name!r} that are not defined, or no part of the body: {missing}")
    _find_rigid(file, deck)
    try:
        find_load_areas(deck)
    except DeckError as error:
        raise MeshError(f"{file}: {error.text}") from None
    for block in deck.model.blocks:
        if block.keyword == "PRE-TENSIONSECTION":
            with _placed(file, block):
                read_bolt(deck, block)
    for block in deck.model.blocks:
        with _placed(file, block):
            match block.keyword:
                case "AMPLITUDE":
                    deck.amplitudes[block.parameters["NAME"].upper()] = block
                case "ORIENTATION":
                    deck.orientations[block.parameters["NAME"].upper()] = block
                case "TRANSFORM":
                    if (turn := _turn(deck, block)) is not None:
                        deck.turned |= dict.fromkeys(map(int, deck.nodes(block.parameters["NSET"])), turn)
    material = interaction = changed = ""
    behaving = of_element = False
    for block in _used_keywords(file, deck):
        with _placed(file, block):
            match block.keyword:
                case "CHANGEFRICTION":
                    changed = block.parameters["INTERACTION"].upper()
                    continue
                case "CHANGESURFACEBEHAVIOR":
                    deck.lose(block, OTHER_BEHAVIOUR)
                    behaving = True
                    continue
                case "FRICTION" if of_element:
                    pass  # the keyword before it is lost
                case "FRICTION" if deck.steps and changed:
                    _change_friction(deck, block, changed)
                case "SURFACEBEHAVIOR" if deck.steps and behaving:
                    pass  # *CHANGE SURFACE BEHAVIOR has said it
                case "ELASTIC" | "EXPANSION" | "HYPERELASTIC" | "PLASTIC" | "FRICTION" | "SURFACEBEHAVIOR" if (
                    deck.steps
                ):
                    deck.lose(block, CHANGED_WITHIN)
                case "MATERIAL":
                    material = block.parameters["NAME"].upper()
                    deck.materials.setdefault(material, {})
                case "SURFACEINTERACTION":
                    if block.rows and deck.mesh.dim == 3:  # in the plane it is a thickness
                        text = ", ".join(block.rows[0])
                        raise ValueError(f"data line 1, {text!r}, is one too many: of which keyword is it?")
                    interaction = block.parameters["NAME"].upper()
                    deck.frictions.setdefault(interaction, {})
                    if "USER" in block.parameters:
                        deck.lose(block, SUBROUTINE)
                case "ELASTIC" | "DENSITY" | "EXPANSION" | "HYPERELASTIC" | "PLASTIC" if not material:
                    raise ValueError("no *MATERIAL is before it")
                case "FRICTION" | "SURFACEBEHAVIOR" if not interaction:
                    raise ValueError("no *SURFACE INTERACTION is before it")
                case "ELASTIC" | "DENSITY" | "EXPANSION":
                    read_constants(deck, block, material)
                case "HYPERELASTIC":
                    read_rubber(deck, block, material)
                case "PLASTIC":
                    read_hardening(deck, block, material)
                case "FRICTION":
                    _friction(deck, block, interaction)
                case "SURFACEBEHAVIOR":
                    _behaviour(deck, block, interaction)
                case _:
                    _read(deck, block)
        changed, behaving, of_element = "", False, block.keyword in _WITH_FRICTION
    try:
        follow_amplitudes(deck)
    except DeckError as error:
        raise MeshError(f"{file}: {error.text}") from None
    return deck


def _turn(deck: Deck, block: DeckBlock) -> Turn | None:
    """The axes of *TRANSFORM; None: they are neither rectangular nor cylindrical.

    Raises:
        ValueError: its points do not determine them.
    """
    kind = block.parameters.get("TYPE", "R").upper()
    points = [real(word) for row in block.rows[:1] for word in row]
    if len(points) != 6:
        raise ValueError("two points are expected")
    if kind not in ("R", "C"):
        deck.lose(block, f"TYPE={kind}: {TURNED}")
        return None
    turn = Turn(tuple(points[:3]), tuple(points[3:]), round=kind == "C")
    turn.at(np.zeros(3))
    return turn


@contextmanager
def _placed(file: Path, block: DeckBlock) -> Iterator[None]:
    """Add the place in the file to an error."""
    try:
        yield
    except DeckError as error:  # of another keyword that this one refers to
        raise MeshError(f"{file}: {error.text}") from None
    except IndexError:
        raise MeshError(f"{file}: {block.origin}: a data line ends too early, or is missing") from None
    except ValueError as error:
        raise MeshError(f"{file}: {block.origin}: {error}") from None
    except KeyError as error:
        raise MeshError(f"{file}: {block.origin}: {error} is missing") from None


def _used_keywords(file: Path, deck: Deck) -> Iterator[DeckBlock]:
    """The keywords without those of steps that a scene has not.

    Raises:
        MeshError: the first step does not say of what kind it is, or one does not end before the next one; a keyword is
            within a step, or outside of one, where it has no meaning.
    """
    step: list[DeckBlock] | None = None
    steps, file_step, kind = 0, -1, ""
    for block in deck.model.blocks:
        if block.keyword == "STEP":
            if step is not None:
                raise MeshError(f"{file}: {block.origin}: the step of {step[0].place} has no *END STEP before this one")
            step = []
            file_step += 1
        if step is None:
            if block.keyword in {STATIC, *_CHANGES} - ({"BOUNDARY"} if file_step < 0 else set()):
                raise MeshError(f"{file}: {block.origin}: {OUTSIDE_STEPS}")
            yield block
            continue
        if block.keyword == "INITIALCONDITIONS":
            raise MeshError(f"{file}: {block.origin}: {WITHIN_STEP}")
        step.append(block)
        if block.keyword != "ENDSTEP" and block is not deck.model.blocks[-1]:
            continue
        procedure = next((entry.name for entry in step if entry.keyword in {STATIC, *_PROCEDURES}), "")
        if not procedure and not kind:
            raise MeshError(f"{file}: {step[0].origin}: {NO_PROCEDURE}")
        if not procedure:
            deck.note(step[0], f"*{kind}, {AS_BEFORE}")
        kind = procedure or kind
        if kind != STATIC:
            deck.lose(step[0], f"the step, *{kind}: {OTHER_PROCEDURE}")
        elif steps and "PERTURBATION" in step[0].parameters:
            deck.lose(step[0], "the step, a perturbation of the one before it")
        else:
            if "PERTURBATION" in step[0].parameters:
                deck.lose(step[0], PERTURBATION)
            steps += 1
            if steps > 1:
                step = yield from _friction_first(deck, step)
            deck.taken.append(file_step)
            yield from step
        step = None


def _friction_first(deck: Deck, step: list[DeckBlock]) -> Generator[DeckBlock, None, list[DeckBlock]]:
    """Give what changes friction a step of its own, without time, if the step of the file changes more than that: in
    CalculiX another coefficient holds from its first increment on, when its loads have hardly begun to act.

    Returns:
        What is left of the step.
    """
    follows = any("TIME" in amplitude.parameters for amplitude in deck.amplitudes.values())  # loads of earlier steps
    changes = [block for block in step if block.keyword == "CHANGEFRICTION"]
    if not changes or not (follows or any(block.keyword in _CHANGES for block in step)):
        return step
    name = step[0].parameters.get("NAME", f"step {deck.given_steps + 1}")
    _begin_step(deck, f"{name}, friction", period=0.0)
    deck.taken.append(None)
    deck.note(changes[0], FRICTION_FIRST)
    remaining_blocks: list[DeckBlock] = []
    keywords = [block.keyword for block in step]
    for block, pair in zip(step, zip(["", *keywords], keywords, strict=False), strict=True):
        if block.keyword == "CHANGEFRICTION" or pair == ("CHANGEFRICTION", "FRICTION"):
            yield block
        else:
            remaining_blocks.append(block)
    return remaining_blocks


def _begin_step(deck: Deck, name: str, *, period: float) -> None:
    """Let another step of the scene begin, which lasts for some time."""
    deck.steps.append(name)
    deck.time += deck.period if deck.step else 0.0
    deck.period = period
    deck.ends[deck.step] = deck.time + period


def _read(deck: Deck, block: DeckBlock) -> None:
    parameters, rows = block.parameters, block.rows
    match block.keyword:
        case "HEADING":
            deck.title = ", ".join(rows[0]) if rows else ""
        case "SOLIDSECTION" | "SHELLSECTION" | "MEMBRANESECTION" | "BEAMSECTION":
            read_section(deck, block)
        case "ELEMENT":
            kind = parameters["TYPE"].upper()
            _hypothesis(deck, block, kind)
            if NO_BODY.match(kind) and not POINTS.match(kind):
                deck.lose(block, f"{kind}, which is no part of the body")
        case "STEP":
            _begin_step(deck, parameters.get("NAME", f"step {deck.given_steps}"), period=1.0)
            if not has_rubber(deck) and "NLGEOM" in parameters and parameters["NLGEOM"].upper() in ("", "YES"):
                deck.note(block, FINITE if deck.finite else SMALL)
                deck.nonlinear = block
        case "STATIC":
            deck.period = (real(rows[0][1]) if rows and len(rows[0]) > 1 else 0.0) or 1.0  # as both programs take it
            deck.ends[deck.step] = deck.time + deck.period
        case "BOUNDARY":
            read_boundary(deck, block)
        case "DSLOAD":
            read_surface_loads(deck, block)
        case "DLOAD":
            read_body_forces(deck, block)
        case "CLOAD":
            read_forces(deck, block)
        case "TEMPERATURE" | "INITIALCONDITIONS":
            read_temperatures(deck, block)
        case "CONTACTPAIR":
            _check_pair(deck, parameters)
            pairs = [deck.facing(_pair(row, parameters.get("INTERACTION", ""))) for row in rows]
            deck.pairs += pairs
            deck.pairing |= dict.fromkeys(pairs, block)
            if "ADJUST" in parameters:
                deck.adjusted |= dict.fromkeys(pairs, parameters["ADJUST"])
        case "MODELCHANGE":
            _change_model(deck, block)
        case "CLEARANCE":
            _clearance(deck, block)
        case "EQUATION":
            read_equations(deck, block)
        case "MPC":
            read_constraints(deck, block)
        case "COUPLING" | "KINEMATIC" | "DISTRIBUTING":
            pass  # have been read where rigid bodies are found
        case "CYCLICSYMMETRYMODEL":
            link_sectors(deck, block)
        case "TIE" if "CYCLICSYMMETRY" in parameters:
            if not any(model.keyword == "CYCLICSYMMETRYMODEL" for model in deck.model.blocks):
                deck.lose(block, NO_SECTORS)
        case "TIE":
            ties = [_pair(row, "")[:2] for row in rows]
            deck.ties += ties
            deck.pairing |= dict.fromkeys(ties, block)
        case keyword if keyword in WRITTEN:
            _output(deck, block)
        case keyword:
            rule = PLAIN.get(keyword)
            if rule is None or rule.grade is Grade.LOST:
                deck.lose(block, UNKNOWN if rule is None else rule.effect)
            elif rule.grade is Grade.NOTED:
                deck.note(block, rule.effect)


def _change_model(deck: Deck, block: DeckBlock) -> None:
    """*MODEL CHANGE: what the first step removes, and nothing adds again, is not there; contact pairs are so far."""
    if removes_elements(block) and not deck.step:
        return  # the mesh is without them
    if block.parameters.get("TYPE", "ELEMENT").upper().replace(" ", "") != "CONTACTPAIR":
        deck.lose(block, COMING_AND_GOING)
        return
    for row in block.rows:
        pair = frozenset((row[0].upper(), row[-1].upper()))
        added = "ADD" in block.parameters
        if not added and not deck.step:
            deck.vanished.add(pair)
        elif added != (pair not in deck.vanished and all(deck.touching_in(pair, deck.step)[-1:])):
            if pair in deck.vanished:  # the first step has removed it
                deck.paired.setdefault(pair, {})[0] = False
                deck.vanished.discard(pair)
            deck.paired.setdefault(pair, {})[deck.step] = added


def _clearance(deck: Deck, block: DeckBlock) -> None:
    """*CLEARANCE: the distance of the surfaces of a contact pair."""
    parameters = block.parameters
    if "VALUE" not in parameters or deck.step > 0:
        deck.lose(block, NO_CLEARANCE)
        return
    deck.clearances[frozenset((parameters["SLAVE"].upper(), parameters["MASTER"].upper()))] = parameter(block, "VALUE")


def _output(deck: Deck, block: DeckBlock) -> None:
    """Say which tables are not written, and of which body forces are."""
    file, written = WRITTEN[block.keyword]
    rows = block.rows
    if block.keyword.startswith("EL") and rows and all(word.isdecimal() for word in rows[0]):
        rows = rows[1:]  # in Abaqus these are points of the sections of shells and beams
    words = [word.upper() for row in rows for word in row if word]
    numbers = [word for word in words if real_or_none(word) is not None]
    if block.keyword == "SECTIONPRINT":  # in Abaqus a point and axes for the forces of a section are before results
        words = [word for word in words if word not in numbers]
    elif numbers:
        raise ValueError(f"{numbers[0]} is no result that can be written: of which keyword is this data line?")
    missing = [word for word in words if word[:4] not in written]
    if missing:
        deck.note(block, f"{', '.join(missing)} in {file}: {NOT_WRITTEN}")
    if "RF" in words and "RF" in written and not deck.kinematics.uniform:
        deck.note(block, f"RF in {file}: {SECTOR}")


def _hypothesis(deck: Deck, block: DeckBlock, kind: str) -> None:
    """What elements of the plane assume; one assumption is that of all."""
    if deck.mesh.dim == 3 or NO_BODY.match(kind) or kind == "CAX4P":  # meshio writes any quadrilateral as CAX4P
        return
    known = {"axisymmetric": "CAX", "plane stress": _STRESS.pattern, "plane strain": "CPE"}
    assumed = next((name for name, pattern in known.items() if re.match(pattern, kind)), None)
    if assumed is None:
        return
    if deck.assumed not in ("", assumed):
        deck.lose(block, f"{kind} beside elements of another kind ({deck.assumed}): all are {assumed} here")
    deck.assumed = assumed
    deck.hypothesis = "" if assumed == "plane strain" else assumed


def _pair(row: list[str], interaction: str) -> tuple[str, str, str]:
    return row[0], row[1] if len(row) > 1 else row[0], interaction.upper()


def _check_pair(deck: Deck, parameters: Mapping[str, str]) -> None:
    """What a *CONTACT PAIR refers to must be there.

    Raises:
        ValueError: it is not.
    """
    kind = parameters.get("TYPE", "NODE TO SURFACE")
    if kind.upper().replace(" ", "") not in _KINDS_OF_PAIRS:
        raise ValueError(f"TYPE={kind}: NODE TO SURFACE, SURFACE TO SURFACE or MORTAR is expected")
    interaction, adjustment = parameters.get("INTERACTION", "").upper(), parameters.get("ADJUST")
    blocks = (block for block in deck.model.blocks if block.keyword == "SURFACEINTERACTION")
    if interaction and interaction not in {block.parameters.get("NAME", "").upper() for block in blocks}:
        raise ValueError(f"there is no *SURFACE INTERACTION, NAME={interaction}")
    is_length = bool(adjustment) and real_or_none(str(adjustment)) is not None
    if adjustment is not None and not is_length and not deck.has_nodes(adjustment):
        raise ValueError(f"ADJUST={adjustment}: a length or the name of a set of nodes is expected")


def _find_rigid(file: Path, deck: Deck) -> None:
    """Rigid surfaces, and the nodes or sets of nodes that move them, wherever in the file they are named."""
    coupling: DeckBlock | None = None
    for block in deck.model.blocks:
        match block.keyword:
            case "COUPLING":
                coupling = block
            case "RIGIDBODY":
                _read_rigid(deck, block)
            case "KINEMATIC" | "DISTRIBUTING":
                with _placed(file, block):
                    read_coupling(deck, coupling, block)
            case "ELEMENT" if re.match(r"R[23]D", block.parameters.get("TYPE", "").upper()):
                deck.rigid.add(plain_name(block.parameters.get("ELSET", "")))
    for block in (block for block in deck.model.blocks if block.keyword == "SURFACE" and "NAME" in block.parameters):
        name = plain_name(block.parameters["NAME"])
        if block.parameters.get("TYPE", "").upper() in ("SEGMENTS", "CYLINDER", "REVOLUTION"):
            deck.drawn[name] = block.rows
            deck.rigid.add(name)
        elif block.rows and all(plain_name(row[0]) in deck.rigid for row in block.rows):
            deck.rigid.add(name)
            deck.parts[name] = [plain_name(row[0]) for row in block.rows]
            nodes = [deck.movers[part] for part in deck.parts[name] if part in deck.movers]
            deck.movers |= {name: nodes[0]} if nodes else {}
    deck.rigid.discard("")


def _read_rigid(deck: Deck, block: DeckBlock) -> None:
    """*RIGID BODY."""
    parameters = block.parameters
    names = [parameters[key] for key in ("ANALYTICALSURFACE", "ELSET") if key in parameters]
    sets = [parameters[key] for key in ("NSET", "TIENSET", "PINNSET") if key in parameters]
    node, turner = (deck.single(parameters.get(key, "")) for key in ("REFNODE", "ROTNODE"))
    if node is not None and turner is not None:
        deck.turners[turner] = node
    if sets and not names and node is not None and all(deck.boundary(name) is not None for name in sets):
        deck.coupled += [(name, node) for name in sets]
        return
    if not names or any(deck.region(name) is not None for name in names):
        deck.lose(block, "a rigid part of the body: it deforms here")
        return
    deck.rigid |= {plain_name(name) for name in names}
    deck.movers |= {plain_name(name): node for name in names if node is not None}


def _friction(deck: Deck, block: DeckBlock, interaction: str) -> None:
    if "ROUGH" in block.parameters:
        deck.rough.add(interaction)
        return
    friction = deck.frictions.setdefault(interaction, {})
    if block.rows and block.rows[0]:
        friction["coefficient"] = real(block.rows[0][0])
    if "TAUMAX" in block.parameters:
        friction["cap"] = parameter(block, "TAUMAX")
    # CalculiX gives the stiffness of sticking after the coefficient.
    if len(block.rows) == 1 and len(block.rows[0]) == 2:
        deck.sticking[interaction] = _stiffness_of(block.rows[0][1])
    if len(block.rows) > 1 or any(len(row) > 2 for row in block.rows):
        deck.lose(block, "friction that depends on speed, pressure or temperature: the first coefficient is taken")


def _change_friction(deck: Deck, block: DeckBlock, interaction: str) -> None:
    """*CHANGE FRICTION: another coefficient from a step on."""
    stiffness, earlier = deck.sticking.get(interaction), dict(deck.frictions.get(interaction, {}))
    deck.frictions[interaction] = {}
    _friction(deck, block, interaction)
    current = deck.frictions[interaction]
    deck.frictions[interaction] = earlier
    deck.rubbing.setdefault(interaction, {})[deck.step] = current.get("coefficient", 0.0)
    if deck.sticking.get(interaction, stiffness) != stiffness:
        deck.lose(block, "another stiffness of sticking within a step: the first one is taken")
        deck.sticking[interaction] = stiffness or deck.sticking[interaction]
    if current.get("cap") != earlier.get("cap"):
        deck.lose(block, "another TAUMAX within a step: the first one is taken")


def _behaviour(deck: Deck, block: DeckBlock, interaction: str) -> None:
    kind = block.parameters.get("PRESSURE-OVERCLOSURE", "HARD").upper()
    if interaction in deck.behaviours:
        deck.lose(block, f"a second behaviour of the interaction {interaction!r}: the last one is taken")
        deck.tied.discard(interaction)
        deck.stiffness.pop(interaction, None)
        deck.overclosures.pop(interaction, None)
    for word in itertools.chain(*block.rows):
        real(word)  # also those that only some programs or laws read
    deck.behaviours[interaction] = block
    if kind == "TIED":
        deck.tied.add(interaction)
    if kind in ("LINEAR", "TIED") and block.rows and block.rows[0]:
        deck.stiffness[interaction] = _stiffness_of(block.rows[0][0])
    elif kind == "EXPONENTIAL":
        words = block.rows[0][:2]
        if len(words) < 2:
            raise ValueError("two numbers, clearance and pressure, are expected")
        clearance, pressure = map(real, words)
        deck.overclosures[interaction] = f'law = "exponential", clearance = {clearance!r}, pressure = {pressure!r}'
    elif kind == "TABULAR":
        rows = [[real(word) for word in row[:2]] for row in block.rows]
        deck.overclosures[interaction] = f'law = "tabular", rows = {_from_zero(rows)}'
    elif kind == "HARD" and any(block.rows):
        deck.lose(block, "its numbers: here it is hard")
    elif kind not in ("HARD", "TIED"):
        deck.lose(block, f"soft contact, {kind.lower()}: here it is hard")
    if "NOSEPARATION" in block.parameters:
        deck.lose(block, 'contact that does not open again: kind = "bilateral" does not open at all')


def _stiffness_of(word: str) -> float:
    """Of a contact."""
    if not (stiffness := real(word)) > 0:
        raise ValueError(f"a contact has the stiffness {stiffness:g}, which is not positive")
    return stiffness


def _from_zero(rows: list[list[float]]) -> list[list[float]]:
    """Rows of pressure and overclosure that begin with the pressure zero.

    Raises:
        ValueError: they have no two numbers each, or do not increase.
    """
    if len(rows) < 2 or any(len(row) != 2 for row in rows):
        raise ValueError("two rows of pressure and overclosure at least are expected")
    if any(b <= a for row, later in itertools.pairwise(rows) for a, b in zip(row, later, strict=True)):
        raise ValueError("pressure and overclosure must increase from row to row")
    first, second = rows[:2]
    if first[0] > 0:  # as on the line between the first two
        zero = first[1] - first[0] * (second[1] - first[1]) / (second[0] - first[0])
        rows = [[0.0, zero], *rows]
    return rows
