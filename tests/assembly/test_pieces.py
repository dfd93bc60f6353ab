"""Bodies in several pieces: which pieces there are, how they can move without strain, and that each is solved right.

The oracles share nothing with what they judge: the null space of the assembled stiffness matrix, and each piece solved
alone as a body of one piece.
"""

from dataclasses import replace

import numpy as np
import pytest
from boxes import Box, boxes_mesh
from dolfinx import fem
from mpi4py import MPI
from scenes import rectangle, table_of

from signorini_fx.algebra.contact.statics import no_balance
from signorini_fx.errors import MeshError
from signorini_fx.mechanics.assembly.pieces import MOST_PIECES, find_pieces
from signorini_fx.mechanics.body.deformation import deformation_of
from signorini_fx.mechanics.body.discretisation import discretise
from signorini_fx.mechanics.mesh.tagged import tag_boundaries
from signorini_fx.records import History, Status, Timings
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve
from signorini_fx.solving.solve_on_mesh import contact_task

WORLD = MPI.COMM_WORLD
UPPER, LOWER = Box("upper", 0.0, 1.0, 2.0, 1.0, 6, 3), Box("lower", 0.5, 0.0, 1.0, 1.0, 4, 4)
BESIDE = Box("beside", 2.0, 2.0, 1.0, 1.5)
# The mesh is given in Python; a scene as a dictionary needs one all the same.
MESH = {"generator": "rectangle", "parameters": {"length": 1.0, "height": 1.0, "nx": 1, "ny": 1}}


def scene_on(mesh, **effects):
    """A scene on a mesh of one's own."""
    data = {"mesh": MESH, "material": {"young": 1000.0, "poisson": 0.3}, **effects}
    return parse_scene(data).model_copy(update={"mesh": mesh})


# --- which pieces there are ------------------------------------------------------------------------------------------


@pytest.mark.mpi
@pytest.mark.parametrize("quadrilaterals", [True, False])
def test_pieces_are_the_same_on_every_rank(quadrilaterals):
    """Pieces apart, one joined at a corner: numbers of cells, places, pins, whatever the number of ranks."""
    mesh = boxes_mesh(WORLD, [BESIDE, LOWER, UPPER], joined={(2.0, 2.0)}, quadrilaterals=quadrilaterals)
    pieces = find_pieces(mesh.mesh)
    cells = [18, 16, 16] if quadrilaterals else [36, 32, 32]
    assert pieces.cells.tolist() == cells
    assert pieces.bounds.tolist() == [[[0, 1], [2, 2]], [[0.5, 0], [1.5, 1]], [[2, 2], [3, 3.5]]]
    assert {tuple(sorted(pair)) for pair in pieces.pins.tolist()} == {(0, 2)}
    assert np.unique(pieces.pin_points, axis=0).tolist() == [[2.0, 2.0]]
    assert pieces.assembly[0] == pieces.assembly[2] != pieces.assembly[1]
    assert [row["joined_to"] for row in pieces.as_rows()] == [[3], [], [1]]


@pytest.mark.mpi
def test_one_piece():
    """The usual body, cut by the ranks but whole."""
    pieces = find_pieces(rectangle(WORLD, length=3.0, height=1.0, nx=17, ny=5).mesh)
    assert pieces.count == 1
    assert pieces.cells.tolist() == [85]
    assert pieces.pins.size == 0
    assert not pieces.of_cell.any()


def test_a_chain_joined_at_corners():
    """A chequerboard of boxes that touch at corners alone: all in one assembly, each pin found."""
    boxes = [Box(f"b{k}", float(k), float(k), 1.0, 1.0, 2, 2) for k in range(5)]
    pieces = find_pieces(boxes_mesh(MPI.COMM_SELF, boxes, joined={box.corners[2] for box in boxes}).mesh)
    assert pieces.count == 5
    assert set(pieces.assembly) == {0}
    assert {tuple(sorted(pair)) for pair in pieces.pins.tolist()} == {(k, k + 1) for k in range(4)}


def test_cells_that_share_no_nodes():
    """A mesh that is no body at all is refused in one sentence, before anything of its size squared is made."""
    boxes = [Box(str(k), float(k), 0.0, 1.0, 1.0, 1, 1) for k in range(MOST_PIECES + 1)]
    with pytest.raises(MeshError, match=r"falls into 201 pieces .* do not share their nodes"):
        find_pieces(boxes_mesh(MPI.COMM_SELF, boxes).mesh)


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("floor", "slope"),  # the slope of the foundation at the nodes
    [
        ({"gap": 0.01}, 0.0),
        ({"foundation": {"shape": "plane", "point": [0.0, -0.01], "normal": [0.0, 1.0]}}, 0.0),
        ({"foundation": {"shape": "circle", "centre": [1.0, -100.01], "radius": 100.0}}, 0.01),
    ],
)
def test_fewer_cells_than_ranks(floor, slope):
    """A rank without cells takes part, and says the same, also where a shape is looked for in the body."""
    mesh = boxes_mesh(WORLD, [Box("only", 0.0, 0.0, 2.0, 1.0, 1, 1)])
    scene = scene_on(
        mesh,
        displacement=[{"boundary": "left only", "x": 0.0}],
        traction=[{"boundary": "top only", "y": -5.0}],
        contact=[{"boundary": "bottom only", **floor}],
    )
    solution = solve(scene, WORLD, check=False)
    assert all(other == solution.findings for other in WORLD.allgather(solution.findings))
    pieces, deformation = solution.model.motions.pieces, solution.steps[-1].deformation
    assert pieces.cells.tolist() == [1]
    assert all(other is solution.status for other in WORLD.allgather(solution.status))
    assert all(other == deformation for other in WORLD.allgather(deformation))
    assert solution.status is Status.CONVERGED
    along, upwards = solution.contact.forces[0]
    assert upwards == pytest.approx(10.0, abs=1e-9)
    assert abs(along) <= 10.0 * slope + 1e-9


def test_a_small_piece_has_not_far_to_go():
    """A travel is measured by the pieces that move together, not by what lies elsewhere."""
    small, large = Box("small", 0.0, 0.0, 0.3, 0.4, 2, 2), Box("large", 5.0, 0.0, 8.0, 6.0, 4, 4)
    mesh = boxes_mesh(MPI.COMM_SELF, [small, large])
    d = discretise(scene_on(mesh).statement, mesh, Timings())
    moved = fem.Function(d.space)
    moved.interpolate(lambda x: np.stack([np.where(x[0] < 1, 0.2, 1.0), 0 * x[0]]))
    assert deformation_of(d, moved, d.tagged.size).displacement == pytest.approx(0.2 / 0.5)


# --- motions without strain ------------------------------------------------------------------------------------------


def random_bodies(rng):
    """Boxes in a staircase, neighbours apart or joined at a corner, some sides of them prescribed."""
    boxes, joined, supports = [], set(), []
    x = y = 0.0
    for k in range(int(rng.integers(1, 6))):
        width, height = rng.uniform(0.5, 2.0, 2)
        boxes.append(Box(f"b{k}", x, y, width, height, *map(int, rng.integers(1, 4, 2))))
        x, y = boxes[-1].corners[2]
        if rng.random() < 0.6:
            joined.add((x, y))
        for side in ("left", "bottom"):
            components = {key: 0.0 for key in ("x", "y") if rng.random() < 0.25}
            if components:
                supports.append({"boundary": f"{side} b{k}", **components})
    return boxes, joined, supports


@pytest.mark.parametrize("seed", range(20))
def test_motions_are_the_null_space_of_the_stiffness(seed):
    """As many motions as the assembled matrix has zero eigenvalues, and each of them is in its null space."""
    boxes, joined, supports = random_bodies(np.random.default_rng(seed))
    mesh = boxes_mesh(MPI.COMM_SELF, boxes, joined=joined, quadrilaterals=bool(seed % 2))
    d = discretise(scene_on(mesh, displacement=supports).statement, mesh, Timings())
    rows, columns = (np.arange(d.dofs, dtype=np.int32),) * 2
    dense = d.stiffness.getValues(rows, columns)
    values = np.linalg.eigvalsh(dense)
    motions = np.reshape(
        [d.motions.displacement(one).ravel() for one in np.eye(d.motions.free.shape[1])], (-1, d.dofs)
    ).T
    assert motions.shape[1] == np.count_nonzero(values < 1e-9 * values[-1])
    assert np.abs(dense @ motions).max(initial=0.0) < 1e-10 * values[-1]
    assert np.linalg.svd(motions, compute_uv=False).min(initial=1.0) > 1e-3


@pytest.mark.mpi
@pytest.mark.parametrize("seed", range(6))
def test_motions_do_not_depend_on_the_ranks(seed):
    """The projector onto the motions, at the owned nodes, gives the same energy-free directions on all ranks."""
    boxes, joined, supports = random_bodies(np.random.default_rng(seed))
    free = []
    for comm in (WORLD, MPI.COMM_SELF):
        mesh = boxes_mesh(comm, boxes, joined=joined)
        motions = discretise(scene_on(mesh, displacement=supports).statement, mesh, Timings()).motions
        free.append((motions.free.shape, np.bincount(motions.assembly).tolist(), motions.pieces.cells.tolist()))
    assert free[0] == free[1]


# --- each piece is solved right --------------------------------------------------------------------------------------

LINEAR_ALGEBRA = ["full", "condensed", "krylov"]


def two_pieces(comm, **effects):
    """A body held and pressed onto another one of which the mesh knows nothing: no node is shared."""
    mesh = boxes_mesh(comm, [UPPER, LOWER])
    return scene_on(
        mesh,
        displacement=[{"boundary": "left upper", "x": 0.0}],
        traction=[{"boundary": "top upper", "y": -5.0}],
        **effects,
    )


@pytest.mark.one_quick
@pytest.mark.mpi
@pytest.mark.parametrize("linear_algebra", LINEAR_ALGEBRA)
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
    """A box on a foundation of its own: held by supports, by contact alone, by friction, by both, or not at all."""
    width, height = rng.uniform(0.6, 2.0, 2)
    box = Box(name, place, float(rng.uniform(0.0, 3.0)), width, height, *map(int, rng.integers(3, 7, 2)))
    kind = rng.choice(["support", "sides", "friction", "rough", "nothing"], p=[0.25, 0.25, 0.2, 0.2, 0.1])
    press, push = -float(rng.uniform(1.0, 10.0)), float(rng.choice([0.0, 0.3]))
    effects = {"traction": [{"boundary": f"top {name}", "x": push, "y": press}], "displacement": [], "contact": []}
    if kind in ("support", "sides"):
        components = {"x": 0.0, "y": 0.0} if kind == "support" else {"x": 0.0}
        effects["displacement"] = [{"boundary": f"left {name}", **components}]
    if kind in ("sides", "friction", "rough"):
        friction = {"friction": {"law": "coulomb", "coefficient": 0.6}} if kind == "rough" else {}
        if kind == "friction":
            friction = {"friction": {"law": "tresca", "bound": 1.0}}
        gap = float(rng.choice([0.0, 0.01, 0.1]))
        effects["contact"] = [{"boundary": f"bottom {name}", "gap": gap, **friction}]
    return box, effects


@pytest.mark.one_quick
@pytest.mark.mpi
@pytest.mark.parametrize("seed", range(16))
def test_pieces_together_are_as_each_alone(seed):
    """Pieces that share nothing: the same outcome, pressure, shear and energy as each of them alone."""
    rng = np.random.default_rng(100 + seed)
    bodies = [random_piece(rng, f"b{k}", 3.0 * k) for k in range(int(rng.integers(2, 5)))]
    solver = {
        "algorithm": ["ssn", "alm"][seed % 2],
        "linear_algebra": LINEAR_ALGEBRA[seed % 3] if WORLD.size == 1 else "auto",
        "gamma_n": 1e7,
        "gamma_t": 1e7,
    }
    alone = [
        solve(scene_on(boxes_mesh(MPI.COMM_SELF, [box]), solver=solver, **effects), MPI.COMM_SELF, check=False)
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


def test_the_cases_above_are_of_all_kinds():
    """Some scenes have a solution, some have a piece that nothing holds."""
    counts = []
    for seed in range(16):
        rng = np.random.default_rng(100 + seed)
        bodies = [random_piece(rng, f"b{k}", 3.0 * k) for k in range(int(rng.integers(2, 5)))]
        counts.append(sum(not (e["displacement"] or e["contact"]) for _, e in bodies))
    assert 4 <= sum(count == 0 for count in counts) <= 14


@pytest.mark.mpi
def test_each_piece_comes_to_rest_by_itself():
    """Pieces drop by their own gaps, also where one of them rests already, or cannot drop."""
    boxes = [Box(f"b{k}", 3.0 * k, 0.0, 2.0, 1.0, 3, 2) for k in range(4)]
    gaps = [0.01, 0.2, 0.0, 0.05]
    mesh = boxes_mesh(WORLD, boxes)
    contact = [{"boundary": f"bottom b{k}", "gap": gap} for k, gap in enumerate(gaps)]
    contact[3]["kind"] = "bilateral"
    scene = scene_on(
        mesh,
        displacement=[{"boundary": f"left b{k}", "x": 0.0} for k in range(4)],
        contact=contact,
        traction=[{"boundary": f"top b{k}", "y": -1.0} for k in range(4)],
    )
    d = discretise(scene.statement, mesh, Timings())
    rest = contact_task(d, History()).rest
    np.testing.assert_allclose(rest.u_n, np.array([0.01, 0.2, 0.0, 0.0])[d.boundary.part], atol=1e-14)
    np.testing.assert_allclose(rest.u_t, 0.0, atol=1e-14)
    field = d.from_rest(rest, d.unknowns(fem.Function(d.space)))
    lowest = d.boundary.traces(field.x.array.reshape(-1, 2)[d.boundary.nodes])[0]
    np.testing.assert_allclose(lowest, rest.u_n, atol=1e-14)


@pytest.mark.mpi
@pytest.mark.parametrize("algorithm", ["ssn", "alm"])
def test_a_squeezed_piece(algorithm):
    """A piece between two foundations, without a load, beside one that friction nearly does not hold: statics of both,
    and the pressure of uniaxial stress, E / (1 - nu^2) times the strain.
    """
    mesh = boxes_mesh(WORLD, [Box("pushed", 0.0, 0.0, 2.0, 1.0, 6, 3), Box("squeezed", 3.0, 0.0, 1.0, 1.0, 3, 3)])
    scene = scene_on(
        mesh,
        displacement=[{"boundary": "left squeezed", "x": 0.0}],
        traction=[{"boundary": "top pushed", "x": 0.55, "y": -1.0}],
        contact=[
            {"boundary": "bottom pushed", "friction": {"law": "coulomb", "coefficient": 0.6}},
            {"boundary": "bottom squeezed", "gap": -0.01},
            {"boundary": "top squeezed", "gap": -0.01},
        ],
        solver={"algorithm": algorithm, "gamma_n": 1e9, "gamma_t": 1e9},
    )
    solution = solve(scene, WORLD, check=False)
    assert solution.status is Status.CONVERGED
    exact, resultants = 1000.0 / (1 - 0.3**2) * 0.02, solution.resultants
    np.testing.assert_allclose(resultants.of("bottom pushed").force, [-1.1, 2.0], atol=1e-6)
    np.testing.assert_allclose(resultants.of("bottom squeezed").force, [0.0, exact], rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(resultants.of("top squeezed").force, [0.0, -exact], rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("loose", [0, 1])
def test_gaps_of_each_piece(loose):
    """Of two pieces between foundations, without a load, the one with clearance leaves its foundation."""
    boxes = [Box("one", 0.0, 0.0, 1.0, 1.0, 2, 2), Box("other", 2.0, 0.0, 1.0, 1.0, 3, 2)]
    mesh = boxes_mesh(MPI.COMM_SELF, boxes)
    contact = [
        {"boundary": f"{side} {box.name}", "gap": 0.01 if number == loose else -0.01}
        for number, box in enumerate(boxes)
        for side in ("bottom", "top")
    ]
    supports = [{"boundary": f"left {box.name}", "x": 0.0} for box in boxes]
    d = discretise(scene_on(mesh, displacement=supports, contact=contact).statement, mesh, Timings())
    task = contact_task(d, History())
    data, motions = task.start.data, task.motions
    lost = no_balance(None, data.bilateral, motions, np.zeros(motions.count), data.gap)
    members = task.motions.of_point[np.isin(d.boundary.part, [2 * loose, 2 * loose + 1])]
    assert (lost.status, {lost.assembly}) == (Status.OPEN, set(members))


# --- pieces joined at corners ----------------------------------------------------------------------------------------


@pytest.mark.mpi
@pytest.mark.parametrize("linear_algebra", LINEAR_ALGEBRA)
def test_a_hinge_is_a_mechanism(linear_algebra):
    """A piece joined to a held one at a single corner turns about it."""
    mesh = boxes_mesh(WORLD, [UPPER, BESIDE], joined={(2.0, 2.0)})
    scene = scene_on(
        mesh,
        displacement=[{"boundary": "left upper", "x": 0.0}],
        contact=[{"boundary": "bottom upper"}],
        traction=[{"boundary": "top upper", "y": -5.0}],
        solver={"linear_algebra": linear_algebra},
    )
    solution = solve(scene, WORLD, check=False)
    assert solution.status is Status.NOT_HELD
    assert solution.history.linear_solves == 0
    assert solution.model.motions.free.shape[1] == 2  # up and down, which contact holds; the hinge


@pytest.mark.mpi
@pytest.mark.parametrize("linear_algebra", LINEAR_ALGEBRA)
def test_a_hinge_that_a_support_holds(linear_algebra):
    """Statics: the block hangs on its hinge and a sliding support, whose force follows from the moments."""
    mesh = boxes_mesh(WORLD, [UPPER, BESIDE], joined={(2.0, 2.0)})
    scene = scene_on(
        mesh,
        displacement=[{"boundary": "left upper", "x": 0.0}, {"boundary": "right beside", "x": 0.0}],
        contact=[{"boundary": "bottom upper", "gap": 0.01}],
        traction=[{"boundary": "top upper", "y": -5.0}, {"boundary": "top beside", "y": -1.0}],
        solver={"linear_algebra": linear_algebra},
    )
    solution = solve(scene, WORLD, check=False)
    assert solution.status is Status.CONVERGED
    contact_force, _ = solution.contact.forces
    np.testing.assert_allclose(contact_force, [0.0, 11.0], atol=1e-9)


@pytest.mark.parametrize("seed", range(8))
def test_a_chain_on_a_foundation(seed):
    """Boxes joined at corners, pressed onto contact with friction at both ends: equilibrium holds the loads' sum."""
    rng = np.random.default_rng(seed)
    press = rng.uniform(1.0, 5.0, 2)
    left, right = Box("left", 0.0, 0.0, 1.0, 1.0), Box("right", 1.0, 1.0, 1.5, 1.0)
    mesh = boxes_mesh(MPI.COMM_SELF, [left, right], joined={(1.0, 1.0)})
    friction = {"law": "coulomb", "coefficient": 0.5}
    scene = scene_on(
        mesh,
        contact=[
            {"boundary": "bottom left", "friction": friction, "gap": 0.001},
            {"boundary": "bottom right", "gap": 0.002 * float(rng.random())},
        ],
        traction=[{"boundary": "top left", "y": -press[0]}, {"boundary": "top right", "y": -press[1]}],
    )
    solution = solve(scene, MPI.COMM_SELF, check=False)
    assert solution.status is Status.CONVERGED
    assert solution.certificate.holds
    contact_force, friction_force = solution.contact.forces
    np.testing.assert_allclose(contact_force + friction_force, [0.0, press[0] + 1.5 * press[1]], atol=1e-8)


def dense_of(d, law):
    """The stiffness of the whole body, and rows that contact adds: normals, and tangents where there is friction."""
    rows = np.arange(d.dofs, dtype=np.int32)
    matrix, boundary = d.stiffness.getValues(rows, rows), d.boundary
    held = [boundary.normal, boundary.tangents[:, :, 0]] if law else [boundary.normal]
    traces = np.zeros((len(held) * boundary.size, d.dofs))
    for number, direction in enumerate(held):
        for component in range(2):
            here = (np.arange(boundary.size) + number * boundary.size, 2 * boundary.nodes + component)
            traces[here] = direction[:, component] * boundary.free[:, component]
    return matrix, traces


def random_chain(seed):
    """Boxes apart and joined, supports and contact at random: their mesh on some ranks, and the effects."""
    rng = np.random.default_rng(1000 + seed)
    boxes, joined, supports = random_bodies(rng)
    friction = {"friction": {"law": "tresca", "bound": 5.0}} if seed % 2 else {}
    chosen = [box.name for box in boxes if rng.random() < 0.8] or [boxes[0].name]
    effects = {
        "displacement": [support for support in supports if not support["boundary"].startswith("bottom")],
        "contact": [{"boundary": f"bottom {name}", **friction} for name in chosen],
        "traction": [{"boundary": f"top {box.name}", "y": -float(rng.uniform(0.5, 2.0))} for box in boxes],
    }
    return lambda comm: scene_on(boxes_mesh(comm, boxes, joined=joined), **effects)


def regular(scene):
    """Whether the matrix of all unknowns, with contact and stick at every node, has no null space."""
    d = discretise(scene.statement, scene.mesh, Timings())
    matrix, traces = dense_of(d, law=scene.statement.has_friction)
    values = np.linalg.eigvalsh(matrix + 1000.0 * traces.T @ traces)
    return values[0] > 1e-9 * values[-1]


@pytest.mark.one_quick
@pytest.mark.mpi
@pytest.mark.parametrize("seed", range(24))
def test_random_chains_are_held_or_not(seed):
    """Held is what no singular matrix denies; where a solution is found, it is in equilibrium."""
    scene_of = random_chain(seed)
    held = regular(scene_of(MPI.COMM_SELF))
    solution = solve(scene_of(WORLD), WORLD, check=False)
    assert (solution.status is not Status.NOT_HELD) == held
    if not held:
        assert solution.history.linear_solves == 0
        warnings = [f.message for f in solution.findings if f.level == "warning"]
        assert any("nothing holds" in message for message in warnings)
    if solution.converged:
        assert solution.certificate.equilibrium < 1e-9


def test_the_chains_above_are_of_both_kinds():
    """Held and not held, neither of them seldom."""
    assert 6 <= sum(regular(random_chain(seed)(MPI.COMM_SELF)) for seed in range(24)) <= 18


def test_a_mesh_of_ones_own_in_pieces():
    """Also a dolfinx mesh made in Python is looked at."""
    mesh = boxes_mesh(MPI.COMM_SELF, [UPPER, LOWER]).mesh
    tagged = tag_boundaries(mesh, {"left": lambda x: np.isclose(x[0], 0.0)})
    scene = scene_on(tagged, displacement=[{"boundary": "left", "x": 0.0, "y": 0.0}])
    assert solve(scene, MPI.COMM_SELF, check=False).status is Status.NOT_HELD


def test_another_boundary():
    """A copy with other contact points takes nothing over that was computed of those before."""
    held = {"boundary": "top", "x": 0.0, "y": 0.0}
    scene = scene_on(rectangle(nx=2, ny=2), displacement=held, contact={"boundary": "bottom"})
    d = discretise(scene.statement, scene.mesh, Timings())
    moved = replace(d, boundary=replace(d.boundary, x=d.boundary.x + 1.0))
    assert replace(d, statement=scene.statement).contact is d.contact
    assert moved.contact is not d.contact
    assert d.contact is replace(d).contact
