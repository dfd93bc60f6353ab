"""Commands and programs, and what they leave."""

import json
import subprocess
import sys

from signorini_fx.scenes import cli


def run(capsys, *arguments):
    """Exit code, standard output and standard error of a command."""
    code = cli.main([str(argument) for argument in arguments])
    return code, *capsys.readouterr()


def run_python(code, *, check=True):
    """A program in a process of its own, with its output."""
    command = [sys.executable, "-c", code]
    return subprocess.run(command, capture_output=True, text=True, check=check)


def summary_in(folder):
    """The summary of a result folder."""
    return json.loads((folder / "summary.json").read_text(encoding="utf-8"))
