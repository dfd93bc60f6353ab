"""Stiffness of a mesh in several element formulations, of which one is that of the program that made a result.

Strains are xx, yy, zz, xy, xz, yz, of shear twice the tensor's; of a body of revolution zz is along the circumference.

- ``full``: as many points as the program takes for its plain elements;
- ``reduced``: one point less along each axis;
- ``B-bar``: the mean dilatation of each element (T. J. R. Hughes, The Finite Element Method, 1987, 4.5.2);
- ``exact``: to many digits, on distorted cells, too;
- ``selective``: lambda div(u) div(v) alone with one point less along each axis, on simplices of degree 2 with one
  (the same book, 4.4.2), the rest as ``full``; ``selective, exact``: the rest as ``exact``;
- ``incompatible``: quadratic modes that neighbours do not share, condensed, with the Jacobian of the centre, as in
  CalculiX (E. L. Wilson, R. L. Taylor, W. P. Doherty, J. Ghaboussi, Incompatible displacement models, 1973);
- ``incompatible, scaled``: the same times its determinant over that of the point, which represents uniform strain on
  distorted cells, too (R. L. Taylor, P. J. Beresford, E. L. Wilson, Int. J. Numer. Meth. Engng 10 (1976) 1211-1219);
- ``uniform strain``: the mean strain of a brick, and a stiffness against hourglassing (D. P. Flanagan, T. Belytschko,
  Int. J. Numer. Meth. Engng 17 (1981) 679-706) as CalculiX has it: of the hourglass modes it takes away the linear part
  along the third axis alone (``shape8hr.f``), so that on distorted cells they have forces under uniform strain, too.
  Plane cells are bricks of the given thickness, and those of revolution bricks of a sector.

Plane stress is also computed as programs do that know solids alone: a layer of bricks, whose displacements in the plane
are constant over the thickness, and whose faces move out of the plane by +w and -w, which is an unknown of each node.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
from scipy.sparse import coo_array, csr_array

from signorini_fx.addons.judging.problem_data import JudgedMaterial, JudgedProblem
from signorini_fx.addons.judging.reference_elements import stiffness_rule
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints
from signorini_fx.tuned import HALF_SECTOR_OF_CALCULIX, HOURGLASS_OF_CALCULIX

INCOMPATIBLE, SCALED, UNIFORM = "incompatible", "incompatible, scaled", "uniform strain"
SELECTIVE, SELECTIVE_EXACT = "selective", "selective, exact"
# Numbers of strains that are made at once.
_AT_ONCE = 4_000_000
_IN_PLANE = (0, 1, 3)
# The strain of a body that expands alike in all directions.
_ALIKE = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])


@dataclass(frozen=True)
class Formulation:
    """An element formulation.

    Attributes:
        name: that of the list above.
        layer: whether plane stress is a layer of bricks.
    """

    name: str
    layer: bool = False

    @property
    def further_points(self) -> int:
        """Of quadrature along each axis, besides those of plain elements."""
        return {"reduced": -1, "exact": 3}.get(self.name, 0)

    @property
    def words(self) -> str:
        """For messages."""
        words = {
            "full": "full integration",
            "reduced": "reduced integration",
            SELECTIVE: "selective reduced integration",
            SELECTIVE_EXACT: "selective reduced, else exact integration",
            "B-bar": "mean dilatation (B-bar)",
            INCOMPATIBLE: "incompatible modes",
            SCALED: "incompatible modes (Taylor)",
            UNIFORM: "uniform strain and hourglass control",
            "exact": "exact integration",
        }[self.name]
        return f"{words}, as a layer of bricks" if self.layer else words


FULL, EXACT, REDUCED = Formulation("full"), Formulation("exact"), Formulation("reduced")


def candidates(problem: JudgedProblem) -> list[Formulation]:
    """All formulations that there are for the cells of a problem; the plain ones first."""
    element = problem.mesh.element
    names = ["full"]
    if not element.simplex:
        names.append("reduced")
        if element.degree == 1:
            names += ["B-bar"] * (problem.hypothesis != "plane stress")
            names += [INCOMPATIBLE, SCALED] * (problem.hypothesis != "axisymmetric")
            names.append(UNIFORM)
    selective = problem.hypothesis != "plane stress" and (element.degree == 2 or not element.simplex)
    names += [SELECTIVE] * selective
    if element.degree == 2 or not element.simplex or problem.hypothesis == "axisymmetric":
        # Programs that generate quadrature from forms take more points on distorted cells, and of 1/r.
        names += ["exact", *[SELECTIVE_EXACT] * selective]
    if problem.hypothesis != "plane stress":
        return [Formulation(name) for name in names]
    plain = [Formulation(name) for name in names if name != UNIFORM]
    layers = [Formulation(name, layer=True) for name in names if name not in (INCOMPATIBLE, SCALED, "exact")]
    return layers + plain if problem.deck is not None else plain + layers  # a scene is no layer


def stiffness_by_material(problem: JudgedProblem, formulation: Formulation) -> list[csr_array]:
    """The stiffness that each material contributes, shape (n c, n c) with c unknowns at a node; see ``components``."""
    count = len(problem.mesh.points) * components(problem, formulation)
    matrices = []
    for material in problem.materials:
        blocks = [
            (numbers, _stiffness_of_cells(parts))
            for _, numbers, parts in _strains_in_blocks(problem, formulation, material)
        ]
        rows = [np.repeat(numbers, numbers.shape[1], axis=1).ravel() for numbers, _ in blocks]
        columns = [np.tile(numbers, numbers.shape[1]).ravel() for numbers, _ in blocks]
        values = [matrix.ravel() for _, matrix in blocks]
        entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns)))
        matrices.append(coo_array(entries, shape=(count, count)).tocsr())
    return matrices


def forces_of_strains(problem: JudgedProblem, formulation: Formulation) -> Floats:
    """The forces by which each material expands with each initial strain, shape (strains, materials, n c)."""
    count = len(problem.mesh.points) * components(problem, formulation)
    forces = np.zeros((len(problem.strains), len(problem.materials), count))
    for number, material in enumerate(problem.materials if problem.strains else ()):
        for cells, numbers, parts in _strains_in_blocks(problem, formulation, material):
            for row, strain in enumerate(problem.strains):
                for part in parts:
                    values = strain.values(cells, part.shape, part.x)
                    np.add.at(forces[row, number], numbers, _expansion(part, values))
    return forces


def square_of_strains(problem: JudgedProblem) -> float:
    """Int eps_0 : C eps_0 of all initial strains together, with full integration, an energy; eps_0 is the strain with
    the same stress that a displacement can have, so that in plane strain no work across the plane is in it.
    """
    square = 0.0
    for material in problem.materials if problem.strains else ():
        for cells, _, parts in _strains_in_blocks(problem, FULL, material):
            for part in parts:
                moving = np.flatnonzero(part.strains.any(axis=(0, 1, 3)))
                stress = (part.stiffness @ _ALIKE)[..., moving]
                stiffness = part.stiffness[..., moving[:, None], moving]
                work = (stress * np.linalg.solve(stiffness, stress[..., None])[..., 0]).sum(axis=-1)
                values = sum(strain.values(cells, part.shape, part.x) for strain in problem.strains)
                square += float((part.measure * values**2 * work).sum())
    return square


def _expansion(part: _StrainsOfCells, values: Floats) -> Floats:
    """The forces of an initial strain in cells: of its values at points, shape (m, q) -> (m, a)."""
    stress = part.stiffness @ _ALIKE
    weighted = part.measure * np.tile(values, (1, part.measure.shape[1] // values.shape[1]))
    forces = np.einsum("mqia,mqi->ma", part.strains, weighted[..., None] * stress)
    if part.inner == forces.shape[1]:
        return np.asarray(forces)
    within = np.linalg.solve(part.product[:, part.inner :, part.inner :], forces[:, part.inner :, None])
    return np.asarray(forces[:, : part.inner] - (part.product[:, : part.inner, part.inner :] @ within)[..., 0])


def components(problem: JudgedProblem, formulation: Formulation) -> int:
    """Unknowns at a node: those of the displacement, and of a layer the one out of its plane."""
    return problem.mesh.dim + formulation.layer


@dataclass(frozen=True)
class _StrainsOfCells:
    """What gives the stiffness of cells, or a part of it.

    Attributes:
        strains: of unit displacements at points, and of modes within the cells, shape (m, r, 6, a).
        measure: weights of the points, shape (m, r).
        stiffness: stresses from strains, shape (6, 6), or of each cell, shape (m, 1, 6, 6).
        shape: of the nodes at the points in the plane or in space, shape (q, k); r is q, of a layer 2 q.
        x: these points, length, shape (m, q, d).
        inner: how many of the unknowns are displacements; the others are condensed.
        further: stiffness that no strain has, shape (m, a, a) or 0.
    """

    strains: Floats
    measure: Floats
    stiffness: Floats
    shape: Floats
    x: Floats
    inner: int
    further: Floats | float = 0.0

    @cached_property
    def product(self) -> Floats:
        """The stiffness before modes are condensed, shape (m, a, a)."""
        rows = self.strains.reshape(len(self.x), -1, self.strains.shape[3])
        stresses = (self.measure[..., None, None] * (self.stiffness @ self.strains)).reshape(rows.shape)
        return np.asarray(rows.transpose(0, 2, 1) @ stresses)


def _stiffness_of_cells(parts: list[_StrainsOfCells]) -> Floats:
    """Shape (m, a, a)."""
    return np.sum([_condensed(part.product, part.inner) + part.further for part in parts], axis=0)


def _condensed(matrix: Floats, inner: int) -> Floats:
    """Matrices without unknowns behind the first ones, shape (m, a, a) -> (m, inner, inner)."""
    if inner == matrix.shape[1]:
        return matrix
    coupling = matrix[:, :inner, inner:]
    return np.asarray(
        matrix[:, :inner, :inner] - coupling @ np.linalg.solve(matrix[:, inner:, inner:], matrix[:, inner:, :inner])
    )


def _strains_in_blocks(
    problem: JudgedProblem, formulation: Formulation, material: JudgedMaterial
) -> Iterator[tuple[Ints, Ints, list[_StrainsOfCells]]]:
    """Some cells of a material after others, the numbers of their unknowns, shape (m, a), and their strains."""
    mesh, c = problem.mesh, components(problem, formulation)
    width = mesh.cells.shape[1] * c
    places, _ = stiffness_rule(mesh.element, formulation.further_points)
    at_once = max(1, _AT_ONCE // (len(places) * 6 * width))
    everywhere = material.stiffness if formulation.layer else elastic_stiffness(problem, material.stiffness)
    for start in range(0, len(material.cells), at_once):
        cells = material.cells[start : start + at_once]
        stiffness = everywhere[start : start + at_once, None] if material.varies else everywhere
        nodes = mesh.cells[cells]
        numbers = (nodes[:, :, None] * c + np.arange(c)).reshape(len(nodes), -1)
        yield cells, numbers, _strains_of_cells(problem, formulation, mesh.points[nodes], stiffness)


def elastic_stiffness(problem: JudgedProblem, stiffness: Floats) -> Floats:
    """That of a material in a problem, shape (..., 6, 6): in plane stress there is no stress across the plane."""
    if problem.hypothesis != "plane stress":
        return stiffness
    plane = np.zeros_like(stiffness)
    rows, columns = np.ix_(_IN_PLANE, _IN_PLANE)
    compliance = np.linalg.inv(stiffness)
    plane[..., rows, columns] = np.linalg.inv(compliance[..., rows, columns])
    return plane


def _strains_of_cells(
    problem: JudgedProblem, formulation: Formulation, x: Floats, stiffness: Floats
) -> list[_StrainsOfCells]:
    """The parts of the stiffness of cells with the nodes x, shape (m, k, d)."""
    if formulation.name == UNIFORM:
        return [_uniform_strain(problem, formulation, x, stiffness)]
    if formulation.name in (SELECTIVE, SELECTIVE_EXACT):
        dilatation = np.zeros_like(stiffness)
        dilatation[..., :3, :3] = stiffness[..., 0, 1][..., None, None]
        plain_rule = FULL if formulation.name == SELECTIVE else EXACT
        parts = (plain_rule, stiffness - dilatation), (REDUCED, dilatation)
        return [part for rule, share in parts for part in _strains_of_cells(problem, rule, x, share)]
    element = problem.mesh.element
    places, weights = stiffness_rule(element, formulation.further_points)
    shape, reference = element.shape(places), element.gradient(places)
    jacobian = np.einsum("qkj,mkd->mqdj", reference, x)
    size = np.linalg.det(jacobian)
    gradient = np.einsum("qkj,mqjd->mqkd", reference, np.linalg.inv(jacobian))
    radius = np.einsum("qk,mk->mq", shape, x[..., 0]) if problem.hypothesis == "axisymmetric" else None
    measure = np.abs(size) * weights * (1.0 if radius is None else radius)
    strains = _strains(gradient, shape, radius)
    if formulation.layer:
        strains, measure = _in_a_layer(strains, gradient, shape, measure, problem.thickness)
    if formulation.name == "B-bar":
        strains = _mean_dilatation(strains, measure)
    inner = strains.shape[3]
    if formulation.name in (INCOMPATIBLE, SCALED):
        centre = np.einsum("qkj,mkd->mqdj", element.gradient(np.full((1, element.dim), 0.5)), x)[:, 0]
        further = _incompatible_modes(places, jacobian, centre, scaled=formulation.name == SCALED)
        strains = np.concatenate((strains, _strains(further, shape, None)), axis=3)
    return [_StrainsOfCells(strains, measure, stiffness, shape, np.einsum("qk,mkd->mqd", shape, x), inner)]


def _uniform_strain(problem: JudgedProblem, formulation: Formulation, x: Floats, stiffness: Floats) -> _StrainsOfCells:
    """Those of bricks with uniform strain, and of plane cells that are such bricks: ``_strains_of_cells``."""
    element = problem.mesh.element
    centre = element.shape(np.full((1, element.dim), 0.5))
    at_centre = np.einsum("qk,mkd->mqd", centre, x)
    corners = 2 * element.nodes - 1.0
    thickness, moves = 1.0, np.eye(24)
    if problem.mesh.dim == 2:
        corners, x, moves, thickness = _as_bricks(problem, formulation, corners, x)
    gradient, volume = _mean_gradient(corners, x)
    strains = np.asarray(_strains(gradient[:, None], np.zeros((1, 8)), None) @ moves, dtype=np.float64)
    xi, eta, zeta = corners.T
    # Their linear part along the third axis is taken away, as by CalculiX, and not those along the others.
    modes = np.stack((eta * zeta, xi * zeta, xi * eta, xi * eta * zeta), axis=1)
    modes = modes - gradient[..., 2:] @ (x[..., 2:].transpose(0, 2, 1) @ modes)
    young = (1 / np.linalg.inv(stiffness)[..., 0, 0]).reshape(-1)
    factor = HOURGLASS_OF_CALCULIX * young * volume * (gradient**2).sum(axis=(1, 2))
    against = factor[:, None, None] * (modes @ modes.transpose(0, 2, 1))
    hourglass = np.einsum("mab,ij->maibj", against, np.eye(3)).reshape(len(x), 24, 24)
    further = np.asarray(moves.T @ hourglass @ moves / thickness, dtype=np.float64)
    measure = np.asarray(volume[:, None] / thickness, dtype=np.float64)
    return _StrainsOfCells(strains, measure, stiffness, centre, at_centre, strains.shape[3], further)


def _as_bricks(
    problem: JudgedProblem, formulation: Formulation, corners: Floats, x: Floats
) -> tuple[Floats, Floats, Floats, float]:
    """Bricks of plane cells or of those of a body of revolution: corners of the reference cell and nodes, as of
    ``_mean_gradient``, how they move with the unknowns of the cell, shape (24, a), and their thickness (an angle).
    """
    revolved, width = problem.hypothesis == "axisymmetric", components(problem, formulation)
    thickness = 2 * HALF_SECTOR_OF_CALCULIX if revolved else problem.thickness
    nodes, faces = [], np.zeros((2, 4, 3, 4, width))
    for face, side in enumerate((-1.0, 1.0)):
        ways = np.eye(3)[:, :width] * (1.0, 1.0, side)[:width]
        height = np.full(x.shape[:2], side * thickness / 2)
        if revolved:
            ways[:, 0] = np.cos(thickness / 2), 0.0, side * np.sin(thickness / 2)
            nodes.append(x @ ways.T)
        else:
            nodes.append(np.concatenate((x, height[..., None]), axis=2))
        for axis, unknown in np.ndindex(ways.shape):
            faces[face, :, axis, :, unknown] = ways[axis, unknown] * np.eye(4)
    heights = np.repeat((-1.0, 1.0), 4)[:, None]
    corners = np.hstack((np.tile(corners, (2, 1)), heights))
    return corners, np.concatenate(nodes, axis=1), faces.reshape(24, 4 * width), thickness


def _mean_gradient(corners: Floats, x: Floats) -> tuple[Floats, Floats]:
    """Of the shape functions of bricks the mean of their gradients, and the volumes, shapes (m, 8, 3) and (m,).

    Args:
        corners: of the reference cell from -1 to 1, shape (8, 3).
        x: nodes, length, shape (m, 8, 3).
    """
    at = np.array(list(product((-1.0, 1.0), repeat=3))) / np.sqrt(3)
    factors = 1 + at[:, None] * corners
    reference = np.stack(
        [corners[:, axis] * np.delete(factors, axis, axis=2).prod(axis=2) / 8 for axis in range(3)], axis=2
    )
    jacobian = np.einsum("qkj,mkd->mqdj", reference, x)
    size = np.abs(np.linalg.det(jacobian))
    gradient = np.einsum("mq,qkj,mqjd->mkd", size, reference, np.linalg.inv(jacobian))
    volume = size.sum(axis=1)
    return np.asarray(gradient / volume[:, None, None]), np.asarray(volume)


def _strains(gradient: Floats, shape: Floats, radius: Floats | None) -> Floats:
    """Strains of unit displacements, node by node, shape (m, q, 6, k d).

    Args:
        gradient: of the shape functions, shape (m, q, k, d).
        shape: themselves, shape (q, k).
        radius: of the points of a body of revolution, shape (m, q); None: it is another one.
    """
    m, q, k, d = gradient.shape
    strains = np.zeros((m, q, 6, k, d))
    for axis in range(d):
        strains[:, :, axis, :, axis] = gradient[..., axis]
    shears = ((3, 0, 1),) if d == 2 else ((3, 0, 1), (4, 0, 2), (5, 1, 2))
    for row, first, second in shears:
        strains[:, :, row, :, first] = gradient[..., second]
        strains[:, :, row, :, second] = gradient[..., first]
    if radius is not None:
        strains[:, :, 2, :, 0] = shape[None] / radius[..., None]
    return strains.reshape(m, q, 6, k * d)


def _in_a_layer(
    strains: Floats, gradient: Floats, shape: Floats, measure: Floats, thickness: float
) -> tuple[Floats, Floats]:
    """Strains with the displacement of the faces out of the plane, at two heights, and the measure of each."""
    m, q, _, width = strains.shape
    k = gradient.shape[2]
    at_heights = []
    for height in (-1 / np.sqrt(3), 1 / np.sqrt(3)):
        layer = np.zeros((m, q, 6, k, 3))
        layer[..., :2] = strains.reshape(m, q, 6, k, width // k)
        layer[:, :, 2, :, 2] = 2 / thickness * shape
        layer[:, :, 4, :, 2] = height * gradient[..., 0]
        layer[:, :, 5, :, 2] = height * gradient[..., 1]
        at_heights.append(layer.reshape(m, q, 6, 3 * k))
    return np.concatenate(at_heights, axis=1), np.concatenate((measure, measure), axis=1) / 2


def _mean_dilatation(strains: Floats, measure: Floats) -> Floats:
    """Strains whose dilatation is its mean over the cell."""
    dilatation = strains[:, :, :3].sum(axis=2)
    mean = np.einsum("mq,mqa->ma", measure, dilatation) / measure.sum(axis=1)[:, None]
    strains = strains.copy()
    strains[:, :, :3] += ((mean[:, None] - dilatation) / 3)[:, :, None]
    return strains


def _incompatible_modes(places: Floats, jacobian: Floats, centre: Floats, *, scaled: bool) -> Floats:
    """Gradients of the modes 1 - xi^2 along each axis, with the Jacobian of the centre, shape (m, q, d, d)."""
    modes = np.einsum("qj,jl->qjl", 1 - 2 * places, np.eye(places.shape[1]))
    gradients = np.einsum("qkj,mjd->mqkd", modes, np.linalg.inv(centre))
    if scaled:
        gradients *= (np.linalg.det(centre)[:, None] / np.linalg.det(jacobian))[..., None, None]
    return np.asarray(gradients)
