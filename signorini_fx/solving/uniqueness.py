"""A bound of the friction coefficient below which the solution on a mesh is unique, proved from the
stiffness of the contact points.

Let v be the difference of two solutions with the same loads, and r that of the nodal contact
forces, so that S v = -r with the condensed stiffness S.  At every point r_N v_N >= 0 and r_T . v_T
>= -F |r_N| |v_T|, with and without regularisation and in bilateral contact.  From this the
inequality of docs/theory.md follows for any weights nu and d.  Here one nu and one factor of d are
chosen so that the bound of F is as large as possible.  Tresca friction is F = 0: its shear stays in
r.  A bonded point does not move.
"""

from __future__ import annotations

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
import numpy as np
from petsc4py import PETSc
from scipy.linalg import LinAlgError, eigh, null_space
from scipy.optimize import minimize
from scipy.sparse import csr_array

from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.algebra.linalg.blocks import by_entries
from signorini_fx.algebra.linalg.schur import SchurComplement
from signorini_fx.arrays import Array, Ints
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.features import refused_by
from signorini_fx.records import Finding
from signorini_fx.tuned import CERTIFICATE_TOLERANCE, NOTHING_LEFT

# How often the largest eigenvalue is evaluated.
_EVALUATIONS = 60
# Largest number of components of contact points, because the matrices are dense.
_MOST_COMPONENTS = 1200
_NOT_TRIED = {
    "cohesion": "bonds soften, and the load may have several solutions",
    "driven foundation": "a force moves a foundation",
    "soft contact": "contact gives way under its pressure",
}


def uniqueness_findings(model: Model) -> list[Finding]:
    """Return a finding with the coefficient of Coulomb friction below which the last load step has
    one solution, given the steps before it.
    """
    law = model.law
    if law is None or not model.has_coulomb:
        return []
    stiffness = _contact_stiffness(model)
    multiple, why = (
        (0.0, stiffness) if isinstance(stiffness, str) else proved_multiple(*stiffness, law)
    )
    if multiple == 0.0:
        return [
            Finding("note", "contact", f"one solution is proved for no friction coefficient: {why}")
        ]
    if multiple == np.inf:
        return []
    acting = law.coefficient[law.coefficient > 0]
    uniform = acting.size and np.ptp(acting) <= NOTHING_LEFT * acting[0]
    below = f"{multiple * acting[0]:.4g}" if uniform else f"{multiple:.4g} times the coefficients"
    sentence = (
        f"with friction coefficients below {below} there is one solution on this mesh, "
        "whatever the loads are"
    )
    assumed = (
        "; sections are shortened as they are" if model.statement.effects.get("preload") else ""
    )
    return [Finding("note", "contact", f"{sentence}{assumed}")]


def _contact_stiffness(model: Model) -> tuple[Array, Array] | str:
    """Return the condensed stiffness and the contact map for ``proved_multiple``; or a message why
    there is no proof.
    """
    law = model.law
    load_step = len(model.path.times) - 1
    assert law is not None
    # These effects have further unknowns, which the stiffness would take as fixed.
    for _, clause in refused_by(model.statement, _NOT_TRIED):
        return f"not tried where {clause}"
    if model.tightens(load_step):
        return "not tried where a force determines the shortening of a section"
    if law.ends_open is not None:
        return "where a point opens, its friction ends with a jump"
    if law.laws:
        return law.unknown
    if model.comm.size > 1:
        return "the proof is for one rank"
    elasticity = model.elasticity([])
    starts, columns, values = elasticity.contact.operator.getValuesCSR()
    retained = np.unique(columns).astype(np.int32)
    if max(retained.size, len(starts) - 1) > _MOST_COMPONENTS:
        return (
            f"there are {len(starts) - 1} components of contact points, the proof is for at "
            f"most {_MOST_COMPONENTS}"
        )
    free = ~elasticity.contact.fixed[retained]
    operator = csr_array((values, np.searchsorted(retained, columns), starts)).toarray()
    try:
        of = by_entries(elasticity.matrix), retained, (), elasticity.positions
        condensed = SchurComplement(*of, definite=elasticity.definite).dense[np.ix_(free, free)]
    except PETSc.Error:
        return "a part of the body moves freely though its contact points are fixed"
    return condensed, operator[:, free]


def proved_multiple(stiffness: Array, operator: Array, law: PointFriction) -> tuple[float, str]:
    """Return the multiple of the friction coefficients below which uniqueness is proved, and the
    reason if it is zero.

    The multiple is infinite if no point with friction has a positive coefficient.

    Args:
        stiffness: of the unknowns that are not prescribed, the others condensed, shape (u, u).
        operator: the contact map B on these unknowns, rows (n, T) of each point.
        law: the friction law.
    """
    coefficient = law.coefficient
    moves = np.linalg.norm(operator, axis=1) > NOTHING_LEFT
    by_point = moves.reshape(coefficient.size, -1)
    if ((coefficient > 0) & ~by_point[:, 0] & by_point[:, 1:].any(axis=1)).any():
        return 0.0, "a support takes the pressure at a point that friction acts on"
    if np.linalg.matrix_rank(operator[moves], tol=NOTHING_LEFT) < np.count_nonzero(moves):
        return (
            0.0,
            "some contact points share a node, or supports hold them in directions of their own",
        )
    point, component = np.nonzero(by_point)
    bonded = np.isinf(law.given[point])
    rubs = (component > 0) & ((coefficient[point] > 0) | (law.given[point] > 0)) & ~bonded
    presses = (component == 0) & ~bonded
    motions = np.linalg.pinv(operator[moves])
    kept = np.column_stack((motions[:, presses], motions[:, rubs]))
    loose = np.column_stack((motions[:, ~(presses | rubs | bonded)], null_space(operator[moves])))
    coupling = loose.T @ stiffness @ kept
    inside = np.linalg.pinv(loose.T @ stiffness @ loose, rcond=NOTHING_LEFT, hermitian=True)
    condensed = kept.T @ stiffness @ kept - coupling.T @ inside @ coupling
    sizes = coefficient[point[rubs]]
    if not (sizes > 0).any():
        return np.inf, ""
    normal = int(np.count_nonzero(presses))
    beside = np.minimum(np.searchsorted(point[presses], point[rubs]), max(normal - 1, 0))
    return _critical((condensed + condensed.T) / 2, normal, beside, sizes)


def _critical(stiffness: Array, normal: int, beside: Ints, sizes: Array) -> tuple[float, str]:
    """Return the critical multiple and the reason if it is zero.

    Args:
        stiffness: of normal components, followed by tangential ones.
        normal: number of normal components.
        beside: for each tangential component, the index of the normal one of its point.
        sizes: friction coefficient of each tangential component.
    """
    # In units of the stiffness, so that nodal compliance is of order one.
    stiffness = stiffness / np.abs(stiffness).max()
    values, vectors = np.linalg.eigh(stiffness)
    held = values > NOTHING_LEFT * values[-1]
    if np.abs(vectors[normal:, ~held]).max(initial=0.0) > NOTHING_LEFT**0.5:
        return 0.0, "nothing but friction holds the body along its foundation"
    basis = vectors[:, held]
    values = values[held]
    compliance = (basis[normal:] ** 2 / values).sum(axis=1)
    ratios = np.sqrt(compliance / np.diag(stiffness)[beside])
    # The symmetric part of D S is nu times the first matrix and the second; that on the right d
    # times the third and the fourth over d.
    along = stiffness @ basis
    pressing = basis[:normal].T @ (stiffness[:normal] @ basis)
    pressing = (pressing + pressing.T) / 2
    sliding = np.diag(values) - pressing
    pressed = along[beside].T @ ((sizes * ratios)[:, None] * along[beside]) / 2
    slid = basis[normal:].T @ ((sizes / ratios)[:, None] * basis[normal:]) / 2
    last = values.size - 1

    def largest(exponents: Array) -> float:
        """Return the logarithm of the largest eigenvalue; infinite if these weights prove
        nothing.
        """
        nu, d = np.exp(exponents)
        matrices = d * pressed + slid / d, nu * pressing + sliding
        try:
            return float(
                np.log(eigh(*matrices, eigvals_only=True, subset_by_index=(last, last))[0])
            )
        except LinAlgError:  # the second one is not positive definite
            return np.inf

    start = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    options = {"initial_simplex": start, "maxfev": _EVALUATIONS}
    best = minimize(largest, start[0], method="Nelder-Mead", options=options)
    multiple = (1 - CERTIFICATE_TOLERANCE) * float(np.exp(-best.fun))
    nu, d = np.exp(best.x)
    left = nu * pressing + sliding - multiple * (d * pressed + slid / d)
    diagonal = np.diag(left)
    count = values.size
    # Bound of the round-off of the eigenvalues, and of the entries, which are a few such sums.
    round_off = 4 * (count + 2) * count * np.finfo(float).eps
    if (
        diagonal.min() <= 0
        or np.linalg.eigvalsh(left / np.sqrt(np.outer(diagonal, diagonal)))[0] <= round_off
    ):
        return 0.0, "round-off hides it"
    return multiple, ""
