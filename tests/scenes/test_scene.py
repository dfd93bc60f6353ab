"""Scenes: what is valid, and that every mistake is named by its path."""

import copy
import math
import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scene_tables import coulomb_friction, fixed, rectangle_mesh, tresca_friction

from signorini_fx.errors import SceneError
from signorini_fx.mechanics.laws.coulomb import Tresca
from signorini_fx.mechanics.statement.expressions import Expression
from signorini_fx.scenes.reading import parse_scene, parse_scene_text, read_scene
from signorini_fx.scenes.scene import Scene

GOOD = {
    "title": "a block",
    "mesh": rectangle_mesh(6, 2),
    "material": {"young": 5000.0, "poisson": 0.4},
    "displacement": [fixed("left", "x"), {"boundary": "right", "x": "0.1*x[1]"}],
    "traction": [{"boundary": "top", "y": "-20 if 1 <= x[0] <= 2 else 0"}],
    "contact": [{"boundary": "bottom", "gap": 0.001, "friction": tresca_friction(1.5)}],
    "solver": {"gamma_n": 1e8, "initial_contact": "1.25 <= x[0] <= 1.75"},
}
NOTHING = object()


def changed(*changes):
    """GOOD with values put in at dotted paths, where NOTHING takes the key away."""
    data = copy.deepcopy(GOOD)
    for path, value in changes:
        *parents, last = (int(part) if part.isdigit() else part for part in path.split("."))
        node = data
        for part in parents:
            node = node[part]
        if value is NOTHING:
            del node[last]
        else:
            node[last] = value
    return data


def problems(data):
    """{path: message} of the mistakes in a scene."""
    with pytest.raises(SceneError) as caught:
        parse_scene(data)
    for path, message in caught.value.problems:
        assert f"{path}: {message}" in str(caught.value)
    return dict(caught.value.problems)


def test_good_scene():
    """The scene that the bad ones are made from is valid, and its values are what was written."""
    scene = parse_scene(GOOD)
    assert scene.contact[0].friction == Tresca(bound=1.5)
    assert scene.displacement[0].x == 0.0
    assert scene.displacement[0].y is None
    assert scene.displacement[1].x == Expression("0.1*x[1]")
    assert scene.solver.initial_contact.text == "1.25 <= x[0] <= 1.75"
    assert scene.solver.gamma_t == "auto"


def test_defaults():
    """What a scene does not mention is off."""
    scene = parse_scene({key: GOOD[key] for key in ("mesh", "material")})
    assert (scene.displacement, scene.traction, scene.body_force, scene.contact) == (
        (),
        (),
        None,
        (),
    )


def test_one_table_instead_of_a_list():
    """[contact] is as good as [[contact]]."""
    assert parse_scene(changed(("contact", GOOD["contact"][0]))) == parse_scene(GOOD)


@pytest.mark.parametrize(
    "mistake",
    [
        ("foo", 1, "unknown key; the file that signorini-fx new writes has all keys"),
        ("material.rho", 1, "unknown key: weight is written [gravity]"),
        ("contact.0.slack", 1, "unknown key; the file that signorini-fx new writes has all keys"),
        (
            "contact.0.friction.rate",
            1,
            "unknown key; the file that signorini-fx new writes has all keys",
        ),
        ("traction.0.factors", 5, "must be a list in brackets"),
        ("material", 210e3, "must be a table or a list of tables, got 210000.0"),
        ("mesh.boundaries", {"a": 1}, "boundaries and regions belong to file", "mesh"),
        ("material.youngs", 1, "unknown key: did you mean 'young'?"),
        ("contact.0.gaps", 1, "unknown key: did you mean 'gap'?"),
        ("material.title", "steel", "belongs to the top level"),
        ("material.degree", 2, "it belongs to [element]"),
        ("material.young", True, "must be a number, got true"),
        ("solver.max_iterations", "many", "must be an integer, got 'many'"),
        ("contact.0.friction.coefficient", 0.3, "unknown key"),
        ("mesh", NOTHING, "mesh is missing", "scene"),
        ("material.young", NOTHING, "is missing"),
        ("contact.0.friction.bound", NOTHING, "is missing"),
        (
            "displacement.0.boundary",
            NOTHING,
            "give either a boundary or at, a point",
            "displacement[0]",
        ),
        ("mesh", {}, "file or generator"),
        ("mesh", {"file": "a.msh", "generator": "block"}, "file or generator"),
        ("mesh", 3, "expected"),
        ("mesh.generator", 3, "string"),
        ("material", 3, ""),
        ("material.young", -1.0, "greater than 0"),
        ("material.young", 0, "greater than 0"),
        ("material.young", math.nan, "finite"),
        ("material.young", math.inf, "finite"),
        ("material.young", "5000", "number"),
        ("material.young", True, "number"),
        ("material.poisson", 0.6, "at most 0.5"),
        ("material.poisson", 0.5, "must be below 0.5"),
        ("material.poisson", -1, "greater than -1"),
        ("material.hypothesis", "plane", "plane strain"),
        ("element", {"degree": 3}, "2", "element.degree"),
        ("displacement.0", "left", ""),
        ("displacement.0.x", NOTHING, "no component is given", "displacement[0]"),
        ("displacement.1.x", "0.1*y", "'y'"),
        ("traction.0.boundary", 3, "string"),
        ("traction.0.y", "1 +", "syntax error"),
        ("traction.0.y", "20 MPa", "Allowed are numbers"),
        ("traction.0.y", "x[0]^2", "a power is written **"),
        ("traction.0.y", "__import__('os')", "__import__"),
        ("traction.0.y", "open('/etc/passwd')", "open"),
        ("traction.0.y", "x.__class__", "'x.__class__' is not available"),
        ("body_force", {"y": "import os"}, "syntax error", "body_force.y"),
        ("contact.0.gap", math.nan, "finite"),
        ("contact.0.gap", 10**400, "finite"),
        ("contact.0.gap", True, "number"),
        ("contact.0.gap", [1], "number"),
        ("contact.0.friction.bound", -1.5, "negative"),
        (
            "contact.0.friction",
            coulomb_friction(-0.3),
            "negative",
            "contact[0].friction.coefficient",
        ),
        (
            "contact.0.friction",
            {"law": "stick"},
            "'none', 'tresca', 'coulomb'",
            "contact[0].friction.law",
        ),
        ("contact.0.friction", 0.3, 'must be a table, such as { law = "coulomb"'),
        ("contact", 3, "must be a table or a list of tables"),
        ("traction.0.factors", [], "must have at least 1 entry, got 0"),
        ("contact", [3], "must be a table", "contact[0]"),
        ("contact.0.friction", {}, "is missing", "contact[0].friction.law"),
        ("contact.0.kind", "glued", "must be 'unilateral', 'bilateral' or 'bonded', got 'glued'"),
        ("contact", [{"boundary": "a"}, {"boundary": "a"}], "in contact twice", "contact[1]"),
        (
            "displacement",
            [{"boundary": "bottom", "normal": 0}],
            "in contact as well",
            "displacement[0]",
        ),
        ("solver.gamma_n", 0, "greater than 0"),
        ("solver.gamma_t", "large", "auto"),
        ("solver.sigma", -1, "greater than 0"),
        ("solver.algorithm", "bisection", "'ssn'"),
        ("solver.max_iterations", 0, "greater than 0"),
        ("solver.initial_contact", "somewhere", "'somewhere'"),
        ("solver.initial_contact", {"w": [0, 1]}, "not dict"),
    ],
)
def test_one_mistake(mistake):
    """A mistake is reported once, with the path of its key or another one, and what is expected."""
    path, value, message, *other = mistake
    (expected,) = other or [re.sub(r"\.(\d+)", r"[\1]", path)]
    found = problems(changed((path, value)))
    assert list(found) == [expected]
    assert message in found[expected]


def test_entries_that_do_not_go_together():
    """Each of them alone is fine; all of them are reported at once, at the later entry."""
    two = {"young": 1.0, "poisson": 0.3}
    found = problems(
        changed(
            ("material", [two, {**two, "hypothesis": "plane stress"}]),
            ("contact", [{"boundary": "a"}, {"boundary": "b"}, {"boundary": "a"}]),
            ("displacement", [fixed("c", "x"), {"boundary": "b", "normal": 0}]),
            ("load_steps", {"names": ["one", "two"]}),
        )
    )
    assert set(found) == {
        "material",
        "material[1]",
        "contact[2]",
        "displacement[1]",
        "load_steps.names",
    }
    assert "own region" in found["material"]
    assert "same hypothesis" in found["material[1]"]


def test_several_mistakes():
    """All mistakes are reported at once."""
    found = problems(
        changed(
            ("foo", 1),
            ("material", {"young": -1.0, "poisson": 0.6}),
            ("traction.0.y", "1 +"),
            ("solver.gamma_n", -1.0),
        )
    )
    assert set(found) == {
        "foo",
        "material.young",
        "material.poisson",
        "traction[0].y",
        "solver.gamma_n",
    }


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('mesh = \ntitle = "a"', "line 1"),
        ('title = "a"\ntitle = "b"', "overwrite"),
        ("gap = " + "1" * 5000, "syntax"),
        ("a = " + "[" * 5000, "syntax"),
    ],
)
def test_syntax_errors(text, message):
    """What is no TOML is refused with the name of the file."""
    with pytest.raises(SceneError, match=message) as caught:
        parse_scene_text(text, Path("bad.toml"))
    assert str(caught.value).startswith("bad.toml: syntax: ")


@pytest.mark.parametrize("content", [None, b"\xff\xfe"])
def test_unreadable_files(tmp_path, content):
    """A file that is not there, or no text, is a mistake of the user like any other."""
    path = tmp_path / "scene.toml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(SceneError, match=r"cannot be read|not a text file"):
        read_scene(path)


KEYS = """
    mesh file generator parameters material young poisson displacement traction body_force contact solver boundary x y
    gap friction law none tresca coulomb bound coefficient initial_contact gamma_n sigma auto all element degree factors
"""
WORDS = st.sampled_from(KEYS.split())
NUMBERS = st.floats() | st.integers() | st.sampled_from([10**400, -(10**400)])
LEAVES = st.none() | st.booleans() | NUMBERS | st.text(max_size=8) | WORDS
DATA = st.recursive(
    LEAVES,
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(WORDS | st.text(max_size=4), inner, max_size=4)
    ),
    max_leaves=12,
)


def refused_or_valid(make):
    """Run ``make``; only a SceneError with a path for each mistake may come out."""
    problems = [("a path", "a message")]
    try:
        assert isinstance(make(), Scene)
    except SceneError as error:
        problems = error.problems
    assert problems
    assert all(path and message for path, message in problems)


@pytest.mark.slow
@given(st.dictionaries(WORDS | st.text(max_size=4), DATA, max_size=6))
def test_random_data(data):
    """Nested data of any shape never raises anything but SceneError."""
    refused_or_valid(lambda: parse_scene(data))


PATHS = st.sampled_from(
    [
        "title",
        *GOOD,
        "mesh.parameters",
        "mesh.parameters.nx",
        "material.young",
        "displacement.0",
        "displacement.1.x",
        "traction.0.y",
        "contact.0.gap",
        "contact.0.friction",
        "contact.0.friction.bound",
        "solver.initial_contact",
        "solver.gamma_n",
    ]
)


@given(PATHS, DATA)
def test_random_mistake(path, value):
    """Anything at any place of a good scene never raises anything but SceneError."""
    refused_or_valid(lambda: parse_scene(changed((path, value))))


@given(st.text(max_size=60) | st.lists(WORDS | st.sampled_from(list('=[]{}\n".1,'))).map(" ".join))
def test_random_text(text):
    """Text of any kind as a scene file never raises anything but SceneError."""
    refused_or_valid(lambda: parse_scene_text(text, Path("random.toml")))


def test_a_key_at_the_top_is_told_its_table():
    """Not the removal of a key of the same name in another table."""
    data = {"file": "part.msh", "material": {"young": 1.0, "poisson": 0.3}}
    with pytest.raises(SceneError) as error:
        parse_scene(data)
    assert (
        "file",
        "unknown key here: it belongs to [mesh] or [temperature]",
    ) in error.value.problems
