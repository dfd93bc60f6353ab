"""Whether a discrete solution is the only one: against all states of few points, one triangle, and random scenes."""

from itertools import product

import numpy as np
import pytest
from mpi4py import MPI
from scenes import alone, example1
from test_coulomb_ways import one_triangle

from signorini_fx.addons.uniqueness.proof import uniqueness, uniqueness_of
from signorini_fx.algebra.contact.friction import PointFriction
from signorini_fx.algebra.contact.points import ContactPoints
from signorini_fx.algebra.contact.state import PointState
from signorini_fx.errors import SignoriniError
from signorini_fx.results.summary import lines_of, summarise
from signorini_fx.scenes.checks import check_scene
from signorini_fx.scenes.reading import parse_scene


def states(stiffness, friction, load, gap):
    """All solutions of few points in the plane, components (n, t) per point, by trying all of their states."""
    count, found = gap.size, []
    size = np.abs(gap).max() + np.abs(np.linalg.solve(stiffness, load)).max()
    for kinds in product(["open", "stick", "+", "-"], repeat=count):
        matrix, right = stiffness.copy(), load.copy()
        for point, kind in enumerate(kinds):
            n, t = 2 * point, 2 * point + 1
            if kind == "open":
                continue
            if kind == "stick":
                matrix[t], right[t] = np.eye(2 * count)[t], 0.0
            else:  # r_T = +-F r_N
                sign = 1.0 if kind == "+" else -1.0
                matrix[t], right[t] = (
                    stiffness[t] - sign * friction * stiffness[n],
                    load[t] - sign * friction * load[n],
                )
        for point, kind in enumerate(kinds):
            if kind != "open":
                matrix[2 * point], right[2 * point] = np.eye(2 * count)[2 * point], gap[point]
        if abs(np.linalg.det(matrix)) < 1e-12 * np.abs(stiffness).max() ** (2 * count):
            continue
        v = np.linalg.solve(matrix, right)
        force = load - stiffness @ v
        pressure, shear = force[::2], force[1::2]
        small, tiny = 1e-9 * size, 1e-9 * np.abs(load).max()
        held = {
            "open": (v[::2] <= gap + small),
            "stick": (pressure >= -tiny) & (np.abs(shear) <= friction * pressure + tiny),
            "+": (pressure >= -tiny) & (v[1::2] >= -small),
            "-": (pressure >= -tiny) & (v[1::2] <= small),
        }
        new = all(np.abs(v - other).max() > 1e-6 * size for other in found)
        if new and all(held[kind][point] for point, kind in enumerate(kinds)):
            found.append(v)
    return found


def test_tresca_friction_beside_coulomb():
    """Where the first point sticks, a second solution begins at F = 1.19 / 1.12, although it is the only one to F = 4.8
    where the first point has no friction; a bond is stronger still, and a bound that is not reached changes nothing.
    """
    stiffness = np.array(
        [[3.51, 2.01, -2.36, 1.62], [2.01, 2.83, -3.11, 0.87], [-2.36, -3.11, 4.07, -1.12], [1.62, 0.87, -1.12, 1.19]]
    )
    # Both points stick; the other solution moves by -0.5 / 1.05 at the second one, its shear twice its pressure.
    force, moved = np.array([9.0, 0.0, 1.0, -1.5]), -0.5 / 1.05
    others = force - stiffness[:, 3] * moved
    assert others[3] == pytest.approx(-2 * others[2])
    assert min(others[0], others[2]) > 0
    gap, coefficient = np.zeros(2), np.array([0.0, 2.0])
    for given in (50.0, np.inf):
        law = PointFriction(np.array([given, 0.0]), coefficient)
        found = uniqueness_of(stiffness, np.eye(4), law, state_of(np.zeros(4), force, gap))
        assert not found.proved
        assert found.coefficient < 1.19 / 1.12
        assert any(other[-1] == pytest.approx(moved) for other in found.others)
    start = state_of(np.zeros(4), force, gap)
    found = uniqueness_of(stiffness, np.eye(4), PointFriction(gap, coefficient), start)
    assert found.proved
    assert found.coefficient > 4


def state_of(v, force, gap):
    """A solution as the points of a body."""
    count = gap.size
    points = ContactPoints(MPI.COMM_SELF, np.ones(count), np.tile(np.eye(2), (count, 1, 1)), np.arange(count)[:, None])
    slip = v[1::2, None]
    touching = force[::2] > 0
    return PointState(
        points=points,
        gap=gap,
        u_n=v[::2],
        u_t=slip,
        pressure=force[::2],
        shear=force[1::2, None],
        bound=np.abs(force[1::2]),
        in_contact=touching,
        direction=np.where(touching[:, None], np.sign(slip), 0.0),
        has_friction=True,
        bilateral=np.zeros(count, dtype=bool),
        slip_length=slip,
        xi=slip,
    )


def random_points(chance, count):
    """A stiffness of contact points with rather much coupling, shape (2 n, 2 n)."""
    root = chance.normal(size=(2 * count, 2 * count))
    return root @ root.T + 0.3 * np.eye(2 * count)


@pytest.mark.one_quick
@pytest.mark.parametrize("seed", range(4))
def test_one_solution_below_the_bound(seed):
    """All states of three points tried: one solution for any load; and the search misses none far above the bound."""
    chance, several = np.random.default_rng(seed), 0
    stiffness = random_points(chance, 3)
    one = PointFriction(np.zeros(3), np.ones(3))
    none = state_of(np.zeros(6), np.zeros(6), np.zeros(3))
    critical = uniqueness_of(stiffness, np.eye(6), one, none, search=False).coefficient
    assert critical > 0
    for factor in (0.99, 6.0):
        for _ in range(8):
            load, gap = chance.normal(size=6), 0.3 * chance.normal(size=3)
            found = states(stiffness, factor * critical, load, gap)
            law = PointFriction(np.zeros(3), np.full(3, factor * critical))
            if factor < 1:
                assert len(found) == 1
            if not found:
                continue
            given = found[0]
            state = state_of(given, load - stiffness @ given, gap)
            answer = uniqueness_of(stiffness, np.eye(6), law, state, search=True)
            assert answer.proved == (factor < 1)
            assert answer.coefficient == pytest.approx(critical, rel=1e-6)
            assert len(answer.others) <= len(found) - 1
            several += len(found) > 1 and not answer.others
    assert several <= 2


@pytest.mark.slow
def test_one_triangle():
    """The critical coefficient is sqrt(3) = K_xx / |K_xy|; three solutions above it, one below."""
    force = (0.015, -0.006)  # a nodal force of (2.5, -1) / 1000
    below = alone(one_triangle(1.7, force, algorithm="exact")).uniqueness
    assert below.proved
    assert below.coefficient == pytest.approx(np.sqrt(3), rel=1e-5)
    assert below.coefficient < np.sqrt(3)
    solution = alone(one_triangle(3.0, force, algorithm="exact", uniqueness=True))
    above = solution.uniqueness
    assert not above.proved
    assert above.coefficient == pytest.approx(below.coefficient, rel=1e-9)
    free = int(np.argmin(np.abs(solution.contact.boundary.x[:, 0])))
    slips = {round(1e3 * float(one[-1]), 6) for one in above.others}
    slips.add(round(1e3 * float(solution.contact.u_t[free, 0]), 6))
    assert slips == {0.0, 0.227671, 0.897329}
    told = "\n".join(map(str, lines_of(summarise(solution))))
    assert "2 other solutions found" in told
    assert not uniqueness(solution.model, solution.contact, search=False).starts


def test_check_before_a_solve(monkeypatch):
    """The same sqrt(3), which needs no solution, only for a scene that asks; none is searched for."""
    force = (0.015, -0.006)
    for coefficient, level in ((1.7, "note"), (3.0, "warning")):
        found = check_scene(one_triangle(coefficient, force, uniqueness=True), MPI.COMM_SELF).findings
        (told,) = (one for one in found if one.path == "solver.uniqueness")
        assert told.level == level
        assert "friction coefficients below 1.732 there is one solution on this mesh" in told.message
    assert "none was searched for" in told.message
    monkeypatch.setattr("signorini_fx.addons.uniqueness.proof.uniqueness", None)
    assert not [one for one in check_scene(one_triangle(1.7, force)).findings if one.path == "solver.uniqueness"]


def test_what_is_not_asked_for():
    """No key in the summary; without Coulomb friction the solution is the only one."""
    solution = alone(example1(bound=1.5, nx=12, ny=4))
    assert "uniqueness" not in summarise(solution)
    assert solution.uniqueness.proved
    assert solution.uniqueness.as_dict()["multiple"] is None


def test_a_finer_mesh_has_a_lower_bound():
    """As the square root of the mesh size, because the pressure of a node is no function of a norm of the energy."""
    bounds = [alone(example1(coefficient=0.1, nx=nx, ny=nx // 3)).uniqueness.coefficient for nx in (12, 24, 48)]
    ratios = np.divide(bounds[1:], bounds[:-1])
    np.testing.assert_allclose(ratios, np.sqrt(0.5), rtol=0.1)


def random_scene(chance):
    """A block with a random load and foundation."""
    scene = example1(coefficient=0.3, nx=int(chance.integers(3, 10)), ny=int(chance.integers(2, 5)))
    load = scene.traction[0].model_copy(
        update={"x": float(chance.normal() * 20), "y": float(-abs(chance.normal()) * 40)}
    )
    a, b, c = chance.normal(size=3)
    friction = scene.contact[0].friction.model_copy(update={"coefficient": float(chance.uniform(0.1, 1.2))})
    gap = f"{0.003 * abs(a)}*(x[0] - {1.5 + b})**2 + {0.0005 * c}"
    return parse_scene(
        {
            "mesh": scene.mesh.model_dump(),
            "material": {"young": 5000.0, "poisson": float(chance.choice([0.0, 0.3, 0.4, 0.49]))},
            "displacement": {"boundary": str(chance.choice(["left", "right"])), "x": 0.0, "y": 0.0},
            "traction": {"boundary": "top", "x": load.x, "y": load.y},
            "contact": {"boundary": "bottom", "gap": gap, "friction": friction.model_dump()},
            "solver": {"algorithm": "exact"},
        }
    )


def searched(count, seed):
    """How many of random scenes have one solution, by proof; none of these has another one."""
    chance, proved, several = np.random.default_rng(seed), 0, 0
    for _ in range(count):
        try:
            solution = alone(random_scene(chance))
        except SignoriniError:
            continue
        answer = uniqueness(solution.model, solution.contact, search=True)
        assert answer.starts > 0
        assert not (answer.proved and answer.others)
        proved += answer.proved
        several += bool(answer.others)
    return proved, several


@pytest.mark.slow
def test_random_scenes():
    """No other solution where one is proved to be the only one."""
    assert searched(10, 1)[0] >= 3


@pytest.mark.long
def test_many_random_scenes():
    """The same in 200 scenes."""
    assert searched(200, 2)[0] >= 60


@pytest.mark.parametrize("given", [{"force": 0.1}, {"shortening": 1e-4}])
def test_a_preload_by_force_is_not_proved_by_the_stiffness_of_a_fixed_shortening(given):
    """Friction alone holds the far end of a block: the shortening is an unknown of the problem."""
    scene = parse_scene(
        {
            "mesh": {"generator": "rectangle", "parameters": {"length": 3.0, "nx": 12, "ny": 4}},
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": [{"boundary": "left", "x": 0.0, "y": 0.0}],
            "preload": {"point": [1.37, 0.0], "axis": [1.0, 0.0], **given},
            "traction": [{"boundary": "top", "y": -1.0}],
            "contact": [{"boundary": "bottom", "friction": {"law": "coulomb", "coefficient": 0.1}}],
        }
    )
    found = alone(scene).uniqueness
    assert found.proved == ("shortening" in given)
    assert ("not tried where a force determines the shortening" in str(found)) == ("force" in given)


def test_the_size_of_slip_is_not_lipschitz_continuous_in_the_energy():
    """Why no constant of a mesh tells of the body: in H^(1/2) a change of phi changes |phi| by more than k^(1/2) times
    as much, where phi has the same norm for all k; in L2 it does not."""
    count, change = 2**18, 1e-4
    x = 2 * np.pi * np.arange(count) / count
    k = np.abs(np.fft.fftfreq(count, 1 / count))

    def norms(values):
        squares = np.abs(np.fft.fft(values) / count) ** 2
        return np.sqrt(squares @ (1 + k)), np.sqrt(squares.sum())

    for waves in (4, 64, 1024):
        phi = np.sin(waves * x) / np.sqrt(waves)
        assert norms(phi)[0] == pytest.approx(np.sqrt(0.5 * (1 + 1 / waves)), rel=1e-9)
        ratio, in_l2 = np.array(norms(np.abs(phi + change) - np.abs(phi))) / change
        assert ratio > np.sqrt(waves)
        assert in_l2 < 1 + 1e-9
