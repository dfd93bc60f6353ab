"""Statics of a body on its foundation: which loads admissible contact tractions can balance.

lambda >= 0, of any sign where the contact is bilateral, and |mu| <= g or <= F lambda, against the rigid motions that
the supports leave free.  Whether there is a balance does not depend on the stiffness of the body.
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
# Friction above this is taken for as much as is wanted.
_ROUGH = 1e6


def balance_exists(
    data: RegularisedData,
    boundary: ContactBoundary,
    motions: RigidMotions,
    resultant: npt.NDArray[np.float64],
) -> bool:
    """Whether admissible contact tractions can balance the load on the free rigid motions; collective."""
    return not unbalanced(data, boundary, motions, resultant).any()


def unbalanced(
    data: RegularisedData,
    boundary: ContactBoundary,
    motions: RigidMotions,
    resultant: npt.NDArray[np.float64],
) -> npt.NDArray[np.bool_]:
    """The assemblies whose load no admissible contact tractions can balance, shape (assemblies,); collective.

    lambda >= 0 (any sign where contact is bilateral) and |mu| <= F g, or <= F lambda, with the resultant of the load on
    the free rigid motions: a linear programme for each assembly, with one to three equations where it is one piece.
    Where it has no solution there is no static equilibrium, whatever the body's shape and stiffness.  Its unknowns are
    nodal forces over the size of the resultant, because the tolerances of the programme are absolute.
    """
    zero = np.zeros(boundary.size)
    bound, coupling = (zero if values is None else values for values in (data.bound, data.coupling))
    every = reactions(boundary, motions, bound, coupling, data.bilateral)
    leaving = np.zeros(int(motions.pieces.assembly.max()) + 1, dtype=bool)
    for number, columns, rows in motions.assemblies():
        here, load = every.of(number, columns), resultant[rows]
        # Where nothing presses every position off the foundation is as good as another.
        pressed = load.any() and here.given.size > 0
        leaving[number] = not (pressed and _balances(here, motions.free[:, columns].T @ resultant, load))
    return leaving


@dataclass(frozen=True)
class Reactions:
    """What the contact nodes of all ranks, n of them, can do against k motions; the same on every rank.

    Attributes:
        normal: each motion along the normal of each node, shape (n, k).
        tangential: along its tangent, shape (n, k).
        given: given part of the friction bound, a force, shape (n,).
        coefficient: F where the bound follows the pressure, shape (n,).
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
            tangential=self.tangential[here][:, columns],
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
    """The reactions that friction bounds (stresses, and shares of the pressure) allow for; collective."""
    modes = boundary.free[:, :, None] * motions.at(boundary.nodes)
    normal = np.einsum("ij,ijk->ik", boundary.normal, modes)
    tangential = np.einsum("ij,ijk->ik", boundary.tangents[:, :, 0], modes)
    two_sided = np.zeros(boundary.size) if bilateral is None else bilateral
    laws = np.column_stack((boundary.weight * bound, coefficient, two_sided, motions.assembly_of(boundary.nodes)))
    table = parallel.gather_rows(boundary.comm, np.column_stack((normal, tangential, laws)))
    k = motions.free.shape[1]
    given, shares, sides, assembly = table[:, 2 * k :].T
    return Reactions(table[:, :k], table[:, k : 2 * k], given, shares, sides > 0, assembly.astype(np.int64))


def _balances(here: Reactions, work: npt.NDArray[np.float64], load: npt.NDArray[np.float64]) -> bool:
    """The linear programme of one assembly.

    Args:
        here: its contact nodes.
        work: what the load does on its free motions, shape (k,).
        load: what it does on the motions of its pieces, free or not: its size is the unit of force.
    """
    n, given, coupling = here.given.size, here.given, here.coefficient
    # mu <= given + coupling lambda and -mu <= given + coupling lambda; an infinite bound is no row.
    finite = np.isfinite(given)
    cone, unit = -sparse.diags(coupling).tocsr()[finite], sparse.identity(n, format="csr")[finite]
    rows, limits = sparse.bmat([[cone, unit], [cone, -unit]]), np.tile(given[finite], 2)
    scale = max(float(np.abs(load).max()), 1e-300)
    result = linprog(
        np.zeros(2 * n),
        A_ub=rows,
        b_ub=limits / scale,
        A_eq=np.hstack((here.normal.T, here.tangential.T)),
        b_eq=work / scale,
        bounds=[(None if sign else 0.0, None) for sign in here.bilateral] + [(None, None)] * n,
    )
    return bool(result.status == 0)


def cone(contact: Reactions | None, count: int) -> tuple[Nodal, Nodal, Nodal]:
    """Contact reactions against so many motions, one a row.

    Returns:
        Generators, of length 1, of the cone that pressure and Coulomb friction can balance (a cap is not counted); what
        given friction balances at most, in either direction; the directions in which there is any reaction.
    """
    if contact is None:
        none = np.empty((0, count))
        return none, none, none
    c, share = contact, contact.coefficient[:, None]
    edges = [c.normal + share * c.tangential, c.normal - share * c.tangential, c.normal]
    rough = c.coefficient > _ROUGH
    edges += [c.tangential[rough], -c.tangential[rough]]
    edges += [-edge[c.bilateral] for edge in edges[:3]]
    cone = np.concatenate(edges)
    sizes = np.linalg.norm(cone, axis=1)
    directions = np.concatenate([c.normal, c.tangential[(c.coefficient > 0) | (c.given > 0)]])
    return cone[sizes > ZERO] / sizes[sizes > ZERO, None], c.given[:, None] * c.tangential, directions


def null_space(rows: Nodal) -> Nodal:
    """Directions, one a column, across all the rows."""
    values, vectors = np.linalg.eigh(rows.T @ rows)
    null: Nodal = vectors[:, values <= ZERO**2 * max(float(values[-1]), 1e-300)]
    return null


def left_over(generators: Nodal, load: Nodal) -> Nodal:
    """What is left of a load when the cone has taken all that it can: load minus its projection onto the cone.

    The rest r satisfies generators r <= 0: a motion that every reaction lets happen.  (``scipy.optimize.nnls`` of SciPy
    1.15 is wrong for one random cone in forty.)
    """
    scale = float(np.linalg.norm(load))
    if scale == 0.0 or not len(generators):
        return load.copy()
    found = lsq_linear(generators.T, load / scale, (0.0, np.inf), method="bvls", tol=1e-14)
    rest: Nodal = load - scale * (found.x @ generators)
    return rest
