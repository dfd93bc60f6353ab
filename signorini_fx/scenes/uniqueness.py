"""Below which friction coefficient a scene has one solution on its mesh, proved from the stiffness of contact points.

Let v be the difference of the relative displacements of two solutions with the same loads, and r that of the nodal
contact forces, so that S v = -r with the condensed stiffness S.  At every point

    r_N v_N >= 0        and        r_T . v_T >= -F |r_N| |v_T|,

the second one because the bound of a point is Lipschitz continuous in its pressure with the constant F, and the shear
is monotone in the slip at a fixed bound.  Both hold with and without regularisation, for bounds with a limit, for
bilateral contact and for an increment of a load step.  With weights nu_i > 0, tau_i = 1 and
F |r_N| |v_T| <= F (d r_N^2 + v_T^2 / d) / 2,

    v^T D S v <= F / 2 (sum d_i (S v)_N,i^2 + |v_T,i|^2 / d_i),        D = diag(nu, tau).

So the solution is the only one if the symmetric part of D S minus the matrix on the right is positive definite.  Any
weights give a proof; here nu and a factor of d are the same at all points, and make the largest such F as large as
possible.  Tresca friction at a point is F = 0: its shear stays in r.  A bond holds its point.  docs/theory.md derives
it.
"""

from __future__ import annotations

from dataclasses import dataclass

import mpi4py.MPI  # noqa: F401  # first, see signorini_fx.mechanics.body
import numpy as np
import numpy.typing as npt
from petsc4py import PETSc
from scipy.linalg import LinAlgError, cholesky, eigh
from scipy.optimize import minimize

from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.algebra.contact.nodal_vectors import Nodal
from signorini_fx.algebra.linalg.blocks import by_entries
from signorini_fx.algebra.linalg.schur import SchurComplement
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.features import refused_by
from signorini_fx.records import Finding
from signorini_fx.tuned import CERTIFICATE_TOLERANCE, NOTHING_LEFT

# How often the largest eigenvalue is evaluated.
_EVALUATIONS = 60
# More components of contact points than this are not looked at: the matrices are dense.
_MOST_COMPONENTS = 1200
_NOT_TRIED = {
    "driven foundation": "a force moves a foundation",
    "soft contact": "contact gives way under its pressure",
}


def uniqueness_findings(model: Model) -> list[Finding]:
    """Below which friction coefficient the last load step has one solution, given the ones before it; none without
    Coulomb friction.
    """
    law = model.law
    if law is None or not model.statement.has_coulomb:
        return []
    stiffness = _contact_stiffness(model)
    multiple, why = (0.0, stiffness) if isinstance(stiffness, str) else proved_multiple(*stiffness, law)
    if multiple == 0.0:
        return [Finding("note", "contact", f"one solution is proved for no friction coefficient: {why}")]
    if multiple == np.inf:
        return []
    acting = law.coefficient[law.coefficient > 0]
    uniform = acting.size and np.ptp(acting) <= NOTHING_LEFT * acting[0]
    below = f"{multiple * acting[0]:.4g}" if uniform else f"{multiple:.4g} times the coefficients"
    sentence = f"with friction coefficients below {below} there is one solution on this mesh, whatever the loads are"
    assumed = "; sections are shortened as they are" if model.statement.effects.get("preload") else ""
    return [Finding("note", "contact", f"{sentence}{assumed}")]


def _contact_stiffness(model: Model) -> tuple[Nodal, Nodal] | str:
    """The stiffness and the contact map for ``proved_multiple``; or why there is no proof."""
    law, load_step = model.law, model.statement.steps - 1
    assert law is not None
    for wrong, reason in (
        # What is an unknown as well the stiffness takes as fixed.
        *((True, f"not tried where {clause}") for _, clause in refused_by(model.statement, _NOT_TRIED)),
        (model.statement.tightens(load_step), "not tried where a force determines the shortening of a section"),
        (law.ends_open is not None, "where a point opens, its friction ends with a jump"),
        (bool(law.laws), law.unknown),
        (model.comm.size > 1, "the proof is for one rank"),
    ):
        if wrong:
            return reason
    elasticity = model.elasticity([])
    operator = elasticity.contact.operator
    starts, columns, values = operator.getValuesCSR()
    retained = np.unique(columns).astype(np.int32)
    if max(retained.size, len(starts) - 1) > _MOST_COMPONENTS:
        return f"there are {len(starts) - 1} components of contact points, the proof is for at most {_MOST_COMPONENTS}"
    free = ~elasticity.contact.fixed[retained]
    rows = np.zeros((len(starts) - 1, retained.size))
    rows[np.repeat(np.arange(len(rows)), np.diff(starts)), np.searchsorted(retained, columns)] = values
    try:
        of = by_entries(elasticity.matrix), retained, (), elasticity.positions
        condensed = SchurComplement(*of, definite=elasticity.definite).dense[np.ix_(free, free)]
    except PETSc.Error:
        return "a part of the body moves freely though its contact points are fixed"
    return condensed, rows[:, free]


def proved_multiple(stiffness: Nodal, operator: Nodal, law: PointFriction) -> tuple[float, str]:
    """The multiple of the friction coefficients below which a problem is proved to have one solution; one rank;
    ``stiffness``: of some unknowns without the prescribed ones, the others eliminated, shape (u, u); ``operator``: B on
    these, rows (n, T) of each point.

    Returns:
        The multiple, infinite where friction has no part in it; and why it is zero.
    """
    rough = _components(stiffness, operator, law)
    return (0.0, rough) if isinstance(rough, str) else _critical(rough, law.coefficient)


@dataclass(frozen=True)
class _Rough:
    """The components of contact points that move, condensed onto: normal ones first, then those with friction;
    ``beside``: for each tangential one the place of its point in ``normal``; ``free``: an orthonormal basis of the
    motions without a force.
    """

    stiffness: Nodal
    normal: npt.NDArray[np.int64]
    tangential: npt.NDArray[np.int64]
    beside: npt.NDArray[np.int64]
    free: Nodal


def _components(stiffness: Nodal, operator: Nodal, law: PointFriction) -> _Rough | str:
    """The stiffness of normal components and of tangential ones with friction; or why there is none."""
    coefficient, count = law.coefficient, law.coefficient.size
    moves = np.linalg.norm(operator, axis=1) > NOTHING_LEFT
    by_point = moves.reshape(count, -1)
    if ((coefficient > 0) & ~by_point[:, 0] & by_point[:, 1:].any(axis=1)).any():
        return "a support takes the pressure at a point that friction acts on"
    rows = operator[moves]
    q, r = np.linalg.qr(rows.T, mode="complete")
    r = r[: len(rows)]
    if len(rows) > len(stiffness) or np.abs(np.diag(r)).min(initial=np.inf) <= NOTHING_LEFT:
        return "some contact points share a node, or are held in a direction of their own"
    # x = q1 r^-T v + q2 z, of which z has no force.
    change = np.column_stack((np.linalg.solve(r, q[:, : len(rows)].T).T, q[:, len(rows) :]))
    transformed = change.T @ stiffness @ change
    point, component = np.nonzero(by_point)
    bonded = np.isinf(law.given[point])
    rubs = (component > 0) & ((coefficient[point] > 0) | (law.given[point] > 0))
    order = np.concatenate((np.flatnonzero((component == 0) & ~bonded), np.flatnonzero(rubs & ~bonded)))
    eliminated = np.setdiff1d(np.arange(len(transformed)), np.concatenate((order, np.flatnonzero(bonded))))
    schur = transformed[np.ix_(order, order)]
    if eliminated.size:
        coupling = transformed[np.ix_(eliminated, order)]
        values, vectors = np.linalg.eigh(transformed[np.ix_(eliminated, eliminated)])
        hard = values > NOTHING_LEFT * values[-1]
        inside = vectors[:, hard].T @ coupling
        schur = schur - inside.T @ (inside / values[hard, None])
    schur = (schur + schur.T) / 2
    normal = point[order[component[order] == 0]]
    tangential = point[order[component[order] > 0]]
    values, vectors = np.linalg.eigh(schur)
    free = vectors[:, values <= NOTHING_LEFT * values[-1]]
    beside = np.minimum(np.searchsorted(normal, tangential), max(normal.size - 1, 0))
    return _Rough(schur, normal, tangential, beside, free)


def _critical(rough: _Rough, coefficient: Nodal) -> tuple[float, str]:
    """The multiple of the coefficients below which the solution is proved to be the only one; and why it is zero."""
    normal, count = rough.normal.size, len(rough.stiffness)
    if not (coefficient[rough.tangential] > 0).any():
        return np.inf, ""
    if np.abs(rough.free[normal:]).max(initial=0.0) > NOTHING_LEFT**0.5:
        return 0.0, "nothing but friction holds the body along its foundation"
    # In units of the stiffness, so that nodal compliance is of order one.
    stiffness = rough.stiffness / float(np.abs(rough.stiffness).max())
    rows, sizes = stiffness[rough.beside], coefficient[rough.tangential]
    basis = np.linalg.svd(rough.free, full_matrices=True)[0][:, rough.free.shape[1] :] if rough.free.size else None
    compliance = np.diag(np.linalg.pinv(stiffness, rcond=NOTHING_LEFT, hermitian=True))[normal:]
    ratios = np.sqrt(compliance / np.diag(stiffness)[rough.beside])
    places = np.arange(normal, count)

    def matrices(exponents: Nodal) -> tuple[Nodal, Nodal]:
        """The symmetric part of D S and the matrix on the right for F, with the same two factors at all points."""
        scale, d = np.ones(count), ratios * np.exp(exponents[1])
        scale[:normal] = np.exp(exponents[0])
        left_side = scale[:, None] * stiffness
        right = rows.T @ ((sizes * d)[:, None] * rows)
        right[places, places] += sizes / d
        left_side, right = (left_side + left_side.T) / 2, right / 2
        return (left_side, right) if basis is None else (basis.T @ left_side @ basis, basis.T @ right @ basis)

    def largest(exponents: Nodal) -> float:
        """The logarithm of the largest eigenvalue; infinite: these weights prove nothing."""
        left_side, right = matrices(exponents)
        last = len(left_side) - 1
        try:
            return float(np.log(eigh(right, left_side, eigvals_only=True, subset_by_index=(last, last))[0]))
        except LinAlgError:  # the left side is not positive definite
            return np.inf

    start = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    options = {"initial_simplex": start, "maxfev": _EVALUATIONS}
    best = minimize(largest, start[0], method="Nelder-Mead", options=options)
    left_side, right = matrices(best.x)
    multiple = (1 - CERTIFICATE_TOLERANCE) * float(np.exp(-best.fun))
    if not _definite(left_side - multiple * right):
        return 0.0, "round-off hides it"
    return multiple, ""


def _definite(matrix: Nodal) -> bool:
    """Whether a symmetric matrix is positive definite, proved with the round-off of the Cholesky factorisation.

    S. M. Rump, Verification of positive definiteness, BIT 46 (2006) 433-452: it is if the factorisation of the matrix
    minus (n + 2) eps times its trace succeeds; the entries of the matrix have the error of a few such sums.
    """
    scale = 1 / np.sqrt(np.diag(matrix)) if (np.diag(matrix) > 0).all() else None
    if scale is None:
        return False
    scaled = scale[:, None] * matrix * scale
    size = len(matrix)
    try:
        cholesky(scaled - 4 * (size + 2) * np.finfo(float).eps * np.trace(scaled) * np.eye(size), lower=True)
    except LinAlgError:
        return False
    return True
