"""What a solve leaves behind: nothing, also for a collector of cycles that does not see into PETSc.

petsc4py built for Python's stable ABI hides from the collector what PETSc objects hold.  Therefore
the collector is off
here: what is freed is freed because nothing refers to it.  Only ``Function.interpolate`` of dolfinx
leaves a cycle of its own, which any collector sees.
"""

import gc
import weakref

import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI
from scene_tables import coulomb_friction, rectangle_mesh
from scenes import example1
from spaces import block

from signorini_fx.algebra.algorithms.ssn import SemismoothNewton
from signorini_fx.machine.petsc_objects import free_unused
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

pytestmark = pytest.mark.mpi
COMM = MPI.COMM_WORLD


@pytest.fixture
def counted(monkeypatch):
    """A function that counts meshes and solvers that are alive, and the communicators in use."""
    alive = {dmesh.Mesh: weakref.WeakSet(), SemismoothNewton: weakref.WeakSet()}
    for kind, known in alive.items():

        def noted(self, *args, _begin=kind.__init__, _known=known, **options):
            _begin(self, *args, **options)
            _known.add(self)

        monkeypatch.setattr(kind, "__init__", noted)
    gc.collect()
    gc.disable()

    def count(*, interpolated=False):
        assert not alive[SemismoothNewton]
        if interpolated:
            gc.collect()
        return len(alive[dmesh.Mesh]), communicators()

    yield count
    gc.enable()


def communicators():
    """A number that grows with that of the communicators in use.

    Every object of PETSc keeps the copy of the communicator that it lives on, and every mesh has
    several.  Open MPI has a table: new ones fill its holes, and the last one is behind all.  MPICH
    has room for a few thousand.
    """
    for _ in range(3):  # what is freed on several ranks may hold other objects
        free_unused(dmesh.create_unit_square(COMM, 2, 2))
    limited, new = MPI.get_vendor()[0] == "MPICH", []
    try:
        while limited or len(new) < 64:
            new.append(COMM.Dup())
    except MPI.Exception:
        pass
    number = -len(new) if limited else max(one.py2f() for one in new)
    for one in new:
        one.Free()
    return number


def ramp(**solver):
    """A block that is pressed on and pushed in three load steps."""
    return parse_scene(
        {
            "mesh": rectangle_mesh(6, 2),
            "material": {"young": 5000.0, "poisson": 0.3},
            "displacement": {
                "boundary": "top",
                "x": 0.002,
                "y": "-0.01 * (1 + 0.1 * x[0])",
                "factors": [0.5, 0.7, 1],
            },
            "contact": {"boundary": "bottom", "friction": coulomb_friction(0.3)},
            **solver,
        }
    )


def plane(**more):
    return example1(coefficient=0.3, nx=12, ny=4, **more)


SCENES = {
    "full": lambda: plane(linear_algebra="full"),
    "condensed": lambda: plane(linear_algebra="condensed"),
    "krylov": lambda: block(
        3, "tetrahedra", coefficient=0.3, gamma="auto", linear_algebra="krylov", comm=COMM
    ),
    "alm": lambda: plane(algorithm="alm"),
    "path-following": lambda: plane(algorithm="path-following", coulomb="newton"),
    "several steps": ramp,
    "several meshes": lambda: ramp(solver={"levels": 2}),
    "accuracy": lambda: ramp(accuracy={"target": 0.5}),
    "no solution": lambda: plane(max_iterations=1, fallbacks=False),
}
# Scenes with a prescribed displacement that varies.
INTERPOLATED = ("several steps", "several meshes", "accuracy")


@pytest.mark.one_quick("name", SCENES)
def test_nothing_is_left(name, counted):
    """With observers, and without them."""
    more = {"observers": [lambda record: None]}
    scene, interpolated = SCENES[name], name in INTERPOLATED
    assert solve(scene(), COMM, check=False).status.value  # a library may keep something once
    before = counted(interpolated=interpolated)
    for options in ({}, more) * (10 if name == "condensed" else 1):
        solution = solve(scene(), COMM, check=False, **options)
        assert solution.converged is (name != "no solution")
        del solution
        assert counted(interpolated=interpolated) == before


def test_nothing_is_left_of_a_nonlinear_body(counted):
    """But cycles, which any collector sees."""
    before = None
    for _ in range(3):
        assert solve(
            ramp(material={"law": "neo-hooke", "young": 5000.0, "poisson": 0.3}), COMM
        ).converged
        gc.collect()
        before = before or counted()
    assert counted() == before


@pytest.mark.one_quick("name", ["full", "condensed", "krylov", "several meshes"])
def test_nothing_is_left_of_an_error(name, counted):
    """An observer raises in the middle of a solve, on all ranks."""

    class Enough(Exception):
        pass

    def observe(record):
        observe.count += 1
        if observe.count == 3:
            raise Enough

    scene, interpolated = SCENES[name], name in INTERPOLATED
    before = None
    for _ in range(2):
        observe.count = 0
        raised = False
        try:
            solve(scene(), COMM, observers=[observe])
        except Enough:
            raised = True
        assert raised
        before = before or counted(interpolated=interpolated)
    assert counted(interpolated=interpolated) == before
