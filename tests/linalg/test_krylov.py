"""A Krylov method with multigrid gives the answers of a factorisation, for the price of about one
linear solve.
"""

from itertools import groupby

import forms
import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI
from on_meshes import trial_and_test, vector_space
from petsc4py import PETSc
from ranks import same_on_all_ranks
from scenes import alone, example1, prepared, same_answer, table_of
from spaces import LAWS, block, friction_of, pushed_brick

from signorini_fx import ContactProblem, Foundation
from signorini_fx.algebra.linalg import choice, factorisation, krylov, multigrid
from signorini_fx.mechanics.effects.displacement import Displacement
from signorini_fx.records import History, Status
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.mesh_sequence import MeshedScene
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve
from signorini_fx.solving import solve_on_mesh
from signorini_fx.solving.meshed_problem import solve_nested

WORLD = MPI.COMM_WORLD


def turned(**solver):
    """Half a disk, whose contact nodes have normals of their own, held by friction."""
    return parse_scene(
        {
            "mesh": {
                "generator": "half_disk",
                "parameters": {"radius": 1.0, "size": 0.2, "contact_size": 0.1},
            },
            "material": {"young": 5000.0, "poisson": 0.3},
            "traction": {"boundary": "top", "x": 0.5, "y": -5.0},
            "contact": {
                "boundary": "arc",
                "gap": 1e-3,
                "friction": {"law": "tresca", "bound": 1.0},
            },
            "solver": solver,
        }
    )


@pytest.fixture
def steps(monkeypatch):
    """Each Krylov solve: unknowns, kinds of the solver and its preconditioner, steps."""
    found = []
    configure = krylov.KrylovSystem.configure

    def watched(self, ksp, **how):
        def note(solver, b, _x):
            found.append(
                (
                    b.getSize(),
                    solver.getType(),
                    solver.getPC().getType(),
                    solver.getIterationNumber(),
                )
            )

        configure(self, ksp, **how)
        ksp.setPostSolve(note)

    monkeypatch.setattr(krylov.KrylovSystem, "configure", watched)
    return found


@pytest.fixture
def set_ups(monkeypatch):
    """Counts how many multigrid hierarchies are set up, by their unknowns."""
    sizes = []
    create = multigrid.Hierarchy.of

    def counted(matrix, level=None):
        sizes.append(matrix.getSize()[0])
        return create(matrix, level)

    monkeypatch.setattr(multigrid.Hierarchy, "of", counted)
    return sizes


def leaning(comm=MPI.COMM_SELF, **solver):
    """A brick that friction alone holds on a foundation whose normal is along no axis."""
    friction = friction_of(coefficient=0.5)
    contact = {"boundary": "bottom", "direction": [0.1, -0.2, -1.0], "friction": friction}
    return pushed_brick(comm, contact=contact, solver=solver)


def glued(**solver):
    """A brick that its foundation does not let go, pulled up and aside."""
    contact = {"boundary": "bottom", "kind": "bilateral", "friction": friction_of(bound=5.0)}
    load = {"boundary": "top", "x": 0.4, "z": 5.0}
    return pushed_brick(MPI.COMM_SELF, contact=contact, traction=load, solver=solver)


SCENES = {
    **{
        f"hexahedra, {law}": lambda law=law, **s: block(12, gamma=1e8, **LAWS[law], **s)
        for law in LAWS
    },
    **{
        f"tetrahedra, {law}": lambda law=law, **s: block(
            12, "tetrahedra", gamma=1e5, **LAWS[law], **s
        )
        for law in LAWS
    },
    "small gamma": lambda **s: block(12, bound=1.5, gamma=1e3, **s),
    "plane": lambda **s: example1(bound=1.5, nx=60, ny=20, **s),
    "plane, fixed point": lambda **s: example1(coefficient=0.5, nx=60, ny=20, **s),
    "nested": lambda **s: example1(coefficient=0.5, nx=60, ny=20, levels=3, **s),
    "bilateral": glued,
    "held by contact alone": lambda **s: pushed_brick(MPI.COMM_SELF, solver=s),
    "tilted, held by contact alone": turned,
    "leaning": leaning,
    "leaning, augmented": lambda **s: leaning(algorithm="alm", **s),
    "augmented, monolithic": lambda **s: block(
        12, gamma="auto", algorithm="alm", **LAWS["coulomb"], **s
    ),
    "augmented": lambda **s: block(12, bound=1.5, gamma=1e6, algorithm="alm", **s),
    "quadratic": lambda **s: example1(bound=1.5, nx=30, ny=10, degree=2, **s),
}


@pytest.mark.one_quick("name", SCENES)
def test_same_answer_as_a_factorisation(name, set_ups):
    """To 1e-8 of the largest, with one hierarchy for each mesh, whatever contact does on it."""
    ours, theirs = (alone(SCENES[name](linear_algebra=kind)) for kind in ("krylov", "full"))
    assert ours.linear_algebra.startswith("krylov")
    same_answer(ours, theirs)
    assert len(set_ups) == (3 if name == "nested" else 1)
    assert sorted(set(set_ups)) == sorted(set_ups)


def linear_solve(scene, steps):
    """Steps of CG for the same body held where it may touch, with multigrid set up for that, to the
    same residual.
    """
    held = (*scene.displacement, Displacement(boundary="bottom", x=0.0, y=0.0, z=0.0))
    alone(scene.model_copy(update={"displacement": held, "contact": ()}))
    return steps.pop()[3]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("cells", "laws"),
    [("hexahedra", ("none", "coulomb")), ("hexahedra", ("tresca",)), ("tetrahedra", tuple(LAWS))],
    ids=["hexahedra", "hexahedra, tresca", "tetrahedra"],
)
def test_about_one_linear_solve(cells, laws, steps):
    """On the finer of two meshes at most twice as many, whatever gamma is and whatever the law, and
    half as many again for what gamma leaves; and from one mesh to the next, eight times as large,
    they hardly grow.
    """
    for law in laws:
        for gamma in (1e5, 1e9):
            spent = []
            for nx in (12, 24):
                steps.clear()
                scenes = [
                    block(n, cells, gamma=gamma, linear_algebra="krylov", **LAWS[law])
                    for n in (nx // 2, nx)
                ]
                comm, history = MPI.COMM_SELF, History()
                meshes = [MeshedScene(comm=comm, history=history, scene=scene) for scene in scenes]
                assert solve_nested(meshes, 2, comm, history).converged
                finest = max(size for size, *_ in steps)
                spent.append(sum(count for size, *_, count in steps if size == finest))
                once = linear_solve(scenes[-1], steps)
                assert spent[-1] <= 2.5 * once
            assert spent[1] <= 1.3 * spent[0]


def test_a_finer_mesh_begins_with_the_displacement_of_the_coarser_one(monkeypatch):
    """With 316,899 unknowns in 3D its sets settle after five linear solves; from zero they take
    seven.
    """
    begun, begin = [], solve_on_mesh._displacement_of_coarser

    def noted(task, model):
        begun.append(begin(task, model))
        return begun[-1]

    monkeypatch.setattr(solve_on_mesh, "_displacement_of_coarser", noted)
    ended = alone(SCENES["nested"](linear_algebra="krylov")).displacement.x.array
    assert len(begun) == 2
    assert np.abs(ended - begun[-1]).max() < 0.05 * np.abs(ended).max()


def test_the_monolithic_method(steps):
    """Its tangent is unsymmetric, with entries as large as gamma; FGMRES takes few steps, and
    Newton few solves.
    """
    ours, theirs = (
        alone(block(12, gamma=1e9, linear_algebra=kind, **LAWS["coulomb"]))
        for kind in ("krylov", "full")
    )
    assert ours.algorithm == theirs.algorithm == "coulomb-newton"
    assert ours.history.events == []
    assert ours.history.linear_solves <= theirs.history.linear_solves + 4
    monolithic = [count for _, method, _, count in steps if method == "fgmres"]
    assert len(monolithic) >= 4
    assert max(monolithic) <= 15


@pytest.mark.parametrize(
    ("options", "method", "kind"),
    [
        ({}, "cg", "python"),
        ({"ksp_type": "minres"}, "minres", "python"),
        ({"pc_type": "gamg"}, "cg", "gamg"),
        ({"ksp_rtol": "1e-13"}, "cg", "python"),
        ({"pc_type": "cholesky", "ksp_type": "preonly"}, "preonly", "cholesky"),
    ],
)
def test_options_of_the_user_win(options, method, kind, steps):
    """The method, the preconditioner, the tolerance; the answer is that of a factorisation."""
    scene = block(6, bound=1.5, gamma=1e6, linear_algebra="krylov")
    reference = alone(
        scene.model_copy(
            update={"solver": scene.solver.model_copy(update={"linear_algebra": "full"})}
        )
    )
    table = PETSc.Options("sfx_")
    try:
        for name, value in options.items():
            table[name] = value
        steps.clear()
        solution = alone(scene)
    finally:
        for name in options:
            table.delValue(name)
    assert {(found, preconditioner) for _, found, preconditioner, _ in steps} == {(method, kind)}
    same_answer(solution, reference, share=1e-7)
    if "ksp_rtol" in options:  # no solve is loose
        assert min(count for *_, count in steps) >= 8


@pytest.mark.parametrize(
    ("coulomb", "kind"), [("fp", PETSc.KSP.Type.CG), ("newton", PETSc.KSP.Type.FGMRES)]
)
@pytest.mark.parametrize("enough", [True, False])
def test_what_fails_is_factorised(coulomb, kind, enough, monkeypatch):
    """A Krylov method that fails is replaced for the rest of the load step, if the memory is large
    enough.
    """
    usual, used = krylov.KrylovSystem.keep_factor, []

    def keep(self, ksp, *arguments, **how):
        kept = usual(self, ksp, *arguments, **how)
        if ksp.getType() in (kind, PETSc.KSP.Type.PREONLY):
            used.append(ksp.getType())
        ksp.setTolerances(max_it=1 if used == [kind, kind] else krylov.KRYLOV_STEPS)
        return kept

    def two_steps(linear_algebra):
        scene = block(
            6, coefficient=0.3, coulomb=coulomb, linear_algebra=linear_algebra, fallbacks=False
        )
        loads = tuple(load.model_copy(update={"factors": (1.0, 1.2)}) for load in scene.traction)
        return scene.model_copy(update={"traction": loads})

    monkeypatch.setattr(krylov.KrylovSystem, "keep_factor", keep)
    monkeypatch.setattr(krylov, "enough_memory", lambda comm, needed: enough)
    found = alone(two_steps("krylov"), check=False)
    if not enough:
        assert found.status is Status.LINEAR_SOLVER
        return
    assert "linear solver failed: the matrix is factorised" in found.history.events
    kinds = [name for name, _ in groupby(used)]
    assert kinds == [kind, PETSc.KSP.Type.PREONLY, kind]
    assert len(found.history.outer) > 2
    same_answer(found, alone(two_steps("full")))


def test_own_loops_try_again_after_a_failure(monkeypatch):
    """What fails in one solve of forms is factorised there, and not in the solves after it."""
    usual, used = krylov.KrylovSystem.keep_factor, []

    def keep(self, ksp, *arguments, **how):
        kept = usual(self, ksp, *arguments, **how)
        used.append(ksp.getType())
        ksp.setTolerances(max_it=1 if len(used) == 1 else krylov.KRYLOV_STEPS)
        return kept

    monkeypatch.setattr(krylov.KrylovSystem, "keep_factor", keep)
    monkeypatch.setattr(krylov, "enough_memory", lambda comm, needed: True)
    mesh = forms.box([1.0, 1.0], [8, 8], comm=MPI.COMM_SELF)
    space = vector_space(mesh)
    u, v = trial_and_test(space)
    top = fem.locate_dofs_topological(space, 1, forms.side(mesh, 1, 1.0))
    press = fem.Function(space)
    press.x.array[1::2] = -0.01
    contact = Foundation(forms.side(mesh, 1, 0.0))
    load = fem.Constant(mesh, [0.0, 0.0])
    problem = ContactProblem(
        forms.hooke(u, v),
        ufl.inner(load, v) * ufl.dx,
        [fem.dirichletbc(press, top)],
        contact,
        linear_algebra="krylov",
    )
    kinds = []
    for _ in range(3):
        problem.solve()
        kinds.append(used[-1])
        press.x.array[1::2] *= 1.5
    assert kinds == [PETSc.KSP.Type.PREONLY, PETSc.KSP.Type.CG, PETSc.KSP.Type.CG]


def test_chosen_for_large_bodies_in_space(monkeypatch):
    """By the number of unknowns in 3D, by memory anywhere; not near incompressibility, and not
    against the user.
    """

    def kind(scene):
        cost = check_scene(scene, MPI.COMM_SELF).cost
        d = assembled(scene)
        chosen = choice.choose_system(
            d.elasticity(d.cases), d.system_size(), scene.solver.linear_algebra
        )
        assert cost.linear_algebra == chosen[1]
        return cost.linear_algebra.partition(":")[0]

    def assembled(scene):
        return prepared(scene)

    plane, solid = example1(nx=96, ny=32), block(6, linear_algebra="auto")
    rubber = solid.model_copy(
        update={"material": (solid.material[0].model_copy(update={"poisson": 0.499}),)}
    )
    assert [kind(scene) for scene in (plane, solid, rubber)] == ["condensed", "full", "full"]
    monkeypatch.setattr(choice, "FEWEST_KRYLOV_UNKNOWNS", 100)
    assert [kind(scene) for scene in (plane, solid, rubber)] == ["condensed", "krylov", "full"]
    assert kind(block(6, linear_algebra="full")) == "full"
    table = PETSc.Options("sfx_")
    table["pc_type"] = "lu"
    try:
        assert kind(solid) == "full"
    finally:
        table.delValue("pc_type")
    monkeypatch.setattr(factorisation, "MEMORY_SHARE", 1e-9)
    assert [kind(scene) for scene in (plane, solid, rubber)] == ["krylov", "krylov", "krylov"]


RANKED = {
    "hexahedra": lambda comm: block(
        9, gamma=1e8, linear_algebra="krylov", comm=comm, **LAWS["tresca"]
    ),
    "tetrahedra": lambda comm: block(
        6, "tetrahedra", gamma=1e8, linear_algebra="krylov", comm=comm, **LAWS["coulomb"]
    ),
    "held by contact": lambda comm: pushed_brick(comm, solver={"linear_algebra": "krylov"}),
    "plane": lambda comm: example1(bound=1.5, nx=30, ny=10, linear_algebra="krylov"),
    "leaning, augmented": lambda comm: leaning(comm, algorithm="alm", linear_algebra="krylov"),
    "nested": lambda comm: example1(bound=1.5, nx=30, ny=10, levels=2, linear_algebra="krylov"),
}


@pytest.mark.mpi
@pytest.mark.one_quick("name", RANKED)
def test_one_rank_or_many(name, steps):
    """As many solves but for one, as many steps but for a fifth, and the same answer to 1e-8.

    What multigrid puts together at the borders of the parts differs, and so does what a loose solve
    leaves.
    """
    together = solve(RANKED[name](WORLD), WORLD)
    ours = same_on_all_ranks([count for *_, count in steps])
    steps.clear()
    single = alone(RANKED[name](MPI.COMM_SELF))
    theirs = [count for *_, count in steps]
    assert abs(len(ours) - len(theirs)) <= 1
    assert sum(ours) == pytest.approx(sum(theirs), rel=0.2)
    table, wanted = together.table.columns, single.table.columns
    round_off = 1e-14 * np.abs(single.displacement.x.array).max()
    for group, least in ((("u_n",), round_off), (("pressure", "shear"), 0.0)):
        close = max(1e-8 * max(np.abs(wanted[one]).max() for one in group), least)
        for one in group:
            np.testing.assert_allclose(table[one], wanted[one], rtol=0, atol=close, err_msg=one)


@pytest.mark.one_quick("algorithm", ["ssn", "alm"])
def test_condensed_with_turned_nodes(algorithm):
    """The dense matrix in the frames of the nodes, against the sparse one."""
    ours, theirs = (
        table_of(alone(turned(algorithm=algorithm, linear_algebra=k)))
        for k in ("condensed", "full")
    )
    for name in ("pressure", "shear"):
        close = 1e-7 * theirs.columns["pressure"].max()
        np.testing.assert_allclose(ours.columns[name], theirs.columns[name], rtol=0, atol=close)
