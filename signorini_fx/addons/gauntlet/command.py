"""What the command line asks of a gauntlet.  No dolfinx here."""

from __future__ import annotations

import argparse
import shlex
from dataclasses import asdict
from typing import Any

from signorini_fx.addons.gauntlet.gauntlet import gauntlet
from signorini_fx.addons.gauntlet.outcomes import Gauntlet
from signorini_fx.addons.gauntlet.page import page, short_line, short_table
from signorini_fx.tuned import EXPLAINED_FROM as AGREES

__all__ = ["AGREES", "as_dict", "command_of", "gauntlet", "page", "short_line", "short_table"]


def command_of(options: argparse.Namespace) -> str:
    """The command without what is only on one machine: of folders their names."""
    words = ["signorini-fx", "gauntlet", *(folder.resolve().name for folder in options.folders)]
    words += ["--seconds", f"{options.seconds:g}"]
    for pattern in options.only:
        words += ["--only", pattern]
    words += ["--jobs", str(options.jobs)] if options.jobs > 1 else []
    words += ["--out", options.out.name]
    return shlex.join(words)


def as_dict(result: Gauntlet) -> dict[str, Any]:
    """As plain data for JSON."""
    cases = [
        asdict(case) | {"quantities": [asdict(quantity) | {"nearer": quantity.nearer} for quantity in case.quantities]}
        for case in result.cases
    ]
    return asdict(result) | {"cases": cases}
