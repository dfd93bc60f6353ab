"""Residuals with several quadrature rules, which some versions of the form compiler get wrong.

FFCx 0.9 compiles the residual of some energies with a rule of one point beside another rule to a wrong vector, though
the matrix of its derivative is right.  The solution of such a vector would be that of another problem.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import ufl
from dolfinx import fem

from signorini_fx.errors import FormError
from signorini_fx.forms.nonlinear.tangent import random_direction
from signorini_fx.machine import parallel
from signorini_fx.machine.compilation import compiling
from signorini_fx.mechanics.assembly.mesh_entities import assemble
from signorini_fx.tuned import NOTHING_LEFT, TRIED_STRAIN


def refuse_miscompiled(F: Any, residual: fem.Form, u: fem.Function, options: dict[str, Any]) -> None:
    """Compare a residual with the sum of its integrals by each rule, where it has several; collective.

    Args:
        F: a UFL form.
        residual: F, compiled.
        u: the Function that F depends on; it is as it was afterwards.
        options: of the form compiler, see ``dolfinx.fem.form``.

    Raises:
        FormError: they differ.
    """
    rules: dict[Any, list[Any]] = {}
    for integral in F.integrals():
        rules.setdefault(integral.metadata().get("quadrature_degree"), []).append(integral)
    if len(rules) < 2:
        return
    with compiling():
        parts = [fem.form(ufl.Form(integrals), **options) for integrals in rules.values()]
    values = u.x.array.copy()
    u.x.array[:] += random_direction(u, TRIED_STRAIN).x.array
    whole, summed = assemble(residual), np.sum([assemble(part) for part in parts], axis=0)
    u.x.array[:] = values
    comm = u.function_space.mesh.comm
    wrong, size = (parallel.largest(comm, np.abs(forces), 0.0) for forces in (whole - summed, summed))
    if np.isfinite(size) and not wrong <= NOTHING_LEFT * size:
        why = "is compiled wrongly: FFCx takes a quadrature rule of one point beside another one for something else, "
        cure = f"{wrong / size:.1e} from the sum over its rules; take no quadrature_degree below 2"
        raise FormError([("F", why + cure)])
