"""Each contact boundary in figures: pressure and area, how far it is from sliding, and the body from overturning."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
import numpy.typing as npt
from scipy.spatial import ConvexHull

from signorini_fx import parallel
from signorini_fx.contact.state import ContactState
from signorini_fx.scene.model import BilateralContact, Scene

Array = npt.NDArray[np.float64]

# Below this share of the forces, or of the size of the base, a resultant or an eccentricity is round-off.
_ROUND_OFF = 1e-9
# Normals of one flat base, or of several parallel ones, differ by less than this.
_PARALLEL = 1e-6


@dataclass(frozen=True)
class ContactFigures:
    """One contact boundary, in the plane per unit thickness, with lengths for areas.

    Attributes:
        boundary: its name.
        area: of the whole boundary.
        contact_area: of the nodes in contact.
        pressure_integral: integral of the pressure, a force.
        mean_pressure: that over the area in contact, stress; None where nothing is in contact.
        max_pressure: largest nodal pressure, stress.
        tangential_force: magnitude of the resultant of the shear.
        friction_limit: integral of the friction bound, a force: F N for Coulomb friction with one coefficient, the
            bound times the area for Tresca friction, which acts on open nodes too.
        sliding_safety: friction_limit over tangential_force; 1 where all of it slides one way.  None without friction
            and where nothing acts tangentially.
    """

    boundary: str
    area: float
    contact_area: float
    pressure_integral: float
    mean_pressure: float | None
    max_pressure: float
    tangential_force: float
    friction_limit: float
    sliding_safety: float | None

    def as_dict(self) -> dict[str, object]:
        """All figures."""
        return asdict(self)


@dataclass(frozen=True)
class Overturning:
    """Where the contact force acts within the base of a body that stands on it, free to tip.

    Attributes:
        acts_at: where the resultant of the pressure acts, length, shape (d,).
        eccentricity: its distance from the centroid of the base, length.
        safety: by how much the eccentricity must be multiplied for the resultant to reach the edge of the base, where
            the body tips: 1 at the limit.  For a load that has its resultant over the centroid and a push across it
            this is the resisting over the overturning moment.  None where the resultant is at the centroid.
    """

    acts_at: tuple[float, ...]
    eccentricity: float
    safety: float | None

    def as_dict(self) -> dict[str, object]:
        """All figures, JSON-safe."""
        return {**asdict(self), "acts_at": list(self.acts_at)}


def contact_figures(scene: Scene, contact: ContactState) -> list[ContactFigures]:
    """The figures of each contact boundary, in the order of the scene; collective."""
    boundary, comm = contact.boundary, contact.boundary.comm
    shear = -boundary.nodal_forces(np.zeros_like(contact.pressure), contact.shear)
    found = []
    for part, effect in enumerate(scene.contact):
        here = boundary.part == part
        weight, pressure = boundary.weight[here], contact.pressure[here]
        sums = np.array(
            [weight.sum(), weight @ contact.in_contact[here], weight @ pressure, weight @ contact.bound[here]]
        )
        total = parallel.global_sum(comm, np.concatenate((sums, shear[here].sum(axis=0))))
        area, touching, normal, limit = map(float, total[:4])
        tangential = float(np.linalg.norm(total[4:]))
        if tangential <= _ROUND_OFF * max(abs(normal), limit):
            tangential = 0.0
        found.append(
            ContactFigures(
                boundary=effect.boundary,
                area=area,
                contact_area=touching,
                pressure_integral=normal,
                mean_pressure=normal / touching if touching > 0 else None,
                max_pressure=parallel.global_max(comm, parallel.local_max(pressure, -np.inf)),
                tangential_force=tangential,
                friction_limit=limit,
                sliding_safety=limit / tangential if tangential > 0 and limit > 0 else None,
            )
        )
    return found


def overturning(scene: Scene, contact: ContactState) -> Overturning | None:
    """Where the resultant of the pressure is within the base, the convex hull of all contact boundaries; collective.

    Returns:
        None where this is no question of statics: if a support holds the body, if the contact cannot open or its
        normals are not parallel, or if nothing is in contact.
    """
    if scene.displacement or any(isinstance(effect, BilateralContact) for effect in scene.contact):
        return None
    boundary, comm = contact.boundary, contact.boundary.comm
    dim = boundary.x.shape[1]
    force = boundary.weight * contact.pressure
    sums = np.concatenate((boundary.weight @ boundary.normal, force @ boundary.centre))
    total = parallel.global_sum(comm, np.append(sums, [boundary.weight.sum(), force.sum()]))
    normal, area, pressed = total[:dim] / np.linalg.norm(total[:dim]), total[-2], float(total[-1])
    apart = parallel.global_max(comm, parallel.local_max(np.linalg.norm(boundary.normal - normal, axis=1)))
    if not (pressed > 0 and np.isfinite(pressed) and area > 0 and apart <= _PARALLEL):
        return None
    acts_at = total[dim:-2] / pressed
    across = np.linalg.svd(normal[None])[2][1:]  # rows that span the plane of the base
    points = parallel.gather_rows(comm, boundary.x) @ across.T
    centroid, sides = _base(points)
    offset = across @ acts_at - centroid
    eccentricity = float(np.linalg.norm(offset))
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    if eccentricity <= _ROUND_OFF * size:
        return Overturning(tuple(map(float, acts_at)), 0.0, None)
    reach = -(sides[:, :-1] @ centroid + sides[:, -1])
    safety = 1 / float(np.max(sides[:, :-1] @ offset / reach))
    return Overturning(tuple(map(float, acts_at)), eccentricity, safety)


def _base(points: Array) -> tuple[Array, Array]:
    """Centroid of the convex hull of points, shape (k,), and its sides: normal and offset, shape (sides, k + 1)."""
    if points.shape[1] == 1:
        low, high = float(points.min()), float(points.max())
        return np.array([(low + high) / 2]), np.array([[-1.0, low], [1.0, -high]])
    hull = ConvexHull(points)
    corners = points[hull.vertices]  # counterclockwise
    following = np.roll(corners, -1, axis=0)
    twice = corners[:, 0] * following[:, 1] - corners[:, 1] * following[:, 0]
    return (corners + following).T @ twice / (3 * twice.sum()), hull.equations
