"""Results, errors and cost of a solution on one mesh, from which convergence tables are made."""

from __future__ import annotations

import numpy as np
from pydantic import ConfigDict, InstanceOf

from signorini_fx.algebra.algorithms.path_following import path_model
from signorini_fx.algebra.algorithms.task import Outcome, Task
from signorini_fx.algebra.linalg import petsc_calls, petsc_options
from signorini_fx.arrays import Array
from signorini_fx.machine import parallel
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.contact_points.contact_table import ContactTable
from signorini_fx.quantities.summary import Number, Price


class LevelResult(Price):
    """Results of a solved mesh: cost, errors, and data to compare with other meshes.

    Cost and errors (loads included) are those of a ``Price``.  ``force``, ``zone`` and ``peak`` are
    None, because they are known from several meshes only, see ``convergence_table``.

    Attributes:
        loads: the error of the loads on the mesh.
        points: the error of the force that is due to few nodes in contact, see ``Errors.points``.
        polygon: effect of straight facets on a curved contact boundary, which no refinement
            reduces, see ``pressure_error.polygon_error``.
        pressure_regularisation: as ``regularisation``, of the contact pressure, relative in
            L2(Gamma_c).
        table: the contact boundary.
        forces: contact and friction force of each contact boundary in all load steps, shape (2 d
            boundaries steps,).
        krylov_from: number of unknowns from which on a mesh is solved by a Krylov method; infinite
            if none is.
    """

    model_config = ConfigDict(arbitrary_types_allowed=True)

    energy: float
    force: Number = None
    zone: Number = None
    peak: Number = None
    predicted: bool = False
    loads: float
    points: float = 0.0
    polygon: float = 0.0
    pressure_regularisation: float
    table: InstanceOf[ContactTable]
    forces: Array
    krylov_from: float

    @property
    def dimension(self) -> int:
        """The dimension of the body, 2 or 3."""
        return 2 if self.table.facets is None else 3


def mean_spacing(table: ContactTable, *, revolved: bool) -> float:
    """Return the mean length per contact node; in 3D the side of a square of the mean area.

    Args:
        table: the contact table.
        revolved: whether weights are areas of rings.
    """
    weight = table.columns["weight"]
    if revolved:
        return float(sum(np.ptp(table.arc(path)) for path in table.paths) / len(weight))
    return float(weight.mean() ** (1 if table.facets is None else 1 / 2))


def regularisation_errors(
    task: Task, outcome: Outcome, size: float, contact: ContactState
) -> tuple[float, float]:
    """Return the regularisation error of a solution in the energy norm and that of its contact
    pressure, both relative; collective.

    They take one or two back substitutions.

    Args:
        task: the problem that was solved.
        outcome: its solution.
        size: energy norm of the solution.
        contact: the contact state of this rank.
    """
    data = outcome.problem.data
    # Multipliers of an augmentation shift the pressure.
    shifted = parallel.any_rank(contact.boundary.comm, data.lambda_hat)
    if shifted or not np.isfinite(data.gamma_n) or not size > 0:
        return 0.0, 0.0
    newton = task.unsymmetric_newton if data.follows is not None else task.newton
    problem = newton.problem
    jacobian = newton.snes.getJacobian()[0]
    if (
        jacobian.handle not in problem.tangent.factorised
    ):  # of a checkpoint, with which nothing has been solved
        newton.pose(problem.data, problem.sets)
        problem.assemble_jacobian(newton.snes, newton.x, jacobian)
        problem.factorised(jacobian)
        with petsc_options.defaults():
            petsc_calls.solve(newton.snes.getKSP().setUp)
    model = path_model(newton, data)
    pressure = contact.points.norm(contact.pressure)
    return model.distance / size, model.pressure_distance / pressure if pressure > 0 else 0.0
