"""Which command files of code_aster are of other problems than the statics of elastic bodies.  No dolfinx here."""

from __future__ import annotations

from signorini_fx.addons.aster.command_file import CommandFile
from signorini_fx.addons.aster.problem import SMALL, results_of
from signorini_fx.addons.aster.values import CommandError, Concept

# Commands of problems that are no statics.
_OTHER_KINDS = ("DYNA_NON_LINE", "DYNA_VIBRA", "THER_LINEAIRE", "THER_NON_LINE", "CALC_MODES")


def other_kind(commands: CommandFile) -> str:
    """Why a command file is of another kind of problem; "": some of it is statics of elastic bodies."""
    if (dynamic := next(iter(commands.named(*_OTHER_KINDS)), None)) is not None:
        return f"{dynamic.origin}: only static steps are taken"
    reasons = [other_behaviour(result) for result in results_of(commands)]
    if not reasons:
        return "it solves nothing that is static"
    return reasons[0] if all(reasons) else ""


def other_behaviour(result: Concept) -> str:
    """Why a result is of no linear elasticity with small deformations; "": it is, or that is not known here."""
    solve_command = result.made_by
    try:
        entries = solve_command.factors("COMPORTEMENT")
    except CommandError:
        return ""
    for entry in entries:
        relation, deformation = entry.get("RELATION", "ELAS"), entry.get("DEFORMATION", "PETIT")
        if relation != "ELAS" or deformation not in SMALL:
            return f"{solve_command.origin}: RELATION={relation!r}, DEFORMATION={deformation!r}: only linear elasticity"
    return ""
