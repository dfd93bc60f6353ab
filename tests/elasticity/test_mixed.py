"""The mixed element of Taylor and Hood: exact states for nu up to 1/2, rates without locking,
contact as it is.
"""

import numpy as np
import pytest
import ufl
from certifying import certify
from dolfinx import fem
from hertz import RADIUS, YOUNG, ellipse, half_disk, profile
from mpi4py import MPI
from numpy.testing import assert_allclose
from on_meshes import tensors
from revolved import section
from scene_tables import coulomb_friction, fixed, rectangle_mesh
from scenes import alone, rectangle
from spaces import uneven

from signorini_fx.errors import SceneError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.elasticity.mixed_pressure import MixedDisplacement
from signorini_fx.results.certificate.contact_nodes import Tractions
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.scene import Element
from signorini_fx.scenes.solver import solve

MIXED = {"degree": 2, "volumetric": "mixed"}
CELLS = ["triangle", "quadrilateral", "tetrahedra", "hexahedra"]
PLANE = ("triangle", "quadrilateral")


def pressed(tagged, poisson, length=1.0, force=1.0, **solver):
    """Pressed with half a unit of stress onto a foundation without friction, free at one side."""
    dim, stress = tagged.dimension, force / length**2
    return parse_scene(
        {
            "mesh": tagged,
            "element": MIXED,
            "material": {"young": 10.0 * stress, "poisson": poisson},
            "displacement": [{"boundary": f"low{k}", "xyz"[k]: 0.0} for k in range(dim) if k != 1],
            "traction": {"boundary": "high1", "y": -0.5 * stress},
            "contact": {"boundary": "low1"},
            "solver": {"algorithm": "alm", **solver},
        }
    )


@pytest.mark.mpi
@pytest.mark.one_quick("poisson", [0.3, 0.5])
@pytest.mark.parametrize("cell", CELLS)
def test_patch(cell, poisson):
    """A uniform state on uneven cells: strains and stresses are those of Hooke's law, contact
    carries the load.
    """
    tagged = uneven(cell, MPI.COMM_WORLD)
    solution = solve(pressed(tagged, poisson))
    assert solution.converged
    plane = tagged.dimension == 2
    across = poisson * (1 + poisson) if plane else poisson  # lateral strain times E over the stress
    along = 1 - poisson**2 if plane else 1.0
    outward = -poisson * 0.5 if plane else 0.0
    strains = np.array([across, -along, 0.0 if plane else across]) * 0.5 / 10
    shear_modulus = 10 / (2 * (1 + poisson))
    pressure = 2 * shear_modulus * strains[0]  # sigma_xx = 0
    assert pressure == pytest.approx(3 * poisson / (1 + poisson) * (0.5 - outward) / 3)
    at = solution.model.space.tabulate_dof_coordinates()[:, : tagged.dimension]
    found = solution.displacement.x.array.reshape(at.shape)
    assert_allclose(found, at * strains[: tagged.dimension], rtol=0, atol=1e-10)
    assert_allclose(solution.displacement.hydrostatic.x.array, pressure, rtol=1e-9)
    tensor = tensors(solution.stress.tensor)
    assert_allclose(tensor, np.broadcast_to(np.diag([0, -0.5, outward]), tensor.shape), atol=1e-9)
    recovered = tensors(solution.stress.recovered.tensor)
    assert_allclose(
        recovered, np.broadcast_to(np.diag([0, -0.5, outward]), recovered.shape), atol=2e-5
    )
    assert_allclose(solution.contact.pressure, 0.5, rtol=1e-8)
    assert solution.certificate.worst < 1e-9
    volume = 3.0
    assert solution.last_step.strain_energy == pytest.approx(
        0.5 * 0.5 * -strains[1] * volume, rel=1e-9
    )
    assert solution.stress.error < 1e-4


@pytest.mark.mpi
@pytest.mark.parametrize("poisson", [0.3, 0.5])
def test_augmentation(poisson):
    """Its limit is the same for every gamma: a part is open, a part slips, and a part sticks."""
    friction = coulomb_friction(0.3)
    found = []
    for settings in ({}, {"gamma_n": 1e3, "gamma_t": 1e3}):
        mesh = uneven("triangle", MPI.COMM_WORLD)
        scene = pressed(mesh, poisson, algorithm="alm", **settings).model_dump(
            exclude_unset=True
        ) | {
            "mesh": mesh,
            "contact": {"boundary": "low1", "friction": friction},
            "traction": {"boundary": "high1", "y": "-1 + 0.45*x[0]", "x": 0.05},
        }
        found.append(solve(parse_scene(scene)))
    limit, other = found
    assert limit.certificate.holds
    closed = parallel.gather_rows(MPI.COMM_WORLD, limit.contact.pressure[:, None] > 0)
    assert 0 < closed.sum() < closed.size
    assert limit.contact.pressure == pytest.approx(other.contact.pressure, abs=1e-6)
    assert limit.contact.shear == pytest.approx(other.contact.shear, abs=1e-6)
    assert limit.displacement.hydrostatic.x.array == pytest.approx(
        other.displacement.hydrostatic.x.array, abs=1e-6
    )


@pytest.mark.mpi
@pytest.mark.one_quick("poisson", [0.3, 0.5])
@pytest.mark.parametrize("cell", ["quadrilateral", "tetrahedra"])
def test_heated_patch(cell, poisson):
    """The same, heated: it expands freely but for plane strain, where E e is missing across the
    plane.
    """
    tagged, e = uneven(cell, MPI.COMM_WORLD), 0.02
    scene = pressed(tagged, poisson).model_dump(exclude_unset=True) | {
        "mesh": tagged,
        "material": {"young": 10.0, "poisson": poisson, "expansion": 2.0},
        "temperature": [{"change": 0.75 * e / 2}, {"change": "0.25 * 0.02 / 2", "factors": [1.0]}],
    }
    solution = solve(parse_scene(scene))
    plane = tagged.dimension == 2
    outward = -poisson * 0.5 - 10.0 * e if plane else 0.0
    stress = np.diag([0.0, -0.5, outward])
    strain = ((1 + poisson) * stress - poisson * np.trace(stress) * np.eye(3)) / 10.0
    at = solution.model.space.tabulate_dof_coordinates()[:, : tagged.dimension]
    found = solution.displacement.x.array.reshape(at.shape)
    assert_allclose(found, at * (np.diag(strain) + e)[: tagged.dimension], rtol=0, atol=1e-10)
    tensor = tensors(solution.stress.tensor)
    assert_allclose(tensor, np.broadcast_to(stress, tensor.shape), atol=1e-9)
    recovered = tensors(solution.stress.recovered.tensor)
    assert_allclose(recovered, np.broadcast_to(stress, recovered.shape), atol=2e-5)
    assert_allclose(solution.contact.pressure, 0.5, rtol=1e-8)
    assert solution.certificate.worst < 1e-9
    assert solution.last_step.strain_energy == pytest.approx(
        np.sum(stress * strain) / 2 * 3.0, rel=1e-9
    )
    assert solution.stress.error < 1e-4


# --- a state that was made up ---------------------------------------------------------------------

AMPLITUDE, TENSION, E = 1e-2, 0.3, 10.0


class MadeUp:
    """u = (a sin x cos y - c x^2 y / 2, -a cos x sin y) and p = P x y, with c = P / lambda."""

    def __init__(self, poisson):
        self.mu = E / (2 * (1 + poisson))
        self.c = TENSION * (1 + poisson) * (1 - 2 * poisson) / (E * poisson)

    def u(self, x):
        a = AMPLITUDE
        return np.array(
            [
                a * np.sin(x[0]) * np.cos(x[1]) - self.c * x[0] ** 2 * x[1] / 2,
                -a * np.cos(x[0]) * np.sin(x[1]),
            ]
        )

    def p(self, x):
        return TENSION * x[0] * x[1]

    def force(self, x):
        """-div sigma = 2 mu u_0 + mu c (2 y, x) + grad p."""
        rest = np.array([self.c * x[0] ** 2 * x[1] / 2, 0 * x[0]])
        grown = self.mu * self.c * np.array([2 * x[1], x[0]])
        return 2 * self.mu * (self.u(x) + rest) + grown + TENSION * np.array([x[1], x[0]])

    def traction(self, x):
        """On the right side, whose normal is along x[0]."""
        strain = AMPLITUDE * np.cos(x[0]) * np.cos(x[1]) - self.c * x[0] * x[1]
        return np.array([2 * self.mu * strain - self.p(x), -2 * self.mu * self.c * x[0] ** 2 / 4])

    def errors(self, count, cell, poisson):
        """Relative errors of displacement and pressure in L2."""
        tagged = rectangle(length=1.5, height=1.0, nx=count, ny=count, cell=cell)
        both = {key: (lambda x, k=k: self.u(x)[k]) for k, key in enumerate("xy")}
        scene = parse_scene(
            {
                "mesh": tagged,
                "element": MIXED,
                "material": {"young": E, "poisson": poisson},
                "displacement": [{"boundary": side, **both} for side in ("left", "bottom", "top")],
                "traction": {
                    "boundary": "right",
                    **{k: (lambda x, k=k: self.traction(x)["xy".index(k)]) for k in "xy"},
                },
                "body_force": {k: (lambda x, k=k: self.force(x)["xy".index(k)]) for k in "xy"},
            }
        )
        solution = alone(scene)
        assert solution.converged
        richer = fem.functionspace(tagged.mesh, ("Lagrange", 4, (3,)))
        exact = fem.Function(richer)
        exact.interpolate(lambda x: np.array([*self.u(x), self.p(x)]))
        y, p = solution.displacement, solution.displacement.hydrostatic
        found = []
        for ours, theirs in ((y, ufl.as_vector((exact[0], exact[1]))), (p, exact[2])):
            squares = [ufl.inner(one, one) * ufl.dx for one in (ours - theirs, theirs)]
            found.append(
                np.sqrt(np.divide(*(fem.assemble_scalar(fem.form(square)) for square in squares)))
            )
        return np.array(found)


@pytest.mark.one_quick("cell", PLANE)
def test_rates_without_locking(cell):
    """Orders 3 and 2 in L2, and errors that do not depend on Poisson's ratio."""
    errors = np.array(
        [
            [MadeUp(nu).errors(count, cell, nu) for count in (4, 8)]
            for nu in (0.3, 0.49, 0.4999, 0.5)
        ]
    )
    rates = np.log2(errors[:, 0] / errors[:, 1])
    assert (rates > [2.8, 1.9]).all()
    assert (errors[2:] < 1.2 * errors[1]).all()
    assert (errors[1:] < 5 * errors[0]).all()  # which has a change of volume to represent as well
    assert (errors[:, 1] < [5e-4, 5e-3]).all()


# --- contact --------------------------------------------------------------------------------------


@pytest.mark.one_quick("cell", PLANE)
def test_hertz_incompressible(cell):
    """Half-width and peak of a rubber cylinder with E* = E / (1 - 1/4), from the load."""
    scene = half_disk(cell=cell, degree=2, size=0.04)
    rubber = scene.material[0].model_copy(update={"poisson": 0.5})
    scene = scene.model_copy(update={"material": (rubber,), "element": Element(**MIXED)})
    solution = alone(scene)
    assert solution.converged
    x, pressure, weight, _ = profile(solution)
    load = 2 * np.dot(weight, pressure)
    half_width = np.sqrt(4 * load * RADIUS / (np.pi * YOUNG / (1 - 0.25)))
    assert ellipse(x, pressure, half_width) == pytest.approx(
        (half_width, 2 * load / (np.pi * half_width)), rel=6e-3
    )


INNER, OUTER, GAP, INSIDE = 1.0, 2.0, 0.01, 3.0


def in_a_pipe(count, cell="quadrilateral", comm=MPI.COMM_SELF, **solver):
    """An incompressible ring between two plates, pressed by a fluid inside against a stiff pipe."""
    return solve(
        parse_scene(
            {
                "mesh": section(INNER, OUTER, 0.5, cell, (count, max(1, count // 2)), comm),
                "element": MIXED,
                "material": {"young": 200.0, "poisson": 0.5, "hypothesis": "axisymmetric"},
                "displacement": [fixed(side, "y") for side in ("bottom", "top")],
                "traction": {"boundary": "inside", "pressure": INSIDE},
                "contact": {"boundary": "outside", "gap": GAP},
                "solver": {"algorithm": "alm", "tolerance": 1e-12, **solver},
            }
        ),
        comm,
    )


@pytest.mark.one_quick("cell", PLANE)
def test_ring_in_a_pipe(cell):
    """u = c / r with c = gap times radius, p uniform, and the contact pressure p_i - 2 mu c (1 /
    a^2 - 1 / b^2).
    """
    c, mu, found = GAP * OUTER, 200.0 / 3, []
    for count in (2, 4, 8):
        solution = in_a_pipe(count, cell)
        assert solution.converged
        r = solution.model.space.tabulate_dof_coordinates()[:, 0]
        radial = solution.displacement.x.array[::2]
        pressure = solution.displacement.hydrostatic.x.array
        touching = solution.contact.pressure
        expected = INSIDE - 2 * mu * c * (1 / INNER**2 - 1 / OUTER**2)
        exact = INSIDE - 2 * mu * c / INNER**2
        found.append(
            [
                np.abs(radial - c / r).max() / c,
                np.abs(pressure - exact).max(),
                np.abs(touching - expected).max(),
            ]
        )
    rates = np.log2(np.divide(found[0], found[2])) / 2
    assert (rates > [2.5, 1.5, 1.5]).all()
    assert (np.array(found[2]) < [2e-4, 0.05, 0.02]).all()


@pytest.mark.mpi
@pytest.mark.one_quick("linear_algebra", ["full", "condensed"])
@pytest.mark.parametrize("cell", ["triangle", "tetrahedra"])
def test_ways_to_solve(cell, linear_algebra):
    """Friction of Coulomb, skew supports and a ramp: all unknowns or those of contact lead to one
    result.
    """
    comm = MPI.COMM_WORLD
    tagged = uneven(cell, comm)  # one mesh: another one may be divided among the ranks differently
    reference = rubbed(cell, tagged, algorithm="ssn", linear_algebra="full")
    other = rubbed(
        cell,
        tagged,
        algorithm="alm",
        coulomb="newton",
        tolerance=1e-11,
        linear_algebra=linear_algebra,
    )
    for solution in (reference, other):
        assert solution.converged
        assert solution.last_step.step == 2
        sliding = np.linalg.norm(solution.contact.shear, axis=1)
        assert (sliding <= 0.3 * solution.contact.pressure + 1e-6).all()
    if comm.size == 1:
        assert other.linear_algebra.startswith(linear_algebra)
    energy = reference.certificate.strain_energy
    assert other.certificate.strain_energy == pytest.approx(energy, rel=1e-4)
    for one, two in (
        (other.displacement, reference.displacement),
        (other.displacement.hydrostatic, reference.displacement.hydrostatic),
    ):
        size = np.abs(two.x.array).max(initial=0.0)
        assert_allclose(one.x.array, two.x.array, rtol=0, atol=1e-3 * size)


def rubbed(cell, tagged, poisson=0.5, **solver):
    """The block, pressed and pushed sideways in two steps, with a support along no axis at one
    end.
    """
    held = {"boundary": "low0", "normal": 0.0} if cell in PLANE else fixed("low0", "xz")
    scene = parse_scene(
        {
            "mesh": tagged,
            "element": MIXED,
            "material": {"young": 10.0, "poisson": poisson},
            "displacement": held,
            "traction": [
                {"boundary": "high1", "y": -0.5},
                {"boundary": "high0", "x": 0.2, "factors": [0.5, 1.0]},
            ],
            "contact": {"boundary": "low1", "friction": coulomb_friction(0.3)},
            "solver": solver,
        }
    )
    return solve(scene, tagged.mesh.comm)


@pytest.mark.mpi
@pytest.mark.parametrize("cell", ["quadrilateral", "tetrahedra"])
def test_certificate(cell):
    """A pressure that is wrong, as a whole, at one node, or by a constant, is no solution; nor is a
    wrong volume.
    """
    comm = MPI.COMM_WORLD
    solution = solve(pressed(uneven(cell, comm), 0.4999), comm)

    def verdict(shift=0.0, factor=1.0, bump=0.0, stretch=1.0):
        y = solution.displacement
        pressure = y.hydrostatic.copy()
        pressure.x.array[:] = factor * pressure.x.array + shift
        if comm.rank == 0:
            pressure.x.array[3] += bump
        pressure.x.scatter_forward()
        other = MixedDisplacement(y.function_space, pressure)
        other.x.array[:] = stretch * y.x.array
        d, contact = solution.model, solution.contact
        return certify(solution.statement, d.tagged, other, Tractions.of(contact))

    assert verdict().holds
    assert verdict().equilibrium < 1e-10
    for wrong in ({"shift": 1e-3}, {"factor": 1.001}, {"bump": 1e-3}, {"stretch": 1.001}):
        assert not verdict(**wrong).holds
        assert verdict(**wrong).equilibrium > 1e-5


def test_nothing_determines_the_pressure():
    """An incompressible body whose whole boundary is held is refused; with a contact that yields,
    it is solved.
    """
    tagged = rectangle(nx=3, ny=2)
    every = [fixed(side) for side in ("left", "right", "bottom", "top")]
    data = {
        "mesh": tagged,
        "element": MIXED,
        "material": {"young": 1.0, "poisson": 0.5},
        "body_force": {"y": "-1 if x[0] < 0.5 else 0"},
    }
    with pytest.raises(SceneError, match="the pressure is not determined"):
        alone(parse_scene({**data, "displacement": every}))
    solution = alone(
        parse_scene(
            {
                **data,
                "displacement": every[:2] + every[3:],
                "contact": {"boundary": "bottom", "gap": 0.01},
                "solver": {"linear_algebra": "condensed"},
            }
        )
    )
    assert solution.converged
    assert solution.linear_algebra == "full: contact and supports enclose the incompressible body"
    assert solution.contact.in_contact.any()
    assert solution.contact.u_n.min() < -0.01
    flux = solution.contact.boundary.weight @ solution.contact.u_n
    assert abs(flux) < 1e-12  # what goes down at one place comes up at another


# --- estimates and sequences of meshes ------------------------------------------------------------


def rubber(**more):
    """An incompressible block on a bowl."""
    return alone(
        parse_scene(
            {
                "mesh": {"generator": "block", "parameters": {"nx": 12, "ny": 4}},
                "element": MIXED,
                "material": {"young": 10.0, "poisson": 0.5},
                "displacement": {"boundary": "top", "x": 0.0, "y": -0.05},
                "contact": {
                    "boundary": "bottom",
                    "gap": "0.05 * (x[0] - 1.4)**2",
                    "friction": coulomb_friction(0.2),
                },
                **more,
            }
        )
    )


BASE = {
    "mesh": rectangle_mesh(2, 2),
    "element": MIXED,
    "material": {"young": 1.0, "poisson": 0.4},
    "contact": {"boundary": "bottom"},
}
REFUSED = {
    "no pressure": (
        {"element": {"degree": 2}, "material": {"young": 1.0, "poisson": 0.5}},
        "must be below 0.5",
    ),
    "degree": ({"element": {"degree": 1, "volumetric": "mixed"}}, "element.degree: must be 2"),
    "nu = 0": ({"material": {"young": 1.0, "poisson": 0.0}}, "poisson: must be above 0"),
    "plane stress": (
        {"material": {"young": 1.0, "poisson": 0.4, "hypothesis": "plane stress"}},
        "nothing locks",
    ),
    "krylov": ({"solver": {"linear_algebra": "krylov"}}, "positive definite"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_refused(name):
    """What the mixed element is not possible with is one clear error."""
    changes, message = REFUSED[name]
    with pytest.raises(SceneError, match=message):
        parse_scene({**BASE, **changes})


def test_a_foundation_that_moves_in_load_steps():
    """The last of two load steps has the displacement and the pressure of its gap alone."""
    scene = {
        **BASE,
        "material": {"young": 1.0, "poisson": 0.5},
        "displacement": fixed("top"),
        "traction": {"boundary": "right", "x": 0.01},
    }
    moved, alone_in_place = (
        solve(parse_scene({**scene, "contact": {"boundary": "bottom", "gap": gap}, **steps}))
        for gap, steps in (("-0.01 * t", {"load_steps": {"times": [1.0, 2.0]}}), (-0.02, {}))
    )
    assert moved.converged
    for one, other in zip(
        (moved.displacement, moved.displacement.hydrostatic),
        (alone_in_place.displacement, alone_in_place.displacement.hydrostatic),
        strict=True,
    ):
        assert_allclose(one.x.array, other.x.array, atol=1e-12)
