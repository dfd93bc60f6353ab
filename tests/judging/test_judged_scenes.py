"""Results against scenes: our own solutions agree, in all formats, and what is changed in them is named."""

from pathlib import Path

import meshio
import numpy as np
import pytest

import signorini_fx as sfx
from signorini_fx import MeshError
from signorini_fx.addons.judging.judge import judge
from signorini_fx.addons.judging.own_solution import at_nodes_of
from signorini_fx.addons.judging.problems import judged_problem
from signorini_fx.scenes.reading import parse_scene

DEMOS = Path(__file__).parents[2] / "demos" / "scenes"
RECTANGLE = {"length": 2.0, "height": 0.5, "nx": 12, "ny": 4}
BOX = {"length": 1.0, "width": 0.5, "height": 0.5, "nx": 4, "ny": 2, "nz": 2}


def shelf(generator="rectangle", hypothesis="plane strain", friction=None, **parameters):
    """A body that is held on the left, and bent down onto a foundation."""
    down = "y" if generator == "rectangle" else "z"
    hypothesis = {"hypothesis": hypothesis} if down == "y" else {}
    sizes = RECTANGLE if generator == "rectangle" else BOX
    return sfx.Scene(
        mesh=sfx.MeshGenerator(generator=generator, parameters=sizes | parameters),
        material=sfx.LinearElastic(young=1000.0, poisson=0.3, **hypothesis),
        displacement=sfx.PrescribedDisplacement(boundary="left", x=0.0, y=0.0, z=0.0 if down == "z" else None),
        traction=sfx.SurfaceTraction(boundary="top", **{down: "-1 - 0.5*x[0]"}),
        body_force=sfx.BodyForce(x=0.2),
        contact=sfx.UnilateralContact(
            boundary="bottom",
            gap="0.005",
            friction=sfx.NoFriction() if friction is None else sfx.Tresca(bound=friction),
        ),
    )


@pytest.fixture(scope="module")
def solved():
    """A scene, its solution at the nodes of the mesh, and their positions."""
    scene = shelf()
    problem, _ = judged_problem(scene)
    return scene, at_nodes_of(sfx.solve(scene), problem), problem.mesh.points


SCENES = {
    "quadrilaterals": {},
    "triangles": {"cell": "triangle"},
    "plane stress": {"hypothesis": "plane stress"},
    "friction of Tresca": {"friction": 0.3},
    "hexahedra": {"generator": "box"},
    "tetrahedra": {"generator": "box", "cell": "tetrahedron"},
}


@pytest.mark.parametrize("kind", SCENES)
def test_our_own_solution_agrees(kind):
    """It shares nothing with the judge but the mesh and the data."""
    scene = shelf(**SCENES[kind])
    problem, reasons = judged_problem(scene)
    assert reasons == []
    v = at_nodes_of(sfx.solve(scene), problem)
    judgement = judge(scene, v, compare=False)
    assert judgement.word == "agrees", str(judgement)
    assert judgement.figures["equilibrium"]["value"] < 1e-8
    # Plane stress is plane stress here, and no layer of bricks.
    assert judgement.theirs["formulation"] == "full integration"
    wrong = judge(scene, 1.1 * v, compare=False)
    assert wrong.word == "another problem: load or modulus"
    assert set(wrong.factors) == {"traction on top", "body force"}


HEATED = {
    "alike everywhere": {"change": 30.0},
    "linear": {"change": "40*x[1] - 10*x[0]"},
    "not linear": {"change": "30*sin(3*x[0])*(1 + x[1]**2)"},
    "of a function": {"change": lambda x: 30 * np.cos(2 * x[0])},
}


def heatable(hypothesis):
    """The shelf in the plane, or in space with facets that are small enough for means over them."""
    return shelf("box", hypothesis, nx=6, ny=3, nz=3) if hypothesis == "space" else shelf("rectangle", hypothesis)


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("kind", HEATED)
@pytest.mark.parametrize("hypothesis", ["plane strain", "plane stress", "space"])
def test_bodies_that_are_heated(kind, degree, hypothesis):
    """Temperatures are taken at points where they are expressions, else between nodes; another one is named."""
    body = heatable(hypothesis)
    material = body.statement.material[0].model_copy(update={"expansion": 1e-4})
    scene = sfx.Scene(**dict(body) | {"element": {"degree": degree}, "material": material, "temperature": HEATED[kind]})
    problem, reasons = judged_problem(scene)
    assert reasons == []
    v = at_nodes_of(sfx.solve(scene), problem)
    judgement = judge(scene, v, compare=False)
    assert judgement.word == "agrees", str(judgement)
    warmer = sfx.Scene(**dict(scene) | {"temperature": HEATED[kind] | {"factors": [1.3]}})
    wrong = judge(warmer, v, compare=False)
    assert wrong.word == "another problem: load or modulus", str(wrong)
    assert wrong.factors["temperature"] == pytest.approx(1 / 1.3, rel=1e-3)


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ("where(x[0] < 0.93, 30.0, -10.0)", "cannot be judged"),
        ("300*max(0, x[0] - 1.3)", "cannot be judged"),
        ("where(x[0] < 1.0, 30.0, -10.0)", "agrees"),  # between cells
    ],
)
def test_temperatures_that_jump_inside_cells(change, word):
    """Each rule of quadrature sees another strain there, so that what is left says nothing; a larger fault is named."""
    body = shelf()
    material = body.statement.material[0].model_copy(update={"expansion": 1e-4})

    def heated(change):
        return sfx.Scene(**dict(body) | {"material": material, "temperature": {"change": change}})

    problem, _ = judged_problem(heated(change))
    v = at_nodes_of(sfx.solve(heated(change)), problem)
    judgement = judge(heated(change), v, compare=False)
    assert judgement.word == word, str(judgement)
    assert ("inside cells" in str(judgement)) == (word == "cannot be judged")
    assert judge(heated(f"-({change})"), v, compare=False).exit_code in (5, 6)


def test_temperatures_of_several_load_steps():
    """Those of the last one alone act; another one is named as it is called there."""
    body = shelf()
    material = body.statement.material[0].model_copy(update={"expansion": 1e-4})

    def heated(last):
        of_steps = [{"change": "40*x[1]", "factors": [1.0, 0.0]}, {"change": "10*x[0]", "factors": [0.0, last]}]
        return sfx.Scene(**dict(body) | {"material": material, "temperature": of_steps})

    problem, _ = judged_problem(heated(1.0))
    v = at_nodes_of(sfx.solve(heated(1.0)), problem)
    assert judge(heated(1.0), v, compare=False).word == "agrees"
    wrong = judge(heated(1.05), v, compare=False)
    assert wrong.factors["temperature"] == pytest.approx(1 / 1.05, rel=1e-3)
    first = sfx.Scene(**dict(body) | {"material": material, "temperature": {"change": "40*x[1]"}})
    assert judge(first, v, compare=False).exit_code in (5, 6)


def test_springs_that_jump_inside_facets():
    """Each rule of quadrature sees another stiffness there, which is not judged; between facets it is."""
    for place, known in ((0.3, False), (0.25, True)):
        springs = [{"boundary": "right", "normal": f"where(x[1] < {place}, 300, 0)"}]
        _, reasons = judged_problem(sfx.Scene(**dict(shelf()) | {"springs": springs}))
        assert reasons == ([] if known else ["springs right may jump inside facets, which is not judged yet"])


@pytest.mark.parametrize("hypothesis", ["plane strain", "plane stress", "axisymmetric"])
def test_bodies_that_expand_freely(hypothesis):
    """What they store is the work of the load, beside which residuals are seen; what is too small for it is named."""
    body = shelf("rectangle", hypothesis)
    fields = dict(body) | {
        "material": body.statement.material[0].model_copy(update={"expansion": 1e-4}),
        "displacement": {"boundary": "left", "x": 0.0},
        "body_force": None,
        "contact": {"boundary": "bottom", "gap": 0.0},
        "temperature": {"change": 30.0},
    }

    def pressed(pressure):
        return sfx.Scene(**fields | {"traction": {"boundary": "top", "y": -pressure}})

    problem, _ = judged_problem(pressed(0.1))
    small, tiny = (at_nodes_of(sfx.solve(pressed(pressure)), problem) for pressure in (0.1, 1e-4))
    judgement = judge(pressed(0.1), small, compare=False)
    assert judgement.word == "agrees", str(judgement)
    assert "traction" not in judgement.lines["balance"]
    wrong = judge(pressed(0.105), small, compare=False)
    assert wrong.word == "another problem: load or modulus", str(wrong)
    assert wrong.factors["traction on top"] == pytest.approx(1 / 1.05, rel=1e-3)
    judgement = judge(pressed(1e-4), tiny, compare=False)
    assert judgement.word == "agrees", str(judgement)
    assert "the traction on top is not seen" in judgement.lines["balance"]


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("hypothesis", ["plane strain", "plane stress", pytest.param("space", marks=pytest.mark.slow)])
def test_materials_that_vary(degree, hypothesis):
    """Moduli in the middle of each cell; those that do not vary are of another problem."""
    body = heatable(hypothesis)
    graded = {"grading": "1/(1 + x[0])", "poisson_grading": "1 - 0.3*x[1]", "expansion": 1e-4}
    material = body.statement.material[0].model_copy(update=graded)
    material = type(material).model_validate(
        {key: getattr(material, key) for key in material.model_fields_set | graded.keys()}
    )
    scene = sfx.Scene(
        **dict(body) | {"element": {"degree": degree}, "material": material, "temperature": {"change": "20*x[1]"}}
    )
    problem, reasons = judged_problem(scene)
    assert reasons == []
    v = at_nodes_of(sfx.solve(scene), problem)
    judgement = judge(scene, v)
    assert judgement.word == "agrees", str(judgement)
    assert judgement.error["distance"] < 1e-9
    plain = sfx.Scene(**dict(scene) | {"material": body.statement.material[0].model_copy(update={"expansion": 1e-4})})
    assert not judge(plain, v, compare=False).agrees


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("hypothesis", ["plane strain", pytest.param("space", marks=pytest.mark.slow)])
def test_bodies_on_springs(degree, hypothesis):
    """They are part of the equilibrium; a stiffness that is another one is named."""
    body = heatable(hypothesis)
    springs = [{"boundary": "right", "normal": "200 + 100*x[1]", "tangential": 50.0}, {"boundary": "left", "x": 80.0}]
    scene = sfx.Scene(**dict(body) | {"element": {"degree": degree}, "springs": springs})
    problem, reasons = judged_problem(scene)
    assert reasons == []
    v = at_nodes_of(sfx.solve(scene), problem)
    judgement = judge(scene, v)
    assert judgement.word == "agrees", str(judgement)
    assert judgement.error["distance"] < 1e-9
    stiffer = [{"boundary": "right", "normal": "400 + 200*x[1]", "tangential": 100.0}, springs[1]]
    wrong = judge(sfx.Scene(**dict(scene) | {"springs": stiffer}), v, compare=False)
    assert wrong.word == "another problem: load or modulus", str(wrong)
    assert wrong.factors["springs on right"] == pytest.approx(0.5, rel=1e-3)
    assert "its stiffness of the springs on right is 0.5 times the problem's" in str(wrong)


@pytest.mark.one_quick
@pytest.mark.parametrize(
    "name", ["bonded_pad", "dovetail", "hertz_friction", "press_and_slide", "press_fit", "two_cylinders"]
)
def test_solutions_of_the_demos_agree(name):
    """In space, of two bodies, on curved foundations, with friction and load steps, elements of degree 2 on cells of
    degree 1, and volumes that are integrated with fewer points.
    """
    scene = sfx.read_scene(DEMOS / f"{name}.toml")
    problem, reasons = judged_problem(scene)
    assert reasons == []
    judgement = judge(scene, at_nodes_of(sfx.solve(scene), problem), compare=False)
    assert judgement.word == "agrees", str(judgement)
    assert judgement.figures["equilibrium"]["value"] < 1e-8


@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.parametrize("cell", ["triangle", "quadrilateral"])
def test_volumes_that_are_integrated_with_fewer_points(cell, degree):
    """The element that the scene states; a full one is another element, and a wrong modulus another problem."""
    held = shelf(cell=cell)
    scene = sfx.Scene(**dict(held) | {"element": {"degree": degree, "volumetric": "reduced"}})
    if (cell, degree) == ("triangle", 1):
        pytest.skip("has no reduced form")
    problem, reasons = judged_problem(scene)
    assert reasons == []
    judgement = judge(scene, at_nodes_of(sfx.solve(scene), problem), compare=False)
    assert judgement.word == "agrees", str(judgement)
    assert judgement.figures["equilibrium"]["value"] < 1e-8
    full = sfx.Scene(**dict(held) | {"element": {"degree": degree}})
    other = judge(full, at_nodes_of(sfx.solve(scene), problem), compare=False)
    assert other.word == "agrees with another element", str(other)


def test_curved_cells_of_degree_2(tmp_path):
    """Quadrature of forms takes more points than that of programs: no fault, and one of 1 % of the load is seen."""
    mesh = sfx.MeshGenerator(generator="half_disk", parameters={"radius": 1.0, "size": 0.3, "order": 2})
    scene = sfx.Scene(
        mesh=mesh,
        element={"degree": 2},
        material=sfx.LinearElastic(young=1000.0, poisson=0.3),
        displacement=sfx.PrescribedDisplacement(boundary="top", x=0.0, y=-0.05),
        body_force=sfx.BodyForce(x=20.0),
        contact=sfx.UnilateralContact(boundary="arc"),
    )
    problem, reasons = judged_problem(scene)
    assert reasons == []
    solution = sfx.solve(scene)
    judgement = judge(scene, at_nodes_of(solution, problem), compare=False)
    assert judgement.word == "agrees", str(judgement)
    other = sfx.Scene(**dict(scene) | {"body_force": sfx.BodyForce(x=22.0)})
    wrong = judge(other, at_nodes_of(solution, problem), compare=False)
    assert wrong.word == "another problem: load or modulus", str(wrong)


@pytest.mark.parametrize("degree", [1, 2])
def test_another_gap_of_a_curved_side(degree):
    """What contact at nodes does not see of a curved gap allows for none that is ignored, or another one."""
    mesh = sfx.MeshGenerator(generator="half_disk", parameters={"radius": 1.0, "size": 0.2, "order": degree})

    def pressed(gap):
        return sfx.Scene(
            mesh=mesh,
            element={"degree": degree},
            material=sfx.LinearElastic(young=1000.0, poisson=0.3),
            displacement=sfx.PrescribedDisplacement(boundary="top", x=0.0, y=-0.05),
            contact=() if gap is None else sfx.UnilateralContact(boundary="arc", direction=(0.0, -1.0), gap=gap),
        )

    scene = pressed("x[1]")
    problem, _ = judged_problem(scene)
    words = [
        judge(scene, at_nodes_of(sfx.solve(pressed(gap), check=False), problem), compare=False).word
        for gap in ("x[1]", None, "x[1] + 0.01", "x[1] - 0.01")
    ]
    through = "violates contact: penetration"
    assert words == ["agrees", through, through, "violates contact: apart"]


def test_folders_of_results(tmp_path):
    """The last load step of a folder or a .pvd, whose slip counts from the step before."""
    scene = sfx.read_scene(DEMOS / "press_fit.toml")
    solution = sfx.solve(scene)
    sfx.write_results(solution, tmp_path / "out")
    for result in (tmp_path / "out", tmp_path / "out" / "fields.pvd"):
        judgement = judge(scene, result)
        assert judgement.word == "agrees", str(judgement)
        assert all(judgement.beside[key] < 1e-8 for key in ("displacement", "force", "pressure"))
        assert judgement.figures["slip_below_bound"]["value"] is not None
    (tmp_path / "empty.pvd").write_text("<VTKFile/>")
    (tmp_path / "torn.pvd").write_text("<VTKFile>")
    for name, reason in (("empty", "names no file"), ("torn", "is no .pvd file"), ("none", "cannot be read")):
        with pytest.raises(MeshError, match=reason):
            judge(scene, tmp_path / f"{name}.pvd")
    with pytest.raises(MeshError, match="cannot be read"):
        judge(scene, tmp_path)


def test_formats(tmp_path, solved):
    """An array, numbers of nodes, tables with positions or numbers, and .vtu: the same verdict."""
    scene, v, x = solved
    (tmp_path / "xy.csv").write_text(
        "x,y,ux,uy\n" + "\n".join(",".join(map(repr, row)) for row in np.hstack((x, v))[::-1].tolist())
    )
    (tmp_path / "node.csv").write_text(
        "node;ux;uy\n".replace(";", ",")
        + "\n".join(f"{n},{a:.8e},{b:.8e}" for n, (a, b) in enumerate(v.tolist(), start=1))
    )
    u = np.pad(v, ((0, 0), (0, 1)))
    cells = [("vertex", np.arange(len(x))[:, None])]
    meshio.Mesh(np.pad(x, ((0, 0), (0, 1))), cells, point_data={"u": u}).write(tmp_path / "u.vtu")
    for result in (
        v,
        dict(enumerate(v.tolist(), start=1)),
        *(tmp_path / name for name in ("xy.csv", "node.csv", "u.vtu")),
    ):
        judgement = judge(scene, result, compare=False)
        assert judgement.word == "agrees", str(judgement)
        assert judgement.figures["equilibrium"]["value"] < 1e-6
    assert judge(scene, tmp_path / "node.csv", compare=False).theirs["digits"] == 9


def test_hard_contact_of_another_penalty(solved):
    """A little softer agrees with another penalty, much softer enters."""
    scene, _, _ = solved
    for gamma, word in ((3e4, "agrees with another penalty"), (1e3, "violates contact: penetration")):
        soft = sfx.Scene(**dict(scene) | {"solver": {"gamma_n": gamma}})
        problem, _ = judged_problem(soft)
        judgement = judge(scene, at_nodes_of(sfx.solve(soft), problem), compare=False)
        assert judgement.word == word, str(judgement)


def test_contact_that_is_ignored(solved):
    """The body goes through its foundation."""
    scene, _, _ = solved
    free = sfx.Scene(**dict(scene) | {"contact": ()})
    problem, _ = judged_problem(free)
    judgement = judge(scene, at_nodes_of(sfx.solve(free), problem), compare=False)
    assert judgement.word == "violates contact: penetration"


def test_two_nodes_at_one_place_need_numbers(tmp_path):
    """A table by positions cannot say which of both it means."""
    scene = sfx.Scene(
        body=[
            {"name": "low", "mesh": {"generator": "rectangle", "parameters": RECTANGLE}},
            {"name": "up", "mesh": {"generator": "rectangle", "parameters": RECTANGLE}, "shift": [0.0, 0.5]},
        ],
        material=sfx.LinearElastic(young=1000.0, poisson=0.3),
        displacement=[
            sfx.PrescribedDisplacement(boundary="low.bottom", x=0.0, y=0.0),
            sfx.PrescribedDisplacement(boundary="up.left", x=0.0),
        ],
        traction=sfx.SurfaceTraction(boundary="up.top", y=-1.0),
        contact=sfx.UnilateralContact(boundary="up.bottom", against="low.top"),
    )
    problem, _ = judged_problem(scene)
    v = at_nodes_of(sfx.solve(scene), problem)
    assert judge(scene, v, compare=False).word == "agrees"
    rows = np.hstack((problem.mesh.points, v)).tolist()
    (tmp_path / "xy.csv").write_text("x,y,ux,uy\n" + "\n".join(",".join(map(repr, row)) for row in rows))
    with pytest.raises(MeshError, match=r"several nodes are at .*, as in contact: give a column node"):
        judge(scene, tmp_path / "xy.csv", compare=False)
    # The cells of a .vtu tell which body a point is of, in any order.
    order = np.random.default_rng(1).permutation(len(v))
    mesh, place = problem.mesh, np.argsort(order)
    at, cells = np.pad(mesh.points, ((0, 0), (0, 1)))[order], [("quad", place[mesh.cells])]
    meshio.Mesh(at, cells, point_data={"u": v[order]}).write(tmp_path / "u.vtu")
    judgement = judge(scene, tmp_path / "u.vtu", compare=False)
    assert judgement.word == "agrees"
    assert judgement.figures["equilibrium"]["value"] < 1e-6
    # Each cell may have points of its own; those of one node move alike.
    of_cells, whole = mesh.cells[::-1].ravel(), np.arange(mesh.cells.size).reshape(-1, 4)
    at, moved = np.pad(mesh.points, ((0, 0), (0, 1)))[of_cells], v[of_cells]
    meshio.Mesh(at, [("quad", whole)], point_data={"u": moved}).write(tmp_path / "u.vtu")
    assert judge(scene, tmp_path / "u.vtu", compare=False).word == "agrees"
    moved[0, 1] += 1e-3
    meshio.Mesh(at, [("quad", whole)], point_data={"u": moved}).write(tmp_path / "u.vtu")
    with pytest.raises(MeshError, match=r"several points are at .*, with different displacements"):
        judge(scene, tmp_path / "u.vtu", compare=False)
    meshio.Mesh(at, [("quad", whole.reshape(-1, 2)[:-1].repeat(2, axis=1))], point_data={"u": moved}).write(
        tmp_path / "u.vtu"
    )
    with pytest.raises(MeshError, match=r"several nodes are at one place, .* its cells are others"):
        judge(scene, tmp_path / "u.vtu", compare=False)


def test_what_is_not_judged_yet_is_said():
    """Contact that cannot open, and materials that are not linear, by their names."""
    scene = sfx.Scene(**dict(shelf()) | {"contact": {"boundary": "bottom", "kind": "bilateral"}})
    problem, _ = judged_problem(scene)
    judgement = judge(scene, np.ones(problem.mesh.points.shape), compare=False)
    assert (judgement.word, judgement.exit_code) == ("cannot be judged", 7)
    assert "contact of bottom cannot open, which is not judged yet" in str(judgement)
    for law in ({"law": "neo-hooke", "young": 1.0, "poisson": 0.3}, {"law": "j2", "young": 1.0, "poisson": 0.3}):
        scene = parse_scene(
            {
                "mesh": {"generator": "rectangle", "parameters": RECTANGLE},
                "material": law | ({"yield_stress": 0.1, "hardening": 0.1} if law["law"] == "j2" else {}),
                "displacement": {"boundary": "left", "x": 0.0, "y": 0.0},
                "contact": {"boundary": "bottom"},
            }
        )
        judgement = judge(scene, np.ones(problem.mesh.points.shape), compare=False)
        assert judgement.word == "cannot be judged"
        assert "is not linear, which is not judged yet" in str(judgement)


@pytest.mark.parametrize("pairs", [0, 1, 4])
@pytest.mark.parametrize("joined", [False, True])
def test_a_mesh_of_other_cells_than_its_file_is_not_judged(tmp_path, pairs, joined):
    """Whether they are divided or cut, and in one of several bodies: nodes are not those of the file."""
    x = np.array([(i, j, 0) for j in (0, 1) for i in range(6)], dtype=float)
    quads = [[i, i + 1, i + 7, i + 6] for i in range(5)]
    halves = [half for a, b, c, d in quads[:pairs] for half in ([a, b, c], [a, c, d])]
    cells = [("quad", quads[pairs:]), *([("triangle", halves)] if halves else [])]
    meshio.write(tmp_path / "bar.vtu", meshio.Mesh(x, cells))
    sides = {"low": "x[1] < 1e-9", "high": "x[1] > 1 - 1e-9"}
    mesh = {"file": str(tmp_path / "bar.vtu"), "boundaries": sides}
    scene = {"material": {"young": 1.0, "poisson": 0.3}}
    if joined:
        plain = {"generator": "rectangle", "parameters": {"cell": "triangle"} if pairs == 4 else {}}
        scene["body"] = [{"name": "bar", "mesh": mesh}, {"name": "other", "mesh": plain, "shift": [0.0, 9.0]}]
        scene["displacement"] = [{"boundary": "other.bottom", "x": 0.0, "y": 0.0}]
    else:
        scene |= {"mesh": mesh, "displacement": []}
    scene["displacement"].append({"boundary": "high", "x": 0.0, "y": -0.1})
    scene["contact"] = [{"boundary": "low", "gap": 0.0}]
    reasons = judged_problem(scene)[1]
    assert [reason for reason in reasons if "other cells than its file" in reason] == (reasons if pairs else [])
    assert len(reasons) == (pairs > 0)


@pytest.mark.slow
def test_the_public_function():
    """``signorini_fx.judge`` is the one of the command."""
    assert sfx.judge is judge
