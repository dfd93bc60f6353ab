"""A nonlinear scene on one mesh after another, to a requested accuracy of its stress."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from signorini_fx.machine import parallel, signals
from signorini_fx.mechanics.body.nonlinear_law import at_rest
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.rigid.mesh_levels import MeshLevel
from signorini_fx.results.accuracy.error_estimates import Errors
from signorini_fx.results.accuracy.mesh_level import LevelResult
from signorini_fx.scenes.nonlinear import solve_nonlinear
from signorini_fx.scenes.scene import Scene
from signorini_fx.solving.meshed_problem import MeshedProblem, SolvedMesh, plane_modulus


@dataclass(frozen=True)
class NonlinearMesh(MeshedProblem[Scene]):
    """A nonlinear scene on one of several meshes: it is solved anew on each, along the whole load path."""

    def solved(self, number: int, state: ContactState | None, coarser: MeshLevel | None) -> SolvedMesh:
        """See ``MeshedProblem``; the error is that of the stress after the last load step."""
        history, comm = self.history, self.comm
        signals.agree(comm)
        history.add(f"level {number}")
        before = len(history.iterations)
        solution = solve_nonlinear(self.source.model_copy(update={"solver": self.settings}), comm, history)
        modulus = max(map(plane_modulus, at_rest(self.source.statement).material))
        solved = SolvedMesh(solution, solution.model.tagged, None, modulus)
        if not solution.converged:
            return solved
        shares = solution.error_shares
        if isinstance(shares, str):
            return solved
        error, own = float(np.sqrt(parallel.global_sum(comm, shares.sum()))), history.iterations[before:]
        errors = Errors(error, None, 0.0, 0.0, 1.0, 0.0, {"energy": shares})
        contacts = [step.contact for step in solution.steps if step.contact and step.place.is_integer()]
        table = solution.table
        level = LevelResult(
            level=number,
            h=float(table.columns["weight"].mean() ** (1 / (solved.tagged.dimension - 1))),
            dofs=solution.model.dofs,
            linear_solves=len(own),
            factorisations=sum(record.factorised for record in own),
            seconds=parallel.global_max(comm, sum(solution.timings.total.values())),
            memory=parallel.peak_memory(comm),
            status=solution.status.value,
            energy=error,
            pressure=None,
            inside=0.0,
            loads=0.0,
            regularisation=0.0,
            pressure_regularisation=0.0,
            iteration=own[-1].residual if own else 0.0,
            table=table,
            force=np.concatenate([contact.forces_of_each.ravel() for contact in contacts]),
            paired=self.paired,
            degree=self.degree,
        )
        return replace(solved, level=level, errors=errors)
