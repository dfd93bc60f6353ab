"""Problems of a user's own forms: blocks, and random ones with a judge that knows nothing of the
solver.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from on_meshes import function_of_cells, hooke_stress, trial_and_test, vector_space

from signorini_fx import ContactProblem, Coulomb, Foundation, TaggedMesh, Tresca
from signorini_fx.records import Status
from signorini_fx.results.contact_fields import ContactFields

CELLS = {
    2: (dmesh.CellType.triangle, dmesh.CellType.quadrilateral),
    3: (dmesh.CellType.tetrahedron,),
}


def side(mesh, axis, at):
    """The facets of a box where a coordinate has a value."""
    return dmesh.locate_entities_boundary(
        mesh, mesh.topology.dim - 1, lambda x: np.isclose(x[axis], at)
    )


def box(sizes, counts, kind=None, comm=MPI.COMM_WORLD):
    """A rectangle or a box with a corner at the origin."""
    create = dmesh.create_rectangle if len(sizes) == 2 else dmesh.create_box
    return create(
        comm, [np.zeros(len(sizes)), np.array(sizes)], counts, kind or CELLS[len(sizes)][0]
    )


def hooke(u, v, young=1000.0, poisson=0.3):
    """Isotropic elasticity, plane strain or space."""
    stress = hooke_stress(ufl.sym(ufl.grad(u)), young, poisson)
    return ufl.inner(stress, ufl.grad(v)) * ufl.dx


def voigt(y):
    """Strains as a list, the shear strains twice."""
    e = ufl.sym(ufl.grad(y))
    d = len(y)
    return ufl.as_vector(
        [e[k, k] for k in range(d)] + [2 * e[i, j] for i in range(d) for j in range(i + 1, d)]
    )


def positive(rng, size, low=0.1, high=1.0):
    """A random symmetric positive definite matrix."""
    q, _ = np.linalg.qr(rng.standard_normal((size, size)))
    return q @ np.diag(rng.uniform(low, high, size)) @ q.T


@dataclass
class Drawn:
    """A problem and what the judge needs of it."""

    problem: ContactProblem
    a: object
    L: object
    bcs: list
    sides: list  # (axis, sign, facets, gap(x), friction) of each contact


def draw(seed):
    """A random problem that has a solution: springs or supports hold the body, whatever the contact
    does.
    """
    rng = np.random.default_rng(seed)
    d = 2 if rng.random() < 0.8 else 3
    sizes = rng.uniform(0.5, 2.0, d)
    kind = CELLS[d][rng.integers(len(CELLS[d]))]
    mesh = box(sizes, rng.integers(2, 7 if d == 2 else 4, d).tolist(), kind)
    V = vector_space(mesh, int(rng.integers(1, 3)) if d == 2 else 1)
    (u, v), x = trial_and_test(V), ufl.SpatialCoordinate(mesh)
    count, unit = d * (d + 1) // 2, 10.0 ** rng.uniform(-3, 6)
    moduli = fem.Constant(mesh, unit * positive(rng, count))
    held = rng.random() < 0.5
    # Either supports hold the body, or springs do: weak ones, too.
    springs = fem.Constant(
        mesh, (0.0 if held else unit * 10.0 ** rng.uniform(-3, 0)) * positive(rng, d)
    )
    softer = function_of_cells(mesh)
    softer.x.array[:] = rng.uniform(0.3, 1.0, softer.x.array.size)
    force, pull = (fem.Constant(mesh, 0.05 * unit * rng.standard_normal(d)) for _ in range(2))
    a = (
        softer * ufl.inner(ufl.dot(moduli, voigt(u)), voigt(v)) * ufl.dx
        + ufl.inner(ufl.dot(springs, u), v) * ufl.ds
    )
    L = ufl.inner(force, v) * ufl.dx + ufl.inner(pull, v) * ufl.ds
    bcs = []
    if held:
        top = side(mesh, d - 1, sizes[-1])
        given = fem.Function(V)
        slope, shift = 0.02 * rng.standard_normal((d, d)), 0.02 * rng.standard_normal((d, 1))
        given.interpolate(lambda x: slope @ x[:d] + shift)
        bcs = [fem.dirichletbc(given, fem.locate_dofs_topological(V, d - 1, top))]
        if rng.random() < 0.5:
            wall = side(mesh, 0, 0.0)
            bcs.append(
                fem.dirichletbc(0.0, fem.locate_dofs_topological(V.sub(0), d - 1, wall), V.sub(0))
            )
    sides, contact = [], []
    places = [(d - 1, 0.0), (0, sizes[0])][: 1 + int(rng.random() < 0.5)]
    for axis, at in places:
        curve, height = 0.05 * rng.uniform(0, 1), rng.uniform(-0.03, 0.02)
        along = (axis + 1) % d
        gap = curve * (x[along] - sizes[along] / 2) ** 2 + height
        law = rng.integers(3)
        friction = [None, Tresca(0.02 * unit), Coulomb(float(rng.uniform(0.05, 0.6)))][law]
        here = side(mesh, axis, at)

        def gap_at(y, curve=curve, height=height, along=along, middle=sizes[along] / 2):
            return curve * (y[:, along] - middle) ** 2 + height

        sides.append((axis, 1.0 if at else -1.0, here, gap_at, friction))
        contact.append(Foundation(here, gap=gap, friction=friction))
    settings = [{}, {"algorithm": "alm"}, {"gamma_n": 1e4 * unit, "gamma_t": 3e3 * unit}][
        rng.integers(3)
    ]
    # The judge asks for the linear problem alone, however large its displacements are.
    problem = ContactProblem(a, L, bcs, contact, largest_deformation=1e3, **settings)
    return Drawn(problem, a, L, bcs, sides)


def judge(drawn, balance=1e-10, tolerance=1e-6):
    """The violations of equilibrium and of the conditions that are not round-off, from a dense
    matrix; one rank.
    """
    problem, y = drawn.problem, drawn.problem.u
    V = y.function_space
    d = V.mesh.geometry.dim
    matrix = fem.assemble_matrix(fem.form(drawn.a)).to_dense()
    loads = fem.assemble_vector(fem.form(drawn.L)).array
    residual = matrix @ y.x.array - loads
    law = problem.certificate.law
    fixed, values = np.zeros(residual.size, dtype=bool), np.zeros(residual.size)
    for condition in drawn.bcs:
        fixed[condition.dof_indices()[0]] = True
        condition.set(values)
    wrong = {}
    scale = 0.0
    x, v = V.tabulate_dof_coordinates(), ufl.TestFunction(V)
    far = np.abs(y.x.array).max()
    for k, (axis, sign, facets, gap, friction) in enumerate(drawn.sides):
        fields = ContactFields.on(V)
        fields.take(V, problem.state, problem.state.boundary.part == k)
        tags = dmesh.meshtags(
            V.mesh, d - 1, np.sort(facets), np.full(facets.size, 1, dtype=np.int32)
        )
        form = fem.form(v[axis] * ufl.ds(domain=V.mesh, subdomain_data=tags)(1))
        weight = fem.assemble_vector(form).array.reshape(-1, d)[:, axis]
        nodes = np.flatnonzero(weight > 1e-12 * weight.max())
        pressure = fields.pressure.x.array[nodes]
        shear, slip = (one.x.array.reshape(-1, d)[nodes] for one in (fields.shear, fields.slip))
        normal = sign * np.eye(d)[axis]
        force = weight[nodes, None] * (pressure[:, None] * normal + shear)
        np.add.at(residual.reshape(-1, d), nodes, force)
        moved = y.x.array.reshape(-1, d)[nodes]
        left = gap(x[nodes]) - moved @ normal
        tangential = moved - (moved @ normal)[:, None] * normal
        stress = max(pressure.max(initial=0.0), np.abs(shear).max(initial=0.0), 1e-300)
        scale = max(scale, np.abs(force).max(initial=0.0))
        bound = np.zeros(nodes.size)
        match friction:
            case Tresca(bound=given):
                bound[:] = given
            case Coulomb(coefficient=coefficient):
                bound = coefficient * pressure
        free = ~fixed.reshape(-1, d)[
            nodes, axis
        ]  # what a support prescribes may overlap with the foundation
        size = np.linalg.norm(shear, axis=1)
        xi = tangential - shear / law.gamma_t
        long = np.linalg.norm(xi, axis=1)
        figures = {
            "gap": np.abs(fields.gap.x.array[nodes] - left) / far,
            "slip": np.abs(slip - tangential) / far,
            "shear across": np.abs(shear @ normal) / stress,
            "negative": -pressure / stress,
            "entered": free * (-left - pressure / law.gamma_n) / far,
            "at a distance": free
            * np.minimum(pressure / stress, np.abs(left + pressure / law.gamma_n) / far),
            "cone": (size - bound) / stress,
            "slips below": np.minimum((bound - size) / stress, long / far),
            "wrong way": np.minimum(
                np.abs(np.einsum("ij,ij->i", xi, shear) - long * size) / stress / far, long / far
            ),
        }
        for name, amounts in figures.items():
            wrong[f"{name} {k}"] = float(amounts.max(initial=0.0))
    wrong["supports"] = float(np.abs(y.x.array - values)[fixed].max(initial=0.0) / far)
    scale = max(scale, np.abs(loads).max(), np.abs(matrix @ y.x.array).max())
    wrong["equilibrium"] = float(np.abs(residual[~fixed]).max() / scale)
    return {
        name: value
        for name, value in wrong.items()
        if not value <= (balance if name == "equilibrium" else tolerance)
    }


def verdict(seed):
    """What is wrong with the solution of a random problem; {} if nothing is."""
    drawn = draw(seed)
    try:
        drawn.problem.solve()
    except Exception as error:
        return {type(error).__name__: str(error).splitlines()[0]}
    assert drawn.problem.status is Status.CONVERGED
    return judge(drawn)


def stress_of(young, poisson, dim):
    """Hooke's law, plane strain or space, as a function of the displacement."""

    def stress(y):
        e = ufl.sym(ufl.grad(y))
        return (
            young
            / (1 + poisson)
            * (e + poisson / (1 - 2 * poisson) * ufl.tr(e) * ufl.Identity(dim))
        )

    return stress


def block_on_a_floor(degree=1, friction=None, **settings):
    """A block held at its left end and pressed on a rigid floor, in 2D or in 3D."""

    def make(mesh):
        mesh = mesh.mesh if isinstance(mesh, TaggedMesh) else mesh
        dim = mesh.topology.dim
        V = vector_space(mesh, degree)
        u, v = trial_and_test(V)
        stress = stress_of(1000.0, 0.3, dim)
        held = fem.dirichletbc(
            np.zeros(dim), fem.locate_dofs_topological(V, dim - 1, side(mesh, 0, 0.0)), V
        )
        floor = Foundation(side(mesh, dim - 1, 0.0), gap=0.002, friction=friction)
        a, L = ufl.inner(stress(u), ufl.grad(v)) * ufl.dx, -8.0 * v[dim - 1] * ufl.dx
        return ContactProblem(a, L, [held], floor, stress=stress, **settings)

    return make


class Block:
    """A block 3 x 1 (x 1) on a floor, its top pressed down and moved aside."""

    def __init__(
        self,
        counts=(12, 4),
        degree=1,
        kind=None,
        comm=MPI.COMM_WORLD,
        friction=None,
        gap=0.0,
        load=0.0,
        mesh=None,
        **settings,
    ):
        d = len(counts)
        self.mesh = box((3.0, 1.0, 1.0)[:d], list(counts), kind, comm) if mesh is None else mesh
        self.V = vector_space(self.mesh, degree)
        u, v = ufl.TrialFunction(self.V), ufl.TestFunction(self.V)
        self.bottom, self.top = side(self.mesh, d - 1, 0.0), side(self.mesh, d - 1, 1.0)
        self.young, self.load = fem.Constant(self.mesh, 1000.0), fem.Constant(self.mesh, load)
        self.down, self.aside = fem.Constant(self.mesh, -0.01), fem.Constant(self.mesh, 0.0)
        self.a = self.young * hooke(u, v, 1.0)
        self.L = self.load * v[d - 1] * ufl.dx
        self.bcs = [
            self.held(d - 1, self.top, self.down),
            *(
                self.held(k, self.top, self.aside if k == 0 else fem.Constant(self.mesh, 0.0))
                for k in range(d - 1)
            ),
        ]
        self.foundation = Foundation(self.bottom, gap=gap, friction=friction)
        self.problem = ContactProblem(self.a, self.L, self.bcs, self.foundation, **settings)

    def held(self, component, facets, value):
        sub = self.V.sub(component)
        return fem.dirichletbc(
            value, fem.locate_dofs_topological(sub, self.mesh.topology.dim - 1, facets), sub
        )
