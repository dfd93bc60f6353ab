"""``ContactProblem``: forms of the user's own, against exact states, scenes, and an independent
judge.
"""

import runpy
from contextlib import contextmanager
from pathlib import Path

import forms
import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from forms import Block
from mpi4py import MPI
from on_meshes import no_load, trial_and_test, vector_space
from scene_tables import circle_shape, coulomb_friction

from signorini_fx import (
    ContactProblem,
    ConvergenceError,
    Coulomb,
    FormError,
    Foundation,
    LinearElastic,
    NoFriction,
    Tresca,
    read_scene,
    solve,
)
from signorini_fx.forms import solver
from signorini_fx.mechanics.mesh.tagged import TaggedMesh, tag_boundaries
from signorini_fx.records import Status
from signorini_fx.results import mechanics
from signorini_fx.results.certificate.certificate import Certificate
from signorini_fx.scenes.reading import parse_scene

COMM = MPI.COMM_WORLD
ROOT = Path(__file__).parents[2]
MATERIALS = ((1000.0, 0.3), (4000.0, 0.2))


def run(name):
    return runpy.run_path(str(ROOT / "demos" / "forms" / f"{name}.py"))


@contextmanager
def counted(monkeypatch, owner, name):
    """How often a function of a module or a class is called."""
    calls, original = [], getattr(owner, name)

    def count(*args, **kwargs):
        calls.append(name)
        return original(*args, **kwargs)

    with monkeypatch.context() as patch:
        patch.setattr(owner, name, count)
        yield calls


# --- gallery --------------------------------------------------------------------------------------


@pytest.mark.mpi
@pytest.mark.parametrize(
    "name", ["orthotropic_block", "winkler_springs", "heated_strip", "varying_modulus"]
)
def test_exact_states(name):
    """Uniform pressures to round-off."""
    found = run(name)
    pressures = found["found"] if "found" in found else [found["pressure"]]
    formulas = np.atleast_1d(found["formula"])
    assert len(pressures) == len(formulas)
    for pressure, formula in zip(pressures, formulas, strict=True):
        assert pressure == pytest.approx(formula, rel=1e-11)
    assert found["problem"].certificate.holds
    assert repr(found["problem"]).endswith("unknowns, converged>")


# --- time loops and changes -----------------------------------------------------------------------


@pytest.mark.mpi(slow=True)
@pytest.mark.one_quick("algorithm", ["auto", "alm"])
def test_own_loop_is_factors(algorithm):
    """The law is incremental: the steps of the scene, one by one."""
    given = read_scene(ROOT / "demos" / "scenes" / "press_and_slide.toml").model_dump(
        exclude_unset=True
    )
    given["mesh"]["parameters"] |= {"nx": 30, "ny": 10}
    given["solver"] = settings = {"gamma_n": 1e6, "gamma_t": 1e6, "algorithm": algorithm}
    factors = given["displacement"][1]["factors"] = given["displacement"][1]["factors"][:21]
    scene = parse_scene(given)
    solution = solve(scene, COMM)
    tagged = solution.model.tagged
    V = vector_space(tagged.mesh)
    u, v = trial_and_test(V)
    aside, top = fem.Constant(tagged.mesh, 0.0), tagged.facets("top")
    bcs = [
        fem.dirichletbc(value, fem.locate_dofs_topological(V.sub(k), 1, top), V.sub(k))
        for k, value in ((1, fem.Constant(tagged.mesh, -0.003)), (0, aside))
    ]
    floor = Foundation((tagged.facet_tags, tagged.boundaries["bottom"]), friction=Coulomb(0.3))
    nothing = ufl.inner(fem.Constant(tagged.mesh, (0.0, 0.0)), v) * ufl.dx
    problem = ContactProblem(forms.hooke(u, v, 5000.0), nothing, bcs, floor, **settings)
    for factor, step in zip(factors, solution.steps, strict=True):
        aside.value = 0.005 * factor
        y = problem.solve()
        problem.advance()
        assert np.abs(y.x.array - step.displacement.x.array).max(initial=0) <= 1e-12 * 0.005
        state = problem.state
        largest = COMM.allreduce(step.contact.pressure.max(initial=0), MPI.MAX)
        for name in ("pressure", "shear"):
            apart = np.abs(getattr(state, name) - getattr(step.contact, name)).max(initial=0)
            assert apart <= 1e-12 * largest, name
    assert problem.history.linear_solves == solution.history.linear_solves


def test_only_what_changes_is_assembled(monkeypatch):
    """And every change has its effect: the result is that of a fresh problem."""
    block = Block()
    gap, friction = (
        fem.Constant(block.mesh, 0.001),
        fem.Function(fem.functionspace(block.mesh, ("Lagrange", 1))),
    )
    friction.x.array[:] = 0.3
    direction = fem.Constant(block.mesh, (0.0, -1.0))
    floor = Foundation(block.bottom, gap=gap, friction=Coulomb(friction), direction=direction)
    problem = ContactProblem(block.a, block.L, list(block.bcs), floor)

    def change(constant, value):
        constant.value = value

    left = block.held(0, forms.side(block.mesh, 0, 0.0), fem.Constant(block.mesh, 0.0))
    changes = [
        ("nothing", lambda: None, (0, 0)),
        ("a load", lambda: change(block.load, -1.0), (0, 1)),
        ("a prescribed value", lambda: change(block.aside, 0.002), (0, 1)),
        ("the gap", lambda: change(gap, 0.002), (0, 0)),
        ("friction", lambda: friction.x.array.__setitem__(slice(None), 0.1), (0, 0)),
        ("the modulus", lambda: change(block.young, 500.0), (1, 1)),
        ("a condition", lambda: problem.bcs.append(left), (1, 1)),
        # The stiffness of the body stays: only the contact points are others.
        ("the direction", lambda: change(direction, (0.1, -1.0)), (0, 1)),
        ("the mesh", lambda: block.mesh.geometry.x.__imul__(1.1), (1, 1)),
    ]
    problem.solve()
    before = problem.u.x.array.copy()
    for name, act, expected in changes:
        act()
        with (
            counted(monkeypatch, solver, "elastic_body") as stiffness,
            counted(monkeypatch, solver, "case_of") as loads,
        ):
            y = problem.solve().x.array.copy()
        assert (len(stiffness), len(loads)) == expected, name
        assert (np.abs(y - before).max() > 1e-6) == (name != "nothing"), name
        fresh = ContactProblem(block.a, block.L, list(problem.bcs), floor).solve().x.array
        assert np.abs(y - fresh).max() <= 1e-7 * np.abs(fresh).max(), name
        before = y


def moved_foundation(block):
    """A plate that a force presses onto a block, and whose spring becomes stiffer."""
    plate = {
        "shape": "plane",
        "point": (0.0, 0.0),
        "normal": (0.0, 1.0),
        "pivot": (1.5, 0.0),
        "force": (0.0, 5.0),
        "prescribed": {"x": 0.0, "rotation": 0.0},
        "spring": {"y": 100.0},
    }
    stiffer = plate | {"spring": {"y": 1000.0}}
    given = [Foundation(block.bottom, shape=shape) for shape in (plate, stiffer)]
    return given, lambda problem: problem.place(0, spring={"y": 1000.0})


def turned_axes(block):
    """The floor is rougher along an axis, which is turned."""
    along = fem.Constant(block.mesh, (1.0, 0.0, 0.0))
    floor = Foundation(block.bottom, friction=Coulomb(0.1, ratio=0.2, along=along))
    return [floor, floor], lambda _: along.value.__setitem__(slice(None), (0.0, 1.0, 0.0))


@pytest.mark.parametrize(
    ("changed", "counts"), [(moved_foundation, (12, 4)), (turned_axes, (4, 3, 2))]
)
def test_what_changes_has_its_effect(changed, counts):
    """A spring of a foundation that a force moves, and axes of friction: the result is that of a
    fresh problem.
    """
    block = Block(counts)
    block.aside.value = 0.01
    (first, then), change = changed(block)
    problem = ContactProblem(block.a, block.L, block.bcs, first)
    before = problem.solve().x.array.copy()
    change(problem)
    after = problem.solve().x.array.copy()
    expected = ContactProblem(block.a, block.L, block.bcs, then).solve().x.array
    assert np.abs(expected - before).max() > 1e-4
    assert np.abs(after - expected).max() <= 1e-8 * np.abs(expected).max()


def test_coordinates_of_the_mesh_may_change():
    """Gaps, normals and areas are those of the moved mesh, as in a problem that is made on it."""
    found = []
    for solves_before in (True, False):
        block = Block((12, 4))
        floor = Foundation(block.bottom, gap=lambda x: 0.001 * x[0], friction=Coulomb(0.3))
        problem = ContactProblem(block.a, block.L, block.bcs, floor)
        if solves_before:
            problem.solve()
        x = block.mesh.geometry.x
        x[:, 1] -= 0.1 * x[:, 0]
        x[:, 0] *= 2.0
        u = problem.solve().x.array.copy()
        found.append((u, problem.state.boundary, problem.solution.model.scales.size))
    (ours, at, size), (expected, boundary, right) = found
    assert size == right
    assert np.abs(ours - expected).max() <= 1e-7 * np.abs(expected).max()
    assert np.allclose(at.x, boundary.x)
    assert np.allclose(at.normal, np.array([-0.05, -1.0]) / np.hypot(0.05, 1.0))


@pytest.mark.one_quick("settings", [{}, {"coulomb": "newton"}, {"linear_algebra": "full"}])
def test_places_that_are_tried_in_a_step(settings):
    """A circle on a block: wherever it has been since the last step, the result is that of its last
    place, and a place that is near the last one takes one or two linear solves.
    """

    def begun():
        block = Block((24, 8))
        bottom = fem.dirichletbc(
            np.zeros(2), fem.locate_dofs_topological(block.V, 1, block.bottom), block.V
        )
        circle = circle_shape((1.2, 1.5), 0.5)
        wheel = Foundation(block.top, shape=circle, friction=Coulomb(0.3))
        problem = ContactProblem(block.a, block.L, [bottom], wheel, **settings)
        problem.place(0, shift=(0.0, -0.03))
        problem.solve()
        problem.advance()
        return problem

    problem, direct = begun(), begun()
    for shift, most in ((0.5, None), (0.01, None), (0.0101, 2), (0.0102, 2), (0.0005, None)):
        before = problem.history.linear_solves
        problem.place(0, shift=(shift, -0.03))
        problem.solve()
        assert problem.certificate.worst < 1e-9
        assert most is None or problem.history.linear_solves - before <= most
    direct.place(0, shift=(0.0005, -0.03))
    direct.solve()
    assert np.abs(problem.u.x.array - direct.u.x.array).max() <= 1e-12 * 0.03


def test_what_is_not_certified_is_no_solution(monkeypatch):
    block = Block()
    monkeypatch.setattr(mechanics, "judged", lambda *given, **law: Certificate(equilibrium=1e-3))
    with pytest.raises(ConvergenceError, match="certificate does not hold"):
        block.problem.solve()
    assert block.problem.status is Status.NOT_CERTIFIED


# --- outcomes -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("load", "friction", "status"),
    [
        ((0.0, -1.0), None, Status.NOT_HELD),
        ((0.0, -1.0), NoFriction(), Status.NOT_HELD),
        ((0.5, -1.0), Coulomb(0.3), Status.SLIDES),
        ((0.0, 1.0), Coulomb(0.3), Status.OPEN),
    ],
)
def test_no_equilibrium(load, friction, status):
    block = Block()
    v = ufl.TestFunction(block.V)
    force = fem.Constant(block.mesh, load)
    problem = ContactProblem(
        block.a,
        ufl.inner(force, v) * ufl.dx,
        [],
        Foundation(block.bottom, friction=friction),
        u=fem.Function(block.V),
    )
    with pytest.raises(RuntimeError, match="no solution"):
        problem.advance()
    with pytest.raises(ConvergenceError, match=status.value) as caught:
        problem.solve()
    assert problem.status is status
    assert caught.value.solution is problem
    with pytest.raises(RuntimeError, match="no solution"):
        problem.advance()
    force.value = (0.05, -1.0)
    if status is not Status.NOT_HELD:
        assert problem.solve() is problem.u
        problem.advance()


@pytest.mark.one_quick("kind", [dmesh.CellType.tetrahedron, dmesh.CellType.hexahedron])
@pytest.mark.parametrize("degree", [1, 2])
@pytest.mark.mpi
def test_fields_on_all_elements(kind, degree):
    """Forces are the integrals of the fields, on any number of ranks; gap and slip are those of the
    displacement.
    """
    block = Block((4, 2, 2), degree, kind, friction=Coulomb(0.3), gap=lambda x: 0.002 * x[0])
    block.aside.value = 0.004
    problem = block.problem
    problem.solve()
    assert problem.certificate.holds
    tags = dmesh.meshtags(
        block.mesh, 2, np.sort(block.bottom), np.full(block.bottom.size, 1, dtype=np.int32)
    )
    ds = ufl.ds(domain=block.mesh, subdomain_data=tags)(1)
    whole = [
        COMM.allreduce(fem.assemble_scalar(fem.form(f * ds)))
        for f in (problem.pressure, -problem.shear[0])
    ]
    contact, friction = problem.state.forces
    assert whole == pytest.approx([contact[2], friction[0]], rel=1e-12)
    serial = Block((4, 2, 2), degree, kind, MPI.COMM_SELF, Coulomb(0.3), lambda x: 0.002 * x[0])
    serial.aside.value = 0.004
    serial.problem.solve()
    assert contact == pytest.approx(serial.problem.state.forces[0], rel=1e-8)


@pytest.mark.mpi(slow=True)
def test_stresses_of_two_materials():
    """They may jump from one to the other, as in a scene; without ``materials`` that is an
    error.
    """
    mesh = forms.box((2.0, 1.0), (8, 4), comm=COMM)
    own = tag_boundaries(mesh, {"bottom": "x[1] < 1e-9", "top": "x[1] > 1 - 1e-9"})
    cells = mesh.topology.index_map(2)
    every = np.arange(cells.size_local + cells.num_ghosts, dtype=np.int32)
    upper = dmesh.compute_midpoints(mesh, 2, every)[:, 1] > 0.5
    tags = dmesh.meshtags(mesh, 2, every, np.where(upper, 5, 3).astype(np.int32))
    settings, hooke = (
        {"gamma_n": 1e6, "gamma_t": 1e6},
        [LinearElastic(young=E, poisson=nu) for E, nu in MATERIALS],
    )
    scene = {
        "mesh": TaggedMesh(mesh, own.facet_tags, own.boundaries, tags, {"soft": 3, "stiff": 5}),
        "material": [
            {"young": one.young, "poisson": one.poisson, "region": region}
            for one, region in zip(hooke, ("soft", "stiff"), strict=True)
        ],
        "displacement": {"boundary": "top", "x": 0.001, "y": -0.01},
        "contact": {"boundary": "bottom", "gap": "0.004*x[0]", "friction": coulomb_friction(0.3)},
        "solver": settings,
    }
    theirs = solve(parse_scene(scene), COMM).stress
    V, Q = vector_space(mesh), fem.functionspace(mesh, ("DG", 0))
    lame, mu = fem.Function(Q), fem.Function(Q)
    for function, values in zip(
        (lame, mu), zip(*(one.lame for one in hooke), strict=True), strict=True
    ):
        function.x.array[Q.dofmap.list[:, 0]] = np.where(upper, values[1], values[0])
    u, v = trial_and_test(V)
    e = ufl.sym(ufl.grad(u))
    inside = 2 * mu * e + lame * ufl.tr(e) * ufl.Identity(2)
    whole = ufl.as_matrix(
        [[inside[0, 0], inside[0, 1], 0], [inside[1, 0], inside[1, 1], 0], [0, 0, lame * ufl.tr(e)]]
    )
    top = fem.locate_dofs_topological(V, 1, own.facets("top"))
    held = fem.dirichletbc(np.array([0.001, -0.01]), top, V)
    floor = Foundation(own.facets("bottom"), gap=lambda x: 0.004 * x[0], friction=Coulomb(0.3))
    given = (
        ufl.inner(inside, ufl.grad(v)) * ufl.dx,
        no_load(mesh, v),
        held,
        floor,
    )
    ours, mixed = (
        ContactProblem(*given, stress=whole, materials=one, **settings) for one in (tags, None)
    )
    for problem in (ours, mixed):
        problem.solve()
    expected = theirs.recovered.tensor.x.array
    assert np.abs(ours.stress.recovered.tensor.x.array - expected).max(initial=0) <= 1e-10 * 1000.0
    assert ours.stress.error == pytest.approx(theirs.error, rel=1e-10)
    assert mixed.stress.error > 1.2 * theirs.error
    for wrong, words in ((3, "MeshTags"), (own.facet_tags, "on the cells")):
        with pytest.raises(FormError, match=words):
            ContactProblem(*given, materials=wrong)


# --- bad input ------------------------------------------------------------------------------------


def bad(**changes):
    """Arguments of a problem, some of them replaced."""
    block = Block()
    u, v = ufl.TrialFunction(block.V), ufl.TestFunction(block.V)
    scalar = fem.functionspace(block.mesh, ("Lagrange", 1))
    other = vector_space(block.mesh, 2)
    cubic = vector_space(block.mesh, 3)
    away = fem.functionspace(forms.box((1.0, 1.0), [2, 2]), ("Lagrange", 1))
    inner = np.setdiff1d(
        np.arange(20, dtype=np.int32), dmesh.exterior_facet_indices(block.mesh.topology)
    )
    known = {
        "block": block,
        "unsymmetric": block.a + u[0].dx(1) * v[1] * ufl.dx,
        "nan": fem.Constant(block.mesh, np.nan) * block.a,
        "negative form": -block.a,
        "infinite load": fem.Constant(block.mesh, np.inf) * v[0] * ufl.dx,
        "nowhere": [block.held(0, block.top, fem.Constant(block.mesh, np.nan))],
        "scalar": ufl.inner(*trial_and_test(scalar)) * ufl.dx,
        "cubic": ufl.inner(*trial_and_test(cubic)) * ufl.dx,
        "elsewhere": ufl.inner(ufl.as_vector((0.0, 1.0)), ufl.TestFunction(other)) * ufl.dx,
        "other": fem.dirichletbc(
            np.zeros(2), fem.locate_dofs_topological(other, 1, block.top), other
        ),
        "inner": Foundation(inner),
        "none": Foundation(np.empty(0, dtype=np.int32)),
        "far": Foundation(np.array([10**6])),
        "words": Foundation("bottom"),
        "cells": Foundation((dmesh.meshtags(block.mesh, 2, np.arange(3, dtype=np.int32), 1), 1)),
        "away": Foundation(block.bottom, gap=fem.Function(away)),
        "twice": [block.foundation, Foundation(block.bottom)],
        "shape": Foundation(block.bottom, gap=ufl.SpatialCoordinate(block.mesh)),
        "normal": Foundation(block.bottom, gap=ufl.FacetNormal(block.mesh)[0]),
        "raises": Foundation(block.bottom, gap=lambda x: 1 / 0),
        "negative": Foundation(block.bottom, friction=Coulomb(lambda x: -0.1 + 0 * x[0])),
        "infinite": Foundation(block.bottom, friction=Tresca(lambda x: np.inf + x[0])),
        "law": Foundation(block.bottom, friction=0.3),
        "zero": Foundation(block.bottom, direction=(0.0, 0.0)),
        "measured": Foundation(block.bottom, measure=fem.Constant(block.mesh, -1.0)),
        "held": [*block.bcs, block.held(1, block.bottom, fem.Constant(block.mesh, 0.0))],
    }
    arguments = {"a": block.a, "L": block.L, "bcs": block.bcs, "contact": block.foundation}
    return arguments | {
        name: known.get(value, value) if isinstance(value, str) and name != "algorithm" else value
        for name, value in changes.items()
    }


@pytest.mark.one_quick(
    ("changes", "message"),
    [
        ({"a": "unsymmetric"}, "a: is not symmetric"),
        ({"a": "nan"}, "a: its matrix is not finite"),
        ({"a": "negative form"}, "a: is not positive"),
        ({"a": 3.0}, "a: must be a UFL form"),
        ({"L": "infinite load"}, "L: is not finite"),
        ({"bcs": "nowhere"}, "bcs: is not finite"),
        ({"u": 1}, "u: must be a Function"),
        ({"a": "scalar"}, "a: its space is"),
        ({"a": "cubic"}, "a: its space is"),
        ({"L": "elsewhere"}, "L: its arguments are on another space"),
        ({"L": None}, "L: must be a UFL form"),
        ({"bcs": [1]}, r"bcs\[0\]: must be a DirichletBC"),
        ({"bcs": "other"}, r"bcs\[0\]: is on another space"),
        ({"bcs": "held"}, r"contact\[0\]: bcs prescribe"),
        ({"contact": [3]}, r"contact\[0\]: must be a Foundation"),
        (
            {"contact": "inner"},
            r"contact\[0\].facets: \d+ of its \d+ facets are not on the boundary",
        ),
        ({"contact": "none"}, r"contact\[0\].facets: are empty"),
        ({"contact": "far"}, r"contact\[0\].facets: local numbers"),
        ({"contact": "words"}, r"contact\[0\].facets: local numbers"),
        ({"contact": "cells"}, r"contact\[0\].facets: the tags are on entities of dimension 2"),
        ({"contact": "twice"}, r"contact\[1\].facets: shares 12 facets"),
        ({"contact": "away"}, r"contact\[0\].gap: .*another mesh"),
        ({"contact": "shape"}, r"contact\[0\].gap: .*shape"),
        ({"contact": "normal"}, r"contact\[0\].gap: cannot be evaluated"),
        ({"contact": "raises"}, r"contact\[0\].gap: .*division by zero"),
        ({"contact": "negative"}, r"contact\[0\].friction.coefficient: is -0.1"),
        ({"contact": "infinite"}, r"contact\[0\].friction.bound: is inf"),
        ({"contact": "law"}, r"contact\[0\].friction: must be Coulomb"),
        ({"contact": "zero"}, r"contact\[0\].direction: is zero"),
        ({"contact": "measured"}, r"contact\[0\].measure: is -1 "),
        ({"algorithm": "sss"}, "algorithm: "),
        ({"levels": 3}, "levels: is no setting"),
        ({"kind": "mpi"}, "kind: is not used"),
        ({"gamma": 3}, "gamma: "),
        ({"algorithm": "path-following"}, "regularisation_error: must be a number"),
    ],
)
def test_bad_arguments_are_named(changes, message):
    with pytest.raises(FormError, match=f"^contact problem: {message}"):
        ContactProblem(**bad(**changes)).solve()


# --- random forms ---------------------------------------------------------------------------------


@pytest.mark.one_quick("seed", range(12))
def test_random_forms(seed):
    """Tensors, springs, supports, moduli and contacts at random, judged from a dense matrix."""
    assert forms.verdict(seed) == {}


# --- one rank, and input that is none -------------------------------------------------------------


@pytest.mark.mpi
def test_one_rank_reads_the_solution_alone():
    """After a solve and after load steps; the other ranks go on without it."""
    block = Block((6, 3), friction=Coulomb(0.3))
    for at in (block.problem.solve, lambda: block.problem.run([1.0], lambda time: None)):
        at()
        if COMM.rank == 0:
            assert block.problem.solution.converged
            assert block.problem.solution.findings == ()
    assert COMM.allreduce(1) == COMM.size


@pytest.mark.parametrize("contact", [np.arange(3), 5, "bottom"], ids=str)
def test_contact_that_is_no_foundation(contact):
    """Facets alone are not."""
    with pytest.raises(FormError, match=r"contact: must be Foundations and Pairs, .*Foundation\("):
        ContactProblem(*nothing(), contact=contact)


def nothing():
    """The forms of a block without a load."""
    mesh = forms.box((1.0, 1.0), (2, 2))
    V = vector_space(mesh)
    u, v = trial_and_test(V)
    return forms.hooke(u, v), no_load(mesh, v)


def test_a_gap_as_scenes_have_it():
    """Is text."""
    with pytest.raises(FormError, match=r"contact\[0\].gap: is text, .* give a number, a callable"):
        ContactProblem(*nothing(), contact=Foundation(np.arange(1), gap="0.001*x[0]"))


def test_paths_and_times_that_are_none():
    """One error that names what is expected."""
    problem = Block((4, 2)).problem
    problem.solve()
    with pytest.raises(TypeError, match="the path of a folder is expected, not int"):
        problem.write(5)
    with pytest.raises(TypeError, match="the path of a folder is expected, not int"):
        problem.run([1.0], lambda time: None, folder=5)
    with pytest.raises(FormError, match="path: must be times, or a LoadPath, not int"):
        problem.run(5, lambda time: None)
