"""The lengths of cells as a field on a mesh that exists already, by which gmsh makes the next one.

gmsh interpolates the lengths at the corners of that mesh: its size field ``PostView``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import IO, Any

import numpy as np

from signorini_fx.mechanics.mesh.files.shape import Floats, Ints

# gmsh's words for the elements of a view, by their dimension and the number of their corners.
_VIEWS = {(2, 3): "ST", (2, 4): "SQ", (3, 4): "SS", (3, 8): "SH"}


@dataclass(frozen=True, eq=False)
class SizeField:
    """Lengths of cells at the corners of a mesh.

    Attributes:
        points: positions, shape (n, d).
        cells: corners of each cell in gmsh's order, shape (m, c).
        sizes: length of the cells at each point, shape (n,).
    """

    points: Floats
    cells: Ints
    sizes: Floats

    def save(self, stream: IO[bytes]) -> None:
        """Write everything; ``load`` reads it again."""
        np.savez(stream, points=self.points, cells=self.cells, sizes=self.sizes)

    @classmethod
    def load(cls, stream: IO[bytes]) -> SizeField:
        """What ``save`` has written."""
        with np.load(stream, allow_pickle=False) as arrays:
            return cls(arrays["points"], arrays["cells"], arrays["sizes"])

    def over(self, unit: float) -> SizeField:
        """The same in a drawing with this unit of length."""
        return SizeField(np.asarray(self.points / unit), self.cells, np.asarray(self.sizes / unit))

    def apply(self, gmsh: Any) -> None:
        """Let the current model of gmsh have cells of these lengths alone, whatever its own settings are."""
        dim = self.points.shape[1]
        x = np.zeros((len(self.points), 3))
        x[:, :dim] = self.points
        # Cells that are divided in the end are twice as long before.
        halved = gmsh.option.getNumber("Mesh.SubdivisionAlgorithm") > 0
        values = self.sizes * (2.0 if halved else 1.0)
        rows = np.concatenate([x[self.cells].transpose(0, 2, 1).reshape(len(self.cells), -1), values[self.cells]], 1)
        view = gmsh.view.add("sizes")
        gmsh.view.addListData(view, _VIEWS[dim, self.cells.shape[1]], len(self.cells), rows.ravel())
        fields = gmsh.model.mesh.field
        number = fields.add("PostView")
        fields.setNumber(number, "ViewTag", view)
        fields.setAsBackgroundMesh(number)
        for option in ("ExtendFromBoundary", "FromPoints", "FromCurvature", "FromParametricPoints", "Min"):
            gmsh.option.setNumber(f"Mesh.MeshSize{option}", 0)
        gmsh.option.setNumber("Mesh.MeshSizeFactor", 1)
        gmsh.option.setNumber("Mesh.MeshSizeMax", float(values.max()))
