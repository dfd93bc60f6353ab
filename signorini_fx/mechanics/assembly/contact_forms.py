"""The weak forms of contact, each returning its UFL terms.  Symbols and equation numbers as in the paper.

The contact terms are integrated with a rule whose points are the contact nodes (``nodal_rule``).  With it a nodal field
is multiplied point by point, so that the terms of (3.3a) need to be assembled once, for unit multipliers, and
everything after that is arithmetic on nodal values, which is equivalent to ``regularised_contact_form`` below.
"""

from __future__ import annotations

from typing import Any

import ufl


def nodal_rule(degree: int, geometry: int = 1, dimension: int = 2) -> dict[str, Any]:
    """Quadrature metadata of the unit contact form, which gives the weights of the nodes of a Lagrange element.

    In 2D the points of the rule are the nodes.  Degree 1: the vertex (trapezoidal) rule; degree 2:
    Gauss-Lobatto-Legendre (Simpson's rule).  All weights are positive, and those of the integrals of the basis
    functions.  On a surface the integrals of the basis functions stand for themselves, exactly: the vertex rule has
    them on triangles, but not on quadrilaterals that are no parallelograms.
    """
    if dimension == 3:
        return {"quadrature_degree": lumped_degree(degree, geometry)}
    if degree == 1:
        return {"quadrature_rule": "vertex", "quadrature_degree": 1}
    return {"quadrature_rule": "GLL", "quadrature_degree": 2 * degree - 1}


def lumped_degree(degree: int, geometry: int) -> int:
    """Quadrature degree that integrates a basis function of ``degree`` times the normal of a surface exactly."""
    return 2 * (degree + geometry)


def contact_form(pressure: Any, z: Any, n: Any, ds: Any) -> Any:
    """(lambda, tau_N z) on Gamma_c, the contact term of (3.3a); ``ds`` carries the nodal rule."""
    return pressure * ufl.inner(z, n) * ds


def average_form(y: Any, phi: Any, ds: Any) -> Any:
    """(phi, y) on Gamma_c, which is w_i times the average of y around the contact point of the hat function phi."""
    return ufl.inner(y, phi) * ds


def friction_form(shear: Any, z: Any, n: Any, ds: Any) -> Any:
    """(mu, tau_T z) on Gamma_c, the friction term of (3.3a), with the tangent t = (-n_2, n_1)."""
    return shear * ufl.inner(z, ufl.as_vector((-n[1], n[0]))) * ds


def regularised_contact_form(
    y: Any, z: Any, n: Any, ds: Any, *, gap: Any, gamma_n: Any, gamma_t: Any, bound: Any, lambda_hat: Any, mu_hat: Any
) -> Any:
    """Contact and friction terms of (3.3a) with (3.3b) and (3.4) inserted: the max/min form of textbooks.

    Its UFL derivative is the generalised derivative (1.5).  The solver does not assemble it: it keeps the active sets
    as nodal indicators, which sigma of (3.3c) needs and which this form cannot express.  It is the reference that the
    solver's residual and Jacobian are tested against.
    """
    t = ufl.as_vector((-n[1], n[0]))
    pressure = ufl.max_value(0, lambda_hat + gamma_n * (ufl.inner(y, n) - gap))
    trial = mu_hat + gamma_t * ufl.inner(y, t)
    shear = trial - ufl.max_value(0, trial - bound) - ufl.min_value(0, trial + bound)
    return contact_form(pressure, z, n, ds) + friction_form(shear, z, n, ds)
