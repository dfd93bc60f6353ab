"""The commands check, new and schema: what is said of a scene before it is solved, and whether it
comes true.
"""

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from commands import run
from mpi4py import MPI
from pressed_block import block, check, contact, coulomb, tresca
from scene_tables import coulomb_friction, fixed, plane_shape, rectangle_mesh, tresca_friction
from scenes import alone, example1

from signorini_fx.errors import SceneError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.effects import contact as contact_of
from signorini_fx.mechanics.effects import displacement
from signorini_fx.mechanics.laws.coulomb import Coulomb, Tresca
from signorini_fx.mechanics.materials.isotropic import LinearElastic
from signorini_fx.mechanics.materials.orthotropic import OrthotropicElastic
from signorini_fx.mechanics.statement import settings
from signorini_fx.mechanics.statement.base import tables
from signorini_fx.mechanics.statement.effect import Effect
from signorini_fx.mechanics.statement.load_path import LoadSteps
from signorini_fx.mechanics.statement.mesh_sources import MeshFile
from signorini_fx.records import Status
from signorini_fx.results.summary import lines_of, summary_of
from signorini_fx.scenes import scene, template
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.reading import parse_scene, read_scene

DEMOS = sorted((Path(__file__).parents[2] / "demos" / "scenes").glob("*.toml"))
FREE = {"displacement": []}


def said(data, level="warning"):
    """{path: message} of the warnings."""
    return {
        finding.path: finding.message for finding in check(data).findings if finding.level == level
    }


# --- effects --------------------------------------------------------------------------------------


ALL = {
    "element": {"degree": 2, "volumetric": "auto"},
    "material": {"young": 5000.0, "poisson": 0.49},
    "displacement": [{"boundary": "left", "x": 0.0, "y": 0.0}, {"boundary": "left", "x": 0.0}],
    "traction": [
        {"boundary": "top", "y": -20.0, "factors": [0.5, 1.0]},
        {"boundary": "right", "pressure": 0.0},
    ],
    "body_force": {"y": "-x[0]"},
    "springs": [{"boundary": "right", "tangential": "1 + x[1]"}, {"boundary": "top", "x": 0.0}],
    "contact": [
        {"boundary": "bottom", "friction": tresca_friction(0.0)},
        {"boundary": "right", "gap": 1.0},
    ],
}
VARIANTS = {
    "plain": block(),
    "no load": block(traction=[], displacement={"boundary": "left", "x": 1e-3, "y": 0.0}),
    "no contact": block(contact=[]),
    "everything": block(**ALL),
    "linear": block(**{**ALL, "contact": []}),
    "path-following": block(solver={"algorithm": "path-following"}),
    "path-following to a given error": block(
        solver={"algorithm": "path-following", "regularisation_error": 1e-4}
    ),
    "path-following without contact": block(contact=[], solver={"algorithm": "path-following"}),
}


@pytest.mark.one_quick("variant", [*VARIANTS, *(demo.stem for demo in DEMOS)])
def test_the_unknowns_are_those_of_the_solve(variant):
    """Those of the body that no support holds, and those of rigid bodies."""
    data = (
        VARIANTS[variant]
        if variant in VARIANTS
        else read_scene(next(d for d in DEMOS if d.stem == variant))
    )
    report, solution = check(data), alone(data, check=False)
    held = np.count_nonzero(solution.model.fixed)
    tools = [
        one.foundation
        for one in solution.statement.contact
        if one.foundation is not None and one.foundation.driven
    ]
    free = sum(3 - len(tool.prescribed) for tool in tools)  # in 2D, besides those of the body
    assert report.cost.unknowns == solution.model.dofs - held + free


@pytest.mark.one_quick("demo", DEMOS, ids=lambda demo: demo.stem)
def test_the_demos_are_fine(demo):
    """Nothing hurts there, but what the paper itself chose."""
    chosen = {
        "example1_coulomb": ["contact[0].friction"],  # the static law
        "example2_tresca": ["material[0]"],  # nu = 0.45 with linear elements
    }
    warnings = [warning.path for warning in check(read_scene(demo)).warnings]
    assert warnings == chosen.get(demo.stem, [])


AT_ONCE = "its points close one after the other"


@pytest.mark.parametrize(
    ("factors", "gap", "warned"),
    [
        (None, "0.1*(x[0] - 1)**2", True),
        ([0.5, 1.0], "0.1*(x[0] - 1)**2", False),
        ([0.2, 0.4, 0.6, 0.8, 1.0], "0.1*(x[0] - 1)**2", False),
        ([0.1, 1.0, 1.0], "0.1*(x[0] - 1)**2", True),
        (None, 0.001, False),
        (None, "0 if x[0] < 1 else 1e9", False),
    ],
)
@pytest.mark.parametrize("law", [None, "neo-hooke"])
@pytest.mark.parametrize("press", ["displacement", "traction"])
def test_friction_in_one_load_step(factors, gap, warned, law, press):
    """Where points close one after the other, by whatever presses them, it is said by check; a
    push along them is another matter.
    """
    aside = {"boundary": "top", "x": 0.001, "factors": [0.0] * len(factors or [1])}
    aside["factors"][-1] = 1.0
    down = {"boundary": "top", "y": -0.01 if press == "displacement" else -50.0}
    loads = {"displacement": [aside], "traction": []}
    loads[press].append(down | ({} if factors is None else {"factors": factors}))
    scene = {
        "mesh": rectangle_mesh(8, 4, length=2.0, height=1.0),
        "material": {"young": 5000.0, "poisson": 0.3} | ({"law": law} if law else {}),
        "contact": {"boundary": "bottom", "gap": gap, "friction": coulomb_friction(0.3)},
    }
    told = said(parse_scene(scene | loads)).get("contact[0].friction", "")
    assert told.startswith(AT_ONCE) is warned
    without = {**scene["contact"], "friction": tresca_friction(1.0)}
    assert "contact[0].friction" not in said(parse_scene(scene | loads | {"contact": without}))


def test_friction_in_one_load_step_of_a_result():
    """The result says it, too; with steps the stick zone is another one."""
    demo = read_scene(DEMOS[0].with_name("hertz_friction.toml"))
    (support,) = demo.displacement
    once = demo.model_copy(
        update={
            "displacement": (support.model_copy(update={"factors": None}),),
            "mesh": demo.mesh.model_copy(
                update={"parameters": demo.mesh.parameters | {"nx": 60, "ny": 30}}
            ),
        }
    )
    found = alone(once)
    assert [f.path for f in found.findings if f.message.startswith(AT_ONCE)] == [
        "contact[0].friction"
    ]


@pytest.mark.parametrize(("degrees", "warned"), [(0, False), (3, False), (30, True)])
def test_a_direction_that_is_inclined(degrees, warned):
    """Pressure along it pushes a flat side; a foundation that has a shape is met where it is."""
    angle = np.radians(degrees)
    inclined = {"boundary": "bottom", "direction": [np.sin(angle), -np.cos(angle)]}
    told = said(block(contact=inclined)).get("contact[0].direction", "")
    assert (f"acts {degrees} degrees off the normal" in told) is warned
    plane = plane_shape([0.0, 0.0], [-np.sin(angle), np.cos(angle)])
    told = said(block(contact={"boundary": "bottom", "foundation": plane}))
    assert "degrees off the normal" not in told.get("contact[0].foundation", "")


ESTIMATED = {
    "elastic": block(contact=[]),
    "contact": block(),
    "tresca": example1(bound=1.5, generator="rectangle"),
    "coulomb": example1(coefficient=0.3, generator="rectangle"),
    "newton": example1(coefficient=0.3, generator="rectangle", coulomb="newton"),
    "nested": example1(coefficient=0.3, generator="rectangle", levels=3),
    "alm": example1(bound=1.5, generator="rectangle", algorithm="alm"),
    "steps": block(
        **tresca(1.0), traction={"boundary": "top", "y": -20.0, "factors": [0.5, 1.0, 1.5]}
    ),
}


@pytest.mark.one_quick("kind", ESTIMATED)
def test_linear_solves_are_as_many_as_estimated(kind):
    """The true number is in the range, or off by no more than a factor of 1.5."""
    low, high = check(ESTIMATED[kind]).cost.linear_solves
    solution = alone(ESTIMATED[kind])
    solves = solution.history.linear_solves or len(solution.steps)
    assert low / 1.5 <= solves <= 1.5 * high


def test_too_little_memory(monkeypatch):
    """A machine of 10 MB."""
    monkeypatch.setattr(parallel, "machine_memory", lambda comm: 1e7)
    assert "use a coarser mesh" in said(block())["mesh"]


# --- what may go wrong ----------------------------------------------------------------------------

QUIET = {
    "plain": block(),
    "friction": block(**coulomb(0.3)),
    "reduced": block(material={"young": 5000.0, "poisson": 0.499}, element={"volumetric": "auto"}),
    "degree 2": block(material={"young": 5000.0, "poisson": 0.499}, element={"degree": 2}),
    "plane stress": block(
        material={"young": 5000.0, "poisson": 0.499, "hypothesis": "plane stress"}
    ),
    "body force": block(traction=[], body_force={"y": -1.0}, **FREE, **coulomb(0.3)),
    "penalty of alm": block(solver={"algorithm": "alm", "gamma_n": 1e4, "gamma_t": 1e4}),
    "path-following": block(solver={"algorithm": "path-following", "gamma_n": 1.0}),
    "gap that closes": block(**contact(gap=1e-3)),
    "pushed, but held by friction": block(
        traction={"boundary": "top", "x": 2.0, "y": -20.0}, **FREE, **coulomb(0.3)
    ),
    "bilateral contact with friction": block(
        **contact(kind="bilateral", friction=coulomb_friction(0.3))
    ),
    "held by bilateral contact": block(
        traction={"boundary": "top", "y": 20.0}, **contact(kind="bilateral")
    ),
}


@pytest.mark.parametrize("name", QUIET)
def test_no_warning(name):
    """Scenes that are as they should be, and that solve."""
    assert said(QUIET[name]) == {}
    assert alone(QUIET[name], check=False).status is Status.CONVERGED


NARROW = {"mesh": rectangle_mesh(4, 12, length=1.0, height=3.0)}
# A scene, the path and words of its warning, and how it ends.
LOOSE = {
    "nothing": (
        block(contact=[], **FREE),
        "displacement",
        "translations and rotations",
        Status.NOT_HELD,
    ),
    "half a support": (
        block(contact=[], displacement={"boundary": "left", "x": 0.0}),
        "displacement",
        "the translation along (0, 1)",
        Status.NOT_HELD,
    ),
    "sideways": (block(**FREE), "displacement", "the translation along (1, 0)", Status.NOT_HELD),
    "frictionless by its coefficient": (
        block(**FREE, **coulomb(0.0)),
        "displacement",
        "add friction",
        Status.NOT_HELD,
    ),
    "pulled off": (
        block(traction={"boundary": "top", "y": 20.0}, displacement={"boundary": "left", "x": 0.0}),
        "traction, body_force",
        "the loads move the body by the translation along (0, 1)",
        Status.OPEN,
    ),
    "too steep": (
        block(traction={"boundary": "top", "x": 10.0, "y": -20.0}, **FREE, **coulomb(0.3)),
        "traction, body_force",
        "no static equilibrium",
        Status.SLIDES,
    ),
    "a force": (
        block(
            traction=[], force={"boundary": "top", "x": 30.0, "y": -60.0}, **FREE, **coulomb(0.3)
        ),
        "force",
        "no static equilibrium",
        Status.SLIDES,
    ),
    "beyond given friction": (
        block(traction={"boundary": "top", "x": 2.0, "y": -20.0}, **FREE, **tresca(1.9)),
        "traction, body_force",
        "the translation along (1, 0)",
        Status.SLIDES,
    ),
    "second step": (
        block(
            traction={"boundary": "top", "y": -20.0, "factors": [1.0, -1.0]}, **FREE, **coulomb(0.3)
        ),
        "traction, body_force",
        "load step 2: contact opens, no static equilibrium",
        Status.OPEN,
    ),
}


@pytest.mark.parametrize("case", LOOSE)
def test_bodies_that_nothing_holds(case):
    """What is foreseen of the equilibrium comes true, and the solution says it too."""
    data, path, words, status = LOOSE[case]
    expected = said(data)
    assert words in expected[path]
    solution = alone(data, check=False)
    assert solution.status is status
    assert expected.keys() <= {
        finding.path for finding in solution.findings
    }  # the words are those of the result


def test_units_that_do_not_agree():
    """A modulus in GPa for a load in kPa: the body would move by more than its size, and the
    summary says so too.
    """
    data = block(
        material={"young": 5.0, "poisson": 0.3}, traction={"boundary": "top", "y": -2000.0}
    )
    assert (
        "check the units of E and of the loads"
        in said(data)["material, traction, body_force, displacement"]
    )
    solution = alone(data, check=False)
    assert solution.status is Status.TOO_LARGE
    assert solution.certificate.displacement > 1
    assert "check the units of E" in "".join(map(str, lines_of(summary_of(solution), Path())))
    path, load = "material, traction, body_force, displacement", {"boundary": "top", "y": -2.0}
    for young, odd in ((2.1e11, True), (2.1e5, False)):
        steel = block(material={"young": young, "poisson": 0.3}, traction=load)
        assert ("same units, such as MPa?" in said(steel, "note").get(path, "")) is odd


@pytest.mark.parametrize("law", ["tresca", "coulomb"])
@pytest.mark.parametrize("push", [-5.9, 5.9, -6.1, 6.1])
def test_friction_holds_either_way(law, push):
    """A block that nothing but friction holds sideways: up to its bound, and no farther, in both
    directions.
    """
    friction = tresca(2.0) if law == "tresca" else coulomb(0.1)
    loads = [{"boundary": "top", "y": -20.0}, {"boundary": "bottom", "x": push / 3}]
    told = [f.message for f in check(block(displacement=[], traction=loads, **friction)).findings]
    assert any("no static equilibrium" in message for message in told) == (abs(push) > 6)


def test_bilateral_contact_pulls():
    """It holds a body that is drawn away from its foundation; unilateral contact does not."""
    side, up = {"boundary": "left", "x": 0.0}, {"boundary": "top", "y": 20.0}
    for kind, held in (("bilateral", True), ("unilateral", False)):
        found = check(block(displacement=side, traction=up, **contact(kind=kind))).findings
        assert any("no static equilibrium" in f.message for f in found) != held


def test_tipping():
    """A narrow block, pushed at its side, turns about its corner; twice as heavy, it stands."""
    pushed = {**NARROW, **FREE, **coulomb(0.9)}
    for weight, tips in ((-2.0, True), (-8.0, False)):
        data = block(
            **pushed, traction={"boundary": "left", "pressure": 1.0}, body_force={"y": weight}
        )
        message = said(data).get("traction, body_force", "")
        assert ("rotation" in message) == tips
        assert (alone(data, check=False).status is not Status.CONVERGED) == tips


HURTING = [
    (contact(gap=1e3), "contact.gap", "more than loads and prescribed displacements can"),
    (
        {"traction": [], "displacement": fixed("top"), **contact(gap=-1.0)},
        "contact.gap",
        "penetrates its foundation",
    ),
    (
        {
            "traction": [],
            "displacement": {"boundary": "left", "x": 1e-3, "y": 0.0},
            **contact(gap=0.1),
        },
        "contact.gap",
        "more than loads and prescribed displacements can",
    ),
    (
        {
            "traction": [
                {"boundary": "top", "y": -1.0},
                {"boundary": "top", "x": "3 if x[1] > 1.5 else 0", "y": "0*x[0]"},
            ]
        },
        "traction[1]",
        "the value is 0 on the whole boundary 'top'",
    ),
    (
        {"traction": [{"boundary": "top", "y": -1.0}, {"boundary": "left", "y": 1.0}]}
        | {"displacement": fixed("left")},
        "traction[1]",
        "the force goes into the support",
    ),
]


@pytest.mark.parametrize(("changes", "path", "words"), HURTING)
def test_warnings(changes, path, words):
    """One mistake, one warning, at its key."""
    found = said(block(**changes))
    assert list(found) == [path]
    assert words in found[path]


# --- the commands ---------------------------------------------------------------------------------

EXAMPLE = DEMOS[[demo.stem for demo in DEMOS].index("example1_coulomb")]


def written(folder, data):
    """A scene file with other text."""
    file = folder / "scene.toml"
    file.write_text(data, encoding="utf-8")
    return file


@pytest.mark.mpi
def test_check_is_the_same_on_every_rank():
    """And on any number of them, but for the linear algebra."""
    data = block(**FREE, **coulomb(2.0), traction={"boundary": "top", "x": 10.0, "y": 1.0})
    shared, own = check_scene(data, MPI.COMM_WORLD), check(data)
    assert shared.acts == own.acts
    assert shared.findings == own.findings
    assert len(set(MPI.COMM_WORLD.allgather(str(shared)))) == 1


def test_check_json(capsys):
    """The same as data."""
    code, out, err = run(capsys, "check", EXAMPLE, "--json")
    report = json.loads(out)
    assert (code, err) == (0, "")
    assert report == json.loads(json.dumps(check(read_scene(EXAMPLE)).as_dict()))
    assert report["findings"][0]["level"] == "note"


BAD = [
    (("young = 5000.0", "young = -1.0"), "material.young"),
    (('boundary = "bottom"', 'boundary = "below"'), "contact[0].boundary"),
    (('gap = "0.003*(x[0] - 1.5)**2 + 0.001"', 'gap = "1 / 0"'), "contact[0].gap"),
    (('generator = "rectangle"', 'generator = "rectangel"'), "mesh.generator"),
    (("gamma_t = 1e8", 'initial_contact = "x[0] < -1"'), "solver.initial_contact"),
    (("title =", "titel ="), "titel"),
    (("[mesh]", "[mesh"), "syntax"),
]


@pytest.mark.parametrize(("change", "path"), BAD)
def test_bad_scenes(capsys, tmp_path, change, path):
    """Exit code 2, and a line that begins with the file and the path of the mistake; with --json
    also as data.
    """
    file = written(tmp_path, EXAMPLE.read_text().replace(*change))
    code, out, err = run(capsys, "check", file)
    assert (code, out) == (2, "")
    assert f"{file}: {path}: " in err
    code, out, _ = run(capsys, "check", file, "--json")
    assert code == 2
    assert path in [problem["path"] for problem in json.loads(out)["problems"]]


# --- new ------------------------------------------------------------------------------------------

TEMPLATE = template.starting_scene()


@pytest.mark.parametrize(("words", "lines"), [((), 22), (("--full",), 260)])
def test_new(capsys, tmp_path, words, lines):
    """The file parses, is fine, solves, and is not overwritten."""
    file = tmp_path / "mine.toml"
    code, out, err = run(capsys, "new", file, *words)
    assert len(file.read_text().splitlines()) < lines
    assert (code, err) == (0, "")
    assert str(file) in out
    data = read_scene(file)
    assert check(data).warnings == ()
    solution = alone(data)
    assert solution.converged
    assert solution.certificate.holds
    file.write_text("mine")
    code, out, err = run(capsys, "new", file)
    assert (code, out) == (2, "")
    assert f"{file}: already exists" in err
    assert file.read_text() == "mine"


def keys_by_table():
    """{table: keys that the template names in it, switched on or off}, inline tables under their
    own keys.
    """
    found, table = {"": set()}, ""
    for line in TEMPLATE.splitlines():
        if header := re.match(r"#?\[+([a-z_]+)\]+", line):
            table = header[1]
            found[table] = set()
        elif key := re.match(r"#?([a-z_]+) = ", line):
            found[table].add(key[1])
            found.setdefault(f"{table}.{key[1]}", set()).update(
                re.findall(r"[{,] ([a-z_]+) = ", line)
            )
    return found


MODELS = {
    ".accuracy": [settings.Accuracy],
    "element": [scene.Element],
    "material": [LinearElastic, OrthotropicElastic],
    "displacement": [displacement.Displacement],
    **{
        key: list(tables(field.annotation))
        for key, field in scene.Scene.model_fields.items()
        if any(issubclass(kind, Effect) for kind in tables(field.annotation))
        and key not in ("displacement", "contact")
    },
    "contact": [contact_of.Contact],
    "contact.friction": [Tresca, Coulomb],
    "general_contact": [contact_of.GeneralContact],
    "load_steps": [LoadSteps],
    "solver": [settings.SolverSettings],
    "mesh": [scene.MeshGenerator, MeshFile],
}


def test_the_template_names_every_key():
    """Nothing is missing, nothing is made up."""
    named = keys_by_table()
    for table, models in MODELS.items():
        assert named[table] == {name for model in models for name in model.model_fields}, table
    assert named[""] | {t for t in named if t and "." not in t} == set(scene.Scene.model_fields)


# --- schema ---------------------------------------------------------------------------------------


def fits(schema, value, root):
    """Whether a value fits a JSON schema: the part of draft 7 that ours uses, and nothing else."""
    known = {
        "$ref",
        "$schema",
        "$defs",
        "title",
        "description",
        "default",
        "format",
        "type",
        "properties",
        "required",
    }
    known |= {
        "additionalProperties",
        "items",
        "minItems",
        "maxItems",
        "enum",
        "const",
        "anyOf",
        "oneOf",
    }
    known |= {"discriminator", "minimum", "maximum", "exclusiveMinimum", "exclusiveMaximum"}
    assert set(schema) <= known, set(schema) - known
    if "$ref" in schema:
        assert set(schema) == {"$ref"}
        return fits(root["$defs"][schema["$ref"].removeprefix("#/$defs/")], value, root)
    kinds = {
        "object": dict,
        "array": list,
        "string": str,
        "boolean": bool,
        "integer": int,
        "number": (int, float),
    }
    wanted = schema.get("type", list(kinds))
    wanted = [wanted] if isinstance(wanted, str) else wanted
    if not any(
        isinstance(value, kinds[kind]) and (kind == "boolean") == isinstance(value, bool)
        for kind in wanted
    ):
        return "type" not in schema
    if ("enum" in schema and value not in schema["enum"]) or (
        "const" in schema and value != schema["const"]
    ):
        return False
    if "anyOf" in schema and not any(fits(choice, value, root) for choice in schema["anyOf"]):
        return False
    if "oneOf" in schema and sum(fits(choice, value, root) for choice in schema["oneOf"]) != 1:
        return False
    if isinstance(value, dict):
        properties, others = schema.get("properties", {}), schema.get("additionalProperties", True)
        if not set(schema.get("required", [])) <= set(value) or (
            others is False and not set(value) <= set(properties)
        ):
            return False
        others = others if isinstance(others, dict) else {}
        return all(fits(properties.get(key, others), item, root) for key, item in value.items())
    if isinstance(value, list):
        length = schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", len(value))
        return length and all(fits(schema.get("items", {}), item, root) for item in value)
    if isinstance(value, int | float) and not isinstance(value, bool):
        return (
            schema.get("minimum", value) <= value <= schema.get("maximum", value)
            and not value <= schema.get("exclusiveMinimum", value - 1)
            and not value >= schema.get("exclusiveMaximum", value + 1)
        )
    return True


def test_schema(capsys):
    """Printed as JSON of a draft that editors know, with a description for every key."""
    code, out, err = run(capsys, "schema")
    assert (code, err) == (0, "")
    schema = json.loads(out, parse_constant=lambda text: pytest.fail(text))
    assert schema == template.scene_schema()
    assert schema["$schema"] == "http://json-schema.org/draft-07/schema#"
    assert "null" not in out
    assert "prefixItems" not in out
    for name, definition in schema["$defs"].items():
        assert definition["description"], name
    solver = schema["$defs"]["SolverSettings"]["properties"]
    assert all(entry["description"] for entry in solver.values())
    assert solver["gamma_n"]["description"].startswith("regularisation of the contact condition")


@pytest.mark.one_quick(
    "demo", [*DEMOS, Path(template.__file__).with_name("template.toml")], ids=lambda demo: demo.stem
)
def test_the_schema_accepts(demo):
    """Every scene that we ship."""
    schema = template.scene_schema()
    assert fits(schema, tomllib.loads(demo.read_text(encoding="utf-8")), schema)


MISTAKES = [
    {"surprise": 1},
    {"material": {"young": "stiff", "poisson": 0.3}},
    {"material": {"young": 1.0, "poisson": 0.6}},
    {"material": {"young": 1.0}},
    {"contact": {"boundary": "bottom", "friction": {"coefficient": 0.3}}},
    {"contact": {"boundary": "bottom", "friction": {"law": "tresca", "coefficient": 0.3}}},
    {"contact": [{"boundary": "bottom", "kind": "sticky"}]},
    {"contact": {"boundary": "bottom", "direction": [0.0, 1.0, 0.0, 0.0]}},
    {"solver": {"algorithm": "magic"}},
    {"solver": {"max_iterations": 0}},
    {"element": {"degree": 3}},
]


@pytest.mark.one_quick("mistake", MISTAKES, ids=str)
def test_the_schema_refuses(mistake):
    """What the scene refuses."""
    schema = template.scene_schema()
    good = tomllib.loads(TEMPLATE)
    assert fits(schema, good, schema)
    assert not fits(schema, {**good, **mistake}, schema)
    with pytest.raises(SceneError):
        parse_scene({**good, **mistake})


# --- how light the light commands are -------------------------------------------------------------


@pytest.mark.one_quick(
    "arguments",
    [
        ["--help"],
        ["help"],
        ["help", "check"],
        ["check", "--help"],
        ["schema"],
        ["new", "scene.toml"],
    ],
)
def test_light_commands(tmp_path, arguments):
    """Without dolfinx, PETSc or MPI."""
    code = (
        "import sys\n"
        "from signorini_fx.scenes.cli import main\n"
        f"try: main({arguments!r})\n"
        "except SystemExit: pass\n"
        "print([m for m in ('dolfinx', 'petsc4py', 'mpi4py', 'ufl', 'matplotlib', 'scipy') if m "
        "in sys.modules],"
        " file=sys.stderr)"
    )
    ended = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert ended.stderr.splitlines()[-1] == "[]"
