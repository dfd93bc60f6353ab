"""Effects beyond tractions: what they do to a body in 2D or in 3D, assembled anew from plain
arrays.
"""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import csr_array

from benchmarks.stability.oracle import elements
from benchmarks.stability.oracle.elements import Array, at_points

if TYPE_CHECKING:
    from benchmarks.stability.oracle.body import Body

# Those with factors.
LOADS = ("force", "fluid", "gravity", "rotation", "temperature")


def listed(scene: dict[str, Any], key: str) -> list[dict[str, Any]]:
    """The tables of a key; a single one may stand without a list."""
    found = scene.get(key, [])
    return [found] if isinstance(found, dict) else found


def graded(body: Body, material: dict[str, Any]) -> Array:
    """What multiplies Young's modulus in each cell: the value in the middle of its corners."""
    return at_points(material.get("grading", 1.0), body.mesh.points[body.corners].mean(axis=1))


def is_orthotropic(body: Body) -> bool:
    """Whether a material has constants that depend on the direction."""
    return any("orthotropic" in material for material in listed(body.scene, "material"))


def orthotropic_matrices(body: Body, rule: tuple[Array, Array]) -> Array:
    """The stiffness matrix of every cell in 3D by a rule, with the tensor C_ijkl of each, turned as
    such.
    """
    tensors = np.zeros((len(body.cells), 3, 3, 3, 3))
    middle = body.mesh.points[body.corners].mean(axis=1)
    for material in listed(body.scene, "material"):
        where = body.of_region(material)
        if "orthotropic" in material:
            own, axes = (
                _along_axes(material["orthotropic"]),
                _axes(material["orthotropic"], middle[where]),
            )
            tensors[where] = np.einsum(
                "cia,cjb,ckd,cle,abde->cijkl", *[axes] * 4, own, optimize=True
            )
        else:
            young, poisson = material["young"], material["poisson"]
            tensors[where] = _along_axes(
                {
                    "young": [young] * 3,
                    "poisson": [poisson] * 3,
                    "shear": [young / 2 / (1 + poisson)] * 3,
                }
            )
    _, size, _, gradients = body.in_cells(rule)
    count, nodes = body.cells.shape
    total = np.zeros((count, nodes, 3, nodes, 3))
    for point in range(size.shape[1]):
        g = gradients[:, point]
        total += np.einsum("c,caj,cijkl,cbl->caibk", size[:, point], g, tensors, g, optimize=True)
    return total.reshape(count, 3 * nodes, 3 * nodes)


def _along_axes(constants: dict[str, Any]) -> Array:
    """C_abcd along the axes of a material."""
    young, flexible = constants["young"], np.diag(1 / np.array(constants["young"]))
    found = np.zeros((3, 3, 3, 3))
    for (i, j), ratio, shear in zip(
        ((0, 1), (0, 2), (1, 2)), constants["poisson"], constants["shear"], strict=True
    ):
        flexible[i, j] = flexible[j, i] = -ratio / young[i]
        for a, b in product(((i, j), (j, i)), repeat=2):
            found[*a, *b] = shear
    stiff = np.linalg.inv(flexible)
    for i, j in product(range(3), repeat=2):
        found[i, i, j, j] = stiff[i, j]
    return found


def _axes(constants: dict[str, Any], x: Array) -> Array:
    """The axes of a material at points, as columns, shape (n, 3, 3)."""
    rows = [
        np.stack([at_points(value, x) for value in constants.get(key, default)], axis=1)
        for key, default in (("direction", [1.0, 0.0, 0.0]), ("second", [0.0, 1.0, 0.0]))
    ]
    q, r = np.linalg.qr(np.stack(rows, axis=2))
    q = q * np.sign(np.diagonal(r, axis1=1, axis2=2))[:, None, :]
    return np.concatenate((q, np.cross(q[:, :, 0], q[:, :, 1])[:, :, None]), axis=2)


def forces(body: Body, key: str, load: dict[str, Any]) -> Array:
    """The nodal forces of one load, shape (nodes, d)."""
    if key == "temperature":
        return _of_temperature(body, load)
    return _on_boundary(body, key, load) if "boundary" in load else _in_body(body, key, load)


def _on_boundary(body: Body, key: str, load: dict[str, Any]) -> Array:
    """A total force, or a fluid."""
    varies = key == "fluid" or isinstance(load.get("spread"), str)
    facets, x, normal, weights, values = body.on_facets(load["boundary"], varies=varies)
    flat, size = x.reshape(-1, body.dim), np.linalg.norm(normal, axis=2)
    if key == "fluid":
        axis = "xy".index(load.get("up", "y"))
        depth = at_points(load["level"], flat).reshape(size.shape) - x[:, :, axis]
        density = -load["weight"] * np.maximum(depth, 0.0)[:, :, None] * normal
    else:
        spread = at_points(load.get("spread", 1.0), flat).reshape(size.shape) * size
        share = spread / (spread @ weights).sum()
        density = share[:, :, None] * np.array([load.get(k, 0.0) for k in "xyz"[: body.dim]])
    total = np.zeros(body.x.shape)
    np.add.at(total, facets.nodes, np.einsum("fpi,p,pk->fki", density, weights, values))
    return total


def _in_body(body: Body, key: str, load: dict[str, Any]) -> Array:
    """Weight, or centrifugal force."""
    x, size, values, _ = body.in_cells()
    density = body.of_materials("density")[:, None, None] * np.ones_like(x)
    if key == "gravity":
        density = density * np.array([load.get(k, 0.0) for k in "xyz"[: body.dim]])
    else:
        density = density * load["speed"] ** 2 * (x - np.array(load.get("about", (0.0, 0.0))))
    total = np.zeros(body.x.shape)
    np.add.at(total, body.cells, np.einsum("cpi,cp,pk->cki", density, size, values))
    return total


def _of_temperature(body: Body, load: dict[str, Any]) -> Array:
    """The stress of a prevented thermal strain e in all directions: (2 mu + k lambda) e, k = 2 in
    plane stress.
    """
    first, second = body.lame
    stressed = listed(body.scene, "material")[0].get("hypothesis", "plane strain") == "plane stress"
    here = np.zeros(len(body.cells))
    here[body.of_region(load)] = 1.0
    expansion = body.of_materials("expansion") * here
    shearing, volumetric = 2 * second, (2 if stressed else 3) * first
    reduced = elements.reduced_rule(body.dim, body.cells.shape[1])
    parts = (
        [(None, shearing), (reduced, volumetric)]
        if body.reduced
        else [(None, shearing + volumetric)]
    )
    total = np.zeros(body.x.shape)
    for rule, modulus in parts:
        x, size, _, gradients = body.in_cells(rule)
        change = at_points(load["change"], x.reshape(-1, body.dim)).reshape(size.shape)
        np.add.at(
            total,
            body.cells,
            np.einsum("c,cp,cpki->cki", modulus * expansion, change * size, gradients),
        )
    return total


def springs(body: Body) -> csr_array:
    """The stiffness of springs on boundaries, dofs as in ``Body.stiffness``."""
    total = csr_array((body.x.size, body.x.size))
    for spring in listed(body.scene, "springs"):
        facets, _, normal, weights, values = body.on_facets(spring["boundary"], varies=False)
        area = np.linalg.norm(normal, axis=2)
        n = normal / area[:, :, None]
        along = np.einsum("fpi,fpj->fpij", n, n)
        stiff = spring.get("normal", 0.0) * along + spring.get("tangential", 0.0) * (
            np.eye(body.dim) - along
        )
        stiff = stiff + np.diag([spring.get(k, 0.0) for k in "xyz"[: body.dim]])
        block = np.einsum(
            "fpij,fp,p,pk,pl->fkilj", stiff, area, weights, values, values, optimize=True
        )
        size = body.dim * facets.nodes.shape[1]
        total = total + body.assembled(block.reshape(-1, size, size), facets.nodes)
    return total


def from_shape(shape: dict[str, Any], x: Array) -> tuple[Array, Array]:
    """Distance and direction of the nearest point of a rigid plane, circle or sphere from points,
    shapes (n,) and (n, d).
    """
    if shape["shape"] == "plane":
        normal = np.array(shape["normal"]) / np.linalg.norm(shape["normal"])
        return (x - np.array(shape["point"])) @ normal, np.tile(-normal, (len(x), 1))
    arm = np.array(shape["centre"]) - x
    away = np.linalg.norm(arm, axis=1)
    return away - shape["radius"], arm / away[:, None]
