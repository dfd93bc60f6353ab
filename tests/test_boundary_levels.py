"""A condensed problem is solved on few contact nodes first: the same answer, from fewer solves on all of them."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from scenes import alone, example1, on_mesh, rectangle, table_of

from signorini_fx.body.discretisation import discretise
from signorini_fx.mesh.tagged import load_mesh
from signorini_fx.records import History, Timings
from signorini_fx.scene.reading import parse_scene
from signorini_fx.solving import boundary_levels
from signorini_fx.solving.one_mesh import contact_task

LONG = {"nx": 600, "ny": 12, "linear_algebra": "condensed"}


def task_of(scene):
    """The contact problem of a scene, not yet solved, and its discretisation."""
    discretisation = discretise(scene, load_mesh(scene, MPI.COMM_SELF), Timings())
    return contact_task(discretisation, discretisation.boundary, History()), discretisation


@pytest.mark.parametrize(
    "effects",
    [
        {"bound": 1.5},
        {"coefficient": 0.3, "coulomb": "fp"},
        {"coefficient": 0.3, "coulomb": "newton"},
        {},
        {"bound": 1.5, "algorithm": "exact"},
        {"bound": 1.5, "degree": 2, "nx": 300},
    ],
    ids=lambda effects: ", ".join(map(str, effects.values())) or "no friction",
)
def test_same_answer_from_fewer_solves(effects):
    """As the full system has it from contact everywhere, with at most six solves on all contact nodes."""
    settings = LONG | effects
    plain = alone(example1(**settings | {"linear_algebra": "full"}, patch="all"))
    nested = alone(example1(**settings, patch="auto"))
    for name in ("pressure", "shear"):
        ours, theirs = table_of(nested).columns[name], table_of(plain).columns[name]
        assert np.abs(ours - theirs).max() <= 3e-7 * table_of(plain).columns["pressure"].max()
    assert nested.certificate.holds
    assert nested.history.linear_solves <= min(6, plain.history.linear_solves / 2)
    assert [event.split(":")[0] for event in nested.history.events][-3:] == [
        f"{n} contact nodes first" for n in (76, 151, 301)
    ]
    assert not plain.history.events


@pytest.mark.parametrize(
    "friction",
    [{"law": "coulomb", "coefficient": 0.3}, {"law": "tresca", "bound": 0.5}],
    ids=lambda friction: friction["law"],
)
def test_a_body_that_only_contact_holds(friction):
    """Displacements count from a resting place, a turn included, and so does slip; on few nodes as on all."""

    def scene(start):
        return parse_scene(
            {
                "mesh": {"generator": "rectangle", "parameters": {"length": 1.0, "height": 0.1, "nx": 320, "ny": 4}},
                "material": {"young": 1000.0, "poisson": 0.3},
                "traction": {"boundary": "top", "x": 0.05, "y": "-1 - x[0]"},
                "contact": {"boundary": "bottom", "gap": "0.01 + 0.02 * (x[0] - 0.4)**2", "friction": friction},
                "solver": {"linear_algebra": "condensed", "initial_contact": start},
            }
        )

    task, _ = task_of(scene("auto"))
    assert task.rest is not None
    assert np.abs(task.rest.u_n).max() > 0.01
    assert task.start.data.slip_origin is not None
    plain, nested = (alone(scene(start)) for start in ("all", "auto"))
    assert sum("contact nodes first" in event and "converged" in event for event in nested.history.events) == 3
    assert nested.history.linear_solves < plain.history.linear_solves / 2
    ours, theirs = table_of(nested).columns, table_of(plain).columns
    for names, tolerance in ((("pressure", "shear"), 1e-6), (("u_n", "u_t"), 1e-9)):
        size = max(np.abs(theirs[name]).max() for name in names)
        for name in names:
            np.testing.assert_allclose(ours[name], theirs[name], rtol=0, atol=tolerance * size)


def test_few_nodes_start_as_in_the_paper():
    """The examples of the paper keep the iteration of the paper; a start that is given is taken."""
    assert not alone(example1(bound=1.5, nx=120, ny=40)).history.events
    assert not boundary_levels.worthwhile(*task_of(example1(bound=1.5, patch={"x": [1.0, 2.0]}, **LONG)))
    assert not boundary_levels.worthwhile(*task_of(example1(bound=1.5, patch="auto", algorithm="alm", **LONG)))
    assert boundary_levels.worthwhile(*task_of(example1(bound=1.5, patch="auto", **LONG)))


def test_coarse_matrix_is_galerkins():
    """P^T S P, P^T b and the length of the boundary, with P linear between every second node."""
    task, d = task_of(example1(bound=1.5, nx=24, ny=4, linear_algebra="condensed"))
    level = boundary_levels._coarser(boundary_levels._finest(task, d.boundary))
    fine, coarse = d.boundary, level.boundary
    order = np.argsort(coarse.x[:, 0])
    np.testing.assert_allclose(coarse.x[order, 0], np.linspace(0, 3, 13), atol=1e-12)
    hat = np.array([np.interp(fine.x[:, 0], coarse.x[order, 0], unit) for unit in np.eye(13)])
    hat = hat[np.argsort(order)]
    dense, reduced = task.system.matrix.getDenseArray(), level.system.matrix.getDenseArray()
    fixed = level.system.fixed
    assert np.count_nonzero(fixed) == 2  # both ends, along the boundary
    for component, free in ((0, ~fixed[0::2]), (1, ~fixed[1::2])):
        rows = 2 * np.argsort(np.argsort(fine.nodes)) + component
        expected = hat @ dense[np.ix_(rows, rows)] @ hat.T
        found = reduced[component::2, component::2]
        inside = np.ix_(free, free)
        # The prescribed ends are interpolated from nothing, and nothing from them: they count for themselves alone.
        np.testing.assert_allclose(found[inside], expected[inside], rtol=1e-12, atol=1e-9 * abs(dense).max())
        load = hat @ task.system.load.getArray()[rows]
        np.testing.assert_allclose(level.system.load.getArray()[component::2][free], load[free], atol=1e-12)
    np.testing.assert_allclose(coarse.weight.sum(), 3.0, rtol=1e-14)
    np.testing.assert_allclose(coarse.weight, hat @ fine.weight, atol=1e-15)


def test_what_few_nodes_know():
    """Each has its own gap and law; the ends of a boundary stay, and the node of two boundaries wherever it is."""
    friction = {"law": "coulomb", "coefficient": "0.2 + x[0]", "cap": "3 + x[0]"}
    task, d = task_of(
        parse_scene(
            {
                "mesh": {"generator": "rectangle", "parameters": {"length": 1.0, "height": 1.0, "nx": 5, "ny": 5}},
                "material": {"young": 1000.0, "poisson": 0.3},
                "displacement": {"boundary": "top", "x": 0.0, "y": -0.01},
                "contact": [
                    {"boundary": "bottom", "gap": "0.01 * x[0]", "friction": friction},
                    {"boundary": "left", "gap": "0.02 * x[1]", "friction": {"law": "tresca", "bound": "1 + x[1]"}},
                ],
                "solver": {"linear_algebra": "condensed"},
            }
        )
    )
    finest = boundary_levels._finest(task, d.boundary)
    level = boundary_levels._coarser(finest)
    rows = level.retained
    assert sorted(d.boundary.x[rows].max(axis=1).round(9)) == [0.0, 0.0, 0.4, 0.4, 0.8, 0.8, 1.0, 1.0]
    np.testing.assert_array_equal(level.data.gap, finest.data.gap[rows])
    for name in ("given", "coefficient", "cap"):
        np.testing.assert_array_equal(getattr(level.law, name), getattr(finest.law, name)[rows], err_msg=name)
    # Where a boundary goes on beyond the node of two, that is none of its ends.
    beyond = replace(finest, chains=[np.roll(chain, 1) for chain in finest.chains])
    corner = np.flatnonzero(np.abs(d.boundary.x).max(axis=1) < 1e-9)
    assert corner.size == 2
    assert set(corner) <= set(boundary_levels._coarser(beyond).retained)


def test_two_boundaries_with_a_common_node():
    """A block pressed into the corner of two foundations: the corner node stays, with both its normals."""
    scene = parse_scene(
        {
            "material": {"young": 1000.0, "poisson": 0.3},
            "traction": [{"boundary": "top", "y": -1.0}, {"boundary": "right", "x": -1.0}],
            "contact": [
                {"boundary": "bottom", "friction": {"law": "coulomb", "coefficient": 0.2}},
                {"boundary": "left", "friction": {"law": "tresca", "bound": 0.1}},
            ],
            "solver": {"linear_algebra": "condensed"},
        }
        | {"mesh": {"generator": "rectangle", "parameters": {"length": 1.0, "height": 1.0, "nx": 2, "ny": 2}}}
    )
    tagged = rectangle(length=1.0, height=1.0, nx=160, ny=160)
    plain, nested = (
        alone(
            on_mesh(
                scene.model_copy(update={"solver": scene.solver.model_copy(update={"initial_contact": start})}), tagged
            )
        )
        for start in ("all", "auto")
    )
    assert any("contact nodes first" in event and "converged" in event for event in nested.history.events)
    for name in ("pressure", "shear"):
        ours, theirs = table_of(nested).columns[name], table_of(plain).columns[name]
        assert np.abs(ours - theirs).max() <= 1e-6 * table_of(plain).columns["pressure"].max()
