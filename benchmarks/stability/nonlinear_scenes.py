"""Random scenes with nonlinear materials under rigid foundations, on one rank or several, judged by
another program.

    ./env python3 -m benchmarks.stability.nonlinear_scenes 300 [FIRST]
    ./env mpirun -n 2 python3 -m benchmarks.stability.nonlinear_scenes 100 [FIRST]

The judge is in NumPy and shares nothing with the package but the mesh and the displacements that it
looks at.  Its elastic bodies have energies of the three principal stretches, whose stresses are U
diag(dW/dl) V^T of the singular value decomposition of F and derivatives by a complex step, after
division of the stretches by those of a temperature; its metal is integrated along the load steps
that are there, by bisection of the yield condition.  Of each load step that is called converged it
looks at equilibrium, gaps, signs, friction and its direction, whether forces that are reported are
those that it finds, whether a tool that a force moves is in balance, and of elastic bodies without
friction whether the second derivative of the energy is positive.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

# Ranks that wait for each other leave a core to the others, of which there may be fewer: read as
# MPI begins.
os.environ.setdefault("OMPI_MCA_mpi_yield_when_idle", "1")

import basix
import numpy as np
import numpy.typing as npt
from mpi4py import MPI

from benchmarks.stability.oracle import elements
from signorini_fx import ConvergenceError, Solution, solve
from signorini_fx.errors import SignoriniError
from signorini_fx.scenes.reading import parse_scene

Array = npt.NDArray[np.float64]
# Degrees of the quadrature of the package: of energies, and of those of the volume where they are
# reduced.  They belong to the discrete problem, as what is integrated is no polynomial.
_DEGREES = {
    ("triangle", 1): (1, 1),
    ("triangle", 2): (2, 1),
    ("quadrilateral", 1): (2, 1),
    ("quadrilateral", 2): (4, 3),
    ("tetrahedron", 1): (1, 1),
    ("hexahedron", 1): (2, 1),
}
_DEGREES_OF_REVOLUTION = {
    ("triangle", 1): 2,
    ("triangle", 2): 4,
    ("quadrilateral", 1): 6,
    ("quadrilateral", 2): 8,
}
# Penetration and slip relative to the size: of augmentation, and of a regularised law, whose gamma
# is 1e5 moduli over the size, below pressures of ten moduli.  Forces are relative to the largest
# one.
_NEAR, _SMALL = {"alm": 1e-6, "auto": 1e-4}, 1e-6
_SIDES = 600  # unknowns up to which the second derivative is looked at
_EXPANSION = 2e-5  # per temperature


@dataclass(frozen=True)
class RandomScene:
    """A block under a rigid foundation."""

    kind: str  # *plane strain*, *axisymmetric* or *space*
    law: dict[str, Any]  # the material, as a scene has it
    cell: str  # of the mesh
    degree: int  # of the displacement
    sizes: Array  # of the block, length
    counts: tuple[int, ...]  # of cells
    # whether the bottom may slide, and the left side is on rollers; otherwise the bottom is held
    rollers: bool
    shape: str  # of the foundation, without its motion: *circle*, *sphere* or *plane*
    centre: Array  # of it; of a plane a point, length
    radius: float  # length
    normal: Array  # of a plane
    ways: Array  # where it has moved to at each load step, length, shape (steps, d)
    push: (
        Array | None
    )  # the force towards the body that moves it, at each load step; None: ``ways`` do
    times: tuple[float, ...]  # of the load steps
    friction: dict[str, Any]  # a law, as a scene has it
    pull: Array  # dead traction on the right side at the last step, stress, shape (d,)
    volumetric: str  # how the energy of the volume is integrated
    algorithm: str  # of the solver
    # free expansion at each load step at the origin, and its growth along each axis over the size
    # of the block, shape (steps, 1 + d); zeros: the temperature stays
    warmth: Array

    @classmethod
    def drawn(cls, seed: int) -> RandomScene:
        """That of a seed."""
        rng = np.random.default_rng([58, seed])
        kind = str(rng.choice(["plane strain", "axisymmetric", "space"], p=[0.6, 0.2, 0.2]))
        dim = 3 if kind == "space" else 2
        unit, stress = 10.0 ** rng.integers(-6, 4), 10.0 ** rng.choice([0, 3, 6, 11])
        law = _drawn_law(rng, kind, stress)
        small = law["law"] == "j2"
        cell = str(
            rng.choice(["tetrahedron", "hexahedron"] if dim == 3 else ["triangle", "quadrilateral"])
        )
        degree = int(rng.choice([1, 2])) if dim == 2 else 1
        sizes = unit * rng.uniform(0.6, 2.0, dim)
        counts = (
            (4, 3, 3)
            if dim == 3
            else tuple(int(n) for n in rng.integers([4, 3], [11, 7]) // degree + 1)
        )
        rollers = kind == "axisymmetric" or bool(rng.random() < 0.3)
        shape = str(rng.choice(["plane", "sphere" if dim == 3 else "circle"], p=[0.3, 0.7]))
        radius = float(rng.uniform(0.3, 2.0) * sizes[0])
        tilt = 0.0 if kind == "axisymmetric" or rollers else rng.uniform(-0.2, 0.2)
        normal = np.zeros(dim)
        normal[0], normal[-1] = np.sin(tilt), -np.cos(tilt)
        clear = float(rng.choice([0.0, 0.02])) * sizes[-1]
        centre = np.zeros(dim) if kind == "axisymmetric" else rng.uniform(0.2, 0.8, dim) * sizes
        centre[-1] = sizes[-1] + clear + (radius if shape != "plane" else 0.0)
        depth = sizes[-1] * (10 ** rng.uniform(-4, -2) if small else 10 ** rng.uniform(-3, -0.5))
        path = str(rng.choice(["at once", "in steps", "and back", "along"]))
        shares = {
            "at once": [1.0],
            "in steps": [0.3, 0.7, 1.0],
            "and back": [0.5, 1.0, 0.4],
            "along": [1.0] * 4,
        }[path]
        ways = np.zeros((len(shares), dim))
        ways[:, -1] = -clear - depth * np.array(shares)
        if path == "along" and kind != "axisymmetric":
            ways[:, :-1] = np.outer(np.arange(len(shares)), depth * rng.uniform(-1, 1, dim - 1))
        friction: dict[str, Any] = {"law": "none"}
        if (drawn := rng.random()) < 0.5:
            friction = {"law": "coulomb", "coefficient": float(rng.uniform(0.05, 1.2))}
        elif drawn < 0.6:
            friction = {"law": "tresca", "bound": float(stress * rng.uniform(0.001, 0.05))}
        push = None
        if rng.random() < 0.2 and path != "along":
            area = {"plane strain": 1.0, "space": sizes[0]}.get(kind, np.pi * sizes[0]) * sizes[0]
            push = stress * area * rng.uniform(0.2, 1.0) * depth / sizes[-1] * np.array(shares)
        pull = stress * rng.uniform(-1, 1, dim) * (1e-3 if small else 1e-2) * (rng.random() < 0.3)
        if kind == "axisymmetric" or rollers:
            pull[1:] = 0.0
        linear_simplex = degree == 1 and cell in ("triangle", "tetrahedron")
        reduced = (
            not linear_simplex and law["law"] != "saint-venant-kirchhoff" and rng.random() < 0.3
        )
        begin, algorithm = float(rng.choice([0.4, 1.0, 7.0])), str(rng.choice(["alm", "auto"]))
        warmth, heated = (
            np.zeros((len(shares), 1 + dim)),
            rng.random() < 0.35,
        )  # drawn last: others stay what they were
        if heated:
            paths = [shares, np.linspace(0, 1, len(shares) + 1)[1:], np.ones(len(shares))]
            warmth[:] = np.outer(
                paths[rng.integers(3)], rng.uniform(-0.1, 0.1, 1 + dim) * (0.02 if small else 1.0)
            )
        block, above = (
            (kind, law, cell, degree, sizes, counts, rollers),
            (shape, centre, radius, normal, ways, push),
        )
        times, volumetric = (
            tuple((begin + np.arange(len(shares))).tolist()),
            "reduced" if reduced else "full",
        )
        return cls(*block, *above, times, friction, pull, volumetric, algorithm, warmth)

    @property
    def axes(self) -> str:
        """Names of the components."""
        return "xyz"[: len(self.sizes)]

    def stated(self) -> dict[str, Any]:
        """The scene as TOML has it."""
        dim = len(self.sizes)
        names = ("length", "width", "height") if dim == 3 else ("length", "height")
        parameters: dict[str, Any] = dict(zip(names, self.sizes.tolist(), strict=True))
        parameters |= dict(zip(("nx", "ny", "nz"), self.counts, strict=False)) | {"cell": self.cell}
        foundation: dict[str, Any] = {"shape": self.shape}
        if self.shape == "plane":
            foundation |= {"point": self.centre.tolist(), "normal": self.normal.tolist()}
        else:
            foundation |= {"centre": self.centre.tolist(), "radius": self.radius}
        if self.push is None:
            foundation["shift"] = [self._of_time(self.ways[:, k]) for k in range(dim)]
        else:
            turns = ("rotation",) if dim == 2 else ("rotation_x", "rotation_y", "rotation_z")
            held = () if self.kind == "axisymmetric" else (*self.axes[:-1], *turns)
            force = [*(["0.0"] * (dim - 1)), self._of_time(-self.push)]
            foundation |= {
                "pivot": self.centre.tolist(),
                "force": [0.0, force[-1]] if not held else force,
            }
            foundation["prescribed"] = dict.fromkeys(held, 0.0)
        supports: list[dict[str, Any]] = [{"boundary": "bottom"} | dict.fromkeys(self.axes, 0.0)]
        if self.rollers:
            supports = [{"boundary": "bottom", self.axes[-1]: 0.0}, {"boundary": "left", "x": 0.0}]
            if dim == 3:
                supports.append({"boundary": "front", "y": 0.0})
        factors = np.linspace(0, 1, len(self.times) + 1)[1:].tolist()
        tractions = [
            {
                "boundary": "right",
                **dict(zip(self.axes, self.pull.tolist(), strict=True)),
                "factors": factors,
            }
        ]
        law = self.law if dim == 3 else self.law | {"hypothesis": self.kind}
        heat: dict[str, Any] = {}
        if self.warmth.any():
            law = law | {"expansion": _EXPANSION}
            terms = [f"({self._of_time(self.warmth[:, 0] / _EXPANSION)})"]
            for axis, size in enumerate(self.sizes.tolist()):
                terms.append(
                    f"({self._of_time(self.warmth[:, 1 + axis] / _EXPANSION / size)}) * x[{axis}]"
                )
            heat = {"temperature": {"change": " + ".join(terms)}}
        return heat | {
            "mesh": {"generator": "box" if dim == 3 else "rectangle", "parameters": parameters},
            "material": law,
            "element": {"degree": self.degree, "volumetric": self.volumetric},
            "displacement": supports,
            "traction": tractions if self.pull.any() else [],
            "contact": {"boundary": "top", "foundation": foundation, "friction": self.friction},
            "load_steps": {"times": list(self.times)},
            "solver": {"algorithm": self.algorithm},
        }

    def _of_time(self, values: Array) -> str:
        """Values at the times as an expression of t, linear between them and from zero at time
        0.
        """
        at, before, words = 0.0, 0.0, "0.0"
        for instant, value in zip(self.times, values.tolist(), strict=True):
            slope = (value - before) / (instant - at)
            words += f" + ({slope!r}) * min(max(t - {at!r}, 0.0), {instant - at!r})"
            at, before = instant, value
        return words

    def between(self, moment: float, values: Array) -> Array:
        """The same at a time."""
        at = np.array([0.0, *self.times])
        rows = np.vstack((np.zeros_like(values[:1]), values))
        return np.array([np.interp(moment, at, column) for column in rows.T])


def _drawn_law(rng: np.random.Generator, kind: str, stress: float) -> dict[str, Any]:
    """A material; the shear modulus is about half the stress."""
    names = ["neo-hooke", "isochoric", "saint-venant-kirchhoff", "mooney-rivlin", "ogden", "j2"]
    name = str(rng.choice(names if kind != "space" else [one for one in names if one != "ogden"]))
    poisson, bulk = float(rng.uniform(0.0, 0.45)), float(stress * 10 ** rng.uniform(0, 1))
    elastic = {"young": float(stress), "poisson": poisson}
    if name == "mooney-rivlin":
        share = rng.uniform(0, 1)
        return {
            "law": name,
            "c10": 0.2 * stress * (1 - share),
            "c01": 0.2 * stress * share,
            "bulk": bulk,
        }
    if name == "ogden":
        return {
            "law": name,
            "mu": [0.4 * stress, 0.02 * stress, -0.05 * stress],
            "alpha": [1.3, 4.0, -2.0],
            "bulk": bulk,
        }
    if name == "j2":
        first = float(stress * 10 ** rng.uniform(-3.5, -2))
        table = [[0.005, 1.3 * first], [0.05, 1.6 * first]]
        hardening = [0.0, 0.05 * stress, table][rng.integers(3)]
        return {"law": name, **elastic, "yield_stress": first, "hardening": hardening}
    return {"law": name.replace("isochoric", "neo-hooke"), **elastic} | (
        {"isochoric": True} if name == "isochoric" else {}
    )


# --- the judge ------------------------------------------------------------------------------------


def shape_energy(law: dict[str, Any], stretches: npt.NDArray[Any]) -> Any:
    """The energy of the principal stretches, shape (..., 3), per undeformed volume, without that of
    the volume.
    """
    volume = stretches.prod(axis=-1)
    even = stretches / volume[..., None] ** (1 / 3)
    name = law["law"]
    if name == "ogden":
        terms = zip(law["mu"], law["alpha"], strict=True)
        return sum(mu / alpha * ((even**alpha).sum(axis=-1) - 3) for mu, alpha in terms)
    if name == "mooney-rivlin":
        first, second = (even**2).sum(axis=-1), (even**-2.0).sum(axis=-1)
        return law["c10"] * (first - 3) + law["c01"] * (second - 3)
    mu = law["young"] / 2 / (1 + law["poisson"])
    if name == "saint-venant-kirchhoff":
        green = (stretches**2 - 1) / 2
        lame = 2 * mu * law["poisson"] / (1 - 2 * law["poisson"])
        return mu * (green**2).sum(axis=-1) + lame / 2 * green.sum(axis=-1) ** 2
    if law.get("isochoric"):
        return mu / 2 * ((even**2).sum(axis=-1) - 3)
    return mu / 2 * ((stretches**2).sum(axis=-1) - 3) - mu * np.log(volume)


def volume_energy(law: dict[str, Any], stretches: npt.NDArray[Any]) -> Any:
    """That of the volume."""
    volume = stretches.prod(axis=-1)
    if law["law"] in ("ogden", "mooney-rivlin"):
        return law["bulk"] / 2 * (volume - 1) ** 2
    if law["law"] == "saint-venant-kirchhoff":
        return 0.0 * volume
    mu = law["young"] / 2 / (1 + law["poisson"])
    bulk = 2 * mu * (1 + law["poisson"]) / 3 / (1 - 2 * law["poisson"])
    if law.get("isochoric"):
        return bulk / 2 * (volume - 1) ** 2
    return (bulk - 2 * mu / 3) / 2 * np.log(volume) ** 2


def stress_of(
    energy: Callable[[dict[str, Any], Any], Any],
    law: dict[str, Any],
    gradient: Array,
    free: Array | float = 0.0,
) -> Array:
    """The first Piola-Kirchhoff stress, shape (..., 3, 3), from a gradient and the free expansion,
    shape (...).
    """
    left, stretches, right = np.linalg.svd(gradient)
    grown = np.asarray(1.0 + free)[..., None]
    slopes = np.zeros_like(stretches)
    for axis in range(3):
        aside = stretches.astype(np.complex128)
        aside[..., axis] += 1e-30j
        slopes[..., axis] = (grown[..., 0] ** 3 * energy(law, aside / grown)).imag / 1e-30
    return np.asarray((left * slopes[..., None, :]) @ right)


@dataclass
class Metal:
    """A material that yields, at points of quadrature."""

    law: dict[str, Any]  # as a scene has it
    plastic: Array  # plastic strain, shape (points, 3, 3)
    grown: Array  # accumulated, shape (points,)

    def yield_stress(self, grown: Array) -> Array:
        """Of accumulated plastic strains."""
        first, hardening = self.law["yield_stress"], self.law["hardening"]
        if isinstance(hardening, float):
            return np.asarray(first + hardening * grown)
        table = np.array([[0.0, first], *hardening])
        return np.interp(grown, table[:, 0], table[:, 1])

    def deviator(self, strain: Array) -> tuple[Array, Metal]:
        """The deviatoric stress of a strain, and the state that it leaves."""
        mu = self.law["young"] / 2 / (1 + self.law["poisson"])
        trial = (
            strain
            - np.trace(strain, axis1=1, axis2=2)[:, None, None] * np.eye(3) / 3
            - self.plastic
        )
        mises = 2 * mu * np.sqrt(1.5 * (trial**2).sum(axis=(1, 2)))
        low, high = np.zeros_like(mises), mises / (3 * mu)
        for _ in range(80):
            half = (low + high) / 2
            too_little = mises - 3 * mu * half > self.yield_stress(self.grown + half)
            low, high = np.where(too_little, half, low), np.where(too_little, high, half)
        flow = np.where(mises > self.yield_stress(self.grown), high, 0.0)
        direction = 1.5 * 2 * mu * trial / np.where(mises > 0, mises, 1.0)[:, None, None]
        change = flow[:, None, None] * direction
        return 2 * mu * (trial - change), Metal(self.law, self.plastic + change, self.grown + flow)


@dataclass
class Judge:
    """The second program for one scene."""

    scene: RandomScene  # it
    x: Array  # the nodes, length, shape (n, d)
    cells: npt.NDArray[np.int64]  # their nodes, shape (c, k)
    _rules: list[tuple[Array, Array, Array]] = field(
        init=False
    )  # weights, gradients and values, by rule
    _metal: Metal | None = field(init=False)

    def __post_init__(self) -> None:
        scene = self.scene
        full, reduced = _DEGREES[scene.cell, scene.degree]
        if scene.kind == "axisymmetric":
            full = _DEGREES_OF_REVOLUTION[scene.cell, scene.degree]
        self._rules = [self._rule(full), self._rule(full)]
        if scene.volumetric == "reduced":
            mean = scene.kind == "axisymmetric" and reduced == 1
            self._rules[1] = self._mean(self._rules[0]) if mean else self._rule(reduced)
        count = self._rules[0][0].size
        metal = scene.law["law"] == "j2"
        self._metal = Metal(scene.law, np.zeros((count, 3, 3)), np.zeros(count)) if metal else None

    def _rule(self, degree: int) -> tuple[Array, Array, Array]:
        """Weights (c, q), gradients (c, q, k, d) and values (c, q, k) of the shape functions."""
        points, weights = basix.make_quadrature(getattr(basix.CellType, self.scene.cell), degree)
        shape, slopes = elements.shape(self.x.shape[1], self.cells.shape[1], points)
        x, values = self.x[self.cells], np.broadcast_to(shape, (len(self.cells), *shape.shape))
        jacobian = np.einsum("cki,qkj->cqij", x, slopes)
        gradients = np.einsum("qkj,cqji->cqki", slopes, np.linalg.inv(jacobian))
        volumes = weights * np.abs(np.linalg.det(jacobian))
        if self.scene.kind == "axisymmetric":
            volumes = volumes * 2 * np.pi * np.einsum("cqk,ck->cq", values, x[:, :, 0])
        return volumes, gradients, values

    def _mean(self, rule: tuple[Array, Array, Array]) -> tuple[Array, Array, Array]:
        """One point of each cell of a body of revolution, with gradients averaged over its volume
        and values over its section.
        """
        volumes, gradients, values = rule
        areas = volumes / np.einsum("cqk,ck->cq", values, self.x[self.cells][:, :, 0])
        whole, area = (each.sum(axis=1)[:, None, None] for each in (volumes, areas))
        slopes = np.einsum("cq,cqkj->ckj", volumes, gradients) / whole
        shape = np.einsum("cq,cqk->ck", areas, values)[:, None] / area
        return whole[:, 0], slopes[:, None], shape

    def _gradient(self, u: Array, rule: tuple[Array, Array, Array]) -> Array:
        """Displacement gradients at the points of a rule, shape (c, q, 3, 3)."""
        _, gradients, values = rule
        dim, out = self.x.shape[1], np.zeros((*values.shape[:2], 3, 3))
        out[..., :dim, :dim] = np.einsum("cki,cqkj->cqij", u[self.cells], gradients)
        if self.scene.kind == "axisymmetric":
            radius = np.einsum("cqk,ck->cq", values, self.x[self.cells][:, :, 0])
            out[..., 2, 2] = np.einsum("cqk,ck->cq", values, u[self.cells][:, :, 0]) / radius
        return out

    def _work(self, stress: Array, rule: tuple[Array, Array, Array]) -> Array:
        """Forces of a stress at the points of a rule, shape (n, d)."""
        volumes, gradients, values = rule
        dim = self.x.shape[1]
        each = np.einsum("cq,cqij,cqkj->cki", volumes, stress[..., :dim, :dim], gradients)
        if self.scene.kind == "axisymmetric":
            radius = np.einsum("cqk,ck->cq", values, self.x[self.cells][:, :, 0])
            each[:, :, 0] += np.einsum("cq,cq,cqk->ck", volumes, stress[..., 2, 2] / radius, values)
        forces = np.zeros_like(self.x)
        np.add.at(forces, self.cells, each)
        return forces

    def least_volume(self, u: Array) -> float:
        """The smallest change of volume at the points."""
        return float(np.linalg.det(np.eye(3) + self._gradient(u, self._rules[0])).min())

    def expansion(self, warmth: Array, rule: tuple[Array, Array, Array]) -> Array:
        """The free expansion at the points of a rule, shape (c, q); ``warmth``: of now, see
        ``RandomScene``.
        """
        places = np.einsum("cqk,cki->cqi", rule[2], self.x[self.cells])
        return np.asarray(warmth[0] + places / self.scene.sizes @ warmth[1:])

    def internal(self, u: Array, warmth: Array) -> tuple[Array, Metal | None]:
        """Forces of the body, shape (n, d), and the state of a metal afterwards; ``warmth``: see
        ``expansion``.
        """
        law, (full, other) = self.scene.law, self._rules
        changes = [self._gradient(u, rule) for rule in (full, other)]
        free = [self.expansion(warmth, rule) for rule in (full, other)]
        if self._metal is None:
            parts = zip((shape_energy, volume_energy), changes, free, (full, other), strict=True)
            return sum(
                self._work(stress_of(w, law, np.eye(3) + change, s), rule)
                for w, change, s, rule in parts
            ), None
        changes = [
            change - s[..., None, None] * np.eye(3) for change, s in zip(changes, free, strict=True)
        ]
        strain = ((changes[0] + changes[0].swapaxes(2, 3)) / 2).reshape(-1, 3, 3)
        deviator, state = self._metal.deviator(strain)
        bulk = law["young"] / 3 / (1 - 2 * law["poisson"])
        mean = bulk * np.trace(changes[1], axis1=2, axis2=3)[..., None, None] * np.eye(3)
        forces = self._work(deviator.reshape(changes[0].shape), full) + self._work(mean, other)
        return forces, state

    def loads(self, share: float) -> Array:
        """Dead forces of the right side, shape (n, d), by Gauss points of its facets."""
        scene, dim = self.scene, self.x.shape[1]
        forces = np.zeros_like(self.x)
        if not scene.pull.any():
            return forces
        right = np.isclose(self.x[:, 0], scene.sizes[0], rtol=1e-9)
        around = 2 * np.pi * scene.sizes[0] if scene.kind == "axisymmetric" else 1.0
        for cell in self.cells:
            nodes = cell[right[cell]]
            if dim == 2 and len(nodes) == scene.degree + 1:
                nodes = nodes[np.argsort(self.x[nodes, 1])]
                size = np.ptp(self.x[nodes, 1])
                shares = (
                    np.array([1 / 6, 2 / 3, 1 / 6]) if scene.degree == 2 else np.array([0.5, 0.5])
                )
                forces[nodes] += around * size * shares[:, None] * scene.pull
            elif dim == 3 and len(nodes) == (3 if scene.cell == "tetrahedron" else 4):
                spread = np.ptp(self.x[nodes, 1:], axis=0).prod() / (
                    2 if scene.cell == "tetrahedron" else 1
                )
                forces[nodes] += spread / len(nodes) * scene.pull
        return share * forces

    def away(self, u: Array, moved: Array) -> tuple[Array, Array]:
        """Distances from the foundation, shape (n,), and the normals from it into the body, shape
        (n, d).
        """
        scene = self.scene
        arms = self.x + u - (scene.centre + moved)
        if scene.shape == "plane":
            return arms @ scene.normal, np.broadcast_to(scene.normal, arms.shape)
        length = np.linalg.norm(arms, axis=1)
        return length - scene.radius, arms / length[:, None]

    def fixed(self) -> npt.NDArray[np.bool_]:
        """Which components supports hold, shape (n, d)."""
        scene, fixed = self.scene, np.zeros(self.x.shape, dtype=bool)
        near = 1e-9 * scene.sizes.max()
        bottom = np.abs(self.x[:, -1]) <= near
        if not scene.rollers:
            fixed[bottom] = True
            return fixed
        fixed[bottom, -1] = True
        for axis in range(self.x.shape[1] - 1):
            fixed[np.abs(self.x[:, axis]) <= near, axis] = True
        return fixed

    def faults(self, step: Step, before: Step) -> list[str]:
        """What is wrong with a load step that is called converged; the metal goes on to its end."""
        scene, u = self.scene, step.u
        size, faults = scene.sizes.max(), list[str]()
        if self._metal is None and self.least_volume(u) <= 0:
            return ["turned inside out"]
        warmth = scene.between(step.time, scene.warmth)
        inner, state = self.internal(u, warmth)
        at = np.array([0.0, *scene.times])
        forces = inner - self.loads(float(np.interp(step.time, at, np.linspace(0, 1, len(at)))))
        fixed, (gap, normal) = self.fixed(), self.away(u, step.moved)
        top = np.isclose(self.x[:, -1], scene.sizes[-1], rtol=1e-9)
        if scene.kind == "axisymmetric":  # the axis of elements of degree 2 has no contact points
            axis = self.x[:, 0] < 1e-9 * size
            top &= ~axis | (scene.degree == 1)
            forces[axis, 0], fixed[axis, 0] = 0.0, False  # no force along x is possible there
        modulus = scene.law.get("young", scene.law.get("bulk", 0.0))
        least = (
            1e-9 * modulus * size ** (1 if scene.kind == "plane strain" else 2)
        )  # where nothing loads the body
        scale = max(float(np.abs(inner).max()), least)
        near = _NEAR[scene.algorithm] * size
        if (gap[top] < -near).any():
            faults.append(f"penetration {-gap[top].min() / size:.1e}")
        touching = top & (gap < near)
        free = np.where(fixed, 0.0, forces)
        if scene.friction["law"] == "tresca":  # which acts on open nodes, too
            free[top] = np.einsum("ni,ni->n", free, normal)[top, None] * normal[top]
            free[top & fixed.any(axis=1)] = 0.0
        if (wrong := np.abs(free[~touching]).max(initial=0.0)) > _SMALL * scale:
            faults.append(f"out of balance by {wrong / scale:.1e}")
        # Where a support holds a component, what the foundation adds is not known; elsewhere all
        # forces are its own.
        known = touching & ~fixed.any(axis=1)
        pressing = np.einsum("ni,ni->n", forces, normal)
        shear = forces - pressing[:, None] * normal
        along = np.linalg.norm(shear, axis=1)
        if pressing[known].min(initial=0.0) < -_SMALL * scale:
            faults.append(f"the foundation pulls by {-pressing[known].min() / scale:.1e}")
        bound = self._bound(pressing)
        if bound is not None:
            if (over := (along - bound)[known].max(initial=0.0)) > 1e-5 * scale:
                faults.append(f"friction beyond its bound by {over / scale:.1e}")
            faults += self._slips(step, before, (known, normal, shear, bound, pressing))
        pushed = top if scene.friction["law"] == "tresca" else touching
        if not fixed[pushed].any():
            found = np.array([forces[pushed].sum(axis=0)])
            if scene.kind == "axisymmetric":
                found[:, 0] = step.force[0]
            if (apart := np.abs(found - step.force).max()) > 1e-5 * scale:
                faults.append(f"force reported is another one by {apart / scale:.1e}")
        if scene.push is not None:
            wanted = float(scene.between(step.time, scene.push[:, None])[0])
            if abs(step.force[-1] + wanted) > 1e-6 * max(wanted, scale):
                faults.append(f"the tool is out of balance: {step.force[-1]:.6g} of {-wanted:.6g}")
        elastic = self._metal is None and scene.friction["law"] == "none" and scene.push is None
        if elastic and 0 < (~fixed).sum() <= _SIDES and not faults:
            faults += self._unstable(u, warmth, (known, normal, pressing), gap, scale)
        self._metal = state
        return faults

    def _bound(self, pressing: Array) -> Array | None:
        """Of friction at the nodes, a force; None: it is not known here."""
        friction = self.scene.friction
        if friction["law"] == "none":
            return np.zeros_like(pressing)
        if friction["law"] == "coulomb":
            return np.asarray(friction["coefficient"] * np.maximum(pressing, 0.0))
        return None

    def _slips(self, step: Step, before: Step, at: tuple[Any, ...]) -> list[str]:
        """Friction below its bound at nodes that slip, or along their slip, of nodes that touch at
        both ends.
        """
        known, normal, shear, bound, pressing = at
        way = (step.u - step.moved) - (before.u - before.moved)
        way -= np.einsum("ni,ni->n", way, normal)[:, None] * normal
        slip, near = (
            np.linalg.norm(way, axis=1),
            _NEAR[self.scene.algorithm] * self.scene.sizes.max(),
        )
        far = np.linalg.norm(step.moved - before.moved) + np.abs(step.u - before.u).max()
        gap, _ = self.away(before.u, before.moved)
        pressed = known & (pressing > 1e-3 * pressing[known].max(initial=0.0)) & (gap < near)
        along, faults = np.linalg.norm(shear, axis=1), list[str]()
        if self.scene.friction["law"] == "none":
            return faults
        # Chords and arcs differ by the square of the way over the radius.
        curved = far**2 / self.scene.radius if self.scene.shape != "plane" else 0.0
        slides = pressed & (slip > 1e-3 * far + 4 * curved + near)
        if slides.any() and (weak := (1 - along[slides] / bound[slides]).max()) > 1e-3:
            faults.append(f"slip with {1 - weak:.3f} of its bound")
        if slides.any():
            cosine = np.einsum("ni,ni->n", shear, way)[slides] / (along * slip)[slides]
            if cosine.max() > (-0.9 if self.x.shape[1] == 3 else 0.0):
                faults.append(f"friction along the slip: cosine {cosine.max():.2f}")
        return faults

    def _unstable(
        self, u: Array, warmth: Array, at: tuple[Any, ...], gap: Array, scale: float
    ) -> list[str]:
        """Whether the energy has no minimum on the displacements that contact and supports leave,
        without friction.
        """
        known, normal, pressing = at
        pressed = np.flatnonzero(known & (pressing > 1e-5 * scale))
        count, dim = self.x.shape
        matrix = np.zeros((count * dim, count * dim))
        step = 1e-6 * self.scene.sizes.min() / max(self.scene.counts)
        for column in range(count * dim):
            aside = np.zeros(count * dim)
            aside[column] = step
            ahead, behind = (
                self.internal(u + sign * aside.reshape(-1, dim), warmth)[0] for sign in (1, -1)
            )
            matrix[:, column] = (ahead - behind).ravel() / (2 * step)
        if self.scene.shape != "plane":
            for node in pressed:  # the force turns with the foundation's normal
                rows = slice(dim * node, dim * node + dim)
                across = np.eye(dim) - np.outer(normal[node], normal[node])
                matrix[rows, rows] -= pressing[node] / (self.scene.radius + gap[node]) * across
        basis = np.eye(count * dim)[:, ~self.fixed().ravel()]
        if pressed.size:
            rows = np.zeros((pressed.size, count * dim))
            for row, node in enumerate(pressed):
                rows[row, dim * node : dim * node + dim] = normal[node]
            _, _, right = np.linalg.svd(rows @ basis)
            basis = basis @ right[pressed.size :].T
        values = np.linalg.eigvalsh(basis.T @ ((matrix + matrix.T) / 2) @ basis)
        if values[0] < -1e-6 * values[-1]:
            return [f"negative eigenvalue {values[0] / values[-1]:.1e}"]
        return []


@dataclass(frozen=True)
class Step:
    """What the judge looks at of a load step."""

    time: float  # of it
    u: Array  # of all nodes, length, shape (n, d)
    moved: Array  # where the foundation has moved to, length, shape (d,)
    force: Array  # of contact on the body, as it is reported, shape (d,)


def gathered(
    solution: Solution, comm: MPI.Comm
) -> tuple[Array, npt.NDArray[np.int64], list[Array]]:
    """Nodes, cells and displacements of all load steps of all ranks; collective."""
    space = solution.model.space
    dim, index = space.mesh.geometry.dim, space.dofmap.index_map
    own, cells = index.size_local, space.mesh.topology.index_map(space.mesh.topology.dim).size_local
    nodes = np.asarray(index.local_to_global(space.dofmap.list[:cells].ravel().astype(np.int32)))
    x = np.concatenate(comm.allgather(space.tabulate_dof_coordinates()[:own, :dim]))
    connected = np.concatenate(comm.allgather(nodes.reshape(cells, -1)))
    steps = [step.displacement.x.array.reshape(-1, dim)[:own] for step in solution.steps]
    return x, connected, [np.concatenate(comm.allgather(values)) for values in steps]


def ended(scene: RandomScene, comm: MPI.Comm) -> tuple[str, Solution | None, str]:
    """How a scene ends, with its solution if there is one, and what is said of the end;
    collective.
    """
    try:
        solution = solve(parse_scene(scene.stated()), comm, check=False)
    except ConvergenceError as error:
        return str(error).partition(":")[0], None, str(error)
    except SignoriniError as error:
        return "refused", None, str(error)
    return solution.status.value, solution, "" if solution.converged else solution.advice


def tried(seed: int, comm: MPI.Comm = MPI.COMM_SELF) -> tuple[str, list[str], str]:
    """How the scene of a seed ends, what is wrong with what is called converged, and what is said
    of the end; collective.
    """
    scene = RandomScene.drawn(seed)
    end, solution, said = ended(scene, comm)
    faults = [] if solution is None else judged(scene, solution, comm)
    return end, faults, said


def judged(scene: RandomScene, solution: Solution, comm: MPI.Comm) -> list[str]:
    """What is wrong with load steps that are called converged; collective."""
    x, cells, displacements = gathered(solution, comm)
    judge, faults = Judge(scene, x, cells), list[str]()
    dim = x.shape[1]
    before = Step(0.0, np.zeros_like(x), np.zeros(dim), np.zeros(dim))
    for step, u in zip(solution.steps, displacements, strict=True):
        if step.status.value != "converged":
            break
        assert step.contact is not None
        force = np.sum(step.contact.forces, axis=0)
        moved = (
            step.rigid_bodies[0].translation
            if scene.push is not None
            else scene.between(step.time, scene.ways)
        )
        now = Step(step.time, u, moved, force)
        faults += [f"at {step.time:g}: {fault}" for fault in judge.faults(now, before)]
        before = now
    return faults


def main(count: int, first: int = 0) -> int:
    """Try seeds, and print what is wrong and how scenes end; whether any is wrong."""
    comm = MPI.COMM_WORLD
    ends, wrong, begun = Counter[tuple[str, str]](), Counter[tuple[str, str]](), time.process_time()
    for seed in range(first, first + count):
        scene, (end, faults, said) = RandomScene.drawn(seed), tried(seed, comm)
        law = str(scene.law["law"])
        ends[law, end] += 1
        wrong[law, end] += bool(faults)
        if comm.rank == 0 and (faults or end != "converged"):
            kind = f"{scene.kind}, {law}, {scene.shape}, {scene.friction['law']}, {scene.algorithm}"
            kind += ", heated" * bool(scene.warmth.any())
            print(f"seed {seed}: {kind}: {end}: {'; '.join(faults[:3])} {said}", flush=True)
    if comm.rank == 0:
        print(
            f"{count} scenes on {comm.size} ranks, {wrong.total()} wrong, "
            f"{time.process_time() - begun:.0f} s"
        )
        for (law, end), number in sorted(ends.items()):
            print(f"{law:24}{end:40}{number:>5}")
    return int(wrong.total() > 0)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n\n")[0])
    parser.add_argument("count", type=int)
    parser.add_argument("first", type=int, nargs="?", default=0)
    sys.exit(main(**vars(parser.parse_args())))
