"""Torsion of bodies of revolution with friction: forms on a section in 3D, against formulas and
statics.
"""

import runpy
from pathlib import Path

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from forms import side
from mpi4py import MPI
from on_meshes import hooke_stress, strain_of_section
from scipy.integrate import quad
from scipy.optimize import fsolve
from scipy.special import ellipe, ellipk

from signorini_fx import ContactProblem, Coulomb, Foundation, embed_in_3d

COMM = MPI.COMM_WORLD
YOUNG, RADIUS, LENGTH, PRESSURE, FRICTION = 1000.0, 1.5, 2.0, 10.0, 0.3


def energy(space, poisson, young=YOUNG):
    """a(., .) of a revolution."""
    u, v, r = (
        ufl.TrialFunction(space),
        ufl.TestFunction(space),
        ufl.SpatialCoordinate(space.mesh)[0],
    )
    stress = hooke_stress(strain_of_section(u, r), young, poisson)
    return ufl.inner(stress, strain_of_section(v, r)) * 2 * np.pi * r * ufl.dx(degree=6)


def section(low, high, counts, kind="quadrilateral", degree=1):
    plane = dmesh.create_rectangle(COMM, [low, high], counts, dmesh.CellType[kind])
    mesh = embed_in_3d(plane)
    return mesh, fem.functionspace(mesh, ("Lagrange", degree, (3,)))


class Cylinder:
    """It stands on a plane, pressed by a uniform pressure and turned by a torque on its top;
    friction alone holds it about the axis.  Without Poisson's ratio the shear is that of the torque
    alone.
    """

    def __init__(self, kind="quadrilateral", degree=1, **settings):
        mesh, space = section([0.0, 0.0], [RADIUS, LENGTH], [6, 3], kind, degree)
        r, v = ufl.SpatialCoordinate(mesh)[0], ufl.TestFunction(space)
        self.mesh, self.torque = mesh, fem.Constant(mesh, 0.0)
        self.friction = fem.Constant(mesh, FRICTION)
        top = dmesh.meshtags(mesh, 1, np.sort(side(mesh, 1, LENGTH)), 1)
        ds = ufl.Measure("ds", domain=mesh, subdomain_data=top)(1, degree=6)
        shear = 2 * self.torque / (np.pi * RADIUS**4) * r  # against x[2], as a rotation about x[1]
        load = -(PRESSURE * v[1] + shear * v[2]) * 2 * np.pi * r * ds
        axis = side(mesh, 0, 0.0)
        held = [
            fem.dirichletbc(0.0, fem.locate_dofs_topological(space.sub(k), 1, axis), space.sub(k))
            for k in (0, 2)
        ]
        floor = Foundation(
            side(mesh, 1, 0.0), friction=Coulomb(self.friction), measure=2 * np.pi * r
        )
        self.problem = ContactProblem(energy(space, 0.0), load, held, floor, **settings)

    @property
    def limit(self):
        """Torque of the friction of a uniform pressure."""
        return 2 / 3 * float(self.friction.value) * PRESSURE * np.pi * RADIUS**3


def test_lubkin():
    """The torque of a sphere by Lubkin's formula, from the angle and the pressure of Hertz's
    contact; the body is finite, and slips outwards a little.
    """
    found = runpy.run_path(str(Path(__file__).parents[2] / "demos" / "forms" / "torsion.py"))
    problem, radius, poisson = found["problem"], found["BALL"]["radius"], found["NU"]
    young, friction = found["E"], found["F"]
    assert problem.solution.converged
    assert not any("inside" in finding.message for finding in problem.solution.findings)
    force = problem.state.forces[0][1]
    a = (3 * force * radius * (1 - poisson**2) / (4 * young)) ** (1 / 3)
    shear, p0 = young / (2 * (1 + poisson)), 3 * force / (2 * np.pi * a**2)

    def angle(c):
        """Of the body, if a disc of radius c sticks."""
        return friction * p0 / (2 * shear) * (ellipk(1 - (c / a) ** 2) - ellipe(1 - (c / a) ** 2))

    def torque(c):
        """It is that of rigid discs of radius b from c to a, each bonded to the body and turned by
        -d angle(b).
        """
        return 16 / 3 * shear * (c**3 * angle(c) + 3 * quad(lambda b: b**2 * angle(b), c, a)[0])

    limit = 3 * np.pi / 16 * friction * force * a
    assert torque(1e-6 * a) == pytest.approx(limit, rel=1e-6)
    assert found["torque"] == pytest.approx(limit, rel=0.005)
    for share, accuracy in ((0.8, 0.04), (0.5, 0.01)):
        turned = -angle(share * a)
        found["moved"].interpolate(
            lambda x, by=turned: np.stack((0 * x[0], 0 * x[0] - found["DOWN"], by * x[0]))
        )
        problem.solve()
        assert problem.certificate.holds
        assert -problem.state.moments[1][1] == pytest.approx(torque(share * a), rel=accuracy)


@pytest.mark.mpi
def test_slip_in_two_directions():
    """A ring that is pushed along a rigid bore and turned in it: friction is against both, in the
    ratio of the slips, which follow from the shear flow in the ring.
    """
    inner, outer, height, tight, push, turn = 1.0, 1.5, 0.5, 0.002, 0.003, 0.005
    mesh, space = section([inner, 0.0], [outer, height], [24, 1])
    v, r = ufl.TestFunction(space), ufl.SpatialCoordinate(mesh)[0]
    inside = side(mesh, 0, inner)
    # without Poisson's ratio u_r = A r + B / r, with u_r = 0 inside and -tight outside
    slope = -tight / (outer - inner**2 / outer)
    pressure = -YOUNG * slope * (1 + inner**2 / outer**2)
    moved = fem.Function(space)
    moved.interpolate(
        lambda x: np.stack((slope * (x[0] - inner**2 / x[0]), 0 * x[0] + push, -turn * x[0]))
    )
    held = [fem.dirichletbc(moved, fem.locate_dofs_topological(space, 1, inside))]
    radial, _ = space.sub(0).collapse()
    narrowed = fem.Function(radial)
    narrowed.interpolate(lambda x: slope * (x[0] - inner**2 / x[0]))
    ends = fem.locate_dofs_geometrical(
        (space.sub(0), radial),
        lambda x: (
            (np.isclose(x[1], 0.0) | np.isclose(x[1], height)) & (x[0] < outer - 1e-9)
        ),  # the bore holds the rest
    )
    held.append(fem.dirichletbc(narrowed, ends, space.sub(0)))
    bore = Foundation(
        side(mesh, 0, outer),
        gap=-tight,
        kind="bilateral",
        friction=Coulomb(FRICTION),
        measure=2 * np.pi * r,
    )
    nothing = ufl.inner(fem.Constant(mesh, (0.0, 0.0, 0.0)), v) * ufl.dx
    problem = ContactProblem(energy(space, 0.0), nothing, held, bore, algorithm="alm")
    problem.solve()
    state, shear = problem.state, YOUNG / 2
    bound = FRICTION * pressure

    def slips(angle):
        """Along the bore and around it, where the shear has this direction."""
        along = push - bound * np.cos(angle) * outer / shear * np.log(outer / inner)
        around = turn * outer - bound * np.sin(angle) * outer**3 / (2 * shear) * (
            inner**-2 - outer**-2
        )
        return along, around

    angle = fsolve(
        lambda at: np.sin(at) * slips(at)[0] - np.cos(at) * slips(at)[1],
        np.arctan2(turn * outer, push),
    )[0]
    assert min(slips(angle)) > 0
    area = 2 * np.pi * outer * height
    expected = bound * area * np.array([np.cos(angle), np.sin(angle) * outer])
    found = -np.array([state.forces[1][1], state.moments[1][1]])
    assert problem.certificate.holds
    assert found == pytest.approx(expected, rel=1e-3)
    assert np.tan(angle) != pytest.approx(
        turn * outer / push, rel=0.05
    )  # the ring's own shear turns it


def test_derivative_of_the_torque():
    """Where everything slips the torque is 2/3 F N R, and so is its derivative over F."""
    cylinder = Cylinder(algorithm="alm")
    problem, space = cylinder.problem, cylinder.problem.u.function_space
    turned = fem.Function(space)
    turned.interpolate(
        lambda x: np.stack((0 * x[0], 0 * x[0] - PRESSURE / YOUNG * LENGTH, -0.5 * x[0]))
    )
    problem.bcs = [
        *problem.bcs,
        fem.dirichletbc(
            turned, fem.locate_dofs_topological(space, 1, side(cylinder.mesh, 1, LENGTH))
        ),
    ]
    problem.solve()
    found = problem.gradient("moment 0 y", cylinder.friction)
    assert abs(found.value) == pytest.approx(cylinder.limit, rel=1e-9)
    assert abs(found.derivatives[0]) == pytest.approx(cylinder.limit / FRICTION, rel=1e-6)
