"""A condensed problem is solved at some of its contact nodes first: the same answer, from fewer solves at all."""

from dataclasses import replace

import numpy as np
import pytest
from mpi4py import MPI
from scenes import alone, bar_on_a_bowl, example1, on_mesh, rectangle, table_of
from two_bodies import assembled, grid

from signorini_fx.body.discretisation import discretise
from signorini_fx.mesh.tagged import load_mesh, tag_boundaries
from signorini_fx.records import History, Status, Timings
from signorini_fx.scene.reading import parse_scene
from signorini_fx.solving import fewer_nodes
from signorini_fx.solving.one_mesh import contact_task

LONG = {"nx": 600, "ny": 6, "linear_algebra": "condensed"}


def task_of(scene):
    """The contact problem of a scene, not yet solved, and its discretisation."""
    discretisation = discretise(scene, load_mesh(scene, MPI.COMM_SELF), Timings())
    return contact_task(discretisation, History()), discretisation


def line_of(boundary):
    """The points of a contact boundary along x[0]."""
    return np.argsort(boundary.x[:, 0])


def first_solves(solution):
    """Of the events those about fewer nodes."""
    return [event for event in solution.history.events if "contact nodes first" in event]


@pytest.mark.parametrize(
    "effects",
    [
        {"bound": 1.5},
        {"coefficient": 0.3, "coulomb": "fp", "tolerance": 1e-11},
        {"coefficient": 0.3, "coulomb": "newton"},
        {},
        {"bound": 1.5, "algorithm": "exact"},
        {"bound": 1.5, "degree": 2, "nx": 300},
    ],
    ids=lambda effects: ", ".join(map(str, effects.values())) or "no friction",
)
def test_same_answer_from_fewer_solves(effects):
    """As from contact everywhere, with at most seven solves for all contact nodes."""
    plain, begun = (alone(example1(**LONG | effects, patch=start)) for start in ("all", "auto"))
    ours, theirs = table_of(begun).columns, table_of(plain).columns
    for name in ("pressure", "shear"):
        assert np.abs(ours[name] - theirs[name]).max() <= 1e-9 * theirs["pressure"].max()
    assert begun.certificate.holds
    assert begun.history.linear_solves <= min(7, plain.history.linear_solves / 2)
    assert [event.split()[0] for event in first_solves(begun)] == ["151", "301"]
    assert not plain.history.events


@pytest.mark.parametrize("law", ["coulomb", "tresca"])
def test_a_body_that_only_contact_holds(law):
    """Displacements count from a resting place, a turn included, and so does slip; at some nodes as at all."""

    plain, begun = (alone(bar_on_a_bowl(320, law, start)) for start in ("all", "auto"))
    assert all("converged" in event for event in first_solves(begun))
    assert begun.history.linear_solves < plain.history.linear_solves / 2
    ours, theirs = table_of(begun).columns, table_of(plain).columns
    for names, tolerance in ((("pressure", "shear"), 1e-6), (("u_n", "u_t"), 1e-9)):
        size = max(np.abs(theirs[name]).max() for name in names)
        for name in names:
            np.testing.assert_allclose(ours[name], theirs[name], rtol=0, atol=tolerance * size)


def test_two_boundaries_with_a_common_node():
    """A block pressed into the corner of two foundations."""

    def scene(start):
        return parse_scene(
            {
                "mesh": {"generator": "rectangle", "parameters": {"length": 1.0, "height": 1.0, "nx": 2, "ny": 2}},
                "material": {"young": 1000.0, "poisson": 0.3},
                "traction": [{"boundary": "top", "y": -1.0}, {"boundary": "right", "x": -1.0}],
                "contact": [
                    {"boundary": "bottom", "friction": {"law": "coulomb", "coefficient": 0.2}},
                    {"boundary": "left", "friction": {"law": "tresca", "bound": 0.1}},
                ],
                "solver": {"linear_algebra": "condensed", "initial_contact": start},
            }
        )

    tagged = rectangle(length=1.0, height=1.0, nx=160, ny=160)
    plain, begun = (alone(on_mesh(scene(start), tagged)) for start in ("all", "auto"))
    assert all("converged" in event for event in first_solves(begun))
    assert first_solves(begun)
    ours, theirs = table_of(begun).columns, table_of(plain).columns
    for name in ("pressure", "shear"):
        assert np.abs(ours[name] - theirs[name]).max() <= 1e-6 * theirs["pressure"].max()


def test_where_it_is_worthwhile():
    """The examples of the paper keep the iteration of the paper; a start that is given is taken."""
    assert not alone(example1(bound=1.5, nx=120, ny=40, patch="auto")).history.events
    for others, expected in (
        ({}, True),
        ({"patch": "all"}, False),
        ({"patch": {"x": [1.0, 2.0]}}, False),
        ({"algorithm": "alm"}, False),
        ({"linear_algebra": "full"}, False),
        ({"nx": 240}, False),
    ):
        settings = LONG | {"patch": "auto"} | others
        assert fewer_nodes.worthwhile(*task_of(example1(bound=1.5, **settings))) is expected, others


def test_without_a_solution_at_fewer_nodes(monkeypatch):
    """The problem starts as it would without."""
    settings = LONG | {"nx": 330, "ny": 6, "bound": 1.5}
    solve = fewer_nodes.solve_task
    monkeypatch.setattr(fewer_nodes, "solve_task", lambda *task: replace(solve(*task), status=Status.CYCLING))
    plain, begun = (alone(example1(**settings, patch=start)) for start in ("all", "auto"))
    assert [event.split()[-1] for event in first_solves(begun)] == [Status.CYCLING.value.split()[-1]]
    assert [record.changed for record in begun.history.iterations] == [
        record.changed for record in plain.history.iterations
    ]


def test_galerkin_system():
    """P^T S P and P^T (b - S start), with P linear between every fourth node and zero where a support prescribes."""
    scene = example1(bound=1.5, nx=24, ny=8, linear_algebra="condensed")
    moved = [effect.model_copy(update={"x": 0.01}) for effect in scene.displacement]
    task, d = task_of(scene.model_copy(update={"displacement": tuple(moved)}))
    coarse, some = fewer_nodes._with_every(4, [line_of(d.boundary)], task, d.boundary)
    system, small = task.system, coarse.system
    x, at = d.boundary.x[:, 0], some.x[:, 0]
    np.testing.assert_allclose(np.sort(at), np.linspace(0, 3, 7), atol=1e-12)
    hat = np.array([np.interp(x, np.sort(at), unit) for unit in np.eye(7)])[np.argsort(np.argsort(at))].T
    numbers, few = (np.argsort(np.argsort(nodes)) for nodes in (d.boundary.nodes, some.nodes))
    change = np.zeros((2 * x.size, 2 * at.size))
    for component in (0, 1):
        change[np.ix_(2 * numbers + component, 2 * few + component)] = hat
    fixed = system.contact.fixed
    change[fixed] = 0.0
    free = ~fixed[(2 * np.sort(numbers[np.isin(d.boundary.nodes, some.nodes)])[:, None] + [0, 1]).ravel()]
    change = change[:, free]
    dense = system.matrix.getDenseArray()
    start, load = system.start.getArray(), system.load.getArray()
    assert start.any()
    np.testing.assert_allclose(small.matrix.getDenseArray(), change.T @ dense @ change, atol=1e-11 * abs(dense).max())
    expected = change.T @ (load - dense @ start)
    np.testing.assert_allclose(small.load.getArray(), expected, atol=1e-11 * abs(expected).max())
    assert not small.contact.fixed.any()
    # Relative displacements are those of start + P x, counted from those of the start, as gaps and slip are.
    x_small, x_all = small.load.duplicate(), system.load.duplicate()
    x_small.getArray()[:] = np.sin(np.arange(free.sum()))
    x_all.getArray()[:] = start + change @ x_small.getArray()
    rows = np.flatnonzero(np.isin(d.boundary.nodes, some.nodes))
    data = coarse.start.data
    for found, counted, all_at in zip(
        small.contact.traces(x_small), (data.gap, data.slip_origin), system.contact.traces(x_all), strict=True
    ):
        given = task.start.data.gap if found.ndim == 1 else np.zeros_like(all_at)
        np.testing.assert_allclose(found - counted, (all_at - given)[rows], atol=1e-13)
    np.testing.assert_allclose(some.weight, (hat.T @ d.boundary.weight), atol=1e-15)


def test_what_fewer_nodes_know():
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
    boundary = d.boundary
    along = boundary.x.max(axis=1)
    lines = [np.flatnonzero(boundary.part == part) for part in (0, 1)]
    lines = [line[np.argsort(along[line])] for line in lines]
    coarse, some = fewer_nodes._with_every(2, lines, task, boundary)
    places = sorted(some.x.max(axis=1).round(9))
    assert places == [0.0, 0.0, 0.4, 0.4, 0.8, 0.8, 1.0, 1.0]
    names = [list(zip(points.part, points.nodes, strict=True)) for points in (boundary, some)]
    rows = np.array([names[0].index(name) for name in names[1]])
    u_n, _ = task.system.contact.traces(task.system.start)
    np.testing.assert_allclose(coarse.start.data.gap, (task.start.data.gap - u_n)[rows], atol=1e-15)
    for name in ("given", "coefficient", "cap"):
        np.testing.assert_array_equal(
            getattr(coarse.start.law, name), getattr(task.start.law, name)[rows], err_msg=name
        )
    np.testing.assert_array_equal(coarse.motions.relative, task.motions.relative[rows])
    # Where a boundary goes on beyond the node of two, that is none of its ends.
    _, some = fewer_nodes._with_every(2, [np.roll(line, 1) for line in lines], task, boundary)
    assert (some.x.max(axis=1) < 1e-9).sum() == 2


@pytest.mark.parametrize("degree", [1, 2])
def test_two_bodies(degree):
    """Condensed onto relative displacements, ends of both bodies moved: the answer of a factorisation, from half of the
    solves that contact everywhere takes; as many unknowns as one body has on a rigid foundation, and some at the ends.
    """
    counts = [n // degree for n in (320, 250)]
    low, high = (
        grid("quadrilateral", (counts[1], 2), (0, -0.1), (3, 0)),
        grid("quadrilateral", (counts[0], 2), (0, 0.001), (3, 0.101)),
    )
    heights = {"bottom": -0.1, "lower": 0.0, "upper": 0.001, "top": 0.101}
    marks = {name: lambda x, y=y: np.isclose(x[1], y, atol=1e-9) for name, y in heights.items()}
    marks |= {name: lambda x, at=at: np.isclose(x[0], at) for name, at in (("left", 0.0), ("right", 3.0))}
    tagged = tag_boundaries(assembled("quadrilateral", low, high), marks)

    def scene(start, kind):
        return parse_scene(
            {
                "mesh": tagged,
                "element": {"degree": degree},
                "material": {"young": 5000.0, "poisson": 0.4},
                "displacement": [
                    {"boundary": "left", "x": 0.0005},
                    {"boundary": "right", "x": 0.0},
                    {"boundary": "bottom", "x": 0.0, "y": 0.0},
                ],
                "traction": {"boundary": "top", "y": "-20 if 1 <= x[0] <= 2 else 0"},
                "contact": {
                    "boundary": "upper",
                    "against": "lower",
                    "gap": "0.003 * (x[0] - 1.5)**2",
                    "distance": "nominal",
                    "friction": {"law": "coulomb", "coefficient": 0.3},
                },
                "solver": {"linear_algebra": kind, "initial_contact": start, "tolerance": 1e-11},
            }
        )

    task, d = task_of(scene("auto", "condensed"))
    assert 0 <= task.system.contact.fixed.size - 2 * d.boundary.size <= 12
    plain, begun = (alone(scene(start, kind)) for start, kind in (("all", "full"), ("auto", "condensed")))
    assert begun.certificate.holds
    assert [event.split()[-1] for event in first_solves(begun)] == ["converged"] * 2
    assert begun.history.linear_solves <= plain.history.linear_solves / 2
    for name in ("pressure", "shear"):
        ours, theirs = (getattr(found.contact, name) for found in (begun, plain))
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-8 * plain.contact.pressure.max())
    far = np.abs(begun.displacement.x.array - plain.displacement.x.array).max()
    assert far <= 1e-9 * np.abs(plain.displacement.x.array).max()


@pytest.mark.parametrize("degree", [1, 2])
def test_a_support_at_a_point_between_two_bodies(degree):
    """Where a support holds a node with a point, the other body still slides past it: the answer of a factorisation."""
    low, high = (
        grid("quadrilateral", (10 // degree, 2), (0, -0.5), (3, 0)),
        grid("quadrilateral", (16 // degree, 2), (0, 0.001), (3, 0.501)),
    )
    marks = {
        name: lambda x, y=y: np.isclose(x[1], y, atol=1e-9)
        for name, y in {"bottom": -0.5, "lower": 0.0, "upper": 0.001, "top": 0.501}.items()
    }
    marks["left"] = lambda x: np.isclose(x[0], 0.0) & (x[1] > 0.0005)
    tagged = tag_boundaries(assembled("quadrilateral", low, high), marks)

    def solved(kind):
        data = {
            "mesh": tagged,
            "element": {"degree": degree},
            "material": {"young": 5000.0, "poisson": 0.3},
            "displacement": [{"boundary": "left", "x": 0.0}, {"boundary": "bottom", "x": 0.004, "y": 0.0}],
            "traction": {"boundary": "top", "y": -20.0},
            "contact": {
                "boundary": "upper",
                "against": "lower",
                "distance": "nominal",
                "friction": {"law": "tresca", "bound": 3.0},
            },
            "solver": {"linear_algebra": kind, "tolerance": 1e-11},
        }
        return alone(parse_scene(data))

    ours, plain = solved("condensed"), solved("full")
    assert ours.certificate.holds
    end = np.argmin(plain.contact.boundary.x[:, 0])
    assert plain.contact.in_contact[end]
    assert plain.contact.shear[end] != 0
    for name in ("pressure", "shear"):
        one, other = (getattr(found.contact, name) for found in (ours, plain))
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-8 * plain.contact.pressure.max())
    far = np.abs(ours.displacement.x.array - plain.displacement.x.array).max()
    assert far <= 1e-9 * np.abs(plain.displacement.x.array).max()
