"""Contact with a rigid foundation or another body, with a friction law of ``laws`` or of another
package.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import Annotated, Any, ClassVar, Literal, Self, cast

from pydantic import (
    BeforeValidator,
    Discriminator,
    TypeAdapter,
    ValidatorFunctionWrapHandler,
    WrapValidator,
    model_validator,
)

from signorini_fx.arrays import Value
from signorini_fx.extensions import LAWS, load_class, names_of
from signorini_fx.mechanics.laws.coulomb import Coulomb, NoFriction, Tresca
from signorini_fx.mechanics.laws.protocol import FrictionLaw
from signorini_fx.mechanics.statement.base import JOIN, Table, refused
from signorini_fx.mechanics.statement.effect import (
    ContactPart,
    Contradictions,
    Effect,
    Features,
    Part,
    Stated,
)
from signorini_fx.mechanics.statement.rigid_body import driven_twice
from signorini_fx.mechanics.statement.rigid_shape import Distance, OneShape, Shape
from signorini_fx.mechanics.statement.values import (
    Accepts,
    Direction,
    Entries,
    NonNegative,
    Positive,
    TimedSampledValue,
    not_at_points,
)
from signorini_fx.tuned import LARGEST_NUMBER

# The classes of friction that depends on the speed, by name; their file is imported only when one
# of them is used.
BY_SPEED = {"stribeck": "Stribeck", "speeds": "SpeedTable"}
_NAMED = ("none", "tresca", "coulomb")


def law_by_speed(name: str) -> type[FrictionLaw]:
    """Return the class of a friction law named in ``BY_SPEED``."""
    file = import_module("signorini_fx.mechanics.laws.stribeck")
    kind: type[FrictionLaw] = getattr(file, BY_SPEED[name])
    return kind


def _law(entry: object, kinds: ValidatorFunctionWrapHandler) -> FrictionLaw:
    """Return the friction law that a table describes; a law is returned unchanged."""
    if isinstance(entry, FrictionLaw):
        return entry
    name = entry.get("law") if isinstance(entry, Mapping) else None
    if not isinstance(name, str) or name in _NAMED:
        return kinds(entry)
    if name in BY_SPEED:
        return TypeAdapter(law_by_speed(name)).validate_python(entry)
    if name in (of_others := names_of(LAWS)):
        return TypeAdapter(load_class(LAWS, name, FrictionLaw)).validate_python(entry)
    known = ", ".join(map(repr, (*_NAMED, *BY_SPEED, *of_others)))
    raise refused("friction", [(("law",), f"must be one of {known}, got {name!r}")])


OneLaw = Annotated[
    Accepts[FrictionLaw | Mapping[str, Any], NoFriction | Tresca | Coulomb],
    Discriminator("law"),
    WrapValidator(_law),
]


def _joined(names: str | Sequence[str]) -> str | Sequence[str]:
    """Return several boundary names joined to one; a single name is returned unchanged."""
    several = isinstance(names, list | tuple) and len(names) > 0
    return JOIN.join(names) if several and all(isinstance(one, str) for one in names) else names


Joined = Annotated[
    Accepts[str | Sequence[str] | None, str | None],
    BeforeValidator(_joined, json_schema_input_type=str | list[str]),
]


class Overclosure(Table):
    """The compliance of contact: pressure = stiffness times overclosure, the length by which one
    side has entered the other.

    Attributes:
        law: its name.
        stiffness: stress per length.
    """

    law: Literal["linear"] = "linear"
    stiffness: Positive


class GeneralContact(Table):
    """Contact between all bodies that touch or nearly do.

    Its contacts are found when the mesh is read, and follow those of ``[[contact]]``.

    Attributes:
        bodies: names of the bodies that may touch each other; default: all.
        within: distance up to which surfaces are near, length; None: a quarter of a facet.
        friction: the friction law of all contacts.
        kind: as of ``[[contact]]``, of all contacts.
        without: pairs of names of bodies between which there is no contact; default: none.

    Examples:
        >>> everywhere = sfx.GeneralContact(friction=sfx.Coulomb(0.2), without=[("pin", "lug")])
        >>> print(everywhere.friction.coefficient)
        0.2
    """

    bodies: Entries[str] = ()
    within: Positive | None = None
    friction: OneLaw = cast("Any", NoFriction())
    kind: Literal["unilateral", "bilateral", "bonded"] = "unilateral"
    without: Entries[tuple[str, str]] = ()


class Contact(Effect):
    """Contact of a boundary with a rigid foundation, or with a boundary of another body, whose
    meshes need not match.

    Attributes:
        boundary: name of the boundary where contact may occur.
        against: name of the boundary of another body that it may touch, or several names, which are
            joined to one; its own name if it may touch itself; None: the foundation is rigid.
        points: which of both carries the contact points; ``auto``: that of the softer body, or of
            the finer mesh, see ``obstacles.scene_contact``.
        distance: between two bodies, to which ``gap`` is added: ``geometry``: computed from the
            meshes; ``nominal``: zero.
        adjust: between two bodies, distances of the meshes up to this length count as zero,
            overlaps included; None: none does.
        sliding: between nonlinear bodies: ``finite``: points follow the other side wherever it is;
            ``small``: they keep their partners, which is right as long as sides slide by less than
            a facet.
        reach: between nonlinear bodies that slide, the distance beyond which facets are not paired,
            length; sides that face each other only later need one; None: as of ``Pair``.
        gap: distance d to the foundation along ``direction``, a length; negative: initial
            penetration; it is added to the distance of a ``foundation``.
        direction: from the body to the foundation, any length; None: the outward normal of the
            body.
        foundation: a shape, whose closest points determine gap and direction,
            ``statement.rigid_shape``; None: none.
        friction: the friction law.
        contact_size: length of its facets, on both sides, if gmsh makes the mesh; None: no special
            size.
        kind: ``unilateral``: Signorini contact (1.1d), the boundary may leave the foundation, but
            not enter it; ``bilateral``: it cannot open, tau_N y = d; ``bonded``: a tie of two
            bodies, or of a body and a rigid one that forces move: both sides stay together in their
            initial position, wherever the surface of a ``foundation`` is.
        overclosure: the compliance of unilateral contact under its pressure, ``Overclosure``; None:
            contact is rigid, apart from ``gamma_n``.
        wear: its law, ``Archard``; None: contact does not wear.
        cohesion: a bond of both sides that can tear, ``Cohesion``; None: there is none.
        conductance: heat transfer, ``Conductance``; None: no heat passes.
        friction_heat: heat from friction, ``FrictionHeat``; None: there is none.
        seeping: a fluid that enters where contact opens, ``Seeping``; None: there is none.

    Examples:
        >>> contact = sfx.Contact(boundary="bottom", gap="0.001*x[0]")
        >>> result = sfx.solve(scene.model_copy(update={"contact": contact}))
        >>> print(np.round(result.contact.forces[0], 6))
        [0. 4.]
    """

    key = "contact"
    boundary: str
    against: Joined = cast("Any", None)
    points: Literal["auto", "boundary", "against"] = "auto"
    distance: Literal["geometry", "nominal"] = "geometry"
    adjust: NonNegative | None = None
    sliding: Literal["finite", "small"] = "finite"
    reach: Positive | None = None
    gap: TimedSampledValue = 0.0
    direction: Direction | None = None
    foundation: OneShape = None
    friction: OneLaw = cast("Any", NoFriction())
    contact_size: Positive | None = None
    kind: Literal["unilateral", "bilateral", "bonded"] = "unilateral"
    overclosure: Overclosure | None = None
    wear: Part = None
    cohesion: Part = None
    conductance: Part = None
    friction_heat: Part = None
    seeping: Part = None

    @model_validator(mode="after")
    def _at_points(self) -> Self:
        """Refuse UFL in the parameters of friction: a scene evaluates them at points."""
        wrong = [
            (("friction",), f"{key}: {not_at_points(value)}")
            for key, value in self.friction
            if hasattr(value, "ufl_domain")
        ]
        if wrong:
            raise refused(type(self).__name__, wrong)
        return self

    vectors = ("direction",)
    refuses: ClassVar[Mapping[str, Mapping[str, str]]] = {
        "contact of two bodies": {
            "local refinement for contact": (
                "the error of contact of two bodies is estimated on "
                "one side only: use 'uniform', or of = 'energy'"
            ),
        },
    }

    @property
    def features(self) -> Features:
        listed = (
            ("contact of two bodies", ("against",), self.against is not None),
            ("driven foundation", ("foundation",), self.driven is not None),
            ("friction axes", ("friction", "ratio"), self.friction.directed),
            ("soft contact", ("overclosure",), self.overclosure is not None),
        )
        of_parts = (
            (name, (part.key, *keys)) for part in self.parts for name, keys in part.features
        )
        return (*((name, keys) for name, keys, used in listed if used), *of_parts)

    @property
    def parts(self) -> list[ContactPart]:
        """The effects of this contact besides friction, such as wear."""
        return [part for _, part in self if isinstance(part, ContactPart)]

    def contradictions(self, statement: Stated, number: int) -> Contradictions:
        for part in self.parts:
            yield from part.contradictions(statement, number)
        if any(rival.boundary == self.boundary for rival in statement.contact[:number]):
            cure = (
                "name the part that each foundation meets as a boundary of its own, or mesh one "
                "of the tools as a body"
            )
            if self.against is not None:
                cure = (
                    "name it as against, and the others as boundary: several contacts may be "
                    "against the same one"
                )
            yield ("contact", number), f"boundary {self.boundary!r} is in contact twice: {cure}"
        for rival, said in (
            ("against", "the other body"),
            ("direction", "the direction, that of the closest point"),
        ):
            if self.foundation is not None and getattr(self, rival) is not None:
                yield (
                    ("contact", number, rival),
                    f"foundation already gives {said}: remove one of them",
                )
        if self.friction.follows_slip:
            yield from _without_speed(statement, number)
        if self.driven is not None:
            yield from _not_driven(statement, number)
        if self.overclosure is not None and not self.opens:
            yield (
                ("contact", number, "overclosure"),
                f"is for unilateral contact, not for {self.kind!r}",
            )
        elif self.overclosure is not None and statement.solver.algorithm not in ("auto", "ssn"):
            reason = f"needs algorithm = 'ssn', not {statement.solver.algorithm!r}"
            yield ("contact", number, "overclosure"), reason
        if self.bonded and self.against is None and self.driven is None:
            reason = (
                "a bond needs the boundary of another body (against), or a foundation that "
                "force or moment moves; bonded to one that stays, or moves as given, is a "
                "[[displacement]] of the boundary"
            )
            yield ("contact", number), reason
        stated = [
            key
            for key, field in type(self).model_fields.items()
            if getattr(self, key) != field.default
        ]
        for key in stated:
            if self.bonded and key in ("distance", "adjust", "gap", "friction"):
                yield (
                    ("contact", number, key),
                    "must be left out: a bond has no friction",
                )
            if self.against is None and key in (
                "distance",
                "points",
                "sliding",
                "adjust",
                "reach",
            ):
                yield ("contact", number, key), "is for contact against another boundary"
        if self.against is None:
            return
        if self.itself:
            itself = "a boundary that touches itself"
            if not statement.nonlinear or self.sliding == "small":
                yield (
                    ("contact", number, "against"),
                    f"is the boundary itself: {itself} is that of a material with a nonlinear law, "
                    "with sliding = 'finite': choose these, or name two parts that may touch",
                )
            for key in ("points", "distance", "adjust", "kind"):
                if key in stated:
                    reason = f"must be left out: each step finds both sides of {itself}"
                    yield ("contact", number, key), reason
        if self.reach is not None and not (statement.nonlinear and self.slides):
            reason = "is for sides that slide, of a material with a nonlinear law: leave it out"
            yield ("contact", number, "reach"), reason
        if self.adjust is not None and self.distance == "nominal":
            yield (
                ("contact", number, "adjust"),
                "has no effect with distance = 'nominal': remove it",
            )
        if self.direction is not None:
            yield (
                ("contact", number, "direction"),
                "between two bodies it is the normal: remove `direction`",
            )

    @property
    def itself(self) -> bool:
        """Whether the boundary may touch itself."""
        return self.against == self.boundary

    @property
    def slides(self) -> bool:
        """Whether points of nonlinear bodies may be paired with other facets as the sides slide."""
        return self.sliding == "finite" and not self.bonded

    @property
    def at_rest(self) -> Contact:
        """The contact of the undeformed body; it is inactive if the sides meet only after a
        displacement.
        """
        if not self.itself and (self.reach is None or not self.opens):
            return self
        nothing = {"against": None, "friction": NoFriction(), "gap": LARGEST_NUMBER}
        return self.model_copy(update=nothing)

    def on_sides_of(self, chosen: Contact) -> Contact:
        """Return the contact with its points on the same side as those of ``chosen``."""
        if chosen.boundary == self.boundary:
            return self
        return self.model_copy(update={"boundary": self.against, "against": self.boundary})

    @property
    def opens(self) -> bool:
        """Whether the boundary may leave the foundation."""
        return self.kind == "unilateral"

    @property
    def bonded(self) -> bool:
        """Whether both sides stay together in their initial position."""
        return self.kind == "bonded"

    @property
    def surface(self) -> Shape | None:
        """The foundation whose shape determines gap and direction; None if there is none, or a
        bond.
        """
        return None if self.bonded else self.foundation

    def gap_in(self, dimension: int) -> Value:
        """Return the gap in 2D or 3D, length: a number, an expression or a callable of the
        position.
        """
        return self.gap if self.surface is None else Distance(self.surface, self.gap, dimension)

    @property
    def driven(self) -> Shape | None:
        """The foundation if its motion is unknown, see ``statement.rigid_body``; otherwise None."""
        return self.foundation if getattr(self.foundation, "driven", False) else None

    @property
    def moves(self) -> bool:
        """Whether the foundation moves with the time."""
        return self.foundation is not None and self.foundation.timed

    @property
    def gap_timed(self) -> bool:
        """Whether the gap depends on the time."""
        return bool(getattr(self.gap, "timed", False))

    @property
    def coulomb(self) -> bool:
        """Whether the friction bound depends on the contact pressure."""
        return self.friction.follows_pressure and self.friction.acts


def _without_speed(statement: Stated, number: int) -> Contradictions:
    """Yield an error if friction depends on the speed of slip, but load steps have no duration."""
    times = statement.load_steps.times
    place = ("contact", number, "friction", "law")
    if times is None or (times[0] <= 0 and not statement.effects.get("inertia")):
        first = "" if times is None else ", the first above 0, as slip begins at time 0"
        reason = "follows the speed of slip, for which load steps need a duration"
        yield place, f"{reason}: give load_steps.times, one for each step{first}"


def _not_driven(statement: Stated, number: int) -> Contradictions:
    """Yield errors for entries that cannot be combined with a foundation of unknown motion."""
    driven = statement.contact[number].driven
    of_components = {key: getattr(driven, key) or {} for key in ("spring", "velocity")}
    if misfit := driven_twice([contact.driven for contact in statement.contact], number):
        yield ("contact", number, "foundation", "rigid"), misfit
    for wrong, name in (
        (driven.force is not None and driven.force[0] != 0.0, "force"),
        (driven.moment is not None, "moment"),
        ((driven.prescribes("x"), driven.prescribes("rotation")) != (None, None), "prescribed"),
        *((bool(of.get("x") or of.get("rotation")), key) for key, of in of_components.items()),
    ):
        if wrong and (reason := statement.kinematics.refuses.get("motion of a rigid body")):
            yield ("contact", number, "foundation", name), reason
    for key in ("mass", "moment_of_inertia", "velocity"):
        if getattr(driven, key) is not None and not statement.effects.get("inertia"):
            yield ("contact", number, "foundation", key), "needs inertia = { time_step = ... }"
    if any(contact.moves for contact in statement.contact):
        reason = (
            "shift or rotation with t, here or elsewhere, and force, moment or prescribed: "
            "choose one of both"
        )
        yield ("contact", number, "foundation"), reason
