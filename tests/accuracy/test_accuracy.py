"""An accuracy that is asked for is reached, or the budget ends by name."""

from pathlib import Path

import numpy as np
import pytest
from corner_scenes import QUANTITIES, Block
from corner_scenes import reference as corner_reference
from mesh_files import write_msh
from mpi4py import MPI
from reference import Reference, divided
from scene_tables import coulomb_friction, fixed, rectangle_mesh
from scenes import alone, example1, on_mesh, rectangle

from signorini_fx.errors import MeshError, SceneError
from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.statement.mesh_sources import MeshGenerator
from signorini_fx.mechanics.statement.settings import Accuracy
from signorini_fx.records import History, IterationRecord, Status
from signorini_fx.results.accuracy.convergence_table import predict
from signorini_fx.results.summary import lines_of, summary_of
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.mesh_sequence import meshes_of, planned
from signorini_fx.scenes.reading import parse_scene, read_scene
from signorini_fx.scenes.solver import solve
from signorini_fx.solving import to_accuracy

SCENES = Path(__file__).parents[2] / "demos" / "scenes"
FRICTION = {"tresca": {"bound": 1.5}, "coulomb": {"coefficient": 0.3}}


def asked(friction, **goal):
    """Example 1 with gamma left to the program, asked for an accuracy."""
    scene = example1(**FRICTION[friction], gamma="auto", nx=120, ny=40)
    return scene.model_copy(update={"accuracy": Accuracy(**goal)})


@pytest.fixture(scope="module", params=sorted(FRICTION))
def reference(request):
    """A solution without regularisation on a much finer mesh."""
    return request.param, solve(
        example1(**FRICTION[request.param], nx=240, ny=80, algorithm="alm")
    ).table.columns


@pytest.mark.slow
@pytest.mark.parametrize(
    ("of", "targets"), [("energy", (1e-1, 1e-2, 2e-3)), ("pressure", (1e-1, 1e-2, 3e-3))]
)
def test_true_error_on_the_meshes_that_the_program_chooses(with_reference, of, targets):
    """Displacement and pressure on triangles of degree 2, refined where the error is: met, and with
    few unknowns.
    """
    friction, fine = with_reference
    for target, most in zip(targets, (3_000, 20_000, 60_000), strict=True):
        solution = alone(asked(friction, target=target, of=of))
        assert fine.errors(solution)[of] <= target
        assert solution.model.dofs < most


@pytest.fixture(scope="module", params=sorted(FRICTION))
def with_reference(request):
    """A reference of much higher accuracy, of displacement too."""
    scene = example1(**FRICTION[request.param], nx=120, ny=40)
    return request.param, Reference(divided(scene, 2.0, 60_000)[-1])


def test_nodes_where_loads_jump_are_kept():
    """The first mesh is part of the scene's own; one that cannot be halved is where it begins."""
    for (nx, ny), (coarse_nx, coarse_ny) in (
        ((120, 40), (15, 5)),
        ((60, 20), (15, 5)),
        ((45, 15), (45, 15)),
    ):
        scene = example1(bound=1.5, nx=nx, ny=ny)
        first = meshes_of(scene, Accuracy(target=0.1), MPI.COMM_SELF, History()).problem.scene
        assert first.mesh.parameters["nx"] == coarse_nx
        assert first.mesh.parameters["ny"] == coarse_ny


@pytest.mark.one_quick("target", [1e-2, 1e-3])
def test_peak(reference, target):
    """The same for the largest pressure."""
    friction, fine = reference
    solution = solve(asked(friction, target=target, of="peak"))
    assert abs(solution.table.columns["pressure"].max() / fine["pressure"].max() - 1) <= target


def test_gamma_is_raised_where_it_is_in_the_way():
    """A large given regularisation error is brought below the target, by gamma and not by meshes
    alone.
    """
    scene = example1(bound=1.5, gamma=1e5, nx=60, ny=20)
    solution = solve(scene.model_copy(update={"accuracy": Accuracy(target=3e-2, of="pressure")}))
    assert solution.parameters["gamma_n"] > 1e6
    assert solution.levels[-1].pressure_regularisation < 0.5 * 3e-2


def test_arcs_are_not_divided():
    """Cells on an arc would converge to a polygon: refused where gmsh cannot make them of other
    lengths.
    """
    goal = Accuracy(target=0.05, refinement="adaptive")
    mesh = MeshGenerator(generator="cylinder", parameters={"cell": "tetrahedron"})
    asked = read_scene(SCENES / "hertz.toml").model_copy(update={"accuracy": goal, "mesh": mesh})
    with pytest.raises(SceneError, match=r"accuracy\.refinement: the arcs of cylinder"):
        planned(asked, goal, MPI.COMM_SELF)


def test_a_mesh_that_cannot_be_divided_is_refused_first():
    """Quadrilaterals that are no generator's: said before anything is solved."""
    scene = on_mesh(asked("tresca", target=0.1), rectangle(nx=6, ny=2))
    history = []
    with pytest.raises(MeshError, match="only triangles"):
        check_scene(scene, MPI.COMM_SELF)
    with pytest.raises(MeshError, match="only triangles"):
        alone(scene, observers=[history.append])
    assert not history


def test_budget_ends_by_name():
    """A refinement that the budget does not allow is not begun; the answer is the last mesh's,
    certified.
    """
    assert solve(asked("tresca", target=1e-6, memory=1e-3), check=False).status is Status.BUDGET


@pytest.mark.mpi(slow=True)
def test_time_ends_after_the_linear_solve_in_which_it_has_passed(monkeypatch):
    """On a clock that counts linear solves: none comes after the last that is allowed, on whichever
    mesh that is.
    """
    solves = []
    monkeypatch.setattr(
        parallel,
        "clock",
        lambda comm: float(sum(isinstance(one, IterationRecord) for one in solves)),
    )
    whole = solve(asked("coulomb", target=0.05), observers=[solves.append])
    by_mesh = np.cumsum([level.linear_solves for level in whole.levels])
    assert len(by_mesh) > 2
    for allowed in (1, by_mesh[0] + 1, by_mesh[1] - 1):
        solves.clear()
        scene = asked("coulomb", target=0.05, seconds=float(allowed))
        solution = solve(scene, observers=[solves.append], check=False)
        complete = int(np.count_nonzero(by_mesh <= allowed))
        assert solution.history.linear_solves == allowed
        assert len(solution.levels) == complete
        assert (
            f"accuracy: {allowed} s have ended before mesh {complete + 1} was solved"
            in solution.history.events
        )
        if complete:
            assert solution.status is Status.BUDGET
            assert solution.certificate.holds
            np.testing.assert_array_equal(
                solution.table.columns["pressure"], solution.levels[-1].table.columns["pressure"]
            )
        else:
            assert solution.status is Status.MAX_ITERATIONS
            assert "raise accuracy.seconds" in solution.advice


def test_the_memory_of_the_machine_is_a_budget(monkeypatch):
    """Without a budget a mesh that the machine has no memory for is not begun: the system would
    kill the process.
    """
    monkeypatch.setattr(parallel, "machine_memory", lambda comm: 1e6)
    solution = solve(asked("tresca", target=1e-6), check=False)
    assert solution.status is Status.MEMORY
    assert solution.certificate.holds
    assert "this machine has 0.00093" in solution.advice
    assert "of memory, this machine has 0.00093" in solution.history.events[-1]
    told = [*map(str, lines_of(summary_of(solution), Path()))]
    assert any(
        line.startswith("  accuracy         the next mesh would take about") for line in told
    )
    assert not any(line.startswith("  fall-backs") for line in told)


def test_arcs_get_degree_2():
    """Half a disk is made anew, with elements and cells of degree 2, and comes to Hertz's peak
    pressure.
    """
    scene = read_scene(SCENES / "hertz.toml")
    scene = scene.model_copy(update={"accuracy": Accuracy(target=0.02, of="pressure")})
    solution = alone(scene)
    assert solution.statement.element.degree == 2
    assert compat.geometry_degree(solution.model.tagged.mesh) == 2
    assert solution.model.dofs < 3_000
    assert any(
        event.startswith("elements: degree 2, cells made anew where the error is")
        for event in solution.history.events
    )
    assert solution.table.columns["pressure"].max() == pytest.approx(5.494, rel=3e-3)


CHEAPER = {
    "element": {"volumetric": "auto"},
    "mesh": rectangle_mesh(20, 10, length=2.0, height=1.0),
    "material": {"young": 10.0, "poisson": 0.499},
    "displacement": [fixed("left", "x"), fixed("right", "x")],
    "traction": {"boundary": "top", "y": -0.5},
    "contact": {"boundary": "bottom", "gap": "0.05*(x[0] - 0.9)**2"},
}


@pytest.mark.parametrize(
    ("of", "target", "entries", "most"),
    [
        ("energy", 0.01, {}, 6_000),
        ("pressure", 0.01, {}, 2_000),
        ("zone", 0.01, {"material": {"young": 10.0, "poisson": 0.3}}, 4_000),
        ("zone", 0.01, {"material": {"young": 10.0, "poisson": 0.499}}, 4_000),
    ],
)
def test_the_cheaper_way(of, target, entries, most):
    """Reduced triangles of degree 2 took 110,118 unknowns for the energy, where a pressure as an
    unknown takes 4,302; ends of zones made all cells smaller, 520,562 and no end.
    """
    scene = CHEAPER | {"accuracy": {"of": of, "target": target}} | entries
    assert alone(parse_scene(scene)).levels[-1].dofs < most


TABLE = {
    "mesh": rectangle_mesh(40, 20, length=2.0, height=1.0),
    "material": {"young": 1000.0, "poisson": 0.3},
    "displacement": [fixed("left", "x")],
    "traction": [{"boundary": "top", "y": -5.0}],
    "contact": {"boundary": "bottom", "friction": coulomb_friction(0.6)},
}


def test_the_largest_pressure_at_a_corner_has_no_value():
    """It grows with every refinement: that is said, and no number is called right."""
    scene = parse_scene({**TABLE, "accuracy": {"target": "5%", "of": "peak"}})
    solution = alone(scene, check=False)
    assert solution.status is Status.OUT_OF_REACH
    assert solution.convergence_table[-2].peak is None
    assert any(
        "no finite value" in event and "at (2, " in event for event in solution.history.events
    )
    assert (
        "the largest pressure has no finite value" in solution.advice
    )  # and so in the first lines


@pytest.mark.one_quick("of", ["energy", "pressure", "force"])
def test_loads_that_jump_between_nodes(of):
    """The resultant that the mesh misses is part of the error: no load is off by more than is asked
    for.
    """
    jump = {"boundary": "top", "y": "where(x[0] > 1.13 and x[0] < 1.87, -20, 0)"}
    mesh = rectangle_mesh(30, 10, length=3.0)
    held = [fixed("left")]
    contact = {"boundary": "bottom", "friction": coulomb_friction(0.3)}
    goal = {"target": 0.05, "of": of}
    scene = {
        **TABLE,
        "mesh": mesh,
        "displacement": held,
        "traction": [jump],
        "contact": contact,
        "accuracy": goal,
    }
    scene = parse_scene(scene)
    solution = alone(scene)
    resultant = sum(float(load.forces.sum()) for load in solution.model.applied)
    assert abs(resultant / (-20 * 0.74) - 1) <= 0.02
    assert solution.levels[0].loads > solution.levels[-1].loads


SEAL = """SetFactory("OpenCASCADE");
Point(1) = {-1, 1, 0}; Point(2) = {1, 1, 0}; Point(3) = {1, 0.5, 0}; Point(4) = {-1, 0.5, 0};
Point(5) = {0, 0.5, 0}; Point(6) = {0, -0.5, 0};
Line(1) = {1, 2}; Line(2) = {2, 3}; Circle(3) = {3, 5, 6}; Circle(4) = {6, 5, 4}; Line(5) = {4, 1};
Curve Loop(1) = {1, 2, 3, 4, 5}; Plane Surface(1) = {1};
Physical Curve("top") = {1}; Physical Curve("lip") = {3, 4}; Physical Surface("body") = {1};
Mesh.MeshSizeMax = 0.25;
"""


def seal(file, **goal):
    """A round lip pressed onto a plane."""
    return parse_scene(
        {
            "mesh": {"file": str(file)},
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": [{"boundary": "top", "x": 0.0, "y": -0.05}],
            "contact": {"boundary": "lip", "gap": "x[1] + 0.5", "direction": [0.0, -1.0]},
            "accuracy": goal,
        }
    )


@pytest.mark.slow
def test_a_drawing_is_meshed_again(tmp_path):
    """A .geo gets finer cells on its true curves; its straight mesh is refused by name, its curved
    one divided.
    """
    drawing = tmp_path / "seal.geo"
    drawing.write_text(SEAL)
    fine = alone(seal(drawing, target=0.03, of="pressure"))
    assert fine.statement.element.degree == 2
    assert compat.geometry_degree(fine.model.tagged.mesh) == 2
    largest = fine.table.columns["pressure"].max()
    solution = alone(seal(drawing, target=0.1, of="pressure"))
    assert solution.table.columns["pressure"].max() == pytest.approx(largest, rel=0.03)
    for degree, name in ((1, "straight.msh"), (2, "curved.msh")):
        write_msh(drawing, tmp_path / name, degree)
    curved = alone(seal(tmp_path / "curved.msh", target=0.1, of="pressure"))
    assert curved.table.columns["pressure"].max() == pytest.approx(largest, rel=0.03)
    polygon = alone(seal(tmp_path / "straight.msh", target=0.05, of="pressure"), check=False)
    assert polygon.status is Status.OUT_OF_REACH
    assert any("straight facets" in event for event in polygon.history.events)
    with pytest.raises(SceneError, match="dolfinx bisects straight ones only"):
        alone(seal(tmp_path / "curved.msh", target=0.05, refinement="adaptive"))


def test_the_cells_of_a_file_are_halved_or_not(tmp_path, monkeypatch):
    """A budget for less than twice as fine a mesh does not begin one that is twice as fine."""
    (tmp_path / "seal.geo").write_text(SEAL)
    jumps = []

    def noted(*given, finer, **named):
        jumps.append(finer)
        return predict(*given, finer=finer, **named)

    monkeypatch.setattr(to_accuracy, "predict", noted)
    scene = seal(tmp_path / "seal.geo", target=1e-6, refinement="uniform", memory=1e-3)
    assert alone(scene, check=False).status is Status.BUDGET
    assert jumps == [2.0]


@pytest.mark.slow
@pytest.mark.parametrize("of", ["energy", "force"])
def test_load_steps(of):
    """Every load step counts: the worst of them has what is asked for."""
    scene = read_scene(SCENES / "press_and_slide.toml")
    rough, fine = (
        alone(scene.model_copy(update={"accuracy": Accuracy(target=target, of=of)}))
        for target in (0.05, 0.01)
    )
    assert len(rough.steps) == scene.statement.steps > 1
    if of == "force":
        forces = [
            np.concatenate([np.concatenate(step.contact.forces) for step in s.steps])
            for s in (rough, fine)
        ]
        assert np.linalg.norm(forces[0] - forces[1]) <= 0.05 * np.linalg.norm(forces[1])


RECTANGLE = {"length": 2.06, "height": 1.01, "nx": 10, "ny": 5}
SINGULAR = {
    "two materials": (
        Block(2.1, 0.62, (10, 3), 0.27, ((0.651, 0.62), (1.471, 0.62))),
        {
            "material": [
                {"region": "first", "young": 1000.0, "poisson": 0.37},
                {"region": "second", "young": 308.0, "poisson": 0.3},
            ],
            "traction": {
                "boundary": "top",
                "y": "where(x[0] > 0.651 and x[0] < 1.471, -7.03, -1.41)",
            },
            "contact": {"boundary": "bottom", "friction": coulomb_friction(0.19)},
        },
    ),
    "friction that jumps": (
        Block(1.56, 1.04, (7, 5), 0.61, ((1.22, 0.0), (0.921, 1.04), (1.301, 1.04))),
        {
            "material": [
                {"region": "first", "young": 1000.0, "poisson": 0.32},
                {"region": "second", "young": 263.0, "poisson": 0.24},
            ],
            "traction": {
                "boundary": "top",
                "y": "where(x[0] > 0.921 and x[0] < 1.301, -12.77, -2.55)",
            },
            "body_force": {"x": 0.0, "y": -0.2},
            "contact": {
                "boundary": "bottom",
                "friction": coulomb_friction("where(x[0] < 1.22, 0.18, 0.46)"),
            },
        },
    ),
    "curved gap": (
        Block(2.06, 1.01, (10, 5), jumps=((0.45, 1.01), (1.447, 1.01))),
        {
            "mesh": rectangle_mesh(**RECTANGLE),
            "material": {"young": 1000.0, "poisson": 0.39},
            "traction": {
                "boundary": "top",
                "y": "where(x[0] > 0.45 and x[0] < 1.447, -10.11, -2.02)",
            },
            "body_force": {"x": 0.0, "y": -4.1},
            "contact": {
                "boundary": "bottom",
                "gap": "0.0352*(x[0] - 0.88)**2",
                "direction": [0.0, -1.0],
                "friction": coulomb_friction(0.52),
            },
        },
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", SINGULAR)
def test_corners_interfaces_and_jumps(name):
    """Where the stress is singular, 5 % of the displacement, the pressure and the force are met."""
    block, data = SINGULAR[name]
    scene = parse_scene({"mesh": block.mesh(), "displacement": fixed("left", "x"), **data})
    fine, _ = corner_reference(scene, block, 25, 15_000)
    for of in QUANTITIES:
        goal = Accuracy(target=0.05, of=of)
        solution = alone(scene.model_copy(update={"accuracy": goal}))
        assert fine.errors(solution)[of] <= 0.05
