"""Where the stress has no limit as the mesh is refined: what is said against what four meshes
show.
"""

import numpy as np
import pytest
from mpi4py import MPI

from signorini_fx.mechanics.body.discretisation import prepare
from signorini_fx.records import Timings
from signorini_fx.results.singularities import why_no_limit
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

COMM = MPI.COMM_WORLD
CLAMPED = [{"boundary": "left", "x": 0.0, "y": 0.0}]
# Twice as wide as high: a node two facets above the corner is one facet of the bottom away from it.
FLAT_CELLS = {"generator": "rectangle", "parameters": {"length": 2.0, "nx": 4, "ny": 4}}
ROLLERS = [{"boundary": "left", "x": 0.0}, {"boundary": "bottom", "y": 0.0}]
PULL = [{"boundary": "right", "x": 1.0}]


def block(displacement, n=4, **more):
    """A block of 2 x 1."""
    return parse_scene(
        {
            "mesh": {"generator": "rectangle", "parameters": {"length": 2.0, "nx": 2 * n, "ny": n}},
            "material": {"young": 100.0, "poisson": 0.3},
            "displacement": displacement,
            "traction": PULL,
            **more,
        }
    )


def said(scene, place, comm=COMM):
    return why_no_limit(prepare(scene.statement, load_mesh(scene, comm), Timings()), place)


@pytest.mark.parametrize(
    ("displacement", "end"), [(CLAMPED, "at the end of the boundary left"), (ROLLERS, None)]
)
def test_what_is_said_is_what_meshes_show(displacement, end):
    """At the corner of a clamped end the stress grows by a tenth and more each time; between
    rollers it does not.
    """
    scenes = [block(displacement, n) for n in (4, 8, 16, 32)]
    found = [solve(scene, MPI.COMM_SELF).stress for scene in scenes]
    growth = np.diff(np.log([one.largest().value for one in found]))
    assert (growth > 0.1).all() if end else np.abs(growth).max() < 1e-6
    if end:
        extremes = [one.as_dict() for one in found]
        assert [one["von_mises"]["no_limit"] for one in extremes] == [end] * 4
        # Each extreme is judged where it is.
        assert all(one["largest_principal"]["no_limit"] == end for one in extremes)
        assert all(one["recovered"]["largest_principal"]["no_limit"] == end for one in extremes)


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("changes", "place", "expected"),
    [
        ({"displacement": CLAMPED}, (0.0, 0.0), "at the end of the boundary left"),
        ({"displacement": CLAMPED}, (0.0, 0.5), None),
        ({"displacement": CLAMPED, "mesh": FLAT_CELLS}, (0.0, 0.5), None),
        (
            {"displacement": CLAMPED, "mesh": FLAT_CELLS},
            (0.0, 0.25),
            "at the end of the boundary left",
        ),
        ({"displacement": CLAMPED}, (2.0, 0.0), None),
        ({"displacement": CLAMPED}, (1.0, 0.5), None),
        ({"displacement": ROLLERS}, (0.0, 0.0), None),
        ({"displacement": ROLLERS}, (0.0, 1.0), None),
        ({"displacement": CLAMPED, "contact": {"boundary": "bottom"}}, (2.0, 0.0), None),
        (
            {
                "displacement": CLAMPED,
                "contact": {"boundary": "bottom", "friction": {"law": "tresca", "bound": 1.0}},
            },
            (2.0, 0.0),
            "at the end of the boundary bottom",
        ),
    ],
)
def test_corners_of_a_block(changes, place, expected):
    """A right angle is too much between a held and a free side only."""
    assert said(block(**changes), place) == expected
