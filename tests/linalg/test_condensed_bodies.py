"""Two bodies condensed onto relative displacements: the answer of a factorisation."""

import numpy as np
import pytest
from mpi4py import MPI
from scenes import alone
from two_bodies import assembled, grid

from signorini_fx.mechanics.body.discretisation import discretise
from signorini_fx.mechanics.mesh.tagged import tag_boundaries
from signorini_fx.records import History, Timings
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.solving.solve_on_mesh import contact_task


def task_of(scene):
    """The contact problem of a scene, not yet solved, and its discretisation."""
    discretisation = discretise(scene.statement, load_mesh(scene, MPI.COMM_SELF), Timings())
    return contact_task(discretisation, History()), discretisation


@pytest.mark.slow
@pytest.mark.parametrize("degree", [1, 2])
def test_two_bodies(degree):
    """Condensed onto relative displacements, ends of both bodies moved: the answer of a factorisation; as many
    unknowns as one body has on a rigid foundation, and some at the ends."""
    counts = [n // degree for n in (320, 250)]
    low, high = (
        grid("quadrilateral", (counts[1], 2), (0, -0.1), (3, 0)),
        grid("quadrilateral", (counts[0], 2), (0, 0.001), (3, 0.101)),
    )
    heights = {"bottom": -0.1, "lower": 0.0, "upper": 0.001, "top": 0.101}
    marks = {name: lambda x, y=y: np.isclose(x[1], y, atol=1e-9) for name, y in heights.items()}
    marks |= {name: lambda x, at=at: np.isclose(x[0], at) for name, at in (("left", 0.0), ("right", 3.0))}
    tagged = tag_boundaries(assembled("quadrilateral", low, high), marks)

    def scene(start, kind):
        return parse_scene(
            {
                "mesh": tagged,
                "element": {"degree": degree},
                "material": {"young": 5000.0, "poisson": 0.4},
                "displacement": [
                    {"boundary": "left", "x": 0.0005},
                    {"boundary": "right", "x": 0.0},
                    {"boundary": "bottom", "x": 0.0, "y": 0.0},
                ],
                "traction": {"boundary": "top", "y": "-20 if 1 <= x[0] <= 2 else 0"},
                "contact": {
                    "boundary": "upper",
                    "against": "lower",
                    "gap": "0.003 * (x[0] - 1.5)**2",
                    "distance": "nominal",
                    "friction": {"law": "coulomb", "coefficient": 0.3},
                },
                "solver": {"linear_algebra": kind, "initial_contact": start, "tolerance": 1e-11},
            }
        )

    task, d = task_of(scene("auto", "condensed"))
    assert 0 <= task.system.contact.fixed.size - 2 * d.boundary.size <= 12
    plain, begun = (alone(scene(start, kind)) for start, kind in (("all", "full"), ("auto", "condensed")))
    assert begun.certificate.holds
    for name in ("pressure", "shear"):
        ours, theirs = (getattr(found.contact, name) for found in (begun, plain))
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-8 * plain.contact.pressure.max())
    far = np.abs(begun.displacement.x.array - plain.displacement.x.array).max()
    assert far <= 1e-9 * np.abs(plain.displacement.x.array).max()
