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

    by_package = {"signorini_fx": signorini_fx.__version__, "python": platform.python_version()}
    by_package["dolfinx"] = dolfinx.__version__
    by_package["petsc"] = ".".join(map(str, PETSc.Sys.getVersion()))
    by_package["mpi"] = MPI.Get_library_version().split(",")[0].split("\n")[0].strip("\x00 ")
    for package in _PACKAGES[1:]:
        try:
            by_package[package.removeprefix("fenics-")] = metadata.version(package)
        except metadata.PackageNotFoundError:
            continue
    by_package["blas"] = blas_in_use()
    return by_package


def blas_in_use() -> str:
    """File name of the BLAS library that this process has loaded; a reference BLAS is several times slower."""
    try:
        maps = Path("/proc/self/maps").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return "unknown"
    files = map(Path, sorted({line.split()[-1] for line in maps if "/" in line and ".so" in line}))
    libraries = ("libblas", "openblas", "blis", "mkl_rt")
    blas_files = [file for file in files if any(word in file.name for word in libraries)]
    names = [f"{file.parent.name}/{file.name}" if file.name.startswith("libblas") else file.name for file in blas_files]
    return ", ".join(dict.fromkeys(names)) or "unknown"
