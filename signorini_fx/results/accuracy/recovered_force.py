"""The error of contact forces on one mesh, from that of the stress and that of the stress which they depend on.

The forces of foundations along f are a(u, w) - L(w) for all displacements w that are -f in contact and vanish at
supports, so that their error is a(u - u_h, w_h) for any such w_h of the elements.  Let it be the one of least energy,
whose problem has the tangent of the last linear solve, and w its limit.  u - u_h is orthogonal to w but for where
contact itself is not known, which is of higher order (R. Becker and R. Rannacher, Acta Numerica 10 (2001) 1-102):

    |F(u) - F(u_h)| = |a(u - u_h, w - w_h)| <= sum over the cells of |int eps(u - u_h) : C eps(w - w_h)|.

Both errors are those of stress recovery, and their product follows from the squares for u_h + w_h and for u_h - w_h.
Contributions of cells may cancel, and where they do so by chance their sum says nothing: shares of both are taken.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from signorini_fx.algebra.algorithms.path_following import solved_again
from signorini_fx.algebra.algorithms.task import Outcome, Task
from signorini_fx.algebra.contact.active_sets import tangent
from signorini_fx.machine import parallel
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.model import Model
from signorini_fx.results.accuracy.level_results import make_ready
from signorini_fx.results.accuracy.stress_recovery import StressRecovery
from signorini_fx.tuned import FORCE_OF_CELLS, FORCE_OF_SUM

Floats = npt.NDArray[np.float64]


def force_by_recovery(model: Model, task: Task, outcome: Outcome, contact: ContactState, step: float) -> float | None:
    """The error of the forces of contact and friction, relative; one back substitution with the last factor,
    collective.

    Args:
        model: on the mesh.
        task: its contact problem.
        outcome: how it ended.
        contact: the contact points.
        step: the load step.

    Returns:
        None without forces, with friction, and where the tangent is none of regularised contact.
    """
    forces = contact.forces_of_each.sum(axis=1)
    size = float(np.linalg.norm(contact.forces_of_each))
    # Where statics determines the contact force, or nearly so, the error is that of friction, which is across f.
    if not forces.any() or outcome.problem.data.bound is not None:
        return None
    boundary = contact.boundary
    along = np.column_stack(boundary.traces((forces / np.linalg.norm(forces))[boundary.part]))
    of_cells = _of_cells(model, task, outcome, contact, along, step)
    if of_cells is None:
        return None
    total, of_sizes = parallel.global_sum(model.comm, np.array([of_cells.sum(), np.abs(of_cells).sum()])) / size
    return float(FORCE_OF_SUM * abs(total) + FORCE_OF_CELLS * of_sizes)


def _of_cells(
    model: Model, task: Task, outcome: Outcome, contact: ContactState, along: Floats, step: float
) -> Floats | None:
    """Contributions of the cells of this rank to the error of the work of contact tractions on displacements at the
    contact points, which are normal and tangential, shape (n, d).

    Returns:
        None where the tangent is not symmetric.
    """
    newton, data = task.iterate.newton, outcome.problem.data
    if data.follows is not None:
        return None
    make_ready(newton)
    system = newton.problem.system
    traction = np.einsum("nij,nj->ni", tangent(newton.problem.sets, data), along)
    force = newton.x.duplicate()
    force.set(0.0)
    system.contact.add_forces(traction[:, 0], traction[:, 1:], force)
    dual, recovery = solved_again(newton, force), StressRecovery.of(model)
    if not dual.norm() > 0:
        return None
    times = newton.x.norm() / dual.norm()  # so that none of both is lost beside the other one

    def squares(factor: float) -> Floats:
        moved = newton.x.copy()
        moved.axpy(factor, dual)
        return recovery.squares(model.function(system.displacement(moved)), step)

    return (squares(times) - squares(-times)) / (4 * times)
