"""What the next accuracy costs: the arithmetic of the forecast, and that it is the same wherever it
is said.
"""

import re
from dataclasses import replace

import pytest
from mpi4py import MPI
from scene_tables import box_mesh, fixed, rectangle_mesh
from scenes import alone, example1

from signorini_fx.errors import SceneError
from signorini_fx.mechanics.statement.settings import Accuracy
from signorini_fx.results.accuracy import next_accuracy
from signorini_fx.scenes.checks import check_scene, text_of
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve
from signorini_fx.tuned import FIXED_UNKNOWNS, MARGIN_OF_ENERGY, NEXT_ERROR, WHOLE_SECONDS


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        ((3.2, 3.4), "about 3 s"),
        ((3.2, 6.1), "3 to 6 s"),
        ((57.2, 429.0), "57 to 430 s"),
        ((4.0, 700.0), "4 s to 12 min"),
    ],
)
def test_times_in_words(seconds, words):
    """One number where both are the same, and the unit once."""
    assert next_accuracy.between(seconds) == words


@pytest.mark.one_quick(("degree", "cell"), [(1, "quadrilateral"), (2, "triangle")])
def test_the_command_reaches_what_was_foretold(degree, cell):
    """It is told from the mesh that was solved, and a run with it ends below the error that was
    foretold.
    """
    scene = example1(coefficient=0.3, gamma="auto", nx=30, ny=10, degree=degree, cell=cell)
    cost = alone(scene).cost
    assert (cost.of, cost.dofs, cost.local) == ("energy", 682 if degree == 1 else 2562, True)
    assert cost.next_error == pytest.approx(NEXT_ERROR[2] * cost.error)
    assert cost.next_seconds[0] < cost.next_seconds[1]
    assert str(cost).startswith(f"{100 * cost.error:.2g} % error of the stress took ")
    assert str(cost).endswith(f" with {cost.command}")
    option, target = cost.command.split()
    assert option == "--accuracy"
    reached = alone(scene.model_copy(update={"accuracy": Accuracy(target=target)}))
    assert reached.converged
    assert (
        reached.convergence_table[-2].energy <= 1.02 * cost.next_error
    )  # the target has two digits
    assert cost.next_dofs / 4 < reached.model.dofs < 4 * cost.next_dofs


def test_without_contact_of_one_body_all_cells_become_smaller():
    """Drawings may have arcs, and the forecast says that it is of another way."""
    scene = example1(coefficient=0.3, gamma="auto", nx=30, ny=10)
    statement, mesh = scene.statement, alone(scene).model.tagged
    assert next_accuracy.divides_cells(statement, mesh, "energy")
    assert not next_accuracy.divides_cells(replace(statement, arcs=True), mesh, "energy")
    assert not next_accuracy.divides_cells(
        replace(statement, generated=False), mesh, "energy"
    )  # quadrilaterals


@pytest.mark.parametrize(("across", "larger"), [(4, 4.0), (6, 2.0), (5, 1.0)])
def test_in_space_it_costs_what_the_first_mesh_costs(across, larger):
    """Its cells are larger than those of the scene where these are their halves."""
    counts = {"nx": 2 * across, "ny": across, "nz": across}
    box = box_mesh(**counts, length=2.0, cell="tetrahedron")
    scene = parse_scene(
        {
            "mesh": box,
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": {"boundary": "top", "x": 0.0, "y": 0.0, "z": -0.01},
            "contact": {"boundary": "bottom"},
        }
    )
    assert scene.mesh.coarsest(8.0) == larger
    dofs = 3 * (2 * across + 1) * (across + 1) ** 2
    refinement = next_accuracy.next_refinement(
        scene.statement, load_mesh(scene, MPI.COMM_SELF), "energy", dofs
    )
    assert refinement.local
    assert refinement.unknowns >= dofs * (2 / larger) ** 3
    assert refinement.times[1] > refinement.unknowns / dofs


def test_iterations_of_metal_increase():
    """Like one over the size of cells, in 3D the cubic root of the unknowns; those of rubber do
    not.
    """
    box = box_mesh(2, 2, 2, length=1.0, cell="hexahedron")
    rubber = {"law": "neo-hooke", "young": 1.0, "poisson": 0.3}
    forecasts = []
    for material in (rubber, {**rubber, "law": "j2", "yield_stress": 1.0}):
        scene = parse_scene({"mesh": box, "material": material, "contact": {"boundary": "bottom"}})
        mesh = load_mesh(scene, MPI.COMM_SELF)
        forecasts.append(next_accuracy.next_refinement(scene.statement, mesh, "energy", 81))
    elastic, metal = forecasts
    assert metal.unknowns == elastic.unknowns
    assert metal.times[1] == pytest.approx((metal.unknowns / 81) ** (1 / 3) * elastic.times[1])


def test_check_foretells_what_it_costs():
    """As much as the solve foretells, before anything is known of the solution."""
    scene = example1(coefficient=0.3, gamma="auto", nx=30, ny=10)
    cost = check_scene(scene).cost
    assert cost.next_local
    factor = next_accuracy.next_refinement(
        scene.statement, alone(scene).model.tagged, "energy", cost.unknowns
    ).times[1]
    assert cost.next_seconds[1] == pytest.approx(factor * cost.seconds[1])
    assert cost.next_seconds[0] < cost.next_seconds[1]
    # Of a small scene linear algebra takes hardly any of it.
    assert cost.seconds[0] > WHOLE_SECONDS[2] * (FIXED_UNKNOWNS[2] + cost.unknowns)


UNSUPPORTED = {
    "mesh": rectangle_mesh(8, 4, length=2.0, height=1.0),
    "material": {"young": 100.0, "poisson": 0.3},
    "displacement": fixed("left"),
    "traction": {"boundary": "top", "y": -0.1},
}
TOUCHING = {"contact": {"boundary": "bottom"}}
AT_A_POINT = {"point_force": {"at": [1.0, 1.0], "y": -0.1}}


def test_no_price_for_what_is_refused():
    """Without contact no command is printed, and with a force at a point no price."""
    alone = parse_scene(UNSUPPORTED)
    cost = solve(alone, MPI.COMM_SELF).cost
    assert cost.command == ""
    assert str(cost).endswith("all cells smaller")
    assert "with all cells smaller" in text_of(check_scene(alone, MPI.COMM_SELF), verbose=False)
    pointed = parse_scene(UNSUPPORTED | TOUCHING | AT_A_POINT)
    assert solve(pointed, MPI.COMM_SELF).cost.startswith("a requested accuracy a force at a point")
    assert "of the error:" not in text_of(check_scene(pointed, MPI.COMM_SELF), verbose=False)
    with pytest.raises(SceneError, match="a force at a point"):
        parse_scene(UNSUPPORTED | TOUCHING | AT_A_POINT | {"accuracy": {"target": 0.1}})
    with pytest.raises(SceneError, match="needs a scene with contact"):
        parse_scene(UNSUPPORTED | {"accuracy": {"target": 0.1}})


def test_the_command_is_in_per_cent():
    """As the errors beside it are."""
    found = solve(parse_scene(UNSUPPORTED | TOUCHING), MPI.COMM_SELF).cost
    share = float(re.fullmatch(r"--accuracy ([\d.]+)%", found.command)[1]) / 100
    assert share == pytest.approx(found.next_error * MARGIN_OF_ENERGY[2], rel=0.02)
