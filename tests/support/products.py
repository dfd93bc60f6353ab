"""Scenes with several features at once, drawn at random, and the plainest way to solve each of
them.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from mpi4py import MPI
from scene_tables import box_mesh, coulomb_friction, rectangle_mesh, tresca_friction
from spaces import box, rotation

from signorini_fx.records import StepRecord
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

FEATURES = (
    "restart",
    "ramp",
    "levels",
    "accuracy",
    "fall-back",
    "unequal gammas",
    "skew walls",
    "closed contact",
    "quadratic tetrahedra",
    "near incompressibility",
)
ALGEBRA = ("full", "condensed", "krylov")
_CLASHES = (
    {"skew walls", "levels"},  # a mesh of one's own has no coarser one
    {"skew walls", "accuracy"},
    {"skew walls", "closed contact"},
    {"closed contact", "quadratic tetrahedra"},
    {"levels", "accuracy"},  # accuracy chooses the meshes
    {"restart", "accuracy"},  # which keeps no checkpoint
    {"ramp", "fall-back"},  # a ramp finds its increments by the number of linear solves
    {"ramp", "accuracy"},  # a ramp finds other increments on each mesh
)
_YOUNG = 1000.0


class Killed(Exception):
    """The end of a run that is restarted."""


@dataclass(frozen=True)
class Product:
    """A scene and a way to solve it.

    Attributes:
        features: names of ``FEATURES``.
        law: table of the friction law.
        method: settings of the solver, the same on the plain way.
        algebra: one of ``ALGEBRA``.
        push: what the body is pushed with, relative to what it is pressed with.
        begun_alone: whether a run that is restarted on all ranks is begun on one.
    """

    features: frozenset[str]
    law: dict[str, object]
    method: dict[str, object]
    algebra: str
    push: float
    begun_alone: bool

    @classmethod
    def drawn(cls, seed: int) -> Product:
        """Two to four features that go together, the same for the same seed."""
        random = np.random.default_rng([7, seed])
        features: set[str] = {FEATURES[seed % len(FEATURES)]}
        wanted = int(random.integers(2, 5))
        for name in random.permutation(FEATURES):
            if len(features) < wanted and not any(
                clash <= features | {str(name)} for clash in _CLASHES
            ):
                features.add(str(name))
        law = [
            {"law": "none"},
            tresca_friction(round(float(random.uniform(0.5, 2.0)), 3)),
            coulomb_friction(round(float(random.uniform(0.1, 0.4)), 3)),
        ][int(random.integers(3))]
        methods: list[dict[str, object]] = [{}, {"algorithm": "alm"}, {"algorithm": "continuation"}]
        if law["law"] == "coulomb":
            methods.append({"coulomb": "newton"})
        method = methods[int(random.integers(len(methods)))]
        algebra = ALGEBRA[int(random.integers(3))]
        # Loose solves are more, which a ramp counts; multigrid is for compressible bodies.
        if algebra == "krylov" and features & {"ramp", "near incompressibility"}:
            algebra = "full"
        push = round(float(random.uniform(-0.3, 0.3)), 3)
        return cls(frozenset(features), law, method, algebra, push, bool(random.integers(2)))

    @property
    def name(self) -> str:
        """All of it in a line."""
        method = ", ".join(map(str, self.method.values())) or "ssn"
        return " + ".join((*sorted(self.features), str(self.law["law"]), method, self.algebra))

    def scene(self, comm: MPI.Comm, *, plain: bool = False):
        """The scene; ``plain``: on one mesh, by a sparse factorisation, with nothing that needs a
        fall-back.
        """
        has = self.features.__contains__
        space = has("quadratic tetrahedra") or has("skew walls")
        data = (
            self._in_space(comm)
            if space
            else self._hole()
            if has("closed contact")
            else self._in_the_plane()
        )
        stretch = 1e-3 if has("unequal gammas") else 1.0
        solver = {
            "tolerance": 1e-10,
            "gamma_n": 1e4 * _YOUNG,
            "gamma_t": 1e4 * stretch * _YOUNG,
            **self.method,
        }
        alone = (
            MPI.COMM_WORLD.size == 1
        )  # which condensing is for, and a run that is restarted keeps its settings
        solver["linear_algebra"] = (
            "full" if plain or (self.algebra == "condensed" and not alone) else self.algebra
        )
        if has("fall-back") and not plain:
            solver["sigma"] = 1e-4 / (
                stretch * _YOUNG
            )  # nodes jump from slip to slip, which cycles
        if has("levels") and not plain:
            solver["levels"] = 2
        if has("near incompressibility"):
            data["material"] = {**data["material"], "poisson": 0.4999}
            data.setdefault("element", {})["volumetric"] = "auto"
        if has("ramp"):
            data["load_steps"] = {"steps": 4}
        if has("accuracy"):
            data["accuracy"] = {"target": 0.3, "of": "energy", "refinement": "uniform"}
        return parse_scene({**data, "solver": solver})

    def _factors(self) -> list[float]:
        return [0.3, 1.0, 0.4] if self.features & {"ramp", "restart"} else [1.0]

    def _contact(self, boundary: str, gap: object) -> dict[str, object]:
        return {"boundary": boundary, "gap": gap, "friction": self.law}

    def _in_the_plane(self) -> dict[str, object]:
        """A block whose top is moved down and aside."""
        return {
            "mesh": rectangle_mesh(12, 4),
            "material": {"young": _YOUNG, "poisson": 0.3},
            "displacement": {
                "boundary": "top", "x": 0.02 * self.push, "y": "-0.02 + 0.001 * x[0]", "factors": self._factors(),
            },
            "contact": self._contact("bottom", "0.002 * (x[0] - 1.3)**2"),
        }  # fmt: skip

    def _hole(self) -> dict[str, object]:
        """A plate on a pin with a little clearance, whose sides are moved."""
        return {
            "mesh": {
                "generator": "plate_with_hole",
                "parameters": {"size": 1.2, "contact_size": 0.4},
            },
            "material": {"young": _YOUNG, "poisson": 0.3},
            "displacement": [
                {"boundary": "left", "x": 0.03, "y": 0.01 * self.push, "factors": self._factors()},
                {"boundary": "right", "x": 0.03, "y": 0.02 * self.push, "factors": self._factors()},
            ],
            "contact": self._contact("hole", 0.002),
        }

    def _in_space(self, comm: MPI.Comm) -> dict[str, object]:
        """A block whose top is moved; or between two walls across no axis, pushed along both of
        them.
        """
        quadratic = "quadratic tetrahedra" in self.features
        cells = (2, 2, 2) if quadratic else (4, 3, 3)
        data: dict[str, object] = {"material": {"young": _YOUNG, "poisson": 0.3}}
        if quadratic:
            data["element"] = {"degree": 2}
        if "skew walls" not in self.features:
            size = dict(zip(("nx", "ny", "nz"), cells, strict=True))
            cell = "tetrahedron" if quadratic else "hexahedron"
            gap = "0.003 * ((x[0] - 0.6)**2 + (x[1] - 0.5)**2)"
            return data | {
                "mesh": box_mesh(length=1.5, cell=cell, **size),
                "displacement": {
                    "boundary": "top", "x": 0.02 * self.push, "y": 0.003, "z": "-0.02 + 0.001 * x[0]",
                    "factors": self._factors(),
                },
                "contact": self._contact("bottom", gap),
            }  # fmt: skip
        back = rotation(0.9, (0.3, -0.8, 0.5))
        tagged = box(
            "tetrahedra" if quadratic else "hexahedra", cells, size=(1.5, 1.2, 1.0), comm=comm
        )
        tagged.mesh.geometry.x[:] = tagged.mesh.geometry.x @ back.T
        pushed = back @ [10.0 * self.push, 2.0, -10.0]
        return data | {
            "mesh": tagged,
            "displacement": [{"boundary": "left", "normal": 0.001}, {"boundary": "front", "normal": 0.0}],
            "traction": {"boundary": "top", **dict(zip("xyz", map(float, pushed), strict=True)),
                         "factors": self._factors()},
            "contact": self._contact("bottom", 0.0),
        }  # fmt: skip

    def solved(self, comm: MPI.Comm, folder: Path):
        """The solution, by way of a run that ends early if the product has a restart;
        collective.
        """
        if "restart" not in self.features:
            return solve(self.scene(comm), comm, check=False)
        if not self.begun_alone or comm.rank == 0:
            self._begin(MPI.COMM_SELF if self.begun_alone else comm, folder)
        comm.barrier()
        solution = solve(self.scene(comm), comm, check=False, checkpoint=folder, restart=True)
        assert solution.history.events[0].startswith("restart: 1 complete load step")
        return solution

    def _begin(self, comm: MPI.Comm, folder: Path) -> None:
        """A run that ends where its second load step on the last mesh begins."""
        last = 2 if "levels" in self.features else 1
        found = []

        def watch(record: object) -> None:
            found.append(record)
            meshes = 1 + sum(isinstance(one, str) and one.startswith("level ") for one in found)
            if isinstance(record, StepRecord) and record.step == 2 and meshes >= last:
                raise Killed

        with pytest.raises(Killed):
            solve(self.scene(comm), comm, check=False, checkpoint=folder, observers=[watch])

    def plainly(self):
        """The solution on this rank alone, of one mesh, in one go, by a sparse factorisation."""
        return solve(self.scene(MPI.COMM_SELF, plain=True), MPI.COMM_SELF, check=False)
