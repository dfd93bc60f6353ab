"""Bounds of the work of tractions on faces of tetrahedra that are orthogonal to linear vectors there.

Such a traction r on a face F of K does no work on rigid motions of K, and its work on a displacement v is at most the
norm of a *lifting*, a symmetric stress in K without divergence, with the traction r on F and none on the other faces,
times the energy norm of v in K.  F is divided into m^2 triangles that are similar to it, every other one turned, and

    r = (Pi r) + (r - Pi r),

Pi the projection onto functions that are linear on each of them.  The first part is lifted by stresses of Johnson and
Mercier in K divided into m^3 tetrahedra.  The second one is orthogonal to linear vectors on each triangle; it is lifted
in the same way in tetrahedra of which these are faces, with apexes so that they do not meet: for a triangle like F one
like K, for a turned one one like K', the tetrahedron of F turned by half a turn about its centroid c with the apex of K
(its corners are 2 c - p_i).  Those of K' are like K' and, for turned ones, like K.  So the largest norms per |r|, c_K
and c_K', are at most those of Pi r, C_K and C_K', and q = 1 / sqrt(m) times one of both, and as both parts are
orthogonal

    max(c_K, c_K')^2 <= max(C_K, C_K')^2 + q^2 max(c_K, c_K')^2.

They are finite by Korn's inequality.  docs/bounds.md has the proof.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import permutations, product

import numpy as np

from signorini_fx.addons.bounds.arrays import Array, Ints
from signorini_fx.addons.bounds.johnson_mercier import LocalStress
from signorini_fx.addons.bounds.korn import REGULAR
from signorini_fx.addons.bounds.simplices import TWICE, Moduli, Simplices
from signorini_fx.tuned import ROUNDED_FORMS

# Tetrahedra whose systems are solved at the same time.
_CHUNK = 16
_EPS = float(np.finfo(float).eps)


@dataclass(frozen=True)
class DividedFace:
    """A triangle divided into m^2, and a tetrahedron on it into m^3.

    Attributes:
        parts: barycentric coordinates of the vertices of its parts, in the order of those of the triangle that they are
            similar to, shape (m^2, 3, 3).
        turned: which of them are turned by half a turn, shape (m^2,).
        mean: from values at the vertices of the parts to those of the closest linear function, shape (3, 3 m^2).
        x: barycentric coordinates of vertices in the tetrahedron, shape (v, 4); those of the triangle are first.
        corners: of its parts, shape (m^3, 4).
    """

    parts: Array
    turned: Ints
    mean: Array
    x: Array
    corners: Ints

    @property
    def times(self) -> int:
        """M."""
        return round(len(self.parts) ** 0.5)


@cache
def divided_face(m: int) -> DividedFace:
    """Into so many parts along each edge."""
    places = [np.array(place) for place in product(range(m + 2), repeat=3)]
    straight = [place + np.eye(3) for place in places if place.sum() == m - 1]
    turned = [place - np.eye(3) for place in places if place.sum() == m + 1 and place.min() > 0]
    parts = np.array(straight + turned) / m
    # Integrals of hat functions of the parts times those of the triangle, over its area.
    mass = (np.ones((3, 3)) + np.eye(3)) / 12
    moments = np.einsum("pia,ij->apj", parts, mass).reshape(3, -1) / m**2
    numbers, corners = dict[tuple[int, ...], int](), []
    for cube in product(range(m), repeat=3):
        for order in permutations(range(3)):
            path = np.cumsum([np.array(cube), *np.eye(3, dtype=np.int64)[list(order)]], axis=0)
            first, second, third = path.mean(axis=0)
            if first > second > third:
                corners.append([numbers.setdefault(tuple(point.tolist()), len(numbers)) for point in path])
    at = np.array(list(numbers))
    x = np.column_stack((m - at[:, 0], at[:, 0] - at[:, 1], at[:, 1] - at[:, 2], at[:, 2])) / m
    kind = np.array([0] * len(straight) + [1] * len(turned), dtype=np.int64)
    return DividedFace(parts, kind, np.linalg.solve(mass, moments), x, np.array(corners))


def finest(face: DividedFace, levels: int) -> Array:
    """Barycentric coordinates of the vertices of the parts of parts, those of each one together, (m^2 ..., 3, 3)."""
    parts: Array = np.eye(3)[None]
    for _ in range(levels):
        parts = (face.parts @ parts[:, None]).reshape(-1, 3, 3)
    return parts


@dataclass(frozen=True)
class Liftings:
    """Of tractions on a face of each of n tetrahedra.

    Attributes:
        face: how faces are divided.
        forms: squares of the norms of liftings in K and in K' of tractions that are linear on the parts, from values at
            their vertices, shape (n, 2, 9 m^2, 9 m^2).
        constant: a bound of c_K and c_K', shape (n,).
    """

    face: DividedFace
    forms: Array
    constant: Array

    @classmethod
    def of(cls, corners: Array, moduli: Moduli, m: int) -> Liftings:
        """Of tetrahedra.

        Args:
            corners: length, that opposite the face last, shape (n, 4, 3).
            moduli: of them.
            m: parts along each edge.
        """
        face, n = divided_face(m), len(corners)
        turned = corners.copy()
        turned[:, :3] = 2 * corners[:, :3].mean(axis=1, keepdims=True) - corners[:, :3]
        pairs = np.stack((corners, turned), axis=1).reshape(-1, 4, 3)
        owner = np.repeat(np.arange(n), 2)
        forms = [
            _forms(face, pairs[first : first + _CHUNK], moduli.of(owner[first : first + _CHUNK]))
            for first in range(0, 2 * n, _CHUNK)
        ]
        form = np.concatenate(forms)
        form += (rounded(pairs, moduli.of(owner)) * np.linalg.norm(form, 2, axis=(1, 2)))[:, None, None] * np.eye(
            9 * m * m
        )
        area = np.linalg.norm(np.cross(pairs[:, 1] - pairs[:, 0], pairs[:, 2] - pairs[:, 0]), axis=1) / 2
        # Orthonormal functions on the face of area 1 that are orthogonal to linear ones.
        root = np.kron(np.eye(m * m), np.linalg.cholesky((np.ones((3, 3)) + np.eye(3)) / (12 * m * m)).T)
        linear = np.linalg.qr(root @ face.parts.reshape(-1, 3), mode="complete")[0][:, 3:]
        free = np.kron(np.linalg.solve(root, linear), np.eye(3))
        largest = np.linalg.eigvalsh(free.T @ form @ free)[:, -1] / area
        constant = np.sqrt(largest.reshape(n, 2).max(axis=1) / (1 - 1 / m))
        return cls(face, form.reshape(n, 2, *form.shape[1:]), constant)

    def norms(self, values: Array, missed: Array) -> Array:
        """Bounds of the norms of liftings, shape (n,).

        Args:
            values: the projections of the tractions after some divisions, at the vertices of the ``finest`` parts,
                shape (n, m^2 ..., 3, 3).
            missed: integrals of the squares of what they are not, shape (n,).
        """
        face, n, m = self.face, len(self.constant), self.face.times
        levels = round(np.log(values.shape[1]) / np.log(m * m))
        kinds: list[Ints] = [np.zeros(1, dtype=np.int64)]
        for _ in range(levels):
            kinds.append((kinds[-1][:, None] ^ face.turned).ravel())
        total = self.constant * np.sqrt(missed / m**levels)
        for level in reversed(range(levels)):
            parts = values.reshape(n, -1, 3 * m * m, 3)
            values = np.einsum("ak,njkd->njad", face.mean, parts)
            difference = (parts - face.parts.reshape(-1, 3) @ values).reshape(n, len(kinds[level]), -1)
            squares = np.zeros(n)
            for kind in (0, 1):
                selected = difference[:, kinds[level] == kind]
                squares += np.einsum("njk,nkl,njl->n", selected, self.forms[:, kind], selected, optimize=True)
            total = total + np.sqrt(squares.clip(min=0.0) / m ** (3 * level))
        return total


def rounded(corners: Array, moduli: Moduli) -> Array:
    """Round-off of forms as a share of their norm, see ``ROUNDED_FORMS``, shape (n,)."""
    edges = (corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1) @ np.linalg.inv((REGULAR[1:] - REGULAR[0]).T)
    root = np.sqrt(TWICE[3])
    stiffness = moduli.stress(np.tile(np.eye(6), (len(corners), 1, 1))).transpose(0, 2, 1) * root[:, None] / root
    sizes = np.linalg.eigvalsh(stiffness)
    return np.asarray(ROUNDED_FORMS * _EPS * sizes[:, -1] / sizes[:, 0] * np.linalg.cond(edges) ** 4)


def _forms(face: DividedFace, corners: Array, moduli: Moduli) -> Array:
    """See ``Liftings.forms``: of some tetrahedra, shape (n, 9 m^2, 9 m^2)."""
    n, m, vertices, cells = len(corners), face.times, len(face.x), len(face.corners)
    x = face.x @ corners
    at_corners = x[:, face.corners]
    negative = np.linalg.det(at_corners[:, :, 1:] - at_corners[:, :, :1]) < 0
    ordered = np.where(negative[:, :, None], face.corners[:, [0, 1, 3, 2]], face.corners)
    numbers = (ordered + vertices * np.arange(n)[:, None, None]).reshape(-1, 4)
    t = Simplices(x.reshape(-1, 3), numbers, moduli.of(np.repeat(np.arange(n), cells)))
    local = LocalStress(t)
    count = len(t.facets) // n  # those of each tetrahedron together, in the same order
    places = (3 * local.places[..., None] + np.arange(3)).reshape(n, cells, 36) - 9 * count * np.arange(n)[
        :, None, None
    ]
    system = np.zeros((n, 9 * count, 9 * count))
    for k in range(n):
        np.add.at(
            system[k], (places[k, :, :, None], places[k, :, None, :]), local.compliance[k * cells : (k + 1) * cells]
        )
    facets = t.facets[:count]
    keys = t.keys(facets)
    places_of_vertices = np.rint(m * face.x)
    moments = np.zeros((9 * count, 9 * m * m))
    mass = (np.ones((3, 3)) + np.eye(3)) / 12 / (m * m)
    for part, corners_of_part in enumerate(np.rint(m * face.parts)):
        vertex = (places_of_vertices[:, :3] == corners_of_part[:, None]).all(axis=2).argmax(axis=1)
        facet, order = int(np.searchsorted(keys, t.keys(np.sort(vertex)))), np.argsort(np.argsort(vertex))
        rows = (9 * facet + 3 * order[:, None] + np.arange(3)).ravel()
        moments[rows, 9 * part : 9 * part + 9] = np.kron(mass, np.eye(3))
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    away = x[:, facets].reshape(n, -1, 3) - x.mean(axis=1)[:, None]
    rigid = np.zeros((n, 3 * count, 3, 6))
    rigid[:, :, range(3), range(3)] = 1.0
    for k, (i, j) in enumerate(((0, 1), (0, 2), (1, 2)), start=3):
        rigid[:, :, i, k], rigid[:, :, j, k] = -away[..., j], away[..., i]
    modes = np.linalg.qr(rigid.reshape(n, -1, 6))[0]
    scale = np.einsum("nii->n", system) / (9 * count)
    full = system + scale[:, None, None] * (modes @ modes.transpose(0, 2, 1))
    solved = np.linalg.solve(full, np.broadcast_to(moments, (n, *moments.shape)))
    forms = moments.T @ solved * (area**2)[:, None, None]
    return np.asarray(forms + forms.transpose(0, 2, 1)) / 2
