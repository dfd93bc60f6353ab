"""A contact boundary that is closed, such as a hole: the interval from its last node to its first is one of them."""

import numpy as np
import pytest
from scenes import alone, table_of

from signorini_fx.mechanics.contact_points.contact_table import ContactTable, is_closed
from signorini_fx.results.accuracy.convergence_table import ends_of_zones
from signorini_fx.results.accuracy.pressure_error import on_facets
from signorini_fx.scenes.reading import parse_scene


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


def test_all_of_it_in_contact():
    """It is one zone without ends."""
    assert ends_of_zones(ring_table(12, np.ones_like)) is None
