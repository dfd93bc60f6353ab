"""What a terminal shows: wrapped lines, colours, completion; and that a pipe gets neither of the first two."""

import argparse
import subprocess
from importlib.util import find_spec

import pytest

from signorini_fx.machine.terminal import TerminalLine
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


@pytest.mark.parametrize(("kind", "code"), [("error", 31), ("warning", 33), ("good", 32), ("", None)])
def test_colours(kind, code):
    """Errors, warnings and success; the text is the same without the escapes."""
    found = TerminalLine("certificate ", "holds", kind).broken(80, colours=True)
    assert found == ("certificate holds" if code is None else f"\x1b[{code};1mcertificate \x1b[0mholds")


def script_for(shell):
    """What ``signorini-fx completion SHELL`` prints."""
    return commands.completion(argparse.Namespace(shell=shell))


def completed(line, place):
    """What bash offers for the last word of a line."""
    state = f"COMP_LINE={line!r}; COMP_POINT={len(line)}; COMP_TYPE=9"
    command = f"{script_for('bash')}\n{state}; _python_argcomplete signorini-fx; printf '%s\\n' \"${{COMPREPLY[@]}}\""
    ended = subprocess.run(["bash", "-c", command], cwd=place, capture_output=True, text=True, check=True)
    return [offer.rstrip() for offer in ended.stdout.splitlines()]


@pytest.mark.slow
@pytest.mark.skipif(find_spec("argcomplete") is None, reason="there is no argcomplete")
def test_completion(place):
    """Commands, options of a command, values of an option or an argument, and files."""
    for line, offers in TYPED.items():
        assert completed(line, place) == offers, line
    assert completed("signorini-fx completion ", place) == ["bash", "zsh", "fish"]
    assert completed("signorini-fx solve scene.toml --of p", place) == ["pressure", "peak"]


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
