"""Whose problem a result solves: factors of loads and of moduli with which it is in equilibrium.

Factors of loads are sought one by one and together, then those of moduli, and never both together: all of them zero
would be a solution.  Displacements alone do not tell a load from a modulus.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from signorini_fx.addons.judging.foreign_equilibrium import BestFit, Equilibrium, Fit
from signorini_fx.mechanics.mesh.files.shape import Floats
from signorini_fx.tuned import JUDGED_FACTOR_LEFT, JUDGED_FACTOR_RANGE, JUDGED_SAME_FACTOR, JUDGED_UNSEEN


@dataclass(frozen=True)
class FoundFactors:
    """Factors with which a displacement is in equilibrium.

    Attributes:
        kind: loads or moduli.
        factors: by the names of the loads or materials that differ or do not.
        count: how many of them were free.
        remainder: rho with them.
        residual: internal forces less loads with them, force, shape (n, d).
        fit: in whose formulation it is in equilibrium.
        springs: which of the names are those of springs.
    """

    kind: str
    factors: Mapping[str, float]
    count: int
    remainder: float
    residual: Floats
    fit: Fit
    springs: frozenset[str]

    def called(self, name: str) -> str:
        """A load, the moduli of a material or the stiffness of springs in words."""
        if self.kind == "loads":
            return name
        if name in self.springs:
            return f"stiffness of the {name}"
        return f"moduli of {name}" if name else "moduli"

    @property
    def changed(self) -> dict[str, float]:
        """Those that are not 1."""
        return {name: value for name, value in self.factors.items() if abs(value - 1) > JUDGED_SAME_FACTOR}

    @property
    def words(self) -> str:
        """For messages."""
        return ", ".join(f"{value:.4g} x the {self.called(name)}" for name, value in self.factors.items())


def found_factors(equilibrium: Equilibrium, best: BestFit) -> FoundFactors | None:
    """The fewest factors that explain what is left of equilibrium; None: none do.

    Those that leave nothing in one of the formulations, of which the wrong one may be nearer to equilibrium without
    them, come before those that leave little in the one that fits best.
    """
    for fit in best.tried:
        explained = _of_fit(equilibrium, fit)
        if explained is not None and explained.remainder <= equilibrium.threshold:
            return explained
    return _of_fit(equilibrium, best.fit)


def _of_fit(equilibrium: Equilibrium, fit: Fit) -> FoundFactors | None:
    """``found_factors`` in one formulation."""
    loads = list(equilibrium.problem.loads)
    loads += [strain.name for strain in equilibrium.problem.strains]
    materials = [*(material.name for material in equilibrium.problem.materials), *equilibrium.problem.springs]
    acting = -np.vstack((equilibrium.loads, fit.forces.strains))
    kinds = (
        ("loads", loads, acting, fit.forces.of_displacement),
        ("moduli", materials, fit.forces.by_material, -equilibrium.loads.sum(axis=0)),
    )
    tried: list[FoundFactors] = []
    for kind, names, parts, besides in kinds:
        alone = [[row] for row in range(len(names))]
        for chosen in [*alone, *([list(range(len(names)))] if len(names) > 1 else [])]:
            factors = _fitted(equilibrium, fit, kind, names, parts, besides, chosen)
            if factors is not None:
                tried.append(factors)
    # What leaves nothing comes before what leaves little, a load before a modulus, and one before all together.
    for limit in (equilibrium.threshold, JUDGED_FACTOR_LEFT * fit.rho):
        for kind, count in (("loads", 1), ("loads", len(loads)), ("moduli", 1), ("moduli", len(materials))):
            fitting = [
                entry for entry in tried if entry.kind == kind and entry.count == count and entry.remainder <= limit
            ]
            if fitting:
                return min(fitting, key=lambda entry: entry.remainder)
    return None


def _fitted(
    equilibrium: Equilibrium,
    fit: Fit,
    kind: str,
    names: list[str],
    parts: Floats,
    acting: Floats,
    chosen: list[int],
) -> FoundFactors | None:
    """The factors of some loads or moduli that leave least; None: they are no answer.

    Args:
        equilibrium: of the displacement.
        fit: in the formulation that fits best.
        kind: loads or moduli.
        names: of them.
        parts: their forces, shape (k, n d).
        acting: what acts besides, shape (n d,).
        chosen: which of them may have another factor than 1.
    """
    fixed = [row for row in range(len(names)) if row not in chosen]
    columns = np.column_stack((parts[chosen].T, fit.forces.columns))
    values, residual = equilibrium.least(acting + parts[fixed].sum(axis=0), columns)
    fitted = values[: len(chosen)]
    low, high = JUDGED_FACTOR_RANGE
    if ((fitted < low) | (fitted > high)).any() or not (np.abs(fitted - 1) > JUDGED_SAME_FACTOR).any():
        return None
    factors = dict.fromkeys(names, 1.0) | {names[row]: float(value) for row, value in zip(chosen, fitted, strict=True)}
    shaped = residual.reshape(equilibrium.v.shape)
    # Of softer bodies the residual is smaller, too: it is compared with their own energy.
    softness = min(1.0, float(fitted.min())) if kind == "moduli" else 1.0
    springs = frozenset(equilibrium.problem.springs)
    return FoundFactors(kind, factors, len(chosen), equilibrium.size(residual) / softness, shaped, fit, springs)


def unseen_factors(equilibrium: Equilibrium, fit: Fit) -> dict[str, float]:
    """By which share of itself a load or the stiffness of springs may differ from the problem's below the threshold of
    equilibrium, for those whose share is not small; what acts on supports and contact alone has none.
    """
    problem = equilibrium.problem
    names = [*problem.loads, *(strain.name for strain in problem.strains)]
    names += [f"stiffness of the {name}" for name in problem.springs]
    parts = np.vstack((equilibrium.loads, fit.forces.strains, fit.forces.by_material[len(problem.materials) :]))
    sizes = {name: equilibrium.size(forces) for name, forces in zip(names, parts, strict=True)}
    return {
        name: equilibrium.threshold / size
        for name, size in sizes.items()
        if 0 < JUDGED_UNSEEN * size < equilibrium.threshold
    }


def force_factor(theirs: Floats, residual: Floats, held: npt.NDArray[np.bool_]) -> tuple[float, float]:
    """The factor of forces that a program says against those that its displacement exerts, and what it leaves of them.

    Args:
        theirs: forces, shape (n, d).
        residual: internal forces less loads, shape (n, d).
        held: which components are compared, shape (n, d).
    """
    printed, exerted = theirs[held], residual[held]
    square = float(exerted @ exerted)
    if not square > 0:
        return 1.0, 0.0
    factor = float(printed @ exerted) / square
    return factor, float(np.linalg.norm(printed - factor * exerted) / np.sqrt(square))
