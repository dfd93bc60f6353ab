"""The stress of orthotropic materials for the second opinion: strains are turned into the axes, and stresses back.

It shares the constants and the axes with ``body.orthotropic``, and no matrix of stiffness.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.effects.material import LinearElastic

Array = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int32]


def in_axes(forces: Any, cells: Indices, gradient: Array) -> Array:
    """The stress of cells of ``NodalForces`` from the gradient of the displacement, both with shape (k, k, f, q)."""
    dim, strain, scene = len(gradient), np.zeros((*gradient.shape[2:], 3, 3)), forces.scene
    strain[..., :dim, :dim] = np.moveaxis(gradient + gradient.swapaxes(0, 1), (0, 1), (2, 3)) / 2
    middle, stress = forces.middles(cells), np.zeros_like(strain)
    for material in scene.material:
        single = len(scene.material) == 1
        inside = np.ones(len(cells), bool) if single else np.isin(cells, forces.tagged.cells(str(material.region)))
        stress[inside] = stress_in_axes(material, middle[:, inside], strain[inside])
    share = forces.grading("grading")
    stress *= (share if share.size == 1 else share[cells])[:, None, None, None]
    return np.moveaxis(stress[..., :dim, :dim], (2, 3), (0, 1))


def stress_in_axes(material: LinearElastic, middle: Array, strain: Array) -> Array:
    """The stress of a material.

    Args:
        material: isotropic ones have axes too.
        middle: of the cells, length, shape (3, f).
        strain: shape (f, q, 3, 3); in plane stress that out of the plane does not count.

    Returns:
        Shape (f, q, 3, 3).
    """
    axes = np.broadcast_to(np.eye(3), (strain.shape[0], 3, 3))
    if material.orthotropic is not None:
        axes, constants = material.orthotropic.axes(middle), material.orthotropic
        (e1, e2, e3), (nu12, nu13, nu23), shear = constants.young, constants.poisson, constants.shear
    else:
        e1 = e2 = e3 = material.young
        nu12 = nu13 = nu23 = material.poisson
        shear = (e1 / (2 * (1 + nu12)),) * 3
    strain_in_axes = np.einsum("fia,fqij,fjb->fqab", axes, strain, axes, optimize=True)
    normal = strain_in_axes.diagonal(axis1=2, axis2=3)
    flexible = np.array(
        [
            [1 / e1, -nu12 / e1, -nu13 / e1],
            [-nu12 / e1, 1 / e2, -nu23 / e2],
            [-nu13 / e1, -nu23 / e2, 1 / e3],
        ]
    )
    free = 2 if material.hypothesis == "plane stress" else 3  # without stress along axis 3
    stress = np.zeros_like(strain_in_axes)
    for k, value in enumerate(np.moveaxis(normal[..., :free] @ np.linalg.inv(flexible[:free, :free]), -1, 0)):
        stress[..., k, k] = value
    for (i, j), modulus in zip(((0, 1), (0, 2), (1, 2)), shear, strict=True):
        stress[..., i, j] = stress[..., j, i] = 2 * modulus * strain_in_axes[..., i, j]
    return np.asarray(np.einsum("fia,fqab,fjb->fqij", axes, stress, axes, optimize=True))
