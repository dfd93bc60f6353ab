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


def sticking_half_width(solution, poisson, least=0.3):
    """The half-width of the contact and that of the zone that sticks by Cattaneo and Mindlin,
    c = a (1 - Q / F P)^(1/2), which the solution has to a node; the pressing force, and the
    distance of nodes.
    """
    tangential, normal = np.abs(sum(solution.contact.forces))
    share = tangential / (0.3 * normal)
    assert least < share < 0.9
    stiffness, radius = 200.0 / (2 * (1 - poisson**2)), 1 / (1 / 8 + 1 / 12)
    half = np.sqrt(4 * normal * radius / (np.pi * stiffness))
    inner = half * np.sqrt(1 - share)
    table = solution.table.columns
    spacing = np.diff(table["x"][np.abs(table["x"]) < half]).max()
    assert np.ptp(table["x"][table["state"] == "stick"]) / 2 == pytest.approx(inner, abs=spacing)
    return half, inner, normal, spacing
