"""Cohesion of a contact: a bond of both sides that softens and tears; damage is permanent.

What it does in a load step is in ``mechanics.body.cohesion``, which is imported only when such a
step is solved.
"""

from __future__ import annotations

from typing import Self

from pydantic import Field, model_validator

from signorini_fx.arrays import Value
from signorini_fx.mechanics.statement.base import refused
from signorini_fx.mechanics.statement.effect import ContactPart, Contradictions, Stated, not_yet
from signorini_fx.mechanics.statement.values import NonNegativeValue, Positive

PARAMETERS = ("strength", "shear_strength", "energy", "shear_energy", "exponent")
_NOT_CONVEX = "is not possible with cohesion: bonds that soften have no convex energy"


class Cohesion(ContactPart):
    """A bond between the sides of a contact where they touch at first.

    It softens once its tractions reach its strength, and has torn when its energy is spent.  The
    friction of the contact acts on the broken share.

    Attributes:
        strength: against opening, stress; 0: there is no bond.
        energy: spent by opening until the bond has torn, stress times length.
        shear_strength: against slip, stress; None: ``strength``.
        shear_energy: spent by slip until the bond has torn; None: ``energy``.
        exponent: of Benzeggagh and Kenane, for the energy in mixed mode; needed if both energies
            differ.
        stiffness: of the bond before it softens, stress per length; None: stiff enough.

    Examples:
        >>> glued = sfx.Contact(boundary="bottom", cohesion=sfx.Cohesion(30.0, 0.3))
        >>> result = sfx.solve(scene.model_copy(update={"contact": glued}))
        >>> print(result.state.fields["damage"].values.max())
        0.0
    """

    key = "cohesion"
    step_effect = "cohesion"
    positional = ("strength", "energy")
    value_keys = (
        "strength",
        "energy",
        "shear_strength",
        "shear_energy",
    )
    refuses = not_yet(
        "cohesion",
        "requested accuracy",
        "nested iteration",
        "mixed element",
        "axisymmetric, torsion",
        "nonlinear material",
        "driven foundation",
        "inertia",
        "preload",
        more={
            "friction axes": "is not possible with cohesion: leave out friction.ratio",
            "statement of an error bound": _NOT_CONVEX,
            "soft contact": "is not possible with cohesion, whose bond has a stiffness of its own",
        },
    )

    strength: NonNegativeValue = Field(kw_only=False)
    energy: NonNegativeValue = Field(kw_only=False)
    shear_strength: NonNegativeValue | None = None
    shear_energy: NonNegativeValue | None = None
    exponent: Positive | None = None
    stiffness: Positive | None = None

    @model_validator(mode="after")
    def _whole(self) -> Self:
        keys = ("energy", "shear_energy", "shear_strength")
        wrong = [((key,), "must be above 0") for key in keys if getattr(self, key) == 0]
        if self.exponent is None and self.shear_energy not in (None, self.energy):
            wrong.append((("shear_energy",), "differs from energy: give exponent, usually 2"))
        if self.exponent is not None and self.exponent < 1:
            wrong.append((("exponent",), f"must be 1 or more, got {self.exponent:g}"))
        if wrong:
            raise refused(type(self).__name__, wrong)
        return self

    @property
    def parameters(self) -> tuple[Value | None, ...]:
        """The values of ``PARAMETERS``, in this order, with defaults filled in."""
        shear = self.strength if self.shear_strength is None else self.shear_strength
        energy = self.energy if self.shear_energy is None else self.shear_energy
        return self.strength, shear, self.energy, energy, self.exponent

    def contradictions(self, statement: Stated, number: int) -> Contradictions:
        path = ("contact", number, "cohesion")
        contact = statement.contact[number]
        friction = contact.friction
        if not contact.opens:
            yield path, f"is for unilateral contact, not for kind = {contact.kind!r}"
        if friction.acts and not (friction.follows_pressure and not friction.ends_open):
            yield path, "goes with Coulomb friction without cohesion, or none: bonds shear anyway"
        if friction.follows_slip:
            yield path, "is not possible yet with friction that follows the speed of slip"
        if contact.moves or contact.gap_timed:
            yield path, "is not possible yet where the foundation moves: prescribe a displacement"
        algorithm = statement.solver.algorithm
        if algorithm not in ("auto", "ssn"):
            yield path, f"needs solver.algorithm = 'ssn', not {algorithm!r}"
