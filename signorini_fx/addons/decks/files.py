"""What readers of meshes need of Abaqus input files."""

from signorini_fx.addons.decks.mesh import read_mesh
from signorini_fx.addons.decks.text import files_of

__all__ = ["files_of", "read_mesh"]
