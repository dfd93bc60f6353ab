"""Nested meshes and a requested accuracy for forms of the user's own, by the algorithms of
scenes.
"""

from dataclasses import replace

import forms
import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from forms import block_on_a_floor, stress_of
from hertz import POISSON, RADIUS, YOUNG, load
from mpi4py import MPI
from on_meshes import trial_and_test, vector_space
from scene_tables import fixed, rectangle_mesh, tresca_friction

from signorini_fx import (
    Accuracy,
    ContactProblem,
    ConvergenceError,
    Coulomb,
    FormError,
    Foundation,
    MeshError,
    Tresca,
    generate_mesh,
    solve,
    solve_nested,
    solve_to_accuracy,
)
from signorini_fx.records import Status
from signorini_fx.scenes.reading import parse_scene

COMM = MPI.COMM_WORLD


def disks(size, cell="triangle"):
    """Half disks with smaller and smaller cells, and their named boundaries."""

    def disk(n, comm=COMM):
        sizes = {
            "radius": RADIUS,
            "contact_size": size / n,
            "contact_zone": 0.6,
            "symmetric": True,
            "cell": cell,
        }
        return generate_mesh("half_disk", {**sizes, "size": 1.0 / n}, comm)

    return disk


def hertz(degree=1, friction=0.0, **settings):
    """Half a disk on a plane, Hertz's contact, by UFL, as a function of the mesh."""

    def make(disk):
        V = vector_space(disk.mesh, degree)
        (u, v), x = trial_and_test(V), ufl.SpatialCoordinate(disk.mesh)
        stress = stress_of(YOUNG, POISSON, 2)
        top, axis, arc = (disk.facets(name) for name in ("top", "symmetry", "arc"))
        ds = ufl.ds(
            domain=disk.mesh,
            subdomain_data=dmesh.meshtags(disk.mesh, 1, top, np.full(top.size, 1, np.int32)),
        )
        L = -load(0.4) / (2 * RADIUS) * v[1] * ds(1)
        held = fem.dirichletbc(0.0, fem.locate_dofs_topological(V.sub(0), 1, axis), V.sub(0))
        gap = RADIUS - ufl.sqrt(ufl.max_value(0.0, RADIUS**2 - x[0] ** 2))
        plane = Foundation(
            arc, gap=gap, direction=(0.0, -1.0), friction=Coulomb(friction) if friction else None
        )
        a = ufl.inner(stress(u), ufl.grad(v)) * ufl.dx
        return ContactProblem(a, L, [held], plane, stress=stress, **settings)

    return make


GAMMA = {"gamma_n": 1e5, "gamma_t": 1e5}


@pytest.mark.mpi(slow=True)
def test_tetrahedra_are_divided():
    """In 3D, from a mesh of dolfinx: the finest solution is that of its mesh alone, from fewer
    solves.
    """
    make = block_on_a_floor(friction=Coulomb(0.3))
    nested = solve_nested(make, forms.box((3.0, 1.0, 1.0), (6, 2, 2)), 2)
    alone = make(nested.displacement.function_space.mesh)
    alone.solve()
    np.testing.assert_allclose(nested.displacement.x.array, alone.u.x.array, rtol=0, atol=1e-7)
    assert nested.levels[1].linear_solves < alone.history.linear_solves
    assert nested.levels[1].dofs == 3 * 13 * 5 * 5
    assert nested.steps[0].linear_solves <= nested.history.linear_solves


@pytest.mark.mpi(slow=True)
@pytest.mark.one_quick("of", ["energy", "pressure", "peak"])
def test_adaptive_meshes_are_those_of_the_scene(of):
    """The same triangles are divided, and gamma is left to the program alike."""
    goal = Accuracy(target=0.15, of=of, refinement="adaptive")
    bound = (
        0.01 if of == "peak" else 0.5
    )  # a shear that jumps at the corner is a pressure without a limit there
    coarsest = generate_mesh(
        "rectangle", {"length": 3.0, "height": 1.0, "nx": 6, "ny": 2, "cell": "triangle"}, COMM
    )
    scene = parse_scene(
        {
            "mesh": rectangle_mesh(6, 2, length=3.0),
            "element": {"degree": 2},
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": [fixed("left")],
            "body_force": {"y": -8.0},
            "contact": {"boundary": "bottom", "gap": 0.002, "friction": tresca_friction(bound)},
            "solver": {} if of == "pressure" else GAMMA,
        }
    )
    theirs = solve(scene.model_copy(update={"mesh": coarsest, "accuracy": goal}), COMM)
    ours = solve_to_accuracy(
        block_on_a_floor(2, Tresca(bound), **({} if of == "pressure" else GAMMA)), coarsest, goal
    )
    assert [level.dofs for level in ours.levels] == [level.dofs for level in theirs.levels]
    assert ours.convergence_table[-2].pressure == pytest.approx(
        theirs.convergence_table[-2].pressure, rel=1e-6
    )
    assert ours.convergence_table[-2].energy == pytest.approx(
        theirs.convergence_table[-2].energy, rel=1e-6
    )
    assert ours.history.linear_solves == theirs.history.linear_solves
    costs = ours.cost, theirs.cost
    assert [cost.of for cost in costs] == [of, of]
    assert of != "peak" or ours.convergence_table[-2].peak == pytest.approx(
        theirs.convergence_table[-2].peak, rel=1e-5
    )
    for name in ("error", "dofs", "next_error", "next_dofs"):
        assert getattr(costs[0], name) == pytest.approx(getattr(costs[1], name), rel=1e-6), name
    took = sum(level.seconds for level in ours.levels)
    assert costs[0].seconds == pytest.approx(took)


def test_budget_ends_by_name():
    """The answer is that of the last mesh, in the error."""
    goal = Accuracy(target=1e-6, memory=1e-3)
    with pytest.raises(ConvergenceError, match="budget ends before the accuracy") as error:
        solve_to_accuracy(
            block_on_a_floor(), forms.box((3.0, 1.0), (6, 2), comm=MPI.COMM_SELF), goal
        )
    assert error.value.solution.status is Status.BUDGET
    assert error.value.solution.certificate.holds


def without_stress(mesh):
    """The block on a floor, with no form of its stress."""
    problem = block_on_a_floor()(mesh)
    problem.assembled.forms = replace(problem.assembled.forms, stress=None)
    return problem


def test_what_is_refused():
    """Before anything is solved."""
    mesh, family = forms.box((3.0, 1.0), (3, 1), comm=MPI.COMM_SELF), disks(0.5)
    squares = forms.box((3.0, 1.0), (3, 1), dmesh.CellType.quadrilateral, MPI.COMM_SELF)
    adaptive = {"target": 0.1, "refinement": "adaptive"}

    with pytest.raises(MeshError, match="only triangles can be refined"):
        solve_nested(block_on_a_floor(), squares)
    for wrong, reason in (
        (lambda: solve_nested(block_on_a_floor(), 3), "mesh: must be a mesh"),
        (
            lambda: solve_nested(block_on_a_floor(), mesh, 0),
            "levels: must be a whole number from 1, got 0",
        ),
        (lambda: solve_nested(lambda mesh: None, mesh), "make: must return a ContactProblem, not"),
        (
            lambda: solve_to_accuracy(without_stress, mesh, Accuracy(target=0.1)),
            "stress: is needed",
        ),
        (
            lambda: solve_to_accuracy(hertz(), family, Accuracy(**adaptive)),
            "give the coarsest mesh, not a function",
        ),
    ):
        with pytest.raises(FormError, match=reason):
            wrong()


def test_without_stress_there_is_no_estimate():
    """The meshes are nested all the same."""
    solution = solve_nested(without_stress, forms.box((3.0, 1.0), (6, 2), comm=MPI.COMM_SELF), 2)
    assert solution.converged
    assert (solution.levels, solution.convergence_table) == ((), ())
