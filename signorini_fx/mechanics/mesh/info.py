"""A description of a mesh file for writing a scene: names, counts, size, and unnamed parts."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from signorini_fx.arrays import Ints
from signorini_fx.mechanics.mesh.files.arrays import bounds, extent, pieces_of
from signorini_fx.mechanics.mesh.files.cells import measures
from signorini_fx.mechanics.mesh.files.formats import read_file
from signorini_fx.mechanics.statement.mesh_sources import MeshFile
from signorini_fx.tuned import NOTHING_LEFT

# The names of the size of the body and of its boundaries, by dimension.
_MEASURES = {2: ("area", "length"), 3: ("volume", "area")}


def mesh_info(file: MeshFile) -> dict[str, Any]:
    """Return a summary of a file that JSON can hold.

    Returns:
        ``cells``, ``kind``, ``degree`` (of the geometry), ``points``, ``bounds`` ([low, high], one
        pair of coordinates each), ``area``, in 3D ``volume``, with curved sides where they are;
        ``pieces`` (parts of the body that share no facet), ``coincident`` (points at the place of
        another one of the same region), ``touching`` (likewise, of another region);
        ``boundaries`` and ``unnamed`` (exterior facets without a name) with
        ``facets``, ``bounds`` and ``length``, in 3D ``area``; ``regions`` with ``cells`` and
        ``area``, in 3D ``volume``.
    """
    mesh = read_file(file)
    tiny = NOTHING_LEFT * mesh.diagonal
    places = np.where(np.abs(mesh.points) < tiny, 0.0, mesh.points)  # without round-off of zeros
    size = measures(mesh.points, mesh.cells, mesh.cell)
    areas = measures(mesh.points, mesh.facets, mesh.facet)
    measure, of_facets = _MEASURES[mesh.dim]

    def facets(rows: Ints) -> dict[str, Any]:
        figures = {"facets": len(rows), of_facets: float(areas[rows].sum())}
        return figures | (
            {"bounds": bounds(places[mesh.facet_corners[rows].ravel()])} if len(rows) else {}
        )

    pairs = cKDTree(mesh.points).query_pairs(tiny, output_type="ndarray")
    region = np.full(len(mesh.points), -1)
    for number, rows in enumerate(mesh.regions.values()):
        region[mesh.cells[rows].ravel()] = number
    apart = region[pairs[:, 0]] != region[pairs[:, 1]]
    named = np.concatenate([np.empty(0, dtype=np.int64), *mesh.boundaries.values()])
    return {
        "cells": len(mesh.cells),
        "kind": mesh.cell.word,
        "degree": mesh.degree,
        "points": len(mesh.points),
        "bounds": bounds(places),
        measure: float(size.sum()),
        "pieces": int(pieces_of(mesh).max()) + 1,
        "coincident": len(np.unique(pairs[~apart])),
        "touching": len(np.unique(pairs[apart])),
        "boundaries": {name: facets(rows) for name, rows in mesh.boundaries.items()},
        "unnamed": facets(np.setdiff1d(np.arange(len(mesh.facets)), named)),
        "regions": {
            name: {"cells": len(rows), measure: float(size[rows].sum())}
            for name, rows in mesh.regions.items()
        },
    }


def render(info: Mapping[str, Any], name: str) -> str:
    """Return the summary as text for a terminal."""
    lines: list[str] = []

    def row(title: str, text: str) -> None:
        lines.append(f"  {title:14s}{text}")

    degree = f", geometry of degree {info['degree']}" if info["degree"] > 1 else ""
    lines.append(f"{name}: {info['cells']} {info['kind']}, {info['points']} points{degree}")
    measure = "volume" if "volume" in info else "area"
    row("extent", f"{extent(info['bounds'])}; {measure} {info[measure]:g}")
    if info["pieces"] > 1:
        shared = "face" if "volume" in info else "side"
        row(
            "pieces",
            f"{info['pieces']} parts of the body share no {shared}: each must be held by itself",
        )
    if info["coincident"]:
        row(
            "warning",
            f"{info['coincident']} points coincide with another one: the cells there are not "
            "connected",
        )
    if info["touching"]:
        row("touching", f"{info['touching']} points of different regions have the same place")
    for title, entries in (("boundaries", info["boundaries"]), ("regions", info["regions"])):
        for label, entry in entries.items():
            row(title, f"{label:16s} {_amount(entry)}")
            title = ""
        if not entries:
            row(title, "none")
    if info["unnamed"]["facets"]:
        row("unnamed", f"{'exterior facets':16s} {_amount(info['unnamed'])}")
    return "\n".join(lines)


def _amount(entry: Mapping[str, Any]) -> str:
    size = next(f"{word} {entry[word]:g}" for word in ("volume", "area", "length") if word in entry)
    if "cells" in entry:
        return f"{entry['cells']} cells, {size}"
    if not entry["facets"]:
        return "no facets"
    return f"{entry['facets']} facets, {size}, {extent(entry['bounds'])}"
