"""Which facets of two sides can meet: the same pairs as a test of every pair, with work that grows like the sides."""

import numpy as np
import pytest

from signorini_fx.mechanics.pairs import search
from signorini_fx.mechanics.pairs.search import Patches, candidates


def every_pair(slave, master, reach, turning):
    """The definition, pair by pair."""
    apart = master.centre[None] - slave.centre[:, None]
    along = np.einsum("smd,sd->sm", apart, slave.normal)
    across = np.linalg.norm(apart - along[..., None] * slave.normal[:, None], axis=2)
    beyond = slave.radius[:, None] + master.radius
    faces = slave.normal @ master.normal.T < -0.2
    within = np.linalg.norm(apart, axis=2) <= slave.radius[:, None] + master.radius.max() + reach
    # Patches of these radii, seen aslant: what is beyond along the direction of projection counts across it, too.
    turning = np.broadcast_to(turning, len(along))[:, None]
    beyond_across = beyond * (1.0 + turning**2 / np.sqrt(1.0 + turning**2))
    over = across <= beyond_across + turning * np.abs(along)
    return np.nonzero(faces & within & over & (np.abs(along) <= reach + beyond))


@pytest.mark.parametrize("seed", range(12))
def test_every_pair_that_can_meet(seed, monkeypatch):
    """Patches of all sizes: in disorder, and on two concentric spheres, of which either may be the larger one."""
    monkeypatch.setattr(search, "_AT_ONCE", 64)
    draw = np.random.default_rng(seed)
    dim, counts = 2 + seed % 2, draw.integers(20, 150, 2)
    sides = []
    for count, way in zip(counts, (1.0, -1.0), strict=True):
        centre = draw.normal(size=(count, dim))
        normal = draw.normal(size=(count, dim))
        if seed % 3:
            normal = centre.copy()
            centre *= draw.uniform(0.9, 1.1) / np.linalg.norm(centre, axis=1, keepdims=True)
        normal *= way / np.linalg.norm(normal, axis=1, keepdims=True)
        sizes = draw.choice([0.01, 0.1, 0.5], (count, 1, 1))
        sides.append(Patches(centre[:, None] + sizes * draw.normal(size=(count, dim, dim)), normal))
    turning = draw.choice([0.0, 0.2, 1.0], counts[0]) if seed % 2 else float(draw.choice([0.0, 0.5]))
    reach = float(draw.choice([0.0, 0.3, np.inf]))
    expected = every_pair(*sides, reach, turning)
    assert len(expected[0])
    for found, numbers in zip(candidates(*sides, reach, turning), expected, strict=True):
        np.testing.assert_array_equal(found, numbers)
