"""A contact boundary that is closed, such as a hole: the interval from its last node to its first is one of them."""

import numpy as np
import pytest
from mpi4py import MPI
from scenes import alone, table_of

from signorini_fx.addons.pictures.boundary_profiles import boundaries_of
from signorini_fx.addons.report.advice import _zone_sizes
from signorini_fx.addons.report.interactive import _data
from signorini_fx.mechanics.contact_points.contact_boundary import chains, in_line
from signorini_fx.mechanics.contact_points.contact_table import ContactTable, is_closed
from signorini_fx.results.accuracy.contact_values import interpolated
from signorini_fx.results.accuracy.convergence_table import zone_ends
from signorini_fx.results.accuracy.data_error import data_error
from signorini_fx.results.accuracy.pressure_error import corners_of_error, interval_squares, on_facets
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

COMM = MPI.COMM_WORLD


def plate(*, degree=1, order=1, pull=0.02, **changes):
    """A plate on a pin: the whole hole may touch it; the pull is towards the start of the hole, (-1, 0)."""
    parameters = {"length": 6.0, "height": 4.0, "size": 1.0, "contact_size": 0.2, "order": order}
    contact = {"boundary": "hole", "gap": "0.001 * (1 + x[0])", "friction": {"law": "coulomb", "coefficient": 0.2}}
    return parse_scene(
        {
            "mesh": {"generator": "plate_with_hole", "parameters": parameters},
            "element": {"degree": degree},
            "material": {"young": 5000.0, "poisson": 0.3},
            "displacement": [{"boundary": "right", "x": pull, "y": 0.0}],
            "contact": contact | changes.pop("contact", {}),
            **changes,
        }
    )


def ring_table(count, pressure, *, start=0):
    """Nodes on the unit circle, one closed piece, with the row ``start`` at the angle 0."""
    angle = 2 * np.pi * (np.arange(count) - start) / count
    side = 2 * np.sin(np.pi / count)
    columns = {"x": np.cos(angle), "y": np.sin(angle), "s": side * np.arange(count), "to_next": np.full(count, side)}
    columns |= {"pressure": pressure(angle), "weight": np.full(count, side), "boundary": np.full(count, "hole")}
    return ContactTable(columns, [range(count)])


def hump(angle):
    """A pressure around the angle 0."""
    return np.maximum(np.cos(angle) - 0.6, 0.0)


@pytest.mark.parametrize("degree", [1, 2])
def test_every_facet_has_its_intervals(degree):
    """All of the closed polygon, and on each facet what belongs to it: with lengths as values, its length."""
    solution = alone(plate(degree=degree))
    table, boundary = table_of(solution), solution.contact.boundary
    [path] = table.paths
    assert is_closed(path)
    assert len(path) - 1 == len(table.columns["x"]) == degree * len(boundary.segments)
    lengths = on_facets(boundary, table, [np.diff(table.arc(path))])
    ends = {int(node): x for node, x in zip(boundary.global_nodes, boundary.x, strict=True)}
    paths = [np.array([ends[int(node)] for node in nodes]) for _, *nodes in boundary.segments]
    expected = [np.linalg.norm(np.diff(x, axis=0), axis=1).sum() for x in paths]
    np.testing.assert_allclose(lengths, expected, rtol=1e-12)
    assert table.arc(path)[-1] == pytest.approx(sum(expected))


@pytest.mark.parametrize("start", [0, 1, 5, 17])
def test_nothing_depends_on_where_it_begins(start):
    """Estimates of the pressure, and the ends of its zone; the zone across the beginning is one."""
    count = 24
    first, table = ring_table(count, hump), ring_table(count, hump, start=start)
    shift = start * table.columns["to_next"][0]
    [reference], [squares] = interval_squares(first), interval_squares(table)
    np.testing.assert_allclose(squares, np.roll(reference, start), atol=1e-15)
    assert len(squares) == count
    assert len(corners_of_error(table)) == len(corners_of_error(first)) == 0
    round_it = table.arc(table.paths[0])[-1]
    ends, known = (zone_ends(one)[:, :, 0].ravel() for one in (table, first))
    assert ends.size == 2
    assert ends[1] - ends[0] == pytest.approx(known[1] - known[0])
    np.testing.assert_allclose((ends - shift - known + 1e-9) % round_it, 1e-9, atol=1e-10)
    zones = table.zones(table.columns["pressure"] > 0)
    np.testing.assert_allclose(zones, first.zones(first.columns["pressure"] > 0), atol=1e-12)
    assert len(zones) == 1
    columns = {**table.columns, "state": np.where(table.columns["pressure"] > 0, "stick", "open")}
    assert _zone_sizes(columns) == [7]


def test_between_the_last_node_and_the_first():
    """A finer mesh sees the coarse values there too; all of it in contact is one zone without ends."""
    coarse, fine = ring_table(12, np.cos), ring_table(24, np.cos)
    values = interpolated(coarse, fine, "pressure")
    p = coarse.columns["pressure"]
    assert values[-1] == pytest.approx((p[-1] + p[0]) / 2)  # as far from the last coarse node as from the first
    assert not zone_ends(ring_table(12, np.ones_like)).size


@pytest.mark.parametrize(("count", "least"), [(8, 8), (200, 5)])
def test_a_part_in_contact_has_nodes(count, least):
    """The last node of a side is in contact: of a coarse one all is drawn, as nothing of the part was to be seen."""
    columns = {name: np.zeros(count) for name in ("y", "gap", "u_n", "u_t", "shear", "bound", "weight")}
    columns |= {"x": np.linspace(170.0, 200.0, count), "s": np.linspace(0.0, 30.0, count)}
    columns |= {"to_next": np.append(np.diff(columns["s"]), 0.0), "pressure": (np.arange(count) == 0) * 1.0}
    columns |= {"state": np.where(columns["pressure"] > 0, "stick", "open"), "friction": np.full(count, "stick")}
    [boundary] = boundaries_of({**columns, "boundary": np.full(count, "foot")})
    assert least <= len(boundary.near().coordinate) < (count + 1 if count == least else count)


def test_pictures_close_the_curve():
    """A curve along the boundary ends with its first value, in pictures and in tables to zoom into."""
    table = ring_table(12, hump)
    nothing = dict.fromkeys(("gap", "u_n", "u_t", "shear", "bound"), np.zeros(12))
    texts = {"state": np.full(12, "open"), "friction": np.full(12, "none"), "boundary": np.full(12, "hole")}
    [boundary] = boundaries_of({**table.columns, **nothing, **texts})
    np.testing.assert_allclose(boundary.coordinate, table.arc(table.paths[0]))
    assert boundary.floats("pressure")[-1] == boundary.floats("pressure")[0]
    assert boundary.starts == [0]
    rows = _data(boundary)["panels"][0]["rows"]
    assert len(rows) == 13
    assert rows[-1][1] == rows[0][1] == pytest.approx(0.4)


@pytest.mark.one_quick
@pytest.mark.mpi
@pytest.mark.parametrize(
    "changes",
    [
        {"contact": {"direction": [-1.0, -1.0]}, "pull": -0.02},
        {"solver": {"algorithm": "alm"}},
        {"contact": {"friction": {"law": "coulomb", "coefficient": 0.2, "cap": 1.0}}},
        {"degree": 2},
    ],
    ids=["direction", "alm", "cap", "degree 2"],
)
def test_levels_and_data_error(changes):
    """Estimates of all kinds on a hole, on any number of ranks the same."""
    changes = dict(changes)
    solver = {"levels": 2} | changes.pop("solver", {})
    scene = plate(solver=solver, **changes)
    solution, alike = solve(scene), alone(scene)
    for one, other in zip(solution.convergence_table, alike.convergence_table, strict=True):
        assert one.pressure == pytest.approx(other.pressure, rel=1e-6)
        assert one.energy == pytest.approx(other.energy, rel=1e-6)
    table = solution.table
    missed = data_error(solution.model, table, 0)
    assert np.isfinite(missed.squares).all()
    [path] = table.paths
    assert len(path) == len(table.columns["x"]) + 1


def test_where_a_line_begins():
    """At its lower end, also if round-off has moved that aside."""
    for aside in (0.0, 1e-16, -1e-16):
        x = np.array([(aside, 0.0), (0.0, 1.0), (0.0, 2.0)])
        numbers, segments = np.array([(0, 0), (0, 1), (0, 2)]), np.array([(0, 0, 1), (0, 1, 2)])
        pieces, order, closed = chains(numbers, segments, x)
        assert (pieces, order.tolist(), closed) == ([range(3)], [0, 1, 2], [False])


def test_a_single_point_is_in_line_with_itself():
    """Without a division by its extent, which is nothing."""
    assert in_line(np.array([[3e12, -5.0]])).tolist() == [[0.0, 0.0]]
    assert in_line(np.array([[2.0, 1.0], [4.0, 1.0 + 1e-12]])).tolist() == [[1.0, 0.5], [2.0, 0.5]]
