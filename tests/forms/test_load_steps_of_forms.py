"""``ContactProblem.run``: the load steps, ramps and restarts of scenes, for forms of the user's
own.
"""

from pathlib import Path
from runpy import run_path

import forms
import numpy as np
import pytest
import ufl
from dolfinx import fem
from dolfinx import mesh as dmesh
from numpy.testing import assert_allclose, assert_array_equal
from on_meshes import at_coordinate, trial_and_test, vector_space
from pushed_block import FRICTION, LIMIT, PRESSURE

from signorini_fx import ContactProblem, Coulomb, FormError, Foundation, LoadPath

GAMMA = {"gamma_n": 1e6, "gamma_t": 1e6}


def block(mesh, pushing=0.0, young=5000.0, friction=FRICTION, floor=None, **settings):
    """The block of ``pushed_block``, and the Constant with the force that pushes it on its left
    side.
    """
    V = vector_space(mesh)
    u, v = trial_and_test(V)
    facets = [forms.side(mesh, axis, at) for axis, at in ((0, 0.0), (1, 1.0), (1, 0.0))]
    numbers, marks = (
        np.concatenate(facets[:2]),
        np.repeat([1, 2], [part.size for part in facets[:2]]).astype(np.int32),
    )
    order = np.argsort(numbers)
    ds = ufl.ds(domain=mesh, subdomain_data=dmesh.meshtags(mesh, 1, numbers[order], marks[order]))
    push = fem.Constant(mesh, pushing)
    L = push * v[0] * ds(1) - PRESSURE * v[1] * ds(2)
    foundation = Foundation(facets[2], friction=Coulomb(friction), **(floor or {}))
    return ContactProblem(forms.hooke(u, v, young), L, [], foundation, **GAMMA, **settings), push


@pytest.mark.mpi
@pytest.mark.one_quick("steps", [None, 3])
def test_a_path_is_a_loop(steps):
    """Its steps are those of ``solve`` and ``advance``, to the last bit."""
    mesh, times = forms.box((3.0, 1.0), (9, 3)), [0.0, 0.4, 0.8, -0.4]
    problem, push = block(mesh)

    def at(time):
        push.value = LIMIT * np.interp(time, range(4), times)

    solved = problem.run(LoadPath(range(4), ("press", "push", "on", "back"), steps=steps), at)
    at_times = [(step.time, step.name) for step in solved.steps if step.time == int(step.time)]
    assert at_times == list(enumerate(("press", "push", "on", "back")))
    assert solved.converged
    by_hand, push = block(mesh)
    for step in solved.steps:
        at(step.time)
        y = by_hand.solve()
        by_hand.advance()
        assert_array_equal(step.displacement.x.array, y.x.array)
        assert_array_equal(step.contact.shear, by_hand.state.shear)
    assert (
        problem.history.linear_solves
        == by_hand.history.linear_solves
        == sum(s.linear_solves for s in solved.steps)
    )
    assert_array_equal(problem.u.x.array, y.x.array)


def test_limit_load():
    """Statics: the block slides at the coefficient times its weight, which the ramp encloses to 1
    %.
    """
    found = run_path(str(Path(__file__).parents[2] / "demos" / "forms" / "limit_load.py"))
    assert 0.99 * 18.0 <= found["limit"] <= 18.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (((), print), "times"),
        (((1.0,), 3.0), "function of the time"),
        (((1.0,), "push"), "function of the time"),
    ],
)
def test_bad_paths_of_forms(arguments, message):
    problem, _ = block(forms.box((3.0, 1.0), (3, 1)))
    with pytest.raises(FormError, match=message):
        problem.run(*arguments)
    with pytest.raises(FormError, match="folder"):
        problem.run((1.0,), print, restart=True)


def test_another_problem(tmp_path):
    """A folder of another problem is refused, with what differs."""
    problem, push = block(forms.box((3.0, 1.0), (3, 1)))
    problem.run((1.0, 2.0), push, folder=tmp_path)
    finer, push = block(forms.box((3.0, 1.0), (6, 2)))
    with pytest.raises(FormError, match="cells: was 6"):
        finer.run((1.0, 2.0), push, folder=tmp_path, restart=True)
    problem, push = block(forms.box((3.0, 1.0), (3, 1)))
    solved = problem.run((1.0, 2.0), push, folder=tmp_path, restart=True)
    assert "restart: 2 complete load step" in solved.history.events[0]


@pytest.mark.parametrize("change", ["tilt", "support"])
def test_a_block_that_falls_first_bears_the_same(change):
    """In the step in which it falls, and in the next one, before which its floor tilts or a support
    holds it.
    """
    mesh, states = forms.box((3.0, 1.0), (9, 3)), []
    for gap in (0.0, 0.01):
        tilt = fem.Constant(mesh, 0.0)
        floor = {"gap": gap, "direction": ufl.as_vector((tilt, -1.0))}
        problem, push = block(mesh, 0.2 * LIMIT, floor=floor)
        states.append([])
        for factor in (0.2, 0.3, 0.1):
            push.value = factor * LIMIT
            problem.solve()
            states[-1].append(problem.state)
            problem.advance()
            if change == "tilt":
                tilt.value = 1e-3
            elif not problem.bcs:
                top = fem.locate_dofs_geometrical(problem.u.function_space, at_coordinate(1, 1.0))
                problem.bcs = [fem.dirichletbc(problem.u.copy(), top)]
    for touching, fallen in zip(*states, strict=True):
        assert_allclose(fallen.pressure, touching.pressure, rtol=1e-8)
        assert_allclose(fallen.shear, touching.shear, rtol=0, atol=1e-8 * PRESSURE)
