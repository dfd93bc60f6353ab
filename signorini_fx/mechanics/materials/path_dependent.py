"""Materials whose stress depends on the history (J. C. Simo and T. J. R. Hughes, Computational
Inelasticity, Springer, 1998).

Plasticity at finite strains comes from a law of small strains: the logarithm of the elastic stretch
takes the place of the strain (J. C. Simo, Comput. Methods Appl. Mech. Eng. 99 (1992) 61-112).

F = F_e F_p, b_e = F C_p^-1 F^T with C_p = F_p^T F_p, and epsilon = 1/2 ln b_e.  A load step starts
with the trial b_e from the C_p of its beginning; plastic flow, which has the axes of b_e, reduces
epsilon.  The Kirchhoff stress is J sigma.  C_p refers to the undeformed body, so that the result
does not depend on rotations.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Annotated, Any, Literal, Self, cast

import numpy as np
from pydantic import Field, PrivateAttr, model_validator

from signorini_fx.arrays import Array, quotient
from signorini_fx.mechanics.materials.nonlinear import (
    DEVIATORIC,
    PathDependent,
    PoissonBelowHalf,
    deviator,
)
from signorini_fx.mechanics.materials.protocol import PAIRS
from signorini_fx.mechanics.statement.base import refused
from signorini_fx.mechanics.statement.effect import Contradictions, Stated
from signorini_fx.mechanics.statement.values import Accepts, NonNegative, Positive
from signorini_fx.tuned import NEAR_ONE

_Table = Annotated[tuple[tuple[Positive, Positive], ...], Field(min_length=1)]


class J2(PathDependent):
    """Metal that yields by von Mises, with isotropic hardening: the stress E : (epsilon -
    epsilon_p) by radial return (boxes 3.1 and 3.2).

    The state is the plastic strain, 9 numbers, and the accumulated one.  At finite strains it is
    C_p^-1 - I, and the law is that of the logarithmic elastic strain and the Kirchhoff stress, see
    ``respond_at_finite_strains``.

    Attributes:
        law: its name.
        young: Young's modulus, stress.
        poisson: Poisson's ratio, in (-1, 0.5).
        yield_stress: by von Mises, at first, stress.
        hardening: by how much the yield stress grows per accumulated plastic strain, a stress; or
            rows [plastic strain, yield stress] of a table, between which it is linear; beyond the
            last one it is constant.
        strains: "small", or "finite", with rows of logarithmic strain and Kirchhoff stress.

    Examples:
        >>> metal = sfx.J2(law="j2", young=1000.0, poisson=0.3, yield_stress=1.0, hardening=50.0)
        >>> result = sfx.solve(scene.model_copy(update={"material": metal}))
        >>> print(np.round(result.contact.forces[0], 6))
        [0. 4.]
    """

    state_size = 10
    flows = True

    law: Literal["j2"]
    young: Positive
    poisson: PoissonBelowHalf
    yield_stress: Positive
    hardening: Accepts[float | Sequence[Sequence[float]], NonNegative | _Table] = cast("Any", 0.0)
    strains: Literal["small", "finite"] = "small"

    @property
    # A property here, a class attribute of other materials.
    def finite(self) -> bool:  # type: ignore[override]
        return self.strains == "finite"

    @model_validator(mode="after")
    def _hardens(self) -> Self:
        strains, stresses = self._curve
        for number, (wider, stronger) in enumerate(
            zip(np.diff(strains) > 0, np.diff(stresses) >= 0, strict=True)
        ):
            if not (wider and stronger):
                rule = (
                    "plastic strains must increase from 0, and yield stresses not decrease "
                    "from yield_stress"
                )
                raise refused("J2", [(("hardening", number), rule)])
        return self

    @property
    def _curve(self) -> tuple[Array, Array]:
        """The plastic strains and yield stresses of the hardening curve, beginning with strain 0;
        linear hardening has this point alone.
        """
        rows = () if isinstance(self.hardening, float) else self.hardening
        strains, stresses = zip((0.0, self.yield_stress), *rows, strict=True)
        return np.array(strains), np.array(stresses)

    @property
    def _slopes(self) -> Array:
        """The slopes of the segments that begin at the points of ``_curve``, stresses."""
        strains, stresses = self._curve
        last_slope = self.hardening if isinstance(self.hardening, float) else 0.0
        return np.append(np.diff(stresses) / np.diff(strains), last_slope)

    def respond(self, strain: Array, state: Array) -> tuple[Array, Array, Array]:
        """Return stress, tangent and state by radial return, in closed form for the segment of the
        hardening curve in which the return ends.
        """
        shear = self.constants_at_rest[0]
        plastic = state[:, :9].reshape(-1, 3, 3)
        accumulated = state[:, 9]
        trial = 2 * shear * (deviator(strain) - plastic)
        size = np.linalg.norm(trial, axis=(1, 2))
        mises = np.sqrt(1.5) * size
        begins, stresses = self._curve
        slopes = self._slopes
        # Find the last point of the curve that the flow passes.  Checking which segment contains
        # the end of the flow could, by round-off, find none if it ends at a point of the curve.
        until = np.maximum(begins - accumulated[:, None], 0.0)
        passed = mises[:, None] - 3 * shear * until > np.where(until > 0, stresses, -np.inf)
        last = np.maximum(passed.sum(axis=1) - 1, 0)
        slope = slopes[last]
        missing = mises - stresses[last] - slope * (accumulated - begins[last])
        flow = np.maximum(missing / (3 * shear + slope), 0.0)
        flowing = np.flatnonzero(flow > 0)
        normal = np.zeros_like(trial)
        share = np.ones_like(flow)
        normal[flowing] = trial[flowing] / size[flowing, None, None]
        share[flowing] = 1 - 3 * shear * flow[flowing] / mises[flowing]
        turned = 3 * shear / (3 * shear + slope[flowing]) - (1 - share[flowing])
        rows = np.array([normal[flowing, i, j] for i, j in PAIRS]).T
        tangent = 2 * shear * share[:, None, None] * DEVIATORIC
        tangent[flowing] -= 2 * shear * turned[:, None, None] * rows[:, :, None] * rows[:, None]
        grown = plastic + np.sqrt(1.5) * flow[:, None, None] * normal
        new = np.concatenate((grown.reshape(-1, 9), (accumulated + flow)[:, None]), axis=1)
        return share[:, None, None] * trial, tangent, new

    def respond_by_change(self, change: Array, state: Array) -> tuple[Array, Array, Array]:
        return respond_at_finite_strains(self.respond, change, state)

    def plastic_strain(self, state: Array) -> Array:
        """Return the integral of sqrt(2/3) |d epsilon_p|, shape (n,)."""
        return state[:, 9]


_Branch = tuple[Positive, Positive]


class Maxwell(PathDependent):
    """Rubber or polymer that relaxes (section 10.3): the deviatoric stress 2 G e + sum of q_i with
    dq_i/dt = 2 G_i de/dt - q_i / tau_i, e the deviator of the strain; the mean stress is that of
    the spring alone.

    A load step is integrated exactly for a strain that changes evenly in it.  Its duration is that
    between the times of the load path, which begins at time 0.  The state are the q_i and e, 9
    numbers each, and the time.

    Attributes:
        law: its name.
        young: Young's modulus of the spring, which is left after a long time, stress.
        poisson: Poisson's ratio of the spring, in (-1, 0.5).
        branches: rows [G_i, tau_i], the shear modulus that a branch adds at first, stress, and the
            time in which its stress falls to 1/e of itself.

    Examples:
        >>> pad = sfx.Maxwell(law="maxwell", young=100.0, poisson=0.3, branches=[[50.0, 1.0]])
        >>> changes = {"material": pad, "load_steps": sfx.LoadSteps(times=[1.0])}
        >>> print(np.round(sfx.solve(scene.model_copy(update=changes)).contact.forces[0], 6))
        [0. 4.]
    """

    law: Literal["maxwell"]
    young: Positive
    poisson: PoissonBelowHalf
    branches: Annotated[
        Accepts[Sequence[Sequence[float]], tuple[_Branch, ...]], Field(min_length=1)
    ]

    _time: float = PrivateAttr(1.0)

    @property
    # A property here, a class attribute of other materials.
    def state_size(self) -> int:  # type: ignore[override]
        return 9 * len(self.branches) + 10

    @property
    def constants_at_rest(self) -> tuple[float, float]:
        """The instantaneous shear and bulk modulus, with all branches, stresses."""
        spring, bulk = super().constants_at_rest
        return spring + sum(shear for shear, _ in self.branches), bulk

    def contradictions(self, statement: Stated, number: int) -> Contradictions:
        yield from super().contradictions(statement, number)
        times = statement.load_steps.times
        if times is not None and times[0] <= 0:
            yield (
                ("load_steps", "times"),
                "must be positive: a body that relaxes is without strain until time 0",
            )

    def at_time(self, time: float) -> Self:
        material = self.model_copy()
        material._time = time
        return material

    def respond(self, strain: Array, state: Array) -> tuple[Array, Array, Array]:
        strain_deviator = deviator(strain)
        last = state[:, -10:-1].reshape(-1, 3, 3)
        since = self._time - state[:, -1]
        spring = super().constants_at_rest[0]
        parts = []
        stress = 2 * spring * strain_deviator
        stiffness: Array = np.full(len(strain_deviator), 2 * spring)
        for branch, (shear, relaxation) in enumerate(self.branches):
            lasts = since / relaxation
            # (1 - exp(-x)) / x
            share = quotient(-np.expm1(-lasts), lasts, otherwise=1.0)
            part = np.exp(-lasts)[:, None, None] * state[:, 9 * branch : 9 * branch + 9].reshape(
                -1, 3, 3
            )
            part += 2 * shear * share[:, None, None] * (strain_deviator - last)
            stress = stress + part
            stiffness = stiffness + 2 * shear * share
            parts.append(part.reshape(-1, 9))
        new = np.column_stack(
            (*parts, strain_deviator.reshape(-1, 9), np.full(len(strain_deviator), self._time))
        )
        return stress, stiffness[:, None, None] * DEVIATORIC, new


# Coefficients of artanh(z) / z in powers of z^2, for small z.
_SERIES = (1.0, 1 / 3, 1 / 5, 1 / 7)


def respond_at_finite_strains(
    respond: Callable[[Array, Array], tuple[Array, Array, Array]], change: Array, state: Array
) -> tuple[Array, Array, Array]:
    """Return stress, tangent and state as ``PathDependent.respond_by_change`` of a plastic
    material.

    Args:
        respond: the isotropic law of small strains, see ``PathDependent.respond``: from a strain
            and a state to the deviatoric stress, its derivative, and the new state.
        change: F - I, shape (n, 3, 3).
        state: C_p^-1 - I and the accumulated plastic strain, shape (n, 10).
    """
    with np.errstate(invalid="ignore"):
        inside_out = ~(np.linalg.det(np.eye(3) + change) > 0)  # or not finite: no stress
    change = np.where(inside_out[:, None, None], 0.0, change)
    turned = change.swapaxes(1, 2)
    gradient = np.eye(3) + change
    inverse = np.linalg.inv(gradient)
    before = state[:, :9].reshape(-1, 3, 3)
    green = change + turned + change @ turned
    values, axes = np.linalg.eigh(green + gradient @ before @ gradient.swapaxes(1, 2))
    strain = np.log1p(values) / 2
    elastic = np.concatenate((np.zeros((len(state), 9)), state[:, 9:]), axis=1)
    stress, tangent, flown = respond(strain[:, :, None] * np.eye(3), elastic)

    across = axes.swapaxes(1, 2)
    back = inverse.swapaxes(1, 2)
    piola = axes @ stress @ across @ back
    # Derivatives by F_kl of b_e, of the strain and of the stress, along the axes of b_e.
    moved = (np.eye(3) + before) @ gradient.swapaxes(1, 2) @ axes
    of_stretch = axes[:, :, None, :, None] * moved[:, None, :, None, :]
    of_strain = (of_stretch + of_stretch.swapaxes(3, 4)).reshape(-1, 9, 3, 3)
    of_strain *= _slopes_of_logarithms(values)[:, None]
    i, j = np.transpose(PAIRS)
    rows = of_strain[:, :, i, j] * np.where(i == j, 1.0, 2.0)
    of_stress = np.empty_like(of_strain)
    of_stress[:, :, i, j] = of_stress[:, :, j, i] = rows @ tangent
    by_stress = axes[:, None] @ of_stress @ (across @ back)[:, None]
    by_inverse = piola.swapaxes(1, 2)[:, None, :, :, None] * back[:, :, None, None, :]
    derivative = by_stress - by_inverse.reshape(by_stress.shape)

    left = axes * np.expm1(2 * (strain - flown[:, :9:4]))[:, None] @ across
    new = np.concatenate((state[:, :9], flown[:, 9:]), axis=1)
    flows = flown[:, 9] > state[:, 9]
    new[flows, :9] = (inverse @ (left - green) @ back)[flows].reshape(-1, 9)
    piola[inside_out] = np.nan
    return piola, derivative.reshape(-1, 9, 9).swapaxes(1, 2), new


def _slopes_of_logarithms(values: Array) -> Array:
    """Return the divided differences of 1/2 ln(1 + x) between values, shape (n, 3, 3), from shape
    (n, 3).
    """
    differences = values[:, :, None] - values[:, None, :]
    sums = 2 + values[:, :, None] + values[:, None, :]
    half = differences / sums
    series = np.polynomial.polynomial.polyval(half**2, _SERIES) / sums
    near = np.abs(half) < NEAR_ONE
    far = np.arctanh(half) / np.where(near, 1.0, differences)
    return np.where(near, series, far)
