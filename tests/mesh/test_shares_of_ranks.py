"""How the cells of several bodies are divided among the ranks: equal shares, each with both sides of its contact."""

from itertools import pairwise

import numpy as np
import pytest
from mpi4py import MPI
from test_two_bodies_on_ranks import points_of

from signorini_fx import solve
from signorini_fx.mechanics.mesh import shares_of_ranks
from signorini_fx.scenes.reading import parse_scene

WORLD = MPI.COMM_WORLD


class Ranks:
    """As many ranks as wanted, all in this process: sums over the ranks are those of this one."""

    def __init__(self, size):
        self.size = size

    def Allreduce(self, given, found, op=None):
        if given is not MPI.IN_PLACE:
            found[...] = given


def boxes(*given):
    """Middles of the cells of boxes, each (counts, low, high), and the body of each."""
    found = []
    for counts, low, high in given:
        ticks = [a + (b - a) * (np.arange(n) + 0.5) / n for n, a, b in zip(counts, low, high, strict=True)]
        found.append(np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1).reshape(-1, len(counts)))
    return np.concatenate(found), np.repeat(np.arange(len(found)), [len(x) for x in found])


def flat(normal, at, length=1.0):
    """Corners of facets with a normal along an axis at points along another one."""
    dim = len(at)
    along = (normal + 1) % dim
    others = [axis for axis in range(dim) if axis != normal]
    corners = np.array(at) + 0.1 * np.array([[0.0] * dim, *np.eye(dim)[others]])
    return corners + np.linspace(0, length, 12)[:, None, None] * np.eye(dim)[along]


@pytest.mark.parametrize("ranks", [1, 2, 3, 4, 6, 7])
def test_two_blocks(ranks):
    """Slices of both blocks, as many cells of each in all of them but for a column."""
    counts = (30, 10), (24, 8)
    middles, body = boxes((counts[0], (0, 0), (3, 1)), (counts[1], (0, -1), (3, 0)))
    owner = shares_of_ranks.shares(Ranks(ranks), middles, flat(1, (0, 0), 3.0))
    assert np.ptp(np.bincount(owner, minlength=ranks)) <= 2
    for number, (_, column) in enumerate(counts):
        own = np.bincount(owner[body == number], minlength=ranks)
        assert np.abs(own - (body == number).sum() / ranks).max() <= column
    if ranks in (2, 3, 6):  # whole columns
        np.testing.assert_array_equal(owner, np.floor(middles[:, 0] * ranks / 3))


@pytest.mark.parametrize(
    ("size", "normal", "cut"),
    [((3, 1, 1), 2, 0), ((1, 1, 3), 2, None), ((1, 2, 3), 2, 1), ((1, 1, 30), 2, 2), ((1, 2, 3), None, 2)],
)
def test_along_the_contact(size, normal, cut):
    """Two ranks are cut apart along the contact of two stacked blocks, unless these are ten times as high as long."""
    size = np.array(size, dtype=float)
    middles, _ = boxes(((4, 4, 5), (0, 0, 0), size * (1, 1, 0.5)), ((4, 4, 5), size * (0, 0, 0.5), size))
    sides = np.empty((0, 3, 3)) if normal is None else flat(normal, (0, 0, size[2] / 2))
    owner = shares_of_ranks.shares(Ranks(2), middles, sides)
    apart = [middles[owner == 0, axis].max() < middles[owner == 1, axis].min() for axis in range(3)]
    assert np.flatnonzero(apart).tolist() == [0 if cut is None else cut]


@pytest.mark.one_quick
@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_few_cells(dim, scale):
    """No rank is without cells if there are enough; equal columns in a row are cut between their cells."""
    cells = ((1,) * dim, (0,) * dim, (scale,) * dim), ((1,) * dim, (0,) * (dim - 1) + (scale,), (scale,) * dim)
    middles, _ = boxes(*cells)
    assert sorted(shares_of_ranks.shares(Ranks(2), middles, scale * flat(dim - 1, (0,) * dim))) == [0, 1]
    middles, _ = boxes(((3, 3, 3)[:dim], (0,) * dim, (scale,) * dim))
    for ranks in range(1, len(middles) + 1):
        assert (
            np.bincount(
                shares_of_ranks.shares(Ranks(ranks), middles, scale * flat(0, (0,) * dim)), minlength=ranks
            ).min()
            >= 1
        )


def block(kind, counts):
    """The mesh of a block 3 x 1 or 3 x 1 x 1 with so many cells along its axes."""
    generator, sizes, names = (
        ("rectangle", ("length", "height"), ("nx", "ny")),
        ("box", ("length", "width", "height"), ("nx", "ny", "nz")),
    )[len(counts) - 2]
    parameters = {
        "cell": kind,
        **dict(zip(sizes, (3.0, 1.0, 1.0), strict=False)),
        **dict(zip(names, counts, strict=True)),
    }
    return {"generator": generator, "parameters": parameters}


def stack(kind, *counts, **more):
    """Blocks on each other, the lowest held, the highest pressed and pushed."""
    dim = len(counts[0])
    names = [f"block {number}" for number in range(len(counts))]
    below = [0.0] * (dim - 1)
    return parse_scene(
        {
            "body": [
                {"name": name, "mesh": block(kind, count), "shift": [*below, float(height)]}
                for height, (name, count) in enumerate(zip(names, counts, strict=True))
            ],
            "material": {"young": 100.0, "poisson": 0.3},
            "displacement": {"boundary": f"{names[0]}.bottom", **dict.fromkeys("xyz"[:dim], 0.0)},
            "traction": {"boundary": f"{names[-1]}.top", "x": 0.1, "xyz"[dim - 1]: "-1 - 0.2 * x[0]"},
            "contact": [
                {"boundary": f"{upper}.bottom", "against": f"{lower}.top", "friction": COULOMB}
                for lower, upper in pairwise(names)
            ],
            **more,
        }
    )


COULOMB = {"law": "coulomb", "coefficient": 0.3}
# Two bodies, three, in 3D, with fewer cells than some numbers of ranks, and on two meshes.
STACKS = {
    "quadrilaterals": ("quadrilateral", (10, 3), (7, 2)),
    "triangles": ("triangle", (6, 2), (4, 2), (8, 2)),
    "hexahedra": ("hexahedron", (6, 2, 2), (4, 1, 1)),
    "tetrahedra": ("tetrahedron", (3, 1, 1), (4, 1, 1)),
    "few": ("quadrilateral", (1, 1), (1, 1)),
}


@pytest.mark.one_quick
@pytest.mark.mpi
@pytest.mark.parametrize(("name", "more"), [*((name, {}) for name in STACKS), ("quadrilaterals", {"levels": 2})])
def test_the_same_as_on_one_rank(name, more):
    """Positions, weights and tractions of all contact points."""
    scene = stack(*STACKS[name], solver=more)
    together, alone = solve(scene, WORLD), solve(scene, MPI.COMM_SELF)
    assert together.certificate.holds
    assert len(together.levels) == len(alone.levels)
    ours, theirs = points_of(together.contact), points_of(alone.contact)
    assert np.abs(alone.contact.shear).max() > 0.01
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-9)
