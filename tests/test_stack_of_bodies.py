"""Three blocks on each other, with contact points on both faces of the middle one: the forces on it cancel.

All forces follow from statics: each joint carries the load above it.
"""

import json

import numpy as np
import pytest
from mpi4py import MPI
from test_summary_schema import VALIDATOR

from signorini_fx import solve, write_results
from signorini_fx.display import on_several_bodies
from signorini_fx.pictures import load_steps
from signorini_fx.report.comparison import compare
from signorini_fx.report.reading import read_csv
from signorini_fx.report.sections import outcome
from signorini_fx.results.summary import render, summarise
from signorini_fx.scene.reading import parse_scene
from signorini_fx.studies.parameter_study import figures_of

WORLD = MPI.COMM_WORLD
PRESS, PUSH = 2000.0, 300.0
EXPECTED = {"pad.bottom": [[0.0, PRESS], [-PUSH / 2, 0.0]], "pad.top": [[0.0, -PRESS], [PUSH / 2, 0.0]]}


def stack(factors=(0.0, 1.0, -1.0, 0.5), **more):
    """A head on a bonded soft pad on a base; pressed, pushed to and fro, and at last by half of it."""
    sizes = {"base": (40.0, 20.0, 4, 2), "pad": (20.0, 5.0, 4, 2), "head": (20.0, 10.0, 5, 2)}
    shifts = {"base": [0.0, 0.0], "pad": [10.0, 20.0], "head": [10.0, 25.0]}
    bodies = [
        {
            "name": name,
            "shift": shifts[name],
            "mesh": {
                "generator": "rectangle",
                "parameters": {"length": size[0], "height": size[1], "nx": size[2], "ny": size[3]},
            },
        }
        for name, size in sizes.items()
    ]
    young = {"base": 210e3, "pad": 3e3, "head": 70e3}
    return parse_scene(
        {
            "body": bodies,
            "material": [{"region": name, "young": value, "poisson": 0.3} for name, value in young.items()],
            "displacement": {"boundary": "base.bottom", "x": 0.0, "y": 0.0},
            "force": [
                {"boundary": "head.top", "y": -PRESS},
                {"boundary": "head.top", "x": PUSH, "factors": list(factors)},
            ],
            "contact": [
                {"boundary": "pad.bottom", "against": "base.top", "kind": "bonded"},
                {
                    "boundary": "pad.top",
                    "against": "head.bottom",
                    "friction": {"law": "coulomb", "coefficient": 0.3},
                },
            ],
            **more,
        }
    )


@pytest.mark.mpi
def test_forces_of_each_contact(tmp_path, monkeypatch):
    """Not their sum, which is nothing but round-off, is what summary, report and studies show."""
    solution = solve(stack(), WORLD)
    for figures in solution.contact_figures:
        found = figures.contact_force, figures.friction_force
        np.testing.assert_allclose(found, EXPECTED[figures.boundary], atol=1e-7 * PRESS)
    row = figures_of(solution)
    assert (row["contact_force"], row["friction_force"]) == pytest.approx((2 * PRESS, PUSH), rel=1e-7)
    folder = WORLD.bcast(tmp_path)
    write_results(solution, folder, pictures=False)
    summary = {**summarise(solution, solution.table), "scene": solution.scene.model_dump(mode="json")}
    if WORLD.rank:
        return
    assert on_several_bodies(summary)
    text = render(summary)
    assert "contact force    (0, 2000) on pad.bottom\n                   (0, -2000) on pad.top\n" in text
    assert "friction force   (-150, 0) on pad.bottom\n                   (150, 0) on pad.top\n" in text
    assert "contact force     (0, -2000) on pad.top" not in text
    lines = compare(folder, folder).splitlines()
    assert any(line.startswith("friction force    (-150, 0) on pad.bottom") and "equal" in line for line in lines)
    for number, share in enumerate((0.0, 1.0, -1.0, 0.5)):
        row = summary["steps"][number]
        assert "contact_force_y" not in row
        for name, sign in (("pad.bottom", 1), ("pad.top", -1)):
            found = [row[f"{key} {name}"] for key in ("contact_force_y", "friction_force_x")]
            np.testing.assert_allclose(found, [sign * PRESS, -sign * share * PUSH], atol=1e-7 * PRESS)
    VALIDATOR.validate(json.loads((folder / "summary.json").read_text(encoding="utf-8")))
    # A bond moves by its elastic slip alone; the head slides on the pad to the right.
    assert abs(summary["steps"][1]["mean_tangential_displacement pad.bottom"]) < 1e-6
    assert summary["steps"][1]["mean_tangential_displacement pad.top"] > 1e-4
    steps = read_csv(folder / "steps.csv")
    seen = []
    monkeypatch.setattr(load_steps, "finish", lambda figure, *_: seen.append(figure))
    load_steps.load_steps("unused", steps)
    upper, lower = seen[0].axes
    lines = {line.get_label(): line.get_ydata() for line in upper.lines}
    np.testing.assert_array_equal(lines["pad.top: contact force y"], steps["contact_force_y pad.top"])
    np.testing.assert_array_equal(lines["pad.bottom: friction force x"], steps["friction_force_x pad.bottom"])
    np.testing.assert_array_equal(lower.lines[1].get_ydata(), steps["friction_force_x pad.top"])
    cards = str(outcome(summary))
    assert "largest contact pressure" in cards
    assert "contact force on" not in cards


def test_the_error_of_forces_that_cancel():
    """It is relative to the forces, not to their sum: they are exact, and the estimate is small."""
    solution = solve(stack([0.5], solver={"levels": 3}), MPI.COMM_SELF)
    assert solution.price_list[-1].force < 1e-3
    walls = parse_scene(
        {
            "mesh": {"generator": "rectangle", "parameters": {"length": 2.0, "height": 1.0, "nx": 16, "ny": 8}},
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": [{"boundary": "bottom", "y": 0.0}, {"boundary": "top", "y": 0.0}],
            "contact": [{"boundary": "left", "gap": -0.01}, {"boundary": "right", "gap": -0.01}],
            "solver": {"levels": 3},
        }
    )
    squeezed = solve(walls, MPI.COMM_SELF)
    # Plane strain, held in the other direction: sigma_x = E (1 - nu) / ((1 + nu) (1 - 2 nu)) times the strain.
    force = 1000.0 * 0.7 / (1.3 * 0.4) * 0.01
    np.testing.assert_allclose(squeezed.contact.forces_of_each[:, 0], [[force, 0.0], [-force, 0.0]], atol=1e-4 * force)
    assert squeezed.price_list[-1].force < 1e-3
