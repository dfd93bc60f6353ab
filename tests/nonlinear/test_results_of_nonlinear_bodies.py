"""Results of nonlinear bodies: load steps, forces in balance at the displaced points, and
fields.
"""

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI
from support.nonlinear_bodies import held, neo_hooke, rectangle, residual

from signorini_fx import Coulomb, Foundation, NonlinearContactProblem, Scene, solve, write_results

CIRCLE = {"shape": "circle", "centre": (0.8, 1.5), "radius": 0.5}


def pressed(comm=MPI.COMM_SELF, degree=1, **arguments):
    """A block of rubber on its ground, and a circle over it; its sides have names."""
    space, side = rectangle([2.0, 1.0], [16, 8], comm, degree=degree)
    u = fem.Function(space, name="displacement")
    contact = Foundation(side(1, 1.0), shape=CIRCLE, friction=Coulomb(0.3))
    names = {"bottom": side(1, 0.0), "top": side(1, 1.0)}
    bcs = [held(space, names["bottom"])]
    return NonlinearContactProblem(
        residual(u, neo_hooke), u, bcs=bcs, contact=contact, boundaries=names, **arguments
    )


def moved(problem):
    """The circle pressed in and pulled sideways, in proportion to the load."""
    return lambda load: problem.place(0, shift=(0.2 * load, -0.3 * load))


@pytest.mark.mpi(slow=True)
def test_load_steps():
    """Each has its time, and the displacement that ``u`` had; the foundation is where the last left
    it.
    """
    problem, seen = pressed(MPI.COMM_WORLD), []
    times = [0.25, 0.5, 0.75, 1.0]
    problem.run(times, moved(problem), on_step=lambda step: seen.append(problem.u.x.array.copy()))
    solution = problem.solution
    assert [step.time for step in solution.steps] == times
    assert [step.step for step in solution.steps] == [1, 2, 3, 4]
    for step in solution.steps:
        bottom, top = (solution.at(step).resultants.of(name).force for name in ("bottom", "top"))
        assert np.abs(bottom + top).max() < 1e-8 * np.abs(top).max()
    assert all(
        np.array_equal(step.displacement.x.array, u)
        for step, u in zip(solution.steps, seen, strict=True)
    )
    assert solution.converged
    assert solution.certificate is problem.certificate
    assert solution.statement.contact[0].foundation.shift == (0.2, -0.3)
    assert solution.at(solution.steps[1]).displacement is solution.steps[1].displacement
    assert sum(step.linear_solves for step in solution.steps) == problem.history.linear_solves
    problem.solve()
    assert len(problem.solution.steps) == 1


@pytest.mark.mpi
def test_fields_on_the_boundary():
    """Of linear elements the integral of the pressure is the sum over the nodes with their
    weights.
    """
    problem = pressed(MPI.COMM_WORLD)
    problem.run([0.5], moved(problem))
    fields, state, comm = problem.solution.boundary_fields(0), problem.state, MPI.COMM_WORLD
    assert fields.mesh.topology.dim == 1
    integral = comm.allreduce(fem.assemble_scalar(fem.form(fields.pressure * ufl.dx)))
    total = comm.allreduce(
        float(
            np.dot(
                state.pressure,
                np.linalg.norm(
                    state.boundary.nodal_forces(1.0 + 0 * state.pressure, 0 * state.shear), axis=1
                ),
            )
        )
    )
    assert integral > 1.0
    assert integral == pytest.approx(total, rel=1e-10)


def test_what_a_nonlinear_body_does_not_have():
    """Energy, stress, estimates and bounds, each with its reason where there is one."""
    problem = pressed()
    with pytest.raises(RuntimeError, match="no solution so far"):
        problem.solution  # noqa: B018
    problem.run([0.5], moved(problem))
    solution = problem.solution
    assert solution.error_bound == "a nonlinear body has no guaranteed bound"
    assert solution.force_bounds("bottom", (0.0, 1.0)) == "a nonlinear body has no guaranteed bound"
    with pytest.raises(RuntimeError, match="is in its residual alone"):
        solution.stress  # noqa: B018


def test_pictures_of_halved_steps(tmp_path):
    """A scene of one load step has no steps.csv, also where the step had to be halved."""
    scene = Scene(
        mesh={"generator": "rectangle", "parameters": {"length": 10.0, "nx": 10, "ny": 2}},
        material={"law": "neo-hooke", "young": 1000.0, "poisson": 0.3},
        displacement={"boundary": "left", "x": 0.0, "y": 0.0},
        traction={"boundary": "right", "x": -20.0, "y": 0.01},
        contact={"boundary": "bottom", "gap": 0.5},
    )
    solution = solve(scene, MPI.COMM_SELF)
    assert len(solution.steps) > 1
    findings = write_results(solution, tmp_path / "column", fields=False)["findings"]
    assert {finding["path"] for finding in findings} == {"contact[0]"}
    assert (tmp_path / "column" / "deformed.png").is_file()
