"""What is known of a mesh of a nested iteration once it is solved: results, errors and cost."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from signorini_fx.mechanics.contact_points.contact_table import ContactTable


@dataclass(frozen=True)
class MeshCost:
    """A mesh and the cost of a solve on it.

    Attributes:
        level: its number, the coarsest is 0.
        h: mean spacing of the contact nodes, length; in 3D the square root of the mean area that they stand for.
        dofs: unknowns.
        linear_solves: linear solves on this mesh.
        factorisations: of them with a new factorisation.
        seconds: wall time of everything on this mesh, largest over the ranks.
        memory: peak memory so far of all ranks together, MB.
    """

    level: int
    h: float
    dofs: int
    linear_solves: int
    factorisations: int
    seconds: float
    memory: float


@dataclass(frozen=True)
class LevelResult(MeshCost):
    """Results and errors on one mesh; its cost is that of ``MeshCost``.

    Attributes:
        status: how it ended.
        energy: estimated discretisation error, relative in the energy norm, loads included.
        pressure: the same of the contact pressure, relative in L2(Gamma_c); None without contact.
        loads: the error of the loads on the mesh.
        polygon: effect of straight facets of a curved contact boundary, which no refinement reduces;
            ``pressure_error.polygon_error``.
        regularisation: regularisation error, relative in the energy norm; 0 without regularisation.
        pressure_regularisation: the same of the contact pressure, relative in L2(Gamma_c).
        iteration: relative residual, or last change of the outer iteration, whichever is larger.
        table: the contact boundary.
        force: contact and friction force of each contact boundary in all load steps, shape (2 d boundaries steps,).
        krylov_from: unknowns from which on a mesh is solved by a Krylov method; infinite: none is.
        paired: whether contact is between two bodies.
        degree: of the displacement.
    """

    status: str
    energy: float
    pressure: float | None
    loads: float
    regularisation: float
    pressure_regularisation: float
    iteration: float
    table: ContactTable
    force: npt.NDArray[np.float64]
    polygon: float = 0.0
    krylov_from: float = np.inf
    paired: bool = False
    degree: int = 1

    @property
    def dimension(self) -> int:
        """Of the body, 2 or 3."""
        return 2 if self.table.facets is None else 3
