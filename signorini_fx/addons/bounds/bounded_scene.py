"""What a scene has to be like so that its error has a guaranteed bound, and its data at points."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.addons.bounds.arrays import Array
from signorini_fx.addons.bounds.round_foundations import is_known, is_round
from signorini_fx.addons.bounds.simplices import COLUMNS, ROWS, TWICE, IsotropicModuli, MatrixModuli, Moduli
from signorini_fx.extensions import is_of_package
from signorini_fx.machine import compat
from signorini_fx.mechanics.effects.contact import BilateralContact, BondedContact, Contact, UnilateralContact
from signorini_fx.mechanics.effects.displacement import PrescribedDisplacement
from signorini_fx.mechanics.effects.preload import Preload
from signorini_fx.mechanics.effects.springs import Springs
from signorini_fx.mechanics.effects.temperature import TemperatureChange
from signorini_fx.mechanics.elasticity.moduli import middles
from signorini_fx.mechanics.materials.protocol import Material
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.effect import Effect, Force
from signorini_fx.mechanics.statement.expressions import Expression, in_space, sample
from signorini_fx.mechanics.statement.features import refused_by
from signorini_fx.mechanics.statement.point_values import PointValues
from signorini_fx.quantities.proved_statements import Grounds, Refused
from signorini_fx.tuned import KNOWN_DEGREE, SAME_ENTRY

# Entries of a scene that are looked at beside forces whose densities tell all of them; any other one could act on the
# body unseen.
_KNOWN_EFFECTS = (
    PrescribedDisplacement,
    TemperatureChange,
    Springs,
    Preload,
    UnilateralContact,
    BilateralContact,
    BondedContact,
)


# Features of a scene that the proof does not know.
REFUSES = {
    "support of a point": "a displacement at a point has no guaranteed bound: a point has none in the energy norm",
    "point force": "a force at a point does infinite work: its displacement has no finite energy",
    "soft contact": "soft contact enters the foundation, and the bound is for displacements that do not",
    "links": "links act at points, where displacements of finite energy have no value",
    "friction axes": "friction that depends on the direction has no guaranteed bound yet",
}
# What else it does not know, by name.
CURVED, POINT = "curved cells", "parts that share a point"
HEXAHEDRA = "hexahedra"
INCOMPRESSIBLE = "material without a change of volume"
TURNING, NO_POLYNOMIAL = "Poisson's ratio or axes that vary", "grading that is no polynomial"
FORM_AS_GAP, FORM_AS_BOUND = "gap given as a form", "friction bound given as a form"
SHAPE = "some foundations with shapes"
LONG_FACETS = (
    "a guaranteed bound needs facets that are shorter than their distance from the centre of a round foundation"
)
REFUSES_BESIDES = {
    SHAPE: "a guaranteed bound is for planes so far, and for circles, spheres and cylinders that contact can leave, "
    "with a gap that is a number, in space without friction; friction has one where none of them moves, and those that "
    "forces move where they are no bonds and have no springs",
    CURVED: "a guaranteed bound is for straight cells so far",
    HEXAHEDRA: "in space a guaranteed bound is for tetrahedra so far",
    POINT: "a body whose parts share nothing but a point has no guaranteed bound yet",
    INCOMPRESSIBLE: "a body that cannot change its volume has no guaranteed bound: displacements of elements change "
    "it, so that their energy norm is infinite",
    TURNING: "Poisson's ratio or axes that vary have no guaranteed bound yet",
    NO_POLYNOMIAL: "a grading has a guaranteed bound where it is a polynomial of degree 5 at most, but for jumps and "
    "kinks along straight lines, and on triangles, parallelograms of degree 1 and tetrahedra so far",
    FORM_AS_GAP: "a gap given as a form is not known between the nodes",
    FORM_AS_BOUND: "a friction bound given as a form is not known between the nodes",
}

# What it does not know of the sides of two bodies, where they lie.
APART, TWICE_MET = "friction or bond of sides that are apart", "side that meets two others at a place"
NO_MATCH = "facets in space that are not over each other one to one, of sides that are not flat and parallel"
CLOSED_NO_MATCH = "bonds and contact that cannot open in space, of facets that are not over each other one to one"
HELD_BY_VARYING_SPRINGS = (
    "a body that springs alone hold has a guaranteed bound where their stiffness vanishes nowhere on some facets"
)
SPRINGS_MOVED = "with springs a guaranteed bound needs that nodes of two bodies meet, or do not nearly meet, so far"
NEARLY_MET, PARTLY_CLOSED = "corners of two bodies that nearly meet", "adjust that closes a part of a contact"
REFUSES_OF_PAIRS = {
    APART: "with friction or a bond a guaranteed bound is for sides of two bodies that lie on each other, or that are "
    "nominally in contact: how a pair turns whose sides are apart is no functional of displacements",
    TWICE_MET: "a guaranteed bound needs that each part of a side meets one part of one other side at most",
    NO_MATCH: "in space a guaranteed bound of two bodies is for flat parallel sides so far, or for meshes that match "
    "where they meet, facet over facet",
    CLOSED_NO_MATCH: "in space a guaranteed bound of bonds and of contact that cannot open is for meshes that match "
    "where they meet so far, facet over facet",
    NEARLY_MET: "a guaranteed bound needs that nodes of two bodies do not nearly meet where no side is straight",
    PARTLY_CLOSED: "adjust that closes a part of a contact does not say what the gap is between the nodes",
}


def knows(kind: type) -> bool:
    """Whether the proof knows what entries of this class do to the body."""
    return kind in _KNOWN_EFFECTS or issubclass(kind, Material) or is_density(kind)


def is_density(kind: type) -> bool:
    """Whether entries of this class do nothing to the body but what their force per volume or area does."""
    return issubclass(kind, Force) and kind.density_tells_all and not (kind.strains or kind.nodal)


def without_bound(label: str) -> str:
    """The reason of an entry that the proof does not know."""
    return f"{label} has no guaranteed bound yet"


@dataclass(frozen=True)
class BoundPoints:
    """Points of quadrature, ``statement.effect.Points``.

    Attributes:
        x: shape (f, q, d).
        normal: outward, shape (f, q, d).
    """

    x: Array
    normal: Array

    @property
    def displacement(self) -> Array:
        """Not known."""
        raise Refused("a load that follows the displacement has no guaranteed bound")

    @property
    def position(self) -> Array:
        """Of the points, shape (f, q, d)."""
        return self.x

    @property
    def density(self) -> Array:
        """Not known."""
        raise Refused("a value that follows the density has no guaranteed bound")

    def total(self, effect: Effect) -> float:
        """Not known."""
        raise Refused(f"the share of {effect.label} has no guaranteed bound")

    def value(self, value: Any) -> Array:
        """Of a number, an expression or a callable, shape (f, q)."""
        if hasattr(value, "ufl_shape"):
            raise Refused("what is given as a form is not known between points of quadrature")
        return sample(value, in_space(self.x.reshape(-1, self.x.shape[2]))).reshape(self.x.shape[:2])

    def vector(self, values: tuple[Any, ...]) -> Array:
        """Values along the axes, shape (f, q, d)."""
        return np.stack([self.value(value) for value in values[: self.x.shape[2]]], axis=2)


@dataclass(frozen=True)
class DensityPoints(BoundPoints):
    """Points at which a load is asked for its density.

    Attributes:
        mass: of the material, mass per volume, shape (f,).
        whole: the integral of ``weighting`` of the load.
    """

    mass: Array
    whole: float

    @property
    def density(self) -> Array:
        """See ``Coefficients``, shape (f, 1)."""
        return self.mass[:, None]

    def total(self, effect: Effect) -> float:
        """See ``Coefficients``."""
        return self.whole


def in_region(model: Model, region: str | None, owner: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    """Which of the cells ``owner`` are in a region; None: all of them are."""
    return np.ones(len(owner), dtype=bool) if region is None else np.isin(owner, model.tagged.cells(region))


def profile_of(load: Force, dimension: int) -> tuple[Any, ...]:
    """``Force.profile``, if the class that says it is not an older one than that which says the density."""
    first, second = (
        next(base for base in type(load).__mro__ if name in vars(base)) for name in ("profile", "density_at")
    )
    return load.profile(dimension) if is_of_package(second) or issubclass(first, second) else (load.density_at,)


def mass_of(model: Model, owner: npt.NDArray[np.int64]) -> Array:
    """Mass per volume of the cells ``owner``, shape (n,); zero where no material tells it."""
    mass: Array = np.zeros(len(owner))
    for material in model.statement.material:
        mass[in_region(model, material.region, owner)] = material.density or 0.0
    return mass


def moduli_of(model: Model, owner: npt.NDArray[np.int64]) -> Moduli:
    """Of the cells ``owner``."""
    dim = model.tagged.dimension
    if model.elastic.stiffness is not None:
        axes = _columns(model)
        stiffness = model.elastic.stiffness.at_cells[owner][:, axes][:, :, axes]
        softest = np.empty(len(owner))
        for material in model.statement.material:
            softest[in_region(model, material.region, owner)] = material.moduli[0]
        return MatrixModuli(stiffness * TWICE[dim], np.linalg.inv(stiffness) / TWICE[dim][:, None], softest)
    lame, mu = (values_of(part, owner) for part in model.elastic.lame)
    return IsotropicModuli(lame, mu, dim)


def values_of(part: Any, owner: npt.NDArray[np.int64]) -> Array:
    """Of a coefficient in the cells ``owner``, shape (n,)."""
    if isinstance(part, fem.Function):
        return np.asarray(part.x.array[part.function_space.dofmap.list[owner, 0]])
    return np.full(len(owner), float(part.value))


def stress_of_free_strain(model: Model, owner: npt.NDArray[np.int64]) -> tuple[Array, Array]:
    """The stress f that an initial strain of one takes from the cells ``owner``, shape (n, 3 or 6); and twice the
    energy density of this strain that no displacement in the plane changes, stress, shape (n,).
    """
    dim, stiffness = model.tagged.dimension, model.elastic.stiffness
    if stiffness is None:
        lame, mu = (values_of(part, owner) for part in model.elastic.lame)
        stress = np.zeros((len(owner), len(ROWS[dim])))
        stress[:, :dim] = (2 * mu + model.kinematics.directions * lame)[:, None]
        return stress, mu * (3 * lame + 2 * mu) / (lame + mu) * model.kinematics.prevented
    free = stiffness.of_free_strain
    values = free.x.array.reshape(-1, *free.ufl_shape)[free.function_space.dofmap.list[owner, 0]]
    axes = _columns(model)
    prevented = np.zeros(len(owner))
    if model.kinematics.prevented:
        at_cells = stiffness.at_cells[owner]
        ratios = at_cells[:, -1:] @ np.linalg.inv(at_cells[:, :-1])
        share = values[:, -1] - np.einsum("nk,nk->n", ratios[:, 0], values[:, :-1])
        for material in model.statement.material:
            inside = in_region(model, material.region, owner)
            across = material.free_strain_in_space(middles(model.tagged, owner[inside].astype(np.int32)))[:, 2, 2]
            prevented[inside] = across * share[inside]
    return values[:, axes], prevented


def _columns(model: Model) -> list[int]:
    """Where the components ``ROWS`` and ``COLUMNS`` are among those of the kinematics."""
    dim = model.tagged.dimension
    ordered = np.minimum(ROWS[dim], COLUMNS[dim]), np.maximum(ROWS[dim], COLUMNS[dim])
    return [model.kinematics.pairs.index(pair) for pair in zip(*map(np.ndarray.tolist, ordered), strict=True)]


def _is_bounded(entry: Contact, dimension: int) -> bool:
    """Whether contact with a foundation that has a shape is one that the proof knows: a round one is left by
    displacements of the elements, but they do not keep to it.
    """
    if not is_known(entry.foundation) or (entry.friction.acts and (entry.moves or entry.tool is not None)):
        return False
    if entry.tool is not None and (not entry.opens or entry.tool.stiffness(dimension).any()):
        return False
    return not is_round(entry.foundation) or (
        entry.opens and isinstance(entry.gap, float) and not (dimension == 3 and entry.friction.acts)
    )


def _is_polynomial(grading: Any) -> bool:
    """Whether a grading is one between places that are known."""
    return isinstance(grading, Expression) and grading.degree <= KNOWN_DEGREE and grading.cuts_exactly


def refuse_unknown(model: Model) -> None:
    """Raise where the scene has something that the proof does not know.

    Raises:
        Refused: with the reason.
    """
    mesh = model.tagged.mesh
    bounds = [value for entry in model.statement.contact for value in entry.friction.parameters.values()]
    shaped = [entry for entry in model.statement.contact if entry.foundation is not None]
    materials = model.statement.material
    gradings = [material.grading for material in materials if material.grading is not None]
    # Inside quadrilaterals of degree 2 the displacement is more than the proof has points for.
    quadratic = mesh.topology.cell_name() == "quadrilateral" and model.space.element.basix_element.degree == 2
    present = {
        INCOMPRESSIBLE: not all(np.isfinite(material.lame).all() for material in materials),
        TURNING: any(material.model_copy(update={"grading": None}).varies for material in materials),
        NO_POLYNOMIAL: bool(gradings) and (quadratic or not all(map(_is_polynomial, gradings))),
        SHAPE: not all(_is_bounded(entry, model.tagged.dimension) for entry in shaped),
        CURVED: compat.geometry_degree(mesh) > 1,
        HEXAHEDRA: mesh.topology.cell_name() == "hexahedron",
        POINT: model.pieces.pins.size > 0,
        FORM_AS_GAP: any(hasattr(entry.gap, "ufl_shape") for entry in model.statement.contact),
        FORM_AS_BOUND: any(hasattr(value, "ufl_shape") for value in bounds),
    }
    for wrong, reason in (
        ("guaranteed bound" in model.kinematics.refuses, model.kinematics.refuses.get("guaranteed bound", "")),
        *((present[name], reason) for name, reason in REFUSES_BESIDES.items()),
        *((True, reason) for _, reason in refused_by(model.statement, REFUSES)),
        *(
            (not knows(type(entry)) or (isinstance(entry, Force) and entry.interface != ""), without_bound(entry.label))
            for _, entry in model.statement.listed()
        ),
    ):
        if wrong:
            raise Refused(reason)


@dataclass(frozen=True)
class _Datum:
    """A value of a scene that a bound looks at between nodes.

    Attributes:
        kind: what it is, in words.
        name: the same with its place.
        value: of the scene.
        degree: up to which its points tell all of a polynomial.
        cut: whether facets and cells are cut where expressions compare.
    """

    kind: str
    name: str
    value: Any
    degree: float
    cut: bool = False


def _data(model: Model, place: float) -> Iterator[_Datum]:
    """What a bound looks at between nodes at a place in the lists of factors."""
    dimension = model.tagged.dimension
    for contact in model.statement.placed(place).contact:
        yield _Datum("gap", f"gap of {contact.boundary!r}", contact.gap, 2)
        bound = 0.0 if contact.friction.follows_pressure else contact.friction.given_bound
        yield _Datum("friction bound", f"friction bound of {contact.boundary!r}", bound, 1)
    for _, listed in model.statement.listed():
        if not isinstance(listed, Force | PrescribedDisplacement | TemperatureChange | Springs):
            continue
        _, entry = model.statement.now(listed, place)
        name = entry.label if entry.where is None else f"{entry.label} of {entry.where!r}"
        if isinstance(entry, TemperatureChange):
            yield from (_Datum(entry.label, entry.name, value, KNOWN_DEGREE, True) for value in entry.given.values())
        elif isinstance(entry, Springs):
            yield from (
                _Datum("stiffness of springs", f"stiffness of {name}", value, KNOWN_DEGREE, True)
                for value in entry.given.values()
            )
        elif isinstance(entry, Force):
            yield from (_Datum(entry.label, name, value, KNOWN_DEGREE, True) for value in profile_of(entry, dimension))
        else:
            for key, value in entry.given.items():
                yield _Datum(entry.label, name, value, 4 if key == "rotation" else 5)  # multiplied by a distance


def why_estimated(model: Model, place: float = 0.0) -> str:
    """Why what is computed as a bound is an estimate, as data are known at points alone; "": it is a bound."""
    reasons = []
    for datum in _data(model, place):
        if isinstance(datum.value, Expression):
            if datum.cut and datum.value.jumps and not datum.value.cuts_exactly:
                reasons.append(f"the {datum.name} compares functions that are not affine")
        elif isinstance(datum.value, PointValues):
            reasons.append(f"the {datum.name} is known at the points of a file alone")
        elif not isinstance(datum.value, float | None):
            reasons.append(f"the {datum.name} is a function of Python")
    return " and ".join(dict.fromkeys(reasons))


def grounds(model: Model, place: float, *, coulomb: bool, later: bool, unknown: float, flat: bool = True) -> Grounds:
    """What a bound rests on.

    Args:
        model: the model.
        place: in the lists of factors.
        coulomb: whether its friction bound is the computed one.
        later: whether slip counts from the displacement of another load step.
        unknown: share of the loads that quadrature does not know, which is counted.
        flat: whether the sides of all pairs of bodies are parallel.
    """
    seen = [
        datum.kind
        for datum in _data(model, place)
        if isinstance(datum.value, Expression)
        and (
            datum.value.degree > datum.degree or not (datum.value.cuts_exactly if datum.cut else datum.value.is_smooth)
        )
    ]
    statements = [
        f"the {' and the '.join(dict.fromkeys(seen))} assumed to be as seen at points of each facet or cell"
        if seen
        else "",
        f"quadrature of the loads, two rules of which differ by {unknown:.1e} of them, is counted"
        if unknown > SAME_ENTRY
        else "",
        model.statement.body_of_proofs,
        "of the problem with the computed shortenings of sections that a force has tightened before, whose errors are "
        "not bounded"
        if any(
            entry.force is not None and entry.force_at(model.statement, place) is None
            for entry in model.statement.of(Preload)
        )
        else "",
        "in the energy norm of body and springs" if model.statement.of(Springs) else "",
        "of the displacement alone, whose volume changes more than the pressure of the mixed element says"
        if model.elastic.pressed
        else "",
        "" if flat else "of the sides of two bodies as polygons, paired at their nodes",
        "of the Tresca problem with the computed friction bound, converged or not: that this is the bound of the exact "
        "solution is assumed"
        if coulomb
        else "",
        "of the load step that begins with the computed displacement of the one before: that this is exact is assumed"
        if later
        else "",
    ]
    return Grounds(why_estimated(model, place), "; ".join(filter(None, statements)))
