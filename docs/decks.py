"""Write docs/decks.md: what becomes of each keyword of an Abaqus input file, from addons/decks/keywords.py.

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

- **Mesh.** Included files are in its folder or below. Instances of `*PART` are put in their place; a set
  that several have is called `INSTANCE.SET`.
- **Materials.** Of elements in several sections the last holds; an element without a material is an error.
  `*ELASTIC` of type `ORTHO` or `ENGINEERING CONSTANTS` becomes `orthotropic`.
- **Supports and loads.** Nodes or faces become a boundary if they fill whole facets; up to twelve supported nodes
  become points, others, and those with a `*TRANSFORM`, links to the ground. Where the deck has contact, `holds` says in
  which steps. Forces of one `*CLOAD` on several sides are several loads, each spread evenly if all are the same and
  that has their moment, or else forces at nodes. What a step gives twice adds up. Each static `*STEP` is a load step,
  `*PRE-TENSION SECTION` a `preload`.
- **Constraints.** `*EQUATION`, cyclic symmetry and ties of nodes that fill no facets become [links](#nodes), which give
  way by 1e-5 of the strain of a cell. `*KINEMATIC` is a rigid tool, `*DISTRIBUTING` spreads its force over nodes.
- **Contact.** Each `*CONTACT PAIR` has its `*FRICTION`, also where it changes, and `ADJUST`. Nodes that
  fill no facets become the facets around them that face the other side, which is lost unless equations move all of
  their nodes alike. The slope of `PRESSURE-OVERCLOSURE=LINEAR` becomes `gamma_n`, or where contacts differ an
  [overclosure](#soft-contact) of each, as `EXPONENTIAL` and `TABULAR` do; CalculiX's stiffness of sticking becomes
  `gamma_t`, which a scene has once. `*TIE` is a bond; beside soft contact its nodes have links.
- **Rigid bodies.** Planes, and in the plane lines and arcs, become foundations, or [tools](scene.md#shapes) where
  their reference node moves. A `*RIGID BODY` of a node set becomes a tool that is bonded to these nodes.
- **Nodes.** Values at nodes belong to their bodies, which share none with others: `body_1` and so on, unless the file
  has a set with the same elements. Temperatures of each are a table, and a single support names its body where another
  one has a node at the same place.
- **Places.** Each table of the draft says which line of the deck it is from, and so does an error of `run`.

## Nodes

Scenes have tables for what decks say of single nodes. A force at a node is one where the stress is infinite. A link has
vectors c at its nodes. It resists the sum of c times their displacements, and so keeps it at zero but for its force
over its stiffness.

| key of `point_force` | default | unit | meaning |
|---|---|---|---|
| `at` | none | length | a node of the mesh |
| `region` | none | | of the node, where several parts have one there |
| `x` | `0.0` | force | value along x[0]; of a body of revolution of the whole ring |
| `y` | `0.0` | force | value along x[1] |
| `z` | `0.0` | force | value along x[2] |
| `file` | none | | instead: `.csv`, columns `x`, `y`, `fx`, `fy`, in space `z`, `fz`, and `region` |
| `factors` | none | 1 | [load steps](load-steps.md#load-steps) |
| `live` | `true` | true or false | as of other [loads](scene.md#loads) |

| key of `links` | default | unit | meaning |
|---|---|---|---|
| `file` | required | | `.csv`, columns `link`, `x`, `y`, `cx`, `cy`, in space `z`, `cz`, and `region`; \
rows with one number are one link |
| `stiffness` | required | force / length | of each link |

## Soft contact

`overclosure` of a `[[contact]]` is a table: how far, h, one side enters the other under the contact pressure p. Without
it only the penalty `gamma_n` gives way.

| key of `overclosure` | default | unit | meaning |
|---|---|---|---|
| `law` | `"linear"` | | `"linear"`: p is `stiffness` h. `"exponential"`: p is `pressure` 100^(h / `clearance`), \
a hundredth of it at the distance `clearance`, and from there on the tangent. `"tabular"`: lines between `rows` |
| `stiffness` | required | stress / length | of a linear law |
| `clearance` | required | length | of an exponential one |
| `pressure` | required | stress | likewise, at the overclosure zero |
| `rows` | required | stress, length | of a tabular one: lists [pressure, overclosure] from the pressure 0 on; beyond \
the last one the line goes on |

```toml
[[contact]]
boundary = "bottom"
overclosure = { law = "exponential", clearance = 1e-3, pressure = 0.5 }
```

It is solved by tangents of the law, with a stiffness and an offset at each point; the certificate asks for the pressure
at the overclosure itself.

## Grades

`./env python3 docs/decks.py` writes this page, with the table that `convert` and `run` grade by. A keyword that is not
listed is *not known to scenes*, which changes the answer.
"""


def written() -> str:
    """The page."""
    rows: dict[tuple[Grade, str, str], list[Rule]] = {}
    for rule in RULES:
        rows.setdefault((rule.grade, rule.effect, rule.case), []).append(rule)
    parts = [HEAD.rstrip()]
    for grade in Grade:
        parts += [f"\n## What {grade}\n", "| keyword | with | what becomes of it |", "|---|---|---|"]
        for (row_grade, effect, case), rules in rows.items():
            if row_grade is grade:
                parts.append(f"| {', '.join(f'`*{rule.keyword}`' for rule in rules)} | {case} | {effect} |")
    return "\n".join(parts) + "\n"


if __name__ == "__main__":
    PAGE.write_text(written(), encoding="utf-8")
