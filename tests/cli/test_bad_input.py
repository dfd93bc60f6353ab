"""Bad input from the command line and in files: one message with its place, exit code 2, soon, and nothing left behind.

Each entry of the lists is a mistake that somebody made once; generated cases try the kind of mistake behind it.
"""

import argparse
import csv
import json
import os
import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from mpi4py import MPI
from petsc4py import PETSc
from scenes import example1

from signorini_fx.addons.pictures import deformed_body
from signorini_fx.addons.report import page
from signorini_fx.algebra.linalg import petsc_options
from signorini_fx.errors import MachineError, MeshError, OptionsError, OutputError, ResultError, SceneError
from signorini_fx.forms.options import applied
from signorini_fx.machine import compilation, petsc_start, requirements, result_files, terminal
from signorini_fx.machine.csv_text import as_name, as_text, write_csv
from signorini_fx.mechanics.mesh.files.formats import read_file
from signorini_fx.results import files
from signorini_fx.results.folder import ResultFolder
from signorini_fx.scenes import cli
from signorini_fx.scenes.cli.grammar import parsed_accuracy, parsed_budget
from signorini_fx.scenes.reading import parse_scene, parse_scene_text
from signorini_fx.scenes.solver import solve
from signorini_fx.solving.check.petsc_options import refuse_mistyped
from signorini_fx.tuned import LARGEST_NUMBER

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
        return run("solve", file, "--out", tmp_path / "out", "--no-pictures", "--no-fields", "--quiet", *arguments)

    return go


def changed(old, new):
    assert old in SCENE
    return SCENE.replace(old, new)


# --- scenes ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "arguments", "message"),
    [
        (changed('"0.001*x[0]"', '"1e200"'), (), "contact[0].gap: is 1e+200 at ("),
        (changed('"0.001*x[0]"', "1e200"), (), "contact[0].gap: must not be larger than 1e+60"),
        (changed("young = 5000.0", "young = 1e308"), (), "material.young: must not be larger than 1e+60"),
        (changed("young = 5000.0", "young = 1e-308"), (), "material.young: must not be smaller than 1e-60"),
        (changed("y = -20.0", 'y = "1e200*x[0]"'), (), "traction, body_force: an expression is not finite, or larger"),
        (SCENE + "[solver]\ngamma_n = 1e300\n", (), "solver.gamma_n: must not be larger than 1e+60"),
        (changed("nx = 6", "self = 1"), (), "mesh.parameters.self: unknown key; there are: length"),
        (
            changed("[mesh]", "[mesh]\nboundaries = {}"),
            (),
            "mesh.boundaries: unknown key; there are: generator, parameters",
        ),
        (changed("nx = 6", "comm = 1"), (), "mesh.parameters.comm: unknown key; there are: length"),
        (changed("nx = 6", "length = 9223372036854775808"), (), "the body is too thin"),
        (changed("nx = 6", 'nx = "six"'), ("--levels", "2"), "mesh.parameters.nx: must be"),
        ("solver = 3\n" + SCENE, ("--levels", "2"), "solver: must be a table"),
        ("accuracy = [1]\n" + SCENE, ("--accuracy", "0.1"), "accuracy: must be a table"),
        (".".join(["a"] * 30_000) + " = 1\n" + SCENE, (), "syntax: a key of more than 50 parts (at line 1)"),
        (
            SCENE + "[" + " . ".join(['"a b"'] * 30_000) + "]",
            (),
            f"syntax: a key of more than 50 parts (at line {SCENE.count(chr(10)) + 1})",
        ),
        (b"\xef\xbb\xbf" + changed("poisson = 0.4", "poisson = 0.6").encode(), (), "material.poisson: must be less"),
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


def test_twenty_thousand_mistakes(solve_text):
    """The first ones are shown, the others counted."""
    code, errors = solve_text("\n".join(f"gama_{n} = 1" for n in range(20_000)) + SCENE)
    assert code == 2
    lines = errors.splitlines()
    assert len(lines) == 21
    assert lines[-1] == "... and 19,980 more"


def test_all_mistakes_are_kept():
    """Python has all of them; a long line keeps both ends."""
    error = SceneError([(f"key{n}", "is wrong") for n in range(100)])
    assert len(error.problems) == 100
    assert str(error).endswith("... and 80 more")
    assert str(SceneError([("title", "x" * 9_000 + " is wrong")])).endswith("xx is wrong")
    assert len(str(MeshError("x" * 9_000))) < 1_100


@pytest.mark.parametrize("command", ["solve", "check", "report", "mesh-info", "new"])
def test_name_of_5000_characters(run, command):
    """No path is too long to be refused."""
    code, errors = run(command, "x" * 5_000)
    assert code == 2
    assert "Traceback" not in errors
    assert len(errors) < 2_000


def test_result_folder_of_5000_characters(tmp_path, run):
    """Nor is that of a result."""
    (tmp_path / "scene.toml").write_text(SCENE)
    code, errors = run("solve", tmp_path / "scene.toml", "--out", "x" * 5_000)
    assert code == 2
    assert "cannot be written: File name too long" in errors


MAGNITUDES = st.floats(-60, 60).map(lambda power: 10.0**power) | st.sampled_from([LARGEST_NUMBER, 1e-60, 1.0])


def ends_by_name(folder, young, gap, load, gamma, length):
    """Whatever numbers are allowed: a status with its numbers in JSON, or a message."""
    scene = parse_scene_text(
        changed("nx = 6", f"length = {length!r}, height = {length!r}, nx = 4")
        .replace("5000.0", repr(young))
        .replace("-20.0", repr(-load))
        .replace('"0.001*x[0]"', repr(gap))
        + f"[solver]\ngamma_n = {gamma!r}\nmax_iterations = 5\nmax_outer_iterations = 3\nfallbacks = false\n",
        Path("scene.toml"),
    )
    try:
        solution = solve(scene, MPI.COMM_SELF, check=False)
    except (SceneError, MeshError):
        return
    files.write_results(solution, folder, fields=False, pictures=False)
    summary = json.loads((folder / "summary.json").read_text(), parse_constant=pytest.fail)
    assert summary["status"] == solution.status.value


@pytest.mark.slow
@pytest.mark.parametrize("count", [25, 8])
def test_all_magnitudes(tmp_path_factory, count):
    """Of numbers drawn at random, and of the largest and smallest that are allowed."""
    drawn = dict.fromkeys(("young", "gap", "load", "gamma", "length"), MAGNITUDES)

    @settings(max_examples=count)
    @given(**drawn)
    @example(young=1e60, gap=1e60, load=1e60, gamma=1e60, length=1e59)
    @example(young=1e-60, gap=1e-60, load=1e-60, gamma=1e-60, length=1e-59)
    def every(**numbers):
        ends_by_name(tmp_path_factory.mktemp("out"), **numbers)

    every()


@settings(max_examples=100)
@given(st.lists(st.text("ab\"'.= \n[]", max_size=4), max_size=200).map("".join), st.integers(0, 3))
def test_keys_of_many_parts(text, copies):
    """Parts, quotes and dots in any order, many times over, are read or refused soon."""
    begin = time.process_time()
    with pytest.raises(SceneError):
        parse_scene_text(text * 20**copies, Path("scene.toml"))
    assert time.process_time() - begin < LIMIT


# --- what options of the command line mean ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "key", "value"),
    [
        *(
            ("60s", "seconds", 60.0),
            ("1.5min", "seconds", 90.0),
            ("2h", "seconds", 7200.0),
            (" 60 s ", "seconds", 60.0),
        ),
        *(("100MB", "memory", 0.1), ("4GB", "memory", 4.0), (".5GB", "memory", 0.5), ("1TB", "memory", 1000.0)),
    ],
)
def test_budget(text, key, value):
    """Seconds, minutes, hours; megabytes, gigabytes."""
    assert parsed_budget(text) == (key, pytest.approx(value, rel=1e-15))


@pytest.mark.parametrize("text", ["", "60", "s", "60 parsecs", "-1s", "1e3s", "1.2.3s", "infs", "4gb"])
def test_no_budget(text):
    """What is neither is refused."""
    with pytest.raises(argparse.ArgumentTypeError, match="5min or 2h, or a memory like 500MB"):
        parsed_budget(text)


def test_accuracy_in_per_cent(run):
    """2% is 0.02; what is no number is refused."""
    assert parsed_accuracy("2%") == parsed_accuracy("0.02") == parsed_accuracy(" 2 %") == 0.02
    code, errors = run("solve", "scene.toml", "--accuracy", "2 per cent")
    assert code == 2
    assert "a number like 0.05 or 5% is expected, got '2 per cent'" in errors


# --- PETSc options ---------------------------------------------------------------------------------------------------

TYPES = ("ksp_type", "pc_type", "snes_type", "snes_linesearch_type", "pc_factor_mat_solver_type", "ksp_norm_type")
WHOLE = ("snes_max_it", "ksp_max_it", "snes_lag_jacobian", "mat_mumps_icntl_14")
REAL = ("snes_rtol", "snes_atol", "snes_stol", "ksp_rtol", "ksp_atol", "ksp_divtol")
LOGICAL = ("ksp_initial_guess_nonzero", "ksp_error_if_not_converged", "ksp_diagonal_scale")
WATCHING = ("snes_monitor", "ksp_monitor", "ksp_view", "snes_converged_reason")
WORDS = st.text("abcdefghijklmnopqrstuvwxyz", min_size=3, max_size=8).map(lambda word: f"q{word}")
MISTYPED = st.tuples(st.sampled_from(TYPES + WHOLE + REAL + LOGICAL + WATCHING), WORDS) | st.tuples(
    st.sampled_from(WHOLE), st.floats(0.1, 0.9).map(str)
)
RIGHT = {
    "ksp_type": "cg",
    "snes_max_it": "20",
    "ksp_rtol": "1e-9",
    "pc_type": "jacobi",
    "snes_linesearch_type": "basic",
}


@pytest.fixture
def petsc():
    """PETSc's options, as they were before at the end."""
    found = PETSc.Options()
    yield found
    for name in found.getAll():
        if name.startswith(petsc_options.PREFIX) or name == "log_view":
            found.delValue(name)


@pytest.mark.mpi
@settings(max_examples=60)
@given(MISTYPED, st.sets(st.sampled_from(sorted(RIGHT))))
@example(("ksp_type", "nonsense"), set())
@example(("snes_rtol", "5"), set())
@example(("snes_max_it", "abc"), {"ksp_type"})
@example(("ksp_view", ":/nowhere/at/all"), {"ksp_type"})
def test_mistyped_option(mistake, others):
    """Among right ones the wrong one is named, on all ranks; nothing is computed before."""
    found = PETSc.Options()
    name, value = mistake
    assume(not ("mat_" in name and "pc_type" in others))  # no factorisation reads it then
    given_options = {key: RIGHT[key] for key in sorted(others)} | {name: value}
    for key, said in given_options.items():
        found[petsc_options.PREFIX + key] = said
    try:
        with pytest.raises(OptionsError, match=f"^PETSc option -sfx_{name} {value}: ."):
            refuse_mistyped(COMM)
        assert {key: found.getString(petsc_options.PREFIX + key) for key in given_options} == given_options
    finally:
        for key in given_options:
            found.delValue(petsc_options.PREFIX + key)


@pytest.mark.mpi
def test_right_options(petsc):
    """What PETSc takes is left to it."""
    for key, said in RIGHT.items():
        petsc[petsc_options.PREFIX + key] = said
    petsc["sfx_snes_monitor"] = None
    refuse_mistyped(COMM)
    assert all(petsc.hasName(petsc_options.PREFIX + key) for key in (*RIGHT, "snes_monitor"))


@pytest.mark.mpi
@pytest.mark.parametrize(
    "said",
    [
        *(f"snes_type {kind}" for kind in ("ngmres", "nrichardson", "qn", "ncg", "ngs", "anderson", "ms", "ksponly")),
        *("snes_mf", "snes_mf true", "snes_mf_operator", "snes_fd", "snes_fd_color"),
        *("snes_convergence_test default", "snes_lag_jacobian 2", "npc_snes_type ngmres"),
    ],
)
def test_options_that_exchange_the_method(petsc, said):
    """They are refused by name, in scenes and in forms; what leaves the method as it is, is not."""
    name, _, value = said.partition(" ")
    message = f"^PETSc option -sfx_{said}: it would take the place of the semi-smooth Newton method"
    petsc[petsc_options.PREFIX + name] = value or None
    with pytest.raises(OptionsError, match=message):
        refuse_mistyped(COMM)
    with pytest.raises(OptionsError, match=message), applied("other_", {}):
        pass
    petsc.delValue(petsc_options.PREFIX + name)
    with pytest.raises(OptionsError, match=message), applied("other_", {name: value or None}):
        pass
    for other, kept in (("snes_type", "newtonls"), ("snes_lag_jacobian", "1"), ("snes_mf", "false")):
        petsc[petsc_options.PREFIX + other] = kept
    refuse_mistyped(COMM)


@pytest.mark.mpi(slow=True)
def test_options_that_crash(petsc):
    """Eigenvalues that are estimated in no step: PETSc ends with a segmentation fault, which a small process takes."""
    petsc["sfx_ksp_rtol"] = "1e-9"
    petsc["sfx_mg_levels_ksp_max_it"] = "2"
    refuse_mistyped(COMM)
    petsc["sfx_mg_levels_esteig_ksp_max_it"] = "0"
    with pytest.raises(OptionsError, match=r"^PETSc option -sfx_mg_levels_esteig_ksp_max_it 0: PETSc crashes with it$"):
        refuse_mistyped(COMM)


@pytest.mark.mpi
def test_solve_looks_at_options_first(petsc):
    """In Python too."""
    petsc["sfx_snes_rtol"] = "5"
    with pytest.raises(OptionsError, match="-sfx_snes_rtol 5: Relative tolerance 5"):
        solve(example1(bound=1.5, nx=6, ny=2), COMM)


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "there is no such file"),
        ("[mesh]\nfile = 3\n", r"line 1 is no option, '\[mesh\]'"),
        ("# fine\n-sfx_ksp_type cg\nksp_type cg\n", "line 3 is no option, 'ksp_type'"),
    ],
)
@pytest.mark.parametrize("place", ["command line", "environment"])
def test_file_of_options(tmp_path_factory, monkeypatch, content, message, place):
    """PETSc would stop on the first rank only."""
    folder = COMM.bcast(tmp_path_factory.mktemp("options") if COMM.rank == 0 else None)
    if content is not None and COMM.rank == 0:
        (folder / "petscrc").write_text(content)
    given_options = ["-options_file", str(folder / "petscrc")]
    if place == "environment":
        monkeypatch.setenv("PETSC_OPTIONS", " ".join(given_options))
        given_options = []
    with pytest.raises(OptionsError, match=f"^PETSc option -options_file .*petscrc: {message}"):
        petsc_start.start_petsc(COMM, given_options)


@pytest.mark.one_quick
@pytest.mark.parametrize("ranks", [1, 3])
def test_mistyped_option_on_the_command_line(tmp_path, ranks):
    """Once, whatever the number of ranks, and nothing else but what mpirun adds."""
    (tmp_path / "scene.toml").write_text(SCENE)
    launcher = ["mpirun", "-n", str(ranks)] if ranks > 1 else []
    command = [*launcher, sys.executable, "-m", "signorini_fx", "solve", "scene.toml", "--out", "out"]
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("OMPI_COMM", "PMIX"))}
    ended = subprocess.run(
        [*command, "--", "-sfx_ksp_type", "nonsense"],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert ended.returncode == 2
    said = [line for line in ended.stderr.splitlines() if "PETSc" in line or "Traceback" in line or "unused" in line]
    assert said == [
        "signorini-fx: error: PETSc option -sfx_ksp_type nonsense: Unable to find requested KSP type nonsense"
    ]
    assert not (tmp_path / "out").exists()


# --- mesh files ------------------------------------------------------------------------------------------------------

INP = "*NODE\n1, 0, 0\n2, 1, 0\n3, 1, 1\n4, 0, 1\n*ELEMENT, TYPE=CPE3, ELSET=body\n1, 1, 2, 3\n2, 1, 3, 4\n"
DOUBLED = "".join(f"*ELSET, ELSET=s{k}\ns{k - 1}, s{k - 1}\ns{k - 1}\n" for k in range(1, 200))


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ("*NSET, NSET=a\n1, 2\n*NSET, NSET=a\na\n", "line 11, *NSET: set 'a' contains itself"),
        ("*NSET, NSET=a\na, a\n", "line 9, *NSET: set 'a' contains itself"),
        ("*NSET, NSET=a, GENERATE\n1, 1000000000000\n", "line 9, *NSET: set 'a': 1 to 1000000000000 by 1 is not"),
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
    ["*NSET, NSET=a", "*ELSET, ELSET=b", "*NSET, NSET=a, GENERATE", "*SURFACE, NAME=s", "*SURFACE, TYPE=NODE, NAME=a"]
)
ENTRIES = st.sampled_from(
    ["1", "2", "3", "4", "a", "b", "body", "S1", "S3", "S4", "S9", "E2", "SPOS", "-1", "0", "1e9", "9" * 14, "x.1", ","]
)
BLOCKS = st.lists(st.tuples(KEYWORDS, st.lists(ENTRIES, max_size=4).map(", ".join)).map("\n".join), max_size=8)


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
        ("pipe.h5", "no regular file 'pipe.h5'"),
        ("absent.h5", "no regular file 'absent.h5'"),
        ("/etc/passwd", "meshio cannot read it as xdmf"),
        ("endless.h5", "meshio cannot read it as xdmf: Unable to allocate"),
    ],
)
def test_xdmf(tmp_path, xdmf, named, message):
    """Data are in a regular file that holds them."""
    import h5py

    os.mkfifo(tmp_path / "pipe.h5")
    with h5py.File(tmp_path / "endless.h5", "w") as file:
        file.create_dataset("data0", shape=(10**12, 2), chunks=(1000, 2), dtype=float)
    with pytest.raises(MeshError, match=message):
        read_file(xdmf(named))


# --- results ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    [
        "[" * 100_000,
        '{"a":' * 100_000,
        '{"status": "converged", "certificate": {}, "linear_solves": 1, "scene": ' + "[" * 900 + "]" * 900 + "}",
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


def test_report_of_a_field_without_end(tmp_path):
    """The csv module has errors of its own."""
    (tmp_path / "contact.csv").write_text("x,y\n1," + "1" * 200_000)
    with pytest.raises(ValueError, match=r"contact\.csv, line 2: field larger"):
        result_files.read_csv(tmp_path / "contact.csv")
    with pytest.raises(ResultError):
        page.write_report(tmp_path)


@pytest.mark.parametrize("name", ["=cmd|' /C calc'!A0", "+1+1", "-1", "@SUM(A1)", "\tx", "'=x", "'", "-", "bottom"])
def test_formula(tmp_path, name):
    """A spreadsheet takes it for text, our own reader for the name; numbers are as they were."""
    rows = [{"x": -1.5, "boundary": name, "count": -3, "u": np.float64(-2e-300)}]
    write_csv(tmp_path / "a.csv", rows)
    (row,) = csv.DictReader((tmp_path / "a.csv").read_text().splitlines())
    assert not row["boundary"].startswith(("=", "+", "-", "@", "\t", "\r"))
    assert (row["x"], row["count"], row["u"]) == ("-1.5", "-3", "-2e-300")
    assert result_files.read_csv(tmp_path / "a.csv")["boundary"].tolist() == [name]


@given(st.text("=+-@'\tab"))
def test_any_name_comes_back(name):
    """As text and back it is the same."""
    assert as_name(as_text(name)) == name
    assert not as_text(name).startswith(("=", "+", "-", "@", "\t"))


@pytest.mark.slow
def test_full_disk(tmp_path):
    """Where the results have no room there is one error, and nothing is left; where the pictures have none, though
    matplotlib fails in ways of its own, the results are there, with a warning that says why, and no half picture.
    """
    solution = solve(example1(bound=1.5, nx=6, ny=2), MPI.COMM_SELF)
    files.write_results(solution, tmp_path / "first", fields=False)  # compiles its forms, while there is room for them
    codes = []
    for limit in (2_000, 4_000, 12_000, 20_000, 40_000):
        out = tmp_path / f"out {limit}"
        child = os.fork()
        if child == 0:
            code = 1
            try:
                resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
                try:
                    files.write_results(solution, out, fields=False)
                    code = 0
                except OutputError as error:
                    code = 3 if "cannot be written: File too large" in str(error) else 2
            finally:
                os._exit(code)
        codes.append(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
        if codes[-1] == 3:
            assert not out.exists()
        else:
            findings = json.loads((out / "summary.json").read_text())["findings"]
            assert "File too large" in next(row["message"] for row in findings if row["path"] == "pictures")
            assert not list(out.glob("*.png"))
    assert codes == sorted(codes, reverse=True)
    assert {*codes} == {0, 3}


def test_errors_of_the_system_under_others(tmp_path, monkeypatch):
    """What matplotlib raises when it closes a file that a full disk has cut off hides the reason, which is said."""

    def closing(file):
        try:
            raise OSError(28, "No space left on device")
        finally:
            file.pos += 1  # as matplotlib's Stream does

    def draw(*arguments, **options):
        closing(object())

    solution = solve(example1(bound=1.5, nx=6, ny=2), MPI.COMM_SELF)
    for drawing, reason in ((draw, "No space left on device"), (lambda *arguments, **options: 1 / 0, "ZeroDivision")):
        monkeypatch.setattr(deformed_body, "deformed_mesh", drawing)
        summary = files.write_results(solution, tmp_path / "out", fields=False)
        assert reason in next(row["message"] for row in summary["findings"] if row["path"] == "pictures")


@pytest.mark.mpi
@pytest.mark.parametrize("error", [SceneError([("a", "b")]), RuntimeError("a mistake of ours"), KeyboardInterrupt()])
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


# --- the machine -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("limit", "option"), [(resource.RLIMIT_AS, "-v"), (resource.RLIMIT_DATA, "-d")])
def test_small_memory(monkeypatch, limit, option):
    """Said at once: the libraries would wait for ever."""
    real = resource.getrlimit
    monkeypatch.setattr(resource, "getrlimit", lambda which: (300 << 20, -1) if which == limit else real(which))
    with pytest.raises(MachineError, match=rf"limited to 315 MB \(ulimit {option}\): at least .* raise the limit"):
        requirements.check_machine()


def test_small_memory_on_the_command_line(tmp_path):
    """Before anything is imported that would not return."""
    command = [sys.executable, "-m", "signorini_fx", "solve", "scene.toml"]
    ended = subprocess.run(
        ["sh", "-c", 'ulimit -v 300000; exec "$@"', "sh", *command],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert ended.returncode == 2
    (line,) = ended.stderr.splitlines()
    assert line.startswith("signorini-fx: error: the memory of each process is limited to 307 MB (ulimit -v)")


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
    """It is named, with how to get one."""
    monkeypatch.setenv("PATH", "/nowhere")
    with pytest.raises(MachineError, match=r"there is no C compiler, '.*' is not on PATH: install one"):
        new_form()


def test_no_folder_for_compiled_forms(tmp_path, new_form):
    """A home that cannot be made: what to set is said."""
    (tmp_path / "cache").write_text("a file")
    with pytest.raises(MachineError, match=r"folder of compiled forms cannot be written .*: set XDG_CACHE_HOME"):
        new_form()


def test_mistakes_of_ours_are_not_the_machine():
    """What is none of its faults passes."""
    with pytest.raises(ZeroDivisionError), compilation.compiling():
        raise ZeroDivisionError


def test_environment_without_a_home():
    """./env says so in one line."""
    environment = {"PATH": os.environ["PATH"], "HOME": "/proc/nowhere", "DEBIAN": "trixie"}
    env = Path(__file__).parents[2] / "env"
    ended = subprocess.run(
        [str(env), "true"], env=environment, cwd=env.parent, capture_output=True, text=True, timeout=60, check=False
    )
    assert ended.returncode == 2
    (line,) = ended.stderr.splitlines()
    assert line.startswith("env: cannot write /proc/nowhere/.cache/signorini_fx/trixie-")
    assert line.endswith(": set XDG_CACHE_HOME to a folder that can be written")


DOCKER = """#!/bin/sh
echo "docker $*" >> "$CALLS"
case "$1 $2" in
    "image inspect") exec test -e "$STATE/$(echo "$3" | tr / _)" ;;
    "pull -q") exit 1 ;;
    import*) touch "$STATE/$(echo "$5" | tr / _)" ;;
    build*) case "$*" in *"--network host") touch "$STATE/built" ;; *) exit 1 ;; esac ;;
esac
"""


def test_docker_without_a_registry(tmp_path):
    """Its base is made of Debian's archive, and its build has the host's network, where there is no other way."""
    tools = tmp_path / "tools"
    tools.mkdir()
    scripts = {
        "docker": DOCKER,
        "mmdebstrap": '#!/bin/sh\necho "mmdebstrap $*" >> "$CALLS"\nfor last; do :; done\n: > "$last"',
    }
    for name, script in scripts.items():
        (tools / name).write_text(script)
        (tools / name).chmod(0o755)
    env = Path(__file__).parents[2] / "env"
    environment = {"PATH": f"{tools}:{os.environ['PATH']}", "HOME": str(tmp_path), "DEBIAN": "trixie"}
    environment |= {"CALLS": str(tmp_path / "calls"), "STATE": str(tmp_path)}
    ended = subprocess.run(
        [str(env), "true"], env=environment, cwd=env.parent, capture_output=True, text=True, timeout=60, check=False
    )
    assert ended.returncode == 0, ended.stderr
    calls = [line.split() for line in (tmp_path / "calls").read_text().splitlines()]
    done = [call[:2] for call in calls if call[1] not in ("info", "image")]
    assert [" ".join(call) for call in done if call[0] == "docker"] == [
        *("docker pull", "docker import", "docker build", "docker build", "docker run")
    ]
    made, imported = (next(call for call in calls if word in call[:2]) for word in ("mmdebstrap", "import"))
    assert made[-1] == imported[-2]
    assert imported[-1] == "docker.io/library/debian:trixie-slim"
    assert not Path(made[-1]).exists()
    assert "building localhost/signorini_fx:" in ended.stderr


def test_ascii_locale_and_another_alphabet(tmp_path):
    """Folders of any name, in a locale that knows ASCII only."""
    folder = tmp_path / "größe"
    folder.mkdir()
    (folder / "scene.toml").write_text('title = "Größe"\n' + SCENE, encoding="utf-8")
    environment = os.environ | {"LC_ALL": "C", "PYTHONCOERCECLOCALE": "0", "PYTHONUTF8": "0"}
    command = [sys.executable, "-m", "signorini_fx", "solve", folder / "scene.toml", "--out", folder / "out"]
    ended = subprocess.run([*command, "--no-pictures"], env=environment, capture_output=True, timeout=120, check=False)
    assert ended.returncode == 0, ended.stderr
    assert b"converged" in ended.stdout
    assert json.loads((folder / "out" / "summary.json").read_bytes())["title"] == "Größe"
    command = [sys.executable, "-m", "signorini_fx", "report", folder / "out"]
    ended = subprocess.run(command, env=environment, capture_output=True, timeout=120, check=False)
    assert ended.returncode == 0, ended.stderr


@pytest.mark.one_quick
@pytest.mark.parametrize("arguments", [["schema"], ["solve", "--help"]])
def test_nobody_reads_on(arguments):
    """``signorini-fx schema | head``: no complaint."""
    reading, writing = os.pipe()
    os.close(reading)
    command = [sys.executable, "-m", "signorini_fx", *arguments]
    ended = subprocess.run(command, stdout=writing, stderr=subprocess.PIPE, timeout=60, check=False)
    os.close(writing)
    assert (ended.returncode, ended.stderr) == (0, b"")


def test_terminal_takes_any_text(capsys, monkeypatch):
    """What its encoding does not have is escaped."""
    import io as streams

    stream = streams.TextIOWrapper(streams.BytesIO(), encoding="ascii")
    monkeypatch.setattr(sys, "stdout", stream)
    terminal.prepare()
    terminal.say("größe \udcff")
    assert stream.buffer.getvalue() == b"gr\\xf6\\xdfe \\udcff\n"


@pytest.mark.slow
def test_all_that_the_mesh_reveals_at_once():
    """Names, dimension and elements are looked at together."""
    scene = parse_scene(
        {
            "mesh": {"generator": "rectangle", "parameters": {"nx": 2, "ny": 2, "cell": "triangle"}},
            "element": {"volumetric": "reduced"},
            "material": {"young": 1.0, "poisson": 0.3, "region": "steel"},
            "displacement": [{"boundary": "above", "x": 0.0}, {"boundary": "top", "z": 0.0}],
            "traction": {"boundary": "left", "x": "x[2]"},
            "contact": {"boundary": "below", "direction": [0.0, 0.0, -1.0]},
        }
    )
    with pytest.raises(SceneError) as caught:
        solve(scene, COMM)
    assert {path for path, _ in caught.value.problems} == {
        *("element.volumetric", "material[0].region", "displacement[0].boundary", "displacement[1].z"),
        *("traction[0].x", "contact[0].boundary", "contact[0].direction"),
    }
