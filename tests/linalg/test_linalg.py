"""Elastic systems of every kind give the same answer."""

import numpy as np
import pytest
from mpi4py import MPI
from scenes import alone, example1, table_of

from signorini_fx.mechanics.statement.expressions import Expression
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.sweep import sweep


def turned(**solver):
    """Half a disk, whose contact nodes have normals of their own, held by friction."""
    return parse_scene(
        {
            "mesh": {"generator": "half_disk", "parameters": {"radius": 1.0, "size": 0.2, "contact_size": 0.1}},
            "material": {"young": 5000.0, "poisson": 0.3},
            "traction": {"boundary": "top", "x": 0.5, "y": -5.0},
            "contact": {"boundary": "arc", "gap": 1e-3, "friction": {"law": "tresca", "bound": 1.0}},
            "solver": solver,
        }
    )


@pytest.mark.one_quick
@pytest.mark.parametrize("algorithm", ["ssn", "alm"])
def test_condensed_with_turned_nodes(algorithm):
    """The dense matrix in the frames of the nodes, against the sparse one."""
    ours, theirs = (table_of(alone(turned(algorithm=algorithm, linear_algebra=k))) for k in ("condensed", "full"))
    for name in ("pressure", "shear"):
        close = 1e-7 * theirs.columns["pressure"].max()
        np.testing.assert_allclose(ours.columns[name], theirs.columns[name], rtol=0, atol=close)


@pytest.mark.parametrize("kind", ["condensed", "full"])
def test_scaled_loads(kind):
    """Half and twice the loads, in the interior of the body too; prescribed displacements are loads."""

    def scaled(factor, kind):
        scene = example1(bound=1.5, nx=12, ny=4, gamma=1e6, linear_algebra=kind)
        left, right = scene.displacement
        pressed = scene.traction[0].model_copy(update={"y": Expression(f"{-20 * factor} if 1 <= x[0] <= 2 else 0")})
        moved = left.model_copy(update={"x": 0.001 * factor})
        return scene.model_copy(update={"displacement": (moved, right), "traction": (pressed,)})

    for point in sweep(scaled(1.0, kind), MPI.COMM_SELF, loads=[1.0, 0.5, 2.0]):
        wanted = alone(scaled(point.value, "full")).displacement.x.array
        found = point.displacement().x.array
        np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-9 * np.abs(wanted).max())
        assert point.certificate().holds
