"""The weak forms of contact, each returning its UFL terms.  Symbols and equation numbers as in the paper.

The contact terms are integrated with a rule whose points are the contact nodes (``nodal_rule``).  With it a nodal field
is multiplied point by point, so that the terms of (3.3a) need to be assembled once, for unit multipliers, and
everything after that is arithmetic on nodal values.
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
