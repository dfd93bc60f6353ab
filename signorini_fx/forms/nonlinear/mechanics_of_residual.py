"""What a residual says of the results of a nonlinear body: its forces and contact sides at one displacement."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NoReturn

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.forms.given_forms import Facets
from signorini_fx.forms.mechanics_of_forms import acting_on
from signorini_fx.mechanics.model import Model
from signorini_fx.quantities.proved_statements import Refused
from signorini_fx.results.accuracy.stress_recovery import StressRecovery
from signorini_fx.results.certificate.contact_nodes import ContactSide
from signorini_fx.results.certificate.equilibrium import Balance
from signorini_fx.results.mechanics import Mechanics
from signorini_fx.results.resultants import ActingForces, NamedForces
from signorini_fx.results.stresses import RawStresses


@dataclass(frozen=True)
class ResidualMechanics(Mechanics):
    """See ``results.mechanics.Mechanics``.

    Attributes:
        balance: the residual as forces on the body without contact.
        contact_sides: the parts of the boundary with contact, met at the displaced points.
        boundaries: the facets of each part of the boundary that was given a name.
        fixed: which dofs of this rank are prescribed, ghosts included, shape (dofs,).
        loads: gives the loads beside the residual at a place in the lists of factors, see ``ActingForces``.
        steps: the same of each load step, by its displacement; none: there is this one alone.
        stresses: gives the stress at the end of a load step from the displacements of those up to it; None: the
            residual alone knows it.
        displaced: whether moments balance at the displaced points: at small strains they do at the undeformed ones.
    """

    balance: Balance
    contact_sides: Sequence[ContactSide]
    boundaries: Mapping[str, Facets]
    fixed: npt.NDArray[np.bool_]
    loads: Callable[[float], Sequence[NamedForces]] = lambda step: ()
    steps: Sequence[tuple[fem.Function, ResidualMechanics]] = ()
    displaced: bool = True
    stresses: Callable[[Model, Sequence[fem.Function]], RawStresses] | None = None
    linear: bool = False

    def sides(self, model: Model, y: fem.Function) -> list[ContactSide]:
        """See ``Mechanics``."""
        return list(self._at(y).contact_sides)

    @property
    def has_stress(self) -> bool:
        """See ``Mechanics``: of the materials of a scene."""
        return self.stresses is not None

    def stress(self, model: Model, y: fem.Function, step: float, shared: dict[str, StressRecovery]) -> RawStresses:
        """See ``Mechanics``.

        Raises:
            RuntimeError: the residual alone knows it.
        """
        if self.stresses is None:
            raise RuntimeError("only the residual knows the stresses of a nonlinear body: evaluate its own expression")
        path = [displacement for displacement, _ in self.steps]
        last = next((number for number, displacement in enumerate(path) if displacement is y), None)
        return self.stresses(model, [y] if last is None else path[: last + 1])

    def acting(self, model: Model, y: fem.Function, step: float) -> ActingForces:
        """See ``Mechanics``: at the supports; which loads act is known to the residual alone."""
        end = self._at(y)
        return acting_on(end.balance, end.boundaries, end.fixed, end.loads(step), displaced=end.displaced)

    def _at(self, y: fem.Function) -> ResidualMechanics:
        """That of the load step with a displacement."""
        return next((mechanics for displacement, mechanics in self.steps if displacement is y), self)

    def stated(self, model: Model) -> NoReturn:
        """See ``Mechanics``.

        Raises:
            Refused: always.
        """
        raise Refused("a nonlinear body has no guaranteed bound")
