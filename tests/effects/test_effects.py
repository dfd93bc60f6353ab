"""Only what a scene lists is compiled, assembled and solved; counted by the package, and behind its back."""

import tomllib
from dataclasses import dataclass, replace
from pathlib import Path

import dolfinx
import numpy as np
import pytest
from dolfinx import mesh as dmesh
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
TRESCA = {"law": "tresca", "bound": 0.5}
COULOMB = {"law": "coulomb", "coefficient": 0.3}
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


def test_elasticity_is_one_matrix_and_one_solve(count):
    """Bilinear form and load, one matrix, one factorisation, one solve, no Newton."""
    _, counts = count(ELASTIC)
    assert counts == Counts(("elasticity", "traction top"), 2, 1, 1, 40, 1, 1, 1, 0, 1)


def test_no_load_compiles_no_load_form(count):
    """Where displacements alone are prescribed, and where a traction is zero, there is only the elastic form."""
    pulled = {**ELASTIC, "displacement": [LEFT, {"boundary": "right", "x": 1e-3}]}
    for traction in ([], [{"boundary": "top"}], [{"boundary": "top", "x": 0.0, "y": 0.0, "pressure": 0.0}]):
        _, counts = count({**pulled, "traction": traction})
        assert counts == Counts(("elasticity",), 1, 1, 1, 40, 1, 1, 1, 0, 1)


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


def test_a_load_history_of_its_own_adds_a_load_form(count):
    """Loads with other factors make a second case: one more form, and one solve for each step with the same factor."""
    two = {"factors": [1.0, 2.0]}
    _, before = count({**ELASTIC, "traction": [{**TRACTION, **two}]})
    assert before == Counts(("elasticity", "traction top"), 2, 1, 1, 40, 2, 2, 1, 0, 1)
    _, after = count({**ELASTIC, "traction": [{**TRACTION, **two}], "body_force": {"y": -1.0}})
    assert changed(before, after) == {"named", "compiled"}
    assert after.compiled == before.compiled + 1


def test_load_steps_add_solves_only(count):
    """Five steps: five solves with one matrix, one solver and no further form."""
    _, one = count(ELASTIC)
    _, five = count({**ELASTIC, "traction": [{**TRACTION, "factors": [0.2, 0.4, 0.6, 0.8, 1.0]}]})
    assert five == replace(one, recorded_solves=5, linear_solves=5)


def test_a_second_material_adds_nothing(count):
    """The Lame parameters become functions; the form stays one, and so does the matrix."""
    tagged = in_two_parts(rectangle(nx=4, ny=3))
    one = {**ELASTIC, "material": [{"young": 5000.0, "poisson": 0.3}]}
    two = [{"young": young, "poisson": 0.3, "region": region} for young, region in ((5000.0, "a"), (500.0, "b"))]
    softened, counts = count({**ELASTIC, "material": two}, tagged)
    whole, before = count(one, tagged)
    assert counts == before
    assert softened.steps[0].strain_energy > 1.4 * whole.steps[0].strain_energy


def in_two_parts(tagged):
    """The same mesh with the regions a and b, left and right."""
    mesh = tagged.mesh
    cells = np.arange(mesh.topology.index_map(2).size_local + mesh.topology.index_map(2).num_ghosts, dtype=np.int32)
    left = dmesh.compute_midpoints(mesh, 2, cells)[:, 0] < 1.5
    tags = dmesh.meshtags(mesh, 2, cells, np.where(left, 1, 2).astype(np.int32))
    return replace(tagged, cell_tags=tags, regions={"a": 1, "b": 2})


def test_reduced_integration_adds_one_form(count):
    """The volumetric term on its own, assembled into the same matrix."""
    _, full = count(ELASTIC)
    _, reduced = count({**ELASTIC, "element": {"volumetric": "reduced"}})
    assert changed(full, reduced) == {"named", "compiled", "matrices"}
    assert reduced.named == ("elasticity", "reduced volumetric elasticity", "traction top")
    assert (reduced.compiled, reduced.matrices) == (3, 2)


def test_springs_add_one_form_to_the_same_matrix(count):
    """All springs together; one matrix more only where the springs alone hold the body, to find out what they hold."""
    springs = [{"boundary": "left", "normal": 7e3}, {"boundary": "right", "x": 5e3, "y": 2e3}]
    _, before = count(ELASTIC)
    _, after = count({**ELASTIC, "springs": springs})
    assert changed(before, after) == {"named", "compiled", "matrices"}
    assert after.named == ("elasticity", "springs left + springs right", "traction top")
    assert (after.compiled, after.matrices) == (3, 2)
    _, zero = count({**ELASTIC, "springs": [{"boundary": "left", "normal": 0.0}]})
    assert zero == before
    _, held = count({**ELASTIC, "displacement": [], "springs": springs})
    assert changed(after, held) == {"matrices"}
    assert held.matrices == 3


def test_loads_share_one_form(count):
    """One for all that do not depend on the time and one for the others; a total force needs one integral more."""
    _, before = count({**ELASTIC, "traction": []})
    heavy = {**ELASTIC["material"], "density": 2.0}
    constant = {
        "gravity": {"y": -1.0},
        "rotation": {"speed": 1.0},
        "fluid": {"boundary": "top", "level": 2.0, "weight": 1.0},
    }
    _, one = count({**ELASTIC, "material": heavy, **constant})
    assert changed(before, one) == {"named", "compiled"}
    assert one.named == ("elasticity", "gravity + rotation + traction top + fluid top")
    timed = {"boundary": "top", "level": "2*t", "weight": 1.0}
    _, two = count({**ELASTIC, "fluid": timed, "force": {"boundary": "right", "x": 1.0}})
    assert two.named == ("elasticity", "total of force right", "traction top + force right", "fluid top")
    assert changed(before, two) == {"named", "compiled"}


@pytest.mark.parametrize("volumetric", ["full", "reduced"])
def test_temperatures_share_one_form(count, volumetric):
    """And one more for the reduced volumetric term; they are a load case of their own, with the same matrix."""
    warm = {**ELASTIC["material"], "expansion": 1e-5}
    data = {**ELASTIC, "element": {"volumetric": volumetric}, "material": warm}
    _, before = count(data)
    _, zero = count({**data, "temperature": {"change": 0.0}})
    assert zero == before
    _, after = count({**data, "temperature": [{"change": 20.0}, {"change": "30 * x[0]"}]})
    assert changed(before, after) == {"named", "compiled"}
    name = "temperature + temperature"
    names = (name,) if volumetric == "full" else (name, f"reduced volumetric {name}")
    assert after.named == (*before.named, *names)


def test_contact_adds_its_form_and_an_iteration(count):
    """One form, which is assembled once into a vector; the matrix stays the elastic one, and no unknown is added."""
    _, before = count(ELASTIC)
    _, after = count(TOUCHING)
    assert changed(before, after) <= {"named", "compiled", *ITERATION}
    assert after.named == (*before.named, "contact bottom")
    assert after.compiled == before.compiled + 1
    assert after.newton_iterations == 1
    assert after.linear_solves == after.recorded_solves > 1


def test_a_second_contact_boundary_adds_its_form(count):
    """Form for form."""
    _, one = count(TOUCHING)
    _, two = count({**TOUCHING, "contact": [CONTACT, {"boundary": "right", "gap": 1e-4}]})
    assert changed(one, two) <= {"named", "compiled", *ITERATION}
    assert two.named == (*one.named, "contact right")
    assert two.compiled == one.compiled + 1


@pytest.mark.parametrize("friction", [TRESCA, COULOMB], ids=["tresca", "coulomb"])
def test_friction_adds_iterations_only(count, friction):
    """No form, no matrix, no unknown, no solver: the nodal weights of contact are those of friction."""
    solution, after = count({**ELASTIC, "contact": [{**CONTACT, "friction": friction}]})
    without, before = count(TOUCHING)
    assert changed(before, after) <= ITERATION
    assert after.linear_solves == after.recorded_solves
    shear = np.abs(solution.contact.shear).max()
    assert shear > 0.1
    assert np.abs(without.contact.shear).max() == 0.0


def test_coulomb_adds_a_newton_solve_for_each_bound(count):
    """The start, and one Tresca problem for each update of the bound."""
    solution, counts = count({**ELASTIC, "contact": [{**CONTACT, "friction": COULOMB}]})
    assert counts.newton_iterations == len(solution.history.outer) > 2


def test_the_monolithic_method_adds_one_solver(count):
    """Its tangent is unsymmetric and needs a factorisation of its own."""
    data = {**ELASTIC, "contact": [{**CONTACT, "friction": COULOMB}]}
    _, fixed_point = count(data)
    _, newton = count({**data, "solver": {"coulomb": "newton"}})
    assert changed(fixed_point, newton) <= {"solvers", *ITERATION}
    assert newton.solvers == fixed_point.solvers + 1
    assert newton.newton_iterations == 2


@pytest.mark.parametrize("algorithm", ["continuation", "alm"])
def test_algorithms_compile_nothing(count, algorithm):
    """They change the data of the same problem."""
    data = {**ELASTIC, "contact": [{**CONTACT, "friction": TRESCA}]}
    _, plain = count(data)
    _, other = count({**data, "solver": {"algorithm": algorithm}})
    assert changed(plain, other) <= {"solvers", *ITERATION}
    assert other.solvers == plain.solvers


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


def test_contact_that_is_removed_leaves_nothing_behind(count):
    """The counts of a scene do not depend on what was solved before."""
    _, first = count(ELASTIC)
    for contact in ([CONTACT], [{**CONTACT, "friction": COULOMB}], [CONTACT, {"boundary": "right", "gap": 1e-4}]):
        count({**ELASTIC, "contact": contact})
    _, last = count(ELASTIC)
    assert first == last


@pytest.mark.mpi
def test_ranks_add_nothing(count):
    """Every rank compiles, assembles and solves the same; a rank without contact facets does so too."""
    tagged = rectangle(MPI.COMM_WORLD, nx=6, ny=4)
    _, elastic = count(ELASTIC, tagged, MPI.COMM_WORLD)
    assert elastic == Counts(("elasticity", "traction top"), 2, 1, 1, 70, 1, 1, 1, 0, 1)
    _, contact = count({**ELASTIC, "contact": [{**CONTACT, "friction": TRESCA}]}, tagged, MPI.COMM_WORLD)
    assert changed(elastic, contact) <= {"named", "compiled", *ITERATION}
    assert contact.compiled == 3


@pytest.mark.parametrize("friction", [{"law": "none"}, TRESCA, COULOMB], ids=["none", "tresca", "coulomb"])
def test_records_know_the_factorisations(count, friction):
    """What the records say of factorisations is what PETSc did."""
    solution, counts = count({**ELASTIC, "contact": [{**CONTACT, "friction": friction}]})
    assert counts.factorisations == sum(record.factorised for record in solution.history.iterations)


def test_path_following(count):
    """Its error estimate projects the stress: three forms and a mass matrix, each once however long the path is."""
    data = {**ELASTIC, "contact": [{**CONTACT, "friction": TRESCA}]}
    _, counts = count({**data, "solver": {"algorithm": "path-following"}})
    assert counts.compiled == len(counts.named)
    assert counts.matrices == counts.matrices_named
