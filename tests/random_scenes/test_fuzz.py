"""Scenes, expressions and mesh files that are spoilt at random, and what such have found."""

import multiprocessing
import os
import random
import re
import resource
import signal
import sys
from pathlib import Path

import meshio
import numpy as np
import pytest
from mesh_files import write_msh
from mpi4py import MPI

from signorini_fx.errors import MeshError, SceneError
from signorini_fx.mechanics.mesh.tagged import read_mesh
from signorini_fx.mechanics.statement.expressions import Expression
from signorini_fx.scenes.reading import parse_scene_text
from signorini_fx.scenes.template import starting_scene

DEMOS = sorted((Path(__file__).parents[2] / "demos" / "scenes").glob("*.toml"))
NUMBERS = (
    "0",
    "-1",
    "1",
    "3",
    "1e9",
    "1_000_000_000",
    "-1e400",
    "1e-320",
    "nan",
    "inf",
    "2147483648",
    "9" * 30,
)
_HUGE = "0x" + "f" * 5000
VALUES = (
    *NUMBERS, _HUGE, "true", '""', "[]", "{}", "[[[[]]]]", "1979-05-27", '"auto"', "'x[0]'", '"x[2]"', '"1/0"',
    '"__import__(\'os\').system(\'touch PWNED\')"', '"open(\'PWNED\', \'w\')"', '"x.__class__"', '"9**9**9**9"',
    '"(lambda: 0)()"', '"[c for c in x]"',
    '"x[0]"' + "  # " + "y" * 3000, '"' + "(" * 500 + '"', '"' + "-" * 1500 + '1"',
    '"' + "x[0]+" * 350 + '1"', '"1e308*1e308"', '"2**100**2"', '"\\u0000"', '"/dev/zero"', '"../../etc/passwd"',
)  # fmt: skip
EXPRESSIONS = (
    "x[0]", "x[1]", "pi", "1", "0.5", "1e308", "-", "+", "*", "/", "**", "(", ")", "<", "<=", "and", "or", "not", "if",
    "else", "where(", "min(", "max(", "sqrt(", "log(", "abs(", ",", "&", "|", "~", "^", "%", "//", "@", ":=", "lambda",
    "[", "]", "{", "}", ".", "'", '"', "\\", "\n", "\t", "x", "x[", "x[-1]", "__class__", "import", "await", "f''",
    "0x", "1j", "1_0", "...", "é", "\x00", "\ud800", "=", "==", "!=", "is", "in", "*x", "yield",
)  # fmt: skip
GEO = """
SetFactory("OpenCASCADE");
Rectangle(1) = {0, 0, 0, 3, 1};
Transfinite Curve{1, 3} = 7; Transfinite Curve{2, 4} = 3; Transfinite Surface{1};
Physical Surface("body") = {1}; Physical Curve("bottom") = {1}; Physical Curve("top") = {3};
"""


def spoilt_bytes(data, chance):
    """Bytes changed, cut out, cut off, repeated, or replaced altogether."""
    found = bytearray(data)
    match chance.randrange(6):
        case 0:
            for _ in range(chance.randrange(1, 8)):
                found[chance.randrange(len(found))] = chance.randrange(256)
        case 1:
            start = chance.randrange(len(found))
            del found[start : start + chance.randrange(1, 200)]
        case 2:
            del found[chance.randrange(len(found)) :]
        case 3:
            start, end = chance.randrange(len(found)), chance.randrange(len(found))
            found[start:start] = found[end : end + chance.randrange(1, 200)]
        case 4:
            lines = bytes(found).split(b"\n")
            where = chance.randrange(len(lines))
            words = lines[where].split(b" ")
            words[chance.randrange(len(words))] = chance.choice(NUMBERS).encode()
            lines[where] = b" ".join(words)
            return b"\n".join(lines)
        case _:
            return chance.randbytes(chance.randrange(1, 400))
    return bytes(found)


def spoilt_text(text, chance):
    """A scene with values exchanged, or lines lost, doubled and mixed; or anything."""
    lines = text.splitlines()
    match chance.randrange(5):
        case 0 | 1:
            places = [k for k, line in enumerate(lines) if re.match(r"\s*#?\s*\w+ *=", line)]
            for _ in range(chance.randrange(1, 4)):
                where = chance.choice(places)
                key = lines[where].split("=")[0].lstrip("# ")
                lines[where] = f"{key}= {chance.choice(VALUES)}"
        case 2:
            del lines[chance.randrange(len(lines))]
            lines.insert(chance.randrange(len(lines)), chance.choice(lines))
        case 3:
            chance.shuffle(lines)
        case _:
            return spoilt_bytes(text.encode(), chance).decode("utf-8", "replace")
    return "\n".join(lines)


def spoilt_expression(chance):
    """An expression, one with something out of place, or pieces of expressions in any order."""
    match chance.randrange(3):
        case 0:
            return _expression(chance, 5)
        case 1:
            text = _expression(chance, 4)
            where = chance.randrange(len(text))
            return text[:where] + chance.choice(EXPRESSIONS) + text[where + chance.randrange(3) :]
    return "".join(chance.choice(EXPRESSIONS) for _ in range(chance.randrange(1, 30)))


def _expression(chance, depth):
    """A number made of coordinates, numbers and functions, in the syntax of scenes."""
    if depth == 0 or chance.random() < 0.2:
        return chance.choice(("x[0]", "x[1]", "pi", "0", "1", "-2.5", "1e300", "1e-300", "0.1"))
    a, b, c, d = (_expression(chance, depth - 1) for _ in range(4))
    condition = f"({a}) {chance.choice(('<', '<=', '>', '>='))} ({b})"
    function = chance.choice(("abs", "cos", "exp", "log", "sign", "sin", "sqrt", "tan", "tanh"))
    return chance.choice(
        (
            f"({a}) {chance.choice('+-*/')} ({b})",
            f"({a})**{chance.choice(('2', '-1', '0.5', '100', '0'))}",
            f"{function}({a})",
            f"{chance.choice(('min', 'max'))}({a}, {b})",
            f"where({condition}, {c}, {d})",
            f"({c} if {condition} else {d})",
            f"({c} if not {condition} and ({a}) < 1 < ({d}) else {b})",
        )
    )


def test_spoilt_texts():
    """An error with its place, or numbers; nothing is executed, nothing is imported."""
    bases, executed, watching = [starting_scene(), *(path.read_text() for path in DEMOS)], [], False
    watched = {
        "os.system",
        "os.exec",
        "os.posix_spawn",
        "subprocess.Popen",
        "import",
        "open",
        "socket.connect",
    }

    def watch(event, arguments):
        if watching and (event in watched or (event == "exec" and "PWNED" in repr(arguments))):
            executed.append(f"{event} {arguments}"[:200])

    def read(number):
        chance, refusal = random.Random(number), None
        try:
            parse_scene_text(spoilt_text(chance.choice(bases), chance), Path("scene.toml"))
        except SceneError as error:
            refusal = error
        if refusal is not None:
            assert refusal.problems
            assert all(path.strip() and len(message) > 5 for path, message in refusal.problems), (
                number
            )
            assert len(str(refusal)) < 20_000
        try:
            function = Expression(spoilt_expression(chance))
        except ValueError:
            return
        assert function(np.array([[0.0, 0.3, 3.0], [0.0, 1.0, 0.5]])).shape == (3,)

    for number in range(600):
        read(number)  # imports what the scene names
    sys.addaudithook(watch)
    for number in range(600):
        watching = True
        read(number)
        watching = False
    assert executed == []


def harmless(file, seconds=30, memory=4 << 30):
    """Read a mesh in a process of its own, which gmsh may break."""
    for number in (signal.SIGSEGV, signal.SIGABRT, signal.SIGFPE, signal.SIGBUS):
        signal.signal(number, signal.SIG_DFL)  # PETSc would end all of MPI
    resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
    resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    try:
        tagged = read_mesh(file, MPI.COMM_SELF)
    except MeshError as refusal:
        os._exit(0 if str(file) in str(refusal) else 1)
    os._exit(0 if tagged.boundaries and np.isfinite(tagged.mesh.geometry.x).all() else 1)


@pytest.mark.parametrize("form", ["text", "binary"])
def test_spoilt_meshes(tmp_path, form):
    """They are refused by their name, or are meshes, or gmsh breaks; another error, and no end, are
    mistakes.
    """
    geo, sound, file = tmp_path / "body.geo", tmp_path / "body.msh", tmp_path / "spoilt.msh"
    geo.write_text(GEO)
    write_msh(geo, sound)
    if form == "binary":
        meshio.write(sound, meshio.read(sound), file_format="gmsh22", binary=True)
    codes = []
    for number in range(15):
        file.write_bytes(spoilt_bytes(sound.read_bytes(), random.Random(number)))
        child = multiprocessing.get_context("fork").Process(target=harmless, args=(file,))
        child.start()
        child.join(60)
        child.kill()
        child.join()
        codes.append(child.exitcode)
    assert max(codes) == 0  # those below it are signals that ended gmsh
    assert -signal.SIGKILL not in codes
    assert 0 in codes


@pytest.mark.parametrize(
    "key", ["young", "poisson", "nx", "gamma_n", "levels", "coefficient", "kind", "x"]
)
def test_number_of_thousands_of_digits(key):
    """TOML takes it in hexadecimal, and Python will not print it."""
    lines = [
        line.lstrip("# ") if line.lstrip("# ").startswith(f"{key} ") else line
        for line in starting_scene().split("\n")
    ]
    text = "\n".join(
        f"{key} = 0x{'f' * 5000}" if line.startswith(f"{key} ") else line for line in lines
    )
    try:
        parse_scene_text(text, Path("scene.toml"))
    except SceneError as refusal:
        for path, message in refusal.problems:
            assert path
            assert "Exceeds the limit" not in message
            assert len(message) < 1000


MESH = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
2
1 1 "bottom"
2 2 "body"
$EndPhysicalNames
$Nodes
NODES
$EndNodes
$Elements
ELEMENTS
$EndElements
"""
NODES = "4\n1 0 0 0\n7 1 0 0\n9 1 1 0\n20 0 1 0"
ELEMENTS = "2\n1 1 2 1 1 1 7\n2 3 2 2 1 1 7 9 20"


def test_numbers_with_holes(tmp_path):
    """Nodes may have any numbers."""
    file = tmp_path / "body.msh"
    file.write_text(
        MESH.replace("NODES", NODES, 1).replace("$NODES", "$Nodes").replace("ELEMENTS", ELEMENTS)
    )
    tagged = read_mesh(file, MPI.COMM_SELF)
    assert tagged.mesh.topology.index_map(2).size_local == 1
    assert tagged.facets("bottom").size == 1


def test_nodes_outside_the_body(tmp_path):
    """Nodes that no cell has, and facets of them, are left behind: dolfinx does not survive
    them.
    """
    file = tmp_path / "body.msh"
    elements = ELEMENTS.replace("2\n", "3\n", 1) + "\n3 1 2 1 1 20 30"
    nodes = NODES.replace("4\n", "5\n") + "\n30 0 9 0"
    file.write_text(MESH.replace("\nNODES", "\n" + nodes).replace("ELEMENTS", elements))
    tagged = read_mesh(file, MPI.COMM_SELF)
    assert tagged.mesh.geometry.x.shape == (4, 3)
    assert tagged.facets("bottom").size == 1


@pytest.mark.parametrize(
    ("nodes", "elements", "message"),
    [
        (NODES.replace("9 1 1 0", "9 1 1 0.5"), ELEMENTS, r"plane x\[2\]"),
        (NODES.replace("9 1 1 0", "9 nan 1 0"), ELEMENTS, "body.msh"),
        (NODES.replace("9 1 1 0", "9 0.5 0 0"), ELEMENTS, "corner without an angle"),
        (NODES.replace("9 1 1 0", "9 0.2 0.2 0"), ELEMENTS, "folded"),
        (NODES, ELEMENTS.replace("1 7 9 20", "1 7 9 21"), "body.msh"),
        (NODES, ELEMENTS.replace("2 3 2 2 1", "2 16 2 2 1"), "body.msh"),
        (
            NODES,
            "4\n1 1 2 1 1 1 7" + "".join(f"\n{k} 3 2 2 1 1 7 9 20" for k in (2, 3, 4)),
            "belongs to 3 cells",
        ),
        (
            NODES,
            ELEMENTS.replace("2\n", "3\n", 1) + "\n3 3 2 5 1 1 7 9 20",
            "format 2.2 has cells twice",
        ),
        (NODES, "1\n2 3 2 2 1 1 7 9 20", "no named boundary"),
        (NODES, "1\n1 1 2 1 1 1 7", "dimension 2"),
        (NODES.replace("4\n", "1000000000\n"), ELEMENTS, "body.msh"),
        (NODES, ELEMENTS.replace("2\n1", "1000000000\n1"), "body.msh"),
    ],
)
def test_broken_mesh(tmp_path, nodes, elements, message):
    """Each ends in an error that names the file, soon."""
    file = tmp_path / "body.msh"
    file.write_text(MESH.replace("\nNODES", "\n" + nodes).replace("ELEMENTS", elements))
    with pytest.raises(MeshError, match=message):
        read_mesh(file, MPI.COMM_SELF)
