"""The Cauchy stress of scenes with nonlinear materials: closed forms, linear scenes, balance, units
and ranks.
"""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from mpi4py import MPI
from numpy.testing import assert_allclose
from on_meshes import trial_and_test
from parameters import slow
from petsc4py import PETSc
from scene_tables import circle_shape, fixed
from scenes import alone
from scipy.optimize import brentq
from support.nonlinear_scenes import block, material, pressed_cube

from signorini_fx import solve

RUBBER = {"young": 100.0, "poisson": 0.3}
METAL = {"young": 100.0, "poisson": 0.3, "yield_stress": 2.0, "hardening": 20.0}
PRESSED_BLOCKS = {
    "plane strain": ({}, {}, (0,)),
    "plane strain, degree 2": ({}, {"degree": 2}, (0,)),
    "plane strain, reduced": ({}, {"volumetric": "reduced"}, (0,)),
    "plane strain, degree 2, reduced": ({}, {"degree": 2, "volumetric": "reduced"}, (0,)),
    "axisymmetric": ({"hypothesis": "axisymmetric"}, {}, (0, 2)),
    "axisymmetric, degree 2": ({"hypothesis": "axisymmetric"}, {"degree": 2}, (0, 2)),
}


def tensors(solution):
    """The stress on all cells of this rank."""
    return solution.stress.tensor.x.array.reshape(-1, 3, 3)


def neo_hooke(high, free):
    """Principal Cauchy stresses of E = 100, nu = .3 where the stretches along the axes ``free``
    adjust themselves, from W = mu / 2 (sum of squares - 3) - mu ln J + lambda / 2 ln^2 J.
    """
    mu = 100.0 / 2.6
    lame = 2 * mu * 0.3 / 0.4

    def stresses(wide):
        stretches = np.array(
            [high if axis == 1 else wide if axis in free else 1.0 for axis in range(3)]
        )
        volume = stretches.prod()
        return (mu * (stretches**2 - 1) + lame * np.log(volume)) / volume

    return stresses(brentq(lambda wide: stresses(wide)[free[0]], 0.9, 2.0, xtol=1e-15))


@pytest.mark.parametrize(
    "kind", [kind if kind == "plane strain" else slow(kind) for kind in PRESSED_BLOCKS]
)
def test_a_block_of_rubber_between_plates(kind):
    """The same stress everywhere, at finite strains: neither the nominal one nor that of the
    undeformed area.
    """
    further, element, free = PRESSED_BLOCKS[kind]
    steps = {"times": [1.0, 2.0]}
    law = material("neo-hooke", **RUBBER, **further)
    solution = alone(block(law, "0.15*t", cells=(2, 2), element=element, load_steps=steps))
    for step, high in zip(solution.steps, (0.85, 0.7), strict=True):
        at_step, expected = solution.at(step), neo_hooke(high, free)
        wanted = np.broadcast_to(np.diag(expected), tensors(at_step).shape)
        assert_allclose(tensors(at_step), wanted, atol=1e-9 * abs(expected[1]))
        largest = at_step.stress.as_dict()
        assert largest["smallest_principal"]["value"] == pytest.approx(expected[1], rel=1e-9)
        assert largest["recovered"] is largest["error"] is None


@pytest.mark.mpi(slow=True)
@pytest.mark.parametrize("cells", [1, 2])
def test_a_cube_of_rubber_between_plates(cells):
    """In 3D, where the free sides are two; of each rank, also where most have no cell."""
    solution = solve(pressed_cube(material("neo-hooke", **RUBBER), "0.3*t", cells=cells))
    across, along, _ = neo_hooke(0.7, (0, 2))
    assert abs(across) < 1e-12
    wanted = np.broadcast_to(np.diag([0.0, 0.0, along]), tensors(solution).shape)
    assert_allclose(tensors(solution), wanted, atol=1e-9 * abs(along))
    assert solution.stress.largest().value == pytest.approx(abs(along), rel=1e-9)


def confined(depths, young, poisson, yields, hardening):
    """Stresses across and along, and plastic strains, of a metal that is pressed between smooth
    walls, by the return to the yield surface along the axis: the deviator of the strain is 2/3 of
    it.
    """
    bulk, shear = young / 3 / (1 - 2 * poisson), young / 2 / (1 + poisson)
    plastic = hardened = 0.0
    for depth in depths:
        mises = 2 * shear * (depth - 1.5 * plastic)
        flow = max(abs(mises) - yields - hardening * hardened, 0.0) / (3 * shear + hardening)
        plastic, hardened = plastic + flow * np.sign(mises), hardened + flow
        reached = mises - 3 * shear * flow * np.sign(mises)
        yield -bulk * depth + reached / 3, -bulk * depth - 2 * reached / 3, hardened


@pytest.mark.parametrize(
    "body",
    ["plane strain", *(slow(body) for body in ("degree 2", "reduced", "axisymmetric", "space"))],
)
def test_a_block_of_metal_between_walls(body):
    """Loaded, unloaded without flow, and loaded again; whichever load step is looked at first."""
    depths, times = (0.02, 0.06, 0.05, 0.08), [1.0, 2.0, 3.0, 4.0]
    path = (
        "0.02*t if t <= 1 else (0.04*t - 0.02 if t <= 2 else (0.08 - 0.01*t if t <= 3 else "
        "0.03*t - 0.04))"
    )
    walls = [fixed(side, "x") for side in ("left", "right")] + [fixed("bottom", "y")]
    steps, along = {"times": times}, 1
    if body == "space":
        walls = [fixed(side, "x") for side in ("left", "right")]
        walls += [fixed(side, "y") for side in ("front", "back")] + [fixed("bottom", "z")]
        scene, along = (
            pressed_cube(material("j2", **METAL), path, displacement=walls, load_steps=steps),
            2,
        )
    else:
        element = {"degree 2": {"degree": 2}, "reduced": {"volumetric": "reduced"}}.get(body, {})
        further = {"hypothesis": "axisymmetric"} if body == "axisymmetric" else {}
        law = material("j2", **METAL, **further)
        scene = block(
            law, path, cells=(2, 2), element=element, displacement=walls, load_steps=steps
        )
    solution, expected = alone(scene), list(confined(depths, *METAL.values()))
    assert [hardened > 0 for _, _, hardened in expected] == [False, True, True, True]
    assert expected[3][2] > 1.5 * expected[2][2]
    for number in (3, 1, 2, 0):
        at_step, (aside, down, hardened) = solution.at(solution.steps[number]), expected[number]
        wanted = np.full((3, 3), 0.0)
        np.fill_diagonal(wanted, [down if axis == along else aside for axis in range(3)])
        found = tensors(at_step)
        size = max(abs(down), abs(aside))
        assert_allclose(found, np.broadcast_to(wanted, found.shape), atol=1e-9 * size)
        assert_allclose(at_step.stress.plastic_strain.x.array, hardened, atol=1e-11)
        assert at_step.stress.largest().value == pytest.approx(abs(aside - down), rel=1e-8)
        assert at_step.stress.plastic_extreme()["value"] == pytest.approx(hardened, abs=1e-11)


def at_quadrature(solution, points, expression=None):
    """The stress of a linear scene, or another expression, at points of the cells, compiled."""
    stress, mesh = solution.stress.stress, solution.model.tagged.mesh
    cells = np.arange(mesh.topology.index_map(mesh.topology.dim).size_local, dtype=np.int32)
    stress.refresh(0.0)
    expression = stress.in_space if expression is None else expression
    values = fem.Expression(expression, points).eval(mesh, cells)
    return np.asarray(values).reshape(len(cells), len(points), *expression.ufl_shape)


LIMITS = [
    ("neo-hooke", {}, {}),
    slow("j2", {}, {"degree": 2}),
    slow("saint-venant-kirchhoff", {"hypothesis": "axisymmetric"}, {"degree": 2}),
    slow("j2", {"hypothesis": "axisymmetric"}, {}),
]


@pytest.mark.mpi
@pytest.mark.parametrize(("name", "further", "element"), LIMITS)
def test_small_depths_have_the_stress_of_the_linear_scene(name, further, element):
    """Point by point, of a stress that varies, at a depth of 1e-6, on each rank; and the field on
    cells, the projection of that stress.
    """
    law, comm, depth = material(name, **further), MPI.COMM_WORLD, 1e-6
    plain = {key: law[key] for key in ("young", "poisson", "hypothesis") if key in law}
    ground = [fixed("bottom")]
    middle = 1.0 if further else 0.0  # of the top; on an axis a node has no area
    bump = circle_shape([middle, 1.0 + 0.5 - depth], 0.5)
    scenes = [
        block(
            one,
            "0",
            length=2.0,
            cells=(6, 3),
            element=element,
            foundation=bump,
            displacement=ground,
        )
        for one in (law, plain)
    ]
    nonlinear, linear = (solve(scene, comm) for scene in scenes)
    at_points = nonlinear.stress.at_points
    wanted = at_quadrature(linear, at_points.points)
    size = comm.allreduce(np.abs(wanted).max(), op=MPI.MAX)
    assert size > 0
    assert_allclose(at_points.stress, wanted, atol=3e-5 * size)
    deviator = wanted - np.trace(wanted, axis1=2, axis2=3)[..., None, None] / 3 * np.eye(3)
    mises, largest = (
        np.sqrt(1.5) * np.linalg.norm(deviator, axis=(2, 3)),
        nonlinear.stress.largest(),
    )
    assert largest.value == pytest.approx(comm.allreduce(mises.max(), op=MPI.MAX), rel=1e-4)
    places = at_quadrature(
        linear, at_points.points, ufl.SpatialCoordinate(linear.model.tagged.mesh)
    )
    at = np.unravel_index(mises.argmax(), mises.shape)
    ranks = comm.allgather((mises[at], tuple(places[at])))
    assert largest.place == pytest.approx(max(ranks)[1], abs=1e-9)
    if not further:
        assert_allclose(projected(linear), nonlinear.stress.tensor.x.array, atol=3e-5 * size)


def projected(solution):
    """The stress of a linear scene, projected onto functions of degree k - 1 on cells by assembled
    forms.
    """
    mesh, degree = solution.model.tagged.mesh, solution.model.space.element.basix_element.degree
    space = fem.functionspace(mesh, ("DG", degree - 1, (3, 3)))
    u, v = trial_and_test(space)
    stress = solution.stress.stress.in_space
    dx = ufl.dx(metadata={"quadrature_degree": 2 * degree + 2})
    matrix = fem_petsc.assemble_matrix(fem.form(ufl.inner(u, v) * dx))
    matrix.assemble()
    load = fem_petsc.assemble_vector(fem.form(ufl.inner(stress, v) * dx))
    ksp, values = PETSc.KSP().create(space.mesh.comm), fem.Function(space)
    ksp.setOperators(matrix)
    ksp.setType("preonly")
    ksp.pc.setType("lu")
    ksp.pc.setFactorSolverType("mumps")
    ksp.solve(load, values.x.petsc_vec)
    values.x.scatter_forward()
    for kept in (ksp, matrix, load):
        kept.destroy()
    return values.x.array
