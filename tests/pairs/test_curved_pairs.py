"""Two curved bodies: frames half-way between both, so that mirror images show no shear and sides can be exchanged."""

import numpy as np
import pytest
import scipy.sparse as sp
from curved_pairs import figures, mirrored, press

from signorini_fx.algebra.linalg.relative_displacements import of_all_ranks


@pytest.mark.one_quick
@pytest.mark.parametrize(
    ("kind", "cells", "depth", "degree"),
    [
        ("quadrilateral", (14, 10), 0.18, 1),
        ("triangle", (10, 8), 0.18, 2),
        ("hexahedron", (4, 4), 0.4, 1),
    ],
)
def test_mirror_images(kind, cells, depth, degree):
    """Matching meshes at a/R of .1 to .2: no shear, and the force of one body on a plane.

    With the frame of one side friction took 15 and 55 % of F P, and the force was .5 and 4.6 % off.
    """
    force, share, ratio = mirrored(kind, (cells, cells), 8.0, depth, degree=degree)
    assert ratio > 0.08
    assert abs(force) < 5e-4
    assert share < 5e-3


@pytest.mark.slow
@pytest.mark.parametrize(("young", "radii"), [((200.0, 6000.0), (8.0, 8.0)), ((200.0, 200.0), (6.0, 20.0))])
def test_either_side_may_have_the_points(young, radii):
    """Unequal moduli or radii, on meshes that match: force and friction are the same but for the discretisation, where
    with one-sided frames friction differed by half of itself.
    """
    both = [figures(press("quadrilateral", ((24, 16),) * 2, radii, 0.1, young=young, slave=k)) for k in (0, 1)]
    assert both[0].force == pytest.approx(both[1].force, rel=2e-3)
    assert both[0].share == pytest.approx(both[1].share, abs=5e-3)


@pytest.mark.one_quick
@pytest.mark.parametrize(("kind", "cells"), [("quadrilateral", ((14, 8), (10, 8))), ("hexahedron", ((4, 3), (3, 3)))])
def test_motions_that_move_points_alone(kind, cells, monkeypatch):
    """B S = 1 up to the square of a small angle where bodies touch, though points turn with their own nodes."""
    problem = press(kind, cells, (8.0, 8.0), 0.2, linear_algebra="full")
    contact = problem.assembled.task.system.contact
    B, S = (of_all_ranks(contact.points.comm, matrix) for matrix in (contact.operator, contact.lift))
    dim = contact.points.dimension
    closed = np.repeat(problem.state.pressure > 0, dim)
    left = abs(B @ S - sp.eye_array(closed.size)).tocsr()[closed][:, closed]
    embedded = abs(B @ (S.multiply(abs(S) > 0.5)) - sp.eye_array(closed.size)).tocsr()[closed][:, closed]
    assert left.max() < 5e-3
    assert embedded.max() > 5 * left.max()
