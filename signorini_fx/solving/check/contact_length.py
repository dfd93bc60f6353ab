"""How long the facets of a contact must be: an eighth of the half width that Hertz's theory expects, an estimate.

K. L. Johnson, Contact Mechanics (1985), sections 4.1 and 4.2: of a line contact a = sqrt(4 P R / (pi E*)) for the force
P per length, of a point contact a = (3 P R / (4 E*))^(1/3), with 1 / E* the sum of 1 / E' of both bodies and 1 / R that
of their curvatures.  The load is what acts along the normal where the distance is least, or else the prescribed
displacement along it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.assembly.mesh_entities import facet_entities, facet_vertices
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.obstacles.carrying_side import SideFigures
from signorini_fx.records import Finding
from signorini_fx.tuned import (
    COARSE_IN_CONTACT,
    CONTACT_FACETS,
    FITTED_FACETS,
    FITTED_NODES,
    FLAT_CONTACT,
    LINE_CONTACT,
    NO_FORCE,
)

_Floats = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Touching:
    """Where a contact begins, and the shape of both sides there.

    Attributes:
        x: the point, shape (d,).
        normal: of the body there, outward, shape (d,).
        gap: there, length.
        curvature: by which both sides part: the curvatures of both together, at most d - 1, the largest first, 1 /
            length; those of flat sides are left out.
        extent: of the boundary along the direction of the last of them, and where there is one direction without a
            curvature, along that, length.
        share: of the surroundings of the point that the model has: a half on a plane of symmetry.
        facet: length of the facets there.
    """

    x: _Floats
    normal: _Floats
    gap: float
    curvature: _Floats
    extent: float
    share: float
    facet: float


@dataclass(frozen=True)
class _Surface:
    """Facets of a boundary on the first rank: middles and outward normals, shapes (f, d), and lengths, shape (f,)."""

    middles: _Floats
    normals: _Floats
    lengths: _Floats

    @classmethod
    def of(cls, body: Model, name: str) -> _Surface:
        """Those of a boundary; collective."""
        mesh, dim = body.tagged.mesh, body.tagged.dimension
        facets = body.tagged.facets(name)
        corners, cells = facet_vertices(mesh, facets)[:, :, :dim], facet_entities(mesh, facets)[:, 0]
        along = corners[:, 1] - corners[:, 0]
        if dim == 2:
            normals = np.stack((along[:, 1], -along[:, 0]), axis=1)
        else:
            normals = np.asarray(np.cross(along, corners[:, 2] - corners[:, 0]), dtype=np.float64)
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        nodes = compat.geometry_cells(mesh)[cells] if len(cells) else np.empty((0, 1), dtype=np.int32)
        inside = mesh.geometry.x[nodes].mean(axis=1)[:, :dim]
        middles = corners.mean(axis=1)
        normals *= np.sign(np.einsum("fi,fi->f", normals, middles - inside))[:, None]
        lengths = np.linalg.norm(np.ptp(corners, axis=1), axis=1)
        rows = parallel.rows_on_root(mesh.comm, np.column_stack((middles, normals, lengths)))
        return cls(rows[:, :dim], rows[:, dim : 2 * dim], rows[:, -1])

    def near(self, x: _Floats) -> npt.NDArray[np.int64]:
        """The facets nearest to a point."""
        count = FITTED_FACETS[len(x)]
        return np.argsort(np.linalg.norm(self.middles - x, axis=1), kind="stable")[:count]

    def curvature(self, x: _Floats, frame: _Floats) -> _Floats:
        """How the normal turns around a point, in a tangential frame, shape (d, d - 1) -> (d - 1, d - 1)."""
        near = self.near(x)
        s, turned = (self.middles[near] - x) @ frame, self.normals[near] @ frame
        matrix = np.column_stack((np.ones(len(near)), s))
        slopes = np.linalg.lstsq(matrix, turned, rcond=None)[0][1:]
        return np.asarray((slopes + slopes.T) / 2)


def contact_lengths(body: Model) -> list[Finding]:
    """About each contact whose facets are longer than Hertz's pressure needs; collective.

    There is none where sides fit each other, where a material is not isotropic, and of contact that cannot open.
    """
    in_section = body.tagged.mesh.geometry.dim == body.tagged.dimension  # no torsion
    if body.boundary is None or body.data is None or body.elastic.stiffness is not None or not in_section:
        return []
    findings = []
    for index, effect in enumerate(body.statement.contact):
        if not effect.opens or (effect.foundation is not None and not isinstance(effect.gap, int | float)):
            continue
        touching = _touching(body, index)
        if touching is None:
            continue
        names = [name for name in (effect.boundary, effect.against) if name is not None]
        modulus = 1 / sum(1 / _plane_modulus(body, name) for name in names)
        pieces = [_piece(body, name) for name in names]
        estimate = _half_width(body, touching, modulus, pieces)
        if estimate is None:
            continue
        width, words = estimate
        size = float(f"{width / CONTACT_FACETS:.2g}")
        if touching.facet > COARSE_IN_CONTACT * size:
            radius = 1 / touching.curvature[0]
            findings.append(
                Finding(
                    "note",
                    f"contact[{index}].contact_size",
                    f"contact_size = {size:g} would give Hertz's half width {CONTACT_FACETS} facets: it is about "
                    f"{width:.2g}, estimated from a radius of {radius:.3g} and {words}; facets there have "
                    f"{touching.facet:.2g} now",
                )
            )
    return findings


def _plane_modulus(body: Model, name: str) -> float:
    """E' behind a boundary, stress: E / (1 - nu^2), in plane stress E."""
    first, second = (SideFigures.of(name, body.tagged, part).stiffness for part in body.elastic.lame)
    return 4 * second * (first + second) / (first + 2 * second)


def _touching(body: Model, index: int) -> Touching | None:
    """Where one contact begins; None where the sides do not part from there as round ones do; collective."""
    boundary, data, dim = body.boundary, body.data, body.tagged.dimension
    assert boundary is not None
    assert data is not None
    on_part = boundary.part == index
    rows = np.column_stack((boundary.x[on_part], boundary.normal[on_part], data.gap[on_part]))
    nodes = parallel.rows_on_root(body.comm, rows)
    effect = body.statement.contact[index]
    surfaces = [_Surface.of(body, name) for name in (effect.boundary, effect.against) if name is not None]

    def shape() -> Touching | None:
        return _shape(nodes, surfaces, dim) if len(nodes) > dim + 1 else None

    return parallel.on_root(body.comm, shape)


def _shape(nodes: _Floats, surfaces: list[_Surface], dim: int) -> Touching | None:
    """The same from positions, normals and gaps of the contact points, shape (n, 2 d + 1)."""
    x, normals, gaps = nodes[:, :dim], nodes[:, dim : 2 * dim], nodes[:, -1]
    size = float(np.linalg.norm(np.ptp(x, axis=0)))
    closest = np.flatnonzero(gaps <= gaps.min() + FLAT_CONTACT * size)
    # Of many points that are equally near, as along a line, the one in their middle.
    point = closest[np.argmin(np.linalg.norm(x[closest] - x[closest].mean(axis=0), axis=1))]
    normal = normals[point] / np.linalg.norm(normals[point])
    frame = np.linalg.svd(normal[None])[2][1:].T
    if len(surfaces) == 2:
        turning = sum(surface.curvature(x[point], frame) for surface in surfaces)
    else:
        turning = _parting(x, gaps, x[point], frame)
    values, directions = np.linalg.eigh(turning)
    values, directions = values[::-1], directions[:, ::-1]
    if values[0] * size < FLAT_CONTACT:
        return None
    kept = values[values > LINE_CONTACT * values[0]]
    side = surfaces[0]
    extent = float(np.ptp(side.middles @ (frame @ directions[:, -1])) + side.lengths.mean())
    near = side.near(x[point])
    share, facet = _share(side.middles[near] - x[point], frame), float(np.median(side.lengths[near[: len(near) // 2]]))
    return Touching(x[point], normal, float(gaps[point]), kept, extent, share, facet)


def _parting(x: _Floats, gaps: _Floats, point: _Floats, frame: _Floats) -> _Floats:
    """Second derivatives of the gap to a foundation around a point, in a tangential frame, shape (d - 1, d - 1)."""
    dim = len(point)
    near = np.argsort(np.linalg.norm(x - point, axis=1), kind="stable")[: FITTED_NODES[dim]]
    s = (x[near] - point) @ frame
    squares = [s[:, 0] ** 2 / 2] if dim == 2 else [s[:, 0] ** 2 / 2, s[:, 0] * s[:, 1], s[:, 1] ** 2 / 2]
    second = np.linalg.lstsq(np.column_stack((np.ones(len(near)), s, *squares)), gaps[near], rcond=None)[0][dim:]
    rows = [second[:1]] if dim == 2 else [second[:2], second[1:]]
    return np.array(rows, dtype=np.float64)


def _share(away: _Floats, frame: _Floats) -> float:
    """Which share of the surroundings of a point some positions around it fill: 1, 1/2 or 1/4."""
    s = away @ frame
    if s.shape[1] == 1:
        low, high = float(-s.min()), float(s.max())
        return 1.0 if min(low, high) > max(low, high) / 4 else 0.5
    angles = np.arctan2(s[:, 1], s[:, 0])
    eighths = len(np.unique(np.floor(angles / (np.pi / 4))))
    return 1.0 if eighths > 6 else 0.5 if eighths > 3 else 0.25


def _half_width(body: Model, touching: Touching, modulus: float, pieces: list[int]) -> tuple[float, str] | None:
    """Hertz's half width, length, and the load that it is for, in words; None without a load; collective.

    Args:
        body: the model.
        touching: where the contact begins.
        modulus: E* of both sides, stress.
        pieces: of the body, that touch.
    """
    dim = body.tagged.dimension
    force = max(_force(body, touching.normal, step, pieces) for step in range(body.statement.steps)) / touching.share
    kinematics = body.kinematics
    curvature, size = touching.curvature, body.tagged.size
    ring = None if kinematics.uniform else kinematics.measure_at(touching.x)
    on_axis = ring is not None and float(ring) < FLAT_CONTACT * size
    if on_axis:
        force *= touching.share  # a revolution is whole
    pointed = on_axis or len(curvature) == 2
    mean = math.sqrt(curvature[0] * curvature[-1])
    length = 1.0 if dim == 2 else touching.extent
    if ring is not None and not on_axis:
        force, length = force * touching.share, float(ring)
    line = math.sqrt(4 * force / length / curvature[0] / (math.pi * modulus))
    if force > NO_FORCE * modulus * size ** (dim - 1):
        width = line
        if pointed:
            circle = (3 * force / mean / (4 * modulus)) ** (1 / 3)
            width = circle * (curvature[-1] / curvature[0]) ** (1 / 3)
            width = width if dim == 2 or circle**2 / width < touching.extent / 2 else line
        return min(width, touching.extent), f"a force of {force:.3g}"
    depth = _approach(body, touching.normal) - max(touching.gap, 0.0)
    if not depth > NO_FORCE * size:
        return None
    width = math.sqrt(depth / curvature[0])
    if not pointed:  # the depth of a line contact depends on the size of the body: Johnson, section 5.6
        for _ in range(50):
            reach = 4 * min(1 / curvature[0], size) / width
            width = math.sqrt(4 * depth / curvature[0] / max(2 * math.log(reach) - 1, 1.0))
    return min(width, touching.extent), f"a displacement of {depth:.3g} after it touches"


def _piece(body: Model, name: str) -> int:
    """The piece of the body that a boundary is of; collective."""
    cells = facet_entities(body.tagged.mesh, body.tagged.facets(name))[:, 0]
    pieces = body.motions.pieces.of_cell[cells]
    return int(parallel.largest(body.comm, pieces.astype(np.float64), -1.0))


def _force(body: Model, normal: _Floats, step: int, pieces: list[int]) -> float:
    """What loads press along a direction in a load step, or against it, whichever is more; collective.

    Of two pieces the one with the smaller load counts, if it has any: the other one may be held.
    """
    dim = body.tagged.dimension
    forces = [factor * load.forces for factor, load in body.applied_at(step) if not load.balanced]
    along = np.reshape(sum(forces, np.zeros(body.fixed.size)), (-1, dim)) @ normal
    of_cell, layout = body.motions.pieces.of_cell, body.space.dofmap.list
    totals = []
    for piece in pieces:
        members = np.unique(layout[: len(of_cell)][of_cell == piece])
        values = along[members[members < len(along)]]
        totals.append([values[values > 0].sum(), -values[values < 0].sum()])
    most = parallel.global_sum(body.comm, np.array(totals)).max(axis=1)
    pressed = most[most > NO_FORCE * most.max()] if most.max() > 0 else most
    return float(pressed.min())


def _approach(body: Model, normal: _Floats) -> float:
    """How far prescribed displacements move along a direction, length, at most; collective."""
    dim, most = body.tagged.dimension, 0.0
    for step in range(body.statement.steps):
        starts = [factor * load.start for factor, load in body.applied_at(step)]
        along = np.reshape(sum(starts, np.zeros(body.fixed.size)), (-1, dim)) @ normal
        most = max(most, parallel.largest(body.comm, np.abs(along)))
    return most
