"""Commands of the command line, run in this process."""

from signorini_fx.scenes import cli


def run(capsys, *arguments):
    """Exit code, standard output and standard error of a command."""
    code = cli.main([str(argument) for argument in arguments])
    return code, *capsys.readouterr()
