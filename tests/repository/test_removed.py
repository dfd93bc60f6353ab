"""Whoever still writes a name that left is told what to use instead, wherever such names are
written.
"""

import pytest
from mpi4py import MPI

import signorini_fx
from signorini_fx import InstallationError, SceneError, SolverSettings
from signorini_fx.extensions import add_on, register
from signorini_fx.removed import INSTEAD
from signorini_fx.scenes import cli
from signorini_fx.scenes.reading import changed, parse_scene

# One of each kind, which no version has had.
KINDS = {
    "moon": "look elsewhere",
    "solver.moonlight": "use sunlight",
    "contact.friction.moon": "use the sun",
    "solver.algorithm = moonwalk": "use 'alm'",
    "contact.friction.law = moon": "use 'coulomb'",
    "signorini-fx moonwalk": "walk",
    "signorini-fx solve --moon": "use --out",
    "signorini-fx solve --of moon": "use energy",
    "Moon": "use Scene",
    "moon_phase": "use a calendar",
}


# Tables whose keys are known only with what tells their kinds apart.
CONTACT = {"boundary": "bottom", "friction": {"law": "coulomb", "coefficient": 0.3}}
SCENE = {"mesh": {"generator": "rectangle"}, "contact": CONTACT}


def words_of(name):
    """What is written on the command line: the command, what it needs, and what left."""
    _, command, *rest = name.split()
    needed = ["scene.toml", "result.csv"] if command == "judge" else ["scene.toml"]
    return [command, *(needed if rest else []), *rest]


def told_of(name, capsys):
    """What whoever writes this name is told."""
    if name.startswith("signorini-fx "):
        with pytest.raises(SystemExit) as end:
            cli.main(words_of(name))
        assert end.value.code == 2
        return capsys.readouterr().err
    if name.startswith("signorini_fx."):
        with pytest.raises(InstallationError) as refusal:
            register(name, "mine", object)
        return str(refusal.value)
    if name.isidentifier() and name != name.lower():
        with pytest.raises(ImportError) as error:
            getattr(signorini_fx, name)
        return str(error.value)
    path, _, value = name.partition(" = ")

    def read():
        if path == "mesh.generator":  # those of other packages are known when the mesh is made
            signorini_fx.generate_mesh(value, {}, MPI.COMM_WORLD)
        parse_scene(changed(SCENE, {path: value or 1.0}))

    with pytest.raises(SceneError) as error:
        read()
    return next(f"{place}: {message}" for place, message in error.value.problems if place == path)


@pytest.mark.parametrize("name", KINDS)
def test_each_kind_of_name_that_left_says_what_to_use_instead(name, capsys, monkeypatch):
    monkeypatch.setitem(INSTEAD, name, KINDS[name])
    assert f"was removed: {KINDS[name]}" in told_of(name, capsys)


@pytest.mark.parametrize("name", INSTEAD)
def test_each_name_that_left_says_what_to_use_instead(name, capsys):
    assert f"was removed: {INSTEAD[name]}" in told_of(name, capsys)


def test_tables_made_in_python_say_it_as_well(monkeypatch):
    monkeypatch.setitem(INSTEAD, "solver.algorithm = moonwalk", "use 'alm'")
    with pytest.raises(SceneError, match="algorithm: 'moonwalk' was removed: use 'alm'"):
        SolverSettings(algorithm="moonwalk")


def test_an_add_on_that_left_says_it(monkeypatch):
    monkeypatch.setitem(INSTEAD, "moon_phase", "use a calendar")
    with pytest.raises(InstallationError, match="'moon_phase' was removed: use a calendar"):
        add_on("moon_phase")


def test_an_import_of_a_name_that_left_says_it():
    with pytest.raises(ImportError, match=r"signorini_fx.CoulombFriction was removed: use Coulomb"):
        from signorini_fx import CoulombFriction  # noqa: F401


def test_what_was_never_there_is_unknown():
    with pytest.raises(AttributeError, match="has no attribute 'Moon'"):
        getattr(signorini_fx, "Moon")  # noqa: B009
    with pytest.raises(SceneError, match="unknown key"):
        parse_scene({"moon": 1})
