"""Objects from outside: one file of at most 40 lines each, and refused by name where its
independent check is another one.

Each file runs as it is, and once more with one sign changed in what the solver or the certificate
takes of it.
"""

import runpy
import subprocess
import sys
from pathlib import Path

import pytest
from scenes import example1

from signorini_fx import ConvergenceError, InstallationError, Scene, SceneError, extensions
from signorini_fx.extensions import EFFECTS, KINEMATICS, SHAPES

ROOT = Path(__file__).parents[2]
DEMOS = ROOT / "demos" / "extensions"
# Of each file what is changed to what, and what the refusal says.
SPOILED = {
    "body": ("J=tangent", "J=-tangent", "give the derivative of F as J"),
    "dissipated_energy": ('"points"', '"point"', "must be at one of dofs, points, nodes, cells"),
    "effect": (
        "* on.vector((0.0, -1.0, 0.0))",
        "",
        r"magnet\[0\]: density of Magnet has the shape \(\), not \(2,\)",
    ),
    "kinematics": (
        "return self.angle * x[0]",
        "return -self.angle * x[0]",
        "measure of 'slice' is not positive",
    ),
    "law": (
        "by_pressure = self.coefficient /",
        "by_pressure = -self.coefficient /",
        "bound of Smooth exceeds",
    ),
    "linear_solver": (
        "self.pc.apply(b, x)",
        "x.set(0.0)",
        "the linear solver 'block-low-rank' of another package",
    ),
    "material": (
        "s = 2 * self.p * e",
        "s = -2 * self.p * e",
        "stress of Fibres does no work on some strain",
    ),
    "quantity": (
        '= "mean_pressure_right", "',
        '= "max_pressure", "',
        "needs a key that is its name, an",
    ),
    "shape": ("np.copysign(normal, away)", "np.copysign(normal, -away)", "distance of RoundedBox"),
}


@pytest.fixture(autouse=True)
def _registered(monkeypatch, tmp_path):
    """For one test; files are written elsewhere."""
    monkeypatch.setattr(extensions, "_registered", {})
    monkeypatch.chdir(tmp_path)
    before = set(Scene.model_fields)
    yield
    for key in Scene.model_fields.keys() - before:
        del Scene.model_fields[key]
    Scene.model_rebuild(force=True)


def test_all_are_here():
    """Each file has its fault, and no file is longer than the issue of extensions allows."""
    files = {file.stem: file for file in DEMOS.glob("*.py")}
    assert sorted(files) == sorted(SPOILED)
    for file in files.values():
        assert len(file.read_text(encoding="utf-8").splitlines()) <= 40, file


@pytest.mark.one_quick("name", sorted(SPOILED))
def test_runs(name, capfd):
    """As it stands it ends with a solution, or says what it is about."""
    runpy.run_path(str(DEMOS / f"{name}.py"), run_name="__main__")
    printed = capfd.readouterr().out
    assert "converged" in printed or "holds" in printed or "derivative" in printed


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(SPOILED))
def test_is_refused(name, tmp_path):
    """With one sign changed there is an error that names it."""
    old, new, message = SPOILED[name]
    text = (DEMOS / f"{name}.py").read_text(encoding="utf-8")
    assert text.count(old) == 1
    (tmp_path / "extensions").mkdir()
    (tmp_path / "scenes").symlink_to(ROOT / "demos" / "scenes")
    spoiled = tmp_path / "extensions" / f"{name}.py"
    spoiled.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises((SceneError, ConvergenceError, InstallationError), match=message):
        runpy.run_path(str(spoiled), run_name="__main__")


SCENE = """
[mesh]
generator = "rectangle"
parameters = { length = 3.0, height = 1.0, nx = 24, ny = 8 }
[material]
young = 5000.0
poisson = 0.4
hypothesis = "HYPOTHESIS"
[[displacement]]
boundary = "left"
x = 0.0
[[magnet]]
boundary = "top"
centre = [1.5, -0.5]
radius = 0.5
strength = 20.0
[[contact]]
boundary = "bottom"
foundation = { shape = "rounded box", centre = [1.5, -0.502], half = [3.6, 0.3], radius = 0.2 }
friction = { law = "tresca", bound = 0.5 }
"""


@pytest.mark.slow
def test_installed(tmp_path):
    """By entry points of an installed package, from the command line: keys, shapes and hypotheses
    have their names.
    """
    modules = {name: DEMOS / f"{name}.py" for name in ("effect", "kinematics", "shape")}
    for name, file in modules.items():
        (tmp_path / f"their_{name}.py").write_bytes(file.read_bytes())
    data = tmp_path / "theirs-1.dist-info"
    data.mkdir()
    (data / "METADATA").write_text("Name: theirs\nVersion: 1\n", encoding="utf-8")
    (data / "entry_points.txt").write_text(
        "[signorini_fx.effects]\nmagnet = their_effect:Magnet\n"
        "[signorini_fx.kinematics]\nslice = their_kinematics:SLICE\n"
        "[signorini_fx.shapes]\nrounded box = their_shape:RoundedBox\n",
        encoding="utf-8",
    )
    program = (
        "import sys; sys.path.insert(0, sys.argv.pop(1)); from signorini_fx.scenes.cli "
        "import main; sys.exit(main())"
    )
    for hypothesis, code in (("plane strain", 0), ("slice", 0), ("slices", 2)):
        (tmp_path / "scene.toml").write_text(
            SCENE.replace("HYPOTHESIS", hypothesis), encoding="utf-8"
        )
        command = [
            sys.executable,
            "-c",
            program,
            str(tmp_path),
            "solve",
            "scene.toml",
            "--no-pictures",
        ]
        ended = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert ended.returncode == code, ended.stdout + ended.stderr
        wanted = (
            "converged"
            if code == 0
            else "'plane strain', 'plane stress', 'axisymmetric', 'slice', got 'slices'"
        )
        assert wanted in ended.stdout + ended.stderr
    explained = [sys.executable, "-c", program, str(tmp_path), "schema"]
    schema = subprocess.run(
        explained, cwd=tmp_path, capture_output=True, text=True, check=True
    ).stdout
    assert '"magnet"' in schema


@pytest.mark.parametrize(
    ("group", "name", "entries", "message"),
    [
        (
            SHAPES,
            "blob",
            {"contact": {"boundary": "bottom", "foundation": {"shape": "blob"}}},
            "is not a Shape",
        ),
        (
            KINEMATICS,
            "odd",
            {"material": {"young": 1.0, "poisson": 0.3, "hypothesis": "odd"}},
            "is no Kinematics",
        ),
        (EFFECTS, "wind", {"wind": {"boundary": "top"}}, "is not an Effect"),
    ],
)
def test_what_is_none(group, name, entries, message):
    """Is named."""
    extensions.register(group, name, object)
    given = dict(example1(nx=6, ny=2)) | entries
    with pytest.raises(InstallationError, match=f"'{name}', which another package adds, {message}"):
        Scene(**given)
