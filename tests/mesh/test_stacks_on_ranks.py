"""Stacked bodies on several ranks: the contact points are those of one rank."""

from itertools import pairwise

import numpy as np
import pytest
from mpi4py import MPI
from test_two_bodies_on_ranks import points_of

from signorini_fx import solve
from signorini_fx.scenes.reading import parse_scene

WORLD = MPI.COMM_WORLD


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
