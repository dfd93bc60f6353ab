"""Pressure that follows a body at finite strains: work on a volume, objectivity, closed forms, and
free edges.
"""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from on_meshes import vector_space
from scene_tables import circle_shape, fixed, plane_shape, rectangle_mesh
from scenes import alone
from support.nonlinear_bodies import inside_of_tube
from support.nonlinear_scenes import material

from signorini_fx import follower_pressure, solve, write_results
from signorini_fx.mechanics.assembly.mesh_entities import assemble
from signorini_fx.mechanics.mesh.tagged import tagged_mesh
from signorini_fx.scenes.reading import parse_scene


def domain(kind, degree):
    """A mesh away from the axis, and a displacement that is not small; quadratic ones have curved
    sides.
    """
    if kind == "space":
        mesh = dmesh.create_box(
            MPI.COMM_WORLD, [[0.0] * 3, [1.0] * 3], [2, 2, 2], dmesh.CellType.hexahedron
        )
    else:
        mesh = dmesh.create_rectangle(
            MPI.COMM_WORLD, [[1.0, 0.0], [2.0, 1.0]], [3, 2], dmesh.CellType.triangle
        )
    dim = mesh.geometry.dim
    u = fem.Function(vector_space(mesh, degree))
    waves = np.array([[1.1, 0.7, 0.4], [0.3, 1.9, 0.8], [0.5, 0.2, 1.3]])[:dim]
    u.interpolate(lambda x: 0.2 * np.sin(waves @ x + np.arange(dim)[:, None]))
    return mesh, u


CASES = [("axisymmetric", 2), ("plane", 1), ("plane", 2), ("space", 1)]


@pytest.mark.mpi
@pytest.mark.one_quick(("kind", "degree"), CASES)
def test_work_on_a_closed_boundary_is_that_of_its_volume(kind, degree):
    """The forces are -p times the derivative of the deformed volume, node by node."""
    mesh, u = domain(kind, degree)
    v, around = ufl.TestFunction(u.function_space), 1.0
    gradient = ufl.Identity(len(u)) + ufl.grad(u)
    volume = ufl.det(gradient)
    if kind == "axisymmetric":
        around = ufl.SpatialCoordinate(mesh)[0]
        volume *= 1 + u[0] / around
    exact = {"quadrature_degree": 8}
    derivative = ufl.derivative(volume * around * ufl.dx(metadata=exact), u, v)
    traction = follower_pressure(fem.Constant(mesh, 3.0), u, axisymmetric=kind == "axisymmetric")
    forces = assemble(fem.form(ufl.inner(traction, v) * around * ufl.ds(metadata=exact)))
    expected = -3.0 * assemble(fem.form(derivative))
    assert np.abs(expected).max() > 0.1
    assert forces == pytest.approx(expected, abs=1e-12)


def tube(pressure, law, comm, **further):
    """The wall of a tube whose length does not change, pressed from inside; a wall around it is far
    away.
    """
    mesh = dmesh.create_rectangle(
        comm, [[1.0, 0.0], [2.0, 0.1]], [16, 1], dmesh.CellType.quadrilateral
    )
    places = {"left": (0, 1.0), "right": (0, 2.0), "bottom": (1, 0.0), "top": (1, 0.1)}
    sides = {
        name: dmesh.locate_entities_boundary(
            mesh, 1, lambda x, axis=axis, at=at: np.isclose(x[axis], at)
        )
        for name, (axis, at) in places.items()
    }
    scene = {
        "mesh": tagged_mesh(mesh, sides),
        "material": law | {"hypothesis": "axisymmetric"},
        "element": {"degree": 2},
        "displacement": [fixed("bottom", "y"), fixed("top", "y")],
        "traction": {"boundary": "left", "pressure": pressure},
        "contact": {"boundary": "right", "foundation": plane_shape([9.0, 0.0], [-1.0, 0.0])},
        "load_steps": {"steps": 2},
    }
    return parse_scene(scene | further)


@pytest.mark.mpi(slow=True)
def test_a_tube_by_its_radial_equilibrium():
    """The inside is wider by more than a quarter, and the area that is pressed with it."""
    pressure = 14.0
    law = {"law": "neo-hooke", "young": 100.0, "poisson": 0.3}
    solution = solve(tube(pressure, law, MPI.COMM_WORLD))
    assert solution.converged
    assert solution.certificate.holds
    u, space = solution.displacement, solution.displacement.function_space
    inside = np.isclose(space.tabulate_dof_coordinates()[:, 0], 1.0)
    widest = MPI.COMM_WORLD.allreduce(u.x.array[::2][inside].max(initial=0.0), MPI.MAX)
    exact = inside_of_tube(1.0, 2.0, pressure) - 1.0
    assert exact > 0.25
    assert widest == pytest.approx(exact, rel=1e-5)


def beam(pressure, **further):
    """A cantilever with free edges that is pressed from above, over a foundation that it may
    reach.
    """
    scene = {
        "mesh": rectangle_mesh(24, 4, length=4.0, height=0.5),
        "material": material("neo-hooke"),
        "displacement": fixed("left"),
        "traction": {"boundary": "top", "pressure": pressure},
        "contact": {"boundary": "bottom", "gap": 50.0},
    }
    return parse_scene(scene | further)


def chord(solution, ends):
    """From one node to another where they have been displaced."""
    u = solution.displacement
    x = u.function_space.tabulate_dof_coordinates()[:, :2]
    places = x + u.x.array.reshape(-1, 2)[: len(x)]
    first, last = (places[np.argmin(np.linalg.norm(x - end, axis=1))] for end in ends)
    return last - first


@pytest.mark.slow
def test_a_cantilever(tmp_path):
    """Its tangent is not symmetric.  What holds it takes p times the chord of the deformed side,
    turned.
    """
    ground = {"boundary": "bottom", "foundation": circle_shape([3.0, -1.5], 0.5)}
    solution = alone(beam("0.5 * t", load_steps={"times": [1.0]}, contact=ground))
    assert solution.converged
    assert solution.certificate.holds
    assert any("the tangent is not symmetric" in event for event in solution.history.events)
    (dx, dy) = chord(solution, ((0.0, 0.5), (4.0, 0.5)))
    assert dy < -1.0
    pushed = 0.5 * np.array([dy, -dx])
    summary = write_results(solution, str(tmp_path), pictures=False)
    resultants = solution.resultants
    assert resultants.of("top").force == pytest.approx(pushed, abs=1e-9)
    on_ground = np.sum(solution.contact.forces, axis=0)
    assert np.abs(on_ground).max() > 0.1
    assert resultants.of("left").force + on_ground == pytest.approx(-pushed, abs=1e-7)
    assert summary["converged"]
