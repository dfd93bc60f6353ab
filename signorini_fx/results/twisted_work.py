"""The work of the stress of an axisymmetric body with torsion, by quadrature in NumPy, for ``nodal_forces``."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.body.assembly import adjugates
from signorini_fx.results.surface_quadrature import QuadratureFacets

Array = npt.NDArray[np.float64]


def twisted_work(
    forces: Any,
    u: Array,
    degree: int,
    hooke: tuple[Array, Array],
    initial: Callable[[QuadratureFacets], Array] | None,
) -> tuple[Array, float]:
    """That of the stress a (epsilon - e I) + b tr(epsilon - e I) I with unit displacements, and the energy of the
    initial strain e alone, both on this rank alone.

    In cylindrical coordinates (radius r, height, around the axis) the displacement gradient has the third column
    (-u_2, 0, u_0) / r.

    Args:
        forces: ``NodalForces`` of the body.
        u: nodal displacements with ghosts, length, shape (nodes, 3).
        degree: of the quadrature.
        hooke: a and b, stresses, of all cells alike, shape (1,), or cell by cell.
        initial: gives e at points, shape (f, q); None: there is none.
    """
    total, energy = np.zeros_like(u), 0.0
    for part, size in forces._cells(degree):
        cells, table = part.cells, part.table
        a, b = (m[:, None] if m.size == 1 else m[cells, None] for m in hooke)
        inverse, determinant = adjugates(forces._jacobian(cells, table))
        slope = np.einsum("kqn,kjcq->jcqn", table.slope, inverse / determinant)  # of each shape function along x_j
        nodes = forces.space.dofmap.list[cells]
        nodal, radius = u[nodes], forces.positions(part)[..., 0]
        around = table.shape / radius[..., None]
        gradient = np.zeros((3, 3, *radius.shape))
        gradient[:, :2] = np.einsum("jcqn,cni->ijcq", slope, nodal)
        gradient[0, 2] = -np.einsum("cqn,cn->cq", around, nodal[:, :, 2])
        gradient[2, 2] = np.einsum("cqn,cn->cq", around, nodal[:, :, 0])
        size = size * 2 * np.pi * radius
        initial_strain = np.zeros_like(radius) if initial is None else initial(part)
        stress = a * (gradient + gradient.swapaxes(0, 1)) / 2
        mean = b * (np.einsum("iicq->cq", gradient) - 3 * initial_strain) - a * initial_strain
        stress[range(3), range(3)] += mean
        energy += float(np.sum(size * (a + 3 * b) * 3 * initial_strain**2)) / 2
        weighted = size * stress
        work = np.einsum("ijcq,jcqn->cni", weighted[:, :2], slope)
        work[:, :, 0] += np.einsum("cq,cqn->cn", weighted[2, 2], around)
        work[:, :, 2] -= np.einsum("cq,cqn->cn", weighted[0, 2], around)
        np.add.at(total, nodes, work)
    return total, energy
