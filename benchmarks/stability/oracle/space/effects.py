"""Effects beyond tractions: what they do to a body in 3D, assembled anew from plain arrays."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import coo_array, csr_array

from benchmarks.stability.oracle import elements as plane
from benchmarks.stability.oracle.body import listed
from benchmarks.stability.oracle.elements import Array, at_points
from benchmarks.stability.oracle.space import elements

if TYPE_CHECKING:
    from benchmarks.stability.oracle.space.body import Body

# Those with factors.
LOADS = ("force", "gravity", "temperature")


def is_orthotropic(body: Body) -> bool:
    """Whether a material has constants that depend on the direction."""
    return any("orthotropic" in material for material in listed(body.scene, "material"))


def orthotropic_matrices(body: Body, rule: tuple[Array, Array]) -> Array:
    """The stiffness matrix of every cell by a rule, with the tensor C_ijkl of each, turned as such."""
    tensors = np.zeros((len(body.cells), 3, 3, 3, 3))
    middle = body.mesh.points[body.corners].mean(axis=1)
    for material in listed(body.scene, "material"):
        where = body.mesh.regions[material["region"]] if "region" in material else np.arange(len(body.cells))
        if "orthotropic" in material:
            own, axes = _along_axes(material["orthotropic"]), _axes(material["orthotropic"], middle[where])
            tensors[where] = np.einsum("cia,cjb,ckd,cle,abde->cijkl", *[axes] * 4, own, optimize=True)
        else:
            young, poisson = material["young"], material["poisson"]
            tensors[where] = _along_axes(
                {"young": [young] * 3, "poisson": [poisson] * 3, "shear": [young / 2 / (1 + poisson)] * 3}
            )
    xi, weights = rule
    _, slopes = elements.shape(body.cells.shape[1], xi)
    jacobian = body.jacobian(xi)
    count, nodes = body.cells.shape
    total = np.zeros((count, nodes, 3, nodes, 3))
    for point, weight in enumerate(weights):
        g = np.einsum("kj,cji->cki", slopes[point], np.linalg.inv(jacobian[:, point]))
        size = np.abs(np.linalg.det(jacobian[:, point])) * weight
        total += np.einsum("c,caj,cijkl,cbl->caibk", size, g, tensors, g, optimize=True)
    return total.reshape(count, 3 * nodes, 3 * nodes)


def _along_axes(constants: dict[str, Any]) -> Array:
    """C_abcd along the axes of a material."""
    young, flexible = constants["young"], np.diag(1 / np.array(constants["young"]))
    found = np.zeros((3, 3, 3, 3))
    for (i, j), ratio, shear in zip(((0, 1), (0, 2), (1, 2)), constants["poisson"], constants["shear"], strict=True):
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
    """The nodal forces of one load, shape (nodes, 3)."""
    total = np.zeros((len(body.x), 3))
    if key == "force":
        facets = body.facets(load["boundary"])
        xi, weights = body.rule(11 if isinstance(load.get("spread"), str) else body.degree + 2)
        values, _ = plane.shape(facets.nodes.shape[1], xi)
        x, normal = body.frames(facets, xi)
        area = np.linalg.norm(normal, axis=2)
        spread = at_points(load.get("spread", 1.0), x.reshape(-1, 3)).reshape(area.shape) * area
        density = (spread / (spread @ weights).sum())[:, :, None] * np.array([load.get(k, 0.0) for k in "xyz"])
        np.add.at(total, facets.nodes, np.einsum("fpi,p,pk->fki", density, weights, values))
        return total
    if key == "gravity":
        xi, weights = elements.tetrahedron(5) if body.corners.shape[1] == 4 else elements.cube(body.degree + 2)
        values, _ = elements.shape(body.cells.shape[1], xi)
        size = np.abs(np.linalg.det(body.jacobian(xi))) * weights * body.of_materials("density")[:, None]
        density = size[:, :, None] * np.array([load.get(k, 0.0) for k in "xyz"])
        np.add.at(total, body.cells, np.einsum("cpi,pk->cki", density, values))
        return total
    # The stress of a prevented thermal strain e in all directions: (2 mu + 3 lambda) e.
    first, second = body.lame
    expansion = body.of_materials("expansion")
    whole = elements.tetrahedron(5) if body.corners.shape[1] == 4 else elements.cube(body.degree + 2)
    for (xi, weights), modulus in (
        (whole, 2 * second if body.reduced else 2 * second + 3 * first),
        *([(elements.reduced_rule(body.cells.shape[1]), 3 * first)] if body.reduced else []),
    ):
        _, slopes = elements.shape(body.cells.shape[1], xi)
        place, _ = elements.shape(body.mesh.cells.shape[1], xi)
        jacobian = body.jacobian(xi)
        size = np.abs(np.linalg.det(jacobian)) * weights
        x = np.einsum("cki,pk->cpi", body.mesh.points[body.mesh.cells], place)
        change = at_points(load["change"], x.reshape(-1, 3)).reshape(size.shape)
        gradients = np.einsum("pkj,cpji->cpki", slopes, np.linalg.inv(jacobian))
        np.add.at(total, body.cells, np.einsum("c,cp,cpki->cki", modulus * expansion, change * size, gradients))
    return total


def springs(body: Body) -> csr_array:
    """The stiffness of springs on boundaries, dofs as in ``Body.stiffness``."""
    size = 3 * len(body.x)
    total = csr_array((size, size))
    for spring in listed(body.scene, "springs"):
        facets = body.facets(spring["boundary"])
        xi, weights = body.rule(body.degree + 2)
        values, _ = plane.shape(facets.nodes.shape[1], xi)
        _, normal = body.frames(facets, xi)
        area = np.linalg.norm(normal, axis=2)
        n = normal / area[:, :, None]
        across = np.einsum("fpi,fpj->fpij", n, n)
        stiff = spring.get("normal", 0.0) * across + spring.get("tangential", 0.0) * (np.eye(3) - across)
        stiff = stiff + np.diag([spring.get(k, 0.0) for k in "xyz"])
        block = np.einsum("fpij,fp,p,pk,pl->fkilj", stiff, area, weights, values, values, optimize=True)
        dofs = 3 * facets.nodes[:, :, None] + np.arange(3)
        rows, columns = np.broadcast_arrays(dofs[:, :, :, None, None], dofs[:, None, None, :, :])
        total += coo_array((block.ravel(), (rows.ravel(), columns.ravel())), shape=(size, size)).tocsr()
    return total
