"""Mesh files as gmsh writes them."""

from signorini_fx.mechanics.mesh.files.gmsh_reader import gmsh_session


def write_msh(source, file, degree=None):
    """Write a drawing or a mesh that gmsh reads as a .msh file; with sides of this degree, if one is given."""
    with gmsh_session() as gmsh:
        gmsh.open(str(source))
        if source.suffix != ".msh":
            gmsh.model.mesh.generate(gmsh.model.getDimension())
        if degree is not None:
            gmsh.model.mesh.setOrder(degree)
        gmsh.write(str(file))
    return file
