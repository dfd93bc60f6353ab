"""Cohesion: friction that a closed contact has without pressure, against statics by hand."""

import pytest
from mpi4py import MPI
from pushed_block import DRAGGED_PRESSURE, dragged_block
from scene_tables import rectangle_mesh

from signorini_fx import SceneError
from signorini_fx.records import Status
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.solver import solve

COMM = MPI.COMM_WORLD
F, C = 0.25, 1.5


def dragged(dim=2, gap=0.0, friction=None, **solver):
    """A low block that is pressed on its foundation with cohesion, and dragged along it."""
    friction = friction or {"law": "coulomb", "coefficient": F, "cohesion": C}
    return dragged_block({"gap": gap, "friction": friction}, dim, solver=solver)


@pytest.mark.mpi
@pytest.mark.parametrize(
    ("dim", "solver"),
    [
        (2, {}),
        (2, {"coulomb": "newton"}),
        (2, {"algorithm": "alm"}),
        (2, {"algorithm": "path-following"}),
        (3, {}),
        (3, {"algorithm": "alm", "linear_algebra": "krylov"}),
    ],
)
def test_a_block_that_slides(dim, solver):
    """The friction force is c times the area and F times the pressing force."""
    solution = solve(dragged(dim, **solver), COMM)
    _, friction = solution.contact.forces
    assert solution.converged
    assert solution.certificate.holds
    assert friction[0] == pytest.approx(-(C * 2.0 + F * DRAGGED_PRESSURE * 2.0), rel=1e-8)


def test_open_contact_has_none():
    """Over a step in the foundation the block does not touch: what is closed transmits c times its
    area, and given friction would be everywhere.
    """
    solution = solve(dragged(gap="0 if x[0] < 1.7 else 0.5"), COMM)
    closed = solution.contact.areas["contact"]
    assert solution.certificate.holds
    assert closed == pytest.approx(1.7)
    normal, friction = solution.contact.forces
    assert normal[1] == pytest.approx(2.0 * DRAGGED_PRESSURE)
    assert friction[0] == pytest.approx(-(C * closed + F * 2.0 * DRAGGED_PRESSURE), rel=1e-6)
    open_ = ~solution.contact.in_contact
    assert not solution.contact.bound[open_].any()
    assert not solution.contact.shear[open_].any()


@pytest.mark.parametrize("share", [0.98, 1.02])
def test_what_pushes_a_block_away(share):
    """Body forces push a long block against c A + F N: it rests below that, and slides above."""
    push = share * (C * 2.0 + F * DRAGGED_PRESSURE * 2.0) / 2.0
    scene = parse_scene(
        {
            "mesh": rectangle_mesh(20, 2, length=2.0, height=0.2),
            "material": {"young": 1e5, "poisson": 0.0},
            "body_force": {"x": push / 0.2, "y": -DRAGGED_PRESSURE / 0.2},
            "contact": {
                "boundary": "bottom",
                "friction": {"law": "coulomb", "coefficient": F, "cohesion": C},
            },
        }
    )
    solution = solve(scene, COMM, check=False)
    if share > 1:
        assert solution.status is Status.SLIDES
        return
    assert solution.converged
    assert solution.friction_used == pytest.approx(share, rel=1e-3)


@pytest.mark.parametrize("wrong", [-1.0, "y", "1/0", "-1 + 0*x[0]"])
def test_bad_values(wrong):
    """One error that names the key."""
    friction = {"law": "coulomb", "coefficient": 0.3, "cohesion": wrong}
    with pytest.raises(SceneError, match="cohesion") as caught:
        solve(dragged(friction=friction), COMM)
    assert len(caught.value.problems) == 1
