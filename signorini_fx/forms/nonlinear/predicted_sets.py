"""The sets that a load step begins with: those of the end of the last one, as they go on to change where supports and
shapes go on as they did in that.

Which sets a solve begins with decides how many linear solves it takes, and nothing else.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from signorini_fx.algebra.algorithms.task import Start
from signorini_fx.algebra.contact.active_sets import ActiveSets, keep_closed
from signorini_fx.algebra.contact.complementarity import slip_of
from signorini_fx.algebra.contact.nodal_vectors import Nodal, length, unit
from signorini_fx.machine import parallel
from signorini_fx.mechanics.contact_points.contact_boundary import ContactBoundary
from signorini_fx.results.certificate.law_of_method import PreviousStep
from signorini_fx.tuned import SAME_WAY

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class StepChange:
    """What a load step has changed.

    Attributes:
        displacement: its values, ghosts included, length, shape (dofs,).
        pressure: at the contact points of this rank, stress, shape (n,).
        shear: likewise, as vectors, shape (n, d).
        moved: foundations at these points, length, shape (n, d); None: none has moved.
    """

    displacement: Array
    pressure: Array
    shear: Array
    moved: Array | None

    @classmethod
    def between(cls, earlier: PreviousStep | None, later: PreviousStep) -> StepChange:
        """From the end of one load step, as the next one sees it, None: from rest, to the end of that."""
        displacement, tractions = later.displacement.x.array.copy(), later.tractions
        if earlier is None:
            return cls(displacement, tractions.pressure, tractions.shear, None)
        begun = earlier.tractions
        displacement -= earlier.displacement.x.array
        return cls(displacement, tractions.pressure - begun.pressure, tractions.shear - begun.shear, earlier.moved)

    def goes_on(self, comm: MPI.Comm, supported: npt.NDArray[np.bool_], ways: Array, moved: Array | None) -> float:
        """How many times the ways of supports and foundations the present ones are; 0: they lead elsewhere, or there
        are none; collective.

        Args:
            comm: of the ranks.
            supported: owned unknowns that are prescribed, shape (owned dofs,).
            ways: of these, length.
            moved: see ``StepChange``.
        """
        still = np.zeros_like(self.shear)
        tools = (still if way is None else way for way in (self.moved, moved))
        of_supports = self.displacement[: supported.size][supported], ways
        earlier_ways, present = (np.append(*pair) for pair in zip(of_supports, tools, strict=True))
        products = parallel.global_sum(
            comm, np.array([earlier_ways @ earlier_ways, present @ earlier_ways, present @ present])
        )
        if not products[0] > 0.0 or not products[1] >= SAME_WAY * np.sqrt(products[0] * products[2]):
            return 0.0
        return float(products[1] / products[0])

    def sets_after(
        self,
        share: float,
        begun: Start,
        boundary: ContactBoundary,
        traces: Callable[[Array], tuple[Nodal, Nodal]],
        far: npt.NDArray[np.bool_] | None,
    ) -> ActiveSets:
        """The sets with which a load step begins; collective.

        Contact that is closed opens where its pressure would be gone by the end of the step, and contact that is open
        closes where the body would be inside.  What sticks slips where its shear would be above its bound.

        Args:
            share: by how much of this change all is changed once more.
            begun: where it begins.
            boundary: the contact points.
            traces: relative displacements of a change of the displacement beyond its values of now.
            far: points that are taken to be far from contact, shape (n,); None: none is.
        """
        sets, data, law = begun.sets, begun.data, begun.law
        assert sets is not None
        assert begun.multipliers is not None
        pressure, shear = begun.multipliers
        ahead = pressure + share * self.pressure
        u_n, u_t = traces(share * self.displacement)
        contact = np.where(sets.contact, ahead > 0.0, u_n > data.distance)
        if far is not None:
            contact &= ~far
        contact = keep_closed(contact, data)
        if law is None or data.bound is None:
            return ActiveSets.of(contact, np.zeros_like(shear))
        sheared = shear + share * np.einsum("nij,ni->nj", boundary.cotangents, self.shear)
        beyond = np.where((length(sheared) > law.bound(np.maximum(ahead, 0.0)))[:, None], unit(sheared), 0.0)
        direction = np.where(sets.slip[:, None], sets.direction, beyond)
        closes = (contact & ~sets.contact)[:, None]
        return ActiveSets.of(contact, np.where(closes, unit(slip_of(u_t, data)), direction), sets.turning)
