"""Where the stress has no limit as the mesh is refined: what is said against what four meshes show."""

from dataclasses import replace

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI
from spaces import box

from signorini_fx.mechanics.body.discretisation import prepare
from signorini_fx.mechanics.mesh.tagged import tag_boundaries
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


@pytest.mark.parametrize(("displacement", "end"), [(CLAMPED, "it is at the end of the boundary left"), (ROLLERS, None)])
def test_what_is_said_is_what_meshes_show(displacement, end):
    """At the corner of a clamped end the stress grows by a tenth and more each time; between rollers it does not."""
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


JUMPS = {
    "shear": ({"boundary": "top", "x": "1 if x[0] > 1 else 0"}, "it is where the load along the boundary top jumps"),
    "pressure": ({"boundary": "top", "pressure": "1 if x[0] > 1 else 0"}, None),
    "continuous": ({"boundary": "top", "x": "max(x[0] - 1, 0)"}, None),
}


@pytest.mark.one_quick
@pytest.mark.mpi
@pytest.mark.parametrize("kind", JUMPS)
def test_loads_that_jump(kind):
    """Shear that begins within a side makes the stress along it grow by as much with each mesh, pressure does not."""
    load, said_of = JUMPS[kind]
    found = [solve(block(CLAMPED, n, traction=load), COMM).stress.component("xx") for n in (16, 32, 64)]
    at = [largest_near(field, (1.0, 1.0)) for field in found]
    # With a jump, 2 / pi ln 2 times the shear, from theory.
    growth, of_theory = np.abs(np.diff(at)), 2 / np.pi * np.log(2)
    if said_of:
        np.testing.assert_allclose(growth, of_theory, rtol=0.12)
    else:
        assert growth[1] < 0.75 * growth[0]
    assert said(block(CLAMPED, 8, traction=load), (1.0, 1.0)) == said_of
    assert said(block(CLAMPED, 8, traction=load), (1.5, 1.0)) is None


def largest_near(field, place):
    """The largest size of a field at a place, on all ranks."""
    x = field.function_space.tabulate_dof_coordinates()[:, :2]
    here = np.linalg.norm(x - place, axis=1) < 1e-9
    return COMM.allreduce(float(np.abs(field.x.array[here]).max(initial=0.0)), op=MPI.MAX)


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


def parted(scene, where, comm=COMM):
    """The scene with two materials, the second one where a rule says so of the middle of a cell."""
    tagged = load_mesh(scene, comm)
    dim = tagged.dimension
    known = tagged.mesh.topology.index_map(dim)
    cells = np.arange(known.size_local + known.num_ghosts, dtype=np.int32)
    second = where(dmesh.compute_midpoints(tagged.mesh, dim, cells))
    tags = dmesh.meshtags(tagged.mesh, dim, cells, 1 + second.astype(np.int32))
    first = scene.material[0]
    materials = tuple(
        first.model_copy(update={"young": young, "region": name}) for young, name in ((100.0, "one"), (1e4, "other"))
    )
    own = replace(tagged, cell_tags=tags, regions={"one": 1, "other": 2})
    return scene.model_copy(update={"mesh": own, "material": materials})


MEET, CORNER = "it is where materials meet at the boundary", "it is at a corner of the interface of materials"


@pytest.mark.slow
@pytest.mark.mpi(slow=True)
def test_materials_that_meet():
    """At a free side the stress grows with each mesh; within the body, and at a mirror, it does not."""
    side = lambda x: x[:, 0] > 1.0  # noqa: E731
    corner = lambda x: (x[:, 0] > 1.0) & (x[:, 1] > 0.5)  # noqa: E731
    scenes = [parted(block(ROLLERS, n), side) for n in (8, 16, 32)]
    fields = [solve(scene, COMM).stress.component("xx") for scene in scenes]
    free, inside, mirror = (
        [largest_near(field, place) for field in fields] for place in ((1.0, 1.0), (1.0, 0.5), (1.0, 0.0))
    )
    assert np.diff(np.log(free)).min() > 0.03
    for one in (inside, mirror):
        before, last = np.abs(np.diff(one))
        assert last < 0.6 * before
    assert [said(scenes[0], place) for place in ((1.0, 1.0), (1.0, 0.5), (1.0, 0.0))] == [MEET, None, None]
    assert said(parted(block(ROLLERS, 8), corner), (1.0, 0.5)) == CORNER
    assert said(parted(block(ROLLERS, 8), corner), (1.0, 0.75)) is None
    solid = parse_scene(
        {
            "mesh": box("tetrahedra", (4, 4, 4), size=(1.0, 1.0, 1.0), comm=COMM),
            "material": {"young": 100.0, "poisson": 0.3},
            "displacement": {"boundary": "left", "x": 0.0, "y": 0.0, "z": 0.0},
            "traction": PULL,
        }
    )
    middle = parted(solid, lambda x: x[:, 0] > 0.5)
    assert said(middle, (0.5, 0.5, 0.5)) is None
    assert said(middle, (0.5, 0.0, 0.5)) == MEET
    assert said(parted(solid, lambda x: (x[:, 0] > 0.5) & (x[:, 1] > 0.5)), (0.5, 0.5, 0.5)) == CORNER


def bodies(wide, n=4, young=(100.0, 100.0), comm=COMM, cell="quadrilateral", **contact):
    """A block of 2 x 1 on one that is as wide between mirrors, or twice as wide; pressed by a given displacement."""

    def mesh(width):
        return {
            "generator": "rectangle",
            "parameters": {"length": width, "height": 1.0, "nx": int(width * n), "ny": n, "cell": cell},
        }

    upper = {"y": -0.01} | ({"x": "0.004 * (x[0] - 1)"} if wide else {})  # about what is natural
    sides = [] if wide else [{"boundary": f"{name}.left", "x": 0.0} for name in ("upper", "lower")]
    return parse_scene(
        {
            "body": [
                {"name": "upper", "mesh": mesh(2.0), "shift": [0.0, 1.0]},
                {"name": "lower", "mesh": mesh(4.0 if wide else 2.0), "shift": [-1.0 if wide else 0.0, 0.0]},
            ],
            "material": [
                {"young": value, "poisson": 0.3, "region": name}
                for name, value in zip(("upper", "lower"), young, strict=True)
            ],
            "displacement": [
                {"boundary": "upper.top", **upper},
                {"boundary": "lower.bottom", "y": 0.0, **({"x": 0.0} if wide else {})},
                *sides,
            ],
            "contact": {"boundary": "upper.bottom", "against": "lower.top", "points": "boundary", **contact},
        }
    )


FRICTION = {"friction": {"law": "coulomb", "coefficient": 0.3}}
PRESSED = {
    "as wide": ({}, False),
    "as wide, of two materials": ({"young": (100.0, 300.0)}, False),
    "as wide, with friction": (FRICTION, False),
    "as wide, bonded": ({"kind": "bonded"}, False),
    "on a wider one": ({}, True),
    "on a wider one, of two materials": ({"young": (300.0, 100.0)}, True),
    "on a wider one, bonded": ({"kind": "bonded"}, True),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", PRESSED)
def test_edges_of_bodies_that_touch(name):
    """A block on one as wide is under a uniform pressure; on a wider one the stress at edges grows with each mesh."""
    more, grows = PRESSED[name]
    scenes = [bodies(grows, n, **more) for n in (4, 8, 16)]
    found = [solve(scene, MPI.COMM_SELF).stress for scene in scenes]
    growth = np.diff(np.log([one.largest().value for one in found]))
    assert (growth > 0.08).all() if grows else np.abs(growth).max() < 1e-6
    expected = "it is at the end of the boundary upper.bottom" if grows else None
    assert [said(scenes[0], place) for place in ((2.0, 1.0), (0.0, 1.0), (1.0, 1.0))] == [expected, expected, None]
    if grows:
        assert {one.as_dict()["von_mises"]["no_limit"] for one in found} == {expected}
