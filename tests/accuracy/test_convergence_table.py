"""The convergence table of a nested solve: estimates against a reference solution, and the
arithmetic behind them.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from effectivity import of_made_up
from scenes import alone, example1

from signorini_fx.mechanics.contact_points.contact_table import ContactTable
from signorini_fx.mechanics.statement.settings import Accuracy
from signorini_fx.results.accuracy import convergence_table as prices
from signorini_fx.results.accuracy.pressure_error import interval_squares, pressure_square
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve


def table(s, pressure):
    """A straight boundary with these pressures."""
    s, pressure = np.asarray(s, dtype=float), np.asarray(pressure, dtype=float)
    columns = {
        "s": s,
        "x": s,
        "y": np.zeros(s.size),
        "pressure": pressure,
        "weight": np.full(s.size, 1.0),
    }
    return ContactTable(columns, [range(s.size)])


def zone_ends(table):
    """Where the contact zones begin and end, from node to node."""
    return np.array(table.zones(table.columns["pressure"] > 0))[:, :, 0].ravel()


def pressure_error(table):
    """Estimated error of the contact pressure, relative in L2."""
    return np.sqrt(
        sum(squares.sum() for squares in interval_squares(table)) / pressure_square(table)
    )


def level(force, energy):
    """What a mesh says of a force."""
    return SimpleNamespace(forces=np.array([0.0, force]), energy=energy, loads=0.0, points=0.0)


@pytest.mark.parametrize("meshes", [[0.4, 0.2], [0.4, 0.2, 0.1]])
def test_error_of_a_force(meshes):
    """That of 1 + h^2 is h^2, where that of the displacement is h."""
    found = prices.force_error([level(1 + h**2, h) for h in meshes])
    assert found == pytest.approx(meshes[-1] ** 2 / (1 + meshes[-1] ** 2))


@pytest.mark.parametrize(("change", "expected"), [(1e-4, 0.12 * 0.1**2), (0.0, 0.0)])
def test_error_of_a_force_on_meshes_that_are_divided_here_and_there(change, expected):
    """It is at least a share of the squared error of the displacement, where no statics determine
    it.
    """
    levels = [level(1 - change, 0.2), level(1.0, 0.1)]
    assert prices.force_error(levels) == pytest.approx(change / 3)
    assert prices.force_error(levels, uniform=False) == pytest.approx(expected)


@pytest.fixture(
    scope="module", params=[{"bound": 1.5}, {"coefficient": 0.3}], ids=["tresca", "coulomb"]
)
def nested(request):
    """A nested solve, a much finer one by another method, and the scene of the first."""
    scene = example1(**request.param, nx=60, ny=20, levels=3)
    return solve(scene), solve(example1(**request.param, nx=180, ny=60, algorithm="alm")), scene


@pytest.fixture(scope="module")
def fine():
    """A solution with Tresca friction on a mesh that is finer than all others."""
    return alone(example1(bound=1.5, gamma="auto", nx=240, ny=80, algorithm="alm")).table


@pytest.mark.slow
def test_one_row_a_mesh_and_one_for_the_next(nested):
    """Meshes of doubling fineness, few solves on the finest, the next one marked as predicted."""
    rows = nested[0].convergence_table
    assert [row.level for row in rows] == [0, 1, 2, 3]
    assert [row.predicted for row in rows] == [False] * 3 + [True]
    assert [row.dofs for row in rows[:3]] == [2 * (15 * k + 1) * (5 * k + 1) for k in (1, 2, 4)]
    assert rows[2].linear_solves <= 4
    assert rows[0].peak is None
    assert all(row.pressure > 0 for row in rows)
    assert rows[-1].pressure < rows[-2].pressure


def test_effectivity_of_the_pressure(nested):
    """Estimated over true error of the contact pressure between 1/2 and 2 on two meshes."""
    solution, reference, _ = nested
    fine = reference.table.columns
    for level, row in zip(solution.levels[1:], solution.convergence_table[1:], strict=False):
        coarse = level.table.columns
        difference = np.interp(fine["s"], coarse["s"], coarse["pressure"]) - fine["pressure"]
        true = np.sqrt(
            np.dot(fine["weight"], difference**2) / np.dot(fine["weight"], fine["pressure"] ** 2)
        )
        assert 0.5 < row.pressure / true < 2.0


@pytest.mark.slow
@pytest.mark.parametrize("law", ["tresca", "coulomb"])
@pytest.mark.parametrize("element", ["Q1", "P2"])
def test_effectivity_on_a_made_up_solution(law, element):
    """Displacement and pressure against an exact solution: between 1/2 and 2 on every mesh, of
    degree 1 and 2.
    """
    rows = [row for row in of_made_up(law, element) if row["quantity"] in ("energy", "pressure")]
    assert len({row["level"] for row in rows}) >= 4
    assert all(0.5 < row["effectivity"] < 2.0 for row in rows)
    assert all(row["true"] < 0.05 for row in rows if row["level"] == 3)


def test_pressure_error_of_known_profiles():
    """Of a parabola it is the error of the interpolant times a constant; it falls like h^2, at
    kinks like h^1.5.
    """

    def estimated(count, profile):
        s = np.linspace(-1.0, 1.0, count + 1)
        columns = {"s": s, "pressure": profile(s), "weight": np.full(s.size, 2 / count)}
        return pressure_error(ContactTable(columns, [range(s.size)]))

    def parabola(s):
        return 1.0 - s**2

    def kink(s):
        return np.maximum(1 / 3 - np.abs(s), 0.0)

    h = 2 / 64
    # The interpolant of a parabola is wrong by h^2 |p''| / sqrt(120) in the mean.
    interpolant = h**2 * 2 / np.sqrt(120) * np.sqrt(2) / np.sqrt(16 / 15)
    assert estimated(64, parabola) == pytest.approx(np.sqrt(120 / 33) * interpolant, rel=0.03)
    assert estimated(64, parabola) / estimated(128, parabola) == pytest.approx(4.0, rel=0.05)
    assert estimated(64, kink) / estimated(256, kink) == pytest.approx(8.0, rel=0.05)


def test_ends_of_zones_to_one_interval():
    """The longer one of the intervals in which the contact ends, over the length in contact;
    whichever the pressure.
    """
    s, pressure = [0.0, 1.0, 1.5, 2.0, 3.0, 3.3], [0.0, 0.0, 2.0, 9.0, 1.0, 0.0]
    assert prices.ends_of_zones(table(s, pressure)) == pytest.approx(0.5 / 1.5)
    assert prices.ends_of_zones(table(s, [0.0] * 6)) is None
    assert prices.ends_of_zones(table(s, [1.0] * 6)) is None


@pytest.mark.one_quick("of", ["energy", "pressure"])
def test_meshes_divided_in_some_places(fine, of):
    """The estimate of the ends of the zone is no less than their error, that of the largest
    pressure than its half.
    """
    scene = example1(bound=1.5, gamma="auto", nx=30, ny=10)
    known, largest = zone_ends(fine), fine.columns["pressure"].max()
    solution = alone(scene.model_copy(update={"accuracy": Accuracy(target=0.02, of=of)}))
    assert len(solution.levels) > 2
    for level, row in zip(solution.levels[1:], solution.convergence_table[1:], strict=False):
        ends = zone_ends(level.table)
        assert np.abs(np.subtract(ends, known)).max() / (known[1] - known[0]) <= row.zone
        assert (
            row.peak is None
            or abs(level.table.columns["pressure"].max() / largest - 1) / 2 <= row.peak < 0.02
        )
    assert solution.convergence_table[-2].peak is not None
    assert solution.convergence_table[0].peak is None  # nothing to compare it with
    unknown = any(row.peak is None for row in solution.convergence_table[1:-1])
    assert ("no finer where it is" in prices.render(list(solution.convergence_table))) == unknown


def test_loads_that_every_mesh_misses():
    """No difference between meshes shows it: it counts on each of them, also where the last one
    tells the error.
    """
    levels = alone(example1(bound=1.5, gamma="auto", nx=60, ny=20, levels=3)).levels
    without = prices.convergence_table(
        [level.model_copy(update={"loads": 0.0}) for level in levels], 0.0
    )
    rows = prices.convergence_table(
        [level.model_copy(update={"loads": 0.2}) for level in levels], 0.0
    )
    assert without[1].peak < 0.01
    assert [row.peak is None for row in rows] == [True, False, False, False]
    assert all(row.peak >= 0.2 for row in rows[1:3])


def test_largest_pressure_where_cells_are_small_there_only(fine):
    """An error that is asked for is met on meshes with few cells elsewhere."""
    scene = example1(bound=1.5, gamma="auto", nx=30, ny=10, cell="triangle")
    solution = alone(
        scene.model_copy(
            update={"accuracy": Accuracy(target=0.02, of="peak", refinement="adaptive")}
        )
    )
    assert solution.converged
    assert abs(solution.table.columns["pressure"].max() / fine.columns["pressure"].max() - 1) < 0.02
    assert solution.model.dofs < 9_000  # a twentieth


def row_of(dofs, seconds, memory):
    """A row of the convergence table as far as its prediction looks at it."""
    errors = dict.fromkeys(("energy", "pressure", "force", "zone", "peak"), 1e-2)
    effort = {"linear_solves": 2, "factorisations": 1, "seconds": seconds, "memory": memory}
    return prices.Price(
        level=0,
        h=1.0,
        dofs=dofs,
        **effort,
        **errors,
        regularisation=0.0,
        iteration=0.0,
        predicted=False,
    )


def test_prediction_tells_what_stays_from_what_grows():
    """Time and memory with a part that stays are foretold exactly; a jump of another size
    likewise.
    """

    def mesh(dofs):
        return row_of(dofs, 0.1 + 1e-6 * dofs**1.2, 200 + 1e-3 * dofs**1.1)

    for finer, dofs in ((None, 160_000), (4.0, 640_000)):
        predicted = prices.predict([mesh(10_000), mesh(40_000)], 150.0, finer=finer)
        assert predicted.dofs == dofs
        assert predicted.seconds == pytest.approx(mesh(dofs).seconds)
        assert predicted.memory == pytest.approx(mesh(dofs).memory)
    assert prices.predict([mesh(10_000), mesh(40_000)], 150.0).pressure == pytest.approx(
        1e-2 / 2**1.25
    )
    # A Krylov method takes as long as there are unknowns, from the mesh on where it is taken.
    linear = [
        row_of(dofs, 0.1 + 1e-5 * dofs, 200 + 1e-2 * dofs) for dofs in (10_000, 80_000, 640_000)
    ]
    following = prices.predict(linear[:2], 150.0, dimension=3, krylov_from=640_000)
    assert (following.seconds, following.memory) == pytest.approx(
        (linear[2].seconds, linear[2].memory)
    )
    assert (
        prices.predict(linear[:2], 150.0, dimension=3, krylov_from=640_001).seconds
        > 2 * linear[2].seconds
    )
    # A coarse mesh that took longer than the fine one, for it began cold, does not make the next
    # one free.
    assert prices.predict([row_of(10_000, 1.0, 200), row_of(40_000, 0.8, 200)], 150.0).seconds > 1.2


def test_regularisation_part(nested):
    """The error that gamma leaves, estimated on the path, is the distance to the unregularised
    solution.
    """
    level = nested[0].levels[-1]
    exact = solve(nested[2].model_copy(update={"solver": example1(algorithm="alm").solver}))
    columns, limit = level.table.columns, exact.table.columns
    difference = np.sqrt(np.dot(limit["weight"], (columns["pressure"] - limit["pressure"]) ** 2))
    true = difference / np.sqrt(np.dot(limit["weight"], limit["pressure"] ** 2))
    assert level.pressure_regularisation == pytest.approx(true, rel=0.1)


def test_equilibrium_leaves_no_error_of_the_force(nested):
    """The contact force balances the load on every mesh, and the list knows it."""
    assert all(row.force < 1e-9 for row in nested[0].convergence_table[2:])


@pytest.mark.one_quick(("zone", "force"), [(0.6, 3.4523), (0.7, 1.2), (0.7, 3.4523), (0.5, 2.4)])
def test_largest_pressure_from_few_nodes(zone, force):
    """Half a disk whose first meshes have one to four nodes in contact, of which one hits the top
    of the pressure by
    chance: the target is met, the estimate is not far below the error by a mesh of short curved
    facets, and a mesh with few nodes has none, though its pressure has grown from mesh to mesh.
    """
    table = {
        "mesh": {
            "generator": "half_disk",
            "parameters": {"symmetric": True, "size": 1.0, "contact_zone": zone},
        },
        "material": {"young": 200.0, "poisson": 0.3},
        "displacement": {"boundary": "symmetry", "x": 0.0},
        "force": {"boundary": "top", "y": -force},
        "contact": {
            "boundary": "arc",
            "foundation": {"shape": "plane", "point": [0.0, 0.0], "normal": [0.0, 1.0]},
        },
    }
    parameters = table["mesh"]["parameters"]
    fine = {**parameters, "contact_size": 0.01, "order": 2}
    reference = table | {"mesh": {**table["mesh"], "parameters": fine}, "element": {"degree": 2}}
    true = alone(parse_scene(reference)).table.columns["pressure"].max()
    parameters["contact_size"] = 0.3
    solution = alone(parse_scene(table | {"accuracy": {"target": 0.01, "of": "peak"}}))
    rows = solution.convergence_table[:-1]
    error = abs(solution.table.columns["pressure"].max() - true) / true
    assert solution.converged
    assert error <= 2.5 * rows[-1].peak
    assert error <= 0.01
    for level, row in zip(solution.levels, rows, strict=True):
        assert (row.peak is None) >= (level.table.touching < 8)
    assert min(level.table.touching for level in solution.levels) < 4
