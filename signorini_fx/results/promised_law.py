"""What a result claims: the contact law that it keeps to, its contact tractions, and what a load step builds on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import fem

from signorini_fx.contact.laws import Nodal
from signorini_fx.contact.state import ContactState


@dataclass(frozen=True)
class Law:
    """The contact law that a result is judged by.

    With finite gamma it is the regularised law: lambda = max(0, gamma_n (tau_N y - d)), and mu is the projection of
    mu_0 + gamma_t times the slip onto |mu| <= F g, with mu_0 the shear before.  With infinite gamma it is the law of
    contact and friction itself.

    Attributes:
        gamma_n: stress per length.
        gamma_t: stress per length.
    """

    gamma_n: float = np.inf
    gamma_t: float = np.inf

    @property
    def regularised(self) -> bool:
        """Whether it allows for penetration and elastic slip."""
        return bool(np.isfinite(self.gamma_n) or np.isfinite(self.gamma_t))

    def __str__(self) -> str:
        if not self.regularised:
            return "the unregularised law"
        return f"the regularised law, gamma_n = {self.gamma_n:.3g}, gamma_t = {self.gamma_t:.3g}"


UNREGULARISED = Law()


@dataclass(frozen=True)
class Tractions:
    """What the contact transmits at the contact nodes of this rank, n of them.

    Attributes:
        part: position of the effect in ``scene.contact``, shape (n,).
        nodes: local number of the node (block of the function space), shape (n,).
        pressure: lambda, stress, shape (n,).
        shear: mu as a vector of the plane or of space, stress, shape (n, d): no frame is shared with the solver.
    """

    part: npt.NDArray[Any]
    nodes: npt.NDArray[Any]
    pressure: Nodal
    shear: Nodal

    @classmethod
    def of(cls, state: ContactState) -> Tractions:
        """What a contact state says of them."""
        boundary = state.boundary
        shear = np.einsum("ijk,ik->ij", boundary.tangents, state.shear)
        return cls(boundary.part, boundary.nodes, state.pressure, shear)


@dataclass(frozen=True)
class Before:
    """The load step before, on which a step builds.

    Attributes:
        displacement: at its end.
        tractions: at its end.
        elastic_slip: what of its slip the regularised law allows to come back, length, as the shear; None: nothing.
    """

    displacement: fem.Function
    tractions: Tractions
    elastic_slip: Nodal | None = None

    @classmethod
    def of(cls, displacement: fem.Function, tractions: Tractions, law: Law, before: Before | None) -> Before:
        """The end of a load step that kept to ``law`` and built on ``before``."""
        if not np.isfinite(law.gamma_t):
            return cls(displacement, tractions)
        added = tractions.shear if before is None else tractions.shear - before.tractions.shear
        elastic: Nodal = np.asarray(added / law.gamma_t)
        if before is not None and before.elastic_slip is not None:
            elastic = before.elastic_slip + elastic
        return cls(displacement, tractions, elastic)
