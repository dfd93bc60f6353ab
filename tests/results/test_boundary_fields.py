"""Contact fields on the mesh of the contact boundary: of scenes and forms, all elements, on any
number of ranks.
"""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI
from scene_tables import coulomb_friction, fixed, rectangle_mesh
from scenes import alone, example1

from signorini_fx import solve
from signorini_fx.scenes.reading import parse_scene

COMM = MPI.COMM_WORLD
YOUNG, POISSON, PRESSURE, SHEAR, GAMMA, ROUND_OFF = 5000.0, 0.3, 20.0, 4.0, 1e6, 1e-10
PLANE = [("rectangle", cell, degree) for cell in ("triangle", "quadrilateral") for degree in (1, 2)]
SPACE = [("box", cell, degree) for cell in ("tetrahedron", "hexahedron") for degree in (1, 2)]


def whole(form):
    """An integral over the meshes of all ranks."""
    return COMM.allreduce(fem.assemble_scalar(fem.form(form)))


def columns(function):
    """Values of the nodes of this rank, one row a node."""
    return function.x.array.reshape(-1, function.function_space.dofmap.index_map_bs)


def positions(function):
    return function.function_space.tabulate_dof_coordinates()


def block(generator, cell, degree):
    """A block that is pressed and pushed on a regularised foundation with a constant state of
    stress: it moves by
    p / gamma_n downwards and t / gamma_t along.
    """
    plane = generator == "rectangle"
    down = "y" if plane else "z"
    counts = {"nx": 4, "ny": 3} if plane else {"nx": 3, "ny": 2, "nz": 2}
    traction = [{"boundary": "top", down: -PRESSURE, "x": SHEAR}]
    traction += [
        {"boundary": side, down: sign * SHEAR} for side, sign in (("left", -1.0), ("right", 1.0))
    ]
    return {
        "mesh": {
            "generator": generator,
            "parameters": {"length": 1.5, "height": 1.0, **counts, "cell": cell},
        },
        "element": {"degree": degree},
        "material": {
            "young": YOUNG,
            "poisson": 0.0,
        },  # otherwise it widens, and slips by more at its ends
        "traction": traction,
        "contact": {"boundary": "bottom", "friction": coulomb_friction(0.5)},
        "solver": {"gamma_n": GAMMA, "gamma_t": GAMMA},
    }


@pytest.mark.one_quick(("generator", "cell", "degree"), PLANE + SPACE)
@pytest.mark.mpi
def test_a_constant_state(generator, cell, degree):
    """Pressure, shear, gap and slip at every node, their integrals, and the area, are exact."""
    data = block(generator, cell, degree)
    solution = solve(parse_scene(data), COMM)
    fields = solution.boundary_fields()
    mesh, last = fields.mesh, solution.displacement.function_space.mesh.geometry.dim - 1
    assert (mesh.topology.dim, mesh.geometry.dim) == (last, last + 1)
    assert fields.pressure.x.array == pytest.approx(PRESSURE, rel=ROUND_OFF)
    shear = np.zeros(last + 1)
    shear[0] = SHEAR
    assert columns(fields.shear) == pytest.approx(
        np.tile(shear, (len(columns(fields.shear)), 1)), abs=1e-8
    )
    assert fields.gap.x.array == pytest.approx(-PRESSURE / GAMMA, rel=1e-7)
    assert columns(fields.slip)[:, 0] == pytest.approx(SHEAR / GAMMA, rel=1e-5)
    area = 1.5
    assert whole(ufl.inner(fields.shear, fields.slip) * ufl.dx) == pytest.approx(
        SHEAR**2 / GAMMA * area, rel=1e-5
    )
    assert whole(fem.Constant(mesh, 1.0) * ufl.dx) == pytest.approx(area, rel=ROUND_OFF)
    assert whole(fields.pressure * ufl.dx) == pytest.approx(
        solution.contact.forces[0][last], rel=ROUND_OFF
    )
    assert whole(fields.shear[0] * ufl.dx) == pytest.approx(
        -solution.contact.forces[1][0], rel=ROUND_OFF
    )
    assert np.abs(positions(fields.pressure)[:, last]).max(initial=0) == 0


@pytest.mark.one_quick("degree", [1, 2])
@pytest.mark.mpi
def test_values_at_points(degree):
    """Each node has the value that the contact table has at its position; forces are integrals, on
    any ranks.
    """
    scene = example1(coefficient=0.3, nx=24, ny=8, degree=degree)
    solution = solve(scene, COMM)
    fields, table = solution.boundary_fields(0), solution.table.columns
    order = np.argsort(table["x"])
    x = positions(fields.pressure)[:, 0]
    rows = order[np.searchsorted(table["x"][order], x - 1e-9)]
    assert table["x"][rows] == pytest.approx(x, abs=1e-12)
    assert fields.pressure.x.array == pytest.approx(table["pressure"][rows], abs=1e-12)
    assert fields.gap.x.array == pytest.approx((table["gap"] - table["u_n"])[rows], abs=1e-15)
    # In 2D the tangent of a normal (0, -1) is (1, 0).
    assert columns(fields.shear)[:, 0] == pytest.approx(table["shear"][rows], abs=1e-12)
    assert columns(fields.slip)[:, 0] == pytest.approx(table["u_t"][rows], abs=1e-15)
    assert np.ptp(table["pressure"]) > PRESSURE / 2
    pressed, pushed = solution.contact.forces
    assert whole(fields.pressure * ufl.dx) == pytest.approx(pressed[1], rel=1e-12)
    assert whole(fields.shear[0] * ufl.dx) == pytest.approx(-pushed[0], rel=1e-9, abs=1e-9)
    serial = alone(scene)
    assert whole(fields.pressure**2 * ufl.dx) == pytest.approx(
        fem.assemble_scalar(fem.form(serial.boundary_fields().pressure ** 2 * ufl.dx)), rel=1e-8
    )


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.mpi
def test_axisymmetric(degree):
    """The force is the integral times 2 pi r."""
    solution = solve(
        parse_scene(
            {
                "mesh": rectangle_mesh(8, 4, length=1.0),
                "element": {"degree": degree},
                "material": {"young": YOUNG, "poisson": 0.0, "hypothesis": "axisymmetric"},
                "traction": {"boundary": "top", "y": -PRESSURE},
                "contact": {"boundary": "bottom"},
            }
        ),
        COMM,
    )
    fields = solution.boundary_fields()
    radius = ufl.SpatialCoordinate(fields.mesh)[0]
    force = whole(2 * np.pi * radius * fields.pressure * ufl.dx)
    assert force == pytest.approx(np.pi * PRESSURE, rel=1e-9)
    assert force == pytest.approx(solution.contact.forces[0][1], rel=1e-9)


def test_without_contact():
    data = block("rectangle", "quadrilateral", 1)
    del data["contact"]
    data["displacement"] = fixed("bottom")
    with pytest.raises(ValueError, match="the scene has no contact"):
        alone(parse_scene(data)).boundary_fields()
