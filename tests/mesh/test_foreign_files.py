"""Files of other programs run nothing: no command is started, no other file is read, none is written.

Two layers see to that, the translation of scripts and the sandbox of the process that reads; each is tested alone.
"""

import json
import re
import subprocess
import sys
from contextlib import suppress
from importlib import metadata
from pathlib import Path

import attacks
import h5py
import numpy as np
import pytest

from signorini_fx.errors import MeshError
from signorini_fx.mechanics.mesh.files import gmsh_files, reading, sandbox
from signorini_fx.mechanics.mesh.files.formats import read_file
from signorini_fx.mechanics.mesh.files.gmsh_script import Script, translated

HERE = Path(__file__).parents[1]
RUN = reading._run  # the program itself, from before any fixture
SQUARE = """
Point(1) = {0, 0, 0, 1}; Point(2) = {1, 0, 0, 1}; Point(3) = {1, 1, 0, 1}; Point(4) = {0, 1, 0, 1};
Line(1) = {1, 2}; Line(2) = {2, 3}; Line(3) = {3, 4}; Line(4) = {4, 1}; Curve Loop(1) = {1:4}; Plane Surface(1) = {1};
"""


def run(*arguments):
    """Run the attacks in a separate process."""
    command = [sys.executable, attacks.__file__, *map(str, arguments)]
    return json.loads(subprocess.run(command, check=True, capture_output=True, timeout=500).stdout)


@pytest.fixture(params=[True, False], ids=["sandbox", "no sandbox"])
def either_way(request, monkeypatch):
    """With the sandbox, read by the program itself as for users; and by a fork on a system without a sandbox."""
    monkeypatch.setattr(reading, "SANDBOX", request.param)
    if request.param:
        monkeypatch.setattr(reading, "_run", RUN)


# --- scripts ---------------------------------------------------------------------------------------------------------


def refusal(file):
    """Why a script is not translated."""
    with pytest.raises(MeshError) as caught:
        translated(file)
    return str(caught.value)


def test_attacks_on_the_translation(tmp_path):
    """Every command in every disguise is refused with its line."""
    file = tmp_path / "script.geo"
    for text in attacks.scripts(len(attacks.COMMANDS) * len(attacks.DISGUISES)):
        file.write_text(text, encoding="utf-8")
        assert re.search(r"script\.geo: line \d+: .* is not allowed in a script", refusal(file), re.DOTALL)


def test_nothing_of_the_user_is_in_a_translation(tmp_path):
    """In place of names and texts there are numbered words, so that it does not matter what gmsh takes them for."""
    file = tmp_path / "script.geo"
    names = ["SystemCall", "Include", "Merge", "Exit", "endEndIf", "ListFromFile", "x"]
    texts = [f"System {attacks.TOUCH}", "EndIf Exit;", "// /*", "%s %n", "OpenCASCADE", "ü", "x" * 255]
    file.write_text(
        f"// SystemCall '{attacks.TOUCH}'\n/* Exit;\n' */ SetFactory('OpenCASCADE'); Box(1) = {{0, 0, 0, 1, 1, 1}};\n"
        + "".join(f"{name} = 1; {name}[] += {{{name}}};\n" for name in names)
        + "".join(f'Physical Surface("{text}") = {{{k}}};\n' for k, text in enumerate(texts, start=1))
        + "If (x > 2)\nMesh.MeshSizeMax = x;\nEndIf\nGeneral.Terminal = 1;\n"
    )
    script = translated(file)
    assert script.text.count("\n") == file.read_text().count("\n")
    assert script.original(" ".join(f"s{k}" for k in range(8, 15))) == " ".join(texts)
    assert set(re.findall(r"[\"']([^\"']*)[\"']", script.text)) == {"OpenCASCADE", *(f"s{k}" for k in range(8, 15))}
    words = {word for word in re.findall(r"[A-Za-z_]\w*", script.text) if not re.fullmatch(r"[sv]\d+", word)}
    drawing = {"SetFactory", "OpenCASCADE", "Box", "Physical", "Surface", "If", "EndIf"}
    assert words == drawing | {"Mesh", "MeshSizeMax", "General", "Terminal"}


@pytest.mark.parametrize("text", ["", "x" * 256, "tab\t", "two\nlines"])
def test_texts_that_are_no_names(tmp_path, text):
    """Those that gmsh could end early, or that cannot be read in a list of names."""
    file = tmp_path / "script.geo"
    for command in (f'Physical Point("{text}") = {{1}};\n', f'SetFactory("{text}");\n'):
        file.write_text(command)
        assert "line 1:" in refusal(file)


@pytest.mark.slow
@pytest.mark.skipif("seccomp" not in sandbox.available(), reason="the system has no seccomp")
@pytest.mark.parametrize("count", [200, 60])
def test_attacks_on_the_sandbox(tmp_path, count):
    """So many scripts that nobody has looked at do nothing in the sandbox; outside, many of them do."""
    attacks.prepare(tmp_path)
    inside = run(tmp_path, count, 1)
    assert len(inside) == count
    assert [one for one in inside if one["left"]] == []
    if "Landlock" in sandbox.available():
        assert [one for one in inside if one["read"]] == []
    outside = run(tmp_path, 60, 0)
    assert sum(bool(one["left"]) for one in outside) > 15
    if metadata.version("gmsh") < "4.15":  # which does what these scripts read with no more
        assert sum(one["read"] for one in outside) > 0


@pytest.mark.parametrize("command", attacks.COMMANDS, ids=lambda command: command.split("\n")[0][:30])
def test_commands_are_named(tmp_path, command):
    """The message names a word of the command and its line."""
    file = tmp_path / "script.geo"
    file.write_text(f'// SystemCall "in a comment"\nlc = 1;\n{command}\n')
    word = re.search(r"script\.geo: line [34]: ([\w.]+) is not allowed in a script", refusal(file))[1]
    assert word.split(".")[-1] in command


def test_scripts_are_drawn_as_they_are(tmp_path, monkeypatch):
    """gmsh makes the same mesh of a script and of its translation; names may have any letters."""
    text = (HERE / "data" / "three_feet.geo").read_text(encoding="utf-8")
    text = text.replace("Mesh.MeshSizeMax = 20", "Mesh.MeshSizeMax = 60").replace('"body"', "'the \"body\", größer'")
    file = tmp_path / "feet.geo"
    file.write_text("\ufeff" + text.replace("\n", "\r\n"), encoding="utf-8")
    ours = read_file(file)
    monkeypatch.setattr(gmsh_files, "translated", lambda _: Script(text.replace("größer", "s99"), {"s99": "größer"}))
    theirs = read_file(file)
    np.testing.assert_array_equal(ours.points, theirs.points)
    np.testing.assert_array_equal(ours.cells, theirs.cells)
    assert list(ours.regions) == list(theirs.regions) == ['the "body", größer']
    assert {name: rows.tolist() for name, rows in ours.boundaries.items()} == {
        name: rows.tolist() for name, rows in theirs.boundaries.items()
    }


def test_messages_in_the_words_of_the_script(tmp_path):
    """What gmsh complains about has the names of the script, and its lines."""
    file = tmp_path / "wrong.geo"
    file.write_text(f"{SQUARE}width = 3;\nPoint(7) = {{width, heigth_, 0}};\nheigth_[] += 1;\n")
    with pytest.raises(MeshError, match=r"wrong\.geo: gmsh cannot read it: .*line 5.*heigth_"):
        read_file(file)


def test_exit(tmp_path, monkeypatch):
    """A script that ends gmsh is refused by its line; and if gmsh ends all the same, that is said."""
    file = tmp_path / "ends.geo"
    file.write_text(SQUARE + "Exit;\n")
    with pytest.raises(MeshError, match="line 4: Exit is not allowed"):
        read_file(file)
    monkeypatch.setattr(gmsh_files, "translated", lambda file: Script(file.read_text(), {}))
    with pytest.raises(MeshError, match=r"ends\.geo: gmsh cannot read it: it ends before there is a mesh"):
        read_file(file)


@pytest.mark.one_quick
def test_options_beside_a_file(tmp_path, monkeypatch, either_way):
    """FILE.opt and the files in the home folder are not read, of a script as of a mesh with values at its nodes."""
    home = tmp_path / "home"
    home.mkdir()
    for name in (".gmshrc", ".gmsh-options"):
        (home / name).write_text(f"Mesh.MeshSizeFactor = 0.1;\nSystemCall 'touch {tmp_path}/{attacks.LEFT}';\n")
    monkeypatch.setenv("HOME", str(home))
    monkeypatch.setenv("GMSH_HOME", str(home))
    values = '$NodeData\n1\n"a"\n1\n0\n3\n0\n1\n1\n1 1.0\n$EndNodeData\n'
    mesh = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n3\n1 0 0 0\n2 1 0 0\n3 0 1 0\n$EndNodes\n"
    mesh += "$Elements\n1\n1 2 2 1 1 1 2 3\n$EndElements\n"
    for name, text, cells in (("body.geo", SQUARE, 4), ("body.msh", mesh + values, 1)):
        (tmp_path / name).write_text(text)
        (tmp_path / f"{name}.opt").write_text(f"SystemCall 'touch {tmp_path}/{attacks.LEFT}';\n")
        assert len(read_file(tmp_path / name).cells) == cells
    assert not (tmp_path / attacks.LEFT).exists()


# --- other formats ---------------------------------------------------------------------------------------------------

VTU = """<?xml version="1.0"?>
<!DOCTYPE VTKFile [ {entities} ]>
<VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian"><UnstructuredGrid>
<Piece NumberOfPoints="3" NumberOfCells="1">
<Points><DataArray type="Float64" NumberOfComponents="3" format="ascii">0 0 0 1 0 0 {x} 1 0</DataArray></Points>
<Cells><DataArray type="Int64" Name="connectivity" format="ascii">0 1 2</DataArray>
<DataArray type="Int64" Name="offsets" format="ascii">3</DataArray>
<DataArray type="Int64" Name="types" format="ascii">5</DataArray></Cells></Piece></UnstructuredGrid></VTKFile>
"""
LAUGHS = '<!ENTITY a "1 2 3 ">' + "".join(
    f'<!ENTITY {b} "{10 * f"&{a};"}">' for a, b in zip("abcdefghi", "bcdefghij", strict=True)
)


@pytest.mark.one_quick
@pytest.mark.parametrize(
    ("entities", "x"),
    [('<!ENTITY out SYSTEM "file://{folder}/secret.txt">', "&out;"), (LAUGHS, "&j;")],
    ids=["external", "expansion"],
)
def test_entities_in_xml(tmp_path, entities, x, either_way):
    """An entity does not bring in another file, nor gigabytes."""
    attacks.prepare(tmp_path)
    file = tmp_path / "body.vtu"
    file.write_text(VTU.format(entities="", x="0"))
    assert len(read_file(file).cells) == 1
    file.write_text(VTU.format(entities=entities.replace("{folder}", str(tmp_path)), x=x))
    with pytest.raises(MeshError, match=r"body\.vtu: meshio cannot read it") as caught:
        read_file(file)
    assert attacks.SECRET not in str(caught.value)


XDMF = """<Xdmf Version="3.0" xmlns:xi="http://www.w3.org/2001/XInclude"><Domain><Grid Name="Grid">{more}
<Geometry GeometryType="XY"><DataItem DataType="Float" Dimensions="3 2" Format="{form}" Precision="8">{name}</DataItem>
</Geometry><Topology TopologyType="Triangle" NumberOfElements="1">
<DataItem DataType="Int" Dimensions="1 3" Format="XML" Precision="8">0 1 2</DataItem></Topology></Grid></Domain></Xdmf>
"""


@pytest.mark.parametrize(
    ("name", "form", "message"),
    [
        ("../outside.h5:/x", "HDF", r"names the file '\.\./outside\.h5'"),
        ("{folder}/outside.h5:/x", "HDF", "must be in a file beside it"),
        ("link.h5:/x", "HDF", "a link to a file elsewhere"),
        ("link.h5", "Binary", "a link to a file elsewhere"),
        ("external.h5:/x", "HDF", "'x' is in another file"),
        ("virtual.h5:/x", "HDF", "'x' is in another file"),
        ("stored.h5:/x", "HDF", "'x' is in another file"),
        ("none.h5:/x", "HDF", "no regular file"),
        ("<xi:include href='{folder}/outside.xml'/>", "XML", "includes another file"),
    ],
)
def test_data_elsewhere(tmp_path, name, form, message):
    """An XDMF file and its data are together; nothing in them leads to another file."""
    outside, folder = tmp_path / "outside.h5", tmp_path / "body"
    folder.mkdir()
    with h5py.File(outside, "w") as data:
        data["x"] = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    (folder / "link.h5").symlink_to(outside)
    (tmp_path / "raw").write_bytes(np.eye(3)[:, :2].tobytes())
    with h5py.File(folder / "external.h5", "w") as data:
        data["x"] = h5py.ExternalLink(outside, "/x")
    with h5py.File(folder / "virtual.h5", "w") as data:
        layout = h5py.VirtualLayout((3, 2), "f8")
        layout[:] = h5py.VirtualSource(outside, "x", (3, 2))
        data.create_virtual_dataset("x", layout)
    with h5py.File(folder / "stored.h5", "w") as data:
        data.create_dataset("x", (3, 2), "f8", external=[(str(tmp_path / "raw"), 0, 48)])
    (folder / "good.h5").write_bytes(outside.read_bytes())
    file = folder / "body.xdmf"
    file.write_text(XDMF.format(more="", form="HDF", name="good.h5:/x"))
    assert len(read_file(file).cells) == 1
    file.write_text(XDMF.format(more="", form=form, name=name.format(folder=tmp_path)))
    with pytest.raises(MeshError, match=message):
        read_file(file)


# --- the sandbox -----------------------------------------------------------------------------------------------------

PROGRAM = """
import ctypes, json, os, signal, socket, subprocess, sys, threading
sys.path.append({folder!r})
import h5py, sandbox
from pathlib import Path
os.chdir({place!r})
found = sandbox.confine([Path("mine"), Path("mine.h5")])

def tried(function):
    try:
        function()
    except Exception as error:
        return type(error).__name__
    return "done"

libc = ctypes.CDLL(None)
started = []
thread = threading.Thread(target=lambda: started.append(1))
thread.start(), thread.join()
attempts = dict(
    mine=lambda: open("mine").read(),
    other=lambda: open("other").read(),
    listing=lambda: os.listdir("."),
    link=lambda: h5py.File("mine.h5")["x"][()],
    append=lambda: open("mine", "a"),
    new=lambda: open("new", "w"),
    both=lambda: os.open("mine", os.O_RDWR),
    nameless=lambda: os.open(".", os.O_TMPFILE | os.O_WRONLY),
    truncate=lambda: os.truncate("mine", 0),
    remove=lambda: os.unlink("mine"),
    rename=lambda: os.rename("mine", "new"),
    symlink=lambda: os.symlink("mine", "new"),
    hardlink=lambda: os.link("mine", "new"),
    folder=lambda: os.mkdir("new"),
    mode=lambda: os.chmod("mine", 0),
    times=lambda: os.utime("mine"),
    fork=os.fork,
    execute=lambda: os.execv("/bin/true", ["true"]),
    spawn=lambda: os.posix_spawn("/bin/true", ["true"], {{}}),
    program=lambda: subprocess.run(["true"]),
    socket=socket.socket,
    signal=lambda: os.kill(os.getppid(), 0),
    group=lambda: os.killpg(0, 0),
    trace=lambda: libc.ptrace(0, 0, 0, 0) == 0 or 1 / 0,
    limits=lambda: __import__("resource").prlimit(os.getppid(), 7, (1, 1)),
)
results = {{name: tried(one) for name, one in attempts.items()}}
print(json.dumps([found, results, started]))
"""


@pytest.mark.skipif(not sandbox.available(), reason="the system has neither seccomp nor Landlock")
def test_what_the_sandbox_leaves(tmp_path):
    """Reading the given files, and threads; nothing else, whatever asks for it."""
    for name in ("mine", "other"):
        (tmp_path / name).write_text("text")
    with h5py.File(tmp_path / "other.h5", "w") as data:
        data["x"] = np.ones(3)
    with h5py.File(tmp_path / "mine.h5", "w") as data:
        data["x"] = h5py.ExternalLink("other.h5", "/x")
    before = sorted((path.name, path.read_bytes()) for path in tmp_path.iterdir())
    text = PROGRAM.format(folder=str(Path(sandbox.__file__).parent), place=str(tmp_path))
    printed = subprocess.run([sys.executable, "-c", text], check=True, capture_output=True, timeout=100).stdout
    found, results, started = json.loads(printed)
    assert tuple(found) == sandbox.available()
    assert started == [1]
    allowed = {"mine"}
    if "Landlock" not in found:
        allowed |= {"other", "listing", "link"}
    if "seccomp" not in found:
        allowed |= {"mode", "times", "fork", "socket", "signal", "group", "trace", "limits"}
    assert {name for name, result in results.items() if result == "done"} <= allowed
    assert results["mine"] == "done"
    assert sorted((path.name, path.read_bytes()) for path in tmp_path.iterdir()) == before


@pytest.mark.slow
@pytest.mark.skipif("seccomp" not in sandbox.available(), reason="the system has no seccomp")
def test_the_sandbox_alone(tmp_path, monkeypatch):
    """If a command got through to gmsh, it would fail; without the sandbox it would not."""
    file, left = tmp_path / "body.geo", tmp_path / attacks.LEFT
    file.write_text(f'{SQUARE}General.AbortOnError = 0;\nSystemCall "touch {left}";\n')
    monkeypatch.setattr(gmsh_files, "translated", lambda file: Script(file.read_text(), {}))
    monkeypatch.setattr(reading, "_run", RUN)
    for sandboxed in (True, False):
        monkeypatch.setattr(reading, "SANDBOX", sandboxed)
        with suppress(MeshError):
            read_file(file)
        assert left.exists() is not sandboxed


@pytest.mark.parametrize("name", ["BODY.GEO", "body.msh", "body.step", "body.brep"])
def test_scripts_under_any_name(tmp_path, name, either_way):
    """gmsh takes a file without a header for a script, whatever it is called."""
    file = tmp_path / name
    file.write_text(f'SystemCall "touch {tmp_path / attacks.LEFT}";\n')
    with pytest.raises(MeshError, match=r"SystemCall is not allowed|does not begin with"):
        read_file(file)
    assert not (tmp_path / attacks.LEFT).exists()
