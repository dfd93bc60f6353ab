"""Effects beyond tractions: what they do to a body in 2D, assembled anew from plain arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import coo_array, csr_array

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


def forces(body: Body, key: str, load: dict[str, Any]) -> Array:
    """The nodal forces of one load, shape (nodes, 2)."""
    if key == "temperature":
        return _of_temperature(body, load)
    return _on_boundary(body, key, load) if "boundary" in load else _in_body(body, key, load)


def _on_boundary(body: Body, key: str, load: dict[str, Any]) -> Array:
    """A total force, or a fluid."""
    varies = key == "fluid" or isinstance(load.get("spread"), str)
    s, weights = elements.gauss(11 if varies else body.degree + 2)
    values, _ = elements.line(body.degree, s)
    x, normal = body.facet_frames(load["boundary"], s)
    flat, size = x.reshape(-1, 2), np.linalg.norm(normal, axis=2)
    if key == "fluid":
        axis = "xy".index(load.get("up", "y"))
        depth = at_points(load["level"], flat).reshape(size.shape) - x[:, :, axis]
        density = -load["weight"] * np.maximum(depth, 0.0)[:, :, None] * normal
    else:
        spread = at_points(load.get("spread", 1.0), flat).reshape(size.shape) * size
        share = spread / (spread @ weights).sum()
        density = share[:, :, None] * np.array([load.get("x", 0.0), load.get("y", 0.0)])
    total = np.zeros((len(body.x), 2))
    np.add.at(total, body.facet_nodes(load["boundary"]), np.einsum("fpi,p,pk->fki", density, weights, values))
    return total


def _cells(body: Body) -> tuple[Array, Array, Array, Array]:
    """Points of cells with their weights, shape (cells, points), values and gradients of the shape functions there."""
    xi, weights = elements.triangle(6) if body.corners.shape[1] == 3 else elements.square(body.degree + 2)
    values, slopes = elements.shape(body.cells.shape[1], xi)
    place, _ = elements.shape(body.mesh.cells.shape[1], xi)
    jacobian = body.jacobian(xi)
    gradients = np.einsum("pkj,cpji->cpki", slopes, np.linalg.inv(jacobian))
    x = np.einsum("cki,pk->cpi", body.mesh.points[body.mesh.cells], place)
    return x, np.abs(np.linalg.det(jacobian)) * weights, values, gradients


def _in_body(body: Body, key: str, load: dict[str, Any]) -> Array:
    """Weight, or centrifugal force."""
    x, size, values, _ = _cells(body)
    density = body.of_materials("density")[:, None, None] * np.ones_like(x)
    if key == "gravity":
        density = density * np.array([load.get("x", 0.0), load.get("y", 0.0)])
    else:
        density = density * load["speed"] ** 2 * (x - np.array(load.get("about", (0.0, 0.0))))
    total = np.zeros((len(body.x), 2))
    np.add.at(total, body.cells, np.einsum("cpi,cp,pk->cki", density, size, values))
    return total


def _of_temperature(body: Body, load: dict[str, Any]) -> Array:
    """The stress of a prevented thermal strain e in all directions: (2 mu + k lambda) e, k = 2 in plane stress."""
    first, second = body.lame
    stressed = listed(body.scene, "material")[0].get("hypothesis", "plane strain") == "plane stress"
    expansion = body.of_materials("expansion")
    if "region" in load:
        here = np.zeros(len(body.cells))
        here[body.mesh.regions[load["region"]]] = 1.0
        expansion = expansion * here
    x, size, _, gradients = _cells(body)
    change = at_points(load["change"], x.reshape(-1, 2)).reshape(size.shape)
    shearing = np.einsum("c,cp,cpki->cki", 2 * second * expansion, change * size, gradients)
    if body.reduced:
        xi, weights = elements.reduced_rule(body.cells.shape[1])
        place, _ = elements.shape(body.mesh.cells.shape[1], xi)
        _, slopes = elements.shape(body.cells.shape[1], xi)
        jacobian = body.jacobian(xi)
        x = np.einsum("cki,pk->cpi", body.mesh.points[body.mesh.cells], place)
        size = np.abs(np.linalg.det(jacobian)) * weights
        gradients = np.einsum("pkj,cpji->cpki", slopes, np.linalg.inv(jacobian))
        change = at_points(load["change"], x.reshape(-1, 2)).reshape(size.shape)
    directions = 2 if stressed else 3
    volumetric = np.einsum("c,cp,cpki->cki", directions * first * expansion, change * size, gradients)
    total = np.zeros((len(body.x), 2))
    np.add.at(total, body.cells, shearing + volumetric)
    return total


def springs(body: Body) -> csr_array:
    """The stiffness of springs on boundaries, dofs as in ``Body.stiffness``."""
    size, rows, columns, entries = 2 * len(body.x), [], [], []
    for spring in listed(body.scene, "springs"):
        s, weights = elements.gauss(body.degree + 2)
        values, _ = elements.line(body.degree, s)
        _, normal = body.facet_frames(spring["boundary"], s)
        length = np.linalg.norm(normal, axis=2)
        n = normal / length[:, :, None]
        across = np.einsum("fpi,fpj->fpij", n, n)
        stiff = spring.get("normal", 0.0) * across + spring.get("tangential", 0.0) * (np.eye(2) - across)
        stiff = stiff + np.diag([spring.get("x", 0.0), spring.get("y", 0.0)])
        block = np.einsum("fpij,fp,p,pk,pl->fkilj", stiff, length, weights, values, values)
        dofs = 2 * body.facet_nodes(spring["boundary"])[:, :, None] + np.arange(2)
        row, column = np.broadcast_arrays(dofs[:, :, :, None, None], dofs[:, None, None, :, :])
        rows.append(row.ravel())
        columns.append(column.ravel())
        entries.append(block.ravel())
    if not rows:
        return csr_array((size, size))
    pairs = np.concatenate(rows), np.concatenate(columns)
    return coo_array((np.concatenate(entries), pairs), shape=(size, size)).tocsr()


def from_shape(shape: dict[str, Any], x: Array) -> tuple[Array, Array]:
    """Distance and direction of the nearest point of a rigid plane or circle from points, shapes (n,) and (n, 2)."""
    if shape["shape"] == "plane":
        normal = np.array(shape["normal"]) / np.linalg.norm(shape["normal"])
        return (x - np.array(shape["point"])) @ normal, np.tile(-normal, (len(x), 1))
    arm = np.array(shape["centre"]) - x
    away = np.linalg.norm(arm, axis=1)
    return away - shape["radius"], arm / away[:, None]
