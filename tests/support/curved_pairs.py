"""Two curved bodies pressed together: what is known of them without a solver, and what the solver
says.

Mirror-equal bodies meet in the plane of symmetry between them: the force is that of one of them on
a rigid plane, and as nothing moves along that plane relative to the other side, friction has
nothing to take.  So the shear, as a share of F P, and the difference of the forces are errors, of
the frames and of the discretisation.
"""

from typing import NamedTuple

import numpy as np
import ufl
from dolfinx import fem
from two_bodies import KINDS, assembled, facets, facets_of_piece, forms, grid, held

from signorini_fx import ContactProblem, Coulomb, Foundation, Pair

SIZE = 3.0


class Pressed(NamedTuple):
    """Attributes: force; shear, the sum of its magnitudes; share, of F P; a, half the width of
    contact.
    """

    force: float
    shear: float
    share: float
    a: float


def cap(kind, radius, sign, cells, power=1.7):
    """A body on -3 <= x <= 3 (in 3D |x|, |y| <= 3) with a rounded face at the origin.

    Args:
        kind: of the cells.
        radius: of the face, a paraboloid; infinite: flat.
        sign: +1 above the face, -1 below.
        cells: along the half width, and through the body.
        power: by which cells shrink towards the origin.
    """
    dim, (along, through) = KINDS[kind], cells

    def place(x):
        s, z = x[:, :-1], x[:, -1]
        wide = SIZE * np.sign(s) * np.abs(s) ** power
        face = (wide**2).sum(axis=1) / (2 * radius)
        return np.column_stack((wide, sign * (face + (SIZE - face) * z**1.3)))

    return grid(
        kind, (*[2 * along] * (dim - 1), through), (*[-1.0] * (dim - 1), 0.0), (1.0,) * dim, place
    )


def press(kind, cells, radii, depth, *, poisson=0.3, degree=1, slave=0, friction=0.3, **given):
    """Press two caps, or one on a rigid foundation, and solve.

    Args:
        kind: of the cells.
        cells: of both caps, see ``cap``; of one alone: its foundation is rigid.
        radii: of both.
        depth: by which the upper one moves down.
        poisson: of both.
        degree: of the elements.
        slave: 0: the points are on the upper one.
        friction: F.
        given: settings.
    """
    up, alone = KINDS[kind] - 1, len(cells) == 1
    made = [cap(kind, r, s, n) for r, s, n in zip(radii, (1.0, -1.0), cells, strict=False)]
    mesh = assembled(kind, *made)
    space, a, v = forms(mesh, degree, 200.0, poisson)
    sides = [
        facets_of_piece(
            mesh,
            lambda x, r=r, s=s: np.isclose(x[up], s * (x[:up] ** 2).sum(axis=0) / (2 * r)),
            lambda x, s=s: s * x[up] > 0,
        )
        for r, s in zip(radii, (1.0, -1.0), strict=False)
    ]
    ends = [facets(mesh, lambda x, z=z: np.isclose(x[up], z)) for z in (SIZE, -SIZE)]
    bcs = [held(space, ends[0], k) for k in range(up)] + [held(space, ends[0], up, -depth)]
    law = Coulomb(friction) if friction else None
    if alone:
        against = Foundation(
            sides[0], gap=lambda x: x[up], direction=(*(0.0,) * up, -1.0), friction=law
        )
    else:
        bcs += [held(space, ends[1], k) for k in range(up + 1)]
        against = Pair(sides[slave], sides[1 - slave], friction=law, distance="geometry")
    nothing = ufl.inner(fem.Constant(mesh, (0.0,) * (up + 1)), v) * ufl.dx
    problem = ContactProblem(
        a, nothing, bcs, contact=against, **{"algorithm": "alm", "tolerance": 1e-9} | given
    )
    problem.solve()
    return problem


def figures(problem, friction=0.3):
    """See ``Pressed``."""
    state, up = problem.state, problem.state.boundary.x.shape[1] - 1
    boundary = state.boundary
    force = abs(float(state.forces[0][up]))
    shear = float(boundary.weight @ np.linalg.norm(state.shear, axis=1))
    touching = boundary.x[state.pressure > 0]
    return Pressed(force, shear, shear / (friction * force), float(np.abs(touching[:, 0]).max()))


def mirrored(kind, cells, radius, depth, **given):
    """(force of two equal bodies over that of one on a plane) - 1, the share, and a / R."""
    one = figures(press(kind, cells[:1], (radius,), depth / 2, friction=0.0, **given))
    two = figures(press(kind, cells, (radius, radius), depth, **given))
    return two.force / one.force - 1.0, two.share, one.a / radius
