"""The contact data of a scene on the nodes of its contact boundary: gap, friction, regularisation, first sets."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from signorini_fx import parallel
from signorini_fx.body.contact_boundary import ContactBoundary
from signorini_fx.body.discretisation import Discretisation
from signorini_fx.contact.laws import ActiveSets, FrictionLaw, Nodal, RegularisedData
from signorini_fx.effects.contact import BilateralContact, CoulombFriction, TrescaFriction
from signorini_fx.errors import SceneError
from signorini_fx.method import Settings
from signorini_fx.scene.expressions import in_space, sample
from signorini_fx.scene.magnitudes import LARGEST
from signorini_fx.scene.model import Scene
from signorini_fx.scene.settings import Box


def friction_law(scene: Scene, boundary: ContactBoundary) -> FrictionLaw | None:
    """Nodal data of the friction laws; None where no law can act."""
    if not scene.has_friction:
        return None
    given, coefficient, cap = np.zeros(boundary.size), np.zeros(boundary.size), np.full(boundary.size, np.inf)
    for index, effect in enumerate(scene.contact):
        here = boundary.part == index
        path = f"contact[{index}].friction"
        match effect.friction:
            case TrescaFriction(bound=value) if effect.friction.acts:
                given[here] = _nodal(value, boundary, here, f"{path}.bound", minimum=0.0)
            case CoulombFriction(coefficient=value, cap=limit) if effect.friction.acts:
                coefficient[here] = _nodal(value, boundary, here, f"{path}.coefficient", minimum=0.0)
                if limit is not None:
                    cap[here] = _nodal(limit, boundary, here, f"{path}.cap", minimum=0.0)
    capped = any(effect.capped for effect in scene.contact)
    return FrictionLaw(given, coefficient, cap if capped else None)


def regularised_data(
    scene: Scene, body: Discretisation, boundary: ContactBoundary, law: FrictionLaw | None
) -> RegularisedData:
    """The regularised problem of the scene, without shifts and with the given part of the friction bound."""
    gap = np.zeros(boundary.size)
    for index, effect in enumerate(scene.contact):
        here = boundary.part == index
        gap[here] = _gap(effect.gap, boundary, here, f"contact[{index}].gap")
    settings, bilateral = Settings.of(scene.solver), bilateral_nodes(scene, boundary)
    return RegularisedData.unshifted(gap, boundary.tangents.shape[2], settings, body.scales.gamma, law, bilateral)


def bilateral_nodes(scene: Scene, boundary: ContactBoundary) -> npt.NDArray[np.bool_] | None:
    """The nodes whose contact cannot open; None if the scene has none."""
    parts = [index for index, effect in enumerate(scene.contact) if isinstance(effect, BilateralContact)]
    return np.isin(boundary.part, parts) if parts else None


def _gap(value: Any, boundary: ContactBoundary, here: npt.NDArray[np.bool_], path: str) -> Nodal:
    """The gap at the points ``here``, averaged where the displacement is that it is compared with."""
    if boundary.averages is None:
        return _nodal(value, boundary, here, path, minimum=-np.inf)
    shares = boundary.averages.shares[here]
    found = np.zeros(shares.shape[1])
    own = np.unique(shares.indices)
    found[own] = _checked(value, boundary.averages.x[own], boundary, path, minimum=-np.inf)
    return np.asarray(shares @ found)


def _nodal(value: Any, boundary: ContactBoundary, here: npt.NDArray[np.bool_], path: str, *, minimum: float) -> Nodal:
    """Values at the nodes ``here``, checked on all ranks together."""
    return _checked(value, boundary.x[here], boundary, path, minimum=minimum)


def _checked(value: Any, x: Nodal, boundary: ContactBoundary, path: str, *, minimum: float) -> Nodal:
    """Values at points, checked on all ranks together."""
    values = sample(value, in_space(x))
    bad = np.flatnonzero(~(np.abs(values) <= LARGEST) | (values < minimum))
    error = None
    if bad.size:
        place = ", ".join(f"{c:g}" for c in x[bad[0]])
        wanted = f"a number of at most {LARGEST:g}" + ("" if minimum == -np.inf else ", and not negative")
        error = SceneError([(path, f"is {values[bad[0]]:g} at ({place}); it must be {wanted}")])
    parallel.raise_together(boundary.comm, error)
    return values


def first_sets(scene: Scene, boundary: ContactBoundary) -> tuple[ActiveSets, int]:
    """The sets of the first linear solve and its number (section 7: 0 if a solve only computes the start)."""
    region = scene.solver.initial_contact
    every = ActiveSets.all_in_contact(*boundary.tangents.shape[::2])
    if isinstance(region, str):
        return every, 0
    if isinstance(region, Box):
        near = 1e-9 * np.ptp(parallel.gather_rows(boundary.comm, boundary.x), axis=0).max()
        inside: npt.NDArray[np.bool_] = np.ones(boundary.size, dtype=bool)
        for axis, (low, high) in enumerate((region.x, region.y, region.z)[: boundary.x.shape[1]]):
            inside &= (boundary.x[:, axis] >= low - near) & (boundary.x[:, axis] <= high + near)
    else:
        inside = sample(region, in_space(boundary.x)) > 0
    if parallel.global_sum(boundary.comm, np.array(np.count_nonzero(inside))) == 0:
        raise SceneError([("solver.initial_contact", "holds no contact node")])
    return ActiveSets.of(inside, every.direction), 1
