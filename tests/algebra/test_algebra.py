"""The core alone: a contact problem given by matrices has the solution that it has as a scene."""

import subprocess
import sys
from pathlib import Path

import algebra_alone
import numpy as np
import pytest
from scenes import alone, example1

PROGRAM = Path(__file__).parents[1] / "support" / "algebra_alone.py"
# The friction law of a scene, and of the core.
LAWS = {
    "tresca": ({"bound": 1.5}, ("given", 1.5)),
    "coulomb": ({"coefficient": 0.3}, ("coefficient", 0.3)),
}


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(
    ("kind", "algorithm"),
    [("full", "auto"), ("condensed", "auto"), ("condensed", "alm"), ("full", "alm")],
)
def test_matrices_or_a_scene(law, kind, algorithm, tmp_path):
    """The same pressure, shear and displacement after as many linear solves, without dolfinx and
    UFL.
    """
    scene, friction = LAWS[law]
    settings = {"linear_algebra": kind, "algorithm": algorithm, "tolerance": 1e-11}
    gamma = algebra_alone.GAMMA
    theirs = alone(
        example1(
            nx=algebra_alone.NX, ny=algebra_alone.NY, gamma=gamma, patch="all", **scene, **settings
        )
    )
    ended = subprocess.run(
        [sys.executable, PROGRAM, kind, algorithm, *map(str, friction), tmp_path / "found.npz"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 0, ended.stderr
    ours = np.load(tmp_path / "found.npz")
    assert str(ours["status"]) == theirs.status.value
    assert int(ours["solves"]) == theirs.history.linear_solves
    contact = theirs.contact
    order = np.argsort(contact.boundary.x[:, 0])
    for name, scale in (
        ("pressure", "pressure"),
        ("shear", "pressure"),
        ("u_n", "u_n"),
        ("u_t", "u_n"),
    ):
        size = np.abs(getattr(contact, scale)).max()
        np.testing.assert_allclose(
            ours[name], getattr(contact, name)[order], rtol=0, atol=1e-10 * size, err_msg=name
        )
    x = theirs.model.space.tabulate_dof_coordinates()[:, :2]
    corner = np.isclose(x, (algebra_alone.LENGTH, algebra_alone.HEIGHT)).all(axis=1)
    top = theirs.displacement.x.array[1::2][corner][0]
    assert float(ours["top"]) == pytest.approx(top, rel=1e-9)


def test_nothing_else_holds_the_body():
    """A load that no pressure balances: the core says so without a linear solve."""
    from from_scipy import from_scipy, task_of

    from signorini_fx.algebra.algorithms.strategy import solve_task
    from signorini_fx.algebra.linalg import ElasticSystem
    from signorini_fx.records import Status

    stiffness, load, operator, weight, gap, prescribed, modes = algebra_alone.matrices()
    elasticity, motions = from_scipy(
        stiffness, -load, operator, weight, prescribed=prescribed, modes=modes
    )
    task = task_of(ElasticSystem.of(elasticity), motions, gap)
    assert solve_task(task, task.start).status is Status.OPEN
    assert task.history.linear_solves == 0


@pytest.mark.parametrize("kind", ["full", "condensed"])
def test_another_load_on_the_same_factor(kind):
    """A load case that is replaced has the solution of a body that is set up with it."""
    from dataclasses import replace

    from from_scipy import from_scipy, task_of

    from signorini_fx.algebra import Settings
    from signorini_fx.algebra.algorithms.strategy import solve_task
    from signorini_fx.algebra.linalg import ElasticSystem
    from signorini_fx.algebra.linalg.condensed import CondensedSystem

    stiffness, load, operator, weight, gap, prescribed, modes = algebra_alone.matrices()
    make = {"full": ElasticSystem, "condensed": CondensedSystem}[kind]
    bodies = [
        from_scipy(stiffness, f, operator, weight, prescribed=prescribed, modes=modes)
        for f in (load, 2 * load)
    ]
    system, other = (make.of(elasticity) for elasticity, _ in bodies)
    motions = bodies[0][1]
    system.set_case(0, bodies[1][0].cases[0])
    system.set_load(np.ones(1))
    settings = Settings(gamma_n=algebra_alone.GAMMA, gamma_t=algebra_alone.GAMMA)
    tasks = [task_of(one, motions, gap, settings=settings) for one in (system, other)]
    outcomes = [solve_task(task, replace(task.start, factors=np.ones(1))) for task in tasks]
    ours, theirs = (outcome.displacement().getArray(readonly=True) for outcome in outcomes)
    assert np.abs(theirs).max() > 0
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-12 * np.abs(theirs).max())
