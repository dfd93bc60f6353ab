"""The identities of the map of two bodies, which their certificate tries."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from certifying import certify
from mpi4py import MPI
from scene_tables import coulomb_friction, fixed, rectangle_mesh
from scenes import alone
from two_bodies import assembled, grid

from signorini_fx import Status, solve
from signorini_fx.mechanics.mesh.tagged import tag_boundaries
from signorini_fx.results.certificate.contact_nodes import Tractions
from signorini_fx.results.summary import lines_of, summary_of
from signorini_fx.scenes.reading import parse_scene

COMM = MPI.COMM_WORLD


def scene():
    """A block on another one, beyond whose end it stands out; the points are on the lower one,
    which is softer.
    """

    def mesh(count):
        parameters = {
            "length": 1.0,
            "height": 1.0,
            "nx": count,
            "ny": count,
            "cell": "quadrilateral",
        }
        return rectangle_mesh(**parameters)

    return parse_scene(
        {
            "body": [
                {"name": "lower", "mesh": mesh(6)},
                {"name": "upper", "mesh": mesh(4), "shift": [0.25, 1.0]},
            ],
            "material": [
                {"region": "lower", "young": 100.0, "poisson": 0.3},
                {"region": "upper", "young": 200.0, "poisson": 0.3},
            ],
            "displacement": [fixed("lower.bottom")],
            "traction": {"boundary": "upper.top", "x": 0.05, "y": "-(1 + 0.3*x[0])"},
            "contact": {
                "boundary": "upper.bottom",
                "against": "lower.top",
                "friction": coulomb_friction(0.3),
            },
        }
    )


@pytest.mark.mpi
def test_what_is_right_is_certified():
    """They hold to round-off."""
    found = solve(scene(), COMM, check=False)
    assert found.status is Status.CONVERGED
    assert found.certificate.coupling < 1e-10


@pytest.mark.one_quick("degree", [1, 2])
def test_faces_that_are_no_parallelograms(degree):
    """Integrands are no polynomials there; the identities hold."""

    def block(counts, low, twist):
        def place(x):
            return x + 16 * np.outer(np.prod(x[:, :2] * (1 - x[:, :2]), axis=1), twist)

        mesh = assembled(
            "hexahedron", grid("hexahedron", counts, (0, 0, low), (1, 1, low + 1), place)
        )
        return tag_boundaries(
            mesh, {"bottom": f"abs(x[2] - {low}) < 1e-9", "top": f"abs(x[2] - {low + 1}) < 1e-9"}
        )

    found = alone(
        parse_scene(
            {
                "body": [
                    {"name": "lower", "mesh": block((2, 2, 1), 0, [0.2, -0.1, 0.0])},
                    {"name": "upper", "mesh": block((3, 3, 1), 1, [-0.2, 0.07, 0.0])},
                ],
                "element": {"degree": degree},
                "material": {"young": 100.0, "poisson": 0.3},
                "displacement": {"boundary": "lower.bottom", **dict.fromkeys("xyz", 0.0)},
                "traction": {"boundary": "upper.top", "x": 1.0, "z": "-1 - x[0]"},
                "contact": {"boundary": "upper.bottom", "against": "lower.top", "kind": "bonded"},
            }
        )
    )
    assert found.converged
    assert found.certificate.coupling < 1e-8


@pytest.mark.parametrize(("ratio", "known"), [(1.0, 1e-6), (1e5, 1e-4), (1e6, 1e-3), (1e7, 1e-2)])
def test_it_says_to_what_a_soft_body_is_checked(ratio, known):
    """Gamma is that of the stiffer body: pressures that are wrong by more than the result says are
    refused, and it says no more than that.
    """

    def mesh(count):
        parameters = {"length": 2.0, "height": 1.0, "nx": 2 * count, "ny": count}
        return rectangle_mesh(**parameters)

    found = alone(
        parse_scene(
            {
                "body": [
                    {"name": "stiff", "mesh": mesh(4)},
                    {"name": "soft", "mesh": mesh(4), "shift": [0.0, 1.0]},
                ],
                "material": [
                    {"region": "stiff", "young": ratio, "poisson": 0.3},
                    {"region": "soft", "young": 1.0, "poisson": 0.3},
                ],
                "displacement": [
                    fixed("stiff.bottom"),
                    {"boundary": "soft.top", "x": 0.0, "y": -0.01},
                ],
                "contact": {
                    "boundary": "soft.bottom",
                    "against": "stiff.top",
                    "gap": "1e-3*(x[0] - 1)**2",
                },
            }
        )
    )
    checked = found.certificate.checked
    assert 0.1 * known < checked <= known
    lines = [line.text for line in lines_of(summary_of(found), Path("here"))]
    assert f"holds for the regularised law, each condition to {checked:.0e}" in lines
    tractions = Tractions.of(found.contact)
    for share, holds in ((checked / 30, True), (3 * checked, False)):
        wrong = replace(tractions, pressure=tractions.pressure * (1 + share))
        law, tagged = found.certificate.law, found.model.tagged
        certificate = certify(found.statement, tagged, found.displacement, wrong, law=law)
        assert certificate.holds is holds
