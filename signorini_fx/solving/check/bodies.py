"""Findings about contact of two bodies: facets that are chords of curved sides."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt
from dolfinx import mesh as dmesh
from scipy.spatial import cKDTree

from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.assembly.mesh_entities import facet_entities, facet_vertices
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.contact_points.contact_table import contact_table
from signorini_fx.mechanics.model import Model
from signorini_fx.records import Finding
from signorini_fx.tuned import FACETS_OFF, NO_CURVED_SIDE

_Floats = npt.NDArray[np.float64]


def facets_in_result(body: Model, contact: ContactState) -> list[Finding]:
    """Contacts of two bodies whose pressure is that of the distances between the chords of their curved sides.

    The slopes of both sides differ by the angles between facets; slope times modulus is a pressure.

    Args:
        body: the model.
        contact: its contact points in a result; collective.
    """
    from signorini_fx.results.accuracy.pressure_error import polygon_error

    table = contact_table(contact, *body.statement.sides)
    assert table.nodes is not None
    assert body.data is not None
    findings = []
    for index, effect in enumerate(body.statement.contact):
        if effect.against is None or effect.distance != "geometry" or effect.kind == "bonded":
            continue
        pressure = np.where(table.nodes[:, 0] == index, table.columns["pressure"], 0.0)
        own = replace(table, columns={**table.columns, "pressure": pressure})
        if polygon_error(own, body.scales.modulus) < 1:
            continue
        names, on_part = (effect.boundary, effect.against), contact.boundary.part == index
        off = sum(_off(body, name, contact.boundary.x[on_part]) for name in names)
        gap = body.data.gap[on_part]
        gap = gap + parallel.largest(body.comm, -gap, -np.inf)
        if parallel.largest(body.comm, gap[gap <= off]) > FACETS_OFF * off > 0:  # else the nodes of both sides match
            text = (
                f"straight facets of {names[0]!r} and {names[1]!r} are up to {off:.2g} off the curved sides that they "
                "are chords of, and the distances between them change the pressure as much as the loads do: take "
                'smaller facets, curved cells, or distance = "nominal"'
            )
            findings.append(Finding("warning", f"contact[{index}].distance", text))
    return findings


def _off(body: Model, name: str, near: _Floats) -> float:
    """How far facets near the contact are off the curved side that they are chords of, at most, length.

    Args:
        body: the model.
        name: of the side.
        near: points, shape (n, d), beside which its facets may be in contact.
    """
    mesh, facets = body.tagged.mesh, body.tagged.facets(name)
    corners, cells = facet_vertices(mesh, facets), facet_entities(mesh, facets)[:, 0]
    extent = np.linalg.norm(np.ptp(corners, axis=1), axis=1)
    off = 0.0
    if compat.geometry_degree(mesh) == 1 and len(facets) and len(near):
        inside = dmesh.compute_midpoints(mesh, mesh.topology.dim, cells)
        away, _ = cKDTree(near).query(corners.mean(axis=1)[:, : near.shape[1]])
        off = _sagitta(corners, extent, inside, body.tagged.dimension, away <= extent)
    return parallel.global_max(body.comm, off)


def _sagitta(
    corners: _Floats, extent: _Floats, inside: _Floats, dimension: int, selected: npt.NDArray[np.bool_]
) -> float:
    """How far the middle of a facet is off an arc through its corners, at most: a facet that is the chord of an arc
    meets its neighbours at the angle that it spans.

    Args:
        corners: of the facets, length, shape (f, k, 3).
        extent: of each facet, length, shape (f,).
        inside: a point of the cell behind each, shape (f, 3).
        dimension: of the body.
        selected: the facets that matter, shape (f,).
    """
    along = corners[:, 1] - corners[:, 0]
    normal = np.stack((along[:, 1], -along[:, 0], 0 * along[:, 0]), axis=1)
    if dimension == 3:
        normal = np.asarray(np.cross(along, corners[:, 2] - corners[:, 0]))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    normal *= np.sign(np.einsum("fi,fi->f", normal, corners.mean(axis=1) - inside))[:, None]
    _, vertices = np.unique(np.round(corners.reshape(-1, 3) / extent.max(), 6), axis=0, return_inverse=True)
    vertices = vertices.reshape(corners.shape[:2])
    means: _Floats = np.zeros((vertices.max() + 1, 3))
    np.add.at(means, vertices, normal[:, None])
    means /= np.linalg.norm(means, axis=1, keepdims=True)
    # Half of the angle between neighbours.
    half = np.arccos(np.clip(np.einsum("fi,fki->fk", normal, means[vertices]), -1.0, 1.0))
    smooth = np.where(half < NO_CURVED_SIDE / 2, half, 0.0).max(axis=1)
    return float((extent * smooth)[selected].max(initial=0.0)) / 4
