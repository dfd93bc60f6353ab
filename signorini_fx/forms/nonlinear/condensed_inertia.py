"""The verdict on stability from the factorisation that Newton's method ends with.

The last tangent K was condensed onto the contact points, and has as many negative directions as what was eliminated and
what is left together (E. V. Haynsworth, Linear Algebra and its Applications 1 (1968) 73-81).  What contact adds, such
as the curvature of shapes under the tractions of now, acts on what is left alone, and is renewed there.

K is the tangent one increment before the equilibrium, where it is K + E.  Both are definite together unless K^-1 E has
an eigenvalue of -1 or below.  It is applied to a random displacement, whose n entries are counted in units of their own
sizes: then the n-th part of its square is along any one eigenvector in the mean, on graded meshes, too, and an
eigenvalue of that size would leave about as much.  The last increment of Newton's method is so small that far less is
left.  Where more is left, or K is not definite, nothing is said: then the tangent of the equilibrium itself must be
factorised.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from petsc4py import PETSc
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from signorini_fx.algebra.linalg import ElasticSystem
from signorini_fx.algebra.linalg.condensed import CondensedSystem
from signorini_fx.forms.nonlinear.tangent import Product
from signorini_fx.mechanics.assembly.nodal_stiffness import JointStiffness, NodalStiffness
from signorini_fx.mechanics.body.elastic_body import ElasticBody
from signorini_fx.tuned import HOLDING_STIFFNESS, SAME_INERTIA

Array = npt.NDArray[np.float64]
Numbers = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Restraint:
    """What acts at contact points beside the form.

    Attributes:
        beside: see ``curvature`` of ``negative_directions``.
        nodes: of the contact points, local numbers, shape (n,).
        held: directions that contact holds at each of them, shape (n, directions, d).
        joint: what contact holds between nodes.
    """

    beside: NodalStiffness
    nodes: npt.NDArray[np.int32]
    held: Array
    joint: Sequence[JointStiffness]


def is_positive(elastic: ElasticBody, system: ElasticSystem, restraint: Restraint, at_end: Product) -> bool:
    """Whether the last tangent says that the one at the equilibrium has no negative direction; False: it does not say.

    Args:
        elastic: the body of the last tangent.
        system: how it was factorised; only a condensed one on one rank says anything.
        restraint: of the equilibrium.
        at_end: the product of the form at the equilibrium, with a displacement that is zero where it is prescribed.
    """
    # Unknowns of rigid bodies, in turned frames, or of a pressure are none of the nodes.
    plain = elastic.rotation is None and not elastic.elastic.pressed and elastic.relative is None
    if not isinstance(system, CondensedSystem) or elastic.comm.size > 1 or not plain:
        return False
    if elastic.boundary is None or elastic.boundary.moving is not None or not system.schur.positive_inside:
        return False
    schur, beside = system.schur, elastic.beside or NodalStiffness.none(elastic.dimension)
    largest = float(np.abs(elastic.stiffness.getDiagonal().getArray(readonly=True)).max())
    change = _change(restraint, beside, HOLDING_STIFFNESS * largest, elastic)
    places = _among(schur.retained, change[:2])
    if places is None:
        return False
    dense = schur.dense.copy()
    np.add.at(dense, places, change[2])
    try:
        factor = cho_factor(dense, lower=True, overwrite_a=True, check_finite=False)
    except LinAlgError:
        return False
    difference = at_end.forces - _product(elastic.stiffness, at_end.direction.x.array)
    difference += beside.times(at_end.direction)
    load = elastic.stiffness.createVecRight()
    load.getArray()[:] = np.where(elastic.fixed, 0.0, difference)
    onto, between = schur.condense(load)
    solution = schur.recover(load, between, cho_solve(factor, onto, check_finite=False)).getArray(readonly=True)
    free = ~elastic.fixed
    return bool(np.linalg.norm(solution[free] / at_end.direction.x.array[free]) <= SAME_INERTIA)


def _product(matrix: PETSc.Mat, values: Array) -> Array:
    x, y = matrix.createVecs()
    x.getArray()[:] = values
    matrix.mult(x, y)
    return np.array(y.getArray(readonly=True))


def _change(
    restraint: Restraint, beside: NodalStiffness, holding: float, elastic: ElasticBody
) -> tuple[Numbers, Numbers, Array]:
    """What takes the last tangent to that of now with what contact holds, as rows, columns and values.

    Args:
        restraint: of now.
        beside: what the last tangent has beside the form.
        holding: stiffness of what contact holds.
        elastic: see ``is_positive``.
    """
    dim, free = elastic.dimension, ~elastic.fixed
    directions = restraint.held * free.reshape(-1, dim)[restraint.nodes][:, None, :]
    dyads = NodalStiffness(
        restraint.nodes.astype(np.int64),
        holding * np.einsum("nki,nkj->nij", directions, directions),
        tuple(part.scaled(holding) for part in restraint.joint),
    )
    parts = [_entries(restraint.beside, 1.0), _entries(beside, -1.0), _entries(dyads, 1.0)]
    row, column, value = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    entries = free[row] & free[column] & (value != 0.0)
    return row[entries], column[entries], value[entries]


def _entries(stiffness: NodalStiffness, factor: float) -> tuple[Numbers, Numbers, Array]:
    """A stiffness of one rank times a factor, as rows, columns and values."""
    blocks, dim = stiffness.blocks, stiffness.blocks.shape[1]
    unknowns = dim * stiffness.nodes[:, None] + np.arange(dim)
    rows, columns = (np.broadcast_to(at, blocks.shape).ravel() for at in (unknowns[:, :, None], unknowns[:, None]))
    listed = [(rows, columns, factor * blocks.ravel())]
    for joint in stiffness.joint:
        entries, numbers = joint.matrix.tocoo(), (dim * joint.nodes[:, None] + np.arange(dim)).ravel()
        listed.append((numbers[entries.row], numbers[entries.col], factor * entries.data))
    row, column, value = (np.concatenate(arrays) for arrays in zip(*listed, strict=True))
    return row, column, value


def _among(retained: Numbers, wanted: Sequence[Numbers]) -> tuple[Numbers, ...] | None:
    """The places of some unknowns among those that stay, ascending; None: one of them is not."""
    places = tuple(np.minimum(np.searchsorted(retained, numbers), retained.size - 1) for numbers in wanted)
    if all(np.array_equal(retained[at], numbers) for at, numbers in zip(places, wanted, strict=True)):
        return places
    return None
