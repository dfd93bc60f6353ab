"""Two hyperelastic bodies of the plane in one mesh that slide on each other, one held and one driven."""

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from support.nonlinear_bodies import neo_hooke
from two_bodies import assembled, facets, facets_of_cells, grid, per_cell

from signorini_fx import NonlinearContactProblem, Pair

OF_PAIR = ("friction", "reach", "allowance")


class SlidingBodies:
    """The first body is held, the second one driven.

    Args:
        kind: of the cells.
        bodies: cells and points of each.
        touching: markers of the sides of both, of points of shape (2, n), before the scene is turned.
        held: markers of what is held of the first, and driven of the second.
        ratio: of the stiffness of the second body to that of the first.
        slave: number of the body with the contact points.
        angle: by which the whole scene is turned about the origin.
        smooth: marker of a plane x[0] = constant that is held across itself, and then both ends are, too, instead of
            all components of theirs; None: there is none.
        settings: of the pair and of the problem, and the ranks, ``comm``.
    """

    def __init__(self, kind, bodies, touching, held, ratio=1.0, slave=0, angle=0.0, smooth=None, **settings):
        self.turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        back = self.turn.T
        count = len(bodies[0][0])
        numbers = np.arange(count), np.arange(count, count + len(bodies[1][0]))
        comm, turned = settings.pop("comm", MPI.COMM_SELF), [(cells, x @ back) for cells, x in bodies]
        mesh = self.mesh = assembled(kind, *turned, comm=comm)
        space = fem.functionspace(mesh, ("Lagrange", 1, (2,)))
        u = self.u = fem.Function(space)
        stiffness = per_cell(mesh, lambda x: 1.0)
        local = np.arange(len(stiffness.x.array), dtype=np.int32)
        stiffness.x.array[np.isin(mesh.topology.original_cell_index[local], numbers[1])] = ratio
        measure = ufl.dx(metadata={"quadrature_degree": 2})
        self.form = ufl.derivative(stiffness * neo_hooke(u) * measure, u, ufl.TestFunction(space))
        self.sides = [
            facets_of_cells(mesh, lambda x, marker=marker: marker(back @ x), of_body)
            for marker, of_body in zip(touching, numbers, strict=True)
        ]
        ends = [facets(mesh, lambda x, marker=marker: marker(back @ x)) for marker in held]
        self.nodes = [fem.locate_dofs_topological(space, 1, end) for end in ends]
        self.drive = fem.Constant(mesh, np.zeros(2))
        values = np.zeros(2), self.drive
        self.bcs = [fem.dirichletbc(value, nodes, space) for value, nodes in zip(values, self.nodes, strict=True)]
        self.driven = None
        if smooth is not None:  # both ends and a plane are held along one axis
            self.driven, still = fem.Constant(mesh, 0.0), fem.Constant(mesh, 0.0)
            listed = [*ends, facets(mesh, lambda x: smooth(back @ x))]
            self.bcs = [
                fem.dirichletbc(value, fem.locate_dofs_topological(space.sub(axis), 1, end), space.sub(axis))
                for value, axis, end in zip((still, self.driven, still), (1, 1, 0), listed, strict=True)
            ]
        options = {key: settings.pop(key) for key in OF_PAIR if key in settings} | settings.pop("pair", {})
        self.pair = Pair(self.sides[slave], self.sides[1 - slave], **options)
        self.problem = NonlinearContactProblem(self.form, u, bcs=self.bcs, contact=self.pair, **settings)
        self.iterations = []

    def move(self, x, y):
        """Drive the second body, in the axes before the scene is turned, and end a step; the force on the slave."""
        self.drive.value[:] = self.turn @ np.array([x, y])
        if self.driven is not None:
            self.driven.value = y
        self.problem.solve()
        self.problem.advance()
        self.iterations.append(self.problem.iterations)
        return self.turn.T @ sum(self.problem.state.forces)


def blocks(kind="quadrilateral", lower=(12, 3), upper=(5, 4), width=2.0, **settings):
    """The unit square above y = 0, driven at its top, on a block of this width and the height 1."""
    low = [(1 - width) / 2, -1.0]
    bodies = grid(kind, lower, low, [(1 + width) / 2, 0.0]), grid(kind, upper, [0.0, 0.0], [1.0, 1.0])
    level = [lambda x, y=y: np.isclose(x[1], y) for y in (0.0, -1.0, 1.0)]
    return SlidingBodies(kind, bodies, [level[0]] * 2, level[1:], **settings)


def bump(kind="quadrilateral", height=2e-4, lower=(24, 8), upper=(18, 6), **settings):
    """The same with a parabola of this height below the upper block: contact grows from its middle."""

    def bent(x):
        return np.column_stack((x[:, 0], x[:, 1] + height * (1 - x[:, 1]) * (2 * x[:, 0] - 1) ** 2))

    bodies = grid(kind, lower, [-0.5, -1.0], [1.5, 0.0]), grid(kind, upper, [0.0, 0.0], [1.0, 1.0], bent)
    level = [lambda x, y=y: np.isclose(x[1], y) for y in (0.0, -1.0, 1.0)]

    def below(x):
        return np.isclose(x[1], height * (2 * x[0] - 1) ** 2, atol=1e-12)

    return SlidingBodies(kind, bodies, [level[0], below], level[1:], **settings)


def roller(kind="quadrilateral", cells=(32, 8), around=16, radius=0.5, gap=0.0, **settings):
    """Half a ring above a block [0, 4] x [0, 1], above x = 1.5, driven at its ends."""

    def ring(x):
        angle, r = np.pi * (x[:, 0] - 1), radius * (0.3 + 0.7 * x[:, 1])
        return np.column_stack((1.5 + r * np.cos(angle), 1 + gap + radius + r * np.sin(angle)))

    bodies = (
        grid(kind, cells, [0.0, 0.0], [4.0, 1.0]),
        grid(kind, (around, max(2, around // 4)), [0.0, 0.0], [1.0, 1.0], ring),
    )
    middle = np.array([1.5, 1 + gap + radius])

    def outer(x):
        return np.isclose(np.linalg.norm(x - middle[:, None], axis=0), radius)

    touching = [lambda x: np.isclose(x[1], 1.0), outer]
    held = [lambda x: np.isclose(x[1], 0.0), lambda x: np.isclose(x[1], middle[1])]
    return SlidingBodies(kind, bodies, touching, held, **settings)
