"""Write docs/decks.md: the keywords of an Abaqus input file that are not read, from addons/decks/keywords.py.

    ./env python3 docs/decks.py

A test reads a deck with each of them, and checks that the page is up to date.
"""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "decks.md"
sys.path.insert(0, str(ROOT))

from signorini_fx.addons.decks.keywords import RULES, Grade, Rule  # noqa: E402

HEAD = """# How a deck is read

`signorini-fx run part.inp` solves a deck of Abaqus or CalculiX. A keyword that is not read is named with its line. If
it changes the answer, the exit code is 4.

| read | as |
|---|---|
| `*NODE`, `*ELEMENT`, `*NSET`, `*ELSET`, `*SURFACE`, `*PART`, `*INSTANCE`, `*INCLUDE` | mesh; \
included files are in the folder of the deck or below it; a set of several instances is called `INSTANCE.SET` |
| `*MATERIAL`, `*SOLID SECTION`, `*ORIENTATION` | material; for elements in several sections the last one counts |
| `*ELASTIC`, `*EXPANSION`, `*DENSITY`, `*PLASTIC`, `*HYPERELASTIC` \
| its law: isotropic or orthotropic, metal with a table of yield stresses, rubber |
| `*BOUNDARY` | displacements of boundaries, and of nodes that fill no facets; `holds` if the support ends or begins |
| `*CLOAD` | traction or force on a boundary if the forces are those of an even one, otherwise forces at nodes |
| `*DLOAD`, `*DSLOAD` | traction, pressure, weight, rotation |
| `*INITIAL CONDITIONS`, `*TEMPERATURE` | temperature of each body |
| `*AMPLITUDE` | factors of load steps, from tables |
| `*STEP`, `*STATIC` | load steps; with `NLGEOM` finite strains |
| `*PRE-TENSION SECTION` | `preload` |
| `*CONTACT PAIR`, `*SURFACE INTERACTION`, `*FRICTION` | contact with friction and \
`adjust`; if one dependent surface is in several pairs, the other surfaces have the contact points |
| `*SURFACE BEHAVIOR` | hard, or with the slope of `LINEAR`; `NO SEPARATION` of closed sides is bilateral |
| `*TIE`, `PRESSURE-OVERCLOSURE=TIED` | a bond |
| `*RIGID BODY` | a rigid foundation: a plane, in 2D also lines and arcs; it moves with its reference node |

Bodies are the parts of the mesh that share no nodes. They are called `body_1` and so on, unless the file has a set with
the same elements. Each table of the draft names the line of the deck that it comes from, and so do the errors of `run`.

## What is not read

`./env python3 docs/decks.py` writes these tables. A keyword that they do not list changes the answer.
"""


def written() -> str:
    """The page."""
    rows: dict[tuple[Grade, str, str], list[Rule]] = {}
    for rule in RULES:
        rows.setdefault((rule.grade, rule.effect, rule.case), []).append(rule)
    parts = [HEAD.rstrip()]
    for grade in Grade:
        parts += [f"\n### It {grade}\n", "| keyword | with | remark |", "|---|---|---|"]
        for (row_grade, effect, case), rules in rows.items():
            if row_grade is grade:
                parts.append(f"| {', '.join(f'`*{rule.keyword}`' for rule in rules)} | {case} | {effect} |")
    return "\n".join(parts) + "\n"


if __name__ == "__main__":
    PAGE.write_text(written(), encoding="utf-8")
