"""A case of Kratos beside the values that Kratos has computed: the scene that it becomes, solved, and compared."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded
import numpy as np

from signorini_fx.addons.aster.draft import StudyDraft
from signorini_fx.addons.cases.kratos import KratosStudy, read_kratos, times_of
from signorini_fx.addons.decks.node_results import NodeResults
from signorini_fx.addons.gauntlet.case_run import StudyRun
from signorini_fx.addons.gauntlet.case_values import DISPLACEMENT, PRESSURE, WantedValue, with_values
from signorini_fx.addons.gauntlet.outcomes import GauntletCase, in_short
from signorini_fx.addons.gauntlet.solved_drafts import SolvedDraft, without_folders
from signorini_fx.addons.gauntlet.sources import KRATOS
from signorini_fx.errors import MeshError
from signorini_fx.tuned import KRATOS_SAME_TIME

# Of the variables that Kratos writes the quantity and the component.
_VARIABLES = {
    **{f"DISPLACEMENT_{axis}": (DISPLACEMENT, k) for k, axis in enumerate("XYZ")},
    "AUGMENTED_NORMAL_CONTACT_PRESSURE": (PRESSURE, 0),
}


class KratosRun(StudyRun[KratosStudy]):
    """A case that runs; its file is that of the parameters."""

    program = KRATOS

    def read(self) -> KratosStudy:
        """See ``StudyRun``."""
        return read_kratos(self.file)

    def compared(
        self,
        study: KratosStudy,
        case: GauntletCase,
        drafted: StudyDraft,
        moments: list[NodeResults],
        solved: SolvedDraft,
    ) -> GauntletCase:
        """See ``StudyRun``."""
        wanted, further = wanted_values(study)
        case = with_values(case, wanted, moments, solved, drafted.deck, study.formulations)
        if case.quantities:
            return case
        message = f"{further} values, all of something else than both have" if further else "Kratos' file has no value"
        return replace(case, why=in_short([*filter(None, [case.why]), message]))

    def without_folders(self, text: str) -> str:
        """See ``CaseRun``; what the parameters name may be beside their folder."""
        return without_folders(text, self.file.parent, self.file.parent.parent, self.out)


def wanted_values(study: KratosStudy) -> tuple[list[WantedValue], int]:
    """What Kratos has computed that we have too, and how many values are of something else.

    Raises:
        MeshError: a file of values is not as it should be.
    """
    collected, further = [], 0
    rows = {int(number): row + 1 for row, number in enumerate(study.numbers)}
    steps = np.diff([0.0, *study.instants])
    near = KRATOS_SAME_TIME * float(steps.min())
    for path, variables in study.checks:
        times = times_of(path)
        instants = [
            next((n for n, instant in enumerate(study.instants) if abs(instant - time) <= near), None) for time in times
        ]
        for label, name, series in _series(path, variables):
            if len(series) != len(times):
                raise MeshError(f"{path}: line 1: {label}, {name}: one number for each TIME is expected")
            if name not in _VARIABLES or int(label) not in rows:
                further += len(series)
                continue
            quantity, component = _VARIABLES[name]
            for value, instant in zip(series, instants, strict=True):
                # The augmented pressure is negative where bodies touch, and positive where they are apart.
                theirs = max(0.0, -float(value)) if quantity == PRESSURE else float(value)
                if instant is not None:
                    collected.append(WantedValue(quantity, component, rows[int(label)], label, instant, theirs))
    return collected, further


def _series(path: Path, variables: tuple[str, ...]) -> Iterator[tuple[str, str, list[Any]]]:
    """Number of a node, name of a variable and its values in time."""
    entries = json.loads(path.read_text(encoding="utf-8"))
    for key, of_node in entries.items():
        label = key.removeprefix("NODE_")
        if not isinstance(of_node, dict) or not label.isdigit():
            continue
        for name, series in of_node.items():
            if name not in variables and name.rpartition("_")[0] not in variables:
                continue
            if not isinstance(series, list) or not all(
                isinstance(v, int | float) and not isinstance(v, bool) for v in series
            ):
                raise MeshError(f"{path}: line 1: {key}, {name}: a list of numbers is expected")
            yield label, name, series
