"""Three blocks on each other, with contact points on both faces of the middle one: the forces on it cancel.

All forces follow from statics: each joint carries the load above it.
"""

import json
import re

import numpy as np
import pytest
from mpi4py import MPI
from test_summary_schema import VALIDATOR

from signorini_fx import solve, write_results
from signorini_fx.addons.pictures import load_steps
from signorini_fx.addons.report import evidence, sections
from signorini_fx.addons.report.comparison import compare
from signorini_fx.addons.report.markup import Markup, long_table
from signorini_fx.machine.display import on_several_bodies
from signorini_fx.machine.result_files import ResultFiles, read_csv
from signorini_fx.results.summary import render, summarise
from signorini_fx.scenes.parameter_study import figures_of
from signorini_fx.scenes.reading import parse_scene

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


@pytest.mark.slow
@pytest.mark.mpi(slow=True)
def test_forces_of_each_contact(tmp_path, monkeypatch):
    """Not their sum, which is nothing but round-off, is what summary, report and studies show."""
    scene = stack()
    solution = solve(scene, WORLD)
    for figures in solution.contact_figures:
        found = figures.contact_force, figures.friction_force
        np.testing.assert_allclose(found, EXPECTED[figures.boundary], atol=1e-7 * PRESS)
        on_boundary = solution.table.columns["boundary"] == figures.boundary
        closed = solution.table.columns["state"] != "open"
        assert figures.touching_nodes == np.count_nonzero(on_boundary & closed) > 0
    row = figures_of(solution)
    assert (row["contact_force"], row["friction_force"]) == pytest.approx((2 * PRESS, PUSH), rel=1e-7)
    folder = WORLD.bcast(tmp_path)
    write_results(solution, folder, pictures=False)
    summary = {**summarise(solution), "scene": scene.model_dump(mode="json")}
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
    shown = str(sections.figures(summary))
    assert "largest contact pressure" in shown
    assert "contact force on" not in shown
    assert "what the other body exerts on the body of the boundary;" in shown
    told = str(evidence.scene(summary))
    assert re.search(
        "body<small>pad</small>.*rectangle length = 20, height = 5, nx = 4, ny = 2; shift = .10, 20.<", told
    )
    assert "made in Python" not in told
    contact = read_csv(folder / "contact.csv")
    heads = re.findall("<th[^>]*>([^<]*)</th>", str(long_table("", {"friction_force_x left_pad.top": [1.0]}, "")))
    assert heads == ["friction force x left_pad.top"]
    for against, who in (
        (contact["against"], "the other body on the body of the boundary"),
        (["", *contact["against"]], "the foundation or the other body on the body of the boundary"),
        ([""], "the foundation on the body"),
    ):
        captions = []
        monkeypatch.setattr(sections, "drawn_by", lambda *_, caption, to=captions, **__: to.append(caption) or Markup())
        sections.steps(ResultFiles(folder), steps, {"against": against})
        assert captions[0] == f"Above: forces of {who}. Below: friction force over displacement."
