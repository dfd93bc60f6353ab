"""A case of FrontISTR beside the results that it has written: the scene that it becomes, solved, and compared."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace

import mpi4py.MPI  # noqa: F401  # first: PETSc and dolfinx from PyPI find the library of MPI where it is loaded
import numpy as np

from signorini_fx.addons.aster.draft import StudyDraft
from signorini_fx.addons.cases.frontistr import FrontistrStudy, read_frontistr
from signorini_fx.addons.cases.hecmw import read_result
from signorini_fx.addons.decks.node_results import NodeResults
from signorini_fx.addons.gauntlet.case_run import StudyRun
from signorini_fx.addons.gauntlet.case_values import DISPLACEMENT, PRESSURE, REACTION, WantedValue, with_values
from signorini_fx.addons.gauntlet.outcomes import GauntletCase, in_short
from signorini_fx.addons.gauntlet.solved_drafts import SolvedDraft
from signorini_fx.addons.gauntlet.sources import FRONTISTR
from signorini_fx.addons.judging.judge import judge
from signorini_fx.errors import MeshError, SignoriniError
from signorini_fx.mechanics.mesh.files.arrays import plain
from signorini_fx.tuned import DIGITS_OF_FILES, EXPLAINED_FROM


class FrontistrRun(StudyRun[FrontistrStudy]):
    """A case that runs; its file is the control file."""

    program = FRONTISTR

    def read(self) -> FrontistrStudy:
        """See ``StudyRun``."""
        return read_frontistr(self.file)

    def compared(
        self,
        study: FrontistrStudy,
        case: GauntletCase,
        drafted: StudyDraft,
        moments: list[NodeResults],
        solved: SolvedDraft,
    ) -> GauntletCase:
        """See ``StudyRun``."""
        case = with_values(case, wanted_values(study), moments, solved, drafted.deck, study.formulations)
        if case.quantities:
            explained = (case.difference or 0.0) <= EXPLAINED_FROM
            return case if explained else replace(case, reasons=(*case.reasons, *self._verdict(study)))
        return replace(case, why=in_short([*filter(None, [case.why]), "no result of a time that is solved"]))

    def _verdict(self, study: FrontistrStudy) -> Iterator[str]:
        """What ``judge`` says of their last result as one of small strains; nothing where it cannot tell."""
        result = read_result(study.results[-1])
        copy = self.out / "theirs.csv"
        rows = np.searchsorted(study.numbers, result.numbers) + 1
        table = zip(plain(rows), plain(result.fields["DISPLACEMENT"]), strict=True)
        lines = (f"{row},{','.join(map(repr, values))}" for row, values in table)
        copy.write_text("\n".join(["node,ux,uy,uz", *lines]) + "\n", encoding="utf-8")
        with suppress(SignoriniError):
            verdict = judge(self.out / f"{self.file.stem}.inp", copy, compare=False)
            if verdict.findings and verdict.findings[0].key != "judged":
                formulation = verdict.theirs.get("formulation")
                words = f"judge says of theirs: {verdict.word}: {verdict.findings[0].text}"
                yield words + (f" ({formulation})" if formulation else "")


def wanted_values(study: FrontistrStudy) -> list[WantedValue]:
    """What FrontISTR has computed: displacements of all nodes, forces of supports, and the pressure of contact.

    Raises:
        MeshError: a result is not as it should be.
    """
    collected: list[WantedValue] = []
    rows = {int(number): row for row, number in enumerate(study.numbers)}
    held = {(int(node), support.component) for support in study.supports for node in support.nodes}
    near = DIGITS_OF_FILES * max(1.0, *study.instants)
    for path in study.results:
        result = read_result(path)
        instant = next((n for n, time in enumerate(study.instants) if abs(time - result.time) <= near), None)
        if instant is None:
            continue
        if unknown := np.setdiff1d(result.numbers, study.numbers).size:
            raise MeshError(f"{path}: line 1: {unknown} nodes are not in the mesh")
        traction, forces = (result.fields.get(f"CONTACT_N{name}") for name in ("TRACTION", "FORCE"))
        of_slaves = np.isin(np.searchsorted(study.numbers, result.numbers), study.slave_corners)
        if traction is not None and forces is not None and forces[of_slaves].any() > traction[of_slaves].any():
            traction = None  # of nodes against a surface it is not written
        for at, number in enumerate(result.numbers):
            row = rows[int(number)]
            for name, quantity in (("DISPLACEMENT", DISPLACEMENT), ("REACTION_FORCE", REACTION)):
                for k, value in enumerate(result.fields.get(name, np.empty((0, 0)))[at : at + 1].ravel()[:3]):
                    if quantity == DISPLACEMENT or (row, k) in held:
                        collected.append(WantedValue(quantity, k, row + 1, str(number), instant, float(value)))
            if traction is not None and of_slaves[at]:
                size = float(np.linalg.norm(traction[at]))
                collected.append(WantedValue(PRESSURE, 0, row + 1, str(number), instant, size))
    return collected
