"""The constitutive law: isotropic linear elasticity in two and three dimensions."""

from __future__ import annotations

from typing import Any

import ufl

from signorini_fx.scene.model import LinearElastic


def lame_parameters(material: LinearElastic) -> tuple[float, float]:
    """Lame parameters (lambda, mu) of section 2.1, stresses; lambda is the reduced one for plane stress.

    Plane strain has those of three dimensions.
    """
    young, poisson = material.young, material.poisson
    mu = young / (2 * (1 + poisson))
    if material.hypothesis == "plane stress":
        return young * poisson / (1 - poisson**2), mu
    return young * poisson / ((1 + poisson) * (1 - 2 * poisson)), mu


def plane_modulus(material: LinearElastic) -> float:
    """Stress per strain along a line without lateral stress: E / (1 - nu^2) in plane strain, E in plane stress."""
    return material.young / (1 - material.poisson**2) if material.hypothesis == "plane strain" else material.young


def strain(y: Any) -> Any:
    """Linearised strain, epsilon(y) of section 2.1, shape (d, d)."""
    return ufl.sym(ufl.grad(y))


def stress(y: Any, lame: Any, mu: Any) -> Any:
    """Stress sigma(y) = lambda tr(epsilon) I + 2 mu epsilon of section 2.1, shape (d, d)."""
    epsilon = strain(y)
    return lame * ufl.tr(epsilon) * ufl.Identity(len(y)) + 2 * mu * epsilon
