"""Example 1 of the paper as one layer of hexahedra: Table 1 by the code of space, about an oblique
axis.
"""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from spaces import box, rotation, turned_tangents

from signorini_fx.algebra.algorithms.strategy import solve_task
from signorini_fx.mechanics.body.discretisation import prepare
from signorini_fx.mechanics.contact_points import contact_boundary
from signorini_fx.records import History, Status, Timings
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.solving.solve_on_mesh import contact_task

TABLE = json.loads((Path(__file__).parents[1] / "data" / "tables.json").read_text())["table1"]
THICKNESS = 0.025
# How the body is turned: no axis of it is one of space.
ANGLE, AXIS = 0.9, (0.3, -0.8, 0.5)


def askew():
    """Example 1 turned about an oblique axis: all supports are along normals that are no axes."""
    back = rotation(ANGLE, AXIS)
    tagged = box("hexahedra", (120, 1, 40), size=(3.0, THICKNESS, 1.0))
    tagged.mesh.geometry.x[:] = tagged.mesh.geometry.x @ back.T
    along = "(" + " + ".join(f"({float(back[k, 0])!r}) * x[{k}]" for k in range(3)) + ")"
    pressed = {
        name: f"({-20 * float(back[k, 2])!r}) if 1 <= {along} <= 2 else 0"
        for k, name in enumerate("xyz")
    }
    return parse_scene(
        {
            "mesh": tagged,
            "material": {"young": 5000.0, "poisson": 0.4},
            "displacement": [
                {"boundary": name, "normal": 0.0} for name in ("left", "right", "front", "back")
            ],
            "traction": {"boundary": "top", **pressed},
            "contact": {
                "boundary": "bottom",
                "gap": f"0.003 * ({along} - 1.5)**2 + 0.001",
                "friction": {"law": "tresca", "bound": 1.5},
                # The layer is so thin that round-off of its coordinates tilts facets by 1e-14,
                # which gamma makes 1e-7.
                "direction": [-float(c) for c in back[:, 2]],
            },
            "solver": {
                "initial_contact": f"1.25 - 1e-9 <= {along} <= 1.75 + 1e-9",
                # exact solves, as in the paper: inexact ones take one more
                "linear_algebra": "condensed",
            },
        }
    )


@pytest.mark.slow
def test_table_1(monkeypatch):
    """36 of 36, with tangents that nobody chose."""
    rng = np.random.default_rng(1)
    monkeypatch.setattr(
        contact_boundary, "tangents_of", lambda normal: turned_tangents(normal, rng)
    )
    scene = askew()
    discretisation = prepare(scene.statement, scene.mesh, Timings())
    task = contact_task(discretisation, History())
    found = []
    for gamma_n in TABLE["gamma_1"]:
        found.append([])
        for gamma_t in TABLE["gamma_2"]:
            data = replace(task.start.data, gamma_n=gamma_n, gamma_t=gamma_t)
            before = task.history.linear_solves
            assert solve_task(task, replace(task.start, data=data)).status is Status.CONVERGED
            found[-1].append(task.history.linear_solves - before)
    assert found == TABLE["iterations"]
