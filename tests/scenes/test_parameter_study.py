"""Entries of a scene that the command line changes, and studies of several values of one."""

import csv
import math
from functools import partial

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI

from signorini_fx import ContactProblem, Coulomb, Foundation, NonlinearContactProblem, generate_mesh, solve
from signorini_fx.errors import SceneError
from signorini_fx.mechanics.statement.changes import changed, parsed_change
from signorini_fx.scenes import cli
from signorini_fx.scenes.parameter_study import FIGURES, run
from signorini_fx.scenes.reading import parse_scene
from tests.support.forms import hooke

PUSHED = """
[mesh]
generator = "rectangle"
parameters = { nx = 12, ny = 4 }
[material]
young = 5000.0
poisson = 0.3
[[traction]]
boundary = "top"
y = -20.0
x = 5.0
[[contact]]
boundary = "bottom"
friction = { law = "coulomb", coefficient = 0.5 }
"""


@pytest.mark.parametrize(
    ("text", "path", "value"),
    [
        ("solver.levels=3", "solver.levels", 3),
        ("contact[0].friction.coefficient=0.3", "contact[0].friction.coefficient", 0.3),
        ("solver.algorithm=alm", "solver.algorithm", "alm"),
        ('title="a = b"', "title", "a = b"),
        ("title=a = b", "title", "a = b"),
        ("traction[1].factors=[0.0, 1.0]", "traction[1].factors", [0.0, 1.0]),
        ("contact.gap=0.1*x[0]", "contact.gap", "0.1*x[0]"),
        (" mesh.parameters.nx = 4", "mesh.parameters.nx", 4),
        ('units={length = "mm"}', "units", {"length": "mm"}),
    ],
)
def test_what_is_given(text, path, value):
    assert parsed_change(text) == (path, value)


@pytest.mark.parametrize("text", ["", "=1", "a", "a..b=1", "a[x]=1", "a[-1]=1", "[0]=1", "1a=2", "a b=1"])
def test_what_is_no_change(text):
    with pytest.raises(ValueError, match="PATH=VALUE is expected"):
        parsed_change(text)


def test_entries_are_changed_and_the_others_are_not():
    data = {"contact": [{"gap": 0.0}, {"gap": 1.0}], "mesh": {"parameters": {"nx": 3}}, "traction": {"x": 1.0}}
    before = repr(data)
    found = changed(data, {"contact[1].gap": 2.0, "mesh.parameters.nx": 4, "traction[0].x": 3.0, "solver.levels": 2})
    assert found == {
        "contact": [{"gap": 0.0}, {"gap": 2.0}],
        "mesh": {"parameters": {"nx": 4}},
        "traction": {"x": 3.0},
        "solver": {"levels": 2},
    }
    assert repr(data) == before
    assert changed({"contact": [{"gap": 0.0}]}, {"contact.gap": 1.0}) == {"contact": [{"gap": 1.0}]}


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("contact[2].gap", r"contact\[2\]: is not there: contact has 2"),
        ("contact.gap", "contact: is a list of 2: say which"),
        ("title.more", "title: must be a table"),
        ("title[0]", r"title\[0\]: is not there: title is no list"),
        ("nothing[1].x", r"nothing\[1\]: is not there: nothing is no list"),
    ],
)
def test_paths_that_lead_nowhere(path, message):
    with pytest.raises(SceneError, match=message):
        changed({"contact": [{"gap": 0.0}, {"gap": 1.0}], "title": "t"}, {path: 1.0})


@pytest.fixture
def scene(tmp_path):
    file = tmp_path / "pushed.toml"
    file.write_text(PUSHED)
    return file


@pytest.mark.slow
def test_a_block_that_is_pushed(scene, tmp_path, capsys):
    """Statics: friction carries 3 x, until the block slides beyond x = F 20 = 10."""
    out = tmp_path / "out"
    assert cli.main(["sweep", str(scene), "--set", "traction.x=0:12:4", "--out", str(out)]) == 1
    printed = capsys.readouterr().out
    assert "slides, no static equilibrium" in printed
    with (out / "sweep.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row["value"]) for row in rows] == [0.0, 4.0, 8.0, 12.0]
    assert [row["status"] for row in rows] == [*["converged"] * 3, "slides, no static equilibrium"]
    for row in rows[:3]:
        assert float(row["contact_force"]) == pytest.approx(60.0, rel=1e-9)
        assert float(row["friction_force"]) == pytest.approx(3 * float(row["value"]), rel=1e-9)
    assert math.isnan(float(rows[3]["contact_force"] or "nan"))


def test_bodies_without_contact(tmp_path, capsys):
    """Figures stand below their names, and the strain energy of rubber is not known."""
    pulled = PUSHED.replace("[[contact]]", "[[displacement]]").split("friction")[0] + "x = 0.0\ny = 0.0\n"
    for law, known in (("", True), ('law = "neo-hooke"\n', False)):
        path = tmp_path / "pulled.toml"
        path.write_text(pulled.replace("poisson", f"{law}poisson"))
        arguments = ["sweep", str(path), "--set", "material.young=5000,6000", "--out", str(tmp_path / "out")]
        assert cli.main(arguments) == 0
        header, first = capsys.readouterr().out.splitlines()[1:3]
        end = header.index("strain energy") + len("strain energy")
        with open(tmp_path / "out" / "sweep.csv", newline="") as file:
            row = next(csv.DictReader(file))
        energy = float(row["strain_energy"])
        assert float(first[end - 12 : end]) == pytest.approx(energy, rel=1e-5, nan_ok=True)
        assert math.isfinite(energy) is known
        assert int(row["linear_solves"]) > 0


@pytest.mark.slow
def test_forms_and_residuals_have_parameter_studies():
    """A block that is pushed down and aside, for several coefficients: a scene, forms and a residual have one table."""
    sides = {"generator": "rectangle", "parameters": {"nx": 12, "ny": 4}}
    coefficients = (0.1, 0.3, 0.9)

    def scene(coefficient):
        friction = {"law": "coulomb", "coefficient": coefficient}
        return parse_scene(
            {
                "mesh": sides,
                "material": [{"young": 5000.0, "poisson": 0.3}],
                "displacement": [{"boundary": "top", "x": 0.01, "y": -0.02}],
                "contact": [{"boundary": "bottom", "friction": friction}],
                "solver": {"algorithm": "alm", "coulomb": "newton"},
            }
        )

    tagged = generate_mesh(sides["generator"], sides["parameters"], MPI.COMM_SELF)
    space = fem.functionspace(tagged.mesh, ("Lagrange", 1, (2,)))
    u, v, shared = fem.Function(space), ufl.TestFunction(space), fem.Constant(tagged.mesh, 0.0)
    moved = [
        fem.dirichletbc(np.array([0.01, -0.02]), fem.locate_dofs_topological(space, 1, tagged.facets("top")), space)
    ]
    floor = Foundation(tagged.facets("bottom"), friction=Coulomb(shared))
    none = ufl.inner(fem.Constant(tagged.mesh, (0.0, 0.0)), v) * ufl.dx
    a = hooke(ufl.TrialFunction(space), v, 5000.0)
    forms = ContactProblem(a, none, moved, floor, algorithm="alm", coulomb="newton")
    residual = NonlinearContactProblem(
        hooke(u, v, 5000.0), u, bcs=moved, contact=floor, algorithm="alm", coulomb="newton"
    )

    def solved(problem, coefficient):
        shared.value = coefficient
        problem.solve()
        return problem.solution

    def table_of(front):
        return run("friction", [(value, partial(front, value)) for value in coefficients], printed.append)

    printed = []
    of_scene, *further = (
        table_of(lambda value: solve(scene(value), MPI.COMM_SELF)),
        table_of(partial(solved, forms)),
        table_of(partial(solved, residual)),
    )
    assert of_scene.rows[0]["stick_area"] < of_scene.rows[2]["stick_area"]
    # Newton's method of a residual ends where its increments are small.
    for table, digits in zip(further, (1e-8, 1e-6), strict=True):
        assert table.solved
        assert [row["value"] for row in table.rows] == [*coefficients]
        for row, row_of_scene in zip(table.rows, of_scene.rows, strict=True):
            for name in set(FIGURES) - {"strain_energy"}:
                assert row[name] == pytest.approx(row_of_scene[name], rel=digits), name
    assert len(printed) == 3 * (1 + len(coefficients))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["solve", "--set", "contact.friction.coeficient=1"], "did you mean 'coefficient'"),
        (["check", "--set", "traction[4].x=1"], "traction[4]: is not there"),
        (["sweep", "--set", "traction.x=1"], "one entry must have several values"),
        (["sweep", "--set", "contact.friction.coefficient=0.1,-3"], "contact[0].friction.coefficient"),
    ],
)
def test_what_is_refused(scene, capsys, arguments, message):
    assert cli.main([arguments[0], str(scene), *arguments[1:]]) == 2
    assert message in capsys.readouterr().err
