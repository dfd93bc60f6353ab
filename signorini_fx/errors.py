"""The errors that this package raises; each message includes what to do."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Self


class SignoriniError(Exception):
    """The base class of all errors that this package raises on purpose.

    Examples:
        >>> try:
        ...     sfx.read_scene("no.toml")
        ... except sfx.SignoriniError as error:
        ...     print(type(error).__name__, len(error.problems))
        SceneError 1
    """


class SceneError(SignoriniError):
    """The scene is wrong.

    Attributes:
        problems: all errors, each as (path of the key in the scene, what is wrong and what is
            allowed).

    Examples:
        >>> try:
        ...     sfx.LinearElastic(young=-1.0, poisson=0.7)
        ... except sfx.SceneError as error:
        ...     print(len(error.problems), error.problems[0])
        2 ('young', 'must be greater than 0, got -1.0')
    """

    _of = "scene"  # what messages name as wrong, unless a source is given

    def __init__(self, problems: list[tuple[str, str]], source: str | None = None) -> None:
        source = self._of if source is None else source
        self.problems = problems
        self.source = source
        super().__init__(
            "\n".join(
                f"{': '.join(dict.fromkeys((source, path)))}: {message}"
                for path, message in problems
            )
        )

    @classmethod
    def at(cls, path: str, message: str, source: str | None = None) -> Self:
        """Return the error of a single problem."""
        return cls([(path, message)], source)

    def of(self, source: str | Path) -> SceneError:
        """Return the same errors for a scene with the name ``source``."""
        return SceneError(self.problems, str(source))

    def __reduce__(self) -> tuple[type, tuple[list[tuple[str, str]], str]]:
        """Return the class and the arguments of its constructor, as errors are sent between
        ranks.
        """
        return type(self), (self.problems, self.source)


class FormError(SceneError, ValueError):
    """An argument of ``ContactProblem`` or ``NonlinearContactProblem`` is wrong.

    Examples:
        >>> try:
        ...     sfx.Coulomb(-0.3)
        ... except sfx.FormError as error:
        ...     print(len(error.problems), error.problems[0])
        1 ('coefficient', 'must not be negative, got -0.3')
    """

    _of = "contact problem"


def together(*checks: Callable[[], Any]) -> list[Any]:
    """Return the results of independent checks; the problems of all of them are raised as one
    SceneError.
    """
    results = []
    problems = []
    for check in checks:
        try:
            results.append(check())
        except SceneError as error:
            problems += error.problems
    if problems:
        raise SceneError(problems)
    return results


class MeshError(SignoriniError):
    """The mesh cannot be read or generated, or lacks something that the scene needs.

    Examples:
        >>> try:
        ...     block.facets("lid")
        ... except sfx.MeshError as error:
        ...     print(str(error).count("'lid'"))
        1
    """


class OptionsError(SignoriniError):
    """PETSc does not accept an option that the user has set.

    Examples:
        >>> error = sfx.OptionsError("unknown")
        >>> print(isinstance(error, sfx.SignoriniError), len(error.args))
        True 1
    """


class MachineError(SignoriniError):
    """The machine lacks something that every solve needs: a C compiler, memory, or a writable
    folder.

    Examples:
        >>> error = sfx.MachineError("no compiler")
        >>> print(isinstance(error, sfx.SignoriniError), len(error.args))
        True 1
    """


class OutputError(SignoriniError):
    """A result cannot be written."""


# The package that draws bodies in 3D, for messages.
PYVISTA = "PyVista with VTK 9.4 or later (pip install pyvista)"


class PictureError(SignoriniError):
    """A picture cannot be drawn on this machine.

    Examples:
        >>> error = sfx.PictureError("no PyVista")
        >>> print(isinstance(error, sfx.SignoriniError), len(error.args))
        True 1
    """


def cannot_be_written(path: str | Path, error: Exception) -> OutputError:
    """Return the error for a file or folder that cannot be written, with the reason from the
    system.
    """
    reason = getattr(error, "strerror", None) or str(error)
    return OutputError(f"{path}: cannot be written: {reason}")


class ResultError(SignoriniError):
    """A folder cannot be read as a result folder, or is incomplete."""


class InstallationError(SignoriniError, ImportError):
    """An installed package is missing, or cannot be used.

    Examples:
        >>> from signorini_fx.extensions import register
        >>> try:
        ...     register("signorini_fx.unknown", "mine", None)
        ... except sfx.InstallationError as error:
        ...     print(str(error).count("signorini_fx.unknown"))
        1
    """


class MissingPackageError(InstallationError):
    """An add-on needs a package that is not installed."""


# --- what is installed ----------------------------------------------------------------------------

FENICSX = ("mpi4py", "petsc4py", "ufl", "basix", "dolfinx")


def check_fenicsx() -> None:
    """Raise an ``InstallationError`` if a part of FEniCSx is not installed; ``compat`` checks its
    version.
    """
    missing = [name for name in FENICSX if find_spec(name) is None]
    if missing:
        raise needs_fenicsx(f"{', '.join(missing)} cannot be imported")


_WAYS = """\
    apt install python3-dolfinx python3-gmsh              (Debian 13 or later, its own Python)
    pip install '.[fenicsx]'                (checkout, Python 3.12 or later on Linux, x86-64)
    conda install -c conda-forge fenics-dolfinx mpich python-gmsh                 (not tried)
    docker build -t signorini-fx .                    (in the checkout, or use its ./env)"""


def needs_fenicsx(message: str) -> InstallationError:
    """Return the error for a FEniCSx that is missing, too old, or incomplete, with the ways to
    install it.
    """
    return InstallationError(
        f"{message}: FEniCSx with dolfinx >= 0.9 is needed. Install it by one of\n{_WAYS}"
    )
