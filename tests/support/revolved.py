"""Bodies of revolution in contact, and an independent program for them: NumPy elements, nodes against nodes.

Both sides of a contact have their nodes at the same places, so that dual functions tie each node to its partner.  The
program has its own cells, loads and nodal areas, eliminates all displacements, and leaves the forces between the nodes
to SciPy: a linear least-squares problem with bounds, which bounds of Coulomb friction repeat until they are settled.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from types import MappingProxyType
from typing import NamedTuple

import basix
import numpy as np
from dolfinx import mesh as dmesh
from mpi4py import MPI
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import lsq_linear
from two_bodies import assembled, grid

from signorini_fx.machine import compat
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.scenes.reading import parse_scene

# Springs of a body that nothing holds along the axis, beside its other stiffness.
_SPRING = 1e-9
# Largest component of a normal across a plane of symmetry, beyond which there is an edge.
_SMOOTH = 0.2
# Sides of a box by the direction across and the end.
SIDES = {"left": (0, 0), "right": (0, 1), "bottom": (1, 0), "top": (1, 1)}


class Box(NamedTuple):
    """A rectangle of radii and heights before it is placed, and its material."""

    name: str
    counts: tuple[int, int]
    low: tuple[float, float]
    high: tuple[float, float]
    young: float = 200.0
    poisson: float = 0.3


class Touching(NamedTuple):
    """Contact of two sides, "body.side" each: a gap along the normal, and friction as a scene has it."""

    slave: str
    master: str
    gap: object = 0.0
    friction: dict = MappingProxyType({})
    kind: str = "unilateral"


@dataclass(frozen=True)
class Bodies:
    """Boxes with what holds, loads and joins them.

    Attributes:
        kind: of the cells.
        boxes: the bodies.
        place: from points of shape (n, 2) before to those after they are placed; None: as they are.
        held: of sides their prescribed components: ("body.side", {"x" or "y": value}).
        pressed: sides with a pressure.
        touching: contacts.
        pull: force per volume along the axis.
    """

    kind: str
    boxes: list[Box]
    place: object = None
    held: list[tuple[str, dict]] = field(default_factory=list)
    pressed: list[tuple[str, float]] = field(default_factory=list)
    touching: list[Touching] = field(default_factory=list)
    pull: float = 0.0

    @property
    def pieces(self):
        """Cells and points of each."""
        return [grid(self.kind, box.counts, box.low, box.high, self.place) for box in self.boxes]

    @property
    def origin(self):
        """The points before they are placed, of all bodies."""
        return np.concatenate([grid(self.kind, box.counts, box.low, box.high)[1] for box in self.boxes])

    def nodes(self, name):
        """The nodes of a side, in order along it."""
        body, side = name.split(".")
        axis, end = SIDES[side]
        start = 0
        for box, (_, x) in zip(self.boxes, self.pieces, strict=True):
            if box.name == body:
                origin = self.origin[start : start + len(x)]
                limit = (box.low, box.high)[end][axis]
                on = np.flatnonzero(np.isclose(origin[:, axis], limit))
                return start + on[np.argsort(origin[on, 1 - axis])]
            start += len(x)
        raise KeyError(name)

    def mesh(self, comm=MPI.COMM_SELF):
        """All bodies as one mesh, with the names of bodies and sides."""
        mesh = assembled(self.kind, *self.pieces, comm=comm)
        mesh.topology.create_connectivity(1, 2)
        facets = dmesh.exterior_facet_indices(mesh.topology)
        at = mesh.geometry.input_global_indices[dmesh.entities_to_geometry(mesh, 1, facets)]
        tags, names = np.zeros(len(facets), dtype=np.int32), {}
        for number, name in enumerate(f"{box.name}.{side}" for box in self.boxes for side in SIDES):
            tags[np.isin(at, self.nodes(name)).all(axis=1)] = names[name] = number + 1
        cells = mesh.topology.index_map(2).size_local + mesh.topology.index_map(2).num_ghosts
        counts = np.cumsum([len(part) for part, _ in self.pieces])
        of_cell = np.searchsorted(counts, mesh.topology.original_cell_index[:cells], side="right").astype(np.int32) + 1
        return TaggedMesh(
            mesh,
            dmesh.meshtags(mesh, 1, facets[tags > 0], tags[tags > 0]),
            names,
            dmesh.meshtags(mesh, 2, np.arange(cells, dtype=np.int32), of_cell),
            {box.name: number + 1 for number, box in enumerate(self.boxes)},
        )

    def scene(self, comm=MPI.COMM_SELF, material=None, **more):
        """The same for the package; ``more``: further entries."""
        contacts = [
            {"boundary": pair.slave, "against": pair.master, "points": "boundary", "kind": pair.kind}
            | ({} if pair.kind == "bonded" else {"distance": "nominal", "gap": pair.gap})
            | ({"friction": dict(pair.friction)} if pair.friction else {})
            for pair in self.touching
        ]
        common = {"hypothesis": "axisymmetric", **(material or {})}
        given = {
            "mesh": self.mesh(comm),
            "material": [{"region": b.name, "young": b.young, "poisson": b.poisson, **common} for b in self.boxes],
            "displacement": [{"boundary": name, **values} for name, values in self.held],
            "traction": [{"boundary": name, "pressure": value} for name, value in self.pressed],
            "body_force": {"y": self.pull} if self.pull else None,
            "contact": contacts,
        }
        return parse_scene({key: value for key, value in given.items() if value} | more)


def _points(kind, degree):
    """Weights, shape functions and their slopes at the points of a rule on the reference cell."""
    cell = getattr(basix.CellType, kind)
    places, weights = basix.make_quadrature(cell, degree)
    s, t = places.T
    if kind == "triangle":
        values = np.stack((1 - s - t, s, t))
        slopes = np.broadcast_to(np.array([[-1.0, -1], [1, 0], [0, 1]])[:, :, None], (3, 2, len(s)))
    else:  # x first
        values = np.stack(((1 - s) * (1 - t), s * (1 - t), (1 - s) * t, s * t))
        slopes = np.stack(((-(1 - t), -(1 - s)), (1 - t, -s), (-t, 1 - s), (t, s)))
    return weights, values.T, np.moveaxis(slopes, 2, 0)


def _system(bodies, degree):
    """Stiffness and loads, dense, with the unknowns (r, z) of each node in turn; ``degree``: of the quadrature."""
    x = np.concatenate([points for _, points in bodies.pieces])
    stiffness, load, start = np.zeros((2 * len(x),) * 2), np.zeros((len(x), 2)), 0
    weights, values, slopes = _points(bodies.kind, degree)
    for box, (cells, points) in zip(bodies.boxes, bodies.pieces, strict=True):
        shear = box.young / (2 * (1 + box.poisson))
        lame = 2 * shear * box.poisson / (1 - 2 * box.poisson)
        law = np.diag([2 * shear] * 3 + [shear])
        law[:3, :3] += lame
        for cell in cells:
            at = (2 * (start + cell)[:, None] + np.arange(2)).ravel()
            for weight, value, slope in zip(weights, values, slopes, strict=True):
                jacobian = points[cell].T @ slope
                gradient = slope @ np.linalg.inv(jacobian)
                radius = value @ points[cell, 0]
                area = 2 * np.pi * radius * weight * abs(np.linalg.det(jacobian))
                strain = np.zeros((4, 2 * len(cell)))  # along r, z, around, and the shear
                strain[0, ::2], strain[1, 1::2], strain[2, ::2] = gradient[:, 0], gradient[:, 1], value / radius
                strain[3, ::2], strain[3, 1::2] = gradient[:, 1], gradient[:, 0]
                stiffness[np.ix_(at, at)] += area * strain.T @ law @ strain
                load[start + cell, 1] += area * value * bodies.pull
        start += len(points)
    for name, pressure in bodies.pressed:
        nodes = bodies.nodes(name)
        area, normal = _areas(x, nodes, bodies, name, moments=True)
        load[nodes] -= pressure * area[:, None] * normal
    return x, stiffness, load.ravel()


def _areas(x, nodes, bodies, name, *, moments=False, still=None):
    """Integrals of hat functions times 2 pi r along a side at each node, and outward normals there, of length one.

    Args:
        x: of all nodes.
        nodes: along the side.
        bodies: which.
        name: of the side.
        moments: whether the normals are those integrals of hat function and normal, over the former; else means of
            the normals of both facets by their lengths.
        still: whether nodes cannot move; areas of facets between two such nodes do not count; None: all count.
    """
    axis, end = SIDES[name.split(".")[1]]
    area, normal = np.zeros(len(nodes)), np.zeros((len(nodes), 2))
    weighted = np.zeros_like(normal)
    for k in range(len(nodes) - 1):
        first, last = x[nodes[k]], x[nodes[k + 1]]
        along = last - first
        # Along the other axis: to the right of that way, or to the left.
        outward = np.array([along[1], -along[0]]) * (1 if (axis == 0) == (end == 1) else -1)
        (r, s), length = (first[0], last[0]), np.linalg.norm(along)
        parts = 2 * np.pi * length * np.array([2 * r + s, r + 2 * s]) / 6
        counts = still is None or not still[k : k + 2].all()
        for node, part in ((k, parts[0]), (k + 1, parts[1])):
            area[node] += part * counts
            weighted[node] += part * outward / length
            normal[node] += outward
    if moments:
        return area, weighted / area[:, None]
    return area, normal / np.linalg.norm(normal, axis=1, keepdims=True)


class Reference(NamedTuple):
    """Displacements of all nodes, shape (n, 2); of each contact its nodes, their areas, and pressures."""

    displacement: np.ndarray
    contacts: list[tuple[np.ndarray, np.ndarray, np.ndarray]]


def reference(bodies, degree, *, tolerance=1e-12):
    """The solution by the program of its own; ``degree``: of the quadrature in cells.

    Raises:
        RuntimeError: bounds of Coulomb friction do not settle.
    """
    x, stiffness, load = _system(bodies, degree)
    prescribed = {2 * int(node) + 0: 0.0 for node in np.flatnonzero(np.abs(x[:, 0]) < 1e-12)}
    for name, values in bodies.held:
        for component, value in values.items():
            prescribed |= {2 * int(node) + "xy".index(component): value for node in bodies.nodes(name)}
    held = np.array(sorted(prescribed), dtype=int)
    values = np.array([prescribed[k] for k in held])
    free = np.setdiff1d(np.arange(load.size), held)
    starts = np.cumsum([0, *(len(points) for _, points in bodies.pieces)])
    for first, last in pairwise(starts):
        axial = 2 * np.arange(first, last) + 1
        if not np.isin(axial, held).any():
            stiffness[axial, axial] += _SPRING * stiffness[axial, axial].max()
    rows, gaps, areas, kinds, shown = [], [], [], [], []
    for pair in bodies.touching:
        nodes, partners = bodies.nodes(pair.slave), bodies.nodes(pair.master)
        assert np.allclose(x[nodes], x[partners])
        area, normal = _areas(x, nodes, bodies, pair.slave)
        for slave, master, direction in zip(nodes, partners, normal, strict=True):
            for component in range(2):  # a plane of symmetry, or the axis
                at_rest = all(prescribed.get(2 * int(node) + component) == 0.0 for node in (slave, master))
                on_axis = component == 0 and abs(x[slave, 0]) < 1e-12  # all around, the mean is along it
                if at_rest and (on_axis or abs(direction[component]) <= _SMOOTH):
                    direction[component] = 0.0
            direction /= np.linalg.norm(direction)
        # Where neither side can move along the normal a node has no point: the one beside it takes its area over, and
        # between two such nodes there is no contact.
        able = [
            any(2 * int(node) + k not in prescribed and abs(n[k]) > 0.01 for k in (0, 1) for node in both)
            for both, n in zip(zip(nodes, partners, strict=True), normal, strict=True)
        ]
        if pair.kind != "bonded":
            area, _ = _areas(x, nodes, bodies, pair.slave, still=~np.array(able))
        taken = np.eye(len(nodes))[able]
        for lost in np.flatnonzero(~np.array(able)):
            beside = [k for k in (lost - 1, lost + 1) if 0 <= k < len(nodes) and able[k]]
            taken[np.searchsorted(np.flatnonzero(able), beside), lost] = 1.0 / len(beside)
        gap = 0.0 * area if pair.kind == "bonded" else _sampled(pair.gap, x[nodes])
        apart = np.zeros((len(nodes), 2, load.size))
        for k, (slave, master) in enumerate(zip(nodes, partners, strict=True)):
            for component in (0, 1):
                apart[k, component, 2 * slave + component] += 1.0
                apart[k, component, 2 * master + component] -= 1.0
        means = np.einsum("kl,l,lij->kij", taken, area, apart) / (taken @ area)[:, None, None]
        for direction in (normal, np.stack((-normal[:, 1], normal[:, 0]), axis=1)):
            rows.append(np.einsum("ki,kij->kj", direction[able], means))
        gaps.append(gap[able])
        areas.append(taken @ area)
        shown.append(nodes[able])
        kinds.append(pair)
    constraint = np.concatenate(rows)
    target = np.concatenate([np.concatenate((gap, np.zeros(len(gap)))) for gap in gaps])
    acting = constraint[:, free]
    # What supports leave nothing of is no constraint, and has no force.
    alive = (np.abs(acting).max(axis=1) > 1e-12) & np.concatenate(
        [_acting(*entry) for entry in zip(kinds, areas, strict=True)]
    )
    factor = cholesky(stiffness[np.ix_(free, free)], lower=True)
    known = load[free] - stiffness[np.ix_(free, held)] @ values
    spread = solve_triangular(factor, acting.T, lower=True)
    wanted = target - constraint[:, held] @ values  # acting u <= wanted, with forces -acting^T f
    forces, limit = np.zeros(target.size), _limits(kinds, areas, None)
    # The dual problem: half of f . S f - f . (spread^T base - wanted) is the least, within the limits.
    schur = spread[:, alive].T @ spread[:, alive]
    scale = np.sqrt(np.diag(schur))
    root = cholesky(schur / np.outer(scale, scale) + 1e-15 * np.eye(scale.size), lower=True)
    coulomb = any(pair.friction.get("law") == "coulomb" for pair in kinds)
    u = np.zeros(load.size)
    u[held] = values
    base = solve_triangular(factor, known, lower=True)
    goal = solve_triangular(root, (spread[:, alive].T @ base - wanted[alive]) / scale, lower=True)
    for _ in range(500):
        low, high = (bound[alive] * scale for bound in limit)
        found = _least(root.T, goal, low, high) / scale
        change, forces[alive] = np.abs(forces[alive] - found).max(), found
        if not coulomb or change <= tolerance * np.abs(forces).max():
            break
        limit = _limits(kinds, areas, forces)
    else:
        raise RuntimeError("bounds of friction do not settle")
    u[free] = solve_triangular(factor.T, base - spread @ forces, lower=False)
    # Where supports hold a component of both sides, forces along the normal and the tangent may be for each other.
    clear = np.array(
        [np.linalg.matrix_rank(rows, tol=1e-9) == np.any(rows, axis=1).sum() for rows in _by_points(acting, areas)]
    )
    contacts, start, first = [], 0, 0
    for nodes, area in zip(shown, areas, strict=True):
        count = len(area)
        told = clear[first : first + count]
        contacts.append((nodes[told], area[told], forces[start : start + count][told] / area[told]))
        start, first = start + 2 * count, first + count
    return Reference(u.reshape(-1, 2), contacts)


def _least(matrix, goal, low, high):
    """The least squares within bounds: those of SciPy, of which it may stop too early, and active sets from there.

    Raises:
        RuntimeError: the conditions of the minimum do not hold.
    """
    wider = np.where(low == high, high + 1e-13 * np.maximum(np.abs(high), 1e-6 * np.abs(goal).max()), high)
    x = np.clip(lsq_linear(matrix, goal, (low, wider), method="bvls", tol=1e-14).x, low, high)
    for _ in range(50):
        slope = matrix.T @ (matrix @ x - goal)
        below, above = x - slope < low, x - slope > high
        inside = ~below & ~above
        fixed = np.where(below, low, np.where(above, high, 0.0))
        last, x = x, fixed
        x[inside] = np.linalg.lstsq(matrix[:, inside], goal - matrix @ fixed, rcond=None)[0]
        if np.abs(x - last).max() <= 1e-12 * np.abs(x).max():
            return x
    raise RuntimeError("active sets do not settle")


def _by_points(rows, areas):
    """The row of the normal and that of the tangent of each point, shape (points, 2, unknowns)."""
    parts = np.split(rows, np.cumsum([2 * len(area) for area in areas])[:-1])
    return np.concatenate([part.reshape(2, -1, rows.shape[1]).swapaxes(0, 1) for part in parts])


def _sampled(gap, x):
    return np.full(len(x), eval(gap, {"x": x.T}) if isinstance(gap, str) else gap)


def _acting(pair, area):
    """Which constraints of a contact have forces: all along the normal, and along the tangent with friction."""
    rubs = bool(pair.friction) or pair.kind == "bonded"
    return np.repeat([True, rubs], len(area))


def _limits(kinds, areas, forces):
    """The smallest and the largest force of each constraint; ``forces``: the last ones, None: none yet."""
    low, high, start = [], [], 0
    for pair, area in zip(kinds, areas, strict=True):
        law, count = pair.friction.get("law"), len(area)
        normal = np.zeros(count) if forces is None else np.abs(forces[start : start + count])
        bound = np.zeros(count)
        if law == "coulomb":
            bound = pair.friction["coefficient"] * normal
        elif law == "tresca":
            bound = pair.friction["bound"] * area
        if pair.kind == "bonded":
            bound = np.full(count, np.inf)
        closed = pair.kind in ("bonded", "bilateral")
        low += [np.full(count, -np.inf if closed else 0.0), -bound]
        high += [np.full(count, np.inf), bound]
        start += 2 * count
    return np.concatenate(low), np.concatenate(high)


def difference(bodies, solution):
    """The largest differences of displacements and pressures from those of ``reference``, relative to the largest."""
    from signorini_fx.mechanics.assembly.quadrature import strain_degree
    from signorini_fx.mechanics.kinematics import AXISYMMETRIC

    space = solution.displacement.function_space
    known = reference(bodies, strain_degree(space, AXISYMMETRIC))
    mesh = space.mesh
    of_dof = np.zeros(len(mesh.geometry.x), dtype=np.int64)
    of_dof[space.dofmap.list.ravel()] = compat.geometry_cells(mesh).ravel()
    number = mesh.geometry.input_global_indices[of_dof]
    moved = solution.displacement.x.array.reshape(-1, 2)
    size = np.abs(known.displacement).max()
    apart = np.abs(moved - known.displacement[number]).max() / size
    largest = max(np.abs(pressure).max() for _, _, pressure in known.contacts)
    worst, boundary = 0.0, solution.contact.boundary
    for part, (nodes, area, pressure) in enumerate(known.contacts):
        on = np.flatnonzero(boundary.part == part)
        place = {int(number[node]): k for k, node in zip(on, boundary.nodes[on], strict=True)}
        for node, size, value in zip(nodes, area, pressure, strict=True):
            if int(node) in place:
                k = place[int(node)]
                assert np.isclose(boundary.weight[k], size, rtol=1e-12)
                worst = max(worst, abs(solution.contact.pressure[k] - value) / max(largest, 1e-300))
    return apart, worst
