"""Where the stress has no limit as the mesh is refined: what is said against what four meshes
show.
"""

from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from scene_tables import coulomb_friction, fixed, rectangle_mesh, tresca_friction
from scenes import alone

from signorini_fx.mechanics.body.discretisation import prepare
from signorini_fx.quantities.shown import short_answer
from signorini_fx.records import Timings
from signorini_fx.results.singularities import why_no_limit
from signorini_fx.results.summary import summary_of
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene

COMM = MPI.COMM_WORLD
CLAMPED = [fixed("left")]
# Twice as wide as high: a node two facets above the corner is one facet of the bottom away from it.
FLAT_CELLS = rectangle_mesh(4, 4, length=2.0)
ROLLERS = [fixed("left", "x"), fixed("bottom", "y")]
PULL = [{"boundary": "right", "x": 1.0}]


def block(displacement, n=4, **more):
    """A block of 2 x 1."""
    return parse_scene(
        {
            "mesh": rectangle_mesh(2 * n, n, length=2.0),
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
    found = [alone(scene).stress for scene in scenes]
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
                "contact": {"boundary": "bottom", "friction": tresca_friction(1.0)},
            },
            (2.0, 0.0),
            "at the end of the boundary bottom",
        ),
    ],
)
def test_corners_of_a_block(changes, place, expected):
    """A right angle is too much between a held and a free side only."""
    assert said(block(**changes), place) == expected


def test_beside_a_single_node():
    """Where a force or a support acts at a node, and within a cell from there."""
    pushed = {"point_force": {"at": [1.0, 1.0], "y": -1.0}, "traction": []}
    scene = block(ROLLERS, **pushed)
    expected = "where a single node is loaded or held"
    assert [said(scene, at) for at in ((1.0, 1.0), (1.25, 0.75))] == [expected] * 2
    assert said(scene, (1.0, 0.5)) is None
    pinned = block([{"at": [1.0, 0.0], "x": 0.0, "y": 0.0}, *ROLLERS])
    assert said(pinned, (1.0, 0.0)) == expected
    extremes = alone(scene).stress.as_dict()
    assert extremes["von_mises"]["no_limit"] == expected


NOTCH = """
SetFactory("OpenCASCADE");
Box(1) = {0, 0, 0, 2, 1, 0.5};
Box(2) = {1, 0.5, 0, 1, 0.5, 0.5};
BooleanDifference{ Volume{1}; Delete; }{ Volume{2}; Delete; }
Mesh.MeshSizeMax = 0.25;
Mesh.ElementOrder = 2;
"""


@pytest.mark.parametrize(
    ("x", "y", "found"),
    [(1.0, 0.5, True), (1.0, 0.35, True), (0.75, 0.25, True), (1.95, 0.0, False)],
)
def test_beside_a_notch_of_curved_cells(tmp_path, x, y, found):
    """Facets of degree 2 share three nodes; on coarse cells the largest stress may be two of them
    away from the edge.
    """
    file = tmp_path / "notch.geo"
    file.write_text(NOTCH, encoding="utf-8")
    scene = parse_scene(
        {
            "mesh": {"file": str(file), "boundaries": {"left": "x[0] < 1e-9"}},
            "element": {"degree": 2},
            "material": {"young": 100.0, "poisson": 0.3},
            "displacement": fixed("left", "xyz"),
        }
    )
    expected = "at a reentrant corner of the body" if found else None
    assert said(scene, (x, y, 0.25), MPI.COMM_SELF) == expected


def punched(n, *, flat):
    """A stiff block with edges, or a crowned one, on a soft one that is broader."""
    parameters = {"length": 1.0, "height": 1.0, "nx": n, "ny": n}
    broad = {"length": 3.0, "height": 1.0, "nx": 3 * n, "ny": n}
    gap = {} if flat else {"gap": "0.4*(x[0] - 1.5)**2"}
    return {
        "body": [
            {"name": "up", "shift": [1.0, 1.0], "mesh": rectangle_mesh(**parameters)},
            {"name": "low", "mesh": rectangle_mesh(**broad)},
        ],
        "material": [
            {"young": 1000.0, "poisson": 0.3, "region": "up"},
            {"young": 100.0, "poisson": 0.3, "region": "low"},
        ],
        "displacement": [fixed("low.bottom"), {"boundary": "up.top", "x": 0.0, "y": -0.02}],
        "contact": {"boundary": "up.bottom", "against": "low.top", **gap},
    }


def rough(n, **contact):
    """A flat block on a rough floor, with corners of 90 degrees."""
    parameters = {"length": 2.0, "height": 1.0, "nx": 2 * n, "ny": n}
    return {
        "mesh": rectangle_mesh(**parameters),
        "material": {"young": 100.0, "poisson": 0.3},
        "displacement": {"boundary": "top", "x": 0.0, "y": -0.01},
        "contact": {"boundary": "bottom", **contact},
    }


FRICTION = {"friction": coulomb_friction(0.5)}
PRESSED = {
    "rough": (lambda n: rough(n, **FRICTION), "at the end of the boundary bottom, ("),
    "smooth": (rough, None),
    "crowned": (lambda n: rough(n, gap="0.05*(x[0] - 1)**2", **FRICTION), None),
    "edges": (lambda n: punched(n, flat=True), "at the edge of one body on another, ("),
    "crowned pair": (lambda n: punched(n, flat=False), None),
}


@pytest.mark.parametrize("name", PRESSED)
def test_the_largest_pressure(name):
    """Where it is said to have no limit it grows by a tenth and more each time the cells are
    halved; elsewhere by less than a hundredth.
    """
    make, why = PRESSED[name]
    found = [alone(parse_scene(make(n))) for n in (8, 16, 32)]
    largest = [one.table.columns["pressure"].max() for one in found]
    growth = np.diff(np.log(largest))
    assert (growth > 0.1).all() if why else abs(growth[-1]) < 0.01
    for one in found:
        told = one.no_limit_of_pressure
        assert told is None if why is None else told.startswith(why)
    lines = " ".join(" ".join(map(str, short_answer(summary_of(found[0]), Path()))).split())
    pressure = lines.partition("largest pressure")[2].partition("stress")[0]
    assert ("no finite value" in pressure) is (why is not None)


@pytest.mark.parametrize(
    ("n", "bowl", "why"),
    [(4, 0.05, "error not known: it may have no limit at (1, 1)"), (16, 0.4, None)],
)
def test_an_edge_that_contact_may_reach(n, bowl, why):
    """A coarse mesh shows little of what would be there, and so it has no largest pressure."""
    made = punched(n, flat=True)
    made["contact"]["gap"] = f"{bowl}*(x[0] - 1.5)**2"
    found = alone(parse_scene(made))
    assert found.no_limit_of_pressure is None
    number = found.numbers["largest pressure"]
    assert number.why == why
    assert (number.error is None) is (why is not None)


def test_a_corner_elsewhere():
    """The largest stress is that of the load, and on finer meshes that of the clamped end."""
    contact = {"boundary": "bottom", "gap": "0.02*(x[0] - 1.5)**2"}
    traction = {"boundary": "top", "y": "-5 if x[0] > 1 else 0"}
    found = [
        alone(block(CLAMPED, n, traction=traction, contact=contact)).stress.as_dict()
        for n in (8, 32)
    ]
    coarse, fine = (one["von_mises"] for one in found)
    assert coarse["place"][0] > 1
    assert coarse["no_limit"] == "at the end of the boundary left, (0, 1)"
    assert fine["place"][0] == 0 or fine["no_limit"] == coarse["no_limit"]
