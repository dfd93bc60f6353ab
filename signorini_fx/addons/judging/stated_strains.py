"""The initial strains of a scene in the cells of a mesh, and as programs take them between nodes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from signorini_fx.addons.judging.problem_data import JudgedMaterial, JudgedMesh, JudgedStrain
from signorini_fx.addons.judging.reference_elements import ReferenceElement, gauss
from signorini_fx.addons.judging.stated_loads import LoadPoints, switches_inside
from signorini_fx.mechanics.mesh.files.shape import Floats, Ints
from signorini_fx.mechanics.statement.effect import InitialStrain
from signorini_fx.mechanics.statement.expressions import Expression, in_space, sample
from signorini_fx.mechanics.statement.statement import Statement


@dataclass(frozen=True)
class CellPoints(LoadPoints):
    """Points of cells, ``statement.effect.BodyPoints``.

    Attributes:
        expansion: coefficient of thermal expansion, 1 / temperature, shape (f, q).
        cells: numbers, shape (f,).
        regions: name -> its cells.
    """

    expansion: Floats
    cells: Ints
    regions: Mapping[str, Ints]

    def value_in(self, region: str | None, value: Any) -> Floats:
        """See ``BodyCoefficients``."""
        if region is None:
            return self.value(value)
        values, rows = np.zeros(self.x.shape[:2]), np.isin(self.cells, self.regions[region])
        values[rows] = sample(value, in_space(self.x[rows].reshape(-1, self.x.shape[2]))).reshape(-1, self.x.shape[1])
        return values


def strains_of(
    statement: Statement, position: float, mesh: JudgedMesh, materials: tuple[JudgedMaterial, ...]
) -> tuple[JudgedStrain, ...]:
    """The initial strains of a scene: expressions at each point, others between nodes by shape functions.

    Args:
        statement: what is stated.
        position: in the lists of factors.
        mesh: the mesh.
        materials: of the body.
    """
    strains: list[JudgedStrain] = []
    expansion = np.zeros(len(mesh.cells))
    for material in materials:
        expansion[material.cells] = material.expansion or 0.0
    for _, entry in statement.listed():
        if not entry.acts or not isinstance(entry, InitialStrain):
            continue
        factor, strain = statement.now(entry, position)
        if factor == 0:  # that of another load step
            continue
        at = partial(_at_points, strain, factor, mesh, expansion)
        everywhere = np.arange(len(mesh.cells))
        varies = any(isinstance(value, Expression) for value in strain.given.values())
        name = strain.name
        while name in {listed.name for listed in strains}:
            name += "'"
        x = mesh.points[mesh.cells]
        switches = switches_inside(strain, mesh.element, x, kinks=True)
        strains.append(JudgedStrain(name, at(everywhere, x), at if varies else None, switches))
    return tuple(strains)


def _at_points(
    strain: InitialStrain, factor: float, mesh: JudgedMesh, expansion: Floats, cells: Ints, x: Floats
) -> Floats:
    """A strain at points of cells, shape (c, q, d) -> (c, q)."""
    nothing = np.zeros(x.shape[:2])
    of_cells = np.broadcast_to(expansion[cells, None], nothing.shape)
    points = CellPoints(x, np.zeros_like(x), nothing, nothing, of_cells, cells, mesh.regions)
    return factor * np.asarray(strain.strain_at(points))


def strains_by_reading(element: ReferenceElement, strains: tuple[JudgedStrain, ...]) -> dict[str, Any]:
    """Initial strains as programs may take them between the nodes, by what is to be said of it; nothing if they are
    constant in each cell.

    Args:
        element: that of the cells.
        strains: as they are stated.
    """
    if not any(np.ptp(strain.at_nodes, axis=1).any() for strain in strains):
        return {}
    at_nodes: dict[str, Floats] = {
        "initial strains constant in each element": np.full((len(element.nodes),) * 2, 1 / len(element.nodes))
    }
    if element.degree == 2:
        linear = element.linear.shape(element.nodes)
        at_corners = np.zeros((len(element.nodes), len(element.nodes)))
        at_corners[:, : linear.shape[1]] = linear
        at_nodes["initial strains linear between the corners of each element"] = at_corners
    if element.degree == 2 and not element.simplex:  # as CalculiX has it (``lintemp.f``)
        places, _ = gauss(2, element.dim)
        at_places = np.linalg.solve(element.linear.shape(places), element.shape(places))
        at_nodes["initial strains linear between the points of reduced integration"] = linear @ at_places
    if any(strain.between is not None for strain in strains):
        at_nodes["initial strains interpolated between nodes"] = np.eye(len(element.nodes))
    return {
        words: tuple(
            replace(strain, at_nodes=strain.at_nodes @ weights.T, between=None, switches=False) for strain in strains
        )
        for words, weights in at_nodes.items()
    }
