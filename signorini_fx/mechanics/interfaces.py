"""Contact boundaries as users of forms give them to ``ContactProblem``: a rigid foundation, or a
pair of two sides.  Their arguments have the names and values of ``[[contact]]`` in a scene.

``effects.contact`` has the contacts of scenes, and ``obstacles.foundations_on_points`` evaluates
both on their contact points.  Bolts, whose shortening a load step finds, are in
``solving.bolt_preloads``.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, Literal, NamedTuple, TypeAlias

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
    """Base class of a contact boundary, with the kind of its contact."""

    kind: Kind

    @property
    def parts(self) -> list[ContactPart]:
        """The effects of this contact besides friction, such as wear."""
        return [part for part in vars(self).values() if isinstance(part, ContactPart)]

    @property
    def bilateral(self) -> bool:
        """Whether the contact can neither open nor close; a bonded contact does not count."""
        return self.kind == "bilateral"

    @property
    def bonded(self) -> bool:
        """Whether both sides stay together in their initial position."""
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
            there is no friction.
        kind: ``unilateral``: the boundary may leave the foundation; ``bilateral``: it cannot, and
            the pressure has any sign; ``bonded``: it is tied to ``shape`` in the initial position,
            whatever gap and friction are, and ``shape`` has a force, a moment, or prescribed
            components.
        measure: factor of the surface measure in the user's forms, a UFL expression, such as 2 pi r
            of bodies of revolution; points at which it is zero carry no contact.  None: 1.
        shape: the geometry of the foundation, such as
            ``signorini_fx.mechanics.shapes.analytic.Sphere(...)``: any object with ``distance(x)``,
            see ``statement.rigid_shape.Shape``, or a table as in a scene.  It determines the
            direction, and ``gap`` is added to its distance.  With a force, a moment or prescribed
            components it is a rigid body that these drive.  None: ``gap`` and ``direction``
            describe the foundation.
        wear: such as ``Archard(1e-8)``; None: contact does not wear.
        cohesion: a bond that can tear, ``Cohesion``; None: there is none.
        against, reach, adjust, by_geometry, slides: attributes of a ``Pair``, without effect here,
            as there is no other side.

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
    shape: SignedDistance | Mapping[str, npt.ArrayLike] | None = None
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

    The contact points are on the first side, the slave: take the softer body, or the finer mesh if
    both are equally stiff.  The gap limits the relative displacement of both sides.  Pressure and
    friction act on both with opposite forces and moments.

    Attributes:
        facets: exterior facets of the slave by their local numbers, or (meshtags, tag), with one
            tag or several.
        against: exterior facets of the other side, the master.  If they are the same as ``facets``,
            the boundary of a nonlinear body may touch itself, and each step finds which facets
            carry contact points.
        gap: length that is added to ``distance``: a number, a callable f(x) of points of shape
            (3, n), a UFL expression, or a Function.
        distance: of both sides.  "geometry": computed from the meshes along normals half-way
            between both, negative where they overlap; "nominal": zero, as a fit between coarse
            meshes needs it.
        adjust: distances by geometry up to this length count as zero; None: none does.
        measure: factor of the surface measure in the user's forms, as in ``Foundation``, of the
            first side: values at its nodes are interpolated; points at which it is zero carry no
            contact. None: 1.
        friction: a law of ``laws``, such as ``Coulomb`` or ``Tresca``, or one of your own; None:
            there is no friction.
        kind: ``unilateral``: the sides may part; ``bilateral``: they cannot, and the pressure has
            any sign; ``bonded``: they are tied in the initial position, whatever gap and friction
            are.
        sliding: ``finite``: each point of a nonlinear body is projected onto the displaced other
            side; ``small``: it keeps its partners of the undeformed bodies, and normals turn with
            the other side, which is right as long as sides slide by a small part of a facet.
            Without effect on linear bodies, which never slide that far.
        reach: distance beyond which facets are not paired, length; None: a default from the sizes
            of both sides, or of the facets of one that touches itself.
        wear: such as ``Archard(1e-8)``; None: contact does not wear.
        cohesion: a bond that can tear, ``Cohesion``; None: there is none.
        shape, direction: attributes of a ``Foundation``, always None here.

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
        """Whether the gap is computed from the distance of both sides of the mesh."""
        return not self.bonded and self.distance == "geometry"

    @property
    def slides(self) -> bool:
        """Whether contact points of a nonlinear body follow the other side."""
        return self.sliding == "finite"


class PlacedShape(NamedTuple):
    """The shape of a foundation in its current position.

    It has the key in the input that names it, the number of the contact, the shape, and what is
    added to its distance, a number or an expression.
    """

    path: str
    contact: int
    shape: SignedDistance
    added: Value
