"""gmsh within this process, with the same options everywhere."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

from signorini_fx.errors import InstallationError, MeshError


@contextlib.contextmanager
def gmsh_session() -> Iterator[Any]:
    """The module gmsh with an empty model and the same options for everybody: silent, and no file of options is read.

    Raises:
        InstallationError: it is not installed, or its wheel lacks a library of the system.
        MeshError: the caller has gmsh open, whose options would change the mesh.
    """
    try:
        import gmsh
    except ImportError:
        raise InstallationError(
            "this mesh is made by gmsh, which is not installed: pip install gmsh, or apt install python3-gmsh"
        ) from None
    except OSError as error:
        raise InstallationError(
            f"this mesh is made by gmsh, which cannot be loaded: {error}; its wheel needs libraries of the system, on "
            "Debian and Ubuntu: apt install libgl1 libglu1-mesa libxcursor1 libxft2 libxinerama1"
        ) from None
    if gmsh.isInitialized():
        raise MeshError("gmsh is open in this process: call gmsh.finalize() before a mesh is made or read by it here")
    gmsh.initialize(readConfigFiles=False, interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Mesh.RandomSeed", 1)
        yield gmsh
    finally:
        if gmsh.isInitialized():  # what is drawn is written by others
            gmsh.finalize()
