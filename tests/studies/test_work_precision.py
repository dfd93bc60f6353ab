"""The work-precision study: the measure, the front, the advice, and a quick study as a whole."""

from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from scenes import example1

from signorini_fx import ContactProblem, Coulomb, Foundation, LinearElastic, OrthotropicElastic, generate_mesh
from signorini_fx.addons.pictures import style
from signorini_fx.addons.studies import conclusions, methods, work_precision
from signorini_fx.addons.studies.files import write_study
from signorini_fx.addons.studies.reference import Reference, reference_errors, studied_settings
from signorini_fx.addons.studies.work_precision import Study
from signorini_fx.errors import SceneError
from signorini_fx.forms.meshes import varied as varied_forms
from signorini_fx.machine.result_files import read_csv
from signorini_fx.scenes import cli
from signorini_fx.scenes.hierarchy import varied_scene
from signorini_fx.scenes.reading import parse_scene, read_scene
from signorini_fx.scenes.solver import solve, varied

SCENES = Path(__file__).parents[2] / "demos" / "scenes"
SCENE = """
title = "Block"
mesh = { generator = "rectangle", parameters = { nx = 60, ny = 20 } }
material = { young = 5000.0, poisson = 0.4 }
displacement = [{ boundary = "left", x = 0.0 }, { boundary = "right", x = 0.0 }]
traction = { boundary = "top", y = "-20 if 1 <= x[0] <= 2 else 0" }
[contact]
boundary = "bottom"
gap = "0.003*(x[0] - 1.5)**2 + 0.001"
friction = { law = "coulomb", coefficient = 0.3 }
"""


CONSTANTS = {"young": [5000.0, 2000.0, 3000.0], "poisson": [0.3, 0.2, 0.25], "shear": [900.0, 1200.0, 1000.0]}
FRICTION = {"law": "coulomb", "coefficient": 0.3}


def row(method, size, seconds, error, **more):
    """A row of the table as far as its evaluation looks at it."""
    given = {"method": method, "size_of_cells": size, "seconds": seconds, "pressure": error, "status": "converged"}
    return {
        **dict.fromkeys(work_precision.QUANTITIES),
        **given,
        "dofs": 100,
        "gamma": "auto",
        "linear_solves": 5,
        "element": "Q1",
        "algorithm": "auto",
    } | more


ROWS = [
    row("simple", 2, 1.0, 1e-1),
    row("simple", 1, 4.0, 1e-2),
    row("lucky", 2, 0.9, 1e-3),
    row("lucky", 1, 5.0, 5e-2),
    row("broken", 1, 0.1, None, status="active sets cycle"),
    row("dear", 1, 3.5, 9e-3),
]


def test_luck_does_not_count():
    """A small error that the next finer mesh of the same method does not keep is none."""
    assert conclusions.lasting_errors(ROWS, "pressure") == [1e-1, 1e-2, 5e-2, 5e-2, None, 9e-3]


def test_cheapest_front():
    """From cheap to dear the error falls; failures are not on it; of what is as good as equal the first stands."""
    front = conclusions.cheapest_front(ROWS, "pressure")
    assert [(r["method"], e) for r, e in front] == [("lucky", 5e-2), ("simple", 1e-2)]


def test_choice():
    """The cheapest; where others take hardly longer, the first of the list; none for what no run reaches."""
    assert conclusions.choice(ROWS, "pressure", 1e-1)["method"] == "simple"
    assert conclusions.choice(ROWS, "pressure", 1e-2) is ROWS[1]
    assert conclusions.choice(ROWS, "pressure", 1e-4) is None


def test_advice_names_failures_and_trusts_the_reference_no_further_than_it_is():
    """Failures are told with their status; targets near the error of the reference are left out."""
    study = Study("Block", ROWS, {"pressure": None, **dict.fromkeys(work_precision.QUANTITIES)}, "it", 1.0)
    said = conclusions.advice(study)
    assert "broken" in said
    assert "active sets cycle" in said
    assert "simple (10 %" in said
    assert "simple (10 % down to 1 %" in conclusions.advice(study)
    doubtful = replace(study, floor={**study.floor, "pressure": 2e-2})
    assert "1 %" not in conclusions.advice(doubtful)


def test_errors_that_are_none_are_not_shown(tmp_path):
    """Forces that balance the load on every mesh have no picture; the pressure has one."""
    rows = [
        row("simple", size, 1 / size, size * 1e-2, force=1e-9, families="; ".join(methods.FAMILIES)) for size in (1, 2)
    ]
    study = Study("Block", rows, dict.fromkeys(work_precision.QUANTITIES), "it", 1.0)
    write_study(study, tmp_path, pdf=True)
    assert sorted(file.name for file in tmp_path.glob("*.p[nd][gf]")) == [
        f"work_precision_pressure.{kind}" for kind in ("pdf", "png")
    ]


@pytest.mark.one_quick
@pytest.mark.parametrize(
    ("cell", "degree", "material"),
    [
        ("triangle", 1, {}),
        ("quadrilateral", 1, {}),
        ("quadrilateral", 2, {}),
        ("quadrilateral", 1, {"hypothesis": "axisymmetric"}),
        ("quadrilateral", 1, {"orthotropic": CONSTANTS}),
    ],
    ids=["triangle-1", "quadrilateral-1", "quadrilateral-2", "axisymmetric", "orthotropic"],
)
def test_measured_energy_error(cell, degree, material):
    """Against a nested finer mesh of the same space, measured at quadrature points = the energies' difference.

    Without contact a(y, y) / 2 of a Galerkin solution under a load only falls short by that of its error.
    """
    linear = example1(nx=24, ny=8, cell=cell, degree=degree)
    fixed = [effect.model_copy(update={"y": 0.0}) for effect in linear.displacement]
    # A body that the foundation does not reach.
    far = [linear.contact[0].model_copy(update={"gap": 1.0})]
    linear = linear.model_copy(update={"displacement": tuple(fixed), "contact": tuple(far)})
    kind = OrthotropicElastic if "orthotropic" in material else partial(LinearElastic, young=5000.0, poisson=0.4)
    linear = linear.model_copy(update={"material": (kind(**material),)})
    settings = studied_settings(linear.statement, {})
    reference = varied(linear, MPI.COMM_SELF).on(1 / 4, "Q2", settings, None)()
    coarse = solve(linear, MPI.COMM_SELF)
    energies = [s.steps[-1].strain_energy for s in (reference, coarse)]
    expected = np.sqrt((energies[0] - energies[1]) / energies[0])
    with np.errstate(invalid="ignore"):  # there is no contact force to compare
        measured = Reference(reference).errors(coarse)
    assert measured["energy"] == pytest.approx(expected, rel=0.05)
    assert measured["pressure"] is None


def test_no_error_against_itself():
    """All errors of the reference vanish."""
    solution = solve(example1(bound=1.0, nx=30, ny=10), MPI.COMM_SELF)
    assert all(error == pytest.approx(0.0, abs=1e-12) for error in Reference(solution).errors(solution).values())


def test_methods():
    """No name twice; Coulomb friction adds its algorithms; every family has something to compare."""
    for friction in ({"bound": 1.0}, {"coefficient": 0.3}):
        scene = example1(**friction)
        found = methods.methods(scene.statement)
        names = [method.name for method in found]
        assert len(names) == len(set(names))
        assert any("monolithic" in name for name in names) == scene.statement.has_coulomb
        for family in methods.FAMILIES:
            assert 3 <= sum(family in method.families for method in found) <= 9
        # The settings are those of a scene.
        of_methods = [(m.element, studied_settings(scene.statement, m.settings)) for m in found]
        assert all(varied_scene(scene, 1.0, *of_method, None) for of_method in of_methods)


@pytest.fixture(scope="module")
def quick(tmp_path_factory):
    """A quick study through the command line; where things are in its pictures takes the longest, and is not seen."""
    folder = tmp_path_factory.mktemp("study")
    (folder / "block.toml").write_text(SCENE, encoding="utf-8")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(style, "lay_out", lambda *_: None)
        code = cli.main(["work-precision", str(folder / "block.toml"), "--quick", "--out", str(folder / "out")])
    return code, folder / "out"


def test_quick_study(quick):
    """Table, pictures and advice are there; errors fall with the mesh, times are told apart."""
    code, folder = quick
    assert code == 0
    table = read_csv(folder / "work_precision.csv")
    assert set(table["status"]) == {"converged"}
    assert {"condensed", "full"} <= set(table["linear_algebra"])
    assert len(table["method"]) >= 16
    for method in dict.fromkeys(table["method"]):
        own = table["method"] == method
        size, asked = table["size_of_cells"][own], table["asked"][own]
        order = np.argsort(-np.where(np.isnan(size), asked, size))
        for quantity in ("energy", "pressure"):
            assert all(b < a for a, b in pairwise(table[quantity][own][order])), (method, quantity)
    parts = sum(table[phase] for phase in (*work_precision.PHASES, "coarser", "rest"))
    assert parts == pytest.approx(table["seconds"], rel=0.02)
    for quantity in ("energy", "pressure", "peak", "zone"):
        assert (folder / f"work_precision_{quantity}.png").stat().st_size > 10_000
    text = (folder / "advice.txt").read_text()
    assert text.startswith("Block: errors relative to")
    assert "\n- For the contact pressure take" in text


@pytest.mark.slow
def test_forms_have_studies(monkeypatch):
    """A scene and forms that state one problem have the same reference and the same errors of all methods."""
    monkeypatch.setattr(work_precision, "QUICK_STUDY_REFERENCE", (0.5, 1_500))
    monkeypatch.setattr(work_precision, "QUICKLY_STUDIED_CELLS", (4.0,))
    monkeypatch.setattr(work_precision, "QUICKLY_STUDIED_TARGETS", (0.1,))
    scene = parse_scene(
        {
            "mesh": {"generator": "rectangle", "parameters": {"nx": 24, "ny": 8}},
            "material": [{"young": 5000.0, "poisson": 0.4}],
            "displacement": [{"boundary": "left", "x": 0.0}, {"boundary": "right", "x": 0.0}],
            "traction": [{"boundary": "top", "y": -20.0}],
            "contact": [{"boundary": "bottom", "gap": "0.003*(x[0] - 1.5)**2 + 0.001", "friction": FRICTION}],
        }
    )

    def stress(y):
        """Hooke's law, plane strain."""
        strain = ufl.sym(ufl.grad(y))
        return 5000.0 / 1.4 * (strain + 0.4 / 0.2 * ufl.tr(strain) * ufl.Identity(2))

    def make(tagged, degree):
        space = fem.functionspace(tagged.mesh, ("Lagrange", degree, (2,)))
        u, v, x = ufl.TrialFunction(space), ufl.TestFunction(space), ufl.SpatialCoordinate(tagged.mesh)
        top = dmesh.meshtags(tagged.mesh, 1, facets := np.sort(tagged.facets("top")), np.full(facets.size, 1, np.int32))
        on_top = ufl.Measure("ds", tagged.mesh, subdomain_data=top)(1)
        held = [
            fem.dirichletbc(0.0, fem.locate_dofs_topological(space.sub(0), 1, tagged.facets(side)), space.sub(0))
            for side in ("left", "right")
        ]
        gap = 0.003 * (x[0] - 1.5) ** 2 + 0.001
        floor = Foundation(tagged.facets("bottom"), gap=gap, friction=Coulomb(FRICTION["coefficient"]))
        a = ufl.inner(stress(u), ufl.grad(v)) * ufl.dx
        return ContactProblem(a, -20.0 * v[1] * on_top, held, floor, stress=stress)

    def mesh(factor, cell):
        sizes = {"nx": round(24 / factor), "ny": round(8 / factor), "cell": cell}
        return generate_mesh("rectangle", sizes, MPI.COMM_SELF)

    of_scene, of_forms = (
        work_precision.run_study(problem, quick=True)
        for problem in (varied(scene, MPI.COMM_SELF), varied_forms(make, mesh))
    )
    assert of_forms.reference == of_scene.reference
    for row_of_scene, row_of_forms in zip(of_scene.rows, of_forms.rows, strict=True):
        assert row_of_forms["status"] == row_of_scene["status"] == "converged"
        for name in ("method", "element", "size_of_cells", "asked", "dofs", *work_precision.QUANTITIES):
            assert row_of_forms[name] == pytest.approx(row_of_scene[name], rel=1e-6, abs=1e-9), (
                row_of_scene["method"],
                name,
            )


def test_what_cannot_be_studied(tmp_path, capsys):
    """A scene without contact is refused, by the name of the key."""
    scene = tmp_path / "scene.toml"
    scene.write_text(SCENE.partition("[contact]")[0].replace('"left", x = 0.0', '"left", x = 0.0, y = 0.0'))
    assert cli.main(["work-precision", str(scene), "--quick", "--out", str(tmp_path / "out")]) == 2
    assert "needs a scene with contact" in capsys.readouterr().err
    tagged = solve(example1(bound=1.0, nx=6, ny=2)).model.tagged
    own = example1(bound=1.0).model_copy(update={"mesh": tagged})
    with pytest.raises(SceneError, match="generator"):
        work_precision.run_study(varied(own, MPI.COMM_SELF))


@pytest.mark.parametrize("cell", ["quadrilateral", "triangle"])
def test_notched_sides(cell):
    """Left and right begin at the given height, on every mesh of a nested iteration; the rest of them has no name."""
    scene = read_scene(SCENES / "example2_tresca.toml")
    for factor, ny in ((1.0, 40), (2.0, 20), (8.0, 5)):
        tagged = varied(scene, MPI.COMM_SELF).mesh(factor, "Q1" if cell[0] == "q" else "P1")
        for name, count in (("left", 0.8 * ny), ("right", 0.8 * ny), ("bottom", 3 * ny), ("top", 3 * ny)):
            assert tagged.facet_tags.find(tagged.boundaries[name]).size == round(count), (factor, name)


def test_example2_scene():
    """The scene file is the paper's second example, as demos/paper builds it (g = 1): 7.2 has stick and both slips."""
    solution = solve(read_scene(SCENES / "example2_tresca.toml"), MPI.COMM_SELF)
    states = set(solution.table.columns["state"])
    assert states >= {"open", "slip+", "slip-"}
    x, pressure = solution.table.columns["x"], solution.table.columns["pressure"]
    assert np.interp(3 - x[::-1], x, pressure) == pytest.approx(pressure[::-1], rel=1e-6, abs=1e-6)


def test_how_far_the_reference_may_be_wrong():
    """Of errors h^r the estimate is exact; it never takes a faster rate than expected, nor believes in luck."""
    for rate in (0.5, 1.0):
        near, far = 2**rate - 1, 4**rate - 1
        found = reference_errors({"zone": near}, {"zone": far})
        assert found["zone"] == pytest.approx(1.0)
        found = reference_errors({"energy": np.sqrt(4**rate - 1)}, {"energy": np.sqrt(16**rate - 1)})
        assert found["energy"] == pytest.approx(1.0)
    found = reference_errors({"pressure": 1.0, "peak": None}, {"pressure": 100.0, "peak": 1.0})
    assert found["pressure"] == pytest.approx(1 / (2**1.25 - 1))
    assert found["peak"] is None
