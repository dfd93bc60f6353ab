"""Three blocks on each other, with contact points on both faces of the middle one: the forces on it cancel.

All forces follow from statics: each joint carries the load above it.
"""

import json
import re

import numpy as np
import pytest
from mpi4py import MPI
from revolved import Bodies, Box, Touching
from test_summary_schema import VALIDATOR

from signorini_fx import Status, solve, write_results
from signorini_fx.addons.pictures import load_steps
from signorini_fx.addons.pictures.boundary_profiles import boundaries_of, panels_of
from signorini_fx.addons.report import evidence, sections
from signorini_fx.addons.report.advice import next_steps
from signorini_fx.addons.report.comparison import compare
from signorini_fx.addons.report.markup import Markup, long_table
from signorini_fx.addons.report.sections_in_space import resultants
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


def test_curves_that_cover_each_other(monkeypatch):
    """Of those that are alike the first one is wider, with dashes as long as those on it; so in the lower axes."""
    pressing, rubbing, motion = np.array([[2.0, 2.0, 2.0], [0.0, 0.3, -0.3], [0.0, 1e-5, 2e-5]])
    steps = {"status": np.full(3, "converged"), "time": np.arange(3.0), "name": np.full(3, "")}
    for name, sign, moves in (("a", 1, 0), ("b", 1, 1), ("c", -1, 1), ("d", 1, 0)):
        for axis, share in zip("xyz", (0, 0, 1), strict=True):
            steps[f"contact_force_{axis} {name}"] = share * sign * pressing
            steps[f"friction_force_{axis} {name}"] = (axis == "x") * sign * rubbing
            steps[f"mean_tangential_displacement_{axis} {name}"] = moves * motion
    seen = []
    monkeypatch.setattr(load_steps, "finish", lambda figure, *_: seen.append(figure))
    load_steps.load_steps("unused", steps)
    upper, lower = seen[0].axes
    widths = {line.get_label(): line.get_linewidth() for line in upper.lines}
    for kind in ("contact force z", "friction force x"):
        a, b, c, d = (widths[f"{name}: {kind}"] for name in "abcd")
        assert (a, b, c) == pytest.approx((3 * d, 2 * d, d))
    dashes = {n: load_steps._wider({"linewidth": 1.0, "linestyle": (0, (4.5, 1.8))}, n)["linestyle"][1] for n in (0, 2)}
    assert dashes[0] == pytest.approx(np.multiply(dashes[2], 3))  # matplotlib multiplies them by the width
    assert [line.get_linewidth() / lower.lines[3].get_linewidth() for line in lower.lines[:4]] == [2, 1, 1, 1]
    assert (lower.get_xlabel()[:31], lower.get_ylabel()) == ("mean tangential displacement x ", "friction force x")


def test_a_bond_has_no_friction_bound():
    columns = {name: np.full(3, 1.0) for name in ("s", "x", "y", "shear", "u_t", "u_n", "weight", "pressure", "gap")}
    table = {**columns, "boundary": np.full(3, "a"), "friction": np.full(3, "stick"), "state": np.full(3, "stick")}
    for bound, count in ((np.inf, 1), (2.0, 3)):
        (boundary,) = boundaries_of({**table, "s": np.arange(3.0), "bound": np.full(3, bound)})
        assert len(panels_of(boundary, "friction")[0].curves) == count


def test_what_to_do_next_with_bodies_in_space():
    """Their meshes can be made finer if all of them are from files or generators."""
    made = {"generator": "box", "parameters": {}}
    table = {name: np.full(9, given) for name, given in (("boundary", "a"), ("state", "contact"), ("friction", "none"))}
    table["bound"] = np.zeros(9)
    for mesh, said in (({"file": "a.step"}, "--accuracy 0.2"), ("<TaggedMesh>", "on a finer mesh as well")):
        scene = {"mesh": None, "body": [{"mesh": made}, {"mesh": mesh}]}
        summary = {"status": "converged", "converged": True, "contact_nodes": 9, "dimension": 3, "scene": scene}
        assert said in " ".join(next_steps(summary, table))


@pytest.mark.slow
def test_the_error_of_forces_that_cancel():
    """It is relative to the forces, not to their sum: they are exact, and the estimate is small."""
    solution = solve(stack([0.5], solver={"levels": 3}), MPI.COMM_SELF)
    assert solution.convergence_table[-1].force < 1e-3
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
    assert squeezed.convergence_table[-1].force < 1e-3


@pytest.mark.parametrize(("against", "whom"), [("head.bottom", "pad.top"), (None, "the body")])
def test_whom_the_forces_of_one_contact_in_space_act_on(against, whom):
    row = {"boundary": "pad.top", "against": against}
    names = ("contact_force", "friction_force", "contact_moment", "friction_moment")
    summary = {**{key: [0.0, 0.0, 1.0] for key in names}, "contact_force_through": None, "contact_boundaries": [row]}
    table = {name: np.full(4, given) for name, given in (("boundary", "pad.top"), ("state", "open"), ("friction", ""))}
    page = str(resultants({**summary, "scene": {"contact": [row]}}, {**table, "weight": np.ones(4)}))
    assert f">on {whom}<" in page


def squeezed(force, **more):
    """Three blocks between a ground and a plate that comes down, with gaps; a pressure pushes the middle one aside."""
    return Bodies(
        "triangle",
        [
            Box("a", (4, 4), (0.0, 0.0), (0.977, 1.4), 33.6, 0.05),
            Box("b", (4, 3), (0.0, 1.4), (0.977, 2.62), 703.0, 0.23),
            Box("c", (4, 1), (0.0, 2.62), (0.977, 3.57), 47.7, 0.12),
        ],
        held=[("a.bottom", {"x": 0.0, "y": 0.0}), ("c.top", {"x": 0.0, "y": -0.00308})],
        pressed=[("b.right", force)],
        touching=[
            Touching("a.top", "b.bottom", 0.00147, {"law": "coulomb", "coefficient": 0.568}),
            Touching("c.bottom", "b.top", "-0.00107 - 0.0024 * x[0]", {"law": "coulomb", "coefficient": 0.282}),
        ],
    ).scene(material={"hypothesis": "plane strain"}, **more)


@pytest.mark.slow
def test_friction_of_pressures_that_first_carry_too_little():
    """The pressures without slip carry too little of the load, those of the solution enough: the bounds of the first
    problems are raised.  Pressures are those of a fixed point of convex programmes, least squares within bounds.
    """
    found = solve(squeezed(0.0471), check=False)
    assert found.status is Status.CONVERGED
    assert found.certificate.holds
    assert any("fixed point with raised bounds" in str(event) for event in found.history.events)
    friction = [figures.friction_force[0] for figures in found.contact_figures]
    assert np.abs(friction).sum() == pytest.approx(0.0471 * 1.22, rel=1e-6)
    beneath = found.contact.boundary.part == 0
    pressure = np.sort(found.contact.pressure[beneath])
    assert pressure == pytest.approx([0.0, 0.0130764, 0.0584255, 0.0884118, 0.2537261], rel=1e-3)


@pytest.mark.slow
def test_friction_that_no_raised_bounds_make_enough():
    """Beyond the limit the bounds stay raised, and the outcome keeps its name."""
    found = solve(squeezed(0.15), check=False)
    assert found.status is Status.SLIDES_AT_PRESSURES
    assert any("raised bounds" in str(event) for event in found.history.events)


@pytest.mark.slow
def test_raised_bounds_take_no_more_solves_than_a_problem_may():
    """Here they take 22 where a problem may take as many as it needs; the other attempts take 21 together."""
    found = solve(squeezed(0.15, solver={"max_iterations": 12}), check=False)
    assert found.status is Status.SLIDES_AT_PRESSURES
    assert any("raised bounds" in str(event) for event in found.history.events)
    assert found.history.linear_solves <= 21 + 12
