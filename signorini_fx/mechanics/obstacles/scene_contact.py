"""The contacts of a scene as foundations and pairs, and the choice of the side of a pair that
carries the contact points.

It is the softer side; if both are equally soft, the one that lies wholly on the other, else the
finer one.  There the multipliers resolve what the other side can follow; on a much stiffer side the
error is larger and Krylov methods converge slowly.  Where a narrow side slides on a wide one,
points on the wide side lose their partners one by one at its ends, and the iteration needs many
more solves.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from dolfinx import fem
from scipy.spatial import cKDTree

from signorini_fx.arrays import Array, Indices, extents
from signorini_fx.errors import SceneError
from signorini_fx.machine import parallel
from signorini_fx.mechanics.assembly.mesh_entities import facet_cells, facet_vertices
from signorini_fx.mechanics.interfaces import Foundation, Pair, PlacedShape
from signorini_fx.mechanics.kinematics import Kinematics
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.mechanics.statement.expressions import sample
from signorini_fx.mechanics.statement.rigid_shape import Corners, SignedDistance, corners_of
from signorini_fx.mechanics.statement.statement import Statement
from signorini_fx.tuned import COARSER_FACETS, STIFFER_BODY

if TYPE_CHECKING:
    from signorini_fx.mechanics.effects.contact import Contact
    from signorini_fx.mechanics.elasticity.moduli import Coefficient

Facets = Mapping[str, Indices]


def foundations_of(
    contacts: Sequence[Contact],
    kinematics: Kinematics,
    facets: Sequence[Indices],
    masters: Mapping[int, Indices],
) -> list[Foundation | Pair]:
    """Return the contacts of a scene as foundations and pairs.

    Args:
        contacts: the contacts of the scene.
        kinematics: the kinematics of the body.
        facets: the facets of each contact.
        masters: the facets of the opposite side, by the number of each pair among the contacts.
    """
    foundations = list[Foundation | Pair]()
    around = None if kinematics.uniform else kinematics.measure_at
    for number, (effect, on) in enumerate(zip(contacts, facets, strict=True)):
        friction = effect.friction if effect.friction.acts else None
        gap = effect.gap if isinstance(effect.gap, int | float) else partial(sample, effect.gap)
        if number in masters:
            same = ("distance", "kind", "adjust", "sliding", "reach")
            choice = {key: getattr(effect, key) for key in same}
            pair = Pair(on, masters[number], gap, friction=friction, measure=around, **choice)
            foundations.append(pair)
            continue
        shape = shape_at_points(effect.surface, kinematics)
        direction = effect.direction
        if direction is not None:
            direction = (*direction, *[0.0] * kinematics.out_of_section)
        foundations.append(Foundation(on, gap, direction, friction, effect.kind, around, shape))
    return foundations


def hard_foundations(contacts: Sequence[Contact], kinematics: Kinematics) -> list[PlacedShape]:
    """Return the shapes of the foundations of a scene, except bonded ones and those with soft
    contact, into which a body may penetrate.
    """
    return [
        PlacedShape(f"contact[{k}].foundation", k, shape, effect.gap)
        for k, effect in enumerate(contacts)
        if (shape := shape_at_points(effect.surface, kinematics)) is not None
        and not effect.bonded
        and getattr(effect, "overclosure", None) is None
    ]


def shape_at_points(shape: SignedDistance | None, kinematics: Kinematics) -> SignedDistance | None:
    """Return a shape of a scene in the form that is evaluated at points of the body; None if there
    is none.
    """
    return shape if shape is None or not kinematics.out_of_section else _ShapeOfSection(shape)


@dataclass(frozen=True)
class _ShapeOfSection:
    """A 2D shape for points of a section whose displacements have three components."""

    shape: SignedDistance

    def distance(self, x: Array) -> tuple[Array, Array]:
        """Return signed distance and unit normal; the normal has no component out of the
        section.
        """
        away, normal = self.shape.distance(np.ascontiguousarray(x[:, :2]))
        return away, np.pad(normal, ((0, 0), (0, 1)))

    def corners(self, dimension: int) -> Corners | None:
        """Return the corners in the plane of the section, see ``Shape.corners``; None if a user's
        own shape has none.
        """
        return corners_of(self.shape, dimension)

    @property
    def inradius(self) -> float:
        """The inradius of the shape, length; infinite if the shape does not define it."""
        return float(getattr(self.shape, "inradius", np.inf))


@dataclass(frozen=True)
class SideFigures:
    """The properties of a side, over all ranks, by which the side with the contact points is
    chosen.

    Attributes:
        stiffness: the mean shear modulus behind its facets, stress.
        size: the mean extent of its facets, length.
        vertices: the vertices of its facets, length, shape (n, 3).
    """

    stiffness: float
    size: float
    vertices: Array

    @classmethod
    def of(cls, name: str, tagged: TaggedMesh, shear_modulus: Coefficient) -> SideFigures:
        """Return the figures of a boundary; collective.

        ``shear_modulus``: a constant or a cell-wise function, stress.
        """
        mesh = tagged.mesh
        facets = tagged.facets(name)
        cells = facet_cells(mesh, facets)
        if isinstance(shear_modulus, fem.Function):
            stiffness = shear_modulus.x.array[shear_modulus.function_space.dofmap.list[cells, 0]]
        else:
            stiffness = np.full(len(facets), float(shear_modulus.value))
        corners = facet_vertices(mesh, facets)
        extent = extents(corners)
        sums = parallel.global_sum(
            mesh.comm, np.array([len(facets), stiffness.sum(), extent.sum()])
        )
        vertices = parallel.gather_rows(mesh.comm, corners.reshape(-1, corners.shape[2]))
        return cls(float(sums[1] / sums[0]), float(sums[2] / sums[0]), vertices)

    def is_better(self, opposite: SideFigures) -> bool:
        """Return whether this side should carry the points rather than the opposite one."""
        softer = opposite.stiffness / self.stiffness
        if not 1 / STIFFER_BODY <= softer <= STIFFER_BODY:
            return softer > 1
        if (within := self._lies_on(opposite)) != opposite._lies_on(self):
            return within
        return opposite.size / self.size > COARSER_FACETS

    def _lies_on(self, opposite: SideFigures) -> bool:
        """Return whether all vertices of this side are within one facet length of those of the
        other side.
        """
        distance, _ = cKDTree(opposite.vertices).query(self.vertices)
        return bool(np.all(distance <= max(self.size, opposite.size)))


def with_chosen_sides(
    statement: Statement, tagged: TaggedMesh, facets: Facets, shear_modulus: Coefficient
) -> Statement:
    """Return the scene with ``boundary`` and ``against`` exchanged where the latter carries the
    points; the same scene if nothing changes; collective.

    With ``points = "auto"`` sides are not exchanged where the gap or the friction are functions,
    which were written for ``boundary``, or where other contacts or supports need the facets.

    ``facets``: the facets of every boundary that the scene names. ``shear_modulus``: see
    ``SideFigures.of``.

    Raises:
        SceneError: the requested side shares facets with another contact.
    """
    contacts = list(statement.contact)
    for number, effect in enumerate(statement.contact):
        if effect.against is None or effect.points == "boundary":
            continue
        others = [contact for k, contact in enumerate(contacts) if k != number]
        taken = [name for contact in others for name in (contact.boundary, contact.against)]
        points = "auto" if effect.points == "auto" else "boundary"
        if points == "auto":
            ours, theirs = (
                SideFigures.of(name, tagged, shear_modulus)
                for name in (effect.boundary, effect.against)
            )
            values = (effect.gap, *effect.friction.parameters.values())
            if not theirs.is_better(ours) or not all(
                isinstance(value, int | float) for value in values
            ):
                continue
            taken += [support.where for support in statement.displacement]
        exchanged = {"boundary": effect.against, "against": effect.boundary, "points": points}
        if (existing := _sharing(effect.against, taken, tagged, facets)) is None:
            contacts[number] = effect.model_copy(update=exchanged)
        elif points == "boundary":
            message = (
                f"{effect.against!r} shares facets with {existing!r} of another contact: "
                "leave the points on"
            )
            raise SceneError.at(f"contact[{number}].points", f"{message} {effect.boundary!r}")
    if all(
        contact is existing for contact, existing in zip(contacts, statement.contact, strict=True)
    ):
        return statement
    return statement.changed(contact=tuple(contacts))


def _sharing(
    name: str, boundaries: list[str | None], tagged: TaggedMesh, facets: Facets
) -> str | None:
    """Return the first of some boundaries that shares facets with the boundary ``name``, or None;
    collective.
    """
    for boundary in boundaries:
        if boundary is None or boundary not in facets:
            continue
        shared = np.intersect1d(facets[name], facets[boundary]).size
        if parallel.global_sum(tagged.mesh.comm, np.array(shared)):
            return boundary
    return None
