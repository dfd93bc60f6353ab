"""Constants of Korn's inequality and of traces on triangles, and of what is beside linear functions on tetrahedra.

Of a displacement w of a tetrahedron K what is left on a face F, and in K, beside linear functions is bounded by the
strain alone:

    min over linear p of |w - p| in L2(F) or L2(K)  <=  c |eps(w)| in L2(K).

``lifted_tractions`` proves that c is at most ``BESIDE_LINEAR`` on a face of the regular tetrahedron with edges of
length 1.  In the tetrahedra of ``HILL`` c is at most the number there.  They have the corners 0, a, a + b, a + b + c,
where a, b and c have the length 1 and equal angles (M. J. M. Hill, Proc. London Math. Soc. 27 (1896) 39-53): parallels
to their faces divide them in m^3 that are like them.  A force r that is orthogonal to linear vectors in K is the sum of
P r, its projection onto functions that are linear on each part, and of r - P r, which is orthogonal to these there:
with the largest norm C of stresses that are in equilibrium with P r alone, c^2 <= C^2 + (c / m)^2, so that
c^2 <= C^2 / (1 - 1 / m^2).

On others w(A xi + b) = A^-T v(xi) has the strain A^-T eps(v) A^-1, and linear functions stay linear.
"""

from __future__ import annotations

from itertools import permutations, product

import numpy as np

from signorini_fx.addons.bounds.arrays import Array, Ints
from signorini_fx.addons.bounds.simplices import Simplices

# Vertices of a regular tetrahedron with edges of length 1, and a bound of its c, which
# tests/bounds/test_lifted_tractions.py computes.
REGULAR: Array = np.array(
    [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.5, 0.75**0.5, 0.0], [0.5, 0.75**0.5 / 3, (2 / 3) ** 0.5]]
)
BESIDE_LINEAR = 1.68


def hill(cosine: float) -> Array:
    """The corners of a tetrahedron on a path of three vectors of length 1 with these cosines between them, (4, 3)."""
    steps = np.linalg.cholesky(np.full((3, 3), cosine) + (1 - cosine) * np.eye(3))
    return np.concatenate((np.zeros((1, 3)), np.cumsum(steps, axis=0)))


# The cosines of two of them and bounds of their c, which tests/bounds/test_lifted_forces.py computes: six of the first
# make a cube, the second is the nearest one to the regular tetrahedron.
HILL = ((0.0, 0.82), (-1 / 3, 0.44))


def korn(t: Simplices) -> tuple[Array, Array]:
    """Constants of |w - r| <= c |eps(w)| in L2 of a triangle and k of |grad (w - r)| <= k |eps(w)|, shape (n,).

    r is the rigid motion with the mean of w and of its rotation.  The first one is k h / pi by Payne and
    Weinberger; k^2 = 1 + 2 / beta^2 with the inf-sup constant beta >= rho / (2 R) of M. Costabel and M. Dauge
    (Arch. Rational Mech. Anal. 217 (2015) 873-898), rho the radius of the incircle, R the distance of its centre
    from the farthest corner.
    """
    p, sides = t.x[t.corners], t.area[t.facets_of]
    centre = np.einsum("ni,nid->nd", sides, p) / sides.sum(axis=1)[:, None]
    inner = 2 * t.volume / sides.sum(axis=1)
    outer = np.linalg.norm(p - centre[:, None], axis=2).max(axis=1)
    k = np.sqrt(1 + 8 * (outer / inner) ** 2)
    return k * sides.max(axis=1) / np.pi, k


def on_edges(t: Simplices, inside: Array, gradient: Array) -> Array:
    """Bounds of |w| in L2 of the edges of each triangle, from those of |w| and |grad w| in it, shape (n, 3).

    |w|^2 on an edge e of a triangle K is at most |e| / |K| (|w|^2 + h |w| |grad w|), with its longest side h.
    """
    sides = t.area[t.facets_of]
    squares = inside**2 + sides.max(axis=1) * inside * gradient
    return np.asarray(np.sqrt(sides * (squares / t.volume)[:, None]))


def missed_squares(t: Simplices, inside: Array, on_facets: Array) -> Array:
    """Squares of the bounds of the work of loads without resultants per unit of the energy norm, by triangle, (n,).

    Args:
        t: the triangles.
        inside: integrals of the squares of the loads in them, shape (n,).
        on_facets: on the edges of the boundary, shape (f,).
    """
    constants = korn(t)
    edges = np.sqrt(on_facets)[t.facets_of]
    bounds = constants[0] * np.sqrt(inside) + (on_edges(t, *constants) * edges).sum(axis=1)
    return np.asarray(bounds**2 / t.moduli.softest)


def work_beside_linear(t: Simplices, faces: Ints, squares: Array) -> Array:
    """Bounds of the work of tractions r that are orthogonal to linear vectors on faces, per unit of the norm of the
    strain in the tetrahedra at these, shape (m,).

    The work is that of A^-1 r on v, so that it is at most c sqrt(|F| |K'| / (|F'| |K|)) |A^-1 r| |A|^2 |eps(w)|, with
    the regular tetrahedron K' and its face F'.  The best of the six orders of the vertices of the face is taken.

    Args:
        t: the tetrahedra.
        faces: of the boundary, shape (m,).
        squares: integrals of the products of the components of r, shape (m, 3, 3).
    """
    cell = t.sides[faces, 0]
    apex = np.take_along_axis(t.corners[cell], (t.facets_of[cell] == faces[:, None]).argmax(axis=1)[:, None], axis=1)
    edges = np.linalg.inv((REGULAR[1:] - REGULAR[0]).T)
    bounds = np.full(len(faces), np.inf)
    for order in permutations(range(3)):
        corners = t.x[np.concatenate((t.facets[faces][:, order], apex), axis=1)]
        map_ = (corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1) @ edges
        inverse = np.linalg.inv(map_)
        size = np.einsum("mij,mjk,mik->m", inverse, squares, inverse).clip(min=0.0)
        bounds = np.minimum(bounds, np.linalg.norm(map_, 2, axis=(1, 2)) ** 2 * np.sqrt(size))
    area, volume = 3**0.5 / 4, 2**0.5 / 12
    return np.asarray(BESIDE_LINEAR * np.sqrt(t.area[faces] / area * volume / t.volume[cell]) * bounds)


def work_inside(t: Simplices, squares: Array) -> Array:
    """Bounds of the work of forces r that are orthogonal to linear vectors in tetrahedra, per unit of the norm of the
    strain there, shape (n,).

    The work is that of A^-1 r on v, so that it is at most c |A^-1 r| |A|^2 |eps(w)|.  The best of the tetrahedra of
    ``HILL`` and of the orders of the vertices is taken.

    Args:
        t: the tetrahedra.
        squares: integrals of the products of the components of r, shape (n, 3, 3).
    """
    bounds = np.full(len(squares), np.inf)
    for (cosine, constant), order in product(HILL, permutations(range(4))):
        if order[0] > order[3]:  # the path backwards
            continue
        corners = hill(cosine)
        vertices = t.x[t.corners[:, order]]
        map_ = (vertices[:, 1:] - vertices[:, :1]).transpose(0, 2, 1) @ np.linalg.inv((corners[1:] - corners[0]).T)
        inverse = np.linalg.inv(map_)
        size = np.einsum("mij,mjk,mik->m", inverse, squares, inverse, optimize=True).clip(min=0.0)
        largest = np.linalg.eigvalsh(map_ @ map_.transpose(0, 2, 1))[:, -1]
        bounds = np.minimum(bounds, constant * largest * np.sqrt(size))
    return bounds
