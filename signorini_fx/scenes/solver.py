"""The main entry point ``solve``: from a scene to its solution, with the same outcome on every
rank.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from mpi4py import MPI

from signorini_fx.algebra.linalg import petsc_options
from signorini_fx.errors import SceneError
from signorini_fx.extensions import STEP_EFFECTS, load_class
from signorini_fx.machine.compat import shared_cells
from signorini_fx.mechanics.state import State
from signorini_fx.mechanics.statement.values import kind_of
from signorini_fx.mechanics.step_effect import StepEffect
from signorini_fx.quantities.summary import own_quantities
from signorini_fx.records import History, Observer
from signorini_fx.results.solution import ConvergenceError, Solution
from signorini_fx.scenes.mesh import coarser_scenes, load_mesh
from signorini_fx.scenes.reading import as_scene
from signorini_fx.scenes.scene import Scene
from signorini_fx.solving.solve_on_mesh import StatedProblem, solve_mesh, stated_problem

if TYPE_CHECKING:
    from signorini_fx.forms.nonlinear.problem import NonlinearContactProblem
    from signorini_fx.solving.restart import StoredStates


@shared_cells()
def solve(
    scene: Scene | str | Path,
    comm: MPI.Comm = MPI.COMM_WORLD,
    *,
    check: bool = True,
    observers: Sequence[Observer] = (),
    checkpoint: str | Path | None = None,
    restart: bool = False,
    state: State | None = None,
    effects: Sequence[StepEffect | str] = (),
) -> Solution:
    """Solve a scene; collective.

    If the handler of a signal, such as SIGTERM, raises an exception on one of several ranks, it is
    raised on all ranks at the next Newton step, mesh or end of the solve (an exception other than
    ``SystemExit`` as ``KeyboardInterrupt`` on the others). An observer must raise on all ranks or
    on none.

    Args:
        scene: from ``read_scene`` or built in Python; or the path of a scene file.
        comm: the ranks that share the work; the call is collective.
        check: whether to raise if no solution was found; otherwise look at ``Solution.status``.
        observers: functions that are called with each ``IterationRecord``, ``OuterRecord`` and
            event, and with a ``StepRecord`` when one of several load steps begins.
        checkpoint: the result folder, in which each complete load step on each mesh is stored until
            ``write_results`` writes the result there; None: nothing is stored. Only scenes with
            contact and several load steps or levels, without a requested accuracy, are stored.
        restart: whether to continue from what is stored there, on any number of ranks.
        state: the ``state`` of an earlier solution on the same mesh, from which load steps
            continue; None: they begin with the first one.
        effects: further effects from load step to load step, or their names among the entry points.

    Raises:
        SceneError: the scene is wrong, does not fit its mesh, or differs from that of the
            checkpoint.
        TypeError: an argument is of the wrong kind.
        MeshError: the mesh cannot be read or generated.
        OptionsError: PETSc does not accept an option that the user has set.
        MachineError: a form cannot be compiled.
        InstallationError: a quantity of another package cannot be used.
        ConvergenceError: no solution was found; its ``solution`` is the last iterate.

    Examples:
        >>> result = sfx.solve(scene)
        >>> print(result.status.value, np.round(result.contact.forces[0], 6))
        converged [0. 4.]
    """
    refuse_other_than_comm(comm)
    petsc_options.refuse_exchanged()
    scene = as_scene(scene, comm)
    own_quantities()  # unusable quantities of other packages are refused before the solve
    if callable(observers) or not all(map(callable, observers)):
        raise TypeError("observers: a list of functions is expected, such as [print_progress]")
    history = History(observers=list(observers))
    in_time = _effects_of(effects)
    if state is not None or in_time:
        _refuse_state(scene)
    stored = _checkpoint(scene, comm, history, checkpoint, restart=restart)
    if scene.accuracy is not None:
        from signorini_fx.scenes.mesh_sequence import meshes_of
        from signorini_fx.solving.to_accuracy import Budget, solve_to_accuracy

        budget = Budget.begins(scene.accuracy, comm, history)
        solution = solve_to_accuracy(meshes_of(scene, scene.accuracy, comm, history), budget)
    elif coarse := coarser_scenes(scene, scene.solver.levels):
        from signorini_fx.scenes.mesh_sequence import MeshedScene
        from signorini_fx.solving.meshed_problem import solve_nested

        meshes = [MeshedScene(comm=comm, history=history, scene=each) for each in (*coarse, scene)]
        solution = solve_nested(meshes, len(meshes), comm, history, stored)
    elif scene.statement.nonlinear:
        from signorini_fx.scenes.nonlinear import build_problem as nonlinear_problem

        nonlinear = nonlinear_problem(scene, comm, history, in_time)
        solution = nonlinear.solved(stored, begin=state)
    else:
        load = partial(load_mesh, scene, comm)
        solution = solve_mesh(
            scene.statement, load, history, None, stored=stored, begin=state, effects=in_time
        )[0]
    if check and not solution.converged:
        raise ConvergenceError(solution)
    return solution


def build_problem(
    scene: Scene | str | Path,
    comm: MPI.Comm = MPI.COMM_WORLD,
    *,
    effects: Sequence[StepEffect | str] = (),
) -> StatedProblem | NonlinearContactProblem:
    """Return the problem of a scene, whose load steps your program solves one by one; collective.

    Args:
        scene: see ``solve``; it is solved on one mesh.
        comm: the ranks that share the work.
        effects: see ``solve``.

    Raises:
        SceneError: the scene is wrong, does not fit its mesh, or needs several meshes.

    Examples:
        >>> problem = sfx.build_problem(scene)
        >>> state = problem.initial()
        >>> for time in problem.path.times:
        ...     state, result = problem.step(state, time)
        >>> print(result.status.value, np.round(result.contact.pressure.max(), 6))
        converged 2.0
    """
    refuse_other_than_comm(comm)
    petsc_options.refuse_exchanged()
    scene = as_scene(scene, comm)
    _refuse_state(scene)
    in_time = _effects_of(effects)
    if scene.statement.nonlinear:
        from signorini_fx.scenes.nonlinear import build_problem as nonlinear_problem

        return nonlinear_problem(scene, comm, History(), in_time)
    load = partial(load_mesh, scene, comm)
    return stated_problem(scene.statement, load, History(), effects=in_time)


def _refuse_state(scene: Scene) -> None:
    """Refuse scenes on several meshes, which have no state that a program can use."""
    if scene.accuracy is not None or scene.solver.levels > 1:
        reason = (
            "takes several meshes, and state and effects are for one: leave out accuracy and "
            "solver.levels"
        )
        raise SceneError.at("accuracy", reason)


def _effects_of(effects: Sequence[StepEffect | str]) -> list[StepEffect]:
    """Return the effects as objects; names of entry points are replaced by new objects."""
    named = [
        load_class(STEP_EFFECTS, effect, StepEffect)() if isinstance(effect, str) else effect
        for effect in effects
    ]
    if wrong := [effect for effect in named if not isinstance(effect, StepEffect)]:
        raise TypeError(f"effects: objects of StepEffect are expected, not {kind_of(wrong[0])}")
    return named


def _checkpoint(
    scene: Scene, comm: MPI.Comm, history: History, folder: str | Path | None, *, restart: bool
) -> StoredStates | None:
    """Return the checkpoint of a run, or None if there is nothing to store."""
    if folder is None and restart:
        raise SceneError.at("restart", "needs the folder of the checkpoint")
    without = None
    if scene.accuracy is not None:
        without = "a run with a requested accuracy"
    elif (
        not (scene.statement.path.several or scene.statement.nonlinear) and scene.solver.levels == 1
    ):
        without = "a scene with one load step on one mesh"
    if folder is None or without is not None:
        if restart:
            raise SceneError.at(
                "restart", f"{without} has no checkpoint to go on from: solve it without restart"
            )
        return None
    from signorini_fx.solving.restart import StoredStates

    return StoredStates(comm, folder, scene, history, restart=restart)


def refuse_other_than_comm(comm: object) -> None:
    """Raise a TypeError if the argument is not a communicator."""
    if not isinstance(comm, MPI.Comm) or comm == MPI.COMM_NULL:
        name = "MPI.COMM_NULL" if isinstance(comm, MPI.Comm) else kind_of(comm)
        raise TypeError(f"a communicator of mpi4py is expected, such as MPI.COMM_WORLD, not {name}")
