"""What a terminal shows: wrapped lines, colours, completion; and that a pipe gets neither of the first two."""

import argparse
import os
import pty
import shutil
import signal
import subprocess
import sys
from importlib.util import find_spec

import pytest

from signorini_fx.errors import InstallationError
from signorini_fx.machine.launcher import environment_of_no_rank
from signorini_fx.machine.terminal import TerminalLine, prose
from signorini_fx.scenes.cli import commands

FIGURE = TerminalLine(
    "  what to do       ",
    "the load moves the body off its foundation and nothing else holds it: check the direction",
    "advice",
)


@pytest.mark.parametrize("width", [40, 60, 80, 200])
def test_prose_below_its_beginning(width):
    """No line is longer than the terminal, no word is lost, and prose continues where it began."""
    first, *others = FIGURE.broken(width, colours=False).split("\n")
    assert max(map(len, [first, *others])) <= width
    assert " ".join([first, *others]).split() == str(FIGURE).split()
    assert first.startswith("  what to do       the load")
    assert all(line[:19].isspace() and not line[19].isspace() for line in others)
    assert bool(others) == (len(str(FIGURE)) > width)


def test_rows_of_tables_stay():
    """What is no prose is not broken."""
    row = TerminalLine("    1      0     0       13       0       0       13    7.1e-01     0.003    7.1e-01     0.003")
    assert row.broken(40, colours=True) == str(row) == row.begin


def test_prose():
    """Each line of a text continues below its own beginning."""
    heading, item = prose("scene.toml:\n    material.young: must be greater than 0")
    assert (heading.begin, item.begin) == ("", "    ")
    assert item.broken(30, colours=False) == "    material.young: must be\n    greater than 0"


@pytest.mark.parametrize(("kind", "code"), [("error", 31), ("warning", 33), ("good", 32), ("", None)])
def test_colours(kind, code):
    """Errors, warnings and success; the text is the same without the escapes."""
    found = TerminalLine("certificate ", "holds", kind).broken(80, colours=True)
    assert found == ("certificate holds" if code is None else f"\x1b[{code};1mcertificate \x1b[0mholds")


def shown(environment):
    """What a terminal of 60 columns shows of an error."""
    master, slave = pty.openpty()
    command = [sys.executable, "-m", "signorini_fx", "check", "/nowhere/" + "scene_" * 8 + ".toml"]
    environment = {**environment_of_no_rank(), "COLUMNS": "60", "TERM": "xterm", **environment}
    process = subprocess.run(command, stdout=slave, stderr=slave, env=environment, check=False)
    os.close(slave)
    text = os.read(master, 100_000).decode().replace("\r\n", "\n")
    os.close(master)
    assert process.returncode == 2
    return text


@pytest.mark.slow
def test_colours_on_a_terminal(monkeypatch):
    """They can be switched off."""
    monkeypatch.delenv("NO_COLOR", raising=False)
    assert "\x1b[31;1m" in shown({})
    assert "\x1b" not in shown({"NO_COLOR": "1"})


@pytest.mark.parametrize("ranks", [1, 2])
def test_output_of_ranks_in_a_file(tmp_path, ranks):
    """Neither colours nor line breaks, although mpirun gives each rank a pseudo-terminal on the way to the file."""
    lines = ["A block: converged", str(FIGURE)]
    own = {name: value for name, value in os.environ.items() if not name.startswith(("OMPI_COMM", "PMIX"))}
    program = (
        "from signorini_fx.machine import launcher, terminal\n"
        "if launcher.started_as_root(): "
        f"terminal.say([terminal.TerminalLine('A block: converged'), terminal.{FIGURE!r}])"
    )
    log = tmp_path / "log"
    with log.open("w") as file:
        command = ["mpirun", "-n", str(ranks), sys.executable, "-c", program]
        subprocess.run(command, stdout=file, env=own, check=True)
    assert log.read_text().splitlines() == lines


def script_for(shell):
    """What ``signorini-fx completion SHELL`` prints."""
    return commands.completion(argparse.Namespace(shell=shell))


def completed(line, place):
    """What bash offers for the last word of a line."""
    state = f"COMP_LINE={line!r}; COMP_POINT={len(line)}; COMP_TYPE=9"
    command = f"{script_for('bash')}\n{state}; _python_argcomplete signorini-fx; printf '%s\\n' \"${{COMPREPLY[@]}}\""
    ended = subprocess.run(["bash", "-c", command], cwd=place, capture_output=True, text=True, check=True)
    return [offer.rstrip() for offer in ended.stdout.splitlines()]


@pytest.mark.skipif(find_spec("argcomplete") is None, reason="there is no argcomplete")
def test_completion(place):
    """Commands, options of a command, values of an option or an argument, and files."""
    for line, offers in TYPED.items():
        assert completed(line, place) == offers, line
    assert completed("signorini-fx completion ", place) == ["bash", "zsh", "fish"]
    assert completed("signorini-fx solve scene.toml --of p", place) == ["pressure", "peak"]


def test_completion_without_its_library(monkeypatch):
    """It says what to install."""
    monkeypatch.setitem(sys.modules, "argcomplete", None)
    with pytest.raises(InstallationError, match="apt install python3-argcomplete"):
        script_for("bash")


# What is typed, and what fish offers; zsh writes it if it is one word.
TYPED = {
    "signorini-fx so": ["solve"],
    "signorini-fx solve --no-f": ["--no-fields"],
    "signorini-fx solve --no": ["--no-fields", "--no-pictures"],
    "signorini-fx solve scene.toml --of pr": ["pressure"],
    "signorini-fx completion z": ["zsh"],
    "signorini-fx check sce": ["scene.toml"],
    "signorini-fx solve scene.toml --out res": ["results/"],
}


@pytest.fixture
def place(tmp_path):
    """A folder with a scene, results, and the scripts."""
    (tmp_path / "scene.toml").touch()
    (tmp_path / "results").mkdir()
    for shell in ("zsh", "fish"):
        (tmp_path / f".{shell}").write_text(script_for(shell))
    return tmp_path


@pytest.mark.skipif(
    not (shutil.which("fish") and find_spec("argcomplete")), reason="there is no fish, or no argcomplete"
)
@pytest.mark.parametrize("line", TYPED)
def test_completion_in_fish(place, line):
    """The shell itself, asked for its offers."""
    command = ["fish", "--private", "--no-config", "-c", f"source .fish; complete -C '{line}'"]
    clean = {**os.environ, "HOME": str(place)}
    process = subprocess.run(command, cwd=place, env=clean, capture_output=True, text=True, check=True)
    assert [offer.partition("\t")[0] for offer in process.stdout.splitlines()] == TYPED[line]


@pytest.mark.skipif(not (shutil.which("zsh") and find_spec("argcomplete")), reason="there is no zsh, or no argcomplete")
@pytest.mark.parametrize("line", [line for line, offers in TYPED.items() if len(offers) == 1])
def test_completion_in_zsh(place, line):
    """The shell itself on a terminal: after the tabulator, Ctrl-T prints what stands in its line."""
    pid, terminal = pty.fork()
    if pid == 0:
        os.chdir(place)
        os.execvpe("zsh", ["zsh", "-f", "-i"], {**os.environ, "HOME": str(place), "TERM": "dumb"})
    with open(terminal, "r+b", buffering=0) as stream:
        begin = "autoload -U compinit; compinit -u; source .zsh; "
        begin += "show() { print -r \"LINE<$BUFFER>\"; BUFFER=; }; zle -N show; bindkey '^T' show"
        stream.write(f"{begin}; print REA''DY\n".encode())
        shown = _until(stream, b"READY\r\n")
        stream.write(f"{line}\t\x14".encode())
        shown = _until(stream, b">\r\n")
        os.kill(pid, signal.SIGKILL)
    os.waitpid(pid, 0)
    word = line.rpartition(" ")[0] + " " + TYPED[line][0]
    assert shown.decode().rpartition("LINE<")[2].partition(">")[0].rstrip() == word


def _until(stream, mark):
    """What a terminal shows up to a mark."""
    shown = b""
    while not shown.endswith(mark):
        shown += stream.read(1)
    return shown
