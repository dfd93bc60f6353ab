"""What an effect of another package says of itself, tried at points before anything is assembled with it.

``density``, ``reaction`` and ``strain`` are evaluated as UFL at points of the boundary or body, with normals,
displacements and coefficients drawn at random, which no mesh is needed for; so is ``density_at``, which proofs read.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from signorini_fx.extensions import is_of_package
from signorini_fx.mechanics.statement.effect import Array, Effect, Force, InitialStrain, Resistance
from signorini_fx.mechanics.statement.expressions import in_space, sample
from signorini_fx.tuned import CERTIFICATE_TOLERANCE, SAMPLED_POINTS


@dataclass(frozen=True)
class TrialPoints:
    """Points as ``density_at`` sees them, ``statement.effect.Points``, here one cell with q points.

    Attributes:
        position: X, length, shape (1, q, d).
        normal: shape (1, q, d).
        displacement: length, shape (1, q, d).
        density: mass per volume, shape (1, 1).
        expansion: 1 / temperature, shape (1, 1).
        whole: ``total``.
    """

    position: Array
    normal: Array
    displacement: Array
    density: Array
    expansion: Array
    whole: float

    def total(self, effect: Effect) -> float:
        """See ``Coefficients``."""
        return self.whole

    def value(self, value: Any) -> Array:
        """See ``Coefficients``."""
        return sample(value, in_space(self.position[0]))[None]

    def value_in(self, region: str | None, value: Any) -> Array:
        """See ``BodyCoefficients``: all points are in the region."""
        return self.value(value)

    def vector(self, values: tuple[Any, ...]) -> Array:
        """See ``Coefficients``."""
        return np.stack([self.value(value) for value in values[: self.position.shape[2]]], axis=2)

    def __getitem__(self, point: int) -> TrialPoint:
        return TrialPoint(self, point)


@dataclass(frozen=True)
class TrialPoint:
    """One of them, ``statement.effect.BodyCoefficients`` as UFL without a mesh.

    Attributes:
        points: all of them.
        number: of this one.
    """

    points: TrialPoints
    number: int

    @property
    def normal(self) -> Any:
        """See ``Coefficients``."""
        return _vector(self.points.normal[0, self.number])

    @property
    def position(self) -> Any:
        """See ``Coefficients``."""
        return _vector(self.points.position[0, self.number])

    @property
    def density(self) -> float:
        """See ``Coefficients``."""
        return float(self.points.density[0, 0])

    @property
    def expansion(self) -> float:
        """See ``BodyCoefficients``."""
        return float(self.points.expansion[0, 0])

    def total(self, effect: Effect) -> float:
        """See ``Coefficients``."""
        return self.points.whole

    def value(self, value: Any) -> float:
        """See ``Coefficients``."""
        return float(self.points.value(value)[0, self.number])

    def value_in(self, region: str | None, value: Any) -> float:
        """See ``BodyCoefficients``."""
        return self.value(value)

    def vector(self, values: tuple[Any, ...]) -> Any:
        """See ``Coefficients``."""
        return _vector(self.points.vector(values)[0, self.number])


def fault_of(effect: Effect, x: Array) -> str:
    """What an effect of another package says of itself and does not keep; "": nothing was found, or it is of this one.

    Args:
        effect: at a time.
        x: points that it acts on, length, shape (n, d).
    """
    kind = type(effect)
    if is_of_package(kind) or not len(x):
        return ""
    if any(hasattr(value, "ufl_shape") for value in effect.given.values()):  # these have no independent check
        return ""
    points = _drawn(x)
    if isinstance(effect, Force):
        return _fault_of_density(effect, points)
    if isinstance(effect, Resistance):
        return _fault_of_reaction(effect, points)
    return _evaluated(effect, "strain", points)[1] if isinstance(effect, InitialStrain) else ""


def _evaluated(effect: Effect, method: str, points: TrialPoints, y: Array | None = None) -> tuple[Array, str]:
    """What a method gives at all points, of displacements ``y`` where it takes them, and why it cannot; "": it can."""
    name, values = type(effect).__name__, np.zeros(0)
    try:
        at_points = [points[number] for number in range(points.position.shape[1])]
        arguments = [(at,) if y is None else (_vector(y[0, number]), at) for number, at in enumerate(at_points)]
        values = np.array([_number(getattr(effect, method)(*given)) for given in arguments])
    except NotImplementedError:
        return values, f"{name} does not say its {method}"
    except Exception as error:
        return values, f"{method} of {name} cannot be evaluated at a point: {type(error).__name__}: {error}"
    return values, "" if np.isfinite(values).all() else f"{method} of {name} is not finite"


def _fault_of_density(effect: Force, points: TrialPoints) -> str:
    """What proofs read is what is solved."""
    name, (wanted, fault) = type(effect).__name__, _evaluated(effect, "density", points)
    if fault:
        return fault
    try:
        claimed = np.asarray(effect.density_at(points), dtype=np.float64)
        claimed = np.broadcast_to(claimed, (1, *wanted.shape))[0]
    except NotImplementedError:
        return f"{name} does not say its density_at"
    except Exception as error:
        return f"density_at of {name} fails: {type(error).__name__}: {error}"
    largest = np.abs(wanted).max(initial=0.0)
    same = np.abs(claimed - wanted).max(initial=0.0) <= CERTIFICATE_TOLERANCE * largest
    return "" if same else f"density_at of {name} is not its density"


def _fault_of_reaction(effect: Resistance, points: TrialPoints) -> str:
    """It is linear, symmetric, and does no negative work."""
    name, y = type(effect).__name__, points.displacement
    tried = [*(np.broadcast_to(unit, y.shape) for unit in np.eye(y.shape[2])), y]
    evaluated = [_evaluated(effect, "reaction", points, displacement) for displacement in tried]
    if fault := next((fault for _, fault in evaluated if fault), ""):
        return fault
    *columns, together = (values for values, _ in evaluated)
    matrix, largest = np.stack(columns, axis=-1), np.abs(columns).max()
    wrong = np.abs(together - np.einsum("qij,qj->qi", matrix, y[0])).max()
    if wrong > CERTIFICATE_TOLERANCE * largest * np.abs(y).max():
        return f"reaction of {name} is not linear in the displacement"
    if np.abs(matrix - matrix.swapaxes(1, 2)).max() > CERTIFICATE_TOLERANCE * largest:
        return f"reaction of {name} has no energy: it is not symmetric"
    if np.linalg.eigvalsh(matrix).min() < -CERTIFICATE_TOLERANCE * largest:
        return f"reaction of {name} pushes the body along its displacement"
    return ""


def _drawn(x: Array) -> TrialPoints:
    """Some of the points, and all else at random, the same each time."""
    random = np.random.default_rng(0)
    chosen = x[np.unique(np.linspace(0, len(x) - 1, SAMPLED_POINTS).astype(np.int64))][None]
    normal = random.normal(size=chosen.shape)
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    density, expansion, whole = random.uniform(0.5, 2.0, size=3)
    size = np.ptp(x, axis=0).max() or 1.0
    displacement = size * random.normal(size=chosen.shape)
    return TrialPoints(chosen, normal, displacement, np.array([[density]]), np.array([[expansion]]), float(whole))


def _vector(numbers: Array) -> Any:
    import ufl

    return ufl.as_vector(numbers.tolist())


def _number(value: Any) -> Any:
    """A number or a vector of UFL without a mesh as numbers."""
    import ufl
    from ufl.algorithms.apply_algebra_lowering import apply_algebra_lowering

    lowered = apply_algebra_lowering(ufl.as_ufl(value))
    return [float(lowered[i](())) for i in range(lowered.ufl_shape[0])] if lowered.ufl_shape else float(lowered(()))
