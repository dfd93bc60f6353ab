"""Sides of two bodies with nodes that supports hold: these push the other body, whichever side has
the points.

The reference is the problem with both sides exchanged, where the points are on the side that is
free.
"""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from on_meshes import no_load, trial_and_test, vector_space
from parameters import slow
from support.sliding_bodies import SlidingBodies, as_linear_bodies
from two_bodies import assembled, facets, facets_of_cells, grid

from signorini_fx import ContactProblem, Pair

DEPTH = 0.02
KINDS = {2: "quadrilateral", 3: "hexahedron"}


def plate(dim, kind=None, cells=3, finer=1, upto=0.0, **settings):
    """A plate of the length 1 and the thickness 0.1, held where x[0] is at most ``upto``, above a
    block that is held below.

    Args:
        dim: of space.
        kind: of the cells.
        cells: of the block along each edge of its upper side.
        finer: by what the plate has more cells.
        upto: see above.
        settings: see ``SlidingBodies``.
    """
    kind, up, away = kind or KINDS[dim], dim - 1, 1e-6  # which tells the nodes of both sides apart
    low, high = [0.0] * (dim - 1), [1.0] * (dim - 1)
    bodies = (
        grid(kind, (*[cells] * (dim - 1), 2), [*low, -1.0], [*high, 0.0]),
        grid(kind, (*[finer * cells] * (dim - 1), 1), [*low, away], [*high, 0.1]),
    )
    touching = [lambda x: np.isclose(x[up], 0.0), lambda x: np.isclose(x[up], away)]
    held = [
        lambda x: np.isclose(x[up], -1.0),
        lambda x: (x[0] <= upto + 1e-9) & (x[up] >= away / 2),
    ]
    return SlidingBodies(kind, bodies, touching, held, reach=0.5, **settings)


def pressed(scene, depth=DEPTH):
    """The force across the sides on the lower body, of bodies that slide and of linear ones."""
    force = scene.move(*[0.0] * (len(scene.u) - 1), -depth)[-1]
    linear = sum(as_linear_bodies(scene).state.forces)[-1]
    return np.abs([force, linear])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("dim", "kind", "upto"),
    [(2, "quadrilateral", 0.0), (2, "triangle", 0.34), (3, "tetrahedron", 0.34)],
)
def test_both_choices_of_the_slave(dim, kind, upto):
    """An edge that is held, and a third of the side, on coarse meshes that match: linear bodies
    have one force, and those that slide differ by what turns.
    """
    slid, linear = np.transpose(
        [pressed(plate(dim, kind, upto=upto, slave=slave)) for slave in (0, 1)]
    )
    assert slid[1] == pytest.approx(slid[0], rel=0.005)
    assert linear[1] == pytest.approx(linear[0], rel=1e-6)


STRAIN, YOUNG_AND_LAME = 0.01, (100.0, 50.0)


def evenly_pressed(kind, degree, bodies, held, slave, sides=None):
    """Two blocks between smooth walls, pressed evenly, of which supports that move along hold some
    facets of both
    sides: the problem, and its displacement without these.

    Args:
        kind: of the cells.
        degree: of the displacement.
        bodies: cells and points of each.
        held: of each which facets of its side, from their middles, shape (f, d - 1).
        slave: which body has the points.
        sides: of each which facets are its side, likewise; None: all.
    """
    dim = bodies[0][1].shape[1]
    up, strain, (young, lame) = dim - 1, STRAIN, YOUNG_AND_LAME
    mesh, count = assembled(kind, *bodies), len(bodies[0][0])
    of_body = np.arange(count), np.arange(count, count + len(bodies[1][0]))
    all_facets = [
        facets_of_cells(mesh, lambda x: np.isclose(x[up], 0.0), cells) for cells in of_body
    ]
    middles = [dmesh.compute_midpoints(mesh, up, listed)[:, :up] for listed in all_facets]
    held = [
        listed[chosen(at)] for listed, chosen, at in zip(all_facets, held, middles, strict=True)
    ]
    if sides is not None:
        all_facets = [
            listed[chosen(at)]
            for listed, chosen, at in zip(all_facets, sides, middles, strict=True)
        ]
    space = vector_space(mesh, degree)
    exact = fem.Function(space)
    exact.interpolate(lambda x: np.stack([*[0.0 * x[0]] * up, -strain * x[up]]))
    ends = [*held, facets(mesh, lambda x: np.isclose(np.abs(x[up]), 1.0))]
    bcs = [fem.dirichletbc(exact, fem.locate_dofs_topological(space, up, end)) for end in ends]
    for axis in range(up):
        walls = facets(
            mesh, lambda x, axis=axis: np.isclose(x[axis], 0.0) | np.isclose(x[axis], 1.0)
        )
        dofs = fem.locate_dofs_topological(space.sub(axis), up, walls)
        bcs.append(fem.dirichletbc(fem.Constant(mesh, 0.0), dofs, space.sub(axis)))
    u, v = trial_and_test(space)
    a = (
        young * ufl.inner(ufl.sym(ufl.grad(u)), ufl.sym(ufl.grad(v))) * ufl.dx
        + lame * ufl.div(u) * ufl.div(v) * ufl.dx
    )
    nothing = no_load(mesh, v)
    pair = Pair(all_facets[slave], all_facets[1 - slave], reach=0.5)
    return ContactProblem(a, nothing, bcs=bcs, contact=pair, algorithm="alm"), exact


@pytest.mark.one_quick("slave", [0, 1])
@pytest.mark.parametrize("upto", [(0.4, 0.4), (0.4, 0.55)])
@pytest.mark.parametrize(
    ("kind", "degree"),
    [
        ("quadrilateral", 1),
        *(slow(*case) for case in (("triangle", 2), ("hexahedron", 1), ("tetrahedron", 2))),
    ],
)
def test_constant_stress_beside_a_region_in_which_both_sides_are_held(kind, degree, upto, slave):
    """Two blocks of meshes that do not match, between smooth walls, pressed evenly: where supports
    that move along hold a part of both sides, displacements and pressures are those without, and
    the force is that of the rest, also where one of both ends before the other.
    """
    dim = 2 if kind in ("quadrilateral", "triangle") else 3
    up = dim - 1

    def graded(x, last):
        """Two facets along what is held, and the others beside it."""
        along = np.where(x[:, 0] <= 0.5, 2 * last * x[:, 0], last + (1 - last) * (2 * x[:, 0] - 1))
        return np.column_stack((along, x[:, 1:]))

    bodies = [
        grid(
            kind,
            (4, *[n] * (dim - 2), 2),
            [*[0.0] * up, low],
            [*[1.0] * up, low + 1],
            lambda x, last=last: graded(x, last),
        )
        for n, low, last in ((2, -1.0, upto[0]), (3, 0.0, upto[1]))
    ]
    held = [lambda x, last=last: x[:, 0] <= last for last in upto]
    problem, exact = evenly_pressed(kind, degree, bodies, held, slave)
    moved, pressure = problem.solve().x.array, sum(YOUNG_AND_LAME) * STRAIN
    assert moved == pytest.approx(exact.x.array, abs=1e-10 * STRAIN)
    assert problem.state.pressure == pytest.approx(pressure, rel=1e-7)
    force = np.abs(sum(problem.state.forces))
    assert force == pytest.approx([*[0.0] * up, pressure * (1 - min(upto))], abs=1e-7 * pressure)
