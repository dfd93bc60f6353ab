"""Admissible tractions that balance the loads of a body that moves freely."""

import numpy as np
import pytest

from signorini_fx.addons.bounds.equilibrated_stress import AdmissibleTractions, balanced
from signorini_fx.addons.bounds.error_bound import ROUND_OFF

FACETS, HEIGHT, LENGTH = 13, 1.6, 1.6


def side(rng, points, normal, size):
    """One side of a rectangle, with pressures and shears that are nobody's solution; of points,
    shape (m, 2, 2).
    """
    x, y = points[..., 0], points[..., 1]
    ones, nothing = np.ones_like(x), np.zeros_like(x)
    modes = np.stack(
        [
            np.stack(mode, axis=-1)
            for mode in ((ones, nothing), (nothing, ones), (HEIGHT / 2 - y, x - LENGTH / 2))
        ],
        -1,
    )
    area = np.linalg.norm(points[:, 1] - points[:, 0], axis=1)
    half, tangent = np.repeat(area[:, None] / 2, 2, axis=1), np.array((-normal[1], normal[0]))
    pressure, shear = rng.normal(size=(2, FACETS, 2)) * np.reshape((size, 150.0), (2, 1, 1))
    return AdmissibleTractions(
        pressure,
        shear[..., None] * tangent,
        130.0 * np.abs(rng.normal(size=(FACETS, 2))),
        half[..., None] * np.einsum("fadn,d->fan", modes, -normal),
        half[..., None, None] * np.einsum("fadn,d,e->faen", modes, tangent, tangent),
        area,
    )


@pytest.mark.one_quick("size", [0.0, 1.0, 1e3, 1e6])
def test_loads_that_admissible_tractions_balance(size):
    """Whatever the given tractions are, and however few points the closest ones leave in
    contact.
    """
    for seed in range(100):
        rng = np.random.default_rng([seed, int(size)])
        ends = np.linspace(0, LENGTH, FACETS + 1)
        along = np.column_stack((ends[:-1], ends[1:]))
        nothing = np.zeros_like(along)
        floor = side(rng, np.stack((along, nothing), axis=-1), np.array((0.0, -1.0)), size)
        wall = side(rng, np.stack((nothing + LENGTH, along), axis=-1), np.array((1.0, 0.0)), size)
        pressures = max(size, 1.0) * np.abs(rng.normal(size=(2, FACETS, 2)))
        loads = -sum(
            one.work(pressure, 0 * one.shear)
            for one, pressure in zip((floor, wall), pressures, strict=True)
        )
        small = ROUND_OFF * sum(
            np.einsum("fan,fa->n", np.abs(one.normal), pressure)
            for one, pressure in zip((floor, wall), pressures, strict=True)
        )
        tractions = balanced(loads, [floor, wall], small)
        work = sum(one.work(*pair) for one, pair in zip((floor, wall), tractions, strict=True))
        assert (np.abs(loads + work) <= small).all()
        for one, (pressure, shear) in zip((floor, wall), tractions, strict=True):
            assert pressure.min() >= 0
            assert (np.linalg.norm(shear, axis=2) <= one.least).all()
