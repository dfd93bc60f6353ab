"""One case of the gauntlet in a process of its own: python3 -m signorini_fx.addons.gauntlet.worker CASE FOLDER FILE."""

from __future__ import annotations

import sys
from pathlib import Path

from signorini_fx.addons.gauntlet.aster import CommandRun
from signorini_fx.addons.gauntlet.calculix import DeckRun
from signorini_fx.addons.gauntlet.case_run import CaseRun
from signorini_fx.addons.gauntlet.frontistr import FrontistrRun
from signorini_fx.addons.gauntlet.kratos import KratosRun
from signorini_fx.addons.gauntlet.outcomes import GauntletCase
from signorini_fx.addons.gauntlet.sources import ASTER, FRONTISTR, KRATOS, program_of


def main(case: Path, folder: Path, file: Path) -> None:
    """Run a case in a folder, and write what it has come to so far, and in the end, into a file."""

    def tell(outcome: GauntletCase) -> None:
        outcome.write(file)

    kinds: dict[str, type[CaseRun]] = {
        ASTER: CommandRun,
        KRATOS: KratosRun,
        FRONTISTR: FrontistrRun,
    }
    kind = kinds.get(program_of(case), DeckRun)
    tell(kind(case, folder, tell).outcome())


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:4]))
