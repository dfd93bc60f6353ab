"""Where the stress has no limit as the mesh is refined: what is said against what four meshes show."""

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI
from spaces import box

from signorini_fx.body.discretisation import prepare
from signorini_fx.mesh.tagged import load_mesh, tag_boundaries
from signorini_fx.records import Timings
from signorini_fx.results.no_limit import why_no_limit
from signorini_fx.scene.reading import parse_scene
from signorini_fx.solving.solver import solve

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
    return why_no_limit(prepare(scene, load_mesh(scene, comm), Timings()), place)


@pytest.mark.parametrize(("displacement", "end"), [(CLAMPED, "it is at the end of the boundary left"), (ROLLERS, None)])
def test_what_is_said_is_what_meshes_show(displacement, end):
    """At the corner of a clamped end the stress grows by a tenth and more each time; between rollers it does not."""
    scenes = [block(displacement, n) for n in (4, 8, 16, 32)]
    found = [solve(scene, MPI.COMM_SELF).stress for scene in scenes]
    growth = np.diff(np.log([one.largest().value for one in found]))
    assert (growth > 0.1).all() if end else np.abs(growth).max() < 1e-6
    if end:
        assert [one.as_dict()["no_limit"] for one in found] == [end] * 4


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("changes", "place", "expected"),
    [
        ({"displacement": CLAMPED}, (0.0, 0.0), "it is at the end of the boundary left"),
        ({"displacement": CLAMPED}, (0.0, 0.5), None),
        ({"displacement": CLAMPED, "mesh": FLAT_CELLS}, (0.0, 0.5), None),
        ({"displacement": CLAMPED, "mesh": FLAT_CELLS}, (0.0, 0.25), "it is at the end of the boundary left"),
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
            "it is at the end of the boundary bottom",
        ),
    ],
)
def test_corners_of_a_block(changes, place, expected):
    """A right angle is too much between a held and a free side only."""
    assert said(block(**changes), place) == expected


@pytest.mark.mpi
def test_a_support_that_ends_within_a_side():
    """Also one that only guides: there the condition changes on a straight line."""
    scene = block(ROLLERS)
    marks = {
        "left": lambda x: np.isclose(x[0], 0.0),
        "right": lambda x: np.isclose(x[0], 2.0),
        "bottom": lambda x: np.isclose(x[1], 0.0) & (x[0] < 1.0 + 1e-9),
    }
    own = tag_boundaries(load_mesh(scene, COMM).mesh, marks)
    assert said(scene.model_copy(update={"mesh": own}), (1.0, 0.0)) == "it is at the end of the boundary bottom"


@pytest.mark.mpi
def test_reentrant_corner_and_edges_in_space():
    """The corner of an L, and the edges of a clamped end of a box; not the middle of its sides."""
    square = dmesh.create_rectangle(COMM, [(0.0, 0.0), (2.0, 2.0)], (8, 8), dmesh.CellType.triangle)
    cells = dmesh.locate_entities(square, 2, lambda x: (x[0] < 1 + 1e-9) | (x[1] < 1 + 1e-9))
    shape = dmesh.create_submesh(square, 2, cells)[0]
    own = tag_boundaries(shape, {"left": lambda x: np.isclose(x[0], 0.0), "right": lambda x: np.isclose(x[0], 2.0)})
    scene = block(CLAMPED).model_copy(update={"mesh": own})
    assert said(scene, (1.0, 1.0)) == "it is at a reentrant corner of the body"
    assert said(scene, (2.0, 1.0)) is None
    solid = parse_scene(
        {
            "mesh": box("tetrahedra", (4, 3, 3), comm=COMM),
            "material": {"young": 100.0, "poisson": 0.3},
            "displacement": {"boundary": "left", "x": 0.0, "y": 0.0, "z": 0.0},
            "traction": PULL,
        }
    )
    assert said(solid, (0.0, 0.0, 1 / 3)) == "it is at the end of the boundary left"
    assert said(solid, (1.5, 0.0, 0.0)) is None
    assert said(solid, (3.0, 1.0, 1.0)) is None
