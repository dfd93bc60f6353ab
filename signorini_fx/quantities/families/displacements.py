"""Displacements of boundaries and points."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from signorini_fx.errors import MeshError, SceneError
from signorini_fx.quantities.quantity import Quantity
from signorini_fx.quantities.requests import axis_of
from signorini_fx.quantities.step_columns import by_axis, of_boundaries

if TYPE_CHECKING:
    from signorini_fx.mechanics.model import Model
    from signorini_fx.quantities.functional import Functional


class MeanTangential(Quantity):
    """Along the contact boundary."""

    key, unit, stage, steps = "mean_tangential_displacement", "length", "never", "components"
    title = "Mean tangential displacement of the contact boundary."

    def columns(self, solution: Any) -> dict[str, Any]:
        """See ``Quantity``; between several bodies of each boundary."""
        contact, names = solution.contact, of_boundaries(solution.statement)
        if contact is None:
            return {}
        motions = contact.mean_tangential_of_each if names else [contact.mean_tangential_displacement]
        return by_axis(self.key, motions, names)


class Mean(Quantity):
    """Over any boundary."""

    key, unit, stage = "mean_displacement", "length", "never"
    title = "Mean displacement of a boundary along an axis."
    request = "mean BOUNDARY AXIS"

    def functional(self, model: Model, *words: str) -> Functional | None:
        import ufl
        from dolfinx import fem

        from signorini_fx.machine import parallel
        from signorini_fx.mechanics.assembly.mesh_entities import assemble, measure
        from signorini_fx.quantities.differentiable import OfDisplacement

        boundary, axis = words
        z, component = ufl.TestFunction(model.space), axis_of(model.dimension, axis)
        try:
            facets = model.tagged.facets(boundary)
        except MeshError as error:
            raise SceneError([(f"of mean {boundary}", str(error))]) from None
        ds = measure(model.space.mesh, [facets], {})(1)
        around = model.kinematics.measure(ufl.SpatialCoordinate(model.space.mesh))
        form = model.inventory.compile(f"mean of {boundary}", lambda: fem.form(z[component] * around * ds))
        weights = assemble(form)
        area = float(parallel.global_sum(model.comm, weights.sum()))
        if area == 0:
            raise SceneError([(f"of mean {boundary}", "this boundary has no area")])
        return OfDisplacement(np.asarray(weights / area, dtype=np.float64))


class AtPoint(Quantity):
    """Of the body."""

    key, unit, stage = "displacement", "length", "never"
    title = "Displacement of a point along an axis."
    request = "displacement X,Y[,Z] AXIS"

    def functional(self, model: Model, *words: str) -> Functional | None:
        from signorini_fx.quantities.differentiable import OfDisplacement

        point, axis = words
        x = np.array([float(coordinate) for coordinate in point.split(",")])
        if x.size != model.dimension:
            raise ValueError(point)
        functional = OfDisplacement.at_point(model.space, x, axis_of(model.dimension, axis))
        if functional is None:
            raise SceneError([(f"of displacement {point}", "this point is outside of the body")])
        return functional


QUANTITIES = (MeanTangential(), Mean(), AtPoint())
