"""Centrifugal forces on nonlinear bodies: those of the displaced radius at finite strains."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from on_meshes import at_coordinate
from parameters import slow
from scene_tables import box_mesh, fixed
from scenes import alone
from support.nonlinear_bodies import LAME, MU, inside_of_tube
from support.nonlinear_scenes import material

from signorini_fx import solve
from signorini_fx.mechanics.mesh.tagged import tagged_mesh
from signorini_fx.scenes.reading import parse_scene

YOUNG, POISSON = MU * (3 * LAME + 2 * MU) / (LAME + MU), LAME / 2 / (LAME + MU)
RUBBER = {"law": "neo-hooke", "young": YOUNG, "poisson": POISSON}
INSIDE, OUTSIDE = 1.0, 2.0


def ring(law, speed, comm=MPI.COMM_SELF, **further):
    """A ring in plane strain that rotates about its axis, as a body of revolution whose length does
    not change.
    """
    size = [[INSIDE, 0.0], [OUTSIDE, 0.1]]
    mesh = dmesh.create_rectangle(comm, size, [16, 1], dmesh.CellType.quadrilateral)
    ends = {
        name: dmesh.locate_entities_boundary(mesh, 1, at_coordinate(1, at))
        for name, at in (("bottom", 0.0), ("top", 0.1))
    }
    scene = {
        "mesh": tagged_mesh(mesh, ends),
        "material": law | {"hypothesis": "axisymmetric", "density": 2.0},
        "element": {"degree": 2},
        "displacement": [fixed(name, "y") for name in ends],
        "rotation": {"speed": speed, "axis": [0.0, 1.0]},
    }
    return solve(parse_scene(scene | further), comm)


def moved(solution, step):
    """The displacement of the inside along the radius, on one rank."""
    x = solution.model.space.tabulate_dof_coordinates()
    return step.displacement.x.array.reshape(-1, 2)[np.isclose(x[:, 0], INSIDE), 0].mean()


def test_a_ring_of_rubber():
    """Its radius grows, and the force with it, over two load steps, one of which is at three
    quarters of the last square of the speed.
    """
    speed = 0.35 * np.sqrt(MU / 2.0)
    solution = ring(
        RUBBER, speed, rotation={"speed": speed, "axis": [0.0, 1.0], "factors": [0.75, 1.0]}
    )
    for step, share in zip(solution.steps, (0.75, 1.0), strict=True):
        expected = inside_of_tube(INSIDE, OUTSIDE, inertia=2.0 * share * speed**2) - INSIDE
        assert moved(solution, step) == pytest.approx(expected, rel=2e-6)
    assert moved(solution, solution.steps[-1]) > 0.1


@pytest.mark.parametrize("name", ["neo-hooke", "j2"])
def test_small_speeds_are_those_of_the_linear_scene(name):
    """At small strains the forces are those of the undeformed radius; both are the same to first
    order.
    """
    law = material(name)
    solution = ring(law, "1e-3 * t", load_steps={"times": [1.0]})
    linear = ring(
        {key: law[key] for key in ("young", "poisson")}, "1e-3 * t", load_steps={"times": [1.0]}
    )
    wanted = linear.displacement.x.array
    assert np.abs(wanted).max() > 1e-9
    assert np.abs(solution.displacement.x.array - wanted).max() < 1e-5 * np.abs(wanted).max()


@pytest.mark.mpi
def test_a_block_off_the_axis():
    """In 3D about an axis that is no edge of the block: the reactions are the mass times the square
    of the speed times the distance of the deformed centre of mass from the axis.
    """
    speed, comm = 2.0, MPI.COMM_WORLD
    size = {"length": 1.0, "width": 0.5, "height": 0.5, "nx": 4, "ny": 2, "nz": 2}
    scene = {
        "mesh": box_mesh(**size),
        "material": material("mooney-rivlin", density=1.5),
        "displacement": fixed("left", "xyz"),
        "rotation": {"speed": speed, "axis": [0.0, 1.0, 1.0], "about": [-0.5, 0.2, 0.0]},
    }
    solution = solve(parse_scene(scene), comm)
    mesh, u = solution.model.space.mesh, solution.displacement
    place = ufl.SpatialCoordinate(mesh) + u
    moments = [
        fem.assemble_scalar(fem.form(place[k] * ufl.dx(metadata={"quadrature_degree": 4})))
        for k in range(3)
    ]
    volume = 0.25
    centre = np.array([comm.allreduce(moment) for moment in moments]) / volume
    along = np.array([0.0, 1.0, 1.0]) / np.sqrt(2)
    arm = centre - np.array([-0.5, 0.2, 0.0])
    pull = 1.5 * volume * speed**2 * (arm - along * (arm @ along))
    assert solution.resultants.of("left").force == pytest.approx(-pull, rel=1e-9)
    assert abs(centre[0] - 0.5) > 1e-3


CALCULIX = {
    "neo-hooke, isochoric": (3.268078e-1, -1.783538e-1, 1.035890e-1),
    "mooney-rivlin": (3.807301e-1, -2.142375e-1, 1.277780e-1),
}


@pytest.mark.parametrize("name", ["mooney-rivlin", slow("neo-hooke, isochoric")])
def test_a_blade_of_calculix(name):
    """A blade that bends as far as a sixth of its length: CalculiX 2.20, C3D8 with NLGEOM and
    CENTRIF, whose forces are those of the places where a step begins, in 22 steps with the same
    speed, the last two of which have these digits.
    """
    size = {
        "length": 2.0,
        "width": 1.0,
        "height": 1.0,
        "nx": 4,
        "ny": 2,
        "nz": 2,
        "cell": "hexahedron",
    }
    scene = {
        "mesh": box_mesh(**size),
        "material": material(name, density=1.5),
        "element": {"volumetric": "full"},
        "displacement": fixed("left", "xyz"),
        "rotation": {
            "speed": float(np.sqrt(6.0)),
            "axis": [0.0, 1.0, 1.0],
            "about": [-0.5, 0.2, 0.0],
        },
    }
    solution = alone(parse_scene(scene))
    x = solution.model.space.tabulate_dof_coordinates()
    middle = np.argmin(np.abs(x - 1.0).sum(axis=1))
    moved = solution.displacement.x.array.reshape(-1, 3)[middle]
    assert moved == pytest.approx(np.array(CALCULIX[name]), abs=1e-7)
