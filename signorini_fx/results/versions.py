"""What a result was made with."""

from __future__ import annotations

import platform
from importlib import metadata
from pathlib import Path

from mpi4py import MPI

import signorini_fx

_PACKAGES = ("fenics-dolfinx", "fenics-basix", "fenics-ufl", "fenics-ffcx", "petsc4py", "mpi4py", "numpy", "pydantic")


def versions() -> dict[str, str]:
    """Versions of all libraries, and the BLAS in use."""
    import dolfinx
    from petsc4py import PETSc

    found = {"signorini_fx": signorini_fx.__version__, "python": platform.python_version()}
    found["dolfinx"] = dolfinx.__version__
    found["petsc"] = ".".join(map(str, PETSc.Sys.getVersion()))
    found["mpi"] = MPI.Get_library_version().split(",")[0].split("\n")[0].strip("\x00 ")
    for package in _PACKAGES[1:]:
        try:
            found[package.removeprefix("fenics-")] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    found["blas"] = blas_in_use()
    return found


def blas_in_use() -> str:
    """File name of the BLAS library that this process has loaded; a reference BLAS is several times slower."""
    try:
        maps = Path("/proc/self/maps").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return "unknown"
    files = sorted({Path(line.split()[-1]) for line in maps if "/" in line and ".so" in line})
    libraries = ("libblas", "openblas", "blis", "mkl_rt")
    found = [file for file in files if any(word in file.name for word in libraries)]
    names = [f"{file.parent.name}/{file.name}" if file.name.startswith("libblas") else file.name for file in found]
    return ", ".join(dict.fromkeys(names)) or "unknown"
