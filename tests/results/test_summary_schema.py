"""summary.json against its schema: every key of every kind of scene is described, and nothing else
is in the schema.
"""

import json
from copy import deepcopy
from pathlib import Path

import jsonschema
import pytest
from commands import summary_in
from pushed_block import LIMIT, PRESSURE
from pushed_block import block as pushed_block
from quantities import markdown
from scene_tables import coulomb_friction, fixed, plane_shape, rectangle_mesh
from scenes import alone, example1
from spaces import block

from signorini_fx.quantities.summary import SCHEMA_VERSION
from signorini_fx.results.files import write_results
from signorini_fx.scenes import cli
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.template import summary_schema

SCHEMA = summary_schema()
VALIDATOR = jsonschema.Draft202012Validator(SCHEMA)
PAGE = Path(__file__).parents[2] / "docs" / "results.md"


def keys_of(name):
    """The keys of a table of the summary, or of the rows of a list."""
    entry = SCHEMA["properties"][name]
    table = entry.get("items", entry)
    return set(SCHEMA["$defs"][table["$ref"].rpartition("/")[2]]["properties"])


def standing(push, law, press=1.0):
    """A block on its foundation, pushed sideways and pressed down."""
    return parse_scene(
        {
            "mesh": rectangle_mesh(4, 4, length=1.0, height=1.0),
            "material": {"young": 1000.0, "poisson": 0.3},
            "body_force": {"x": push, "y": -press},
            "contact": {"boundary": "bottom", "friction": law},
        }
    )


def stepped():
    """Two load steps."""
    scene = example1(coefficient=0.3, nx=12, ny=4)
    loads = [load.model_copy(update={"factors": (0.5, 1.0)}) for load in scene.traction]
    return scene.model_copy(update={"traction": tuple(loads)})


def stepped_in_space():
    """Two load steps in 3D."""
    scene = block(6, coefficient=0.3, gamma="auto")
    loads = [load.model_copy(update={"factors": (0.5, 1.0)}) for load in scene.traction]
    return scene.model_copy(update={"traction": tuple(loads)})


def linear():
    """No contact."""
    return parse_scene(
        {
            "mesh": rectangle_mesh(6, 3),
            "material": {"young": 1000.0, "poisson": 0.3, "hypothesis": "plane stress"},
            "displacement": fixed("left"),
            "traction": {"boundary": "right", "y": -1.0},
        }
    )


def tool(dimension=2):
    """A block under a plate that a force presses."""
    down = [0.0] * (dimension - 1) + [-1.0]
    shape = {
        "shape": "plane",
        "point": [0.0] * (dimension - 1) + [1.0],
        "normal": down,
        "pivot": [0.4] * dimension,
    }
    return parse_scene(
        {
            "mesh": {
                "generator": "rectangle" if dimension == 2 else "box",
                "parameters": {"nx": 3, "ny": 2},
            },
            "material": {"young": 1000.0, "poisson": 0.3, "yield_stress": 10.0},
            "displacement": {"boundary": "bottom", **dict.fromkeys("xyz"[:dimension], 0.0)},
            "contact": {
                "boundary": "top",
                "foundation": {**shape, "force": down},
                "friction": COULOMB,
            },
        }
    )


def preloaded():
    """A block without contact, shortened across its middle."""
    preload = {"point": [0.5, 0.0], "axis": [1.0, 0.0], "shortening": 0.01}
    scene = linear()
    return parse_scene(
        scene.model_dump(include={"mesh", "material", "displacement"}) | {"preload": preload}
    )


def ramp():
    """A block that is pushed beyond the limit of friction."""
    push = {"boundary": "left", "x": 2 * LIMIT, "factors": [0.0, 1.0]}
    steps = {"steps": 2, "times": [0.0, 1.0]}
    pressed = {"boundary": "top", "y": -PRESSURE}
    return pushed_block(3, {"traction": [pressed, push], "load_steps": steps})


def cornered():
    """A block on the edge of a wedge, between two of its nodes."""
    wedge = {"shape": "polyline", "points": [[-0.6, -1.0], [0.4, 0.0], [1.4, -1.0]]}
    return parse_scene(
        {
            "mesh": rectangle_mesh(4, 4, length=1.0),
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": {"boundary": "top", "x": 0.0, "y": -0.01},
            "contact": {"boundary": "bottom", "foundation": wedge},
        }
    )


def twisted():
    """A ring that is pressed and turned in two load steps."""
    return parse_scene(
        {
            "mesh": rectangle_mesh(3, 2),
            "material": {
                "young": 1000.0,
                "poisson": 0.3,
                "hypothesis": "axisymmetric",
                "torsion": True,
            },
            "displacement": {
                "boundary": "top",
                "y": -0.01,
                "z": "-0.01 * x[0]",
                "factors": [0.5, 1.0],
            },
            "contact": {"boundary": "bottom", "friction": COULOMB},
        }
    )


def dented():
    """A metal that yields under a plate."""
    return parse_scene(
        {
            "mesh": rectangle_mesh(3, 2),
            "material": {"law": "j2", "young": 1000.0, "poisson": 0.3, "yield_stress": 5.0},
            "displacement": fixed("bottom"),
            "contact": {"boundary": "top", "foundation": plane_shape([0.0, 0.99], [0.0, -1.0])},
        }
    )


COULOMB = coulomb_friction(0.3)
SCENES = {
    "plane": lambda: example1(bound=1.5, nx=12, ny=4),
    "space": lambda: block(6, coefficient=0.3, gamma="auto"),
    "steps": stepped,
    "steps in 3D": stepped_in_space,
    "levels": lambda: example1(bound=1.5, nx=12, ny=4, levels=2, error_bound=True),
    "path-following": lambda: example1(bound=1.5, nx=12, ny=4, algorithm="path-following"),
    "alm": lambda: example1(coefficient=0.3, nx=12, ny=4, gamma="auto", algorithm="alm"),
    "free to tip": lambda: standing(0.1, COULOMB),
    "linear": linear,
    "torsion": twisted,
    "tool": tool,
    "tool in 3D": lambda: tool(3),
    "preload": preloaded,
    "corner": cornered,
    "metal": dented,
    "ramp": ramp,
    "slides": lambda: standing(0.5, COULOMB),
    "rubber": lambda: parse_scene(
        {
            "mesh": rectangle_mesh(2, 1),
            "material": {"law": "neo-hooke", "young": 2.0, "poisson": 0.3},
            "displacement": {"boundary": "top", "x": 0.0, "y": -0.1},
            "contact": {"boundary": "bottom", "gap": 0.0},
        }
    ),
    "opens": lambda: standing(0.0, COULOMB, press=-1.0),
    "stopped": lambda: example1(coefficient=0.3, nx=12, ny=4, max_iterations=1, fallbacks=False),
}


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The summaries of all scenes, as they are in the files."""
    found = {}
    for name, scene in SCENES.items():
        folder = tmp_path_factory.mktemp("summary")
        write_results(alone(scene(), check=False), folder, pictures=False)
        found[name] = summary_in(folder)
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_summaries(written, name):
    """They are valid, solved or not."""
    VALIDATOR.validate(written[name])
    solved = name not in ("slides", "opens", "stopped", "ramp")
    assert written[name]["converged"] == solved


def test_every_key_is_used(written):
    """There is no key in the schema that no scene has, so that a key that goes is noticed."""
    assert set(SCHEMA["properties"]) == set().union(*written.values())
    inner = {
        "contact_boundaries": written["plane"]["contact_boundaries"][0],
        "resultants": written["plane"]["resultants"][0],
        "rigid_bodies": written["tool"]["rigid_bodies"][0],
        "preloads": written["preload"]["preloads"][0],
        "corners": written["corner"]["corners"][0],
        "pieces": written["plane"]["pieces"][0],
        "convergence_table": written["levels"]["convergence_table"][0],
        "findings": written["slides"]["findings"][0],
    }
    for name, row in inner.items():
        assert keys_of(name) == set(row), name
    for name, kind in (("certificate", "plane"), ("stress", "plane"), ("limit", "ramp")):
        assert keys_of(name) == set(written[kind][name]), name


@pytest.mark.one_quick(
    "place",
    [
        (),
        ("certificate",),
        ("resultants", 0),
        ("contact_boundaries", 0),
        ("stress", "von_mises"),
        ("parameters",),
    ],
    ids=str,
)
def test_what_is_not_described(written, place):
    """A key that the schema does not have is refused, at every level; so is one that is missing."""
    changed = deepcopy(written["plane"])
    table = changed
    for key in place:
        table = table[key]
    table["unheard_of"] = 1.0
    with pytest.raises(jsonschema.ValidationError, match="unheard_of"):
        VALIDATOR.validate(changed)
    del table["unheard_of"]
    VALIDATOR.validate(changed)
    del changed["status"]
    with pytest.raises(jsonschema.ValidationError, match="status"):
        VALIDATOR.validate(changed)


def test_the_schema():
    """It is a schema; all its keys are in the reference, and its version is that of the summary."""
    jsonschema.Draft202012Validator.check_schema(SCHEMA)
    text = PAGE.read_text(encoding="utf-8") + markdown()
    assert {key for key in SCHEMA["properties"] if f"`{key}`" not in text} == set()
    for key in ("resultants", "contact_boundaries", "stress", "deformation"):
        assert {k for k in keys_of(key) if f"`{k}`" not in text} == set()
    assert SCHEMA["properties"]["schema_version"]["const"] == SCHEMA_VERSION


def test_command(capsys):
    """It can be printed."""
    assert cli.main(["schema", "--summary"]) == 0
    assert json.loads(capsys.readouterr().out) == SCHEMA
