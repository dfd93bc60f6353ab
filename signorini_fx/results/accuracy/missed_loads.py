"""Loads that jump between the points of quadrature: a well resolved solution may belong to other loads.

They are integrated with many more points; the difference is a separate error, which is refined like the others.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import default_scalar_type, fem

from signorini_fx.mechanics.assembly.mesh_entities import assemble
from signorini_fx.mechanics.loads.load_vectors import measures
from signorini_fx.mechanics.model import Model
from signorini_fx.mechanics.statement.effect import Force

Floats = npt.NDArray[np.float64]

# Quadrature to compare with, by dimension: 31 points along a facet and 100 in a cell; in 3D 441 and 343.
_FACET_DEGREE, _CELL_DEGREE = {2: 60, 3: 40}, {2: 18, 3: 12}


def missed_loads(model: Model, step: float) -> Floats:
    """The part of the loads that the quadrature of each owned cell misses, a force (in 2D per thickness), shape
    (cells,); collective.

    Args:
        model: the model.
        step: the load step.
    """
    mesh, dim = model.tagged.mesh, model.tagged.dimension
    owned = mesh.topology.index_map(dim).size_local
    loads = [load for load in model.statement.of(Force) if load.varies]
    if not loads:
        return np.zeros(owned)
    z = ufl.TestFunction(fem.functionspace(mesh, ("DG", 0, (model.dimension,))))
    on, terms = model.coefficients, []
    assert on is not None
    on.move_to(step)
    for load, where in zip(loads, measures(model.space, loads, model.tagged.facets), strict=True):
        factor = fem.Constant(mesh, default_scalar_type(model.statement.now(load, step)[0]))
        density = factor * ufl.inner(load.density(on), z) * on.around
        fine = _CELL_DEGREE[dim] if load.where is None else _FACET_DEGREE[dim]
        terms += [
            density * where(metadata={"quadrature_degree": fine}),
            -density * where(metadata={"quadrature_degree": load.degree(model.statement.element.degree)}),
        ]
    missed = model.inventory.compile("missed loads", lambda: fem.form(sum(terms[1:], terms[0])))
    return np.asarray(np.linalg.norm(assemble(missed).reshape(-1, model.dimension), axis=1))
