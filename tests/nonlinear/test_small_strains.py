"""Digits of nonlinear bodies at strains of any size: such a body is a linear one up to its strain,
or a finding tells how large errors may be.
"""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from on_meshes import at_coordinate, vector_space
from scene_tables import coulomb_friction, fixed, floor, rectangle_mesh
from scenes import alone
from support.nonlinear_scenes import LAWS, block, material

from signorini_fx import ConvergenceError, NonlinearContactProblem, Scene, Status

SCALES = [10.0**-power for power in (3, 8, 12)]
# Terms of the strain beside it: of Saint Venant-Kirchhoff 3.5 strains in the block below.
BESIDE = 10.0
# Round-off of a linear solve, and what an iteration of the exact contact law leaves.
ROUND_OFF, LEFT_BY_CONTACT = 1e-12, 2e-8


def linear_twin(law):
    """The linear material that one of ``LAWS`` is at rest."""
    rest = block(material(law), "t").statement.material[0].at_rest
    return {"young": rest.young, "poisson": rest.poisson}


def apart(one, other):
    """The largest relative difference of two displacements."""
    values, others = (np.array(solution.displacement.x.array) for solution in (one, other))
    return np.abs(values - others).max() / np.abs(others).max()


def of_digits(solution):
    """The findings on digits."""
    return [found for found in solution.findings if "round-off" in found.message]


@pytest.mark.one_quick("law", LAWS)
def test_a_block_under_a_load_of_any_size(law):
    """It is as far from the linear one as its strain, which round-off of I + grad u would hide from
    1e-8 on.
    """
    for scale in SCALES:
        loads = {
            "displacement": [fixed("bottom")],
            "traction": [{"boundary": "top", "x": 30.0 * scale, "y": -100.0 * scale}],
        }
        solution, linear = (
            alone(Scene(mesh=block(one, "t").mesh, material=one, **loads), check=False)
            for one in (material(law), linear_twin(law))
        )
        assert apart(solution, linear) <= BESIDE * scale + ROUND_OFF
        assert not of_digits(solution)


@pytest.mark.slow
@pytest.mark.parametrize("contact", ["plane", "kept partners", "sliding"])
def test_contact_at_displacements_of_any_size(contact):
    """Gaps of the undeformed bodies keep their digits; what is met at displaced points has those of
    its coordinates, and a finding says how many.
    """
    large = rectangle_mesh(7, 2, length=1.5, height=0.5)
    small = rectangle_mesh(6, 3, length=1.0, height=0.5)
    plate = floor()
    rough = {"friction": coulomb_friction(0.3)}
    for scale in SCALES:
        if contact == "plane":
            one = {
                "mesh": small,
                "displacement": [fixed("left", "x")],
                "traction": [{"boundary": "top", "y": -100.0 * scale}],
                "contact": [{"boundary": "bottom", "foundation": plate} | rough],
            }
        else:
            sliding = {"sliding": "small"} if contact == "kept partners" else {}
            one = {
                "body": [
                    {"name": "u", "mesh": small, "shift": [0.2, 0.5]},
                    {"name": "l", "mesh": large},
                ],
                "displacement": [
                    {"boundary": "u.top", "x": 0.2 * scale, "y": -0.5 * scale},
                    fixed("l.bottom"),
                ],
                "contact": [{"boundary": "u.bottom", "against": "l.top"} | sliding | rough],
            }
        pairs = []
        for law in (material("neo-hooke"), linear_twin("neo-hooke")):
            entries = [
                {key: value for key, value in entry.items() if key != "sliding" or "law" in law}
                for entry in one["contact"]
            ]
            scene = Scene(**{**one, "contact": entries}, material=law, solver={"algorithm": "alm"})
            pairs.append(alone(scene, check=False))
        error = apart(*pairs)
        known = BESIDE * scale + LEFT_BY_CONTACT
        told = of_digits(pairs[0])
        if contact == "kept partners":
            assert error <= known
            assert not told
        else:
            placed = pairs[0].certificate.placed
            assert error <= known + placed
            assert bool(told) == (placed > 1e-6)


def lossy(h, one):
    """The strain of a residual that adds I to grad u."""
    return one + h, ((one + h).T * (one + h) - one) / 2


def own_block(change, scale, comm=MPI.COMM_SELF):
    """A block of Saint Venant-Kirchhoff's material with a residual of one's own, its load, and a
    linear one.

    Args:
        change: gives F and E from grad u and I.
        scale: of the load.
        comm: the ranks.
    """
    mesh = dmesh.create_rectangle(comm, [[0, 0], [1, 0.5]], [6, 3], dmesh.CellType.quadrilateral)
    space = vector_space(mesh)
    u, v, identity = fem.Function(space), ufl.TestFunction(space), ufl.Identity(2)
    mu, lame = 100 / 2.6, 100 * 0.3 / (1.3 * 0.4)
    top = np.sort(dmesh.locate_entities_boundary(mesh, 1, at_coordinate(1, 0.5)))
    ds = ufl.Measure(
        "ds",
        mesh,
        subdomain_data=dmesh.meshtags(mesh, 1, top, np.full(top.size, 1, dtype=np.int32)),
    )
    load = fem.Constant(mesh, (30.0 * scale, -100.0 * scale))
    held = fem.locate_dofs_geometrical(space, at_coordinate(1, 0.0))
    bcs = [fem.dirichletbc(np.zeros(2), held, space)]

    def hooke(strain):
        return 2 * mu * strain + lame * ufl.tr(strain) * identity

    gradient, strain = change(ufl.grad(u), identity)
    work = ufl.inner(gradient * hooke(strain), ufl.grad(v)) * ufl.dx - ufl.inner(load, v) * ds(1)
    nonlinear = NonlinearContactProblem(work, u, bcs=bcs)
    work = ufl.inner(hooke(ufl.sym(ufl.grad(u))), ufl.grad(v)) * ufl.dx - ufl.inner(load, v) * ds(1)
    return nonlinear, load, NonlinearContactProblem(work, u, bcs=bcs)


def along(problem, load, factors):
    """Load steps with these factors of the load."""
    full = load.value.copy()

    def apply(time):
        load.value[:] = full * np.interp(time, range(len(factors)), factors)

    return problem.run(np.arange(1.0, len(factors)), apply)


@pytest.mark.one_quick("scale", [1e-15, 3e-15])
@pytest.mark.parametrize("factors", [None, (0, 1), (0, 0.8, 1), (0, 1, 0), (0, 0, 1)])
def test_a_body_of_which_no_digit_is_known(scale, factors):
    """The check after the solve would accept the body at rest: the outcome has a name, of a solve
    and of load steps, and there are no figures of it.
    """
    problem, load, _ = own_block(lossy, scale)
    with pytest.raises(ConvergenceError, match=r"result below round-off: .*[Rr]ound-off"):
        problem.solve() if factors is None else along(problem, load, factors)
    assert problem.status is Status.NO_DIGIT
    if factors is None:
        assert not problem.u.x.array.any()
    else:
        assert problem.solution.status is Status.NO_DIGIT
        at_rest = factors[1] == 0.0  # a first step without load is solved
        ended = Status.CONVERGED if at_rest else Status.NO_DIGIT
        assert [step.status for step in problem.solution.steps] == [ended]


@pytest.mark.one_quick("advances", [True, False])
@pytest.mark.parametrize(
    "change", [lossy, lambda h, one: (one, ufl.sym(h))], ids=["finite", "linear"]
)
def test_steps_without_load(change, advances):
    """A body that nothing moves is where it was; a loop that ends at rest, too, whether the
    residual has the round-off of I + grad u or none but that of the displacement.
    """
    problem, load, _ = own_block(change, 1e-3)
    full = load.value.copy()
    for factor in (0.0, 1.0, 0.0, 0.0, 1e-14, 0.0):
        load.value[:] = factor * full
        problem.solve()
        assert problem.status is Status.CONVERGED
        assert factor or np.abs(problem.u.x.array).max() < 1e-16
        if advances:
            problem.advance()
    problem, load, _ = own_block(change, 0.0)
    assert along(problem, load, (0, 1, 1)).converged
    assert not problem.u.x.array.any()


def test_metal_that_flows_does_not_lock():
    """Where it flows it keeps its volume, whatever its ratio is: 'auto' reduces, and the force of a
    squeezed layer between rough plates is that of 'reduced', far below that of all points.
    """
    size = {"length": 8.0, "height": 1.0, "nx": 16, "ny": 2}
    forces = {}
    for volumetric in ("full", "auto", "reduced"):
        scene = Scene(
            mesh=rectangle_mesh(**size),
            material={"law": "j2", "young": 210e3, "poisson": 0.3, "yield_stress": 250.0},
            displacement=[
                fixed("bottom", "y"),
                fixed("left", "x"),
                {"boundary": "top", "x": 0.0, "y": "-0.05*t"},
            ],
            element={"volumetric": volumetric},
            load_steps={"times": [0.2, 0.4, 0.6]},
        )
        forces[volumetric] = -alone(scene).resultants.of("top").force[1]
    assert forces["auto"] == forces["reduced"]
    assert forces["reduced"] < 0.8 * forces["full"]
