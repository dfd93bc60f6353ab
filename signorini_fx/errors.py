"""The ways in which a request can fail, each with a sentence that says what to do."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from signorini_fx.solution import Solution


class SignoriniError(Exception):
    """Base class: catch it to catch everything that this package raises on purpose."""


class SceneError(SignoriniError):
    """The scene is wrong.

    Attributes:
        problems: every mistake found, as (path of the key in the scene, what is wrong and what is allowed).
    """

    def __init__(self, problems: list[tuple[str, str]], source: str = "scene") -> None:
        self.problems = problems
        self.source = source
        super().__init__("\n".join(f"{source}: {path}: {message}" for path, message in problems))

    def __reduce__(self) -> tuple[type, tuple[list[tuple[str, str]], str]]:
        """Errors travel between ranks."""
        return type(self), (self.problems, self.source)


class MeshError(SignoriniError):
    """The mesh cannot be read or generated, or lacks something that the scene needs."""


class ConvergenceError(SignoriniError):
    """No solution was reached.

    Attributes:
        solution: the last iterate with its status, history and certificate.
    """

    def __init__(self, solution: Solution) -> None:
        self.solution = solution
        warnings = (f"\n{found.path}: {found.message}" for found in solution.findings if found.level == "warning")
        super().__init__(f"{solution.status.value}: {solution.status.advice}{''.join(warnings)}")


class OutputError(SignoriniError):
    """A result cannot be written."""


class ResultError(SignoriniError):
    """A result folder cannot be read: it is none, or not whole."""


_CHANNELS = """FEniCSx with dolfinx >= 0.9 is needed; pip does not have it. Install it by one of
    apt install python3-dolfinx python3-gmsh                              (Debian 13)
    conda install -c conda-forge fenics-dolfinx mpich python-gmsh
    docker build -t signorini-fx .                                        (in the checkout, or use its ./env)"""


class InstallationError(SignoriniError, ImportError):
    """FEniCSx is missing or too old."""

    def __init__(self, what: str) -> None:
        super().__init__(f"{what}: {_CHANNELS}")
