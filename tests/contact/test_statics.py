"""Which loads admissible contact tractions balance: against linear programmes."""

import numpy as np
import pytest
from scipy import sparse
from scipy.optimize import linprog

from signorini_fx.algebra.contact.statics import Reactions, largest_multiple, nearest, separable
from signorini_fx.mechanics.rigid.rigid_motions import rigid_modes

KINDS = ("coulomb", "tresca", "mixed", "capped")


def reactions(points, normals, given=0.0, coefficient=0.0, cap=np.inf):
    """Those of single points of one body."""
    count, dim = points.shape
    modes = rigid_modes(points, np.zeros(dim), np.array(1.0))
    tangents = np.linalg.svd(normals[:, None])[2][:, 1:].transpose(0, 2, 1)
    per_node = [
        np.broadcast_to(np.asarray(value, dtype=float), (count,)).copy()
        for value in (given, coefficient, cap)
    ]
    return Reactions(
        np.einsum("ij,ijk->ik", normals, modes),
        np.einsum("ijt,ijk->itk", tangents, modes),
        *per_node,
        np.zeros(count, dtype=bool),
        np.zeros(count, dtype=np.int64),
    )


def anything(rng, kind, count, dim, *, flat):
    """Contact at random points, on one plane or in random directions."""
    points = rng.uniform(-1.0, 1.0, (count, dim))
    normals = rng.normal(size=(count, dim))
    if flat:
        points[:, -1] = -1.0
        normals = np.broadcast_to(-np.eye(dim)[-1], (count, dim))
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    coefficient, given, cap = (
        rng.uniform(0.0, 0.8, count),
        rng.uniform(0.0, 2.0 / count, count),
        np.inf,
    )
    match kind:
        case "coulomb":
            given = 0.0
        case "tresca":
            coefficient = 0.0
        case "capped":
            given, cap = 0.0, rng.uniform(0.0, 3.0 / count, count)
    return reactions(points, normals, given, coefficient, cap)


def largest_by_programme(here, dead, live, *, outer, sides=64):
    """The largest multiple by a linear programme, with a polygon around or within the disc of the
    shear; None: none.
    """
    count, tangents, _ = here.tangential.shape
    ends = np.array([[1.0], [-1.0]])
    if tangents == 2:
        angle = 2 * np.pi * np.arange(sides) / sides
        radius = 1 / np.cos(np.pi / sides) if outer else 1.0
        ends = radius * np.column_stack((np.cos(angle), np.sin(angle)))
    pulls = np.einsum("ct,itk->cik", ends, here.tangential).reshape(-1, live.size)
    own, none = sparse.identity(count, format="csr"), sparse.csr_matrix((count, 1))
    bounded = sparse.hstack([-sparse.diags(here.coefficient), *[own] * len(ends), none]).tocsr()
    capped = sparse.hstack([0 * own, *[own] * len(ends), none]).tocsr()[np.isfinite(here.cap)]
    result = linprog(
        np.append(np.zeros(count + len(pulls)), -1.0),
        A_ub=sparse.vstack([bounded, capped]),
        b_ub=np.append(here.given, here.cap[np.isfinite(here.cap)]),
        A_eq=np.hstack((here.normal.T, pulls.T, -live[:, None])),
        b_eq=dead,
    )
    assert result.status in (0, 2, 3)
    return {0: lambda: -result.fun, 2: lambda: None, 3: lambda: np.inf}[result.status]()


@pytest.mark.one_quick("kind", KINDS)
@pytest.mark.parametrize("dim", [2, 3])
def test_balance_against_linear_programmes(kind, dim):
    """What is called unbalanced has no tractions within the polygon, what is called balanced has
    some in the outer.
    """
    rng = np.random.default_rng(dim)
    seen = set()
    for _ in range(12):
        here = anything(rng, kind, int(rng.choice([3, 10, 40])), dim, flat=rng.random() < 0.6)
        load = 0.3 * rng.normal(size=here.normal.shape[1])
        load[dim - 1] -= 1.0
        near = nearest(here, load)
        assert near.balanced != near.unbalanced
        none = np.zeros_like(load)
        inner, outer = (
            largest_by_programme(here, load, none, outer=side) is not None for side in (False, True)
        )
        assert outer if near.balanced else not inner
        seen.add(near.balanced)
    assert seen == {True, False}


@pytest.mark.one_quick("kind", ["tresca", "mixed", "capped"])
@pytest.mark.parametrize("dim", [2, 3])
def test_largest_multiple_against_linear_programmes(kind, dim):
    """It is between those of the two polygons."""
    rng, finite = np.random.default_rng(10 + dim), 0
    for _ in range(8):
        here = anything(rng, kind, int(rng.choice([4, 20])), dim, flat=True)
        load = 0.05 * rng.normal(size=here.normal.shape[1])
        load[dim - 1] = -0.1
        low, high = (
            largest_by_programme(here, 0 * load, load, outer=outer) for outer in (False, True)
        )
        multiple = largest_multiple(here, load)
        assert low * (1 - 1e-6) - 1e-6 <= multiple <= high * (1 + 1e-6) + 1e-6
        finite += 0 < multiple < np.inf
    assert finite


FOOT = np.array([(x, -0.5) for x in np.linspace(-1.0, 1.0, 9)])
DOWN = np.broadcast_to([0.0, -1.0], FOOT.shape)


@pytest.mark.parametrize(("slope", "balanced"), [(1e-3, True), (1e-5, False)])
def test_walls_that_are_nearly_parallel(slope, balanced):
    """Forces beyond ten thousand times the load hold nothing: the motion that proves it is that of
    the load.
    """
    points, normals = np.array([(-1.0, 0.0), (1.0, 0.0)]), np.array([(-1.0, -slope), (1.0, -slope)])
    here = reactions(points, normals / np.linalg.norm(normals, axis=1, keepdims=True))
    found = nearest(here, np.array([0.0, -1.0, 0.0]))
    assert found.balanced is balanced
    assert balanced or found.motion[1] < -0.5


@pytest.mark.parametrize("friction", [{}, {"coefficient": 0.3}, {"given": 0.1}])
def test_separable(friction):
    """A foot can be lifted, a body between two walls cannot, and one in a groove only against
    little friction.
    """
    assert separable(reactions(FOOT, DOWN, **friction))
    walls = np.where(FOOT[:, :1] > 0, [[1.0, 0.0]], [[-1.0, 0.0]])
    assert not separable(reactions(FOOT, walls, **friction))
    groove = np.where(FOOT[:, :1] > 0, [[0.8, -0.6]], [[-0.8, -0.6]])
    assert separable(reactions(FOOT, groove, **friction)) is ("given" not in friction)
    assert not separable(reactions(FOOT, groove, coefficient=0.8))
