"""Two hyperelastic bodies in one mesh that slide on each other, one held and one driven."""

import numpy as np
import ufl
from dolfinx import fem
from mpi4py import MPI
from on_meshes import at_coordinate, trial_and_test, turn_by, vector_space
from scipy.spatial.transform import Rotation
from support.nonlinear_bodies import neo_hooke
from two_bodies import assembled, facets, facets_of_cells, grid, per_cell

from signorini_fx import ContactProblem, NonlinearContactProblem, Pair

OF_PAIR = ("friction", "reach")


class SlidingBodies:
    """The first body is held, the second one driven.

    Args:
        kind: of the cells.
        bodies: cells and points of each.
        touching: markers of the sides of both, of points of shape (d, n), before the scene is
        turned.
        held: markers of what is held of the first, and driven of the second.
        ratio: of the stiffness of the second body to that of the first.
        slave: number of the body with the contact points.
        angle: by which the whole scene is turned about the origin, in 3D about (1, 2, 3).
        smooth: marker of a plane x[0] = constant that is held across itself, and then both ends
        are, too, instead of
            all components of theirs, in 3D also of a plane x[1] = constant; None: there is none.
        half: whether x[0] = 0 is held across itself, and ends whole.
        quarter: whether x[0] = 0 and x[1] = 0 are held like that.
        revolved: whether the bodies are of revolution about x[0] = 0, and forces those of whole
        rings.
        degree: of the displacement.
        settings: of the pair and of the problem, and the ranks, ``comm``.
    """

    def __init__(
        self,
        kind,
        bodies,
        touching,
        held,
        ratio=1.0,
        slave=0,
        angle=0.0,
        smooth=None,
        half=False,
        quarter=False,
        revolved=False,
        degree=1,
        **settings,
    ):
        self.half = half
        dim = bodies[0][1].shape[1]
        self.turn = turn_of(angle, dim)
        back = self.turn.T
        count = len(bodies[0][0])
        numbers = np.arange(count), np.arange(count, count + len(bodies[1][0]))
        comm, turned = (
            settings.pop("comm", MPI.COMM_SELF),
            [(cells, x @ self.turn.T) for cells, x in bodies],
        )
        mesh = self.mesh = assembled(kind, *turned, comm=comm)
        space = vector_space(mesh, degree)
        u = self.u = fem.Function(space)
        of_body = self.of_body = per_cell(mesh, lambda x: 0.0)
        local = np.arange(len(of_body.x.array), dtype=np.int32)
        of_body.x.array[np.isin(mesh.topology.original_cell_index[local], numbers[1])] = 1.0
        stiffness = 1.0 + (ratio - 1.0) * of_body
        radius = ufl.SpatialCoordinate(mesh)[0] if revolved else None
        around = 2 * np.pi * radius if revolved else 1.0
        energy = (
            stiffness
            * neo_hooke(u, radius)
            * around
            * ufl.dx(metadata={"quadrature_degree": 2 * degree})
        )
        self.form = ufl.derivative(energy, u, ufl.TestFunction(space))
        self.sides = [
            facets_of_cells(mesh, lambda x, marker=marker: marker(back @ x), cells)
            for marker, cells in zip(touching, numbers, strict=True)
        ]
        ends = [facets(mesh, lambda x, marker=marker: marker(back @ x)) for marker in held]
        self.nodes = [fem.locate_dofs_topological(space, dim - 1, end) for end in ends]
        self.drive = fem.Constant(mesh, np.zeros(dim))
        values = np.zeros(dim), self.drive
        self.bcs = [
            fem.dirichletbc(value, nodes, space)
            for value, nodes in zip(values, self.nodes, strict=True)
        ]
        self.driven = None
        if smooth is not None:  # both ends and a plane are held along one axis
            self.driven, still = fem.Constant(mesh, 0.0), fem.Constant(mesh, 0.0)
            planes = [smooth] if dim == 2 else [smooth, lambda x: smooth(x[[1, 0, 2]])]
            listed = [
                *ends,
                *(facets(mesh, lambda x, plane=plane: plane(back @ x)) for plane in planes),
            ]
            axes = (dim - 1, dim - 1, *range(dim - 1))
            self.bcs = [
                fem.dirichletbc(
                    value,
                    fem.locate_dofs_topological(space.sub(axis), dim - 1, end),
                    space.sub(axis),
                )
                for value, axis, end in zip(
                    (still, self.driven, *[still] * (dim - 1)), axes, listed, strict=True
                )
            ]
        for axis in range(2 if quarter else 1 if half else 0):
            part, middle = (
                space.sub(axis),
                facets(mesh, lambda x, axis=axis: np.isclose(x[axis], 0.0)),
            )
            held_across = fem.locate_dofs_topological(part, dim - 1, middle)
            self.bcs.append(fem.dirichletbc(fem.Constant(mesh, 0.0), held_across, part))
        options = {"measure": around} if revolved else {}
        options |= {key: settings.pop(key) for key in OF_PAIR if key in settings} | settings.pop(
            "pair", {}
        )
        self.pair = Pair(self.sides[slave], self.sides[1 - slave], **options)
        self.problem = NonlinearContactProblem(
            self.form, u, bcs=self.bcs, contact=self.pair, **settings
        )
        self.iterations = []

    def move(self, *way):
        """Drive the second body, in the axes before the scene is turned, and end a step; the force
        on the slave.
        """
        self.drive.value[:] = self.turn @ np.array(way)
        if self.driven is not None:
            self.driven.value = way[-1]
        self.problem.solve()
        self.problem.advance()
        self.iterations.append(self.problem.iterations)
        return self.turn.T @ sum(self.problem.state.forces)


def turn_of(angle, dim):
    """A rotation by this angle, in 3D about (1, 2, 3)."""
    if dim == 2:
        return turn_by(angle)
    return Rotation.from_rotvec(angle * np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)).as_matrix()


def on_each_other(kind, *bodies, below=None, axis=1, **settings):
    """A body up to the height 1, driven there, on one from -1, which is held; they touch at the
    height 0, or the upper one where ``below`` is.
    """
    level, bottom, top = (at_coordinate(axis, at, atol=1e-12) for at in (0.0, -1.0, 1.0))
    return SlidingBodies(kind, bodies, [level, below or level], [bottom, top], **settings)


def half_ring(middle, radius, inner, share=1.0):
    """Places of a half ring below its middle, or a share of it from its lowest point on, from
    points of the unit square.
    """

    def ring(x):
        angle, r = np.pi * share * (x[:, 0] - 1), radius * (inner + (1 - inner) * x[:, 1])
        return middle + np.column_stack((r * np.cos(angle), r * np.sin(angle)))

    def outer(x):
        return np.isclose(np.linalg.norm(x - np.array(middle)[:, None], axis=0), radius)

    return ring, outer


def blocks(kind="quadrilateral", lower=(12, 3), upper=(5, 4), width=2.0, **settings):
    """The unit square above y = 0, driven at its top, on a block of this width and the height 1."""
    low = grid(kind, lower, [(1 - width) / 2, -1.0], [(1 + width) / 2, 0.0])
    return on_each_other(kind, low, grid(kind, upper, [0.0, 0.0], [1.0, 1.0]), **settings)


def bump(kind="quadrilateral", height=2e-4, lower=(24, 8), upper=(18, 6), **settings):
    """The same with a parabola of this height below the upper block: contact grows from its
    middle.
    """

    def bent(x):
        return np.column_stack((x[:, 0], x[:, 1] + height * (1 - x[:, 1]) * (2 * x[:, 0] - 1) ** 2))

    def below(x):
        return np.isclose(x[1], height * (2 * x[0] - 1) ** 2, atol=1e-12)

    low = grid(kind, lower, [-0.5, -1.0], [1.5, 0.0])
    high = grid(kind, upper, [0.0, 0.0], [1.0, 1.0], bent)
    return on_each_other(kind, low, high, below=below, **settings)


def roller(kind="quadrilateral", cells=(32, 8), around=16, radius=0.5, gap=0.0, **settings):
    """Half a ring above a block [0, 4] x [0, 1], above x = 1.5, driven at its ends."""
    middle = (1.5, 1 + gap + radius)
    ring, outer = half_ring(middle, radius, 0.3)
    bodies = (
        grid(kind, cells, [0.0, 0.0], [4.0, 1.0]),
        grid(kind, (around, max(2, around // 4)), [0.0, 0.0], [1.0, 1.0], ring),
    )
    held = [at_coordinate(1, 0.0), at_coordinate(1, middle[1])]
    return SlidingBodies(kind, bodies, [at_coordinate(1, 1.0), outer], held, **settings)


def wheel(kind="quadrilateral", cells=(12, 6), around=8, radius=0.5, **settings):
    """The lower half of a ring on a block of the width 2 and the height 1, both around x = 0,
    driven at its ends;
    ``half``: where x > 0 alone.
    """
    parts, share = (1, 0.5) if settings.get("half", False) else (2, 1.0)
    ring, outer = half_ring((0.0, radius), radius, 0.3, share)
    bodies = (
        grid(kind, (parts * cells[0], cells[1]), [1.0 - parts, -1.0], [1.0, 0.0]),
        grid(kind, (parts * around, 4), [0.0, 0.0], [1.0, 1.0], ring),
    )
    held = [at_coordinate(1, -1.0), at_coordinate(1, radius)]
    return SlidingBodies(kind, bodies, [at_coordinate(1, 0.0), outer], held, **settings)


def cylinders(kind="quadrilateral", lower=(5, 3), upper=(3, 2), inner=0.0, **settings):
    """Two cylinders of the radius and the height 1 on each other, or tubes, held and driven at
    smooth ends.
    """
    low = grid(kind, lower, [inner, -1.0], [1.0, 0.0])
    high = grid(kind, upper, [inner, 0.0], [1.0, 1.0])
    smooth = {"smooth": at_coordinate(0, 0.0)}
    return on_each_other(kind, low, high, revolved=True, **smooth, **settings)


def dome(kind="quadrilateral", height=2e-7, lower=(18, 8), upper=(13, 6), **settings):
    """A cylinder with the radius and the height 1 and a paraboloid of this height below, clamped
    above, on one with the radius 1.5.
    """

    def bent(x):
        return np.column_stack((x[:, 0], x[:, 1] + height * (1 - x[:, 1]) * x[:, 0] ** 2))

    def below(x):
        return np.column_stack((1.5 * x[:, 0], x[:, 1]))

    def rounded(x):
        return np.isclose(x[1], height * x[0] ** 2, atol=1e-12) & (x[0] <= 1.0)

    low = grid(kind, lower, [0.0, -1.0], [1.0, 0.0], below)
    high = grid(kind, upper, [0.0, 0.0], [1.0, 1.0], bent)
    return on_each_other(kind, low, high, below=rounded, half=True, revolved=True, **settings)


def ring_on_cone(kind="quadrilateral", cells=(32, 6), around=12, size=0.2, **settings):
    """Half a ring of this outer radius around a shell of a cone from the radius 0.5 to 2, which
    falls by 45 degrees, at the radius 1 on the middle of its side, driven along the axis at its
    flat end, where it is free to widen.
    """
    middle = np.array([1.0, -1.0]) + size / np.sqrt(2.0)

    def shell(x):
        return np.column_stack((x[:, 0], -x[:, 0] - x[:, 1]))

    ring, outer = half_ring(middle, size, 0.4)
    bodies = (
        grid(kind, cells, [0.5, 0.0], [2.0, 0.5], shell),
        grid(kind, (around, max(2, around // 6)), [0.0, 0.0], [1.0, 1.0], ring),
    )
    touching = [lambda x: np.isclose(x[1], -x[0]), outer]
    held = [lambda x: np.isclose(x[1], -x[0] - 0.5), at_coordinate(1, middle[1])]
    smooth = {"smooth": at_coordinate(0, 0.0)}
    return SlidingBodies(kind, bodies, touching, held, revolved=True, **smooth, **settings)


def as_linear_bodies(scene, **settings):
    """The solved contact problem of the tangent at no displacement, with the pair of linear
    bodies.
    """
    space = scene.u.function_space
    trial, test = trial_and_test(space)
    a = ufl.replace(ufl.derivative(scene.form, scene.u, trial), {scene.u: fem.Function(space)})
    nothing = ufl.inner(fem.Constant(scene.mesh, np.zeros(len(scene.u))), test) * ufl.dx
    linear = ContactProblem(
        a, nothing, bcs=scene.bcs, contact=scene.pair, **{"algorithm": "alm", **settings}
    )
    linear.solve()
    return linear


def out_of_balance(scene):
    """The sum of the nodal forces of contact on both bodies, and of their moments per unit of
    length, over the sum of all forces.
    """
    state, (pair,) = scene.problem.state, scene.problem.linear.foundations.sliding.values()
    rows = pair.coupling
    shear = np.einsum("ndj,nj->nd", state.boundary.tangents, state.shear)
    along = np.einsum("ndk,nd->nk", rows.frames.tangents, shear)
    weights = rows.weight * state.pressure, (rows.weight[:, None] * along).ravel()
    forces = (rows.normal_rows.T @ weights[0] + rows.tangent_rows.T @ weights[1]).reshape(
        -1, shear.shape[1]
    )
    places = np.concatenate((rows.slave.x, rows.master.x))
    size = np.abs(forces).sum()
    pairs = [(k, j) for j in range(places.shape[1]) for k in range(j)]
    moment = max(abs(places[:, k] @ forces[:, j] - places[:, j] @ forces[:, k]) for k, j in pairs)
    return np.abs(forces.sum(axis=0)).max() / size, moment / size


def stacked(kind="hexahedron", lower=(4, 3, 2), upper=(3, 4, 2), width=1.0, **settings):
    """The unit cube above z = 0, driven at its top, on a block of this width and the height 1."""
    ends = (1 - width) / 2, (1 + width) / 2
    low = grid(kind, lower, [ends[0], ends[0], -1.0], [ends[1], ends[1], 0.0])
    return on_each_other(kind, low, grid(kind, upper, [0.0] * 3, [1.0] * 3), axis=2, **settings)


def bulge(kind="hexahedron", height=2e-4, lower=(8, 8, 4), upper=(6, 5, 3), **settings):
    """The unit cube with a paraboloid of this height below, driven at its top, on a block of the
    width 2: contact grows from the middle.
    """

    def away(x):
        return (2 * x[0] - 1) ** 2 + (2 * x[1] - 1) ** 2

    def bent(x):
        return np.column_stack((x[:, :2], x[:, 2] + height * (1 - x[:, 2]) * away(x.T)))

    def below(x):
        return np.isclose(x[2], height * away(x), atol=1e-12)

    low = grid(kind, lower, [-0.5, -0.5, -1.0], [1.5, 1.5, 0.0])
    high = grid(kind, upper, [0.0] * 3, [1.0] * 3, bent)
    return on_each_other(kind, low, high, below=below, axis=2, **settings)


def pillow(kind="hexahedron", lower=(10, 7, 3), upper=(5, 5, 2), height=0.5, top=0.7, **settings):
    """A block [0, 2] x [0, 1.4] x [0, 0.6], and above its part around (0.6, 0.7) a square of the
    side 1 with a paraboloid of this height at its corners below, driven at its ``top``.
    """

    def away(x):
        return 2 * ((x[0] - 0.6) ** 2 + (x[1] - 0.7) ** 2)

    def bent(x):
        return np.column_stack(
            (x[:, :2], x[:, 2] + height * (top - x[:, 2]) / (top - 0.3) * away(x.T))
        )

    ends = [0.1, 0.2, 0.3], [1.1, 1.2, top]
    bodies = grid(kind, lower, [0.0, 0.0, -0.3], [2.0, 1.4, 0.3]), grid(kind, upper, *ends, bent)

    def below(x):
        return np.isclose(x[2], 0.3 + height * away(x))

    touching = [at_coordinate(2, 0.3), below]
    held = [at_coordinate(2, -0.3), at_coordinate(2, top)]
    return SlidingBodies(kind, bodies, touching, held, **settings)


def rounded(kind="hexahedron", height=0.2, **settings):
    """A block of the width 2 below z = 0, and a smaller one with a paraboloid below, both around
    (0, 0), driven at its top.
    """

    def away(x):
        return x[0] ** 2 + x[1] ** 2

    def bent(x):
        return np.column_stack((x[:, :2], x[:, 2] + height * (0.5 - x[:, 2]) * 2 * away(x.T)))

    bodies = (
        grid(kind, (8, 7, 2), [-1.0, -1.0, -0.6], [1.0, 1.0, 0.0]),
        grid(kind, (4, 5, 1), [-0.6, -0.6, 0.0], [0.6, 0.6, 0.5], bent),
    )
    touching = [at_coordinate(2, 0.0), lambda x: np.isclose(x[2], height * away(x), atol=1e-12)]
    held = [at_coordinate(2, -0.6), at_coordinate(2, 0.5)]
    return SlidingBodies(kind, bodies, touching, held, **settings)


def quarter_of_a_bulge(kind="hexahedron", height=2e-3, cells=(12, 8), **settings):
    """A quarter of a block with a paraboloid of this height at the radius 1 below, on one that is
    half as wide again, clamped at their ends; facets are graded towards the axis.
    """

    power = 2.5

    def graded(x, width):
        return np.column_stack(
            (width * x[:, :2] ** power, np.sign(x[:, 2]) * np.abs(x[:, 2]) ** power)
        )

    def bent(x):
        at = graded(x, 1.0)
        at[:, 2] += height * (1 - at[:, 2]) * np.sum(at[:, :2] ** 2, axis=1)
        return at

    def wide(x):
        return graded(x, 1.5)

    def below(x):
        return np.isclose(x[2], height * (x[0] ** 2 + x[1] ** 2), atol=1e-12)

    along, up = cells
    low = grid(kind, (along + 2, along + 2, up), [0.0, 0.0, -1.0], [1.0, 1.0, 0.0], wide)
    high = grid(kind, (along, along, up), [0.0] * 3, [1.0] * 3, bent)
    return on_each_other(kind, low, high, below=below, axis=2, quarter=True, **settings)
