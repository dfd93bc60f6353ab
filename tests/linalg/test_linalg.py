"""Elastic systems of every kind give the same answer, and their parts do what they say."""

import numpy as np
import pytest
from mpi4py import MPI
from petsc4py import PETSc
from scenes import alone, example1, table_of

from signorini_fx.algebra.linalg import full, partial_factor, schur
from signorini_fx.mechanics.body.discretisation import discretise
from signorini_fx.mechanics.statement.expressions import Expression
from signorini_fx.records import Timings
from signorini_fx.scenes.mesh import load_mesh
from signorini_fx.scenes.reading import parse_scene
from signorini_fx.scenes.sweep import sweep

COMM = MPI.COMM_SELF


@pytest.mark.parametrize("size", [1, 7, 256, 257, 600])
@pytest.mark.parametrize("triangle", [np.tril, np.triu], ids=["lower", "upper"])
def test_one_triangle_makes_a_symmetric_matrix(size, triangle):
    """Whichever triangle MUMPS has filled, and whatever is in the other one."""
    values = np.random.default_rng(size).uniform(1.0, 2.0, (size, size))
    symmetric = values + values.T
    half = triangle(symmetric)
    partial_factor._symmetrise(half)
    if triangle is np.tril:
        np.testing.assert_array_equal(half, symmetric)
    else:  # in place where the array is its own; a caller with the upper one sees the lower one filled
        np.testing.assert_array_equal(np.triu(half), np.triu(symmetric))
        np.testing.assert_array_equal(np.tril(half), np.tril(symmetric))


@pytest.mark.parametrize("definite", [True, False])
@pytest.mark.parametrize("count", [0, 3])
@pytest.mark.parametrize("placed", [None, 40, 30])
def test_schur_complement_with_loads(definite, count, placed):
    """Against dense algebra, in odd units, with loads of very different sizes and none."""
    generator = np.random.default_rng(count)
    half = generator.normal(size=(40, 40)) * (generator.random((40, 40)) < 0.2)
    dense = 1e-9 * (half + half.T + 20 * np.diag(generator.choice([1.0, 1.0 if definite else -1.0], 40)))
    retained = np.array([31, 0, 17, 5], dtype=np.int32)
    inside = np.setdiff1d(np.arange(40), retained)
    loads = [generator.normal(size=40) * (generator.random(40) < 0.5) * size for size in (1e9, 1e-12, 0.0)[:count]]
    matrix = PETSc.Mat().createDense((40, 40), array=dense, comm=COMM)
    matrix.assemble()
    matrix = matrix.convert("aij")
    positions = None if placed is None else np.repeat(generator.normal(size=(placed // 2, 2)), 2, axis=0)
    found = schur.SchurComplement(matrix, retained, loads, positions, definite=definite)
    lift = np.linalg.solve(dense[np.ix_(inside, inside)], dense[np.ix_(inside, retained)])
    expected = dense[np.ix_(retained, retained)] - dense[np.ix_(retained, inside)] @ lift
    np.testing.assert_allclose(found.dense, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
    assert found.loads.shape == (count, 4)
    for load, condensed in zip([*loads, np.ones(40)], [*found.loads, None], strict=True):
        right = PETSc.Vec().createWithArray(load, comm=COMM)
        reference, tolerance = load[retained] - lift.T @ load[inside], 1e-12 * np.abs(load).max()
        for one in (condensed, found.condense(right)[0]):
            if one is not None:
                np.testing.assert_allclose(one, reference, rtol=0, atol=tolerance)
        again = right.duplicate()  # without a back substitution
        again.setArray(np.where(np.isin(np.arange(40), retained), 2.0 * load + 1.0, load))
        twice = found.condense(again)[0] - found.condense(right)[0]
        np.testing.assert_allclose(twice, load[retained] + 1.0, rtol=0, atol=10 * tolerance + 1e-12)
        values = generator.normal(size=4)
        every = found.recover(right, np.empty(0), values).getArray()
        np.testing.assert_array_equal(every[retained], values)
        solved = np.linalg.solve(dense[np.ix_(inside, inside)], load[inside] - dense[np.ix_(inside, retained)] @ values)
        np.testing.assert_allclose(every[inside], solved, rtol=0, atol=1e-12 * np.abs(solved).max(initial=0))
    np.testing.assert_array_equal(matrix.convert("dense").getDenseArray(), dense)


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


def test_prescribed_displacements_of_a_load_step():
    """They have the factor of the step and that of the loads."""
    scene = example1(bound=1.5, nx=6, ny=2)
    left, right = scene.displacement
    moved = left.model_copy(update={"x": 0.001, "factors": (1.0, -3.0)})
    d = discretise(
        scene.model_copy(update={"displacement": (moved, right)}).statement, load_mesh(scene, COMM), Timings()
    )
    system = full.FullSystem.of(d.elasticity(d.cases))
    for step, factor in ((0, 1.0), (1, -3.0)):
        for scale in (1.0, 0.5):
            system.set_load(scale * d.factors(step))
            values = system.start.getArray()
            assert values[np.abs(values).argmax()] == pytest.approx(0.001 * factor * scale)


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
