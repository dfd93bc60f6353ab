"""Derivatives of results of a ``ContactProblem`` by its Constants."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import ufl
from dolfinx import fem

from signorini_fx.addons.derivatives.gradient import ChangedStep, SolvedStep, difference, explicit
from signorini_fx.arrays import Array, length
from signorini_fx.errors import FormError, SceneError, SignoriniError
from signorini_fx.machine import parallel
from signorini_fx.machine.compilation import compiling
from signorini_fx.mechanics.assembly.mesh_entities import assemble
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.mechanics.model import Model
from signorini_fx.quantities.differentiable import Functional, Gradient, functional_of
from signorini_fx.results.accuracy.adjoint import Explicit, TransposedTangent
from signorini_fx.tuned import (
    DIFFERENCE_STEP,
    LEFT_BY_SOLVES,
    WIDEST_DIFFERENCE,
    WIDTHS_OF_DIFFERENCE,
    ZERO_IN_SOLUTION,
)


@dataclass(frozen=True)
class OfForm(Functional):
    """A UFL form of the displacement u without arguments, see ``Functional``."""

    form: fem.Form
    derivative: fem.Form
    u: fem.Function

    def value(
        self, y: fem.Function, boundary: ContactBoundary, pressure: Array, shear: Array
    ) -> float:
        saved = self.u.x.array.copy()
        self.u.x.array[:] = y.x.array
        try:
            return parallel.total(boundary.comm, fem.assemble_scalar(self.form))
        finally:
            self.u.x.array[:] = saved

    def by_displacement(self, y: fem.Function) -> Array | None:
        return assemble(self.derivative)


def _quantity_of(wanted: ufl.Form | str, u: fem.Function, body: Callable[[], Model]) -> Functional:
    """Return a result, see ``ContactProblem.gradient``: a UFL form, or a text with a contact by its
    name or number; collective.
    """
    if isinstance(wanted, ufl.Form):
        if wanted.arguments():
            raise FormError.at("of", "has arguments: a number is expected, a form of u alone")
        with compiling():
            test = ufl.TestFunction(u.function_space)
            return OfForm(fem.form(wanted), fem.form(ufl.derivative(wanted, u, test)), u)
    named = body()
    words = str(wanted).split()
    contacts = [effect.boundary for effect in named.contacts]
    if len(words) > 1 and words[1].isdigit() and int(words[1]) < len(contacts):
        words[1] = shlex.quote(contacts[int(words[1])])
    try:
        return functional_of(named, " ".join(words))
    except SceneError as error:
        raise FormError(
            [
                *error.problems,
                ("of", f"{wanted!r} is no result; a UFL form of u without arguments is one, too"),
            ]
        ) from None


def _checked(by: fem.Constant | Sequence[fem.Constant]) -> list[fem.Constant]:
    """Return the Constants as a list; refuse anything but Constants with one value."""
    constants = [by] if isinstance(by, fem.Constant) else list(by)
    wrong = [
        k
        for k, constant in enumerate(constants)
        if not isinstance(constant, fem.Constant) or constant.value.size != 1
    ]
    if wrong:
        raise FormError(
            [
                (f"by[{k}]", "a Constant with one value is expected, that the problem uses")
                for k in wrong
            ]
        )
    return constants


def extrapolated(slope: Callable[[float], float], unit: float) -> float:
    """Return a derivative extrapolated from central differences of several widths, by Ridders'
    method.

    Where the data are smooth it has not the round-off of a narrow difference; elsewhere the narrow
    difference is returned.

    Args:
        slope: returns the central difference of a half width.
        unit: unit of the half widths; 0 for the narrow difference alone.
    """
    narrow = slope(DIFFERENCE_STEP * (unit or 1.0))
    best = narrow
    error = DIFFERENCE_STEP * abs(narrow)
    rows = list[list[float]]()
    for k in range(WIDTHS_OF_DIFFERENCE if unit else 0):
        try:
            row = [slope(WIDEST_DIFFERENCE * 0.5**k * unit)]
        except SignoriniError:  # data that the problem refuses
            row = [float("nan")]
        for order, coarser in enumerate(rows[-1] if rows else [], start=1):
            row.append(row[-1] + (row[-1] - coarser) / (4.0**order - 1))
            change = max(abs(row[-1] - row[-2]), abs(row[-1] - coarser))
            if change < error:
                best = row[-1]
                error = change
        rows.append(row)
        if error <= LEFT_BY_SOLVES * abs(best):
            break
    return best


def gradient(
    of: ufl.Form | str,
    by: fem.Constant | Sequence[fem.Constant],
    body: Callable[[], Model],
    step: tuple[Any, ...],
    data: Callable[[], tuple[Any, ...]],
) -> Gradient:
    """Return the derivatives of one result by Constants, see ``ContactProblem.gradient``;
    collective.

    Args:
        of: the result.
        by: the Constants.
        body: returns the model.
        step: the solution, see ``SolvedStep.of``.
        data: evaluates the problem with the current values of the Constants: forms, forces,
            prescribed displacements, contact points, gap, law, see ``ChangedStep``.

    Raises:
        FormError: an argument is wrong.
        RuntimeError: the result depends on the previous step, whose Constants, Functions and
            conditions are no longer known.
    """
    begun = step[3]
    u = step[5]
    quantity = _quantity_of(of, u, body)
    constants = _checked(by)
    solved = SolvedStep.of(*step)
    tangent = TransposedTangent(solved.system, solved.law, symmetric=solved.body.symmetric)
    adjoint = tangent.adjoint(*solved.quantity(quantity))
    state = solved.state
    value = solved.value(quantity)
    moved = state.points.weight * (length(state.u_t) + length(state.slip_length))
    owed = np.sum(moved * length(adjoint.tied[:, 1:]))
    if begun.step > 0 and parallel.global_sum(solved.body.comm, owed) > ZERO_IN_SOLUTION * abs(
        value
    ):
        raise RuntimeError(
            "after advance() the result depends on the slip and the shear of the step before, by "
            "points that stick or, in 3D, turn, and the data of that step are not kept: use a "
            "scene with load steps"
        )
    slopes: list[float] = []
    for constant in constants:
        kept = constant.value.copy()

        def at(change: float, constant: fem.Constant = constant, initial: Array = kept) -> Explicit:
            try:
                constant.value[...] = initial + change
                return explicit(solved, ChangedStep(*data()), [quantity])
            finally:
                constant.value[...] = initial

        def slope(width: float, at: Callable[[float], Explicit] = at) -> float:
            change = difference(at(width), at(-width), width)
            return adjoint.derivative(change, change.values[0])

        slopes.append(extrapolated(slope, abs(float(kept.ravel()[0]))))
    return Gradient(value, np.array(slopes), solved.law.between)
