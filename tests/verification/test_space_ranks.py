"""The number of ranks changes nothing in 3D either; more ranks than contact facets; errors raised alike."""

import numpy as np
import pytest
from mpi4py import MPI
from spaces import block, box, friction_of
from test_ranks import same_on_all_ranks
from test_space_patch import rotation

from signorini_fx.mechanics.mesh.tagged import tag_boundaries
from signorini_fx.records import Status
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

pytestmark = pytest.mark.mpi
WORLD = MPI.COMM_WORLD


def brick(comm, **effects):
    """A brick that friction alone holds, pushed obliquely."""
    return parse_scene(
        {
            "mesh": box("hexahedra", (4, 4, 2), size=(2.0, 2.0, 1.0), comm=comm),
            "material": {"young": 1000.0, "poisson": 0.3},
            "traction": {"boundary": "top", "pressure": 10.0},
            "body_force": {"x": 2.0, "y": 1.5},
            "contact": {"boundary": "bottom", "friction": friction_of(coefficient=0.3)},
            **effects,
        }
    )


def foot(comm, cells, degree=1):
    """Three cells in a row, of which the middle one stands on the foundation: by one square, or two triangles."""
    mesh = box(cells, (3, 1, 1), comm=comm)
    tagged = tag_boundaries(
        mesh.mesh,
        {
            "top": lambda x: np.abs(x[2] - 1) < 1e-9,
            "foot": lambda x: (np.abs(x[2]) < 1e-9) & (np.abs(x[0] - 1.5) < 0.5 + 1e-9),
        },
    )
    return parse_scene(
        {
            "mesh": tagged,
            "element": {"degree": degree},
            "material": {"young": 1000.0, "poisson": 0.3},
            "traction": {"boundary": "top", "pressure": 1.0, "x": 0.1, "y": 0.05},
            "contact": {"boundary": "foot", "friction": friction_of(coefficient=0.5)},
        }
    )


def between_walls(comm, cells, degree=1):
    """A brick turned in 3D between two walls that are across no axis, pushed along both of them."""
    back = rotation(0.9, (0.3, -0.8, 0.5))
    tagged = box(cells, (4, 3, 3), size=(1.5, 1.2, 1.0), comm=comm)
    tagged.mesh.geometry.x[:] = tagged.mesh.geometry.x @ back.T
    return parse_scene(
        {
            "mesh": tagged,
            "element": {"degree": degree},
            "material": {"young": 1000.0, "poisson": 0.3},
            "displacement": [{"boundary": "left", "normal": 0.001}, {"boundary": "front", "normal": 0.0}],
            "traction": {"boundary": "top", **dict(zip("xyz", map(float, back @ [1.0, 2.0, -10.0]), strict=True))},
            "contact": {"boundary": "bottom", "friction": friction_of(coefficient=0.3)},
        }
    )


SCENES = {
    "frictionless": lambda comm: block(12, comm=comm),
    "tresca": lambda comm: block(12, bound=1.5, comm=comm),
    "coulomb, tetrahedra": lambda comm: block(12, "tetrahedra", coefficient=0.3, comm=comm),
    "monolithic": lambda comm: block(12, coefficient=0.3, coulomb="newton", comm=comm),
    "alm": lambda comm: block(12, bound=1.5, gamma="auto", algorithm="alm", comm=comm),
    "quadratic tetrahedra": lambda comm: block(6, "tetrahedra", bound=1.5, degree=2, comm=comm),
    "quadratic, monolithic": lambda comm: block(
        6, "tetrahedra", coefficient=0.3, coulomb="newton", degree=2, comm=comm
    ),
    "walls across no axis": lambda comm: between_walls(comm, "hexahedra"),
    "walls across no axis, quadratic": lambda comm: between_walls(comm, "tetrahedra", degree=2),
    "three facets": lambda comm: block(3, bound=1.5, comm=comm),
    "one facet": lambda comm: foot(comm, "hexahedra"),
    "two facets": lambda comm: foot(comm, "tetrahedra"),
    "two quadratic facets": lambda comm: foot(comm, "tetrahedra", degree=2),
    "held by friction": brick,
    "slides": lambda comm: brick(comm, body_force={"x": 4.0}),
}


@pytest.mark.one_quick
@pytest.mark.parametrize("name", SCENES)
def test_one_rank_or_many(name):
    """Scenes of every kind."""
    agree(SCENES[name])


def agree(scene, *, counts=True):
    """All ranks together get what one rank gets: status, counts, and numbers to 1e-9 of the largest.

    Args:
        scene: makes it on the given ranks.
        counts: whether counts must agree; loose solves by multigrid are others on each number of ranks.
    """
    together, alone = (solve(scene(comm), comm, check=False) for comm in (WORLD, MPI.COMM_SELF))
    assert same_on_all_ranks(together.status) is alone.status
    sets = [[(r.active_contact, r.slip_plus, r.changed) for r in s.history.iterations] for s in (together, alone)]
    assert same_on_all_ranks(sets[0]) == sets[1] or not counts
    if alone.status is not Status.CONVERGED:
        return
    ours, theirs = together.table.columns, alone.table.columns
    for names in (
        ("x", "y", "z"),
        ("weight",),
        ("u_n", "u_t", "u_t_x", "u_t_y"),
        ("pressure", "shear", "shear_x", "shear_y", "bound"),
    ):
        close = 1e-9 * max(np.abs(theirs[one]).max() for one in names)
        for one in names:
            np.testing.assert_allclose(ours[one], theirs[one], rtol=0, atol=close, err_msg=one)
    for one in ("state", "friction", "boundary"):
        assert ours[one].tolist() == theirs[one].tolist()
    assert same_on_all_ranks(together.certificate.holds) == alone.certificate.holds is True
    np.testing.assert_allclose(together.contact.forces, alone.contact.forces, atol=1e-8)
    assert same_on_all_ranks(together.contact.areas) == pytest.approx(alone.contact.areas)
