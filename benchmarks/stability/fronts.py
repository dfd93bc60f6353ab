"""Random problems that are stated twice or three times: as a scene, as forms, and as a residual; by
seed.

    ./env python3 -m benchmarks.stability.fronts 200 [FIRST]

The fronts share the core, and nothing else that is compared here is shared: a scene finds facets by
names, integrates its loads and supports by effects and has its contact as entries; forms have UFL,
DirichletBCs and Foundations; of a residual with a linear F there are a Newton iteration and a
certificate of its own.  Status, load steps, sets, forces, displacements, pressures, states, the
contact table, quantities and the estimated error have to agree.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
import ufl
from dolfinx import fem
from mpi4py import MPI

from signorini_fx import (
    ContactProblem,
    ConvergenceError,
    Coulomb,
    Foundation,
    FrictionLaw,
    LoadPath,
    NonlinearContactProblem,
    Pair,
    Parameter,
    Solution,
    Tresca,
    solve,
)
from signorini_fx.extensions import LAWS, register
from signorini_fx.mechanics.assembly.mesh_entities import strain_degree
from signorini_fx.mechanics.contact_points.contact_table import ContactTable
from signorini_fx.mechanics.kinematics import AXISYMMETRIC
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.quantities.values import of_fields, of_results
from signorini_fx.records import Status
from signorini_fx.results.mechanics import StepResult
from signorini_fx.scenes.reading import parse_scene

Array = npt.NDArray[np.float64]
# The coefficient of the law of the study's own.
COEFFICIENT = 0.4
# The coefficient of expansion of all materials, per temperature.
EXPANSION = 1e-5


class Levelling(FrictionLaw):
    """Friction of a user's own: k (1 - exp(-F lambda / k)), with F the coefficient and k the
    largest shear.
    """

    law: Literal["own"] = "own"
    coefficient: Parameter
    largest: Parameter
    concave = True

    def evaluate(self, pressure: Array, slip: Array, dt: float) -> tuple[Array, Array, float]:
        """See ``FrictionLaw``."""
        left = np.asarray(np.exp(-self.coefficient * pressure / self.largest))
        return self.largest * (1 - left), self.coefficient * left, 0.0


register(LAWS, "own", Levelling)
# Quantities that forms answer as scenes do; of the others forms call boundaries otherwise.
QUANTITIES = (
    *("contact_nodes", "touching_nodes", "max_pressure", "max_shear", "pressure_integral"),
    *("areas", "contact_force", "friction_force", "contact_moment", "friction_moment"),
    *("deformation", "utilisation"),
)
# Those of energies, which forms know without what heat strains, and that of the stress.
ENERGIES, STRESS = ("strain_energy",), ("stress",)
# By how much two fronts may differ, relative to the largest value of all load steps: two assemblies
# of one problem differ by round-off, which gamma = 1e5 moduli makes 1e5 times as large where a
# pressure is a penetration.
SAME = 1e-8


@dataclass(frozen=True)
class RandomProblem:
    """A rectangle, a body of revolution or a box over a floor, another rectangle, or a rigid circle
    or sphere that may move with the time, or by a force.
    """

    kind: str  # *plane strain*, *axisymmetric* or *space*
    cell: str  # of the mesh
    degree: int  # of the displacement
    sizes: tuple[float, ...]  # of the body along each axis, length
    counts: tuple[int, ...]  # of cells along each axis
    young: float  # Young's modulus
    poisson: float  # Poisson's ratio
    held: bool  # whether the top is displaced; otherwise it is loaded
    down: Array  # the displacement of the top at the load factor 1, length, shape (d,)
    traction: Array  # on the top where it is not held, and on the side, stress, shape (2, d)
    gap: tuple[float, float]  # of the floor at the origin, length, and its slope along x[0]
    radius: float | None  # of the rigid circle; None: there is a floor
    wall: float | None  # the gap of a wall on the right; None: there is none
    velocity: Array | None  # of the circle, length per time, shape (d,); None: it stands still
    push: float | None  # the force on the circle towards the body, which moves it; None: none does
    # counts of cells along each axis of another rectangle or box that it lies on, as long as twice
    # its length; None: there is none
    below: tuple[int, ...] | None
    law: tuple[str, float]  # of friction, with its bound or coefficient
    factors: tuple[float, ...]  # of the loads, by load step
    times: tuple[float, ...]  # of the load steps
    ramp: int | None  # increments of a ramp between two load steps; None: there is none
    settings: dict[str, Any]  # of the solver
    # the free thermal strain at the origin at the load factor 1, and its slope along x[0]; None:
    # there is none
    heat: tuple[float, float] | None
    # whether forms are given the stress beside the energy, where it is linear in the strain
    tells_stress: bool

    @classmethod
    def drawn(cls, seed: int) -> RandomProblem:
        """That of a seed."""
        rng = np.random.default_rng([57, seed])
        kind = str(rng.choice(["plane strain", "axisymmetric", "space"], p=[0.55, 0.2, 0.25]))
        dim = 3 if kind == "space" else 2
        cells = ["tetrahedron", "hexahedron"] if dim == 3 else ["triangle", "quadrilateral"]
        degree = int(rng.choice([1, 2])) if dim == 2 else 1
        counts = (6, 4, 4) if dim == 3 else (int(rng.integers(6, 16)), int(rng.integers(3, 8)))
        sizes = tuple(rng.uniform(0.7, 2.0, dim).tolist())
        young = float(10 ** rng.uniform(0, 6))
        strain = float(10 ** rng.uniform(-4, -2))
        down = strain * np.array([*rng.uniform(-1, 1, dim - 1), -rng.uniform(0.5, 1.5)]) * sizes[-1]
        if kind == "axisymmetric":
            down[0] = 0.0
        held = kind == "axisymmetric" or bool(rng.random() < 0.6)
        pull = strain * young * rng.uniform(-0.3, 0.3, (2, dim))
        pull[0, -1] = -strain * young * rng.uniform(0.3, 1.0)
        name = str(rng.choice(["none", "tresca", "coulomb"]))
        size = strain * young * 0.3 if name == "tresca" else 1.0
        steps = int(rng.integers(1, 4))
        begin = float(rng.choice([0.0, 0.4, 1.0])) if steps > 1 else 1.0
        factors = rng.uniform(0.3, 1.0, steps) if steps > 1 else np.ones(1)
        ramp = int(rng.integers(2, 5)) if steps == 2 and rng.random() < 0.5 else None
        algorithm = str(rng.choice(["ssn", "alm", "ssn"]))
        settings: dict[str, Any] = {"algorithm": algorithm}
        if rng.random() < 0.5:
            settings |= {"gamma_n": 1e4 * young, "gamma_t": 1e4 * young}
        below = None
        if kind == "plane strain" and rng.random() < 0.35:
            below = int(rng.integers(6, 20)), int(rng.integers(2, 6))
        circle = kind != "axisymmetric" and below is None and rng.random() < 0.35
        wall = kind == "plane strain" and rng.random() < 0.3
        velocity = push = None
        kind_of_motion, own = rng.random(2)
        if circle and held and kind_of_motion < 0.5:
            velocity = strain * rng.uniform(-0.3, 0.3, dim) * sizes[0]
        elif circle and dim == 2 and kind_of_motion < 0.8:
            push = strain * young * sizes[0] * float(rng.uniform(0.05, 0.2))
        if name != "none" and own < 0.25:
            name, size = "own", strain * young * 0.3
        # Draws of their own, so that the problems of a seed are what they were before there were
        # these.
        further = np.random.default_rng([57, seed, 1])
        hot, warm, onto, by_force, _ = further.random(5)
        heat = (
            (float(strain * warm), float(strain * further.uniform(-0.3, 0.3)))
            if hot < 0.3
            else None
        )
        if dim == 3 and not circle and onto < 0.4:
            below = tuple(further.integers([4, 3, 2], [9, 7, 4]).tolist())
        elif dim == 3 and circle and velocity is None and by_force < 0.7:
            push = strain * young * sizes[0] * sizes[1] * float(further.uniform(0.05, 0.2))
        tells_stress = bool(np.random.default_rng([57, seed, 2]).random() < 0.7)
        return cls(
            kind=kind,
            cell=str(rng.choice(cells)),
            degree=degree,
            sizes=sizes,
            counts=counts,
            young=young,
            poisson=float(rng.uniform(0.0, 0.45)),
            held=held,
            down=down,
            traction=pull,
            gap=(float(strain * rng.uniform(-0.2, 0.3)), float(strain * rng.uniform(-0.2, 0.2))),
            radius=float(rng.uniform(1.0, 4.0)) if circle else None,
            wall=float(strain * rng.uniform(0.0, 0.3)) if wall else None,
            velocity=velocity,
            push=push,
            below=below,
            law=(name, float(rng.uniform(0.1, 0.6)) * size),
            factors=tuple(factors.tolist()),
            times=tuple((begin + np.arange(steps)).tolist()),
            ramp=ramp,
            settings=settings,
            heat=heat,
            tells_stress=tells_stress,
        )

    @property
    def axes(self) -> str:
        """Names of the components of a displacement."""
        return "xyz"[: len(self.sizes)]

    @property
    def shape(self) -> dict[str, Any] | None:
        """The rigid circle or sphere; None: there is a floor."""
        if self.radius is None:
            return None
        centre = [0.5 * size for size in self.sizes[:-1]] + [-self.radius]
        name = "sphere" if self.kind == "space" else "circle"
        described: dict[str, Any] = {"shape": name, "centre": centre, "radius": self.radius}
        if self.push is not None:
            turns = (
                ("rotation",)
                if len(self.sizes) == 2
                else ("rotation_x", "rotation_y", "rotation_z")
            )
            aside = dict.fromkeys((*self.axes[:-1], *turns), 0.0)
            force = [0.0] * (len(self.sizes) - 1) + [self.push]
            described |= {"pivot": centre, "force": force, "prescribed": aside}
        return described

    @property
    def friction(self) -> FrictionLaw | None:
        """The law as an object; None: there is none."""
        kinds = {"tresca": Tresca, "coulomb": Coulomb, "own": partial(Levelling, COEFFICIENT)}
        return None if self.law[0] == "none" else kinds[self.law[0]](self.law[1])

    def placement(self, time: float) -> dict[str, Any]:
        """How the circle is placed at a time."""
        return {} if self.velocity is None else {"shift": tuple((time * self.velocity).tolist())}

    def named(self, boundary: str) -> str:
        """The name of a boundary of the body."""
        return boundary if self.below is None else f"high.{boundary}"

    def stated(self) -> dict[str, Any]:
        """The scene as TOML has it."""
        in_space, sides = (
            self.kind == "space",
            ("length", "width", "height") if self.kind == "space" else (),
        )
        names, numbers = sides or ("length", "height"), ("nx", "ny", "nz")[: len(self.sizes)]
        parameters: dict[str, Any] = dict(zip(names, self.sizes, strict=True))
        parameters |= dict(zip(numbers, self.counts, strict=True)) | {"cell": self.cell}
        factors = list(self.factors)
        law: dict[str, Any] = {"law": self.law[0]}
        if self.law[0] == "own":
            law |= {"coefficient": COEFFICIENT, "largest": self.law[1]}
        elif self.law[0] != "none":
            law |= {"bound" if self.law[0] == "tresca" else "coefficient": self.law[1]}
        contact: dict[str, Any] = {"boundary": self.named("bottom"), "friction": law}
        if self.below is not None:
            contact |= {"against": "low.top", "points": "boundary", "gap": abs(self.gap[0])}
        elif self.shape is None:
            contact["gap"] = f"{self.gap[0]!r} + ({self.gap[1]!r}) * x[0]"
        else:
            shift = (
                None
                if self.velocity is None
                else [f"({rate!r}) * t" for rate in self.velocity.tolist()]
            )
            contact |= {
                "gap": self.gap[0],
                "foundation": self.shape | ({} if shift is None else {"shift": shift}),
            }
        contacts = [contact]
        if self.wall is not None:
            contacts.append({"boundary": self.named("right"), "gap": self.wall, "friction": law})
        supports: list[dict[str, Any]] = []
        tractions: list[dict[str, Any]] = []
        if self.held:
            moved = dict(zip(self.axes, self.down.tolist(), strict=True))
            supports.append({"boundary": self.named("top"), **moved, "factors": factors})
        else:
            pull = dict(zip(self.axes, self.traction[0].tolist(), strict=True))
            tractions.append({"boundary": self.named("top"), **pull, "factors": factors})
        if self.kind == "axisymmetric":
            supports.append({"boundary": "left", "x": 0.0, "factors": factors})
        else:
            pull = dict(zip(self.axes, self.traction[1].tolist(), strict=True))
            tractions.append({"boundary": self.named("left"), **pull, "factors": factors})
        material: dict[str, Any] = {"young": self.young, "poisson": self.poisson}
        if not in_space:
            material["hypothesis"] = self.kind
        steps: dict[str, Any] = {"times": self.times} if len(self.times) > 1 else {}
        if self.ramp is not None:
            steps["steps"] = self.ramp
        mesh: dict[str, Any] = {
            "generator": "box" if in_space else "rectangle",
            "parameters": parameters,
        }
        bodies: dict[str, Any] = {"mesh": mesh}
        if self.below is not None:
            supports.append(
                {"boundary": "low.bottom", **dict.fromkeys(self.axes, 0.0), "factors": factors}
            )
            extent = dict(
                zip(
                    names,
                    (*(2 * size for size in self.sizes[:-1]), 0.7 * self.sizes[-1]),
                    strict=True,
                )
            )
            cells = dict(zip(numbers, self.below, strict=True)) | {"cell": self.cell}
            under = {"generator": mesh["generator"], "parameters": extent | cells}
            shift = [*(0.5 * size for size in self.sizes[:-1]), extent["height"]]
            bodies = {
                "body": [
                    {"name": "low", "mesh": under},
                    {"name": "high", "mesh": mesh, "shift": shift},
                ]
            }
        heated: dict[str, Any] = {}
        if self.heat is not None:
            material["expansion"] = EXPANSION
            change = f"({self.heat[0] / EXPANSION!r}) + ({self.heat[1] / EXPANSION!r}) * x[0]"
            heated = {"temperature": {"change": change, "factors": factors}}
        return {
            **bodies,
            **heated,
            "material": material,
            "element": {"degree": self.degree},
            "displacement": supports,
            "traction": tractions,
            "contact": contacts,
            "load_steps": steps,
            "solver": self.settings,
        }

    def forms(self, tagged: TaggedMesh) -> Forms:
        """The same in UFL, on a mesh with the names of the scene."""
        mesh, dim = tagged.mesh, len(self.sizes)
        V = fem.functionspace(mesh, ("Lagrange", self.degree, (dim,)))
        v, x = ufl.TestFunction(V), ufl.SpatialCoordinate(mesh)
        factor = fem.Constant(mesh, self.factors[0])
        measure = 2 * np.pi * x[0] if self.kind == "axisymmetric" else None
        around = 1.0 if measure is None else measure

        def strain(y: Any) -> Any:
            gradient = ufl.grad(y)
            if self.kind == "space":
                return ufl.sym(gradient)
            ring = y[0] / x[0] if measure is not None else 0
            shear = (gradient[0, 1] + gradient[1, 0]) / 2
            return ufl.as_matrix(
                [[gradient[0, 0], shear, 0], [shear, gradient[1, 1], 0], [0, 0, ring]]
            )

        def stress(y: Any) -> Any:
            lame = self.poisson / (1 - 2 * self.poisson) * ufl.tr(strain(y))
            return self.young / (1 + self.poisson) * (strain(y) + lame * ufl.Identity(3))

        L = ufl.inner(fem.Constant(mesh, np.zeros(dim)), v) * ufl.dx
        for name, pull in (("top", self.traction[0]), ("left", self.traction[1])):
            if (name == "top" and self.held) or (name == "left" and measure is not None):
                continue
            boundary = tagged.boundaries[self.named(name)]
            ds = ufl.ds(domain=mesh, subdomain_data=tagged.facet_tags, subdomain_id=boundary)
            L += factor * around * ufl.inner(fem.Constant(mesh, pull), v) * ds
        # The quadrature of UFL for y[0] / r is not that of the package.
        rule = {} if measure is None else {"quadrature_degree": strain_degree(V, AXISYMMETRIC)}
        if self.heat is not None:
            free, three_bulk = (
                self.heat[0] + self.heat[1] * x[0],
                self.young / (1 - 2 * self.poisson),
            )
            L += factor * around * three_bulk * free * ufl.tr(strain(v)) * ufl.dx(metadata=rule)
        bcs, moved = [], fem.Function(V)
        if self.held:
            bcs.append(
                fem.dirichletbc(
                    moved, fem.locate_dofs_topological(V, dim - 1, tagged.facets(self.named("top")))
                )
            )
        if measure is not None:
            dofs = fem.locate_dofs_topological(V.sub(0), dim - 1, tagged.facets("left"))
            bcs.append(fem.dirichletbc(0.0, dofs, V.sub(0)))
        if self.below is not None:
            held = fem.locate_dofs_topological(V, dim - 1, tagged.facets("low.bottom"))
            bcs.append(fem.dirichletbc(np.zeros(dim), held, V))
        law = self.friction
        common: dict[str, Any] = {"friction": law} | (
            {} if measure is None else {"measure": measure}
        )
        floor: Foundation | Pair
        if self.below is not None:
            sides = tagged.facets(self.named("bottom")), tagged.facets("low.top")
            floor = Pair(*sides, distance="nominal", gap=abs(self.gap[0]), friction=law)
        elif self.shape is None:
            floor = Foundation(
                tagged.facets(self.named("bottom")), gap=self.gap[0] + self.gap[1] * x[0], **common
            )
        else:
            floor = Foundation(
                tagged.facets(self.named("bottom")), gap=self.gap[0], shape=self.shape, **common
            )
        contact: list[Foundation | Pair] = [floor]
        if self.wall is not None:
            contact.append(Foundation(tagged.facets(self.named("right")), gap=self.wall, **common))

        def at(time: float) -> None:
            factor.value = np.interp(time, self.times, self.factors)
            moved.x.array.reshape(-1, dim)[:] = factor.value * self.down

        at(self.times[0])
        # A stress of forms is linear in the strain, without what heat would strain a free body by.
        given = stress if self.tells_stress and measure is None and self.heat is None else None
        return Forms(
            lambda y: ufl.inner(stress(y), strain(v)) * around * ufl.dx(metadata=rule),
            L,
            bcs,
            contact,
            given,
            at,
            V,
        )


@dataclass(frozen=True)
class Forms:
    """A problem in UFL."""

    inner: Callable[[Any], Any]  # a(y, v) of a displacement y
    L: Any  # the loads
    bcs: list[fem.DirichletBC]  # the supports
    contact: list[Foundation | Pair]  # the foundations
    stress: Any  # of a displacement; None: estimates do not know it
    at: Callable[[float], None]  # changes the problem to what it is at a time
    space: fem.FunctionSpace  # of the displacement


def by_forms(drawn: RandomProblem, forms: Forms) -> Solution:
    """Solve the forms at the load steps."""
    a = forms.inner(ufl.TrialFunction(forms.space))
    problem = ContactProblem(
        a, forms.L, forms.bcs, forms.contact, stress=forms.stress, **drawn.settings
    )

    def at(time: float) -> None:
        forms.at(time)
        if placement := drawn.placement(time):
            problem.place(0, **placement)

    try:
        return problem.run(LoadPath(drawn.times, steps=drawn.ramp), at)
    except ConvergenceError as error:
        return error.solution


def by_residual(drawn: RandomProblem, forms: Forms) -> list[tuple[Array, Any]]:
    """Solve the residual step by step: displacements and contact forces of each, up to the last
    that has a solution.
    """
    u, steps = fem.Function(forms.space), []
    F = forms.inner(u) - forms.L
    problem = NonlinearContactProblem(F, u, bcs=forms.bcs, contact=forms.contact, **drawn.settings)
    for time in drawn.times:
        forms.at(time)
        try:
            problem.solve()
        except ConvergenceError:
            break
        steps.append((u.x.array.copy(), problem.state.forces_of_each))
        problem.advance()
    return steps


def _largest(comm: MPI.Comm, values: Array) -> float:
    """Of all ranks."""
    return float(comm.allreduce(np.abs(values).max(initial=0.0), op=MPI.MAX))


def _forces(step: StepResult) -> Array:
    assert step.contact is not None
    return np.array(step.contact.forces_of_each, dtype=np.float64)


@dataclass(frozen=True)
class Sizes:
    """The largest value of all load steps."""

    displacement: float  # length
    force: float  # of contact or friction
    pressure: float  # stress

    @classmethod
    def of(cls, steps: list[StepResult], comm: MPI.Comm) -> Sizes:
        """Those of load steps with contact; collective."""
        return cls(
            max(_largest(comm, step.displacement.x.array) for step in steps),
            max(_largest(comm, _forces(step)) for step in steps),
            max(
                _largest(comm, step.contact.pressure) for step in steps if step.contact is not None
            ),
        )


@dataclass
class Differences:
    """What two fronts differ in."""

    comm: MPI.Comm  # the ranks
    found: list[str]  # in words

    def look(self, name: str, ours: Any, theirs: Any, size: float) -> None:
        """At two values of this rank, relative to a size; collective."""
        ours, theirs = np.asarray(ours, dtype=np.float64), np.asarray(theirs, dtype=np.float64)
        if self.comm.allreduce(ours.shape != theirs.shape, op=MPI.LOR):
            self.found.append(f"{name}: shapes {ours.shape} and {theirs.shape}")
        elif not (apart := _largest(self.comm, ours - theirs)) <= SAME * size:
            self.found.append(f"{name}: {apart / max(size, 1e-300):.1e}")

    def look_at_steps(self, solved: list[tuple[StepResult, StepResult]], sizes: Sizes) -> None:
        """At load steps of a scene and of forms; collective."""
        for number, (a, b) in enumerate(solved, 1):
            assert a.contact is not None
            assert b.contact is not None
            self.look(f"step {number}: time", a.time, b.time, 1.0)
            self.look(
                f"step {number}: displacement",
                a.displacement.x.array,
                b.displacement.x.array,
                sizes.displacement,
            )
            self.look(f"step {number}: force", _forces(a), _forces(b), sizes.force)
            self.look(
                f"step {number}: pressure", a.contact.pressure, b.contact.pressure, sizes.pressure
            )
            self.look(f"step {number}: states", a.contact.in_contact, b.contact.in_contact, 1.0)

    def look_at_tables(
        self, name: str, ours: ContactTable, theirs: ContactTable, sizes: Sizes
    ) -> None:
        """At all columns of two contact tables; collective."""
        if (a := list(ours.columns)) != (b := list(theirs.columns)):
            self.found.append(f"{name}: columns {a} and {b}")
            return
        for key, column in ours.columns.items():
            if column.dtype.kind == "U":
                apart = np.count_nonzero(column != theirs.columns[key])
                if apart and key != "boundary" and key != "against":  # which are numbered in forms
                    self.found.append(f"{name}: {key} of {apart} nodes")
                continue
            stress = key in ("pressure", "bound") or key.startswith("shear")
            scale = max(
                sizes.pressure if stress else sizes.displacement, np.abs(column).max(initial=0.0)
            )
            self.look(f"{name}: {key}", column, theirs.columns[key], scale)

    def look_at_quantities(
        self, scene: Solution, forms: Solution, keys: Collection[str], sizes: Sizes
    ) -> None:
        """At quantities, relative to the largest number of each, of forces and moments no less than
        that of all contacts; collective.
        """
        arm, dimension = scene.model.tagged.size, scene.model.dimension
        # The energy of a body that only moves as a whole is round-off of that of a body which is
        # strained as much.
        unstrained = (
            SAME * scene.model.statement.young * sizes.displacement**2 * arm ** (dimension - 2)
        )
        floors = {
            "force": sizes.force,
            "moment": sizes.force * arm,
            "energy": unstrained,
        }
        values_of_scene, values_of_forms = (
            of_results(solution) | of_fields(solution) for solution in (scene, forms)
        )
        for key in [key for key in keys if key in values_of_scene]:
            ours, theirs = (
                np.array(numbers_in(values.get(key)))
                for values in (values_of_scene, values_of_forms)
            )
            floor = floors.get(key.rsplit("_", 1)[-1], 0.0)
            self.look(key, ours, theirs, max(floor, np.abs(ours).max(initial=0.0)))

    def look_at_estimate(self, scene: Solution, forms: Solution) -> None:
        """At the estimated error; collective."""
        self.look(
            "estimated error",
            scene.stress.error or 0.0,
            forms.stress.error or 0.0,
            scene.stress.error or 1.0,
        )


def iterations(solution: Solution) -> list[tuple[int, ...]]:
    """What each linear solve has begun and ended with: load step, number, points in contact and
    slipping either way, and those that change.
    """
    return [
        (one.step, one.iteration, one.active_contact, one.slip_plus, one.slip_minus, one.changed)
        for one in solution.history.iterations
    ]


def numbers_in(value: Any) -> list[float]:
    """Those of a value of JSON, but where it has its largest one, as another place may have one
    that is as large, and the error of a stress, which is not known of forms: nobody says where a
    stress of theirs has no limit.
    """
    if isinstance(value, dict):
        parts = [part for key, part in value.items() if key not in ("place", "error")]
        return [number for part in parts for number in numbers_in(part)]
    if isinstance(value, list | tuple):
        return [number for part in value for number in numbers_in(part)]
    return [float(value)] if isinstance(value, int | float) else []


def compared(drawn: RandomProblem, comm: MPI.Comm = MPI.COMM_SELF) -> tuple[Status, list[str]]:
    """How the scene ends, and what the fronts differ in; collective."""
    scene = solve(parse_scene(drawn.stated()), comm, check=False)
    forms = drawn.forms(scene.model.tagged)
    other = by_forms(drawn, forms)
    ends = [
        f"{solution.status.value}, {len(solution.steps)} load steps" for solution in (scene, other)
    ]
    if ends[0] != ends[1]:
        return scene.status, [f"{ends[0]}; forms: {ends[1]}"]
    differences = Differences(comm, [])
    # An iteration without a solution to go to is one of round-off.
    if scene.converged and (ours := iterations(scene)) != (theirs := iterations(other)):
        differences.found.append(
            f"iterations: {len(ours)} and {len(theirs)} linear solves, or other sets"
        )
    solved = [
        (a, b)
        for a, b in zip(scene.steps, other.steps, strict=True)
        if a.status is Status.CONVERGED
    ]
    if not solved:
        return scene.status, differences.found
    sizes = Sizes.of([a for a, _ in solved], comm)
    differences.look_at_steps(solved, sizes)
    if scene.converged:
        differences.look_at_tables("table", scene.table, other.table, sizes)
    if scene.converged:
        keys = [
            *QUANTITIES,
            *(ENERGIES if drawn.heat is None else ()),
            *(() if forms.stress is None else STRESS),
        ]
        differences.look_at_quantities(scene, other, keys, sizes)
    if scene.converged and forms.stress is not None:
        differences.look_at_estimate(scene, other)
    # A residual does not say what its modulus is, the scale of gamma, and has shapes at the
    # displaced points.
    alone = drawn.shape is None and drawn.below is None and drawn.kind != "axisymmetric"
    if alone and drawn.ramp is None and "gamma_n" in drawn.settings:
        third = by_residual(drawn, forms)
        if len(third) != len(solved):
            differences.found.append(f"residual: {len(third)} of {len(solved)} load steps")
        for number, ((a, _), (u, forces)) in enumerate(zip(solved, third, strict=False), 1):
            differences.look(
                f"residual, step {number}: displacement",
                a.displacement.x.array,
                u,
                sizes.displacement,
            )
            differences.look(f"residual, step {number}: force", _forces(a), forces, sizes.force)
    return scene.status, differences.found


def main(count: int, first: int = 0) -> int:
    """Compare the fronts on all ranks, and print how many differ."""
    ends, wrong, comm = Counter[str](), 0, MPI.COMM_WORLD
    for seed in range(first, first + count):
        drawn = RandomProblem.drawn(seed)
        status, found = compared(drawn, comm)
        ends[status.value] += 1
        wrong += bool(found)
        if found and comm.rank == 0:
            print(
                f"seed {seed}: {drawn.kind}, {drawn.law[0]}, {drawn.settings}: "
                f"{'; '.join(found[:6])}",
                flush=True,
            )
    if comm.rank == 0:
        counts = ", ".join(f"{number} {end}" for end, number in ends.most_common())
        print(f"{count} problems on {comm.size} ranks, {wrong} with a difference; {counts}")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])))
