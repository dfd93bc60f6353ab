"""An accuracy that is asked for is reached, or the budget ends by name."""

from pathlib import Path

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI

from signorini_fx import accuracy, compat
from signorini_fx.checks import check_scene
from signorini_fx.errors import MeshError, SceneError
from signorini_fx.mesh import generate_mesh
from signorini_fx.reference import Reference, divided
from signorini_fx.results import Status
from signorini_fx.scene import Accuracy, parse_scene, read_scene
from signorini_fx.solver import solve
from tests.scenes import example1, on_mesh, rectangle

SCENES = Path(__file__).parent.parent / "demos" / "scenes"
FRICTION = {"tresca": {"bound": 1.5}, "coulomb": {"coefficient": 0.3}}


def asked(friction, **goal):
    """Example 1 with gamma left to the program, asked for an accuracy."""
    scene = example1(**FRICTION[friction], gamma="auto", nx=120, ny=40)
    return scene.model_copy(update={"accuracy": Accuracy(**goal)})


@pytest.fixture(scope="module", params=sorted(FRICTION))
def reference(request):
    """A solution without regularisation on a much finer mesh."""
    return request.param, solve(example1(**FRICTION[request.param], nx=960, ny=320, algorithm="exact")).table.columns


@pytest.mark.parametrize("target", [1e-1, 3e-2, 1e-2])
def test_pressure(reference, target):
    """The true error of the contact pressure is what was asked for, or less."""
    friction, fine = reference
    solution = solve(asked(friction, target=target, of="pressure"))
    coarse = solution.table.columns
    difference = np.interp(fine["s"], coarse["s"], coarse["pressure"]) - fine["pressure"]
    true = np.sqrt(np.dot(fine["weight"], difference**2) / np.dot(fine["weight"], fine["pressure"] ** 2))
    assert true <= target


@pytest.mark.parametrize(("of", "targets"), [("energy", (1e-1, 1e-2, 2e-3)), ("pressure", (1e-1, 1e-2, 3e-3))])
def test_true_error_on_the_meshes_that_the_program_chooses(overkill, of, targets):
    """Displacement and pressure on triangles of degree 2, refined where the error is: met, and with few unknowns."""
    friction, fine = overkill
    for target, most in zip(targets, (3_000, 20_000, 60_000), strict=True):
        solution = solve(asked(friction, target=target, of=of), MPI.COMM_SELF)
        assert fine.errors(solution)[of] <= target
        assert solution.discretisation.dofs < most


@pytest.fixture(scope="module", params=sorted(FRICTION))
def overkill(request):
    """A reference of much higher accuracy, of displacement too."""
    scene = example1(**FRICTION[request.param], nx=120, ny=40)
    return request.param, Reference(divided(scene, 2.0, 60_000)[-1])


@pytest.mark.mpi
def test_every_number_of_ranks_meets_it():
    """The same meshes, and with them the same answer, on any number of ranks."""
    scene = asked("coulomb", target=3e-2, of="pressure")
    ours, alone = solve(scene), solve(scene, MPI.COMM_SELF)
    assert [level.dofs for level in ours.levels] == [level.dofs for level in alone.levels]
    assert ours.price_list[-2].pressure == pytest.approx(alone.price_list[-2].pressure, rel=1e-6)


def test_nodes_where_loads_jump_are_kept():
    """The first mesh is part of the scene's own; one that cannot be halved is where it begins."""
    for (nx, ny), (coarse_nx, coarse_ny) in (((120, 40), (15, 5)), ((60, 20), (15, 5)), ((45, 15), (45, 15))):
        scene = example1(bound=1.5, nx=nx, ny=ny)
        meshes = accuracy.Meshes(scene, Accuracy(target=0.1), MPI.COMM_SELF)
        assert meshes.scene.mesh.parameters["nx"] == coarse_nx
        assert meshes.scene.mesh.parameters["ny"] == coarse_ny


def test_supports_begin_where_the_scene_says():
    """A first mesh on which a named side would begin elsewhere is none: cells that are divided would keep it there."""
    scene = parse_scene(
        {
            "mesh": {"generator": "notched_sides", "parameters": {"nx": 60, "ny": 20, "lower": 0.25}},
            "material": {"young": 1e4, "poisson": 0.3},
            "displacement": [{"boundary": side, "x": 0.0, "y": -0.004} for side in ("left", "right")],
            "contact": {"boundary": "bottom", "gap": 0.0015},
            "accuracy": {"target": 0.2},
        }
    )
    solution = solve(scene, MPI.COMM_SELF)
    tagged = solution.discretisation.tagged
    for side in ("left", "right"):
        points = tagged.mesh.geometry.x[dmesh.entities_to_geometry(tagged.mesh, 1, tagged.facets(side))]
        assert points[:, :, 1].min() == pytest.approx(0.25)


def test_uniform_meshes_jump_to_what_is_needed():
    """The scene's own elements, in whole multiples of the coarsest, with few meshes in between."""
    solution = solve(asked("tresca", target=2e-2, of="energy", refinement="uniform"), MPI.COMM_SELF)
    assert solution.scene.element.degree == 1
    counts = [(level.table.columns["s"].size - 1) / 30 for level in solution.levels]
    assert counts == [round(count) for count in counts]
    assert counts[-1] > 8 > len(counts)


@pytest.mark.parametrize("of", ["energy", "pressure"])
def test_own_triangles(overkill, of):
    """A mesh that no generator makes gets degree 2 as well: the accuracy is met with few unknowns."""
    friction, fine = overkill
    scene = asked(friction, target=1e-2, of=of)
    generator = {**scene.mesh.parameters, "nx": 30, "ny": 10, "cell": "triangle"}
    own = generate_mesh(scene.mesh.generator, generator, MPI.COMM_SELF)
    solution = solve(scene.model_copy(update={"mesh": own}), MPI.COMM_SELF)
    assert solution.scene.element.degree == 2
    assert fine.errors(solution)[of] <= 1e-2
    assert solution.discretisation.dofs < 20_000


@pytest.mark.parametrize("target", [1e-2, 1e-3])
def test_peak(reference, target):
    """The same for the largest pressure."""
    friction, fine = reference
    solution = solve(asked(friction, target=target, of="peak"))
    assert abs(solution.table.columns["pressure"].max() / fine["pressure"].max() - 1) <= target


def test_gamma_is_raised_where_it_is_in_the_way():
    """A large given regularisation error is brought below the target, by gamma and not by meshes alone."""
    scene = example1(bound=1.5, gamma=1e5, nx=60, ny=20)
    solution = solve(scene.model_copy(update={"accuracy": Accuracy(target=3e-2, of="pressure")}))
    assert solution.parameters["gamma_n"] > 1e6
    assert solution.levels[-1].pressure_regularisation < 0.5 * 3e-2


def test_path_following_leaves_less_where_it_is_in_the_way():
    """What the scene lets it leave is more than the target: it is lowered, and no mesh is solved for ever."""
    meshes = []

    def watch(record):
        if isinstance(record, str) and record.startswith("level "):
            meshes.append(record)
            assert len(meshes) < 15

    path = {"algorithm": "path-following", "regularisation_error": 0.1}
    scene = example1(bound=1.5, gamma="auto", nx=24, ny=8, **path)
    goal = Accuracy(target=3e-2, of="pressure")
    solution = solve(scene.model_copy(update={"accuracy": goal}), MPI.COMM_SELF, observers=[watch])
    assert solution.levels[-1].pressure_regularisation < 0.5 * 3e-2


def test_arcs_are_not_divided():
    """Cells on an arc would converge to a polygon: refused, and not solved for it."""
    scene = read_scene(SCENES / "hertz.toml")
    asked = scene.model_copy(update={"accuracy": Accuracy(target=0.05, refinement="adaptive")})
    with pytest.raises(SceneError, match=r"accuracy\.refinement: the arcs of half_disk"):
        solve(asked, MPI.COMM_SELF)


def test_a_mesh_that_cannot_be_divided_is_refused_first():
    """Quadrilaterals that are no generator's: said before anything is solved."""
    scene = on_mesh(asked("tresca", target=0.1), rectangle(nx=6, ny=2))
    history = []
    with pytest.raises(MeshError, match="only triangles"):
        check_scene(scene, MPI.COMM_SELF)
    with pytest.raises(MeshError, match="only triangles"):
        solve(scene, MPI.COMM_SELF, observers=[history.append])
    assert not history


def test_budget_ends_by_name():
    """A refinement that the budget does not allow is not begun; the answer is the last mesh's, certified."""
    solution = solve(asked("tresca", target=1e-6, seconds=1e-3), check=False)
    assert solution.status is Status.BUDGET
    assert solution.certificate.holds
    assert len(solution.levels) == 2
    assert solve(asked("tresca", target=1e-6, memory=1e-3), check=False).status is Status.BUDGET


def test_no_more_than_asked_for():
    """A rough answer costs two small meshes."""
    assert len(solve(asked("tresca", target=0.5, of="pressure")).levels) == 2


def test_arcs_get_degree_2():
    """Half a disk is refined uniformly with elements and cells of degree 2, and comes to Hertz's peak pressure."""
    scene = read_scene(SCENES / "hertz.toml")
    scene = scene.model_copy(update={"accuracy": Accuracy(target=0.02, of="pressure")})
    solution = solve(scene, MPI.COMM_SELF)
    assert solution.scene.element.degree == 2
    assert compat.geometry_degree(solution.discretisation.tagged.mesh) == 2
    assert solution.discretisation.dofs < 20_000
    assert any(event.startswith("elements: degree 2, all cells smaller") for event in solution.history.events)
    assert solution.table.columns["pressure"].max() == pytest.approx(5.494, rel=3e-3)
