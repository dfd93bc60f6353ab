"""Contact of two deformable bodies whose meshes do not match, in ``ContactProblem``."""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from two_bodies import KINDS, assembled, facets, facets_of_piece, forms, grid, held, on, per_cell

from signorini_fx import ContactProblem, Coulomb, Foundation, FormError, Pair, Tresca

ELEMENTS = [(kind, degree) for kind in KINDS for degree in (1, 2)]
COUNTS = {2: ((5, 2), (3, 2)), 3: ((3, 1, 2), (2, 1, 2))}


def rotation(dimension, angle=0.4):
    """Of the plane x[0], x[1]; in space about a skew axis."""
    turn = np.eye(dimension)
    turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    if dimension == 3:
        other = np.eye(3)
        other[1:, 1:] = turn[:2, :2]
        turn = turn @ other
    return turn


@pytest.mark.parametrize("exchanged", [False, True], ids=["", "exchanged"])
@pytest.mark.parametrize("law", ["bonded", "stick", "slip"])
@pytest.mark.parametrize(("kind", "degree"), ELEMENTS)
def test_patch(kind, degree, law, exchanged):
    """A state of constant stress in two blocks in any direction, with stick, oblique slip, or tied: exact."""
    dim = KINDS[kind]
    turn = rotation(dim)
    low, high = np.zeros(dim), np.ones(dim)
    below = high * 1.0
    below[1] = 0.0
    start = low.copy()
    start[1] = -1.0
    lower, upper = COUNTS[dim]
    mesh = assembled(
        kind, grid(kind, lower, start, below, lambda x: x @ turn.T), grid(kind, upper, low, high, lambda x: x @ turn.T)
    )

    def straight(x):
        return turn.T @ x

    both = [
        facets_of_piece(mesh, lambda x: np.isclose(straight(x)[1], 0), lambda x, s=s: s * straight(x)[1] > 0)
        for s in (1, -1)
    ]
    young, poisson = 100.0, 0.3
    normal = turn @ np.eye(dim)[1] * -1.0  # of the upper body
    # Compression with shear across the contact, in the frame of the blocks.
    strain = np.zeros((dim, dim))
    strain[1, 1] = -0.01
    strain[0, 1] = strain[1, 0] = 0.001
    if dim == 3:
        strain[2, 1] = strain[1, 2] = -0.0007
    strain = turn @ strain @ turn.T
    stress = young / (1 + poisson) * (strain + poisson / (1 - 2 * poisson) * np.trace(strain) * np.eye(dim))
    traction = stress @ normal
    pressure = -traction @ normal
    shear = -(traction + pressure * normal)  # mu = - sigma_T of the upper body
    slip = 0.003 * shear / np.linalg.norm(shear) if law == "slip" else np.zeros(dim)

    space, a, v = forms(mesh, degree, per_cell(mesh, lambda x: young), poisson)
    outer = facets(mesh, lambda x: np.full(x.shape[1], True))
    outer = np.setdiff1d(outer, np.concatenate(both)).astype(np.int32)
    # At the edges of the contact nodes of both bodies coincide: their cells say which body they are of.
    exact = fem.Function(space)
    exact.interpolate(lambda x: strain @ x[:dim])
    piece = np.zeros(len(space.tabulate_dof_coordinates()), dtype=bool)
    cells = space.dofmap.list
    middles = space.tabulate_dof_coordinates()[cells].mean(axis=1)[:, :dim]
    piece[cells[straight(middles.T)[1] > 0]] = True
    exact.x.array.reshape(-1, dim)[piece] += slip
    outside = fem.locate_dofs_topological(space, dim - 1, outer)
    friction = {"bonded": None, "stick": Coulomb(0.9), "slip": Tresca(float(np.linalg.norm(shear)))}[law]
    sides = both[::-1] if exchanged else both
    problem = ContactProblem(
        a,
        ufl.inner(fem.Constant(mesh, (0.0,) * dim), v) * ufl.dx,
        [fem.dirichletbc(exact, outside)],
        contact=Pair(*sides, friction=friction, bonded=law == "bonded"),
        algorithm="alm",
        tolerance=1e-12,
    )
    problem.solve()
    size = np.abs(exact.x.array).max()
    np.testing.assert_allclose(problem.u.x.array, exact.x.array, rtol=0, atol=1e-9 * size)
    state = problem.state
    np.testing.assert_allclose(state.pressure, pressure, rtol=1e-8)
    sign = -1.0 if exchanged else 1.0
    found = np.einsum("ijk,ik->ij", state.boundary.tangents, state.shear)
    np.testing.assert_allclose(found, np.tile(sign * shear, (len(found), 1)), rtol=0, atol=1e-8 * pressure)
    assert problem.certificate.coupling < 1e-9
