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

- **Mesh.** Included files must be in the folder of the deck or below it. Instances of `*PART` are moved to their
  positions; a set that occurs in several instances is called `INSTANCE.SET`.
- **Materials.** For elements in several sections the last one counts; an element without a material is an error.
  `*ELASTIC` of type `ORTHO` or `ENGINEERING CONSTANTS` becomes `orthotropic`.
- **Supports and loads.** Nodes or faces become a boundary if they fill whole facets. Other supported nodes become
  points, if there are at most twelve. If there are more, or if they have a `*TRANSFORM`, they become links to the
  ground. If the deck has contact, `holds` says in which steps a support acts. Forces of one `*CLOAD` on several sides
  become a load for each side. A load is spread evenly if all its nodal forces are equal and the even load has their
  moment; otherwise it becomes forces at nodes. Loads that a step gives twice are added. Each static `*STEP` is a load
  step, `*PRE-TENSION SECTION` a `preload`.
- **Constraints.** `*EQUATION`, cyclic symmetry and ties of nodes that fill no facets become [links](#nodes), which
  yield by 1e-5 of the strain of a cell. Where a sector touches the next one (`CONTACT`), the elements at its
  independent side are added once more, turned by a sector, with 1e-4 of the smallest stiffness, and linked to those
  that they are images of. `*KINEMATIC` becomes a rigid tool, `*DISTRIBUTING` spreads its force over nodes.
- **Contact.** Each `*CONTACT PAIR` has its own `*FRICTION`, even if it changes, and `ADJUST`. Nodes that do not fill
  facets are replaced by the facets around them that face the other side. This counts as a change of the answer unless
  equations move all nodes of these facets alike. The slope of `PRESSURE-OVERCLOSURE=LINEAR` becomes `gamma_n`, or, if
  contacts differ, an [overclosure](#soft-contact) of each, as `EXPONENTIAL` and `TABULAR` do. The stick stiffness of
  CalculiX becomes `gamma_t`, of which a scene has only one. `*TIE` becomes a bond, or links between nodes if there is
  soft contact as well.
- **Rigid bodies.** Planes, and in the plane lines and arcs, become foundations, or [tools](scene.md#shapes) where their
  reference node moves. A `*RIGID BODY` of a node set becomes a tool that is bonded to these nodes.
- **Nodes.** Values at nodes are given body by body; bodies are the parts of the mesh that share no nodes. They are
  called `body_1` and so on, unless the file has a set with the same elements. The temperatures of each body are a
  table. A support at a single node names its body if another body has a node at the same position.
- **Places.** Each table of the draft names the line of the deck that it comes from, and so do the errors of `run`.

## Nodes

Two tables of a scene contain what decks say about single nodes. The stress at a node with a force is infinite. A link
has a vector c at each of its nodes, and resists the sum of c · u over these nodes, with their displacements u. It keeps
this sum at zero, except for the force of the link divided by its stiffness.

| key of `point_force` | default | unit | meaning |
|---|---|---|---|
| `at` | none | length | a node of the mesh |
| `region` | none | | of the node, if several parts have a node there |
| `x` | `0.0` | force | value along x[0]; for a body of revolution that of the whole ring |
| `y` | `0.0` | force | value along x[1] |
| `z` | `0.0` | force | value along x[2] |
| `file` | none | | instead of these: `.csv`, columns `x`, `y`, `fx`, `fy`, in space `z`, `fz`, and `region` |
| `factors` | none | 1 | [load steps](load-steps.md#load-steps) |
| `live` | `true` | true or false | as for other [loads](scene.md#loads) |

| key of `links` | default | unit | meaning |
|---|---|---|---|
| `file` | required | | `.csv`, columns `link`, `x`, `y`, `cx`, `cy`, in space `z`, `cz`, and `region`; \
rows with one number are one link |
| `stiffness` | required | force / length | of each link |

## Soft contact

`overclosure` of a `[[contact]]` is a table. It says how far, h, one side penetrates the other under the contact
pressure p. Without it, only the penalty `gamma_n` allows a penetration.

| key of `overclosure` | default | unit | meaning |
|---|---|---|---|
| `law` | `"linear"` | | `"linear"`: p is `stiffness` h. `"exponential"`: p is `pressure` 100^(h / `clearance`), \
a hundredth of it at the distance `clearance`, and from there on the tangent. `"tabular"`: lines between `rows` |
| `stiffness` | required | stress / length | of a linear law |
| `clearance` | required | length | of an exponential one |
| `pressure` | required | stress | likewise, at the overclosure zero |
| `rows` | required | stress, length | of a tabular one: lists [pressure, overclosure] from the pressure 0 on; beyond \
the last one its line continues |

```toml
[[contact]]
boundary = "bottom"
overclosure = { law = "exponential", clearance = 1e-3, pressure = 0.5 }
```

The solver linearises the law, with a stiffness and an offset at each point. The certificate compares the pressure with
the law itself, at the overclosure of the solution.

## Grades

`./env python3 docs/decks.py` writes this page, with the table by which `convert` and `run` grade. A keyword that is not
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
