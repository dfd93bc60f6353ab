"""The identities of the map of two bodies, which their certificate tries."""

import numpy as np
import pytest
from mpi4py import MPI
from two_bodies import assembled, grid

from signorini_fx import Status, solve
from signorini_fx.mechanics.mesh.tagged import tag_boundaries
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
        return {"generator": "rectangle", "parameters": parameters}

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
            "displacement": [{"boundary": "lower.bottom", "x": 0.0, "y": 0.0}],
            "traction": {"boundary": "upper.top", "x": 0.05, "y": "-(1 + 0.3*x[0])"},
            "contact": {
                "boundary": "upper.bottom",
                "against": "lower.top",
                "friction": {"law": "coulomb", "coefficient": 0.3},
            },
        }
    )


@pytest.mark.mpi
def test_what_is_right_is_certified():
    """They hold to round-off."""
    found = solve(scene(), COMM, check=False)
    assert found.status is Status.CONVERGED
    assert found.certificate.coupling < 1e-10


@pytest.mark.one_quick
@pytest.mark.parametrize("degree", [1, 2])
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

    found = solve(
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
        ),
        MPI.COMM_SELF,
    )
    assert found.converged
    assert found.certificate.coupling < 1e-8
