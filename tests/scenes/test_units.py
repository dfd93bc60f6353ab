"""Nothing depends on the units of length and force: the formulas of ``scales``, and generated scenes in other units.

Lengths and forces are multiplied by powers of ten, each apart; every setting of the solver is a share of the scales of
the scene, so that the same linear solves lead to the same result.
"""

from dataclasses import fields, replace
from itertools import product

import numpy as np
import pytest
from dolfinx import mesh as dmesh
from mpi4py import MPI
from scenes import alone, example1
from spaces import CELLS

from signorini_fx.algebra.linalg.assembled import AssembledSystem
from signorini_fx.mechanics.body.discretisation import discretise
from signorini_fx.mechanics.effects.displacement import PrescribedDisplacement
from signorini_fx.mechanics.mesh.tagged import generate_mesh, tag_boundaries
from signorini_fx.mechanics.scales import Scales
from signorini_fx.records import History, Status, Timings
from signorini_fx.results.certificate.certificate import Certificate, certify
from signorini_fx.results.certificate.law_of_method import Law, Tractions
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve
from signorini_fx.solving.solve_on_mesh import contact_task

YOUNG = 5000.0
PLANE = {"triangles": dmesh.CellType.triangle, "quadrilaterals": dmesh.CellType.quadrilateral}
ELEMENTS = list(product((*PLANE, *CELLS), (1, 2)))
LAWS = ("none", "tresca", "coulomb", "cap", "bilateral")
ALGORITHMS = ("ssn", "continuation", "path-following", "alm")
WAYS = ("fp", "newton")
LINEAR_ALGEBRA = ("full", "condensed", "krylov")
# (length, force): what a unit of length and of force is in other units.
UNITS = [(10.0**length, 10.0**force) for length in (-12, 0, 12) for force in (-12, 0, 12) if (length, force) != (0, 0)]


def body(cells, degree, length=1.0, comm=MPI.COMM_SELF):
    """A block without symmetry, named before it is scaled."""
    if cells in PLANE:
        ends, shape = [(0.0, 0.0), (3.0, 1.0)], (8, 3) if degree == 1 else (4, 2)
        mesh, up = dmesh.create_rectangle(comm, ends, shape, PLANE[cells]), 1
    else:
        ends, shape = [(0.0, 0.0, 0.0), (3.0, 1.3, 1.0)], (4, 3, 2) if degree == 1 else (3, 2, 1)
        mesh, up = dmesh.create_box(comm, ends, shape, CELLS[cells]), 2
    sides = {
        "left": lambda x: x[0] < 1e-9,
        "right": lambda x: x[0] > 3 - 1e-9,
        "bottom": lambda x: x[up] < 1e-9,
        "top": lambda x: x[up] > 1 - 1e-9,
    }
    tagged = tag_boundaries(mesh, sides)
    mesh.geometry.x[:] *= length
    return tagged


def block(element, law="none", length=1.0, force=1.0, comm=MPI.COMM_SELF, **solver):
    """The block pressed and pulled on a foundation that is nearest at one side; supports that move."""
    stress, tagged = force / length**2, body(*element, length, comm)
    friction = {
        "none": {"law": "none"},
        "tresca": {"law": "tresca", "bound": 1.1 * stress},
        "coulomb": {"law": "coulomb", "coefficient": 0.3},
        "cap": {"law": "coulomb", "coefficient": 0.4, "cap": 3.0 * stress},
        "bilateral": {"law": "tresca", "bound": 0.7 * stress},
    }[law]
    space = tagged.dimension == 3
    return parse_scene(
        {
            "mesh": tagged,
            "element": {"degree": element[1]},
            "material": {"young": YOUNG * stress, "poisson": 0.3},
            "displacement": [
                {"boundary": "left", "x": 0.0002 * length, **({"y": 0.0} if space else {})},
                {"boundary": "right", "x": -0.0001 * length},
            ],
            "traction": {"boundary": "top", "x": 1.7 * stress, "z" if space else "y": -12.0 * stress}
            | ({"y": 2.9 * stress} if space else {}),
            "contact": {
                "boundary": "bottom",
                "kind": "bilateral" if law == "bilateral" else "unilateral",
                "gap": lambda x: length * (0.002 * (x[0] / length - 1.1) ** 2 + 0.0007 * x[1] / length + 0.0001),
                "friction": friction,
            },
            "solver": solver,
        }
    )


def counts(solution):
    """Linear solves of each problem, and the sets of each solve."""
    sets = [(r.active_contact, r.slip_plus, r.slip_minus, r.changed) for r in solution.history.iterations]
    return solution.algorithm, [record.linear_solves for record in solution.history.outer], sets


def close(ours, theirs, unit):
    """Equal to 1e-9 of the largest value."""
    np.testing.assert_allclose(np.asarray(ours) / unit, theirs, rtol=0, atol=1e-9 * np.abs(theirs).max())


def assert_same(there, here, length, force):
    """The solution in other units, with the same counts."""
    assert (there.status, counts(there)) == (here.status, counts(here))
    stress, dim = force / length**2, here.model.tagged.dimension
    close(there.displacement.x.array, here.displacement.x.array, length)
    close(there.contact.pressure, here.contact.pressure, stress)
    if here.contact.has_friction:
        close(there.contact.shear, here.contact.shear, stress)
    assert there.certificate.strain_energy == pytest.approx(
        here.certificate.strain_energy * stress * length**dim, rel=1e-9
    )


def settings(algorithm, way, linear_algebra):
    return {"algorithm": algorithm, "coulomb": way, "linear_algebra": linear_algebra}


def possible(element, law, algorithm, way, linear_algebra):
    """The way of Coulomb friction is one where there is none."""
    return way == "fp" or law == "coulomb"


EVERY = [
    combination for combination in product(ELEMENTS, LAWS, ALGORITHMS, WAYS, LINEAR_ALGEBRA) if possible(*combination)
]


def covering():
    """Few combinations among which are all pairs of two choices that are possible, found greedily."""
    pairs = {c: {((i, c[i]), (j, c[j])) for i in range(5) for j in range(i)} for c in EVERY}
    left, chosen = set().union(*pairs.values()), []
    while left:
        best = max(EVERY, key=lambda c: len(pairs[c] & left))  # the first of several
        chosen.append(best)
        left -= pairs[best]
    return chosen


COVERING = covering()


def named(combination):
    (cells, degree), *rest = combination
    return "-".join((f"{cells}{degree}", *rest))


@pytest.mark.one_quick
@pytest.mark.parametrize("number", range(len(COVERING)), ids=[named(c) for c in COVERING])
def test_other_units(number):
    """Each pair of element, law, algorithm and linear algebra, in two of the eight systems of units."""
    element, law, *rest = COVERING[number]
    here = alone(block(element, law, **settings(*rest)))
    for length, force in (UNITS[number % 8], UNITS[(number + 3) % 8]):
        assert_same(alone(block(element, law, length, force, **settings(*rest))), here, length, force)


@pytest.mark.long
@pytest.mark.parametrize("combination", EVERY, ids=named)
def test_every_combination_in_every_unit(combination):
    """The whole product."""
    element, law, *rest = combination
    here = alone(block(element, law, **settings(*rest)))
    for length, force in UNITS:
        assert_same(alone(block(element, law, length, force, **settings(*rest))), here, length, force)


def test_the_covering_covers():
    """A few combinations, and among them every choice with every other one that it can be combined with."""
    assert 10 * len(COVERING) < len(EVERY)
    found, wanted = (
        {(i, c[i], j, c[j]) for c in combinations for i in range(5) for j in range(5)}
        for combinations in (COVERING, EVERY)
    )
    assert found == wanted


# --- the formulas of dimension, and where they are used ---------------------------------------------------------------


@pytest.mark.parametrize("dim", [2, 3])
def test_formulas(dim):
    """A body of the size 7 in one unit of length, and of the modulus 5 in one unit of force, in all others."""
    for length, force in UNITS:
        stress, energy, area = force / length**2, force * length ** (dim - 2), length ** (dim - 1)
        here, there = Scales(dim, 5.0, 7.0), Scales(dim, 5.0 * stress, 7.0 * length)
        for ours, theirs, unit in (
            (there.gamma, here.gamma, stress / length),
            (there.spacing(11), here.spacing(11), length),
            (there.side(np.array(3.0 * area)), here.side(np.array(3.0)), length),
            (there.stiffness(2.0 * length), here.stiffness(2.0), stress * area / length),
            (there.stress(13.0 * energy), here.stress(13.0), stress),
            (there.deflection(0.2 * stress), here.deflection(0.2), length),
        ):
            assert ours == pytest.approx(theirs * unit, rel=1e-12)


def test_formulas_of_a_cube():
    """A stretched cube of the side 2 with E = 5: the energy is 2^3 sigma^2 / (2 E), the area of a side 4."""
    scales = Scales(3, 5.0, 2.0)
    assert scales.stress(8 * 0.3**2 / (2 * 5.0)) == pytest.approx(0.3)
    assert scales.side(np.array(4.0)) == pytest.approx(2.0)
    assert (scales.spacing(8), scales.stiffness(0.5), scales.deflection(0.5)) == pytest.approx((1.0, 2.5, 0.2))


SMALL = [("quadrilaterals", 1), ("tetrahedra", 1)]


def disturbed(element, law, shake, length, force):
    """The certificate of a result that is wrong by noise."""
    scene = block(element, law, length, force)
    d = discretise(scene.statement, load_mesh(scene, MPI.COMM_SELF), Timings())
    rng, stress = np.random.default_rng(3), force / length**2
    y = d.function(d.stiffness.createVecRight())
    y.x.array[:] = length * shake(rng, y.x.array.shape)
    n = d.boundary.size
    tractions = (
        (0.0, 0.0) if law == "none" else (rng.uniform(-1.0, 12.0, n), rng.uniform(-1.0, 1.0, d.boundary.x.shape))
    )
    pressure, shear = (stress * np.zeros((n, *np.shape(values)[1:])) + stress * values for values in tractions)
    if law == "none":
        shear = np.zeros(d.boundary.x.shape)
    gamma = 1e6 * stress / length
    return certify(
        scene.statement,
        d.tagged,
        y,
        Tractions(d.boundary.part, d.boundary.nodes, pressure, shear),
        law=Law(gamma, gamma),
    )


@pytest.mark.one_quick
@pytest.mark.parametrize("element", SMALL, ids=str)
@pytest.mark.parametrize(
    ("law", "shake", "accuracy"),
    [
        ("tresca", lambda rng, shape: 1e-3 * rng.uniform(-1.0, 1.0, shape), 1e-9),
        # A motion that is as good as rigid, on which everything but round-off is zero.
        ("none", lambda rng, shape: 1e-3 + 1e-14 * rng.integers(-1, 2, shape), 1e-3),
    ],
    ids=["violated", "at round-off"],
)
def test_figures_of_the_certificate(element, law, shake, accuracy):
    """Each of them is a share: the same in all units."""
    here = disturbed(element, law, shake, 1.0, 1.0)
    names = [
        field.name for field in fields(Certificate) if field.name not in ("law", "strain_energy", "potential_energy")
    ]
    assert here.equilibrium > 0
    for length, force in UNITS:
        there = disturbed(element, law, shake, length, force)
        for name in names:
            assert getattr(there, name) == pytest.approx(getattr(here, name), rel=accuracy), (name, length, force)


@pytest.mark.one_quick
@pytest.mark.parametrize("element", SMALL, ids=str)
@pytest.mark.parametrize("linear_algebra", LINEAR_ALGEBRA)
def test_the_size_of_the_forces(element, linear_algebra):
    """What residuals are compared with: forces on the unknowns that nothing prescribes, but those of a rigid motion,
    and no displacement times E.
    """
    found = []
    for length, force in [(1.0, 1.0), *UNITS]:
        scene = block(element, "none", length, force, linear_algebra=linear_algebra)
        d = discretise(scene.statement, load_mesh(scene, MPI.COMM_SELF), Timings())
        task = contact_task(d, History())
        problem = task.iterate.newton.problem
        assert task.iterate.newton.solve(task.start.data, task.start.sets) is Status.CONVERGED
        system, work = task.system, task.iterate.x.duplicate()
        system.matrix.mult(task.iterate.x, work)
        rigid, lifted = system.start.copy(), work.duplicate()
        rigid.getArray()[system.contact.fixed] = 0.0
        system.matrix.mult(rigid, lifted)
        forces = [(vector - lifted).getArray()[~system.contact.fixed] for vector in (work, system.load)]
        forces = [np.linalg.norm(part) for part in forces]
        assert problem.force_scale == pytest.approx(max(forces), rel=1e-6)
        diagonal = d.stiffness.getDiagonal().getArray()
        assert set(diagonal[d.fixed]) == {diagonal[~d.fixed].max()}
        found.append(
            (
                problem.force_scale / force * (length if element[0] in PLANE else 1.0),
                system.contact.stiffness(system.matrix.getDiagonal()).max() / force * length**3,
            )
        )
    np.testing.assert_allclose(found, np.tile(found[0], (len(found), 1)), rtol=1e-9)


# --- bodies that were judged wrongly ----------------------------------------------------------------------------------


@pytest.mark.parametrize("unit", [1.0, 1e-3])
def test_a_block_that_its_support_lifts_off(unit):
    """300 mm long, in millimetres and in metres: all of its forces are round-off."""
    mesh = dmesh.create_box(
        MPI.COMM_SELF, [(0.0, 0.0, 0.0), (300.0, 100.0, 100.0)], (6, 4, 4), dmesh.CellType.tetrahedron
    )
    tagged = tag_boundaries(mesh, {"bottom": lambda x: x[2] < 1e-6, "top": lambda x: x[2] > 100 - 1e-6})
    mesh.geometry.x[:] *= unit
    scene = parse_scene(
        {
            "mesh": tagged,
            "material": {"young": YOUNG / unit**2, "poisson": 0.3},
            "displacement": {"boundary": "top", "x": 0.01 * unit, "y": 0.02 * unit, "z": 0.05 * unit},
            "contact": {"boundary": "bottom"},
        }
    )
    solution = alone(scene)
    assert not solution.contact.in_contact.any()
    assert solution.certificate.displacement == pytest.approx(np.sqrt(30.0) * 0.01 / np.sqrt(110000.0))


@pytest.mark.parametrize("length", [1.0, 1e-9])
def test_a_cone_that_is_violated(length):
    """Coulomb friction that was iterated once is none, however small the body is."""
    scene = block(("hexahedra", 1), "coulomb", length, length**2, algorithm="alm", tolerance=0.1)
    cones = [
        alone(
            block(("hexahedra", 1), "coulomb", unit, unit**2, algorithm="alm", tolerance=0.1), check=False
        ).certificate.friction_cone
        for unit in (1.0, length)
    ]
    assert scene.solver.tolerance == 0.1
    assert cones[0] > 1e-6
    assert cones[1] == pytest.approx(cones[0], rel=1e-6)


@pytest.mark.mpi
@pytest.mark.parametrize("cells", CELLS)
def test_a_steel_block_of_ten_millimetres_on_ranks(cells):
    """In metres, by Krylov's method: results of one rank and of several agree as promised.

    While the sets change it stops early, and levels by aggregation depend on the ranks: the sets in between may differ.
    """
    units = {"length": 0.01 / 3, "force": 2.1e11 / YOUNG * (0.01 / 3) ** 2, "linear_algebra": "krylov"}
    together, here = solve(block((cells, 1), comm=MPI.COMM_WORLD, **units)), alone(block((cells, 1), **units))
    algorithm, solves, sets = counts(together)
    assert (algorithm, solves, sets[-1]) == (*counts(here)[:2], counts(here)[2][-1])
    ours, theirs = (np.sort(solution.table.columns["pressure"]) for solution in (together, here))
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-9 * theirs.max())


@pytest.mark.parametrize("law", ["none", "coulomb"])
def test_krylov_steps_have_no_unit(law):
    """Nor has the preconditioner: a stiffness of 1e-21 leads to as many steps as any other."""
    here, there = [], []
    for found, length, force in ((here, 1.0, 1.0), (there, 1e12, 1e-12)):
        scene = block(("tetrahedra", 1), law, length, force, linear_algebra="krylov", coulomb="newton")
        alone(scene, on_progress=lambda progress, found=found: found.append((progress.solve, progress.krylov)))
    assert here == there


# --- numbers that are none --------------------------------------------------------------------------------------------


@pytest.mark.one_quick
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("where", ["displacement", "pressure", "shear"])
@pytest.mark.parametrize("element", SMALL, ids=str)
@pytest.mark.parametrize("every", [False, True], ids=["one of them", "all of them"])
def test_not_a_number_in_a_result(value, where, element, every):
    """The certificate does not hold, and says so without an error."""
    solution = alone(block(element, "tresca"))
    tractions = Tractions.of(solution.contact)
    place = slice(None) if every else 1
    if where == "displacement":
        solution.displacement.x.array[place] = value
    else:
        values = getattr(tractions, where).copy()
        values[place] = value
        tractions = replace(tractions, **{where: values})
    with np.errstate(all="ignore"):
        found = certify(solution.statement, solution.model.tagged, solution.displacement, tractions)
    assert not found.holds


@pytest.mark.parametrize("element", SMALL, ids=str)
def test_not_a_number_in_an_iterate(element):
    """Of a body whose sets must be repaired, because pressures that are no numbers open all contact: the iteration ends
    by name.
    """
    scene = block(element)
    d = discretise(scene.statement, load_mesh(scene, MPI.COMM_SELF), Timings())
    task = contact_task(d, History())
    newton = task.iterate.newton
    newton.pose(task.start.data, task.start.sets)
    assert newton.problem.sets.contact.all()
    newton.x.set(np.nan)
    assert newton.solve(task.start.data) is Status.NOT_FINITE


@pytest.mark.parametrize(
    ("spoil", "status"),
    [
        (lambda system: system.matrix.scale(0.0), Status.SINGULAR),
        (lambda system: system.matrix.scale(np.inf), Status.NOT_FINITE),
        (lambda system: system.load.set(np.nan), Status.NOT_FINITE),
    ],
    ids=["no stiffness", "infinite stiffness", "a load that is no number"],
)
@pytest.mark.parametrize("linear_algebra", ["full", "condensed"])
def test_what_a_solve_cannot_do(linear_algebra, spoil, status):
    """A matrix that breaks down is told from numbers that were not finite before."""
    scene = example1(nx=6, ny=2, linear_algebra=linear_algebra)
    d = discretise(scene.statement, load_mesh(scene, MPI.COMM_SELF), Timings())
    task = contact_task(d, History())
    spoil(task.system)
    with np.errstate(all="ignore"):
        assert task.iterate.newton.solve(task.start.data) is status


@pytest.mark.parametrize(("value", "status"), [(np.nan, Status.SINGULAR), (1e308, Status.NOT_FINITE)])
def test_what_a_solve_gives(value, status):
    """No number, of a matrix whose factorisation breaks down without a word; or more than forces can be computed of."""
    scene = example1(nx=6, ny=2, linear_algebra="full")
    d = discretise(scene.statement, load_mesh(scene, MPI.COMM_SELF), Timings())
    task = contact_task(d, History())
    newton = task.iterate.newton
    newton.snes.getKSP().setPostSolve(lambda ksp, b, x: x.set(value))
    with np.errstate(all="ignore"):
        assert newton.solve(task.start.data) is status


def test_forces_that_are_no_numbers_without_contact(monkeypatch):
    """The outcome has the same name."""
    monkeypatch.setattr(AssembledSystem, "set_load", lambda system, *_: system.load.set(np.inf))
    held = (PrescribedDisplacement(boundary="top", x=0.0, y=0.0),)
    scene = example1(nx=6, ny=2).model_copy(update={"contact": (), "displacement": held})
    with np.errstate(all="ignore"):
        assert alone(scene, check=False).status is Status.NOT_FINITE


@pytest.mark.parametrize("exponent", [-50, -20, 50])
@pytest.mark.parametrize("cell", ["hexahedron", "tetrahedron"])
def test_a_box_of_any_size(cell, exponent):
    """The same nodes, to the last bit where the unit is a power of two."""
    unit = 2.0**exponent
    counts = {"nx": 3, "ny": 2, "nz": 2, "cell": cell}
    here, there = (
        generate_mesh("box", {"length": 3.1 * size, "width": 0.7 * size, "height": 1.3 * size, **counts}, MPI.COMM_SELF)
        for size in (1.0, unit)
    )
    np.testing.assert_array_equal(there.mesh.geometry.x, unit * here.mesh.geometry.x)
