"""Orthotropic elasticity: the stiffness in each cell, and its form; its stress is in ``body.element_stress``.

Stress and strain are vectors of the components ``Kinematics.pairs``, of shear strains twice epsilon_ij.
"""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem

from signorini_fx import parallel
from signorini_fx.body.moduli import graded, middles
from signorini_fx.effects.material import LinearElastic
from signorini_fx.errors import SceneError
from signorini_fx.kinematics.cartesian import Kinematics, position
from signorini_fx.mesh.tagged import TaggedMesh
from signorini_fx.scene.model import Scene

Array = npt.NDArray[np.float64]

# The components in space, in the order of ``Kinematics.pairs``.
_PAIRS = (*((k, k) for k in range(3)), *combinations(range(3), 2))


def cellwise_stiffness(scene: Scene, tagged: TaggedMesh) -> fem.Function:
    """The stiffness of all cells, with the axes in their middle; of plane strain with a last row for the stress out of
    the plane; shape (rows, m); collective.

    Raises:
        SceneError: the axes have no direction in some cell.
    """
    kinematics = scene.kinematics_in(tagged.dimension)
    rows, columns = _components(kinematics)
    moduli = fem.Function(fem.functionspace(tagged.mesh, ("DG", 0, (len(rows), len(columns)))))
    at_cells, problems = moduli.x.array.reshape(-1, len(rows), len(columns)), []
    for number, material in enumerate(scene.material):
        if material.region is not None and material.region not in tagged.regions:
            continue  # which is reported elsewhere
        count = len(moduli.function_space.dofmap.list)
        cells = np.arange(count, dtype=np.int32) if material.region is None else tagged.cells(material.region)
        stiffness = np.linalg.inv(_compliance(material))[None]
        if material.orthotropic is not None:
            axes = material.orthotropic.axes(middles(tagged, cells))
            if parallel.any_rank(tagged.mesh.comm, not np.isfinite(axes).all()):
                wanted = "direction and second must be finite, not zero and not parallel in the middle of each cell"
                problems.append((f"material[{number}].orthotropic", wanted))
                continue
            turned = _turned(axes)
            stiffness = turned @ stiffness @ turned.swapaxes(1, 2)
        if scene.material[0].hypothesis == "plane stress":
            stiffness = np.linalg.inv(np.linalg.inv(stiffness)[:, rows][:, :, columns])
        else:
            stiffness = stiffness[:, rows][:, :, columns]
        at_cells[moduli.function_space.dofmap.list[cells, 0]] = stiffness
    if problems:
        raise SceneError(problems)
    share = graded(scene, tagged, "grading")
    if share is not None:
        at_cells *= share.x.array[:, None, None]
    return moduli


def _components(kinematics: Kinematics) -> tuple[list[int], list[int]]:
    """Those of stress and strain among the components in space."""
    columns = [_PAIRS.index(pair) for pair in kinematics.pairs]
    return [*columns, *([_PAIRS.index((2, 2))] if kinematics.prevented else [])], columns


def _compliance(material: LinearElastic) -> Array:
    """Along its axes, shape (6, 6)."""
    if material.orthotropic is not None:
        return material.orthotropic.compliance
    young, poisson = material.young, material.poisson
    compliance = np.diag([1 / young] * 3 + [2 * (1 + poisson) / young] * 3)
    compliance[:3, :3] -= poisson / young * (1 - np.eye(3))
    return compliance


def _turned(axes: Array) -> Array:
    """The components of a stress from those along the axes, shape (cells, 6, 6) (W. L. Bond, Bell Syst. Tech. J. 22
    (1943) 1-72); its transpose turns the strain back.
    """
    bond_matrices = np.empty((len(axes), 6, 6))
    for p, (i, j) in enumerate(_PAIRS):
        for q, (a, b) in enumerate(_PAIRS):
            bond_matrices[:, p, q] = axes[:, i, a] * axes[:, j, b] + (axes[:, i, b] * axes[:, j, a] if a != b else 0)
    return bond_matrices


def strain_components(y: Any, kinematics: Kinematics, *, on_axis: bool = False) -> Any:
    """The components of the strain as a vector, UFL; ``on_axis``: see ``Kinematics.strain``."""
    epsilon = kinematics.strain(y, on_axis=on_axis)
    return ufl.as_vector([epsilon[i, j] * (1 if i == j else 2) for i, j in kinematics.pairs])


def orthotropic_form(y: Any, z: Any, stiffness: fem.Function, degree: int, kinematics: Kinematics) -> Any:
    """a(y, z) with the stiffness of each cell; the arguments are those of ``effects.material.elastic_forms``."""
    first, second = strain_components(y, kinematics), strain_components(z, kinematics)
    stress = ufl.as_vector([ufl.dot(stiffness[k, :], first) for k in range(len(first))])
    around = kinematics.measure(position(z))
    return ufl.inner(stress, second) * around * ufl.dx(metadata={"quadrature_degree": degree})
