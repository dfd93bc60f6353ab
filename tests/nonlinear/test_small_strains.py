"""Digits of nonlinear bodies at strains of any size: such a body is a linear one up to its strain, or a finding tells
how large errors may be.
"""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from mpi4py import MPI
from support.nonlinear_scenes import LAWS, block, material

from signorini_fx import NonlinearContactProblem, Scene, solve

SCALES = [10.0**-power for power in (3, 7, 8, 10, 12, 14)]
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


@pytest.mark.parametrize("law", LAWS)
def test_a_block_under_a_load_of_any_size(law):
    """It is as far from the linear one as its strain, which round-off of I + grad u would hide from 1e-8 on."""
    for scale in SCALES:
        loads = {
            "displacement": [{"boundary": "bottom", "x": 0.0, "y": 0.0}],
            "traction": [{"boundary": "top", "x": 30.0 * scale, "y": -100.0 * scale}],
        }
        solution, linear = (
            solve(Scene(mesh=block(one, "t").mesh, material=one, **loads), MPI.COMM_SELF, check=False)
            for one in (material(law), linear_twin(law))
        )
        assert apart(solution, linear) <= BESIDE * scale + ROUND_OFF
        assert not of_digits(solution)


@pytest.mark.parametrize("contact", ["plane", "kept partners", "sliding"])
def test_contact_at_displacements_of_any_size(contact):
    """Gaps of the undeformed bodies keep their digits; what is met at displaced points has those of its coordinates,
    and a finding says how many.
    """
    large = {"generator": "rectangle", "parameters": {"length": 1.5, "height": 0.5, "nx": 7, "ny": 2}}
    small = {"generator": "rectangle", "parameters": {"length": 1.0, "height": 0.5, "nx": 6, "ny": 3}}
    plate = {"shape": "plane", "point": [0.0, 0.0], "normal": [0.0, 1.0]}
    rough = {"friction": {"law": "coulomb", "coefficient": 0.3}}
    for scale in SCALES:
        if contact == "plane":
            one = {
                "mesh": small,
                "displacement": [{"boundary": "left", "x": 0.0}],
                "traction": [{"boundary": "top", "y": -100.0 * scale}],
                "contact": [{"boundary": "bottom", "foundation": plate} | rough],
            }
        else:
            sliding = {"sliding": "small"} if contact == "kept partners" else {}
            one = {
                "body": [{"name": "u", "mesh": small, "shift": [0.2, 0.5]}, {"name": "l", "mesh": large}],
                "displacement": [
                    {"boundary": "u.top", "x": 0.2 * scale, "y": -0.5 * scale},
                    {"boundary": "l.bottom", "x": 0.0, "y": 0.0},
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
            pairs.append(solve(scene, MPI.COMM_SELF, check=False))
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


def own_residual(change, scale):
    """A block of Saint Venant-Kirchhoff's material with a residual of one's own, and its displacement by a linear one.

    Args:
        change: gives F and E from grad u and I.
        scale: of the load.
    """
    mesh = dmesh.create_rectangle(MPI.COMM_SELF, [[0, 0], [1, 0.5]], [6, 3], dmesh.CellType.quadrilateral)
    space = fem.functionspace(mesh, ("Lagrange", 1, (2,)))
    u, v, identity = fem.Function(space), ufl.TestFunction(space), ufl.Identity(2)
    mu, lame = 100 / 2.6, 100 * 0.3 / (1.3 * 0.4)
    top = np.sort(dmesh.locate_entities_boundary(mesh, 1, lambda x: np.isclose(x[1], 0.5)))
    ds = ufl.Measure("ds", mesh, subdomain_data=dmesh.meshtags(mesh, 1, top, np.full(top.size, 1, dtype=np.int32)))
    load = fem.Constant(mesh, (30.0 * scale, -100.0 * scale))
    held = fem.locate_dofs_geometrical(space, lambda x: np.isclose(x[1], 0.0))
    bcs = [fem.dirichletbc(np.zeros(2), held, space)]

    def hooke(strain):
        return 2 * mu * strain + lame * ufl.tr(strain) * identity

    gradient, strain = change(ufl.grad(u), identity)
    work = ufl.inner(gradient * hooke(strain), ufl.grad(v)) * ufl.dx - ufl.inner(load, v) * ds(1)
    nonlinear = NonlinearContactProblem(work, u, bcs=bcs)
    nonlinear.solve()
    values = u.x.array.copy()
    work = ufl.inner(hooke(ufl.sym(ufl.grad(u))), ufl.grad(v)) * ufl.dx - ufl.inner(load, v) * ds(1)
    u.x.array[:] = 0.0
    linear = NonlinearContactProblem(work, u, bcs=bcs)
    linear.solve()
    assert not linear.findings
    error = np.abs(values - u.x.array).max() / np.abs(u.x.array).max()
    return nonlinear, load, error


def test_a_residual_of_ones_own_that_loses_digits():
    """The difference of F^T F and I has the round-off of one: the error that it may cause is told, and is not smaller
    than the one that there is; a strain from grad u has none.
    """
    for scale in SCALES:
        lossy, _, error = own_residual(lambda h, one: (one + h, ((one + h).T * (one + h) - one) / 2), scale)
        assert error <= BESIDE * scale + lossy.certificate.lost + ROUND_OFF
        assert bool(lossy.findings) == (lossy.certificate.lost > 1e-6)
        assert lossy.findings or scale > 1e-8
        careful, _, error = own_residual(lambda h, one: (one + h, (h + h.T + h.T * h) / 2), scale)
        assert error <= BESIDE * scale + ROUND_OFF
        assert not careful.findings


def test_a_body_that_comes_back_to_rest():
    """Beside what it was loaded by, its round-off is nothing, and no finding speaks of it."""
    problem, load, _ = own_residual(lambda h, one: (one + h, ((one + h).T * (one + h) - one) / 2), 1e-3)
    full = load.value.copy()

    def apply(time):
        load.value[:] = full * (1 - abs(time - 1))

    problem.run([1.0, 2.0], apply)
    assert np.abs(problem.u.x.array).max() < 1e-14
    assert not problem.findings
