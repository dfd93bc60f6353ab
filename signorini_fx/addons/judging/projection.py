"""The closest points of a surface of facets, and the signed distance from it."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.spatial import cKDTree

from signorini_fx.addons.judging.problem_data import JudgedMesh, facet_points
from signorini_fx.addons.judging.reference_elements import ReferenceElement
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints
from signorini_fx.tuned import JUDGED_BESIDE

# Samples of each facet along an axis, facets that are tried for a point, and steps of Gauss and Newton.
_SAMPLES, _NEAREST, _STEPS = 5, 4, 8


@dataclass(frozen=True)
class ClosestPoints:
    """Of each of some points the closest one of a surface.

    Attributes:
        facet: that it is on, shape (n,).
        shape: functions of the nodes of the facet there, shape (n, l).
        distance: signed, positive outside, length; infinite where no facet is opposite, shape (n,).
        normal: outward there, shape (n, d).
    """

    facet: Ints
    shape: Floats
    distance: Floats
    normal: Floats

    def values(self, facets: Ints, nodal: Floats) -> Floats:
        """A field of the nodes there, shape (n, d)."""
        return np.einsum("nk,nkd->nd", self.shape, nodal[facets[self.facet]])


def closest_points(mesh: JudgedMesh, facets: Ints, nodal: Floats, x: Floats) -> ClosestPoints:
    """Project points onto facets.

    Args:
        mesh: the mesh.
        facets: nodes, shape (f, l).
        nodal: where all nodes are, length, shape (n, d).
        x: points, length, shape (p, d).
    """
    element = mesh.facet
    samples: Floats = np.array(list(product(np.linspace(0, 1, _SAMPLES), repeat=element.dim)))
    if element.simplex:
        samples = samples[samples.sum(axis=1) <= 1]
    at = np.einsum("qk,fkd->fqd", element.shape(samples), nodal[facets])
    count = min(_NEAREST * 2, at.shape[0] * at.shape[1])
    _, near = cKDTree(at.reshape(-1, mesh.dim)).query(x, k=count)
    near = near.reshape(len(x), count)
    candidates, starts = near // len(samples), samples[near % len(samples)]
    reference, away = _closest(element, nodal[facets[candidates]], x, starts)
    best = np.argmin(away, axis=1)
    rows = np.arange(len(x))
    facet, reference = candidates[rows, best], reference[rows, best]
    shape = element.shape(reference)
    corners = nodal[facets[facet]]
    foot = np.einsum("nk,nkd->nd", shape, corners)
    tangents = _tangents(element, corners, reference)
    normal = _normal(tangents) * outward_signs(mesh, facets)[facet][:, None]
    distance = np.einsum("nd,nd->n", x - foot, normal)
    beside = np.linalg.norm(x - foot - distance[:, None] * normal, axis=1)
    length = np.linalg.norm(np.ptp(corners, axis=1), axis=1)
    distance = np.where(beside > JUDGED_BESIDE * length + np.abs(distance), np.inf, distance)
    return ClosestPoints(facet, shape, distance, normal)


def _closest(element: ReferenceElement, corners: Floats, x: Floats, start: Floats) -> tuple[Floats, Floats]:
    """Places on several facets for each point, and how far they are, shapes (p, m, dim) and (p, m)."""
    p, m = start.shape[:2]
    nodes = corners.reshape(p * m, *corners.shape[2:])
    reference: Floats = start.reshape(p * m, element.dim)
    target = np.repeat(x, m, axis=0)
    for _ in range(_STEPS):
        residual = target - np.einsum("nk,nkd->nd", element.shape(reference), nodes)
        tangents = _tangents(element, nodes, reference)
        gram = np.einsum("ndi,ndj->nij", tangents, tangents)
        step = np.linalg.solve(gram, np.einsum("ndi,nd->ni", tangents, residual)[..., None])[..., 0]
        reference = np.clip(reference + step, 0.0, 1.0)
        if element.simplex:
            excess = np.maximum(reference.sum(axis=1) - 1, 0.0)
            reference = np.clip(reference - excess[:, None] / element.dim, 0.0, 1.0)
    away = np.linalg.norm(target - np.einsum("nk,nkd->nd", element.shape(reference), nodes), axis=1)
    return reference.reshape(p, m, element.dim), away.reshape(p, m)


def _tangents(element: ReferenceElement, nodes: Floats, reference: Floats) -> Floats:
    return np.einsum("nkj,nkd->ndj", element.gradient(reference), nodes)


def _normal(tangents: Floats) -> Floats:
    """Unit normals, shape (n, d)."""
    if tangents.shape[1] == 2:
        normal: Floats = np.column_stack((tangents[:, 1, 0], -tangents[:, 0, 0]))
    else:
        normal = np.asarray(np.cross(tangents[..., 0], tangents[..., 1]), dtype=np.float64)
    return np.asarray(normal / np.linalg.norm(normal, axis=1)[:, None])


def outward_signs(mesh: JudgedMesh, facets: Ints) -> Floats:
    """1 where the normal by the order of the nodes leads out of the body, else -1, shape (f,)."""
    middle = np.full((len(facets), mesh.facet.dim), 1 / (mesh.dim if mesh.facet.simplex else 2))
    plain = _normal(_tangents(mesh.facet, mesh.points[facets], middle))
    outward = facet_points(mesh, facets, 1, revolved=False).normal[:, 0]
    return np.sign(np.einsum("fd,fd->f", plain, outward))


def rotated_by(mesh: JudgedMesh, facets: Ints, v: Floats) -> Floats:
    """By how much the normal of each facet turns, radians, shape (f,)."""
    middle = np.full((len(facets), mesh.facet.dim), 1 / (mesh.dim if mesh.facet.simplex else 2))
    undeformed = _normal(_tangents(mesh.facet, mesh.points[facets], middle))
    deformed = _normal(_tangents(mesh.facet, (mesh.points + v)[facets], middle))
    return np.asarray(np.linalg.norm(deformed - undeformed, axis=1))
