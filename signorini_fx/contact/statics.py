"""Statics of a body on its foundation: which loads admissible contact tractions can balance.

lambda >= 0, of any sign where the contact is bilateral, and |mu| <= g or <= F lambda, against the rigid motions that
the supports leave free.  Whether there is a balance does not depend on the stiffness of the body.

In space |mu| <= g is a disc, and the balance a second-order cone programme.  Here the disc is enclosed between two
regular polygons, which lead to linear programmes: if the outer one has no solution, there is no equilibrium; if the
inner one has a solution, there is one.  Between them, half a per cent of the friction, the iteration decides.  In the
plane both are the interval.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.optimize import linprog, lsq_linear

from signorini_fx import parallel
from signorini_fx.body.contact_boundary import ContactBoundary
from signorini_fx.body.rigid import RigidMotions
from signorini_fx.contact.laws import Nodal, RegularisedData

# Forces and motions below this share of their scale are round-off.
ZERO = 1e-8
# Sides of the polygons: the outer radius is 1 / cos(pi / 32) of the inner one, 1.005.
_SIDES = 32
# Friction above this is treated as unlimited.
_ROUGH = 1e6


def balance_exists(
    data: RegularisedData,
    boundary: ContactBoundary,
    motions: RigidMotions,
    resultant: npt.NDArray[np.float64],
) -> bool:
    """Whether admissible contact tractions can balance the load on the free rigid motions; collective.

    In space: whether it is not proved that they cannot.
    """
    return not unbalanced(data, boundary, motions, resultant).any()


def unbalanced(
    data: RegularisedData,
    boundary: ContactBoundary,
    motions: RigidMotions,
    resultant: npt.NDArray[np.float64],
) -> npt.NDArray[np.bool_]:
    """The assemblies whose load no admissible contact tractions can balance, shape (assemblies,); collective.

    lambda >= 0 (any sign where contact is bilateral) and |mu| <= F g, or <= F lambda, with the resultant of the load on
    the free rigid motions: a linear programme for each assembly, with as many equations as it has free motions.
    Where it has no solution there is no static equilibrium, whatever the body's shape and stiffness.  Its unknowns are
    nodal forces over the size of the resultant, because the tolerances of the programme are absolute.
    In space the outer polygon replaces the disc of |mu|.
    """
    zero = np.zeros(boundary.size)
    bound, coupling = (zero if values is None else values for values in (data.bound, data.coupling))
    every = reactions(boundary, motions, bound, coupling, data.bilateral)
    leaving = np.zeros(int(motions.pieces.assembly.max()) + 1, dtype=bool)
    for number, columns, rows in motions.assemblies():
        here, load = every.of(number, columns), resultant[rows]
        if not here.given.size:
            leaving[number] = True
        elif load.any():
            leaving[number] = not _balances(here, motions.free[:, columns].T @ resultant, load)
        else:
            # If nothing presses the body on, all positions off the foundation are equivalent.
            leaving[number] = not squeezed(data, boundary, every, number, columns)
    return leaving


def squeezed(
    data: RegularisedData, boundary: ContactBoundary, every: Reactions, number: int, columns: npt.NDArray[np.bool_]
) -> bool:
    """Whether one assembly is held by its foundation without a load, as in an interference fit; collective.

    Args:
        data: the problem.
        boundary: the contact nodes.
        every: their reactions, on all ranks.
        number: of the assembly.
        columns: its free motions.
    """
    gap = parallel.gather_rows(boundary.comm, data.gap[:, None])[every.assembly == number, 0]
    return _interferes(every.of(number, columns), gap)


@dataclass(frozen=True)
class Reactions:
    """The reactions of the n contact nodes of all ranks to k motions; the same on every rank.

    Attributes:
        normal: each motion along the normal of each node, shape (n, k).
        tangential: along its tangents, shape (n, d - 1, k).
        given: given part of the friction bound, a force, shape (n,).
        coefficient: F where the bound depends on the pressure, shape (n,).
        bilateral: whether the contact cannot open, shape (n,).
        assembly: number of the assembly that the node is in, shape (n,).
    """

    normal: Nodal
    tangential: Nodal
    given: Nodal
    coefficient: Nodal
    bilateral: npt.NDArray[np.bool_]
    assembly: npt.NDArray[np.int64]

    def of(self, number: int, columns: npt.NDArray[np.bool_]) -> Reactions:
        """The nodes and the motions of one assembly."""
        here = self.assembly == number
        return Reactions(
            normal=self.normal[here][:, columns],
            tangential=self.tangential[here][:, :, columns],
            given=self.given[here],
            coefficient=self.coefficient[here],
            bilateral=self.bilateral[here],
            assembly=self.assembly[here],
        )


def reactions(
    boundary: ContactBoundary,
    motions: RigidMotions,
    bound: Nodal,
    coefficient: Nodal,
    bilateral: npt.NDArray[np.bool_] | None,
) -> Reactions:
    """The reactions that friction bounds (stresses, and shares of the pressure) allow; collective."""
    modes = motions.at(boundary)
    normal = np.einsum("ij,ijk->ik", boundary.normal, modes)
    tangential = np.einsum("ijt,ijk->itk", boundary.tangents, modes)
    two_sided = np.zeros(boundary.size) if bilateral is None else bilateral
    laws = np.column_stack((boundary.weight * bound, coefficient, two_sided, motions.assembly_of(boundary.nodes)))
    _, tangents, k = tangential.shape
    flat = tangential.reshape(boundary.size, tangents * k)
    table = parallel.gather_rows(boundary.comm, np.column_stack((normal, flat, laws)))
    given, shares, sides, assembly = table[:, (1 + tangents) * k :].T
    sideways = table[:, k : (1 + tangents) * k].reshape(-1, tangents, k)
    return Reactions(table[:, :k], sideways, given, shares, sides > 0, assembly.astype(np.int64))


def corners(tangents: int, *, outer: bool) -> Nodal:
    """Corners of the polygon that replaces the unit disc of R^(d - 1), shape (m, d - 1); in R^1 the interval's ends.

    Args:
        tangents: d - 1.
        outer: whether it is around the disc, or within it.
    """
    if tangents == 1:
        return np.array([[1.0], [-1.0]])
    angle = 2 * np.pi * np.arange(_SIDES) / _SIDES
    radius = 1 / np.cos(np.pi / _SIDES) if outer else 1.0
    return radius * np.column_stack((np.cos(angle), np.sin(angle)))


def _balances(
    here: Reactions, work: npt.NDArray[np.float64], load: npt.NDArray[np.float64], *, outer: bool = True
) -> bool:
    """The linear programme of one assembly: mu is a combination of the corners of the polygon, with non-negative shares
    that sum up to no more than the bound.

    Args:
        here: its contact nodes.
        work: the work of the load on its free motions, shape (k,).
        load: the same on all motions of its pieces, free or not: its size is the unit of force.
        outer: which polygon.
    """
    n, given, coupling = here.given.size, here.given, here.coefficient
    ends = corners(here.tangential.shape[1], outer=outer)
    pulls = np.einsum("ct,itk->cik", ends, here.tangential).reshape(-1, work.size)
    # The shares of a node sum up to given + coupling lambda at most; an infinite bound is no row.
    finite = np.isfinite(given)
    own = sparse.identity(n, format="csr")[finite]
    rows = sparse.hstack([-sparse.diags(coupling).tocsr()[finite], *[own] * len(ends)])
    scale = max(float(np.abs(load).max()), 1e-300)
    result = linprog(
        np.zeros(n + len(pulls)),
        A_ub=rows,
        b_ub=given[finite] / scale,
        A_eq=np.hstack((here.normal.T, pulls.T)),
        b_eq=work / scale,
        bounds=[(None if sign else 0.0, None) for sign in here.bilateral] + [(0.0, None)] * len(pulls),
    )
    return bool(result.status == 0)


def _interferes(here: Reactions, gap: Nodal) -> bool:
    """Whether the contact nodes of one assembly overlap with the foundation wherever it is.

    Args:
        here: its contact nodes.
        gap: at these nodes, length, shape (n,).
    """
    size = float(np.abs(gap).max())
    if size == 0.0:
        return False
    # The motion with the largest clearance, in units of the largest gap.
    rows = np.vstack((here.normal, -here.normal[here.bilateral]))
    limits = np.concatenate((gap, -gap[here.bilateral])) / size
    unknowns = np.append(np.zeros(rows.shape[1]), -1.0)
    result = linprog(
        unknowns,
        A_ub=np.column_stack((rows, np.ones(len(rows)))),
        b_ub=limits,
        bounds=[(None, None)] * rows.shape[1] + [(None, 0.0)],
    )
    return bool(result.status == 0 and -result.fun < -ZERO)


def certainly_balances(here: Reactions, work: npt.NDArray[np.float64], load: npt.NDArray[np.float64]) -> bool:
    """Whether one assembly is in equilibrium for certain: with the inner polygon; see ``_balances``."""
    return _balances(here, work, load, outer=False)


def cone(contact: Reactions | None, count: int) -> tuple[Nodal, Nodal, Nodal]:
    """Contact reactions against this number of motions, one per row.

    Returns:
        Generators, of length 1, of a cone that contains all loads that pressure and Coulomb friction can balance (a cap
        is not counted); the most that Tresca friction balances in each direction of the tangents, shape
        (n, d - 1, count); the directions in which there is any reaction.
    """
    if contact is None:
        none = np.empty((0, count))
        return none, none[:, None], none
    c, share = contact, contact.coefficient[:, None]
    pulls = [np.einsum("t,itk->ik", end, c.tangential) for end in corners(c.tangential.shape[1], outer=True)]
    edges = [*(c.normal + share * pull for pull in pulls), c.normal]
    rough = c.coefficient > _ROUGH
    edges += [*(pull[rough] for pull in pulls), *(-edge[c.bilateral] for edge in edges)]
    cone = np.concatenate(edges)
    sizes = np.linalg.norm(cone, axis=1)
    acting = c.tangential[(c.coefficient > 0) | (c.given > 0)]
    directions = np.concatenate([c.normal, acting.reshape(-1, count)])
    return cone[sizes > ZERO] / sizes[sizes > ZERO, None], c.given[:, None, None] * c.tangential, directions


def null_space(rows: Nodal) -> Nodal:
    """Directions, one per column, perpendicular to all rows."""
    values, vectors = np.linalg.eigh(rows.T @ rows)
    null: Nodal = vectors[:, values <= ZERO**2 * max(float(values[-1]), 1e-300)]
    return null


def left_over(generators: Nodal, load: Nodal) -> Nodal:
    """The remainder of a load that the cone cannot balance: load minus its projection onto the cone.

    The remainder r satisfies generators r <= 0: a motion that no reaction opposes.  (``scipy.optimize.nnls`` of SciPy
    1.15 is wrong for one random cone in forty.)
    """
    scale = float(np.linalg.norm(load))
    if scale == 0.0 or not len(generators):
        return load.copy()
    found = lsq_linear(generators.T, load / scale, (0.0, np.inf), method="bvls", tol=1e-14)
    rest: Nodal = load - scale * (found.x @ generators)
    return rest
