"""The safety factor against statics, ramps and linear programmes: blocks, a dam, a groove, a hub and a bracket."""

from dataclasses import replace

import numpy as np
import pytest
from boxes import Box, boxes_mesh
from dolfinx import mesh as dmesh
from mpi4py import MPI
from scenes import alone
from scipy.optimize import linprog
from spaces import CELLS
from test_pieces import scene_on

from signorini_fx.mechanics.mesh.tagged import tag_boundaries
from signorini_fx.records import Status
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

WEIGHT, LENGTH, HEIGHT = 3.0, 3.0, 2.0


def block(push, friction, *, ny=4, **more):
    """A heavy block that is pushed at half its height."""
    return parse_scene(
        {
            "mesh": {
                "generator": "rectangle",
                "parameters": {"length": LENGTH, "height": HEIGHT, "nx": 12, "ny": ny},
            },
            "material": {"young": 1e6, "poisson": 0.3},
            "body_force": {"y": -WEIGHT / (LENGTH * HEIGHT)},
            "traction": {"boundary": "left", "x": push / HEIGHT},
            "contact": {"boundary": "bottom", "friction": friction, **more},
        }
    )


COULOMB = {"law": "coulomb", "coefficient": 0.8}
ROUGH = {"law": "coulomb", "coefficient": 5.0}
TRESCA = {"law": "tresca", "bound": 1.0}


@pytest.mark.one_quick
@pytest.mark.parametrize(
    ("friction", "limit", "status", "motion"),
    [
        (COULOMB, 0.8 * WEIGHT, Status.SLIDES, "the translation along (1, 0)"),
        (ROUGH, WEIGHT * LENGTH / HEIGHT, Status.TIPS, "the rotation about (3, 0)"),
        (TRESCA, 1.0 * LENGTH, Status.SLIDES, "the translation along (1, 0)"),
    ],
    ids=["slides", "tips", "tresca"],
)
def test_factor_and_ramp_agree(friction, limit, status, motion):
    """The factor is the limit of statics, whatever the push was; just below it there is a solution, above none."""
    for push in (0.3 * limit, 0.7 * limit):
        safety = alone(block(push, friction)).safety
        assert safety.factor * push == pytest.approx(limit, rel=1e-9)
        assert safety.bound * push == pytest.approx(limit, rel=1e-9)
        assert safety.motion == motion
        assert safety.exact is (friction is TRESCA)
        assert (safety.friction_used is None) is safety.exact
    assert alone(block(0.998 * limit, friction)).safety.factor == pytest.approx(1 / 0.998, rel=1e-9)
    beyond = alone(block(1.002 * limit, friction), check=False)
    assert beyond.status is status
    assert beyond.safety is None


@pytest.mark.parametrize("depth", [0.2, 1e-3])
def test_a_block_on_a_plinth(depth):
    """Where the foundation is below the plinth the body would have to tip first: it does so over the edge at 2."""
    safety = alone(block(1.2, ROUGH, gap=f"0 if 0.99 <= x[0] <= 2.01 else {depth}")).safety
    assert safety.factor == pytest.approx(WEIGHT * 0.5 / (1.2 * HEIGHT / 2), rel=1e-6)
    assert safety.motion == "the rotation about (2, 0)"


@pytest.mark.parametrize("pushes", [(0.1, 0.2), (0.2, 0.1)])
def test_of_several_pieces_the_weakest_counts(pushes):
    """Each slides at its own limit."""
    boxes = [Box("one", 0.0, 0.0, 1.0, 1.0, 2, 2), Box("other", 2.0, 0.0, 1.0, 1.0, 2, 2)]
    tractions = [{"boundary": f"left {box.name}", "x": push} for box, push in zip(boxes, pushes, strict=True)]
    contact = [{"boundary": f"bottom {box.name}", "friction": COULOMB} for box in boxes]
    weight = {"y": -1.0, "live": False}
    scene = scene_on(boxes_mesh(MPI.COMM_SELF, boxes), body_force=weight, traction=tractions, contact=contact)
    safety = alone(scene).safety
    assert safety.factor == pytest.approx(0.8 / 0.2, rel=1e-6)
    assert safety.friction_used == pytest.approx(0.2 / 0.8, rel=1e-6)  # of the piece that uses most of it
    assert (safety.sliding, safety.overturning) == (pytest.approx(0.8 / 0.2), pytest.approx(0.5 / (0.2 * 0.5)))


def hub(torque, **solver):
    """A ring pressed onto a shaft that turns it."""
    return parse_scene(
        {
            "mesh": {"generator": "ring", "parameters": {"nr": 2, "nt": 4, "nz": 1}},
            "material": {"young": 1e5, "poisson": 0.3},
            "displacement": {"boundary": "bottom", "z": 0.0},
            "traction": {"boundary": "outer", "x": f"{-torque} * x[1]", "y": f"{torque} * x[0]"},
            "contact": {"boundary": "inner", "gap": -1e-3, "friction": {"law": "coulomb", "coefficient": 0.3}},
            "solver": solver,
        }
    )


def dam(friction):
    """A dam of concrete, upright on the side of the water that presses it, as wide as high at its foot."""
    mesh = dmesh.create_rectangle(MPI.COMM_SELF, [(0.0, 0.0), (3.0, 4.0)], (12, 12), dmesh.CellType.quadrilateral)
    x = mesh.geometry.x
    x[:, 0] *= 1 - x[:, 1] / 6  # a crest of 1
    own = tag_boundaries(mesh, {"left": "x[0] < 1e-9", "bottom": "x[1] < 1e-9"})
    return parse_scene(
        {
            "mesh": own,
            "material": {"young": 1e4, "poisson": 0.2},
            "body_force": {"y": -2.4},
            "traction": {"boundary": "left", "x": "4 - x[1]"},
            "contact": {"boundary": "bottom", "friction": {"law": "coulomb", "coefficient": friction}},
        }
    )


@pytest.mark.parametrize(
    ("friction", "motion"), [(0.8, "the translation along (1, 0)"), (2.0, "the rotation about (3, 0)")]
)
def test_a_dam(friction, motion):
    """It weighs 2.4 times 8 at 13/12 from the water, which presses with 8 at a third of its height of 4."""
    slides, tips = friction * 2.4 * 8 / 8, 2.4 * 8 * (3 - 13 / 12) / (8 * 4 / 3)
    safety = alone(dam(friction)).safety
    assert safety.factor == pytest.approx(min(slides, tips), rel=1e-9)
    assert safety.bound == pytest.approx(min(slides, tips), rel=1e-9)
    assert (safety.sliding, safety.overturning) == (pytest.approx(slides), pytest.approx(tips))
    assert safety.motion == motion
    assert safety.friction_used == pytest.approx(1 / min(slides, tips), rel=1e-6)


FRICTION, PULL = 0.2, 0.1
UPRIGHT = np.eye(3)
DOWN, ALONG = -UPRIGHT[2], UPRIGHT[0]


def groove(*, comm=MPI.COMM_SELF, turn=UPRIGHT, length=1.0, stress=1.0, materials=1, law="coulomb", counts=(6, 4, 2)):
    """A wedge in a groove with walls of slope 2, pressed into it by its weight and pulled along it.

    Args:
        comm: the ranks.
        turn: an orthogonal matrix, which may be a reflection.
        length: the unit of length, in those of the scene.
        stress: the unit of stress.
        materials: their number.
        law: of friction.
        counts: cells along, across and upwards.
    """
    mesh = dmesh.create_box(comm, [(0.0, -1.0, 0.0), (3.0, 1.0, 1.0)], counts, CELLS["hexahedra"])
    x = mesh.geometry.x
    x[:, 1] *= 0.5 + 0.5 * x[:, 2]
    ends = {"left": (ALONG, 0.0), "top": (-DOWN, 1.0)}
    walls = {name: (np.array([0.0, side, -0.5]), 0.5) for name, side in (("front", -1.0), ("back", 1.0))}
    marks = {
        name: lambda x, axis=turn @ axis, far=far: np.abs(axis @ x / length - far) < 1e-9
        for name, (axis, far) in {**ends, **walls}.items()
    }
    x[:] = length * x @ turn.T
    own = tag_boundaries(mesh, marks)
    young = [1e3 * 10.0**k * stress for k in range(materials)]
    if materials > 1:
        known = mesh.topology.index_map(3)
        cells = np.arange(known.size_local + known.num_ghosts, dtype=np.int32)
        which = 1 + (dmesh.compute_midpoints(mesh, 3, cells) @ turn @ ALONG > 1.3 * length).astype(np.int32)
        tags = dmesh.meshtags(mesh, 3, cells, which)
        own = replace(own, cell_tags=tags, regions={"a": 1, "b": 2})
    weight, pull = stress / length * turn @ DOWN, PULL * stress * turn @ ALONG
    friction = {"law": "coulomb", "coefficient": FRICTION} if law == "coulomb" else {"law": law, "bound": 0.1 * stress}
    return parse_scene(
        {
            "mesh": own,
            "material": [
                {"young": one, "poisson": 0.3, **({"region": name} if materials > 1 else {})}
                for one, name in zip(young, "ab", strict=False)
            ],
            "body_force": dict(zip("xyz", weight.tolist(), strict=True)),
            "traction": {"boundary": "left", **dict(zip("xyz", pull.tolist(), strict=True))},
            "contact": [{"boundary": name, "friction": friction} for name in walls],
        }
    )


def programme(nodes, forces, *, outer):
    """The largest multiple of the second of two forces that nodes with friction balance, by a linear programme.

    Args:
        nodes: position, outward normal, coefficient and given bound of friction (a force) of each.
        forces: two lists of pairs (force, its point).
        outer: whether discs are replaced by polygons around them, or within them.
    """
    sides = 64
    columns, rows, limits = [], [], []
    for number, (place, normal, coefficient, given) in enumerate(nodes):
        first, second = np.linalg.svd(normal[None])[2][1:]
        angles = 2 * np.pi * np.arange(sides) / sides
        around = np.outer(np.cos(angles), first) + np.outer(np.sin(angles), second)
        for force in (-normal, *(around / np.cos(np.pi / sides) if outer else around)):
            columns.append((*force, *np.cross(place, force)))
        row = np.zeros(len(nodes) * (sides + 1))
        begin = number * (sides + 1)
        row[begin], row[begin + 1 : begin + 1 + sides] = -coefficient, 1.0
        rows.append(row)
        limits.append(given)
    dead, live = (sum(np.append(force, np.cross(place, force)) for force, place in some) for some in forces)
    found = linprog(
        np.append(np.zeros(len(columns)), -1.0),
        A_ub=np.column_stack((rows, np.zeros(len(rows)))),
        b_ub=limits,
        A_eq=np.column_stack((np.transpose(columns), live)),
        b_eq=-dead,
    )
    return -found.fun


def nodes_of(solution, *, present):
    """The nodes for ``programme``, from the table: with their coefficient, or with the bounds of the solution."""
    columns = solution.table.columns
    bounds = columns["weight"] * columns["bound"]
    places = np.column_stack([columns[axis] for axis in "xyz"])
    normals = np.column_stack([columns[f"n_{axis}"] for axis in "xyz"])
    zero = np.zeros_like(bounds)
    coefficients = zero if present else zero + FRICTION
    return list(zip(places, normals, coefficients, bounds if present else zero, strict=True))


def check_between_programmes(solution, forces):
    """The factor, and the friction in use, are between those of the two polygons, which are near to each other."""
    safety = solution.safety
    for present in (False, True):
        nodes = nodes_of(solution, present=present)
        low, high = (programme(nodes, forces, outer=outer) for outer in (False, True))
        assert low < high < 1.01 * low
        found, bound = (1 / safety.friction_used,) * 2 if present else (safety.factor, safety.bound)
        assert low * (1 - 1e-7) <= bound
        assert found <= high * (1 + 1e-7)


@pytest.mark.slow
def test_a_wedge_in_a_groove():
    """A friction across the groove that pulls the wedge in lets it press more: W F / sqrt(sin^2 - F^2 cos^2)."""
    solution = alone(groove())
    weight, pull = 3 * 1.5, 1.5 * PULL
    sine, cosine = np.array([1.0, 2.0]) / np.sqrt(5)
    limit = weight * FRICTION / np.sqrt(sine**2 - (FRICTION * cosine) ** 2) / pull
    safety = solution.safety
    assert safety.factor == pytest.approx(limit, rel=1e-9)
    assert safety.bound == pytest.approx(limit, rel=1e-6)
    assert safety.motion == "the translation along (1, 0, 0)"
    assert (safety.sliding, safety.overturning) == (pytest.approx(limit, rel=1e-6), np.inf)
    centre = np.array([1.5, 0.0, 1.25 / 3 / 0.75])
    end = np.array([0.0, 0.0, 1.25 / 3 / 0.75])
    check_between_programmes(solution, [[(weight * DOWN, centre)], [(pull * ALONG, end)]])


TURN = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]


@pytest.mark.one_quick
@pytest.mark.mpi
@pytest.mark.parametrize(
    ("changes", "law", "materials"),
    [
        ({}, "coulomb", 2),
        ({"length": 1e-3, "stress": 1e6}, "tresca", 1),
        ({"length": 1e9}, "coulomb", 1),
        ({"stress": 1e-9}, "coulomb", 2),
        ({"turn": np.diag([1.0, -1.0, 1.0])}, "tresca", 2),
        ({"turn": np.diag([-1.0, 1.0, 1.0])}, "coulomb", 1),
        ({"turn": TURN}, "tresca", 1),
        ({"turn": -TURN, "length": 1e3, "stress": 1e-3}, "coulomb", 2),
    ],
    ids=["ranks", "mm", "lengths", "stresses", "across", "along", "turned", "turned, units"],
)
def test_figures_do_not_depend_on_the_view(changes, law, materials):
    """Units, ranks, reflections and rotations of skew walls change nothing, with several materials too."""
    reference = alone(groove(law=law, materials=materials)).safety
    found = solve(groove(comm=MPI.COMM_WORLD, law=law, materials=materials, **changes), MPI.COMM_WORLD).safety
    assert found.factor == pytest.approx(reference.factor, rel=1e-9)
    assert found.exact is (law == "tresca")
    if law == "coulomb":
        assert found.factor == pytest.approx(alone(groove()).safety.factor, rel=1e-9)
        assert found.friction_used == pytest.approx(reference.friction_used, rel=1e-9)
