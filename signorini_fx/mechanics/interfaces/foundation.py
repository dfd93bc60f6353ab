"""A part of the boundary that may touch a rigid foundation: plain data for ``ContactProblem``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from signorini_fx.mechanics.laws.protocol import FrictionLaw


@dataclass(frozen=True)
class Foundation:
    """A rigid foundation: y . n <= gap, the pressure lambda >= 0 pushes the body off, friction acts along it.

    Attributes:
        facets: exterior facets by their local numbers, or (meshtags, tag), with one tag or several.
        gap: distance to the foundation along n, length, negative where they overlap: a number, a callable f(x) of
            points of shape (3, n), a UFL expression, or a Function.
        direction: n, from the body to the foundation, a vector of any length: numbers, a callable, a UFL vector, or a
            Function; None: the outward normal.
        friction: a law of ``laws``, such as ``Coulomb`` or ``Tresca``, or one of your own; None: there is none.
        bilateral: whether the contact cannot open; the pressure then has any sign.
        measure: factor of the surface measure in the user's forms, a UFL expression, such as 2 pi r of bodies of
            revolution; points at which it is zero carry no contact.  None: 1.
        shape: the foundation as a thing, such as ``signorini_fx.mechanics.shapes.sphere.Sphere(...)``: any object with
            ``distance(x)``, see ``statement.rigid_shape.Shape``, or a table as a scene has it.  It determines the
            direction, and ``gap`` is added to its distance.  With a force, a moment or prescribed components it is a
            rigid tool, which they move.  None: gap and direction say where it is.
        bonded: whether the boundary is tied to it as it lies, whatever gap and friction are; then ``shape`` has a
            force, a moment, or prescribed components.
        against, allowance, reach, adjust, by_geometry: those of a ``Pair``: there is no other side.
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
