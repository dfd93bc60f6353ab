"""Parts of the boundary with contact as users of forms state them, plain data for
``ContactProblem``: a rigid foundation; a pair of two sides, or with ``bonded`` a bond of both.

``effects.contact`` has those of scenes, ``obstacles.foundations_on_points`` all of them on their
contact points. Bolts, for which a load step finds shortenings, are in ``solving.bolt_preloads``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

from signorini_fx.mechanics.laws.protocol import FrictionLaw


@dataclass(frozen=True)
class Foundation:
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
        bilateral: whether the contact cannot open; the pressure then has any sign.
        measure: factor of the surface measure in the user's forms, a UFL expression, such as 2 pi r
            of bodies of revolution; points at which it is zero carry no contact.  None: 1.
        shape: the foundation as a thing, such as
            ``signorini_fx.mechanics.shapes.analytic.Sphere(...)``: any object with ``distance(x)``,
            see ``statement.rigid_shape.Shape``, or a table as a scene has it. It determines the
            direction, and ``gap`` is added to its distance.  With a force, a moment or prescribed
            components it is a rigid tool, which they move.  None: gap and direction say where it
            is.
        bonded: whether the boundary is tied to it as it lies, whatever gap and friction are; then
            ``shape`` has a force, a moment, or prescribed components.
        against, allowance, reach, adjust, by_geometry, sliding: those of a ``Pair``: there is no
            other side.

    Examples:
        >>> bottom = sfx.Foundation(block.facets("bottom"), gap=0.001, friction=sfx.Coulomb(0.3))
        >>> print(len(bottom.facets), bottom.friction.coefficient)
        8 0.3
    """

    facets: Any
    gap: Any = 0.0
    direction: Any = None
    friction: FrictionLaw | None = None
    bilateral: bool = False
    measure: Any = None
    shape: Any = None
    bonded: bool = False
    against: ClassVar[None] = None
    allowance: ClassVar[float] = 0.0
    reach: ClassVar[None] = None
    adjust: ClassVar[None] = None
    by_geometry: ClassVar[bool] = False
    sliding: ClassVar[bool] = False


@dataclass(frozen=True)
class Pair:
    """Contact of two deformable bodies, or of two parts of the boundary of one, across meshes that
    need not match.

    The contact points are on the first side, the slave: take the softer body, of equal ones that
    with the finer mesh. The relative displacement of both sides keeps to the gap; the pressure
    pushes them apart, friction acts between them, with opposite forces and moments on both.

    Attributes:
        facets: exterior facets of the slave by their local numbers, or (meshtags, tag), with one
            tag or several.
        against: those of the other side, the master.
        gap: "geometry": the distance of both sides as the meshes lie, along normals half-way
            between both, negative where they overlap; or a distance of sides that are nominally in
            contact, length: a number, a callable f(x) of points of shape (3, n), a UFL expression,
            or a Function.  A fit between coarse meshes needs the latter.
        allowance: what is added to the distance by geometry, of the same kinds.
        adjust: where the distance by geometry is at most this, length, it counts as zero; None:
            nowhere.
        measure: factor of the surface measure in the user's forms, as in ``Foundation``, of the
            first side: values at its nodes are interpolated; points at which it is zero carry no
            contact. None: 1.
        friction: a law of ``laws``, such as ``Coulomb`` or ``Tresca``, or one of your own; None:
            there is none.
        bilateral: whether the contact cannot open; the pressure then has any sign.
        bonded: whether both sides are tied as they lie, whatever gap and friction are.
        sliding: whether points of a nonlinear body see the other side at displaced places, wherever
            it is; otherwise they keep the partners of the undeformed bodies, which is right as long
            as sides slide by little of a facet, and normals turn with the other side.  Without
            effect on linear bodies, which never slide that far.
        reach: distance beyond which facets are no partners, length; None: a default from the sizes
            of both sides.
        shape, direction: those of a ``Foundation``: there is none.

    Examples:
        >>> pair = sfx.Pair(block.facets("bottom"), block.facets("top"), friction=sfx.Coulomb(0.3))
        >>> print(pair.friction.coefficient)
        0.3
    """

    facets: Any
    against: Any
    gap: Any = "geometry"
    allowance: Any = 0.0
    friction: FrictionLaw | None = None
    bilateral: bool = False
    bonded: bool = False
    reach: float | None = None
    sliding: bool = True
    adjust: float | None = None
    measure: Any = None
    shape: ClassVar[None] = None
    direction: ClassVar[None] = None

    @property
    def by_geometry(self) -> bool:
        """Return whether the gap is the distance of both sides of the mesh."""
        return not self.bonded and isinstance(self.gap, str)


class PlacedShape(NamedTuple):
    """The shape of a foundation where it is: the place in the input that names it, the number of
    the contact, the shape, None: there is none, and what is added to its distance, a number or an
    expression.
    """

    path: str
    contact: int
    shape: Any
    added: Any
