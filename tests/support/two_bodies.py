"""Meshes of several pieces that do not match, for contact of deformable bodies."""

import basix.ufl
import numpy as np
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from on_meshes import (
    at_coordinate,
    function_of_cells,
    hooke_stress,
    no_load,
    trial_and_test,
    turn_by,
    vector_space,
)

from signorini_fx import ContactProblem, Coulomb, Pair
from signorini_fx.machine import compat

# Of a cube with the corners numbered x first, six tetrahedra along a diagonal.
TETRAHEDRA = ((0, 1, 3, 7), (0, 1, 7, 5), (0, 5, 7, 4), (0, 3, 2, 7), (0, 6, 4, 7), (0, 2, 6, 7))
TRIANGLES = ((0, 1, 3), (0, 3, 2))
KINDS = {"triangle": 2, "quadrilateral": 2, "tetrahedron": 3, "hexahedron": 3}


def grid(kind, counts, low, high, place=None):
    """Cells and points of a box, moved by ``place``, a function of points of shape (n, d)."""
    dim = len(counts)
    axes = [np.linspace(a, b, n + 1) for a, b, n in zip(low, high, counts, strict=True)]
    x = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, dim)
    strides = np.array([np.prod([n + 1 for n in counts[k + 1 :]], dtype=int) for k in range(dim)])
    first = (
        np.stack(np.meshgrid(*[np.arange(n) for n in counts], indexing="ij"), axis=-1).reshape(
            -1, dim
        )
        @ strides
    )
    corners = np.array([[(k >> axis) & 1 for axis in range(dim)] for k in range(2**dim)]) @ strides
    boxes = first[:, None] + corners
    simplices = {"triangle": TRIANGLES, "tetrahedron": TETRAHEDRA}.get(kind)
    cells = boxes if simplices is None else boxes[:, np.array(simplices)].reshape(-1, dim + 1)
    return cells, x if place is None else np.asarray(place(x))


def assembled(kind, *bodies, comm=MPI.COMM_SELF):
    """One mesh of several pieces, each (cells, points)."""
    before = np.cumsum([0, *(len(x) for _, x in bodies)])
    cells = np.concatenate(
        [cells + start for (cells, _), start in zip(bodies, before, strict=False)]
    )
    x = np.concatenate([points for _, points in bodies])
    element = basix.ufl.element("Lagrange", kind, 1, shape=(x.shape[1],))
    if comm.rank:  # the first rank has all of it
        cells, x = cells[:0], x[:0]
    # It asks for the cells of a facet since dolfinx 0.11.
    cells_of_facet = (2,) if compat.VERSION >= (0, 11) else ()
    shared = dmesh.create_cell_partitioner(dmesh.GhostMode.shared_facet, *cells_of_facet)
    return dmesh.create_mesh(
        comm, cells=cells.astype(np.int64), x=x, e=ufl.Mesh(element), partitioner=shared
    )


def facets(mesh, marker):
    """Exterior facets of which all vertices have a mark; ``marker``: of points of shape (d, n)."""
    return dmesh.locate_entities_boundary(
        mesh, mesh.topology.dim - 1, lambda x: marker(x[: mesh.geometry.dim])
    )


def per_cell(mesh, value):
    """A number for each cell, from its middle, of shape (d,)."""
    found = function_of_cells(mesh)
    dim = mesh.topology.dim
    cells = mesh.topology.index_map(dim)
    count = cells.size_local + cells.num_ghosts
    middles = dmesh.compute_midpoints(mesh, dim, np.arange(count, dtype=np.int32))
    found.x.array[:] = [value(x) for x in middles]
    return found


def forms(mesh, degree, young, poisson=0.3):
    """Space, a, and a function from loads (a density) to L."""
    space = vector_space(mesh, degree)
    u, v = trial_and_test(space)
    stress = stress_of(u, young, poisson)
    return space, ufl.inner(stress, ufl.sym(ufl.grad(v))) * ufl.dx, v


def stress_of(u, young, poisson):
    """Of isotropic elasticity, plane strain or space."""
    return hooke_stress(ufl.sym(ufl.grad(u)), young, poisson)


def on(mesh, listed):
    """The measure of some facets."""
    tags = dmesh.meshtags(mesh, mesh.topology.dim - 1, np.sort(listed), 1)
    return ufl.ds(domain=mesh, subdomain_data=tags, metadata={"quadrature_degree": 4})(1)


def facets_of_piece(mesh, marker, inside):
    """Those of ``facets`` whose cells have their middles where ``inside`` is true; both of points
    of shape (d, n).
    """
    dim = mesh.topology.dim
    found = facets(mesh, marker)
    mesh.topology.create_connectivity(dim - 1, dim)
    cells = mesh.topology.connectivity(dim - 1, dim)
    middles = dmesh.compute_midpoints(
        mesh, dim, np.array([cells.links(facet)[0] for facet in found], dtype=np.int32)
    )
    return found[np.asarray(inside(middles.T[:dim]), dtype=bool)]


def facets_of_cells(mesh, marker, numbers):
    """Those of ``facets`` of the cells that had some numbers before the mesh was made, a range."""
    found, dim = facets(mesh, marker), mesh.topology.dim
    mesh.topology.create_connectivity(dim - 1, dim)
    behind = [mesh.topology.connectivity(dim - 1, dim).links(facet)[0] for facet in found]
    return found[np.isin(mesh.topology.original_cell_index[behind], numbers)]


def held(space, listed, component=None, value=0.0):
    """A Dirichlet condition on facets; ``value``: a number, or of vectors a function of points."""
    dim = space.mesh.topology.dim
    if component is not None:
        part = space.sub(component)
        return fem.dirichletbc(value, fem.locate_dofs_topological(part, dim - 1, listed), part)
    function = fem.Function(space)
    function.interpolate(value)
    return fem.dirichletbc(function, fem.locate_dofs_topological(space, dim - 1, listed))


COUNTS = {2: ((5, 2), (3, 2)), 3: ((3, 1, 2), (2, 1, 2))}


def turn_of_blocks(dimension, angle=0.4):
    """Of the plane x[0], x[1]; in 3D about a skew axis."""
    turn = np.eye(dimension)
    turn[:2, :2] = turn_by(angle)
    if dimension == 3:
        other = np.eye(3)
        other[1:, 1:] = turn[:2, :2]
        turn = turn @ other
    return turn


def blocks(kind, turn, counts=None):
    """Unit blocks on each other, turned about the origin, and the facets of both there, first the
    upper ones.
    """
    dim = KINDS[kind]
    lower, upper = counts or COUNTS[dim]
    up = np.eye(dim)[1]

    def place(x):
        return x @ turn.T

    bodies = (
        grid(kind, lower, -up, np.ones(dim) - up, place),
        grid(kind, upper, np.zeros(dim), np.ones(dim), place),
    )
    mesh = assembled(kind, *bodies)
    both = [
        facets_of_piece(
            mesh, lambda x: np.isclose((turn.T @ x)[1], 0), lambda x, s=s: s * (turn.T @ x)[1] > 0
        )
        for s in (1, -1)
    ]
    return mesh, both


def paraboloids(kind, degree, counts, comm=MPI.COMM_SELF, **settings):
    """Two bodies with rounded faces pressed and sheared in 3D."""

    def body(radius, sign, along, through):
        def place(x):
            face = sign * (x[:, 0] ** 2 + x[:, 1] ** 2) / (2 * radius)
            return np.column_stack((x[:, :2], face + (sign - face) * x[:, 2]))

        return grid(kind, (along, along, through), (-1, -1, 0), (1, 1, 1), place)

    mesh = assembled(kind, body(8.0, 1.0, counts[0], 2), body(12.0, -1.0, counts[1], 2), comm=comm)
    space, a, v = forms(mesh, degree, per_cell(mesh, lambda x: 200.0 if x[2] > 0 else 600.0))
    sides = [
        facets_of_piece(
            mesh,
            lambda x, of=of: np.isclose(x[2], of[1] * (x[0] ** 2 + x[1] ** 2) / (2 * of[0])),
            lambda x, of=of: of[1] * x[2] > 0,
        )
        for of in ((8.0, 1.0), (12.0, -1.0))
    ]
    top, bottom = (facets(mesh, at_coordinate(2, z)) for z in (1.0, -1.0))
    bcs = [held(space, top, k, value) for k, value in enumerate((0.004, 0.002, -0.02))]
    bcs += [held(space, bottom, k) for k in range(3)]
    problem = ContactProblem(
        a, no_load(mesh, v), bcs, contact=Pair(*sides, friction=Coulomb(0.3)), **settings
    )
    problem.solve()
    return problem
