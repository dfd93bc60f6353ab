"""What a type checker sees of the public names, in a program of a user."""

import ast
from pathlib import Path

import pytest

import signorini_fx

api = pytest.importorskip("mypy.api")

USER = """\
from pathlib import Path
from mpi4py import MPI
import signorini_fx as sfx

friction = sfx.Coulomb(0.3, cohesion=lambda x: 1.0 + x[0])
below = [sfx.Contact(boundary="bottom", direction=[0, -1], friction=friction)]
steel = sfx.LinearElastic(young=210e3, poisson=0.3, density=7.85e-9)
block = sfx.generate_mesh("rectangle", {"nx": 8, "ny": 4}, MPI.COMM_WORLD)
moved = sfx.Displacement(boundary="top", y="-t", factors=[0, 1])
scene = sfx.Scene(mesh=block, material=steel, displacement=moved, contact=below, solver={"levels": 1})
solution = sfx.solve(scene)
problem = sfx.ContactProblem(1, 2, contact=[sfx.Foundation([3]), sfx.Pair([1], [2])])
sfx.write_results(solution, Path("out"))
"""

# A line of a user -> the beginning of what mypy says of it.
FAULTS = {
    "sfx.LinearElastic(yung=1)": 'Unexpected keyword argument "yung" for "LinearElastic"; did you',
    'sfx.LinearElastic(young="soft", poisson=0.3)': 'Argument "young" to "LinearElastic" has',
    "sfx.Coulomb()": 'Missing positional argument "coefficient" in call to "Coulomb"',
    "sfx.Scene(material=steel, contact=5)": 'Argument "contact" to "Scene" has incompatible type',
    "scene.contact[0].foot": '"Contact" has no attribute "foot"',
    "solution.pressures": '"Solution" has no attribute "pressures"',
    "sfx.plott": 'Module has no attribute "plott"',
}


@pytest.mark.slow
def test_program_of_a_user(tmp_path, monkeypatch):
    """It passes, its types are known, and a wrong key or a wrong type is found."""
    names = ("friction", "steel", "scene", "scene.contact", "solution", "problem", "block")
    shown = "".join(f"reveal_type({name})\n" for name in names)
    file = tmp_path / "user.py"
    file.write_text(USER + shown + "".join(f"{fault}\n" for fault in FAULTS), encoding="utf-8")
    monkeypatch.setenv("MYPYPATH", str(Path(signorini_fx.__file__).parents[1]))
    report, errors, _ = api.run(
        [
            "--config-file=",
            "--ignore-missing-imports",
            "--follow-imports=silent",
            "--no-error-summary",
            f"--cache-dir={tmp_path}",
            str(file),
        ]
    )
    assert errors == ""
    told = [line.partition(": ")[2] for line in report.splitlines()]
    types = [line.rpartition(".")[2].strip('"') for line in told if line.startswith("note: Rev")]
    assert types == [
        "Coulomb",
        "LinearElastic",
        "Scene",
        "]",
        "Solution",
        "ContactProblem",
        "TaggedMesh",
    ]
    found = [line for line in told if line.startswith("error: ")]
    assert len(found) == len(FAULTS), report
    for line, said in zip(found, FAULTS.values(), strict=True):
        assert line.startswith(f"error: {said}"), line


def test_public_names():
    """Each is where the stub says, and the stub names nothing that is not there."""
    stub = Path(signorini_fx.__file__).with_suffix(".pyi").read_text(encoding="utf-8")
    names = [node for node in ast.parse(stub).body if isinstance(node, ast.ImportFrom)]
    assert [name.names[0].name for name in names] == list(signorini_fx._PUBLIC)
    for name in signorini_fx.__all__:
        assert hasattr(signorini_fx, name), name
