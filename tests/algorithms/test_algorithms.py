"""What the algorithms promise on their way, where the answer alone would not show it."""

import numpy as np
import pytest
from mpi4py import MPI
from scenes import alone, example1
from spaces import block

from signorini_fx.algebra.algorithms.ssn import SemismoothNewton
from signorini_fx.algebra.algorithms.strategy import solve_task
from signorini_fx.algebra.contact.active_sets import ActiveSets
from signorini_fx.mechanics.body.discretisation import discretise
from signorini_fx.mechanics.effects.displacement import PrescribedDisplacement
from signorini_fx.records import History, Status, Timings
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.solving.solve_on_mesh import contact_task


def solved_task(scene):
    """A task that has been run, for a look inside, and its contact boundary."""
    d = discretise(scene.statement, load_mesh(scene, MPI.COMM_SELF), Timings())
    task = contact_task(d, History())
    assert solve_task(task, task.start).status is Status.CONVERGED
    return task, d.boundary


@pytest.mark.parametrize("wrong", ["turned round", "all slip", "all stick", "all in contact"])
def test_exact_method_finds_its_sets(wrong):
    """The unregularised limit does not live on the sets that it is given: nodes are caught and released, both ways."""
    task, boundary = solved_task(example1(bound=1.5, nx=30, ny=10, algorithm="exact"))
    newton = task.iterate.exact_newton
    right = newton.problem.sets
    slip = right.direction
    assert {-1, 0, 1} <= set(slip[:, 0])
    slips = {
        "turned round": np.where(slip == 0, 1, -slip),
        "all slip": np.ones_like(slip),
        "all stick": np.zeros_like(slip),
        "all in contact": slip,
    }
    contact = np.ones_like(right.contact) if wrong == "all in contact" else right.contact
    given = ActiveSets.of(contact, slips[wrong])
    assert newton.solve(newton.problem.data, given) is Status.CONVERGED
    free = boundary.free.all(axis=1)  # elsewhere the support decides, and either set is as good
    assert not newton.problem.sets.changed(right)[free].any()


@pytest.mark.parametrize("push", [1e-2, -1e-2])
def test_exact_method_sees_where_a_support_drags_a_node(push):
    """Nodes that a support moves along the foundation slip, and bear their bound, whatever sets it begins with."""
    scene = parse_scene(
        {
            "mesh": {"generator": "rectangle", "parameters": {"nx": 6, "ny": 2}},
            "material": {"young": 5000.0, "poisson": 0.3},
            "displacement": [{"boundary": side, "x": push} for side in ("left", "right")],
            "traction": {"boundary": "top", "y": -20.0},
            "contact": {"boundary": "bottom", "friction": {"law": "tresca", "bound": 2.0}},
            "solver": {"algorithm": "exact"},
        }
    )
    task, boundary = solved_task(scene)
    newton, size = task.iterate.exact_newton, boundary.size
    assert np.count_nonzero(~boundary.free[:, 0]) == 2
    for slip in (-1, 0, 1):
        given = ActiveSets.of(np.ones(size, dtype=bool), np.full((size, 1), float(slip)))
        assert newton.solve(newton.problem.data, given) is Status.CONVERGED
        np.testing.assert_allclose(newton.multipliers()[1], 2.0 * np.sign(push), rtol=1e-9)


def test_the_limit_in_space_sees_a_shear_beside_its_slip():
    """How far mu is from the projection, where directions that the sets have do not fit the slip."""
    task, boundary = solved_task(block(6, bound=1.5, gamma="auto", algorithm="exact"))
    newton = task.iterate.exact_newton
    problem = newton.problem
    assert problem.law_residual(newton.x) < 1e-8
    turn = np.array([[0.8, -0.6], [0.6, 0.8]])
    direction = problem.sets.direction @ turn.T
    problem.sets = ActiveSets.of(problem.sets.contact, direction)
    slip = problem.sets.slip
    assert slip.any()
    diagonal = task.system.matrix.getDiagonal().getArray().max()
    trial = 1.5 * direction + diagonal / boundary.weight[:, None] * problem.system.contact.traces(newton.x)[1]
    away = np.linalg.norm(direction[slip] - trial[slip] / np.linalg.norm(trial[slip], axis=1)[:, None], axis=1)
    assert away.min() > 0.2
    np.testing.assert_allclose(problem.away(newton.x)[slip], 1.5 * away, rtol=1e-9)
    assert problem.law_residual(newton.x) == pytest.approx(away.max(), rel=1e-9)


@pytest.mark.parametrize("law", [{"bound": 1.5}, {"coefficient": 0.3}])
def test_augmented_lagrangian_leaves_no_penalty(law):
    """Its limit is the unregularised solution in both directions, whatever gamma: no overlap and no creep in stick."""
    solution = alone(example1(**law, nx=30, ny=10, gamma=1e6, algorithm="alm", tolerance=1e-8))
    assert (solution.contact.direction == 0).any()
    assert solution.certificate.penetration < 1e-8
    assert solution.certificate.stick_slip < 1e-8
    plain = alone(example1(**law, nx=30, ny=10, gamma=1e6))
    assert plain.certificate.penetration > 1e-3
    assert plain.certificate.stick_slip > 1e-4


def test_inexact_augmented_lagrangian_shifts_by_feasible_multipliers(monkeypatch):
    """Section 7: lambda >= 0 and |mu| <= F g before each update, also after a problem that was cut off."""
    shifts = []
    solve_one = SemismoothNewton.solve

    def spy(self, data, *arguments, **options):
        status = solve_one(self, data, *arguments, **options)
        shifts.append((data, status, self.multipliers()))
        return status

    monkeypatch.setattr(SemismoothNewton, "solve", spy)
    scene = example1(bound=1.5, nx=30, ny=10, gamma=1e5, algorithm="alm", inner_iterations=1)
    assert alone(scene).converged
    cut_off = [(pressure, shear) for _, status, (pressure, shear) in shifts if status is Status.MAX_ITERATIONS]
    assert any(pressure.min() < 0 or np.abs(shear).max() > 1.5 for pressure, shear in cut_off)
    for data, _, _ in shifts:
        assert data.lambda_hat.min() >= 0
        assert np.abs(data.mu_hat).max() <= 1.5


@pytest.mark.parametrize("value", [0.01, "0.01 + 0*x[0]"])
@pytest.mark.parametrize(("side", "component", "sign"), [("left", 0, -1), ("right", 0, 1), ("top", 1, 1)])
def test_normal_displacement_is_outward(side, component, sign, value):
    """A prescribed normal displacement moves the boundary out of the body, given as a number or as an expression."""
    scene = example1(nx=6, ny=2).model_copy(
        update={"displacement": (PrescribedDisplacement(boundary=side, normal=value),), "contact": (), "traction": ()}
    )
    held = PrescribedDisplacement(boundary="bottom", x=0.0, y=0.0)
    solution = alone(scene.model_copy(update={"displacement": (held, *scene.displacement)}))
    x = solution.model.space.tabulate_dof_coordinates()
    place = {"left": 0.0, "right": 3.0, "top": 1.0}[side]
    nodes = np.isclose(x[:, component], place) & ~np.isclose(x[:, 1], 0.0)
    moved = solution.displacement.x.array.reshape(-1, 2)[nodes, component]
    assert moved.size >= 2
    np.testing.assert_allclose(moved, sign * 0.01, rtol=1e-12)


@pytest.mark.parametrize("gamma", [(1e8, 1e5), (1e6, 1e9)])
def test_continuation_ends_at_both_gammas(gamma):
    """The last problem is that of the scene, also where gamma_n and gamma_t differ."""
    scene = {"bound": 1.5, "nx": 30, "ny": 10, "gamma": gamma}
    plain, followed = alone(example1(**scene)), alone(example1(**scene, algorithm="continuation"))
    np.testing.assert_allclose(followed.contact.shear, plain.contact.shear, rtol=0, atol=1e-9)
    np.testing.assert_allclose(followed.contact.u_t, plain.contact.u_t, rtol=0, atol=1e-12)
