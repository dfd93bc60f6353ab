"""Bad input from the command line and in files: one message with its place, exit code 2, soon, and
nothing left behind.

Each entry of the lists is a mistake that somebody made once; generated cases try the kind of
mistake behind it.
"""

import json
import os
import subprocess
import sys
import time
import tomllib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mesh_files import read_file
from mpi4py import MPI
from petsc4py import PETSc

from signorini_fx.algebra.linalg import petsc_options
from signorini_fx.errors import MachineError, MeshError, OptionsError, SceneError
from signorini_fx.forms.solver import options_applied
from signorini_fx.machine import compilation
from signorini_fx.results.folder import ResultFolder
from signorini_fx.scenes import cli
from signorini_fx.scenes.solver import solve

COMM = MPI.COMM_WORLD
SCENE = """
[mesh]
generator = "rectangle"
parameters = { nx = 6, ny = 2 }
[material]
young = 5000.0
poisson = 0.4
[[displacement]]
boundary = "left"
x = 0.0
[[traction]]
boundary = "top"
y = -20.0
[[contact]]
boundary = "bottom"
gap = "0.001*x[0]"
friction = { law = "coulomb", coefficient = 0.3 }
"""
LIMIT = 1.0  # CPU seconds


@pytest.fixture
def run(tmp_path, capfd):
    """Run the command line in this process: exit code and what it wrote on standard error."""

    def go(*arguments):
        begin = time.process_time()
        try:
            code = cli.main([str(argument) for argument in arguments])
        except SystemExit as end:
            code = end.code
        assert time.process_time() - begin < LIMIT
        assert not list(tmp_path.rglob("*.part"))
        return code, capfd.readouterr().err

    return go


@pytest.fixture
def solve_text(tmp_path, run):
    """Solve a scene given as text."""

    def go(text, *arguments):
        file = tmp_path / "scene.toml"
        file.write_bytes(text if isinstance(text, bytes) else text.encode())
        return run(
            "solve",
            file,
            "--out",
            tmp_path / "out",
            "--no-pictures",
            "--no-fields",
            "--quiet",
            *arguments,
        )

    return go


def changed(old, new):
    assert old in SCENE
    return SCENE.replace(old, new)


# --- scenes ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "arguments", "message"),
    [
        (changed('"0.001*x[0]"', '"1e200"'), (), "contact[0].gap: is 1e+200 at ("),
        (changed('"0.001*x[0]"', "1e200"), (), "contact[0].gap: must not be larger than 1e+60"),
        (
            changed("young = 5000.0", "young = 1e308"),
            (),
            "material.young: must not be larger than 1e+60",
        ),
        (
            changed("young = 5000.0", "young = 1e-308"),
            (),
            "material.young: must not be smaller than 1e-60",
        ),
        (
            changed("y = -20.0", 'y = "1e200*x[0]"'),
            (),
            "traction[0].y: is 5e+199 at (0.5, 1); it must be a number of at most",
        ),
        (
            changed("x = 0.0", 'x = "log(-1 - x[1])"'),
            (),
            "displacement[0].x: is nan at (0, 0); it must be a number of at most 1e+60",
        ),
        (
            SCENE + '[[displacement]]\nboundary = "left"\nx = 1e-3\n',
            (),
            "displacement[1].x: displacement[0] prescribes x on 'left' as well, otherwise: remove",
        ),
        (
            SCENE + "[solver]\ngamma_n = 1e300\n",
            (),
            "solver.gamma_n: must not be larger than 1e+60",
        ),
        (changed("nx = 6", "self = 1"), (), "mesh.parameters.self: unknown key; there are: length"),
        (
            changed("[mesh]", "[mesh]\nboundaries = {}"),
            (),
            "mesh: boundaries and regions belong to file",
        ),
        (changed("nx = 6", "comm = 1"), (), "mesh.parameters.comm: unknown key; there are: length"),
        (changed("nx = 6", "length = 9223372036854775808"), (), "the body is too thin"),
        (
            changed("nx = 6", 'nx = "six"'),
            ("--set", "solver.levels=2"),
            "mesh.parameters.nx: must be",
        ),
        ("solver = 3\n" + SCENE, ("--set", "solver.levels=2"), "solver: must be a table"),
        ("accuracy = [1]\n" + SCENE, ("--accuracy", "0.1"), "accuracy: must be a table"),
        (
            b"\xef\xbb\xbf" + changed("poisson = 0.4", "poisson = 0.6").encode(),
            (),
            "material.poisson: must be at most",
        ),
    ],
    ids=range(16),
)
def test_scene(solve_text, text, arguments, message):
    """Exit code 2 and one line that names the key."""
    code, errors = solve_text(text, *arguments)
    assert code == 2
    (line,) = errors.splitlines()
    assert line.startswith("signorini-fx: error: ")
    assert message in line


# --- PETSc options --------------------------------------------------------------------------------


MISTYPED = (
    "ksp_type wrong",
    "snes_rtol 5",
    "snes_max_it abc",
    "pc_type wrong",
    "pc_factor_mat_solver_type superlu",
)


@pytest.fixture
def petsc():
    """PETSc's options, as they were before at the end."""
    found = PETSc.Options()
    yield found
    for name in found.getAll():
        if name.startswith(petsc_options.PREFIX) or name == "log_view":
            found.delValue(name)


@pytest.mark.mpi
@pytest.mark.parametrize("said", MISTYPED)
def test_mistyped_option(petsc, said):
    """It is named on all ranks."""
    name, _, value = said.partition(" ")
    petsc[petsc_options.PREFIX + name] = value
    with pytest.raises(OptionsError, match=f"^PETSc fails with the options -sfx_{said}: ."):
        solve(tomllib.loads(SCENE))


def test_mistyped_option_of_a_matrix(petsc):
    """PETSc reads it when it factorises."""
    petsc[petsc_options.PREFIX + "pc_factor_mat_solver_type"] = "mumps"
    petsc[petsc_options.PREFIX + "mat_mumps_icntl_14"] = "abc"
    with pytest.raises(
        OptionsError, match=r"^PETSc fails with the options .*-sfx_mat_mumps_icntl_14 abc.*: ."
    ):
        solve(tomllib.loads(SCENE))


@pytest.mark.mpi
@pytest.mark.parametrize(
    "said",
    [
        *(
            f"snes_type {kind}"
            for kind in ("ngmres", "nrichardson", "qn", "ncg", "ngs", "anderson", "ms", "ksponly")
        ),
        *("snes_mf", "snes_mf true", "snes_mf_operator", "snes_fd", "snes_fd_color"),
        *("snes_convergence_test default", "snes_lag_jacobian 2", "npc_snes_type ngmres"),
    ],
)
def test_options_that_exchange_the_method(petsc, said):
    """They are refused by name, in scenes and in forms; what leaves the method as it is, is not."""
    name, _, value = said.partition(" ")
    message = f"^PETSc option -sfx_{said}: it would replace the semi-smooth Newton method"
    petsc[petsc_options.PREFIX + name] = value or None
    with pytest.raises(OptionsError, match=message):
        petsc_options.refuse_exchanged()
    with pytest.raises(OptionsError, match=message), options_applied("other_", {}):
        pass
    petsc.delValue(petsc_options.PREFIX + name)
    with (
        pytest.raises(OptionsError, match=message),
        options_applied("other_", {name: value or None}),
    ):
        pass
    for other, kept in (
        ("snes_type", "newtonls"),
        ("snes_lag_jacobian", "1"),
        ("snes_mf", "false"),
    ):
        petsc[petsc_options.PREFIX + other] = kept
    petsc_options.refuse_exchanged()


@pytest.mark.parametrize("place", ["command line", "environment"])
def test_file_of_options(solve_text, monkeypatch, place):
    """They are not read."""
    arguments = ["-options_file", "petscrc"]
    if place == "environment":
        monkeypatch.setenv("PETSC_OPTIONS", " ".join(arguments))
        arguments = []
    code, errors = solve_text(SCENE, "--", *arguments)
    assert code == 2
    assert "PETSc option -options_file: files of options are not read" in errors


# --- mesh files -----------------------------------------------------------------------------------

INP = (
    "*NODE\n1, 0, 0\n2, 1, 0\n3, 1, 1\n4, 0, 1\n*ELEMENT, TYPE=CPE3, ELSET=body\n1, 1, 2, 3\n2, "
    "1, 3, 4\n"
)
DOUBLED = "".join(f"*ELSET, ELSET=s{k}\ns{k - 1}, s{k - 1}\ns{k - 1}\n" for k in range(1, 200))


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ("*NSET, NSET=a\n1, 2\n*NSET, NSET=a\na\n", "line 11, *NSET: set 'a' contains itself"),
        ("*NSET, NSET=a\na, a\n", "line 9, *NSET: set 'a' contains itself"),
        (
            "*NSET, NSET=a, GENERATE\n1, 1000000000000\n",
            "line 9, *NSET: set 'a': 1 to 1000000000000 by 1 is not",
        ),
        ("*ELSET, ELSET=a, GENERATE\n1, 1" + "0" * 40 + ", 2\n", "is not a possible range"),
        ("*NSET, NSET=a, GENERATE\n1, 4, 0\n", "1 to 4 by 0 is not"),
        ("*SURFACE, NAME=s\n1, S4\n", "surface 's': element 1 is a triangle and has no face S4"),
        ("*SURFACE, NAME=s\nbody, S9\n", "surface 's': element 1 is a triangle and has no face S9"),
        ("*SURFACE, NAME=s\n1, S0\n", "element 1 is a triangle and has no face S0"),
    ],
)
def test_inp(tmp_path, more, message):
    """The line of the keyword is named."""
    file = tmp_path / "body.inp"
    file.write_text(INP + more)
    begin = time.process_time()
    with pytest.raises(MeshError) as caught:
        read_file(file)
    assert message in str(caught.value)
    assert time.process_time() - begin < LIMIT


def test_sets_of_sets(tmp_path):
    """A set that is named over and over has its members once, not two to the power of 200 times."""
    file = tmp_path / "body.inp"
    file.write_text(INP + "*ELSET, ELSET=s0\n1\n" + DOUBLED + "*SURFACE, NAME=foot\ns199, S1\n")
    mesh = read_file(file)
    assert mesh.regions["s199"].tolist() == [0]
    assert mesh.points[mesh.facets[mesh.boundaries["foot"][0]]].tolist() == [[0.0, 0.0], [1.0, 0.0]]


KEYWORDS = st.sampled_from(
    [
        "*NSET, NSET=a",
        "*ELSET, ELSET=b",
        "*NSET, NSET=a, GENERATE",
        "*SURFACE, NAME=s",
        "*SURFACE, TYPE=NODE, NAME=a",
    ]
)
ENTRIES = st.sampled_from(
    [
        "1",
        "2",
        "3",
        "4",
        "a",
        "b",
        "body",
        "S1",
        "S3",
        "S4",
        "S9",
        "E2",
        "SPOS",
        "-1",
        "0",
        "1e9",
        "9" * 14,
        "x.1",
        ",",
    ]
)
BLOCKS = st.lists(
    st.tuples(KEYWORDS, st.lists(ENTRIES, max_size=4).map(", ".join)).map("\n".join), max_size=8
)


@given(BLOCKS)
def test_random_inp(tmp_path_factory, blocks):
    """Sets and surfaces of anything are read or refused, soon."""
    file = tmp_path_factory.getbasetemp() / "random.inp"
    file.write_text(INP + "\n".join(blocks))
    begin = time.process_time()
    message = "random.inp: "
    try:
        read_file(file)
    except MeshError as error:
        message = str(error)
    assert "random.inp: " in message
    assert time.process_time() - begin < LIMIT


@pytest.fixture
def xdmf(tmp_path):
    """A mesh in XDMF whose text names its data file, and a function that makes that another one."""
    meshio = pytest.importorskip("meshio")
    pytest.importorskip("h5py")
    points = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    meshio.write(tmp_path / "body.xdmf", meshio.Mesh(points, [("quad", np.array([[0, 1, 2, 3]]))]))
    assert read_file(tmp_path / "body.xdmf").cells.shape == (1, 4)

    def naming(other):
        text = (tmp_path / "body.xdmf").read_text()
        assert "body.h5" in text
        (tmp_path / "other.xdmf").write_text(text.replace("body.h5", str(other)))
        return tmp_path / "other.xdmf"

    return naming


@pytest.mark.parametrize(
    ("named", "message"),
    [
        ("absent.h5", "meshio cannot read it as xdmf"),
        ("/etc/passwd", "meshio cannot read it as xdmf"),
        ("endless.h5", "meshio cannot read it as xdmf: Unable to allocate"),
    ],
)
def test_xdmf(tmp_path, xdmf, named, message):
    """Data are in a file that holds them."""
    import h5py

    with h5py.File(tmp_path / "endless.h5", "w") as file:
        file.create_dataset("data0", shape=(10**12, 2), chunks=(1000, 2), dtype=float)
    with pytest.raises(MeshError, match=message):
        read_file(xdmf(named))


# --- results --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    [
        "[" * 100_000,
        '{"a":' * 100_000,
        '{"status": "converged", "certificate": {}, "linear_solves": 1, "scene": '
        + "[" * 900
        + "]" * 900
        + "}",
        '{"status": NaN}',
    ],
    ids=["lists", "tables", "scene", "nan"],
)
def test_report_of_nested_json(tmp_path, run, text):
    """One line that says what to do."""
    (tmp_path / "summary.json").write_text(text)
    code, errors = run("report", tmp_path)
    assert code == 2
    assert len(errors.splitlines()) == 1
    assert "give a folder" in errors or "solve again" in errors


@pytest.mark.mpi
@pytest.mark.parametrize(
    "error", [SceneError([("a", "b")]), RuntimeError("a mistake of ours"), KeyboardInterrupt()]
)
def test_no_part_is_left(tmp_path_factory, error):
    """However a run ends."""
    path = COMM.bcast(tmp_path_factory.mktemp("results") if COMM.rank == 0 else None) / "out"

    def run():
        with ResultFolder(COMM, path, ()) as folder:
            assert folder.part.is_dir()
            COMM.barrier()
            raise error

    with pytest.raises(type(error)):
        run()
    COMM.barrier()
    assert not path.exists()


# --- the machine ----------------------------------------------------------------------------------


@pytest.fixture
def new_form(tmp_path, monkeypatch):
    """A form that no cache has, and what compiles it."""
    import ufl
    from dolfinx import fem, jit, mesh

    monkeypatch.setitem(jit.DOLFINX_DEFAULT_JIT_OPTIONS, "cache_dir", (str(tmp_path / "cache"), ""))
    domain = mesh.create_unit_square(MPI.COMM_SELF, 1, 1)

    def compile_it():
        with compilation.compiling():
            return fem.form(fem.Constant(domain, 1.0) * ufl.dx)

    return compile_it


def test_no_compiler(new_form, monkeypatch):
    """What a compilation takes is named."""
    monkeypatch.setenv("PATH", "/nowhere")
    with pytest.raises(MachineError, match="it takes a C compiler"):
        new_form()


@pytest.mark.slow
def test_ascii_locale_and_another_alphabet(tmp_path):
    """Folders of any name, in a locale that knows ASCII only."""
    folder = tmp_path / "größe"
    folder.mkdir()
    (folder / "scene.toml").write_text('title = "Größe"\n' + SCENE, encoding="utf-8")
    environment = os.environ | {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"}
    command = [
        sys.executable,
        "-m",
        "signorini_fx",
        "solve",
        folder / "scene.toml",
        "--out",
        folder / "out",
    ]
    ended = subprocess.run(
        [*command, "--no-pictures"], env=environment, capture_output=True, timeout=120, check=False
    )
    assert ended.returncode == 0, ended.stderr
    assert b"converged" in ended.stdout
    assert json.loads((folder / "out" / "summary.json").read_bytes())["title"] == "Größe"
    command = [sys.executable, "-m", "signorini_fx", "report", folder / "out"]
    ended = subprocess.run(command, env=environment, capture_output=True, timeout=120, check=False)
    assert ended.returncode == 0, ended.stderr


@pytest.mark.slow
@pytest.mark.parametrize("arguments", [["schema"], ["solve", "--help"]])
def test_nobody_reads_on(arguments):
    """``signorini-fx schema | head``: no complaint."""
    reading, writing = os.pipe()
    os.close(reading)
    command = [sys.executable, "-m", "signorini_fx", *arguments]
    ended = subprocess.run(command, stdout=writing, stderr=subprocess.PIPE, timeout=60, check=False)
    os.close(writing)
    assert (ended.returncode, ended.stderr) == (0, b"")
