"""The certificate of a nonlinear body: its residual, distances and frames at the displaced points, evaluated anew.

Equilibrium is that of the residual F itself, relative to the contact forces and reactions; no matrix and no
linearisation enters.  The distance of the shapes, their normals, and how far they have moved are evaluated at X + u.
Both sides share F, the shapes, and the values of friction at the nodes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.algebra import Settings
from signorini_fx.forms.given_forms import Facets, conditions_of
from signorini_fx.forms.mechanics_of_forms import acting_on, prescribed_nodes
from signorini_fx.forms.nonlinear.linearised import LinearisedProblem
from signorini_fx.mechanics.loads.supports import prescribed
from signorini_fx.mechanics.obstacles.paired_points import MovingPair, PairedSides
from signorini_fx.results.accuracy.stress_recovery import StressRecovery
from signorini_fx.results.certificate.body_nodes import BodyNodes
from signorini_fx.results.certificate.certificate import Certificate, judged
from signorini_fx.results.certificate.contact_nodes import ContactConditions
from signorini_fx.results.certificate.equilibrium import Balance
from signorini_fx.results.certificate.law_of_method import Tractions
from signorini_fx.results.certificate.pair_points import PairPoints
from signorini_fx.results.mechanics import SolidBody, StepResult
from signorini_fx.results.resultants import ActingForces
from signorini_fx.results.stresses import RawStresses

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class ResidualMechanics:
    """What the residual says of a body at a displacement.

    Attributes:
        forces: the residual as forces on the body without contact.
        contact: what holds at the contact points, met at the displaced points; None: there is no contact.
        fixed: which dofs of this rank are prescribed, ghosts included, shape (dofs,).
    """

    forces: Balance
    contact: ContactConditions | None
    fixed: npt.NDArray[np.bool_]


@dataclass(frozen=True, kw_only=True)
class ResidualBody(SolidBody):
    """A body that its residual says all of, at the displacements of its load steps.

    Attributes:
        ends: each load step with what it says there, the last one at least.
        boundaries: the facets of each part of the boundary that was given a name.
        stress_error: gives what cells have of the error of the stress at the last one, see ``stress_error``.
    """

    no_bounds: ClassVar[str] = "a nonlinear body has no guaranteed bound"

    ends: Sequence[tuple[StepResult, ResidualMechanics]]
    boundaries: Mapping[str, Facets]
    stress_error: Callable[[], Array | str] = lambda: "there is no estimate of the error"

    def conditions(self, y: fem.Function) -> ContactConditions | None:
        return self._at(y).contact

    def stress(self, y: fem.Function, step: float, shared: dict[str, StressRecovery]) -> RawStresses | str:
        return "only the residual knows the stresses of a nonlinear body: evaluate its own expression"

    def balance(self, y: fem.Function, step: float) -> Balance:
        return self._at(y).forces

    def acting(self, y: fem.Function, step: float) -> ActingForces:
        """At the supports; which loads act is known to the residual alone."""
        end = self._at(y)
        return acting_on(end.forces, self.boundaries, end.fixed, (), displaced=True)

    def _at(self, y: fem.Function) -> ResidualMechanics:
        """That of the load step with a displacement, or of the last one."""
        return next((end for load_step, end in self.ends if load_step.displacement is y), self.ends[-1][1])


def mechanics_at(
    u: fem.Function, residual: Array, linear: LinearisedProblem, lost: Array | None = None
) -> ResidualMechanics:
    """The forces on a body and its contact at a displacement, where F is ``residual`` and its round-off ``lost``,
    None: not known, forces at the owned unknowns; ``linear``: of the last iteration; collective.
    """
    space, scales = u.function_space, linear.scales
    fixed, values = prescribed(space, conditions_of(linear.bcs, space))
    forces = residual.reshape(-1, space.mesh.geometry.dim)
    nothing = np.zeros_like(forces)
    balance = Balance(
        BodyNodes(space),
        forces,
        nothing,
        prescribed_nodes(fixed, values, space),
        scales,
        scales,
        nothing,
        lost=nothing if lost is None else lost.reshape(forces.shape),
        with_loads=True,
        displaced=bool(linear.shapes or linear.pairs),
    )
    return ResidualMechanics(balance, conditions_at(u, linear, fixed, values) if linear.contact else None, fixed)


def conditions_at(
    u: fem.Function, linear: LinearisedProblem, fixed: npt.NDArray[np.bool_], values: Array
) -> ContactConditions:
    """What holds at the contact points where a displacement has taken them: distances and normals of shapes, and the
    maps of pairs; ``fixed``: which dofs are prescribed, and to what, shapes (dofs,); collective.
    """
    linear.slide()
    data, foundations = [*linear.data], linear.foundations
    places = u.x.array.reshape(-1, u.function_space.mesh.geometry.dim)
    for number, moving in linear.shapes.items():
        gap, along = np.full(len(places), np.nan), np.full(places.shape, np.nan)
        gap[moving.nodes], along[moving.nodes] = moving.projected(linear=False)
        gap[moving.nodes] += moving.added
        data[number] = replace(data[number], gap=gap, shape=replace(data[number].shape, direction=along))
    for number in linear.pairs:  # their distance is that of the map
        allowance = data[number].allowance
        assert allowance is not None
        data[number] = replace(data[number], gap=allowance)
    boundary = linear.points([entry.shape for entry in data], fixed, values)
    regularised, law = foundations.problem(boundary, data, Settings.of(linear.settings), linear.scales)
    both: Mapping[int, PairedSides | MovingPair] = {**foundations.pairs, **linear.pairs}
    pairs = {number: PairPoints.of(pair) for number, pair in both.items()}
    return ContactConditions(boundary, regularised.gap, law, regularised.bilateral, pairs)


def certified(
    u: fem.Function, mechanics: ResidualMechanics, linear: LinearisedProblem, tractions: Tractions | None = None
) -> Certificate:
    """Check equilibrium and contact conditions at a displacement; ``linear``: of the last iteration; ``tractions``:
    None: those of the solver; collective.
    """
    tools, before = linear.foundations.rigid_bodies, linear.previous_step
    tractions = tractions or Tractions.of(linear.state)
    rigid = [*zip(tools.motions, tools.drives(), strict=True)]
    if before is not None:
        boundary, moved = linear.state.boundary, linear.moved(linear.state.boundary)
        signed = [(tool, -1.0) for tool in tools.motions] + [(tool, 1.0) for tool in before.rigid]
        for tool, sign in [] if moved is None else signed:  # beyond what they tell of the undeformed points
            touching = np.isin(boundary.part, tool.body.parts)
            moved[touching] += sign * tool.at(boundary.x[touching])
        before = replace(before, moved=moved)
    return judged(u, mechanics.forces, mechanics.contact, tractions, law=linear.law, before=before, rigid=rigid)
