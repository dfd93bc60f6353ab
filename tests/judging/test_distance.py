"""The guaranteed interval of the error of a foreign result, against a fine solution; and what stands beside ours."""

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from foreign_spoils import displacements

from signorini_fx.addons.judging.formulations import EXACT, stiffness_by_material
from signorini_fx.addons.judging.judge import judge
from signorini_fx.addons.judging.own_solution import CarriedMesh, as_functions, at_points, one_body, solved, tagged
from signorini_fx.addons.judging.problems import judged_problem

DATA = Path(__file__).parent / "data"


def displacement_of(name):
    """Of a result, at the nodes of its deck."""
    problem, _ = judged_problem(DATA / f"{name}.inp")
    numbers, values = displacements(DATA / f"{name}.dat")
    rows = dict(zip(numbers, values, strict=True))
    return problem, np.array([rows[number][: problem.mesh.dim] for number in problem.mesh.names.tolist()])


def loads_times(factor):
    """The displacement where nothing is prescribed but zero, times a factor."""
    return lambda v: factor * v


def moved(v):
    """One node inside, by a tenth of the largest displacement."""
    away = v.copy()
    away[17] += 0.1 * np.abs(v).max()
    return away


@cache
def fine(name, halvings):
    """A fine solution, and the mesh that carries displacements of the deck onto it."""
    problem, v = displacement_of(name)
    body = one_body(problem, v)
    mesh = body.mesh
    for _ in range(halvings):
        mesh = mesh.finer()
    return at_points(solved(body.solve, mesh=tagged(mesh.arrays)), mesh.arrays.points), mesh


def energy_norm(problem, arrays, u):
    """Of a displacement on a mesh with one material."""
    from dataclasses import replace

    mesh = replace(problem.mesh, points=arrays.points, kind=arrays.kind, cells=arrays.cells)
    material = replace(problem.materials[0], cells=np.arange(len(arrays.cells)))
    (stiffness,) = stiffness_by_material(replace(problem, mesh=mesh, materials=(material,)), EXACT)
    return float(np.sqrt(u.ravel() @ (stiffness @ u.ravel())))


CASES = [
    ("shelf_CPE6", 3, None),
    ("shelf_CPE6", 3, loads_times(1.05)),
    ("shelf_CPE6", 3, loads_times(0.9)),
    ("shelf_CPE8R", 3, None),
    ("shelf_CPE8R", 3, moved),
    ("shelf_C3D4", 2, None),
]


@pytest.mark.one_quick
@pytest.mark.parametrize(("name", "halvings", "change"), CASES)
def test_the_error_is_in_its_interval(name, halvings, change):
    """The true error, up to that of the fine solution, is neither above the bound nor below the other one, also where
    the displacement is spoiled.
    """
    problem, v = displacement_of(name)
    v = v if change is None else np.where(np.isnan(problem.prescribed), change(v), v)
    error = judge(DATA / f"{name}.inp", v).error
    assert error["guaranteed"], error
    exact, mesh = fine(name, halvings)
    body = one_body(problem, v).mesh
    for _ in range(halvings):
        body = body.finer()
    assert body.arrays.points.shape == mesh.arrays.points.shape
    true = energy_norm(problem, mesh.arrays, body.displacements - exact) / energy_norm(problem, mesh.arrays, exact)
    assert error["low"] <= 1.02 * true
    assert true <= 1.001 * error["high"]
    assert 0 <= error["low"] <= error["high"]
    if problem.mesh.dim == 2:
        assert error["high"] < 1.45 * true  # and it is of use


@pytest.mark.slow
def test_a_wrong_result_is_refuted():
    """All of a displacement 1.3 times too large: its error is at least what no mesh can excuse."""
    _, v = displacement_of("shelf_CPE6")
    good = judge(DATA / "shelf_CPE6.inp", v).error
    bad = judge(DATA / "shelf_CPE6.inp", 1.6 * v).error
    assert bad["low"] > good["high"]
    assert bad["ours_on_their_mesh"]["high"] == pytest.approx(good["ours_on_their_mesh"]["high"], rel=1e-6)


@pytest.mark.parametrize("name", ["shelf_CPE4", "shelf_CPE6", "shelf_C3D4"])
def test_a_carried_displacement_stays_the_same_function(name):
    """On the mesh with halved sides it has the same energy, and the same values in the space of our solution."""
    problem, v = displacement_of(name)
    mesh = one_body(problem, v).mesh
    finer = mesh.finer()
    sizes = [energy_norm(problem, each.arrays, each.displacements) for each in (mesh, finer)]
    assert sizes[1] == pytest.approx(sizes[0], rel=1e-10)
    solution = solved(one_body(problem, v).solve, mesh=tagged(finer.arrays))
    (function,) = as_functions(solution, finer)
    solution.displacement.x.array[:] = function.x.array
    np.testing.assert_allclose(at_points(solution, finer.arrays.points), finer.displacements, atol=1e-14)
    assert isinstance(mesh, CarriedMesh)


@pytest.mark.parametrize(("name", "reason"), [
    ("press_CPE4", "Coulomb"), ("stack_CPE4", "flat rigid foundation"), ("shelf_CAX4", "axisymmetric"),
    ("shelf_C3D8I", "hexahedron cells"), ("shelf_CPS4", "quadrilateral cells"),
])  # fmt: skip
def test_no_bound_has_a_reason(name, reason):
    """And the distance to our solution on the same mesh, which is that of the penalty or of the element."""
    judgement = judge(DATA / f"{name}.inp", DATA / f"{name}.dat")
    assert not judgement.error["guaranteed"]
    assert reason in judgement.error["reason"]
    limit = {"press_CPE4": 0.01, "stack_CPE4": 0.02, "shelf_CAX4": 0.01}.get(name, 0.3)
    assert judgement.error["distance"] < limit
    assert judgement.beside["displacement"] < limit
    assert judgement.beside["force"] < limit


def test_beside_ours():
    """Displacement, force and pressure of the same elements differ by the penalty alone."""
    beside = judge(DATA / "shelf_CPE4.inp", DATA / "shelf_CPE4.dat").beside
    assert set(beside) == {"displacement", "force", "pressure"}
    assert max(beside.values()) < 0.01


def test_no_distance_where_our_own_solution_does_not_move(tmp_path):
    """Relative to nothing there is none."""
    text = (DATA / "shelf_CAX4.inp").read_text()
    (tmp_path / "deck.inp").write_text(re.sub(r"(BODY_\w+), P, .*", r"\1, P, 0.", text))
    judgement = judge(tmp_path / "deck.inp", DATA / "shelf_CAX4.dat")
    assert judgement.error["distance"] is None
    assert "in our own solution nothing moves" in judgement.error["reason"]
