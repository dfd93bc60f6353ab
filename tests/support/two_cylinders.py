"""The demonstration of two cylinders with other entries, and the balance of its contacts."""

import tomllib
from pathlib import Path

import numpy as np
import pytest

DEMO = Path(__file__).parents[2] / "demos" / "scenes" / "two_cylinders.toml"


def altered(**changes):
    """The demo with other entries."""

    scene = tomllib.loads(DEMO.read_text(encoding="utf-8"))
    scene["mesh"]["file"] = str(DEMO.parent / scene["mesh"]["file"])
    contact = scene["contact"][0]
    for key, value in changes.items():
        if key in ("solver", "accuracy"):
            scene[key] = value
        elif value is None:
            contact.pop(key, None)
        else:
            contact[key] = value
    return scene


def in_balance(solution):
    """Forces and moments of both sides of every contact sum to zero; the resultants by their
    boundaries.
    """
    every = {one.boundary: one for one in solution.resultants.every()}
    for effect in solution.statement.contact:
        one, other = every[effect.boundary], every[effect.against]
        assert one.force + other.force == pytest.approx(np.zeros(2), abs=1e-9 * one.size[0])
        assert one.moment + other.moment == pytest.approx(0.0, abs=1e-9 * one.size[1])
    return every
