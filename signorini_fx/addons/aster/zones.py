"""Contact of a command file, DEFI_CONTACT and DEFI_CONT.  No dolfinx here."""

from __future__ import annotations

from typing import Any

import numpy as np

from signorini_fx.addons.aster.study import AsterStudy, ExcludedNodes, Zone, add_once
from signorini_fx.addons.aster.values import AsterCommand, CommandError
from signorini_fx.mechanics.mesh.files.shape import Ints

# Keywords of a zone that steer how code_aster solves, or how it looks for the other side.
_HOW = frozenset(
    [
        "ALGO_CONT",
        "ALGO_FROT",
        "COEF_CONT",
        "COEF_FROT",
        "APPARIEMENT",
        "INTEGRATION",
        "ORDRE_INT",
        "CONTACT_INIT",
        "TYPE_APPA",
        "TOLE_PROJ_EXT",
        "TOLE_PROJ_INT",
        "COEF_MATR_FROT",
        "SEUIL_INIT",
        "ADAPTATION",
        "ALARME_JEU",
        "VERI_NORM",
        "TYPE_MATR_TANG",
        "VARIANTE",
        "DIST_APPA",
        "COEF_MULT_APPA",
        "TYPE_JACOBIEN",
        "GRAND_GLIS",
        "TOLE_INTERP",
        "TYPE_PROJECTION",
        "PENE_MAXI",
        "GLIS_MAXI",
        "COEF_PENA_CONT",
        "COEF_PENA_FROT",
        "E_N",
        "E_T",
        "COULOMB",
        "FROTTEMENT",
        "TYPE_FROT",
        "GROUP_MA_MAIT",
        "GROUP_MA_ESCL",
        "NORMALE",
        "LISSAGE",
        "RESOLUTION",
        "GLISSIERE",
        "TYPE_CONT",
        "SYME",
        "DECOUPE",
        "SANS_GROUP_NO",
        "SANS_GROUP_MA",
        "SANS_GROUP_NO_FR",
        "DIRE_EXCL_FROT",
    ]
)

_YES_OR_NO = ("OUI", "NON")
_ALGORITHMS = ("STANDARD", "PENALISATION", "LAC", "LAGRANGIEN", "GCP", "CONTRAINTE", "NITSCHE")


def read_contact(study: AsterStudy, solve: AsterCommand, value: Any) -> None:
    """What CONTACT says: zones with friction and stiffness.

    Raises:
        CommandError: a value is none, or a group is not there.
    """
    if isinstance(value, dict):  # MECA_NON_LINE
        value = value.get("DEFINITION")
    if isinstance(value, tuple | list) and len(value) == 1:
        (value,) = value
    command = solve.concept(value, "CONTACT").made_by
    formulation = command.get("FORMULATION", "CONTINUE")
    if formulation not in ("CONTINUE", "DISCRETE"):
        study.lose(command.origin, f"FORMULATION={formulation!r}: this contact is not in the scene")
        return
    if command.get("REAC_GEOM", "AUTOMATIQUE") != "SANS":
        study.follows = f"{command.origin}: REAC_GEOM"
    rubs = command.choice(command.keywords, "FROTTEMENT", ("SANS", "COULOMB")) == "COULOMB"
    if not command.factors("ZONE"):
        raise CommandError(command.origin, "ZONE: _F(...) is expected")
    for number, entry in enumerate(command.factors("ZONE"), 1):
        if command.choice(entry, "RESOLUTION", _YES_OR_NO) == "NON":
            study.note(command.origin, f"zone {number}: RESOLUTION='NON': no contact")
            continue
        _zone(study, command, number, entry, discrete=formulation == "DISCRETE", rubs=rubs)


def _zone(
    study: AsterStudy, command: AsterCommand, number: int, entry: dict[str, Any], *, discrete: bool, rubs: bool
) -> None:
    of_zone = f"zone {number}: "
    slave, master = (
        study.mesh.boundary(command, {"GROUP_MA": entry.get(key, ())}, study.dim)
        for key in ("GROUP_MA_ESCL", "GROUP_MA_MAIT")
    )
    for key, marks in (("GROUP_MA_ESCL", slave), ("GROUP_MA_MAIT", master)):
        if not any(mark.any() for mark in marks):
            raise CommandError(command.origin, f"{of_zone}{key}: elements of a boundary are expected")
    coefficient, sticking, stiffness = 0.0, None, None
    zone_rubs = command.choice(entry, "FROTTEMENT", _YES_OR_NO[::-1]) == "OUI"
    if rubs or (zone_rubs and entry.get("TYPE_FROT", "SANS") == "COULOMB"):
        coefficient = command.number(entry.get("COULOMB"), "COULOMB")
    elif zone_rubs and entry.get("TYPE_FROT", "SANS") != "SANS":
        study.lose(command.origin, f"{of_zone}TYPE_FROT={entry['TYPE_FROT']!r}: no friction")
    penalty = command.choice(entry, "ALGO_CONT", _ALGORITHMS) == "PENALISATION"
    soft_friction = command.choice(entry, "ALGO_FROT", _ALGORITHMS) == "PENALISATION"
    if discrete and "E_N" in entry and penalty:
        area = _nodal_area(study, slave)
        stiffness = command.number(entry["E_N"], "E_N") / area
        study.note(command.origin, f"{of_zone}E_N at each node: over a mean area of {area:.3g} at a node")
        if coefficient and "E_T" in entry:
            sticking = command.number(entry["E_T"], "E_T") / area
    elif penalty and "COEF_PENA_CONT" in entry:
        stiffness = command.number(entry["COEF_PENA_CONT"], "COEF_PENA_CONT")
    elif penalty and "COEF_CONT" in entry and command.name == "DEFI_CONT":
        stiffness = command.number(entry["COEF_CONT"], "COEF_CONT")
    elif penalty:
        study.lose(command.origin, f"{of_zone}ALGO_CONT='PENALISATION' without its stiffness: contact is hard")
    if coefficient and soft_friction and "COEF_PENA_FROT" in entry:
        sticking = command.number(entry["COEF_PENA_FROT"], "COEF_PENA_FROT")
    slides = command.choice(entry, "GLISSIERE", _YES_OR_NO[::-1]) == "OUI"
    if slides or command.choice(entry, "TYPE_CONT", ("UNILATERAL", "BILATERAL")) == "BILATERAL":
        study.stays.append(f"{command.origin}: {of_zone}GLISSIERE")
    for key in ("SANS_GROUP_NO", "SANS_GROUP_MA", "SANS_GROUP_NO_FR"):
        if key in entry and (coefficient or key != "SANS_GROUP_NO_FR"):
            _exclude(study, command, number, key, entry, slave, rubs=coefficient > 0)
    for key in entry.keys() - _HOW:
        study.lose(command.origin, f"{of_zone}{key} is not known here")
    add_once(
        study.formulations, _formulation(entry, discrete=discrete, penalty=penalty, mortar=command.name == "DEFI_CONT")
    )
    vector = command.name == "DEFI_CONT" and zone_rubs
    none: Ints = np.empty(0, dtype=np.int64)
    zone = Zone(slave, master, coefficient, stiffness, sticking, command.origin, number, vector, none, none)
    study.zones.append(zone)


def _formulation(entry: dict[str, Any], *, discrete: bool, penalty: bool, mortar: bool) -> str:
    if discrete:
        words = "contact at nodes (DISCRETE)"
    elif mortar or entry.get("ALGO_CONT") == "LAC":
        words = f"a mortar method ({entry.get('ALGO_CONT', 'DEFI_CONT')})"
    else:
        words = f"contact at quadrature points (CONTINUE, {entry.get('INTEGRATION', 'AUTO')})"
    return words + (", a penalty" if penalty else "")


def _exclude(
    study: AsterStudy,
    command: AsterCommand,
    number: int,
    key: str,
    entry: dict[str, Any],
    slave: list[Any],
    *,
    rubs: bool,
) -> None:
    """Note the nodes of a zone without contact or friction."""
    names = command.words(entry[key], key)
    nodes = None if key == "SANS_GROUP_MA" else study.mesh.nodes(command, names)
    if nodes is None:
        nodes = study.mesh.nodes_of_cells(study.mesh.cells(command, names))
    nodes = np.intersect1d(nodes, study.mesh.nodes_of_cells(slave))
    acting = np.ones((len(nodes), 3)) if rubs else study.mesh.normals(slave)[nodes]
    origin = f"{command.origin}: zone {number}: {key}"
    friction = key == "SANS_GROUP_NO_FR"
    if friction and "DIRE_EXCL_FROT" in entry:
        direction = np.array(command.numbers(entry["DIRE_EXCL_FROT"], "DIRE_EXCL_FROT"))
        if len(direction) < study.dim or not direction.any():
            raise CommandError(command.origin, f"DIRE_EXCL_FROT: {study.dim} numbers that are not all 0 are expected")
        acting = np.tile(direction / np.linalg.norm(direction), (len(nodes), 1))
        origin = f"{command.origin}: zone {number}: DIRE_EXCL_FROT"
    study.excluded.append(ExcludedNodes(nodes, acting, number, friction, "DIRE_EXCL_FROT" in origin, origin))


def _nodal_area(study: AsterStudy, marks: list[Any]) -> float:
    """The mean area at a node of a surface, per radian of a body of revolution."""
    area, nodes = 0.0, study.mesh.nodes_of_cells(marks)
    for (kind, rows), mark in zip(study.mesh.blocks, marks, strict=True):
        x = study.mesh.points[rows[mark]]
        if not len(x):
            continue
        if kind.startswith("line"):
            lengths = np.linalg.norm(x[:, 1] - x[:, 0], axis=1)
            if study.model == "AXIS":
                lengths = lengths * (x[:, 0, 0] + x[:, 1, 0]) / 2
            area += float(lengths.sum())
        else:
            corners = 3 if kind.startswith("triangle") else 4
            for k in range(1, corners - 1):
                area += float(np.linalg.norm(np.cross(x[:, k] - x[:, 0], x[:, k + 1] - x[:, 0]), axis=1).sum()) / 2
    return area / len(nodes)
