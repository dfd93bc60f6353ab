"""Two deformable bodies against solutions in closed form."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from on_meshes import at_coordinate, no_load
from two_bodies import (
    KINDS,
    assembled,
    facets,
    facets_of_piece,
    forms,
    grid,
    held,
    on,
    per_cell,
    stress_of,
)

from signorini_fx import ContactProblem, Coulomb, Pair


def quarter(kind, counts, inner, outer):
    """A quarter of a ring."""

    def place(x):
        return np.stack((x[:, 0] * np.cos(x[:, 1]), x[:, 0] * np.sin(x[:, 1])), axis=1)

    return grid(kind, counts, (inner, 0.0), (outer, np.pi / 2), place)


@pytest.mark.one_quick("exchanged", [False, True], ids=["", "exchanged"])
def test_disc_that_sticks_in_a_ring(exchanged):
    """A disc cut at r = 0.6 under the pressure 1e7 + 1e6 cos 2t: the same pressure at the cut, and
    the shear
    0.64e6 sin 2t (SSNP167 of the Code_Aster manuals).
    """
    mean, part, cut, bore = 1e7, 1e6, 0.6, 0.2
    kind, degree = "quadrilateral", 2
    mesh = assembled(kind, quarter(kind, (4, 16), bore, cut), quarter(kind, (4, 21), cut, 1.0))

    def inner(x):
        return np.hypot(*x[:2]) < cut

    space, a, v = forms(mesh, degree, per_cell(mesh, lambda x: 1e9), 0.2)
    sides = [
        facets_of_piece(mesh, lambda x: np.isclose(np.hypot(*x), cut), lambda x, s=s: inner(x) == s)
        for s in (True, False)
    ]
    x = ufl.SpatialCoordinate(mesh)
    r2 = ufl.dot(x, x)
    outward = x / ufl.sqrt(r2)
    around = ufl.as_vector((-outward[1], outward[0]))
    cosine, sine = (x[0] ** 2 - x[1] ** 2) / r2, 2 * x[0] * x[1] / r2
    radial, shear = -mean - part * cosine, part * (1 - r2) * sine
    rim, hole = (facets(mesh, lambda x, r=r: np.isclose(np.hypot(*x), r)) for r in (1.0, bore))
    order = np.argsort(np.concatenate((rim, hole)))
    marks = np.repeat([1, 2], [rim.size, hole.size]).astype(np.int32)[order]
    tags = dmesh.meshtags(mesh, 1, np.concatenate((rim, hole))[order], marks)
    ds = ufl.ds(domain=mesh, subdomain_data=tags, metadata={"quadrature_degree": 6})
    rim, hole = ds(1), ds(2)
    load = radial * ufl.dot(v, outward) * rim
    load -= (radial * ufl.dot(v, outward) + shear * ufl.dot(v, around)) * hole
    bcs = [held(space, facets(mesh, lambda x, k=k: np.isclose(x[k], 0.0)), k) for k in (0, 1)]
    pair = Pair(
        *(sides[::-1] if exchanged else sides), distance="nominal", gap=0.0, friction=Coulomb(0.5)
    )
    problem = ContactProblem(a, load, bcs, contact=pair)
    problem.solve()
    state = problem.state
    angle = np.arctan2(state.boundary.x[:, 1], state.boundary.x[:, 0])
    inside = (angle > 0.1) & (angle < np.pi / 2 - 0.1)
    pressure = mean + part * np.cos(2 * angle)
    # Facets are chords of the circle, which scatters the pressure from node to node.
    assert np.sqrt(np.mean((state.pressure - pressure)[inside] ** 2)) < 0.02 * mean
    away = np.abs(state.shear[:, 0]) - 0.64 * part * np.sin(2 * angle)
    assert np.sqrt(np.mean(away[inside] ** 2)) < 0.08 * part


@pytest.mark.one_quick("finer", ["slave", "master"])
@pytest.mark.parametrize(
    ("kind", "degree"), [("triangle", 1), ("quadrilateral", 1), ("triangle", 2)]
)
def test_bonded_blocks_converge(kind, degree, finer):
    """The solution (sin(2x + 1) cos 3y, cos 2x sin(3y + 1/2)) in two blocks that are tied: the
    error of the energy norm falls with the degree of the elements, whichever side is finer.
    """
    errors = []
    for count in (4, 8):
        counts = (3 * count // 2, count) if finer == "slave" else (count, 3 * count // 2)
        bodies = [
            grid(kind, (n, n), (0.0, y), (1.0, y + 1.0))
            for n, y in zip(counts, (0.0, -1.0), strict=True)
        ]
        mesh = assembled(kind, *bodies)
        space, a, v = forms(mesh, degree, per_cell(mesh, lambda x: 10.0))
        x = ufl.SpatialCoordinate(mesh)
        exact = ufl.as_vector(
            (ufl.sin(2 * x[0] + 1) * ufl.cos(3 * x[1]), ufl.cos(2 * x[0]) * ufl.sin(3 * x[1] + 0.5))
        )
        both = [
            facets_of_piece(mesh, at_coordinate(1, 0), lambda x, s=s: s * x[1] > 0) for s in (1, -1)
        ]
        outer = np.setdiff1d(
            facets(mesh, lambda x: np.full(x.shape[1], True)), np.concatenate(both)
        ).astype(np.int32)
        bcs = [
            held(
                space,
                outer,
                value=lambda x: (
                    np.sin(2 * x[0] + 1) * np.cos(3 * x[1]),
                    np.cos(2 * x[0]) * np.sin(3 * x[1] + 0.5),
                ),
            )
        ]
        load = -ufl.inner(ufl.div(stress_of(exact, 10.0, 0.3)), v) * ufl.dx
        # The linear problem alone, however large its displacements are.
        of_both = Pair(*both, kind="bonded")
        problem = ContactProblem(
            a, load, bcs, contact=of_both, algorithm="alm", largest_deformation=1e3
        )
        problem.solve()
        away = ufl.sym(ufl.grad(problem.u - exact))
        errors.append(
            np.sqrt(fem.assemble_scalar(fem.form(ufl.inner(away, away) * ufl.dx(degree=8))))
        )
    assert np.log2(errors[0] / errors[1]) == pytest.approx(degree, abs=0.15)


@pytest.mark.one_quick("degree", [1, 2])
@pytest.mark.parametrize("kind", KINDS)
def test_a_narrow_block_on_a_wide_one(kind, degree):
    """A pressure on the top of a block and beside it on the wider one below: both have this stress,
    exactly (as in SSNP121 and SSNP170 of the Code_Aster manuals, with 1e5 and 25).
    """
    dim = KINDS[kind]
    pressed = {2: 1e5, 3: 25.0}[dim]
    deep = (2,) * (dim - 2), (3,) * (dim - 2)
    narrow = grid(kind, (4, *deep[1], 2), (0.0,) * dim, (1.0,) * dim)
    wide = grid(
        kind, (9, *deep[0], 2), (-1.0, *(0.0,) * (dim - 2), -1.0), (2.0, *(1.0,) * (dim - 2), 0.0)
    )
    mesh = assembled(kind, narrow, wide)
    young, poisson, last = 1e4 * pressed, 0.3, dim - 1
    space, a, v = forms(mesh, degree, per_cell(mesh, lambda x: young), poisson)

    def at_joint(inside):
        return facets_of_piece(mesh, lambda x: np.isclose(x[last], 0), inside)

    upper = at_joint(lambda x: x[last] > 0)
    lower = at_joint(lambda x: (x[last] < 0) & (abs(x[0] - 0.5) < 0.5))
    beside = at_joint(lambda x: (x[last] < 0) & (abs(x[0] - 0.5) > 0.5))
    top = facets(mesh, lambda x: np.isclose(x[last], 1))
    load = -pressed * v[last] * on(mesh, np.concatenate((top, beside)))
    # Nothing strains through the depth, as in plane strain.
    widening, shortening = (
        poisson * (1 + poisson) * pressed / young,
        (1 - poisson**2) * pressed / young,
    )
    bcs = [held(space, facets(mesh, lambda x: np.isclose(x[last], -1)), last, shortening)]
    bcs.append(held(space, facets_of_piece(mesh, at_coordinate(0, 0), lambda x: x[last] > 0), 0))
    bcs.append(held(space, facets(mesh, at_coordinate(0, -1)), 0, -widening))
    if dim == 3:
        bcs.append(
            held(space, facets(mesh, lambda x: np.isclose(x[1], 0) | np.isclose(x[1], 1)), 1)
        )
    problem = ContactProblem(
        a, load, bcs, contact=Pair(upper, lower), algorithm="alm", tolerance=1e-12
    )
    problem.solve()
    x = space.tabulate_dof_coordinates()[:, :dim]
    exact = np.zeros_like(x)
    exact[:, 0], exact[:, last] = widening * x[:, 0], -shortening * x[:, last]
    np.testing.assert_allclose(
        problem.u.x.array.reshape(-1, dim), exact, rtol=0, atol=1e-9 * shortening
    )
    np.testing.assert_allclose(problem.state.pressure, pressed, rtol=1e-8)


@pytest.mark.slow
def test_cattaneo_and_mindlin_of_two_balls():
    """Paraboloids of one material, pressed and pushed: a circle of radius c = a (1 - Q / F P)^(1/3)
    sticks, and the shear is the difference of two of Hertz's distributions.  The surfaces are
    nearly flat, since the shear is that in the tangent plane of one of them.
    """
    young, poisson, radius, coefficient, size = 200.0, 0.3, 40.0, 0.3, 3.0

    def half(sign, fine, through):
        """Cells of 0.8 / fine beside the contact."""
        at = np.concatenate(
            (np.linspace(0, 0.8, fine, endpoint=False), 0.8 + 2.2 * np.linspace(0, 1, 5) ** 1.5)
        )
        last = len(at) - 1
        cells, x = grid("hexahedron", (2 * last, last, through), (-last, 0, 0), (last, last, 1))
        x = np.column_stack(
            [np.sign(y) * np.interp(np.abs(y), range(last + 1), at) for y in x.T[:2]]
            + [size * x[:, 2] ** 1.7]
        )
        face = (x[:, 0] ** 2 + x[:, 1] ** 2) / (2 * radius)
        return cells, np.column_stack((x[:, :2], sign * (face + (size - face) * x[:, 2] / size)))

    mesh = assembled("hexahedron", half(1.0, 9, 7), half(-1.0, 8, 6))
    space, a, v = forms(mesh, 1, per_cell(mesh, lambda x: young), poisson)
    sides = [
        facets_of_piece(
            mesh,
            lambda x, s=s: np.isclose(x[2], s * (x[0] ** 2 + x[1] ** 2) / (2 * radius)),
            lambda x, s=s: s * x[2] > 0,
        )
        for s in (1.0, -1.0)
    ]
    ends = [facets(mesh, at_coordinate(2, z)) for z in (size, -size)]
    bcs = [held(space, facets(mesh, at_coordinate(1, 0.0)), 1)]
    bcs += [held(space, ends[0], k, value) for k, value in ((0, 0.0036), (2, -0.016))]
    bcs += [held(space, ends[1], k) for k in (0, 2)]
    problem = ContactProblem(
        a, no_load(mesh, v), bcs, contact=Pair(*sides, friction=Coulomb(coefficient))
    )
    problem.solve()
    state = problem.state
    force = 2 * np.abs(np.sum(state.forces, axis=0))
    share = force[0] / (coefficient * force[2])
    assert 0.5 < share < 0.85
    stiffness = young / (2 * (1 - poisson**2))
    contact = (3 * force[2] * (radius / 2) / (4 * stiffness)) ** (1 / 3)
    stick = contact * (1 - share) ** (1 / 3)
    shear, distance = np.linalg.norm(state.shear, axis=1), np.hypot(*state.boundary.x[:, :2].T)
    sticks = shear < (1 - 1e-6) * coefficient * state.pressure
    cell = np.sqrt(state.boundary.weight[distance < contact].max())
    found = np.sqrt(2 * state.boundary.weight[sticks].sum() / np.pi)
    assert found == pytest.approx(stick, abs=cell / 2)
    assert not sticks[distance > stick + cell].any()
    assert sticks[distance < stick - cell].all()
    root = [np.sqrt(np.maximum(0.0, 1 - (distance / edge) ** 2)) for edge in (contact, stick)]
    expected = (
        coefficient
        * 3
        * force[2]
        / (2 * np.pi * contact**2)
        * (root[0] - stick / contact * root[1])
    )
    weight = state.boundary.weight
    assert np.sqrt(weight @ (shear - expected) ** 2 / (weight @ expected**2)) < 0.15
    inside = distance < stick - cell
    assert np.abs(shear - expected)[inside].max() < 0.1 * expected.max()
