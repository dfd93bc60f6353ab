"""Load steps of nonlinear bodies: what they go back to, and how they end."""

import re

import numpy as np
import pytest
import ufl
from dolfinx import fem
from mpi4py import MPI
from scene_tables import circle_shape, plane_shape
from support.nonlinear_bodies import held, neo_hooke, polynomial, rectangle, residual, under_shape

from signorini_fx import (
    ConvergenceError,
    Coulomb,
    FormError,
    Foundation,
    NonlinearContactProblem,
    Status,
)


def pressed(update=None, energy=neo_hooke, made=NonlinearContactProblem, **options):
    """A block on its ground and a circle over it."""
    options |= {"friction": Coulomb(0.3), "update": update, "energy": energy, "make": made}
    return under_shape(circle_shape((0.8, 1.5), 0.5), (2.0, 1.0), (8, 4), **options)


def down(problem, depth=0.2):
    """The circle moved down in proportion to the load."""
    return lambda load: problem.place(0, shift=(0.0, -depth * load))


def everything(problem):
    """What belongs to a solution, as numbers."""
    fields = (problem.u, problem.pressure, problem.shear, problem.gap, problem.slip)
    figures = [] if problem.certificate is None else [problem.certificate.worst]
    state = problem.state
    forces = [
        *np.ravel(state.forces),
        *state.pressure,
        *np.ravel(state.shear),
        *np.ravel(state.u_t),
    ]
    place = problem.shapes[0].shape.shift
    return np.concatenate(
        [*(field.x.array for field in fields), figures, forces, place, [problem.iterations]]
    )


class Unlike(Exception):
    """What a user's function may raise."""


@pytest.mark.parametrize("fault", ["update", "unstable"])
def test_a_failure_goes_back_to_the_last_step(fault, monkeypatch):
    """Displacement, tractions, certificate and shapes are those of the last step, at which
    ``update`` was called, and from which it goes on.
    """
    called, kept, problem = [], [], None

    def fails():
        return np.abs(problem.u.x.array).max() > 0.12

    def update():
        called.append(problem.u.x.array.copy())
        if fault == "update" and fails():
            raise Unlike("no return to the yield surface")

    problem = pressed(update, max_newton=8, stability=fault == "unstable")
    inertia = "signorini_fx.forms.nonlinear.verdicts.negative_directions"
    values = problem.u.x.array
    monkeypatch.setattr(inertia, lambda *_: (int(fault == "unstable" and fails()), values))
    with pytest.raises(FormError if fault == "update" else ConvergenceError) as raised:
        problem.run(
            [0.25, 0.5, 0.75], down(problem), on_step=lambda step: kept.append(everything(problem))
        )
    assert everything(problem) == pytest.approx(kept[-1], rel=0, abs=0)
    assert (called[-1] == problem.u.x.array).all()
    said = {
        "update": "update: raised Unlike: no return to the yield surface",
        "unstable": "unstable equilibrium",
    }[fault]
    assert problem.status is (Status.UNSTABLE if fault == "unstable" else None)
    assert re.search(
        rf"{said}.*at time 0\.\d+; there is a solution at time 0\.\d+", str(raised.value)
    )
    problem.place(0, shift=(0.0, 1.05 * problem.shapes[0].shape.shift[1]))
    fault = ""
    problem.solve()
    problem.advance()


def test_cells_turned_inside_out():
    """An energy that is finite for every displacement lets a plate press a block through its
    ground.
    """
    space, side = rectangle([1.0, 1.0], [2, 2])
    u = fem.Function(space)
    contact = Foundation(side(0, 1.0), shape=plane_shape((3.0, 0.0), (-1.0, 0.0)))
    bcs = [held(space, side(1, 0.0)), push := held(space, side(1, 1.0))]
    problem = NonlinearContactProblem(
        residual(u, polynomial), u, bcs=bcs, contact=contact, stability=False
    )
    push.g.value[:] = (0.0, -1.2)
    with pytest.raises(ConvergenceError, match="inside out"):
        problem.solve()
    assert problem.status is Status.INVERTED


@pytest.mark.mpi
def test_no_first_step():
    """A block that is lifted off its ground: the problem shows the body before, and the next
    solution takes over.
    """
    space, side = rectangle([2.0, 1.0], [8, 4], MPI.COMM_WORLD)
    u, load = fem.Function(space), fem.Constant(space.mesh, 0.0)
    F = residual(u, neo_hooke) - load * ufl.TestFunction(space)[1] * ufl.dx
    walls = [
        fem.dirichletbc(
            0.0, fem.locate_dofs_topological(space.sub(0), 1, side(0, 0.0)), space.sub(0)
        )
    ]
    problem = NonlinearContactProblem(F, u, bcs=walls, contact=Foundation(side(1, 0.0)))

    def lift(time):
        load.value = time

    with pytest.raises(ConvergenceError, match="there is no solution before it") as error:
        problem.run([1.0], lift)
    assert error.value.solution.status is problem.solution.status is Status.LIMIT
    assert 0.0 < problem.solution.last_step.time < 0.01
    assert not problem.solution.certificate.holds
    assert not problem.solution.displacement.x.array.any()
    assert load.value == 0.0
    lift(-1.0)
    problem.solve()
    assert problem.solution.converged
    assert problem.solution.certificate.holds
