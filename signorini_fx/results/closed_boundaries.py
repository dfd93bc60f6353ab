"""What friction transmits where a contact boundary closes around a body, such as the seat of a hub on its shaft.

Its pressures balance each other, and its shears may turn the body without pushing it: the resultants are round-off
then, while the moment about the middle of the boundary is what the fit is made for.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from signorini_fx.machine import parallel
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.tuned import CLOSED_BOUNDARY

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Turning:
    """Friction on a closed boundary, in 2D per unit thickness.

    Attributes:
        pressure_integral: integral of the pressure, a force.
        moment: of friction on the body of this boundary about the middle of the boundary, force times length, shape
            (1,) in 2D (counterclockwise), (3,) in 3D.
        limit: the largest moment that the friction bounds allow in that direction; infinite for a bond.
    """

    pressure_integral: float
    moment: Array
    limit: float


def turning_of(statement: Statement, contact: ContactState) -> list[Turning | None]:
    """Friction on each contact boundary, in the order of the scene; None where it is not closed; collective."""
    if not (statement.kinematics.uniform and contact.boundary.kinematics.uniform):
        return [None] * len(statement.contact)
    return [_of_part(contact, part) for part in range(len(statement.contact))]


def _of_part(contact: ContactState, part: int) -> Turning | None:
    boundary, comm = contact.boundary, contact.boundary.comm
    on_part = boundary.part == part
    weight, x, normal = boundary.weight[on_part], boundary.centre[on_part], boundary.normal[on_part]
    dim = x.shape[1]
    ones = np.ones((len(x), 1))
    sums = np.concatenate((x, normal, ones, contact.pressure[on_part, None]), axis=1)
    total = parallel.global_sum(comm, weight @ sums)
    area = float(total[2 * dim])
    if not np.linalg.norm(total[dim : 2 * dim]) < CLOSED_BOUNDARY * area:
        return None
    arm = x - total[:dim] / area
    force = -boundary.nodal_forces(np.zeros_like(contact.pressure), contact.shear)[on_part]
    moment = parallel.global_sum(comm, _cross(arm, force).sum(axis=0))
    size = float(np.linalg.norm(moment))
    turn = moment / size if size > 0 else np.eye(len(moment))[-1]
    way = np.column_stack((-arm[:, 1], arm[:, 0])) * turn if dim == 2 else np.cross(turn, arm)
    reach = np.linalg.norm(np.einsum("nij,ni->nj", boundary.tangents[on_part], way), axis=1)
    largest_moments = weight * np.where(reach > 0, contact.bound[on_part] * reach, 0.0)
    return Turning(float(total[-1]), moment, float(parallel.global_sum(comm, np.array(largest_moments.sum()))))


def one_or_three(moment: Array) -> float | list[float]:
    """A moment as tables have it."""
    return float(moment[0]) if moment.size == 1 else [float(component) for component in moment]


def _cross(arm: Array, force: Array) -> Array:
    """Moments, shape (n, 1) in 2D, (n, 3) in 3D."""
    if arm.shape[1] == 3:
        return np.asarray(np.cross(arm, force))
    return (arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0])[:, None]
