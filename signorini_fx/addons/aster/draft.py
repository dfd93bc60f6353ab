"""The draft of a scene from a command file of code_aster, or from another case.  No dolfinx here."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np

from signorini_fx.addons.aster.command_file import CommandFile, read_commands
from signorini_fx.addons.aster.deck_text import DeckText, interaction_of
from signorini_fx.addons.aster.problem import read_study, results_of
from signorini_fx.addons.aster.study import AsterStudy, CaseStudy
from signorini_fx.addons.aster.values import Concept
from signorini_fx.addons.decks.content import Deck
from signorini_fx.addons.decks.deck import read_deck
from signorini_fx.addons.decks.draft import Draft, draft_of
from signorini_fx.addons.decks.nodal import link_nodes
from signorini_fx.errors import MeshError


@dataclass(frozen=True)
class StudyDraft(Draft):
    """A scene that was drafted from a case; the mesh and what acts on it are in an input file beside it.

    Attributes:
        study: what was read.
        at_case: makes messages about lines of the input file such of the case.
    """

    study: CaseStudy
    at_case: Callable[[str], str]


@dataclass(frozen=True)
class CommandDraft(StudyDraft):
    """A scene that was drafted from a command file.

    Attributes:
        study: what was read.
    """

    study: AsterStudy


def draft_commands(file: Path, target: Path) -> CommandDraft:
    """The scene of the first result of a command file.

    Args:
        file: the command file, beside which its mesh is.
        target: where the scene will be; the input file that it refers to is written beside it.

    Raises:
        MeshError: the file, or its mesh, cannot be read, or has what is not known here; the message says where.
    """
    commands = read_commands(file)
    results = results_of(commands)
    if not results:
        raise MeshError(f"{file}: it solves nothing: STAT_NON_LINE, MECA_NON_LINE or MECA_STATIQUE is expected")
    drafted = draft_result(file, commands, results[0], target)
    if len(results) > 1:
        further = ", ".join(result.name for result in results[1:])
        note = f"the first result, {results[0].name}, is taken; others are {further}"
        drafted = replace(drafted, noted=[note, *drafted.noted])
    return drafted


def draft_result(
    file: Path, commands: CommandFile, result: Concept, target: Path, wanted: Sequence[float] | None = None
) -> CommandDraft:
    """The scene of one result of a command file.

    Args:
        file: the command file.
        commands: what is in it.
        result: one of ``results_of``.
        target: where the scene will be.
        wanted: instants that are enough where the solution does not depend on what was before; None: all.

    Raises:
        MeshError: see ``draft_commands``.
    """
    study = read_study(file, commands, result, wanted)
    drafted = draft_study(study, file, target, f"{file.stem} {result.name}")
    return CommandDraft(**{part.name: getattr(drafted, part.name) for part in fields(drafted)} | {"study": study})


def draft_study(study: CaseStudy, file: Path, target: Path, title: str) -> StudyDraft:
    """The scene of a problem that was read from a case.

    Args:
        study: the problem.
        file: of the case, which messages name.
        target: where the scene will be; the input file that it refers to is written beside it.
        title: of the scene.

    Raises:
        MeshError: something of the case is not known here, or the input file cannot be written.
    """
    beside = target.with_suffix(".inp")
    try:
        deck_text = DeckText(study, title)
    except MeshError as error:
        raise MeshError(f"{file}: {error}") from None
    _write(beside, deck_text.text)
    try:
        deck = read_deck(beside)
        deck.slaves = True
        for zone in study.zones:
            name = interaction_of(zone)
            deck.untouched[name], deck.smooth[name] = (
                np.array([deck.node(row) for number in nodes + 1 for row in deck.rows([int(number)])], dtype=np.int64)
                for nodes in (zone.apart, zone.smooth)
            )
        _tie_middles(deck, study)
        for remark in study.noted:
            deck.note(None, remark)
        for remark in study.lost:
            deck.lose(None, remark)
        drafted = draft_of(deck, beside, target, file.name)
    except MeshError as error:
        raise MeshError(f"{file}: {deck_text.at_commands(str(error)).removeprefix(f'{beside}: ')}") from None
    files = {path: deck_text.at_commands(text) for path, text in drafted.files.items()}
    remarks = {key: list(map(deck_text.at_commands, getattr(drafted, key))) for key in ("lost", "noted")}
    return StudyDraft(
        files[target],
        remarks["lost"],
        remarks["noted"],
        deck,
        files,
        {table: deck_text.at_commands(origin) for table, origin in drafted.origins.items()},
        study,
        deck_text.at_commands,
    )


# Of the nodes of a face of degree 2 without the middle one their shares there, corners first.
_SERENDIPITY_MIDDLE = (-0.25,) * 4 + (0.5,) * 4


def _tie_middles(deck: Deck, study: CaseStudy) -> None:
    """Tie nodes in the middle of faces, which cells have here and not in the command file, to the other nodes of faces
    that supports with a value of its own at each node hold: there their displacement is that of the file's elements.
    """
    faces = deck.mesh.facets
    if deck.mesh.dim < 3 or faces.shape[1] != len(_SERENDIPITY_MIDDLE) + 1:
        return
    blocks = [block for block in deck.model.blocks if block.keyword == "BOUNDARY"]
    for support in study.supports:
        if not any(isinstance(value, np.ndarray) for value in support.values):
            continue
        held = [deck.node(row) for row in map(int, deck.rows(map(int, support.nodes + 1)))]
        unit = np.eye(3)[support.component]
        for face in faces[np.isin(faces[:, :-1], held).all(axis=1)]:
            terms = [(int(node), -share * unit) for node, share in zip(face, _SERENDIPITY_MIDDLE, strict=False)]
            link_nodes(deck, blocks[0], [(int(face[-1]), unit), *terms])


def _write(file: Path, text: str) -> None:
    """Write the input file, unless it is there as it is.

    Raises:
        MeshError: another one is there, or it cannot be written.
    """
    try:
        if file.is_file() and file.read_text(encoding="utf-8") == text:
            return
        if file.exists():
            raise MeshError(f"{file}: already exists: remove it")
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")
    except OSError as error:
        raise MeshError(f"{file}: cannot be written: {error.strerror}") from None
