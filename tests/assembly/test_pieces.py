"""Bodies in several pieces: which pieces there are, how they can move without strain, and that each
is solved right.

The oracles share nothing with what they judge: the null space of the assembled stiffness matrix,
and each piece solved alone as a body of one piece.
"""

import numpy as np
import pytest
from boxes import Box, boxes_mesh, scene_on
from mpi4py import MPI
from scene_tables import circle_shape, coulomb_friction, fixed, plane_shape, tresca_friction
from scenes import table_of

from signorini_fx import MeshError
from signorini_fx.mechanics.assembly.pieces import find_pieces
from signorini_fx.mechanics.body.discretisation import prepare
from signorini_fx.records import Status, Timings
from signorini_fx.scenes.solver import solve

WORLD = MPI.COMM_WORLD
UPPER, LOWER = Box("upper", 0.0, 1.0, 2.0, 1.0, 6, 3), Box("lower", 0.5, 0.0, 1.0, 1.0, 4, 4)
BESIDE = Box("beside", 2.0, 2.0, 1.0, 1.5)
# --- which pieces there are -----------------------------------------------------------------------


@pytest.mark.mpi
@pytest.mark.parametrize("quadrilaterals", [True, False])
def test_pieces_are_the_same_on_every_rank(quadrilaterals):
    """Pieces apart: numbers of cells and places, whatever the number of ranks."""
    mesh = boxes_mesh(WORLD, [BESIDE, LOWER, UPPER], quadrilaterals=quadrilaterals)
    pieces = find_pieces(mesh.mesh)
    cells = [18, 16, 16] if quadrilaterals else [36, 32, 32]
    assert pieces.cells.tolist() == cells
    assert pieces.bounds.tolist() == [[[0, 1], [2, 2]], [[0.5, 0], [1.5, 1]], [[2, 2], [3, 3.5]]]
    assert pieces.assembly.tolist() == [0, 1, 2]


@pytest.mark.mpi
def test_a_hinge_is_refused():
    """By the place of the node that two pieces share, on all ranks alike."""
    mesh = boxes_mesh(WORLD, [BESIDE, LOWER, UPPER], joined={(2.0, 2.0)})
    with pytest.raises(MeshError, match=r"share only the node at \(2, 2\)"):
        find_pieces(mesh.mesh)


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("floor", "slope"),  # the slope of the foundation at the nodes
    [
        ({"gap": 0.01}, 0.0),
        ({"foundation": plane_shape([0.0, -0.01], [0.0, 1.0])}, 0.0),
        ({"foundation": circle_shape([1.0, -100.01], 100.0)}, 0.01),
    ],
)
def test_fewer_cells_than_ranks(floor, slope):
    """A rank without cells takes part, and says the same, also where a shape is looked for in the
    body.
    """
    mesh = boxes_mesh(WORLD, [Box("only", 0.0, 0.0, 2.0, 1.0, 1, 1)])
    scene = scene_on(
        mesh,
        displacement=[fixed("left only", "x")],
        traction=[{"boundary": "top only", "y": -5.0}],
        contact=[{"boundary": "bottom only", **floor}],
    )
    solution = solve(scene, WORLD, check=False)
    assert all(other == solution.findings for other in WORLD.allgather(solution.findings))
    pieces, deformation = solution.model.motions.pieces, solution.steps[-1].deformation
    assert pieces.cells.tolist() == [1]
    assert all(other is solution.status for other in WORLD.allgather(solution.status))
    assert all(other == deformation for other in WORLD.allgather(deformation))
    assert solution.converged
    along, upwards = solution.contact.forces[0]
    assert upwards == pytest.approx(10.0, abs=1e-9)
    assert abs(along) <= 10.0 * slope + 1e-9


# --- motions without strain -----------------------------------------------------------------------


def random_bodies(rng):
    """Boxes in a staircase, some sides of them prescribed."""
    boxes, supports = [], []
    x = y = 0.0
    for k in range(int(rng.integers(1, 6))):
        width, height = rng.uniform(0.5, 2.0, 2)
        boxes.append(Box(f"b{k}", x, y, width, height, *map(int, rng.integers(1, 4, 2))))
        x, y = boxes[-1].corners[2]
        for side in ("left", "bottom"):
            components = {key: 0.0 for key in ("x", "y") if rng.random() < 0.25}
            if components:
                supports.append({"boundary": f"{side} b{k}", **components})
    return boxes, supports


# --- each piece is solved right -------------------------------------------------------------------

LINEAR_ALGEBRA = ["full", "condensed", "krylov"]


def two_pieces(comm, **effects):
    """A body held and pressed onto another one of which the mesh knows nothing: no node is
    shared.
    """
    mesh = boxes_mesh(comm, [UPPER, LOWER])
    return scene_on(
        mesh,
        displacement=[fixed("left upper", "x")],
        traction=[{"boundary": "top upper", "y": -5.0}],
        **effects,
    )


@pytest.mark.mpi
@pytest.mark.one_quick("linear_algebra", LINEAR_ALGEBRA)
@pytest.mark.parametrize("algorithm", ["ssn", "alm", "path-following"])
@pytest.mark.parametrize("gap", [0.0, 0.01])
def test_a_piece_that_nothing_holds(linear_algebra, algorithm, gap):
    """Said by name, before anything is solved."""
    scene = two_pieces(
        WORLD,
        contact=[{"boundary": "bottom upper", "gap": gap}],
        solver={"algorithm": algorithm, "linear_algebra": linear_algebra},
    )
    solution = solve(scene, WORLD, check=False)
    assert solution.status is Status.NOT_HELD
    assert solution.history.linear_solves == 0
    kind = "krylov" if linear_algebra == "krylov" else "full"
    assert solution.linear_algebra.startswith(kind)  # the interior of such a body has no inverse
    (warning,) = [f.message for f in solution.findings if f.level == "warning"]
    assert warning.startswith("nothing holds piece 2 of 2 (16 cells, x[0] 0.5 to 1.5, x[1] 0 to 1)")
    assert "translations and rotations" in warning


def random_piece(rng, name, place):
    """A box on a foundation of its own: held by supports, by contact alone, by friction, by both,
    or not at all.
    """
    width, height = rng.uniform(0.6, 2.0, 2)
    box = Box(
        name, place, float(rng.uniform(0.0, 3.0)), width, height, *map(int, rng.integers(3, 7, 2))
    )
    kind = rng.choice(
        ["support", "sides", "friction", "rough", "nothing"], p=[0.25, 0.25, 0.2, 0.2, 0.1]
    )
    press, push = -float(rng.uniform(1.0, 10.0)), float(rng.choice([0.0, 0.3]))
    effects = {
        "traction": [{"boundary": f"top {name}", "x": push, "y": press}],
        "displacement": [],
        "contact": [],
    }
    if kind in ("support", "sides"):
        components = {"x": 0.0, "y": 0.0} if kind == "support" else {"x": 0.0}
        effects["displacement"] = [{"boundary": f"left {name}", **components}]
    if kind in ("sides", "friction", "rough"):
        friction = {"friction": coulomb_friction(0.6)} if kind == "rough" else {}
        if kind == "friction":
            friction = {"friction": tresca_friction(1.0)}
        gap = float(rng.choice([0.0, 0.01, 0.1]))
        effects["contact"] = [{"boundary": f"bottom {name}", "gap": gap, **friction}]
    return box, effects


@pytest.mark.mpi
@pytest.mark.one_quick("seed", range(16))
def test_pieces_together_are_as_each_alone(seed):
    """Pieces that share nothing: the same outcome, pressure, shear and energy as each of them
    alone.
    """
    rng = np.random.default_rng(100 + seed)
    bodies = [random_piece(rng, f"b{k}", 3.0 * k) for k in range(int(rng.integers(2, 5)))]
    solver = {
        "algorithm": ["ssn", "alm"][seed % 2],
        "linear_algebra": LINEAR_ALGEBRA[seed % 3] if WORLD.size == 1 else "auto",
        "gamma_n": 1e7,
        "gamma_t": 1e7,
    }
    alone = [
        solve(
            scene_on(boxes_mesh(MPI.COMM_SELF, [box]), solver=solver, **effects),
            MPI.COMM_SELF,
            check=False,
        )
        for box, effects in bodies
    ]
    merged = {key: [e for _, effects in bodies for e in effects[key]] for key in bodies[0][1]}
    mesh = boxes_mesh(WORLD, [box for box, _ in bodies])
    together = solve(scene_on(mesh, solver=solver, **merged), WORLD, check=False)
    outcomes = {one.status for one in alone} - {Status.CONVERGED}
    assert together.status in (outcomes or {Status.CONVERGED})
    if outcomes:
        return
    energy = sum(one.steps[-1].strain_energy for one in alone)
    assert together.steps[-1].strain_energy == pytest.approx(energy, rel=1e-8)
    tables = [table_of(one).columns for one in alone if one.contact is not None]
    if tables:
        found = table_of(together).columns
        for name in ("x", "pressure", "shear", "u_n"):
            wanted = np.concatenate([table[name] for table in tables])
            scale = max(np.abs(wanted).max(), 1e-3)
            np.testing.assert_allclose(found[name], wanted, rtol=0, atol=1e-7 * scale)


# --- held or not ----------------------------------------------------------------------------------


def dense_of(d, law):
    """The stiffness of the whole body, and rows that contact adds: normals, and tangents where
    there is friction.
    """
    rows = np.arange(d.dofs, dtype=np.int32)
    matrix, boundary = d.stiffness.getValues(rows, rows), d.boundary
    held = [boundary.normal, boundary.tangents[:, :, 0]] if law else [boundary.normal]
    traces = np.zeros((len(held) * boundary.size, d.dofs))
    for number, direction in enumerate(held):
        for component in range(2):
            here = (
                np.arange(boundary.size) + number * boundary.size,
                2 * boundary.nodes + component,
            )
            traces[here] = direction[:, component] * boundary.free[:, component]
    return matrix, traces


def random_row(seed):
    """Boxes, supports and contact at random: their mesh on some ranks, and the effects."""
    rng = np.random.default_rng(1000 + seed)
    boxes, supports = random_bodies(rng)
    friction = {"friction": tresca_friction(5.0)} if seed % 2 else {}
    chosen = [box.name for box in boxes if rng.random() < 0.8] or [boxes[0].name]
    effects = {
        "displacement": [
            support for support in supports if not support["boundary"].startswith("bottom")
        ],
        "contact": [{"boundary": f"bottom {name}", **friction} for name in chosen],
        "traction": [
            {"boundary": f"top {box.name}", "y": -float(rng.uniform(0.5, 2.0))} for box in boxes
        ],
    }
    return lambda comm: scene_on(boxes_mesh(comm, boxes), **effects)


def regular(scene):
    """Whether the matrix of all unknowns, with contact and stick at every node, has no null
    space.
    """
    d = prepare(scene.statement, scene.mesh, Timings())
    matrix, traces = dense_of(d, law=any(contact.friction.acts for contact in scene.contact))
    values = np.linalg.eigvalsh(matrix + 1000.0 * traces.T @ traces)
    return values[0] > 1e-9 * values[-1]


@pytest.mark.mpi
@pytest.mark.one_quick("seed", range(24))
def test_random_boxes_are_held_or_not(seed):
    """Held is what no singular matrix denies; where a solution is found, it is in equilibrium."""
    scene_of = random_row(seed)
    held = regular(scene_of(MPI.COMM_SELF))
    solution = solve(scene_of(WORLD), WORLD, check=False)
    assert (solution.status is not Status.NOT_HELD) == held
    if not held:
        assert solution.history.linear_solves == 0
        warnings = [f.message for f in solution.findings if f.level == "warning"]
        assert any("nothing holds" in message for message in warnings)
    if solution.converged:
        assert solution.certificate.equilibrium < 1e-9
