"""Calibration: data of a scene from measured results, by least squares with derivatives of adjoint
problems.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mpi4py import MPI

from signorini_fx.addons.derivatives.of_scene import Sensitivity, sensitivity
from signorini_fx.arrays import Array
from signorini_fx.errors import ResultError, SceneError
from signorini_fx.machine.result_files import read_csv
from signorini_fx.results.solution import ConvergenceError
from signorini_fx.scenes.reading import as_scene, changed, parse_scene
from signorini_fx.scenes.scene import Scene
from signorini_fx.tuned import NEGLIGIBLE, ZERO_IN_SOLUTION

_MOST_STEPS, _MOST_HALVINGS = 20, 40


@dataclass(frozen=True)
class Calibration:
    """The data of a scene that fit the measured results best.

    Attributes:
        values: the data by their paths.
        deviations: standard deviation of each; nan with as many measured results as data, if these
            have no deviations.
        results: measured and computed value of each measured result, computed with ``values``.
        scene: the scene with these values.
    """

    values: dict[str, float]
    deviations: dict[str, float]
    results: dict[str, tuple[float, float]]
    scene: Scene

    def __str__(self) -> str:
        """Return the data with their deviations, and the measured and computed results, one
        a line.
        """
        spread = {k: f" +- {d:.2g}" for k, d in self.deviations.items() if np.isfinite(d)}
        data = [f"{k} = {v:.6g}{spread.get(k, '')}" for k, v in self.values.items()]
        fits = [f"{of}: measured {m:.6g}, computed {c:.6g}" for of, (m, c) in self.results.items()]
        return "\n".join([*data, *fits])


def read_measured(file: Path) -> tuple[dict[str, float], dict[str, float]]:
    """Return measured results and their deviations by name, from a table with the columns ``of``,
    ``value`` and optionally ``deviation``.

    Raises:
        ResultError: the table cannot be read, or lacks a column.
    """
    try:
        table = read_csv(file)
        names = [str(name) for name in table["of"]]
        deviations = table.get("deviation", np.ones(0)).astype(float)
        measured = dict(zip(names, table["value"].astype(float), strict=True))
        return measured, dict(zip(names, deviations, strict=False))
    except (OSError, KeyError, ValueError) as error:
        reason = "columns of and value are expected, and no others but deviation"
        raise ResultError(f"{file}: cannot be read ({error}): {reason}") from None


def calibrate(
    scene: Scene | str | Path,
    measured: Mapping[str, float] | str | Path,
    by: Sequence[str],
    comm: MPI.Comm = MPI.COMM_WORLD,
    *,
    deviations: Mapping[str, float] | None = None,
) -> Calibration:
    """Return the data of a scene with which its results are closest to measured ones; collective.

    The method of Gauss and Newton starts from the values of the scene and uses the derivatives of
    ``sensitivity``; it refuses the same scenes.

    Args:
        scene: see ``sensitivity``.
        measured: results by their names, such as ``force bottom x step 2``; or a file, a table with
            the columns ``of``, ``value`` and optionally ``deviation``.
        by: paths of the data, such as ``contact[0].friction.coefficient``.
        comm: the ranks that share the work.
        deviations: standard deviation of each measured result; None: all have the same relative
            deviation, which follows from how well they fit.

    Raises:
        SceneError: see ``sensitivity``; there are fewer results than data, they do not depend on
            one of these, or no value fits better than that of the scene.
        ResultError: the file cannot be read.
        ConvergenceError: the scene has no solution.

    Examples:
        >>> found = sfx.calibrate(scene, {"mean top y": -0.003}, ["material.young"])
        >>> print(round(found.values["material.young"], 3))
        606.682
    """
    scene = as_scene(scene, comm)
    if not isinstance(measured, Mapping):
        measured, of_file = read_measured(Path(measured))
        deviations = deviations or of_file
    if len(measured) < len(by):
        raise SceneError.at("by", f"{len(by)} data need as many measured results at least")
    wanted = np.array(list(measured.values()))
    sizes = np.where(wanted == 0.0, 1.0, np.abs(wanted))
    if deviations:
        sizes = np.array([deviations[name] for name in measured])
    weights = 1.0 / sizes
    found, values = _solved(scene, measured, by, None, comm)

    def misfit(found: list[Sensitivity]) -> Array:
        """Return the differences between measured and computed results, in deviations, shape
        (results,).
        """
        return weights * (wanted - np.array([each.value for each in found]))

    for _ in range(_MOST_STEPS):
        slopes = weights[:, None] * np.array([each.derivatives for each in found])
        _refuse_idle(slopes * values, by)
        step = np.linalg.lstsq(slopes, misfit(found), rcond=None)[0]
        for halving in range(_MOST_HALVINGS):
            tried = values + step / 2**halving
            try:
                following, _ = _solved(scene, measured, by, tried, comm)
            except (ConvergenceError, SceneError):
                continue
            if np.linalg.norm(misfit(following)) <= np.linalg.norm(misfit(found)):
                break
        else:
            if (np.abs(step) > NEGLIGIBLE * np.abs(values)).any():
                reason = "no value near this one fits better: begin from another one"
                raise SceneError([(path, reason) for path in by])
            break
        done = bool((np.abs(tried - values) <= ZERO_IN_SOLUTION * np.abs(tried)).all())
        found, values = following, tried
        if done:
            break
    else:
        raise SceneError.at("measured", f"the data do not settle in {_MOST_STEPS} steps")
    slopes = weights[:, None] * np.array([each.derivatives for each in found])
    spare = len(wanted) - len(by)
    unit = 1.0 if deviations else float(misfit(found) @ misfit(found)) / spare if spare else np.nan
    variances = unit * np.diag(np.linalg.inv(slopes.T @ slopes))
    computed = [each.value for each in found]
    return Calibration(
        dict(zip(by, map(float, values), strict=True)),
        dict(zip(by, map(float, np.sqrt(variances)), strict=True)),
        dict(zip(measured, zip(map(float, wanted), computed, strict=True), strict=True)),
        _changed(scene, by, values),
    )


def _changed(scene: Scene, by: Sequence[str], values: Array) -> Scene:
    """Return the scene with other values of data."""
    new: dict[str, float] = dict(zip(by, map(float, values), strict=True))
    return parse_scene(changed(scene, new))


def _solved(
    scene: Scene, of: Mapping[str, float], by: Sequence[str], values: Array | None, comm: MPI.Comm
) -> tuple[list[Sensitivity], Array]:
    """Return the results of a scene with their derivatives, and the values of its data;
    collective.
    """
    now = scene if values is None else _changed(scene, by, values)
    found = sensitivity(now, list(of), by, comm)
    assert isinstance(found, list)
    return found, np.array(found[0].data)


def _refuse_idle(changes: Array, by: Sequence[str]) -> None:
    """Refuse data on which no measured result depends.

    Args:
        changes: derivative of each result times each datum, shape (results, data).
        by: paths of the data.
    """
    sizes = np.abs(changes).max(axis=0)
    least = ZERO_IN_SOLUTION * sizes.max()
    idle = [path for path, size in zip(by, sizes, strict=True) if not size > least]
    if idle:
        reason = "no measured result depends on it here: begin from another value, or measure more"
        raise SceneError([(path, reason) for path in idle])
