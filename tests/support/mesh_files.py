"""Mesh files as gmsh writes them, and what files of fields hold."""

import base64
from xml.etree import ElementTree

import numpy as np

from signorini_fx.mechanics.mesh.files import formats
from signorini_fx.mechanics.mesh.files.gmsh_reader import gmsh_session
from signorini_fx.mechanics.statement.mesh_sources import MeshFile


def read_file(file, boundaries=None, regions=None, degree=None):
    """The arrays of a mesh file with names of a scene."""
    return formats.read_file(
        MeshFile(file=file, boundaries=boundaries or {}, regions=regions or {}), degree=degree
    )


def write_msh(source, file, degree=None):
    """Write a drawing or a mesh that gmsh reads as a .msh file; with sides of this degree, if one
    is given.
    """
    with gmsh_session("a test") as gmsh:
        gmsh.open(str(source))
        if source.suffix != ".msh":
            gmsh.model.mesh.generate(gmsh.model.getDimension())
        if degree is not None:
            gmsh.model.mesh.setOrder(degree)
        gmsh.write(str(file))
    return file


def arrays_of(file):
    """The arrays of a file by name, one row per point, cell or corner."""
    found = {}
    for array in ElementTree.parse(file).iter("DataArray"):
        data = base64.b64decode(array.text)
        assert np.frombuffer(data[:8], np.uint64)[0] == len(data) - 8
        values = np.frombuffer(data[8:], np.dtype(array.get("type").lower()))
        found[array.get("Name")] = values.reshape(-1, int(array.get("NumberOfComponents") or 1))
    return found
