"""The safety factor of a result: by how much the live loads can grow before statics lets the body move away."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from signorini_fx import parallel
from signorini_fx.body.discretisation import Discretisation
from signorini_fx.body.motion_names import names_of
from signorini_fx.body.rigid import total_work
from signorini_fx.contact.data import friction_law
from signorini_fx.contact.laws import FrictionLaw
from signorini_fx.contact.reactions import reactions
from signorini_fx.contact.resting_place import resting_place
from signorini_fx.contact.state import ContactState
from signorini_fx.contact.statics import Limit, along_contact, largest_multiple
from signorini_fx.results.nodal_forces import NodalForces
from signorini_fx.scene.model import BodyForce, Scene, SurfaceTraction

_Load = TypeVar("_Load", BodyForce, SurfaceTraction)
# A node whose gap is below this share of the size of the body is closed.
_CLOSED = 1e-9


@dataclass(frozen=True)
class Safety:
    """Multiples of the live loads, beyond which a body that supports do not hold moves away; inf: no limit.

    The foundation can press at the nodes that touch it in this solution, or where the rigid body rests: no other node
    is counted on, since the body would have to move there first.

    Attributes:
        factor: the smaller one of the two that follow.
        statics: no larger multiple is balanced by any pressures and shears that the law allows for.
        present: the largest one with the friction bounds of this solution, whatever the pressures.
        exact: whether this is the limit of the problem with these nodes: without Coulomb friction, because the other
            laws are associated.  With Coulomb friction ``statics`` is an upper bound of what the body holds, and
            ``present`` a figure for the pressures as they are, which another load changes.
        motion: the motion beyond ``factor``, in words; "" where there is no limit.
    """

    factor: float
    statics: float
    present: float
    exact: bool
    motion: str

    def as_dict(self) -> dict[str, object]:
        """All figures, JSON-safe: null where there is no limit."""
        return {name: None if value == np.inf else value for name, value in asdict(self).items()}


def safety_of(d: Discretisation, contact: ContactState, place: float) -> Safety | None:
    """The safety factor of a load step; collective.

    Args:
        d: the discretised scene.
        contact: the contact nodes of this rank in its solution.
        place: of the load step in the lists of factors.

    Returns:
        None if supports hold the body, if no live load acts on its free motions, or if the tractions of the solution
        do not balance its loads at these nodes.
    """
    motions, boundary, count = d.motions, contact.boundary, d.motions.free.shape[1]
    if not count:
        return None
    live, dead = (total_work([(1.0, motions.load_of(forces, d.comm))], count) for forces in _loads(d, place))
    law = friction_law(d.scene, boundary)
    pressing = _touching(d, contact, live + dead) & ~boundary.immovable
    if not parallel.any_rank(d.comm, bool(np.isfinite(contact.pressure).all())) or not live.any():
        return None
    zero = np.zeros(boundary.size)
    laws = [law]
    if law is not None:
        # Where a support takes the pressure, no other load changes the friction bound.
        laws = [replace(law, given=np.where(boundary.immovable, contact.bound, law.given))]
        if d.scene.has_coulomb:
            laws.append(FrictionLaw(contact.bound, zero))
    every = [reactions(boundary, motions, each, contact.bilateral, pressing) for each in laws]
    worst: Safety | None = None
    for number, columns, _ in motions.assemblies():
        if not live[columns].any():
            continue
        limits: list[Limit] = []
        for here in (one.of(number, columns) for one in every):
            limit = largest_multiple(here, dead[columns], live[columns])
            if limit is None:
                return None
            limits.append(limit)
        least = min(range(len(limits)), key=lambda k: limits[k].found)
        motion = limits[least].motion
        words = ""
        if motion is not None:
            along = along_contact(every[least].of(number, columns), motion, limits[least].pressed)
            members = np.flatnonzero(motions.pieces.assembly == number)
            words = names_of((motions.free[:, columns] @ along)[:, None], motions, members)
        found = Safety(limits[least].found, limits[0].factor, limits[-1].found, not d.scene.has_coulomb, words)
        worst = found if worst is None or found.factor < worst.factor else worst
    return worst


def _loads(d: Discretisation, place: float) -> list[npt.NDArray[np.float64]]:
    """The live and the other loads of a load step at the owned dofs, shape (owned dofs,) each."""
    scene = d.scene
    found: list[npt.NDArray[np.float64]] = []
    for live in (True, False):
        traction = tuple(_alone(scene, load) for load in scene.traction if load.live is live)
        body = scene.body_force
        volume = None if body is None or body.live is not live else _alone(scene, body)
        if traction or volume is not None:
            some = scene.model_copy(update={"traction": traction, "body_force": volume})
            found.append(NodalForces(some, d.tagged, d.space).external(place).ravel())
        else:
            found.append(np.zeros(d.fixed.size))
    return found


def _alone(scene: Scene, load: _Load) -> _Load:
    """A load with the factors that it has beside all others."""
    return load.model_copy(update={"factors": scene.factors_of(load)})


def _touching(d: Discretisation, contact: ContactState, load: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
    """The nodes that touch their foundation in the solution, or where the rigid body rests on it, shape (n,).

    Supports that move may keep the body away from where it would rest: then only the former.
    """
    touching = contact.in_contact | contact.bilateral
    if parallel.any_rank(d.comm, any(applied.start.any() for applied in d.applied)):
        return touching
    rest = resting_place(contact.gap, contact.bilateral, contact.boundary, d.motions, load)
    gap = contact.gap if rest is None else contact.gap - rest.u_n
    return np.asarray(touching | (gap <= _CLOSED * d.tagged.size))
