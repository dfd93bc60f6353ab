"""The nodal arithmetic of the solver against the assembled weak forms."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx.fem import petsc as fem_petsc
from scenes import on_mesh, rectangle
from shifted_problems import shifted

from signorini_fx.algebra.contact.active_sets import ActiveSets
from signorini_fx.algebra.linalg.full import FullSystem
from signorini_fx.algebra.problem.regularised import RegularisedProblem
from signorini_fx.mechanics.assembly.quadrature import nodal_rule
from signorini_fx.mechanics.body.discretisation import discretise
from signorini_fx.records import Timings
from signorini_fx.scenes.reading import parse_scene

ELEMENTS = [("triangle", 1), ("quadrilateral", 1), ("triangle", 2), ("quadrilateral", 2)]
GAMMA_N, GAMMA_T = 2e6, 7e5
YOUNG, POISSON = 5000.0, 0.3


def turned(tagged, angle):
    """The mesh turned about the origin."""
    c, s = np.cos(angle), np.sin(angle)
    x = tagged.mesh.geometry.x
    x[:, :2] = x[:, :2] @ np.array([[c, s], [-s, c]])
    return tagged


def body(cell, degree, angle=0.4):
    """A block held on its left, with contact at its bottom and its right: at their corner one node has two normals."""
    scene = parse_scene(
        {
            "mesh": {"generator": "rectangle"},
            "element": {"degree": degree},
            "material": {"young": YOUNG, "poisson": POISSON},
            "displacement": {"boundary": "left", "x": 0.0, "y": 0.0},
            "traction": {"boundary": "top", "x": 3.0},
            "contact": [{"boundary": "bottom"}, {"boundary": "right"}],
        }
    )
    tagged = turned(rectangle(nx=12, ny=8, cell=cell), angle)
    return discretise(on_mesh(scene, tagged).statement, tagged, Timings())


def wave(amplitude, k, phase, offset=0.0):
    """A function of the position that changes its sign from node to node, more or less."""
    return lambda x: offset + amplitude * np.sin(k * x[0] - 1.3 * k * x[1] + phase)


FIELDS = {
    "gap": wave(5e-4, 11.0, 0.3),
    "lambda_hat": wave(300.0, 17.0, 1.0),
    "mu_hat": wave(200.0, 13.0, 2.0),
    "bound": wave(150.0, 7.0, 0.1, offset=200.0),
}


class Assembled:
    """The textbook form of the regularised problem (3.3a), (3.3b), (3.4): residual and derivative by UFL."""

    def __init__(self, discretisation, y):
        space, degree = discretisation.space, discretisation.statement.element.degree
        mesh, z = space.mesh, ufl.TestFunction(space)
        scalar = fem.functionspace(mesh, ("Lagrange", degree))
        fields = {}
        for name, values in FIELDS.items():
            fields[name] = fem.Function(scalar)
            fields[name].interpolate(values)
        tagged, n = discretisation.tagged, ufl.FacetNormal(mesh)
        ds = ufl.Measure("ds", domain=mesh, subdomain_data=tagged.facet_tags)
        lame, mu = YOUNG * POISSON / ((1 + POISSON) * (1 - 2 * POISSON)), YOUNG / (2 * (1 + POISSON))
        elastic = lame * ufl.div(y) * ufl.div(z) + 2 * mu * ufl.inner(ufl.sym(ufl.grad(y)), ufl.sym(ufl.grad(z)))
        terms = [elastic * ufl.dx - 3.0 * z[0] * ds(tagged.boundaries["top"])]
        for name in ("bottom", "right"):
            nodal = ds(tagged.boundaries[name], metadata=nodal_rule(degree))
            gammas = {"gamma_n": GAMMA_N, "gamma_t": GAMMA_T}
            terms.append(regularised_contact_form(y, z, n, nodal, **gammas, **fields))
        self.residual = sum(fem_petsc.assemble_vector(fem.form(term)).getArray() for term in terms)
        self.jacobian = sum(jacobian(term, y) for term in terms)


def regularised_contact_form(y, z, n, ds, *, gap, gamma_n, gamma_t, bound, lambda_hat, mu_hat):
    """Contact and friction terms of (3.3a) with (3.3b) and (3.4) inserted: the max/min form of textbooks."""
    t = ufl.as_vector((-n[1], n[0]))
    pressure = ufl.max_value(0, lambda_hat + gamma_n * (ufl.inner(y, n) - gap))
    trial = mu_hat + gamma_t * ufl.inner(y, t)
    shear = trial - ufl.max_value(0, trial - bound) - ufl.min_value(0, trial + bound)
    return pressure * ufl.inner(z, n) * ds + shear * ufl.inner(z, t) * ds


def jacobian(residual, y):
    """The assembled ufl.derivative."""
    matrix = fem_petsc.assemble_matrix(fem.form(ufl.derivative(residual, y)))
    matrix.assemble()
    return dense(matrix)


def dense(matrix):
    """All entries of a small matrix."""
    return matrix.convert("dense").getDenseArray().copy()


def problem_at_random_state(discretisation, seed):
    """The solver's problem with sigma = 1 / gamma_2, whose sets do not depend on those before; and a displacement."""
    rng = np.random.default_rng(seed)
    boundary = discretisation.boundary
    values = {name: field(boundary.x.T) for name, field in FIELDS.items()}
    values["mu_hat"] = values["mu_hat"][:, None]
    data = shifted(gamma_n=GAMMA_N, gamma_t=GAMMA_T, sigma=1 / GAMMA_T, **values)
    system = FullSystem.of(discretisation.elasticity(discretisation.cases))
    problem = RegularisedProblem(system, discretisation.at_contact)
    problem.set_data(data)
    problem.sets = ActiveSets.of(rng.random(boundary.size) < 0.5, rng.integers(-1, 2, (boundary.size, 1)).astype(float))
    y = fem.Function(discretisation.space)
    y.x.array[:] = np.where(discretisation.fixed, 0.0, 1e-3 * rng.standard_normal(y.x.array.size))
    return problem, y


def evaluate(problem, x):
    """Residual and Jacobian of the solver at dofs x."""
    vector = problem.system.start.duplicate()
    vector.setArray(x)
    f = vector.duplicate()
    problem.residual(None, vector, f)
    jacobian = problem.create_jacobian(symmetric=problem.data.follows is None)
    problem.assemble_jacobian(None, vector, jacobian)
    return f.getArray().copy(), dense(jacobian)


@pytest.mark.parametrize(("cell", "degree"), ELEMENTS)
def test_residual_and_jacobian_are_those_of_the_weak_form(cell, degree):
    """Nodal arithmetic equals the assembled max/min form and its ufl.derivative in every dof that is free."""
    discretisation = body(cell, degree)
    problem, y = problem_at_random_state(discretisation, seed=degree)
    residual, jacobian = evaluate(problem, y.x.array)
    assert {True, False} == set(problem.sets.contact.tolist())
    assert {-1, 0, 1} == set(problem.sets.direction[:, 0].tolist())
    reference = Assembled(discretisation, y)
    free = ~discretisation.fixed
    assert np.abs(residual - reference.residual)[free].max() <= 1e-12 * np.abs(reference.residual).max()
    difference = (jacobian - reference.jacobian)[np.ix_(free, free)]
    assert np.abs(difference).max() <= 1e-12 * np.abs(reference.jacobian).max()
