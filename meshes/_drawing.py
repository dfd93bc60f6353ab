"""How generators mesh what they draw, surfaces and solids; they get the initialised module gmsh."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx.mechanics.mesh.files.gmsh_reader import set_order
from signorini_fx.meshes import refuse
from signorini_fx.tuned import DIGITS_OF_FILES

# A function of points of shape (3, n) that says which of them are on a surface.
Surface = Callable[[npt.NDArray[np.float64]], npt.NDArray[np.bool_]]
# More facets than this along the zone of small cells, or along the body, are a mistake in the
# input.
_MOST_FACETS = 5000


@dataclass(frozen=True)
class Drawing:
    """A scaled gmsh model: the tolerances of gmsh are absolute, so the numbers should be the same
    in all units.
    """

    gmsh: Any  # the initialised module
    unit: float  # length of the model's unit

    def length(self, length: float) -> float:
        """A length in the model's unit, the same number in all units of the scene: a mesh depends
        on every last bit.
        """
        return float(f"{length / self.unit:.12g}")

    def point(self, x: float, y: float) -> int:
        """A point at a position in units of the scene."""
        tag: int = self.gmsh.model.geo.addPoint(x / self.unit, y / self.unit, 0.0)
        return tag


@dataclass(frozen=True)
class Sizes:
    """The length of facets: ``near`` up to the distance ``zone`` from the places, growing to
    ``far`` at ``reach``.
    """

    near: float
    far: float
    zone: float
    reach: float

    def at(self, distance: Any) -> Any:
        """Length at distances from the places."""
        ends = [self.zone, max(self.reach, self.zone * (1 + 1e-9))]
        return np.interp(distance, ends, [min(self.near, self.far), self.far])


def _refuse_short(sizes: Sizes, fine: float) -> None:
    """Refuse facets that are too short for the zone where they are fine, or for the body."""
    for name, short, long in (("contact_size", sizes.near, fine), ("size", sizes.far, sizes.reach)):
        if long / short > _MOST_FACETS:
            refuse(name, f"{short:g} is too short: {long / short:.2g} facets along {long:g}")


def mesh_surface(
    drawing: Drawing,
    bodies: Sequence[int],
    boundaries: Mapping[str, Sequence[int]],
    sizes: Sizes,
    *,
    points: Sequence[int] = (),
    curves: Sequence[int] = (),
    cell: str = "triangle",
    order: int = 1,
) -> None:
    """Mesh surfaces, fine near some points and curves, and name their parts: the body is ``body``.

    Args:
        drawing: the model, not yet synchronised.
        bodies: surfaces.
        boundaries: name -> curves.
        sizes: lengths of the facets.
        points: where they are small.
        curves: where they are small.
        cell: ``triangle`` or ``quadrilateral``.
        order: degree of the geometry; 2: facets and cells have nodes between, which are on the
            arcs.

    Raises:
        SceneError: the facets are so short that no machine could mesh the body.
    """
    _refuse_short(sizes, max(sizes.reach, sizes.zone) if curves else sizes.zone)
    gmsh = drawing.gmsh
    unit = drawing.unit
    geo = gmsh.model.geo
    fields = gmsh.model.mesh.field
    if cell == "quadrilateral":
        for body in bodies:
            geo.mesh.setRecombine(2, body)
    geo.synchronize()
    # A subdivision of all cells makes a pure quadrilateral mesh of facets half as long.
    stretch = 2.0 if cell == "quadrilateral" else 1.0
    distance = fields.add("Distance")
    threshold = fields.add("Threshold")
    fields.setNumbers(distance, "PointsList", list(points))
    fields.setNumbers(distance, "CurvesList", list(curves))
    fields.setNumber(distance, "Sampling", 200)
    settings = {
        "InField": distance,
        "SizeMin": stretch * min(sizes.near, sizes.far) / unit,
        "SizeMax": stretch * sizes.far / unit,
        "DistMin": sizes.zone / unit,
        "DistMax": max(sizes.reach, sizes.zone) / unit,
    }
    for name, value in settings.items():
        fields.setNumber(threshold, name, value)
    fields.setAsBackgroundMesh(threshold)
    for option in ("MeshSizeExtendFromBoundary", "MeshSizeFromPoints", "MeshSizeFromCurvature"):
        gmsh.option.setNumber(f"Mesh.{option}", 0)
    if cell == "quadrilateral":
        gmsh.option.setNumber("Mesh.SubdivisionAlgorithm", 1)
        # Triangles stay until then where the quadrilateral would be flat, as in the rounding of a
        # fillet.
        gmsh.option.setNumber("Mesh.RecombineMinimumQuality", 0.3)
    gmsh.model.addPhysicalGroup(2, list(bodies), name="body")
    for name, tags in boundaries.items():
        gmsh.model.addPhysicalGroup(1, list(tags), name=name)
    gmsh.model.mesh.generate(2)
    if order > 1:
        gmsh.model.mesh.setOrder(order)


# --- bodies in 3D ---------------------------------------------------------------------------------


def plane(axis: int, at: float) -> Surface:
    """The points where x[axis] is ``at``, in units of the drawing."""
    return lambda x: np.abs(x[axis] - at) < DIGITS_OF_FILES


def around(radius: float, centre: float = 0.0) -> Surface:
    """The points at a distance from a line along x[2], at ``centre`` on x[0], in units of the
    drawing.
    """
    return lambda x: np.abs(np.hypot(x[0] - centre, x[1]) - radius) < 1e-5


def mesh_solid(
    drawing: Drawing,
    boundaries: Mapping[str, Surface],
    sizes: Sizes,
    distance: Callable[[float, float, float], float],
    *,
    cell: str = "tetrahedron",
    order: int = 1,
) -> None:
    """Mesh the solids of OpenCASCADE, fine near some places, and name their surfaces.

    Args:
        drawing: the model, not yet synchronised.
        boundaries: name -> which points are on it, in units of the drawing; of several the first
            counts.
        sizes: lengths of the edges, in units of the scene.
        distance: distance of a position from the places where they are small, in units of the
            drawing.
        cell: ``tetrahedron``, or ``hexahedron``: tetrahedra of twice the size, each divided into
            four hexahedra.
        order: degree of the geometry; 2: edges have nodes between, which are on the surfaces.

    Raises:
        SceneError: the edges are so short that no machine could mesh the body.
    """
    _refuse_short(sizes, sizes.zone)
    gmsh = drawing.gmsh
    stretch = 2.0 if cell == "hexahedron" else 1.0
    gmsh.model.occ.synchronize()
    drawn = Sizes(
        *(drawing.length(value) for value in (sizes.near, sizes.far, sizes.zone, sizes.reach))
    )

    def size(_dim: int, _tag: int, x: float, y: float, z: float, wanted: float) -> float:
        return min(wanted, stretch * float(drawn.at(distance(x, y, z))))

    for option in ("MeshSizeExtendFromBoundary", "MeshSizeFromPoints"):
        gmsh.option.setNumber(f"Mesh.{option}", 0)
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 10)
    if cell == "hexahedron":
        gmsh.option.setNumber("Mesh.SubdivisionAlgorithm", 2)
    gmsh.model.mesh.setSizeCallback(size)
    gmsh.model.mesh.generate(3)
    gmsh.model.mesh.removeSizeCallback()
    if order > 1:
        set_order(gmsh, order)
    _name_solids(gmsh, boundaries)


def mesh_extruded(
    drawing: Drawing,
    sections: Sequence[int],
    counts: Iterable[tuple[Sequence[int], int]],
    boundaries: Mapping[str, Surface],
    height: float,
    layers: int,
    *,
    cell: str,
    order: int,
) -> None:
    """Mesh the extrusion of plane sections along x[2] in layers, and name its surfaces.

    Args:
        drawing: the model, not yet synchronised.
        sections: plane surfaces, each between three or four curves.
        counts: curves of the sections, and how many cells there are along each of them.
        boundaries: those at the sides, as for ``mesh_solid``; the ends are ``bottom`` and ``top``.
        height: of the extrusion, in units of the scene.
        layers: cells along it.
        cell: ``hexahedron`` or ``tetrahedron``.
        order: degree of the geometry.
    """
    gmsh = drawing.gmsh
    geo = drawing.gmsh.model.geo
    up = height / drawing.unit
    for curves, count in counts:
        for curve in curves:
            geo.mesh.setTransfiniteCurve(curve, count + 1)
    for section in sections:
        geo.mesh.setTransfiniteSurface(section)
        if cell == "hexahedron":
            geo.mesh.setRecombine(2, section)
    geo.extrude(
        [(2, section) for section in sections],
        0.0,
        0.0,
        up,
        [layers],
        recombine=cell == "hexahedron",
    )
    geo.synchronize()
    # Centres of arcs would become nodes without a cell, which dolfinx cannot distribute.
    points = gmsh.model.getEntities(0)
    gmsh.model.removeEntities(
        [point for point in points if not len(gmsh.model.getAdjacencies(*point)[0])]
    )
    gmsh.model.mesh.generate(3)
    if order > 1:
        set_order(gmsh, order)
    _name_solids(gmsh, {"bottom": plane(2, 0.0), "top": plane(2, up), **boundaries})


def _name_solids(gmsh: Any, boundaries: Mapping[str, Surface]) -> None:
    """Name surfaces by their nodes, of several names the first counts, and all solids together
    ``body``.
    """
    named: dict[str, list[int]] = {}
    for _, tag in gmsh.model.getEntities(2):
        _, x, _ = gmsh.model.mesh.getNodes(2, tag, includeBoundary=True)
        points = np.asarray(x).reshape(-1, 3).T
        names = [name for name, holds in boundaries.items() if holds(points).all()]
        if names:
            named.setdefault(names[0], []).append(tag)
    gmsh.model.addPhysicalGroup(3, [tag for _, tag in gmsh.model.getEntities(3)], name="body")
    for name, tags in named.items():
        gmsh.model.addPhysicalGroup(2, tags, name=name)
