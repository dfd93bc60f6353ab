"""Only what a scene lists is compiled, assembled and solved; counted by the package, and behind its back."""

import tomllib
from dataclasses import dataclass, replace
from pathlib import Path

import dolfinx
import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc
from scenes import on_mesh, rectangle

from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.reading import parse_scene, read_scene
from signorini_fx.scenes.solver import solve

PETSc.Log.begin()
# A stage of its own: an error inside an event, as other tests provoke, leaves PETSc's count of it open for good.
STAGE = PETSc.Log.Stage("effects")

LEFT = {"boundary": "left", "x": 0.0, "y": 0.0}
TRACTION = {"boundary": "top", "y": -4.0}
CONTACT = {"boundary": "bottom", "gap": 1e-3}
ELASTIC = {"material": {"young": 5000.0, "poisson": 0.3}, "displacement": [LEFT], "traction": [TRACTION]}
TOUCHING = {**ELASTIC, "contact": [CONTACT]}


@dataclass(frozen=True)
class Counts:
    """What a solve made: as the package says, and as seen from outside."""

    named: tuple
    compiled: int
    matrices_named: int
    matrices: int
    unknowns: int
    recorded_solves: int
    linear_solves: int
    factorisations: int
    newton_iterations: int
    solvers: int


def events(*names):
    """How often PETSc began something in this module."""
    return np.array([PETSc.Log.Event(name).getPerfInfo(STAGE)["count"] for name in names])


@pytest.fixture(autouse=True)
def stage():
    """Count in the stage of this module."""
    STAGE.push()
    yield
    STAGE.pop()


class Spy:
    """Counts calls of dolfinx and PETSc, whoever makes them."""

    def __init__(self, monkeypatch):
        self.calls = {"jit": 0, "matrix": 0, "ksp": 0, "snes": 0}
        self.monkeypatch = monkeypatch
        # Everything that dolfinx compiles, forms and expressions, goes through here.
        self._watch(dolfinx.jit, "ffcx_jit", "jit")
        for module in (dolfinx.fem, dolfinx.fem.petsc):  # on one rank, on several
            self._watch(module, "assemble_matrix", "matrix")
        for name in ("KSP", "SNES"):
            monkeypatch.setattr(PETSc, name, self._counting(getattr(PETSc, name), name.lower()))

    def _watch(self, module, name, key):
        function = getattr(module, name)
        inside = []  # dolfinx 0.11 calls itself by the same name: one call of ours is one

        def counted(*arguments, **options):
            self.calls[key] += not inside
            inside.append(name)
            try:
                return function(*arguments, **options)
            finally:
                inside.pop()

        self.monkeypatch.setattr(module, name, counted)

    def _counting(self, kind, key):
        spy = self

        class Counting(kind):
            def create(self, comm=None):
                spy.calls[key] += 1
                return super().create(comm)

        return Counting


@pytest.fixture
def count(monkeypatch):
    """Solves a scene on a small mesh and counts."""
    spy = Spy(monkeypatch)

    def counted(data, tagged=None, comm=MPI.COMM_SELF):
        scene = on_mesh(
            parse_scene({"mesh": {"generator": "rectangle"}, **data}), tagged or rectangle(comm, nx=4, ny=3)
        )
        watched = ("KSPSolve", "SNESSolve", "MatCholFctrNum", "MatLUFactorNum")
        before, calls = events(*watched), dict(spy.calls)
        solution = solve(scene, comm, check=False)
        assert solution.converged, solution.status
        made = {name: spy.calls[name] - calls[name] for name in calls}
        linear, newton, cholesky, lu = events(*watched) - before
        inventory = solution.model.inventory
        return solution, Counts(
            named=tuple(inventory.forms),
            compiled=made["jit"],
            matrices_named=len(inventory.matrices),
            matrices=made["matrix"],
            unknowns=solution.model.dofs,
            recorded_solves=sum(step.linear_solves for step in solution.steps),
            linear_solves=int(linear),
            factorisations=int(cholesky + lu),
            newton_iterations=int(newton),
            solvers=made["ksp"] + made["snes"],
        )

    return counted


def changed(before, after):
    """The figures that differ."""
    return {name for name in Counts.__dataclass_fields__ if getattr(before, name) != getattr(after, name)}


ITERATION = {"recorded_solves", "linear_solves", "factorisations", "newton_iterations"}


def test_example_1_pays_for_what_it_lists(count):
    """Of 20 effects that a scene may list it has six, with three forms and a matrix."""
    file = Path(__file__).parents[2] / "demos" / "scenes" / "example1_tresca.toml"
    effects = check_scene(read_scene(file), MPI.COMM_SELF).effects
    assert (len(effects), sum(effect.on for effect in effects)) == (20, 6)
    data = {key: value for key, value in tomllib.loads(file.read_text(encoding="utf-8")).items() if key != "mesh"}
    _, counts = count(data, rectangle(MPI.COMM_SELF, length=3.0, nx=12, ny=4))
    assert counts.named == ("elasticity", "traction top", "contact bottom")
    assert (counts.compiled, counts.matrices_named, counts.matrices) == (3, 1, 1)


LOADS = {
    "body force": ({"body_force": {"y": -1.0}}, "body force + traction top"),
    "pressure": ({"traction": [{**TRACTION, "pressure": 2.0}]}, "traction top"),
    "second traction": ({"traction": [TRACTION, {"boundary": "right", "x": 1.0}]}, "traction top + traction right"),
    "expression": ({"traction": [{"boundary": "top", "y": "-4 * x[0]"}]}, "traction top"),
}


@pytest.mark.parametrize("effect", LOADS)
def test_a_load_adds_a_term_to_the_load_form(count, effect):
    """And nothing else: no form, no matrix, no solve."""
    data, name = LOADS[effect]
    _, before = count(ELASTIC)
    _, after = count({**ELASTIC, **data})
    assert after == replace(before, named=("elasticity", name))
    _, removed = count(ELASTIC)
    assert removed == before


def test_contact_adds_its_form_and_an_iteration(count):
    """One form, which is assembled once into a vector; the matrix stays the elastic one, and no unknown is added."""
    _, before = count(ELASTIC)
    _, after = count(TOUCHING)
    assert changed(before, after) <= {"named", "compiled", *ITERATION}
    assert after.named == (*before.named, "contact bottom")
    assert after.compiled == before.compiled + 1
    assert after.newton_iterations == 1
    assert after.linear_solves == after.recorded_solves > 1


NO_FRICTION = {
    "no coefficient": {"law": "coulomb", "coefficient": 0.0},
    "no bound": {"law": "tresca", "bound": 0.0},
    "no cap": {"law": "coulomb", "coefficient": 0.3, "cap": 0.0},
    "none": {"law": "none"},
}


@pytest.mark.one_quick
@pytest.mark.parametrize("law", NO_FRICTION)
@pytest.mark.parametrize("algorithm", ["ssn", "alm"])
def test_friction_that_cannot_act_is_no_friction(count, law, algorithm):
    """F = 0 and g = 0 take the frictionless path: the same counts, the same bits, the same records."""
    settings = {"solver": {"algorithm": algorithm}}
    plain, before = count({**TOUCHING, **settings})
    other, after = count({**ELASTIC, **settings, "contact": [{**CONTACT, "friction": NO_FRICTION[law]}]})
    assert after == before
    assert other.algorithm == plain.algorithm
    assert [replace(r, seconds=0.0) for r in other.history.iterations] == [
        replace(r, seconds=0.0) for r in plain.history.iterations
    ]
    for name in ("pressure", "shear", "u_n", "u_t"):
        assert np.array_equal(getattr(other.contact, name), getattr(plain.contact, name)), name
    assert np.array_equal(other.displacement.x.array, plain.displacement.x.array)
