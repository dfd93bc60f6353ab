"""Frozen scenes of one linear body, stated once more as forms or as a residual; public names
only.
"""

import tomllib

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI

from signorini_fx import (
    ContactProblem,
    ConvergenceError,
    Coulomb,
    Foundation,
    LoadPath,
    NonlinearContactProblem,
    Tresca,
    generate_mesh,
)


def problem_of(text, *, residual):
    """The problem of a rectangle or a box with loads on sides, and a floor, a wall or a rigid
    circle that stands still; what gives the forms their values at a time; and the load path.
    """
    scene = tomllib.loads(text)
    tagged = generate_mesh(scene["mesh"]["generator"], scene["mesh"]["parameters"], MPI.COMM_WORLD)
    mesh, dim = tagged.mesh, tagged.mesh.geometry.dim
    V = fem.functionspace(mesh, ("Lagrange", scene["element"]["degree"], (dim,)))
    u, v, x, factor = (
        fem.Function(V),
        ufl.TestFunction(V),
        ufl.SpatialCoordinate(mesh),
        fem.Constant(mesh, 1.0),
    )
    young, poisson = scene["material"]["young"], scene["material"]["poisson"]

    def inner(y):
        e = ufl.sym(ufl.grad(y))
        stress = (
            young
            / (1 + poisson)
            * (e + poisson / (1 - 2 * poisson) * ufl.tr(e) * ufl.Identity(dim))
        )
        return ufl.inner(stress, ufl.grad(v)) * ufl.dx

    def vector(entry):
        return np.array([entry[axis] for axis in "xyz"[:dim]])

    L = ufl.inner(fem.Constant(mesh, np.zeros(dim)), v) * ufl.dx
    for load in scene["traction"]:
        tag = tagged.boundaries[load["boundary"]]
        ds = ufl.ds(domain=mesh, subdomain_data=tagged.facet_tags, subdomain_id=tag)
        L += factor * ufl.inner(fem.Constant(mesh, vector(load)), v) * ds
    supports = [
        (fem.Function(V), vector(entry), tagged.facets(entry["boundary"]))
        for entry in scene["displacement"]
    ]
    bcs = [
        fem.dirichletbc(moved, fem.locate_dofs_topological(V, dim - 1, facets))
        for moved, _, facets in supports
    ]
    contact = []
    for entry in scene["contact"]:
        law = entry["friction"]
        friction = {"none": lambda law: None, "tresca": lambda law: Tresca(law["bound"])} | {
            "coulomb": lambda law: Coulomb(law["coefficient"])
        }
        gap = eval(str(entry["gap"]), {"x": x})
        shape = {"shape": entry["foundation"]} if "foundation" in entry else {}
        contact.append(
            Foundation(
                tagged.facets(entry["boundary"]),
                gap=gap,
                friction=friction[law["law"]](law),
                **shape,
            )
        )
    times = scene["load_steps"].get("times", [1.0])
    factors = (scene["traction"] + scene["displacement"])[0]["factors"]

    def at(time):
        factor.value = np.interp(time, times, factors)
        for moved, values, _ in supports:
            moved.x.array.reshape(-1, dim)[:] = factor.value * values

    path = LoadPath(tuple(times), steps=scene["load_steps"].get("steps"))
    if residual:
        residual_form = inner(u) - L
        problem = NonlinearContactProblem(
            residual_form, u, bcs=bcs, contact=contact, **scene["solver"]
        )
    else:
        bilinear = inner(ufl.TrialFunction(V))
        problem = ContactProblem(bilinear, L, bcs, contact, **scene["solver"])
    return problem, at, path


def solution_of(text, *, residual):
    """That of ``problem_of``."""
    try:
        problem, at, path = problem_of(text, residual=residual)
        if not residual:
            return problem.run(path, at)
        for time in path.times:
            at(time)
            problem.solve()
            problem.advance()
    except ConvergenceError as error:
        return error.solution
    return problem.solution
