"""Parts of the boundary with contact as users of forms state them, plain data for
``ContactProblem``: a rigid foundation, or a pair of two sides. Their arguments have the names and
values of ``[[contact]]`` in a scene.

``effects.contact`` has those of scenes, ``obstacles.foundations_on_points`` all of them on their
contact points. Bolts, for which a load step finds shortenings, are in ``solving.bolt_preloads``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, Literal, NamedTuple, TypeAlias

import numpy.typing as npt

from signorini_fx.arrays import Array, Expr, Indices, Value
from signorini_fx.mechanics.laws.protocol import FrictionLaw
from signorini_fx.mechanics.statement.effect import ContactPart
from signorini_fx.mechanics.statement.rigid_shape import SignedDistance

if TYPE_CHECKING:
    from dolfinx.mesh import MeshTags

# Local numbers of exterior facets, or mesh tags with one tag of them, or several.
Facets: TypeAlias = "Sequence[int] | Indices | tuple[MeshTags, int | Sequence[int]]"
Kind = Literal["unilateral", "bilateral", "bonded"]


class _OfKind:
    """A part of the boundary with a kind of contact."""

    kind: Kind

    @property
    def parts(self) -> list[ContactPart]:
        """Return what happens there beside contact and friction, such as wear."""
        return [part for part in vars(self).values() if isinstance(part, ContactPart)]

    @property
    def bilateral(self) -> bool:
        """Return whether the contact can neither open nor close, and is no bond."""
        return self.kind == "bilateral"

    @property
    def bonded(self) -> bool:
        """Return whether both sides stay together in their initial position."""
        return self.kind == "bonded"


@dataclass(frozen=True)
class Foundation(_OfKind):
    """A rigid foundation: y . n <= gap, where a pressure lambda >= 0 pushes the body off and
    friction acts along it.

    Attributes:
        facets: exterior facets by their local numbers, or (meshtags, tag), with one tag or several.
        gap: distance to the foundation along n, length, negative where they overlap: a number, a
            callable f(x) of points of shape (3, n), a UFL expression, or a Function.
        direction: n, from the body to the foundation, a vector of any length: numbers, a callable,
            a UFL vector, or a Function; None: the outward normal.
        friction: a law of ``laws``, such as ``Coulomb`` or ``Tresca``, or one of your own; None:
            there is none.
        kind: ``unilateral``: the boundary may leave the foundation; ``bilateral``: it cannot, and
            the pressure has any sign; ``bonded``: it is tied to ``shape`` in the initial position,
            whatever gap and friction are, and ``shape`` has a force, a moment, or prescribed
            components.
        measure: factor of the surface measure in the user's forms, a UFL expression, such as 2 pi r
            of bodies of revolution; points at which it is zero carry no contact.  None: 1.
        shape: the foundation as a thing, such as
            ``signorini_fx.mechanics.shapes.analytic.Sphere(...)``: any object with ``distance(x)``,
            see ``statement.rigid_shape.Shape``, or a table as a scene has it. It determines the
            direction, and ``gap`` is added to its distance.  With a force, a moment or prescribed
            components it is a rigid body, which they move.  None: gap and direction say where it
            is.
        wear: such as ``Archard(1e-8)``; None: contact does not wear.
        cohesion: a bond that can tear, ``Cohesion``; None: there is none.
        against, reach, adjust, by_geometry, slides: those of a ``Pair``: there is no other side.

    Examples:
        >>> bottom = sfx.Foundation(block.facets("bottom"), gap=0.001, friction=sfx.Coulomb(0.3))
        >>> print(len(bottom.facets), bottom.friction.coefficient)
        8 0.3
    """

    facets: Facets
    gap: Value = 0.0
    direction: Sequence[float] | Callable[[Array], npt.ArrayLike] | Expr | None = None
    friction: FrictionLaw | None = None
    kind: Kind = "unilateral"
    measure: Expr | None = None
    shape: SignedDistance | Mapping[str, Any] | None = None
    wear: ContactPart | None = None
    cohesion: ContactPart | None = None
    against: ClassVar[None] = None
    reach: ClassVar[None] = None
    adjust: ClassVar[None] = None
    by_geometry: ClassVar[bool] = False
    slides: ClassVar[bool] = False


@dataclass(frozen=True)
class Pair(_OfKind):
    """Contact of two deformable bodies, or of two parts of the boundary of one, across meshes that
    need not match.

    The contact points are on the first side, the slave: take the softer body, of equal ones that
    with the finer mesh. The relative displacement of both sides keeps to the gap; the pressure
    pushes them apart, friction acts between them, with opposite forces and moments on both.

    Attributes:
        facets: exterior facets of the slave by their local numbers, or (meshtags, tag), with one
            tag or several.
        against: those of the other side, the master; the same as ``facets``: of a nonlinear body
            they may touch each other, and each step finds which of them carry points.
        gap: what is added to ``distance``, length: a number, a callable f(x) of points of shape
            (3, n), a UFL expression, or a Function.
        distance: of both sides, "geometry": as the meshes lie, along normals half-way between both,
            negative where they overlap; "nominal": zero, which a fit between coarse meshes needs.
        adjust: where the distance by geometry is at most this, length, it counts as zero; None:
            nowhere.
        measure: factor of the surface measure in the user's forms, as in ``Foundation``, of the
            first side: values at its nodes are interpolated; points at which it is zero carry no
            contact. None: 1.
        friction: a law of ``laws``, such as ``Coulomb`` or ``Tresca``, or one of your own; None:
            there is none.
        kind: ``unilateral``: the sides may part; ``bilateral``: they cannot, and the pressure has
            any sign; ``bonded``: they are tied in the initial position, whatever gap and friction
            are.
        sliding: ``finite``: points of a nonlinear body see the other side at displaced places,
            wherever it is; ``small``: they keep the partners of the undeformed bodies, which is
            right as long as sides slide by little of a facet, and normals turn with the other side.
            Without effect on linear bodies, which never slide that far.
        reach: distance beyond which facets are no partners, length; None: a default from the sizes
            of both sides, or of the facets of one that touches itself.
        wear: such as ``Archard(1e-8)``; None: contact does not wear.
        cohesion: a bond that can tear, ``Cohesion``; None: there is none.
        shape, direction: those of a ``Foundation``: there is none.

    Examples:
        >>> pair = sfx.Pair(block.facets("bottom"), block.facets("top"), friction=sfx.Coulomb(0.3))
        >>> print(pair.friction.coefficient)
        0.3
    """

    facets: Facets
    against: Facets
    gap: Value = 0.0
    distance: Literal["geometry", "nominal"] = "geometry"
    friction: FrictionLaw | None = None
    kind: Kind = "unilateral"
    reach: float | None = None
    sliding: Literal["finite", "small"] = "finite"
    adjust: float | None = None
    measure: Expr | None = None
    wear: ContactPart | None = None
    cohesion: ContactPart | None = None
    shape: ClassVar[None] = None
    direction: ClassVar[None] = None

    @property
    def by_geometry(self) -> bool:
        """Return whether the gap is the distance of both sides of the mesh."""
        return not self.bonded and self.distance == "geometry"

    @property
    def slides(self) -> bool:
        """Return whether points of a nonlinear body follow the other side."""
        return self.sliding == "finite"


class PlacedShape(NamedTuple):
    """The shape of a foundation where it is: the place in the input that names it, the number of
    the contact, the shape, and what is added to its distance, a number or an expression.
    """

    path: str
    contact: int
    shape: SignedDistance
    added: Value
